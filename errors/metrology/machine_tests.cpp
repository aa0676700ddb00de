#include "errors/metrology/machine_tests.h"

#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "errors/metrology/shares.h"

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

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
                 place_shares(places_of(series), one_place)};
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

}  // namespace abbe::errors::metrology
