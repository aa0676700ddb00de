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

inline constexpr double max_counts = 1e15;  ///< up to here doubles resolve a quarter of a count

/// Time windows of equal length, `spacing_s` apart, in which an inserted pair can begin.
struct PulseWindows {
  double begin_s = 0.0;  ///< of the first window; -inf if the axis rests there before the series
  /// End of the first window: a pair that begins later does not fit; +inf if the axis rests there
  /// after the series.
  double end_s = 0.0;
  double spacing_s = 0.0;
  double windows = 1.0;
};

/// Returns the windows in which both trains of an encoder are low and stay low for the duration of
/// a pair, in order. A line of the motion adds at most three entries, whatever the number of signal
/// periods.
/// @param motion  valid
/// @param phase   in counts, of the lower end of a range in which both trains are low
/// @throws std::invalid_argument for positions beyond 1e15 counts
std::vector<PulseWindows> pulse_windows(const TimeSeries& motion, Eigen::Index column, double count,
                                        double phase, double pulse_s);

namespace {

using Eigen::Index;

/// A line of the motion in quarters of a count. Boundary j is between quarters j - 1 and j.
struct QuarterLine {
  double t0, t1;
  double g0, g1;

  double time_of(double boundary) const { return t0 + (boundary - g0) / (g1 - g0) * (t1 - t0); }
};

bool is_low(double quarter) { return std::fmod(quarter, 4.0) == 0.0; }

/// Collects the windows in which a pair can begin. A stay is a time range in which both trains are
/// low.
class WindowCollector {
 public:
  WindowCollector(double pulse_s, bool is_low_before) : pulse_s_(pulse_s) {
    if (is_low_before) begin_stay(-infinity);
  }

  void begin_stay(double begin_s) { stay_begin_s_ = begin_s; }
  void end_stay(double end_s) {
    if (stay_begin_s_) add({*stay_begin_s_, end_s, 0.0, 1.0});
    stay_begin_s_.reset();
  }
  void add(PulseWindows windows) {
    // A pair must begin early enough to end before the trains leave their low level.
    windows.end_s -= pulse_s_;
    if (windows.windows > 0.0 && windows.end_s >= windows.begin_s) windows_.push_back(windows);
  }
  std::vector<PulseWindows> windows() && { return std::move(windows_); }

 private:
  double pulse_s_;
  std::optional<double> stay_begin_s_;
  std::vector<PulseWindows> windows_;
};

/// Adds the windows of a line that crosses at least one boundary: of the stay that ends on it, of
/// the complete stays, and of the stay that begins on it.
void add_line_windows(const QuarterLine& line, WindowCollector& collector) {
  const double from = std::floor(line.g0), to = std::floor(line.g1);
  const bool is_upward = to > from;
  const auto entry_time = [&](double quarter) {
    return line.time_of(is_upward ? quarter : quarter + 1.0);
  };
  const auto exit_time = [&](double quarter) {
    return line.time_of(is_upward ? quarter + 1.0 : quarter);
  };

  if (is_low(from)) collector.end_stay(exit_time(from));
  const double low_quarter =
      4.0 * (is_upward ? std::floor(from / 4.0) + 1.0 : std::ceil(from / 4.0) - 1.0);
  const double whole_periods =
      std::floor((is_upward ? to - 1.0 - low_quarter : low_quarter - to - 1.0) / 4.0) + 1.0;
  if (whole_periods > 0.0)
    collector.add({entry_time(low_quarter), exit_time(low_quarter),
                   entry_time(low_quarter + (is_upward ? 4.0 : -4.0)) - entry_time(low_quarter),
                   whole_periods});
  if (is_low(to)) collector.begin_stay(entry_time(to));
}

}  // namespace

std::vector<PulseWindows> pulse_windows(const TimeSeries& motion, Index column, double count,
                                        double phase, double pulse_s) {
  const auto position_in_quarters = [&](Index knot) {
    const double counts = motion.value(knot, column) / count - phase;
    if (!(std::abs(counts) <= max_counts))
      throw std::invalid_argument("an axis is more than 1e15 counts of its encoder from zero");
    return 4.0 * counts;
  };
  double g0 = position_in_quarters(0);
  WindowCollector collector(pulse_s, is_low(std::floor(g0)));
  for (Index i = 1; i < motion.time_s.size(); ++i) {
    const double g1 = position_in_quarters(i);
    if (std::floor(g0) != std::floor(g1))
      add_line_windows({motion.time_s[i - 1], motion.time_s[i], g0, g1}, collector);
    g0 = g1;
  }
  collector.end_stay(infinity);
  return std::move(collector).windows();
}

namespace {

using Eigen::VectorXd;

constexpr double max_cycles = 2e8;
constexpr std::size_t max_steps = 25'000'000;

void require_insertion(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument("pulse insertion expects " + what);
}

/// Finds windows for times that do not decrease.
class WindowFinder {
 public:
  explicit WindowFinder(std::vector<PulseWindows> windows) : windows_(std::move(windows)) {}

  /// Returns the first time from `time_s` on at which a pair can begin; infinity if there is none.
  double next_start(double time_s) {
    for (; next_ < windows_.size(); ++next_) {
      const PulseWindows& window = windows_[next_];
      if (window.end_s + (window.windows - 1.0) * window.spacing_s < time_s) continue;
      double skipped = 0.0;
      if (window.end_s < time_s)
        // Windows in the past are counted, not visited, because a fast axis has millions of them.
        skipped =
            std::min(std::ceil((time_s - window.end_s) / window.spacing_s), window.windows - 1.0);
      return std::max(time_s, window.begin_s + skipped * window.spacing_s);
    }
    return std::numeric_limits<double>::infinity();
  }

