#pragma once

#include <nlohmann/json_fwd.hpp>

namespace abbe::sim {

/// Versions of everything that shapes the bits of a result.
nlohmann::ordered_json versions();

}  // namespace abbe::sim
