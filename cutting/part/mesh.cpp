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

double distance(const Vector3d& point, const Segment& segment) {
  const Vector3d along = segment.b - segment.a;
  const double squared_length = along.squaredNorm();
  const double u = squared_length > 0.0
                       ? std::clamp((point - segment.a).dot(along) / squared_length, 0.0, 1.0)
                       : 0.0;
  return (point - segment.a - u * along).norm();
}

SegmentGrid::SegmentGrid(std::vector<Segment> segments, double cell)
    : segments_(std::move(segments)), cell_(cell) {
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    const Segment& segment = segments_[i];
    // Samples along a segment are at most half a cell apart.
    const int sample_count =
        static_cast<int>(std::ceil((segment.b - segment.a).norm() / (0.5 * cell_))) + 1;
    for (int k = 0; k <= sample_count; ++k) {
      auto& cell_segments =
          cells_[cell_of(segment.a + (segment.b - segment.a) * (double(k) / sample_count))];
      if (cell_segments.empty() || cell_segments.back() != i) cell_segments.push_back(i);
    }
  }
}

// Every point of a segment has a sample within a quarter of a cell, so a segment within one cell
// size of the point has a sample within 1.25 cells, i.e. at most two cells away.
bool SegmentGrid::is_within(const Vector3d& point, double radius) const {
  const Cell centre = cell_of(point);
  for (std::int64_t i = -2; i <= 2; ++i)
    for (std::int64_t j = -2; j <= 2; ++j)
      for (std::int64_t k = -2; k <= 2; ++k) {
        const auto cell = cells_.find({centre[0] + i, centre[1] + j, centre[2] + k});
        if (cell == cells_.end()) continue;
        for (const std::size_t segment : cell->second)
          if (distance(point, segments_[segment]) < radius) return true;
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

SegmentGrid::Cell SegmentGrid::cell_of(const Vector3d& point) const {
  Cell cell;
  for (int k = 0; k < 3; ++k)
    cell[static_cast<std::size_t>(k)] = static_cast<std::int64_t>(std::floor(point[k] / cell_));
  return cell;
}

Vector3d triangle_cross_product(const Points& vertices, const Triangles& triangles,
                                Eigen::Index t) {
  const Vector3d a = vertices.row(triangles(t, 0));
  const Vector3d b = vertices.row(triangles(t, 1));
  const Vector3d c = vertices.row(triangles(t, 2));
  return (b - a).cross(c - a);
}

namespace {

/// Returns the sag of the edge between two vertices below the smooth surface.
double sag(const Points& vertices, const Points& normals, int a, int b) {
  const Vector3d na = normals.row(a);
  const Vector3d nb = normals.row(b);
  const double angle = std::atan2(na.cross(nb).norm(), na.dot(nb));
  return (vertices.row(b) - vertices.row(a)).norm() * angle / 8.0;
}

/// Returns (triangles) 1 for each that faces upwards.
std::vector<char> top_triangles(const Design& design, double min_normal_z) {
  std::vector<char> is_top(std::size_t(design.triangles.rows()), 0);
  for (Eigen::Index t = 0; t < design.triangles.rows(); ++t) {
    const Vector3d cross = triangle_cross_product(design.vertices, design.triangles, t);
    is_top[std::size_t(t)] = cross.z() >= min_normal_z * cross.norm();
  }
  return is_top;
}

}  // namespace

std::vector<Segment> top_rim(const Design& design, double min_normal_z) {
  const std::vector<char> is_top = top_triangles(design, min_normal_z);
  // Vertices at a seam count as one, because a border between groups is no rim.
  std::vector<int> shared_vertex(std::size_t(design.vertices.rows()));
  std::iota(shared_vertex.begin(), shared_vertex.end(), 0);
  for (const auto& [first, added] : design.seams) shared_vertex[std::size_t(added)] = first;
  std::map<std::pair<int, int>, int> sides;
  for (Eigen::Index t = 0; t < design.triangles.rows(); ++t) {
    if (!is_top[static_cast<std::size_t>(t)]) continue;
    for (int k = 0; k < 3; ++k) {
      const int a = shared_vertex[std::size_t(design.triangles(t, k))];
      const int b = shared_vertex[std::size_t(design.triangles(t, (k + 1) % 3))];
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
  Design result = design;
  result.vertices =
      (design.vertices * T.linear().transpose()).rowwise() + T.translation().transpose();
  result.normals = design.normals * T.linear().transpose();
  return result;
}

Eigen::VectorXd vertex_area(const Points& vertices, const Triangles& triangles) {
  Eigen::VectorXd area = Eigen::VectorXd::Zero(vertices.rows());
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const double third = triangle_cross_product(vertices, triangles, t).norm() / 6.0;
    for (int k = 0; k < 3; ++k) area[triangles(t, k)] += third;
  }
  return area;
}

// Weights by angle make a normal independent of how the faces are divided into triangles.
Points vertex_normals(const Points& vertices, const Triangles& triangles) {
  Points normals = Points::Zero(vertices.rows(), 3);
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const Vector3d cross = triangle_cross_product(vertices, triangles, t);
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
  Eigen::VectorXd max_sag = Eigen::VectorXd::Zero(vertices.rows());
  for (Eigen::Index t = 0; t < triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = triangles(t, k);
      const int b = triangles(t, (k + 1) % 3);
      const double edge_sag = sag(vertices, normals, a, b);
      max_sag[a] = std::max(max_sag[a], edge_sag);
      max_sag[b] = std::max(max_sag[b], edge_sag);
    }
  return max_sag;
}

Coarseness coarseness(const Design& design) {
  // 30 degrees, as stated in the header.
  const double min_cosine = std::cos(std::numbers::pi / 6);
  const auto is_judged = [&](int v) {
    return design.judged.empty() || design.judged[static_cast<std::size_t>(v)] != 0;
  };
  Coarseness result;
  // Atomic, because triangles that share a vertex may be processed by different threads; all of
  // them write true.
  std::vector<std::atomic<bool>> is_at_sharp_edge(static_cast<std::size_t>(design.vertices.rows()));
  const auto max_with_triangle = [&](Eigen::Index t, double max_sag) {
    const Vector3d normal =
        triangle_cross_product(design.vertices, design.triangles, t).normalized();
    bool is_smooth = true;
    for (const int v : design.triangles.row(t))
      if (design.normals.row(v).dot(normal) < min_cosine) {
        is_smooth = false;
        is_at_sharp_edge[static_cast<std::size_t>(v)].store(true, std::memory_order_relaxed);
      }
    const bool is_recognised =
        !design.face.empty() && design.face[std::size_t(design.triangles(t, 0))] >= 0;
    for (int k = 0; is_smooth && !is_recognised && k < 3; ++k) {
      const int a = design.triangles(t, k), b = design.triangles(t, (k + 1) % 3);
      if (is_judged(a) && is_judged(b))
        max_sag = std::max(max_sag, sag(design.vertices, design.normals, a, b));
    }
    return max_sag;
  };
  using Range = tbb::blocked_range<Eigen::Index>;
  result.max_facet_error = tbb::parallel_reduce(
      Range(0, design.triangles.rows()), 0.0,
      [&](const Range& range, double max_sag) {
        for (Eigen::Index t = range.begin(); t < range.end(); ++t)
          max_sag = max_with_triangle(t, max_sag);
        return max_sag;
      },
      [](double a, double b) { return std::max(a, b); });
  for (int v = 0; v < static_cast<int>(is_at_sharp_edge.size()); ++v) {
    if (!is_judged(v)) continue;
    ++result.judged_vertices;
    result.vertices_at_sharp_edges += is_at_sharp_edge[static_cast<std::size_t>(v)];
  }
  return result;
}

Design judge_top(const Design& design, const JudgeTopOptions& options) {
  if (!std::isfinite(options.min_normal_z))
    throw std::invalid_argument("judge_top: min_normal_z is not finite");
  if (!std::isfinite(options.margin) || options.margin < 0.0)
    throw std::invalid_argument("judge_top: the margin must be finite and not negative");

  Design result = design;
  result.judged.resize(static_cast<std::size_t>(design.vertices.rows()), 1);
  const std::vector<char> is_top = top_triangles(design, options.min_normal_z);
  for (Eigen::Index t = 0; t < design.triangles.rows(); ++t)
    if (!is_top[std::size_t(t)])
      for (const int v : design.triangles.row(t)) result.judged[std::size_t(v)] = 0;
  // A vertex at the rim is excluded on all sides of a seam.
  for (const auto& [first, added] : design.seams)
    if (!result.judged[std::size_t(added)]) result.judged[std::size_t(first)] = 0;
  for (const auto& [first, added] : design.seams)
    if (!result.judged[std::size_t(first)]) result.judged[std::size_t(added)] = 0;
  const std::vector<Segment> rim_edges =
      options.rim ? *options.rim : top_rim(design, options.min_normal_z);
  for (const Segment& s : rim_edges)
    if (!s.a.allFinite() || !s.b.allFinite())
      throw std::invalid_argument("judge_top: a vertex is not finite");
  if (options.margin == 0.0 || rim_edges.empty()) return result;
  // Cells much smaller than the edges of the rim would make the list of cells too long.
  double length = 0.0;
  for (const Segment& s : rim_edges) length += (s.b - s.a).norm();
  const SegmentGrid near_rim(rim_edges,
                             std::max(options.margin, length / double(rim_edges.size())));
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i) {
    auto& is_judged = result.judged[static_cast<std::size_t>(i)];
    if (is_judged && near_rim.is_within(design.vertices.row(i), options.margin)) is_judged = 0;
  }
  return result;
}

std::vector<TriangleSide> triangle_sides(const Triangles& triangles) {
  if (triangles.rows() == 0) return {};
  const auto side = [&](int t, int k) -> TriangleSide {
    const auto [low, high] = std::minmax(triangles(t, k), triangles(t, (k + 1) % 3));
    return {low, high, t, k};
  };
  std::vector<std::ptrdiff_t> bucket_begin(std::size_t(triangles.maxCoeff()) + 2, 0);
  for (int t = 0; t < int(triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) ++bucket_begin[std::size_t(side(t, k).low) + 1];
  std::partial_sum(bucket_begin.begin(), bucket_begin.end(), bucket_begin.begin());
  std::vector<TriangleSide> sides(3 * std::size_t(triangles.rows()));
  std::vector<std::ptrdiff_t> bucket_next = bucket_begin;
  for (int t = 0; t < int(triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) {
      const TriangleSide current = side(t, k);
      sides[std::size_t(bucket_next[std::size_t(current.low)]++)] = current;
    }
  for (std::size_t v = 0; v + 1 < bucket_begin.size(); ++v)
    std::sort(sides.begin() + bucket_begin[v], sides.begin() + bucket_begin[v + 1],
              [](const TriangleSide& a, const TriangleSide& b) {
                return std::tie(a.high, a.triangle, a.corner) <
                       std::tie(b.high, b.triangle, b.corner);
              });
  return sides;
}

Eigen::VectorXd facet_uncertainty(const Design& design) {
  using Eigen::Vector3d;
  constexpr double opposite = -0.8;  // cosine between two edges that continue each other
  const auto vertex_count = std::size_t(design.vertices.rows());
  std::vector<std::vector<int>> neighbour_vertices(vertex_count);
  for (const auto& t : design.triangles.rowwise())
    if (design.face.empty() || design.face[std::size_t(t[0])] < 0)
      for (int k = 0; k < 3; ++k) neighbour_vertices[std::size_t(t[k])].push_back(t[(k + 1) % 3]);
  struct Edge {
    Vector3d direction;
    double length, curvature;
  };
  Eigen::VectorXd uncertainty = Eigen::VectorXd::Zero(design.vertices.rows());
  for (std::size_t v = 0; v < vertex_count; ++v) {
    std::vector<Edge> edges;
    for (const int neighbour : neighbour_vertices[v]) {
      const Vector3d offset = design.vertices.row(neighbour) - design.vertices.row(Eigen::Index(v));
      const Vector3d normal_change =
          design.normals.row(neighbour) - design.normals.row(Eigen::Index(v));
      const double length = offset.norm();
      edges.push_back({offset / length, length, normal_change.dot(offset) / (length * length)});
    }
    double& max_uncertainty = uncertainty[Eigen::Index(v)];
    for (const Edge& first : edges)
      for (const Edge& other : edges)
        if (first.direction.dot(other.direction) < opposite)
          max_uncertainty = std::max(max_uncertainty, std::abs(first.curvature - other.curvature) *
                                                          first.length * other.length / 8.0);
  }
  return uncertainty;
}

namespace {

// Largest values of a channel.
constexpr int max_of_eight_bits = 255, max_of_five_bits = 31;

bool can_denote(int written, int channel, FaceColour::ChannelFormat channel_format) {
  switch (channel_format) {
    case FaceColour::ChannelFormat::EightBits:
      return written == channel;
    case FaceColour::ChannelFormat::FiveBits:
      return written == channel / 8 ||
             written ==
                 (2 * max_of_five_bits * channel + max_of_eight_bits) / (2 * max_of_eight_bits);
    case FaceColour::ChannelFormat::Fraction:
      return std::abs(written - channel) <= 1;
  }
  return false;
}

}  // namespace

bool can_denote(const FaceColour& written, const Rgb& colour) {
  for (std::size_t k = 0; k < 3; ++k)
    if (!can_denote(written.channels[k], colour[k], written.channel_format)) return false;
  return true;
}

// In integer arithmetic, rounded to the nearest.
Rgb to_eight_bits(const FaceColour& written) {
  if (written.channel_format != FaceColour::ChannelFormat::FiveBits) return written.channels;
  Rgb colour;
  for (std::size_t k = 0; k < 3; ++k)
    colour[k] =
        (2 * max_of_eight_bits * written.channels[k] + max_of_five_bits) / (2 * max_of_five_bits);
  return colour;
}

std::string hex_text(const Rgb& colour) {
  return fmt::format("#{:02x}{:02x}{:02x}", colour[0], colour[1], colour[2]);
}

// Strict, so that every colour has a single spelling, apart from case.
std::optional<Rgb> parse_hex_colour(const std::string& hex_text) {
  if (hex_text.size() != 7 || hex_text[0] != '#') return std::nullopt;
  Rgb colour;
  for (std::size_t k = 0; k < 3; ++k) {
    const char* first = hex_text.data() + 1 + 2 * k;
    unsigned channel = 0;  // unsigned, so that a sign is rejected
    const auto [end, error] = std::from_chars(first, first + 2, channel, 16);
    if (error != std::errc() || end != first + 2) return std::nullopt;
    colour[k] = int(channel);
  }
  return colour;
}

}  // namespace abbe::cutting
