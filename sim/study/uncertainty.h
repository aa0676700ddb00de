#pragma once

#include <nlohmann/json.hpp>

#include "sim/study/budget.h"
#include "sim/study/influence.h"

namespace abbe::sim::study {

/// How far the map of an arm is unknown, vertex by vertex, where its inputs are.
struct UncertaintyMap {
  Eigen::VectorXd
      standard_deviation;  ///< (n) mm, G S G^T of the pass that makes the surface in the
                           ///< base run, S the covariance of the inputs; NaN where uncut
  Eigen::VectorXd low;    ///< (n) mm, ends of the band of the map over random machines, in which it
  Eigen::VectorXd high;   ///< (n) lies at that vertex with the study's confidence
  Eigen::VectorXd drawn;  ///< (n) mm, standard deviation over those machines: what rivals add
  double confidence = 0.95;
  std::uint64_t machines = 0;
};
/// Bands and `drawn` are those of the residual less the error-free one where the study asks for
/// that, before any alignment; the machines are points of Sobol's sequence. Memory: the inputs of
/// all machines, not their maps. The same bits for any number of threads.
UncertaintyMap uncertainty_map(const Study& study, const InfluenceMap& influence);

/// Covariance of the inputs: standard deviations and the correlation of their scores, which is
/// theirs where they are normal. (inputs x inputs)
Eigen::MatrixXd covariance_of(const Study& study);

/// `uncertainty.json` values of a map, um: RMS (by area) and largest of the standard deviation,
/// mean width of the band.
nlohmann::ordered_json to_json(const InfluenceMap& influence, const UncertaintyMap& uncertainty);

/// Spreads that keep a response of an arm within the tolerance of its study, by influence maps.
/// `equal`: one factor of all spreads; `cheapest`: the factors, none above 1, that cost least,
/// where an input whose spread is a k-th costs k times its cost. Both are as large as the same
/// machines (Sobol's) allow, to 1e-5, and verified on fresh random ones, which the shares are of.
/// A factor shrinks how far an input is drawn from its centre. Where the limit is kept neither by
/// the present spreads nor by none at all, nothing is attainable: all factors are 0 and the costs
/// infinite.
/// Cheapest to some 1 % of its cost: the response's quantile is known from so many machines only.
/// It never costs more than `equal`.
Allocation allocation(const Study& study, const PreparedConfiguration& ready,
                      const InfluenceMap& influence);

/// The same for any response; greater values of it are worse, and a machine without one fails.
/// @param study  its tolerance, inputs, copula and seed
Allocation allocation(const Study& study, const ResponseFunction& response);

}  // namespace abbe::sim::study
