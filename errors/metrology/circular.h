#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/form.h"

/// Weights of readings along a closed path, such that a position that is read twice does not count
/// twice, and the circular test of ISO 230-4.
namespace abbe::errors::metrology {

/// Returns the weight of each reading along a circle: half the angle to its neighbours on either
/// side, whatever the turn in which they were read. Readings at one position (to 1e-9 rad) share
/// its weight. At the ends of an arc a reading extends as far outwards as inwards, so evenly spaced
/// readings of an arc have equal weights, and so do those of a circle whether or not its end point
/// is read again.
/// @param angle  (n) rad, in any order and of any turn
/// @return (n) rad, > 0
Eigen::VectorXd arc_weights(const Eigen::VectorXd& angle);

/// Returns true if the readings cover the full circle: the widest gap between neighbouring
/// positions is narrower than 5 degrees or than 1.5 times the median gap. Always false for fewer
/// than 3 positions.
bool is_full_turn(const Eigen::VectorXd& angle);

/// Returns 1 over the number of rows at the same position (the row itself included), so that every
/// position counts once.
/// @param places     (n x k) coordinates; for an angle its cosine and its sine
/// @param tolerance  rows that differ by less in every coordinate are at one position
/// @return (n) in (0, 1]
Eigen::VectorXd place_weights(const Eigen::MatrixXd& places, double tolerance);

/// Radii along a circular path in a plane, as measured with a ball bar. A ball bar knows only the
/// commanded angle; taking it for the true one neglects e^2 / R in every result, e the largest
/// deviation of the path (20 um on 100 mm: 4 nm).
struct CircularTrace {
  Eigen::VectorXd angle;   ///< (n) rad, from the first axis of the plane to the second
  Eigen::VectorXd radius;  ///< (n) mm, distance from the centre of the path; empty: not measured
};

/// One circle or arc, in one or both senses.
struct CircularRuns {
  double nominal_radius = 0.0;  ///< mm
  CircularTrace anticlockwise;  ///< angles in the order of motion, increasing
  CircularTrace clockwise;      ///< angles in the order of motion, decreasing
};

/// Definition of the circle's centre.
enum class CircleCentre {
  Set,          ///< as set up, from which the radii count
  LeastSquares  ///< of the least-squares circle of all readings, if they cover the full circle; for
                ///< an arc as set up, since ISO 230-4 allows it for full circles only
};

struct CircularOptions {
  CircleCentre centre = CircleCentre::LeastSquares;  ///< for F; G always uses its own centre
};

/// Deviations of one sense of motion, or of both together, mm.
struct CircularFigures {
  double G_lsq = 0.0;           ///< circular deviation about the least-squares centre
  double G_minimum_zone = 0.0;  ///< circular deviation by the two closest concentric circles
  double F_max = 0.0;           ///< largest radial deviation from the nominal radius
  double F_min = 0.0;           ///< smallest radial deviation
};

/// Results of ISO 230-4. `both` is G(b) by its two definitions and the extremes of F. Least squares
/// weight every reading by its arc, so that a first position that is read again at the end counts
/// once, and both senses count alike.
struct Circular {
  std::optional<CircularFigures> anticlockwise;
  std::optional<CircularFigures> clockwise;
  std::optional<CircularFigures> both;               ///< bidirectional; requires both senses
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< mm, reference of F and H
  CircleCentre centre_kind = CircleCentre::Set;      ///< definition of that centre
  LeastSquaresCircle circle;                         ///< of all readings
  double D = 0.0;  ///< mean radial deviation: radius of that circle minus the nominal, mm
  /// Circular hysteresis: the largest radial difference of the two senses at one angle, mm, linear
  /// over the angle between readings. Requires both senses over a common arc.
  std::optional<double> H;
};

/// Evaluates a circular test.
/// @throws std::invalid_argument if no sense is measured, sizes differ, a sense has fewer than 3
///         points, angles contradict the sense, or for numbers that are not finite or positive
Circular circular(const CircularRuns& runs, const CircularOptions& options = {});

/// A value found by least squares.
struct EstimatedValue {
  double value = 0.0;
  double u = 0.0;  ///< standard uncertainty, from the residual
};

/// Causes identified from the shape of a circular test. A cause that the measured arcs cannot
/// separate from others is omitted and named.
struct CircularCauses {
  std::optional<EstimatedValue> radius;      ///< mm, mean of both scales and the bar's own length
  std::optional<EstimatedValue> centre_u;    ///< mm, centre of the path along the first axis
  std::optional<EstimatedValue> centre_v;    ///< mm, along the second axis
  std::optional<EstimatedValue> scale;       ///< relative: first axis minus second axis
  std::optional<EstimatedValue> squareness;  ///< rad, the second axis turned about first x second
  std::optional<EstimatedValue> reversal_u;  ///< mm, B of the first axis: mean upwards minus mean
                                             ///< downwards
  std::optional<EstimatedValue> reversal_v;  ///< mm, of the second axis
  std::optional<EstimatedValue> lag;  ///< rad, angular speed times the excess lag of the first axis
  std::vector<std::string> undetermined;  ///< names of the causes that the arcs do not determine
  double residual = 0.0;                  ///< mm, standard deviation of the unexplained part
};

struct CauseOptions {
  bool is_lag_excluded =
      false;  ///< slow motion: no lag is estimated, so that one sense determines the squareness
};

/// Returns the number of distinct positions read, counted separately for each sense, whole turns
/// removed.
int place_count(const CircularRuns& runs);
inline constexpr int circular_cause_count = 8;  ///< number of causes; least squares need more
                                                ///< positions
/// Names in the order of `CircularCauses`, as used in `undetermined`.
inline constexpr std::array<const char*, circular_cause_count> cause_names{
    "radius", "centre_u", "centre_v", "scale", "squareness", "reversal_u", "reversal_v", "lag"};

/// Estimates the causes by linear least squares of the radial deviations, weighted as in
/// `circular`, with one centre for both senses. In a single sense a lag and a squareness have the
/// same effect and both are undetermined. The uncertainties hold for readings of equal noise and
/// residuals that are independent from angle to angle; a systematic residual makes them too small.
/// First order, as above.
/// Source: the shapes listed in ISO 230-4 annex B.
/// @throws std::invalid_argument as `circular`, or for no more readings than causes, repeated
///         positions of a sense not counted
CircularCauses circular_causes(const CircularRuns& runs, const CauseOptions& options = {});

}  // namespace abbe::errors::metrology
