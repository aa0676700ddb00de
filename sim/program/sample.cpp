#include "sim/program/sample.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "kinematics/bad_input.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/pose.h"
#include "kinematics/units.h"
#include "sim/program/block_motion.h"

namespace abbe::sim::program {
namespace {

using kinematics::angle_between;
using kinematics::AxisVector;
using kinematics::great_circle_point;
using kinematics::Motion;

// An axis counts as moving when it is farther than this from its last recorded position. Smaller
// steps are rounding of the control's arithmetic and must not count as reversals.
constexpr double motion_threshold_mm = 1e-9;
constexpr double motion_threshold_rad = 1e-11;
constexpr double min_gap = 1e-9;  // mm or rad, rounding of a conversion between axes and tip

/// Position and axis of the tool in the workpiece.
struct ToolPosition {
  Eigen::Vector3d tip;
  Eigen::Vector3d direction;
};

/// Positions of the tool at the ends and the three inner quarter points of a part of a block.
using QuarterPositions = std::array<ToolPosition, 5>;

/// Bounds of the derivatives of the motion with respect to u, the fraction of the block, over the
/// whole block.
struct MotionBounds {
  double turn = 0.0;              ///< rad, sum over the rotary axes
  double travel = 0.0;            ///< mm, path of the slides, or of the tip as programmed
  double fifth_derivative = 0.0;  ///< mm, of any point of the tool axis up to `reach`
  double lever = 0.0;  ///< mm, sum of the distances of the tip from the rotary axis lines
};

/// Returns the real roots of a u^2 + 2 b u + c by the form that does not subtract nearly equal
/// numbers.
std::vector<double> roots(double a, double b, double c) {
  const double discriminant = b * b - a * c;
  if (!(discriminant > 0.0)) return {};
  const double t = -(b + std::copysign(std::sqrt(discriminant), b));
  std::vector<double> u;
  if (t != 0.0) u.push_back(c / t);
  if (a != 0.0) u.push_back(t / a);
  return u;
}

/// Returns the number of parts, rounded up. 1e-9 absorbs the rounding of a whole quotient, and 1e9
/// keeps the result within int.
int to_part_count(double parts) { return int(std::ceil(std::clamp(parts - 1e-9, 1.0, 1e9))); }

/// Computes the motion of one block as the control executes it, and the steps in which to sample
/// it.
class BlockSampler {
 public:
  BlockSampler(const Path& path, const Block& block, const kinematics::Chain& control,
               const SampleOptions& options);

  AxisVector axes(double u) const;
  std::vector<double> breakpoints() const;
  int coarse_parts(double u_length) const;
  /// Returns the number of equal steps for the part from ua to ub.
  int steps(double ua, double ub, const AxisVector& qa, const AxisVector& qb) const;

 private:
  Motion motion(int j) const { return control_.joints()[std::size_t(j)].motion; }
  bool is_spindle(int j) const {
    return motion(j) == Motion::Spindle || options_.workpiece_spindle == j;
  }
  bool is_rotary(int j) const { return motion(j) == Motion::Rotary && !is_spindle(j); }
  bool is_slide(int j) const { return motion(j) == Motion::Linear; }
  Eigen::Vector3d programmed_tip(const AxisVector& q) const { return {q[x_], q[y_], q[z_]}; }
  AxisVector slides(const AxisVector& programmed) const;
  ToolPosition tool_position(double u) const;
  double chord_error_bound(const QuarterPositions& positions, double u_length) const;
  double rotation_bound(const QuarterPositions& positions, double u_length) const;
  double lever_sum() const;
  void set_bounds();

