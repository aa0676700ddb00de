#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "cutting/face_marks.h"

namespace abbe::cutting {

inline constexpr std::size_t max_mtl_bytes = std::size_t{16} << 20;

/// Materials by name, with their diffuse colour; none where a material has none.
using Materials = std::map<std::string, std::optional<FaceColour>>;

/// The materials of a Wavefront MTL and their `Kd r g b`, 0 .. 1. What else materials have is
/// passed over, but its keyword must be one of theirs.
/// @throws BadInput for anything else, a name twice and a file of more than `max_mtl_bytes`
Materials read_mtl(const std::filesystem::path& file);

}  // namespace abbe::cutting
