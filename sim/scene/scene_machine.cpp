#include <cmath>
#include <stdexcept>

#include "kinematics/topology.h"
#include "kinematics/units.h"
#include "sim/scene/body_names.h"
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

void put_travel(const Joint& joint, Node::Table& table) {
  const Joint without_end;
  if (joint.min == without_end.min && joint.max == without_end.max) return;
  const char* key = joint.motion == Motion::Linear ? "travel_mm" : "travel_deg";
  put_numbers(table, key, Eigen::Vector2d(joint.min, joint.max), unit_of(key));
}

/// @param axis  with its letter's motion
Fields<Joint> axis_fields(const Joint& axis) {
  using kinematics::DeviationAxes;
  using kinematics::Squareness;
  const KeyName direction =
      KeyName("direction").otherwise("x of X, U, A; y of Y, V, B; z of Z, W, C; none of S");
  const KeyName travel_mm = KeyName("travel_mm").otherwise("without end");
  const KeyName travel_deg = KeyName("travel_deg").otherwise("without end");
  return Fields<Joint>(axis)
      .word(KeyName("motion").otherwise("by letter: rotary of A, B, C, S"), &Joint::motion,
            {{"linear", Motion::Linear}, {"rotary", Motion::Rotary}}, "what the axis does")
      .direction(usual_direction(axis.name) ? direction : must(direction), &Joint::direction_b,
                 "a positive command moves the tool this way against the workpiece, or turns it "
                 "about it")
      .custom(
          {key_of_numbers(KeyName("point_mm").otherwise("[0, 0, 0] of a slide"), 3,
                          "on the line of rotation of an axis that turns, which must have it; "
                          "of a slide, where its deviations are stated")},
          [](TableReader& reader, Joint& joint) {
            joint.point_b = joint.motion == Motion::Linear
                                ? reader.vector("point_mm", Vector3d::Zero())
                                : reader.vector("point_mm");
          },
          [](const Joint& joint, Node::Table& table) {
            put_numbers(table, "point_mm", joint.point_b, 1.0);
          })
      .custom({key_of_numbers(travel_mm, 2, "[least, most] commanded, of a slide"),
               key_of_numbers(travel_deg, 2, "[least, most] commanded, of an axis that turns")},
              read_travel, put_travel)
      .word("deviation_axes", &Joint::deviation_axes,
            {{"fixed", DeviationAxes::Fixed, "ISO 230-7"},
             {"turning", DeviationAxes::Turning, "the papers' order"}},
            "directions in which the deviations of an axis that turns are stated")
      .word("squareness", &Joint::squareness,
            {{"frame", Squareness::Frame,
              "the axis turns with all that it carries, or, where it carries the slide to which "
              "the angle is stated, what it carries turns by the opposite "
              "(`kinematics/README.md`)"},
             {"travel", Squareness::Travel, "the direction of travel only"}},
            "what an angle of location turns; the angle is the same");
}

/// An axis with what the control makes of its words.
struct MachineAxis {
  Joint joint;
  program::Rollover rollover = program::Rollover::ByControl;
};

Fields<MachineAxis> machine_axis_fields(const MachineAxis& axis) {
  using program::Rollover;
  return Fields<MachineAxis>(axis)
      .all_of(&MachineAxis::joint, axis_fields(axis.joint))
      .where([](const MachineAxis& axis) { return axis.joint.motion != Motion::Linear; },
             Fields<MachineAxis>().word(
                 "rollover", &MachineAxis::rollover,
                 {{"by_control", Rollover::ByControl,
                   "\"shortest\" in a program of Fanuc for an axis that carries the workpiece and "
                   "turns without end, or by more than two turns; else \"none\""},
                  {"none", Rollover::None, "it turns by the difference of the positions"},
                  {"shortest", Rollover::Shortest, "whole turns do not count: the short way"},
                  {"sign", Rollover::Sign,
                   "whole turns do not count: in the direction of the word's sign"}},
                 "how the control turns it to an absolute position"));
}

