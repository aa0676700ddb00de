#include "cutting/mesh.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include "cutting/segment_grid.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

Vector3d cross_of(const Points& vertices, const Triangles& triangles, Eigen::Index t) {
  const Vector3d a = vertices.row(triangles(t, 0));
  const Vector3d b = vertices.row(triangles(t, 1));
  const Vector3d c = vertices.row(triangles(t, 2));
  return (b - a).cross(c - a);
}

/// Of the edge between two vertices below the smooth surface.
double sag(const Points& vertices, const Points& normals, int a, int b) {
  const Vector3d na = normals.row(a);
  const Vector3d nb = normals.row(b);
  const double angle = std::atan2(na.cross(nb).norm(), na.dot(nb));
  return (vertices.row(b) - vertices.row(a)).norm() * angle / 8.0;
}

/// (triangles) whether each looks up.
std::vector<char> top_of(const Design& design, double min_normal_z) {
  std::vector<char> is_top(std::size_t(design.triangles.rows()), 0);
  for (Eigen::Index t = 0; t < design.triangles.rows(); ++t) {
    const Vector3d cross = cross_of(design.vertices, design.triangles, t);
    is_top[std::size_t(t)] = cross.z() >= min_normal_z * cross.norm();
  }
  return is_top;
}

}  // namespace

std::vector<Segment> rim_of_top(const Design& design, double min_normal_z) {
  const std::vector<char> is_top = top_of(design, min_normal_z);
  // a border between groups is no rim
  std::vector<int> at(std::size_t(design.vertices.rows()));
  std::iota(at.begin(), at.end(), 0);
  for (const auto& [kept, added] : design.seams) at[std::size_t(added)] = kept;
  std::map<std::pair<int, int>, int> sides;
  for (Eigen::Index t = 0; t < design.triangles.rows(); ++t) {
    if (!is_top[static_cast<std::size_t>(t)]) continue;
    for (int k = 0; k < 3; ++k) {
      const int a = at[std::size_t(design.triangles(t, k))];
      const int b = at[std::size_t(design.triangles(t, (k + 1) % 3))];
      ++sides[{std::min(a, b), std::max(a, b)}];
    }
  }
  std::vector<Segment> segments;
  for (const auto& [edge, count] : sides)
    if (count == 1)
      segments.push_back({design.vertices.row(edge.first), design.vertices.row(edge.second)});
  return segments;
}

Design transformed(const Design& design, const Eigen::Isometry3d& T) {
  Design moved = design;
  moved.vertices =
      (design.vertices * T.linear().transpose()).rowwise() + T.translation().transpose();
  moved.normals = design.normals * T.linear().transpose();
  return moved;
}

Eigen::VectorXd vertex_area(const Points& vertices, const Triangles& triangles) {
  Eigen::VectorXd area = Eigen::VectorXd::Zero(vertices.rows());
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const double third = cross_of(vertices, triangles, t).norm() / 6.0;
    for (int k = 0; k < 3; ++k) area[triangles(t, k)] += third;
  }
  return area;
}

Points vertex_normals(const Points& vertices, const Triangles& triangles) {
  Points normals = Points::Zero(vertices.rows(), 3);
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vector3d cross = cross_of(vertices, triangles, t);
    const double twice_area = cross.norm();
    if (twice_area == 0.0) continue;
    for (int k = 0; k < 3; ++k) {
      const Vector3d p = vertices.row(triangles(t, k));
      const Vector3d u = vertices.row(triangles(t, (k + 1) % 3)).transpose() - p;
      const Vector3d v = vertices.row(triangles(t, (k + 2) % 3)).transpose() - p;
      const double angle = std::atan2(u.cross(v).norm(), u.dot(v));
      normals.row(triangles(t, k)) += (angle / twice_area) * cross.transpose();
    }
  }
  for (Eigen::Index i = 0; i < normals.rows(); ++i) {
    const double length = normals.row(i).norm();
    if (length > 0.0) normals.row(i) /= length;
  }
  return normals;
}

