#pragma once

#include <optional>

namespace abbe::sim {

/// What a control can read, and how well.
struct SignalsDescription {
  double interval = 0.0;  ///< s between rows of signals.csv; 0: as fine as 20 000 rows allow
  double history_interval = 0.0;    ///< s between rows of the thermal history; 0: none are written
  double encoder_resolution = 0.0;  ///< mm; 0: not rounded
  double encoder_resolution_rad = 0.0;
  double encoder_noise = 0.0;  ///< mm, standard deviation
  double encoder_noise_rad = 0.0;
  struct Current {
    double torque_per_current = 1e3;  ///< N mm/A
    double idle_torque = 0.0;         ///< N mm, of bearings at any speed
    double viscous_torque = 0.0;      ///< N mm s/rad
    double noise_A = 0.0;             ///< standard deviation
    double bandwidth = 0.0;           ///< Hz, first order; 0: none
  };
  std::optional<Current> current;
  struct Dynamometer {
    double noise = 0.0;       ///< N
    double resolution = 0.0;  ///< N
    double bandwidth = 0.0;   ///< Hz, first order; 0: none
  };
  std::optional<Dynamometer> dynamometer;
};

}  // namespace abbe::sim
