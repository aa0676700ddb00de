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

// Best-fit alignment of a residual map to its design, and form deviations (flatness, roundness,
// ...) after ISO 1101.

namespace abbe::cutting {

namespace {

using Eigen::Vector3d;
using DisplacementRow = kinematics::Deviation;

/// A cut vertex, or the sample within a triangle.
struct CutPoint {
  Vector3d point, normal;
  double residual;
  double weight;  ///< mm^2
};

bool have_equal_sizes(const Surface& surface, const Design& design) {
  const Eigen::Index count = design.vertices.rows();
  return Eigen::Index(surface.status.size()) == count && surface.residual.size() == count &&
         design.area.size() == count && design.normals.rows() == count;
}

/// Throws std::invalid_argument if sizes differ or a cut vertex has no finite residual.
void check_map(const Surface& surface, const Design& design) {
  if (!have_equal_sizes(surface, design))
    throw std::invalid_argument("aligned: the map and the design have different sizes");
  for (std::size_t i = 0; i < surface.status.size(); ++i)
    if (surface.status[i] == VertexStatus::Cut &&
        !std::isfinite(surface.residual[static_cast<Eigen::Index>(i)]))
      throw std::invalid_argument("aligned: a cut vertex has no residual");
}

/// Returns the cut vertices, then the samples within triangles.
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
          {value_at_sample(surface.interior_sample, design.vertices, design.triangles, t),
           value_at_sample(surface.interior_sample, design.normals, design.triangles, t),
           surface.within[t], weights.within[t]});
  return points;
}

/// The point at which the displacement is stated, and the length by which angles are multiplied.
struct DisplacementScale {
  Vector3d point = Vector3d::Zero();
  double length = 1.0;
};

/// Returns the centroid of the points and their root-mean-square distance from it.
DisplacementScale displacement_scale(const std::vector<CutPoint>& points) {
  CompensatedSum area;
  std::array<CompensatedSum, 3> moment;
  for (const CutPoint& cut_point : points) {
    area.add(cut_point.weight);
    for (int k = 0; k < 3; ++k)
      moment[static_cast<std::size_t>(k)].add(cut_point.weight * cut_point.point[k]);
  }
  if (!(area.value() > 0.0)) return {};
  DisplacementScale scale;
  for (int k = 0; k < 3; ++k)
    scale.point[k] = moment[static_cast<std::size_t>(k)].value() / area.value();
  CompensatedSum squared_distance;
  for (const CutPoint& cut_point : points)
    squared_distance.add(cut_point.weight * (cut_point.point - scale.point).squaredNorm());
  const double length = std::sqrt(squared_distance.value() / area.value());
  if (length > 0.0) scale.length = length;
  return scale;
}

/// Returns the row of the design matrix of a point: the displacement along its normal per unit of
/// each component. Rotations are expressed in mm, as angle times `scale.length`.
DisplacementRow displacement_row(const Vector3d& point, const Vector3d& normal,
                                 const DisplacementScale& scale) {
  DisplacementRow row;
  row << normal, (point - scale.point).cross(normal) / scale.length;
  return row;
}

/// Normal equations A x = b of the best displacement.
struct NormalEquations {
  Eigen::MatrixXd A;
  Eigen::VectorXd b;
};

/// Returns the normal equations for the first `size` components of the displacement.
NormalEquations normal_equations(const std::vector<CutPoint>& points,
                                 const DisplacementScale& scale, int size) {
  std::array<CompensatedSum, 6> rhs;
  std::array<std::array<CompensatedSum, 6>, 6> lhs;
  for (const CutPoint& p : points) {
    const DisplacementRow row = displacement_row(p.point, p.normal, scale);
    for (int i = 0; i < size; ++i) {
      const auto a = static_cast<std::size_t>(i);
      rhs[a].add(p.weight * row[i] * p.residual);
      for (int j = 0; j <= i; ++j)
        lhs[a][static_cast<std::size_t>(j)].add(p.weight * row[i] * row[j]);
    }
  }
  NormalEquations equations{Eigen::MatrixXd(size, size), Eigen::VectorXd(size)};
  for (int i = 0; i < size; ++i) {
    equations.b[i] = rhs[static_cast<std::size_t>(i)].value();
    for (int j = 0; j <= i; ++j)
      equations.A(i, j) = equations.A(j, i) =
          lhs[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)].value();
  }
  return equations;
}

