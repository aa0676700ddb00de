#include "sim/scene/thermal_network.h"

#include <algorithm>
#include <array>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

namespace abbe::sim {

namespace {

std::array<std::string, 3> in_units(const std::string& stem) {
  return {stem + "_h", stem + "_min", stem + "_s"};
}

}  // namespace

ThermalSetting thermal_setting(const MachineDescription& machine,
                               const errors::ThermalNetwork& network, std::uint64_t seed) {
  ThermalSetting setting{machine, std::nullopt, {}, seed};
  for (const errors::ThermalNode& node : network.nodes) setting.nodes.push_back(node.name);
  try {
    if (!machine.joints.empty()) setting.chain.emplace(machine.joints, machine.T_bw, machine.T_bs);
  } catch (const std::invalid_argument&) {
    // reported with the machine
  }
  return setting;
}

std::string named_table_path(const std::string& list, const Node& table) {
  const Node* name = table.find("name");
  return "thermal." + list + (name && name->text() ? "." + *name->text() : "");
}

void check_binding(const errors::ThermalErrors& alone, const ThermalSetting& setting,
                   const Place& place, InputErrors& input_errors) {
  // Without a chain or nodes every binding would fail, and the cause is reported elsewhere.
  if (!setting.chain || setting.nodes.empty()) return;
  try {
    errors::bind(alone, *setting.chain, int(setting.nodes.size()));
  } catch (const std::invalid_argument& fault) {
    input_errors.add(place, "thermal errors that fit the machine", fault.what());
  }
}

void check_name_is_free(TableReader& reader, const std::string& name,
                        const std::vector<std::string>& taken, const char* once) {
  if (!name.empty() && std::find(taken.begin(), taken.end(), name) != taken.end())
    reader.refuse("name", once, name + " again");
}

std::vector<Key> time_keys(const std::string& stem, Key::Kind kind, const char* sentence) {
  std::vector<Key> keys;
  for (const std::string& name : in_units(stem))
    keys.push_back(make_key(KeyName(name).one_of(stem), kind, sentence));
  return keys;
}

std::optional<std::string> time_key(TableReader& reader, const std::string& stem) {
  std::vector<std::string> there;
  std::string all;
  for (const std::string& key : in_units(stem)) {
    if (reader.accept_key(key)) there.push_back(key);
    all += (all.empty() ? "" : ", ") + key;
  }
  if (there.size() == 1) return there.front();
  if (there.empty()) reader.missing(in_units(stem).front(), "one of " + all);
  // Every further key gets a message at its own position.
  for (std::size_t i = 1; i < there.size(); ++i)
    reader.refuse(there[i], "only one of " + all, there[0] + " and " + there[i]);
  return std::nullopt;
}

int node_of(TableReader& reader, const std::string& key, const std::vector<std::string>& nodes) {
  const std::string name = reader.text(key);
  // Node 0 is a valid index, and the missing name has been reported already.
  if (name.empty()) return 0;
  const auto found = std::find(nodes.begin(), nodes.end(), name);
  if (found != nodes.end()) return int(found - nodes.begin());
  report_unknown_node(reader.accept_key(key)->place, "a node of the thermal network for " + key,
                      name, nodes, reader.input_errors());
  return 0;
}

void report_unknown_node(const Place& place, const std::string& expected, const std::string& name,
                         const std::vector<std::string>& nodes, InputErrors& input_errors) {
  std::set<std::string> names(nodes.begin(), nodes.end());
  // Nodes whose name is missing have an empty one, which must not be suggested.
  names.erase("");
  const auto meant = nearest(name, names);
  input_errors.add(place, expected,
                   "\"" + name + "\"" + (meant ? " (nearest: \"" + *meant + "\")" : ""));
}

namespace {

using Eigen::VectorXd;
using kinematics::Joint;
using kinematics::Motion;

constexpr Range phase_spindle_rpm{0.0, 1e6};
constexpr Range axis_speed{0.0, 1e6};  // mm or deg per minute
constexpr std::size_t most_rows = 10'000;

// ---- room

void read_room_table(const Node& section, ThermalDescription& thermal, InputErrors& input_errors) {
  TableReader reader(section, "thermal.room", input_errors);
  const std::size_t before = input_errors.list().size();
  const auto key = time_key(reader, "time");
  const VectorXd T_C = reader.numbers("T_C");
  const VectorXd time_s = key ? reader.numbers(*key) : VectorXd();
  reader.close();
  if (input_errors.list().size() != before) return;
  if (T_C.size() != time_s.size())
    reader.refuse("T_C", fmt::format("as many temperatures as times, {}", time_s.size()),
                  fmt::format("{}", T_C.size()));
  for (Eigen::Index i = 1; i < time_s.size(); ++i)
    // The negated comparison also rejects NaN.
    if (!(time_s[i] > time_s[i - 1]))
      reader.refuse(*key, "rising times for thermal.room." + *key,
                    fmt::format("{} s after {} s", time_s[i], time_s[i - 1]));
  if (T_C.size() > Eigen::Index(most_rows))
    reader.refuse("T_C", fmt::format("at most {} rows", most_rows), fmt::format("{}", T_C.size()));
  const Range& range = temperature_range;
  if (T_C.minCoeff() < range.min || T_C.maxCoeff() > range.max)
    reader.refuse("T_C", fmt::format("temperatures of {} .. {}", range.min, range.max),
                  fmt::format("{} .. {}", T_C.minCoeff(), T_C.maxCoeff()));
  thermal.room_time_s = time_s;
  thermal.room_T_C = T_C;
}

void read_room(TableReader& reader, ThermalDescription& thermal) {
  // A constant room is a table of one row, so that the simulation handles a single form.
  thermal.room_time_s = VectorXd::Zero(1);
  thermal.room_T_C = VectorXd::Constant(1, reader.number("room_C", temperature_range, 20.0));
  const Node* section = reader.section("room");
  if (!section) return;
  if (reader.has("room_C")) reader.refuse("room", "either room_C or a table room", "both");
  read_room_table(*section, thermal, reader.input_errors());
}

void write_room(const ThermalDescription& from, Node::Table& to) {
  // A single row at time 0 is the form in which a constant room is stored.
  if (from.room_time_s.size() == 1 && from.room_time_s[0] == 0.0)
    return put(to, "room_C", from.room_T_C[0]);
  Node::Table room;
  put_numbers(room, "time_s", from.room_time_s, 1.0);
  put_numbers(room, "T_C", from.room_T_C, 1.0);
  put(to, "room", std::move(room));
}

// ---- history

struct SpeedKey {
  const char* name;
  Motion motion;
  const char* axes;
  const char* sentence;
};
constexpr std::array speed_keys{
    SpeedKey{"axis_speed_mm_per_min", Motion::Linear, "[XYZUVW]",
             "mean speeds of slides that go to and fro, `{ X = 5000 }`"},
    SpeedKey{"axis_speed_deg_per_min", Motion::Rotary, "[ABCS]",
             "mean speeds of axes that turn to and fro, `{ A = 100 }`"}};

void read_axis_speeds(TableReader& phase, kinematics::AxisVector& speeds,
                      const ThermalSetting& setting) {
  // Axes without a stated speed rest.
  if (setting.chain) speeds.setZero(setting.chain->size());
  for (const SpeedKey& key : speed_keys) {
    const Node* section = phase.section(key.name);
    if (!section || !setting.chain) continue;
    TableReader reader(*section, std::string("thermal.history.") + key.name, phase.input_errors());
    for (int j = 0; j < setting.chain->size(); ++j) {
      const Joint& joint = setting.chain->joints()[std::size_t(j)];
      if (joint.motion != key.motion) continue;
      const auto written = reader.number_as_written(std::string(1, joint.name), axis_speed);
      // The unit belongs to the name of the table and not to the letter of the axis.
      if (written) speeds[j] = *written * unit_of(key.name);
    }
    reader.close();
  }
}

void write_axis_speeds(const kinematics::AxisVector& speeds, Node::Table& to,
                       const ThermalSetting& setting) {
  for (const SpeedKey& key : speed_keys) {
    Node::Table axes;
    for (int j = 0; j < int(speeds.size()); ++j) {
      const Joint& joint = setting.chain->joints()[std::size_t(j)];
      if (joint.motion == key.motion && speeds[j] != 0.0)
        put(axes, std::string(1, joint.name), speeds[j] / unit_of(key.name));
    }
    if (!axes.empty()) put(to, key.name, std::move(axes));
  }
}

std::vector<Key> axis_speed_keys() {
  std::vector<Key> keys;
  for (const SpeedKey& one : speed_keys) {
    Key axis = make_key("<axis>", Key::Kind::Number, "of one axis, in the unit of the table");
    axis.pattern = one.axes;
    axis.range = axis_speed;
    Key key = make_key(KeyName(one.name).otherwise("0"), Key::Kind::Table, one.sentence);
    key.keys = {axis};
    keys.push_back(key);
  }
  return keys;
}

Range duration_range(const std::string& key) {
  return {0.0, longest_s / unit_of(key), true, false};
}

Fields<ThermalPhase> phase_fields(const ThermalSetting& setting) {
  std::vector<Key> durations = time_keys("duration", Key::Kind::Number, "how long it lasts");
  for (Key& key : durations) key.range = duration_range(key.name);
  return Fields<ThermalPhase>()
      .custom(
          {make_key("name", Key::Kind::Text, "of the phase, for people")},
          [](TableReader& reader, ThermalPhase&) { reader.text("name", ""); },
          [](const ThermalPhase&, Node::Table&) {})
      .custom(
          durations,
          [](TableReader& reader, ThermalPhase& phase) {
            if (const auto key = time_key(reader, "duration"))
              phase.duration = reader.number(*key, duration_range(*key));
          },
          [](const ThermalPhase& from, Node::Table& to) { put(to, "duration_s", from.duration); })
      .number("speed_rpm", &ThermalPhase::spindle_speed, phase_spindle_rpm, "of the spindle")
      .custom(
          axis_speed_keys(),
          [&setting](TableReader& reader, ThermalPhase& phase) {
            read_axis_speeds(reader, phase.axis_speed, setting);
          },
          [&setting](const ThermalPhase& from, Node::Table& to) {
            write_axis_speeds(from.axis_speed, to, setting);
          })
      .boolean("powered", &ThermalPhase::powered, "the machine is switched on")
      .boolean("coolant", &ThermalPhase::coolant, "the coolant flows");
}

void read_history(TableReader& reader, ThermalDescription& thermal, const ThermalSetting& setting) {
  const auto phases = reader.tables("history");
  if (phases.size() > most_rows) {
    reader.refuse("history", fmt::format("at most {} phases", most_rows),
                  fmt::format("{}", phases.size()));
    return;
  }
  const Fields<ThermalPhase> fields = phase_fields(setting);
  for (const Node* table : phases)
    thermal.history.push_back(
        fields.read_table(*table, named_table_path("history", *table), reader.input_errors()));
}

}  // namespace

Fields<ThermalDescription> room_fields() {
  Key constant = make_key(KeyName("room_C").otherwise("20"), Key::Kind::Number,
                          "temperature of a room that stays the same; or `room`");
  constant.range = temperature_range;
  Key room = make_key("room", Key::Kind::Table,
                      "temperature of the room, linear between its rows, held outside; at most "
                      "10 000 rows");
  room.keys = time_keys("time", Key::Kind::Numbers, "rising, before the program negative");
  room.keys.push_back(
      make_key(must("T_C"), Key::Kind::Numbers, "temperatures, one for each of the times"));
  return Fields<ThermalDescription>().custom({constant, room}, read_room, write_room);
}

Fields<ThermalDescription> history_fields(const ThermalSetting& setting) {
  return Fields<ThermalDescription>().tables(
      "history", &ThermalDescription::history, phase_fields(setting),
      "stretch of time before the program, in order; at most 10 000",
      [&setting](TableReader& reader, ThermalDescription& to) {
        read_history(reader, to, setting);
      });
}

namespace {

using errors::Surroundings;

constexpr Range power{0.0, 1e7};  // W
constexpr Range share_of_all{0.0, 1.0};
constexpr std::size_t max_nodes = 200;

// ---- nodes

struct ThermalNodeEntry {
  errors::ThermalNode node;
  std::optional<double> start_T_C;
};

Fields<ThermalNodeEntry> node_table_fields(const std::vector<std::string>& taken) {
  using errors::ThermalNode;
  const auto check_name = [taken](TableReader& reader, ThermalNode& node) {
    // Links use these two names for the surroundings.
    if (node.name == "room" || node.name == "coolant")
      reader.refuse("name", "a node not named room or coolant, which links know already",
                    node.name);
    check_name_is_free(reader, node.name, taken, "every node once");
  };
  const auto node = Fields<ThermalNode>()
                        .text(must("name"), &ThermalNode::name, "not `room` or `coolant`")
                        .check(check_name)
                        .number(must("capacity_J_per_K"), &ThermalNode::capacity_J_per_K, positive,
                                "heat that warms it by 1 K");
  return Fields<ThermalNodeEntry>()
      .all_of(&ThermalNodeEntry::node, node)
      .number(KeyName("start_C").otherwise("`start_C` of all"), &ThermalNodeEntry::start_T_C,
              temperature_range, "when the history begins");
}

void read_nodes(TableReader& reader, ThermalDescription& thermal) {
  const auto tables = reader.tables("node");
  if (!reader.has("node")) reader.missing("node", "a list of tables");
  if (tables.size() > max_nodes) {
    reader.refuse("node", fmt::format("at most {} nodes", max_nodes),
                  fmt::format("{}", tables.size()));
    return;
  }
  auto& [nodes, links, surroundings, sources, start_T_C] = thermal.network;
  // The default of all nodes is the first temperature of the room, hence the order of reading.
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

void write_nodes(const ThermalDescription& from, Node::Table& to) {
  Node::Array nodes;
  for (const errors::ThermalNode& node : from.network.nodes) {
    // Each node is written with its own start temperature, which may differ from the common one.
    const double start = from.network.start_T_C[Eigen::Index(nodes.size())];
    nodes.push_back(Node{{}, node_table_fields({}).written({node, start})});
  }
  put(to, "node", std::move(nodes));
}

// ---- links

using End = std::variant<int, Surroundings>;

struct ThermalLinkEntry {
  std::optional<std::array<End, 2>> ends;  ///< none: rejected
  double conductance_W_per_K = 1.0;
};

std::optional<End> read_end(const Node& word, const std::vector<std::string>& nodes,
                            InputErrors& input_errors) {
  const std::string& name = *word.text();
  if (name == "room") return End(Surroundings::Room);
  if (name == "coolant") return End(Surroundings::Coolant);
  const auto found = std::find(nodes.begin(), nodes.end(), name);
  if (found != nodes.end()) return End(int(found - nodes.begin()));
  report_unknown_node(word.place, "a node of the thermal network, \"room\" or \"coolant\"", name,
                      nodes, input_errors);
  return std::nullopt;
}

std::optional<std::array<End, 2>> read_ends(TableReader& reader,
                                            const std::vector<std::string>& nodes) {
  const Node* between = reader.accept_key("between");
  if (!between) {
    reader.missing("between", "two names");
    return std::nullopt;
  }
  const Node::Array* words = between->array();
  if (!words || words->size() != 2 || !(*words)[0].text() || !(*words)[1].text()) {
    reader.refuse("between", "two names for thermal.link.between", shown(*between));
    return std::nullopt;
  }
  const auto a = read_end((*words)[0], nodes, reader.input_errors());
  const auto b = read_end((*words)[1], nodes, reader.input_errors());
  if (!a || !b) return std::nullopt;
  // A link between two surroundings, or of a node with itself, moves no heat into the network.
  if (*a == *b || (a->index() == 1 && b->index() == 1)) {
    reader.refuse("between", "two different nodes, or a node and its surroundings",
                  *(*words)[0].text() + " and " + *(*words)[1].text());
    return std::nullopt;
  }
  return std::array{*a, *b};
}

Fields<ThermalLinkEntry> link_fields(const std::vector<std::string>& nodes) {
  const auto name_of_end = [&nodes](const End& end) {
    if (const int* node = std::get_if<int>(&end)) return nodes.at(std::size_t(*node));
    return std::string(std::get<Surroundings>(end) == Surroundings::Room ? "room" : "coolant");
  };
  const auto write_ends = [name_of_end](const ThermalLinkEntry& from, Node::Table& to) {
    Node::Array names;
    for (const End& end : *from.ends) names.push_back(Node{{}, name_of_end(end)});
    put(to, "between", std::move(names));
  };
  Key between =
      make_key(must("between"), Key::Kind::Texts,
               "two nodes, or a node and `room` or `coolant`, which takes heat only while "
               "it flows");
  between.size = 2;
  return Fields<ThermalLinkEntry>()
      .custom(
          {between},
          [&nodes](TableReader& reader, ThermalLinkEntry& link) {
            link.ends = read_ends(reader, nodes);
          },
          write_ends)
      .number(must("conductance_W_per_K"), &ThermalLinkEntry::conductance_W_per_K, positive,
              "heat that flows for 1 K between the two");
}

void read_links(TableReader& reader, errors::ThermalNetwork& network,
                const std::vector<std::string>& nodes) {
  for (const Node* table : reader.tables("link")) {
    const auto [ends, conductance] =
        link_fields(nodes).read_table(*table, "thermal.link", reader.input_errors());
    if (!ends) continue;
    auto [a, b] = *ends;
    // The network stores surroundings as the second end, so a reversed pair is swapped.
    if (a.index() == 1) std::swap(a, b);
    if (const auto* outside = std::get_if<Surroundings>(&b)) {
      network.surroundings.push_back({std::get<int>(a), *outside, conductance});
    } else {
      network.links.push_back({std::get<int>(a), std::get<int>(b), conductance});
    }
  }
}

Node::Array written_links(const errors::ThermalNetwork& network,
                          const std::vector<std::string>& nodes) {
  Node::Array links;
  const auto add = [&](const End& a, const End& b, double conductance) {
    links.push_back(Node{{}, link_fields(nodes).written({std::array{a, b}, conductance})});
  };
  for (const auto& link : network.links) add(link.a, link.b, link.conductance_W_per_K);
  for (const auto& link : network.surroundings) add(link.node, link.to, link.conductance_W_per_K);
  return links;
}

// ---- sources

using Law = decltype(errors::HeatSource::law);

Fields<errors::AxisHeat> friction_fields(bool slide) {
  using errors::AxisHeat;
  return Fields<AxisHeat>()
      .number(slide ? "coulomb_N" : "coulomb_Nm", &AxisHeat::coulomb, non_negative,
              slide ? "of a slide; one of the two at least" : "of an axis that turns")
      .number(slide ? "viscous_N_s_per_mm" : "viscous_Nm_s", &AxisHeat::viscous, non_negative,
              slide ? "of a slide" : "of an axis that turns");
}

std::optional<errors::AxisHeat> read_axis_heat(TableReader& reader, const ThermalSetting& setting) {
  const std::string name = reader.text("axis");
  const auto& joints = setting.machine.joints;
  const auto found = std::find_if(joints.begin(), joints.end(), [&](const Joint& joint) {
    return name == std::string(1, joint.name) && joint.motion != Motion::Spindle;
  });
  // An unknown axis reads the keys of a slide, so that its other errors are reported as well.
  const bool slide = found == joints.end() || found->motion == Motion::Linear;
  const Fields<errors::AxisHeat> friction = friction_fields(slide);
  errors::AxisHeat heat = friction.read(reader);
  const std::string coulomb = friction.keys()[0].name, viscous = friction.keys()[1].name;
  // One coefficient is enough; without either the axis would produce no heat.
  if (!reader.has(coulomb) && !reader.has(viscous))
    reader.missing(coulomb, "a number, or " + viscous + ",");
  if (found == joints.end()) {
    // Without a valid machine the axis cannot be judged.
    if (!name.empty() && setting.chain) reader.refuse("axis", "an axis of the machine", name);
    return std::nullopt;
  }
  // The spindle has a heat law of its own.
  if (name == "S") {
    reader.refuse("axis", "an axis; a spindle heats by kind = \"spindle\"", name);
    return std::nullopt;
  }
  heat.joint = int(found - joints.begin());
  return heat;
}

Alternative<Law> axis_heat(const ThermalSetting& setting) {
  Word word{"axis",
            "friction of an axis, (coulomb + viscous |v|) |v|",
            {make_key(must("axis"), Key::Kind::Text, "its letter")}};
  for (const bool slide : {true, false})
    for (const Key& key : friction_fields(slide).keys()) word.keys.push_back(key);
  const auto read = [&setting](TableReader& reader) {
    const auto heat = read_axis_heat(reader, setting);
    return heat ? Law(*heat) : Law();
  };
  const auto write = [&setting](const Law& law, Node::Table& to) {
    const auto* heat = std::get_if<errors::AxisHeat>(&law);
    if (!heat) return false;
    const Joint& joint = setting.machine.joints.at(std::size_t(heat->joint));
    put(to, "axis", std::string(1, joint.name));
    for (Node::Entry& entry : friction_fields(joint.motion == Motion::Linear).written(*heat))
      to.push_back(std::move(entry));
    return true;
  };
  return {std::move(word), read, write};
}

Fields<errors::HeatSource> law_fields(const ThermalSetting& setting) {
  using errors::CuttingHeat, errors::PowerOnHeat, errors::SpindleHeat, errors::HeatSource;
  const auto spindle =
      Fields<SpindleHeat>()
          .number(must("power_W"), &SpindleHeat::power_W, power, "at `at_rpm`")
          .number(must("at_rpm"), &SpindleHeat::reference_speed, positive,
                  "speed at which the power is stated")
          .number("exponent", &SpindleHeat::exponent, non_negative, "of the speed");
  const auto power_on = Fields<PowerOnHeat>().number(must("power_W"), &PowerOnHeat::power_W, power,
                                                     "while the machine is switched on");
  const auto cutting = Fields<CuttingHeat>().number(must("share"), &CuttingHeat::share,
                                                    share_of_all, "of the cutting power");
  return Fields<HeatSource>().kinds(
      must("kind"), &HeatSource::law,
      {alternative<Law>("spindle", spindle, "bearings and motor, power_W (n / at_rpm)^exponent"),
       axis_heat(setting), alternative<Law>("power_on", power_on, "motors and cabinets"),
       alternative<Law>("cutting", cutting, "a share of the cutting power")},
      "what makes the heat");
}

Fields<errors::HeatSource> source_node_fields(const std::vector<std::string>& nodes) {
  return node_fields<errors::HeatSource>(must("node"), &errors::HeatSource::node, nodes,
                                         "that is heated");
}

/// Returns true if a kind is present, on which the other keys depend.
bool has_kind(TableReader& reader, const Fields<errors::HeatSource>& law) {
  if (reader.has("kind")) return bool(reader.word("kind", words_of(law.keys().front()), false));
  reader.input_errors().add(reader.place(), "a kind of heat for thermal.source.kind", "nothing");
  return false;
}

void read_sources(TableReader& list, ThermalDescription& thermal, const ThermalSetting& setting) {
  const Fields<errors::HeatSource> law = law_fields(setting);
  for (const Node* table : list.tables("source")) {
    TableReader reader(*table, "thermal.source", list.input_errors());
    errors::HeatSource source = source_node_fields(setting.nodes).read(reader);
    // Without a kind the other keys are not read, and close() would call all of them unknown.
    if (!has_kind(reader, law)) continue;
    thermal.network.sources.push_back(law.read(reader, source));
    reader.close();
  }
}

}  // namespace

Fields<ThermalDescription> thermal_node_fields() {
  Key nodes =
      make_key(must("node"), Key::Kind::Tables,
               "lump with one temperature; at most 200, and heat must find a way to the room "
               "from every one without the coolant");
  nodes.keys = node_table_fields({}).keys();
  Key start = make_key(KeyName("start_C").otherwise("first of the room"), Key::Kind::Number,
                       "of every node when the history begins");
  start.range = temperature_range;
  return Fields<ThermalDescription>().custom({start, nodes}, read_nodes, write_nodes);
}

bool has_too_many_nodes(TableReader& reader) { return reader.tables("node").size() > max_nodes; }

Fields<ThermalDescription> thermal_link_fields(const std::vector<std::string>& nodes) {
  Key links = make_key("link", Key::Kind::Tables, "way of heat between two nodes or to the room");
  links.keys = link_fields(nodes).keys();
  return Fields<ThermalDescription>().custom(
      {links},
      [&nodes](TableReader& reader, ThermalDescription& thermal) {
        read_links(reader, thermal.network, nodes);
      },
      [&nodes](const ThermalDescription& from, Node::Table& to) {
        put(to, "link", written_links(from.network, nodes));
      });
}

Fields<ThermalDescription> thermal_source_fields(const ThermalSetting& setting) {
  return Fields<ThermalDescription>().tables(
      "source", [](auto& thermal) -> auto& { return thermal.network.sources; },
      source_node_fields(setting.nodes).all_of(std::identity{}, law_fields(setting)),
      "heat that goes into a node",
      [&setting](TableReader& reader, ThermalDescription& to) {
        read_sources(reader, to, setting);
      });
}

void check_network(const errors::ThermalNetwork& network, TableReader& reader) {
  // Heat that enters such a node could never leave it.
  if (const auto node = errors::isolated_node(network)) {
    const Node* table = reader.tables("node")[std::size_t(*node)];
    reader.input_errors().add(table->place,
                              "links over which heat reaches the room from thermal.node." +
                                  network.nodes[std::size_t(*node)].name,
                              "none");
    return;
  }
  errors::Activity rest;
  try {
    // A single step of rest is simulated, because the simulation applies its own tests to the
    // network.
    errors::simulate(network, {&rest, 1});
  } catch (const std::invalid_argument& fault) {
    reader.input_errors().add(reader.place(), "a thermal network that can be", fault.what());
  }
}

}  // namespace abbe::sim
