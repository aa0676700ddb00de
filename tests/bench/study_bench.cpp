// What a machine costs in a study of gantry_dome: from influence maps, by growth in machines,
// inputs and vertices, and cut in full. `study_bench [MACHINES] [RUNS]`
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>

#include "sim/study/case_plan.h"

namespace {

using namespace abbe::sim::study;

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// A study of every number of every element of the machine.
Study dome(int vertices, std::size_t inputs, std::uint64_t machines, const char* engine) {
  const auto file = std::filesystem::temp_directory_path() / "abbe_study_bench.toml";
  std::ofstream(file) << fmt::format(
      "scene = \"{}/scenes/gantry_dome.toml\"\n"
      "set = {{ part.vertices = {}, sampling.chord_tolerance_nm = 50, sampling.max_step_mm = 1000 "
      "}}\n"
      "engine = \"{}\"\n[influence]\nchecks = 0\n[monte_carlo]\ncases = {}\n"
      "[[inputs]]\nevery = \"number\"\nspread = 1\nlow = -3\nhigh = 3\n",
      ABBE_SOURCE_DIR, vertices, engine, machines);
  Study study = read_study(file);
  std::filesystem::remove(file);
  if (study.inputs.size() > inputs) study.inputs.resize(inputs);
  study.copula = Copula(int(study.inputs.size()));
  return study;
}

/// Seconds that all cases of a study take, as the farm does them.
double farmed(const PreparedStudy& ready) {
  const double start = seconds();
  std::size_t rows = 0;
  farm(make_batches(ready.plan), {}, batch_computation(ready),
       [&](const Batch&, const std::vector<Row>& done) { rows += done.size(); });
  if (rows != ready.plan.cases) std::abort();
  return seconds() - start;
}

void influence(int vertices, std::size_t inputs, std::uint64_t machines) {
  double start = seconds();
  const PreparedStudy ready = prepare_study(dome(vertices, inputs, machines, "influence"));
  const double made = seconds() - start;
  const double taken = farmed(ready);
  const InfluenceMap& map = ready.influences.front();
  fmt::print(
      "{:>8} machines {:>7} vertices {:>8} rivals {:>4} inputs: map {:6.2f} s, machines "
      "{:7.2f} s, {:7.1f} us each\n",
      machines, map.design.vertices.rows(), map.distance.size(), ready.study.inputs.size(), made,
      taken, 1e6 * taken / double(machines));
}

void full(int vertices, std::uint64_t runs) {
  const PreparedStudy ready = prepare_study(dome(vertices, 100, runs, "full"));
  const double taken = farmed(ready);
  fmt::print(
      "{:>8} full runs {:>6} vertices {:>6} moves {:>7} samples: {:7.2f} s, {:6.1f} ms each\n",
      runs, ready.configurations[0].job.design_w.vertices.rows(),
      ready.configurations[0].job.path.motion_blocks,
      ready.configurations[0].job.samples.states.size(), taken, 1e3 * taken / double(runs + 1));
}

}  // namespace

int main(int argc, char** argv) {
  const std::uint64_t machines = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 100000;
  const std::uint64_t runs = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1000;
  for (const std::uint64_t part : {100, 10})
    influence(10000, 100, std::max<std::uint64_t>(machines / part, 2));
  for (const std::size_t inputs : {25, 50}) influence(10000, inputs, machines / 10);
  for (const int vertices : {2500, 5000}) influence(vertices, 100, machines / 10);
  influence(10000, 100, machines);
  for (const int vertices : {5000, 20000, 80000})
    full(vertices, std::max<std::uint64_t>(runs / 20, 2));
  full(20000, runs);
}
