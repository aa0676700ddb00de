#include "sim/compensation/pulse_insertion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "kinematics/hash.h"
#include "kinematics/units.h"
#include "sim/compensation/channels.h"
#include "sim/compensation/time_series.h"

namespace abbe::sim::compensation {

inline constexpr double max_counts = 1e15;  ///< up to here a quarter of a count is resolved

/// Times at which an inserted pair can begin: `windows` windows of equal length, `spacing_s` apart.
struct PulseWindows {
  double begin_s = 0.0;  ///< of the first; -inf if the axis rests there before its series
  double end_s = 0.0;    ///< of the first: a pair that begins later would not pass; +inf at rest
                         ///< after its series
  double spacing_s = 0.0;
  double windows = 1.0;
};

/// Returns the windows in which both trains of an encoder are low and stay low for the length of a
/// pair, in order. A line of the motion gives at most three entries, however many signal periods it
/// passes.
/// @param motion  valid
/// @param phase   in counts, as in `quadrature`
/// @throws std::invalid_argument for positions beyond 1e15 counts
std::vector<PulseWindows> pulse_windows(const TimeSeries& motion, Eigen::Index column, double count,
                                        double phase, double pulse_s);

namespace {

using Eigen::Index;

/// A line of the motion in quarters of a count; boundary j lies between quarters j - 1 and j.
struct QuarterLine {
  double t0, t1;
  double g0, g1;

  double time_of(double boundary) const { return t0 + (boundary - g0) / (g1 - g0) * (t1 - t0); }
};

bool is_low(double quarter) { return std::fmod(quarter, 4.0) == 0.0; }

/// Collects the stays with both trains low that are long enough for a pair.
class Stays {
 public:
  Stays(double pulse_s, bool low_before) : pulse_s_(pulse_s) {
    if (low_before) open(-infinity);
  }

  void open(double begin_s) { open_s_ = begin_s; }
  void close(double end_s) {
    if (open_s_) add({*open_s_, end_s, 0.0, 1.0});
    open_s_.reset();
  }
  void add(PulseWindows stays) {
    // a pair must begin so early that it has passed when the stay ends
    stays.end_s -= pulse_s_;
    if (stays.windows > 0.0 && stays.end_s >= stays.begin_s) windows_.push_back(stays);
  }
  std::vector<PulseWindows> windows() && { return std::move(windows_); }

 private:
  double pulse_s_;
  std::optional<double> open_s_;
  std::vector<PulseWindows> windows_;
};

/// Adds the stays of one line that crosses at least one boundary: that which ends, the whole ones
/// between, and that which begins.
void pass(const QuarterLine& line, Stays& stays) {
  const double from = std::floor(line.g0), to = std::floor(line.g1);
  const bool up = to > from;
  const auto entered = [&](double quarter) { return line.time_of(up ? quarter : quarter + 1.0); };
  const auto left = [&](double quarter) { return line.time_of(up ? quarter + 1.0 : quarter); };

  if (is_low(from)) stays.close(left(from));
  const double low = 4.0 * (up ? std::floor(from / 4.0) + 1.0 : std::ceil(from / 4.0) - 1.0);
  const double whole = std::floor((up ? to - 1.0 - low : low - to - 1.0) / 4.0) + 1.0;
  if (whole > 0.0)
    stays.add({entered(low), left(low), entered(low + (up ? 4.0 : -4.0)) - entered(low), whole});
  if (is_low(to)) stays.open(entered(to));
}

}  // namespace

std::vector<PulseWindows> pulse_windows(const TimeSeries& motion, Index column, double count,
                                        double phase, double pulse_s) {
  const auto quarters = [&](Index knot) {
    const double counts = motion.value(knot, column) / count - phase;
    if (!(std::abs(counts) <= max_counts))
      throw std::invalid_argument("an axis is more than 1e15 counts of its encoder from zero");
    return 4.0 * counts;
  };
  double g0 = quarters(0);
  Stays stays(pulse_s, is_low(std::floor(g0)));
  for (Index i = 1; i < motion.time_s.size(); ++i) {
    const double g1 = quarters(i);
    if (std::floor(g0) != std::floor(g1))
      pass({motion.time_s[i - 1], motion.time_s[i], g0, g1}, stays);
    g0 = g1;
  }
  stays.close(infinity);
  return std::move(stays).windows();
}

namespace {

using Eigen::VectorXd;

constexpr double max_cycles = 2e8;
constexpr std::size_t max_steps = 25'000'000;

void require_insertion(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument("pulse insertion expects " + what);
}

/// Finds the next window at times that never decrease.
class Openings {
 public:
  explicit Openings(std::vector<PulseWindows> windows) : windows_(std::move(windows)) {}

