#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/study/response_statistics.h"
#include "sim/study/study.h"

namespace abbe::sim::study {

/// Contribution of one input to one response of one configuration. Values of an analysis that was
/// not requested are empty.
struct Contribution {
  int input = 0;
  std::optional<double> low;   ///< change of the response with the input at centre - step, mm
  std::optional<double> high;  ///< the same at centre + step
  std::optional<SobolIndex> sobol;
  std::optional<double> correlation;  ///< linear, with the responses of the Monte-Carlo cases
  std::optional<double> rank_correlation;
  std::optional<double> main_effect = {};  ///< fraction of the Monte-Carlo variance due to this
                                           ///< input alone (response_statistics.h)
};

/// Error budget of one response.
struct ResponseBudget {
  Response response = Response::Pv;
  double base = 0.0;  ///< response with every input at its centre, mm or percent
  std::vector<Contribution> contributions;  ///< (inputs)
  std::optional<double> root_sum_square;    ///< of the larger of |low| and |high| of every input
  std::optional<double> sum;          ///< of the same values: the worst case of a linear response
  std::optional<double> worst;        ///< response at the worst corner found
  std::optional<double> worst_bound;  ///< upper bound: no corner is worse
  Eigen::VectorXd values;             ///< responses of the Monte-Carlo cases, (cases) or empty
  std::optional<Answers> answers;     ///< statistics of `values`
  std::optional<double> limit;        ///< mm
  std::optional<double> capability;   ///< Cpk against the limit
  std::optional<IntervalEstimate> fraction_within;  ///< fraction of the machines within the limit
  std::optional<IndexConvergence> convergence;
};

/// Effect of one standard deviation of an input on the map of a configuration.
struct MapContribution {
  double rms = 0.0;  ///< mm, over the judged area
  double pv = 0.0;   ///< mm
  /// Fraction of the part of the map's mean square, over random machines, that is due to inputs;
  /// they sum to 1. Half of a covariance counts for each of the two inputs, so it may be below 0
  /// where correlated inputs cancel each other.
  double share = 0.0;
};

/// Effect of one standard deviation of an unidentified coefficient on the map of a configuration.
struct UnidentifiedEffect {
  Unidentified number;
  double rms = 0.0;  ///< mm, over the judged area
  double pv = 0.0;   ///< mm
};

/// Spreads of the inputs that keep a response within its limit.
struct Allocation {
  Tolerance asked;
  Eigen::VectorXd equal;     ///< (inputs) factor of every spread, all equal
  Eigen::VectorXd cheapest;  ///< (inputs) factors <= 1 of minimum total cost, the sum of cost /
                             ///< factor
  double equal_cost = 0.0;
  double cheapest_cost = 0.0;
  IntervalEstimate equal_share;  ///< fraction of fresh random machines within the limit
  IntervalEstimate cheapest_share;
  double floor = 0.0;      ///< mm, response with all inputs at their centres
  bool attainable = true;  ///< false: the limit is not met even with zero spreads
};

/// Budget of one configuration: its responses, its map, and the spreads that a limit allows.
struct ConfigurationBudget {
  Configuration arm;
  std::vector<ResponseBudget> responses;
  std::vector<MapContribution> maps;  ///< (inputs), empty without influence maps
  std::optional<double> map_rms;  ///< mm, root of the mean square of the map over random machines:
                                  ///< its mean part and the contributions of all inputs
  std::optional<double> map_mean_rms;     ///< mm, of the part due to no input: cusps, centres
  std::optional<double> flagged_percent;  ///< of the judged area, where the influence maps are
                                          ///< flagged
  std::optional<double> uncut_percent;    ///< of the judged area, with every input at its centre
  std::optional<double> gouged_percent;   ///< the same, deeper than the gouge band
  std::optional<Allocation> allocation;
  std::vector<UnidentifiedEffect> unidentified;  ///< coefficients of a belief, drawn or left out
};

/// Comparison of influence maps with full cuts over the proof cases of engine `both`, for one
/// response of one configuration.
struct Proof {
  std::string arm;
  Response response = Response::Pv;
  std::uint64_t compared = 0;     ///< cases for which both engines have a response
  std::uint64_t one_sided = 0;    ///< cases for which only one of them has
  std::optional<double> percent;  ///< largest difference, relative to the full cut's value; for the
                                  ///< mean and the area in tolerance, which may be zero, relative
                                  ///< to their largest value
};

/// Responses along the values of one sweep.
struct SweepResult {
  int sweep = 0;
  std::vector<std::vector<Eigen::VectorXd>> answers;  ///< (arms)(responses), each (values)
};

/// All results of a study.
struct Budget {
  Study study;
  std::uint64_t cases = 0;   ///< finished cases
  std::uint64_t failed = 0;  ///< finished cases without a response
  std::vector<ConfigurationBudget> arms;
  std::vector<Proof> proofs;
  std::vector<SweepResult> sweeps;
  std::vector<std::string> warnings;
};

/// Returns the contents of `budget.json`; the keys are stable for scripts. Each response states its
/// unit ("um", "%"), in which all its values are; fractions are in keys that end in _percent;
/// indices, correlations, factors and Cpk are dimensionless, as are inputs of unit "1". Missing
/// values are null.
nlohmann::ordered_json to_json(const Budget& budget);
/// Returns the contents of `budget.csv`: one row for every configuration, response and input, units
/// in the column heads. A change is in the column _um or _percent, depending on its response.
/// Fields are quoted by RFC 4180; numbers read back to the same bits.
std::string to_csv(const Budget& budget);
/// Returns the contents of `budget.md` for a reader: one line for every configuration, then totals,
/// the dominant inputs, what to spend on, and the 15 inputs that contribute most. Mark-up in names
/// is escaped.
std::string to_markdown(const Budget& budget);
/// Returns the same report for a terminal: without mark-up, in aligned columns.
std::string to_text(const Budget& budget);

/// Writes the pictures for which the budget has data: pareto-CONFIGURATION,
/// tornado-CONFIGURATION-RESPONSE, indices-CONFIGURATION-RESPONSE (convergence),
/// correlation-CONFIGURATION, distribution-RESPONSE (all configurations) and sweep-INPUT, .png;
/// file_part() makes the names. Writes nothing if the program was built without VTK.
/// @param progress  shows one stage, "budget"
/// @throws OutputFailure, Interrupted
void write_pictures(const ResultFolder& folder, const Budget& budget,
                    const Progress& progress = {});

/// Inputs ordered by their contribution, by the best measure that a budget has.
struct Ranking {
  enum class Basis {
    None,
    Sobol,       ///< shares are first-order indices, the order is by total indices
    Change,      ///< square of the larger one-at-a-time change
    MainEffect,  ///< fraction of the variance of random machines due to an input alone
    Map,         ///< mean square of the map
  } basis = Basis::None;
  std::vector<int> order;   ///< (inputs) largest weight first, equal weights by index
  Eigen::VectorXd weights;  ///< (inputs) >= 0, the weights that define the order
  Eigen::VectorXd shares;   ///< (inputs) fractions of the whole; all zero where nothing varies.
                            ///< Those of a map are as in MapContribution, so below zero where
                            ///< correlated inputs cancel
  double apart =
      0.0;  ///< fraction of the whole due to no input alone; it and the shares add up to 1
};

/// Returns the largest correlation that chance alone may give: four standard errors; 0 without
/// Monte-Carlo responses.
double chance_correlation(const ResponseBudget& response);

/// Ranks by Sobol indices; without them by one-at-a-time changes, then by main effects beyond
/// chance. The basis is None where none of these exists, or where the response varies by less than
/// the floor of 1 nm.
Ranking ranking(const ResponseBudget& response, std::size_t inputs);
/// Ranks by the larger one-at-a-time change, as a tornado chart does; changes below 1 nm count as
/// zero.
Ranking change_ranking(const ResponseBudget& response, std::size_t inputs);
/// Ranks by contributions to the map of a configuration.
Ranking map_ranking(const ConfigurationBudget& arm, std::size_t inputs);

/// Returns the label of the whole that the shares of a ranking are fractions of.
const char* share_of(Ranking::Basis basis);
/// Returns the label of the remainder that no share of a ranking contains; empty if the basis has
/// none.
const char* remainder_name(Ranking::Basis basis);

/// Returns the inputs that together make at least half of the whole, at most three, largest first;
/// empty if three do not reach half.
std::vector<int> dominant_inputs(const Ranking& ranking);

/// A bar of a Pareto chart.
struct ParetoBar {
  enum class Kind { Input, Others, Apart } kind = Kind::Input;
  int input = 0;         ///< index, for kind Input
  std::size_t many = 1;  ///< number of inputs, for kind Others
  double share = 0.0;
};
/// Returns the bars of the largest shares, one bar of the other inputs, and the remainder; they add
/// up to 1.
/// @param most  maximum number of inputs with a bar of their own
std::vector<ParetoBar> pareto(const Ranking& ranking, std::size_t most);

/// Returns the larger of the two one-at-a-time changes by magnitude; empty if that analysis was not
/// requested.
std::optional<double> larger_change(const Contribution& contribution);

}  // namespace abbe::sim::study
