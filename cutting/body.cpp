#include "cutting/body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "cutting/polygon.h"
#include "kinematics/require.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

/// Sides of a polygon around a circle whose corners lie outside by at most `sag`.
int sides_around(double radius, double sag) {
  constexpr double least = 8.0, most = 1e5;
  const double half = std::acos(radius / (radius + sag));
  return int(std::clamp(std::ceil(std::numbers::pi / half), least, most));
}

ClosedMesh mesh_of(const std::vector<Vector3d>& vertices,
                   const std::vector<std::array<int, 3>>& triangles) {
  ClosedMesh mesh{Points(Index(vertices.size()), 3), Triangles(Index(triangles.size()), 3), 0.0};
  for (std::size_t i = 0; i < vertices.size(); ++i)
    mesh.vertices.row(Index(i)) = vertices[i].transpose();
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) mesh.triangles(Index(t), Index(k)) = triangles[t][k];
  return mesh;
}

/// The profile with its ends on the axis.
std::vector<Eigen::Vector2d> closed_profile(const Eigen::MatrixX2d& profile) {
  std::vector<Eigen::Vector2d> points;
  if (profile(0, 0) > 0.0) points.emplace_back(0.0, profile(0, 1));
  for (const auto& row : profile.rowwise()) points.emplace_back(row.transpose());
  if (points.back().x() > 0.0) points.emplace_back(0.0, points.back().y());
  return points;
}

}  // namespace

ClosedMesh box_mesh(const Vector3d& size) {
  require(size.allFinite() && (size.array() > 0.0).all(), "box: sizes must be positive");
  const Vector3d half = 0.5 * size;
  Eigen::MatrixX2d outline(4, 2);
  outline << -half.x(), -half.y(), half.x(), -half.y(), half.x(), half.y(), -half.x(), half.y();
  ClosedMesh mesh = extruded_mesh(outline, size.z());
  mesh.vertices.col(2).array() -= half.z();
  return mesh;
}

ClosedMesh revolved_mesh(const Eigen::MatrixX2d& profile, double sag) {
  require(profile.rows() >= 2 && profile.allFinite(), "revolution: two finite points at least");
  require((profile.col(0).array() >= 0.0).all() && profile.col(0).maxCoeff() > 0.0,
          "revolution: radii must not be below zero, nor all zero");
  require(std::isfinite(sag) && sag > 0.0, "revolution: the sag must be positive");
  const std::vector<Eigen::Vector2d> points = closed_profile(profile);
  const int n = sides_around(profile.col(0).maxCoeff(), sag);
  const double outwards = 1.0 / std::cos(std::numbers::pi / n);
  std::vector<Vector3d> vertices;
  std::vector<std::array<int, 2>> ring;  // first vertex, and the step to the next: 0 on the axis
  for (const Eigen::Vector2d& point : points) {
    const bool on_axis = point.x() == 0.0;
    ring.push_back({int(vertices.size()), on_axis ? 0 : 1});
    for (int k = 0; k < (on_axis ? 1 : n); ++k) {
      const double angle = 2.0 * std::numbers::pi * k / n, r = outwards * point.x();
      vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), point.y());
    }
  }
  std::vector<std::array<int, 3>> triangles;
  const auto corner = [&](std::size_t i, int k) { return ring[i][0] + ring[i][1] * (k % n); };
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    require(points[i] != points[i + 1], "revolution: neighbouring points must differ");
    require(points[i].y() <= points[i + 1].y(), "revolution: heights must not fall");
    require(ring[i][1] + ring[i + 1][1] > 0, "revolution: the profile must leave the axis once");
    for (int k = 0; k < n; ++k) {
      const int a = corner(i, k), b = corner(i, k + 1), c = corner(i + 1, k + 1),
                d = corner(i + 1, k);
      if (a != b) triangles.push_back({a, b, c});
      if (c != d) triangles.push_back({a, c, d});
    }
  }
  return mesh_of(vertices, triangles);
}

ClosedMesh sphere_mesh(double radius, double sag) {
  require(std::isfinite(radius) && radius > 0.0, "sphere: the radius must be positive");
  require(std::isfinite(sag) && sag > 0.0, "sphere: the sag must be positive");
  const int n = (sides_around(radius, 0.5 * sag) + 1) / 2;
  const double r = radius / std::cos(0.5 * std::numbers::pi / n);
  Eigen::MatrixX2d profile(n + 1, 2);
  for (int i = 0; i <= n; ++i) {
    const double angle = std::numbers::pi * i / n;
    profile.row(i) << (i == 0 || i == n ? 0.0 : r * std::sin(angle)), -r * std::cos(angle);
  }
  return revolved_mesh(profile, 0.5 * sag);
}

ClosedMesh extruded_mesh(const Eigen::MatrixX2d& outline, double height) {
  require(outline.rows() >= 3 && outline.allFinite(), "extrusion: three finite corners at least");
  require(std::isfinite(height) && height > 0.0, "extrusion: the height must be positive");
  const int n = int(outline.rows());
  double twice_area = 0.0;
  std::vector<Vector3d> corners;
  for (int i = 0; i < n; ++i) {
    const Eigen::RowVector2d a = outline.row(i), b = outline.row((i + 1) % n);
    twice_area += a.x() * b.y() - a.y() * b.x();
    corners.emplace_back(a.x(), a.y(), 0.0);
  }
  const std::vector<std::array<int, 3>> top = triangulated(corners);
  require(!top.empty() && twice_area > 0.0,
          "extrusion: the outline must run counter-clockwise and not cross itself");
  std::vector<Vector3d> vertices = corners;
  for (const Vector3d& corner : corners) vertices.push_back(corner + height * Vector3d::UnitZ());
  std::vector<std::array<int, 3>> triangles;
  for (const auto& [a, b, c] : top) {
    triangles.push_back({a, c, b});
    triangles.push_back({a + n, b + n, c + n});
  }
  for (int i = 0; i < n; ++i) {
    const int next = (i + 1) % n;
    triangles.push_back({i, next, next + n});
    triangles.push_back({i, next + n, i + n});
  }
  return mesh_of(vertices, triangles);
}

