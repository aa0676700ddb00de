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
constexpr Index map_block_numbers = Index(1) << 21;  // of maps in memory: 16 MB per thread

/// Returns the part of a map for the vertices first .. first + count - 1, with only the members
/// that `maps` reads.
InfluenceMap vertex_block(const InfluenceMap& whole, Index first, Index count) {
  InfluenceMap part;
  const auto begin = whole.first.begin() + first;
  const Index first_pass = *begin, pass_count = *(begin + count) - first_pass;
  part.first.assign(begin, begin + count + 1);
  for (Index& pass : part.first) pass -= first_pass;
  part.distance = whole.distance.segment(first_pass, pass_count);
  part.half_curvature = whole.half_curvature.segment(first_pass, pass_count);
  part.slope = whole.slope.middleCols(first_pass, pass_count);
  part.shift = whole.shift.middleCols(first_pass, pass_count);
  part.centre = whole.centre;
  return part;
}

/// Returns the standard deviation of the linear map in closed form. (n)
Eigen::VectorXd linear_deviation(const Study& study, const InfluenceMap& influence) {
  const Eigen::MatrixXd G = effects(influence);
  const Eigen::VectorXd sd = spreads(study);
  std::vector<bool> is_independent(std::size_t(G.rows()), true);
  for (const Copula::Group& group : study.copula.groups())
    for (const int i : group.of) is_independent[std::size_t(i)] = false;
  Eigen::VectorXd deviation = Eigen::VectorXd::Constant(G.cols(), none);
  tbb::parallel_for(Index(0), G.cols(), [&](Index v) {
    if (!is_cut(influence, v)) return;
    double variance = 0.0;
    for (Index i = 0; i < G.rows(); ++i)
      if (is_independent[std::size_t(i)]) variance += std::pow(G(i, v) * sd[i], 2);
    // In a group S = sd F F^T sd. The variance is then a sum of squares, never negative for any
    // rank.
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

Eigen::MatrixXd input_covariance(const Study& study) {
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
  const Uncertainty settings = study.uncertainty.value_or(Uncertainty{});
  const Index n = Index(influence.first.size()) - 1;
  const Eigen::VectorXd empty = Eigen::VectorXd::Constant(n, none);
  UncertaintyMap map{linear_deviation(study, influence),
                     empty,
                     empty,
                     empty,
                     settings.confidence,
                     settings.machines};
  const Sequence sequence{Sampling::Sobol, int(study.inputs.size()),
                          study.seed ^ uncertainty_stream};
  const Eigen::MatrixXd x = draw_inputs(study, points(sequence, 0, Index(settings.machines)));
  const double tail = 0.5 * (1.0 - settings.confidence);
  const Index block_size = std::max<Index>(1, map_block_numbers / x.cols());
  tbb::parallel_for(Index(0), (n + block_size - 1) / block_size, [&](Index block) {
    const Index first = block * block_size, count = std::min(block_size, n - first);
    const Eigen::MatrixXd block_maps = maps(vertex_block(influence, first, count), x);
    std::vector<double> residuals(std::size_t(x.cols()));  // of all machines at a vertex
    for (Index v = first; v < first + count; ++v) {
      if (!is_cut(influence, v)) continue;
      for (Index k = 0; k < x.cols(); ++k)
        residuals[std::size_t(k)] = block_maps(v - first, k) - influence.error_free[v];
      map.drawn[v] = sample_standard_deviation(residuals);
      std::sort(residuals.begin(), residuals.end());
      map.low[v] = sorted_quantile(residuals, tail);
      map.high[v] = sorted_quantile(residuals, 1.0 - tail);
    }
  });
  return map;
}

nlohmann::ordered_json to_json(const InfluenceMap& influence, const UncertaintyMap& uncertainty) {
  // Weighted by area, except the maximum.
  double area = 0.0, squares = 0.0, drawn_squares = 0.0, widths = 0.0, max_deviation = 0.0;
  for (Index v = 0; v < uncertainty.standard_deviation.size(); ++v) {
    if (!is_cut(influence, v)) continue;
    const double weight = influence.design.area[v];
    const double deviation = uncertainty.standard_deviation[v];
    area += weight;
    squares += weight * deviation * deviation;
    drawn_squares += weight * uncertainty.drawn[v] * uncertainty.drawn[v];
    widths += weight * (uncertainty.high[v] - uncertainty.low[v]);
    max_deviation = std::max(max_deviation, deviation);
  }
  const auto um = [&](double value) {
    return area > 0.0 ? nlohmann::ordered_json(value / units::um) : nlohmann::ordered_json();
  };
  return {{"confidence_percent", 100.0 * uncertainty.confidence},
          {"machines", uncertainty.machines},
          {"standard_deviation_rms_um", um(std::sqrt(squares / area))},
          {"standard_deviation_largest_um", um(max_deviation)},
          {"drawn_standard_deviation_rms_um", um(std::sqrt(drawn_squares / area))},
          {"band_mean_width_um", um(widths / area)}};
}

namespace {

using Eigen::VectorXd;

// Each step has its own machines, so that factors which fit the machines of one step by chance fail
// in the next.
constexpr std::uint64_t shape_stream = 0x3c6ef372fe94f82bULL;
constexpr std::uint64_t scale_stream = 0xa54ff53a5f1d36f1ULL;
constexpr std::uint64_t verification_stream = 0x510e527fade682d1ULL;

constexpr Index machine_block = 256;  // machines drawn and evaluated together
// Limits of the number of machines that shape the factors.
constexpr std::uint64_t min_shaping = 4000, max_shaping = 20000;
constexpr int max_rounds = 12;
constexpr double min_cost_change = 1e-3;      // relative; a smaller change ends the rounds
constexpr double fine = 1e-5, coarse = 1e-3;  // relative tolerances of factors

/// Random machines. They are drawn again whenever they are needed, because a million of them with
/// 2000 inputs would take 16 GB.
struct Machines {
  const Study& study;
  const ResponseFunction& response;
  Sequence sequence;
  std::uint64_t count;

  /// Returns the deviations of machines from the centres of the inputs. (inputs x number)
  Eigen::MatrixXd deviations(std::uint64_t first, Index number) const {
    return draw_inputs(study, points(sequence, first, number)).colwise() - centre(study);
  }
  /// Returns the inputs of machines whose deviations are multiplied by factors. (inputs x number)
  Eigen::MatrixXd scaled(const VectorXd& factors, const Eigen::MatrixXd& deviations) const {
    return (factors.asDiagonal() * deviations).colwise() + centre(study);
  }
};

/// Returns random machines of a study.
/// @param stream  makes the seed of the study that of an independent sequence
Machines machines(const Study& study, const ResponseFunction& response, Sampling sampling,
                  std::uint64_t stream, std::uint64_t count) {
  return {study, response, {sampling, int(study.inputs.size()), study.seed ^ stream}, count};
}

/// Returns the responses of all machines with scaled deviations. A machine without a response
/// exceeds every limit.
VectorXd scaled_responses(const Machines& all_machines, const VectorXd& factors) {
  VectorXd values(Index(all_machines.count));
  tbb::parallel_for(Index(0), (values.size() + machine_block - 1) / machine_block, [&](Index i) {
    const Index first = i * machine_block, number = std::min(machine_block, values.size() - first);
    values.segment(first, number) = all_machines.response.values(
        all_machines.scaled(factors, all_machines.deviations(std::uint64_t(first), number)));
  });
  for (double& value : values)
    if (!std::isfinite(value)) value = std::numeric_limits<double>::max();
  return values;
}

/// Returns the rank, from 0, of the response at the quantile `confidence`.
Index quantile_rank(double confidence, Index count) {
  // The factor avoids the next rank if the product is rounded to just above an integer.
  const double included = std::ceil(confidence * double(count) * (1.0 - 1e-14));
  return std::clamp<Index>(Index(included) - 1, 0, count - 1);
}

/// Returns the quantile of the response minus the limit, mm.
double excess(const Machines& all_machines, const VectorXd& factors) {
  const Tolerance& tolerance = *all_machines.study.tolerance;
  VectorXd values = scaled_responses(all_machines, factors);
  const auto quantile = values.begin() + quantile_rank(tolerance.confidence, values.size());
  std::nth_element(values.begin(), quantile, values.end());
  return *quantile - tolerance.limit;
}

/// A factor and its excess.
struct SearchPoint {
  double factor = 0.0;
  double excess = 0.0;
};

/// Returns the largest factor whose excess is not positive, to a relative tolerance. The method is
/// false position (Illinois variant), which needs few evaluations of thousands of machines; every
/// third step bisects, which bounds their number.
/// @param from, to  ends of the search: excess <= 0 at the first, > 0 at the second
template <typename Excess>
double largest_feasible_factor(const Excess& excess_at, SearchPoint from, SearchPoint to,
                               double guess, double tolerance) {
  int last_side = 0;
  for (int i = 0; i < 200 && to.factor - from.factor > tolerance * to.factor; ++i) {
    const double margin = 0.5 * tolerance * to.factor;
    if (i % 3 == 2) guess = 0.5 * (from.factor + to.factor);
    guess = std::clamp(guess, from.factor + margin, to.factor - margin);
    const double value = excess_at(guess);
    SearchPoint& replaced = value <= 0.0 ? from : to;
    SearchPoint& retained = value <= 0.0 ? to : from;
    const int side = value <= 0.0 ? -1 : 1;
    replaced = {guess, value};
    if (last_side == side) retained.excess *= 0.5;
    last_side = side;
    guess = from.factor + (to.factor - from.factor) * from.excess / (from.excess - to.excess);
    if (!std::isfinite(guess)) guess = 0.5 * (from.factor + to.factor);
  }
  return from.factor;
}

/// Returns the sum of the inputs' costs with scaled spreads.
double total_cost(const Study& study, const VectorXd& factors) {
  double cost = 0.0;
  for (Index i = 0; i < factors.size(); ++i) cost += study.inputs[std::size_t(i)].cost / factors[i];
  return cost;
}

/// Returns the factors of a shape at a scale, limited to 1.
VectorXd clipped(const VectorXd& shape, double scale) { return (scale * shape).cwiseMin(1.0); }

/// Returns the scale at which the excess is zero if it grows linearly.
double linear_scale(double floor_excess, double full_excess) {
  return floor_excess / (floor_excess - full_excess);
}

/// Returns the largest factors of a shape with which the machines stay within the limit.
/// @param floor_excess  excess with zero spreads
/// @param full_excess   excess with unchanged spreads
VectorXd scaled_to_limit(const Machines& all_machines, const VectorXd& shape, double floor_excess,
                         double full_excess, double guess, double tolerance) {
  if (full_excess <= 0.0) return VectorXd::Ones(shape.size());
  const double max_scale = 1.0 / shape.minCoeff();
  const auto excess_at = [&](double scale) { return excess(all_machines, clipped(shape, scale)); };
  return clipped(shape, largest_feasible_factor(excess_at, {0.0, floor_excess},
                                                {max_scale, full_excess}, guess, tolerance));
}

/// Returns the machines whose responses are nearest in rank to the quantile at the confidence.
std::vector<Index> near_limit(const Machines& all_machines, const VectorXd& values) {
  std::vector<Index> order(std::size_t(values.size()));
  std::iota(order.begin(), order.end(), Index(0));
  std::sort(order.begin(), order.end(), [&](Index a, Index b) {
    return values[a] != values[b] ? values[a] < values[b] : a < b;
  });
  const double confidence = all_machines.study.tolerance->confidence;
  const Index rank = quantile_rank(confidence, values.size());
  // Half as many machines as there are beyond the quantile, to either side of it, are near enough
  // to represent it; but at least 32 machines or an eighth of all.
  const Index half = std::max(Index(0.5 * (1.0 - confidence) * double(values.size())),
                              std::min<Index>(32, values.size() / 8));
  const Index first = std::max<Index>(0, rank - half);
  const Index last = std::min(values.size() - 1, rank + half);
  return {order.begin() + first, order.begin() + last + 1};
}

/// Returns the mean without the contribution of chance: zero within two standard errors, almost
/// unchanged far beyond them (positive-part James-Stein estimator with doubled shrinkage).
double shrunk_mean(const Eigen::ArrayXd& values) {
  const auto n = double(values.size());
  double mean = 0.0, sum_of_squares = 0.0;
  for (const double value : values) mean += value / n;
  for (const double value : values) sum_of_squares += (value - mean) * (value - mean);
  const double chance = 4.0 * sum_of_squares / (n * std::max(1.0, n - 1.0));
  return mean * mean > chance ? mean - chance / mean : 0.0;
}

/// Returns the derivatives of the response's quantile by the logarithms of the factors, mm. Each is
/// the mean of gradient times deviation over the machines near the quantile. Because a few hundred
/// machines do not determine the effect of a small input among many, the deviation that linear
/// theory expects for the given response and gradient is used, corrected by the part of the sample
/// that exceeds chance.
VectorXd sensitivities(const Machines& all_machines, const VectorXd& factors) {
  const std::vector<Index> near_machines =
      near_limit(all_machines, scaled_responses(all_machines, factors));
  const Index p = factors.size(), count = Index(near_machines.size());
  Eigen::MatrixXd deviation(p, count);
  tbb::parallel_for(Index(0), count, [&](Index k) {
    deviation.col(k) = all_machines.deviations(std::uint64_t(near_machines[std::size_t(k)]), 1);
  });
  const Eigen::MatrixXd gradient =
      all_machines.response.gradients(all_machines.scaled(factors, deviation));
  const Eigen::MatrixXd S =
      factors.asDiagonal() * input_covariance(all_machines.study) * factors.asDiagonal();
  const Eigen::MatrixXd sampled = gradient.cwiseProduct(factors.asDiagonal() * deviation);
  Eigen::MatrixXd linear = gradient.cwiseProduct(S * gradient);
  for (Index k = 0; k < count; ++k) {
    double variance = 0.0, change = 0.0;
    for (Index i = 0; i < p; ++i) {
      variance += linear(i, k);
      change += sampled(i, k);
    }
    linear.col(k) *= variance > 0.0 ? change / variance : 0.0;
  }
  VectorXd result(p);
  for (Index i = 0; i < p; ++i) {
    double sum = 0.0;
    for (Index k = 0; k < count; ++k) sum += linear(i, k);
    result[i] = sum / double(count) + shrunk_mean((sampled.row(i) - linear.row(i)).transpose());
  }
  return result;
}

/// Returns the shape of the next round. At the minimum of the cost for a given quantile, cost /
/// factor is proportional to the sensitivity. The sensitivity is assumed to grow with the square of
/// its factor, as in a norm of independent inputs, for which one round suffices; for sums each
/// round reduces the error to a third.
VectorXd next_shape(const Study& study, const VectorXd& factors, const VectorXd& sensitivity) {
  VectorXd shape(factors.size());
  for (Index i = 0; i < shape.size(); ++i)
    shape[i] = sensitivity[i] > 0.0 ? std::cbrt(study.inputs[std::size_t(i)].cost * factors[i] *
                                                factors[i] / sensitivity[i])
                                    : infinity;
  const double smallest = shape.minCoeff();
  if (!std::isfinite(smallest)) return factors;
  // The limit applies to inputs with almost no effect, which keep their spread.
  return (shape / smallest).cwiseMin(1e12);
}

/// Returns the scale of the shape at which the sum of the assumed sensitivities is unchanged.
double expected_scale(const VectorXd& factors, const VectorXd& sensitivity, const VectorXd& shape) {
  double current_sum = 0.0, next_sum = 0.0;
  for (Index i = 0; i < factors.size(); ++i) {
    const double s = std::max(0.0, sensitivity[i]);
    current_sum += s;
    next_sum += s * std::pow(shape[i] / factors[i], 2);
  }
  return next_sum > 0.0 ? std::sqrt(current_sum / next_sum) : 1.0;
}

/// Returns the factors of minimum cost, up to a common scale.
VectorXd cheapest_shape(const Machines& all_machines, double floor_excess) {
  const Index p = Index(all_machines.study.inputs.size());
  const VectorXd ones = VectorXd::Ones(p);
  const double full_excess = excess(all_machines, ones);
  VectorXd factors = scaled_to_limit(all_machines, ones, floor_excess, full_excess,
                                     linear_scale(floor_excess, full_excess), coarse);
  VectorXd best = factors;
  double cost = total_cost(all_machines.study, factors), min_cost = cost;
  if (!(full_excess > 0.0) || !std::isfinite(cost)) return ones;
  for (int round = 0; round < max_rounds; ++round) {
    const VectorXd sensitivity = sensitivities(all_machines, factors);
    const VectorXd shape = next_shape(all_machines.study, factors, sensitivity);
    factors = scaled_to_limit(all_machines, shape, floor_excess, full_excess,
                              expected_scale(factors, sensitivity, shape), coarse);
    const double last_cost = cost;
    cost = total_cost(all_machines.study, factors);
    if (!std::isfinite(cost)) break;
    if (cost < min_cost) best = factors, min_cost = cost;
    if (std::abs(cost - last_cost) <= min_cost_change * last_cost) break;
  }
  return best;
}

}  // namespace

Allocation allocation(const Study& study, const ResponseFunction& response) {
  const Tolerance& tolerance = *study.tolerance;
  const Index p = Index(study.inputs.size());
  const VectorXd zeros = VectorXd::Zero(p), ones = VectorXd::Ones(p);
  const double floor = response.values(centre(study))[0];
  Allocation result{tolerance, zeros, zeros, infinity, infinity, {}, {}, floor, false};
  const Machines search_machines =
      machines(study, response, Sampling::Sobol, scale_stream, tolerance.machines);
  const double floor_excess = floor - tolerance.limit, full_excess = excess(search_machines, ones);
  result.attainable = floor_excess < 0.0 || full_excess <= 0.0;
  if (!result.attainable) return result;
  result.equal = scaled_to_limit(search_machines, ones, floor_excess, full_excess,
                                 linear_scale(floor_excess, full_excess), fine);
  result.equal_cost = total_cost(study, result.equal);
  result.cheapest = result.equal;
  if (full_excess > 0.0) {
    const VectorXd shape =
        cheapest_shape(machines(study, response, Sampling::Sobol, shape_stream,
                                std::clamp(tolerance.machines, min_shaping, max_shaping)),
                       floor_excess);
    const VectorXd factors =
        scaled_to_limit(search_machines, shape, floor_excess, full_excess, 1.0, fine);
    if (total_cost(study, factors) < result.equal_cost) result.cheapest = factors;
  }
  result.cheapest_cost = total_cost(study, result.cheapest);
  const Machines new_machines =
      machines(study, response, Sampling::Random, verification_stream, tolerance.machines);
  result.equal_fraction =
      fraction_within_limit(scaled_responses(new_machines, result.equal), tolerance.limit);
  result.cheapest_fraction =
      fraction_within_limit(scaled_responses(new_machines, result.cheapest), tolerance.limit);
  return result;
}

Allocation allocation(const Study& study, const PreparedConfiguration& ready,
                      const InfluenceMap& influence) {
  return allocation(study, response_function(study, ready, influence, study.tolerance->response));
}

}  // namespace abbe::sim::study
