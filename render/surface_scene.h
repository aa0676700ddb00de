#pragma once

#include <string>
#include <vector>

#include "render/canvas.h"
#include "render/layout.h"
#include "render/residual_field.h"

/// A coloured residual as a scene, alone or among others.
namespace abbe::render {

/// Checks a field. @throws std::invalid_argument if arrays do not match or a triangle refers to a
/// missing vertex
void check(const Field& field);

/// The design coloured by a value, grey where a corner of the triangle is not cut, with its rims,
/// sharp edges and silhouette; shown as a smooth surface without facets, also if the field has no
/// normals. Equal values have equal colours: coloured faces are not lit.
struct SurfaceScene {
  std::vector<Solid> solids;
  std::vector<Wire> wires;
};
/// @param values  (n) coloured values in the unit of the scale; ignored where not cut
/// @param toward  unit, to the eye: a light line is drawn along the silhouette
SurfaceScene surface_scene(const Field& field, const Eigen::VectorXd& values,
                           const ColourScale& scale, const Eigen::Vector3d& toward);

/// Returns lines of equal value across the triangles that are cut.
Wire isolines(const Field& field, const Eigen::VectorXd& values, const std::vector<double>& levels);

/// Number of vertices by status.
struct Tally {
  std::size_t cut = 0;
  std::size_t uncut = 0;
  std::size_t outside = 0;
  std::size_t gouged = 0;  ///< deeper than the band
  std::size_t beyond = 0;  ///< cut, and |deviation| beyond the range
  double lowest_um = 0.0;  ///< of the cut vertices
  double highest_um = 0.0;

  std::size_t vertices() const { return cut + uncut + outside + gouged; }
  std::size_t judged() const { return cut + uncut + gouged; }
};
/// Count the vertices. @param ends_um  of the scale
Tally tally(const Field& field, const Span& ends_um);
Tally tally(const Field& field, double range_um);

// Marked positions of a map with their labels.

struct Flag {
  Eigen::Vector2d at;  ///< px
  std::string text;
  bool hidden = false;  ///< the surface is in front of it: drawn as an open mark
};

/// Returns true if the surface, in this view, hides a point of it.
bool is_hidden(const View& view, const cutting::Design& design, const Eigen::Vector3d& point);

/// Returns positions for labels of these sizes: each near its point, within the room, over no other
/// label and no point, as far as possible.
std::vector<Rectangle> place_labels(const std::vector<Eigen::Vector2d>& points,
                                    const std::vector<Eigen::Vector2d>& sizes,
                                    const Rectangle& room, double em);

/// Draws marks at the positions, with leaders to their labels.
void draw_flags(Canvas& canvas, const std::vector<Flag>& flags, const Rectangle& room,
                const TextStyle& style);

}  // namespace abbe::render
