#include "sim/cut/tool_track.h"

namespace abbe::sim {

ToolTrack track_of(const std::vector<TrackedPart>& parts) {
  using Eigen::Index;
  Index n = 0, axes = 0;
  for (const TrackedPart& part : parts) {
    n += Index(part.samples.states.size());
    if (!part.samples.states.empty()) axes = part.samples.states.front().q.size();
  }
  using Rows = ToolTrack::Rows;
  ToolTrack track{Eigen::VectorXd(n), {},         Rows(n, axes), Rows(n, 3),
                  Rows(n, 3),         Rows(n, 3), Rows(n, 3)};
  track.line.reserve(std::size_t(n));
  Index row = 0;
  for (const TrackedPart& part : parts) {
    track.line.insert(track.line.end(), part.samples.line.begin(), part.samples.line.end());
    for (std::size_t i = 0; i < part.samples.states.size(); ++i, ++row) {
      track.time_s[row] = part.samples.states[i].time_s;
      track.q.row(row) = part.samples.states[i].q.transpose();
      track.nominal_tip.row(row) = part.T_wt_nominal[i].translation().transpose();
      track.nominal_direction.row(row) = part.T_wt_nominal[i].linear().col(2).transpose();
      track.actual_tip.row(row) = part.T_wt[i].translation().transpose();
      track.actual_direction.row(row) = part.T_wt[i].linear().col(2).transpose();
    }
  }
  return track;
}

ToolTrack in_part_frame(ToolTrack track, const kinematics::Pose& T_wm) {
  const kinematics::Pose T_mw = T_wm.inverse();
  const Eigen::Matrix3d turned = T_mw.linear().transpose();
  for (ToolTrack::Rows* tip : {&track.nominal_tip, &track.actual_tip})
    *tip = ((*tip * turned).rowwise() + T_mw.translation().transpose()).eval();
  for (ToolTrack::Rows* direction : {&track.nominal_direction, &track.actual_direction})
    *direction = (*direction * turned).eval();
  return track;
}

}  // namespace abbe::sim
