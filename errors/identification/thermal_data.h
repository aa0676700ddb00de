#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::errors::identification {

/// Data for a thermal model. Every row has the inputs (temperatures, spindle speed, current) and
/// the deviation at one time. Rows of one run (a day, a warm-up) are consecutive in time and
/// correlated, so training and test data are separated by run and never by row.
struct ThermalData {
  std::vector<std::string> names;  ///< (m) of the inputs
  Eigen::MatrixXd T;               ///< (n x m) deg C or K, as in the source
  Eigen::VectorXd y;               ///< (n) mm or rad, or as in the source
  std::vector<int> run;            ///< (n) label of the run of every row
};

/// Checks the data.
/// @throws std::invalid_argument unless the shapes agree, n >= 1, m >= 1, every number is finite,
///         names differ, and the rows of each run are contiguous
void validate(const ThermalData& data);

/// Returns the labels of the runs in order of first appearance.
std::vector<int> runs(const ThermalData& data);

/// Return the rows of the given runs, or the rows of all runs except one, in the order of the data.
ThermalData select_runs(const ThermalData& data, const std::vector<int>& labels);
ThermalData exclude_run(const ThermalData& data, int label);

/// Returns the inputs with the given indices, in that order.
ThermalData select_inputs(const ThermalData& data, const std::vector<int>& inputs);

/// Returns every k-th row of each run, including its first.
ThermalData thin_runs(const ThermalData& data, int row_stride);

/// Size of values: root mean square and maximum about 0.
struct Spread {
  double rms = 0.0;
  double max = 0.0;  ///< largest magnitude
};
Spread spread(const Eigen::VectorXd& values);

/// Features of a model, computed from the inputs of a run. Every feature of a row uses only that
/// row and earlier rows of its run, so a control could compute it.
struct ThermalFeatures {
  bool since_start = false;  ///< each input minus its value in the first row of the run
  /// Time constant of a first-order lag, in rows; 0: no lag. Every input gets a lagged copy as an
  /// additional feature: the response of a mass that the input heats, starting in equilibrium.
  double lag_rows = 0.0;
};

/// Returns the same rows with features; lagged copies are named "NAME lag".
/// @throws std::invalid_argument if lag_rows is negative or not finite
ThermalData with_features(const ThermalData& data, const ThermalFeatures& features);

}  // namespace abbe::errors::identification
