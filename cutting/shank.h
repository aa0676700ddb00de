#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cutting/mesh.h"
#include "cutting/sweep.h"
#include "cutting/tool.h"

namespace abbe::cutting {

/// A convex piece of a tool that must not cut: of its shank, its collet, its holder.
struct IdlePiece {
  Cutter shape;       ///< by its own tip
  double base = 0.0;  ///< mm, of that above the tip of the tool
};

/// Of a profile of revolution, a cone from each point to the next.
/// @param profile  (n x 2) mm, radius and height above the tip, rising
std::vector<IdlePiece> idle_pieces(const Eigen::MatrixX2d& profile);

/// A tool that goes into the design with what does not cut.
struct ShankContact {
  int vertices = 0;      ///< at which it goes deeper than `passed`
  double passed = 0.0;   ///< mm below the design that are let pass
  double deepest = 0.0;  ///< mm from the whole of the design, at most the band
  bool deeper = false;   ///< the search ended in the shank
  int line = 0;          ///< program line of that
  int first_line = 0;    ///< of the earliest line that does
};

struct ShankOptions {
  double length = 0.0;                ///< mm from the tip to the end of the shank
  double band = 2.0;                  ///< mm below the design that are searched
  std::optional<double> radius = {};  ///< mm, of the shank; none: the cutter's
};

/// Where the shank, the cylinder from the end of the flank up to `length`, is in the part by more
/// than `rubbing` (stock.h; a quarter of its radius where that is less) during the motion, rapids
/// too; nothing if nowhere. How deep it is counts from the nearest place of the design, so one that
/// runs along a wall is in nothing. Every vertex counts, judged or not. A shank that passes through
/// the part and comes nearer to no vertex than the band is not seen.
/// @throws std::invalid_argument as milled_surface
std::optional<ShankContact> shank_contact(const Design& design_w, const Cutter& cutter,
                                          const CutterMotion& motion, const ShankOptions& options);

/// The same of any pieces, at each vertex of the one that goes in deepest there.
/// @param band  mm below the design that are searched
std::optional<ShankContact> idle_contact(const Design& design_w,
                                         const std::vector<IdlePiece>& pieces,
                                         const CutterMotion& motion, double band);

}  // namespace abbe::cutting
