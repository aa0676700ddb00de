#include "cutting/map/form.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <type_traits>

#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "cutting/map/residual.h"
#include "cutting/part/compensated_sum.h"
#include "kinematics/decompositions.h"

namespace abbe::cutting {

namespace {

using Eigen::Vector3d;
using Row = kinematics::Deviation;

/// A cut vertex or the sample within a triangle.
struct CutPoint {
  Vector3d point, normal;
  double residual;
  double weight;  ///< mm^2
};

void check_map(const Surface& surface, const Design& design) {
  const auto n = static_cast<std::size_t>(design.vertices.rows());
  if (surface.status.size() != n || static_cast<std::size_t>(surface.residual.size()) != n ||
      static_cast<std::size_t>(design.area.size()) != n ||
      static_cast<std::size_t>(design.normals.rows()) != n)
    throw std::invalid_argument("aligned: the map and the design have different sizes");
  for (std::size_t i = 0; i < n; ++i)
    if (surface.status[i] == VertexStatus::Cut &&
        !std::isfinite(surface.residual[static_cast<Eigen::Index>(i)]))
      throw std::invalid_argument("aligned: a cut vertex without a residual");
}

std::vector<CutPoint> cut_points(const Surface& surface, const Design& design) {
  const Weights weights = cutting::weights(surface, design);
  std::vector<CutPoint> points;
  for (std::size_t i = 0; i < surface.status.size(); ++i) {
    if (surface.status[i] != VertexStatus::Cut) continue;
    const auto v = static_cast<Eigen::Index>(i);
    points.push_back(
        {design.vertices.row(v), design.normals.row(v), surface.residual[v], weights.vertex[v]});
  }
  for (Eigen::Index t = 0; t < weights.within.size(); ++t)
    if (weights.within[t] > 0.0)
      points.push_back(
          {value_at_place_within(surface.sampled_within, design.vertices, design.triangles, t),
           value_at_place_within(surface.sampled_within, design.normals, design.triangles, t),
           surface.within[t], weights.within[t]});
  return points;
}

/// The point at which the displacement is stated, and the length by which angles are multiplied.
struct Gauge {
  Vector3d point = Vector3d::Zero();
  double length = 1.0;
};

Gauge gauge(const std::vector<CutPoint>& points) {
  Sum area;
  std::array<Sum, 3> moment;
  for (const CutPoint& p : points) {
    area.add(p.weight);
    for (int k = 0; k < 3; ++k) moment[static_cast<std::size_t>(k)].add(p.weight * p.point[k]);
  }
  if (!(area.value() > 0.0)) return {};
  Gauge g;
  for (int k = 0; k < 3; ++k)
    g.point[k] = moment[static_cast<std::size_t>(k)].value() / area.value();
  Sum square;
  for (const CutPoint& p : points) square.add(p.weight * (p.point - g.point).squaredNorm());
  const double length = std::sqrt(square.value() / area.value());
  if (length > 0.0) g.length = length;
  return g;
}

/// Returns the displacement along a normal for each component, with angles multiplied by g.length.
Row row_of(const Vector3d& point, const Vector3d& normal, const Gauge& g) {
  Row row;
  row << normal, (point - g.point).cross(normal) / g.length;
  return row;
}

struct NormalEquations {
  Eigen::MatrixXd A;
  Eigen::VectorXd b;
};

NormalEquations normal_equations(const std::vector<CutPoint>& points, const Gauge& g, int size) {
  std::array<Sum, 6> rhs;
  std::array<std::array<Sum, 6>, 6> lhs;
  for (const CutPoint& p : points) {
    const Row row = row_of(p.point, p.normal, g);
    for (int i = 0; i < size; ++i) {
      const auto a = static_cast<std::size_t>(i);
      rhs[a].add(p.weight * row[i] * p.residual);
      for (int j = 0; j <= i; ++j)
        lhs[a][static_cast<std::size_t>(j)].add(p.weight * row[i] * row[j]);
    }
  }
  NormalEquations e{Eigen::MatrixXd(size, size), Eigen::VectorXd(size)};
  for (int i = 0; i < size; ++i) {
    e.b[i] = rhs[static_cast<std::size_t>(i)].value();
    for (int j = 0; j <= i; ++j)
      e.A(i, j) = e.A(j, i) = lhs[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)].value();
  }
  return e;
}

/// Returns names for the null space. Its basis is brought to echelon form, so that each vector has
/// as few components as possible, and is named after those above a hundredth.
std::vector<std::string> names(Eigen::MatrixXd basis) {
  static constexpr std::array component = {"EX", "EY", "EZ", "EA", "EB", "EC"};
  std::vector<std::string> result;
  for (Eigen::Index column = 0; column < basis.cols(); ++column) {
    Eigen::Index pivot_row = 0, pivot_column = 0;
    basis.rightCols(basis.cols() - column).cwiseAbs().maxCoeff(&pivot_row, &pivot_column);
    basis.col(column).swap(basis.col(column + pivot_column));
    basis.col(column) /= basis(pivot_row, column);
    for (Eigen::Index other = 0; other < basis.cols(); ++other)
      if (other != column) basis.col(other) -= basis(pivot_row, other) * basis.col(column);
  }
  for (Eigen::Index column = 0; column < basis.cols(); ++column) {
    std::string name;
    for (Eigen::Index i = 0; i < basis.rows(); ++i)
      if (std::abs(basis(i, column)) > 1e-2)
        name += (name.empty() ? "" : "+") + std::string(component[static_cast<std::size_t>(i)]);
    result.push_back(name);
  }
  return result;
}

}  // namespace

