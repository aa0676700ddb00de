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

/// The contribution of an input to a response of a configuration. Values of analyses that were not
/// requested are empty.
struct Contribution {
  int input = 0;
  std::optional<double> low;   ///< change of the response with the input at centre - step, mm or %
  std::optional<double> high;  ///< the same at centre + step
  std::optional<SobolIndex> sobol;
  std::optional<double> correlation;  ///< linear, with the responses of the Monte-Carlo cases
  std::optional<double> rank_correlation;
  std::optional<double> main_effect = {};  ///< fraction of the Monte-Carlo variance due to the
                                           ///< input alone (response_statistics.h)
};

/// The error budget of a response.
struct ResponseBudget {
  Response response = Response::Pv;
  double base = 0.0;  ///< response with every input at its centre, mm or percent
  std::vector<Contribution> contributions;  ///< (inputs)
  std::optional<double> root_sum_square;    ///< of the larger of |low| and |high| of every input
  std::optional<double> sum;          ///< of those values: the worst case of a linear response
  std::optional<double> worst;        ///< response at the worst corner found
  std::optional<double> worst_bound;  ///< upper bound of the response at any corner
  Eigen::VectorXd values;             ///< responses of the Monte-Carlo cases, (cases) or empty
  std::optional<ResponseStatistics> answers;        ///< statistics of `values`
  std::optional<double> limit;                      ///< mm
  std::optional<double> capability;                 ///< Cpk against the limit
  std::optional<IntervalEstimate> fraction_within;  ///< fraction of the machines within the limit
  std::optional<IndexConvergence> index_convergence;
};

/// The effect of one standard deviation of an input on the map of a configuration.
struct MapContribution {
  double rms = 0.0;  ///< mm, over the judged area
  double pv = 0.0;   ///< mm
  /// Fraction of that part of the map's mean square, over random machines, which is due to inputs.
  /// The fractions sum to 1. Half of a covariance counts for each of two inputs, so that the
  /// fraction is below 0 where correlated inputs cancel each other.
  double share = 0.0;
};

/// The effect of one standard deviation of an unidentified coefficient on the map of a
/// configuration.
struct UnidentifiedEffect {
  UnidentifiedCoefficient number;
  double rms = 0.0;  ///< mm, over the judged area
  double pv = 0.0;   ///< mm
};

/// The spreads of the inputs with which a response keeps its limit.
struct Allocation {
  Tolerance asked;
  Eigen::VectorXd equal;     ///< (inputs) factors of the spreads, all equal
  Eigen::VectorXd cheapest;  ///< (inputs) factors <= 1 with the least total cost, the sum of cost /
                             ///< factor
  double equal_cost = 0.0;
  double cheapest_cost = 0.0;
  IntervalEstimate equal_fraction;  ///< fraction of new random machines within the limit
  IntervalEstimate cheapest_fraction;
  double floor = 0.0;      ///< response with all inputs at their centres, mm
  bool attainable = true;  ///< false if even zero spreads do not meet the limit
};

/// The budget of a configuration: its responses, its map, and the spreads that a limit allows.
struct ConfigurationBudget {
  Configuration arm;
  std::vector<ResponseBudget> responses;
  std::vector<MapContribution> maps;  ///< (inputs), empty without influence maps
  std::optional<double> map_rms;  ///< root of the mean square of the map over random machines, mm:
                                  ///< its mean part and the contributions of all inputs
  std::optional<double> map_mean_rms;  ///< of the part due to no input (cusps, centres), mm
  std::optional<double>
      flagged_percent;                  ///< fraction of the judged area with flagged influence maps
  std::optional<double> uncut_percent;  ///< of the judged area, with every input at its centre
  std::optional<double> gouged_percent;  ///< the same, deeper than the gouge band
  std::optional<Allocation> allocation;
  std::vector<UnidentifiedEffect> unidentified;  ///< coefficients of a belief, drawn or left out
};

/// The comparison of influence maps with full cuts over the proof cases of engine `both`, for a
/// response of a configuration.
struct Proof {
  std::string arm;
  Response response = Response::Pv;
  std::uint64_t compared = 0;     ///< number of cases with a response from both engines
  std::uint64_t one_sided = 0;    ///< number of cases with a response from only one engine
  std::optional<double> percent;  ///< largest difference, relative to the value of the full cut;
                                  ///< for the mean and the area in tolerance, which may be zero,
                                  ///< relative to the largest value
};

/// The responses along the values of a sweep.
struct SweepResult {
  int sweep = 0;
  std::vector<std::vector<Eigen::VectorXd>>
      answers;  ///< (configurations)(responses), each (values)
};

/// The results of a study.
struct Budget {
  Study study;
  std::uint64_t cases = 0;   ///< finished cases
  std::uint64_t failed = 0;  ///< finished cases without a response
  std::vector<ConfigurationBudget> configurations;
  std::vector<Proof> proofs;
  std::vector<SweepResult> sweeps;
  std::vector<std::string> warnings;
};

