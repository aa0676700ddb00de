#pragma once

#include <array>
#include <optional>

#include "cutting/part/mesh.h"
#include "cutting/surface/surface.h"

/// Statistics of a residual map, its conformance to tolerances, and differences of maps.
namespace abbe::cutting {

/// Permitted residuals (n x 2), mm: lower and upper limit of each vertex, both included; infinite
/// if there is no limit. No rows: no tolerance.
using ToleranceBands = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;

/// Conformance of a judged surface to its tolerance. The fractions refer to the judged area that
/// has limits, in per cent, and add up to 100; a gouge counts as under. In a triangle whose corners
/// have different limits, the widest limits apply.
struct Conformance {
  double in = 0.0, over = 0.0, under = 0.0, uncut = 0.0;
  int vertex = -1;    ///< vertex with the largest excess, the first if several are equal; -1: none,
                      ///< or a sample within a triangle has the largest excess
  int triangle = -1;  ///< triangle of the sample with the largest excess; -1: none, or a vertex
                      ///< has the largest excess
  double excess = 0.0;  ///< mm, the largest excess
  bool is_lower_bound =
      false;  ///< the excess is a lower bound: a gouge that was not followed to its end
  int out_of_tolerance_count = 0;  ///< number of vertices, including gouged ones, and samples
                                   ///< within triangles
  int uncut_vertices = 0;

  bool passes() const { return out_of_tolerance_count == 0 && uncut_vertices == 0; }
};

/// A sampled residual of a map, mm: at a vertex, or (vertex -1) within a triangle.
struct SampleValue {
  int vertex = -1;
  int triangle = -1;
  double value = 0.0;
};

/// The areas that the samples of a map represent in integrals over the surface, mm^2.
struct Weights {
  Eigen::VectorXd vertex;  ///< (n) 0 if not cut
  Eigen::VectorXd within;  ///< (m) of the sample within each triangle, 0 if it has no residual;
                           ///< empty if none was sampled
};

/// Returns the weights of a map. Vertices that refinement has added are on the crests of the cut,
/// and straight lines between them fill the hollows. Therefore, if the middle of a triangle has a
/// residual, it represents three quarters of the triangle's area and each corner a twelfth, which
/// is exact for a quadratic residual. A random sample represents the whole triangle, so that waves
/// that the vertices do not resolve average out in any mean. Otherwise each corner represents a
/// third of the triangle.
/// @throws std::invalid_argument if sizes differ
Weights weights(const Surface& surface, const Design& design);

/// Returns the name under which files store the residuals within triangles (um); empty if the map
/// has none.
const char* sample_values_name(Surface::InteriorSample within);

/// Returns the barycentric coordinates of the sample within triangle t. For `Random` they are
/// reproducible and uniform in area.
std::array<double, 3> sample_barycentric(Surface::InteriorSample within, Eigen::Index t);

/// Return rows or values of the vertices, interpolated at the sample of triangle t.
Eigen::Vector3d value_at_sample(Surface::InteriorSample within, const Points& rows,
                                const Triangles& triangles, Eigen::Index t);
double value_at_sample(Surface::InteriorSample within, const Eigen::VectorXd& values,
                       const Triangles& triangles, Eigen::Index t);

/// Statistics of a residual map. Vertices that are uncut, gouged beyond the band or outside the
/// judged region are counted but excluded from all numbers except the conformance. A number that
/// has no vertices (or, if weighted, no area) is empty. All numbers use the same samples: vertices
/// and, if the map has them, the samples within triangles; counts are those of vertices. Sums are
/// compensated and run in the order of the vertices, so the bits are reproducible; the rounding of
/// a sum is below 4e-16 of the sum of magnitudes.
struct Statistics {
  std::optional<double> pv;       ///< mm, max - min
  std::optional<double> rms;      ///< mm, weighted by area
  std::optional<double> mean;     ///< mm, weighted by area
  std::optional<double> std_dev;  ///< mm, about the mean, weighted by area
  std::optional<double> min;      ///< mm
  std::optional<double> max;      ///< mm
  std::optional<double> p95_abs;  ///< mm, magnitude that is not exceeded on 95 % of the cut area
  std::optional<SampleValue> lowest, highest;  ///< samples of min and max, the first if several are
                                               ///< equal, vertices before samples within triangles
  std::optional<Conformance> conformance;      ///< empty if no tolerance was given
  int vertices = 0;
  int cut_vertices = 0;
  int uncut_vertices = 0;        ///< judged, no material removed
  int outside_vertices = 0;      ///< not judged
  int gouged_vertices = 0;       ///< judged, material removed deeper than the band
  std::optional<Gouge> deepest;  ///< deepest gouge, the first if several are equal
};

/// Returns the statistics of a map.
/// @throws std::invalid_argument if sizes differ, or a cut vertex has no finite residual
Statistics statistics(const Surface& surface, const Design& design,
                      const ToleranceBands& tolerance = {});

/// Returns the map without the samples within triangles.
Surface without_triangle_samples(Surface surface);

/// Returns the status of a vertex in a difference of two maps: outside if it is outside in either
/// map, else gouged, else uncut, else cut.
VertexStatus worse_status(VertexStatus a, VertexStatus b);

/// Returns the first map minus the second at the vertices that are cut in both; elsewhere the
/// status is the worse of the two. Cut times, lines and gouges are those of the first map; a gouge
/// of the second map is included where the first has none.
/// @throws std::invalid_argument if sizes differ
Surface minus(const Surface& a, const Surface& b);

}  // namespace abbe::cutting
