#include "sim/compensation/pulse_windows.h"

#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "kinematics/numbers.h"

namespace abbe::sim::compensation {
namespace {

using Eigen::Index;

/// One line of the motion in quarters of a count; boundary j lies between quarters j - 1 and j.
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
    stays.end_s -= pulse_s_;
    if (stays.windows > 0.0 && stays.end_s >= stays.begin_s) windows_.push_back(stays);
  }
  std::vector<PulseWindows> windows() && { return std::move(windows_); }

 private:
  double pulse_s_;
  std::optional<double> open_s_;
  std::vector<PulseWindows> windows_;
};

/// Passes one line that crosses at least one boundary.
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

std::vector<PulseWindows> pulse_windows(const Course& motion, Index column, double count,
                                        double phase, double pulse_s) {
  const auto quarters = [&](Index knot) {
    const double counts = motion.value(knot, column) / count - phase;
    if (!(std::abs(counts) <= most_counts))
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

}  // namespace abbe::sim::compensation
