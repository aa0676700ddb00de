#include "cutting/triangle_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <tbb/parallel_invoke.h>

namespace abbe::cutting {

using Eigen::AlignedBox3d;
using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr int leaf_most = 4;
constexpr int alone = 4096;         // triangles that are not worth a task of their own
constexpr double ray_slack = 1e-9;  // of a triangle, so that no ray slips between two
constexpr double touch = 1e-9;      // mm

/// Nodes of a tree of n triangles and of n + 1.
std::pair<int, int> nodes_of(int n) {
  if (n < leaf_most) return {1, 1};
  const auto [half, more] = nodes_of(n / 2);
  const int even = 1 + 2 * half, odd = 1 + half + more;
  const int here = n <= leaf_most ? 1 : (n % 2 == 0 ? even : odd);
  return {here, n % 2 == 0 ? odd : 1 + 2 * more};
}

/// Whether a ray meets the box within `most`. A place at the rim lies beyond it by rounding, and
/// its ray runs along a side of the box.
bool is_met(const AlignedBox3d& box, const Vector3d& start, const Vector3d& direction,
            double most) {
  double from = 0.0, to = most;
  for (int k = 0; k < 3; ++k) {
    const double low = box.min()[k] - touch, high = box.max()[k] + touch;
    if (direction[k] == 0.0) {
      if (start[k] < low || start[k] > high) return false;
      continue;
    }
    const double a = (low - start[k]) / direction[k], b = (high - start[k]) / direction[k];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  return from <= to;
}

}  // namespace

TriangleTree::TriangleTree(Points vertices, Triangles triangles)
    : vertices_(std::move(vertices)),
      corners_(std::move(triangles)),
      order_(std::size_t(corners_.rows())) {
  std::iota(order_.begin(), order_.end(), 0);
  if (order_.empty()) return;
  Points middles(corners_.rows(), 3);
  for (Index t = 0; t < corners_.rows(); ++t)
    middles.row(t) = (vertices_.row(corners_(t, 0)) + vertices_.row(corners_(t, 1)) +
                      vertices_.row(corners_(t, 2))) /
                     3.0;
  nodes_.resize(std::size_t(nodes_of(int(order_.size())).first));
  fill_node(0, 0, int(order_.size()), middles);
}

void TriangleTree::fill_node(int node, int first, int last, const Points& middles) {
  Node& here = nodes_[std::size_t(node)];
  AlignedBox3d spread;
  for (int i = first; i < last; ++i) {
    const int triangle = order_[std::size_t(i)];
    spread.extend(Vector3d(middles.row(triangle)));
    for (const int corner : corners_.row(triangle))
      here.box.extend(Vector3d(vertices_.row(corner)));
  }
  here.first = first;
  if (last - first <= leaf_most) {
    here.count = last - first;
    return;
  }
  int widest = 0;
  spread.sizes().maxCoeff(&widest);
  const int middle = first + (last - first) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](int a, int b) {
                     const double ca = middles(a, widest), cb = middles(b, widest);
                     return ca < cb || (ca == cb && a < b);
                   });
  here.second = node + 1 + nodes_of(middle - first).first;
  const auto lower = [&] { fill_node(node + 1, first, middle, middles); };
  const auto upper = [&] { fill_node(here.second, middle, last, middles); };
  if (last - first > alone) {
    tbb::parallel_invoke(lower, upper);
  } else {
    lower();
    upper();
  }
}

TriangleTree::Nearest TriangleTree::nearest_of(int triangle, const Vector3d& place) const {
  // Ericson, Real-Time Collision Detection, 5.1.5: by the region of the plane that the place is
  // over
  const Vector3d a = vertices_.row(corners_(triangle, 0)), b = vertices_.row(corners_(triangle, 1)),
                 c = vertices_.row(corners_(triangle, 2));
  const Vector3d ab = b - a, ac = c - a, ap = place - a, bp = place - b, cp = place - c;
  const auto at = [&](double u, double v, double w) {
    const Vector3d point = u == 1.0   ? a
                           : v == 1.0 ? b
                           : w == 1.0 ? c
                                      : Vector3d(a + v * ab + w * ac);
    return Nearest{triangle, point, {u, v, w}, (place - point).squaredNorm()};
  };
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp),
               d6 = ac.dot(cp);
  if (d1 <= 0.0 && d2 <= 0.0) return at(1, 0, 0);
  if (d3 >= 0.0 && d4 <= d3) return at(0, 1, 0);
  if (d6 >= 0.0 && d5 <= d6) return at(0, 0, 1);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3) {
    const double v = d1 / (d1 - d3);
    return at(1 - v, v, 0);
  }
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 > d6) {
    const double w = d2 / (d2 - d6);
    return at(1 - w, 0, w);
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return at(0, 1 - w, w);
  }
  const double all = va + vb + vc;
  return at(va / all, vb / all, vc / all);
}

