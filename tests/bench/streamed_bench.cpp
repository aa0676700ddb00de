// The surface of a motion that is made in blocks: time and memory, and those of the whole motion at
// once where it is asked for.
//   streamed_bench [moves [vertices [moves a block [whole]]]]     (5 000 000, 1 000 000, 1 000 000)
// 100 000 000 moves take some minutes.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include <sys/resource.h>

#include "cutting/surface/machined_surface.h"
#include "tests/bench/wave.h"

namespace abbe::bench {
namespace {

constexpr double side = 100.0;  // mm

double peak_gib() {
  ::rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return double(usage.ru_maxrss) / (1024.0 * 1024.0);
}

cutting::MotionBlocks blocks_of(const cutting::Cutter& cutter, const WaveRaster& raster,
                                long moves) {
  return [&cutter, raster, moves, next = 0L]() mutable -> std::optional<cutting::MotionBlock> {
    const long last = long(raster.passes) * raster.passes - 1, first = next;
    if (first >= last) return std::nullopt;
    next = std::min(first + moves, last);
    return cutting::MotionBlock{wave_motion(cutter, raster, first, next),
                                double(next) / double(last)};
  };
}

struct Size {
  int passes = 0;
  int per_side = 0;
  long block = 0;
  bool whole = false;
};

void report(const char* name, const cutting::Cutter& cutter, bool upright, const Size& size) {
  const WaveRaster raster{.side = side, .passes = size.passes, .upright = upright};
  const cutting::Design design = wave(side, size.per_side);
  const double before = peak_gib();
  const auto start = std::chrono::steady_clock::now();
  const cutting::Surface surface =
      size.whole ? cutting::milled_surface(design, cutter, wave_motion(cutter, raster))
                 : cutting::streamed_surface(design, cutter,
                                             [&] { return blocks_of(cutter, raster, size.block); });
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  double sum = 0.0;  // the same for the same surface
  for (Eigen::Index i = 0; i < surface.residual.size(); ++i)
    sum += surface.residual[i] * surface.cut_time_s[i];
  const double moves = double(size.passes) * size.passes - 1;
  std::printf("%-22s %11.0f moves %9.0f vertices  %7.1f s  peak %6.3f GiB, %6.3f of design  %a\n",
              name, moves, double(design.vertices.rows()), taken.count(), peak_gib(), before, sum);
  std::fflush(stdout);
}

}  // namespace
}  // namespace abbe::bench

int main(int argc, char** argv) {
  using namespace abbe::bench;
  const auto number = [&](int at, double usual) { return argc > at ? std::atof(argv[at]) : usual; };
  const Size size{.passes = int(std::lround(std::sqrt(number(1, 5e6)))),
                  .per_side = int(std::lround(std::sqrt(number(2, 1e6)))),
                  .block = std::max(1L, std::lround(number(3, 1e6))),
                  .whole = argc > 4 && std::string(argv[4]) == "whole"};
  report("ball, three axes", {5, 5, 20}, true, size);
  report("bull-nose, five axes", {5, 1, 20}, false, size);
}