AlignmentResult aligned(const Surface& surface, const Design& design,
                        const AlignmentOptions& options) {
  AlignmentResult result;
  result.surface = surface;
  check_map(surface, design);
  if (options.alignment == Alignment::None) return result;
  const std::vector<CutPoint> points = cut_points(surface, design);
  if (points.empty()) return result;

  const int size = options.alignment == Alignment::Offset ? 3 : 6;
  const Gauge g = gauge(points);
  result.point = g.point;
  const NormalEquations equations = normal_equations(points, g, size);
  const Eigenvectors eigen = eigenvectors(equations.A);
  const double largest = eigen.values[size - 1];
  Eigen::VectorXd solution = Eigen::VectorXd::Zero(size);
  int dropped = 0;
  for (int k = 0; k < size; ++k) {
    const double value = eigen.values[k];
    const auto direction = eigen.vectors.col(k);
    if (!(value > options.truncation * largest))
      ++dropped;  // eigenvalues are in rising order
    else
      solution += direction * (direction.dot(equations.b) / value);
  }
  result.rank = size - dropped;
  result.undetermined = names(eigen.vectors.leftCols(dropped));
  Row scaled = Row::Zero();
  scaled.head(size) = solution;
  for (Eigen::Index v = 0; v < surface.residual.size(); ++v)
    if (surface.status[std::size_t(v)] == VertexStatus::Cut)
      result.surface.residual[v] -=
          row_of(design.vertices.row(v), design.normals.row(v), g).dot(scaled);
  for (Eigen::Index t = 0; t < surface.within.size(); ++t)
    result.surface.within[t] -=
        row_of(value_at_place_within(surface.sampled_within, design.vertices, design.triangles, t),
               value_at_place_within(surface.sampled_within, design.normals, design.triangles, t),
               g)
            .dot(scaled);
  result.displacement = scaled;
  result.displacement.tail<3>() /= g.length;
  return result;
}

namespace {

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

/// Returns the residual at the cut vertices after removal of displacement and size. An orthogonal
/// decomposition is used, because on a shallow cap size and height differ only by the square of the
/// slope, which normal equations would square again.
std::optional<Eigen::VectorXd> form_residual(const Design& design, const Surface& surface,
                                             const std::vector<Eigen::Index>& cut) {
  const auto n = static_cast<Eigen::Index>(cut.size());
  // seven unknowns
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

// The minimum zone of a plane.

/// A plane z = c0 + c1 x + c2 y, and half the width of the zone about it.
using Zone = Eigen::Vector4d;

/// Returns the smallest zone that contains a few points: tests every vertex of the linear program
/// +-(z - plane) <= t, i.e. every four active constraints of two per point.
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

/// Returns the width of the smallest zone. The points that protrude most are added to a small set
/// until no point protrudes from the zone of the set. The half width grows in every round, so the
/// iteration ends.
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
    // at most 8 points, so at most 1820 systems of four equations a round
    if (active.size() > 6) active.resize(6);
    add(active, *low);
    add(active, *high);
    handful = std::move(active);
  }
  return width;
}

/// Returns the machined points over a plane, with x and y scaled to order one.
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

// Roundness.

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
    // A displacement r along the normal is, at constant height, a displacement across the axis of r
    // divided by the radial component of the normal.
    ring.push_back(p + n / n.squaredNorm() * surface.residual[v]);
  }
  if (ring.size() < 6) return std::nullopt;
  Eigen::Matrix<double, Eigen::Dynamic, 2> points(static_cast<Eigen::Index>(ring.size()), 2);
  for (std::size_t i = 0; i < ring.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = ring[i];
  return fit_circle(points).roundness;
}

/// The name of the `_lsq` number, and the height of the ring for roundness if there is one.
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
                  // above 45 degrees a displacement along the normal is mostly axial
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

  // Start: the circle that is best in squared distances, which is linear in its unknowns.
  Eigen::MatrixXd A(n, 3);
  A << q / scale, Eigen::VectorXd::Ones(n);
  const Eigen::VectorXd right = q.rowwise().squaredNorm() / scale;
  const auto start = least_squares(A, right, 1e-10);
  if (!(scale > 0.0) || start.rank < 3)
    throw std::invalid_argument("fit_circle: the points lie on a line");
  const Eigen::Vector3d c = start.x;
  Eigen::Vector2d centre = 0.5 * c.head<2>();
  double radius = std::sqrt(std::max(0.0, centre.squaredNorm() + c[2] * scale));

  // Gauss-Newton for the geometric distances; the start is so close that few steps are needed
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
