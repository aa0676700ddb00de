#include "sim/scene/machine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/axes.h"
#include "kinematics/units.h"
#include "sim/scene/bodies.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

namespace {

/// Names that the collision check gives to its own bodies.
constexpr std::array reserved_names{"part", "stock", "cutter", "shank", "holder"};

bool is_reserved_name(const std::string& name) {
  return std::ranges::find(reserved_names, name) != reserved_names.end();
}

std::string carrier_name(const MachineDescription& machine, const MachineBody& body) {
  return body.joint ? std::string(1, machine.joints[std::size_t(*body.joint)].name) : "b";
}

/// Returns a name such as "body of X", or "body 2 of X" if there are several.
/// @param suffix  " of X", or empty
std::string numbered_name(const char* noun, int number, int count, const std::string& suffix) {
  return count == 1 ? noun + suffix : fmt::format("{} {}{}", noun, number, suffix);
}

/// Returns the tables of a list; a single table counts as a list of one.
std::vector<const Node*> listed_tables(const Node* list) {
  std::vector<const Node*> tables;
  if (list != nullptr && list->table() != nullptr) tables.push_back(list);
  if (list != nullptr && list->array() != nullptr)
    for (const Node& table : *list->array()) tables.push_back(&table);
  return tables;
}

/// Reports every name that another body has or that is reserved.
/// @param kind  the kind of the named bodies, for messages
/// @param owners  description of the owner of each name in use
void check_unique_names(InputErrors& input_errors, const std::vector<const Node*>& tables,
                        const std::vector<std::string>& names, const char* kind,
                        std::map<std::string, std::string> owners) {
  // An invalid table gives no body, so names and tables would not correspond.
  if (tables.size() != names.size()) return;
  for (std::size_t i = 0; i < names.size(); ++i) {
    // A default name is not in the file, so the position of the body is reported.
    const Node* name_node = tables[i]->find("name");
    const SourcePosition& position =
        name_node != nullptr ? name_node->position : tables[i]->position;
    const auto owner = is_reserved_name(names[i])
                           ? fmt::format("the name of the {} itself", names[i])
                           : (owners.contains(names[i]) ? owners[names[i]] : std::string());
    if (!owner.empty())
      input_errors.add(position, fmt::format("a unique name for {}", kind),
                       fmt::format("\"{}\", {}", names[i], owner));
    owners.emplace(names[i], fmt::format("already the name of {}", kind));
  }
}

}  // namespace

std::vector<std::string> machine_body_names(const MachineDescription& machine) {
  std::map<std::string, int> count, number;
  // Only bodies without a name are numbered.
  for (const MachineBody& body : machine.bodies)
    count[carrier_name(machine, body)] += body.body.name.empty();
  std::vector<std::string> names;
  for (const MachineBody& body : machine.bodies) {
    const std::string carrier = carrier_name(machine, body);
    names.push_back(body.body.name.empty()
                        ? numbered_name("body", ++number[carrier], count[carrier], " of " + carrier)
                        : body.body.name);
  }
  return names;
}

std::vector<std::string> fixture_names(const std::vector<BodyDescription>& fixtures) {
  const auto count = int(std::ranges::count(fixtures, std::string(), &BodyDescription::name));
  int number = 0;
  std::vector<std::string> names;
  for (const BodyDescription& fixture : fixtures)
    names.push_back(fixture.name.empty() ? numbered_name("fixture", ++number, count, "")
                                         : fixture.name);
  return names;
}

void check_fixture_names(TableReader& scene, const MachineDescription& machine,
                         const std::vector<BodyDescription>& fixtures) {
  std::map<std::string, std::string> owners;
  for (const std::string& name : machine_body_names(machine))
    owners.emplace(name, "already the name of a body of the machine");
  check_unique_names(scene.input_errors(), listed_tables(scene.accept_key("fixture")),
                     fixture_names(fixtures), "a fixture", std::move(owners));
}

