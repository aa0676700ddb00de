#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "cutting/alignment.h"
#include "cutting/form.h"
#include "cutting/residual.h"
#include "sim/cut/cut.h"
#include "sim/files/output.h"
#include "sim/files/versions.h"

namespace abbe::sim {

/// One case judged: its map aligned as the scene asks, and the figures of it.
struct Verdict {
  Cut cut;
  cutting::Aligned aligned;      ///< the map without what the alignment of the scene takes out
  cutting::Statistics residual;  ///< of the aligned map
  std::vector<cutting::FormNumber> form;       ///< where the design is a known surface
  std::optional<cutting::Statistics> machine;  ///< of it minus the error-free map
};

/// @param error_free  the map that is taken away for the machine's own part; null for that case
/// itself
Verdict judge(const Job& job, Cut cut, const Verdict* error_free);

/// `summary.json` of a case; the keys are a promise to scripts.
nlohmann::ordered_json summary(const Job& job, const Verdict& verdict);

/// `program.ngc` or `program.csv` of a generated program.
/// @throws OutputFailure
void write_program(const ResultFolder& folder, const Job& job);

/// Names as they stand in files and pictures.
const char* name_of(DatumDescription::Kind datum);
const char* name_of(Alignment alignment);

/// Writes every file of one case into its folder.
/// @throws OutputFailure
void write_case(const ResultFolder& folder, const Job& job, const Verdict& verdict);

/// `comparison.json`: every case against the uncompensated one of its variant.
struct Compared {
  Verdict verdict;
  const Job* job = nullptr;  ///< the scene itself, or the variant, that it belongs to
  std::optional<std::size_t> uncompensated;  ///< index of the case that it is measured against
};
/// A case whose plug-in failed.
struct FailedCase {
  std::string name;
  std::string reason;
};
nlohmann::ordered_json comparison(const Job& job, const std::vector<Compared>& cases,
                                  const std::vector<FailedCase>& failed = {});

/// Names the acceptance limits of the scene that a case exceeds; empty if none.
std::vector<std::string> exceeded(const Limits& limits, const Verdict& verdict);

}  // namespace abbe::sim
