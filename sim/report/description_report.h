#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/report/describe.h"

namespace abbe::sim {

/// What `abbe check --json` prints; lengths in mm and um, angles in deg and urad, as keys say.
nlohmann::ordered_json to_json(const Description& description);

/// The same as text for people.
std::string to_text(const Description& description);

}  // namespace abbe::sim
