#include "errors/metrology/machine_tests.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "errors/metrology/circular.h"
#include "kinematics/decompositions.h"
#include "kinematics/units.h"

namespace abbe::errors::metrology {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Sorts the readings of a plan into the tests of ISO 230: positioning, straightness, angle, error
// motion, circular, drift, and the rest.

namespace {

/// Readings of one channel of one set-up, in the order of the plan.
struct ChannelSeries {
  const Readings& readings;
  int set_up_index = 0;                   ///< index in the plan
  int channel = 0;                        ///< index in that set-up
  std::vector<std::size_t> measurements;  ///< indices in the plan

  const SetUp& set_up() const { return readings.plan.set_ups[std::size_t(set_up_index)]; }
  const Channel& sensor() const { return set_up().channels[std::size_t(channel)]; }
  const Measurement& measurement(std::size_t i) const {
    return readings.plan.measurements[measurements[i]];
  }
  /// Returns the name of the set-up, followed by that of the channel if there are several.
  std::string name() const {
    return set_up().channels.size() > 1 ? set_up().name + ", " + sensor().name : set_up().name;
  }
};

/// Targets in ascending order of their position along a path.
struct Targets {
  VectorXd position;         ///< (m)
  std::map<int, Index> row;  ///< row of each target number
};

/// Sorts the targets of a series by their position along a path.
Targets path_targets(const ChannelSeries& series, const VectorXd& along) {
  std::map<int, double> position;
  for (std::size_t i = 0; i < series.measurements.size(); ++i)
    position.emplace(series.measurement(i).target, along[Index(i)]);
  std::vector<std::pair<double, int>> order;
  for (const auto& [target, at] : position) order.emplace_back(at, target);
  std::sort(order.begin(), order.end());
  Targets targets;
  targets.position.resize(Index(order.size()));
  for (std::size_t i = 0; i < order.size(); ++i) {
    targets.position[Index(i)] = order[i].first;
    targets.row[order[i].second] = Index(i);
  }
  return targets;
}

/// Returns the nominal poses of the bodies at a measurement.
BodyPoses nominal_bodies_at(const ChannelSeries& series, std::size_t i) {
  return nominal_bodies(series.readings.nominal, series.measurement(i).state.q);
}

/// Returns the readings minus those of a perfect set-up on the nominal machine (measurements).
VectorXd deviations(const ChannelSeries& series) {
  VectorXd result(Index(series.measurements.size()));
  for (std::size_t i = 0; i < series.measurements.size(); ++i) {
    const BodyPoses nominal = nominal_bodies_at(series, i);
    result[Index(i)] = series.readings.value[Index(series.measurements[i])] -
                       reading(series.set_up(), series.channel, {}, nominal, nominal,
                               spindle_angle(series.readings.nominal, series.measurement(i).state));
  }
  return result;
}

/// Returns the nominal position of the measured point in the workpiece.
Eigen::Vector3d measured_point_w(const ChannelSeries& series, const kinematics::AxisVector& q) {
  const BodyPoses nominal = nominal_bodies(series.readings.nominal, q);
  return nominal.T_bw.inverse() * (nominal.T_bt * series.sensor().point_of);
}

/// Returns the indices of the axes that move.
std::vector<int> moving_axes(const ChannelSeries& series) {
  std::vector<int> moving;
  for (Index j = 0; j < series.measurement(0).state.q.size(); ++j)
    for (std::size_t i = 1; i < series.measurements.size(); ++i)
      // 1e-9 mm or rad: rounding of a commanded position; a larger change is a motion.
      if (std::abs(series.measurement(i).state.q[j] - series.measurement(0).state.q[j]) > 1e-9) {
        moving.push_back(int(j));
        break;
      }
  return moving;
}

/// Returns the deviations of a series as runs over positions along a path, in ascending order of
/// the targets. Empty if a run misses or repeats a target, or if two targets coincide.
/// @param along       (measurements) position on the path
/// @param from_below  (measurements) true if the measurement was approached from lower positions
std::optional<PositionRuns> position_runs(const ChannelSeries& series, const VectorXd& along,
                                          const std::vector<bool>& from_below) {
  const Targets targets = path_targets(series, along);
  const Index m = targets.position.size();
  if (m < 2) return std::nullopt;
  const VectorXd value = deviations(series);
  std::map<std::pair<bool, int>, VectorXd> columns;
  std::map<std::pair<bool, int>, std::set<Index>> targets_read;
  for (std::size_t i = 0; i < series.measurements.size(); ++i) {
    const std::pair key{bool(from_below[i]), series.measurement(i).run};
    VectorXd& column = columns.try_emplace(key, VectorXd::Zero(m)).first->second;
    const Index row = targets.row.at(series.measurement(i).target);
    // In ISO 230-2 a run reads each target once per direction.
    if (!targets_read[key].insert(row).second) return std::nullopt;
    column[row] = value[Index(i)];
  }
  PositionRuns runs;
  runs.target = targets.position;
  for (const auto& [key, column] : columns) {
    if (Index(targets_read[key].size()) != m) return std::nullopt;
    Eigen::MatrixXd& side = key.first ? runs.up : runs.down;
    side.conservativeResize(m, side.cols() + 1);
    side.rightCols(1) = column;
  }
  for (Index i = 1; i < m; ++i)
    if (!(runs.target[i] > runs.target[i - 1])) return std::nullopt;
  return runs;
}

/// Returns the direction of a channel in the bed at its first measurement.
Eigen::Vector3d sensor_direction_b(const ChannelSeries& series) {
  const BodyPoses nominal = nominal_bodies_at(series, 0);
  const Channel& sensor = series.sensor();
  if (sensor.in == Body::Bed) return sensor.direction_in;
  return (sensor.in == Body::Workpiece ? nominal.T_bw : nominal.T_bt).linear() *
         sensor.direction_in;
}

/// Returns true if a channel measures along the travel, false if across it. Decided by how much the
/// nominal reading changes over the travel.
bool is_measured_along(const ChannelSeries& series, int joint) {
  std::size_t farthest = 0;
  const auto displacement = [&](std::size_t i) {
    return std::abs(series.measurement(i).state.q[joint] - series.measurement(0).state.q[joint]);
  };
  for (std::size_t i = 1; i < series.measurements.size(); ++i)
    if (displacement(i) > displacement(farthest)) farthest = i;
  const auto first = nominal_bodies_at(series, 0),
             farthest_bodies = nominal_bodies_at(series, farthest);
  const double reading_change =
      reading(series.set_up(), series.channel, {}, farthest_bodies, farthest_bodies) -
      reading(series.set_up(), series.channel, {}, first, first);
  // The ratio is about 1 along the travel and about 0 across it.
  return std::abs(reading_change) > 0.5 * displacement(farthest);
}

AxisTest::TestKind classify_axis_test(const ChannelSeries& series, int joint,
                                      const AxisTest& test) {
  using TestKind = AxisTest::TestKind;
  if (test.rotary) return test.angle ? TestKind::Positioning : TestKind::ErrorMotion;
  if (test.angle) return TestKind::Angle;
  return is_measured_along(series, joint) ? TestKind::Positioning : TestKind::Straightness;
}

/// Subtracts the mean at the target nearest to the zero of the axis, since the zero of readings is
/// arbitrary.
void subtract_zero_reading(PositionRuns& runs) {
  Index nearest = 0;
  runs.target.cwiseAbs().minCoeff(&nearest);
  double zero = 0.0;
  const Index n = runs.up.cols() + runs.down.cols();
  if (runs.up.cols() > 0) zero += runs.up.row(nearest).sum();
  if (runs.down.cols() > 0) zero += runs.down.row(nearest).sum();
  runs.up.array() -= zero / double(n);
  runs.down.array() -= zero / double(n);
}

/// Returns the test of the only moving axis; empty if a run misses a target.
std::optional<AxisTest> axis_test(const ChannelSeries& series, int joint) {
  const kinematics::Joint& axis = series.readings.nominal.joints()[std::size_t(joint)];
  VectorXd along(Index(series.measurements.size()));
  std::vector<bool> from_below;
  for (std::size_t i = 0; i < series.measurements.size(); ++i) {
    along[Index(i)] = series.measurement(i).state.q[joint];
    from_below.push_back(series.measurement(i).state.direction[std::size_t(joint)] >= 0);
  }
  auto runs = position_runs(series, along, from_below);
  if (!runs) return std::nullopt;
  subtract_zero_reading(*runs);
  AxisTest test;
  test.name = series.name();
  test.axis = axis.name;
  test.set_up = series.set_up_index;
  test.angle = series.sensor().is_angle();
  test.rotary = axis.motion != kinematics::Motion::Linear;
  if (test.rotary) {
    test.spindle = axis.motion == kinematics::Motion::Spindle || axis.name == 'S';
    // 0.7 is the cosine of 45 degrees, halfway between axial and radial.
    test.axial = std::abs(sensor_direction_b(series).dot(axis.direction_b)) > 0.7;
  }
  test.test_kind = classify_axis_test(series, joint, test);
  test.runs = std::move(*runs);
  return test;
}

}  // namespace

bool is_hidden_by_centring(const AxisTest& test) {
  if (test.test_kind != AxisTest::TestKind::ErrorMotion || test.axial) return false;
  Eigen::MatrixX2d coordinates(test.runs.target.size(), 2);
  coordinates << test.runs.target.array().cos(), test.runs.target.array().sin();
  // The sum of the weights is the number of distinct positions. Three positions are fitted exactly
  // by offset and once-per-turn motion; 3.5 allows for rounding.
  return position_weights(coordinates, 1e-9).sum() < 3.5;
}

PositionRuns form_runs(const AxisTest& test) {
  PositionRuns runs = test.runs;
  const VectorXd& t = runs.target;
  Eigen::MatrixXd set_up_terms = Eigen::MatrixXd::Ones(t.size(), 1);
  VectorXd root_of_weight = VectorXd::Ones(t.size());
  // The set-up contributes the line of the optics to a straightness, the eccentricity of the
  // artefact to a radial error motion, and the zero to an axial one.
  if (test.test_kind == AxisTest::TestKind::Straightness) {
    set_up_terms.conservativeResize(Eigen::NoChange, 2);
    set_up_terms.col(1) = t.array() - t.mean();
  } else if (test.test_kind != AxisTest::TestKind::ErrorMotion) {
    return runs;
  } else {
    root_of_weight = arc_weights(t).cwiseSqrt();
    if (!test.axial && !is_hidden_by_centring(test)) {
      set_up_terms.conservativeResize(Eigen::NoChange, 3);
      set_up_terms.col(1) = t.array().cos();
      set_up_terms.col(2) = t.array().sin();
    }
  }
  const Eigen::MatrixXd weighted = root_of_weight.asDiagonal() * set_up_terms;
  const VectorXd set_up_contribution =
      set_up_terms *
      least_squares(weighted, VectorXd(root_of_weight.cwiseProduct(run_mean(runs)))).x;
  runs.up.colwise() -= set_up_contribution;
  runs.down.colwise() -= set_up_contribution;
  return runs;
}

namespace {

/// Returns the two slides of a circle in alphabetical order; empty if other axes move.
std::optional<std::array<int, 2>> circle_slides(const ChannelSeries& series,
                                                const std::vector<int>& moving) {
  const auto& joints = series.readings.nominal.joints();
  if (series.sensor().quantity != Quantity::Length || moving.size() != 2) return std::nullopt;
  for (const int joint : moving)
    if (joints[std::size_t(joint)].motion != kinematics::Motion::Linear) return std::nullopt;
  std::array slides{moving[0], moving[1]};
  if (joints[std::size_t(slides[1])].name < joints[std::size_t(slides[0])].name)
    std::swap(slides[0], slides[1]);
  return slides;
}

/// Measurements of one run in one sense of motion, with unwrapped angles about the centre.
struct CirclePass {
  int run = 0;
  std::vector<std::size_t> measurements;
  std::vector<double> angle;
};

/// Divides a series into passes. A pass ends with its run, or at a target that is read again before
/// the motion back.
std::vector<CirclePass> circle_passes(const ChannelSeries& series,
                                      const Eigen::Matrix<double, 3, 2>& plane) {
  std::vector<CirclePass> passes;
  int step = 0;
  for (std::size_t i = 0; i < series.measurements.size(); ++i) {
    const Measurement& measurement = series.measurement(i);
    const Eigen::Vector2d arm = plane.transpose() * (measured_point_w(series, measurement.state.q) -
                                                     series.sensor().point_in);
    double angle = std::atan2(arm.y(), arm.x());
    const int target_step = i > 0 ? measurement.target - series.measurement(i - 1).target : 0;
    const bool continues_pass = !passes.empty() && passes.back().run == measurement.run &&
                                target_step != 0 &&
                                (passes.back().measurements.size() < 2 || target_step * step > 0);
    if (!continues_pass) passes.push_back({measurement.run, {}, {}});
    CirclePass& pass = passes.back();
    if (!pass.angle.empty())
      // Unwrapping assumes steps below half a turn from reading to reading.
      angle = pass.angle.back() + std::remainder(angle - pass.angle.back(), 2 * pi);
    step = target_step;
    pass.measurements.push_back(i);
    pass.angle.push_back(angle);
  }
  return passes;
}

/// Returns unit vectors in the workpiece: along the first slide and, perpendicular to it, towards
/// the second.
Eigen::Matrix<double, 3, 2> plane_w(const ChannelSeries& series, const std::array<int, 2>& slides) {
  const auto& q0 = series.measurement(0).state.q;
  Eigen::Matrix<double, 3, 2> plane;
  for (int k = 0; k < 2; ++k) {
    // Slides move along straight lines, so a displacement of 1 mm gives the direction.
    kinematics::AxisVector q = q0;
    q[slides[std::size_t(k)]] += 1.0;
    plane.col(k) = measured_point_w(series, q) - measured_point_w(series, q0);
  }
  plane.col(0).normalize();
  plane.col(1) -= plane.col(1).dot(plane.col(0)) * plane.col(0);
  plane.col(1).normalize();
  return plane;
}

/// Returns one test per run; empty if the motion is not a circle of two slides about the socket.
/// @param moving  the axes that move
std::vector<CircleTest> circle_tests(const ChannelSeries& series, const std::vector<int>& moving) {
  const auto slides = circle_slides(series, moving);
  if (!slides) return {};
  const auto& q0 = series.measurement(0).state.q;
  const double radius = (measured_point_w(series, q0) - series.sensor().point_in).norm();
  for (std::size_t i = 1; i < series.measurements.size(); ++i) {
    const Vector3d arm =
        measured_point_w(series, series.measurement(i).state.q) - series.sensor().point_in;
    // 1e-6 of the radius allows for the rounding of positions in a file.
    if (std::abs(arm.norm() - radius) > 1e-6 * radius) return {};
  }
  std::map<int, CircleTest> circles;
  for (const CirclePass& pass : circle_passes(series, plane_w(series, *slides))) {
    if (pass.measurements.size() < 3) return {};
    CircleTest& test = circles[pass.run];
    const bool is_anticlockwise = pass.angle.back() > pass.angle.front();
    CircularTrace& trace = is_anticlockwise ? test.runs.anticlockwise : test.runs.clockwise;
    if (trace.angle.size() > 0) return {};  // a run repeats a sense of rotation
    trace.angle = VectorXd::Map(pass.angle.data(), Index(pass.angle.size()));
    trace.radius.resize(trace.angle.size());
    for (std::size_t i = 0; i < pass.measurements.size(); ++i)
      trace.radius[Index(i)] =
          series.readings.value[Index(series.measurements[pass.measurements[i]])];
  }
  std::vector<CircleTest> result;
  for (auto& [run, test] : circles) {
    test.name =
        circles.size() > 1 ? fmt::format("{}, run {}", series.name(), run + 1) : series.name();
    for (const int joint : *slides)
      test.plane += series.readings.nominal.joints()[std::size_t(joint)].name;
    test.runs.nominal_radius = radius;
    test.is_zero_known = !series.set_up().is_zero_unknown;
    result.push_back(std::move(test));
  }
  return result;
}

/// Returns the signs of the slides along a diagonal in the order X Y Z; empty if other axes move.
std::optional<std::array<int, 3>> diagonal_signs(const ChannelSeries& series,
                                                 const std::vector<int>& moving) {
  std::array<int, 3> signs{0, 0, 0};
  int first = series.measurement(0).target, last = first;
  for (std::size_t i = 1; i < series.measurements.size(); ++i) {
    first = std::min(first, series.measurement(i).target);
    last = std::max(last, series.measurement(i).target);
  }
  for (const int joint : moving) {
    const char name = series.readings.nominal.joints()[std::size_t(joint)].name;
    if (name < 'X' || name > 'Z') return std::nullopt;
    double from = 0.0, to = 0.0;
    for (std::size_t i = 0; i < series.measurements.size(); ++i) {
      if (series.measurement(i).target == first) from = series.measurement(i).state.q[joint];
      if (series.measurement(i).target == last) to = series.measurement(i).state.q[joint];
    }
    signs[std::size_t(name - 'X')] = to > from ? 1 : -1;
  }
  return signs;
}

/// Returns true if the measured point moves along the beam.
bool is_along_beam(const ChannelSeries& series) {
  const Vector3d& beam = series.sensor().direction_in;
  const Vector3d start = measured_point_w(series, series.measurement(0).state.q);
  for (std::size_t i = 1; i < series.measurements.size(); ++i) {
    const Vector3d displacement = measured_point_w(series, series.measurement(i).state.q) - start;
    // 1e-6 relative allows for the rounding of positions in a file.
    if ((displacement - displacement.dot(beam) * beam).norm() > 1e-6 * (1 + displacement.norm()))
      return false;
  }
  return true;
}

/// Returns the test of a diagonal; empty if other axes than slides move, the path is not straight
/// along the beam, or a run misses a target.
/// @param moving  the axes that move, two or more
std::optional<DiagonalTest> diagonal_test(const ChannelSeries& series,
                                          const std::vector<int>& moving) {
  if (series.sensor().quantity != Quantity::Displacement) return std::nullopt;
  const auto signs = diagonal_signs(series, moving);
  if (!signs || !is_along_beam(series)) return std::nullopt;
  const int leading = moving.front();
  const int sign =
      (*signs)[std::size_t(series.readings.nominal.joints()[std::size_t(leading)].name - 'X')];
  Eigen::VectorXd along(Index(series.measurements.size()));
  std::vector<bool> from_below;
  for (std::size_t i = 0; i < series.measurements.size(); ++i) {
    const BodyPoses nominal = nominal_bodies_at(series, i);
    along[Index(i)] = reading(series.set_up(), series.channel, {}, nominal, nominal);
    from_below.push_back(sign * series.measurement(i).state.direction[std::size_t(leading)] >= 0);
  }
  auto runs = position_runs(series, along, from_below);
  if (!runs) return std::nullopt;
  const double zero = runs->up.cols() > 0 ? runs->up.row(0).mean() : runs->down.row(0).mean();
  runs->up.array() -= zero;
  runs->down.array() -= zero;
  return DiagonalTest{series.name(), {*signs, std::move(*runs)}};
}

/// Returns the channels of a set-up over time; empty if they were not read together.
std::optional<DriftTest> drift_test(const std::vector<ChannelSeries>& channels) {
  const ChannelSeries& first = channels.front();
  DriftTest test;
  test.name = first.set_up().name;
  const auto n = Index(first.measurements.size());
  test.log.time_s.resize(n);
  test.log.values.resize(n, Index(channels.size()));
  for (std::size_t c = 0; c < channels.size(); ++c) {
    if (Index(channels[c].measurements.size()) != n) return std::nullopt;
    const VectorXd value = deviations(channels[c]);
    test.log.names.push_back(channels[c].sensor().name);
    test.angle.push_back(channels[c].sensor().is_angle());
    test.log.values.col(Index(c)) = value.array() - value[0];
  }
  for (Index i = 0; i < n; ++i) {
    test.log.time_s[i] = first.measurement(std::size_t(i)).state.time_s;
    if (i > 0 && !(test.log.time_s[i] > test.log.time_s[i - 1])) return std::nullopt;
  }
  if (n < 2) return std::nullopt;
  return test;
}

/// Returns the positions of the axes at each measurement, with whole turns removed.
Eigen::MatrixXd wrapped_positions(const ChannelSeries& series) {
  const auto& joints = series.readings.nominal.joints();
  Eigen::MatrixXd positions(Index(series.measurements.size()), 2 * Index(joints.size()));
  for (Index i = 0; i < positions.rows(); ++i) {
    const kinematics::AxisVector& q = series.measurement(std::size_t(i)).state.q;
    for (Index j = 0; j < q.size(); ++j) {
      const bool is_slide = joints[std::size_t(j)].motion == kinematics::Motion::Linear;
      positions(i, 2 * j) = is_slide ? q[j] : std::cos(q[j]);
      positions(i, 2 * j + 1) = is_slide ? 0.0 : std::sin(q[j]);
    }
  }
  return positions;
}

/// Returns the deviations of a series from their mean.
OtherTest other_test(const ChannelSeries& series) {
  constexpr double tolerance = 1e-9;  // mm or rad
  OtherTest test{series.name(), series.sensor().is_angle(), deviations(series),
                 position_weights(wrapped_positions(series), tolerance)};
  test.weights /= test.weights.sum();
  if (test.deviation.size() > 1) test.deviation.array() -= test.weights.dot(test.deviation);
  return test;
}

/// Joins channels with a single reading, such as those of a tracker at every position, into one
/// test of lengths and one of angles.
void join_single_readings(std::vector<OtherTest>& tests) {
  std::vector<OtherTest> remaining;
  std::array<std::vector<double>, 2> single_deviations;
  for (OtherTest& test : tests) {
    if (test.deviation.size() == 1)
      single_deviations[test.angle ? 1 : 0].push_back(test.deviation[0]);
    else
      remaining.push_back(std::move(test));
  }
  for (const bool is_angle : {false, true}) {
    const std::vector<double>& deviations_of_kind = single_deviations[is_angle ? 1 : 0];
    if (deviations_of_kind.empty()) continue;
    VectorXd value = VectorXd::Map(deviations_of_kind.data(), Index(deviations_of_kind.size()));
    value.array() -= value.mean();
    VectorXd weights = VectorXd::Constant(value.size(), 1.0 / double(value.size()));
    remaining.push_back({is_angle ? "angles read once each" : "lengths read once each", is_angle,
                         std::move(value), std::move(weights)});
  }
  tests = std::move(remaining);
}

/// Adds the tests of one set-up.
void add_set_up_tests(const std::vector<ChannelSeries>& channels, MachineTests& tests) {
  std::vector<AxisTest> axis_tests;
  std::set<char> axes;
  // Readings without any motion are a drift test for every instrument.
  bool is_at_rest = true;
  for (const ChannelSeries& series : channels)
    is_at_rest = is_at_rest && moving_axes(series).empty();
  if (is_at_rest) {
    if (auto drift = drift_test(channels)) {
      tests.drifts.push_back(std::move(*drift));
      return;
    }
  }
  // The order matters: one moving axis, then a straight diagonal, then a circle. All other readings
  // are reported by their range.
  for (const ChannelSeries& series : channels) {
    const std::vector<int> moving = moving_axes(series);
    if (moving.size() == 1) {
      if (auto test = axis_test(series, moving.front())) {
        axes.insert(test->axis);
        axis_tests.push_back(std::move(*test));
        continue;
      }
    } else if (moving.size() > 1) {
      if (auto test = diagonal_test(series, moving)) {
        tests.diagonals.push_back(std::move(*test));
        continue;
      }
      std::vector<CircleTest> circles = circle_tests(series, moving);
      if (!circles.empty()) {
        for (CircleTest& circle : circles) tests.circles.push_back(std::move(circle));
        continue;
      }
    }
    tests.others.push_back(other_test(series));
  }
  const bool is_square_test = axis_tests.size() == 2 && axes.size() == 2 &&
                              axis_tests[0].test_kind == AxisTest::TestKind::Straightness &&
                              axis_tests[1].test_kind == AxisTest::TestKind::Straightness;
  if (is_square_test)
    tests.squares.push_back({channels.front().set_up().name, axis_tests[0], axis_tests[1]});
  for (AxisTest& line : axis_tests) tests.axes.push_back(std::move(line));
}

}  // namespace

MachineTests classify_readings(const Readings& readings) {
  MachineTests tests;
  const auto& plan = readings.plan;
  std::vector<std::vector<ChannelSeries>> set_ups(plan.set_ups.size());
  for (std::size_t s = 0; s < set_ups.size(); ++s)
    for (std::size_t c = 0; c < plan.set_ups[s].channels.size(); ++c)
      set_ups[s].push_back({readings, int(s), int(c), {}});
  for (std::size_t i = 0; i < plan.measurements.size(); ++i)
    set_ups[std::size_t(plan.measurements[i].set_up)][std::size_t(plan.measurements[i].channel)]
        .measurements.push_back(i);
  for (const std::vector<ChannelSeries>& set_up_series : set_ups) {
    std::vector<ChannelSeries> channels;
    for (const ChannelSeries& series : set_up_series)
      if (!series.measurements.empty()) channels.push_back(series);
    if (!channels.empty()) add_set_up_tests(channels, tests);
  }
  join_single_readings(tests.others);
  return tests;
}

}  // namespace abbe::errors::metrology
