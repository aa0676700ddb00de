#include "sim/cut/tool_poses.h"

#include <tbb/parallel_for.h>

#include "sim/cut/accelerations.h"
#include "sim/cut/inside_tables.h"

namespace abbe::sim {

using kinematics::Pose;

Pose actual_pose(const ActualRun& run, std::size_t sample, errors::Load load) {
  if (!run.acceleration.empty()) load.acceleration = run.acceleration[sample];
  Pose T_wt = tool_in_workpiece(run.job.truth, run.commands.samples.states[sample], load);
  if (!run.wear.empty())
    T_wt.translation() += run.wear[sample] * run.job.scene.tool.wear->length * T_wt.linear().col(2);
  if (const auto& piezo = run.commands.piezo) {
    const Eigen::Vector3d& along_t = piezo->piezo.direction_t;
    const double force = along_t.dot(load.on_tool_t.head<3>());
    T_wt.translation() +=
        (piezo->stroke[Eigen::Index(sample)] + compensation::yielding(piezo->piezo, force)) *
        (T_wt.linear() * along_t);
  }
  return T_wt;
}

std::vector<errors::Load> loads_of(const ActualRun& run, const Process& process) {
  if (!run.job.truth.compliance && !run.commands.piezo) return {};
  if (process.steps.empty() && run.acceleration.empty()) return {};
  const auto& states = run.commands.samples.states;
  std::vector<errors::Load> loads(states.size());
  for (std::size_t i = 0; i < loads.size(); ++i) {
    loads[i] = load_at(process, states[i].time_s);
    if (!run.acceleration.empty()) loads[i].acceleration = run.acceleration[i];
  }
  return loads;
}

ActualRun actual_run(const Job& job, const Commands& commands) {
  ActualRun run{job, commands, wanted_poses(job, commands)};
  if (!job.accelerations.empty()) run.acceleration = accelerations(commands.samples);
  run.wear = wear_shares(cut_part(job), commands.samples);
  return run;
}

std::vector<Pose> poses_of(const ActualRun& run, const std::vector<errors::Load>& loads,
                           std::span<const std::size_t> at) {
  std::vector<Pose> T_wt(at.empty() ? run.commands.samples.states.size() : at.size());
  tbb::parallel_for(std::size_t(0), T_wt.size(), [&](std::size_t i) {
    const std::size_t sample = at.empty() ? i : at[i];
    T_wt[i] = actual_pose(run, sample, loads.empty() ? errors::Load{} : loads[sample]);
  });
  return T_wt;
}

std::vector<Pose> tool_poses(const Job& job, const Commands& commands, const Process& process,
                             std::span<const std::size_t> at) {
  const ActualRun run = actual_run(job, commands);
  return inside_tables(job, [&] { return poses_of(run, loads_of(run, process), at); });
}

}  // namespace abbe::sim
