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
  Eigen::VectorXd range;     ///< (c) largest minus smallest value within the interval
  Eigen::VectorXd change;    ///< (c) value at the end minus value at the start
  Eigen::VectorXd max_rate;  ///< (c) largest |change| per second between two samples in the
                             ///< interval
};

/// Returns the range of every column over every interval. The log is interpolated linearly between
/// samples and at the ends of an interval. Source: ISO 230-3:2020, the drift d(X), d(Y), d(Z),
/// d(A), d(B).
/// @throws std::invalid_argument if the log is malformed, or an interval is empty or exceeds it
std::vector<DriftRange> drift(const DriftLog& log, const std::vector<DriftInterval>& intervals);

/// Returns the largest range of every column (c) in any interval of `window_s` seconds within the
/// log: the environmental temperature variation error of a test that may begin at any time.
/// @throws std::invalid_argument as `drift`
Eigen::VectorXd max_window_drift(const DriftLog& log, double window_s);

/// Returns the intervals that ISO 230-3 reports for a spindle or an axis that runs from `start_s`
/// to `stop_s`: the first hour of running, the whole running time, and the time after it.
std::vector<DriftInterval> running_intervals(const DriftLog& log, double start_s, double stop_s);

/// Positions along Z of the five sensors around a mandrel. X and Y are measured at both heights.
struct MandrelSensors {
  double z_near_mm = 0.0;  ///< mm, pair near the nose; X and Y of the result refer to it
  double z_far_mm = 0.0;   ///< mm, pair near the free end
};

/// Returns columns X Y Z A B from the readings of five sensors: A and B are the tilts of the
/// mandrel about X and Y, right-handed. First order in the tilt.
/// @param readings  columns X near, Y near, X far, Y far, Z in this order, mm
/// @throws std::invalid_argument unless there are five columns and two different heights
DriftLog mandrel_drift(const DriftLog& readings, const MandrelSensors& sensors);

}  // namespace abbe::errors::metrology
