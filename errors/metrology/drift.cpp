#include "errors/metrology/drift.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace abbe::errors::metrology {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

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
  for (Index i = 0; i < log.time_s.size(); ++i) {
    if (log.time_s[i] < interval.from_s || log.time_s[i] > interval.to_s) continue;
    const VectorXd value = log.values.row(i);
    low = low.cwiseMin(value);
    high = high.cwiseMax(value);
  }
  return {interval, high - low, end - start};
}

}  // namespace

std::vector<DriftRange> drift(const DriftLog& log, const std::vector<DriftInterval>& intervals) {
  check(log);
  std::vector<DriftRange> result;
  for (const DriftInterval& interval : intervals) result.push_back(interval_drift(log, interval));
  return result;
}

}  // namespace abbe::errors::metrology
