#pragma once

#include <array>
#include <optional>

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"

namespace abbe::cutting {

/// Bands in which residuals may lie (n x 2), mm: the lower and the upper limit of each vertex, the
/// limits themselves within; infinite where there is none. Without rows there is no tolerance.
using ToleranceBands = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

/// A judged surface against its tolerance. The shares are of the judged area that has limits, in
/// percent, and add up to 100: a gouge is under, and what was not cut is not within. In a triangle
/// across a border of bands the widest of its corners' limits hold.
struct Conformance {
  double in = 0.0, over = 0.0, under = 0.0, uncut = 0.0;
  int vertex = -1;       ///< furthest out of its band, of equal ones the first; -1: none is out,
                         ///< or a place within a triangle is further out
  int triangle = -1;     ///< with the place furthest out; -1: a vertex is further out, or none
  double excess = 0.0;   ///< mm, by which it is
  bool further = false;  ///< by more: it is a gouge that was not followed to its end
  int out_of_tolerance = 0;  ///< vertices, gouged ones too, and places within triangles
  int uncut_vertices = 0;

  bool passes() const { return out_of_tolerance == 0 && uncut_vertices == 0; }
};

/// A sampled residual of a map, mm: at a vertex, or (vertex -1) within a triangle.
struct SampleValue {
  int vertex = -1;
  int triangle = -1;
  double value = 0.0;
};

/// What the places of a map stand for in integrals over it, mm^2.
struct Weights {
  Eigen::VectorXd vertex;  ///< (n) 0 where not cut
  Eigen::VectorXd within;  ///< (m) of the place within each triangle, 0 where it has no residual;
                           ///< empty if none was sampled
};

/// Vertices that were chosen for a cut stand on its crests, and straight lines between them fill
/// the hollows: where the middle of a triangle has a residual it stands for three quarters of the
/// triangle's area and each corner for a twelfth, which is exact for a quadratic residual. A place
/// at random stands for all of its triangle, so that waves which the vertices do not resolve
/// average out in any mean. Elsewhere a corner stands for a third.
/// @throws std::invalid_argument if sizes differ
Weights weights(const Surface& surface, const Design& design);

/// What files call the residuals within triangles, um; empty without.
const char* within_values_name(Surface::Within within);

/// Barycentric coordinates of the place within triangle t that is sampled. Of `Random` they are
/// the same always, and even in area.
std::array<double, 3> place_within(Surface::Within within, Eigen::Index t);

/// Rows or values of vertices, interpolated there.
Eigen::Vector3d value_at_place_within(Surface::Within within, const Points& rows,
                                      const Triangles& triangles, Eigen::Index t);
double value_at_place_within(Surface::Within within, const Eigen::VectorXd& values,
                             const Triangles& triangles, Eigen::Index t);

/// What a residual map comes to. Vertices that are uncut, gouged beyond the band or outside the
/// judged region are left out of every number and counted; only the shares in and out of tolerance
/// know them. A number for which no vertex is left (or no area, for the weighted ones) is empty.
/// All of them are of the same samples: vertices and, where the map has them, the places within
/// triangles; counts are those of vertices.
/// Sums are compensated and run in the order of the vertices, so they give the same bits always;
/// the rounding of a sum is below 4e-16 of the sum of magnitudes.
struct Statistics {
  std::optional<double> pv;       ///< mm, max - min
  std::optional<double> rms;      ///< mm, weighted by area
  std::optional<double> mean;     ///< mm, weighted by area
  std::optional<double> std_dev;  ///< mm, about the mean, weighted by area
  std::optional<double> min;      ///< mm
  std::optional<double> max;      ///< mm
  std::optional<double> p95_abs;  ///< mm, least magnitude of a place such that those of at most it
                                  ///< are 95 % of the cut area
  std::optional<SampleValue> lowest, highest;  ///< where min and max are, of equal ones the first,
                                               ///< vertices before places within triangles
  std::optional<Conformance> conformance;      ///< empty if no tolerance was given
  int vertices = 0;
  int cut_vertices = 0;
  int uncut_vertices = 0;        ///< judged, but nothing was removed
  int outside_vertices = 0;      ///< not judged
  int gouged_vertices = 0;       ///< judged, and removed deeper than the band
  std::optional<Gouge> deepest;  ///< of those, of equal ones the first
};

/// @throws std::invalid_argument if sizes differ, or a vertex called cut has no finite residual
Statistics statistics(const Surface& surface, const Design& design,
                      const ToleranceBands& tolerance = {});

/// The map at its vertices alone.
Surface at_vertices(Surface surface);

/// What a vertex is in a difference of two maps: outside if it is outside in either, else gouged,
/// else uncut, else cut.
VertexStatus worse(VertexStatus a, VertexStatus b);

/// First map minus second, vertex by vertex, where both are cut; else its status is the worse of
/// the two. Instants, lines and gouges are those of the first, gouges of the second where only that
/// has one.
/// @throws std::invalid_argument if sizes differ
Surface minus(const Surface& a, const Surface& b);

}  // namespace abbe::cutting
