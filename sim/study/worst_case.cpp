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

namespace {

struct HeightRange {
  double low = 0.0;
  double high = 0.0;
};

/// The passes of an influence map over a box of inputs, minus a slope that is common to all.
struct Passes {
  const InfluenceMap& influence;
  Eigen::VectorXd half;    ///< (p) half widths of the box
  Eigen::VectorXd middle;  ///< (m) mm, linear part at the middle of the box, minus the error-free
                           ///< map
  Eigen::VectorXd magnitude;      ///< (m) mm, largest change of the linear part in the box
  std::vector<HeightRange> lift;  ///< (m) mm, range of the curvature term
  std::vector<Eigen::Index> cut;  ///< vertices that have a pass

  /// Range of the passes of a vertex.
  Eigen::Index begin(Eigen::Index v) const { return influence.first[std::size_t(v)]; }
  Eigen::Index end(Eigen::Index v) const { return influence.first[std::size_t(v) + 1]; }
};

/// Heights by the pass of the base run, and bounds of the contribution of other passes and
/// curvature.
struct LinearHeights {
  Eigen::VectorXd weight;  ///< (c) fraction of the area of each cut vertex
  Eigen::VectorXd base;    ///< (c) mm, at the middle of the box
  Eigen::MatrixXd slope;   ///< (p x c)
  Eigen::VectorXd added;   ///< (c) mm, largest contribution of other passes and curvature
  Eigen::VectorXd slack;   ///< (c) mm, largest magnitude of that contribution
};

/// Returns the cut vertices sorted by a key, largest first; ties keep their order.
template <typename Key>
std::vector<Eigen::Index> sorted_vertices(const Passes& passes, const Key& key) {
  std::vector<Eigen::Index> vertices = passes.cut;
  std::stable_sort(vertices.begin(), vertices.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return key(a) > key(b); });
  return vertices;
}

}  // namespace

Box input_box(const Study& study, double coverage) {
  const Index p = Index(study.inputs.size());
  Box box{VectorXd(p), VectorXd(p)};
  for (Index i = 0; i < p; ++i) {
    const Distribution& d = study.inputs[std::size_t(i)].distribution;
    // The lower end of a log-normal distribution, 0, is not a realistic value, so it is limited by
    // the coverage too.
    const bool is_open_below = d.kind == Distribution::Kind::LogNormal && d.low <= 0.0;
    const double low = quantile(d, 0.0), high = quantile(d, 1.0);
    box.low[i] = std::isfinite(low) && !is_open_below ? low : value_at_score(d, -coverage);
    box.high[i] = std::isfinite(high) ? high : value_at_score(d, coverage);
  }
  return box;
}

namespace {

/// Returns the largest change of a linear function in the box.
double max_change(const auto& slope, const VectorXd& half) {
  double sum = 0.0;
  for (Index i = 0; i < half.size(); ++i) sum += std::abs(slope[i]) * half[i];
  return sum;
}

/// Returns the range of the curvature term of a pass.
/// @param middle     shift across the feed at the middle of the box
/// @param magnitude  largest change of the shift in the box
HeightRange curvature_lift(double half_curvature, double middle, double magnitude) {
  const double max_shift = std::abs(middle) + magnitude;
  const double min_shift = std::max(0.0, std::abs(middle) - magnitude);
  const double a = half_curvature * min_shift * min_shift,
               b = half_curvature * max_shift * max_shift;
  return {std::min(a, b), std::max(a, b)};
}

/// Returns the range of a vertex's height in the box, mm.
HeightRange height_range(const Passes& passes, Index v) {
  HeightRange range{infinity, infinity};
  for (Index r = passes.begin(v); r < passes.end(v); ++r) {
    const HeightRange lift = passes.lift[std::size_t(r)];
    range.low = std::min(range.low, passes.middle[r] - passes.magnitude[r] + lift.low);
    range.high = std::min(range.high, passes.middle[r] + passes.magnitude[r] + lift.high);
  }
  return range;
}

/// Returns the passes over a box.
/// @param common  (p) slope subtracted from all passes
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
    passes.magnitude[r] = max_change(slope, passes.half);
    passes.lift[std::size_t(r)] = curvature_lift(influence.half_curvature[r], across,
                                                 max_change(influence.shift.col(r), passes.half));
  });
  for (std::size_t v = 0; v + 1 < influence.first.size(); ++v) {
    if (influence.first[v] < influence.first[v + 1]) passes.cut.push_back(Index(v));
    for (Index r = influence.first[v]; r < influence.first[v + 1]; ++r)
      passes.middle[r] -= influence.error_free[Index(v)];
  }
  return passes;
}

