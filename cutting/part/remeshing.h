#pragma once

#include <array>
#include <memory>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/part/mesh.h"
#include "cutting/part/surface_fit.h"

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
  bool can_flip(int edge) const;
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

struct SubdivideOptions {
  double spacing = 0.1;             ///< mm, no judged edge is longer
  Eigen::Index points = 1'000'000;  ///< vertices at most, unless more are given
};

/// The design with its judged edges halved, longest first, until none is longer than the spacing or
/// there are as many vertices as may be.
/// @throws std::invalid_argument if the spacing is not positive
Design subdivided(const Design& design, const SurfaceInterpolator& on_surface,
                  const SubdivideOptions& options = {});

/// The design with a vertex of its own, and a normal of its own, for every smooth patch that meets
/// at a point: triangles belong to one patch across an edge if their normals differ by at most
/// `angle`. The first patch at a point keeps the vertex; those of the others follow at the end, in
/// the order of the triangles. Normals, areas and facet errors are those of the split design;
/// `judged` goes with the vertex.
/// @param angle  rad, in (0, pi)
/// @throws std::invalid_argument if the angle is out of range
Design split_at_edges(const Design& design, double angle);

/// The design with a vertex of its own for every group of triangles that meets at a point, so that
/// no vertex is of two: at the same place and with the same normal, since a border between groups
/// is no edge of the part. `group` and `seams` say which; areas are those of the triangles of the
/// group alone, and vertices are numbered as by `split_at_edges`. What is made of the design
/// afterwards keeps the groups (`resampled_design`): a triangle within another is of its group.
/// @param group  (triangles) from 0
/// @throws std::invalid_argument unless there is one group a triangle
Design split_at_groups(const Design& design, const std::vector<int>& group);

/// The design with a vertex of its own for every face of triangles that meets at a point, joined by
/// `seams`: what is a face says the recognition of surfaces, and where two meet no edge is. `face`
/// says which; normals, areas and facet errors are those of the triangles of the face.
/// @param face  (triangles) -1: none, which is a face here as well
/// @throws std::invalid_argument unless there is one face a triangle
Design split_at_faces(const Design& design, const std::vector<int>& face);

/// (m) the triangle across the side of each from its corner k to the next; -1 at a rim.
std::vector<std::array<int, 3>> neighbours(const Triangles& triangles);

/// (n) number of the connected patch of triangles to which each vertex belongs, from 0 in the order
/// of their first vertices; groups and faces of triangles are connected by their seams.
std::vector<int> patches(const Design& design);

/// The sharp edges of a split design: those that two triangles share by their points and not by
/// their vertices.
std::vector<Segment> sharp_edges(const Design& design);

/// How many edges fold by `angle` within `within`, both in rad: whether `split_at_edges` takes them
/// for sharp is up to the rounding of their corners.
int count_edges_near_angle(const Design& design, double angle, double within);

/// The same design with `judged` = 0 at every vertex nearer than `margin` mm to an edge. 0 leaves
/// all as it is.
/// @throws std::invalid_argument if the margin is negative or not finite
Design judge_off_edges(const Design& design, std::vector<Segment> edges, double margin);

/// A design of recognised faces with vertices added where two of them meet without an edge along a
/// curve, a floor and the torus around a boss: a chord of the curve cuts a sliver off one face that
/// the other covers then. The new vertices stand where the normals of both surfaces agree, one for
/// each face, joined by `seams`; chords are halved until what they cut off is nearer than `off` to
/// both surfaces.
/// @param faces  that `Design::face` numbers
/// @param off    mm, > 0
/// @throws std::invalid_argument if `off` is not positive
Design refine_round_borders(const Design& design, const std::vector<AnalyticPatch>& faces,
                            double off);

}  // namespace abbe::cutting
