#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/inverse_kinematics.h"
#include "sim/dialects/tool_vectors.h"
#include "tests/dialects/siemens_reading.h"

namespace abbe::sim::dialects {
namespace {

namespace machines = program::test;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using kinematics::AxisVector;
using siemens_test::low_gantry;
using siemens_test::siemens_options;
using siemens_test::siemens_path;
using siemens_test::siemens_refusal;

/// Pose of the tool in the workpiece at the end of a block, by the machine's forward chain.
kinematics::Pose pose_at_end(const program::Block& block, const machines::Chain& chain) {
  if (block.coordinates == program::Coordinates::Axis) return chain.tool_in_workpiece(block.end);
  const auto q =
      kinematics::solve_slides(chain, block.end, {block.end[1], block.end[2], block.end[3]});
  return chain.tool_in_workpiece(*q);
}

Vector3d random_vector(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> any(-size, size);
  return {any(random), any(random), any(random)};
}

TEST(SiemensGeometry, SwivelledPlanesAreThoseOfQuaternions) {
  std::mt19937 random(20260311);
  std::uniform_int_distribution<int> axis(1, 3);
  double worst_mm = 0.0, worst_rad = 0.0;
  int swivelled = 0;
  for (int n = 0; n < 300; ++n) {
    const bool solid = n % 4 == 0;
    const Eigen::Vector3i order(axis(random), axis(random), axis(random));
    const Vector3d first = random_vector(random, 100), angles = random_vector(random, 45),
                   then = random_vector(random, 50), point = random_vector(random, 80);
    const int mode = solid ? 64 : order[0] + 4 * order[1] + 16 * order[2];
    const std::string text = fmt::format(
        "T1 D1 G90 G0 X0 Y0 Z0\nCYCLE800(0,\"A\",0,{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},"
        "{:.17g},{:.17g},{:.17g},{:.17g},{})\nG1 X{:.9f} Y{:.9f} Z{:.9f} F1000\n",
        mode, first[0], first[1], first[2], angles[0], angles[1], angles[2], then[0], then[1],
        then[2], n % 2 == 0 ? 1 : -1, point[0], point[1], point[2]);
    const machines::Chain chain = low_gantry();
    const program::Path path = siemens_path(text, chain);
    const auto about = [](int k, double deg) {
      return Quaterniond(Eigen::AngleAxisd(deg * units::deg, Vector3d::Unit(k)));
    };
    const Quaterniond turn = solid
                                 ? about(2, angles[0]) * about(1, angles[1])
                                 : about(order[0] - 1, angles[0]) * about(order[1] - 1, angles[1]) *
                                       about(order[2] - 1, angles[2]);
    const kinematics::Pose T_wt = pose_at_end(path.blocks.back(), chain);
    const Vector3d normal = turn * Vector3d::UnitZ();
    worst_mm = std::max(worst_mm, (T_wt.translation() - (first + turn * (then + point))).norm());
    worst_rad = std::max(worst_rad, (T_wt.linear().col(2) - normal).norm());
    const double a = path.blocks.back().end[4];
    if (normal.head<2>().norm() > 1e-6) {
      EXPECT_EQ(a > 0, n % 2 == 0) << "the head is the first rotary axis";
    }
    ++swivelled;
  }
  std::cout << swivelled << " planes: " << worst_mm << " mm, " << worst_rad << " rad\n";
  EXPECT_LT(worst_mm, 2e-9);  // nine digits of the words
  EXPECT_LT(worst_rad, 1e-11);
}

TEST(SiemensGeometry, AWorkOffsetIsOnePlaceWithAndWithoutTransformation) {
  const machines::Chain chain = low_gantry();
  ReadOptions with = siemens_options(chain);
  with.control.work_offset[1] = AxisVector::Zero(6);
  with.control.work_offset[1] << 0, 11, 12, 13, 0, 0;
  const auto ends_at = [&](const std::string& how) {
    const std::string text = "T1 D1 G90 G55\n" + how + "G1 X1 Y2 Z3 F100\n";
    const program::Path path = read_program(text, "part.mpf", with).path;
    return Vector3d(pose_at_end(path.blocks.back(), chain).translation());
  };
  const Vector3d wanted(12, 14, 16);
  EXPECT_LT((ends_at("") - wanted).norm(), 1e-12);
  EXPECT_LT((ends_at("TRAORI\n") - wanted).norm(), 1e-12);
  EXPECT_LT((ends_at("CYCLE800(0,\"A\",0,57,0,0,0,0,0,0,0,0,0,-1)\n") - wanted).norm(), 1e-12);
  EXPECT_LT((ends_at("TRAORI\nG1 X5 A30 F100\nTRAFOOF\nG1 A0\n") - wanted).norm(), 1e-12);
}

TEST(SiemensGeometry, ToolVectorsPointTheToolOfTheForwardChain) {
  std::mt19937 random(5);
  const machines::Chain chain = low_gantry();
  double worst_mm = 0.0, worst_rad = 0.0;
  for (int n = 0; n < 200; ++n) {
    Vector3d direction = random_vector(random, 1);
    direction.z() = std::abs(direction.z()) + 0.1;
    const Vector3d tip = random_vector(random, 100);
    const Vector3d frame_deg = random_vector(random, 20), shift = random_vector(random, 30);
    const std::string text = fmt::format(
        "T1 D1 G90 TRAORI ORIAXES\nTRANS X={:.17g} Y={:.17g} Z={:.17g}\nAROT X={:.17g} Y={:.17g} "
        "Z={:.17g}\nG1 X={:.17g} Y={:.17g} Z={:.17g} A3={:.17g} B3={:.17g} C3={:.17g} F1000\n",
        shift[0], shift[1], shift[2], frame_deg[0], frame_deg[1], frame_deg[2], tip[0], tip[1],
        tip[2], direction[0], direction[1], direction[2]);
    const program::Path path = siemens_path(text, chain);
    const auto about = [&](int k) {
      return Quaterniond(Eigen::AngleAxisd(frame_deg[k] * units::deg, Vector3d::Unit(k)));
    };
    const Quaterniond turn = about(2) * about(1) * about(0);  // RPY: Z, then Y, then X
    const kinematics::Pose T_wt = pose_at_end(path.blocks.back(), chain);
    worst_mm = std::max(worst_mm, (T_wt.translation() - (shift + turn * tip)).norm());
    worst_rad = std::max(worst_rad, (T_wt.linear().col(2) - turn * direction.normalized()).norm());
  }
  std::cout << "worst " << worst_mm << " mm, " << worst_rad << " rad\n";
  EXPECT_LT(worst_mm, 1e-9);
  EXPECT_LT(worst_rad, 1e-11);
}

TEST(SiemensGeometry, LinesTurnTheToolOnGreatCirclesWithinAMicroradian) {
  std::mt19937 random(17);
  const machines::Chain chain = machines::gantry();
  const OrientationKinematics turning(chain);
  std::uniform_real_distribution<double> tilt(5, 60), round(-20, 20), turn(-3, 3);
  double worst = 0.0;
  std::size_t pieces = 0, most = 0;
  for (int n = 0; n < 100; ++n) {
    AxisVector from = AxisVector::Zero(6), to = from;
    from[4] = tilt(random) * units::deg;
    from[0] = round(random) * units::deg;
    to[4] = from[4] + turn(random) * units::deg;
    to[0] = from[0] + 3 * turn(random) * units::deg;
    const auto all = great_circle_segments(turning, from, to, 1e-6);
    ASSERT_FALSE(all.empty());
    pieces += all.size();
    most = std::max(most, all.size());
    EXPECT_EQ(all.back().q, to);
    const Vector3d a = chain.tool_in_workpiece(from).linear().col(2);
    const Vector3d b = chain.tool_in_workpiece(to).linear().col(2);
    const Quaterniond whole = Quaterniond::FromTwoVectors(a, b);
    AxisVector here = from;
    double done = 0.0;
    for (const auto& piece : all) {
      for (int k = 0; k <= 16; ++k) {
        const double u = k / 16.0, fraction = done + u * (piece.fraction - done);
        const Vector3d seen =
            chain.tool_in_workpiece(AxisVector(here + u * (piece.q - here))).linear().col(2);
        const Vector3d wanted = Quaterniond::Identity().slerp(fraction, whole) * a;
        worst = std::max(worst, (seen - wanted).norm());
      }
      here = piece.q;
      done = piece.fraction;
    }
  }
  std::cout << "worst " << worst * 1e6 << " urad, " << pieces << " pieces of 100 lines, at most "
            << most << "\n";
  EXPECT_LT(worst, 1.02e-6);  // between the quarters at which it is held
  AxisVector through = AxisVector::Zero(6), pole = through;
  through[4] = 30 * units::deg;
  pole[4] = 30 * units::deg;
  pole[0] = pi;
  EXPECT_TRUE(great_circle_segments(turning, through, pole, 1e-6).empty())
      << "it runs through the pole, where C would have to jump";
}

TEST(SiemensGeometry, ArcsAreThoseOfClosedForms) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-50, 50), angle(5, 355);
  double worst = 0.0;
  for (int n = 0; n < 300; ++n) {
    const Eigen::Vector2d start(any(random), any(random)), centre(any(random), any(random));
    const double ar = angle(random);
    const bool clockwise = n % 2 == 0;
    const Eigen::Rotation2Dd turn((clockwise ? -ar : ar) * units::deg);
    const Eigen::Vector2d end = centre + turn * (start - centre);
    const Eigen::Vector2d middle =
        centre + Eigen::Rotation2Dd((clockwise ? -ar : ar) * units::deg / 2) * (start - centre);
    const double r = (start - centre).norm();
    const std::string begin =
        fmt::format("T1 D1 G90 G0 X={:.17g} Y={:.17g} Z1\n", start.x(), start.y());
    const std::string g = clockwise ? "G2" : "G3";
    const std::string to = fmt::format(" X={:.17g} Y={:.17g}", end.x(), end.y());
    for (const std::string& words :
         {g + to +
              fmt::format(" I={:.17g} J={:.17g}", centre.x() - start.x(), centre.y() - start.y()),
          g + to + fmt::format(" I=AC({:.17g}) J=AC({:.17g})", centre.x(), centre.y()),
          g + to + fmt::format(" CR={:.17g}", ar > 180 ? -r : r),
          g + to + fmt::format(" AR={:.17g}", ar),
          g + fmt::format(" AR={:.17g} I=AC({:.17g}) J=AC({:.17g})", ar, centre.x(), centre.y()),
          "CIP" + to + fmt::format(" I1={:.17g} J1={:.17g}", middle.x(), middle.y())}) {
      const program::Path path = siemens_path(begin + words + " F100\n");
      ASSERT_EQ(path.arcs.size(), 1u) << words;
      const program::Arc& arc = path.arcs[0];
      worst = std::max({worst, (arc.centre - centre).norm(), std::abs(arc.radius - r),
                        std::abs(arc.sweep - (clockwise ? -ar : ar) * units::deg) * r,
                        (path.blocks.back().end.segment<2>(1) - end).norm()});
    }
  }
  std::cout << "worst " << worst << " mm\n";
  EXPECT_LT(worst, 1e-9);
}

