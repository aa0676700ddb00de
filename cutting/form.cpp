#include "cutting/form.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <type_traits>

#include <Eigen/Dense>

#include "kinematics/least_squares.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

std::vector<Eigen::Index> cut_vertices(const Design& design, const Surface& surface) {
  const auto n = static_cast<std::size_t>(design.vertices.rows());
  if (surface.status.size() != n || static_cast<std::size_t>(surface.residual.size()) != n ||
      static_cast<std::size_t>(design.area.size()) != n ||
      static_cast<std::size_t>(design.normals.rows()) != n)
    throw std::invalid_argument("form: the map and the design have different sizes");
  std::vector<Eigen::Index> cut;
  for (std::size_t i = 0; i < n; ++i)
    if (surface.status[i] == VertexStatus::Cut) cut.push_back(static_cast<Eigen::Index>(i));
  return cut;
}

/// Residual at the cut vertices after displacement and size are taken out. By orthogonal
/// decomposition, because on a shallow cap size and height differ by the square of the slope only.
std::optional<Eigen::VectorXd> form_residual(const Design& design, const Surface& surface,
                                             const std::vector<Eigen::Index>& cut) {
  const auto n = static_cast<Eigen::Index>(cut.size());
  if (n < 8) return std::nullopt;
  Vector3d middle = Vector3d::Zero();
  for (const Eigen::Index v : cut) middle += design.vertices.row(v).transpose() / double(n);
  double reach = 0.0;
  for (const Eigen::Index v : cut)
    reach = std::max(reach, (design.vertices.row(v).transpose() - middle).norm());
  if (!(reach > 0.0)) return std::nullopt;

  Eigen::MatrixXd A(n, 7);
  Eigen::VectorXd r(n), weight(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index v = cut[static_cast<std::size_t>(i)];
    const Vector3d normal = design.normals.row(v);
    const Vector3d arm = (design.vertices.row(v).transpose() - middle) / reach;
    A.row(i) << normal.transpose(), arm.cross(normal).transpose(), 1.0;
    r[i] = surface.residual[v];
    weight[i] = std::sqrt(design.area[v]);
  }
  const Eigen::VectorXd solution =
      shortest_least_squares(weight.asDiagonal() * A, weight.cwiseProduct(r), 1e-7);
  return Eigen::VectorXd(r - A * solution);
}

double peak_to_valley(const Eigen::VectorXd& values) {
  return values.maxCoeff() - values.minCoeff();
}

// --- minimum zone of a plane --------------------------------------------------------------------

/// A plane z = c0 + c1 x + c2 y and half the zone about it.
using Zone = Eigen::Vector4d;

/// Smallest zone that holds a handful of points: tries every vertex of the linear program
/// +-(z - plane) <= t, four active of two constraints a point.
std::optional<Zone> smallest_zone(const std::vector<Vector3d>& points) {
  const int m = 2 * static_cast<int>(points.size());
  Eigen::MatrixXd C(m, 4);
  Eigen::VectorXd d(m);
  for (int i = 0; i < m; ++i) {
    const Vector3d& p = points[static_cast<std::size_t>(i / 2)];
    const double sign = i % 2 == 0 ? 1.0 : -1.0;
    C.row(i) << sign, sign * p.x(), sign * p.y(), 1.0;
    d[i] = sign * p.z();
  }
  std::optional<Zone> best;
  const double slack = 1e-12 * (1.0 + d.cwiseAbs().maxCoeff());
  for (int i = 0; i < m; ++i)
    for (int j = i + 1; j < m; ++j)
      for (int k = j + 1; k < m; ++k)
        for (int l = k + 1; l < m; ++l) {
          Eigen::Matrix4d M;
          M << C.row(i), C.row(j), C.row(k), C.row(l);
          const Eigen::FullPivLU<Eigen::Matrix4d> lu(M);
          if (lu.rank() < 4) continue;
          const Zone zone = lu.solve(Eigen::Vector4d(d[i], d[j], d[k], d[l]));
          if (((C * zone - d).array() < -slack).any()) continue;
          if (!best || zone[3] < (*best)[3]) best = zone;
        }
  return best;
}

