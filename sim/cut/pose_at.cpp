#include "sim/cut/pose_at.h"

#include <charconv>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "sim/cut/pose_doubts.h"

namespace abbe::sim {

kinematics::AxisVector positions_in(const std::string& at, const kinematics::Chain& chain,
                                    const std::string& option, Within within) {
  const auto refuse = [&](std::size_t column, const std::string& expected,
                          const std::string& seen) {
    throw BadInput(option, 1, int(column) + 1, expected, seen);
  };
  kinematics::AxisVector q = kinematics::AxisVector::Zero(chain.size());
  std::set<char> seen;
  std::size_t i = 0;
  while (true) {
    while (i < at.size() && (at[i] == ' ' || at[i] == ',')) ++i;
    if (i == at.size()) return q;
    const auto joint = chain.find(at[i]);
    if (!joint || !is_positioned(chain.joints()[std::size_t(*joint)]))
      refuse(i, "an axis of this machine (" + axis_names(chain) + ")",
             "'" + std::string(1, at[i]) + "'");
    if (!seen.insert(at[i]).second)
      refuse(i, "every axis once", "'" + std::string(1, at[i]) + "' again");
    const std::size_t start = i++;
    if (i < at.size() && at[i] == '=') ++i;
    double value = 0.0;
    const auto [end, error] = std::from_chars(at.data() + i, at.data() + at.size(), value);
    if (error != std::errc() || !std::isfinite(value))
      refuse(i, "a number in mm or degrees", "'" + at.substr(i, at.find(' ', i) - i) + "'");
    i = std::size_t(end - at.data());
    const kinematics::Joint& axis = chain.joints()[std::size_t(*joint)];
    q[*joint] = value * position_unit(axis);
    if (within == Within::Travel && (q[*joint] < axis.min || q[*joint] > axis.max))
      refuse(start, travel_text(axis), fmt::format("{:.9g}", value));
  }
}

PoseAt pose_at(const Scene& scene, const std::string& at, const PoseWishes& wishes) {
  const IdleMachine idle = idle_machine(scene);
  const PoseTable table(idle, wishes);
  kinematics::AxisState state;
  state.q = positions_in(at, idle.machine.nominal, "--at", Within::Travel);
  const auto wished = [](const auto& all) {
    return std::vector(all.begin() + std::ptrdiff_t(PoseTable::always), all.end());
  };
  try {
    return {tip_pose(idle, state), table.wished(), wished(table.heads()),
            wished(table.row(state).numbers), doubts(idle, state.q, state.q)};
  } catch (const std::out_of_range& left) {
    throw BadInput("--at", 1, 0, "positions inside the tables of the errors", left.what());
  }
}

}  // namespace abbe::sim
