#include "cutting/part/surface_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "kinematics/decompositions.h"

namespace abbe::cutting {

namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Returns the radius of a point about the axis and its height along it.
Vector2d radius_height(const AnalyticPatch& surface, const Vector3d& point) {
  const Vector3d local = surface.frame.transpose() * (point - surface.origin);
  return {local.head<2>().norm(), local.z()};
}

/// Returns true if a translation along the third axis is a parameter of the form.
bool has_axial_parameter(Form form) {
  return form == Form::Sphere || form == Form::Torus || form == Form::Plane;
}

/// Returns the surface with small changes of its parameters: two rotations of the axis, the origin,
/// the shape. Parameters that the form does not have, or that move it into itself, are omitted.
AnalyticPatch change_parameters(AnalyticPatch surface, const VectorXd& change) {
  const bool has_axis = surface.form != Form::Sphere;
  Index k = 0;
  if (has_axis) {
    const Vector3d axis = surface.frame * Vector3d(change[0], change[1], 1.0);
    surface.frame =
        Eigen::Quaterniond::FromTwoVectors(surface.frame.col(2), axis).toRotationMatrix() *
        surface.frame;
    k = 2;
  }
  if (surface.form != Form::Plane) {
    surface.origin += change[k] * surface.frame.col(0) + change[k + 1] * surface.frame.col(1);
    k += 2;
  }
  if (has_axial_parameter(surface.form)) surface.origin += change[k++] * surface.frame.col(2);
  for (Index i = 0; i < surface.shape.size(); ++i) surface.shape[i] += change[k++];
  return surface;
}

VectorXd distances(const AnalyticPatch& surface, const Points& points) {
  VectorXd result(points.rows());
  for (Index i = 0; i < result.size(); ++i) result[i] = distance_of(surface, points.row(i));
  return result;
}

/// Returns the derivatives of the distance of a point from a surface with respect to the parameters
/// of `change_parameters`.
Eigen::RowVectorXd distance_gradient(const AnalyticPatch& surface, const Vector3d& point) {
  const Vector3d n = outward(surface, point), offset = point - surface.origin;
  Eigen::RowVectorXd J(parameter_count(surface.form));
  Index k = 0;
  if (surface.form != Form::Sphere) {
    J[k++] = -n.dot(surface.frame.col(1).cross(offset));
    J[k++] = n.dot(surface.frame.col(0).cross(offset));
  }
  if (surface.form != Form::Plane)
    for (const int axis : {0, 1}) J[k++] = -n.dot(surface.frame.col(axis));
  if (has_axial_parameter(surface.form)) J[k++] = -n.dot(surface.frame.col(2));
  const Vector2d position = radius_height(surface, point);
  if (surface.form == Form::Sphere || surface.form == Form::Cylinder) J[k] = -1.0;
  if (surface.form == Form::Cone) {
    const double slant = std::hypot(1.0, surface.shape[1]);
    J[k] = -1.0 / slant;
    J[k + 1] =
        -position.y() / slant - distance_of(surface, point) * surface.shape[1] / (slant * slant);
  }
  if (surface.form == Form::Torus) {
    J[k] = -n.dot((offset - position.y() * surface.frame.col(2)).normalized());
    J[k + 1] = -1.0;
  }
  return J;
}

Matrix3d frame_along(const Vector3d& axis) {
  return Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
}

AnalyticPatch fit_plane_to_patch(const FacetPatch& patch) {
  const Eigen::MatrixXd covariance = patch.points.transpose() * patch.points;
  AnalyticPatch surface;
  surface.frame = frame_along(eigenvectors(covariance).vectors.col(0));
  return surface;
}

// A linear least-squares problem in the centre and R^2 - |centre|^2.
AnalyticPatch fit_sphere(const Points& points) {
  Eigen::MatrixXd A(points.rows(), 4);
  A << 2.0 * points, VectorXd::Ones(points.rows());
  const VectorXd x = least_squares(A, VectorXd(points.rowwise().squaredNorm())).x;
  AnalyticPatch surface;
  surface.form = Form::Sphere;
  surface.origin = x.head<3>();
  surface.shape =
      VectorXd::Constant(1, std::sqrt(std::max(0.0, x[3] + surface.origin.squaredNorm())));
  return surface;
}

/// The line nearest to the lines along the normals of facets.
struct NormalLine {
  AnalyticPatch axis;
  double definiteness = 0.0;  ///< second smallest eigenvalue relative to the largest
};

/// Returns the line nearest to the normals at the given points.
NormalLine line_through_normals(const FacetPatch& patch, const Points& points) {
  Matrix3d directions = Matrix3d::Zero(), moments = Matrix3d::Zero(), mixed = Matrix3d::Zero();
  for (Index i = 0; i < patch.normals.rows(); ++i) {
    const Vector3d n = patch.normals.row(i), m = Vector3d(points.row(i)).cross(n);
    directions += n * n.transpose();
    moments += m * m.transpose();
    mixed += n * m.transpose();
  }
  // Directions in which all normals agree carry no moment.
  constexpr double relative_tolerance = 1e-9;
  Matrix3d moment_per_direction;
  for (int k = 0; k < 3; ++k)
    moment_per_direction.col(k) = shortest_least_squares(
        Eigen::MatrixXd(directions), VectorXd(mixed.col(k)), relative_tolerance);
  const Matrix3d reduced_moments = moments - mixed.transpose() * moment_per_direction;
  const Eigenvectors eigen = eigenvectors(0.5 * (reduced_moments + reduced_moments.transpose()));
  const Vector3d axis = eigen.vectors.col(0);
  NormalLine result;
  result.axis.frame = frame_along(axis);
  result.axis.origin = axis.cross(-(moment_per_direction * axis));
  // 1e-300 avoids 0 / 0.
  result.definiteness = eigen.values[1] / std::max(eigen.values[2], 1e-300);
  return result;
}

/// Returns an even selection of about 2000 points at most, which suffices for a fit.
Points thinned_points(const Points& points) {
  constexpr Index max_points = 2000;
  const Index stride = 1 + points.rows() / max_points;
  Points result((points.rows() + stride - 1) / stride, 3);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = points.row(i * stride);
  return result;
}

/// Returns the surface of revolution about an axis whose profile, a line or circle, fits the
/// vertices in the half plane of the axis.
AnalyticPatch fit_profile(AnalyticPatch surface, Form form, const Points& points) {
  const Index count = points.rows();
  Eigen::MatrixXd A(count, form == Form::Torus ? 3 : 2);
  VectorXd b(count);
  for (Index i = 0; i < count; ++i) {
    const Vector2d position = radius_height(surface, points.row(i));
    if (form == Form::Torus) {
      A.row(i) << 2.0 * position.x(), 2.0 * position.y(), 1.0;
      b[i] = position.squaredNorm();
    } else {
      A.row(i) << 1.0, position.y();
      b[i] = position.x();
    }
  }
  const VectorXd x = least_squares(A, b).x;
  surface.form = form;
  if (form == Form::Torus) {
    surface.origin += x[1] * surface.frame.col(2);
    surface.shape = Vector2d(x[0], std::sqrt(std::max(0.0, x[2] + x.head<2>().squaredNorm())));
  } else if (form == Form::Cone) {
    surface.shape = x;
  } else {
    surface.shape = VectorXd::Constant(1, b.mean());
  }
  return surface;
}

/// Returns +1 if the surface has the same outward side as the facets, -1 if it has the opposite;
/// empty if a facet deviates from the surface by more than 30 degrees or faces the other side.
std::optional<double> facing_sign(const AnalyticPatch& surface, const FacetPatch& patch) {
  constexpr double min_cosine = 0.866;  // cos 30 degrees
  double sign = 0.0;
  for (Index i = 0; i < patch.normals.rows(); ++i) {
    const double cosine = outward(surface, patch.centres.row(i)).dot(patch.normals.row(i));
    if (sign == 0.0) sign = cosine > 0.0 ? 1.0 : -1.0;
    if (!(sign * cosine > min_cosine)) return std::nullopt;
  }
  return sign;
}

constexpr double min_point_distance = 1e-3;  // of the size of a patch, between distinct points

/// Returns true if at least `min_count` of the points are distinct.
bool has_distinct_points(const std::vector<Vector2d>& points, std::size_t min_count) {
  std::vector<Vector2d> distinct;
  for (const Vector2d& point : points) {
    const auto is_near = [&](const Vector2d& other) {
      return (other - point).norm() < min_point_distance;
    };
    if (std::none_of(distinct.begin(), distinct.end(), is_near)) distinct.push_back(point);
    if (distinct.size() == min_count) return true;
  }
  return false;
}

/// Returns true if a part of the patch is flat: more facets have the same normal than the halves of
/// two quadrangles.
bool has_flat_part(const FacetPatch& patch) {
  constexpr double normal_step = 1e-5;  // of a unit normal
  constexpr int max_quadrangle_halves = 4;
  std::map<std::array<long, 3>, int> facets_by_normal;
  for (const auto& normal : patch.normals.rowwise()) {
    const Eigen::RowVector3d cell = normal / normal_step;
    if (++facets_by_normal[{std::lround(cell[0]), std::lround(cell[1]), std::lround(cell[2])}] >
        max_quadrangle_halves)
      return true;
  }
  return false;
}

/// Returns true if no facet closes a cylinder or cone across its axis like a cap, with its centre
/// at less than half of the radius.
bool is_uncapped(const AnalyticPatch& surface, const FacetPatch& patch) {
  const double growth = surface.form == Form::Cone ? surface.shape[1] : 0.0;
  for (const auto& centre : patch.centres.rowwise()) {
    const Vector2d position = radius_height(surface, centre);
    if (position.x() < 0.5 * (surface.shape[0] + growth * position.y())) return false;
  }
  return true;
}

/// The directions of the lines of vertices along an axis, and the radius and height of their rings.
struct LinesAndRings {
  std::vector<Vector2d> lines, rings;
};

LinesAndRings lines_and_rings(const AnalyticPatch& surface, const Points& points) {
  LinesAndRings result;
  for (const auto& point : points.rowwise()) {
    const Vector3d local = surface.frame.transpose() * (point.transpose() - surface.origin);
    result.lines.push_back(local.head<2>().normalized());
    result.rings.push_back({local.head<2>().norm(), local.z()});
  }
  return result;
}

/// Returns the centre of the circle through the corners of a triangle, or its centroid if that
/// centre is far away.
Vector3d circumcentre(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d u = b - a, v = c - a, n = u.cross(v);
  const Vector3d offset =
      (u.squaredNorm() * v - v.squaredNorm() * u).cross(n) / (2.0 * n.squaredNorm());
  const Vector3d centre = (a + b + c) / 3.0;
  const double max_side = std::max(u.norm(), v.norm());
  return (a + offset - centre).norm() < max_side ? Vector3d(a + offset) : centre;
}

/// Returns true if at least three rings of a sphere are visible about every axis that another
/// surface could have.
bool is_evident_sphere(AnalyticPatch surface, const FacetPatch& patch) {
  if (has_flat_part(patch)) return false;
  const Eigen::MatrixXd covariance = patch.points.transpose() * patch.points;
  const Matrix3d principal_axes = eigenvectors(covariance).vectors;
  for (const Vector3d& axis :
       {Vector3d(revolution_from_normals(patch).frame.col(2)), Vector3d(principal_axes.col(0)),
        Vector3d(principal_axes.col(1)), Vector3d(principal_axes.col(2))}) {
    surface.frame = frame_along(axis);
    if (!has_distinct_points(lines_and_rings(surface, patch.points).rings, 3)) return false;
  }
  return true;
}

}  // namespace

