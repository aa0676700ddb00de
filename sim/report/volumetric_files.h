#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/volumetric_map.h"
#include "sim/files/output.h"

namespace abbe::sim {

/// What is said of a volumetric map: `machine`, `convention`, `grid`, `standing`, `poses`,
/// `deviation_um` {`max`, `p95`, `rms`, `mean`}, `worst`, `direction_urad`, `volumetric_error`,
/// `worst_pair`.
nlohmann::ordered_json to_json(const IdleMachine& idle, const VolumetricMap& map,
                               const VolumetricSummary& summary);

/// The same for people.
std::string to_text(const IdleMachine& idle, const VolumetricMap& map,
                    const VolumetricSummary& summary);

/// Writes `volumetric.csv` and, where the program was built with VTK, `volumetric.vts` (structured
/// grid; point data deviation_um, direction_urad, rotation_urad, deviation_norm_um and the
/// positions of the axes), `volumetric.vtp` (its outer faces; deviation_um and direction_urad by
/// length, deviation_x_um and so on) and `volumetric.png`, which shows the warnings too.
/// @throws OutputFailure
void write_volumetric_files(const ResultFolder& folder, const PoseTable& table,
                            const VolumetricMap& map, const VolumetricSummary& summary,
                            const std::vector<std::string>& warnings);

}  // namespace abbe::sim
