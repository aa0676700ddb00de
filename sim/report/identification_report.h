#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/calibration.h"

namespace abbe::sim {

/// Returns the report of an identification as text for the terminal. Control characters in file
/// names and messages are escaped, so that each of them stays on one line.
std::string identification_text(const IdentificationResult& identified);

/// Returns the JSON report that is written beside a belief file. Scripts may rely on its keys.
nlohmann::ordered_json to_json(const IdentificationResult& identified);

/// Returns the text of the belief file: an errors file (sim/readings/belief_file.h) or, for
/// readings of a whole day, a thermal belief. It begins with comments that name its sources.
std::string belief_file_text(const IdentificationResult& identified);

/// Returns the text of the file that holds the thermal half of a composite belief.
std::string thermal_half_file_text(const IdentificationResult& composite);

}  // namespace abbe::sim
