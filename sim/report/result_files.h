#pragma once

#include <string>
#include <vector>

#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// Name of the format of the tool's track, saved as `track.npz`. The cut must have retained the
/// track.
inline constexpr const char* track_format = "track";

/// Returns the formats in which a map can be saved, as `--save` names them; "vtp" only if the
/// program was built with VTK.
std::vector<std::string> map_formats();

/// Returns the formats that are saved by default.
std::vector<std::string> default_map_formats();

/// Returns the data that must be kept of a cut for these formats.
Retention required_retention(const std::vector<std::string>& formats);

/// Writes `residual.FORMAT` for each format, and removes the files of other formats that an earlier
/// run left.
/// @param progress  shows one stage, "write"
/// @throws OutputFailure, Interrupted
void write_map_files(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                     const std::vector<std::string>& formats, const Progress& progress = {});

/// Writes `program.ngc` or `program.csv` of a generated program.
/// @throws OutputFailure
void write_program(const ResultFolder& folder, const Job& job);

/// Writes all files of a case into its folder.
/// @param formats  of its map, a subset of `map_formats`
/// @throws OutputFailure, Interrupted
void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                const std::vector<std::string>& formats, const Progress& progress = {});

}  // namespace abbe::sim
