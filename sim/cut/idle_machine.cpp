#include "sim/cut/idle_machine.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include <fmt/format.h>

#include "errors/geometric.h"
#include "kinematics/jacobian.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/cut/process.h"
#include "sim/machine/run_out.h"
#include "sim/machine/truth.h"
#include "sim/scene/toml.h"
#include "sim/scene/value_warnings.h"

namespace abbe::sim {

namespace {

using kinematics::Joint;
using kinematics::Motion;

}  // namespace

IdleMachine idle_machine(const Scene& described) {
  Scene scene = with_run_out(described);
  Machine machine = compile(scene);
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
using Effect = Eigen::Matrix<double, 6, 1>;  // [tip mm | axis rad]

/// Returns the chain with the actual tool on the nominal clamping.
Chain with_real_tool(const IdleMachine& idle) {
  const Chain& nominal = idle.machine.nominal;
  return {nominal.joints(), nominal.T_bw_home(), idle.truth.actual.T_bt_home()};
}

void add_geometric(const IdleMachine& idle, std::vector<ErrorSource>& all) {
  for (const errors::Element& element : idle.scene.geometric.elements) {
    errors::GeometricErrors alone = idle.scene.geometric;
    alone.elements = {element};
    // without the covariance of an identified belief: one element alone has no correlation
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

/// The chain at a pose, with the Jacobians that carry small deviations of its joints to the tip.
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

// Changes of the tip and the axis from one pose to another, exact.
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
  // A displacement of the workpiece moves the tip relative to it the opposite way.
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

std::vector<ErrorSource> select_sources(std::vector<ErrorSource> all,
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

Eigen::Matrix<double, 6, Eigen::Dynamic> source_contributions(
    const IdleMachine& idle, const std::vector<ErrorSource>& sources,
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

namespace {

constexpr std::size_t max_faults = 20;

struct TimeUnit {
  const char* head;
  double seconds;
};
constexpr TimeUnit time_units[] = {{"time_s", 1.0}, {"time_min", 60.0}, {"time_h", 3600.0}};

// Converts a pose list from text, and collects the errors of its rows.
class Reader {
 public:
  Reader(std::string_view text, const std::string& file, const Chain& chain)
      : lines_(text, file), chain_(chain) {
    list_.file = file;
    list_.others = kinematics::AxisVector::Zero(chain.size());
  }

  PoseList read() {
    const auto head = lines_.next();
    if (!head)
      throw BadInput(list_.file, 1, 1, "a head such as " + known_columns(), "an empty file");
    read_head(*head);
    for (bool more = true; more;) {
      try {
        more = read_row();
      } catch (const BadInput& fault) {
        // One error a row, 20 in all: a mistake such as a wrong unit repeats in every row.
        input_errors_.push_back(fault);
        if (input_errors_.size() == max_faults) break;
      }
    }
    if (!input_errors_.empty()) throw BadScene(input_errors_);
    if (list_.size() == 0) lines_.refuse(0, "at least one pose", "none");
    return std::move(list_);
  }

 private:
  std::string known_columns() const {
    std::string names;
    for (const Joint& joint : chain_.joints())
      if (is_positioned(joint))
        names += fmt::format("{}_{},", joint.name, position_unit_label(joint));
    return names + "time_s";
  }

  PoseList::Column column(const Cell& cell) const {
    for (const auto& [head, seconds] : time_units)
      if (cell.text == head) return {head, -1, seconds};
    const auto joint =
        cell.text.size() > 2 && cell.text[1] == '_' ? chain_.find(cell.text[0]) : std::nullopt;
    if (joint && is_positioned(chain_.joints()[std::size_t(*joint)])) {
      const Joint& axis = chain_.joints()[std::size_t(*joint)];
      const std::string_view unit = cell.text.substr(2);
      if (unit == position_unit_label(axis))
        return {std::string(cell.text), *joint, position_unit(axis)};
      if (unit == "rad" && axis.motion == kinematics::Motion::Rotary)
        return {std::string(cell.text), *joint, 1.0};
    }
    lines_.refuse(cell, "a column of " + known_columns());
  }

  void read_head(const Line& line) {
    separator_ = cell_separator(line.text);
    const std::size_t most = std::size_t(chain_.size()) + 1;
    const std::vector<Cell> cells = cells_of(line.text, separator_, most);
    for (const Cell& cell : cells) {
      PoseList::Column one = column(cell);
      for (const PoseList::Column& other : list_.columns)
        if (other.joint == one.joint)
          lines_.refuse(cell, one.joint < 0 ? "one column of time" : "every axis once");
      list_.columns.push_back(std::move(one));
    }
    if (std::all_of(list_.columns.begin(), list_.columns.end(),
                    [](const auto& one) { return one.joint < 0; }))
      lines_.refuse(cells.front(), "a column of at least one axis");
  }

  /// Reads a row. @return false at the end of the text
  bool read_row() {
    const auto line = lines_.next();
    if (!line) return false;
    const std::size_t width = list_.columns.size();
    const std::vector<Cell> cells = cells_of(line->text, separator_, width);
    const auto wanted = [&] { return fmt::format("{} cells, as the head has", width); };
    if (cells.size() < width)
      lines_.refuse(int(line->text.size()) + 1, wanted(), fmt::format("{}", cells.size()));
    if (cells.size() > width) lines_.refuse(cells[width].column, wanted(), "more");
    if (list_.size() == max_poses)
      lines_.refuse(0, fmt::format("at most {} poses", max_poses), "more");
    row_.clear();
    for (std::size_t i = 0; i < width; ++i) row_.push_back(number(cells[i], list_.columns[i]));
    if (!input_errors_.empty())
      return true;  // the list is not used after an error; rows are still
                    // checked
    list_.numbers.insert(list_.numbers.end(), row_.begin(), row_.end());
    list_.line.push_back(line->number);
    return true;
  }

  double number(const Cell& cell, const PoseList::Column& column) const {
    const double value = lines_.number_in(cell);
    if (column.joint < 0) return value;
    const Joint& axis = chain_.joints()[std::size_t(column.joint)];
    const double q = value * column.unit;
    if (q < axis.min || q > axis.max) lines_.refuse(cell, travel_text(axis));
    return value;
  }

  TableLines lines_;
  const Chain& chain_;
  PoseList list_;
  char separator_ = ',';
  std::vector<double> row_;
  std::vector<BadInput> input_errors_;
};

}  // namespace

bool PoseList::is_timed() const {
  return std::any_of(columns.begin(), columns.end(), [](const auto& one) { return one.joint < 0; });
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
  return Reader(text, file, chain).read();
}

PoseList read_poses_file(const std::filesystem::path& file, const Chain& chain) {
  return read_poses(read_text(file, max_pose_bytes), file.string(), chain);
}

namespace {

using kinematics::AxisVector;

/// Returns half of the difference of a curve between its two directions of approach, mm or rad.
double half_reversal(const errors::Curve& curve) {
  double half = 0.0;
  if (const auto* backlash = std::get_if<errors::Backlash>(&curve.shape))
    half = std::abs(backlash->half);
  if (const auto* both = std::get_if<errors::DirectionalTables>(&curve.shape))
    for (const double q : both->up.q)
      // only where both tables have values: beyond one of them the difference is extrapolation
      if (q >= both->down.q[0] && q <= both->down.q[both->down.q.size() - 1])
        half = std::max(half, 0.5 * std::abs(errors::value({both->up}, {q, q}) -
                                             errors::value({both->down}, {q, q})));
  return half * std::abs(curve.scale);
}

// Returns the standard deviation of the random part of a curve, mm or rad.
double chance(const errors::Curve& curve) {
  const auto* random = std::get_if<errors::Repeatability>(&curve.shape);
  return random != nullptr ? random->sigma * std::abs(curve.scale) : 0.0;
}

/// Returns a text such as "EXX 1.5 um, EAX 2 urad" of the elements with a non-zero `size`.
template <typename Size>
std::string figures_of(const errors::GeometricModel& model, const Size& size) {
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
  std::vector<std::string> found;
  if (!poses.is_timed()) return found;
  if (!idle.truth.heat) {
    found.push_back("time changes nothing: the machine of this scene has no heat");
    return found;
  }
  std::size_t after = 0, before = 0;
  const double begin_s = idle.truth.heat->run.knots.front().time_s;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double time_s = poses.state(i).time_s;
    after += time_s > 0.0;
    before += time_s < begin_s;
  }
  if (after > 0)
    found.push_back(
        fmt::format("{} of {} poses come after time 0: the last phase of the history "
                    "goes on, no program runs",
                    after, poses.size()));
  if (before > 0)
    found.push_back(
        fmt::format("{} of {} poses come before the history, which begins at {:.6g} s: "
                    "the machine is as at its beginning",
                    before, poses.size(), begin_s));
  return found;
}

}  // namespace

std::vector<std::string> pose_warnings(const IdleMachine& idle, const AxisVector& least,
                                       const AxisVector& most) {
  std::vector<std::string> found;
  const errors::GeometricModel& model = idle.truth.geometric;
  found = value_warnings(idle.scene);
  std::ranges::move(heat_warnings({}, idle.truth), std::back_inserter(found));
  std::ranges::move(errors::element_warnings(model, least, most), std::back_inserter(found));
  if (!idle.scene.additional_tools.empty())
    found.push_back(fmt::format("poses are of T{}, the first of {} tools",
                                idle.scene.tool.number.value_or(0),
                                1 + idle.scene.additional_tools.size()));
  if (const std::string halves = figures_of(model, half_reversal); !halves.empty())
    found.push_back("poses are half way between their two approaches; reversal adds or takes: " +
                    halves);
  if (const std::string sigmas = figures_of(model, chance); !sigmas.empty())
    found.push_back("poses have one draw of the repeatability, whose standard deviation is: " +
                    sigmas);
  return found;
}

std::vector<std::string> pose_warnings(const IdleMachine& idle, const PoseList& poses) {
  AxisVector least = poses.state(0).q, most = least;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const AxisVector q = poses.state(i).q;
    least = least.cwiseMin(q);
    most = most.cwiseMax(q);
  }
  std::vector<std::string> found = pose_warnings(idle, least, most);
  std::ranges::move(time_warnings(idle, poses), std::back_inserter(found));
  return found;
}

}  // namespace abbe::sim
