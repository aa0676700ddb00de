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

// An axis has moved once it is this far from where it was last detected to move. Smaller steps are
// the rounding of the control's arithmetic and must not count as reversals.
constexpr double motion_threshold_mm = 1e-9;
constexpr double motion_threshold_rad = 1e-11;
constexpr double same_place = 1e-9;  // mm or rad, rounding of a conversion between axes and tip

/// Tool position in the workpiece.
struct Place {
  Eigen::Vector3d tip;
  Eigen::Vector3d direction;
};

/// Tool at the ends and at the three inner quarter points of a part of a block.
using Places = std::array<Place, 5>;

/// Bounds over a whole block of the motion per unit of u and its powers.
struct Rates {
  double turn = 0.0;    ///< rad, sum over the rotary axes
  double travel = 0.0;  ///< mm, path of the slides, or of the tip as programmed
  double fifth = 0.0;   ///< mm, fifth derivative of any point of the tool axis up to `reach`
  double lever = 0.0;   ///< mm, sum of the distances of the tip from the rotary axis lines
};

/// Real roots of a u^2 + 2 b u + c, in the form that does not subtract nearly equal numbers.
std::vector<double> roots(double a, double b, double c) {
  const double discriminant = b * b - a * c;
  if (!(discriminant > 0.0)) return {};
  const double t = -(b + std::copysign(std::sqrt(discriminant), b));
  std::vector<double> found;
  if (t != 0.0) found.push_back(c / t);
  if (a != 0.0) found.push_back(t / a);
  return found;
}

// Rounds up; 1e-9 keeps a quotient that is whole up to rounding, and 1e9 keeps the result within
// int.
int whole_parts(double parts) { return int(std::ceil(std::clamp(parts - 1e-9, 1.0, 1e9))); }

/// Motion of one block as the control executes it.
class Walk {
 public:
  Walk(const Path& path, const Block& block, const kinematics::Chain& control,
       const SampleOptions& options);

  AxisVector axes(double u) const;
  std::vector<double> breakpoints() const;
  int coarse_pieces(double part) const;
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
  Place place(double u) const;
  double bend(const Places& places, double part) const;
  double turning(const Places& places, double part) const;
  double sum_of_levers() const;
  void set_rates();

  const Path& path_;
  const Block& block_;
  const kinematics::Chain& control_;
  const SampleOptions& options_;
  bool tip_ = false;
  int x_ = -1, y_ = -1, z_ = -1;
  Rates rates_;
  AxisVector qa_, qb_;  ///< slides at the ends, if they move in a straight line between them
  bool straight_ = false;
};

Walk::Walk(const Path& path, const Block& block, const kinematics::Chain& control,
           const SampleOptions& options)
    : path_(path), block_(block), control_(control), options_(options) {
  tip_ = block.coordinates == Coordinates::Tip;
  if (tip_) {
    const auto x = control.find('X'), y = control.find('Y'), z = control.find('Z');
    if (!x || !y || !z)
      throw BadInput(path.file, block.line, 0, "a machine with X Y Z for G43.4", "another");
    x_ = *x, y_ = *y, z_ = *z;
  }
  set_rates();
  // Without rotation the slides follow the tip linearly: they are solved at the two ends only.
  straight_ = tip_ && rates_.turn == 0.0 && block.interpolation != Interpolation::Arc &&
              block.interpolation != Interpolation::Cubic;
  if (straight_) {
    qa_ = slides(block.start);
    qb_ = slides(block.end);
  }
}

/// Sum of the distances of the tip from all rotary axis lines: a rotation by 1 rad displaces the
/// tip by the chord 2 L sin(1/2).
double Walk::sum_of_levers() const {
  const AxisVector q = axes(0.0);
  const Eigen::Vector3d tip = control_.tool_in_workpiece(q).translation();
  double levers = 0.0;
  for (int j = 0; j < control_.size(); ++j) {
    if (!is_rotary(j)) continue;
    AxisVector turned = q;
    turned[j] += 1.0;
    levers += (control_.tool_in_workpiece(turned).translation() - tip).norm() / (2 * std::sin(0.5));
  }
  return levers;
}

