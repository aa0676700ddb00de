#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "errors/curve.h"

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

}  // namespace abbe::errors
