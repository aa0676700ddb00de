#include "errors/identification/design.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "errors/coefficients.h"
#include "errors/geometric.h"
#include "errors/metrology/readings.h"
#include "kinematics/decompositions.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/units.h"

namespace abbe::errors::identification {

using Eigen::Index;
using Eigen::VectorXd;
using kinematics::Chain;
using kinematics::Joint;
using metrology::Measurement;
using metrology::Readings;

namespace {

// 1e-9 mm or rad: machines read back from a file differ by the rounding of their decimals.
bool is_close(double a, double b) { return a == b || std::abs(a - b) <= 1e-9; }

bool is_same(const Joint& a, const Joint& b) {
  return a.name == b.name && a.side == b.side && a.motion == b.motion && is_close(a.min, b.min) &&
         is_close(a.max, b.max) && (a.direction_b - b.direction_b).norm() <= 1e-9 &&
         (a.point_b - b.point_b).norm() <= 1e-9 && a.deviation_axes == b.deviation_axes &&
         a.squareness == b.squareness;
}

bool is_same(const Chain& a, const Chain& b) {
  const auto poses_differ = [](const kinematics::Pose& S, const kinematics::Pose& T) {
    return (S.matrix() - T.matrix()).cwiseAbs().maxCoeff() > 1e-9;
  };
  if (a.size() != b.size() || poses_differ(a.T_bw_home(), b.T_bw_home()) ||
      poses_differ(a.T_bt_home(), b.T_bt_home()))
    return false;
  for (int i = 0; i < a.size(); ++i)
    if (!is_same(a.joints()[std::size_t(i)], b.joints()[std::size_t(i)])) return false;
  return true;
}

void check_readings_complete(const Readings& readings) {
  const metrology::Plan& plan = readings.plan;
  const auto throw_input_error = [&](Index i, const std::string& what) {
    throw std::invalid_argument(fmt::format("reading {} of {}: {}", i + 1, plan.instrument, what));
  };
  if (readings.value.size() != 0 && readings.value.size() != Index(plan.measurements.size()))
    throw std::invalid_argument(fmt::format("readings of {}: expected {} values, seen {}",
                                            plan.instrument, plan.measurements.size(),
                                            readings.value.size()));
  for (Index i = 0; i < readings.value.size(); ++i) {
    const Measurement& measurement = plan.measurements[std::size_t(i)];
    if (measurement.set_up < 0 || measurement.set_up >= int(plan.set_ups.size()))
      throw_input_error(i, fmt::format("set-up {} does not exist", measurement.set_up));
    const auto& channels = plan.set_ups[std::size_t(measurement.set_up)].channels;
    if (channels.empty()) continue;
    if (measurement.channel < 0 || measurement.channel >= int(channels.size()))
      throw_input_error(i, fmt::format("channel {} does not exist", measurement.channel));
    if (measurement.state.q.size() != readings.nominal.size() || !measurement.state.q.allFinite() ||
        !std::isfinite(measurement.state.time_s))
      throw_input_error(i, "expected one finite position per axis");
    if (!std::isfinite(readings.value[i])) throw_input_error(i, "expected a finite number");
    const double noise = metrology::standard_deviation(channels[std::size_t(measurement.channel)]);
    if (!std::isfinite(noise)) throw_input_error(i, "expected a finite noise");
  }
}

/// Checks the inputs of an identification.
/// @throws std::invalid_argument unless there are readings, all of one nominal machine, with one
///         finite value at every measurement, and a model of finite values without random curves
void check_readings(const GeometricErrors& model, std::span<const Readings> readings) {
  if (readings.empty()) throw std::invalid_argument("there are no readings");
  for (const Readings& r : readings) {
    check_readings_complete(r);
    if (!is_same(r.nominal, readings.front().nominal))
      throw std::invalid_argument(
          fmt::format("readings of {} and of {} come from different machines",
                      readings.front().plan.instrument, r.plan.instrument));
  }
  if (!values(model.elements).allFinite())
    throw std::invalid_argument("a starting value is not finite");
  for (const Element& element : model.elements)
    for (const Curve& curve : element.curves)
      if (is_random(curve))
        throw std::invalid_argument(to_string(element.name) +
                                    ": a random error cannot be identified");
}

/// Returns the instrument's name, numbered if several sets of readings share it.
std::string readings_label(std::span<const Readings> readings, std::size_t r) {
  const std::string& name = readings[r].plan.instrument;
  const auto same_name_count =
      std::count_if(readings.begin(), readings.end(),
                    [&](const Readings& other) { return other.plan.instrument == name; });
  return same_name_count > 1 ? fmt::format("{} (readings {})", name, r + 1) : name;
}

/// Returns the unknowns of a model and of the set-ups of all readings, with their names.
Unknowns model_unknowns(const GeometricErrors& model, std::span<const Readings> readings) {
  Unknowns result;
  result.coefficients = coefficients(model.elements);
  for (const Coefficient& coefficient : result.coefficients)
    result.names.push_back(name_of(coefficient, model.elements));
  for (std::size_t r = 0; r < readings.size(); ++r) {
    const auto& plan_set_ups = readings[r].plan.set_ups;
    for (std::size_t s = 0; s < plan_set_ups.size(); ++s) {
      const std::vector<metrology::SetUpUnknown> unknowns = metrology::unknowns(plan_set_ups[s]);
      result.set_ups.push_back({int(r), int(s), result.size(), int(unknowns.size())});
      for (const metrology::SetUpUnknown& unknown : unknowns)
        result.names.push_back(fmt::format("{}, {}: {}", readings_label(readings, r),
                                           plan_set_ups[s].name, unknown.name));
    }
  }
  return result;
}

/// Returns the block of unknowns of a set-up.
const Unknowns::SetUp& set_up_block(const Unknowns& unknowns, int readings, int set_up) {
  for (const Unknowns::SetUp& block : unknowns.set_ups)
    if (block.readings == readings && block.set_up == set_up) return block;
  throw std::logic_error("a set-up has no column");
}

}  // namespace

VectorXd start(const GeometricErrors& model, const Unknowns& unknowns) {
  VectorXd x = VectorXd::Zero(unknowns.size());
  x.head(Index(unknowns.coefficients.size())) = values(model.elements);
  return x;
}

std::vector<metrology::Misalignment> set_ups(std::span<const Readings> readings,
                                             const Unknowns& unknowns, const VectorXd& values) {
  std::vector<metrology::Misalignment> result;
  for (const Unknowns::SetUp& block : unknowns.set_ups)
    result.push_back(metrology::misalignment(
        readings[std::size_t(block.readings)].plan.set_ups[std::size_t(block.set_up)],
        values.segment(block.first, block.count)));
  return result;
}

namespace {

using Eigen::MatrixXd;
using kinematics::AxisState;
using kinematics::Deviation;
using kinematics::JointDeviation;
using metrology::BodyPoses;

constexpr double cancellation_limit = 1e-12;  // relative to the column without cancellation

/// Returns a row for every measurement of a channel.
std::vector<Row> channel_rows(std::span<const Readings> readings) {
  std::vector<Row> rows;
  for (std::size_t r = 0; r < readings.size(); ++r)
    for (Index i = 0; i < readings[r].value.size(); ++i) {
      const Measurement& measurement = readings[r].plan.measurements[std::size_t(i)];
      if (!readings[r].plan.set_ups[std::size_t(measurement.set_up)].channels.empty())
        rows.push_back({int(r), int(i)});
    }
  return rows;
}

/// Motion of the body carried by each joint, per unit of each component of the joint's deviation:
/// small motions [translation | rotation] about the bed's origin, in the bed frame.
struct BodyTwists {
  MatrixXd motion;    ///< (6 x 6 size)
  MatrixXd location;  ///< (6 x 6 size)
};

/// Returns the Jacobian of the body in the bed, from that of the tool in the workpiece. Columns of
/// workpiece joints change sign: a workpiece that moves one way appears as a tool that moves the
/// other way.
MatrixXd in_bed(const MatrixXd& J_wt, const Chain& chain, const BodyPoses& bodies) {
  const Eigen::Matrix3d R_bw = bodies.T_bw.linear();
  const Eigen::Matrix3d tip_b = kinematics::cross_matrix(bodies.T_bt.translation());
  MatrixXd result(6, J_wt.cols());
  result.bottomRows<3>() = R_bw * J_wt.bottomRows<3>();
  result.topRows<3>() = R_bw * J_wt.topRows<3>() + tip_b * result.bottomRows<3>();
  for (int j = 0; j < chain.size(); ++j)
    if (chain.joints()[std::size_t(j)].side == kinematics::Side::Workpiece)
      result.middleCols<6>(6 * j) *= -1.0;
  return result;
}

BodyTwists body_twists(const Chain& chain, const AxisState& state, const BodyPoses& bodies) {
  return {in_bed(kinematics::motion_jacobian(chain, state.q), chain, bodies),
          in_bed(kinematics::location_jacobian(chain, state.q), chain, bodies)};
}

/// Error element of constant value 1, bound together with the measuring lines, which transform it
/// like the element itself.
struct UnitElement {
  GeometricModel unit;
  int joint = 0;
  bool location = false;
  Index coefficient_count = 0;
};

/// Returns a unit element for every element of the model.
std::vector<UnitElement> unit_elements(const GeometricErrors& model, const Chain& chain) {
  std::vector<UnitElement> result;
  for (const Element& element : model.elements) {
    const GeometricErrors unit_errors{
        {{element.name, {Curve{Constant{1.0}}}}}, model.measuring_lines, {}};
    const GeometricModel unit = bind(unit_errors, chain);
    result.push_back({unit, unit.elements[0].joint, element.name.location,
                      Index(coefficients({element}).size())});
  }
  return result;
}

/// Constant inputs of all rows of the design matrix.
struct DesignInputs {
  const GeometricErrors& model;
  std::span<const Readings> readings;
  const Chain& chain;
  std::vector<UnitElement> elements;
  std::vector<VectorXd> since_s;  ///< (readings) time since set-up of every measurement
};

/// Change of one reading per unit of each coefficient. `uncancelled` is its magnitude if no terms
/// cancelled: far below it, a change is only rounding.
struct SensitivityRow {
  VectorXd change;
  VectorXd uncancelled;
};

/// Returns the change of a reading per unit of every coefficient, at zero deviations.
SensitivityRow sensitivity_row(const DesignInputs& inputs, const metrology::Channel& channel,
                               const AxisState& state, const BodyPoses& bodies, Index count) {
  const metrology::ReadingGradient gradient = metrology::gradient(channel, bodies);
  const BodyTwists twist = body_twists(inputs.chain, state, bodies);
  SensitivityRow row{VectorXd::Zero(count), VectorXd::Zero(count)};
  Index first = 0;
  for (std::size_t e = 0; e < inputs.elements.size(); ++e) {
    const UnitElement& element = inputs.elements[e];
    const Joint& joint = inputs.chain.joints()[std::size_t(element.joint)];
    const bool primed = joint.side == kinematics::Side::Workpiece;
    const Deviation& g = primed ? gradient.workpiece : gradient.tool;
    const JointDeviation unit = deviations(element.unit, state)[std::size_t(element.joint)];
    const MatrixXd& J = element.location ? twist.location : twist.motion;
    const Deviation body_motion =
        J.middleCols<6>(6 * element.joint) * (element.location ? unit.location : unit.motion);
    const double effect = g.dot(body_motion);
    const double lever_effect =
        g.head<3>().norm() * body_motion.tail<3>().norm();  // lever arm of 1 mm
    const double uncancelled = g.cwiseAbs().dot(body_motion.cwiseAbs()) + lever_effect;
    const CurveState argument = curve_state(element.unit, state, element.joint);
    for (const Curve& curve : inputs.model.elements[e].curves) {
      const VectorXd b = basis(curve, argument);
      row.change.segment(first, b.size()) = effect * b;
      row.uncancelled.segment(first, b.size()).setConstant(uncancelled * std::abs(curve.scale));
      first += b.size();
    }
  }
  return row;
}

/// Prior knowledge of coefficients.
struct Prior {
  std::vector<Index> unknown;  ///< (k) indices of the coefficients among the unknowns
  MatrixXd root;  ///< (k x k) its rows times the coefficients are in standard deviations
};

/// Returns the prior by the model's own covariance. Coefficients of zero variance are marked as not
/// sought in the design.
Prior model_prior(const GeometricErrors& model, Design& design) {
  const Covariance& covariance = model.covariance;
  const auto m = Index(covariance.of.size());
  if (covariance.matrix.rows() != m || covariance.matrix.cols() != m)
    throw std::invalid_argument(
        "the size of the covariance does not match the coefficients of the model");
  if (!covariance.matrix.allFinite())
    throw std::invalid_argument("the covariance of the model is not finite");
  Prior prior;
  std::vector<Index> uncertain;
  for (Index i = 0; i < m; ++i) {
    const auto& coefficients = design.unknowns.coefficients;
    const auto position =
        std::find(coefficients.begin(), coefficients.end(), covariance.of[std::size_t(i)]);
    if (position == coefficients.end())
      throw std::invalid_argument(
          "the covariance of the model refers to a coefficient that it does not have");
    if (covariance.matrix(i, i) == 0.0) {
      design.is_sought[std::size_t(position - coefficients.begin())] = 0;
    } else {
      uncertain.push_back(i);
      prior.unknown.push_back(position - coefficients.begin());
    }
  }
  if (uncertain.empty()) return prior;
  const MatrixXd covariance_block = covariance.matrix(uncertain, uncertain);
  // Scaling to unit variances first: mm and rad differ by orders of magnitude, which would cost
  // digits of the Cholesky factor.
  const VectorXd deviation = covariance_block.diagonal().cwiseSqrt();
  const VectorXd inverse = deviation.cwiseInverse();
  const Cholesky root = cholesky(inverse.asDiagonal() * covariance_block * inverse.asDiagonal());
  if (!deviation.allFinite() || !root.positive_definite)
    throw std::invalid_argument("the covariance of the model is not positive definite");
  prior.root = solve_lower(root.L, inverse.asDiagonal());
  return prior;
}

/// Adds the prior knowledge of coefficients and of the unknowns of set-ups.
void add_prior(const GeometricErrors& model, std::span<const Readings> readings, Design& design) {
  const Prior prior = model_prior(model, design);
  std::vector<std::pair<Index, double>> weighted_unknowns;  // of set-ups: index, weight
  for (const Unknowns::SetUp& block : design.unknowns.set_ups) {
    const auto& set_up =
        readings[std::size_t(block.readings)].plan.set_ups[std::size_t(block.set_up)];
    const std::vector<metrology::SetUpUnknown> list = metrology::unknowns(set_up);
    for (int i = 0; i < block.count; ++i)
      if (std::isfinite(list[std::size_t(i)].sigma))
        weighted_unknowns.emplace_back(block.first + i, 1.0 / list[std::size_t(i)].sigma);
  }
  const auto k = Index(prior.unknown.size());
  design.prior = MatrixXd::Zero(k + Index(weighted_unknowns.size()), design.unknowns.size());
  for (Index i = 0; i < k; ++i)
    design.prior.col(prior.unknown[std::size_t(i)]).head(k) = prior.root.col(i);
  for (std::size_t i = 0; i < weighted_unknowns.size(); ++i)
    design.prior(k + Index(i), weighted_unknowns[i].first) = weighted_unknowns[i].second;
}

}  // namespace

constexpr double max_design_entries = 2e8;  // entries of the design matrix, 1.6 GB

double weighting_sigma(const metrology::Channel& channel) {
  const double stated = metrology::standard_deviation(channel);
  // A channel without noise still needs a finite weight: 1 nm or 1 nrad.
  if (stated > 0.0) return stated;
  return channel.is_angle() ? 1e-9 : units::nm;
}

Design design(const GeometricErrors& model, std::span<const Readings> readings) {
  check_readings(model, readings);
  const Chain& chain = readings.front().nominal;
  bind(model, chain);  // throws with the name of an element that does not fit
  DesignInputs inputs{model, readings, chain, unit_elements(model, chain), {}};
  for (const Readings& r : readings) inputs.since_s.push_back(metrology::time_since_set_up(r.plan));

  Design result{model_unknowns(model, readings), channel_rows(readings), {}, {}, {}, {}, {}};
  const auto m = Index(result.rows.size());
  const Index n = result.unknowns.size();
  const auto p = Index(result.unknowns.coefficients.size());
  if (double(m) * double(n) > max_design_entries)
    throw std::invalid_argument(
        fmt::format("expected the product of readings and unknowns below {:.0e}, seen {} times {}",
                    max_design_entries, m, n));
  result.sigma.resize(m);
  result.A = MatrixXd::Zero(m, n);
  VectorXd uncancelled = VectorXd::Zero(p);
  for (Index i = 0; i < m; ++i) {
    const Row& row = result.rows[std::size_t(i)];
    const Readings& r = readings[std::size_t(row.readings)];
    const Measurement& measurement = r.plan.measurements[std::size_t(row.measurement)];
    const metrology::SetUp& set_up = r.plan.set_ups[std::size_t(measurement.set_up)];
    const metrology::Channel& channel = set_up.channels[std::size_t(measurement.channel)];
    const BodyPoses bodies = metrology::nominal_bodies(chain, measurement.state.q);
    const double weight = 1.0 / weighting_sigma(channel);
    result.sigma[i] = 1.0 / weight;
    const SensitivityRow sensitivity =
        sensitivity_row(inputs, channel, measurement.state, bodies, p);
    result.A.row(i).head(p) = weight * sensitivity.change;
    uncancelled += (weight * sensitivity.uncancelled).cwiseAbs2();
    const Unknowns::SetUp& block = set_up_block(result.unknowns, row.readings, measurement.set_up);
    const VectorXd change = metrology::unknowns_gradient(
        set_up, measurement.channel, bodies, metrology::spindle_angle(chain, measurement.state),
        inputs.since_s[std::size_t(row.readings)][row.measurement]);
    result.A.row(i).segment(block.first, block.count) = weight * change;
  }
  result.is_sought.assign(std::size_t(n), 1);
  result.is_unobservable.assign(std::size_t(n), 0);
  add_prior(model, readings, result);
  // A column of nothing but rounding would count as an observable direction, so it is set to zero.
  for (Index j = 0; j < n; ++j) {
    if (j < p && result.A.col(j).norm() <= cancellation_limit * std::sqrt(uncancelled[j]))
      result.A.col(j).setZero();
    if (!result.is_sought[std::size_t(j)] || !result.A.col(j).isZero(0.0) ||
        !result.prior.col(j).isZero(0.0))
      continue;
    result.is_unobservable[std::size_t(j)] = 1;
    result.is_sought[std::size_t(j)] = 0;
  }
  return result;
}

namespace {

/// Machine with the deviations of a model, for the prediction of readings.
struct DeviatedMachine {
  std::span<const Readings> readings;
  const Chain& chain;
  GeometricModel bound;
  std::vector<VectorXd> since_s;  ///< (readings) time since set-up of every measurement
  std::vector<std::size_t>
      first_set_up;  ///< (readings) index of its first set-up among those of all readings
};

DeviatedMachine deviated_machine(const GeometricErrors& model, std::span<const Readings> readings,
                                 const VectorXd& coefficient_values) {
  const Chain& chain = readings.front().nominal;
  DeviatedMachine result{
      readings,
      chain,
      bind({with_values(model.elements, coefficient_values), model.measuring_lines, {}}, chain),
      {},
      {}};
  std::size_t set_up_count = 0;
  for (const Readings& r : readings) {
    result.since_s.push_back(metrology::time_since_set_up(r.plan));
    result.first_set_up.push_back(set_up_count);
    set_up_count += r.plan.set_ups.size();
  }
  return result;
}

/// Model of the reading of one row, for any pose of the bodies and any misalignment.
struct RowReading {
  const Chain& chain;
  const Measurement& measurement;
  const metrology::SetUp& set_up;
  double since_s;
  BodyPoses nominal;

