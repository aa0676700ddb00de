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

using Fitted = AnalyticPatch;

/// Returns the radius about the axis and the height along it.
Vector2d radius_height(const Fitted& f, const Vector3d& p) {
  const Vector3d from = f.frame.transpose() * (p - f.origin);
  return {from.head<2>().norm(), from.z()};
}

/// Returns true if a translation along the third axis is a parameter of the form.
bool has_axial_parameter(Form form) {
  return form == Form::Sphere || form == Form::Torus || form == Form::Plane;
}

/// Returns the surface changed by small parameters: two rotations of the axis, the origin, the
/// shape. Parameters that the form does not have, or that move it into itself, are omitted.
Fitted moved(Fitted f, const VectorXd& by) {
  const bool turns = f.form != Form::Sphere;
  Index k = 0;
  if (turns) {
    const Vector3d axis = f.frame * Vector3d(by[0], by[1], 1.0);
    f.frame = Eigen::Quaterniond::FromTwoVectors(f.frame.col(2), axis).toRotationMatrix() * f.frame;
    k = 2;
  }
  if (f.form != Form::Plane) {
    f.origin += by[k] * f.frame.col(0) + by[k + 1] * f.frame.col(1);
    k += 2;
  }
  if (has_axial_parameter(f.form)) f.origin += by[k++] * f.frame.col(2);
  for (Index i = 0; i < f.shape.size(); ++i) f.shape[i] += by[k++];
  return f;
}

VectorXd distances(const Fitted& f, const Points& points) {
  VectorXd all(points.rows());
  for (Index i = 0; i < all.size(); ++i) all[i] = distance_of(f, points.row(i));
  return all;
}

/// Returns the derivatives of the distance of a point from a surface with respect to the parameters
/// of `moved`.
Eigen::RowVectorXd slopes(const Fitted& f, const Vector3d& p) {
  const Vector3d n = outward(f, p), from = p - f.origin;
  Eigen::RowVectorXd J(numbers_of(f.form));
  Index k = 0;
  if (f.form != Form::Sphere) {
    J[k++] = -n.dot(f.frame.col(1).cross(from));
    J[k++] = n.dot(f.frame.col(0).cross(from));
  }
  if (f.form != Form::Plane)
    for (const int axis : {0, 1}) J[k++] = -n.dot(f.frame.col(axis));
  if (has_axial_parameter(f.form)) J[k++] = -n.dot(f.frame.col(2));
  const Vector2d at = radius_height(f, p);
  if (f.form == Form::Sphere || f.form == Form::Cylinder) J[k] = -1.0;
  if (f.form == Form::Cone) {
    const double slant = std::hypot(1.0, f.shape[1]);
    J[k] = -1.0 / slant;
    J[k + 1] = -at.y() / slant - distance_of(f, p) * f.shape[1] / (slant * slant);
  }
  if (f.form == Form::Torus) {
    J[k] = -n.dot((from - at.y() * f.frame.col(2)).normalized());
    J[k + 1] = -1.0;
  }
  return J;
}

Matrix3d frame_along(const Vector3d& axis) {
  return Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
}

Fitted plane_of(const FacetPatch& patch) {
  const Eigen::MatrixXd covariance = patch.points.transpose() * patch.points;
  Fitted f;
  f.frame = frame_along(eigenvectors(covariance).vectors.col(0));
  return f;
}

// Linear least squares for the centre and R^2 - |centre|^2.
Fitted sphere_of(const Points& points) {
  Eigen::MatrixXd A(points.rows(), 4);
  A << 2.0 * points, VectorXd::Ones(points.rows());
  const VectorXd x = least_squares(A, VectorXd(points.rowwise().squaredNorm())).x;
  Fitted f;
  f.form = Form::Sphere;
  f.origin = x.head<3>();
  f.shape = VectorXd::Constant(1, std::sqrt(std::max(0.0, x[3] + f.origin.squaredNorm())));
  return f;
}

/// The line nearest to the lines along the normals of facets, and how well it is determined: the
/// second smallest eigenvalue relative to the largest.
struct NormalLine {
  Fitted axis;
  double known = 0.0;
};

