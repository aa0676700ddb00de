G21 G91 F600
o1 repeat [2]
  o2 while [#1 LT 3]
    #1 = [#1 + 1]
    o3 if [#1 EQ 2]
      o2 continue
    o3 elseif [#1 GT 2]
      G1 Y1
    o3 else
      G1 X1
    o3 endif
  o2 endwhile
  #1 = 1
o1 endrepeat
o4 do
  G1 Z1
  #1 = [#1 - 1]
  o5 if [#1 LE 0]
    o4 break
  o5 endif
o4 while [1]
G90 G0 Z10
M2
