#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

/// Evaluation of positioning readings by ISO 230-2 and of diagonals by ISO 230-6.
namespace abbe::errors::metrology {

/// Deviations of one axis at its targets, actual minus target, mm for a slide, rad for a rotary
/// axis. A column is a run. `up` contains the approaches in the positive direction of the axis.
struct PositionRuns {
  Eigen::VectorXd target;  ///< (m) strictly increasing, m >= 2
  Eigen::MatrixXd up;      ///< (m x n); without columns: not measured in this direction
  Eigen::MatrixXd down;    ///< (m x k); without columns: not measured in this direction
};

/// Results for one direction of approach, in the unit of the readings.
struct UnidirectionalPositioning {
  Eigen::VectorXd mean;           ///< (m) mean deviation at each target
  Eigen::VectorXd s;              ///< (m) standard deviation of one approach; (0) for a single run
  Eigen::VectorXd repeatability;  ///< (m) R_i = 4 s_i; (0) for a single run
  double E = 0.0;                 ///< systematic deviation: range of the means
  std::optional<double> R;        ///< largest R_i; requires two runs
  std::optional<double> A;        ///< range of mean +- 2 s; requires two runs
};

/// Results by ISO 230-2, in the unit of the readings. Quantities that the runs do not determine are
/// empty: those of a direction that was not measured, R and A of a single run, and all
/// bidirectional quantities if one direction is missing.
struct Positioning {
  Eigen::VectorXd target;                         ///< (m)
  std::optional<UnidirectionalPositioning> up;    ///< positive direction of approach
  std::optional<UnidirectionalPositioning> down;  ///< negative direction of approach
  Eigen::VectorXd reversal;       ///< (m) B_i = mean up - mean down; (0) for one direction
  Eigen::VectorXd mean;           ///< (m) of both directions; (0) for one direction
  Eigen::VectorXd repeatability;  ///< (m) R_i of both directions; (0) if not determined
  std::optional<double> B;        ///< largest |B_i|
  std::optional<double> B_mean;   ///< mean of B_i, with its sign
  std::optional<double> M;        ///< range of the bidirectional mean
  std::optional<double> E;        ///< systematic deviation, both directions
  std::optional<double> R;        ///< largest R_i; requires two runs in each direction
  std::optional<double> A;        ///< accuracy; requires two runs in each direction
};

/// Returns accuracy and repeatability of positioning: R_i = max(2 s_i up + 2 s_i down + |B_i|, 4
/// s_i up, 4 s_i down), with n - 1 degrees of freedom in s_i and the coverage factor 2. The order
/// of the runs has no effect. The two directions may have different numbers of runs.
/// Source: ISO 230-2:2014, clause 3.
/// @throws std::invalid_argument if there is no run, if sizes differ, if targets do not increase,
///         or for numbers that are not finite
Positioning positioning(const PositionRuns& runs);

/// Returns the largest minus the smallest value.
double range(const Eigen::VectorXd& values);

/// Returns the mean of all runs of both directions (m).
Eigen::VectorXd run_mean(const PositionRuns& runs);

/// Runs along one diagonal of the work zone, with targets counted from its start. The signs give
/// its direction: {1, 1, 1} rises in X, Y and Z, {-1, 1, 1} falls in X; a face diagonal has one
/// zero. A diagonal and its reverse count as the same.
struct DiagonalRuns {
  std::array<int, 3> signs{1, 1, 1};
  PositionRuns runs;
};

/// Results by ISO 230-6, mm.
struct Diagonals {
  std::vector<Positioning> each;  ///< results of every diagonal
  double E_d = 0.0;  ///< diagonal systematic deviation: largest E of the set (of a diagonal
                     ///< measured in one direction only, of that direction)
  std::optional<double> B_d;  ///< largest |B_i| of the set, if every diagonal was measured in both
                              ///< directions
};

/// Returns the results of every diagonal by ISO 230-2, and those of the set.
/// Source: ISO 230-6:2002.
/// @throws std::invalid_argument as `positioning`, or for no diagonal, signs other than -1, 0, 1,
///         fewer than two of them not zero, or the same diagonal twice
Diagonals diagonals(const std::vector<DiagonalRuns>& set);

}  // namespace abbe::errors::metrology