NormalLine line_through_normals(const FacetPatch& patch, const Points& places) {
  Matrix3d directions = Matrix3d::Zero(), moments = Matrix3d::Zero(), mixed = Matrix3d::Zero();
  for (Index i = 0; i < patch.normals.rows(); ++i) {
    const Vector3d n = patch.normals.row(i), m = Vector3d(places.row(i)).cross(n);
    directions += n * n.transpose();
    moments += m * m.transpose();
    mixed += n * m.transpose();
  }
  constexpr double flat = 1e-9;  // relative; directions in which all normals agree carry no moment
  Matrix3d moment_of;
  for (int k = 0; k < 3; ++k)
    moment_of.col(k) =
        shortest_least_squares(Eigen::MatrixXd(directions), VectorXd(mixed.col(k)), flat);
  const Matrix3d left = moments - mixed.transpose() * moment_of;
  const Eigenvectors found = eigenvectors(0.5 * (left + left.transpose()));
  const Vector3d axis = found.vectors.col(0);
  NormalLine met;
  met.axis.frame = frame_along(axis);
  met.axis.origin = axis.cross(-(moment_of * axis));
  // 1e-300 avoids 0 / 0
  met.known = found.values[1] / std::max(found.values[2], 1e-300);
  return met;
}

/// Returns an even selection of at most about 2000 points, which is enough for a fit.
Points thinned_points(const Points& points) {
  constexpr Index most = 2000;
  const Index every = 1 + points.rows() / most;
  Points few((points.rows() + every - 1) / every, 3);
  for (Index i = 0; i < few.rows(); ++i) few.row(i) = points.row(i * every);
  return few;
}

/// Returns the surface of revolution whose profile, a line or circle, fits the vertices in the half
/// plane of the axis.
Fitted profiled(Fitted f, Form form, const Points& points) {
  const Index n = points.rows();
  Eigen::MatrixXd A(n, form == Form::Torus ? 3 : 2);
  VectorXd b(n);
  for (Index i = 0; i < n; ++i) {
    const Vector2d at = radius_height(f, points.row(i));
    if (form == Form::Torus) {
      A.row(i) << 2.0 * at.x(), 2.0 * at.y(), 1.0;
      b[i] = at.squaredNorm();
    } else {
      A.row(i) << 1.0, at.y();
      b[i] = at.x();
    }
  }
  const VectorXd x = least_squares(A, b).x;
  f.form = form;
  if (form == Form::Torus) {
    f.origin += x[1] * f.frame.col(2);
    f.shape = Vector2d(x[0], std::sqrt(std::max(0.0, x[2] + x.head<2>().squaredNorm())));
  } else if (form == Form::Cone) {
    f.shape = x;
  } else {
    f.shape = VectorXd::Constant(1, b.mean());
  }
  return f;
}

/// Returns +1 if the surface has the same outward side as the facets, -1 if it has the opposite;
/// nothing if the facets do not all lie along the surface on one side.
std::optional<double> facing(const Fitted& f, const FacetPatch& patch) {
  constexpr double least = 0.866;  // cos 30 degrees
  double sign = 0.0;
  for (Index i = 0; i < patch.normals.rows(); ++i) {
    const double along = outward(f, patch.centres.row(i)).dot(patch.normals.row(i));
    if (sign == 0.0) sign = along > 0.0 ? 1.0 : -1.0;
    if (!(sign * along > least)) return std::nullopt;
  }
  return sign;
}

constexpr double apart = 1e-3;  // of the size of a patch; points that are farther
                                // apart are distinct

/// Returns true if at least `wanted` of the points are distinct.
bool has_distinct_points(const std::vector<Vector2d>& places, std::size_t wanted) {
  std::vector<Vector2d> found;
  for (const Vector2d& place : places) {
    const auto is_near = [&](const Vector2d& one) { return (one - place).norm() < apart; };
    if (std::none_of(found.begin(), found.end(), is_near)) found.push_back(place);
    if (found.size() == wanted) return true;
  }
  return false;
}

/// Returns true if more facets have the same normal than the halves of a few quadrangles: a flat.
bool has_flat(const FacetPatch& patch) {
  constexpr double same = 1e-5;  // of a unit normal
  constexpr int halves = 4;
  std::map<std::array<long, 3>, int> facing;
  for (const auto& normal : patch.normals.rowwise()) {
    const Eigen::RowVector3d at = normal / same;
    if (++facing[{std::lround(at[0]), std::lround(at[1]), std::lround(at[2])}] > halves)
      return true;
  }
  return false;
}

