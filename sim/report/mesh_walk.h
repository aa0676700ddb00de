#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace abbe::sim {

/// The triangles of a mesh in an order in which nearly every one shares an edge with one before it,
/// and the vertices in the order in which they are first met. Vertices without a triangle stand
/// last.
struct MeshWalk {
  std::vector<Eigen::Index> order;        ///< (n) old number of each
  std::vector<std::array<int, 3>> known;  ///< (n) new numbers of vertices met before: the edge over
                                          ///< which the walk came and the corner opposite it; the
                                          ///< one before, three times, where it came over none
  std::string code;                       ///< from which a page makes the triangles, range coded
};

/// @param triangles  any corners: holes, several parts, edges of more than two triangles; a
/// triangle
///                   keeps its sense and may begin at another of its corners
/// @param vertices   their number
/// Source: the edge conquest of Gumhold and Strasser 1998 and the valences of Touma and Gotsman
///         1998, without their splits of the border.
MeshWalk mesh_walk(const Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>& triangles,
                   Eigen::Index vertices);

}  // namespace abbe::sim
