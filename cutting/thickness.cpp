#include "cutting/thickness.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "cutting/segment_grid.h"

namespace abbe::cutting {

using Eigen::AlignedBox3d;
using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr int leaf_size = 8;
constexpr double triangle_slack = 1e-9;  // of a triangle, so that no line slips between two
constexpr double touch = 1e-9;           // mm

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
    : vertices_(design.vertices),
      corners_(design.triangles),
      triangles_(static_cast<std::size_t>(design.triangles.rows())) {
  std::iota(triangles_.begin(), triangles_.end(), 0);
  if (triangles_.empty()) return;
  Points middles(corners_.rows(), 3);
  for (Index t = 0; t < corners_.rows(); ++t) middles.row(t) = box_of(static_cast<int>(t)).center();
  add_node(0, static_cast<int>(triangles_.size()), middles);
}

AlignedBox3d Thickness::box_of(int triangle) const {
  AlignedBox3d box;
  for (const int corner : corners_.row(triangle)) box.extend(Vector3d(vertices_.row(corner)));
  // A place at the rim lies beyond it by rounding, and its line runs along a side of the box.
  return {box.min().array() - touch, box.max().array() + touch};
}

void Thickness::add_node(int first, int last, const Points& middles) {
  AlignedBox3d box, spread;
  for (int i = first; i < last; ++i) {
    const int triangle = triangles_[static_cast<std::size_t>(i)];
    box.extend(box_of(triangle));
    spread.extend(Vector3d(middles.row(triangle)));
  }
  const std::size_t node = nodes_.size();
  nodes_.push_back({box, first, last - first <= leaf_size ? last - first : 0, 0});
  if (nodes_[node].count > 0) return;
  int widest = 0;
  spread.sizes().maxCoeff(&widest);
  const int middle = (first + last) / 2;
  std::nth_element(triangles_.begin() + first, triangles_.begin() + middle,
                   triangles_.begin() + last, [&](int a, int b) {
                     const double ca = middles(a, widest), cb = middles(b, widest);
                     return ca < cb || (ca == cb && a < b);
                   });
  add_node(first, middle, middles);
  nodes_[node].second = static_cast<int>(nodes_.size());
  add_node(middle, last, middles);
}

std::optional<double> Thickness::leaves_through(int triangle, const Vector3d& place,
                                                const Vector3d& direction) const {
  const auto corners = corners_.row(triangle);
  const Vector3d a = vertices_.row(corners[0]);
  const Vector3d ab = vertices_.row(corners[1]).transpose() - a;
  const Vector3d ac = vertices_.row(corners[2]).transpose() - a;
  const Vector3d outward = ab.cross(ac);
  const double out = direction.dot(outward);
  const double height = (a - place).dot(outward);
  if (!(out > 0.0)) return std::nullopt;  // it enters there, or runs along
  if (!(height > touch * outward.norm())) return std::nullopt;
  const Vector3d turned = (place - a).cross(direction);
  const double u = -ac.dot(turned) / out, v = ab.dot(turned) / out;
  if (u < -triangle_slack || v < -triangle_slack || u + v > 1.0 + triangle_slack)
    return std::nullopt;
  return height / out;
}

std::optional<double> Thickness::behind(const Vector3d& place, const Vector3d& normal,
                                        double most) const {
  const Vector3d direction = -normal;
  double nearest = most;
  bool found = false;
  for (std::vector<int> open(nodes_.empty() ? 0 : 1, 0); !open.empty();) {
    const auto number = static_cast<std::size_t>(open.back());
    const Node& node = nodes_[number];
    open.pop_back();
    if (!meets(node.box, place, direction, nearest)) continue;
    if (node.count == 0) {
      open.push_back(node.second);
      open.push_back(static_cast<int>(number) + 1);
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const auto distance =
          leaves_through(triangles_[static_cast<std::size_t>(i)], place, direction);
      if (!distance || *distance > nearest) continue;
      nearest = *distance;
      found = true;
    }
  }
  return found ? std::optional(nearest) : std::nullopt;
}

double Thickness::distance_to(int triangle, const Vector3d& place) const {
  const auto corners = corners_.row(triangle);
  const Vector3d a = vertices_.row(corners[0]), b = vertices_.row(corners[1]),
                 c = vertices_.row(corners[2]);
  const Vector3d normal = (b - a).cross(c - a);
  const auto is_inside = [&](const Vector3d& from, const Vector3d& to) {
    return normal.dot((to - from).cross(place - from)) >= 0.0;
  };
  if (normal.squaredNorm() > 0.0 && is_inside(a, b) && is_inside(b, c) && is_inside(c, a)) {
    const double height = normal.dot(place - a);
    return std::abs(height) / normal.norm();
  }
  return std::min({distance(place, {a, b}), distance(place, {b, c}), distance(place, {c, a})});
}

bool Thickness::comes_within(const Vector3d& place, double distance) const {
  for (std::vector<int> open(nodes_.empty() ? 0 : 1, 0); !open.empty();) {
    const auto number = static_cast<std::size_t>(open.back());
    const Node& node = nodes_[number];
    open.pop_back();
    if (node.box.squaredExteriorDistance(place) > distance * distance) continue;
    if (node.count == 0) {
      open.push_back(node.second);
      open.push_back(static_cast<int>(number) + 1);
    }
    for (int i = node.first; i < node.first + node.count; ++i)
      if (distance_to(triangles_[static_cast<std::size_t>(i)], place) <= distance) return true;
  }
  return false;
}

}  // namespace abbe::cutting
