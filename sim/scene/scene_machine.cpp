#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/topology.h"
#include "kinematics/units.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

using Eigen::Vector3d;
using kinematics::Joint;
using kinematics::Motion;

Motion motion_of(char name) {
  if (name == 's') return Motion::Spindle;
  return std::string_view("XYZUVWPQR").find(name) != std::string_view::npos ? Motion::Linear
                                                                            : Motion::Rotary;
}

// ISO 841: a rotary axis of this letter turns about the slide of that one.
std::optional<Vector3d> usual_direction(char name) {
  if (std::string_view("XUPA").find(name) != std::string_view::npos) return Vector3d::UnitX();
  if (std::string_view("YVQB").find(name) != std::string_view::npos) return Vector3d::UnitY();
  if (std::string_view("ZWRC").find(name) != std::string_view::npos) return Vector3d::UnitZ();
  return std::nullopt;
}

void read_travel(TableReader& reader, Joint& joint) {
  const std::string key = joint.motion == Motion::Linear ? "travel_mm" : "travel_deg";
  const auto travel = reader.maybe_numbers(key, 2);
  if (!travel) return;
  joint.min = (*travel)[0];
  joint.max = (*travel)[1];
  if (!(joint.min < joint.max)) {
    reader.refuse(key, "[least, most] with least below most for " + key, "not rising");
  }
}

Joint read_axis(const Node& table, const kinematics::CodeAxis& code, Faults& faults) {
  TableReader reader(table, std::string("machine.axis.") + code.name, faults);
  Joint joint;
  joint.name = code.name;
  joint.side = code.side;
  joint.motion = reader.choice<Motion>(
      "motion", {{"linear", Motion::Linear}, {"rotary", Motion::Rotary}}, motion_of(code.name));
  const auto usual = usual_direction(code.name);
  joint.direction_b = usual ? reader.direction("direction", *usual) : reader.direction("direction");
  joint.point_b = joint.motion == Motion::Linear ? reader.vector("point_mm", Vector3d::Zero())
                                                 : reader.vector("point_mm");
  read_travel(reader, joint);
  joint.deviation_axes =
      reader.choice<kinematics::DeviationAxes>("deviation_axes",
                                               {{"fixed", kinematics::DeviationAxes::Fixed},
                                                {"turning", kinematics::DeviationAxes::Turning}},
                                               kinematics::DeviationAxes::Fixed);
  joint.squareness = reader.choice<kinematics::Squareness>(
      "squareness",
      {{"frame", kinematics::Squareness::Frame}, {"travel", kinematics::Squareness::Travel}},
      kinematics::Squareness::Frame);
  reader.close();
  return joint;
}

// A nose is where the tool sits, so its frame says all that an axis section would.
Joint nose_joint(const kinematics::CodeAxis& code, const kinematics::Pose& T_bs) {
  Joint joint;
  joint.name = code.name;
  joint.side = code.side;
  joint.motion = Motion::Spindle;
  joint.direction_b = T_bs.linear().col(2);
  joint.point_b = T_bs.translation();
  return joint;
}

kinematics::Pose read_nose(TableReader& reader) {
  kinematics::Pose T_bs = kinematics::Pose::Identity();
  T_bs.translation() = reader.vector("at_mm");
  const Vector3d z = reader.direction("axis", Vector3d::UnitZ());
  const Vector3d usual_x = std::abs(z.x()) < 0.9 ? Vector3d::UnitX() : Vector3d::UnitZ();
  const Vector3d wanted_x = reader.direction("x", (usual_x - usual_x.dot(z) * z).normalized());
  const Vector3d across = wanted_x - wanted_x.dot(z) * z;
  if (across.norm() < 1e-3) {
    reader.refuse("x", "a direction across the axis for machine.nose.x", "one along it");
    return T_bs;
  }
  const Vector3d x = across.norm() == 1.0 ? across : Vector3d(across.normalized());
  T_bs.linear().col(0) = x;
  T_bs.linear().col(1) = z.cross(x);
  T_bs.linear().col(2) = z;
  return T_bs;
}

std::optional<kinematics::Topology> read_code(TableReader& reader) {
  const std::string code = reader.text("code");
  if (code.empty()) return std::nullopt;
  try {
    return kinematics::parse_structural_code(code);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("code", "a structural code such as \"w C' b X Y Z A s t\"", fault.what());
    return std::nullopt;
  }
}

std::vector<Joint> read_axes(TableReader& machine, const kinematics::Topology& topology,
                             const kinematics::Pose& T_bs) {
  std::vector<Joint> joints;
  const Node* section = machine.section("axis");
  Node none;
  none.place = machine.place();
  none.value = Node::Table{};
  TableReader axes(section ? *section : none, "machine.axis", machine.faults());
  for (const kinematics::CodeAxis& code : topology) {
    if (motion_of(code.name) == Motion::Spindle) {
      joints.push_back(nose_joint(code, T_bs));
      continue;
    }
    const std::string name(1, code.name);
    if (const Node* table = axes.section(name)) {
      joints.push_back(read_axis(*table, code, machine.faults()));
    } else if (!axes.has(name)) {
      axes.missing(name, "a table");
    }
  }
  axes.close();
  return joints;
}

