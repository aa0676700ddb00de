#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::render {

/// A matrix with names of its rows and columns.
struct HeatMap {
  std::vector<std::string> rows;
  std::vector<std::string> columns;
  Eigen::MatrixXd values;  ///< (rows x columns); values that are not finite have no colour
};

struct HeatMapOptions {
  std::string title{};
  std::string row_label{};        ///< meaning of the rows: "trained on"
  std::string column_label{};     ///< meaning of the columns: "tested on"
  std::string value_label{};      ///< meaning of a number: "RMS / µm"
  std::optional<double> range{};  ///< end of the scale, such as 1 for correlations; by default the
                                  ///< largest value
  int decimals = -1;              ///< decimals of the numbers; -1: three digits for the largest
  int width = 1600;               ///< px, largest width; a small matrix gives a smaller picture
  std::vector<std::string> caption{};
};

/// Draws a matrix as coloured cells with their numbers. The scale is diverging about zero, or
/// starts at zero if no value is negative and no range is given. Numbers that do not fit are
/// omitted.
/// @throws std::invalid_argument for no cell, more than 256 rows or 64 columns, sizes that do not
///         match, or a range that is not positive
/// @throws std::system_error with the path if the file cannot be written
void write_heat_map(const std::filesystem::path& path, const HeatMap& map,
                    const HeatMapOptions& options = {});

}  // namespace abbe::render
