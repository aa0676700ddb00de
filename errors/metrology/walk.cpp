#include "errors/metrology/walk.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::errors::metrology {
namespace {

/// Targets off equal spacing by up to this part of it, each by another, the first and the last by
/// none: the multiples of the golden section fill an interval most evenly.
Eigen::VectorXd scattered(Eigen::VectorXd targets, double part) {
  constexpr double golden = 0.6180339887498949;
  for (Eigen::Index i = 1; i + 1 < targets.size(); ++i) {
    const double whole = golden * double(i);
    const double spacing = (targets[targets.size() - 1] - targets[0]) / double(targets.size() - 1);
    targets[i] += part * spacing * (2.0 * (whole - std::floor(whole)) - 1.0);
  }
  return targets;
}

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

constexpr std::size_t most_looks = 500'000;  // some 80 MB
// A way this short is rounding of the path: an axis that stands has not turned back.
constexpr double still = 1e-9;  // mm or rad
constexpr double slack = 1e-9;  // mm or rad, rounding of a place on a limit

}  // namespace

kinematics::AxisState moved(kinematics::AxisState state, const AxisVector& q) {
  for (int j = 0; j < int(q.size()); ++j) {
    const double way = q[j] - state.q[j];
    if (std::abs(way) <= still) continue;
    const std::int8_t up_or_down = way > 0.0 ? 1 : -1;
    std::int8_t& last = state.direction[std::size_t(j)];
    if (last != 0 && last != up_or_down) ++state.stroke[std::size_t(j)];
    last = up_or_down;
  }
  state.q = q;
  return state;
}

Walk::Walk(const Instrument& instrument, const Chain& nominal, const AxisVector& start)
    : instrument_(instrument), nominal_(nominal) {
  state_.q = start;
  plan_.instrument = instrument.name.empty() ? to_string(instrument.kind) : instrument.name;
  plan_.kind = to_string(instrument.kind);
}

void Walk::set_up(SetUp set_up) {
  set_up.set_up_s = instrument_.set_up_s;
  time_s_ += set_up.set_up_s;
  plan_.set_ups.push_back(std::move(set_up));
}

void Walk::move(const AxisVector& q) {
  double slides = 0.0, turns = 0.0;
  for (int j = 0; j < nominal_.size(); ++j) {
    const Joint& joint = nominal_.joints()[std::size_t(j)];
    const bool linear = joint.motion == Motion::Linear;
    const double unit = linear ? 1.0 : units::deg;
    if (!(q[j] >= joint.min - slack && q[j] <= joint.max + slack))
      refuse(instrument_, fmt::format("expected targets within the travel of {}, {:.6g} to {:.6g} "
                                      "{}, seen {:.6g}",
                                      joint.name, joint.min / unit, joint.max / unit,
                                      linear ? "mm" : "deg", q[j] / unit));
    const double way = q[j] - state_.q[j];
    if (linear)
      slides = std::hypot(slides, way);
    else
      turns = std::max(turns, std::abs(way));
  }
  // A rotary axis turns as fast as takes a point at the instrument's radius along at its speed.
  time_s_ += std::max(slides, turns * instrument_.radius) / instrument_.speed;
  state_ = moved(std::move(state_), q);
}

void Walk::spin(int joint, double angle) {
  const double speed = instrument_.spindle_speed;
  time_s_ += std::abs(angle - state_.q[joint]) / speed;
  state_.q[joint] = angle;
  state_.direction[std::size_t(joint)] = 1;
  state_.spindle_speed = speed;
}

// It comes to rest at 0, where the next set-up begins to count.
void Walk::stop_spindle(int joint) {
  state_.q[joint] = 0.0;
  state_.spindle_speed = 0.0;
}

void Walk::run_spindle() { state_.spindle_speed = instrument_.spindle_speed; }

void Walk::read(int run, int target, const std::vector<int>& channels) {
  state_.time_s = time_s_;
  const int set_up = int(plan_.set_ups.size()) - 1;
  const auto look = [&](int channel) {
    if (plan_.looks.size() >= most_looks)
      refuse(instrument_, fmt::format("expected at most {} readings", most_looks));
    plan_.looks.push_back({set_up, channel, run, target, state_});
  };
  const int all = int(plan_.set_ups.back().channels.size());
  if (all == 0) look(-1);
  if (channels.empty())
    for (int channel = 0; channel < all; ++channel) look(channel);
  for (const int channel : channels) look(channel);
}

void Walk::go_along(const Path& path, double from, double to, int smoothly) {
  for (int i = 1; i <= smoothly; ++i)
    move(path(i == smoothly ? to : from + (to - from) * i / smoothly));
}

void Walk::back_and_forth(const Path& path, const Range& range, int smoothly,
                          const std::vector<int>& channels) {
  const Eigen::VectorXd at = scattered(targets(range, instrument_.targets), instrument_.scatter);
  const int count = int(at.size());
  const double below = range.from - range.overshoot, above = range.to + range.overshoot;
  double here = below;
  const auto go = [&](double there) {
    go_along(path, here, there, smoothly);
    here = there;
  };
  const auto stop = [&](int run, int target) {
    go(at[target]);
    wait(instrument_.dwell_s);
    read(run, target, channels);
  };
  for (int run = 0; run < instrument_.runs; ++run) {
    go(below);
    for (int i = 0; i < count; ++i) stop(run, i);
    if (!instrument_.both_ways) continue;
    go(above);
    for (int i = count - 1; i >= 0; --i) stop(run, i);
  }
}

void Walk::visit(const std::vector<AxisVector>& places,
                 const std::function<std::vector<int>(int)>& channels) {
  const auto stop = [&](int run, int target) {
    move(places[std::size_t(target)]);
    wait(instrument_.dwell_s);
    read(run, target, channels ? channels(target) : std::vector<int>());
  };
  const int count = int(places.size());
  for (int run = 0; run < instrument_.runs; ++run) {
    for (int i = 0; i < count; ++i) stop(run, i);
    if (!instrument_.both_ways) continue;
    for (int i = count - 1; i >= 0; --i) stop(run, i);
  }
}

Plan Walk::finish() && {
  plan_.duration_s = time_s_;
  const double late = plan_.looks.empty() ? 0.0 : plan_.looks.front().state.time_s;
  for (Look& look : plan_.looks) look.state.time_s += instrument_.start_s - late;
  return std::move(plan_);
}

}  // namespace abbe::errors::metrology
