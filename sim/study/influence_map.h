#pragma once

#include <array>
#include <optional>
#include <vector>

#include "cutting/surface/surface.h"
#include "sim/cut/tool_motion.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// A configuration cut with its inputs at their centres, with the data for the columns of its
/// influence map.
struct BaseRun {
  const Study& study;
  const PreparedConfiguration& ready;
  Process process;
  std::vector<kinematics::Pose> T_wt;  ///< (samples)
  std::vector<std::size_t> sample;     ///< (cutting motion) number of the sample of the job
  std::optional<SpindleLine> spindle;  ///< axis about which the workpiece turns
  std::vector<cutting::CompetingPass> competing_passes;  ///< in the order of the vertices
  std::vector<cutting::Gouge> gouges = {};  ///< at vertices without a competing pass, in the same
                                            ///< order
};

/// Returns the base run; `study` and `ready` must outlive it.
/// @throws BadInput as `cut`, and for several tools, tool wear or a hollow tool
BaseRun base_run(const Study& study, const PreparedConfiguration& ready,
                 const Progress& progress = {});

/// An end of the move on which a competing pass makes its surface.
struct MoveEnd {
  std::size_t sample = 0;  ///< of the job
  double share = 0.0;      ///< weight of this end at the instant of the pass, 0 .. 1
};
/// Returns both ends of the move of a competing pass; their weights add up to 1.
std::array<MoveEnd, 2> move_ends(const BaseRun& run, const cutting::CompetingPass& competing_pass);

/// Returns the samples at the ends of the moves of all competing passes, ascending.
std::vector<std::size_t> competing_pass_samples(const BaseRun& run);

/// Returns the values between which the difference for an input is taken: those at standard normal
/// scores of -1 and +1, which the input may always have.
std::array<double, 2> difference_points(const Study& study, Eigen::Index input);

/// Returns the scenes at those values, with the other inputs at their centres, and run-out as part
/// of their tools.
std::array<Scene, 2> stepped_scenes(const BaseRun& run, Eigen::Index input);

}  // namespace abbe::sim::study
