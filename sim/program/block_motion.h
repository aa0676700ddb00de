#pragma once

#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/program/nc_block.h"
#include "sim/program/path.h"

/// Speed of the workpiece spindle under constant surface speed (G96).
namespace abbe::sim::program {

/// Constant surface speed as a program states it.
struct SurfaceSpeed {
  double m_per_min = 0.0;
  std::optional<double> max_rpm = {};  ///< G50 S, LIMS=, G96 D; none: that of the machine
};

/// How a move changes its distance from the spindle's axis: in proportion from one end to the
/// other, or along an arc in the plane of that distance.
struct RadialMove {
  double from = 0.0, to = 0.0;  ///< mm, signed: both sides of the axis
  struct Arc {
    double centre = 0.0;  ///< mm, from the axis
    double radius = 0.0;  ///< mm
    double start = 0.0;   ///< rad, from the direction away from the axis
    double sweep = 0.0;   ///< rad
  };
  std::optional<Arc> arc = {};
};

/// Returns the one speed at which a move takes as long, at a feed per turn, as with the speed that
/// belongs to each of its points: the harmonic mean over its path, rpm. The result is exact for
/// lines and arcs, whether or not `max_rpm` holds in a part of them.
double mean_spindle_speed(const RadialMove& move, double m_per_min, double max_rpm);

/// Returns the least distance from the axis, mm, 0 where a line crosses it.
double min_radius(const RadialMove& move);

/// Words that make no arc.
struct BadGeometry : BadInput {
  using BadInput::BadInput;
  bool is_uncertain = false;  ///< it may only follow from a fault before it
};

/// Centre of the arc of radius |r| from start to end: r above zero is the arc of at most half a
/// turn, below zero the other. mm.
/// @throws BadGeometry where start and end are one point, r is zero or less than half the chord
Eigen::Vector2d centre_by_radius(const ArcGeometry& ends, double r, const NcLocation& place,
                                 const Cause& cause);

/// The arc as the control turns it; `first` and `second` are left.
/// @param turns  begun: 1 is at most a whole turn
/// @throws BadGeometry at `cause` for a centre at an end, a radius beyond 1e6 mm, radii at start
/// and
///         end that differ more than the README of this folder says
Arc checked_arc(const ArcGeometry& words, int turns, const NcLocation& place, const Cause& cause);

// What the axes do in a block.

/// Axis positions with the slides that bring the tip to a place of the workpiece, under a tip mode.
/// @param programmed  (axes) of which the rotary ones count
/// @throws BadInput naming the line where they do not reach it
kinematics::AxisVector axes_for_tip(const Path& path, const Block& block,
                                    const kinematics::Chain& control,
                                    const kinematics::AxisVector& programmed,
                                    const Eigen::Vector3d& tip_w);

/// Axis positions at fraction u of a block; under a tip mode the slides are those that bring the
/// tip there.
/// @throws BadInput naming the line where they do not reach it
kinematics::AxisVector axes_at(const Path& path, const Block& block,
                               const kinematics::Chain& control, double u);

/// Largest first, second and third derivative of one coordinate over u in [0, 1].
struct DerivativeBounds {
  double first = 0.0, second = 0.0, third = 0.0;
};
DerivativeBounds bends(const Path& path, const Block& block, int j);

/// Sum of the turns of the positioned rotary axes in a block, rad; of a cubic at most.
double rotary_turn_sum(const Path& path, const Block& block, const kinematics::Chain& control);

/// Chords of a block at most: some 10 s of work.
inline constexpr double max_chords = 2e7;

/// Equal parts of a block in each of which neither the slides nor the tip in the workpiece leave
/// the straight line between its ends by more than `within`, mm.
/// @throws BadInput naming the line where more than `max_chords` are needed
/// Bound: a second derivative of at most b leaves a chord of 1/n by b / 8 n^2, with
/// b = lever turn^2 + 2 way turn + way turn^2 + what arcs and cubics bend.
std::size_t chords_of(const Path& path, const Block& block, const kinematics::Chain& control,
                      double within);

}  // namespace abbe::sim::program
