#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "sim/study/influence.h"

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
inline FlatMachine flat(Study study, const Eigen::MatrixXd& slope) {
  const Eigen::Index n = slope.cols();
  InfluenceMap map;
  for (Eigen::Index v = 0; v <= n; ++v) map.first.push_back(v);
  map.status.assign(std::size_t(n), cutting::VertexStatus::Cut);
  map.design.area = Eigen::VectorXd::Ones(n);
  map.design.area[0] = 2.0;
  map.error_free = Eigen::VectorXd::Zero(n);
  map.distance = Eigen::VectorXd::Zero(n);
  map.half_curvature = Eigen::VectorXd::Zero(n);
  map.slope = slope;
  map.shift = Eigen::MatrixXd::Zero(slope.rows(), n);
  map.centre = centre(study);
  return {std::move(study), std::move(map)};
}

inline std::vector<Distribution> normals(int p, double spread = 1.0) {
  return std::vector<Distribution>(std::size_t(p), {Distribution::Kind::Normal, 0.0, spread});
}

/// Smooth random slopes with one to three passes at every vertex, some curved, some vertices uncut,
/// and an error-free map.
inline FlatMachine random_machine(Study study, Eigen::Index n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const Eigen::Index p = Eigen::Index(study.inputs.size());
  const auto field = [&](Eigen::Index) { return unit(random); };
  InfluenceMap map;
  map.first = {0};
  std::vector<Eigen::Index> competing_passes;
  for (Eigen::Index v = 0; v < n; ++v) {
    const bool uncut = v % 17 == 3;
    competing_passes.push_back(uncut ? 0 : 1 + Eigen::Index(std::abs(field(v)) * 2.99));
    map.first.push_back(map.first.back() + competing_passes.back());
    map.status.push_back(uncut ? cutting::VertexStatus::Uncut : cutting::VertexStatus::Cut);
  }
  const Eigen::Index m = map.first.back();
  map.design.area = Eigen::VectorXd::NullaryExpr(n, field).array().abs() + 0.1;
  map.error_free = 1e-3 * Eigen::VectorXd::NullaryExpr(n, field);
  map.distance.resize(m);
  map.half_curvature = 0.05 * Eigen::VectorXd::NullaryExpr(m, field).cwiseAbs();
  map.slope.resize(p, m);
  map.shift.resize(p, m);
  const Eigen::VectorXd wave = Eigen::VectorXd::NullaryExpr(p, field);
  for (Eigen::Index v = 0; v < n; ++v)
    for (Eigen::Index r = map.first[std::size_t(v)]; r < map.first[std::size_t(v) + 1]; ++r) {
      const bool nearest = r == map.first[std::size_t(v)];
      map.distance[r] =
          nearest ? 2e-3 * unit(random) : map.distance[r - 1] + 4e-3 * std::abs(unit(random));
      for (Eigen::Index i = 0; i < p; ++i) {
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
inline double figure(const InfluenceMap& influence, Response response, const Eigen::VectorXd& map) {
  double area = 0.0, first = 0.0, square = 0.0, low = INFINITY, high = -INFINITY;
  for (Eigen::Index v = 0; v < map.size(); ++v) {
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
  return {[&influence, response](const Eigen::MatrixXd& x) {
            const Eigen::MatrixXd all = maps(influence, x);
            Eigen::VectorXd values(x.cols());
            for (Eigen::Index k = 0; k < x.cols(); ++k)
              values[k] = figure(influence, response, all.col(k));
            return values;
          },
          [&influence, response](const Eigen::MatrixXd& x) {
            return gradients(influence, response, x);
          }};
}

}  // namespace abbe::sim::study
