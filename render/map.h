#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "render/field.h"
#include "render/figures.h"

namespace abbe::render {

/// A residual map and all that must be said with it.
struct MapPicture {
  std::string title;
  Field field;
  Figures figures;  ///< of this field
  std::string datum = "none";
  std::string alignment = "none";
  std::vector<std::string> caption;  ///< further lines
};

struct MapOptions {
  int width = 1600;                ///< px
  int height = 1200;               ///< px
  std::optional<double> range_um;  ///< scale is -range .. +range; else fitted
  Eigen::Vector3d from = Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< direction from the part to the eye
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

/// Half range of the symmetric scale on which 99.5 % of the cut vertices lie, rounded up to
/// 1, 1.5, 2, 3, 4, 5, 6 or 8 x 10^k, at least 0.01 nm; micrometres.
double fitted_range_um(const Field& field);

/// Draws the map: the design fills the picture in a parallel projection, coloured by deviation on a
/// diverging scale symmetric about zero, uncut grey, with colour bar, figures, sign convention,
/// datum, alignment, view, scale bar and the number of vertices. In nm where the scale ends
/// below 0.1 µm.
/// @throws std::invalid_argument if sizes do not fit, or the range is not positive
/// @throws std::system_error with the path if the file cannot be written
void write_map(const std::filesystem::path& path, const MapPicture& picture,
               const MapOptions& options = {});

}  // namespace abbe::render
