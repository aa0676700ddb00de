#include "cutting/part/mesh.h"

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <map>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

namespace abbe::cutting {

using Eigen::Vector3d;

double distance(const Vector3d& p, const Segment& s) {
  const Vector3d d = s.b - s.a;
  const double length2 = d.squaredNorm();
  const double u = length2 > 0.0 ? std::clamp((p - s.a).dot(d) / length2, 0.0, 1.0) : 0.0;
  return (p - s.a - u * d).norm();
}

SegmentGrid::SegmentGrid(std::vector<Segment> segments, double cell)
    : segments_(std::move(segments)), cell_(cell) {
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    const Segment& s = segments_[i];
    // half a cell between samples along a segment
    const int steps = static_cast<int>(std::ceil((s.b - s.a).norm() / (0.5 * cell_))) + 1;
    for (int k = 0; k <= steps; ++k) {
      auto& list = cells_[cell_of(s.a + (s.b - s.a) * (double(k) / steps))];
      if (list.empty() || list.back() != i) list.push_back(i);
    }
  }
}

// Samples lie at most a quarter of a cell from any point of a segment, so a segment within one cell
// size of p has a sample within 1.25 cells: two cells away at most.
bool SegmentGrid::is_within(const Vector3d& p, double radius) const {
  const Cell c = cell_of(p);
  for (std::int64_t i = -2; i <= 2; ++i)
    for (std::int64_t j = -2; j <= 2; ++j)
      for (std::int64_t k = -2; k <= 2; ++k) {
        const auto found = cells_.find({c[0] + i, c[1] + j, c[2] + k});
        if (found == cells_.end()) continue;
        for (const std::size_t s : found->second)
          if (distance(p, segments_[s]) < radius) return true;
      }
  return false;
}

std::size_t SegmentGrid::Hash::operator()(const Cell& c) const {
  // The golden ratio and a multiplier of MurmurHash3, which spread neighbouring cells over the
  // table.
  std::uint64_t h = 0x9e3779b97f4a7c15ull;
  for (const std::int64_t v : c) h = (h ^ static_cast<std::uint64_t>(v)) * 0xff51afd7ed558ccdull;
  return static_cast<std::size_t>(h ^ (h >> 32));
}

SegmentGrid::Cell SegmentGrid::cell_of(const Vector3d& p) const {
  Cell cell;
  for (int k = 0; k < 3; ++k)
    cell[static_cast<std::size_t>(k)] = static_cast<std::int64_t>(std::floor(p[k] / cell_));
  return cell;
}

namespace {

Vector3d cross_of(const Points& vertices, const Triangles& triangles, Eigen::Index t) {
  const Vector3d a = vertices.row(triangles(t, 0));
  const Vector3d b = vertices.row(triangles(t, 1));
  const Vector3d c = vertices.row(triangles(t, 2));
  return (b - a).cross(c - a);
}

/// Returns the sag of the edge between two vertices below the smooth surface.
double sag(const Points& vertices, const Points& normals, int a, int b) {
  const Vector3d na = normals.row(a);
  const Vector3d nb = normals.row(b);
  const double angle = std::atan2(na.cross(nb).norm(), na.dot(nb));
  return (vertices.row(b) - vertices.row(a)).norm() * angle / 8.0;
}

/// Returns (triangles) 1 for each that faces upwards.
std::vector<char> top_of(const Design& design, double min_normal_z) {
  std::vector<char> is_top(std::size_t(design.triangles.rows()), 0);
  for (Eigen::Index t = 0; t < design.triangles.rows(); ++t) {
    const Vector3d cross = cross_of(design.vertices, design.triangles, t);
    is_top[std::size_t(t)] = cross.z() >= min_normal_z * cross.norm();
  }
  return is_top;
}

}  // namespace

std::vector<Segment> top_rim(const Design& design, double min_normal_z) {
  const std::vector<char> is_top = top_of(design, min_normal_z);
  // A border between groups is no rim.
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

// Weights by angle make a normal independent of the way in which its faces are divided.
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
  // 30 degrees, as in the header
  const double smooth = std::cos(std::numbers::pi / 6);
  const auto is_judged = [&](int v) {
    return design.judged.empty() || design.judged[static_cast<std::size_t>(v)] != 0;
  };
  Coarseness coarse;
  // Atomic because triangles that share a vertex may be processed by different threads; all write
  // true.
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
  // A vertex at the rim is excluded on all sides of a seam.
  for (const auto& [kept, added] : design.seams)
    if (!judged.judged[std::size_t(added)]) judged.judged[std::size_t(kept)] = 0;
  for (const auto& [kept, added] : design.seams)
    if (!judged.judged[std::size_t(kept)]) judged.judged[std::size_t(added)] = 0;
  const std::vector<Segment> edge =
      options.rim ? *options.rim : top_rim(design, options.min_normal_z);
  for (const Segment& s : edge)
    if (!s.a.allFinite() || !s.b.allFinite())
      throw std::invalid_argument("judge_top: a vertex is not finite");
  if (options.margin == 0.0 || edge.empty()) return judged;
  // Cells much smaller than the edges of the rim would make the list of cells too long.
  double length = 0.0;
  for (const Segment& s : edge) length += (s.b - s.a).norm();
  const SegmentGrid near_rim(edge, std::max(options.margin, length / double(edge.size())));
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i) {
    auto& flag = judged.judged[static_cast<std::size_t>(i)];
    if (flag && near_rim.is_within(design.vertices.row(i), options.margin)) flag = 0;
  }
  return judged;
}