TEST(SiemensGeometry, ArcsThroughAPointLieInThePlaneOfTheThree) {
  std::mt19937 random(8);
  double worst = 0.0;
  for (int n = 0; n < 100; ++n) {
    const Vector3d a = random_vector(random, 50), b = random_vector(random, 50),
                   c = random_vector(random, 50);
    const program::Path path = siemens_path(fmt::format(
        "T1 D1 G90 G0 X={:.17g} Y={:.17g} Z={:.17g}\nROT Z30\nCIP X={:.17g} Y={:.17g} Z={:.17g} "
        "I1={:.17g} J1={:.17g} K1={:.17g} F100\n",
        a[0], a[1], a[2], c[0], c[1], c[2], b[0], b[1], b[2]));
    const Quaterniond frame(Eigen::AngleAxisd(30 * units::deg, Vector3d::UnitZ()));
    const Vector3d between = frame * b, end = frame * c;
    const program::Block& block = path.blocks.back();
    EXPECT_LT((Vector3d(block.end.segment<3>(1)) - end).norm(), 1e-12);
    // how near the arc comes to the point between, along its way
    double near = 1e9;
    double low = 0.0, high = 1.0;
    for (int level = 0; level < 12; ++level) {
      double best = low;
      near = 1e9;
      for (int k = 0; k <= 200; ++k) {
        const double u = low + (high - low) * k / 200;
        const double d =
            (Vector3d(program::position(path, block, u).segment<3>(1)) - between).norm();
        if (d < near) {
          near = d;
          best = u;
        }
      }
      const double half = (high - low) / 100;
      low = std::max(0.0, best - half);
      high = std::min(1.0, best + half);
    }
    worst = std::max(worst, near);
  }
  std::cout << "worst " << worst << " mm from the point between\n";
  EXPECT_LT(worst, 1e-8);
}

