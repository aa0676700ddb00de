#include "errors/metrology/readings.h"

#include <cassert>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "errors/curve.h"

namespace abbe::errors::metrology {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::Deviation;
using kinematics::Pose;

Pose body_pose(Body body, const BodyPoses& bodies) {
  if (body == Body::Bed) return Pose::Identity();
  return body == Body::Workpiece ? bodies.T_bw : bodies.T_bt;
}

/// Returns the displacement of an eccentric ball, rotated about z of the tool by the spindle angle.
Vector3d rotated_eccentricity(const Eigen::Vector2d& eccentricity, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * eccentricity.x() - s * eccentricity.y(), s * eccentricity.x() + c * eccentricity.y(),
          0.0};
}

/// Returns the two directions about which a rotation of the mirror has an effect.
Eigen::Matrix<double, 3, 2> mirror_rotations(const SetUp& set_up) {
  for (const Channel& channel : set_up.channels)
    if (channel.quantity == Quantity::Mirror) return perpendicular_basis(channel.normal_of);
  return perpendicular_basis(Vector3d::UnitX());
}

/// Geometry of a reading.
struct SightLine {
  Vector3d offset;        ///< p - p_in, in the frame of `in`
  Vector3d direction_in;  ///< u
  Vector3d normal_in;     ///< of the mirror in its current position
};

/// Returns the value of a channel other than an angle, without errors of scale, zero and drift.
double ideal_value(const Channel& channel, const SightLine& sight) {
  switch (channel.quantity) {
    case Quantity::Length:
      return sight.offset.norm();
    case Quantity::Displacement:
      return sight.direction_in.dot(sight.offset);
    case Quantity::Mirror:
      return sight.normal_in.dot(sight.offset) / sight.normal_in.dot(sight.direction_in);
    case Quantity::Angle:
      break;
  }
  assert(false && "an angle has no points");
  return 0.0;
}

/// Derivatives of a value with respect to p, u and n, in the frame of `in`.
struct ValueGradient {
  Vector3d point = Vector3d::Zero();
  Vector3d direction = Vector3d::Zero();
  Vector3d normal = Vector3d::Zero();
};

/// Returns the gradient of a value; zero for an angle.
ValueGradient value_gradient(const Channel& channel, const SightLine& sight) {
  ValueGradient s;
  switch (channel.quantity) {
    case Quantity::Length: {
      const double length = sight.offset.norm();
      if (length > 0.0) s.point = sight.offset / length;
      // At length 0 the derivative is undefined and stays 0.
      break;
    }
    case Quantity::Displacement:
      s.point = sight.direction_in;
      s.direction = sight.offset;
      break;
    case Quantity::Mirror: {
      const double cosine = sight.normal_in.dot(sight.direction_in);
      const double value = sight.normal_in.dot(sight.offset) / cosine;
      s.point = sight.normal_in / cosine;
      s.direction = -value * sight.normal_in / cosine;
      s.normal = (sight.offset - value * sight.direction_in) / cosine;
      break;
    }
    case Quantity::Angle:
      break;
  }
  return s;
}

/// Returns the geometry of a perfect set-up.
SightLine nominal_sight(const Channel& channel, const Pose& T_of_in) {
  return {T_of_in * channel.point_of - channel.point_in, channel.direction_in,
          T_of_in.linear() * channel.normal_of};
}

Pose relative_pose(const Channel& channel, const BodyPoses& bodies) {
  return body_pose(channel.in, bodies).inverse() * body_pose(channel.of, bodies);
}

/// Offsets of the unknowns of a set-up in their vector; -1: not present.
struct UnknownOffsets {
  int zero = -1, rotation = -1, point_of = -1, point_in = -1, normal = -1, eccentricity = -1,
      scale = -1, drift = -1;
  int size = 0;
};

