#pragma once

#include <cstddef>
#include <optional>
#include <variant>
#include <vector>

#include "cutting/stock/stock.h"
#include "sim/cut/bodies.h"
#include "sim/cut/job.h"
#include "sim/cut/process_simulation.h"

/// The steps in which a program mills.
namespace abbe::sim {

/// A program as it is milled on the wrong machine, step by step.
struct Milling {
  std::vector<std::size_t> at;         ///< (n) samples, rising from 0
  std::vector<kinematics::Pose> T_wt;  ///< (n) where the tool is
  std::vector<int> line;               ///< (n) program line that brings it there
  std::vector<bool> rapid;             ///< (n) whether that is a rapid

  std::size_t moves() const { return at.empty() ? 0 : at.size() - 1; }
  cutting::StockMove move(std::size_t k) const;  ///< from k to k + 1
};

/// @param part     with [cutting] and a milling cutter
/// @param process  that cut, for its forces; empty: nothing bends
/// @throws BadInput where a table of the errors is left
Milling milling_of(const Job& part, const Commands& commands, const Process& process = {});

// The stock of a cut at any moment of it.

/// A cut done once more, move by move, with the poses and forces that it had: its stock is that of
/// the process after as many moves.
class StockReplay {
 public:
  /// @param part      with [cutting]
  /// @param commands  of that part
  /// @param process   that cut, for its forces; empty: nothing bends
  /// @throws BadInput where a table of the errors is left, std::invalid_argument and
  ///         std::length_error as of the blank
  StockReplay(const Job& part, const Commands& commands, const Process& process = {});

  /// Takes away what is cut by moves that have ended until then.
  /// @return whether that changed the stock
  bool advance_to(double time_s);
  /// Share of all moves that are done, 0 .. 1.
  double done() const;
  cutting::StockMesh mesh() const;
  double volume() const;  ///< mm^3

 private:
  std::variant<cutting::Stock, cutting::TurnedStock> stock_;
  std::variant<cutting::Cutter, cutting::Nose> tool_;
  Milling milling_;             ///< of a turned part the slow poses
  std::vector<double> time_s_;  ///< (moves) at which each has ended
  std::size_t next_ = 0;
};

// What meets the stock as it stands at that moment.

/// Whether a part has a stock that is followed: [cutting] and a milling cutter.
bool has_tracked_stock(const Job& part);

/// How near a body is to the stock in the blocks of some samples.
struct StockProximity {
  std::size_t first = 0, last = 0;  ///< samples
  std::string body;
  double at_least = 0.0;  ///< mm, 0 for contact
};

struct StockCollisions {
  std::vector<Collision> list;  ///< in the order of the program; "stock" is one of the two
  std::vector<Clearance> clearances;
  std::vector<StockProximity> near;  ///< of contacts and near misses
  std::size_t queries = 0;           ///< of distances
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
StockCollisions stock_collisions(const ActualMotion& actual_motion,
                                 const std::vector<SolidBody>& bodies,
                                 const std::vector<cutting::BodyPair>& pairs,
                                 const Progress& progress = {});

}  // namespace abbe::sim