void check_ignored_names(TableReader& scene, const MachineDescription& machine,
                         const std::vector<BodyDescription>& fixtures) {
  const Node* collision = scene.accept_key("collision");
  // After an input error bodies may be missing, and correct names would be reported as unknown.
  if (collision == nullptr || !scene.input_errors().empty()) return;
  std::vector<std::string> names = machine_body_names(machine);
  for (const std::string& name : fixture_names(fixtures)) names.push_back(name);
  names.insert(names.end(), reserved_names.begin(), reserved_names.end());
  for (const Node* pair : listed_tables(collision->find("ignore"))) {
    const Node *a = pair->find("a"), *b = pair->find("b");
    for (const Node* name : {a, b})
      if (std::ranges::find(names, *name->text()) == names.end())
        scene.input_errors().add(name->position,
                                 fmt::format("the name of a body: {}", fmt::join(names, ", ")),
                                 display_text(*name));
    if (*a->text() == *b->text())
      scene.input_errors().add(b->position, "the name of a body other than collision.ignore.a",
                               display_text(*b));
  }
}

namespace {

using Eigen::Vector3d;
using kinematics::Joint;
using kinematics::Motion;

/// Returns the motion that the letter of an axis stands for.
Motion default_motion(char name) {
  if (name == 's') return Motion::Spindle;
  return std::string_view("XYZUVWPQR").find(name) != std::string_view::npos ? Motion::Linear
                                                                            : Motion::Rotary;
}

/// Returns the direction of an axis by its letter: ISO 841 names X, Y, Z and their parallel axes,
/// and A, B, C, which rotate about them.
std::optional<Vector3d> default_direction(char name) {
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
  // The negated comparison also rejects NaN.
  if (!(joint.min < joint.max)) {
    reader.report_invalid(key, "[min, max] with min below max for " + key, "not ascending");
  }
}

void put_travel(const Joint& joint, Node::Table& table) {
  // The default is an endless axis.
  const Joint endless;
  if (joint.min == endless.min && joint.max == endless.max) return;
  const char* key = joint.motion == Motion::Linear ? "travel_mm" : "travel_deg";
  put_numbers(table, key, Eigen::Vector2d(joint.min, joint.max), unit_factor(key));
}

/// @param axis  default values, which depend on the letter of the axis
Fields<Joint> axis_fields(const Joint& axis) {
  using kinematics::DeviationAxes;
  using kinematics::Squareness;
  const KeyName direction =
      KeyName("direction").with_fallback("x for X, U, A; y for Y, V, B; z for Z, W, C; none for S");
  const KeyName travel_mm = KeyName("travel_mm").with_fallback("unlimited");
  const KeyName travel_deg = KeyName("travel_deg").with_fallback("unlimited");
  return Fields<Joint>(axis)
      .choice(KeyName("motion").with_fallback("by letter: rotary for A, B, C, S"), &Joint::motion,
              {{"linear", Motion::Linear}, {"rotary", Motion::Rotary}}, "type of motion")
      .direction(default_direction(axis.name) ? direction : required_key(direction),
                 &Joint::direction_b,
                 "direction in which a positive command moves the tool relative to the workpiece, "
                 "or about which it turns the tool")
      .custom_field(
          {make_numbers_key(KeyName("point_mm").with_fallback("[0, 0, 0] for a slide"), 3,
                            "a point on the axis of rotation, required for a rotary axis; for a "
                            "slide, the point at which its deviations are stated")},
          [](TableReader& reader, Joint& joint) {
            joint.point_b = joint.motion == Motion::Linear
                                ? reader.vector("point_mm", Vector3d::Zero())
                                : reader.vector("point_mm");
          },
          [](const Joint& joint, Node::Table& table) {
            put_numbers(table, "point_mm", joint.point_b, 1.0);
          })
      .custom_field(
          {make_numbers_key(travel_mm, 2, "[min, max] of the commanded position of a slide"),
           make_numbers_key(travel_deg, 2, "[min, max] of the commanded angle of a rotary axis")},
          read_travel, put_travel)
      .choice("deviation_axes", &Joint::deviation_axes,
              {{"fixed", DeviationAxes::Fixed, "ISO 230-7"},
               {"turning", DeviationAxes::Turning, "the convention of the papers"}},
              "directions in which the deviations of a rotary axis are stated")
      .choice("squareness", &Joint::squareness,
              {{"frame", Squareness::Frame,
                "the axis turns with everything that it carries; if it carries the slide to which "
                "the angle is stated, everything that it carries turns by the opposite angle "
                "(`kinematics/README.md`)"},
               {"travel", Squareness::Travel, "only the direction of travel"}},
              "what a location angle turns; the angle is the same");
}

/// A joint with its rollover, a property of the control and not of the kinematics.
struct MachineAxis {
  Joint joint;
  program::Rollover rollover = program::Rollover::ByControl;
};

Fields<MachineAxis> machine_axis_fields(const MachineAxis& axis) {
  using program::Rollover;
  return Fields<MachineAxis>(axis)
      .include_fields(&MachineAxis::joint, axis_fields(axis.joint))
      .only_if([](const MachineAxis& axis) { return axis.joint.motion != Motion::Linear; },
               Fields<MachineAxis>().choice(
                   "rollover", &MachineAxis::rollover,
                   {{"by_control", Rollover::ByControl,
                     "\"shortest\" in a Fanuc program for an axis that carries the workpiece and "
                     "has unlimited travel or more than two turns; else \"none\""},
                    {"none", Rollover::None, "it turns by the difference of the positions"},
                    {"shortest", Rollover::Shortest,
                     "full turns are ignored; it turns by the shorter way"},
                    {"sign", Rollover::Sign,
                     "full turns are ignored; it turns in the direction of the sign of the word"}},
                   "how the control moves it to an absolute position"));
}

/// Returns the default joint of a letter in the structural code.
Joint make_default_joint(const kinematics::CodeAxis& code) {
  Joint joint;
  joint.name = code.name;
  joint.side = code.side;
  joint.motion = default_motion(code.name);
  // If the letter has no default direction, the key is required and replaces this one.
  joint.direction_b = default_direction(code.name).value_or(Vector3d::UnitX());
  return joint;
}

/// Returns the joint of the spindle, whose axis is the z axis of the nose frame.
Joint make_nose_joint(const kinematics::CodeAxis& code, const kinematics::Pose& T_bs) {
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
  // The default x direction must not be parallel to z.
  const Vector3d default_x = std::abs(z.x()) < 0.9 ? Vector3d::UnitX() : Vector3d::UnitZ();
  const Vector3d stated_x = reader.direction("x", (default_x - default_x.dot(z) * z).normalized());
  const Vector3d projected_x = stated_x - stated_x.dot(z) * z;
  // Within about a milliradian of z the projection has no reliable direction.
  if (projected_x.norm() < 1e-3) {
    reader.report_invalid("x", "a direction not parallel to the axis for machine.nose.x",
                          "a parallel one");
    return T_bs;
  }
  // An exact unit vector is kept, so that a written scene reads back as the same bits.
  const Vector3d x = projected_x.norm() == 1.0 ? projected_x : Vector3d(projected_x.normalized());
  T_bs.linear().col(0) = x;
  T_bs.linear().col(1) = z.cross(x);
  T_bs.linear().col(2) = z;
  return T_bs;
}

Fields<kinematics::Pose> nose_fields() {
  using kinematics::Pose;
  return Fields<Pose>(Pose::Identity())
      .custom_field(
          {make_numbers_key(required_key("at_mm"), 3, "position of the nose"),
           make_numbers_key(KeyName("axis").with_fallback("[0, 0, 1]"), 3,
                            "direction from the tip to the spindle"),
           make_numbers_key(KeyName("x").with_fallback("[1, 0, 0], or z if the axis is x"), 3,
                            "its x direction, made perpendicular to the axis")},
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
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("code", "a structural code such as \"w C' b X Y Z A s t\"", error.what());
    return std::nullopt;
  }
}

std::vector<MachineAxis> read_axes(TableReader& machine, const kinematics::Topology& topology,
                                   const kinematics::Pose& T_bs) {
  std::vector<MachineAxis> axes;
  const Node* section = machine.section("axis");
  // If the section is missing, an empty one is read, so that each missing axis is reported.
  Node empty_section;
  empty_section.position = machine.position();
  empty_section.value = Node::Table{};
  TableReader reader(section ? *section : empty_section, machine.qualified_name("axis"),
                     machine.input_errors());
  for (const kinematics::CodeAxis& code : topology) {
    // The nose has a section of its own.
    if (default_motion(code.name) == Motion::Spindle) {
      axes.push_back({make_nose_joint(code, T_bs)});
      continue;
    }
    const std::string name(1, code.name);
    if (const Node* table = reader.section(name)) {
      axes.push_back(machine_axis_fields({make_default_joint(code)})
                         .read_table(*table, reader.qualified_name(name), machine.input_errors()));
    } else if (!reader.has(name)) {  // section() reports a value of the wrong type
      reader.report_missing(name, "a table");
    }
  }
  reader.close();
  return axes;
}

void read_joints(TableReader& reader, MachineDescription& machine) {
  // An invalid code ends the reading; these keys must not be reported as unknown then.
  reader.accept_key("axis");
  for (const char* key : {"home", "reference", "machine_zero"}) reader.accept_key(key);
  const auto topology = read_code(reader);
  if (!topology) return;
  const std::size_t error_count = reader.input_errors().list().size();
  for (const MachineAxis& axis : read_axes(reader, *topology, machine.T_bs)) {
    machine.joints.push_back(axis.joint);
    machine.rollover.push_back(axis.rollover);
  }
  // The chain of an incomplete machine would report a misleading second error.
  if (machine.joints.size() != topology->size() ||
      reader.input_errors().list().size() != error_count)
    return;
  try {
    // The chain is built only for its validation.
    kinematics::Chain(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("code", "a machine that forms a valid chain", error.what());
  }
}

void put_joints(const MachineDescription& machine, Node::Table& table) {
  put_value(table, "code", kinematics::to_string(kinematics::chain_topology(machine.joints)));
  Node::Table axes;
  for (std::size_t j = 0; j < machine.joints.size(); ++j) {
    // A machine that was not read from a file has no rollover.
    const MachineAxis axis{machine.joints[j], j < machine.rollover.size()
                                                  ? machine.rollover[j]
                                                  : program::Rollover::ByControl};
    if (axis.joint.motion != Motion::Spindle)
      put_value(axes, std::string(1, axis.joint.name), machine_axis_fields(axis).to_table(axis));
  }
  if (!axes.empty()) put_value(table, "axis", std::move(axes));
}

void read_home(TableReader& reader, MachineDescription& machine) {
  const auto fields = axis_position_fields(machine.joints);
  machine.home = kinematics::AxisVector::Zero(Eigen::Index(machine.joints.size()));
  if (const Node* home = reader.section("home"))
    machine.home = fields.read_table(*home, reader.qualified_name("home"), reader.input_errors());
  if (const Node* reference = reader.section("reference"))
    machine.reference =
        fields.read_table(*reference, reader.qualified_name("reference"), reader.input_errors());
  if (const Node* machine_zero = reader.section("machine_zero"))
    machine.machine_zero = fields.read_table(*machine_zero, reader.qualified_name("machine_zero"),
                                             reader.input_errors());
}

/// Reads the letter of the joint that carries a body; b is the bed.
void read_carrier(TableReader& reader, const std::vector<Joint>& joints, MachineBody& body) {
  const std::string letter = reader.text("carried_by", "b");
  std::string known_letters = "b";
  for (std::size_t j = 0; j < joints.size(); ++j) {
    known_letters += std::string(" ") + joints[j].name;
    if (letter == std::string(1, joints[j].name)) body.joint = int(j);
  }
  // If the code is invalid, which is reported already, there are no joints.
  if (!body.joint && letter != "b" && !joints.empty())
    reader.report_invalid("carried_by", "a letter of the machine's code: " + known_letters, letter);
}

/// @param joints  of the machine
Fields<MachineBody> machine_body_fields(const std::vector<Joint>& joints) {
  return Fields<MachineBody>()
      .custom_field(
          {make_key(KeyName("carried_by").with_fallback("b"), Key::Kind::Text,
                    "letter of the axis that carries it, s for the spindle nose, b for the bed")},
          [joints](TableReader& reader, MachineBody& body) { read_carrier(reader, joints, body); },
          [joints](const MachineBody& body, Node::Table& table) {
            if (body.joint)
              put_value(table, "carried_by", std::string(1, joints[std::size_t(*body.joint)].name));
          })
      .include_fields(&MachineBody::body, body_fields());
}

void read_bodies(TableReader& reader, MachineDescription& machine) {
  const auto fields = machine_body_fields(machine.joints);
  for (const Node* node : reader.tables("body"))
    machine.bodies.push_back(
        fields.read_table(*node, reader.qualified_name("body"), reader.input_errors()));
  check_unique_names(reader.input_errors(), listed_tables(reader.accept_key("body")),
                     machine_body_names(machine), "a body of the machine", {});
}

void put_bodies(const MachineDescription& machine, Node::Table& table) {
  put_tables(table, "body", machine.bodies, machine_body_fields(machine.joints));
}

Key body_key() {
  return make_key(KeyName("body").with_fallback("none"), Key::Kind::Tables,
                  "bodies of the machine for pictures and collision checks, in the bed frame with "
                  "all axes at zero",
                  machine_body_fields({}).keys());
}

Key code_key() {
  return make_key(
      required_key("code"), Key::Kind::Text,
      "structural code, workpiece to tool: \"w C' b X Y Z A s t\"; primed axes carry the "
      "workpiece, `s` is the spindle nose");
}

/// Returns the key of a section with one table for each axis letter.
Key axis_key(const char* pattern, const char* sentence, std::vector<Key> keys) {
  Key letter = make_key("<axis>", Key::Kind::Table, sentence, std::move(keys));
  letter.pattern = pattern;
  return make_key("axis", Key::Kind::Table, "the axes by letter", {std::move(letter)});
}

Key home_key() {
  return make_key(KeyName("home").with_fallback("all at zero"), Key::Kind::Table,
                  "positions of the axes at the start of a program: { Z_mm = 300, C_deg = 0 }",
                  axis_position_fields({}).keys());
}

Key reference_key() {
  return make_key(KeyName("reference").with_fallback("home"), Key::Kind::Table,
                  "reference position of G28 and similar words: { Z_mm = 400 }",
                  axis_position_fields({}).keys());
}

Key machine_zero_key() {
  return make_key(KeyName("machine_zero").with_fallback("the zeros of the axes"), Key::Kind::Table,
                  "axis positions from which G53, M91 and SUPA are measured",
                  axis_position_fields({}).keys());
}

void put_home(const MachineDescription& machine, Node::Table& table) {
  const auto fields = axis_position_fields(machine.joints);
  put_value(table, "home", fields.to_table(machine.home));
  // Empty vectors stand for the defaults.
  if (machine.reference.size() > 0)
    put_value(table, "reference", fields.to_table(machine.reference));
  if (machine.machine_zero.size() > 0)
    put_value(table, "machine_zero", fields.to_table(machine.machine_zero));
}

const Fields<MachineDescription>& machine_fields() {
  using Machine = MachineDescription;
  static const Fields<Machine> fields =
      Fields<Machine>()
          .text("name", &Machine::name, "name of the machine")
          .text("summary", &Machine::summary,
                "description in one line, as printed by `abbe new --list`")
          .table(required_key("nose"), &Machine::T_bs, nose_fields(), "where the tool is mounted")
          .table(KeyName("workpiece").with_fallback("the bed frame"), &Machine::T_bw,
                 placement_fields(), "frame w of the workpiece")
          .number("rapid_mm_per_min", &Machine::rapid_speed, positive, "rapid speed of slides (G0)")
          .number(KeyName("rapid_deg_per_min").with_fallback("3437.75 (1 rad/s)"),
                  &Machine::rapid_rotation_speed, positive,
                  "speed of rotary axes in a G0 without slides; in a G0 with slides they finish "
                  "together with these")
          .number(KeyName("max_spindle_rpm").with_fallback("no limit"), &Machine::max_spindle_speed,
                  positive, "largest speed of the spindle under constant surface speed (G96)")
          .custom_field({code_key(), axis_key("[A-Z]", "every letter of the code except `s`",
                                              axis_fields(make_default_joint({})).keys())},
                        read_joints, put_joints)
          .custom_field({home_key(), reference_key(), machine_zero_key()}, read_home, put_home)
          .custom_field({body_key()}, read_bodies, put_bodies);
  return fields;
}

Fields<Joint> believed_joint_fields(const Joint& joint) {
  return Fields<Joint>(joint)
      .vector(KeyName("point_mm").with_fallback("as nominal"), &Joint::point_b,
              "point believed by the control")
      .direction(KeyName("direction").with_fallback("as nominal"), &Joint::direction_b,
                 "direction believed by the control");
}

void read_believed_joints(TableReader& reader, const std::vector<Joint>& joints,
                          ControlDescription& control) {
  const Node* section = reader.section("axis");
  if (!section) return;
  // The section states differences only; the remaining joints are as designed.
  control.joints = joints;
  TableReader axes(*section, reader.qualified_name("axis"), reader.input_errors());
  for (Joint& joint : control.joints) {
    const std::string name(1, joint.name);
    if (const Node* axis = axes.section(name))
      joint = believed_joint_fields(joint).read_table(*axis, axes.qualified_name(name),
                                                      reader.input_errors());
  }
  axes.close();
}

void put_believed_joints(const ControlDescription& control, Node::Table& table) {
  Node::Table axes;
  for (const Joint& joint : control.joints)
    put_value(axes, std::string(1, joint.name), believed_joint_fields(joint).to_table(joint));
  if (!axes.empty()) put_value(table, "axis", std::move(axes));
}

/// @param joints  of the machine as designed
Fields<ControlDescription> control_fields(const std::vector<Joint>& joints) {
  return Fields<ControlDescription>()
      .number(KeyName("tool_length_mm").with_fallback("as nominal"),
              &ControlDescription::tool_length, any_number, "tool length believed by the control")
      .custom_field(
          {axis_key("[A-Zs]", "an axis about which the control's belief differs",
                    believed_joint_fields({}).keys())},
          [joints](TableReader& reader, ControlDescription& control) {
            read_believed_joints(reader, joints, control);
          },
          put_believed_joints);
}

}  // namespace

MachineDescription read_machine(const Node& table, InputErrors& input_errors) {
  return machine_fields().read_table(table, "machine", input_errors);
}
Node::Table machine_to_table(const MachineDescription& machine) {
  return machine_fields().to_table(machine);
}
std::vector<Key> machine_keys() { return machine_fields().keys(); }

ControlDescription read_control(const Node& table, const std::vector<Joint>& joints,
                                InputErrors& input_errors) {
  return control_fields(joints).read_table(table, "control", input_errors);
}
Node::Table control_to_table(const ControlDescription& control) {
  return control_fields({}).to_table(control);
}
std::vector<Key> control_keys() { return control_fields({}).keys(); }

namespace {

using kinematics::Deviation;

Fields<DatumDescription::Touch> touch_fields() {
  using Touch = DatumDescription::Touch;
  return Fields<Touch>()
      .vector(required_key("point_mm"), &Touch::point_w, "contact point, in the workpiece frame")
      .direction(required_key("direction"), &Touch::direction_w,
                 "direction in which the probe moves, towards the face");
}

/// Returns the fields of the time of the datum, which is negative in the thermal history before the
/// program.
Fields<DatumDescription> time_fields() {
  Key hours = make_key("time_h", Key::Kind::Number, "the same in hours");
  return Fields<DatumDescription>()
      .number("time_s", &DatumDescription::time_s, any_number,
              "time at which the datum was found, negative before the program; with heat, drift is "
              "counted from there")
      .custom_field(
          {hours},
          [](TableReader& reader, DatumDescription& datum) {
            const auto time_s = reader.maybe_number("time_h", any_number);
            if (!reader.has("time_h")) return;
            // The keys state the same time in different units.
            if (reader.has("time_s"))
              reader.report_invalid("time_h", "either time_s or time_h", "both");
            datum.time_s = time_s.value_or(1.0);
          },
          [](const DatumDescription&, Node::Table&) {});
}

Fields<DatumDescription> datum_kind_fields(DatumDescription::Kind kind) {
  Fields<DatumDescription> fields;
  // Only the keys of this kind are read; those of another are reported as unknown.
  if (kind == DatumDescription::Kind::Ideal)
    fields.vector("point_mm", &DatumDescription::point_w,
                  "point at which the tip is set exactly, in the workpiece frame");
  if (kind != DatumDescription::Kind::None) fields.include_fields(whole_struct, time_fields());
  if (kind == DatumDescription::Kind::TouchOff)
    fields.tables(required_key("touch"), &DatumDescription::touches, touch_fields(),
                  "touches of the probe, each on the part, its blank, a fixture or the table "
                  "within `search.band_mm`, at most 40 degrees from the normal of the face");
  return fields;
}

}  // namespace

const Fields<Deviation>& setup_fields() {
  static const Fields<Deviation> fields = [] {
    Fields<Deviation> components;
    const char* names[] = {"EX_um", "EY_um", "EZ_um", "EA_urad", "EB_urad", "EC_urad"};
    for (int i = 0; i < 6; ++i)
      components.number(
          KeyName(names[i]).with_fallback("0"), [i](auto& setup) -> auto& { return setup[i]; },
          any_number,
          i < 3 ? "displacement of the part, actual minus nominal"
                : "rotation of the part, actual minus nominal");
    return components;
  }();
  return fields;
}

const Fields<DatumDescription>& datum_fields() {
  static const Fields<DatumDescription> fields = [] {
    Key kind = make_key(required_key("kind"), Key::Kind::Text, "how the control finds the part");
    const std::vector<std::pair<DatumDescription::Kind, EnumChoice>> kinds{
        {DatumDescription::Kind::None, {"none", "not at all; its nominal position is assumed", {}}},
        {DatumDescription::Kind::Ideal, {"ideal", "the tip is set exactly at one point", {}}},
        {DatumDescription::Kind::TouchOff,
         {"touch_off", "with a probe, subject to the machine's errors", {}}}};
    for (auto [datum_kind, word] : kinds) {
      word.keys = datum_kind_fields(datum_kind).keys();
      kind.choices.push_back(std::move(word));
    }
    return Fields<DatumDescription>().custom_field(
        {kind},
        [kind, kinds](TableReader& reader, DatumDescription& datum) {
          const auto word = reader.word("kind", choice_names(kind), true);
          for (const auto& [datum_kind, choice] : kinds)
            if (word == choice.word) datum.kind = datum_kind;
          datum = datum_kind_fields(datum.kind).read(reader, datum);
        },
        [kinds](const DatumDescription& datum, Node::Table& table) {
          for (const auto& [datum_kind, choice] : kinds)
            if (datum.kind == datum_kind) put_value(table, "kind", choice.word);
          append_entries(table, datum_kind_fields(datum.kind).to_table(datum));
        });
  }();
  return fields;
}

}  // namespace abbe::sim
