#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"

/// The first point at which one ray enters a cutter during one move, and the pose of the cutter
/// within the move.
namespace abbe::cutting {

/// A line segment through the surface: the points `point + s * normal` with s from -band (inside
/// the part) to band (outside).
struct Ray {
  Eigen::Vector3d point;   ///< mm
  Eigen::Vector3d normal;  ///< unit, outward
  double band = 2.0;       ///< mm
};

/// A move between two samples, or the part of it between the instants `from` and `to` (0 .. 1). At
/// instant t the tip is `tip + t * step` and the axis is
/// `axis * cos(t * angle) + side * sin(t * angle)`.
struct Move {
  Eigen::Vector3d tip;   ///< mm
  Eigen::Vector3d step;  ///< mm
  Eigen::Vector3d axis;  ///< unit
  Eigen::Vector3d side;  ///< unit, normal to `axis`, the direction towards which the axis turns;
                         ///< arbitrary if angle is 0
  double angle = 0.0;    ///< rad, below pi
  double from = 0.0;
  double to = 1.0;
};

/// Returns the move from sample `index` to the next sample; from the last sample, a move that
/// stands still.
Move move_after(const CutterMotion& motion, int index);

/// The first point of a ray inside the swept cutter, and the instant at which it is removed.
struct Entry {
  double s = 0.0;  ///< mm along the normal; -band if the ray starts in removed material
  double t = 0.0;  ///< instant within the whole move, 0 .. 1
};

/// Returns the first s in [-band, limit] at which the ray lies in the swept cutter, or nothing if
/// there is none.
/// The value does not depend on `limit`, which only ends the search early. The error is never below
/// -1e-12 mm (rounding at 1 m), nor above 2e-8 mm if the axis turns and 1e-9 mm if it does not. A
/// touch of less than 1e-10 mm may be missed.
/// If the axis turns, a ray may touch the cutter several times within the same part of a move. A
/// touch no deeper than (cutter radius + flank length) * angle^2 / 2 may then be missed, so parts
/// should be short (0.05 rad).
std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit);

/// Overload for every cutter except a ball, and for a ball where the closed form is undecided. The
/// search starts from `fraction` and `min_s`, so the last bits of the value depend on both.
/// @param fraction  estimate of the instant of entry, as a fraction of the move's range `from` ..
///                  `to` (`EntryBounds::fraction` in entry_bounds.h); any value 0 .. 1 is valid
/// @param min_s     lower bound of the entry, mm (`EntryBounds::min_s`), or any s before which the
///                  ray does not enter
std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit, float fraction, float min_s);

/// Returns the s at which the ray meets the cutter in its pose at instant t (0 .. 1 of the whole
/// move); -band if the ray starts inside it. The result is bit-identical to what `first_entry`
/// computes at this instant with the same `min_s`.
std::optional<double> instant_entry(const Cutter& cutter, const Move& move, double t,
                                    const Ray& ray, float min_s);

/// Returns the depth of a point below the skin of the cutter at instant t, mm; negative outside,
/// where the distance may be underestimated near sharp edges.
double depth(const Cutter& cutter, const Move& move, double t, const Eigen::Vector3d& point);

/// A search skips a move only if the smallest s at which the move could remove the ray exceeds the
/// first entry so far by more than this margin. The margin is larger than the error of first_entry,
/// so the result does not depend on the order of the search.
inline constexpr double entry_margin = 5e-8;  // mm

/// The tip of a cutter (mm) and the unit direction of its axis.
struct CutterPose {
  Eigen::Vector3d tip;
  Eigen::Vector3d axis;
};

/// Returns the instant of the whole move at a fraction (0 .. 1) of its range `from` .. `to`.
inline double instant(const Move& move, double fraction) {
  return move.from + fraction * (move.to - move.from);
}

/// Returns the pose of the cutter at instant t (0 .. 1) of a move.
inline CutterPose cutter_pose(const Move& move, double t) {
  const double x = move.angle * t;
  if (x == 0.0) return {move.tip + t * move.step, move.axis};
  double sine = 0.0;
  double cosine = 1.0;
  if (std::abs(x) < 0.06) {  // the truncated series is exact to rounding here
    const double y = x * x;
    sine = x * (1 - y / 6 * (1 - y / 20 * (1 - y / 42 * (1 - y / 72))));
    cosine = 1 - y / 2 * (1 - y / 12 * (1 - y / 30 * (1 - y / 56 * (1 - y / 90))));
  } else {
    sine = std::sin(x);
    cosine = std::cos(x);
  }
  return {move.tip + t * move.step, cosine * move.axis + sine * move.side};
}

}  // namespace abbe::cutting
