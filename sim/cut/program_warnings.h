#pragma once

#include <string>
#include <vector>

#include "sim/cut/part.h"
#include "sim/program/sample.h"

namespace abbe::sim {

/// A program as the error-free machine runs it.
struct NominalRun {
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt;  ///< (samples)
};

/// What is to be said of a scene's part and program before anything is cut: poses that the machine
/// does not reach, tools that are not the scene's, no feed, a shank in the part, a coarse mesh.
/// @throws BadInput as tool_call_warnings
std::vector<std::string> program_warnings(const Scene& scene, const cutting::Design& design_w,
                                          const Program& program, const NominalRun& run);

}  // namespace abbe::sim
