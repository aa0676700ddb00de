#pragma once

#include <filesystem>
#include <vector>

#include "cutting/triangle_soup.h"

namespace abbe::cutting {

/// Vertices and faces of a Wavefront OBJ; texture, normals, lines and points are passed over. The
/// groups of a face: each name of the `g` above it, all of them as one text, the `o` and the
/// `usemtl` above it ("default" of a `g` alone). Its colour: the Kd of its `usemtl` in the
/// libraries above, which stand beside the file whatever folder their `mtllib` names.
/// @throws BadInput for anything else; where colours are asked for, also for a library that is not
///         there and a material that no library above it has
Soup read_obj(const MeshSource& source, const WantedMarks& wanted = {});

/// The libraries of materials that an OBJ names and that stand beside it, each once.
/// @throws BadInput where the file cannot be read or is longer than `max_bytes`
std::vector<std::filesystem::path> material_files(const std::filesystem::path& file,
                                                  std::uintmax_t max_bytes = std::uintmax_t{1}
                                                                             << 30);

}  // namespace abbe::cutting