std::vector<TriangleSide> sides_of(const Triangles& triangles) {
  if (triangles.rows() == 0) return {};
  const auto side = [&](int t, int k) -> TriangleSide {
    const auto [low, high] = std::minmax(triangles(t, k), triangles(t, (k + 1) % 3));
    return {low, high, t, k};
  };
  std::vector<std::ptrdiff_t> from(std::size_t(triangles.maxCoeff()) + 2, 0);
  for (int t = 0; t < int(triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) ++from[std::size_t(side(t, k).low) + 1];
  std::partial_sum(from.begin(), from.end(), from.begin());
  std::vector<TriangleSide> sides(3 * std::size_t(triangles.rows()));
  std::vector<std::ptrdiff_t> next = from;
  for (int t = 0; t < int(triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) {
      const TriangleSide one = side(t, k);
      sides[std::size_t(next[std::size_t(one.low)]++)] = one;
    }
  for (std::size_t v = 0; v + 1 < from.size(); ++v)
    std::sort(sides.begin() + from[v], sides.begin() + from[v + 1],
              [](const TriangleSide& a, const TriangleSide& b) {
                return std::tie(a.high, a.triangle, a.corner) <
                       std::tie(b.high, b.triangle, b.corner);
              });
  return sides;
}

Eigen::VectorXd facet_uncertainty(const Design& design) {
  using Eigen::Vector3d;
  constexpr double opposite = -0.8;  // cosine between two edges that continue each other
  const auto n = std::size_t(design.vertices.rows());
  std::vector<std::vector<int>> ends(n);
  for (const auto& t : design.triangles.rowwise())
    if (design.face.empty() || design.face[std::size_t(t[0])] < 0)
      for (int k = 0; k < 3; ++k) ends[std::size_t(t[k])].push_back(t[(k + 1) % 3]);
  struct Edge {
    Vector3d direction;
    double length, curvature;
  };
  Eigen::VectorXd miss = Eigen::VectorXd::Zero(design.vertices.rows());
  for (std::size_t v = 0; v < n; ++v) {
    std::vector<Edge> edges;
    for (const int end : ends[v]) {
      const Vector3d way = design.vertices.row(end) - design.vertices.row(Eigen::Index(v));
      const Vector3d turn = design.normals.row(end) - design.normals.row(Eigen::Index(v));
      const double length = way.norm();
      edges.push_back({way / length, length, turn.dot(way) / (length * length)});
    }
    double& most = miss[Eigen::Index(v)];
    for (const Edge& one : edges)
      for (const Edge& other : edges)
        if (one.direction.dot(other.direction) < opposite)
          most = std::max(
              most, std::abs(one.curvature - other.curvature) * one.length * other.length / 8.0);
  }
  return miss;
}

namespace {

// largest values of a channel
constexpr int max_of_eight_bits = 255, max_of_five_bits = 31;

bool can_denote(int written, int channel, FaceColour::Digits digits) {
  switch (digits) {
    case FaceColour::Digits::EightBits:
      return written == channel;
    case FaceColour::Digits::FiveBits:
      return written == channel / 8 ||
             written ==
                 (2 * max_of_five_bits * channel + max_of_eight_bits) / (2 * max_of_eight_bits);
    case FaceColour::Digits::Fraction:
      return std::abs(written - channel) <= 1;
  }
  return false;
}

}  // namespace

bool can_denote(const FaceColour& written, const Rgb& colour) {
  for (std::size_t k = 0; k < 3; ++k)
    if (!can_denote(written.channels[k], colour[k], written.digits)) return false;
  return true;
}

// Integer arithmetic, rounded to the nearest.
Rgb spread(const FaceColour& written) {
  if (written.digits != FaceColour::Digits::FiveBits) return written.channels;
  Rgb colour;
  for (std::size_t k = 0; k < 3; ++k)
    colour[k] =
        (2 * max_of_eight_bits * written.channels[k] + max_of_five_bits) / (2 * max_of_five_bits);
  return colour;
}

std::string hex_text(const Rgb& colour) {
  return fmt::format("#{:02x}{:02x}{:02x}", colour[0], colour[1], colour[2]);
}

// Strict, so that every colour has one spelling apart from case.
std::optional<Rgb> colour_of(const std::string& hex_text) {
  if (hex_text.size() != 7 || hex_text[0] != '#') return std::nullopt;
  Rgb colour;
  for (std::size_t k = 0; k < 3; ++k) {
    const char* first = hex_text.data() + 1 + 2 * k;
    unsigned channel = 0;  // unsigned, so that a sign is no digit
    const auto [end, error] = std::from_chars(first, first + 2, channel, 16);
    if (error != std::errc() || end != first + 2) return std::nullopt;
    colour[k] = int(channel);
  }
  return colour;
}

}  // namespace abbe::cutting
