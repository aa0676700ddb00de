#include "errors/vibration.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include <fmt/format.h>

#include "errors/element.h"

namespace abbe::errors {
namespace {

void require_number(const Vibration& vibration, bool holds, const char* expected, double seen) {
  if (holds) return;
  throw std::invalid_argument(fmt::format("vibration of {}: expected {}, seen {}",
                                          to_string(vibration.name), expected, seen));
}

bool is_positive_number(double x) { return x > 0.0 && std::isfinite(x); }

void check(const Vibration& v) {
  // A location element describes a constant position of an axis and cannot vibrate.
  if (v.name.location) {
    throw std::invalid_argument(fmt::format(
        "vibration of {}: expected an error motion, seen a location element", to_string(v.name)));
  }
  require_number(v, is_positive_number(v.order), "an order above 0", v.order);
  require_number(v, std::isfinite(v.amplitude), "a finite amplitude", v.amplitude);
  require_number(v, is_positive_number(v.reference_speed), "a reference speed above 0",
                 v.reference_speed);
  require_number(v, v.exponent >= 0.0 && std::isfinite(v.exponent), "an exponent of at least 0",
                 v.exponent);
  require_number(v, std::isfinite(v.phase), "a finite phase", v.phase);
  if (v.resonance)
    require_number(v, is_positive_number(*v.resonance), "a resonance above 0", *v.resonance);
  require_number(v, is_positive_number(v.damping), "a damping above 0", v.damping);
}

}  // namespace

VibrationModel bind(const std::vector<Vibration>& vibrations, const kinematics::Chain& chain) {
  VibrationModel model;
  model.joints = chain.size();
  for (const Vibration& vibration : vibrations) {
    check(vibration);
    const std::string who = "vibration of " + to_string(vibration.name);
    const int joint = axis_joint(vibration.name.axis, chain, who);
    check_meaning(vibration.name, chain, joint);
    model.harmonics.push_back({joint, vibration.name.component(), vibration});
  }
  return model;
}

double amplitude(const Vibration& v, double spindle_speed) {
  // The amplitude is the same in both senses of rotation.
  const double n = std::abs(spindle_speed);
  const double excitation = v.amplitude * std::pow(n / v.reference_speed, v.exponent);
  if (!v.resonance) return excitation;
  const double r = v.order * n / *v.resonance;
  // Steady response of a one-mass oscillator driven at the order's frequency.
  return excitation / std::hypot(1.0 - r * r, 2.0 * v.damping * r);
}

std::vector<kinematics::JointDeviation> deviations(const VibrationModel& model,
                                                   double spindle_speed, double spindle_angle) {
  std::vector<kinematics::JointDeviation> result(std::size_t(model.joints));
  for (const VibrationModel::Bound& bound : model.harmonics) {
    const Vibration& v = bound.vibration;
    // Harmonics of one component add up.
    result[std::size_t(bound.joint)].motion[bound.component] +=
        amplitude(v, spindle_speed) * std::cos(v.order * spindle_angle + v.phase);
  }
  return result;
}

}  // namespace abbe::errors
