#include "sim/study/base_run.h"
#include "sim/cut/tool_poses.h"

#include <algorithm>

#include <fmt/format.h>

#include "sim/machine/run_out.h"

namespace abbe::sim::study {

namespace {

/// The design with only those vertices judged that have no rival.
cutting::Design without_rivals(cutting::Design design, const std::vector<cutting::Rival>& rivals) {
  design.judged.resize(std::size_t(design.vertices.rows()), 1);
  for (const cutting::Rival& rival : rivals) design.judged[std::size_t(rival.vertex)] = 0;
  return design;
}

}  // namespace

BaseRun base_run(const Study& study, const ReadyArm& ready, const Progress& progress) {
  const Job& job = ready.job;
  if (!job.stretches.empty())
    throw BadInput(job.scene.file.string(), 0, 0,
                   "one tool for influence maps; engine = \"full\" follows several",
                   fmt::format("{} tools", 1 + job.scene.more_tools.size()));
  if (job.scene.tool.wear && job.scene.tool.wear->radius > 0.0)
    throw BadInput(job.scene.file.string(), 0, 0,
                   "a tool that keeps its radius for influence maps; engine = \"full\" follows its "
                   "wear",
                   "tool.wear.radius_um");
  const auto* hollow = std::get_if<cutting::Cutter>(&job.scene.tool.actual);
  if (hollow && cutting::is_hollow(*hollow))
    throw BadInput(job.scene.file.string(), 0, 0,
                   "a convex tool for influence maps; engine = \"full\" follows a hollow one",
                   "a tool.kind = \"profile\" that bends inwards");
  BaseRun run{study, ready, cut_process(job, ready.commanded), {}, {}, std::nullopt, {}};
  run.T_wt = tool_poses(job, ready.commanded, run.process);
  cutting::RivalOptions options;
  options.reach = study.influence.reach;
  options.most = study.influence.most_rivals;
  options.band = job.scene.band;
  if (progress) options.progress = [&](double fraction) { progress("rivals", fraction); };
  const program::Samples& samples = ready.commanded.samples;
  const cutting::SurfaceOptions band{.band = job.scene.band, .progress = {}};
  if (const auto* cutter = std::get_if<cutting::Cutter>(&job.scene.tool.actual)) {
    for (std::size_t i = 0; i < samples.states.size(); ++i) run.sample.push_back(i);
    const cutting::CutterMotion motion = cutter_motion(run.T_wt, samples);
    run.rivals = cutting::milled_rivals(job.design_w, *cutter, motion, options);
    run.gouges =
        cutting::milled_surface(without_rivals(job.design_w, run.rivals), *cutter, motion, band)
            .gouges;
    return run;
  }
  const int joint = *job.machine.workpiece_spindle;
  run.spindle = spindle_line(job.truth.actual, joint);
  run.sample = distinct_instants(samples);
  const auto& nose = std::get<cutting::Nose>(job.scene.tool.actual);
  const cutting::NoseMotion motion = nose_motion(run.T_wt, samples, *run.spindle, joint);
  run.rivals = cutting::turned_rivals(job.design_w, nose, motion, options);
  run.gouges =
      cutting::turned_surface(without_rivals(job.design_w, run.rivals), nose, motion, band).gouges;
  return run;
}

std::array<End, 2> ends_of(const BaseRun& run, const cutting::Rival& rival) {
  const auto move = std::size_t(rival.move);
  const std::size_t next = std::min(move + 1, run.sample.size() - 1);
  return {End{run.sample[move], 1.0 - rival.t}, End{run.sample[next], rival.t}};
}

std::vector<std::size_t> samples_of_rivals(const BaseRun& run) {
  std::vector<std::size_t> needed;
  for (const cutting::Rival& rival : run.rivals)
    for (const End& end : ends_of(run, rival)) needed.push_back(end.sample);
  std::sort(needed.begin(), needed.end());
  needed.erase(std::unique(needed.begin(), needed.end()), needed.end());
  return needed;
}

std::array<double, 2> around(const Study& study, Eigen::Index input) {
  const Distribution& d = study.inputs[std::size_t(input)].distribution;
  return {at_score(d, -1.0), at_score(d, 1.0)};
}

std::array<Scene, 2> scenes_around(const BaseRun& run, Eigen::Index input) {
  Eigen::VectorXd x = centre(run.study);
  std::array<Scene, 2> scenes;
  const std::array<double, 2> at = around(run.study, input);
  for (std::size_t side = 0; side < 2; ++side) {
    x[input] = at[side];
    scenes[side] = with_run_out(scene_at(run.study, run.ready.arm, run.ready.scene, x));
  }
  return scenes;
}

}  // namespace abbe::sim::study
