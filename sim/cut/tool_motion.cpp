#include "sim/cut/tool_motion.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::sim {

SpindleLine spindle_line(const kinematics::Chain& chain, int joint) {
  const kinematics::Pose T_wb = chain.T_bw_home().inverse();
  return {T_wb * chain.joints()[std::size_t(joint)].point_b,
          T_wb.linear() * chain.joints()[std::size_t(joint)].direction_b};
}

kinematics::Pose slow_pose(const SpindleLine& line, double spindle_angle,
                           const kinematics::Pose& T_wt) {
  // about the spindle axis, against its angle
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
    // strictly later: of samples at one time the first counts
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

std::vector<kinematics::AxisVector> accelerations(const program::Samples& samples) {
  // 20 ms: the speed jumps where blocks meet, so a shorter window gives larger accelerations
  constexpr double window_s = 0.02;
  const auto& states = samples.states;
  std::vector<kinematics::AxisVector> all(states.size());
  const auto at = [&](double time_s, std::size_t near) -> kinematics::AxisVector {
    std::size_t i = near;
    while (i + 1 < states.size() && states[i + 1].time_s <= time_s) ++i;
    while (i > 0 && states[i].time_s > time_s) --i;
    if (i + 1 == states.size() || time_s <= states[i].time_s) return states[i].q;
    const double part = (time_s - states[i].time_s) / (states[i + 1].time_s - states[i].time_s);
    return (1 - part) * states[i].q + part * states[i + 1].q;
  };
  for (std::size_t i = 0; i < states.size(); ++i) {
    const double t = states[i].time_s;
    all[i] = (at(t + window_s, i) - 2 * states[i].q + at(t - window_s, i)) / (window_s * window_s);
  }
  return all;
}

namespace {

/// Returns a text such as ", whose words count in inches (G20 on line 2, after G21 on line 1)";
/// empty for a block in mm.
std::string inch_text(const program::Path& path, const program::Block& block) {
  const auto later = std::ranges::find_if(
      path.unit_words, [&](const program::UnitWord& word) { return word.line > block.line; });
  const auto words = later - path.unit_words.begin();
  if (!block.inch || words == 0) return {};
  const std::string before =
      words > 1 ? fmt::format(", after G21 on line {}", (later - 2)->line) : "";
  return fmt::format(", whose words count in inches (G20 on line {}{})", (later - 1)->line, before);
}

}  // namespace

void check_travel(const Machine& machine, const program::Path& path,
                  const program::Samples& samples) {
  constexpr double slack = 1e-6;  // mm or rad: programmed numbers are rounded, limits are not exact
  for (std::size_t i = 0; i < samples.states.size(); ++i) {
    for (int k = 0; k < machine.nominal.size(); ++k) {
      const kinematics::Joint& joint = machine.nominal.joints()[std::size_t(k)];
      const double q = samples.states[i].q[k];
      if (is_spindle(machine, k)) continue;
      if (q >= joint.min - slack && q <= joint.max + slack) continue;
      const bool turns = joint.motion == kinematics::Motion::Rotary;
      const double unit = turns ? units::deg : 1.0;
      throw BadInput(path.file, samples.line[i], 0,
                     fmt::format("{} between {:.6g} and {:.6g} {}", joint.name, joint.min / unit,
                                 joint.max / unit, turns ? "deg" : "mm"),
                     fmt::format("{} = {:.9g} in this block{}", joint.name, q / unit,
                                 inch_text(path, path.blocks[std::size_t(samples.block[i])])));
    }
  }
}

}  // namespace abbe::sim
