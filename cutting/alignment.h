#pragma once

#include <string>
#include <vector>

#include "cutting/mesh.h"
#include "cutting/surface.h"
#include "kinematics/pose.h"

namespace abbe::cutting {

/// What of a residual is taken out as a displacement of the whole part.
enum class Alignment {
  None,
  Offset,  ///< best translation, three components
  Rigid,   ///< best translation and rotation, six components
};

struct AlignmentOptions {
  Alignment alignment = Alignment::None;
  double truncation = 1e-6;  ///< eigenvalues below this fraction of the largest are left out: a
                             ///< displacement that moves the surface along its normals a thousand
                             ///< times less than another one is not determined by them
};

/// A residual without the displacement of the whole.
struct Aligned {
  Surface surface;  ///< the residual changed where it is cut, all else as it was
  kinematics::Deviation displacement =
      kinematics::Deviation::Zero();                ///< of the machined part, stated
                                                    ///< at `point`; mm and rad
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< mm, centre of the cut area
  int rank = 0;                                     ///< components that were determined
  std::vector<std::string> undetermined;  ///< what was left out, by its components: "EX", "EA+EY"
};

/// Takes out the displacement D that fits r = n . (d + theta x (p - point)) best over the cut
/// vertices and places within triangles, least squares with their `weights`, truncated as the
/// options say (the shortest solution, angles counted at the root-mean-square distance from the
/// point). First order: a rotation |theta| over a distance L from the point leaves out |theta|^2 L
/// / 2 (100 urad, 100 mm: 0.5 nm) and what the shift does along a curved surface, t^2 / 2R (50 um
/// on R 50 mm: 25 nm).
/// @throws std::invalid_argument if sizes differ, or a vertex called cut has no finite residual
Aligned aligned(const Surface& surface, const Design& design, const AlignmentOptions& options);

}  // namespace abbe::cutting
