#pragma once

#include <array>
#include <string>
#include <vector>

#include "kinematics/axis.h"
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
std::string letters_of(const std::vector<ControlledAxis>& axes);

/// Squares of how far a block goes along a line, spindles left out.
struct SquaredWay {
  double xyz = 0.0, uvw = 0.0, turns = 0.0;  ///< mm^2, rad^2
};
SquaredWay squared_way(const std::vector<ControlledAxis>& axes, const kinematics::AxisVector& start,
                       const kinematics::AxisVector& end);

/// How far a block goes as F counts it: mm of X Y Z, else of U V W, else degrees of turns.
/// @param arc   in X Y Z, if the block is one
/// @param turn  of its plane, if that is turned
struct Way {
  double length = 0.0;
  bool linear = true;  ///< mm; else degrees
};
Way way_of_feed(const std::vector<ControlledAxis>& axes, const kinematics::AxisVector& start,
                const kinematics::AxisVector& end, const Arc* arc = nullptr,
                const Eigen::Matrix3d* turn = nullptr);

}  // namespace abbe::sim::program
