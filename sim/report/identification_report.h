#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/calibration.h"

namespace abbe::sim {

/// Returns the identification as text; every foreign text stays on one line.
std::string identify_text(const Identified& identified);

/// Returns the report beside a belief file; its keys are stable for scripts.
nlohmann::ordered_json to_json(const Identified& identified);

/// Returns the belief file of an identification, with its sources at its head: an errors file
/// (belief_file), or for the readings of a day a thermal belief (thermal_belief).
std::string belief_text(const Identified& identified);

/// Returns the file of the thermal half of a composite belief.
std::string thermal_half_text(const Identified& composite);

}  // namespace abbe::sim