/// Returns a common slope of zero. (p)
VectorXd zero_slope(const InfluenceMap& influence) {
  return VectorXd::Zero(influence.slope.rows());
}

/// Returns the middle of the slopes of each input. Subtracted from all passes it makes the bound of
/// PV tighter, which does not depend on a common displacement of all vertices. (p)
VectorXd common_slope(const InfluenceMap& influence) {
  if (influence.slope.cols() == 0) return zero_slope(influence);
  return 0.5 * (influence.slope.rowwise().minCoeff() + influence.slope.rowwise().maxCoeff());
}

/// Returns the range of the height of each vertex in the box, mm; zero if it is not cut. (n)
std::vector<HeightRange> heights(const Passes& passes) {
  std::vector<HeightRange> ranges(passes.influence.first.size() - 1);
  for (const Index v : passes.cut) ranges[std::size_t(v)] = height_range(passes, v);
  return ranges;
}

/// Returns an upper bound of the height of a vertex above another, mm: the minimum over the passes
/// of the upper vertex, which is below all of them, of the maximum over the passes of the lower
/// vertex.
double max_height_above(const Passes& passes, Index upper, Index lower) {
  const InfluenceMap& map = passes.influence;
  double bound = infinity;
  for (Index r = passes.begin(upper); r < passes.end(upper); ++r) {
    double distance = -infinity;
    for (Index s = passes.begin(lower); s < passes.end(lower) && distance < bound; ++s) {
      double sum = 0.0;
      for (Index i = 0; i < passes.half.size(); ++i)
        sum += std::abs(map.slope(i, r) - map.slope(i, s)) * passes.half[i];
      distance = std::max(distance, passes.middle[r] - passes.middle[s] + sum +
                                        passes.lift[std::size_t(r)].high -
                                        passes.lift[std::size_t(s)].low);
    }
    bound = std::min(bound, distance);
  }
  return bound;
}

/// Returns the linear heights of the cut vertices.
/// @param passes  without a subtracted slope
LinearHeights linear_heights(const Passes& passes) {
  const InfluenceMap& map = passes.influence;
  const Index count = Index(passes.cut.size());
  LinearHeights linear{VectorXd(count), VectorXd(count), Eigen::MatrixXd(map.slope.rows(), count),
                       VectorXd(count), VectorXd(count)};
  double area = 0.0;
  for (Index k = 0; k < count; ++k) {
    const Index v = passes.cut[std::size_t(k)], r = passes.begin(v);
    double lowest = passes.lift[std::size_t(r)].low;
    for (Index s = r + 1; s < passes.end(v); ++s)
      lowest =
          std::min(lowest, passes.middle[s] - passes.middle[r] + passes.lift[std::size_t(s)].low -
                               max_change(map.slope.col(s) - map.slope.col(r), passes.half));
    linear.base[k] = passes.middle[r];
    linear.slope.col(k) = map.slope.col(r);
    linear.added[k] = passes.lift[std::size_t(r)].high;
    linear.slack[k] = std::max(std::abs(lowest), std::abs(linear.added[k]));
    linear.weight[k] = map.design.area[v];
    area += linear.weight[k];
  }
  linear.weight /= area;
  return linear;
}

