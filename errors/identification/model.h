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

/// How the elements of a machine are parameterised.
struct ModelOptions {
  Basis slides = Basis::Legendre;  ///< over the travel; a Fourier has a straight line beside it
  int order = 4;                   ///< of slides: degree, harmonics; of a spline its knots less one
  int harmonics = 3;               ///< of rotary axes: Fourier over one turn
  int spindle_harmonics = 0;       ///< of the nose over its own angle; 0: constants alone
  bool constants = false;  ///< constants of error motions too (each hides in a place or a zero)
  bool straightness_slopes = false;  ///< their slopes too (each hides in a squareness)
  bool placement = true;  ///< of a rotary table its order 1 whole; else two motions are held (of C
                          ///< EXC and EAC) whose order 1 beside that of two others only shifts and
                          ///< tilts the workpiece on it
  bool backlash = true;   ///< of the positioning of each axis
  bool locations = true;  ///< squareness, parallelism, rotary offsets
  std::map<char, double> pitch = {};  ///< mm, of the screw of a slide: two harmonics of it in the
                                      ///< axis's positioning
  std::map<std::string, int> orders = {};  ///< of single elements, "EXX"; instead of the above
  std::vector<std::string> only = {};      ///< names; empty: all that mean something
};

/// Name of the curve of a screw's pitch beside the other curves of its element.
inline constexpr const char* pitch_name = "screw pitch";

/// Every element of a machine that may be identified, values zero: six error motions of each axis
/// over its travel, squareness of the slides (X primary, Y secondary), parallelism and offsets of
/// the rotary axes, five of the nose. Numbers that the options leave out stay zero: the covariance
/// gives them zero variance (of a spline the value at its first knot is its constant, and the value
/// at its last the slope of a straightness). An element without any other number is left out.
/// @throws std::invalid_argument naming an unknown element, a slide without limits, or a number out
///         of range (orders 0 to 60)
GeometricErrors model_of(const kinematics::Chain& nominal, const ModelOptions& options = {});

/// Returns the name of the element that a number belongs to: "EXX" of "EXX[2]" and of
/// "EXX screw pitch cos 1".
std::string element_of_number(const std::string& number);

/// Returns the standard deviation that machine tools of good making have of a number of an element
/// ("EXX[2]", "EXC cos 1", "EC0Y"), mm or rad: half of what ISO 10791-1 and -2 allow of new
/// machining centres. Squareness, parallelism 20 urad (0.02 mm over 500 mm), offsets of rotary axes
/// 20 um, translations 5 um, angles of slides and tables 15 urad (0.06 mm/m), of the nose 5 um and
/// 10 urad; of the k-th order or harmonic a k-th.
/// @throws std::invalid_argument if no element's name begins it
double typical_deviation(const std::string& number);

/// Returns the unit in which a number of an element is shown, 1 um or 1 urad, in mm or rad.
/// @throws std::invalid_argument if no element's name begins it
double shown_unit(const std::string& number);

/// Choice of the order of each element by cross-validation.
struct OrderChoice {
  std::map<std::string, int> orders;           ///< "EXX" -> order
  std::map<std::string, Eigen::VectorXd> rms;  ///< prediction of targets left out, in standard
                                               ///< deviations, per order tried from 0, over the
                                               ///< readings that see the element
};
struct OrderOptions {
  int most = 10;  ///< highest order tried
  int folds = 5;  ///< targets are left out in turn, all their runs together
  std::function<void(double)> progress = {};  ///< called now and then with the finished fraction
};
/// Order of every element whose curve has one and that a reading sees: the smallest whose
/// prediction of targets that were left out is within one standard error of the best (of the
/// difference, fold by fold), element by element, the others first at the
/// highest order and then, in up to three sweeps more, at what they were found to need. The first
/// and the last target of a set-up are never left out. Of a rotary axis that cannot turn once no
/// more harmonics are tried than the model has. First order in the deviations. A direction that
/// the targets left in do not determine stays where it is (the normal equations of unit columns
/// have 1e-11 added to their diagonal): in a prediction it does no harm.
/// @throws std::invalid_argument as `estimate` and `model_of` do, for a spline (its orders do not
///         hold each other), fewer than 2 folds, or fewer targets than folds
OrderChoice choose_orders(std::span<const metrology::Readings> readings,
                          const ModelOptions& model = {}, const OrderOptions& options = {});

}  // namespace abbe::errors::identification
