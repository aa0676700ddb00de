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

/// Practical magnitudes of a kind of key, with the probable cause of a number outside of them. The
/// ranges are deliberately wide, a factor of ten beyond the largest and the smallest machine,
/// because wrong warnings teach users to ignore all of them.
struct PlausibleRange {
  std::string_view section;  ///< a section on the path to the key; empty: any
  std::string_view ending;   ///< of the key
  double low, high;
  std::string_view below, above;  ///< probable unit of a smaller or larger magnitude
};

// The first row that matches a key applies, so rows of a section precede those for all sections.
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
    PlausibleRange{"", "rpm", 20, 3e5, "1/s or 1000 rpm", "degrees a minute"},
    PlausibleRange{"machine", "rapid_mm_per_min", 100, 3e5, "m/min or mm/s", "um/s"},
    PlausibleRange{"machine", "rapid_deg_per_min", 50, 1e6, "rpm or rad/s", "degrees an hour"},
    PlausibleRange{"", "rate_mm_per_min", 0.1, 1e4, "m/min", "um/s"},
    PlausibleRange{"", "mm_per_min", 10, 3e5, "m/min or mm/s", "um/min"},
    PlausibleRange{"", "feed_um_per_rev", 0.5, 5000, "mm a revolution", "nm a revolution"},
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

/// Tables of changes, which are judged in the scene to which they are applied.
constexpr std::array<std::string_view, 3> changes{"study", "variant", "set"};

/// Temperatures of a workshop, its coolant and a resting machine, deg C. Fahrenheit and kelvin
/// begin beyond them: 20 deg C is 68 F and 293 K.
constexpr double min_plausible_C = -40.0, max_plausible_C = 60.0, fahrenheit_to = 200.0;

/// Travels between both ends; a slide of a few mm is a piezo stage.
constexpr double min_plausible_travel_mm = 5.0, longest_travel_mm = 1e5;
// 110 deg either way are 3.8 rad, a whole turn either way 12.6: no rotary table turns less than 13
// deg.
constexpr double min_plausible_travel_deg = 13.0;

std::string_view last_key(std::string_view key) { return key.substr(key.rfind('.') + 1); }

std::string_view parent_of(std::string_view key) {
  const std::size_t dot = key.rfind('.');
  return dot == std::string_view::npos ? std::string_view() : key.substr(0, dot);
}

bool has_unit(std::string_view key) { return key_stem(key) != key; }

/// Returns the part of a key that carries the unit: its end, or the table above an axis letter, as
/// in "axis_speed_mm_per_min.X".
std::string_view part_with_unit(std::string_view key) {
  const std::string_view own = last_key(key);
  const std::string_view holder = last_key(parent_of(key));
  return !has_unit(own) && own.size() <= 3 && has_unit(holder) ? holder : own;
}

bool is_within(std::string_view key, std::string_view section) {
  if (section.empty()) return true;
  for (std::string_view rest = key; !rest.empty();) {
    const std::size_t dot = rest.find('.');
    if (rest.substr(0, dot) == section) return true;
    if (dot == std::string_view::npos) return false;
    rest.remove_prefix(dot + 1);
  }
  return false;
}

bool is_temperature(std::string_view name) { return name.ends_with("_C"); }

/// Returns true for 30, 45, 60, 90, 120, 135, 180, 270 or 360 degrees in radians, to the three
/// digits in common use; such numbers are rare as degrees.
bool resembles_radians(double value) {
  for (const int part : {2, 3, 4, 6, 8, 9, 12, 18, 24}) {
    const double angle = pi * part / 12.0;
    if (std::abs(std::abs(value) - angle) < 1e-3 * angle) return true;
  }
  return false;
}

const PlausibleRange* range_of(std::string_view key) {
  const std::string_view name = part_with_unit(key);
  for (const PlausibleRange& range : plausible_ranges)
    if (name.ends_with(range.ending) && is_within(key, range.section)) return &range;
  return nullptr;
}

/// Returns true if anything is known of the numbers of a key.
bool has_plausible_range(std::string_view key) {
  const std::string_view name = part_with_unit(key);
  return is_temperature(name) || name.ends_with("_deg") || range_of(key) != nullptr;
}

std::string mistaken_temperature(double value) {
  if (value >= min_plausible_C && value <= max_plausible_C) return {};
  return value < min_plausible_C ? "another quantity"
         : value < fahrenheit_to ? "Fahrenheit"
                                 : "kelvin";
}

/// Returns the expected values of a key for a warning.
std::string plausible_text(std::string_view key) {
  const std::string unit = unit_name(part_with_unit(key));
  const std::string named = unit == "no unit" ? "" : " " + unit;
  if (is_temperature(part_with_unit(key)))
    return fmt::format("{} to {} deg C", min_plausible_C, max_plausible_C);
  const PlausibleRange* range = range_of(key);
  if (range == nullptr) return "degrees";
  if (range->low == 0.0) return fmt::format("up to {:g}{}", range->high, named);
  return fmt::format("{:g} to {:g}{}", range->low, range->high, named);
}

