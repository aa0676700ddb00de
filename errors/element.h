#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "errors/curve.h"
#include "kinematics/chain.h"

/// Elements: the deviations of a machine, named by ISO 230-1. "Error" always means a deviation of
/// the machine; a failure of the program is an exception or a status.
namespace abbe::errors {

/// Name of an element as in ISO 230-1: E, direction, axis. "EYX" is the deviation of the X axis in
/// Y, "ECX" its rotation about Z. A zero marks a location error: "EC0Y" is the squareness of Y.
struct ElementName {
  char direction = 'X';  ///< X Y Z for a translation (mm), A B C for a rotation (rad)
  char axis = 'X';       ///< letter of the joint; 'S' is the spindle, tool nose or workpiece
                         ///< spindle
  bool location = false;

  bool is_angle() const { return direction >= 'A' && direction <= 'C'; }
  int component() const { return is_angle() ? 3 + (direction - 'A') : direction - 'X'; }
  friend bool operator==(const ElementName&, const ElementName&) = default;
};

/// Parses "EXX", "EC0Y" and the vendors' short form "C0Y". The direction letter of a location error
/// is the axis about which the axis is turned (A B C) or along which it is offset (X Y Z).
/// @throws std::invalid_argument that says what was expected and seen
ElementName parse_element_name(std::string_view text);
std::string to_string(const ElementName& name);

/// An element: the sum of its curves.
struct Element {
  ElementName name;
  std::vector<Curve> curves;
};

// Checks of the numbers of a description. Each throws std::invalid_argument with a message that
// begins with `who`.

[[noreturn]] void refuse(const std::string& who, const std::string& why);

void expect_positive(double value, const std::string& who, const char* what);
void expect_not_negative(double value, const std::string& who, const char* what);
void expect_finite(double value, const std::string& who, const char* what);
/// Throws unless `node` is one of `nodes` nodes of a thermal network, from 0.
void expect_node(int node, int nodes, const std::string& who);

// Binding of an element to a chain, common to all sources of errors.

/// Returns the joint that an element's axis letter denotes. 'S' is the joint S (a spindle that
/// carries the workpiece) if the chain has one, else the nose s.
/// @param who  begins the message
/// @throws std::invalid_argument if the chain lacks the axis
int joint_of(char axis, const kinematics::Chain& chain, const std::string& who);

/// Checks that an element exists for a joint.
/// @param joint  index of the axis in the chain
/// @throws std::invalid_argument naming the element and the reason if it is meaningless for that
///         joint: an angle of an axis about itself, an offset of a slide or along a rotary axis (a
///         constant error motion expresses that), a squareness that belongs to another slide or to
///         which no slide is a reference, a spindle's rotation about itself
void check_meaning(const ElementName& name, const kinematics::Chain& chain, int joint);

/// Returns the meaning of a location element on this machine: "squareness of Y to X", "parallelism
/// of A to X about Y", "offset of C along X".
std::string meaning(const ElementName& name, const kinematics::Chain& chain, int joint);

/// The location error that is equivalent to the slope of a straightness.
struct SquarenessContribution {
  ElementName name;    ///< of the slide to which the angle belongs: EC0Y, EB0Z, EA0Z
  double value = 0.0;  ///< rad, to be added to that element
};

/// Returns the squareness to which a slope removed by `detrend` belongs: the slope of EXY turns Y,
/// which is EC0Y; that of EYX turns X, which is Y turned the other way. One contribution for each
/// bed axis about which the slide turns, hence one for slides along the bed axes, whatever their
/// sense.
/// @param slope   per mm of the carriage's own travel (on a primed axis: minus that per command)
/// @param joints  of the machine
/// @throws std::invalid_argument unless the element is a straightness of a slide of the machine
///         that forms an angle with another
std::vector<SquarenessContribution> squareness_contributions(
    const ElementName& straightness, double slope, std::span<const kinematics::Joint> joints);

}  // namespace abbe::errors
