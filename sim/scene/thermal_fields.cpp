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

namespace abbe::sim {

// ---- effects of heat: elements, expanding axes and an expanding workpiece

/// Returns the fields `element`, `axis` and `workpiece`.
/// @param context  must outlive the fields
Fields<ThermalDescription> thermal_effect_fields(const ThermalContext& context);

namespace {

using Eigen::VectorXd;
using errors::ElementName;
using kinematics::Joint;
using kinematics::Motion;
using Nodes = std::vector<std::string>;

/// Returns the unit of a key that is nothing but a unit, such as "um_per_K". unit_of() requires a
/// stem.
double bare_unit(const std::string& key) { return unit_factor("stem_" + key); }

// ---- functions of temperatures

/// Reads a table of values over temperatures, whose interpolation is known.
errors::Table read_rows(TableReader& reader, const std::string& value_key,
                        const errors::Table& interpolation) {
  const std::size_t error_count = reader.input_errors().list().size();
  VectorXd dT_K = reader.numbers("dT_K");
  VectorXd value = reader.numbers(value_key);
  // A missing or invalid list is reported already.
  if (reader.input_errors().list().size() != error_count || !reader.has("dT_K") ||
      !reader.has(value_key))
    return {};
  if (dT_K.size() != value.size()) {
    reader.report_invalid(value_key,
                          fmt::format("as many values as temperatures, that is {}", dT_K.size()),
                          fmt::format("{}", value.size()));
    return {};
  }
  try {
    return errors::make_table(std::move(dT_K), std::move(value), interpolation.between,
                              interpolation.outside);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("dT_K", "a table with ascending temperatures and at least 2 rows",
                          error.what());
    return {};
  }
}

Fields<errors::Table> rows_fields(const std::string& value_key) {
  return interpolation_fields<errors::Table>().custom_field(
      {make_key(KeyName("dT_K").in_exclusive_group("law"), Key::Kind::Numbers,
                "temperature changes, ascending"),
       make_key(value_key, Key::Kind::Numbers, "values, one for each of `dT_K`")},
      [value_key](TableReader& reader, errors::Table& table) {
        table = read_rows(reader, value_key, table);
      },
      [value_key](const errors::Table& table, Node::Table& entries) {
        put_numbers(entries, "dT_K", table.q, 1.0);
        put_numbers(entries, value_key, table.value, unit_factor(value_key));
      });
}

/// Returns the fields of one term of a thermal function.
/// @param unit  unit of the value, such as "um", or "um_per_m" for a slope
Fields<errors::ThermalFunction::Term> term_fields(const std::string& unit, const Nodes& nodes) {
  using Term = errors::ThermalFunction::Term;
  const std::string per_K = unit + (unit.ends_with("_per_m") ? "_K" : "_per_K");
  const std::string value = "value_" + unit;
  const auto rows = rows_fields(value);
  const auto factor = Fields<Term>().number_in(bare_unit(per_K), required_key(per_K), &Term::per_K,
                                               any_number, "change per kelvin");
  const auto read = [=](TableReader& reader, Term& term) {
    // The term is either a table over temperatures or a factor.
    if (reader.has("dT_K") || reader.has(value)) {
      term.table = rows.read(reader);
      if (reader.accept_key(per_K))
        reader.report_invalid(per_K, "either a table of dT_K or " + per_K, "both");
    } else {
      // The keys of the other form are made known, so that misspelt keys get a suggestion.
      reader.accept_key("dT_K");
      reader.accept_key(value);
      term = factor.read(reader, term);
    }
  };
  const auto write = [=](const Term& term, Node::Table& table) {
    append_entries(table, term.table ? rows.to_table(*term.table) : factor.to_table(term));
  };
  std::vector<Key> keys = rows.keys();
  keys.insert(keys.begin(), factor.keys().front());
  keys.front().required = false;
  keys.front().exclusive_group = "law";
  return node_fields<Term>(required_key("node"), &Term::node, nodes,
                           "node on whose temperature it depends, relative to the reference")
      .include_fields(whole_struct,
                      node_fields<Term>("minus", &Term::minus, nodes,
                                        "dT becomes the difference from this node, as for a tilt"))
      .custom_field(keys, read, write);
}

Fields<errors::ThermalFunction> function_fields(const std::string& stem, const std::string& unit,
                                                const Nodes& nodes) {
  using errors::ThermalFunction;
  return Fields<ThermalFunction>()
      .number(stem + "_" + unit, &ThermalFunction::constant, any_number, "value at dT = 0")
      .tables(stem, &ThermalFunction::terms, term_fields(unit, nodes),
              "temperature terms, which add up");
}

// ---- elements

/// Returns true if the element is an error motion of a slide.
bool is_slide(const ElementName& name, const MachineDescription& machine) {
  if (name.location || name.axis == 'S') return false;
  for (const Joint& joint : machine.joints)
    if (joint.name == name.axis) return joint.motion == Motion::Linear;
  return true;  // check_binding() reports the unknown axis
}

/// Reports keys of an angle in um, or of a length in urad. As unknown keys they would get a message
/// that does not name the cause.
void report_wrong_unit(TableReader& reader, const ElementName& name) {
  const std::string unit = name.is_angle() ? "urad" : "um";
  const std::string wrong_unit = name.is_angle() ? "um" : "urad";
  const std::string stated_name =
      reader.node().find("name") ? *reader.node().find("name")->text() : "";
  for (const std::string& key : {"offset_" + wrong_unit, "slope_" + wrong_unit + "_per_m"})
    if (reader.has(key))
      reader.report_invalid(key, "values of " + stated_name + " in " + unit, key);
}

void report_slope_error(TableReader& reader, const std::string& unit) {
  for (const std::string& key : {std::string("slope"), "slope_" + unit + "_per_m",
                                 std::string("fixed_mm"), std::string("fixed_deg")})
    if (reader.has(key))
      reader.report_invalid(key, "no slope, as only error motions of slides have one", key);
}

Fields<errors::ThermalElement> element_fields(const ElementName& name,
                                              const ThermalContext& context) {
  using errors::ThermalElement;
  const std::string unit = name.is_angle() ? "urad" : "um";
  Fields<ThermalElement> fields;
  fields
      .custom_field(
          {make_key(required_key("name"), Key::Kind::Text,
                    "name, such as `EZS`; the value is offset(T) + slope(T) (p - fixed_mm), where "
                    "p is the commanded position")},
          // The fields depend on the name, so read_element() reads it beforehand.
          [](TableReader& reader, ThermalElement&) { reader.accept_key("name"); },
          [](const ThermalElement& element, Node::Table& table) {
            put_value(table, "name", to_string(element.name));
          })
      .check([name](TableReader& reader, ThermalElement&) { report_wrong_unit(reader, name); })
      .include_fields(&ThermalElement::offset, function_fields("offset", unit, context.nodes));
  // Location elements and the spindle have no position along which a slope would act.
  if (!is_slide(name, context.machine))
    return fields.check(
        [unit](TableReader& reader, ThermalElement&) { report_slope_error(reader, unit); });
  return fields
      .include_fields(&ThermalElement::slope,
                      function_fields("slope", unit + "_per_m", context.nodes))
      .number("fixed_mm", &ThermalElement::fixed, any_number,
              "commanded position at which the slope contributes nothing; only error motions of "
              "slides have a slope");
}

std::optional<errors::ThermalElement> read_element(const Node& table, const ThermalContext& context,
                                                   InputErrors& input_errors) {
  TableReader reader(table, named_table_path("element", table), input_errors);
  const std::size_t error_count = input_errors.list().size();
  errors::ThermalElement element;
  try {
    element.name = errors::parse_element_name(reader.text("name", ""));
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("name", "the name of an element for thermal.element.name", error.what());
    return std::nullopt;  // the other keys depend on the name
  }
  element = element_fields(element.name, context).read(reader, element);
  reader.close();
  if (input_errors.list().size() != error_count) return std::nullopt;
  return element;
}

void read_elements(TableReader& reader, ThermalDescription& thermal,
                   const ThermalContext& context) {
  auto& elements = thermal.errors.elements;
  for (const Node* table : reader.tables("element")) {
    const auto element = read_element(*table, context, reader.input_errors());
    if (!element) continue;
    const SourcePosition& position = table->find("name")->position;
    if (std::any_of(elements.begin(), elements.end(),
                    [&](const auto& other) { return other.name == element->name; })) {
      reader.input_errors().add(position, "each element once (all its terms in one list)",
                                to_string(element->name) + " again");
      continue;
    }
    // Each element is bound separately, so that an error is reported at its position.
    check_binding({{*element}, {}, std::nullopt, 20.0}, context, position, reader.input_errors());
    elements.push_back(*element);
  }
}

Node::Array elements_to_tables(const ThermalDescription& thermal, const ThermalContext& context) {
  Node::Array elements;
  for (const errors::ThermalElement& element : thermal.errors.elements)
    elements.push_back(Node{{}, element_fields(element.name, context).to_table(element)});
  return elements;
}

// ---- expansion

Fields<errors::Expansion> expansion_fields(const Nodes& nodes) {
  using errors::Expansion;
  return node_fields<Expansion>(required_key("node"), &Expansion::node, nodes,
                                "node whose temperature causes the growth")
      .number_in(bare_unit("um_per_m_K"), required_key("um_per_m_K"), &Expansion::per_K, any_number,
                 "coefficient of expansion")
      .number("fixed_mm", &Expansion::fixed, any_number, "commanded position of the fixed end");
}

Fields<errors::AxisExpansion> axis_expansion_fields(const Nodes& nodes) {
  using errors::AxisExpansion;
  using errors::Feedback;
  return Fields<AxisExpansion>()
      .choice(required_key("feedback"), &AxisExpansion::feedback,
              {{"motor", Feedback::Motor, "the growth of the screw has an effect and is required"},
               {"scale", Feedback::Scale, "the growth of the scale has an effect and is required"}},
              "where the position of the axis is measured")
      .table("screw", &AxisExpansion::screw, expansion_fields(nodes),
             "moves the carriage itself away from the fixed end")
      .table("scale", &AxisExpansion::scale, expansion_fields(nodes),
             "moves the carriage itself away from the fixed end");
}

void read_axes(TableReader& reader, ThermalDescription& thermal, const ThermalContext& context) {
  const Node* section = reader.section("axis");
  if (!section) return;
  InputErrors& input_errors = reader.input_errors();
  TableReader axes_reader(*section, "thermal.axis", input_errors);
  for (const Joint& joint : context.machine.joints) {
    // Only slides have a screw and a scale.
    if (joint.motion != Motion::Linear) continue;
    const std::string name(1, joint.name);
    const Node* table = axes_reader.section(name);
    if (!table) continue;
    const std::size_t error_count = input_errors.list().size();
    errors::AxisExpansion default_axis;
    default_axis.axis = joint.name;
    const auto axis =
        axis_expansion_fields(context.nodes)
            .read_table(*table, axes_reader.qualified_name(name), input_errors, default_axis);
    if (input_errors.list().size() == error_count)
      check_binding({{}, {axis}, std::nullopt, 20.0}, context, table->position, input_errors);
    thermal.errors.expansions.push_back(axis);
  }
  // If the machine is invalid, there are no joints, and every axis would be reported as unknown.
  if (!context.machine.joints.empty()) axes_reader.close();
}

Node::Table axes_to_table(const ThermalDescription& thermal, const ThermalContext& context) {
  Node::Table axes;
  for (const errors::AxisExpansion& axis : thermal.errors.expansions)
    put_value(axes, std::string(1, axis.axis), axis_expansion_fields(context.nodes).to_table(axis));
  return axes;
}

Key axes_key(const Nodes& nodes) {
  Key axis = make_key("<axis>", Key::Kind::Table, "growth of one slide");
  axis.pattern = "[XYZUVW]";
  axis.keys = axis_expansion_fields(nodes).keys();
  Key axes = make_key("axis", Key::Kind::Table, "slides whose screw or scale grows");
  axes.keys = {axis};
  return axes;
}

Fields<errors::WorkpieceExpansion> workpiece_expansion_fields(const Nodes& nodes) {
  using errors::WorkpieceExpansion;
  return node_fields<WorkpieceExpansion>(required_key("node"), &WorkpieceExpansion::node, nodes,
                                         "node whose temperature causes the growth")
      .number_in(bare_unit("um_per_m_K"), required_key("um_per_m_K"), &WorkpieceExpansion::per_K,
                 any_number, "coefficient of expansion, below 1000")
      .vector("fixed_mm", &WorkpieceExpansion::fixed_w,
              "point at which it is held, in its own frame");
}

void read_workpiece(TableReader& reader, ThermalDescription& thermal,
                    const ThermalContext& context) {
  const Node* table = reader.section("workpiece");
  if (!table) return;
  InputErrors& input_errors = reader.input_errors();
  const std::size_t error_count = input_errors.list().size();
  const auto workpiece = workpiece_expansion_fields(context.nodes)
                             .read_table(*table, "thermal.workpiece", input_errors);
  if (input_errors.list().size() == error_count)
    check_binding({{}, {}, workpiece, 20.0}, context, table->position, input_errors);
  thermal.errors.workpiece = workpiece;
}

}  // namespace

Fields<ThermalDescription> thermal_effect_fields(const ThermalContext& context) {
  Key elements = make_key("element", Key::Kind::Tables,
                          "thermal contribution to an element, each element once");
  elements.keys = allow_other_unit(element_fields({}, context).keys(), "um", "urad");
  Key workpiece = make_key("workpiece", Key::Kind::Table,
                           "growth of the workpiece, which is judged at 20 deg C (ISO 1) whatever "
                           "the value of `reference_C`");
  workpiece.keys = workpiece_expansion_fields(context.nodes).keys();
  return Fields<ThermalDescription>()
      .custom_field(
          {elements},
          [&context](TableReader& reader, ThermalDescription& thermal) {
            read_elements(reader, thermal, context);
          },
          [&context](const ThermalDescription& thermal, Node::Table& table) {
            Node::Array elements = elements_to_tables(thermal, context);
            if (!elements.empty()) put_value(table, "element", std::move(elements));
          })
      .custom_field(
          {axes_key(context.nodes)},
          [&context](TableReader& reader, ThermalDescription& thermal) {
            read_axes(reader, thermal, context);
          },
          [&context](const ThermalDescription& thermal, Node::Table& table) {
            Node::Table axes = axes_to_table(thermal, context);
            if (!axes.empty()) put_value(table, "axis", std::move(axes));
          })
      .custom_field(
          {workpiece},
          [&context](TableReader& reader, ThermalDescription& thermal) {
            read_workpiece(reader, thermal, context);
          },
          [&context](const ThermalDescription& thermal, Node::Table& table) {
            if (const auto& expansion = thermal.errors.workpiece)
              put_value(table, "workpiece",
                        workpiece_expansion_fields(context.nodes).to_table(*expansion));
          });
}

namespace {

using Plot = ThermalDescription::Plot;

constexpr Eigen::Index max_curves = 50;

/// Returns the default seed of a sensor, the FNV-1a hash of the scene's seed and its name.
std::uint64_t sensor_seed(std::uint64_t scene_seed, const std::string& name) {
  return fnv_1a(name, fnv_1a_basis ^ scene_seed);
}

// ---- sensors

/// @param used_names  names of the preceding sensors
Fields<errors::TemperatureSensor> sensor_fields(const ThermalContext& context,
                                                const std::vector<std::string>& used_names) {
  using errors::TemperatureSensor;
  constexpr std::int64_t max_seed = std::numeric_limits<std::int64_t>::max();
  const std::uint64_t scene_seed = context.seed;
  Key seed_key = make_key(KeyName("seed").with_fallback("from the seed of the scene and the name"),
                          Key::Kind::Whole, "seed of its noise");
  seed_key.range = {0.0, double(max_seed)};
  return Fields<TemperatureSensor>()
      .text(required_key("name"), &TemperatureSensor::name, "name of the sensor; must be unique")
      .check([used_names](TableReader& reader, TemperatureSensor& sensor) {
        check_name_is_free(reader, sensor.name, used_names, "each sensor once");
      })
      .include_fields(whole_struct, node_fields<TemperatureSensor>(
                                        required_key("node"), &TemperatureSensor::node,
                                        context.nodes, "node whose temperature it reads"))
      .number("offset_K", &TemperatureSensor::offset_K, any_number, "reading minus truth")
      .number("noise_K", &TemperatureSensor::noise_K, non_negative,
              "standard deviation, one draw per sample")
      .number("resolution_K", &TemperatureSensor::resolution_K, non_negative,
              "resolution of a reading; 0: not rounded")
      .number("lag_s", &TemperatureSensor::lag_s, non_negative,
              "time constant of the sensor's own mass")
      .number("sampling_s", &TemperatureSensor::sampling_s, {1e-4, max_time_s},
              "interval between samples; the last reading is held in between")
      .custom_field(
          {seed_key},
          [scene_seed](TableReader& reader, TemperatureSensor& sensor) {
            const auto stated_seed = reader.maybe_integer("seed", 0, max_seed);
            sensor.seed =
                stated_seed ? std::uint64_t(*stated_seed) : sensor_seed(scene_seed, sensor.name);
          },
          [scene_seed](const TemperatureSensor& sensor, Node::Table& table) {
            if (sensor.seed != sensor_seed(scene_seed, sensor.name))
              put_value(table, "seed", std::int64_t(sensor.seed));
          });
}

void read_sensors(TableReader& reader, ThermalDescription& thermal, const ThermalContext& context) {
  std::vector<std::string> names;
  for (const Node* table : reader.tables("sensor")) {
    thermal.sensors.push_back(
        sensor_fields(context, names)
            .read_table(*table, named_table_path("sensor", *table), reader.input_errors()));
    names.push_back(thermal.sensors.back().name);
  }
}

// ---- plots

const Joint* find_joint_by_letter(char axis, const ThermalContext& context) {
  for (const Joint& joint : context.machine.joints)
    if (joint.name == axis) return &joint;
  return nullptr;
}

std::string range_key(const Joint& joint) {
  return joint.motion == Motion::Linear ? "range_mm" : "range_deg";
}

void read_plotted_element(TableReader& reader, Plot& plot) {
  const std::string name = reader.text("element");
  try {
    if (!name.empty()) plot.element = errors::parse_element_name(name);
  } catch (const std::invalid_argument& error) {
    reader.report_invalid("element", "the name of an element for thermal.plot.element",
                          error.what());
  }
  // Location elements and the spindle have a single value and no curve.
  if (plot.element.location || plot.element.axis == 'S')
    reader.report_invalid("element", "an error motion of an axis, which has a curve", name);
}

void read_plot_times(TableReader& reader, Plot& plot) {
  const auto key = time_key(reader, "at");
  if (key) plot.time_s = reader.numbers(*key);
  if (plot.time_s.size() > max_curves)
    reader.report_invalid(*key, fmt::format("at most {} curves", max_curves),
                          fmt::format("{}", plot.time_s.size()));
}

void read_range(TableReader& reader, Plot& plot, const ThermalContext& context) {
  const Joint* joint = find_joint_by_letter(plot.element.axis, context);
  if (!joint) {  // check_binding() reports the unknown axis
    reader.accept_key("range_mm");
    reader.accept_key("range_deg");
    return;
  }
  const std::string key = range_key(*joint);
  const auto range = reader.maybe_numbers(key, 2);
  if (!range) return;
  const double min = (*range)[0], max = (*range)[1], unit = unit_factor(key);
  // The curve can be computed within the travel only.
  if (min < max && min >= joint->min && max <= joint->max) {
    plot.range = std::array{min, max};
    return;
  }
  reader.report_invalid(
      key,
      fmt::format("an ascending range within the travel, {} .. {}, for thermal.plot.{}",
                  joint->min / unit, joint->max / unit, key),
      fmt::format("{} .. {}", min / unit, max / unit));
}

void write_range(const Plot& plot, Node::Table& table, const ThermalContext& context) {
  const Joint* joint = find_joint_by_letter(plot.element.axis, context);
  if (!plot.range || !joint) return;
  const std::string key = range_key(*joint);
  put_numbers(table, key, Eigen::Vector2d(plot.range->front(), plot.range->back()),
              unit_factor(key));
}

/// @param other_plots  preceding plots, which must be of other elements
Fields<Plot> plot_fields(const ThermalContext& context, const std::vector<Plot>& other_plots) {
  Key range = make_key(
      KeyName("range_mm")
          .with_fallback("all of the travel, at most 2000 mm or one turn in either direction"),
      Key::Kind::Numbers, "range `[from, to]` of the travel over which the curve is drawn");
  range.size = 2;
  const auto report_repeated_name = [other_plots](TableReader& reader, Plot& plot) {
    const Node* name = reader.node().find("element");
    for (const Plot& other : other_plots)
      if (other.element == plot.element)
        reader.report_invalid("element", "one plot per element",
                              (name && name->text() ? *name->text() : "") + " again");
  };
  return Fields<Plot>()
      .custom_field(
          {make_key(required_key("element"), Key::Kind::Text,
                    "error motion of an axis, whose curve is drawn in `EXX-temperatures.png`")},
          read_plotted_element,
          [](const Plot& plot, Node::Table& table) {
            put_value(table, "element", to_string(plot.element));
          })
      .custom_field(time_keys("at", Key::Kind::Numbers,
                              "instants, at most 50, each with the temperatures that the curve "
                              "depends on; negative before the program"),
                    read_plot_times,
                    [](const Plot& plot, Node::Table& table) {
                      put_numbers(table, "at_s", plot.time_s, 1.0);
                    })
      .check(report_repeated_name)
      .custom_field(
          allow_other_unit({range}, "mm", "deg"),
          [&context](TableReader& reader, Plot& plot) { read_range(reader, plot, context); },
          [&context](const Plot& plot, Node::Table& table) { write_range(plot, table, context); });
}

void read_plots(TableReader& reader, ThermalDescription& thermal, const ThermalContext& context) {
  InputErrors& input_errors = reader.input_errors();
  for (const Node* table : reader.tables("plot")) {
    const std::size_t error_count = input_errors.list().size();
    const Plot plot =
        plot_fields(context, thermal.plots).read_table(*table, "thermal.plot", input_errors);
    if (input_errors.list().size() != error_count) continue;
    check_binding({{{plot.element, {}, {}, 0.0}}, {}, std::nullopt, 20.0}, context,
                  table->find("element")->position, input_errors);
    thermal.plots.push_back(plot);
  }
}

// ---- the section

/// Returns the fields that are read before the links, which refer to nodes by name.
Fields<ThermalDescription> room_and_node_fields() {
  return Fields<ThermalDescription>()
      .remark("name", "name of the table")
      .include_fields(whole_struct, room_fields())
      .include_fields(whole_struct, thermal_node_fields());
}

Fields<ThermalDescription> state_fields() {
  using Thermal = ThermalDescription;
  return Fields<Thermal>()
      .number("scale", &Thermal::scale, {-1e6, 1e6},
              "factor of all thermal effects on elements, axes and workpiece; temperatures are "
              "unaffected")
      .number(
          "reference_C", [](auto& thermal) -> auto& { return thermal.errors.reference_T_C; },
          temperature_range,
          "temperature at which elements and growth are zero: dT is a node's temperature minus "
          "this")
      .boolean("powered", &Thermal::powered, "the machine is switched on while the program runs")
      .boolean("coolant", &Thermal::coolant, "the coolant flows while the program runs")
      .number("coolant_C", &Thermal::coolant_T_C, temperature_range, "temperature of the coolant")
      .number("interval_s", &Thermal::interval, {1e-3, max_time_s},
              "interval over which speeds and cutting power are averaged during the program");
}

/// Returns the fields that are read after the links.
/// @param context  must outlive the fields
Fields<ThermalDescription> source_and_effect_fields(const ThermalContext& context) {
  using Thermal = ThermalDescription;
  return Fields<Thermal>()
      .include_fields(whole_struct, thermal_source_fields(context))
      .include_fields(whole_struct, thermal_effect_fields(context))
      .tables("sensor", &Thermal::sensors, sensor_fields(context, {}),
              "temperature sensor of the control",
              [&context](TableReader& reader, Thermal& thermal) {
                read_sensors(reader, thermal, context);
              })
      .include_fields(whole_struct, history_fields(context))
      .tables("plot", &Thermal::plots, plot_fields(context, {}),
              "picture of the thermal effect on an element",
              [&context](TableReader& reader, Thermal& thermal) {
                read_plots(reader, thermal, context);
              })
      .include_fields(whole_struct, state_fields());
}

Fields<ThermalDescription> thermal_fields(const ThermalContext& context) {
  return room_and_node_fields()
      .include_fields(whole_struct, thermal_link_fields(context.nodes))
      .include_fields(whole_struct, source_and_effect_fields(context));
}

}  // namespace

ThermalDescription read_thermal(const Node& table, const MachineDescription& machine,
                                std::uint64_t seed, InputErrors& input_errors) {
  TableReader reader(table, "thermal", input_errors);
  const std::size_t error_count = input_errors.list().size();
  ThermalDescription thermal = room_and_node_fields().read(reader);
  // Too many nodes are not read, so the links would refer to unknown nodes.
  if (has_too_many_nodes(reader)) return thermal;
  const ThermalContext context = thermal_context(machine, thermal.network, seed);
  thermal = thermal_link_fields(context.nodes).read(reader, std::move(thermal));
  // After an input error the network is incomplete and cannot be checked.
  const bool is_complete = input_errors.list().size() == error_count && reader.has("node");
  thermal = source_and_effect_fields(context).read(reader, std::move(thermal));
  reader.close();
  if (is_complete) check_network(thermal.network, reader);
  return thermal;
}

Node::Table thermal_to_table(const ThermalDescription& thermal, const MachineDescription& machine,
                             std::uint64_t seed) {
  const ThermalContext context = thermal_context(machine, thermal.network, seed);
  return thermal_fields(context).to_table(thermal);
}

std::vector<Key> thermal_keys() {
  const ThermalContext context;
  return thermal_fields(context).keys();
}

}  // namespace abbe::sim
