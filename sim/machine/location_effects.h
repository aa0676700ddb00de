#pragma once

#include <string>
#include <vector>

#include "errors/geometric.h"
#include "kinematics/chain.h"

namespace abbe::sim {

/// What one location element does on a machine.
struct LocationEffect {
  std::string meaning;  ///< "squareness of Y to X"
  kinematics::Displaces displaces = kinematics::Displaces::Frame;
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
