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

/// The two solutions of y'' + 2 d w y' + w^2 y = 0 from which every other follows: after a time, y
/// is (mean + d w odd) y(0) + odd y'(0), and y' is (mean - d w odd) y'(0) - w^2 odd y(0).
struct Transition {
  double mean = 1.0;
  double odd = 0.0;  // s
};

// Below critical damping an oscillation; (1 - d)(1 + d) instead of 1 - d^2 keeps its digits near d
// = 1.
Transition transition(double w, double d, double time_s) {
  if (d < 1.0) {
    const double turn = w * std::sqrt((1.0 - d) * (1.0 + d));
    const double decay = std::exp(-d * w * time_s);
    const double angle = turn * time_s;
    return {decay * std::cos(angle), decay * (angle == 0.0 ? time_s : std::sin(angle) / turn)};
  }
  const double spread = w * std::sqrt((d - 1.0) * (d + 1.0));
  // the slow rate as a quotient, since the difference of two near numbers would cancel
  const double slow = w * w / (d * w + spread);
  const double decay = std::exp(-slow * time_s);
  const double fast_over_slow = std::expm1(-2.0 * spread * time_s);
  return {decay * (1.0 + 0.5 * fast_over_slow),
          spread == 0.0 ? decay * time_s : -decay * fast_over_slow / (2.0 * spread)};
}

/// The distance of each column from its rest or steady following; it decays by itself.
struct Transient {
  VectorXd off;   // mm or rad
  VectorXd rate;  // mm/s or rad/s; unused in first order
};

/// A validated loop with its constants in SI units.
struct Loop {
  bool second;
  double w;  // rad/s
  double d;
  LoopOptions options;

  double lag_s() const { return second ? 2.0 * d / w : 1.0 / w; }

  Transient after(const Transient& start, double time_s) const {
    if (!second) return {start.off * std::exp(-w * time_s), start.rate};
    const Transition t = transition(w, d, time_s);
    const double friction = d * w * t.odd;
    return {(t.mean + friction) * start.off + t.odd * start.rate,
            (t.mean - friction) * start.rate - w * w * t.odd * start.off};
  }

  /// Returns a bound on the motion still to come: the energy of a damped oscillator never grows.
  double to_go(const Transient& now) const {
    if (!second) return now.off.cwiseAbs().maxCoeff();
    return (now.off.array().square() + (now.rate / w).array().square()).sqrt().maxCoeff();
  }

  /// Returns the time to the next added knot. After its fast part has decayed an overdamped loop
  /// creeps, so its knots may be farther apart.
  double step(const Transient& now, double time_s) const {
    double constant = 1.0 / w;
    if (second && d > 1.0) {
      const double spread = w * std::sqrt((d - 1.0) * (d + 1.0));
      const double slow = w * w / (d * w + spread);
      const VectorXd fast = (now.rate + slow * now.off) / (2.0 * spread);
      if (fast.cwiseAbs().maxCoeff() <= options.tolerance) constant = 1.0 / slow;
    }
    // at least four units in the last digit of the time, so that the time advances
    return std::max(constant / options.per_constant,
                    4.0 * std::numeric_limits<double>::epsilon() * std::abs(time_s));
  }
};

Loop checked(const PositionLoop& loop, const LoopOptions& options) {
  const auto need = [](bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(std::string("position loop: expected ") + what);
  };
  const bool second = loop.order == PositionLoop::Order::Second;
  need(loop.bandwidth > 0.0 && std::isfinite(loop.bandwidth), "a bandwidth above 0");
  need(!second || (loop.damping >= 1e-3 && loop.damping <= 100.0), "a damping from 0.001 to 100");
  need(options.per_constant > 0, "at least one knot a time constant");
  need(options.tolerance > 0.0, "a tolerance above 0");
  return {second, 2.0 * std::numbers::pi * loop.bandwidth, loop.damping, options};
}

/// Response to a line that starts at zero with the loop at rest, as a fraction of the rise of the
/// line, and its rate, after a time.
struct Ramp {
  double place;
  double rate;  // 1/s
};

