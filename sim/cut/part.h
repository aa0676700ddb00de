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

/// The design of a scene and its program, loaded from files or generated.
namespace abbe::sim {

/// The use of a mesh in a scene, as part, blank, fixture or body of the machine.
struct MeshUse {
  std::string what;                   ///< name in messages: "the part", "fixture \"clamp\""
  std::string table;                  ///< table of its keys, such as "part"
  bool accepts_open = false;          ///< the key `open = true` is accepted
  std::optional<double> travel = {};  ///< largest extent of the mesh, mm; none: no limit
};

/// Reads the mesh that a scene names, scaled by its unit; with a rim if the scene allows it.
/// @param options  further options of the reader
/// @throws BadInput as `read_marked_mesh`; for an unexpected rim with the location in the scene
cutting::MarkedMesh read_named_mesh(const MeshFile& mesh, const MeshUse& use,
                                    cutting::ReadMeshOptions options = {},
                                    const cutting::MarkSelection& wanted = {});

/// Returns the extents along the axes, mm.
Eigen::Vector3d extents(const cutting::Points& vertices);

/// Returns the warning about a mesh whose extents are below 1 mm or beyond the travel; empty for
/// any other mesh, and for one with `any_size`.
/// @param size  extents along the axes of its own frame, mm
std::string mesh_size_warning(const MeshFile& mesh, const MeshUse& use,
                              const Eigen::Vector3d& size);

/// Returns the name of a unit of `unit_mm` mm in part.unit; empty if it has none.
std::string unit_label(double unit_mm);

/// Returns the warning about passes that a generator had to leave out; empty if there are none.
std::string unreached_text(const program::UnreachedPoints& unreached);

/// The loaded design of a scene.
struct Part {
  cutting::Design body_m;    ///< as loaded from the file or the declared surface, part frame
  cutting::Design design_m;  ///< the same with vertices split at sharp edges
  cutting::Design design_w;  ///< in the workpiece frame, where it is cut
  std::vector<cutting::AnalyticPatch> recognised;  ///< surfaces recognised in a mesh, part frame
  double recognised_fraction = 0.0;                ///< fraction of the mesh area
  Eigen::VectorXd facet_uncertainty;               ///< (vertices as loaded) mm, of a mesh
  FaceGroups face_groups;                          ///< of a mesh, for its regions
  std::vector<std::string> warnings;
  program::ContactField contact;  ///< part frame; it continues beyond the rim if a raster needs it
  Eigen::Vector2d lower, upper;   ///< range of x and y of the part frame that a raster covers, mm
};

/// Returns the extents of the travel of the slides along the axes of the bed, mm; none if a slide
/// has no limits.
std::optional<Eigen::Vector3d> travel_box(const MachineDescription& machine);

/// Returns the use of the part's mesh, which should fit into the travel.
MeshUse part_mesh_use(const Scene& scene);

/// Returns the surface of a part at pose T between its vertices: the declared surface, the surfaces
/// recognised in a mesh, or the smooth surface that its facets represent.
cutting::SurfaceInterpolator surface_between_vertices(
    const PartDescription& part, const std::vector<cutting::AnalyticPatch>& recognised,
    const kinematics::Pose& T);

/// Loads the part of a scene.
/// @throws BadInput, also if a mesh is too large for the machine or no vertex is judged
Part load_part(const Scene& scene);

/// A program, with its text if it was generated.
struct Program {
  program::Path path;
  std::string text;
  program::UnreachedPoints unreached;      ///< passes that a generator had to leave out
  std::vector<std::string> warnings = {};  ///< of the reader
};

/// Reads the program of a scene. A generated program is read back from its own text, under the name
/// of its file.
/// @throws BadInput if the program cannot be read or generated
Program load_program(const Scene& scene, const Machine& machine, const Part& part);

/// Returns the data of the control of a scene before it reads a program.
program::NcOptions nc_options(const Scene& scene, const Machine& machine);

}  // namespace abbe::sim
