#include "sim/scene/library.h"

#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>

#include "sim/scene/document.h"
#include "sim/study/study.h"
#include "tests/sim/small_scene.h"

/// Scenes find machines, errors, tools and the rest beside themselves, then in the library.
namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

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
  EXPECT_NE(faults_of(folder.write("s.toml", text_of("library:trunion_ca", "library:ball_r5")))
                .find("s.toml:1:11: expected a library name: library:trunnion_ca, library:"),
            std::string::npos);
  const std::string beside =
      faults_of(folder.write("s.toml", text_of("lathe.toml", "library:ball_r5")));
  EXPECT_NE(beside.find("s.toml:1:11: expected a file that can be read, or a library name: "
                        "library:lathe_zx, library:"),
            std::string::npos)
      << beside;
  // of its own kind alone, all of them, and no file that a scene cannot name
  EXPECT_EQ(beside.find("library:ball"), std::string::npos) << beside;
  for (const char* machine : {"gantry_cxyza", "head_head", "platform_xz", "three_axis_table"})
    EXPECT_NE(beside.find("library:" + std::string(machine)), std::string::npos) << beside;
  const std::string data =
      faults_of(folder.write("s.toml", text_of("library:gantry_cxyza", "library:ball_r5") +
                                           "file = \"library:parts/freform\"\n"));
  EXPECT_NE(data.find("expected a library name: library:parts/freeform, library:"),
            std::string::npos)
      << data;
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
  EXPECT_NE(faults_of(names).find(
                "names.toml:1:11: expected a folder that contains abbe's machines/, seen"),
            std::string::npos)
      << faults_of(names);
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
  EXPECT_NE(files[0].text.find("machine = \"machine.toml\"\ntool = \"tool.toml\"\n[part]"),
            std::string::npos)
      << files[0].text;
  for (const CopiedFile& one : files) {
    if (one.name != "scene.toml") {
      EXPECT_EQ(one.text, bytes(one.from)) << one.name;
    }
    folder.write("copy/" + one.name, one.text);
  }
  EXPECT_EQ(read_scene(folder.path() / "copy/scene.toml").resolved, read_scene(scene).resolved);
}

}  // namespace
}  // namespace abbe::sim
