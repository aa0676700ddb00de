#pragma once

#include <nlohmann/json_fwd.hpp>

#include "sim/calibration/identify.h"

namespace abbe::sim {

/// The report beside a belief file; its keys are a promise to scripts.
nlohmann::ordered_json to_json(const Identified& identified);

}  // namespace abbe::sim
