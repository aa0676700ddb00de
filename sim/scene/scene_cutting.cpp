#include <filesystem>
#include <string>
#include <system_error>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/scene_sections.h"

namespace abbe::sim {

namespace {

constexpr Range helix_range{-90.0, 90.0, true, true};
constexpr int most_corners = 10000;
constexpr Range spacing_range{0.001, 20.0};
constexpr Range step_range{0.0, 100.0, true, false};
constexpr Range run_out_range{0.0, 1000.0};

void refuse_flat(TableReader& reader, const cutting::BoxBlank& box) {
  if (!reader.has("lower_mm") || !reader.has("upper_mm")) return;
  for (int i = 0; i < 3; ++i) {
    if (box.lower_k[i] < box.upper_k[i]) continue;
    reader.refuse("upper_mm",
                  fmt::format("cutting.upper_mm above cutting.lower_mm in {}", "xyz"[i]),
                  fmt::format("{} and {}", box.upper_k[i], box.lower_k[i]));
    return;
  }
}

cutting::CylinderBlank read_cylinder(TableReader& reader) {
  const cutting::CylinderBlank blank{reader.number("radius_mm", positive),
                                     reader.number("lower_mm", any_number),
                                     reader.number("upper_mm", any_number)};
  if (reader.has("lower_mm") && reader.has("upper_mm") && !(blank.lower < blank.upper)) {
    reader.refuse("upper_mm", "cutting.upper_mm above cutting.lower_mm",
                  fmt::format("{} and {}", blank.upper, blank.lower));
  }
  return blank;
}

/// Corners of the blank over the spindle line, which may step but not go back.
CuttingDescription::TurnedBlank read_turned(TableReader& reader) {
  CuttingDescription::TurnedBlank blank;
  if (!reader.has("profile")) reader.missing("profile", "a list of tables");
  const std::size_t before = reader.faults().list().size();
  const auto corners = reader.tables("profile");
  if (reader.has("profile") && (corners.size() < 2 || corners.size() > most_corners)) {
    reader.refuse("profile", fmt::format("2 to {} corners for cutting.profile", most_corners),
                  fmt::format("{}", corners.size()));
    return blank;
  }
  blank.profile.resize(Eigen::Index(corners.size()), 2);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    TableReader corner(*corners[i], "cutting.profile", reader.faults());
    const Eigen::Index k = Eigen::Index(i);
    blank.profile(k, 0) = corner.number("along_mm", any_number);
    blank.profile(k, 1) = corner.number("radius_mm", non_negative);
    const double before_mm = k > 0 ? blank.profile(k - 1, 0) : blank.profile(k, 0);
    if (corner.has("along_mm") && blank.profile(k, 0) < before_mm) {
      corner.refuse("along_mm",
                    fmt::format("along_mm of at least {}, the corner before", before_mm),
                    fmt::format("{}", blank.profile(k, 0)));
    }
    corner.close();
  }
  const Eigen::Index last = blank.profile.rows() - 1;
  if (last > 0 && reader.faults().list().size() == before &&
      !(blank.profile(last, 0) > blank.profile(0, 0))) {
    reader.refuse("profile", "corners at two places or more for cutting.profile", "one place");
  }
  return blank;
}

CuttingDescription::Blank read_blank(TableReader& reader) {
  enum class Kind { Box, Cylinder, Offset, Mesh, Turned };
  const Kind kind = reader.choice<Kind>("blank", {{"box", Kind::Box},
                                                  {"cylinder", Kind::Cylinder},
                                                  {"offset", Kind::Offset},
                                                  {"mesh", Kind::Mesh},
                                                  {"turned", Kind::Turned}});
  switch (kind) {
    case Kind::Box: {
      const cutting::BoxBlank box{reader.vector("lower_mm"), reader.vector("upper_mm")};
      refuse_flat(reader, box);
      return box;
    }
    case Kind::Cylinder:
      return read_cylinder(reader);
    case Kind::Offset:
      return CuttingDescription::OffsetBlank{reader.number("allowance_mm", positive),
                                             reader.number("floor_mm", any_number)};
    case Kind::Mesh:
      return read_mesh_file(reader);
    case Kind::Turned:
      break;
  }
  return read_turned(reader);
}

cutting::Flutes read_flutes(TableReader& reader) {
  cutting::Flutes flutes;
  flutes.count = int(reader.integer("flutes", 1, 100, flutes.count));
  flutes.helix = reader.number("helix_deg", helix_range, 30.0 * units::deg);
  flutes.run_out = reader.number("run_out_um", run_out_range, 0.0);
  flutes.run_out_angle = reader.number("run_out_angle_deg", any_number, 0.0);
  flutes.clockwise =
      reader.choice<bool>("rotation", {{"clockwise", true}, {"counter_clockwise", false}}, true);
  return flutes;
}

bool reads_three_directions(TableReader& reader) {
  const std::int64_t directions = reader.integer("directions", 1, 3, 3);
  if (directions == 2) reader.refuse("directions", "1 or 3 for cutting.directions", "2");
  return directions != 1;
}

/// A blank for the lathe under a cutter, or the other way round.
void refuse_mismatch(TableReader& reader, bool is_nose, const CuttingDescription& cutting) {
  const bool turned = std::holds_alternative<CuttingDescription::TurnedBlank>(cutting.blank);
  if (is_nose && !turned) {
    reader.refuse("blank", "\"turned\" for cutting.blank under a turning tool", "another");
  } else if (!is_nose && turned) {
    reader.refuse("blank", "a blank for a milling cutter for cutting.blank", "\"turned\"");
  }
}

}  // namespace

cutting::CuttingCoefficients read_material(const Node& table, Faults& faults) {
  TableReader reader(table, "material", faults);
  cutting::CuttingCoefficients K;
  K.name = reader.text("name");
  K.source = reader.text("source");
  K.K_tc = reader.number("K_tc_N_per_mm2", positive);
  K.K_rc = reader.number("K_rc_N_per_mm2", non_negative);
  K.K_ac = reader.number("K_ac_N_per_mm2", any_number);
  K.K_te = reader.number("K_te_N_per_mm", non_negative);
  K.K_re = reader.number("K_re_N_per_mm", non_negative);
  K.K_ae = reader.number("K_ae_N_per_mm", any_number);
  reader.close();
  return K;
}

CuttingDescription read_cutting(const Node& table, const ToolDescription& tool, Faults& faults) {
  TableReader reader(table, "cutting", faults);
  CuttingDescription cutting;
  const bool is_nose = std::holds_alternative<cutting::Nose>(tool.nominal);
  const std::size_t before = faults.list().size();
  cutting.blank = read_blank(reader);
  if (faults.list().size() == before) refuse_mismatch(reader, is_nose, cutting);
  cutting.spacing = reader.number("spacing_mm", spacing_range, cutting.spacing);
  if (!is_nose) {  // a nose has no flutes and no dexels
    cutting.three_directions = reads_three_directions(reader);
    cutting.flutes = read_flutes(reader);
    cutting.step = reader.number("step_mm", step_range, cutting.step);
  }
  if (!std::holds_alternative<CuttingDescription::TurnedBlank>(cutting.blank))
    cutting.max_bytes = std::size_t(reader.integer("max_MiB", 1, std::int64_t(1) << 24, 2048))
                        << 20;
  cutting.tolerance = reader.number("tolerance_nm", positive, cutting.tolerance);
  cutting.most_iterations = int(reader.integer("most_iterations", 1, 1000, 30));
  reader.close();
  return cutting;
}

}  // namespace abbe::sim
