#pragma once

#include <cstddef>
#include <optional>

#include <Eigen/Core>

#include "kinematics/bad_input.h"
#include "kinematics/chain.h"
#include "sim/program/nc_block.h"
#include "sim/program/path.h"

/// Motion of the axes within a block: arcs, spindle speed under constant surface speed (G96), axis
/// positions, and the number of chords that approximate it.
namespace abbe::sim::program {

/// Constant surface speed as a program states it.
struct SurfaceSpeed {
  double m_per_min = 0.0;
  std::optional<double> max_rpm = {};  ///< G50 S, LIMS= or G96 D; else the machine's limit applies
};

/// The change of radius in a move: linear between the ends, or along an arc in the plane of the
/// radius.
struct RadialMove {
  double from = 0.0, to = 0.0;  ///< mm, signed by the side of the spindle axis
  struct Arc {
    double centre = 0.0;  ///< mm, from the spindle axis
    double radius = 0.0;  ///< mm
    double start = 0.0;   ///< rad, from the direction away from the axis
    double sweep = 0.0;   ///< rad
  };
  std::optional<Arc> arc = {};
};

/// Returns the harmonic mean of the spindle speed over the path of a move, rpm. At a feed per
/// revolution the move takes as long at this constant speed as at the speed of each of its points.
/// Exact for lines and arcs, also if `max_rpm` limits the speed on part of them.
double mean_spindle_speed(const RadialMove& move, double m_per_min, double max_rpm);

/// Returns the distance from the spindle axis of the nearer end of the move, mm; 0 for a line that
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
Eigen::Vector2d centre_by_radius(const ArcGeometry& ends, double r, const NcLocation& location,
                                 const Cause& cause);

/// Returns the arc as the control executes it; `first` and `second` are not set. `turns` counts
/// begun turns: 1 means at most one whole turn. Throws BadGeometry at `cause` if the centre is at
/// an end of the arc, the radius exceeds 1e6 mm, or the radii at start and end differ by more than
/// the README of this folder allows.
Arc validated_arc(const ArcGeometry& geometry, int turns, const NcLocation& location,
                  const Cause& cause);

// Axis positions within a block.

/// Returns the axis positions (axes) at which the tip is at `tip_w`, with the rotary axes as in
/// `programmed`. Throws BadInput at the line if the slides do not reach the point.
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
/// Returns the bounds for joint j; derivatives of arcs are not included.
DerivativeBounds derivative_bounds(const Path& path, const Block& block, int j);

/// Returns the sum of the rotations of the positioned rotary axes in a block, rad; for a cubic an
/// upper bound.
double total_rotation(const Path& path, const Block& block, const kinematics::Chain& control);

/// Limit on the number of chords of a block; more would take longer than about 10 s.
inline constexpr double max_chords = 2e7;

/// Returns the number of equal parts of a block such that in each of them neither the slides nor
/// the tip in the workpiece deviate by more than `tolerance`, mm, from the chord. Throws BadInput
/// at the line if more than `max_chords` are needed. Bound: a curve whose second derivative is at
/// most b deviates from a chord of length 1/n by at most b / 8 n^2, with b = lever rotation^2 + 2
/// travel rotation + travel rotation^2 + the second derivatives of arcs and cubics.
std::size_t chords_of(const Path& path, const Block& block, const kinematics::Chain& control,
                      double tolerance);

}  // namespace abbe::sim::program
