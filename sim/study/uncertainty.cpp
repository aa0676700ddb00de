#include "sim/study/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <tbb/parallel_for.h>

#include "kinematics/numbers.h"
#include "kinematics/units.h"
#include "sim/study/answers.h"
#include "sim/study/plan.h"

namespace abbe::sim::study {
namespace {

using Eigen::Index;

constexpr std::uint64_t uncertainty_stream = 0x8c1f3b5ad96e7043ULL;
constexpr Index numbers_at_once = Index(1) << 21;  // of a map of many machines: 16 MB a thread
/// The vertices first .. first + count - 1 alone, as far as maps need them.
InfluenceMap stretch(const InfluenceMap& whole, Index first, Index count) {
  InfluenceMap part;
  const auto begin = whole.first.begin() + first;
  const Index from = *begin, rivals = *(begin + count) - from;
  part.first.assign(begin, begin + count + 1);
  for (Index& at : part.first) at -= from;
  part.distance = whole.distance.segment(from, rivals);
  part.half_curvature = whole.half_curvature.segment(from, rivals);
  part.slope = whole.slope.middleCols(from, rivals);
  part.shift = whole.shift.middleCols(from, rivals);
  part.centre = whole.centre;
  return part;
}

/// (n) the closed form.
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
    // S is sd F F^T sd in a group: a sum of squares, which stays above 0 whatever its rank.
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
      map.drawn[v] = deviation_of(of_vertex);
      std::sort(of_vertex.begin(), of_vertex.end());
      map.low[v] = quantile_in(of_vertex, tail);
      map.high[v] = quantile_in(of_vertex, 1.0 - tail);
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

}  // namespace abbe::sim::study
