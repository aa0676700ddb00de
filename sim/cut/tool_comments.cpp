#include "sim/cut/tool_comments.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "sim/cut/tool_calls.h"

namespace abbe::sim {
namespace {

using program::ToolComment;
using program::ToolWords;

constexpr double same_mm = 0.01;  // CAM writes two or three decimals

/// The number of the tool that a comment is about; none where nothing is called.
std::optional<int> number_meant(const ToolComment& comment,
                                const std::vector<program::ToolCall>& calls) {
  if (comment.words.number || calls.empty()) return comment.words.number;
  const auto next = std::ranges::find_if(
      calls, [&](const program::ToolCall& call) { return call.before >= comment.before; });
  return next == calls.end() ? calls.back().number : next->number;
}

/// The tool of the scene that a comment is about.
const ToolDescription* tool_of(const ToolComment& comment,
                               const std::vector<program::ToolCall>& calls,
                               std::span<const ToolDescription> tools) {
  const std::optional<int> number = number_meant(comment, calls);
  if (number && !calls.empty() &&
      std::ranges::none_of(calls, [&](const auto& call) { return call.number == *number; }))
    return nullptr;  // it does not cut
  for (const ToolDescription& tool : tools)
    if (!tool.number || !number || *tool.number == *number) return &tool;
  return nullptr;
}

std::string what_differs(const ToolWords& words, const cutting::Cutter& cutter) {
  std::vector<std::string> all;
  if (std::abs(words.diameter - 2.0 * cutter.radius) > same_mm)
    all.push_back(fmt::format("{:.6g} mm in diameter, and the scene's has {:.6g} mm",
                              words.diameter, 2.0 * cutter.radius));
  std::optional<double> corner = words.corner_radius;
  if (!corner && words.end == ToolWords::End::Flat) corner = 0.0;
  if (!corner && words.end == ToolWords::End::Ball) corner = 0.5 * words.diameter;
  if (corner && std::abs(*corner - cutter.corner_radius) > same_mm)
    all.push_back(fmt::format("{:.6g} mm of corner radius, and the scene's has {:.6g} mm", *corner,
                              cutter.corner_radius));
  return fmt::format("{}", fmt::join(all, "; "));
}

}  // namespace

std::vector<std::string> tool_comment_warnings(const program::Path& path,
                                               std::span<const ToolDescription> tools) {
  const std::vector<program::ToolCall> calls = cutting_calls(path);
  std::vector<std::string> warnings;
  std::set<std::string> said;
  for (const ToolComment& comment : path.tool_comments) {
    const ToolDescription* tool = tool_of(comment, calls, tools);
    const auto* cutter = tool ? std::get_if<cutting::Cutter>(&tool->nominal) : nullptr;
    if (cutter == nullptr) continue;
    const std::string differs = what_differs(comment.words, *cutter);
    if (differs.empty() || !said.insert(differs).second) continue;
    warnings.push_back(fmt::format("line {} says \"{}\": {}", comment.line, comment.text, differs));
  }
  return warnings;
}

}  // namespace abbe::sim
