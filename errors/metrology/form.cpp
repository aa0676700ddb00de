#include "errors/metrology/form.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "kinematics/decompositions.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

/// Uniform (minimax) fit of linear terms: the coefficients x that minimise the largest |y - terms *
/// x|.
struct ChebyshevFit {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  double half_width = 0.0;                 ///< largest |residual| at `x`
  double lower = 0.0;                      ///< lower bound of the optimal half width
  std::vector<Eigen::Index> upper_points;  ///< rows with residual +half_width
  std::vector<Eigen::Index> lower_points;  ///< rows with residual -half_width
};

using Eigen::Index;
using Eigen::Matrix4d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using Reference = std::array<Index, 4>;

// The lower bound grows with every exchange, so the iteration ends without this limit, which only
// stops cycles caused by rounding.
constexpr int max_exchanges = 1000;
// Relative to the terms, which are about 1. It separates points on a line, whose references would
// be degenerate.
constexpr double perturbation = 1e-11;

/// Returns a pseudo-random number in -1 .. 1 that depends on k alone, so that results are
/// reproducible.
double scatter(std::uint64_t k) {
  k = (k + 0x9e3779b97f4a7c15u) * 0xbf58476d1ce4e5b9u;
  k = (k ^ (k >> 29)) * 0x94d049bb133111ebu;
  return double(k >> 11) * 0x1p-52 - 1.0;
}

