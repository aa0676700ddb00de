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

constexpr double angle_tolerance = 1e-9;  // rad; covers the rounding of coordinates

/// Distinct positions of readings around a circle, with the gap after each.
struct Ring {
  std::vector<double> positions;  ///< (m) rad in [0, 2 pi), ascending
  std::vector<double> gap;        ///< (m) rad to the next position, also from the last to the first
  std::vector<int> position_of;   ///< (n) index of the position of each reading
  std::vector<int> readings;      ///< (m) number of readings at each position

  std::size_t size() const { return positions.size(); }
  std::size_t widest_gap() const {
    return std::size_t(std::max_element(gap.begin(), gap.end()) - gap.begin());
  }
};

/// Sorts the angles of readings into distinct positions.
Ring make_ring(const VectorXd& angle) {
  std::vector<Index> order(static_cast<std::size_t>(angle.size()));
  std::iota(order.begin(), order.end(), 0);
  const VectorXd wrapped = angle.unaryExpr([](double a) {
    const double remainder = a - units::full_turn * std::floor(a / units::full_turn);
    // An angle just below a full turn is the start of the circle with rounded coordinates.
    return remainder > units::full_turn - angle_tolerance ? 0.0 : remainder;
  });
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return wrapped[a] < wrapped[b]; });
  Ring ring;
  ring.position_of.resize(order.size());
  for (const Index i : order) {
    if (ring.positions.empty() || wrapped[i] - ring.positions.back() > angle_tolerance) {
      ring.positions.push_back(wrapped[i]);
      ring.readings.push_back(0);
    }
    ring.position_of[std::size_t(i)] = int(ring.size()) - 1;
    ++ring.readings.back();
  }
  for (std::size_t k = 0; k + 1 < ring.size(); ++k)
    ring.gap.push_back(ring.positions[k + 1] - ring.positions[k]);
  if (ring.size() > 0)
    ring.gap.push_back(units::full_turn - (ring.positions.back() - ring.positions.front()));
  return ring;
}

// Gaps below 5 degrees are small on any circle. A coarser circle is full if its widest gap is about
// as wide as the median gap.
bool is_full_ring(const Ring& ring) {
  if (ring.size() < 3) return false;
  std::vector<double> gap = ring.gap;
  std::sort(gap.begin(), gap.end());
  return gap.back() < 5.0 * units::deg || gap.back() < 1.5 * gap[(gap.size() - 1) / 2];
}

}  // namespace

VectorXd arc_weights(const VectorXd& angle) {
  const Ring ring = make_ring(angle);
  const std::size_t m = ring.size(), widest_gap = m > 0 ? ring.widest_gap() : 0;
  const bool is_full = is_full_ring(ring);
  VectorXd weights(angle.size());
  for (Index i = 0; i < weights.size(); ++i) {
    const auto k = std::size_t(ring.position_of[std::size_t(i)]);
    double previous_gap = ring.gap[(k + m - 1) % m], next_gap = ring.gap[k];
    // No reading exists beyond the end of an arc, so the end point represents as much of the arc
    // outwards as inwards.
    if (!is_full && k == widest_gap) next_gap = std::min(previous_gap, next_gap);
    if (!is_full && (k + m - 1) % m == widest_gap) previous_gap = std::min(previous_gap, next_gap);
    weights[i] = 0.5 * (previous_gap + next_gap) / ring.readings[k];
  }
  return weights;
}

bool is_full_turn(const VectorXd& angle) { return is_full_ring(make_ring(angle)); }

