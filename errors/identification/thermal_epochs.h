#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/identification/regression.h"
#include "errors/metrology/readings.h"

/// Readings of a day, split into epochs and compared with the first epoch; Yang's composite thermal
/// element.
namespace abbe::errors::identification {

/// Returns the index of the start of every set-up, from 0: the number of earlier set-ups of the
/// same name. (set-ups)
std::vector<int> start_indices(const metrology::Plan& plan);

/// Returns the readings of every start separately (starts). The plan of a start has no duration, as
/// it is not known.
std::vector<metrology::Readings> split_by_start(const metrology::Readings& readings);

/// Returns the columns of sensors among the logged ones.
/// @throws std::invalid_argument naming a sensor that was not logged
std::vector<Eigen::Index> sensor_columns(const std::vector<std::string>& sensors,
                                         const std::vector<std::string>& logged);

/// Returns the mean temperatures over each set of readings minus those over the first. (readings x
/// sensors)
/// @throws std::invalid_argument naming a sensor that was not logged
Eigen::MatrixXd temperature_rise_K(std::span<const metrology::Readings> readings,
                                   const std::vector<std::string>& sensors);

/// Readings of an instrument over a day, with the starts of their set-ups. The readings must
/// outlive the log.
struct DayLog {
  const metrology::Readings* readings = nullptr;
  std::vector<int> start_index;  ///< (set-ups) index of the start
  int start_count = 1;           ///< number of starts; 1: permanent set-up for the whole day

  double time_s(std::size_t measurement) const {
    return readings->plan.measurements[measurement].state.time_s;
  }
  int start_of(std::size_t measurement) const {
    return start_index[std::size_t(readings->plan.measurements[measurement].set_up)];
  }
};
DayLog day_log(const metrology::Readings& readings);

/// Closed interval of time in which the thermal state counts as constant.
struct Epoch {
  double from_s = 0.0;
  double to_s = 0.0;
  bool contains(double time_s) const { return time_s >= from_s && time_s <= to_s; }
};

/// Returns one epoch for each start of the instruments with several starts. If there is no such
/// instrument, returns one per instant or group of instants, at most 200.
/// @throws std::invalid_argument for fewer than 3 epochs, for starts that differ between
///         instruments, or for a start that begins before all instruments have read from the
///         previous one
std::vector<Epoch> split_into_epochs(const std::vector<DayLog>& logs);

/// Returns the readings of every instrument in an epoch as if the machine had been perfect in the
/// first: the nominal readings plus the change since the mean of the first epoch at the same
/// position, with the same direction of approach, by the same channel. Unknowns of a permanent
/// set-up cancel. Those of a repeated set-up count twice, and its zeros stay unknown.
/// @return (epochs), each (instruments)
/// @throws std::invalid_argument naming an instrument that does not read in every epoch
std::vector<std::vector<metrology::Readings>> changes_since_first(const std::vector<DayLog>& logs,
                                                                  const std::vector<Epoch>& epochs);

/// Returns the sensors that every file logged. @throws std::invalid_argument if there are none
std::vector<std::string> common_sensors(const std::vector<DayLog>& logs);

/// Returns the mean temperatures of every epoch minus those of the first. (epochs x sensors)
/// @param sensors  logged by every file
Eigen::MatrixXd temperature_rise_K(const std::vector<DayLog>& logs,
                                   const std::vector<Epoch>& epochs,
                                   const std::vector<std::string>& sensors);

/// Returns true if readings were taken at more than one position of an axis, as a slope along it
/// requires.
bool is_axis_varied(const std::vector<DayLog>& logs, int joint);

// Yang's composite element, delta(p, T) = delta_G(p) + delta_T(T) p: the cold curve of an axis plus
// a slope that depends on temperature, separated by runs along the axis at several temperatures.

/// Run along an axis.
struct CompositeRun {
  Eigen::VectorXd p;      ///< (n) mm or rad, positions
  Eigen::VectorXd delta;  ///< (n) mm or rad, deviations
  Eigen::VectorXd dT_K;   ///< (m) temperature changes since the cold state
  bool cold = false;      ///< true: run at dT = 0
};
/// Options of the separation of a composite element.
struct CompositeOptions {
  int degree = 4;  ///< of the polynomial of the cold curve
  /// Allow a constant of the slope besides the temperatures. By the definition of dT it is 0 unless
  /// the cold runs were not cold. The cold curve has its own slope in either case.
  bool slope_constant = false;
  /// Allow every later run a constant offset from the cold curve, the drift of the zero. `offset`
  /// reports it; the composite law excludes it.
  bool free_offset = true;
};
/// Outcome of a separation.
enum class CompositeStatus {
  Ok,
  NoColdRun,           ///< no run is marked as cold
  ColdRunNotCold,      ///< a cold run has a dT other than 0
  NoLaterRun,          ///< all runs are cold
  CurveNotDetermined,  ///< too few positions for the degree; `curve` has the details
  SlopeNotDetermined,  ///< the temperatures do not separate the slopes; `slope_fit` has the details
};
/// Composite element of an axis, separated into its cold curve and its thermal slope.
struct CompositeFit {
  CompositeStatus status = CompositeStatus::Ok;
  int run = -1;               ///< index of the run that causes the status; -1: none
  Eigen::VectorXd geometric;  ///< (degree + 1) delta_G = sum_k geometric[k] p^k
  Eigen::VectorXd thermal;    ///< (m) delta_T = thermal_constant + thermal . dT_K, per K
  double thermal_constant = 0.0;
  Regression curve;                      ///< of the cold runs, in powers of p / `curve_scale`
  double curve_scale = 1.0;              ///< mm or rad
  Regression slope_fit;                  ///< of the slopes on the temperatures
  std::vector<int> warm_runs;            ///< indices of the runs that are not cold
  Eigen::VectorXd slope;                 ///< (later) of each such run minus the cold curve
  Eigen::VectorXd slope_standard_error;  ///< (later) standard error
  Eigen::VectorXd offset;                ///< (later) 0 unless free_offset
  double rms = 0.0;  ///< residual of all readings about the law, offsets included
};
/// Fits the composite element: the cold polynomial to the cold runs, then a straight line to each
/// later run minus that polynomial, then a regression of its slope on the temperatures. The slope
/// of the cold curve stays in the cold curve: if slopes of whole runs are regressed with a
/// constant, as published, that constant is the cold slope and must not be added again.
/// @throws std::invalid_argument for no runs, shapes that disagree, numbers that are not finite, or
///         a degree outside 1 .. 12
/// Source: yang2012.
[[nodiscard]] CompositeFit fit_composite(const std::vector<CompositeRun>& runs,
                                         const CompositeOptions& options = {});

/// Returns delta_G(p) + delta_T(dT) p.
double value(const CompositeFit& fit, double p, const Eigen::VectorXd& dT_K);

}  // namespace abbe::errors::identification
