#include "cutting/triangle_mesh.h"

#include <algorithm>
#include <stdexcept>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>

namespace abbe::cutting {

using OpenMesh::EdgeHandle;
using OpenMesh::FaceHandle;
using OpenMesh::VertexHandle;

struct TriangleMesh::HalfEdges : OpenMesh::TriMesh_ArrayKernelT<> {
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

bool TriangleMesh::may_turn(int edge) const {
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

}  // namespace abbe::cutting
