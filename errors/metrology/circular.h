#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/form.h"

/// Circular test of ISO 230-4, and weights by which every position on a closed path counts once,
/// even if it is read twice.
namespace abbe::errors::metrology {

/// Returns the weight of each reading on a circle: half the sum of the angles to its two
/// neighbouring positions, which may belong to other turns. Readings at the same position (to 1e-9
/// rad) divide its weight. The end of an arc has the weight that it would have with a further
/// neighbour at the same distance. Evenly spaced readings thus have equal weights on an arc and on
/// a circle, whether or not the end point of the circle is read again.
/// @param angle  (n) rad, in any order, whole turns ignored
/// @return (n) rad, > 0
Eigen::VectorXd arc_weights(const Eigen::VectorXd& angle);

/// Returns true if readings cover the full circle: the widest gap between neighbouring positions is
/// less than 5 degrees or less than 1.5 times the median gap. Always false for fewer than 3
/// positions.
bool is_full_turn(const Eigen::VectorXd& angle);

/// Returns for each row 1 over the number of rows at its position, so that every position counts
/// once.
/// @param places     (n x k) coordinates; for an angle its cosine and sine
/// @param tolerance  rows that differ by less in every coordinate are at the same position
/// @return (n) in (0, 1]
Eigen::VectorXd position_weights(const Eigen::MatrixXd& positions, double tolerance);

/// Radii along a circular path in a plane, as measured with a ball bar. The angles are commanded
/// ones, since a ball bar does not measure them. The resulting error of every result is e^2 / R,
/// where e is the largest deviation of the path (20 um on 100 mm: 4 nm).
struct CircularTrace {
  Eigen::VectorXd angle;   ///< (n) rad, from the first axis of the plane to the second
  Eigen::VectorXd radius;  ///< (n) mm, distance from the centre of the path; empty: not measured
};

/// Circle or arc, measured in one or both senses of motion.
struct CircularRuns {
  double nominal_radius = 0.0;  ///< mm
  CircularTrace anticlockwise;  ///< angles in the order of motion, increasing
  CircularTrace clockwise;      ///< angles in the order of motion, decreasing
};

/// Centre to which radial deviations refer.
enum class CircleCentre {
  Set,          ///< centre of the set-up, from which the radii are measured
  LeastSquares  ///< centre of the least-squares circle of all readings; `Set` if they cover only an
                ///< arc, since ISO 230-4 allows this centre for full circles only
};

struct CircularOptions {
  CircleCentre centre = CircleCentre::LeastSquares;  ///< for F; G always has its own centre
};

/// Deviations of one sense of motion, or of both together, mm.
struct CircularFigures {
  double G_lsq = 0.0;           ///< circular deviation about the least-squares centre
  double G_minimum_zone = 0.0;  ///< circular deviation by the two closest concentric circles
  double F_max = 0.0;           ///< largest radial deviation from the nominal radius
  double F_min = 0.0;           ///< smallest radial deviation
};

/// Results by ISO 230-4. `both` contains G(b) by its two definitions and the extremes of F over
/// both senses. In least squares every reading has the weight of its arc: a first position that is
/// read again at the end counts once, and both senses have equal weight.
struct CircularResult {
  std::optional<CircularFigures> anticlockwise;
  std::optional<CircularFigures> clockwise;
  std::optional<CircularFigures> both;               ///< bidirectional; requires both senses
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< mm, reference of F and H
  CircleCentre centre_kind = CircleCentre::Set;      ///< kind of `centre`
  LeastSquaresCircle circle;                         ///< least-squares circle of all readings
  double D = 0.0;  ///< mean radial deviation: radius of that circle minus the nominal, mm
  /// Circular hysteresis, mm: the largest difference of radius between the two senses at the same
  /// angle, interpolated linearly between readings. Requires a common arc.
  std::optional<double> H;
};

/// Evaluates a circular test.
/// @throws std::invalid_argument if no sense is measured, sizes differ, a sense has fewer than 3
///         points, its angles do not run in that sense, or a number is not finite or not positive
CircularResult circular(const CircularRuns& runs, const CircularOptions& options = {});

/// Value estimated by least squares.
struct EstimatedValue {
  double value = 0.0;
  double u = 0.0;  ///< standard uncertainty, from the residuals of the fit
};

/// Causes estimated from the shape of a circular test. A cause that the measured arcs cannot
/// separate from others is empty and is named in `undetermined`.
struct CircularCauses {
  std::optional<EstimatedValue> radius;    ///< mm, deviation by mean scale error and bar length
  std::optional<EstimatedValue> centre_u;  ///< mm, centre of the path along the first axis
  std::optional<EstimatedValue> centre_v;  ///< mm, centre of the path along the second axis
  std::optional<EstimatedValue> scale;  ///< ratio, scale error of the first axis minus the second
  std::optional<EstimatedValue>
      squareness;  ///< rad, rotation of the second axis about first x second
  std::optional<EstimatedValue> reversal_u;  ///< mm, reversal value of the first axis: mean in
                                             ///< positive minus mean in negative motion
  std::optional<EstimatedValue> reversal_v;  ///< mm, reversal value of the second axis
  std::optional<EstimatedValue> lag;  ///< rad, angular speed times the excess lag of the first axis
  std::vector<std::string> undetermined;  ///< names of the causes that the arcs do not determine
  double residual = 0.0;                  ///< mm, standard deviation of the unexplained part
};

struct CauseOptions {
  bool is_lag_excluded = false;  ///< true: no lag is estimated, as for slow motion; one sense then
                                 ///< determines squareness
};

/// Returns the number of distinct positions of each sense, whole turns ignored, summed over both
/// senses.
int position_count(const CircularRuns& runs);
inline constexpr int circular_cause_count = 8;  ///< an estimate needs more positions than this
/// Names of the causes in the order of `CircularCauses`, as in `undetermined`.
inline constexpr std::array<const char*, circular_cause_count> cause_names{
    "radius", "centre_u", "centre_v", "scale", "squareness", "reversal_u", "reversal_v", "lag"};

/// Estimates the causes by linear least squares of the radial deviations, weighted as in
/// `circular`, with one centre for both senses. Exact to first order in the deviations. With a
/// single sense, lag and squareness have the same effect and both are undetermined. The
/// uncertainties assume equal noise of all readings and residuals that are independent from angle
/// to angle; a systematic residual makes them too small.
///
/// Source: the shapes listed in ISO 230-4 annex B.
/// @throws std::invalid_argument as `circular`, or unless there are more distinct positions
///         (`position_count`) than causes
CircularCauses circular_causes(const CircularRuns& runs, const CauseOptions& options = {});

}  // namespace abbe::errors::metrology
