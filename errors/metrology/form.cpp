#include "errors/metrology/form.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "errors/metrology/chebyshev.h"
#include "kinematics/least_squares.h"
#include "kinematics/singular_values.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixX2d;
using Eigen::MatrixX3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double flat = 1e-9;  // of the size: what is thinner is a line, or on one

template <typename Points>
void check(const Points& points, const char* what) {
  if (points.rows() < 3)
    throw std::invalid_argument(std::string(what) + ": expected at least 3 points");
  if (!points.allFinite())
    throw std::invalid_argument(std::string(what) + ": expected finite numbers");
}

/// Parts of 1 that the points count; of no weights the same for all.
VectorXd parts_of(const VectorXd& weights, Index points, const char* what) {
  if (weights.size() == 0) return VectorXd::Constant(points, 1.0 / double(points));
  if (weights.size() != points || !weights.allFinite() || !(weights.minCoeff() > 0.0))
    throw std::invalid_argument(std::string(what) + ": expected a weight above 0 for every point");
  return weights / weights.sum();
}

/// Distances of the points from a centre and the unit vectors towards them.
struct Rays {
  VectorXd length;
  MatrixX2d direction;
  double width() const { return length.maxCoeff() - length.minCoeff(); }
};

Rays rays(const MatrixX2d& points, const Vector2d& centre) {
  Rays result;
  const MatrixX2d from_centre = points.rowwise() - centre.transpose();
  result.length = from_centre.rowwise().norm();
  result.direction = MatrixX2d::Zero(points.rows(), 2);
  for (Index i = 0; i < points.rows(); ++i)
    if (result.length[i] > 0.0) result.direction.row(i) = from_centre.row(i) / result.length[i];
  return result;
}

/// The circle of least squares in x^2 + y^2, to start from.
Vector2d algebraic_centre(const MatrixX2d& points, const VectorXd& part) {
  MatrixX3d terms(points.rows(), 3);
  terms << 2.0 * points, VectorXd::Ones(points.rows());
  const VectorXd root = part.cwiseSqrt();
  const MatrixX3d weighted = root.asDiagonal() * terms;
  const VectorXd right = root.cwiseProduct(points.rowwise().squaredNorm());
  const auto fit = least_squares(weighted, right, flat);
  if (fit.rank < 3) throw std::invalid_argument("circle: expected points that are not on a line");
  return fit.x.head<2>();
}

/// Mean of the squared distances from the best circle about a centre.
double misfit(const MatrixX2d& points, const VectorXd& part, const Vector2d& centre) {
  const VectorXd d = rays(points, centre).length;
  return part.dot((d.array() - part.dot(d)).square().matrix());
}

/// Gauss-Newton step of the centre; the radius goes with it as the mean distance.
Vector2d step(const MatrixX2d& points, const VectorXd& part, const Vector2d& centre) {
  const Rays r = rays(points, centre);
  MatrixX3d terms(points.rows(), 3);
  terms << r.direction, VectorXd::Ones(points.rows());
  const VectorXd root = part.cwiseSqrt();
  const MatrixX3d weighted = root.asDiagonal() * terms;
  return least_squares(weighted, VectorXd(root.cwiseProduct(r.length))).x.head<2>();
}

/// Goes from `centre` along `move`, or a part of it, to where `width` is less; false if nowhere.
template <typename Place, typename Width>
bool descend(Place& place, const Vector2d& move, const Width& width) {
  const double before = width(place, Vector2d::Zero());
  for (double part = 1.0; part > 1e-6; part *= 0.5)
    if (width(place, part * move) < before) {
      place = place.moved(part * move);
      return true;
    }
  return false;
}

struct Centre {
  Vector2d at;
  Centre moved(const Vector2d& by) const { return {at + by}; }
};

/// Points about their mean, of size 1.
struct Scaled {
  MatrixX2d points;
  Vector2d mean;
  double size;
};

Scaled scaled(const MatrixX2d& points) {
  Scaled s;
  s.mean = points.colwise().mean();
  s.points = points.rowwise() - s.mean.transpose();
  s.size = s.points.cwiseAbs().maxCoeff();
  if (!(s.size > 0.0)) throw std::invalid_argument("circle: expected points that differ");
  s.points /= s.size;
  return s;
}