/// Returns the heights minus their mean by area.
LinearHeights about_mean(LinearHeights heights) {
  heights.base.array() -= heights.weight.dot(heights.base);
  const VectorXd mean = heights.slope * heights.weight;
  heights.slope.colwise() -= mean;
  return heights;
}

constexpr int start_vertices = 24;          // from which pairs are improved
constexpr int max_exchanges = 8;            // of one vertex of a pair for a farther one
constexpr Index random_start_count = 1024;  // random corners that are improved by the linear map
constexpr std::size_t max_start_signs = 16;
constexpr std::uint64_t sign_seed = 0x13198a2e03707344ULL;

/// Returns the vertex with the largest distance.
/// @param distance  function of a vertex
template <typename Distance>
Index farthest_vertex(const Passes& passes, const Distance& distance) {
  std::vector<double> distances(passes.cut.size());
  tbb::parallel_for(std::size_t(0), distances.size(),
                    [&](std::size_t i) { distances[i] = distance(passes.cut[i]); });
  const auto largest = std::max_element(distances.begin(), distances.end());
  return passes.cut[std::size_t(largest - distances.begin())];
}

/// Returns the slopes of the distances of pairs of vertices that are locally farthest apart, i.e.
/// no pair that has a vertex in common with them is farther apart.
std::vector<VectorXd> pair_slopes(const InfluenceMap& influence, const Box& box) {
  const Passes passes = passes_in_box(influence, box, common_slope(influence));
  const std::vector<HeightRange> range = heights(passes);
  const auto high = sorted_vertices(passes, [&](Index v) { return range[std::size_t(v)].high; });
  std::vector<VectorXd> slopes;
  std::vector<std::pair<Index, Index>> pairs;
  for (int start = 0; start < start_vertices && !high.empty(); ++start) {
    // The search starts from the eight highest vertices and from others spread over all heights.
    const auto rank = start < 8 ? std::size_t(start)
                                : (high.size() - 1) * std::size_t(start - 8) / (start_vertices - 9);
    std::pair pair{high[std::min(rank, high.size() - 1)], Index(-1)};
    for (int i = 0; i < max_exchanges; ++i) {
      const Index lowest =
          farthest_vertex(passes, [&](Index v) { return max_height_above(passes, pair.first, v); });
      if (std::exchange(pair.second, lowest) == lowest) break;
      pair.first = farthest_vertex(
          passes, [&](Index v) { return max_height_above(passes, v, pair.second); });
    }
    if (std::find(pairs.begin(), pairs.end(), pair) != pairs.end()) continue;
    pairs.push_back(pair);
    slopes.push_back(influence.slope.col(passes.begin(pair.first)) -
                     influence.slope.col(passes.begin(pair.second)));
  }
  return slopes;
}

/// Returns the slopes of the highest vertices and the negative slopes of the lowest vertices.
std::vector<VectorXd> extreme_slopes(const InfluenceMap& influence, const Box& box) {
  const Passes passes = passes_in_box(influence, box, zero_slope(influence));
  const std::vector<HeightRange> range = heights(passes);
  const auto high = sorted_vertices(passes, [&](Index v) { return range[std::size_t(v)].high; });
  const auto low = sorted_vertices(passes, [&](Index v) { return -range[std::size_t(v)].low; });
  std::vector<VectorXd> slopes;
  for (std::size_t i = 0; i < std::min<std::size_t>(high.size(), start_vertices / 2); ++i) {
    slopes.push_back(influence.slope.col(passes.begin(high[i])));
    slopes.push_back(-influence.slope.col(passes.begin(low[i])));
  }
  return slopes;
}

/// Variable part of the squared norm of linear heights at the corners of a box: s^T Q s + 2 b^T s,
/// where the signs s are +-1.
struct SquaredNorm {
  Eigen::MatrixXd Q;
  VectorXd b;
};

