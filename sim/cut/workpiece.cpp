#include "sim/cut/workpiece.h"

#include <utility>

#include "kinematics/bad_input.h"
#include "sim/cut/cut.h"
#include "sim/cut/judged_surface.h"
#include "sim/scene/read_scene.h"

namespace abbe::sim {
namespace {

/// Returns the commands after the filter, tool by tool.
Commands filtered(Commands commands, const CommandFilter& filter) {
  if (!commands.segments.empty()) {
    for (Commands& part : commands.segments) part = filtered(std::move(part), filter);
    return joined(std::move(commands.segments));
  }
  std::vector<kinematics::AxisState>& states = commands.samples.states;
  const std::size_t count = states.size();
  states = filter(std::move(states));
  require(states.size() == count, "a command filter must keep the number of commands");
  return commands;
}

}  // namespace

std::shared_ptr<const Job> prepare_scene(
    const std::filesystem::path& scene,
    const std::vector<std::pair<std::string, std::string>>& overrides) {
  std::vector<Override> changes;
  for (const auto& [path, value] : overrides) changes.push_back({path, value});
  return std::make_shared<const Job>(sampled(prepare(read_scene(scene, changes))));
}

const cutting::Design& judged_design(const Job& job) { return job.design_w; }

const kinematics::Chain& control_chain(const Job& job) { return job.machine.control; }

Workpiece cut_workpiece(const Job& job, const CommandFilter& filter) {
  Cut result = filter ? cut(job, filtered(uncompensated_commands(job), filter)) : cut(job);
  std::vector<std::string> warnings = warnings_of(job, result);
  return {std::move(result.surface), std::move(warnings)};
}

}  // namespace abbe::sim
