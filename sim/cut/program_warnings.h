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

/// Where a design is judged, as far as it is between these places that something is missed.
struct JudgedPlaces {
  int vertices = 0;
  double apart = 0.0;  ///< mm, the longest edge between two of them
};
JudgedPlaces judged_places(const cutting::Design& design);

/// Below this number, or where they are farther apart than the cutter is wide, what is cut between
/// them is in no figure.
inline constexpr int least_judged = 10;
bool is_sparse(const JudgedPlaces& places, const ToolDescription& tool);

/// What is to be said of a scene's part and program before anything is cut: poses that the machine
/// does not reach, tools in comments that are not the scene's, no feed, two units, a coarse
/// mesh, a holder that overlaps cutter or spindle or ends short of it.
std::vector<std::string> program_warnings(const Scene& scene, const cutting::Design& design_w,
                                          const program::Path& path,
                                          const program::Unreached& unreached);

/// Where the shank of the scene's tool, above its flank, goes into the design.
std::vector<std::string> shank_warnings(const Scene& scene, const cutting::Design& design_w,
                                        const NominalRun& run);

}  // namespace abbe::sim
