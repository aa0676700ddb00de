#include "errors/metrology/circular.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "errors/metrology/form.h"
#include "kinematics/decompositions.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double one_place = 1e-9;  // rad: rounding of an angle computed from two coordinates

/// Distinct positions of readings around a circle, and the gap after each.
struct Ring {
  std::vector<double> place;  ///< (m) rad in [0, 2 pi), ascending
  std::vector<double> gap;    ///< (m) rad to the next position, also from the last to the first
  std::vector<int> place_of;  ///< (n) index of the position of each reading
  std::vector<int> readings;  ///< (m) number of readings at each position

  std::size_t size() const { return place.size(); }
  std::size_t widest() const {
    return std::size_t(std::max_element(gap.begin(), gap.end()) - gap.begin());
  }
};

Ring ring_of(const VectorXd& angle) {
  std::vector<Index> order(static_cast<std::size_t>(angle.size()));
  std::iota(order.begin(), order.end(), 0);
  const VectorXd within = angle.unaryExpr([](double a) {
    const double rest = a - units::full_turn * std::floor(a / units::full_turn);
    // An angle just below a full turn is the start of the circle, by the rounding of its
    // coordinates.
    return rest > units::full_turn - one_place ? 0.0 : rest;
  });
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return within[a] < within[b]; });
  Ring ring;
  ring.place_of.resize(order.size());
  for (const Index i : order) {
    if (ring.place.empty() || within[i] - ring.place.back() > one_place) {
      ring.place.push_back(within[i]);
      ring.readings.push_back(0);
    }
    ring.place_of[std::size_t(i)] = int(ring.size()) - 1;
    ++ring.readings.back();
  }
  for (std::size_t k = 0; k + 1 < ring.size(); ++k)
    ring.gap.push_back(ring.place[k + 1] - ring.place[k]);
  if (ring.size() > 0)
    ring.gap.push_back(units::full_turn - (ring.place.back() - ring.place.front()));
  return ring;
}

// Gaps below 5 degrees are small on any circle; a coarser circle is full if its widest gap is about
// as wide as the median.
bool is_full_ring(const Ring& ring) {
  if (ring.size() < 3) return false;
  std::vector<double> gap = ring.gap;
  std::sort(gap.begin(), gap.end());
  return gap.back() < 5.0 * units::deg || gap.back() < 1.5 * gap[(gap.size() - 1) / 2];
}

}  // namespace

VectorXd arc_weights(const VectorXd& angle) {
  const Ring ring = ring_of(angle);
  const std::size_t m = ring.size(), widest = m > 0 ? ring.widest() : 0;
  const bool whole = is_full_ring(ring);
  VectorXd shares(angle.size());
  for (Index i = 0; i < shares.size(); ++i) {
    const auto k = std::size_t(ring.place_of[std::size_t(i)]);
    double before = ring.gap[(k + m - 1) % m], after = ring.gap[k];
    // Beside the widest gap of an arc nothing was read, so its end counts only as far outwards as
    // inwards.
    if (!whole && k == widest) after = std::min(before, after);
    if (!whole && (k + m - 1) % m == widest) before = std::min(before, after);
    shares[i] = 0.5 * (before + after) / ring.readings[k];
  }
  return shares;
}

bool is_full_turn(const VectorXd& angle) { return is_full_ring(ring_of(angle)); }

// Rows are sorted by a linear combination of their coordinates with irrational weights, which
// differs for almost all distinct positions, so that only neighbours in this order are compared.
VectorXd place_weights(const Eigen::MatrixXd& places, double tolerance) {
  const Index n = places.rows();
  VectorXd along(places.cols());
  for (Index c = 0; c < along.size(); ++c)
    along[c] = 0.5 + std::fmod(0.6180339887498949 * double(c + 1), 1.0);
  const VectorXd key = places * along;
  const double reach = tolerance * along.sum();
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return key[a] < key[b]; });
  VectorXd count = VectorXd::Ones(n);
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size() && key[order[j]] - key[order[i]] <= reach; ++j) {
      if ((places.row(order[i]) - places.row(order[j])).cwiseAbs().maxCoeff() > tolerance) continue;
      count[order[i]] += 1.0;
      count[order[j]] += 1.0;
    }
  return count.cwiseInverse();
}

