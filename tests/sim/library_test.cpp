#include "sim/scene/library.h"
#include "sim/cut/bodies.h"
#include "sim/cut/placement.h"
#include "sim/scene/document.h"
#include "sim/study/study.h"
#include "tests/sim/odd_scenes.h"
#include "tests/sim/refusal.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

/// Scenes find machines, errors, tools and the rest beside themselves, then in the library.
namespace abbe::sim {
namespace {

std::string text_of(const std::string& machine, const std::string& tool) {
  return "machine = \"" + machine + "\"\ntool = \"" + tool +
         "\"\n[part]\nsurface = \"rectangle\"\nlength_x_mm = 4\nlength_y_mm = 4\n"
         "at_mm = [0, 0, 80]\n[program]\ngenerator = \"raster\"\n";
}

/// Another library for as long as it lives; an empty name: that of the program again.
class Library {
 public:
  explicit Library(const fs::path& folder) { ::setenv("ABBE_LIBRARY", folder.c_str(), 1); }
  ~Library() { ::unsetenv("ABBE_LIBRARY"); }
};

TEST(Library, StandsBesideTheProgramOfABuild) {
  EXPECT_TRUE(fs::equivalent(library_folder(), packaged("")));
}

TEST(Library, ANameMeansTheFileOfItsKind) {
  const SceneFolder folder;
  const Scene scene =
      read_scene(folder.write("s.toml", text_of("library:trunnion_ca", "library:ball_r5.toml") +
                                            "[[variant]]\nname = \"v\"\nset = { machine = "
                                            "\"library:gantry_cxyza\" }\n"),
                 {{"errors", "library:errors/trunnion_typical"}});
  EXPECT_EQ(scene.machine.name, "trunnion C'A'");
  EXPECT_FALSE(scene.geometric.elements.empty());
  const auto reads = [&](const fs::path& file) {
    return std::ranges::find(scene.files, library_folder() / file) != scene.files.end();
  };
  EXPECT_TRUE(reads("machines/trunnion_ca.toml") && reads("tools/ball_r5.toml") &&
              reads("machines/gantry_cxyza.toml"))
      << "input files are never overwritten";
}

TEST(Library, ACopiedSceneReadsAnywhereAndIsTheSame) {
  const SceneFolder folder;
  for (const std::string& name : packaged_scenes()) {
    const fs::path alone = folder.path() / fs::path(name).stem() / name;
    fs::create_directories(alone.parent_path());
    fs::copy_file(packaged(name), alone);
    EXPECT_EQ(read_scene(alone).resolved, read_scene(packaged(name)).resolved) << name;
  }
}

TEST(Library, WhatStandsBesideTheSceneComesFirst) {
  const SceneFolder folder;
  folder.write("tools/ball_r5.toml",
               "kind = \"ball\"\nradius_mm = 4\nflank_length_mm = 20\nlength_mm = 100\n");
  const fs::path file =
      folder.write("s.toml", text_of("machines/gantry_cxyza.toml", "tools/ball_r5.toml"));
  const auto radius = [&] {
    return std::get<cutting::Cutter>(read_scene(file).tool.nominal).radius;
  };
  EXPECT_EQ(radius(), 4.0);
  fs::remove(folder.path() / "tools/ball_r5.toml");
  EXPECT_EQ(radius(), 5.0);
}

TEST(Library, ANameThatIsNotThereListsWhatIsTheNearestFirst) {
  const SceneFolder folder;
  EXPECT_HAS(faults_of(folder.write("s.toml", text_of("library:trunion_ca", "library:ball_r5"))),
             "s.toml:1:11: expected a library name: library:trunnion_ca, library:");
  const std::string beside =
      faults_of(folder.write("s.toml", text_of("lathe.toml", "library:ball_r5")));
  EXPECT_HAS(beside,
             "s.toml:1:11: expected a file that can be read, or a library name: "
             "library:lathe_zx, library:");
  // of its own kind alone, all of them, and no file that a scene cannot name
  EXPECT_EQ(beside.find("library:ball"), std::string::npos) << beside;
  for (const char* machine : {"gantry_cxyza", "head_head", "platform_xz", "three_axis_table"})
    EXPECT_HAS(beside, "library:" + std::string(machine));
  const std::string data =
      faults_of(folder.write("s.toml", text_of("library:gantry_cxyza", "library:ball_r5") +
                                           "file = \"library:parts/freform\"\n"));
  EXPECT_HAS(data, "expected a library name: library:parts/freeform, library:");
}

TEST(Library, AStudyMayNameItsSceneInTheLibrary) {
  const SceneFolder folder;
  const std::string inputs =
      "[[input]]\nname = \"k\"\npath = \"errors.scale\"\ncentre = 1.0\nspread = 0.5\n";
  const study::Study named =
      study::read_study(folder.write("s.toml", "scene = \"library:gantry_dome\"\n" + inputs));
  EXPECT_EQ(fs::path(named.scene), library_folder() / "gantry_dome.toml");
}

TEST(Library, WithoutOneOnlyNamesOfItAreRefused) {
  const SceneFolder folder;
  const std::string here = packaged("").string();
  const fs::path whole = folder.write(
      "whole.toml", text_of(here + "machines/gantry_cxyza.toml", here + "tools/ball_r5.toml"));
  const fs::path names =
      folder.write("names.toml", text_of("library:gantry_cxyza", "library:ball_r5"));
  const Library none(folder.path());
  EXPECT_EQ(faults_of(whole), "");
  EXPECT_HAS(faults_of(names),
             "names.toml:1:11: expected a folder that contains abbe's machines/, seen");
}

TEST(Library, AnotherOneServesByItsFolder) {
  const SceneFolder folder;
  fs::create_directories(folder.path() / "machines");
  fs::copy_file(packaged("machines/lathe_zx.toml"), folder.path() / "machines/mine.toml");
  const fs::path file =
      folder.write("s.toml", text_of("library:mine", packaged("tools/ball_r5.toml").string()));
  const Library mine(folder.path());
  EXPECT_EQ(read_scene(file).machine.name, "lathe ZX");
}

TEST(SceneCopy, KeepsEveryTextAndNamesFilesByTheirSections) {
  const SceneFolder folder;
  folder.write("a/first.toml", "EXX_um = 1 # one\n");
  folder.write("second.toml", "EXX_um = 2 # two\n");
  const fs::path scene = folder.write(
      "s.toml", "# head\nerrors = [\"a/first.toml\", 'second.toml'] # both\n" +
                    text_of(packaged("machines/gantry_cxyza.toml").string(), "library:ball_r5"));
  const std::vector<CopiedFile> files = scene_copy(scene);
  ASSERT_EQ(files.size(), 5u);
  EXPECT_EQ(files[0].text.substr(0, 52), "# head\nerrors = [\"errors.toml\", 'errors_2.toml'] # b");
  EXPECT_HAS(files[0].text, "machine = \"machine.toml\"\ntool = \"tool.toml\"\n[part]");
  for (const CopiedFile& one : files) {
    if (one.name != "scene.toml") {
      EXPECT_EQ(one.text, bytes(one.from)) << one.name;
    }
    folder.write("copy/" + one.name, one.text);
  }
  EXPECT_EQ(read_scene(folder.path() / "copy/scene.toml").resolved, read_scene(scene).resolved);
}

// Meshes that a scene names, part, blank, fixture and body of the machine alike: which of them is
// open, and where the scene names it; which is so small that its unit is doubted.

/// A scene whose meshes are these files.
struct Meshes {
  std::string part = "box.obj";
  std::string blank = "box.obj";
  std::string fixture = "box.obj";
  std::string body = "box.obj";
  std::string of_part = {};  // more lines
  std::string of_blank = {};
};

class NamedMesh : public testing::Test {
 protected:
  void SetUp() override {
    write_odd_files(folder_);
    const std::string box = box_obj(true);
    folder_.write("open.obj", box.substr(0, box.rfind("f ")));
    std::string small;
    for (const double z : {0.0, 0.01})
      for (const double y : {-0.01, 0.01})
        for (const double x : {-0.01, 0.01}) small += fmt::format("v {} {} {}\n", x, y, z);
    folder_.write("metres.obj", small + box.substr(box.find("f ")));
  }

