#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/safety/program_run.h"

/// What a program leaves to its control, as the commands report it.
namespace abbe::safety {
namespace {

using nlohmann::json;

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
    EXPECT_NE(ran.text.find("line 5: 2 blocks after / left out: block skip is on"),
              std::string::npos)
        << ran.text;
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
  EXPECT_NE(stated.text.find("line 5: 2 blocks after / executed: block skip is off"),
            std::string::npos)
      << stated.text;
  EXPECT_EQ(lines_of(stated.text, "program.startup_code"), 0) << stated.text;
  const Ran wrong = run("check " + scene + " --set program.block_skip=maybe");
  EXPECT_EQ(wrong.code, 3) << wrong.text;
  EXPECT_NE(wrong.text.find("\"on\", \"off\" or levels such as \"1 3\""), std::string::npos)
      << wrong.text;
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
