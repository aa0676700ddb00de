#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/mesh.h"

namespace abbe::render {

/// One of many maps of the same design.
struct SheetMap {
  std::string title;
  std::string figures;               ///< one or two, below the title: "RMS 1.23 µm   PV 5.6 µm"
  Eigen::VectorXd values_um;         ///< (n) NaN where there is none
  std::optional<double> range_um{};  ///< end of its scale; else fitted as that of a map
};

struct SheetOptions {
  std::string title{};
  std::optional<std::string> values{};  ///< what they are, in the caption; else a residual's signs
  int columns = 0;                      ///< 0: as many as make the sheet about 4 : 3
  int width = 2400;                     ///< px; the height follows
  bool one_range = false;               ///< the largest range for all maps
  Eigen::Vector3d from = Eigen::Vector3d(-0.5, -1.0, 0.9);  ///< as of a map
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  std::vector<std::string> caption{};  ///< further lines
};

inline constexpr std::size_t most_sheet_maps = 256;

/// Draws small maps side by side, seen alike, each with title, figures and a colour bar of its own
/// scale: symmetric about zero, or from zero where no value is negative (a standard deviation).
/// A fine design is drawn on fewer vertices, so that memory stays below about 2 GB, and the sheet
/// says so.
/// @throws std::invalid_argument for no map or more than 256, sizes that do not fit, a range that
///         is not positive, a design that is none, or a sheet higher than 16384 px
/// @throws std::system_error with the path if the file cannot be written
void write_sheet(const std::filesystem::path& path, const cutting::Design& design,
                 const std::vector<SheetMap>& maps, const SheetOptions& options = {});

}  // namespace abbe::render
