#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "errors/identification/grey.h"
#include "errors/identification/thermal_data.h"

/// Key temperature points: of many sensors the few that matter, no two of which say the same.
namespace abbe::errors::identification {

enum class Likeness { Grey, Correlation };
enum class Screening {
  Degree,      ///< the leaders that resemble the error most (Chen)
  Regression,  ///< one leader after another, each time the one that lowers the residual most: with
               ///< each run left out, or, of a single run, in that run
};
struct SensorChoiceOptions {
  int count = 4;  ///< sensors wanted
  Likeness likeness = Likeness::Grey;
  /// A sensor that falls while the error rises is turned over first where the image is Interval.
  GreyOptions grey = {GreyKind::Deng, Image::Interval, 0.5, 0.5};
  /// Sensors this alike or more stand in one group. Unset: the threshold at which most groups are
  /// `groups`, so that there is something left to screen.
  std::optional<double> threshold;
  int groups = 6;  ///< where the threshold is unset; never fewer than `count` if there are so many
  Screening screening = Screening::Regression;
  /// Where a degree divides by a first value, its rows begin where the error is first farther from
  /// zero than this, for each error: a drift that counts from its first reading starts at zero.
  std::vector<double> least_start;  ///< (errors) unit of y; empty: 0
  std::vector<std::string> fixed;   ///< sensors that are taken as they are, nothing is chosen
};

/// Whether the degree divides every series by its first value: Deng's by the initial image, Liu's
/// relative and comprehensive ones. Its temperatures are best in deg C as read, since a change
/// since the start is zero there.
bool divides_by_start(const SensorChoiceOptions& options);

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
                                              ///< none: the error never leaves `least_start` and
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
  int last_start = 0;                ///< draws begin at rows 0 .. that
  Eigen::VectorXd chosen;            ///< (m) fraction of the draws that choose each input
  std::vector<int> best_rank;        ///< (m) of its degree over the draws, from 1; 0: none had one
  std::vector<int> worst_rank;       ///< (m)
  double same = 0.0;                 ///< fraction of the draws that choose the same set
};
struct ChoiceSpreadOptions {
  int draws = 50;
  int last_start = 10;               ///< at most a quarter of the rows
  Eigen::VectorXd input_noise;       ///< (m) standard deviation that is added to each input
  std::vector<double> error_noise;   ///< (errors) that is added to each y
  std::uint64_t seed = 1;
};
/// Chooses again and again: from the rows behind a start row, with noise added once more to what was
/// read, so that the spread is a little wide. The same bits for any number of threads.
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

}  // namespace abbe::errors::identification
