#include "sim/scene/cutting.h"

#include <string>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/bodies.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"

namespace abbe::sim {

const Fields<cutting::CuttingCoefficients>& material_fields() {
  using Coefficients = cutting::CuttingCoefficients;
  static const Fields<Coefficients> fields =
      Fields<Coefficients>()
          .text(required_key("name"), &Coefficients::name, "name of the material and the tool")
          .text(required_key("source"), &Coefficients::source, "source of the values")
          .number(required_key("K_tc_N_per_mm2"), &Coefficients::K_tc, positive,
                  "tangential force per chip area")
          .number(required_key("K_rc_N_per_mm2"), &Coefficients::K_rc, non_negative,
                  "radial force per chip area")
          .number(required_key("K_ac_N_per_mm2"), &Coefficients::K_ac, any_number,
                  "axial force per chip area")
          .number(required_key("K_te_N_per_mm"), &Coefficients::K_te, non_negative,
                  "tangential force per edge length")
          .number(required_key("K_re_N_per_mm"), &Coefficients::K_re, non_negative,
                  "radial force per edge length")
          .number(required_key("K_ae_N_per_mm"), &Coefficients::K_ae, any_number,
                  "axial force per edge length");
  return fields;
}

cutting::CuttingCoefficients read_material(const Node& table, InputErrors& input_errors) {
  return material_fields().read_table(table, "material", input_errors);
}

Node::Table material_to_table(const cutting::CuttingCoefficients& material) {
  return material_fields().to_table(material);
}

std::vector<Key> material_keys() { return material_fields().keys(); }

namespace {

constexpr Range helix_range{.min = -90.0, .max = 90.0, .open_min = true, .open_max = true};
constexpr Range run_out_range{0.0, 1000.0};

}  // namespace

const Fields<cutting::Flutes>& flutes_fields() {
  using cutting::Flutes;
  static const Flutes defaults{.helix = 30.0 * units::deg};
  static const Fields<Flutes> fields =
      Fields<Flutes>(defaults)
          // Reading starts from these defaults and not from those of `CuttingDescription`.
          .derive([](Flutes& flutes) { flutes = defaults; })
          .integer("flutes", &Flutes::count, 1, 100, "milling: number of flutes of the cutter")
          .number("helix_deg", &Flutes::helix, helix_range,
                  "milling: helix angle, + for right-hand")
          .number("run_out_um", &Flutes::run_out, run_out_range,
                  "milling: offset of the cutter axis from the spindle axis")
          .number("run_out_angle_deg", &Flutes::run_out_angle, any_number,
                  "milling: direction of that offset, counter-clockwise from the first flute")
          .choice("rotation", &Flutes::clockwise,
                  {{"clockwise", true, "M3, seen from the spindle"}, {"counter_clockwise", false}},
                  "milling: direction of rotation of the spindle");
  return fields;
}

namespace {

using cutting::BoxBlank;
using cutting::CylinderBlank;
using Blank = CuttingDescription::Blank;
using OffsetBlank = CuttingDescription::OffsetBlank;
using TurnedBlank = CuttingDescription::TurnedBlank;

enum class Operation { Milling, Turning };

constexpr int max_corners = 10000;
constexpr Range spacing_range{0.001, 20.0};
constexpr Range step_range{.min = 0.0, .max = 100.0, .open_min = true};

void check_box_corners(TableReader& reader, BoxBlank& box) {
  // A missing corner has already been reported; its default value must not be compared.
  if (!reader.has("lower_mm") || !reader.has("upper_mm")) return;
  for (int i = 0; i < 3; ++i) {
    if (box.lower_k[i] < box.upper_k[i]) continue;
    reader.report_invalid("upper_mm",
                          fmt::format("cutting.upper_mm above cutting.lower_mm in {}", "xyz"[i]),
                          fmt::format("{} and {}", box.upper_k[i], box.lower_k[i]));
    return;  // one message is enough for all three directions
  }
}

Fields<BoxBlank> box_fields() {
  return Fields<BoxBlank>()
      .vector(required_key("lower_mm"), &BoxBlank::lower_k, "corner with the smallest x, y and z")
      .vector(required_key("upper_mm"), &BoxBlank::upper_k, "corner with the largest x, y and z")
      .check(check_box_corners);
}

Fields<CylinderBlank> cylinder_fields() {
  return Fields<CylinderBlank>()
      .number(required_key("radius_mm"), &CylinderBlank::radius, positive, "radius about z")
      .number(required_key("lower_mm"), &CylinderBlank::lower, any_number, "z of the lower end")
      .number(required_key("upper_mm"), &CylinderBlank::upper, any_number, "z of the upper end")
      .check([](TableReader& reader, CylinderBlank& blank) {
        // A missing height has already been reported; its default value must not be compared.
        if (reader.has("lower_mm") && reader.has("upper_mm") && !(blank.lower < blank.upper))
          reader.report_invalid("upper_mm", "cutting.upper_mm above cutting.lower_mm",
                                fmt::format("{} and {}", blank.upper, blank.lower));
      });
}

Fields<OffsetBlank> offset_fields() {
  return Fields<OffsetBlank>()
      .number(required_key("allowance_mm"), &OffsetBlank::allowance, positive,
              "allowance along the normals of the design")
      .number(required_key("floor_mm"), &OffsetBlank::floor, any_number, "z of the lower end");
}

/// A corner of the profile of a turned blank.
struct ProfileCorner {
  double axial_position = 0.0;  ///< mm on the spindle line, from the origin of the part
  double radius = 0.0;          ///< mm
};

Fields<ProfileCorner> corner_fields() {
  return Fields<ProfileCorner>()
      .number(required_key("along_mm"), &ProfileCorner::axial_position, any_number,
              "z, not less than that of the previous corner; two corners at the same z make a step")
      .number(required_key("radius_mm"), &ProfileCorner::radius, non_negative,
              "distance from the spindle line");
}

/// Reads the profile of a turned blank, whose positions on the spindle line must not decrease.
void read_profile(TableReader& reader, TurnedBlank& blank) {
  if (!reader.has("profile")) reader.report_missing("profile", "a list of tables");
  const std::size_t error_count = reader.input_errors().list().size();
  const auto corners = reader.tables("profile");
  if (reader.has("profile") && (corners.size() < 2 || corners.size() > max_corners)) {
    reader.report_invalid("profile",
                          fmt::format("2 to {} corners for cutting.profile", max_corners),
                          fmt::format("{}", corners.size()));
    return;
  }
  blank.profile.resize(Eigen::Index(corners.size()), 2);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    TableReader corner_reader(*corners[i], reader.qualified_name("profile"), reader.input_errors());
    const ProfileCorner corner = corner_fields().read(corner_reader);
    const Eigen::Index k = Eigen::Index(i);
    blank.profile.row(k) << corner.axial_position, corner.radius;
    if (k > 0 && corner_reader.has("along_mm") && corner.axial_position < blank.profile(k - 1, 0)) {
      corner_reader.report_invalid(
          "along_mm",
          fmt::format("along_mm of at least {}, that of the previous corner",
                      blank.profile(k - 1, 0)),
          fmt::format("{}", corner.axial_position));
    }
    corner_reader.close();
  }
  const Eigen::Index last_row = blank.profile.rows() - 1;
  // A blank of zero length has no volume. Invalid corners have already been reported, so they are
  // not compared.
  if (last_row > 0 && reader.input_errors().list().size() == error_count &&
      !(blank.profile(last_row, 0) > blank.profile(0, 0))) {
    reader.report_invalid("profile", "corners at two or more positions for cutting.profile",
                          "one position");
  }
}

Fields<TurnedBlank> turned_fields() {
  const Key profile = make_key(required_key("profile"), Key::Kind::Tables,
                               fmt::format("corners of the profile, 2 to {}", max_corners).c_str(),
                               corner_fields().keys());
  return Fields<TurnedBlank>().custom_field(
      {profile}, read_profile, [](const TurnedBlank& blank, Node::Table& table) {
        std::vector<ProfileCorner> corners;
        for (const auto& row : blank.profile.rowwise()) corners.push_back({row[0], row[1]});
        put_tables(table, "profile", corners, corner_fields());
      });
}

/// Returns the fields of the blank. A turning tool requires a turned blank; a milling cutter does
/// not accept one.
Fields<CuttingDescription> blank_fields(Operation operation) {
  const Fields<CuttingDescription> blank = Fields<CuttingDescription>().variant(
      required_key("blank"), &CuttingDescription::blank,
      {alternative<Blank>("box", box_fields(), "along the axes of the part"),
       alternative<Blank>("cylinder", cylinder_fields(), "axis along z of the part"),
       alternative<Blank>("offset", offset_fields(), "the design, offset along its normals"),
       alternative<Blank>("mesh", mesh_file_fields(required_key("file")), "a closed mesh"),
       alternative<Blank>("turned", turned_fields(), "for turning tools only")},
      "blank, in the part frame");
  return Fields<CuttingDescription>().custom_field(
      blank.keys(),
      [blank, operation](TableReader& reader, CuttingDescription& cutting) {
        const std::size_t error_count = reader.input_errors().list().size();
        cutting = blank.read(reader, std::move(cutting));
        // An invalid blank has the default kind, which must not be compared with the tool.
        if (reader.input_errors().list().size() != error_count) return;
        const bool is_turning_tool = operation == Operation::Turning;
        const bool is_turned_blank = std::holds_alternative<TurnedBlank>(cutting.blank);
        if (is_turning_tool && !is_turned_blank)
          reader.report_invalid("blank", "\"turned\" for cutting.blank with a turning tool",
                                "a different kind");
        if (!is_turning_tool && is_turned_blank)
          reader.report_invalid("blank", "a cutting.blank for a milling cutter", "\"turned\"");
      },
      [blank](const CuttingDescription& cutting, Node::Table& table) {
        append_entries(table, blank.to_table(cutting));
      });
}

/// Returns the fields that only milling has: flutes, dexels and the step of the engagement.
Fields<CuttingDescription> milling_fields() {
  Key directions_key = make_key(KeyName("directions").with_fallback("3"), Key::Kind::Whole,
                                "milling: directions of dexels, 1 (along z of the part, if the "
                                "tool axis stays along it) or 3");
  directions_key.range = {1, 3};
  return Fields<CuttingDescription>()
      .custom_field(
          {directions_key},
          [](TableReader& reader, CuttingDescription& cutting) {
            const auto direction_count = reader.maybe_integer("directions", 1, 3);
            // Two directions would leave faces across the third unresolved.
            if (direction_count == 2)
              reader.report_invalid("directions", "1 or 3 for cutting.directions", "2");
            cutting.three_directions = direction_count != 1;
          },
          [](const CuttingDescription& cutting, Node::Table& table) {
            put_value(table, "directions", std::int64_t(cutting.three_directions ? 3 : 1));
          })
      .include_fields(&CuttingDescription::flutes, flutes_fields())
      .number("step_mm", &CuttingDescription::step, step_range,
              "milling: tip travel between two evaluations of the engagement; turning evaluates it "
              "once per revolution");
}

Fields<CuttingDescription> memory_fields() {
  constexpr std::int64_t max_MiB = std::int64_t(1) << 24;
  Key key = make_key(
      "max_MiB", Key::Kind::Whole,
      "milling: memory limit for dexels; a scene that needs more is rejected with the estimate");
  key.range = {1, double(max_MiB)};
  key.fallback = std::to_string(CuttingDescription{}.max_bytes >> 20);
  return Fields<CuttingDescription>().custom_field(
      {key},
      [](TableReader& reader, CuttingDescription& cutting) {
        if (const auto limit_MiB = reader.maybe_integer("max_MiB", 1, max_MiB))
          cutting.max_bytes = std::size_t(*limit_MiB) << 20;
      },
      [](const CuttingDescription& cutting, Node::Table& table) {
        put_value(table, "max_MiB", std::int64_t(cutting.max_bytes >> 20));
      });
}

Fields<CuttingDescription> make_cutting_fields(Operation operation) {
  // A turned blank is stored as a profile and not as dexels, so no memory limit applies to it.
  const auto has_dexels = [](const CuttingDescription& cutting) {
    return !std::holds_alternative<TurnedBlank>(cutting.blank);
  };
  Fields<CuttingDescription> fields = blank_fields(operation);
  fields.number("spacing_mm", &CuttingDescription::spacing, spacing_range,
                "spacing of dexels; for a turned blank, spacing along the spindle line");
  if (operation == Operation::Milling) fields.include_fields(whole_struct, milling_fields());
  return fields.only_if(has_dexels, memory_fields())
      .number("tolerance_nm", &CuttingDescription::tolerance, positive,
              "convergence tolerance of the deflection under the cutting force, at every step")
      .integer("most_iterations", &CuttingDescription::max_iterations, 1, 1000,
               "iterations per step, after which the step is reported as not converged")
      .number("rest_um", &CuttingDescription::rest, positive,
              "limit of residual material on the machined part; anything above it is reported as a "
              "finding in `summary.json`")
      .number("gouge_um", &CuttingDescription::gouge, positive,
              "limit of gouging (cutting below the design surface), reported in the same way");
}

const Fields<CuttingDescription>& cutting_fields(const ToolDescription& tool) {
  // Each list of fields is built once and kept, since this takes longer than reading a table.
  static const Fields<CuttingDescription> milling = make_cutting_fields(Operation::Milling),
                                          turning = make_cutting_fields(Operation::Turning);
  return std::holds_alternative<cutting::Nose>(tool.nominal) ? turning : milling;
}

}  // namespace

CuttingDescription read_cutting(const Node& table, const ToolDescription& tool,
                                InputErrors& input_errors) {
  return cutting_fields(tool).read_table(table, "cutting", input_errors);
}

Node::Table cutting_to_table(const CuttingDescription& cutting, const ToolDescription& tool) {
  return cutting_fields(tool).to_table(cutting);
}

// The keys of milling include those of turning.
std::vector<Key> cutting_keys() { return make_cutting_fields(Operation::Milling).keys(); }

}  // namespace abbe::sim