TriangleTree::Nearest TriangleTree::nearest(const Vector3d& place, int guess, double most) const {
  Nearest best;
  best.squared = most * most;
  if (nodes_.empty()) return best;
  // of a triangle without an area the distance may be no number
  if (guess >= 0)
    if (const Nearest near = nearest_of(guess, place); near.squared <= best.squared) best = near;
  struct Open {
    int node;
    double squared;
  };
  std::array<Open, 64> open;  // as many as a tree of 2^31 triangles is high, twice
  int top = 0;
  open[std::size_t(top++)] = {0, nodes_[0].box.squaredExteriorDistance(place)};
  while (top > 0) {
    const Open next = open[std::size_t(--top)];
    if (next.squared > best.squared) continue;
    const Node& node = nodes_[std::size_t(next.node)];
    for (int i = node.first; i < node.first + node.count; ++i) {
      const Nearest one = nearest_of(order_[std::size_t(i)], place);
      if (one.squared < best.squared ||
          (one.squared == best.squared && (best.triangle < 0 || one.triangle < best.triangle)))
        best = one;
    }
    if (node.count > 0) continue;
    Open near{next.node + 1, nodes_[std::size_t(next.node + 1)].box.squaredExteriorDistance(place)};
    Open far{node.second, nodes_[std::size_t(node.second)].box.squaredExteriorDistance(place)};
    if (far.squared < near.squared) std::swap(near, far);
    if (far.squared <= best.squared) open[std::size_t(top++)] = far;
    if (near.squared <= best.squared) open[std::size_t(top++)] = near;
  }
  return best;
}

std::vector<TriangleTree::Nearest> TriangleTree::within(const Vector3d& place,
                                                        double distance) const {
  std::vector<Nearest> all;
  const double most = distance * distance;
  for (std::vector<int> open(nodes_.empty() ? 0 : 1, 0); !open.empty();) {
    const int number = open.back();
    const Node& node = nodes_[std::size_t(number)];
    open.pop_back();
    if (node.box.squaredExteriorDistance(place) > most) continue;
    if (node.count == 0) {
      open.push_back(node.second);
      open.push_back(number + 1);
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const Nearest one = nearest_of(order_[std::size_t(i)], place);
      if (one.squared <= most) all.push_back(one);
    }
  }
  std::ranges::sort(all, {}, &Nearest::triangle);
  return all;
}

std::optional<double> TriangleTree::met(int triangle, const Vector3d& start,
                                        const Vector3d& direction, Side side) const {
  const auto corners = corners_.row(triangle);
  const Vector3d a = vertices_.row(corners[0]);
  const Vector3d ab = vertices_.row(corners[1]).transpose() - a;
  const Vector3d ac = vertices_.row(corners[2]).transpose() - a;
  const Vector3d outward = ab.cross(ac);
  const double sign = side == Side::Outer ? -1.0 : 1.0;
  const double out = direction.dot(outward), height = (a - start).dot(outward);
  if (!(sign * out > 0.0)) return std::nullopt;  // it comes from the other side, or runs along
  if (!(sign * height > touch * outward.norm())) return std::nullopt;
  const Vector3d turned = (start - a).cross(direction);
  const double u = -ac.dot(turned) / out, v = ab.dot(turned) / out;
  if (u < -ray_slack || v < -ray_slack || u + v > 1.0 + ray_slack) return std::nullopt;
  return height / out;
}

std::optional<TriangleTree::Met> TriangleTree::first_met(const Vector3d& start,
                                                         const Vector3d& direction, Side side,
                                                         double most) const {
  Met first{most};
  for (std::vector<int> open(nodes_.empty() ? 0 : 1, 0); !open.empty();) {
    const int number = open.back();
    const Node& node = nodes_[std::size_t(number)];
    open.pop_back();
    if (!is_met(node.box, start, direction, first.along)) continue;
    if (node.count == 0) {
      open.push_back(node.second);
      open.push_back(number + 1);
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const int triangle = order_[std::size_t(i)];
      const auto along = met(triangle, start, direction, side);
      if (along && *along <= first.along) first = {*along, triangle};
    }
  }
  return first.triangle >= 0 ? std::optional(first) : std::nullopt;
}

}  // namespace abbe::cutting
