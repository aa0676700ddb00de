#pragma once

#include <array>
#include <memory>
#include <vector>

#include "cutting/mesh.h"

namespace abbe::cutting {

/// Which triangles meet where, while edges are split and turned. Vertices, edges and faces are
/// numbers, and keep them; where vertices stand is the caller's.
class TriangleMesh {
 public:
  /// @throws std::invalid_argument if the triangles are no surface: more than two at an edge, or
  ///         turned both ways
  TriangleMesh(const Triangles& triangles, Eigen::Index vertices);
  ~TriangleMesh();
  TriangleMesh(TriangleMesh&&) noexcept;
  TriangleMesh& operator=(TriangleMesh&&) noexcept;

  int edges() const;
  int faces() const;
  std::array<int, 2> ends(int edge) const;      ///< the lower number first
  std::array<int, 2> faces_at(int edge) const;  ///< -1 beyond a rim
  std::array<int, 3> corners(int face) const;   ///< counter-clockwise
  std::array<int, 3> sides_of(int face) const;  ///< its edges
  /// From one end to the other, then the corner at the left and that at the right; -1 beyond a rim.
  std::array<int, 4> quad(int edge) const;
  /// The other edges of the faces at an edge.
  std::vector<int> sides(int edge) const;

  /// Whether the edge across the two faces can take the place of an edge, as far as topology goes.
  bool may_turn(int edge) const;
  void turn(int edge);
  /// The edge becomes two, its faces four; the new vertex has the next number. @return the edges at
  /// the new vertex
  std::vector<int> split_edge(int edge);
  /// The face becomes three. @return the edges at the new vertex, then those around it
  std::vector<int> split_face(int face);

  Triangles triangles() const;

 private:
  struct HalfEdges;
  std::unique_ptr<HalfEdges> mesh_;
};

}  // namespace abbe::cutting
