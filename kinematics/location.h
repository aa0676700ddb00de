#pragma once

#include <array>
#include <optional>
#include <span>

#include "kinematics/chain.h"

namespace abbe::kinematics {

/// Whether joint `one` carries joint `other`: on the same side of the bed and nearer to it.
bool carries(std::span<const Joint> joints, int one, int other);

/// The slides that make the machine's frame, by the bed axis along which each mainly travels. Of
/// two along one axis it is the first of X Y Z U V W P Q R. X is primary, Y secondary, Z third.
std::array<std::optional<int>, 3> main_slides(std::span<const Joint> joints);

/// What one component of a joint's location error is on a machine of this structural code.
struct LocationElement {
  Displaces displaces = Displaces::Frame;
  std::optional<int> reference;  ///< slide against which the axis is located, if one sees it
  std::optional<int> stated_by;  ///< set where the angle is already that of this later slide
  bool defined = true;           ///< a slide has no place, no angle about its own direction, and
                                 ///< none where no earlier slide sees it; what is not defined
                                 ///< displaces the frame
};

/// A rotary axis and a slide beyond the main ones are located against the main slides that see it:
/// of a turn about a bed axis the two that travel across it, of an offset the one along it. A main
/// slide is located against the one that makes a pair with it. The frame of the axis is displaced
/// with all that it carries; where it carries all those slides, that would show nowhere, and what
/// it carries is displaced by the opposite instead; where it carries some of them, the axis alone
/// is turned. `Squareness::Travel` turns the axis alone in any case.
/// @param component  0..5 of [EX EY EZ EA EB EC]
LocationElement location_element(std::span<const Joint> joints, int joint, int component);

}  // namespace abbe::kinematics
