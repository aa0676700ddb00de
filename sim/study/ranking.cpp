#include "sim/study/ranking.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace abbe::sim::study {
namespace {

double squared(double value) { return value * value; }

Ranking ranked(Ranking::Basis basis, Eigen::VectorXd weights) {
  Ranking r;
  r.basis = basis;
  r.weights = weights.array().isFinite().select(weights.cwiseMax(0.0), 0.0);
  const double sum = r.weights.sum();
  r.shares = sum > 0.0 ? Eigen::VectorXd(r.weights / sum) : Eigen::VectorXd(0.0 * r.weights);
  r.order.resize(std::size_t(weights.size()));
  std::iota(r.order.begin(), r.order.end(), 0);
  std::stable_sort(r.order.begin(), r.order.end(),
                   [&](int a, int b) { return r.weights[a] > r.weights[b]; });
  return r;
}

/// A ranking by one figure of every contribution; of no basis where none of them has it.
template <typename Figure>
Ranking by(Ranking::Basis basis, const ResponseBudget& response, std::size_t inputs,
           const Figure& figure) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(Eigen::Index(inputs));
  bool any = false;
  for (const Contribution& c : response.contributions) {
    const std::optional<double> weight = figure(c);
    if (!weight) continue;
    any = true;
    weights[c.input] = *weight;
  }
  return ranked(any ? basis : Ranking::Basis::None, weights);
}

}  // namespace

std::optional<double> larger_change(const Contribution& c) {
  if (!c.low && !c.high) return {};
  return std::max(std::abs(c.low.value_or(0.0)), std::abs(c.high.value_or(0.0)));
}

Ranking change_ranking(const ResponseBudget& response, std::size_t inputs) {
  return by(Ranking::Basis::Change, response, inputs, [](const Contribution& c) {
    const std::optional<double> change = larger_change(c);
    return change ? std::optional(squared(*change)) : std::nullopt;
  });
}

double chance_correlation(const ResponseBudget& response) {
  return response.answers ? 4.0 / std::sqrt(double(response.answers->cases)) : 0.0;
}

Ranking ranking(const ResponseBudget& response, std::size_t inputs) {
  constexpr double numerical_floor = 1e-6;  // mm: what varies less is nobody's
  if (response.response != Response::InTolerance && response.answers &&
      response.answers->standard_deviation.value < numerical_floor)
    return {};
  const Ranking total = by(Ranking::Basis::Total, response, inputs, [](const Contribution& c) {
    return c.sobol ? std::optional(c.sobol->total.value) : std::nullopt;
  });
  if (total.basis != Ranking::Basis::None) return total;
  const Ranking change = change_ranking(response, inputs);
  if (change.basis != Ranking::Basis::None) return change;
  // a correlation that chance alone would give ranks nothing
  const double chance = chance_correlation(response);
  const auto told = [&](const Contribution& c) -> std::optional<double> {
    if (!c.rank_correlation) return {};
    return std::abs(*c.rank_correlation) > chance ? squared(*c.rank_correlation) : 0.0;
  };
  const Ranking correlated = by(Ranking::Basis::Correlation, response, inputs, told);
  return correlated.weights.sum() > 0.0 ? correlated : Ranking{};
}

Ranking map_ranking(const ArmBudget& arm, std::size_t inputs) {
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(Eigen::Index(inputs));
  for (std::size_t i = 0; i < std::min(arm.maps.size(), inputs); ++i)
    weights[Eigen::Index(i)] = arm.maps[i].share;
  Ranking result = ranked(arm.maps.empty() ? Ranking::Basis::None : Ranking::Basis::Map, weights);
  result.shares = weights;
  return result;
}

const char* share_of(Ranking::Basis basis) {
  switch (basis) {
    case Ranking::Basis::None:
      return "";
    case Ranking::Basis::Total:
      return "the sum of total Sobol indices";
    case Ranking::Basis::Change:
      return "the sum of squares, one at a time";
    case Ranking::Basis::Correlation:
      return "the sum of squared rank correlations";
    case Ranking::Basis::Map:
      return "the mean square of the map that inputs make";
  }
  return "";
}

}  // namespace abbe::sim::study
