#include "sim/cut/idle_machine.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include <fmt/format.h>

#include "errors/geometric.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/table_file.h"
#include "kinematics/units.h"
#include "sim/cut/process.h"
#include "sim/machine/run_out.h"
#include "sim/machine/truth.h"
#include "sim/scene/toml.h"
#include "sim/scene/value_warnings.h"

namespace abbe::sim {

using kinematics::Joint;
using kinematics::Motion;

IdleMachine idle_machine(const Scene& described) {
  Scene scene = with_run_out(described);
  Machine machine = make_machine(scene);
  Truth truth = make_truth(scene, machine, activity(scene, machine, {}, {}));
  return {std::move(scene), std::move(machine), std::move(truth)};
}

TipPose tip_pose(const IdleMachine& idle, const kinematics::AxisState& state) {
  return {idle.machine.nominal.tool_in_workpiece(state.q), tool_in_workpiece(idle.truth, state)};
}

bool is_positioned(const Joint& joint) { return joint.motion != Motion::Spindle; }

std::string axis_names(const kinematics::Chain& chain) {
  std::string names;
  for (const Joint& joint : chain.joints())
    if (is_positioned(joint)) names += std::string(names.empty() ? "" : " ") + joint.name;
  return names;
}

double position_unit(const Joint& joint) {
  return joint.motion == Motion::Linear ? 1.0 : units::deg;
}

const char* position_unit_label(const Joint& joint) {
  return joint.motion == Motion::Linear ? "mm" : "deg";
}

std::string travel_text(const Joint& joint) {
  const double unit = position_unit(joint);
  return fmt::format("{} between {:.6g} and {:.6g} {}", joint.name, joint.min / unit,
                     joint.max / unit, position_unit_label(joint));
}

namespace {

using Eigen::Vector3d;
using kinematics::Chain;
using kinematics::Deviation;
using kinematics::JointDeviation;
using kinematics::Pose;
using TipChange = Eigen::Matrix<double, 6, 1>;  // [tip mm | axis rad]

/// Returns the chain with the actual tool on the nominal clamping.
Chain with_actual_tool(const IdleMachine& idle) {
  const Chain& nominal = idle.machine.nominal;
  return {nominal.joints(), nominal.T_bw_home(), idle.truth.actual.T_bt_home()};
}

void add_geometric(const IdleMachine& idle, std::vector<ErrorSource>& sources) {
  for (const errors::Element& element : idle.scene.geometric.elements) {
    errors::GeometricErrors single = idle.scene.geometric;
    single.elements = {element};
    // A covariance, as an identified belief has, correlates elements and has no meaning for one.
    single.covariance = {};
    sources.push_back({to_string(element.name),
                       scaled(errors::bind(single, idle.truth.actual), idle.scene.error_scale)});
  }
}

void add_vibrations(const IdleMachine& idle, std::vector<ErrorSource>& sources) {
  std::map<std::string, std::vector<errors::Vibration>> vibrations_by_element;
  for (const errors::Vibration& vibration : idle.scene.vibrations)
    vibrations_by_element[to_string(vibration.name)].push_back(vibration);
  for (const auto& [name, harmonics] : vibrations_by_element)
    sources.push_back({name + "_vibration", errors::bind(harmonics, idle.machine.nominal)});
}

void add_heat(const IdleMachine& idle, std::vector<ErrorSource>& sources) {
  if (!idle.truth.heat) return;
  const ThermalDescription& thermal = *idle.scene.thermal;
  const auto add = [&](const std::string& name, errors::ThermalErrors single) {
    single.reference_T_C = thermal.errors.reference_T_C;
    const int nodes = int(thermal.network.nodes.size());
    sources.push_back(
        {name, scaled(errors::bind(single, idle.machine.nominal, nodes), thermal.scale)});
  };
  for (const errors::ThermalElement& element : thermal.errors.elements)
    add(to_string(element.name) + "_heat", {{element}, {}, {}, {}});
  for (const errors::AxisExpansion& axis : thermal.errors.expansions)
    add(axis.axis + std::string("_expansion"), {{}, {axis}, {}, {}});
  if (idle.truth.heat->model.workpiece)
    sources.push_back({"part_expansion", ErrorSource::PartExpansion{}});
}

/// The linearisation of the tip about a pose of the chain, for small deviations of its joints.
struct TipLinearisation {
  const IdleMachine& idle;
  const kinematics::AxisState& state;
  Pose T_wt;
  Eigen::MatrixXd motion_jacobian, location_jacobian;  ///< (6 x 6 joints) Jacobians
  Eigen::VectorXd T_C;                                 ///< (nodes), empty without heat

