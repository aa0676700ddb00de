#include <functional>
#include <iostream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/safety/program_run.h"

namespace abbe::safety {
namespace {

// what a stranger would have a terminal do: clear it, a title, a C1 control, reversed letters
const std::string attack = "\x1b[2J\x1b]0;owned\x07\u009b31m\u202egnp\x7f\rabbe: all is well";
const std::string forged = "\nforged: a line as if it were abbe's";
// the same as TOML writes it, and a line of its own
const std::string toml_attack =
    "\\u001b[2J\\u001b]0;owned\\u0007\\u009b31m\\u202egnp\\u007f\\rabbe: all is well"
    "\\nforged: a line as if it were abbe's";

/// The first byte of a text that would act on a terminal, as a number in words; empty if none.
std::string act_in(const std::string& text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const auto next = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0u;
    const bool control = (c < 0x20 && c != '\n' && c != '\t') || c == 0x7f;
    const bool c1 = c == 0xc2 && next >= 0x80 && next < 0xa0;
    const bool bidi = text.compare(i, 3, "\u202e") == 0;
    if (control || c1 || bidi)
      return "byte " + std::to_string(c) + " at " + std::to_string(i) +
             " after: " + text.substr(i < 60 ? 0 : i - 60, i < 60 ? i : 60);
  }
  return "";
}

void expect_calm(const Ran& ran, const std::string& door) {
  EXPECT_EQ(act_in(ran.text), "") << door;
  EXPECT_EQ(("\n" + ran.text).find("\nforged"), std::string::npos) << door << ": " << ran.text;
  EXPECT_TRUE(ran.code == 0 || ran.code == 1 || ran.code == 2 || ran.code == 3 || ran.code == 5 ||
              ran.code == 6)
      << door << ": " << ran.code << ": " << ran.text;
}

/// Every table, report and scene below a folder.
int expect_calm_files(const fs::path& folder, const std::string& door) {
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string ending = entry.path().extension().string();
    const bool text = ending == ".json" || ending == ".csv" || ending == ".md" ||
                      ending == ".toml" || entry.path().filename() == ".abbe-result";
    if (!entry.is_regular_file() || !text) continue;
    ++files;
    EXPECT_EQ(act_in(bytes(entry.path())), "") << door << ": " << entry.path().filename();
    if (ending == ".json") {
      EXPECT_TRUE(nlohmann::json::accept(bytes(entry.path()))) << entry.path();
    }
  }
  return files;
}

class Escapes : public testing::Test {
 protected:
  Escapes() { folder_.write("p.ngc", small_program); }
  std::string in() const { return "cd " + folder_.path().string() + " &&"; }
  Ran abbe(const std::string& arguments) const { return run(arguments, in()); }
  Folder folder_;
};

TEST_F(Escapes, OfEveryTextOfASceneAreShownInMessagesTablesAndJson) {
  folder_.write(
      "scene.toml",
      small_scene("[[part.ring]]\nname = \"" + toml_attack +
                      "\"\nalong_mm = 500\nwidth_mm = 1\n[limits]\npv_um = 1e-9\n[errors]\n"
                      "name = \"" +
                      toml_attack + "\"\nEXX_um = 5\n",
                  toml_attack));
  const Ran shown = abbe("run scene.toml --out out");
  expect_calm(shown, "run");
  EXPECT_NE(shown.text.find("\\x1b[2J"), std::string::npos) << "spelt out: " << shown.text;
  EXPECT_NE(shown.text.find("\\u202e"), std::string::npos) << shown.text;
  const Ran json = abbe("run scene.toml --json --out json 2>/dev/null");
  expect_calm(json, "run --json");
  std::string title = nlohmann::json::parse(bytes(folder_ / "out/summary.json"))["scene"];
  EXPECT_EQ(title, attack + forged) << "JSON gives the text itself to a program that reads it";
  for (const char* command : {"compare scene.toml --out cmp", "check scene.toml",
                              "check scene.toml --json", "pose scene.toml --at X=0",
                              "pose scene.toml --at X=0 --json", "measure scene.toml --out rd"})
    expect_calm(abbe(command), command);
  EXPECT_GE(expect_calm_files(folder_ / "out", "run"), 2);
  EXPECT_GE(expect_calm_files(folder_ / "cmp", "compare"), 5);
}

