#include "cutting/map/residual.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <vector>

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#include <Eigen/Geometry>

#include "cutting/part/compensated_sum.h"
#include "kinematics/hash.h"

namespace abbe::cutting {

namespace {

void check_sizes(const Surface& surface, std::size_t vertex_count) {
  const bool are_equal = static_cast<std::size_t>(surface.residual.size()) == vertex_count &&
                         static_cast<std::size_t>(surface.cut_time_s.size()) == vertex_count &&
                         surface.cut_line.size() == vertex_count &&
                         surface.status.size() == vertex_count;
  if (!are_equal) throw std::invalid_argument("residual map: the arrays differ in size");
}

/// A residual, the area it represents, and its location.
struct WeightedResidual {
  double residual, area;
  int vertex = -1, triangle = -1;
};

/// Returns the cut samples: vertices, then samples within triangles.
std::vector<WeightedResidual> weighted_residuals(const Surface& surface, const Weights& weights) {
  std::vector<WeightedResidual> values;
  for (std::size_t i = 0; i < surface.status.size(); ++i)
    if (surface.status[i] == VertexStatus::Cut)
      values.push_back(
          {surface.residual[Eigen::Index(i)], weights.vertex[Eigen::Index(i)], int(i)});
  for (Eigen::Index t = 0; t < weights.within.size(); ++t)
    if (weights.within[t] > 0.0)
      values.push_back({surface.within[t], weights.within[t], -1, int(t)});
  return values;
}

/// Returns the mean of a function of the residual, weighted by area; `area` is the total.
template <class F>
double weighted_mean(const std::vector<WeightedResidual>& values, double area, const F& f) {
  CompensatedSum sum;
  for (const WeightedResidual& sample : values) sum.add(sample.area * f(sample.residual));
  return sum.value() / area;
}

/// Returns the magnitude that residuals do not exceed on the fraction `q` of the area.
std::optional<double> quantile(std::vector<WeightedResidual> values, double q) {
  // Ties are sorted by area, so that the sums below do not depend on the sorting algorithm.
  tbb::parallel_sort(values.begin(), values.end(),
                     [](const WeightedResidual& a, const WeightedResidual& b) {
                       const double x = std::abs(a.residual), y = std::abs(b.residual);
                       return x != y ? x < y : a.area < b.area;
                     });
  CompensatedSum total_area, cumulative_area;
  for (const WeightedResidual& sample : values) total_area.add(sample.area);
  if (!(total_area.value() > 0.0)) return std::nullopt;
  for (const WeightedResidual& sample : values) {
    cumulative_area.add(sample.area);
    if (cumulative_area.value() >= q * total_area.value()) return std::abs(sample.residual);
  }
  return std::abs(values.back().residual);
}

/// Returns the gouges at the vertices that are gouged in the difference, one per vertex: that of
/// the first map, or else that of the second.
std::vector<Gouge> merge_gouges(const Surface& a, const Surface& b,
                                const std::vector<VertexStatus>& status) {
  std::vector<Gouge> result;
  const auto by_vertex = [](const Gouge& gouge, const Gouge& other) {
    return gouge.vertex < other.vertex;
  };
  std::set_union(a.gouges.begin(), a.gouges.end(), b.gouges.begin(), b.gouges.end(),
                 std::back_inserter(result), by_vertex);
  std::erase_if(result, [&](const Gouge& gouge) {
    return status[static_cast<std::size_t>(gouge.vertex)] != VertexStatus::Gouged;
  });
  return result;
}

using Limits = Eigen::RowVector2d;

bool is_limited(const Limits& limits) {
  return std::isfinite(limits[0]) || std::isfinite(limits[1]);
}

/// Returns the widest limits of the corners of a triangle, so that a border between bands causes no
/// false alarm.
Limits widest_limits(const ToleranceBands& tolerance, const Eigen::RowVector3i& corners) {
  Limits widest = tolerance.row(corners[0]);
  for (const int corner : corners)
    widest = {std::min(widest[0], tolerance(corner, 0)), std::max(widest[1], tolerance(corner, 1))};
  return widest;
}

/// Returns the excess of a residual above the upper limit (+) or below the lower limit (-); 0 if it
/// is within the limits.
double signed_excess(double residual, const Limits& limits) {
  const double above = residual - limits[1], below = limits[0] - residual;
  return above > 0.0 ? above : below > 0.0 ? -below : 0.0;
}

/// Returns the conformance; empty if no judged area has limits.
std::optional<Conformance> conformance(const Surface& surface, const Design& design,
                                       const Weights& weights, const ToleranceBands& tolerance) {
  Conformance result;
  CompensatedSum area_in, area_over, area_under, area_uncut;
  const auto add_area = [&](double excess_of_sample, double area) {
    (excess_of_sample > 0.0 ? area_over : excess_of_sample < 0.0 ? area_under : area_in).add(area);
  };
  struct SampleLocation {
    int vertex = -1, triangle = -1;
  };
  const auto record_excess = [&](const SampleLocation& location, double excess, bool is_bound) {
    if (++result.out_of_tolerance_count > 1 && excess <= result.excess) return;
    result.vertex = location.vertex;
    result.triangle = location.triangle;
    result.excess = excess;
    result.is_lower_bound = is_bound;
  };
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const auto v = static_cast<Eigen::Index>(i);
    if (!is_limited(tolerance.row(v))) continue;
    if (surface.status[i] == VertexStatus::Uncut) {
      area_uncut.add(design.area[v]);
      ++result.uncut_vertices;
    }
    if (surface.status[i] != VertexStatus::Cut) continue;
    const double excess_of_sample = signed_excess(surface.residual[v], tolerance.row(v));
    add_area(excess_of_sample, weights.vertex[v]);
    if (excess_of_sample != 0.0)
      record_excess({.vertex = int(i)}, std::abs(excess_of_sample), false);
  }
  for (Eigen::Index t = 0; t < weights.within.size(); ++t) {
    if (!(weights.within[t] > 0.0)) continue;
    const Limits limits = widest_limits(tolerance, design.triangles.row(t));
    if (!is_limited(limits)) continue;
    const double excess_of_sample = signed_excess(surface.within[t], limits);
    add_area(excess_of_sample, weights.within[t]);
    if (excess_of_sample != 0.0)
      record_excess({.triangle = int(t)}, std::abs(excess_of_sample), false);
  }
  for (const Gouge& gouge : surface.gouges) {
    if (!is_limited(tolerance.row(gouge.vertex))) continue;
    area_under.add(design.area[gouge.vertex]);
    // Without a lower limit the gouge itself is the limit, and the excess is 0.
    const double lower = std::max(tolerance(gouge.vertex, 0), -gouge.depth);
    record_excess({.vertex = gouge.vertex}, lower + gouge.depth, gouge.continues_deeper);
  }
  const double total_area =
      area_in.value() + area_over.value() + area_under.value() + area_uncut.value();
  if (!(total_area > 0.0)) return std::nullopt;
  result.in = 100.0 * area_in.value() / total_area;
  result.over = 100.0 * area_over.value() / total_area;
  result.under = 100.0 * area_under.value() / total_area;
  result.uncut = 100.0 * area_uncut.value() / total_area;
  return result;
}

}  // namespace