  TipChange change(const Deviation& displacement_w) const {
    TipChange result;
    result << displacement_w.head<3>(), displacement_w.tail<3>().cross(T_wt.linear().col(2));
    return result;
  }

  /// Returns the displacement of the tool in the workpiece by the deviations of the joints.
  Deviation tool_displacement(const std::vector<JointDeviation>& joints) const {
    Deviation sum = Deviation::Zero();
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const auto at = 6 * Eigen::Index(i);
      if (!joints[i].motion.isZero(0.0))
        sum += motion_jacobian.middleCols<6>(at) * joints[i].motion;
      if (!joints[i].location.isZero(0.0))
        sum += location_jacobian.middleCols<6>(at) * joints[i].location;
    }
    return sum;
  }
};

// Returns the exact change of tip and tool axis between two poses.
TipChange difference(const Pose& after, const Pose& before) {
  TipChange result;
  result << after.translation() - before.translation(),
      after.linear().col(2) - before.linear().col(2);
  return result;
}

TipChange tip_change(const TipLinearisation& tip, const errors::GeometricModel& model) {
  return tip.change(tip.tool_displacement(errors::deviations(model, tip.state)));
}

TipChange tip_change(const TipLinearisation& tip, const errors::ThermalModel& model) {
  return tip.change(tip.tool_displacement(errors::deviations(model, tip.state.q, tip.T_C)));
}

TipChange tip_change(const TipLinearisation& tip, const errors::VibrationModel& model) {
  const auto spindle = tip.idle.truth.spindle;
  return tip.change(tip.tool_displacement(
      errors::deviations(model, tip.state.spindle_speed, spindle ? tip.state.q[*spindle] : 0.0)));
}

TipChange tip_change(const TipLinearisation& tip, ErrorSource::Tool) {
  return difference(with_actual_tool(tip.idle).tool_in_workpiece(tip.state.q),
                    tip.idle.machine.nominal.tool_in_workpiece(tip.state.q));
}

TipChange tip_change(const TipLinearisation& tip, ErrorSource::Clamping) {
  return difference(tip.T_wt, with_actual_tool(tip.idle).tool_in_workpiece(tip.state.q));
}

TipChange tip_change(const TipLinearisation& tip, ErrorSource::Compliance) {
  const errors::ForceDeviations deviations =
      errors::deviations(*tip.idle.truth.compliance, tip.state, {});
  Deviation displacement_w = tip.tool_displacement(deviations.joints);
  const Eigen::Matrix3d R = tip.T_wt.linear();
  displacement_w.head<3>() += R * deviations.tool_t.head<3>();
  displacement_w.tail<3>() += R * deviations.tool_t.tail<3>();
  // A displacement of the workpiece moves the tip relative to it in the opposite direction.
  const Vector3d turn_w = deviations.workpiece_w.tail<3>();
  displacement_w.head<3>() -=
      deviations.workpiece_w.head<3>() + turn_w.cross(tip.T_wt.translation());
  displacement_w.tail<3>() -= turn_w;
  return tip.change(displacement_w);
}

TipChange tip_change(const TipLinearisation& tip, ErrorSource::PartExpansion) {
  const Vector3d tip_w = tip.T_wt.translation();
  TipChange result = TipChange::Zero();
  result.head<3>() = errors::position_at_20_C(tip.idle.truth.heat->model, tip.T_C, tip_w) - tip_w;
  return result;
}

}  // namespace

std::vector<ErrorSource> error_sources(const IdleMachine& idle) {
  std::vector<ErrorSource> sources;
  const Chain &nominal = idle.machine.nominal, &actual = idle.truth.actual;
  if (nominal.T_bt_home().matrix() != actual.T_bt_home().matrix())
    sources.push_back({"tool", ErrorSource::Tool{}});
  if (nominal.T_bw_home().matrix() != actual.T_bw_home().matrix())
    sources.push_back({"clamping", ErrorSource::Clamping{}});
  add_geometric(idle, sources);
  add_vibrations(idle, sources);
  add_heat(idle, sources);
  if (idle.truth.compliance &&
      (idle.truth.compliance->gravity_b || !idle.truth.compliance->clamping_w.isZero(0.0)))
    sources.push_back({"compliance", ErrorSource::Compliance{}});
  return sources;
}

