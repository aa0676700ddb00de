#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "kinematics/axes.h"
#include "kinematics/chain.h"
#include "sim/program/path.h"

/// The axes, tables and settings of a control before it reads a program.
namespace abbe::sim::program {

/// Roll-over rule: how a control moves a rotary axis to an absolute position (Fanuc parameters
/// 1008#0 ROA and #1 RAB). Incremental values are not affected.
enum class Rollover {
  ByControl,  ///< the usual rule of controls of the dialect
  None,       ///< rotates by the difference between the positions
  /// Rotates modulo whole turns in the shorter direction; if both are equally long, as `None`.
  Shortest,
  Sign,  ///< rotates modulo whole turns in the direction of the sign of the value
};

/// A controlled axis; lists of them are in the order of the structural code.
struct ControlledAxis {
  char name = 'X';
  kinematics::Motion motion = kinematics::Motion::Linear;
  Rollover rollover = Rollover::ByControl;
};

/// Returns the joints of a chain as controlled axes.
std::vector<ControlledAxis> controlled_axes(const kinematics::Chain& chain);

/// Returns the joint that S and M3 turn: the rotary axis S that carries the workpiece, otherwise
/// the tool spindle s; -1 if there is neither.
int find_spindle(const std::vector<ControlledAxis>& axes);

/// Returns true if the machine has a spindle that turns the workpiece, i.e. a rotary axis S.
bool turns_workpiece(const std::vector<ControlledAxis>& axes);

/// Returns the joint that each letter addresses; -1 for letters of spindles or of no axis.
std::array<int, 26> joints_by_letter(const std::vector<ControlledAxis>& axes);
/// Returns the names of the axes that NC words address, for example "X Y Z A C".
std::string axis_letter_list(const std::vector<ControlledAxis>& axes);

/// Squared lengths of a straight move: of X Y Z, of U V W and of the rotary axes without spindles.
struct SquaredDistance {
  double xyz = 0.0, uvw = 0.0, rotation = 0.0;  ///< mm^2, mm^2 and rad^2
};
/// Returns the squared lengths of the straight move from `start` to `end`.
SquaredDistance squared_distances(const std::vector<ControlledAxis>& axes,
                                  const kinematics::AxisVector& start,
                                  const kinematics::AxisVector& end);

/// The length of a block to which F refers: mm of X Y Z; if they do not move, mm of U V W; if these
/// do not move either, degrees of rotation.
struct FeedLength {
  double length = 0.0;
  bool linear = true;  ///< true: mm; false: degrees
};
/// Returns the length of a block to which F refers. `arc` is its arc in X Y Z or null;
/// `plane_rotation` is the rotation of the plane of the arc, or null.
FeedLength feed_length(const std::vector<ControlledAxis>& axes, const kinematics::AxisVector& start,
                       const kinematics::AxisVector& end, const Arc* arc = nullptr,
                       const Eigen::Matrix3d* plane_rotation = nullptr);

/// The block skip levels that are switched on. A plain / is level 0 on Siemens and level 1 on
/// Fanuc.
using BlockSkip = std::bitset<10>;

/// Parses "on", "off" or level digits such as "1 3". Returns nothing for any other text.
std::optional<BlockSkip> parse_block_skip(std::string_view text);
/// Returns the text that `parse_block_skip` parses.
std::string to_text(const BlockSkip& levels);

/// State and tables of a control before it reads a program. Lengths mm, angles rad, speeds mm/s.
struct NcOptions {
  std::vector<ControlledAxis> axes;   ///< every joint of the machine
  kinematics::AxisVector start;       ///< (axes) initial position
  std::map<int, double> tool_length;  ///< mm by H number; an unknown H is an input error
  std::map<int, double> tool_radius;  ///< mm by D number, for cutter and nose radius compensation
  std::map<std::string, int, std::less<>> tool_number;  ///< by name, for tools with a name
  std::map<int, double> length_wear, radius_wear;       ///< mm, wear that the values above include
  /// True: the tables above are complete, and a call of another tool is an input error.
  bool tool_table = false;
  int control_tool = 0;  ///< with a tool table: the tool at whose tip `control` ends; 0: none
  /// G54 .. G59, (axes) each, see `program_zero`; empty: not stated
  std::array<kinematics::AxisVector, 6> work_offset{};
  /// Further offsets of a control: 7 to 9 are G59.1 to G59.3 of LinuxCNC; 0 is the external offset
  /// and 100 + n G54.1 Pn of Fanuc; 507 to 599 are G507 to G599 of Siemens; 1000 + n is preset n of
  /// Heidenhain.
  std::map<int, kinematics::AxisVector> extra_offsets;
  double rapid_speed = 10000.0 / 60.0;  ///< mm/s along the path
  double rapid_rotation_speed =
      3600.0 / 60.0 * 0.017453292519943295;  ///< rad/s of a block that only rotates
  std::optional<double> max_spindle_rpm;     ///< empty: unlimited
  /// The control's model of the machine, which gives the tip position for G43.4; without it G43.4
  /// is an input error.
  std::optional<kinematics::Chain> control;
  /// With several tools: the control's model to the tip of each, by H number.
  std::map<int, kinematics::Chain> control_by_h;
  BlockSkip block_skip = BlockSkip().set();  ///< blocks with a / of these levels are skipped
  kinematics::AxisVector reference;          ///< (axes) reference position of G28; empty: `start`
  /// (axes) origin of G53, M91 and SUPA; empty: the zero of the axes.
  kinematics::AxisVector machine_zero;
  std::size_t max_bytes = std::size_t(1) << 31;  ///< larger programs are an input error
  /// Limit on moves and dwells; those in loops and cycles count each time they are executed.
  std::size_t max_moves = 20'000'000;
  std::size_t max_move_bytes = std::size_t(4) << 30;  ///< memory of the moves that are kept
};

/// Returns the offset of a coordinate system, (axes); empty if it is not stated. `system` is 1 to 6
/// for G54 to G59, or a key of `extra_offsets`.
const kinematics::AxisVector& work_offset(const NcOptions& options, int system);

/// Returns true if a tool can be called: tool 0 and the tools of the table; without a table, any.
bool is_known_tool(const NcOptions& options, int number);

/// Returns the number of the tool if there is exactly one: the tool of the scene, or that of a tool
/// table with one line.
std::optional<int> only_tool(const NcOptions& options);

/// Returns the initial axis positions: zero unless stated. Throws std::invalid_argument if `start`
/// does not have one number for each axis.
kinematics::AxisVector initial_position(const NcOptions& options);

/// Returns the reference position, (axes): the initial position unless it is stated.
kinematics::AxisVector reference_position(const NcOptions& options);

// Program zero: the point to which X Y Z of a work offset refer.

/// Returns the position of the tip in the workpiece with all axes at zero, mm. Returns nothing if
/// X, Y or Z is missing or not parallel (to 1e-9) to x, y and z of the workpiece at that position.
std::optional<Eigen::Vector3d> tip_at_zero(const kinematics::Chain& chain);

/// Returns the shift of X Y Z, (axes), by which programmed positions become positions of the tip of
/// a turning tool in the workpiece, with X0 on the spindle axis. Returns nothing if the slides are
/// not perpendicular to each other (to 1e-9).
std::optional<kinematics::AxisVector> tip_shift(const kinematics::Chain& chain);

/// Origin of work offsets on a machine for which `tip_at_zero` is not empty.
struct ProgramZero {
  /// mm, position of the spindle nose in the workpiece with all axes at zero. It is above the tip
  /// by the length of the tool at whose tip the chain of the control ends.
  Eigen::Vector3d nose_w = {0, 0, 0};
  bool places = false;  ///< true: offsets are points in the workpiece; false: slide positions
};

/// Returns the origin of work offsets. On a machine with rotary axes an offset is the point of the
/// workpiece to which X0 Y0 Z0 lead the tip, both with the tip commanded and, if the rotary axes
/// are at zero and a tool length is in force, with the axes commanded. On any other machine an
/// offset consists of the slide positions at which the nose is at that point. Returns nothing if
/// the kinematics are unknown or the scene states no offset; X0 Y0 Z0 is then the origin of the
/// workpiece under a tip mode, and the zero of the axes otherwise.
std::optional<ProgramZero> program_zero(const NcOptions& options);

/// Returns the origin of `program_zero` even if the scene states no offset, for controls on which
/// offsets always have this origin.
std::optional<ProgramZero> workpiece_zero(const NcOptions& options);

/// Returns the correction, mm, that has to be added to a work offset under these coordinates.
Eigen::Vector3d offset_correction(const std::optional<ProgramZero>& zero, Coordinates coordinates);

}  // namespace abbe::sim::program
