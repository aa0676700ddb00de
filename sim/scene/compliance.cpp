#include "sim/scene/compliance.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/compliance.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

#if ABBE_RENDER
#include "render/vtk_reader.h"
#endif

namespace abbe::sim {

namespace {

constexpr Range poisson_range{-1.0, 0.5, true, false};
constexpr Range bar_diameter{1e-3, 1e5};  // mm

using errors::WorkpieceBar;
using errors::WorkpieceCompliance;
using errors::WorkpieceField;
using errors::WorkpiecePlate;

/// Reads the second moment of area of a bar, stated directly or by the diameter of a round bar.
void read_second_moment(TableReader& reader, WorkpieceBar& bar) {
  const auto diameter = reader.maybe_number("diameter_mm", bar_diameter);
  const auto second_moment = reader.maybe_number("second_moment_mm4", positive);
  // Either key determines the bending stiffness, so the two could contradict each other.
  if (diameter && second_moment) {
    reader.report_invalid("second_moment_mm4", "diameter_mm or second_moment_mm4", "both");
  } else if (!reader.has("diameter_mm") && !reader.has("second_moment_mm4")) {
    reader.report_missing("diameter_mm", "a number, or second_moment_mm4,");
  }
  // A solid round section has pi d^4 / 64.
  bar.second_moment = second_moment.value_or(pi * std::pow(diameter.value_or(0.0), 4) / 64.0);
}

Fields<WorkpieceBar> bar_fields() {
  Key diameter = make_key(KeyName("diameter_mm").in_exclusive_group("section"), Key::Kind::Number,
                          "diameter of a round bar");
  Key second_moment = make_key(
      KeyName("second_moment_mm4").in_exclusive_group("section"), Key::Kind::Number,
      "second moment of area of a bar that is not round, in mm⁴, equal about both transverse axes");
  diameter.range = bar_diameter;
  second_moment.range = positive;
  return Fields<WorkpieceBar>()
      .vector("clamp_mm", &WorkpieceBar::clamp_w, "centre of the clamped end")
      .direction("direction", &WorkpieceBar::direction_w, "direction from the clamp outwards")
      .number(required_key("length_mm"), &WorkpieceBar::length, positive,
              "length from the clamp to the free end")
      .number(required_key("youngs_modulus_GPa"), &WorkpieceBar::youngs_modulus, positive,
              "Young's modulus of the material")
      .custom_field({diameter, second_moment}, read_second_moment,
                    [](const WorkpieceBar& bar, Node::Table& table) {
                      put_value(table, "second_moment_mm4", bar.second_moment);
                    });
}

Fields<WorkpiecePlate> plate_fields() {
  return Fields<WorkpiecePlate>()
      .vector("foot_mm", &WorkpiecePlate::foot_w, "a point on the foot")
      .direction("up", &WorkpiecePlate::up_w,
                 "direction from the foot to the free edge, perpendicular to `normal`")
      .direction(required_key("normal"), &WorkpiecePlate::normal_w, "direction across the wall")
      .number(required_key("height_mm"), &WorkpiecePlate::height, positive, "height above the foot")
      .number(required_key("thickness_mm"), &WorkpiecePlate::thickness, positive,
              "thickness of the wall")
      .number(required_key("youngs_modulus_GPa"), &WorkpiecePlate::youngs_modulus, positive,
              "Young's modulus of the material")
      .number("poisson_ratio", &WorkpiecePlate::poisson_ratio, poisson_range,
              "Poisson's ratio of the material");
}

WorkpieceField read_vtu_field([[maybe_unused]] const std::filesystem::path& file) {
#if ABBE_RENDER
  render::PointTensors field = render::read_vtu(file, "compliance_um_per_N");
  // um/N in the file, mm/N in the models.
  for (Eigen::Matrix3d& C : field.tensors) C *= units::um;
  return {std::move(field.points), std::move(field.tensors)};
#else
  throw BadInput(file.string(), 0, 0, "a program built with -DABBE_RENDER=ON, or a .csv file",
                 "a program built without VTK");
#endif
}

void read_field(TableReader& reader, WorkpieceField& field) {
  const std::filesystem::path file = field.file;
  if (file.empty()) return;
  try {
    if (file.extension() == ".csv")
      field =
          errors::read_compliance_field(read_text(file, errors::max_field_bytes), file.string());
    else if (file.extension() == ".vtu")
      field = read_vtu_field(file);
    else
      reader.report_invalid("file", "a field file named .csv or .vtu", file.string());
    // The readers return a new field, which has no file name.
    field.file = file.string();
  } catch (const BadInput& error) {
    // An error without a line number concerns the file as a whole, so it is reported at the key
    // `file` of the scene.
    if (error.line == 0) {
      reader.report_invalid("file", error.expected, file.string() + ": " + error.seen);
    } else {
      reader.input_errors().add(error);
    }
  }
}

Fields<WorkpieceField> field_fields() {
  return Fields<WorkpieceField>()
      .text(required_key("file"), &WorkpieceField::file,
            "surface nodes from a finite-element program, each with its displacement per unit "
            "force there, .csv or .vtu")
      .check(read_field);
}

const Fields<WorkpieceCompliance>& workpiece_kind_fields() {
  static const Fields<WorkpieceCompliance> fields = Fields<WorkpieceCompliance>().variant(
      required_key("kind"), whole_struct,
      {alternative<WorkpieceCompliance>("bar", bar_fields(),
                                        "cantilever with transverse deflection"),
       alternative<WorkpieceCompliance>(
           "plate", plate_fields(),
           "infinitely long wall clamped at its foot, with deflection normal to its surface"),
       alternative<WorkpieceCompliance>("field", field_fields(),
                                        "computed by a finite-element program")},
      "kind of part");
  return fields;
}

/// Returns the key at which an invalid part is reported.
const char* offending_key(const WorkpieceCompliance& part) {
  if (std::holds_alternative<WorkpieceField>(part)) return "file";
  return std::holds_alternative<WorkpiecePlate>(part) ? "normal" : "kind";
}

void read_workpiece_stiffness(TableReader& compliance, errors::ComplianceErrors& errors) {
  const Node* section = compliance.section("workpiece");
  if (!section) return;
  TableReader reader(*section, compliance.qualified_name("workpiece"), compliance.input_errors());
  const std::size_t error_count = reader.input_errors().list().size();
  WorkpieceCompliance part = workpiece_kind_fields().read(reader);
  reader.close();
  // If a key is invalid, the validation below would report misleading errors.
  if (reader.input_errors().list().size() != error_count) return;
  try {
    // The validation of the models is used, so that a scene accepts exactly what they accept.
    errors::validate(part);
    errors.workpiece = std::move(part);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid(offending_key(part), "a valid workpiece", error.what());
  }
}

/// Returns the fields of `[compliance.workpiece]`, the deflection of the part under the tool.
Fields<errors::ComplianceErrors> workpiece_fields() {
  return Fields<errors::ComplianceErrors>().custom_field(
      {make_key(KeyName("workpiece").with_fallback("stiff"), Key::Kind::Table,
                "compliance of the part at the contact point, in the workpiece frame",
                workpiece_kind_fields().keys())},
      read_workpiece_stiffness, [](const errors::ComplianceErrors& errors, Node::Table& table) {
        if (errors.workpiece)
          put_value(table, "workpiece", workpiece_kind_fields().to_table(*errors.workpiece));
      });
}

using errors::CantileverSection;
using errors::Compliance;
using errors::ComplianceErrors;
using errors::MovingMass;
using kinematics::Wrench;

constexpr double standard_gravity = 9806.65;  // mm/s^2
constexpr double min_stiffness_N_per_um = 1e-6;
constexpr double min_stiffness_Nm_per_urad = 1e-9;
// Largest entry of a compliance matrix, mm/N (the inverse of min_stiffness_N_per_um) or rad/(N mm).
constexpr double max_compliance = 1e3;

/// Reads three stiffnesses k and returns the compliances 1/k; zero, i.e. stiff, without the key.
/// @param min_stiffness  in the unit of the key
Eigen::Vector3d read_inverse_stiffness(TableReader& reader, const std::string& key,
                                       double min_stiffness) {
  Eigen::Vector3d compliances = Eigen::Vector3d::Zero();
  const auto stiffnesses = reader.numbers_as_written(key, 3);
  if (!stiffnesses) return compliances;
  // Checked before the inversion, since a stiffness near zero would give an unbounded compliance.
  if (stiffnesses->minCoeff() < min_stiffness) {
    reader.report_invalid(
        key,
        fmt::format("three stiffnesses of at least {} (omit what is stiff) for {}", min_stiffness,
                    key),
        fmt::format("{}", stiffnesses->minCoeff()));
    return compliances;
  }
  return (*stiffnesses * unit_factor(key)).cwiseInverse();
}

Compliance read_matrix(TableReader& reader) {
  const auto numbers = reader.maybe_numbers("matrix", 36);
  if (!numbers) return Compliance::Zero();
  // A matrix in a wrong unit gets a clearer message here than from the test of its eigenvalues.
  if (numbers->cwiseAbs().maxCoeff() > max_compliance) {
    reader.report_invalid("matrix", fmt::format("entries of at most {} for matrix", max_compliance),
                          fmt::format("{}", numbers->cwiseAbs().maxCoeff()));
    return Compliance::Zero();
  }
  const Compliance C =
      Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(numbers->data());
  try {
    errors::validate(C, "matrix");
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("matrix", "a valid compliance", error.what());
    return Compliance::Zero();
  }
  return C;
}

/// Reads a compliance, stated either by `stiffness_N_per_um` and `turning_stiffness_Nm_per_urad`
/// along axes turned by `turn_deg`, or by `matrix`.
Compliance read_stiffness(TableReader& reader) {
  const Eigen::Vector3d linear =
      read_inverse_stiffness(reader, "stiffness_N_per_um", min_stiffness_N_per_um);
  const Eigen::Vector3d angular =
      read_inverse_stiffness(reader, "turning_stiffness_Nm_per_urad", min_stiffness_Nm_per_urad);
  const bool has_stiffness =
      reader.has("stiffness_N_per_um") || reader.has("turning_stiffness_Nm_per_urad");
  if (has_stiffness && reader.has("matrix"))
    reader.report_invalid("matrix", "either stiffnesses or a matrix", "both");
  // A matrix is stated in the frame of the element, so `turn_deg` would have no effect on it.
  if (reader.has("turn_deg") && !has_stiffness)
    reader.report_invalid("turn_deg", "stiffnesses to which turn_deg applies", "none");
  const Eigen::Matrix3d R = read_turn(reader);
  Compliance C = Compliance::Zero();
  // The stiffnesses act along the turned axes; R transforms them to the frame of the element.
  C.topLeftCorner<3, 3>() = R * linear.asDiagonal() * R.transpose();
  C.bottomRightCorner<3, 3>() = R * angular.asDiagonal() * R.transpose();
  return C + read_matrix(reader);
}

/// Returns the fields of one compliant element. It is always written as its matrix, however it was
/// stated.
Fields<Compliance> make_stiffness_fields() {
  const auto make_stiffness_key = [](const char* name, const char* letters, double min_stiffness) {
    return make_numbers_key(name, 3,
                            fmt::format("{}, each at least {}", letters, min_stiffness).c_str());
  };
  std::vector<Key> keys{
      make_stiffness_key("stiffness_N_per_um", "[kx, ky, kz]", min_stiffness_N_per_um),
      make_stiffness_key("turning_stiffness_Nm_per_urad", "[ka, kb, kc]",
                         min_stiffness_Nm_per_urad)};
  for (Key& key : turn_fields().keys()) keys.push_back(std::move(key));
  keys.push_back(make_numbers_key(
      "matrix", 36,
      "compliance, in place of the stiffnesses, row by row: rows EX EY EZ EA EB EC in mm and rad, "
      "columns FX FY FZ MX MY MZ in N and N mm; symmetric, without negative eigenvalues"));
  return Fields<Compliance>(Compliance::Zero())
      .custom_field(
          std::move(keys), [](TableReader& reader, Compliance& C) { C = read_stiffness(reader); },
          [](const Compliance& C, Node::Table& table) {
            // A stiff element is the default.
            if (!C.isZero(0.0)) put_numbers(table, "matrix", C.reshaped<Eigen::RowMajor>(), 1.0);
          });
}

const Fields<Compliance>& stiffness_fields() {
  static const Fields<Compliance> fields = make_stiffness_fields();
  return fields;
}

void read_joint_stiffness(TableReader& compliance, const MachineDescription& machine,
                          ComplianceErrors& errors) {
  const Node* section = compliance.section("axis");
  if (!section) return;
  TableReader reader(*section, compliance.qualified_name("axis"), compliance.input_errors());
  for (const kinematics::Joint& joint : machine.joints) {
    // The chain names the spindle nose 's'; scenes name all axes in capitals.
    const char letter = joint.name == 's' ? 'S' : joint.name;
    const std::string key(1, letter);
    const Node* node = reader.section(key);
    if (node)
      errors.joints.push_back(
          {letter, stiffness_fields().read_table(*node, reader.qualified_name(key),
                                                 reader.input_errors())});
  }
  // Reports unknown axes. If the machine could not be read, there are no joints, and every axis
  // would be reported.
  if (!machine.joints.empty()) reader.close();
}

Fields<ComplianceErrors> joints_fields(const MachineDescription& machine) {
  Key axis_key = make_key(
      "<axis>", Key::Kind::Table,
      "compliance at the point of the axis, along the axes of its deviations; S is the spindle",
      stiffness_fields().keys());
  axis_key.pattern = "[A-Z]";
  const Key key = make_key(KeyName("axis").with_fallback("stiff"), Key::Kind::Table,
                           "stiffness of the carriages", {axis_key});
  return Fields<ComplianceErrors>().custom_field(
      {key},
      [machine](TableReader& reader, ComplianceErrors& errors) {
        read_joint_stiffness(reader, machine, errors);
      },
      [](const ComplianceErrors& errors, Node::Table& table) {
        Node::Table joints;
        for (const errors::JointCompliance& joint : errors.joints)
          put_value(joints, std::string(1, joint.axis), stiffness_fields().to_table(joint.C));
        if (!joints.empty()) put_value(table, "axis", std::move(joints));
      });
}

Fields<CantileverSection> section_fields() {
  return Fields<CantileverSection>()
      .number(required_key("length_mm"), &CantileverSection::length, positive,
              "length along the tool")
      .number(required_key("diameter_mm"), &CantileverSection::diameter, bar_diameter,
              "diameter; the effective diameter for a fluted section")
      .number(required_key("youngs_modulus_GPa"), &CantileverSection::youngs_modulus, positive,
              "Young's modulus of the material")
      .number("poisson_ratio", &CantileverSection::poisson_ratio, poisson_range,
              "Poisson's ratio of the material");
}

/// Adds the compliance of the sections of a tool.
void read_sections(TableReader& reader, Compliance& tool) {
  const std::size_t error_count = reader.input_errors().list().size();
  std::vector<CantileverSection> sections;
  for (const Node* node : reader.tables("section"))
    sections.push_back(section_fields().read_table(*node, reader.qualified_name("section"),
                                                   reader.input_errors()));
  // If a section is invalid, the sum over the others would be wrong.
  if (sections.empty() || reader.input_errors().list().size() != error_count) return;
  try {
    // The sections and the stated stiffness are in series between nose and tip, so their
    // compliances add up.
    tool += errors::stepped_cantilever(sections);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("section", "valid sections", error.what());
  }
}

}  // namespace

const Fields<Compliance>& tool_compliance_fields() {
  static const Fields<Compliance> fields =
      Fields<Compliance>(stiffness_fields())
          .custom_field({make_key("section", Key::Kind::Tables,
                                  "round sections from the tip to the clamp; their compliance is "
                                  "added to that of the stiffnesses",
                                  section_fields().keys())},
                        read_sections,
                        // Stiffness and sections are written as one matrix.
                        [](const Compliance&, Node::Table&) {});
  return fields;
}

namespace {

Fields<ComplianceErrors> tool_section_fields() {
  const Key tool = make_key(
      KeyName("tool").with_fallback("stiff"), Key::Kind::Table,
      "compliance from the spindle nose to the tip, at the tip in the tool frame; a tool with its "
      "own `compliance` replaces it",
      tool_compliance_fields().keys());
  return Fields<ComplianceErrors>().custom_field(
      {tool},
      [](TableReader& reader, ComplianceErrors& errors) {
        if (const Node* section = reader.section("tool"))
          errors.tool = tool_compliance_fields().read_table(*section, reader.qualified_name("tool"),
                                                            reader.input_errors());
      },
      [](const ComplianceErrors& errors, Node::Table& table) {
        Node::Table tool = tool_compliance_fields().to_table(errors.tool);
        if (!tool.empty()) put_value(table, "tool", std::move(tool));
      });
}

/// Checks that the machine has the axis that carries the mass, and reports an error at the key of
/// this mass.
void check_mass(TableReader& reader, const MovingMass& mass, const MachineDescription& machine) {
  if (machine.joints.empty()) return;
  std::optional<kinematics::Chain> chain;
  try {
    chain.emplace(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument&) {
    return;  // the invalid machine is reported by its own reader
  }
  try {
    ComplianceErrors errors;
    errors.masses = {mass};
    errors::bind(errors, *chain);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("axis", "a carriage of the machine, \"t\" or \"w\"", error.what());
  }
}

Fields<MovingMass> mass_fields() {
  const Key axis = make_key(required_key("axis"), Key::Kind::Text,
                            "letter of the axis that carries it, \"S\" for the spindle, \"t\" for "
                            "the tool or \"w\" for the part");
  return Fields<MovingMass>()
      .remark("name", "name of the mass")
      .custom_field(
          {axis},
          [](TableReader& reader, MovingMass& mass) {
            const std::string letter = reader.text("axis");
            if (!letter.empty()) mass.axis = letter.front();
          },
          [](const MovingMass& mass, Node::Table& table) {
            put_value(table, "axis", std::string(1, mass.axis));
          })
      .number(required_key("mass_kg"), &MovingMass::mass_kg, non_negative,
              "mass, concentrated at a point")
      .vector(required_key("centre_mm"), &MovingMass::centre_b,
              "centre in the bed frame, with all axes at zero");
}

void read_masses(TableReader& compliance, const MachineDescription& machine,
                 ComplianceErrors& errors) {
  for (const Node* node : compliance.tables("mass")) {
    TableReader reader(*node, compliance.qualified_name("mass"), compliance.input_errors());
    const std::size_t error_count = reader.input_errors().list().size();
    const MovingMass mass = mass_fields().read(reader);
    reader.close();
    if (reader.input_errors().list().size() != error_count) continue;
    // The field keeps only the first letter, so the length of the text is checked separately.
    if (const std::string axis = reader.text("axis", ""); axis.size() != 1) {
      reader.report_invalid("axis", "a single letter", axis);
      continue;
    }
    check_mass(reader, mass, machine);
    errors.masses.push_back(mass);
  }
}

Fields<ComplianceErrors> masses_fields(const MachineDescription& machine) {
  return Fields<ComplianceErrors>().custom_field(
      {make_key("mass", Key::Kind::Tables, "moving masses, for gravity and inertia",
                mass_fields().keys())},
      [machine](TableReader& reader, ComplianceErrors& errors) {
        read_masses(reader, machine, errors);
      },
      [](const ComplianceErrors& errors, Node::Table& table) {
        put_tables(table, "mass", errors.masses, mass_fields());
      });
}

Fields<ComplianceErrors> gravity_fields() {
  return Fields<ComplianceErrors>()
      .custom_field(
          {make_numbers_key(
              KeyName("gravity").with_fallback("off"), 3,
              "direction of gravity, 9806.65 mm/s², in the bed frame, such as [0, 0, -1]")},
          [](TableReader& reader, ComplianceErrors& errors) {
            // direction() would report a missing key, but gravity is optional.
            if (reader.accept_key("gravity"))
              errors.gravity_b = standard_gravity * reader.direction("gravity");
          },
          [](const ComplianceErrors& errors, Node::Table& table) {
            if (errors.gravity_b)
              put_numbers(table, "gravity", *errors.gravity_b, standard_gravity);
          })
      .boolean(
          "inertia", &ComplianceErrors::inertia,
          "true: the masses resist their acceleration; terms in velocity squared are neglected");
}

Fields<Wrench> clamping_fields() {
  Fields<Wrench> fields(Wrench::Zero());
  const std::array keys{"FX_N", "FY_N", "FZ_N", "MX_Nm", "MY_Nm", "MZ_Nm"};
  // Each key sets one component of the wrench.
  for (int i = 0; i < 6; ++i)
    fields.number(
        keys[std::size_t(i)], [i](auto& wrench) -> auto& { return wrench[i]; }, any_number,
        i < 3 ? "force" : "moment");
  return fields;
}

Fields<ComplianceErrors> compliance_fields(const MachineDescription& machine) {
  return Fields<ComplianceErrors>()
      .remark("name", "name of the compliant structure")
      .number("scale", &ComplianceErrors::scale, {0.0, 1e6}, "factor of all compliances")
      .include_fields(whole_struct, joints_fields(machine))
      .include_fields(whole_struct, tool_section_fields())
      .table(KeyName("fixture").with_fallback("stiff"), &ComplianceErrors::fixture,
             stiffness_fields(),
             "compliance of the part on its carriage, at the origin of the workpiece frame")
      .include_fields(whole_struct, workpiece_fields())
      .include_fields(whole_struct, masses_fields(machine))
      .include_fields(whole_struct, gravity_fields())
      .table("clamping", &ComplianceErrors::clamping_w, clamping_fields(),
             "clamping wrench on the part at the origin of the workpiece frame, which acts on the "
             "fixture only");
}

}  // namespace

ComplianceErrors read_compliance(const Node& table, const MachineDescription& machine,
                                 InputErrors& input_errors) {
  return compliance_fields(machine).read_table(table, "compliance", input_errors);
}

Node::Table compliance_to_table(const ComplianceErrors& errors, const MachineDescription& machine) {
  return compliance_fields(machine).to_table(errors);
}

std::vector<Key> compliance_keys() { return compliance_fields({}).keys(); }

}  // namespace abbe::sim
