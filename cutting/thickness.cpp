#include "cutting/thickness.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace abbe::cutting {

using Eigen::AlignedBox3d;
using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr int leaf_size = 8;
constexpr double triangle_slack = 1e-9;  // of a triangle, so that no line slips between two

/// Whether the line from `start` along `direction` meets the box within `most`.
bool meets(const AlignedBox3d& box, const Vector3d& start, const Vector3d& direction, double most) {
  double from = 0.0, to = most;
  for (int k = 0; k < 3; ++k) {
    if (direction[k] == 0.0) {
      if (start[k] < box.min()[k] || start[k] > box.max()[k]) return false;
      continue;
    }
    const double a = (box.min()[k] - start[k]) / direction[k];
    const double b = (box.max()[k] - start[k]) / direction[k];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  return from <= to;
}

}  // namespace

Thickness::Thickness(const Design& design)
    : design_(design), triangles_(static_cast<std::size_t>(design.triangles.rows())) {
  std::iota(triangles_.begin(), triangles_.end(), 0);
  if (!triangles_.empty()) add_node(0, static_cast<int>(triangles_.size()));
}

AlignedBox3d Thickness::box_of(int triangle) const {
  AlignedBox3d box;
  for (const int corner : design_.triangles.row(triangle))
    box.extend(Vector3d(design_.vertices.row(corner)));
  return box;
}

void Thickness::add_node(int first, int last) {
  AlignedBox3d box, middles;
  for (int i = first; i < last; ++i) {
    const AlignedBox3d one = box_of(triangles_[static_cast<std::size_t>(i)]);
    box.extend(one);
    middles.extend(one.center());
  }
  const std::size_t node = nodes_.size();
  nodes_.push_back({box, first, last - first <= leaf_size ? last - first : 0, 0});
  if (nodes_[node].count > 0) return;
  int widest = 0;
  middles.sizes().maxCoeff(&widest);
  const int middle = (first + last) / 2;
  std::nth_element(triangles_.begin() + first, triangles_.begin() + middle,
                   triangles_.begin() + last, [&](int a, int b) {
                     const double ca = box_of(a).center()[widest], cb = box_of(b).center()[widest];
                     return ca < cb || (ca == cb && a < b);
                   });
  add_node(first, middle);
  nodes_[node].second = static_cast<int>(nodes_.size());
  add_node(middle, last);
}

std::optional<double> Thickness::leaves_through(int triangle, Index vertex) const {
  const auto corners = design_.triangles.row(triangle);
  // at a sharp edge the faces have vertices of their own at one point
  for (const int corner : corners)
    if (design_.vertices.row(corner) == design_.vertices.row(vertex)) return std::nullopt;
  const Vector3d a = design_.vertices.row(corners[0]);
  const Vector3d ab = design_.vertices.row(corners[1]).transpose() - a;
  const Vector3d ac = design_.vertices.row(corners[2]).transpose() - a;
  const Vector3d start = design_.vertices.row(vertex);
  const Vector3d direction = -design_.normals.row(vertex);
  const double out = direction.dot(ab.cross(ac));
  if (!(out > 0.0)) return std::nullopt;  // it enters there, or runs along
  const Vector3d turned = (start - a).cross(direction);
  const double u = -ac.dot(turned) / out, v = ab.dot(turned) / out;
  if (u < -triangle_slack || v < -triangle_slack || u + v > 1.0 + triangle_slack)
    return std::nullopt;
  const double distance = (a - start).dot(ab.cross(ac)) / out;
  return distance > 0.0 ? std::optional(distance) : std::nullopt;
}

std::optional<double> Thickness::behind(Index vertex, double most) const {
  const Vector3d start = design_.vertices.row(vertex);
  const Vector3d direction = -design_.normals.row(vertex);
  double nearest = most;
  bool found = false;
  for (std::vector<int> open(nodes_.empty() ? 0 : 1, 0); !open.empty();) {
    const auto number = static_cast<std::size_t>(open.back());
    const Node& node = nodes_[number];
    open.pop_back();
    if (!meets(node.box, start, direction, nearest)) continue;
    if (node.count == 0) {
      open.push_back(node.second);
      open.push_back(static_cast<int>(number) + 1);
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const auto distance = leaves_through(triangles_[static_cast<std::size_t>(i)], vertex);
      if (!distance || *distance > nearest) continue;
      nearest = *distance;
      found = true;
    }
  }
  return found ? std::optional(nearest) : std::nullopt;
}

}  // namespace abbe::cutting
