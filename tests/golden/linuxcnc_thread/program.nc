(a thread of a turning machine with diameters, feed per turn, constant surface speed)
G21 G18 G7 G90 G95 F0.2
S500 M3
G0 X42 Z5
G1 X40
Z0
G76 P1.5 Z-6 I-1 J0.6 K0.92 Q29.5 H1 E0.5 L2
G0 X50
G96 D2000 S150
G1 X20
G97 S400
G33 Z-10 K2
M2
