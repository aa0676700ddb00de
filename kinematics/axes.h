#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace abbe::kinematics {

inline constexpr int max_joints = 8;

/// One number per joint in the order of the structural code (workpiece to tool), whatever the
/// letters are: mm for slides, rad for turns and spindles.
using AxisVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, max_joints, 1>;

enum class Motion {
  Linear,   ///< slide
  Rotary,   ///< turn; a spindle that carries the workpiece is one
  Spindle,  ///< `s`, the spindle nose: turns a tool of revolution, so it moves nothing nominally
            ///< and its frame does not turn with it; a place for deviations
};

enum class Side {
  Workpiece,  ///< primed: commanded + moves the carriage the other way (ISO 841)
  Tool,
};

/// Where the axes are commanded to be, when, and which way they came: all that the deviations of a
/// machine may depend on.
struct AxisState {
  AxisVector q;  ///< (n) commanded positions
  double time_s = 0.0;
  std::array<std::int8_t, max_joints> direction{};  ///< +1 up, -1 down, 0 has not moved yet
  std::array<std::int32_t, max_joints> stroke{};    ///< reversals so far, counted from the start
  double spindle_speed = 0.0;  ///< rad/s, of the spindle that carries the tool or the workpiece
};

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