/// Returns the variable part of the squared norm of heights over a box.
/// @param half  half widths of the box
SquaredNorm squared_norm(const LinearHeights& linear, const VectorXd& half) {
  const Eigen::MatrixXd weighted = linear.slope * linear.weight.asDiagonal();
  return {half.asDiagonal() * (weighted * linear.slope.transpose()) * half.asDiagonal(),
          half.cwiseProduct(weighted * linear.base)};
}

/// Flips signs one by one, always the one with the largest gain, until none gains. Returns the
/// squared norm and the signs.
std::pair<double, VectorXd> improve_signs(const SquaredNorm& square, VectorXd s) {
  VectorXd half_gradient = square.Q * s + square.b;
  const auto gains = [&] {
    return (4.0 * (square.Q.diagonal().array() - s.array() * half_gradient.array())).eval();
  };
  Index i = 0;
  // The norm grows with every flip, so the loop ends; the limit of 50 flips per sign is a
  // safeguard.
  for (Index step = 0; step < 50 * s.size(); ++step) {
    // Without the tolerance a sign could be flipped back and forth by rounding.
    if (!(gains().maxCoeff(&i) > 1e-12 * std::abs(square.Q(i, i)))) break;
    half_gradient -= 2.0 * s[i] * square.Q.col(i);
    s[i] = -s[i];
  }
  return {s.dot(half_gradient) + s.dot(square.b), s};
}

/// Returns the signs of the largest squared norms that are found from random signs.
std::vector<VectorXd> largest_norm_signs(const SquaredNorm& square) {
  const Eigen::MatrixXd u =
      points({Sampling::Random, int(square.b.size()), sign_seed}, 0, random_start_count);
  std::vector<std::pair<double, VectorXd>> candidates(std::size_t(u.cols()));
  tbb::parallel_for(Index(0), u.cols(), [&](Index k) {
    candidates[std::size_t(k)] =
        improve_signs(square, (2.0 * u.col(k).array().round() - 1.0).matrix());
  });
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<VectorXd> signs;
  for (const auto& [value, s] : candidates)
    if (signs.size() < max_start_signs &&
        std::none_of(signs.begin(), signs.end(), [&](const VectorXd& other) { return other == s; }))
      signs.push_back(s);
  return signs;
}

/// Returns corners from which the search for the worst corner starts: those at which a pair of
/// vertices is farthest apart, or a vertex is highest or lowest. For rms and std there are also the
/// best of many corners that no change of a single input improves by the linear map. (p x count)
Eigen::MatrixXd start_points(const InfluenceMap& influence, const Box& box, Response response) {
  std::vector<VectorXd> slopes = pair_slopes(influence, box);
  const auto add = [&](const std::vector<VectorXd>& more) {
    slopes.insert(slopes.end(), more.begin(), more.end());
  };
  add(extreme_slopes(influence, box));
  const Passes passes = passes_in_box(influence, box, zero_slope(influence));
  if (!passes.cut.empty() && response == Response::Rms)
    add(largest_norm_signs(squared_norm(linear_heights(passes), passes.half)));
  if (!passes.cut.empty() && response == Response::Std)
    add(largest_norm_signs(squared_norm(about_mean(linear_heights(passes)), passes.half)));
  Eigen::MatrixXd corners(box.low.size(), Index(slopes.size()));
  for (std::size_t k = 0; k < slopes.size(); ++k)
    corners.col(Index(k)) = (slopes[k].array() < 0.0).select(box.low, box.high);
  return corners;
}

constexpr double max_products = 1e9;     // multiply-adds for all pairs: about a second
constexpr Index vertex_block_size = 64;  // vertices whose pairs are examined in parallel

