#include "sim/scene/scene_thermal_network.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include <fmt/format.h>

namespace abbe::sim {

namespace {

using errors::Surroundings;
using kinematics::Joint;
using kinematics::Motion;

constexpr Range power{0.0, 1e7};  // W
constexpr Range share_of_all{0.0, 1.0};
constexpr std::size_t most_nodes = 200;

// ---- nodes

struct NodeAsWritten {
  errors::ThermalNode node;
  std::optional<double> start_T_C;
};

Fields<NodeAsWritten> node_table_fields(const std::vector<std::string>& taken) {
  using errors::ThermalNode;
  const auto check_name = [taken](TableReader& reader, ThermalNode& node) {
    if (node.name == "room" || node.name == "coolant")
      reader.refuse("name", "a node not named room or coolant, which links know already",
                    node.name);
    refuse_taken(reader, node.name, taken, "every node once");
  };
  const auto node = Fields<ThermalNode>()
                        .text(must("name"), &ThermalNode::name, "not `room` or `coolant`")
                        .check(check_name)
                        .number(must("capacity_J_per_K"), &ThermalNode::capacity_J_per_K, positive,
                                "heat that warms it by 1 K");
  return Fields<NodeAsWritten>()
      .all_of(&NodeAsWritten::node, node)
      .number(KeyName("start_C").otherwise("`start_C` of all"), &NodeAsWritten::start_T_C,
              temperature_range, "when the history begins");
}

void read_nodes(TableReader& reader, ThermalDescription& thermal) {
  const auto tables = reader.tables("node");
  if (!reader.has("node")) reader.missing("node", "a list of tables");
  if (tables.size() > most_nodes) {
    reader.refuse("node", fmt::format("at most {} nodes", most_nodes),
                  fmt::format("{}", tables.size()));
    return;
  }
  auto& [nodes, links, surroundings, sources, start_T_C] = thermal.network;
  start_T_C.setConstant(Eigen::Index(tables.size()),
                        reader.number("start_C", temperature_range, thermal.room_T_C[0]));
  std::vector<std::string> names;
  for (const Node* table : tables) {
    const auto [node, start] =
        node_table_fields(names).read_table(*table, where_of("node", *table), reader.faults());
    if (start) start_T_C[Eigen::Index(nodes.size())] = *start;
    names.push_back(node.name);
    nodes.push_back(node);
  }
}

void write_nodes(const ThermalDescription& from, Node::Table& to) {
  Node::Array nodes;
  for (const errors::ThermalNode& node : from.network.nodes) {
    const double start = from.network.start_T_C[Eigen::Index(nodes.size())];
    nodes.push_back(Node{{}, node_table_fields({}).written({node, start})});
  }
  put(to, "node", std::move(nodes));
}

// ---- links

using End = std::variant<int, Surroundings>;

struct LinkAsWritten {
  std::optional<std::array<End, 2>> ends;  ///< none: refused
  double conductance_W_per_K = 1.0;
};

std::optional<End> read_end(const Node& word, const std::vector<std::string>& nodes,
                            Faults& faults) {
  const std::string& name = *word.text();
  if (name == "room") return End(Surroundings::Room);
  if (name == "coolant") return End(Surroundings::Coolant);
  const auto found = std::find(nodes.begin(), nodes.end(), name);
  if (found != nodes.end()) return End(int(found - nodes.begin()));
  refuse_node(word.place, "a node of the thermal network, \"room\" or \"coolant\"", name, nodes,
              faults);
  return std::nullopt;
}

std::optional<std::array<End, 2>> read_ends(TableReader& reader,
                                            const std::vector<std::string>& nodes) {
  const Node* between = reader.know("between");
  if (!between) {
    reader.missing("between", "two names");
    return std::nullopt;
  }
  const Node::Array* words = between->array();
  if (!words || words->size() != 2 || !(*words)[0].text() || !(*words)[1].text()) {
    reader.refuse("between", "two names for thermal.link.between", shown(*between));
    return std::nullopt;
  }
  const auto a = read_end((*words)[0], nodes, reader.faults());
  const auto b = read_end((*words)[1], nodes, reader.faults());
  if (!a || !b) return std::nullopt;
  if (*a == *b || (a->index() == 1 && b->index() == 1)) {
    reader.refuse("between", "two different nodes, or a node and its surroundings",
                  *(*words)[0].text() + " and " + *(*words)[1].text());
    return std::nullopt;
  }
  return std::array{*a, *b};
}

Fields<LinkAsWritten> link_fields(const std::vector<std::string>& nodes) {
  const auto name_of_end = [&nodes](const End& end) {
    if (const int* node = std::get_if<int>(&end)) return nodes.at(std::size_t(*node));
    return std::string(std::get<Surroundings>(end) == Surroundings::Room ? "room" : "coolant");
  };
  const auto write_ends = [name_of_end](const LinkAsWritten& from, Node::Table& to) {
    Node::Array names;
    for (const End& end : *from.ends) names.push_back(Node{{}, name_of_end(end)});
    put(to, "between", std::move(names));
  };
  Key between = key_of(must("between"), Key::Kind::Texts,
                       "two nodes, or a node and `room` or `coolant`, which takes heat only while "
                       "it flows");
  between.size = 2;
  return Fields<LinkAsWritten>()
      .custom(
          {between},
          [&nodes](TableReader& reader, LinkAsWritten& link) {
            link.ends = read_ends(reader, nodes);
          },
          write_ends)
      .number(must("conductance_W_per_K"), &LinkAsWritten::conductance_W_per_K, positive,
              "heat that flows for 1 K between the two");
}

void read_links(TableReader& reader, errors::ThermalNetwork& network,
                const std::vector<std::string>& nodes) {
  for (const Node* table : reader.tables("link")) {
    const auto [ends, conductance] =
        link_fields(nodes).read_table(*table, "thermal.link", reader.faults());
    if (!ends) continue;
    auto [a, b] = *ends;
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
  const bool slide = found == joints.end() || found->motion == Motion::Linear;
  const Fields<errors::AxisHeat> friction = friction_fields(slide);
  errors::AxisHeat heat = friction.read(reader);
  const std::string coulomb = friction.keys()[0].name, viscous = friction.keys()[1].name;
  if (!reader.has(coulomb) && !reader.has(viscous))
    reader.missing(coulomb, "a number, or " + viscous + ",");
  if (found == joints.end()) {
    if (!name.empty() && setting.chain) reader.refuse("axis", "an axis of the machine", name);
    return std::nullopt;
  }
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
            {key_of(must("axis"), Key::Kind::Text, "its letter")}};
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

/// Whether there is a kind, on which the other keys depend.
bool has_kind(TableReader& reader, const Fields<errors::HeatSource>& law) {
  if (reader.has("kind")) return bool(reader.word("kind", words_of(law.keys().front()), false));
  reader.faults().add(reader.place(), "a kind of heat for thermal.source.kind", "nothing");
  return false;
}

void read_sources(TableReader& list, ThermalDescription& thermal, const ThermalSetting& setting) {
  const Fields<errors::HeatSource> law = law_fields(setting);
  for (const Node* table : list.tables("source")) {
    TableReader reader(*table, "thermal.source", list.faults());
    errors::HeatSource source = source_node_fields(setting.nodes).read(reader);
    if (!has_kind(reader, law)) continue;
    thermal.network.sources.push_back(law.read(reader, source));
    reader.close();
  }
}

}  // namespace

Fields<ThermalDescription> thermal_node_fields() {
  Key nodes = key_of(must("node"), Key::Kind::Tables,
                     "lump with one temperature; at most 200, and heat must find a way to the room "
                     "from every one without the coolant");
  nodes.keys = node_table_fields({}).keys();
  Key start = key_of(KeyName("start_C").otherwise("first of the room"), Key::Kind::Number,
                     "of every node when the history begins");
  start.range = temperature_range;
  return Fields<ThermalDescription>().custom({start, nodes}, read_nodes, write_nodes);
}

bool has_too_many_nodes(TableReader& reader) { return reader.tables("node").size() > most_nodes; }

Fields<ThermalDescription> thermal_link_fields(const std::vector<std::string>& nodes) {
  Key links = key_of("link", Key::Kind::Tables, "way of heat between two nodes or to the room");
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
  if (const auto node = errors::cut_off_node(network)) {
    const Node* table = reader.tables("node")[std::size_t(*node)];
    reader.faults().add(table->place,
                        "links over which heat reaches the room from thermal.node." +
                            network.nodes[std::size_t(*node)].name,
                        "none");
    return;
  }
  errors::Activity rest;
  try {
    errors::simulate(network, {&rest, 1});
  } catch (const std::invalid_argument& fault) {
    reader.faults().add(reader.place(), "a thermal network that can be", fault.what());
  }
}

}  // namespace abbe::sim
