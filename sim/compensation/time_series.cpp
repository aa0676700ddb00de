#include "sim/compensation/time_series.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace abbe::sim::compensation {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

// 0.4 GB
constexpr std::size_t max_numbers = 50'000'000;

/// Returns the value between two knots; `next` is the first knot after the time.
double value_before(const TimeSeries& course, Index next, double time_s, Index column) {
  const Index n = course.time_s.size();
  if (next == 0) return course.value(0, column);
  if (next == n) return course.value(n - 1, column);
  const double t0 = course.time_s[next - 1], t1 = course.time_s[next];
  const double v0 = course.value(next - 1, column), v1 = course.value(next, column);
  return v0 + (v1 - v0) * ((time_s - t0) / (t1 - t0));
}

VectorXd row_before(const TimeSeries& course, Index next, double time_s) {
  VectorXd row(course.value.cols());
  for (Index j = 0; j < row.size(); ++j) row[j] = value_before(course, next, time_s, j);
  return row;
}

/// Returns the knots that count: the first and the last of every time.
std::vector<Index> shown_knots(const VectorXd& time_s) {
  std::vector<Index> shown;
  const Index n = time_s.size();
  for (Index i = 0; i < n; ++i)
    if (i == 0 || i + 1 == n || time_s[i] != time_s[i - 1] || time_s[i] != time_s[i + 1])
      shown.push_back(i);
  return shown;
}

/// The slopes with which a line from the anchor passes every knot since within the tolerance.
struct Cone {
  VectorXd low, high;

  explicit Cone(Index columns)
      : low(VectorXd::Constant(columns, -std::numeric_limits<double>::infinity())), high(-low) {}

  bool holds(const VectorXd& rise, double run) const {
    if (run == 0.0) return true;
    const auto slope = (rise / run).array();
    return (slope >= low.array()).all() && (slope <= high.array()).all();
  }
  void narrow(const VectorXd& rise, double run, const VectorXd& tolerance) {
    if (run == 0.0) return;
    low = low.cwiseMax((rise - tolerance) / run);
    high = high.cwiseMin((rise + tolerance) / run);
  }
};

TimeSeries chosen(const TimeSeries& course, const std::vector<Index>& knots) {
  TimeSeries result;
  result.time_s = course.time_s(knots);
  result.value = course.value(knots, Eigen::all);
  return result;
}

}  // namespace

void validate(const TimeSeries& course, const char* what) {
  const auto refuse = [&](const std::string& why) {
    throw std::invalid_argument(std::string(what) + ": " + why);
  };
  const Index n = course.time_s.size();
  if (n == 0) refuse("a course needs at least one knot");
  if (course.value.rows() != n)
    refuse("a course needs a row of values for each of its " + std::to_string(n) + " knots, seen " +
           std::to_string(course.value.rows()));
  if (!course.time_s.allFinite() || !course.value.allFinite())
    refuse("the times and values of a course must be finite");
  for (Index i = 1; i < n; ++i)
    if (course.time_s[i] < course.time_s[i - 1])
      refuse("the times of a course must not decrease, knot " + std::to_string(i + 1) + " does");
}

VectorXd value_at(const TimeSeries& course, double time_s) {
  if (course.time_s.size() == 0 || course.value.rows() != course.time_s.size())
    throw std::invalid_argument("value_at: a course needs a knot, and a row of values for each");
  if (std::isnan(time_s)) throw std::invalid_argument("value_at: the instant is not a number");
  const double* first = course.time_s.data();
  const double* last = first + course.time_s.size();
  return row_before(course, std::upper_bound(first, last, time_s) - first, time_s);
}

void TimeSeriesReader::advance(double time_s) {
  while (next_ < course_->time_s.size() && course_->time_s[next_] <= time_s) ++next_;
}

double TimeSeriesReader::at(double time_s, Index column) {
  advance(time_s);
  return value_before(*course_, next_, time_s, column);
}

VectorXd TimeSeriesReader::at(double time_s) {
  advance(time_s);
  return row_before(*course_, next_, time_s);
}

TimeSeries thinned(const TimeSeries& course, const VectorXd& tolerance) {
  validate(course, "thinned");
  if (tolerance.size() != course.value.cols() || !(tolerance.array() > 0.0).all())
    throw std::invalid_argument("thinned: expected a tolerance above 0 for each column");

  const std::vector<Index> shown = shown_knots(course.time_s);
  std::vector<Index> kept = {shown.front()};
  Cone cone(course.value.cols());
  // The knots left out since the last kept one can always be spanned by a line to `previous`.
  Index previous = shown.front();
  for (std::size_t i = 1; i < shown.size(); ++i) {
    const Index k = shown[i];
    const VectorXd step = (course.value.row(k) - course.value.row(previous)).transpose();
    const bool jumps = course.time_s[k] == course.time_s[previous] &&
                       (step.cwiseAbs().array() > tolerance.array()).any();
    const auto rise_of = [&](Index knot) -> VectorXd {
      return (course.value.row(knot) - course.value.row(kept.back())).transpose();
    };
    const auto grid_run = [&](Index knot) {
      return course.time_s[knot] - course.time_s[kept.back()];
    };
    // The line ends at `previous` if it cannot be continued to this knot.
    if (jumps || !cone.holds(rise_of(k), grid_run(k))) {
      if (kept.back() != previous) kept.push_back(previous);
      if (jumps) kept.push_back(k);
      cone = Cone(course.value.cols());
    }
    if (!jumps) cone.narrow(rise_of(k), grid_run(k), tolerance);
    previous = k;
  }
  if (kept.back() != previous) kept.push_back(previous);
  return chosen(course, kept);
}

void Knots::add(double time_s, const Eigen::Ref<const VectorXd>& value) {
  if (rows_.size() + std::size_t(columns_) > max_numbers)
    throw std::invalid_argument(
        "a channel would need more than 5e7 numbers: the course is too long for its cycle or "
        "bandwidth");
  time_s_.push_back(time_s);
  rows_.insert(rows_.end(), value.data(), value.data() + columns_);
}

TimeSeries Knots::course() const {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  TimeSeries course;
  course.time_s = Eigen::Map<const VectorXd>(time_s_.data(), size());
  course.value = Eigen::Map<const RowMajor>(rows_.data(), size(), columns_);
  return course;
}

Eigen::VectorXd column(const ControlLog& log, const std::string& name) {
  const auto found = std::find(log.names.begin(), log.names.end(), name);
  if (found == log.names.end()) {
    std::string there;
    for (const std::string& other : log.names) there += (there.empty() ? "" : ", ") + other;
    throw std::invalid_argument("the control reads no \"" + name + "\", it reads " +
                                (there.empty() ? "nothing" : there));
  }
  if (log.values.cols() != Eigen::Index(log.names.size()) || log.values.rows() != log.time_s.size())
    throw std::invalid_argument("a control log needs a value for each of its names and instants");
  return log.values.col(found - log.names.begin());
}

Eigen::Index row_at(const ControlLog& log, double time_s) {
  if (log.time_s.size() == 0)
    throw std::invalid_argument("a control log without rows was asked what it knows");
  if (std::isnan(time_s)) throw std::invalid_argument("row_at: the instant is not a number");
  return row_at(log.time_s, time_s);
}

// readings are held until the next one
Eigen::Index row_at(const Eigen::VectorXd& time_s, double instant_s) {
  const double* first = time_s.data();
  const double* after = std::upper_bound(first, first + time_s.size(), instant_s);
  return after == first ? 0 : after - first - 1;
}

}  // namespace abbe::sim::compensation
