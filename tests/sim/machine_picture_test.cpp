// The picture of `abbe check`: nothing hangs in the air, and a raster is lines.

#if ABBE_RENDER

#include "sim/report/machine_picture.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

/// 60 passes to and fro of 20 mm, 0.33 apart, without a rapid between them.
std::string zigzag() {
  std::string text = "%\nG21 G90 G94 G17\nG54\nG43.4 H1\nG0 X-10 Y-10 Z95 A0 C0\nG1 Z80 F1000\n";
  for (int i = 0; i < 60; ++i)
    text += fmt::format("G1 Y{:.3f}\nG1 X{}\n", -10.0 + i / 3.0, i % 2 == 0 ? 10 : -10);
  return text + "G0 Z95\nM2\n%\n";
}

render::MachinePicture zigzag_picture(bool without_blocks = false, const std::string& more = "") {
  const SceneFolder folder;
  const std::string program = folder.write("p.ngc", zigzag()).string();
  const std::string scenes = packaged("").string();
  const auto scene = folder.write(
      "s.toml",
      "machine = \"" + scenes + "machines/gantry_cxyza.toml\"\ntool = \"" + scenes +
          "tools/ball_r5.toml\"\n[part]\nsurface = \"rectangle\"\nlength_x_mm = "
          "20\nlength_y_mm = 20\nat_mm = [0, 0, 80]\nvertices = 200\n[program]\nfile = \"" +
          program + "\"\n" + more);
  Scene read = read_scene(scene);
  if (without_blocks) read.machine.bodies.clear();
  return machine_picture(prepare(read));
}

TEST(MachinePicture, DrawsStretchesOfALongPathAndNoSheet) {
  const render::MachinePicture picture = zigzag_picture();
  double all = 0.0, longest = 0.0;
  for (const render::DrawnPath& path : picture.paths) {
    double length = 0.0;
    for (Index i = 1; i < path.points.rows(); ++i)
      length += (path.points.row(i) - path.points.row(i - 1)).norm();
    longest = std::max(longest, length);
    all += length;
  }
  std::cout << picture.paths.size() << " stretches of " << longest << " mm at most, " << all
            << " mm of 1220\n";
  EXPECT_GE(picture.paths.size(), 5u);
  EXPECT_LT(longest, 60.0);  // about the part and the way down to it
  EXPECT_LT(all, 0.4 * 1220.0);
}

TEST(MachinePicture, OfAMachineWithoutBlocksStandsOnABed) {
  const render::MachinePicture picture = zigzag_picture(true);
  const auto bed = std::find_if(picture.bodies.begin(), picture.bodies.end(),
                                [](const render::Body& body) { return body.label == "bed"; });
  ASSERT_NE(bed, picture.bodies.end());
  const double top =
      bed->T.translation().z() + 0.5 * std::get<render::BlockShape>(bed->shape).size.z();
  int standing = 0;
  for (const render::Body& body : picture.bodies) {
    const auto* block = std::get_if<render::BlockShape>(&body.shape);
    if (!block || &body == &*bed) continue;
    const Vector3d half = 0.5 * block->size.z() * body.T.linear().col(2);
    const double low = body.T.translation().z() - std::abs(half.z());
    EXPECT_GE(low, top - 1e-6);
    standing += std::abs(low - top) < 1e-6;
  }
  EXPECT_EQ(standing, 2) << "a column of the tool's side and one of the part's";
}

// Half way through the program the axes stand at Z 80 and more, X Y within 10 mm, A and C at zero.
TEST(MachinePicture, DrawsTheBlocksOfTheMachineWhereItsAxesStand) {
  const render::MachinePicture picture = zigzag_picture();
  const auto labelled = [&](const std::string& label) -> const render::Body* {
    for (const render::Body& body : picture.bodies)
      if (body.label == label) return &body;
    return nullptr;
  };
  for (const char* label : {"bed", "C'", "X", "Y", "Z", "A", "s", "tool"})
    EXPECT_NE(labelled(label), nullptr) << label;
  EXPECT_EQ(picture.bodies.size(), 8u);
  const render::Body *table = labelled("C'"), *ram = labelled("Z"), *spindle = labelled("s"),
                     *tool = labelled("tool");
  ASSERT_TRUE(table && ram && spindle && tool);
  EXPECT_EQ(std::get<render::BlockShape>(table->shape).size, Vector3d(500, 500, 60));
  EXPECT_EQ(table->T.translation(), Vector3d(0, 0, -30));
  // ram and spindle go with the tool: the nose is at 50 mm, the ram's middle at 500, the spindle's
  // at 100 with the axes at zero
  const Vector3d nose = tool->T * Vector3d(0, 0, 100);
  EXPECT_NEAR((spindle->T.translation() - nose - Vector3d(0, 0, 50)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((ram->T.translation() - nose - Vector3d(0, 0, 450)).norm(), 0.0, 1e-9);
}

TEST(MachinePicture, DrawsFixturesByTheirNamesWhereThePartStands) {
  const auto labelled = [](const render::MachinePicture& picture, const std::string& label) {
    return std::ranges::find(picture.bodies, label, &render::Body::label);
  };
  const std::string fixtures =
      "[[fixture]]\nname = \"vice\"\nsize_mm = [40, 10, 30]\nat_mm = [0, 25, 65]\n"
      "[[fixture]]\nshape = \"cylinder\"\nradius_mm = 4\nheight_mm = 10\nat_mm = [20, 0, 70]\n";
  for (const bool without_blocks : {false, true}) {
    const render::MachinePicture picture = zigzag_picture(without_blocks, fixtures);
    const auto vice = labelled(picture, "vice");
    ASSERT_NE(vice, picture.bodies.end());
    EXPECT_NE(labelled(picture, "fixture"), picture.bodies.end());
    const auto& solid = std::get<render::SolidShape>(vice->shape);
    const Vector3d low = solid.vertices.colwise().minCoeff().transpose(),
                   high = solid.vertices.colwise().maxCoeff().transpose();
    EXPECT_NEAR((low - Vector3d(-20, 20, 50)).norm(), 0.0, 1e-9);
    EXPECT_NEAR((high - Vector3d(20, 30, 80)).norm(), 0.0, 1e-9);
    EXPECT_EQ(vice->T.matrix(), picture.frames.front().T.matrix()) << "the workpiece";
    EXPECT_EQ(zigzag_picture(without_blocks).bodies.size() + 2, picture.bodies.size());
  }
}

}  // namespace
}  // namespace abbe::sim

#endif
