#include <pty.h>
#include <sys/wait.h>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <regex>
#include "sim/commands/command_line.h"
#include "sim/commands/scene_commands.h"
#include "sim/cut/cut.h"
#include "sim/scene/read_scene.h"
#include "tests/safety/program_run.h"
#include "tests/sim/odd_scenes.h"
#include "tests/test.h"

/// What somebody does first: asks for help, for the version, for a scene to begin with; and slips.
namespace abbe::sim {
namespace {

using safety::bytes;
using safety::Folder;
using safety::Ran;
using safety::run;
using safety::shell;
using Clock = std::chrono::steady_clock;

bool says(const std::string& text, const std::string& wanted) {
  return text.find(wanted) != std::string::npos;
}

int count_of(const std::string& text, const std::string& wanted) {
  int count = 0;
  for (auto at = text.find(wanted); at != std::string::npos; at = text.find(wanted, at + 1))
    ++count;
  return count;
}

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder))
    names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

/// Words as a shell makes them of a line with double quotes.
std::vector<std::string> words_of(const std::string& line) {
  std::vector<std::string> words;
  std::istringstream in(line);
  for (std::string word; in >> word;) {
    while (std::ranges::count(word, '"') == 1) {
      std::string more;
      if (!(in >> more)) break;
      word += " " + more;
    }
    std::erase(word, '"');
    words.push_back(word);
  }
  return words;
}

Exit parsed(const std::string& line) {
  std::vector<std::string> words = words_of(line);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  int argc = int(argv.size());
  char** first = argv.data();
  CommonOptions common;
  return parse_command_line(all_commands(common, argc, first), argc, first);
}

std::vector<Command> commands() {
  static CommonOptions common;
  static int argc = 0;
  static char** argv = nullptr;
  return all_commands(common, argc, argv);
}

class NewScene : public testing::TestWithParam<std::string> {};

TEST_P(NewScene, RunsAsItIsAndItsMapMakesSense) {
  const Folder folder;
  const std::string kind = GetParam(), first = (folder / "first").string();
  const Ran made = run("new " + kind + " " + first);
  ASSERT_EQ(made.code, 0) << made.text;
  std::vector<std::string> sections;
  for (const std::string& name : names_in(first)) {
    sections.push_back(fs::path(name).stem().string());
    const std::string text = bytes(fs::path(first) / name);
    // a post begins with the mark or the first word of its control
    const bool is_post = text.starts_with("%") || text.starts_with("0 BEGIN PGM");
    EXPECT_TRUE(is_post || text.starts_with("#") || text.starts_with("(") || text.starts_with("$$"))
        << name << " has a comment at its head";
    EXPECT_HAS(made.text, name);
  }
  EXPECT_EQ(sections,
            (std::vector<std::string>{"errors", "machine", "part", "program", "scene", "tool"}));

  const Ran ran = run("compare " + first + "/scene.toml --out " + first + "/out");
  ASSERT_EQ(ran.code, 0) << ran.text;
  EXPECT_EQ(count_of(ran.text, "warning"), 0) << ran.text;
  EXPECT_EQ(says(ran.text, "assumed: line 7: the reference position (G28, G30)"), kind == "fanuc")
      << ran.text;
  const auto json = nlohmann::json::parse(bytes(fs::path(first) / "out/comparison.json"));
  const auto of = [&](int number, const char* map, const char* what) {
    return json["cases"][std::size_t(number)][map][what].get<double>();
  };
  const double cusps = of(0, "residual_um", "pv"), before = of(1, "machine_um", "rms"),
               after = of(2, "machine_um", "rms");
  std::cout << kind << ": cusps " << cusps << " um PV, the machine's part " << before << " -> "
            << after << " um RMS\n";
  EXPECT_LT(cusps, 4.0);
  EXPECT_GT(before, 0.5);
  EXPECT_LT(before, 60.0);
  // three axes cannot turn a flat end mill upright again
  EXPECT_LT(after, (kind == "three_axis" ? 0.6 : 0.1) * before);
  const auto summary =
      nlohmann::json::parse(bytes(fs::path(first) / "out/uncompensated/summary.json"));
  EXPECT_EQ(summary["uncut_vertices"], 0);
}

