#pragma once

#include "sim/compensation/time_series.h"
#include "tests/test.h"

/// Courses that several tests of channels need.
namespace abbe::sim::compensation::testing_courses {

struct Knot {
  double time_s;
  double value;
};

/// One column through these knots.
inline TimeSeries course(const std::vector<Knot>& knots) {
  TimeSeries result{VectorXd(Index(knots.size())), MatrixXd(Index(knots.size()), 1)};
  for (std::size_t i = 0; i < knots.size(); ++i) {
    result.time_s[Index(i)] = knots[i].time_s;
    result.value(Index(i), 0) = knots[i].value;
  }
  return result;
}

/// Value just before an instant, by looking at every knot: what a jump starts from.
inline double before(const TimeSeries& course, double time_s, Index column) {
  const Index n = course.time_s.size();
  if (time_s <= course.time_s[0]) return course.value(0, column);
  Index next = 0;
  while (next < n && course.time_s[next] < time_s) ++next;
  if (next == n) return course.value(n - 1, column);
  const double share =
      (time_s - course.time_s[next - 1]) / (course.time_s[next] - course.time_s[next - 1]);
  return (1.0 - share) * course.value(next - 1, column) + share * course.value(next, column);
}

/// Root of the mean square of `difference(time)` over [from, to], by the midpoint rule.
template <typename Difference>
double rms(const Difference& difference, double from_s, double to_s, int samples) {
  double sum = 0.0;
  for (int i = 0; i < samples; ++i) {
    const double d = difference(from_s + (to_s - from_s) * (i + 0.5) / samples);
    sum += d * d;
  }
  return std::sqrt(sum / samples);
}

}  // namespace abbe::sim::compensation::testing_courses