/// Returns twice the area of a triangle, positive if it turns left.
double orientation(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// Returns weights of four points for which every affine function of the terms sums to zero and the
/// absolute weights to one; zeros if the points do not determine them.
Vector4d balance(const Eigen::MatrixX2d& terms, const Reference& r) {
  const Vector2d p0 = terms.row(r[0]), p1 = terms.row(r[1]), p2 = terms.row(r[2]),
                 p3 = terms.row(r[3]);
  Vector4d weight(orientation(p1, p2, p3), -orientation(p0, p2, p3), orientation(p0, p1, p3),
                  -orientation(p0, p1, p2));
  const double sum = weight.lpNorm<1>();
  if (!(sum > 0.0)) return Vector4d::Zero();
  return weight / sum;
}

/// Returns the weighted sum of y over a reference; its magnitude is a lower bound of the half
/// width.
double value(const VectorXd& y, const Reference& r, const Vector4d& weight) {
  return weight[0] * y[r[0]] + weight[1] * y[r[1]] + weight[2] * y[r[2]] + weight[3] * y[r[3]];
}

/// Returns the reference in which the entering point replaces the one for which the lower bound
/// grows most.
Reference exchange_point(const Eigen::MatrixX2d& terms, const VectorXd& y, const Reference& r,
                         Index entering) {
  Reference best = r;
  double max_bound = -1.0;
  for (int leaving = 0; leaving < 4; ++leaving) {
    Reference trial = r;
    trial[leaving] = entering;
    const double bound = std::abs(value(y, trial, balance(terms, trial)));
    if (bound > max_bound) {
      max_bound = bound;
      best = trial;
    }
  }
  return best;
}

/// Returns the coefficients whose residuals at the reference have the magnitude of the bound and
/// the signs of its weights.
Vector3d reference_solution(const Eigen::MatrixX2d& terms, const VectorXd& y, const Reference& r) {
  const Vector4d weight = balance(terms, r);
  const double side = value(y, r, weight) < 0.0 ? -1.0 : 1.0;
  Matrix4d system;
  Vector4d right;
  for (int i = 0; i < 4; ++i) {
    system.row(i) << terms(r[i], 0), terms(r[i], 1), 1.0, weight[i] < 0.0 ? -side : side;
    right[i] = y[r[i]];
  }
  return system.fullPivLu().solve(right).head<3>();
}

VectorXd residual(const Eigen::MatrixX2d& terms, const VectorXd& y, const Vector3d& x) {
  return (y - terms * x.head<2>()).array() - x[2];
}

/// Returns four points far apart, so that the first bound is not degenerate.
Reference first_reference(const Eigen::MatrixX2d& terms, const VectorXd& y) {
  Reference r{0, 0, 0, 0};
  const Vector2d middle = terms.colwise().mean();
  (terms.rowwise() - middle.transpose()).rowwise().squaredNorm().maxCoeff(&r[0]);
  (terms.rowwise() - terms.row(r[0])).rowwise().squaredNorm().maxCoeff(&r[1]);
  const Vector2d along = terms.row(r[1]) - terms.row(r[0]);
  const Vector2d across(-along.y(), along.x());
  ((terms.rowwise() - terms.row(r[0])) * across).cwiseAbs().maxCoeff(&r[2]);
  double max_bound = -1.0;
  for (Index i = 0; i < y.size(); ++i) {
    const Reference trial{r[0], r[1], r[2], i};
    const double bound = std::abs(value(y, trial, balance(terms, trial)));
    if (i != r[0] && i != r[1] && i != r[2] && bound > max_bound) {
      max_bound = bound;
      r[3] = i;
    }
  }
  return r;
}

/// Returns the coefficients with the constant shifted to the middle of the residuals.
Vector3d centred(const Eigen::MatrixX2d& terms, const VectorXd& y, Vector3d x) {
  const VectorXd residuals = residual(terms, y, x);
  x[2] += 0.5 * (residuals.maxCoeff() + residuals.minCoeff());
  return x;
}

/// Returns the corners of the convex hull in order, without duplicates (Andrew's monotone chain).
std::vector<Vector2d> hull(const Eigen::MatrixX2d& points) {
  std::vector<Vector2d> sorted;
  for (Index i = 0; i < points.rows(); ++i) sorted.push_back(points.row(i));
  const auto precedes = [](const Vector2d& a, const Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  };
  std::sort(sorted.begin(), sorted.end(), precedes);
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  if (sorted.size() < 3) return sorted;
  std::vector<Vector2d> corners;
  const auto add_chain = [&](auto begin, auto end) {
    const std::size_t start = corners.size();
    for (auto p = begin; p != end; ++p) {
      while (corners.size() >= start + 2 &&
             orientation(corners[corners.size() - 2], corners.back(), *p) <= 0.0)
        corners.pop_back();
      corners.push_back(*p);
    }
    corners.pop_back();
  };
  add_chain(sorted.begin(), sorted.end());
  add_chain(sorted.rbegin(), sorted.rend());
  return corners;
}

void add_contact_points(const VectorXd& residuals, ChebyshevFit& fit) {
  // 1e-9: relative accuracy of the fit; 1e-15: rounding of terms of size 1.
  const double contact_threshold = fit.half_width * (1.0 - 1e-9) - 1e-15;
  for (Index i = 0; i < residuals.size(); ++i) {
    if (residuals[i] >= contact_threshold) fit.upper_points.push_back(i);
    if (residuals[i] <= -contact_threshold) fit.lower_points.push_back(i);
  }
}

/// Returns the uniform fit, by exchanging one point at a time of a reference of four (Remez). The
/// third term is a constant, so `terms` has two columns. `terms` and `y` should be centred and
/// scaled to about 1.
/// Source: Stiefel 1959; Watson 1980, ch. 2.
ChebyshevFit chebyshev_fit(const Eigen::MatrixX2d& terms, const VectorXd& y) {
  ChebyshevFit fit;
  const Index n = y.size();
  if (n < 4) {  // three points are always fitted exactly
    Eigen::MatrixX3d all_terms(n, 3);
    all_terms << terms, VectorXd::Ones(n);
    fit.x = centred(terms, y, all_terms.fullPivLu().solve(y));
  } else {
    Eigen::MatrixX2d perturbed = terms;
    for (Index i = 0; i < n; ++i)
      perturbed.row(i) += perturbation * Eigen::RowVector2d(scatter(2 * i), scatter(2 * i + 1));
    Reference r = first_reference(perturbed, y);
    double smallest_residual = std::numeric_limits<double>::infinity();
    for (int i = 0; i < max_exchanges; ++i) {
      const Vector3d x = reference_solution(perturbed, y, r);
      fit.lower = std::max(fit.lower, std::abs(value(y, r, balance(terms, r))));
      const VectorXd residuals = residual(perturbed, y, x);
      Index farthest = 0;
      const double max_residual = residuals.cwiseAbs().maxCoeff(&farthest);
      if (max_residual < smallest_residual) {
        smallest_residual = max_residual;
        fit.x = x;
      }
      const bool is_in_reference = std::find(r.begin(), r.end(), farthest) != r.end();
      // The fit is optimal if the largest residual equals the bound to rounding, or if its point is
      // already in the reference.
      if (is_in_reference ||
          max_residual <= std::abs(value(y, r, balance(perturbed, r))) * (1.0 + 1e-14))
        break;
      r = exchange_point(perturbed, y, r, farthest);
    }
    fit.x = centred(terms, y, fit.x);
  }
  const VectorXd residuals = residual(terms, y, fit.x);
  fit.half_width = residuals.cwiseAbs().maxCoeff();
  add_contact_points(residuals, fit);
  return fit;
}

/// Returns the rate at which a difference of extremes grows away from its minimum: the smallest
/// value, over all unit directions d, of the maximum of -d.u over upper points minus the minimum of
/// -d.u over lower points. It is 0 or less if the contact points do not enclose the minimum.
/// @param upper, lower  (n x 2), (k x 2), n and k >= 1
double sharpness(const Eigen::MatrixX2d& upper, const Eigen::MatrixX2d& lower) {
  // The support function of the polygon of all differences has its minimum over directions at a
  // normal of one of its edges, which are edges of the two hulls.
  const std::vector<Vector2d> upper_hull = hull(upper), lower_hull = hull(lower);
  const auto support = [&](const Vector2d& d) {
    double highest = -std::numeric_limits<double>::infinity();
    double lowest = -highest;
    for (const Vector2d& u : upper_hull) highest = std::max(highest, -u.dot(d));
    for (const Vector2d& u : lower_hull) lowest = std::min(lowest, -u.dot(d));
    return highest - lowest;
  };
  double lowest = std::numeric_limits<double>::infinity();
  for (const std::vector<Vector2d>* polygon : {&upper_hull, &lower_hull})
    for (std::size_t i = 0; i < polygon->size() && polygon->size() > 1; ++i) {
      const Vector2d edge = (*polygon)[(i + 1) % polygon->size()] - (*polygon)[i];
      const Vector2d normal = Vector2d(-edge.y(), edge.x()).normalized();
      lowest = std::min({lowest, support(normal), support(-normal)});
    }
  return std::isfinite(lowest) ? lowest : 0.0;
}

using Eigen::Matrix3d;
using Eigen::MatrixX2d;
using Eigen::MatrixX3d;

constexpr double min_thickness = 1e-9;  // relative to the size; a thinner cloud is a line

template <typename Points>
void check(const Points& points, const char* what) {
  if (points.rows() < 3)
    throw std::invalid_argument(std::string(what) + ": expected at least 3 points");
  if (!points.allFinite())
    throw std::invalid_argument(std::string(what) + ": expected finite numbers");
}

/// Returns the weights scaled to sum 1; equal weights for an empty vector.
VectorXd normalised_weights(const VectorXd& weights, Index points, const char* what) {
  if (weights.size() == 0) return VectorXd::Constant(points, 1.0 / double(points));
  if (weights.size() != points || !weights.allFinite() || !(weights.minCoeff() > 0.0))
    throw std::invalid_argument(std::string(what) + ": expected one weight above 0 per point");
  return weights / weights.sum();
}

/// Distances of points from a centre, with the unit vectors towards the points.
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

/// Returns the centre of the circle with the least squares of x^2 + y^2, as a start of the
/// iteration.
Vector2d algebraic_centre(const MatrixX2d& points, const VectorXd& weights) {
  MatrixX3d terms(points.rows(), 3);
  terms << 2.0 * points, VectorXd::Ones(points.rows());
  const VectorXd root = weights.cwiseSqrt();
  const MatrixX3d weighted = root.asDiagonal() * terms;
  const VectorXd right = root.cwiseProduct(points.rowwise().squaredNorm());
  const auto fit = least_squares(weighted, right, min_thickness);
  if (fit.rank < 3) throw std::invalid_argument("circle: expected points that are not collinear");
  return fit.x.head<2>();
}

/// Returns the mean squared distance from the best circle about a centre.
double mean_square_distance(const MatrixX2d& points, const VectorXd& weights,
                            const Vector2d& centre) {
  const VectorXd d = rays(points, centre).length;
  return weights.dot((d.array() - weights.dot(d)).square().matrix());
}

/// Returns the Gauss-Newton step of the centre; the radius follows as the mean distance.
Vector2d step(const MatrixX2d& points, const VectorXd& weights, const Vector2d& centre) {
  const Rays r = rays(points, centre);
  MatrixX3d terms(points.rows(), 3);
  terms << r.direction, VectorXd::Ones(points.rows());
  const VectorXd root = weights.cwiseSqrt();
  const MatrixX3d weighted = root.asDiagonal() * terms;
  return least_squares(weighted, VectorXd(root.cwiseProduct(r.length))).x.head<2>();
}

/// Moves the position along `move`, or a fraction of it, to a smaller `width`. Returns false if
/// there is none. Fractions below 1e-6 are not tried: the next step would correct larger errors.
template <typename Position, typename Width>
bool descend(Position& position, const Vector2d& move, const Width& width) {
  const double initial_width = width(position, Vector2d::Zero());
  for (double fraction = 1.0; fraction > 1e-6; fraction *= 0.5)
    if (width(position, fraction * move) < initial_width) {
      position = position.displaced(fraction * move);
      return true;
    }
  return false;
}

/// Centre of a circle, as a position for `descend`.
struct Centre {
  Vector2d at;
  Centre displaced(const Vector2d& by) const { return {at + by}; }
};

/// Points relative to their mean, scaled to size 1.
struct ScaledPoints {
  MatrixX2d points;
  Vector2d mean;
  double size;
};

ScaledPoints scaled(const MatrixX2d& points) {
  ScaledPoints s;
  s.mean = points.colwise().mean();
  s.points = points.rowwise() - s.mean.transpose();
  s.size = s.points.cwiseAbs().maxCoeff();
  if (!(s.size > 0.0)) throw std::invalid_argument("circle: expected distinct points");
  s.points /= s.size;
  return s;
}

/// Returns the centre of the least-squares circle.
Vector2d least_squares_centre(const MatrixX2d& points, const VectorXd& weights) {
  Centre centre{algebraic_centre(points, weights)};
  const auto sum = [&](const Centre& c, const Vector2d& by) {
    return mean_square_distance(points, weights, c.at + by);
  };
  for (int i = 0; i < 200; ++i) {
    const Vector2d move = step(points, weights, centre.at);
    // For points nearly on a line the centre diverges, since a line fits better than any circle.
    if (centre.at.norm() > 1e6) throw std::invalid_argument("circle: no best-fit circle exists");
    if (!descend(centre, move, sum)) break;
  }
  // The sum of squares is flat to rounding here, but the steps are not: iterate until they no
  // longer halve.
  double step_limit = 1e-6;
  for (Vector2d move = step(points, weights, centre.at); move.norm() < step_limit;
       move = step(points, weights, centre.at)) {
    step_limit = 0.5 * move.norm();
    centre.at += move;
  }
  return centre.at;
}

MatrixX2d rows(const MatrixX2d& points, const std::vector<Index>& indices) {
  MatrixX2d result(Index(indices.size()), 2);
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = points.row(indices[std::size_t(i)]);
  return result;
}

/// Uniform fit of the heights after a small motion, linearised; x is in units of `spread`.
struct ZoneFit {
  ChebyshevFit fit;
  double width = 0.0;
  double spread = 1.0;  ///< mm that correspond to 1 in the fit

  Vector2d move() const { return spread * fit.x.head<2>(); }
  double gap() const { return std::max(0.0, width - 2.0 * spread * fit.lower); }
};

/// Fits the motion that minimises the range of the heights.
ZoneFit zone_fit(const MatrixX2d& terms, const VectorXd& heights) {
  ZoneFit zone;
  zone.width = heights.maxCoeff() - heights.minCoeff();
  zone.spread = zone.width > 0.0 ? zone.width : 1.0;
  const double middle = 0.5 * (heights.maxCoeff() + heights.minCoeff());
  zone.fit = chebyshev_fit(terms, (heights.array() - middle).matrix() / zone.spread);
  return zone;
}

/// Returns the sharpness of the minimum zone by its contact points.
double zone_sharpness(const MatrixX2d& terms, const VectorXd& heights, double width) {
  // 1e-8 of the width is ten times the accuracy of the fit, so no contact point is missed.
  const double highest = heights.maxCoeff() - 1e-8 * width;
  const double lowest = heights.minCoeff() + 1e-8 * width;
  std::vector<Index> upper, lower;
  for (Index i = 0; i < heights.size(); ++i) {
    if (heights[i] >= highest) upper.push_back(i);
    if (heights[i] <= lowest) lower.push_back(i);
  }
  return sharpness(rows(terms, upper), rows(terms, lower));
}

/// Returns the largest angle between neighbouring directions, rad.
double largest_gap(const MatrixX2d& directions) {
  std::vector<double> angle;
  for (Index i = 0; i < directions.rows(); ++i)
    angle.push_back(std::atan2(directions(i, 1), directions(i, 0)));
  std::sort(angle.begin(), angle.end());
  double largest = 2.0 * pi - (angle.back() - angle.front());
  for (std::size_t i = 1; i < angle.size(); ++i)
    largest = std::max(largest, angle[i] - angle[i - 1]);
  return largest;
}

/// Returns true if no centre gives a smaller width. A centre at distance t has a width of at least
/// w + g t - t^2 / 2(m - t), by the contact points, and of at least 2 k t - w - t^2 / 2(m - t), by
/// the points all around. w is the width, g the sharpness, m the inner radius, k the cosine of half
/// the largest gap. The two bounds must exceed w for 0 < t < m / 2.
bool proves_minimum(const Rays& r) {
  const double w = r.width(), m = r.length.minCoeff();
  if (!(m > 0.0)) return false;
  const double k = std::cos(0.5 * largest_gap(r.direction));
  const double g = zone_sharpness(r.direction, r.length, w);
  if (!(k > 0.0) || !(g > 0.0)) return false;
  const double near_bound = 2.0 * g * m / (1.0 + 2.0 * g);
  const double a = 4.0 * k + 1.0, b = 4.0 * (k * m + w), c = 4.0 * w * m;
  const double root = b * b - 4.0 * a * c;
  if (!(root > 0.0)) return false;
  return (b - std::sqrt(root)) / (2.0 * a) < near_bound &&
         (b + std::sqrt(root)) / (2.0 * a) > 0.5 * m;
}

/// Orthonormal frame whose third axis is the normal of a plane.
struct PlaneFrame {
  Matrix3d axes;  ///< columns
  /// Returns the frame of the plane z = by.x x + by.y y, given in this frame.
  PlaneFrame displaced(const Vector2d& by) const {
    const Vector3d n = (axes * Vector3d(-by.x(), -by.y(), 1.0)).normalized();
    const Vector3d x = (axes.col(0) - n * n.dot(axes.col(0))).normalized();
    Matrix3d displaced_axes;
    displaced_axes << x, n.cross(x), n;
    return {displaced_axes};
  }
};

/// Returns the normal with its largest component positive. The sign of a normal is arbitrary; this
/// choice makes results comparable.
Vector3d upward_normal(const Vector3d& normal) {
  Index largest = 0;
  normal.cwiseAbs().maxCoeff(&largest);

  return normal[largest] < 0.0 ? Vector3d(-normal) : normal;
}

/// Points relative to their mean, with the principal axes of their scatter, the smallest last.
struct PointCloud {
  Vector3d mean;
  MatrixX3d points;
  PlaneFrame frame;
};

/// Returns points about their weighted mean, with principal axes.
PointCloud centred_cloud(const MatrixX3d& points, const VectorXd& weights = {}) {
  const VectorXd relative_weights = normalised_weights(weights, points.rows(), "plane");
  PointCloud c;
  c.mean = points.transpose() * relative_weights;
  c.points = points.rowwise() - c.mean.transpose();
  const double size = c.points.cwiseAbs().maxCoeff();
  if (!(size > 0.0)) throw std::invalid_argument("plane: expected distinct points");
  const VectorXd root = relative_weights.cwiseSqrt();
  const MatrixX3d unit = root.asDiagonal() * (c.points / size);
  const PrincipalAxes spread = principal_axes(unit);
  if (spread.size[1] < min_thickness * spread.size[0])
    throw std::invalid_argument("plane: expected points that are not collinear");
  c.frame.axes = spread.axes;
  c.frame.axes.col(2) = c.frame.axes.col(0).cross(c.frame.axes.col(1));
  return c;
}

}  // namespace

