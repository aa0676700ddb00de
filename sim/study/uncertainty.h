#pragma once

#include <nlohmann/json.hpp>

#include "sim/study/budget.h"
#include "sim/study/influence.h"

namespace abbe::sim::study {

/// Uncertainty of the map of a configuration at each vertex due to the spread of its inputs.
struct UncertaintyMap {
  Eigen::VectorXd standard_deviation;  ///< (n) mm, square root of the diagonal of G S G^T, where G
                                       ///< are the effects of the inputs by the pass that cuts the
                                       ///< vertex in the base run and S is the covariance of the
                                       ///< inputs; NaN where uncut
  Eigen::VectorXd low;   ///< (n) mm, lower end of the interval of the residual over random machines
  Eigen::VectorXd high;  ///< (n) mm, upper end of that interval
  Eigen::VectorXd drawn;  ///< (n) mm, standard deviation over these machines, in which other passes
                          ///< may cut the vertex
  double confidence = 0.95;  ///< of the interval
  std::uint64_t machines = 0;
};
/// Computes the uncertainty map. Intervals and `drawn` are those of the residual before any
/// alignment, minus the error-free map if the study requests that. The machines are points of
/// Sobol's sequence. Their inputs are held in memory, their maps are not. The bits do not depend on
/// the number of threads.
UncertaintyMap uncertainty_map(const Study& study, const InfluenceMap& influence);

/// Returns the covariance of the inputs from their standard deviations and the correlation of their
/// scores, which is exact for normal inputs. (inputs x inputs)
Eigen::MatrixXd input_covariance(const Study& study);

/// Returns the entry of `budget.json` for a map, um: RMS (by area) and maximum of the standard
/// deviation, and mean width of the interval.
nlohmann::ordered_json to_json(const InfluenceMap& influence, const UncertaintyMap& uncertainty);

/// Returns the factors of the inputs' spreads with which a response of a configuration stays within
/// the tolerance of its study, computed by influence maps. `equal` is a common factor of all
/// spreads; `cheapest` are the factors, none above 1, of minimum cost, where an input with 1/k of
/// its spread costs k times as much. A factor scales the distance of an input from its centre. Both
/// are the largest that the same machines (Sobol's sequence) allow, to within 1e-5. They are
/// verified on new random machines, whose fractions within the limit are reported. If neither the
/// present spreads nor zero spreads keep the limit, it is not attainable: all factors are 0 and the
/// costs infinite. The cost is minimal to about 1 %, because the quantile of the response is known
/// from a finite number of machines. It never exceeds that of `equal`.
Allocation allocation(const Study& study, const PreparedConfiguration& ready,
                      const InfluenceMap& influence);

/// Returns the factors for any response of which greater values are worse. A machine without a
/// response exceeds the limit.
/// @param study  of which tolerance, inputs, copula and seed are used
Allocation allocation(const Study& study, const ResponseFunction& response);

}  // namespace abbe::sim::study
