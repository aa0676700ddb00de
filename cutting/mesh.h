#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cutting/segment_grid.h"

namespace abbe::cutting {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;  ///< (n x 3)
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;  ///< (m x 3)

/// The design surface that carries the residual: where, along which normal, for how much area.
struct Design {
  Points vertices;       ///< (n x 3) mm
  Points normals;        ///< (n x 3) unit, outward
  Triangles triangles;   ///< (m x 3) counter-clockwise seen from outside
  Eigen::VectorXd area;  ///< (n) mm^2, a third of the triangles around (the weight of a vertex)
  Eigen::VectorXd facet_error;  ///< (n) mm, estimated sag between mesh and smooth surface; 0 for
                                ///< surfaces that are known, declared or recognised
  std::vector<std::uint8_t> judged;  ///< (n) 0 where the scene leaves the vertex out (status 2)
  std::vector<int> face;             ///< (n) the recognised face of each, -1: none; empty: no faces
  std::vector<int> group;  ///< (n) the group of all triangles at the vertex; empty: no groups
  /// Vertices at one place, within the tolerance of recognition, that a border between groups or
  /// between faces of a smooth patch parts: no edge of the part.
  std::vector<std::array<int, 2>> seams;
};

/// The design moved: vertices and normals by T.
Design transformed(const Design& design, const Eigen::Isometry3d& T);

/// (n) mm^2, a third of the triangles around each vertex.
Eigen::VectorXd vertex_area(const Points& vertices, const Triangles& triangles);

/// (n x 3) unit: the normals of the triangles around each vertex, weighted by the angle at it. Zero
/// where no triangle with an area touches the vertex.
Points vertex_normals(const Points& vertices, const Triangles& triangles);

/// (n) mm, estimated sag of the edges at each vertex below the smooth surface through the vertices:
/// the largest L theta / 8 over its edges, L the length, theta the angle between the normals at the
/// two ends (an arc of radius L / theta). On a sphere meshed by equal triangles the middle of a
/// triangle sags 4/3 of that. At a sharp edge of the part it says how much a rounding would take
/// away.
Eigen::VectorXd facet_error(const Points& vertices, const Points& normals,
                            const Triangles& triangles);

/// How well the triangles of a design follow its surface where it is judged. An edge of the part is
/// no fault of theirs: triangles that leave a vertex normal by more than 30 degrees are left out;
/// on a recognised face the surface is known between the vertices too.
struct Coarseness {
  double facet_error = 0.0;  ///< mm, the largest L theta / 8 between judged vertices
  int judged = 0;            ///< vertices
  int sharp = 0;             ///< judged vertices at a triangle left out
};
Coarseness coarseness(const Design& design);

/// What of a closed body is judged: the region that looks up.
struct JudgeTopOptions {
  double min_normal_z = 0.5;  ///< a triangle is of the top if its normal's z is at least this
  double margin = 0.0;        ///< mm, vertices nearer than this to the edge of the top are left out
  /// The edge of the top, where it is known from before the design was parted and subdivided.
  std::optional<std::vector<Segment>> rim = {};
};

/// The edge of the top: sides that a triangle of the top shares with none other. Borders between
/// groups or faces are no edge, unless vertices were added on them.
std::vector<Segment> rim_of_top(const Design& design, double min_normal_z);

/// The same design with `judged` = 0 at every vertex that is not inside the top: one that touches a
/// triangle which is not of the top (so the rim itself is out) or lies within the margin of the
/// rim. Vertices that were not judged before stay so.
/// @throws std::invalid_argument if an option is not finite or the margin is negative
Design judge_top(const Design& design, const JudgeTopOptions& options = {});

}  // namespace abbe::cutting