UnknownOffsets unknown_offsets(const SetUp& set_up) {
  UnknownOffsets offsets;
  const auto allocate = [&](bool is_present, int count) {
    const int first = offsets.size;
    if (!is_present) return -1;
    offsets.size += count;
    return first;
  };
  offsets.zero = allocate(set_up.is_zero_unknown, int(set_up.channels.size()));
  offsets.rotation = allocate(set_up.rotation_sigma > 0.0, 3);
  offsets.point_of = allocate(set_up.point_of_sigma > 0.0, 3);
  offsets.point_in = allocate(set_up.point_in_sigma > 0.0, 3);
  offsets.normal = allocate(set_up.normal_sigma > 0.0, 2);
  offsets.eccentricity = allocate(set_up.eccentricity_sigma > 0.0, 2);
  offsets.scale = allocate(set_up.scale_sigma > 0.0, 1);
  offsets.drift = allocate(set_up.drift_sigma > 0.0, 1);
  return offsets;
}

/// Returns the rotation vector of the body from its nominal pose. An angle is its component along
/// the instrument's direction. At nominal poses it is zero, so a misaligned direction has no
/// first-order effect.
Vector3d rotation_from_nominal(const Channel& channel, const BodyPoses& actual,
                               const BodyPoses& nominal) {
  const Matrix3d R_actual = relative_pose(channel, actual).linear();
  const Matrix3d R_nominal = relative_pose(channel, nominal).linear();
  return kinematics::rotation_vector(R_actual * R_nominal.transpose());
}

}  // namespace

Eigen::Matrix<double, 3, 2> perpendicular_basis(const Vector3d& normal) {
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = normal.unitOrthogonal();
  basis.col(1) = normal.cross(basis.col(0));
  return basis;
}

double reading(const SetUp& set_up, int channel, const Misalignment& misalignment,
               const BodyPoses& actual, const BodyPoses& nominal, double spindle_angle,
               double since_s) {
  assert(channel >= 0 && channel < int(set_up.channels.size()));
  const Channel& c = set_up.channels[std::size_t(channel)];
  const Vector3d direction_in = kinematics::rotation(misalignment.rotation) * c.direction_in;
  double value;
  if (c.is_angle()) {
    value = direction_in.dot(rotation_from_nominal(c, actual, nominal));
  } else {
    const Pose T_of_in = relative_pose(c, actual);
    const Vector3d point_of = c.point_of + misalignment.point_of +
                              rotated_eccentricity(misalignment.eccentricity, spindle_angle);
    value = ideal_value(
        c, {T_of_in * point_of - (c.point_in + misalignment.point_in), direction_in,
            T_of_in.linear() * (kinematics::rotation(misalignment.normal) * c.normal_of)});
  }
  const double zero = misalignment.zero.size() > 0 ? misalignment.zero[channel] : 0.0;
  return value + misalignment.scale * value + zero + misalignment.drift * since_s;
}

ReadingGradient gradient(const Channel& channel, const BodyPoses& nominal) {
  const Pose T_b_of = body_pose(channel.of, nominal);
  const Pose T_b_in = body_pose(channel.in, nominal);
  const Matrix3d R_b_in = T_b_in.linear();
  Deviation of_gradient = Deviation::Zero();  // equal motions of both bodies change nothing
  if (channel.is_angle()) {
    of_gradient.tail<3>() = R_b_in * channel.direction_in;
  } else {
    const SightLine sight = nominal_sight(channel, T_b_in.inverse() * T_b_of);
    const ValueGradient s = value_gradient(channel, sight);
    const Vector3d point_b = T_b_of * channel.point_of;
    of_gradient.head<3>() = R_b_in * s.point;
    // The mirror is carried by `of`, so a rotation of the body also turns its normal.
    of_gradient.tail<3>() =
        point_b.cross(of_gradient.head<3>()) + R_b_in * sight.normal_in.cross(s.normal);
  }
  ReadingGradient result;
  const auto add = [&](Body body, double sign) {
    if (body == Body::Workpiece) result.workpiece += sign * of_gradient;
    if (body == Body::Tool) result.tool += sign * of_gradient;
  };
  add(channel.of, 1.0);
  add(channel.in, -1.0);
  return result;
}

