#include "sim/cut/pose_shares.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "kinematics/jacobian.h"
#include "kinematics/text.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;
using kinematics::Chain;
using kinematics::Deviation;
using kinematics::JointDeviation;
using kinematics::Pose;
using Effect = Eigen::Matrix<double, 6, 1>;  // [tip mm | axis rad]

/// Tool as it is on the workpiece as it should be clamped.
Chain with_real_tool(const IdleMachine& idle) {
  const Chain& nominal = idle.machine.nominal;
  return {nominal.joints(), nominal.T_bw_home(), idle.truth.actual.T_bt_home()};
}

void add_geometric(const IdleMachine& idle, std::vector<ErrorSource>& all) {
  for (const errors::Element& element : idle.scene.geometric.elements) {
    errors::GeometricErrors alone = idle.scene.geometric;
    alone.elements = {element};
    alone.covariance = {};
    all.push_back({to_string(element.name),
                   scaled(errors::bind(alone, idle.truth.actual), idle.scene.error_scale)});
  }
}

void add_vibrations(const IdleMachine& idle, std::vector<ErrorSource>& all) {
  std::map<std::string, std::vector<errors::Vibration>> by_element;
  for (const errors::Vibration& one : idle.scene.vibrations)
    by_element[to_string(one.name)].push_back(one);
  for (const auto& [name, harmonics] : by_element)
    all.push_back({name + "_vibration", errors::bind(harmonics, idle.machine.nominal)});
}

void add_heat(const IdleMachine& idle, std::vector<ErrorSource>& all) {
  if (!idle.truth.heat) return;
  const ThermalDescription& thermal = *idle.scene.thermal;
  const auto add = [&](const std::string& name, errors::ThermalErrors alone) {
    alone.reference_T_C = thermal.errors.reference_T_C;
    const int nodes = int(thermal.network.nodes.size());
    all.push_back({name, scaled(errors::bind(alone, idle.machine.nominal, nodes), thermal.scale)});
  };
  for (const errors::ThermalElement& element : thermal.errors.elements)
    add(to_string(element.name) + "_heat", {{element}, {}, {}, {}});
  for (const errors::AxisExpansion& axis : thermal.errors.expansions)
    add(axis.axis + std::string("_expansion"), {{}, {axis}, {}, {}});
  if (idle.truth.heat->model.workpiece)
    all.push_back({"part_expansion", ErrorSource::PartExpansion{}});
}

/// The chain at a pose, ready to carry deviations to the tip to first order.
struct Base {
  const IdleMachine& idle;
  const kinematics::AxisState& state;
  Pose T_wt;
  Eigen::MatrixXd of_motion, of_location;  ///< (6 x 6 joints) Jacobians
  Eigen::VectorXd T_C;                     ///< (nodes), empty without heat

  Effect effect(const Deviation& moved_w) const {
    Effect result;
    result << moved_w.head<3>(), moved_w.tail<3>().cross(T_wt.linear().col(2));
    return result;
  }

  Deviation carried(const std::vector<JointDeviation>& joints) const {
    Deviation sum = Deviation::Zero();
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const auto at = 6 * Eigen::Index(i);
      if (!joints[i].motion.isZero(0.0)) sum += of_motion.middleCols<6>(at) * joints[i].motion;
      if (!joints[i].location.isZero(0.0))
        sum += of_location.middleCols<6>(at) * joints[i].location;
    }
    return sum;
  }
};

Effect difference(const Pose& after, const Pose& before) {
  Effect result;
  result << after.translation() - before.translation(),
      after.linear().col(2) - before.linear().col(2);
  return result;
}

Effect effect_of(const Base& base, const errors::GeometricModel& model) {
  return base.effect(base.carried(errors::deviations(model, base.state)));
}

Effect effect_of(const Base& base, const errors::ThermalModel& model) {
  return base.effect(base.carried(errors::deviations(model, base.state.q, base.T_C)));
}

Effect effect_of(const Base& base, const errors::VibrationModel& model) {
  const auto spindle = base.idle.truth.spindle;
  return base.effect(base.carried(
      errors::deviations(model, base.state.spindle_speed, spindle ? base.state.q[*spindle] : 0.0)));
}

