#include "sim/calibration/evaluate_tests.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Core>

#include "errors/metrology/shares.h"
#include "kinematics/least_squares.h"
#include "kinematics/units.h"

namespace abbe::sim {
namespace {

namespace metrology = errors::metrology;
using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;
using metrology::Channel;
using metrology::Look;
using metrology::Quantity;
using metrology::Readings;
using metrology::SetUp;

/// The looks of one channel of one set-up.
struct Series {
  const Readings& readings;
  int set_up = 0;
  int channel = 0;
  std::vector<std::size_t> looks;

  const SetUp& optics() const { return readings.plan.set_ups[std::size_t(set_up)]; }
  const Channel& sensor() const { return optics().channels[std::size_t(channel)]; }
  const Look& look(std::size_t i) const { return readings.plan.looks[looks[i]]; }
  std::string name() const {
    return optics().channels.size() > 1 ? optics().name + ", " + sensor().name : optics().name;
  }
};

metrology::Bodies nominal_at(const Series& series, std::size_t i) {
  return metrology::nominal_bodies(series.readings.nominal, series.look(i).state.q);
}

/// Reading minus what a perfect set-up would read on the nominal machine. (looks)
VectorXd deviations(const Series& series) {
  VectorXd result(Index(series.looks.size()));
  for (std::size_t i = 0; i < series.looks.size(); ++i) {
    const metrology::Bodies nominal = nominal_at(series, i);
    result[Index(i)] =
        series.readings.value[Index(series.looks[i])] -
        metrology::reading(series.optics(), series.channel, {}, nominal, nominal,
                           metrology::spindle_angle(series.readings.nominal, series.look(i).state));
  }
  return result;
}

/// Where the nominal machine has the point that is looked at, in the workpiece.
Vector3d place_w(const Series& series, const kinematics::AxisVector& q) {
  const metrology::Bodies nominal = metrology::nominal_bodies(series.readings.nominal, q);
  return nominal.T_bw.inverse() * (nominal.T_bt * series.sensor().point_of);
}

std::vector<int> moving_joints(const Series& series) {
  std::vector<int> moving;
  for (Index j = 0; j < series.look(0).state.q.size(); ++j)
    for (std::size_t i = 1; i < series.looks.size(); ++i)
      if (std::abs(series.look(i).state.q[j] - series.look(0).state.q[j]) > 1e-9) {
        moving.push_back(int(j));
        break;
      }
  return moving;
}

/// Position of every target along a path, rising with the position.
struct Targets {
  std::map<int, double> position;  ///< by number of the target
  VectorXd sorted;                 ///< (m)
  std::map<int, Index> row;        ///< by number of the target
};

template <typename Along>
Targets targets_of(const Series& series, const Along& along) {
  Targets targets;
  for (std::size_t i = 0; i < series.looks.size(); ++i)
    targets.position.emplace(series.look(i).target, along(i));
  std::vector<std::pair<double, int>> order;
  for (const auto& [target, position] : targets.position) order.emplace_back(position, target);
  std::sort(order.begin(), order.end());
  targets.sorted.resize(Index(order.size()));
  for (std::size_t i = 0; i < order.size(); ++i) {
    targets.sorted[Index(i)] = order[i].first;
    targets.row[order[i].second] = Index(i);
  }
  return targets;
}

/// Runs of a series over positions along a path; empty unless every run has every target once.
/// @param up  whether look i came from below
template <typename Along, typename Up>
std::optional<metrology::PositionRuns> runs_of(const Series& series, const Along& along,
                                               const Up& up) {
  const Targets targets = targets_of(series, along);
  const Index m = targets.sorted.size();
  if (m < 2) return std::nullopt;
  const VectorXd value = deviations(series);
  std::map<std::pair<bool, int>, VectorXd> columns;
  std::map<std::pair<bool, int>, std::set<Index>> filled;
  for (std::size_t i = 0; i < series.looks.size(); ++i) {
    const std::pair key{up(i), series.look(i).run};
    VectorXd& column = columns.try_emplace(key, VectorXd::Zero(m)).first->second;
    const Index row = targets.row.at(series.look(i).target);
    if (!filled[key].insert(row).second) return std::nullopt;
    column[row] = value[Index(i)];
  }
  metrology::PositionRuns runs;
  runs.target = targets.sorted;
  for (const auto& [key, column] : columns) {
    if (Index(filled[key].size()) != m) return std::nullopt;
    Eigen::MatrixXd& side = key.first ? runs.up : runs.down;
    side.conservativeResize(m, side.cols() + 1);
    side.rightCols(1) = column;
  }
  for (Index i = 1; i < m; ++i)
    if (!(runs.target[i] > runs.target[i - 1])) return std::nullopt;
  return runs;
}

/// Direction in which a channel looks, in the bed, at its first look.
Vector3d sight_b(const Series& series) {
  const metrology::Bodies nominal = nominal_at(series, 0);
  const Channel& sensor = series.sensor();
  if (sensor.in == metrology::Body::Bed) return sensor.direction_in;
  return (sensor.in == metrology::Body::Workpiece ? nominal.T_bw : nominal.T_bt).linear() *
         sensor.direction_in;
}

std::optional<AxisTest> axis_test(const Series& series, int joint) {
  const kinematics::Joint& axis = series.readings.nominal.joints()[std::size_t(joint)];
  auto runs = runs_of(
      series, [&](std::size_t i) { return series.look(i).state.q[joint]; },
      [&](std::size_t i) { return series.look(i).state.direction[std::size_t(joint)] >= 0; });
  if (!runs) return std::nullopt;
  AxisTest test;
  test.name = series.name();
  test.axis = axis.name;
  test.set_up = series.set_up;
  test.angle = series.sensor().is_angle();
  test.rotary = axis.motion != kinematics::Motion::Linear;
  test.what = AxisTest::What::Angle;
  if (test.rotary) {
    test.what = test.angle ? AxisTest::What::Positioning : AxisTest::What::ErrorMotion;
    test.spindle = axis.motion == kinematics::Motion::Spindle || axis.name == 'S';
    test.axial = std::abs(sight_b(series).dot(axis.direction_b)) > 0.7;
  } else if (!test.angle) {
    // along the travel, or across it: how much the nominal machine itself moves the reading
    std::size_t far = 0;
    const auto moved = [&](std::size_t i) {
      return std::abs(series.look(i).state.q[joint] - series.look(0).state.q[joint]);
    };
    for (std::size_t i = 1; i < series.looks.size(); ++i)
      if (moved(i) > moved(far)) far = i;
    const auto first = nominal_at(series, 0), last = nominal_at(series, far);
    const double seen = metrology::reading(series.optics(), series.channel, {}, last, last) -
                        metrology::reading(series.optics(), series.channel, {}, first, first);
    test.what = std::abs(seen) > 0.5 * moved(far) ? AxisTest::What::Positioning
                                                  : AxisTest::What::Straightness;
  }
  // readings count from an arbitrary zero: here from the mean at the target nearest to the axis's
  Index nearest = 0;
  runs->target.cwiseAbs().minCoeff(&nearest);
  double zero = 0.0;
  const Index n = runs->up.cols() + runs->down.cols();
  if (runs->up.cols() > 0) zero += runs->up.row(nearest).sum();
  if (runs->down.cols() > 0) zero += runs->down.row(nearest).sum();
  runs->up.array() -= zero / double(n);
  runs->down.array() -= zero / double(n);
  test.runs = std::move(*runs);
  return test;
}

/// Signs of the slides along a diagonal, in the order X Y Z; nothing if other axes move.
std::optional<std::array<int, 3>> signs_of(const Series& series, const std::vector<int>& moving) {
  std::array<int, 3> signs{0, 0, 0};
  const Targets targets =
      targets_of(series, [&](std::size_t i) { return double(series.look(i).target); });
  const int first = targets.position.begin()->first, last = targets.position.rbegin()->first;
  for (const int joint : moving) {
    const char name = series.readings.nominal.joints()[std::size_t(joint)].name;
    if (name < 'X' || name > 'Z') return std::nullopt;
    double from = 0.0, to = 0.0;
    for (std::size_t i = 0; i < series.looks.size(); ++i) {
      if (series.look(i).target == first) from = series.look(i).state.q[joint];
      if (series.look(i).target == last) to = series.look(i).state.q[joint];
    }
    signs[std::size_t(name - 'X')] = to > from ? 1 : -1;
  }
  return signs;
}

std::optional<DiagonalTest> diagonal_test(const Series& series, const std::vector<int>& moving) {
  if (series.sensor().quantity != Quantity::Displacement) return std::nullopt;
  const auto signs = signs_of(series, moving);
  if (!signs) return std::nullopt;
  const Channel& sensor = series.sensor();
  const auto along = [&](std::size_t i) {
    const metrology::Bodies nominal = nominal_at(series, i);
    return metrology::reading(series.optics(), series.channel, {}, nominal, nominal);
  };
  // a straight way along the beam, or it is no diagonal
  const Vector3d start = place_w(series, series.look(0).state.q);
  for (std::size_t i = 1; i < series.looks.size(); ++i) {
    const Vector3d way = place_w(series, series.look(i).state.q) - start;
    if ((way - way.dot(sensor.direction_in) * sensor.direction_in).norm() > 1e-6 * (1 + way.norm()))
      return std::nullopt;
  }
  const int leading = moving.front();
  const int sign =
      (*signs)[std::size_t(series.readings.nominal.joints()[std::size_t(leading)].name - 'X')];
  auto runs = runs_of(series, along, [&](std::size_t i) {
    return sign * series.look(i).state.direction[std::size_t(leading)] >= 0;
  });
  if (!runs) return std::nullopt;
  const double zero = runs->up.cols() > 0 ? runs->up.row(0).mean() : runs->down.row(0).mean();
  runs->up.array() -= zero;
  runs->down.array() -= zero;
  return DiagonalTest{series.name(), {*signs, std::move(*runs)}};
}

/// The two slides of a circle by letter; nothing if other axes move.
std::optional<std::array<int, 2>> slides_of_circle(const Series& series,
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

/// Looks of one run in one sense, with the angle about the socket going on without jumps.
struct Pass {
  int run = 0;
  std::vector<std::size_t> looks;
  std::vector<double> angle;
};

// A sense ends where the run does or where a target is read again before the way back.
std::vector<Pass> passes_of(const Series& series, const Eigen::Matrix<double, 3, 2>& plane) {
  std::vector<Pass> passes;
  int step = 0;
  for (std::size_t i = 0; i < series.looks.size(); ++i) {
    const Look& look = series.look(i);
    const Eigen::Vector2d arm =
        plane.transpose() * (place_w(series, look.state.q) - series.sensor().point_in);
    double angle = std::atan2(arm.y(), arm.x());
    const int way = i > 0 ? look.target - series.look(i - 1).target : 0;
    const bool goes_on = !passes.empty() && passes.back().run == look.run && way != 0 &&
                         (passes.back().looks.size() < 2 || way * step > 0);
    if (!goes_on) passes.push_back({look.run, {}, {}});
    Pass& pass = passes.back();
    if (!pass.angle.empty())
      angle = pass.angle.back() + std::remainder(angle - pass.angle.back(), 2 * pi);
    step = way;
    pass.looks.push_back(i);
    pass.angle.push_back(angle);
  }
  return passes;
}

/// One circle a run.
std::vector<CircleTest> circle_tests(const Series& series, const std::vector<int>& moving) {
  const auto slides = slides_of_circle(series, moving);
  if (!slides) return {};
  const auto& q0 = series.look(0).state.q;
  const double radius = (place_w(series, q0) - series.sensor().point_in).norm();
  for (std::size_t i = 1; i < series.looks.size(); ++i) {
    const Vector3d arm = place_w(series, series.look(i).state.q) - series.sensor().point_in;
    if (std::abs(arm.norm() - radius) > 1e-6 * radius) return {};
  }
  Eigen::Matrix<double, 3, 2> plane;
  for (int k = 0; k < 2; ++k) {
    kinematics::AxisVector q = q0;
    q[(*slides)[std::size_t(k)]] += 1.0;
    plane.col(k) = place_w(series, q) - place_w(series, q0);
  }
  plane.col(0).normalize();
  plane.col(1) -= plane.col(1).dot(plane.col(0)) * plane.col(0);
  plane.col(1).normalize();
  std::map<int, CircleTest> circles;
  for (const Pass& pass : passes_of(series, plane)) {
    if (pass.looks.size() < 3) return {};
    CircleTest& test = circles[pass.run];
    const bool rises = pass.angle.back() > pass.angle.front();
    metrology::CircularTrace& trace = rises ? test.runs.anticlockwise : test.runs.clockwise;
    if (trace.angle.size() > 0) return {};  // the same sense twice in a run
    trace.angle = VectorXd::Map(pass.angle.data(), Index(pass.angle.size()));
    trace.radius.resize(trace.angle.size());
    for (std::size_t i = 0; i < pass.looks.size(); ++i)
      trace.radius[Index(i)] = series.readings.value[Index(series.looks[pass.looks[i]])];
  }
  std::vector<CircleTest> result;
  for (auto& [run, test] : circles) {
    test.name =
        circles.size() > 1 ? fmt::format("{}, run {}", series.name(), run + 1) : series.name();
    for (const int joint : *slides)
      test.plane += series.readings.nominal.joints()[std::size_t(joint)].name;
    test.runs.nominal_radius = radius;
    test.zero_known = !series.optics().zero_unknown;
    result.push_back(std::move(test));
  }
  return result;
}

/// Channels of a set-up over time, the axes at rest.
std::optional<DriftTest> drift_test(const std::vector<Series>& channels) {
  const Series& first = channels.front();
  DriftTest test;
  test.name = first.optics().name;
  const auto n = Index(first.looks.size());
  test.log.time_s.resize(n);
  test.log.values.resize(n, Index(channels.size()));
  for (std::size_t c = 0; c < channels.size(); ++c) {
    if (Index(channels[c].looks.size()) != n) return std::nullopt;
    const VectorXd value = deviations(channels[c]);
    test.log.names.push_back(channels[c].sensor().name);
    test.angle.push_back(channels[c].sensor().is_angle());
    test.log.values.col(Index(c)) = value.array() - value[0];
  }
  for (Index i = 0; i < n; ++i) {
    test.log.time_s[i] = first.look(std::size_t(i)).state.time_s;
    if (i > 0 && !(test.log.time_s[i] > test.log.time_s[i - 1])) return std::nullopt;
  }
  if (n < 2) return std::nullopt;
  return test;
}

/// Where the axes stand at each look, whole turns left out.
Eigen::MatrixXd places_of(const Series& series) {
  const auto& joints = series.readings.nominal.joints();
  Eigen::MatrixXd places(Index(series.looks.size()), 2 * Index(joints.size()));
  for (Index i = 0; i < places.rows(); ++i) {
    const kinematics::AxisVector& q = series.look(std::size_t(i)).state.q;
    for (Index j = 0; j < q.size(); ++j) {
      const bool slides = joints[std::size_t(j)].motion == kinematics::Motion::Linear;
      places(i, 2 * j) = slides ? q[j] : std::cos(q[j]);
      places(i, 2 * j + 1) = slides ? 0.0 : std::sin(q[j]);
    }
  }
  return places;
}

OtherTest other_test(const Series& series) {
  constexpr double one_place = 1e-9;  // mm or rad
  OtherTest test{series.name(), series.sensor().is_angle(), deviations(series),
                 metrology::place_shares(places_of(series), one_place)};
  test.share /= test.share.sum();
  if (test.deviation.size() > 1) test.deviation.array() -= test.share.dot(test.deviation);
  return test;
}

/// Channels that were read once, as those of a tracker at every place, are one test of their kind.
void join_single_readings(std::vector<OtherTest>& tests) {
  std::vector<OtherTest> joined;
  std::array<std::vector<double>, 2> single;
  for (OtherTest& test : tests) {
    if (test.deviation.size() == 1)
      single[test.angle ? 1 : 0].push_back(test.deviation[0]);
    else
      joined.push_back(std::move(test));
  }
  for (const bool angle : {false, true}) {
    const std::vector<double>& all = single[angle ? 1 : 0];
    if (all.empty()) continue;
    VectorXd value = VectorXd::Map(all.data(), Index(all.size()));
    value.array() -= value.mean();
    VectorXd share = VectorXd::Constant(value.size(), 1.0 / double(value.size()));
    joined.push_back({angle ? "angles read once each" : "lengths read once each", angle,
                      std::move(value), std::move(share)});
  }
  tests = std::move(joined);
}

void sort_set_up(const std::vector<Series>& channels, Tests& tests) {
  std::vector<AxisTest> lines;
  std::set<char> axes;
  bool rest = true;
  for (const Series& series : channels) rest = rest && moving_joints(series).empty();
  if (rest) {
    if (auto drift = drift_test(channels)) {
      tests.drifts.push_back(std::move(*drift));
      return;
    }
  }
  for (const Series& series : channels) {
    const std::vector<int> moving = moving_joints(series);
    if (moving.size() == 1) {
      if (auto test = axis_test(series, moving.front())) {
        axes.insert(test->axis);
        lines.push_back(std::move(*test));
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
  const bool square = lines.size() == 2 && axes.size() == 2 &&
                      lines[0].what == AxisTest::What::Straightness &&
                      lines[1].what == AxisTest::What::Straightness;
  if (square) tests.squares.push_back({channels.front().optics().name, lines[0], lines[1]});
  for (AxisTest& line : lines) tests.axes.push_back(std::move(line));
}

}  // namespace

VectorXd mean_of(const metrology::PositionRuns& runs) {
  VectorXd sum = VectorXd::Zero(runs.target.size());
  if (runs.up.cols() > 0) sum += runs.up.rowwise().sum();
  if (runs.down.cols() > 0) sum += runs.down.rowwise().sum();
  return sum / double(runs.up.cols() + runs.down.cols());
}

bool hides_in_centring(const AxisTest& test) {
  if (test.what != AxisTest::What::ErrorMotion || test.axial) return false;
  Eigen::MatrixX2d place(test.runs.target.size(), 2);
  place << test.runs.target.array().cos(), test.runs.target.array().sin();
  return metrology::place_shares(place, 1e-9).sum() < 3.5;
}

metrology::PositionRuns form_of(const AxisTest& test) {
  metrology::PositionRuns runs = test.runs;
  const VectorXd& t = runs.target;
  Eigen::MatrixXd set_up = Eigen::MatrixXd::Ones(t.size(), 1);
  VectorXd root = VectorXd::Ones(t.size());
  if (test.what == AxisTest::What::Straightness) {
    set_up.conservativeResize(Eigen::NoChange, 2);
    set_up.col(1) = t.array() - t.mean();
  } else if (test.what != AxisTest::What::ErrorMotion) {
    return runs;
  } else {
    root = metrology::arc_shares(t).cwiseSqrt();
    if (!test.axial && !hides_in_centring(test)) {
      set_up.conservativeResize(Eigen::NoChange, 3);
      set_up.col(1) = t.array().cos();
      set_up.col(2) = t.array().sin();
    }
  }
  const Eigen::MatrixXd weighted = root.asDiagonal() * set_up;
  const VectorXd added =
      set_up * least_squares(weighted, VectorXd(root.cwiseProduct(mean_of(runs)))).x;
  runs.up.colwise() -= added;
  runs.down.colwise() -= added;
  return runs;
}

Tests tests_of(const Readings& readings) {
  Tests tests;
  const auto& plan = readings.plan;
  std::vector<std::vector<Series>> set_ups(plan.set_ups.size());
  for (std::size_t s = 0; s < set_ups.size(); ++s)
    for (std::size_t c = 0; c < plan.set_ups[s].channels.size(); ++c)
      set_ups[s].push_back({readings, int(s), int(c), {}});
  for (std::size_t i = 0; i < plan.looks.size(); ++i)
    set_ups[std::size_t(plan.looks[i].set_up)][std::size_t(plan.looks[i].channel)].looks.push_back(
        i);
  for (const std::vector<Series>& all : set_ups) {
    std::vector<Series> channels;
    for (const Series& one : all)
      if (!one.looks.empty()) channels.push_back(one);
    if (!channels.empty()) sort_set_up(channels, tests);
  }
  join_single_readings(tests.others);
  return tests;
}

}  // namespace abbe::sim
