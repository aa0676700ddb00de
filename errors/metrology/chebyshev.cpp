#include "errors/metrology/chebyshev.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <Eigen/LU>

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::Matrix4d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using Reference = std::array<Index, 4>;

constexpr int most_exchanges = 1000;
constexpr double nudge = 1e-11;  // of the terms, which are about 1: breaks ties of points on a line

/// A number in -1 .. 1 that depends on k alone.
double scatter(std::uint64_t k) {
  k = (k + 0x9e3779b97f4a7c15u) * 0xbf58476d1ce4e5b9u;
  k = (k ^ (k >> 29)) * 0x94d049bb133111ebu;
  return double(k >> 11) * 0x1p-52 - 1.0;
}

/// Twice the area of a triangle, positive if it turns left.
double orientation(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// Weights of four points with which every affine function of the terms sums to zero, their
/// absolute values to one; zero where the points leave that open.
Vector4d balance(const Eigen::MatrixX2d& terms, const Reference& r) {
  const Vector2d p0 = terms.row(r[0]), p1 = terms.row(r[1]), p2 = terms.row(r[2]),
                 p3 = terms.row(r[3]);
  Vector4d weight(orientation(p1, p2, p3), -orientation(p0, p2, p3), orientation(p0, p1, p3),
                  -orientation(p0, p1, p2));
  const double sum = weight.lpNorm<1>();
  if (!(sum > 0.0)) return Vector4d::Zero();
  return weight / sum;
}

double value(const VectorXd& y, const Reference& r, const Vector4d& weight) {
  return weight[0] * y[r[0]] + weight[1] * y[r[1]] + weight[2] * y[r[2]] + weight[3] * y[r[3]];
}

/// One exchange: which of four points gives way to a fifth so that the bound grows most.
Reference exchanged(const Eigen::MatrixX2d& terms, const VectorXd& y, const Reference& r,
                    Index entering) {
  Reference best = r;
  double most = -1.0;
  for (int leaving = 0; leaving < 4; ++leaving) {
    Reference trial = r;
    trial[leaving] = entering;
    const double bound = std::abs(value(y, trial, balance(terms, trial)));
    if (bound > most) {
      most = bound;
      best = trial;
    }
  }
  return best;
}

/// Coefficients whose residuals at the reference are the bound with the signs of its weights.
Vector3d solved(const Eigen::MatrixX2d& terms, const VectorXd& y, const Reference& r) {
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

/// Four points far apart, so that the first bound is no degenerate one.
Reference first_reference(const Eigen::MatrixX2d& terms, const VectorXd& y) {
  Reference r{0, 0, 0, 0};
  const Vector2d middle = terms.colwise().mean();
  (terms.rowwise() - middle.transpose()).rowwise().squaredNorm().maxCoeff(&r[0]);
  (terms.rowwise() - terms.row(r[0])).rowwise().squaredNorm().maxCoeff(&r[1]);
  const Vector2d along = terms.row(r[1]) - terms.row(r[0]);
  const Vector2d across(-along.y(), along.x());
  ((terms.rowwise() - terms.row(r[0])) * across).cwiseAbs().maxCoeff(&r[2]);
  double most = -1.0;
  for (Index i = 0; i < y.size(); ++i) {
    const Reference trial{r[0], r[1], r[2], i};
    const double bound = std::abs(value(y, trial, balance(terms, trial)));
    if (i != r[0] && i != r[1] && i != r[2] && bound > most) {
      most = bound;
      r[3] = i;
    }
  }
  return r;
}

/// The same coefficients with the constant in the middle of the residuals.
Vector3d centred(const Eigen::MatrixX2d& terms, const VectorXd& y, Vector3d x) {
  const VectorXd left = residual(terms, y, x);
  x[2] += 0.5 * (left.maxCoeff() + left.minCoeff());
  return x;
}

/// Corners of the convex hull, all different, in order around it.
std::vector<Vector2d> hull(const Eigen::MatrixX2d& points) {
  std::vector<Vector2d> sorted;
  for (Index i = 0; i < points.rows(); ++i) sorted.push_back(points.row(i));
  const auto before = [](const Vector2d& a, const Vector2d& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  };
  std::sort(sorted.begin(), sorted.end(), before);
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

void add_touching(const VectorXd& left, ChebyshevFit& fit) {
  const double near = fit.half_width * (1.0 - 1e-9) - 1e-15;
  for (Index i = 0; i < left.size(); ++i) {
    if (left[i] >= near) fit.upper_points.push_back(i);
    if (left[i] <= -near) fit.lower_points.push_back(i);
  }
}

}  // namespace

ChebyshevFit chebyshev_fit(const Eigen::MatrixX2d& terms, const VectorXd& y) {
  ChebyshevFit fit;
  const Index n = y.size();
  if (n < 4) {  // three points always fit
    Eigen::MatrixX3d all(n, 3);
    all << terms, VectorXd::Ones(n);
    fit.x = centred(terms, y, all.fullPivLu().solve(y));
  } else {
    Eigen::MatrixX2d moved = terms;
    for (Index i = 0; i < n; ++i)
      moved.row(i) += nudge * Eigen::RowVector2d(scatter(2 * i), scatter(2 * i + 1));
    Reference r = first_reference(moved, y);
    double best = std::numeric_limits<double>::infinity();
    for (int i = 0; i < most_exchanges; ++i) {
      const Vector3d x = solved(moved, y, r);
      fit.lower = std::max(fit.lower, std::abs(value(y, r, balance(terms, r))));
      const VectorXd left = residual(moved, y, x);
      Index farthest = 0;
      const double largest = left.cwiseAbs().maxCoeff(&farthest);
      if (largest < best) {
        best = largest;
        fit.x = x;
      }
      const bool known = std::find(r.begin(), r.end(), farthest) != r.end();
      if (known || largest <= std::abs(value(y, r, balance(moved, r))) * (1.0 + 1e-14)) break;
      r = exchanged(moved, y, r, farthest);
    }
    fit.x = centred(terms, y, fit.x);
  }
  const VectorXd left = residual(terms, y, fit.x);
  fit.half_width = left.cwiseAbs().maxCoeff();
  add_touching(left, fit);
  return fit;
}

double sharpness(const Eigen::MatrixX2d& upper, const Eigen::MatrixX2d& lower) {
  // the support function of the polygon of all differences; its least value over directions is
  // taken where the direction is a normal of one of the edges, which are edges of the two hulls
  const std::vector<Vector2d> above = hull(upper), below = hull(lower);
  const auto support = [&](const Vector2d& d) {
    double most = -std::numeric_limits<double>::infinity();
    double least = -most;
    for (const Vector2d& u : above) most = std::max(most, -u.dot(d));
    for (const Vector2d& u : below) least = std::min(least, -u.dot(d));
    return most - least;
  };
  double least = std::numeric_limits<double>::infinity();
  for (const std::vector<Vector2d>* polygon : {&above, &below})
    for (std::size_t i = 0; i < polygon->size() && polygon->size() > 1; ++i) {
      const Vector2d edge = (*polygon)[(i + 1) % polygon->size()] - (*polygon)[i];
      const Vector2d normal = Vector2d(-edge.y(), edge.x()).normalized();
      least = std::min({least, support(normal), support(-normal)});
    }
  return std::isfinite(least) ? least : 0.0;
}

}  // namespace abbe::errors::metrology
