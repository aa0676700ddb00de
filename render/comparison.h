#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "render/map.h"

namespace abbe::render {

struct ComparisonOptions {
  std::string title;
  int width = 1600;  ///< px; the height follows from the number of cases and their shape
  std::optional<double> range_um;  ///< as of a map; else the largest of the cases'
  Eigen::Vector3d from = Eigen::Vector3d(-0.5, -1.0, 0.9);
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::vector<std::string> caption;  ///< further lines below all
};

/// Draws every case on one colour scale and one length scale, its title above and its figures,
/// share in tolerance and caption lines ("−92 % RMS") below; a case whose own scale ends below 40 %
/// of the common one a second time beside it on its own. Each panel has its colour bar.
/// @throws std::invalid_argument if there is no case, sizes do not fit, or the range is not
/// positive
/// @throws std::system_error with the path if the file cannot be written
void write_comparison(const std::filesystem::path& path, const std::vector<MapPicture>& cases,
                      const ComparisonOptions& options = {});

}  // namespace abbe::render