LeastSquaresCircle least_squares_circle(const MatrixX2d& points, const VectorXd& weights) {
  check(points, "circle");
  const VectorXd relative_weights = normalised_weights(weights, points.rows(), "circle");
  const ScaledPoints s = scaled(points);
  LeastSquaresCircle circle;
  circle.centre = s.mean + s.size * least_squares_centre(s.points, relative_weights);
  const VectorXd d = rays(points, circle.centre).length;
  circle.radius = relative_weights.dot(d);
  circle.circularity = d.maxCoeff() - d.minCoeff();
  return circle;
}

MinimumZoneCircles minimum_zone_circles(const MatrixX2d& points) {
  check(points, "circle");
  const ScaledPoints s = scaled(points);
  Centre centre{least_squares_centre(s.points, normalised_weights({}, points.rows(), "circle"))};
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
  circles.is_proven =
      points.rows() > 3 && circles.gap <= 1e-8 * circles.circularity && proves_minimum(r);
  return circles;
}

LeastSquaresPlane least_squares_plane(const MatrixX3d& points, const VectorXd& weights) {
  check(points, "plane");
  const PointCloud c = centred_cloud(points, weights);
  LeastSquaresPlane plane;
  plane.normal = upward_normal(c.frame.axes.col(2));
  plane.offset = plane.normal.dot(c.mean);
  const VectorXd height = c.points * plane.normal;
  plane.flatness = height.maxCoeff() - height.minCoeff();
  return plane;
}

MinimumZonePlanes minimum_zone_planes(const MatrixX3d& points) {
  check(points, "plane");
  PointCloud c = centred_cloud(points);
  const double size = c.points.cwiseAbs().maxCoeff();
  c.points /= size;
  const auto width = [&](const PlaneFrame& frame, const Vector2d& by) {
    const VectorXd height = c.points * frame.displaced(by).axes.col(2);
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
  planes.normal = upward_normal(c.frame.axes.col(2));
  const VectorXd height = (size * c.points) * planes.normal;
  const double offset = planes.normal.dot(c.mean);
  planes.lower = offset + height.minCoeff();
  planes.upper = offset + height.maxCoeff();
  planes.flatness = size * w;
  planes.gap = size * zone.gap();
  // Planes tilted by a slope t are (w + g t) / sqrt(1 + t^2) apart, so g > w is sufficient.
  planes.is_proven =
      !(w > 0.0) || (planes.gap <= 1e-8 * planes.flatness &&
                     zone_sharpness(local.leftCols<2>(), local.col(2), w) > 1.000001 * w);
  return planes;
}

}  // namespace abbe::errors::metrology
