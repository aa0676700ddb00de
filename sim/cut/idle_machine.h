#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "kinematics/chain.h"
#include "sim/machine/truth.h"
#include "sim/scene/scene.h"

/// The pose errors of a machine at rest and their sources, and lists of poses read from CSV.
namespace abbe::sim {

/// The machine of a scene with all its errors, at rest: no program runs, nothing is cut, no datum
/// is measured. Heat comes from the history before the program, whose last phase continues after
/// time 0.
struct IdleMachine {
  Scene scene;  ///< with the run-out of a tool spindle as part of the tool
  Machine machine;
  Truth truth;
};

/// Returns the machine of a scene at rest.
/// @throws BadInput as `compile` and `make_truth`
IdleMachine idle_machine(const Scene& scene);

/// Nominal and actual pose of the tool in the workpiece, T_wt.
struct TipPose {
  kinematics::Pose nominal;
  kinematics::Pose actual;

  Eigen::Vector3d deviation() const { return actual.translation() - nominal.translation(); }
  /// Returns the deviation of the tool axis (unit vector from the tip to the spindle); its
  /// components across the axis are angles in rad.
  Eigen::Vector3d direction() const { return actual.linear().col(2) - nominal.linear().col(2); }
};

/// Returns the pose at an axis state.
/// @throws std::out_of_range naming the element if a position lies outside an error table that does
///     not extrapolate
TipPose tip_pose(const IdleMachine& idle, const kinematics::AxisState& state);

/// Returns true if a joint has commanded positions, i.e. is not the spindle nose s.
bool is_positioned(const kinematics::Joint& joint);

/// Returns the names of the positioned axes, such as "X A C".
std::string axis_names(const kinematics::Chain& chain);

/// Returns the unit in which positions are printed: 1 mm for a slide, a degree in rad for a rotary
/// axis.
double position_unit(const kinematics::Joint& joint);
/// Returns the name of that unit: "mm" or "deg".
const char* position_unit_label(const kinematics::Joint& joint);

/// Returns a text such as "X between -300 and 300 mm".
std::string travel_text(const kinematics::Joint& joint);

/// A single source of deviation of the tip.
struct ErrorSource {
  struct Tool {};           ///< actual against ordered tool
  struct Clamping {};       ///< actual against nominal clamping of the part
  struct Compliance {};     ///< deflection under weight and clamping
  struct PartExpansion {};  ///< the part is judged at 20 deg C
  std::string name;         ///< "EXX", "EXX_heat", "X_expansion", "EXS_vibration", "tool",
                            ///< "clamping", "compliance", "part_expansion"
  std::variant<errors::GeometricModel, errors::ThermalModel, errors::VibrationModel, Tool, Clamping,
               Compliance, PartExpansion>
      what;
};

/// Returns every error source of the machine, in this order: tool, clamping, geometric elements as
/// in the scene, vibrations, heat (element by element, screw by screw, then the expansion of the
/// part), compliance.
std::vector<ErrorSource> error_sources(const IdleMachine& idle);

/// Returns the sources with the given names, in the order of the names; "all" means every
/// source.
/// @throws BadInput if the machine has no source of a name, or if a name occurs twice
std::vector<ErrorSource> select_sources(std::vector<ErrorSource> all,
                                        const std::vector<std::string>& names);

/// Returns the contribution of each source to the deviation of the tip and of the tool axis, in the
/// workpiece frame. Those of tool and clamping are exact; the others are linearised about the
/// machine with that tool and clamping. The sum over all sources differs from the deviation of the
/// tip by at most (T^2 L / 2 + T D + G (T L + D)) (1 + 2 T), and from that of the axis by T^2 / 2
/// (1 + T). T is the sum of the angles and D of the displacements of all joints, tool and part, L
/// the longest arm from them to the tip or the longest travel, G the growth of the part (100 urad,
/// 30 um, 1 m: 8 nm).
/// @return (6 x sources) [tip mm | axis rad]
/// @throws std::out_of_range if a position lies outside an error table that does not extrapolate
Eigen::Matrix<double, 6, Eigen::Dynamic> source_contributions(
    const IdleMachine& idle, const std::vector<ErrorSource>& sources,
    const kinematics::AxisState& state);

/// A list of poses in the columns and units of the user.
struct PoseList {
  struct Column {
    std::string head;   ///< "X_mm", "A_deg", "A_rad", "time_s", "time_min", "time_h"
    int joint = -1;     ///< of the chain; -1: time
    double unit = 1.0;  ///< size of one unit in mm, rad or s
  };
  std::vector<Column> columns;
  std::vector<double> numbers;    ///< (poses x columns) by rows, in the unit of the column
  std::vector<int> line;          ///< (poses) line in the file; empty without a file
  std::string file;               ///< name of the source in messages
  kinematics::AxisVector others;  ///< (joints) positions of axes without a column

  std::size_t size() const { return columns.empty() ? 0 : numbers.size() / columns.size(); }
  /// Returns true if a column gives the time.
  bool is_timed() const;
  /// Returns the axis state of a pose, in mm, rad and s.
  kinematics::AxisState state(std::size_t pose) const;
  /// Returns a text such as "X_mm = 100, A_deg = 30".
  std::string text(std::size_t pose) const;
};

/// Limits on a file of poses and on their number.
inline constexpr std::size_t max_pose_bytes = std::size_t(1) << 30;
inline constexpr std::size_t max_poses = 10'000'000;

/// Reads poses from CSV. The header names axes as X_mm, A_deg or A_rad and optionally time_s,
/// time_min or time_h from the start of the program, in any order; each further row is a pose.
/// Cells are separated by commas, semicolons or blanks; empty lines and lines that begin with # are
/// skipped. Axes without a column stand at zero.
/// @param file  name of the source in messages
/// @throws BadScene with up to 20 input errors, each with line and column: an unknown or repeated
///     column, no axis, a missing or surplus cell, a cell that is not a number within +-1e9, a
///     position beyond the travel, no pose, or more than `max_poses`
PoseList read_poses(std::string_view text, const std::string& file, const kinematics::Chain& chain);

/// Reads poses from a file.
/// @throws BadScene as `read_poses`, BadInput if the file is larger than `max_pose_bytes`
PoseList read_poses_file(const std::filesystem::path& file, const kinematics::Chain& chain);

/// Returns warnings about assumptions of the poses, a sentence each with figures: on reversal and
/// repeatability, since nothing moves, and on curves beyond the range for which they are stated.
/// @param lower, upper  (joints) bounds of the poses
std::vector<std::string> pose_warnings(const IdleMachine& idle, const kinematics::AxisVector& lower,
                                       const kinematics::AxisVector& upper);

/// Returns the same warnings for a list, and those about its time column: a machine without heat,
/// and times before the history or after it.
std::vector<std::string> pose_warnings(const IdleMachine& idle, const PoseList& poses);

}  // namespace abbe::sim
