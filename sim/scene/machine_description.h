#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/chain.h"

/// A machine as it is designed, and what its control believes and finds.
namespace abbe::sim {

/// A block that stands for a part of the machine, such as its ram or its table: for pictures, and
/// for whoever asks what meets what.
struct MachineBody {
  std::string name;
  std::optional<int> joint;                             ///< that carries it; none: the bed
  Eigen::Vector3d size = Eigen::Vector3d::Zero();       ///< mm, along its own x y z
  kinematics::Pose T_b = kinematics::Pose::Identity();  ///< its middle, axes at zero
};

/// A machine as its file describes it; every length mm, every angle rad, in the bed frame at zero.
struct MachineDescription {
  std::string name;
  std::vector<kinematics::Joint> joints;                 ///< in the order of the structural code
  kinematics::Pose T_bw = kinematics::Pose::Identity();  ///< workpiece, axes at zero
  kinematics::Pose T_bs =
      kinematics::Pose::Identity();     ///< spindle nose or tool post; z = tool axis
  kinematics::AxisVector home;          ///< (joints) where the axes stand when a program begins
  double rapid_speed = 10000.0 / 60.0;  ///< mm/s
  double rapid_turn = 1.0;              ///< rad/s
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
