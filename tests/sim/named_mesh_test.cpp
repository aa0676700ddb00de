// Meshes that a scene names, part, blank, fixture and body of the machine alike: which of them is
// open, and where the scene names it; which is so small that its unit is doubted.

#include <string>

#include <gtest/gtest.h>

#include "sim/cut/bodies.h"
#include "sim/cut/placement.h"
#include "tests/sim/odd_scenes.h"
#include "tests/sim/refusal.h"

namespace abbe::sim {
namespace {

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
    for (std::string& text : body_warnings(job, job_bodies(job))) all.push_back(std::move(text));
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
      job_bodies(job);
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
    EXPECT_NE(text.find(place + ": expected a closed mesh for " + expected + ", seen "),
              std::string::npos)
        << text;
    EXPECT_NE(text.find("open.obj with 4 open edges, the first at "), std::string::npos) << text;
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
    EXPECT_NE(refused.find("; " + said), std::string::npos) << margin << refused;
  }
  EXPECT_EQ(doubts(warnings({.part = "metres.obj", .of_part = "edge_margin_mm = 0\n"})),
            text("the part", "part"));
}

}  // namespace
}  // namespace abbe::sim
