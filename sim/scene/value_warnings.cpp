#include "sim/scene/value_warnings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

namespace abbe::sim {
namespace {

/// Plausible magnitudes of certain keys, with the probable unit of a number outside of them. The
/// ranges are wide, a factor of ten beyond the largest and the smallest machine, because false
/// warnings teach users to ignore all of them.
struct PlausibleRange {
  std::string_view section;  ///< a section on the path to the key; empty: any
  std::string_view ending;   ///< end of the key
  double low, high;
  std::string_view below, above;  ///< probable unit of a smaller or larger magnitude
};

// The first matching row applies, so rows of a section precede general ones.
constexpr std::array plausible_ranges{
    // temperatures
    PlausibleRange{"", "offset_K", 1e-4, 20, "", "a temperature, not a difference"},
    PlausibleRange{"", "noise_K", 1e-4, 20, "", "mK"},
    PlausibleRange{"", "resolution_K", 1e-4, 20, "", "mK"},
    PlausibleRange{"", "dT_K", 0, 200, "", "a temperature, not a difference"},
    // heat
    PlausibleRange{"", "capacity_J_per_K", 20, 1e8, "kJ/K", "mJ/K"},
    PlausibleRange{"", "conductance_W_per_K", 0.02, 2e4, "kW/K", "mW/K"},
    PlausibleRange{"", "power_W", 2, 2e5, "kW", "mW"},
    PlausibleRange{"", "um_per_m_K", 0.05, 200, "1/K or mm per m and K", "nm per m and K"},
    PlausibleRange{"", "urad_per_m_K", 0.005, 1000, "rad or mrad per m and K", "nrad per m and K"},
    PlausibleRange{"", "um_per_K", 0.004, 200, "mm per K", "nm per K"},
    PlausibleRange{"", "urad_per_K", 0.004, 1000, "rad or mrad per K", "nrad per K"},
    PlausibleRange{"", "lag_s", 0.01, 7200, "minutes or hours", "ms"},
    PlausibleRange{"", "sampling_s", 1e-4, 3600, "", "ms"},
    // times
    PlausibleRange{"", "duration_h", 0.003, 300, "", "minutes or seconds"},
    PlausibleRange{"", "duration_min", 0.1, 15000, "hours", "seconds"},
    PlausibleRange{"history", "duration_s", 5, 1e6, "hours or minutes", "ms"},
    PlausibleRange{"", "_h", 0, 1000, "", "minutes or seconds"},
    PlausibleRange{"datum", "time_s", 10, 1e7, "hours", "ms"},
    PlausibleRange{"tool", "time_min", 0.2, 1e4, "hours", "seconds"},
    PlausibleRange{"", "set_up_min", 0.2, 1000, "hours", "seconds"},
    PlausibleRange{"", "dwell_s", 0.01, 600, "minutes", "ms"},
    PlausibleRange{"", "interval_s", 1e-5, 7200, "", "ms"},
    PlausibleRange{"", "cycle_ms", 0.005, 2000, "s", "us"},
    PlausibleRange{"", "delay_ms", 0.005, 5000, "s", "us"},
    PlausibleRange{"", "pulse_ms", 5e-5, 100, "s", "us"},
    PlausibleRange{"", "smoothing_ms", 1, 6e4, "s", "us"},
    PlausibleRange{"", "bandwidth_Hz", 0.5, 1e5, "kHz", "mHz"},
    PlausibleRange{"", "resonance_Hz", 2, 5e4, "kHz", "rpm or mHz"},
    // speeds
    PlausibleRange{"", "viscous_torque_Nm_per_rpm", 1e-7, 0.1, "", "Nm per 1000 rpm"},
    PlausibleRange{"", "rpm", 20, 3e5, "1/s or 1000 rpm", "degrees per minute"},
    PlausibleRange{"machine", "rapid_mm_per_min", 100, 3e5, "m/min or mm/s", "um/s"},
    PlausibleRange{"machine", "rapid_deg_per_min", 50, 1e6, "rpm or rad/s", "degrees per hour"},
    PlausibleRange{"", "rate_mm_per_min", 0.1, 1e4, "m/min", "um/s"},
    PlausibleRange{"", "mm_per_min", 10, 3e5, "m/min or mm/s", "um/min"},
    PlausibleRange{"", "feed_um_per_rev", 0.5, 5000, "mm per revolution", "nm per revolution"},
    // forces, stiffness, material
    PlausibleRange{"", "turning_stiffness_Nm_per_urad", 1e-3, 1e4, "Nm per nrad", "Nm per rad"},
    PlausibleRange{"", "stiffness_N_per_um", 0.2, 1e4, "N per nm", "N/mm or N/m"},
    PlausibleRange{"", "youngs_modulus_GPa", 0.5, 1500, "TPa", "MPa"},
    PlausibleRange{"", "mass_kg", 0.005, 1e5, "t", "g"},
    PlausibleRange{"", "torque_Nm_per_A", 0.005, 100, "kNm per A", "Nmm per A"},
    PlausibleRange{"", "coulomb_N", 0.1, 5e4, "kN", "mN"},
    PlausibleRange{"", "K_ac_N_per_mm2", 1, 1e4, "kN/mm2 or GPa", "kPa or N/m2"},
    PlausibleRange{"", "N_per_mm2", 20, 1e4, "kN/mm2 or GPa", "kPa or N/m2"},
    PlausibleRange{"material", "K_ae_N_per_mm", 0.01, 1000, "N/um", "N/m"},
    PlausibleRange{"material", "N_per_mm", 0.3, 1000, "N/um", "N/m"},
    PlausibleRange{"vibration", "damping", 1e-4, 1.5, "", "percent of critical"},
    PlausibleRange{"loop", "damping", 0.02, 10, "", "percent of critical"},
    // lengths of instruments, controls, limits
    PlausibleRange{"instrument", "noise_um", 1e-3, 200, "mm", "nm"},
    PlausibleRange{"instrument", "noise_urad", 1e-3, 1000, "rad or mrad", "nrad"},
    PlausibleRange{"instrument", "position_um", 1e-3, 5000, "mm", "nm"},
    PlausibleRange{"instrument", "alignment_urad", 0.01, 5000, "rad or mrad", "nrad"},
    PlausibleRange{"instrument", "scale_um_per_m", 1e-3, 500, "mm/m", "nm/m"},
    PlausibleRange{"instrument", "resolution_um", 1e-5, 200, "mm", "nm"},
    PlausibleRange{"instrument", "radius_mm", 2, 5000, "m", "um"},
    PlausibleRange{"instrument", "lever_mm", 2, 1e4, "m", "um"},
    PlausibleRange{"instrument", "spacing_mm", 0.02, 500, "m", "um"},
    PlausibleRange{"signals", "_um", 1e-4, 100, "mm", "nm"},
    PlausibleRange{"pulses", "count_um", 0.005, 200, "mm", "nm"},
    PlausibleRange{"origin", "increment_um", 0.005, 200, "mm", "nm"},
    PlausibleRange{"belief", "scale", 0, 5, "", "percent"},
    PlausibleRange{"piezo", "range_um", 0.5, 5000, "mm", "nm"},
    PlausibleRange{"compensation", "rotary_bound_deg", 0.003, 20, "radians", "urad"},
    PlausibleRange{"compensation", "path_tolerance_um", 0.002, 200, "mm", "nm"},
    PlausibleRange{"table", "spacing_mm", 0.05, 200, "m", "um"},
    PlausibleRange{"", "word_resolution_mm", 1e-8, 0.2, "", "um"},
    PlausibleRange{"setup", "_um", 0.05, 1e4, "mm", "nm"},
    PlausibleRange{"setup", "_urad", 0.05, 2e4, "rad or mrad", "nrad"},
    PlausibleRange{"part", "tolerance_um", 0.05, 1e4, "mm", "nm"},
    PlausibleRange{"limits", "_um", 0.05, 5000, "mm", "nm"},
    PlausibleRange{"tolerance", "limit_um", 0.05, 5000, "mm", "nm"},
    // studies
    PlausibleRange{"influence", "reach_um", 1, 5000, "mm", "nm"},
    PlausibleRange{"influence", "flag_um", 0.002, 200, "mm", "nm"},
    PlausibleRange{"one_at_a_time", "step", 0.01, 6, "", "percent, not standard deviations"},
    PlausibleRange{"worst_case", "coverage", 1, 8, "a confidence, not standard deviations",
                   "percent, not standard deviations"},
    PlausibleRange{"cutting", "run_out_um", 0.05, 500, "mm", "nm"},
    PlausibleRange{"cutting", "_um", 0.05, 1e5, "mm", "nm"},
    PlausibleRange{"cutting", "allowance_mm", 0.005, 100, "m", "um"},
    PlausibleRange{"vibration", "_um", 1e-4, 1000, "m or mm", "nm"},
    PlausibleRange{"vibration", "_urad", 1e-4, 1e4, "rad or mrad", "nrad"},
    PlausibleRange{"wave", "amplitude_um", 1e-4, 500, "m or mm", "nm"},
    PlausibleRange{"wear", "_um", 0.01, 2000, "mm", "nm"},
    PlausibleRange{"search", "band_mm", 0.02, 50, "m", "um"},
    // lengths of machine, tool and part
    PlausibleRange{"errors", "half_range_mm", 2, 3e4, "m", "um"},
    PlausibleRange{"errors", "period_mm", 0.2, 3e4, "m", "um"},
    PlausibleRange{"section", "length_mm", 0.5, 5000, "m", "um"},
    PlausibleRange{"section", "diameter_mm", 0.1, 2000, "m", "um"},
    PlausibleRange{"control", "tool_length_mm", 2, 3000, "m or inch", "um"},
    PlausibleRange{"tool", "corner_radius_mm", 0.005, 500, "m", "um"},
    PlausibleRange{"tool", "wiper_mm", 0.01, 50, "m", "um"},
    PlausibleRange{"tool", "radius_mm", 0.01, 500, "m", "um"},
    PlausibleRange{"tool", "diameter_mm", 0.02, 1000, "m", "um"},
    PlausibleRange{"tool", "flank_length_mm", 0.1, 1000, "m", "um"},
    PlausibleRange{"tool", "cutting_edge_mm", 0.05, 200, "m", "um"},
    PlausibleRange{"tool", "minor_edge_mm", 0.05, 200, "m", "um"},
    PlausibleRange{"tool", "length_mm", 2, 3000, "m or inch", "um"},
    PlausibleRange{"part", "length_x_mm", 0.5, 2e4, "m", "um"},
    PlausibleRange{"part", "length_y_mm", 0.5, 2e4, "m", "um"},
    PlausibleRange{"part", "rim_radius_mm", 0.2, 2e4, "m", "um"},
    PlausibleRange{"body", "size_mm", 1, 1e5, "m", "um"},
    PlausibleRange{"fixture", "size_mm", 1, 1e5, "m", "um"},
    PlausibleRange{"body", "at_mm", 0, 2e4, "", "um"},
    PlausibleRange{"fixture", "at_mm", 0, 2e4, "", "um"},
    PlausibleRange{"mass", "centre_mm", 0, 2e4, "", "um"},
    PlausibleRange{"part", "form_cutoff_mm", 0.005, 1000, "m", "um"},
    PlausibleRange{"part", "resolution_um", 1e-3, 1000, "mm", "nm"},
    PlausibleRange{"program", "step_over_mm", 1e-3, 200, "m", "um"},
    PlausibleRange{"program", "step_mm", 1e-3, 200, "m", "um"},
    PlausibleRange{"program", "clearance_mm", 0.01, 2000, "m", "um"},
    PlausibleRange{"sampling", "chord_tolerance_nm", 0.01, 1e5, "um", "pm"},
};

/// Tables of changes, which are examined in the scene to which they are applied.
constexpr std::array<std::string_view, 3> changes{"study", "variant", "set"};

/// Temperatures of a workshop, its coolant and a machine at rest, deg C. Numbers in Fahrenheit and
/// kelvin are higher: 20 deg C is 68 F and 293 K.
constexpr double min_plausible_C = -40.0, max_plausible_C = 60.0, max_plausible_F = 200.0;

/// Total travels. Only a piezo stage moves by just a few mm, and no machine axis moves by 100 m.
constexpr double min_plausible_travel_mm = 5.0, max_plausible_travel_mm = 1e5;
// In radians, +-110 deg is a travel of 3.8, and +-360 deg one of 12.6. A travel below 13 deg is
// therefore in radians; no rotary table turns so little.
constexpr double min_plausible_travel_deg = 13.0;

std::string_view last_key(std::string_view key) { return key.substr(key.rfind('.') + 1); }

std::string_view parent_of(std::string_view key) {
  const std::size_t dot = key.rfind('.');
  return dot == std::string_view::npos ? std::string_view() : key.substr(0, dot);
}

bool has_unit(std::string_view key) { return key_without_unit(key) != key; }

/// Returns the component of a key that has the unit: the last one, or the table of an axis letter,
/// as in "axis_speed_mm_per_min.X".
std::string_view component_with_unit(std::string_view key) {
  const std::string_view name = last_key(key);
  const std::string_view table_name = last_key(parent_of(key));
  return !has_unit(name) && name.size() <= 3 && has_unit(table_name) ? table_name : name;
}

bool is_within(std::string_view key, std::string_view section) {
  if (section.empty()) return true;
  for (std::string_view remaining_key = key; !remaining_key.empty();) {
    const std::size_t dot = remaining_key.find('.');
    if (remaining_key.substr(0, dot) == section) return true;
    if (dot == std::string_view::npos) return false;
    remaining_key.remove_prefix(dot + 1);
  }
  return false;
}

bool is_temperature(std::string_view name) { return name.ends_with("_C"); }

/// Returns true if the value is one of 30, 45, 60, 90, 120, 135, 180, 270 and 360 degrees in
/// radians, to three digits. Such numbers are rare in degrees.
bool resembles_radians(double value) {
  for (const int twelfths : {2, 3, 4, 6, 8, 9, 12, 18, 24}) {
    const double angle = pi * twelfths / 12.0;
    if (std::abs(std::abs(value) - angle) < 1e-3 * angle) return true;
  }
  return false;
}

const PlausibleRange* find_plausible_range(std::string_view key) {
  const std::string_view name = component_with_unit(key);
  for (const PlausibleRange& range : plausible_ranges)
    if (name.ends_with(range.ending) && is_within(key, range.section)) return &range;
  return nullptr;
}

/// Returns true if implausible numbers of a key can be recognised.
bool has_plausible_range(std::string_view key) {
  const std::string_view name = component_with_unit(key);
  return is_temperature(name) || name.ends_with("_deg") || find_plausible_range(key) != nullptr;
}

std::string temperature_mistake(double value) {
  if (value >= min_plausible_C && value <= max_plausible_C) return {};
  return value < min_plausible_C   ? "a different quantity"
         : value < max_plausible_F ? "Fahrenheit"
                                   : "kelvin";
}

/// Returns the plausible values of a key as text.
std::string plausible_text(std::string_view key) {
  const std::string unit = unit_name(component_with_unit(key));
  const std::string unit_text = unit == "no unit" ? "" : " " + unit;
  if (is_temperature(component_with_unit(key)))
    return fmt::format("{} to {} deg C", min_plausible_C, max_plausible_C);
  const PlausibleRange* range = find_plausible_range(key);
  if (range == nullptr) return "degrees";
  if (range->low == 0.0) return fmt::format("up to {:g}{}", range->high, unit_text);
  return fmt::format("{:g} to {:g}{}", range->low, range->high, unit_text);
}

std::string location_text(const SourcePosition& position) {
  if (!position.file || position.file->empty() || position.line == 0) return {};
  return fmt::format("{}:{}:{}: ", *position.file, position.line, position.column);
}

std::optional<double> node_number(const Node& node) {
  if (const double* real = std::get_if<double>(&node.value)) return *real;
  if (const std::int64_t* whole = std::get_if<std::int64_t>(&node.value)) return double(*whole);
  return std::nullopt;
}

/// Implausible numbers of one key.
struct Finding {
  std::string text;
  int further_count = 0;
};

/// Visits the numbers of a tree and collects findings.
class NumberVisitor {
 public:
  void visit(const Node& node, const std::string& key) {
    if (const auto value = node_number(node)) return visit_number(*value, node.position, key);
    if (const Node::Table* table = node.table())
      for (const Node::Entry& entry : *table) {
        const std::string inner = key.empty() ? entry.key : key + "." + entry.key;
        if (std::ranges::find(changes, inner) == changes.end()) visit(entry.node, inner);
      }
    if (const Node::Array* array = node.array()) {
      visit_travel(*array, node.position, key);
      // Arrays of numbers may be long, so the range of their key is looked up first.
      if (!array->empty() && node_number(array->front()) && !has_plausible_range(key)) return;
      for (const Node& element : *array) visit(element, key);
    }
  }