/// Distance of a place from a closed polygon.
double distance_from(const std::vector<Eigen::Vector2d>& corners, const Eigen::Vector2d& p) {
  double least = 1e9;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d a = corners[i], side = corners[(i + 1) % corners.size()] - a;
    const double u = std::clamp((p - a).dot(side) / side.squaredNorm(), 0.0, 1.0);
    least = std::min(least, (p - a - u * side).norm());
  }
  return least;
}

TEST(SiemensGeometry, CutterCompensationKeepsTheRadiusFromTheContour) {
  std::mt19937 random(23);
  ReadOptions with = siemens_options();
  with.control.tool_radius = {{1, 3.0}};
  std::uniform_real_distribution<double> size(30, 60), part(0.3, 1.0), turn(-30, 30);
  double worst = 0.0;
  for (int n = 0; n < 200; ++n) {
    const bool outside = n % 2 == 0;
    std::vector<Eigen::Vector2d> corners;  // counter-clockwise, convex
    const double a = size(random), b = size(random);
    for (double angle = 0; angle < 2 * pi - 0.5; angle += part(random) + 0.2)
      corners.emplace_back(a * std::cos(angle), b * std::sin(angle));
    const Eigen::Vector2d first = corners[0], middle = 0.5 * (corners[0] + corners[1]);
    const Eigen::Vector2d from = middle * (outside ? 1.4 : 0.6);
    // in and out at the middle of the first side, turned by a frame of the program
    const double frame_deg = n % 3 == 0 ? turn(random) : 0.0;
    std::string text = fmt::format(
        "T1 D1 G17 G90 F1000\nROT Z={:.17g}\nG0 X={:.17g} Y={:.17g} Z0\n{} G1 X={:.17g} "
        "Y={:.17g}\n",
        frame_deg, from.x(), from.y(), outside ? "G42" : "G41", middle.x(), middle.y());
    for (std::size_t i = 1; i <= corners.size(); ++i) {
      const Eigen::Vector2d& to = corners[i % corners.size()];
      text += fmt::format("X={:.17g} Y={:.17g}\n", to.x(), to.y());
    }
    text += fmt::format("X={0:.17g} Y={1:.17g}\nG40 X={2:.17g} Y={3:.17g}\n", middle.x(),
                        middle.y(), from.x(), from.y());
    const program::Path path = read_program(text, "part.mpf", with).path;
    const Eigen::Rotation2Dd frame(-frame_deg * units::deg);
    const Eigen::Vector2d normal =
        Eigen::Vector2d(corners[1].y() - first.y(), first.x() - corners[1].x()).normalized();
    const Eigen::Vector2d upright = middle + (outside ? 3.0 : -3.0) * normal;
    ASSERT_GE(path.blocks.size(), corners.size() + 3);
    const Eigen::Vector2d entered = frame * path.blocks[1].end.segment<2>(1);
    worst = std::max(worst, (entered - upright).norm());
    for (std::size_t i = 2; i + 1 < path.blocks.size(); ++i)
      for (int k = 0; k <= 10; ++k) {
        const Eigen::Vector2d p =
            frame * program::position(path, path.blocks[i], 0.1 * k).segment<2>(1);
        worst = std::max(worst, std::abs(distance_from(corners, p) - 3.0));
      }
    EXPECT_LT((frame * path.blocks.back().end.segment<2>(1) - from).norm(), 1e-12);
  }
  std::cout << "worst " << worst << " mm\n";
  EXPECT_LT(worst, 1e-11);
  EXPECT_NE(siemens_refusal("T1 D1 G0 X0 Y0\nROT X20\nG41 G1 X5 F100\n", with).find("tilted"),
            std::string::npos);
}

}  // namespace
}  // namespace abbe::sim::dialects
