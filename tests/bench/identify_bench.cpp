// Cost of measuring and knowing the CXYZA gantry, and how it grows with the targets of a campaign
// and the order of its curves: plan and readings, the estimate with its covariance, the choice of
// orders.
//   identify_bench [repetitions]

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <limits>
#include <vector>

#include <fmt/format.h>

#include "errors/identification/estimate.h"
#include "errors/identification/model.h"
#include "errors/metrology/instrument.h"
#include "tests/metrology/machines.h"

namespace abbe::errors::identification {
namespace {

using metrology::Kind;
using metrology::Readings;

template <typename Work>
double best_s(int repetitions, const Work& work) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repetitions; ++i) {
    const auto start = std::chrono::steady_clock::now();
    work();
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    best = std::min(best, taken.count());
  }
  return best;
}

std::vector<Readings> campaign(const kinematics::Chain& gantry, int targets) {
  std::vector<Readings> all;
  const auto perfect = [&](const kinematics::AxisState& state) {
    return metrology::nominal_bodies(gantry, state.q);
  };
  for (const Kind kind : {Kind::Laser, Kind::Straightness, Kind::AngleOptics, Kind::Level,
                          Kind::Square, Kind::RTest}) {
    metrology::Instrument instrument = metrology::typical_instrument(kind);
    instrument.targets = targets;
    all.push_back(metrology::measure(metrology::plan(instrument, gantry), gantry, perfect, 1));
  }
  return all;
}

int run(int repetitions) {
  const kinematics::Chain gantry = metrology::machines::gantry();
  fmt::print("{:>8} {:>6} {:>9} {:>9} {:>16} {:>12} {:>16} {:>12}\n", "targets", "order",
             "readings", "numbers", "measure, us each", "estimate, s", "ns/(reading n)",
             "orders, s");
  for (const int targets : {11, 21, 41, 81}) {
    std::vector<Readings> readings;
    const double measuring = best_s(repetitions, [&] { readings = campaign(gantry, targets); });
    std::size_t count = 0;
    for (const Readings& one : readings) count += one.plan.measurements.size();
    for (const int order : {4, 8}) {
      ModelOptions options;
      options.order = order;
      const GeometricErrors model = error_model(gantry, options);
      Estimate found;
      const double estimating = best_s(repetitions, [&] { found = estimate(model, readings); });
      const double choosing =
          best_s(1, [&] { (void)choose_orders(readings, options, {.max_order = order}); });
      const auto numbers = double(found.names.size());
      fmt::print("{:>8} {:>6} {:>9} {:>9} {:>16.2f} {:>12.3f} {:>16.1f} {:>12.3f}\n", targets,
                 order, count, found.names.size(), 1e6 * measuring / double(count), estimating,
                 1e9 * estimating / (double(count) * numbers), choosing);
    }
  }
  return 0;
}

}  // namespace
}  // namespace abbe::errors::identification

int main(int argc, char** argv) {
  return abbe::errors::identification::run(argc > 1 ? std::max(1, std::atoi(argv[1])) : 3);
}
