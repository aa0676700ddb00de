#include "errors/metrology/circle_tests.h"

#include <array>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::errors::metrology {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// The two slides of a circle by letter; nothing if other axes move.
std::optional<std::array<int, 2>> slides_of_circle(const Series& series,
                                                   const std::vector<int>& moving) {
  const auto& joints = series.readings.nominal.joints();
  if (series.sensor().quantity != Quantity::Length || moving.size() != 2) return std::nullopt;
  for (const int joint : moving)
    if (joints[std::size_t(joint)].motion != kinematics::Motion::Linear) return std::nullopt;
  std::array slides{moving[0], moving[1]};
  if (joints[std::size_t(slides[1])].name < joints[std::size_t(slides[0])].name)
    std::swap(slides[0], slides[1]);
  return slides;
}

/// Looks of one run in one sense, with the angle about the socket going on without jumps.
struct Pass {
  int run = 0;
  std::vector<std::size_t> looks;
  std::vector<double> angle;
};

// A sense ends where the run does or where a target is read again before the way back.
std::vector<Pass> passes_of(const Series& series, const Eigen::Matrix<double, 3, 2>& plane) {
  std::vector<Pass> passes;
  int step = 0;
  for (std::size_t i = 0; i < series.looks.size(); ++i) {
    const Look& look = series.look(i);
    const Eigen::Vector2d arm =
        plane.transpose() * (place_w(series, look.state.q) - series.sensor().point_in);
    double angle = std::atan2(arm.y(), arm.x());
    const int way = i > 0 ? look.target - series.look(i - 1).target : 0;
    const bool goes_on = !passes.empty() && passes.back().run == look.run && way != 0 &&
                         (passes.back().looks.size() < 2 || way * step > 0);
    if (!goes_on) passes.push_back({look.run, {}, {}});
    Pass& pass = passes.back();
    if (!pass.angle.empty())
      angle = pass.angle.back() + std::remainder(angle - pass.angle.back(), 2 * pi);
    step = way;
    pass.looks.push_back(i);
    pass.angle.push_back(angle);
  }
  return passes;
}

/// Unit vectors along the first slide and, square to it, towards the second, in the workpiece.
Eigen::Matrix<double, 3, 2> plane_w(const Series& series, const std::array<int, 2>& slides) {
  const auto& q0 = series.look(0).state.q;
  Eigen::Matrix<double, 3, 2> plane;
  for (int k = 0; k < 2; ++k) {
    kinematics::AxisVector q = q0;
    q[slides[std::size_t(k)]] += 1.0;
    plane.col(k) = place_w(series, q) - place_w(series, q0);
  }
  plane.col(0).normalize();
  plane.col(1) -= plane.col(1).dot(plane.col(0)) * plane.col(0);
  plane.col(1).normalize();
  return plane;
}

}  // namespace

std::vector<CircleTest> circle_tests(const Series& series, const std::vector<int>& moving) {
  const auto slides = slides_of_circle(series, moving);
  if (!slides) return {};
  const auto& q0 = series.look(0).state.q;
  const double radius = (place_w(series, q0) - series.sensor().point_in).norm();
  for (std::size_t i = 1; i < series.looks.size(); ++i) {
    const Vector3d arm = place_w(series, series.look(i).state.q) - series.sensor().point_in;
    if (std::abs(arm.norm() - radius) > 1e-6 * radius) return {};
  }
  std::map<int, CircleTest> circles;
  for (const Pass& pass : passes_of(series, plane_w(series, *slides))) {
    if (pass.looks.size() < 3) return {};
    CircleTest& test = circles[pass.run];
    const bool rises = pass.angle.back() > pass.angle.front();
    CircularTrace& trace = rises ? test.runs.anticlockwise : test.runs.clockwise;
    if (trace.angle.size() > 0) return {};  // the same sense twice in a run
    trace.angle = VectorXd::Map(pass.angle.data(), Index(pass.angle.size()));
    trace.radius.resize(trace.angle.size());
    for (std::size_t i = 0; i < pass.looks.size(); ++i)
      trace.radius[Index(i)] = series.readings.value[Index(series.looks[pass.looks[i]])];
  }
  std::vector<CircleTest> result;
  for (auto& [run, test] : circles) {
    test.name =
        circles.size() > 1 ? fmt::format("{}, run {}", series.name(), run + 1) : series.name();
    for (const int joint : *slides)
      test.plane += series.readings.nominal.joints()[std::size_t(joint)].name;
    test.runs.nominal_radius = radius;
    test.zero_known = !series.optics().zero_unknown;
    result.push_back(std::move(test));
  }
  return result;
}

}  // namespace abbe::errors::metrology