  Scene scene(const Meshes& of) const {
    const std::string ram =
        "[[body]]\nname = \"ram\"\ncarried_by = \"Z\"\nshape = \"mesh\"\nfile = \"" + of.body +
        "\"\nat_mm = [0, 0, 500]\n";
    folder_.write("machine.toml", std::string(axes) + ram);
    return read_scene(folder_.write(
        "scene.toml",
        "machine = \"machine.toml\"\n[tool]\nkind = \"ball\"\nradius_mm = 5\n"
        "flank_length_mm = 25\nlength_mm = 100\n[part]\nfile = \"" +
            of.part + "\"\n" + of.of_part +
            "[program]\nfile = \"box.ngc\"\n[cutting]\nblank = \"mesh\"\nfile = \"" + of.blank +
            "\"\n" + of.of_blank +
            "[[fixture]]\nname = \"clamp\"\nshape = \"mesh\"\nat_mm = [50, 0, 0]\nfile = \"" +
            of.fixture + "\"\n"));
  }

  std::vector<std::string> warnings(const Meshes& of) const {
    const Job job = prepare(scene(of));
    std::vector<std::string> all = job.warnings;
    for (std::string& text : body_warnings(job, segment_bodies(job, job)))
      all.push_back(std::move(text));
    return all;
  }

