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

namespace abbe::sim {

/// The machine of a scene with all that is wrong with it, standing still: no program runs, nothing
/// is cut, no datum is touched off. Heat comes from the history before the program; after time 0
/// its last phase goes on.
struct IdleMachine {
  Scene scene;  ///< run-out of a tool spindle counted into the tool
  Machine machine;
  Truth truth;
};

/// @throws BadInput as `compile` and `truth_of`
IdleMachine idle_machine(const Scene& scene);

/// Where the tool should be and where it is, T_wt.
struct TipPose {
  kinematics::Pose nominal;
  kinematics::Pose actual;

  Eigen::Vector3d deviation() const { return actual.translation() - nominal.translation(); }
  /// Of the tool axis, a unit vector from the tip to the spindle: rad across it.
  Eigen::Vector3d direction() const { return actual.linear().col(2) - nominal.linear().col(2); }
};

/// @throws std::out_of_range naming the element where a table that refuses is left
TipPose tip_pose(const IdleMachine& idle, const kinematics::AxisState& state);

/// Whether a joint has positions to be commanded, which the nose s has not.
bool is_positioned(const kinematics::Joint& joint);

/// "X A C", the axes that can be positioned.
std::string axis_names(const kinematics::Chain& chain);

/// mm of a slide, degrees of a turn, in which positions are said; and the name of that unit.
double position_unit(const kinematics::Joint& joint);
const char* position_unit_label(const kinematics::Joint& joint);

/// "X between -300 and 300 mm"
std::string travel_text(const kinematics::Joint& joint);

/// One cause of a deviation, alone.
struct ErrorSource {
  struct Tool {};           ///< as it is, against as ordered
  struct Clamping {};       ///< of the part, against where it should be
  struct Compliance {};     ///< under weight and clamping
  struct PartExpansion {};  ///< the part is judged at 20 deg C
  std::string name;         ///< "EXX", "EXX_heat", "X_expansion", "EXS_vibration", "tool",
                            ///< "clamping", "compliance", "part_expansion"
  std::variant<errors::GeometricModel, errors::ThermalModel, errors::VibrationModel, Tool, Clamping,
               Compliance, PartExpansion>
      what;
};

/// Every cause that the machine has: tool, clamping, geometric elements in the order of the scene,
/// vibrations, heat element by element and screw by screw, compliance, the part's expansion.
std::vector<ErrorSource> error_sources(const IdleMachine& idle);

/// Those of these names in their order; "all" stands for every one.
/// @throws BadInput for a name that the machine lacks, or twice
std::vector<ErrorSource> select_sources(std::vector<ErrorSource> all,
                                        const std::vector<std::string>& names);

/// What each source alone adds to the deviation of the tip and to that of the tool axis, in the
/// workpiece frame; tool and clamping exactly, all others to first order about the machine with
/// that tool and clamping.
/// Their sum over all sources misses the deviation of the tip by at most
/// (T^2 L / 2 + T D + G (T L + D)) (1 + 2 T), and that of the axis by T^2 / 2 (1 + T): T the sum of
/// the angles and D of the displacements of all joints, tool and part, L the longest arm from them
/// to the tip or the longest travel, G the growth of the part (100 urad, 30 um, 1 m: 8 nm).
/// @return (6 x sources) [tip mm | axis rad]
/// @throws std::out_of_range where a table that refuses is left
Eigen::Matrix<double, 6, Eigen::Dynamic> source_contributions(
    const IdleMachine& idle, const std::vector<ErrorSource>& sources,
    const kinematics::AxisState& state);

/// Poses that are asked for, as they were written.
struct PoseList {
  struct Column {
    std::string head;   ///< "X_mm", "A_deg", "A_rad", "time_s", "time_min", "time_h"
    int joint = -1;     ///< of the chain; -1: time
    double unit = 1.0;  ///< mm, rad or s for one of its own
  };
  std::vector<Column> columns;
  std::vector<double> numbers;    ///< (poses x columns) by rows, in the unit of the column
  std::vector<int> line;          ///< (poses) of the file; empty where there is none
  std::string file;               ///< what refusals call the source
  kinematics::AxisVector others;  ///< (joints) where axes without a column stand

  std::size_t size() const { return columns.empty() ? 0 : numbers.size() / columns.size(); }
  bool is_timed() const;
  kinematics::AxisState state(std::size_t pose) const;
  /// "X_mm = 100, A_deg = 30"
  std::string text(std::size_t pose) const;
};

inline constexpr std::size_t max_pose_bytes = std::size_t(1) << 30;
inline constexpr std::size_t max_poses = 10'000'000;

/// Reads poses from CSV: a head of axes X_mm, A_deg or A_rad and, if wanted, time_s, time_min or
/// time_h from the start of the program, in any order, then one pose a row; commas, semicolons or
/// blanks; empty lines and lines that begin with # are passed over. Axes without a column stand at
/// zero.
/// @param file  what refusals call it
/// @throws BadScene with the faults of up to 20 rows, each with line and column: a column that is
///         unknown or comes twice, no axis, a cell too few or too many or that is no number within
///         +-1e9, a position beyond the limits of travel, no pose, more than most_poses of them
PoseList read_poses(std::string_view text, const std::string& file, const kinematics::Chain& chain);

/// The same from a file. @throws BadInput also beyond most_pose_bytes
PoseList read_poses_file(const std::filesystem::path& file, const kinematics::Chain& chain);

/// What answers about poses leave out or assume of this machine, a sentence each with figures:
/// reversal and chance, since nothing moves; curves beyond the range over which they are stated.
/// @param least, most  (joints) between which the poses lie
std::vector<std::string> pose_warnings(const IdleMachine& idle, const kinematics::AxisVector& least,
                                       const kinematics::AxisVector& most);

/// The same, and what a column of time cannot say: of a machine without heat, before its history,
/// after it.
std::vector<std::string> pose_warnings(const IdleMachine& idle, const PoseList& poses);

}  // namespace abbe::sim