double height(const Vector3d& p, const Zone& zone) {
  return p.z() - zone[0] - zone[1] * p.x() - zone[2] * p.y();
}

/// Width of the smallest zone: the points that stand out most join the handful until none stands
/// out of the zone of the handful (each round its half width grows, so it ends).
std::optional<double> minimum_zone(const std::vector<Vector3d>& points) {
  std::vector<Vector3d> handful;
  const auto add = [](std::vector<Vector3d>& to, const Vector3d& p) {
    if (std::find(to.begin(), to.end(), p) == to.end()) to.push_back(p);
  };
  for (const auto& key :
       {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(1, 1, 0), Vector3d(1, -1, 0)}) {
    const auto [low, high] = std::minmax_element(
        points.begin(), points.end(),
        [&](const Vector3d& a, const Vector3d& b) { return a.dot(key) < b.dot(key); });
    add(handful, *low);
    add(handful, *high);
  }
  std::optional<double> width;
  for (int round = 0; round < 60; ++round) {
    const auto zone = smallest_zone(handful);
    if (!zone) break;
    const auto [low, high] = std::minmax_element(
        points.begin(), points.end(),
        [&](const Vector3d& a, const Vector3d& b) { return height(a, *zone) < height(b, *zone); });
    const double seen = height(*high, *zone) - height(*low, *zone);
    const double tilt = std::sqrt(1.0 + (*zone)[1] * (*zone)[1] + (*zone)[2] * (*zone)[2]);
    width = width ? std::min(*width, seen / tilt) : seen / tilt;
    if (seen <= 2.0 * (*zone)[3] + 1e-12) break;
    std::vector<Vector3d> active;
    for (const Vector3d& p : handful)
      if (std::abs(height(p, *zone)) > (*zone)[3] - 1e-9 * (1.0 + (*zone)[3])) active.push_back(p);
    if (active.size() > 6) active.resize(6);
    add(active, *low);
    add(active, *high);
    handful = std::move(active);
  }
  return width;
}

/// The machined points over a plane, scaled so that x and y are of order one.
std::vector<Vector3d> over_plane(const Design& design, const std::vector<Eigen::Index>& cut,
                                 const Eigen::VectorXd& residual) {
  double reach = 1e-300;
  for (const Eigen::Index v : cut)
    reach = std::max(reach, design.vertices.row(v).head<2>().cwiseAbs().maxCoeff());
  std::vector<Vector3d> points;
  for (std::size_t i = 0; i < cut.size(); ++i)
    points.emplace_back(design.vertices(cut[i], 0) / reach, design.vertices(cut[i], 1) / reach,
                        residual[static_cast<Eigen::Index>(i)]);
  return points;
}

// --- roundness ----------------------------------------------------------------------------------

std::optional<double> roundness(const Design& design, const Surface& surface,
                                const std::vector<Eigen::Index>& cut, double z_middle) {
  double nearest = std::numeric_limits<double>::infinity(), z_ring = 0.0;
  for (const Eigen::Index v : cut) {
    const double z = design.vertices(v, 2);
    if (std::abs(z - z_middle) >= nearest) continue;
    nearest = std::abs(z - z_middle);
    z_ring = z;
  }
  std::vector<Eigen::Vector2d> ring;
  for (const Eigen::Index v : cut) {
    if (std::abs(design.vertices(v, 2) - z_ring) > 1e-9) continue;
    const Eigen::Vector2d p = design.vertices.row(v).head<2>();
    const Eigen::Vector2d n = design.normals.row(v).head<2>();
    // along the normal by r is, at the same height, across the axis by r over the normal's part
    // there
    ring.push_back(p + n / n.squaredNorm() * surface.residual[v]);
  }
  if (ring.size() < 6) return std::nullopt;
  Eigen::Matrix<double, Eigen::Dynamic, 2> points(static_cast<Eigen::Index>(ring.size()), 2);
  for (std::size_t i = 0; i < ring.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = ring[i];
  return fit_circle(points).roundness;
}

/// Name of the `_lsq` number, and the height of the ring for roundness where there is one.
struct Wanted {
  std::string name;
  bool flat = false;
  std::optional<double> ring_height;
};

Wanted wanted(const Primitive& primitive) {
  return std::visit(
      [](const auto& p) -> Wanted {
        using Kind = std::decay_t<decltype(p)>;
        if constexpr (std::is_same_v<Kind, RectanglePlane> || std::is_same_v<Kind, Disc>)
          return {"flatness_lsq", true, {}};
        else if constexpr (std::is_same_v<Kind, Cylinder>)
          return {"cylindricity_lsq", false, 0.5 * p.height};
        else if constexpr (std::is_same_v<Kind, Cone>)
          return {"conicity_lsq", false,
                  p.half_apex_angle <= std::numbers::pi / 4 ? std::optional(0.5 * p.height)
                                                            : std::nullopt};
        else if constexpr (std::is_same_v<Kind, SphereCap>)
          return {"sphericity_lsq", false, {}};
        else if constexpr (std::is_same_v<Kind, Torus>)
          return {"torus_form_lsq", false, {}};
        else
          return {"profile_form_lsq", false, {}};
      },
      primitive);
}

}  // namespace

