#pragma once

#include <string>
#include <vector>

#include "render/canvas.h"
#include "render/layout.h"
#include "render/residual_field.h"

/// Coloured residuals as scenes in space, and flags at their points.
namespace abbe::render {

/// Checks a field.
/// @throws std::invalid_argument if array sizes do not match, a triangle refers to a missing vertex
///         or a cut vertex has no finite deviation
void check_field(const Field& field);

/// A design coloured by values, with its rims, sharp edges and silhouette. Triangles with a corner
/// that is not cut are grey. The surface is shown smooth, without facets, also if the field has no
/// normals. Coloured faces are not lit, so that equal values have equal colours.
struct SurfaceScene {
  std::vector<Solid> solids;
  std::vector<Wire> wires;
};
/// @param values  (n) values in the unit of the scale; ignored where not cut
/// @param toward_eye  unit vector, for the silhouette
SurfaceScene surface_scene(const Field& field, const Eigen::VectorXd& values,
                           const ColourScale& scale, const Eigen::Vector3d& toward_eye);

/// Returns the lines of equal value on the triangles that are cut.
Wire isolines(const Field& field, const Eigen::VectorXd& values, const std::vector<double>& levels);

/// Numbers of vertices by status, and the range of the deviation.
struct VertexCounts {
  std::size_t cut = 0;
  std::size_t uncut = 0;
  std::size_t outside = 0;
  std::size_t gouged = 0;        ///< deeper than the band
  std::size_t beyond_scale = 0;  ///< cut, with a deviation beyond the ends of the scale
  double lowest_um = 0.0;        ///< least deviation of a cut vertex
  double highest_um = 0.0;       ///< largest deviation of a cut vertex

  std::size_t vertices() const { return cut + uncut + outside + gouged; }
  std::size_t judged() const { return cut + uncut + gouged; }
};
/// Count the vertices.
/// @param ends_um  ends of the scale
VertexCounts count_vertices(const Field& field, const Span& ends_um);
VertexCounts count_vertices(const Field& field, double range_um);

/// A marked point of a map with its label.
struct Flag {
  Eigen::Vector2d at;  ///< px
  std::string text;
  bool hidden = false;  ///< hidden by the surface; drawn as an open mark
};

/// Returns true if the surface hides one of its points in a view.
bool is_hidden(const View& view, const cutting::Design& design, const Eigen::Vector3d& point);

/// Returns rectangles for labels of given sizes. Each is near its point and within `area`; labels
/// do not overlap each other or a point if there is enough space.
std::vector<Rectangle> place_labels(const std::vector<Eigen::Vector2d>& points,
                                    const std::vector<Eigen::Vector2d>& sizes,
                                    const Rectangle& area, double em);

/// Draws marks at the flags, with leader lines to their labels within `area`.
void draw_flags(Canvas& canvas, const std::vector<Flag>& flags, const Rectangle& area,
                const TextStyle& style);

}  // namespace abbe::render
