#pragma once

#include <cstddef>
#include <vector>

#include "cutting/stock.h"
#include "sim/cut/job.h"

/// How a program is followed through a blank: the blank, and the places at which it is looked at.
namespace abbe::sim {

/// The blank of a scene with [cutting] as dexels.
/// @param design_m  the part in its own frame, for a blank that is its offset
/// @throws std::invalid_argument for a blank that cannot be, std::length_error for one that does
///         not fit in its memory, BadInput for a mesh file that cannot be read
cutting::Stock blank_stock(const Scene& scene, const cutting::Design& design_m);

/// Whether the block that runs at a sample is a rapid.
bool is_rapid(const program::Samples& samples, const program::Path& path, std::size_t sample);

/// Samples between which material is taken away: after every `step` (mm) of travel of the tip and
/// of the turning of what is `reach` (mm) above it, wherever the motion turns by more than 0.1 rad,
/// and where rapid and feed meet. The first is 0, the last the last.
/// @param T_wt  (samples)
std::vector<std::size_t> milling_looks(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, double step,
                                       double reach);

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

}  // namespace abbe::sim
