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

#include "kinematics/chain.h"
#include "sim/program/controlled_axes.h"

namespace abbe::sim::program {

/// Levels of the operator's block skip, by number: / alone is 0 of Siemens and 1 of Fanuc.
using BlockSkip = std::bitset<10>;

/// Returns the levels that "on", "off" or digits such as "1 3" name; nothing for other text.
std::optional<BlockSkip> block_skip_of(std::string_view text);
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
  BlockSkip block_skip = BlockSkip().set();       ///< blocks behind a / of these levels are left out
  kinematics::AxisVector reference;  ///< (axes) reference position, of G28; empty: `start`
  kinematics::AxisVector
      machine_zero;  ///< (axes) where G53, M91 and SUPA count from; empty: the zero of the axes
  std::size_t max_bytes = std::size_t(1) << 31;   ///< larger programs are refused
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

}  // namespace abbe::sim::program
