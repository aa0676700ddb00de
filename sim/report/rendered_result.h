#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/files/output.h"
#include "sim/report/line_texture.h"
#include "sim/scene/part.h"

namespace abbe::sim {

struct RenderOptions {
  std::filesystem::path result;                ///< a residual.vtp, or the folder that has one
  std::optional<std::filesystem::path> minus;  ///< another, taken away vertex by vertex
  std::optional<std::string> line;         ///< profile along "x", "y" or "radius" instead of a map
  LineTextureOptions texture;              ///< of that line
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

/// What was drawn.
struct RenderOutcome {
  std::filesystem::path picture;
  std::vector<std::filesystem::path> files;  ///< beside it
  std::optional<LineTexture> texture;        ///< of a line
};

/// Pictures of a finished result, or of a difference of two; of a line its profiles as well, as
/// profile-LINE.json and .csv.
/// @throws BadInput, also where nothing of a line is cut; OutputFailure
RenderOutcome render_result(const RenderOptions& options);

}  // namespace abbe::sim
