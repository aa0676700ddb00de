#include <array>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/scene/scene_sections.h"
#include "sim/scene/scene_workpiece.h"

namespace abbe::sim {

namespace {

using errors::CantileverSection;
using errors::Compliance;
using errors::ComplianceErrors;
using errors::MovingMass;
using kinematics::Wrench;

constexpr double standard_gravity = 9806.65;  // mm/s^2
constexpr double softest_N_per_um = 1e-6;
constexpr double softest_Nm_per_urad = 1e-9;
constexpr double softest_entry = 1e3;  // of a matrix, mm/N as 1e-6 N/um and rad/(N mm) likewise

/// Compliances 1/k of three stiffnesses, zero where they are left out.
/// @param least  in the unit of the key
Eigen::Vector3d softness(TableReader& reader, const std::string& key, double least) {
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  const auto k = reader.numbers_as_written(key, 3);
  if (!k) return c;
  if (k->minCoeff() < least) {
    reader.refuse(
        key,
        fmt::format("three stiffnesses above 0, at least {} (leave out what is stiff), for {}",
                    least, key),
        fmt::format("{}", k->minCoeff()));
    return c;
  }
  return (*k * unit_of(key)).cwiseInverse();
}

Compliance read_matrix(TableReader& reader) {
  const auto numbers = reader.maybe_numbers("matrix", 36);
  if (!numbers) return Compliance::Zero();
  if (numbers->cwiseAbs().maxCoeff() > softest_entry) {
    reader.refuse("matrix", fmt::format("entries of at most {} for matrix", softest_entry),
                  fmt::format("{}", numbers->cwiseAbs().maxCoeff()));
    return Compliance::Zero();
  }
  const Compliance C =
      Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(numbers->data());
  try {
    errors::validate(C, "matrix");
  } catch (const std::invalid_argument& fault) {
    reader.refuse("matrix", "a compliance that can be", fault.what());
    return Compliance::Zero();
  }
  return C;
}

/// What gives way by `stiffness_N_per_um` and `turning_stiffness_Nm_per_urad` along axes turned by
/// `turn_deg`, or by `matrix`.
Compliance read_stiffness(TableReader& reader) {
  const Eigen::Vector3d linear = softness(reader, "stiffness_N_per_um", softest_N_per_um);
  const Eigen::Vector3d angular =
      softness(reader, "turning_stiffness_Nm_per_urad", softest_Nm_per_urad);
  const bool by_numbers =
      reader.has("stiffness_N_per_um") || reader.has("turning_stiffness_Nm_per_urad");
  if (by_numbers && reader.has("matrix"))
    reader.refuse("matrix", "stiffnesses or a matrix", "both");
  if (reader.has("turn_deg") && !by_numbers)
    reader.refuse("turn_deg", "stiffnesses that it turns", "none");
  const Eigen::Matrix3d R = read_turn(reader);
  Compliance C = Compliance::Zero();
  C.topLeftCorner<3, 3>() = R * linear.asDiagonal() * R.transpose();
  C.bottomRightCorner<3, 3>() = R * angular.asDiagonal() * R.transpose();
  return C + read_matrix(reader);
}

/// What gives way at one place; it is written as its matrix.
Fields<Compliance> made_stiffness_fields() {
  const auto stiffness = [](const char* name, const char* letters, double least) {
    return key_of_numbers(name, 3, fmt::format("{}, each at least {}", letters, least).c_str());
  };
  std::vector<Key> keys{
      stiffness("stiffness_N_per_um", "[kx, ky, kz]", softest_N_per_um),
      stiffness("turning_stiffness_Nm_per_urad", "[ka, kb, kc]", softest_Nm_per_urad)};
  for (Key& key : turn_fields().keys()) keys.push_back(std::move(key));
  keys.push_back(key_of_numbers(
      "matrix", 36,
      "instead of stiffnesses: the compliance row by row, rows EX EY EZ EA EB EC in mm and rad, "
      "columns FX FY FZ MX MY MZ in N and N mm; symmetric, without negative eigenvalue"));
  return Fields<Compliance>(Compliance::Zero())
      .custom(
          std::move(keys), [](TableReader& reader, Compliance& C) { C = read_stiffness(reader); },
          [](const Compliance& C, Node::Table& table) {
            if (!C.isZero(0.0)) put_numbers(table, "matrix", C.reshaped<Eigen::RowMajor>(), 1.0);
          });
}

const Fields<Compliance>& stiffness_fields() {
  static const Fields<Compliance> fields = made_stiffness_fields();
  return fields;
}

void read_joint_stiffness(TableReader& compliance, const MachineDescription& machine,
                          ComplianceErrors& errors) {
  const Node* section = compliance.section("axis");
  if (!section) return;
  TableReader reader(*section, compliance.name_of("axis"), compliance.faults());
  for (const kinematics::Joint& joint : machine.joints) {
    const char letter = joint.name == 's' ? 'S' : joint.name;
    const std::string key(1, letter);
    const Node* node = reader.section(key);
    if (node)
      errors.joints.push_back(
          {letter, stiffness_fields().read_table(*node, reader.name_of(key), reader.faults())});
  }
  if (!machine.joints.empty()) reader.close();
}

Fields<ComplianceErrors> joints_fields(const MachineDescription& machine) {
  Key one = key_of("<axis>", Key::Kind::Table,
                   "at the point of the axis, along the axes of its deviations; S is the spindle",
                   stiffness_fields().keys());
  one.pattern = "[A-Z]";
  const Key axis = key_of(KeyName("axis").otherwise("stiff"), Key::Kind::Table,
                          "stiffness of the carriages", {one});
  return Fields<ComplianceErrors>().custom(
      {axis},
      [machine](TableReader& reader, ComplianceErrors& errors) {
        read_joint_stiffness(reader, machine, errors);
      },
      [](const ComplianceErrors& errors, Node::Table& table) {
        Node::Table joints;
        for (const errors::JointCompliance& joint : errors.joints)
          put(joints, std::string(1, joint.axis), stiffness_fields().written(joint.C));
        if (!joints.empty()) put(table, "axis", std::move(joints));
      });
}

Fields<CantileverSection> section_fields() {
  return Fields<CantileverSection>()
      .number(must("length_mm"), &CantileverSection::length, positive, "along the tool")
      .number(must("diameter_mm"), &CantileverSection::diameter, bar_diameter,
              "of a fluted piece its effective one")
      .number(must("youngs_modulus_GPa"), &CantileverSection::youngs_modulus, positive,
              "of the material")
      .number("poisson_ratio", &CantileverSection::poisson_ratio, poisson_range, "of the material");
}

void read_tool_compliance(TableReader& compliance, ComplianceErrors& errors) {
  const Node* section = compliance.section("tool");
  if (!section) return;
  TableReader reader(*section, compliance.name_of("tool"), compliance.faults());
  const std::size_t before = reader.faults().list().size();
  errors.tool = stiffness_fields().read(reader);
  std::vector<CantileverSection> pieces;
  for (const Node* node : reader.tables("section"))
    pieces.push_back(
        section_fields().read_table(*node, reader.name_of("section"), reader.faults()));
  reader.close();
  if (pieces.empty() || reader.faults().list().size() != before) return;
  try {
    errors.tool += errors::stepped_cantilever(pieces);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("section", "sections that can be", fault.what());
  }
}

Fields<ComplianceErrors> tool_compliance_fields() {
  std::vector<Key> keys = stiffness_fields().keys();
  keys.push_back(key_of("section", Key::Kind::Tables,
                        "round pieces from the tip to the clamp, which add to the stiffness",
                        section_fields().keys()));
  const Key tool = key_of(KeyName("tool").otherwise("stiff"), Key::Kind::Table,
                          "from the nose of the spindle to the tip, at the tip in the tool's frame",
                          std::move(keys));
  return Fields<ComplianceErrors>().custom(
      {tool}, read_tool_compliance, [](const ComplianceErrors& errors, Node::Table& table) {
        Node::Table own = stiffness_fields().written(errors.tool);
        if (!own.empty()) put(table, "tool", std::move(own));
      });
}

/// Each mass is bound alone, so that a refusal is reported where it stands.
void check_mass(TableReader& mass, const MovingMass& read, const MachineDescription& machine) {
  if (machine.joints.empty()) return;
  std::optional<kinematics::Chain> chain;
  try {
    chain.emplace(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument&) {
    return;  // reported with the machine
  }
  try {
    ComplianceErrors alone;
    alone.masses = {read};
    errors::bind(alone, *chain);
  } catch (const std::invalid_argument& fault) {
    mass.refuse("axis", "a carriage of the machine, \"t\" or \"w\"", fault.what());
  }
}

Fields<MovingMass> mass_fields() {
  const Key axis = key_of(must("axis"), Key::Kind::Text,
                          "letter of the axis that carries it, \"S\" the spindle, \"t\" the tool "
                          "or \"w\" the part");
  return Fields<MovingMass>()
      .remark("name", "of the mass")
      .custom(
          {axis},
          [](TableReader& reader, MovingMass& mass) {
            const std::string letter = reader.text("axis");
            if (!letter.empty()) mass.axis = letter.front();
          },
          [](const MovingMass& mass, Node::Table& table) {
            put(table, "axis", std::string(1, mass.axis));
          })
      .number(must("mass_kg"), &MovingMass::mass_kg, non_negative, "as a point")
      .vector(must("centre_mm"), &MovingMass::centre_b, "in the bed frame, axes at zero");
}

void read_masses(TableReader& compliance, const MachineDescription& machine,
                 ComplianceErrors& errors) {
  for (const Node* node : compliance.tables("mass")) {
    TableReader reader(*node, compliance.name_of("mass"), compliance.faults());
    const std::size_t before = reader.faults().list().size();
    const MovingMass mass = mass_fields().read(reader);
    reader.close();
    if (reader.faults().list().size() != before) continue;
    if (const std::string axis = reader.text("axis", ""); axis.size() != 1) {
      reader.refuse("axis", "one letter", axis);
      continue;
    }
    check_mass(reader, mass, machine);
    errors.masses.push_back(mass);
  }
}

Fields<ComplianceErrors> masses_fields(const MachineDescription& machine) {
  return Fields<ComplianceErrors>().custom(
      {key_of("mass", Key::Kind::Tables, "moving masses, for gravity and inertia",
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
      .custom(
          {key_of_numbers(KeyName("gravity").otherwise("off"), 3,
                          "direction of 9806.65 mm/s² in the bed frame, such as [0, 0, -1]")},
          [](TableReader& reader, ComplianceErrors& errors) {
            if (reader.know("gravity"))
              errors.gravity_b = standard_gravity * reader.direction("gravity");
          },
          [](const ComplianceErrors& errors, Node::Table& table) {
            if (errors.gravity_b)
              put_numbers(table, "gravity", *errors.gravity_b, standard_gravity);
          })
      .boolean("inertia", &ComplianceErrors::inertia,
               "the masses push against their acceleration, without terms in speed squared");
}

Fields<Wrench> clamping_fields() {
  Fields<Wrench> fields(Wrench::Zero());
  const std::array keys{"FX_N", "FY_N", "FZ_N", "MX_Nm", "MY_Nm", "MZ_Nm"};
  for (int i = 0; i < 6; ++i)
    fields.number(
        keys[std::size_t(i)], [i](auto& wrench) -> auto& { return wrench[i]; }, any_number,
        i < 3 ? "force" : "moment");
  return fields;
}

Fields<ComplianceErrors> compliance_fields(const MachineDescription& machine) {
  return Fields<ComplianceErrors>()
      .remark("name", "of what gives way")
      .number("scale", &ComplianceErrors::scale, {0.0, 1e6}, "factor of every compliance")
      .all_of(itself, joints_fields(machine))
      .all_of(itself, tool_compliance_fields())
      .table(KeyName("fixture").otherwise("stiff"), &ComplianceErrors::fixture, stiffness_fields(),
             "of the part on its carriage, at the origin of the workpiece frame")
      .all_of(itself, workpiece_fields())
      .all_of(itself, masses_fields(machine))
      .all_of(itself, gravity_fields())
      .table("clamping", &ComplianceErrors::clamping_w, clamping_fields(),
             "wrench on the part at the origin of the workpiece frame, which bears on the fixture "
             "alone");
}

}  // namespace

ComplianceErrors read_compliance(const Node& table, const MachineDescription& machine,
                                 Faults& faults) {
  return compliance_fields(machine).read_table(table, "compliance", faults);
}

Node::Table written_compliance(const ComplianceErrors& errors, const MachineDescription& machine) {
  return compliance_fields(machine).written(errors);
}

std::vector<Key> compliance_keys() { return compliance_fields({}).keys(); }

}  // namespace abbe::sim
