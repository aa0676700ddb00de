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
  // OpenMesh requires a position, which is not used, because the caller stores the vertices.
  VertexHandle append_vertex() { return add_vertex(Point(0, 0, 0)); }
};

TriangleMesh::TriangleMesh(const Triangles& triangles, Eigen::Index vertices)
    : mesh_(std::make_unique<HalfEdges>()) {
  for (Eigen::Index i = 0; i < vertices; ++i) mesh_->append_vertex();
  for (const auto& t : triangles.rowwise())
    if (!mesh_->add_face(VertexHandle(t[0]), VertexHandle(t[1]), VertexHandle(t[2])).is_valid())
      throw std::invalid_argument("the triangles of the design do not form a surface");
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

std::array<int, 3> TriangleMesh::face_edges(int face) const {
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

std::vector<int> TriangleMesh::adjacent_edges(int edge) const {
  std::vector<int> edges;
  for (const int side : {0, 1}) {
    const auto half = mesh_->halfedge_handle(EdgeHandle(edge), side);
    if (mesh_->is_boundary(half)) continue;
    for (const auto other : {mesh_->next_halfedge_handle(half), mesh_->prev_halfedge_handle(half)})
      edges.push_back(mesh_->edge_handle(other).idx());
  }
  return edges;
}

bool TriangleMesh::can_flip(int edge) const {
  return !mesh_->is_boundary(EdgeHandle(edge)) && mesh_->is_flip_ok(EdgeHandle(edge));
}

void TriangleMesh::flip(int edge) { mesh_->flip(EdgeHandle(edge)); }

std::vector<int> TriangleMesh::split_edge(int edge) {
  const VertexHandle vertex = mesh_->append_vertex();
  mesh_->split(EdgeHandle(edge), vertex);
  std::vector<int> edges;
  for (auto it = mesh_->cve_iter(vertex); it.is_valid(); ++it) edges.push_back(it->idx());
  return edges;
}

std::vector<int> TriangleMesh::split_face(int face) {
  const VertexHandle vertex = mesh_->append_vertex();
  mesh_->split(FaceHandle(face), vertex);
  std::vector<int> edges;
  for (auto it = mesh_->cve_iter(vertex); it.is_valid(); ++it) edges.push_back(it->idx());
  for (auto it = mesh_->cvoh_iter(vertex); it.is_valid(); ++it)
    edges.push_back(mesh_->edge_handle(mesh_->next_halfedge_handle(*it)).idx());
  return edges;
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

/// An edge to be halved. Longer edges come first, edges of equal length in order of their index, so
/// that the order is unique.
struct LongEdge {
  double length;
  int edge;
  bool operator<(const LongEdge& other) const {
    return std::tuple(length, -edge) < std::tuple(other.length, -other.edge);
  }
};

}  // namespace

Design subdivide(const Design& design, const SurfaceInterpolator& on_surface,
                 const SubdivideOptions& options) {
  require(std::isfinite(options.spacing) && options.spacing > 0.0,
          "subdivided: the spacing must be positive");
  TriangleMesh mesh(design.triangles, design.vertices.rows());
  std::vector<Contact> contacts = vertex_contacts(design);
  std::vector<std::uint8_t> judged = design.judged;
  judged.resize(contacts.size(), 1);
  std::priority_queue<LongEdge> queue;
  const auto add = [&](int edge) {
    const auto [a, b] = mesh.ends(edge);
    if (!judged[std::size_t(a)] || !judged[std::size_t(b)]) return;
    const double length = (contacts[std::size_t(a)].point - contacts[std::size_t(b)].point).norm();
    if (length > options.spacing) queue.push({length, edge});
  };
  for (int edge = 0; edge < mesh.edges(); ++edge) add(edge);
  // A split edge keeps its index for one half, so old entries remain in the queue; their lengths
  // differ from those of the edges.
  for (; !queue.empty() && Index(contacts.size()) < options.points; queue.pop()) {
    const auto [length, edge] = queue.top();
    const auto [a, b] = mesh.ends(edge);
    const std::array<Contact, 2> end_contacts = {contacts[std::size_t(a)],
                                                 contacts[std::size_t(b)]};
    if (length != (end_contacts[0].point - end_contacts[1].point).norm()) continue;  // obsolete
    contacts.push_back(on_surface(end_contacts, std::array<double, 2>{0.5, 0.5}));
    judged.push_back(1);
    for (const auto new_edge : mesh.split_edge(edge)) add(new_edge);
  }
  return resampled_design(design, contacts, mesh.triangles(), std::move(judged));
}

namespace {

using Eigen::Vector3d;

/// Returns the angle between the normals of two triangles, rad.
double fold_angle(const Design& design, int a, int b) {
  const auto normal = [&](int t) {
    return triangle_cross_product(design.vertices, design.triangles, t);
  };
  return kinematics::angle_between(normal(a), normal(b));
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
DisjointSets joined_corners(const Design& design, const Joined& are_joined) {
  DisjointSets corners(3 * std::size_t(design.triangles.rows()));
  const std::vector<TriangleSide> sides = triangle_sides(design.triangles);
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const TriangleSide &side = sides[i], &other = sides[i + 1];
    if (!side.same_edge(other) || !are_joined(side.triangle, other.triangle)) continue;
    for (const int vertex : {side.low, side.high})
      corners.join(corner_at(design.triangles, side.triangle, vertex),
                   corner_at(design.triangles, other.triangle, vertex));
  }
  return corners;
}

/// Returns the seams of a design plus one for each added vertex; each seam refers to the first
/// vertex at its point.
/// @param source_vertex  original vertex of every vertex: first all original ones, then those added
std::vector<std::array<int, 2>> extended_seams(const Design& design,
                                               const std::vector<int>& source_vertex) {
  const auto vertex_count = std::size_t(design.vertices.rows());
  std::vector<int> first_at(vertex_count);
  std::iota(first_at.begin(), first_at.end(), 0);
  for (const auto& [first, added] : design.seams) first_at[std::size_t(added)] = first;
  std::vector<std::array<int, 2>> seams = design.seams;
  for (std::size_t i = vertex_count; i < source_vertex.size(); ++i)
    seams.push_back({first_at[std::size_t(source_vertex[i])], int(i)});
  return seams;
}

/// Returns a design with new triangles, whose vertices are copies of those of another design.
/// @param source_vertex  original vertex of every vertex
Design copy_vertices(const Design& design, const std::vector<int>& source_vertex,
                     Triangles triangles) {
  Design result;
  const auto count = Index(source_vertex.size());
  result.vertices.resize(count, 3);
  for (Index i = 0; i < count; ++i)
    result.vertices.row(i) = design.vertices.row(source_vertex[std::size_t(i)]);
  result.triangles = std::move(triangles);
  result.normals = vertex_normals(result.vertices, result.triangles);
  result.area = vertex_area(result.vertices, result.triangles);
  result.facet_error = facet_error(result.vertices, result.normals, result.triangles);
  if (!design.judged.empty())
    for (const int vertex : source_vertex)
      result.judged.push_back(design.judged[std::size_t(vertex)]);
  if (!design.face.empty())
    for (const int vertex : source_vertex) result.face.push_back(design.face[std::size_t(vertex)]);
  result.seams = extended_seams(design, source_vertex);
  return result;
}

/// Triangles with duplicated vertices, so that every set of corners has its own vertex.
struct SplitDesign {
  std::vector<int> source_vertex;  ///< original vertex of every vertex: first all original ones,
                                   ///< then those added
  Triangles triangles;
};

/// Gives every set of corners its own vertex; the first set at a vertex keeps it.
SplitDesign split_at_corners(const Design& design, DisjointSets corners) {
  const auto vertex_count = std::size_t(design.vertices.rows());
  SplitDesign split{std::vector<int>(vertex_count), design.triangles};
  std::iota(split.source_vertex.begin(), split.source_vertex.end(), 0);
  // For each vertex the set of corners that keeps it; -1: none yet.
  std::vector<int> keeping_set(vertex_count, -1);
  std::map<int, int> new_vertices;  // of all other sets
  for (int t = 0; t < int(design.triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) {
      const int vertex = design.triangles(t, k), set = corners.representative(3 * t + k);
      int& keeper = keeping_set[std::size_t(vertex)];
      if (keeper < 0) keeper = set;
      if (keeper == set) continue;
      const auto [entry, is_new] = new_vertices.emplace(set, int(split.source_vertex.size()));
      if (is_new) split.source_vertex.push_back(vertex);
      split.triangles(t, k) = entry->second;
    }
  return split;
}

/// Splits a design where triangles of different labels meet.
/// @param label  of each triangle
SplitDesign split_by_labels(const Design& design, const std::vector<int>& label) {
  return split_at_corners(design, joined_corners(design, [&](int triangle, int other) {
                            return label[std::size_t(triangle)] == label[std::size_t(other)];
                          }));
}

/// Returns the label of each vertex, i.e. that of all of its triangles; -1 for a vertex without
/// triangles.
std::vector<int> vertex_labels(const Design& design, const std::vector<int>& label) {
  std::vector<int> result(std::size_t(design.vertices.rows()), -1);
  for (Index t = 0; t < design.triangles.rows(); ++t)
    for (const int vertex : design.triangles.row(t))
      result[std::size_t(vertex)] = label[std::size_t(t)];
  return result;
}

/// Returns the first vertex at the same point for each vertex.
std::vector<int> first_vertex_at_point(const Points& vertices) {
  std::map<std::array<double, 3>, int> first_index;
  std::vector<int> result;
  for (int i = 0; i < int(vertices.rows()); ++i) {
    const std::array<double, 3> point = {vertices(i, 0), vertices(i, 1), vertices(i, 2)};
    result.push_back(first_index.emplace(point, i).first->second);
  }
  return result;
}

}  // namespace

Design split_at_edges(const Design& design, double angle) {
  if (!(angle > 0.0 && angle < std::numbers::pi))
    throw std::invalid_argument("split_at_edges: the angle must be between 0 and pi");
  const auto is_smooth = [&](int a, int b) { return !(fold_angle(design, a, b) > angle); };
  SplitDesign split = split_at_corners(design, joined_corners(design, is_smooth));
  if (split.source_vertex.size() == std::size_t(design.vertices.rows())) return design;
  Design result = copy_vertices(design, split.source_vertex, std::move(split.triangles));
  result.seams = design.seams;
  return result;
}

int count_edges_near_angle(const Design& design, double angle, double max_difference) {
  const std::vector<TriangleSide> sides = triangle_sides(design.triangles);
  int count = 0;
  for (std::size_t i = 0; i + 1 < sides.size(); ++i)
    if (sides[i].same_edge(sides[i + 1]))
      count += std::abs(fold_angle(design, sides[i].triangle, sides[i + 1].triangle) - angle) <
               max_difference;
  return count;
}

Design split_at_faces(const Design& design, const std::vector<int>& face) {
  if (Index(face.size()) != design.triangles.rows())
    throw std::invalid_argument("split_at_faces: expected one face per triangle");
  SplitDesign split = split_by_labels(design, face);
  Design result = copy_vertices(design, split.source_vertex, std::move(split.triangles));
  result.face = vertex_labels(result, face);
  return result;
}

std::vector<std::array<int, 3>> neighbours(const Triangles& triangles) {
  std::vector<std::array<int, 3>> across(std::size_t(triangles.rows()), {-1, -1, -1});
  const std::vector<TriangleSide> sides = triangle_sides(triangles);
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const TriangleSide &side = sides[i], &other = sides[i + 1];
    if (!side.same_edge(other)) continue;
    across[std::size_t(side.triangle)][std::size_t(side.corner)] = other.triangle;
    across[std::size_t(other.triangle)][std::size_t(other.corner)] = side.triangle;
  }
  return across;
}

Design split_at_groups(const Design& design, const std::vector<int>& group) {
  if (Index(group.size()) != design.triangles.rows())
    throw std::invalid_argument("split_at_groups: expected one group per triangle");
  SplitDesign split = split_by_labels(design, group);
  Design result = copy_vertices(design, split.source_vertex, std::move(split.triangles));
  result.group = vertex_labels(result, group);
  // A border between groups is not an edge of the part, so normals and facet errors are unchanged.
  for (Index i = 0; i < result.vertices.rows(); ++i) {
    const int source = split.source_vertex[std::size_t(i)];
    result.normals.row(i) = design.normals.row(source);
    result.facet_error[i] = design.facet_error[source];
  }
  return result;
}

std::vector<int> patches(const Design& design) {
  DisjointSets sets(std::size_t(design.vertices.rows()));
  for (const auto& triangle : design.triangles.rowwise()) {
    sets.join(triangle[0], triangle[1]);
    sets.join(triangle[0], triangle[2]);
  }
  for (const auto& [first, added] : design.seams) sets.join(first, added);
  std::vector<int> patch(std::size_t(design.vertices.rows()));
  int count = 0;
  for (int i = 0; i < int(patch.size()); ++i) {
    const int set = sets.representative(i);  // the first vertex of the set, so already numbered
    patch[std::size_t(i)] = set == i ? count++ : patch[std::size_t(set)];
  }
  return patch;
}

std::vector<Segment> sharp_edges(const Design& design) {
  const std::vector<int> first_vertex = first_vertex_at_point(design.vertices);
  std::map<std::pair<int, int>, int> unshared_sides;
  const std::vector<TriangleSide> sides = triangle_sides(design.triangles);
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const bool is_shared = (i > 0 && sides[i].same_edge(sides[i - 1])) ||
                           (i + 1 < sides.size() && sides[i].same_edge(sides[i + 1]));
    if (is_shared) continue;
    const auto ends = std::minmax(first_vertex[std::size_t(sides[i].low)],
                                  first_vertex[std::size_t(sides[i].high)]);
    ++unshared_sides[ends];
  }
  std::vector<Segment> edges;
  for (const auto& [ends, count] : unshared_sides)
    if (count > 1)
      edges.push_back({design.vertices.row(ends.first), design.vertices.row(ends.second)});
  return edges;
}

Design exclude_near_edges(const Design& design, std::vector<Segment> edges, double margin) {
  if (!std::isfinite(margin) || margin < 0.0)
    throw std::invalid_argument("judge_off_edges: the margin must be finite and not negative");
  if (margin == 0.0 || edges.empty()) return design;
  // An edge is listed in every cell that it crosses, so cells much smaller than the edges would
  // need too much memory.
  double length = 0.0;
  for (const Segment& edge : edges) length += (edge.b - edge.a).norm();
  const double cell = std::max(margin, length / double(edges.size()));
  const SegmentGrid near_edge(std::move(edges), cell);
  Design result = design;
  result.judged.resize(std::size_t(design.vertices.rows()), 1);
  tbb::parallel_for(Index(0), design.vertices.rows(), [&](Index i) {
    auto& is_judged = result.judged[std::size_t(i)];
    if (is_judged && near_edge.is_within(design.vertices.row(i), margin)) is_judged = 0;
  });
  return result;
}

namespace {

/// An edge where two faces meet, given by its vertices in each face.
struct BorderEdge {
  std::array<std::array<int, 2>, 2> ends;  // [face][end], both in the same direction
  int halvings = 0;
};

/// Returns the edges of a design where two different recognised faces meet.
std::vector<BorderEdge> face_borders(const Design& design) {
  std::vector<int> shared_vertex(std::size_t(design.vertices.rows()));
  std::iota(shared_vertex.begin(), shared_vertex.end(), 0);
  for (const auto& [first, added] : design.seams) shared_vertex[std::size_t(added)] = first;
  const auto vertex_at_point = [&](int v) { return shared_vertex[std::size_t(v)]; };
  std::map<std::pair<int, int>, std::vector<std::array<int, 2>>> sides;
  const std::vector<std::array<int, 3>> across = neighbours(design.triangles);
  for (int t = 0; t < int(design.triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) {
      std::array<int, 2> ends = {design.triangles(t, k), design.triangles(t, (k + 1) % 3)};
      if (across[std::size_t(t)][std::size_t(k)] >= 0) continue;
      if (vertex_at_point(ends[0]) > vertex_at_point(ends[1])) std::swap(ends[0], ends[1]);
      sides[{vertex_at_point(ends[0]), vertex_at_point(ends[1])}].push_back(ends);
    }
  std::vector<BorderEdge> borders;
  for (const auto& [ends, sides_of_edge] : sides) {
    if (sides_of_edge.size() != 2) continue;
    const int face_a = design.face[std::size_t(sides_of_edge[0][0])],
              face_b = design.face[std::size_t(sides_of_edge[1][0])];
    if (face_a >= 0 && face_b >= 0 && face_a != face_b)
      borders.push_back({{sides_of_edge[0], sides_of_edge[1]}});
  }
  return borders;
}

/// A chord of the true border of two faces, i.e. an edge of the mesh.
struct BorderChord {
  const AnalyticPatch &first, &second;
  Vector3d a, b;  // ends

  Vector3d middle() const { return 0.5 * (a + b); }
  /// Returns the unit vector across the border and tangential to the faces.
  Vector3d across() const {
    return project_to_surface(first, middle()).normal.cross(b - a).normalized();
  }
  /// Returns the component across the border of the difference of both normals at a point; it is 0
  /// on the border of tangential faces.
  double normal_difference(const Vector3d& p) const {
    return (project_to_surface(first, p).normal - project_to_surface(second, p).normal)
        .dot(across());
  }
  /// Returns the distance between both surfaces near a point, mm.
  double surface_gap(const Vector3d& p) const {
    return distance_of(second, project_to_surface(first, p).point);
  }
  /// Returns the error of the sliver that the chord assigns to the wrong face, mm: the distance
  /// between both surfaces at the middle of the chord, less the mean of those at its ends, where
  /// surfaces fitted to rounded vertices do not quite touch.
  double sliver_error() const {
    return std::abs(surface_gap(middle()) - 0.5 * (surface_gap(a) + surface_gap(b)));
  }
};

/// Returns the point of the border next to the middle of its chord; empty if there is none nearby.
std::optional<Vector3d> nearest_border_point(const BorderChord& chord) {
  // Newton's method with a difference quotient, starting on the chord.
  constexpr int max_iterations = 8;
  constexpr double max_fraction = 0.3, step_fraction = 1e-3;  // of the chord
  constexpr double min_edge_angle = 0.05;  // rad; a larger angle at an end is an edge of the part
  const double length = (chord.b - chord.a).norm();
  for (const Vector3d& end : {chord.a, chord.b})
    if ((project_to_surface(chord.first, end).normal - project_to_surface(chord.second, end).normal)
            .norm() > min_edge_angle)
      return std::nullopt;
  const Vector3d across = chord.across();
  double offset = 0.0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const auto point_at = [&](double s) {
      return project_to_surface(chord.first, chord.middle() + s * across).point;
    };
    const double difference = chord.normal_difference(point_at(offset));
    const double step = step_fraction * length;
    const double slope = (chord.normal_difference(point_at(offset + step)) - difference) / step;
    if (!(std::abs(slope) > 0.0)) return std::nullopt;
    offset -= difference / slope;
    if (!(std::abs(offset) < max_fraction * length)) return std::nullopt;
  }
  return project_to_surface(chord.first, chord.middle() + offset * across).point;
}

}  // namespace

Design refine_round_borders(const Design& design, const std::vector<AnalyticPatch>& faces,
                            double max_deviation) {
  require(std::isfinite(max_deviation) && max_deviation > 0.0,
          "refine_round_borders: max_deviation must be positive");
  constexpr int max_halvings = 8;  // these divide a chord of 30 degrees into chords of about 0.1
  if (design.face.empty()) return design;
  std::vector<BorderEdge> pending = face_borders(design);
  TriangleMesh mesh(design.triangles, design.vertices.rows());
  std::vector<Contact> contacts = vertex_contacts(design);
  std::map<std::pair<int, int>, int> edge_at;
  const auto register_edge = [&](int edge) {
    edge_at[{mesh.ends(edge)[0], mesh.ends(edge)[1]}] = edge;
  };
  for (int edge = 0; edge < mesh.edges(); ++edge)
    if (const auto [face_a, face_b] = mesh.faces_at(edge); face_a < 0 || face_b < 0)
      register_edge(edge);
  std::vector<std::uint8_t> judged = design.judged;
  std::vector<std::array<int, 2>> seams = design.seams;
  while (!pending.empty()) {
    const BorderEdge border = pending.back();
    pending.pop_back();
    const auto face = [&](std::size_t side) -> const AnalyticPatch& {
      return faces[std::size_t(contacts[std::size_t(border.ends[side][0])].face)];
    };
    const BorderChord chord{face(0), face(1), contacts[std::size_t(border.ends[0][0])].point,
                            contacts[std::size_t(border.ends[0][1])].point};
    if (!(chord.sliver_error() > max_deviation) || border.halvings == max_halvings) continue;
    const std::optional<Vector3d> border_point = nearest_border_point(chord);
    if (!border_point) continue;
    std::array<int, 2> new_vertices{};
    for (std::size_t side = 0; side < 2; ++side) {
      const auto [a, b] = border.ends[side];
      Contact contact = project_to_surface(face(side), *border_point);
      contact.face = contacts[std::size_t(a)].face;
      new_vertices[side] = int(contacts.size());
      contacts.push_back(contact);
      for (const int edge : mesh.split_edge(edge_at.at(std::minmax(a, b)))) register_edge(edge);
      if (!judged.empty()) judged.push_back(1);
    }
    seams.push_back(new_vertices);
    for (const std::size_t end : {0u, 1u})
      pending.push_back(
          {{{{border.ends[0][end], new_vertices[0]}, {border.ends[1][end], new_vertices[1]}}},
           border.halvings + 1});
  }
  Design result = resampled_design(design, contacts, mesh.triangles(), std::move(judged));
  result.seams = std::move(seams);
  return result;
}

}  // namespace abbe::cutting
