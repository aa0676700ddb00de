#include "errors/identification/step_diagonal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "errors/coefficients.h"
#include "errors/element.h"
#include "errors/identification/design.h"
#include "errors/metrology/readings.h"
#include "kinematics/chain.h"
#include "kinematics/decompositions.h"
#include "kinematics/units.h"

namespace abbe::errors::identification {

using Eigen::Index;
using Eigen::Vector3d;
using kinematics::Chain;
using kinematics::Joint;
using metrology::Measurement;
using metrology::Readings;

namespace {

constexpr std::array<char, 3> slides = {'X', 'Y', 'Z'};

/// Leg of a diagonal: the motion of one axis over one interval between step positions, with the two
/// readings at its ends.
struct StepLeg {
  int axis = 0;                 ///< 0 1 2
  int interval = 0;             ///< index of the interval among those of the axis
  int diagonal = 0;             ///< index of the set-up
  Eigen::Vector3d sensitivity;  ///< change of reading per mm by which the displacement error grows
                                ///< from the lower to the upper step position, by component
  Eigen::Index from = 0;        ///< index of the reading before the motion
  Eigen::Index to = 0;          ///< index of the reading after it
};

/// Step positions of X, Y and Z, mm, ascending.
using Steps = std::array<std::vector<double>, 3>;

/// Legs of four step diagonals, with the step positions that they share.
struct StepPath {
  Steps steps;
  std::vector<StepLeg> legs;
};

/// Throws std::invalid_argument with "step diagonal: " and the reason.
[[noreturn]] void throw_diagonal_error(const std::string& reason) {
  throw std::invalid_argument("step diagonal: " + reason);
}

// mm; commanded positions that differ by less are the same step position
constexpr double position_tolerance = 1e-6;

void check_diagonals(const Readings& readings) {
  const metrology::Plan& plan = readings.plan;
  if (plan.set_ups.size() != 4)
    throw_diagonal_error(fmt::format("expected four diagonals, seen {}", plan.set_ups.size()));
  for (const metrology::SetUp& set_up : plan.set_ups)
    if (set_up.channels.size() != 1 || set_up.channels[0].is_angle() ||
        set_up.channels[0].quantity == metrology::Quantity::Length)
      throw_diagonal_error("expected one beam along each diagonal");
  if (plan.measurements.empty() || readings.value.size() != Index(plan.measurements.size()) ||
      !readings.value.allFinite())
    throw_diagonal_error("expected one finite reading per measurement");
  for (const Measurement& measurement : plan.measurements)
    if (measurement.set_up < 0 || measurement.set_up > 3 || measurement.channel != 0 ||
        measurement.state.q.size() != readings.nominal.size())
      throw_diagonal_error("expected measurements along four diagonals");
}

int joint_index(const Chain& chain, int axis) { return *chain.find(slides[std::size_t(axis)]); }

/// Returns the slide (0 1 2) that moved between two states; -1 unless one slide and no other axis
/// moved.
int moved_slide(const Chain& chain, const kinematics::AxisVector& a,
                const kinematics::AxisVector& b) {
  int moving_axis = -1;
  for (int j = 0; j < chain.size(); ++j) {
    if (std::abs(b[j] - a[j]) <= position_tolerance) continue;
    int axis = 0;
    while (axis < 3 && joint_index(chain, axis) != j) ++axis;
    if (moving_axis >= 0 || axis == 3) return -1;
    moving_axis = axis;
  }
  return moving_axis;
}

/// Inserts a step position in ascending order unless it exists.
void add_step_position(std::vector<double>& positions, double q) {
  const auto position =
      std::lower_bound(positions.begin(), positions.end(), q - position_tolerance);
  if (position == positions.end() || *position > q + position_tolerance)
    positions.insert(position, q);
}

/// Returns the index of the interval between two neighbouring step positions.
int step_interval(const std::vector<double>& positions, double a, double b) {
  const double low = std::min(a, b);
  const auto lower = std::lower_bound(positions.begin(), positions.end(), low - position_tolerance);
  const auto upper = lower + 1;
  if (upper == positions.end() || std::abs(*upper - std::max(a, b)) > position_tolerance)
    throw_diagonal_error("expected the same steps on every diagonal");
  return int(lower - positions.begin());
}

/// Returns the slide X, Y or Z of a chain.
/// @param axis  0 1 2
/// @throws std::invalid_argument if the chain lacks it or it does not travel along that bed axis
Joint slide(const Chain& chain, int axis) {
  const auto joint = chain.find(slides[std::size_t(axis)]);
  if (!joint) throw_diagonal_error(fmt::format("expected a slide {}", slides[std::size_t(axis)]));
  const Joint& j = chain.joints()[std::size_t(*joint)];
  if (j.motion != kinematics::Motion::Linear ||
      (j.direction_b - Vector3d::Unit(axis)).norm() > 1e-9)
    throw_diagonal_error(fmt::format("expected {} parallel to the machine axis of its name",
                                     slides[std::size_t(axis)]));
  return j;
}

/// Returns the legs along which readings were taken.
/// @throws std::invalid_argument unless the readings are finite and belong to four diagonals with
///         the same step positions, each one step of X, Y or Z after the one before
StepPath step_path(const Readings& readings) {
  check_diagonals(readings);
  const Chain& chain = readings.nominal;
  const std::vector<Measurement>& measurements = readings.plan.measurements;
  std::array<Joint, 3> joints = {slide(chain, 0), slide(chain, 1), slide(chain, 2)};
  std::map<std::pair<int, int>, std::size_t> last_reading;  // of each set-up and run
  std::vector<std::pair<std::size_t, std::size_t>> reading_pairs;
  StepPath path;
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis)
      add_step_position(path.steps[std::size_t(axis)],
                        measurements[i].state.q[joint_index(chain, axis)]);
    const auto previous = last_reading.find({measurements[i].set_up, measurements[i].run});
    if (previous != last_reading.end()) reading_pairs.emplace_back(previous->second, i);
    last_reading[{measurements[i].set_up, measurements[i].run}] = i;
  }
  for (const auto& [from, to] : reading_pairs) {
    const auto& q_from = measurements[from].state.q;
    const auto& q_to = measurements[to].state.q;
    const int axis = moved_slide(chain, q_from, q_to);
    if (axis < 0) throw_diagonal_error("expected readings that are one step in X, Y or Z apart");
    const int j = joint_index(chain, axis);
    const metrology::Channel& channel =
        readings.plan.set_ups[std::size_t(measurements[to].set_up)].channels[0];
    const metrology::ReadingGradient g =
        metrology::gradient(channel, metrology::nominal_bodies(chain, q_to));
    const bool primed = joints[std::size_t(axis)].side == kinematics::Side::Workpiece;
    const Vector3d direction = primed ? g.workpiece.head<3>() : g.tool.head<3>();
    const double sense = q_to[j] > q_from[j] ? 1.0 : -1.0;
    path.legs.push_back({axis, step_interval(path.steps[std::size_t(axis)], q_from[j], q_to[j]),
                         measurements[to].set_up, sense * direction, Index(from), Index(to)});
  }
  return path;
}

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Returns the readings (measurements) of a machine with these errors in perfect set-ups.
VectorXd perfect_readings(const Readings& readings, const GeometricErrors& errors) {
  const Chain& chain = readings.nominal;
  const GeometricModel model = bind(errors, chain);
  VectorXd result(readings.value.size());
  for (Index i = 0; i < result.size(); ++i) {
    const Measurement& measurement = readings.plan.measurements[std::size_t(i)];
    const auto& q = measurement.state.q;
    const std::vector<kinematics::JointDeviation> D = deviations(model, measurement.state);
    result[i] = metrology::reading(readings.plan.set_ups[std::size_t(measurement.set_up)], 0, {},
                                   {chain.workpiece_in_bed(q, D), chain.tool_in_bed(q, D)},
                                   metrology::nominal_bodies(chain, q));
  }
  return result;
}

