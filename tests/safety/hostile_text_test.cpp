// Programs, scenes and results of strangers: what nests without end, makes moves without end or
// stands in another encoding ends in input errors with their places, one a line, in every command.

#include <nlohmann/json.hpp>
#include "sim/report/page_template.h"
#include "tests/safety/every_command.h"
#include "tests/safety/program_run.h"
#include "tests/test.h"

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
      EXPECT_HAS(ran.text, name + ":2:") << command << ": " << ran.text.substr(0, 500);
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
    EXPECT_HAS(ran.text, "scene.toml:") << ran.text.substr(0, 300);
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
    EXPECT_HAS(ran.text, "p.ngc:3:1: ") << command;
    EXPECT_HAS(ran.text, "p.ngc:4:") << command;
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
    EXPECT_HAS(ran.text, "UTF-16") << command;
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
    EXPECT_HAS(ran.text, "a lone CR") << command;
  }
}

TEST_F(HostileText, TheDialectIsSaidWithItsSign) {
  folder_.write("p.ngc", small_program);
  folder_.write("scene.toml", small_scene());
  for (const char* command : {"program p.ngc", "check scene.toml", "run scene.toml --out o"}) {
    const Ran ran = abbe(command);
    EXPECT_EQ(ran.code, 0) << command << ": " << ran.text;
    EXPECT_HAS(ran.text, "read as linuxcnc, as no word identifies another dialect") << command;
  }
  folder_.write("f.nc", "L X+10 R0 F100\nL X+20 R0\n");
  const Ran other = abbe("program f.nc");
  EXPECT_EQ(other.code, 3);
  EXPECT_HAS(other.text, "dialect heidenhain, which reads the file with");
}

TEST_F(HostileText, MovesWithoutEndAreAnInputErrorThatNamesTheKey) {
  folder_.write("p.ngc", "G21 F100 M3 S100\nG91\nG83 X1 Z-100 R1 Q0.0011 L1000000\nM2\n");
  folder_.write("scene.toml", small_scene());
  for (const char* command : {"program p.ngc", "check scene.toml"}) {
    const Ran ran = shell("cd " + folder_.path().string() + " && ulimit -v 3000000 && " +
                          ABBE_PROGRAM + " " + command);
    EXPECT_EQ(ran.code, 3) << command << ": " << ran.text;
    EXPECT_HAS(ran.text, "p.ngc:3:");
    EXPECT_HAS(ran.text, "max_moves");
  }
  folder_.write("p.ngc", "G21 F100 M3 S100\nG83 X0 Y0 Z-1 R1 Q0.1\nM2\n");
  EXPECT_EQ(abbe("program p.ngc").code, 0);
  EXPECT_EQ(abbe("program p.ngc --max-moves 20").code, 3);
  folder_.write("scene.toml", small_scene("max_moves = 20\n"));
  const Ran limited = abbe("check scene.toml");
  EXPECT_EQ(limited.code, 3) << limited.text;
  EXPECT_HAS(limited.text, "at most 20 moves (max_moves)");
}

std::string in_hex(std::string_view bytes) {
  std::string text;
  for (const std::uint8_t byte : sim::sha256(bytes)) text += fmt::format("{:02x}", byte);
  return text;
}

// FIPS 180-4 and its examples; lengths around the end of a block against Python's hashlib
TEST(ScriptHash, IsSha256) {
  EXPECT_EQ(in_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(in_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(in_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(in_hex(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  for (const std::size_t length : {55u, 56u, 63u, 64u, 65u, 119u, 120u}) {
    const Ran python = shell("python3 -c \"import hashlib; print(hashlib.sha256(b'x' * " +
                             std::to_string(length) + ").hexdigest())\"");
    if (python.code != 0) GTEST_SKIP() << "python3 is not installed";
    EXPECT_EQ(in_hex(std::string(length, 'x')) + "\n", python.text) << length;
  }
}

/// Says for the scripts of a page whether its policy names the hash of each, and nothing else.
constexpr const char* judge = R"py(
import base64, hashlib, re, sys
page = open(sys.argv[1], 'rb').read()
policy = re.search(rb'Content-Security-Policy" content="([^"]*)"', page).group(1).decode()
allowed = re.search(r'script-src ([^;]*);', policy).group(1).split()
scripts = re.findall(rb'<script>(.*?)</script>', page, re.S)
hashes = ["'sha256-" + base64.b64encode(hashlib.sha256(s).digest()).decode() + "'" for s in scripts]
print('same' if scripts and allowed == hashes else f'allowed {allowed}, seen {hashes}')
)py";

TEST(PagePolicy, NamesTheHashOfTheScriptThatIsInThePage) {
  const Folder folder;
  write_inputs(folder);
  folder.write("judge.py", judge);
  const std::string here = "cd " + folder.path().string() + " &&";
  for (const std::string line :
       {"report scene.toml -o page.html", "evaluate readings/ball_bar.csv --report -o evaluated",
        "study study.toml --report -o studied"}) {
    const Ran ran = run(line, here);
    ASSERT_EQ(ran.code, 0) << line << ": " << ran.text;
    const std::string page =
        line.ends_with(".html") ? "page.html" : line.substr(line.rfind(' ') + 1) + "/report.html";
    EXPECT_EQ(bytes(folder / page).find("script-src 'unsafe-inline'"), std::string::npos) << line;
    const Ran judged = shell(here + " python3 judge.py " + page);
    if (judged.text.find("not found") != std::string::npos) GTEST_SKIP() << "no python3";
    EXPECT_EQ(judged.text, "same\n") << line;
  }
}

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
  EXPECT_HAS(shown.text, "\\x1b[2J") << "spelt out";
  EXPECT_HAS(shown.text, "\\u202e");
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
