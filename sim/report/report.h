#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "sim/files/output.h"
#include "sim/files/versions.h"
#include "sim/report/verdict.h"

namespace abbe::sim {

/// `summary.json` of a case; the keys are a promise to scripts.
nlohmann::ordered_json summary(const Job& job, const Verdict& verdict);

/// `program.ngc` or `program.csv` of a generated program.
/// @throws OutputFailure
void write_program(const ResultFolder& folder, const Job& job);

/// Writes every file of one case into its folder.
/// @throws OutputFailure
void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict);

/// A case whose plug-in failed.
struct FailedCase {
  std::string name;
  std::string reason;
};
/// `comparison.json`: every case against the uncompensated one of its variant.
nlohmann::ordered_json comparison(const Job& job, const std::vector<Compared>& cases,
                                  const std::vector<FailedCase>& failed = {});

/// Names the acceptance limits of the scene that a case exceeds; empty if none.
std::vector<std::string> exceeded(const Limits& limits, const Verdict& verdict);

}  // namespace abbe::sim
