#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::errors::metrology {

/// What displacement sensors showed over time; a column is a quantity.
struct DriftLog {
  Eigen::VectorXd time_s;          ///< (n) strictly increasing, n >= 2
  std::vector<std::string> names;  ///< (c) such as X, Y, Z, A, B, or X at a position
  Eigen::MatrixXd values;          ///< (n x c) mm or rad
};

struct DriftInterval {
  std::string name;  ///< "first hour", "environment"
  double from_s = 0.0;
  double to_s = 0.0;
};

/// Thermal drift d over one interval.
struct DriftRange {
  DriftInterval interval;
  Eigen::VectorXd range;      ///< (c) largest minus smallest value within the interval
  Eigen::VectorXd change;     ///< (c) value at its end minus value at its start
  Eigen::VectorXd rate_peak;  ///< (c) largest |change| per second between two samples in it
};

/// Range of every column over every interval; between samples, as at the ends of an interval, the
/// log is a straight line. Source: ISO 230-3:2020, the drift d(X), d(Y), d(Z), d(A), d(B).
/// @throws std::invalid_argument if the log is malformed or an interval is empty or leaves it
std::vector<DriftRange> drift(const DriftLog& log, const std::vector<DriftInterval>& intervals);

/// Largest range of every column (c) in any interval of `window_s` seconds within the log: the
/// environmental temperature variation error of a test that may begin at any time.
/// @throws std::invalid_argument as `drift`
Eigen::VectorXd worst_drift(const DriftLog& log, double window_s);

/// The intervals that ISO 230-3 reports of a spindle or an axis that runs from `start_s` to
/// `stop_s`: its first hour, the whole time it runs, and what is left of the log after it.
std::vector<DriftInterval> running_intervals(const DriftLog& log, double start_s, double stop_s);

/// Where the five sensors stand along a mandrel in Z: X and Y are read at both heights.
struct MandrelSensors {
  double z_near_mm = 0.0;  ///< of the pair near the nose; X and Y of the result belong here
  double z_far_mm = 0.0;   ///< of the pair towards the end
};

/// Columns X Y Z A B from the readings of five sensors: A and B are the tilts of the mandrel about
/// X and Y, right-handed. First order in the tilt.
/// @param readings  columns X near, Y near, X far, Y far, Z in this order, mm
/// @throws std::invalid_argument unless there are five columns and two heights
DriftLog mandrel_drift(const DriftLog& readings, const MandrelSensors& sensors);

}  // namespace abbe::errors::metrology