namespace {

/// Profile of a form cutter, its arcs within the polygons of their tangents.
Eigen::MatrixX2d profile_around(const ToolOutline& outline, double sag) {
  std::vector<Eigen::Vector2d> points{outline.pieces.front().from};
  for (const OutlinePiece& piece : outline.pieces) {
    const double turn = std::acos(std::clamp(piece.normal_from.dot(piece.normal_to), -1.0, 1.0));
    const int sides = piece.radius > 0.0 ? sides_around(piece.radius, sag) : 1;
    const int tangents = std::max(1, int(std::ceil(turn * sides / (2.0 * std::numbers::pi))));
    const double half = 0.5 * turn / tangents;
    for (int k = 0; k < tangents && piece.radius > 0.0; ++k) {
      const Eigen::Vector2d middle =
          Eigen::Rotation2Dd((2 * k + 1) * half) * piece.normal_from / std::cos(half);
      points.push_back(piece.from + piece.radius * (middle - piece.normal_from));
    }
    points.push_back(piece.to);
  }
  Eigen::MatrixX2d profile(Index(points.size()), 2);
  Index count = 0;
  for (const Eigen::Vector2d& point : points) {
    // the profile begins and ends at the axis, and rounding makes no height fall
    const Eigen::RowVector2d next(
        std::max(0.0, point.x()),
        std::clamp(point.y(), count > 0 ? profile(count - 1, 1) : 0.0, outline.height));
    if (count == 0 || next != profile.row(count - 1)) profile.row(count++) = next;
  }
  return profile.topRows(count);
}

}  // namespace

ClosedMesh cutter_mesh(const Cutter& cutter, double sag) {
  check_cutter(cutter);
  require(std::isfinite(sag) && sag > 0.0, "cutter: the sag must be positive");
  if (cutter.outline) return revolved_mesh(profile_around(*cutter.outline, 0.5 * sag), 0.5 * sag);
  const double r = cutter.corner_radius, flat = cutter.radius - r, quarter = 0.5 * std::numbers::pi;
  // the corner lies within the polygon of its tangents
  const int pieces = r > 0.0 ? std::max(1, (sides_around(r, 0.5 * sag) + 3) / 4) : 0;
  std::vector<Eigen::Vector2d> points{{flat, 0.0}};
  const double out = pieces > 0 ? r / std::cos(0.5 * quarter / pieces) : 0.0;
  for (int k = 0; k < pieces; ++k) {
    const double angle = quarter * (k + 0.5) / pieces;
    points.emplace_back(flat + out * std::sin(angle), std::max(0.0, r - out * std::cos(angle)));
  }
  points.emplace_back(cutter.radius, r);
  if (cutter.flank_length > r) points.emplace_back(cutter.radius, cutter.flank_length);
  const auto same = std::ranges::unique(points);
  points.erase(same.begin(), same.end());
  Eigen::MatrixX2d profile(Index(points.size()), 2);
  for (std::size_t i = 0; i < points.size(); ++i) profile.row(Index(i)) = points[i].transpose();
  return revolved_mesh(profile, pieces > 0 ? 0.5 * sag : sag);
}

std::vector<ClosedMesh> cutter_pieces(const Cutter& cutter, double sag) {
  check_cutter(cutter);
  if (is_hollow(cutter)) {
    std::vector<ClosedMesh> pieces;
    for (const Cutter& part : convex_parts(cutter)) pieces.push_back(cutter_mesh(part, sag));
    return pieces;
  }
  if (cutter.outline) return {cutter_mesh(cutter, sag)};
  const double r = cutter.corner_radius, flat = cutter.radius - r;
  std::vector<ClosedMesh> pieces;
  if (cutter.flank_length > r) {
    Eigen::MatrixX2d flank(2, 2);
    flank << cutter.radius, r, cutter.radius, cutter.flank_length;
    pieces.push_back(revolved_mesh(flank, sag));
  }
  if (r == 0.0) return pieces;
  std::vector<Vector3d> corners{{0.0, 0.0, r}};
  std::vector<std::array<int, 3>> fan;
  const int n = flat > 0.0 ? sides_around(flat, sag) : 0;
  for (int k = 0; k < n; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / n,
                 out = flat / std::cos(std::numbers::pi / n);
    corners.emplace_back(out * std::cos(angle), out * std::sin(angle), r);
    fan.push_back({0, 1 + k, 1 + (k + 1) % n});
  }
  if (n == 0) fan.push_back({0, 0, 0});
  pieces.push_back(mesh_of(corners, fan));
  pieces.back().skin = r;
  return pieces;
}

ClosedMesh moved(ClosedMesh mesh, const kinematics::Pose& T) {
  mesh.vertices = (mesh.vertices * T.linear().transpose()).rowwise() + T.translation().transpose();
  return mesh;
}

}  // namespace abbe::cutting
