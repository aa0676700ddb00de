#include "sim/study/worst_case.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

#include "kinematics/units.h"
#include "sim/study/influence.h"
#include "sim/study/sampling.h"

namespace abbe::sim::study {

using Eigen::Index;
using Eigen::VectorXd;

struct HeightRange {
  double low = 0.0;
  double high = 0.0;
};

/// The passes of an influence map over a box of inputs, less a slope that is common to all.
struct Passes {
  const InfluenceMap& influence;
  Eigen::VectorXd half;       ///< (p) half widths of the box
  Eigen::VectorXd middle;     ///< (m) mm, linear part at the middle of the box, less the error-free
                              ///< map
  Eigen::VectorXd magnitude;  ///< (m) mm, largest change of the linear part in the box
  std::vector<HeightRange> lift;  ///< (m) mm, range of the curvature term
  std::vector<Eigen::Index> cut;  ///< vertices that have a pass

  Eigen::Index begin(Eigen::Index v) const { return influence.first[std::size_t(v)]; }
  Eigen::Index end(Eigen::Index v) const { return influence.first[std::size_t(v) + 1]; }
};
/// @param common  (p) slope subtracted from all passes
Passes passes_in_box(const InfluenceMap& influence, const Box& box, const Eigen::VectorXd& common);

/// Return the slope to subtract, (p): zeros, or the middle of the slopes of each input. The latter
/// serves PV, which does not depend on a common shift of all vertices, and makes the bound tighter.
Eigen::VectorXd zero_slope(const InfluenceMap& influence);
Eigen::VectorXd common_slope(const InfluenceMap& influence);

/// Returns the range of the height of each vertex in the box, mm; zero where it is not cut. (n)
std::vector<HeightRange> heights(const Passes& passes);

/// Returns an upper bound of the height of a vertex above another, mm: the smallest over the passes
/// of the upper vertex, which lies below all of them, of the largest over those of the lower one.
double apart(const Passes& passes, Eigen::Index upper, Eigen::Index lower);

/// Heights by the pass of the base run, and bounds of the contribution of other passes and
/// curvature.
struct LinearHeights {
  Eigen::VectorXd weight;  ///< (c) fraction of the area of each cut vertex
  Eigen::VectorXd base;    ///< (c) mm, at the middle of the box
  Eigen::MatrixXd slope;   ///< (p x c)
  Eigen::VectorXd added;   ///< (c) mm, largest contribution
  Eigen::VectorXd slack;   ///< (c) mm, its largest magnitude
};
/// @param passes  nothing subtracted
LinearHeights linear_heights(const Passes& passes);
/// Returns the heights less their mean by area.
LinearHeights about_mean(LinearHeights heights);

/// Returns the cut vertices sorted by a key, largest first, ties in their order.
template <typename Key>
std::vector<Eigen::Index> ordered(const Passes& passes, const Key& key) {
  std::vector<Eigen::Index> vertices = passes.cut;
  std::stable_sort(vertices.begin(), vertices.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return key(a) > key(b); });
  return vertices;
}

/// Returns corners from which the search for the worst begins: those where some pair of vertices is
/// farthest apart, or some vertex highest or lowest; for rms and std also the best of many corners
/// that no single input improves, by the linear map alone. (p x count)
Eigen::MatrixXd start_points(const InfluenceMap& influence, const Box& box, Response response);

Box box_of(const Study& study, double coverage) {
  const Index p = Index(study.inputs.size());
  Box box{VectorXd(p), VectorXd(p)};
  for (Index i = 0; i < p; ++i) {
    const Distribution& d = study.inputs[std::size_t(i)].distribution;
    // The end of a log-normal distribution at 0 is no realistic value, so the coverage limits it
    // too.
    const bool open_below = d.kind == Distribution::Kind::LogNormal && d.low <= 0.0;
    const double low = quantile(d, 0.0), high = quantile(d, 1.0);
    box.low[i] = std::isfinite(low) && !open_below ? low : value_at_score(d, -coverage);
    box.high[i] = std::isfinite(high) ? high : value_at_score(d, coverage);
  }
  return box;
}

