#pragma once

#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// The same with every text and key on one line, as `escaped` has it: what a report for a person is
/// composed of, so that no foreign text begins a line of its own in it.
nlohmann::ordered_json one_lined(const nlohmann::ordered_json& json);

}  // namespace abbe::sim
