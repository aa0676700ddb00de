#pragma once

#include <span>
#include <string>
#include <vector>

#include "errors/metrology/machine_tests.h"
#include "errors/metrology/part.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::metrology {

/// Judgement of readings before anything is concluded from them, by what is stated beside them:
/// noise and resolution of each channel, the plan, the nominal machine.
struct ReadingDiagnostics {
  std::vector<std::string> errors;    ///< what no instrument that works can have read
  std::vector<std::string> warnings;  ///< what one hardly reads
};

/// Errors: a channel that never changes although its noise must show (chance below 1e-9); a length
/// of 0 or less; readings 10 mm or 0.1 rad and more from what the nominal machine would show, five
/// sigmas of the set-up's alignment allowed; a temperature below absolute zero.
/// Warnings: the same from 1 mm or 10 mrad on; a channel that never changes and may do so; a part
/// of at least 4 equal readings in a row; 20 or more readings that scatter by less than a tenth of
/// their noise (by second differences); positions beyond the travel; time that runs backwards;
/// rows that stand twice; a direction against the motion; a set-up that takes longer than the whole
/// measurement; set-ups or channels without a reading; temperatures outside -40 .. 150 degrees,
/// none below 45, 25 K below the median, jumps of 10 K in two minutes, or one that never changes
/// while others do.
ReadingDiagnostics diagnose(const Readings& readings);

/// The same of a part: its deviations are expected within 1 mm.
ReadingDiagnostics diagnose(const PartReadings& readings);

/// The same of position files, which state neither noise nor machine: deviations that are all the
/// same, or beyond 1 mm or 10 mrad.
ReadingDiagnostics diagnose(const std::vector<AxisTest>& tests);

/// The readings of one run of one channel; indices of the file, the set-up and its channel.
struct SeriesIndex {
  int file = 0, set_up = 0, channel = 0, run = 0;
};
/// Two series that are the same to the last digit although their noise must tell them apart.
struct RepeatedSeries {
  SeriesIndex first, again;
};
/// Returns the series that repeat one before them, in one file or in two: copied, or rounded more
/// coarsely than it states.
std::vector<RepeatedSeries> repeated_series(std::span<const Readings> files);
/// Returns the name of a series for messages: "X positioning, along X, run 1".
std::string series_text(const Readings& readings, const SeriesIndex& series);

/// Returns what the nominal machine would show at every measurement, in perfect set-ups.
/// (measurements) mm or rad; 0 where temperatures are logged
Eigen::VectorXd nominal_values(const Readings& readings);

/// The readings of one channel of one set-up: their measurements, in the order in which they were
/// read.
struct ChannelMeasurements {
  int set_up = 0;
  int channel = 0;
  std::vector<int> measurements;
};
/// Returns every channel that was read, in the order of the set-ups.
std::vector<ChannelMeasurements> channel_measurements(const Plan& plan);

}  // namespace abbe::errors::metrology
