#include "errors/metrology/readings.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/curve.h"

namespace abbe::errors::metrology {
namespace {

using kinematics::AxisState;

// Noise and set-ups draw from two streams, so that a longer plan leaves the first readings alone.
constexpr std::uint64_t set_up_stream = 0x5e7095e7095e7095ull;

bool same(const AxisState& a, const AxisState& b) {
  return a.time_s == b.time_s && a.q == b.q && a.direction == b.direction && a.stroke == b.stroke &&
         a.spindle_speed == b.spindle_speed;
}

bool reads_temperatures_alone(const Plan& plan) {
  for (const SetUp& set_up : plan.set_ups)
    if (!set_up.channels.empty()) return false;
  return true;
}

void check(const Plan& plan, const kinematics::Chain& nominal) {
  for (std::size_t i = 0; i < plan.looks.size(); ++i) {
    const Look& look = plan.looks[i];
    const auto refuse = [&](const std::string& what, int seen) {
      throw std::invalid_argument(fmt::format("reading {} of {}: expected {}, seen {}", i + 1,
                                              plan.instrument, what, seen));
    };
    const int set_ups = int(plan.set_ups.size());
    if (look.set_up < 0 || look.set_up >= set_ups)
      refuse(fmt::format("one of {} set-ups", set_ups), look.set_up);
    const int channels = int(plan.set_ups[std::size_t(look.set_up)].channels.size());
    if (channels > 0 && (look.channel < 0 || look.channel >= channels))
      refuse(fmt::format("one of {} channels", channels), look.channel);
    if (look.state.q.size() != nominal.size())
      refuse(fmt::format("{} axis positions", nominal.size()), int(look.state.q.size()));
    if (!look.state.q.allFinite() || !std::isfinite(look.state.time_s))
      throw std::invalid_argument(
          fmt::format("reading {} of {}: expected finite positions", i + 1, plan.instrument));
  }
}

/// A set-up as it stands: its counters are set when they are first read.
struct Standing {
  Misalignment misalignment;
  std::vector<char> is_set;  ///< (channels)
};

/// Everything that is drawn when the set-ups are made.
std::vector<Standing> stand_up(const Plan& plan, std::uint64_t seed) {
  std::vector<Standing> result;
  std::uint64_t counter = 0;
  for (const SetUp& set_up : plan.set_ups) {
    const std::vector<SetUpUnknown> list = unknowns(set_up);
    Eigen::VectorXd v = Eigen::VectorXd::Zero(Eigen::Index(list.size()));
    for (std::size_t i = 0; i < list.size(); ++i)
      if (std::isfinite(list[i].sigma))
        v[Eigen::Index(i)] = list[i].sigma * normal_deviate(seed ^ set_up_stream, counter++);
    Misalignment m = misalignment(set_up, v);
    m.zero = Eigen::VectorXd::Zero(Eigen::Index(set_up.channels.size()));
    result.push_back({m, std::vector<char>(set_up.channels.size(), 0)});
  }
  return result;
}

/// What one look meets.
struct Instant {
  const Bodies& actual;
  const Bodies& ideal;
  double spindle_angle;
  double since_s;
};

double shown(Standing& standing, const SetUp& set_up, int channel, const Instant& at) {
  const auto now = [&](const Misalignment& m) {
    return reading(set_up, channel, m, at.actual, at.ideal, at.spindle_angle, at.since_s);
  };
  char& is_set = standing.is_set[std::size_t(channel)];
  if (set_up.zero_unknown && !is_set) {  // the counter is set to what it should show
    standing.misalignment.zero[channel] =
        reading(set_up, channel, {}, at.ideal, at.ideal) - now(standing.misalignment);
    is_set = 1;
  }
  return now(standing.misalignment);
}

}  // namespace

double rounded(double value, double resolution) {
  return resolution > 0.0 ? std::round(value / resolution) * resolution : value;
}

Readings measure(const Plan& plan, const kinematics::Chain& nominal,
                 const MachineUnderTest& machine, std::uint64_t seed) {
  check(plan, nominal);
  Readings readings{plan, nominal, {}, {}, {}};
  if (reads_temperatures_alone(plan)) return readings;

  std::vector<Standing> standing = stand_up(plan, seed);
  const Eigen::VectorXd since_s = since_set_up(plan);
  readings.value.setZero(Eigen::Index(plan.looks.size()));
  Bodies actual, ideal;
  for (std::size_t i = 0; i < plan.looks.size(); ++i) {
    const Look& look = plan.looks[i];
    if (i == 0 || !same(look.state, plan.looks[i - 1].state)) {
      actual = machine(look.state);
      ideal = nominal_bodies(nominal, look.state.q);
    }
    const SetUp& set_up = plan.set_ups[std::size_t(look.set_up)];
    if (set_up.channels.empty()) continue;
    const Channel& channel = set_up.channels[std::size_t(look.channel)];
    const double value =
        shown(standing[std::size_t(look.set_up)], set_up, look.channel,
              {actual, ideal, spindle_angle(nominal, look.state), since_s[Eigen::Index(i)]}) +
        channel.noise * normal_deviate(seed, i);
    if (!std::isfinite(value))
      throw std::invalid_argument(fmt::format("reading {} of {} ({}): expected a finite number",
                                              i + 1, plan.instrument, channel.name));
    readings.value[Eigen::Index(i)] = rounded(value, channel.resolution);
  }
  return readings;
}

Bodies nominal_bodies(const kinematics::Chain& nominal, const kinematics::AxisVector& q) {
  return {nominal.workpiece_in_bed(q), nominal.tool_in_bed(q)};
}

double standard_deviation(const Channel& channel) {
  return std::sqrt(channel.noise * channel.noise + channel.resolution * channel.resolution / 12.0);
}

double spindle_angle(const kinematics::Chain& nominal, const kinematics::AxisState& state) {
  const std::optional<int> nose = nominal.find('s');
  return nose ? state.q[*nose] : 0.0;
}

Eigen::VectorXd since_set_up(const Plan& plan) {
  std::vector<double> first(plan.set_ups.size(), std::numeric_limits<double>::quiet_NaN());
  Eigen::VectorXd since_s(Eigen::Index(plan.looks.size()));
  for (std::size_t i = 0; i < plan.looks.size(); ++i) {
    const Look& look = plan.looks[i];
    double& start = first[std::size_t(look.set_up)];
    if (std::isnan(start)) start = look.state.time_s;
    since_s[Eigen::Index(i)] = look.state.time_s - start;
  }
  return since_s;
}

}  // namespace abbe::errors::metrology
