#include "sim/scene/compliance.h"

#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

#include "errors/compliance.h"
#include "kinematics/units.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

#if ABBE_RENDER
#include "render/vtk_reader.h"
#endif

namespace abbe::sim {

inline constexpr Range poisson_range{-1.0, 0.5, true, false};
inline constexpr Range bar_diameter{1e-3, 1e5};  // mm

/// Returns the fields of `[compliance.workpiece]`: how the part gives way where the tool touches
/// it.
Fields<errors::ComplianceErrors> workpiece_fields();

namespace {

using errors::WorkpieceBar;
using errors::WorkpieceCompliance;
using errors::WorkpieceField;
using errors::WorkpiecePlate;

void read_second_moment(TableReader& reader, WorkpieceBar& bar) {
  const auto diameter = reader.maybe_number("diameter_mm", bar_diameter);
  const auto second_moment = reader.maybe_number("second_moment_mm4", positive);
  // Each key determines the bending stiffness, so two of them could contradict each other.
  if (diameter && second_moment) {
    reader.refuse("second_moment_mm4", "diameter_mm or second_moment_mm4", "both");
  } else if (!reader.has("diameter_mm") && !reader.has("second_moment_mm4")) {
    reader.missing("diameter_mm", "a number, or second_moment_mm4,");
  }
  // A solid round section has pi d^4 / 64.
  bar.second_moment = second_moment.value_or(pi * std::pow(diameter.value_or(0.0), 4) / 64.0);
}

Fields<WorkpieceBar> bar_fields() {
  Key diameter =
      make_key(KeyName("diameter_mm").one_of("section"), Key::Kind::Number, "of a round bar");
  Key second_moment =
      make_key(KeyName("second_moment_mm4").one_of("section"), Key::Kind::Number,
               "in mm⁴, of a bar that is not round, the same about both axes across");
  diameter.range = bar_diameter;
  second_moment.range = positive;
  return Fields<WorkpieceBar>()
      .vector("clamp_mm", &WorkpieceBar::clamp_w, "centre of the clamped end")
      .direction("direction", &WorkpieceBar::direction_w, "from the clamp outwards")
      .number(must("length_mm"), &WorkpieceBar::length, positive, "from the clamp to the free end")
      .number(must("youngs_modulus_GPa"), &WorkpieceBar::youngs_modulus, positive,
              "of the material")
      .custom({diameter, second_moment}, read_second_moment,
              [](const WorkpieceBar& bar, Node::Table& table) {
                put(table, "second_moment_mm4", bar.second_moment);
              });
}

Fields<WorkpiecePlate> plate_fields() {
  return Fields<WorkpiecePlate>()
      .vector("foot_mm", &WorkpiecePlate::foot_w, "a point of the foot")
      .direction("up", &WorkpiecePlate::up_w, "from the foot to the free edge, square to `normal`")
      .direction(must("normal"), &WorkpiecePlate::normal_w, "across the wall")
      .number(must("height_mm"), &WorkpiecePlate::height, positive, "from the foot upwards")
      .number(must("thickness_mm"), &WorkpiecePlate::thickness, positive, "of the wall")
      .number(must("youngs_modulus_GPa"), &WorkpiecePlate::youngs_modulus, positive,
              "of the material")
      .number("poisson_ratio", &WorkpiecePlate::poisson_ratio, poisson_range, "of the material");
}

WorkpieceField read_csv_field(const std::filesystem::path& file) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(file, failure))
    throw BadInput(file.string(), 0, 0, "a file that can be read", "no such file");
  // The size is checked first, so that a wrong file cannot fill the memory.
  const std::uintmax_t size = std::filesystem::file_size(file, failure);
  if (failure || size > errors::max_field_bytes)
    throw BadInput(file.string(), 0, 0, "at most 64 MiB", std::to_string(size) + " bytes");
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  // Without this check a read error in the middle would silently truncate the field.
  if (!in)
    throw BadInput(file.string(), 0, 0, "a file that can be read", "a failure while reading");
  return errors::read_compliance_field(text.view(), file.string());
}

