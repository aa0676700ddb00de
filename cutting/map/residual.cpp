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

void check_sizes(const Surface& surface, std::size_t n) {
  const bool equal = static_cast<std::size_t>(surface.residual.size()) == n &&
                     static_cast<std::size_t>(surface.cut_time_s.size()) == n &&
                     surface.cut_line.size() == n && surface.status.size() == n;
  if (!equal) throw std::invalid_argument("residual map: arrays of different sizes");
}

/// A residual, the area it represents, and its location.
struct Weighted {
  double residual, area;
  int vertex = -1, triangle = -1;
};

/// Returns the cut samples: vertices, then samples within triangles.
std::vector<Weighted> weighted(const Surface& surface, const Weights& weights) {
  std::vector<Weighted> values;
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
double mean_of(const std::vector<Weighted>& values, double area, const F& f) {
  Sum sum;
  for (const Weighted& one : values) sum.add(one.area * f(one.residual));
  return sum.value() / area;
}

/// Returns the least magnitude such that residuals up to it make up the fraction `q` of the area.
std::optional<double> quantile(std::vector<Weighted> values, double q) {
  // Ties by area, so that the sums below do not depend on the sort.
  tbb::parallel_sort(values.begin(), values.end(), [](const Weighted& a, const Weighted& b) {
    const double x = std::abs(a.residual), y = std::abs(b.residual);
    return x != y ? x < y : a.area < b.area;
  });
  Sum all, upto;
  for (const Weighted& one : values) all.add(one.area);
  if (!(all.value() > 0.0)) return std::nullopt;
  for (const Weighted& one : values) {
    upto.add(one.area);
    if (upto.value() >= q * all.value()) return std::abs(one.residual);
  }
  return std::abs(values.back().residual);
}

/// Returns the gouges of both maps at the vertices that are gouged in the difference, one per
/// vertex, preferring the first map.
std::vector<Gouge> joined(const Surface& a, const Surface& b,
                          const std::vector<VertexStatus>& status) {
  std::vector<Gouge> both;
  const auto by_vertex = [](const Gouge& one, const Gouge& other) {
    return one.vertex < other.vertex;
  };
  std::set_union(a.gouges.begin(), a.gouges.end(), b.gouges.begin(), b.gouges.end(),
                 std::back_inserter(both), by_vertex);
  std::erase_if(both, [&](const Gouge& one) {
    return status[static_cast<std::size_t>(one.vertex)] != VertexStatus::Gouged;
  });
  return both;
}

using Limits = Eigen::RowVector2d;

bool is_limited(const Limits& limits) {
  return std::isfinite(limits[0]) || std::isfinite(limits[1]);
}

// Returns the widest limits of the corners of a triangle, so that a border between bands makes no
// false alarm.
Limits widest_limits(const ToleranceBands& tolerance, const Eigen::RowVector3i& corners) {
  Limits widest = tolerance.row(corners[0]);
  for (const int corner : corners)
    widest = {std::min(widest[0], tolerance(corner, 0)), std::max(widest[1], tolerance(corner, 1))};
  return widest;
}

/// Returns by how much a residual is above its limits (+) or below them (-); 0 within.
double beyond(double residual, const Limits& limits) {
  const double high = residual - limits[1], low = limits[0] - residual;
  return high > 0.0 ? high : low > 0.0 ? -low : 0.0;
}

/// Returns the conformance; nothing if no area is judged.
std::optional<Conformance> conformance(const Surface& surface, const Design& design,
                                       const Weights& weights, const ToleranceBands& tolerance) {
  Conformance c;
  Sum in, over, under, uncut;
  const auto count = [&](double off, double area) {
    (off > 0.0 ? over : off < 0.0 ? under : in).add(area);
  };
  struct Where {
    int vertex = -1, triangle = -1;
  };
  const auto found_out = [&](const Where& at, double excess, bool further) {
    if (++c.out_of_tolerance > 1 && excess <= c.excess) return;
    c.vertex = at.vertex;
    c.triangle = at.triangle;
    c.excess = excess;
    c.further = further;
  };
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    const auto v = static_cast<Eigen::Index>(i);
    if (!is_limited(tolerance.row(v))) continue;
    if (surface.status[i] == VertexStatus::Uncut) {
      uncut.add(design.area[v]);
      ++c.uncut_vertices;
    }
    if (surface.status[i] != VertexStatus::Cut) continue;
    const double off = beyond(surface.residual[v], tolerance.row(v));
    count(off, weights.vertex[v]);
    if (off != 0.0) found_out({.vertex = int(i)}, std::abs(off), false);
  }
  for (Eigen::Index t = 0; t < weights.within.size(); ++t) {
    if (!(weights.within[t] > 0.0)) continue;
    const Limits limits = widest_limits(tolerance, design.triangles.row(t));
    if (!is_limited(limits)) continue;
    const double off = beyond(surface.within[t], limits);
    count(off, weights.within[t]);
    if (off != 0.0) found_out({.triangle = int(t)}, std::abs(off), false);
  }
  for (const Gouge& gouge : surface.gouges) {
    if (!is_limited(tolerance.row(gouge.vertex))) continue;
    under.add(design.area[gouge.vertex]);
    // Without a lower limit the gouge itself is the limit, and the excess is 0.
    const double lower = std::max(tolerance(gouge.vertex, 0), -gouge.depth);
    found_out({.vertex = gouge.vertex}, lower + gouge.depth, gouge.deeper);
  }
  const double all = in.value() + over.value() + under.value() + uncut.value();
  if (!(all > 0.0)) return std::nullopt;
  c.in = 100.0 * in.value() / all;
  c.over = 100.0 * over.value() / all;
  c.under = 100.0 * under.value() / all;
  c.uncut = 100.0 * uncut.value() / all;
  return c;
}

}  // namespace

