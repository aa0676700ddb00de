#include "sim/pose_at.h"

#include <charconv>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/units.h"
#include "sim/activity.h"
#include "sim/run_out.h"
#include "sim/truth.h"

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

std::string axis_names(const kinematics::Chain& chain) {
  std::string names;
  for (const kinematics::Joint& joint : chain.joints())
    if (joint.motion != kinematics::Motion::Spindle)
      names += std::string(names.empty() ? "" : " ") + joint.name;
  return names;
}

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
    if (!joint || chain.joints()[std::size_t(*joint)].motion == kinematics::Motion::Spindle)
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
    const bool linear = chain.joints()[std::size_t(*joint)].motion == kinematics::Motion::Linear;
    q[*joint] = linear ? value : value * units::deg;
    const kinematics::Joint& axis = chain.joints()[std::size_t(*joint)];
    const double unit = linear ? 1.0 : units::deg;
    if (q[*joint] < axis.min || q[*joint] > axis.max)
      refuse(start,
             fmt::format("{} between {:.6g} and {:.6g} {}", axis.name, axis.min / unit,
                         axis.max / unit, linear ? "mm" : "deg"),
             fmt::format("{:.9g}", value));
  }
}

}  // namespace

ordered_json pose_at(const Scene& described, const std::string& at) {
  const Scene scene = with_run_out(described);
  const Machine machine = compile(scene);
  const Truth truth = truth_of(scene, machine, activity(scene, machine, {}, {}));
  kinematics::AxisState state;
  state.q = parse_positions(machine.nominal, at);
  const kinematics::Pose nominal = machine.nominal.tool_in_workpiece(state.q);
  kinematics::Pose actual;
  try {
    actual = tool_in_workpiece(truth, state);
  } catch (const std::out_of_range& left) {
    throw BadInput("--at", 1, 0, "positions inside the tables of the errors", left.what());
  }
  return {{"T_wt_nominal", rows(nominal)},
          {"T_wt_actual", rows(actual)},
          {"deviation_mm", numbers(actual.translation() - nominal.translation())},
          {"direction_rad", numbers(actual.linear().col(2) - nominal.linear().col(2))},
          {"E", rows(kinematics::error_transform(nominal, actual))}};
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
  return text;
}

}  // namespace abbe::sim