Ramp ramp(const Loop& loop, double time_s) {
  const double x = loop.w * time_s, d = loop.d;
  // Below 1e-3 the closed form cancels; three terms of the series are then exact to 1e-11.
  if (!loop.second) {
    if (x < 1e-3) return {x * (1.0 / 2 - x * (1.0 / 6 - x / 24)), 0.0};
    return {1.0 + std::expm1(-x) / x, 0.0};
  }
  // near the start the closed form is the small difference of large numbers
  if (std::max(1.0, 2.0 * d) * x < 1e-3) {
    const double first = 2.0 * d * x, second = (4.0 * d * d - 1.0) * x * x;
    return {x * x * (1.0 / 6 - first / 24 + second / 120),
            loop.w * x * (1.0 / 2 - first / 6 + second / 24)};
  }
  const Transition t = transition(loop.w, d, time_s);
  const double friction = d * loop.w * t.odd, lag = loop.lag_s();
  return {1.0 + (lag * (t.mean + friction - 1.0) - t.odd) / time_s,
          (1.0 - (t.mean - friction) - lag * loop.w * loop.w * t.odd) / time_s};
}

/// A line of the time series; the last one is held for ever.
struct CourseLine {
  double start_s, end_s;
  VectorXd from, rise;

  double length_s() const { return end_s - start_s; }
};

/// Adds knots between the ends of a line until the loop follows steadily.
void follow(const CourseLine& line, const Loop& loop, const Transient& at_start, Knots& knots) {
  const VectorXd slope = line.rise / line.length_s();
  const VectorXd lag = loop.lag_s() * slope;
  const Transient start{at_start.off + lag, at_start.rate - slope};
  Transient now = start;
  double time_s = line.start_s;
  while (loop.to_go(now) > loop.options.tolerance) {
    time_s += loop.step(now, time_s);
    if (!(time_s < line.end_s)) return;
    const double since_s = time_s - line.start_s;
    now = loop.after(start, since_s);
    knots.add(time_s, line.from + slope * since_s - lag + now.off);
  }
}

}  // namespace

TimeSeries loop_response(const TimeSeries& wanted, const PositionLoop& loop,
                         const LoopOptions& options) {
  validate(wanted, "position loop");
  if (loop.order == PositionLoop::Order::None || wanted.value.cols() == 0) return wanted;
  const Loop checked_loop = checked(loop, options);

  const Index n = wanted.time_s.size(), columns = wanted.value.cols();
  Knots knots(columns);
  VectorXd position = wanted.value.row(0).transpose();
  VectorXd speed = VectorXd::Zero(columns);
  knots.add(wanted.time_s[0], position);
  for (Index i = 0; i < n; ++i) {
    const bool last = i + 1 == n;
    CourseLine line{wanted.time_s[i],
                    last ? std::numeric_limits<double>::infinity() : wanted.time_s[i + 1],
                    wanted.value.row(i).transpose(), VectorXd::Zero(columns)};
    if (!last) line.rise = (wanted.value.row(i + 1) - wanted.value.row(i)).transpose();
    if (line.length_s() == 0.0) continue;  // a jump: the axis has not moved yet
    const Transient start{position - line.from, speed};
    follow(line, checked_loop, start, knots);
    if (last) break;
    // The loop is linear: its own decay and the response to the line add up, so the end is exact.
    const Transient free = checked_loop.after(start, line.length_s());
    const Ramp share = ramp(checked_loop, line.length_s());
    position = line.from + free.off + share.place * line.rise;
    speed = free.rate + share.rate * line.rise;
    knots.add(line.end_s, position);
  }
  return knots.course();
}

namespace {

// 2e8 cycles: 55 hours at 1 ms
constexpr double longest_course = 2e8;
constexpr double largest_count = 1e15;  // below it whole numbers and halves are distinct

void require_channel(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument("a channel expects " + what);
}

bool positive(double value) { return value > 0.0 && std::isfinite(value); }
bool not_negative(double value) { return value >= 0.0 && std::isfinite(value); }

double rounded(double value, double increment) {
  if (increment == 0.0) return value;
  const double whole = std::round(value / increment);
  // beyond that the increment is below the rounding of the value
  return std::abs(whole) < largest_count ? whole * increment : value;
}

/// Returns the number of the first cycle that does not begin before `end_s`.
long cycles_until(double end_s, double start_s, double cycle_s) {
  const double cycles = std::ceil((end_s - start_s) / cycle_s);
  require_channel(cycles <= longest_course, "at most 2e8 cycles in a course");
  return long(cycles);
}

/// Returns the value at the beginning of every cycle, changed by `shaped`, held from `delay_s`
/// later on.
template <typename Shaped>
TimeSeries held(const TimeSeries& wanted, double cycle_s, double delay_s, const Shaped& shaped) {
  validate(wanted, "channel");
  require_channel(positive(cycle_s), "a cycle above 0");
  require_channel(not_negative(delay_s), "a delay that is not negative");
  const double start_s = wanted.time_s[0];
  const long cycles = cycles_until(wanted.time_s[wanted.time_s.size() - 1], start_s, cycle_s);
  TimeSeriesReader walk(wanted);
  VectorXd now = shaped(wanted.value.row(0).transpose());
  Knots knots(now.size());
  knots.add(start_s, now);
  for (long k = 0; k <= cycles; ++k) {
    const double read_s = start_s + double(k) * cycle_s;
    const VectorXd next = shaped(walk.at(read_s));
    // an unchanged value needs no knot, so a long series stays short
    if (next == now) continue;
    knots.add(read_s + delay_s, now);
    knots.add(read_s + delay_s, next);
    now = next;
  }
  return knots.course();
}

/// The motion to a target at a rate, for each column.
struct Approach {
  double start_s;
  double rate;
  VectorXd from, target, arrival_s;

