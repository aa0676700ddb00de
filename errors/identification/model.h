#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "errors/geometric.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::identification {

enum class Basis { Polynomial, Legendre, Fourier, Spline };

/// Options of the parameterisation of a machine's elements.
struct ModelOptions {
  Basis slides = Basis::Legendre;  ///< basis over the travel; Fourier is complemented by a straight
                                   ///< line
  int order = 4;                   ///< of slides: degree or number of harmonics; for a spline the
                                   ///< number of knots minus one
  int harmonics = 3;               ///< of rotary axes: Fourier over one turn
  int spindle_harmonics = 0;       ///< of the nose over its own angle; 0: constants only
  bool constants = false;  ///< identify constants of error motions too (each is equivalent to a
                           ///< position or a zero)
  bool straightness_slopes = false;  ///< identify their slopes too (each is equivalent to a
                                     ///< squareness)
  bool placement = true;  ///< identify order 1 of a rotary table in full; otherwise two motions are
                          ///< held (of C EXC and EAC), whose order 1 together with that of two
                          ///< others only shifts and tilts the workpiece on the table
  bool backlash = true;   ///< in the positioning of each axis
  bool locations = true;  ///< squareness, parallelism, rotary offsets
  std::map<char, double> pitch = {};  ///< mm, pitch of the screw of a slide: adds two harmonics to
                                      ///< its positioning
  std::map<std::string, int> orders = {};  ///< of single elements, e.g. "EXX"; overrides the above
  std::vector<std::string> only = {};      ///< names of elements; empty: all that are meaningful
};

/// Name of the curve of a screw's pitch among the curves of its element.
inline constexpr const char* pitch_name = "screw pitch";

/// Returns every identifiable element of a machine with zero values: six error motions of each axis
/// over its travel, squareness of the slides (X primary, Y secondary), parallelism and offsets of
/// the rotary axes, five elements of the nose. Numbers excluded by the options stay zero: the
/// covariance gives them zero variance (for a spline the value at its first knot is its constant,
/// and the value at its last the slope of a straightness). An element without any other number is
/// omitted.
/// @throws std::invalid_argument naming an unknown element, a slide without limits, or a number out
///         of range (orders 0 to 60)
GeometricErrors model_of(const kinematics::Chain& nominal, const ModelOptions& options = {});

/// Returns the name of the element to which a number belongs: "EXX" for "EXX[2]" and for "EXX screw
/// pitch cos 1".
std::string element_of_number(const std::string& number);

/// Returns the typical standard deviation of a number of an element ("EXX[2]", "EXC cos 1", "EC0Y")
/// on well-made machine tools, mm or rad: half of the tolerances of ISO 10791-1 and -2 for new
/// machining centres. Squareness and parallelism 20 urad (0.02 mm over 500 mm), offsets of rotary
/// axes 20 um, translations 5 um, angles of slides and tables 15 urad (0.06 mm/m), of the nose 5 um
/// and 10 urad; of the k-th order or harmonic 1/k of it.
/// @throws std::invalid_argument if the text does not begin with the name of an element
double typical_deviation(const std::string& number);

/// Returns the display unit of a number of an element, 1 um or 1 urad, in mm or rad.
/// @throws std::invalid_argument if the text does not begin with the name of an element
double shown_unit(const std::string& number);

/// Orders of the elements, chosen by cross-validation.
struct OrderChoice {
  std::map<std::string, int> orders;           ///< "EXX" -> order
  std::map<std::string, Eigen::VectorXd> rms;  ///< prediction error at targets left out, in
                                               ///< standard deviations, per order from 0, over the
                                               ///< readings that depend on the element
};
struct OrderOptions {
  int most = 10;  ///< highest order tried
  int folds = 5;  ///< number of subsets of targets that are left out in turn, with all their runs
  std::function<void(double)> progress = {};  ///< called with the finished fraction
};
/// Chooses the order of every element whose curve has one and on which a reading depends: the
/// smallest whose prediction of targets left out is within one standard error of the best (of the
/// difference, fold by fold). Element by element, the others first at the highest order and then,
/// in up to three more sweeps, at their chosen orders. The first and the last target of a set-up
/// are never left out. For a rotary axis that cannot make a full turn no more harmonics are tried
/// than the model has. First order in the deviations. A direction that the remaining targets do not
/// determine stays at its start (1e-11 is added to the diagonal of the normal equations of unit
/// columns): it does not affect a prediction.
/// @throws std::invalid_argument as `estimate` and `model_of`, for a spline (its orders are not
///         nested), fewer than 2 folds, or fewer targets than folds
OrderChoice choose_orders(std::span<const metrology::Readings> readings,
                          const ModelOptions& model = {}, const OrderOptions& options = {});

}  // namespace abbe::errors::identification
