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
  Eigen::MatrixXd values;  ///< (rows x columns); what is not finite stays empty
};

struct HeatMapOptions {
  std::string title{};
  std::string row_label{};        ///< what the rows are: "trained on"
  std::string column_label{};     ///< "tested on"
  std::string value_label{};      ///< what a number is: "RMS / µm"
  std::optional<double> range{};  ///< end of the scale; else the largest value. 1 for correlations
  int decimals = -1;  ///< of the numbers; -1: as many as three digits of the largest need
  int width = 1600;   ///< px, at most: a small matrix gives a smaller picture
  std::vector<std::string> caption{};
};

/// Draws a matrix as coloured cells with their numbers: a diverging scale about zero, or, where no
/// range is asked and no value is negative, from zero; a number that has no room is left out.
/// @throws std::invalid_argument for no cell, more than 256 rows or 64 columns, sizes that do not
///         fit, or a range that is not positive
/// @throws std::system_error with the path if the file cannot be written
void write_heat_map(const std::filesystem::path& path, const HeatMap& map,
                    const HeatMapOptions& options = {});

}  // namespace abbe::render
