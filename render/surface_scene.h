#pragma once

#include <string>
#include <vector>

#include "render/canvas.h"
#include "render/field.h"

/// A coloured residual as it stands in a map, alone or among others.
namespace abbe::render {

/// @throws std::invalid_argument if arrays do not fit or a triangle names no vertex
void check(const Field& field);

/// The design coloured by deviation, grey where a corner of the triangle is not cut, with its rims
/// drawn; one surface and not its facets, also where the field has no normals.
struct SurfaceScene {
  std::vector<Solid> solids;
  std::vector<Wire> wires;
};
SurfaceScene surface_scene(const Field& field, double range_um);

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
Tally tally(const Field& field, double range_um);

struct ColourBar {
  double range_um = 1.0;
  bool low_end = false;   ///< an end in the colour of what lies below the scale
  bool high_end = false;  ///< and above it
};

/// A vertical colour bar with its ticks; it takes `box`, labels to the right of it go beyond.
void colour_bar(Canvas& canvas, const Rectangle& box, const ColourBar& bar, const TextStyle& style);

/// A lying colour bar, the ends of its scale written beside it: -range .. +range, or 0 .. range.
/// All of it is within `box`.
struct LyingBar {
  double range = 1.0;      ///< in the unit that is written
  std::string unit{};      ///< behind the upper end
  bool one_sided = false;  ///< from 0
  bool low_end = false;    ///< as of ColourBar
  bool high_end = false;
};
void lying_colour_bar(Canvas& canvas, const Rectangle& box, const LyingBar& bar,
                      const TextStyle& style);

}  // namespace abbe::render
