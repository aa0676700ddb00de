#include "sim/compensation/channels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

namespace abbe::sim::compensation {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Two fundamental solutions of y'' + 2 d w y' + w^2 y = 0 at a time. Then y is
/// (mean + d w odd) y(0) + odd y'(0), and y' is (mean - d w odd) y'(0) - w^2 odd y(0).
struct Transition {
  double mean = 1.0;
  double odd = 0.0;  // s
};

// Below critical damping the solution oscillates. (1 - d)(1 + d) keeps more digits near d = 1 than
// 1 - d^2.
Transition transition(double w, double d, double time_s) {
  if (d < 1.0) {
    const double frequency = w * std::sqrt((1.0 - d) * (1.0 + d));
    const double decay = std::exp(-d * w * time_s);
    const double angle = frequency * time_s;
    return {decay * std::cos(angle), decay * (angle == 0.0 ? time_s : std::sin(angle) / frequency)};
  }
  const double rate_spread = w * std::sqrt((d - 1.0) * (d + 1.0));
  // The slow rate is written as a quotient, because the difference of two near numbers would
  // cancel.
  const double slow_rate = w * w / (d * w + rate_spread);
  const double decay = std::exp(-slow_rate * time_s);
  const double fast_over_slow = std::expm1(-2.0 * rate_spread * time_s);
  return {decay * (1.0 + 0.5 * fast_over_slow),
          rate_spread == 0.0 ? decay * time_s : -decay * fast_over_slow / (2.0 * rate_spread)};
}

/// The offset of each column from rest or from steady following, which decays to zero.
struct Transient {
  VectorXd offset;  // mm or rad
  VectorXd rate;    // mm/s or rad/s; unused in first order
};

/// A validated loop with its constants in SI units.
struct Loop {
  bool is_second_order;
  double w;  // rad/s
  double d;
  LoopOptions options;

  double lag_s() const { return is_second_order ? 2.0 * d / w : 1.0 / w; }

  Transient after(const Transient& start, double time_s) const {
    if (!is_second_order) return {start.offset * std::exp(-w * time_s), start.rate};
    const Transition t = transition(w, d, time_s);
    const double friction = d * w * t.odd;
    return {(t.mean + friction) * start.offset + t.odd * start.rate,
            (t.mean - friction) * start.rate - w * w * t.odd * start.offset};
  }

  /// Returns a bound of the motion that remains, because the energy of a damped oscillator never
  /// grows.
  double remaining_motion(const Transient& current) const {
    if (!is_second_order) return current.offset.cwiseAbs().maxCoeff();
    return (current.offset.array().square() + (current.rate / w).array().square())
        .sqrt()
        .maxCoeff();
  }

  /// Returns the time to the next added knot. An overdamped loop creeps once its fast part has
  /// decayed, so its knots may then be farther apart.
  double knot_interval(const Transient& current, double time_s) const {
    double time_constant = 1.0 / w;
    if (is_second_order && d > 1.0) {
      const double rate_spread = w * std::sqrt((d - 1.0) * (d + 1.0));
      const double slow_rate = w * w / (d * w + rate_spread);
      const VectorXd fast = (current.rate + slow_rate * current.offset) / (2.0 * rate_spread);
      if (fast.cwiseAbs().maxCoeff() <= options.tolerance) time_constant = 1.0 / slow_rate;
    }
    // At least four units in the last place of the time, so that the time advances.
    return std::max(time_constant / options.per_constant,
                    4.0 * std::numeric_limits<double>::epsilon() * std::abs(time_s));
  }
};

Loop validated_loop(const PositionLoop& loop, const LoopOptions& options) {
  const auto require = [](bool holds, const char* requirement) {
    if (!holds) throw std::invalid_argument(std::string("position loop: expected ") + requirement);
  };
  const bool is_second_order = loop.order == PositionLoop::Order::Second;
  require(loop.bandwidth > 0.0 && std::isfinite(loop.bandwidth), "a bandwidth above 0");
  require(!is_second_order || (loop.damping >= 1e-3 && loop.damping <= 100.0),
          "a damping from 0.001 to 100");
  require(options.per_constant > 0, "at least one knot per time constant");
  require(options.tolerance > 0.0, "a tolerance above 0");
  return {is_second_order, 2.0 * std::numbers::pi * loop.bandwidth, loop.damping, options};
}

/// The response of a loop at rest to a line that starts at zero: position and rate as fractions of
/// the rise of the line.
struct LineResponse {
  double position;
  double rate;  // 1/s
};

LineResponse line_response(const Loop& loop, double time_s) {
  const double x = loop.w * time_s, d = loop.d;
  // Below 1e-3 the closed form cancels; three terms of the series are then exact to 1e-11.
  if (!loop.is_second_order) {
    if (x < 1e-3) return {x * (1.0 / 2 - x * (1.0 / 6 - x / 24)), 0.0};
    return {1.0 + std::expm1(-x) / x, 0.0};
  }
  // Near the start the closed form is a small difference of large numbers.
  if (std::max(1.0, 2.0 * d) * x < 1e-3) {
    const double first_order = 2.0 * d * x, second_order = (4.0 * d * d - 1.0) * x * x;
    return {x * x * (1.0 / 6 - first_order / 24 + second_order / 120),
            loop.w * x * (1.0 / 2 - first_order / 6 + second_order / 24)};
  }
  const Transition t = transition(loop.w, d, time_s);
  const double friction = d * loop.w * t.odd, lag = loop.lag_s();
  return {1.0 + (lag * (t.mean + friction - 1.0) - t.odd) / time_s,
          (1.0 - (t.mean - friction) - lag * loop.w * loop.w * t.odd) / time_s};
}

/// A line between two knots of a time series; the last one is held for ever.
struct SeriesSegment {
  double start_s, end_s;
  VectorXd from, rise;

