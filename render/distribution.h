#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::render {

/// The values of one configuration of a study.
struct DistributionSeries {
  std::string name;
  Eigen::VectorXd values;        ///< (n); values that are not finite are excluded
  std::optional<double> mean{};  ///< marked at the axis
  std::optional<double> p95{};
  std::vector<std::string> figures{};  ///< table row, one figure per head
};

struct DistributionOptions {
  std::string title{};
  std::string x_label = "value";
  std::string unit = "µm";        ///< of the values, for the bins
  std::optional<double> limit{};  ///< drawn as a vertical line
  std::string limit_label = "limit";
  std::vector<std::string> heads{};  ///< of the table: "mean / µm", "P95 / µm", "Cpk"
  int width = 1600;                  ///< px
  int height = 900;                  ///< px, without the table
  std::vector<std::string> caption{};
};

/// Draws histograms of all series, overlaid, with bins of one round width, mean (disc) and P95
/// (triangle) at the axis, and a table of figures that is the legend. If a few values would squeeze
/// the rest, the axis spans 99.8 % of them and the picture states how many lie beyond.
/// @throws std::invalid_argument for no series, more than 24, or figures that do not match the
///         heads
/// @throws std::system_error with the path if the file cannot be written
void write_distribution(const std::filesystem::path& path,
                        const std::vector<DistributionSeries>& series,
                        const DistributionOptions& options = {});

}  // namespace abbe::render