namespace {

using Eigen::MatrixX2d;
using Eigen::Vector2d;

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

/// Points of one sense, or of both, with their arc weights.
struct CircularPath {
  MatrixX2d points;
  VectorXd shares;
};

CircularPath traced(const CircularTrace& trace) {
  CircularPath path{MatrixX2d(trace.radius.size(), 2), arc_weights(trace.angle)};
  path.points.col(0) = trace.radius.array() * trace.angle.array().cos();
  path.points.col(1) = trace.radius.array() * trace.angle.array().sin();
  return path;
}

CircularPath together(const CircularPath& a, const CircularPath& b) {
  CircularPath all{MatrixX2d(a.points.rows() + b.points.rows(), 2),
                   VectorXd(a.shares.size() + b.shares.size())};
  all.points << a.points, b.points;
  all.shares << a.shares, b.shares;
  return all;
}

// Radii about the centre in use, hence not those of the trace.
VectorXd distances(const MatrixX2d& points, const Vector2d& centre) {
  return (points.rowwise() - centre.transpose()).rowwise().norm();
}

CircularFigures figures(const CircularPath& path, const Vector2d& centre, double nominal_radius) {
  const VectorXd radius = distances(path.points, centre);
  return {least_squares_circle(path.points, path.shares).circularity,
          minimum_zone_circles(path.points).circularity, radius.maxCoeff() - nominal_radius,
          radius.minCoeff() - nominal_radius};
}

/// Radii of one sense over the angle from its start, within one turn.
class RadiiOverAngle {
 public:
  RadiiOverAngle(const VectorXd& angle, const VectorXd& radius) : from_(angle.minCoeff()) {
    for (Index i = 0; i < radius.size(); ++i) at_.emplace_back(since_start(angle[i]), radius[i]);
    std::sort(at_.begin(), at_.end());
    if (is_full_turn(angle)) at_.emplace_back(2.0 * pi, at_.front().second);
  }

  /// Returns the radius, linear between readings; empty where this sense was not measured.
  std::optional<double> radius(double angle) const {
    const double there = since_start(angle);
    if (there > at_.back().first + one_place) return std::nullopt;
    const auto after =
        std::lower_bound(at_.begin(), at_.end(), there - one_place,
                         [](const auto& one, double value) { return one.first < value; });
    if (after == at_.begin() || after->first <= there + one_place) return after->second;
    const auto before = after - 1;
    const double part = (there - before->first) / (after->first - before->first);
    return before->second + part * (after->second - before->second);
  }

 private:
  static constexpr double one_place = 1e-9;  // rad: rounding of angles

  double since_start(double angle) const {
    const double turns = (angle - from_) / (2.0 * pi);
    const double rest = 2.0 * pi * (turns - std::floor(turns));
    return rest > 2.0 * pi - one_place ? 0.0 : rest;
  }

