#pragma once

#include <optional>
#include <string>
#include <vector>

#include "errors/metrology/diagonals.h"
#include "errors/metrology/series.h"

namespace abbe::errors::metrology {

/// Displacements read while several slides move along one straight line.
struct DiagonalTest {
  std::string name;  ///< of set-up and channel
  DiagonalRuns runs;
};

/// Nothing if anything but slides moves, the way is not straight along the beam, or runs lack a
/// target.
/// @param moving  the axes that move, two or more
std::optional<DiagonalTest> diagonal_test(const Series& series, const std::vector<int>& moving);

}  // namespace abbe::errors::metrology
