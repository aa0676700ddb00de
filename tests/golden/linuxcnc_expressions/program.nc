(parameters, expressions, a subprogram with arguments and a result)
G21 G90 F600
#31 = [2 ** 3 ** 2 / 8]        (64 / 8)
#<half> = [#31 / 2 MOD 3]      (4 MOD 3)
#<_wide> = [10 + ATAN[1]/[1]]  (55)
o<step> sub
  G1 X[#1] Y[#2 + #<_wide>]
  o<step> return [#1 + #2]
o<step> endsub
G1 X#31 Y#<half> Z-[ROUND[2.5] - FIX[-1.2]]
o<step> call [1] [2]
G0 X#<_value> Z[EXISTS[#<half>] + EXISTS[#<none>]]
X[5 GT 3 AND 2 LE 2] Y[SQRT[16] EQ 4 XOR 1]
M2
