#include "sim/cut/tool_calls.h"

#include <algorithm>

#include <fmt/format.h>

namespace abbe::sim {
namespace {

/// The calls that put a tool into the spindle: M6, or T where no M6 is in the program.
std::vector<program::ToolCall> changes_of(const program::Path& path) {
  const bool with_m6 = std::any_of(path.tool_calls.begin(), path.tool_calls.end(),
                                   [](const program::ToolCall& call) { return call.changes; });
  std::vector<program::ToolCall> calls;
  for (const program::ToolCall& call : path.tool_calls)
    if (call.changes == with_m6) calls.push_back(call);
  return calls;
}

/// Those of them with which the program cuts.
std::vector<program::ToolCall> cutting_calls(const program::Path& path,
                                             const std::vector<program::ToolCall>& calls) {
  std::vector<program::ToolCall> cutting;
  for (std::size_t i = 0; i < calls.size(); ++i) {
    const auto first = path.blocks.begin() + std::ptrdiff_t(calls[i].before);
    const auto last = i + 1 < calls.size()
                          ? path.blocks.begin() + std::ptrdiff_t(calls[i + 1].before)
                          : path.blocks.end();
    if (std::any_of(first, last, program::is_feed)) cutting.push_back(calls[i]);
  }
  return cutting;
}

std::string name_of(const program::ToolCall& call) {
  return call.number < 0 ? "M6 without a T" : fmt::format("T{}", call.number);
}

/// Feed before the first of the calls with which the program cuts.
std::vector<std::string> early_feed_warnings(const program::Path& path,
                                             const std::vector<program::ToolCall>& calls) {
  if (calls.empty()) return {};
  const auto called = path.blocks.begin() + std::ptrdiff_t(calls.front().before);
  const auto early = std::find_if(path.blocks.begin(), called, program::is_feed);
  if (early == called) return {};
  return {
      fmt::format("line {} feeds before the first tool is called, {} on line {}: it is cut with "
                  "the scene's tool as well",
                  early->line, name_of(calls.front()), calls.front().line)};
}

}  // namespace

std::vector<std::string> tool_call_warnings(const program::Path& path,
                                            const ToolDescription& tool) {
  const std::vector<program::ToolCall> calls = cutting_calls(path, changes_of(path));
  std::vector<std::string> warnings = early_feed_warnings(path, calls);
  if (calls.empty()) return warnings;
  const program::ToolCall& first = calls.front();
  for (const program::ToolCall& call : calls) {
    if (tool.number && call.number != *tool.number)
      throw BadInput(path.file, call.line, 0,
                     fmt::format("T{}, which is the scene's tool.number", *tool.number),
                     name_of(call));
    if (call.number != first.number)
      throw BadInput(
          path.file, call.line, 0,
          fmt::format("one tool, {} of line {}: a scene has one", name_of(first), first.line),
          name_of(call));
  }
  if (!tool.number)
    warnings.push_back(
        fmt::format("{} on line {} is cut with the scene's tool{}: give tool.number if it is that",
                    name_of(first), first.line, tool.name.empty() ? "" : " " + tool.name));
  return warnings;
}

}  // namespace abbe::sim