std::vector<ErrorSource> select_sources(std::vector<ErrorSource> sources,
                                        const std::vector<std::string>& names) {
  if (names == std::vector<std::string>{"all"}) return sources;
  std::vector<ErrorSource> selection;
  for (const std::string& name : names) {
    const auto has_name = [&](const ErrorSource& source) { return source.name == name; };
    if (std::ranges::any_of(selection, has_name))
      throw BadInput("--elements", 0, 0, "each name only once", quoted_excerpt(name) + " again");
    const auto source = std::ranges::find_if(sources, has_name);
    if (source == sources.end()) {
      std::string known = "all";
      for (const ErrorSource& available : sources) known += " " + available.name;
      throw BadInput("--elements", 0, 0, "an error source of this machine (" + known + ")",
                     quoted_excerpt(name));
    }
    selection.push_back(*source);
  }
  return selection;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> source_contributions(
    const IdleMachine& idle, const std::vector<ErrorSource>& sources,
    const kinematics::AxisState& state) {
  const Chain& chain = idle.truth.actual;
  const TipLinearisation tip{idle,
                             state,
                             chain.tool_in_workpiece(state.q),
                             kinematics::motion_jacobian(chain, state.q),
                             kinematics::location_jacobian(chain, state.q),
                             idle.truth.heat
                                 ? errors::temperatures(idle.truth.heat->run, state.time_s)
                                 : Eigen::VectorXd()};
  Eigen::Matrix<double, 6, Eigen::Dynamic> contributions(6, Eigen::Index(sources.size()));
  for (std::size_t i = 0; i < sources.size(); ++i)
    contributions.col(Eigen::Index(i)) =
        std::visit([&](const auto& what) { return tip_change(tip, what); }, sources[i].what);
  return contributions;
}

namespace {

/// Returns the schema of a list of poses: a column for each positioned axis, in the order of
/// `joints`, then the time.
TableSchema pose_schema(const Chain& chain, const std::vector<int>& joints) {
  TableSchema schema{.max_rows = max_poses};
  for (const int j : joints) {
    const Joint& axis = chain.joints()[std::size_t(j)];
    TableColumn column{.required = false, .min = axis.min, .max = axis.max};
    column.names = {
        {fmt::format("{}_{}", axis.name, position_unit_label(axis)), position_unit(axis)}};
    if (axis.motion == Motion::Rotary) column.names.push_back({fmt::format("{}_rad", axis.name)});
    schema.header += column.names.front().head + ",";
    schema.columns.push_back(std::move(column));
  }
  schema.header += "time_s";
  schema.columns.push_back(
      {.names = {{"time_s", 1.0}, {"time_min", 60.0}, {"time_h", 3600.0}}, .required = false});
  schema.check_header = [time = joints.size()](const TableFile& header) {
    if (header.order == std::vector{time})
      header.throw_missing_column("a column for at least one axis");
  };
  return schema;
}

}  // namespace

bool PoseList::is_timed() const {
  return std::ranges::any_of(columns, [](const Column& column) { return column.joint < 0; });
}

kinematics::AxisState PoseList::state(std::size_t pose) const {
  kinematics::AxisState state;
  state.q = others;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const double value = numbers[pose * columns.size() + i] * columns[i].unit;
    (columns[i].joint < 0 ? state.time_s : state.q[columns[i].joint]) = value;
  }
  return state;
}

std::string PoseList::text(std::size_t pose) const {
  std::string text;
  for (std::size_t i = 0; i < columns.size(); ++i)
    text += fmt::format("{}{} = {:.9g}", i > 0 ? ", " : "", columns[i].head,
                        numbers[pose * columns.size() + i]);
  return text;
}

PoseList read_poses(std::string_view text, const std::string& file, const Chain& chain) {
  std::vector<int> joints;
  for (int j = 0; j < chain.size(); ++j)
    if (is_positioned(chain.joints()[std::size_t(j)])) joints.push_back(j);
  TableFile table;
  try {
    table = read_table(text, file, pose_schema(chain, joints));
  } catch (const BadTable& bad) {
    throw BadScene(bad.input_errors);
  }
  PoseList list;
  list.file = file;
  list.line = table.line;
  list.others = kinematics::AxisVector::Zero(chain.size());
  for (const std::size_t k : table.order)
    list.columns.push_back(
        {table.columns[k].head, k < joints.size() ? joints[k] : -1, table.columns[k].unit});
  list.numbers.reserve(table.rows() * table.order.size());
  for (std::size_t row = 0; row < table.rows(); ++row)
    for (const std::size_t k : table.order) list.numbers.push_back(table.columns[k].numbers[row]);
  return list;
}

PoseList read_poses_file(const std::filesystem::path& file, const Chain& chain) {
  return read_poses(read_text(file, max_pose_bytes), file.string(), chain);
}

