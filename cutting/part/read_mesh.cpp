#include "cutting/part/read_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include "cutting/part/binary_mesh_formats.h"
#include "cutting/part/index_sets.h"
#include "cutting/part/mesh_file.h"
#include "cutting/part/text_mesh_formats.h"
#include "kinematics/text.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

/// An edge of a triangle from `from` to `to`; `across` is its third corner.
struct HalfEdge {
  int from, to, across;
};

/// Checks that every triangle has an area and coordinates of a reasonable size.
void check_triangles(const MeshSource& source, const TriangleSoup& soup) {
  if (soup.faces.empty()) source.refuse("a mesh of triangles", "none");
  for (std::size_t f = 0; f < soup.faces.size(); ++f) {
    const Vector3d& a = soup.points[static_cast<std::size_t>(soup.faces[f][0])];
    const Vector3d& b = soup.points[static_cast<std::size_t>(soup.faces[f][1])];
    const Vector3d& c = soup.points[static_cast<std::size_t>(soup.faces[f][2])];
    const double longest =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const double twice_area = (b - a).cross(c - a).norm();
    if (!std::isfinite(longest) || longest > 1e30)
      source.refuse("coordinates below 1e15", coordinates_text(a),
                    soup.line.empty() ? 0 : soup.line[f], 1);
    // 1e-7: single-precision coordinates cannot define the normal of a flatter triangle.
    if (!(twice_area > 1e-7 * longest))
      source.refuse(
          "triangles with an area above 0 (height above 1e-7 of the longest edge)",
          fmt::format("triangle {} at {}, which is degenerate", f + 1, coordinates_text(a)),
          soup.line.empty() ? 0 : soup.line[f], 1);
  }
}

/// Returns the range of half-edges from one vertex to another.
auto range(const std::vector<HalfEdge>& edges, int from, int to) {
  const auto is_before = [](const HalfEdge& a, const HalfEdge& b) {
    return std::pair(a.from, a.to) < std::pair(b.from, b.to);
  };
  return std::equal_range(edges.begin(), edges.end(), HalfEdge{from, to, 0}, is_before);
}

/// Checks the edges of a surface; a rim is permitted if `open`. Returns its number of edges.
std::size_t check_edges(const MeshSource& source, const TriangleSoup& soup,
                        const std::vector<HalfEdge>& edges, bool open) {
  std::size_t rim = 0;
  const HalfEdge* first_rim_edge = nullptr;
  const auto edge_text = [&](const HalfEdge& e) {
    return coordinates_text(soup.points[static_cast<std::size_t>(e.from)]) + " - " +
           coordinates_text(soup.points[static_cast<std::size_t>(e.to)]);
  };
  for (const HalfEdge& edge : edges) {
    const auto same_direction = range(edges, edge.from, edge.to);
    const auto opposite = range(edges, edge.to, edge.from);
    const auto same_count = same_direction.second - same_direction.first,
               opposite_count = opposite.second - opposite.first;
    if (same_count + opposite_count > 2)
      source.refuse(
          "at most two triangles per edge",
          fmt::format("{} at edge {}: not manifold", same_count + opposite_count, edge_text(edge)));
    if (same_count == 2)
      source.refuse("all triangles with the same orientation",
                    fmt::format("two that are opposed at edge {}", edge_text(edge)));
    if (opposite_count == 0 && rim++ == 0) first_rim_edge = &edge;
  }
  if (rim > 0 && !open)
    throw MeshWithRim(
        source.name, 0, 0, "a closed mesh",
        fmt::format("{} open edges, the first at {}", rim, edge_text(*first_rim_edge)));
  return rim;
}