Eigen::VectorXd facet_error(const Points& vertices, const Points& normals,
                            const Triangles& triangles) {
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(vertices.rows());
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = triangles(t, k);
      const int b = triangles(t, (k + 1) % 3);
      const double here = sag(vertices, normals, a, b);
      largest[a] = std::max(largest[a], here);
      largest[b] = std::max(largest[b], here);
    }
  return largest;
}

Coarseness coarseness(const Design& design) {
  const double smooth = std::cos(std::numbers::pi / 6);
  const auto is_judged = [&](int v) {
    return design.judged.empty() || design.judged[static_cast<std::size_t>(v)] != 0;
  };
  Coarseness coarse;
  std::vector<std::atomic<bool>> sharp(static_cast<std::size_t>(design.vertices.rows()));
  const auto worst_of = [&](Eigen::Index t, double worst) {
    const Vector3d face = cross_of(design.vertices, design.triangles, t).normalized();
    bool follows = true;
    for (const int v : design.triangles.row(t))
      if (design.normals.row(v).dot(face) < smooth) {
        follows = false;
        sharp[static_cast<std::size_t>(v)].store(true, std::memory_order_relaxed);
      }
    const bool is_known =
        !design.face.empty() && design.face[std::size_t(design.triangles(t, 0))] >= 0;
    for (int k = 0; follows && !is_known && k < 3; ++k) {
      const int a = design.triangles(t, k), b = design.triangles(t, (k + 1) % 3);
      if (is_judged(a) && is_judged(b))
        worst = std::max(worst, sag(design.vertices, design.normals, a, b));
    }
    return worst;
  };
  using Range = tbb::blocked_range<Eigen::Index>;
  coarse.facet_error = tbb::parallel_reduce(
      Range(0, design.triangles.rows()), 0.0,
      [&](const Range& range, double worst) {
        for (Eigen::Index t = range.begin(); t < range.end(); ++t) worst = worst_of(t, worst);
        return worst;
      },
      [](double a, double b) { return std::max(a, b); });
  for (int v = 0; v < static_cast<int>(sharp.size()); ++v) {
    if (!is_judged(v)) continue;
    ++coarse.judged;
    coarse.sharp += sharp[static_cast<std::size_t>(v)];
  }
  return coarse;
}

Design judge_top(const Design& design, const JudgeTopOptions& options) {
  if (!std::isfinite(options.min_normal_z))
    throw std::invalid_argument("judge_top: min_normal_z is not finite");
  if (!std::isfinite(options.margin) || options.margin < 0.0)
    throw std::invalid_argument("judge_top: the margin must be finite and not negative");

  Design judged = design;
  judged.judged.resize(static_cast<std::size_t>(design.vertices.rows()), 1);
  const std::vector<char> is_top = top_of(design, options.min_normal_z);
  for (Eigen::Index t = 0; t < design.triangles.rows(); ++t)
    if (!is_top[std::size_t(t)])
      for (const int v : design.triangles.row(t)) judged.judged[std::size_t(v)] = 0;
  // a vertex at the rim is out on every side of it
  for (const auto& [kept, added] : design.seams)
    if (!judged.judged[std::size_t(added)]) judged.judged[std::size_t(kept)] = 0;
  for (const auto& [kept, added] : design.seams)
    if (!judged.judged[std::size_t(kept)]) judged.judged[std::size_t(added)] = 0;
  const std::vector<Segment> edge =
      options.rim ? *options.rim : rim_of_top(design, options.min_normal_z);
  for (const Segment& s : edge)
    if (!s.a.allFinite() || !s.b.allFinite())
      throw std::invalid_argument("judge_top: a vertex is not finite");
  if (options.margin == 0.0 || edge.empty()) return judged;
  // cells much smaller than the edges of the rim would be more than can be listed
  double length = 0.0;
  for (const Segment& s : edge) length += (s.b - s.a).norm();
  const SegmentGrid near_rim(edge, std::max(options.margin, length / double(edge.size())));
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i) {
    auto& flag = judged.judged[static_cast<std::size_t>(i)];
    if (flag && near_rim.is_within(design.vertices.row(i), options.margin)) flag = 0;
  }
  return judged;
}

}  // namespace abbe::cutting
