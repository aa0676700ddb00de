#include "sim/program/nc_options.h"

#include <stdexcept>

namespace abbe::sim::program {

using kinematics::AxisVector;

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

AxisVector start_of(const NcOptions& options) {
  const Eigen::Index n = Eigen::Index(options.axes.size());
  if (options.start.size() == 0) return AxisVector::Zero(n);
  if (options.start.size() != n)
    throw std::invalid_argument("expected one start position for every axis");
  return options.start;
}

}  // namespace abbe::sim::program