/// Checks that no vertex joins two fans of triangles.
void check_fans(const MeshSource& source, const TriangleSoup& soup,
                const std::vector<HalfEdge>& edges) {
  for (std::size_t first = 0; first < edges.size();) {
    const int vertex = edges[first].from;
    std::size_t last = first;
    while (last < edges.size() && edges[last].from == vertex) ++last;
    // The walk leads once around the vertex: across(v -> a) is the b of the next v -> b. At a rim
    // it begins with the edge that has no predecessor.
    const auto next = [&](const HalfEdge& e) {
      const auto next_edges = range(edges, vertex, e.across);
      return next_edges.first == next_edges.second ? nullptr : &*next_edges.first;
    };
    const HalfEdge* start = &edges[first];
    for (std::size_t i = first; i < last; ++i) {
      const auto previous_edges = range(edges, edges[i].to, vertex);
      if (previous_edges.first == previous_edges.second) start = &edges[i];
    }
    std::size_t edges_around = 1;
    for (const HalfEdge* e = next(*start); e != nullptr && e != start; e = next(*e)) ++edges_around;
    if (edges_around != last - first)
      source.refuse("one fan of triangles around each vertex",
                    fmt::format("two fans that touch at {}: not manifold",
                                coordinates_text(soup.points[static_cast<std::size_t>(vertex)])));
    first = last;
  }
}

using HalfEdgeMesh = OpenMesh::TriMesh_ArrayKernelT<>;

/// Builds the same surface as half-edges of OpenMesh, which must accept every triangle and count
/// the same rim: an independent check of the edges and fans. OpenMesh's own readers are not used,
/// because they keep only floats, silently drop or duplicate triangles that are not manifold, and
/// request absurd memory for valid files (an OFF with a comment below its first line).
void check_half_edge_mesh(const MeshSource& source, const TriangleSoup& soup, std::size_t rim) {
  omerr().disable();  // the errors below replace its messages and state the location
  HalfEdgeMesh mesh;
  mesh.reserve(soup.points.size(), soup.points.size() + soup.faces.size(), soup.faces.size());
  for (std::size_t i = 0; i < soup.points.size(); ++i) mesh.add_vertex({});
  const auto handle = [](int i) { return OpenMesh::VertexHandle(i); };
  for (const TriangleSoup::Face& f : soup.faces)
    if (!mesh.add_face(handle(f[0]), handle(f[1]), handle(f[2])).is_valid())
      source.refuse("triangles that form a surface",
                    fmt::format("one at {} that does not fit: not manifold",
                                coordinates_text(soup.points[static_cast<std::size_t>(f[0])])));
  for (const auto v : mesh.vertices())
    if (!mesh.is_manifold(v))
      source.refuse("one fan of triangles around each vertex",
                    fmt::format("several at {}: not manifold",
                                coordinates_text(soup.points[static_cast<std::size_t>(v.idx())])));
  const auto open_edges = std::count_if(mesh.edges_begin(), mesh.edges_end(),
                                        [&](const auto& e) { return mesh.is_boundary(e); });
  if (static_cast<std::size_t>(open_edges) != rim)
    source.refuse(fmt::format("{} open edges", rim), fmt::format("{} in OpenMesh", open_edges));
}

/// A connected component of a mesh.
struct Shell {
  double volume = 0.0;  ///< signed
  Eigen::AlignedBox3d box;
};

/// Returns the connected components of a closed mesh.
std::vector<Shell> shells(const TriangleSoup& soup) {
  DisjointSets sets(soup.points.size());
  for (const TriangleSoup::Face& f : soup.faces)
    for (std::size_t k = 1; k < 3; ++k) sets.join(f[0], f[k]);

  // Relative to a point of the body, so that its distance from the origin causes no cancellation in
  // the volume.
  const Vector3d origin = soup.points[static_cast<std::size_t>(soup.faces[0][0])];
  std::vector<int> shell_index(soup.points.size(), -1);
  std::vector<Shell> result;
  for (const TriangleSoup::Face& f : soup.faces) {
    int& index = shell_index[static_cast<std::size_t>(sets.representative(f[0]))];
    if (index < 0) {
      index = static_cast<int>(result.size());
      result.emplace_back();
    }
    Shell& shell = result[static_cast<std::size_t>(index)];
    std::array<Vector3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      shell.box.extend(soup.points[static_cast<std::size_t>(f[k])]);
      p[k] = soup.points[static_cast<std::size_t>(f[k])] - origin;
    }
    shell.volume += p[0].cross(p[1]).dot(p[2]) / 6.0;
  }
  return result;
}

