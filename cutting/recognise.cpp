#include "cutting/recognise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "cutting/primitive.h"
#include "cutting/smooth_patches.h"
#include "kinematics/least_squares.h"
#include "kinematics/require.h"
#include "kinematics/symmetric.h"

namespace abbe::cutting {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// A patch about the middle of its vertices, its size 1.
struct Patch {
  std::vector<int> vertices;
  std::vector<Index> triangles;
  Points points;            // (vertices)
  Points centres, normals;  // (triangles)
  Vector3d middle;
  double size = 1.0;  // mm
};

using Fitted = RecognisedPatch;

/// Radius about the axis and height along it.
Vector2d radius_height(const Fitted& f, const Vector3d& p) {
  const Vector3d from = f.frame.transpose() * (p - f.origin);
  return {from.head<2>().norm(), from.z()};
}

/// Signed distance of a point from the surface.
double distance_of(const Fitted& f, const Vector3d& p) {
  if (f.form == Form::Plane) return f.frame.col(2).dot(p - f.origin);
  if (f.form == Form::Sphere) return (p - f.origin).norm() - f.shape[0];
  const Vector2d at = radius_height(f, p);
  if (f.form == Form::Cylinder) return at.x() - f.shape[0];
  if (f.form == Form::Cone)
    return (at.x() - f.shape[0] - f.shape[1] * at.y()) / std::hypot(1.0, f.shape[1]);
  return std::hypot(at.x() - f.shape[0], at.y()) - f.shape[1];
}

/// The direction in which the distance grows.
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

/// The surface moved by small numbers: two turns of the axis, the origin, the shape. What a surface
/// does not have, or what moves it into itself, is left out.
Fitted moved(Fitted f, const VectorXd& by) {
  const bool turns = f.form != Form::Sphere;
  Index k = 0;
  if (turns) {
    const Vector3d axis = f.frame * Vector3d(by[0], by[1], 1.0);
    f.frame = Eigen::Quaterniond::FromTwoVectors(f.frame.col(2), axis).toRotationMatrix() * f.frame;
    k = 2;
  }
  const bool along = f.form == Form::Sphere || f.form == Form::Torus || f.form == Form::Plane;
  if (f.form != Form::Plane) {
    f.origin += by[k] * f.frame.col(0) + by[k + 1] * f.frame.col(1);
    k += 2;
  }
  if (along) f.origin += by[k++] * f.frame.col(2);
  for (Index i = 0; i < f.shape.size(); ++i) f.shape[i] += by[k++];
  return f;
}

Index numbers_of(Form form) {
  constexpr Index numbers[] = {3, 4, 5, 6, 7};
  return numbers[std::size_t(form)];
}

VectorXd distances(const Fitted& f, const Points& points) {
  VectorXd all(points.rows());
  for (Index i = 0; i < all.size(); ++i) all[i] = distance_of(f, points.row(i));
  return all;
}

/// Least squares of the distances by Gauss and Newton, derivatives by central differences.
Fitted adjusted(Fitted f, const Points& points) {
  constexpr int rounds = 30;
  constexpr double step = 1e-6, still = 1e-14;
  const Index n = numbers_of(f.form);
  for (int round = 0; round < rounds; ++round) {
    Eigen::MatrixXd J(points.rows(), n);
    for (Index k = 0; k < n; ++k) {
      const VectorXd by = step * VectorXd::Unit(n, k);
      J.col(k) = (distances(moved(f, by), points) - distances(moved(f, -by), points)) / (2 * step);
    }
    const VectorXd change = -least_squares(J, distances(f, points)).x;
    if (!change.allFinite() || change.norm() > 10.0) break;
    f = moved(f, change);
    if (change.norm() < still) break;
  }
  return f;
}

Matrix3d frame_along(const Vector3d& axis) {
  return Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
}

Fitted plane_of(const Patch& patch) {
  const Eigen::MatrixXd covariance = patch.points.transpose() * patch.points;
  Fitted f;
  f.frame = frame_along(eigenvectors(covariance).vectors.col(0));
  return f;
}

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

/// The line that the normals of the facets meet, as axis and origin.
Fitted turned_about_normals(const Patch& patch) {
  Matrix3d directions = Matrix3d::Zero(), moments = Matrix3d::Zero(), mixed = Matrix3d::Zero();
  for (Index i = 0; i < patch.normals.rows(); ++i) {
    const Vector3d n = patch.normals.row(i), m = Vector3d(patch.centres.row(i)).cross(n);
    directions += n * n.transpose();
    moments += m * m.transpose();
    mixed += n * m.transpose();
  }
  constexpr double flat = 1e-9;
  Matrix3d moment_of;
  for (int k = 0; k < 3; ++k)
    moment_of.col(k) =
        shortest_least_squares(Eigen::MatrixXd(directions), VectorXd(mixed.col(k)), flat);
  const Matrix3d left = moments - mixed.transpose() * moment_of;
  const Vector3d axis = eigenvectors(0.5 * (left + left.transpose())).vectors.col(0);
  Fitted f;
  f.frame = frame_along(axis);
  f.origin = axis.cross(-(moment_of * axis));
  return f;
}

/// The straight line, or the circle, on which the vertices lie in the half plane of their axis.
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

Patch patch_of(const Design& design, std::vector<int> vertices, std::vector<Index> triangles) {
  Patch patch;
  patch.points.resize(Index(vertices.size()), 3);
  for (std::size_t i = 0; i < vertices.size(); ++i)
    patch.points.row(Index(i)) = design.vertices.row(vertices[i]);
  patch.middle = patch.points.colwise().mean().transpose();
  patch.points.rowwise() -= patch.middle.transpose();
  patch.size = std::max(patch.points.rowwise().norm().maxCoeff(), 1e-300);
  patch.points /= patch.size;
  patch.centres.resize(Index(triangles.size()), 3);
  patch.normals.resize(Index(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Eigen::RowVector3i t = design.triangles.row(triangles[i]);
    const Vector3d a = design.vertices.row(t[0]), b = design.vertices.row(t[1]),
                   c = design.vertices.row(t[2]);
    patch.centres.row(Index(i)) = ((a + b + c) / 3.0 - patch.middle) / patch.size;
    patch.normals.row(Index(i)) = (b - a).cross(c - a).normalized();
  }
  patch.vertices = std::move(vertices);
  patch.triangles = std::move(triangles);
  return patch;
}

/// Whether the facets lie along the surface, all on the same side of it. @return +1 where it looks
/// outward as they do, -1 where it looks inward; none
std::optional<double> facing(const Fitted& f, const Patch& patch) {
  constexpr double least = 0.866;  // cos 30 degrees
  double sign = 0.0;
  for (Index i = 0; i < patch.normals.rows(); ++i) {
    const double along = outward(f, patch.centres.row(i)).dot(patch.normals.row(i));
    if (sign == 0.0) sign = along > 0.0 ? 1.0 : -1.0;
    if (!(sign * along > least)) return std::nullopt;
  }
  return sign;
}

/// Evenly some of the points: enough to fit by.
Points few_of(const Points& points) {
  constexpr Index most = 2000;
  const Index every = 1 + points.rows() / most;
  Points few((points.rows() + every - 1) / every, 3);
  for (Index i = 0; i < few.rows(); ++i) few.row(i) = points.row(i * every);
  return few;
}

constexpr double apart = 1e-3;  // of the size of a patch

/// Whether at least so many of the places are apart from one another.
bool are_apart(const std::vector<Vector2d>& places, std::size_t wanted) {
  std::vector<Vector2d> found;
  for (const Vector2d& place : places) {
    const auto is_near = [&](const Vector2d& one) { return (one - place).norm() < apart; };
    if (std::none_of(found.begin(), found.end(), is_near)) found.push_back(place);
    if (found.size() == wanted) return true;
  }
  return false;
}

/// Whether more facets look the same way than the halves of a few quadrangles: a flat.
bool has_flat(const Patch& patch) {
  constexpr double same = 1e-5;
  constexpr int halves = 4;
  std::map<std::array<long, 3>, int> facing;
  for (const auto& normal : patch.normals.rowwise()) {
    const Eigen::RowVector3d at = normal / same;
    if (++facing[{std::lround(at[0]), std::lround(at[1]), std::lround(at[2])}] > halves)
      return true;
  }
  return false;
}

/// Whether no facet closes a cylinder or cone across its axis: that is a cap.
bool is_uncapped(const Fitted& f, const Patch& patch) {
  const double growth = f.form == Form::Cone ? f.shape[1] : 0.0;
  for (const auto& centre : patch.centres.rowwise()) {
    const Vector2d at = radius_height(f, centre);
    if (at.x() < 0.5 * (f.shape[0] + growth * at.y())) return false;
  }
  return true;
}

/// Lines of vertices along an axis as directions, and their rings as radius and height.
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

/// A sphere shows about every axis that those of other surfaces may be.
bool is_evident_sphere(Fitted f, const Fitted& turned, const Patch& patch) {
  if (has_flat(patch)) return false;
  const Eigen::MatrixXd covariance = patch.points.transpose() * patch.points;
  const Matrix3d main = eigenvectors(covariance).vectors;
  for (const Vector3d& axis : {Vector3d(turned.frame.col(2)), Vector3d(main.col(0)),
                               Vector3d(main.col(1)), Vector3d(main.col(2))}) {
    f.frame = frame_along(axis);
    if (!are_apart(lines_and_rings(f, patch.points).rings, 3)) return false;
  }
  return true;
}

/// Whether the vertices stand on enough lines along a surface, or rings around it, to show it.
/// Three lines of a bend lie on a cylinder, and four of a symmetric one; two rings on a sphere, as
/// those of any cylinder or cone; three rings of a chamfered shaft on a torus, and four of a
/// symmetric one: that these fit says nothing of what lies between them. A torus about a point is a
/// sphere that was refused.
bool is_evident(const Fitted& f, const Fitted& turned, const Patch& patch) {
  if (f.form == Form::Sphere) return is_evident_sphere(f, turned, patch);
  const LinesAndRings found = lines_and_rings(f, patch.points);
  if (f.form == Form::Torus) return f.shape[0] > apart && are_apart(found.rings, 5);
  return are_apart(found.lines, 5) && is_uncapped(f, patch);
}

/// Planes first, and what is curved in one direction before what is in two.
std::optional<Fitted> form_of(const Patch& patch, double tolerance) {
  const Points few = few_of(patch.points);
  const auto lies_on = [&](const Fitted& f) {
    const Index enough = f.form == Form::Plane ? 3 : 2 * numbers_of(f.form);
    return patch.points.rows() >= enough &&
           distances(f, patch.points).cwiseAbs().maxCoeff() * patch.size <= tolerance &&
           facing(f, patch);
  };
  if (const Fitted plane = plane_of(patch); lies_on(plane)) return plane;
  const Fitted axis = turned_about_normals(patch);
  for (const Form form : {Form::Cylinder, Form::Cone, Form::Sphere, Form::Torus}) {
    const Fitted near = form == Form::Sphere ? sphere_of(few) : profiled(axis, form, few);
    const Fitted found = adjusted(near, few);
    if (lies_on(found) && is_evident(found, axis, patch)) return found;
  }
  return std::nullopt;
}

/// The surface in the frame of the mesh, with what is said of it.
RecognisedPatch placed(Fitted f, const Patch& patch, double area) {
  f.sign = *facing(f, patch);
  f.off = distances(f, patch.points).cwiseAbs().maxCoeff() * patch.size;
  f.area = area;
  f.origin = patch.middle + patch.size * f.origin;
  if (f.form == Form::Cone)
    f.shape[0] *= patch.size;
  else
    f.shape *= patch.size;
  for (const auto& p : patch.points.rowwise())
    f.box.extend(patch.middle + patch.size * p.transpose());
  return f;
}

/// The nearest point of the surface, near it, with the normal of the part.
Contact dropped(const Fitted& f, const Vector3d& p) {
  const Vector3d normal = outward(f, p);
  return {p - distance_of(f, p) * normal, f.sign * normal};
}

/// Whether a place is one that `dropped` has made.
bool lies_on(const Fitted& f, const Contact& at, double rounding) {
  constexpr double along = 1e-6;
  return std::abs(distance_of(f, at.point)) <= rounding &&
         f.sign * outward(f, at.point).dot(at.normal) > 1.0 - along;
}

}  // namespace

Recognised recognised(const Design& design, double tolerance) {
  require(std::isfinite(tolerance) && tolerance > 0.0, "recognised: tolerance must be positive");
  const std::vector<int> number = patches(design);
  const int count = number.empty() ? 0 : 1 + *std::max_element(number.begin(), number.end());
  std::vector<std::vector<int>> vertices(std::size_t(count), std::vector<int>{});
  std::vector<std::vector<Index>> triangles(std::size_t(count), std::vector<Index>{});
  for (std::size_t i = 0; i < number.size(); ++i)
    vertices[std::size_t(number[i])].push_back(int(i));
  for (Index t = 0; t < design.triangles.rows(); ++t)
    triangles[std::size_t(number[std::size_t(design.triangles(t, 0))])].push_back(t);
  Recognised found{design, {}, 0.0};
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    double area = 0.0;
    for (const int v : vertices[k]) area += design.area[v];
    found.area += area;
    if (triangles[k].empty()) continue;
    const Patch patch = patch_of(design, std::move(vertices[k]), std::move(triangles[k]));
    const std::optional<Fitted> form = form_of(patch, tolerance);
    if (!form) continue;
    const RecognisedPatch surface = placed(*form, patch, area);
    for (const int v : patch.vertices) {
      const Contact at = dropped(surface, design.vertices.row(v));
      found.design.vertices.row(v) = at.point;
      found.design.normals.row(v) = at.normal;
    }
    found.patches.push_back(surface);
  }
  found.design.facet_error =
      facet_error(found.design.vertices, found.design.normals, found.design.triangles);
  found.design.area = vertex_area(found.design.vertices, found.design.triangles);
  return found;
}