  double length_s() const { return end_s - start_s; }
};

/// Adds knots between the ends of a line until the loop follows steadily.
void add_settling_knots(const SeriesSegment& line, const Loop& loop, const Transient& initial,
                        TimeSeriesBuilder& knots) {
  const VectorXd slope = line.rise / line.length_s();
  const VectorXd lag = loop.lag_s() * slope;
  const Transient start{initial.offset + lag, initial.rate - slope};
  Transient current = start;
  double time_s = line.start_s;
  while (loop.remaining_motion(current) > loop.options.tolerance) {
    time_s += loop.knot_interval(current, time_s);
    if (!(time_s < line.end_s)) return;
    const double elapsed_s = time_s - line.start_s;
    current = loop.after(start, elapsed_s);
    knots.add(time_s, line.from + slope * elapsed_s - lag + current.offset);
  }
}

}  // namespace

TimeSeries loop_response(const TimeSeries& input, const PositionLoop& loop,
                         const LoopOptions& options) {
  validate(input, "position loop");
  if (loop.order == PositionLoop::Order::None || input.value.cols() == 0) return input;
  const Loop validated = validated_loop(loop, options);

  const Index n = input.time_s.size(), columns = input.value.cols();
  TimeSeriesBuilder knots(columns);
  VectorXd position = input.value.row(0).transpose();
  VectorXd speed = VectorXd::Zero(columns);
  knots.add(input.time_s[0], position);
  for (Index i = 0; i < n; ++i) {
    const bool is_last = i + 1 == n;
    SeriesSegment line{input.time_s[i],
                       is_last ? std::numeric_limits<double>::infinity() : input.time_s[i + 1],
                       input.value.row(i).transpose(), VectorXd::Zero(columns)};
    if (!is_last) line.rise = (input.value.row(i + 1) - input.value.row(i)).transpose();
    if (line.length_s() == 0.0) continue;  // at a jump the axis has not moved yet
    const Transient start{position - line.from, speed};
    add_settling_knots(line, validated, start, knots);
    if (is_last) break;
    // The loop is linear, so the sum of its free decay and its response to the line is exact.
    const Transient free_response = validated.after(start, line.length_s());
    const LineResponse ramp_response = line_response(validated, line.length_s());
    position = line.from + free_response.offset + ramp_response.position * line.rise;
    speed = free_response.rate + ramp_response.rate * line.rise;
    knots.add(line.end_s, position);
  }
  return knots.series();
}

namespace {

constexpr double max_channel_cycles = 2e8;  // 55 hours at 1 ms
constexpr double max_whole_number = 1e15;   // up to here whole numbers and halves are distinct

void require_for_channel(bool holds, const std::string& requirement) {
  if (!holds) throw std::invalid_argument("a channel expects " + requirement);
}

bool is_positive(double value) { return value > 0.0 && std::isfinite(value); }
bool is_not_negative(double value) { return value >= 0.0 && std::isfinite(value); }

double rounded(double value, double increment) {
  if (increment == 0.0) return value;
  const double steps = std::round(value / increment);
  // Beyond that bound the increment is smaller than the rounding error of the value.
  return std::abs(steps) < max_whole_number ? steps * increment : value;
}

/// Returns the number of the first cycle that begins at or after `end_s`.
long cycles_until(double end_s, double start_s, double cycle_s) {
  const double cycles = std::ceil((end_s - start_s) / cycle_s);
  require_for_channel(cycles <= max_channel_cycles, "at most 2e8 cycles in a time series");
  return long(cycles);
}

/// Samples a series at the beginning of every cycle, applies `shape`, and holds the value, delayed
/// by `delay_s`.
template <typename Shape>
TimeSeries sample_and_hold(const TimeSeries& input, double cycle_s, double delay_s,
                           const Shape& shape) {
  validate(input, "channel");
  require_for_channel(is_positive(cycle_s), "a cycle above 0");
  require_for_channel(is_not_negative(delay_s), "a non-negative delay");
  const double start_s = input.time_s[0];
  const long cycles = cycles_until(input.time_s[input.time_s.size() - 1], start_s, cycle_s);
  TimeSeriesReader reader(input);
  VectorXd current = shape(input.value.row(0).transpose());
  TimeSeriesBuilder knots(current.size());
  knots.add(start_s, current);
  for (long k = 0; k <= cycles; ++k) {
    const double read_s = start_s + double(k) * cycle_s;
    const VectorXd next = shape(reader.at(read_s));
    // An unchanged value needs no knot, which keeps a long series short.
    if (next == current) continue;
    knots.add(read_s + delay_s, current);
    knots.add(read_s + delay_s, next);
    current = next;
  }
  return knots.series();
}

/// The motion of each column to its target at a limited rate.
struct Approach {
  double start_s;
  double rate;
  VectorXd from, target, arrival_s;

