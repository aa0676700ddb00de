#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/pose_table.h"
#include "sim/files/output.h"

namespace abbe::sim {

/// Returns `T_wt_nominal`, `T_wt_actual` (lists of 4 rows, mm), `deviation_mm`, `direction_rad`,
/// `E` (T_nominal^-1 T_actual), `columns` (the requested additional columns by their names in a
/// table of poses) and `warnings`.
nlohmann::ordered_json to_json(const PoseResult& pose);

/// Returns the result as text.
std::string to_text(const PoseResult& pose);

inline constexpr const char* pose_convention =
    "actual minus nominal in the workpiece frame, machine at standstill, no datum set";

/// Writes a table of poses as CSV or JSON to a temporary file, which is renamed at the end.
/// @throws OutputFailure; BadInput and Interrupted as write_poses. Then no file is left.
PoseStatistics write_pose_file(const ResultFile& file, const PoseTable& table,
                               const PoseList& poses, TableFormat format,
                               const std::vector<std::string>& warnings,
                               ProgressLine* progress = nullptr);

/// Prints a table of poses to standard output while it is computed.
/// @throws OutputFailure
PoseStatistics print_poses(const PoseTable& table, const PoseList& poses, TableFormat format,
                           const std::vector<std::string>& warnings,
                           ProgressLine* progress = nullptr);

/// Returns `poses`, `deviation_um` {`max`, `p95`, `rms`}, `worst`, `direction_urad` {`max`,
/// `worst`}.
nlohmann::ordered_json to_json(const PoseStatistics& statistics, const PoseList& poses);
std::string to_text(const PoseStatistics& statistics, const PoseList& poses);

/// Returns the format by the extension of a file name.
/// @throws OutputFailure unless it ends in .csv or .json
TableFormat pose_file_format(const std::filesystem::path& file);

/// Returns the results of a volumetric map: `machine`, `convention`, `grid`, `standing`, `poses`,
/// `deviation_um` {`max`, `p95`, `rms`, `mean`}, `worst`, `direction_urad`, `volumetric_error`,
/// `worst_pair`.
nlohmann::ordered_json to_json(const IdleMachine& idle, const VolumetricMap& map,
                               const VolumetricSummary& summary);

/// Returns the results of a volumetric map as text.
std::string to_text(const IdleMachine& idle, const VolumetricMap& map,
                    const VolumetricSummary& summary);

/// Writes `volumetric.csv` and, if the program was built with VTK, three more files:
/// `volumetric.vts` (structured grid; point data deviation_um, direction_urad, rotation_urad,
/// deviation_norm_um and the positions of the axes), `volumetric.vtp` (its outer faces; the norms
/// deviation_um and direction_urad, and the components deviation_x_um and so on) and
/// `volumetric.png`, which also shows the warnings.
/// @throws OutputFailure
void write_volumetric_files(const ResultFolder& folder, const PoseTable& table,
                            const VolumetricMap& map, const VolumetricSummary& summary,
                            const std::vector<std::string>& warnings);

}  // namespace abbe::sim
