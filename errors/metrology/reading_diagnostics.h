#pragma once

#include <span>
#include <string>
#include <vector>

#include "errors/metrology/machine_tests.h"
#include "errors/metrology/part.h"
#include "errors/metrology/readings.h"

namespace abbe::errors::metrology {

/// Errors and warnings about readings, before they are used. They compare the readings with the
/// stated noise and resolution of each channel, the plan and the nominal machine.
struct ReadingDiagnostics {
  std::vector<std::string> errors;    ///< about readings that no working instrument can produce
  std::vector<std::string> warnings;  ///< about improbable readings
};

/// Returns errors and warnings for readings.
/// Errors: a channel that is constant in spite of its noise (probability below 1e-9); a length of 0
/// or less; readings that depart from the nominal machine by 10 mm or 0.1 rad or more, plus five
/// sigmas of the set-up's alignment; a temperature below absolute zero.
/// Warnings: a departure of 1 mm or 10 mrad or more; a channel that is constant and may be so; a
/// sequence of at least 4 equal readings; 20 or more readings that scatter by less than a tenth of
/// their noise (by second differences); positions beyond the travel; time that runs backwards;
/// repeated rows; a direction of approach against the motion; a set-up that takes longer than the
/// whole measurement; set-ups or channels without a reading; temperatures outside -40 .. 150
/// degrees, all above 45 degrees, or 25 K below the median; jumps of 10 K in two minutes; a sensor
/// that is constant while others change.
ReadingDiagnostics diagnose(const Readings& readings);

/// Returns errors and warnings for a part, whose deviations are expected within 1 mm.
ReadingDiagnostics diagnose(const PartReadings& readings);

/// Returns warnings for position files, which state neither noise nor machine, about constant
/// deviations and deviations of 1 mm or 10 mrad or more.
ReadingDiagnostics diagnose(const std::vector<AxisTest>& tests);

/// Index of a series, the readings of one channel in one run: file, set-up, channel of the set-up,
/// run.
struct SeriesIndex {
  int file = 0, set_up = 0, channel = 0, run = 0;
};
/// Two series that are identical to the last digit in spite of their noise.
struct RepeatedSeries {
  SeriesIndex first, again;
};
/// Returns the series that repeat an earlier one, in the same or another file. They were copied, or
/// rounded more coarsely than stated.
std::vector<RepeatedSeries> repeated_series(std::span<const Readings> files);
/// Returns the name of a series for messages: "X positioning, along X, run 1".
std::string series_text(const Readings& readings, const SeriesIndex& series);

/// Measurements of one channel of a set-up, in the order of the plan.
struct ChannelMeasurements {
  int set_up = 0;
  int channel = 0;
  std::vector<int> measurements;
};
/// Returns the measurements of every channel that was read, in the order of the set-ups.
std::vector<ChannelMeasurements> channel_measurements(const Plan& plan);

}  // namespace abbe::errors::metrology