Joint axis_of(const kinematics::CodeAxis& code) {
  Joint joint;
  joint.name = code.name;
  joint.side = code.side;
  joint.motion = motion_of(code.name);
  joint.direction_b = usual_direction(code.name).value_or(Vector3d::UnitX());
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

Fields<kinematics::Pose> nose_fields() {
  using kinematics::Pose;
  return Fields<Pose>(Pose::Identity())
      .custom(
          {key_of_numbers(must("at_mm"), 3, "where it is"),
           key_of_numbers(KeyName("axis").otherwise("[0, 0, 1]"), 3, "from the tip to the spindle"),
           key_of_numbers(KeyName("x").otherwise("[1, 0, 0], or z where the axis is x"), 3,
                          "its x direction, made square to the axis")},
          [](TableReader& reader, Pose& T_bs) { T_bs = read_nose(reader); },
          [](const Pose& T_bs, Node::Table& table) {
            put_numbers(table, "at_mm", T_bs.translation(), 1.0);
            put_numbers(table, "axis", T_bs.linear().col(2), 1.0);
            put_numbers(table, "x", T_bs.linear().col(0), 1.0);
          });
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

std::vector<MachineAxis> read_axes(TableReader& machine, const kinematics::Topology& topology,
                             const kinematics::Pose& T_bs) {
  std::vector<MachineAxis> read;
  const Node* section = machine.section("axis");
  Node none;
  none.place = machine.place();
  none.value = Node::Table{};
  TableReader axes(section ? *section : none, machine.name_of("axis"), machine.faults());
  for (const kinematics::CodeAxis& code : topology) {
    if (motion_of(code.name) == Motion::Spindle) {
      read.push_back({nose_joint(code, T_bs)});
      continue;
    }
    const std::string name(1, code.name);
    if (const Node* table = axes.section(name)) {
      read.push_back(machine_axis_fields({axis_of(code)})
                         .read_table(*table, axes.name_of(name), machine.faults()));
    } else if (!axes.has(name)) {
      axes.missing(name, "a table");
    }
  }
  axes.close();
  return read;
}

void read_joints(TableReader& reader, MachineDescription& machine) {
  reader.know("axis");
  for (const char* key : {"home", "reference", "machine_zero"}) reader.know(key);
  const auto topology = read_code(reader);
  if (!topology) return;
  const std::size_t before = reader.faults().list().size();
  for (const MachineAxis& axis : read_axes(reader, *topology, machine.T_bs)) {
    machine.joints.push_back(axis.joint);
    machine.rollover.push_back(axis.rollover);
  }
  if (machine.joints.size() != topology->size() || reader.faults().list().size() != before) return;
  try {
    kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("code", "a machine that makes a chain", fault.what());
  }
}

void put_joints(const MachineDescription& machine, Node::Table& table) {
  put(table, "code", kinematics::to_string(kinematics::topology_of(machine.joints)));
  Node::Table axes;
  for (std::size_t j = 0; j < machine.joints.size(); ++j) {
    const MachineAxis axis{machine.joints[j], j < machine.rollover.size()
                                                  ? machine.rollover[j]
                                                  : program::Rollover::ByControl};
    if (axis.joint.motion != Motion::Spindle)
      put(axes, std::string(1, axis.joint.name), machine_axis_fields(axis).written(axis));
  }
  if (!axes.empty()) put(table, "axis", std::move(axes));
}

void read_home(TableReader& reader, MachineDescription& machine) {
  const auto fields = axis_word_fields(machine.joints);
  machine.home = kinematics::AxisVector::Zero(Eigen::Index(machine.joints.size()));
  if (const Node* home = reader.section("home"))
    machine.home = fields.read_table(*home, reader.name_of("home"), reader.faults());
  if (const Node* reference = reader.section("reference"))
    machine.reference =
        fields.read_table(*reference, reader.name_of("reference"), reader.faults());
  if (const Node* zero = reader.section("machine_zero"))
    machine.machine_zero =
        fields.read_table(*zero, reader.name_of("machine_zero"), reader.faults());
}

/// Joint that a letter of the code names; none for b, the bed.
void read_carrier(TableReader& reader, const std::vector<Joint>& joints, MachineBody& body) {
  const std::string letter = reader.text("carried_by", "b");
  std::string known = "b";
  for (std::size_t j = 0; j < joints.size(); ++j) {
    known += std::string(" ") + joints[j].name;
    if (letter == std::string(1, joints[j].name)) body.joint = int(j);
  }
  if (!body.joint && letter != "b" && !joints.empty())
    reader.refuse("carried_by", "a letter of the machine's code: " + known, letter);
}

/// @param joints  of the machine
Fields<MachineBody> machine_body_fields(const std::vector<Joint>& joints) {
  return Fields<MachineBody>()
      .custom(
          {key_of(KeyName("carried_by").otherwise("b"), Key::Kind::Text,
                  "letter of the axis that it moves with, s of the nose, b of the bed")},
          [joints](TableReader& reader, MachineBody& body) { read_carrier(reader, joints, body); },
          [joints](const MachineBody& body, Node::Table& table) {
            if (body.joint)
              put(table, "carried_by", std::string(1, joints[std::size_t(*body.joint)].name));
          })
      .all_of(&MachineBody::body, body_fields());
}

void read_bodies(TableReader& reader, MachineDescription& machine) {
  const auto fields = machine_body_fields(machine.joints);
  for (const Node* node : reader.tables("body"))
    machine.bodies.push_back(fields.read_table(*node, reader.name_of("body"), reader.faults()));
  check_body_names(reader, machine);
}

void put_bodies(const MachineDescription& machine, Node::Table& table) {
  put_tables(table, "body", machine.bodies, machine_body_fields(machine.joints));
}

Key body_key() {
  return key_of(KeyName("body").otherwise("none"), Key::Kind::Tables,
                "what the machine is made of, for its picture and for collisions; placed in the "
                "bed, with all axes at zero",
                machine_body_fields({}).keys());
}

Key code_key() {
  return key_of(must("code"), Key::Kind::Text,
                "structural code, workpiece to tool: \"w C' b X Y Z A s t\"; primed axes carry the "
                "workpiece, `s` is the spindle nose");
}

/// A table of tables, one for every letter of an axis.
Key axis_key(const char* pattern, const char* sentence, std::vector<Key> keys) {
  Key letter = key_of("<axis>", Key::Kind::Table, sentence, std::move(keys));
  letter.pattern = pattern;
  return key_of("axis", Key::Kind::Table, "the axes by their letters", {std::move(letter)});
}

Key home_key() {
  return key_of(KeyName("home").otherwise("all at zero"), Key::Kind::Table,
                "where the axes stand when a program begins: { Z_mm = 300, C_deg = 0 }",
                axis_word_fields({}).keys());
}

Key reference_key() {
  return key_of(KeyName("reference").otherwise("home"), Key::Kind::Table,
                "reference position, where G28 and its kin go: { Z_mm = 400 }",
                axis_word_fields({}).keys());
}

Key machine_zero_key() {
  return key_of(KeyName("machine_zero").otherwise("the zero of the axes"), Key::Kind::Table,
                "positions of the axes that G53, M91 and SUPA count from",
                axis_word_fields({}).keys());
}

void put_home(const MachineDescription& machine, Node::Table& table) {
  const auto fields = axis_word_fields(machine.joints);
  put(table, "home", fields.written(machine.home));
  if (machine.reference.size() > 0) put(table, "reference", fields.written(machine.reference));
  if (machine.machine_zero.size() > 0)
    put(table, "machine_zero", fields.written(machine.machine_zero));
}

const Fields<MachineDescription>& machine_fields() {
  using Machine = MachineDescription;
  static const Fields<Machine> fields =
      Fields<Machine>()
          .text("name", &Machine::name, "of the machine")
          .text("summary", &Machine::summary,
                "of what it is, one line, as `abbe new --list` has it")
          .table(must("nose"), &Machine::T_bs, nose_fields(), "where the tool is mounted")
          .table(KeyName("workpiece").otherwise("the bed frame"), &Machine::T_bw,
                 placement_fields(), "frame w of the workpiece")
          .number("rapid_mm_per_min", &Machine::rapid_speed, positive, "speed of slides in G0")
          .number(KeyName("rapid_deg_per_min").otherwise("3437.75: 1 rad/s"), &Machine::rapid_turn,
                  positive,
                  "speed of axes that turn in a G0 without slides; beside slides they keep pace "
                  "with these")
          .number(KeyName("max_spindle_rpm").otherwise("no limit"), &Machine::max_spindle_speed,
                  positive, "largest speed of the spindle under constant surface speed (G96)")
          .custom({code_key(), axis_key("[A-Z]", "every letter of the code but `s`",
                                        axis_fields(axis_of({})).keys())},
                  read_joints, put_joints)
          .custom({home_key(), reference_key(), machine_zero_key()}, read_home, put_home)
          .custom({body_key()}, read_bodies, put_bodies);
  return fields;
}

Fields<Joint> believed_fields(const Joint& joint) {
  return Fields<Joint>(joint)
      .vector(KeyName("point_mm").otherwise("as it is"), &Joint::point_b,
              "where the control believes it to be")
      .direction(KeyName("direction").otherwise("as it is"), &Joint::direction_b,
                 "that the control believes in");
}

void read_believed(TableReader& reader, const std::vector<Joint>& joints,
                   ControlDescription& control) {
  const Node* section = reader.section("axis");
  if (!section) return;
  control.joints = joints;
  TableReader axes(*section, reader.name_of("axis"), reader.faults());
  for (Joint& joint : control.joints) {
    const std::string name(1, joint.name);
    if (const Node* axis = axes.section(name))
      joint = believed_fields(joint).read_table(*axis, axes.name_of(name), reader.faults());
  }
  axes.close();
}

void put_believed(const ControlDescription& control, Node::Table& table) {
  Node::Table axes;
  for (const Joint& joint : control.joints)
    put(axes, std::string(1, joint.name), believed_fields(joint).written(joint));
  if (!axes.empty()) put(table, "axis", std::move(axes));
}

/// @param joints  of the machine as it is designed
Fields<ControlDescription> control_fields(const std::vector<Joint>& joints) {
  return Fields<ControlDescription>()
      .number(KeyName("tool_length_mm").otherwise("as it is"), &ControlDescription::tool_length,
              any_number, "of the tool, as the control believes")
      .custom(
          {axis_key("[A-Zs]", "an axis that the control believes elsewhere",
                    believed_fields({}).keys())},
          [joints](TableReader& reader, ControlDescription& control) {
            read_believed(reader, joints, control);
          },
          put_believed);
}

}  // namespace

MachineDescription read_machine(const Node& table, Faults& faults) {
  return machine_fields().read_table(table, "machine", faults);
}
Node::Table written_machine(const MachineDescription& machine) {
  return machine_fields().written(machine);
}
std::vector<Key> machine_keys() { return machine_fields().keys(); }

ControlDescription read_control(const Node& table, const std::vector<Joint>& joints,
                                Faults& faults) {
  return control_fields(joints).read_table(table, "control", faults);
}
Node::Table written_control(const ControlDescription& control) {
  return control_fields({}).written(control);
}
std::vector<Key> control_keys() { return control_fields({}).keys(); }

}  // namespace abbe::sim
