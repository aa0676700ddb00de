#pragma once

#include <filesystem>
#include <vector>

#include "cutting/part/mesh_file.h"

/// Readers of mesh formats in text form: OBJ with its material libraries, and OFF.
namespace abbe::cutting {

/// Reads vertices and faces of a Wavefront OBJ; texture, normals, lines and points are skipped. The
/// groups of a face are each name of the preceding `g` ("default" if it has none), the whole text
/// of several names, the preceding `o` and the preceding `usemtl`. Its colour is the Kd of its
/// `usemtl` in the preceding libraries, which are searched in the folder of the file whatever
/// folder their `mtllib` names.
/// @throws BadInput for other content; if colours are requested, also for a missing library and for
///         a material that no preceding library defines
TriangleSoup read_obj(const MeshSource& source, const MarkSelection& requested_marks = {});

/// Returns the material libraries that an OBJ names and that exist in its folder, without
/// duplicates.
/// @throws BadInput if the file cannot be read or is longer than `max_bytes`
std::vector<std::filesystem::path> material_files(const std::filesystem::path& file,
                                                  std::uintmax_t max_bytes = std::uintmax_t{1}
                                                                             << 30);

/// Reads an OFF in text form, with or without colours of its faces, or a COFF, whose vertices have
/// colours. The colour of a face is three or four integers 0 .. 255 or fractions 0 .. 1 (integers
/// count as fractions if none exceeds 1); the fourth number is ignored. A face without a colour
/// gets that of its corners, provided that they agree.
/// @throws BadInput for other content; for a colour only if colours are requested, and then also
///         for an index into a colour map
TriangleSoup read_off(const MeshSource& source, const MarkSelection& requested_marks = {});

}  // namespace abbe::cutting
