#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/chain.h"
#include "sim/program/controlled_axes.h"
#include "sim/scene/body_description.h"

/// A machine as it is designed, and what its control believes and finds.
namespace abbe::sim {

/// A machine as its file describes it; every length mm, every angle rad, in the bed frame at zero.
struct MachineDescription {
  std::string name;
  std::vector<kinematics::Joint> joints;                 ///< in the order of the structural code
  kinematics::Pose T_bw = kinematics::Pose::Identity();  ///< workpiece, axes at zero
  kinematics::Pose T_bs =
      kinematics::Pose::Identity();     ///< spindle nose or tool post; z = tool axis
  kinematics::AxisVector home;          ///< (joints) where the axes stand when a program begins
  std::vector<program::Rollover> rollover;  ///< (joints) of the axes that turn
  kinematics::AxisVector reference;     ///< (joints) reference position, of G28; empty: `home`
  kinematics::AxisVector machine_zero;  ///< (joints) where G53 counts from; empty: the axes' zero
  double rapid_speed = 10000.0 / 60.0;  ///< mm/s
  double rapid_turn = 1.0;              ///< rad/s
  std::optional<double> max_spindle_speed;  ///< rad/s; none: no limit is known
  std::string summary;                  ///< one line, for lists of machines
  std::vector<MachineBody> bodies;
};

/// What the control believes, where it differs from the nominal machine.
struct ControlDescription {
  std::vector<kinematics::Joint> joints;  ///< as it believes (points, directions)
  std::optional<double> tool_length;      ///< mm
};

struct DatumDescription {
  enum class Kind { None, Ideal, TouchOff } kind = Kind::None;
  struct Touch {
    Eigen::Vector3d point_w;      ///< mm
    Eigen::Vector3d direction_w;  ///< unit, along which the probe touches
  };
  std::vector<Touch> touches;                         ///< touch_off
  Eigen::Vector3d point_w = Eigen::Vector3d::Zero();  ///< ideal: where the tip is set exactly
  double time_s = 0.0;
};

}  // namespace abbe::sim
