#include <gtest/gtest.h>

#include "sim/dialects/dialect.h"

namespace abbe::sim::dialects {
namespace {

std::string taken(std::string_view text, std::string_view file = "part.nc") {
  const Recognised found = recognised(text, file);
  return std::string(name_of(found.dialect)) + ": " + found.sign;
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
  const std::string none = "linuxcnc: nothing in it is of another dialect";
  EXPECT_EQ(taken("G21 G43.4 H1\nG1 X1 F100\n"), none);
  EXPECT_EQ(taken("(M98 and TRAORI in a comment)\nG1 X1 ; G65\n"), none);
  EXPECT_EQ(taken("O100 sub\nG1 X1\nO100 endsub\n"), none);
  EXPECT_EQ(taken("#1=5\nG1 X#1\n"), none);
  EXPECT_EQ(taken("G650 M980 M991 AM98\n"), none);
  EXPECT_EQ(taken(""), none);
}

}  // namespace
}  // namespace abbe::sim::dialects
