#pragma once

#include <array>
#include <cstdint>

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
  AxisVector q;        ///< (n) commanded positions
  double time_s = 0.0;
  std::array<std::int8_t, max_joints> direction{};  ///< +1 up, -1 down, 0 has not moved yet
  std::array<std::int32_t, max_joints> stroke{};    ///< reversals so far, counted from the start
  double spindle_speed = 0.0;  ///< rad/s, of the spindle that carries the tool or the workpiece
};

}  // namespace abbe::kinematics