Effect effect_of(const Base& base, ErrorSource::Tool) {
  return difference(with_real_tool(base.idle).tool_in_workpiece(base.state.q),
                    base.idle.machine.nominal.tool_in_workpiece(base.state.q));
}

Effect effect_of(const Base& base, ErrorSource::Clamping) {
  return difference(base.T_wt, with_real_tool(base.idle).tool_in_workpiece(base.state.q));
}

Effect effect_of(const Base& base, ErrorSource::Compliance) {
  const errors::ForceDeviations all =
      errors::deviations(*base.idle.truth.compliance, base.state, {});
  Deviation moved_w = base.carried(all.joints);
  const Eigen::Matrix3d R = base.T_wt.linear();
  moved_w.head<3>() += R * all.tool_t.head<3>();
  moved_w.tail<3>() += R * all.tool_t.tail<3>();
  const Vector3d turn_w = all.workpiece_w.tail<3>();
  moved_w.head<3>() -= all.workpiece_w.head<3>() + turn_w.cross(base.T_wt.translation());
  moved_w.tail<3>() -= turn_w;
  return base.effect(moved_w);
}

Effect effect_of(const Base& base, ErrorSource::PartExpansion) {
  const Vector3d tip_w = base.T_wt.translation();
  Effect result = Effect::Zero();
  result.head<3>() = errors::at_20_C(base.idle.truth.heat->model, base.T_C, tip_w) - tip_w;
  return result;
}

}  // namespace

std::vector<ErrorSource> error_sources(const IdleMachine& idle) {
  std::vector<ErrorSource> all;
  const Chain &nominal = idle.machine.nominal, &actual = idle.truth.actual;
  if (nominal.T_bt_home().matrix() != actual.T_bt_home().matrix())
    all.push_back({"tool", ErrorSource::Tool{}});
  if (nominal.T_bw_home().matrix() != actual.T_bw_home().matrix())
    all.push_back({"clamping", ErrorSource::Clamping{}});
  add_geometric(idle, all);
  add_vibrations(idle, all);
  add_heat(idle, all);
  if (idle.truth.compliance &&
      (idle.truth.compliance->gravity_b || !idle.truth.compliance->clamping_w.isZero(0.0)))
    all.push_back({"compliance", ErrorSource::Compliance{}});
  return all;
}

std::vector<ErrorSource> chosen_sources(std::vector<ErrorSource> all,
                                        const std::vector<std::string>& names) {
  if (names == std::vector<std::string>{"all"}) return all;
  std::vector<ErrorSource> chosen;
  for (const std::string& name : names) {
    const auto named = [&](const ErrorSource& source) { return source.name == name; };
    if (std::any_of(chosen.begin(), chosen.end(), named))
      throw BadInput("--elements", 0, 0, "every name once", in_quotes(name) + " again");
    const auto found = std::find_if(all.begin(), all.end(), named);
    if (found == all.end()) {
      std::string known = "all";
      for (const ErrorSource& source : all) known += " " + source.name;
      throw BadInput("--elements", 0, 0, "what this machine has (" + known + ")", in_quotes(name));
    }
    chosen.push_back(*found);
  }
  return chosen;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> shares(const IdleMachine& idle,
                                                const std::vector<ErrorSource>& sources,
                                                const kinematics::AxisState& state) {
  const Chain& chain = idle.truth.actual;
  const Base base{idle,
                  state,
                  chain.tool_in_workpiece(state.q),
                  kinematics::motion_jacobian(chain, state.q),
                  kinematics::location_jacobian(chain, state.q),
                  idle.truth.heat ? errors::temperatures(idle.truth.heat->run, state.time_s)
                                  : Eigen::VectorXd()};
  Eigen::Matrix<double, 6, Eigen::Dynamic> all(6, Eigen::Index(sources.size()));
  for (std::size_t i = 0; i < sources.size(); ++i)
    all.col(Eigen::Index(i)) =
        std::visit([&](const auto& what) { return effect_of(base, what); }, sources[i].what);
  return all;
}

}  // namespace abbe::sim
