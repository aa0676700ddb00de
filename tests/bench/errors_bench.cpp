// What one call of deviations() costs for the 46 elements of a gantry, 30 of them curves.

#include <cmath>
#include <string>

#include <benchmark/benchmark.h>

#include "errors/geometric.h"

namespace abbe::errors {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

kinematics::Chain gantry() {
  using enum kinematics::Side;
  using enum kinematics::Motion;
  const Vector3d ex(1, 0, 0), ey(0, 1, 0), ez(0, 0, 1);
  const kinematics::Pose home = kinematics::Pose::Identity();
  return kinematics::Chain({{'C', Workpiece, Rotary, ez, {0, 0, -50}},
                            {'X', Tool, Linear, ex, {0, 0, 300}},
                            {'Y', Tool, Linear, ey, {0, 0, 350}},
                            {'Z', Tool, Linear, ez, {0, 0, 400}},
                            {'A', Tool, Rotary, ex, {0, 0, 200}},
                            {'s', Tool, Spindle, ez, {0, 0, 150}}},
                           home, home);
}

Shape tabulated(TableInterpolation between) {
  VectorXd q(41), y(41);
  for (int i = 0; i < 41; ++i) {
    q[i] = -400 + 20 * i;
    y[i] = 0.01 * std::sin(0.3 * i);
  }
  return make_table(q, y, between);
}

Shape polynomial() { return Polynomial{VectorXd::Constant(6, 0.001), 0, 400}; }
Shape fourier() { return Fourier{VectorXd::Constant(3, 0.001), VectorXd::Constant(3, 0.001), 20}; }

GeometricModel error_model(const Shape& motion) {
  GeometricErrors errors;
  const auto add = [&](const std::string& name, const Shape& shape) {
    errors.elements.push_back({parse_element_name(name), {Curve{shape}}});
  };
  for (const char axis : std::string("XYZAC"))
    for (const char direction : std::string("XYZABC"))
      add(std::string("E") + direction + axis, motion);
  for (const char* name : {"EXS", "EYS", "EZS", "EAS", "EBS", "EC0Y", "EB0Z", "EA0Z", "EB0A",
                           "EC0A", "EA0C", "EB0C", "EY0A", "EZ0A", "EX0C", "EY0C"})
    add(name, Constant{1e-5});
  errors.measuring_lines = {{'X', {0, 0, 0}, MeasuredBy::Tool}};
  return bind(errors, gantry());
}

void run(benchmark::State& bench, const Shape& motion) {
  const GeometricModel model = error_model(motion);
  kinematics::AxisState state;
  state.q = VectorXd::Zero(6);
  double q = 0.0;
  for (auto _ : bench) {
    q = q > 399.0 ? -399.0 : q + 0.37;
    state.q << 0.001 * q, q, -q, 0.5 * q, 0.002 * q, 0;
    benchmark::DoNotOptimize(deviations(model, state));
  }
}

void linear_tables(benchmark::State& bench) { run(bench, tabulated(TableInterpolation::Linear)); }
void spline_tables(benchmark::State& bench) { run(bench, tabulated(TableInterpolation::Spline)); }
void polynomials(benchmark::State& bench) { run(bench, polynomial()); }
void screw_pitches(benchmark::State& bench) { run(bench, fourier()); }
void chance(benchmark::State& bench) { run(bench, Repeatability{1e-3, 1}); }

BENCHMARK(linear_tables);
BENCHMARK(spline_tables);
BENCHMARK(polynomials);
BENCHMARK(screw_pitches);
BENCHMARK(chance);

}  // namespace
}  // namespace abbe::errors

BENCHMARK_MAIN();
