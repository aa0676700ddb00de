#include "cutting/mesh_audit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

#include "cutting/disjoint_sets.h"
#include "cutting/read_mesh.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

void check_triangles(const MeshSource& source, const Soup& soup) {
  if (soup.faces.empty()) source.refuse("a mesh of triangles", "none");
  for (std::size_t f = 0; f < soup.faces.size(); ++f) {
    const Vector3d& a = soup.points[static_cast<std::size_t>(soup.faces[f][0])];
    const Vector3d& b = soup.points[static_cast<std::size_t>(soup.faces[f][1])];
    const Vector3d& c = soup.points[static_cast<std::size_t>(soup.faces[f][2])];
    const double longest =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const double twice_area = (b - a).cross(c - a).norm();
    if (!std::isfinite(longest) || longest > 1e30)
      source.refuse("coordinates below 1e15", place_text(a), soup.line.empty() ? 0 : soup.line[f],
                    1);
    if (!(twice_area > 1e-7 * longest))
      source.refuse("triangles with an area (height above 1e-7 of the longest edge)",
                    fmt::format("a degenerate one, number {}, at {}", f + 1, place_text(a)),
                    soup.line.empty() ? 0 : soup.line[f], 1);
  }
}

auto range(const std::vector<HalfEdge>& edges, int from, int to) {
  const auto before = [](const HalfEdge& a, const HalfEdge& b) {
    return std::pair(a.from, a.to) < std::pair(b.from, b.to);
  };
  return std::equal_range(edges.begin(), edges.end(), HalfEdge{from, to, 0}, before);
}

/// Refuses edges that are no edges of a surface; the rim is allowed if `open`. Returns its length.
std::size_t check_edges(const MeshSource& source, const Soup& soup,
                        const std::vector<HalfEdge>& edges, bool open) {
  std::size_t rim = 0;
  const HalfEdge* first_of_rim = nullptr;
  const auto place = [&](const HalfEdge& e) {
    return place_text(soup.points[static_cast<std::size_t>(e.from)]) + " - " +
           place_text(soup.points[static_cast<std::size_t>(e.to)]);
  };
  for (const HalfEdge& edge : edges) {
    const auto same = range(edges, edge.from, edge.to);
    const auto opposite = range(edges, edge.to, edge.from);
    const auto along = same.second - same.first, against = opposite.second - opposite.first;
    if (along + against > 2)
      source.refuse("at most two triangles at an edge",
                    fmt::format("{} at the edge {}: not manifold", along + against, place(edge)));
    if (along == 2)
      source.refuse("all triangles turned the same way",
                    fmt::format("two that disagree at the edge {}", place(edge)));
    if (against == 0 && rim++ == 0) first_of_rim = &edge;
  }
  if (rim > 0 && !open)
    throw MeshWithRim(source.name, 0, 0, "a closed mesh",
                      fmt::format("{} open edges, the first at {}", rim, place(*first_of_rim)));
  return rim;
}

/// Refuses vertices at which two fans of triangles touch.
void check_fans(const MeshSource& source, const Soup& soup, const std::vector<HalfEdge>& edges) {
  for (std::size_t first = 0; first < edges.size();) {
    const int vertex = edges[first].from;
    std::size_t last = first;
    while (last < edges.size() && edges[last].from == vertex) ++last;
    // walk once around: across(v -> a) is the b of the next v -> b; begin where nothing leads to
    const auto next = [&](const HalfEdge& e) {
      const auto found = range(edges, vertex, e.across);
      return found.first == found.second ? nullptr : &*found.first;
    };
    const HalfEdge* start = &edges[first];
    for (std::size_t i = first; i < last; ++i) {
      const auto before = range(edges, edges[i].to, vertex);
      if (before.first == before.second) start = &edges[i];
    }
    std::size_t walked = 1;
    for (const HalfEdge* e = next(*start); e != nullptr && e != start; e = next(*e)) ++walked;
    if (walked != last - first)
      source.refuse("one fan of triangles at a vertex",
                    fmt::format("two that touch at {}: not manifold",
                                place_text(soup.points[static_cast<std::size_t>(vertex)])));
    first = last;
  }
}

using HalfEdgeMesh = OpenMesh::TriMesh_ArrayKernelT<>;

