#pragma once

#include <string>
#include <variant>
#include <vector>

#include "errors/identification/thermal_study.h"
#include "errors/metrology/instrument.h"
#include "errors/metrology/part.h"

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

}  // namespace abbe::sim
