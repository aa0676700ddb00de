#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "cutting/read_mesh.h"
#include "sim/scene/mesh_file.h"

namespace abbe::sim {

/// What a scene says of a mesh: part, blank, fixture or body of the machine.
struct MeshUse {
  std::string what;                   ///< "the part", "fixture \"clamp\""
  std::string table;                  ///< of its keys: "part"
  bool may_open = false;              ///< its `open = true` is taken
  std::optional<double> travel = {};  ///< mm, in which it should find room; none: it may be larger
};

/// The mesh that a scene names, in its unit and open if it says so.
/// @param options  what else is asked of it
/// @throws BadInput as `read_marked_mesh`; for a rim that is not meant with the place in the scene
cutting::MarkedMesh read_named_mesh(const MeshFile& mesh, const MeshUse& use,
                                    cutting::ReadMeshOptions options = {},
                                    const cutting::WantedMarks& wanted = {});

/// mm, along the axes.
Eigen::Vector3d extents(const cutting::Points& vertices);

/// What is to be said of the extents of a mesh: below 1 mm, beyond the travel. Empty of others, and
/// of a mesh of `any_size`.
/// @param size  mm, along the axes of its own frame
std::string odd_size(const MeshFile& mesh, const MeshUse& use, const Eigen::Vector3d& size);

/// What part.unit calls a unit of so many mm; empty if it has no name.
std::string unit_word(double unit_mm);

}  // namespace abbe::sim
