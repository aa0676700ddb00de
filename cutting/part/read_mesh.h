#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "cutting/part/mesh.h"
#include "kinematics/bad_input.h"

/// Reading and checking of design surfaces from mesh files.
namespace abbe::cutting {

struct ReadMeshOptions {
  double unit_mm = 1.0;  ///< mm per unit of the file, > 0: 25.4 inch, 1000 metre
  bool open = false;     ///< a surface with a rim is expected; closed ones are accepted as well
  std::int64_t max_triangles = 10'000'000;
  std::uintmax_t max_bytes = std::uintmax_t{1} << 30;
  std::optional<Eigen::Vector3d> travel;  ///< mm, extents of the machine's travel; a part more than
                                          ///< `travel_ratio` times as large cannot be machined and
                                          ///< is an input error. Empty: the size is not checked
  double travel_ratio = 2.0;  ///< 2: the part may protrude by half of the travel on either side
};

/// Error of a mesh with a rim where a closed one is expected.
struct MeshWithRim : BadInput {
  using BadInput::BadInput;
};

/// Reads a design surface from an STL (ascii, binary), PLY (ascii, binary), OBJ or OFF file, with
/// the format given by the file extension.
/// Faces of more than three corners are split by `triangulated`; corners of such a face that
/// coincide with their predecessor are dropped. Coordinates keep all digits of the file, up to
/// double precision. Equal points become one vertex (except in bodies that are closed as indexed in
/// the file), unused vertices are dropped, and normals in the file are ignored.
/// The header is checked against the size of the file before anything is stored. The mesh is then
/// checked: finite numbers, no degenerate triangle (height under 1e-7 of the longest edge), at most
/// two triangles at an edge and one fan at a vertex, one orientation (checked here, and OpenMesh's
/// half-edges must agree), closed unless `open`, outward orientation (positive volume; a negative
/// shell only inside a positive one), size against travel. Self-intersection is not checked.
/// @throws BadInput with file, expected and seen, and line and column for a text file
/// @throws MeshWithRim for a rim unless `open`
/// @throws std::invalid_argument if an option is not positive and finite
Design read_mesh(const std::filesystem::path& file, const ReadMeshOptions& options = {});

/// A design surface with the marks of its triangles.
struct MarkedMesh {
  Design design;
  FaceMarks marks;
};

/// Reads a design surface with the requested marks. Named groups are `g`, `o` and `usemtl` of an
/// OBJ, the solids of an ascii STL and integer properties of faces of a PLY. Colours are in PLY,
/// OFF, binary STL and the material library of an OBJ; see `read_obj` etc.
/// @throws BadInput, std::invalid_argument as `read_mesh`, and for an invalid mark
MarkedMesh read_mesh_with_marks(const std::filesystem::path& file, const ReadMeshOptions& options,
                                const MarkSelection& requested_marks);

}  // namespace abbe::cutting