/// Returns an upper bound of the distance of any pair, at least `known`. Pairs are examined in
/// descending order of their upper vertices, and for each in ascending order of the lower vertices,
/// until the ranges of the heights show that no further pair exceeds the known maximum.
double max_separation(const Passes& passes, double known) {
  const std::vector<HeightRange> range = heights(passes);
  const auto upper = sorted_vertices(passes, [&](Index v) { return range[std::size_t(v)].high; });
  const auto lower = sorted_vertices(passes, [&](Index v) { return -range[std::size_t(v)].low; });
  if (upper.empty()) return known;
  const auto range_bound = [&](Index v, Index w) {
    return range[std::size_t(v)].high - range[std::size_t(w)].low;
  };
  const double passes_per_vertex =
      double(passes.influence.distance.size()) / double(passes.cut.size());
  double remaining_pairs =
      max_products / (double(passes.half.size()) * passes_per_vertex * passes_per_vertex);
  for (Index first = 0; first < Index(upper.size()); first += vertex_block_size) {
    const double block_bound = range_bound(upper[std::size_t(first)], lower.front());
    if (block_bound <= known) return known;
    if (remaining_pairs <= 0.0) return block_bound;
    const Index count = std::min(vertex_block_size, Index(upper.size()) - first);
    std::vector<double> bounds(std::size_t(count), known), examined(std::size_t(count), 0.0);
    const double max_pairs = remaining_pairs / double(count);  // of a vertex
    tbb::parallel_for(Index(0), count, [&](Index i) {
      const Index v = upper[std::size_t(first + i)];
      double& bound = bounds[std::size_t(i)];
      for (const Index w : lower) {
        if (range_bound(v, w) <= bound) break;
        if (examined[std::size_t(i)]++ >= max_pairs) {
          bound = range_bound(v, w);  // of all remaining pairs of v
          break;
        }
        if (v != w) bound = std::max(bound, max_height_above(passes, v, w));
      }
    });
    for (Index i = 0; i < count; ++i) {
      known = std::max(known, bounds[std::size_t(i)]);
      remaining_pairs -= examined[std::size_t(i)];
    }
  }
  return known;
}

/// Returns an upper bound of the mean of the heights.
double mean_bound(const LinearHeights& linear, const VectorXd& half) {
  return linear.weight.dot(linear.base) + (linear.slope * linear.weight).cwiseAbs().dot(half) +
         linear.weight.dot(linear.added);
}

/// Returns an upper bound of the RMS of the heights.
double norm_bound(const LinearHeights& linear, const VectorXd& half) {
  const Eigen::MatrixXd weighted = linear.slope * linear.weight.asDiagonal();
  const Eigen::MatrixXd products = weighted * linear.slope.transpose();
  const double squared_norm = linear.weight.dot(linear.base.cwiseAbs2()) +
                              2.0 * (weighted * linear.base).cwiseAbs().dot(half) +
                              half.dot(products.cwiseAbs() * half);
  return std::sqrt(squared_norm) + std::sqrt(linear.weight.dot(linear.slack.cwiseAbs2()));
}

/// Returns an upper bound of the magnitudes of all heights.
double max_height_bound(const Passes& passes) {
  double bound = 0.0;
  for (const HeightRange& range : heights(passes))
    bound = std::max({bound, range.high, -range.low});
  return bound;
}

/// Returns the RMS of the largest magnitudes of the heights.
double max_height_rms(const Passes& passes, const VectorXd& weight) {
  const std::vector<HeightRange> ranges = heights(passes);
  double mean_square = 0.0;
  for (Index k = 0; k < weight.size(); ++k) {
    const HeightRange range = ranges[std::size_t(passes.cut[std::size_t(k)])];
    mean_square += weight[k] * std::pow(std::max(range.high, -range.low), 2);
  }
  return std::sqrt(mean_square);
}

}  // namespace

