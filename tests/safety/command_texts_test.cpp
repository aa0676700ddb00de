#include <nlohmann/json.hpp>
#include "tests/safety/every_command.h"
#include "tests/safety/program_run.h"
#include "tests/sim/packaged_remarks.h"
#include "tests/test.h"

/// What commands say, and where they put what they write.
namespace abbe::safety {
namespace {

using nlohmann::json;

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

// What a program leaves to its control, as the commands report it.

json json_of(const std::string& arguments) {
  const Ran ran = shell(std::string("(") + ABBE_PROGRAM + " " + arguments + " --json 2>/dev/null)");
  return json::parse(ran.text, nullptr, false);
}

/// How many lines of the text begin with "abbe: assumed:" and name the key.
int lines_of(const std::string& text, const std::string& key) {
  int count = 0;
  for (std::size_t at = text.find("abbe: assumed: "); at != std::string::npos;
       at = text.find("abbe: assumed: ", at + 1))
    count += text.substr(at, text.find('\n', at) - at).find("(" + key) != std::string::npos;
  return count;
}

std::string keys_of(const json& assumptions) {
  std::string keys;
  for (const json& one : assumptions) keys += one["key"].get<std::string>() + " ";
  return keys;
}

// The program of a part whose operator may leave out two blocks, in the units of the control.
const std::string open_program =
    "G90 G17\nG43.4 H1\nG0 X-10 Y0 Z95 A0 C0\nG1 Z80 F1000\n/G1 Y1\n/G1 Y0\nG1 X10\nG0 Z95\nM2\n";

TEST(AssumptionsOfCommands, AreSaidOnceByEachAndListedInItsResult) {
  const Folder folder;
  folder.write("p.ngc", open_program);
  const std::string scene = folder.write("scene.toml", small_scene()).string();
  for (const std::string command : {"check", "run", "compare"}) {
    SCOPED_TRACE(command);
    const std::string out = command == "check" ? "" : " --force --out " + (folder / "out").string();
    const Ran ran = run(command + " " + scene + out);
    EXPECT_EQ(ran.code, 0) << ran.text;
    EXPECT_EQ(lines_of(ran.text, "program.block_skip"), 1) << ran.text;
    EXPECT_EQ(lines_of(ran.text, "program.startup_code"), 1) << ran.text;
    EXPECT_HAS(ran.text, "line 5: 2 blocks after / left out: block skip is on");
    const json all = json_of(command + " " + scene + out);
    ASSERT_TRUE(all.is_object());
    // check says the dialect beside the program
    EXPECT_EQ(keys_of(all["assumptions"]),
              std::string(command == "check" ? "" : "program.dialect ") +
                  "program.block_skip program.startup_code ");
  }
  const json summary = json::parse(bytes(folder / "out/error_free/summary.json"), nullptr, false);
  ASSERT_TRUE(summary.is_object());
  EXPECT_EQ(keys_of(summary["assumptions"]),
            "program.dialect program.block_skip program.startup_code ");
  const Ran stated =
      run("check " + scene + " --set program.block_skip=off --set 'program.startup_code=G21 G94'");
  EXPECT_HAS(stated.text, "line 5: 2 blocks after / executed: block skip is off");
  EXPECT_EQ(lines_of(stated.text, "program.startup_code"), 0) << stated.text;
  const Ran wrong = run("check " + scene + " --set program.block_skip=maybe");
  EXPECT_EQ(wrong.code, 3) << wrong.text;
  EXPECT_HAS(wrong.text, "\"on\", \"off\" or levels such as \"1 3\"");
}

TEST(AssumptionsOfCommands, TheOnlyToolCutsABossThatNoCallNames) {
  const Folder folder;
  const auto contour = [](const std::string& call) {
    return "G21 G90 G17 G94\n" + call +
           "G54 G0 X25 Y-60\nG0 Z60\nS3000 M3\nG1 Z39 F1000\nG42 X25 Y-25\nG1 Y0 F500\n"
           "G3 X25 Y0 I-25 J0\nG1 Y25\nG40 X25 Y60\nG0 Z60\nM2\n";
  };
  const std::string scene =
      folder
          .write("boss.toml",
                 "machine = \"library:three_axis_table\"\n[tool]\nkind = \"flat\"\nradius_mm = "
                 "8\nflank_length_mm = 50\nlength_mm = 110\n[part]\nsurface = "
                 "\"cylinder\"\nradius_mm = 25\nheight_mm = 10\nat_mm = [0, 0, 40]\nvertices = "
                 "2000\n[program]\nfile = \"boss.ngc\"\nwork_offset = { G54 = { Z_mm = 10 } }\n")
          .string();
  std::vector<json> residuals;
  for (const std::string call : {"", "T1 M6\n"}) {
    SCOPED_TRACE(call);
    folder.write("boss.ngc", contour(call));
    const json all = json_of("run " + scene + " --force --out " + (folder / "boss").string());
    ASSERT_TRUE(all.is_object());
    EXPECT_LT(all["residual_um"]["pv"], 0.001) << all["residual_um"];
    EXPECT_EQ(keys_of(all["assumptions"]),
              call.empty() ? "program.dialect program.startup_code " : "program.dialect ");
    residuals.push_back(all["residual_um"]);
  }
  EXPECT_EQ(residuals[0], residuals[1]);
}

TEST(AssumptionsOfCommands, ATableOfFanucRollsOverUnlessTheMachineSaysOtherwise) {
  const Folder folder;
  const std::string program =
      folder
          .write("turns.nc",
                 "O1\nG21 G90\nG0 C0.\nN1 G90 C-150.\nN2 G90 C540.\nN3 G90 C-620.\nN4 G91 "
                 "C380.\nN5 G91 C-840.\nM30\n")
          .string();
  const json rolled = json_of("program " + program + " --machine library:trunnion_ca");
  ASSERT_TRUE(rolled.is_object());
  // turned by -150, -30, -80, 380 and -840
  EXPECT_NEAR(rolled["axes"]["C"]["from"], -720.0, 1e-9);
  EXPECT_NEAR(rolled["axes"]["C"]["to"], 120.0, 1e-9);
  EXPECT_EQ(keys_of(rolled["assumptions"]), "machine.axis.C.rollover ");
  std::string machine = bytes(source / "scenes/machines/trunnion_ca.toml");
  const std::string section = "[axis.C]\n";
  machine.insert(machine.find(section) + section.size(), "rollover = \"none\"\n");
  const json counted = json_of("program " + program + " --machine " +
                               folder.write("counted.toml", machine).string());
  ASSERT_TRUE(counted.is_object());
  EXPECT_NEAR(counted["axes"]["C"]["from"], -1080.0, 1e-9);
  EXPECT_NEAR(counted["axes"]["C"]["to"], 540.0, 1e-9);
  EXPECT_EQ(keys_of(counted["assumptions"]), "");
}

TEST(AssumptionsOfCommands, TheSwitchOfTheOperatorIsAnOption) {
  const Folder folder;
  const std::string program =
      folder
          .write("skip.nc",
                 "O1\nG21 G90\nT1 M6\nG54\nG0 X0. Y0.\nG43 H1 Z5.\n/G0 X50. Y50.\nG1 Z-2. F200.\n"
                 "X60.\nM30\n")
          .string();
  const json on = json_of("program " + program);
  const json off = json_of("program " + program + " --block-skip off");
  ASSERT_TRUE(on.is_object() && off.is_object());
  EXPECT_EQ(off["blocks"].get<int>(), on["blocks"].get<int>() + 1);
  EXPECT_EQ(off["moves"].get<int>(), on["moves"].get<int>() + 1);
  EXPECT_NEAR(on["extent_at_feed_mm"]["X"][0], 0.0, 1e-9) << "it plunges at (0, 0)";
  EXPECT_NEAR(off["extent_at_feed_mm"]["X"][0], 50.0, 1e-9);
  int lines = 0;
  for (const json& one : on["assumptions"])
    lines +=
        one["key"] == "program.block_skip" && one["option"] == "--block-skip" && one["line"] == 7;
  EXPECT_EQ(lines, 1) << on["assumptions"];
  const json inches = json_of("program " + program + " --startup-code 'G20 G91'");
  ASSERT_TRUE(inches.is_object());
  EXPECT_EQ(run("program " + program + " --startup-code G777").code, 3);
  EXPECT_EQ(run("program " + program + " --block-skip maybe").code, 2);
}

}  // namespace
}  // namespace abbe::safety