/// Checks that all triangles of a closed mesh face outwards.
void check_outward(const MeshSource& source, const TriangleSoup& soup) {
  const std::vector<Shell> all_shells = shells(soup);
  double volume = 0.0;
  for (const Shell& shell : all_shells) volume += shell.volume;
  const std::string expected =
      "triangles ordered counter-clockwise as seen from outside (volume above 0)";
  if (!(volume > 0.0))
    source.refuse(expected,
                  fmt::format("an inside-out mesh, volume {:.6g} in units of the file", volume));
  for (const Shell& cavity : all_shells) {
    // A shell of negative volume is a cavity, which must lie inside a body.
    if (cavity.volume > 0.0) continue;
    const bool is_inside = std::any_of(
        all_shells.begin(), all_shells.end(),
        [&](const Shell& body) { return body.volume > 0.0 && body.box.contains(cavity.box); });
    if (!is_inside)
      source.refuse(expected, fmt::format("an inside-out shell between {} and {}",
                                          coordinates_text(cavity.box.min()),
                                          coordinates_text(cavity.box.max())));
  }
}

/// Returns all half-edges of a soup in the order of `from`, then `to`.
std::vector<HalfEdge> half_edges(const TriangleSoup& soup) {
  std::vector<HalfEdge> edges;
  edges.reserve(3 * soup.faces.size());
  for (const TriangleSoup::Face& f : soup.faces)
    for (std::size_t k = 0; k < 3; ++k) edges.push_back({f[k], f[(k + 1) % 3], f[(k + 2) % 3]});
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::pair(a.from, a.to) < std::pair(b.from, b.to);
  });
  return edges;
}

/// Returns true if every edge has exactly one triangle on either side.
bool has_no_rim(const std::vector<HalfEdge>& edges) {
  return std::all_of(edges.begin(), edges.end(), [&](const HalfEdge& edge) {
    const auto same_direction = range(edges, edge.from, edge.to);
    const auto opposite = range(edges, edge.to, edge.from);
    return same_direction.second - same_direction.first == 1 &&
           opposite.second - opposite.first == 1;
  });
}

/// Checks that the triangles form a surface: no degenerate triangles, at most two at an edge and
/// one fan at a vertex, consistent orientation, no rim unless `open`, and a closed body with
/// outward orientation. OpenMesh must agree. Every point must be used.
/// @param edges  those of `soup`
/// @throws BadInput with the location
void check_surface(const MeshSource& source, const TriangleSoup& soup,
                   const std::vector<HalfEdge>& edges, bool open) {
  check_triangles(source, soup);
  const std::size_t rim = check_edges(source, soup, edges, open);
  check_fans(source, soup, edges);
  check_half_edge_mesh(source, soup, rim);
  if (rim == 0) check_outward(source, soup);
}

void check_options(const ReadMeshOptions& options) {
  const auto is_positive = [](double value) { return std::isfinite(value) && value > 0.0; };
  if (!is_positive(options.unit_mm))
    throw std::invalid_argument("read_mesh: unit_mm must be positive");
  if (!is_positive(options.travel_ratio) || options.travel_ratio < 1.0)
    throw std::invalid_argument("read_mesh: travel_ratio must be at least 1");
  if (options.travel && !(options.travel->allFinite() && options.travel->maxCoeff() > 0.0))
    throw std::invalid_argument("read_mesh: travel must be positive and finite");
}

TriangleSoup read_soup(const MeshSource& source, const std::string& kind,
                       const MarkSelection& requested_marks) {
  if (kind == "stl") return read_stl(source, requested_marks);
  if (kind == "obj") return read_obj(source, requested_marks);
  if (kind == "ply") return read_ply(source, requested_marks);
  if (kind == "off") return read_off(source, requested_marks);
  source.refuse("a mesh file ending in .stl, .obj, .ply or .off", quoted_excerpt("." + kind));
}

/// Triangles with shared vertices, and their half-edges.
struct IndexedMesh {
  TriangleSoup soup;
  std::vector<HalfEdge> edges;
};

/// Returns the mesh with equal points merged to one vertex, except in a body that is closed as
/// indexed in the file: touching bodies have common points but are closed separately.
IndexedMesh share_vertices(const TriangleSoup& file_soup, const std::string& kind) {
  if (kind != "stl") {
    TriangleSoup soup = drop_unused_points(file_soup);
    std::vector<HalfEdge> edges = half_edges(soup);
    if (has_no_rim(edges)) return {std::move(soup), std::move(edges)};
  }
  TriangleSoup soup = drop_unused_points(merge_equal_points(file_soup));
  std::vector<HalfEdge> edges = half_edges(soup);
  return {std::move(soup), std::move(edges)};
}

