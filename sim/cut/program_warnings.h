#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cutting/shank.h"
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

/// Returns half the width of the narrowest tolerance of a part, mm; empty without one.
std::optional<double> narrowest_half_width(const PartDescription& part);

/// What is to be said of a scene's part and program before anything is cut: poses that the machine
/// does not reach, tools in comments that are not the scene's, no feed, two units, a coarse
/// mesh, a holder that overlaps cutter or spindle or ends short of it.
std::vector<std::string> program_warnings(const Scene& scene, const cutting::Design& design_w,
                                          const program::Path& path,
                                          const program::Unreached& unreached);

/// Where what does not cut of the scene's tool goes into the design.
struct ShankContacts {
  std::optional<cutting::ShankContact> shank, holder;
  bool in_windows = false;  ///< the vertices are the most of any window
};
ShankContacts shank_contacts(const Scene& scene, const cutting::Design& design_w,
                             const NominalRun& run);

/// Of two windows, one after the other.
ShankContacts joined(const ShankContacts& a, const ShankContacts& b);

std::vector<std::string> shank_warnings(const Scene& scene, const ShankContacts& contacts);

}  // namespace abbe::sim