std::string location_text(const Place& place) {
  if (!place.file || place.file->empty() || place.line == 0) return {};
  return fmt::format("{}:{}:{}: ", *place.file, place.line, place.column);
}

std::optional<double> number_of(const Node& node) {
  if (const double* real = std::get_if<double>(&node.value)) return *real;
  if (const std::int64_t* whole = std::get_if<std::int64_t>(&node.value)) return double(*whole);
  return std::nullopt;
}

/// Implausible numbers of one key.
struct Finding {
  std::string text;
  int more = 0;
};

class Walk {
 public:
  void visit(const Node& node, const std::string& key) {
    if (const auto value = number_of(node)) return visit_number(*value, node.place, key);
    if (const Node::Table* table = node.table())
      for (const Node::Entry& entry : *table) {
        const std::string inner = key.empty() ? entry.key : key + "." + entry.key;
        if (std::ranges::find(changes, inner) == changes.end()) visit(entry.node, inner);
      }
    if (const Node::Array* array = node.array()) {
      visit_travel(*array, node.place, key);
      // Tables and covariances are long, so their key is looked up once.
      if (!array->empty() && number_of(array->front()) && !has_plausible_range(key)) return;
      for (const Node& element : *array) visit(element, key);
    }
  }

  std::vector<std::string> texts() const {
    std::vector<std::string> texts;
    for (const std::string& key : order_) {
      const Finding& finding = findings_.at(key);
      texts.push_back(finding.text + (finding.more == 0
                                          ? std::string()
                                          : fmt::format("; {} more of this key", finding.more)));
    }
    return texts;
  }

 private:
  void add(const std::string& key, std::string text) {
    // One message per key is enough, since a wrong unit usually affects all of its numbers.
    const auto [at, is_first] = findings_.try_emplace(key, Finding{std::move(text), 0});
    if (is_first)
      order_.push_back(key);
    else
      ++at->second.more;
  }

  void visit_number(double value, const Place& place, const std::string& key) {
    const std::string mistake = probable_mistake(key, value);
    if (!mistake.empty())
      add(key, fmt::format("{}{} is {:.6g}: looks like {}, {} expected", location_text(place), key,
                           value, mistake, plausible_text(key)));
  }

  /// Examines a travel as a whole, because each of its ends may be near zero.
  void visit_travel(const Node::Array& ends, const Place& place, const std::string& key) {
    const std::string_view name = last_key(key);
    if (ends.size() != 2 || !name.starts_with("travel_")) return;
    const auto from = number_of(ends[0]), to = number_of(ends[1]);
    if (!from || !to) return;
    const double size = *to - *from;
    const bool turns = name == "travel_deg";
    const double shortest = turns ? min_plausible_travel_deg : min_plausible_travel_mm;
    const bool is_short = size > 0.0 && size < shortest;
    // A rotary axis may turn without end, so only its short travel is suspicious.
    if (!is_short && (turns || size <= longest_travel_mm)) return;
    add(key, fmt::format("{}{} is {:.6g} long: looks like {}, {} expected", location_text(place),
                         key, size,
                         turns      ? "radians"
                         : is_short ? "m"
                                    : "um",
                         turns ? fmt::format("{:g} deg or more", shortest)
                               : fmt::format("{:g} to {:g} mm", shortest, longest_travel_mm)));
  }

  std::vector<std::string> order_;
  std::map<std::string, Finding> findings_;
};

// ---- pairs of numbers

/// Tools are measured to hundredths of a mm, so a larger deviation is a difference, a diameter or
/// another unit in place of the actual size.
constexpr double max_wrong_tool_mm = 1.0, max_wrong_ratio = 1.25;
/// Controls are set to some um; a deviation of a mm comes from another axis, sign or unit.
constexpr double max_wrong_control_mm = 1.0;

void add_tool_texts(const ToolDescription& tool, std::vector<std::string>& warnings) {
  const std::string whose = tool.number ? fmt::format(" of T{}", *tool.number) : "";
  const auto add = [&](const char* key, double actual, double nominal) {
    const bool is_near = std::abs(actual - nominal) <= max_wrong_tool_mm;
    const double ratio = std::max(actual, nominal) / std::min(actual, nominal);
    if (is_near && (ratio > 0.0 && ratio <= max_wrong_ratio)) return;
    warnings.push_back(fmt::format(
        "tool.actual.{}{} is {:.6g} where the tool is {:.6g}: it is the size itself, not a "
        "difference, a diameter or another unit",
        key, whose, actual, nominal));
  };
  const auto* nominal = std::get_if<cutting::Cutter>(&tool.nominal);
  const auto* actual = std::get_if<cutting::Cutter>(&tool.actual);
  if (nominal != nullptr && actual != nullptr) add("radius_mm", actual->radius, nominal->radius);
  // An actual length equal to the nominal one is the default.
  if (tool.actual_length != tool.length) add("length_mm", tool.actual_length, tool.length);
}

