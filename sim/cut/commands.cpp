#include "sim/cut/commands.h"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "kinematics/bad_input.h"
#include "kinematics/inverse.h"
#include "sim/cut/datum.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;

bool is_tip(const program::Path& path, int block) {
  return path.blocks[std::size_t(block)].coordinates == program::Coordinates::Tip;
}

}  // namespace

std::vector<AxisState> commanded(const kinematics::Chain& control, const program::Path& path,
                                 const program::Samples& samples,
                                 const kinematics::Chain& sampled_by,
                                 const Eigen::Vector3d& offset_w) {
  std::vector<AxisState> states = samples.states;
  if (same(control, sampled_by) && offset_w.isZero(0.0)) return states;
  const AxisVector slides = slides_of_offset(control, offset_w);
  tbb::parallel_for(std::size_t(0), states.size(), [&](std::size_t i) {
    if (!is_tip(path, samples.block[i])) {
      states[i].q += slides;
      return;
    }
    const Eigen::Vector3d tip_w =
        sampled_by.tool_in_workpiece(states[i].q).translation() + offset_w;
    const auto q = kinematics::slides_for_tip(control, states[i].q, tip_w);
    if (!q)
      throw BadInput(path.file, samples.line[i], 0, "a tip that the control's slides reach",
                     "another");
    states[i].q = *q;
  });
  return states;
}

Commands as_programmed(const Machine& machine, const program::Path& path,
                       const program::Samples& samples, const Eigen::Vector3d& offset_w) {
  Commands result;
  result.samples = samples;
  result.samples.states = commanded(machine.control, path, samples, machine.nominal, offset_w);
  return result;
}

Commands joined(std::vector<Commands> parts) {
  if (parts.size() == 1) return std::move(parts.front());
  Commands all;
  for (const Commands& part : parts) {
    const auto& states = part.samples.states;
    all.samples.states.insert(all.samples.states.end(), states.begin(), states.end());
    all.point_left = std::max(all.point_left, part.point_left);
    all.direction_left = std::max(all.direction_left, part.direction_left);
    all.not_converged += part.not_converged;
    for (const std::string& warning : part.warnings)
      if (std::ranges::find(all.warnings, warning) == all.warnings.end())
        all.warnings.push_back(warning);
  }
  all.stretches = std::move(parts);
  return all;
}

const Commands& of_part(const Commands& commands, std::size_t part) {
  return commands.stretches.empty() ? commands : commands.stretches[part];
}

}  // namespace abbe::sim
