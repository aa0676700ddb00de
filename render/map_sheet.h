#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/mesh.h"
#include "render/residual_map.h"

namespace abbe::render {

struct ComparisonOptions {
  std::string title;
  int width = 1600;                ///< px; the height depends on number and shape of the cases
  std::optional<double> range_um;  ///< end of the scale; by default the largest of the cases
  Eigen::Vector3d from = Eigen::Vector3d(-0.5, -1.0, 0.9);
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::vector<std::string> caption;  ///< further lines below the maps
};

/// Draws the maps of all cases with the same colour scale and length scale. Above a map is its
/// title, below it are a colour bar, its figures, the fraction of the area in tolerance and its
/// caption ("−92 % RMS"). A case that needs less than 40 % of the common scale is drawn again
/// beside it, on its own scale.
/// @throws std::invalid_argument if there is no case, sizes do not match, or the range is not
///         positive
/// @throws std::system_error with the path if the file cannot be written
void write_comparison(const std::filesystem::path& path, const std::vector<MapPicture>& cases,
                      const ComparisonOptions& options = {});

/// One of several maps of the same design.
struct SheetMap {
  std::string title;
  std::string figures;               ///< text below the title, such as "RMS 1.23 µm   PV 5.6 µm"
  Eigen::VectorXd values_um;         ///< (n) NaN for a vertex without value
  std::optional<double> range_um{};  ///< end of its scale; by default fitted to the values
};

struct SheetOptions {
  std::string title{};
  std::optional<std::string> values{};  ///< meaning of the values, in the caption; by default the
                                        ///< sign convention of a residual
  int columns = 0;                      ///< 0: the number that makes the sheet about 4 : 3
  int width = 2400;                     ///< px; the height depends on the number of maps
  bool common_range = false;            ///< all maps have the largest range
  Eigen::Vector3d from = Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< as for a map
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::vector<std::string> caption{};  ///< further lines
};

inline constexpr std::size_t max_sheet_maps = 256;

/// Draws small maps side by side in the same view, each with title, figures and a colour bar. A
/// scale is symmetric about zero, or starts at zero if no value is negative (standard deviations).
/// A fine design is drawn with fewer vertices, so that memory stays below about 2 GB; the sheet
/// states their number.
/// @throws std::invalid_argument for no map or more than 256, sizes that do not match, a range that
///         is not positive, an invalid design, or a sheet higher than 16384 px
/// @throws std::system_error with the path if the file cannot be written
void write_sheet(const std::filesystem::path& path, const cutting::Design& design,
                 const std::vector<SheetMap>& maps, const SheetOptions& options = {});

}  // namespace abbe::render