AnalyticPatch revolution_from_normals(const FacetPatch& patch) {
  // The normals of a single ring of a cone meet in a point and do not determine the axis.
  constexpr double min_definiteness = 1e-6;
  const NormalLine line = line_through_normals(patch, patch.circumcentres);
  return line.definiteness > min_definiteness ? line.axis
                                              : line_through_normals(patch, patch.centres).axis;
}

double distance_of(const AnalyticPatch& surface, const Vector3d& point) {
  if (surface.form == Form::Plane) return surface.frame.col(2).dot(point - surface.origin);
  if (surface.form == Form::Sphere) return (point - surface.origin).norm() - surface.shape[0];
  const Vector2d position = radius_height(surface, point);
  if (surface.form == Form::Cylinder) return position.x() - surface.shape[0];
  if (surface.form == Form::Cone)
    return (position.x() - surface.shape[0] - surface.shape[1] * position.y()) /
           std::hypot(1.0, surface.shape[1]);
  return std::hypot(position.x() - surface.shape[0], position.y()) - surface.shape[1];
}

Vector3d outward(const AnalyticPatch& surface, const Vector3d& point) {
  const Vector3d axis = surface.frame.col(2), offset = point - surface.origin;
  if (surface.form == Form::Plane) return axis;
  if (surface.form == Form::Sphere) return offset.normalized();
  const double height = offset.dot(axis);
  const Vector3d radial = (offset - height * axis).normalized();
  if (surface.form == Form::Cylinder) return radial;
  if (surface.form == Form::Cone) return (radial - surface.shape[1] * axis).normalized();
  return (offset - surface.shape[0] * radial).normalized();
}