void Walk::set_rates() {
  double second = 0.0, third = 0.0;  // of the slides
  double turn_second = 0.0, turn_third = 0.0;
  double travel_squared = 0.0;
  for (int j = 0; j < control_.size(); ++j) {
    const DerivativeBounds b = derivative_bounds(path_, block_, j);
    if (is_rotary(j)) {
      rates_.turn += b.first;
      turn_second += b.second;
      turn_third += b.third;
    } else if (is_slide(j)) {
      travel_squared += b.first * b.first;
      second += b.second;
      third += b.third;
    }
  }
  rates_.travel = std::sqrt(travel_squared);
  double sweep = 0.0, radius = 0.0;
  if (block_.interpolation == Interpolation::Arc) {
    const Arc& arc = path_.arcs[block_.shape];
    sweep = std::abs(arc.sweep);
    radius = std::max(arc.radius, arc.radius + arc.growth) + std::abs(arc.growth);
    rates_.travel += radius * sweep;
  }
  // The travel of the block may lengthen the lever of each of two rotary axes.
  if (rates_.turn > 0.0) rates_.lever = sum_of_levers() + 2 * rates_.travel;
  // (w + sqrt(w2) + cbrt(w3))^5 times 3 bounds the fifth Bell polynomial of a rotation with
  // derivatives w, w2, w3.
  const double w = rates_.turn + std::sqrt(turn_second) + std::cbrt(turn_third);
  const double turned = 2 * (turn_second > 0.0 ? 3 : 1) * std::pow(w, 5);
  if (tip_) {
    rates_.fifth = options_.reach * turned + radius * std::pow(sweep, 5);
  } else {
    // Leibniz rule for the fifth derivative of slide motion times rotation; 5, 10, 10 are binomial
    // coefficients.
    rates_.fifth = (options_.reach + rates_.lever) * turned + radius * std::pow(sweep + w, 5) +
                   5 * rates_.travel * std::pow(w, 4) + 10 * second * std::pow(w, 3) +
                   10 * third * w * w;
  }
}

AxisVector Walk::slides(const AxisVector& programmed) const {
  return axes_for_tip(path_, block_, control_, programmed, programmed_tip(programmed));
}

AxisVector Walk::axes(double u) const {
  const AxisVector programmed = position(path_, block_, u);
  if (!tip_) return programmed;
  if (!straight_ || qa_.size() == 0 || qb_.size() == 0) return slides(programmed);
  if (u >= 1.0) return qb_;
  return qa_ + u * (qb_ - qa_);
}

Place Walk::place(double u) const {
  AxisVector q = position(path_, block_, u);
  // The rotation of the workpiece spindle is excluded from the chord error.
  if (options_.workpiece_spindle) q[*options_.workpiece_spindle] = 0.0;
  // Under G43.4 the slides are not needed: they do not rotate the tool, and the tip is as
  // programmed.
  const kinematics::Pose T_wt = control_.tool_in_workpiece(q);
  return {tip_ ? programmed_tip(q) : Eigen::Vector3d(T_wt.translation()), T_wt.linear().col(2)};
}

/// Fractions of a block between which no axis reverses, so that reversals are sampled.
std::vector<double> Walk::breakpoints() const {
  std::vector<double> u{0.0, 1.0};
  const auto add = [&](double at) {
    // A reversal this close to an end of the block would only add an empty part.
    if (at > 1e-9 && at < 1 - 1e-9) u.push_back(at);
  };
  if (block_.interpolation == Interpolation::Arc)
    for (const double at : reversal_points(path_, block_)) add(at);
  if (block_.interpolation == Interpolation::Cubic) {
    const double duration = block_.end_s - block_.start_s;
    const Cubic& cubic = path_.cubics[block_.shape];
    for (int j = 0; j < control_.size(); ++j) {
      if (is_spindle(j)) continue;
      const double c0 = cubic.start_velocity[j] * duration, c2 = cubic.end_velocity[j] * duration;
      // Bezier coefficient of the rate, a parabola.
      const double c1 = 3 * (block_.end[j] - block_.start[j]) - c0 - c2;
      for (const double root : roots(c0 - 2 * c1 + c2, c1 - c0, c0)) add(root);
    }
  }
  std::sort(u.begin(), u.end());
  return u;
}

// Bound of the rotation of the tool axis over a part: the peak rate is at most the largest mean
// rate of a quarter plus the change of rate within it, turn^2 / 4.
double Walk::turning(const Places& places, double part) const {
  double quickest = 0.0;
  for (std::size_t k = 1; k < places.size(); ++k)
    quickest = std::max(quickest, angle_between(places[k - 1].direction, places[k].direction));
  const double turn = rates_.turn * part;
  return 4 * quickest + 0.25 * turn * turn;
}

