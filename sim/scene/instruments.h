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

/// An instrument of the scene, with the times of its use.
struct InstrumentDescription {
  errors::metrology::Instrument instrument;
  std::vector<double> starts_s;  ///< (n >= 1) s; everything is read once from each start; time 0 is
                                 ///< the start of the program
};

/// An instrument for the finished part: a touch probe on the machine that cut it, or a separate
/// coordinate measuring machine.
struct PartInstrumentDescription {
  std::string name;
  std::string case_name;  ///< the case whose part is measured; empty: uncompensated
  std::variant<errors::metrology::CoordinateMachine, errors::metrology::TouchProbe> how;
  double spacing = 5.0;  ///< mm, approximate, between points
};

/// Settings of the choice of temperature sensors, and of the model that uses the chosen ones.
struct SensorChoiceDescription {
  std::string instrument = "drift";  ///< the instrument that reads the drift; its readings over the
                                     ///< scene's own history train the model, those over the
                                     ///< histories of the variants test it
  errors::identification::ThermalStudyOptions study;
  /// Another method of choice, rated for comparison.
  struct Way {
    std::string name;
    errors::identification::SensorChoiceOptions choice;
    std::vector<std::string> drifts;  ///< displacements such as "Z" for which sensors are chosen;
                                      ///< empty: all
  };
  std::vector<Way> beside;
};

struct Key;

/// The `[[instrument]]` tables, divided into instruments for the machine and for the part. Values
/// that a table leaves out are those of a typical instrument of its kind.
struct Instruments {
  std::vector<InstrumentDescription> of_machine;
  std::vector<PartInstrumentDescription> of_part;
};
/// Reads the instruments.
/// @param machine  tries every measuring plan, so that an impossible one is rejected at its
///                 position
Instruments read_instruments(const std::vector<const Node*>& tables,
                             const MachineDescription& machine, InputErrors& input_errors);
std::vector<Node::Table> written_instruments(const Instruments& instruments,
                                             const MachineDescription& machine);
std::vector<Key> instrument_keys();

/// Reads and writes `[sensor_choice]`: the number of sensors, the similarity measure, the screening
/// and the model.
SensorChoiceDescription read_sensor_choice(const Node& table, InputErrors& input_errors);
Node::Table written_sensor_choice(const SensorChoiceDescription& choice);
std::vector<Key> sensor_choice_keys();

/// Readings available to the control, with their quality.
struct SignalsDescription {
  double interval = 0.0;  ///< s between rows of signals.csv; 0: as fine as 20 000 rows allow
  double history_interval = 0.0;    ///< s between rows of the thermal history; 0: no rows
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

/// Returns the fields of `[signals]`: the readings of the control and the interval of their output.
const Fields<SignalsDescription>& signals_fields();

}  // namespace abbe::sim
