#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "errors/identification/thermal_data.h"
#include "errors/identification/thermal_model.h"

/// Grey relational degrees: how alike two short series run. Deng's grades every instant against the
/// worst of all series, Liu's compare the areas that the series leave from their start.
namespace abbe::errors::identification {

enum class GreyKind {
  Deng,           ///< mean over k of (min + rho max) / (|x0(k) - xi(k)| + rho max)
  Absolute,       ///< Liu, areas of x - x(1)
  Relative,       ///< Liu, the same of x / x(1)
  Comprehensive,  ///< theta absolute + (1 - theta) relative
};
/// What Deng's degree makes of a series first. Liu's degrees take the series as they are.
enum class Image {
  None,      ///< as it is
  Initial,   ///< x / x(1): depends on deg C or K, impossible where a series starts at 0
  Mean,      ///< x / mean, impossible where the mean is 0
  Interval,  ///< (x - min) / (max - min), impossible for a series that stands still
};
struct GreyOptions {
  GreyKind kind = GreyKind::Deng;
  Image image = Image::Initial;
  double rho = 0.5;    ///< of Deng, in (0, 1]
  double theta = 0.5;  ///< of the comprehensive degree, in [0, 1]
};
enum class GreyStatus { Ok, StartsAtZero, MeanIsZero, StandsStill };

struct GreyDegrees {
  GreyStatus status = GreyStatus::Ok;
  int series = -1;  ///< column that has no image, where the status is not Ok; -1: the reference
  Eigen::VectorXd degree;  ///< (m), in (0, 1]; empty unless Ok
};
struct MutualDegrees {
  GreyStatus status = GreyStatus::Ok;
  int series = -1;
  Eigen::MatrixXd degree;  ///< (m x m), symmetric with ones on the diagonal; empty unless Ok
};

/// Degree of every series with the reference. Deng's min and max run over all series and instants;
/// where every series equals the reference, every degree is 1.
/// @param reference  (n), n >= 2
/// @param series     (n x m), m >= 1
/// @throws std::invalid_argument for other shapes, a number that is not finite, options out of
/// range Source: Deng's relational grade as in chen2013; Liu's three degrees.
[[nodiscard]] GreyDegrees grey_degrees(const Eigen::VectorXd& reference,
                                       const Eigen::MatrixXd& series,
                                       const GreyOptions& options = {});

/// Degree of every series with every other. Deng's min and max run over all pairs, a series with
/// itself among them (so min = 0), which makes the matrix symmetric.
[[nodiscard]] MutualDegrees mutual_degrees(const Eigen::MatrixXd& series,
                                           const GreyOptions& options = {});

const char* to_string(GreyStatus status);

// Key temperature points: of many sensors the few that matter, no two of which say the same.

enum class SimilarityMeasure { Grey, Correlation };
enum class Screening {
  Degree,      ///< the leaders that resemble the error most (Chen)
  Regression,  ///< one leader after another, each time the one that lowers the residual most: with
               ///< each run left out, or, of a single run, in that run
};
struct SensorChoiceOptions {
  int count = 4;  ///< sensors wanted
  SimilarityMeasure similarity_measure = SimilarityMeasure::Grey;
  /// A sensor that falls while the error rises is turned over first where the image is Interval.
  GreyOptions grey = {GreyKind::Deng, Image::Interval, 0.5, 0.5};
  /// Sensors this alike or more stand in one group. Unset: the threshold at which most groups are
  /// `groups`, so that there is something left to screen.
  std::optional<double> threshold;
  int groups = 6;  ///< where the threshold is unset; never fewer than `count` if there are so many
  Screening screening = Screening::Regression;
  /// Where a degree divides by a first value, its rows begin where the error is first farther from
  /// zero than this, for each error: a drift that counts from its first reading starts at zero.
  std::vector<double> min_start;   ///< (errors) unit of y; empty: 0
  std::vector<std::string> fixed;  ///< sensors that are taken as they are, nothing is chosen
};

/// Whether the degree divides every series by its first value: Deng's by the initial image, Liu's
/// relative and comprehensive ones. Its temperatures are best in deg C as read, since a change
/// since the start is zero there.
bool is_divided_by_start(const SensorChoiceOptions& options);

struct SensorChoice {
  GreyStatus status = GreyStatus::Ok;
  int input = -1;          ///< that has no image, where the status is not Ok; -1: the error
  std::vector<int> still;  ///< inputs that never move: left out of everything
  Eigen::VectorXd degree;  ///< (m) with the error; 0 for those
  Eigen::MatrixXd mutual;  ///< (m x m); 0 for those
  double threshold = 0.0;  ///< that was used
  std::vector<std::vector<int>> groups;  ///< by falling degree of their leaders; leader first
  std::vector<int> chosen;               ///< at most `count`, in the order in which they were taken
  std::vector<std::optional<int>> first_row;  ///< (errors) where a degree that divides by it began;
                                              ///< none: the error never leaves `min_start` and
                                              ///< takes no part
};
/// Groups: the sensor of the highest degree leads, those whose mutual degree with it reaches the
/// threshold follow; then the same among those left (Yang: the best of each correlated group). Then
/// the leaders are screened down to `count`. Runs are strung together for the degrees.
/// @throws std::invalid_argument as `validate`, for options out of range, a fixed sensor that the
/// data
///         lack
/// Source: yang2012 (grouping), chen2013 (ranking against the error).
/// Of several errors seen at the same rows, one set of sensors is chosen for all: a sensor's degree
/// is its highest with any of them, and a regression leaves the sum of their squares.
/// @param errors  (n >= 1) equal but for y
[[nodiscard]] SensorChoice choose_sensors(std::span<const ThermalData> errors,
                                          const SensorChoiceOptions& options = {});
[[nodiscard]] SensorChoice choose_sensors(const ThermalData& error,
                                          const SensorChoiceOptions& options = {});

/// How far a choice is one of chance.
struct ChoiceSpread {
  int draws = 0;
  int last_start = 0;           ///< draws begin at rows 0 .. that
  Eigen::VectorXd chosen;       ///< (m) fraction of the draws that choose each input
  std::vector<int> best_rank;   ///< (m) of its degree over the draws, from 1; 0: none had one
  std::vector<int> worst_rank;  ///< (m)
  double same = 0.0;            ///< fraction of the draws that choose the same set
};
struct ChoiceSpreadOptions {
  int draws = 50;
  int last_start = 10;              ///< at most a quarter of the rows
  Eigen::VectorXd input_noise;      ///< (m) standard deviation that is added to each input
  std::vector<double> error_noise;  ///< (errors) that is added to each y
  std::uint64_t seed = 1;
};
/// Chooses again and again: from the rows behind a start row, with noise added once more to what
/// was read, so that the spread is a little wide. The same bits for any number of threads.
/// @param choice  that it is compared with
/// @throws std::invalid_argument as `choose_sensors`, for noise of another size, fewer than 1 draw
[[nodiscard]] ChoiceSpread choice_spread(std::span<const ThermalData> errors,
                                         const SensorChoiceOptions& options,
                                         const SensorChoice& choice,
                                         const ChoiceSpreadOptions& spread);

/// Absolute correlation of the error with every input, and of every input with every other; 0 where
/// one stands still.
Eigen::VectorXd correlations(const ThermalData& data);
Eigen::MatrixXd mutual_correlations(const ThermalData& data);

/// Indices by falling degree; of equals the lower index first.
std::vector<int> ranking(const Eigen::VectorXd& degree);

/// Random choices of `size` different numbers below `below`, ascending, each drawn afresh.
std::vector<std::vector<int>> random_subsets(int below, int size, int how_many, std::uint64_t seed);

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
  int unfitted_count = 0;
  double p05 = 0, p25 = 0, p50 = 0, p75 = 0, p95 = 0;
  double fraction_beaten = 0.0;  ///< part of them that the choice beats, in [0, 1]
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