TEST_F(Escapes, OfWhatAReaderRefusesAreShown) {
  const std::string raw = attack, toml = toml_attack;
  const struct {
    std::string door, file, text, command;
  } doors[] = {
      {"unknown key", "scene.toml", small_scene("\"" + toml + "\" = 1\n"), "run scene.toml"},
      {"raw controls in TOML", "scene.toml", "title = \"" + raw + "\"\n", "run scene.toml"},
      {"wrong word", "scene.toml", small_scene("alignment_ = 1\nalignment = \"" + toml + "\"\n"),
       "run scene.toml"},
      {"missing sub-file", "scene.toml", "machine = \"" + toml + ".toml\"\n", "run scene.toml"},
      {"case", "scene.toml", small_scene("[compare]\ncases = [\"" + toml + "-x\"]\n"),
       "compare scene.toml"},
      {"plug-in's file", "scene.toml", small_scene("[compare]\ncases = [\"./" + toml + "\"]\n"),
       "compare scene.toml"},
      {"variant's name", "scene.toml",
       small_scene("[[variant]]\nname = \"" + toml + "\"\nset = { errors.EXX_um = 1 }\n"),
       "compare scene.toml"},
      {"variant's path", "scene.toml",
       small_scene("[[variant]]\nname = \"v\"\nset = { \"" + toml + "\" = 1 }\n"),
       "compare scene.toml"},
      {"instrument", "scene.toml", small_scene("[[instrument]]\nkind = \"" + toml + "\"\n"),
       "measure scene.toml"},
      {"NC word", "p.ngc", "G21 G90\nG1 X1 " + raw + "\nM2\n", "run good.toml"},
      {"NC comment", "p.ngc", "G21 G90\n(" + raw + ")\nG7 X1 ; " + raw + "\nM2\n", "run good.toml"},
      {"NC comment, rewritten", "p.ngc", "(" + raw + ")\n" + small_program, "run good.toml"},
      {"PVT", "p.csv", "t," + raw + ",X\n0,1,2\n", "run good.toml --set program.file=p.csv"},
      {"OBJ", "m.obj", "o " + raw + "\nv 1 2 " + raw + "\n",
       "run good.toml --set 'part={file=\"m.obj\",unit=\"mm\"}'"},
      {"STL header", "m.stl", "solid " + raw + "\nfacet " + raw + "\nendsolid\n",
       "run good.toml --set 'part={file=\"m.stl\",unit=\"mm\"}'"},
      {"PLY header", "m.ply", "ply\nformat ascii 1.0\ncomment " + raw + "\nelement " + raw + "\n",
       "run good.toml --set 'part={file=\"m.ply\",unit=\"mm\"}'"},
      {"readings", "r.csv", "# abbe readings 1\n" + raw + "\n", "evaluate r.csv --out e"},
      {"positions", "r.csv", "target_mm,direction,run,deviation_um\n0," + raw + ",1,2\n",
       "evaluate r.csv --out e"},
      {"identify", "r.csv", "x," + raw + "\n", "identify r.csv --out b.toml"},
      {"laser's file", "r.rtl", "HEADER:: " + raw + "\n", "evaluate r.rtl --out e"},
      {"error table", "t.csv", "X,EXX," + raw + "\n0,1,2\n1,1,2\n",
       "run good.toml --set 'errors={EXX=[{kind=\"table\",file=\"t.csv\"}]}'"},
      {"thermal belief", "b.txt", "abbe thermal belief " + raw + "\n",
       "run good.toml --set 'belief.thermal.file=\"b.txt\"'"},
      {"study", "study.toml", "scene = \"" + toml + "\"\n", "study study.toml"},
      {"study's input", "study.toml",
       "scene = \"good.toml\"\n[[input]]\nname = \"" + toml + "\"\npath = \"" + toml +
           "\"\nspread = 1\n",
       "study study.toml"},
  };
  folder_.write("good.toml", small_scene());
  for (const auto& door : doors) {
    folder_.write("p.ngc", small_program);
    folder_.write(door.file, door.text);
    const Ran ran = abbe(door.command);
    expect_calm(ran, door.door);
    std::error_code ignored;
    fs::remove_all(folder_ / "out", ignored);
  }
}

TEST_F(Escapes, OfNamesOfFilesAndOfWhatIsTypedAreShown) {
  folder_.write("good.toml", small_scene());
  const std::string quoted = "$'\\x1b[2J\\u202e\\xff'";
  for (const std::string& command :
       {"run " + quoted, "run good.toml --set title=" + quoted,
        "run good.toml --set " + quoted + "=1", "run good.toml --case " + quoted,
        "run good.toml --out " + quoted + "/p.ngc", "run good.toml --out p.ngc/" + quoted,
        "pose good.toml --at " + quoted, "measure good.toml --instrument " + quoted,
        "evaluate " + quoted, "identify " + quoted, "render " + quoted, "study " + quoted,
        "export good.toml --case " + quoted, std::string("run good.toml --out $'o\\nforged'"),
        std::string("run $'o\\nforged.toml'"), "run good.toml --json --out " + quoted,
        "compare good.toml --compensator ./" + quoted}) {
    const fs::path script =
        folder_.write("go.sh", std::string(ABBE_PROGRAM) + " " + command + "\n");
    const Ran ran = shell(in() + " bash " + script.string());
    EXPECT_EQ(act_in(ran.text), "") << command;
    EXPECT_EQ(ran.text.find('\xff'), std::string::npos) << command;
    EXPECT_EQ(("\n" + ran.text).find("\nforged"), std::string::npos) << command << ": " << ran.text;
  }
}