  const Path& path_;
  const Block& block_;
  const kinematics::Chain& control_;
  const SampleOptions& options_;
  bool is_tip_mode_ = false;
  int x_ = -1, y_ = -1, z_ = -1;
  MotionBounds bounds_;
  AxisVector qa_, qb_;  ///< slides at the ends, if they move in a straight line between them
  bool is_straight_ = false;
};

BlockSampler::BlockSampler(const Path& path, const Block& block, const kinematics::Chain& control,
                           const SampleOptions& options)
    : path_(path), block_(block), control_(control), options_(options) {
  is_tip_mode_ = block.coordinates == Coordinates::Tip;
  if (is_tip_mode_) {
    const auto x = control.find('X'), y = control.find('Y'), z = control.find('Z');
    if (!x || !y || !z)
      throw BadInput(path.file, block.line, 0, "a machine with X Y Z for G43.4", "another");
    x_ = *x, y_ = *y, z_ = *z;
  }
  set_bounds();
  // Without rotation the slides follow the tip linearly: they are solved at the two ends only.
  is_straight_ = is_tip_mode_ && bounds_.turn == 0.0 && block.interpolation != Interpolation::Arc &&
                 block.interpolation != Interpolation::Cubic;
  if (is_straight_) {
    qa_ = slides(block.start);
    qb_ = slides(block.end);
  }
}

/// Returns the sum of the distances L of the tip from all rotary axis lines: a rotation by 1 rad
/// displaces the tip by the chord 2 L sin(1/2).
double BlockSampler::lever_sum() const {
  const AxisVector q = axes(0.0);
  const Eigen::Vector3d tip = control_.tool_in_workpiece(q).translation();
  double sum = 0.0;
  for (int j = 0; j < control_.size(); ++j) {
    if (!is_rotary(j)) continue;
    AxisVector rotated = q;
    rotated[j] += 1.0;
    sum += (control_.tool_in_workpiece(rotated).translation() - tip).norm() / (2 * std::sin(0.5));
  }
  return sum;
}

void BlockSampler::set_bounds() {
  double second = 0.0, third = 0.0;  // of the slides
  double turn_second = 0.0, turn_third = 0.0;
  double travel_squared = 0.0;
  for (int j = 0; j < control_.size(); ++j) {
    const DerivativeBounds b = derivative_bounds(path_, block_, j);
    if (is_rotary(j)) {
      bounds_.turn += b.first;
      turn_second += b.second;
      turn_third += b.third;
    } else if (is_slide(j)) {
      travel_squared += b.first * b.first;
      second += b.second;
      third += b.third;
    }
  }
  bounds_.travel = std::sqrt(travel_squared);
  double sweep = 0.0, radius = 0.0;
  if (block_.interpolation == Interpolation::Arc) {
    const Arc& arc = path_.arcs[block_.shape];
    sweep = std::abs(arc.sweep);
    radius = std::max(arc.radius, arc.radius + arc.growth) + std::abs(arc.growth);
    bounds_.travel += radius * sweep;
  }
  // The travel of the block may lengthen the lever of each of two rotary axes.
  if (bounds_.turn > 0.0) bounds_.lever = lever_sum() + 2 * bounds_.travel;
  // (w + sqrt(w2) + cbrt(w3))^5 times 3 bounds the fifth Bell polynomial of a rotation with
  // derivatives w, w2, w3: its term 15 w w2^2 is three times that of the power; the others are at
  // most equal to theirs.
  const double w = bounds_.turn + std::sqrt(turn_second) + std::cbrt(turn_third);
  const double rotation_fifth = 2 * (turn_second > 0.0 ? 3 : 1) * std::pow(w, 5);
  if (is_tip_mode_) {
    bounds_.fifth_derivative = options_.reach * rotation_fifth + radius * std::pow(sweep, 5);
  } else {
    // Leibniz rule for the fifth derivative of slide motion times rotation; 5, 10, 10 are binomial
    // coefficients.
    bounds_.fifth_derivative =
        (options_.reach + bounds_.lever) * rotation_fifth + radius * std::pow(sweep + w, 5) +
        5 * bounds_.travel * std::pow(w, 4) + 10 * second * std::pow(w, 3) + 10 * third * w * w;
  }
}

AxisVector BlockSampler::slides(const AxisVector& programmed) const {
  return axes_for_tip(path_, block_, control_, programmed, programmed_tip(programmed));
}

AxisVector BlockSampler::axes(double u) const {
  const AxisVector programmed = position(path_, block_, u);
  if (!is_tip_mode_) return programmed;
  if (!is_straight_ || qa_.size() == 0 || qb_.size() == 0) return slides(programmed);
  if (u >= 1.0) return qb_;
  return qa_ + u * (qb_ - qa_);
}

ToolPosition BlockSampler::tool_position(double u) const {
  AxisVector q = position(path_, block_, u);
  // The rotation of the workpiece spindle is excluded from the chord error.
  if (options_.workpiece_spindle) q[*options_.workpiece_spindle] = 0.0;
  // Under G43.4 the slides need not be computed: they do not rotate the tool, and the tip is
  // programmed.
  const kinematics::Pose T_wt = control_.tool_in_workpiece(q);
  return {is_tip_mode_ ? programmed_tip(q) : Eigen::Vector3d(T_wt.translation()),
          T_wt.linear().col(2)};
}

/// Returns the fractions of a block at which axes reverse, with both ends, so that every reversal
/// is sampled.
std::vector<double> BlockSampler::breakpoints() const {
  std::vector<double> u{0.0, 1.0};
  const auto add = [&](double fraction) {
    // A reversal this close to an end of the block would only add a part without samples.
    if (fraction > 1e-9 && fraction < 1 - 1e-9) u.push_back(fraction);
  };
  if (block_.interpolation == Interpolation::Arc)
    for (const double fraction : reversal_points(path_, block_)) add(fraction);
  if (block_.interpolation == Interpolation::Cubic) {
    const double duration = block_.end_s - block_.start_s;
    const Cubic& cubic = path_.cubics[block_.shape];
    for (int j = 0; j < control_.size(); ++j) {
      if (is_spindle(j)) continue;
      const double c0 = cubic.start_velocity[j] * duration, c2 = cubic.end_velocity[j] * duration;
      // The rate is a parabola; c1 is its middle Bezier coefficient.
      const double c1 = 3 * (block_.end[j] - block_.start[j]) - c0 - c2;
      for (const double root : roots(c0 - 2 * c1 + c2, c1 - c0, c0)) add(root);
    }
  }
  std::sort(u.begin(), u.end());
  return u;
}

/// Returns a bound on the rotation of the tool axis over a part: the peak rate is at most the
/// largest mean rate of a quarter plus the change of rate within it, turn^2 / 4.
double BlockSampler::rotation_bound(const QuarterPositions& positions, double u_length) const {
  double max_quarter_angle = 0.0;
  for (std::size_t k = 1; k < positions.size(); ++k)
    max_quarter_angle = std::max(max_quarter_angle,
                                 angle_between(positions[k - 1].direction, positions[k].direction));
  const double turn = bounds_.turn * u_length;
  return 4 * max_quarter_angle + 0.25 * turn * turn;
}

/// Returns a bound on the second derivative of the deviation of the motion from its chord. With n
/// equal chords the chord error is at most this bound over 8 n^2. The bound is the second
/// derivative of the quartic through five instants, plus a bound on its remainder.
double BlockSampler::chord_error_bound(const QuarterPositions& positions, double u_length) const {
  // Finite differences of the quartic through five points with step 1/4 (12 h^2 = 12/16); its ends
  // are zero.
  static constexpr double second_differences[5][3] = {
      {-104, 114, -56}, {-20, 6, 4}, {16, -30, 16}, {4, 6, -20}, {-56, 114, -104}};
  const ToolPosition &a = positions.front(), &b = positions.back();
  std::array<std::array<Eigen::Vector3d, 3>, 2> deviations;  // at the tip and at `reach`
  for (std::size_t k = 0; k < 3; ++k) {
    const double u = 0.25 * double(k + 1);
    const ToolPosition& p = positions[k + 1];
    deviations[0][k] = p.tip - ((1 - u) * a.tip + u * b.tip);
    deviations[1][k] =
        deviations[0][k] +
        options_.reach * (p.direction - great_circle_point(a.direction, b.direction, u));
  }
  double max_second_derivative = 0.0;
  for (const auto& e : deviations)
    for (const auto& row : second_differences)
      max_second_derivative =
          std::max(max_second_derivative,
                   (row[0] * e[0] + row[1] * e[1] + row[2] * e[2]).norm() * 16.0 / 12.0);
  // A parabola that is within 1 at five equidistant points stays below 1.13 between them. 0.03
  // bounds the remainder of the quartic's second derivative per unit of the fifth derivative.
  return 1.13 * (1 + 3 * bounds_.turn * u_length) * max_second_derivative +
         0.03 * bounds_.fifth_derivative * std::pow(u_length, 5);
}

/// Returns the number of parts for which the remainder term of `chord_error_bound` (0.03 times the
/// fifth derivative) stays below a tenth of the permitted value, 8 tolerances, and no part rotates
/// by more than 0.1 rad.
int BlockSampler::coarse_parts(double u_length) const {
  const double remainder_parts =
      std::pow(0.03 * bounds_.fifth_derivative / (0.8 * options_.chord_tolerance), 0.2);
  return to_part_count(u_length * std::max(remainder_parts, bounds_.turn / 0.1));
}

int BlockSampler::steps(double ua, double ub, const AxisVector& qa, const AxisVector& qb) const {
  const double u_length = ub - ua;
  const double turn = bounds_.turn * u_length, travel = bounds_.travel * u_length;
  double n = (is_tip_mode_ ? travel : travel + bounds_.lever * turn) / options_.max_step;
  // The largest step exceeds the mean step by at most half of the second derivative.
  // The second derivative is that of the rotated lever plus twice the product of both rates.
  double slide_bend = 0.5 * (bounds_.lever * turn * turn + 2 * travel * turn);
  if (block_.interpolation == Interpolation::Arc) {
    const Arc& arc = path_.arcs[block_.shape];
    slide_bend += 0.5 * arc.radius * arc.sweep * arc.sweep * u_length * u_length;
  }
  for (int j = 0; j < control_.size(); ++j) {
    const double programmed = derivative_bounds(path_, block_, j).first * u_length;
    if (options_.workpiece_spindle == j) {
      n = std::max(n, programmed / options_.max_spindle_turn);
    } else if (motion(j) == Motion::Spindle) {
      if (options_.max_tool_spindle_turn)
        n = std::max(n, programmed / *options_.max_tool_spindle_turn);
    } else if (is_slide(j) && is_tip_mode_) {
      n = std::max(n, (std::abs(qb[j] - qa[j]) + (is_straight_ ? 0.0 : slide_bend)) /
                          options_.max_axis_step);
    } else if (!is_spindle(j)) {
      n = std::max(n, programmed / options_.max_axis_step);
    }
  }
  const bool is_linear =
      block_.interpolation != Interpolation::Arc && block_.interpolation != Interpolation::Cubic;
  if (turn > 0.0 || !is_linear) {
    QuarterPositions positions;
    for (std::size_t k = 0; k < positions.size(); ++k)
      positions[k] = tool_position(ua + 0.25 * double(k) * u_length);
    n = std::max(
        {n, rotation_bound(positions, u_length) / options_.max_turn,
         std::sqrt(chord_error_bound(positions, u_length) / (8 * options_.chord_tolerance))});
  }
  return to_part_count(n);
}

/// Collects samples and tracks the direction of each axis.
class SampleRecorder {
 public:
  SampleRecorder(const Path& path, const kinematics::Chain& control, const SampleOptions& options)
      : path_(path), control_(control), options_(options) {
    if (options.continued_from) continue_from(*options.continued_from, 0);
  }

