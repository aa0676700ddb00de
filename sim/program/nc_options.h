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

namespace abbe::sim::program {

/// How a control turns a rotary axis to an absolute position (Fanuc's parameters 1008#0 ROA and #1
/// RAB). Incremental words turn by what they say under every rule.
enum class Rollover {
  ByControl,  ///< as the dialect of the program usually has it
  None,       ///< by the difference of the positions
  Shortest,   ///< whole turns do not count, the short way; of two equal ways that of the difference
  Sign,       ///< whole turns do not count, in the direction of the word's sign
};

/// One controlled axis, in the order of the structural code.
struct ControlledAxis {
  char name = 'X';
  kinematics::Motion motion = kinematics::Motion::Linear;
  Rollover rollover = Rollover::ByControl;
};

/// The joint that S and M3 turn: the rotary S that carries the workpiece, else the nose s; -1 for
/// none.
int spindle_of(const std::vector<ControlledAxis>& axes);

/// Returns true if a spindle turns the workpiece: a rotary axis S.
bool turns_workpiece(const std::vector<ControlledAxis>& axes);

/// Joints that words address by letter; -1 where a letter addresses none, as that of a spindle.
std::array<int, 26> joints_by_letter(const std::vector<ControlledAxis>& axes);
/// Names of the axes that words address, "X Y Z A C".
std::string axis_letter_list(const std::vector<ControlledAxis>& axes);

/// Squares of how far a block goes along a line, spindles left out.
struct SquaredDistance {
  double xyz = 0.0, uvw = 0.0, turns = 0.0;  ///< mm^2, rad^2
};
SquaredDistance squared_distances(const std::vector<ControlledAxis>& axes,
                                  const kinematics::AxisVector& start,
                                  const kinematics::AxisVector& end);

/// How far a block goes as F counts it: mm of X Y Z, else of U V W, else degrees of turns.
/// @param arc   in X Y Z, if the block is one
/// @param turn  of its plane, if that is turned
struct Way {
  double length = 0.0;
  bool linear = true;  ///< mm; else degrees
};
Way feed_distance(const std::vector<ControlledAxis>& axes, const kinematics::AxisVector& start,
                  const kinematics::AxisVector& end, const Arc* arc = nullptr,
                  const Eigen::Matrix3d* turn = nullptr);

/// Levels of the operator's block skip, by number: / alone is 0 of Siemens and 1 of Fanuc.
using BlockSkip = std::bitset<10>;

/// Returns the levels that "on", "off" or digits such as "1 3" name; nothing for other text.
std::optional<BlockSkip> parse_block_skip(std::string_view text);
/// Returns that text.
std::string to_text(const BlockSkip& levels);

/// What a control knows before it reads a program. Lengths mm, angles rad, speeds mm/s.
struct NcOptions {
  std::vector<ControlledAxis> axes;                     ///< every joint of the machine
  kinematics::AxisVector start;                         ///< (axes) where the axes stand at first
  std::map<int, double> tool_length;                    ///< mm by H number; an unknown H is refused
  std::map<int, double> tool_radius;                    ///< mm by D number, for cutter and nose
                                                        ///< compensation
  std::map<std::string, int, std::less<>> tool_number;  ///< by name, of those that have one
  std::map<int, double> length_wear, radius_wear;       ///< mm, what of those above is wear
  bool tool_table = false;  ///< they are all that the control knows: a call of another is refused
  int control_tool = 0;     ///< with such a table: the tool that `control` ends with; 0: in none
  std::array<kinematics::AxisVector, 6>
      work_offset{};  ///< G54 .. G59, (axes) each, as `program_zero` has it;
                      ///< empty means none is stated
  std::map<int, kinematics::AxisVector>
      more_offset;  ///< likewise, of a control's table: 7 to 9 G59.1 to G59.3 of LinuxCNC; 0 the
                    ///< external one and 100 + n G54.1 Pn of Fanuc; 507 to 599 G507 to G599 of
                    ///< Siemens; 1000 + n preset n of Heidenhain
  double rapid_speed = 10000.0 / 60.0;                       ///< mm/s along the way
  double rapid_turn = 3600.0 / 60.0 * 0.017453292519943295;  ///< rad/s for a block of turns only
  std::optional<double> max_spindle_rpm;          ///< of the spindle; none: no limit is known
  std::optional<kinematics::Chain> control;       ///< the control's own chain: G43.4 needs it to
                                                  ///< know where the tip stands when it is
                                                  ///< switched on; without it G43.4 is refused
  std::map<int, kinematics::Chain> control_of_h;  ///< of several tools: `control` to the tip of
                                                  ///< each, by H, for G43.4
  BlockSkip block_skip = BlockSkip().set();  ///< blocks behind a / of these levels are left out
  kinematics::AxisVector reference;          ///< (axes) reference position, of G28; empty: `start`
  kinematics::AxisVector
      machine_zero;  ///< (axes) where G53, M91 and SUPA count from; empty: the zero of the axes
  std::size_t max_bytes = std::size_t(1) << 31;  ///< larger programs are refused
  std::size_t max_moves = 20'000'000;  ///< moves and dwells, those of loops and cycles each time
  std::size_t max_move_bytes = std::size_t(4) << 30;  ///< of moves that are kept
};

/// The offset of a coordinate system, (axes); empty where none is stated.
/// @param system  1 to 6, G54 to G59, or a number of `more_offset`
const kinematics::AxisVector& work_offset(const NcOptions& options, int system);

/// Whether a tool can be called: T0, or one of the control's table where it has one.
bool knows_tool(const NcOptions& options, int number);

/// Returns the number of the tool if there is exactly one: the scene's, or that of a tool table of
/// one line. Returns nothing if there are several, or none.
std::optional<int> only_tool(const NcOptions& options);

/// Where the axes stand at first: zero unless stated.
/// @throws std::invalid_argument if `start` has not one number for every axis
kinematics::AxisVector start_of(const NcOptions& options);

/// Returns the reference position, (axes): where the axes stand at first unless it is stated.
kinematics::AxisVector reference_of(const NcOptions& options);

// Where the zero of a program lies: what the X Y Z of a work offset mean.

/// Where the tip stands in the workpiece with all axes at zero, mm.
/// @return none without X Y Z, or where these do not run along the workpiece's x y z then (1e-9)
std::optional<Eigen::Vector3d> tip_at_zero(const kinematics::Chain& chain);

/// Returns what to add to the positions of X Y Z so that the tip of a turning tool stands in the
/// workpiece where they say, X0 on the spindle line: (axes), none where these slides are not at
/// right angles to each other (1e-9).
std::optional<kinematics::AxisVector> tip_shift(const kinematics::Chain& chain);

/// What work offsets count from, on a machine for which `tip_at_zero` has an answer.
struct ProgramZero {
  /// mm, where the spindle's nose stands in the workpiece with all axes at zero: above the tip by
  /// the length of the tool that the control's chain ends with
  Eigen::Vector3d nose_w = {0, 0, 0};
  bool places = false;  ///< offsets are places in the workpiece; else positions of the slides
};

/// The rule of a control: on a machine with rotary axes an offset is the place in the workpiece to
/// which X0 Y0 Z0 lead the tip, with the tip commanded and, the rotary axes at zero and a tool
/// length in force, with the axes commanded. On any other machine it is the positions of the slides
/// at which the nose is there. None where nothing is known, or the scene states no offset: then
/// offsets are zero, of the workpiece where the tip is commanded and of the axes where these are.
std::optional<ProgramZero> program_zero(const NcOptions& options);

/// The same whether an offset is stated or not, for controls that always count so.
std::optional<ProgramZero> known_zero(const NcOptions& options);

/// What comes on top of an offset in these coordinates, mm.
Eigen::Vector3d offset_correction(const std::optional<ProgramZero>& zero, Coordinates coordinates);

}  // namespace abbe::sim::program