  std::vector<std::string> texts() const {
    std::vector<std::string> texts;
    for (const std::string& key : order_) {
      const Finding& finding = findings_.at(key);
      texts.push_back(finding.text +
                      (finding.further_count == 0
                           ? std::string()
                           : fmt::format("; {} more values of this key", finding.further_count)));
    }
    return texts;
  }

 private:
  void add(const std::string& key, std::string text) {
    // A wrong unit usually affects all numbers of a key, so there is one message for each key.
    const auto [entry, is_first] = findings_.try_emplace(key, Finding{std::move(text), 0});
    if (is_first)
      order_.push_back(key);
    else
      ++entry->second.further_count;
  }

  void visit_number(double value, const SourcePosition& position, const std::string& key) {
    const std::string mistake = probable_mistake(key, value);
    if (!mistake.empty())
      add(key, fmt::format("{}{} is {:.6g}: looks like {}; expected {}", location_text(position),
                           key, value, mistake, plausible_text(key)));
  }

  /// Examines the length of a travel, because its ends may be near zero.
  void visit_travel(const Node::Array& ends, const SourcePosition& position,
                    const std::string& key) {
    const std::string_view name = last_key(key);
    if (ends.size() != 2 || !name.starts_with("travel_")) return;
    const auto min = node_number(ends[0]), max = node_number(ends[1]);
    if (!min || !max) return;
    const double travel = *max - *min;
    const bool is_rotary = name == "travel_deg";
    const double min_travel = is_rotary ? min_plausible_travel_deg : min_plausible_travel_mm;
    const bool is_short = travel > 0.0 && travel < min_travel;
    // A rotary axis may be endless, so only a short travel is implausible.
    if (!is_short && (is_rotary || travel <= max_plausible_travel_mm)) return;
    add(key,
        fmt::format(
            "{}{} is {:.6g} long: looks like {}; expected {}", location_text(position), key, travel,
            is_rotary  ? "radians"
            : is_short ? "m"
                       : "um",
            is_rotary ? fmt::format("{:g} deg or more", min_travel)
                      : fmt::format("{:g} to {:g} mm", min_travel, max_plausible_travel_mm)));
  }

