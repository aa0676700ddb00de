#pragma once

#include <span>
#include <string>
#include <vector>

#include "sim/program/path.h"
#include "sim/scene/tool_description.h"

namespace abbe::sim {

/// The calls of tools with which a program cuts: those that a block of feed follows before the
/// next; T alone is a call where no M6 is in the program.
std::vector<program::ToolCall> cutting_calls(const program::Path& path);

/// Blocks of a program that one tool of the scene runs, one after the other.
struct ToolStretch {
  std::size_t tool = 0;             ///< of the scene's, in their order
  std::size_t first = 0, last = 0;  ///< first block, and one past the last
};

/// Which tool runs what, and what is to be said of it.
struct ToolUse {
  std::vector<ToolStretch> stretches;  ///< all blocks, in their order
  std::vector<std::string> warnings;
};

/// A scene with one tool cuts with it whatever T and M6 say; of several each runs from its call to
/// the next, the first of them before any.
/// @param tools  of the scene; several have numbers
/// @throws BadInput on the line of a call of a tool that the scene does not describe, of a second
///         tool where its only one has no number, and of a block under G43.4 with the H of another
///         tool of several than runs it
ToolUse tool_use(const program::Path& path, std::span<const ToolDescription> tools);

/// Lengths (H) of other tools than the one that runs a stretch, as warnings.
/// @param number  of that tool
/// @throws BadInput on the line of a block under G43.4 with such a length
std::vector<std::string> length_warnings(const program::Path& path, const ToolStretch& stretch,
                                         int number);

}  // namespace abbe::sim
