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

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;

constexpr double side = 100.0;  // mm

Vector3d wave_normal(double x, double y) {
  const double dx = 0.2 * std::cos(x / 10) * std::cos(y / 10);
  const double dy = -0.2 * std::sin(x / 10) * std::sin(y / 10);
  return Vector3d(-dx, -dy, 1).normalized();
}

/// z = 2 sin(x/10) cos(y/10), 100 x 100 mm.
Vector3d wave_point(double x, double y) { return {x, y, 2 * std::sin(x / 10) * std::cos(y / 10)}; }

Design wave(int per_side) {
  Design design;
  const int n = per_side * per_side;
  design.vertices.resize(n, 3);
  design.normals.resize(n, 3);
  for (int j = 0; j < per_side; ++j)
    for (int i = 0; i < per_side; ++i) {
      const double x = side * (i + 0.5) / per_side;
      const double y = side * (j + 0.5) / per_side;
      design.vertices.row(j * per_side + i) = wave_point(x, y);
      design.normals.row(j * per_side + i) = wave_normal(x, y);
    }
  return design;
}

/// The underside of a plate below the wave, which no move reaches.
Design underside(int per_side) {
  Design design = wave(per_side);
  design.vertices.col(2).setConstant(-10.0);
  design.normals.rowwise() = -Eigen::RowVector3d::UnitZ();
  return design;
}

/// Serpentine raster with the corner circle touching the wave; the axis is upright, or leads by
/// `lead` rad from the normal along x.
CutterMotion raster(const Cutter& cutter, int passes, bool upright, double lead) {
  const int n = passes * passes;
  CutterMotion motion{.tip = Points(n, 3),
                      .axis = Points(n, 3),
                      .time_s = Eigen::VectorXd(n),
                      .line = std::vector<int>(n)};
  for (int j = 0; j < passes; ++j)
    for (int i = 0; i < passes; ++i) {
      const int k = j * passes + i;
      const double x = side * (j % 2 == 0 ? i : passes - 1 - i) / (passes - 1);
      const double y = side * j / (passes - 1);
      const Vector3d normal = wave_normal(x, y);
      const Vector3d along = (Vector3d::UnitX() - normal.x() * normal).normalized();
      const Vector3d axis = upright ? Vector3d::UnitZ().eval()
                                    : Vector3d(std::cos(lead) * normal + std::sin(lead) * along);
      const Vector3d across = normal - normal.dot(axis) * axis;
      const double ring = cutter.radius - cutter.corner_radius;
      const Vector3d tip = wave_point(x, y) + cutter.corner_radius * (normal - axis) +
                           (across.norm() > 1e-12 ? ring : 0.0) * across.stableNormalized();
      motion.tip.row(k) = tip;
      motion.axis.row(k) = axis.normalized();
      motion.time_s[k] = 0.01 * k;
      motion.line[k] = k + 1;
    }
  return motion;
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
  const CutterMotion motion = raster(cutter, passes, upright, 10 * 3.14159265358979 / 180);
  const Design none{.vertices = Points(0, 3),
                    .normals = Points(0, 3),
                    .triangles = {},
                    .area = {},
                    .facet_error = {},
                    .judged = {}};
  const double build = seconds(none, cutter, motion, repetitions);
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
