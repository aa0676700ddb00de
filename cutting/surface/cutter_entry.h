#pragma once

#include <cmath>
#include <optional>

#include <Eigen/Core>

#include "cutting/surface/surface.h"
#include "cutting/surface/tool.h"

/// One ray against one move of a milling cutter.
namespace abbe::cutting {

/// Points point + s normal, s from -band to band, walked from inside the part.
struct Ray {
  Eigen::Vector3d point;   ///< mm
  Eigen::Vector3d normal;  ///< unit, outward
  double band = 2.0;       ///< mm
};

/// A move between two samples, or the part of it between the instants `from` and `to` (0 .. 1): the
/// tip is at tip + t step, the axis at axis cos(t angle) + side sin(t angle).
struct Move {
  Eigen::Vector3d tip;
  Eigen::Vector3d step;
  Eigen::Vector3d axis;
  Eigen::Vector3d side;  ///< unit and across `axis`, towards which it turns; any if angle is 0
  double angle = 0.0;    ///< rad, below pi
  double from = 0.0;
  double to = 1.0;
};

/// The move from sample `index` to the next (to itself if there is none).
Move move_after(const CutterMotion& motion, int index);

/// Where and when a ray meets the swept cutter first.
struct Entry {
  double s = 0.0;  ///< mm along the normal; -band if the ray starts in removed material
  double t = 0.0;  ///< instant within the whole move, 0 .. 1
};

/// First s in [-band, limit] at which the ray lies in the swept cutter.
/// The value does not depend on `limit`, which only lets the search end early. It is never below
/// the true one by more than rounding (1e-12 mm at 1 m), nor above it by more than 2e-8 mm where
/// the axis turns and 1e-9 mm where it does not. A ray that touches the sweep by less than 1e-10 mm
/// may miss it.
/// Where the axis turns, a ray may touch the cutter, leave it and touch it again within the same
/// part of a move. Of several such touches, one no deeper than (R + flank length) angle^2 / 2 may
/// go unseen: keep parts short (0.05 rad).
std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit);

/// The same of any cutter but a ball, or of a ball where the closed form does not decide.
/// The search starts there, so the last bits of the value depend on both.
/// @param part   of the move's `EntryBounds`, or any
/// @param least  of the same, or any place before which the ray does not enter
std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit, float part, float least);

/// Where the ray meets the cutter as it stands at instant t (0 .. 1 of the whole move); -band if it
/// starts there. With the `least` of a search, what that search finds at this instant.
std::optional<double> standing_entry(const Cutter& cutter, const Move& move, double t,
                                     const Ray& ray, float least);

/// mm, of a place below the skin of the cutter as it stands at instant t, or less beside sharp
/// edges; negative outside.
double depth(const Cutter& cutter, const Move& move, double t, const Eigen::Vector3d& place);

/// How far inside the bound of a search a move has to be ruled out, so that the result does not
/// depend on the order of the search: more than the error of first_entry.
inline constexpr double entry_margin = 5e-8;  // mm

// Where a cutter stands within a move; inline, for it is asked for every sample of a search.

/// The tip of a cutter and the direction of its axis.
struct Position {
  Eigen::Vector3d tip;
  Eigen::Vector3d axis;
};

/// The instant of the whole move at a part 0 .. 1 of the way `from` .. `to`.
inline double instant(const Move& move, double part) {
  return move.from + part * (move.to - move.from);
}

/// Of a move at its instant t, 0 .. 1.
inline Position position(const Move& move, double t) {
  const double x = move.angle * t;
  if (x == 0.0) return {move.tip + t * move.step, move.axis};
  double sine = 0.0;
  double cosine = 1.0;
  if (std::abs(x) < 0.06) {  // the series is exact to rounding here
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
