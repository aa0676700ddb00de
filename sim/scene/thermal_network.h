#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sim/scene/fields.h"
#include "sim/scene/machine.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/thermal.h"

/// What the parts of `[thermal]` share.
namespace abbe::sim {

inline constexpr Range temperature_range{ThermalDescription::min_T_C, ThermalDescription::max_T_C};
inline constexpr double longest_s = 1e10;  // three centuries

/// What the keys depend on.
struct ThermalSetting {
  MachineDescription machine;
  std::optional<kinematics::Chain> chain;  ///< none if the machine has faults
  std::vector<std::string> nodes;          ///< of the network, by name
  std::uint64_t seed = 0;
};
ThermalSetting thermal_setting(const MachineDescription& machine,
                               const errors::ThermalNetwork& network, std::uint64_t seed);

/// "thermal.node.column": a table of a list by its name, as --set finds it.
std::string named_table_path(const std::string& list, const Node& table);

/// Binds what heat does without the rest, so that a refusal is reported where it stands.
void check_binding(const errors::ThermalErrors& alone, const ThermalSetting& setting,
                   const Place& place, InputErrors& input_errors);

/// Refuses a name that another table of the list has.
void check_name_is_free(TableReader& reader, const std::string& name,
                        const std::vector<std::string>& taken, const char* once);

/// A time or a list of them in h, min or s.
std::vector<Key> time_keys(const std::string& stem, Key::Kind kind, const char* sentence);
/// Which of them is there; none if there is not exactly one, which is reported.
std::optional<std::string> time_key(TableReader& reader, const std::string& stem);

/// Index of the node that a key names; 0 if there is none, which is reported.
int node_of(TableReader& reader, const std::string& key, const std::vector<std::string>& nodes);
/// Reports a node that is not in the network.
void report_unknown_node(const Place& place, const std::string& expected, const std::string& name,
                         const std::vector<std::string>& nodes, InputErrors& input_errors);

/// A key that names a node. @param nodes  must outlive the fields
template <typename T, typename M>
Fields<T> node_fields(const KeyName& name, M member, const std::vector<std::string>& nodes,
                      const char* sentence) {
  const Key key = make_field_key(name, Key::Kind::Text, sentence);
  return Fields<T>().custom(
      {key},
      [key, member, &nodes](TableReader& reader, T& to) {
        if (key.required || reader.know(key.name))
          std::invoke(member, to) = node_of(reader, key.name, nodes);
      },
      [key, member, &nodes](const T& from, Node::Table& to) {
        const std::optional<int> node = std::invoke(member, from);
        if (node) put(to, key.name, nodes.at(std::size_t(*node)));
      });
}

// The day of a machine: its room, and what it did before the program.

/// `room_C` and `room`.
Fields<ThermalDescription> room_fields();

/// `history`. @param setting  must outlive the fields
Fields<ThermalDescription> history_fields(const ThermalSetting& setting);

// The network of `[thermal]`: nodes, links, sources.

/// `node` and `start_C`; nothing of them where there are too many. The room is read before.
Fields<ThermalDescription> thermal_node_fields();
/// More than 200, of which the modes take long.
bool has_too_many_nodes(TableReader& reader);

/// @param nodes  must outlive the fields
Fields<ThermalDescription> thermal_link_fields(const std::vector<std::string>& nodes);

/// @param setting  must outlive the fields
Fields<ThermalDescription> thermal_source_fields(const ThermalSetting& setting);

/// Refuses a network that cannot be simulated, each of whose keys is right.
void check_network(const errors::ThermalNetwork& network, TableReader& reader);

}  // namespace abbe::sim
