#pragma once

#include "sim/study/influence.h"
#include "tests/test.h"

namespace abbe::sim::study {

/// A flat part of n vertices, all of one area but the first, which has twice that, and its inputs.
struct FlatMachine {
  Study study;
  InfluenceMap influence;
};

inline Study study_of(const std::vector<Distribution>& distributions,
                      const std::vector<double>& costs = {},
                      const std::vector<Correlation>& correlations = {}) {
  Study study;
  for (std::size_t i = 0; i < distributions.size(); ++i) {
    Input input;
    input.name = "input " + std::to_string(i);
    input.distribution = distributions[i];
    if (!costs.empty()) input.cost = costs[i];
    study.inputs.push_back(input);
  }
  study.copula = Copula(int(distributions.size()), correlations);
  study.seed = 7;
  study.configurations = {{"uncompensated", "", "uncompensated"}};
  study.responses = {Response::Pv, Response::Rms};
  return study;
}

/// One pass a vertex. @param slope  (p x n)
inline FlatMachine flat(Study study, const MatrixXd& slope) {
  const Index n = slope.cols();
  InfluenceMap map;
  for (Index v = 0; v <= n; ++v) map.first.push_back(v);
  map.status.assign(std::size_t(n), cutting::VertexStatus::Cut);
  map.design.area = VectorXd::Ones(n);
  map.design.area[0] = 2.0;
  map.error_free = VectorXd::Zero(n);
  map.distance = VectorXd::Zero(n);
  map.half_curvature = VectorXd::Zero(n);
  map.slope = slope;
  map.shift = MatrixXd::Zero(slope.rows(), n);
  map.centre = centre(study);
  return {std::move(study), std::move(map)};
}

inline std::vector<Distribution> normals(int p, double spread = 1.0) {
  return std::vector<Distribution>(std::size_t(p), {Distribution::Kind::Normal, 0.0, spread});
}

/// Smooth random slopes with one to three passes at every vertex, some curved, some vertices uncut,
/// and an error-free map.
inline FlatMachine random_machine(Study study, Index n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const Index p = Index(study.inputs.size());
  const auto field = [&](Index) { return unit(random); };
  InfluenceMap map;
  map.first = {0};
  std::vector<Index> competing_passes;
  for (Index v = 0; v < n; ++v) {
    const bool uncut = v % 17 == 3;
    competing_passes.push_back(uncut ? 0 : 1 + Index(std::abs(field(v)) * 2.99));
    map.first.push_back(map.first.back() + competing_passes.back());
    map.status.push_back(uncut ? cutting::VertexStatus::Uncut : cutting::VertexStatus::Cut);
  }
  const Index m = map.first.back();
  map.design.area = VectorXd::NullaryExpr(n, field).array().abs() + 0.1;
  map.error_free = 1e-3 * VectorXd::NullaryExpr(n, field);
  map.distance.resize(m);
  map.half_curvature = 0.05 * VectorXd::NullaryExpr(m, field).cwiseAbs();
  map.slope.resize(p, m);
  map.shift.resize(p, m);
  const VectorXd wave = VectorXd::NullaryExpr(p, field);
  for (Index v = 0; v < n; ++v)
    for (Index r = map.first[std::size_t(v)]; r < map.first[std::size_t(v) + 1]; ++r) {
      const bool nearest = r == map.first[std::size_t(v)];
      map.distance[r] =
          nearest ? 2e-3 * unit(random) : map.distance[r - 1] + 4e-3 * std::abs(unit(random));
      for (Index i = 0; i < p; ++i) {
        map.slope(i, r) = std::sin(5.0 * wave[i] + 0.03 * double((i + 2) * v)) + 0.2 * unit(random);
        map.shift(i, r) = unit(random);
      }
    }
  map.slope *= 1e-3;
  map.shift *= 1e-2;
  map.centre = centre(study);
  return {std::move(study), std::move(map)};
}

/// Figures of a map, written again. @param map  (n) mm, NaN where not cut
inline double figure(const InfluenceMap& influence, Response response, const VectorXd& map) {
  double area = 0.0, first = 0.0, square = 0.0, low = INFINITY, high = -INFINITY;
  for (Index v = 0; v < map.size(); ++v) {
    if (std::isnan(map[v])) continue;
    const double h = map[v] - influence.error_free[v], a = influence.design.area[v];
    area += a;
    first += a * h;
    square += a * h * h;
    low = std::min(low, h);
    high = std::max(high, h);
  }
  switch (response) {
    case Response::Pv:
      return high - low;
    case Response::Rms:
      return std::sqrt(square / area);
    case Response::Mean:
      return first / area;
    case Response::Std:
      return std::sqrt(square / area - std::pow(first / area, 2));
    default:
      return std::max(high, -low);
  }
}

inline ResponseFunction function_of(const InfluenceMap& influence, Response response) {
  return {[&influence, response](const MatrixXd& x) {
            const MatrixXd all = maps(influence, x);
            VectorXd values(x.cols());
            for (Index k = 0; k < x.cols(); ++k)
              values[k] = figure(influence, response, all.col(k));
            return values;
          },
          [&influence, response](const MatrixXd& x) { return gradients(influence, response, x); }};
}

}  // namespace abbe::sim::study