/// Returns the design in mm, with normals, areas and facet errors.
Design to_design(const MeshSource& source, const TriangleSoup& soup, double unit_mm) {
  Design design;
  design.vertices.resize(static_cast<Eigen::Index>(soup.points.size()), 3);
  design.triangles.resize(static_cast<Eigen::Index>(soup.faces.size()), 3);
  for (std::size_t i = 0; i < soup.points.size(); ++i)
    design.vertices.row(static_cast<Eigen::Index>(i)) = unit_mm * soup.points[i].transpose();
  for (std::size_t f = 0; f < soup.faces.size(); ++f)
    for (int k = 0; k < 3; ++k)
      design.triangles(static_cast<Eigen::Index>(f), k) =
          soup.faces[f][static_cast<std::size_t>(k)];
  design.normals = vertex_normals(design.vertices, design.triangles);
  design.area = vertex_area(design.vertices, design.triangles);
  design.facet_error = facet_error(design.vertices, design.normals, design.triangles);
  design.judged.assign(soup.points.size(), 1);
  // Normals of opposite triangles cancel to zero; all others have length 1.
  for (Eigen::Index i = 0; i < design.normals.rows(); ++i)
    if (!(design.normals.row(i).norm() > 0.5))
      source.refuse("a normal at every vertex",
                    "triangles whose normals cancel at " +
                        coordinates_text(design.vertices.row(i).transpose()));
  return design;
}

/// Checks that the machine could produce the part; otherwise suggests the unit of the file.
void check_size(const MeshSource& source, const Eigen::AlignedBox3d& box,
                const ReadMeshOptions& options) {
  if (!options.travel) return;
  const double part_size = box.sizes().maxCoeff();
  const double travel = options.travel->maxCoeff();
  if (part_size <= options.travel_ratio * travel) return;
  // The units that are confused most often, in the order in which they are tried.
  static const std::array<std::pair<double, const char*>, 5> units = {
      {{1.0, "mm"}, {25.4, "inches"}, {10.0, "cm"}, {1e-3, "um"}, {1000.0, "m"}}};
  std::string guess = "no common unit explains this size";
  for (const auto& [unit_mm, name] : units)
    if (const double size_in_unit = part_size / options.unit_mm * unit_mm; size_in_unit <= travel) {
      guess = fmt::format("read in {} it would be {:.4g} mm long", name, size_in_unit);
      break;
    }
  source.refuse(fmt::format("a part of at most {:.4g} mm, {:.4g} times the travel of {:.4g} mm "
                            "(set the unit of the mesh)",
                            travel * options.travel_ratio, options.travel_ratio, travel),
                fmt::format("{:.4g} x {:.4g} x {:.4g} mm: {}", box.sizes().x(), box.sizes().y(),
                            box.sizes().z(), guess));
}

}  // namespace

Design read_mesh(const std::filesystem::path& file, const ReadMeshOptions& options) {
  return read_mesh_with_marks(file, options, {}).design;
}

MarkedMesh read_mesh_with_marks(const std::filesystem::path& file, const ReadMeshOptions& options,
                                const MarkSelection& requested_marks) {
  check_options(options);
  const std::string ending = lower(file.extension().string());
  const std::string kind = ending.empty() ? ending : ending.substr(1);
  // Three corners per triangle are counted in int.
  const MeshSource source = load_mesh_source(
      file, options.max_bytes, std::min<std::int64_t>(options.max_triangles, 700'000'000));
  TriangleSoup file_soup = read_soup(source, kind, requested_marks);
  FaceMarks marks = std::exchange(file_soup.marks, {});
  const auto [soup, edges] = share_vertices(file_soup, kind);
  check_surface(source, soup, edges, options.open);
  Design design = to_design(source, soup, options.unit_mm);
  Eigen::AlignedBox3d box;
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i)
    box.extend(design.vertices.row(i).transpose());
  check_size(source, box, options);
  return {std::move(design), std::move(marks)};
}

}  // namespace abbe::cutting