// Rows are sorted by a linear combination of their coordinates with irrational weights. It differs
// for almost all distinct positions, so that only neighbours in this order need to be compared.
VectorXd position_weights(const Eigen::MatrixXd& positions, double tolerance) {
  const Index n = positions.rows();
  VectorXd projection(positions.cols());
  for (Index c = 0; c < projection.size(); ++c)
    projection[c] = 0.5 + std::fmod(0.6180339887498949 * double(c + 1), 1.0);
  const VectorXd key = positions * projection;
  const double max_key_difference = tolerance * projection.sum();
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return key[a] < key[b]; });
  VectorXd count = VectorXd::Ones(n);
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1;
         j < order.size() && key[order[j]] - key[order[i]] <= max_key_difference; ++j) {
      if ((positions.row(order[i]) - positions.row(order[j])).cwiseAbs().maxCoeff() > tolerance)
        continue;
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
    throw std::invalid_argument("circular: expected one radius per angle");
  if (n == 0) return;
  if (n < 3)
    throw std::invalid_argument("circular: expected at least 3 readings per sense of rotation");
  if (!trace.angle.allFinite() || !trace.radius.allFinite() || !(trace.radius.minCoeff() > 0.0))
    throw std::invalid_argument("circular: expected finite angles and positive radii");
  for (Index i = 1; i < n; ++i)
    if (!(sense * (trace.angle[i] - trace.angle[i - 1]) > 0.0))
      throw std::invalid_argument(
          "circular: expected angles that increase anticlockwise and decrease clockwise");
}

void check(const CircularRuns& runs) {
  if (!(runs.nominal_radius > 0.0) || !std::isfinite(runs.nominal_radius))
    throw std::invalid_argument("circular: expected a positive nominal radius");
  check(runs.anticlockwise, 1.0);
  check(runs.clockwise, -1.0);
  if (runs.anticlockwise.radius.size() + runs.clockwise.radius.size() == 0)
    throw std::invalid_argument("circular: expected readings in at least one sense of rotation");
}

/// Points of one sense of motion, or of both, with their arc weights.
struct CircularPath {
  MatrixX2d points;
  VectorXd weights;
};

CircularPath path_points(const CircularTrace& trace) {
  CircularPath path{MatrixX2d(trace.radius.size(), 2), arc_weights(trace.angle)};
  path.points.col(0) = trace.radius.array() * trace.angle.array().cos();
  path.points.col(1) = trace.radius.array() * trace.angle.array().sin();
  return path;
}

CircularPath concatenate(const CircularPath& a, const CircularPath& b) {
  CircularPath path{MatrixX2d(a.points.rows() + b.points.rows(), 2),
                    VectorXd(a.weights.size() + b.weights.size())};
  path.points << a.points, b.points;
  path.weights << a.weights, b.weights;
  return path;
}

/// Returns the distances of points from the centre in use, which differs from that of the trace.
VectorXd distances(const MatrixX2d& points, const Vector2d& centre) {
  return (points.rowwise() - centre.transpose()).rowwise().norm();
}

/// Returns the deviations of a path; F refers to the given centre.
CircularFigures figures(const CircularPath& path, const Vector2d& centre, double nominal_radius) {
  const VectorXd radius = distances(path.points, centre);
  return {least_squares_circle(path.points, path.weights).circularity,
          minimum_zone_circles(path.points).circularity, radius.maxCoeff() - nominal_radius,
          radius.minCoeff() - nominal_radius};
}

/// Interpolation of the radii of one sense over the angle since its start, within one turn.
class RadiiOverAngle {
 public:
  RadiiOverAngle(const VectorXd& angle, const VectorXd& radius) : start_(angle.minCoeff()) {
    for (Index i = 0; i < radius.size(); ++i)
      samples_.emplace_back(since_start(angle[i]), radius[i]);
    std::sort(samples_.begin(), samples_.end());
    if (is_full_turn(angle)) samples_.emplace_back(2.0 * pi, samples_.front().second);
  }

  /// Returns the radius, linear between readings; nothing at angles where this sense was not
  /// measured.
  std::optional<double> radius(double angle) const {
    const double offset = since_start(angle);
    if (offset > samples_.back().first + angle_tolerance) return std::nullopt;
    const auto after =
        std::lower_bound(samples_.begin(), samples_.end(), offset - angle_tolerance,
                         [](const auto& sample, double value) { return sample.first < value; });
    if (after == samples_.begin() || after->first <= offset + angle_tolerance) return after->second;
    const auto before = after - 1;
    const double fraction = (offset - before->first) / (after->first - before->first);
    return before->second + fraction * (after->second - before->second);
  }

 private:
  double since_start(double angle) const {
    const double turns = (angle - start_) / (2.0 * pi);
    const double remainder = 2.0 * pi * (turns - std::floor(turns));
    return remainder > 2.0 * pi - angle_tolerance ? 0.0 : remainder;
  }

