#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/chain.h"
#include "sim/program/nc_options.h"
#include "sim/scene/bodies.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

/// Descriptions of the machine as designed, of the belief of its control, and of the datum.
namespace abbe::sim {

/// A machine as designed. Lengths in mm and angles in rad, in the bed frame with all axes at zero.
struct MachineDescription {
  std::string name;
  std::vector<kinematics::Joint> joints;                 ///< in the order of the structural code
  kinematics::Pose T_bw = kinematics::Pose::Identity();  ///< workpiece frame, axes at zero
  kinematics::Pose T_bs =
      kinematics::Pose::Identity();         ///< spindle nose or tool post; z = tool axis
  kinematics::AxisVector home;              ///< (joints) axis positions at the start of a program
  std::vector<program::Rollover> rollover;  ///< (joints) matters for rotary axes only
  kinematics::AxisVector reference;         ///< (joints) reference position of G28; empty: `home`
  kinematics::AxisVector machine_zero;      ///< (joints) origin of G53; empty: the zero of the axes
  double rapid_speed = 10000.0 / 60.0;      ///< mm/s
  double rapid_rotation_speed = 1.0;        ///< rad/s
  std::optional<double> max_spindle_speed;  ///< rad/s; none: no known limit
  std::string summary;                      ///< one line, for lists of machines
  std::vector<MachineBody> bodies;
};

/// Beliefs of the control that differ from the nominal machine.
struct ControlDescription {
  std::vector<kinematics::Joint> joints;  ///< points and directions as believed
  std::optional<double> tool_length;      ///< mm
};

/// The datum: how the control finds the part.
struct DatumDescription {
  enum class Kind { None, Ideal, TouchOff } kind = Kind::None;
  struct Touch {
    Eigen::Vector3d point_w;      ///< mm
    Eigen::Vector3d direction_w;  ///< unit, direction of the touch
  };
  std::vector<Touch> touches;                         ///< for TouchOff
  Eigen::Vector3d point_w = Eigen::Vector3d::Zero();  ///< for Ideal: mm, point at which the tip is
                                                      ///< set exactly
  double time_s = 0.0;  ///< time at which the datum is set, negative before the program
};

struct Key;
template <typename T>
class Fields;

/// Reads and writes `[machine]`.
MachineDescription read_machine(const Node& table, InputErrors& input_errors);
Node::Table machine_to_table(const MachineDescription& machine);
std::vector<Key> machine_keys();

/// Reads and writes `[control]`, the beliefs of the control that differ from the machine.
/// @param joints  of the machine as designed
ControlDescription read_control(const Node& table, const std::vector<kinematics::Joint>& joints,
                                InputErrors& input_errors);
Node::Table control_to_table(const ControlDescription& control);
std::vector<Key> control_keys();

/// Returns the fields of `[setup]`, the deviation of the clamped part, and of `[datum]`.
const Fields<kinematics::Deviation>& setup_fields();
const Fields<DatumDescription>& datum_fields();

// Names of bodies in the reports of the collision check and in its list of ignored pairs.

/// Returns the names of the bodies of a machine, in its order. A body without a name is called
/// "body of X", or "body 2 of X" if axis X carries several such bodies.
std::vector<std::string> machine_body_names(const MachineDescription& machine);

/// Returns the names of fixtures. A fixture without a name is called "fixture", or "fixture 2" if
/// there are several such fixtures.
std::vector<std::string> fixture_names(const std::vector<BodyDescription>& fixtures);

/// Reports every fixture that has the name of another body or a reserved name.
/// @param scene  reader of the scene
void check_fixture_names(TableReader& scene, const MachineDescription& machine,
                         const std::vector<BodyDescription>& fixtures);

/// Reports every ignored pair with an unknown body.
/// @param scene  reader of the scene
void check_ignored_names(TableReader& scene, const MachineDescription& machine,
                         const std::vector<BodyDescription>& fixtures);

}  // namespace abbe::sim
