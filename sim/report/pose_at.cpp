#include "sim/report/pose_at.h"

#include <charconv>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"
#include "sim/cut/pose.h"
#include "sim/cut/pose_doubts.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

ordered_json rows(const kinematics::Pose& T) {
  ordered_json all = ordered_json::array();
  for (int i = 0; i < 4; ++i)
    all.push_back({T.matrix()(i, 0), T.matrix()(i, 1), T.matrix()(i, 2), T.matrix()(i, 3)});
  return all;
}

ordered_json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

kinematics::AxisVector parse_positions(const kinematics::Chain& chain, const std::string& at) {
  const auto refuse = [&](std::size_t column, const std::string& expected,
                          const std::string& seen) {
    throw BadInput("--at", 1, int(column) + 1, expected, seen);
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
    if (q[*joint] < axis.min || q[*joint] > axis.max)
      refuse(start, travel_text(axis), fmt::format("{:.9g}", value));
  }
}

/// What was wished beside the deviation, by head.
ordered_json columns(const PoseTable& table, const kinematics::AxisState& state) {
  const PoseTable::Row row = table.row(state);
  ordered_json json = ordered_json::object();
  for (std::size_t i = PoseTable::always; i < row.numbers.size(); ++i)
    json[table.heads()[i]] = row.numbers[i];
  return json;
}

}  // namespace

ordered_json pose_at(const Scene& scene, const std::string& at, const PoseWishes& wishes) {
  const IdleMachine idle = idle_machine(scene);
  const PoseTable table(idle, wishes);
  kinematics::AxisState state;
  state.q = parse_positions(idle.machine.nominal, at);
  try {
    const TipPose pose = tip_pose(idle, state);
    return {{"T_wt_nominal", rows(pose.nominal)},
            {"T_wt_actual", rows(pose.actual)},
            {"deviation_mm", numbers(pose.deviation())},
            {"direction_rad", numbers(pose.direction())},
            {"E", rows(kinematics::error_transform(pose.nominal, pose.actual))},
            {"columns", columns(table, state)},
            {"warnings", doubts(idle, state.q, state.q)}};
  } catch (const std::out_of_range& left) {
    throw BadInput("--at", 1, 0, "positions inside the tables of the errors", left.what());
  }
}

std::string pose_text(const ordered_json& pose) {
  std::string text;
  for (const char* key : {"T_wt_nominal", "T_wt_actual", "E"}) {
    text += fmt::format("{}\n", key);
    for (const auto& row : pose[key])
      text += fmt::format("  {:16.9f} {:16.9f} {:16.9f} {:16.9f}\n", row[0].get<double>(),
                          row[1].get<double>(), row[2].get<double>(), row[3].get<double>());
  }
  const auto& d = pose["deviation_mm"];
  const auto& u = pose["direction_rad"];
  text += fmt::format("deviation of the tip    {:10.4f} {:10.4f} {:10.4f} um, workpiece frame\n",
                      d[0].get<double>() / units::um, d[1].get<double>() / units::um,
                      d[2].get<double>() / units::um);
  text += fmt::format("deviation of direction  {:10.4f} {:10.4f} {:10.4f} urad\n",
                      u[0].get<double>() / units::urad, u[1].get<double>() / units::urad,
                      u[2].get<double>() / units::urad);
  std::string last;
  for (const auto& [head, value] : pose["columns"].items()) {
    // heads come six at a time: EXX_x_um ... EXX_z_urad, dx_dX ... dc_dX
    const bool jacobian = head.find("_d") == 2 && head.size() > 4;
    const std::string row =
        jacobian ? "d/d" + head.substr(4) : head.substr(0, head.rfind("_", head.rfind("_") - 1));
    if (row != last)
      text +=
          fmt::format("{}{:<22}", last.empty() ? "" : "\n", row + (jacobian ? "" : ", um, urad"));
    last = row;
    text += fmt::format(" {:12.6g}", value.get<double>());
  }
  if (!last.empty()) text += "\n";
  return text;
}

}  // namespace abbe::sim