  double start_;
  std::vector<std::pair<double, double>> samples_;
};

/// Returns the largest difference of the radii of the two senses, at all angles read in either
/// sense.
std::optional<double> hysteresis(const CircularRuns& runs, const VectorXd& anticlockwise_radii,
                                 const VectorXd& clockwise_radii) {
  std::optional<double> largest;
  const auto compare = [&](const VectorXd& angle, const VectorXd& radius,
                           const RadiiOverAngle& other) {
    for (Index i = 0; i < radius.size(); ++i)
      if (const auto other_radius = other.radius(angle[i]))
        largest = std::max(largest.value_or(0.0), std::abs(radius[i] - *other_radius));
  };
  const VectorXd &anticlockwise_angle = runs.anticlockwise.angle,
                 &clockwise_angle = runs.clockwise.angle;
  compare(anticlockwise_angle, anticlockwise_radii,
          RadiiOverAngle(clockwise_angle, clockwise_radii));
  compare(clockwise_angle, clockwise_radii,
          RadiiOverAngle(anticlockwise_angle, anticlockwise_radii));
  return largest;
}

/// Causes in the order of `cause_names`; `Causes` is their number.
enum Cause { Radius, CentreU, CentreV, Scale, SquarenessVU, ReversalU, ReversalV, Lag, Causes };

