#include "cutting/recognise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>

#include "cutting/grown_faces.h"
#include "cutting/smooth_patches.h"
#include "kinematics/require.h"
#include "kinematics/turn_between.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

/// The triangles of a mesh by the face on which they are, -1 on none, and the faces.
struct Sorted {
  std::vector<int> face;  // (triangles)
  std::vector<RecognisedPatch> faces;
  int untried = 0;  // triangles
};

/// Vertices and triangles of each patch.
std::vector<GrownFace> whole_patches(const Design& design, double tolerance) {
  const std::vector<int> number = patches(design);
  const int count = number.empty() ? 0 : 1 + *std::max_element(number.begin(), number.end());
  std::vector<std::vector<int>> vertices(std::size_t(count), std::vector<int>{});
  std::vector<std::vector<int>> triangles(std::size_t(count), std::vector<int>{});
  for (std::size_t i = 0; i < number.size(); ++i)
    vertices[std::size_t(number[i])].push_back(int(i));
  for (int t = 0; t < int(design.triangles.rows()); ++t)
    triangles[std::size_t(number[std::size_t(design.triangles(t, 0))])].push_back(t);
  std::vector<GrownFace> found;
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    if (triangles[k].empty()) continue;
    FacetPatch patch = facet_patch(design, std::move(vertices[k]), std::move(triangles[k]));
    if (const auto surface = surface_of(patch, tolerance))
      found.push_back({*surface, std::move(patch.triangles)});
  }
  return found;
}

Sorted sorted(const Design& design, double tolerance) {
  std::vector<GrownFace> all = whole_patches(design, tolerance);
  std::vector<char> open(std::size_t(design.triangles.rows()), 1);
  for (const GrownFace& one : all)
    for (const int t : one.triangles) open[std::size_t(t)] = 0;
  GrownFaces grown = grown_faces(design, open, tolerance);
  for (GrownFace& one : grown.faces) all.push_back(std::move(one));
  Sorted by_face{std::vector<int>(open.size(), -1), {}, grown.untried};
  for (GrownFace& one : all) {
    for (const int t : one.triangles) by_face.face[std::size_t(t)] = int(by_face.faces.size());
    by_face.faces.push_back(std::move(one.surface));
  }
  return by_face;
}

/// (n) the largest angle by which facets on no face turn at each vertex: those at it, and the ones
/// beside them, which are the other halves of quadrangles.
Eigen::VectorXd turns_of_unrecognised(const Design& design) {
  const auto normal = [&](int t) {
    const auto corner = [&](int k) -> Vector3d {
      return design.vertices.row(design.triangles(t, k));
    };
    return (corner(1) - corner(0)).cross(corner(2) - corner(0)).eval();
  };
  const auto count = int(design.triangles.rows());
  const std::vector<std::array<int, 3>> across = neighbours(design.triangles);
  Eigen::VectorXd of_triangle = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd turn = Eigen::VectorXd::Zero(design.vertices.rows());
  const auto is_none = [&](int t) { return design.face[std::size_t(design.triangles(t, 0))] < 0; };
  for (int t = 0; t < count; ++t)
    for (const int next : across[std::size_t(t)])
      if (next >= 0 && is_none(t))
        of_triangle[t] =
            std::max(of_triangle[t], kinematics::angle_between(normal(t), normal(next)));
  for (int t = 0; t < count; ++t) {
    if (!is_none(t)) continue;
    double here = of_triangle[t];
    for (const int next : across[std::size_t(t)])
      if (next >= 0) here = std::max(here, of_triangle[next]);
    for (const int v : design.triangles.row(t)) turn[v] = std::max(turn[v], here);
  }
  return turn;
}

/// What is on no face takes the normal of one where it runs into it: where its facets lean on it by
/// about half of the angle between them, as those of a curve do on its tangent.
void lean_on_faces(Design& design, const std::vector<RecognisedPatch>& faces) {
  constexpr double half = 0.75;
  const Eigen::VectorXd turn = turns_of_unrecognised(design);
  std::vector<std::vector<int>> at(std::size_t(design.vertices.rows()));  // at one place
  for (const auto& [first, added] : design.seams) {
    if (at[std::size_t(first)].empty()) at[std::size_t(first)].push_back(first);
    at[std::size_t(first)].push_back(added);
  }
  for (const std::vector<int>& together : at)
    for (const int v : together) {
      if (design.face[std::size_t(v)] >= 0) continue;
      const Vector3d own = design.normals.row(v);
      double least = half * turn[v];
      for (const int other : together) {
        const int face = design.face[std::size_t(other)];
        if (face < 0) continue;
        const Vector3d there = dropped(faces[std::size_t(face)], design.vertices.row(v)).normal;
        if (!(kinematics::angle_between(own, there) < least)) continue;
        least = kinematics::angle_between(own, there);
        design.normals.row(v) = there;
      }
    }
}

}  // namespace

Recognised recognised(const Design& design, double tolerance) {
  require(std::isfinite(tolerance) && tolerance > 0.0, "recognised: tolerance must be positive");
  Sorted by_face = sorted(design, tolerance);
  Recognised found{design, std::move(by_face.faces), design.area.sum(), by_face.untried};
  if (found.patches.empty()) return found;
  found.design = split_at_faces(design, by_face.face);
  Design& made = found.design;
  lean_on_faces(made, found.patches);
  for (Index i = 0; i < made.vertices.rows(); ++i) {
    const int face = made.face[std::size_t(i)];
    if (face < 0) continue;
    found.patches[std::size_t(face)].area += made.area[i];
    const Contact at = dropped(found.patches[std::size_t(face)], made.vertices.row(i));
    made.vertices.row(i) = at.point;
    made.normals.row(i) = at.normal;
  }
  made.facet_error = facet_error(made.vertices, made.normals, made.triangles);
  for (Index i = 0; i < made.facet_error.size(); ++i)
    if (made.face[std::size_t(i)] >= 0) made.facet_error[i] = 0.0;
  made.area = vertex_area(made.vertices, made.triangles);
  return found;
}

OnSurface on_recognised(const std::vector<RecognisedPatch>& patches, const Eigen::Isometry3d& T) {
  return [patches, T, back = T.inverse()](std::span<const Contact> corners,
                                          std::span<const double> weights) {
    const int face = corners.front().face;
    if (face < 0 || !std::all_of(corners.begin(), corners.end(),
                                 [&](const Contact& one) { return one.face == face; }))
      return on_smooth_facet(corners, weights);
    Vector3d flat = Vector3d::Zero();
    for (std::size_t i = 0; i < corners.size(); ++i) flat += weights[i] * corners[i].point;
    const Contact found = dropped(patches[std::size_t(face)], back * flat);
    return Contact{T * found.point, T.linear() * found.normal, face};
  };
}

}  // namespace abbe::cutting
