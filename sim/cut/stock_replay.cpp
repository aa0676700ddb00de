#include "sim/cut/stock_replay.h"

#include "cutting/turned_mesh.h"
#include "sim/cut/tool_poses.h"
#include "sim/cut/turning.h"

namespace abbe::sim {
namespace {

/// Turning as steps: the tool as it stands to the part once that is turned back.
Milling turning_of(const Job& part, const Commands& commands, const Process& process,
                   const SpindleLine& line) {
  const program::Samples& samples = commands.samples;
  const program::Path& path = path_of(part, commands);
  const auto& T_wt = wanted_poses(part, commands);
  const int spindle = *part.machine.workpiece_spindle;
  Milling turning;
  turning.at = turning_looks(samples, path, T_wt, spindle, line);
  turning.T_wt = tool_poses(part, commands, process, turning.at);
  for (std::size_t k = 0; k < turning.at.size(); ++k) {
    const std::size_t i = turning.at[k];
    turning.T_wt[k] = slow_pose(line, samples.states[i].q[spindle], turning.T_wt[k]);
    turning.line.push_back(samples.line[i]);
    turning.rapid.push_back(is_rapid(samples, path, i));
  }
  return turning;
}

}  // namespace

StockReplay::StockReplay(const Job& part, const Commands& commands, const Process& process)
    : tool_(part.scene.tool.actual) {
  if (std::holds_alternative<cutting::Cutter>(tool_)) {
    stock_ = blank_stock(part.scene, blank_of(part.scene, *part.body_m));
    milling_ = milling_of(part, commands, process);
  } else {
    const SpindleLine line = spindle_line(part.truth.actual, *part.machine.workpiece_spindle);
    stock_ = turned_blank(part.scene, line);
    milling_ = turning_of(part, commands, process, line);
  }
  for (std::size_t k = 1; k < milling_.at.size(); ++k)
    time_s_.push_back(commands.samples.states[milling_.at[k]].time_s);
}

bool StockReplay::advance_to(double time_s) {
  double taken = 0.0;  // mm^3
  for (; next_ < time_s_.size() && time_s_[next_] <= time_s; ++next_) {
    const cutting::StockMove move = milling_.move(next_);
    if (auto* milled = std::get_if<cutting::Stock>(&stock_))
      taken += cutting::remove(*milled, std::get<cutting::Cutter>(tool_), move).volume;
    else
      taken +=
          cutting::remove(std::get<cutting::TurnedStock>(stock_), std::get<cutting::Nose>(tool_),
                          move.from_T_wt, move.to_T_wt, move.rapid ? -move.line : move.line);
  }
  return taken > 0.0;
}

double StockReplay::done() const {
  return time_s_.empty() ? 1.0 : double(next_) / double(time_s_.size());
}

cutting::StockMesh StockReplay::mesh() const {
  return std::visit([](const auto& stock) { return cutting::stock_mesh(stock); }, stock_);
}

double StockReplay::volume() const {
  return std::visit([](const auto& stock) { return cutting::volume(stock); }, stock_);
}

}  // namespace abbe::sim
