#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

/// Time series of corrections, and the log of a control.
namespace abbe::sim::compensation {

/// A vector as a function of time: linear between knots, constant before the first and after the
/// last one. Two knots at the same time are a jump; of more than two the first and the last count.
struct TimeSeries {
  Eigen::VectorXd time_s;  ///< (n >= 1) not decreasing
  Eigen::MatrixXd value;   ///< (n x joints) mm and rad
};

/// Throws std::invalid_argument, with a message that begins with `what`, unless there is at least
/// one knot, every knot has a row of values, all numbers are finite and times do not decrease.
void validate(const TimeSeries& series, const char* what);

/// Returns the value at a time; at a jump, the value after it. Cost is logarithmic in the knots.
/// @return (joints)
/// @throws std::invalid_argument if the series has no knots or the time is not a number
Eigen::VectorXd value_at(const TimeSeries& series, double time_s);

/// Reads a series at times that do not decrease. All reads together take one pass over the knots.
class TimeSeriesReader {
 public:
  /// @param course  valid; must outlive the reader
  explicit TimeSeriesReader(const TimeSeries& series) : series_(&series) {}

  /// Returns the value of a column, the same bits as `value_at`.
  /// @param time_s  not before that of the previous call
  double at(double time_s, Eigen::Index column);
  Eigen::VectorXd at(double time_s);

 private:
  void advance(double time_s);

  const TimeSeries* series_;
  Eigen::Index next_ = 0;  ///< first knot after the last time
};

/// Returns a subset of the knots of a series with which every column stays within its tolerance at
/// every time (plus rounding, 1e-12 of the values). The first and the last knot and both sides of
/// every jump larger than the tolerance are kept. A greedy method extends each segment as long as
/// the tolerance allows. Cost is linear in the knots.
/// @param tolerance  (joints) mm and rad, above 0
/// @throws std::invalid_argument if the series is not valid or a tolerance is not above 0
TimeSeries thin_out(const TimeSeries& series, const Eigen::VectorXd& tolerance);

/// Builds a series knot by knot.
class TimeSeriesBuilder {
 public:
  explicit TimeSeriesBuilder(Eigen::Index columns) : columns_(columns) {}

  /// Adds a knot. Throws std::invalid_argument beyond 5e7 numbers (0.4 GB), which a cycle time or
  /// bandwidth causes that does not fit the duration of the series.
  void add(double time_s, const Eigen::Ref<const Eigen::VectorXd>& value);

  Eigen::Index size() const { return Eigen::Index(time_s_.size()); }
  /// Returns the series of the knots added so far.
  TimeSeries series() const;

 private:
  Eigen::Index columns_;
  std::vector<double> time_s_;
  std::vector<double> rows_;
};

/// Signals that a control recorded while a program ran, one row for each instant: temperatures
/// `NAME_C`, `current_A`, forces `FX_dynamometer_N` ..., encoders `X_encoder_mm` ...,
/// `spindle_rpm`.
struct ControlLog {
  std::vector<std::string> names;  ///< (m) with their units, one per column
  Eigen::VectorXd time_s;          ///< (n) increasing; negative during the thermal history
  Eigen::MatrixXd values;          ///< (n x m)
};

/// Returns the column of a name, (n).
/// @throws std::invalid_argument if the log has no such column, naming those that it has, or if the
///         size of `values` does not match names and times
Eigen::VectorXd column(const ControlLog& log, const std::string& name);

/// Returns the index of the latest row that a control has recorded at a time; 0 before the first
/// row.
/// @throws std::invalid_argument if the log has no rows or the time is not a number
Eigen::Index row_at(const ControlLog& log, double time_s);

/// Returns the same for the times of a log, which must not be empty and must ascend.
Eigen::Index row_at(const Eigen::VectorXd& time_s, double instant_s);

}  // namespace abbe::sim::compensation
