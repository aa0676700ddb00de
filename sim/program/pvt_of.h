#pragma once

#include <vector>

#include "kinematics/chain.h"
#include "sim/program/path.h"
#include "sim/program/pvt.h"

namespace abbe::sim::program {

struct PvtOfOptions {
  double within = 0.001;  ///< mm, of the path; a rotary axis counts with `lever`
  double lever = 100.0;   ///< mm
  std::size_t max_rows = 20'000'000;
};

struct PvtOf {
  std::vector<PvtRow> rows;
  double off = 0.0;  ///< mm, the farthest that the cubics were seen from the path, three times in
                     ///< each
};

/// A path as positions, velocities and times: rows close to the corners, where cubics cannot turn
/// at once, and as many between them as curved moves need. What cubics leave by a corner falls with
/// the time to the rows beside it.
/// @throws BadInput for more rows than allowed, and where slides do not reach a tip
PvtOf pvt_of(const Path& path, const kinematics::Chain& control, const PvtOfOptions& options = {});

}  // namespace abbe::sim::program