// One part for every control: balls have the same centres on five axes and on three, so that the
// cusps are the same but for the digits of the posts.
TEST(NewScene, PostsOfFourControlsLeaveTheMapOfTheCutterLocations) {
  const Folder folder;
  const auto cusps = [&](const std::string& kind) {
    const std::string scene = (folder / kind).string() + "/scene.toml";
    EXPECT_EQ(run("new " + kind + " " + (folder / kind).string()).code, 0);
    std::istringstream lines(bytes(scene));
    int count = 0;
    for (std::string line; std::getline(lines, line);) count += !line.empty() && line[0] != '#';
    EXPECT_LT(count, 10) << kind << ": lines of its scene";
    return cut_error_free(
        prepare(read_scene(scene, {{"part.sampling", "\"vertices\""}, {"part.vertices", "3000"}})));
  };
  const cutting::Surface cam = cusps("cam").surface;
  for (const std::string kind : {"fanuc", "siemens", "heidenhain", "linuxcnc"}) {
    const cutting::Surface post = cusps(kind).surface;
    ASSERT_EQ(post.residual.size(), cam.residual.size());
    double most = 0.0;
    for (Index i = 0; i < cam.residual.size(); ++i) {
      ASSERT_EQ(post.status[std::size_t(i)], cutting::VertexStatus::Cut) << kind << " " << i;
      most = std::max(most, std::abs(post.residual[i] - cam.residual[i]));
    }
    std::cout << kind << ": its map differs by " << 1e6 * most << " nm at most\n";
    // a post has steps of 0.1 or 0.01 um; on three axes the ball runs straight between two places,
    // on five its middle swings by 0.01 rad about a tip that does: R 5 mm * 0.011^2 / 8 is 80 nm
    EXPECT_LT(most, kind == "fanuc" || kind == "linuxcnc" ? 2e-4 : 2e-5) << kind;
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, NewScene, testing::ValuesIn(scene_kinds()),
                         [](const auto& kind) { return kind.param; });

TEST(NewScene, RefusesAFolderWithFilesAndTouchesNone) {
  const Folder folder;
  folder.write("first/notes.txt", "mine");
  const Ran ran = run("new gantry " + (folder / "first").string());
  EXPECT_EQ(ran.code, 5);
  EXPECT_HAS(ran.text, "expected a new or empty folder, seen a folder with notes.txt");
  EXPECT_EQ(names_in(folder / "first"), std::vector<std::string>{"notes.txt"});
  folder.write("file", "mine");
  EXPECT_EQ(run("new gantry " + (folder / "file").string()).code, 5);
  EXPECT_EQ(bytes(folder / "file"), "mine");
}

TEST(NewScene, TakesAFolderThatIsEmptyOrHasHiddenFilesAlone) {
  const Folder folder;
  folder.write("first/.gitkeep", "");
  EXPECT_EQ(run("new lathe " + (folder / "first").string()).code, 0);
  EXPECT_EQ(names_in(folder / "first").size(), 7u);
  EXPECT_FALSE(fs::exists(folder / "first/.abbe-result")) << "the files are the user's";
  const Ran here =
      shell("cd " + folder.path().string() + " && mkdir here && cd here && " + ABBE_PROGRAM +
            " new lathe . && " + ABBE_PROGRAM + " new lathe ../deep/er/");
  EXPECT_EQ(here.code, 0) << here.text;
  EXPECT_EQ(names_in(folder / "here").size(), 6u);
  EXPECT_EQ(names_in(folder / "deep/er").size(), 6u);
}

TEST(NewScene, LeavesNothingBehindWhereItFails) {
  const Folder folder;
  folder.write("file", "mine");
  EXPECT_EQ(run("new gantry " + (folder / "file/first").string()).code, 5);
  // the disk is full after a kilobyte, in the second or third file
  const Ran full = shell("trap '' XFSZ; ulimit -f 2; " + std::string(ABBE_PROGRAM) +
                         " new gantry " + (folder / "deep/first").string());
  EXPECT_EQ(full.code, 5) << full.text;
  EXPECT_HAS(full.text, "cannot be written");
  // a library without such a scene
  fs::create_directories(folder / "library/machines");
  const Ran none = run("new gantry " + (folder / "first").string(),
                       "ABBE_LIBRARY=" + (folder / "library").string());
  EXPECT_EQ(none.code, 3) << none.text;
  EXPECT_EQ(names_in(folder.path()), (std::vector<std::string>{"file", "library"}));
  EXPECT_EQ(bytes(folder / "file"), "mine");
}

TEST(CopiedScene, RunsElsewhereAndCheckSaysWhatItReads) {
  const Folder folder;
  fs::copy_file(safety::source / "scenes/gantry_dome.toml", folder / "dome.toml");
  const Ran ran = run("check " + (folder / "dome.toml").string() +
                      " --set part.vertices=500 --set program.step_over_mm=5");
  EXPECT_EQ(ran.code, 0) << ran.text;
  for (const std::string& file :
       {(folder / "dome.toml").string(), std::string("library:machines/gantry_cxyza.toml"),
        std::string("library:errors/gantry_typical.toml")})
    EXPECT_HAS(ran.text, "  " + file + "\n");
}

TEST(Help, EveryCommandHasTwoExamplesThatTheParserTakes) {
  for (const Command& command : commands()) {
    EXPECT_GE(command.examples.size(), 2u) << command.name;
    const Ran help = run(command.name + " --help");
    EXPECT_EQ(help.code, 0);
    for (const std::string& line : command.examples) {
      EXPECT_TRUE(line.starts_with("abbe " + command.name)) << line;
      EXPECT_EQ(parsed(line), Exit::Ok) << line;
      EXPECT_HAS(help.text, "\n  " + line + "\n");
      for (const std::string& word : words_of(line))
        if (word.starts_with("scenes/")) {
          EXPECT_TRUE(fs::exists(safety::source / word)) << line;
        }
    }
  }
}

TEST(Help, ExamplesThatTakeAMomentRunAsTheyStand) {
  const Folder folder;
  const std::string cd = "cd " + folder.path().string() + " && ";
  fs::create_directory_symlink(safety::source / "scenes", folder / "scenes");
  fs::create_symlink(ABBE_PROGRAM, folder / "abbe");
  for (const Command& command : commands()) {
    if (!std::set<std::string>{"new", "schema", "explain", "pose", "check", "export", "program"}
             .contains(command.name))
      continue;
    for (const std::string& line : command.examples) {
      const Ran ran = shell("(" + cd + "./" + line + ")");
      EXPECT_EQ(ran.code, 0) << line << ": " << ran.text;
    }
  }
}

TEST(Slip, TheNearestCommandOptionOrWordIsNamed) {
  const struct {
    std::string line, wanted;
  } slips[] = {
      {"rnu scene.toml", "expected a command (nearest: run), seen rnu"},
      {"comapre s.toml", "(nearest: compare)"},
      {"idetnify a.csv", "(nearest: identify)"},
      {"--verison", "expected a command, --help or --version (nearest: --version), seen --verison"},
      {"--threads 2 run s.toml", "expected a command, --help or --version"},
      {"run s.toml --treads 2", "expected an option of run (nearest: --threads), seen --treads"},
      {"run s.toml --treads=2", "(nearest: --threads), seen --treads"},
      {"pose s.toml --gird", "(nearest: --grid)"},
      {"new gantri first",
       "expected one of cam, fanuc, gantry, head_head, heidenhain, lathe, linuxcnc, platform, "
       "siemens, three_axis, trunnion (nearest: gantry), seen gantri"},
      {"render r --line radios", "(nearest: radius)"},
      {"explain part.raduis_mm", "nearest: part.radius_mm"},
      {"run library:gantri_dome", "a library name: library:gantry_dome, "},
  };
  for (const auto& one : slips) {
    const Ran ran = run(one.line);
    EXPECT_EQ(ran.code, one.line.starts_with("run library") ? 3 : 2) << one.line;
    EXPECT_HAS(ran.text, one.wanted) << one.line;
    EXPECT_LE(std::ranges::count(ran.text, '\n'), 1) << ran.text;
  }
  EXPECT_FALSE(says(run("xylophone").text, "nearest"));
}

TEST(Version, SaysWhatTheProgramWasMadeOf) {
  const Ran ran = run("--version");
  EXPECT_EQ(ran.code, 0);
  for (const char* wanted :
       {"abbe 0.", "\ncommit ", "\ncompiler ", "\npreset ", "\nflags ", "\nlibraries ", "Eigen3 3.",
        "fcl ", "OpenMesh ", "TBB ", "fmt ", "SQLite3 ", "Boost ", "dlib "})
    EXPECT_HAS(ran.text, wanted) << wanted << " in " << ran.text;
  EXPECT_HAS(ran.text, "-ffp-contract=off");
  EXPECT_TRUE(
      says(ran.text, "\nscenes        " + fs::canonical(safety::source / "scenes").string() + "\n"))
      << ran.text;
}

/// What the build's script writes for sources in a folder.
std::string commit_of(const Folder& folder) {
  const std::string out = (folder / "commit.cpp").string();
  const Ran ran = shell("cmake -DSOURCE=" + (folder / "source").string() + " -DOUT=" + out +
                        " -P " + (safety::source / "sim/commands/commit.cmake").string());
  EXPECT_EQ(ran.code, 0) << ran.text;
  return bytes(out);
}

TEST(Version, TheCommitIsThatOfTheSourcesAndWrittenOnlyWhereItChanged) {
  const Folder folder;
  folder.write("source/file", "one");
  EXPECT_HAS(commit_of(folder), "\"unknown, built without git\"") << "an unpacked archive";
  const std::string git =
      "git -C " + (folder / "source").string() + " -c user.name=a -c user.email=a@b ";
  if (shell(git + "init -q").code != 0) GTEST_SKIP() << "no git";
  ASSERT_EQ(
      shell(git + "add file && GIT_COMMITTER_DATE=2026-01-02T03:04:05Z " + git + "commit -q -m one")
          .code,
      0);
  const std::string name = shell(git + "log -1 --format=%h").text;
  const std::string wanted = "\"" + name.substr(0, name.find('\n')) + " of 2026-01-02";
  EXPECT_HAS(commit_of(folder), wanted + "\";");
  const auto written = fs::last_write_time(folder / "commit.cpp");
  commit_of(folder);
  EXPECT_EQ(fs::last_write_time(folder / "commit.cpp"), written);
  folder.write("source/file", "two");
  EXPECT_HAS(commit_of(folder), wanted + ", with changes since\";");
}

// Slips of a first evening: what the program says to each, from which the next step is clear.

class FirstEvening : public testing::Test {
 protected:
  FirstEvening() {
    folder_.write("good.ngc", to_nc({}));
    folder_.write("above.ngc", to_nc({.z = 80}));
  }

  Ran run(const std::string& command, const std::string& scene) const {
    const auto file = folder_.write("scene.toml", scene);
    return safety::run(
        fmt::format("{} {} --out {}", command, file.string(), (folder_ / "out").string()));
  }
  Ran run(const std::string& command, const FlatScene& scene) const {
    return run(command, to_toml(scene));
  }
  /// Files of results, but for the mark of the folder.
  int results() const {
    int count = 0;
    if (!fs::exists(folder_ / "out")) return count;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / "out"))
      count += entry.is_regular_file() && entry.path().filename() != ".abbe-result";
    return count;
  }
  /// Both `check` and `run` refuse with these words, and leave no files.
  void expect_refused(const std::string& scene, const std::string& words) const {
    for (const char* command : {"check", "run"}) {
      const Ran ran = run(command, scene);
      EXPECT_EQ(ran.code, 3) << ran.text;
      EXPECT_HAS(ran.text, words) << command;
      EXPECT_EQ(results(), 0) << "a refusal leaves no files";
    }
  }
  void expect_refused(const FlatScene& scene, const std::string& words) const {
    expect_refused(to_toml(scene), words);
  }
  /// `check` takes it and warns with these words.
  void expect_warned(const std::string& scene, const std::string& words) const {
    const Ran ran = run("check", scene);
    EXPECT_EQ(ran.code, 0) << ran.text;
    EXPECT_HAS(ran.text, "warning: " + words);
  }
  void expect_warned(const FlatScene& scene, const std::string& words) const {
    expect_warned(to_toml(scene), words);
  }

  safety::Folder folder_;
};

