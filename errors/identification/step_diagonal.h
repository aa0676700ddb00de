#pragma once

#include <span>
#include <string>
#include <vector>

#include "errors/identification/estimate.h"

namespace abbe::errors::identification {

/// Result of the published evaluation of a step diagonal. Along four body diagonals the machine
/// steps X, then Y, then Z, with a reading after each step. The change of reading over a leg is the
/// projection of that axis's displacement error, so four diagonals give three components for each
/// of three axes. Exact for translational errors with the beam along the diagonal and the mirror
/// across it.
/// Limitations: a leg moves the tool off the beam by r, and a tool rotated there by
/// theta reads theta . (n x r) more, where n is the normal of the mirror (the beam meets the mirror
/// at r from its reference point, so a rotation about an axis across the beam reads as a length). A
/// misaligned mirror or beam has a similar effect at every step. At the end of a step r is 0: the
/// sum of its three legs is correct, the single legs are not. A misfit of the four equations per
/// leg raises chi-square and gives a warning. Most angular errors cause no misfit; the elements are
/// then wrong without a warning, and `caution` names these errors.
/// Source: Wang 2000 (laser vector method); Yang 2012.
struct StepDiagonal {
  /// 9 tables over the steps, and the squarenesses of travel EC0Y, EB0Z and EA0Z, with covariance.
  /// Positioning is 0 at its first row. Straightness is without its least-squares line, which
  /// counts as squareness. Valid on a chain whose slides have squareness `Travel`.
  GeometricErrors belief;
  std::vector<std::string> warnings;  ///< contradictions between readings and model
  std::string caution;  ///< angular errors that would cause no contradiction on this machine, and
                        ///< the effect of 20 urad of them on the elements; empty if there are none
  double reduced_chi_square = 0.0;  ///< misfit of four diagonals by three components
};
/// Evaluates a step diagonal.
/// @throws std::invalid_argument unless the readings are those of four step diagonals of three
///         slides X Y Z along the bed axes, with the same steps on each
StepDiagonal step_diagonal(const metrology::Readings& readings);

/// Elements of several step diagonals as linear functions of temperatures: the least-squares slopes
/// of the three positionings (per mm of command), the three squarenesses, and every row of the six
/// straightnesses.
struct StepDiagonalTrend {
  std::vector<std::string> names;  ///< (v) "EXX slope", "EC0Y", "EYX[3]"
  std::vector<bool> is_length;     ///< (v) true: mm; false: a slope (mm per mm) or an angle (rad)
  Eigen::VectorXd at_zero;         ///< (v) value where all temperature changes are 0
  Eigen::MatrixXd per_K;           ///< (v x k) change per kelvin of each temperature
  Eigen::MatrixXd per_K_sigma;     ///< (v x k) standard deviation by the scatter about the
                                   ///< lines; empty for k + 1 results
};
/// Fits the elements over temperature.
/// @param results  of one machine with the same steps
/// @param dT_K     (results x k) temperature changes of the results
/// @throws std::invalid_argument if the results differ in their steps, are fewer than k + 1, or the
///         temperatures do not separate the slopes (columns dependent to 1e-9)
StepDiagonalTrend step_diagonal_trend(std::span<const StepDiagonal> results,
                                      const Eigen::MatrixXd& dT_K);

}  // namespace abbe::errors::identification
