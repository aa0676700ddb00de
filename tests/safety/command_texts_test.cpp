#include <algorithm>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/safety/every_command.h"
#include "tests/sim/packaged_remarks.h"

/// What commands say, and where they put what they write.
namespace abbe::safety {
namespace {

std::string inside(const Folder& folder) { return "cd " + folder.path().string() + " &&"; }

bool has(const Ran& ran, const std::string& text) {
  return ran.text.find(text) != std::string::npos;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// ---- where results go

std::set<std::string> files_below(const fs::path& folder) {
  std::set<std::string> names;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (entry.is_regular_file()) names.insert(fs::relative(entry.path(), folder).string());
  return names;
}

TEST(Out, IsAFolderInEveryCommandAndHasAShortForm) {
  const CommandList list;
  const Folder folder;
  write_inputs(folder);
  folder.write("poses.csv", "X_mm\n1\n");
  std::vector<CommandCall> calls = small_calls();
  calls.push_back({"pose", "scene.toml --at-file poses.csv"});
  if (ABBE_RENDER) calls.push_back({"check", "scene.toml --picture"});
  std::set<std::string> writing;
  for (const CommandCall& call : calls) {
    const auto command = std::ranges::find(list.commands, call.command, &sim::Command::name);
    const std::string line = call.command + " " + call.arguments;
    if (!has_option(*command, "--out") || call.arguments.find("--at ") != std::string::npos)
      continue;
    EXPECT_TRUE(has(run(call.command + " --help"), "-o,--out")) << call.command;
    for (const char* out : {"a", "b"}) fs::remove_all(folder / out);
    const std::set<std::string> before = files_below(folder.path());
    const Ran with_short = run(line + " -o a/b.c/d", inside(folder));
    const Ran with_long = run(line + " --out b/b.c/d", inside(folder));
    EXPECT_EQ(with_short.code, 0) << line << ": " << with_short.text;
    EXPECT_EQ(with_long.code, 0) << line << ": " << with_long.text;
    const std::set<std::string> files = files_below(folder / "a/b.c/d");
    EXPECT_EQ(files, files_below(folder / "b/b.c/d")) << line;
    EXPECT_EQ(files,
              [&] {
                std::set<std::string> made = files_below(folder / "a");
                std::set<std::string> own;
                for (const std::string& name : made)
                  own.insert(name.substr(std::string("b.c/d/").size()));
                return own;
              }())
        << line << " writes elsewhere";
    if (!files.empty()) writing.insert(call.command);
    for (const char* out : {"a", "b"}) fs::remove_all(folder / out);
    EXPECT_EQ(files_below(folder.path()), before) << line << " writes elsewhere";
  }
  for (const sim::Command& command : list.commands)
    if (has_option(command, "--out") &&
        (ABBE_RENDER ||
         (command.name != "check" && command.name != "render" && command.name != "animate"))) {
      EXPECT_TRUE(writing.contains(command.name)) << command.name;
    }
}

TEST(Out, IsAFileWhereACommandWritesOneAndItsNameHasAnEnding) {
  const Folder folder;
  write_inputs(folder);
  folder.write("poses.csv", "X_mm\n1\n");
  const std::pair<std::string, std::string> calls[] = {
      {"identify readings/ball_bar.csv --elements EXX --order 1", "x/own.toml"},
      {"rewrite scene.toml --case perfect-position-program", "x/own.ngc"},
      {"pose scene.toml --at-file poses.csv", "x/own.csv"},
      {"report scene.toml", "x/own.html"}};
  for (const auto& [line, file] : calls)
    for (const std::string option : {" -o ", " --out "}) {
      fs::remove_all(folder / "x");
      const Ran ran = run(line + option + file, inside(folder));
      EXPECT_EQ(ran.code, 0) << line << ": " << ran.text;
      EXPECT_TRUE(fs::is_regular_file(folder / file)) << line << option << file;
    }
}

// ---- how much is said

TEST(Check, PrintsALineForEachOfATerminalAndTheRestIfAsked) {
  const std::string line = "check " + gantry_dome_scene() +
                           " --set part.vertices=500 --set program.step_over_mm=5 2> /dev/null";
  const std::vector<std::string> shown = lines_of(shell(ABBE_PROGRAM " " + line).text);
  const std::vector<std::string> all = lines_of(
      shell(ABBE_PROGRAM " " + line.substr(0, line.find(" 2>")) + " --all 2> /dev/null").text);
  ASSERT_EQ(shown.size(), 40u);
  ASSERT_GT(all.size(), 60u);
  EXPECT_EQ(shown.back(),
            "... and " + std::to_string(all.size() - 39) + " more lines: --all prints them");
  EXPECT_TRUE(std::equal(shown.begin(), shown.end() - 1, all.begin())) << "the same order";
  for (const char* first : {"machine  ", "part     ", "program  ", "axis  ", "reads    "})
    EXPECT_TRUE(std::ranges::any_of(shown, [&](const std::string& text) {
      return text.starts_with(first);
    })) << first;
}

/// First words of the lines of a list, from the line after its head to the next empty one.
std::vector<std::string> listed(const std::string& text, const std::string& head, int indent) {
  std::vector<std::string> names;
  bool inside_list = false;
  for (const std::string& line : lines_of(text)) {
    if (inside_list && line.empty()) break;
    if (inside_list && line.find_first_not_of(' ') == std::size_t(indent))
      names.push_back(line.substr(std::size_t(indent),
                                  line.find(' ', std::size_t(indent)) - std::size_t(indent)));
    inside_list = inside_list || line.starts_with(head);
  }
  return names;
}

TEST(Lists, AreSortedWhereTheirOrderMeansNothing) {
  const std::string library = run("new --list").text, help = run("help").text;
  for (const std::vector<std::string>& names :
       {listed(library, "kinds", 2), listed(library, "machines", 2), listed(help, "Topics", 2)}) {
    EXPECT_GE(names.size(), 5u);
    EXPECT_TRUE(std::ranges::is_sorted(names)) << names.front();
  }
}

// ---- what shipped scenes say of themselves

TEST(ShippedScenes, NeitherWarnNorAssumeButWhatIsListed) {
  const Folder folder;
  const std::string printed = (folder / "printed.txt").string();
  int scenes = 0;
  for (const auto& entry : fs::directory_iterator(source / "scenes")) {
    const fs::path& file = entry.path();
    if (file.extension() != ".toml") continue;
    const std::string scene = file.stem().string();
    SCOPED_TRACE(scene);
    const Ran checked =
        shell("(" ABBE_PROGRAM " check --all " + file.string() + " > " + printed + ")");
    EXPECT_EQ(checked.code, 0) << checked.text;
    for (const std::string& line : lines_of(checked.text))
      EXPECT_TRUE(!line.starts_with("abbe: ") || sim::is_remark(scene, line)) << line;
    for (const sim::Remark& remark : sim::packaged_remarks())
      EXPECT_TRUE(remark.scene != scene || !remark.is_of_check || has(checked, remark.text))
          << "listed and not said: " << remark.text;
    EXPECT_EQ(bytes(printed).find("as no word identifies another dialect"), std::string::npos)
        << "state the dialect";
    ++scenes;
  }
  EXPECT_GT(scenes, 25);
}

// ---- collisions that are not searched

/// The plane of `small_scene`, and then a hole beside it down to a depth.
std::string plunge_program(double z) {
  return "%\nG21 G90 G94 G17\nG54\nG43.4 H1\nG0 X-10 Y0 Z95 A0 C0\nG1 Z80 F1000\nG1 X10\nG0 Z95\n"
         "G0 X60\nG1 Z" +
         std::to_string(z) + " F1000\nG0 Z95\nM2\n%\n";
}

TEST(NotSearched, ATableThatTheToolGoesThroughIsNamedWithItsLine) {
  const Folder folder;
  folder.write("scene.toml", small_scene());
  folder.write("p.ngc", plunge_program(-20.0));
  for (const std::string command : {"check", "run", "compare"}) {
    const Ran ran = run(command + " scene.toml", inside(folder));
    EXPECT_EQ(ran.code, 0) << ran.text;
    EXPECT_TRUE(has(ran, "warning: this command does not check collisions, but ")) << ran.text;
    EXPECT_TRUE(has(ran, "table")) << ran.text;
    EXPECT_TRUE(has(ran, "on line 10")) << ran.text;
    EXPECT_TRUE(has(ran, "`abbe check --collisions`")) << ran.text;
  }
  const Ran searched = run("check scene.toml --collisions", inside(folder));
  EXPECT_EQ(searched.code, 1) << searched.text;
  EXPECT_FALSE(has(searched, "does not check collisions")) << searched.text;
}

TEST(NotSearched, NothingIsSaidWhereNothingComesNear) {
  const Folder folder;
  folder.write("scene.toml", small_scene());
  folder.write("p.ngc", plunge_program(30.0));
  for (const std::string command : {"check", "run", "check --collisions"}) {
    const Ran ran = run(command + " scene.toml", inside(folder));
    EXPECT_EQ(ran.code, 0) << ran.text;
    EXPECT_FALSE(has(ran, "does not check collisions")) << command << ": " << ran.text;
  }
}

TEST(NotSearched, TheSearchNeedsNoPartThatIsCut) {
  const Folder folder;
  folder.write("scene.toml", small_scene());
  const std::string program = plunge_program(-20.0);
  const std::size_t cut = program.find("G1 Z80");
  folder.write("p.ngc", program.substr(0, cut) + program.substr(program.find("G0 X60")));
  const Ran plain = run("check scene.toml", inside(folder));
  EXPECT_EQ(plain.code, 3) << plain.text;
  const Ran searched = run("check scene.toml --collisions", inside(folder));
  EXPECT_EQ(searched.code, 3) << searched.text;
  EXPECT_TRUE(has(searched, "cutter collide")) << searched.text;
  EXPECT_TRUE(has(searched, "comes within")) << "and why it cuts nothing: " << searched.text;
}

}  // namespace
}  // namespace abbe::safety