WorkpieceField read_vtu_field([[maybe_unused]] const std::filesystem::path& file) {
#if ABBE_RENDER
  render::PointTensors read = render::read_vtu(file, "compliance_um_per_N");
  // um/N in the file, mm/N in the models.
  for (Eigen::Matrix3d& C : read.tensors) C *= units::um;
  return {std::move(read.points), std::move(read.tensors)};
#else
  throw BadInput(file.string(), 0, 0, "a program built with -DABBE_RENDER=ON, or a .csv file",
                 "one without VTK");
#endif
}

void read_field(TableReader& reader, WorkpieceField& field) {
  const std::filesystem::path file = field.file;
  if (file.empty()) return;
  try {
    if (file.extension() == ".csv")
      field = read_csv_field(file);
    else if (file.extension() == ".vtu")
      field = read_vtu_field(file);
    else
      reader.refuse("file", "a field named .csv or .vtu", file.string());
    // The readers return a new field without its file name.
    field.file = file.string();
  } catch (const BadInput& fault) {
    // An error without a line concerns the file itself and is reported at its key in the scene.
    if (fault.line == 0) {
      reader.refuse("file", fault.expected, file.string() + ": " + fault.seen);
    } else {
      reader.input_errors().add(fault);
    }
  }
}

Fields<WorkpieceField> field_fields() {
  return Fields<WorkpieceField>()
      .text(must("file"), &WorkpieceField::file,
            "the nodes of the surface from a finite-element program, each with its displacement "
            "per force there, .csv or .vtu")
      .check(read_field);
}

const Fields<WorkpieceCompliance>& kind_fields() {
  static const Fields<WorkpieceCompliance> fields = Fields<WorkpieceCompliance>().kinds(
      must("kind"), itself,
      {alternative<WorkpieceCompliance>("bar", bar_fields(), "cantilever, gives way across itself"),
       alternative<WorkpieceCompliance>(
           "plate", plate_fields(), "endless wall clamped along its foot, gives way across itself"),
       alternative<WorkpieceCompliance>("field", field_fields(),
                                        "as a finite-element program computed it")},
      "of part");
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
  TableReader reader(*section, compliance.name_of("workpiece"), compliance.input_errors());
  const std::size_t before = reader.input_errors().list().size();
  WorkpieceCompliance part = kind_fields().read(reader);
  reader.close();
  // A part that could not be read completely would cause misleading errors.
  if (reader.input_errors().list().size() != before) return;
  try {
    // Checked by the module of the models, so that a scene accepts exactly what they accept.
    errors::validate(part);
    errors.workpiece = std::move(part);
  } catch (const std::invalid_argument& fault) {
    reader.refuse(offending_key(part), "a workpiece that can be", fault.what());
  }
}

}  // namespace

Fields<errors::ComplianceErrors> workpiece_fields() {
  return Fields<errors::ComplianceErrors>().custom(
      {make_key(KeyName("workpiece").otherwise("stiff"), Key::Kind::Table,
                "the part where it is touched, in the workpiece frame", kind_fields().keys())},
      read_workpiece_stiffness, [](const errors::ComplianceErrors& errors, Node::Table& table) {
        if (errors.workpiece) put(table, "workpiece", kind_fields().written(*errors.workpiece));
      });
}