  double from_;
  std::vector<std::pair<double, double>> at_;
};

/// Returns the largest difference of the radii of both senses at the angles at which either was
/// read.
std::optional<double> hysteresis(const CircularRuns& runs, const VectorXd& forth,
                                 const VectorXd& back) {
  std::optional<double> most;
  const auto measurement = [&](const VectorXd& angle, const VectorXd& radius,
                               const RadiiOverAngle& other) {
    for (Index i = 0; i < radius.size(); ++i)
      if (const auto there = other.radius(angle[i]))
        most = std::max(most.value_or(0.0), std::abs(radius[i] - *there));
  };
  const VectorXd &up = runs.anticlockwise.angle, &down = runs.clockwise.angle;
  measurement(up, forth, RadiiOverAngle(down, back));
  measurement(down, back, RadiiOverAngle(up, forth));
  return most;
}

enum Cause { Radius, CentreU, CentreV, Scale, SquarenessVU, ReversalU, ReversalV, Lag, Causes };

double sign(double x) {
  constexpr double turning = 1e-12;  // rad: at a quadrant an axis stands still and has no direction
  return x > turning ? 1.0 : (x < -turning ? -1.0 : 0.0);
}

/// Returns the radial deviation per unit of every cause at one angle for one sense of motion (+1
/// anticlockwise).
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

struct Deviations {
  Eigen::MatrixXd effect;  ///< (n x Causes)
  VectorXd deviation;      ///< (n) mm
  VectorXd share;          ///< (n) arc weights
};

Deviations deviations(const CircularRuns& runs) {
  const Index n = runs.anticlockwise.radius.size(), k = runs.clockwise.radius.size();
  Deviations all{Eigen::MatrixXd(n + k, Index(Causes)), VectorXd(n + k), VectorXd(n + k)};
  all.share << arc_weights(runs.anticlockwise.angle), arc_weights(runs.clockwise.angle);
  all.deviation << runs.anticlockwise.radius, runs.clockwise.radius;
  all.deviation.array() -= runs.nominal_radius;
  for (Index i = 0; i < n; ++i)
    all.effect.row(i) = effect(runs.anticlockwise.angle[i], 1.0, runs.nominal_radius);
  for (Index i = 0; i < k; ++i)
    all.effect.row(n + i) = effect(runs.clockwise.angle[i], -1.0, runs.nominal_radius);
  return all;
}

/// Weighted least squares by singular values; a cause that takes part in a direction without effect
/// is undetermined.
struct Solution {
  VectorXd value, u;
  std::array<bool, Causes> open{};
  double residual = 0.0;
};

// With weights w, x = (A'WA)^-1 A'W y has the covariance s^2 (A'WA)^-1 A'W^2A (A'WA)^-1 if all
// readings have the noise s, and the sum of w r^2 expects s^2 times (sum of w - trace), the trace
// computed below.
Solution solution(const Deviations& all, Index causes) {
  constexpr double without_effect = 1e-8;  // relative to the largest singular value, columns scaled
                                           // to length 1
  const VectorXd share = all.share / all.share.maxCoeff(), root = share.cwiseSqrt();
  const Eigen::MatrixXd weighted = root.asDiagonal() * all.effect.leftCols(causes);
  // Scaled columns make the causes (mm, rad, relative) comparable; 1e-300 avoids a division by
  // zero.
  const VectorXd norm = weighted.colwise().norm().transpose().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = weighted * norm.cwiseInverse().asDiagonal();
  const SingularValues svd = singular_values(scaled, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const VectorXd& singular = svd.values;
  VectorXd inverse = VectorXd::Zero(causes);
  Solution result;
  for (Index i = 0; i < causes; ++i) {
    if (singular[i] > without_effect * singular[0]) {
      inverse[i] = 1.0 / singular[i];
      continue;
    }
    for (Index c = 0; c < causes; ++c)
      // 1e-6: a cause whose part of the null direction is below this is determined to six digits.
      if (std::abs(svd.V(c, i)) > 1e-6) result.open[std::size_t(c)] = true;
  }
  const Eigen::MatrixXd estimator =
      svd.V * inverse.asDiagonal() * svd.U.transpose();  // applied to root times y
  const VectorXd x = estimator * root.cwiseProduct(all.deviation);
  const VectorXd left = root.cwiseProduct(all.deviation) - scaled * x;
  const double taken = share.dot((scaled * estimator).diagonal());
  const double free = share.sum() - taken;
  // With as many readings as causes nothing is left to estimate the noise from.
  result.residual = free > 1e-9 ? std::sqrt(left.squaredNorm() / free) : 0.0;
  result.value = x.cwiseQuotient(norm);
  result.u = result.residual * (estimator * root.asDiagonal()).rowwise().norm().cwiseQuotient(norm);
  return result;
}

}  // namespace

Circular circular(const CircularRuns& runs, const CircularOptions& options) {
  check(runs);
  const CircularPath forth = traced(runs.anticlockwise), back = traced(runs.clockwise);
  const CircularPath all = together(forth, back);
  Circular result;
  result.circle = least_squares_circle(all.points, all.shares);
  // ISO 230-4 allows the least-squares centre for full circles only.
  const bool whole = (forth.shares.size() == 0 || is_full_turn(runs.anticlockwise.angle)) &&
                     (back.shares.size() == 0 || is_full_turn(runs.clockwise.angle));
  if (options.centre == CircleCentre::LeastSquares && whole) {
    result.centre = result.circle.centre;
    result.centre_kind = CircleCentre::LeastSquares;
  }
  const double R = runs.nominal_radius;
  result.D = result.circle.radius - R;
  if (forth.shares.size() > 0) result.anticlockwise = figures(forth, result.centre, R);
  if (back.shares.size() > 0) result.clockwise = figures(back, result.centre, R);
  if (!result.anticlockwise || !result.clockwise) return result;
  result.both = figures(all, result.centre, R);
  result.H = hysteresis(runs, distances(forth.points, result.centre),
                        distances(back.points, result.centre));
  return result;
}

int place_count(const CircularRuns& runs) {
  int count = 0;
  for (const CircularTrace* trace : {&runs.anticlockwise, &runs.clockwise}) {
    Eigen::MatrixX2d place(trace->angle.size(), 2);
    place << trace->angle.array().cos(), trace->angle.array().sin();
    count += int(std::lround(place_weights(place, 1e-9).sum()));
  }
  return count;
}

CircularCauses circular_causes(const CircularRuns& runs, const CauseOptions& options) {
  check(runs);
  static_assert(Causes == circular_cause_count);
  const Deviations all = deviations(runs);
  const Index causes = options.is_lag_excluded ? Lag : Causes;
  if (place_count(runs) <= causes)
    throw std::invalid_argument("circular: expected more readings than causes");
  const Solution found = solution(all, causes);
  CircularCauses result;
  result.residual = found.residual;
  const std::array<std::optional<EstimatedValue>*, Causes> fields{
      &result.radius,     &result.centre_u,   &result.centre_v,   &result.scale,
      &result.squareness, &result.reversal_u, &result.reversal_v, &result.lag};
  for (Index c = 0; c < causes; ++c) {
    if (found.open[std::size_t(c)])
      result.undetermined.push_back(cause_names[std::size_t(c)]);
    else
      *fields[std::size_t(c)] = EstimatedValue{found.value[c], found.u[c]};
  }
  return result;
}

}  // namespace abbe::errors::metrology
