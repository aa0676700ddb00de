#include "sim/cut/judged_surface.h"

#include <algorithm>
#include <array>
#include <iostream>
#include <string>

#include <gtest/gtest.h>

#include "sim/cut/part_regions.h"
#include "sim/report/verdict.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using cutting::VertexStatus;
using Eigen::Vector3d;

constexpr double ball = 3.0, depth = 6.0;
const std::array<Vector3d, 4> outer = {
    Vector3d{-20, -15, 0}, {20, -15, 0}, {20, 15, 0}, {-20, 15, 0}};
const std::array<Vector3d, 4> inner = {Vector3d{-14, -9, 0}, {14, -9, 0}, {14, 9, 0}, {-14, 9, 0}};

/// A block with a pocket, sharp all around, two triangles a face as a CAD writes it.
std::string pocket_stl() {
  std::string text = "solid pocket\n";
  const auto triangle = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const Vector3d& p : {a, b, c})
      text += fmt::format("vertex {} {} {}\n", p.x(), p.y(), p.z());
    text += "endloop\nendfacet\n";
  };
  const auto face = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c,
                        const Vector3d& d) {
    triangle(a, b, c);
    triangle(a, c, d);
  };
  const auto at = [](const Vector3d& p, double z) { return Vector3d(p.x(), p.y(), z); };
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t j = (i + 1) % 4;
    face(outer[i], outer[j], inner[j], inner[i]);
    face(at(outer[i], -12), at(outer[j], -12), outer[j], outer[i]);
    face(at(inner[j], -depth), at(inner[i], -depth), inner[i], inner[j]);
  }
  face(at(inner[0], -depth), at(inner[1], -depth), at(inner[2], -depth), at(inner[3], -depth));
  face(at(outer[3], -12), at(outer[2], -12), at(outer[1], -12), at(outer[0], -12));
  return text + "endsolid pocket\n";
}

/// Passes of the ball over the floor, 0.25 mm apart, as near to the walls as they let it.
std::string pocket_program(double z) {
  std::string text = fmt::format("G21 G90 G94\nG43 H1\nG0 X0 Y0 Z30\nF1000\nG1 Z{}\n", z);
  for (int i = 0; i <= 48; ++i) {
    const double x = i % 2 == 0 ? 11.0 : -11.0;
    text += fmt::format("G1 X{} Y{}\nG1 X{}\n", -x, -6.0 + 0.25 * i, x);
  }
  return text + "G0 Z30\nM30\n";
}

class Pocket : public testing::Test {
 protected:
  Job job(double z, const std::string& keys = "") {
    folder_.write("pocket.stl", pocket_stl());
    folder_.write("p.nc", pocket_program(z));
    folder_.write("ball.toml",
                  "name = \"ball R3\"\nkind = \"ball\"\nradius_mm = 3\nflank_length_mm = 12\n"
                  "length_mm = 50\n");
    return prepare(read_scene(
        folder_.write("s.toml", "machine = \"" + packaged("machines/gantry_cxyza.toml").string() +
                                    "\"\ntool = \"ball.toml\"\n"
                                    "[program]\nfile = \"p.nc\"\n"
                                    "work_offset.G54 = { X_mm = 40, Y_mm = 25, Z_mm = 80 }\n"
                                    "[part]\nfile = \"pocket.stl\"\nat_mm = [40, 25, 80]\n" +
                                    keys)));
  }
  SceneFolder folder_;
};

/// What the ball can make of the part by closed form: the floor under its passes, and the walls
/// above the round of its end. PV is the cusp.
TEST_F(Pocket, ThePartThatTheBallFitsIntoIsJudged) {
  const Job meant = sampled(job(-depth, "edge_margin_mm = 0\n"));
  const Verdict free = judge(meant, cut_error_free(meant), nullptr);
  const double floor_area = 22.0 * 12.0, walls = 2.0 * (22.0 + 12.0) * (depth - ball);
  const ExcludedArea& excluded_area = meant.sampled->excluded_area;
  const double cusp = ball - std::sqrt(ball * ball - 0.125 * 0.125);
  std::cout << "judged " << meant.sampled->judged_area << " of " << floor_area + walls
            << " mm^2; PV " << *free.residual.pv / units::um << " um of " << cusp / units::um
            << "; unreached " << excluded_area.unreached << ", corner " << excluded_area.corner
            << ", run-out " << excluded_area.lead_out_area << " mm^2\n";
  EXPECT_NEAR(meant.sampled->judged_area, floor_area + walls, 0.2 * (floor_area + walls));
  EXPECT_NEAR(meant.sampled->judged_area + excluded_area.area(), meant.design_w.area.sum(), 1e-9);
  EXPECT_GE(*free.residual.pv, 0.98 * cusp);
  EXPECT_LE(*free.residual.pv, cusp + 2e-4 * ball);
  EXPECT_GT(excluded_area.corner,
            300.0);  // floor within R of the walls, walls within R of the floor
  EXPECT_GT(excluded_area.max_remaining_height, 1.0);
  EXPECT_NE(
      exclusion_text(*meant.sampled).find("where the tool's corner radius of 3 mm does not fit"),
      std::string::npos)
      << exclusion_text(*meant.sampled);
  const auto wide = sampled(job(-depth, "edge_margin_mm = 0\njudged = \"all\"\n"));
  EXPECT_EQ(wide.sampled->excluded_area.area(), 0.0);
  EXPECT_GT(*judge(wide, cut_error_free(wide), nullptr).residual.pv, 1.0);
}

/// The floor is cut too deep from above: it is the floor's gouge, of no wall around it.
TEST_F(Pocket, AGougeOfTheFloorIsNoneOfTheWallsAround) {
  const Job deep = sampled(job(-depth - 2.5, "judged = \"all\"\n"));
  const cutting::Surface surface = cut_error_free(deep).surface;
  int of_floor = 0, of_others = 0;
  for (const cutting::Gouge& gouge : surface.gouges) {
    const double z = deep.design_w.vertices(gouge.vertex, 2) - 80.0;
    (std::abs(z + depth) < 1e-9 ? of_floor : of_others) += 1;
  }
  std::cout << of_floor << " vertices of the floor gouged, " << of_others << " of others\n";
  EXPECT_GT(of_floor, 20);
  EXPECT_EQ(of_others, 0);
}

TEST_F(Pocket, ALaterRegionWithoutAToleranceHasThatOfThePart) {
  const Job made = job(-depth,
                       "tolerance_um = 50\n[[part.region]]\nname = \"pocket\"\ntolerance_um = 5\n"
                       "box_mm = [-14, -9, -6, 14, 9, 0]\n[[part.region]]\nname = \"left half\"\n"
                       "box_mm = [-20, -15, -12, 0, 15, 0]\n");
  const auto bands = tolerance_bands(made.scene.part, made.face_groups, made.design_w);
  int right = 0, left = 0;
  for (Eigen::Index i = 0; i < bands.rows(); ++i) {
    const Vector3d p = made.design_w.vertices.row(i).transpose() - Vector3d(40, 25, 80);
    const bool in_pocket =
        std::abs(p.x()) < 14.000001 && std::abs(p.y()) < 9.000001 && p.z() > -6.000001;
    const bool is_left = p.x() < 1e-6;
    EXPECT_EQ(bands(i, 1), in_pocket && !is_left ? 5e-3 : 50e-3) << p.transpose();
    (is_left ? left : right) += in_pocket;
  }
  EXPECT_GT(left, 4);
  EXPECT_GT(right, 4);
}

}  // namespace
}  // namespace abbe::sim