namespace {

using errors::CantileverSection;
using errors::Compliance;
using errors::ComplianceErrors;
using errors::MovingMass;
using kinematics::Wrench;

constexpr double standard_gravity = 9806.65;  // mm/s^2
constexpr double min_stiffness_N_per_um = 1e-6;
constexpr double min_stiffness_Nm_per_urad = 1e-9;
constexpr double max_softness = 1e3;  // largest entry of a matrix, mm/N (which is 1e-6 N/um) or
                                      // rad/(N mm)

/// Returns the compliances 1/k of three stiffnesses; zero, i.e. stiff, if the key is missing.
/// @param least  smallest stiffness, in the unit of the key
Eigen::Vector3d softness(TableReader& reader, const std::string& key, double least) {
  Eigen::Vector3d c = Eigen::Vector3d::Zero();
  const auto k = reader.numbers_as_written(key, 3);
  if (!k) return c;
  // Checked before the inversion, since a stiffness near zero would give an unbounded compliance.
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
  // Rejects matrices in a wrong unit with a clearer message than their eigenvalues would give.
  if (numbers->cwiseAbs().maxCoeff() > max_softness) {
    reader.refuse("matrix", fmt::format("entries of at most {} for matrix", max_softness),
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

/// Reads a compliance, stated either by `stiffness_N_per_um` and `turning_stiffness_Nm_per_urad`
/// along axes turned by `turn_deg`, or by `matrix`.
Compliance read_stiffness(TableReader& reader) {
  const Eigen::Vector3d linear = softness(reader, "stiffness_N_per_um", min_stiffness_N_per_um);
  const Eigen::Vector3d angular =
      softness(reader, "turning_stiffness_Nm_per_urad", min_stiffness_Nm_per_urad);
  const bool by_numbers =
      reader.has("stiffness_N_per_um") || reader.has("turning_stiffness_Nm_per_urad");
  if (by_numbers && reader.has("matrix"))
    reader.refuse("matrix", "stiffnesses or a matrix", "both");
  // `turn_deg` has no effect on a matrix, which is stated in the frame of the element.
  if (reader.has("turn_deg") && !by_numbers)
    reader.refuse("turn_deg", "stiffnesses that it turns", "none");
  const Eigen::Matrix3d R = read_turn(reader);
  Compliance C = Compliance::Zero();
  // From the turned axes, along which the stiffnesses act, into the frame of the element.
  C.topLeftCorner<3, 3>() = R * linear.asDiagonal() * R.transpose();
  C.bottomRightCorner<3, 3>() = R * angular.asDiagonal() * R.transpose();
  return C + read_matrix(reader);
}

/// Returns the fields of one compliant element, which is always written as its matrix.
Fields<Compliance> element_stiffness_fields() {
  const auto stiffness = [](const char* name, const char* letters, double least) {
    return make_numbers_key(name, 3, fmt::format("{}, each at least {}", letters, least).c_str());
  };
  std::vector<Key> keys{
      stiffness("stiffness_N_per_um", "[kx, ky, kz]", min_stiffness_N_per_um),
      stiffness("turning_stiffness_Nm_per_urad", "[ka, kb, kc]", min_stiffness_Nm_per_urad)};
  for (Key& key : turn_fields().keys()) keys.push_back(std::move(key));
  keys.push_back(make_numbers_key(
      "matrix", 36,
      "instead of stiffnesses: the compliance row by row, rows EX EY EZ EA EB EC in mm and rad, "
      "columns FX FY FZ MX MY MZ in N and N mm; symmetric, without negative eigenvalue"));
  return Fields<Compliance>(Compliance::Zero())
      .custom(
          std::move(keys), [](TableReader& reader, Compliance& C) { C = read_stiffness(reader); },
          [](const Compliance& C, Node::Table& table) {
            // Stiff is the default and need not be written.
            if (!C.isZero(0.0)) put_numbers(table, "matrix", C.reshaped<Eigen::RowMajor>(), 1.0);
          });
}

const Fields<Compliance>& stiffness_fields() {
  static const Fields<Compliance> fields = element_stiffness_fields();
  return fields;
}

void read_joint_stiffness(TableReader& compliance, const MachineDescription& machine,
                          ComplianceErrors& errors) {
  const Node* section = compliance.section("axis");
  if (!section) return;
  TableReader reader(*section, compliance.name_of("axis"), compliance.input_errors());
  for (const kinematics::Joint& joint : machine.joints) {
    // The chain names the spindle nose 's'; scenes name all axes in capitals.
    const char letter = joint.name == 's' ? 'S' : joint.name;
    const std::string key(1, letter);
    const Node* node = reader.section(key);
    if (node)
      errors.joints.push_back({letter, stiffness_fields().read_table(*node, reader.name_of(key),
                                                                     reader.input_errors())});
  }
  // Reports unknown keys. Without joints, i.e. if the machine could not be read, every axis would
  // look unknown.
  if (!machine.joints.empty()) reader.close();
}

Fields<ComplianceErrors> joints_fields(const MachineDescription& machine) {
  Key one = make_key("<axis>", Key::Kind::Table,
                     "at the point of the axis, along the axes of its deviations; S is the spindle",
                     stiffness_fields().keys());
  one.pattern = "[A-Z]";
  const Key axis = make_key(KeyName("axis").otherwise("stiff"), Key::Kind::Table,
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
  TableReader reader(*section, compliance.name_of("tool"), compliance.input_errors());
  const std::size_t before = reader.input_errors().list().size();
  errors.tool = stiffness_fields().read(reader);
  std::vector<CantileverSection> pieces;
  for (const Node* node : reader.tables("section"))
    pieces.push_back(
        section_fields().read_table(*node, reader.name_of("section"), reader.input_errors()));
  reader.close();
  // If a section could not be read, the compliance of the others would be wrong.
  if (pieces.empty() || reader.input_errors().list().size() != before) return;
  try {
    // Compliances add, because the sections and the stated stiffness are in series between nose and
    // tip.
    errors.tool += errors::stepped_cantilever(pieces);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("section", "sections that can be", fault.what());
  }
}

Fields<ComplianceErrors> tool_compliance_fields() {
  std::vector<Key> keys = stiffness_fields().keys();
  keys.push_back(make_key("section", Key::Kind::Tables,
                          "round pieces from the tip to the clamp, which add to the stiffness",
                          section_fields().keys()));
  const Key tool = make_key(
      KeyName("tool").otherwise("stiff"), Key::Kind::Table,
      "from the nose of the spindle to the tip, at the tip in the tool's frame", std::move(keys));
  return Fields<ComplianceErrors>().custom(
      {tool}, read_tool_compliance, [](const ComplianceErrors& errors, Node::Table& table) {
        // Stiffness and sections are written as one matrix.
        Node::Table own = stiffness_fields().written(errors.tool);
        if (!own.empty()) put(table, "tool", std::move(own));
      });
}

/// Binds a mass by itself, so that an error is reported at its own position.
void check_mass(TableReader& mass, const MovingMass& read, const MachineDescription& machine) {
  if (machine.joints.empty()) return;
  std::optional<kinematics::Chain> chain;
  try {
    chain.emplace(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument&) {
    return;  // the machine is invalid, which is reported elsewhere
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
  const Key axis = make_key(must("axis"), Key::Kind::Text,
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
    TableReader reader(*node, compliance.name_of("mass"), compliance.input_errors());
    const std::size_t before = reader.input_errors().list().size();
    const MovingMass mass = mass_fields().read(reader);
    reader.close();
    if (reader.input_errors().list().size() != before) continue;
    // The field keeps only the first letter, so the length of the text is checked here.
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
      .custom(
          {make_numbers_key(KeyName("gravity").otherwise("off"), 3,
                            "direction of 9806.65 mm/s² in the bed frame, such as [0, 0, -1]")},
          [](TableReader& reader, ComplianceErrors& errors) {
            // The key is optional: without it gravity stays off. direction() would require it.
            if (reader.accept_key("gravity"))
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
  // The six keys set the components of one vector, so each has an accessor with its index.
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
                                 InputErrors& input_errors) {
  return compliance_fields(machine).read_table(table, "compliance", input_errors);
}

Node::Table written_compliance(const ComplianceErrors& errors, const MachineDescription& machine) {
  return compliance_fields(machine).written(errors);
}

std::vector<Key> compliance_keys() { return compliance_fields({}).keys(); }

}  // namespace abbe::sim
