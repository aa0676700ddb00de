#pragma once

#include <optional>
#include <vector>

#include "errors/element.h"
#include "kinematics/chain.h"

namespace abbe::errors {

/// One harmonic of a vibrating element: amplitude cos(order * spindle angle + phase). The amplitude
/// follows the spindle speed n: `amplitude` (|n| / reference)^exponent (exponent 2 for unbalance, 0
/// for a constant amplitude, which then also acts at rest); near a resonance it is magnified by 1 /
/// sqrt((1 - r^2)^2 + (2 damping r)^2), r = order |n| / resonance.
struct Vibration {
  ElementName name;                 ///< of an error motion
  double order = 1.0;               ///< per turn of the spindle: 1, or the number of teeth; > 0
  double amplitude = 0.0;           ///< mm or rad, at the reference speed
  double reference_speed = 1.0;     ///< rad/s, > 0
  double exponent = 0.0;            ///< >= 0
  double phase = 0.0;               ///< rad
  std::optional<double> resonance;  ///< rad/s, > 0
  double damping = 0.05;            ///< fraction of critical damping, > 0
};

/// The vibrations bound to a chain. Immutable; created by `bind`.
struct VibrationModel {
  struct Bound {
    int joint = 0;
    int component = 0;  ///< 0..5
    Vibration vibration;
  };
  std::vector<Bound> harmonics;  ///< several harmonics of one element are added
  int joints = 0;
};

/// Binds the vibrations to a chain.
/// @throws std::invalid_argument naming the element: an axis that the chain lacks, a location
///         element, a spindle's rotation about itself, a number that is not physical
VibrationModel bind(const std::vector<Vibration>& vibrations, const kinematics::Chain& chain);

/// Returns the amplitude at a spindle speed of either sense of rotation, mm or rad, with the sign
/// of `amplitude`.
double amplitude(const Vibration& vibration, double spindle_speed);

/// Returns the deviation of every joint by vibration, in the order of the chain.
/// @param spindle_angle  rad, since the start of the program
std::vector<kinematics::JointDeviation> deviations(const VibrationModel& model,
                                                   double spindle_speed, double spindle_angle);

}  // namespace abbe::errors