/// Linear estimator of the growth of the displacement errors over each interval. It is a matrix
/// that acts on the readings, so that it also propagates their covariance.
struct LinearEstimator {
  MatrixXd increments;  ///< (3 intervals x readings) components x y z of each interval
  MatrixXd contrast;    ///< (intervals x readings) zero if all errors are translations
};

/// Returns the estimator for the legs of four diagonals.
LinearEstimator linear_estimator(const StepPath& path, Index readings) {
  std::array<Index, 3> first_interval{};
  Index intervals = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    first_interval[axis] = intervals;
    intervals += Index(path.steps[axis].size()) - 1;
  }
  std::vector<std::vector<const StepLeg*>> legs(static_cast<std::size_t>(intervals));
  for (const StepLeg& leg : path.legs)
    legs[std::size_t(first_interval[std::size_t(leg.axis)] + leg.interval)].push_back(&leg);

  LinearEstimator result{MatrixXd::Zero(3 * intervals, readings),
                         MatrixXd::Zero(intervals, readings)};
  for (Index k = 0; k < intervals; ++k) {
    Eigen::Matrix<double, 4, 3> N = Eigen::Matrix<double, 4, 3>::Zero();
    Eigen::Vector4d count = Eigen::Vector4d::Zero();
    for (const StepLeg* leg : legs[std::size_t(k)]) {
      N.row(leg->diagonal) = leg->sensitivity.transpose();
      count[leg->diagonal] += 1.0;
    }
    if (count.minCoeff() == 0.0) throw_diagonal_error("expected the same steps on every diagonal");
    // Four diagonals measure three components, so the fourth left singular vector is a combination
    // of readings that no translation changes: the contrast.
    const SingularValues svd = singular_values(N, Eigen::ComputeFullU | Eigen::ComputeThinV);
    // 1e-3: the diagonals of a box a thousand times longer than high no longer resolve the
    // component along its height.
    if (svd.values[2] < 1e-3 * svd.values[0])
      throw_diagonal_error("expected diagonals that span three directions");
    const MatrixXd inverse =
        svd.V * svd.values.cwiseInverse().asDiagonal() * svd.U.leftCols(3).transpose();
    for (const StepLeg* leg : legs[std::size_t(k)]) {
      const double weight_of_leg = 1.0 / count[leg->diagonal];
      const VectorXd column = weight_of_leg * inverse.col(leg->diagonal);
      result.increments.col(leg->to).segment<3>(3 * k) += column;
      result.increments.col(leg->from).segment<3>(3 * k) -= column;
      const double contrast_weight = weight_of_leg * svd.U(leg->diagonal, 3);
      result.contrast(k, leg->to) += contrast_weight;
      result.contrast(k, leg->from) -= contrast_weight;
    }
  }
  return result;
}

