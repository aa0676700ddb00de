#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

/// A correction over time, and what a channel makes of it.
namespace abbe::sim::compensation {

/// One vector over time, linear between knots, held before the first and after the last. Two knots
/// at one instant are a jump; of more, the first and the last count.
struct TimeSeries {
  Eigen::VectorXd time_s;  ///< (n >= 1) never decreasing
  Eigen::MatrixXd value;   ///< (n x joints) mm and rad
};

/// @throws std::invalid_argument beginning with `what` unless there is a knot, a row of values for
///         each, all of it finite, and no time before the one in front of it
void validate(const TimeSeries& course, const char* what);

/// Value at an instant; at a jump what comes after it. Logarithmic in the knots.
/// @return (joints)
/// @throws std::invalid_argument for a course without knots or an instant that is no number
Eigen::VectorXd value_at(const TimeSeries& course, double time_s);

/// Reads a course at instants that never decrease: all of them together cost no more than one pass.
class TimeSeriesReader {
 public:
  /// @param course  valid, and outlives the walk
  explicit TimeSeriesReader(const TimeSeries& course) : course_(&course) {}

  /// What `value_at` says, the same bits. @param time_s  not before the instant asked for last
  double at(double time_s, Eigen::Index column);
  Eigen::VectorXd at(double time_s);

 private:
  void advance(double time_s);

  const TimeSeries* course_;
  Eigen::Index next_ = 0;  ///< first knot after the instant
};

/// The same course with few knots, chosen among its own, that keep it within a tolerance at every
/// instant, column by column (to rounding: 1e-12 of the values). First and last knot and both sides
/// of every jump larger than the tolerance stay. Greedy: a line goes on for as long as it can end
/// at the next knot. Linear in the knots.
/// @param tolerance  (joints) mm and rad, above 0
/// @throws std::invalid_argument for a course that is not valid, or a tolerance that is not above 0
TimeSeries thinned(const TimeSeries& course, const Eigen::VectorXd& tolerance);

/// Collects the knots of a course one by one.
class Knots {
 public:
  explicit Knots(Eigen::Index columns) : columns_(columns) {}

  /// @throws std::invalid_argument beyond 5e7 numbers (0.4 GB): a cycle or a bandwidth that does
  ///         not fit the length of the course
  void add(double time_s, const Eigen::Ref<const Eigen::VectorXd>& value);

  Eigen::Index size() const { return Eigen::Index(time_s_.size()); }
  TimeSeries course() const;

 private:
  Eigen::Index columns_;
  std::vector<double> time_s_;
  std::vector<double> rows_;
};

/// What a control could read while a program ran, one row an instant: temperatures `NAME_C`,
/// `current_A`, `FX_dynamometer_N` …, encoders `X_encoder_mm` …, `spindle_rpm`.
struct ControlLog {
  std::vector<std::string> names;  ///< (m) with their units
  Eigen::VectorXd time_s;          ///< (n) increasing; before 0 the thermal history
  Eigen::MatrixXd values;          ///< (n x m)
};

/// Column of that name.
/// @return (n)
/// @throws std::invalid_argument naming it and those that there are, or for a log whose values do
///         not fit its names and instants
Eigen::VectorXd column(const ControlLog& log, const std::string& name);

/// Row that a control knows at an instant: the last that was read; before the first, the first.
/// @throws std::invalid_argument for a log without rows or an instant that is no number
Eigen::Index row_at(const ControlLog& log, double time_s);

/// The same of rising instants, at least one.
Eigen::Index row_at(const Eigen::VectorXd& time_s, double instant_s);

}  // namespace abbe::sim::compensation