std::array<double, 3> place_within(Surface::Within within, Eigen::Index t) {
  if (within != Surface::Within::Random) return {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0};
  const auto chance = [&](std::uint64_t k) {
    return split_mix::unit(split_mix::stream(k, std::uint64_t(t)));
  };
  // the square root makes the samples uniform in area
  const double root = std::sqrt(chance(0)), share = chance(1);
  return {1.0 - root, root * (1.0 - share), root * share};
}

Eigen::Vector3d value_at_place_within(Surface::Within within, const Points& rows,
                                      const Triangles& triangles, Eigen::Index t) {
  const std::array<double, 3> share = place_within(within, t);
  Eigen::Vector3d blend = Eigen::Vector3d::Zero();
  for (Eigen::Index k = 0; k < 3; ++k)
    blend += share[std::size_t(k)] * rows.row(triangles(t, k)).transpose();
  return blend;
}

double value_at_place_within(Surface::Within within, const Eigen::VectorXd& values,
                             const Triangles& triangles, Eigen::Index t) {
  const std::array<double, 3> share = place_within(within, t);
  double blend = 0.0;
  for (Eigen::Index k = 0; k < 3; ++k) blend += share[std::size_t(k)] * values[triangles(t, k)];
  return blend;
}

Weights weights(const Surface& surface, const Design& design) {
  const auto n = static_cast<std::size_t>(design.vertices.rows());
  check_sizes(surface, n);
  const Eigen::Index m = surface.within.size();
  if (static_cast<std::size_t>(design.area.size()) != n)
    throw std::invalid_argument("statistics: the design has no area for every vertex");
  if (m != 0 && m != design.triangles.rows())
    throw std::invalid_argument("statistics: one place within a triangle is needed, or none");
  // three quarters for a sample in the middle: exact for a quadratic residual
  const double share = surface.sampled_within == Surface::Within::Random ? 1.0 : 0.75;
  Weights w{design.area, Eigen::VectorXd::Zero(m)};
  for (std::size_t i = 0; i < n; ++i)
    if (surface.status[i] != VertexStatus::Cut) w.vertex[static_cast<Eigen::Index>(i)] = 0.0;
  Eigen::VectorXd area = Eigen::VectorXd::Zero(m);
  tbb::parallel_for(Eigen::Index(0), m, [&](Eigen::Index t) {
    if (!std::isfinite(surface.within[t])) return;
    const Eigen::RowVector3i corners = design.triangles.row(t);
    const Eigen::Vector3d a = design.vertices.row(corners[0]), b = design.vertices.row(corners[1]),
                          c = design.vertices.row(corners[2]);
    area[t] = 0.5 * (b - a).cross(c - a).norm();
    w.within[t] = share * area[t];
  });
  for (Eigen::Index t = 0; t < m; ++t)
    if (area[t] > 0.0)
      for (const int corner : design.triangles.row(t))
        w.vertex[corner] = std::max(0.0, w.vertex[corner] - share / 3.0 * area[t]);
  return w;
}