const std::string ball = "kind = \"ball\"\nradius_mm = 5\nflank_length_mm = 25\nlength_mm = 100\n";

TEST_F(FirstEvening, AProgramAboveThePart) {
  expect_refused(FlatScene{.program = "above.ngc"},
                 "above.ngc:5: expected a program that comes within 2 mm of the part, seen the "
                 "lowest cut is 80.0 mm above the part; with G54 Z = -80 it fits best");
  const Ran ran =
      run("check", FlatScene{.program = "above.ngc", .more = "work_offset.G54 = { Z_mm = -80 }\n"});
  EXPECT_EQ(ran.code, 0) << ran.text;
  // the part lies in the top of the table, which the cutter meets beside it: that alone is said
  const std::string meets =
      "warning: this command does not check collisions, but table and cutter collide";
  EXPECT_EQ(ran.text.find("warning"), ran.text.find(meets)) << ran.text;
  EXPECT_EQ(ran.text.find("warning"), ran.text.rfind("warning")) << ran.text;
}

TEST_F(FirstEvening, TheWrongTool) {
  folder_.write("t7.ngc",
                to_nc({.head = "(T7 D=12. CR=0. - FLAT END MILL)\nG21 G90 G49\nT7 M6\n"}));
  expect_refused(FlatScene{.program = "t7.ngc", .tool = ball + "number = 3\n"},
                 "t7.ngc:3: expected T3, which is the scene's tool.number, seen T7: describe it in "
                 "a [[tool]] of its own, or set tool.number = 7 if it is the scene's tool");
  expect_warned(FlatScene{.program = "t7.ngc", .tool = ball + "number = 7\n"},
                "line 1 says \"T7 D=12. CR=0. - FLAT END MILL\": 12 mm diameter, but the scene's "
                "tool has 10 mm; 0 mm corner radius, but the scene's tool has 5 mm");
}

