#pragma once

#include <cstddef>
#include <vector>

#include "sim/cut/bodies.h"
#include "sim/cut/following.h"

/// What meets the stock as it stands at that moment.
namespace abbe::sim {

/// Whether a part has a stock that is followed: [cutting] and a milling cutter.
bool follows_stock(const Job& part);

/// How near a body is to the stock in the blocks of some samples.
struct NearStock {
  std::size_t first = 0, last = 0;  ///< samples
  std::string body;
  double at_least = 0.0;  ///< mm, 0 for contact
};

struct StockCollisions {
  std::vector<Collision> list;  ///< in the order of the program; "stock" is one of the two
  std::vector<Clearance> clearances;
  std::vector<NearStock> near;  ///< of contacts and near misses
  std::size_t queries = 0;      ///< of distances
  std::vector<std::string> warnings;
};

/// Follows the dexels of [cutting] step by step, where nothing bends, and what may not touch them:
/// the holder and every body of the machine that may meet the part, a shank that has not the
/// cutter's radius, at any time; cutter and shank as `cutting::remove` judges them, the cutter on
/// rapids. That takes a shank of the cutter's radius: where one of another is not seen to meet what
/// it says, a warning counts the places. Where the
/// stock is to a spacing of its dexels, `[cutting] spacing_mm`, so are places and depths. Between
/// two steps a body is on a screw. A stretch in which two are near is closed at the end of the
/// block in which they part.
/// @param pairs  of the bodies; those with the part are taken with the stock
/// @throws BadInput for a blank that cannot be
StockCollisions stock_collisions(const Following& following, const std::vector<SolidBody>& bodies,
                                 const std::vector<cutting::BodyPair>& pairs,
                                 const Progress& progress = {});

}  // namespace abbe::sim