namespace {

using kinematics::AxisVector;

/// Returns half of the largest difference of a curve between its two directions of approach, mm or
/// rad.
double half_reversal(const errors::Curve& curve) {
  double reversal = 0.0;
  if (const auto* backlash = std::get_if<errors::Backlash>(&curve.shape))
    reversal = std::abs(backlash->half);
  if (const auto* tables = std::get_if<errors::DirectionalTables>(&curve.shape))
    for (const double q : tables->up.q)
      // Beyond the range of either table the difference would be extrapolated.
      if (q >= tables->down.q[0] && q <= tables->down.q[tables->down.q.size() - 1])
        reversal = std::max(reversal, 0.5 * std::abs(errors::value({tables->up}, {q, q}) -
                                                     errors::value({tables->down}, {q, q})));
  return reversal * std::abs(curve.scale);
}

// Returns the standard deviation of the random part of a curve, mm or rad.
double repeatability(const errors::Curve& curve) {
  const auto* random = std::get_if<errors::Repeatability>(&curve.shape);
  return random != nullptr ? random->sigma * std::abs(curve.scale) : 0.0;
}

/// Returns a text such as "EXX 1.5 um, EAX 2 urad" of the elements whose sum over the curves is not
/// zero.
/// @param size  returns the figure of a curve, mm or rad
template <typename Size>
std::string element_figures(const errors::GeometricModel& model, const Size& size) {
  std::string text;
  for (const auto& bound : model.elements) {
    double sum = 0.0;
    for (const errors::Curve& curve : bound.element.curves) sum += size(curve);
    if (sum == 0.0) continue;
    const bool angle = bound.element.name.is_angle();
    text += fmt::format("{}{} {:.3g} {}", text.empty() ? "" : ", ", to_string(bound.element.name),
                        sum / (angle ? units::urad : units::um), angle ? "urad" : "um");
  }
  return text;
}

/// Returns the warnings about the time column of a pose list.
std::vector<std::string> time_warnings(const IdleMachine& idle, const PoseList& poses) {
  std::vector<std::string> warnings;
  if (!poses.is_timed()) return warnings;
  if (!idle.truth.heat) {
    warnings.push_back("time has no effect: the machine of this scene has no [thermal]");
    return warnings;
  }
  std::size_t late_poses = 0, early_poses = 0;
  const double begin_s = idle.truth.heat->run.knots.front().time_s;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double time_s = poses.state(i).time_s;
    late_poses += time_s > 0.0;
    early_poses += time_s < begin_s;
  }
  if (late_poses > 0)
    warnings.push_back(fmt::format(
        "{} of {} poses are after time 0: the last phase of the history continues, no program runs",
        late_poses, poses.size()));
  if (early_poses > 0)
    warnings.push_back(
        fmt::format("{} of {} poses are before the history, which begins at {:.6g} s: the machine "
                    "is in its initial state",
                    early_poses, poses.size(), begin_s));
  return warnings;
}

}  // namespace

std::vector<std::string> pose_warnings(const IdleMachine& idle, const AxisVector& lower,
                                       const AxisVector& upper) {
  std::vector<std::string> warnings = value_warnings(idle.scene);
  const errors::GeometricModel& model = idle.truth.geometric;
  std::ranges::move(heat_warnings({}, idle.truth), std::back_inserter(warnings));
  std::ranges::move(errors::element_warnings(model, lower, upper), std::back_inserter(warnings));
  if (!idle.scene.additional_tools.empty())
    warnings.push_back(fmt::format("poses are computed for T{}, the first of {} tools",
                                   idle.scene.tool.number.value_or(0),
                                   1 + idle.scene.additional_tools.size()));
  if (const std::string reversals = element_figures(model, half_reversal); !reversals.empty())
    warnings.push_back(
        "poses are midway between the two directions of approach; reversal adds or subtracts: " +
        reversals);
  if (const std::string sigmas = element_figures(model, repeatability); !sigmas.empty())
    warnings.push_back(
        "poses contain one random draw of the repeatability, with standard deviation: " + sigmas);
  return warnings;
}

std::vector<std::string> pose_warnings(const IdleMachine& idle, const PoseList& poses) {
  AxisVector lower = poses.state(0).q, upper = lower;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const AxisVector q = poses.state(i).q;
    lower = lower.cwiseMin(q);
    upper = upper.cwiseMax(q);
  }
  std::vector<std::string> warnings = pose_warnings(idle, lower, upper);
  std::ranges::move(time_warnings(idle, poses), std::back_inserter(warnings));
  return warnings;
}

}  // namespace abbe::sim