/// Returns the names of the undetermined components. The basis of the null space is brought to
/// echelon form, so that each vector has as few components as possible. The name of a vector lists
/// its components above a hundredth of its pivot.
std::vector<std::string> component_names(Eigen::MatrixXd basis) {
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
  const DisplacementScale scale = displacement_scale(points);
  result.point = scale.point;
  const NormalEquations equations = normal_equations(points, scale, size);
  const Eigenvectors eigen = eigenvectors(equations.A);
  const double max_eigenvalue = eigen.values[size - 1];
  Eigen::VectorXd solution = Eigen::VectorXd::Zero(size);
  int omitted_count = 0;
  for (int k = 0; k < size; ++k) {
    const double value = eigen.values[k];
    const auto direction = eigen.vectors.col(k);
    if (!(value > options.truncation * max_eigenvalue))
      ++omitted_count;  // eigenvalues are in ascending order
    else
      solution += direction * (direction.dot(equations.b) / value);
  }
  result.rank = size - omitted_count;
  result.undetermined = component_names(eigen.vectors.leftCols(omitted_count));
  DisplacementRow scaled_displacement = DisplacementRow::Zero();
  scaled_displacement.head(size) = solution;
  for (Eigen::Index v = 0; v < surface.residual.size(); ++v)
    if (surface.status[std::size_t(v)] == VertexStatus::Cut)
      result.surface.residual[v] -=
          displacement_row(design.vertices.row(v), design.normals.row(v), scale)
              .dot(scaled_displacement);
  for (Eigen::Index t = 0; t < surface.within.size(); ++t)
    result.surface.within[t] -=
        displacement_row(
            value_at_sample(surface.interior_sample, design.vertices, design.triangles, t),
            value_at_sample(surface.interior_sample, design.normals, design.triangles, t), scale)
            .dot(scaled_displacement);
  result.displacement = scaled_displacement;
  result.displacement.tail<3>() /= scale.length;
  return result;
}