/// Returns true if no facet closes a cylinder or cone across its axis, as a cap does: its centre
/// would lie at less than half the radius.
bool is_uncapped(const Fitted& f, const FacetPatch& patch) {
  const double growth = f.form == Form::Cone ? f.shape[1] : 0.0;
  for (const auto& centre : patch.centres.rowwise()) {
    const Vector2d at = radius_height(f, centre);
    if (at.x() < 0.5 * (f.shape[0] + growth * at.y())) return false;
  }
  return true;
}

/// The directions of the lines of vertices along an axis, and radius and height of their rings.
struct LinesAndRings {
  std::vector<Vector2d> lines, rings;
};

LinesAndRings lines_and_rings(const Fitted& f, const Points& points) {
  LinesAndRings found;
  for (const auto& p : points.rowwise()) {
    const Vector3d from = f.frame.transpose() * (p.transpose() - f.origin);
    found.lines.push_back(from.head<2>().normalized());
    found.rings.push_back({from.head<2>().norm(), from.z()});
  }
  return found;
}

/// Returns the centre of the circle through the corners of a triangle; its centroid if that centre
/// is far away.
Vector3d middle_of_circle(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d u = b - a, v = c - a, n = u.cross(v);
  const Vector3d way =
      (u.squaredNorm() * v - v.squaredNorm() * u).cross(n) / (2.0 * n.squaredNorm());
  const Vector3d centre = (a + b + c) / 3.0;
  const double size = std::max(u.norm(), v.norm());
  return (a + way - centre).norm() < size ? Vector3d(a + way) : centre;
}

/// Returns true if at least three rings of a sphere are visible about every axis that another
/// surface could have.
bool is_evident_sphere(Fitted f, const FacetPatch& patch) {
  if (has_flat(patch)) return false;
  const Eigen::MatrixXd covariance = patch.points.transpose() * patch.points;
  const Matrix3d main = eigenvectors(covariance).vectors;
  for (const Vector3d& axis :
       {Vector3d(revolution_from_normals(patch).frame.col(2)), Vector3d(main.col(0)),
        Vector3d(main.col(1)), Vector3d(main.col(2))}) {
    f.frame = frame_along(axis);
    if (!has_distinct_points(lines_and_rings(f, patch.points).rings, 3)) return false;
  }
  return true;
}

}  // namespace

AnalyticPatch revolution_from_normals(const FacetPatch& patch) {
  constexpr double least = 1e-6;  // normals of a single ring of a cone meet in a point, so the axis
                                  // is not determined
  const NormalLine met = line_through_normals(patch, patch.feet);
  return met.known > least ? met.axis : line_through_normals(patch, patch.centres).axis;
}

double distance_of(const Fitted& f, const Vector3d& p) {
  if (f.form == Form::Plane) return f.frame.col(2).dot(p - f.origin);
  if (f.form == Form::Sphere) return (p - f.origin).norm() - f.shape[0];
  const Vector2d at = radius_height(f, p);
  if (f.form == Form::Cylinder) return at.x() - f.shape[0];
  if (f.form == Form::Cone)
    return (at.x() - f.shape[0] - f.shape[1] * at.y()) / std::hypot(1.0, f.shape[1]);
  return std::hypot(at.x() - f.shape[0], at.y()) - f.shape[1];
}

Vector3d outward(const Fitted& f, const Vector3d& p) {
  const Vector3d axis = f.frame.col(2), from = p - f.origin;
  if (f.form == Form::Plane) return axis;
  if (f.form == Form::Sphere) return from.normalized();
  const double height = from.dot(axis);
  const Vector3d radial = (from - height * axis).normalized();
  if (f.form == Form::Cylinder) return radial;
  if (f.form == Form::Cone) return (radial - f.shape[1] * axis).normalized();
  return (from - f.shape[0] * radial).normalized();
}

