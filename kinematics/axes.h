#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace abbe::kinematics {

inline constexpr int max_joints = 8;

/// Values of all joints in the order of the structural code (workpiece to tool), whatever their
/// letters: mm for slides, rad for rotary axes and spindles.
using AxisVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, max_joints, 1>;

enum class Motion {
  Linear,   ///< linear axis
  Rotary,   ///< rotary axis, also a spindle that carries the workpiece
  Spindle,  ///< the spindle nose `s`: it turns a tool of revolution, so its nominal motion is the
            ///< identity and its frame does not turn with it; it only carries deviations
};

enum class Side {
  Workpiece,  ///< primed in the code: a positive command moves the carriage in the negative
              ///< direction (ISO 841)
  Tool,
};

/// Commanded positions, time, direction of approach, stroke and spindle speed: every quantity on
/// which the deviations of a machine may depend.
struct AxisState {
  AxisVector q;  ///< (n) commanded positions
  double time_s = 0.0;
  std::array<std::int8_t, max_joints> direction{};  ///< +1 up, -1 down, 0 before the first motion
  /// Index of the stroke of every axis: number of its reversals since the start.
  std::array<std::int32_t, max_joints> stroke{};
  double spindle_speed = 0.0;  ///< rad/s, of the spindle that carries the tool or the workpiece
};

/// An axis of a structural code, without w, t and the bed.
struct CodeAxis {
  char name = 'X';  ///< capital axis letter; 's' for the spindle nose
  Side side = Side::Tool;
  friend bool operator==(const CodeAxis&, const CodeAxis&) = default;
};

/// The moving parts in order, from the workpiece via the bed to the tool.
using Topology = std::vector<CodeAxis>;

/// Parses a structural code such as "w C' b X Y Z A s t". Spaces are ignored. Axes of the workpiece
/// side are primed and precede b, those of the tool side are not primed; s is allowed only right
/// before t.
/// @throws std::invalid_argument with a message that says what was expected and what was seen
Topology parse_structural_code(std::string_view code);

/// Returns the structural code with single spaces; parse_structural_code(to_string(x)) == x.
std::string to_string(const Topology& topology);

/// Low-order body array. Bodies are numbered from 1: first the workpiece side from the bed
/// outwards, which ends with the workpiece, then the tool side from the bed outwards, which ends
/// with the tool. `parent[k]` is the parent of body k + 1; 0 is the bed.
/// Source: Peng et al. 2017, whose platform "w S' X' b Z s t" gives 0 1 2 0 4 5.
struct BodyArray {
  std::vector<std::string> body;  ///< "X", "S", "workpiece", "Z", "s", "tool"
  std::vector<int> parent;
};
BodyArray low_order_body_array(const Topology& topology);

}  // namespace abbe::kinematics