Vector2d least_squares_centre(const MatrixX2d& points, const VectorXd& part) {
  Centre centre{algebraic_centre(points, part)};
  const auto sum = [&](const Centre& c, const Vector2d& by) {
    return misfit(points, part, c.at + by);
  };
  for (int i = 0; i < 200; ++i) {
    const Vector2d move = step(points, part, centre.at);
    if (centre.at.norm() > 1e6) throw std::invalid_argument("circle: no circle is best");
    if (!descend(centre, move, sum)) break;
  }
  // the sum is flat to rounding here, the steps are not
  double last = 1e-6;
  for (Vector2d move = step(points, part, centre.at); move.norm() < last;
       move = step(points, part, centre.at)) {
    last = 0.5 * move.norm();
    centre.at += move;
  }
  return centre.at;
}

MatrixX2d rows(const MatrixX2d& all, const std::vector<Index>& which) {
  MatrixX2d result(Index(which.size()), 2);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = all.row(which[std::size_t(i)]);
  return result;
}

/// Uniform fit of the extremes that `lengths` would have if the place moved: x in units of `size`.
struct ZoneFit {
  ChebyshevFit fit;
  double width = 0.0;
  double spread = 1.0;  ///< mm that stand for 1 in the fit

  Vector2d move() const { return spread * fit.x.head<2>(); }
  double gap() const { return std::max(0.0, width - 2.0 * spread * fit.lower); }
};

ZoneFit zone_fit(const MatrixX2d& terms, const VectorXd& heights) {
  ZoneFit zone;
  zone.width = heights.maxCoeff() - heights.minCoeff();
  zone.spread = zone.width > 0.0 ? zone.width : 1.0;
  const double middle = 0.5 * (heights.maxCoeff() + heights.minCoeff());
  zone.fit = chebyshev_fit(terms, (heights.array() - middle).matrix() / zone.spread);
  return zone;
}

double sharpness_of(const MatrixX2d& terms, const VectorXd& heights, double width) {
  const double highest = heights.maxCoeff() - 1e-8 * width;
  const double lowest = heights.minCoeff() + 1e-8 * width;
  std::vector<Index> upper, lower;
  for (Index i = 0; i < heights.size(); ++i) {
    if (heights[i] >= highest) upper.push_back(i);
    if (heights[i] <= lowest) lower.push_back(i);
  }
  return sharpness(rows(terms, upper), rows(terms, lower));
}

double largest_gap(const MatrixX2d& directions) {
  std::vector<double> angle;
  for (Index i = 0; i < directions.rows(); ++i)
    angle.push_back(std::atan2(directions(i, 1), directions(i, 0)));
  std::sort(angle.begin(), angle.end());
  double most = 2.0 * pi - (angle.back() - angle.front());
  for (std::size_t i = 1; i < angle.size(); ++i) most = std::max(most, angle[i] - angle[i - 1]);
  return most;
}

/// A centre at distance t from this one has at least width + g t - t^2 / 2(m - t), by what holds
/// it, and at least 2 k t - width - t^2 / 2(m - t), by the points all around: m the inner radius, k
/// the cosine of half the largest gap. The two must cover 0 < t < m / 2.
bool is_proven(const Rays& r) {
  const double w = r.width(), m = r.length.minCoeff();
  if (!(m > 0.0)) return false;
  const double k = std::cos(0.5 * largest_gap(r.direction));
  const double g = sharpness_of(r.direction, r.length, w);
  if (!(k > 0.0) || !(g > 0.0)) return false;
  const double near = 2.0 * g * m / (1.0 + 2.0 * g);
  const double a = 4.0 * k + 1.0, b = 4.0 * (k * m + w), c = 4.0 * w * m;
  const double root = b * b - 4.0 * a * c;
  if (!(root > 0.0)) return false;
  return (b - std::sqrt(root)) / (2.0 * a) < near && (b + std::sqrt(root)) / (2.0 * a) > 0.5 * m;
}

/// An orthonormal frame whose third axis is a plane's normal.
struct Tilted {
  Matrix3d axes;  ///< columns
  /// The frame of the plane z = by.x x + by.y y in this one.
  Tilted moved(const Vector2d& by) const {
    const Vector3d n = (axes * Vector3d(-by.x(), -by.y(), 1.0)).normalized();
    const Vector3d x = (axes.col(0) - n * n.dot(axes.col(0))).normalized();
    Matrix3d next;
    next << x, n.cross(x), n;
    return {next};
  }
};

Vector3d upright(const Vector3d& normal) {
  Index largest = 0;
  normal.cwiseAbs().maxCoeff(&largest);
  return normal[largest] < 0.0 ? Vector3d(-normal) : normal;
}

/// Points about their mean, and the axes of their scatter, the thinnest last.
struct Cloud {
  Vector3d mean;
  MatrixX3d points;
  Tilted frame;
};

