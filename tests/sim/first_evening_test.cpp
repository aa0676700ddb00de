#include <fmt/format.h>

#include <gtest/gtest.h>

#include "tests/safety/program_run.h"
#include "tests/sim/odd_scenes.h"

/// Slips of a first evening: what the program says to each, from which the next step is clear.
namespace abbe::sim {
namespace {

using safety::Ran;

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
    if (!std::filesystem::exists(folder_ / "out")) return count;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "out"))
      count += entry.is_regular_file() && entry.path().filename() != ".abbe-result";
    return count;
  }
  /// Both `check` and `run` refuse with these words, and leave no files.
  void expect_refused(const std::string& scene, const std::string& words) const {
    for (const char* command : {"check", "run"}) {
      const Ran ran = run(command, scene);
      EXPECT_EQ(ran.code, 3) << ran.text;
      EXPECT_NE(ran.text.find(words), std::string::npos)
          << command << ": wanted " << words << "\n in " << ran.text;
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
    EXPECT_NE(ran.text.find("warning: " + words), std::string::npos)
        << "wanted " << words << "\n in " << ran.text;
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
  EXPECT_NE(found.text.find("library:machines/gantry_cxyza.toml"), std::string::npos)
      << "what is abbe's own is found wherever the scene stands: " << found.text;
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
  EXPECT_NE(ran.text.find("with the part scaled by 0.03937 it would be "), std::string::npos)
      << ran.text;
  EXPECT_NE(ran.text.find("check whether part.unit should be \"mm\""), std::string::npos)
      << ran.text;
}

}  // namespace
}  // namespace abbe::sim
