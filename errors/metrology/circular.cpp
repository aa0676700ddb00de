#include "errors/metrology/circular.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <Eigen/SVD>

#include "errors/metrology/form.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::MatrixX2d;
using Eigen::Vector2d;
using Eigen::VectorXd;

void check(const CircularTrace& trace, double sense) {
  const Index n = trace.radius.size();
  if (trace.angle.size() != n)
    throw std::invalid_argument("circular: expected a radius for every angle");
  if (n == 0) return;
  if (n < 3) throw std::invalid_argument("circular: expected at least 3 readings in a sense");
  if (!trace.angle.allFinite() || !trace.radius.allFinite() || !(trace.radius.minCoeff() > 0.0))
    throw std::invalid_argument("circular: expected finite angles and positive radii");
  for (Index i = 1; i < n; ++i)
    if (!(sense * (trace.angle[i] - trace.angle[i - 1]) > 0.0))
      throw std::invalid_argument(
          "circular: expected angles that increase anticlockwise, decrease clockwise");
}

void check(const CircularRuns& runs) {
  if (!(runs.nominal_radius > 0.0) || !std::isfinite(runs.nominal_radius))
    throw std::invalid_argument("circular: expected a positive nominal radius");
  check(runs.anticlockwise, 1.0);
  check(runs.clockwise, -1.0);
  if (runs.anticlockwise.radius.size() + runs.clockwise.radius.size() == 0)
    throw std::invalid_argument("circular: expected a sense that was measured");
}

MatrixX2d points(const CircularTrace& trace) {
  MatrixX2d p(trace.radius.size(), 2);
  p.col(0) = trace.radius.array() * trace.angle.array().cos();
  p.col(1) = trace.radius.array() * trace.angle.array().sin();
  return p;
}

CircularFigures figures(const MatrixX2d& path, const Vector2d& centre, double nominal_radius) {
  const VectorXd radius = (path.rowwise() - centre.transpose()).rowwise().norm();
  return {least_squares_circle(path).circularity, minimum_zone_circles(path).circularity,
          radius.maxCoeff() - nominal_radius, radius.minCoeff() - nominal_radius};
}

enum Cause { Radius, CentreU, CentreV, Scale, SquarenessVU, ReversalU, ReversalV, Lag, Causes };
constexpr std::array<const char*, Causes> cause_names{
    "radius", "centre_u", "centre_v", "scale", "squareness", "reversal_u", "reversal_v", "lag"};

double sign(double x) {
  constexpr double turning = 1e-12;  // rad: there an axis stands still and has no direction
  return x > turning ? 1.0 : (x < -turning ? -1.0 : 0.0);
}

/// Radial deviation per unit of every cause at one angle of a sense of motion (+1 anticlockwise).
Eigen::Matrix<double, 1, Causes> effect(double angle, double sense, double R) {
  const double c = std::cos(angle), s = std::sin(angle);
  Eigen::Matrix<double, 1, Causes> row;
  row[Radius] = 1.0;
  row[CentreU] = c;
  row[CentreV] = s;
  row[Scale] = 0.5 * R * (c * c - s * s);
  row[SquarenessVU] = -R * s * c;
  row[ReversalU] = 0.5 * sign(-sense * s) * c;
  row[ReversalV] = 0.5 * sign(sense * c) * s;
  row[Lag] = sense * R * s * c;
  return row;
}

struct Readings {
  Eigen::MatrixXd effect;  ///< (n x Causes)
  VectorXd deviation;      ///< (n) mm
};

Readings readings(const CircularRuns& runs) {
  const Index n = runs.anticlockwise.radius.size(), k = runs.clockwise.radius.size();
  Readings all{Eigen::MatrixXd(n + k, Index(Causes)), VectorXd(n + k)};
  all.deviation << runs.anticlockwise.radius, runs.clockwise.radius;
  all.deviation.array() -= runs.nominal_radius;
  for (Index i = 0; i < n; ++i)
    all.effect.row(i) = effect(runs.anticlockwise.angle[i], 1.0, runs.nominal_radius);
  for (Index i = 0; i < k; ++i)
    all.effect.row(n + i) = effect(runs.clockwise.angle[i], -1.0, runs.nominal_radius);
  return all;
}

/// Least squares by singular values; a cause that takes part in a direction without effect is open.
struct Solution {
  VectorXd value, u;
  std::array<bool, Causes> open{};
  double residual = 0.0;
};

Solution solution(const Readings& all, Index causes) {
  constexpr double without_effect = 1e-8;  // of the largest, columns scaled to length 1
  const Index n = all.deviation.size();
  const VectorXd norm = all.effect.leftCols(causes).colwise().norm().transpose().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = all.effect.leftCols(causes) * norm.cwiseInverse().asDiagonal();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(scaled, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const VectorXd& singular = svd.singularValues();
  VectorXd inverse = VectorXd::Zero(causes);
  Solution result;
  Index rank = 0;
  for (Index i = 0; i < causes; ++i) {
    if (singular[i] > without_effect * singular[0]) {
      inverse[i] = 1.0 / singular[i];
      ++rank;
      continue;
    }
    for (Index c = 0; c < causes; ++c)
      if (std::abs(svd.matrixV()(c, i)) > 1e-6) result.open[std::size_t(c)] = true;
  }
  const VectorXd y = svd.matrixU().transpose() * all.deviation;
  const VectorXd x = svd.matrixV() * inverse.asDiagonal() * y;
  const double sum = (all.deviation - scaled * x).squaredNorm();
  result.residual = n > rank ? std::sqrt(sum / double(n - rank)) : 0.0;
  result.value = x.cwiseQuotient(norm);
  result.u =
      result.residual * (svd.matrixV() * inverse.asDiagonal()).rowwise().norm().cwiseQuotient(norm);
  return result;
}

}  // namespace

Circular circular(const CircularRuns& runs, const CircularOptions& options) {
  check(runs);
  const MatrixX2d forth = points(runs.anticlockwise), back = points(runs.clockwise);
  MatrixX2d all(forth.rows() + back.rows(), 2);
  all << forth, back;
  const LeastSquaresCircle circle = least_squares_circle(all);
  Circular result;
  if (options.centre == CircleCentre::LeastSquares) result.centre = circle.centre;
  result.D = circle.radius - runs.nominal_radius;
  const double R = runs.nominal_radius;
  if (forth.rows() > 0) result.anticlockwise = figures(forth, result.centre, R);
  if (back.rows() > 0) result.clockwise = figures(back, result.centre, R);
  if (forth.rows() > 0 && back.rows() > 0) result.both = figures(all, result.centre, R);
  return result;
}

CircularCauses circular_causes(const CircularRuns& runs, const CauseOptions& options) {
  check(runs);
  const Readings all = readings(runs);
  const Index causes = options.no_lag ? Lag : Causes;
  if (all.deviation.size() <= causes)
    throw std::invalid_argument("circular: expected more readings than causes");
  const Solution found = solution(all, causes);
  CircularCauses result;
  result.residual = found.residual;
  const std::array<std::optional<Estimated>*, Causes> fields{
      &result.radius,     &result.centre_u,   &result.centre_v,   &result.scale,
      &result.squareness, &result.reversal_u, &result.reversal_v, &result.lag};
  for (Index c = 0; c < causes; ++c) {
    if (found.open[std::size_t(c)])
      result.undetermined.push_back(cause_names[std::size_t(c)]);
    else
      *fields[std::size_t(c)] = Estimated{found.value[c], found.u[c]};
  }
  return result;
}

}  // namespace abbe::errors::metrology
