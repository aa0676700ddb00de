// What one correction costs on one thread, for the gantry of Guo 2016 with all its elements:
// beliefs and chains a second, corrections by strategy, growth with the number of elements, near
// its pole.
//   compensate_bench [repetitions]

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "errors/geometric.h"
#include "sim/compensation/correct.h"
#include "tests/compensation/believed.h"

namespace abbe::sim::compensation {
namespace {

using kinematics::AxisState;
using kinematics::Chain;
using kinematics::Pose;

constexpr std::uint64_t seed = 20260110;
constexpr int commands = 20000;

/// Nanoseconds of work(i) per command: the commands in short lots, each timed so often and the
/// quickest taken, so that what else the computer does counts little.
template <typename Work>
double best_ns(int repetitions, const Work& work) {
  constexpr int lot = 500;
  double sum = 0.0;
  for (int first = 0; first < commands; first += lot) {
    double best = std::numeric_limits<double>::infinity();
    for (int k = 0; k < repetitions; ++k) {
      const auto start = std::chrono::steady_clock::now();
      for (int i = first; i < first + lot; ++i) work(std::size_t(i));
      const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
      best = std::min(best, taken.count());
    }
    sum += best;
  }
  return 1e9 * sum / commands;
}

struct Task {
  std::vector<AxisState> commands;
  std::vector<Pose> T_wt;
};

/// Commands all over the workspace, or with the tool held at one tilt.
Task task(const Chain& gantry, double min_A, double max_A) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Task task;
  for (int i = 0; i < commands; ++i) {
    AxisState state;
    state.q.resize(6);
    const double a = unit(random);
    state.q << pi * unit(random), 250 * unit(random), 250 * unit(random), 250 * unit(random),
        std::copysign(min_A + (max_A - min_A) * std::abs(a), a), 0.0;
    task.commands.push_back(state);
    task.T_wt.push_back(gantry.tool_in_workpiece(state.q));
  }
  return task;
}

struct Cost {
  double ns = 0.0;
  double beliefs = 0.0;  ///< evaluated per correction
  double remaining_point_error = 0.0;
  double remaining_direction_error = 0.0;
};

Cost cost(const Chain& gantry, const errors::GeometricModel& model, const Task& task,
          const CorrectOptions& options, int repetitions) {
  const Belief belief = believed(gantry, model);
  Cost cost;
  cost.ns = best_ns(repetitions, [&](std::size_t i) {
    const Correction one = correct(gantry, belief, task.T_wt[i], task.commands[i], options);
    cost.remaining_point_error = std::max(cost.remaining_point_error, one.remaining_point_error);
    cost.remaining_direction_error =
        std::max(cost.remaining_direction_error, one.remaining_direction_error);
  });
  std::size_t asked = 0;
  const Belief counted = [&](const AxisState& state) {
    ++asked;
    return belief(state);
  };
  for (int i = 0; i < commands; ++i)
    (void)correct(gantry, counted, task.T_wt[i], task.commands[i], options);
  cost.beliefs = double(asked) / commands;
  return cost;
}

void print(const std::string& name, const Cost& cost) {
  fmt::print("{:<44} {:>8.0f} ns {:>6.2f} beliefs {:>9.2e} um {:>9.2e} urad left\n", name, cost.ns,
             cost.beliefs, 1e3 * cost.remaining_point_error, 1e6 * cost.remaining_direction_error);
}

/// The nominal chain, the chain with deviations, and what it takes to know them.
void poses(const Chain& gantry, const errors::GeometricModel& model, const Task& task,
           int repetitions) {
  double sum = 0.0;
  const auto& at = task.commands;
  const double nominal = best_ns(repetitions, [&](std::size_t i) {
    sum += gantry.tool_in_workpiece(at[i].q).translation().x();
  });
  const auto fixed = errors::deviations(model, at.front());
  const double chain = best_ns(repetitions, [&](std::size_t i) {
    sum += gantry.tool_in_workpiece(at[i].q, fixed).translation().x();
  });
  const double elements = best_ns(repetitions, [&](std::size_t i) {
    sum += errors::deviations(model, at[i]).front().motion[0];
  });
  const double whole = best_ns(repetitions, [&](std::size_t i) {
    sum += gantry.tool_in_workpiece(at[i].q, errors::deviations(model, at[i])).translation().x();
  });
  for (const auto& [name, ns] : {std::pair{"pose of the nominal chain", nominal},
                                 std::pair{"pose of the chain with deviations", chain},
                                 std::pair{"deviations of 46 elements", elements},
                                 std::pair{"pose with 46 elements, a belief", whole}})
    fmt::print("{:<44} {:>8.0f} ns {:>6.2f} M/s\n", name, ns, 1e3 / ns);
  if (sum == 0.5) fmt::print("\n");  // so that nothing above is left out
}

void strategies(const Chain& gantry, const errors::GeometricModel& model, const Task& task,
                int repetitions) {
  CorrectOptions options;
  options.functional_height = 5.0;
  for (const auto& [name, strategy] :
       {std::pair{"position only", Strategy::Position},
        std::pair{"decoupled, one step", Strategy::Decoupled},
        std::pair{"iterated to 0.01 nm and 1e-12 rad", Strategy::Iterated}}) {
    options.strategy = strategy;
    print(name, cost(gantry, model, task, options, repetitions));
  }
}

void growth(const Chain& gantry, const Task& task, int repetitions) {
  const errors::GeometricErrors all = typical_errors(gantry, seed);
  for (const std::size_t count : {0, 6, 12, 18, 30, 46}) {
    errors::GeometricErrors some = all;
    some.elements.resize(count);
    print(fmt::format("iterated with {} elements", count),
          cost(gantry, errors::bind(some, gantry), task, {}, repetitions));
  }
}

int run(int repetitions) {
  const Chain gantry = machines::gantry();
  const errors::GeometricModel model = errors::bind(typical_errors(gantry, seed), gantry);
  fmt::print("{} elements, {} commands, quickest of {}, one thread\n", model.elements.size(),
             commands, repetitions);
  const Task anywhere = task(gantry, 0.1, 1.4);
  poses(gantry, model, anywhere, repetitions);
  strategies(gantry, model, anywhere, repetitions);
  growth(gantry, anywhere, repetitions);
  print("iterated at the pole, A = 0", cost(gantry, model, task(gantry, 0, 0), {}, repetitions));
  print("iterated near the pole, |A| < 1 deg",
        cost(gantry, model, task(gantry, 0, units::deg), {}, repetitions));
  return 0;
}

}  // namespace
}  // namespace abbe::sim::compensation

int main(int argc, char** argv) {
  return abbe::sim::compensation::run(argc > 1 ? std::max(1, std::atoi(argv[1])) : 9);
}
