#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"

namespace abbe::render {

/// Displacements at the points of a grid in the work space.
struct VolumePicture {
  std::string title;
  std::string figures;               ///< line of text below the title
  cutting::Points points;            ///< (n x 3) mm
  cutting::Points displacement_um;   ///< (n x 3)
  std::array<int, 3> size{1, 1, 1};  ///< number of points along each direction; the first index
                                     ///< varies fastest, at least two sizes are above 1
  std::vector<std::string> caption;
};

struct VolumeOptions {
  int width = 1600;   ///< px
  int height = 1200;  ///< px
  /// Direction from the grid to the eye. By default it is the normal of a flat grid, else
  /// (-0.5, -1, 0.6).
  std::optional<Eigen::Vector3d> from;
  std::optional<double> magnification;  ///< of the displacements; default: `fitted_magnification`
};

/// Returns a round factor with which the largest displacement is about a twelfth of the diagonal of
/// the grid; 1 without displacements.
double fitted_magnification(const VolumePicture& picture);

/// Draws the surface of the grid with magnified displacements, coloured by their magnitude, and the
/// outline of the undisplaced grid. At the right are three small views, coloured by the X, Y and Z
/// components on a common symmetric scale. The picture states the magnification and has colour
/// bars, axes and a scale bar.
/// @throws std::invalid_argument if array sizes do not match `size`, a number is not finite, fewer
///         than two entries of `size` are above 1, or the magnification is not positive
/// @throws std::system_error with the path if the file cannot be written
void write_volume_map(const std::filesystem::path& path, const VolumePicture& picture,
                      const VolumeOptions& options = {});

}  // namespace abbe::render
