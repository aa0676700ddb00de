#include "sim/cut/tool_motion.h"

#include <algorithm>

namespace abbe::sim {

SpindleLine spindle_line(const kinematics::Chain& chain, int joint) {
  const kinematics::Pose T_wb = chain.T_bw_home().inverse();
  return {T_wb * chain.joints()[std::size_t(joint)].point_b,
          T_wb.linear() * chain.joints()[std::size_t(joint)].direction_b};
}

kinematics::Pose slow_pose(const SpindleLine& line, double spindle_angle,
                           const kinematics::Pose& T_wt) {
  const Eigen::Matrix3d back =
      Eigen::AngleAxisd(-spindle_angle, line.direction_w).toRotationMatrix();
  kinematics::Pose T = T_wt;
  T.linear() = back * T_wt.linear();
  T.translation() = line.point_w + back * (T_wt.translation() - line.point_w);
  return T;
}

cutting::CutterMotion cutter_motion(const std::vector<kinematics::Pose>& T_wt,
                                    const program::Samples& samples) {
  cutting::CutterMotion motion;
  const Eigen::Index n = Eigen::Index(T_wt.size());
  motion.tip.resize(n, 3);
  motion.axis.resize(n, 3);
  motion.time_s.resize(n);
  motion.line = samples.line;
  for (Eigen::Index i = 0; i < n; ++i) {
    motion.tip.row(i) = T_wt[std::size_t(i)].translation().transpose();
    motion.axis.row(i) = T_wt[std::size_t(i)].linear().col(2).normalized().transpose();
    motion.time_s[i] = samples.states[std::size_t(i)].time_s;
  }
  return motion;
}

std::size_t sample_at(const program::Samples& samples, double time_s) {
  const auto& states = samples.states;
  const auto after = std::lower_bound(
      states.begin(), states.end(), time_s,
      [](const kinematics::AxisState& state, double time) { return state.time_s < time; });
  return std::min(std::size_t(after - states.begin()), states.size() - 1);
}

std::vector<std::size_t> distinct_instants(const program::Samples& samples) {
  std::vector<std::size_t> distinct;
  for (std::size_t i = 0; i < samples.states.size(); ++i)
    if (distinct.empty() || samples.states[i].time_s > samples.states[distinct.back()].time_s)
      distinct.push_back(i);
  return distinct;
}

cutting::NoseMotion nose_motion(const std::vector<kinematics::Pose>& T_wt,
                                const program::Samples& samples, const SpindleLine& line,
                                int spindle) {
  cutting::NoseMotion motion;
  motion.spindle_point = line.point_w;
  motion.spindle_direction = line.direction_w;
  std::vector<double> angle, time;
  for (const std::size_t i : distinct_instants(samples)) {
    const kinematics::AxisState& state = samples.states[i];
    const double turn = state.q[spindle];
    motion.T_slow.push_back(slow_pose(line, turn, T_wt[i]));
    angle.push_back(turn);
    time.push_back(state.time_s);
    motion.line.push_back(samples.line[i]);
  }
  motion.spindle = Eigen::Map<Eigen::VectorXd>(angle.data(), Eigen::Index(angle.size()));
  motion.time_s = Eigen::Map<Eigen::VectorXd>(time.data(), Eigen::Index(time.size()));
  return motion;
}

}  // namespace abbe::sim
