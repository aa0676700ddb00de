#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::sim::compensation {

/// What a control could read while a program ran, one row an instant: temperatures `NAME_C`,
/// `current_A`, `FX_dynamometer_N` …, encoders `X_encoder_mm` …, `spindle_rpm`.
struct ControlLog {
  std::vector<std::string> names;  ///< (m) with their units
  Eigen::VectorXd time_s;          ///< (n) increasing; before 0 the thermal history
  Eigen::MatrixXd values;          ///< (n x m)
};

/// Column of that name.
/// @return (n)
/// @throws std::invalid_argument naming it and those that there are, or for a log whose values do
///         not fit its names and instants
Eigen::VectorXd column(const ControlLog& log, const std::string& name);

/// Row that a control knows at an instant: the last that was read; before the first, the first.
/// @throws std::invalid_argument for a log without rows or an instant that is no number
Eigen::Index row_at(const ControlLog& log, double time_s);

/// The same of rising instants, at least one.
Eigen::Index row_at(const Eigen::VectorXd& time_s, double instant_s);

}  // namespace abbe::sim::compensation
