#pragma once

#include <vector>

#include "sim/cut/job.h"

namespace abbe::sim {

/// Where the tool of a case was at every sample of its program, in the workpiece frame.
struct ToolTrack {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::VectorXd time_s;  ///< (n)
  std::vector<int> line;   ///< (n) of the program
  Rows q;                  ///< (n x axes) as they were commanded, mm and rad
  Rows nominal_tip;        ///< (n x 3) mm, where the tip should be
  Rows nominal_direction;  ///< (n x 3) of the tool axis, from the tip to the spindle
  Rows actual_tip;         ///< (n x 3) mm, where it was
  Rows actual_direction;   ///< (n x 3)
};

/// A part of a job as it went.
struct TrackedPart {
  const program::Samples& samples;
  const std::vector<kinematics::Pose>& T_wt_nominal;  ///< (samples)
  const std::vector<kinematics::Pose>& T_wt;          ///< (samples)
};

/// Parts of one machine, one after the other in time.
ToolTrack track_of(const std::vector<TrackedPart>& parts);

/// @param T_wm  the part frame in the workpiece frame
ToolTrack in_part_frame(ToolTrack track, const kinematics::Pose& T_wm);

}  // namespace abbe::sim
