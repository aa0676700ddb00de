#include "cutting/smooth_patches.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <utility>

#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/disjoint_sets.h"
#include "cutting/segment_grid.h"
#include "cutting/triangle_sides.h"
#include "kinematics/turn_between.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

Vector3d normal_of(const Design& design, int triangle) {
  const auto corner = [&](int k) -> Vector3d {
    return design.vertices.row(design.triangles(triangle, k));
  };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0));
}

/// rad, by which the design turns from one triangle to another
double fold(const Design& design, int one, int other) {
  return kinematics::angle_between(normal_of(design, one), normal_of(design, other));
}

int corner_at(const Triangles& triangles, int triangle, int vertex) {
  for (int k = 0; k < 3; ++k)
    if (triangles(triangle, k) == vertex) return 3 * triangle + k;
  return -1;
}

/// Corners of triangles, numbered 3 t + k, that stay together at a vertex: those of triangles that
/// are joined across an edge.
template <typename Joined>
DisjointSets joined_corners(const Design& design, const Joined& joined) {
  DisjointSets corners(3 * std::size_t(design.triangles.rows()));
  const std::vector<TriangleSide> sides = sides_of(design.triangles);
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const TriangleSide &one = sides[i], &other = sides[i + 1];
    if (!one.same_edge(other) || !joined(one.triangle, other.triangle)) continue;
    for (const int vertex : {one.low, one.high})
      corners.join(corner_at(design.triangles, one.triangle, vertex),
                   corner_at(design.triangles, other.triangle, vertex));
  }
  return corners;
}

/// The seams of a design, and those at which vertices were added to it, all of them to the first
/// vertex at a place.
/// @param from  the old vertex of each: all of them, then those added
std::vector<std::array<int, 2>> seams_of(const Design& design, const std::vector<int>& from) {
  const auto n = std::size_t(design.vertices.rows());
  std::vector<int> kept(n);
  std::iota(kept.begin(), kept.end(), 0);
  for (const auto& [first, added] : design.seams) kept[std::size_t(added)] = first;
  std::vector<std::array<int, 2>> seams = design.seams;
  for (std::size_t i = n; i < from.size(); ++i)
    seams.push_back({kept[std::size_t(from[i])], int(i)});
  return seams;
}

/// A design with these triangles, its vertices taken from those of another.
Design taken(const Design& design, const std::vector<int>& from, Triangles triangles) {
  Design made;
  const auto n = Index(from.size());
  made.vertices.resize(n, 3);
  for (Index i = 0; i < n; ++i) made.vertices.row(i) = design.vertices.row(from[std::size_t(i)]);
  made.triangles = std::move(triangles);
  made.normals = vertex_normals(made.vertices, made.triangles);
  made.area = vertex_area(made.vertices, made.triangles);
  made.facet_error = facet_error(made.vertices, made.normals, made.triangles);
  if (!design.judged.empty())
    for (const int old : from) made.judged.push_back(design.judged[std::size_t(old)]);
  if (!design.face.empty())
    for (const int old : from) made.face.push_back(design.face[std::size_t(old)]);
  made.seams = seams_of(design, from);
  return made;
}

/// Triangles whose sets of corners have vertices of their own.
struct Parted {
  std::vector<int> from;  ///< the old vertex of each: all of them, then those added
  Triangles triangles;
};

Parted parted_at(const Design& design, DisjointSets corners) {
  const auto n = std::size_t(design.vertices.rows());
  Parted parted{std::vector<int>(n), design.triangles};
  std::iota(parted.from.begin(), parted.from.end(), 0);
  std::vector<int> taker(n, -1);  // set of corners that keeps the vertex
  std::map<int, int> added;       // vertex of the other sets
  for (int t = 0; t < int(design.triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) {
      const int vertex = design.triangles(t, k), set = corners.name_of(3 * t + k);
      int& keeps = taker[std::size_t(vertex)];
      if (keeps < 0) keeps = set;
      if (keeps == set) continue;
      const auto [place, is_new] = added.emplace(set, int(parted.from.size()));
      if (is_new) parted.from.push_back(vertex);
      parted.triangles(t, k) = place->second;
    }
  return parted;
}

/// The vertices parted where triangles of different labels meet.
Parted parted_by(const Design& design, const std::vector<int>& label) {
  return parted_at(design, joined_corners(design, [&](int one, int other) {
                     return label[std::size_t(one)] == label[std::size_t(other)];
                   }));
}

/// (n) the label of the triangles of each vertex, which are of one; -1 where it has none.
std::vector<int> labels_of(const Design& design, const std::vector<int>& label) {
  std::vector<int> found(std::size_t(design.vertices.rows()), -1);
  for (Index t = 0; t < design.triangles.rows(); ++t)
    for (const int vertex : design.triangles.row(t))
      found[std::size_t(vertex)] = label[std::size_t(t)];
  return found;
}

/// (n) the first vertex that stands at the same point.
std::vector<int> first_at_point(const Points& vertices) {
  std::map<std::array<double, 3>, int> first;
  std::vector<int> found;
  for (int i = 0; i < int(vertices.rows()); ++i) {
    const std::array<double, 3> point = {vertices(i, 0), vertices(i, 1), vertices(i, 2)};
    found.push_back(first.emplace(point, i).first->second);
  }
  return found;
}

}  // namespace

