#pragma once

#include <string>
#include <vector>

#include "sim/files/output.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// `program.ngc` or `program.csv` of a generated program.
/// @throws OutputFailure
void write_program(const ResultFolder& folder, const Job& job);

/// Writes every file of one case into its folder.
/// @param formats  of its map, of `map_formats`
/// @throws OutputFailure, Interrupted
void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict,
                const std::vector<std::string>& formats, const Progress& progress = {});

}  // namespace abbe::sim
