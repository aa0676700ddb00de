#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/readings.h"

/// Readings of a day by the starts from which they were read, taken apart into epochs and set
/// against the first of them.
namespace abbe::errors::identification {

/// The number of the start of every set-up, from 0: how often its name came before. (set-ups)
std::vector<int> starts_of(const metrology::Plan& plan);

/// The readings of every start alone; how long one took is not known. (starts)
std::vector<metrology::Readings> by_start(const metrology::Readings& readings);

/// Columns of some sensors among those that were logged.
/// @throws std::invalid_argument naming one that was not
std::vector<Eigen::Index> sensor_columns(const std::vector<std::string>& sensors,
                                         const std::vector<std::string>& logged);

/// Mean temperatures over each of some readings less those over the first. (readings x sensors)
/// @throws std::invalid_argument naming a sensor that was not logged
Eigen::MatrixXd warmed_K(std::span<const metrology::Readings> readings,
                         const std::vector<std::string>& sensors);

/// Readings with the starts of their set-ups. They must outlive it.
struct DayLog {
  const metrology::Readings* readings = nullptr;
  std::vector<int> start;  ///< (set-ups)
  int starts = 1;          ///< 1: it stands all day

  double time_s(std::size_t look) const { return readings->plan.looks[look].state.time_s; }
  int start_of(std::size_t look) const {
    return start[std::size_t(readings->plan.looks[look].set_up)];
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
std::vector<Epoch> epochs_of(const std::vector<DayLog>& logs);

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
Eigen::MatrixXd warmed_K(const std::vector<DayLog>& logs, const std::vector<Epoch>& epochs,
                         const std::vector<std::string>& sensors);

/// Whether an axis was read at more places than one: else no slope along it means anything.
bool is_moved(const std::vector<DayLog>& logs, int joint);

}  // namespace abbe::errors::identification
