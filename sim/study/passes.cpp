#include "sim/study/passes.h"

#include <cmath>
#include <limits>

#include <tbb/parallel_for.h>

#include "kinematics/numbers.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

double weighted_magnitude(const auto& slope, const VectorXd& half) {
  double sum = 0.0;
  for (Index i = 0; i < half.size(); ++i) sum += std::abs(slope[i]) * half[i];
  return sum;
}

HeightRange lift_of(double half_curvature, double middle, double magnitude) {
  const double most = std::abs(middle) + magnitude;
  const double least = std::max(0.0, std::abs(middle) - magnitude);
  const double a = half_curvature * least * least, b = half_curvature * most * most;
  return {std::min(a, b), std::max(a, b)};
}

/// Where a vertex can be in the box.
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

Passes passes_over(const InfluenceMap& influence, const Box& box, const VectorXd& common) {
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
    passes.lift[std::size_t(r)] = lift_of(influence.half_curvature[r], across,
                                          weighted_magnitude(influence.shift.col(r), passes.half));
  });
  for (std::size_t v = 0; v + 1 < influence.first.size(); ++v) {
    if (influence.first[v] < influence.first[v + 1]) passes.cut.push_back(Index(v));
    for (Index r = influence.first[v]; r < influence.first[v + 1]; ++r)
      passes.middle[r] -= influence.error_free[Index(v)];
  }
  return passes;
}

VectorXd no_slope(const InfluenceMap& influence) { return VectorXd::Zero(influence.slope.rows()); }

VectorXd common_slope(const InfluenceMap& influence) {
  if (influence.slope.cols() == 0) return no_slope(influence);
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

}  // namespace abbe::sim::study