namespace {

/// Returns the indices of the cut vertices.
/// @throws std::invalid_argument if the sizes of map and design differ
std::vector<Eigen::Index> cut_vertices(const Design& design, const Surface& surface) {
  if (!have_equal_sizes(surface, design))
    throw std::invalid_argument("form: the map and the design have different sizes");
  std::vector<Eigen::Index> cut_indices;
  for (std::size_t i = 0; i < surface.status.size(); ++i)
    if (surface.status[i] == VertexStatus::Cut) cut_indices.push_back(static_cast<Eigen::Index>(i));
  return cut_indices;
}

/// Returns the residuals at the cut vertices after a best fit of position, orientation and size;
/// empty if there are too few vertices. On a shallow cap, size and height are almost
/// indistinguishable (they differ by the square of the slope). Normal equations would square the
/// condition number, so an orthogonal decomposition is used.
std::optional<Eigen::VectorXd> form_residual(const Design& design, const Surface& surface,
                                             const std::vector<Eigen::Index>& cut_indices) {
  const auto count = static_cast<Eigen::Index>(cut_indices.size());
  // Seven unknowns need at least eight equations.
  if (count < 8) return std::nullopt;
  Vector3d centroid = Vector3d::Zero();
  for (const Eigen::Index v : cut_indices)
    centroid += design.vertices.row(v).transpose() / double(count);
  double max_radius = 0.0;
  for (const Eigen::Index v : cut_indices)
    max_radius = std::max(max_radius, (design.vertices.row(v).transpose() - centroid).norm());
  if (!(max_radius > 0.0)) return std::nullopt;

  Eigen::MatrixXd A(count, 7);
  Eigen::VectorXd r(count), weight(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index v = cut_indices[static_cast<std::size_t>(i)];
    const Vector3d normal = design.normals.row(v);
    const Vector3d arm = (design.vertices.row(v).transpose() - centroid) / max_radius;
    A.row(i) << normal.transpose(), arm.cross(normal).transpose(), 1.0;
    r[i] = surface.residual[v];
    weight[i] = std::sqrt(design.area[v]);
  }
  // Pivots below 1e-7 of the largest count as zero: the map does not determine these components.
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

/// Returns the smallest zone that contains a few points; empty if they do not determine it. Tests
/// every vertex of the linear program +-(z - plane) <= t, i.e. every combination of four of the
/// constraints, two per point.
std::optional<Zone> smallest_zone(const std::vector<Vector3d>& points) {
  const int constraint_count = 2 * static_cast<int>(points.size());
  Eigen::MatrixXd C(constraint_count, 4);
  Eigen::VectorXd d(constraint_count);
  for (int i = 0; i < constraint_count; ++i) {
    const Vector3d& p = points[static_cast<std::size_t>(i / 2)];
    const double sign = i % 2 == 0 ? 1.0 : -1.0;
    C.row(i) << sign, sign * p.x(), sign * p.y(), 1.0;
    d[i] = sign * p.z();
  }
  std::optional<Zone> best;
  const double tolerance = 1e-12 * (1.0 + d.cwiseAbs().maxCoeff());
  for (int i = 0; i < constraint_count; ++i)
    for (int j = i + 1; j < constraint_count; ++j)
      for (int k = j + 1; k < constraint_count; ++k)
        for (int l = k + 1; l < constraint_count; ++l) {
          Eigen::Matrix4d M;
          M << C.row(i), C.row(j), C.row(k), C.row(l);
          const Eigen::FullPivLU<Eigen::Matrix4d> lu(M);
          if (lu.rank() < 4) continue;
          const Zone zone = lu.solve(Eigen::Vector4d(d[i], d[j], d[k], d[l]));
          if (((C * zone - d).array() < -tolerance).any()) continue;
          if (!best || zone[3] < (*best)[3]) best = zone;
        }
  return best;
}

/// Returns the height of a point above the middle plane of a zone.
double height(const Vector3d& p, const Zone& zone) {
  return p.z() - zone[0] - zone[1] * p.x() - zone[2] * p.y();
}

/// Returns the width of the smallest zone that contains all points. The points that protrude most
/// are added to a small set of support points until no point protrudes from the zone of the set.
/// The half width grows in every iteration, so the iteration ends.
std::optional<double> minimum_zone(const std::vector<Vector3d>& points) {
  std::vector<Vector3d> support_points;
  const auto add_distinct = [](std::vector<Vector3d>& points_to_extend, const Vector3d& p) {
    if (std::find(points_to_extend.begin(), points_to_extend.end(), p) == points_to_extend.end())
      points_to_extend.push_back(p);
  };
  for (const auto& direction :
       {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(1, 1, 0), Vector3d(1, -1, 0)}) {
    const auto [low, high] = std::minmax_element(
        points.begin(), points.end(),
        [&](const Vector3d& a, const Vector3d& b) { return a.dot(direction) < b.dot(direction); });
    add_distinct(support_points, *low);
    add_distinct(support_points, *high);
  }
  std::optional<double> width;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const auto zone = smallest_zone(support_points);
    if (!zone) break;
    const auto [low, high] = std::minmax_element(
        points.begin(), points.end(),
        [&](const Vector3d& a, const Vector3d& b) { return height(a, *zone) < height(b, *zone); });
    const double extent = height(*high, *zone) - height(*low, *zone);
    const double tilt = std::sqrt(1.0 + (*zone)[1] * (*zone)[1] + (*zone)[2] * (*zone)[2]);
    width = width ? std::min(*width, extent / tilt) : extent / tilt;
    if (extent <= 2.0 * (*zone)[3] + 1e-12) break;
    std::vector<Vector3d> active_points;
    for (const Vector3d& p : support_points)
      if (std::abs(height(p, *zone)) > (*zone)[3] - 1e-9 * (1.0 + (*zone)[3]))
        active_points.push_back(p);
    // At most 8 points, hence at most 1820 systems of four equations per iteration.
    if (active_points.size() > 6) active_points.resize(6);
    add_distinct(active_points, *low);
    add_distinct(active_points, *high);
    support_points = std::move(active_points);
  }
  return width;
}

/// Returns the deviations of the cut vertices over a plane, with x and y scaled to at most one.
std::vector<Vector3d> points_over_plane(const Design& design,
                                        const std::vector<Eigen::Index>& cut_indices,
                                        const Eigen::VectorXd& residual) {
  double max_coordinate = 1e-300;
  for (const Eigen::Index v : cut_indices)
    max_coordinate =
        std::max(max_coordinate, design.vertices.row(v).head<2>().cwiseAbs().maxCoeff());
  std::vector<Vector3d> points;
  for (std::size_t i = 0; i < cut_indices.size(); ++i)
    points.emplace_back(design.vertices(cut_indices[i], 0) / max_coordinate,
                        design.vertices(cut_indices[i], 1) / max_coordinate,
                        residual[static_cast<Eigen::Index>(i)]);
  return points;
}

// Roundness.

/// Returns the roundness of the ring of vertices nearest to a height; empty if it has fewer than 6.
std::optional<double> roundness(const Design& design, const Surface& surface,
                                const std::vector<Eigen::Index>& cut_indices, double z_middle) {
  double min_distance = std::numeric_limits<double>::infinity(), z_ring = 0.0;
  for (const Eigen::Index v : cut_indices) {
    const double z = design.vertices(v, 2);
    if (std::abs(z - z_middle) >= min_distance) continue;
    min_distance = std::abs(z - z_middle);
    z_ring = z;
  }
  std::vector<Eigen::Vector2d> ring;
  for (const Eigen::Index v : cut_indices) {
    if (std::abs(design.vertices(v, 2) - z_ring) > 1e-9) continue;
    const Eigen::Vector2d p = design.vertices.row(v).head<2>();
    const Eigen::Vector2d n = design.normals.row(v).head<2>();
    // At constant height, a residual r along the normal moves the surface radially by r / (radial
    // component of the normal).
    ring.push_back(p + n / n.squaredNorm() * surface.residual[v]);
  }
  if (ring.size() < 6) return std::nullopt;
  Eigen::Matrix<double, Eigen::Dynamic, 2> points(static_cast<Eigen::Index>(ring.size()), 2);
  for (std::size_t i = 0; i < ring.size(); ++i) points.row(static_cast<Eigen::Index>(i)) = ring[i];
  return fit_circle(points).roundness;
}

/// The form figures that a primitive has.
struct FormDescription {
  std::string name;                   ///< of the least-squares figure
  bool is_flat = false;               ///< it has a minimum zone
  std::optional<double> ring_height;  ///< z at which roundness is evaluated
};

FormDescription form_description(const Primitive& primitive) {
  return std::visit(
      [](const auto& p) -> FormDescription {
        using Kind = std::decay_t<decltype(p)>;
        if constexpr (std::is_same_v<Kind, RectanglePlane> || std::is_same_v<Kind, Disc>)
          return {"flatness_lsq", true, {}};
        else if constexpr (std::is_same_v<Kind, Cylinder>)
          return {"cylindricity_lsq", false, 0.5 * p.height};
        else if constexpr (std::is_same_v<Kind, Cone>)
          return {"conicity_lsq", false,
                  // Above 45 degrees a displacement along the normal is mostly axial.
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
  const std::vector<Eigen::Index> cut_indices = cut_vertices(design_m, surface);
  const auto residual = form_residual(design_m, surface, cut_indices);
  if (!residual) return {};
  const FormDescription description = form_description(primitive);
  std::vector<FormNumber> numbers{{description.name, peak_to_valley(*residual)}};
  if (description.is_flat)
    if (const auto zone = minimum_zone(points_over_plane(design_m, cut_indices, *residual)))
      numbers.push_back({"flatness_minimum_zone", *zone});
  if (description.ring_height)
    if (const auto value = roundness(design_m, surface, cut_indices, *description.ring_height))
      numbers.push_back({"roundness_lsc", *value});
  return numbers;
}

Circle fit_circle(const Eigen::Matrix<double, Eigen::Dynamic, 2>& points) {
  const Eigen::Index count = points.rows();
  if (count < 3) throw std::invalid_argument("fit_circle: expected at least 3 points");
  if (!points.allFinite()) throw std::invalid_argument("fit_circle: a point is not finite");
  const Eigen::RowVector2d centroid = points.colwise().mean();
  const Eigen::Matrix<double, Eigen::Dynamic, 2> centred = points.rowwise() - centroid;
  const double scale = centred.rowwise().norm().maxCoeff();

  // The start is the circle of least algebraic (squared) distances, which is a linear problem.
  Eigen::MatrixXd A(count, 3);
  A << centred / scale, Eigen::VectorXd::Ones(count);
  const Eigen::VectorXd right_side = centred.rowwise().squaredNorm() / scale;
  const auto start = least_squares(A, right_side, 1e-10);
  if (!(scale > 0.0) || start.rank < 3)
    throw std::invalid_argument("fit_circle: the points lie on a line");
  const Eigen::Vector3d c = start.x;
  Eigen::Vector2d centre = 0.5 * c.head<2>();
  double radius = std::sqrt(std::max(0.0, centre.squaredNorm() + c[2] * scale));

  // Gauss-Newton for the geometric distances; few steps suffice, because the start is close.
  for (int i = 0; i < 50; ++i) {
    const Eigen::Matrix<double, Eigen::Dynamic, 2> offsets = centred.rowwise() - centre.transpose();
    const Eigen::VectorXd distance = offsets.rowwise().norm();
    if (!(distance.minCoeff() > 0.0)) break;
    Eigen::MatrixX3d J(count, 3);
    J << offsets.array().colwise() / distance.array(), Eigen::VectorXd::Ones(count);
    const Eigen::VectorXd deviation = distance.array() - radius;
    const Eigen::Vector3d step = least_squares(J, deviation).x;
    centre += step.head<2>();
    radius += step[2];
    if (step.norm() < 1e-15 * scale) break;
  }
  const Eigen::VectorXd distance = (centred.rowwise() - centre.transpose()).rowwise().norm();
  return {centre + centroid.transpose(), radius, peak_to_valley(distance)};
}

}  // namespace abbe::cutting
