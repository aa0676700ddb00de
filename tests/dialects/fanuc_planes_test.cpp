// Tilted planes and directions of the tool against what is written down another way: turns as
// quaternions, the machine's own forward chain, pairs of angles in closed form.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "kinematics/bad_input.h"
#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"

namespace abbe::sim::dialects::fanuc_tests {
namespace {

namespace machines = program::test;
using Eigen::Vector3d;
using machines::Chain;

constexpr int c_joint = 0, x_joint = 1, a_joint = 4;  // of the gantry

program::Path planes_read(const std::string& text, const Chain& chain) {
  ReadOptions options;
  options.control = machines::options_for(chain);
  options.dialect = Dialect::Fanuc;
  return read_program(text, "part.nc", options).path;
}

/// A turn as a quaternion w x y z, by its half angle.
using Quaternion = std::array<double, 4>;

Quaternion turn_about(int axis, double degrees) {
  Quaternion q{std::cos(0.5 * degrees * units::deg), 0, 0, 0};
  q[std::size_t(axis) + 1] = std::sin(0.5 * degrees * units::deg);
  return q;
}

Quaternion operator*(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

Vector3d turned(const Quaternion& q, const Vector3d& v) {
  const Quaternion r =
      q * Quaternion{0, v.x(), v.y(), v.z()} * Quaternion{q[0], -q[1], -q[2], -q[3]};
  return {r[1], r[2], r[3]};
}

// Bound: 1e-9 mm and 1e-12 rad, the promise of the inverse; planes lean by up to 60 degrees.
TEST(FanucPlanes, TheTipStandsWhereQuaternionsPutItAndTheToolAcrossThePlane) {
  const unsigned seed = 20240713;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-180, 180), lean(-60, 60), at(-50, 50);
  double worst_mm = 0, worst_rad = 0;
  for (int n = 0; n < 500; ++n) {
    const Chain machine = n % 2 == 0 ? machines::gantry() : machines::trunnion();
    const double i = any(random), j = lean(random), k = any(random);
    const Vector3d o(at(random), at(random), at(random)), p(at(random), at(random), at(random));
    const std::string text = fmt::format(
        "G90 G0 A0. C0.\nG68.2 X{:.9f} Y{:.9f} Z{:.9f} I{:.9f} J{:.9f} K{:.9f}\nG53.1\n"
        "G43 H1\nG0 X{:.9f} Y{:.9f} Z{:.9f}\nG69\nG49\nG91 G0 X1.\n",
        o.x(), o.y(), o.z(), i, j, k, p.x(), p.y(), p.z());
    const program::Path path = planes_read(text, machine);
    const Quaternion q = turn_about(2, i) * turn_about(0, j) * turn_about(2, k);
    const Vector3d expected = o + turned(q, p), across = turned(q, Vector3d::UnitZ());
    // the last move begins where the axes stand, by the control's chain
    const kinematics::AxisVector axes = path.blocks.back().start;
    ASSERT_EQ(int(path.blocks.back().coordinates), int(program::Coordinates::Axis));
    const machines::Pose tool = machine.tool_in_workpiece(axes);
    worst_mm = std::max(worst_mm, (tool.translation() - expected).norm());
    worst_rad = std::max(worst_rad, tool.linear().col(2).cross(across).norm());
    ASSERT_GT(tool.linear().col(2).dot(across), 0.0);
  }
  std::cout << "worst " << worst_mm << " mm, " << worst_rad << " rad\n";
  EXPECT_LT(worst_mm, 2e-8) << "angles and positions are written to 1e-9";
  EXPECT_LT(worst_rad, 1e-10);
}

TEST(FanucPlanes, OfTwoPairsTheTableTurnsLessThenTheHead) {
  // A plane that leans by 30 about X: A 30 and C 0, or A -30 and C 180.
  const auto turned_from = [](double c) {
    const program::Path path = planes_read(
        fmt::format("G0 C{:.1f}\nG68.2 I0. J30. K0.\nG53.1\nG69\nG0 X1.\n", c), machines::gantry());
    const kinematics::AxisVector& q = path.blocks.back().end;
    return std::array{q[a_joint] / units::deg, q[c_joint] / units::deg};
  };
  const auto near = turned_from(40.0), far = turned_from(150.0);
  EXPECT_NEAR(near[0], 30.0, 1e-9);
  EXPECT_NEAR(near[1], 0.0, 1e-9);
  EXPECT_NEAR(far[0], -30.0, 1e-9);
  EXPECT_NEAR(far[1], 180.0, 1e-9);
}

TEST(FanucPlanes, OfTwoPairsOfATrunnionItsFirstAxisTurnsLess) {
  // A carries C: the pairs of one direction have A and -A, whatever C must turn.
  for (const double from : {5.0, -5.0}) {
    const program::Path path =
        planes_read(fmt::format("G0 A{:.1f} C10.\nG68.2 I0. J20. K0.\nG53.1\nG69\nG0 X1.\n", from),
                    machines::trunnion());
    EXPECT_NEAR(path.blocks.back().end[1] / units::deg, from > 0 ? 20.0 : -20.0, 1e-9);
  }
}

TEST(FanucPlanes, DirectionsOutOfReachAreRefused) {
  try {
    planes_read("G68.2 I0. J30. K0.\nG53.1\n", machines::three_axis());
    ADD_FAILURE();
  } catch (const BadInput& fault) {
    EXPECT_NE(std::string(fault.what()).find("part.nc:2:1: expected a direction that the rotary"),
              std::string::npos)
        << fault.what();
  }
}

// I J K of G43.5: the forward chain gives the direction back.
TEST(FanucPlanes, DirectionsOfG435AreThoseOfTheForwardChain) {
  const unsigned seed = 20240714;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1), at(-50, 50);
  double worst = 0;
  for (int n = 0; n < 200; ++n) {
    const Chain machine = n % 2 == 0 ? machines::gantry() : machines::trunnion();
    const Vector3d d = Vector3d(any(random), any(random), 1.2 + any(random));
    const Vector3d tip(at(random), at(random), at(random));
    const program::Path path = planes_read(
        fmt::format("G43.5 H1\nG1 X{:.6f} Y{:.6f} Z{:.6f} I{:.12f} J{:.12f} K{:.12f} F100.\n",
                    tip.x(), tip.y(), tip.z(), d.x(), d.y(), d.z()),
        machine);
    const program::Block& block = path.blocks.back();
    ASSERT_EQ(int(block.coordinates), int(program::Coordinates::Tip));
    worst = std::max(
        worst, machine.tool_in_workpiece(block.end).linear().col(2).cross(d.normalized()).norm());
    ASSERT_NEAR(block.end[*machine.find('X')], tip.x(), 1e-6);
  }
  std::cout << "worst " << worst << " rad\n";
  EXPECT_LT(worst, 1e-11);
}

// The plane of a rotation G68 in G18 turns from Z to X, as a positive turn about Y.
TEST(FanucPlanes, G68TurnsInThePlaneAboutItsCentre) {
  const auto at = [](const std::string& text) {
    const kinematics::AxisVector q = planes_read(text, machines::gantry()).blocks.back().end;
    return Vector3d(q[x_joint], q[x_joint + 1], q[x_joint + 2]);
  };
  EXPECT_NEAR((at("G17 G68 X1. Y2. R90.\nX3. Y2. Z4.\n") - Vector3d(1, 4, 4)).norm(), 0, 1e-14);
  EXPECT_NEAR((at("G18 G68 X1. Z2. R90.\nX1. Y5. Z3.\n") - Vector3d(2, 5, 2)).norm(), 0, 1e-14);
  EXPECT_NEAR((at("G19 G68 Y1. Z2. R90.\nX7. Y2. Z2.\n") - Vector3d(7, 1, 3)).norm(), 0, 1e-14);
}

}  // namespace
}  // namespace abbe::sim::dialects::fanuc_tests
