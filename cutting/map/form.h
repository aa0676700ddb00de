#pragma once

#include <string>
#include <vector>

#include "cutting/part/mesh.h"
#include "cutting/part/primitive.h"
#include "cutting/surface/surface.h"
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
struct AlignmentResult {
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
AlignmentResult aligned(const Surface& surface, const Design& design,
                        const AlignmentOptions& options);

/// One number of form, named as ISO 1101 names it with the way of fitting.
struct FormNumber {
  std::string name;
  double value_mm;
};

/// Form of the machined surface over its cut vertices, where the design is a known surface:
///   rectangle, disc  flatness_lsq, flatness_minimum_zone
///   cylinder         cylindricity_lsq, roundness_lsc (the ring nearest to mid height, across the
///   axis) cone             conicity_lsq (at the nominal apex angle), roundness_lsc up to 45
///   degrees sphere cap       sphericity_lsq;   torus  torus_form_lsq;   profile  profile_form_lsq
/// The `_lsq` numbers are max - min of the residual after the best displacement of the whole and
/// the best uniform allowance (the size) are taken out, least squares weighted by vertex area;
/// first order in the displacement t: t^2 / 2R is left out (20 um on R 50 mm: 4 nm). The minimum
/// zone is the distance of the closest two parallel planes, an upper bound that the method closes
/// to 1e-12 mm. A number for which too few vertices are cut is not in the list.
/// @param design_m  the design in the frame of the primitive
/// @throws std::invalid_argument if sizes differ
std::vector<FormNumber> form(const Primitive& primitive, const Design& design_m,
                             const Surface& surface);

/// Least-squares circle.
struct Circle {
  Eigen::Vector2d centre;  ///< mm
  double radius;           ///< mm
  double roundness;        ///< mm, largest minus smallest distance from the centre
};

/// Circle that makes the sum of squared distances of the points from it smallest (geometric
/// distances, each point counting one).
/// @param points  (n x 2) mm, n >= 3
/// @throws std::invalid_argument for fewer than 3 points, numbers not finite, points on a line
Circle fit_circle(const Eigen::Matrix<double, Eigen::Dynamic, 2>& points);

}  // namespace abbe::cutting
