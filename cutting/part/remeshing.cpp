#include "cutting/part/remeshing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <queue>
#include <stdexcept>
#include <tuple>
#include <utility>

#include <tbb/parallel_for.h>
#include <Eigen/Geometry>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include "cutting/part/design_points.h"
#include "cutting/part/index_sets.h"
#include "cutting/part/mesh.h"
#include "kinematics/bad_input.h"
#include "kinematics/pose.h"

namespace abbe::cutting {

using OpenMesh::EdgeHandle;
using OpenMesh::FaceHandle;
using OpenMesh::VertexHandle;

struct TriangleMesh::HalfEdges : OpenMesh::TriMesh_ArrayKernelT<> {
  // OpenMesh requires a position, which is not used: the caller stores the vertices.
  VertexHandle added() { return add_vertex(Point(0, 0, 0)); }
};

TriangleMesh::TriangleMesh(const Triangles& triangles, Eigen::Index vertices)
    : mesh_(std::make_unique<HalfEdges>()) {
  for (Eigen::Index i = 0; i < vertices; ++i) mesh_->added();
  for (const auto& t : triangles.rowwise())
    if (!mesh_->add_face(VertexHandle(t[0]), VertexHandle(t[1]), VertexHandle(t[2])).is_valid())
      throw std::invalid_argument("the triangles of the design are no surface");
}

TriangleMesh::~TriangleMesh() = default;
TriangleMesh::TriangleMesh(TriangleMesh&&) noexcept = default;
TriangleMesh& TriangleMesh::operator=(TriangleMesh&&) noexcept = default;

int TriangleMesh::edges() const { return int(mesh_->n_edges()); }

int TriangleMesh::faces() const { return int(mesh_->n_faces()); }

std::array<int, 2> TriangleMesh::ends(int edge) const {
  const auto half = mesh_->halfedge_handle(EdgeHandle(edge), 0);
  const int a = mesh_->from_vertex_handle(half).idx(), b = mesh_->to_vertex_handle(half).idx();
  return {std::min(a, b), std::max(a, b)};
}

std::array<int, 2> TriangleMesh::faces_at(int edge) const {
  const auto face = [&](int side) {
    return mesh_->face_handle(mesh_->halfedge_handle(EdgeHandle(edge), side)).idx();
  };
  return {face(0), face(1)};
}

std::array<int, 3> TriangleMesh::corners(int face) const {
  const auto half = mesh_->halfedge_handle(FaceHandle(face));
  return {mesh_->from_vertex_handle(half).idx(), mesh_->to_vertex_handle(half).idx(),
          mesh_->opposite_vh(half).idx()};
}

std::array<int, 3> TriangleMesh::sides_of(int face) const {
  const auto half = mesh_->halfedge_handle(FaceHandle(face));
  const auto next = mesh_->next_halfedge_handle(half);
  return {mesh_->edge_handle(half).idx(), mesh_->edge_handle(next).idx(),
          mesh_->edge_handle(mesh_->next_halfedge_handle(next)).idx()};
}

std::array<int, 4> TriangleMesh::quad(int edge) const {
  const auto half = mesh_->halfedge_handle(EdgeHandle(edge), 0),
             other = mesh_->halfedge_handle(EdgeHandle(edge), 1);
  const auto corner = [&](OpenMesh::HalfedgeHandle at) {
    return mesh_->is_boundary(at) ? -1 : mesh_->opposite_vh(at).idx();
  };
  return {mesh_->from_vertex_handle(half).idx(), mesh_->to_vertex_handle(half).idx(), corner(half),
          corner(other)};
}

std::vector<int> TriangleMesh::sides(int edge) const {
  std::vector<int> found;
  for (const int side : {0, 1}) {
    const auto half = mesh_->halfedge_handle(EdgeHandle(edge), side);
    if (mesh_->is_boundary(half)) continue;
    for (const auto other : {mesh_->next_halfedge_handle(half), mesh_->prev_halfedge_handle(half)})
      found.push_back(mesh_->edge_handle(other).idx());
  }
  return found;
}

bool TriangleMesh::can_flip(int edge) const {
  return !mesh_->is_boundary(EdgeHandle(edge)) && mesh_->is_flip_ok(EdgeHandle(edge));
}

void TriangleMesh::turn(int edge) { mesh_->flip(EdgeHandle(edge)); }

std::vector<int> TriangleMesh::split_edge(int edge) {
  const VertexHandle vertex = mesh_->added();
  mesh_->split(EdgeHandle(edge), vertex);
  std::vector<int> made;
  for (auto it = mesh_->cve_iter(vertex); it.is_valid(); ++it) made.push_back(it->idx());
  return made;
}

std::vector<int> TriangleMesh::split_face(int face) {
  const VertexHandle vertex = mesh_->added();
  mesh_->split(FaceHandle(face), vertex);
  std::vector<int> made;
  for (auto it = mesh_->cve_iter(vertex); it.is_valid(); ++it) made.push_back(it->idx());
  for (auto it = mesh_->cvoh_iter(vertex); it.is_valid(); ++it)
    made.push_back(mesh_->edge_handle(mesh_->next_halfedge_handle(*it)).idx());
  return made;
}

Triangles TriangleMesh::triangles() const {
  Triangles triangles(faces(), 3);
  for (int face = 0; face < faces(); ++face) {
    const std::array<int, 3> at = corners(face);
    triangles.row(face) << at[0], at[1], at[2];
  }
  return triangles;
}

namespace {

using Eigen::Index;

/// An edge to be halved. Longer edges come first; of equally long ones the one of lower index, so
/// that the order is unique.
struct Long {
  double length;
  int edge;
  bool operator<(const Long& other) const {
    return std::tuple(length, -edge) < std::tuple(other.length, -other.edge);
  }
};

}  // namespace

Design subdivided(const Design& design, const SurfaceInterpolator& on_surface,
                  const SubdivideOptions& options) {
  require(std::isfinite(options.spacing) && options.spacing > 0.0,
          "subdivided: the spacing must be positive");
  TriangleMesh mesh(design.triangles, design.vertices.rows());
  std::vector<Contact> places = places_of(design);
  std::vector<std::uint8_t> judged = design.judged;
  judged.resize(places.size(), 1);
  std::priority_queue<Long> queue;
  const auto add = [&](int edge) {
    const auto [a, b] = mesh.ends(edge);
    if (!judged[std::size_t(a)] || !judged[std::size_t(b)]) return;
    const double length = (places[std::size_t(a)].point - places[std::size_t(b)].point).norm();
    if (length > options.spacing) queue.push({length, edge});
  };
  for (int edge = 0; edge < mesh.edges(); ++edge) add(edge);
  // A split edge keeps its index for one half, so old entries remain in the queue. Their length no
  // longer matches.
  for (; !queue.empty() && Index(places.size()) < options.points; queue.pop()) {
    const auto [length, edge] = queue.top();
    const auto [a, b] = mesh.ends(edge);
    const std::array<Contact, 2> halves = {places[std::size_t(a)], places[std::size_t(b)]};
    if (length != (halves[0].point - halves[1].point).norm()) continue;  // split since
    places.push_back(on_surface(halves, std::array<double, 2>{0.5, 0.5}));
    judged.push_back(1);
    for (const auto made : mesh.split_edge(edge)) add(made);
  }
  return resampled_design(design, places, mesh.triangles(), std::move(judged));
}

namespace {

using Eigen::Vector3d;

Vector3d normal_of(const Design& design, int triangle) {
  const auto corner = [&](int k) -> Vector3d {
    return design.vertices.row(design.triangles(triangle, k));
  };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0));
}