namespace {

double weighted_magnitude(const auto& slope, const VectorXd& half) {
  double sum = 0.0;
  for (Index i = 0; i < half.size(); ++i) sum += std::abs(slope[i]) * half[i];
  return sum;
}

HeightRange curvature_lift(double half_curvature, double middle, double magnitude) {
  const double most = std::abs(middle) + magnitude;
  const double least = std::max(0.0, std::abs(middle) - magnitude);
  const double a = half_curvature * least * least, b = half_curvature * most * most;
  return {std::min(a, b), std::max(a, b)};
}

/// Returns the range of a vertex's height in the box.
HeightRange height(const Passes& passes, Index v) {
  HeightRange range{infinity, infinity};
  for (Index r = passes.begin(v); r < passes.end(v); ++r) {
    const HeightRange lift = passes.lift[std::size_t(r)];
    range.low = std::min(range.low, passes.middle[r] - passes.magnitude[r] + lift.low);
    range.high = std::min(range.high, passes.middle[r] + passes.magnitude[r] + lift.high);
  }
  return range;
}

}  // namespace

Passes passes_in_box(const InfluenceMap& influence, const Box& box, const VectorXd& common) {
  const Index m = influence.distance.size();
  Passes passes{influence,
                0.5 * (box.high - box.low),
                VectorXd(m),
                VectorXd(m),
                std::vector<HeightRange>(std::size_t(m)),
                {}};
  const VectorXd middle = 0.5 * (box.high + box.low) - influence.centre;
  tbb::parallel_for(Index(0), m, [&](Index r) {
    const VectorXd slope = influence.slope.col(r) - common;
    double along = 0.0, across = 0.0;
    for (Index i = 0; i < middle.size(); ++i) {
      along += slope[i] * middle[i];
      across += influence.shift(i, r) * middle[i];
    }
    passes.middle[r] = influence.distance[r] + along;
    passes.magnitude[r] = weighted_magnitude(slope, passes.half);
    passes.lift[std::size_t(r)] =
        curvature_lift(influence.half_curvature[r], across,
                       weighted_magnitude(influence.shift.col(r), passes.half));
  });
  for (std::size_t v = 0; v + 1 < influence.first.size(); ++v) {
    if (influence.first[v] < influence.first[v + 1]) passes.cut.push_back(Index(v));
    for (Index r = influence.first[v]; r < influence.first[v + 1]; ++r)
      passes.middle[r] -= influence.error_free[Index(v)];
  }
  return passes;
}

VectorXd zero_slope(const InfluenceMap& influence) {
  return VectorXd::Zero(influence.slope.rows());
}

VectorXd common_slope(const InfluenceMap& influence) {
  if (influence.slope.cols() == 0) return zero_slope(influence);
  return 0.5 * (influence.slope.rowwise().minCoeff() + influence.slope.rowwise().maxCoeff());
}

std::vector<HeightRange> heights(const Passes& passes) {
  std::vector<HeightRange> all(passes.influence.first.size() - 1);
  for (const Index v : passes.cut) all[std::size_t(v)] = height(passes, v);
  return all;
}

double apart(const Passes& passes, Index upper, Index lower) {
  const InfluenceMap& map = passes.influence;
  double least = infinity;
  for (Index r = passes.begin(upper); r < passes.end(upper); ++r) {
    double most = -infinity;
    for (Index s = passes.begin(lower); s < passes.end(lower) && most < least; ++s) {
      double sum = 0.0;
      for (Index i = 0; i < passes.half.size(); ++i)
        sum += std::abs(map.slope(i, r) - map.slope(i, s)) * passes.half[i];
      most = std::max(most, passes.middle[r] - passes.middle[s] + sum +
                                passes.lift[std::size_t(r)].high - passes.lift[std::size_t(s)].low);
    }
    least = std::min(least, most);
  }
  return least;
}

LinearHeights linear_heights(const Passes& passes) {
  const InfluenceMap& map = passes.influence;
  const Index count = Index(passes.cut.size());
  LinearHeights all{VectorXd(count), VectorXd(count), Eigen::MatrixXd(map.slope.rows(), count),
                    VectorXd(count), VectorXd(count)};
  double area = 0.0;
  for (Index k = 0; k < count; ++k) {
    const Index v = passes.cut[std::size_t(k)], r = passes.begin(v);
    double least = passes.lift[std::size_t(r)].low;
    for (Index s = r + 1; s < passes.end(v); ++s)
      least =
          std::min(least, passes.middle[s] - passes.middle[r] + passes.lift[std::size_t(s)].low -
                              weighted_magnitude(map.slope.col(s) - map.slope.col(r), passes.half));
    all.base[k] = passes.middle[r];
    all.slope.col(k) = map.slope.col(r);
    all.added[k] = passes.lift[std::size_t(r)].high;
    all.slack[k] = std::max(std::abs(least), std::abs(all.added[k]));
    all.weight[k] = map.design.area[v];
    area += all.weight[k];
  }
  all.weight /= area;
  return all;
}

