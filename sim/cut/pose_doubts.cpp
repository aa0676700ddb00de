#include "sim/cut/pose_doubts.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "errors/element_warnings.h"
#include "kinematics/units.h"
#include "sim/cut/heat_warnings.h"
#include "sim/scene/value_warnings.h"

namespace abbe::sim {
namespace {

using kinematics::AxisVector;

/// Half of what a curve differs by between its two ways of approach, mm or rad.
double half_reversal(const errors::Curve& curve) {
  double half = 0.0;
  if (const auto* backlash = std::get_if<errors::Backlash>(&curve.shape))
    half = std::abs(backlash->half);
  if (const auto* both = std::get_if<errors::UpDown>(&curve.shape))
    for (const double q : both->up.q)
      if (q >= both->down.q[0] && q <= both->down.q[both->down.q.size() - 1])
        half = std::max(half, 0.5 * std::abs(errors::value({both->up}, {q, q}) -
                                             errors::value({both->down}, {q, q})));
  return half * std::abs(curve.scale);
}

double chance(const errors::Curve& curve) {
  const auto* random = std::get_if<errors::Repeatability>(&curve.shape);
  return random != nullptr ? random->sigma * std::abs(curve.scale) : 0.0;
}

/// "EXX 1.5 um, EAX 2 urad" of the elements of which `size` is not zero.
template <typename Size>
std::string figures_of(const errors::GeometricModel& model, const Size& size) {
  std::string text;
  for (const auto& bound : model.elements) {
    double sum = 0.0;
    for (const errors::Curve& curve : bound.element.curves) sum += size(curve);
    if (sum == 0.0) continue;
    const bool angle = bound.element.name.is_angle();
    text += fmt::format("{}{} {:.3g} {}", text.empty() ? "" : ", ", to_string(bound.element.name),
                        sum / (angle ? units::urad : units::um), angle ? "urad" : "um");
  }
  return text;
}

/// What a column of time cannot say of this machine.
std::vector<std::string> doubts_of_time(const IdleMachine& idle, const PoseList& poses) {
  std::vector<std::string> found;
  if (!poses.is_timed()) return found;
  if (!idle.truth.heat) {
    found.push_back("time changes nothing: the machine of this scene has no heat");
    return found;
  }
  std::size_t after = 0, before = 0;
  const double begin_s = idle.truth.heat->run.knots.front().time_s;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double time_s = poses.state(i).time_s;
    after += time_s > 0.0;
    before += time_s < begin_s;
  }
  if (after > 0)
    found.push_back(
        fmt::format("{} of {} poses come after time 0: the last phase of the history "
                    "goes on, no program runs",
                    after, poses.size()));
  if (before > 0)
    found.push_back(
        fmt::format("{} of {} poses come before the history, which begins at {:.6g} s: "
                    "the machine is as at its beginning",
                    before, poses.size(), begin_s));
  return found;
}

}  // namespace

std::vector<std::string> doubts(const IdleMachine& idle, const AxisVector& least,
                                const AxisVector& most) {
  std::vector<std::string> found;
  const errors::GeometricModel& model = idle.truth.geometric;
  found = value_warnings(idle.scene);
  std::ranges::move(heat_warnings({}, idle.truth), std::back_inserter(found));
  std::ranges::move(errors::element_warnings(model, least, most), std::back_inserter(found));
  if (!idle.scene.more_tools.empty())
    found.push_back(fmt::format("poses are of T{}, the first of {} tools",
                                idle.scene.tool.number.value_or(0),
                                1 + idle.scene.more_tools.size()));
  if (const std::string halves = figures_of(model, half_reversal); !halves.empty())
    found.push_back("poses are half way between their two approaches; reversal adds or takes: " +
                    halves);
  if (const std::string sigmas = figures_of(model, chance); !sigmas.empty())
    found.push_back("poses have one draw of the repeatability, whose standard deviation is: " +
                    sigmas);
  return found;
}

std::vector<std::string> doubts(const IdleMachine& idle, const PoseList& poses) {
  AxisVector least = poses.state(0).q, most = least;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const AxisVector q = poses.state(i).q;
    least = least.cwiseMin(q);
    most = most.cwiseMax(q);
  }
  std::vector<std::string> found = doubts(idle, least, most);
  std::ranges::move(doubts_of_time(idle, poses), std::back_inserter(found));
  return found;
}

}  // namespace abbe::sim