/// Returns weights w such that w . values is the least-squares slope of values over q.
VectorXd slope_weights(const VectorXd& q) {
  const VectorXd dq = q.array() - q.mean();
  return dq / dq.squaredNorm();
}

ElementName axis_element(int component, int axis) {
  return {slides[std::size_t(component)], slides[std::size_t(axis)], false};
}

/// Linear maps from the readings to the nine displacement errors at their step positions, and to
/// the three squarenesses. The least-squares line of a straightness is removed from it; its slope
/// counts as squareness.
struct Curves {
  std::array<VectorXd, 3> q;
  std::array<std::array<MatrixXd, 3>, 3> rows;  ///< [axis][component] (steps x readings)
  MatrixXd squareness;                          ///< (3 x readings) EC0Y, EB0Z, EA0Z
};

const std::array<ElementName, 3> identified_squarenesses = {
    ElementName{'C', 'Y', true}, ElementName{'B', 'Z', true}, ElementName{'A', 'Z', true}};

/// Integrates the growth over the intervals, and separates the squarenesses.
Curves curves(const StepPath& path, const LinearEstimator& estimator, const Chain& chain) {
  const Index readings = estimator.increments.cols();
  Curves result;
  result.squareness = MatrixXd::Zero(3, readings);
  Index first = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<double>& steps = path.steps[std::size_t(axis)];
    const auto n = Index(steps.size());
    const VectorXd q = VectorXd::Map(steps.data(), n);
    result.q[std::size_t(axis)] = q;
    const double travel = kinematics::carriage_travel(slide(chain, axis).side, 1.0);
    for (int component = 0; component < 3; ++component) {
      MatrixXd rows = MatrixXd::Zero(n, readings);
      for (Index i = 1; i < n; ++i)
        rows.row(i) = rows.row(i - 1) + estimator.increments.row(3 * (first + i - 1) + component);
      if (component != axis) {
        const Eigen::RowVectorXd slope = slope_weights(q).transpose() * rows;
        const Eigen::RowVectorXd mean = rows.colwise().mean();
        rows -= (q.array() - q.mean()).matrix() * slope;
        rows.rowwise() -= mean;
        for (const SquarenessContribution& contribution :
             to_squareness_errors(axis_element(component, axis), 1.0, chain.joints()))
          for (std::size_t s = 0; s < 3; ++s)
            if (identified_squarenesses[s] == contribution.name)
              result.squareness.row(Index(s)) += contribution.value * travel * slope;
      }
      result.rows[std::size_t(axis)][std::size_t(component)] = rows;
    }
    first += n - 1;
  }
  return result;
}

