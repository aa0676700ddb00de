// Cost of a thermal history: three hours with a knot a second, and how it grows with knots and
// nodes; then what one instant, one sensor and one sample of the elements cost.
//   thermal_bench [repetitions]

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>

#include <fmt/format.h>

#include "errors/thermal_elements.h"
#include "errors/thermal_run.h"

namespace abbe::errors {
namespace {

using Eigen::VectorXd;

/// A row of nodes, each linked to the next two and to the room, every fourth to the coolant.
ThermalNetwork row_of(int nodes) {
  ThermalNetwork network;
  for (int i = 0; i < nodes; ++i) {
    network.nodes.push_back({"node " + std::to_string(i), 1e3 * (1 + i % 7) * (1 + i % 7)});
    network.surroundings.push_back({i, Surroundings::Room, 2.0 + i % 5});
    if (i % 4 == 0) network.surroundings.push_back({i, Surroundings::Coolant, 5.0});
    for (int j = i + 1; j < std::min(i + 3, nodes); ++j)
      network.links.push_back({i, j, 10.0 + (i + j) % 11});
    network.sources.push_back({i, CuttingHeat{0.5 / nodes}});
  }
  network.sources.push_back({0, SpindleHeat{800.0, 1257.0, 1.5}});
  network.start_T_C = VectorXd::Constant(nodes, 20.0);
  return network;
}

/// A knot a second, coolant on and off every ten minutes.
std::vector<Activity> busy(int knots) {
  std::vector<Activity> all(static_cast<std::size_t>(knots));
  for (int i = 0; i < knots; ++i) {
    Activity& knot = all[std::size_t(i)];
    knot.time_s = i;
    knot.spindle_speed = 1257.0 * (0.5 + 0.5 * std::sin(0.01 * i));
    knot.cutting_power_W = 500.0 * (i % 13) / 13.0;
    knot.room_T_C = 20.0 + std::sin(3e-4 * i);
    knot.coolant = i / 600 % 2 == 1;
  }
  return all;
}

template <typename Work>
double seconds(int repetitions, Work work) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repetitions; ++i) {
    const auto start = std::chrono::steady_clock::now();
    if (!std::isfinite(work())) std::abort();
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    best = std::min(best, taken.count());
  }
  return best;
}

void report_history(int nodes, int knots, int repetitions) {
  const ThermalNetwork network = row_of(nodes);
  const std::vector<Activity> activity = busy(knots);
  const double modes = seconds(
      repetitions, [&] { return simulate(network, std::span(activity).first(1)).T_C.sum(); });
  const double all =
      seconds(repetitions, [&] { return simulate(network, activity).T_C.bottomRows(1).sum(); });
  fmt::print("{:4} nodes {:8} knots  modes {:8.2f} ms  all {:9.2f} ms  ({:6.2f} us/knot)\n", nodes,
             knots, 1e3 * modes, 1e3 * all, 1e6 * (all - modes) / knots);
}

void report_instants(int nodes, int repetitions) {
  const ThermalRun run = simulate(row_of(nodes), busy(10'801));
  constexpr int n = 100'000;
  const double instants = seconds(repetitions, [&] {
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += temperatures(run, 0.108 * i)[0];
    return sum;
  });
  const TemperatureSensor sensor{.name = "T", .node = nodes / 2, .noise_K = 0.01, .lag_s = 20.0};
  const VectorXd times = VectorXd::LinSpaced(10'801, 0.0, 10'800.0);
  const double sensing = seconds(repetitions, [&] { return readings(sensor, run, times).sum(); });
  fmt::print("{:4} nodes: temperatures {:.2f} us/instant, a sensor over 3 h {:.1f} ms\n", nodes,
             1e6 * instants / n, 1e3 * sensing);
}

kinematics::Chain three_slides() {
  std::vector<kinematics::Joint> joints(3);
  for (int i = 0; i < 3; ++i) {
    joints[std::size_t(i)].name = char('X' + i);
    joints[std::size_t(i)].direction_b = Eigen::Vector3d::Unit(i);
  }
  return {joints, kinematics::Pose::Identity(), kinematics::Pose::Identity()};
}

void report_elements(int repetitions) {
  ThermalErrors errors;
  for (const char axis : {'X', 'Y', 'Z'}) {
    for (const char direction : {'X', 'Y', 'Z', 'A', 'B', 'C'}) {
      ThermalElement element;
      element.name = {direction, axis, false};
      element.offset.terms = {{0, std::nullopt, 1e-3, std::nullopt}, {1, 2, 1e-4, std::nullopt}};
      element.slope.terms = {{3, std::nullopt, 1e-6, std::nullopt}};
      errors.elements.push_back(element);
    }
    errors.expansions.push_back({axis, Feedback::Motor, Expansion{4, 11.7e-6, 0.0}, std::nullopt});
  }
  const ThermalModel model = bind(errors, three_slides(), 20);
  const VectorXd T_C = VectorXd::LinSpaced(20, 18.0, 40.0);
  const kinematics::AxisVector q = Eigen::Vector3d(100, 200, 300);
  constexpr int n = 1'000'000;
  const double taken = seconds(repetitions, [&] {
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += deviations(model, q, T_C)[0].motion[0];
    return sum;
  });
  fmt::print("18 elements and 3 screws: {:.0f} ns/sample\n", 1e9 * taken / n);
}

}  // namespace
}  // namespace abbe::errors

int main(int argc, char** argv) {
  using namespace abbe::errors;
  const int repetitions = argc > 1 ? std::max(1, std::atoi(argv[1])) : 3;
  for (const int nodes : {5, 10, 20, 40, 80, 160, 200}) report_history(nodes, 10'801, repetitions);
  for (const int knots : {1'081, 108'001, 1'080'001}) report_history(20, knots, repetitions);
  for (const int nodes : {5, 20, 80}) report_instants(nodes, repetitions);
  report_elements(repetitions);
}
