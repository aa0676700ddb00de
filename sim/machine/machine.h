#pragma once

#include <optional>
#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"

/// The machine of a scene as designed and as believed by its control, and the effect of location
/// elements.
namespace abbe::sim {

/// A machine as designed and as its control believes it to be, with its tool. Immutable.
struct Machine {
  kinematics::Chain nominal;             ///< as designed, with the tool as ordered
  kinematics::Chain control;             ///< as the control believes it to be
  std::optional<int> workpiece_spindle;  ///< joint that turns the workpiece under a turning tool
};

/// Returns true if a joint is a spindle of the tool or the workpiece: it turns without limits and
/// is not positioned.
bool is_spindle(const Machine& machine, int joint);

/// Returns the joint that turns the tool or the workpiece, if there is one.
std::optional<int> find_spindle(const Machine& machine);

/// Returns true if two chains bring the tool to the same pose for the same commands, bit for bit.
bool same(const kinematics::Chain& a, const kinematics::Chain& b);

/// The effect of one location element on a machine.
struct LocationEffect {
  std::string meaning;  ///< "squareness of Y to X"
  kinematics::DisplacedPart displaces = kinematics::DisplacedPart::Frame;
  std::vector<std::string> bodies;  ///< displaced bodies: axes, then "workpiece" or "tool"
  double amount = 0.0;  ///< displacement, mm or rad: the value of the element, or its opposite if
                        ///< what the axis carries is displaced instead
  struct Angle {
    std::string between;  ///< "X-Y"
    double change = 0.0;  ///< rad, change of the angle between the two directions as poses show it
  };
  /// Angles that change between slides, lines of rotary axes and the spindle nose. Two parallel
  /// directions open by the rotation of one of them, in whatever direction.
  std::vector<Angle> angles;
  struct Tip {
    std::string at;           ///< "zero", "X -400 mm"
    Eigen::Vector3d moved_w;  ///< mm, displacement of the tip in the workpiece from nominal
  };
  /// At zero of all axes, then at the ends of travel (of a rotary axis at most half a turn) of the
  /// axis and of the slide relative to which it is located.
  std::vector<Tip> tip;
};

/// Returns the effect of a location element.
/// @param element  a location element that `bind` accepted for this chain
LocationEffect location_effect(const errors::Element& element, const kinematics::Chain& chain);

}  // namespace abbe::sim
