#include "sim/cut/milling.h"

#include <variant>

#include "sim/cut/tool_poses.h"

namespace abbe::sim {

cutting::StockMove Milling::move(std::size_t k) const {
  return {T_wt[k], T_wt[k + 1], line[k + 1], rapid[k + 1]};
}

Milling milling_of(const Job& part, const Commands& commands, const Process& process) {
  const program::Samples& samples = commands.samples;
  const program::Path& path = path_of(part, commands);
  const auto& T_wt = wanted_poses(part, commands);
  const auto& cutter = std::get<cutting::Cutter>(part.scene.tool.actual);
  Milling milling;
  milling.at = milling_looks(samples, path, T_wt, part.scene.cutting->step, cutter.flank_length);
  milling.T_wt = tool_poses(part, commands, process, milling.at);
  for (const std::size_t i : milling.at) {
    milling.line.push_back(samples.line[i]);
    milling.rapid.push_back(is_rapid(samples, path, i));
  }
  return milling;
}

}  // namespace abbe::sim
