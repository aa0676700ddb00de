#include "sim/commands/compare.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "sim/commands/choose_sensors.h"
#include "sim/compensation/plug_in.h"
#include "sim/cut/reach.h"
#include "sim/files/output.h"
#include "sim/loop/compensate.h"
#include "sim/report/case_files.h"
#include "sim/report/pictures.h"
#include "sim/report/summary_report.h"
#include "sim/scene/case_folders.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {
namespace {

Progress to(ProgressLine& line) {
  return [&line](const std::string& stage, double fraction) { line.report(stage, fraction); };
}

/// A job with its cases: the scene itself, or one variant of it.
struct Batch {
  std::string prefix;  ///< of the names of its cases; empty for the scene itself
  Job job;
};

/// The cases of a batch, measured against its own error-free map, and reductions against its
/// uncompensated case.
void cut_cases(const Batch& batch, std::vector<Compared>& cases, std::vector<FailedCase>& failed,
               ProgressLine& progress) {
  const auto named = [&](const std::string& name) { return case_folder(batch.prefix, name); };
  progress.begin(batch.prefix.empty() ? "error_free" : batch.prefix + ", error-free");
  Cut free = cut_error_free(batch.job, to(progress));
  check_cuts_part(batch.job, free);
  const Verdict error_free = judge(batch.job, std::move(free), nullptr);
  if (batch.prefix.empty()) cases.push_back({error_free, &batch.job, std::nullopt});
  const std::size_t uncompensated = cases.size();
  const auto fails = [&](const std::string& name, const char* reason) {
    failed.push_back({named(name), reason});
    progress.begin("write " + named(name));
  };
  const auto add = [&](const std::optional<CaseDescription>& compensator) {
    progress.begin(named(compensator ? compensator->name : "uncompensated"));
    Cut made;
    try {
      made = cut(batch.job, compensator, to(progress));
      check_cuts_part(batch.job, made);
    } catch (const compensation::PlugInFailure& failure) {
      return fails(compensator->name, failure.what());
    } catch (const BadInput& fault) {  // of what the plug-in answered; else of the scene
      if (!compensator || compensator->plug_in.empty()) throw;
      return fails(compensator->name, fault.what());
    }
    made.name = named(made.name);
    const auto against = compensator ? std::optional(uncompensated) : std::nullopt;
    cases.push_back({judge(batch.job, std::move(made), &error_free), &batch.job, against});
  };
  add(std::nullopt);
  for (const CaseDescription& compensator : batch.job.scene.cases) add(compensator);
}

void collect(std::vector<std::string>& all, const Limits& limits, const Verdict& verdict) {
  for (std::string& one : exceeded(limits, verdict)) all.push_back(std::move(one));
}

/// `run` cuts the case that is named, else the uncompensated machine.
Cut cut_one(const Job& job, const std::string& case_name, const Progress& progress) {
  if (case_name == "error_free") return cut_error_free(job, progress);
  if (case_name.empty() || case_name == "uncompensated") return cut(job, std::nullopt, progress);
  return cut(job, parse_case(case_name), progress);
}

/// The scene with the plug-ins of the command line among its cases, each a folder of its own.
Scene with_plug_ins(Scene scene, const std::vector<std::filesystem::path>& plug_ins) {
  for (const std::filesystem::path& file : plug_ins) {
    const CaseDescription added = plug_in_case(file);
    const bool taken =
        added.name == "error_free" || added.name == "uncompensated" ||
        std::any_of(scene.cases.begin(), scene.cases.end(),
                    [&](const CaseDescription& one) { return one.name == added.name; });
    if (taken)
      throw BadInput(file.string(), 0, 0, "a compensator whose file name no other case has",
                     "\"" + added.name + "\" again");
    scene.cases.push_back(added);
    trust(scene, added);
  }
  return scene;
}

std::vector<Scene> read_variants(const Scene& scene, const std::vector<Override>& overrides) {
  std::vector<Scene> variants;
  for (const Variant& variant : scene.variants) {
    std::vector<Override> all = overrides;
    all.insert(all.end(), variant.set.begin(), variant.set.end());
    variants.push_back(read_scene(scene.file, all));
    variants.back().trusted = scene.trusted;
  }
  return variants;
}

/// Refuses, before an hour's work, what will not be written over: forced, an input may stand there.
void check_names(const ResultFolder& folder) {
  for (const char* name : result_names) check_file(folder / name);
}

/// Refuses, before an hour's work, a folder of a case that two cases share or that somebody else
/// made.
void check_cases(const ResultFolder& folder, const Scene& scene, const std::vector<Scene>& variants,
                 const Writer& writer) {
  ComparedNames names{scene.cases, {}};
  for (std::size_t i = 0; i < variants.size(); ++i)
    names.variants.push_back({scene.variants[i].name, variants[i].cases});
  Faults faults;  // those of the scene alone were found when it was read
  check_case_folders(*scene.tree, names, faults);
  if (!faults.empty()) throw BadScene(faults.list());
  for (const std::string& name : case_folders(names)) {
    check_folder(folder.path() / name, writer);
    for (const char* file : result_names) check_file(folder.path() / name / file, writer);
  }
}

}  // namespace