LinearHeights about_mean(LinearHeights heights) {
  heights.base.array() -= heights.weight.dot(heights.base);
  const VectorXd mean = heights.slope * heights.weight;
  heights.slope.colwise() -= mean;
  return heights;
}

namespace {

constexpr int starts = 24;        // vertices from which pairs are improved
constexpr int max_exchanges = 8;  // steps that exchange one vertex of a pair for a farther one
constexpr Index random_start_count = 1024;  // random corners that are improved by the linear map
constexpr std::size_t max_start_signs = 16;
constexpr std::uint64_t sign_seed = 0x13198a2e03707344ULL;

/// Returns the vertex that is farthest from another one.
/// @param above  true: the farthest above it
Index farthest(const Passes& passes, Index from, bool above) {
  std::vector<double> distance(passes.cut.size());
  tbb::parallel_for(std::size_t(0), distance.size(), [&](std::size_t i) {
    distance[i] = above ? apart(passes, passes.cut[i], from) : apart(passes, from, passes.cut[i]);
  });
  const auto most = std::max_element(distance.begin(), distance.end());
  return passes.cut[std::size_t(most - distance.begin())];
}

/// Returns the slopes of the distance of pairs of vertices that are locally farthest apart: no pair
/// that shares a vertex with them is farther.
std::vector<VectorXd> slopes_of_pairs(const InfluenceMap& influence, const Box& box) {
  const Passes passes = passes_in_box(influence, box, common_slope(influence));
  const std::vector<HeightRange> range = heights(passes);
  const auto high = ordered(passes, [&](Index v) { return range[std::size_t(v)].high; });
  std::vector<VectorXd> slopes;
  std::vector<std::pair<Index, Index>> known;
  for (int start = 0; start < starts && !high.empty(); ++start) {
    // The eight highest vertices, and others spread over all heights.
    const auto place =
        start < 8 ? std::size_t(start) : (high.size() - 1) * std::size_t(start - 8) / (starts - 9);
    std::pair pair{high[std::min(place, high.size() - 1)], Index(-1)};
    for (int i = 0; i < max_exchanges; ++i) {
      const Index before = std::exchange(pair.second, farthest(passes, pair.first, false));
      if (pair.second == before) break;
      pair.first = farthest(passes, pair.second, true);
    }
    if (std::find(known.begin(), known.end(), pair) != known.end()) continue;
    known.push_back(pair);
    slopes.push_back(influence.slope.col(passes.begin(pair.first)) -
                     influence.slope.col(passes.begin(pair.second)));
  }
  return slopes;
}

/// Returns the slopes of the highest vertices, and the negative ones of the lowest.
std::vector<VectorXd> slopes_of_farthest(const InfluenceMap& influence, const Box& box) {
  const Passes passes = passes_in_box(influence, box, zero_slope(influence));
  const std::vector<HeightRange> range = heights(passes);
  const auto high = ordered(passes, [&](Index v) { return range[std::size_t(v)].high; });
  const auto low = ordered(passes, [&](Index v) { return -range[std::size_t(v)].low; });
  std::vector<VectorXd> slopes;
  for (std::size_t i = 0; i < std::min<std::size_t>(high.size(), starts / 2); ++i) {
    slopes.push_back(influence.slope.col(passes.begin(high[i])));
    slopes.push_back(-influence.slope.col(passes.begin(low[i])));
  }
  return slopes;
}

/// The square of a norm of linear heights at the corners of a box: s^T Q s + 2 b^T s, s = +-1.
struct Square {
  Eigen::MatrixXd Q;
  VectorXd b;
};

Square square_of(const LinearHeights& all, const VectorXd& half) {
  const Eigen::MatrixXd weighted = all.slope * all.weight.asDiagonal();
  return {half.asDiagonal() * (weighted * all.slope.transpose()) * half.asDiagonal(),
          half.cwiseProduct(weighted * all.base)};
}

/// Flips signs one by one, each time the one with the largest gain. Returns the square and the
/// signs.
std::pair<double, VectorXd> improved(const Square& square, VectorXd s) {
  VectorXd pull = square.Q * s + square.b;
  const auto gains = [&] {
    return (4.0 * (square.Q.diagonal().array() - s.array() * pull.array())).eval();
  };
  Index i = 0;
  // The square grows with every flip, so the loop ends; 50 flips per sign is a safeguard.
  for (Index step = 0; step < 50 * s.size(); ++step) {
    // Without a tolerance rounding could flip a sign back and forth.
    if (!(gains().maxCoeff(&i) > 1e-12 * std::abs(square.Q(i, i)))) break;
    pull -= 2.0 * s[i] * square.Q.col(i);
    s[i] = -s[i];
  }
  return {s.dot(pull) + s.dot(square.b), s};
}

/// Returns the signs of the largest squares found.
std::vector<VectorXd> signs_of_norm(const Square& square) {
  const Eigen::MatrixXd u =
      points({Sampling::Random, int(square.b.size()), sign_seed}, 0, random_start_count);
  std::vector<std::pair<double, VectorXd>> found(std::size_t(u.cols()));
  tbb::parallel_for(Index(0), u.cols(), [&](Index k) {
    found[std::size_t(k)] = improved(square, (2.0 * u.col(k).array().round() - 1.0).matrix());
  });
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<VectorXd> signs;
  for (const auto& [value, s] : found)
    if (signs.size() < max_start_signs &&
        std::none_of(signs.begin(), signs.end(), [&](const VectorXd& other) { return other == s; }))
      signs.push_back(s);
  return signs;
}

}  // namespace

