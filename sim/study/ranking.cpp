#include "sim/study/ranking.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "sim/study/main_effects.h"

namespace abbe::sim::study {
namespace {

double squared(double value) { return value * value; }

constexpr double numerical_floor = 1e-6;  // mm: what varies less is nobody's

Eigen::VectorXd known(const Eigen::VectorXd& values) {
  return values.array().isFinite().select(values.cwiseMax(0.0), 0.0);
}

/// In the order of the weights. Shares that add up to more than 1, as estimates may, are scaled.
Ranking ranked(Ranking::Basis basis, const Eigen::VectorXd& weights,
               const Eigen::VectorXd& shares) {
  Ranking r;
  r.basis = basis;
  r.weights = known(weights);
  r.shares = known(shares);
  r.shares /= std::max(1.0, r.shares.sum());
  r.apart = r.weights.sum() > 0.0 ? std::max(0.0, 1.0 - r.shares.sum()) : 0.0;
  r.order.resize(std::size_t(weights.size()));
  std::iota(r.order.begin(), r.order.end(), 0);
  std::stable_sort(r.order.begin(), r.order.end(),
                   [&](int a, int b) { return r.weights[a] > r.weights[b]; });
  return r;
}

/// Shares are of the sum of all weights.
Ranking ranked(Ranking::Basis basis, const Eigen::VectorXd& weights) {
  const Eigen::VectorXd all = known(weights);
  const double sum = all.sum();
  Ranking r = ranked(basis, all, sum > 0.0 ? Eigen::VectorXd(all / sum) : all);
  r.apart = 0.0;
  return r;
}

/// One figure of every contribution; nothing where none of them has it.
template <typename Figure>
std::optional<Eigen::VectorXd> figures(const ResponseBudget& response, std::size_t inputs,
                                       const Figure& figure) {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(Eigen::Index(inputs));
  bool any = false;
  for (const Contribution& c : response.contributions) {
    const std::optional<double> value = figure(c);
    if (!value) continue;
    any = true;
    all[c.input] = *value;
  }
  return any ? std::optional(all) : std::nullopt;
}

std::optional<Ranking> sobol_ranking(const ResponseBudget& response, std::size_t inputs) {
  const auto of = [&](const Banded SobolIndex::*which) {
    return figures(response, inputs, [&](const Contribution& c) {
      return c.sobol ? std::optional(((*c.sobol).*which).value) : std::nullopt;
    });
  };
  const auto total = of(&SobolIndex::total), first = of(&SobolIndex::first);
  if (!total) return {};
  return ranked(Ranking::Basis::Sobol, *total, *first);
}

std::optional<Ranking> main_effect_ranking(const ResponseBudget& response, std::size_t inputs) {
  // an effect that chance alone would give is none
  const double chance =
      chance_effect(response.answers ? response.answers->cases : 0, Eigen::Index(inputs));
  const auto effects = figures(response, inputs, [&](const Contribution& c) {
    return c.main_effect ? std::optional(*c.main_effect > chance ? *c.main_effect : 0.0)
                         : std::nullopt;
  });
  if (!effects) return {};
  Ranking r = ranked(Ranking::Basis::MainEffect, *effects, *effects);
  r.apart = std::max(0.0, 1.0 - r.shares.sum());
  return r;
}

}  // namespace

std::optional<double> larger_change(const Contribution& c) {
  if (!c.low && !c.high) return {};
  return std::max(std::abs(c.low.value_or(0.0)), std::abs(c.high.value_or(0.0)));
}

Ranking change_ranking(const ResponseBudget& response, std::size_t inputs) {
  const double floor = response.response == Response::InTolerance ? 0.0 : numerical_floor;
  const auto squares = figures(response, inputs, [&](const Contribution& c) {
    const std::optional<double> change = larger_change(c);
    return change ? std::optional(*change >= floor ? squared(*change) : 0.0) : std::nullopt;
  });
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(Eigen::Index(inputs));
  return squares ? ranked(Ranking::Basis::Change, *squares) : ranked(Ranking::Basis::None, none);
}

double chance_correlation(const ResponseBudget& response) {
  return response.answers ? 4.0 / std::sqrt(double(response.answers->cases)) : 0.0;
}

Ranking ranking(const ResponseBudget& response, std::size_t inputs) {
  if (response.response != Response::InTolerance && response.answers &&
      response.answers->standard_deviation.value < numerical_floor)
    return {};
  if (const auto sobol = sobol_ranking(response, inputs)) return *sobol;
  Ranking change = change_ranking(response, inputs);
  if (change.basis != Ranking::Basis::None) return change;
  return main_effect_ranking(response, inputs).value_or(Ranking{});
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
    case Ranking::Basis::Sobol:
      return "the variance, first-order Sobol indices";
    case Ranking::Basis::Change:
      return "the sum of squares, one at a time";
    case Ranking::Basis::MainEffect:
      return "the variance, by line and parabola of each input";
    case Ranking::Basis::Map:
      return "the mean square of the map that inputs make";
  }
  return "";
}

const char* apart_of(Ranking::Basis basis) {
  switch (basis) {
    case Ranking::Basis::Sobol:
      return "interactions of inputs";
    case Ranking::Basis::MainEffect:
      return "of no input alone";
    default:
      return "";
  }
}

std::vector<int> dominating(const Ranking& ranking) {
  constexpr std::size_t most = 3;
  std::vector<int> inputs;
  double sum = 0.0;
  for (std::size_t k = 0; k < std::min(most, ranking.order.size()); ++k) {
    const int i = ranking.order[k];
    if (!(ranking.shares[i] > 0.0)) continue;
    inputs.push_back(i);
    sum += ranking.shares[i];
  }
  return sum >= 0.5 ? inputs : std::vector<int>{};
}

std::vector<ParetoBar> pareto(const Ranking& ranking, std::size_t most) {
  std::vector<int> order = ranking.order;
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return std::abs(ranking.shares[a]) > std::abs(ranking.shares[b]);
  });
  std::vector<ParetoBar> bars;
  ParetoBar others{ParetoBar::Kind::Others, 0, 0, 0.0};
  for (const int i : order) {
    if (bars.size() < most) {
      bars.push_back({ParetoBar::Kind::Input, i, 1, ranking.shares[i]});
    } else {
      ++others.many;
      others.share += ranking.shares[i];
    }
  }
  if (others.many > 0) bars.push_back(others);
  if (*apart_of(ranking.basis) != '\0')
    bars.push_back({ParetoBar::Kind::Apart, 0, 1, ranking.apart});
  return bars;
}

}  // namespace abbe::sim::study