// Figures of a budget as JSON; null for a value that is missing or not finite.

nlohmann::ordered_json json_figure(const std::optional<double>& value);
nlohmann::ordered_json json_figure(const IntervalEstimate& estimate, double factor = 1.0);
nlohmann::ordered_json json_figures(const Eigen::VectorXd& values);
/// Return a value of a response in its unit.
nlohmann::ordered_json json_figure(Response response, const std::optional<double>& value);
nlohmann::ordered_json json_figure(Response response, const IntervalEstimate& estimate);

/// Returns the figures of the map of a configuration by key; null if it has none.
nlohmann::ordered_json map_figures(const ConfigurationBudget& arm);

/// Returns the contents of `budget.json`, with keys that are stable for scripts. Values of a
/// response are in its stated unit ("um", "%"), fractions in keys that end in _percent. Indices,
/// correlations, factors, Cpk and inputs of unit "1" are dimensionless. Missing values are null.
nlohmann::ordered_json to_json(const Budget& budget);
/// Returns the contents of `budget.csv`: a row for every configuration, response and input, with
/// units in the column heads. A change is in the column _um or _percent, depending on its response.
/// Fields are quoted by RFC 4180, and numbers read back to the same bits.
std::string to_csv(const Budget& budget);
/// Returns the contents of `budget.md`: a line for every configuration, then totals, dominant
/// inputs, recommended spending, and the 15 inputs that contribute most. Mark-up in names is
/// escaped.
std::string to_markdown(const Budget& budget);
/// Returns the same report for a terminal: without mark-up, in aligned columns.
std::string to_text(const Budget& budget);

/// Writes the pictures for which the budget has data: pareto-CONFIGURATION,
/// tornado-CONFIGURATION-RESPONSE, indices-CONFIGURATION-RESPONSE (convergence),
/// correlation-CONFIGURATION, distribution-RESPONSE (all configurations) and sweep-INPUT, .png;
/// `file_name_part` makes the names. Writes nothing if the program was built without VTK.
/// @param progress  shows one stage, "budget"
/// @throws OutputFailure, Interrupted
void write_pictures(const ResultFolder& folder, const Budget& budget,
                    const Progress& progress = {});

/// The inputs in the order of their contributions.
struct Ranking {
  enum class Basis {
    None,
    Sobol,       ///< shares are first-order indices, weights are total indices
    Change,      ///< squares of the larger one-at-a-time changes
    MainEffect,  ///< fractions of the variance of random machines due to an input alone
    Map,         ///< contributions to the mean square of the map
  } basis = Basis::None;
  std::vector<int> order;   ///< (inputs) largest weight first, equal weights by index
  Eigen::VectorXd weights;  ///< (inputs) >= 0
  Eigen::VectorXd shares;   ///< (inputs) fractions of the total; all zero if nothing varies. Those
                            ///< of a map are as in MapContribution, so below zero where correlated
                            ///< inputs cancel
  double apart = 0.0;       ///< fraction due to no input alone; it and the shares add up to 1
};

/// Returns the largest correlation that chance alone may give, four standard errors; 0 without
/// Monte-Carlo responses.
double chance_correlation(const ResponseBudget& response);

/// Ranks by Sobol indices; without them by one-at-a-time changes; without these by main effects
/// beyond chance. The basis is None without any of them, or if the response varies by less than the
/// floor of 1 nm.
Ranking ranking(const ResponseBudget& response, std::size_t inputs);
/// Ranks by the larger one-at-a-time change, as in a tornado chart; changes below 1 nm count as 0.
Ranking change_ranking(const ResponseBudget& response, std::size_t inputs);
/// Ranks by contributions to the map of a configuration.
Ranking map_ranking(const ConfigurationBudget& arm, std::size_t inputs);

/// Returns the label of the total of which the shares of a ranking are fractions.
const char* share_of(Ranking::Basis basis);
/// Returns the label of the remainder that no share contains; empty if the basis has none.
const char* remainder_name(Ranking::Basis basis);

/// Returns the inputs with the three largest shares above zero, largest first; empty if these do
/// not reach half of the total.
std::vector<int> dominant_inputs(const Ranking& ranking);

/// A bar of a Pareto chart.
struct ParetoBar {
  enum class Kind { Input, Others, Apart } kind = Kind::Input;
  int input = 0;         ///< index, for kind Input
  std::size_t many = 1;  ///< number of inputs, for kind Others
  double share = 0.0;
};
/// Number of inputs that budget.json and the page name as the largest of a response.
inline constexpr std::size_t max_ranked_inputs = 10;
/// Returns the bars of the largest shares, a bar of the other inputs, and the remainder. They add
/// up to 1.
/// @param max_inputs  number of inputs with a bar of their own, at most
std::vector<ParetoBar> pareto(const Ranking& ranking, std::size_t max_inputs);

/// Returns the magnitude of the larger one-at-a-time change; none if that analysis was not
/// requested.
std::optional<double> larger_change(const Contribution& contribution);

}  // namespace abbe::sim::study
