#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/identification/regression.h"
#include "errors/metrology/readings.h"

/// Readings of a day by the starts from which they were read, taken apart into epochs and set
/// against the first of them.
namespace abbe::errors::identification {

/// The number of the start of every set-up, from 0: how often its name came before. (set-ups)
std::vector<int> start_numbers(const metrology::Plan& plan);

/// The readings of every start alone; how long one took is not known. (starts)
std::vector<metrology::Readings> split_by_start(const metrology::Readings& readings);

/// Columns of some sensors among those that were logged.
/// @throws std::invalid_argument naming one that was not
std::vector<Eigen::Index> sensor_columns(const std::vector<std::string>& sensors,
                                         const std::vector<std::string>& logged);

/// Mean temperatures over each of some readings less those over the first. (readings x sensors)
/// @throws std::invalid_argument naming a sensor that was not logged
Eigen::MatrixXd temperature_rise_K(std::span<const metrology::Readings> readings,
                                   const std::vector<std::string>& sensors);

/// Readings with the starts of their set-ups. They must outlive it.
struct DayLog {
  const metrology::Readings* readings = nullptr;
  std::vector<int> start;  ///< (set-ups)
  int starts = 1;          ///< 1: it stands all day

  double time_s(std::size_t measurement) const {
    return readings->plan.measurements[measurement].state.time_s;
  }
  int start_of(std::size_t measurement) const {
    return start[std::size_t(readings->plan.measurements[measurement].set_up)];
  }
};
DayLog day_log(const metrology::Readings& readings);

/// From the first to the last of some instants.
struct Epoch {
  double from_s = 0.0;
  double to_s = 0.0;
  bool holds(double time_s) const { return time_s >= from_s && time_s <= to_s; }
};

/// One for each start of the instruments that read from several; where there is none, one an
/// instant, or a few of them: at most 200.
/// @throws std::invalid_argument in a sentence for fewer than 3, starts that differ between
///         instruments or begin before all have read from the one before
std::vector<Epoch> split_into_epochs(const std::vector<DayLog>& logs);

/// What every instrument would have read in an epoch if the machine had been perfect in the first:
/// the nominal readings and what has changed since the mean of the first epoch at the same place,
/// approached the same way, by the same channel. What an instrument that stands all day does not
/// know of its set-up drops out; what was laid twice errs twice, and its zeros are unknown.
/// @return (epochs), each (instruments)
/// @throws std::invalid_argument naming an instrument that does not read in every epoch
std::vector<std::vector<metrology::Readings>> changes_of(const std::vector<DayLog>& logs,
                                                         const std::vector<Epoch>& epochs);

/// Sensors that every file logged. @throws std::invalid_argument if there are none
std::vector<std::string> common_sensors(const std::vector<DayLog>& logs);

/// Mean temperatures of every epoch less those of the first. (epochs x sensors)
/// @param sensors  that every file logged
Eigen::MatrixXd temperature_rise_K(const std::vector<DayLog>& logs,
                                   const std::vector<Epoch>& epochs,
                                   const std::vector<std::string>& sensors);

/// Whether an axis was read at more places than one: else no slope along it means anything.
bool is_moved(const std::vector<DayLog>& logs, int joint);

// Yang's composite element, delta(p, T) = delta_G(p) + delta_T(T) p: the cold curve of an axis and
// a slope that grows with temperature, separated by runs along the axis at several
// temperatures.

/// One run along the axis.
struct CompositeRun {
  Eigen::VectorXd p;      ///< (n) mm or rad, positions
  Eigen::VectorXd delta;  ///< (n) mm or rad, deviations
  Eigen::VectorXd dT_K;   ///< (m) temperature changes since the cold state
  bool cold = false;      ///< the run, or one of those, at which dT is zero
};
struct CompositeOptions {
  int degree = 4;  ///< of the cold polynomial
  /// Let the slope have a constant besides the temperatures. It is 0 by the definition of dT unless
  /// the cold runs were not cold; the cold curve keeps its own slope either way.
  bool slope_constant = false;
  /// Let every later run lie higher or lower than the cold curve as a whole: a drift of the zero,
  /// which `offset` reports and the composite law leaves out.
  bool free_offset = true;
};
enum class CompositeStatus {
  Ok,
  NoColdRun,    ///< none says that its dT is zero
  ColdRunWarm,  ///< a run that is said to be cold has a dT other than 0
  NoLaterRun,
  CurveNotDetermined,  ///< too few positions for the degree: see `curve`
  SlopeNotDetermined,  ///< the temperatures do not part: see `slope_fit`
};
struct CompositeFit {
  CompositeStatus status = CompositeStatus::Ok;
  int run = -1;               ///< the one to blame, where there is one
  Eigen::VectorXd geometric;  ///< (degree + 1) delta_G = sum_k geometric[k] p^k
  Eigen::VectorXd thermal;    ///< (m) delta_T = thermal_constant + thermal . dT_K, per K
  double thermal_constant = 0.0;
  Regression curve;  ///< of the cold runs, in powers of p / `curve_scale`
  double curve_scale = 1.0;
  Regression slope_fit;         ///< of the slopes on the temperatures
  std::vector<int> later;       ///< indices of the runs that are not cold
  Eigen::VectorXd slope;        ///< (later) of each such run minus the cold curve
  Eigen::VectorXd slope_error;  ///< (later) standard error
  Eigen::VectorXd offset;       ///< (later) 0 unless free_offset
  double rms = 0.0;             ///< of all readings about the law, offsets included
};
/// The cold polynomial comes from the cold runs, then a straight line through each later run minus
/// that polynomial, then its slope is regressed on the temperatures. The slope of the cold curve
/// stays in the cold curve: where slopes of whole runs are regressed with a constant, as published,
/// that constant is the cold slope and must not be added to it again.
/// @throws std::invalid_argument for no runs, shapes that disagree, numbers that are not finite, a
///         degree outside 1 .. 12
/// Source: yang2012.
[[nodiscard]] CompositeFit fit_composite(const std::vector<CompositeRun>& runs,
                                         const CompositeOptions& options = {});

/// delta_G(p) + delta_T(dT) p
double value(const CompositeFit& fit, double p, const Eigen::VectorXd& dT_K);

/// Least-squares slope of a whole run, its geometric part included: what the paper regresses.
double run_slope(const CompositeRun& run);

}  // namespace abbe::errors::identification
