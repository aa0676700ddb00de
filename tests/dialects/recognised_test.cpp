#include <filesystem>

#include <gtest/gtest.h>

#include "kinematics/text.h"
#include "sim/dialects/linuxcnc/rs274.h"
#include "sim/dialects/read_options.h"

namespace abbe::sim::dialects {
namespace {

std::string taken(std::string_view text, std::string_view file = "part.nc") {
  const DetectedDialect detected = detect_dialect(text, file);
  return std::string(name_of(detected.dialect)) + ": " + detected.evidence;
}

TEST(Recognised, BySignsThatOneDialectAloneHas) {
  EXPECT_EQ(taken("%\nO1001 (PART)\nG21\n"), "fanuc: line 2 has a program number O");
  EXPECT_EQ(taken("G21\nG65 P9810 Z1\n"), "fanuc: line 2 has G65");
  EXPECT_EQ(taken("N10 G0 X1\nN20 TRAORI\n"), "siemens: line 2 has TRAORI");
  EXPECT_EQ(taken("N10 R1=5\n"), "siemens: line 1 has R1=");
  EXPECT_EQ(taken("G1 X=R1+5\n"), "siemens: line 1 has X=");
  EXPECT_EQ(taken("0 BEGIN PGM PART MM\n"), "heidenhain: line 1 has BEGIN PGM");
  EXPECT_EQ(taken("$$ made\nGOTO/1,2,3\n"), "cl: line 1 has $$");
  EXPECT_EQ(taken("PARTNO X\n"), "cl: line 1 has PARTNO");
  EXPECT_EQ(taken("x,y,z,i,j,k,feed\n1,2,3,0,0,1,100\n", "a.csv"), "cl: line 1 has X,Y,Z");
  EXPECT_EQ(taken("G21 G64 P0.01\n"), "linuxcnc: line 1 has G64 P");
  EXPECT_EQ(taken("o<drill> sub\n"), "linuxcnc: line 1 has O<");
  EXPECT_EQ(taken("G0 X1\n", "a.MPF"), "siemens: the file is named .MPF");
}

TEST(Recognised, WhatHasNoSignIsLinuxCnc) {
  const std::string none = "linuxcnc: no word identifies another dialect";
  EXPECT_EQ(taken("G21 G43.4 H1\nG1 X1 F100\n"), none);
  EXPECT_EQ(taken("(M98 and TRAORI in a comment)\nG1 X1 ; G65\n"), none);
  EXPECT_EQ(taken("#1=5\nG1 X#1\n"), none);
  EXPECT_EQ(taken("G650 M980 M991 AM98\n"), none);
  EXPECT_EQ(taken(""), none);
}

TEST(Recognised, OWordsOfLinuxCncAreNoWordsOfAnother) {
  for (const char* line :
       {"O110 if [#2 gt 0]", "O110 endif", "  o3   endif", "o1010    return [123*[#1]]", "o100 sub",
        "N10 o5 while [1]", "O[#1] call", "o#1 call", "o100endsub", "o1 repeat [5]", "o 1 do"})
    EXPECT_EQ(taken(std::string("G20\n") + line + "\n"), "linuxcnc: line 2 has an O word") << line;
  EXPECT_EQ(taken("O0110\nIF[#2GT0]GOTO5\n"), "fanuc: line 1 has a program number O");
  EXPECT_EQ(taken("IF R1==1\nG1 X1\nENDIF\n"), "siemens: line 1 has R1==");
  EXPECT_EQ(taken("IF R1 > 1\nG1 X1\nENDIF\n"), "siemens: line 3 has ENDIF");
}

TEST(Recognised, OneDialectForEachSnippet) {
  const std::pair<const char*, const char*> snippets[] = {
      {"linuxcnc", "G21\no<face> call [10] [20]\n"},
      {"linuxcnc", "M70\nG64 P0.01\nM72\n"},
      {"linuxcnc", "#<depth> = 5\nG1 Z[-#<depth>] F100\n"},
      {"linuxcnc", "G59.3\nG0 X0\n"},
      {"linuxcnc", "S1000 M3 $0\n"},
      {"linuxcnc", "#1=0 #2=5\nG1 X#1 F100\n"},
      {"fanuc", "%\nO0001(PART)\nG90 G54\nM30\n%\n"},
      {"fanuc", "N10 G65 P9010 A1. B2.\n"},
      {"fanuc", "M98 P1000 L3\n"},
      {"fanuc", "G05.1 Q1\nG1 X1. F100.\n"},
      {"fanuc", "G68.2 X0 Y0 Z0 I0 J0 K0\n"},
      {"siemens", "N10 G54 TRAORI\n"},
      {"siemens", "R10=5 R11=R10+1\n"},
      {"siemens", "DEF REAL DEPTH\n"},
      {"siemens", "LOOP\nG1 X=5\nENDLOOP\n"},
      {"siemens", "MCALL CYCLE81(10,0,1,-5)\n"},
      {"heidenhain", "0 BEGIN PGM 1 MM\n1 L X+0 R0 FMAX\n"},
      {"heidenhain", "5 TOOL CALL 3 Z S1000\n"},
      {"heidenhain", "7 CYCL DEF 7.0 DATUM SHIFT\n"},
      {"cl", "PARTNO A\nGOTO/1,2,3\n"},
      {"cl", "UNITS/MM\nLOADTL/1\n"},
  };
  for (const auto& [dialect, text] : snippets)
    EXPECT_EQ(taken(text).substr(0, taken(text).find(':')), dialect) << text;
}

TEST(Recognised, EveryProgramThatComesWithLinuxCncIsOneOfLinuxCnc) {
  const auto packages = find_linuxcnc();
  if (!packages) GTEST_SKIP() << "no LinuxCNC: ./abbe setup --linuxcnc";
  int programs = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(*packages / "usr/share")) {
    if (entry.path().extension() != ".ngc" || !entry.is_regular_file()) continue;
    const DetectedDialect detected =
        detect_dialect(read_text(entry.path(), 1 << 28), entry.path().string());
    EXPECT_EQ(name_of(detected.dialect), "linuxcnc") << entry.path() << ": " << detected.evidence;
    ++programs;
  }
  std::cout << programs << " programs\n";
  EXPECT_GE(programs, 56);
}

}  // namespace
}  // namespace abbe::sim::dialects
