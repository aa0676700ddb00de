#pragma once

#include "sim/study/budget.h"
#include "sim/study/response_function.h"

namespace abbe::sim::study {

/// Spreads that keep a response of an arm within the tolerance of its study, by influence maps.
/// `equal`: one factor of all spreads; `cheapest`: the factors, none above 1, that cost least,
/// where an input whose spread is a k-th costs k times its cost. Both are as large as the same
/// machines (Sobol's) allow, to 1e-5, and verified on fresh random ones, which the shares are of.
/// A factor shrinks how far an input is drawn from its centre. Where the limit is kept neither by
/// the present spreads nor by none at all, nothing is attainable: all factors are 0 and the costs
/// infinite.
/// Cheapest to some 1 % of its cost: the response's quantile is known from so many machines only.
/// It never costs more than `equal`.
Allocation allocation(const Study& study, const ReadyArm& ready, const InfluenceMap& influence);

/// The same for any response; greater values of it are worse, and a machine without one fails.
/// @param study  its tolerance, inputs, copula and seed
Allocation allocation(const Study& study, const ResponseFunction& response);

}  // namespace abbe::sim::study
