#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace abbe::sim::program {

/// A line of a program.
struct NcPlace {
  const std::string& file;
  int line = 0;
};

/// What of a line a refusal points at: its column, from 1, and the text that was seen.
struct Cause {
  int column = 0;
  std::string_view text;
};

/// Refuses what stands there; what was seen is its own text unless stated.
/// @throws BadInput
[[noreturn]] void refuse(const NcPlace& place, const Cause& cause, std::string expected,
                         std::optional<std::string> seen = {});

}  // namespace abbe::sim::program
