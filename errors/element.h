#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "errors/curve.h"
#include "kinematics/chain.h"

/// Error elements of a machine, named as in ISO 230-1. In this namespace "error" always means a
/// deviation of the machine; a failure of the program is an exception or a status.
namespace abbe::errors {

/// Name of an element as in ISO 230-1: E, direction, axis. "EYX" is the deviation of the X axis in
/// Y, "ECX" its rotation about Z. A zero marks a location error: "EC0Y" is the squareness of Y.
struct ElementName {
  char direction = 'X';  ///< X Y Z for a translation (mm), A B C for a rotation (rad)
  char axis = 'X';       ///< letter of the axis; 'S' is the spindle of the tool or of the workpiece
  bool location = false;  ///< a constant error of position or direction of the axis

  bool is_angle() const { return direction >= 'A' && direction <= 'C'; }
  int component() const { return is_angle() ? 3 + (direction - 'A') : direction - 'X'; }
  friend bool operator==(const ElementName&, const ElementName&) = default;
};

/// Parses "EXX", "EC0Y" and the vendors' short form "C0Y". The first letter of a location error is
/// the direction about which the axis is tilted (A B C) or along which it is offset (X Y Z).
/// @throws std::invalid_argument with what was expected and seen
ElementName parse_element_name(std::string_view text);
std::string to_string(const ElementName& name);

/// An error element: the sum of its curves.
struct Element {
  ElementName name;
  std::vector<Curve> curves;
};

// Checks of the numbers in a description of errors. Each throws std::invalid_argument with a
// message that begins with `who`, the name of the item to which the number belongs.

[[noreturn]] void refuse(const std::string& who, const std::string& reason);

void require_positive_value(double value, const std::string& who, const char* quantity);
void require_not_negative(double value, const std::string& who, const char* quantity);
void require_finite(double value, const std::string& who, const char* quantity);
/// Throws unless `node` is the index of one of the `nodes` nodes of a thermal network.
void require_node(int node, int nodes, const std::string& who);

// Binding of an element to a chain, common to all sources of errors.

/// Returns the joint that an element's axis letter denotes. 'S' is the joint S (a spindle that
/// carries the workpiece) if the chain has one, else the nose s.
/// @param who  text with which an error message begins
/// @throws std::invalid_argument if the chain lacks the axis
int axis_joint(char axis, const kinematics::Chain& chain, const std::string& who);

/// Checks that an element has a meaning for a joint.
/// @param joint  index of the axis in the chain
/// @throws std::invalid_argument with the element and the reason if it is meaningless: a tilt of an
///         axis about itself; an offset of a slide, or of a rotary axis along itself (a constant
///         error motion expresses both); a squareness that is stated for another slide or has no
///         reference slide; the rotation of a spindle about itself
void check_meaning(const ElementName& name, const kinematics::Chain& chain, int joint);

/// Returns the meaning of a location element on this machine: "squareness of Y to X", "parallelism
/// of A to X about Y", "offset of C along X".
std::string meaning(const ElementName& name, const kinematics::Chain& chain, int joint);

/// The location error that is equivalent to the slope of a straightness.
struct SquarenessContribution {
  ElementName name;    ///< of the slide to which the angle belongs: EC0Y, EB0Z, EA0Z
  double value = 0.0;  ///< rad, to be added to that element
};

/// Returns the squareness errors equivalent to a slope that `detrend` removes from a straightness.
/// The slope of EXY tilts Y and is EC0Y; that of EYX tilts X and is EC0Y with the opposite sign.
/// There is one contribution for each bed axis about which the slide is tilted, hence exactly one
/// if the slide lies along a bed axis.
/// @param slope   per mm of the carriage's own travel (on a primed axis: minus that per command)
/// @param joints  all joints of the machine
/// @throws std::invalid_argument unless the element is a straightness of a slide of the machine
///         that forms an angle with another
std::vector<SquarenessContribution> to_squareness_errors(const ElementName& straightness,
                                                         double slope,
                                                         std::span<const kinematics::Joint> joints);

}  // namespace abbe::errors