/// Bound of 8 n^2 times the distance between the true motion and n lines and great circles: the
/// second derivative of their difference, from the quartic through five instants plus a bound of
/// the remainder.
double Walk::bend(const Places& places, double part) const {
  // Finite differences of the quartic through five points, its ends zero, step 1/4 (12 h^2 =
  // 12/16).
  static constexpr double second[5][3] = {
      {-104, 114, -56}, {-20, 6, 4}, {16, -30, 16}, {4, 6, -20}, {-56, 114, -104}};
  const Place &a = places.front(), &b = places.back();
  std::array<std::array<Eigen::Vector3d, 3>, 2> off;  // at the tip and at `reach`
  for (std::size_t k = 0; k < 3; ++k) {
    const double at = 0.25 * double(k + 1);
    const Place& p = places[k + 1];
    off[0][k] = p.tip - ((1 - at) * a.tip + at * b.tip);
    off[1][k] = off[0][k] +
                options_.reach * (p.direction - great_circle_point(a.direction, b.direction, at));
  }
  double largest = 0.0;
  for (const auto& e : off)
    for (const auto& row : second)
      largest =
          std::max(largest, (row[0] * e[0] + row[1] * e[1] + row[2] * e[2]).norm() * 16.0 / 12.0);
  // A parabola within 1 at five equidistant points stays below 1.13 between them. 0.03 bounds the
  // remainder of the quartic's second derivative per unit of the fifth derivative.
  return 1.13 * (1 + 3 * rates_.turn * part) * largest + 0.03 * rates_.fifth * std::pow(part, 5);
}

/// Number of parts such that the remainder, 0.03 of the fifth derivative, stays below a tenth of
/// the tolerance (8 times which is the bound of `bend`), and no part rotates by more than 0.1 rad.
int Walk::coarse_pieces(double part) const {
  const double unseen = std::pow(0.03 * rates_.fifth / (0.8 * options_.chord_tolerance), 0.2);
  return whole_parts(part * std::max(unseen, rates_.turn / 0.1));
}

int Walk::steps(double ua, double ub, const AxisVector& qa, const AxisVector& qb) const {
  const double part = ub - ua;
  const double turn = rates_.turn * part, travel = rates_.travel * part;
  double n = (tip_ ? travel : travel + rates_.lever * turn) / options_.max_step;
  // Half of the second derivative: the largest step exceeds the mean step by at most that.
  double slide_bend = 0.5 * (rates_.lever * turn * turn + 2 * travel * turn);
  if (block_.interpolation == Interpolation::Arc) {
    const Arc& arc = path_.arcs[block_.shape];
    slide_bend += 0.5 * arc.radius * arc.sweep * arc.sweep * part * part;
  }
  for (int j = 0; j < control_.size(); ++j) {
    const double programmed = derivative_bounds(path_, block_, j).first * part;
    if (options_.workpiece_spindle == j) {
      n = std::max(n, programmed / options_.max_spindle_turn);
    } else if (motion(j) == Motion::Spindle) {
      if (options_.max_nose_turn) n = std::max(n, programmed / *options_.max_nose_turn);
    } else if (is_slide(j) && tip_) {
      n = std::max(
          n, (std::abs(qb[j] - qa[j]) + (straight_ ? 0.0 : slide_bend)) / options_.max_axis_step);
    } else if (!is_spindle(j)) {
      n = std::max(n, programmed / options_.max_axis_step);
    }
  }
  const bool line =
      block_.interpolation != Interpolation::Arc && block_.interpolation != Interpolation::Cubic;
  if (turn > 0.0 || !line) {
    Places places;
    for (std::size_t k = 0; k < places.size(); ++k) places[k] = place(ua + 0.25 * double(k) * part);
    n = std::max({n, turning(places, part) / options_.max_turn,
                  std::sqrt(bend(places, part) / (8 * options_.chord_tolerance))});
  }
  return whole_parts(n);
}

/// Collects samples and tracks the direction of each axis.
class Recorder {
 public:
  Recorder(const Path& path, const kinematics::Chain& control, const SampleOptions& options)
      : path_(path), control_(control), options_(options) {
    if (options.goes_on) go_on(*options.goes_on, 0);
  }

