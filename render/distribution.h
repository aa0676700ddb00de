#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::render {

/// The values of one configuration of a study, drawn as a histogram.
struct DistributionSeries {
  std::string name;
  Eigen::VectorXd values;              ///< (n); values that are not finite are excluded
  std::optional<double> mean{};        ///< marked at the axis
  std::optional<double> p95{};         ///< marked at the axis
  std::vector<std::string> figures{};  ///< row of the table, one text for each head
};

struct DistributionOptions {
  std::string title{};
  std::string x_label = "value";
  std::string unit = "µm";        ///< unit of the values, stated with the bin width
  std::optional<double> limit{};  ///< drawn as a vertical line
  std::string limit_label = "limit";
  std::vector<std::string> headings{};  ///< heads of the table: "mean / µm", "P95 / µm", "Cpk"
  int width = 1600;                     ///< px
  int height = 900;                     ///< px, without the table
  std::vector<std::string> caption{};
};

/// Draws the overlaid histograms of all series, with bins of one round width, the mean (disc) and
/// P95 (triangle) at the axis, and a table that is also the legend. If outliers would compress the
/// histograms, the axis covers 99.8 % of the values and the picture states how many are beyond.
/// @throws std::invalid_argument for no series, more than 24, or figures that do not match the
///         heads
/// @throws std::system_error with the path if the file cannot be written
void write_distribution(const std::filesystem::path& path,
                        const std::vector<DistributionSeries>& series,
                        const DistributionOptions& options = {});

}  // namespace abbe::render
