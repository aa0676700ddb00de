#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "sim/study/budget.h"

namespace abbe::sim::study {

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
  double apart = 0.0;  ///< of the whole, what no input makes alone; shares and this add up to 1
};

/// What correlation chance alone may give a response: four standard errors; 0 without answers.
double chance_correlation(const ResponseBudget& response);

/// By Sobol indices; where there are none by changes, then by main effects beyond chance; of no
/// basis where none is, or where the response varies by less than the floor of 1 nm.
Ranking ranking(const ResponseBudget& response, std::size_t inputs);
/// By the larger change alone, of those above 1 nm: of a tornado.
Ranking change_ranking(const ResponseBudget& response, std::size_t inputs);
/// By the map of an arm.
Ranking map_ranking(const ArmBudget& arm, std::size_t inputs);

/// What a share of a ranking is a share of, in words.
const char* share_of(Ranking::Basis basis);
/// What stands apart from the shares of a ranking, in words; empty where nothing can.
const char* apart_of(Ranking::Basis basis);

/// The inputs that together make at least half of the whole, at most three, the largest first;
/// empty where three do not.
std::vector<int> dominating(const Ranking& ranking);

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
