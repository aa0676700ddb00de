#pragma once

#include <span>
#include <string>
#include <vector>

#include "errors/identification/estimate.h"

namespace abbe::errors::identification {

/// The published evaluation of the step diagonal: along four body diagonals the machine steps X,
/// then Y, then Z, with a reading after each; every leg's change of reading is the projection of
/// that axis's displacement error, so four diagonals give three components of three axes.
/// Exact for errors of translation with the beam along the diagonal and the mirror across it.
///
/// Where it fails: a leg takes the tool off the beam by r, and a tool turned there by theta reads
/// theta . (n x r) more, n the mirror's normal (the beam meets the mirror r from its reference, so
/// a turn about an axis across the beam reads as a length). A mirror or a beam out of line does the
/// like at every step. At the end of a step r is 0: the sums of three legs hold, their parts do
/// not. What four equations a leg cannot reconcile shows as chi-square and as a warning. Most
/// angles can be reconciled, and the elements are wrong without a sign: `caution` names them.
/// Source: Wang 2000 (laser vector method); Yang 2012.
struct StepDiagonal {
  /// 9 tables over the steps: positioning 0 at its first row, straightness without its line of
  /// least squares, which goes to squareness of travel EC0Y EB0Z EA0Z; with covariance. It holds on
  /// a chain whose slides have squareness `Travel`.
  GeometricErrors belief;
  std::vector<std::string> warnings;  ///< where the readings contradict the model
  std::string
      caution;  ///< angular errors that would not contradict it on this machine, and by how
                ///< much 20 urad of them would falsify the elements; empty if there are none
  double reduced_chi_square = 0.0;  ///< four diagonals against three components
};
/// @throws std::invalid_argument unless the readings are those of four step diagonals of three
///         slides X Y Z along the bed axes, the same steps on each
StepDiagonal step_diagonal(const metrology::Readings& readings);

/// The elements of several step diagonals as straight lines of temperatures: of the three
/// positionings the slope of least squares (per mm of command), the three squarenesses, and of the
/// six straightnesses every row.
struct StepDiagonalTrend {
  std::vector<std::string> names;  ///< (v) "EXX slope", "EC0Y", "EYX[3]"
  std::vector<bool> is_length;     ///< (v) mm; else a slope (mm per mm) or an angle (rad)
  Eigen::VectorXd at_zero;         ///< (v) where all temperatures are zero
  Eigen::MatrixXd per_K;           ///< (v x k)
  Eigen::MatrixXd per_K_sigma;     ///< (v x k) from what scatters about the lines; empty where
                                   ///< there are only k + 1 results
};
/// @param results  of one machine with the same steps
/// @param dT_K     (results x k) changes of temperature that go with them
/// @throws std::invalid_argument if the results differ in their steps, are fewer than k + 1, or the
///         temperatures do not separate the slopes (columns dependent to 1e-9)
StepDiagonalTrend step_diagonal_trend(std::span<const StepDiagonal> results,
                                      const Eigen::MatrixXd& dT_K);

}  // namespace abbe::errors::identification
