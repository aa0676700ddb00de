#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "sim/compensation/correct.h"
#include "sim/compensation/plug_in_task.h"

namespace abbe::sim {

/// A compensator as the three choices of a case name, or one of the user's own.
struct CaseDescription {
  std::string name;  ///< "perfect-iterated-ideal", "mine.py"
  enum class Belief {
    Perfect,     ///< the truth without its random parts
    Identified,  ///< geometric errors, from readings
    Thermal,     ///< what heat adds, from temperatures
    Composite,   ///< both (Yang 2012)
    Force,       ///< what the cut bends, from current, dynamometer or a model of the force
    Part,        ///< what was measured of a part that was cut before
    Fused,       ///< all that the scene gives to believe, with one correction (Guo 2016)
  } belief = Belief::Perfect;
  compensation::Strategy strategy = compensation::Strategy::Iterated;
  enum class Channel {
    Ideal,
    Program,
    Pulses,
    Open,
    Origin,
    Table,
    Piezo
  } channel = Channel::Ideal;
  std::filesystem::path plug_in;  ///< then belief and strategy are its own
  /// Asked instead of the file, whose name then is a name alone.
  std::shared_ptr<const compensation::PlugInFunction> function = {};
};

}  // namespace abbe::sim
