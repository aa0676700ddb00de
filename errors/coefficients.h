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

/// How well the numbers of a description are known; empty: they are taken as they stand. Numbers
/// that are zero by convention (the constant of an error motion, say) have zero variance.
struct Covariance {
  std::vector<Coefficient> of;  ///< (m)
  Eigen::MatrixXd matrix;       ///< (m x m) products of mm and rad
};

// The curves of a description as one vector of numbers. Every shape is linear in its numbers: those
// of Constant, Polynomial, Legendre (from order 0), Fourier (cosines, then sines), Backlash, the
// values of a Table, those of UpDown (up, then down). Random shapes have none. `scale` and `negate`
// of a curve act on its value, not on its numbers.

/// All of them, in the order of the description.
std::vector<Coefficient> coefficients(const std::vector<Element>& elements);

/// "EXX[2]", of a named curve among several "EXX screw pitch cos 1"; unique within a description.
std::string name_of(const Coefficient& coefficient, const std::vector<Element>& elements);

/// Their values, and the elements with other values. @throws std::invalid_argument if sizes differ
Eigen::VectorXd values(const std::vector<Element>& elements);
std::vector<Element> with_values(std::vector<Element> elements, const Eigen::VectorXd& values);

/// Change of one element's value at a state per unit of each number of one of its curves: what the
/// number is multiplied by, `scale` and sign included. (numbers of that curve)
/// @throws std::out_of_range where a table that refuses is left
Eigen::VectorXd basis(const Curve& curve, const CurveState& state);

}  // namespace abbe::errors