TEST_F(FirstEvening, AMeshInInches) {
  std::string inches;
  for (const double z : {0.0, 10.0})
    for (const double y : {-10.0, 10.0})
      for (const double x : {-10.0, 10.0})
        inches += fmt::format("v {} {} {}\n", x / 25.4, y / 25.4, z / 25.4);
  const std::string millimetres = box_obj(true);
  folder_.write("box.obj", inches + millimetres.substr(millimetres.find('f')));
  folder_.write("box.ngc", to_nc({.from = -12, .to = 12, .step = 1, .reach = 14, .z = 10}));
  const std::string part = "file = \"box.obj\"\n";
  expect_refused(FlatScene{.program = "box.ngc", .part = part},
                 "the lowest cut is 9.6 mm above the part; 0 % of the judged area is cut within 2 "
                 "mm of the design; with the part scaled by 25.4 it would be ");
  expect_refused(FlatScene{.program = "box.ngc", .part = part},
                 "%: check whether part.unit should be \"inch\"; set part.any_size = true if the "
                 "size is right");
  const Ran ran = run("check", FlatScene{.program = "box.ngc", .part = part + "unit = \"inch\"\n"});
  EXPECT_EQ(ran.code, 0) << ran.text;
}

TEST_F(FirstEvening, AMisspeltCommand) {
  const Ran ran = safety::run("rnu scene.toml");
  EXPECT_EQ(ran.code, 2);
  EXPECT_EQ(ran.text,
            "abbe: expected a command (nearest: run), seen rnu; abbe --help lists them\n");
}

