#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::errors::metrology {

/// Displacements over time. Every column is a quantity.
struct DriftLog {
  Eigen::VectorXd time_s;          ///< (n) strictly increasing, n >= 2
  std::vector<std::string> names;  ///< (c) such as X, Y, Z, A, B, or X at a position
  Eigen::MatrixXd values;          ///< (n x c) mm or rad
};

/// Interval over which a drift is evaluated.
struct DriftInterval {
  std::string name;  ///< "first hour", "environment"
  double from_s = 0.0;
  double to_s = 0.0;
};

/// Thermal drift over one interval.
struct DriftRange {
  DriftInterval interval;
  Eigen::VectorXd range;   ///< (c) largest minus smallest value within the interval
  Eigen::VectorXd change;  ///< (c) value at the end minus value at the start
};

/// Returns the range of every column over every interval. The log is interpolated linearly between
/// samples and at the ends of an interval. Source: ISO 230-3:2020, the drift d(X), d(Y), d(Z),
/// d(A), d(B).
/// @throws std::invalid_argument if the log is malformed, or an interval is empty or exceeds it
std::vector<DriftRange> drift(const DriftLog& log, const std::vector<DriftInterval>& intervals);

}  // namespace abbe::errors::metrology
