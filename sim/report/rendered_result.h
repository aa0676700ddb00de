#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "sim/files/permissions.h"
#include "sim/scene/part_description.h"

namespace abbe::sim {

struct RenderOptions {
  std::filesystem::path result;                ///< a residual.vtp, or the folder that has one
  std::optional<std::filesystem::path> minus;  ///< another, taken away vertex by vertex
  std::optional<std::string> line;         ///< profile along "x", "y" or "radius" instead of a map
  std::filesystem::path out;               ///< folder
  std::optional<Eigen::Vector3d> from;     ///< direction to the eye; else that of the result
  std::optional<double> range_um;          ///< else fitted
  std::optional<Tolerance> bands;          ///< mm; else the tolerance of the result
  std::optional<std::array<int, 2>> size;  ///< px
  std::string colours;                     ///< "diverging", "cividis", "tolerance"; empty: by bands
  bool isolines = false;
  std::string format = "png";  ///< or "svg", "pdf"
  Permissions permissions;
};

/// Pictures of a finished result, or of a difference of two.
/// @return the picture
/// @throws BadInput, OutputFailure
std::filesystem::path render_result(const RenderOptions& options);

}  // namespace abbe::sim