TEST_F(FirstEvening, AnUnclosedQuote) {
  expect_refused(
      "title = \"first part\nmachine = \"m.toml\"\n",
      "scene.toml:1:9: expected a string that ends with \", seen a string not closed on its line");
}

TEST_F(FirstEvening, AnElementInMillimetres) {
  expect_warned(FlatScene{.more = "[errors]\nEXX_um = 5000\n"},
                "errors.EXX is 5 mm at X = -7 mm, which is implausible for a machine: values of "
                "EXX_um are in um (5000 here)");
  expect_warned(FlatScene{.more = "[errors]\nEXX_um = 0.005\n"},
                "errors.EXX is at most 0.005 um, which is implausibly small for a slide: values of "
                "EXX_um are in um, not in mm");
  expect_refused(FlatScene{.more = "[errors]\nEXX_mm = 0.005\n"},
                 "expected EXX_um for the element EXX, seen EXX_mm, which is EXX_um = 5");
}

TEST_F(FirstEvening, ASceneCopiedElsewhere) {
  const auto scene = [](const std::string& machine) {
    return "machine = \"machines/" + machine +
           "\"\ntool = \"tools/ball_r5.toml\"\n[part]\nsurface = \"disc\"\nradius_mm = 10\n"
           "[program]\ngenerator = \"raster\"\n";
  };
  const Ran found = run("check", scene("gantry_cxyza.toml"));
  EXPECT_EQ(found.code, 0) << found.text;
  EXPECT_HAS(found.text, "library:machines/gantry_cxyza.toml")
      << "what is abbe's own is found wherever the scene stands";
  for (const std::string& words :
       {std::string("scene.toml:1:11: expected a file that can be read, or a library name: "),
        fmt::format("seen no file {0}/machines/ours.toml; names are relative to the folder of the "
                    "file that contains them, here {0}",
                    folder_.path().string())})
    expect_refused(scene("ours.toml"), words);
}

