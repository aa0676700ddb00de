#include "errors/identification/step_path.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>

#include <fmt/format.h>

namespace abbe::errors::identification {

using Eigen::Index;
using Eigen::Vector3d;
using kinematics::Chain;
using kinematics::Joint;
using metrology::Look;
using metrology::Readings;

namespace {

constexpr double same_place = 1e-6;  // mm

void check_diagonals(const Readings& readings) {
  const metrology::Plan& plan = readings.plan;
  if (plan.set_ups.size() != 4)
    refuse_diagonals(fmt::format("expected four diagonals, seen {}", plan.set_ups.size()));
  for (const metrology::SetUp& set_up : plan.set_ups)
    if (set_up.channels.size() != 1 || set_up.channels[0].is_angle() ||
        set_up.channels[0].quantity == metrology::Quantity::Length)
      refuse_diagonals("expected one beam along each diagonal");
  if (plan.looks.empty() || readings.value.size() != Index(plan.looks.size()) ||
      !readings.value.allFinite())
    refuse_diagonals("expected one finite reading at every look");
  for (const Look& look : plan.looks)
    if (look.set_up < 0 || look.set_up > 3 || look.channel != 0 ||
        look.state.q.size() != readings.nominal.size())
      refuse_diagonals("expected looks along four diagonals");
}

int joint_index(const Chain& chain, int axis) { return *chain.find(slides[std::size_t(axis)]); }

/// The slide that moved between two states, -1 if not exactly one did and nothing else.
int moved(const Chain& chain, const kinematics::AxisVector& a, const kinematics::AxisVector& b) {
  int which = -1;
  for (int j = 0; j < chain.size(); ++j) {
    if (std::abs(b[j] - a[j]) <= same_place) continue;
    int axis = 0;
    while (axis < 3 && joint_index(chain, axis) != j) ++axis;
    if (which >= 0 || axis == 3) return -1;
    which = axis;
  }
  return which;
}

void add_place(std::vector<double>& places, double q) {
  const auto at = std::lower_bound(places.begin(), places.end(), q - same_place);
  if (at == places.end() || *at > q + same_place) places.insert(at, q);
}

int interval_of(const std::vector<double>& places, double a, double b) {
  const double low = std::min(a, b);
  const auto at = std::lower_bound(places.begin(), places.end(), low - same_place);
  const auto next = at + 1;
  if (next == places.end() || std::abs(*next - std::max(a, b)) > same_place)
    refuse_diagonals("expected the same steps on every diagonal");
  return int(at - places.begin());
}

}  // namespace

void refuse_diagonals(const std::string& why) {
  throw std::invalid_argument("step diagonal: " + why);
}

Joint slide(const Chain& chain, int axis) {
  const auto joint = chain.find(slides[std::size_t(axis)]);
  if (!joint) refuse_diagonals(fmt::format("expected a slide {}", slides[std::size_t(axis)]));
  const Joint& j = chain.joints()[std::size_t(*joint)];
  if (j.motion != kinematics::Motion::Linear ||
      (j.direction_b - Vector3d::Unit(axis)).norm() > 1e-9)
    refuse_diagonals(
        fmt::format("expected {} along its axis of the bed", slides[std::size_t(axis)]));
  return j;
}

StepPath step_path(const Readings& readings) {
  check_diagonals(readings);
  const Chain& chain = readings.nominal;
  const std::vector<Look>& looks = readings.plan.looks;
  std::array<Joint, 3> joints = {slide(chain, 0), slide(chain, 1), slide(chain, 2)};
  std::map<std::pair<int, int>, std::size_t> last;  // of each set-up and run
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  StepPath path;
  for (std::size_t i = 0; i < looks.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis)
      add_place(path.steps[std::size_t(axis)], looks[i].state.q[joint_index(chain, axis)]);
    const auto before = last.find({looks[i].set_up, looks[i].run});
    if (before != last.end()) pairs.emplace_back(before->second, i);
    last[{looks[i].set_up, looks[i].run}] = i;
  }
  for (const auto& [from, to] : pairs) {
    const auto& q_from = looks[from].state.q;
    const auto& q_to = looks[to].state.q;
    const int axis = moved(chain, q_from, q_to);
    if (axis < 0) refuse_diagonals("expected readings that are one step of X, Y or Z apart");
    const int j = joint_index(chain, axis);
    const metrology::Channel& channel =
        readings.plan.set_ups[std::size_t(looks[to].set_up)].channels[0];
    const metrology::ReadingGradient g =
        metrology::gradient(channel, metrology::nominal_bodies(chain, q_to));
    const bool primed = joints[std::size_t(axis)].side == kinematics::Side::Workpiece;
    const Vector3d direction = primed ? g.workpiece.head<3>() : g.tool.head<3>();
    const double way = q_to[j] > q_from[j] ? 1.0 : -1.0;
    path.legs.push_back({axis, interval_of(path.steps[std::size_t(axis)], q_from[j], q_to[j]),
                         looks[to].set_up, way * direction, Index(from), Index(to)});
  }
  return path;
}

}  // namespace abbe::errors::identification
