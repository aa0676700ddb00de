#include "cutting/residual.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <vector>

#include "cutting/sum.h"

namespace abbe::cutting {
namespace {

void check_sizes(const Surface& surface, std::size_t n) {
  const bool equal = static_cast<std::size_t>(surface.residual.size()) == n &&
                     static_cast<std::size_t>(surface.cut_time_s.size()) == n &&
                     surface.cut_line.size() == n && surface.status.size() == n;
  if (!equal) throw std::invalid_argument("residual map: arrays of different sizes");
}

double quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  const double rank = q * (double(values.size()) - 1.0);
  const auto below = static_cast<std::size_t>(rank);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (rank - double(below)) * (values[above] - values[below]);
}

/// Those of both at the vertices that are gouged, one a vertex, the first's before the second's.
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

}  // namespace

Statistics statistics(const Surface& surface, const Design& design,
                      std::optional<double> tolerance) {
  const auto n = static_cast<std::size_t>(design.vertices.rows());
  check_sizes(surface, n);
  if (static_cast<std::size_t>(design.area.size()) != n)
    throw std::invalid_argument("statistics: the design has no area for every vertex");

  Statistics s;
  s.vertices = static_cast<int>(n);
  std::vector<double> magnitude;
  Sum area, first;
  for (std::size_t i = 0; i < n; ++i) {
    if (surface.status[i] == VertexStatus::Uncut) ++s.uncut_vertices;
    if (surface.status[i] == VertexStatus::Outside) ++s.outside_vertices;
    if (surface.status[i] == VertexStatus::Gouged) ++s.gouged_vertices;
    if (surface.status[i] != VertexStatus::Cut) continue;
    const auto v = static_cast<Eigen::Index>(i);
    const double r = surface.residual[v];
    if (!std::isfinite(r))
      throw std::invalid_argument("statistics: a cut vertex without a residual");
    magnitude.push_back(std::abs(r));
    area.add(design.area[v]);
    first.add(design.area[v] * r);
    s.min = s.min ? std::min(*s.min, r) : r;
    s.max = s.max ? std::max(*s.max, r) : r;
  }
  s.cut_vertices = static_cast<int>(magnitude.size());
  for (const Gouge& gouge : surface.gouges)
    if (!s.deepest || gouge.depth > s.deepest->depth) s.deepest = gouge;
  if (tolerance && s.cut_vertices + s.gouged_vertices > 0) {
    const auto within = std::count_if(magnitude.begin(), magnitude.end(),
                                      [&](double m) { return m <= *tolerance; });
    s.in_tolerance_percent = 100.0 * double(within) / double(s.cut_vertices + s.gouged_vertices);
  }
  if (magnitude.empty()) return s;

  s.pv = *s.max - *s.min;
  s.p95_abs = quantile(magnitude, 0.95);
  if (!(area.value() > 0.0)) return s;
  s.mean = first.value() / area.value();
  Sum square, about;
  for (std::size_t i = 0; i < n; ++i) {
    if (surface.status[i] != VertexStatus::Cut) continue;
    const auto v = static_cast<Eigen::Index>(i);
    const double r = surface.residual[v];
    square.add(design.area[v] * r * r);
    about.add(design.area[v] * (r - *s.mean) * (r - *s.mean));
  }
  s.rms = std::sqrt(square.value() / area.value());
  s.std_dev = std::sqrt(about.value() / area.value());
  return s;
}

VertexStatus worse(VertexStatus a, VertexStatus b) {
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
  return difference;
}

}  // namespace abbe::cutting
