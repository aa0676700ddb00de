#pragma once

#include <Eigen/Core>

#include "sim/program/nc_block.h"
#include "sim/program/path.h"

namespace abbe::sim::program {

/// A block of G2 or G3 as the control meets it, in its plane, mm.
struct NcArc {
  const NcBlock& words;
  const NcWord& cause;  ///< where a refusal points that is of no other word
  NcPlace place;
  int plane = 170;  ///< tenths of its G code
  bool clockwise = false;
  bool absolute_centre = false;  ///< G90.1
  double unit = 1.0;             ///< mm per unit of length
  Eigen::Vector2d start, end;
  Eigen::Vector2d zero;  ///< from which an absolute centre counts
};

/// The arc by its R or by the I J K of its plane; `first` and `second` are left. An R above zero is
/// the arc of at most half a turn, below zero the other.
/// @throws BadInput at the word that makes no arc; radii at start and end may differ as the README
///         of this folder says
Arc arc_of(const NcArc& block);

}  // namespace abbe::sim::program
