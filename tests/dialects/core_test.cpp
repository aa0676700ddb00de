#include "kinematics/text.h"
#include "sim/dialects/expression.h"
#include "sim/dialects/linuxcnc/rs274.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects {
namespace {

constexpr Operator operators[] = {
    {"**", 3, [](double a, double b) { return std::pow(a, b); }},
    {"*", 2, [](double a, double b) { return a * b; }},
    {"/", 2, [](double a, double b) { return a / b; },
     [](double, double b) { return b == 0 ? "a nonzero divisor" : nullptr; }},
    {"+", 1, [](double a, double b) { return a + b; }},
    {"-", 1, [](double a, double b) { return a - b; }},
};
constexpr Function functions[] = {
    {"SQRT", [](double x) { return std::sqrt(x); },
     [](double x) { return x < 0 ? "a non-negative number" : nullptr; }},
};
const ExpressionGrammar grammar{operators, functions};

class NoOperands : public OperandParser {
 public:
  std::optional<double> parse_operand(Cursor& cursor) override {
    if (!cursor.accept("#1")) return std::nullopt;
    return 7.0;
  }
};

double evaluated(std::string_view text) {
  const std::string file = "t";
  Cursor cursor{text, {file, 3}};
  NoOperands none;
  const double result = parse_bracketed(cursor, grammar, none);
  EXPECT_TRUE(cursor.at_end()) << text;
  return result;
}

std::string core_refusal(std::string_view text) {
  return thrown_text<BadInput>([&] { evaluated(text); }, "accepted");
}

TEST(Expression, BindsByLevelAndFromTheLeft) {
  EXPECT_EQ(evaluated("[1 + 2 * 3]"), 7.0);
  EXPECT_EQ(evaluated("[8 - 3 - 2]"), 3.0);
  EXPECT_EQ(evaluated("[2 ** 3 ** 2]"), 64.0);
  EXPECT_EQ(evaluated("[2 * 3 ** 2]"), 18.0);
  EXPECT_EQ(evaluated("[[1 + 2] * 3]"), 9.0);
  EXPECT_EQ(evaluated("[-2 ** 2]"), 4.0);
  EXPECT_EQ(evaluated("[-#1]"), -7.0);
  EXPECT_EQ(evaluated("[1 - -#1]"), 8.0);
  EXPECT_EQ(evaluated("[sqrt[#1 + 2] / 2]"), 1.5);
}

TEST(Expression, RefusesWhatIsNone) {
  EXPECT_EQ(core_refusal("[1 / 0]"), "t:3:4: expected a nonzero divisor, seen /");
  EXPECT_EQ(core_refusal("[1 + ]"), "t:3:6: expected a number, seen ]");
  EXPECT_EQ(core_refusal("[1"), "t:3:3: expected ] or an operator, seen the end of the line");
  EXPECT_HAS(core_refusal(std::string(200, '[') + "1"), "100 nested brackets");
  EXPECT_HAS(core_refusal("[" + std::string(100000, '-') + "#1]"), "100 nested brackets");
  EXPECT_HAS(core_refusal("[10 ** 400]"), "finite");
  EXPECT_HAS(core_refusal("[sqrt[-1]]"), "non-negative");
  EXPECT_HAS(core_refusal("[99999999999]"), "1e9");
}

TEST(Variables, OfACallEndWithItAndTheirNumberIsLimited) {
  Variables variables(3);
  ASSERT_TRUE(variables.set(1, 2.0, Variables::Scope::Call));
  variables.enter();
  EXPECT_FALSE(variables.number(1, Variables::Scope::Call));
  ASSERT_TRUE(variables.set(1, 5.0, Variables::Scope::Call));
  ASSERT_TRUE(variables.set("x", 6.0));
  EXPECT_FALSE(variables.set(2, 1.0));
  EXPECT_TRUE(variables.set("x", 7.0));
  variables.leave();
  EXPECT_EQ(variables.number(1, Variables::Scope::Call), 2.0);
  EXPECT_EQ(variables.named("x"), 7.0);
  EXPECT_TRUE(variables.set(2, 1.0));
}

}  // namespace
}  // namespace abbe::sim::dialects

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
  for (const auto& entry : fs::recursive_directory_iterator(*packages / "usr/share")) {
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

// Text behind the end of a program: it is read on, or one line says which lines were not read.
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
