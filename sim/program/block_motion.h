#pragma once

#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/program/nc_block.h"
#include "sim/program/path.h"

/// Motion of the axes within a block: arcs, spindle speed under constant surface speed (G96), axis
/// positions, chord counts.
namespace abbe::sim::program {

/// Constant surface speed as a program states it.
struct SurfaceSpeed {
  double m_per_min = 0.0;
  std::optional<double> max_rpm = {};  ///< G50 S, LIMS=, G96 D; none: that of the machine
};

/// The change of radius in a move: linear from one end to the other, or along an arc that lies in
/// the plane of the radius.
struct RadialMove {
  double from = 0.0, to = 0.0;  ///< mm, signed by the side of the axis
  struct Arc {
    double centre = 0.0;  ///< mm, from the spindle axis
    double radius = 0.0;  ///< mm
    double start = 0.0;   ///< rad, from the direction away from the axis
    double sweep = 0.0;   ///< rad
  };
  std::optional<Arc> arc = {};
};

/// Returns the constant spindle speed at which a move takes as long, at a feed per revolution, as
/// with the speed that belongs to each of its points: the harmonic mean over its path, rpm. Exact
/// for lines and arcs, also where `max_rpm` limits part of them.
double mean_spindle_speed(const RadialMove& move, double m_per_min, double max_rpm);

/// Returns the smallest distance from the axis at the ends of the move, mm; 0 for a line that
/// crosses the axis.
double min_radius(const RadialMove& move);

/// Thrown if the programmed values define no arc.
struct BadGeometry : BadInput {
  using BadInput::BadInput;
  bool is_uncertain = false;  ///< the error may be a consequence of an earlier one
};

/// Returns the centre, mm, of the arc of radius |r| from start to end: the arc of at most half a
/// turn if r is positive, the other one if it is negative. Throws BadGeometry if start and end
/// coincide, r is zero or less than half the chord.
Eigen::Vector2d centre_by_radius(const ArcGeometry& ends, double r, const NcLocation& place,
                                 const Cause& cause);

/// Returns the arc as the control executes it; `first` and `second` are not set. `turns` is the
/// number of turns begun: 1 is at most one whole turn. Throws BadGeometry at `cause` for a centre
/// at an end of the arc, a radius beyond 1e6 mm, or radii at start and end that differ by more than
/// the README of this folder allows.
Arc checked_arc(const ArcGeometry& words, int turns, const NcLocation& place, const Cause& cause);

// Axis positions within a block.

/// Returns the axis positions whose slides bring the tip to a point of the workpiece, under a tip
/// mode. Of `programmed` (axes) the rotary axes are used. Throws BadInput at the line if the slides
/// do not reach the point.
kinematics::AxisVector axes_for_tip(const Path& path, const Block& block,
                                    const kinematics::Chain& control,
                                    const kinematics::AxisVector& programmed,
                                    const Eigen::Vector3d& tip_w);

/// Returns the axis positions at fraction u of a block. Under a tip mode the slides are solved for
/// the tip. Throws BadInput at the line if they do not reach it.
kinematics::AxisVector axes_at(const Path& path, const Block& block,
                               const kinematics::Chain& control, double u);

/// Bounds of the first, second and third derivative of one coordinate over u in [0, 1].
struct DerivativeBounds {
  double first = 0.0, second = 0.0, third = 0.0;
};
DerivativeBounds bends(const Path& path, const Block& block, int j);

/// Returns the sum of the rotations of the positioned rotary axes in a block, rad; for a cubic an
/// upper bound.
double rotary_turn_sum(const Path& path, const Block& block, const kinematics::Chain& control);

/// The largest number of chords of a block; about 10 s of computation.
inline constexpr double max_chords = 2e7;

/// Returns the number of equal parts of a block in each of which neither the slides nor the tip in
/// the workpiece deviate by more than `within`, mm, from the straight line between its ends. Throws
/// BadInput at the line if more than `max_chords` are needed. Bound: a second derivative of at most
/// b leaves a chord of length 1/n by at most b / 8 n^2, with b = lever turn^2 + 2 way turn + way
/// turn^2 + the second derivatives of arcs and cubics.
std::size_t chords_of(const Path& path, const Block& block, const kinematics::Chain& control,
                      double within);

}  // namespace abbe::sim::program
