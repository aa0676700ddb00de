#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/element.h"

namespace abbe::errors {

/// One number of one curve of a description.
struct Coefficient {
  int element = 0;  ///< index in the elements
  int curve = 0;    ///< index in its curves
  int number = 0;   ///< index in the shape
  friend bool operator==(const Coefficient&, const Coefficient&) = default;
};

/// Covariance of the numbers of a description; if empty they are taken as exact. Numbers that are
/// zero by convention (e.g. the constant of an error motion) have zero variance.
struct Covariance {
  std::vector<Coefficient> of;  ///< (m)
  Eigen::MatrixXd matrix;       ///< (m x m) products of mm and rad
};

// The curves of a description as one vector of numbers. Every shape is linear in its numbers: those
// of Constant, Polynomial, Legendre (from order 0), Fourier (cosines, then sines), Backlash, the
// values of a Table, those of DirectionalTables (up, then down). Random shapes have none. `scale`
// and `negate` of a curve act on its value, not on its numbers.

/// Returns all numbers in the order of the description.
std::vector<Coefficient> coefficients(const std::vector<Element>& elements);

/// Returns a name such as "EXX[2]"; for a named curve among several "EXX screw pitch cos 1". Unique
/// within a description.
std::string name_of(const Coefficient& coefficient, const std::vector<Element>& elements);

/// Return the values of the numbers, and the elements with other values.
/// @throws std::invalid_argument if the sizes differ
Eigen::VectorXd values(const std::vector<Element>& elements);
std::vector<Element> with_values(std::vector<Element> elements, const Eigen::VectorXd& values);

/// Returns the factors of the numbers of a curve at a state (numbers of that curve): change of the
/// element's value per unit of each, `scale` and sign included.
/// @throws std::out_of_range if the state is outside a table that does not extrapolate
Eigen::VectorXd basis(const Curve& curve, const CurveState& state);

}  // namespace abbe::errors
