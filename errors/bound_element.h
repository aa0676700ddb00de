#pragma once

#include <string>

#include "errors/element.h"
#include "kinematics/chain.h"

/// What every source of errors asks when it binds an element to a chain.
namespace abbe::errors {

/// Joint that an element's axis letter means. 'S' is the joint S (a spindle that carries the
/// workpiece) if the chain has one, else the nose s.
/// @param who  begins the message
/// @throws std::invalid_argument if the chain lacks the axis
int joint_of(char axis, const kinematics::Chain& chain, const std::string& who);

/// @param joint  index of the axis in the chain
/// @throws std::invalid_argument naming the element and the reason if it means nothing for that
///         joint: an angle of an axis about itself, an offset of a slide or along a rotary axis (a
///         constant error motion says that), a squareness that another slide states or that no
///         slide sees, a spindle's turn about itself
void check_meaning(const ElementName& name, const kinematics::Chain& chain, int joint);

/// What an element of location is on this machine, in words: "squareness of Y to X", "parallelism
/// of A to X about Y", "offset of C along X".
std::string meaning(const ElementName& name, const kinematics::Chain& chain, int joint);

}  // namespace abbe::errors
