#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

namespace abbe::render {

/// Displacements at the points of a grid in a work space.
struct VolumePicture {
  std::string title;
  std::string figures;               ///< one line below the title
  cutting::Points points;            ///< (n x 3) mm
  cutting::Points displacement_um;   ///< (n x 3)
  std::array<int, 3> size{1, 1, 1};  ///< points along each direction, at least two of them above 1;
                                     ///< the first varies fastest
  std::vector<std::string> caption;
};

struct VolumeOptions {
  int width = 1600;   ///< px
  int height = 1200;  ///< px
  /// Direction from the grid to the eye; by default a flat grid is seen from straight above, others
  /// from (-0.5, -1, 0.6).
  std::optional<Eigen::Vector3d> from;
  std::optional<double> magnification;  ///< of the displacements; by default a round one that makes
                                        ///< them visible
};

/// Returns a round factor that makes the largest displacement about a twelfth of the grid's
/// diagonal; 1 if nothing is displaced.
double fitted_magnification(const VolumePicture& picture);

/// Draws the hull of the displaced grid, magnified, coloured by the length of the displacement,
/// with the outline of the undisplaced grid; at the right the hull coloured by the X, Y and Z
/// components on one symmetric scale. Magnification, scales, axis directions and a length are
/// printed.
/// @throws std::invalid_argument if sizes do not match, a number is not finite, fewer than two
///         sizes are above 1, or the magnification is not positive
/// @throws std::system_error with the path if the file cannot be written
void write_volume_map(const std::filesystem::path& path, const VolumePicture& picture,
                      const VolumeOptions& options = {});

}  // namespace abbe::render
