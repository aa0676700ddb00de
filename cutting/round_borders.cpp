#include "cutting/round_borders.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "cutting/nearest.h"
#include "cutting/smooth_patches.h"
#include "cutting/triangle_mesh.h"
#include "kinematics/require.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

/// An edge of a border, once for each of the two faces: its vertices there, in the same direction.
struct TwoSided {
  std::array<std::array<int, 2>, 2> ends;  // face, end
  int halvings = 0;
};

/// The edges of a design at which two recognised faces meet.
std::vector<TwoSided> face_borders(const Design& design) {
  std::vector<int> place(std::size_t(design.vertices.rows()));
  std::iota(place.begin(), place.end(), 0);
  for (const auto& [kept, added] : design.seams) place[std::size_t(added)] = kept;
  const auto at = [&](int v) { return place[std::size_t(v)]; };
  std::map<std::pair<int, int>, std::vector<std::array<int, 2>>> sides;
  const std::vector<std::array<int, 3>> across = neighbours(design.triangles);
  for (int t = 0; t < int(design.triangles.rows()); ++t)
    for (int k = 0; k < 3; ++k) {
      std::array<int, 2> ends = {design.triangles(t, k), design.triangles(t, (k + 1) % 3)};
      if (across[std::size_t(t)][std::size_t(k)] >= 0) continue;
      if (at(ends[0]) > at(ends[1])) std::swap(ends[0], ends[1]);
      sides[{at(ends[0]), at(ends[1])}].push_back(ends);
    }
  std::vector<TwoSided> borders;
  for (const auto& [ends, two] : sides) {
    if (two.size() != 2) continue;
    const int one = design.face[std::size_t(two[0][0])],
              other = design.face[std::size_t(two[1][0])];
    if (one >= 0 && other >= 0 && one != other) borders.push_back({{two[0], two[1]}});
  }
  return borders;
}

/// Two faces near a chord of their border.
struct Meeting {
  const RecognisedPatch &one, &other;
  Vector3d a, b;  // ends of the chord

  Vector3d middle() const { return 0.5 * (a + b); }
  /// Across the border, along the faces.
  Vector3d way() const { return dropped(one, middle()).normal.cross(b - a).normalized(); }
  /// How far the normals are from each other at a place, along that way.
  double apart(const Vector3d& p) const {
    return (dropped(one, p).normal - dropped(other, p).normal).dot(way());
  }
  /// mm, between the surfaces beside a place.
  double between(const Vector3d& p) const { return distance_of(other, dropped(one, p).point); }
  /// mm, from either surface of what the chord cuts off the other, beyond what is between them at
  /// its ends: surfaces fitted to rounded vertices do not quite touch.
  double off() const { return std::abs(between(middle()) - 0.5 * (between(a) + between(b))); }
};

/// Where the border passes beside the middle of its chord; none where it is not found near it.
std::optional<Vector3d> on_border(const Meeting& at) {
  constexpr int rounds = 8;
  constexpr double most = 0.3, little = 1e-3, edge = 0.05;  // of the chord; rad
  const double chord = (at.b - at.a).norm();
  for (const Vector3d& end : {at.a, at.b})
    if ((dropped(at.one, end).normal - dropped(at.other, end).normal).norm() > edge)
      return std::nullopt;
  const Vector3d way = at.way();
  double along = 0.0;
  for (int round = 0; round < rounds; ++round) {
    const auto place = [&](double s) { return dropped(at.one, at.middle() + s * way).point; };
    const double here = at.apart(place(along)), step = little * chord;
    const double slope = (at.apart(place(along + step)) - here) / step;
    if (!(std::abs(slope) > 0.0)) return std::nullopt;
    along -= here / slope;
    if (!(std::abs(along) < most * chord)) return std::nullopt;
  }
  return dropped(at.one, at.middle() + along * way).point;
}

}  // namespace

Design with_round_borders(const Design& design, const std::vector<RecognisedPatch>& faces,
                          double off) {
  require(std::isfinite(off) && off > 0.0, "with_round_borders: off must be positive");
  constexpr int most = 8;  // halvings: of a chord of 30 degrees to one of a tenth
  if (design.face.empty()) return design;
  std::vector<TwoSided> waiting = face_borders(design);
  TriangleMesh mesh(design.triangles, design.vertices.rows());
  std::vector<Contact> places = places_of(design);
  std::map<std::pair<int, int>, int> edge_at;
  const auto name = [&](int edge) { edge_at[{mesh.ends(edge)[0], mesh.ends(edge)[1]}] = edge; };
  for (int edge = 0; edge < mesh.edges(); ++edge)
    if (const auto [one, other] = mesh.faces_at(edge); one < 0 || other < 0) name(edge);
  std::vector<std::uint8_t> judged = design.judged;
  std::vector<std::array<int, 2>> seams = design.seams;
  while (!waiting.empty()) {
    const TwoSided border = waiting.back();
    waiting.pop_back();
    const auto face = [&](std::size_t side) -> const RecognisedPatch& {
      return faces[std::size_t(places[std::size_t(border.ends[side][0])].face)];
    };
    const Meeting at{face(0), face(1), places[std::size_t(border.ends[0][0])].point,
                     places[std::size_t(border.ends[0][1])].point};
    if (!(at.off() > off) || border.halvings == most) continue;
    const std::optional<Vector3d> found = on_border(at);
    if (!found) continue;
    std::array<int, 2> made{};
    for (std::size_t side = 0; side < 2; ++side) {
      const auto [a, b] = border.ends[side];
      Contact place = dropped(face(side), *found);
      place.face = places[std::size_t(a)].face;
      made[side] = int(places.size());
      places.push_back(place);
      for (const int edge : mesh.split_edge(edge_at.at(std::minmax(a, b)))) name(edge);
      if (!judged.empty()) judged.push_back(1);
    }
    seams.push_back(made);
    for (const std::size_t end : {0u, 1u})
      waiting.push_back({{{{border.ends[0][end], made[0]}, {border.ends[1][end], made[1]}}},
                         border.halvings + 1});
  }
  Design rounded = design_on(design, places, mesh.triangles(), std::move(judged));
  rounded.seams = std::move(seams);
  return rounded;
}

}  // namespace abbe::cutting