Eigen::MatrixXd start_points(const InfluenceMap& influence, const Box& box, Response response) {
  std::vector<VectorXd> slopes = slopes_of_pairs(influence, box);
  const auto add = [&](const std::vector<VectorXd>& more) {
    slopes.insert(slopes.end(), more.begin(), more.end());
  };
  add(slopes_of_farthest(influence, box));
  const Passes passes = passes_in_box(influence, box, zero_slope(influence));
  if (!passes.cut.empty() && response == Response::Rms)
    add(signs_of_norm(square_of(linear_heights(passes), passes.half)));
  if (!passes.cut.empty() && response == Response::Std)
    add(signs_of_norm(square_of(about_mean(linear_heights(passes)), passes.half)));
  Eigen::MatrixXd corners(box.low.size(), Index(slopes.size()));
  for (std::size_t k = 0; k < slopes.size(); ++k)
    corners.col(Index(k)) = (slopes[k].array() < 0.0).select(box.low, box.high);
  return corners;
}

namespace {

constexpr double max_products = 1e9;  // multiply-adds for the pairs that are examined, about a
                                      // second
constexpr Index vertex_lot = 64;      // vertices whose pairs are examined in parallel

/// Returns an upper bound of the distance of any pair, at least `known`. Pairs are examined in the
/// order of their upper vertices, for each of them from the lowest lower vertex upwards, until the
/// ranges of the two heights show that no further pair exceeds the known maximum.
double max_separation(const Passes& passes, double known) {
  const std::vector<HeightRange> range = heights(passes);
  const auto upper = ordered(passes, [&](Index v) { return range[std::size_t(v)].high; });
  const auto lower = ordered(passes, [&](Index v) { return -range[std::size_t(v)].low; });
  if (upper.empty()) return known;
  const auto coarse = [&](Index v, Index w) {
    return range[std::size_t(v)].high - range[std::size_t(w)].low;
  };
  const double competing_passes =
      double(passes.influence.distance.size()) / double(passes.cut.size());
  double pairs = max_products / (double(passes.half.size()) * competing_passes * competing_passes);
  for (Index first = 0; first < Index(upper.size()); first += vertex_lot) {
    if (coarse(upper[std::size_t(first)], lower.front()) <= known) return known;
    if (pairs <= 0.0) return coarse(upper[std::size_t(first)], lower.front());
    const Index count = std::min(vertex_lot, Index(upper.size()) - first);
    std::vector<double> most(std::size_t(count), known), looked(std::size_t(count), 0.0);
    const double each = pairs / double(count);
    tbb::parallel_for(Index(0), count, [&](Index i) {
      const Index v = upper[std::size_t(first + i)];
      double& own = most[std::size_t(i)];
      for (const Index w : lower) {
        if (coarse(v, w) <= own) break;
        if (looked[std::size_t(i)]++ >= each) {
          own = coarse(v, w);  // bounds all remaining pairs of v
          break;
        }
        if (v != w) own = std::max(own, apart(passes, v, w));
      }
    });
    for (Index i = 0; i < count; ++i) {
      known = std::max(known, most[std::size_t(i)]);
      pairs -= looked[std::size_t(i)];
    }
  }
  return known;
}

double mean_bound(const LinearHeights& all, const VectorXd& half) {
  return all.weight.dot(all.base) + (all.slope * all.weight).cwiseAbs().dot(half) +
         all.weight.dot(all.added);
}

double norm_bound(const LinearHeights& all, const VectorXd& half) {
  const Eigen::MatrixXd weighted = all.slope * all.weight.asDiagonal();
  const Eigen::MatrixXd products = weighted * all.slope.transpose();
  const double square = all.weight.dot(all.base.cwiseAbs2()) +
                        2.0 * (weighted * all.base).cwiseAbs().dot(half) +
                        half.dot(products.cwiseAbs() * half);
  return std::sqrt(square) + std::sqrt(all.weight.dot(all.slack.cwiseAbs2()));
}

double farthest_height(const Passes& passes) {
  double most = 0.0;
  for (const HeightRange& range : heights(passes)) most = std::max({most, range.high, -range.low});
  return most;
}

double rms_of_farthest(const Passes& passes, const VectorXd& weight) {
  const std::vector<HeightRange> all = heights(passes);
  double square = 0.0;
  for (Index k = 0; k < weight.size(); ++k) {
    const HeightRange range = all[std::size_t(passes.cut[std::size_t(k)])];
    square += weight[k] * std::pow(std::max(range.high, -range.low), 2);
  }
  return std::sqrt(square);
}

}  // namespace

