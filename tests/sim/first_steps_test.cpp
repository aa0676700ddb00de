#include <algorithm>
#include <cmath>
#include <iostream>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "sim/commands/command_line.h"
#include "sim/commands/scene_commands.h"
#include "sim/cut/cut.h"
#include "sim/scene/read_scene.h"
#include "tests/safety/program_run.h"

/// What somebody does first: asks for help, for the version, for a scene to begin with; and slips.
namespace abbe::sim {
namespace {

using safety::bytes;
using safety::Folder;
using safety::Ran;
using safety::run;
using safety::shell;
namespace fs = std::filesystem;

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
    EXPECT_TRUE(says(made.text, name)) << made.text;
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
    for (Eigen::Index i = 0; i < cam.residual.size(); ++i) {
      ASSERT_EQ(post.status[std::size_t(i)], cutting::VertexStatus::Cut) << kind << " " << i;
      most = std::max(most, std::abs(post.residual[i] - cam.residual[i]));
    }
    std::cout << kind << ": its map differs by " << 1e6 * most << " nm at most\n";
    // a post has steps of 0.1 or 0.01 um; on three axes the ball runs straight between two places,
    // on five its middle swings by 0.01 rad about a tip that does: R 5 mm * 0.011^2 / 8 is 80 nm
    EXPECT_LT(most, kind == "fanuc" || kind == "linuxcnc" ? 2e-4 : 2e-5) << kind;
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, NewScene, testing::ValuesIn(new_kinds()),
                         [](const auto& kind) { return kind.param; });

TEST(NewScene, RefusesAFolderWithFilesAndTouchesNone) {
  const Folder folder;
  folder.write("first/notes.txt", "mine");
  const Ran ran = run("new gantry " + (folder / "first").string());
  EXPECT_EQ(ran.code, 5);
  EXPECT_TRUE(says(ran.text, "expected a new or empty folder, seen a folder with notes.txt"))
      << ran.text;
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
  EXPECT_TRUE(says(full.text, "cannot be written")) << full.text;
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
    EXPECT_TRUE(says(ran.text, "  " + file + "\n")) << ran.text;
}

TEST(Help, EveryCommandHasTwoExamplesThatTheParserTakes) {
  for (const Command& command : commands()) {
    EXPECT_GE(command.examples.size(), 2u) << command.name;
    const Ran help = run(command.name + " --help");
    EXPECT_EQ(help.code, 0);
    for (const std::string& line : command.examples) {
      EXPECT_TRUE(line.starts_with("abbe " + command.name)) << line;
      EXPECT_EQ(parsed(line), Exit::Ok) << line;
      EXPECT_TRUE(says(help.text, "\n  " + line + "\n")) << help.text;
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
    EXPECT_TRUE(says(ran.text, one.wanted)) << one.line << ": " << ran.text;
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
    EXPECT_TRUE(says(ran.text, wanted)) << wanted << " in " << ran.text;
  EXPECT_TRUE(says(ran.text, "-ffp-contract=off")) << ran.text;
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
  EXPECT_TRUE(says(commit_of(folder), "\"unknown, built without git\"")) << "an unpacked archive";
  const std::string git =
      "git -C " + (folder / "source").string() + " -c user.name=a -c user.email=a@b ";
  if (shell(git + "init -q").code != 0) GTEST_SKIP() << "no git";
  ASSERT_EQ(
      shell(git + "add file && GIT_COMMITTER_DATE=2026-01-02T03:04:05Z " + git + "commit -q -m one")
          .code,
      0);
  const std::string name = shell(git + "log -1 --format=%h").text;
  const std::string wanted = "\"" + name.substr(0, name.find('\n')) + " of 2026-01-02";
  EXPECT_TRUE(says(commit_of(folder), wanted + "\";")) << commit_of(folder);
  const auto written = fs::last_write_time(folder / "commit.cpp");
  commit_of(folder);
  EXPECT_EQ(fs::last_write_time(folder / "commit.cpp"), written);
  folder.write("source/file", "two");
  EXPECT_TRUE(says(commit_of(folder), wanted + ", with changes since\";")) << commit_of(folder);
}

}  // namespace
}  // namespace abbe::sim
