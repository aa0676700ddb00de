#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Core>

/// The least value of a function of time that is convex but for a bounded dip, by branch and bound.
namespace abbe::cutting {

/// A value with its slope, and how far below zero its curvature may fall nearby.
struct Sample {
  double t;
  bool defined;  ///< the function is +infinity elsewhere
  double value;
  double slope;
  double dip;               ///< curvature >= -dip; 0 where the function is convex
  double fade;              ///< dip holds for times well below 1 / fade
  Eigen::Vector3d outward;  ///< normal of the cutter, for a `floor`
  double facing;            ///< -outward * normal of the ray
  double doubt = 0;         ///< the value may be too large by so much, from rounding

  double dip_over(double w) const { return dip / ((1 - fade * w) * (1 - fade * w)); }
};

inline Sample undefined_at(double t) {
  return {t, false, std::numeric_limits<double>::infinity(), 0, 0, 0, Eigen::Vector3d::Zero(), 1};
}

struct Goal {
  double tolerance;
  /// Larger values are of no interest.
  double limit = std::numeric_limits<double>::infinity();
  /// A value as small as this ends the search.
  double enough = -std::numeric_limits<double>::infinity();
  int max_samples = 5000;  ///< it needs 3 to 12; hundreds for a disc of no height that a ray grazes
};

struct Piece {
  Sample a, b;
  int depth;
};

/// What a piece may still hide: a lower bound, and where it is reached.
struct Promise {
  double value;
  double t;
};

/// A straight line over a piece, by its values at the ends.
struct Line {
  double at_a, at_b;
};

/// Where a function above two lines may be least over a piece.
inline Promise least_above(const Piece& piece, const Line& first, const Line& second) {
  const auto higher = [&](double x) {
    return std::max(first.at_a + x * (first.at_b - first.at_a),
                    second.at_a + x * (second.at_b - second.at_a));
  };
  const double apart_a = first.at_a - second.at_a;
  const double apart_b = first.at_b - second.at_b;
  double x = higher(0.0) <= higher(1.0) ? 0.0 : 1.0;
  if (apart_a * apart_b < 0) {
    const double crossing = apart_a / (apart_a - apart_b);
    if (higher(crossing) < higher(x)) x = crossing;
  }
  const double width = piece.b.t - piece.a.t;
  return {higher(x), piece.a.t + (x == 0.0 || x == 1.0 ? 0.5 : x) * width};
}

/// f + dip (t - a)^2 / 2 is convex, so it lies above its tangents at both ends. Where the dip
/// cannot be trusted over the piece, `floor(piece)` is the promise.
template <class Floor>
Promise promise(const Piece& piece, double tolerance, const Floor& floor) {
  const auto& [a, b, depth] = piece;
  const double w = b.t - a.t;
  const double middle = a.t + 0.5 * w;
  const bool trusted = std::max(a.fade, b.fade) * w < 0.5;
  if (!a.defined || !b.defined) {
    if (!trusted) return floor(piece);
    const Sample& end = a.defined ? a : b;
    const double far =
        end.value + (a.defined ? 1 : -1) * end.slope * w - 0.5 * end.dip_over(w) * w * w;
    return {std::min(end.value, far) - end.doubt, middle};
  }
  if (!trusted) return floor(piece);
  const double dip = std::max(a.dip_over(w), b.dip_over(w));
  const double value_a = a.value - a.doubt;
  const double value_b = b.value - b.doubt + 0.5 * dip * w * w;
  const double slope_b = b.slope + dip * w;
  const double below_a = value_b - value_a - a.slope * w;
  const double below_b = value_a - value_b + slope_b * w;
  const double slack = tolerance + a.doubt + b.doubt;
  if (below_a < -slack || below_b < -slack) return floor(piece);
  // What rounding does to the lower end of a slope is not found by more samples.
  if (a.slope >= 0.5 * dip * w) return {a.value, a.t};
  if (b.slope <= -0.5 * dip * w) return {b.value, b.t};
  const double turn = slope_b - a.slope;
  const double x = turn > 0 ? std::clamp(below_b / turn, 0.0, w) : 0.5 * w;
  const double inner = value_a + a.slope * x - 0.5 * dip * x * x;
  return {std::min({value_a, b.value - b.doubt, inner}), a.t + x};
}

inline double next_sample(const Piece& piece, const Promise& low) {
  const auto& [a, b, depth] = piece;
  const double w = b.t - a.t;
  if (!a.defined || !b.defined || low.value == -std::numeric_limits<double>::infinity())
    return low.t;
  if (a.slope < 0 && b.slope > 0) {
    const double secant = a.t + w * a.slope / (a.slope - b.slope);
    // The tangents of a parabola meet in the middle, and the secant finds its lowest point; the
    // tangents of a kink meet at it. Halving now and then serves what is neither.
    if (depth % 4 == 3) return a.t + 0.5 * w;
    const bool smooth = std::abs(low.t - a.t - 0.5 * w) < 0.1 * w;
    return std::clamp(smooth ? secant : low.t, a.t + 1e-4 * w, b.t - 1e-4 * w);
  }
  // Next to a minimum: what must be looked at grows with the distance from it.
  return a.value <= b.value ? a.t + w / 16 : b.t - w / 16;
}

/// Smallest value of f between two samples, by branch and bound.
template <class Function, class Floor>
Sample minimum(const Function& f, const Floor& floor, const Sample& first, const Sample& last,
               const Goal& goal) {
  Sample best = last.defined && (!first.defined || last.value < first.value) ? last : first;
  const auto settled = [&](const Promise& low) {
    return low.value >= std::min(best.value - goal.tolerance, goal.limit);
  };
  const Piece whole{first, last, 0};
  if (best.value <= goal.enough || settled(promise(whole, goal.tolerance, floor))) return best;
  std::array<Piece, 64> open;
  std::size_t count = 0;
  open[count++] = whole;
  for (int samples = 0; count > 0 && samples < goal.max_samples && best.value > goal.enough;) {
    const Piece piece = open[--count];
    const Promise low = promise(piece, goal.tolerance, floor);
    if (settled(low)) continue;
    if (piece.b.t - piece.a.t < 1e-13 || count + 2 > open.size()) continue;
    const Sample c = f(next_sample(piece, low));
    ++samples;
    if (c.defined && c.value < best.value) best = c;
    if (c.defined || piece.a.defined) open[count++] = {piece.a, c, piece.depth + 1};
    if (c.defined || piece.b.defined) open[count++] = {c, piece.b, piece.depth + 1};
  }
  return best;
}

}  // namespace abbe::cutting
