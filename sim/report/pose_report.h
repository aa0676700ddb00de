#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/pose_at.h"

namespace abbe::sim {

/// `T_wt_nominal`, `T_wt_actual` (4x4 row lists, mm), `deviation_mm`, `direction_rad`, `E`
/// (T_nominal^-1 T_actual), `columns` (what is wished beside, by its heads in a table of poses),
/// `warnings`.
nlohmann::ordered_json to_json(const PoseAt& pose);

/// The same for people.
std::string to_text(const PoseAt& pose);

}  // namespace abbe::sim
