UNITS/MM
LOADTL/1
FEDRAT/600
RAPID
GOTO/10,0,5
GOTO/10,0,0
$$ seven values: counter-clockwise about the vector, here a quarter about z
CIRCLE/0,0,0, 0,0,1, 10
GOTO/0,10,0
$$ still on it: a second arc of the same circle; the third point leaves it
GOTO/-10,0,0
GOTO/-20,0,0
$$ clockwise: the vector down
CIRCLE/-20,10,0,0,0,-1,10
GOTO/-30,10,0
$$ eleven values, as NX posts them: clockwise about the vector, for one point
CIRCLE/-20,10,0,0,0,1,10,0.0600,0.5000,12,0
GOTO/-20,20,0
GOTO/-10,10,0
$$ a whole circle, a helix of a quarter, an arc about x and one about y
CIRCLE/-20,10,0,0,0,-1,10,0.0600,0.5000,12,0
GOTO/-10,10,0
CIRCLE/-20,10,0,0,0,1,10
GOTO/-20,20,-4
CIRCLE/-20,20,0,1,0,0,4
GOTO/-20,24,0
CIRCLE/-20,24,4,0,1,0,4
GOTO/-24,24,4
$$ in a plane of its own: about 0.6 0 0.8, from 4 along y to 4 along 0.8 0 -0.6
GOTO/0,4,0
CIRCLE/0,0,0,0.6,0,0.8,4
GOTO/-3.2,0,2.4
$$ by its angle, two turns and a quarter
MOVARC/0,0,0,0.6,0,0.8,4,ANGLE,810
GOTO/0,-4,0
$$ the tool leans while it goes round
CIRCLE/0,0,0,0,0,-1,4
GOTO/-4,0,0,0,0.6,0.8
FINI
