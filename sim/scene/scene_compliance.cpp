#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/scene_sections.h"

#if ABBE_RENDER
#include "render/read_vtu.h"
#endif

namespace abbe::sim {

namespace {

using errors::Compliance;

constexpr double standard_gravity = 9806.65;  // mm/s^2
constexpr Range poisson{-1.0, 0.5, true, false};
constexpr Range thickness{1e-3, 1e5, false, false};  // mm
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

std::vector<errors::JointCompliance> read_joints(TableReader& compliance,
                                                 const MachineDescription& machine) {
  std::vector<errors::JointCompliance> joints;
  const Node* section = compliance.section("axis");
  if (!section) return joints;
  TableReader reader(*section, "compliance.axis", compliance.faults());
  for (const kinematics::Joint& joint : machine.joints) {
    const char letter = joint.name == 's' ? 'S' : joint.name;
    const std::string key(1, letter);
    const Node* node = reader.section(key);
    if (!node) continue;
    TableReader axis(*node, "compliance.axis." + key, compliance.faults());
    joints.push_back({letter, read_stiffness(axis)});
    axis.close();
  }
  if (!machine.joints.empty()) reader.close();
  return joints;
}

Compliance read_tool_compliance(TableReader& compliance) {
  const Node* section = compliance.section("tool");
  if (!section) return Compliance::Zero();
  TableReader reader(*section, "compliance.tool", compliance.faults());
  const std::size_t before = reader.faults().list().size();
  Compliance C = read_stiffness(reader);
  std::vector<errors::CantileverSection> pieces;
  for (const Node* node : reader.tables("section")) {
    TableReader piece(*node, "compliance.tool.section", reader.faults());
    pieces.push_back({piece.number("length_mm", positive), piece.number("diameter_mm", thickness),
                      piece.number("youngs_modulus_GPa", positive),
                      piece.number("poisson_ratio", poisson, 0.3)});
    piece.close();
  }
  reader.close();
  if (pieces.empty() || reader.faults().list().size() != before) return C;
  try {
    C += errors::stepped_cantilever(pieces);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("section", "sections that can be", fault.what());
  }
  return C;
}

Compliance read_fixture(TableReader& compliance) {
  const Node* section = compliance.section("fixture");
  if (!section) return Compliance::Zero();
  TableReader reader(*section, "compliance.fixture", compliance.faults());
  const Compliance C = read_stiffness(reader);
  reader.close();
  return C;
}

errors::WorkpieceBar read_bar(TableReader& reader) {
  errors::WorkpieceBar bar;
  bar.clamp_w = reader.vector("clamp_mm", Eigen::Vector3d::Zero());
  bar.direction_w = reader.direction("direction", Eigen::Vector3d::UnitZ());
  bar.length = reader.number("length_mm", positive);
  bar.youngs_modulus = reader.number("youngs_modulus_GPa", positive);
  const auto diameter = reader.maybe_number("diameter_mm", thickness);
  const auto second_moment = reader.maybe_number("second_moment_mm4", positive);
  if (diameter && second_moment) {
    reader.refuse("second_moment_mm4", "diameter_mm or second_moment_mm4", "both");
  } else if (!reader.has("diameter_mm") && !reader.has("second_moment_mm4")) {
    reader.missing("diameter_mm", "a number, or second_moment_mm4,");
  }
  bar.second_moment = second_moment.value_or(pi * std::pow(diameter.value_or(0.0), 4) / 64.0);
  return bar;
}

errors::WorkpiecePlate read_plate(TableReader& reader) {
  errors::WorkpiecePlate plate;
  plate.foot_w = reader.vector("foot_mm", Eigen::Vector3d::Zero());
  plate.up_w = reader.direction("up", Eigen::Vector3d::UnitZ());
  plate.normal_w = reader.direction("normal");
  plate.height = reader.number("height_mm", positive);
  plate.thickness = reader.number("thickness_mm", positive);
  plate.youngs_modulus = reader.number("youngs_modulus_GPa", positive);
  plate.poisson_ratio = reader.number("poisson_ratio", poisson, 0.33);
  return plate;
}

errors::WorkpieceField read_csv_field(const std::filesystem::path& file) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(file, failure))
    throw BadInput(file.string(), 0, 0, "a file that can be read", "no such file");
  const std::uintmax_t size = std::filesystem::file_size(file, failure);
  if (failure || size > errors::max_field_bytes)
    throw BadInput(file.string(), 0, 0, "at most 64 MiB", std::to_string(size) + " bytes");
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in)
    throw BadInput(file.string(), 0, 0, "a file that can be read", "a failure while reading");
  return errors::read_compliance_field(text.view(), file.string());
}