double response_bound(const InfluenceMap& influence, const Box& box, Response response,
                      double attained) {
  if (response == Response::InTolerance) return 0.0;
  // At a rim the plane of the filter may extrapolate the data to which it is fitted, so there is no
  // bound.
  if (is_filtered(response)) return infinity;
  if (response == Response::Pv)
    return max_separation(passes_in_box(influence, box, common_slope(influence)), attained);
  const Passes passes = passes_in_box(influence, box, zero_slope(influence));
  if (passes.cut.empty()) return attained;
  if (response == Response::MaxAbs || response == Response::P95Abs)
    return std::max(attained, max_height_bound(passes));
  const LinearHeights linear = linear_heights(passes);
  switch (response) {
    case Response::Mean:
      return std::max(attained, mean_bound(linear, passes.half));
    case Response::Std:
      return std::max(attained, norm_bound(about_mean(linear), passes.half));
    default:
      return std::max(attained, std::min(norm_bound(linear, passes.half),
                                         max_height_rms(passes, linear.weight)));
  }
}

namespace {

constexpr Index max_exhaustive_inputs = 12;  // for which all corners, at most 4096, are evaluated
constexpr int random_starts = 64;
constexpr Index finalists = 8;  // corners from which the search continues input by input
constexpr int max_steps = 50;   // of a search along gradients
constexpr int max_flips = 20;   // of single inputs to their other end
constexpr std::uint64_t start_seed = 0x243f6a8885a308d3ULL;

/// Corners and their responses.
struct Corners {
  Eigen::MatrixXd x;  ///< (p x count)
  VectorXd value;     ///< (count) responses with the sign with which larger values are worse
};

/// Local search from corner to corner.
class CornerSearch {
 public:
  CornerSearch(const Box& box, const ResponseFunction& function, double sign)
      : box_(box), function_(function), sign_(sign) {}

  Corners evaluate(const Eigen::MatrixXd& x) const { return {x, sign_ * function_.values(x)}; }

  /// Moves all corners to the ends towards which their gradients point. A convex response is
  /// nowhere below its tangent, so no step decreases it. All corners are moved together, because
  /// many machines take little longer than one.
  Corners follow_gradients(Corners corners) const {
    std::vector<Index> rising(std::size_t(corners.value.size()));
    std::iota(rising.begin(), rising.end(), Index(0));
    for (int i = 0; i < max_steps && !rising.empty(); ++i) {
      const Corners next = evaluate(gradient_ends(corners.x(Eigen::all, rising)));
      std::vector<Index> still_rising;
      for (std::size_t k = 0; k < rising.size(); ++k) {
        const Index corner = rising[k];
        if (!(next.value[Index(k)] > corners.value[corner])) continue;
        corners.x.col(corner) = next.x.col(Index(k));
        corners.value[corner] = next.value[Index(k)];
        still_rising.push_back(corner);
      }
      rising = std::move(still_rising);
    }
    return corners;
  }

  /// Flips single inputs of one corner. Gradients do not suffice, since at a kink that of one side
  /// may miss an improvement.
  Corners flip_inputs(Corners corner) const {
    for (int i = 0; i < max_flips; ++i) {
      const Corners next = worst_corners(evaluate(corners_with_flipped_input(corner.x)), 1);
      if (!(next.value[0] > corner.value[0])) break;
      corner = follow_gradients(next);
    }
    return corner;
  }

  /// Returns the corners with the largest values in descending order.
  static Corners worst_corners(const Corners& corners, Index count) {
    std::vector<Index> order(std::size_t(corners.value.size()));
    std::iota(order.begin(), order.end(), Index(0));
    std::stable_sort(order.begin(), order.end(),
                     [&](Index a, Index b) { return corners.value[a] > corners.value[b]; });
    order.resize(std::min(order.size(), std::size_t(count)));
    return {corners.x(Eigen::all, order), corners.value(order)};
  }