Outcome run(const std::filesystem::path& file, const RunOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  std::string name = options.case_name.empty() ? scene.case_name : options.case_name;
  if (!options.plug_ins.empty()) name = plug_in_case(options.plug_ins.front()).plug_in.string();
  if (!options.case_name.empty() || !options.plug_ins.empty()) trust(scene, name);
  const ResultFolder folder(options.folder, writer_of(scene, options.permissions));
  check_names(folder);
  ProgressLine progress(2);
  progress.begin("prepare");
  const Job job = prepare(scene, to(progress));
  check_reaches_part(job);
  progress.begin(name.empty() ? "uncompensated" : name);
  Cut made = cut_one(job, name, to(progress));
  check_cuts_part(job, made);
  const Verdict verdict = judge(job, std::move(made), nullptr);
  write_program(folder, job);
  write_case(folder, job, verdict);
  Outcome outcome{summary(job, verdict), {}, {}, {}};
  if (scene.sensor_choice)
    outcome.sensors = choose_sensors(folder, scene, read_variants(scene, options.overrides));
  collect(outcome.exceeded, scene.limits, verdict);
  return outcome;
}

Outcome compare(const std::filesystem::path& file, const RunOptions& options) {
  const Scene scene = with_plug_ins(
      read_trusted_scene(file, options.overrides, options.permissions), options.plug_ins);
  std::vector<Scene> variants = read_variants(scene, options.overrides);
  for (Scene& variant : variants) variant = with_plug_ins(std::move(variant), options.plug_ins);
  const ResultFolder folder(options.folder, writer_of(scene, options.permissions));
  check_names(folder);
  check_cases(folder, scene, variants, writer_of(scene, options.permissions));

  int parts = 2;  // preparing, and the comparison at the end
  const auto count = [&](const Scene& one) { parts += 2 * (2 + int(one.cases.size())); };
  count(scene);
  for (const Scene& variant : variants) count(variant);
  ProgressLine progress(parts);
  progress.begin("prepare");
  std::vector<Batch> batches;
  batches.reserve(1 + variants.size());
  batches.push_back({"", prepare(scene, to(progress))});
  for (std::size_t i = 0; i < variants.size(); ++i)
    batches.push_back({scene.variants[i].name, prepare(variants[i], to(progress))});
  for (const Batch& batch : batches) check_reaches_part(batch.job);
  std::vector<Compared> cases;
  std::vector<FailedCase> failed;
  for (const Batch& batch : batches) cut_cases(batch, cases, failed, progress);

  const Comparison compared = comparison(batches.front().job, cases, failed);
  Outcome outcome{compared, {}, {}, {}};
  for (const FailedCase& one : failed) outcome.failed.push_back(one.name + ": " + one.reason);
  for (const Batch& batch : batches) write_program(folder.inside(batch.prefix), batch.job);
  const bool compensates = std::any_of(cases.begin(), cases.end(), [](const Compared& one) {
    return one.uncompensated.has_value();
  });
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const Compared& one = cases[i];
    progress.begin("write " + one.verdict.cut.name);
    write_case(folder.inside(one.verdict.cut.name), *one.job, one.verdict);
    // where there are compensators, they are what is accepted or not
    if (compensates ? one.uncompensated.has_value() : i > 0)
      collect(outcome.exceeded, one.job->scene.limits, one.verdict);
  }
  outcome.sensors = choose_sensors(folder, scene, variants);
  write_json(folder / "comparison.json", to_json(compared));
  progress.begin("write comparison");
  write_comparison_picture(folder / "comparison.png", scene, cases);
  return outcome;
}

}  // namespace abbe::sim