TEST_F(Escapes, OfAPlugInsWordsAreShown) {
  folder_.write("good.toml", small_scene());
  const std::string python = "import sys, json\n";
  const std::string say =
      "sys.stderr.write('\\x1b[2J\\x9b31m\\u202egnp\\n\\x1b]0;t\\x07')\n"
      "sys.stderr.flush()\n";
  const std::pair<const char*, std::string> plug_ins[] = {
      {"dies.py", python + say + "sys.exit(3)\n"},
      {"named.py", python + say +
                       "sys.stdin.readline()\nprint(json.dumps({'type': 'ready', 'protocol': "
                       "'\\x1b[2J\\u202e', 'name': '\\nforged\\x1b[2J\\u202e'}))\n"},
      {"babbles.py", python + "sys.stdin.readline()\nprint('\\x1b[2J\\u202e\\x9b')\n"},
      {"errs.py",
       python +
           "sys.stdin.readline()\nprint(json.dumps({'error': '\\nforged\\x1b[2J\\u202e'}))\n"}};
  std::string all;
  for (const auto& [name, text] : plug_ins) {
    folder_.write(name, text);
    all += std::string(" --compensator ") + name;
  }
  expect_calm(abbe("run good.toml --compensator dies.py --out alone"), "run");
  const Ran ran = abbe("compare good.toml" + all + " --out out");
  EXPECT_EQ(ran.code, 6) << ran.text;
  expect_calm(ran, "compare");
  EXPECT_GE(expect_calm_files(folder_ / "out", "compare"), 3);
  expect_calm(abbe("compare good.toml --json" + all + " --out again"), "compare --json");
}

TEST_F(Escapes, OfAStudysNamesAreShownInItsTables) {
  folder_.write("scene.toml", small_scene("[errors]\nEXX_um = 5\nEZX_um = 3\n"));
  folder_.write("study.toml",
                "title = \"" + toml_attack + "\"\nscene = \"scene.toml\"\n[[input]]\nname = \"" +
                    toml_attack +
                    "\"\npath = \"errors.EXX_um\"\nspread = 1\n[monte_carlo]\ncases = "
                    "4\n[one_at_a_time]\n[[sweep]]\ninput = \"" +
                    toml_attack + "\"\nfrom = 0\nto = 1\nsteps = 2\n");
  const Ran ran = abbe("study study.toml --out out");
  EXPECT_EQ(ran.code, 0) << ran.text;
  expect_calm(ran, "study");
  expect_calm(abbe("study study.toml --show --out out"), "show");
  expect_calm(abbe("study study.toml --show --json --out out"), "show --json");
  EXPECT_GE(expect_calm_files(folder_ / "out", "study"), 4);
}

/// Nothing in the program prints but through the door that escapes.
TEST(EscapesInTheSource, EveryPrintGoesThroughTheOneDoor) {
  int files = 0;
  for (const char* module : {"kinematics", "errors", "cutting", "render", "sim"})
    for (const auto& entry : fs::recursive_directory_iterator(source / module)) {
      const std::string name = fs::relative(entry.path(), source).string();
      if (entry.path().extension() != ".cpp" && entry.path().extension() != ".h") continue;
      ++files;
      const bool allowed =
          name == "sim/files/terminal.h" ||    // the door
          name == "sim/files/progress.cpp" ||  // draws a line, its text escaped
          name == "sim/files/output.cpp" || name == "render/vtk_writer.cpp" ||  // files
          name == "sim/report/pose_report.cpp" ||    // numbers, and JSON that is escaped
          name == "sim/compensation/plug_in.cpp" ||  // a pipe to ourselves
          name == "render/glew_init.cpp";            // a text of its own
      const std::string text = bytes(entry.path());
      for (const char* way : {"fmt::print(", "std::cout", "std::cerr", "fputs(", "fwrite(",
                              " printf(", "fprintf(", "std::puts(", "std::clog", ".dump(2)"})
        EXPECT_TRUE(allowed || text.find(way) == std::string::npos) << name << " has " << way;
    }
  EXPECT_GT(files, 100);
}

}  // namespace
}  // namespace abbe::safety
