#pragma once

#include "sim/study/budget.h"
#include "tests/test.h"

namespace abbe::sim::study::test {

/// What a synthetic budget is made of.
struct Synthetic {
  int inputs = 46;
  int configurations = 2;
  std::string prefix = "EXX[1] straightness of the slide ";  ///< of the names of inputs
  bool map = true;
};

inline IntervalEstimate band(double value, double half) {
  return {value, value - half, value + half};
}

/// Influence of an input: falls from the first to the last.
inline double effect(int input) { return 4e-3 * std::pow(0.8, input); }

inline ResponseStatistics scaled_responses(const VectorXd& v) {
  ResponseStatistics a;
  const double mean = v.mean();
  const double sd = std::sqrt((v.array() - mean).square().sum() / double(v.size() - 1));
  a.cases = v.size();
  a.mean = band(mean, 2.0 * sd / std::sqrt(double(v.size())));
  a.standard_deviation = band(sd, 0.05 * sd);
  a.min = v.minCoeff();
  a.max = v.maxCoeff();
  a.median = band(mean, 0.1 * sd);
  a.p95 = band(mean + 1.645 * sd, 0.1 * sd);
  a.p99 = band(mean + 2.326 * sd, 0.2 * sd);
  return a;
}

inline Study study_of(const Synthetic& options) {
  Study s;
  s.title = "gantry dome: what its errors cost";
  s.seed = 7;
  for (int a = 0; a < options.configurations; ++a) {
    const std::string name = a == 0   ? "uncompensated"
                             : a == 1 ? "perfect-iterated-ideal"
                                      : "3 h identified-decoupled-program " + std::to_string(a);
    s.configurations.push_back({name, "", name});
  }
  s.responses = {Response::Pv, Response::Rms, Response::InTolerance};
  s.limits = {{Response::Pv, 20e-3}};
  for (int i = 0; i < options.inputs; ++i) {
    Input input;
    input.name = options.prefix + std::to_string(i);
    input.unit = i % 3 == 0 ? "um" : (i % 3 == 1 ? "urad" : "");
    input.settings = {{"errors.EXX.0.coefficients_um.1", 1.0}};
    input.distribution.centre = i % 2;
    input.distribution.spread = 1.0 + 0.1 * i;
    input.cost = 1.0 + i;
    s.inputs.push_back(input);
  }
  s.one_at_a_time = OneAtATime{};
  s.monte_carlo = MonteCarlo{};
  s.sobol = SobolAnalysis{};
  s.worst_case = WorstCase{};
  return s;
}

inline IndexConvergence convergence_of(int inputs) {
  IndexConvergence c;
  for (int points = 8; points <= 1024; points *= 2) {
    c.base_points.push_back(points);
    std::vector<SobolIndex> row;
    for (int i = 0; i < inputs; ++i) {
      const double truth = 0.36 * std::pow(0.64, i), off = 0.6 / std::sqrt(double(points));
      row.push_back({band(truth * (1.0 + 0.3 * off * std::cos(points + i)), 0.6 * off),
                     band(1.05 * truth * (1.0 + 0.3 * off * std::sin(points + i)), 0.6 * off)});
    }
    c.indices.push_back(row);
  }
  return c;
}

inline ResponseBudget response_of(Response response, const Synthetic& options, double scale) {
  ResponseBudget r;
  r.response = response;
  const double unit = response == Response::InTolerance ? -1e3 : scale;
  r.base = response == Response::InTolerance ? 96.0 : 3.2e-3 * scale;
  r.index_convergence = convergence_of(options.inputs);
  double squares = 0.0, sum = 0.0;
  for (int i = 0; i < options.inputs; ++i) {
    Contribution c;
    c.input = i;
    c.low = (i % 4 == 3 ? 0.6 : -0.9) * unit * effect(i);
    c.high = unit * effect(i);
    c.sobol = r.index_convergence->indices.back()[std::size_t(i)];
    c.correlation = (i % 2 ? -1.0 : 1.0) * 0.6 * std::pow(0.8, i);
    c.rank_correlation = *c.correlation * 0.97;
    squares += *c.high * *c.high;
    sum += std::abs(*c.high);
    r.contributions.push_back(c);
  }
  r.root_sum_square = std::sqrt(squares);
  r.sum = sum;
  r.worst = r.base + 2.5 * sum;
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(r.base + 0.5 * std::sqrt(squares),
                                          0.6 * std::sqrt(squares));
  r.values = VectorXd::NullaryExpr(2000, [&] { return std::abs(normal(random)); });
  r.answers = scaled_responses(r.values);
  if (response == Response::Pv) {
    r.limit = 12e-3;
    r.fraction_within = IntervalEstimate{0.913, 0.9, 0.925};
    r.capability = 0.72;
  }
  return r;
}

inline Allocation allocation_of(int inputs) {
  Allocation a;
  a.asked = {Response::Pv, 12e-3, 0.95, 4000};
  a.equal = VectorXd::Constant(inputs, 0.71);
  a.cheapest =
      VectorXd::NullaryExpr(inputs, [](Index i) { return std::min(1.0, 0.3 + 0.07 * double(i)); });
  a.equal_cost = inputs * (inputs + 1) / 2.0 / 0.71;
  a.cheapest_cost = 0.0;
  for (int i = 0; i < inputs; ++i) a.cheapest_cost += (1.0 + i) / a.cheapest[i];
  a.equal_fraction = {0.951, 0.944, 0.957};
  a.cheapest_fraction = {0.949, 0.942, 0.956};
  a.floor = 3.2e-3;
  return a;
}

/// A budget that has everything.
inline Budget compute_budget(const Synthetic& options = {}) {
  Budget b;
  b.study = study_of(options);
  b.cases = 52345;
  b.failed = 3;
  for (int k = 0; k < options.configurations; ++k) {
    const double scale = k == 0 ? 1.0 : 0.35;
    ConfigurationBudget arm;
    arm.arm = b.study.configurations[std::size_t(k)];
    for (const Response response : b.study.responses)
      arm.responses.push_back(
          response_of(response, options, response == Response::Rms ? 0.2 * scale : scale));
    double sum = 0.0;
    for (int i = 0; i < options.inputs; ++i) sum += effect(i) * effect(i);
    for (int i = 0; options.map && i < options.inputs; ++i)
      arm.maps.push_back({0.2 * scale * effect(i), scale * effect(i), effect(i) * effect(i) / sum});
    if (options.map) {
      arm.map_rms = 1.4e-3 * scale;
      arm.map_mean_rms = 0.4e-3 * scale;
      arm.flagged_percent = 0.7;
    }
    if (k == 0) arm.allocation = allocation_of(options.inputs);
    b.configurations.push_back(arm);
  }
  b.proofs = {{"uncompensated", Response::Pv, 50, 0, 0.23},
              {"uncompensated", Response::Rms, 50, 0, 0.11}};
  b.study.sweeps = {{0, VectorXd::LinSpaced(9, -4.0, 4.0)}};
  SweepResult sweep;
  for (int k = 0; k < options.configurations; ++k) {
    std::vector<VectorXd> answers;
    for (const Response response : b.study.responses) {
      const double unit = response == Response::InTolerance ? -1e3 : 1.0;
      answers.push_back((b.study.sweeps[0].values.array().square() * 1e-3 * unit / (k + 1)) +
                        (unit < 0.0 ? 96.0 : 3.2e-3));
    }
    sweep.answers.push_back(answers);
  }
  b.sweeps = {sweep};
  b.warnings = {"3 cases have no answer: the tool touches nothing"};
  return b;
}

}  // namespace abbe::sim::study::test
