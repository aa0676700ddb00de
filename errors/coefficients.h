#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/element.h"

namespace abbe::errors {

/// Position of one number in a description: a coefficient of a curve of an element.
struct Coefficient {
  int element = 0;  ///< index in the elements
  int curve = 0;    ///< index in the curves of the element
  int number = 0;   ///< index in the numbers of the shape
  friend bool operator==(const Coefficient&, const Coefficient&) = default;
};

/// Covariance of the numbers of a description; if empty, the numbers are assumed to be exact.
/// Numbers that are zero by convention (e.g. the constant of an error motion) have zero variance.
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

/// Returns a name of the coefficient that is unique within the description, such as "EXX[2]"; if
/// the element has several curves, with the name of the curve: "EXX screw pitch cos 1".
std::string name_of(const Coefficient& coefficient, const std::vector<Element>& elements);

/// Returns the values of all numbers, in the order of `coefficients`.
Eigen::VectorXd values(const std::vector<Element>& elements);

/// Returns the elements with other values of their numbers.
/// @throws std::invalid_argument if the sizes differ
std::vector<Element> with_values(std::vector<Element> elements, const Eigen::VectorXd& values);

/// Returns the change of an element's value per unit of each number of one of its curves at a
/// state, `scale` and sign included (numbers of that curve).
/// @throws std::out_of_range if the state is outside a table that does not extrapolate
Eigen::VectorXd basis(const Curve& curve, const CurveState& state);

}  // namespace abbe::errors
