#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "kinematics/hash.h"
#include "sim/compensation/channels.h"
#include "sim/compensation/pulse_windows.h"

namespace abbe::sim::compensation {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double most_cycles = 2e8;
constexpr std::size_t most_steps = 25'000'000;

void insertion_expects(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument("pulse insertion expects " + what);
}

/// Finds openings at instants that never decrease.
class Openings {
 public:
  explicit Openings(std::vector<PulseWindows> windows) : windows_(std::move(windows)) {}

  /// First instant from one on at which a pair can begin; infinity for none.
  double from(double time_s) {
    for (; next_ < windows_.size(); ++next_) {
      const PulseWindows& group = windows_[next_];
      if (group.end_s + (group.windows - 1.0) * group.spacing_s < time_s) continue;
      double passed = 0.0;
      if (group.end_s < time_s)
        passed = std::min(std::ceil((time_s - group.end_s) / group.spacing_s), group.windows - 1.0);
      return std::max(time_s, group.begin_s + passed * group.spacing_s);
    }
    return std::numeric_limits<double>::infinity();
  }

 private:
  std::vector<PulseWindows> windows_;
  std::size_t next_ = 0;
};

/// From an instant on, the correction of one joint.
struct TimedStep {
  double time_s;
  int joint;
  double value;
};

/// One fitted joint: the correction by so many whole counts.
struct Counter {
  double count;
  double phase;

  double value(double whole) const { return count * (whole + phase); }
  double wanted(double correction) const {
    const double counts = correction / count;
    insertion_expects(std::abs(counts) <= most_counts, "corrections of at most 1e15 counts");
    return std::round(counts - phase);
  }
};

struct Duration {
  double start_s, end_s;
};

/// Appends the steps of one joint in time. @return the correction that it starts with
double pass(const Course& wanted, const Pulses& pulses, const Course& motion, int joint,
            const Duration& duration, std::vector<TimedStep>& steps) {
  const Counter counter{pulses.count[joint], zero_phase(pulses.phase_seed, joint)};
  Openings openings(pulse_windows(motion, joint, counter.count, counter.phase, pulses.pulse_s));
  CourseWalk walk(wanted);
  const double at_start = counter.wanted(wanted.value(0, joint));
  double whole = at_start;
  double busy_s = -std::numeric_limits<double>::infinity();
  for (long k = 0;; ++k) {
    const double cycle_s = duration.start_s + double(k) * pulses.cycle_s;
    if (cycle_s >= duration.end_s) break;
    const double left = counter.wanted(walk.at(cycle_s, joint)) - whole;
    if (left == 0.0) continue;
    const double begin_s = openings.from(std::max(cycle_s, busy_s));
    if (begin_s >= duration.start_s + double(k + 1) * pulses.cycle_s) continue;
    whole += left > 0.0 ? 1.0 : -1.0;
    busy_s = begin_s + pulses.pulse_s;
    steps.push_back({busy_s, joint, counter.value(whole)});
    insertion_expects(steps.size() <= most_steps, "at most 2.5e7 pairs in a course");
  }
  return counter.value(at_start);
}

void validate(const Course& wanted, const Pulses& pulses, const Course& motion) {
  validate(wanted, "pulse insertion");
  validate(motion, "pulse insertion");
  const Index joints = wanted.value.cols();
  insertion_expects(motion.value.cols() == joints && pulses.count.size() == joints,
                    "a correction, a position and a count for each joint");
  insertion_expects(pulses.count.allFinite() && (pulses.count.array() >= 0.0).all(),
                    "counts that are not negative");
  insertion_expects(pulses.cycle_s > 0.0 && std::isfinite(pulses.cycle_s), "a cycle above 0");
  insertion_expects(pulses.pulse_s > 0.0 && std::isfinite(pulses.pulse_s), "a pulse above 0");
}

/// Steps of several joints, sorted by time, as one course.
Course course_of(const std::vector<TimedStep>& steps, VectorXd now, const Duration& duration) {
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
  // two rounds, so that neighbouring seeds and joints have nothing in common
  const std::uint64_t once = mixed(seed + golden * (std::uint64_t(joint) + 2));
  const std::uint64_t bits = mixed(once + golden);
  return double(bits >> 11) * 0x1p-53 - 0.5;
}

Course through(const Course& wanted, const Pulses& pulses, const Course& motion) {
  validate(wanted, pulses, motion);
  const auto last = [](const Course& course) { return course.time_s[course.time_s.size() - 1]; };
  const Duration duration{wanted.time_s[0], std::max(last(wanted), last(motion))};
  insertion_expects((duration.end_s - duration.start_s) / pulses.cycle_s <= most_cycles,
                    "at most 2e8 cycles in a course");
  std::vector<TimedStep> steps;
  VectorXd at_start = VectorXd::Zero(wanted.value.cols());
  for (Index joint = 0; joint < at_start.size(); ++joint)
    if (pulses.count[joint] > 0.0)
      at_start[joint] = pass(wanted, pulses, motion, int(joint), duration, steps);
  std::stable_sort(steps.begin(), steps.end(),
                   [](const TimedStep& a, const TimedStep& b) { return a.time_s < b.time_s; });
  return course_of(steps, at_start, duration);
}

}  // namespace abbe::sim::compensation
