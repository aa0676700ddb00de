// Cost of cutting a stock: dexels held against a sweep a second, looks at the engagement a second,
// and how they grow with the spacing and the number of moves. One thread.
//   stock_bench [moves]

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "cutting/stock/engagement.h"
#include "cutting/stock/force.h"
#include "cutting/stock/stock.h"

namespace abbe::cutting {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Serpentine over 100 x 100 mm, 3 mm below the top; the axis swings by `swing` rad either way.
Isometry3d pose_at(int i, int moves, double swing) {
  const double passes = 25.0, u = double(i) / moves * passes;
  const double pass = std::min(std::floor(u), passes - 1);
  const double along = (int(pass) % 2 == 0 ? u - pass : 1 - (u - pass)) * 100;
  Isometry3d T = Isometry3d::Identity();
  T.translation() = Vector3d(along, 2 + pass * 4, 17);
  T.linear() = (Eigen::AngleAxisd(swing * std::sin(0.01 * i), Vector3d::UnitX()) *
                Eigen::AngleAxisd(swing * std::cos(0.013 * i), Vector3d::UnitY()))
                   .toRotationMatrix();
  return T;
}

Stock block(double spacing, bool three) {
  return make_stock(BoxBlank{{0, 0, 0}, {100, 100, 20}}, Isometry3d::Identity(), {spacing, three});
}

void cut(const char* name, const Cutter& cutter, double spacing, bool three, int moves,
         double swing) {
  Stock stock = block(spacing, three);
  double removed = 0.0;
  std::size_t lines = 0;
  const Stopwatch watch;
  for (int i = 0; i < moves; ++i) {
    const RemovalResult one = remove(
        stock, cutter, {pose_at(i, moves, swing), pose_at(i + 1, moves, swing), i + 1, false});
    removed += one.volume;
    lines += one.lines;
  }
  const double s = watch.seconds();
  std::printf(
      "%-10s %s spacing %-5g moves %-6d %8.3f s  %7.1f us/move  %6.2f M dexels/s  %.0f mm^3\n",
      name, three ? "3 directions" : "1 direction ", spacing, moves, s, 1e6 * s / moves,
      1e-6 * double(lines) / s, removed);
}

void look(const char* name, const Cutter& cutter, double spacing, bool three) {
  Stock stock = block(spacing, three);
  Isometry3d from = Isometry3d::Identity(), to = from;
  from.translation() = Vector3d(-20, 50, 14);
  to.translation() = Vector3d(50, 50, 14);
  remove(stock, cutter, {from, to, 1, false});
  const int looks = 4000;
  std::size_t arcs = 0;
  const Stopwatch watch;
  for (int i = 0; i < looks; ++i) {
    to.translation().x() = 50.5 + 1e-5 * i;
    arcs += engagement(stock, cutter, to, Vector3d::UnitX()).arcs.size();
  }
  const double s = watch.seconds();
  std::printf("%-10s %s spacing %-5g %8.1f us/look  %8.0f looks/s  %.0f arcs\n", name,
              three ? "3 directions" : "1 direction ", spacing, 1e6 * s / looks, looks / s,
              double(arcs) / looks);
}

/// A step of a force loop: the look and the mean force of a revolution.
void force_steps(const char* name, const Cutter& cutter, double spacing) {
  Stock stock = block(spacing, true);
  Isometry3d from = Isometry3d::Identity(), to = from;
  from.translation() = Vector3d(-20, 50, 14);
  to.translation() = Vector3d(50, 50, 14);
  remove(stock, cutter, {from, to, 1, false});
  const CuttingCoefficients aluminium{"Al6082-T6", "", 631, 99, 273, 13, 10, 2.8};
  const int steps = 4000;
  double force = 0.0;
  const Stopwatch watch;
  for (int i = 0; i < steps; ++i) {
    to.translation().x() = 50.5 + 1e-5 * i;
    force += mean_force(engagement(stock, cutter, to, Vector3d::UnitX()), aluminium, Flutes{}, 0.05)
                 .tool_wrench_t.head<3>()
                 .norm();
  }
  const double s = watch.seconds();
  std::printf("%-10s 3 directions spacing %-5g %8.1f us/force step %6.0f force steps/s  %.1f N\n",
              name, spacing, 1e6 * s / steps, steps / s, force / steps);
}

void turn(double spacing) {
  Eigen::Matrix<double, Eigen::Dynamic, 2> profile(2, 2);
  profile << 0, 12.5, 60, 12.5;
  TurnedStock stock = make_turned_stock(profile, spacing, Vector3d::Zero(), Vector3d::UnitX());
  const Nose nose{0.8, {}};
  Isometry3d a = Isometry3d::Identity(), b = a;
  const int turns = 1500;
  std::size_t pieces = 0;
  const Stopwatch watch;
  for (int i = 0; i < turns; ++i) {
    a.translation() = Vector3d(60 - 0.04 * i, 0, 13.0);
    b.translation() = Vector3d(60 - 0.04 * (i + 1), 0, 13.0);
    pieces += engagement(stock, nose, b).size();
    remove(stock, nose, a, b);
  }
  std::printf("turning    spacing %-5g %8.1f us/revolution (look and removal), %.0f pieces\n",
              spacing, 1e6 * watch.seconds() / turns, double(pieces) / turns);
}

}  // namespace
}  // namespace abbe::cutting

int main(int argc, char** argv) {
  using namespace abbe::cutting;
  const int moves = argc > 1 ? std::atoi(argv[1]) : 5000;
  if (moves < 4) {
    std::fprintf(stderr, "stock_bench [moves]: expected 4 or more moves\n");
    return 2;
  }
  const Cutter flat{5.0, 0.0, 30.0}, bull{5.0, 1.0, 30.0}, ball{5.0, 5.0, 30.0};
  for (const bool three : {false, true}) {
    cut("flat", flat, 0.5, three, moves, 0.0);
    cut("bull", bull, 0.5, three, moves, 0.0);
    cut("ball", ball, 0.5, three, moves, 0.0);
  }
  cut("flat turns", flat, 0.5, true, moves, 0.2);
  cut("bull turns", bull, 0.5, true, moves, 0.2);
  cut("ball turns", ball, 0.5, true, moves, 0.2);
  for (const double spacing : {1.0, 0.5, 0.25}) cut("flat", flat, spacing, true, moves, 0.0);
  for (const int part : {4, 2, 1}) cut("ball turns", ball, 0.5, true, moves / part, 0.2);
  for (const bool three : {false, true})
    for (const double spacing : {0.5, 0.25}) {
      look("flat", flat, spacing, three);
      look("bull", bull, spacing, three);
      look("ball", ball, spacing, three);
    }
  for (const double spacing : {0.5, 0.25}) {
    force_steps("flat", flat, spacing);
    force_steps("ball", ball, spacing);
  }
  for (const double spacing : {0.02, 0.01}) turn(spacing);
}
