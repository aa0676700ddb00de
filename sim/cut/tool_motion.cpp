#include "sim/cut/tool_motion.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::sim {

Eigen::Vector3d SpindleLine::radial(const Eigen::Vector3d& p_w) const {
  const Eigen::Vector3d lever = p_w - point_w;
  return lever - lever.dot(direction_w) * direction_w;
}

SpindleLine spindle_line(const kinematics::Chain& chain, int joint) {
  const kinematics::Pose T_wb = chain.T_bw_home().inverse();
  return {T_wb * chain.joints()[std::size_t(joint)].point_b,
          T_wb.linear() * chain.joints()[std::size_t(joint)].direction_b};
}

kinematics::Pose slow_pose(const SpindleLine& line, double spindle_angle,
                           const kinematics::Pose& T_wt) {
  const Eigen::Matrix3d R_back =
      Eigen::AngleAxisd(-spindle_angle, line.direction_w).toRotationMatrix();
  kinematics::Pose T_without_spindle = T_wt;
  T_without_spindle.linear() = R_back * T_wt.linear();
  T_without_spindle.translation() = line.point_w + R_back * (T_wt.translation() - line.point_w);
  return T_without_spindle;
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

bool is_feed_sample(const program::Path& path, const program::Samples& samples,
                    std::size_t sample) {
  return program::is_feed(path.blocks[std::size_t(samples.block[sample])]);
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
  std::vector<double> angles, times_s;
  for (const std::size_t i : distinct_instants(samples)) {
    const kinematics::AxisState& state = samples.states[i];
    const double spindle_angle = state.q[spindle];
    motion.T_without_spindle.push_back(slow_pose(line, spindle_angle, T_wt[i]));
    angles.push_back(spindle_angle);
    times_s.push_back(state.time_s);
    motion.line.push_back(samples.line[i]);
  }
  motion.spindle = Eigen::Map<Eigen::VectorXd>(angles.data(), Eigen::Index(angles.size()));
  motion.time_s = Eigen::Map<Eigen::VectorXd>(times_s.data(), Eigen::Index(times_s.size()));
  return motion;
}

std::vector<kinematics::AxisVector> accelerations(const program::Samples& samples) {
  // The speed jumps at block ends, so the window length determines the acceleration there.
  constexpr double window_s = 0.02;
  const auto& states = samples.states;
  std::vector<kinematics::AxisVector> result(states.size());
  const auto position = [&](double time_s, std::size_t guess) -> kinematics::AxisVector {
    std::size_t sample = guess;
    while (sample + 1 < states.size() && states[sample + 1].time_s <= time_s) ++sample;
    while (sample > 0 && states[sample].time_s > time_s) --sample;
    if (sample + 1 == states.size() || time_s <= states[sample].time_s) return states[sample].q;
    const double fraction =
        (time_s - states[sample].time_s) / (states[sample + 1].time_s - states[sample].time_s);
    return (1 - fraction) * states[sample].q + fraction * states[sample + 1].q;
  };
  for (std::size_t sample = 0; sample < states.size(); ++sample) {
    const double t = states[sample].time_s;
    result[sample] =
        (position(t + window_s, sample) - 2 * states[sample].q + position(t - window_s, sample)) /
        (window_s * window_s);
  }
  return result;
}

namespace {

/// Returns a text such as ", with words in inches (G20 on line 2, after G21 on line 1)"; empty for
/// a block in mm.
std::string inch_text(const program::Path& path, const program::Block& block) {
  const auto later_word = std::ranges::find_if(
      path.unit_words, [&](const program::UnitWord& word) { return word.line > block.line; });
  const auto word_count = later_word - path.unit_words.begin();
  if (!block.inch || word_count == 0) return {};
  const auto current = later_word - 1;
  // `unit_words` holds only changes of the unit, so G20 and G21 alternate: the word before a G20 is
  // a G21.
  std::string previous_text;
  if (word_count > 1) previous_text = fmt::format(", after G21 on line {}", (current - 1)->line);
  return fmt::format(", with words in inches (G20 on line {}{})", current->line, previous_text);
}

}  // namespace

void check_travel(const Machine& machine, const program::Path& path,
                  const program::Samples& samples) {
  constexpr double tolerance = 1e-6;  // mm or rad, for the rounding of programmed numbers
  for (std::size_t i = 0; i < samples.states.size(); ++i) {
    for (int k = 0; k < machine.nominal.size(); ++k) {
      const kinematics::Joint& joint = machine.nominal.joints()[std::size_t(k)];
      const double q = samples.states[i].q[k];
      if (is_spindle(machine, k)) continue;
      if (q >= joint.min - tolerance && q <= joint.max + tolerance) continue;
      const bool is_rotary = joint.motion == kinematics::Motion::Rotary;
      const double unit = is_rotary ? units::deg : 1.0;
      throw BadInput(path.file, samples.line[i], 0,
                     fmt::format("{} between {:.6g} and {:.6g} {}", joint.name, joint.min / unit,
                                 joint.max / unit, is_rotary ? "deg" : "mm"),
                     fmt::format("{} = {:.9g} in this block{}", joint.name, q / unit,
                                 inch_text(path, path.blocks[std::size_t(samples.block[i])])));
    }
  }
}

}  // namespace abbe::sim