/// Returns the angle between the normals of two triangles, rad.
double fold(const Design& design, int one, int other) {
  return kinematics::angle_between(normal_of(design, one), normal_of(design, other));
}

int corner_at(const Triangles& triangles, int triangle, int vertex) {
  for (int k = 0; k < 3; ++k)
    if (triangles(triangle, k) == vertex) return 3 * triangle + k;
  return -1;
}

/// Returns the sets of corners (index 3 t + k for corner k of triangle t) that keep a common
/// vertex: those at the ends of edges across which two triangles are joined.
/// @param joined  (int triangle, int other) -> bool
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

/// Returns the seams of a design plus one for each added vertex, all of which refer to the first
/// vertex at their point.
/// @param from  original vertex of every vertex: first all original ones, then those added
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

/// Returns a design with new triangles, whose vertices are copies of those of another design.
/// @param from  original vertex of every vertex
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

/// Triangles after vertices were duplicated, so that every set of corners has its own.
struct SplitDesign {
  std::vector<int> from;  ///< original vertex of every vertex: all original ones, then those added
  Triangles triangles;
};

SplitDesign split_at_corners(const Design& design, DisjointSets corners) {
  const auto n = std::size_t(design.vertices.rows());
  SplitDesign parted{std::vector<int>(n), design.triangles};
  std::iota(parted.from.begin(), parted.from.end(), 0);
  std::vector<int> taker(n, -1);  // for each vertex the set of corners that keeps it; -1: none yet
  std::map<int, int> added;       // new vertex of each other set
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

/// Splits a design where triangles of different labels meet.
/// @param label  of each triangle
SplitDesign split_by_labels(const Design& design, const std::vector<int>& label) {
  return split_at_corners(design, joined_corners(design, [&](int one, int other) {
                            return label[std::size_t(one)] == label[std::size_t(other)];
                          }));
}

/// Returns the label of each vertex, which all of its triangles have; -1 for a vertex without
/// triangles.
std::vector<int> labels_of(const Design& design, const std::vector<int>& label) {
  std::vector<int> found(std::size_t(design.vertices.rows()), -1);
  for (Index t = 0; t < design.triangles.rows(); ++t)
    for (const int vertex : design.triangles.row(t))
      found[std::size_t(vertex)] = label[std::size_t(t)];
  return found;
}

/// Returns for each vertex the first one at the same point.
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
  SplitDesign parted = split_at_corners(design, joined_corners(design, is_smooth));
  if (parted.from.size() == std::size_t(design.vertices.rows())) return design;
  Design made = taken(design, parted.from, std::move(parted.triangles));
  made.seams = design.seams;
  return made;
}

