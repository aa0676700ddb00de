// Arcs in planes that no two joints span, as a coordinate system that is turned makes them.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "kinematics/bad_input.h"
#include "machines.h"
#include "sim/program/canon.h"
#include "sim/program/nc_reader.h"
#include "sim/program/rewrite.h"
#include "sim/program/sample.h"

namespace abbe::sim::program {
namespace {

using Eigen::Vector3d;
using test::AxisVector;

/// A helix of more than a turn in a frame that is turned any way, by its centre or its radius.
struct Turned {
  Eigen::Matrix3d R;
  Path path;
  double radius = 0.0, sweep = 0.0, across = 0.0;
  Vector3d start;  ///< in the frame
};

Turned turned_helix(unsigned seed, const NcOptions& options) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Turned one;
  one.R = Eigen::AngleAxisd(3 * unit(random),
                            Vector3d(unit(random), unit(random), unit(random)).normalized())
              .toRotationMatrix();
  Canon canon("t", options);
  canon.set_feed(Feed{600.0, 1.0});
  Frame frame;
  frame.shift = AxisVector(Vector3d(5 * unit(random), 7, -3));
  frame.rotation = one.R;
  canon.set_frame(0, frame);
  one.radius = 10 + 5 * unit(random);
  one.sweep = 2 * pi + 1.5 + unit(random);
  one.across = 8 * unit(random);
  one.start = Vector3d(1, 2, 3);
  const Vector3d centre = one.start - Vector3d(one.radius, 0, 0);
  const Vector3d end = centre + Vector3d(one.radius * std::cos(one.sweep),
                                         one.radius * std::sin(one.sweep), one.across);
  canon.traverse({.end = canon.placed(AxisVector(one.start))});
  ArcMove move{.first = 0, .second = 1, .end = canon.placed(AxisVector(end)), .turns = 2};
  move.centre_with_offsets = canon.placed(AxisVector(centre));
  canon.arc(std::move(move));
  one.path = canon.take();
  return one;
}

Vector3d expected(const Turned& one, const NcOptions&, const Vector3d& shift, double u) {
  const double a = u * one.sweep;
  return one.R * (one.start + Vector3d(one.radius * (std::cos(a) - 1), one.radius * std::sin(a),
                                       u * one.across)) +
         shift;
}

TEST(TurnedArc, IsTheHelixOfItsFrame) {
  const NcOptions options = test::options_for(test::three_axis());
  double off = 0.0, rate_off = 0.0, time_off = 0.0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE(seed);
    const Turned one = turned_helix(seed, options);
    const Block& block = one.path.blocks.back();
    ASSERT_EQ(one.path.arcs.size(), 1u);
    const Vector3d shift = block.start - one.R * one.start;
    const double seconds = block.end_s - block.start_s;
    time_off =
        std::max(time_off, std::abs(seconds - std::hypot(one.radius * one.sweep, one.across) / 10));
    for (double u = 0.0; u <= 1.0; u += 0.05) {
      off = std::max(off, (position(one.path, block, u) - expected(one, options, shift, u)).norm());
      const double h = 1e-5;
      if (u < 0.01 || u > 0.99) continue;
      const Vector3d rate =
          (expected(one, options, shift, u + h) - expected(one, options, shift, u - h)) /
          (2 * h * seconds);
      rate_off = std::max(rate_off, (velocity(one.path, block, u) - rate).norm());
    }
  }
  std::cout << "position within " << off << " mm, velocity within " << rate_off
            << " mm/s of differences, time within " << time_off << " s\n";
  EXPECT_LE(off, 1e-12);  // mm: rounding at 30 mm
  EXPECT_LE(rate_off, 1e-6);
  EXPECT_LE(time_off, 1e-11);
}

TEST(TurnedArc, IsSampledWhereItsAxesTurnBackWithinTheChordTolerance) {
  const test::Chain machine = test::three_axis();
  const NcOptions options = test::options_for(machine);
  SampleOptions sampling;
  sampling.chord_tolerance = 1e-3;
  double chord = 0.0, beyond = 0.0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    const Turned one = turned_helix(seed, options);
    const Samples samples = sample(one.path, machine, sampling);
    const Block& block = one.path.blocks.back();
    const Vector3d shift = block.start - one.R * one.start;
    Vector3d most = Vector3d::Constant(-1e9), seen = block.start;
    for (double u = 0.0; u <= 1.0; u += 1e-4)
      most = most.cwiseMax(expected(one, options, shift, u));
    for (std::size_t i = 0; i < samples.states.size(); ++i) {
      if (samples.block[i] != 1) continue;
      seen = seen.cwiseMax(Vector3d(samples.states[i].q));
      if (i == 0 || samples.block[i - 1] != 1) continue;
      const auto u_of = [&](std::size_t k) {
        return (samples.states[k].time_s - block.start_s) / (block.end_s - block.start_s);
      };
      const Vector3d middle = expected(one, options, shift, 0.5 * (u_of(i - 1) + u_of(i)));
      chord = std::max(
          chord, (middle - 0.5 * Vector3d(samples.states[i - 1].q + samples.states[i].q)).norm());
    }
    beyond = std::max(beyond, (most - seen).maxCoeff());
  }
  std::cout << "chords within " << chord << " of 0.001 mm, extremes met within " << beyond
            << " mm\n";
  EXPECT_LE(chord, 1e-3);
  EXPECT_LE(beyond, 1e-7);
}

TEST(TurnedArc, IsRewrittenAsChordsWithinItsWords) {
  const NcOptions options = test::options_for(test::three_axis());
  const Turned one = turned_helix(7, options);
  RewriteOptions words;
  words.word_mm = 1e-4;
  const RewrittenProgram program =
      rewrite_program(one.path, CorrectedPath(one.path.blocks.size()), options, words);
  const Path again = read_nc(program.text, "again", options);
  const Block& block = one.path.blocks.back();
  const Vector3d shift = block.start - one.R * one.start;
  double off = 0.0;
  for (const Block& line : again.blocks) {
    if (line.interpolation != Interpolation::Line) continue;
    const double u = (line.end_s - block.start_s) / (block.end_s - block.start_s);
    off = std::max(off, (Vector3d(line.end) - expected(one, options, shift, u)).norm());
  }
  std::cout << again.blocks.size() << " blocks, ends within " << off << " mm\n";
  EXPECT_NEAR(again.blocks.back().end_s, one.path.blocks.back().end_s, 1e-3);
  EXPECT_LE(off, 3e-4);
}

}  // namespace
}  // namespace abbe::sim::program
