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

/// The connectivity of triangles while edges are split and flipped. Vertices, edges and faces are
/// numbered and keep their numbers; the caller stores the positions of the vertices.
class TriangleMesh {
 public:
  /// @throws std::invalid_argument if the triangles are no surface: more than two at an edge, or
  ///         inconsistent orientation
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
  /// Returns the two ends, then the corners to the left and to the right of the direction from the
  /// first end to the second; -1 beyond a rim.
  std::array<int, 4> quad(int edge) const;
  /// Returns the other edges of the faces at an edge.
  std::vector<int> sides(int edge) const;

  /// Returns true if the edge can be replaced by the other diagonal of its two faces, as far as
  /// topology is concerned.
  bool can_flip(int edge) const;
  /// Replaces the edge by that diagonal.
  void turn(int edge);
  /// Splits an edge into two and its faces into four; the new vertex gets the next number.
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
  double spacing = 0.1;             ///< mm, largest length of a judged edge
  Eigen::Index points = 1'000'000;  ///< largest number of vertices, unless more are given
};

/// Returns the design with its judged edges halved, longest first, until none is longer than the
/// spacing or the number of vertices is reached.
/// @throws std::invalid_argument if the spacing is not positive
Design subdivided(const Design& design, const SurfaceInterpolator& on_surface,
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
/// normal, since a border between groups is no edge of the part. `group` and `seams` record them;
/// areas are those of the triangles of the group alone, and vertices are numbered as by
/// `split_at_edges`. Designs derived from the result keep the groups (`resampled_design`): a
/// triangle within another belongs to its group.
/// @param group  (triangles) from 0
/// @throws std::invalid_argument unless there is one group for each triangle
Design split_at_groups(const Design& design, const std::vector<int>& group);

/// Returns the design with a separate vertex for every face that meets at a point, joined by
/// `seams`. Faces come from the recognition of surfaces, and no edge is assumed where two of them
/// meet. `face` records them; normals, areas and facet errors are those of the triangles of the
/// face.
/// @param face  (triangles) -1: none, which counts as a face here
/// @throws std::invalid_argument unless there is one face for each triangle
Design split_at_faces(const Design& design, const std::vector<int>& face);

/// Returns (m) the triangle across the side of each from its corner k to the next; -1 at a rim.
std::vector<std::array<int, 3>> neighbours(const Triangles& triangles);

/// Returns (n) the number of the connected patch of triangles to which each vertex belongs, from 0
/// in the order of their first vertices; groups and faces are connected by their seams.
std::vector<int> patches(const Design& design);

/// Returns the sharp edges of a split design: those that two triangles share by their points but
/// not by their vertices.
std::vector<Segment> sharp_edges(const Design& design);

/// Returns the number of edges whose fold is within `within` of `angle`, both in rad: for these the
/// rounding of their corners decides if `split_at_edges` treats them as sharp.
int count_edges_near_angle(const Design& design, double angle, double within);

/// Returns the design with `judged` = 0 at every vertex nearer than `margin` mm to an edge. A
/// margin of 0 changes nothing.
/// @throws std::invalid_argument if the margin is negative or not finite
Design judge_off_edges(const Design& design, std::vector<Segment> edges, double margin);

/// Returns a design of recognised faces with vertices added where two of them meet along a curve
/// without an edge, such as a floor and the torus around a boss: a chord of the curve cuts a sliver
/// off one face and assigns it to the other. The new vertices stand where the normals of both
/// surfaces agree, one for each face, joined by `seams`; chords are halved until the sliver is
/// nearer than `off` to both surfaces.
/// @param faces  indexed by `Design::face`
/// @param off    mm, > 0
/// @throws std::invalid_argument if `off` is not positive
Design refine_round_borders(const Design& design, const std::vector<AnalyticPatch>& faces,
                            double off);

}  // namespace abbe::cutting
