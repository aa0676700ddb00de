#include "errors/thermal_network.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "errors/element.h"

namespace abbe::errors {

using Eigen::Index;

namespace {

std::string node_name(const ThermalNetwork& network, int node) {
  return "node " + network.nodes[std::size_t(node)].name;
}

void check_nodes(const ThermalNetwork& network) {
  if (network.nodes.empty()) refuse("thermal network", "expected at least one node");
  if (network.start_T_C.size() != Index(network.nodes.size()))
    refuse("thermal network", fmt::format("expected {} start temperatures, seen {}",
                                          network.nodes.size(), network.start_T_C.size()));
  std::set<std::string> names;
  for (int i = 0; i < int(network.nodes.size()); ++i) {
    const ThermalNode& node = network.nodes[std::size_t(i)];
    if (node.name.empty()) refuse(fmt::format("node {}", i), "expected a name");
    const std::string who = node_name(network, i);
    // Links and sensors refer to nodes by name.
    if (!names.insert(node.name).second) refuse(who, "given twice");
    require_positive_value(node.capacity_J_per_K, who, "heat capacity");
    require_finite(network.start_T_C[i], who, "start temperature");
  }
}

void check_links(const ThermalNetwork& network) {
  const int nodes = int(network.nodes.size());
  for (const ThermalLink& link : network.links) {
    require_node(link.a, nodes, "link");
    require_node(link.b, nodes, "link");
    if (link.a == link.b) refuse(node_name(network, link.a), "linked to itself");
    require_positive_value(
        link.conductance_W_per_K,
        "link of " + node_name(network, link.a) + " and " + node_name(network, link.b),
        "conductance");
  }
  for (const SurroundingsLink& link : network.surroundings) {
    const char* surroundings_name = link.to == Surroundings::Room ? "room" : "coolant";
    require_node(link.node, nodes, fmt::format("link to the {}", surroundings_name));
    require_positive_value(
        link.conductance_W_per_K,
        fmt::format("link of {} to the {}", node_name(network, link.node), surroundings_name),
        "conductance");
  }
}

void check(const SpindleHeat& heat, const std::string& who) {
  require_not_negative(heat.power_W, who, "power");
  require_positive_value(heat.reference_speed, who, "reference speed");
  require_not_negative(heat.exponent, who, "exponent");
}
void check(const AxisHeat& heat, const std::string& who) {
  if (heat.joint < 0 || heat.joint >= kinematics::max_joints)
    refuse(who, fmt::format("expected a joint from 0 to {}, seen {}", kinematics::max_joints - 1,
                            heat.joint));
  require_not_negative(heat.coulomb, who, "Coulomb friction");
  require_not_negative(heat.viscous, who, "viscous friction");
}
void check(const PowerOnHeat& heat, const std::string& who) {
  require_not_negative(heat.power_W, who, "power");
}
void check(const CuttingHeat& heat, const std::string& who) {
  if (!(heat.share >= 0.0 && heat.share <= 1.0))
    refuse(who, fmt::format("expected a fraction of the cutting power from 0 to 1, seen {}",
                            heat.share));
}

void check_sources(const ThermalNetwork& network) {
  const int nodes = int(network.nodes.size());
  for (std::size_t i = 0; i < network.sources.size(); ++i) {
    const HeatSource& source = network.sources[i];
    const std::string who = fmt::format("heat source {}", i + 1);
    require_node(source.node, nodes, who);
    const std::string source_name = who + " at " + node_name(network, source.node);
    std::visit([&](const auto& law) { check(law, source_name); }, source.law);
  }
}

double law_heat_W(const SpindleHeat& heat, const Activity& activity) {
  const double speed = std::abs(activity.spindle_speed);
  if (speed == 0.0) return 0.0;  // also at exponent 0
  return heat.power_W * std::pow(speed / heat.reference_speed, heat.exponent);
}
double law_heat_W(const AxisHeat& heat, const Activity& activity) {
  // An activity at rest may have an empty vector of speeds.
  if (heat.joint >= activity.axis_speed.size()) return 0.0;
  const double speed = std::abs(activity.axis_speed[heat.joint]);
  return 1e-3 * (heat.coulomb + heat.viscous * speed) * speed;  // N mm/s are mW
}
double law_heat_W(const PowerOnHeat& heat, const Activity& activity) {
  return activity.powered ? heat.power_W : 0.0;
}
double law_heat_W(const CuttingHeat& heat, const Activity& activity) {
  return heat.share * activity.cutting_power_W;
}

}  // namespace

void validate(const ThermalNetwork& network) {
  check_nodes(network);
  check_links(network);
  check_sources(network);
  if (const auto node = isolated_node(network))
    refuse(node_name(network, *node), "no heat path to the room");
}

// Searches from the nodes that are linked to the room. Links to the coolant do not count, because
// it can be off forever, and a node without a path to the room then has no steady state.
std::optional<int> isolated_node(const ThermalNetwork& network) {
  std::vector<std::vector<int>> neighbours(network.nodes.size());
  for (const ThermalLink& link : network.links) {
    neighbours[std::size_t(link.a)].push_back(link.b);
    neighbours[std::size_t(link.b)].push_back(link.a);
  }
  std::vector<char> has_path(network.nodes.size(), 0);
  std::vector<int> pending;
  const auto visit = [&](int node) {
    if (!has_path[std::size_t(node)]) pending.push_back(node);
    has_path[std::size_t(node)] = 1;
  };
  for (const SurroundingsLink& link : network.surroundings)
    if (link.to == Surroundings::Room) visit(link.node);
  while (!pending.empty()) {
    const int node = pending.back();
    pending.pop_back();
    for (const int neighbour : neighbours[std::size_t(node)]) visit(neighbour);
  }
  const auto isolated = std::find(has_path.begin(), has_path.end(), 0);
  if (isolated == has_path.end()) return std::nullopt;
  return int(isolated - has_path.begin());
}

double heat_W(const HeatSource& source, const Activity& activity) {
  return std::visit([&](const auto& law) { return law_heat_W(law, activity); }, source.law);
}

}  // namespace abbe::errors
