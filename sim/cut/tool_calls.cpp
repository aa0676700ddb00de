#include "sim/cut/tool_calls.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/bad_input.h"

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

}  // namespace

std::vector<program::ToolCall> cutting_calls(const program::Path& path) {
  const std::vector<program::ToolCall> calls = changes_of(path);
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

namespace {

std::string name_of(const program::ToolCall& call) {
  return call.number < 0 ? "M6 without a T" : fmt::format("T{}", call.number);
}

/// Feed before the first of the calls with which the program cuts.
std::vector<std::string> early_feed_warnings(const program::Path& path,
                                             const std::vector<program::ToolCall>& calls,
                                             const std::string& with) {
  if (calls.empty()) return {};
  const auto called = path.blocks.begin() + std::ptrdiff_t(calls.front().before);
  const auto early = std::find_if(path.blocks.begin(), called, program::is_feed);
  if (early == called) return {};
  return {
      fmt::format("line {} feeds before the first tool is called, {} on line {}: it is cut with "
                  "{}",
                  early->line, name_of(calls.front()), calls.front().line, with)};
}

ToolUse use_of_one(const program::Path& path, const ToolDescription& tool) {
  const std::vector<program::ToolCall> calls = cutting_calls(path);
  ToolUse use{{{0, 0, path.blocks.size()}},
              early_feed_warnings(path, calls, "the scene's tool as well")};
  if (calls.empty()) return use;
  const program::ToolCall& first = calls.front();
  for (const program::ToolCall& call : calls) {
    if (tool.number && call.number != *tool.number)
      throw BadInput(path.file, call.line, 0,
                     fmt::format("T{}, which is the scene's tool.number", *tool.number),
                     fmt::format("{}: describe it in a [[tool]] of its own, or give tool.number = "
                                 "{} if the scene's is that",
                                 name_of(call), call.number));
    if (call.number != first.number)
      throw BadInput(path.file, call.line, 0,
                     fmt::format("one tool, {} of line {}, as the scene has one; several are "
                                 "described by a [[tool]] each, with its number",
                                 name_of(first), first.line),
                     name_of(call));
  }
  if (!tool.number)
    use.warnings.push_back(
        fmt::format("{} on line {} is cut with the scene's tool{}: give tool.number if it is that",
                    name_of(first), first.line, tool.name.empty() ? "" : " " + tool.name));
  return use;
}

std::size_t described(const program::Path& path, const program::ToolCall& call,
                      std::span<const ToolDescription> tools) {
  std::string known;
  for (std::size_t i = 0; i < tools.size(); ++i) {
    if (tools[i].number == call.number) return i;
    known += fmt::format("{}T{}", known.empty() ? "" : ", ", *tools[i].number);
  }
  throw BadInput(path.file, call.line, 0,
                 fmt::format("a tool that a [[tool]] of the scene describes ({})", known),
                 name_of(call));
}

/// Puts a stretch behind the others; one of the same tool is longer by it.
void add(std::vector<ToolStretch>& stretches, const ToolStretch& next) {
  if (next.first == next.last) return;
  if (!stretches.empty() && stretches.back().tool == next.tool)
    stretches.back().last = next.last;
  else
    stretches.push_back(next);
}

ToolUse use_of_several(const program::Path& path, std::span<const ToolDescription> tools) {
  const std::vector<program::ToolCall> calls = cutting_calls(path);
  ToolUse use{
      {},
      early_feed_warnings(path, calls, fmt::format("T{}, the scene's first", *tools[0].number))};
  std::vector<bool> runs(tools.size(), false);
  // rapids before the first call are its way to the part
  std::size_t tool =
      calls.empty() || !use.warnings.empty() ? 0 : described(path, calls.front(), tools);
  std::size_t first = 0;
  for (const program::ToolCall& call : calls) {
    add(use.stretches, {tool, first, call.before});
    tool = described(path, call, tools);
    first = call.before;
    runs[tool] = true;
  }
  add(use.stretches, {tool, first, path.blocks.size()});
  for (const ToolStretch& stretch : use.stretches)
    for (std::string& one : length_warnings(path, stretch, *tools[stretch.tool].number))
      use.warnings.push_back(std::move(one));
  if (calls.empty())
    use.warnings.push_back(
        fmt::format("the program calls no tool: all of it is cut with T{}, the scene's first",
                    *tools[0].number));
  for (std::size_t i = 0; i < tools.size() && !calls.empty(); ++i)
    if (!runs[i])
      use.warnings.push_back(fmt::format(
          "T{} of the scene cuts nothing: the program does not call it", *tools[i].number));
  return use;
}

}  // namespace

std::vector<std::string> length_warnings(const program::Path& path, const ToolStretch& stretch,
                                         int number) {
  for (std::size_t i = stretch.first; i < stretch.last; ++i) {
    const program::Block& block = path.blocks[i];
    if (block.tool_length < 0 || block.tool_length == number) continue;
    if (block.coordinates == program::Coordinates::Tip)
      throw BadInput(path.file, block.line, 0,
                     fmt::format("G43.4 H{}, the length of T{}, which runs here", number, number),
                     fmt::format("H{}", block.tool_length));
    if (program::is_feed(block))
      return {fmt::format("from line {} on T{} runs with the length H{} of G43, not its own",
                          block.line, number, block.tool_length)};
  }
  return {};
}

ToolUse tool_use(const program::Path& path, std::span<const ToolDescription> tools) {
  return tools.size() == 1 ? use_of_one(path, tools.front()) : use_of_several(path, tools);
}

}  // namespace abbe::sim
