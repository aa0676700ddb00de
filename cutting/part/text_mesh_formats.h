#pragma once

#include <filesystem>
#include <vector>

#include "cutting/part/mesh_file.h"

/// Mesh formats in text form: OBJ with its material libraries, and OFF.
namespace abbe::cutting {

/// Reads vertices and faces of a Wavefront OBJ; texture, normals, lines and points are skipped. The
/// groups of a face are each name of the `g` above it, all of them as one text, and the `o` and the
/// `usemtl` above it ("default" for a `g` without a name). Its colour is the Kd of its `usemtl` in
/// the libraries above, which are searched beside the file whatever folder their `mtllib` names.
/// @throws BadInput for anything else; if colours are requested, also for a missing library and for
///         a material that no library above it has
TriangleSoup read_obj(const MeshSource& source, const MarkSelection& wanted = {});

/// Returns the material libraries that an OBJ names and that exist beside it, each once.
/// @throws BadInput if the file cannot be read or is longer than `max_bytes`
std::vector<std::filesystem::path> material_files(const std::filesystem::path& file,
                                                  std::uintmax_t max_bytes = std::uintmax_t{1}
                                                                             << 30);

/// Reads an OFF in text, with or without colours of its faces, or a COFF, whose vertices have
/// colours. The colour of a face is three or four integers, 0 .. 255, or fractions, 0 .. 1
/// (integers of which none is above 1 count as fractions), of which the fourth is ignored; without
/// one, the colour of its corners, if they agree.
/// @throws BadInput for anything else; for a colour only if colours are requested, and then also
///         for an index into a colour map
TriangleSoup read_off(const MeshSource& source, const MarkSelection& wanted = {});

}  // namespace abbe::cutting
