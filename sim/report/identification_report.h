#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/calibration.h"

namespace abbe::sim {

/// What was identified, as a person reads it; foreign text in it stays on its line.
std::string identify_text(const Identified& identified);

/// The report beside a belief file; its keys are a promise to scripts.
nlohmann::ordered_json to_json(const Identified& identified);

/// The belief file of what was identified, its head saying from what: an errors file (belief_file),
/// of a day a thermal belief (thermal_belief).
std::string belief_text(const Identified& identified);

/// The file of the thermal half of a composite.
std::string thermal_half_text(const Identified& composite);

}  // namespace abbe::sim
