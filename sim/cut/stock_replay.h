#pragma once

#include <cstddef>
#include <optional>
#include <variant>
#include <vector>

#include "cutting/stock/stock.h"
#include "sim/cut/bodies.h"
#include "sim/cut/job.h"
#include "sim/cut/process_simulation.h"

/// The stock during a program: the milling steps, the replay of the cut, and collisions with the
/// stock.
namespace abbe::sim {

/// The milling steps of a program on the machine with errors.
struct MillingSteps {
  std::vector<std::size_t> at;         ///< (n) samples, ascending from 0
  std::vector<kinematics::Pose> T_wt;  ///< (n) actual poses of the tool
  std::vector<int> line;               ///< (n) program line of the move to the step
  std::vector<bool> rapid;             ///< (n) true if that move is a rapid

  std::size_t moves() const { return at.empty() ? 0 : at.size() - 1; }
  cutting::StockMove move(std::size_t k) const;  ///< from step k to k + 1
};

/// Returns the milling steps of a segment.
/// @param segment  with [cutting] and a milling cutter
/// @param process  gives the forces; empty: nothing deflects
/// @throws BadInput if the motion leaves a table of the errors
MillingSteps make_milling_steps(const Segment& segment, const Commands& commands,
                                const Process& process = {});
/// Returns those of a tool of a job in windows, without forces.
/// @param tool  index in `tool_segments`
MillingSteps make_milling_steps(const Job& job, std::size_t tool, const WindowedProgram& program);

/// Repeats a cut move by move, with its poses and forces. After each move the stock equals that of
/// the process.
class StockReplay {
 public:
  /// @param job       with [cutting]
  /// @param process   gives the forces; empty: nothing deflects
  /// @throws BadInput if the motion leaves a table of the errors, std::invalid_argument and
  ///     std::length_error as for the blank
  StockReplay(const Job& job, const Commands& commands, const Process& process = {});

  /// Removes the material that is cut by moves which end at a time or before.
  /// @return true if the stock changed
  bool advance_to(double time_s);
  /// Returns the surface of the present stock.
  cutting::StockMesh mesh() const;
  double volume() const;  ///< mm^3

 private:
  std::variant<cutting::Stock, cutting::TurnedStock> stock_;
  /// A move of the steps of one tool.
  struct Move {
    double end_s = 0.0;
    std::size_t part = 0;
    std::size_t number = 0;  ///< among the moves of the part
  };
  std::vector<std::variant<cutting::Cutter, cutting::Nose>> tools_;  ///< (parts)
  std::vector<MillingSteps> milling_;  ///< (parts) of a turned part with slow poses
  std::vector<Move> moves_;
  std::size_t next_move_ = 0;
};

/// Returns true if the stock of a segment is tracked: it has [cutting] and a milling cutter.
bool has_tracked_stock(const Segment& segment);

/// The lower bound of the distance between a body and the stock in the blocks of some samples.
struct StockProximity {
  std::size_t first = 0, last = 0;  ///< range of samples
  std::string body;
  double lower_bound = 0.0;  ///< mm; 0 for contact
};

/// The collisions with the stock of a part.
struct StockCollisions {
  std::vector<Collision> list;  ///< in the order of the program; one of the two bodies is "stock"
  std::vector<Clearance> clearances;
  std::vector<StockProximity> near;  ///< of contacts and near misses
  std::size_t queries = 0;           ///< number of distance queries
  std::vector<std::string> warnings;
  std::optional<cutting::Stock> stock;  ///< left by the part
};

/// Follows the dexels of [cutting] step by step, without deflection, and searches the bodies that
/// must not touch them: at any time the holder, every machine body that may meet the part, and a
/// shank of another radius than the cutter; the cutter in rapids, and a shank of the cutter's
/// radius, by `cutting::remove`. That function assumes a shank of the cutter's radius; a warning
/// counts the places where a shank of another radius shows no contact. Positions and depths have
/// the accuracy of the stock, a spacing of its dexels (`[cutting] spacing_mm`). Between two steps a
/// body moves on a screw. An event ends with the block in which the bodies part.
/// @param pairs   of the bodies; those with the part are searched for the stock instead
/// @param steps   of the motion
/// @param before  stock at the start of the part; none: the blank
/// @throws BadInput if the blank is not valid
StockCollisions stock_collisions(const ActualMotion& actual_motion,
                                 const std::vector<SolidBody>& bodies,
                                 const std::vector<cutting::BodyPair>& pairs, MillingSteps steps,
                                 std::optional<cutting::Stock> before = {},
                                 const Progress& progress = {});

}  // namespace abbe::sim