  VectorXd at(double time_s) const {
    const VectorXd reached = rate * (time_s - start_s) * (target - from).cwiseSign();
    return (arrival_s.array() <= time_s).select(target, from + reached);
  }
};

/// Returns the response to steps with a limited rate, for each column.
TimeSeries ramped(const TimeSeries& steps, double rate) {
  const Index n = steps.time_s.size();
  VectorXd now = steps.value.row(0).transpose();
  Knots knots(now.size());
  knots.add(steps.time_s[0], now);
  for (Index i = 0; i < n; ++i) {
    const double start_s = steps.time_s[i];
    const double end_s = i + 1 < n ? steps.time_s[i + 1] : std::numeric_limits<double>::infinity();
    if (end_s == start_s) continue;
    Approach approach{start_s, rate, now, steps.value.row(i).transpose(), {}};
    approach.arrival_s = start_s + ((approach.target - now).cwiseAbs() / rate).array();
    std::vector<double> arrivals;
    for (Index j = 0; j < now.size(); ++j)
      if (approach.target[j] != now[j] && approach.arrival_s[j] < end_s)
        arrivals.push_back(approach.arrival_s[j]);
    std::sort(arrivals.begin(), arrivals.end());
    arrivals.erase(std::unique(arrivals.begin(), arrivals.end()), arrivals.end());
    for (const double arrival_s : arrivals) knots.add(arrival_s, approach.at(arrival_s));
    if (i + 1 == n) break;
    now = approach.at(end_s);
    knots.add(end_s, now);
  }
  return knots.course();
}

}  // namespace

TimeSeries through(const TimeSeries& wanted, const OpenControl& open) {
  return held(wanted, open.cycle_s, open.delay_s, [](const VectorXd& row) { return row; });
}

TimeSeries through(const TimeSeries& wanted, const OriginShift& origin,
                   std::span<const kinematics::Joint> joints) {
  require_channel(Index(joints.size()) == wanted.value.cols(), "a joint for each column");
  require_channel(not_negative(origin.increment), "an increment that is not negative");
  require_channel(not_negative(origin.rate), "a rate that is not negative");
  const TimeSeries steps = held(wanted, origin.cycle_s, origin.delay_s, [&](VectorXd row) {
    for (Index j = 0; j < row.size(); ++j) {
      // An origin shift moves linear axes only.
      const bool slide = joints[std::size_t(j)].motion == kinematics::Motion::Linear;
      row[j] = slide ? rounded(row[j], origin.increment) : 0.0;
    }
    return row;
  });
  return origin.rate > 0.0 ? ramped(steps, origin.rate) : steps;
}

TimeSeries through(const TimeSeries& wanted_t, const Piezo& piezo) {
  require_channel(wanted_t.value.cols() == 3, "three columns for a piezo");
  require_channel(std::abs(piezo.direction_t.norm() - 1.0) <= 1e-9,
                  "a unit direction of the piezo");
  require_channel(positive(piezo.range), "a range of the piezo above 0");
  require_channel(not_negative(piezo.resolution), "a resolution that is not negative");
  const TimeSeries along{wanted_t.time_s, wanted_t.value * piezo.direction_t};
  const double most = 0.5 * piezo.range;
  const TimeSeries set_points = held(along, piezo.cycle_s, 0.0, [&](VectorXd row) {
    // rounded before it is limited: the range is that of the actuator, not of its set-points
    row[0] = std::clamp(rounded(row[0], piezo.resolution), -most, most);
    return row;
  });
  return loop_response(set_points, piezo.loop);
}

double piezo_deflection(const Piezo& piezo, double force_along) {
  require_channel(positive(piezo.stiffness), "a stiffness of the piezo above 0");
  return force_along / piezo.stiffness;
}

}  // namespace abbe::sim::compensation
