#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// Of abbe itself, "0.2.0".
std::string version();

/// Versions of everything that shapes the bits of a result.
nlohmann::ordered_json versions();

}  // namespace abbe::sim
