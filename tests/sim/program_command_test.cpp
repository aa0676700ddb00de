#include <cmath>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/safety/program_run.h"

#ifndef ABBE_RENDER
#define ABBE_RENDER 0
#endif

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using safety::Folder;
using safety::Ran;
using safety::run;

const std::string finish =
    (safety::source / "tests/golden/cl_five_axis_finish/program.nc").string() + " --dialect cl";

json json_of(const std::string& arguments, const std::string& before = "") {
  const Ran ran =
      safety::shell("(" + before + ABBE_PROGRAM + " program " + arguments + " --json 2>/dev/null)");
  return json::parse(ran.text, nullptr, false);
}

TEST(ProgramCommand, SaysWhatAProgramAsksOfAMachine) {
  const json all = json_of(finish);
  ASSERT_TRUE(all.is_object());
  EXPECT_EQ(all["dialect"], "cl");
  EXPECT_EQ(all["machine"], "gantry CXYZA");
  EXPECT_EQ(all["moves"], 82);
  EXPECT_EQ(all["arcs"]["count"], 7);
  EXPECT_EQ(all["tools"][0]["number"], 1);
  EXPECT_EQ(all["tip_mode_blocks"], 82);
  // from home: Z at 340 mm, the nose 50 mm above the table at zero, the tool 100 mm long
  EXPECT_NEAR(all["extent_mm"]["Z"][1].get<double>(), 290.0, 1e-9);
  // the highest point at feed is the last of the retracts along the tool
  EXPECT_NEAR(all["extent_at_feed_mm"]["Z"][1].get<double>(), 60.9361, 1e-9);
  // A leads by 36 deg; the feed moves come no nearer to the pole than the least lean of the tool
  const double angle = all["singular"]["angle_deg"];
  EXPECT_NEAR(angle, std::abs(all["singular"]["axes"]["A"].get<double>()), 1e-9);
  EXPECT_GT(angle, 20.0);
  EXPECT_GT(all["time_by_axis_limits_s"], 0.0);
  EXPECT_GT(all["axes"]["Z"]["travel_left"], 0.0);
  bool counted = false;
  for (const json& word : all["words"])
    counted = counted || (word["word"] == "GOTO" && word["use"] == "read" && word["count"] == 82);
  EXPECT_TRUE(counted) << all["words"];
  const Ran text = run("program " + finish);
  EXPECT_EQ(text.code, 0) << text.text;
  for (const char* one : {"gantry CXYZA", "82 moves", "travel left", "singular", "T1, called once",
                          "describes one of 10 mm with a corner of 5 mm"})
    EXPECT_NE(text.text.find(one), std::string::npos) << one << " in\n" << text.text;
}

TEST(ProgramCommand, ConvertsAndReadsWhatItWroteToTheSameFigures) {
  const Folder folder;
  const json was = json_of(finish);
  for (const auto& [format, file, options] : {std::tuple{"cl", "program.cls", ""},
                                              {"nc", "program.ngc", ""},
                                              {"csv", "program.csv", " --dialect cl"},
                                              {"pvt", "program.pvt", ""}}) {
    SCOPED_TRACE(format);
    const std::string out = (folder.path() / format).string();
    const json written = json_of(finish + " --to " + format + " --out " + out);
    ASSERT_TRUE(written.is_object());
    ASSERT_TRUE(fs::exists(fs::path(out) / file));
    const json again = json_of((fs::path(out) / file).string() + options);
    ASSERT_TRUE(again.is_object()) << run("program " + (fs::path(out) / file).string()).text;
    for (const char* axis : {"X", "Y", "Z"})
      for (const int end : {0, 1}) {
        const double a = was["extent_at_feed_mm"][axis][end];
        const double b =
            again[std::string(format) == "pvt" ? "extent_mm" : "extent_at_feed_mm"][axis][end];
        if (std::string(format) != "pvt") {
          EXPECT_NEAR(a, b, 0.011) << axis;
        }
      }
    EXPECT_NEAR(was["time_s"].get<double>(), again["time_s"].get<double>(),
                1e-4 * was["time_s"].get<double>());
  }
}

TEST(ProgramCommand, WorkOffsetsAndTheToolShiftWhatTheAxesDo) {
  const Folder folder;
  folder.write("p.ngc", "G21 G90 G94 G54\nG43 H1\nG0 X10 Z60\nG1 X20 F1000\n");
  const std::string file = (folder.path() / "p.ngc").string();
  const json plain = json_of(file);
  const json moved = json_of(file + " --offset \"X=5 Z=10\" --tool-length 80");
  EXPECT_EQ(plain["axes"]["Z"]["from"], 160.0);
  // the nose stands 50 mm above the table with Z at zero
  EXPECT_EQ(moved["axes"]["Z"]["from"], 60.0 + 10.0 - 50.0 + 80.0);
  EXPECT_EQ(moved["axes"]["X"]["to"], 25.0);
  // an offset is a place in the workpiece
  EXPECT_NEAR(moved["extent_at_feed_mm"]["Z"][0].get<double>(), 70.0, 1e-12);
  EXPECT_EQ(run("program " + file + " --offset Q=5").code, 3);
}

