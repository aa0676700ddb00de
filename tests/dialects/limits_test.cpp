// What a program may ask of its reader: how deep it nests, how many moves it makes, in which
// encoding it stands, and what of its input errors is said.

#include "kinematics/text.h"
#include "sim/dialects/read_options.h"
#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"
#include "tests/test.h"

namespace abbe::sim::dialects {
namespace {

namespace machines = program::test;

ReadOptions limits_options(Dialect dialect) {
  ReadOptions options;
  options.control = machines::options_for(machines::gantry());
  options.control.tool_radius = {{1, 3.0}};
  options.dialect = dialect;
  return options;
}

std::vector<BadInput> errors_of(const std::string& text, const ReadOptions& options) {
  try {
    read_program(text, "part", options);
  } catch (const BadProgram& bad) {
    return bad.input_errors;
  } catch (const BadInput& bad) {
    return {bad};
  }
  return {};
}

std::string repeated(const std::string& text, int n) {
  std::string all;
  for (int i = 0; i < n; ++i) all += text;
  return all;
}

struct Nested {
  Dialect dialect;
  std::string before, level, behind = {};  ///< level again and again between the two
  std::string closing = {};                ///< as often, behind `behind`
};

const std::vector<Nested>& nested() {
  using enum Dialect;
  static const std::vector<Nested> all = {
      {LinuxCnc, "X", "["},
      {LinuxCnc, "X[", "-", "#1]"},
      {LinuxCnc, "X", "#", "1"},
      {LinuxCnc, "", "#", "1=5"},
      {LinuxCnc, "#5=", "#", "1"},
      {LinuxCnc, "X", "#["},
      {LinuxCnc, "X", "SIN["},
      {LinuxCnc, "X", "ATAN[1]/["},
      {LinuxCnc, "X", "ATAN["},
      {LinuxCnc, "X[1", "+[1"},
      {LinuxCnc, "X[2", "**-#[1"},
      {LinuxCnc, "o", "#", "1 call"},
      {LinuxCnc, "o1 if [", "["},
      {LinuxCnc, "o1 while ", "["},
      {LinuxCnc, "o<a> call [", "#", "1]"},
      {LinuxCnc, "G", "#", "1"},
      {Fanuc, "#1=", "["},
      {Fanuc, "#1=", "-[", "1"},
      {Fanuc, "#1=", "#["},
      {Fanuc, "", "#["},
      {Fanuc, "X", "SIN["},
      {Fanuc, "X", "ROUND["},
      {Fanuc, "X", "ATAN["},
      {Fanuc, "X", "ATAN[1]/["},
      {Fanuc, "X", "POW["},
      {Fanuc, "X", "POW[1,"},
      {Fanuc, "IF", "["},
      {Fanuc, "WHILE", "["},
      {Fanuc, "GOTO", "#["},
      {Fanuc, "G65 P", "#["},
      {Siemens, "R1=", "("},
      {Siemens, "R1=", "-", "R2"},
      {Siemens, "R1=", "R["},
      {Siemens, "", "R["},
      {Siemens, "R1=", "NOT ", "1"},
      {Siemens, "R1=", "B_NOT ", "1"},
      {Siemens, "X=", "SIN("},
      {Siemens, "X=IC", "("},
      {Siemens, "R1=", "ATAN2("},
      {Siemens, "R1=", "MINVAL(1,"},
      {Siemens, "R1=", "BOUND(0,1,"},
      {Siemens, "IF ", "("},
      {Siemens, "CYCLE81", "("},
      {Siemens, "DEF REAL AB[", "("},
      {Heidenhain, "Q1 = ", "("},
      {Heidenhain, "Q1 = ", "-", "Q2"},
      {Heidenhain, "Q1 = ", "SIN "},
      {Heidenhain, "Q1 = ", "SQRT -"},
      {Heidenhain, "Q1 = ", "NEG ("},
      {Heidenhain, "FN 0: Q1 = ", "-", "Q2"},
      {Heidenhain, "L X", "-", "Q2"},
      {Heidenhain, "CYCL DEF 200 Q200=", "-", "Q2"},
      {Cl, "GOTO/", "("},
  };
  return all;
}

TEST(ProgramLimits, WhateverNestsEndsInOneErrorWithItsPlace) {
  for (const Nested& one : nested()) {
    // a line of Siemens has 4096 characters at most; its definitions are read before that is asked
    for (const int depth : {max_nesting + 20, 200'000}) {
      const std::string text = one.before + repeated(one.level, depth) + one.behind;
      SCOPED_TRACE(std::string(name_of(one.dialect)) + ": " + one.before + one.level);
      const auto errors = errors_of("\n" + text + "\n", limits_options(one.dialect));
      ASSERT_EQ(errors.size(), 1u);
      EXPECT_EQ(errors[0].line, 2);
      EXPECT_GE(errors[0].column, 1);
      EXPECT_LT(errors[0].expected.size(), 300u);
    }
  }
}

TEST(ProgramLimits, WhatIsNotTooDeepIsRead) {
  for (const auto& [dialect, text] : std::vector<std::pair<Dialect, std::string>>{
           {Dialect::LinuxCnc, "X" + repeated("#", max_nesting - 2) + "1\n"},
           {Dialect::LinuxCnc, "G0 X" + repeated("[", 90) + "1" + repeated("]", 90) + "\n"},
           {Dialect::Siemens, "R1=" + repeated("(", 90) + "1" + repeated(")", 90) + "\n"},
           {Dialect::Siemens, "R1=" + repeated("NOT ", 90) + "1\n"},
           {Dialect::Heidenhain, "Q1 = " + repeated("SIN ", 90) + "1\n"},
           {Dialect::Fanuc, "#1=" + repeated("#[", 90) + "1" + repeated("]", 90) + "\n"}}) {
    for (const BadInput& error : errors_of(text, limits_options(dialect)))
      EXPECT_EQ(error.expected.find("nested"), std::string::npos) << error.what();
  }
}

TEST(ProgramLimits, LoopsLabelsAndCallsOfAnyDepthEnd) {
  const int n = 200'000;
  std::string ifs, repeats, siemens, labels;
  for (int i = 0; i < n; ++i) ifs += fmt::format("o{} if [1]\n", i + 1);
  for (int i = 0; i < n; ++i) repeats += fmt::format("o{} repeat [2]\n", i + 1);
  for (int i = 0; i < n; ++i) siemens += "IF 1\n";
  for (int i = 0; i < n; ++i) labels += fmt::format("LBL {}\n", i % 60000 + 1);
  errors_of(ifs, limits_options(Dialect::LinuxCnc));
  const auto too_many = errors_of(repeats, limits_options(Dialect::LinuxCnc));
  ASSERT_FALSE(too_many.empty());
  EXPECT_HAS(too_many[0].expected, "nested");
  EXPECT_FALSE(errors_of(siemens, limits_options(Dialect::Siemens)).empty());
  errors_of(labels, limits_options(Dialect::Heidenhain));
  for (const auto& [dialect, text] : std::vector<std::pair<Dialect, std::string>>{
           {Dialect::LinuxCnc, "o<a> sub\no<a> call\no<a> endsub\no<a> call\n"},
           {Dialect::Fanuc, "O1\nM98 P1\nM30\n"},
           {Dialect::Fanuc, "O1\nG65 P1\nM30\n"},
           {Dialect::Siemens, "UP\nM30\n%_N_UP_SPF\nUP\nM17\n"},
           {Dialect::Heidenhain, "LBL 1\nCALL LBL 1\nLBL 0\n"}}) {
    const auto errors = errors_of(text, limits_options(dialect));
    ASSERT_FALSE(errors.empty()) << text;
    EXPECT_HAS(errors[0].expected, "nested calls") << errors[0].what();
  }
}

struct Many {
  Dialect dialect;
  std::string text;
  int line = 0;  ///< of the block that asks for too much
};

/// Every cycle and repeat of every dialect that makes many moves of few lines.
std::vector<Many> many() {
  using enum Dialect;
  const std::string klartext = "TOOL CALL 1 Z S1000 F100\nL X+0 Y+0 Z+20 R0 FMAX M3\n";
  const auto cycle = [&](const std::string& words) {
    return klartext + "CYCL DEF " + words + " Q203=+0 Q204=+10\nCYCL CALL\n";
  };
  return {
      {LinuxCnc, "F100 M3 S100\nG98 G83 X0 Y0 Z-10 R1 Q0.001\n", 2},
      {LinuxCnc, "F100 M3 S100\nG98 G73 X0 Y0 Z-10 R1 Q0.001\n", 2},
      {LinuxCnc, "F100 M3 S100\nG91 G81 X1 Z-1 R1 L1000000\n", 2},
      {LinuxCnc, "F100 M3 S100\nG91 G83 X1 Z-100 R1 Q0.01 L1000000\n", 2},
      {LinuxCnc, "F100\no1 repeat [1000000]\nG91 G1 X1\nX-1\no1 endrepeat\n", 0},
      {LinuxCnc, "F100\no1 while [1]\nG91 G1 X1\nX-1\no1 endwhile\n", 0},
      {LinuxCnc, "F100\no1 do\nG91 G1 X1\nX-1\no1 while [1]\n", 0},
      {LinuxCnc,
       "F100\no<a> sub\nG91 G1 X1\nX-1\no<a> endsub\no1 repeat [1000000]\no<a> call\no1 "
       "endrepeat\n",
       0},
      {LinuxCnc, "F100 G17\nG5 I100000 J0 P-100000 Q0 X100000 Y100000\n", 2},
      {LinuxCnc, "F100 G17\nG5.2 X1 Y1 P1 L3\nX90000 Y0 P1\nX0 Y90000 P1\nX90000 Y90000 P1\nG5.3\n",
       6},
      {Fanuc, "G99 F100 M3 S100\nG83 X0 Y0 Z-10. R1. Q0.001 G98\n", 0},
      {Fanuc, "M3 S100\nG91 G81 X1. Z-1. R1. K1000000 F100.\n", 2},
      {Fanuc, "M3 S100\nG91 G83 X1. Z-10. R1. Q0.1 L1000000 F100.\n", 2},
      {Fanuc, "O1\nM98 P2 L99999999\nM30\nO2\nG91 G1 X1. F100.\nX-1.\nM99\n", 0},
      {Fanuc, "O1\nG65 P2 L99999999\nM30\nO2\nG91 G1 X1. F100.\nX-1.\nM99\n", 0},
      {Fanuc, "O1\nWHILE[1]DO1\nG91 G1 X1. F100.\nX-1.\nEND1\nM30\n", 0},
      {Fanuc, "O1\nN1 G91 G1 X1. F100.\nX-1.\nGOTO1\n", 0},
      {Siemens, "F100 S100 M3\nCYCLE83(10,0,1,-9,,,0.001,0.001,0,0,1,1)\n", 2},
      {Siemens, "F100 G91 G1\nA1: X1\nX-1\nREPEAT A1 P=9999\n", 0},
      {Siemens, "F100 G91 G1\nLOOP\nX1\nX-1\nENDLOOP\n", 0},
      {Siemens, "F100 G91 G1\nR1=0\nFOR R1=0 TO 1000000\nX1\nX-1\nENDFOR\n", 0},
      {Siemens, "F100 G91 G1\nWHILE 1\nX1\nX-1\nENDWHILE\n", 0},
      {Siemens, "F100 G91 G1\nREPEAT\nX1\nX-1\nUNTIL 0\n", 0},
      {Siemens, "UP P9999\nM30\n%_N_UP_SPF\nG91 G1 F100 X1\nX-1\nM17\n", 0},
      {Heidenhain, cycle("200 Q200=+2 Q201=-10 Q206=+100 Q202=+0.001 Q210=+0"), 4},
      {Heidenhain, cycle("203 Q200=+2 Q201=-10 Q206=+100 Q202=+0.001"), 4},
      {Heidenhain, cycle("205 Q200=+2 Q201=-10 Q206=+100 Q202=+0.001"), 4},
      {Heidenhain, cycle("205 Q200=+2 Q201=-10 Q206=+100 Q202=+10 Q257=+0.001"), 4},
      {Heidenhain, klartext + "LBL 1\nL IX+1\nL IX-1\nCALL LBL 1 REP 65534\n", 0},
  };
}

TEST(ProgramLimits, MovesOfCyclesAndRepeatsCount) {
  for (const Many& one : many()) {
    SCOPED_TRACE(std::string(name_of(one.dialect)) + ": " + one.text);
    ReadOptions options = limits_options(one.dialect);
    options.control.max_moves = options.limits.blocks = 5000;
    const auto errors = errors_of(one.text, options);
    ASSERT_EQ(errors.size(), 1u);
    EXPECT_HAS(errors[0].expected, "max_moves") << errors[0].what();
    EXPECT_GE(errors[0].line, 1);
    if (one.line > 0) {
      EXPECT_EQ(errors[0].line, one.line);
    }
  }
}

TEST(ProgramLimits, WhatACycleWouldMakeIsKnownBeforeItMakesIt) {
  // 3e11 moves of four lines
  const auto begin = std::chrono::steady_clock::now();
  const auto errors = errors_of("F100 M3 S100\nG91\nG83 X1 Z-100 R1 Q0.0011 L1000000\nM2\n",
                                limits_options(Dialect::LinuxCnc));
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_EQ(errors[0].line, 3);
  std::cout << errors[0].what() << ", after " << seconds << " s\n";
  EXPECT_LT(seconds, 0.2);
}

TEST(ProgramLimits, MemoryOfMovesIsALimitOfItsOwn) {
  ReadOptions options = limits_options(Dialect::LinuxCnc);
  options.control.max_move_bytes = 1'000'000;
  for (const char* text : {"F100 M3 S100\nG83 X0 Y0 Z-10 R1 Q0.001\n",
                           "F100\no1 repeat [1000000]\nG91 G1 X1\nX-1\no1 endrepeat\n"}) {
    const auto errors = errors_of(text, options);
    ASSERT_EQ(errors.size(), 1u) << text;
    EXPECT_HAS(errors[0].expected, "1 MB") << errors[0].what();
  }
  // of what is given away as it is made nothing is kept
  std::size_t moves = 0;
  options.on_path_segment = [&](program::Path piece) { moves += piece.blocks.size(); };
  options.control.max_move_bytes = std::size_t(64) << 20;
  EXPECT_TRUE(
      errors_of("F100\no1 repeat [200000]\nG91 G1 X1\nX-1\no1 endrepeat\n", options).empty());
  EXPECT_EQ(moves, 400'000u);
}

TEST(ProgramErrors, ThatOnlyFollowFromADefinitionAreLeftOut) {
  using enum Dialect;
  const std::string klartext = "TOOL CALL 1 Z S1000 F100\nL X+0 Y+0 Z+20 R0 FMAX M3\n";
  for (const auto& [dialect, text] : std::vector<std::pair<Dialect, std::string>>{
           {LinuxCnc, "F100\n#<a> = [1/0]\nG1 X#<a>\nY#<a>\n#<b> = [#<a> + 1]\nX#<b>\n"},
           {LinuxCnc, "F100\n#100 = [1/0]\nG1 X[1/#100]\nY[1/#100]\n"},
           {LinuxCnc, "F100\n#<a> = 5 X[1/0]\nG1 X#<a>\n"},
           {LinuxCnc, "F100\nG81 X1 Y1 Z-5\nX2\nX3\nX4\n"},
           {LinuxCnc, "o<no> call\no<no> call\no<no> call\n"},
           {LinuxCnc, "G1 F[1/0]\nX1\nX2\n"},
           {LinuxCnc, "G1 X1\nX2\nX3\n"},
           {Fanuc, "O1\n#100=[1/0]\nG1 X#100 F100.\nX[1/#100]\n"},
           {Fanuc, "O1\nG99 G81 X1. Y1. Z-5. F100.\nX2.\nX3.\n"},
           {Fanuc, "O1\nM98 P7\nM98 P7\nM98 P7\n"},
           {Siemens, "R1=1/0\nG1 X=R1 F100\nY=1/R1\n"},
           {Siemens, "DEF REAL AB=(, CD\nAB=5\nCD=6\nG1 X=AB+CD F100\n"},
           {Siemens, "GOTOF NO\nGOTOF NO\n"},
           {Heidenhain, "Q1 = 1 / 0\nL X+Q1 F100\nQ2 = Q1 + 1\nL X+Q2\n"},
           {Heidenhain, "FN 4: Q1 = 1 DIV 0\nL X+Q1 F100\n"},
           {Heidenhain, klartext + "CYCL DEF 200 Q200=+2 Q201=-10\nL X+5 FMAX M99\nCYCL CALL\n"},
           {Heidenhain, klartext + "CYCL DEF 252\nL X+5 FMAX M99\nL X+6 FMAX M99\n"},
           {Heidenhain, "CALL LBL 7\nCALL LBL 7\n"}}) {
    SCOPED_TRACE(std::string(name_of(dialect)) + ": " + text);
    const auto errors = errors_of(text, limits_options(dialect));
    std::string all;
    for (const BadInput& error : errors) all += std::string(error.what()) + "\n";
    EXPECT_EQ(errors.size(), 1u) << all;
  }
  // what is set again is certain again, and an error of its own is said
  EXPECT_EQ(
      errors_of("F100\n#<a> = [1/0]\n#<a> = 0\nG1 X[1/#<a>]\n", limits_options(LinuxCnc)).size(),
      2u);
  EXPECT_EQ(errors_of("G93 G1 X1\nX2\n", limits_options(LinuxCnc)).size(), 2u)
      << "every block needs its own F";
}

TEST(ProgramEncoding, IsOneErrorThatNamesIt) {
  const std::string plain = "G21 G90\nG1 X1 F100\nG1 X2\nG1 X3\nM2\n";
  const auto wide = [&](bool big) {
    std::string text;
    for (const char c : plain) text += big ? std::string{'\0', c} : std::string{c, '\0'};
    return text;
  };
  std::string ebcdic;
  for (const char c : plain)
    ebcdic += c == '\n'              ? '\x15'
              : c == ' '             ? '\x40'
              : c >= '0' && c <= '9' ? char(0xf0 + (c - '0'))
              : c >= 'A' && c <= 'I' ? char(0xc1 + (c - 'A'))
              : c >= 'J' && c <= 'R' ? char(0xd1 + (c - 'J'))
                                     : char(0xe2 + (c - 'S'));
  std::string binary(4000, 'x');
  for (std::size_t i = 0; i < binary.size(); i += 3) binary[i] = char(i % 31);
  for (const auto& [text, name] : std::vector<std::pair<std::string, std::string>>{
           {"\xff\xfe" + wide(false), "UTF-16"},
           {"\xfe\xff" + wide(true), "UTF-16"},
           {wide(false), "UTF-16, little"},
           {wide(true), "UTF-16, big"},
           {std::string("\xff\xfe\0\0G\0\0\0", 8), "UTF-32"},
           {ebcdic, "EBCDIC"},
           {binary, "binary"}})
    for (const Dialect dialect : {Dialect::Auto, Dialect::LinuxCnc, Dialect::Fanuc,
                                  Dialect::Siemens, Dialect::Heidenhain, Dialect::Cl}) {
      const auto errors = errors_of(text, limits_options(dialect));
      ASSERT_EQ(errors.size(), 1u) << name;
      EXPECT_HAS(errors[0].seen, name) << errors[0].what();
    }
  const std::string umlauts = "\xc4X1\n\xd6X2\n\xdcX3\n";
  const auto latin = errors_of(umlauts, limits_options(Dialect::LinuxCnc));
  ASSERT_EQ(latin.size(), 1u);
  EXPECT_HAS(latin[0].seen, "Latin-1") << latin[0].what();
  EXPECT_TRUE(
      errors_of("(\xc4\xd6\xdc)\nG1 X1 F100\n(\xdf)\n", limits_options(Dialect::LinuxCnc)).empty())
      << "a comment may have any letters";
}

TEST(ProgramEncoding, WhatMovesATapeIsWhiteSpace) {
  const std::vector<std::pair<Dialect, std::string>> programs = {
      {Dialect::LinuxCnc, "%\nG21 G90\nG1 X10 F100\nX20\n%\n"},
      {Dialect::Fanuc, "%\nO1\nG21 G90\nG1 X10. F100.\nX20.\nM30\n%\n"},
      {Dialect::Siemens, "G71 G90\nG1 X10 F100\nX20\nM30\n"},
      {Dialect::Heidenhain,
       "0 BEGIN PGM A MM\n1 TOOL CALL 1 Z S100 F100\n2 L X+10 R0 F100\n3 END PGM A MM\n"},
      {Dialect::Cl, "UNITS/MM\nFEDRAT/100,MMPM\nGOTO/1,2,3\nGOTO/2,2,3\nFINI\n"}};
  for (const auto& [dialect, text] : programs) {
    const ParsedProgram wanted = read_program(text, "part", limits_options(dialect));
    for (const std::string end : {"\r\n", "\n\r\r", "\r\r\n"}) {
      std::string tape(40, '\0');
      for (const char c : text) tape += c == '\n' ? end : std::string(1, c);
      tape += "\r\r";
      tape.append(40, '\0');
      const ParsedProgram read = read_program(tape, "part", limits_options(dialect));
      ASSERT_EQ(read.path.blocks.size(), wanted.path.blocks.size()) << name_of(dialect);
      for (std::size_t i = 0; i < read.path.blocks.size(); ++i)
        EXPECT_EQ(read.path.blocks[i].line, wanted.path.blocks[i].line);
    }
  }
}

/// A control reads lines that end in CR alone as one block, LinuxCNC `G0 X1` and `Y2` as one move.
TEST(ProgramEncoding, ACrAloneIsOneInputError) {
  const std::vector<std::pair<Dialect, std::string>> programs = {
      {Dialect::LinuxCnc, "G21 G90\n(a note)\nG0 X1\nY2\nM2\n"},
      {Dialect::Fanuc, "%\nO1\nG21 G90\nG0 X10.\nY20. (a note)\nM30\n%\n"},
      {Dialect::Siemens, "G71 G90 ;a note\nG0 X10\nY20\nM30\n"},
      {Dialect::Heidenhain,
       "BEGIN PGM A MM\nTOOL CALL 1 Z S100 F100\nL X+10 R0 ;a note\nL Y+2\n"
       "END PGM A MM\n"},
      {Dialect::Cl, "UNITS/MM\nFEDRAT/100,MMPM $$ a note\nGOTO/1,2,3\nGOTO/2,2,3\nFINI\n"}};
  for (const auto& [dialect, text] : programs)
    for (const Dialect read_as : {dialect, Dialect::Auto}) {
      SCOPED_TRACE(name_of(dialect));
      ASSERT_TRUE(errors_of(text, limits_options(dialect)).empty());
      std::string old = text;
      std::ranges::replace(old, '\n', '\r');
      const auto all = errors_of(old, limits_options(read_as));
      ASSERT_EQ(all.size(), 1u);
      EXPECT_EQ(all[0].seen, "a lone CR") << all[0].what();
      EXPECT_EQ(all[0].line, 1);
      // one of them, at each place
      for (std::size_t at = text.find('\n'); at + 1 < text.size(); at = text.find('\n', at + 1)) {
        std::string one = text;
        one[at] = '\r';
        const auto errors = errors_of(one, limits_options(read_as));
        ASSERT_EQ(errors.size(), 1u) << one;
        EXPECT_EQ(errors[0].seen, "a lone CR");
        EXPECT_EQ(errors[0].line, 1 + std::count(one.begin(), one.begin() + long(at), '\n'));
        EXPECT_EQ(errors[0].column, int(at - (one.rfind('\n', at) + 1)) + 1);
      }
    }
}

TEST(OtherDialect, IsNamedWhereItReadsTheFileWithFewerErrors) {
  ReadOptions options = limits_options(Dialect::Auto);
  // Fanuc, by nothing that only Fanuc has
  const std::string fanuc =
      "G21 G90 G80\nG0 X0 Y0\nG28 G91 Z0\nG90\nG1 X1. F100.\nG4 P500\n#3006=1\nM30\n";
  const auto errors = errors_of(fanuc, options);
  if (!errors.empty()) {
    EXPECT_HAS(errors.back().expected, "dialect") << errors.back().what();
  }
  const auto klartext = errors_of("L X+10 Y+5 R0 F100\nL X+20 R0\nCC X+0 Y+0\n", options);
  ASSERT_GE(klartext.size(), 2u);
  EXPECT_EQ(klartext.back().expected,
            "dialect heidenhain, which reads the file with no input error")
      << klartext.back().what();
  EXPECT_EQ(klartext.back().line, 0);
  // where it was stated nobody asks
  for (const BadInput& error : errors_of("L X+10 F100\n", limits_options(Dialect::LinuxCnc)))
    EXPECT_EQ(error.expected.find("dialect"), std::string::npos);
}

}  // namespace
}  // namespace abbe::sim::dialects