 private:
  /// Returns the corners towards which the gradients point.
  Eigen::MatrixXd gradient_ends(const Eigen::MatrixXd& x) const {
    const Eigen::MatrixXd gradient = sign_ * function_.gradients(x);
    Eigen::MatrixXd ends = x;
    for (Index k = 0; k < x.cols(); ++k)
      for (Index i = 0; i < x.rows(); ++i)
        if (gradient(i, k) != 0.0) ends(i, k) = gradient(i, k) > 0.0 ? box_.high[i] : box_.low[i];
    return ends;
  }

  /// Returns all corners that differ from one corner in one input.
  Eigen::MatrixXd corners_with_flipped_input(const VectorXd& corner) const {
    Eigen::MatrixXd x = corner.replicate(1, corner.size());
    x.diagonal() = (corner.array() == box_.low.array()).select(box_.high, box_.low);
    return x;
  }

  const Box& box_;
  const ResponseFunction& function_;
  double sign_;
};

/// Returns all 2^p corners of a box. (p x 2^p)
Eigen::MatrixXd all_corners(const Box& box) {
  return Eigen::MatrixXd::NullaryExpr(
      box.low.size(), Index(1) << box.low.size(),
      [&](Index i, Index k) { return (k >> i) & 1 ? box.high[i] : box.low[i]; });
}

/// Returns the start points, the corners opposite to them, and random corners.
Eigen::MatrixXd search_starts(const Box& box, const InfluenceMap& influence, Response response) {
  const Eigen::MatrixXd start_corners = start_points(influence, box, response);
  const Index count = start_corners.cols();
  const auto repeat = [&](const Eigen::VectorXd& end, Index n) {
    return end.replicate(1, n).eval();
  };
  const Eigen::MatrixXd u =
      points({Sampling::Random, int(box.low.size()), start_seed}, 0, random_starts);
  Eigen::MatrixXd corners(box.low.size(), 2 * count + random_starts);
  corners << start_corners,
      (start_corners.array() == repeat(box.low, count).array())
          .select(repeat(box.high, count), repeat(box.low, count)),
      (u.array() < 0.5).select(repeat(box.low, random_starts), repeat(box.high, random_starts));
  return corners;
}

/// Returns the worst corner that is found, without its bound.
Corner search_worst_corner(const Box& box, const InfluenceMap& influence, Response response,
                           const ResponseFunction& function) {
  const double sign = response == Response::InTolerance ? -1.0 : 1.0;
  const CornerSearch search(box, function, sign);
  if (box.low.size() <= max_exhaustive_inputs) {
    const Corners worst = CornerSearch::worst_corners(search.evaluate(all_corners(box)), 1);
    return {worst.x, sign * worst.value[0], 0.0};
  }
  Corners corners = CornerSearch::worst_corners(
      search.follow_gradients(search.evaluate(search_starts(box, influence, response))), finalists);
  for (Index k = 0; k < corners.value.size(); ++k) {
    const Corners corner = search.flip_inputs({corners.x.col(k), corners.value.segment(k, 1)});
    corners.x.col(k) = corner.x;
    corners.value[k] = corner.value[0];
  }
  const Corners worst = CornerSearch::worst_corners(corners, 1);
  return {worst.x, sign * worst.value[0], 0.0};
}

}  // namespace

Corner worst_corner(const Box& box, const InfluenceMap& influence, Response response,
                    const ResponseFunction& function) {
  Corner corner = search_worst_corner(box, influence, response, function);
  corner.bound = response_bound(influence, box, response, corner.response);
  return corner;
}

Corner worst_corner(const Study& study, const PreparedConfiguration& ready,
                    const InfluenceMap& influence, Response response) {
  const Box box = input_box(study, study.worst_case.value_or(WorstCase{}).coverage);
  const ResponseFunction function = response_function(study, ready, influence, response);
  if (ready.job.scene.alignment == Alignment::None)
    return worst_corner(box, influence, response, function);
  Corner corner = search_worst_corner(box, influence, response, function);
  corner.bound = response == Response::InTolerance ? 0.0 : infinity;
  return corner;
}

}  // namespace abbe::sim::study
