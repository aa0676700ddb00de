#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sim/scene/fields.h"
#include "sim/scene/machine.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/thermal.h"

/// Definitions common to the parts of `[thermal]`.
namespace abbe::sim {

inline constexpr Range temperature_range{ThermalDescription::min_T_C, ThermalDescription::max_T_C};
inline constexpr double longest_s = 1e10;  // three centuries

/// Data on which the keys depend.
struct ThermalSetting {
  MachineDescription machine;
  std::optional<kinematics::Chain> chain;  ///< none if the machine has errors
  std::vector<std::string> nodes;          ///< node names of the network
  std::uint64_t seed = 0;
};
ThermalSetting thermal_setting(const MachineDescription& machine,
                               const errors::ThermalNetwork& network, std::uint64_t seed);

/// Returns the path of a table in a list by its name, such as "thermal.node.column", as used by
/// --set.
std::string named_table_path(const std::string& list, const Node& table);

/// Binds one thermal effect without the others, so that an error is reported at its position.
void check_binding(const errors::ThermalErrors& alone, const ThermalSetting& setting,
                   const Place& place, InputErrors& input_errors);

/// Rejects a name that another table of the list has.
void check_name_is_free(TableReader& reader, const std::string& name,
                        const std::vector<std::string>& taken, const char* once);

/// Returns the keys of a time, or of a list of times, in h, min or s.
std::vector<Key> time_keys(const std::string& stem, Key::Kind kind, const char* sentence);
/// Returns the one of these keys that is present; none, with a message, unless there is exactly
/// one.
std::optional<std::string> time_key(TableReader& reader, const std::string& stem);

/// Returns the index of the node that a key names; 0, with a message, if there is none.
int node_of(TableReader& reader, const std::string& key, const std::vector<std::string>& nodes);
/// Reports a node that is not in the network.
void report_unknown_node(const Place& place, const std::string& expected, const std::string& name,
                         const std::vector<std::string>& nodes, InputErrors& input_errors);

/// Returns the field of a key that names a node. @param nodes  must outlive the fields
template <typename T, typename M>
Fields<T> node_fields(const KeyName& name, M member, const std::vector<std::string>& nodes,
                      const char* sentence) {
  const Key key = make_key(name, Key::Kind::Text, sentence);
  return Fields<T>().custom(
      {key},
      [key, member, &nodes](TableReader& reader, T& to) {
        if (key.required || reader.accept_key(key.name))
          std::invoke(member, to) = node_of(reader, key.name, nodes);
      },
      [key, member, &nodes](const T& from, Node::Table& to) {
        const std::optional<int> node = std::invoke(member, from);
        if (node) put(to, key.name, nodes.at(std::size_t(*node)));
      });
}

// The day of a machine: the room temperature and the activity before the program.

/// Returns the fields `room_C` and `room`.
Fields<ThermalDescription> room_fields();

/// Returns the field `history`. @param setting  must outlive the fields
Fields<ThermalDescription> history_fields(const ThermalSetting& setting);

// The network of `[thermal]`: nodes, links and sources.

/// Returns the fields `node` and `start_C`; too many nodes are dropped. The room is read before.
Fields<ThermalDescription> thermal_node_fields();
/// Returns true for more than 200 nodes, whose modes take long to compute.
bool has_too_many_nodes(TableReader& reader);

/// @param nodes  must outlive the fields
Fields<ThermalDescription> thermal_link_fields(const std::vector<std::string>& nodes);

/// @param setting  must outlive the fields
Fields<ThermalDescription> thermal_source_fields(const ThermalSetting& setting);

/// Rejects a network that cannot be simulated although each of its keys is correct.
void check_network(const errors::ThermalNetwork& network, TableReader& reader);

}  // namespace abbe::sim
