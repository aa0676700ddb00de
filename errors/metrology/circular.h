#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/form.h"

/// How much of a path each of its readings stands for, so that a place that is read again does not
/// count twice.
namespace abbe::errors::metrology {

/// What each reading along a circle stands for: half the way to its neighbours on either side, by
/// whichever turn they were read. Readings at one place (to 1e-9 rad) share what it stands for. At
/// the two ends of an arc a reading reaches as far outwards as inwards, so evenly spaced readings
/// of an arc count alike, and so do those of a circle with its end point read again or not.
/// @param angle  (n) rad, in any order and of any turn
/// @return (n) rad, > 0
Eigen::VectorXd arc_weights(const Eigen::VectorXd& angle);

/// Whether readings go all the way round: the widest gap between neighbouring places is narrower
/// than 5 degrees or than 1.5 times the median gap. Fewer than 3 places never do.
bool is_full_turn(const Eigen::VectorXd& angle);

/// 1 over the number of rows at the same place, itself among them, so that every place counts once.
/// @param places     (n x k) coordinates; of an angle its cosine and its sine
/// @param tolerance  rows that differ by less in every coordinate are at one place
/// @return (n) in (0, 1]
Eigen::VectorXd place_weights(const Eigen::MatrixXd& places, double tolerance);

/// Radii along a circular path in a plane, as a ball bar shows them. A ball bar knows the angle
/// only as commanded; taking it for the true one leaves e^2 / R out of every figure, e the largest
/// deviation of the path (20 um on 100 mm: 4 nm).
struct CircularTrace {
  Eigen::VectorXd angle;   ///< (n) rad, from the first axis of the plane to the second
  Eigen::VectorXd radius;  ///< (n) mm, distance from the centre of the path; empty: not measured
};

/// One circle or arc, in one sense or both.
struct CircularRuns {
  double nominal_radius = 0.0;  ///< mm
  CircularTrace anticlockwise;  ///< angles in the order of motion, increasing
  CircularTrace clockwise;      ///< decreasing
};

/// Where the circle's centre is taken.
enum class CircleCentre {
  Set,          ///< as set up: the radii count from it
  LeastSquares  ///< of the least-squares circle of everything measured, if that goes all the way
                ///< round; of an arc as set up, since ISO 230-4 allows it for full circles only
};

struct CircularOptions {
  CircleCentre centre = CircleCentre::LeastSquares;  ///< for F; G always chooses its own
};

/// Deviations of one sense of motion, or of both together, in mm.
struct CircularFigures {
  double G_lsq = 0.0;           ///< circular deviation about the least-squares centre
  double G_minimum_zone = 0.0;  ///< circular deviation, the two closest concentric circles
  double F_max = 0.0;           ///< largest radial deviation from the nominal radius
  double F_min = 0.0;           ///< smallest
};

/// Figures of ISO 230-4. `both` is G(b) with its two definitions and the extremes of F. Least
/// squares weight every reading by the arc that it stands for, so that a first place
/// that is read again at the end counts once, and both senses count alike.
struct Circular {
  std::optional<CircularFigures> anticlockwise;
  std::optional<CircularFigures> clockwise;
  std::optional<CircularFigures> both;               ///< bidirectional; needs both senses
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  ///< mm, that F and H were taken from
  CircleCentre centre_kind = CircleCentre::Set;      ///< which one that is
  LeastSquaresCircle circle;                         ///< of everything measured
  double D = 0.0;  ///< mean radial deviation, radius of that circle minus the nominal, mm
  /// Circular hysteresis, the largest radial difference of the two senses at one angle, mm; between
  /// readings a sense goes on straight over the angle. Needs both senses over a common arc.
  std::optional<double> H;
};

/// @throws std::invalid_argument if no sense is measured, sizes differ, a sense has fewer than 3
///         points, angles do not go its way, or for numbers that are not finite or positive
Circular circular(const CircularRuns& runs, const CircularOptions& options = {});

/// A number found by least squares.
struct EstimatedValue {
  double value = 0.0;
  double u = 0.0;  ///< standard uncertainty, from the residual
};

/// Causes that the shape of a circular test shows. A cause that the arcs measured cannot separate
/// from others is left out and named.
struct CircularCauses {
  std::optional<EstimatedValue> radius;      ///< mm, mean of both scales and the bar's own length
  std::optional<EstimatedValue> centre_u;    ///< mm, centre of the path along the first axis
  std::optional<EstimatedValue> centre_v;    ///< mm, along the second
  std::optional<EstimatedValue> scale;       ///< relative: first axis minus second axis
  std::optional<EstimatedValue> squareness;  ///< rad, the second axis turned about first x second
  std::optional<EstimatedValue> reversal_u;  ///< mm, B of the first axis: mean going up minus down
  std::optional<EstimatedValue> reversal_v;  ///< mm, of the second
  std::optional<EstimatedValue>
      lag;  ///< rad, angular speed times how much the first axis lags more
  std::vector<std::string> undetermined;  ///< names of what the arcs leave open
  double residual = 0.0;                  ///< mm, standard deviation of what no cause explains
};

struct CauseOptions {
  bool is_lag_excluded =
      false;  ///< slow motion: no lag is looked for, so that one sense shows squareness
};

/// Places that were read, of each sense apart, whole turns left out.
int place_count(const CircularRuns& runs);
inline constexpr int circular_cause_count = 8;  ///< that least squares look for at more places
/// In the order of `CircularCauses`, as `undetermined` names them.
inline constexpr std::array<const char*, circular_cause_count> cause_names{
    "radius", "centre_u", "centre_v", "scale", "squareness", "reversal_u", "reversal_v", "lag"};

/// Linear least squares of the radial deviations on the causes, weighted as in `circular`; one
/// centre for both senses. In one sense alone a lag and a squareness look the same and both stay
/// open. The uncertainties hold for readings of equal noise and residuals that do not hang together
/// from angle to angle; a residual with a shape makes them too small. First order, as above.
/// Source: the shapes that ISO 230-4 annex B lists.
/// @throws std::invalid_argument as `circular`, or for no more readings than causes, those that
///         repeat a place of their sense not counted
CircularCauses circular_causes(const CircularRuns& runs, const CauseOptions& options = {});

}  // namespace abbe::errors::metrology
