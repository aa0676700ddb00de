#pragma once

#include <span>
#include <string>
#include <vector>

#include "errors/metrology/machine_tests.h"
#include "errors/metrology/part.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::metrology {

/// Plausibility of readings before they are used, judged by the data stated with them: noise and
/// resolution of each channel, the plan, the nominal machine.
struct ReadingDiagnostics {
  std::vector<std::string> errors;    ///< readings that no working instrument can have produced
  std::vector<std::string> warnings;  ///< readings that are improbable
};

/// Returns errors and warnings for readings.
/// Errors: a channel that never changes although its noise would show (probability below 1e-9); a
/// length of 0 or less; readings 10 mm or 0.1 rad and more from the nominal machine, five sigmas of
/// the set-up's alignment allowed; a temperature below absolute zero.
/// Warnings: such a departure from 1 mm or 10 mrad on; a channel that never changes and may do so;
/// a sequence of at least 4 equal readings; 20 or more readings that scatter by less than a tenth
/// of their noise (by second differences); positions beyond the travel; time that runs backwards;
/// duplicate rows; a direction against the motion; a set-up that takes longer than the whole
/// measurement; set-ups or channels without a reading; temperatures outside -40 .. 150 degrees,
/// none below 45, 25 K below the median, jumps of 10 K in two minutes, or one that never changes
/// while others do.
ReadingDiagnostics diagnose(const Readings& readings);

/// Returns errors and warnings for a part, whose deviations are expected within 1 mm.
ReadingDiagnostics diagnose(const PartReadings& readings);

/// Returns warnings for position files, which state neither noise nor machine: constant deviations,
/// or deviations beyond 1 mm or 10 mrad.
ReadingDiagnostics diagnose(const std::vector<AxisTest>& tests);

/// Index of the readings of one run of one channel: file, set-up, channel of the set-up, run.
struct SeriesIndex {
  int file = 0, set_up = 0, channel = 0, run = 0;
};
/// Two series that are identical to the last digit although their noise should tell them apart.
struct RepeatedSeries {
  SeriesIndex first, again;
};
/// Returns the series that repeat an earlier one, in the same or another file: copied, or rounded
/// more coarsely than stated.
std::vector<RepeatedSeries> repeated_series(std::span<const Readings> files);
/// Returns the name of a series for messages: "X positioning, along X, run 1".
std::string series_text(const Readings& readings, const SeriesIndex& series);

/// Returns the values that the nominal machine would give at every measurement in perfect set-ups
/// (measurements), mm or rad; 0 for logged temperatures.
Eigen::VectorXd nominal_values(const Readings& readings);

/// Measurements of one channel of one set-up, in the order in which they were taken.
struct ChannelMeasurements {
  int set_up = 0;
  int channel = 0;
  std::vector<int> measurements;
};
/// Returns every channel that was read, in the order of the set-ups.
std::vector<ChannelMeasurements> channel_measurements(const Plan& plan);

}  // namespace abbe::errors::metrology