std::array<double, 3> sample_barycentric(Surface::InteriorSample within, Eigen::Index t) {
  if (within != Surface::InteriorSample::Random) return {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0};
  const auto random_number = [&](std::uint64_t k) {
    return split_mix::unit(split_mix::stream(k, std::uint64_t(t)));
  };
  // The square root makes the samples uniform in area.
  const double root = std::sqrt(random_number(0)), fraction = random_number(1);
  return {1.0 - root, root * (1.0 - fraction), root * fraction};
}

Eigen::Vector3d value_at_sample(Surface::InteriorSample within, const Points& rows,
                                const Triangles& triangles, Eigen::Index t) {
  const std::array<double, 3> fractions = sample_barycentric(within, t);
  Eigen::Vector3d interpolated = Eigen::Vector3d::Zero();
  for (Eigen::Index k = 0; k < 3; ++k)
    interpolated += fractions[std::size_t(k)] * rows.row(triangles(t, k)).transpose();
  return interpolated;
}

double value_at_sample(Surface::InteriorSample within, const Eigen::VectorXd& values,
                       const Triangles& triangles, Eigen::Index t) {
  const std::array<double, 3> fractions = sample_barycentric(within, t);
  double interpolated = 0.0;
  for (Eigen::Index k = 0; k < 3; ++k)
    interpolated += fractions[std::size_t(k)] * values[triangles(t, k)];
  return interpolated;
}

Weights weights(const Surface& surface, const Design& design) {
  const auto vertex_count = static_cast<std::size_t>(design.vertices.rows());
  check_sizes(surface, vertex_count);
  const Eigen::Index sample_count = surface.within.size();
  if (static_cast<std::size_t>(design.area.size()) != vertex_count)
    throw std::invalid_argument("statistics: expected one area per vertex");
  if (sample_count != 0 && sample_count != design.triangles.rows())
    throw std::invalid_argument("statistics: expected one sample per triangle, or none");
  // Three quarters for a sample in the middle is exact for a quadratic residual.
  const double triangle_fraction =
      surface.interior_sample == Surface::InteriorSample::Random ? 1.0 : 0.75;
  Weights result{design.area, Eigen::VectorXd::Zero(sample_count)};
  for (std::size_t i = 0; i < vertex_count; ++i)
    if (surface.status[i] != VertexStatus::Cut) result.vertex[static_cast<Eigen::Index>(i)] = 0.0;
  Eigen::VectorXd area = Eigen::VectorXd::Zero(sample_count);
  tbb::parallel_for(Eigen::Index(0), sample_count, [&](Eigen::Index t) {
    if (!std::isfinite(surface.within[t])) return;
    const Eigen::RowVector3i corners = design.triangles.row(t);
    const Eigen::Vector3d a = design.vertices.row(corners[0]), b = design.vertices.row(corners[1]),
                          c = design.vertices.row(corners[2]);
    area[t] = 0.5 * (b - a).cross(c - a).norm();
    result.within[t] = triangle_fraction * area[t];
  });
  for (Eigen::Index t = 0; t < sample_count; ++t)
    if (area[t] > 0.0)
      for (const int corner : design.triangles.row(t))
        result.vertex[corner] =
            std::max(0.0, result.vertex[corner] - triangle_fraction / 3.0 * area[t]);
  return result;
}

