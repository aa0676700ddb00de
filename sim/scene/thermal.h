#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "errors/thermal_elements.h"
#include "errors/thermal_run.h"
#include "kinematics/axes.h"
#include "sim/scene/machine.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// A stretch of time before the program, as the machine spent it.
struct ThermalPhase {
  double duration = 0.0;              ///< s
  double spindle_speed = 0.0;         ///< rad/s
  kinematics::AxisVector axis_speed;  ///< (joints) mean |v| of reciprocating axes, mm/s or rad/s
  bool powered = true;
  bool coolant = false;
};

/// Heat: the network, what it does to the elements, what came before the program. Time 0 is the
/// start of the program; the history ends there.
struct ThermalDescription {
  static constexpr double min_T_C = -273.15, max_T_C = 5000.0;  ///< of anything in it, ever
  errors::ThermalNetwork network;
  errors::ThermalErrors errors;
  std::vector<errors::TemperatureSensor> sensors;
  std::vector<ThermalPhase> history;  ///< in order, the last one ends at time 0
  Eigen::VectorXd room_time_s;        ///< (n >= 1) the room is linear between, held outside
  Eigen::VectorXd room_T_C;           ///< (n)
  double coolant_T_C = 20.0;
  bool powered = true;    ///< while the program runs
  bool coolant = false;   ///< the same
  double interval = 1.0;  ///< s, in the program heat flows are linear over stretches of this length
  double scale = 1.0;     ///< of all that heat does to elements and workpiece
  struct Plot {
    errors::ElementName element;
    Eigen::VectorXd time_s;                      ///< (n) instants whose curves are drawn
    std::optional<std::array<double, 2>> range;  ///< mm or rad; else the travel
  };
  std::vector<Plot> plots;
};

/// How long the history lasted, s.
inline double history_s(const ThermalDescription& thermal) {
  double sum = 0.0;
  for (const ThermalPhase& phase : thermal.history) sum += phase.duration;
  return sum;
}

struct Key;

/// `[thermal]`: network, thermal elements, sensors, history, room.
ThermalDescription read_thermal(const Node& table, const MachineDescription& machine,
                                std::uint64_t seed, InputErrors& input_errors);
/// @param seed  of the scene, for the sensors without one of their own
Node::Table written_thermal(const ThermalDescription& thermal, const MachineDescription& machine,
                            std::uint64_t seed);
std::vector<Key> thermal_keys();

}  // namespace abbe::sim
