#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "cutting/part/mesh.h"
#include "kinematics/bad_input.h"

namespace abbe::cutting {

struct ReadMeshOptions {
  double unit_mm = 1.0;  ///< mm per unit of the file, > 0: 25.4 inch, 1000 metre
  bool open = false;     ///< a surface with a rim is meant; closed ones pass as well
  std::int64_t max_triangles = 10'000'000;
  std::uintmax_t max_bytes = std::uintmax_t{1} << 30;
  std::optional<Eigen::Vector3d> travel;  ///< mm, extents of the machine's travel: a part more than
                                          ///< `travel_ratio` times as large cannot lie there and is
                                          ///< refused. Leave it out where the size is beyond doubt
  double travel_ratio = 2.0;              ///< a part may stand out by half its size on either side
};

/// Refusal of a mesh with a rim where none is meant.
struct MeshWithRim : BadInput {
  using BadInput::BadInput;
};

/// Design surface from an STL (ascii, binary), PLY (ascii, binary), OBJ or OFF file, its kind known
/// by the ending. Faces of more than three corners are split as `triangulated` says. Coordinates
/// are taken as written (double where the file has the digits); a corner of such a face that stands
/// where the one before stands is dropped, equal points are one vertex (but of bodies that are
/// closed as they are indexed), unused vertices are dropped, normals in the file are not believed.
/// The file is checked against its own header and size before anything is stored, and the mesh is
/// audited: finite, no degenerate triangle (height under 1e-7 of the longest edge), at most two
/// triangles at an edge and one fan at a vertex, one orientation (found here, and OpenMesh's
/// half-edges must agree), closed unless `open`, outward (positive volume; a negative shell only
/// inside a positive one), size against travel. Self-intersection is not looked for.
/// @throws BadInput with file, line and column where it is text; expected and seen
/// @throws MeshWithRim for a rim unless `open`
/// @throws std::invalid_argument if an option is not positive and finite
Design read_mesh(const std::filesystem::path& file, const ReadMeshOptions& options = {});

/// A design surface, and what its file says of its triangles.
struct MarkedMesh {
  Design design;
  FaceMarks marks;
};

/// The same with the marks that are asked for: groups by name are `g`, `o` and `usemtl` of an OBJ,
/// the solids of an ascii STL and whole numbers at the faces of a PLY; colours are in PLY, OFF,
/// binary STL and the library of materials of an OBJ (`read_obj.h` and so on).
/// @throws BadInput, std::invalid_argument as `read_mesh`, and for a mark that is none
MarkedMesh read_marked_mesh(const std::filesystem::path& file, const ReadMeshOptions& options,
                            const MarkSelection& wanted);

}  // namespace abbe::cutting