TEST_F(FirstEvening, NothingJudged) {
  expect_refused(
      FlatScene{.part = "surface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\nvertices = "
                        "400\njudged_radius_min_mm = 50\n"},
      "expected a part with judged vertices (part.edge_margin_mm, judged_normal_z, "
      "judged_margin_mm, "
      "judged_radius_min_mm, judged_radius_max_mm, region), seen 400 vertices, all excluded, on a "
      "part of 10 x 10 x 0 mm that is 0.2727 to 7.071 mm from its z axis");
}

TEST_F(FirstEvening, APartOutsideOfWhatTheMachineReaches) {
  const std::string part =
      "surface = \"rectangle\"\nlength_x_mm = 10\nlength_y_mm = 10\nvertices = 400\n";
  expect_refused(fmt::format("machine = \"{0}machines/three_axis_table.toml\"\ntool = "
                             "\"{0}tools/ball_r5.toml\"\n[part]\n{1}at_mm = [900, 0, 0]\n"
                             "[program]\ngenerator = \"raster\"\nstep_over_mm = 1\nstep_mm = 1\n",
                             packaged("").string(), part),
                 "would exceed its travel; part.at_mm is [900, 0, 0], and the slides travel X "
                 "between -400 and 400 mm, Y between ");
}

TEST_F(FirstEvening, UnitsTwice) {
  folder_.write("twice.ngc", to_nc({.head = "G21\nG20 G90 G17 G94 G49\n"}));
  expect_refused(
      FlatScene{.program = "twice.ngc"},
      "seen Z = 401 in this block, with words in inches (G20 on line 2, after G21 on line 1)");
  folder_.write("mixed.ngc", to_nc({.middle = "G20\nG0 Z3\nG21\n"}));
  expect_warned(FlatScene{.program = "mixed.ngc"},
                "the program sets two units, G21 on line 1, G20 on line 63, G21 on line 65: 1 of "
                "its 117 moves are in inches, the others in mm; remove the wrong word");
  // the mesh is in mm already
  folder_.write("box.obj", box_obj(true));
  folder_.write("box.ngc", to_nc({.from = -12, .to = 12, .step = 1, .reach = 14, .z = 10}));
  const Ran ran = run(
      "check", FlatScene{.program = "box.ngc", .part = "file = \"box.obj\"\nunit = \"inch\"\n"});
  EXPECT_HAS(ran.text, "with the part scaled by 0.03937 it would be ");
  EXPECT_HAS(ran.text, "check whether part.unit should be \"mm\"");
}