  void start(const AxisVector& q, double time_s, int block);
  void move_to(const AxisVector& q, double time_s, int block);
  void check_capacity(double additional_count, int block) const;
  void continue_from(const SamplingState& from, int block);
  std::size_t count() const { return samples_.states.size(); }
  Samples take();

 private:
  void push(kinematics::AxisState state, int block);
  bool update_directions(const AxisVector& q, kinematics::AxisState& state);

  const Path& path_;
  const kinematics::Chain& control_;
  const SampleOptions& options_;
  Samples samples_;
  AxisVector last_motion_position_;  ///< last position at which each axis was detected to move
};

// Called before the samples are computed, so that no memory is allocated for too many.
void SampleRecorder::check_capacity(double additional_count, int block) const {
  if (double(samples_.states.size()) + additional_count > double(options_.max_samples))
    throw TooManySamples(path_.file, path_.blocks[std::size_t(block)].line, 0,
                         fmt::format("a program of at most {} samples", options_.max_samples),
                         "more");
}

void SampleRecorder::continue_from(const SamplingState& from, int block) {
  last_motion_position_ = from.moved;
  push(from.last, block);
}

Samples SampleRecorder::take() {
  samples_.moved = last_motion_position_;
  return std::exchange(samples_, {});
}

void SampleRecorder::push(kinematics::AxisState state, int block) {
  samples_.states.push_back(std::move(state));
  samples_.line.push_back(path_.blocks[std::size_t(block)].line);
  samples_.block.push_back(block);
}

/// Updates the directions and strokes in `state` for a move to q. Returns true if an axis, spindles
/// excluded, reverses or starts.
bool SampleRecorder::update_directions(const AxisVector& q, kinematics::AxisState& state) {
  bool has_reversed = false;
  for (int j = 0; j < control_.size(); ++j) {
    const Motion motion = control_.joints()[std::size_t(j)].motion;
    const double displacement = q[j] - last_motion_position_[j];
    if (std::abs(displacement) <=
        (motion == Motion::Linear ? motion_threshold_mm : motion_threshold_rad))
      continue;
    last_motion_position_[j] = q[j];
    const std::int8_t direction = displacement > 0 ? 1 : -1;
    std::int8_t& previous_direction = state.direction[std::size_t(j)];
    if (direction == previous_direction) continue;
    const bool is_counted = motion != Motion::Spindle && options_.workpiece_spindle != j;
    if (previous_direction != 0) ++state.stroke[std::size_t(j)];
    previous_direction = direction;
    has_reversed = has_reversed || is_counted;
  }
  return has_reversed;
}

/// Begins a block. The last sample of the previous block is reused unless the program leaves a gap.
void SampleRecorder::start(const AxisVector& q, double time_s, int block) {
  if (!samples_.states.empty()) {
    const kinematics::AxisState& last = samples_.states.back();
    if (last.time_s == time_s && (last.q - q).cwiseAbs().maxCoeff() < min_gap) return;
  }
  move_to(q, time_s, block);
}

void SampleRecorder::move_to(const AxisVector& q, double time_s, int block) {
  if (samples_.states.empty()) {
    last_motion_position_ = q;
    push({q, time_s, options_.before.direction, options_.before.stroke, 0.0}, block);
    return;
  }
  kinematics::AxisState state = samples_.states.back();
  // A reversal adds a second sample at the same position and time with the new direction, because
  // play and friction jump there.
  if (update_directions(q, state)) push(state, block);
  state.q = q;
  state.time_s = time_s;
  push(std::move(state), block);
}

/// A part of a block that is sampled in equal steps.
struct StepRange {
  double from, to;  // fractions of the block
  int steps;
  const AxisVector& end;
};

/// Calls `visit` for the parts of a block in order, and before each `check_steps` with its number
/// of steps, so that too many can be rejected.
template <class CheckSteps, class Visit>
void for_each_step_range(const BlockSampler& sampler, const AxisVector& start,
                         const CheckSteps& check_steps, const Visit& visit) {
  AxisVector qa = start;
  const std::vector<double> part_ends = sampler.breakpoints();
  for (std::size_t i = 0; i + 1 < part_ends.size(); ++i) {
    const double length = part_ends[i + 1] - part_ends[i];
    const int part_count = sampler.coarse_parts(length);
    check_steps(part_count);
    for (int k = 0; k < part_count; ++k) {
      const double ua = part_ends[i] + length * k / part_count;
      const double ub =
          k + 1 == part_count ? part_ends[i + 1] : part_ends[i] + length * (k + 1) / part_count;
      const AxisVector qb = sampler.axes(ub);
      const int steps = sampler.steps(ua, ub, qa, qb);
      check_steps(steps);
      visit(StepRange{ua, ub, steps, qb});
      qa = qb;
    }
  }
}

/// Adds the samples of one block to the recorder.
void sample_block(const Path& path, int index, const kinematics::Chain& control,
                  const SampleOptions& options, SampleRecorder& recorder) {
  const Block& block = path.blocks[std::size_t(index)];
  const BlockSampler sampler(path, block, control, options);
  const AxisVector start = sampler.axes(0.0);
  recorder.start(start, block.start_s, index);
  const double duration = block.end_s - block.start_s;
  const auto record = [&](const StepRange& range) {
    for (int step = 1; step < range.steps; ++step) {
      const double u = range.from + (range.to - range.from) * step / range.steps;
      recorder.move_to(sampler.axes(u), block.start_s + u * duration, index);
    }
    recorder.move_to(range.end, range.to == 1.0 ? block.end_s : block.start_s + range.to * duration,
                     index);
  };
  for_each_step_range(
      sampler, start, [&](int steps) { recorder.check_capacity(steps, index); }, record);
}

/// Throws TooManySamples if the path has more than `max_samples`, before any sample is computed.
void check_sample_count(const Path& path, const kinematics::Chain& control,
                        const SampleOptions& options, double max_samples) {
  double count = 0.0;
  for (const Block& block : path.blocks) {
    const BlockSampler sampler(path, block, control, options);
    const auto check_steps = [&](int steps) {
      if (count + steps > max_samples)
        throw TooManySamples(path.file, block.line, 0,
                             fmt::format("a program of at most {:.0f} samples", max_samples),
                             "more");
    };
    for_each_step_range(sampler, sampler.axes(0.0), check_steps,
                        [&](const StepRange& range) { count += range.steps; });
  }
}

std::optional<int> find_sampled_spindle(const kinematics::Chain& control,
                                        const SampleOptions& options) {
  if (options.workpiece_spindle) return options.workpiece_spindle;
  for (int j = 0; j < control.size(); ++j)
    if (control.joints()[std::size_t(j)].motion == Motion::Spindle) return j;
  return std::nullopt;
}

/// Sets the spindle speed of each sample: the mean over the interval that ends there. The first
/// sample of a program takes that of the interval that follows.
void set_spindle_speeds(Samples& samples, int spindle, bool is_program_start) {
  std::vector<kinematics::AxisState>& states = samples.states;
  for (std::size_t i = 1; i < states.size(); ++i) {
    const double time = states[i].time_s - states[i - 1].time_s;
    // The second sample of a reversal, at the same time, takes the speed of the first.
    states[i].spindle_speed = time > 0.0
                                  ? std::abs(states[i].q[spindle] - states[i - 1].q[spindle]) / time
                                  : states[i - 1].spindle_speed;
  }
  if (is_program_start && states.size() > 1) states.front().spindle_speed = states[1].spindle_speed;
}

void check_axis_count(const Path& path, const kinematics::Chain& control) {
  for (const Block& block : path.blocks)
    if (block.start.size() != control.size())
      throw std::invalid_argument("expected a path with as many axes as the chain");
}

}  // namespace

Samples sample(const Path& path, const kinematics::Chain& control, const SampleOptions& options) {
  check_axis_count(path, control);
  SampleRecorder recorder(path, control, options);
  for (int i = options.continued_from ? 1 : 0; i < int(path.blocks.size()); ++i)
    sample_block(path, i, control, options, recorder);
  Samples samples = recorder.take();
  if (const auto spindle = find_sampled_spindle(control, options))
    set_spindle_speeds(samples, *spindle, !options.continued_from);
  return samples;
}

std::vector<SampleWindow> windows(const Path& path, const kinematics::Chain& control,
                                  const SampleOptions& options, std::size_t max_samples_per_window,
                                  const std::function<void(double fraction)>& progress) {
  check_axis_count(path, control);
  check_sample_count(path, control, options, max_samples_in_windows);
  // The samples are computed here only to find the ends of the windows, and dropped window by
  // window.
  const std::optional<int> spindle = find_sampled_spindle(control, options);
  SampleRecorder recorder(path, control, options);
  std::vector<SampleWindow> result{{0, 0}};
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    sample_block(path, int(i), control, options, recorder);
    // Reports are so rare that their cost is negligible.
    constexpr std::size_t progress_block_interval = 1000;
    if (progress && i % progress_block_interval == 0)
      progress(double(i) / double(path.blocks.size()));
    result.back().last = i + 1;
    // The last window ends with the path even if it is short.
    if (recorder.count() < max_samples_per_window || result.back().last == path.blocks.size())
      continue;
    Samples samples = recorder.take();
    if (spindle) set_spindle_speeds(samples, *spindle, result.size() == 1);
    const SamplingState end{samples.states.back(), samples.moved};
    result.push_back({i + 1, i + 1, end});
    recorder.continue_from(end, int(i));
  }
  return result;
}

Path path_of(const Path& path, const SampleWindow& window) {
  return path_segment(path, window.continued_from ? window.first - 1 : window.first, window.last);
}

}  // namespace abbe::sim::program
