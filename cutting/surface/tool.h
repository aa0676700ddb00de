#pragma once

#include <memory>
#include <vector>

#include "cutting/surface/edge_profile.h"
#include "cutting/surface/outline.h"

/// Hollow tools of revolution: step drills, T-slot cutters, dovetails on a shank, grooved form
/// cutters.
namespace abbe::cutting {

/// mm, the largest distance between an arc that bulges inwards and its chords.
inline constexpr double max_chord_sag = 1e-3;

/// The outline through points, convex or hollow, of lines and arcs. Its heights do not fall from
/// point to point, and it stays off the axis above its tip. A hollow one is exactly the union of
/// its parts, one more than it has corners that bend inwards: the runs between those, each going on
/// along its own line into the next one by half of what that has room for, so that no face between
/// two of them shows. An arc that bulges inwards is as many chords as its sag takes: the tool is
/// larger there, by `max_chord_sag` at most.
/// @param points  from the tip, whose height is 0, upwards
/// @throws std::invalid_argument as outline_through, or for what falls, turns back on itself, comes
///         to the axis or takes more than 200 chords, with the point
ToolOutline profile_from_points(const std::vector<OutlinePoint>& points);

/// mm, by which the outline through these points is larger than its arcs that bulge inwards; 0
/// without one.
double chord_sag(const std::vector<OutlinePoint>& points);

/// What an outline sweeps that is moved across the axis by up to `radial` and along it by up to
/// `axial`, mm, from where the tip then is at the lowest: of a convex one its hull, of a hollow one
/// as if every height came up at every angle.
/// @throws std::invalid_argument for a hollow one that is moved along the axis, where a corner that
///         bends inwards is the end of an arc, or the groove beside it is lower than that
ToolOutline widened(const ToolOutline& outline, double radial, double axial);

/// What lies inside of a hollow outline by a margin and more, as lines: nowhere less than the
/// margin, nor more than twice that and a five-hundredth of the height.
/// @param margin  mm; half of the narrowest neck at most is taken
/// @throws std::invalid_argument where nothing is left
InsetOutline inset_hollow(const ToolOutline& outline, double margin);

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
struct InsetCutter {
  Cutter cutter;
  double raised = 0.0;  ///< mm, of the tip
};
/// @param margin  mm; a quarter of the radius at most is taken, and of the height of a form cutter,
///                whose arcs then are polygons (outline.h, of a hollow one hollow_outline.h)
InsetCutter shrunk(const Cutter& cutter, double margin);

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

/// The cutter that stands for one whose spindle runs out: the flat grows by `radial` and with it
/// the radius, the corner stays; its tip lies `axial` below the tip of the cutter at rest (make the
/// tool longer by that), and the flank ends as much above. Its sweep is the union of the cutter's
/// places exactly for radial run-out alone where the flat is at least `radial` wide, and for axial
/// alone. Otherwise it is that union's hull, larger in two ways:
/// - a flat narrower than `radial` leaves a hollow about the axis, r < radial - R(z), no deeper
///   than radial^2 / (corner radius + sqrt(corner radius^2 - radial^2)), 0.1 nm for 1 um on R 5
///   (if `radial` reaches the corner radius: than that); any feed across the axis takes it out;
/// - radial and axial run-out locked in phase reach their largest at one angle only; the union is
///   this one if every height comes up at every angle.
/// @param radial  mm, radius of the circle on which the axis runs, >= 0
/// @param axial   mm, amplitude up and down, >= 0
/// Of a convex form cutter it is the hull of its outline so moved, by the same reasons; of a hollow
/// one see `widened` (hollow_outline.h).
/// @throws std::invalid_argument naming the number, or as `widened`
Cutter with_run_out(const Cutter& cutter, double radial, double axial);

}  // namespace abbe::cutting
