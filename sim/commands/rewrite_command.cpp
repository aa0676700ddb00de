#include "sim/commands/rewrite_command.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "kinematics/units.h"
#include "sim/cut/reach.h"
#include "sim/cut/stages.h"
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
  const std::string name = "rewritten" + std::filesystem::path(job.path.file).extension().string();
  const std::filesystem::path out =
      options.out.empty() ? std::filesystem::path("out") / job.scene.file.stem() : options.out;
  return result_file(file_of_out(out, name), writer_of(job.scene, options.permissions));
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

Rewritten rewrite(const std::filesystem::path& file, const RewriteCommandOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const CaseDescription compensator = chosen_case(scene, options.case_name);
  if (!options.case_name.empty()) trust(scene, compensator);
  const auto rest = [&](const WorkSize& size) {
    return stages_of_commands(compensator.name, size, scene, compensator) +
           stages_of_words("write", size);
  };
  ProgressLine progress(stages_of_preparing("prepare", expected_size(scene)) +
                        rest(expected_size(scene)));
  progress.begin("prepare");
  const Job job = prepare(scene, to(progress));
  const ResultFile out = out_file(job, options);
  progress.replan(rest(size_of(job)));
  progress.begin(compensator.name);
  const Commands commands = compensate(job, compensator, to(progress));
  check_travel(job, commands);
  progress.begin("write");
  progress.report("words", 0.0);
  const WordChange change = word_change(job, commands);
  write_file(out, commands.rewritten_program);

  const CompensationDescription& words = scene.compensation;
  std::optional<Rewritten::Words> step;
  if (!is_pvt(job.path)) step = {words.word_resolution, words.angle_resolution / units::deg};
  std::vector<std::string> warnings = job.warnings;
  warnings.insert(warnings.end(), commands.warnings.begin(), commands.warnings.end());
  const Placement place = placement(job);
  warnings.insert(warnings.end(), place.warnings.begin(), place.warnings.end());
  if (place.fault)
    warnings.push_back(fmt::format("nothing of the part is cut: {}", place.fault->what()));
  if (commands.not_converged > 0)
    warnings.push_back(fmt::format("{} of {} corrections did not converge", commands.not_converged,
                                   job.samples.states.size()));
  return {out.path(),
          compensator.name,
          std::size_t(job.path.motion_blocks),
          std::size_t(commands.path->motion_blocks),
          commands.rewritten_program.size(),
          change,
          path_tolerance(scene.compensation, job.path),
          step,
          commands.point_left,
          commands.direction_left,
          std::move(warnings)};
}

namespace {

ordered_json spread(const Spread& s, double unit) {
  return {{"rms", s.rms / unit}, {"max", s.max / unit}};
}

ordered_json to_json(const Rewritten& done) {
  ordered_json words;
  if (done.words) words = {{"mm", done.words->mm}, {"deg", done.words->deg}};
  return {{"file", done.file.string()},
          {"case", done.case_name},
          {"blocks", {{"before", done.blocks_before}, {"after", done.blocks_after}}},
          {"bytes", done.bytes},
          {"correction_um", spread(done.correction.tip, units::um)},
          {"correction_urad", spread(done.correction.direction, units::urad)},
          {"path_tolerance_um", done.path_tolerance / units::um},
          {"words", words},
          {"left_um", done.point_left / units::um},
          {"left_urad", done.direction_left / units::urad},
          {"warnings", done.warnings}};
}

std::string to_text(const Rewritten& done) {
  std::string text = fmt::format(
      "{} blocks became {}\ncorrection of the tip {:.4f} um rms, {:.4f} um at most; of the tool "
      "axis "
      "{:.4f} urad at most\nwithin {:.4g} um of the corrected path",
      done.blocks_before, done.blocks_after, done.correction.tip.rms / units::um,
      done.correction.tip.max / units::um, done.correction.direction.max / units::urad,
      done.path_tolerance / units::um);
  if (done.words)
    text +=
        fmt::format(", words rounded to {:.4g} mm and {:.4g} deg", done.words->mm, done.words->deg);
  return text + fmt::format("\n{} ({}, {} bytes)\n", escaped(done.file.string()),
                            escaped(done.case_name), done.bytes);
}

Exit print_rewritten(const Common& common, const std::string& case_name) {
  RewriteCommandOptions options;
  options.overrides = overrides(common);
  options.case_name = case_name;
  options.out = common.out;
  options.permissions = common.permissions;
  const Rewritten done = rewrite(common.scene, options);
  print_warnings(done.warnings);
  print("{}", Lines(common.json ? json_text(to_json(done)) : to_text(done)));
  return Exit::Ok;
}

}  // namespace

Command rewrite_command(Common& common) {
  const auto case_name = std::make_shared<std::string>();
  return {"rewrite",
          "Write the program of a scene with a compensator's corrections in it",
          {"abbe rewrite scenes/gantry_dome.toml --out out/dome.ngc",
           "abbe rewrite scenes/platform_plane.toml --case identified-position-program --out "
           "out/plane.csv"},
          scene_options(common, {{"--out", &common.out,
                                  "file for the program, or folder for it (out/SCENE/rewritten.*)"},
                                 force_option(common),
                                 trust_option(common),
                                 {"--case", case_name.get(),
                                  "belief-strategy-program (the first such case of the scene)"}}),
          [case_name, &common] { return print_rewritten(common, *case_name); }};
}

}  // namespace abbe::sim