Cloud cloud(const MatrixX3d& points, const VectorXd& weights = {}) {
  const VectorXd part = parts_of(weights, points.rows(), "plane");
  Cloud c;
  c.mean = points.transpose() * part;
  c.points = points.rowwise() - c.mean.transpose();
  const double size = c.points.cwiseAbs().maxCoeff();
  if (!(size > 0.0)) throw std::invalid_argument("plane: expected points that differ");
  const VectorXd root = part.cwiseSqrt();
  const MatrixX3d unit = root.asDiagonal() * (c.points / size);
  const Principal spread = principal(unit);
  if (spread.size[1] < flat * spread.size[0])
    throw std::invalid_argument("plane: expected points that are not on a line");
  c.frame.axes = spread.axes;
  c.frame.axes.col(2) = c.frame.axes.col(0).cross(c.frame.axes.col(1));
  return c;
}

}  // namespace

LeastSquaresCircle least_squares_circle(const MatrixX2d& points, const VectorXd& weights) {
  check(points, "circle");
  const VectorXd part = parts_of(weights, points.rows(), "circle");
  const Scaled s = scaled(points);
  LeastSquaresCircle circle;
  circle.centre = s.mean + s.size * least_squares_centre(s.points, part);
  const VectorXd d = rays(points, circle.centre).length;
  circle.radius = part.dot(d);
  circle.circularity = d.maxCoeff() - d.minCoeff();
  return circle;
}

MinimumZoneCircles minimum_zone_circles(const MatrixX2d& points) {
  check(points, "circle");
  const Scaled s = scaled(points);
  Centre centre{least_squares_centre(s.points, parts_of({}, points.rows(), "circle"))};
  const auto width = [&](const Centre& c, const Vector2d& by) {
    return rays(s.points, c.at + by).width();
  };
  ZoneFit zone;
  for (int i = 0; i < 100; ++i) {
    const Rays r = rays(s.points, centre.at);
    zone = zone_fit(r.direction, r.length);
    if (!(zone.width > 0.0) || !descend(centre, zone.move(), width)) break;
  }
  const Rays r = rays(s.points, centre.at);
  MinimumZoneCircles circles;
  circles.centre = s.mean + s.size * centre.at;
  circles.inner = s.size * r.length.minCoeff();
  circles.outer = s.size * r.length.maxCoeff();
  circles.circularity = s.size * r.width();
  circles.gap = s.size * zone.gap();
  circles.proven = points.rows() > 3 && circles.gap <= 1e-8 * circles.circularity && is_proven(r);
  return circles;
}

LeastSquaresPlane least_squares_plane(const MatrixX3d& points, const VectorXd& weights) {
  check(points, "plane");
  const Cloud c = cloud(points, weights);
  LeastSquaresPlane plane;
  plane.normal = upright(c.frame.axes.col(2));
  plane.offset = plane.normal.dot(c.mean);
  const VectorXd height = c.points * plane.normal;
  plane.flatness = height.maxCoeff() - height.minCoeff();
  return plane;
}

MinimumZonePlanes minimum_zone_planes(const MatrixX3d& points) {
  check(points, "plane");
  Cloud c = cloud(points);
  const double size = c.points.cwiseAbs().maxCoeff();
  c.points /= size;
  const auto width = [&](const Tilted& frame, const Vector2d& by) {
    const VectorXd height = c.points * frame.moved(by).axes.col(2);
    return height.maxCoeff() - height.minCoeff();
  };
  ZoneFit zone;
  MatrixX3d local;
  for (int i = 0; i < 100; ++i) {
    local = c.points * c.frame.axes;
    zone = zone_fit(local.leftCols<2>(), local.col(2));
    if (!(zone.width > 0.0) || !descend(c.frame, zone.move(), width)) break;
  }
  local = c.points * c.frame.axes;
  const double w = local.col(2).maxCoeff() - local.col(2).minCoeff();
  MinimumZonePlanes planes;
  planes.normal = upright(c.frame.axes.col(2));
  const VectorXd height = (size * c.points) * planes.normal;
  const double offset = planes.normal.dot(c.mean);
  planes.lower = offset + height.minCoeff();
  planes.upper = offset + height.maxCoeff();
  planes.flatness = size * w;
  planes.gap = size * zone.gap();
  // planes tilted by the slope t are (w + g t) / sqrt(1 + t^2) apart, so g > w is enough
  planes.proven = !(w > 0.0) || (planes.gap <= 1e-8 * planes.flatness &&
                                 sharpness_of(local.leftCols<2>(), local.col(2), w) > 1.000001 * w);
  return planes;
}

}  // namespace abbe::errors::metrology
