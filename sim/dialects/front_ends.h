#pragma once

#include <span>
#include <string_view>

#include "sim/dialects/dialect.h"
#include "sim/dialects/program_run.h"
#include "sim/dialects/word_table.h"

namespace abbe::sim::dialects {

/// A dialect that is read: what turns its text into canonical moves, and its words.
struct FrontEnd {
  Dialect dialect;
  std::string_view title;  ///< for people, "LinuxCNC (RS274/NGC)"
  void (*read)(std::string_view text, ProgramRun& run);
  std::span<const WordUse> (*words)();
  /// Words of its turning controls, where these are others; null: they are the same.
  std::span<const WordUse> (*turning_words)() = nullptr;
  std::string_view turning_title = {};
};

/// The dialects in the order of the README. A dialect that is not among them is refused by name.
std::span<const FrontEnd> front_ends();

}  // namespace abbe::sim::dialects
