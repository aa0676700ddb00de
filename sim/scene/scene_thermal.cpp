#include <algorithm>
#include <array>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/scene/scene_sections.h"
#include "sim/scene/scene_thermal_day.h"
#include "sim/scene/scene_thermal_elements.h"
#include "sim/scene/scene_thermal_network.h"

namespace abbe::sim {

namespace {

using kinematics::Joint;
using kinematics::Motion;
using Plot = ThermalDescription::Plot;

constexpr Eigen::Index most_curves = 50;

/// FNV-1a of the scene's seed and a name: every sensor has a noise of its own.
std::uint64_t seed_of(std::uint64_t seed, const std::string& name) {
  std::uint64_t hash = 0xcbf29ce484222325u ^ seed;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return hash;
}

// ---- sensors

/// @param taken  names of the sensors before it
Fields<errors::TemperatureSensor> sensor_fields(const ThermalSetting& setting,
                                                const std::vector<std::string>& taken) {
  using errors::TemperatureSensor;
  constexpr std::int64_t most_seed = std::numeric_limits<std::int64_t>::max();
  const std::uint64_t scene = setting.seed;
  Key seed = key_of(KeyName("seed").otherwise("from the scene's and the name"), Key::Kind::Whole,
                    "of its noise");
  seed.range = {0.0, double(most_seed)};
  return Fields<TemperatureSensor>()
      .text(must("name"), &TemperatureSensor::name, "of the sensor, each once")
      .check([taken](TableReader& reader, TemperatureSensor& sensor) {
        refuse_taken(reader, sensor.name, taken, "every sensor once");
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
            const auto own = reader.maybe_integer("seed", 0, most_seed);
            sensor.seed = own ? std::uint64_t(*own) : seed_of(scene, sensor.name);
          },
          [scene](const TemperatureSensor& from, Node::Table& to) {
            if (from.seed != seed_of(scene, from.name)) put(to, "seed", std::int64_t(from.seed));
          });
}

void read_sensors(TableReader& reader, ThermalDescription& thermal, const ThermalSetting& setting) {
  std::vector<std::string> names;
  for (const Node* table : reader.tables("sensor")) {
    thermal.sensors.push_back(sensor_fields(setting, names)
                                  .read_table(*table, where_of("sensor", *table), reader.faults()));
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
  if (plot.element.location || plot.element.axis == 'S')
    reader.refuse("element", "an error motion of an axis, which has a curve", name);
}

void read_instants(TableReader& reader, Plot& plot) {
  const auto key = time_key(reader, "at");
  if (key) plot.time_s = reader.numbers(*key);
  if (plot.time_s.size() > most_curves)
    reader.refuse(*key, fmt::format("at most {} curves", most_curves),
                  fmt::format("{}", plot.time_s.size()));
}

void read_range(TableReader& reader, Plot& plot, const ThermalSetting& setting) {
  const Joint* joint = joint_of(plot.element.axis, setting);
  if (!joint) {  // which is reported
    reader.know("range_mm");
    reader.know("range_deg");
    return;
  }
  const std::string key = range_key(*joint);
  const auto range = reader.maybe_numbers(key, 2);
  if (!range) return;
  const double from = (*range)[0], to = (*range)[1], unit = unit_of(key);
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
  Key range = key_of(
      KeyName("range_mm").otherwise("all of the travel, at most 2000 mm or a turn either way"),
      Key::Kind::Numbers, "`[from, to]` within the travel over which the curve is drawn");
  range.size = 2;
  const auto refuse_twice = [before](TableReader& reader, Plot& plot) {
    const Node* name = reader.node().find("element");
    for (const Plot& other : before)
      if (other.element == plot.element)
        reader.refuse("element", "one plot an element",
                      (name && name->text() ? *name->text() : "") + " again");
  };
  return Fields<Plot>()
      .custom(
          {key_of(must("element"), Key::Kind::Text,
                  "error motion of an axis, whose curve is drawn in `EXX-temperatures.png`")},
          read_plotted,
          [](const Plot& from, Node::Table& to) { put(to, "element", to_string(from.element)); })
      .custom(time_keys("at", Key::Kind::Numbers,
                        "instants, at most 50, each with the temperatures that the curve depends "
                        "on; before the program negative"),
              read_instants,
              [](const Plot& from, Node::Table& to) { put_numbers(to, "at_s", from.time_s, 1.0); })
      .check(refuse_twice)
      .custom(
          with_other_unit({range}, "mm", "deg"),
          [&setting](TableReader& reader, Plot& plot) { read_range(reader, plot, setting); },
          [&setting](const Plot& from, Node::Table& to) { write_range(from, to, setting); });
}

void read_plots(TableReader& reader, ThermalDescription& thermal, const ThermalSetting& setting) {
  Faults& faults = reader.faults();
  for (const Node* table : reader.tables("plot")) {
    const std::size_t before = faults.list().size();
    const Plot plot =
        plot_fields(setting, thermal.plots).read_table(*table, "thermal.plot", faults);
    if (faults.list().size() != before) continue;
    bind_alone({{{plot.element, {}, {}, 0.0}}, {}, std::nullopt, 20.0}, setting,
               table->find("element")->place, faults);
    thermal.plots.push_back(plot);
  }
}

// ---- the section

/// What comes before the links, which ask for the nodes by name.
Fields<ThermalDescription> first_fields() {
  const auto itself = std::identity{};
  return Fields<ThermalDescription>()
      .custom(
          {key_of("name", Key::Kind::Text, "of the table, for people")},
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

/// What comes after the links. @param setting  must outlive the fields
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
                                std::uint64_t seed, Faults& faults) {
  TableReader reader(table, "thermal", faults);
  const std::size_t before = faults.list().size();
  ThermalDescription thermal = first_fields().read(reader);
  if (has_too_many_nodes(reader)) return thermal;
  const ThermalSetting setting = thermal_setting(machine, thermal.network, seed);
  thermal = thermal_link_fields(setting.nodes).read(reader, std::move(thermal));
  const bool whole = faults.list().size() == before && reader.has("node");
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
