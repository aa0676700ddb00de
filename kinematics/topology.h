#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "kinematics/axis.h"

namespace abbe::kinematics {

/// One letter of a structural code between w and t, the bed left out.
struct CodeAxis {
  char name = 'X';  ///< capital axis letter; 's' for the spindle nose
  Side side = Side::Tool;
  friend bool operator==(const CodeAxis&, const CodeAxis&) = default;
};

/// The order of the moving parts, from the workpiece over the bed to the tool.
using Topology = std::vector<CodeAxis>;

/// Reads a structural code such as "w C' b X Y Z A s t" (blanks are free; the workpiece side is
/// primed and stands before b, the tool side is not primed; s only right before t).
/// @throws std::invalid_argument with a sentence that says what was expected and what was seen
Topology parse_structural_code(std::string_view code);

/// Writes it back with single blanks; parse(to_string(x)) == x.
std::string to_string(const Topology& topology);

/// Low-order body array: bodies numbered from 1, first the workpiece side from the bed outwards
/// with the workpiece last, then the tool side from the bed outwards with the tool last;
/// `parent[k]` is the parent of body k + 1, 0 the bed.
/// Source: Peng et al. 2017, whose platform "w S' X' b Z s t" gives 0 1 2 0 4 5.
struct BodyArray {
  std::vector<std::string> body;  ///< "X", "S", "workpiece", "Z", "s", "tool"
  std::vector<int> parent;
};
BodyArray low_order_body_array(const Topology& topology);

}  // namespace abbe::kinematics
