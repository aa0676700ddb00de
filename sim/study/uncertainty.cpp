#include "sim/study/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <tbb/parallel_for.h>

#include "kinematics/units.h"
#include "sim/study/case_plan.h"
#include "sim/study/response_statistics.h"

namespace abbe::sim::study {

namespace {

using Eigen::Index;

constexpr std::uint64_t uncertainty_stream = 0x8c1f3b5ad96e7043ULL;
constexpr Index numbers_at_once = Index(1) << 21;  // of the maps of many machines: 16 MB a thread
/// Returns the part of a map for the vertices first .. first + count - 1, with only the members
/// that `maps` reads.
InfluenceMap stretch(const InfluenceMap& whole, Index first, Index count) {
  InfluenceMap part;
  const auto begin = whole.first.begin() + first;
  const Index from = *begin, competing_passes = *(begin + count) - from;
  part.first.assign(begin, begin + count + 1);
  for (Index& at : part.first) at -= from;
  part.distance = whole.distance.segment(from, competing_passes);
  part.half_curvature = whole.half_curvature.segment(from, competing_passes);
  part.slope = whole.slope.middleCols(from, competing_passes);
  part.shift = whole.shift.middleCols(from, competing_passes);
  part.centre = whole.centre;
  return part;
}

/// Returns the standard deviation of the linear map in closed form. (n)
Eigen::VectorXd linear_deviation(const Study& study, const InfluenceMap& influence) {
  const Eigen::MatrixXd G = effects(influence);
  const Eigen::VectorXd sd = spreads(study);
  std::vector<bool> alone(std::size_t(G.rows()), true);
  for (const Copula::Group& group : study.copula.groups())
    for (const int i : group.of) alone[std::size_t(i)] = false;
  Eigen::VectorXd deviation = Eigen::VectorXd::Constant(G.cols(), none);
  tbb::parallel_for(Index(0), G.cols(), [&](Index v) {
    if (!is_cut(influence, v)) return;
    double variance = 0.0;
    for (Index i = 0; i < G.rows(); ++i)
      if (alone[std::size_t(i)]) variance += std::pow(G(i, v) * sd[i], 2);
    // In a group S = sd F F^T sd, which gives a sum of squares: it stays above 0 for any rank.
    for (const Copula::Group& group : study.copula.groups())
      for (Index j = 0; j < group.factor.cols(); ++j) {
        double sum = 0.0;
        for (std::size_t i = 0; i < group.of.size(); ++i)
          sum += group.factor(Index(i), j) * sd[group.of[i]] * G(group.of[i], v);
        variance += sum * sum;
      }
    deviation[v] = std::sqrt(variance);
  });
  return deviation;
}

}  // namespace

Eigen::MatrixXd covariance_of(const Study& study) {
  const Eigen::VectorXd sd = spreads(study);
  Eigen::MatrixXd S = sd.cwiseAbs2().asDiagonal();
  for (const Copula::Group& group : study.copula.groups())
    for (std::size_t i = 0; i < group.of.size(); ++i)
      for (std::size_t j = 0; j < i; ++j) {
        double rho = 0.0;
        for (Index k = 0; k < group.factor.cols(); ++k)
          rho += group.factor(Index(i), k) * group.factor(Index(j), k);
        const int a = group.of[i], b = group.of[j];
        S(a, b) = S(b, a) = rho * sd[a] * sd[b];
      }
  return S;
}

UncertaintyMap uncertainty_map(const Study& study, const InfluenceMap& influence) {
  const Uncertainty asked = study.uncertainty.value_or(Uncertainty{});
  const Index n = Index(influence.first.size()) - 1;
  const Eigen::VectorXd empty = Eigen::VectorXd::Constant(n, none);
  UncertaintyMap map{
      linear_deviation(study, influence), empty, empty, empty, asked.confidence, asked.machines};
  const Sequence sequence{Sampling::Sobol, int(study.inputs.size()),
                          study.seed ^ uncertainty_stream};
  const Eigen::MatrixXd x = drawn(study, points(sequence, 0, Index(asked.machines)));
  const double tail = 0.5 * (1.0 - asked.confidence);
  const Index length = std::max<Index>(1, numbers_at_once / x.cols());
  tbb::parallel_for(Index(0), (n + length - 1) / length, [&](Index lot) {
    const Index first = lot * length, count = std::min(length, n - first);
    const Eigen::MatrixXd made = maps(stretch(influence, first, count), x);
    std::vector<double> of_vertex(std::size_t(x.cols()));
    for (Index v = first; v < first + count; ++v) {
      if (!is_cut(influence, v)) continue;
      for (Index k = 0; k < x.cols(); ++k)
        of_vertex[std::size_t(k)] = made(v - first, k) - influence.error_free[v];
      map.drawn[v] = sample_deviation(of_vertex);
      std::sort(of_vertex.begin(), of_vertex.end());
      map.low[v] = sorted_quantile(of_vertex, tail);
      map.high[v] = sorted_quantile(of_vertex, 1.0 - tail);
    }
  });
  return map;
}

nlohmann::ordered_json to_json(const InfluenceMap& influence, const UncertaintyMap& uncertainty) {
  double area = 0.0, square = 0.0, drawn_square = 0.0, width = 0.0, largest = 0.0;
  for (Index v = 0; v < uncertainty.standard_deviation.size(); ++v) {
    if (!is_cut(influence, v)) continue;
    const double weight = influence.design.area[v];
    const double deviation = uncertainty.standard_deviation[v];
    area += weight;
    square += weight * deviation * deviation;
    drawn_square += weight * uncertainty.drawn[v] * uncertainty.drawn[v];
    width += weight * (uncertainty.high[v] - uncertainty.low[v]);
    largest = std::max(largest, deviation);
  }
  const auto um = [&](double value) {
    return area > 0.0 ? nlohmann::ordered_json(value / units::um) : nlohmann::ordered_json();
  };
  return {{"confidence_percent", 100.0 * uncertainty.confidence},
          {"machines", uncertainty.machines},
          {"standard_deviation_rms_um", um(std::sqrt(square / area))},
          {"standard_deviation_largest_um", um(largest)},
          {"drawn_standard_deviation_rms_um", um(std::sqrt(drawn_square / area))},
          {"band_mean_width_um", um(width / area)}};
}

namespace {

using Eigen::VectorXd;

// The factors are shaped, scaled and verified on different machines, so that factors fitted to the
// chance of the first are not taken for good ones.
constexpr std::uint64_t shape_stream = 0x3c6ef372fe94f82bULL;
constexpr std::uint64_t scale_stream = 0xa54ff53a5f1d36f1ULL;
constexpr std::uint64_t verification_stream = 0x510e527fade682d1ULL;

constexpr Index draw_block = 256;  // machines drawn and evaluated together
// Limits of the number of machines that shape the factors.
constexpr std::uint64_t min_shaping = 4000, max_shaping = 20000;
constexpr int max_rounds = 12;
constexpr double settled = 1e-3;              // relative change of the cost that ends the rounds
constexpr double fine = 1e-5, coarse = 1e-3;  // relative tolerance of factors
/// Random machines, drawn again whenever they are needed: a million of them with 2000 inputs would
/// take 16 GB.
struct Machines {
  const Study& study;
  const ResponseFunction& response;
  Sequence sequence;
  std::uint64_t count;

