#include "cutting/leftover.h"

#include <limits>
#include <stdexcept>

#include <tbb/parallel_for.h>

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double slack = 0.02;        // of the corner's radius
constexpr double least_rise = slack;  // mm per mm, the slope of the round where it is kept
constexpr double most_kept = 0.5 * slack * slack;  // of the radius, its height there

/// The vertices that share an edge or a seam with each vertex, one after the other.
struct Neighbours {
  std::vector<int> first;  // (n + 1)
  std::vector<int> vertex;
};

Neighbours neighbours(const Design& design) {
  Neighbours all{std::vector<int>(std::size_t(design.vertices.rows()) + 1, 0), {}};
  const auto each_pair = [&](const auto& act) {
    for (const auto& t : design.triangles.rowwise())
      for (int k = 0; k < 3; ++k) {  // a border has one triangle, so both ways are listed
        act(t[k], t[(k + 1) % 3]);
        act(t[(k + 1) % 3], t[k]);
      }
    for (const auto& [a, b] : design.seams) {
      act(a, b);
      act(b, a);
    }
  };
  each_pair([&](int from, int) { ++all.first[std::size_t(from) + 1]; });
  for (std::size_t i = 1; i < all.first.size(); ++i) all.first[i] += all.first[i - 1];
  all.vertex.resize(std::size_t(all.first.back()));
  std::vector<int> next(all.first.begin(), all.first.end() - 1);
  each_pair([&](int from, int to) { all.vertex[std::size_t(next[std::size_t(from)]++)] = to; });
  return all;
}

}  // namespace

std::vector<std::uint8_t> out_of_corner(const Design& design, const Surface& surface,
                                        const Thickness& part, double radius) {
  std::vector<std::uint8_t> out(surface.status.size(), 0);
  if (!(radius > 0.0)) return out;
  tbb::parallel_for(std::size_t(0), out.size(), [&](std::size_t i) {
    const auto v = Index(i);
    if (surface.status[i] != VertexStatus::Cut ||
        !(surface.residual[v] > 0.25 * most_kept * radius))
      return;
    const Vector3d centre = design.vertices.row(v) + radius * design.normals.row(v);
    out[i] = part.comes_within(centre, (1.0 - slack) * radius);
  });
  return out;
}

std::vector<std::uint8_t> run_out_beside(const Design& design, const Surface& surface,
                                         double radius, const std::vector<std::uint8_t>& listed) {
  const std::size_t n = surface.status.size();
  if (std::size_t(design.vertices.rows()) != n || listed.size() != n)
    throw std::invalid_argument("run_out_beside: one status and one mark a vertex");
  std::vector<int> open;
  for (std::size_t i = 0; i < n; ++i)
    if (listed[i] || surface.status[i] == VertexStatus::Uncut) open.push_back(int(i));
  std::vector<std::uint8_t> found(n, 0);
  if (open.empty()) return found;
  const Neighbours around = neighbours(design);
  const auto height = [&](int v) {
    return surface.status[std::size_t(v)] == VertexStatus::Uncut ? infinity : surface.residual[v];
  };
  while (!open.empty()) {
    const int from = open.back();
    open.pop_back();
    for (int k = around.first[std::size_t(from)]; k < around.first[std::size_t(from) + 1]; ++k) {
      const int to = around.vertex[std::size_t(k)];
      const auto t = std::size_t(to);
      if (found[t] || listed[t] || surface.status[t] != VertexStatus::Cut) continue;
      const double length = (design.vertices.row(from) - design.vertices.row(to)).norm();
      const double fall = height(from) - surface.residual[to];
      if (!(fall >= least_rise * length) || !(surface.residual[to] > most_kept * radius)) continue;
      found[t] = 1;
      open.push_back(to);
    }
  }
  return found;
}

}  // namespace abbe::cutting
