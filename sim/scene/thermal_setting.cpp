#include "sim/scene/thermal_setting.h"

#include <algorithm>
#include <array>
#include <set>
#include <stdexcept>

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

std::string where_of(const std::string& list, const Node& table) {
  const Node* name = table.find("name");
  return "thermal." + list + (name && name->text() ? "." + *name->text() : "");
}

void bind_alone(const errors::ThermalErrors& alone, const ThermalSetting& setting,
                const Place& place, Faults& faults) {
  if (!setting.chain || setting.nodes.empty()) return;
  try {
    errors::bind(alone, *setting.chain, int(setting.nodes.size()));
  } catch (const std::invalid_argument& fault) {
    faults.add(place, "thermal errors that fit the machine", fault.what());
  }
}

void refuse_taken(TableReader& reader, const std::string& name,
                  const std::vector<std::string>& taken, const char* once) {
  if (!name.empty() && std::find(taken.begin(), taken.end(), name) != taken.end())
    reader.refuse("name", once, name + " again");
}

std::vector<Key> time_keys(const std::string& stem, Key::Kind kind, const char* sentence) {
  std::vector<Key> keys;
  for (const std::string& name : in_units(stem))
    keys.push_back(key_of(KeyName(name).one_of(stem), kind, sentence));
  return keys;
}

std::optional<std::string> time_key(TableReader& reader, const std::string& stem) {
  std::vector<std::string> there;
  std::string all;
  for (const std::string& key : in_units(stem)) {
    if (reader.know(key)) there.push_back(key);
    all += (all.empty() ? "" : ", ") + key;
  }
  if (there.size() == 1) return there.front();
  if (there.empty()) reader.missing(in_units(stem).front(), "one of " + all);
  for (std::size_t i = 1; i < there.size(); ++i)
    reader.refuse(there[i], "only one of " + all, there[0] + " and " + there[i]);
  return std::nullopt;
}

int node_of(TableReader& reader, const std::string& key, const std::vector<std::string>& nodes) {
  const std::string name = reader.text(key);
  if (name.empty()) return 0;
  const auto found = std::find(nodes.begin(), nodes.end(), name);
  if (found != nodes.end()) return int(found - nodes.begin());
  refuse_node(reader.know(key)->place, "a node of the thermal network for " + key, name, nodes,
              reader.faults());
  return 0;
}

void refuse_node(const Place& place, const std::string& expected, const std::string& name,
                 const std::vector<std::string>& nodes, Faults& faults) {
  std::set<std::string> names(nodes.begin(), nodes.end());
  names.erase("");
  const auto meant = nearest(name, names);
  faults.add(place, expected, "\"" + name + "\"" + (meant ? " (nearest: \"" + *meant + "\")" : ""));
}

}  // namespace abbe::sim
