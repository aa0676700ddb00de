#pragma once

#include <cstddef>
#include <optional>
#include <variant>
#include <vector>

#include "sim/cut/milling.h"

/// The stock of a cut at any moment of it.
namespace abbe::sim {

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

}  // namespace abbe::sim
