#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sim/cut/job.h"

/// What of the judged surface a program means to cut (part.judged = "cut").
namespace abbe::sim {

enum class WhyUnmeant : std::uint8_t { Meant, Unreached, Corner, RunOut };

/// Takes out of a map, and of what the job judges, where the error-free cut does not reach, where
/// the corner of no tool of the job fits into the design, and where the sweep runs out beside
/// these. Nothing where the scene judges all, nor if all would be left out, which is refused
/// where it is cut.
/// @param before  what was said of the first vertices before others were added; empty: nothing
/// @return        (vertices) the reason; of those that the scene does not judge: meant
std::vector<WhyUnmeant> leave_out_unmeant(Job& job, cutting::Surface& nominal,
                                          std::vector<WhyUnmeant> before);

struct MeantAreas {
  double judged = 0.0;  ///< mm^2
  Unmeant unmeant;
};
MeantAreas meant_areas(const Job& job, const cutting::Surface& nominal,
                       const std::vector<WhyUnmeant>& why);

std::string unmeant_text(const SampledSurface& sampled);

}  // namespace abbe::sim
