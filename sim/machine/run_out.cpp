#include "sim/machine/run_out.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "cutting/surface/tool.h"
#include "kinematics/units.h"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;

bool is_run_out(const errors::Curve& curve) {
  return std::holds_alternative<errors::Fourier>(curve.shape) ||
         std::holds_alternative<errors::Asynchronous>(curve.shape);
}

bool is_synchronous(const errors::Curve& curve) {
  const auto* fourier = std::get_if<errors::Fourier>(&curve.shape);
  if (fourier == nullptr) return false;
  // A Fourier curve is synchronous if an integer number of its periods fits into a revolution.
  const double periods_per_turn = units::full_turn / fourier->period;
  return periods_per_turn > 0.5 &&
         std::abs(periods_per_turn - std::round(periods_per_turn)) < 1e-9 * periods_per_turn;
}

/// Returns the spindle that turns the tool; null on a machine with an axis S, because S in an
/// element name then denotes that axis.
const kinematics::Joint* tool_spindle(const MachineDescription& machine) {
  const kinematics::Joint* nose = nullptr;
  for (const kinematics::Joint& joint : machine.joints) {
    if (joint.name == 'S') return nullptr;
    if (joint.name == 's') nose = &joint;
  }
  return nose;
}

/// Removes the curves of run-out of the spindle from the elements and returns them.
std::vector<errors::Element> extract_run_out(std::vector<errors::Element>& elements) {
  std::vector<errors::Element> run_out;
  for (errors::Element& element : elements) {
    if (element.name.axis != 'S' || element.name.location) continue;
    const auto first_run_out =
        std::stable_partition(element.curves.begin(), element.curves.end(),
                              [](const auto& curve) { return !is_run_out(curve); });
    if (first_run_out == element.curves.end()) continue;
    // An element without curves is kept, because its name is checked later.
    run_out.push_back({element.name, {first_run_out, element.curves.end()}});
    element.curves.erase(first_run_out, element.curves.end());
  }
  return run_out;
}

/// Throws BadInput naming the scene if a curve of the run-out is invalid.
void check(const std::vector<errors::Element>& elements, const Scene& scene) {
  for (const errors::Element& element : elements) {
    try {
      for (const errors::Curve& curve : element.curves) errors::validate(curve);
    } catch (const std::invalid_argument& error) {
      throw BadInput(scene.file.string(), 0, 0, "errors that match the machine",
                     errors::to_string(element.name) + ": " + error.what());
    }
  }
}

/// The error motion of a spindle over its angle.
struct SpindleMotion {
  std::vector<errors::Element> elements;
  double scale = 1.0;
};

/// Returns the error motion at an angle of the spindle.
kinematics::Deviation motion_at_angle(const SpindleMotion& motion, double angle) {
  // The command and the carriage are both at the angle; error motion has no reversal.
  const errors::CurveState state{angle, angle, 1, 0, false};
  kinematics::Deviation deviation = kinematics::Deviation::Zero();
  for (const errors::Element& element : motion.elements)
    for (const errors::Curve& curve : element.curves)
      deviation[element.name.component()] += motion.scale * errors::value(curve, state);
  return deviation;
}

bool is_synchronous(const SpindleMotion& motion) {
  return std::all_of(motion.elements.begin(), motion.elements.end(), [](const auto& element) {
    return std::all_of(element.curves.begin(), element.curves.end(),
                       [](const auto& curve) { return is_synchronous(curve); });
  });
}

/// Maximum displacement of the tool axis over the angle of the spindle.
struct RunOut {
  double radial = 0.0;  ///< mm
  double axial = 0.0;   ///< mm
};

/// Returns the maximum radial and axial run-out over the sampled angles.
/// @param arm_b   mm, from the point of the nose to the point of the cutter, axes at zero
/// @param axis_b  unit, of the tool, towards the spindle
RunOut max_run_out(const SpindleMotion& motion, const Vector3d& arm_b, const Vector3d& axis_b) {
  // 65 536 angles: the error for order k is at most (pi k / 65536)^2 / 2 = 1.2e-9 k^2 of its
  // amplitude.
  constexpr int angle_count = 65536;
  const double step = (is_synchronous(motion) ? 1.0 : 64.0) * units::full_turn / angle_count;
  RunOut result;
  for (int i = 0; i < angle_count; ++i) {
    const kinematics::Deviation deviation = motion_at_angle(motion, step * i);
    const Vector3d displacement = deviation.head<3>() + Vector3d(deviation.tail<3>()).cross(arm_b);
    const double axial_displacement = displacement.dot(axis_b);
    result.radial = std::max(result.radial, (displacement - axial_displacement * axis_b).norm());
    // Along the axis, only a motion away from the spindle lets the tool cut deeper.
    result.axial = std::max(result.axial, -axial_displacement);
  }
  return result;
}

}  // namespace

Scene with_run_out(const Scene& scene) {
  const kinematics::Joint* spindle = tool_spindle(scene.machine);
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.actual);
  if (spindle == nullptr || cutter == nullptr) return scene;
  Scene result = scene;
  const SpindleMotion motion{extract_run_out(result.geometric.elements), scene.error_scale};
  if (motion.elements.empty()) return scene;
  check(motion.elements, scene);

  const Vector3d corner_s(0, 0, cutting::corner_height(*cutter) - scene.tool.actual_length);
  const RunOut run_out = max_run_out(motion, scene.machine.T_bs * corner_s - spindle->point_b,
                                     scene.machine.T_bs.linear().col(2));
  try {
    result.tool.actual = cutting::with_run_out(*cutter, run_out.radial, run_out.axial);
  } catch (const std::invalid_argument& error) {
    throw BadInput(
        scene.file.string(), 0, 0, "a tool that can have this run-out",
        fmt::format("{:.3g} um axial run-out: {}", run_out.axial / units::um, error.what()));
  }
  result.tool.actual_length += run_out.axial;
  return result;
}

}  // namespace abbe::sim