Index parameter_count(Form form) {
  // In the order of Form: plane, sphere, cylinder, cone, torus.
  constexpr Index numbers[] = {3, 4, 5, 6, 7};
  return numbers[std::size_t(form)];
}

FacetPatch facet_patch(const Design& design, std::vector<int> vertices,
                       std::vector<int> triangles) {
  FacetPatch patch;
  patch.points.resize(Index(vertices.size()), 3);
  for (std::size_t i = 0; i < vertices.size(); ++i)
    patch.points.row(Index(i)) = design.vertices.row(vertices[i]);
  patch.middle = patch.points.colwise().mean().transpose();
  patch.points.rowwise() -= patch.middle.transpose();
  patch.size = std::max(patch.points.rowwise().norm().maxCoeff(), 1e-300);
  patch.points /= patch.size;
  patch.centres.resize(Index(triangles.size()), 3);
  patch.normals.resize(Index(triangles.size()), 3);
  patch.circumcentres.resize(Index(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Eigen::RowVector3i t = design.triangles.row(triangles[i]);
    const Vector3d a = design.vertices.row(t[0]), b = design.vertices.row(t[1]),
                   c = design.vertices.row(t[2]);
    patch.centres.row(Index(i)) = ((a + b + c) / 3.0 - patch.middle) / patch.size;
    patch.normals.row(Index(i)) = (b - a).cross(c - a).normalized();
    patch.circumcentres.row(Index(i)) = (circumcentre(a, b, c) - patch.middle) / patch.size;
  }
  patch.vertices = std::move(vertices);
  patch.triangles = std::move(triangles);
  return patch;
}

AnalyticPatch to_patch_coordinates(const FacetPatch& patch, AnalyticPatch surface) {
  surface.origin = (surface.origin - patch.middle) / patch.size;
  const Index lengths = surface.form == Form::Cone ? 1 : surface.shape.size();
  surface.shape.head(lengths) /= patch.size;
  return surface;
}

AnalyticPatch from_patch_coordinates(const FacetPatch& patch, AnalyticPatch surface) {
  surface.origin = patch.middle + patch.size * surface.origin;
  const Index lengths = surface.form == Form::Cone ? 1 : surface.shape.size();
  surface.shape.head(lengths) *= patch.size;
  return surface;
}

double max_vertex_distance(const FacetPatch& patch, const AnalyticPatch& surface) {
  return distances(surface, patch.points).cwiseAbs().maxCoeff() * patch.size;
}

AnalyticPatch initial_surface(Form form, const FacetPatch& patch, const AnalyticPatch& axis) {
  if (form == Form::Plane) return fit_plane_to_patch(patch);
  if (form == Form::Sphere) return fit_sphere(thinned_points(patch.points));
  return fit_profile(axis, form, thinned_points(patch.points));
}

AnalyticPatch refine_fit(AnalyticPatch surface, const FacetPatch& patch, int max_iterations) {
  constexpr double convergence_tolerance = 1e-14;  // of the patch's size, near rounding
  const Points points = thinned_points(patch.points);
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Eigen::MatrixXd J(points.rows(), parameter_count(surface.form));
    for (Index i = 0; i < points.rows(); ++i) J.row(i) = distance_gradient(surface, points.row(i));
    const VectorXd change = -least_squares(J, distances(surface, points)).x;
    // A step of more than ten sizes of the patch diverges.
    if (!change.allFinite() || change.norm() > 10.0) break;
    surface = change_parameters(surface, change);
    if (change.norm() < convergence_tolerance) break;
  }
  return surface;
}