  /// Of what was said what doubts a size.
  static std::string doubts(const std::vector<std::string>& said) {
    std::string text;
    for (const std::string& one : said)
      if (one.find("less than 1 mm") != std::string::npos) text += one + "\n";
    return text;
  }

  std::string refusal(const Meshes& of) const {
    return refusal_by([&] {
      const Job job = prepare(scene(of));
      segment_bodies(job, job);
      check_placement(job);
    });
  }

  static constexpr const char* axes =
      "code = \"w b X Y Z s t\"\nnose = { at_mm = [0, 0, 100] }\nhome = { Z_mm = 290 }\n"
      "[axis.X]\ntravel_mm = [-300, 300]\n[axis.Y]\ntravel_mm = [-300, 300]\n"
      "[axis.Z]\ntravel_mm = [-300, 300]\n";

  SceneFolder folder_;
};

TEST_F(NamedMesh, ThatIsOpenIsNamedWithItsPlaceInTheScene) {
  EXPECT_EQ(refusal({}), "");
  const auto expect = [&](const Meshes& of, const std::string& place, const std::string& expected) {
    const std::string text = refusal(of);
    EXPECT_HAS(text, place + ": expected a closed mesh for " + expected + ", seen ");
    EXPECT_HAS(text, "open.obj with 4 open edges, the first at ");
  };
  expect({.part = "open.obj"}, "scene.toml:8:8",
         "the part, or part.open = true for an open surface");
  expect({.blank = "open.obj"}, "scene.toml:13:8", "the blank");
  expect({.fixture = "open.obj"}, "scene.toml:18:8", "fixture \"clamp\"");
  expect({.body = "open.obj"}, "machine.toml:14:8", "body \"ram\"");
  EXPECT_EQ(refusal({.part = "open.obj", .of_part = "open = true\n"}), "");
}

TEST_F(NamedMesh, BelowAMillimetreIsDoubtedOfAllAlike) {
  const auto text = [](const std::string& what, const std::string& table) {
    return "the mesh of " + what + ", read in mm, is 0.02 x 0.02 x 0.01 mm, less than 1 mm: set " +
           table + ".unit (\"m\" for metres) for another unit, or " + table +
           ".any_size = true if the size is right\n";
  };
  EXPECT_EQ(doubts(warnings({})), "");
  EXPECT_EQ(doubts(warnings({.blank = "metres.obj"})), text("the blank", "cutting"));
  EXPECT_EQ(doubts(warnings({.fixture = "metres.obj"})), text("fixture \"clamp\"", "fixture"));
  EXPECT_EQ(doubts(warnings({.body = "metres.obj"})), text("body \"ram\"", "body"));
  EXPECT_EQ(doubts(warnings({.blank = "metres.obj", .of_blank = "any_size = true\n"})), "");
  EXPECT_EQ(doubts(warnings({.blank = "metres.obj", .of_blank = "unit = \"m\"\n"})), "");
  // of such a part nothing can be cut, and what is refused says why
  std::string said = text("the part", "part");
  said.pop_back();
  for (const char* margin : {"", "edge_margin_mm = 0\n"}) {
    const std::string refused = refusal({.part = "metres.obj", .of_part = margin});
    EXPECT_HAS(refused, "; " + said) << margin;
  }
  EXPECT_EQ(doubts(warnings({.part = "metres.obj", .of_part = "edge_margin_mm = 0\n"})),
            text("the part", "part"));
}

}  // namespace
}  // namespace abbe::sim
