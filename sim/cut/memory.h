#pragma once

#include <string>
#include <vector>

#include "sim/cut/stages.h"

/// What `run` and `compare` take of the memory at their peak, known before anything is cut.
namespace abbe::sim {

/// The cases that are cut.
struct CasesAsked {
  double kept = 1.0;         ///< so many maps stay until the last is written
  bool compensated = false;  ///< one has a compensator
  bool rewritten = false;    ///< whose commands have samples of their own
  bool pictures = true;      ///< they are drawn
  bool compared = false;     ///< and all of them in one picture
  bool tracked = false;      ///< the tracks of their tools are kept
  int at_once = 1;           ///< so many of them are cut, and then drawn, at a time
};
CasesAsked cases_of_run(const std::optional<CaseDescription>& compensator);
CasesAsked cases_of_compare(const std::vector<Scene>& scenes);

/// Bytes. Within 30 % of the scenes it was measured on; dexels of a fine stock come on top.
/// @param jobs  all are held while the cases of one are cut; vertices as they are judged
double peak_memory(const std::vector<WorkSize>& jobs, const CasesAsked& asked);

/// Samples of its program that a job may hold at its peak within `memory_bytes`; 0 where they are
/// fewer than is worth it, a hundred thousand.
std::size_t samples_that_fit(WorkSize job, const CasesAsked& asked);

/// How many cases to cut and draw at once: one a thread, as long as that leaves a third of
/// `memory_bytes`.
int cases_at_once(const std::vector<WorkSize>& jobs, CasesAsked asked);

/// @param whole  what asks for samples of the whole program, in a word; empty for nothing
/// @throws BadInput naming the keys and the figures if that is more than `memory_bytes`
void check_memory(const Scene& scene, const std::vector<WorkSize>& jobs, const CasesAsked& asked,
                  const std::string& whole = {});

/// One line for a person, empty below 2 GB.
std::string memory_remark(const std::vector<WorkSize>& jobs, const CasesAsked& asked);

}  // namespace abbe::sim
