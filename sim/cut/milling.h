#pragma once

#include <cstddef>
#include <vector>

#include "cutting/stock.h"
#include "sim/cut/job.h"
#include "sim/cut/milling_looks.h"

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

}  // namespace abbe::sim
