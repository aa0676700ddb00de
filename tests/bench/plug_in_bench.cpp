// What a sample costs that a plug-in corrects: the table of scenes/compensators as a Python program
// and as a shared library, by the size of a batch. Most of it for the program is Python's own
// arithmetic.
//   plug_in_bench [samples]

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "sim/compensation/plug_in.h"

namespace abbe::sim::compensation {
namespace {

namespace fs = std::filesystem;

struct Asked {
  PlugInTask task;
  std::vector<kinematics::AxisState> commands;
  std::vector<kinematics::Pose> T_wt;
};

Asked five_axes(int samples) {
  Asked asked;
  asked.task.structure = "w C' b X Y Z A t";
  for (const char name : {'C', 'X', 'Y', 'Z', 'A'}) {
    kinematics::Joint joint;
    joint.name = name;
    asked.task.joints.push_back(joint);
  }
  for (int i = 0; i < samples; ++i) {
    kinematics::AxisState state;
    state.time_s = 0.01 * i;
    state.q = kinematics::AxisVector::NullaryExpr(
        5, [&](Eigen::Index j) { return 100 * std::sin(0.013 * i + double(j)); });
    asked.commands.push_back(state);
    asked.T_wt.push_back(kinematics::motion(
        (kinematics::Deviation() << state.q.head<3>(), 0.1, 0.2, 0.3).finished(), {1, 2, 3}));
  }
  return asked;
}

double seconds(const fs::path& plug_in, const Asked& asked, int batch) {
  PlugInOptions options;
  options.batch_size = batch;
  const auto start = std::chrono::steady_clock::now();
  ask(plug_in, asked.task, {asked.commands, asked.T_wt}, options);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void print_costs(const fs::path& plug_in, int samples) {
  double start = seconds(plug_in, five_axes(0), 1);
  for (int i = 0; i < 5; ++i) start = std::min(start, seconds(plug_in, five_axes(0), 1));
  std::printf("%s: %.0f ms to start and end\n", plug_in.filename().c_str(), 1e3 * start);
  for (const int batch : {1, 10, 100, 1000, 10000}) {
    const int n = std::min(samples, 2000 * batch);
    const double all = seconds(plug_in, five_axes(n), batch);
    std::printf("  batches of %5d: %7.2f us a sample\n", batch, 1e6 * (all - start) / n);
  }
}

int run(int samples) {
  const fs::path source = ABBE_SOURCE_DIR;
  const fs::path library =
      fs::temp_directory_path() / ("abbe_plug_in_bench_" + std::to_string(samples) + ".so");
  const std::string command = ABBE_C_COMPILER " -std=c99 -shared -fPIC -O2 -I '" +
                              (source / "sim/compensation").string() + "' -o '" + library.string() +
                              "' '" + (source / "scenes/compensators/table.c").string() + "'";
  if (std::system(command.c_str()) != 0) return 1;
  print_costs(library, samples);
  print_costs(source / "scenes/compensators/table.py", samples);
  fs::remove(library);
  return 0;
}

}  // namespace
}  // namespace abbe::sim::compensation

int main(int argc, char** argv) {
  using namespace abbe::sim::compensation;
  if (const auto code = plug_in_host(argc, argv)) return *code;
  return run(argc > 1 ? std::max(1, std::atoi(argv[1])) : 100000);
}
