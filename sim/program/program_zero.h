#pragma once

#include <optional>

#include "sim/program/nc_options.h"
#include "sim/program/path.h"

/// Where the zero of a program lies: what the X Y Z of a work offset mean.
namespace abbe::sim::program {

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
Eigen::Vector3d on_top_of_offset(const std::optional<ProgramZero>& zero, Coordinates coordinates);

}  // namespace abbe::sim::program
