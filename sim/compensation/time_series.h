#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

/// Time series, from which corrections, channels and logs are made.
namespace abbe::sim::compensation {

/// A vector over time, linear between knots, held before the first and after the last. Two knots at
/// one time are a jump; of more, the first and the last count.
struct TimeSeries {
  Eigen::VectorXd time_s;  ///< (n >= 1) never decreasing
  Eigen::MatrixXd value;   ///< (n x joints) mm and rad
};

/// Throws std::invalid_argument beginning with `what` unless there is a knot, every knot has a row
/// of values, all numbers are finite, and no time is before the one in front of it.
void validate(const TimeSeries& course, const char* what);

/// Returns the value at a time; at a jump the value after it. Logarithmic in the knots.
/// @return (joints)
/// @throws std::invalid_argument if the series has no knots or the time is not a number
Eigen::VectorXd value_at(const TimeSeries& course, double time_s);

/// Reads a series at times that never decrease; all reads together cost no more than one pass.
class TimeSeriesReader {
 public:
  /// @param course  valid; must outlive the reader
  explicit TimeSeriesReader(const TimeSeries& course) : course_(&course) {}

  /// Returns the same as `value_at`, bit for bit.
  /// @param time_s  not before that of the last call
  double at(double time_s, Eigen::Index column);
  Eigen::VectorXd at(double time_s);

 private:
  void advance(double time_s);

  const TimeSeries* course_;
  Eigen::Index next_ = 0;  ///< first knot after the last time
};

/// Returns the series with fewer knots, a subset of its own, within a tolerance at every time,
/// column by column (to rounding: 1e-12 of the values). The first and last knot and both sides of
/// every jump larger than the tolerance are kept. Greedy: a line continues as long as it can end at
/// the next knot. Linear in the knots.
/// @param tolerance  (joints) mm and rad, above 0
/// @throws std::invalid_argument if the series is not valid or a tolerance is not above 0
TimeSeries thinned(const TimeSeries& course, const Eigen::VectorXd& tolerance);

/// Collects the knots of a series.
class Knots {
 public:
  explicit Knots(Eigen::Index columns) : columns_(columns) {}

  /// Adds a knot. Throws std::invalid_argument beyond 5e7 numbers (0.4 GB): a cycle or bandwidth
  /// that does not fit the length of the series.
  void add(double time_s, const Eigen::Ref<const Eigen::VectorXd>& value);

  Eigen::Index size() const { return Eigen::Index(time_s_.size()); }
  /// Returns the series of the knots.
  TimeSeries course() const;

 private:
  Eigen::Index columns_;
  std::vector<double> time_s_;
  std::vector<double> rows_;
};

/// Readings of a control while a program ran, one row a time: temperatures `NAME_C`, `current_A`,
/// `FX_dynamometer_N` ..., encoders `X_encoder_mm` ..., `spindle_rpm`.
struct ControlLog {
  std::vector<std::string> names;  ///< (m) with their units
  Eigen::VectorXd time_s;          ///< (n) increasing; before 0 the thermal history
  Eigen::MatrixXd values;          ///< (n x m)
};

/// Returns the column of a name.
/// @return (n)
/// @throws std::invalid_argument naming it and the columns that exist, or if the values do not fit
///     the names and times
Eigen::VectorXd column(const ControlLog& log, const std::string& name);

/// Returns the row that a control knows at a time: the last one read; before the first row, the
/// first.
/// @throws std::invalid_argument if the log has no rows or the time is not a number
Eigen::Index row_at(const ControlLog& log, double time_s);

/// Returns the same for ascending times, at least one.
Eigen::Index row_at(const Eigen::VectorXd& time_s, double instant_s);

}  // namespace abbe::sim::compensation
