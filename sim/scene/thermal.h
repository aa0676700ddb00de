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

/// A period of constant activity of the machine, before the program.
struct ThermalPhase {
  double duration = 0.0;              ///< s
  double spindle_speed = 0.0;         ///< rad/s
  kinematics::AxisVector axis_speed;  ///< (joints) mean |v| of reciprocating axes, mm/s or rad/s
  bool powered = true;
  bool coolant = false;
};

/// The thermal network, its effect on the elements, and the history before the program. Time 0 is
/// the start of the program.
struct ThermalDescription {
  static constexpr double min_T_C = -273.15, max_T_C = 5000.0;  ///< limits of every temperature
  errors::ThermalNetwork network;
  errors::ThermalErrors errors;
  std::vector<errors::TemperatureSensor> sensors;
  std::vector<ThermalPhase> history;  ///< in order; the last phase ends at time 0
  Eigen::VectorXd room_time_s;        ///< (n >= 1) s; the room temperature is linear between these
                                      ///< times and constant outside
  Eigen::VectorXd room_T_C;           ///< (n)
  double coolant_T_C = 20.0;
  bool powered = true;    ///< during the program
  bool coolant = false;   ///< during the program
  double interval = 1.0;  ///< s, of the program, over which heat flows are linear
  double scale = 1.0;     ///< factor of all thermal effects on elements and workpiece
  struct Plot {           ///< a picture of the thermal part of one element
    errors::ElementName element;
    Eigen::VectorXd time_s;                      ///< (n) times for which curves are drawn
    std::optional<std::array<double, 2>> range;  ///< mm or rad; none: the travel
  };
  std::vector<Plot> plots;
};

/// Returns the duration of the history, s.
inline double history_duration(const ThermalDescription& thermal) {
  double sum = 0.0;
  for (const ThermalPhase& phase : thermal.history) sum += phase.duration;
  return sum;
}

struct Key;

/// Reads and writes `[thermal]`: network, thermal elements, sensors, history and room.
/// @param seed  seed of the scene, from which sensors without a seed of their own derive one
ThermalDescription read_thermal(const Node& table, const MachineDescription& machine,
                                std::uint64_t seed, InputErrors& input_errors);
Node::Table thermal_to_table(const ThermalDescription& thermal, const MachineDescription& machine,
                             std::uint64_t seed);
std::vector<Key> thermal_keys();

}  // namespace abbe::sim