// What somebody sees who waits: the program on a terminal, and without one.

/// Something that was drawn, and when.
struct Drawn {
  double at_s = 0.0;
  std::string text;
};

struct Watched {
  int code = -1;
  double total_s = 0.0;
  std::vector<Drawn> lines;
};

double since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The program with a terminal of its own.
Watched on_a_terminal(const std::string& arguments) {
  const std::string command = std::string(ABBE_PROGRAM) + " " + arguments;
  const Clock::time_point start = Clock::now();
  int terminal = -1;
  const ::pid_t child = ::forkpty(&terminal, nullptr, nullptr, nullptr);
  if (child == 0) {
    ::execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    ::_exit(127);
  }
  Watched watched;
  std::string text;
  char buffer[4096];
  for (ssize_t n = 0;
       (n = ::read(terminal, buffer, sizeof buffer)) > 0 || (n < 0 && errno == EINTR);) {
    text.append(buffer, std::size_t(std::max<ssize_t>(0, n)));
    for (std::size_t end = 0; (end = text.find_first_of("\r\n")) != std::string::npos;
         text.erase(0, end + 1))
      if (end > 0) watched.lines.push_back({since(start), text.substr(0, end)});
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ::close(terminal);
  watched.total_s = since(start);
  watched.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return watched;
}

TEST(Waiting, OnATerminalThePartTheStageAndTheTimeLeftAreDrawn) {
  const safety::Folder folder;
  const std::string scene = (safety::source / "scenes/new/gantry.toml").string();
  const Watched watched = on_a_terminal("compare " + scene + " --out " + (folder / "out").string());
  ASSERT_EQ(watched.code, 0);
  const std::regex state(R"(\[(\d+)/(\d+)\] (.+): (\w+)( \d+ %)?(, (\d+) (s|min) left)?)");
  std::set<std::string> parts, stages;
  int times = 0, last = 0;
  for (const Drawn& line : watched.lines) {
    std::smatch seen;
    if (!std::regex_search(line.text, seen, state)) continue;
    parts.insert(seen[3]);
    stages.insert(seen[4]);
    EXPECT_GE(std::stoi(seen[1]), last) << line.text;
    EXPECT_LE(last = std::stoi(seen[1]), std::stoi(seen[2])) << line.text;
    times += seen[6].matched;
  }
  // preparing, three cases, three folders of files, the comparison
  EXPECT_EQ(parts.size(), 8u);
  EXPECT_EQ(last, 8);
  for (const char* stage : {"surface", "correct", "draw", "compare"})
    EXPECT_TRUE(stages.contains(stage)) << stage;
  EXPECT_GE(times, 2) << "of " << watched.lines.size() << " lines in " << watched.total_s << " s";
}

TEST(Waiting, WithoutATerminalEveryPartIsALine) {
  const safety::Folder folder;
  const std::string scene = (safety::source / "scenes/new/lathe.toml").string();
  const safety::Ran ran = safety::run("compare " + scene + " --out " + (folder / "out").string());
  ASSERT_EQ(ran.code, 0) << ran.text;
  for (const char* line :
       {"[1/8] prepare\n", "[2/8] error_free\n", "[4/8] perfect-position-program\n",
        "[5/8] write error_free\n", "[8/8] write comparison\n"})
    EXPECT_HAS(ran.text, line);
  EXPECT_EQ(ran.text.find('\x1b'), std::string::npos);
  const safety::Ran written =
      safety::run("rewrite " + scene + " --out " + (folder / "program.ngc").string());
  EXPECT_HAS(written.text, "[3/3] write\n");
  const safety::Ran exported = safety::run(
      "export " + scene + " --case perfect-position-table --out " + (folder / "tables").string());
  EXPECT_HAS(exported.text, "[3/3] write\n");
}

}  // namespace
}  // namespace abbe::sim
