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

/// What one input contributes to one response of one arm. What an analysis did not ask is empty.
struct Contribution {
  int input = 0;
  std::optional<double> low;   ///< change of the response at centre - step, mm
  std::optional<double> high;  ///< at centre + step
  std::optional<SobolIndex> sobol;
  std::optional<double> correlation;  ///< linear, with the answers of Monte-Carlo
  std::optional<double> rank_correlation;
  std::optional<double> main_effect = {};  ///< share of the variance of Monte-Carlo that it makes
                                           ///< alone (main_effects.h)
};

/// The budget of one response.
struct ResponseBudget {
  Response response = Response::Pv;
  double base = 0.0;                        ///< with every input at its centre
  std::vector<Contribution> contributions;  ///< (inputs)
  std::optional<double> root_sum_square;    ///< of the larger of low and high
  std::optional<double> sum;                ///< of the same: worst case of a linear response
  std::optional<double> worst;              ///< of the worst corner that was found
  std::optional<double> worst_bound;        ///< no corner is worse
  Eigen::VectorXd values;                   ///< of Monte-Carlo, (cases) or empty
  std::optional<Answers> answers;           ///< of them
  std::optional<double> limit;              ///< mm
  std::optional<double> capability;         ///< Cpk against it
  std::optional<IntervalEstimate> fraction_within;  ///< of the machines within the limit
  std::optional<IndexConvergence> convergence;
};

/// What one standard deviation of an input does to the map of an arm.
struct MapContribution {
  double rms = 0.0;    ///< mm, over the judged area
  double pv = 0.0;     ///< mm
  double share = 0.0;  ///< of what all inputs make of the map's mean square over random machines;
                       ///< they sum to 1. A covariance counts half for each of the two, so a share
                       ///< may be below 0 where correlated inputs undo each other
};

/// What a standard deviation of an unidentified number does to the map of an arm.
struct UnidentifiedEffect {
  Unidentified number;
  double rms = 0.0;  ///< mm, over the judged area
  double pv = 0.0;   ///< mm
};

/// Spreads that keep a response within its limit.
struct Allocation {
  Tolerance asked;
  Eigen::VectorXd equal;     ///< (inputs) factor of every spread, the same for all
  Eigen::VectorXd cheapest;  ///< (inputs) factors <= 1 of least cost, sum of cost / factor
  double equal_cost = 0.0;
  double cheapest_cost = 0.0;
  IntervalEstimate equal_share;  ///< of fresh random machines within the limit
  IntervalEstimate cheapest_share;
  double floor = 0.0;      ///< mm, of the response with all inputs at their centres
  bool attainable = true;  ///< false: not even without any spread
};

struct ConfigurationBudget {
  Configuration arm;
  std::vector<ResponseBudget> responses;
  std::vector<MapContribution> maps;  ///< (inputs) or empty without influence maps
  std::optional<double> map_rms;  ///< mm, root of the mean square of the map over random machines:
                                  ///< its mean part and all shares
  std::optional<double> map_mean_rms;  ///< mm, of the part that is no input's: cusps, centres
  std::optional<double> flagged_percent;
  std::optional<double> uncut_percent;   ///< of the judged area, with every input at its centre
  std::optional<double> gouged_percent;  ///< the same, deeper than the band
  std::optional<Allocation> allocation;
  std::vector<UnidentifiedEffect> unidentified;  ///< of a belief, whether drawn or left out
};

/// Influence against full runs, over the proofs of engine `both`: one response of one arm.
struct Proof {
  std::string arm;
  Response response = Response::Pv;
  std::uint64_t compared = 0;     ///< cases that both engines answer
  std::uint64_t one_sided = 0;    ///< cases that one of them answers
  std::optional<double> percent;  ///< largest difference, of the full run's figure; of mean and
                                  ///< share in tolerance, which may be zero, of the largest figure
};

struct SweepResult {
  int sweep = 0;
  std::vector<std::vector<Eigen::VectorXd>> answers;  ///< (arms)(responses), each (values)
};

