#include <cmath>
#include <numbers>
#include <stdexcept>

#include "sim/program/generate.h"
#include "sim/program/milling_text.h"

namespace abbe::sim::program {
namespace {

constexpr int overlap = 2;  // steps beyond the full turn
/// The flank of the cutter along the generator at one azimuth of the cone.
Posture posture(const Flank& flank, const cutting::Cone& cone, const cutting::Cutter& cutter,
                double azimuth) {
  const double c = std::cos(cone.half_apex_angle), s = std::sin(cone.half_apex_angle);
  const Eigen::Vector3d out(std::cos(azimuth), std::sin(azimuth), 0.0);
  const Eigen::Vector3d normal = c * out + s * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d generator = -s * out + c * Eigen::Vector3d::UnitZ();
  return {cone.base_radius * out - flank.tip_below * generator + cutter.radius * normal, generator,
          normal};
}

Pass once_around(const Flank& flank, const cutting::Cone& cone, const cutting::Cutter& cutter,
                 const GenerateContext& context, double start, double sign) {
  const double circle = 2 * std::numbers::pi;
  const int n = int(std::ceil(circle * cone.base_radius / flank.step));
  Pass pass;
  for (int k = 0; k <= n + overlap; ++k) {
    Posture p = posture(flank, cone, cutter, start + sign * circle * k / n);
    pass.push_back({context.T_wm * p.tip_w, context.T_wm.linear() * p.direction_w,
                    context.T_wm.linear() * p.retreat_w});
  }
  return pass;
}

void check(const Flank& flank, const cutting::Cone& cone, const cutting::Cutter& cutter) {
  const bool sizes = flank.step > 0 && flank.feed > 0 && flank.clearance > 0 &&
                     cone.base_radius > 0 && cutter.radius > 0 && cone.half_apex_angle > 0 &&
                     cone.half_apex_angle < std::numbers::pi / 2;
  if (cutter.outline)
    throw std::invalid_argument(
        "expected a cutter with a cylinder as its flank, a ball, bull or flat end");
  if (!sizes || !std::isfinite(flank.tip_below))
    throw std::invalid_argument(
        "expected positive sizes of the cone, the cutter, step, feed and clearance");
  if (2 * std::numbers::pi * cone.base_radius / flank.step > most_points)
    throw std::invalid_argument("expected at most 2e7 points in a program");
}

}  // namespace

std::string generate_flank(const Flank& flank, const cutting::Cone& cone,
                           const cutting::Cutter& cutter, const GenerateContext& context) {
  check(flank, cone, cutter);
  const MillingTextOptions options{.title = "flank milling of a cone frustum",
                                   .feed = flank.feed,
                                   .clearance = flank.clearance,
                                   .speed_rpm = flank.speed_rpm,
                                   .cutter_radius = cutter.radius,
                                   .neighbour = 0.0,
                                   .whole = true,
                                   .format = flank.format};
  // A rotary axis that cannot turn on and on may still get around from another start or the other
  // way.
  for (const double sign : {-1.0, 1.0})
    for (int quarter = 0; quarter < 4; ++quarter) try {
        return milling_text({once_around(flank, cone, cutter, context,
                                         quarter * std::numbers::pi / 2, sign)},
                            options, context)
            .text;
      } catch (const std::invalid_argument&) {
        if (sign > 0 && quarter == 3) throw;
      }
  throw std::logic_error("unreachable");
}

}  // namespace abbe::sim::program
