#include "sim/commands/rewrite_command.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/cut/reach.h"
#include "sim/files/one_lined.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/files/terminal.h"
#include "sim/loop/program_channel.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;
using Channel = CaseDescription::Channel;

bool writes_program(const Scene& scene, const CaseDescription& compensator) {
  return (compensator.plug_in.empty() ? compensator.channel : scene.compensation.plug_in.channel) ==
         Channel::Program;
}

/// The case that is written, by name or the first of the scene.
CaseDescription chosen_case(const Scene& scene, const std::string& name) {
  const std::string file = scene.file.string();
  if (!name.empty()) {
    CaseDescription compensator;
    try {
      compensator = parse_case(name);
    } catch (const std::invalid_argument& fault) {
      throw BadInput(file, 0, 0, "a case that this scene can run", fault.what());
    }
    if (!writes_program(scene, compensator))
      throw BadInput(file, 0, 0, "a case through the channel program", "\"" + name + "\"");
    return compensator;
  }
  for (const CaseDescription& compensator : scene.cases)
    if (writes_program(scene, compensator)) return compensator;
  throw BadInput(
      file, 0, 0,
      "a case through the channel program among those that the scene compares, or --case", "none");
}

ResultFile out_file(const Job& job, const RewriteCommandOptions& options) {
  std::filesystem::path out = options.out;
  if (out.empty())
    out = std::filesystem::path("out") / job.scene.file.stem() /
          ("rewritten" + std::filesystem::path(job.path.file).extension().string());
  return result_file(out, writer_of(job.scene, options.permissions));
}

ordered_json spread(const Spread& s, double unit) {
  return {{"rms", s.rms / unit}, {"max", s.max / unit}};
}

void add(Spread& spread, double value) {
  spread.rms += value * value;
  spread.max = std::max(spread.max, value);
}

}  // namespace

WordChange word_change(const Job& job, const Commands& commands) {
  WordChange change;
  const std::size_t n = commands.samples.states.size();
  for (std::size_t i = 0; i < n; ++i) {
    const program::Block& block = commands.path->blocks[std::size_t(commands.samples.block[i])];
    const double duration = block.end_s - block.start_s;
    const double u =
        duration > 0.0 ? (commands.samples.states[i].time_s - block.start_s) / duration : 1.0;
    const kinematics::Pose T =
        job.machine.nominal.tool_in_workpiece(nominal_axes(job.machine, *commands.path, block, u));
    const kinematics::Pose& wanted = commands.T_wt_nominal[i];
    add(change.tip, (T.translation() - wanted.translation()).norm());
    const Eigen::Vector3d a = T.linear().col(2), b = wanted.linear().col(2);
    add(change.direction, std::atan2(a.cross(b).norm(), a.dot(b)));
  }
  for (Spread* spread : {&change.tip, &change.direction})
    spread->rms = std::sqrt(spread->rms / double(std::max<std::size_t>(1, n)));
  return change;
}

ordered_json rewrite(const std::filesystem::path& file, const RewriteCommandOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const CaseDescription compensator = chosen_case(scene, options.case_name);
  if (!options.case_name.empty()) trust(scene, compensator);
  ProgressLine progress(2);
  const auto report = [&](const std::string& stage, double fraction) {
    progress.report(stage, fraction);
  };
  progress.begin("prepare");
  const Job job = prepare(scene, report);
  const ResultFile out = out_file(job, options);
  progress.begin(compensator.name);
  const Commands commands = compensate(job, compensator, report);
  check_travel(job, commands);
  write_file(out, commands.rewritten_program);

  const WordChange change = word_change(job, commands);
  const CompensationDescription& words = scene.compensation;
  ordered_json step;
  if (!is_pvt(job.path))
    step = {{"mm", words.word_resolution}, {"deg", words.angle_resolution / units::deg}};
  std::vector<std::string> warnings = job.warnings;
  warnings.insert(warnings.end(), commands.warnings.begin(), commands.warnings.end());
  if (const auto fault = missed_part(job))
    warnings.push_back(fmt::format("nothing of the part is cut: {}", fault->what()));
  if (commands.not_converged > 0)
    warnings.push_back(fmt::format("{} of {} corrections did not converge", commands.not_converged,
                                   job.samples.states.size()));
  return {{"file", out.path().string()},
          {"case", compensator.name},
          {"blocks", {{"before", job.path.motion_blocks}, {"after", commands.path->motion_blocks}}},
          {"bytes", commands.rewritten_program.size()},
          {"correction_um", spread(change.tip, units::um)},
          {"correction_urad", spread(change.direction, units::urad)},
          {"path_tolerance_um", path_tolerance(scene.compensation, job.path) / units::um},
          {"words", step},
          {"left_um", commands.point_left / units::um},
          {"left_urad", commands.direction_left / units::urad},
          {"warnings", warnings}};
}

std::string rewrite_text(const ordered_json& report) {
  const auto number = [](const ordered_json& json) { return json.get<double>(); };
  std::string text = fmt::format(
      "{} blocks became {}\ncorrection of the tip {:.4f} um rms, {:.4f} um at most; of the tool "
      "axis "
      "{:.4f} urad at most\nwithin {:.4g} um of the corrected path",
      report["blocks"]["before"].get<int>(), report["blocks"]["after"].get<int>(),
      number(report["correction_um"]["rms"]), number(report["correction_um"]["max"]),
      number(report["correction_urad"]["max"]), number(report["path_tolerance_um"]));
  if (!report["words"].is_null())
    text += fmt::format(", words rounded to {:.4g} mm and {:.4g} deg",
                        number(report["words"]["mm"]), number(report["words"]["deg"]));
  return text + fmt::format("\n{} ({}, {} bytes)\n", report["file"].get<std::string>(),
                            report["case"].get<std::string>(), report["bytes"].get<std::size_t>());
}

namespace {

Exit print_rewritten(const Common& common, const std::string& case_name) {
  RewriteCommandOptions options;
  options.overrides = overrides(common);
  options.case_name = case_name;
  options.out = common.out;
  options.permissions = common.permissions;
  const nlohmann::ordered_json report = rewrite(common.scene, options);
  print_warnings(report);
  print("{}", Lines(common.json ? json_text(report) : rewrite_text(one_lined(report))));
  return Exit::Ok;
}

}  // namespace

Command rewrite_command(Common& common) {
  const auto case_name = std::make_shared<std::string>();
  return {
      "rewrite", "Write the program of a scene with a compensator's corrections in it",
      scene_options(common, {{"--out", &common.out, "file for the program (out/SCENE/rewritten.*)"},
                             force_option(common),
                             trust_option(common),
                             {"--case", case_name.get(),
                              "belief-strategy-program (the first such case of the scene)"}}),
      [case_name, &common] { return print_rewritten(common, *case_name); }};
}

}  // namespace abbe::sim