std::vector<FormNumber> form(const Primitive& primitive, const Design& design_m,
                             const Surface& surface) {
  const std::vector<Eigen::Index> cut = cut_vertices(design_m, surface);
  const auto residual = form_residual(design_m, surface, cut);
  if (!residual) return {};
  const Wanted what = wanted(primitive);
  std::vector<FormNumber> numbers{{what.name, peak_to_valley(*residual)}};
  if (what.flat)
    if (const auto zone = minimum_zone(over_plane(design_m, cut, *residual)))
      numbers.push_back({"flatness_minimum_zone", *zone});
  if (what.ring_height)
    if (const auto value = roundness(design_m, surface, cut, *what.ring_height))
      numbers.push_back({"roundness_lsc", *value});
  return numbers;
}

Circle fit_circle(const Eigen::Matrix<double, Eigen::Dynamic, 2>& points) {
  const Eigen::Index n = points.rows();
  if (n < 3) throw std::invalid_argument("fit_circle: at least 3 points are needed");
  if (!points.allFinite()) throw std::invalid_argument("fit_circle: a point is not finite");
  const Eigen::RowVector2d middle = points.colwise().mean();
  const Eigen::Matrix<double, Eigen::Dynamic, 2> q = points.rowwise() - middle;
  const double scale = q.rowwise().norm().maxCoeff();

  // start: the circle that is best in squared distances, linear in its unknowns
  Eigen::MatrixXd A(n, 3);
  A << q / scale, Eigen::VectorXd::Ones(n);
  const Eigen::VectorXd right = q.rowwise().squaredNorm() / scale;
  const auto start = least_squares(A, right, 1e-10);
  if (!(scale > 0.0) || start.rank < 3)
    throw std::invalid_argument("fit_circle: the points lie on a line");
  const Eigen::Vector3d c = start.x;
  Eigen::Vector2d centre = 0.5 * c.head<2>();
  double radius = std::sqrt(std::max(0.0, centre.squaredNorm() + c[2] * scale));

  for (int i = 0; i < 50; ++i) {
    const Eigen::Matrix<double, Eigen::Dynamic, 2> d = q.rowwise() - centre.transpose();
    const Eigen::VectorXd distance = d.rowwise().norm();
    if (!(distance.minCoeff() > 0.0)) break;
    Eigen::MatrixX3d J(n, 3);
    J << d.array().colwise() / distance.array(), Eigen::VectorXd::Ones(n);
    const Eigen::VectorXd left = distance.array() - radius;
    const Eigen::Vector3d step = least_squares(J, left).x;
    centre += step.head<2>();
    radius += step[2];
    if (step.norm() < 1e-15 * scale) break;
  }
  const Eigen::VectorXd distance = (q.rowwise() - centre.transpose()).rowwise().norm();
  return {centre + middle.transpose(), radius, peak_to_valley(distance)};
}

}  // namespace abbe::cutting