/// Everything that a study says.
struct Budget {
  Study study;
  std::uint64_t cases = 0;   ///< finished
  std::uint64_t failed = 0;  ///< of them, without an answer
  std::vector<ConfigurationBudget> arms;
  std::vector<Proof> proofs;
  std::vector<SweepResult> sweeps;
  std::vector<std::string> warnings;
};

/// `budget.json`; the keys are a promise to scripts. A response says its unit ("um", "%"), all
/// figures of it are in that; shares in keys that end in _percent; indices, correlations, factors
/// and Cpk are pure numbers, as are inputs of unit "1". What is not there is null.
nlohmann::ordered_json to_json(const Budget& budget);
/// `budget.csv`: a row for every arm, response and input, units in the heads; a change is in the
/// column _um or _percent, as its response is. Fields as RFC 4180 has them, numbers read back the
/// same bits.
std::string to_csv(const Budget& budget);
/// `budget.md`: what a person reads first: a line for every arm, then totals, what dominates, what
/// to spend on, and the 15 inputs that contribute most. Names lose their mark-up.
std::string to_markdown(const Budget& budget);
/// The same for a terminal: no mark-up, columns that stand below each other.
std::string to_text(const Budget& budget);

/// Whatever the budget has of pareto-ARM, tornado-ARM-RESPONSE, indices-ARM-RESPONSE (convergence),
/// correlation-ARM, distribution-RESPONSE (all arms) and sweep-INPUT, .png; names as file_part()
/// makes them. Nothing where the program was built without VTK.
/// @param progress  shows one stage, "budget"
/// @throws OutputFailure, Interrupted
void write_pictures(const ResultFolder& folder, const Budget& budget,
                    const Progress& progress = {});

/// Inputs in the order of what they contribute, by the best figure of a budget.
struct Ranking {
  enum class Basis {
    None,
    Sobol,       ///< shares are first-order indices, the order is that of total ones
    Change,      ///< square of the larger change, one at a time
    MainEffect,  ///< share of the variance of random machines that an input makes alone
    Map,         ///< mean square of the map
  } basis = Basis::None;
  std::vector<int> order;   ///< (inputs) the largest weight first, equal ones by their number
  Eigen::VectorXd weights;  ///< (inputs) >= 0 by which they are ordered
  Eigen::VectorXd shares;   ///< (inputs) of the whole; all zero where nothing varies. Of a map as
                            ///< MapContribution says, so below zero where correlated inputs take
                            ///< away
  double length_mismatch_text =
      0.0;  ///< of the whole, what no input makes alone; shares and this add up to 1
};

/// What correlation chance alone may give a response: four standard errors; 0 without answers.
double chance_correlation(const ResponseBudget& response);

/// By Sobol indices; where there are none by changes, then by main effects beyond chance; of no
/// basis where none is, or where the response varies by less than the floor of 1 nm.
Ranking ranking(const ResponseBudget& response, std::size_t inputs);
/// By the larger change alone, of those above 1 nm: of a tornado.
Ranking change_ranking(const ResponseBudget& response, std::size_t inputs);
/// By the map of an arm.
Ranking map_ranking(const ConfigurationBudget& arm, std::size_t inputs);

/// What a share of a ranking is a share of, in words.
const char* share_of(Ranking::Basis basis);
/// What stands apart from the shares of a ranking, in words; empty where nothing can.
const char* remainder_name(Ranking::Basis basis);

/// The inputs that together make at least half of the whole, at most three, the largest first;
/// empty where three do not.
std::vector<int> dominant_inputs(const Ranking& ranking);

/// A bar of a Pareto picture.
struct ParetoBar {
  enum class Kind { Input, Others, Apart } kind = Kind::Input;
  int input = 0;         ///< of kind Input
  std::size_t many = 1;  ///< of kind Others
  double share = 0.0;
};
/// The largest shares, the others in one bar, and what stands apart; they add up to 1.
/// @param most  inputs with a bar of their own
std::vector<ParetoBar> pareto(const Ranking& ranking, std::size_t most);

/// The larger of both changes, by size; nothing where one at a time was not asked.
std::optional<double> larger_change(const Contribution& contribution);

}  // namespace abbe::sim::study
