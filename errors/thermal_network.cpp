#include "errors/thermal_network.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "errors/element.h"

namespace abbe::errors {

using Eigen::Index;

namespace {

std::string named(const ThermalNetwork& network, int node) {
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
    const std::string who = named(network, i);
    // Links and sensors refer to nodes by name.
    if (!names.insert(node.name).second) refuse(who, "comes twice");
    expect_positive(node.capacity_J_per_K, who, "heat capacity");
    expect_finite(network.start_T_C[i], who, "start temperature");
  }
}

void check_links(const ThermalNetwork& network) {
  const int nodes = int(network.nodes.size());
  for (const ThermalLink& link : network.links) {
    expect_node(link.a, nodes, "link");
    expect_node(link.b, nodes, "link");
    if (link.a == link.b) refuse(named(network, link.a), "is linked to itself");
    expect_positive(link.conductance_W_per_K,
                    "link of " + named(network, link.a) + " and " + named(network, link.b),
                    "conductance");
  }
  for (const SurroundingsLink& link : network.surroundings) {
    const char* to = link.to == Surroundings::Room ? "room" : "coolant";
    expect_node(link.node, nodes, fmt::format("link to the {}", to));
    expect_positive(link.conductance_W_per_K,
                    fmt::format("link of {} to the {}", named(network, link.node), to),
                    "conductance");
  }
}

void check(const SpindleHeat& heat, const std::string& who) {
  expect_not_negative(heat.power_W, who, "power");
  expect_positive(heat.reference_speed, who, "reference speed");
  expect_not_negative(heat.exponent, who, "exponent");
}
void check(const AxisHeat& heat, const std::string& who) {
  if (heat.joint < 0 || heat.joint >= kinematics::max_joints)
    refuse(who, fmt::format("expected a joint 0 .. {}, seen {}", kinematics::max_joints - 1,
                            heat.joint));
  expect_not_negative(heat.coulomb, who, "Coulomb friction");
  expect_not_negative(heat.viscous, who, "viscous friction");
}
void check(const PowerOnHeat& heat, const std::string& who) {
  expect_not_negative(heat.power_W, who, "power");
}
void check(const CuttingHeat& heat, const std::string& who) {
  if (!(heat.share >= 0.0 && heat.share <= 1.0))
    refuse(who, fmt::format("expected a share of the cutting power, 0 .. 1, seen {}", heat.share));
}

void check_sources(const ThermalNetwork& network) {
  const int nodes = int(network.nodes.size());
  for (std::size_t i = 0; i < network.sources.size(); ++i) {
    const HeatSource& source = network.sources[i];
    const std::string who = fmt::format("heat source {}", i + 1);
    expect_node(source.node, nodes, who);
    const std::string where = who + " at " + named(network, source.node);
    std::visit([&](const auto& law) { check(law, where); }, source.law);
  }
}

double watts(const SpindleHeat& heat, const Activity& activity) {
  const double speed = std::abs(activity.spindle_speed);
  if (speed == 0.0) return 0.0;  // also at exponent 0
  return heat.power_W * std::pow(speed / heat.reference_speed, heat.exponent);
}
double watts(const AxisHeat& heat, const Activity& activity) {
  // An activity at rest may have an empty vector of speeds.
  if (heat.joint >= activity.axis_speed.size()) return 0.0;
  const double speed = std::abs(activity.axis_speed[heat.joint]);
  return 1e-3 * (heat.coulomb + heat.viscous * speed) * speed;  // N mm/s are mW
}
double watts(const PowerOnHeat& heat, const Activity& activity) {
  return activity.powered ? heat.power_W : 0.0;
}
double watts(const CuttingHeat& heat, const Activity& activity) {
  return heat.share * activity.cutting_power_W;
}

}  // namespace

void validate(const ThermalNetwork& network) {
  check_nodes(network);
  check_links(network);
  check_sources(network);
  if (const auto node = isolated_node(network))
    refuse(named(network, *node), "no heat can reach the room from it");
}

// Breadth first search from the nodes that have a link to the room. The coolant does not count: it
// can be off for ever, and a node without any path has no steady state.
std::optional<int> isolated_node(const ThermalNetwork& network) {
  std::vector<std::vector<int>> neighbours(network.nodes.size());
  for (const ThermalLink& link : network.links) {
    neighbours[std::size_t(link.a)].push_back(link.b);
    neighbours[std::size_t(link.b)].push_back(link.a);
  }
  std::vector<char> reaches(network.nodes.size(), 0);
  std::vector<int> waiting;
  const auto visit = [&](int node) {
    if (!reaches[std::size_t(node)]) waiting.push_back(node);
    reaches[std::size_t(node)] = 1;
  };
  for (const SurroundingsLink& link : network.surroundings)
    if (link.to == Surroundings::Room) visit(link.node);
  while (!waiting.empty()) {
    const int node = waiting.back();
    waiting.pop_back();
    for (const int next : neighbours[std::size_t(node)]) visit(next);
  }
  const auto first = std::find(reaches.begin(), reaches.end(), 0);
  if (first == reaches.end()) return std::nullopt;
  return int(first - reaches.begin());
}

double heat_W(const HeatSource& source, const Activity& activity) {
  return std::visit([&](const auto& law) { return watts(law, activity); }, source.law);
}

}  // namespace abbe::errors
