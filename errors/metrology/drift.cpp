#include "errors/metrology/drift.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <stdexcept>

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double hour_s = 3600.0;

void check(const DriftLog& log) {
  const Index n = log.time_s.size();
  if (n < 2) throw std::invalid_argument("drift: expected at least 2 samples");
  if (log.values.rows() != n || log.values.cols() != Index(log.names.size()) ||
      log.values.cols() == 0)
    throw std::invalid_argument("drift: expected one value per time and name");
  if (!log.time_s.allFinite() || !log.values.allFinite())
    throw std::invalid_argument("drift: expected finite numbers");
  for (Index i = 1; i < n; ++i)
    if (!(log.time_s[i] > log.time_s[i - 1]))
      throw std::invalid_argument("drift: expected increasing times");
}

/// Returns the values at a time, linear between samples and extrapolated beyond the ends.
VectorXd values_at(const DriftLog& log, double time_s) {
  const double* begin = log.time_s.data();
  const double* end = begin + log.time_s.size();
  const Index after =
      std::clamp<Index>(std::upper_bound(begin, end, time_s) - begin, 1, log.time_s.size() - 1);
  const double previous_s = log.time_s[after - 1];
  const double fraction = (time_s - previous_s) / (log.time_s[after] - previous_s);
  return (1.0 - fraction) * log.values.row(after - 1) + fraction * log.values.row(after);
}

/// Returns the drift over one interval.
DriftRange interval_drift(const DriftLog& log, const DriftInterval& interval) {
  const double first = log.time_s[0], last = log.time_s[log.time_s.size() - 1];
  if (!(interval.from_s < interval.to_s) || !(interval.from_s >= first) || !(interval.to_s <= last))
    throw std::invalid_argument("drift: the interval '" + interval.name +
                                "' is empty or outside the log");
  const VectorXd start = values_at(log, interval.from_s), end = values_at(log, interval.to_s);
  VectorXd low = start.cwiseMin(end), high = start.cwiseMax(end);
  VectorXd rate = VectorXd::Zero(log.values.cols());
  VectorXd previous = start;
  double previous_s = interval.from_s;
  const auto update_rate = [&](const VectorXd& value, double time_s) {
    if (!(time_s > previous_s)) return;
    rate = rate.cwiseMax((value - previous).cwiseAbs() / (time_s - previous_s));
    previous = value;
    previous_s = time_s;
  };
  for (Index i = 0; i < log.time_s.size(); ++i) {
    if (log.time_s[i] < interval.from_s || log.time_s[i] > interval.to_s) continue;
    const VectorXd value = log.values.row(i);
    low = low.cwiseMin(value);
    high = high.cwiseMax(value);
    update_rate(value, log.time_s[i]);
  }
  update_rate(end, interval.to_s);
  return {interval, high - low, end - start, rate};
}

/// Extreme of a sliding window: a monotonic queue of the indices that can still become the extreme,
/// with the current extreme first. Each index enters and leaves once, so the time is linear in the
/// length of the log.
class WindowExtreme {
 public:
  WindowExtreme(const Eigen::MatrixXd& values, Index column, double sign)
      : values_(values), column_(column), sign_(sign) {}
  void push(Index i) {
    while (!candidates_.empty() && value(candidates_.back()) <= value(i)) candidates_.pop_back();
    candidates_.push_back(i);
  }
  void remove_before(Index i) {
    while (!candidates_.empty() && candidates_.front() < i) candidates_.pop_front();
  }
  /// Returns the largest value for sign 1, the smallest for sign -1.
  double extreme() const { return sign_ * value(candidates_.front()); }
  bool empty() const { return candidates_.empty(); }

 private:
  double value(Index i) const { return sign_ * values_(i, column_); }
  const Eigen::MatrixXd& values_;
  Index column_;
  double sign_;
  std::deque<Index> candidates_;
};

/// Returns the log with an additional row at the other end of every window that begins or ends at a
/// sample. The range over a window is piecewise linear in its position, so the largest range occurs
/// for a window that begins or ends at a sample.
DriftLog with_window_ends(const DriftLog& log, double window_s) {
  const double first = log.time_s[0], last = log.time_s[log.time_s.size() - 1];
  std::vector<double> times(log.time_s.begin(), log.time_s.end());
  for (const double t : log.time_s)
    for (const double window_end : {t - window_s, t + window_s})
      if (window_end > first && window_end < last) times.push_back(window_end);
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  DriftLog refined{Eigen::Map<const VectorXd>(times.data(), Index(times.size())), log.names, {}};
  refined.values.resize(refined.time_s.size(), log.values.cols());
  for (Index i = 0; i < refined.time_s.size(); ++i)
    refined.values.row(i) = values_at(log, refined.time_s[i]).transpose();
  return refined;
}

}  // namespace

std::vector<DriftRange> drift(const DriftLog& log, const std::vector<DriftInterval>& intervals) {
  check(log);
  std::vector<DriftRange> result;
  for (const DriftInterval& interval : intervals) result.push_back(interval_drift(log, interval));
  return result;
}

VectorXd max_window_drift(const DriftLog& log, double window_s) {
  check(log);
  const double length = log.time_s[log.time_s.size() - 1] - log.time_s[0];
  if (!(window_s > 0.0) || !(window_s <= length))
    throw std::invalid_argument("drift: expected a window no longer than the log");
  const DriftLog refined = with_window_ends(log, window_s);
  // Window ends computed by addition and by subtraction agree to a few ulp only.
  const double tolerance = 1e-12 * std::max(length, refined.time_s.cwiseAbs().maxCoeff());
  VectorXd worst = VectorXd::Zero(log.values.cols());
  for (Index c = 0; c < log.values.cols(); ++c) {
    WindowExtreme high(refined.values, c, 1.0), low(refined.values, c, -1.0);
    Index window_begin = 0;
    for (Index i = 0; i < refined.time_s.size(); ++i) {
      high.push(i);
      low.push(i);
      while (refined.time_s[i] - refined.time_s[window_begin] > window_s + tolerance)
        ++window_begin;
      high.remove_before(window_begin);
      low.remove_before(window_begin);
      worst[c] = std::max(worst[c], high.extreme() - low.extreme());
    }
  }
  return worst;
}

std::vector<DriftInterval> running_intervals(const DriftLog& log, double start_s, double stop_s) {
  check(log);
  const double last = log.time_s[log.time_s.size() - 1];
  std::vector<DriftInterval> result;
  // ISO 230-3 reports the first hour separately, if the test lasts that long.
  if (stop_s - start_s >= hour_s)
    result.push_back({"first hour of running", start_s, start_s + hour_s});
  result.push_back({"running", start_s, stop_s});
  if (last > stop_s) result.push_back({"after stopping", stop_s, last});
  return result;
}

DriftLog mandrel_drift(const DriftLog& readings, const MandrelSensors& sensors) {
  check(readings);
  const double height = sensors.z_far_mm - sensors.z_near_mm;
  if (readings.values.cols() != 5 || !(std::abs(height) > 0.0) || !std::isfinite(height))
    throw std::invalid_argument("drift: expected five columns and two different heights");
  DriftLog result{readings.time_s, {"X", "Y", "Z", "A", "B"}, {}};
  result.values.resize(readings.values.rows(), 5);
  const auto& r = readings.values;
  // A positive tilt about X moves the far end to -Y, one about Y to +X.
  result.values << r.col(0), r.col(1), r.col(4), -(r.col(3) - r.col(1)) / height,
      (r.col(2) - r.col(0)) / height;
  return result;
}

}  // namespace abbe::errors::metrology
