#pragma once

#include <optional>

#include <Eigen/Core>

/// Evaluation of readings as the standards for machine tools prescribe it.
namespace abbe::errors::metrology {

/// Deviations of one axis at its targets, actual minus target, mm for a slide, rad for a turn;
/// a column is a run. `up` are the approaches in the positive direction of the axis.
struct PositionRuns {
  Eigen::VectorXd target;  ///< (m) strictly increasing, m >= 2
  Eigen::MatrixXd up;      ///< (m x n), or without columns: not measured in this direction
  Eigen::MatrixXd down;    ///< (m x k), the same
};

/// Quantities of one direction of approach, in the unit of the readings.
struct OneWayPositioning {
  Eigen::VectorXd mean;           ///< (m) mean deviation at each target
  Eigen::VectorXd s;              ///< (m) standard deviation of one approach; (0) for a single run
  Eigen::VectorXd repeatability;  ///< (m) R_i = 4 s_i; (0) for a single run
  double E = 0.0;                 ///< systematic deviation: range of the means
  std::optional<double> R;        ///< largest R_i; needs two runs
  std::optional<double> A;        ///< range of mean +- 2 s; needs two runs
};

/// Quantities of ISO 230-2, in the unit of the readings. What the runs cannot give is left out:
/// a direction that was not measured, R and A of a single run, and everything bidirectional where
/// one direction is missing.
struct Positioning {
  Eigen::VectorXd target;                 ///< (m)
  std::optional<OneWayPositioning> up;    ///< positive direction of approach
  std::optional<OneWayPositioning> down;  ///< negative direction
  Eigen::VectorXd reversal;               ///< (m) B_i = mean up - mean down; (0) if not both
  Eigen::VectorXd mean;                   ///< (m) of both directions; (0) if not both
  Eigen::VectorXd repeatability;          ///< (m) R_i of both directions; (0) if not given
  std::optional<double> B;                ///< largest |B_i|
  std::optional<double> B_mean;           ///< mean of B_i, with its sign
  std::optional<double> M;                ///< range of the bidirectional mean
  std::optional<double> E;                ///< systematic deviation, both directions
  std::optional<double> R;                ///< largest R_i; needs two runs in each direction
  std::optional<double> A;                ///< accuracy; needs two runs in each direction
};

/// Accuracy and repeatability of positioning:
/// R_i = max(2 s_i up + 2 s_i down + |B_i|, 4 s_i up, 4 s_i down), s_i with n - 1, coverage factor
/// 2 throughout. The order of the runs does not matter; the numbers of runs may differ.
/// Source: ISO 230-2:2014, clause 3.
/// @throws std::invalid_argument if there is no run, if sizes differ, if targets do not increase,
/// or
///         for numbers that are not finite
Positioning positioning(const PositionRuns& runs);

/// Largest less smallest.
double range(const Eigen::VectorXd& values);

/// Mean of all runs, of both ways. (m)
Eigen::VectorXd mean_of(const PositionRuns& runs);

}  // namespace abbe::errors::metrology