/// Returns the direction of motion of an axis: -1, 0 or 1.
double sign(double x) {
  constexpr double direction_threshold =
      1e-12;  // rad; at a quadrant an axis stands still and has no direction
  return x > direction_threshold ? 1.0 : (x < -direction_threshold ? -1.0 : 0.0);
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

/// Linear model of the radial deviations.
struct Deviations {
  Eigen::MatrixXd effect;  ///< (n x Causes)
  VectorXd deviation;      ///< (n) mm
  VectorXd weights;        ///< (n) arc weights
};

/// Returns the model of the radial deviations of both senses.
Deviations deviations(const CircularRuns& runs) {
  const Index n = runs.anticlockwise.radius.size(), k = runs.clockwise.radius.size();
  Deviations result{Eigen::MatrixXd(n + k, Index(Causes)), VectorXd(n + k), VectorXd(n + k)};
  result.weights << arc_weights(runs.anticlockwise.angle), arc_weights(runs.clockwise.angle);
  result.deviation << runs.anticlockwise.radius, runs.clockwise.radius;
  result.deviation.array() -= runs.nominal_radius;
  for (Index i = 0; i < n; ++i)
    result.effect.row(i) = effect(runs.anticlockwise.angle[i], 1.0, runs.nominal_radius);
  for (Index i = 0; i < k; ++i)
    result.effect.row(n + i) = effect(runs.clockwise.angle[i], -1.0, runs.nominal_radius);
  return result;
}

/// Solution of the weighted least squares by singular values. A cause that contributes to a
/// direction without effect is undetermined.
struct Solution {
  VectorXd value;
  VectorXd u;  ///< standard uncertainty
  std::array<bool, Causes> is_undetermined{};
  double residual = 0.0;
};

// With weights w, x = (A'WA)^-1 A'W y has the covariance s^2 (A'WA)^-1 A'W^2A (A'WA)^-1 if all
// readings have the noise s, and the sum of w r^2 expects s^2 times (sum of w - trace), the trace
// computed below.
Solution solution(const Deviations& model, Index causes) {
  constexpr double min_effect = 1e-8;  // relative to the largest singular value, columns scaled
                                       // to length 1
  const VectorXd relative_weight = model.weights / model.weights.maxCoeff(),
                 root_of_weight = relative_weight.cwiseSqrt();
  const Eigen::MatrixXd weighted = root_of_weight.asDiagonal() * model.effect.leftCols(causes);
  // Scaled columns make the causes (mm, rad, relative) comparable; 1e-300 avoids a division by
  // zero.
  const VectorXd norm = weighted.colwise().norm().transpose().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = weighted * norm.cwiseInverse().asDiagonal();
  const SingularValues svd = singular_values(scaled, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const VectorXd& singular = svd.values;
  VectorXd inverse = VectorXd::Zero(causes);
  Solution result;
  for (Index i = 0; i < causes; ++i) {
    if (singular[i] > min_effect * singular[0]) {
      inverse[i] = 1.0 / singular[i];
      continue;
    }
    for (Index c = 0; c < causes; ++c)
      // 1e-6: a cause with a smaller component in the null direction is determined to six digits.
      if (std::abs(svd.V(c, i)) > 1e-6) result.is_undetermined[std::size_t(c)] = true;
  }
  const Eigen::MatrixXd estimator =
      svd.V * inverse.asDiagonal() * svd.U.transpose();  // applied to root times y
  const VectorXd x = estimator * root_of_weight.cwiseProduct(model.deviation);
  const VectorXd residuals = root_of_weight.cwiseProduct(model.deviation) - scaled * x;
  const double model_trace = relative_weight.dot((scaled * estimator).diagonal());
  const double freedom = relative_weight.sum() - model_trace;
  // With as many readings as causes the residuals carry no information about the noise.
  result.residual = freedom > 1e-9 ? std::sqrt(residuals.squaredNorm() / freedom) : 0.0;
  result.value = x.cwiseQuotient(norm);
  result.u = result.residual *
             (estimator * root_of_weight.asDiagonal()).rowwise().norm().cwiseQuotient(norm);
  return result;
}

}  // namespace

CircularResult circular(const CircularRuns& runs, const CircularOptions& options) {
  check(runs);
  const CircularPath anticlockwise = path_points(runs.anticlockwise),
                     clockwise = path_points(runs.clockwise);
  const CircularPath both_senses = concatenate(anticlockwise, clockwise);
  CircularResult result;
  result.circle = least_squares_circle(both_senses.points, both_senses.weights);
  // ISO 230-4 allows the least-squares centre for full circles only.
  const bool is_full =
      (anticlockwise.weights.size() == 0 || is_full_turn(runs.anticlockwise.angle)) &&
      (clockwise.weights.size() == 0 || is_full_turn(runs.clockwise.angle));
  if (options.centre == CircleCentre::LeastSquares && is_full) {
    result.centre = result.circle.centre;
    result.centre_kind = CircleCentre::LeastSquares;
  }
  const double R = runs.nominal_radius;
  result.D = result.circle.radius - R;
  if (anticlockwise.weights.size() > 0)
    result.anticlockwise = figures(anticlockwise, result.centre, R);
  if (clockwise.weights.size() > 0) result.clockwise = figures(clockwise, result.centre, R);
  if (!result.anticlockwise || !result.clockwise) return result;
  result.both = figures(both_senses, result.centre, R);
  result.H = hysteresis(runs, distances(anticlockwise.points, result.centre),
                        distances(clockwise.points, result.centre));
  return result;
}

int position_count(const CircularRuns& runs) {
  int count = 0;
  for (const CircularTrace* trace : {&runs.anticlockwise, &runs.clockwise}) {
    Eigen::MatrixX2d coordinates(trace->angle.size(), 2);
    coordinates << trace->angle.array().cos(), trace->angle.array().sin();
    count += int(std::lround(position_weights(coordinates, 1e-9).sum()));
  }
  return count;
}

CircularCauses circular_causes(const CircularRuns& runs, const CauseOptions& options) {
  check(runs);
  static_assert(Causes == circular_cause_count);
  const Deviations model = deviations(runs);
  const Index causes = options.is_lag_excluded ? Lag : Causes;
  if (position_count(runs) <= causes)
    throw std::invalid_argument("circular: expected more readings than causes");
  const Solution fit = solution(model, causes);
  CircularCauses result;
  result.residual = fit.residual;
  const std::array<std::optional<EstimatedValue>*, Causes> fields{
      &result.radius,     &result.centre_u,   &result.centre_v,   &result.scale,
      &result.squareness, &result.reversal_u, &result.reversal_v, &result.lag};
  for (Index c = 0; c < causes; ++c) {
    if (fit.is_undetermined[std::size_t(c)])
      result.undetermined.push_back(cause_names[std::size_t(c)]);
    else
      *fields[std::size_t(c)] = EstimatedValue{fit.value[c], fit.u[c]};
  }
  return result;
}

}  // namespace abbe::errors::metrology
