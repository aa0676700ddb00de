#include "sim/compensation/force_belief.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>

#include "kinematics/least_squares.h"

namespace abbe::sim::compensation {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Mean of every row and those up to `length_s` before it.
VectorXd smoothed(const VectorXd& values, const VectorXd& time_s, double length_s) {
  if (!(length_s > 0.0)) return values;
  VectorXd means(values.size());
  double sum = 0.0;
  Index first = 0;
  for (Index i = 0; i < values.size(); ++i) {
    sum += values[i];
    for (; time_s[first] < time_s[i] - length_s; ++first) sum -= values[first];
    means[i] = sum / double(i - first + 1);
  }
  return means;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The first rows in which the spindle turns as fast as in the cut: the approach, in air.
std::vector<double> air_currents(const ControlLog& log, double cut_begins_s) {
  const VectorXd current = column(log, "current_A"), rpm = column(log, "spindle_rpm");
  const double speed = rpm[row_at(log, cut_begins_s)];
  std::vector<double> air;
  for (Index i = 0; i < current.size() && log.time_s[i] < cut_begins_s; ++i)
    if (log.time_s[i] >= 0.0 && std::abs(rpm[i] - speed) <= 1e-3 * std::abs(speed))
      air.push_back(current[i]);
  return air;
}

}  // namespace

errors::Load load_at(const LoadCourse& course, double time_s) {
  const VectorXd& t = course.time_s;
  const Index n = t.size();
  if (n == 0 || !(time_s >= t[0] && time_s <= t[n - 1])) return {};
  const Index after =
      std::min<Index>(n - 1, std::upper_bound(t.data(), t.data() + n, time_s) - t.data());
  const Index before = std::max<Index>(0, after - 1);
  const double length = t[after] - t[before];
  const double u = length > 0.0 ? (time_s - t[before]) / length : 1.0;
  const errors::Load &a = course.loads[std::size_t(before)], &b = course.loads[std::size_t(after)];
  errors::Load load;
  load.on_tool_t = a.on_tool_t + u * (b.on_tool_t - a.on_tool_t);
  load.contact_t = a.contact_t + u * (b.contact_t - a.contact_t);
  return load;
}

LoadCourse load_of_dynamometer(const ControlLog& log, double smoothing_s) {
  LoadCourse course{log.time_s, std::vector<errors::Load>(std::size_t(log.time_s.size()))};
  const char* const names[] = {"FX_dynamometer_N", "FY_dynamometer_N", "FZ_dynamometer_N"};
  for (Index k = 0; k < 3; ++k) {
    const VectorXd force = smoothed(column(log, names[k]), log.time_s, smoothing_s);
    for (Index i = 0; i < force.size(); ++i) course.loads[std::size_t(i)].on_tool_t[k] = force[i];
  }
  return course;
}

CurrentLaw fitted_law(const ControlLog& log, const CurrentTraining& part, double smoothing_s) {
  const Index n = part.time_s.size();
  if (n < 2 || part.deviation.size() != n)
    throw std::invalid_argument("expected a training part with a deviation at two places or more");
  CurrentLaw law;
  law.smoothing_s = smoothing_s;
  std::vector<double> air = air_currents(log, part.time_s.minCoeff());
  if (air.empty())
    throw std::invalid_argument(
        "expected the current in air before the training cut, at the speed of the cut");
  law.air_A = median(std::move(air));
  const VectorXd current = smoothed(column(log, "current_A"), log.time_s, smoothing_s);
  Eigen::MatrixX2d A(n, 2);
  for (Index i = 0; i < n; ++i) {
    const double x = current[row_at(log, part.time_s[i])] - law.air_A;
    A.row(i) << x, x * x;
    law.largest_A = std::max(law.largest_A, x);
  }
  const auto fit = least_squares(A, part.deviation);
  if (fit.rank < 2)
    throw std::invalid_argument("expected a training part cut with two depths or more");
  law.c = fit.x;
  law.sigma =
      std::sqrt((A * law.c - part.deviation).squaredNorm() / double(std::max<Index>(1, n - 2)));
  return law;
}

Course bending(const CurrentLaw& law, const ControlLog& log) {
  const VectorXd current = smoothed(column(log, "current_A"), log.time_s, law.smoothing_s);
  Course course{log.time_s, Eigen::MatrixXd(current.size(), 1)};
  for (Index i = 0; i < current.size(); ++i) {
    const double x = std::clamp(current[i] - law.air_A, 0.0, law.largest_A);
    course.value(i, 0) = law.c[0] * x + law.c[1] * x * x;
  }
  return course;
}

}  // namespace abbe::sim::compensation