  void start(const AxisVector& q, double time_s, int block);
  void go(const AxisVector& q, double time_s, int block);
  void expect(double more, int block) const;
  void go_on(const SamplingState& from, int block);
  std::size_t count() const { return samples_.states.size(); }
  Samples take();

 private:
  void push(kinematics::AxisState state, int block);
  bool turn_back(const AxisVector& q, kinematics::AxisState& state);

  const Path& path_;
  const kinematics::Chain& control_;
  const SampleOptions& options_;
  Samples samples_;
  AxisVector moved_;  ///< last position at which each axis was detected to move
};

// Called before the samples are made, so that no memory is taken for too many.
void Recorder::expect(double more, int block) const {
  if (double(samples_.states.size()) + more > double(options_.max_samples))
    throw TooManySamples(path_.file, path_.blocks[std::size_t(block)].line, 0,
                         fmt::format("a program of at most {} samples", options_.max_samples),
                         "more");
}

void Recorder::go_on(const SamplingState& from, int block) {
  moved_ = from.moved;
  push(from.last, block);
}

Samples Recorder::take() {
  samples_.moved = moved_;
  return std::exchange(samples_, {});
}

void Recorder::push(kinematics::AxisState state, int block) {
  samples_.states.push_back(std::move(state));
  samples_.line.push_back(path_.blocks[std::size_t(block)].line);
  samples_.block.push_back(block);
}

/// Updates the directions and strokes in `state` for a move to q. Returns true if an axis other
/// than a spindle reverses or starts.
bool Recorder::turn_back(const AxisVector& q, kinematics::AxisState& state) {
  bool turned = false;
  for (int j = 0; j < control_.size(); ++j) {
    const Motion motion = control_.joints()[std::size_t(j)].motion;
    const double way = q[j] - moved_[j];
    if (std::abs(way) <= (motion == Motion::Linear ? motion_threshold_mm : motion_threshold_rad))
      continue;
    moved_[j] = q[j];
    const std::int8_t direction = way > 0 ? 1 : -1;
    std::int8_t& last = state.direction[std::size_t(j)];
    if (direction == last) continue;
    const bool counted = motion != Motion::Spindle && options_.workpiece_spindle != j;
    if (last != 0) ++state.stroke[std::size_t(j)];
    last = direction;
    turned = turned || counted;
  }
  return turned;
}

/// Begins a block: the end of the previous block is reused unless the program leaves a gap.
void Recorder::start(const AxisVector& q, double time_s, int block) {
  if (!samples_.states.empty()) {
    const kinematics::AxisState& last = samples_.states.back();
    if (last.time_s == time_s && (last.q - q).cwiseAbs().maxCoeff() < same_place) return;
  }
  go(q, time_s, block);
}

void Recorder::go(const AxisVector& q, double time_s, int block) {
  if (samples_.states.empty()) {
    moved_ = q;
    push({q, time_s, options_.before.direction, options_.before.stroke, 0.0}, block);
    return;
  }
  kinematics::AxisState state = samples_.states.back();
  // A reversal adds a second sample at the same position and time with the new direction, because
  // play and friction jump there.
  if (turn_back(q, state)) push(state, block);
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

/// Visits the parts of a block in order. `expects` is called with each number of steps beforehand,
/// so that it can reject too many.
template <class Expects, class Use>
void for_each_step_range(const Walk& walk, const AxisVector& start, const Expects& expects,
                         const Use& use) {
  AxisVector qa = start;
  const std::vector<double> breaks = walk.breakpoints();
  for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
    const double length = breaks[i + 1] - breaks[i];
    const int pieces = walk.coarse_pieces(length);
    expects(pieces);
    for (int k = 0; k < pieces; ++k) {
      const double ua = breaks[i] + length * k / pieces;
      const double ub = k + 1 == pieces ? breaks[i + 1] : breaks[i] + length * (k + 1) / pieces;
      const AxisVector qb = walk.axes(ub);
      const int steps = walk.steps(ua, ub, qa, qb);
      expects(steps);
      use(StepRange{ua, ub, steps, qb});
      qa = qb;
    }
  }
}

