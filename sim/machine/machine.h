#pragma once

#include <optional>
#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"

/// The machine of a scene as designed and as its control assumes it to be, and the effect of
/// location elements.
namespace abbe::sim {

/// A machine with its tool, as designed and as its control assumes it to be. Immutable.
struct Machine {
  kinematics::Chain nominal;             ///< as designed, with the nominal tool
  kinematics::Chain control;             ///< as the control assumes it to be
  std::optional<int> workpiece_spindle;  ///< joint that turns the workpiece under a turning tool
};

/// Returns true if a joint is a spindle of the tool or the workpiece, i.e. turns without limits and
/// is not positioned.
bool is_spindle(const Machine& machine, int joint);

/// Returns the joint that turns the tool or the workpiece; empty if there is none.
std::optional<int> find_spindle(const Machine& machine);

/// Returns true if two chains bring the tool to the same pose for the same commands, bit for bit.
bool have_same_poses(const kinematics::Chain& a, const kinematics::Chain& b);

/// The effect of one location element on a machine.
struct LocationEffect {
  std::string meaning;  ///< "squareness of Y to X"
  kinematics::DisplacedPart displaces = kinematics::DisplacedPart::Frame;
  std::vector<std::string> bodies;  ///< displaced bodies: axes, then "workpiece" or "tool"
  double amount = 0.0;  ///< displacement, mm or rad: the value of the element, or its negative if
                        ///< the bodies that the axis carries are displaced instead
  struct Angle {
    std::string between;  ///< "X-Y"
    double change = 0.0;  ///< rad, change of the angle between the two directions
  };
  /// Changed angles between slides, rotary axes and the spindle nose. Any rotation of one of two
  /// parallel directions increases the angle between them.
  std::vector<Angle> angles;
  struct Tip {
    std::string at;                  ///< "zero", "X -400 mm"
    Eigen::Vector3d displacement_w;  ///< mm, displacement of the tip in the workpiece from nominal
  };
  /// Tips with all axes at zero, then at the ends of travel of the axis and of its reference slide;
  /// the travel of a rotary axis is limited to half a turn.
  std::vector<Tip> tip;
};

/// Returns the effect of a location element.
/// @param element  a location element that `bind` accepted for this chain
LocationEffect location_effect(const errors::Element& element, const kinematics::Chain& chain);

}  // namespace abbe::sim
