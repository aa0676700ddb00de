#pragma once

#include <memory>
#include <vector>

#include "cutting/surface/edge_profile.h"
#include "cutting/surface/outline.h"

/// Cutting tools: milling cutters of revolution by numbers or by an outline, convex or hollow (step
/// drills, T-slot cutters, dovetails on a shank, grooved form cutters), and the noses of turning
/// tools.
namespace abbe::cutting {

/// Maximum distance between an arc that bulges inwards and its chords, mm.
inline constexpr double max_chord_sag = 1e-3;

/// Returns the convex or hollow outline that joins the points by lines and arcs.
/// A hollow outline is exactly the union of its convex parts. Each part is a run between two
/// corners that bend inwards, extended along its end lines into the next run by half of the
/// available length, so that no face between two parts is exposed. An arc that bulges inwards is
/// replaced by as many chords as its sag requires: the tool is larger there, by at most
/// `max_chord_sag`.
/// @param points  from the tip, whose height is 0, upwards; heights must not fall, and above the
/// tip
///                no point may lie on the axis
/// @throws std::invalid_argument as outline_from_points, or if a height falls, or if the outline
///         turns back on itself, reaches the axis or requires more than 200 chords; the message
///         gives the point
ToolOutline tool_outline_from_points(const std::vector<OutlinePoint>& points);

/// Returns the maximum distance, mm, by which chords make the outline through these points larger
/// than its arcs that bulge inwards; 0 without such an arc.
double chord_sag(const std::vector<OutlinePoint>& points);

/// Returns the region swept by an outline that is displaced across the axis by up to `radial` and
/// along it by up to `axial`, mm, relative to its lowest tip: the hull for a convex outline; for a
/// hollow outline the region in which every height occurs at every angle.
/// @throws std::invalid_argument for a hollow outline with axial displacement, if a corner that
///         bends inwards is the end of an arc or if the groove beside it is lower than the
///         displacement
ToolOutline run_out_envelope(const ToolOutline& outline, double radial, double axial);

/// Returns the interior of a hollow outline at a margin, bounded by lines. Its distance from the
/// outline is at least the margin and at most twice the margin plus a five-hundredth of the height.
/// @param margin  mm; limited to half of the narrowest neck
/// @throws std::invalid_argument if nothing is left
InsetOutline inset_hollow(const ToolOutline& outline, double margin);

/// A milling cutter of revolution: a flat of radius (radius - corner_radius) at the tip, a torus
/// corner, a cylindrical flank up to `flank_length` above the tip. corner_radius = radius is a ball
/// end, 0 a flat end. Its frame t has the origin at the tip and z along the axis to the spindle. A
/// form cutter has an outline instead; it lies inside the flat end described by the numbers.
struct Cutter {
  double radius = 5.0;                              ///< mm, > 0
  double corner_radius = 5.0;                       ///< mm, 0 .. radius
  double flank_length = 20.0;                       ///< mm above the tip, >= corner_radius
  std::shared_ptr<const ToolOutline> outline = {};  ///< of a form cutter, else null
};

/// Returns the form cutter of an outline.
Cutter form_cutter(ToolOutline outline);

inline bool is_ball(const Cutter& cutter) {
  return !cutter.outline && cutter.corner_radius == cutter.radius;
}

inline bool is_hollow(const Cutter& cutter) { return cutter.outline && is_hollow(*cutter.outline); }

/// Returns the convex cutters, with the same tip, whose union is the cutter; for a convex cutter
/// only itself.
std::vector<Cutter> convex_parts(const Cutter& cutter);

/// Returns the radius of the shank above the flank, mm.
inline double shank_radius(const Cutter& cutter) {
  return cutter.outline ? top_radius(*cutter.outline) : cutter.radius;
}

/// Returns the height of the corner's centre above the tip, mm; for a ball, of the ball's centre.
inline double corner_height(const Cutter& cutter) {
  return cutter.outline ? corner_height(*cutter.outline) : cutter.corner_radius;
}

/// Returns how far the cutter reaches from its tip along the direction with component `rise` along
/// its axis and `across` >= 0 normal to it, mm times the direction's length.
inline double support(const Cutter& cutter, double rise, double across) {
  if (cutter.outline) return support(*cutter.outline, rise, across);
  if (rise > 0) return cutter.flank_length * rise + cutter.radius * across;
  return cutter.corner_radius * (1 + rise) + (cutter.radius - cutter.corner_radius) * across;
}

/// Throws std::invalid_argument if a number of the cutter is outside the range stated above.
void check_cutter(const Cutter& cutter);

/// A cutter whose whole surface is moved inwards; its tip is at the bottom of the result.
struct InsetCutter {
  Cutter cutter;
  double raised = 0.0;  ///< mm, height of its tip above that of the original
};
/// Returns a cutter with its surface moved inwards.
/// @param margin  mm; limited to a quarter of the radius and, for a form cutter, of the height; the
///                arcs of a form cutter become polygons (`inset_convex` in outline.h,
///                `inset_hollow` for a hollow one)
InsetCutter inset_cutter(const Cutter& cutter, double margin);

/// Harmonic form error of a nose: the edge protrudes by amplitude cos(order psi + phase).
struct NoseWave {
  int order = 1;
  double amplitude = 0.0;  ///< mm
  double phase = 0.0;      ///< rad
};

/// A turning tool: a circular edge of `radius` about the origin of frame t in its x-z plane (y = 0,
/// the rake plane). The tip of a turning tool is the centre of that circle. psi is measured from x
/// towards z. An insert has a profile of its edges instead, which contains that circle.
struct Nose {
  double radius = 0.249;                            ///< mm, > 0
  std::vector<NoseWave> waves;                      ///< empty: a perfect circle
  std::shared_ptr<const EdgeProfile> profile = {};  ///< of an insert, which has no waves; else null
};

/// Returns the nose of an insert.
Nose profile_nose(EdgeProfile profile);

/// Returns the cutter that represents a cutter with spindle run-out: the flat, and with it the
/// radius, grows by `radial`; the corner is unchanged. The tip lies `axial` below the tip of the
/// cutter at rest (make the tool longer by that), and the flank ends as far above. Its sweep
/// equals the union of the cutter's positions exactly for radial run-out alone if the flat is at
/// least `radial` wide, and for axial run-out alone. Otherwise it is the hull of that union, larger
/// in two respects:
/// - a flat narrower than `radial` leaves a hollow about the axis, r < radial - R(z), no deeper
///   than radial^2 / (corner radius + sqrt(corner radius^2 - radial^2)), 0.1 nm for 1 um on R 5 (if
///   `radial` reaches the corner radius: than the corner radius); any feed across the axis removes
///   it;
/// - radial and axial run-out locked in phase reach their maxima together at one angle only; the
///   union equals the hull if every height occurs at every angle.
/// For a convex form cutter the result is the hull of its displaced outline, with the same limits;
/// for a hollow one see `run_out_envelope`.
/// @param radial  mm, radius of the circle on which the axis runs, >= 0
/// @param axial   mm, amplitude up and down, >= 0
/// @throws std::invalid_argument naming the number, or as `run_out_envelope`
Cutter with_run_out(const Cutter& cutter, double radial, double axial);

}  // namespace abbe::cutting
