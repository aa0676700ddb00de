#pragma once

#include "sim/scene/thermal_setting.h"

/// The network of `[thermal]`: nodes, links, sources.
namespace abbe::sim {

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
