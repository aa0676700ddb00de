#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

namespace abbe::render {

/// A grid of points in a work space and how far each is displaced.
struct VolumePicture {
  std::string title;
  std::string figures;               ///< one line below the title
  cutting::Points points;            ///< (n x 3) mm
  cutting::Points displacement_um;   ///< (n x 3)
  std::array<int, 3> size{1, 1, 1};  ///< points along each run, at least two of them above 1; the
                                     ///< first runs fastest
  std::vector<std::string> caption;
};

struct VolumeOptions {
  int width = 1600;   ///< px
  int height = 1200;  ///< px
  /// Direction from the grid to the eye; else a flat grid is seen from straight above it, others
  /// from (-0.5, -1, 0.6).
  std::optional<Eigen::Vector3d> from;
  std::optional<double> magnification;  ///< of the displacements; else a round one that shows them
};

/// Round factor that makes the largest displacement about a twelfth of the grid's diagonal; 1 where
/// nothing is displaced.
double fitted_magnification(const VolumePicture& picture);

/// Draws the hull of the displaced grid, magnified, coloured by the length of the displacement,
/// beside the outline of the grid where it should be; at the right the hull coloured by the X, Y
/// and Z of the displacement on one symmetric scale. Magnification, scales, directions of the axes
/// and a length are written.
/// @throws std::invalid_argument if sizes do not fit, a number is not finite, fewer than two sizes
///         are above 1, or the magnification is not positive
/// @throws std::system_error with the path if the file cannot be written
void write_volume_map(const std::filesystem::path& path, const VolumePicture& picture,
                      const VolumeOptions& options = {});

}  // namespace abbe::render
