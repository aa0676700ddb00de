#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/part/read_mesh.h"
#include "cutting/part/recognition.h"
#include "sim/cut/part_regions.h"
#include "sim/machine/machine.h"
#include "sim/program/generators.h"
#include "sim/program/path.h"
#include "sim/scene/bodies.h"
#include "sim/scene/scene.h"

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
                                    const cutting::MarkSelection& wanted = {});

/// mm, along the axes.
Eigen::Vector3d extents(const cutting::Points& vertices);

/// What is to be said of the extents of a mesh: below 1 mm, beyond the travel. Empty of others, and
/// of a mesh of `any_size`.
/// @param size  mm, along the axes of its own frame
std::string mesh_size_warning(const MeshFile& mesh, const MeshUse& use,
                              const Eigen::Vector3d& size);

/// What part.unit calls a unit of so many mm; empty if it has no name.
std::string unit_label(double unit_mm);

/// "12 of 40 passes are left out ..."; empty if all are reached.
std::string unreached_text(const program::Unreached& unreached);

/// The design of a scene, loaded.
struct Part {
  cutting::Design body_m;    ///< as the file or the declared surface gives it, part frame
  cutting::Design design_m;  ///< the same, its sharp edges parted
  cutting::Design design_w;  ///< in the workpiece frame, where it is cut
  std::vector<cutting::AnalyticPatch> recognised;  ///< of a mesh, part frame
  double recognised_fraction = 0.0;                ///< of its area
  Eigen::VectorXd facet_uncertainty;               ///< (vertices given) mm, of a mesh
  FaceGroups face_groups;                          ///< of a mesh, for its regions
  std::vector<std::string> warnings;
  program::ContactField contact;  ///< part frame, continued beyond the rim where a raster asks
  Eigen::Vector2d lower, upper;   ///< mm, x y of the part frame that a raster covers
};

/// mm, extents of the travel of the slides, along the bed's axes; none where one has no limits.
std::optional<Eigen::Vector3d> travel_box(const MachineDescription& machine);

/// What the scene says of the part's mesh; room for it is in the travel.
MeshUse part_mesh_use(const Scene& scene);

/// The surface of a part between its vertices, the part standing at T: the declared one, what a
/// mesh was recognised as, or what its facets show.
cutting::SurfaceInterpolator surface_between_vertices(
    const PartDescription& part, const std::vector<cutting::AnalyticPatch>& recognised,
    const kinematics::Pose& T);

/// @throws BadInput, also if a mesh is too large to lie on the machine, or no vertex is left to be
///         judged
Part load_part(const Scene& scene);

/// A program read, and its text if a generator wrote it.
struct Program {
  program::Path path;
  std::string text;
  program::Unreached unreached;            ///< what a generator had to leave out
  std::vector<std::string> warnings = {};  ///< of its reader
};

/// Reads the program of a scene; a generated one is read back from its own text, under the name
/// that its file will have.
/// @throws BadInput
Program load_program(const Scene& scene, const Machine& machine, const Part& part);

/// What the control of the scene knows before it reads a program.
program::NcOptions nc_options(const Scene& scene, const Machine& machine);

}  // namespace abbe::sim
