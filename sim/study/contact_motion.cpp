#include "sim/study/contact_motion.h"

#include <Eigen/Geometry>

namespace abbe::sim::study {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::Pose;

Matrix3d turn(const SpindleLine& line, double angle) {
  return Eigen::AngleAxisd(angle, line.direction_w).toRotationMatrix();
}

double turn_at(const BaseRun& run, const End& end) {
  return run.ready.commanded.samples.states[end.sample].q[*run.ready.job.machine.workpiece_spindle];
}

double turn_at(const BaseRun& run, const std::array<End, 2>& ends) {
  return ends[0].share * turn_at(run, ends[0]) + ends[1].share * turn_at(run, ends[1]);
}

Pose between(const Pose& from, const Pose& to, double share) {
  Pose pose = Pose::Identity();
  pose.translation() = (1.0 - share) * from.translation() + share * to.translation();
  pose.linear() = Eigen::Quaterniond(from.linear())
                      .slerp(share, Eigen::Quaterniond(to.linear()))
                      .toRotationMatrix();
  return pose;
}

}  // namespace

Vector3d displacement(const BaseRun& run, const cutting::Rival& rival,
                      const std::array<Twist, 2>& at_ends) {
  const std::array<End, 2> ends = ends_of(run, rival);
  Vector3d d = Vector3d::Zero();
  for (std::size_t e = 0; e < 2; ++e) {
    const Vector3d shift = at_ends[e].head<3>(), rotation = at_ends[e].tail<3>();
    const Vector3d& tip = run.T_wt[ends[e].sample].translation();
    if (!run.spindle) {
      d += ends[e].share * (shift + rotation.cross(rival.contact - tip));
      continue;
    }
    // the contact, carried back by the spindle to where it is when the tool is at this end
    const Matrix3d on = turn(*run.spindle, turn_at(run, ends) - turn_at(run, ends[e]));
    const Vector3d contact = on.transpose() * (rival.contact - run.spindle->point_w);
    d += ends[e].share * (on * (shift + rotation.cross(contact - (tip - run.spindle->point_w))));
  }
  return d;
}

Pose tool_at(const BaseRun& run, const cutting::Rival& rival, const Tool& tool) {
  const std::array<End, 2> ends = ends_of(run, rival);
  if (!tool.spindle) return between(tool.T_wt[0], tool.T_wt[1], ends[1].share);
  const SpindleLine& line = *tool.spindle;
  const Pose slow = between(slow_pose(line, turn_at(run, ends[0]), tool.T_wt[0]),
                            slow_pose(line, turn_at(run, ends[1]), tool.T_wt[1]), ends[1].share);
  return slow_pose(line, -turn_at(run, ends), slow);
}

Vector3d displacement(const BaseRun& run, const cutting::Rival& rival, const Tool& from,
                      const Tool& to) {
  const Pose a = tool_at(run, rival, from), b = tool_at(run, rival, to);
  const Matrix3d R = b.linear() * a.linear().transpose();
  const Vector3d rotation = 0.5 * Vector3d(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
  const Vector3d arm = rival.contact - 0.5 * (a.translation() + b.translation());
  return b.translation() - a.translation() + rotation.cross(arm);
}

}  // namespace abbe::sim::study