OnSurface on_recognised(const std::vector<RecognisedPatch>& patches, const Eigen::Isometry3d& T) {
  struct Near {
    RecognisedPatch surface;
    double margin2;  // mm^2: what was moved onto a convex surface may stand out of the box of its
                     // vertices
    double rounding;
  };
  const Eigen::Isometry3d back = T.inverse();
  std::vector<Near> all;
  for (const RecognisedPatch& one : patches) {
    const double size = one.box.diagonal().norm();
    all.push_back({one, 0.25 * size * size, 1e-9 * (size + back.translation().norm())});
  }
  return [all, T, back](std::span<const Contact> corners, std::span<const double> weights) {
    std::array<Contact, 3> at;
    Vector3d flat = Vector3d::Zero();
    for (std::size_t i = 0; i < corners.size(); ++i) {
      at[i] = {back * corners[i].point, back.linear() * corners[i].normal};
      flat += weights[i] * at[i].point;
    }
    for (const Near& one : all) {
      if (one.surface.box.squaredExteriorDistance(flat) > one.margin2) continue;
      if (!std::all_of(at.begin(), at.begin() + std::ptrdiff_t(corners.size()),
                       [&](const Contact& c) { return lies_on(one.surface, c, one.rounding); }))
        continue;
      const Contact found = dropped(one.surface, flat);
      return Contact{T * found.point, T.linear() * found.normal};
    }
    return on_smooth_facet(corners, weights);
  };
}

}  // namespace abbe::cutting
