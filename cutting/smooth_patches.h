#pragma once

#include <array>
#include <vector>

#include "cutting/mesh.h"
#include "cutting/segment_grid.h"

namespace abbe::cutting {

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
/// afterwards keeps the groups (`design_on`): a triangle within another is of its group.
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
int edges_about(const Design& design, double angle, double within);

/// The same design with `judged` = 0 at every vertex nearer than `margin` mm to an edge. 0 leaves
/// all as it is.
/// @throws std::invalid_argument if the margin is negative or not finite
Design judge_off_edges(const Design& design, std::vector<Segment> edges, double margin);

}  // namespace abbe::cutting
