#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace abbe::errors::identification {

/// Readings for a thermal model: at every row the inputs (temperatures, spindle speed, current) and
/// the deviation seen there. Rows of one run (a day, a warm-up) follow each other in time and are
/// correlated, so training and testing are parted by run and never by row.
struct ThermalData {
  std::vector<std::string> names;  ///< (m) of the inputs
  Eigen::MatrixXd T;               ///< (n x m) deg C or K, as the source has them
  Eigen::VectorXd y;               ///< (n) mm or rad, or as the source has it
  std::vector<int> run;            ///< (n) label of the run of every row
};

/// @throws std::invalid_argument unless the shapes agree, n >= 1, m >= 1, every number is finite,
///         names differ, and the rows of each run stand together
void validate(const ThermalData& data);

/// Labels in order of first appearance.
std::vector<int> runs(const ThermalData& data);

/// The rows of the runs named, in the order of the data.
ThermalData select_runs(const ThermalData& data, const std::vector<int>& labels);
ThermalData exclude_run(const ThermalData& data, int label);

/// The inputs named by index, in that order.
ThermalData select_inputs(const ThermalData& data, const std::vector<int>& inputs);

/// Every k-th row of each run, its first among them.
ThermalData thinned(const ThermalData& data, int every);

/// RMS and largest magnitude.
struct Spread {
  double rms = 0.0;
  double max = 0.0;
};
Spread spread(const Eigen::VectorXd& values);

/// Which column of a log is what; every other column not in `ignored` is an input.
struct ThermalColumns {
  std::string run = "run";
  std::string y = "y";
  std::vector<std::string> ignored;
};
/// Reads a log: lines that start with # are left out, the first other one holds the heads, numbers
/// follow; cells are parted by ; or , or blanks. Runs are whole numbers.
/// @param file  name for refusals
/// @throws BadInput with the place: no such column, a name twice, more than 1000 columns, a row of
///         another length, no number within +-1e9, a run that is not a whole number or comes in two
///         pieces, no rows
ThermalData read_thermal_data(std::string_view text, const std::string& file,
                              const ThermalColumns& columns = {});

/// What is made of the temperatures of a run before a model sees them. Every feature of a row uses
/// that row and earlier ones of its own run only, as a control could.
struct ThermalFeatures {
  bool since_start = false;  ///< each input minus its value at the first row of the run
  /// Beside every input its copy behind a first-order lag of this many rows, the reaction of a mass
  /// that it heats; it starts settled at the first row. 0: none.
  double lag_rows = 0.0;
};

/// The same rows, lagged copies named "NAME lag".
/// @throws std::invalid_argument if lag_rows < 0 or not finite
ThermalData with_features(const ThermalData& data, const ThermalFeatures& features);

/// y counted from the first row of each run: another problem, that of a control which resets its
/// zero at the start of a run.
ThermalData zeroed_at_start(const ThermalData& data);

}  // namespace abbe::errors::identification