void add_control_texts(const Scene& scene, std::vector<std::string>& warnings) {
  const ControlDescription& control = scene.control;
  if (control.tool_length &&
      std::abs(*control.tool_length - scene.tool.length) > max_wrong_control_mm)
    warnings.push_back(fmt::format(
        "control.tool_length_mm is {:.6g} where the tool is {:.6g} long: it is the length itself "
        "that the control believes",
        *control.tool_length, scene.tool.length));
  const auto& joints = scene.machine.joints;
  for (std::size_t j = 0; j < std::min(joints.size(), control.joints.size()); ++j) {
    const double apart = (control.joints[j].point_b - joints[j].point_b).norm();
    if (joints[j].motion == kinematics::Motion::Rotary && apart > max_wrong_control_mm)
      warnings.push_back(fmt::format(
          "control.axis.{}.point_mm lies {:.4g} mm from that of the machine, and no control is "
          "that wrong: another axis, sign or unit?",
          joints[j].name, apart));
  }
}

/// Checks that fixtures are near the part. Nothing on this machine reaches farther than its longest
/// slide.
void add_fixture_texts(const Scene& scene, std::vector<std::string>& warnings) {
  double longest = 0.0;
  for (const kinematics::Joint& joint : scene.machine.joints)
    if (joint.motion == kinematics::Motion::Linear)
      longest = std::max(longest, joint.max - joint.min);
  for (const BodyDescription& fixture : scene.fixtures) {
    const double apart = (fixture.T.translation() - scene.part.T_wm.translation()).norm();
    if (longest > 0.0 && apart > longest)
      warnings.push_back(fmt::format(
          "fixture \"{}\" lies {:.4g} mm from the part, and the longest slide goes {:.4g} mm: its "
          "at_mm may be in another unit or from another zero",
          fixture.name, apart, longest));
  }
}

/// Checks that the flexible sections of the tool are parts of it; the first one, at the tip, is
/// that of the cutter.
void add_section_texts(const Scene& scene, std::vector<std::string>& warnings) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  const Node* node = scene.tree.get();
  for (const char* key : {"compliance", "tool", "section"})
    if (node != nullptr) node = node->find(key);
  if (cutter == nullptr || node == nullptr || !node->array() || node->array()->empty()) return;
  constexpr double rounded = 1.01;  // sizes are rounded in data sheets
  const auto size_of = [](const Node& section, const char* key) {
    const Node* size = section.find(key);
    return size == nullptr ? 0.0 : number_of(*size).value_or(0.0);
  };
  double length = 0.0;
  for (const Node& section : *node->array()) length += size_of(section, "length_mm");
  if (length > rounded * scene.tool.length)
    warnings.push_back(fmt::format(
        "compliance.tool.section are {:.6g} mm long together, and the tool is {:.6g} mm long",
        length, scene.tool.length));
  const double diameter = size_of(node->array()->front(), "diameter_mm");
  const double widest = 2.0 * std::max(cutter->radius, cutting::shank_radius(*cutter));
  if (diameter > rounded * widest)
    warnings.push_back(fmt::format(
        "compliance.tool.section at the tip is {:.6g} mm thick, and the cutter {:.6g} mm: sections "
        "go from the tip to the spindle",
        diameter, widest));
}

}  // namespace

std::string probable_mistake(std::string_view key, double value) {
  const std::string_view name = part_with_unit(key);
  // Zero turns a term off and has no unit that could be wrong.
  if (value == 0.0 || !std::isfinite(value)) return {};
  if (is_temperature(name)) return mistaken_temperature(value);
  if (const PlausibleRange* range = range_of(key)) {
    const double size = std::abs(value);
    if (size < range->low && !range->below.empty()) return std::string(range->below);
    if (size > range->high) return std::string(range->above);
    return {};
  }
  return name.ends_with("_deg") && resembles_radians(value) ? "radians" : "";
}

std::vector<std::string> value_warnings(const Node& tree) {
  Walk walk;
  walk.visit(tree, "");
  return walk.texts();
}

std::vector<std::string> value_warnings(const Scene& scene) {
  std::vector<std::string> warnings;
  if (scene.tree) warnings = value_warnings(*scene.tree);
  for (const ToolDescription& tool : all_tools(scene)) add_tool_texts(tool, warnings);
  add_control_texts(scene, warnings);
  add_fixture_texts(scene, warnings);
  add_section_texts(scene, warnings);
  // The range of the key allows a negative factor, hence a warning and no error.
  if (scene.belief.scale < 0.0)
    warnings.push_back(fmt::format(
        "belief.scale is {:g}: a compensator adds the errors that it believes in, in place of "
        "taking them away",
        scene.belief.scale));
  if (scene.compliance && scene.compliance->gravity_b && scene.compliance->gravity_b->z() > 0.5)
    warnings.push_back(
        "compliance.gravity points up, along z of the bed: it is the direction in which masses "
        "fall, [0, 0, -1] expected");
  return warnings;
}

}  // namespace abbe::sim