double response_bound(const InfluenceMap& influence, const Box& box, Response response,
                      double found) {
  if (response == Response::InTolerance) return 0.0;
  // At a rim the plane of the filter may lie outside the data to which it is fitted, so no bound
  // holds.
  if (is_filtered(response)) return infinity;
  if (response == Response::Pv)
    return max_separation(passes_in_box(influence, box, common_slope(influence)), found);
  const Passes passes = passes_in_box(influence, box, zero_slope(influence));
  if (passes.cut.empty()) return found;
  if (response == Response::MaxAbs || response == Response::P95Abs)
    return std::max(found, farthest_height(passes));
  const LinearHeights all = linear_heights(passes);
  switch (response) {
    case Response::Mean:
      return std::max(found, mean_bound(all, passes.half));
    case Response::Std:
      return std::max(found, norm_bound(about_mean(all), passes.half));
    default:
      return std::max(found,
                      std::min(norm_bound(all, passes.half), rms_of_farthest(passes, all.weight)));
  }
}

namespace {

constexpr Index few = 12;  // inputs up to which all corners, 4096, are evaluated
constexpr int random_starts = 64;
constexpr Index finalists = 8;  // climbs that continue input by input
constexpr int max_steps = 50;   // of a climb along gradients
constexpr int max_flips = 20;   // of single inputs to their other end
constexpr std::uint64_t start_seed = 0x243f6a8885a308d3ULL;

/// Corners and their responses, signed so that more is worse.
struct Places {
  Eigen::MatrixXd x;  ///< (p x count)
  VectorXd value;     ///< (count)
};

/// Climbs from corner to corner.
class Climb {
 public:
  Climb(const Box& box, const ResponseFunction& function, double sign)
      : box_(box), function_(function), sign_(sign) {}

  Places at(const Eigen::MatrixXd& x) const { return {x, sign_ * function_.values(x)}; }

  /// Moves every corner to the ends towards which its gradient points. A convex response is at
  /// least its tangent, so every step goes up. All corners move together, because many machines
  /// cost little more than one.
  Places along_gradients(Places places) const {
    std::vector<Index> rising(std::size_t(places.value.size()));
    std::iota(rising.begin(), rising.end(), Index(0));
    for (int i = 0; i < max_steps && !rising.empty(); ++i) {
      const Places next = at(ends_by_gradient(places.x(Eigen::all, rising)));
      std::vector<Index> still;
      for (std::size_t k = 0; k < rising.size(); ++k) {
        const Index place = rising[k];
        if (!(next.value[Index(k)] > places.value[place])) continue;
        places.x.col(place) = next.x.col(Index(k));
        places.value[place] = next.value[Index(k)];
        still.push_back(place);
      }
      rising = std::move(still);
    }
    return places;
  }

