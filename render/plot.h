#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::render {

struct HistogramOptions {
  std::string title;
  int width = 1600;                    ///< px
  int height = 900;                    ///< px
  std::optional<double> tolerance_um;  ///< half width; two lines are drawn
  std::vector<std::string> caption;    ///< further lines
};

/// Draws how much of the area has which deviation: shares of bins of a round width, the mean as a
/// line, PV, RMS and mean in words, tolerance lines where there are any. Told in nm where
/// everything is below 0.1 µm. Where a few values would squeeze the rest, the axis spans 99.9 % of
/// the area and the picture says how much lies beyond.
/// @param deviation_um  (n); what is not finite (uncut) is left out
/// @param weights       (n) >= 0, the areas of the vertices
/// @throws std::invalid_argument if sizes differ or a weight is negative or not finite
/// @throws std::system_error with the path if the file cannot be written
void write_histogram(const std::filesystem::path& path, const Eigen::VectorXd& deviation_um,
                     const Eigen::VectorXd& weights, const HistogramOptions& options = {});

/// One curve: points in their order, broken where a coordinate is not finite.
struct ProfileSeries {
  std::string name;
  Eigen::VectorXd x;
  Eigen::VectorXd y;
};

struct ProfileOptions {
  std::string title;
  std::string x_label = "x / mm";
  std::string y_label = "deviation / µm";
  int width = 1600;  ///< px
  int height = 900;  ///< px
  std::vector<std::string> caption;
};

/// Draws curves over a common abscissa with axes and legend.
/// @throws std::invalid_argument if there is no series or the sizes of one differ
/// @throws std::system_error with the path if the file cannot be written
void write_profile(const std::filesystem::path& path, const std::vector<ProfileSeries>& series,
                   const ProfileOptions& options = {});

}  // namespace abbe::render
