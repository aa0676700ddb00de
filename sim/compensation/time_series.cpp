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

constexpr std::size_t max_numbers = 50'000'000;  // 0.4 GB

/// Returns the value between two knots; `next` is the first knot after the time.
double interpolate(const TimeSeries& series, Index next, double time_s, Index column) {
  const Index n = series.time_s.size();
  if (next == 0) return series.value(0, column);
  if (next == n) return series.value(n - 1, column);
  const double t0 = series.time_s[next - 1], t1 = series.time_s[next];
  const double v0 = series.value(next - 1, column), v1 = series.value(next, column);
  return v0 + (v1 - v0) * ((time_s - t0) / (t1 - t0));
}

VectorXd interpolate_row(const TimeSeries& series, Index next, double time_s) {
  VectorXd row(series.value.cols());
  for (Index j = 0; j < row.size(); ++j) row[j] = interpolate(series, next, time_s, j);
  return row;
}

/// Returns the indices of the first and the last knot at every time.
std::vector<Index> distinct_knot_indices(const VectorXd& time_s) {
  std::vector<Index> distinct_knots;
  const Index n = time_s.size();
  for (Index i = 0; i < n; ++i)
    if (i == 0 || i + 1 == n || time_s[i] != time_s[i - 1] || time_s[i] != time_s[i + 1])
      distinct_knots.push_back(i);
  return distinct_knots;
}

/// The slopes with which a line from the last kept knot passes every later knot within the
/// tolerance.
struct SlopeRange {
  VectorXd low, high;

  explicit SlopeRange(Index columns)
      : low(VectorXd::Constant(columns, -std::numeric_limits<double>::infinity())), high(-low) {}

  bool contains(const VectorXd& rise, double run) const {
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

TimeSeries select_knots(const TimeSeries& series, const std::vector<Index>& knots) {
  TimeSeries result;
  result.time_s = series.time_s(knots);
  result.value = series.value(knots, Eigen::all);
  return result;
}

}  // namespace

void validate(const TimeSeries& series, const char* what) {
  const auto throw_input_error = [&](const std::string& why) {
    throw std::invalid_argument(std::string(what) + ": " + why);
  };
  const Index n = series.time_s.size();
  if (n == 0) throw_input_error("a time series needs at least one knot");
  if (series.value.rows() != n)
    throw_input_error("a time series needs one row of values for each of its " + std::to_string(n) +
                      " knots, seen " + std::to_string(series.value.rows()));
  if (!series.time_s.allFinite() || !series.value.allFinite())
    throw_input_error("the times and values of a time series must be finite");
  for (Index i = 1; i < n; ++i)
    if (series.time_s[i] < series.time_s[i - 1])
      throw_input_error("the times of a time series must not decrease, knot " +
                        std::to_string(i + 1) + " does");
}

VectorXd value_at(const TimeSeries& series, double time_s) {
  if (series.time_s.size() == 0 || series.value.rows() != series.time_s.size())
    throw std::invalid_argument(
        "value_at: a time series needs at least one knot and one row of values per knot");
  if (std::isnan(time_s)) throw std::invalid_argument("value_at: the instant is not a number");
  const double* first = series.time_s.data();
  const double* last = first + series.time_s.size();
  return interpolate_row(series, std::upper_bound(first, last, time_s) - first, time_s);
}

void TimeSeriesReader::advance(double time_s) {
  while (next_ < series_->time_s.size() && series_->time_s[next_] <= time_s) ++next_;
}

double TimeSeriesReader::at(double time_s, Index column) {
  advance(time_s);
  return interpolate(*series_, next_, time_s, column);
}

VectorXd TimeSeriesReader::at(double time_s) {
  advance(time_s);
  return interpolate_row(*series_, next_, time_s);
}

TimeSeries thin_out(const TimeSeries& series, const VectorXd& tolerance) {
  validate(series, "thinned");
  if (tolerance.size() != series.value.cols() || !(tolerance.array() > 0.0).all())
    throw std::invalid_argument("thinned: expected a tolerance above 0 for each column");

  const std::vector<Index> distinct_knots = distinct_knot_indices(series.time_s);
  std::vector<Index> kept_knots = {distinct_knots.front()};
  SlopeRange slopes(series.value.cols());
  // A line from the last kept knot to `previous` always passes the knots between them within the
  // tolerance.
  Index previous = distinct_knots.front();
  for (std::size_t i = 1; i < distinct_knots.size(); ++i) {
    const Index k = distinct_knots[i];
    const VectorXd jump = (series.value.row(k) - series.value.row(previous)).transpose();
    const bool is_jump = series.time_s[k] == series.time_s[previous] &&
                         (jump.cwiseAbs().array() > tolerance.array()).any();
    const auto rise_to = [&](Index knot) -> VectorXd {
      return (series.value.row(knot) - series.value.row(kept_knots.back())).transpose();
    };
    const auto run_to = [&](Index knot) {
      return series.time_s[knot] - series.time_s[kept_knots.back()];
    };
    // The line must end at `previous` if it cannot be continued to this knot.
    if (is_jump || !slopes.contains(rise_to(k), run_to(k))) {
      if (kept_knots.back() != previous) kept_knots.push_back(previous);
      if (is_jump) kept_knots.push_back(k);
      slopes = SlopeRange(series.value.cols());
    }
    if (!is_jump) slopes.narrow(rise_to(k), run_to(k), tolerance);
    previous = k;
  }
  if (kept_knots.back() != previous) kept_knots.push_back(previous);
  return select_knots(series, kept_knots);
}

void TimeSeriesBuilder::add(double time_s, const Eigen::Ref<const VectorXd>& value) {
  if (rows_.size() + std::size_t(columns_) > max_numbers)
    throw std::invalid_argument(
        "a channel would need more than 5e7 numbers: the time series is too long for its cycle or "
        "bandwidth");
  time_s_.push_back(time_s);
  rows_.insert(rows_.end(), value.data(), value.data() + columns_);
}

TimeSeries TimeSeriesBuilder::series() const {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  TimeSeries series;
  series.time_s = Eigen::Map<const VectorXd>(time_s_.data(), size());
  series.value = Eigen::Map<const RowMajor>(rows_.data(), size(), columns_);
  return series;
}

Eigen::VectorXd column(const ControlLog& log, const std::string& name) {
  const auto position = std::find(log.names.begin(), log.names.end(), name);
  if (position == log.names.end()) {
    std::string names;
    for (const std::string& other : log.names) names += (names.empty() ? "" : ", ") + other;
    throw std::invalid_argument("the control has no reading \"" + name +
                                "\"; available: " + (names.empty() ? "nothing" : names));
  }
  if (log.values.cols() != Eigen::Index(log.names.size()) || log.values.rows() != log.time_s.size())
    throw std::invalid_argument("a control log needs one value per name and instant");
  return log.values.col(position - log.names.begin());
}

Eigen::Index row_at(const ControlLog& log, double time_s) {
  if (log.time_s.size() == 0)
    throw std::invalid_argument("a control log without rows cannot be evaluated");
  if (std::isnan(time_s)) throw std::invalid_argument("row_at: the instant is not a number");
  return row_at(log.time_s, time_s);
}

// A reading holds until the next one.
Eigen::Index row_at(const Eigen::VectorXd& time_s, double instant_s) {
  const double* first = time_s.data();
  const double* after = std::upper_bound(first, first + time_s.size(), instant_s);
  return after == first ? 0 : after - first - 1;
}

}  // namespace abbe::sim::compensation