std::vector<SetUpUnknown> unknowns(const SetUp& set_up) {
  std::vector<SetUpUnknown> result;
  const auto add = [&](double sigma, std::initializer_list<const char*> names) {
    if (!(sigma > 0.0)) return;
    for (const char* name : names) result.push_back({name, sigma});
  };
  if (set_up.is_zero_unknown)
    for (const Channel& channel : set_up.channels)
      result.push_back({"zero of " + channel.name, std::numeric_limits<double>::infinity()});
  add(set_up.rotation_sigma, {"rotation about A", "rotation about B", "rotation about C"});
  add(set_up.point_of_sigma, {"carried point in X", "carried point in Y", "carried point in Z"});
  add(set_up.point_in_sigma, {"fixed point in X", "fixed point in Y", "fixed point in Z"});
  add(set_up.normal_sigma, {"first turn of the mirror", "second turn of the mirror"});
  add(set_up.eccentricity_sigma, {"eccentricity in X", "eccentricity in Y"});
  add(set_up.scale_sigma, {"scale"});
  add(set_up.drift_sigma, {"drift"});
  return result;
}

Misalignment misalignment(const SetUp& set_up, const Eigen::VectorXd& values) {
  const UnknownOffsets offsets = unknown_offsets(set_up);
  assert(values.size() == offsets.size);
  Misalignment result;
  if (offsets.zero >= 0)
    result.zero = values.segment(offsets.zero, Eigen::Index(set_up.channels.size()));
  if (offsets.rotation >= 0) result.rotation = values.segment<3>(offsets.rotation);
  if (offsets.point_of >= 0) result.point_of = values.segment<3>(offsets.point_of);
  if (offsets.point_in >= 0) result.point_in = values.segment<3>(offsets.point_in);
  if (offsets.normal >= 0)
    result.normal = mirror_rotations(set_up) * values.segment<2>(offsets.normal);
  if (offsets.eccentricity >= 0) result.eccentricity = values.segment<2>(offsets.eccentricity);
  if (offsets.scale >= 0) result.scale = values[offsets.scale];
  if (offsets.drift >= 0) result.drift = values[offsets.drift];
  return result;
}

Eigen::VectorXd values(const SetUp& set_up, const Misalignment& misalignment) {
  const UnknownOffsets offsets = unknown_offsets(set_up);
  Eigen::VectorXd result = Eigen::VectorXd::Zero(offsets.size);
  if (offsets.zero >= 0 && misalignment.zero.size() > 0)
    result.segment(offsets.zero, Eigen::Index(set_up.channels.size())) = misalignment.zero;
  if (offsets.rotation >= 0) result.segment<3>(offsets.rotation) = misalignment.rotation;
  if (offsets.point_of >= 0) result.segment<3>(offsets.point_of) = misalignment.point_of;
  if (offsets.point_in >= 0) result.segment<3>(offsets.point_in) = misalignment.point_in;
  if (offsets.normal >= 0)
    result.segment<2>(offsets.normal) = mirror_rotations(set_up).transpose() * misalignment.normal;
  if (offsets.eccentricity >= 0)
    result.segment<2>(offsets.eccentricity) = misalignment.eccentricity;
  if (offsets.scale >= 0) result[offsets.scale] = misalignment.scale;
  if (offsets.drift >= 0) result[offsets.drift] = misalignment.drift;
  return result;
}

