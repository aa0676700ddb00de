#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "errors/geometric.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::identification {

/// Basis functions of the curve of an error motion.
enum class Basis { Polynomial, Legendre, Fourier, Spline };

/// Options of the parameterisation of a machine's error elements.
struct ModelOptions {
  Basis slides = Basis::Legendre;  ///< basis over the travel; a Fourier series has a straight line
                                   ///< added
  int order = 4;                   ///< of slides: degree or number of harmonics; for a spline the
                                   ///< number of knots minus one
  int harmonics = 3;               ///< of rotary axes: Fourier over one turn
  int spindle_harmonics = 0;       ///< of the nose over its own angle; 0: constants only
  bool constants = false;  ///< also identify constants of error motions (each has the same effect
                           ///< as a position or a zero)
  bool straightness_slopes = false;  ///< also identify slopes of straightness (each has the same
                                     ///< effect as a squareness)
  bool placement = true;  ///< identify order 1 of a rotary table in full; if not, it is held for
                          ///< two error motions (of C: EXC and EAC), whose order 1 together with
                          ///< that of two others only shifts and tilts the workpiece on the table
  bool backlash = true;   ///< identify backlash in the positioning of each axis
  bool locations = true;  ///< identify squareness, parallelism and rotary offsets
  std::map<char, double> pitch = {};  ///< mm, pitch of the screw of a slide: adds two harmonics to
                                      ///< its positioning
  std::map<std::string, int> orders = {};  ///< of single elements, e.g. "EXX"; overrides the above
  std::vector<std::string> only =
      {};  ///< names of elements to identify; empty: all meaningful ones
};

/// Name of the curve of a screw's pitch among the curves of its element.
inline constexpr const char* pitch_name = "screw pitch";

/// Returns every identifiable element of a machine with zero values: six error motions of each axis
/// over its travel, squareness of the slides (X primary, Y secondary), parallelism and offsets of
/// the rotary axes, five elements of the nose. Coefficients excluded by the options stay zero: the
/// covariance gives them zero variance (for a spline the value at its first knot counts as its
/// constant, and the value at its last knot as its slope). An element without any other coefficient
/// is omitted.
/// @throws std::invalid_argument for an unknown element, a slide without limits, or an option
///         out of range (orders 0 to 60)
GeometricErrors error_model(const kinematics::Chain& nominal, const ModelOptions& options = {});

/// Returns the name of the element to which a coefficient belongs: "EXX" for "EXX[2]" and for "EXX
/// screw pitch cos 1".
std::string coefficient_element(const std::string& coefficient);

/// Returns the typical standard deviation of a coefficient ("EXX[2]", "EXC cos 1", "EC0Y") on
/// well-made machine tools, mm or rad: half of the tolerances of ISO 10791-1 and -2 for new
/// machining centres. Squareness and parallelism 20 urad (0.02 mm over 500 mm), offsets of rotary
/// axes 20 um, translations 5 um, angles of slides and tables 15 urad (0.06 mm/m), of the nose 5 um
/// and 10 urad; the k-th order or harmonic has 1/k of these.
/// @throws std::invalid_argument if the text does not begin with the name of an element
double typical_deviation(const std::string& coefficient);

/// Returns the display unit of a coefficient, 1 um or 1 urad, in mm or rad.
/// @throws std::invalid_argument if the text does not begin with the name of an element
double display_unit(const std::string& coefficient);

/// Orders of the elements, chosen by cross-validation.
struct OrderChoice {
  std::map<std::string, int> orders;           ///< "EXX" -> order
  std::map<std::string, Eigen::VectorXd> rms;  ///< prediction error at targets left out, in
                                               ///< standard deviations, per order from 0, over the
                                               ///< readings that depend on the element
};
/// Options of the choice of orders.
struct OrderOptions {
  int max_order = 10;  ///< highest order to be tried
  int folds = 5;  ///< number of subsets of targets that are left out in turn, with all their runs
  std::function<void(double)> progress = {};  ///< called with the finished fraction
};
/// Chooses the order of every element whose curve has one and on which a reading depends: the
/// smallest order whose prediction of targets left out is within one standard error of the best (of
/// the difference, fold by fold). One element is chosen at a time. The other elements have the
/// highest order in the first sweep, and their chosen orders in up to three more. The first and the
/// last target of a set-up are never left out. For a rotary axis that cannot make a full turn no
/// more harmonics are tried than the model has. First order in the deviations. A direction that the
/// remaining targets do not determine stays at its start (1e-11 is added to the diagonal of the
/// normal equations of unit columns): it does not affect a prediction.
/// @throws std::invalid_argument as `estimate` and `error_model`, for a spline (its orders are not
///         nested), fewer than 2 folds, or fewer targets than folds
OrderChoice choose_orders(std::span<const metrology::Readings> readings,
                          const ModelOptions& model = {}, const OrderOptions& options = {});

}  // namespace abbe::errors::identification
