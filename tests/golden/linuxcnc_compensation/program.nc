(around a square with a corner inside, left of it, radius 3 mm)
G21 G90 G17 F600
G0 X-20 Y-20 Z5
G41.1 D6
G1 X0 Y0
G1 Y40
X40
Y20
X20
G3 X10 Y10 I0 J-10
G1 X10 Y0
X-10
G40
G0 X-20 Y-20
M2
