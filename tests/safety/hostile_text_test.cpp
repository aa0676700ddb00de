// Programs, scenes and results of strangers: what nests without end, makes moves without end or
// stands in another encoding ends in input errors with their places, one a line, in every command.

#include <algorithm>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "tests/safety/program_run.h"

namespace abbe::safety {
namespace {

std::string times(const std::string& text, int n) {
  std::string all;
  all.reserve(text.size() * std::size_t(n));
  for (int i = 0; i < n; ++i) all += text;
  return all;
}

std::string scene_of(const std::string& program) {
  std::string scene = small_scene();
  return scene.replace(scene.find("p.ngc"), 5, program);
}

/// Every line begins as an error of abbe's, and none has the end of a line spelt out.
void expect_one_a_line(const Ran& ran, const std::string& what) {
  EXPECT_EQ(ran.text.find("\\x0a"), std::string::npos) << what << ": " << ran.text;
  std::istringstream lines(ran.text);
  for (std::string line; std::getline(lines, line);)
    EXPECT_TRUE(line.starts_with("abbe: ") || line.starts_with("["))  // a stage of its progress
        << what << ": " << line;
}

class HostileText : public testing::Test {
 protected:
  Ran abbe(const std::string& arguments) const {
    return run(arguments, "cd " + folder_.path().string() + " &&");
  }
  Folder folder_;
};

TEST_F(HostileText, NestedProgramsAreInputErrorsWithTheirPlaces) {
  constexpr int deep = 200'000;
  const std::pair<std::string, std::string> programs[] = {
      {"hash.ngc", "G21\nX" + times("#", deep) + "1\n"},
      {"bracket.ngc", "G21\nX" + times("[", deep) + "\n"},
      {"sign.ngc", "G21\nX[" + times("-", deep) + "#1]\n"},
      {"function.ngc", "G21\nX" + times("ATAN[1]/[", deep) + "\n"},
      {"set.ngc", "G21\n" + times("#", deep) + "1=5\n"},
      {"label.ngc", "G21\no" + times("#", deep) + "1 call\n"},
      {"variable.eia", "G21\n#1=" + times("#[", deep) + "\n"},
      {"power.eia", "G21\nX" + times("POW[1,", deep) + "\n"},
      {"not.mpf", "G71\nR1=" + times("NOT ", deep) + "1\n"},
      {"field.mpf", "G71\n" + times("R[", deep) + "\n"},
      {"sin.h", "0 BEGIN PGM A MM\n1 Q1 = " + times("SIN ", deep) + "\n"},
      {"minus.h", "0 BEGIN PGM A MM\n1 L X" + times("-", deep) + "Q1\n"},
      {"point.cl", "UNITS/MM\nGOTO/" + times("(", deep) + "\n"},
  };
  for (const auto& [name, text] : programs) {
    folder_.write(name, text);
    folder_.write("scene.toml", scene_of(name));
    for (const std::string& command : {"program " + name, std::string("check scene.toml")}) {
      const Ran ran = abbe(command);
      EXPECT_EQ(ran.code, 3) << command << ": " << ran.text.substr(0, 500);
      EXPECT_NE(ran.text.find(name + ":2:"), std::string::npos)
          << command << ": " << ran.text.substr(0, 500);
    }
  }
}

TEST_F(HostileText, NestedScenesAndResultsAreInputErrors) {
  constexpr int deep = 200'000;
  folder_.write("p.ngc", small_program);
  const std::string before = small_scene();
  for (const std::string& more :
       {"[x]\na = " + times("[", deep), "[x]\na = " + times("{a=", deep),
        "[x]\n" + times("a.", deep) + "a = 1\n", "[" + times("a.", deep) + "a]\n",
        "[[" + times("a.", deep) + "a]]\n",
        "[x]\na = " + times("[", 300) + times("]", 300) + "\n"}) {
    folder_.write("scene.toml", before + more);
    const Ran ran = abbe("check scene.toml");
    EXPECT_EQ(ran.code, 3) << more.substr(0, 30) << ": " << ran.text.substr(0, 300);
    EXPECT_NE(ran.text.find("scene.toml:"), std::string::npos) << ran.text.substr(0, 300);
  }
  const Ran set = abbe("check scene.toml --set x=" + times("[", 20'000));
  EXPECT_TRUE(set.code == 2 || set.code == 3) << set.code;
  for (const std::string& json : {times("[", deep), times("{\"a\":", deep)}) {
    folder_.write("out/summary.json", json);
    folder_.write("out/NAME.json", json);
    const Ran ran = abbe("report out -o page.html");
    EXPECT_TRUE(ran.code == 2 || ran.code == 3) << ran.code << ": " << ran.text.substr(0, 300);
  }
}

TEST_F(HostileText, ErrorsOfAProgramStandOneALineInEveryCommand) {
  folder_.write("p.ngc", "G21 G90 F100\nG1 X10\nG99.9\nFOO\x1b[2J\nM2\n");
  folder_.write("scene.toml", small_scene());
  for (const char* command :
       {"program p.ngc", "check scene.toml", "run scene.toml --out o", "compare scene.toml --out o",
        "report scene.toml -o page.html", "animate scene.toml --out o"}) {
    const Ran ran = abbe(command);
    EXPECT_EQ(ran.code, 3) << command << ": " << ran.text;
    expect_one_a_line(ran, command);
    EXPECT_NE(ran.text.find("p.ngc:3:1: "), std::string::npos) << command << ": " << ran.text;
    EXPECT_NE(ran.text.find("p.ngc:4:"), std::string::npos) << command << ": " << ran.text;
    EXPECT_EQ(ran.text.find('\x1b'), std::string::npos) << command;
  }
}

TEST_F(HostileText, AnEncodingIsOneErrorOfEveryReader) {
  folder_.write("p.ngc", small_program);
  const auto wide = [](const std::string& text) {
    std::string all = "\xff\xfe";
    for (const char c : text) all += std::string{c, '\0'};
    return all;
  };
  folder_.write("wide.ngc", wide(small_program));
  folder_.write("wide.cl", wide("UNITS/MM\nGOTO/1,2,3\n"));
  folder_.write("scene.toml", wide(small_scene()));
  folder_.write("readings.csv", wide("# instrument = \"laser\"\nposition_mm,reading_um\n1,2\n"));
  for (const char* command : {"program wide.ngc", "program wide.cl", "check scene.toml",
                              "evaluate readings.csv", "identify readings.csv"}) {
    const Ran ran = abbe(command);
    EXPECT_EQ(ran.code, 3) << command << ": " << ran.text;
    expect_one_a_line(ran, command);
    EXPECT_EQ(ran.text.find("abbe: "), ran.text.rfind("abbe: ")) << command << ": " << ran.text;
    EXPECT_NE(ran.text.find("UTF-16"), std::string::npos) << command << ": " << ran.text;
  }
  // what a tape has is white space in a scene too
  std::string tape(20, '\0');
  for (const char c : small_scene()) tape += c == '\n' ? std::string("\n\r\r") : std::string(1, c);
  folder_.write("tape.toml", tape + std::string(20, '\0'));
  const Ran ran = abbe("check tape.toml");
  EXPECT_EQ(ran.code, 0) << ran.text;
}

TEST_F(HostileText, ACrAloneIsOneErrorOfEveryReader) {
  const auto old = [](std::string text) {
    std::ranges::replace(text, '\n', '\r');
    return text;
  };
  folder_.write("p.ngc", small_program);
  folder_.write("good.toml", small_scene());
  folder_.write("old.ngc", old(small_program));
  folder_.write("old.cl", old("UNITS/MM\nGOTO/1,2,3\n"));
  folder_.write("old.csv", old("time_s,X_mm,Y_mm,Z_mm,X_mm_per_s,Y_mm_per_s,Z_mm_per_s\n"
                               "0,0,0,0,1,0,0\n1,1,0,0,1,0,0\n"));
  folder_.write("scene.toml", old(small_scene()));
  folder_.write("readings.csv", old("# instrument = \"laser\"\nposition_mm,reading_um\n1,2\n"));
  folder_.write("tool.tbl", old("T1 P1 Z100 D10\nT2 P2 Z50 D5\n"));
  folder_.write("poses.csv", old("X_mm,Y_mm,Z_mm\n1,2,3\n4,5,6\n"));
  for (const char* command : {"program old.ngc", "program old.cl", "program old.csv",
                              "check scene.toml", "evaluate readings.csv", "identify readings.csv",
                              "program p.ngc --dialect linuxcnc --unit mm --tools tool.tbl",
                              "pose good.toml --at-file poses.csv"}) {
    const Ran ran = abbe(command);
    EXPECT_EQ(ran.code, 3) << command << ": " << ran.text;
    expect_one_a_line(ran, command);
    EXPECT_EQ(ran.text.find("abbe: "), ran.text.rfind("abbe: ")) << command << ": " << ran.text;
    EXPECT_NE(ran.text.find("a lone CR"), std::string::npos) << command << ": " << ran.text;
  }
}

TEST_F(HostileText, TheDialectIsSaidWithItsSign) {
  folder_.write("p.ngc", small_program);
  folder_.write("scene.toml", small_scene());
  for (const char* command : {"program p.ngc", "check scene.toml", "run scene.toml --out o"}) {
    const Ran ran = abbe(command);
    EXPECT_EQ(ran.code, 0) << command << ": " << ran.text;
    EXPECT_NE(ran.text.find("read as linuxcnc, as no word identifies another dialect"),
              std::string::npos)
        << command << ": " << ran.text;
  }
  folder_.write("f.nc", "L X+10 R0 F100\nL X+20 R0\n");
  const Ran other = abbe("program f.nc");
  EXPECT_EQ(other.code, 3);
  EXPECT_NE(other.text.find("dialect heidenhain, which reads the file with"), std::string::npos)
      << other.text;
}

TEST_F(HostileText, MovesWithoutEndAreAnInputErrorThatNamesTheKey) {
  folder_.write("p.ngc", "G21 F100 M3 S100\nG91\nG83 X1 Z-100 R1 Q0.0011 L1000000\nM2\n");
  folder_.write("scene.toml", small_scene());
  for (const char* command : {"program p.ngc", "check scene.toml"}) {
    const Ran ran = shell("cd " + folder_.path().string() + " && ulimit -v 3000000 && " +
                          ABBE_PROGRAM + " " + command);
    EXPECT_EQ(ran.code, 3) << command << ": " << ran.text;
    EXPECT_NE(ran.text.find("p.ngc:3:"), std::string::npos) << ran.text;
    EXPECT_NE(ran.text.find("max_moves"), std::string::npos) << ran.text;
  }
  folder_.write("p.ngc", "G21 F100 M3 S100\nG83 X0 Y0 Z-1 R1 Q0.1\nM2\n");
  EXPECT_EQ(abbe("program p.ngc").code, 0);
  EXPECT_EQ(abbe("program p.ngc --max-moves 20").code, 3);
  folder_.write("scene.toml", small_scene("max_moves = 20\n"));
  const Ran limited = abbe("check scene.toml");
  EXPECT_EQ(limited.code, 3) << limited.text;
  EXPECT_NE(limited.text.find("at most 20 moves (max_moves)"), std::string::npos) << limited.text;
}

}  // namespace
}  // namespace abbe::safety