int count_edges_near_angle(const Design& design, double angle, double within) {
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
  SplitDesign parted = split_by_labels(design, face);
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
  SplitDesign parted = split_by_labels(design, group);
  Design made = taken(design, parted.from, std::move(parted.triangles));
  made.group = labels_of(made, group);
  // A border between groups is not an edge of the part, so normals and facet errors stay unchanged.
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
    const int name = sets.name_of(i);  // the first vertex of the set, so already numbered
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
  // An edge is listed in every cell that it crosses; cells much smaller than the edges would cost
  // too much memory.
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

namespace {

/// An edge where two faces meet, by its vertices in each face.
struct TwoSided {
  std::array<std::array<int, 2>, 2> ends;  // [face][end], both in the same direction
  int halvings = 0;
};

/// Returns the edges of a design where two different recognised faces meet.
std::vector<TwoSided> face_borders(const Design& design) {
  std::vector<int> place(std::size_t(design.vertices.rows()));
  std::iota(place.begin(), place.end(), 0);
  for (const auto& [kept, added] : design.seams) place[std::size_t(added)] = kept;
  const auto at = [&](int v) { return place[std::size_t(v)]; };
  std::map<std::pair<int, int>, std::vector<std::array<int, 2>>> sides;
  const std::vector<std::array<int, 3>> across = neighbours(design.triangles);
  for (int t = 0; t < int(design.triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) {
      std::array<int, 2> ends = {design.triangles(t, k), design.triangles(t, (k + 1) % 3)};
      if (across[std::size_t(t)][std::size_t(k)] >= 0) continue;
      if (at(ends[0]) > at(ends[1])) std::swap(ends[0], ends[1]);
      sides[{at(ends[0]), at(ends[1])}].push_back(ends);
    }
  std::vector<TwoSided> borders;
  for (const auto& [ends, two] : sides) {
    if (two.size() != 2) continue;
    const int one = design.face[std::size_t(two[0][0])],
              other = design.face[std::size_t(two[1][0])];
    if (one >= 0 && other >= 0 && one != other) borders.push_back({{two[0], two[1]}});
  }
  return borders;
}

/// Two faces near an edge of the mesh, which is a chord of their true border.
struct Meeting {
  const AnalyticPatch &one, &other;
  Vector3d a, b;  // ends of the chord

  Vector3d middle() const { return 0.5 * (a + b); }
  /// Returns the unit vector across the border and tangential to the faces.
  Vector3d way() const { return dropped(one, middle()).normal.cross(b - a).normalized(); }
  /// Returns the component of the difference of both normals at a point in that direction; it is 0
  /// on the border of tangential faces.
  double apart(const Vector3d& p) const {
    return (dropped(one, p).normal - dropped(other, p).normal).dot(way());
  }
  /// Returns the distance between both surfaces near a point, mm.
  double between(const Vector3d& p) const { return distance_of(other, dropped(one, p).point); }
  /// Returns the distance between both surfaces at the middle of the chord, mm, less the mean of
  /// those at its ends, where surfaces fitted to rounded vertices do not quite touch: the error of
  /// the sliver that the chord assigns to the wrong face.
  double off() const { return std::abs(between(middle()) - 0.5 * (between(a) + between(b))); }
};

/// Returns the point of the border beside the middle of its chord; empty if none is found nearby.
std::optional<Vector3d> on_border(const Meeting& at) {
  // Newton's method with a difference quotient, starting on the chord.
  constexpr int rounds = 8;
  constexpr double most = 0.3, little = 1e-3, edge = 0.05;  // fractions of the chord; rad
  const double chord = (at.b - at.a).norm();
  for (const Vector3d& end : {at.a, at.b})
    // Faces whose normals differ by more than this at an end meet in an edge of the part.
    if ((dropped(at.one, end).normal - dropped(at.other, end).normal).norm() > edge)
      return std::nullopt;
  const Vector3d way = at.way();
  double along = 0.0;
  for (int round = 0; round < rounds; ++round) {
    const auto place = [&](double s) { return dropped(at.one, at.middle() + s * way).point; };
    const double here = at.apart(place(along)), step = little * chord;
    const double slope = (at.apart(place(along + step)) - here) / step;
    if (!(std::abs(slope) > 0.0)) return std::nullopt;
    along -= here / slope;
    if (!(std::abs(along) < most * chord)) return std::nullopt;
  }
  return dropped(at.one, at.middle() + along * way).point;
}

}  // namespace

Design refine_round_borders(const Design& design, const std::vector<AnalyticPatch>& faces,
                            double off) {
  require(std::isfinite(off) && off > 0.0, "with_round_borders: off must be positive");
  constexpr int most = 8;  // halvings, which divide a chord of 30 degrees into chords of about 0.1
  if (design.face.empty()) return design;
  std::vector<TwoSided> waiting = face_borders(design);
  TriangleMesh mesh(design.triangles, design.vertices.rows());
  std::vector<Contact> places = places_of(design);
  std::map<std::pair<int, int>, int> edge_at;
  const auto name = [&](int edge) { edge_at[{mesh.ends(edge)[0], mesh.ends(edge)[1]}] = edge; };
  for (int edge = 0; edge < mesh.edges(); ++edge)
    if (const auto [one, other] = mesh.faces_at(edge); one < 0 || other < 0) name(edge);
  std::vector<std::uint8_t> judged = design.judged;
  std::vector<std::array<int, 2>> seams = design.seams;
  while (!waiting.empty()) {
    const TwoSided border = waiting.back();
    waiting.pop_back();
    const auto face = [&](std::size_t side) -> const AnalyticPatch& {
      return faces[std::size_t(places[std::size_t(border.ends[side][0])].face)];
    };
    const Meeting at{face(0), face(1), places[std::size_t(border.ends[0][0])].point,
                     places[std::size_t(border.ends[0][1])].point};
    if (!(at.off() > off) || border.halvings == most) continue;
    const std::optional<Vector3d> found = on_border(at);
    if (!found) continue;
    std::array<int, 2> made{};
    for (std::size_t side = 0; side < 2; ++side) {
      const auto [a, b] = border.ends[side];
      Contact place = dropped(face(side), *found);
      place.face = places[std::size_t(a)].face;
      made[side] = int(places.size());
      places.push_back(place);
      for (const int edge : mesh.split_edge(edge_at.at(std::minmax(a, b)))) name(edge);
      if (!judged.empty()) judged.push_back(1);
    }
    seams.push_back(made);
    for (const std::size_t end : {0u, 1u})
      waiting.push_back({{{{border.ends[0][end], made[0]}, {border.ends[1][end], made[1]}}},
                         border.halvings + 1});
  }
  Design rounded = resampled_design(design, places, mesh.triangles(), std::move(judged));
  rounded.seams = std::move(seams);
  return rounded;
}

}  // namespace abbe::cutting
