// Cost of the milled surface a vertex and a move, and how it grows.
//   surface_bench [vertices [repetitions]]

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <string>

#include <tbb/global_control.h>

#include "cutting/surface.h"
#include "tests/bench/wave.h"

namespace abbe::cutting {
namespace {

constexpr double side = 100.0;  // mm

Design wave(int per_side) { return bench::wave(side, per_side); }

/// The underside of a plate below the wave, which no move reaches.
Design underside(int per_side) {
  Design design = wave(per_side);
  design.vertices.col(2).setConstant(-10.0);
  design.normals.rowwise() = -Eigen::RowVector3d::UnitZ();
  return design;
}

double seconds(const Design& design, const Cutter& cutter, const CutterMotion& motion,
               int repetitions) {
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < repetitions; ++i) {
    const auto start = std::chrono::steady_clock::now();
    const Surface surface = milled_surface(design, cutter, motion);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    best = std::min(best, taken.count());
    if (surface.residual.size() != design.vertices.rows()) std::abort();
  }
  return best;
}

void report(const char* name, const Cutter& cutter, bool upright, int per_side, int passes,
            int repetitions, const std::function<Design(int)>& made = wave) {
  const Design design = made(per_side);
  const CutterMotion motion =
      bench::wave_motion(cutter, {.side = side, .passes = passes, .upright = upright});
  const double build = seconds(wave(0), cutter, motion, repetitions);
  const double all = seconds(design, cutter, motion, repetitions);
  const double vertices = double(per_side) * per_side;
  const double moves = double(passes) * passes;
  std::printf(
      "%-22s %9.0f vertices %9.0f moves  build %7.1f ms (%5.0f ns/move)  all %7.3f s"
      " (%6.0f ns/vertex)\n",
      name, vertices, moves, 1e3 * build, 1e9 * build / moves, all, 1e9 * (all - build) / vertices);
}

}  // namespace
}  // namespace abbe::cutting

int main(int argc, char** argv) {
  using namespace abbe::cutting;
  const int vertices = argc > 1 ? std::atoi(argv[1]) : 1'000'000;
  const int repetitions = argc > 2 ? std::atoi(argv[2]) : 3;
  const int n = int(std::lround(std::sqrt(double(vertices))));
  const Cutter ball{5, 5, 20};
  const Cutter bull_nose{5, 1, 20};
  for (const std::size_t threads : {1, 2}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    std::printf("%zu thread(s)\n", threads);
    report("ball, three axes", ball, true, n, 201, repetitions);
    report("ball, five axes", ball, false, n, 201, repetitions);
    report("bull-nose, five axes", bull_nose, false, n, 201, repetitions);
    report("bull-nose, three axes", bull_nose, true, n, 201, repetitions);
    report("flat end, five axes", {5, 0, 20}, false, n, 201, repetitions);
    report("ball, three axes", ball, true, n / 4, 201, repetitions);
    report("ball, few vertices", ball, false, 141, 224, repetitions);
    report("ball, many moves", ball, true, n / 2, 1001, repetitions);
    report("bull-nose, many moves", bull_nose, false, n / 4, 1001, repetitions);
    report("ball, underside", ball, false, n / 4, 201, repetitions, underside);
    report("ball, its many moves", ball, false, n / 4, 1001, repetitions, underside);
    report("bull-nose, underside", bull_nose, false, n / 4, 201, repetitions, underside);
  }
}
