// Cost of the milled surface a vertex and a move, and how it grows.
//   surface_bench [vertices [repetitions [part of the names that are measured]]]

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <string>

#include <tbb/global_control.h>

#include "cutting/surface/surface.h"
#include "kinematics/units.h"
#include "tests/bench/wave.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

constexpr double side = 100.0;  // mm
std::string measured;           // part of the names

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

void report(const char* name, const Cutter& cutter, const CutterMotion& motion,
            const Design& design, int repetitions) {
  if (std::string(name).find(measured) == std::string::npos) return;
  const double build = seconds(wave(0), cutter, motion, repetitions);
  const double all = seconds(design, cutter, motion, repetitions);
  const double vertices = double(design.vertices.rows()), moves = double(motion.tip.rows());
  std::printf(
      "%-24s %9.0f vertices %9.0f moves  build %7.1f ms (%5.0f ns/move)  all %7.3f s"
      " (%6.0f ns/vertex)\n",
      name, vertices, moves, 1e3 * build, 1e9 * build / moves, all, 1e9 * (all - build) / vertices);
}

void report(const char* name, const Cutter& cutter, bool upright, int per_side, int passes,
            int repetitions, const std::function<Design(int)>& made = wave) {
  report(name, cutter,
         bench::wave_motion(cutter, {.side = side, .passes = passes, .upright = upright}),
         made(per_side), repetitions);
}

/// A cone that widens downwards from 20 mm at the top, 20 mm high, by the flank of a cylindrical
/// cutter in one turn: every vertex sees the whole flank of every move beside it.
constexpr double cone_lean = 0.2;  // rad

Vector3d cone_normal(double around) {
  return {std::cos(around) * std::cos(cone_lean), std::sin(around) * std::cos(cone_lean),
          std::sin(cone_lean)};
}
Vector3d cone_point(double around, double down) {
  const double radius = 20.0 + down * std::tan(cone_lean);
  return {radius * std::cos(around), radius * std::sin(around), -down};
}

Design cone(int per_side) {
  Design design = wave(per_side);
  for (int k = 0; k < per_side * per_side; ++k) {
    const double around = 2 * pi * (k % per_side + 0.5) / per_side;
    design.vertices.row(k) = cone_point(around, 20.0 * (k / per_side + 0.5) / per_side);
    design.normals.row(k) = cone_normal(around);
  }
  return design;
}

CutterMotion around_cone(const Cutter& cutter, int moves) {
  CutterMotion motion{.tip = Points(moves + 1, 3),
                      .axis = Points(moves + 1, 3),
                      .time_s = Eigen::VectorXd::LinSpaced(moves + 1, 0.0, 100.0),
                      .line = std::vector<int>(std::size_t(moves) + 1, 1)};
  for (int k = 0; k <= moves; ++k) {
    const double around = 2 * pi * k / moves;
    const Vector3d up = (cone_point(around, 0.0) - cone_point(around, 1.0)).normalized();
    motion.axis.row(k) = up;
    motion.tip.row(k) = cone_point(around, 22.0) + cutter.radius * cone_normal(around);
  }
  return motion;
}

}  // namespace
}  // namespace abbe::cutting

int main(int argc, char** argv) {
  using namespace abbe::cutting;
  namespace bench = abbe::bench;
  const int vertices = argc > 1 ? std::atoi(argv[1]) : 1'000'000;
  const int repetitions = argc > 2 ? std::atoi(argv[2]) : 3;
  if (argc > 3) measured = argv[3];
  const int n = int(std::lround(std::sqrt(double(vertices))));
  const Cutter ball{5, 5, 20};
  const Cutter bull_nose{5, 1, 20};
  const double lean = 5 * abbe::units::deg;
  const AptCutter tapered_ball{.diameter = 6 * (1 - std::sin(lean)) / std::cos(lean),
                               .corner = 3,
                               .radial = 0,
                               .axial = 3,
                               .flank = lean,
                               .height = 20};
  const std::vector<OutlinePoint> barrel{{{1.0, 0}}, {{2.4, 0.5}, 2.4}, {{2.4, 14.5}, 20}};
  for (const std::size_t threads : {1, 2}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    std::printf("%zu thread(s)\n", threads);
    report("ball, three axes", ball, true, n, 201, repetitions);
    report("ball, five axes", ball, false, n, 201, repetitions);
    report("bull-nose, five axes", bull_nose, false, n, 201, repetitions);
    report("bull-nose, three axes", bull_nose, true, n, 201, repetitions);
    report("flat end, five axes", {5, 0, 20}, false, n, 201, repetitions);
    for (const auto& [name, cutter] :
         {std::pair{"ball, into the feed", ball}, {"bull-nose, into the feed", bull_nose}}) {
      const bench::WaveRaster both{
          .side = side, .passes = 201, .upright = false, .lead = 0.5, .into_feed = true};
      report(name, cutter, bench::wave_motion(cutter, both), wave(n), repetitions);
    }
    report("flank of a cone", {5, 1, 30}, around_cone({5, 1, 30}, 40400), cone(n), repetitions);
    report("tapered ball", form_cutter(apt_outline(tapered_ball)), false, n, 201, repetitions);
    report("barrel", form_cutter(outline_from_points(barrel)), false, n, 201, repetitions);
    report("ball, three axes", ball, true, n / 4, 201, repetitions);
    report("ball, few vertices", ball, false, 141, 224, repetitions);
    report("ball, many moves", ball, true, n / 2, 1001, repetitions);
    report("bull-nose, many moves", bull_nose, false, n / 4, 1001, repetitions);
    report("ball, underside", ball, false, n / 4, 201, repetitions, underside);
    report("ball, its many moves", ball, false, n / 4, 1001, repetitions, underside);
    report("bull-nose, underside", bull_nose, false, n / 4, 201, repetitions, underside);
  }
}
