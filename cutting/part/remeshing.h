#pragma once

#include <array>
#include <memory>
#include <vector>

#include "cutting/part/design_points.h"
#include "cutting/part/mesh.h"
#include "cutting/part/surface_fit.h"

/// Changes of the triangles of a design: splitting and flipping of edges, subdivision, and separate
/// vertices where patches, groups or faces meet.
namespace abbe::cutting {

/// The connectivity of triangles while edges are split and flipped. Vertices, edges and faces keep
/// their indices; the caller stores the positions of the vertices.
class TriangleMesh {
 public:
  /// @throws std::invalid_argument if the triangles do not form a surface, i.e. if there are more
  ///         than two at an edge or their orientations are inconsistent
  TriangleMesh(const Triangles& triangles, Eigen::Index vertices);
  ~TriangleMesh();
  TriangleMesh(TriangleMesh&&) noexcept;
  TriangleMesh& operator=(TriangleMesh&&) noexcept;

  int edges() const;
  int faces() const;
  std::array<int, 2> ends(int edge) const;        ///< the lower index first
  std::array<int, 2> faces_at(int edge) const;    ///< -1 beyond a rim
  std::array<int, 3> corners(int face) const;     ///< counter-clockwise
  std::array<int, 3> face_edges(int face) const;  ///< its edges
  /// Returns the two ends, then the corners to the left and to the right of the direction from the
  /// first end to the second; -1 beyond a rim.
  std::array<int, 4> quad(int edge) const;
  /// Returns the other edges of the faces at an edge.
  std::vector<int> adjacent_edges(int edge) const;

  /// Returns true if the topology permits to replace the edge by the other diagonal of its two
  /// faces.
  bool can_flip(int edge) const;
  /// Replaces the edge by the other diagonal of its two faces.
  void flip(int edge);
  /// Splits an edge into two and its faces into four; the new vertex gets the next index.
  /// @return the edges at the new vertex
  std::vector<int> split_edge(int edge);
  /// Splits a face into three.
  /// @return the edges at the new vertex, then those around it
  std::vector<int> split_face(int face);

  Triangles triangles() const;

 private:
  struct HalfEdges;
  std::unique_ptr<HalfEdges> mesh_;
};

struct SubdivideOptions {
  double spacing = 0.1;             ///< mm, maximum length of a judged edge
  Eigen::Index points = 1'000'000;  ///< maximum number of vertices, unless the design has more
};

/// Returns the design with its judged edges halved, longest first, until none is longer than the
/// spacing or the maximum number of vertices is reached.
/// @throws std::invalid_argument if the spacing is not positive
Design subdivide(const Design& design, const SurfaceInterpolator& on_surface,
                 const SubdivideOptions& options = {});

/// Returns the design with a separate vertex and normal for every smooth patch that meets at a
/// point: triangles belong to one patch across an edge if their normals differ by at most `angle`.
/// The first patch at a point keeps the vertex; those of the others follow at the end, in the order
/// of the triangles. Normals, areas and facet errors are those of the split design; `judged` is
/// copied with the vertex.
/// @param angle  rad, in (0, pi)
/// @throws std::invalid_argument if the angle is out of range
Design split_at_edges(const Design& design, double angle);

/// Returns the design with a separate vertex for every group of triangles that meets at a point, so
/// that each vertex belongs to one group. These vertices have the same position and the same
/// normal, since a border between groups is no edge of the part. `group` and `seams` record them.
/// The area of a vertex is that of the triangles of its group, and vertices are ordered as by
/// `split_at_edges`. Designs derived from the result by `resampled_design` keep the groups: a
/// triangle within another one belongs to its group.
/// @param group  (triangles) from 0
/// @throws std::invalid_argument unless there is one group for each triangle
Design split_at_groups(const Design& design, const std::vector<int>& group);

/// Returns the design with a separate vertex for every recognised face that meets at a point,
/// joined by `seams`; no edge is assumed where two faces meet. `face` records them; normals, areas
/// and facet errors are those of the triangles of the face.
/// @param face  (triangles) index of the face; the triangles on no face (-1) count as one face
/// @throws std::invalid_argument unless there is one face for each triangle
Design split_at_faces(const Design& design, const std::vector<int>& face);

/// Returns, for each triangle, the adjacent triangles across the sides from corner k to the next;
/// -1 at a rim.
std::vector<std::array<int, 3>> neighbours(const Triangles& triangles);

/// Returns (n) the number of the connected patch of triangles to which each vertex belongs, from 0
/// in the order of their first vertices; groups and faces are connected by their seams.
std::vector<int> patches(const Design& design);

/// Returns the sharp edges of a split design: those at which two triangles have the same points but
/// different vertices.
std::vector<Segment> sharp_edges(const Design& design);

/// Returns the number of edges at which the angle between the normals differs from `angle` by less
/// than `max_difference`, both in rad. For these edges the rounding of the corners decides if
/// `split_at_edges` treats them as sharp.
int count_edges_near_angle(const Design& design, double angle, double max_difference);

/// Returns the design with `judged` = 0 at every vertex nearer than `margin` mm to an edge. A
/// margin of 0 changes nothing.
/// @throws std::invalid_argument if the margin is negative or not finite
Design exclude_near_edges(const Design& design, std::vector<Segment> edges, double margin);

/// Returns a design of recognised faces with vertices added where two faces meet along a curve
/// without an edge, such as a floor and the torus around a boss: a chord of the curve cuts a sliver
/// off one face and assigns it to the other. The new vertices, one for each face, joined by
/// `seams`, are placed where the normals of both surfaces agree. Chords are halved until the
/// distance of the sliver from either surface is less than `max_deviation`.
/// @param faces          indexed by `Design::face`
/// @param max_deviation  mm, > 0
/// @throws std::invalid_argument if `max_deviation` is not positive
Design refine_round_borders(const Design& design, const std::vector<AnalyticPatch>& faces,
                            double max_deviation);

}  // namespace abbe::cutting