/// Second-order effects of a tilted direction of travel. A direction tilted by theta deviates
/// sideways by sin(theta) per mm of travel, the slope, and loses 1 - cos(theta) of its travel.
struct TravelTilt {
  double angle_per_slope = 1.0;  ///< theta / sin(theta)
  double shortening = 0.0;       ///< 1 - cos(theta)
};
TravelTilt travel_tilt(double slope) {
  if (slope == 0.0) return {};
  const double angle = std::asin(std::min(slope, 1.0));
  return {angle / slope, 2.0 * std::pow(std::sin(0.5 * angle), 2)};
}

/// Returns the 12 elements with their covariance.
GeometricErrors estimated_belief(const Curves& curves, const VectorXd& y, const VectorXd& sigma,
                                 const Chain& chain) {
  const Vector3d slope = curves.squareness * y;
  const std::array<TravelTilt, 3> tilt = {TravelTilt{}, travel_tilt(std::abs(slope[0])),
                                          travel_tilt(std::hypot(slope[1], slope[2]))};
  GeometricErrors belief;
  std::vector<MatrixXd> rows;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double travel = kinematics::carriage_travel(slide(chain, int(axis)).side, 1.0);
    for (std::size_t component = 0; component < 3; ++component) {
      const MatrixXd& r = curves.rows[axis][component];
      VectorXd value = r * y;
      if (component == axis) {
        value += travel * tilt[axis].shortening * curves.q[axis];
        value.array() -= value[0];
      }
      belief.elements.push_back(
          {axis_element(int(component), int(axis)), {Curve{make_table(curves.q[axis], value)}}});
      rows.push_back(r);
    }
  }
  for (std::size_t s = 0; s < 3; ++s) {
    const double value = slope[Index(s)] * tilt[s == 0 ? 1 : 2].angle_per_slope;
    belief.elements.push_back({identified_squarenesses[s], {Curve{Constant{value}}}});
    rows.push_back(curves.squareness.row(Index(s)));
  }
  belief.covariance.of = coefficients(belief.elements);
  MatrixXd all_rows(Index(belief.covariance.of.size()), y.size());
  Index first_row = 0;
  for (const MatrixXd& r : rows) {
    all_rows.middleRows(first_row, r.rows()) = r;
    first_row += r.rows();
  }
  const MatrixXd weighted = all_rows * sigma.asDiagonal();
  belief.covariance.matrix = weighted * weighted.transpose();
  return belief;
}

/// Returns the chi-square that chance exceeds once in a thousand times (Wilson and Hilferty 1931).
/// @param freedom  degrees of freedom
double critical_chi_square(double freedom) {
  const double t = 2.0 / (9.0 * freedom);
  return freedom * std::pow(1.0 - t + 3.0902 * std::sqrt(t), 3);
}

/// Test of the contrasts against zero: without angular errors they contain only noise.
struct Contradiction {
  double chi_square = 0.0;
  double freedom = 0.0;  ///< degrees of freedom
  bool is_significant() const { return freedom > 0.0 && chi_square > critical_chi_square(freedom); }
};

/// Returns the test of contrasts of readings y with standard deviations sigma.
Contradiction contradiction(const MatrixXd& contrast, const VectorXd& y, const VectorXd& sigma) {
  if (contrast.rows() == 0) return {};
  const MatrixXd weighted = contrast * sigma.asDiagonal();
  const VectorXd k = contrast * y;
  return {k.dot(solve_positive(weighted * weighted.transpose(), k)), double(k.size())};
}

/// Matrices that split the contrasts of all intervals into their mean over each axis and their
/// changes from one interval to the next.
struct ContrastSplit {
  MatrixXd steady;   ///< (3 x intervals)
  MatrixXd varying;  ///< (intervals - 3 x intervals)
};

