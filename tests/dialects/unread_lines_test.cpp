// Text behind the end of a program: it is read on, or one line says which lines were not read.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"

namespace abbe::sim::dialects::unread_tests {
namespace {

namespace machines = program::test;

ParsedProgram read_lines(const std::string& text, Dialect dialect) {
  ReadOptions options;
  options.control = machines::options_for(machines::gantry());
  options.dialect = dialect;
  return read_program(text, "part.nc", options);
}

std::vector<std::string> unread(const std::string& text, Dialect dialect) {
  std::vector<std::string> found;
  for (const std::string& warning : read_lines(text, dialect).warnings)
    if (warning.find("not read") != std::string::npos ||
        warning.find("is ignored") != std::string::npos)
      found.push_back(warning);
  return found;
}

TEST(UnreadLines, BehindTheEndAreSaidInOneLine) {
  struct Case {
    Dialect dialect;
    std::string text, said;
  };
  const Case cases[] = {
      {Dialect::Fanuc, "O1\nG21 G1 X10. F100.\nM30\nX20.\nX30.\n%\n",
       "part.nc:4: 2 lines from 'X20.' on are not read: the program ends on line 3"},
      {Dialect::Fanuc, "%\nO1\nG21 G1 X10. F100.\nM30\n%\n(NOTE)\nO2\nX20.\nM30\n%\n",
       "part.nc:7: 3 lines from 'O2' on are not read: the program ends on line 4"},
      {Dialect::Fanuc, "O1\nG21 G1 X10. F100.\nM98 P3\nM30\nO2\nX20.\nM99\nO3\nX40.\nM99\n",
       "part.nc:5: 3 lines from 'O2' on are not read: the program ends on line 4"},
      {Dialect::Fanuc, "% G1 X5.\nO1\nG21 G1 X10. F100.\nM30\n",
       "part.nc:1: '% G1 X5.' on the line of % is ignored"},
      {Dialect::LinuxCnc, "G21 G1 X10 F100\nM2\n(end)\nG1 X20\n",
       "part.nc:4: the line from 'G1 X20' on is not read: the program ends on line 2"},
      {Dialect::LinuxCnc, "%\n%\nG21 G1 X10 F100\n%\n",
       "part.nc:3: the line from 'G21 G1 X10 F100' on is not read: the program ends on line 2"},
      {Dialect::Siemens, "G71 G1 X10 F100\nM30\nX20\n%_N_OTHER_SPF\nX30\nM17\n",
       "part.nc:3: 3 lines from 'X20' on are not read: the program ends on line 2"},
      {Dialect::Heidenhain,
       "BEGIN PGM A MM\nTOOL CALL 1 Z S100\nL X+10 R0 F100\nM30\nLBL 1\nL X+20\nLBL 0\nEND PGM A "
       "MM\n",
       "part.nc:5: 2 lines from 'LBL 1' on are not read: the program ends on line 4"},
      {Dialect::Heidenhain,
       "BEGIN PGM A MM\nTOOL CALL 1 Z S100\nL X+10 R0 F100\nEND PGM A MM\nBEGIN PGM B MM\nL X+20\n",
       "part.nc:5: 2 lines from 'BEGIN PGM B MM' on are not read: the program ends on line 4"},
      {Dialect::Cl, "UNITS/MM\nFEDRAT/100,MMPM\nGOTO/1,2,3\nFINI\n$$ end\nGOTO/4,5,6\n",
       "part.nc:6: the line from 'GOTO/4,5,6' on is not read: the program ends on line 4"},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.text);
    EXPECT_EQ(unread(one.text, one.dialect), std::vector<std::string>{one.said});
  }
}

TEST(UnreadLines, NothingIsSaidOfWhatRunsOrIsNoText) {
  const std::pair<Dialect, std::string> cases[] = {
      {Dialect::Fanuc, "%\nO1\nG21 G1 X10. F100.\nM98 P2\nM30\n\nO2\nX20.\nM99\n%\n\n(END)\n"},
      {Dialect::Fanuc, "O1\nG21 G1 X10. F100.\nIF[#1GT5]GOTO9\nM30\nN9 #3000=1(WRONG)\n"},
      {Dialect::LinuxCnc, "G21 G1 X10 F100\no<a> call\nM2\no<a> sub\nX20\no<a> endsub\n; end\n"},
      {Dialect::Siemens, "G71 G1 X10 F100\nSUB\nM30\n; end\n%_N_SUB_SPF\nX20\nM17\n"},
      {Dialect::Heidenhain,
       "BEGIN PGM A MM\nTOOL CALL 1 Z S100\nL X+10 R0 F100\nCALL LBL 1\nM30\nLBL 1\nL X+20\nLBL "
       "0\nEND PGM A MM\n"},
      {Dialect::Cl, "UNITS/MM\nFEDRAT/100,MMPM\nGOTO/1,2,3\nFINI\n$$ end\n"},
  };
  for (const auto& [dialect, text] : cases) {
    SCOPED_TRACE(text);
    EXPECT_EQ(unread(text, dialect), std::vector<std::string>{});
  }
}

TEST(UnreadLines, AFanucProgramBehindADoubledPercentIsRead) {
  const ParsedProgram read =
      read_lines("%\n%\nO1000\nG21 G90\nG1 X10. F100.\nX20.\nM30\n%\n", Dialect::Fanuc);
  ASSERT_EQ(read.path.motion_blocks, 2u);
  EXPECT_EQ(read.path.blocks.back().end[1], 20.0);
}

TEST(UnreadLines, APercentBehindWordsEndsAFanucProgramThatBeginsWithoutOne) {
  const std::string text = "O1\nG21 G90 G0 X10.\n%\nG0 X20.\nM30\n";
  EXPECT_EQ(read_lines(text, Dialect::Fanuc).path.motion_blocks, 1u);
  EXPECT_EQ(
      unread(text, Dialect::Fanuc),
      std::vector<std::string>{"part.nc:4: 2 lines from 'G0 X20.' on are not read: the program "
                               "ends on line 2"});
}

}  // namespace
}  // namespace abbe::sim::dialects::unread_tests
