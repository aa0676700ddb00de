#include <algorithm>
#include <array>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/hash.h"
#include "sim/scene/error_tables.h"
#include "sim/scene/fields.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/thermal.h"
#include "sim/scene/thermal_network.h"

/// Effects of heat on the machine: elements, expanding axes and an expanding workpiece.
namespace abbe::sim {

/// Returns the fields `element`, `axis` and `workpiece`. @param setting  must outlive the fields
Fields<ThermalDescription> thermal_effect_fields(const ThermalSetting& setting);

namespace {

using Eigen::VectorXd;
using errors::ElementName;
using kinematics::Joint;
using kinematics::Motion;
using Nodes = std::vector<std::string>;

/// Returns the unit of a key that consists of a unit, such as "um_per_K"; unit_of() requires a stem
/// in front of it.
double whole_unit(const std::string& key) { return unit_of("in_" + key); }

// ---- functions of temperatures

errors::Table read_rows(TableReader& reader, const std::string& value_key,
                        const errors::Table& how) {
  const std::size_t before = reader.input_errors().list().size();
  VectorXd dT_K = reader.numbers("dT_K");
  VectorXd value = reader.numbers(value_key);
  // Both lists are needed for a table, and a missing one is reported by the reader.
  if (reader.input_errors().list().size() != before || !reader.has("dT_K") ||
      !reader.has(value_key))
    return {};
  if (dT_K.size() != value.size()) {
    reader.refuse(value_key, fmt::format("as many values as temperatures, {}", dT_K.size()),
                  fmt::format("{}", value.size()));
    return {};
  }
  try {
    return errors::make_table(std::move(dT_K), std::move(value), how.between, how.outside);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("dT_K", "a table with rising temperatures and at least 2 rows", fault.what());
    return {};
  }
}

Fields<errors::Table> rows_fields(const std::string& value_key) {
  return interpolation_fields<errors::Table>().custom(
      {make_key(KeyName("dT_K").one_of("law"), Key::Kind::Numbers,
                "changes of temperature, rising"),
       make_key(value_key, Key::Kind::Numbers, "one for each of `dT_K`")},
      [value_key](TableReader& reader, errors::Table& table) {
        table = read_rows(reader, value_key, table);
      },
      [value_key](const errors::Table& from, Node::Table& to) {
        put_numbers(to, "dT_K", from.q, 1.0);
        put_numbers(to, value_key, from.value, unit_of(value_key));
      });
}

/// @param unit  of the value: "um", for a slope "um_per_m"
Fields<errors::ThermalFunction::Term> term_fields(const std::string& unit, const Nodes& nodes) {
  using Term = errors::ThermalFunction::Term;
  const std::string per_K = unit + (unit.ends_with("_per_m") ? "_K" : "_per_K");
  const std::string value = "value_" + unit;
  const auto rows = rows_fields(value);
  const auto factor = Fields<Term>().number_in(whole_unit(per_K), must(per_K), &Term::per_K,
                                               any_number, "change for a change of temperature");
  const auto read = [=](TableReader& reader, Term& term) {
    // A table of temperatures and a factor are two forms of the same law, so only one may be given.
    if (reader.has("dT_K") || reader.has(value)) {
      term.table = rows.read(reader);
      if (reader.accept_key(per_K))
        reader.refuse(per_K, "either a table of dT_K or " + per_K, "both");
    } else {
      // The keys of the other form become known, which lets a misspelling find them.
      reader.accept_key("dT_K");
      reader.accept_key(value);
      term = factor.read(reader, term);
    }
  };
  const auto write = [=](const Term& from, Node::Table& to) {
    for (Node::Entry& entry : from.table ? rows.written(*from.table) : factor.written(from))
      to.push_back(std::move(entry));
  };
  std::vector<Key> keys = rows.keys();
  keys.insert(keys.begin(), factor.keys().front());
  keys.front().required = false;
  keys.front().either = "law";
  return node_fields<Term>(must("node"), &Term::node, nodes,
                           "on whose temperature it depends, less the reference")
      .all_of(std::identity{},
              node_fields<Term>("minus", &Term::minus, nodes,
                                "dT is then the difference to this node, as a tilt takes it"))
      .custom(keys, read, write);
}

Fields<errors::ThermalFunction> function_fields(const std::string& stem, const std::string& unit,
                                                const Nodes& nodes) {
  using errors::ThermalFunction;
  return Fields<ThermalFunction>()
      .number(stem + "_" + unit, &ThermalFunction::constant, any_number, "constant at dT = 0")
      .tables(stem, &ThermalFunction::terms, term_fields(unit, nodes),
              "terms of temperatures, which add up");
}

// ---- elements

bool is_slide(const ElementName& name, const MachineDescription& machine) {
  if (name.location || name.axis == 'S') return false;
  for (const Joint& joint : machine.joints)
    if (joint.name == name.axis) return joint.motion == Motion::Linear;
  return true;  // no such axis, which is rejected when bound
}

void refuse_wrong_unit(TableReader& reader, const ElementName& name) {
  // The name decides the unit; a generic message on an unknown key would not say so.
  const std::string unit = name.is_angle() ? "urad" : "um", wrong = name.is_angle() ? "um" : "urad";
  const std::string written = reader.node().find("name") ? *reader.node().find("name")->text() : "";
  for (const std::string& key : {"offset_" + wrong, "slope_" + wrong + "_per_m"})
    if (reader.has(key)) reader.refuse(key, "values of " + written + " in " + unit, key);
}

void report_slope_error(TableReader& reader, const std::string& unit) {
  for (const std::string& key : {std::string("slope"), "slope_" + unit + "_per_m",
                                 std::string("fixed_mm"), std::string("fixed_deg")})
    if (reader.has(key)) reader.refuse(key, "no slope: only a slide's error motion has one", key);
}

Fields<errors::ThermalElement> element_fields(const ElementName& name,
                                              const ThermalSetting& setting) {
  using errors::ThermalElement;
  const std::string unit = name.is_angle() ? "urad" : "um";
  Fields<ThermalElement> fields;
  fields
      .custom(
          {make_key(must("name"), Key::Kind::Text,
                    "as `EZS`; its value is offset(T) + slope(T) (p - fixed_mm), p the commanded "
                    "position")},
          [](TableReader& reader, ThermalElement&) { reader.accept_key("name"); },  // read before
          [](const ThermalElement& from, Node::Table& to) {
            put(to, "name", to_string(from.name));
          })
      .check([name](TableReader& reader, ThermalElement&) { refuse_wrong_unit(reader, name); })
      .all_of(&ThermalElement::offset, function_fields("offset", unit, setting.nodes));
  // A location element and the spindle have no position over which a slope could act.
  if (!is_slide(name, setting.machine))
    return fields.check(
        [unit](TableReader& reader, ThermalElement&) { report_slope_error(reader, unit); });
  return fields
      .all_of(&ThermalElement::slope, function_fields("slope", unit + "_per_m", setting.nodes))
      .number("fixed_mm", &ThermalElement::fixed, any_number,
              "commanded position where the slope adds nothing; slopes are of error motions of "
              "slides");
}

std::optional<errors::ThermalElement> read_element(const Node& table, const ThermalSetting& setting,
                                                   InputErrors& input_errors) {
  TableReader reader(table, named_table_path("element", table), input_errors);
  const std::size_t before = input_errors.list().size();
  errors::ThermalElement element;
  try {
    element.name = errors::parse_element_name(reader.text("name", ""));
  } catch (const std::invalid_argument& fault) {
    reader.refuse("name", "the name of an element for thermal.element.name", fault.what());
    return std::nullopt;  // the other keys depend on the name
  }
  element = element_fields(element.name, setting).read(reader, element);
  reader.close();
  if (input_errors.list().size() != before) return std::nullopt;
  return element;
}

void read_elements(TableReader& reader, ThermalDescription& thermal,
                   const ThermalSetting& setting) {
  auto& elements = thermal.errors.elements;
  for (const Node* table : reader.tables("element")) {
    const auto element = read_element(*table, setting, reader.input_errors());
    if (!element) continue;
    const Place& place = table->find("name")->place;
    if (std::any_of(elements.begin(), elements.end(),
                    [&](const auto& other) { return other.name == element->name; })) {
      reader.input_errors().add(place, "each element once (its terms are one list)",
                                to_string(element->name) + " again");
      continue;
    }
    // Each element is bound alone, so that an error is reported at its own position.
    check_binding({{*element}, {}, std::nullopt, 20.0}, setting, place, reader.input_errors());
    elements.push_back(*element);
  }
}

Node::Array written_elements(const ThermalDescription& thermal, const ThermalSetting& setting) {
  Node::Array all;
  for (const errors::ThermalElement& one : thermal.errors.elements)
    all.push_back(Node{{}, element_fields(one.name, setting).written(one)});
  return all;
}

// ---- growth

Fields<errors::Expansion> expansion_fields(const Nodes& nodes) {
  using errors::Expansion;
  return node_fields<Expansion>(must("node"), &Expansion::node, nodes,
                                "with whose temperature it grows")
      .number_in(whole_unit("um_per_m_K"), must("um_per_m_K"), &Expansion::per_K, any_number,
                 "growth")
      .number("fixed_mm", &Expansion::fixed, any_number,
              "commanded position of the end that stays");
}

Fields<errors::AxisExpansion> axis_fields(const Nodes& nodes) {
  using errors::AxisExpansion;
  using errors::Feedback;
  return Fields<AxisExpansion>()
      .word(must("feedback"), &AxisExpansion::feedback,
            {{"motor", Feedback::Motor, "the growth of the screw shows, which must be there"},
             {"scale", Feedback::Scale, "the growth of the scale shows, which must be there"}},
            "where the axis is measured")
      .table("screw", &AxisExpansion::screw, expansion_fields(nodes),
             "moves the carriage itself away from the end that stays")
      .table("scale", &AxisExpansion::scale, expansion_fields(nodes),
             "moves the carriage itself away from the end that stays");
}

void read_axes(TableReader& reader, ThermalDescription& thermal, const ThermalSetting& setting) {
  const Node* section = reader.section("axis");
  if (!section) return;
  InputErrors& input_errors = reader.input_errors();
  TableReader axes(*section, "thermal.axis", input_errors);
  for (const Joint& joint : setting.machine.joints) {
    // Only slides have a screw or a scale that can grow.
    if (joint.motion != Motion::Linear) continue;
    const std::string name(1, joint.name);
    const Node* table = axes.section(name);
    if (!table) continue;
    const std::size_t before = input_errors.list().size();
    errors::AxisExpansion start;
    start.axis = joint.name;
    const auto axis =
        axis_fields(setting.nodes).read_table(*table, axes.name_of(name), input_errors, start);
    if (input_errors.list().size() == before)
      check_binding({{}, {axis}, std::nullopt, 20.0}, setting, table->place, input_errors);
    thermal.errors.expansions.push_back(axis);
  }
  // With an unreadable machine every axis would look unknown.
  if (!setting.machine.joints.empty()) axes.close();
}

Node::Table written_axes(const ThermalDescription& thermal, const ThermalSetting& setting) {
  Node::Table axes;
  for (const errors::AxisExpansion& axis : thermal.errors.expansions)
    put(axes, std::string(1, axis.axis), axis_fields(setting.nodes).written(axis));
  return axes;
}

Key axes_key(const Nodes& nodes) {
  Key axis = make_key("<axis>", Key::Kind::Table, "growth of one slide");
  axis.pattern = "[XYZUVW]";
  axis.keys = axis_fields(nodes).keys();
  Key axes = make_key("axis", Key::Kind::Table, "slides whose screw or scale grows");
  axes.keys = {axis};
  return axes;
}

Fields<errors::WorkpieceExpansion> workpiece_fields(const Nodes& nodes) {
  using errors::WorkpieceExpansion;
  return node_fields<WorkpieceExpansion>(must("node"), &WorkpieceExpansion::node, nodes,
                                         "with whose temperature it grows")
      .number_in(whole_unit("um_per_m_K"), must("um_per_m_K"), &WorkpieceExpansion::per_K,
                 any_number, "growth, below 1000")
      .vector("fixed_mm", &WorkpieceExpansion::fixed_w, "where it is held, in its own frame");
}

void read_workpiece(TableReader& reader, ThermalDescription& thermal,
                    const ThermalSetting& setting) {
  const Node* table = reader.section("workpiece");
  if (!table) return;
  InputErrors& input_errors = reader.input_errors();
  const std::size_t before = input_errors.list().size();
  const auto workpiece =
      workpiece_fields(setting.nodes).read_table(*table, "thermal.workpiece", input_errors);
  if (input_errors.list().size() == before)
    check_binding({{}, {}, workpiece, 20.0}, setting, table->place, input_errors);
  thermal.errors.workpiece = workpiece;
}

}  // namespace

Fields<ThermalDescription> thermal_effect_fields(const ThermalSetting& setting) {
  Key elements = make_key("element", Key::Kind::Tables, "what heat adds to an element, each once");
  elements.keys = with_other_unit(element_fields({}, setting).keys(), "um", "urad");
  Key workpiece = make_key("workpiece", Key::Kind::Table,
                           "growth of the workpiece, which is judged at 20 deg C (ISO 1), whatever "
                           "`reference_C` is");
  workpiece.keys = workpiece_fields(setting.nodes).keys();
  return Fields<ThermalDescription>()
      .custom(
          {elements},
          [&setting](TableReader& reader, ThermalDescription& thermal) {
            read_elements(reader, thermal, setting);
          },
          [&setting](const ThermalDescription& from, Node::Table& to) {
            Node::Array all = written_elements(from, setting);
            if (!all.empty()) put(to, "element", std::move(all));
          })
      .custom(
          {axes_key(setting.nodes)},
          [&setting](TableReader& reader, ThermalDescription& thermal) {
            read_axes(reader, thermal, setting);
          },
          [&setting](const ThermalDescription& from, Node::Table& to) {
            Node::Table axes = written_axes(from, setting);
            if (!axes.empty()) put(to, "axis", std::move(axes));
          })
      .custom(
          {workpiece},
          [&setting](TableReader& reader, ThermalDescription& thermal) {
            read_workpiece(reader, thermal, setting);
          },
          [&setting](const ThermalDescription& from, Node::Table& to) {
            if (const auto& grown = from.errors.workpiece)
              put(to, "workpiece", workpiece_fields(setting.nodes).written(*grown));
          });
}

namespace {

using Plot = ThermalDescription::Plot;

constexpr Eigen::Index max_curves = 50;

/// Returns the FNV-1a hash of the scene's seed and a name, so that every sensor has its own noise.
std::uint64_t seed_of(std::uint64_t seed, const std::string& name) {
  return fnv_1a(name, fnv_1a_basis ^ seed);
}

// ---- sensors

/// @param taken  names of the sensors before it
Fields<errors::TemperatureSensor> sensor_fields(const ThermalSetting& setting,
                                                const std::vector<std::string>& taken) {
  using errors::TemperatureSensor;
  constexpr std::int64_t max_seed = std::numeric_limits<std::int64_t>::max();
  const std::uint64_t scene = setting.seed;
  Key seed = make_key(KeyName("seed").otherwise("from the scene's and the name"), Key::Kind::Whole,
                      "of its noise");
  seed.range = {0.0, double(max_seed)};
  return Fields<TemperatureSensor>()
      .text(must("name"), &TemperatureSensor::name, "of the sensor, each once")
      .check([taken](TableReader& reader, TemperatureSensor& sensor) {
        check_name_is_free(reader, sensor.name, taken, "every sensor once");
      })
      .all_of(std::identity{},
              node_fields<TemperatureSensor>(must("node"), &TemperatureSensor::node, setting.nodes,
                                             "whose temperature it reads"))
      .number("offset_K", &TemperatureSensor::offset_K, any_number, "reading minus truth")
      .number("noise_K", &TemperatureSensor::noise_K, non_negative,
              "standard deviation, one draw a sample")
      .number("resolution_K", &TemperatureSensor::resolution_K, non_negative, "0: not rounded")
      .number("lag_s", &TemperatureSensor::lag_s, non_negative,
              "time constant of the sensor's own mass")
      .number("sampling_s", &TemperatureSensor::sampling_s, {1e-4, longest_s},
              "between samples, between which the last reading stands")
      .custom(
          {seed},
          [scene](TableReader& reader, TemperatureSensor& sensor) {
            const auto own = reader.maybe_integer("seed", 0, max_seed);
            sensor.seed = own ? std::uint64_t(*own) : seed_of(scene, sensor.name);
          },
          [scene](const TemperatureSensor& from, Node::Table& to) {
            // A derived seed is left out, because it follows from the scene again.
            if (from.seed != seed_of(scene, from.name)) put(to, "seed", std::int64_t(from.seed));
          });
}

void read_sensors(TableReader& reader, ThermalDescription& thermal, const ThermalSetting& setting) {
  std::vector<std::string> names;
  for (const Node* table : reader.tables("sensor")) {
    thermal.sensors.push_back(
        sensor_fields(setting, names)
            .read_table(*table, named_table_path("sensor", *table), reader.input_errors()));
    names.push_back(thermal.sensors.back().name);
  }
}

// ---- plots

const Joint* joint_of(char axis, const ThermalSetting& setting) {
  for (const Joint& joint : setting.machine.joints)
    if (joint.name == axis) return &joint;
  return nullptr;
}

std::string range_key(const Joint& joint) {
  return joint.motion == Motion::Linear ? "range_mm" : "range_deg";
}

void read_plotted(TableReader& reader, Plot& plot) {
  const std::string name = reader.text("element");
  try {
    if (!name.empty()) plot.element = errors::parse_element_name(name);
  } catch (const std::invalid_argument& fault) {
    reader.refuse("element", "the name of an element for thermal.plot.element", fault.what());
  }
  // Location elements and the spindle have one value, not a curve over a position.
  if (plot.element.location || plot.element.axis == 'S')
    reader.refuse("element", "an error motion of an axis, which has a curve", name);
}

void read_instants(TableReader& reader, Plot& plot) {
  const auto key = time_key(reader, "at");
  if (key) plot.time_s = reader.numbers(*key);
  if (plot.time_s.size() > max_curves)
    reader.refuse(*key, fmt::format("at most {} curves", max_curves),
                  fmt::format("{}", plot.time_s.size()));
}

void read_range(TableReader& reader, Plot& plot, const ThermalSetting& setting) {
  const Joint* joint = joint_of(plot.element.axis, setting);
  if (!joint) {  // reported already
    reader.accept_key("range_mm");
    reader.accept_key("range_deg");
    return;
  }
  const std::string key = range_key(*joint);
  const auto range = reader.maybe_numbers(key, 2);
  if (!range) return;
  const double from = (*range)[0], to = (*range)[1], unit = unit_of(key);
  // The curve is computed for positions within the travel only.
  if (from < to && from >= joint->min && to <= joint->max) {
    plot.range = std::array{from, to};
    return;
  }
  reader.refuse(key,
                fmt::format("a rising range within the travel, {} .. {}, for thermal.plot.{}",
                            joint->min / unit, joint->max / unit, key),
                fmt::format("{} .. {}", from / unit, to / unit));
}

void write_range(const Plot& from, Node::Table& to, const ThermalSetting& setting) {
  const Joint* joint = joint_of(from.element.axis, setting);
  if (!from.range || !joint) return;
  const std::string key = range_key(*joint);
  put_numbers(to, key, Eigen::Vector2d(from.range->front(), from.range->back()), unit_of(key));
}

/// @param before  plots of other elements
Fields<Plot> plot_fields(const ThermalSetting& setting, const std::vector<Plot>& before) {
  Key range = make_key(
      KeyName("range_mm").otherwise("all of the travel, at most 2000 mm or a turn either way"),
      Key::Kind::Numbers, "`[from, to]` within the travel over which the curve is drawn");
  range.size = 2;
  const auto report_repeated_name = [before](TableReader& reader, Plot& plot) {
    const Node* name = reader.node().find("element");
    for (const Plot& other : before)
      if (other.element == plot.element)
        reader.refuse("element", "one plot an element",
                      (name && name->text() ? *name->text() : "") + " again");
  };
  return Fields<Plot>()
      .custom(
          {make_key(must("element"), Key::Kind::Text,
                    "error motion of an axis, whose curve is drawn in `EXX-temperatures.png`")},
          read_plotted,
          [](const Plot& from, Node::Table& to) { put(to, "element", to_string(from.element)); })
      .custom(time_keys("at", Key::Kind::Numbers,
                        "instants, at most 50, each with the temperatures that the curve depends "
                        "on; before the program negative"),
              read_instants,
              [](const Plot& from, Node::Table& to) { put_numbers(to, "at_s", from.time_s, 1.0); })
      .check(report_repeated_name)
      .custom(
          with_other_unit({range}, "mm", "deg"),
          [&setting](TableReader& reader, Plot& plot) { read_range(reader, plot, setting); },
          [&setting](const Plot& from, Node::Table& to) { write_range(from, to, setting); });
}

void read_plots(TableReader& reader, ThermalDescription& thermal, const ThermalSetting& setting) {
  InputErrors& input_errors = reader.input_errors();
  for (const Node* table : reader.tables("plot")) {
    const std::size_t before = input_errors.list().size();
    const Plot plot =
        plot_fields(setting, thermal.plots).read_table(*table, "thermal.plot", input_errors);
    if (input_errors.list().size() != before) continue;
    check_binding({{{plot.element, {}, {}, 0.0}}, {}, std::nullopt, 20.0}, setting,
                  table->find("element")->place, input_errors);
    thermal.plots.push_back(plot);
  }
}

// ---- the section

/// Returns the fields that precede the links, which refer to nodes by name.
Fields<ThermalDescription> first_fields() {
  const auto itself = std::identity{};
  return Fields<ThermalDescription>()
      .custom(
          {make_key("name", Key::Kind::Text, "of the table, for people")},
          [](TableReader& reader, ThermalDescription&) { reader.text("name", ""); },
          [](const ThermalDescription&, Node::Table&) {})
      .all_of(itself, room_fields())
      .all_of(itself, thermal_node_fields());
}

Fields<ThermalDescription> state_fields() {
  using Thermal = ThermalDescription;
  return Fields<Thermal>()
      .number("scale", &Thermal::scale, {-1e6, 1e6},
              "factor of all that heat does to elements, axes and workpiece; temperatures stay")
      .number(
          "reference_C", [](auto& thermal) -> auto& { return thermal.errors.reference_T_C; },
          temperature_range,
          "at which elements and growth are zero: dT is a node's temperature minus this")
      .boolean("powered", &Thermal::powered, "the machine is switched on while the program runs")
      .boolean("coolant", &Thermal::coolant, "the coolant flows while the program runs")
      .number("coolant_C", &Thermal::coolant_T_C, temperature_range, "temperature of the coolant")
      .number("interval_s", &Thermal::interval, {1e-3, longest_s},
              "in the program speeds and cutting power are averaged over stretches of this length");
}

/// Returns the fields that follow the links. @param setting  must outlive the fields
Fields<ThermalDescription> last_fields(const ThermalSetting& setting) {
  using Thermal = ThermalDescription;
  const auto itself = std::identity{};
  return Fields<Thermal>()
      .all_of(itself, thermal_source_fields(setting))
      .all_of(itself, thermal_effect_fields(setting))
      .tables("sensor", &Thermal::sensors, sensor_fields(setting, {}),
              "temperature sensor of the control",
              [&setting](TableReader& reader, Thermal& to) { read_sensors(reader, to, setting); })
      .all_of(itself, history_fields(setting))
      .tables("plot", &Thermal::plots, plot_fields(setting, {}),
              "picture of what heat does to an element",
              [&setting](TableReader& reader, Thermal& to) { read_plots(reader, to, setting); })
      .all_of(itself, state_fields());
}

Fields<ThermalDescription> thermal_fields(const ThermalSetting& setting) {
  const auto itself = std::identity{};
  return first_fields()
      .all_of(itself, thermal_link_fields(setting.nodes))
      .all_of(itself, last_fields(setting));
}

}  // namespace

ThermalDescription read_thermal(const Node& table, const MachineDescription& machine,
                                std::uint64_t seed, InputErrors& input_errors) {
  TableReader reader(table, "thermal", input_errors);
  const std::size_t before = input_errors.list().size();
  ThermalDescription thermal = first_fields().read(reader);
  // The nodes were dropped, so every name in the other sections would be unknown.
  if (has_too_many_nodes(reader)) return thermal;
  const ThermalSetting setting = thermal_setting(machine, thermal.network, seed);
  thermal = thermal_link_fields(setting.nodes).read(reader, std::move(thermal));
  // The network is checked as a whole only if each of its parts is correct.
  const bool whole = input_errors.list().size() == before && reader.has("node");
  thermal = last_fields(setting).read(reader, std::move(thermal));
  reader.close();
  if (whole) check_network(thermal.network, reader);
  return thermal;
}

Node::Table written_thermal(const ThermalDescription& thermal, const MachineDescription& machine,
                            std::uint64_t seed) {
  const ThermalSetting setting = thermal_setting(machine, thermal.network, seed);
  return thermal_fields(setting).written(thermal);
}

std::vector<Key> thermal_keys() {
  const ThermalSetting setting;
  return thermal_fields(setting).keys();
}

}  // namespace abbe::sim
