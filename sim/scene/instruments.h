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

/// An instrument that measures the machine, with the times of its use.
struct InstrumentDescription {
  errors::metrology::Instrument instrument;
  std::vector<double> starts_s;  ///< (n >= 1) s, start of each measurement; 0 is the start of the
                                 ///< program
};

/// An instrument that measures the finished part: a touch probe on the machine that cut it, or a
/// coordinate measuring machine.
struct PartInstrumentDescription {
  std::string name;
  std::string case_name;  ///< the case whose part is measured; empty: uncompensated
  std::variant<errors::metrology::CoordinateMeasuringMachine, errors::metrology::TouchProbe> device;
  double spacing = 5.0;  ///< mm, approximate distance of the points
};

/// Settings of the selection of temperature sensors and of the model of the thermal drift.
struct SensorChoiceDescription {
  std::string instrument = "drift";  ///< instrument that reads the drift. Its readings over the
                                     ///< thermal history of the scene train the model, those over
                                     ///< the histories of the variants test it
  errors::identification::ThermalStudyOptions study;
  /// Another selection method, rated for comparison.
  struct SelectionMethod {
    std::string name;
    errors::identification::SensorChoiceOptions choice;
    std::vector<std::string> drifts;  ///< displacements such as "Z" for which sensors are selected;
                                      ///< empty: all
  };
  std::vector<SelectionMethod> compared_methods;
};

struct Key;

/// The `[[instrument]]` tables, divided into instruments for the machine and for the part. Keys
/// that a table leaves out have the values of a typical instrument of its kind.
struct Instruments {
  std::vector<InstrumentDescription> of_machine;
  std::vector<PartInstrumentDescription> of_part;
};
/// Reads the instruments.
/// @param machine  machine on which every measuring plan is tested; a plan that the machine cannot
///                 execute is reported at its position
Instruments read_instruments(const std::vector<const Node*>& tables,
                             const MachineDescription& machine, InputErrors& input_errors);
std::vector<Node::Table> instruments_to_tables(const Instruments& instruments,
                                               const MachineDescription& machine);
std::vector<Key> instrument_keys();

/// Reads and writes `[sensor_choice]`: number of sensors, similarity measure, screening and model.
SensorChoiceDescription read_sensor_choice(const Node& table, InputErrors& input_errors);
Node::Table sensor_choice_to_table(const SensorChoiceDescription& choice);
std::vector<Key> sensor_choice_keys();

/// Signals that the control can read, with their noise, resolution and bandwidth.
struct SignalsDescription {
  double interval = 0.0;  ///< s between rows of signals.csv; 0: the least that 20 000 rows allow
  double history_interval = 0.0;    ///< s between rows of the thermal history; 0: no rows
  double encoder_resolution = 0.0;  ///< mm; 0: not rounded
  double encoder_resolution_rad = 0.0;
  double encoder_noise = 0.0;  ///< mm, standard deviation
  double encoder_noise_rad = 0.0;
  struct Current {
    double torque_per_current = 1e3;  ///< N mm/A
    double idle_torque = 0.0;         ///< N mm, of the bearings, independent of speed
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

/// Returns the fields of `[signals]`.
const Fields<SignalsDescription>& signals_fields();

}  // namespace abbe::sim
