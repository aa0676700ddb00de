#pragma once

#include "sim/files/output.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// `program.ngc` or `program.csv` of a generated program.
/// @throws OutputFailure
void write_program(const ResultFolder& folder, const Job& job);

/// Writes every file of one case into its folder.
/// @throws OutputFailure
void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict);

}  // namespace abbe::sim
