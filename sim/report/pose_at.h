#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/pose_table.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// Where the tool is and should be with the axes at "X=100 A=30" (mm, degrees; axes not named stand
/// at zero, moving nowhere): `T_wt_nominal`, `T_wt_actual` (4x4 row lists, mm), `deviation_mm`,
/// `direction_rad`, `E` (T_nominal^-1 T_actual), `columns` (what is wished beside, by its heads in
/// a table of poses), `warnings`.
/// @throws BadInput for an axis that the machine lacks, a number that is none or beyond the travel,
///         an axis twice, an element that the machine lacks
nlohmann::ordered_json pose_at(const Scene& scene, const std::string& at,
                               const PoseWishes& wishes = {});

/// The same for people.
std::string pose_text(const nlohmann::ordered_json& pose);

}  // namespace abbe::sim
