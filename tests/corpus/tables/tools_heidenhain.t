BEGIN TOOL    .T MM
T     NAME            L           R         R2        DL      DR      CUT
1     BALL 10         +80         +5        +5        +0.005  +.005   2
5.1   INDEX           +10         +1
20                    -5.5        3
[END]
