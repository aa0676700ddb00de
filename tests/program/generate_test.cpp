#include "machines.h"
#include "sim/program/generators.h"
#include "sim/program/program_writers.h"
#include "tests/test.h"

namespace abbe::sim::program {
namespace {

using test::AxisVector;

constexpr double half_word = 0.5e-7;  // mm, rounding of the words

/// Closed-form designs: a sphere cap with its top at z = 0 and a plane.
ContactField dome(double radius, double rim) {
  return [=](double x, double y) -> std::optional<cutting::Contact> {
    if (x * x + y * y > rim * rim) return std::nullopt;
    const Vector3d n = Vector3d(x, y, std::sqrt(radius * radius - x * x - y * y)) / radius;
    return cutting::Contact{radius * n - Vector3d(0, 0, radius), n};
  };
}
std::optional<cutting::Contact> plane(double x, double y) {
  return cutting::Contact{{x, y, 0.0}, Vector3d::UnitZ()};
}

GeneratorContext context(const test::Chain& chain, double half_width) {
  return {
      chain, kinematics::Pose::Identity(), {-half_width, -half_width}, {half_width, half_width}, 1};
}

Path read(const std::string& text, const test::Chain& chain) {
  return read_nc(text, "generated.ngc", test::options_for(chain));
}

Vector3d tip(const AxisVector& q) { return {q[1], q[2], q[3]}; }
Vector3d direction(const AxisVector& q) {
  return {std::sin(q[0]) * std::sin(q[4]), -std::cos(q[0]) * std::sin(q[4]), std::cos(q[4])};
}

/// Postures that cut, pass by pass: the ends of feed blocks.
std::vector<std::vector<AxisVector>> passes_of(const Path& path) {
  std::vector<std::vector<AxisVector>> passes;
  bool cutting = false;
  for (const Block& block : path.blocks) {
    const bool feed = block.interpolation == Interpolation::Line;
    if (feed && !cutting) passes.emplace_back();
    if (feed) passes.back().push_back(block.end);
    cutting = feed;
  }
  return passes;
}

TEST(Raster, CountsWhatAMachineWithoutTheAxisForItDoesNotReach) {
  // a table that tilts about Y alone: on a dome only the pass through the middle has no lean in Y
  const test::Chain vector4(
      {test::joint('B', test::Side::Workpiece, test::Motion::Rotary, test::ey),
       test::joint('X', test::Side::Tool, test::Motion::Linear, test::ex),
       test::joint('Y', test::Side::Tool, test::Motion::Linear, test::ey),
       test::joint('Z', test::Side::Tool, test::Motion::Linear, test::ez)},
      kinematics::Pose::Identity(), kinematics::Pose::Identity());
  Raster raster;
  raster.step_over = raster.step = 1.0;
  raster.lead = 0.2;
  const MillingProgram made =
      generate_raster(raster, dome(60, 10), {5, 5, 20}, context(vector4, 10));
  const UnreachedPoints& u = made.unreached;
  EXPECT_EQ(passes_of(read(made.text, vector4)).size(), 1u);
  EXPECT_EQ(u.passes, u.all_passes - 1);
  EXPECT_GT(u.all_passes, 15);
  EXPECT_EQ(u.broken_passes, 0);
  EXPECT_EQ(u.first_pass, 1);
  EXPECT_EQ(u.why, kinematics::Reachability::Unreachable);
  EXPECT_GT(u.points, u.all_points / 2);
  EXPECT_LT(u.points, u.all_points);

  raster.lead = 0.0;
  const MillingProgram whole =
      generate_raster(raster, plane, {5, 5, 20}, context(test::gantry(), 10));
  EXPECT_EQ(whole.unreached.points, 0);
  EXPECT_EQ(whole.unreached.first_pass, 0);
}

TEST(Raster, PassesOnASphereLieAtEqualLatitude) {
  const double R = 60, rim = 25;
  Raster raster;
  raster.step_over = 0.8;
  raster.step = 2.0;
  const Path path =
      read(generate_raster(raster, dome(R, rim), {5, 5, 20}, context(test::gantry(), rim)).text,
           test::gantry());
  const auto passes = passes_of(path);
  const int half = int(R * std::asin(rim / R) / raster.step_over);
  ASSERT_EQ(int(passes.size()), 2 * half + 1);
  double off = 0.0;
  for (int k = 0; k < int(passes.size()); ++k) {
    const double latitude = (k - half) * raster.step_over / R;
    for (const AxisVector& q : passes[std::size_t(k)]) {
      // the ball's centre lies on the sphere of radius R + r, contact in the plane of the pass
      const Vector3d centre = tip(q) + 5 * direction(q) + Vector3d(0, 0, R);
      off = std::max({off, std::abs(centre.norm() - (R + 5)),
                      std::abs(centre.y() / centre.norm() * R - R * std::sin(latitude))});
    }
  }
  std::cout << "off by " << off << " mm over " << passes.size() << " passes\n";
  EXPECT_LT(off, 4 * half_word);
}

TEST(Raster, PointsOfAPassLieAtTheStepOfArcLength) {
  const double R = 60, rim = 25;
  Raster raster;
  raster.step_over = 5;
  raster.step = 0.7;
  const auto passes = passes_of(
      read(generate_raster(raster, dome(R, rim), {5, 5, 20}, context(test::gantry(), rim)).text,
           test::gantry()));
  double off = 0.0;
  for (const auto& pass : passes)
    for (std::size_t i = 2; i + 1 < pass.size(); ++i) {  // the step at one end is what is left
      const Vector3d a = tip(pass[i - 1]) + 5 * direction(pass[i - 1]),
                     b = tip(pass[i]) + 5 * direction(pass[i]);
      const double y = a.y() * R / (R + 5),
                   circle = std::sqrt(R * R - y * y);  // the section's radius
      const double chord = (b - a).norm() * R / (R + 5);
      off = std::max(off, std::abs(2 * circle * std::asin(chord / (2 * circle)) - raster.step));
    }
  std::cout << "off by " << off << " mm\n";
  EXPECT_LT(off, 4 * half_word);
}

TEST(Raster, PositiveLeadLeansTheAxisTowardsTheFeedAndTiltAcross) {
  Raster raster;
  raster.lead = 10 * units::deg;
  raster.tilt = 4 * units::deg;
  raster.step = raster.step_over = 2;
  const auto passes = passes_of(read(
      generate_raster(raster, plane, {5, 1, 20}, context(test::gantry(), 6)).text, test::gantry()));
  ASSERT_EQ(passes.size(), 7u);
  for (const auto& pass : passes) {
    const Vector3d feed = (tip(pass[1]) - tip(pass[0])).normalized();
    const Vector3d u = direction(pass[1]);
    EXPECT_NEAR(u.dot(feed), std::sin(raster.lead), 1e-8);
    // by hand, feed along x: a turn by +tilt about x takes z towards -y = x cross z
    EXPECT_NEAR(u.dot(feed.cross(Vector3d::UnitZ())), std::sin(raster.tilt) * std::cos(raster.lead),
                1e-8);
  }
  EXPECT_GT((tip(passes[0][1]) - tip(passes[0][0])).x(), 0);
  EXPECT_LT((tip(passes[1][1]) - tip(passes[1][0])).x(), 0);
}

TEST(Raster, CutterOfAnyShapeTouchesItsContactAndNothingElse) {
  for (const cutting::Cutter& cutter :
       {cutting::Cutter{5, 5, 20}, cutting::Cutter{5, 1, 20}, cutting::Cutter{5, 0, 20}})
    for (const double lead : {0.0, 0.2}) {
      Raster raster;
      raster.lead = lead;
      raster.step = raster.step_over = 1.5;
      const auto passes = passes_of(read(
          generate_raster(raster, plane, cutter, context(test::gantry(), 6)).text, test::gantry()));
      double worst = 0.0;
      for (const auto& pass : passes)
        for (const AxisVector& q : pass) {
          // lowest point of a cutter of revolution above a plane: tube centre circle, minus the
          // tube
          const Vector3d u = direction(q);
          const double sine = std::sqrt(std::max(0.0, 1 - u.z() * u.z()));
          const double r = cutter.corner_radius;
          const double lowest = tip(q).z() + r * u.z() - (cutter.radius - r) * sine - r;
          worst = std::max(worst, std::abs(lowest));
        }
      EXPECT_LT(worst, 2e-7) << cutter.corner_radius << " " << lead;
    }
}

TEST(Raster, LinksStayAboveTheDome) {
  const double R = 60, rim = 30;
  for (const bool zigzag : {true, false}) {
    Raster raster;
    raster.zigzag = zigzag;
    raster.lead = 0.2;
    raster.step_over = 3;
    raster.step = 1;
    const Path path = read(
        "G0 Z30\n" +
            generate_raster(raster, dome(R, rim), {5, 5, 20}, context(test::gantry(), rim)).text,
        test::gantry());
    double nearest = 1e9;
    for (const Block& block : path.blocks) {
      if (block.interpolation != Interpolation::Rapid || block.coordinates != Coordinates::Tip)
        continue;
      for (int k = 0; k <= 40; ++k) {
        const AxisVector q = position(path, block, k / 40.0);
        nearest = std::min(nearest, (tip(q) + 5 * direction(q) + Vector3d(0, 0, R)).norm() - R - 5);
      }
    }
    std::cout << "rapids come as near as " << nearest << " mm\n";
    EXPECT_GE(nearest, -1e-6);  // a rapid sets off from the surface
    const auto links = passes_of(path).size();
    EXPECT_EQ(links, 2 * std::size_t(R * std::asin(rim / R) / 3) + 1);
  }
}

TEST(Raster, GapsInTheDesignSplitThePasses) {
  const ContactField ring = [](double x, double y) {
    const double r = std::hypot(x, y);
    return r > 4.05 && r < 9.03 ? plane(x, y) : std::nullopt;
  };
  Raster raster;
  raster.step = 0.5;
  raster.step_over = 3;
  const auto passes = passes_of(read(
      generate_raster(raster, ring, {2, 2, 20}, context(test::gantry(), 9)).text, test::gantry()));
  ASSERT_EQ(passes.size(), 10u);  // y = -9 -6 6 9 whole, y = -3 0 3 in two
  for (const auto& pass : passes)
    for (const AxisVector& q : pass) {
      const double r = std::hypot(q[1], q[2]);
      EXPECT_TRUE(r > 4.05 - 1e-6 && r < 9.03 + 1e-6) << q.transpose();
    }
}

TEST(Raster, MachineWithoutRotaryAxesGetsThreeAxes) {
  Raster raster;
  raster.step = raster.step_over = 1;
  const auto text =
      generate_raster(raster, dome(60, 10), {5, 1, 20}, context(test::three_axis(), 10)).text;
  const Path path = read(text, test::three_axis());
  for (const Block& block : path.blocks) EXPECT_EQ(block.coordinates, Coordinates::Axis);
  double worst = 0.0;
  for (const auto& pass : passes_of(path))
    for (const AxisVector& q : pass) {
      const Vector3d at =
          test::three_axis().tool_in_workpiece(q).translation() + Vector3d(0, 0, 61);
      const double ring = std::hypot(at.x(), at.y());  // tube circle of radius 4 about the axis
      worst = std::max(worst, std::abs(std::hypot(ring - 4, at.z()) - 61));
    }
  EXPECT_LT(worst, 3e-7);
  raster.lead = 0.1;
  EXPECT_THROW(generate_raster(raster, plane, {5, 1, 20}, context(test::three_axis(), 10)),
               std::invalid_argument);
}

TEST(Raster, WhatCannotBeIsRefused) {
  const auto wrong = [](auto change) {
    Raster raster;
    change(raster);
    EXPECT_THROW(generate_raster(raster, plane, {5, 5, 20}, context(test::gantry(), 10)),
                 std::invalid_argument);
  };
  wrong([](Raster& raster) { raster.step_over = 0.0; });
  wrong([](Raster& raster) { raster.step = -1.0; });
  wrong([](Raster& raster) { raster.step_over = raster.step = 1e-9; });
  const auto nowhere = [](double, double) { return std::optional<cutting::Contact>(); };
  EXPECT_THROW(generate_raster({}, nowhere, {5, 5, 20}, context(test::gantry(), 10)),
               std::invalid_argument);
}

TEST(Flank, FlankTouchesTheConeAlongItsGenerator) {
  cutting::Cone cone;
  cone.base_radius = 40;
  cone.height = 30;
  cone.half_apex_angle = 15 * units::deg;
  const cutting::Cutter cutter{8, 0, 60};
  Flank flank;
  flank.step = 2;
  GeneratorContext tilted = context(test::gantry(), 50);
  tilted.T_wm.linear() = Eigen::AngleAxisd(10 * units::deg, Vector3d::UnitX()).toRotationMatrix();
  tilted.T_wm.translation() = Vector3d(0, 0, 7);
  const auto passes = passes_of(read(generate_flank(flank, cone, cutter, tilted), test::gantry()));
  ASSERT_EQ(passes.size(), 1u);
  const int n = int(std::ceil(2 * pi * 40 / 2));
  EXPECT_EQ(int(passes[0].size()), n + 3);
  double worst = 0.0;
  for (const AxisVector& q : passes[0])
    for (const double along : {1.0, 10.0, 30.0}) {
      // distance of a point of the tool's axis from the cone: r cos(alpha) + z sin(alpha) - r_base
      // cos(alpha)
      const Vector3d p = tilted.T_wm.inverse() * Vector3d(tip(q) + along * direction(q));
      const double c = std::cos(cone.half_apex_angle), s = std::sin(cone.half_apex_angle);
      worst = std::max(worst, std::abs(std::hypot(p.x(), p.y()) * c + p.z() * s - 40 * c - 8));
    }
  std::cout << "off by " << worst << " mm\n";
  EXPECT_LT(worst, 3e-7);
}

/// Nose centre (r signed, z) of the platform in the part, spindle at zero, read from its chain.
Vector2d centre(const AxisVector& q) {
  AxisVector still = q;
  still[0] = 0;
  const Vector3d tip_w = test::platform().tool_in_workpiece(still).translation();
  EXPECT_NEAR(tip_w.x(), 0.0, 1e-12);
  return {tip_w.y(), tip_w.z()};
}

double distance(const Vector2d& p, const Vector2d& a, const Vector2d& b) {
  const double t = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (p - a - t * (b - a)).norm();
}

Path spiral_path(const Spiral& spiral, const cutting::Primitive& part, double nose) {
  const std::string text = generate_spiral(spiral, part, {nose, {}}, context(test::platform(), 0));
  const NcOptions options = test::options_for(test::platform());
  return spiral.write_nc ? read_nc(text, "t.ngc", options) : read_pvt(text, "t.csv", options);
}

TEST(Spiral, PlaneIsFacedAtAConstantFeedOnAStraightLine) {
  Spiral spiral;
  const Path path = spiral_path(spiral, cutting::Disc{10.8, 0.0}, 0.249);
  double off = 0.0;
  const double rate = 0.02 * 2.5;
  const double arrival = (10.8 + 0.02) / rate;
  for (const Block& block : path.blocks)
    for (int k = 0; k <= 8; ++k) {
      const double t = block.start_s + k / 8.0 * (block.end_s - block.start_s);
      const AxisVector q = position(path, block, k / 8.0);
      const Vector2d at = centre(q);
      off = std::max({off, std::abs(at.y() - 0.249), std::abs(q[0] - 5 * pi * t) * 1e-3});
      if (t < arrival - 1e-3) off = std::max(off, std::abs(at.x() - (10.82 - rate * t)));
      if (t > arrival + 1e-3) off = std::max(off, std::abs(at.x()));
    }
  std::cout << "off by " << off << " mm, " << path.blocks.size() << " blocks\n";
  EXPECT_LT(off, 1e-12);
  EXPECT_NEAR(path.blocks.back().end_s, arrival + 0.4, 1e-9);  // one revolution at r = 0
}

TEST(Spiral, NoseTouchesConeAndSphereAndBridgesTheCorner) {
  Spiral spiral;
  spiral.feed_per_revolution = 0.1;
  const double a = 0.249;
  cutting::RevolvedProfile cone;  // Peng's cone with its flat rim
  cone.profile_segments = {{{0, 0.4}, {10, 0}, 0.0}, {{10, 0}, {10.8, 0}, 0.0}};
  double lowest = 1e9, highest = -1e9, worst_on_line = 0;
  const Path path = spiral_path(spiral, cone, a);
  const double slope = 0.04, length = std::hypot(1.0, slope);
  for (const Block& block : path.blocks)
    for (int k = 0; k <= 8; ++k) {
      const Vector2d c = centre(position(path, block, k / 8.0));
      const double to_cone = (c.y() + slope * std::abs(c.x()) - 0.4) / length;
      const double gap = std::min({distance(c, {-10, 0}, {0, 0.4}), distance(c, {0, 0.4}, {10, 0}),
                                   distance(c, {10, 0}, {12, 0})}) -
                         a;
      lowest = std::min(lowest, gap);
      highest = std::max(highest, gap);
      if (c.x() > 0.1 && c.x() < 9.5)
        worst_on_line = std::max(worst_on_line, std::abs(to_cone - a));
    }
  std::cout << "gap " << lowest << " to " << highest << " mm, on the cone " << worst_on_line
            << "\n";
  EXPECT_LT(worst_on_line, 1e-12);
  EXPECT_GT(lowest, -2e-6);  // the cubics at a change of contact, 2 nm
  EXPECT_LT(highest, 3e-6);  // in the 2 ms around a change of contact: rate 0.25 mm/s, slope 0.04

  const Path sphere = spiral_path(spiral, cutting::SphereCap{125.2, 10.0}, a);
  double off = 0;
  for (const Block& block : sphere.blocks)
    for (int k = 0; k <= 8; ++k) {
      const Vector2d c = centre(position(sphere, block, k / 8.0));
      if (c.x() < 9.9) off = std::max(off, std::abs(std::hypot(c.x(), c.y() + 125.2) - 125.2 - a));
    }
  std::cout << "sphere off by " << off << " mm\n";
  EXPECT_LT(off, 1e-9);
}

TEST(Spiral, NcTextTurnsTheSameSpiral) {
  Spiral spiral;
  spiral.feed_per_revolution = 0.1;
  spiral.write_nc = true;
  const Path path = spiral_path(spiral, cutting::Disc{10.0, 0.0}, 0.249);
  const Block* first = nullptr;
  double off = 0.0;
  for (const Block& block : path.blocks) {
    if (block.interpolation != Interpolation::Line) continue;
    if (!first) first = &block;
    const Vector2d c = centre(block.end);
    const double turned = block.end[0] - first->start[0];
    off = std::max({off, std::abs(c.y() - 0.249),
                    std::abs(c.x() - std::max(0.0, 10.02 - 0.1 * turned / (2 * pi)))});
  }
  ASSERT_NE(first, nullptr);
  std::cout << "off by " << off << " mm\n";
  EXPECT_LT(off, 1e-4);  // the blend at the arrival
}

TEST(Spiral, ToolStaysOnTheSideWhereItStandsAtHome) {
  test::Chain machine = test::platform();
  kinematics::Pose T_bt = machine.T_bt_home();
  T_bt.translation().z() = -15;
  const test::Chain mirrored(machine.joints(), machine.T_bw_home(), T_bt);
  const std::string text =
      generate_spiral({}, cutting::Disc{10, 0}, {0.249, {}}, context(mirrored, 0));
  const Path path = read_pvt(text, "t", test::options_for(mirrored));
  AxisVector q = path.blocks.front().start;
  EXPECT_NEAR(mirrored.tool_in_workpiece(q).translation().y(), -10.02, 1e-12);
}

TEST(Spiral, WhatCannotBeIsRefused) {
  const auto wrong = [](auto change) {
    Spiral spiral;
    change(spiral);
    EXPECT_THROW(
        generate_spiral(spiral, cutting::Disc{10, 0}, {0.249, {}}, context(test::platform(), 0)),
        std::invalid_argument);
  };
  wrong([](Spiral& spiral) { spiral.feed_per_revolution = 0.0; });
  wrong([](Spiral& spiral) { spiral.end_radius = 11.0; });
  wrong([](Spiral& spiral) { spiral.interval = 1e-9; });
  EXPECT_THROW(generate_spiral({}, cutting::Disc{10, 0}, {0.249, {}}, context(test::gantry(), 0)),
               std::invalid_argument);
}

}  // namespace
}  // namespace abbe::sim::program
