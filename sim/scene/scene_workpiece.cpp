#include "sim/scene/scene_workpiece.h"

#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "kinematics/units.h"

#if ABBE_RENDER
#include "render/read_vtu.h"
#endif

namespace abbe::sim {

namespace {

using errors::WorkpieceBar;
using errors::WorkpieceCompliance;
using errors::WorkpieceField;
using errors::WorkpiecePlate;

void read_second_moment(TableReader& reader, WorkpieceBar& bar) {
  const auto diameter = reader.maybe_number("diameter_mm", bar_diameter);
  const auto second_moment = reader.maybe_number("second_moment_mm4", positive);
  if (diameter && second_moment) {
    reader.refuse("second_moment_mm4", "diameter_mm or second_moment_mm4", "both");
  } else if (!reader.has("diameter_mm") && !reader.has("second_moment_mm4")) {
    reader.missing("diameter_mm", "a number, or second_moment_mm4,");
  }
  bar.second_moment = second_moment.value_or(pi * std::pow(diameter.value_or(0.0), 4) / 64.0);
}

Fields<WorkpieceBar> bar_fields() {
  Key diameter =
      key_of(KeyName("diameter_mm").one_of("section"), Key::Kind::Number, "of a round bar");
  Key second_moment = key_of(KeyName("second_moment_mm4").one_of("section"), Key::Kind::Number,
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

WorkpieceField read_vtu_field([[maybe_unused]] const std::filesystem::path& file) {
#if ABBE_RENDER
  render::PointTensors read = render::read_vtu(file, "compliance_um_per_N");
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
    field.file = file.string();
  } catch (const BadInput& fault) {
    if (fault.line == 0) {
      reader.refuse("file", fault.expected, file.string() + ": " + fault.seen);
    } else {
      reader.faults().add(fault);
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

/// The key whose word or number is to blame for a part that cannot be.
const char* key_to_blame(const WorkpieceCompliance& part) {
  if (std::holds_alternative<WorkpieceField>(part)) return "file";
  return std::holds_alternative<WorkpiecePlate>(part) ? "normal" : "kind";
}

void read_workpiece_stiffness(TableReader& compliance, errors::ComplianceErrors& errors) {
  const Node* section = compliance.section("workpiece");
  if (!section) return;
  TableReader reader(*section, compliance.name_of("workpiece"), compliance.faults());
  const std::size_t before = reader.faults().list().size();
  WorkpieceCompliance part = kind_fields().read(reader);
  reader.close();
  if (reader.faults().list().size() != before) return;
  try {
    errors::validate(part);
    errors.workpiece = std::move(part);
  } catch (const std::invalid_argument& fault) {
    reader.refuse(key_to_blame(part), "a workpiece that can be", fault.what());
  }
}

}  // namespace

Fields<errors::ComplianceErrors> workpiece_fields() {
  return Fields<errors::ComplianceErrors>().custom(
      {key_of(KeyName("workpiece").otherwise("stiff"), Key::Kind::Table,
              "the part where it is touched, in the workpiece frame", kind_fields().keys())},
      read_workpiece_stiffness, [](const errors::ComplianceErrors& errors, Node::Table& table) {
        if (errors.workpiece) put(table, "workpiece", kind_fields().written(*errors.workpiece));
      });
}

}  // namespace abbe::sim