Eigen::VectorXd unknowns_gradient(const SetUp& set_up, int channel, const BodyPoses& nominal,
                                  double spindle_angle, double since_s) {
  const Channel& c = set_up.channels[std::size_t(channel)];
  const UnknownOffsets offsets = unknown_offsets(set_up);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(offsets.size);
  if (offsets.zero >= 0) g[offsets.zero + channel] = 1.0;
  if (offsets.drift >= 0) g[offsets.drift] = since_s;
  if (c.is_angle()) return g;

  const Pose T_of_in = relative_pose(c, nominal);
  const SightLine sight = nominal_sight(c, T_of_in);
  const ValueGradient s = value_gradient(c, sight);
  const Vector3d point_gradient =
      T_of_in.linear().transpose() * s.point;  // per motion of the carried point
  if (offsets.rotation >= 0) g.segment<3>(offsets.rotation) = c.direction_in.cross(s.direction);
  if (offsets.point_of >= 0) g.segment<3>(offsets.point_of) = point_gradient;
  if (offsets.point_in >= 0) g.segment<3>(offsets.point_in) = -s.point;
  if (offsets.normal >= 0) {
    const Vector3d normal_gradient = c.normal_of.cross(T_of_in.linear().transpose() * s.normal);
    g.segment<2>(offsets.normal) = mirror_rotations(set_up).transpose() * normal_gradient;
  }
  if (offsets.eccentricity >= 0) {
    g[offsets.eccentricity] =
        point_gradient.dot(rotated_eccentricity(Eigen::Vector2d::UnitX(), spindle_angle));
    g[offsets.eccentricity + 1] =
        point_gradient.dot(rotated_eccentricity(Eigen::Vector2d::UnitY(), spindle_angle));
  }
  if (offsets.scale >= 0) g[offsets.scale] = ideal_value(c, sight);
  return g;
}

namespace {

using kinematics::AxisState;

// Noise and set-ups have separate random streams, so that the first readings of a longer plan are
// unchanged.
constexpr std::uint64_t set_up_random_stream = 0x5e7095e7095e7095ull;

bool is_same_state(const AxisState& a, const AxisState& b) {
  return a.time_s == b.time_s && a.q == b.q && a.direction == b.direction && a.stroke == b.stroke &&
         a.spindle_speed == b.spindle_speed;
}

bool is_temperature_log(const Plan& plan) {
  for (const SetUp& set_up : plan.set_ups)
    if (!set_up.channels.empty()) return false;
  return true;
}

void check(const Plan& plan, const kinematics::Chain& nominal) {
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    const Measurement& measurement = plan.measurements[i];
    const auto throw_input_error = [&](const std::string& what, int seen) {
      throw std::invalid_argument(fmt::format("reading {} of {}: expected {}, seen {}", i + 1,
                                              plan.instrument, what, seen));
    };
    const int set_ups = int(plan.set_ups.size());
    if (measurement.set_up < 0 || measurement.set_up >= set_ups)
      throw_input_error(fmt::format("one of {} set-ups", set_ups), measurement.set_up);
    const int channels = int(plan.set_ups[std::size_t(measurement.set_up)].channels.size());
    if (channels > 0 && (measurement.channel < 0 || measurement.channel >= channels))
      throw_input_error(fmt::format("one of {} channels", channels), measurement.channel);
    if (measurement.state.q.size() != nominal.size())
      throw_input_error(fmt::format("{} axis positions", nominal.size()),
                        int(measurement.state.q.size()));
    if (!measurement.state.q.allFinite() || !std::isfinite(measurement.state.time_s))
      throw std::invalid_argument(
          fmt::format("reading {} of {}: expected finite positions", i + 1, plan.instrument));
  }
}

/// State of a set-up while it is used. Counters are set at their first reading.
struct SetUpState {
  Misalignment misalignment;
  std::vector<char> is_zero_set;  ///< (channels) true: the counter has been set
};

/// Draws the misalignments of all set-ups.
std::vector<SetUpState> draw_set_ups(const Plan& plan, std::uint64_t seed) {
  std::vector<SetUpState> result;
  std::uint64_t counter = 0;
  for (const SetUp& set_up : plan.set_ups) {
    const std::vector<SetUpUnknown> list = unknowns(set_up);
    Eigen::VectorXd v = Eigen::VectorXd::Zero(Eigen::Index(list.size()));
    for (std::size_t i = 0; i < list.size(); ++i)
      if (std::isfinite(list[i].sigma))
        v[Eigen::Index(i)] = list[i].sigma * normal_deviate(seed ^ set_up_random_stream, counter++);
    Misalignment m = misalignment(set_up, v);
    m.zero = Eigen::VectorXd::Zero(Eigen::Index(set_up.channels.size()));
    result.push_back({m, std::vector<char>(set_up.channels.size(), 0)});
  }
  return result;
}

