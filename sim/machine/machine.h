#pragma once

#include <optional>
#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"

namespace abbe::sim {

/// A machine as it is meant to be and as its control believes it to be, with its tool. Immutable.
struct Machine {
  kinematics::Chain nominal;             ///< as designed, the tool as ordered
  kinematics::Chain control;             ///< as the control believes it to be
  std::optional<int> workpiece_spindle;  ///< joint that turns the workpiece under a turning tool
};

/// Whether a joint is a spindle, of the tool or of the workpiece: it turns without limits and is no
/// axis that is positioned.
bool is_spindle(const Machine& machine, int joint);

/// The joint that turns the tool or the workpiece, if there is one.
std::optional<int> spindle_of(const Machine& machine);

/// Whether two chains bring the tool to the same place for the same commands, bit for bit.
bool same(const kinematics::Chain& a, const kinematics::Chain& b);

/// What one location element does on a machine.
struct LocationEffect {
  std::string meaning;  ///< "squareness of Y to X"
  kinematics::DisplacedPart displaces = kinematics::DisplacedPart::Frame;
  std::vector<std::string> bodies;  ///< what is displaced: axes, then "workpiece" or "tool"
  double amount = 0.0;              ///< mm or rad, by how much: the value, or its opposite where
                                    ///< what the axis carries is displaced in its place
  struct Angle {
    std::string between;  ///< "X-Y"
    double change = 0.0;  ///< rad, of the angle between two directions as poses show it
  };
  /// Those that change, of slides, lines of rotary axes and the nose with each other. Two that are
  /// parallel open by what turns one of them, whichever way.
  std::vector<Angle> angles;
  struct Tip {
    std::string at;           ///< "zero", "X -400 mm"
    Eigen::Vector3d moved_w;  ///< mm, of the tip in the workpiece against nominal
  };
  std::vector<Tip> tip;  ///< all axes at zero, then the axis and the slide against which it is
                         ///< located at the ends of travel (of a turn at most half of one)
};

/// @param element  a location element that `bind` took for this chain
LocationEffect location_effect(const errors::Element& element, const kinematics::Chain& chain);

}  // namespace abbe::sim
