#pragma once

#include <array>
#include <optional>
#include <vector>

#include "cutting/surface/surface.h"
#include "sim/cut/tool_motion.h"
#include "sim/study/configuration.h"

namespace abbe::sim::study {

/// An arm cut with its inputs at their centres, as the columns of its influence map need it.
struct BaseRun {
  const Study& study;
  const PreparedConfiguration& ready;
  Process process;
  std::vector<kinematics::Pose> T_wt;  ///< (samples)
  std::vector<std::size_t> sample;     ///< of the motion that cuts: its samples in those of the job
  std::optional<SpindleLine> spindle;  ///< the workpiece turns about it
  std::vector<cutting::CompetingPass> competing_passes;  ///< in the order of the vertices
  std::vector<cutting::Gouge> gouges = {};  ///< of the vertices without one, in the same order
};

/// `study` and `ready` outlive it.
/// @throws BadInput as `cut`
BaseRun base_run(const Study& study, const PreparedConfiguration& ready,
                 const Progress& progress = {});

/// One end of the move on which a rival makes its surface.
struct End {
  std::size_t sample = 0;  ///< of the job
  double share = 0.0;      ///< of the rival's instant, 0 .. 1
};
std::array<End, 2> ends_of(const BaseRun& run, const cutting::CompetingPass& competing_pass);

/// Samples at the ends of all rivals' moves, ascending.
std::vector<std::size_t> competing_pass_samples(const BaseRun& run);

/// The values between which an input is differenced: those that a standard normal number of -1 and
/// +1 would give, so always values that it may have.
std::array<double, 2> around(const Study& study, Eigen::Index input);

/// The scenes at those values, every other input at its centre, run-out in their tools.
std::array<Scene, 2> stepped_scenes(const BaseRun& run, Eigen::Index input);

}  // namespace abbe::sim::study
