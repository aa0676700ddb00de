#pragma once

#include <filesystem>
#include <vector>

#include "cutting/part/mesh_file.h"

namespace abbe::cutting {

/// Vertices and faces of a Wavefront OBJ; texture, normals, lines and points are passed over. The
/// groups of a face: each name of the `g` above it, all of them as one text, the `o` and the
/// `usemtl` above it ("default" of a `g` alone). Its colour: the Kd of its `usemtl` in the
/// libraries above, which stand beside the file whatever folder their `mtllib` names.
/// @throws BadInput for anything else; where colours are asked for, also for a library that is not
///         there and a material that no library above it has
TriangleSoup read_obj(const MeshSource& source, const MarkSelection& wanted = {});

/// The libraries of materials that an OBJ names and that stand beside it, each once.
/// @throws BadInput where the file cannot be read or is longer than `max_bytes`
std::vector<std::filesystem::path> material_files(const std::filesystem::path& file,
                                                  std::uintmax_t max_bytes = std::uintmax_t{1}
                                                                             << 30);

/// An OFF in text, its faces with or without a colour, or a COFF, whose vertices have one. The
/// colour of a face: three or four whole numbers, 0 .. 255, or fractions, 0 .. 1 (so are whole ones
/// of which none is above 1), the fourth not looked at; without one that of its corners, if they
/// agree.
/// @throws BadInput for anything else; for a colour only if colours are asked for, and then for an
///         index into a map of colours too
TriangleSoup read_off(const MeshSource& source, const MarkSelection& wanted = {});

}  // namespace abbe::cutting
