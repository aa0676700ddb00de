#include "cutting/alignment.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>

#include "cutting/residual.h"
#include "cutting/sum.h"
#include "kinematics/symmetric.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;
using Row = kinematics::Deviation;

/// A vertex or the place within a triangle.
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
          {at_place_within(surface.looked_within, design.vertices, design.triangles, t),
           at_place_within(surface.looked_within, design.normals, design.triangles, t),
           surface.within[t], weights.within[t]});
  return points;
}

/// Where the displacement is stated and the length at which angles weigh as much as shifts.
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

/// What each component of a displacement does along a normal, angles at g.length.
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

/// Names the null space: its basis is brought to echelon form, so that each vector has as few
/// components as it can, and named by those that take part.
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

Aligned aligned(const Surface& surface, const Design& design, const AlignmentOptions& options) {
  Aligned result;
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
      ++dropped;  // eigenvalues come in growing order
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
        row_of(at_place_within(surface.looked_within, design.vertices, design.triangles, t),
               at_place_within(surface.looked_within, design.normals, design.triangles, t), g)
            .dot(scaled);
  result.displacement = scaled;
  result.displacement.tail<3>() /= g.length;
  return result;
}

}  // namespace abbe::cutting