double exact_sine(double degrees) {
  const double turns = std::remainder(degrees, 360.0);
  if (turns == 0.0 || std::abs(turns) == 180.0) return 0.0;
  if (std::abs(turns) == 90.0) return std::copysign(1.0, turns);
  return std::sin(turns * units::deg);
}

Eigen::Matrix3d turned(const Vector3d& degrees) {
  for (int axis = 0; axis < 3; ++axis) {
    const int j = (axis + 1) % 3;
    const int k = (axis + 2) % 3;
    if (degrees[j] != 0.0 || degrees[k] != 0.0) continue;
    const double s = exact_sine(degrees[axis]);
    const double c = exact_sine(degrees[axis] + 90.0);
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    R(j, j) = R(k, k) = c;
    R(k, j) = s;
    R(j, k) = -s;
    return R;
  }
  return kinematics::rotation(degrees * units::deg);
}

}  // namespace

Eigen::Matrix3d read_turn(TableReader& reader) {
  constexpr double most_turn_deg = 3600.0;  // beyond, the last digits of the angle are its turns
  const auto turn = reader.numbers_as_written("turn_deg", 3);
  if (!turn) return Eigen::Matrix3d::Identity();
  if (turn->cwiseAbs().maxCoeff() <= most_turn_deg) return turned(*turn);
  reader.refuse("turn_deg", fmt::format("turns within +-{} deg for turn_deg", most_turn_deg),
                fmt::format("{}", turn->cwiseAbs().maxCoeff()));
  return Eigen::Matrix3d::Identity();
}

kinematics::Pose read_placement(TableReader& reader) {
  kinematics::Pose pose = kinematics::Pose::Identity();
  pose.translation() = reader.vector("at_mm", Vector3d::Zero());
  pose.linear() = read_turn(reader);
  return pose;
}

kinematics::AxisVector read_axis_words(TableReader& reader, const std::vector<Joint>& joints) {
  kinematics::AxisVector words = kinematics::AxisVector::Zero(Eigen::Index(joints.size()));
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].motion == Motion::Spindle) continue;
    const char* unit = joints[j].motion == Motion::Linear ? "_mm" : "_deg";
    words[Eigen::Index(j)] = reader.number(joints[j].name + std::string(unit), any_number, 0.0);
  }
  return words;
}

MachineDescription read_machine(const Node& table, Faults& faults) {
  TableReader reader(table, "machine", faults);
  MachineDescription machine;
  machine.name = reader.text("name", "");
  if (const Node* nose = reader.section("nose")) {
    TableReader nose_reader(*nose, "machine.nose", faults);
    machine.T_bs = read_nose(nose_reader);
    nose_reader.close();
  } else if (!reader.has("nose")) {
    reader.missing("nose", "a table");
  }
  if (const Node* workpiece = reader.section("workpiece")) {
    TableReader workpiece_reader(*workpiece, "machine.workpiece", faults);
    machine.T_bw = read_placement(workpiece_reader);
    workpiece_reader.close();
  }
  machine.rapid_speed = reader.number("rapid_mm_per_min", positive, machine.rapid_speed);
  machine.rapid_turn = reader.number("rapid_deg_per_min", positive, machine.rapid_turn);
  reader.know("axis");
  reader.know("home");
  if (const auto topology = read_code(reader)) {
    const std::size_t before = faults.list().size();
    machine.joints = read_axes(reader, *topology, machine.T_bs);
    if (machine.joints.size() == topology->size() && faults.list().size() == before) {
      try {
        kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs);
      } catch (const std::invalid_argument& fault) {
        reader.refuse("code", "a machine that makes a chain", fault.what());
      }
    }
  }
  machine.home = kinematics::AxisVector::Zero(Eigen::Index(machine.joints.size()));
  if (const Node* home = reader.section("home")) {
    TableReader words(*home, "machine.home", faults);
    machine.home = read_axis_words(words, machine.joints);
    words.close();
  }
  reader.close();
  return machine;
}

ControlDescription read_control(const Node& table, const std::vector<Joint>& joints,
                                Faults& faults) {
  TableReader reader(table, "control", faults);
  ControlDescription control;
  control.tool_length = reader.maybe_number("tool_length_mm", any_number);
  if (const Node* section = reader.section("axis")) {
    control.joints = joints;
    TableReader axes(*section, "control.axis", faults);
    for (Joint& joint : control.joints) {
      const std::string name(1, joint.name);
      const Node* axis = axes.section(name);
      if (!axis) continue;
      TableReader believed(*axis, "control.axis." + name, faults);
      joint.point_b = believed.vector("point_mm", joint.point_b);
      joint.direction_b = believed.direction("direction", joint.direction_b);
      believed.close();
    }
    axes.close();
  }
  reader.close();
  return control;
}

}  // namespace abbe::sim
