#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "errors/identification/cross_validation.h"
#include "errors/identification/sensor_choice.h"

namespace abbe::errors::identification {

struct ThermalStudyOptions {
  SensorChoiceOptions choice;
  ThermalModelOptions model;
  ThermalFeatures features;  ///< the choice counts since the start too, lags are made of the chosen
  int random_subsets = 200;  ///< as large as the choice, to compare with
  std::uint64_t seed = 1;
};

/// Percentiles of RMS on the test data over the drift range, of random choices of sensors.
struct RandomChoices {
  std::vector<double> rms_over_range;  ///< ascending; those that could be fitted
  int not_fitted = 0;
  double p05 = 0, p25 = 0, p50 = 0, p75 = 0, p95 = 0;
  double beaten = 0.0;  ///< part of them that the choice beats, in [0, 1]
};

/// One error predicted from the sensors chosen.
struct ErrorStudy {
  ThermalFit fitted;                   ///< on all training runs
  Spread in_cycle;                     ///< on the training runs
  std::optional<Validation> left_out;  ///< each training run left out; none of a single run
  Validation test;                     ///< on the test runs, which chose and fitted nothing
  double drift_range = 0.0;            ///< max - min of y in the test data
  double rms_over_range = 0.0;         ///< 0 where the range is 0
};

struct ThermalStudy {
  SensorChoice choice;              ///< indices into the inputs of the training data
  std::vector<std::string> chosen;  ///< names
  std::vector<ErrorStudy> errors;   ///< in the order given
  double rms_over_range = 0.0;  ///< the figure to judge by: of all errors, root of sums of squares
  RandomChoices random;
};

/// Chooses one set of sensors for one or several errors and fits a model of each on the training
/// data, and grades them on the test data. Where the choice or a fit has an outcome other than Ok,
/// what depends on it is left empty.
/// @param training, test  (errors) equal but for y
/// @throws std::invalid_argument as `validate`, where the inputs of the two differ, or where a run
///         stands in both
[[nodiscard]] ThermalStudy study_sensors(std::span<const ThermalData> training,
                                         std::span<const ThermalData> test,
                                         const ThermalStudyOptions& options = {});
[[nodiscard]] ThermalStudy study_sensors(const ThermalData& training, const ThermalData& test,
                                         const ThermalStudyOptions& options = {});

}  // namespace abbe::errors::identification
