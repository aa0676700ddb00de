#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "errors/curve.h"
#include "kinematics/chain.h"

/// What is wrong with a machine. "Error" means a deviation of the machine, named by ISO 230-1; a
/// failure of the program is an exception or a status, never called an error.
namespace abbe::errors {

/// Name of an element as ISO 230-1 spells it: E, direction, axis. "EYX" is the deviation in Y of
/// the X axis, "ECX" its rotation about Z. A zero marks a location error: "EC0Y" is the
/// squareness of Y.
struct ElementName {
  char direction = 'X';  ///< X Y Z for a translation (mm), A B C for a rotation (rad)
  char axis = 'X';       ///< letter of the joint; 'S' is the spindle, nose or workpiece
  bool location = false;

  bool is_angle() const { return direction >= 'A' && direction <= 'C'; }
  int component() const { return is_angle() ? 3 + (direction - 'A') : direction - 'X'; }
  friend bool operator==(const ElementName&, const ElementName&) = default;
};

/// Reads "EXX", "EC0Y" and the vendors' short "C0Y". The direction letter of a location error says
/// about what the axis is turned (A B C) or along what it is offset (X Y Z).
/// @throws std::invalid_argument saying what was expected and seen
ElementName parse_element_name(std::string_view text);
std::string to_string(const ElementName& name);

/// One element: the sum of its curves.
struct Element {
  ElementName name;
  std::vector<Curve> curves;
};

// What the numbers of a description must be. Each refusal is a std::invalid_argument that begins
// with `who`.

[[noreturn]] void refuse(const std::string& who, const std::string& why);

void expect_positive(double value, const std::string& who, const char* what);
void expect_not_negative(double value, const std::string& who, const char* what);
void expect_finite(double value, const std::string& who, const char* what);
/// One of `nodes` nodes of a thermal network, from 0.
void expect_node(int node, int nodes, const std::string& who);

// What every source of errors asks when it binds an element to a chain.

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

/// Location error that a straight slope of a straightness amounts to.
struct SquarenessContribution {
  ElementName name;    ///< of the slide that states the angle: EC0Y, EB0Z, EA0Z
  double value = 0.0;  ///< rad, to be added to it
};

/// Where a slope taken out by `detrend` belongs: the slope of EXY turns Y, which EC0Y states; that
/// of EYX turns X, which is Y turned the other way. One share a bed axis about which the slide
/// turns, so one for slides along the bed axes, whichever way they point.
/// @param slope   per mm of the carriage's own travel (of a primed axis: minus that per command)
/// @param joints  of the machine
/// @throws std::invalid_argument unless the element is a straightness of a slide of the machine
/// that
///         makes an angle with another
std::vector<SquarenessContribution> squareness_contributions(
    const ElementName& straightness, double slope, std::span<const kinematics::Joint> joints);

}  // namespace abbe::errors