ContrastSplit split_contrasts(const Steps& steps) {
  std::array<Index, 3> n{};
  Index intervals = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) intervals += n[axis] = Index(steps[axis].size()) - 1;
  ContrastSplit result{MatrixXd::Zero(3, intervals), MatrixXd::Zero(intervals - 3, intervals)};
  Index first = 0;
  Index row = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.steady.row(Index(axis)).segment(first, n[axis]).setConstant(1.0 / double(n[axis]));
    for (Index i = 1; i < n[axis]; ++i, ++row) {
      result.varying(row, first + i) = 1.0;
      result.varying(row, first + i - 1) = -1.0;
    }
    first += n[axis];
  }
  return result;
}

std::vector<std::string> contradiction_warnings(const Steps& steps, const MatrixXd& contrast,
                                                const VectorXd& y, const VectorXd& sigma) {
  const ContrastSplit split = split_contrasts(steps);
  const Contradiction overall = contradiction(contrast, y, sigma);
  const Contradiction steady = contradiction(split.steady * contrast, y, sigma);
  const Contradiction varying = contradiction(split.varying * contrast, y, sigma);
  const auto chi_square_text = [](const Contradiction& c) {
    return fmt::format("(chi-square {:.4g} for {:.0f} degrees of freedom, significant)",
                       c.chi_square, c.freedom);
  };
  std::vector<std::string> result;
  if (varying.is_significant())
    result.push_back("the contradiction between the four diagonals varies from step to step " +
                     chi_square_text(varying) +
                     ": the axes are likely to have angular errors, and the 12 elements are wrong");
  if (steady.is_significant())
    result.push_back("the contradiction between the four diagonals is the same at every step " +
                     chi_square_text(steady) +
                     ": a misaligned mirror or beam, or a constant angular error, is likely, and "
                     "the 12 elements are wrong");
  if (result.empty() && overall.is_significant())
    result.push_back("the four diagonals contradict each other " + chi_square_text(overall) +
                     ": the 12 elements are doubtful");
  return result;
}

/// Returns a single angular error that grows linearly over the steps of its axis.
/// @param angle  rad, at the last step
GeometricErrors linear_angular_error(const ElementName& name, const std::vector<double>& steps,
                                     double angle) {
  const double length = steps.back() - steps.front();
  const Polynomial line{(VectorXd(2) << 0.0, angle).finished(), steps.front(), length};
  return {{{name, {Curve{line}}}}, {}, {}};
}

/// Returns the largest magnitude, mm, of any of the nine displacement errors for these readings.
double largest_value(const Curves& curves, const VectorXd& y) {
  double largest = 0.0;
  for (const auto& axis : curves.rows)
    for (const MatrixXd& rows : axis) largest = std::max(largest, (rows * y).cwiseAbs().maxCoeff());
  return largest;
}

/// Returns a warning that names the angular errors which cause no contradiction, or nothing if
/// there are none. Each error is applied alone to the nominal machine.
std::string angular_caution(const Readings& readings, const StepPath& path,
                            const MatrixXd& contrast, const Curves& curves) {
  // Typical pitch or yaw of a machine tool. The effect is linear, so this value only scales the
  // effect stated in the message.
  constexpr double angle = 20.0 * units::urad;
  const VectorXd perfect = perfect_readings(readings, {});
  std::string hidden_names;
  double max_effect = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const char about : {'A', 'B', 'C'}) {
      const ElementName name{about, slides[axis], false};
      const VectorXd y =
          perfect_readings(readings, linear_angular_error(name, path.steps[axis], angle)) - perfect;
      const double effect = largest_value(curves, y);
      const double max_contrast = (contrast * y).cwiseAbs().maxCoeff();
      // An effect below 1 nm does not matter. A contrast per step below 1 % of the effect does not
      // reveal the error.
      if (effect < units::nm || max_contrast > 1e-2 * effect / double(path.steps[axis].size()))
        continue;
      hidden_names += " " + to_string(name);
      max_effect = std::max(max_effect, effect);
    }
  if (hidden_names.empty()) return "";
  return fmt::format(
      "20 urad of{}, increasing along the axis, would not show in these readings and would distort "
      "the elements by up to {:.2f} um",
      hidden_names, max_effect / units::um);
}

/// Values of one result that are fitted over temperature.
struct TrendValues {
  std::vector<std::string> names;
  std::vector<bool> is_length;
  std::vector<double> value;
};

