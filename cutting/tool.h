#pragma once

#include <memory>
#include <vector>

#include "cutting/edge_profile.h"
#include "cutting/outline.h"

namespace abbe::cutting {

/// Milling cutter of revolution: a flat of radius (radius - corner_radius) at the tip, a
/// torus corner, a cylindrical flank up to `flank_length` above the tip. corner_radius = radius is
/// a ball end, 0 a flat end. Its frame t has the origin at the tip and z along the axis to the
/// spindle. A form cutter has an outline instead, inside of the flat end that the numbers then are.
struct Cutter {
  double radius = 5.0;                              ///< mm, > 0
  double corner_radius = 5.0;                       ///< mm, 0 .. radius
  double flank_length = 20.0;                       ///< mm above the tip, >= corner_radius
  std::shared_ptr<const ToolOutline> outline = {};  ///< of a form cutter
};

Cutter form_cutter(ToolOutline outline);

inline bool is_ball(const Cutter& cutter) {
  return !cutter.outline && cutter.corner_radius == cutter.radius;
}

inline bool is_hollow(const Cutter& cutter) { return cutter.outline && is_hollow(*cutter.outline); }

/// The convex cutters that together are this one, by the same tip; itself if it is convex.
std::vector<Cutter> convex_parts(const Cutter& cutter);

/// mm, of what goes on above the flank.
inline double shank_radius(const Cutter& cutter) {
  return cutter.outline ? top_radius(*cutter.outline) : cutter.radius;
}

/// mm above the tip, of the middle of the corner: of a ball its centre.
inline double corner_height(const Cutter& cutter) {
  return cutter.outline ? corner_height(*cutter.outline) : cutter.corner_radius;
}

/// How far it reaches from its tip along a direction that rises by `rise` along its axis and goes
/// by `across` across it.
inline double support(const Cutter& cutter, double rise, double across) {
  if (cutter.outline) return support(*cutter.outline, rise, across);
  if (rise > 0) return cutter.flank_length * rise + cutter.radius * across;
  return cutter.corner_radius * (1 + rise) + (cutter.radius - cutter.corner_radius) * across;
}

/// @throws std::invalid_argument for a cutter out of those ranges
void check_cutter(const Cutter& cutter);

/// A cutter with all of its surface moved inwards, its tip staying where the bottom then is.
struct ShrunkCutter {
  Cutter cutter;
  double raised = 0.0;  ///< mm, of the tip
};
/// @param margin  mm; a quarter of the radius at most is taken, and of the height of a form cutter,
///                whose arcs then are polygons (outline.h, of a hollow one hollow_outline.h)
ShrunkCutter shrunk(const Cutter& cutter, double margin);

/// One wave on the nose of a turning tool: the edge stands out by amplitude cos(order psi + phase).
struct NoseWave {
  int order = 1;
  double amplitude = 0.0;  ///< mm
  double phase = 0.0;      ///< rad
};

/// Turning tool: a circular edge of `radius` about the origin of frame t in its x-z plane (y = 0,
/// the rake plane). The tip of a turning tool is the centre of that circle. psi counts from x to z.
/// An insert has the profile of its edges about that circle instead.
struct Nose {
  double radius = 0.249;                            ///< mm, > 0
  std::vector<NoseWave> waves;                      ///< none: a perfect circle
  std::shared_ptr<const EdgeProfile> profile = {};  ///< of an insert, which has no waves
};

Nose nose_of(EdgeProfile profile);

}  // namespace abbe::cutting