  std::vector<std::string> order_;
  std::map<std::string, Finding> findings_;
};

// ---- pairs of numbers

/// Tools are measured to hundredths of a mm. A larger deviation means that the number is a
/// difference, a diameter or in another unit.
constexpr double max_tool_deviation_mm = 1.0, max_tool_ratio = 1.25;
/// Controls are set to within some um. A deviation of a mm means another axis, sign or unit.
constexpr double max_control_deviation_mm = 1.0;

void add_tool_warnings(const ToolDescription& tool, std::vector<std::string>& warnings) {
  const std::string tool_name = tool.number ? fmt::format(" of T{}", *tool.number) : "";
  const auto add = [&](const char* key, double actual, double nominal) {
    const bool is_near = std::abs(actual - nominal) <= max_tool_deviation_mm;
    const double ratio = std::max(actual, nominal) / std::min(actual, nominal);
    if (is_near && (ratio > 0.0 && ratio <= max_tool_ratio)) return;
    warnings.push_back(
        fmt::format("tool.actual.{}{} is {:.6g}, but the tool has {:.6g}: state the size itself, "
                    "not a difference or a diameter, and check the unit",
                    key, tool_name, actual, nominal));
  };
  const auto* nominal = std::get_if<cutting::Cutter>(&tool.nominal);
  const auto* actual = std::get_if<cutting::Cutter>(&tool.actual);
  if (nominal != nullptr && actual != nullptr) add("radius_mm", actual->radius, nominal->radius);
  // An actual length equal to the nominal one is the default.
  if (tool.actual_length != tool.length) add("length_mm", tool.actual_length, tool.length);
}

void add_control_warnings(const Scene& scene, std::vector<std::string>& warnings) {
  const ControlDescription& control = scene.control;
  if (control.tool_length &&
      std::abs(*control.tool_length - scene.tool.length) > max_control_deviation_mm)
    warnings.push_back(
        fmt::format("control.tool_length_mm is {:.6g}, but the tool is {:.6g} long: state the "
                    "length itself that the control believes",
                    *control.tool_length, scene.tool.length));
  const auto& joints = scene.machine.joints;
  for (std::size_t j = 0; j < std::min(joints.size(), control.joints.size()); ++j) {
    const double distance = (control.joints[j].point_b - joints[j].point_b).norm();
    if (joints[j].motion == kinematics::Motion::Rotary && distance > max_control_deviation_mm)
      warnings.push_back(
          fmt::format("control.axis.{}.point_mm is {:.4g} mm from that of the machine, and no "
                      "control is that wrong: check the axis, the sign and the unit",
                      joints[j].name, distance));
  }
}

/// Adds a warning for each fixture that is farther from the part than the travel of the longest
/// slide.
void add_fixture_warnings(const Scene& scene, std::vector<std::string>& warnings) {
  double longest_travel = 0.0;
  for (const kinematics::Joint& joint : scene.machine.joints)
    if (joint.motion == kinematics::Motion::Linear)
      longest_travel = std::max(longest_travel, joint.max - joint.min);
  for (const BodyDescription& fixture : scene.fixtures) {
    const double distance = (fixture.T.translation() - scene.part.T_wm.translation()).norm();
    if (longest_travel > 0.0 && distance > longest_travel)
      warnings.push_back(
          fmt::format("fixture \"{}\" is {:.4g} mm from the part, but the travel of the longest "
                      "slide is {:.4g} mm: check the unit and the origin of its at_mm",
                      fixture.name, distance, longest_travel));
  }
}

/// Adds warnings for compliant sections that are longer than the tool or, at the tip, thicker than
/// the cutter.
void add_section_warnings(const Scene& scene, std::vector<std::string>& warnings) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  const Node* node = scene.tree.get();
  for (const char* key : {"compliance", "tool", "section"})
    if (node != nullptr) node = node->find(key);
  if (cutter == nullptr || node == nullptr || !node->array() || node->array()->empty()) return;
  constexpr double rounding_margin = 1.01;  // data sheets state rounded sizes
  const auto section_size = [](const Node& section, const char* key) {
    const Node* size = section.find(key);
    return size == nullptr ? 0.0 : node_number(*size).value_or(0.0);
  };
  double length = 0.0;
  for (const Node& section : *node->array()) length += section_size(section, "length_mm");
  if (length > rounding_margin * scene.tool.length)
    warnings.push_back(fmt::format(
        "compliance.tool.section has a total length of {:.6g} mm, but the tool is {:.6g} mm long",
        length, scene.tool.length));
  const double diameter = section_size(node->array()->front(), "diameter_mm");
  const double cutter_diameter = 2.0 * std::max(cutter->radius, cutting::shank_radius(*cutter));
  if (diameter > rounding_margin * cutter_diameter)
    warnings.push_back(
        fmt::format("compliance.tool.section has a diameter of {:.6g} mm at the tip, but the "
                    "cutter has {:.6g} mm: sections are listed from the tip to the spindle",
                    diameter, cutter_diameter));
}

}  // namespace