bool has_lines(const AnalyticPatch& surface, const FacetPatch& patch, int min_count) {
  return has_distinct_points(lines_and_rings(surface, patch.points).lines, std::size_t(min_count));
}

bool is_determined(const AnalyticPatch& surface, const FacetPatch& patch, int tangent_lines) {
  if (surface.form == Form::Plane) return true;
  if (surface.form == Form::Sphere) return is_evident_sphere(surface, patch);
  const LinesAndRings positions = lines_and_rings(surface, patch.points);
  if (surface.form == Form::Torus)
    return surface.shape[0] > min_point_distance && has_distinct_points(positions.rings, 5);
  return has_distinct_points(positions.lines, std::size_t(std::max(1, 5 - tangent_lines))) &&
         is_uncapped(surface, patch);
}

std::optional<AnalyticPatch> recognise_surface(const FacetPatch& patch, double tolerance) {
  const auto to_recognised = [&](const AnalyticPatch& fit) -> std::optional<AnalyticPatch> {
    // With fewer vertices than twice the parameters, a surface may fit by chance.
    const Index min_vertices = fit.form == Form::Plane ? 3 : 2 * parameter_count(fit.form);
    const double max_distance = max_vertex_distance(patch, fit);
    if (patch.points.rows() < min_vertices || !(max_distance <= tolerance)) return std::nullopt;
    const std::optional<double> sign = facing_sign(fit, patch);
    if (!sign || !is_determined(fit, patch)) return std::nullopt;
    AnalyticPatch surface = from_patch_coordinates(patch, fit);
    surface.sign = *sign;
    surface.off = max_distance;
    for (const auto& p : patch.points.rowwise())
      surface.box.extend(patch.middle + patch.size * p.transpose());
    return surface;
  };
  if (const auto plane = to_recognised(fit_plane_to_patch(patch))) return plane;
  const AnalyticPatch axis = revolution_from_normals(patch);
  for (const Form form : {Form::Cylinder, Form::Cone, Form::Sphere, Form::Torus})
    if (const auto surface = to_recognised(refine_fit(initial_surface(form, patch, axis), patch)))
      return surface;
  return std::nullopt;
}

Contact project_to_surface(const AnalyticPatch& surface, const Vector3d& point) {
  const Vector3d normal = outward(surface, point);
  return {point - distance_of(surface, point) * normal, surface.sign * normal};
}

}  // namespace abbe::cutting