/// The same surface as OpenMesh's half-edges, which must take every triangle and count the same
/// rim: a second opinion on the edges and fans above. Its own readers are not used: they keep float
/// only, drop or double what is not manifold in silence, and ask for absurd memory on sound files
/// (an OFF with a comment under its first line).
void check_half_edge_mesh(const MeshSource& source, const Soup& soup, std::size_t rim) {
  omerr().disable();  // what it has to say is reported below, with the place
  HalfEdgeMesh mesh;
  mesh.reserve(soup.points.size(), soup.points.size() + soup.faces.size(), soup.faces.size());
  for (std::size_t i = 0; i < soup.points.size(); ++i) mesh.add_vertex({});
  const auto handle = [](int i) { return OpenMesh::VertexHandle(i); };
  for (const Soup::Face& f : soup.faces)
    if (!mesh.add_face(handle(f[0]), handle(f[1]), handle(f[2])).is_valid())
      source.refuse("triangles that join to a surface",
                    fmt::format("one at {} that does not: not manifold",
                                place_text(soup.points[static_cast<std::size_t>(f[0])])));
  for (const auto v : mesh.vertices())
    if (!mesh.is_manifold(v))
      source.refuse("one fan of triangles at a vertex",
                    fmt::format("more at {}: not manifold",
                                place_text(soup.points[static_cast<std::size_t>(v.idx())])));
  const auto open_edges = std::count_if(mesh.edges_begin(), mesh.edges_end(),
                                        [&](const auto& e) { return mesh.is_boundary(e); });
  if (static_cast<std::size_t>(open_edges) != rim)
    source.refuse(fmt::format("{} open edges", rim), fmt::format("{} in OpenMesh", open_edges));
}

struct Shell {
  double volume = 0.0;  ///< signed
  Eigen::AlignedBox3d box;
};

std::vector<Shell> shells(const Soup& soup) {
  DisjointSets sets(soup.points.size());
  for (const Soup::Face& f : soup.faces)
    for (std::size_t k = 1; k < 3; ++k) sets.join(f[0], f[k]);

  const Vector3d origin = soup.points[static_cast<std::size_t>(soup.faces[0][0])];
  std::vector<int> number(soup.points.size(), -1);
  std::vector<Shell> result;
  for (const Soup::Face& f : soup.faces) {
    int& id = number[static_cast<std::size_t>(sets.name_of(f[0]))];
    if (id < 0) {
      id = static_cast<int>(result.size());
      result.emplace_back();
    }
    Shell& shell = result[static_cast<std::size_t>(id)];
    std::array<Vector3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      shell.box.extend(soup.points[static_cast<std::size_t>(f[k])]);
      p[k] = soup.points[static_cast<std::size_t>(f[k])] - origin;
    }
    shell.volume += p[0].cross(p[1]).dot(p[2]) / 6.0;
  }
  return result;
}

void check_outward(const MeshSource& source, const Soup& soup) {
  const std::vector<Shell> all = shells(soup);
  double volume = 0.0;
  for (const Shell& shell : all) volume += shell.volume;
  const std::string expected =
      "triangles that are counter-clockwise seen from outside (volume above 0)";
  if (!(volume > 0.0))
    source.refuse(expected,
                  fmt::format("a flipped mesh, volume {:.6g} in units of the file", volume));
  for (const Shell& cavity : all) {
    if (cavity.volume > 0.0) continue;
    const bool inside = std::any_of(all.begin(), all.end(), [&](const Shell& body) {
      return body.volume > 0.0 && body.box.contains(cavity.box);
    });
    if (!inside)
      source.refuse(expected,
                    fmt::format("a flipped shell between {} and {}", place_text(cavity.box.min()),
                                place_text(cavity.box.max())));
  }
}

}  // namespace

std::vector<HalfEdge> half_edges(const Soup& soup) {
  std::vector<HalfEdge> edges;
  edges.reserve(3 * soup.faces.size());
  for (const Soup::Face& f : soup.faces)
    for (std::size_t k = 0; k < 3; ++k) edges.push_back({f[k], f[(k + 1) % 3], f[(k + 2) % 3]});
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::pair(a.from, a.to) < std::pair(b.from, b.to);
  });
  return edges;
}

bool is_closed(const std::vector<HalfEdge>& edges) {
  return std::all_of(edges.begin(), edges.end(), [&](const HalfEdge& edge) {
    const auto same = range(edges, edge.from, edge.to);
    const auto opposite = range(edges, edge.to, edge.from);
    return same.second - same.first == 1 && opposite.second - opposite.first == 1;
  });
}

void audit(const MeshSource& source, const Soup& soup, const std::vector<HalfEdge>& edges,
           bool open) {
  check_triangles(source, soup);
  const std::size_t rim = check_edges(source, soup, edges, open);
  check_fans(source, soup, edges);
  check_half_edge_mesh(source, soup, rim);
  if (rim == 0) check_outward(source, soup);
}

}  // namespace abbe::cutting