  // Flips single inputs: at a kink the gradient of one side may miss an improvement.
  Places input_by_input(Places place) const {
    for (int i = 0; i < max_flips; ++i) {
      const Places next = best(at(flip_each_input(place.x)), 1);
      if (!(next.value[0] > place.value[0])) break;
      place = along_gradients(next);
    }
    return place;
  }

  /// Returns the largest corners in falling order.
  static Places best(const Places& places, Index count) {
    std::vector<Index> order(std::size_t(places.value.size()));
    std::iota(order.begin(), order.end(), Index(0));
    std::stable_sort(order.begin(), order.end(),
                     [&](Index a, Index b) { return places.value[a] > places.value[b]; });
    order.resize(std::min(order.size(), std::size_t(count)));
    return {places.x(Eigen::all, order), places.value(order)};
  }

 private:
  Eigen::MatrixXd ends_by_gradient(const Eigen::MatrixXd& x) const {
    const Eigen::MatrixXd gradient = sign_ * function_.gradients(x);
    Eigen::MatrixXd ends = x;
    for (Index k = 0; k < x.cols(); ++k)
      for (Index i = 0; i < x.rows(); ++i)
        if (gradient(i, k) != 0.0) ends(i, k) = gradient(i, k) > 0.0 ? box_.high[i] : box_.low[i];
    return ends;
  }

  /// Returns all corners that differ from one corner in one input.
  Eigen::MatrixXd flip_each_input(const VectorXd& corner) const {
    Eigen::MatrixXd x = corner.replicate(1, corner.size());
    x.diagonal() = (corner.array() == box_.low.array()).select(box_.high, box_.low);
    return x;
  }

  const Box& box_;
  const ResponseFunction& function_;
  double sign_;
};

Eigen::MatrixXd all_corners(const Box& box) {
  return Eigen::MatrixXd::NullaryExpr(
      box.low.size(), Index(1) << box.low.size(),
      [&](Index i, Index k) { return (k >> i) & 1 ? box.high[i] : box.low[i]; });
}

/// Returns the start points, their opposite corners, and random corners.
Eigen::MatrixXd search_starts(const Box& box, const InfluenceMap& influence, Response response) {
  const Eigen::MatrixXd promising = start_points(influence, box, response);
  const Index count = promising.cols();
  const auto of = [&](const Eigen::VectorXd& end, Index n) { return end.replicate(1, n).eval(); };
  const Eigen::MatrixXd u =
      points({Sampling::Random, int(box.low.size()), start_seed}, 0, random_starts);
  Eigen::MatrixXd all(box.low.size(), 2 * count + random_starts);
  all << promising,
      (promising.array() == of(box.low, count).array())
          .select(of(box.high, count), of(box.low, count)),
      (u.array() < 0.5).select(of(box.low, random_starts), of(box.high, random_starts));
  return all;
}

Corner climbed(const Box& box, const InfluenceMap& influence, Response response,
               const ResponseFunction& function) {
  const double sign = response == Response::InTolerance ? -1.0 : 1.0;
  const Climb climb(box, function, sign);
  if (box.low.size() <= few) {
    const Places worst = Climb::best(climb.at(all_corners(box)), 1);
    return {worst.x, sign * worst.value[0], 0.0};
  }
  const Places first = Climb::best(
      climb.along_gradients(climb.at(search_starts(box, influence, response))), finalists);
  Places last = first;
  for (Index k = 0; k < first.value.size(); ++k) {
    const Places one = climb.input_by_input({first.x.col(k), first.value.segment(k, 1)});
    last.x.col(k) = one.x;
    last.value[k] = one.value[0];
  }
  const Places worst = Climb::best(last, 1);
  return {worst.x, sign * worst.value[0], 0.0};
}

}  // namespace

Corner worst_corner(const Box& box, const InfluenceMap& influence, Response response,
                    const ResponseFunction& function) {
  Corner corner = climbed(box, influence, response, function);
  corner.bound = response_bound(influence, box, response, corner.response);
  return corner;
}

Corner worst_corner(const Study& study, const PreparedConfiguration& ready,
                    const InfluenceMap& influence, Response response) {
  const Box box = box_of(study, study.worst_case.value_or(WorstCase{}).coverage);
  const ResponseFunction function = response_function(study, ready, influence, response);
  if (ready.job.scene.alignment == Alignment::None)
    return worst_corner(box, influence, response, function);
  Corner corner = climbed(box, influence, response, function);
  corner.bound = response == Response::InTolerance ? 0.0 : infinity;
  return corner;
}

}  // namespace abbe::sim::study
