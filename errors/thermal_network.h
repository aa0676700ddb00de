#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "kinematics/axes.h"

namespace abbe::errors {

// Lumped thermal network of a machine. Heat is in W, J/K and W/K, temperatures T_C in deg C,
// changes dT_K in K, time in s.

/// A body of the machine with one temperature.
struct ThermalNode {
  std::string name;
  double capacity_J_per_K = 1.0;  ///< > 0
};

/// A link with a heat flow from `a` to `b` proportional to T_a - T_b.
struct ThermalLink {
  int a = 0;
  int b = 0;
  double conductance_W_per_K = 0.0;  ///< > 0
};

/// Surroundings whose temperature the machine does not affect.
enum class Surroundings {
  Room,     ///< always in contact
  Coolant,  ///< only while the coolant flows
};
/// A link between a node and the surroundings.
struct SurroundingsLink {
  int node = 0;
  Surroundings to = Surroundings::Room;
  double conductance_W_per_K = 0.0;  ///< > 0
};

/// Heat of spindle bearings and motor: power (n / reference)^exponent.
struct SpindleHeat {
  double power_W = 0.0;
  double reference_speed = 1.0;  ///< rad/s, > 0
  double exponent = 1.0;         ///< >= 0; no heat at rest
};
/// Friction heat of an axis: (coulomb + viscous |v|) |v|.
struct AxisHeat {
  int joint = 0;         ///< index in the chain
  double coulomb = 0.0;  ///< N, or N mm of a rotary axis, >= 0
  double viscous = 0.0;  ///< N s/mm, or N mm s/rad, >= 0
};
/// Heat of motors and cabinets while the machine is switched on.
struct PowerOnHeat {
  double power_W = 0.0;
};
/// A fraction of the cutting power.
struct CuttingHeat {
  double share = 0.0;  ///< 0 .. 1
};
/// A source that heats one node.
struct HeatSource {
  int node = 0;
  std::variant<SpindleHeat, AxisHeat, PowerOnHeat, CuttingHeat> law;
};

/// Lumped thermal network. Every node has a path to the room over its links.
struct ThermalNetwork {
  std::vector<ThermalNode> nodes;
  std::vector<ThermalLink> links;
  std::vector<SurroundingsLink> surroundings;
  std::vector<HeatSource> sources;
  Eigen::VectorXd start_T_C;  ///< (nodes) at the beginning of the history
};

/// Checks a network.
/// @throws std::invalid_argument naming the node or source: a capacity or conductance that is not
///         positive, an index out of range, a node linked to itself, a name twice or empty, a node
///         without a path to the room, a number that is not finite, no node at all
void validate(const ThermalNetwork& network);

/// Returns the first node without a path to the room; empty if every node has one.
std::optional<int> isolated_node(const ThermalNetwork& network);

/// Activity of the machine at an instant, a knot of its history. Between two knots heat flows and
/// the temperatures of the surroundings change linearly; `coolant` holds until the next knot. Two
/// knots at the same instant are a jump.
struct Activity {
  double time_s = 0.0;
  double spindle_speed = 0.0;         ///< rad/s
  kinematics::AxisVector axis_speed;  ///< (joints) mean |v|, mm/s or rad/s; if empty, all are at
                                      ///< rest
  bool powered = true;
  double cutting_power_W = 0.0;
  bool coolant = false;
  double room_T_C = 20.0;
  double coolant_T_C = 20.0;
};

/// Returns the heat of a source in a state of the machine, W.
double heat_W(const HeatSource& source, const Activity& activity);

}  // namespace abbe::errors
