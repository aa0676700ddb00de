#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cutting/recognise.h"
#include "sim/cut/named_mesh.h"
#include "sim/cut/regions.h"
#include "sim/machine/machine.h"
#include "sim/program/generate.h"
#include "sim/program/path.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// The design of a scene, loaded.
struct Part {
  cutting::Design body_m;    ///< as the file or the declared surface gives it, part frame
  cutting::Design design_m;  ///< the same, its sharp edges parted
  cutting::Design design_w;  ///< in the workpiece frame, where it is cut
  std::vector<cutting::RecognisedPatch> recognised;  ///< of a mesh, part frame
  double recognised_share = 0.0;                     ///< of its area
  Eigen::VectorXd facet_miss;                        ///< (vertices given) mm, of a mesh
  FaceGroups face_groups;                            ///< of a mesh, for its regions
  std::vector<std::string> warnings;
  program::ContactField contact;  ///< part frame, continued beyond the rim where a raster asks
  Eigen::Vector2d lower, upper;   ///< mm, x y of the part frame that a raster covers
};

/// mm, extents of the travel of the slides, along the bed's axes; none where one has no limits.
std::optional<Eigen::Vector3d> travel_box(const MachineDescription& machine);

/// What the scene says of the part's mesh; room for it is in the travel.
MeshUse use_of_part(const Scene& scene);

/// The surface of a part between its vertices, the part standing at T: the declared one, what a
/// mesh was recognised as, or what its facets show.
cutting::OnSurface between_vertices(const PartDescription& part,
                                    const std::vector<cutting::RecognisedPatch>& recognised,
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
