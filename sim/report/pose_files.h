#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/cut/pose_table.h"
#include "sim/files/output.h"

namespace abbe::sim {

inline constexpr const char* pose_convention =
    "actual minus nominal in the workpiece frame, the machine standing still, no datum set";

/// Writes a table of poses under a temporary name that is renamed: CSV, or JSON as `poses_json`.
/// @throws OutputFailure; BadInput and Interrupted as write_poses, and then nothing is left of it
PoseStatistics write_pose_file(const ResultFile& file, const PoseTable& table,
                               const PoseList& poses, TableFormat format,
                               const std::vector<std::string>& warnings,
                               ProgressLine* progress = nullptr);

/// Prints the same on standard output as it is computed. @throws OutputFailure
PoseStatistics print_poses(const PoseTable& table, const PoseList& poses, TableFormat format,
                           const std::vector<std::string>& warnings,
                           ProgressLine* progress = nullptr);

/// `poses`, `deviation_um` {`max`, `p95`, `rms`}, `worst`, `direction_urad` {`max`, `worst`}.
nlohmann::ordered_json to_json(const PoseStatistics& statistics, const PoseList& poses);
std::string to_text(const PoseStatistics& statistics, const PoseList& poses);

/// The format that a name asks for.
/// @throws OutputFailure unless it ends in .csv or .json
TableFormat pose_file_format(const std::filesystem::path& file);

}  // namespace abbe::sim
