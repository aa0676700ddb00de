#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "errors/identification/sensor_choice.h"
#include "errors/metrology/instrument.h"
#include "errors/metrology/part.h"
#include "sim/scene/machine.h"
#include "sim/scene/toml.h"

namespace abbe::sim {

/// An instrument of the scene, and when it is used.
struct InstrumentDescription {
  errors::metrology::Instrument instrument;
  std::vector<double> starts_s;  ///< (n >= 1) everything is read once from each; time 0 is the
                                 ///< start of the program
};

/// What measures the finished part: a touch probe on the machine that cut it, or a coordinate
/// measuring machine of its own.
struct PartInstrumentDescription {
  std::string name;
  std::string case_name;  ///< of which case the part is; empty: uncompensated
  std::variant<errors::metrology::CoordinateMachine, errors::metrology::TouchProbe> how;
  double spacing = 5.0;  ///< mm, about, between points
};

/// Which temperature sensors are worth having, and what a model of them is good for.
struct SensorChoiceDescription {
  std::string instrument = "drift";  ///< reads the drift, over the scene's own history for
                                     ///< training, over those of its variants for testing
  errors::identification::ThermalStudyOptions study;
  /// Another way to choose, graded beside.
  struct Way {
    std::string name;
    errors::identification::SensorChoiceOptions choice;
    std::vector<std::string> drifts;  ///< "Z": displacements to choose for; empty: all
  };
  std::vector<Way> beside;
};

struct Key;

/// What `[[instrument]]` tables say, sorted into those that measure the machine and those that
/// measure the part. A kind that is left to itself is a typical one.
struct Instruments {
  std::vector<InstrumentDescription> of_machine;
  std::vector<PartInstrumentDescription> of_part;
};
/// @param machine  on which every plan is tried, so that one that cannot be is refused where it
/// stands
Instruments read_instruments(const std::vector<const Node*>& tables,
                             const MachineDescription& machine, InputErrors& input_errors);
std::vector<Node::Table> written_instruments(const Instruments& instruments,
                                             const MachineDescription& machine);
std::vector<Key> instrument_keys();

/// `[sensor_choice]`: how many sensors, by which likeness and screening, for which model.
SensorChoiceDescription read_sensor_choice(const Node& table, InputErrors& input_errors);
Node::Table written_sensor_choice(const SensorChoiceDescription& choice);
std::vector<Key> sensor_choice_keys();

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

template <typename T>
class Fields;

/// `[signals]`: what the control reads, and how often it is written.
const Fields<SignalsDescription>& signals_fields();

}  // namespace abbe::sim
