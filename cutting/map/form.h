#pragma once

#include <string>
#include <vector>

#include "cutting/part/mesh.h"
#include "cutting/part/primitive.h"
#include "cutting/surface/surface.h"
#include "kinematics/pose.h"

/// Removal of the displacement of the whole part from a residual, and numbers of form.
namespace abbe::cutting {

/// The displacement of the whole part that is removed from a residual.
enum class Alignment {
  None,
  Offset,  ///< best translation, three components
  Rigid,   ///< best translation and rotation, six components
};

struct AlignmentOptions {
  Alignment alignment = Alignment::None;
  double truncation = 1e-6;  ///< eigenvalues below this fraction of the largest are omitted: a
                             ///< displacement is not determined if it moves the surface along its
                             ///< normals a thousand times less than another one
};

/// A residual after removal of a displacement.
struct AlignmentResult {
  Surface surface;  ///< with changed residuals of cut vertices; all else is unchanged
  kinematics::Deviation displacement =
      kinematics::Deviation::Zero();                ///< of the machined part, stated
                                                    ///< at `point`; mm and rad
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< mm, centroid of the cut area
  int rank = 0;                                     ///< number of components that were determined
  std::vector<std::string> undetermined;            ///< components that were omitted: "EX", "EA+EY"
};

/// Removes the displacement D = (d, theta) that best fits r = n . (d + theta x (p - point)) over
/// the cut vertices and samples within triangles, by least squares with their `weights`, truncated
/// as in the options (the shortest solution, with angles multiplied by the root-mean-square
/// distance from the point). The terms of second order are neglected: |theta|^2 L / 2 for a
/// rotation theta at a distance L from the point (100 urad, 100 mm: 0.5 nm) and t^2 / 2R for a
/// translation t along a curved surface (50 um on R 50 mm: 25 nm).
/// @throws std::invalid_argument if sizes differ, or a cut vertex has no finite residual
AlignmentResult aligned(const Surface& surface, const Design& design,
                        const AlignmentOptions& options);

/// A number of form; the name is that of ISO 1101 with the method of fitting.
struct FormNumber {
  std::string name;
  double value_mm;
};

/// Returns the form of the machined surface over its cut vertices, for a design that is a declared
/// surface:
///   rectangle, disc  flatness_lsq, flatness_minimum_zone
///   cylinder         cylindricity_lsq, roundness_lsc (the ring nearest to mid height, across the
///                    axis)
///   cone             conicity_lsq (at the nominal apex angle), roundness_lsc up to 45 degrees
///   sphere cap       sphericity_lsq
///   torus            torus_form_lsq
///   profile          profile_form_lsq
/// The `_lsq` numbers are max - min of the residual after removal of the best displacement of the
/// whole and the best uniform allowance (the size), by least squares weighted by vertex area. They
/// are of first order in the displacement t: t^2 / 2R is neglected (20 um on R 50 mm: 4 nm). The
/// minimum zone is the distance between the closest two parallel planes, computed as an upper bound
/// to within 1e-12 mm. A number for which too few vertices are cut is omitted.
/// @param design_m  the design in the frame of the primitive
/// @throws std::invalid_argument if sizes differ
std::vector<FormNumber> form(const Primitive& primitive, const Design& design_m,
                             const Surface& surface);

/// A circle fitted by least squares.
struct Circle {
  Eigen::Vector2d centre;  ///< mm
  double radius;           ///< mm
  double roundness;        ///< mm, largest minus smallest distance of the points from the centre
};

/// Returns the circle that minimises the sum of the squared distances of the points from it
/// (geometric distances, all points with the same weight).
/// @param points  (n x 2) mm, n >= 3
/// @throws std::invalid_argument for fewer than 3 points, numbers that are not finite, or points on
///         a line
Circle fit_circle(const Eigen::Matrix<double, Eigen::Dynamic, 2>& points);

}  // namespace abbe::cutting
