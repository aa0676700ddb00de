#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "errors/metrology/positioning.h"

namespace abbe::errors::metrology {

/// Readings of one axis as a file holds them.
struct PositionSet {
  std::string name;     ///< of the set, of the test or of the axis; may be empty
  bool rotary = false;  ///< targets and deviations are rad, not mm
  PositionRuns runs;
};

struct PositionFileOptions {
  std::size_t max_bytes = std::size_t(16) << 20;  ///< longer texts are refused unread
  std::size_t max_readings = 1000000;             ///< of one file
};

inline constexpr int most_runs = 10000;

/// One reading as a deviation, and where it stands.
struct PositionReading {
  bool up = true;
  int run = 1;
  double target = 0.0;
  double deviation = 0.0;
  int line = 0;

  auto order() const { return std::tuple(up, run, target); }
};

/// Every run of a direction must have every target once.
/// @throws BadInput where one is missing or comes twice
PositionRuns assembled(std::vector<PositionReading> all, const std::string& file);

/// @throws BadInput if the text is too long
void check_size(std::string_view text, const std::string& file, const PositionFileOptions& options);

}  // namespace abbe::errors::metrology
