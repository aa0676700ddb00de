#include "cutting/nearest.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "cutting/disjoint_sets.h"
#include "cutting/profile_section.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kink = 0.01;  // of the profile's size: how near a kink is settled by the normal

/// The arc at which a section comes nearest to a point of its half plane.
double nearest_arc(const Section& s, const Vector2d& p) {
  const Vector2d from = p - s.from;
  const Vector2d left = left_of(s.tangent);
  const double along = s.tangent.dot(from);
  if (s.curvature == 0.0) return std::clamp(along, 0.0, s.length);
  // the walk turns by curvature times arc, to the right where it is convex; seen from the centre,
  // which lies at -left / curvature
  const double out = 1.0 + s.curvature * left.dot(from);
  const double turned = std::atan2(std::abs(s.curvature) * along, out);
  return std::clamp(turned / std::abs(s.curvature), 0.0, s.length);
}

Contact turned_to(const Station& station, const Vector2d& azimuth) {
  const Vector2d& n = station.normal;
  return {{station.point.x() * azimuth.x(), station.point.x() * azimuth.y(), station.point.y()},
          Vector3d(n.x() * azimuth.x(), n.x() * azimuth.y(), n.y()).normalized()};
}

/// (vertices) of a design whose vertices are those of another, then more between them. No triangle
/// joins two groups, so vertices that triangles join are of the group of the first of them.
std::vector<int> groups_on(const Design& from, const Design& made) {
  if (from.group.empty()) return {};
  DisjointSets joined(std::size_t(made.vertices.rows()));
  for (const auto& triangle : made.triangles.rowwise()) {
    joined.join(triangle[0], triangle[1]);
    joined.join(triangle[0], triangle[2]);
  }
  std::vector<int> group = from.group;
  for (int i = int(group.size()); i < int(made.vertices.rows()); ++i)
    group.push_back(group[std::size_t(joined.name_of(i))]);
  return group;
}

}  // namespace

Contact on_facet(std::span<const Contact> corners, std::span<const double> weights) {
  Contact mean{Vector3d::Zero(), Vector3d::Zero()};
  for (std::size_t i = 0; i < corners.size(); ++i) {
    mean.point += weights[i] * corners[i].point;
    mean.normal += weights[i] * corners[i].normal;
  }
  mean.normal.normalize();
  return mean;
}

Contact on_smooth_facet(std::span<const Contact> corners, std::span<const double> weights) {
  constexpr double smooth_sine = 0.5;
  const Contact flat = on_facet(corners, weights);
  Vector3d lift = Vector3d::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector3d from = corners[i].point - flat.point, &normal = corners[i].normal;
    if (std::abs(normal.dot(from)) > smooth_sine * from.norm()) return flat;
    lift += weights[i] * normal.dot(from) * normal;
  }
  return {flat.point + 0.5 * lift, flat.normal};
}

OnSurface on_declared(const Primitive& primitive, const Eigen::Isometry3d& T) {
  return [primitive, T, back = T.inverse()](std::span<const Contact> corners,
                                            std::span<const double> weights) {
    const Contact flat = on_facet(corners, weights);
    const Contact at = nearest(primitive, back * flat.point, back.linear() * flat.normal);
    return Contact{T * at.point, T.linear() * at.normal};
  };
}

Contact nearest(const Primitive& primitive, const Vector3d& point, const Vector3d& normal) {
  if (const auto* plane = std::get_if<RectanglePlane>(&primitive)) {
    const double x = 0.5 * plane->length_x, y = 0.5 * plane->length_y;
    return {{std::clamp(point.x(), -x, x), std::clamp(point.y(), -y, y), 0.0}, Vector3d::UnitZ()};
  }
  const double r = point.head<2>().norm();
  const Vector2d azimuth = r > 0.0 ? Vector2d(point.head<2>() / r) : Vector2d::UnitX();
  const Vector2d at_rz(r, point.z());
  const Vector2d normal_rz(normal.head<2>().dot(azimuth), normal.z());
  const double size = std::max(normal_rz.norm(), 1e-300);
  const RevolvedProfile outline = profile(primitive);
  Eigen::AlignedBox2d box(outline.pieces.front().from);
  for (const RevolvedProfile::Piece& piece : outline.pieces) box.extend(piece.to);
  const double near = kink * box.diagonal().norm();
  Station best{};
  double least = std::numeric_limits<double>::infinity();
  for (const RevolvedProfile::Piece& piece : outline.pieces) {
    const Section s = section(piece);
    const Station here = at(s, nearest_arc(s, at_rz));
    const double off = (here.point - at_rz).squaredNorm() / (near * near) +
                       (here.normal - normal_rz / size).squaredNorm();
    if (off >= least) continue;
    best = here;
    least = off;
  }
  return turned_to(best, azimuth);
}

Design design_on(const Design& from, const std::vector<Contact>& places, Triangles triangles,
                 std::vector<std::uint8_t> judged) {
  const auto n = Eigen::Index(places.size());
  Design made;
  made.vertices.resize(n, 3);
  made.normals.resize(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    made.vertices.row(i) = places[std::size_t(i)].point;
    made.normals.row(i) = places[std::size_t(i)].normal;
  }
  made.area = vertex_area(made.vertices, triangles);
  made.triangles = std::move(triangles);
  made.facet_error = Eigen::VectorXd::Zero(n);
  made.facet_error.head(from.facet_error.size()) = from.facet_error;
  made.judged = std::move(judged);
  made.group = groups_on(from, made);
  if (!from.face.empty())
    for (const Contact& place : places) made.face.push_back(place.face);
  made.seams = from.seams;
  return made;
}

Contact place_of(const Design& design, int vertex) {
  return {design.vertices.row(vertex), design.normals.row(vertex),
          design.face.empty() ? -1 : design.face[std::size_t(vertex)]};
}

std::vector<Contact> places_of(const Design& design) {
  std::vector<Contact> places;
  places.reserve(std::size_t(design.vertices.rows()));
  for (int i = 0; i < int(design.vertices.rows()); ++i) places.push_back(place_of(design, i));
  return places;
}

Design design_of_places(const std::vector<Contact>& places) {
  Design at;
  const auto n = Eigen::Index(places.size());
  at.vertices.resize(n, 3);
  at.normals.resize(n, 3);
  at.triangles.resize(0, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    at.vertices.row(i) = places[std::size_t(i)].point;
    at.normals.row(i) = places[std::size_t(i)].normal;
  }
  return at;
}

}  // namespace abbe::cutting