void sample_block(const Path& path, int index, const kinematics::Chain& control,
                  const SampleOptions& options, Recorder& recorder) {
  const Block& block = path.blocks[std::size_t(index)];
  const Walk walk(path, block, control, options);
  const AxisVector start = walk.axes(0.0);
  recorder.start(start, block.start_s, index);
  const double duration = block.end_s - block.start_s;
  const auto record = [&](const StepRange& piece) {
    for (int step = 1; step < piece.steps; ++step) {
      const double u = piece.from + (piece.to - piece.from) * step / piece.steps;
      recorder.go(walk.axes(u), block.start_s + u * duration, index);
    }
    recorder.go(piece.end, piece.to == 1.0 ? block.end_s : block.start_s + piece.to * duration,
                index);
  };
  for_each_step_range(
      walk, start, [&](int steps) { recorder.expect(steps, index); }, record);
}

/// Throws TooManySamples before any sample is made.
void check_count(const Path& path, const kinematics::Chain& control, const SampleOptions& options,
                 double most) {
  double count = 0.0;
  for (const Block& block : path.blocks) {
    const Walk walk(path, block, control, options);
    const auto expects = [&](int steps) {
      if (count + steps > most)
        throw TooManySamples(path.file, block.line, 0,
                             fmt::format("a program of at most {:.0f} samples", most), "more");
    };
    for_each_step_range(walk, walk.axes(0.0), expects,
                        [&](const StepRange& piece) { count += piece.steps; });
  }
}

std::optional<int> find_spindle(const kinematics::Chain& control, const SampleOptions& options) {
  if (options.workpiece_spindle) return options.workpiece_spindle;
  for (int j = 0; j < control.size(); ++j)
    if (control.joints()[std::size_t(j)].motion == Motion::Spindle) return j;
  return std::nullopt;
}

/// The speed at a sample is the mean over the interval that ends there. The first sample of a
/// program takes that of the interval that follows.
void note_spindle_speed(Samples& samples, int spindle, bool begins) {
  std::vector<kinematics::AxisState>& states = samples.states;
  for (std::size_t i = 1; i < states.size(); ++i) {
    const double time = states[i].time_s - states[i - 1].time_s;
    // A second sample at the same time (a reversal) takes the speed of the first.
    states[i].spindle_speed = time > 0.0
                                  ? std::abs(states[i].q[spindle] - states[i - 1].q[spindle]) / time
                                  : states[i - 1].spindle_speed;
  }
  if (begins && states.size() > 1) states.front().spindle_speed = states[1].spindle_speed;
}

void check_size(const Path& path, const kinematics::Chain& control) {
  for (const Block& block : path.blocks)
    if (block.start.size() != control.size())
      throw std::invalid_argument("expected a path with as many axes as the chain");
}

}  // namespace

Samples sample(const Path& path, const kinematics::Chain& control, const SampleOptions& options) {
  check_size(path, control);
  Recorder recorder(path, control, options);
  for (int i = options.goes_on ? 1 : 0; i < int(path.blocks.size()); ++i)
    sample_block(path, i, control, options, recorder);
  Samples samples = recorder.take();
  if (const auto spindle = find_spindle(control, options))
    note_spindle_speed(samples, *spindle, !options.goes_on);
  return samples;
}

std::vector<Window> windows(const Path& path, const kinematics::Chain& control,
                            const SampleOptions& options, std::size_t most,
                            const std::function<void(double part)>& progress) {
  check_size(path, control);
  check_count(path, control, options, max_in_windows);
  // The samples of the windows are made once here to find their ends, and dropped window by window.
  const std::optional<int> spindle = find_spindle(control, options);
  Recorder recorder(path, control, options);
  std::vector<Window> all{{0, 0}};
  for (std::size_t i = 0; i < path.blocks.size(); ++i) {
    sample_block(path, int(i), control, options, recorder);
    // Rare enough to cost nothing beside sampling.
    constexpr std::size_t progress_block_interval = 1000;  // blocks
    if (progress && i % progress_block_interval == 0)
      progress(double(i) / double(path.blocks.size()));
    all.back().last = i + 1;
    // The last window ends with the path even if it is short.
    if (recorder.count() < most || all.back().last == path.blocks.size()) continue;
    Samples samples = recorder.take();
    if (spindle) note_spindle_speed(samples, *spindle, all.size() == 1);
    const SamplingState end{samples.states.back(), samples.moved};
    all.push_back({i + 1, i + 1, end});
    recorder.go_on(end, int(i));
  }
  return all;
}

Path path_of(const Path& path, const Window& window) {
  return stretch_of(path, window.goes_on ? window.first - 1 : window.first, window.last);
}

}  // namespace abbe::sim::program
