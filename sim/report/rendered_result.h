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

/// Options of `abbe render`.
struct RenderOptions {
  std::filesystem::path result;                ///< a residual.vtp or its folder
  std::optional<std::filesystem::path> minus;  ///< another result, subtracted vertex by vertex
  std::optional<std::string> line;  ///< "x", "y" or "radius": a profile along this line instead of
                                    ///< a map
  LineTextureOptions texture;       ///< for that line
  std::filesystem::path out;        ///< folder
  std::optional<Eigen::Vector3d> from;     ///< view direction, towards the eye; empty: that of the
                                           ///< result
  std::optional<double> range_um;          ///< of the colours; empty: fitted to the map
  std::optional<Tolerance> bands;          ///< mm; empty: the tolerance of the result
  std::optional<std::array<int, 2>> size;  ///< px
  std::string colours;  ///< "diverging", "cividis", "tolerance"; empty: "tolerance" with bands,
                        ///< else "diverging"
  bool isolines = false;
  std::string format = "png";  ///< "png", "svg" or "pdf"
  Permissions permissions;
};

/// Result of `abbe render`: the written files, and the texture of a line.
struct RenderOutcome {
  std::filesystem::path picture;
  std::vector<std::filesystem::path> files;  ///< other files
  std::optional<LineTexture> texture;        ///< for a line
};

/// Draws the map of a result, or the difference of two results. For a line it draws the profile and
/// also writes profile-LINE.json and profile-LINE.csv.
/// @throws BadInput, also if nothing on a line is cut; OutputFailure
RenderOutcome render_result(const RenderOptions& options);

}  // namespace abbe::sim
