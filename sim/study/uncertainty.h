#pragma once

#include <nlohmann/json.hpp>

#include "sim/study/budget.h"
#include "sim/study/influence.h"

namespace abbe::sim::study {

/// Uncertainty of the map of a configuration at each vertex due to the spread of its inputs.
struct UncertaintyMap {
  Eigen::VectorXd standard_deviation;  ///< (n) mm, root of the diagonal of G S G^T for the pass
                                       ///< that makes the surface in the base run, S the covariance
                                       ///< of the inputs; NaN where uncut
  Eigen::VectorXd low;    ///< (n) mm, lower end of the interval that contains the residual at a
                          ///< vertex
  Eigen::VectorXd high;   ///< (n) mm, upper end, with the study's confidence, over random machines
  Eigen::VectorXd drawn;  ///< (n) mm, standard deviation over those machines, including changes of
                          ///< the competing pass
  double confidence = 0.95;
  std::uint64_t machines = 0;
};
/// Computes the uncertainty map. Intervals and `drawn` are those of the residual less the
/// error-free one if the study requests that, before any alignment; the machines are points of
/// Sobol's sequence. Memory: the inputs of all machines, not their maps. The same bits for any
/// number of threads.
UncertaintyMap uncertainty_map(const Study& study, const InfluenceMap& influence);

/// Returns the covariance of the inputs from standard deviations and the correlation of scores,
/// which is exact where the inputs are normal. (inputs x inputs)
Eigen::MatrixXd covariance_of(const Study& study);

/// Returns the `uncertainty.json` values of a map, um: RMS (by area) and maximum of the standard
/// deviation, mean width of the interval.
nlohmann::ordered_json to_json(const InfluenceMap& influence, const UncertaintyMap& uncertainty);

/// Returns spreads that keep a response of a configuration within the tolerance of its study, by
/// influence maps. `equal`: one factor of all spreads; `cheapest`: the factors, none above 1, of
/// minimum cost, where an input with 1/k of its spread costs k times its cost. Both are as large as
/// the same machines (Sobol's sequence) allow, to 1e-5, and verified on fresh random ones, whose
/// fractions within the limit are reported. A factor scales the distance of an input from its
/// centre. If the limit is kept neither by the present spreads nor by zero spreads, it is not
/// attainable: all factors are 0 and the costs infinite.
/// The cost is minimal to some 1 %, because the quantile of the response is known from a finite
/// number of machines. It never exceeds that of `equal`.
Allocation allocation(const Study& study, const PreparedConfiguration& ready,
                      const InfluenceMap& influence);

/// Returns the same for any response; greater values are worse, and a machine without a response
/// fails.
/// @param study  its tolerance, inputs, copula and seed
Allocation allocation(const Study& study, const ResponseFunction& response);

}  // namespace abbe::sim::study
