#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kinematics/chain.h"
#include "sim/program/nc_options.h"
#include "sim/scene/bodies.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"

/// A machine as it is designed, and what its control believes and finds.
namespace abbe::sim {

/// A machine as its file describes it; every length mm, every angle rad, in the bed frame at zero.
struct MachineDescription {
  std::string name;
  std::vector<kinematics::Joint> joints;                 ///< in the order of the structural code
  kinematics::Pose T_bw = kinematics::Pose::Identity();  ///< workpiece, axes at zero
  kinematics::Pose T_bs =
      kinematics::Pose::Identity();         ///< spindle nose or tool post; z = tool axis
  kinematics::AxisVector home;              ///< (joints) where the axes stand when a program begins
  std::vector<program::Rollover> rollover;  ///< (joints) of the axes that turn
  kinematics::AxisVector reference;         ///< (joints) reference position, of G28; empty: `home`
  kinematics::AxisVector machine_zero;  ///< (joints) where G53 counts from; empty: the axes' zero
  double rapid_speed = 10000.0 / 60.0;  ///< mm/s
  double rapid_turn = 1.0;              ///< rad/s
  std::optional<double> max_spindle_speed;  ///< rad/s; none: no limit is known
  std::string summary;                      ///< one line, for lists of machines
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

struct Key;
template <typename T>
class Fields;

MachineDescription read_machine(const Node& table, InputErrors& input_errors);
Node::Table written_machine(const MachineDescription& machine);
std::vector<Key> machine_keys();

/// `[control]`: what the control believes where it differs.
/// @param joints  of the machine as it is designed
ControlDescription read_control(const Node& table, const std::vector<kinematics::Joint>& joints,
                                InputErrors& input_errors);
Node::Table written_control(const ControlDescription& control);
std::vector<Key> control_keys();

/// `[setup]`, whose value starts from zero, and `[datum]`
const Fields<kinematics::Deviation>& setup_fields();
const Fields<DatumDescription>& datum_fields();

// The names by which a search for collisions reports bodies, and leaves pairs of them out.

/// Of a machine, in its order: what has no name of its own is "body of X", or "body 2 of X" where X
/// carries several such.
std::vector<std::string> machine_body_names(const MachineDescription& machine);

/// What has no name of its own is "fixture", or "fixture 2" of several such.
std::vector<std::string> fixture_names(const std::vector<BodyDescription>& fixtures);

/// Refuses a body of a machine with the name of another, or with one that part, stock and tool
/// have.
/// @param machine  the table that it was read from
void check_body_names(TableReader& machine, const MachineDescription& described);

/// The same of fixtures, bodies of the machine among the others. @param scene  likewise
void check_fixture_names(TableReader& scene, const MachineDescription& machine,
                         const std::vector<BodyDescription>& fixtures);

/// Refuses pairs to be left out of which one is not there. @param scene  likewise
void check_ignored_names(TableReader& scene, const MachineDescription& machine,
                         const std::vector<BodyDescription>& fixtures);

}  // namespace abbe::sim