/// Returns the values of a result that are fitted over temperature.
TrendValues trend_values(const GeometricErrors& belief) {
  TrendValues result;
  for (const Element& element : belief.elements) {
    const std::string name = to_string(element.name);
    const Shape& shape = element.curves.at(0).shape;
    const auto* table = std::get_if<Table>(&shape);
    if (element.name.location) {
      result.names.push_back(name);
      result.value.push_back(std::get<Constant>(shape).value);
    } else if (element.name.direction == element.name.axis) {
      result.names.push_back(name + " slope");
      result.value.push_back(slope_weights(table->q).dot(table->value));
    } else {
      for (Index i = 0; i < table->value.size(); ++i) {
        result.names.push_back(fmt::format("{}[{}]", name, i));
        result.value.push_back(table->value[i]);
      }
    }
    result.is_length.resize(result.names.size(),
                            !element.name.location && element.name.direction != element.name.axis);
  }
  return result;
}

}  // namespace

StepDiagonal step_diagonal(const Readings& readings) {
  const StepPath path = step_path(readings);
  const LinearEstimator estimator = linear_estimator(path, readings.value.size());
  const VectorXd y = readings.value - perfect_readings(readings, {});
  VectorXd sigma(y.size());
  for (Index i = 0; i < y.size(); ++i) {
    const Measurement& measurement = readings.plan.measurements[std::size_t(i)];
    sigma[i] = weighting_sigma(readings.plan.set_ups[std::size_t(measurement.set_up)]
                                   .channels[std::size_t(measurement.channel)]);
  }
  StepDiagonal result;
  const Curves estimated_curves = curves(path, estimator, readings.nominal);
  result.belief = estimated_belief(estimated_curves, y, sigma, readings.nominal);
  result.warnings = contradiction_warnings(path.steps, estimator.contrast, y, sigma);
  result.caution = angular_caution(readings, path, estimator.contrast, estimated_curves);
  const Contradiction overall = contradiction(estimator.contrast, y, sigma);
  result.reduced_chi_square = overall.chi_square / overall.freedom;
  return result;
}

StepDiagonalTrend step_diagonal_trend(std::span<const StepDiagonal> results, const MatrixXd& dT_K) {
  const auto m = Index(results.size());
  const Index k = dT_K.cols();
  if (dT_K.rows() != m || !dT_K.allFinite())
    throw_diagonal_error("expected one row of finite temperatures for each result");
  if (m < k + 1)
    throw_diagonal_error(
        fmt::format("expected at least {} results for {} temperatures, seen {}", k + 1, k, m));
  StepDiagonalTrend trend;
  MatrixXd values;
  for (Index i = 0; i < m; ++i) {
    const TrendValues q = trend_values(results[std::size_t(i)].belief);
    if (i == 0) {
      trend.names = q.names;
      trend.is_length = q.is_length;
      values.resize(m, Index(q.names.size()));
    }
    if (q.names != trend.names) throw_diagonal_error("expected results over the same steps");
    values.row(i) = VectorXd::Map(q.value.data(), Index(q.value.size())).transpose();
  }
  MatrixXd A(m, k + 1);
  A << VectorXd::Ones(m), dT_K;
  const VectorXd norm = A.colwise().norm().cwiseMax(std::numeric_limits<double>::min());
  const MatrixXd scaled = A * norm.cwiseInverse().asDiagonal();
  const auto fit = least_squares(scaled, values, 1e-9);
  if (fit.rank < k + 1)
    throw_diagonal_error("the temperatures do not vary enough to separate their slopes");
  const MatrixXd coefficients = norm.cwiseInverse().asDiagonal() * fit.x;
  trend.at_zero = coefficients.row(0).transpose();
  trend.per_K = coefficients.bottomRows(k).transpose();
  if (m == k + 1) return trend;
  const VectorXd variance =
      (values - A * coefficients).colwise().squaredNorm().transpose() / double(m - k - 1);
  const VectorXd inverse =
      solve_semidefinite(MatrixXd(A.transpose() * A), MatrixXd(MatrixXd::Identity(k + 1, k + 1)))
          .diagonal();
  trend.per_K_sigma = variance.cwiseSqrt() * inverse.tail(k).cwiseSqrt().transpose();
  return trend;
}

}  // namespace abbe::errors::identification