Index numbers_of(Form form) {
  // in the order of Form: plane, sphere, cylinder, cone, torus
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
  patch.feet.resize(Index(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Eigen::RowVector3i t = design.triangles.row(triangles[i]);
    const Vector3d a = design.vertices.row(t[0]), b = design.vertices.row(t[1]),
                   c = design.vertices.row(t[2]);
    patch.centres.row(Index(i)) = ((a + b + c) / 3.0 - patch.middle) / patch.size;
    patch.normals.row(Index(i)) = (b - a).cross(c - a).normalized();
    patch.feet.row(Index(i)) = (middle_of_circle(a, b, c) - patch.middle) / patch.size;
  }
  patch.vertices = std::move(vertices);
  patch.triangles = std::move(triangles);
  return patch;
}

AnalyticPatch to_patch_coordinates(const FacetPatch& patch, Fitted f) {
  f.origin = (f.origin - patch.middle) / patch.size;
  const Index lengths = f.form == Form::Cone ? 1 : f.shape.size();
  f.shape.head(lengths) /= patch.size;
  return f;
}

AnalyticPatch from_patch_coordinates(const FacetPatch& patch, Fitted f) {
  f.origin = patch.middle + patch.size * f.origin;
  const Index lengths = f.form == Form::Cone ? 1 : f.shape.size();
  f.shape.head(lengths) *= patch.size;
  return f;
}

double farthest(const FacetPatch& patch, const Fitted& f) {
  return distances(f, patch.points).cwiseAbs().maxCoeff() * patch.size;
}

AnalyticPatch first_guess(Form form, const FacetPatch& patch, const Fitted& axis) {
  if (form == Form::Plane) return plane_of(patch);
  if (form == Form::Sphere) return sphere_of(thinned_points(patch.points));
  return profiled(axis, form, thinned_points(patch.points));
}

AnalyticPatch adjusted(Fitted f, const FacetPatch& patch, int rounds) {
  // of the patch's size, near rounding
  constexpr double still = 1e-14;
  const Points points = thinned_points(patch.points);
  for (int round = 0; round < rounds; ++round) {
    Eigen::MatrixXd J(points.rows(), numbers_of(f.form));
    for (Index i = 0; i < points.rows(); ++i) J.row(i) = slopes(f, points.row(i));
    const VectorXd change = -least_squares(J, distances(f, points)).x;
    // a step beyond ten sizes of the patch diverges
    if (!change.allFinite() || change.norm() > 10.0) break;
    f = moved(f, change);
    if (change.norm() < still) break;
  }
  return f;
}

bool has_lines(const Fitted& f, const FacetPatch& patch, int wanted) {
  return has_distinct_points(lines_and_rings(f, patch.points).lines, std::size_t(wanted));
}

bool is_determined(const Fitted& f, const FacetPatch& patch, int tangents) {
  if (f.form == Form::Plane) return true;
  if (f.form == Form::Sphere) return is_evident_sphere(f, patch);
  const LinesAndRings found = lines_and_rings(f, patch.points);
  if (f.form == Form::Torus) return f.shape[0] > apart && has_distinct_points(found.rings, 5);
  return has_distinct_points(found.lines, std::size_t(std::max(1, 5 - tangents))) &&
         is_uncapped(f, patch);
}

std::optional<AnalyticPatch> surface_of(const FacetPatch& patch, double tolerance) {
  const auto placed = [&](const Fitted& f) -> std::optional<Fitted> {
    // vertices must overdetermine a surface twice, or it fits by chance
    const Index enough = f.form == Form::Plane ? 3 : 2 * numbers_of(f.form);
    const double off = farthest(patch, f);
    if (patch.points.rows() < enough || !(off <= tolerance)) return std::nullopt;
    const std::optional<double> sign = facing(f, patch);
    if (!sign || !is_determined(f, patch)) return std::nullopt;
    Fitted surface = from_patch_coordinates(patch, f);
    surface.sign = *sign;
    surface.off = off;
    for (const auto& p : patch.points.rowwise())
      surface.box.extend(patch.middle + patch.size * p.transpose());
    return surface;
  };
  if (const auto plane = placed(plane_of(patch))) return plane;
  const Fitted axis = revolution_from_normals(patch);
  for (const Form form : {Form::Cylinder, Form::Cone, Form::Sphere, Form::Torus})
    if (const auto found = placed(adjusted(first_guess(form, patch, axis), patch))) return found;
  return std::nullopt;
}

Contact dropped(const Fitted& f, const Vector3d& p) {
  const Vector3d normal = outward(f, p);
  return {p - distance_of(f, p) * normal, f.sign * normal};
}

}  // namespace abbe::cutting