  VectorXd at(double time_s) const {
    const VectorXd displacement = rate * (time_s - start_s) * (target - from).cwiseSign();
    return (arrival_s.array() <= time_s).select(target, from + displacement);
  }
};

/// Limits the rate of each column of a series of steps.
TimeSeries limit_rate(const TimeSeries& steps, double rate) {
  const Index n = steps.time_s.size();
  VectorXd current = steps.value.row(0).transpose();
  TimeSeriesBuilder knots(current.size());
  knots.add(steps.time_s[0], current);
  for (Index i = 0; i < n; ++i) {
    const double start_s = steps.time_s[i];
    const double end_s = i + 1 < n ? steps.time_s[i + 1] : std::numeric_limits<double>::infinity();
    if (end_s == start_s) continue;
    Approach approach{start_s, rate, current, steps.value.row(i).transpose(), {}};
    approach.arrival_s = start_s + ((approach.target - current).cwiseAbs() / rate).array();
    std::vector<double> arrivals;
    for (Index j = 0; j < current.size(); ++j)
      if (approach.target[j] != current[j] && approach.arrival_s[j] < end_s)
        arrivals.push_back(approach.arrival_s[j]);
    std::sort(arrivals.begin(), arrivals.end());
    arrivals.erase(std::unique(arrivals.begin(), arrivals.end()), arrivals.end());
    for (const double arrival_s : arrivals) knots.add(arrival_s, approach.at(arrival_s));
    if (i + 1 == n) break;
    current = approach.at(end_s);
    knots.add(end_s, current);
  }
  return knots.series();
}

}  // namespace

TimeSeries apply_channel(const TimeSeries& correction, const OpenControl& open) {
  return sample_and_hold(correction, open.cycle_s, open.delay_s,
                         [](const VectorXd& row) { return row; });
}

TimeSeries apply_channel(const TimeSeries& correction, const OriginShift& origin,
                         std::span<const kinematics::Joint> joints) {
  require_for_channel(Index(joints.size()) == correction.value.cols(), "one joint per column");
  require_for_channel(is_not_negative(origin.increment), "a non-negative increment");
  require_for_channel(is_not_negative(origin.rate), "a non-negative rate");
  const TimeSeries steps =
      sample_and_hold(correction, origin.cycle_s, origin.delay_s, [&](VectorXd row) {
        for (Index j = 0; j < row.size(); ++j) {
          // An origin shift moves linear axes only.
          const bool is_slide = joints[std::size_t(j)].motion == kinematics::Motion::Linear;
          row[j] = is_slide ? rounded(row[j], origin.increment) : 0.0;
        }
        return row;
      });
  return origin.rate > 0.0 ? limit_rate(steps, origin.rate) : steps;
}

TimeSeries apply_channel(const TimeSeries& displacement_t, const Piezo& piezo) {
  require_for_channel(displacement_t.value.cols() == 3, "three columns for a piezo");
  require_for_channel(std::abs(piezo.direction_t.norm() - 1.0) <= 1e-9,
                      "a unit direction for the piezo");
  require_for_channel(is_positive(piezo.range), "a piezo range above 0");
  require_for_channel(is_not_negative(piezo.resolution), "a non-negative resolution");
  const TimeSeries stroke{displacement_t.time_s, displacement_t.value * piezo.direction_t};
  const double max_stroke = 0.5 * piezo.range;
  const TimeSeries set_points = sample_and_hold(stroke, piezo.cycle_s, 0.0, [&](VectorXd row) {
    // Rounded before it is limited, because the range is that of the actuator, not of its
    // set-points.
    row[0] = std::clamp(rounded(row[0], piezo.resolution), -max_stroke, max_stroke);
    return row;
  });
  return loop_response(set_points, piezo.loop);
}

double piezo_deflection(const Piezo& piezo, double force_along) {
  require_for_channel(is_positive(piezo.stiffness), "a piezo stiffness above 0");
  return force_along / piezo.stiffness;
}

}  // namespace abbe::sim::compensation
