# x y z of the tip, the tool axis, feed in mm/min
k; j; i; z_mm; y_mm; x_mm; feed
1; 0; 0; 50; 0; 0;
1; 0; 0; 10; 0; 5; rapid
1; 0; 0; 0; 0; 5; 300
0.8; 0.6; 0; 0; 0; 10; 600
0.8; 0.6; 0; 0; 8; 10;
0.8; 0; 0.6; 0; 8; 10;