/// Returns the value on the instrument's display, without noise, and sets a counter at its first
/// reading.
double displayed_value(SetUpState& state, const SetUp& set_up, int channel, const BodyPoses& actual,
                       const BodyPoses& nominal, double spindle_angle, double since_s) {
  const auto reading_with = [&](const Misalignment& m) {
    return reading(set_up, channel, m, actual, nominal, spindle_angle, since_s);
  };
  char& is_zero_set = state.is_zero_set[std::size_t(channel)];
  if (set_up.is_zero_unknown && !is_zero_set) {  // the counter is set to its nominal value
    state.misalignment.zero[channel] =
        reading(set_up, channel, {}, nominal, nominal) - reading_with(state.misalignment);
    is_zero_set = 1;
  }
  return reading_with(state.misalignment);
}

}  // namespace

double round_to_resolution(double value, double resolution) {
  return resolution > 0.0 ? std::round(value / resolution) * resolution : value;
}

Readings measure(const Plan& plan, const kinematics::Chain& nominal,
                 const MachineUnderTest& machine, std::uint64_t seed) {
  check(plan, nominal);
  Readings readings{plan, nominal, {}, {}, {}};
  if (is_temperature_log(plan)) return readings;

  std::vector<SetUpState> set_up_states = draw_set_ups(plan, seed);
  const Eigen::VectorXd since_s = time_since_set_up(plan);
  readings.value.setZero(Eigen::Index(plan.measurements.size()));
  BodyPoses actual, nominal_poses;
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    const Measurement& measurement = plan.measurements[i];
    // The machine is evaluated once for channels that are read together.
    if (i == 0 || !is_same_state(measurement.state, plan.measurements[i - 1].state)) {
      actual = machine(measurement.state);
      nominal_poses = nominal_bodies(nominal, measurement.state.q);
    }
    const SetUp& set_up = plan.set_ups[std::size_t(measurement.set_up)];
    if (set_up.channels.empty()) continue;
    const Channel& channel = set_up.channels[std::size_t(measurement.channel)];
    const double value =
        displayed_value(set_up_states[std::size_t(measurement.set_up)], set_up, measurement.channel,
                        actual, nominal_poses, spindle_angle(nominal, measurement.state),
                        since_s[Eigen::Index(i)]) +
        channel.noise * normal_deviate(seed, i);
    if (!std::isfinite(value))
      throw std::invalid_argument(fmt::format("reading {} of {} ({}): expected a finite number",
                                              i + 1, plan.instrument, channel.name));
    readings.value[Eigen::Index(i)] = round_to_resolution(value, channel.resolution);
  }
  return readings;
}

BodyPoses nominal_bodies(const kinematics::Chain& nominal, const kinematics::AxisVector& q) {
  return {nominal.workpiece_in_bed(q), nominal.tool_in_bed(q)};
}

double standard_deviation(const Channel& channel) {
  // A uniform rounding error over one step has the variance of step^2 / 12.
  return std::sqrt(channel.noise * channel.noise + channel.resolution * channel.resolution / 12.0);
}

double spindle_angle(const kinematics::Chain& nominal, const kinematics::AxisState& state) {
  const std::optional<int> nose = nominal.find('s');
  return nose ? state.q[*nose] : 0.0;
}

Eigen::VectorXd time_since_set_up(const Plan& plan) {
  std::vector<double> first(plan.set_ups.size(), std::numeric_limits<double>::quiet_NaN());
  Eigen::VectorXd since_s(Eigen::Index(plan.measurements.size()));
  for (std::size_t i = 0; i < plan.measurements.size(); ++i) {
    const Measurement& measurement = plan.measurements[i];
    double& start = first[std::size_t(measurement.set_up)];
    if (std::isnan(start)) start = measurement.state.time_s;
    since_s[Eigen::Index(i)] = measurement.state.time_s - start;
  }
  return since_s;
}

}  // namespace abbe::errors::metrology
