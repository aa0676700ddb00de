#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "cutting/face_marks.h"
#include "cutting/mesh_source.h"

namespace abbe::cutting {

/// Triangles as a file has them. What is done to a soup keeps their order, so that its marks, which
/// `merged` and `without_unused` leave behind, stand for theirs.
struct Soup {
  using Face = std::array<int, 3>;
  std::vector<Eigen::Vector3d> points;
  std::vector<Face> faces;
  std::vector<int> line;  ///< of every face, empty if the file is binary
  FaceMarks marks;        ///< those that were asked for
};

/// A face of a file: its corners, and the line on which it stands, 0 in a binary file.
struct Polygon {
  std::vector<int> corners;
  int line = 0;
};
inline constexpr int most_corners = 1000;  ///< of a face

/// Adds a face as triangles; a triangle is taken as it is.
/// @throws BadInput if the face has no area, its outline crosses itself, or it is one too many
Soup with_face(Soup soup, Polygon face, const MeshSource& source);

/// Corners at equal points made one vertex, in the order of their first use.
Soup merged(const Soup& soup);

/// Only the points that a face uses, in their order.
Soup without_unused(const Soup& soup);

/// "(x, y, z)" in six digits.
std::string place_text(const Eigen::Vector3d& p);

}  // namespace abbe::cutting