namespace {

/// Returns the numbers of vertices by status.
Statistics count_vertices(const Surface& surface) {
  Statistics result;
  result.vertices = static_cast<int>(surface.status.size());
  const auto count = [&](VertexStatus status) {
    return static_cast<int>(std::count(surface.status.begin(), surface.status.end(), status));
  };
  result.cut_vertices = count(VertexStatus::Cut);
  result.uncut_vertices = count(VertexStatus::Uncut);
  result.outside_vertices = count(VertexStatus::Outside);
  result.gouged_vertices = count(VertexStatus::Gouged);
  for (const Gouge& gouge : surface.gouges)
    if (!result.deepest || gouge.depth > result.deepest->depth) result.deepest = gouge;
  return result;
}

}  // namespace

Surface without_triangle_samples(Surface surface) {
  surface.interior_sample = Surface::InteriorSample::None;
  surface.within.resize(0);
  return surface;
}

Statistics statistics(const Surface& surface, const Design& design,
                      const ToleranceBands& tolerance) {
  const Weights weights = cutting::weights(surface, design);
  const auto vertex_count = static_cast<std::size_t>(design.vertices.rows());
  if (tolerance.rows() != 0 && static_cast<std::size_t>(tolerance.rows()) != vertex_count)
    throw std::invalid_argument("statistics: expected one tolerance band per vertex");
  Statistics result = count_vertices(surface);
  const std::vector<WeightedResidual> residuals = weighted_residuals(surface, weights);
  for (const WeightedResidual& sample : residuals) {
    if (!std::isfinite(sample.residual))
      throw std::invalid_argument("statistics: a cut vertex has no residual");
    const SampleValue value{sample.vertex, sample.triangle, sample.residual};
    if (!result.lowest || value.value < result.lowest->value) result.lowest = value;
    if (!result.highest || value.value > result.highest->value) result.highest = value;
  }
  if (tolerance.rows() > 0) result.conformance = conformance(surface, design, weights, tolerance);
  if (residuals.empty()) return result;

  result.min = result.lowest->value;
  result.max = result.highest->value;
  result.pv = *result.max - *result.min;
  result.p95_abs = quantile(residuals, 0.95);
  CompensatedSum sum;
  for (const WeightedResidual& sample : residuals) sum.add(sample.area);
  const double area = sum.value();
  if (!(area > 0.0)) return result;
  result.mean = weighted_mean(residuals, area, [](double r) { return r; });
  result.rms = std::sqrt(weighted_mean(residuals, area, [](double r) { return r * r; }));
  result.std_dev = std::sqrt(weighted_mean(
      residuals, area, [&](double r) { return (r - *result.mean) * (r - *result.mean); }));
  return result;
}

const char* sample_values_name(Surface::InteriorSample within) {
  switch (within) {
    case Surface::InteriorSample::None:
      return "";
    case Surface::InteriorSample::Middle:
      return "middle_um";
    case Surface::InteriorSample::Random:
      return "random_um";
  }
  return "";
}

VertexStatus worse_status(VertexStatus a, VertexStatus b) {
  // In order from the worst to the best.
  for (const VertexStatus status :
       {VertexStatus::Outside, VertexStatus::Gouged, VertexStatus::Uncut})
    if (a == status || b == status) return status;
  return VertexStatus::Cut;
}

Surface minus(const Surface& a, const Surface& b) {
  const std::size_t vertex_count = a.status.size();
  check_sizes(a, vertex_count);
  check_sizes(b, vertex_count);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Surface result = a;
  for (std::size_t i = 0; i < vertex_count; ++i) {
    const VertexStatus status = worse_status(a.status[i], b.status[i]);
    const auto v = static_cast<Eigen::Index>(i);
    const bool is_cut = status == VertexStatus::Cut;
    result.status[i] = status;
    result.residual[v] = is_cut ? a.residual[v] - b.residual[v] : nan;
    if (is_cut || (status == VertexStatus::Gouged && a.status[i] == status)) continue;
    const bool is_second_gouge = status == VertexStatus::Gouged;
    result.cut_time_s[v] = is_second_gouge ? b.cut_time_s[v] : nan;
    result.cut_line[i] = is_second_gouge ? b.cut_line[i] : 0;
  }
  result.gouges = merge_gouges(a, b, result.status);
  // Samples at different points have no difference.
  if (a.interior_sample == b.interior_sample && a.within.size() == b.within.size()) {
    result.within = a.within - b.within;
  } else {
    result.interior_sample = Surface::InteriorSample::None;
    result.within.resize(0);
  }
  return result;
}

}  // namespace abbe::cutting
