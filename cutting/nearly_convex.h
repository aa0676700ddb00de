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

/// Pieces that may hold less than the best sample so far.
template <class Function, class Floor>
class BranchAndBound {
 public:
  BranchAndBound(const Function& f, const Floor& floor, const Goal& goal, const Sample& best)
      : f_(f), floor_(floor), goal_(goal), best_(best) {}

  bool is_over() const { return best_.value <= goal_.enough; }
  void take(const Sample& sample) {
    if (sample.defined && sample.value < best_.value) best_ = sample;
  }
  Sample sample(double t) {
    const Sample sample = f_(t);
    take(sample);
    return sample;
  }
  bool is_settled(const Piece& piece) const { return is_settled(piece, promised(piece)); }
  /// The same without the cost of a floor.
  bool is_plainly_settled(const Piece& piece) const { return !is_small(promised(piece).value); }
  void add(const Piece& piece) { open_[count_++] = piece; }

  Sample least() {
    for (int samples = 0; count_ > 0 && samples < goal_.max_samples && !is_over();) {
      const Piece piece = open_[--count_];
      const Promise low = promised(piece);
      if (is_settled(piece, low)) continue;
      if (piece.b.t - piece.a.t < 1e-13 || count_ + 2 > open_.size()) continue;
      const Sample c = sample(next_sample(piece, low));
      ++samples;
      if (c.defined || piece.a.defined) add({piece.a, c, piece.depth + 1});
      if (c.defined || piece.b.defined) add({c, piece.b, piece.depth + 1});
    }
    return best_;
  }

 private:
  Promise promised(const Piece& piece) const { return promise(piece, goal_.tolerance, floor_); }
  bool is_small(double value) const {
    return !(value >= std::min(best_.value - goal_.tolerance, goal_.limit));
  }
  /// Planes bend less over a piece than the dip, but cost more.
  bool is_settled(const Piece& piece, const Promise& low) const {
    if (!is_small(low.value)) return true;
    return std::max(piece.a.dip, piece.b.dip) > 0 && !is_small(floor_(piece).value);
  }

  const Function& f_;
  const Floor& floor_;
  const Goal& goal_;
  Sample best_;
  std::array<Piece, 64> open_;
  std::size_t count_ = 0;
};

/// Smallest value of f between two samples.
template <class Function, class Floor>
Sample minimum(const Function& f, const Floor& floor, const Sample& first, const Sample& last,
               const Goal& goal) {
  const bool last_is_less = last.defined && (!first.defined || last.value < first.value);
  BranchAndBound search(f, floor, goal, last_is_less ? last : first);
  search.add({first, last, 0});
  return search.least();
}

/// The same from `from` to `to` where f is known to be least near `about`; undefined if it is
/// undefined there. Three samples mostly: there and on either side.
/// @param beyond  of two times and a goal: the least value between them, for what lies on the other
///                side of a gap in f and is not ruled out
template <class Function, class Floor, class Beyond>
Sample minimum_about(const Function& f, const Floor& floor, const Beyond& beyond, double from,
                     double about, double to, const Goal& goal) {
  const Sample c = f(about);
  BranchAndBound search(f, floor, goal, c);
  if (!c.defined || search.is_over()) return c;
  const auto piece = [](const Sample& one, const Sample& other) {
    return one.t < other.t ? Piece{one, other, 0} : Piece{other, one, 0};
  };
  for (const double end : {from, to}) {
    if (search.is_over()) break;
    if (end == about || search.is_plainly_settled(piece(c, undefined_at(end)))) continue;
    const double sense = end < about ? -1.0 : 1.0;
    double aside = (std::abs(c.slope) < c.dip ? 4e-3 : 3e-4) * (to - from);
    Sample last = c;
    do {
      const double next = std::clamp(last.t + sense * aside, from, to);
      const Sample beside = search.sample(next);
      search.add(piece(last, beside));
      if (!beside.defined) {
        if (next != end && !search.is_settled(piece(last, undefined_at(end))))
          search.take(beyond(std::min(next, end), std::max(next, end), goal));
        break;
      }
      // once more as far as where the slope would turn
      const double bend = (beside.slope - last.slope) / (beside.t - last.t);
      aside = std::max(8.0 * aside, bend > 0 ? 1.5 * std::abs(beside.slope) / bend : 0.0);
      last = beside;
    } while (last.t != end && !search.is_settled(piece(last, undefined_at(end))));
  }
  return search.least();
}

}  // namespace abbe::cutting