  BodyPoses bodies(const std::vector<JointDeviation>& D) const {
    return {chain.workpiece_in_bed(measurement.state.q, D),
            chain.tool_in_bed(measurement.state.q, D)};
  }
  double operator()(const BodyPoses& actual, const metrology::Misalignment& m) const {
    return metrology::reading(set_up, measurement.channel, m, actual, nominal,
                              metrology::spindle_angle(chain, measurement.state), since_s);
  }
};

RowReading row_reading(const DeviatedMachine& machine, const Row& row) {
  const auto r = std::size_t(row.readings);
  const metrology::Plan& plan = machine.readings[r].plan;
  const Measurement& measurement = plan.measurements[std::size_t(row.measurement)];
  return {machine.chain, measurement, plan.set_ups[std::size_t(measurement.set_up)],
          machine.since_s[r][row.measurement],
          metrology::nominal_bodies(machine.chain, measurement.state.q)};
}

/// Returns the index of the row's set-up among those of all readings.
std::size_t set_up_index(const DeviatedMachine& machine, const Row& row) {
  const auto r = std::size_t(row.readings);
  const metrology::Plan& plan = machine.readings[r].plan;
  return machine.first_set_up[r] +
         std::size_t(plan.measurements[std::size_t(row.measurement)].set_up);
}

}  // namespace

VectorXd predicted_readings(const GeometricErrors& model, std::span<const Readings> readings,
                            const Design& design, const VectorXd& unknowns) {
  const auto p = Index(design.unknowns.coefficients.size());
  const DeviatedMachine machine = deviated_machine(model, readings, unknowns.head(p));
  const std::vector<metrology::Misalignment> misalignments =
      set_ups(readings, design.unknowns, unknowns);
  VectorXd result(Index(design.rows.size()));
  for (Index i = 0; i < result.size(); ++i) {
    const Row& row = design.rows[std::size_t(i)];
    const RowReading reading = row_reading(machine, row);
    const BodyPoses actual = reading.bodies(deviations(machine.bound, reading.measurement.state));
    result[i] = reading(actual, misalignments[set_up_index(machine, row)]);
  }
  return result;
}

namespace {

constexpr double difference_step =
    1e-4;  // step of the central differences: mm, rad, relative, mm/s;
           // truncation and rounding stay below 1e-6 of a lever arm of 600 mm

/// Returns the poses of the bodies with one joint's deviation changed. Only the body on the joint's
/// side of the bed is computed anew.
BodyPoses bodies_with_deviation(const RowReading& reading, BodyPoses actual,
                                std::vector<JointDeviation> D, int joint,
                                const JointDeviation& unit, double amount) {
  JointDeviation& changed = D[std::size_t(joint)];
  changed.motion += amount * unit.motion;
  changed.location += amount * unit.location;
  const auto& q = reading.measurement.state.q;
  if (reading.chain.joints()[std::size_t(joint)].side == kinematics::Side::Workpiece) {
    actual.T_bw = reading.chain.workpiece_in_bed(q, D);
  } else {
    actual.T_bt = reading.chain.tool_in_bed(q, D);
  }
  return actual;
}

bool is_any_sought(const std::vector<char>& is_sought, Index first, Index count) {
  const auto begin = is_sought.begin() + first;
  return std::any_of(begin, begin + count, [](char flag) { return flag != 0; });
}

/// Returns the change of one reading per unit of each coefficient; 0 for those not sought.
VectorXd coefficient_sensitivities(const DesignInputs& inputs, const Design& design,
                                   const RowReading& reading, const std::vector<JointDeviation>& D,
                                   const metrology::Misalignment& m) {
  const BodyPoses actual = reading.bodies(D);
  VectorXd change = VectorXd::Zero(Index(design.unknowns.coefficients.size()));
  Index index = 0;
  for (std::size_t e = 0; e < inputs.elements.size(); ++e) {
    const UnitElement& element = inputs.elements[e];
    if (!is_any_sought(design.is_sought, index, element.coefficient_count)) {
      index += element.coefficient_count;
      continue;
    }
    const JointDeviation unit =
        deviations(element.unit, reading.measurement.state)[std::size_t(element.joint)];
    const auto reading_at = [&](double amount) {
      return reading(bodies_with_deviation(reading, actual, D, element.joint, unit, amount), m);
    };
    const double effect =
        (reading_at(difference_step) - reading_at(-difference_step)) / (2.0 * difference_step);
    const CurveState argument = curve_state(element.unit, reading.measurement.state, element.joint);
    for (const Curve& curve : inputs.model.elements[e].curves) {
      const VectorXd b = basis(curve, argument);
      for (Index k = 0; k < b.size(); ++k, ++index)
        if (design.is_sought[std::size_t(index)]) change[index] = effect * b[k];
    }
  }
  return change;
}

/// Returns the change of one reading per unit of each unknown of its set-up.
VectorXd set_up_sensitivities(const RowReading& reading, const std::vector<JointDeviation>& D,
                              const VectorXd& values) {
  const BodyPoses actual = reading.bodies(D);
  VectorXd change(values.size());
  for (Index k = 0; k < values.size(); ++k) {
    const auto reading_at = [&](double amount) {
      VectorXd unknowns = values;
      unknowns[k] += amount;
      return reading(actual, metrology::misalignment(reading.set_up, unknowns));
    };
    change[k] =
        (reading_at(difference_step) - reading_at(-difference_step)) / (2.0 * difference_step);
  }
  return change;
}

}  // namespace

Design design_at(Design design, const GeometricErrors& model, std::span<const Readings> readings,
                 const VectorXd& unknowns) {
  const auto p = Index(design.unknowns.coefficients.size());
  const DeviatedMachine machine = deviated_machine(model, readings, unknowns.head(p));
  const DesignInputs inputs{
      model, readings, machine.chain, unit_elements(model, machine.chain), {}};
  const std::vector<metrology::Misalignment> misalignments =
      set_ups(readings, design.unknowns, unknowns);
  for (Index i = 0; i < Index(design.rows.size()); ++i) {
    const Row& row = design.rows[std::size_t(i)];
    const RowReading reading = row_reading(machine, row);
    const std::vector<JointDeviation> D = deviations(machine.bound, reading.measurement.state);
    const std::size_t set_up = set_up_index(machine, row);
    const double weight = 1.0 / design.sigma[i];
    design.A.row(i).head(p) =
        weight * coefficient_sensitivities(inputs, design, reading, D, misalignments[set_up]);
    const Unknowns::SetUp& block = design.unknowns.set_ups[set_up];
    design.A.row(i).segment(block.first, block.count) =
        weight * set_up_sensitivities(reading, D, unknowns.segment(block.first, block.count));
  }
  return design;
}

VectorXd observed_readings(std::span<const Readings> readings, const Design& design) {
  VectorXd result(Index(design.rows.size()));
  for (Index i = 0; i < result.size(); ++i) {
    const Row& row = design.rows[std::size_t(i)];
    result[i] = readings[std::size_t(row.readings)].value[row.measurement];
  }
  return result;
}

}  // namespace abbe::errors::identification