errors::WorkpieceField read_vtu_field([[maybe_unused]] const std::filesystem::path& file) {
#if ABBE_RENDER
  render::PointTensors read = render::read_vtu(file, "compliance_um_per_N");
  for (Eigen::Matrix3d& C : read.tensors) C *= units::um;
  return {std::move(read.points), std::move(read.tensors)};
#else
  throw BadInput(file.string(), 0, 0, "a program built with -DABBE_RENDER=ON, or a .csv file",
                 "one without VTK");
#endif
}

errors::WorkpieceField read_field(TableReader& reader) {
  const std::filesystem::path file = reader.text("file");
  if (file.empty()) return {};
  try {
    if (file.extension() == ".csv") return read_csv_field(file);
    if (file.extension() == ".vtu") return read_vtu_field(file);
    reader.refuse("file", "a field named .csv or .vtu", file.string());
  } catch (const BadInput& fault) {
    if (fault.line == 0) {
      reader.refuse("file", fault.expected, file.string() + ": " + fault.seen);
    } else {
      reader.faults().add(fault);
    }
  }
  return {};
}

std::optional<errors::WorkpieceCompliance> read_workpiece(TableReader& compliance) {
  const Node* section = compliance.section("workpiece");
  if (!section) return std::nullopt;
  TableReader reader(*section, "compliance.workpiece", compliance.faults());
  const std::size_t before = reader.faults().list().size();
  enum class Kind { Bar, Plate, Field };
  const Kind kind = reader.choice<Kind>(
      "kind", {{"bar", Kind::Bar}, {"plate", Kind::Plate}, {"field", Kind::Field}});
  errors::WorkpieceCompliance part;
  if (kind == Kind::Bar) part = read_bar(reader);
  if (kind == Kind::Plate) part = read_plate(reader);
  if (kind == Kind::Field) part = read_field(reader);
  reader.close();
  if (reader.faults().list().size() != before) return std::nullopt;
  try {
    errors::validate(part);
  } catch (const std::invalid_argument& fault) {
    reader.refuse(kind == Kind::Field   ? "file"
                  : kind == Kind::Plate ? "normal"
                                        : "kind",
                  "a workpiece that can be", fault.what());
    return std::nullopt;
  }
  return part;
}

/// Each mass is bound alone, so that a refusal is reported where it stands.
void check_mass(TableReader& mass, const errors::MovingMass& read,
                const MachineDescription& machine) {
  if (machine.joints.empty()) return;
  std::optional<kinematics::Chain> chain;
  try {
    chain.emplace(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument&) {
    return;  // reported with the machine
  }
  try {
    errors::ComplianceErrors alone;
    alone.masses = {read};
    errors::bind(alone, *chain);
  } catch (const std::invalid_argument& fault) {
    mass.refuse("axis", "a carriage of the machine, \"t\" or \"w\"", fault.what());
  }
}

std::vector<errors::MovingMass> read_masses(TableReader& compliance,
                                            const MachineDescription& machine) {
  std::vector<errors::MovingMass> masses;
  for (const Node* node : compliance.tables("mass")) {
    TableReader reader(*node, "compliance.mass", compliance.faults());
    const std::size_t before = reader.faults().list().size();
    errors::MovingMass mass;
    reader.text("name", "");
    const std::string axis = reader.text("axis");
    mass.mass_kg = reader.number("mass_kg", non_negative);
    mass.centre_b = reader.vector("centre_mm");
    reader.close();
    if (reader.faults().list().size() != before) continue;
    if (axis.size() != 1) {
      reader.refuse("axis", "one letter", axis);
      continue;
    }
    mass.axis = axis.front();
    check_mass(reader, mass, machine);
    masses.push_back(mass);
  }
  return masses;
}

kinematics::Wrench read_clamping(TableReader& compliance) {
  kinematics::Wrench W = kinematics::Wrench::Zero();
  const Node* section = compliance.section("clamping");
  if (!section) return W;
  TableReader reader(*section, "compliance.clamping", compliance.faults());
  int i = 0;
  for (const char* key : {"FX_N", "FY_N", "FZ_N", "MX_Nm", "MY_Nm", "MZ_Nm"})
    W[i++] = reader.number(key, any_number, 0.0);
  reader.close();
  return W;
}

}  // namespace

errors::ComplianceErrors read_compliance(const Node& table, const MachineDescription& machine,
                                         Faults& faults) {
  TableReader reader(table, "compliance", faults);
  errors::ComplianceErrors errors;
  reader.text("name", "");
  errors.scale = reader.number("scale", {0.0, 1e6}, 1.0);
  errors.joints = read_joints(reader, machine);
  errors.tool = read_tool_compliance(reader);
  errors.fixture = read_fixture(reader);
  errors.workpiece = read_workpiece(reader);
  errors.masses = read_masses(reader, machine);
  if (reader.has("gravity")) errors.gravity_b = standard_gravity * reader.direction("gravity");
  errors.inertia = reader.boolean("inertia", false);
  errors.clamping_w = read_clamping(reader);
  reader.know("gravity");
  reader.close();
  return errors;
}

}  // namespace abbe::sim
