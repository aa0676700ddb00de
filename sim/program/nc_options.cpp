#include "sim/program/nc_options.h"

#include <stdexcept>

namespace abbe::sim::program {

using kinematics::AxisVector;

std::optional<BlockSkip> block_skip_of(std::string_view text) {
  if (text == "on") return BlockSkip().set();
  if (text == "off") return BlockSkip();
  BlockSkip levels;
  for (const char c : text) {
    if (c >= '0' && c <= '9')
      levels.set(std::size_t(c - '0'));
    else if (c != ' ')
      return std::nullopt;
  }
  return levels.any() ? std::optional(levels) : std::nullopt;
}

std::string to_text(const BlockSkip& levels) {
  if (levels.all()) return "on";
  if (levels.none()) return "off";
  std::string text;
  for (std::size_t level = 0; level < levels.size(); ++level)
    if (levels.test(level)) text += (text.empty() ? "" : " ") + std::to_string(level);
  return text;
}

const AxisVector& work_offset(const NcOptions& options, int system) {
  static const AxisVector none;
  if (system >= 1 && system <= int(options.work_offset.size()))
    return options.work_offset[std::size_t(system - 1)];
  const auto found = options.more_offset.find(system);
  return found == options.more_offset.end() ? none : found->second;
}

bool knows_tool(const NcOptions& options, int number) {
  return !options.tool_table || number == 0 || options.tool_length.contains(number);
}

std::optional<int> only_tool(const NcOptions& options) {
  const std::map<int, double>& lengths = options.tool_length;
  if (options.tool_table)
    return lengths.size() == 1 ? std::optional(lengths.begin()->first) : std::nullopt;
  if (!options.control_of_h.empty() || lengths.empty()) return std::nullopt;
  return lengths.contains(1) ? 1 : lengths.begin()->first;
}

AxisVector start_of(const NcOptions& options) {
  const Eigen::Index n = Eigen::Index(options.axes.size());
  if (options.start.size() == 0) return AxisVector::Zero(n);
  if (options.start.size() != n)
    throw std::invalid_argument("expected one start position for every axis");
  return options.start;
}

AxisVector reference_of(const NcOptions& options) {
  return options.reference.size() > 0 ? options.reference : start_of(options);
}

}  // namespace abbe::sim::program
