#pragma once

#include <vector>

#include <Eigen/Core>

#include "sim/study/budget.h"

namespace abbe::sim::study {

/// Inputs in the order of what they contribute, by the best figure of a budget.
struct Ranking {
  enum class Basis {
    None,
    Total,        ///< total Sobol index
    Change,       ///< square of the larger change, one at a time
    Correlation,  ///< square of the rank correlation
    Map,          ///< mean square of the map
  } basis = Basis::None;
  std::vector<int> order;   ///< (inputs) the largest first, equal ones by their number
  Eigen::VectorXd weights;  ///< (inputs) >= 0 what the basis says
  Eigen::VectorXd shares;   ///< (inputs) of the sum of all weights; all zero where it is zero. Of a
                            ///< map as MapContribution says, so below zero where correlated inputs
                            ///< take away
};

/// What correlation chance alone may give a response: four standard errors; 0 without answers.
double chance_correlation(const ResponseBudget& response);

/// By total Sobol indices; where there are none by changes, then by correlations beyond chance; of
/// no basis where none is, or where the response varies by less than the floor of 1 nm.
Ranking ranking(const ResponseBudget& response, std::size_t inputs);
/// By the larger change alone: of a tornado.
Ranking change_ranking(const ResponseBudget& response, std::size_t inputs);
/// By the map of an arm.
Ranking map_ranking(const ArmBudget& arm, std::size_t inputs);

/// What a share of a ranking is a share of, in words.
const char* share_of(Ranking::Basis basis);

/// The larger of both changes, by size; nothing where one at a time was not asked.
std::optional<double> larger_change(const Contribution& contribution);

}  // namespace abbe::sim::study