  Eigen::MatrixXd deviations(std::uint64_t first, Index number) const {
    return drawn(study, points(sequence, first, number)).colwise() - centre(study);
  }
  Eigen::MatrixXd scaled(const VectorXd& factors, const Eigen::MatrixXd& deviations) const {
    return (factors.asDiagonal() * deviations).colwise() + centre(study);
  }
};

Machines machines(const Study& study, const ResponseFunction& response, Sampling sampling,
                  std::uint64_t stream, std::uint64_t count) {
  return {study, response, {sampling, int(study.inputs.size()), study.seed ^ stream}, count};
}

/// Returns the responses with scaled deviations. A machine without a response exceeds every limit.
VectorXd scaled_responses(const Machines& all, const VectorXd& factors) {
  VectorXd values(Index(all.count));
  tbb::parallel_for(Index(0), (values.size() + draw_block - 1) / draw_block, [&](Index i) {
    const Index first = i * draw_block, number = std::min(draw_block, values.size() - first);
    values.segment(first, number) =
        all.response.values(all.scaled(factors, all.deviations(std::uint64_t(first), number)));
  });
  for (double& value : values)
    if (!std::isfinite(value)) value = std::numeric_limits<double>::max();
  return values;
}

/// Returns the rank, from 0, of the response at or below which the fraction `confidence` of all
/// lies.
Index rank_of(double confidence, Index count) {
  // The factor keeps a product that rounds to just above an integer from taking the next rank.
  const double enough = std::ceil(confidence * double(count) * (1.0 - 1e-14));
  return std::clamp<Index>(Index(enough) - 1, 0, count - 1);
}

/// Returns the distance of the response's quantile from the limit, mm; positive beyond it.
double excess(const Machines& all, const VectorXd& factors) {
  const Tolerance& asked = *all.study.tolerance;
  VectorXd values = scaled_responses(all, factors);
  const auto at = values.begin() + rank_of(asked.confidence, values.size());
  std::nth_element(values.begin(), at, values.end());
  return *at - asked.limit;
}

/// A point of the search and the excess there.
struct Reached {
  double at = 0.0;
  double excess = 0.0;
};

/// Returns the largest number whose excess is not above 0, to a relative tolerance. Uses false
/// position (Illinois variant), which needs few evaluations of thousands of machines; every third
/// step bisects, which bounds their number.
/// @param from, to  ends of the search: excess <= 0 at the first, > 0 at the second
template <typename Excess>
double largest_feasible_factor(const Excess& excess_at, Reached from, Reached to, double guess,
                               double tolerance) {
  int side = 0;
  for (int i = 0; i < 200 && to.at - from.at > tolerance * to.at; ++i) {
    const double margin = 0.5 * tolerance * to.at;
    if (i % 3 == 2) guess = 0.5 * (from.at + to.at);
    guess = std::clamp(guess, from.at + margin, to.at - margin);
    const double value = excess_at(guess);
    Reached& near = value <= 0.0 ? from : to;
    Reached& other = value <= 0.0 ? to : from;
    const int now = value <= 0.0 ? -1 : 1;
    near = {guess, value};
    if (side == now) other.excess *= 0.5;
    side = now;
    guess = from.at + (to.at - from.at) * from.excess / (from.excess - to.excess);
    if (!std::isfinite(guess)) guess = 0.5 * (from.at + to.at);
  }
  return from.at;
}

double cost_of(const Study& study, const VectorXd& factors) {
  double cost = 0.0;
  for (Index i = 0; i < factors.size(); ++i) cost += study.inputs[std::size_t(i)].cost / factors[i];
  return cost;
}

/// Returns the factors of a shape at a scale, none above 1.
VectorXd clipped(const VectorXd& shape, double scale) { return (scale * shape).cwiseMin(1.0); }

/// Returns the scale at which the excess is zero if it grows linearly.
double even_scale(double floor_excess, double full_excess) {
  return floor_excess / (floor_excess - full_excess);
}

/// Returns the largest factors of a shape that the machines allow.
/// @param full_excess  excess with unchanged spreads
VectorXd scaled_to_limit(const Machines& all, const VectorXd& shape, double floor_excess,
                         double full_excess, double guess, double tolerance) {
  if (full_excess <= 0.0) return VectorXd::Ones(shape.size());
  const double last = 1.0 / shape.minCoeff();
  const auto at = [&](double scale) { return excess(all, clipped(shape, scale)); };
  return clipped(shape, largest_feasible_factor(at, {0.0, floor_excess}, {last, full_excess}, guess,
                                                tolerance));
}

/// Returns the machines whose responses are next to the quantile at the confidence.
std::vector<Index> near_limit(const Machines& all, const VectorXd& values) {
  std::vector<Index> order(std::size_t(values.size()));
  std::iota(order.begin(), order.end(), Index(0));
  std::sort(order.begin(), order.end(), [&](Index a, Index b) {
    return values[a] != values[b] ? values[a] < values[b] : a < b;
  });
  const double confidence = all.study.tolerance->confidence;
  const Index rank = rank_of(confidence, values.size());
  // Half of the machines beyond the quantile on either side: near enough to represent it. At least
  // 32 of them or an eighth of all.
  const Index half = std::max(Index(0.5 * (1.0 - confidence) * double(values.size())),
                              std::min<Index>(32, values.size() / 8));
  const Index first = std::max<Index>(0, rank - half);
  const Index last = std::min(values.size() - 1, rank + half);
  return {order.begin() + first, order.begin() + last + 1};
}

/// Returns the mean with the contribution of chance removed: zero within two standard errors,
/// unchanged far beyond them (positive-part James-Stein, doubled).
double shrunk_mean(const Eigen::ArrayXd& values) {
  const auto n = double(values.size());
  double mean = 0.0, squares = 0.0;
  for (const double value : values) mean += value / n;
  for (const double value : values) squares += (value - mean) * (value - mean);
  const double chance = 4.0 * squares / (n * std::max(1.0, n - 1.0));
  return mean * mean > chance ? mean - chance / mean : 0.0;
}

/// Returns the change of the response's quantile with the logarithm of every factor, mm: the mean
/// of gradient times deviation over the machines near the quantile. A few hundred machines say
/// little about a small input among many, so the deviation that linear theory expects for the given
/// response and gradient is used, corrected by the part of the sample that exceeds chance.
VectorXd sensitivities(const Machines& all, const VectorXd& factors) {
  const std::vector<Index> near = near_limit(all, scaled_responses(all, factors));
  const Index p = factors.size(), count = Index(near.size());
  Eigen::MatrixXd deviation(p, count);
  tbb::parallel_for(Index(0), count, [&](Index k) {
    deviation.col(k) = all.deviations(std::uint64_t(near[std::size_t(k)]), 1);
  });
  const Eigen::MatrixXd gradient = all.response.gradients(all.scaled(factors, deviation));
  const Eigen::MatrixXd S = factors.asDiagonal() * covariance_of(all.study) * factors.asDiagonal();
  const Eigen::MatrixXd seen = gradient.cwiseProduct(factors.asDiagonal() * deviation);
  Eigen::MatrixXd linear = gradient.cwiseProduct(S * gradient);
  for (Index k = 0; k < count; ++k) {
    double variance = 0.0, change = 0.0;
    for (Index i = 0; i < p; ++i) {
      variance += linear(i, k);
      change += seen(i, k);
    }
    linear.col(k) *= variance > 0.0 ? change / variance : 0.0;
  }
  VectorXd result(p);
  for (Index i = 0; i < p; ++i) {
    double sum = 0.0;
    for (Index k = 0; k < count; ++k) sum += linear(i, k);
    result[i] = sum / double(count) + shrunk_mean((seen.row(i) - linear.row(i)).transpose());
  }
  return result;
}

/// Returns the shape of the next round. Cost and quantile are stationary where cost / factor is
/// proportional to the sensitivity. Between rounds a sensitivity is assumed to grow with the square
/// of its factor, as in a norm of independent inputs, for which one round is enough; for sums each
/// round leaves a third of the error.
VectorXd next_shape(const Study& study, const VectorXd& factors, const VectorXd& sensitivity) {
  VectorXd shape(factors.size());
  for (Index i = 0; i < shape.size(); ++i)
    shape[i] = sensitivity[i] > 0.0 ? std::cbrt(study.inputs[std::size_t(i)].cost * factors[i] *
                                                factors[i] / sensitivity[i])
                                    : infinity;
  const double least = shape.minCoeff();
  if (!std::isfinite(least)) return factors;
  // An input with almost no effect keeps its spread.
  return (shape / least).cwiseMin(1e12);
}

/// Returns the scale of the shape at which the assumed sensitivities have the same sum as now.
double expected_scale(const VectorXd& factors, const VectorXd& sensitivity, const VectorXd& shape) {
  double now = 0.0, then = 0.0;
  for (Index i = 0; i < factors.size(); ++i) {
    const double s = std::max(0.0, sensitivity[i]);
    now += s;
    then += s * std::pow(shape[i] / factors[i], 2);
  }
  return then > 0.0 ? std::sqrt(now / then) : 1.0;
}

VectorXd cheapest_shape(const Machines& all, double floor_excess) {
  const Index p = Index(all.study.inputs.size());
  const VectorXd ones = VectorXd::Ones(p);
  const double full_excess = excess(all, ones);
  VectorXd factors = scaled_to_limit(all, ones, floor_excess, full_excess,
                                     even_scale(floor_excess, full_excess), coarse);
  VectorXd best = factors;
  double cost = cost_of(all.study, factors), least = cost;
  if (!(full_excess > 0.0) || !std::isfinite(cost)) return ones;
  for (int round = 0; round < max_rounds; ++round) {
    const VectorXd sensitivity = sensitivities(all, factors);
    const VectorXd shape = next_shape(all.study, factors, sensitivity);
    factors = scaled_to_limit(all, shape, floor_excess, full_excess,
                              expected_scale(factors, sensitivity, shape), coarse);
    const double before = cost;
    cost = cost_of(all.study, factors);
    if (!std::isfinite(cost)) break;
    if (cost < least) best = factors, least = cost;
    if (std::abs(cost - before) <= settled * before) break;
  }
  return best;
}

}  // namespace

Allocation allocation(const Study& study, const ResponseFunction& response) {
  const Tolerance& asked = *study.tolerance;
  const Index p = Index(study.inputs.size());
  const VectorXd none = VectorXd::Zero(p), ones = VectorXd::Ones(p);
  const double floor = response.values(centre(study))[0];
  Allocation result{asked, none, none, infinity, infinity, {}, {}, floor, false};
  const Machines all = machines(study, response, Sampling::Sobol, scale_stream, asked.machines);
  const double floor_excess = floor - asked.limit, full_excess = excess(all, ones);
  result.attainable = floor_excess < 0.0 || full_excess <= 0.0;
  if (!result.attainable) return result;
  result.equal = scaled_to_limit(all, ones, floor_excess, full_excess,
                                 even_scale(floor_excess, full_excess), fine);
  result.equal_cost = cost_of(study, result.equal);
  result.cheapest = result.equal;
  if (full_excess > 0.0) {
    const VectorXd shape =
        cheapest_shape(machines(study, response, Sampling::Sobol, shape_stream,
                                std::clamp(asked.machines, min_shaping, max_shaping)),
                       floor_excess);
    const VectorXd factors = scaled_to_limit(all, shape, floor_excess, full_excess, 1.0, fine);
    if (cost_of(study, factors) < result.equal_cost) result.cheapest = factors;
  }
  result.cheapest_cost = cost_of(study, result.cheapest);
  const Machines fresh =
      machines(study, response, Sampling::Random, verification_stream, asked.machines);
  result.equal_share = fraction_below(scaled_responses(fresh, result.equal), asked.limit);
  result.cheapest_share = fraction_below(scaled_responses(fresh, result.cheapest), asked.limit);
  return result;
}

Allocation allocation(const Study& study, const PreparedConfiguration& ready,
                      const InfluenceMap& influence) {
  return allocation(study, response_function(study, ready, influence, study.tolerance->response));
}

}  // namespace abbe::sim::study
