#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/identification/thermal_data.h"
#include "errors/identification/thermal_model.h"

/// Choice of key temperature sensors, by grey relational degrees (measures of the similarity of two
/// short series) or by correlation. Deng's degree compares every instant with the largest
/// difference of all series, Liu's degrees compare areas between the series and their initial
/// values.
namespace abbe::errors::identification {

/// Kinds of grey relational degrees.
enum class GreyKind {
  Deng,           ///< mean over k of (min + rho max) / (|x0(k) - xi(k)| + rho max)
  Absolute,       ///< Liu, areas of x - x(1)
  Relative,       ///< Liu, areas of x / x(1) - 1
  Comprehensive,  ///< theta absolute + (1 - theta) relative
};
/// Normalisation of a series for Deng's degree. Liu's degrees use the series unchanged.
enum class Image {
  None,      ///< unchanged
  Initial,   ///< x / x(1): depends on deg C or K, impossible if a series starts at 0
  Mean,      ///< x / mean, impossible if the mean is 0
  Interval,  ///< (x - min) / (max - min), impossible for a constant series
};
struct GreyOptions {
  GreyKind kind = GreyKind::Deng;
  Image image = Image::Initial;
  double rho = 0.5;    ///< of Deng, in (0, 1]
  double theta = 0.5;  ///< of the comprehensive degree, in [0, 1]
};
enum class GreyStatus { Ok, StartsAtZero, MeanIsZero, ConstantSeries };

/// Degrees of several series with a reference.
struct GreyDegrees {
  GreyStatus status = GreyStatus::Ok;
  int series = -1;         ///< column without image if the status is not Ok; -1: the reference
  Eigen::VectorXd degree;  ///< (m), in (0, 1]; empty unless Ok
};
/// Degrees of several series with each other.
struct MutualDegrees {
  GreyStatus status = GreyStatus::Ok;
  int series = -1;         ///< column without image if the status is not Ok
  Eigen::MatrixXd degree;  ///< (m x m), symmetric with ones on the diagonal; empty unless Ok
};

/// Returns the degree of every series with the reference. Deng's min and max are taken over all
/// series and instants; if every series equals the reference, every degree is 1.
/// @param reference  (n), n >= 2
/// @param series     (n x m), m >= 1
/// @throws std::invalid_argument for other shapes, a number that is not finite, or options out of
///         range
/// Source: Deng's relational grade as in chen2013; Liu's three degrees.
[[nodiscard]] GreyDegrees grey_degrees(const Eigen::VectorXd& reference,
                                       const Eigen::MatrixXd& series,
                                       const GreyOptions& options = {});

/// Returns the degree of every series with every other. Deng's min and max are taken over all
/// pairs, including a series with itself (so min = 0), which makes the matrix symmetric.
[[nodiscard]] MutualDegrees mutual_degrees(const Eigen::MatrixXd& series,
                                           const GreyOptions& options = {});

const char* to_string(GreyStatus status);

/// Measure of the similarity of sensors with the error and with each other.
enum class SimilarityMeasure { Grey, Correlation };
/// Selection of sensors among the leaders of the groups.
enum class Screening {
  Degree,      ///< the leaders most similar to the error (Chen)
  Regression,  ///< one leader after another, each time the one that lowers the residual most; the
               ///< residual is that of cross-validation over the runs or, for a single run, of its
               ///< fit
};
/// Options of a choice of sensors.
struct SensorChoiceOptions {
  int count = 4;  ///< number of sensors to choose
  SimilarityMeasure similarity_measure = SimilarityMeasure::Grey;
  /// With the image Interval, a sensor that falls while the error rises is inverted first.
  GreyOptions grey = {GreyKind::Deng, Image::Interval, 0.5, 0.5};
  /// Sensors of at least this mutual degree belong to one group. Empty: the threshold that gives
  /// `groups` groups, more than `count`, so that the screening has a choice.
  std::optional<double> threshold;
  int groups = 6;  ///< if the threshold is empty; at least `count` if there are so many
  Screening screening = Screening::Regression;
  /// Minimum magnitude of an error as a divisor, for degrees that divide by the initial value. The
  /// rows of an error begin where it first exceeds this value, because a drift relative to its
  /// first reading starts at zero.
  std::vector<double> min_start;   ///< (errors) unit of y; empty: 0
  std::vector<std::string> fixed;  ///< sensors to be used without a choice
};

/// Returns true if the degree divides every series by its initial value: Deng's with the initial
/// image, Liu's relative and comprehensive ones. Temperatures should then be in deg C as
/// read, since changes since the start begin at zero.
bool is_divided_by_start(const SensorChoiceOptions& options);

/// Chosen sensors, with the degrees and groups on which the choice is based.
struct SensorChoice {
  GreyStatus status = GreyStatus::Ok;
  int input = -1;                    ///< input without image if the status is not Ok; -1: the error
  std::vector<int> constant_inputs;  ///< constant inputs, which cannot be chosen
  Eigen::VectorXd degree;            ///< (m) with the error; 0 for constant inputs
  Eigen::MatrixXd mutual;            ///< (m x m); 0 for constant inputs
  double threshold = 0.0;            ///< threshold used
  std::vector<std::vector<int>> groups;  ///< by descending degree of their leaders; leader first
  std::vector<int> chosen;               ///< at most `count`, in the order of selection
  std::vector<std::optional<int>> first_row;  ///< (errors) first row of a degree that divides by
                                              ///< it; empty: the error never exceeds `min_start`
                                              ///< and is not used
};
/// Chooses one set of sensors for several errors seen at the same rows.
/// Groups: the sensor of the highest degree leads the first group, which contains all sensors whose
/// mutual degree with it reaches the threshold; further groups are formed of the remaining sensors
/// in the same manner (Yang: the best of each correlated group). The leaders are then screened down
/// to `count`. Runs are concatenated for the degrees. With several errors, a sensor's degree is its
/// highest with any of them, and a regression minimises the sum of their squares.
/// Source: yang2012 (grouping), chen2013 (ranking against the error).
/// @param errors  (n >= 1) equal except for y
/// @throws std::invalid_argument as `validate`, for options out of range, or a fixed sensor that
///         the data lack
[[nodiscard]] SensorChoice choose_sensors(std::span<const ThermalData> errors,
                                          const SensorChoiceOptions& options = {});

/// Variability of a choice under noise.
struct ChoiceSpread {
  int draws = 0;
  int last_start = 0;           ///< draws begin at rows 0 .. last_start
  Eigen::VectorXd chosen;       ///< (m) fraction of the draws that choose each input
  std::vector<int> best_rank;   ///< (m) best rank of its degree over the draws, from 1; 0: no draw
                                ///< had one
  std::vector<int> worst_rank;  ///< (m)
  double same_fraction = 0.0;   ///< fraction of the draws that choose the same set
};
/// Options of the variability of a choice.
struct ChoiceSpreadOptions {
  int draws = 50;
  int last_start = 10;              ///< last start row; at most a quarter of the rows
  Eigen::VectorXd input_noise;      ///< (m) standard deviation added to each input
  std::vector<double> error_noise;  ///< (errors) standard deviation added to each y
  std::uint64_t seed = 1;
};
/// Repeats the choice from different start rows, with noise added to the readings. The readings
/// already contain noise, so the spread is slightly overestimated. Results are the same bits for
/// any number of threads.
/// @param choice  the choice with which the repetitions are compared
/// @throws std::invalid_argument as `choose_sensors`, for noise of another size, or fewer than 1
///         draw
[[nodiscard]] ChoiceSpread choice_spread(std::span<const ThermalData> errors,
                                         const SensorChoiceOptions& options,
                                         const SensorChoice& choice,
                                         const ChoiceSpreadOptions& spread);

/// Returns indices by descending degree; among equals the lower index first.
std::vector<int> ranking(const Eigen::VectorXd& degree);

/// Returns `count` subsets, drawn independently, of `size` different indices below `set_size`;
/// each is ascending.
std::vector<std::vector<int>> random_subsets(int set_size, int size, int count, std::uint64_t seed);

/// Options of a study of sensors.
struct ThermalStudyOptions {
  SensorChoiceOptions choice;
  ThermalModelOptions model;
  ThermalFeatures features;  ///< `since_start` also applies to the choice; lags are made of the
                             ///< chosen sensors only
  int random_subsets = 200;  ///< number of random subsets of the same size, for comparison
  std::uint64_t seed = 1;
};

/// RMS on the test data over the drift range, for random choices of sensors, with percentiles.
struct RandomChoices {
  std::vector<double> rms_over_range;  ///< ascending; of those that could be fitted
  int failed_fit_count = 0;
  double p05 = 0, p25 = 0, p50 = 0, p75 = 0, p95 = 0;
  double fraction_beaten = 0.0;  ///< fraction of the random choices that are worse than the choice
};

/// Prediction of one error from the chosen sensors.
struct ErrorStudy {
  ThermalFit fitted;                   ///< on all training runs
  Spread training_residual;            ///< on the training runs
  std::optional<Validation> left_out;  ///< each training run predicted from the others; empty for a
                                       ///< single run
  Validation test;                     ///< on the test runs, which were not used for choice or fit
  double drift_range = 0.0;            ///< max - min of y in the test data
  double rms_over_range = 0.0;         ///< 0 if the range is 0
};

/// Result of a study of sensors.
struct ThermalStudy {
  SensorChoice choice;              ///< indices into the inputs of the training data
  std::vector<std::string> chosen;  ///< names of the chosen sensors
  std::vector<ErrorStudy> errors;   ///< in the order of the data
  double rms_over_range = 0.0;  ///< of all errors: root of the sum of squares of the RMS, over that
                                ///< of the ranges
  RandomChoices random;
};

/// Chooses one set of sensors for one or several errors, fits a model of each on the training data,
/// and evaluates them on the test data. If the choice or a fit has an outcome other than Ok,
/// dependent results are left empty.
/// @param training, test  (errors) equal except for y
/// @throws std::invalid_argument as `validate`, if the inputs of the two differ, or if a run is in
///         both
[[nodiscard]] ThermalStudy study_sensors(std::span<const ThermalData> training,
                                         std::span<const ThermalData> test,
                                         const ThermalStudyOptions& options = {});

}  // namespace abbe::errors::identification