std::string probable_mistake(std::string_view key, double value) {
  const std::string_view name = component_with_unit(key);
  // Zero is the same in every unit.
  if (value == 0.0 || !std::isfinite(value)) return {};
  if (is_temperature(name)) return temperature_mistake(value);
  if (const PlausibleRange* range = find_plausible_range(key)) {
    const double magnitude = std::abs(value);
    if (magnitude < range->low && !range->below.empty()) return std::string(range->below);
    if (magnitude > range->high) return std::string(range->above);
    return {};
  }
  return name.ends_with("_deg") && resembles_radians(value) ? "radians" : "";
}

std::vector<std::string> value_warnings(const Node& tree) {
  NumberVisitor visitor;
  visitor.visit(tree, "");
  return visitor.texts();
}

std::vector<std::string> value_warnings(const Scene& scene) {
  std::vector<std::string> warnings;
  if (scene.tree) warnings = value_warnings(*scene.tree);
  for (const ToolDescription& tool : all_tools(scene)) add_tool_warnings(tool, warnings);
  add_control_warnings(scene, warnings);
  add_fixture_warnings(scene, warnings);
  add_section_warnings(scene, warnings);
  // A negative factor is allowed, but it is unusual.
  if (scene.belief.scale < 0.0)
    warnings.push_back(fmt::format(
        "belief.scale is {:g}: a compensator adds the believed errors instead of removing them",
        scene.belief.scale));
  if (scene.compliance && scene.compliance->gravity_b && scene.compliance->gravity_b->z() > 0.5)
    warnings.push_back(
        "compliance.gravity points up, along z of the bed: it is the direction in which masses "
        "fall; expected [0, 0, -1]");
  return warnings;
}

}  // namespace abbe::sim
