#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sim/scene/fields.h"
#include "sim/scene/machine.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/thermal.h"

/// Readers of the room, the history and the network of `[thermal]`, and helpers for its other
/// parts.
namespace abbe::sim {

inline constexpr Range temperature_range{ThermalDescription::min_T_C, ThermalDescription::max_T_C};
inline constexpr double max_time_s = 1e10;  // three centuries

/// The parts of the scene that reading `[thermal]` needs.
struct ThermalContext {
  MachineDescription machine;
  std::optional<kinematics::Chain> chain;  ///< none if the machine is invalid
  std::vector<std::string> nodes;          ///< node names of the network
  std::uint64_t seed = 0;
};
ThermalContext thermal_context(const MachineDescription& machine,
                               const errors::ThermalNetwork& network, std::uint64_t seed);

/// Returns the path of a table in a list by its name, such as "thermal.node.column", as --set takes
/// it.
std::string named_table_path(const std::string& list, const Node& table);

/// Checks that a single thermal effect fits the machine, and reports an error at its position.
void check_binding(const errors::ThermalErrors& effect, const ThermalContext& context,
                   const SourcePosition& position, InputErrors& input_errors);

/// Reports a name that another table of the list has.
/// @param used_names  names of the other tables
/// @param expected  text of the message
void check_name_is_free(TableReader& reader, const std::string& name,
                        const std::vector<std::string>& used_names, const char* expected);

/// Returns the keys of a time, or of a list of times, in h, min and s, of which a table has one.
std::vector<Key> time_keys(const std::string& stem, Key::Kind kind, const char* sentence);
/// Returns the one of these keys that is present. If there is none or more than one, reports it and
/// returns nothing.
std::optional<std::string> time_key(TableReader& reader, const std::string& stem);

/// Returns the index of the node that a key names. If there is none, reports it and returns 0.
int read_node(TableReader& reader, const std::string& key, const std::vector<std::string>& nodes);
/// Returns the field of a key that names a node.
/// @param nodes  must outlive the fields
template <typename T, typename M>
Fields<T> node_fields(const KeyName& name, M member, const std::vector<std::string>& nodes,
                      const char* sentence) {
  const Key key = make_key(name, Key::Kind::Text, sentence);
  return Fields<T>().custom_field(
      {key},
      [key, member, &nodes](TableReader& reader, T& target) {
        if (key.required || reader.accept_key(key.name))
          std::invoke(member, target) = read_node(reader, key.name, nodes);
      },
      [key, member, &nodes](const T& source, Node::Table& table) {
        const std::optional<int> node = std::invoke(member, source);
        if (node) put_value(table, key.name, nodes.at(std::size_t(*node)));
      });
}

// The room temperature and the activity of the machine before the program.

/// Returns the fields `room_C` and `room`.
Fields<ThermalDescription> room_fields();

/// Returns the field `history`.
/// @param context  must outlive the fields
Fields<ThermalDescription> history_fields(const ThermalContext& context);

// The network: nodes, links and sources.

/// Returns the fields `node` and `start_C`. The room must be read before. Too many nodes are
/// reported and not read.
Fields<ThermalDescription> thermal_node_fields();
/// Returns true if there are more than 200 nodes, whose modes would take long to compute.
bool has_too_many_nodes(TableReader& reader);

/// Returns the field `link`.
/// @param nodes  must outlive the fields
Fields<ThermalDescription> thermal_link_fields(const std::vector<std::string>& nodes);

/// Returns the field `source`.
/// @param context  must outlive the fields
Fields<ThermalDescription> thermal_source_fields(const ThermalContext& context);

/// Reports a network that cannot be simulated although each of its keys is valid.
void check_network(const errors::ThermalNetwork& network, TableReader& reader);

}  // namespace abbe::sim
