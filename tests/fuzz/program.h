#pragma once

#include <stdexcept>
#include <string_view>

#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"

namespace abbe::fuzz {

/// Reads a program in a dialect on a five-axis gantry, 20 000 blocks of it at most.
/// @throws std::logic_error if a block is no motion: not finite, or back in time
inline void read_as(sim::dialects::Dialect dialect, std::string_view text) {
  sim::dialects::ReadOptions options;
  options.control = sim::program::test::options_for(sim::program::test::gantry());
  options.control.tool_length = {{1, 80.0}, {2, 120.0}};
  options.control.tool_radius = {{1, 5.0}, {2, 3.0}};
  options.dialect = dialect;
  options.limits.blocks = 20'000;
  const sim::dialects::ParsedProgram read = sim::dialects::read_program(text, "fuzz", options);
  for (const sim::program::Block& block : read.path.blocks)
    if (!block.start.allFinite() || !block.end.allFinite() || !(block.end_s >= block.start_s))
      throw std::logic_error("a block is no motion");
}

}  // namespace abbe::fuzz
