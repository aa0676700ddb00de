#include "sim/scene/thermal_network.h"

#include <algorithm>
#include <array>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

namespace abbe::sim {

namespace {

std::array<std::string, 3> in_time_units(const std::string& stem) {
  return {stem + "_h", stem + "_min", stem + "_s"};
}

/// Reports a node that is not in the network.
void report_unknown_node(const SourcePosition& position, const std::string& expected,
                         const std::string& name, const std::vector<std::string>& nodes,
                         InputErrors& input_errors) {
  std::set<std::string> names(nodes.begin(), nodes.end());
  // A node without a name has an empty one, which must not be suggested.
  names.erase("");
  const auto suggestion = nearest(name, names);
  input_errors.add(position, expected,
                   "\"" + name + "\"" + (suggestion ? " (nearest: \"" + *suggestion + "\")" : ""));
}

}  // namespace

ThermalContext thermal_context(const MachineDescription& machine,
                               const errors::ThermalNetwork& network, std::uint64_t seed) {
  ThermalContext context{machine, std::nullopt, {}, seed};
  for (const errors::ThermalNode& node : network.nodes) context.nodes.push_back(node.name);
  try {
    if (!machine.joints.empty()) context.chain.emplace(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument&) {
    // The invalid machine is reported with its own section.
  }
  return context;
}

std::string named_table_path(const std::string& list, const Node& table) {
  const Node* name = table.find("name");
  return "thermal." + list + (name && name->text() ? "." + *name->text() : "");
}

void check_binding(const errors::ThermalErrors& effect, const ThermalContext& context,
                   const SourcePosition& position, InputErrors& input_errors) {
  // If the machine or the nodes are invalid, which is reported already, every binding would fail.
  if (!context.chain || context.nodes.empty()) return;
  try {
    errors::bind(effect, *context.chain, int(context.nodes.size()));
  } catch (const std::invalid_argument& error) {
    input_errors.add(position, "thermal errors that fit the machine", error.what());
  }
}

void check_name_is_free(TableReader& reader, const std::string& name,
                        const std::vector<std::string>& used_names, const char* expected) {
  if (!name.empty() && std::find(used_names.begin(), used_names.end(), name) != used_names.end())
    reader.report_invalid("name", expected, name + " again");
}

std::vector<Key> time_keys(const std::string& stem, Key::Kind kind, const char* sentence) {
  std::vector<Key> keys;
  for (const std::string& name : in_time_units(stem))
    keys.push_back(make_key(KeyName(name).in_exclusive_group(stem), kind, sentence));
  return keys;
}

std::optional<std::string> time_key(TableReader& reader, const std::string& stem) {
  std::vector<std::string> stated_keys;
  std::string list;
  for (const std::string& key : in_time_units(stem)) {
    if (reader.accept_key(key)) stated_keys.push_back(key);
    list += (list.empty() ? "" : ", ") + key;
  }
  if (stated_keys.size() == 1) return stated_keys.front();
  if (stated_keys.empty()) reader.report_missing(in_time_units(stem).front(), "one of " + list);
  for (std::size_t i = 1; i < stated_keys.size(); ++i)
    reader.report_invalid(stated_keys[i], "only one of " + list,
                          stated_keys[0] + " and " + stated_keys[i]);
  return std::nullopt;
}

int read_node(TableReader& reader, const std::string& key, const std::vector<std::string>& nodes) {
  const std::string name = reader.text(key);
  // A missing name is reported already; 0 is a valid index.
  if (name.empty()) return 0;
  const auto node = std::find(nodes.begin(), nodes.end(), name);
  if (node != nodes.end()) return int(node - nodes.begin());
  report_unknown_node(reader.accept_key(key)->position, "a node of the thermal network for " + key,
                      name, nodes, reader.input_errors());
  return 0;
}

namespace {

using Eigen::VectorXd;
using kinematics::Joint;
using kinematics::Motion;

constexpr Range phase_spindle_rpm{0.0, 1e6};
constexpr Range axis_speed{0.0, 1e6};  // mm or deg per minute
constexpr std::size_t max_rows = 10'000;

// ---- room

void read_room_table(const Node& section, ThermalDescription& thermal, InputErrors& input_errors) {
  TableReader reader(section, "thermal.room", input_errors);
  const std::size_t error_count = input_errors.list().size();
  const auto key = time_key(reader, "time");
  const VectorXd T_C = reader.numbers("T_C");
  const VectorXd time_s = key ? reader.numbers(*key) : VectorXd();
  reader.close();
  if (input_errors.list().size() != error_count) return;
  if (T_C.size() != time_s.size())
    reader.report_invalid("T_C",
                          fmt::format("as many temperatures as times, that is {}", time_s.size()),
                          fmt::format("{}", T_C.size()));
  for (Eigen::Index i = 1; i < time_s.size(); ++i)
    // The negated comparison also rejects NaN.
    if (!(time_s[i] > time_s[i - 1]))
      reader.report_invalid(*key, "ascending times for thermal.room." + *key,
                            fmt::format("{} s after {} s", time_s[i], time_s[i - 1]));
  if (T_C.size() > Eigen::Index(max_rows))
    reader.report_invalid("T_C", fmt::format("at most {} rows", max_rows),
                          fmt::format("{}", T_C.size()));
  const Range& range = temperature_range;
  if (T_C.minCoeff() < range.min || T_C.maxCoeff() > range.max)
    reader.report_invalid("T_C", fmt::format("temperatures of {} .. {}", range.min, range.max),
                          fmt::format("{} .. {}", T_C.minCoeff(), T_C.maxCoeff()));
  thermal.room_time_s = time_s;
  thermal.room_T_C = T_C;
}

void read_room(TableReader& reader, ThermalDescription& thermal) {
  // A constant temperature is stored as a table of one row.
  thermal.room_time_s = VectorXd::Zero(1);
  thermal.room_T_C = VectorXd::Constant(1, reader.number("room_C", temperature_range, 20.0));
  const Node* section = reader.section("room");
  if (!section) return;
  if (reader.has("room_C")) reader.report_invalid("room", "either room_C or a room table", "both");
  read_room_table(*section, thermal, reader.input_errors());
}

void write_room(const ThermalDescription& thermal, Node::Table& table) {
  // A constant temperature is stored as a single row at time 0.
  if (thermal.room_time_s.size() == 1 && thermal.room_time_s[0] == 0.0)
    return put_value(table, "room_C", thermal.room_T_C[0]);
  Node::Table room;
  put_numbers(room, "time_s", thermal.room_time_s, 1.0);
  put_numbers(room, "T_C", thermal.room_T_C, 1.0);
  put_value(table, "room", std::move(room));
}

// ---- history

/// Key of a table with the speeds of slides or of rotary axes.
struct SpeedKey {
  const char* name;
  Motion motion;
  const char* axes;  ///< pattern of the axis letters
  const char* sentence;
};
constexpr std::array speed_keys{
    SpeedKey{"axis_speed_mm_per_min", Motion::Linear, "[XYZUVW]",
             "mean speeds of slides that move back and forth, `{ X = 5000 }`"},
    SpeedKey{"axis_speed_deg_per_min", Motion::Rotary, "[ABCS]",
             "mean speeds of rotary axes that move back and forth, `{ A = 100 }`"}};

void read_axis_speeds(TableReader& phase, kinematics::AxisVector& speeds,
                      const ThermalContext& context) {
  // Axes without a stated speed are at rest.
  if (context.chain) speeds.setZero(context.chain->size());
  for (const SpeedKey& key : speed_keys) {
    const Node* section = phase.section(key.name);
    if (!section || !context.chain) continue;
    TableReader reader(*section, std::string("thermal.history.") + key.name, phase.input_errors());
    for (int j = 0; j < context.chain->size(); ++j) {
      const Joint& joint = context.chain->joints()[std::size_t(j)];
      if (joint.motion != key.motion) continue;
      const auto speed = reader.number_as_written(std::string(1, joint.name), axis_speed);
      // The unit is in the key of the table and not in those of the axes.
      if (speed) speeds[j] = *speed * unit_factor(key.name);
    }
    reader.close();
  }
}

void write_axis_speeds(const kinematics::AxisVector& speeds, Node::Table& table,
                       const ThermalContext& context) {
  for (const SpeedKey& key : speed_keys) {
    Node::Table axes;
    for (int j = 0; j < int(speeds.size()); ++j) {
      const Joint& joint = context.chain->joints()[std::size_t(j)];
      if (joint.motion == key.motion && speeds[j] != 0.0)
        put_value(axes, std::string(1, joint.name), speeds[j] / unit_factor(key.name));
    }
    if (!axes.empty()) put_value(table, key.name, std::move(axes));
  }
}

std::vector<Key> axis_speed_keys() {
  std::vector<Key> keys;
  for (const SpeedKey& speed_key : speed_keys) {
    Key axis =
        make_key("<axis>", Key::Kind::Number, "mean speed of one axis, in the unit of the table");
    axis.pattern = speed_key.axes;
    axis.range = axis_speed;
    Key key =
        make_key(KeyName(speed_key.name).with_fallback("0"), Key::Kind::Table, speed_key.sentence);
    key.keys = {axis};
    keys.push_back(key);
  }
  return keys;
}

Range duration_range(const std::string& key) {
  return {0.0, max_time_s / unit_factor(key), true, false};
}

Fields<ThermalPhase> phase_fields(const ThermalContext& context) {
  std::vector<Key> durations = time_keys("duration", Key::Kind::Number, "duration of the phase");
  for (Key& key : durations) key.range = duration_range(key.name);
  return Fields<ThermalPhase>()
      .remark("name", "name of the phase")
      .custom_field(
          durations,
          [](TableReader& reader, ThermalPhase& phase) {
            if (const auto key = time_key(reader, "duration"))
              phase.duration = reader.number(*key, duration_range(*key));
          },
          [](const ThermalPhase& phase, Node::Table& table) {
            put_value(table, "duration_s", phase.duration);
          })
      .number("speed_rpm", &ThermalPhase::spindle_speed, phase_spindle_rpm, "spindle speed")
      .custom_field(
          axis_speed_keys(),
          [&context](TableReader& reader, ThermalPhase& phase) {
            read_axis_speeds(reader, phase.axis_speed, context);
          },
          [&context](const ThermalPhase& phase, Node::Table& table) {
            write_axis_speeds(phase.axis_speed, table, context);
          })
      .boolean("powered", &ThermalPhase::powered, "the machine is switched on")
      .boolean("coolant", &ThermalPhase::coolant, "the coolant flows");
}

void read_history(TableReader& reader, ThermalDescription& thermal, const ThermalContext& context) {
  const auto phases = reader.tables("history");
  if (phases.size() > max_rows) {
    reader.report_invalid("history", fmt::format("at most {} phases", max_rows),
                          fmt::format("{}", phases.size()));
    return;
  }
  const Fields<ThermalPhase> fields = phase_fields(context);
  for (const Node* table : phases)
    thermal.history.push_back(
        fields.read_table(*table, named_table_path("history", *table), reader.input_errors()));
}

}  // namespace

Fields<ThermalDescription> room_fields() {
  Key constant = make_key(KeyName("room_C").with_fallback("20"), Key::Kind::Number,
                          "constant temperature of the room; or `room`");
  constant.range = temperature_range;
  Key room = make_key("room", Key::Kind::Table,
                      "temperature of the room, linear between its rows and constant beyond them; "
                      "at most 10 000 rows");
  room.keys =
      time_keys("time", Key::Kind::Numbers, "times, ascending, negative before the program");
  room.keys.push_back(
      make_key(required_key("T_C"), Key::Kind::Numbers, "temperatures, one per time"));
  return Fields<ThermalDescription>().custom_field({constant, room}, read_room, write_room);
}

Fields<ThermalDescription> history_fields(const ThermalContext& context) {
  return Fields<ThermalDescription>().tables(
      "history", &ThermalDescription::history, phase_fields(context),
      "phase before the program, in order; at most 10 000",
      [&context](TableReader& reader, ThermalDescription& thermal) {
        read_history(reader, thermal, context);
      });
}

namespace {

using errors::Surroundings;

constexpr Range power{0.0, 1e7};  // W
constexpr Range cutting_power_fraction{0.0, 1.0};
constexpr std::size_t max_nodes = 200;

// ---- nodes

/// A node with its start temperature, if it states one.
struct ThermalNodeEntry {
  errors::ThermalNode node;
  std::optional<double> start_T_C;
};

Fields<ThermalNodeEntry> node_table_fields(const std::vector<std::string>& used_names) {
  using errors::ThermalNode;
  const auto check_name = [used_names](TableReader& reader, ThermalNode& node) {
    // Links denote the surroundings by these names.
    if (node.name == "room" || node.name == "coolant")
      reader.report_invalid(
          "name", "a node name other than room or coolant, which links already know", node.name);
    check_name_is_free(reader, node.name, used_names, "each node once");
  };
  const auto node =
      Fields<ThermalNode>()
          .text(required_key("name"), &ThermalNode::name, "name, not `room` or `coolant`")
          .check(check_name)
          .number(required_key("capacity_J_per_K"), &ThermalNode::capacity_J_per_K, positive,
                  "heat capacity");
  return Fields<ThermalNodeEntry>()
      .include_fields(&ThermalNodeEntry::node, node)
      .number(KeyName("start_C").with_fallback("`start_C` of all nodes"),
              &ThermalNodeEntry::start_T_C, temperature_range,
              "temperature at the start of the history");
}

void read_nodes(TableReader& reader, ThermalDescription& thermal) {
  const auto tables = reader.tables("node");
  if (!reader.has("node")) reader.report_missing("node", "a list of tables");
  if (tables.size() > max_nodes) {
    reader.report_invalid("node", fmt::format("at most {} nodes", max_nodes),
                          fmt::format("{}", tables.size()));
    return;
  }
  auto& [nodes, links, surroundings, sources, start_T_C] = thermal.network;
  // By default all nodes start at the first temperature of the room, which is read before.
  start_T_C.setConstant(Eigen::Index(tables.size()),
                        reader.number("start_C", temperature_range, thermal.room_T_C[0]));
  std::vector<std::string> names;
  for (const Node* table : tables) {
    const auto [node, start] = node_table_fields(names).read_table(
        *table, named_table_path("node", *table), reader.input_errors());
    if (start) start_T_C[Eigen::Index(nodes.size())] = *start;
    names.push_back(node.name);
    nodes.push_back(node);
  }
}

void write_nodes(const ThermalDescription& thermal, Node::Table& table) {
  Node::Array nodes;
  for (const errors::ThermalNode& node : thermal.network.nodes) {
    const double start = thermal.network.start_T_C[Eigen::Index(nodes.size())];
    nodes.push_back(Node{{}, node_table_fields({}).to_table({node, start})});
  }
  put_value(table, "node", std::move(nodes));
}

// ---- links

using End = std::variant<int, Surroundings>;  // index of a node, or the surroundings

struct ThermalLinkEntry {
  std::optional<std::array<End, 2>> ends;  ///< none if they are invalid
  double conductance_W_per_K = 1.0;
};

std::optional<End> read_end(const Node& node, const std::vector<std::string>& nodes,
                            InputErrors& input_errors) {
  const std::string& name = *node.text();
  if (name == "room") return End(Surroundings::Room);
  if (name == "coolant") return End(Surroundings::Coolant);
  const auto position = std::find(nodes.begin(), nodes.end(), name);
  if (position != nodes.end()) return End(int(position - nodes.begin()));
  report_unknown_node(node.position, "a node of the thermal network, \"room\" or \"coolant\"", name,
                      nodes, input_errors);
  return std::nullopt;
}

std::optional<std::array<End, 2>> read_ends(TableReader& reader,
                                            const std::vector<std::string>& nodes) {
  const Node* between = reader.accept_key("between");
  if (!between) {
    reader.report_missing("between", "two names");
    return std::nullopt;
  }
  const Node::Array* names = between->array();
  if (!names || names->size() != 2 || !(*names)[0].text() || !(*names)[1].text()) {
    reader.report_invalid("between", "two names for thermal.link.between", display_text(*between));
    return std::nullopt;
  }
  const auto a = read_end((*names)[0], nodes, reader.input_errors());
  const auto b = read_end((*names)[1], nodes, reader.input_errors());
  if (!a || !b) return std::nullopt;
  // Heat between two surroundings, or between a node and itself, does not change the network.
  if (*a == *b || (a->index() == 1 && b->index() == 1)) {
    reader.report_invalid("between", "two different nodes, or a node and its surroundings",
                          *(*names)[0].text() + " and " + *(*names)[1].text());
    return std::nullopt;
  }
  return std::array{*a, *b};
}

Fields<ThermalLinkEntry> link_fields(const std::vector<std::string>& nodes) {
  const auto end_name = [&nodes](const End& end) {
    if (const int* node = std::get_if<int>(&end)) return nodes.at(std::size_t(*node));
    return std::string(std::get<Surroundings>(end) == Surroundings::Room ? "room" : "coolant");
  };
  const auto write_ends = [end_name](const ThermalLinkEntry& link, Node::Table& table) {
    Node::Array names;
    for (const End& end : *link.ends) names.push_back(Node{{}, end_name(end)});
    put_value(table, "between", std::move(names));
  };
  Key between = make_key(
      required_key("between"), Key::Kind::Texts,
      "two nodes, or a node and `room` or `coolant`; the coolant takes heat only while it flows");
  between.size = 2;
  return Fields<ThermalLinkEntry>()
      .custom_field(
          {between},
          [&nodes](TableReader& reader, ThermalLinkEntry& link) {
            link.ends = read_ends(reader, nodes);
          },
          write_ends)
      .number(required_key("conductance_W_per_K"), &ThermalLinkEntry::conductance_W_per_K, positive,
              "heat flow per kelvin of difference");
}

void read_links(TableReader& reader, errors::ThermalNetwork& network,
                const std::vector<std::string>& nodes) {
  for (const Node* table : reader.tables("link")) {
    const auto [ends, conductance] =
        link_fields(nodes).read_table(*table, "thermal.link", reader.input_errors());
    if (!ends) continue;
    auto [a, b] = *ends;
    // The network stores the surroundings as the second end.
    if (a.index() == 1) std::swap(a, b);
    if (const auto* surroundings = std::get_if<Surroundings>(&b)) {
      network.surroundings.push_back({std::get<int>(a), *surroundings, conductance});
    } else {
      network.links.push_back({std::get<int>(a), std::get<int>(b), conductance});
    }
  }
}

Node::Array links_to_tables(const errors::ThermalNetwork& network,
                            const std::vector<std::string>& nodes) {
  Node::Array links;
  const auto add = [&](const End& a, const End& b, double conductance) {
    links.push_back(Node{{}, link_fields(nodes).to_table({std::array{a, b}, conductance})});
  };
  for (const auto& link : network.links) add(link.a, link.b, link.conductance_W_per_K);
  for (const auto& link : network.surroundings) add(link.node, link.to, link.conductance_W_per_K);
  return links;
}

// ---- sources

using Law = decltype(errors::HeatSource::law);

Fields<errors::AxisHeat> friction_fields(bool is_slide) {
  using errors::AxisHeat;
  return Fields<AxisHeat>()
      .number(is_slide ? "coulomb_N" : "coulomb_Nm", &AxisHeat::coulomb, non_negative,
              is_slide ? "Coulomb friction of a slide; at least one of the two is required"
                       : "Coulomb friction of a rotary axis")
      .number(is_slide ? "viscous_N_s_per_mm" : "viscous_Nm_s", &AxisHeat::viscous, non_negative,
              is_slide ? "viscous friction of a slide" : "viscous friction of a rotary axis");
}

std::optional<errors::AxisHeat> read_axis_heat(TableReader& reader, const ThermalContext& context) {
  const std::string name = reader.text("axis");
  const auto& joints = context.machine.joints;
  const auto joint_position = std::find_if(joints.begin(), joints.end(), [&](const Joint& joint) {
    return name == std::string(1, joint.name) && joint.motion != Motion::Spindle;
  });
  // For an unknown axis the keys of a slide are read, so that their errors are reported as well.
  const bool is_slide = joint_position == joints.end() || joint_position->motion == Motion::Linear;
  const Fields<errors::AxisHeat> friction = friction_fields(is_slide);
  errors::AxisHeat heat = friction.read(reader);
  const std::string coulomb = friction.keys()[0].name, viscous = friction.keys()[1].name;
  // Without either coefficient the axis would produce no heat.
  if (!reader.has(coulomb) && !reader.has(viscous))
    reader.report_missing(coulomb, "a number, or " + viscous + ",");
  if (joint_position == joints.end()) {
    // If the machine is invalid, every axis is unknown.
    if (!name.empty() && context.chain)
      reader.report_invalid("axis", "an axis of the machine", name);
    return std::nullopt;
  }
  // The heat of a spindle is a kind of its own.
  if (name == "S") {
    reader.report_invalid("axis", "an axis other than the spindle, which has kind = \"spindle\"",
                          name);
    return std::nullopt;
  }
  heat.joint = int(joint_position - joints.begin());
  return heat;
}

Alternative<Law> axis_heat_alternative(const ThermalContext& context) {
  EnumChoice choice{"axis",
                    "friction of an axis, (coulomb + viscous |v|) |v|",
                    {make_key(required_key("axis"), Key::Kind::Text, "letter of the axis")}};
  for (const bool is_slide : {true, false})
    for (const Key& key : friction_fields(is_slide).keys()) choice.keys.push_back(key);
  const auto read = [&context](TableReader& reader) {
    const auto heat = read_axis_heat(reader, context);
    return heat ? Law(*heat) : Law();
  };
  const auto write = [&context](const Law& law, Node::Table& table) {
    const auto* heat = std::get_if<errors::AxisHeat>(&law);
    if (!heat) return false;
    const Joint& joint = context.machine.joints.at(std::size_t(heat->joint));
    put_value(table, "axis", std::string(1, joint.name));
    append_entries(table, friction_fields(joint.motion == Motion::Linear).to_table(*heat));
    return true;
  };
  return {std::move(choice), read, write};
}

Fields<errors::HeatSource> law_fields(const ThermalContext& context) {
  using errors::CuttingHeat, errors::PowerOnHeat, errors::SpindleHeat, errors::HeatSource;
  const auto spindle =
      Fields<SpindleHeat>()
          .number(required_key("power_W"), &SpindleHeat::power_W, power, "power at `at_rpm`")
          .number(required_key("at_rpm"), &SpindleHeat::reference_speed, positive,
                  "speed at which the power is stated")
          .number("exponent", &SpindleHeat::exponent, non_negative, "exponent of the speed");
  const auto power_on =
      Fields<PowerOnHeat>().number(required_key("power_W"), &PowerOnHeat::power_W, power,
                                   "power while the machine is switched on");
  const auto cutting =
      Fields<CuttingHeat>().number(required_key("share"), &CuttingHeat::share,
                                   cutting_power_fraction, "fraction of the cutting power");
  return Fields<HeatSource>().variant(
      required_key("kind"), &HeatSource::law,
      {alternative<Law>("spindle", spindle, "bearings and motor, power_W (n / at_rpm)^exponent"),
       axis_heat_alternative(context),
       alternative<Law>("power_on", power_on, "motors and cabinets"),
       alternative<Law>("cutting", cutting, "a fraction of the cutting power")},
      "source of the heat");
}

Fields<errors::HeatSource> source_node_fields(const std::vector<std::string>& nodes) {
  return node_fields<errors::HeatSource>(required_key("node"), &errors::HeatSource::node, nodes,
                                         "node that is heated");
}

/// Returns true if the table states a valid kind; else reports the error.
bool has_kind(TableReader& reader, const Fields<errors::HeatSource>& law) {
  if (reader.has("kind")) return bool(reader.word("kind", choice_names(law.keys().front()), false));
  reader.input_errors().add(reader.position(), "a kind of heat for thermal.source.kind", "nothing");
  return false;
}

void read_sources(TableReader& list, ThermalDescription& thermal, const ThermalContext& context) {
  const Fields<errors::HeatSource> law = law_fields(context);
  for (const Node* table : list.tables("source")) {
    TableReader reader(*table, "thermal.source", list.input_errors());
    errors::HeatSource source = source_node_fields(context.nodes).read(reader);
    // Which other keys exist depends on the kind, so without one nothing more can be checked.
    if (!has_kind(reader, law)) continue;
    thermal.network.sources.push_back(law.read(reader, source));
    reader.close();
  }
}

}  // namespace

Fields<ThermalDescription> thermal_node_fields() {
  Key nodes = make_key(required_key("node"), Key::Kind::Tables,
                       "body with a single temperature; at most 200, and each needs a path of heat "
                       "to the room without the coolant");
  nodes.keys = node_table_fields({}).keys();
  Key start = make_key(KeyName("start_C").with_fallback("first temperature of the room"),
                       Key::Kind::Number, "temperature of every node at the start of the history");
  start.range = temperature_range;
  return Fields<ThermalDescription>().custom_field({start, nodes}, read_nodes, write_nodes);
}

bool has_too_many_nodes(TableReader& reader) { return reader.tables("node").size() > max_nodes; }

Fields<ThermalDescription> thermal_link_fields(const std::vector<std::string>& nodes) {
  Key links = make_key("link", Key::Kind::Tables, "heat flow between two nodes or to the room");
  links.keys = link_fields(nodes).keys();
  return Fields<ThermalDescription>().custom_field(
      {links},
      [&nodes](TableReader& reader, ThermalDescription& thermal) {
        read_links(reader, thermal.network, nodes);
      },
      [&nodes](const ThermalDescription& thermal, Node::Table& table) {
        put_value(table, "link", links_to_tables(thermal.network, nodes));
      });
}

Fields<ThermalDescription> thermal_source_fields(const ThermalContext& context) {
  return Fields<ThermalDescription>().tables(
      "source", [](auto& thermal) -> auto& { return thermal.network.sources; },
      source_node_fields(context.nodes).include_fields(whole_struct, law_fields(context)),
      "heat source in a node",
      [&context](TableReader& reader, ThermalDescription& thermal) {
        read_sources(reader, thermal, context);
      });
}

void check_network(const errors::ThermalNetwork& network, TableReader& reader) {
  // Heat could enter an isolated node but never leave it.
  if (const auto node = errors::isolated_node(network)) {
    const Node* table = reader.tables("node")[std::size_t(*node)];
    reader.input_errors().add(table->position,
                              "links through which heat reaches the room from thermal.node." +
                                  network.nodes[std::size_t(*node)].name,
                              "none");
    return;
  }
  errors::Activity idle_activity;
  try {
    // One step without activity is simulated, because the simulation validates the network.
    errors::simulate(network, {&idle_activity, 1});
  } catch (const std::invalid_argument& error) {
    reader.input_errors().add(reader.position(), "a valid thermal network", error.what());
  }
}

}  // namespace abbe::sim
