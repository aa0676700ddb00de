#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::render {

/// A labelled matrix.
struct HeatMap {
  std::vector<std::string> rows;
  std::vector<std::string> columns;
  Eigen::MatrixXd values;  ///< (rows x columns); values that are not finite stay empty
};

struct HeatMapOptions {
  std::string title{};
  std::string row_label{};        ///< meaning of the rows: "trained on"
  std::string column_label{};     ///< meaning of the columns: "tested on"
  std::string value_label{};      ///< meaning of a number: "RMS / µm"
  std::optional<double> range{};  ///< end of the scale; by default the largest value. 1 for
                                  ///< correlations
  int decimals = -1;              ///< of the numbers; -1: such that the largest has three digits
  int width = 1600;               ///< px, at most: a small matrix gives a smaller picture
  std::vector<std::string> caption{};
};

/// Draws a matrix as coloured cells with their numbers: a diverging scale about zero or, without a
/// given range and negative values, a scale from zero. A number that does not fit is omitted.
/// @throws std::invalid_argument for no cell, more than 256 rows or 64 columns, sizes that do not
///         match, or a range that is not positive
/// @throws std::system_error with the path if the file cannot be written
void write_heat_map(const std::filesystem::path& path, const HeatMap& map,
                    const HeatMapOptions& options = {});

}  // namespace abbe::render
