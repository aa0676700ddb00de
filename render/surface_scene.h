#pragma once

#include <string>
#include <vector>

#include "render/canvas.h"
#include "render/layout.h"
#include "render/residual_field.h"

/// A coloured residual as it stands in a map, alone or among others.
namespace abbe::render {

/// @throws std::invalid_argument if arrays do not fit or a triangle names no vertex
void check(const Field& field);

/// The design coloured by a value, grey where a corner of the triangle is not cut, with its rims,
/// sharp edges and outline drawn; one surface and not its facets, also where the field has no
/// normals. Equal values have equal colours: no light falls on what is coloured.
struct SurfaceScene {
  std::vector<Solid> solids;
  std::vector<Wire> wires;
};
/// @param values  (n) what is coloured, in the unit of the scale; where not cut it does not matter
/// @param toward  unit, to the eye: where the surface turns away a light line is drawn
SurfaceScene surface_scene(const Field& field, const Eigen::VectorXd& values,
                           const ColourScale& scale, const Eigen::Vector3d& toward);

/// Lines of equal value across the triangles that are cut.
Wire isolines(const Field& field, const Eigen::VectorXd& values, const std::vector<double>& levels);

/// How many vertices are what.
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
/// @param ends  of the scale
Tally tally(const Field& field, const Span& ends_um);
Tally tally(const Field& field, double range_um);

// Marked places of a map with what is to be read there.

struct Flag {
  Eigen::Vector2d at;  ///< px
  std::string text;
  bool hidden = false;  ///< the surface lies before it: an open mark
};

/// Whether the surface, seen in this view, lies before a point of it.
bool is_hidden(const View& view, const cutting::Design& design, const Eigen::Vector3d& point);

/// Where labels of these sizes stand: each near its point, within the room, over no other label
/// and no point, as long as there is such a place.
std::vector<Rectangle> place_labels(const std::vector<Eigen::Vector2d>& points,
                                    const std::vector<Eigen::Vector2d>& sizes,
                                    const Rectangle& room, double em);

/// Marks the places, with leaders to their labels.
void draw_flags(Canvas& canvas, const std::vector<Flag>& flags, const Rectangle& room,
                const TextStyle& style);

}  // namespace abbe::render