Design split_at_edges(const Design& design, double angle) {
  if (!(angle > 0.0 && angle < std::numbers::pi))
    throw std::invalid_argument("split_at_edges: the angle must be between 0 and pi");
  const auto is_smooth = [&](int one, int other) { return !(fold(design, one, other) > angle); };
  Parted parted = parted_at(design, joined_corners(design, is_smooth));
  if (parted.from.size() == std::size_t(design.vertices.rows())) return design;
  Design made = taken(design, parted.from, std::move(parted.triangles));
  made.seams = design.seams;
  return made;
}

int edges_about(const Design& design, double angle, double within) {
  const std::vector<TriangleSide> sides = sides_of(design.triangles);
  int count = 0;
  for (std::size_t i = 0; i + 1 < sides.size(); ++i)
    if (sides[i].same_edge(sides[i + 1]))
      count += std::abs(fold(design, sides[i].triangle, sides[i + 1].triangle) - angle) < within;
  return count;
}

Design split_at_faces(const Design& design, const std::vector<int>& face) {
  if (Index(face.size()) != design.triangles.rows())
    throw std::invalid_argument("split_at_faces: one face a triangle");
  Parted parted = parted_by(design, face);
  Design made = taken(design, parted.from, std::move(parted.triangles));
  made.face = labels_of(made, face);
  return made;
}

std::vector<std::array<int, 3>> neighbours(const Triangles& triangles) {
  std::vector<std::array<int, 3>> across(std::size_t(triangles.rows()), {-1, -1, -1});
  const std::vector<TriangleSide> sides = sides_of(triangles);
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const TriangleSide &one = sides[i], &other = sides[i + 1];
    if (!one.same_edge(other)) continue;
    across[std::size_t(one.triangle)][std::size_t(one.corner)] = other.triangle;
    across[std::size_t(other.triangle)][std::size_t(other.corner)] = one.triangle;
  }
  return across;
}

Design split_at_groups(const Design& design, const std::vector<int>& group) {
  if (Index(group.size()) != design.triangles.rows())
    throw std::invalid_argument("split_at_groups: one group a triangle");
  Parted parted = parted_by(design, group);
  Design made = taken(design, parted.from, std::move(parted.triangles));
  made.group = labels_of(made, group);
  for (Index i = 0; i < made.vertices.rows(); ++i) {
    const int old = parted.from[std::size_t(i)];
    made.normals.row(i) = design.normals.row(old);
    made.facet_error[i] = design.facet_error[old];
  }
  return made;
}

std::vector<int> patches(const Design& design) {
  DisjointSets sets(std::size_t(design.vertices.rows()));
  for (const auto& triangle : design.triangles.rowwise()) {
    sets.join(triangle[0], triangle[1]);
    sets.join(triangle[0], triangle[2]);
  }
  for (const auto& [kept, added] : design.seams) sets.join(kept, added);
  std::vector<int> patch(std::size_t(design.vertices.rows()));
  int count = 0;
  for (int i = 0; i < int(patch.size()); ++i) {
    const int name = sets.name_of(i);  // the least vertex of the set, so it has its number
    patch[std::size_t(i)] = name == i ? count++ : patch[std::size_t(name)];
  }
  return patch;
}

std::vector<Segment> sharp_edges(const Design& design) {
  const std::vector<int> first = first_at_point(design.vertices);
  std::map<std::pair<int, int>, int> open;
  const std::vector<TriangleSide> sides = sides_of(design.triangles);
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const bool shared = (i > 0 && sides[i].same_edge(sides[i - 1])) ||
                        (i + 1 < sides.size() && sides[i].same_edge(sides[i + 1]));
    if (shared) continue;
    const auto ends =
        std::minmax(first[std::size_t(sides[i].low)], first[std::size_t(sides[i].high)]);
    ++open[ends];
  }
  std::vector<Segment> edges;
  for (const auto& [ends, count] : open)
    if (count > 1)
      edges.push_back({design.vertices.row(ends.first), design.vertices.row(ends.second)});
  return edges;
}

Design judge_off_edges(const Design& design, std::vector<Segment> edges, double margin) {
  if (!std::isfinite(margin) || margin < 0.0)
    throw std::invalid_argument("judge_off_edges: the margin must be finite and not negative");
  if (margin == 0.0 || edges.empty()) return design;
  // cells much smaller than the edges would be more than can be listed
  double length = 0.0;
  for (const Segment& edge : edges) length += (edge.b - edge.a).norm();
  const double cell = std::max(margin, length / double(edges.size()));
  const SegmentGrid near_edge(std::move(edges), cell);
  Design judged = design;
  judged.judged.resize(std::size_t(design.vertices.rows()), 1);
  tbb::parallel_for(Index(0), design.vertices.rows(), [&](Index i) {
    auto& flag = judged.judged[std::size_t(i)];
    if (flag && near_edge.is_within(design.vertices.row(i), margin)) flag = 0;
  });
  return judged;
}

}  // namespace abbe::cutting