  /// Returns the first time from `time_s` on at which a pair can begin; infinity if there is none.
  double from(double time_s) {
    for (; next_ < windows_.size(); ++next_) {
      const PulseWindows& group = windows_[next_];
      if (group.end_s + (group.windows - 1.0) * group.spacing_s < time_s) continue;
      double passed = 0.0;
      if (group.end_s < time_s)
        // the stays passed are counted, not visited: a fast axis has millions of them
        passed = std::min(std::ceil((time_s - group.end_s) / group.spacing_s), group.windows - 1.0);
      return std::max(time_s, group.begin_s + passed * group.spacing_s);
    }
    return std::numeric_limits<double>::infinity();
  }

 private:
  std::vector<PulseWindows> windows_;
  std::size_t next_ = 0;
};

/// A correction of one joint from a time on.
struct TimedStep {
  double time_s;
  int joint;
  double value;
};

/// A fitted joint, whose correction is a whole number of counts plus its phase.
struct Counter {
  double count;
  double phase;

  double value(double whole) const { return count * (whole + phase); }
  double wanted(double correction) const {
    const double counts = correction / count;
    require_insertion(std::abs(counts) <= max_counts, "corrections of at most 1e15 counts");
    return std::round(counts - phase);
  }
};

struct Duration {
  double start_s, end_s;
};

/// Appends the steps of one joint in the order of time.
/// @return the correction at the start
double pass(const TimeSeries& wanted, const Pulses& pulses, const TimeSeries& motion, int joint,
            const Duration& duration, std::vector<TimedStep>& steps) {
  const Counter counter{pulses.count[joint], zero_phase(pulses.phase_seed, joint)};
  Openings openings(pulse_windows(motion, joint, counter.count, counter.phase, pulses.pulse_s));
  TimeSeriesReader walk(wanted);
  const double at_start = counter.wanted(wanted.value(0, joint));
  double whole = at_start;
  double busy_s = -std::numeric_limits<double>::infinity();
  for (long k = 0;; ++k) {
    const double cycle_s = duration.start_s + double(k) * pulses.cycle_s;
    if (cycle_s >= duration.end_s) break;
    const double left = counter.wanted(walk.at(cycle_s, joint)) - whole;
    if (left == 0.0) continue;
    const double begin_s = openings.from(std::max(cycle_s, busy_s));
    // no opening in this cycle: the next one asks again
    if (begin_s >= duration.start_s + double(k + 1) * pulses.cycle_s) continue;
    whole += left > 0.0 ? 1.0 : -1.0;
    busy_s = begin_s + pulses.pulse_s;
    steps.push_back({busy_s, joint, counter.value(whole)});
    require_insertion(steps.size() <= max_steps, "at most 2.5e7 pairs in a course");
  }
  return counter.value(at_start);
}

void validate(const TimeSeries& wanted, const Pulses& pulses, const TimeSeries& motion) {
  validate(wanted, "pulse insertion");
  validate(motion, "pulse insertion");
  const Index joints = wanted.value.cols();
  require_insertion(motion.value.cols() == joints && pulses.count.size() == joints,
                    "a correction, a position and a count for each joint");
  require_insertion(pulses.count.allFinite() && (pulses.count.array() >= 0.0).all(),
                    "counts that are not negative");
  require_insertion(pulses.cycle_s > 0.0 && std::isfinite(pulses.cycle_s), "a cycle above 0");
  require_insertion(pulses.pulse_s > 0.0 && std::isfinite(pulses.pulse_s), "a pulse above 0");
}

/// Returns the steps of several joints, sorted by time, as one series.
TimeSeries pulse_series(const std::vector<TimedStep>& steps, VectorXd now,
                        const Duration& duration) {
  Knots knots(now.size());
  knots.add(duration.start_s, now);
  for (std::size_t i = 0; i < steps.size();) {
    const double time_s = steps[i].time_s;
    knots.add(time_s, now);
    for (; i < steps.size() && steps[i].time_s == time_s; ++i) now[steps[i].joint] = steps[i].value;
    knots.add(time_s, now);
  }
  const double last_s = steps.empty() ? duration.start_s : steps.back().time_s;
  if (duration.end_s > last_s) knots.add(duration.end_s, now);
  return knots.course();
}

}  // namespace

double zero_phase(std::uint64_t seed, int joint) {
  using namespace split_mix;
  // two rounds, so that neighbouring seeds and joints give independent phases
  const std::uint64_t once = mixed(seed + golden * (std::uint64_t(joint) + 2));
  const std::uint64_t bits = mixed(once + golden);
  // the upper 53 bits fill a double exactly
  return double(bits >> 11) * 0x1p-53 - 0.5;
}

TimeSeries through(const TimeSeries& wanted, const Pulses& pulses, const TimeSeries& motion) {
  validate(wanted, pulses, motion);
  const auto last = [](const TimeSeries& course) {
    return course.time_s[course.time_s.size() - 1];
  };
  const Duration duration{wanted.time_s[0], std::max(last(wanted), last(motion))};
  require_insertion((duration.end_s - duration.start_s) / pulses.cycle_s <= max_cycles,
                    "at most 2e8 cycles in a course");
  std::vector<TimedStep> steps;
  VectorXd at_start = VectorXd::Zero(wanted.value.cols());
  for (Index joint = 0; joint < at_start.size(); ++joint)
    if (pulses.count[joint] > 0.0)
      at_start[joint] = pass(wanted, pulses, motion, int(joint), duration, steps);
  std::stable_sort(steps.begin(), steps.end(),
                   [](const TimedStep& a, const TimedStep& b) { return a.time_s < b.time_s; });
  return pulse_series(steps, at_start, duration);
}

namespace {

constexpr double max_periods = 1e15;  // up to here a quarter of a period is resolved
constexpr std::size_t max_edges = 100'000'000;

/// Returns the quarter of the signal period, 0..3: both low, A, both, B.
int quarter_of(const QuadratureState& state) {
  return state.a ? (state.b ? 2 : 1) : (state.b ? 3 : 0);
}

QuadratureState state_of(double quarter) {
  const int q = int(quarter - 4.0 * std::floor(quarter / 4.0));
  return {q == 1 || q == 2, q == 2 || q == 3};
}

double quarters(double position, double period, double phase) {
  return 4.0 * (position / period - phase);
}

/// Returns the edge between neighbouring quarters: the one train that differs.
Edge edge_into(double quarter, double from, double time_s) {
  const QuadratureState before = state_of(from), after = state_of(quarter);
  const bool is_a = before.a != after.a;
  return {time_s, is_a, is_a ? after.a : after.b};
}

QuadratureState after(QuadratureState state, const Edge& edge) {
  bool& train = edge.is_a ? state.a : state.b;
  if (train == edge.level)
    throw std::invalid_argument("an edge of an encoder changes nothing at " +
                                std::to_string(edge.time_s) + " s");
  train = edge.level;
  return state;
}

/// A time range in which both trains are low.
struct Stay {
  double begin_s, end_s;
};

std::vector<Stay> stays_low(const Feedback& feedback) {
  std::vector<Stay> stays;
  QuadratureState state = feedback.start;
  double begin_s = -infinity;
  for (const Edge& edge : feedback.edges) {
    if (quarter_of(state) == 0) stays.push_back({begin_s, edge.time_s});
    state = after(state, edge);
    begin_s = edge.time_s;
  }
  if (quarter_of(state) == 0) stays.push_back({begin_s, infinity});
  return stays;
}

void validate(const std::vector<Request>& requests, const InsertionBox& box) {
  if (!(box.pulse_s > 0.0) || !std::isfinite(box.pulse_s))
    throw std::invalid_argument("an insertion box expects a pulse above 0");
  for (std::size_t i = 0; i < requests.size(); ++i)
    if (!std::isfinite(requests[i].time_s) ||
        (i > 0 && requests[i].time_s <= requests[i - 1].time_s))
      throw std::invalid_argument("an insertion box expects requests at increasing times");
}

}  // namespace

QuadratureState quadrature(double position, double period, double phase) {
  return state_of(std::floor(quarters(position, period, phase)));
}

Feedback feedback(const TimeSeries& motion, double period, double phase, int column) {
  validate(motion, "encoder feedback");
  if (!(period > 0.0) || !std::isfinite(period) || !std::isfinite(phase))
    throw std::invalid_argument("encoder feedback: expected a period above 0 and a finite phase");
  if (column < 0 || column >= motion.value.cols())
    throw std::invalid_argument("encoder feedback: the motion has no such column");
  const auto at = [&](Eigen::Index knot) {
    const double g = quarters(motion.value(knot, column), period, phase);
    if (!(std::abs(g) <= 4.0 * max_periods))
      throw std::invalid_argument("encoder feedback: more than 1e15 periods from zero");
    return g;
  };
  double g0 = at(0);
  Feedback result{state_of(std::floor(g0)), {}};
  for (Eigen::Index i = 1; i < motion.time_s.size(); ++i) {
    const double g1 = at(i), t0 = motion.time_s[i - 1], t1 = motion.time_s[i];
    const double from = std::floor(g0), to = std::floor(g1), step = to > from ? 1.0 : -1.0;
    if (double(result.edges.size()) + std::abs(to - from) > double(max_edges))
      throw std::invalid_argument("encoder feedback: more than 1e8 edges");
    // every boundary between the quarters is an edge, at the time of its crossing
    for (double quarter = from; quarter != to; quarter += step) {
      const double boundary = step > 0.0 ? quarter + 1.0 : quarter;
      const double time_s = t0 + (boundary - g0) / (g1 - g0) * (t1 - t0);
      result.edges.push_back(edge_into(quarter + step, quarter, time_s));
    }
    g0 = g1;
  }
  return result;
}

std::vector<Count> counts(const Feedback& feedback, Evaluation evaluation) {
  std::vector<Count> result;
  QuadratureState state = feedback.start;
  // X4 counts from the quarter in which it starts, X1 from the period.
  long quarter = quarter_of(state);
  const long start = quarter;
  const auto count_of = [&](long quarters_now) {
    return evaluation == Evaluation::X4 ? quarters_now - start : quarters_now >> 2;
  };
  for (const Edge& edge : feedback.edges) {
    const long before = count_of(quarter);
    const int from = quarter_of(state);
    state = after(state, edge);
    // modulo 4, one quarter forwards is up, any other neighbour is down
    quarter += (quarter_of(state) - from + 4) % 4 == 1 ? 1 : -1;
    if (count_of(quarter) != before) result.push_back({edge.time_s, count_of(quarter)});
  }
  return result;
}

long count_at(const std::vector<Count>& counts, double time_s) {
  const auto next = std::upper_bound(counts.begin(), counts.end(), time_s,
                                     [](double t, const Count& c) { return t < c.time_s; });
  return next == counts.begin() ? 0 : std::prev(next)->count;
}

std::vector<Insertion> insertions(const Feedback& feedback, const std::vector<Request>& requests,
                                  const InsertionBox& box) {
  validate(requests, box);
  std::vector<Insertion> result;
  if (box.bypass) return result;
  long done = 0;
  std::size_t next = 0;  // first request after the present time
  for (const Stay& stay : stays_low(feedback)) {
    while (next < requests.size() && requests[next].time_s <= stay.begin_s) ++next;
    double time_s = stay.begin_s;
    // A request that changes nothing, or is withdrawn, is passed over within the stay.
    while (next < requests.size() && (next == 0 || requests[next - 1].pairs == done) &&
           requests[next].time_s < stay.end_s)
      time_s = requests[next++].time_s;
    const long left = next == 0 ? 0 : requests[next - 1].pairs - done;
    if (left == 0 || !(time_s + box.pulse_s <= stay.end_s)) continue;
    result.push_back({time_s, left > 0 ? 1 : -1});
    done += result.back().direction;
  }
  return result;
}

Feedback inserted(const Feedback& feedback, const std::vector<Request>& requests,
                  const InsertionBox& box) {
  Feedback result{feedback.start, {}};
  auto edge = feedback.edges.begin();
  for (const Insertion& pair : insertions(feedback, requests, box)) {
    // An edge at the very beginning of a pair is the one that made both trains low.
    while (edge != feedback.edges.end() && edge->time_s <= pair.time_s)
      result.edges.push_back(*edge++);
    const bool leads = pair.direction > 0;
    const double third_s = box.pulse_s / 3.0;
    result.edges.push_back({pair.time_s, leads, true});
    result.edges.push_back({pair.time_s + third_s, !leads, true});
    result.edges.push_back({pair.time_s + 2.0 * third_s, leads, false});
    result.edges.push_back({pair.time_s + box.pulse_s, !leads, false});
  }
  result.edges.insert(result.edges.end(), edge, feedback.edges.end());
  return result;
}

}  // namespace abbe::sim::compensation
