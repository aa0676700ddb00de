#include "cutting/collision.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <queue>
#include <vector>

#include <fcl/fcl.h>

#include "kinematics/require.h"

namespace abbe::cutting {

using Eigen::Vector3d;
using kinematics::Pose;

struct BodySearch {
  fcl::BVHModel<fcl::OBBRSSd> tree;
  ClosedMesh mesh;
};

Body body_of(const ClosedMesh& mesh) {
  require(mesh.triangles.rows() > 0, "body: it has no triangles");
  require(mesh.vertices.allFinite(), "body: vertices must be finite");
  require(mesh.triangles.minCoeff() >= 0 && mesh.triangles.maxCoeff() < mesh.vertices.rows(),
          "body: a triangle names a vertex that is not there");
  std::vector<fcl::Vector3d> vertices;
  for (const auto& row : mesh.vertices.rowwise()) vertices.emplace_back(row.transpose());
  std::vector<fcl::Triangle> triangles;
  for (const auto& t : mesh.triangles.rowwise())
    triangles.emplace_back(std::size_t(t[0]), std::size_t(t[1]), std::size_t(t[2]));
  auto search = std::make_shared<BodySearch>();
  search->mesh = mesh;
  search->tree.beginModel(int(triangles.size()), int(vertices.size()));
  search->tree.addSubModel(vertices, triangles);
  search->tree.endModel();
  Body body;
  const Vector3d low = mesh.vertices.colwise().minCoeff(),
                 high = mesh.vertices.colwise().maxCoeff();
  body.centre = 0.5 * (low + high);
  body.radius = (mesh.vertices.rowwise() - body.centre.transpose()).rowwise().norm().maxCoeff();
  body.search = std::move(search);
  return body;
}

Gap gap(const Body& a, const Pose& T_a, const Body& b, const Pose& T_b) {
  const fcl::DistanceRequestd request(true);
  fcl::DistanceResultd result;
  fcl::distance(&a.search->tree, T_a, &b.search->tree, T_b, request, result);
  return {std::max(0.0, result.min_distance), result.nearest_points[0], result.nearest_points[1]};
}

namespace {

/// How often a closed surface goes around a point: by the solid angles of its triangles.
double windings(const ClosedMesh& mesh, const Vector3d& point) {
  double solid_angle = 0.0;
  for (const auto& t : mesh.triangles.rowwise()) {
    const Vector3d a = mesh.vertices.row(t[0]).transpose() - point,
                   b = mesh.vertices.row(t[1]).transpose() - point,
                   c = mesh.vertices.row(t[2]).transpose() - point;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    solid_angle += 2.0 * std::atan2(a.dot(b.cross(c)),
                                    la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return solid_angle / (4.0 * std::numbers::pi);
}

bool holds(const Body& outer, const Pose& T_outer, const Body& inner, const Pose& T_inner) {
  const Vector3d point =
      T_outer.inverse() * (T_inner * Vector3d(inner.search->mesh.vertices.row(0).transpose()));
  return std::abs(windings(outer.search->mesh, point)) > 0.5;
}

}  // namespace

bool is_inside(const Body& a, const Pose& T_a, const Body& b, const Pose& T_b) {
  return gap(a, T_a, b, T_b).distance > 0.0 && (holds(a, T_a, b, T_b) || holds(b, T_b, a, T_a));
}

namespace {

/// A distance on the way.
struct Looked {
  double u, distance;
};

/// Between two instants nothing comes nearer than `least`.
struct Stretch {
  Looked from, to;
  double least;
};

Stretch stretch(const Looked& from, const Looked& to, double speed) {
  return {from, to, 0.5 * (from.distance + to.distance - speed * (to.u - from.u))};
}

}  // namespace

Approach approach(const Body& a, const Body& b, const kinematics::Screw& b_in_a,
                  const ApproachOptions& options) {
  require(options.resolution > 0.0 && options.within > 0.0 && options.share >= 0.0,
          "approach: resolution and within must be positive, the share not negative");
  const double speed = kinematics::fastest(b_in_a, b.centre, b.radius);
  Approach nearest;
  nearest.gap.distance = std::numeric_limits<double>::infinity();
  const auto look = [&](double u) -> Looked {
    const Gap here = gap(a, Pose::Identity(), b, kinematics::pose_at(b_in_a, u));
    ++nearest.queries;
    if (here.distance < nearest.gap.distance)
      nearest = {here.distance <= options.resolution, u, here, nearest.queries};
    return {u, here.distance};
  };
  const auto further = [](const Stretch& one, const Stretch& other) {
    return one.least > other.least;
  };
  std::priority_queue<Stretch, std::vector<Stretch>, decltype(further)> open(further);
  for (Looked last = look(0.0); !nearest.contact && last.u < 1.0;) {
    const bool to_the_end = speed * (1.0 - last.u) <= last.distance;
    const Looked next = look(to_the_end ? 1.0 : last.u + last.distance / speed);
    open.push(stretch(last, next, speed));
    last = next;
  }
  const auto allowed = [&] {
    return std::max(options.within, options.share * nearest.gap.distance);
  };
  while (!nearest.contact && open.top().least < nearest.gap.distance - allowed()) {
    const auto [from, to, least] = open.top();
    open.pop();
    const Looked middle = look(0.5 * (from.u + to.u));
    open.push(stretch(from, middle, speed));
    open.push(stretch(middle, to, speed));
  }
  return nearest;
}

}  // namespace abbe::cutting