 private:
  std::vector<PulseWindows> windows_;
  std::size_t next_ = 0;
};

/// A correction of one joint that holds from a time on.
struct TimedStep {
  double time_s;
  int joint;
  double value;
};

/// Converts corrections of a joint to whole counts and back. The correction is a whole number of
/// counts plus the phase of the encoder.
struct CountRounder {
  double count;
  double phase;

  double value(double whole) const { return count * (whole + phase); }
  double nearest_whole(double correction) const {
    const double counts = correction / count;
    require_insertion(std::abs(counts) <= max_counts, "corrections of at most 1e15 counts");
    return std::round(counts - phase);
  }
};

struct TimeSpan {
  double start_s, end_s;
};

/// Appends the steps of one joint in the order of time. Returns its correction at the start.
double add_joint_steps(const TimeSeries& requested, const PulseInsertion& pulses,
                       const TimeSeries& motion, int joint, const TimeSpan& span,
                       std::vector<TimedStep>& steps) {
  const CountRounder rounder{pulses.count[joint], zero_phase(pulses.phase_seed, joint)};
  WindowFinder finder(pulse_windows(motion, joint, rounder.count, rounder.phase, pulses.pulse_s));
  TimeSeriesReader reader(requested);
  const double initial = rounder.nearest_whole(requested.value(0, joint));
  double inserted_counts = initial;
  double end_of_pair_s = -std::numeric_limits<double>::infinity();
  for (long k = 0;; ++k) {
    const double cycle_s = span.start_s + double(k) * pulses.cycle_s;
    if (cycle_s >= span.end_s) break;
    const double missing_counts =
        rounder.nearest_whole(reader.at(cycle_s, joint)) - inserted_counts;
    if (missing_counts == 0.0) continue;
    const double begin_s = finder.next_start(std::max(cycle_s, end_of_pair_s));
    // If no window begins in this cycle, the next cycle asks again.
    if (begin_s >= span.start_s + double(k + 1) * pulses.cycle_s) continue;
    inserted_counts += missing_counts > 0.0 ? 1.0 : -1.0;
    end_of_pair_s = begin_s + pulses.pulse_s;
    steps.push_back({end_of_pair_s, joint, rounder.value(inserted_counts)});
    require_insertion(steps.size() <= max_steps, "at most 2.5e7 pairs in a time series");
  }
  return rounder.value(initial);
}

void validate(const TimeSeries& requested, const PulseInsertion& pulses, const TimeSeries& motion) {
  validate(requested, "pulse insertion");
  validate(motion, "pulse insertion");
  const Index joints = requested.value.cols();
  require_insertion(motion.value.cols() == joints && pulses.count.size() == joints,
                    "one correction, position and count per joint");
  require_insertion(pulses.count.allFinite() && (pulses.count.array() >= 0.0).all(),
                    "non-negative counts");
  require_insertion(pulses.cycle_s > 0.0 && std::isfinite(pulses.cycle_s), "a cycle above 0");
  require_insertion(pulses.pulse_s > 0.0 && std::isfinite(pulses.pulse_s), "a pulse above 0");
}

/// Converts the steps of all joints, sorted by time, to a series.
TimeSeries pulse_series(const std::vector<TimedStep>& steps, VectorXd current,
                        const TimeSpan& span) {
  TimeSeriesBuilder knots(current.size());
  knots.add(span.start_s, current);
  for (std::size_t i = 0; i < steps.size();) {
    const double time_s = steps[i].time_s;
    knots.add(time_s, current);
    for (; i < steps.size() && steps[i].time_s == time_s; ++i)
      current[steps[i].joint] = steps[i].value;
    knots.add(time_s, current);
  }
  const double last_s = steps.empty() ? span.start_s : steps.back().time_s;
  if (span.end_s > last_s) knots.add(span.end_s, current);
  return knots.series();
}

}  // namespace

double zero_phase(std::uint64_t seed, int joint) {
  using namespace split_mix;
  // Two rounds of mixing make the phases of neighbouring seeds and joints independent.
  const std::uint64_t mixed_once = mixed(seed + golden * (std::uint64_t(joint) + 2));
  const std::uint64_t bits = mixed(mixed_once + golden);
  // The upper 53 bits are exactly represented by a double.
  return double(bits >> 11) * 0x1p-53 - 0.5;
}

TimeSeries apply_channel(const TimeSeries& requested, const PulseInsertion& pulses,
                         const TimeSeries& motion) {
  validate(requested, pulses, motion);
  const auto last = [](const TimeSeries& series) {
    return series.time_s[series.time_s.size() - 1];
  };
  const TimeSpan span{requested.time_s[0], std::max(last(requested), last(motion))};
  require_insertion((span.end_s - span.start_s) / pulses.cycle_s <= max_cycles,
                    "at most 2e8 cycles in a time series");
  std::vector<TimedStep> steps;
  VectorXd initial = VectorXd::Zero(requested.value.cols());
  for (Index joint = 0; joint < initial.size(); ++joint)
    if (pulses.count[joint] > 0.0)
      initial[joint] = add_joint_steps(requested, pulses, motion, int(joint), span, steps);
  std::stable_sort(steps.begin(), steps.end(),
                   [](const TimedStep& a, const TimedStep& b) { return a.time_s < b.time_s; });
  return pulse_series(steps, initial, span);
}

}  // namespace abbe::sim::compensation
