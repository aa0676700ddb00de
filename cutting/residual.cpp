#include "cutting/residual.h"

#include <algorithm>
#include <cmath>
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
  if (magnitude.empty()) return s;

  s.pv = *s.max - *s.min;
  s.p95_abs = quantile(magnitude, 0.95);
  if (tolerance) {
    const auto within = std::count_if(magnitude.begin(), magnitude.end(),
                                      [&](double m) { return m <= *tolerance; });
    s.in_tolerance_percent = 100.0 * double(within) / double(magnitude.size());
  }
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

Surface minus(const Surface& a, const Surface& b) {
  const std::size_t n = a.status.size();
  check_sizes(a, n);
  check_sizes(b, n);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Surface difference = a;
  for (std::size_t i = 0; i < n; ++i) {
    // Cut < Uncut < Outside: the worse of the two holds
    const VertexStatus status = std::max(a.status[i], b.status[i]);
    const auto v = static_cast<Eigen::Index>(i);
    const bool cut = status == VertexStatus::Cut;
    difference.status[i] = status;
    difference.residual[v] = cut ? a.residual[v] - b.residual[v] : nan;
    if (cut) continue;
    difference.cut_time_s[v] = nan;
    difference.cut_line[i] = 0;
  }
  return difference;
}

}  // namespace abbe::cutting