namespace {

/// Returns the numbers of vertices by status.
Statistics counted(const Surface& surface) {
  Statistics s;
  s.vertices = static_cast<int>(surface.status.size());
  const auto count = [&](VertexStatus status) {
    return static_cast<int>(std::count(surface.status.begin(), surface.status.end(), status));
  };
  s.cut_vertices = count(VertexStatus::Cut);
  s.uncut_vertices = count(VertexStatus::Uncut);
  s.outside_vertices = count(VertexStatus::Outside);
  s.gouged_vertices = count(VertexStatus::Gouged);
  for (const Gouge& gouge : surface.gouges)
    if (!s.deepest || gouge.depth > s.deepest->depth) s.deepest = gouge;
  return s;
}

}  // namespace

Surface at_vertices(Surface surface) {
  surface.sampled_within = Surface::Within::None;
  surface.within.resize(0);
  return surface;
}

Statistics statistics(const Surface& surface, const Design& design,
                      const ToleranceBands& tolerance) {
  const Weights weights = cutting::weights(surface, design);
  const auto n = static_cast<std::size_t>(design.vertices.rows());
  if (tolerance.rows() != 0 && static_cast<std::size_t>(tolerance.rows()) != n)
    throw std::invalid_argument("statistics: one band of tolerance a vertex is needed");
  Statistics s = counted(surface);
  const std::vector<Weighted> cut = weighted(surface, weights);
  for (const Weighted& one : cut) {
    if (!std::isfinite(one.residual))
      throw std::invalid_argument("statistics: a cut vertex without a residual");
    const SampleValue value{one.vertex, one.triangle, one.residual};
    if (!s.lowest || value.value < s.lowest->value) s.lowest = value;
    if (!s.highest || value.value > s.highest->value) s.highest = value;
  }
  if (tolerance.rows() > 0) s.conformance = conformance(surface, design, weights, tolerance);
  if (cut.empty()) return s;

  s.min = s.lowest->value;
  s.max = s.highest->value;
  s.pv = *s.max - *s.min;
  s.p95_abs = quantile(cut, 0.95);
  Sum sum;
  for (const Weighted& one : cut) sum.add(one.area);
  const double area = sum.value();
  if (!(area > 0.0)) return s;
  s.mean = mean_of(cut, area, [](double r) { return r; });
  s.rms = std::sqrt(mean_of(cut, area, [](double r) { return r * r; }));
  s.std_dev =
      std::sqrt(mean_of(cut, area, [&](double r) { return (r - *s.mean) * (r - *s.mean); }));
  return s;
}

const char* within_values_name(Surface::Within within) {
  switch (within) {
    case Surface::Within::None:
      return "";
    case Surface::Within::Middle:
      return "middle_um";
    case Surface::Within::Random:
      return "random_um";
  }
  return "";
}

VertexStatus worse(VertexStatus a, VertexStatus b) {
  // From the worst to the best.
  for (const VertexStatus one : {VertexStatus::Outside, VertexStatus::Gouged, VertexStatus::Uncut})
    if (a == one || b == one) return one;
  return VertexStatus::Cut;
}

Surface minus(const Surface& a, const Surface& b) {
  const std::size_t n = a.status.size();
  check_sizes(a, n);
  check_sizes(b, n);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Surface difference = a;
  for (std::size_t i = 0; i < n; ++i) {
    const VertexStatus status = worse(a.status[i], b.status[i]);
    const auto v = static_cast<Eigen::Index>(i);
    const bool cut = status == VertexStatus::Cut;
    difference.status[i] = status;
    difference.residual[v] = cut ? a.residual[v] - b.residual[v] : nan;
    if (cut || (status == VertexStatus::Gouged && a.status[i] == status)) continue;
    const bool second = status == VertexStatus::Gouged;
    difference.cut_time_s[v] = second ? b.cut_time_s[v] : nan;
    difference.cut_line[i] = second ? b.cut_line[i] : 0;
  }
  difference.gouges = joined(a, b, difference.status);
  // Samples at different points have no difference.
  if (a.sampled_within == b.sampled_within && a.within.size() == b.within.size()) {
    difference.within = a.within - b.within;
  } else {
    difference.sampled_within = Surface::Within::None;
    difference.within.resize(0);
  }
  return difference;
}

}  // namespace abbe::cutting
