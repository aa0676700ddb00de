#include "sim/compare.h"

#include <nlohmann/json.hpp>

#include "sim/output.h"
#include "sim/pictures.h"

namespace abbe::sim {
namespace {

Progress to(ProgressLine& line) {
  return [&line](const std::string& stage, double fraction) { line.report(stage, fraction); };
}

/// The cases of one variant (or of the scene itself), measured against its uncompensated one.
void cut_cases(const Job& job, const std::string& prefix, const Verdict& error_free,
               std::vector<Compared>& cases, ProgressLine& progress) {
  const auto named = [&](const std::string& name) {
    if (prefix.empty()) return name;
    return name == "uncompensated" ? prefix : prefix + "-" + name;
  };
  const auto add = [&](const std::optional<CaseDescription>& compensator, std::optional<std::size_t> against) {
    const std::string name = named(compensator ? compensator->name : "uncompensated");
    progress.begin(name);
    Cut made = cut(job, compensator, to(progress));
    made.name = name;
    cases.push_back({judge(job, std::move(made), &error_free), against});
  };
  const std::size_t uncompensated = cases.size();
  add(std::nullopt, std::nullopt);
  for (const CaseDescription& compensator : job.scene.cases) add(compensator, uncompensated);
}

void collect(std::vector<std::string>& all, const Limits& limits, const Verdict& verdict) {
  for (std::string& one : exceeded(limits, verdict)) all.push_back(std::move(one));
}

}  // namespace

Outcome run(const std::filesystem::path& file, const RunOptions& options) {
  const Scene scene = read_scene(file, options.overrides);
  prepare_folder(options.folder);
  ProgressLine progress(2);
  progress.begin("prepare");
  const Job job = prepare(scene, {options.folder, to(progress)});
  progress.begin(options.error_free ? "error_free" : options.only ? options.only->name : "uncompensated");
  const Verdict verdict = judge(
      job, options.error_free ? cut_error_free(job, to(progress)) : cut(job, options.only, to(progress)), nullptr);
  write_case(options.folder, job, verdict);
  Outcome outcome{summary(job, verdict), {}};
  collect(outcome.exceeded, scene.limits, verdict);
  return outcome;
}

Outcome compare(const std::filesystem::path& file, const RunOptions& options) {
  const Scene scene = read_scene(file, options.overrides);
  std::vector<Scene> variants;
  for (const Variant& variant : scene.variants) {
    std::vector<Override> overrides = options.overrides;
    overrides.insert(overrides.end(), variant.set.begin(), variant.set.end());
    variants.push_back(read_scene(file, overrides));
  }
  prepare_folder(options.folder);

  const int per_variant = 1 + int(scene.cases.size());
  const int cuts = 1 + per_variant * (1 + int(variants.size()));
  ProgressLine progress(2 * cuts + 1);
  progress.begin("prepare");
  const Job job = prepare(scene, {options.folder, to(progress)});
  std::vector<Compared> cases;
  progress.begin("error_free");
  cases.push_back({judge(job, cut_error_free(job, to(progress)), nullptr), std::nullopt});
  const Verdict error_free = cases.front().verdict;
  cut_cases(job, "", error_free, cases, progress);

  std::vector<const Job*> job_of(cases.size(), &job);
  std::vector<Job> variant_jobs;
  variant_jobs.reserve(variants.size());
  for (std::size_t i = 0; i < variants.size(); ++i) {
    variant_jobs.push_back(prepare(variants[i], {options.folder, to(progress)}));
    cut_cases(variant_jobs.back(), scene.variants[i].name, error_free, cases, progress);
    job_of.resize(cases.size(), &variant_jobs.back());
  }

  Outcome outcome{comparison(job, cases), {}};
  for (std::size_t i = 0; i < cases.size(); ++i) {
    progress.begin("write " + cases[i].verdict.cut.name);
    write_case(options.folder / cases[i].verdict.cut.name, *job_of[i], cases[i].verdict);
    if (i > 1) collect(outcome.exceeded, job_of[i]->scene.limits, cases[i].verdict);
  }
  write_file(options.folder / "comparison.json", outcome.json.dump(2) + "\n");
  progress.begin("write comparison");
  write_comparison_picture(options.folder / "comparison.png", job, cases);
  return outcome;
}

}  // namespace abbe::sim
