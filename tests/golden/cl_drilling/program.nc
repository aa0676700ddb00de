UNITS/MM
LOADTL/1
SPINDL/1500,RPM,CLW
FEDRAT/400,MMPM
RAPID
GOTO/0,0,50,0,0,1
$$ as ISO 4343 has it: depth below the point, clearance above it
CYCLE/DRILL,DEPTH,12,MMPM,150,CLEAR,2,DWELL,0.5
GOTO/10,0,0
GOTO/20,0,0
$$ a higher place: up first
GOTO/30,0,8
CYCLE/OFF
$$ as NX posts it; back to 5 above the point
CYCLE/DRILL,RAPTO,3.0000,FEDTO,-8.0000,RTRCTO,5.0000,MMPR,0.1
GOTO/40,0,0
$$ along a leaning tool axis
GOTO/50,0,0,0,0.6,0.8
CYCLE/OFF
GOTO/50,10,10
FINI
