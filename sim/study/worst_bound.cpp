#include "sim/study/worst_bound.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

#include "kinematics/numbers.h"
#include "sim/study/passes.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double most_products = 1e9;  // of the pairs that are looked at
constexpr Index vertex_lot = 64;       // vertices whose pairs are looked at together

/// Pairs in the order of their upper vertices; each of those with ever higher lower ones, until
/// their own heights say that no pair is farther apart than what is known.
double farthest_apart(const Passes& passes, double known) {
  const std::vector<HeightRange> range = heights(passes);
  const auto upper = ordered(passes, [&](Index v) { return range[std::size_t(v)].high; });
  const auto lower = ordered(passes, [&](Index v) { return -range[std::size_t(v)].low; });
  if (upper.empty()) return known;
  const auto coarse = [&](Index v, Index w) {
    return range[std::size_t(v)].high - range[std::size_t(w)].low;
  };
  const double rivals = double(passes.influence.distance.size()) / double(passes.cut.size());
  double pairs = most_products / (double(passes.half.size()) * rivals * rivals);
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
          own = coarse(v, w);  // none of the rest is farther
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

double bound_over(const InfluenceMap& influence, const Box& box, Response response, double found) {
  if (response == Response::InTolerance) return 0.0;
  // at a rim the filter's plane may lie beyond all that it is fitted to
  if (is_filtered(response)) return infinity;
  if (response == Response::Pv)
    return farthest_apart(passes_over(influence, box, common_slope(influence)), found);
  const Passes passes = passes_over(influence, box, no_slope(influence));
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

}  // namespace abbe::sim::study