TEST(ProgramCommand, LeavingTheTravelEndsWithThreeAndTheFigures) {
  const Folder folder;
  folder.write("far.ngc", "G21 G90 G94\nG0 X280\nG1 X350 F1000\nX-20\n");
  const std::string file = (folder.path() / "far.ngc").string();
  const Ran ran = run("program " + file);
  EXPECT_EQ(ran.code, 3);
  EXPECT_NE(ran.text.find("X leaves its travel of -300 to 300 mm by 50, on line 3 with 350"),
            std::string::npos)
      << ran.text;
  EXPECT_NE(ran.text.find("time "), std::string::npos) << "the figures come all the same";
}

TEST(ProgramCommand, FaultsOfUsageAndInputLeaveNoFiles) {
  const Folder folder;
  folder.write("bad.ngc", "G21\nG12.1 X1\nG1 X1\n");
  const std::string at = "cd " + folder.path().string() + " && ";
  const Ran bad = run("program bad.ngc --to cl --picture --out made", at);
  EXPECT_EQ(bad.code, 3);
  EXPECT_NE(bad.text.find("bad.ngc:2:1: expected a G code"), std::string::npos) << bad.text;
  EXPECT_FALSE(fs::exists(folder.path() / "made"));
  EXPECT_EQ(run("program none.ngc", at).code, 3);
  EXPECT_EQ(run("program bad.ngc --machine gantri", at).code, 3);
  EXPECT_NE(run("program bad.ngc --machine gantry_cxyz", at).text.find("gantry_cxyza"),
            std::string::npos)
      << "the nearest of the library is named";
  EXPECT_EQ(run("program bad.ngc --to dxf", at).code, 2);
  EXPECT_EQ(run("program bad.ngc --tolerance-um 0", at).code, 2);
  EXPECT_EQ(run("program", at).code, 2);
  const Ran skipped = run("program bad.ngc --skip-unknown", at);
  EXPECT_NE(skipped.text.find("no axis words beside a code that is skipped"), std::string::npos)
      << skipped.text;
}

TEST(ProgramCommand, CountsWithTheTablesOfAControl) {
  const Folder folder;
  folder.write("p.ngc", "G21 G90 G94 G55\nT1 M6\nG43 H1\nG0 Z5\nT2 M6\nG43 H2\nG0 Z7\nG49\nM2\n");
  folder.write("t.tbl", "T1 Z80 D10\nT2 Z120.5 D6\n");
  folder.write("o.var", "5221 0\n5243 -250\n");
  const std::string at = "cd " + folder.path().string() + " && ";
  const std::string words = "p.ngc --machine three_axis_table --offsets o.var --unit mm";
  const json all = json_of(words + " --tools t.tbl", at);
  ASSERT_TRUE(all.is_object());
  // the slide stands at offset + length + word, from home at 390 mm
  EXPECT_NEAR(all["axes"]["Z"]["to"].get<double>(), 390.0, 1e-9) << all["axes"]["Z"];
  EXPECT_NEAR(all["axes"]["Z"]["from"].get<double>(), -250 + 80 + 5, 1e-9);
  EXPECT_EQ(all["tool_table"], "t.tbl");
  const Ran text = run("program " + words + " --tools t.tbl", at);
  EXPECT_NE(text.text.find("tools of t.tbl"), std::string::npos) << text.text;
  EXPECT_EQ(run("program " + words + " --tools t.tbl --to cl", at).code, 2);
  EXPECT_EQ(run("program " + words + " --offset X=1", at).code, 2);
  folder.write("t.tbl", "T1 Z80 D10\n");
  const Ran missing = run("program " + words + " --tools t.tbl", at);
  EXPECT_EQ(missing.code, 3);
  EXPECT_NE(missing.text.find("p.ngc:5:1: expected a tool of the tool table"), std::string::npos)
      << missing.text;
  folder.write("t.tbl", "T1 Z80 Q\n");
  EXPECT_NE(run("program " + words + " --tools t.tbl", at).text.find("t.tbl:1:9: expected"),
            std::string::npos);
}

#if ABBE_RENDER
TEST(ProgramCommand, DrawsMachineAndPath) {
  const Folder folder;
  const std::string out = (folder.path() / "drawn").string();
  const Ran ran = run("program " + finish + " --picture --out " + out);
  EXPECT_EQ(ran.code, 0) << ran.text;
  EXPECT_GT(fs::file_size(fs::path(out) / "path.png"), 10000u);
}
#endif

}  // namespace
}  // namespace abbe::sim
