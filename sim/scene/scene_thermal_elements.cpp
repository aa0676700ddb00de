#include "sim/scene/scene_thermal_elements.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/scene/scene_curves.h"

namespace abbe::sim {

namespace {

using Eigen::VectorXd;
using errors::ElementName;
using kinematics::Joint;
using kinematics::Motion;
using Nodes = std::vector<std::string>;

/// Unit of a key that is one from end to end, as "um_per_K": a unit is found behind a stem only.
double whole_unit(const std::string& key) { return unit_of("in_" + key); }

// ---- functions of temperatures

errors::Table read_rows(TableReader& reader, const std::string& value_key,
                        const errors::Table& how) {
  const std::size_t before = reader.faults().list().size();
  VectorXd dT_K = reader.numbers("dT_K");
  VectorXd value = reader.numbers(value_key);
  if (reader.faults().list().size() != before || !reader.has("dT_K") || !reader.has(value_key))
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
      {key_of(KeyName("dT_K").one_of("law"), Key::Kind::Numbers, "changes of temperature, rising"),
       key_of(value_key, Key::Kind::Numbers, "one for each of `dT_K`")},
      [value_key](TableReader& reader, errors::Table& table) {
        table = read_rows(reader, value_key, table);
      },
      [value_key](const errors::Table& from, Node::Table& to) {
        put_numbers(to, "dT_K", from.q, 1.0);
        put_numbers(to, value_key, from.value, unit_of(value_key));
      });
}

/// @param unit  of the value: "um", of a slope "um_per_m"
Fields<errors::ThermalFunction::Term> term_fields(const std::string& unit, const Nodes& nodes) {
  using Term = errors::ThermalFunction::Term;
  const std::string per_K = unit + (unit.ends_with("_per_m") ? "_K" : "_per_K");
  const std::string value = "value_" + unit;
  const auto rows = rows_fields(value);
  const auto factor = Fields<Term>().number_in(whole_unit(per_K), must(per_K), &Term::per_K,
                                               any_number, "change for a change of temperature");
  const auto read = [=](TableReader& reader, Term& term) {
    if (reader.has("dT_K") || reader.has(value)) {
      term.table = rows.read(reader);
      if (reader.know(per_K)) reader.refuse(per_K, "either a table of dT_K or " + per_K, "both");
    } else {
      reader.know("dT_K");
      reader.know(value);
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
  return true;  // no such axis, which is refused when bound
}

void refuse_wrong_unit(TableReader& reader, const ElementName& name) {
  const std::string unit = name.is_angle() ? "urad" : "um", wrong = name.is_angle() ? "um" : "urad";
  const std::string written = reader.node().find("name") ? *reader.node().find("name")->text() : "";
  for (const std::string& key : {"offset_" + wrong, "slope_" + wrong + "_per_m"})
    if (reader.has(key)) reader.refuse(key, "values of " + written + " in " + unit, key);
}

void refuse_slope(TableReader& reader, const std::string& unit) {
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
          {key_of(must("name"), Key::Kind::Text,
                  "as `EZS`; its value is offset(T) + slope(T) (p - fixed_mm), p the commanded "
                  "position")},
          [](TableReader& reader, ThermalElement&) { reader.know("name"); },  // read before
          [](const ThermalElement& from, Node::Table& to) {
            put(to, "name", to_string(from.name));
          })
      .check([name](TableReader& reader, ThermalElement&) { refuse_wrong_unit(reader, name); })
      .all_of(&ThermalElement::offset, function_fields("offset", unit, setting.nodes));
  if (!is_slide(name, setting.machine))
    return fields.check(
        [unit](TableReader& reader, ThermalElement&) { refuse_slope(reader, unit); });
  return fields
      .all_of(&ThermalElement::slope, function_fields("slope", unit + "_per_m", setting.nodes))
      .number("fixed_mm", &ThermalElement::fixed, any_number,
              "commanded position where the slope adds nothing; slopes are of error motions of "
              "slides");
}

std::optional<errors::ThermalElement> read_element(const Node& table, const ThermalSetting& setting,
                                                   Faults& faults) {
  TableReader reader(table, where_of("element", table), faults);
  const std::size_t before = faults.list().size();
  errors::ThermalElement element;
  try {
    element.name = errors::parse_element_name(reader.text("name", ""));
  } catch (const std::invalid_argument& fault) {
    reader.refuse("name", "the name of an element for thermal.element.name", fault.what());
    return std::nullopt;  // its other keys depend on it
  }
  element = element_fields(element.name, setting).read(reader, element);
  reader.close();
  if (faults.list().size() != before) return std::nullopt;
  return element;
}

void read_elements(TableReader& reader, ThermalDescription& thermal,
                   const ThermalSetting& setting) {
  auto& elements = thermal.errors.elements;
  for (const Node* table : reader.tables("element")) {
    const auto element = read_element(*table, setting, reader.faults());
    if (!element) continue;
    const Place& place = table->find("name")->place;
    if (std::any_of(elements.begin(), elements.end(),
                    [&](const auto& other) { return other.name == element->name; })) {
      reader.faults().add(place, "each element once (its terms are one list)",
                          to_string(element->name) + " again");
      continue;
    }
    bind_alone({{*element}, {}, std::nullopt, 20.0}, setting, place, reader.faults());
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
  Faults& faults = reader.faults();
  TableReader axes(*section, "thermal.axis", faults);
  for (const Joint& joint : setting.machine.joints) {
    if (joint.motion != Motion::Linear) continue;
    const std::string name(1, joint.name);
    const Node* table = axes.section(name);
    if (!table) continue;
    const std::size_t before = faults.list().size();
    errors::AxisExpansion start;
    start.axis = joint.name;
    const auto axis =
        axis_fields(setting.nodes).read_table(*table, axes.name_of(name), faults, start);
    if (faults.list().size() == before)
      bind_alone({{}, {axis}, std::nullopt, 20.0}, setting, table->place, faults);
    thermal.errors.expansions.push_back(axis);
  }
  if (!setting.machine.joints.empty()) axes.close();
}

Node::Table written_axes(const ThermalDescription& thermal, const ThermalSetting& setting) {
  Node::Table axes;
  for (const errors::AxisExpansion& axis : thermal.errors.expansions)
    put(axes, std::string(1, axis.axis), axis_fields(setting.nodes).written(axis));
  return axes;
}

Key axes_key(const Nodes& nodes) {
  Key axis = key_of("<axis>", Key::Kind::Table, "growth of one slide");
  axis.pattern = "[XYZUVW]";
  axis.keys = axis_fields(nodes).keys();
  Key axes = key_of("axis", Key::Kind::Table, "slides whose screw or scale grows");
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
  Faults& faults = reader.faults();
  const std::size_t before = faults.list().size();
  const auto workpiece =
      workpiece_fields(setting.nodes).read_table(*table, "thermal.workpiece", faults);
  if (faults.list().size() == before)
    bind_alone({{}, {}, workpiece, 20.0}, setting, table->place, faults);
  thermal.errors.workpiece = workpiece;
}

}  // namespace

Fields<ThermalDescription> thermal_effect_fields(const ThermalSetting& setting) {
  Key elements = key_of("element", Key::Kind::Tables, "what heat adds to an element, each once");
  elements.keys = with_other_unit(element_fields({}, setting).keys(), "um", "urad");
  Key workpiece = key_of("workpiece", Key::Kind::Table,
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

}  // namespace abbe::sim
