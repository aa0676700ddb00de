#include "sim/commands/scene_runs.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>

#include <nlohmann/json.hpp>

#include "sim/compensation/plug_in.h"
#include "sim/cut/collisions.h"
#include "sim/cut/judged_surface.h"
#include "sim/cut/placement.h"
#include "sim/cut/process.h"
#include "sim/cut/run_estimate.h"
#include "sim/files/output.h"
#include "sim/files/progress.h"
#include "sim/loop/compensate.h"
#include "sim/measure/measure.h"
#include "sim/report/case_page.h"
#include "sim/report/picture_files.h"
#include "sim/report/result_files.h"
#include "sim/report/sensor_choice_report.h"
#include "sim/report/stock_check.h"
#include "sim/report/summary.h"
#include "sim/scene/cases.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/trust.h"

namespace abbe::sim {

namespace {

/// Returns the times at which the spindle or an axis starts after a rest, s. The history begins
/// after a rest.
std::vector<double> cycle_starts(const ThermalDescription& thermal, double history) {
  std::vector<double> starts;
  double time_s = -history;
  bool is_resting = true;
  for (const ThermalPhase& phase : thermal.history) {
    const bool is_working = phase.spindle_speed > 0.0 ||
                            (phase.axis_speed.size() > 0 && phase.axis_speed.maxCoeff() > 0.0);
    if (is_working && is_resting) starts.push_back(time_s);
    is_resting = !is_working;
    time_s += phase.duration;
  }
  return starts;
}

}  // namespace

std::optional<CaseDescription> parse_compensator(const std::string& case_name) {
  if (case_name.empty() || case_name == "error_free" || case_name == "uncompensated")
    return std::nullopt;
  return parse_case(case_name);
}

Cut cut_named_case(const Job& job, const std::string& case_name, const Progress& progress,
                   Retention retention) {
  if (case_name == "error_free") return cut_error_free(job, progress, retention);
  return cut(job, parse_compensator(case_name), progress, retention);
}

DayReadings measure_day(const std::string& name, const Scene& scene) {
  const auto throw_input_error = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(scene.file.string(), 0, 0, expected, seen);
  };
  InstrumentDescription description = find_instrument(scene, scene.sensor_choice->instrument);
  if (description.instrument.kind != errors::metrology::Kind::Drift)
    throw_input_error("an instrument of kind drift for sensor_choice",
                      errors::metrology::to_string(description.instrument.kind));
  // The day on which sensors are chosen is the history of the machine before the program.
  const double history = history_duration(*scene.thermal);
  if (history <= 0.0) throw_input_error("a [[history]] for the choice of sensors", "none");
  description.starts_s = {-history};
  description.instrument.duration_s = history;
  DayReadings day{name,
                  scene.file,
                  cycle_starts(*scene.thermal, history),
                  measure_machine(scene, description),
                  {}};
  day.sensor_noise_K = Eigen::VectorXd::Zero(Eigen::Index(day.readings.sensors.size()));
  for (const errors::TemperatureSensor& sensor : scene.thermal->sensors)
    if (const auto sensor_name = std::ranges::find(day.readings.sensors, sensor.name);
        sensor_name != day.readings.sensors.end())
      // Rounding to the resolution adds the variance of a uniform distribution, resolution^2 / 12.
      day.sensor_noise_K[sensor_name - day.readings.sensors.begin()] = std::sqrt(
          sensor.noise_K * sensor.noise_K + sensor.resolution_K * sensor.resolution_K / 12.0);
  return day;
}

std::optional<ThermalSensorChoice> choose_sensors(const ResultFolder& folder, const Scene& scene,
                                                  const std::vector<Scene>& variants) {
  if (!scene.sensor_choice || !scene.thermal) return std::nullopt;
  std::vector<DayReadings> days{measure_day("its own day", scene)};
  for (std::size_t i = 0; i < variants.size(); ++i)
    days.push_back(measure_day(scene.variants[i].name, variants[i]));
  ThermalSensorChoice choice = choose_thermal_sensors(days, *scene.sensor_choice);
  write_json(folder / "thermal.json", to_json(choice));
  write_thermal_picture(folder / "thermal.png", choice);
  return choice;
}

namespace {

/// Returns the job with its part sampled. Checks first that it fits into memory and is located
/// where the program cuts.
/// @param windows_obstacle  see `check_memory`
Job sample_job(Job job, const CaseRequest& request, ProgressLine& progress,
               const std::string& windows_obstacle = {}) {
  check_memory(job.scene, {work_size(job)}, request, windows_obstacle);
  if (std::string text = proximity_warning(job); !text.empty())
    job.warnings.push_back(std::move(text));
  return sampled(check_placement(std::move(job)), progress_function(progress));
}

/// Returns the memory for the samples of a program. If they exceed it, the program is cut in
/// windows, unless something needs all samples at once.
/// @param scenes  of all jobs that are in memory together
/// @param cases   to cut in addition to those of [compare]
/// @param scene   scene of this job, one of `scenes`
MemoryBudget memory_budget(const std::vector<Scene>& scenes,
                           const std::vector<std::optional<CaseDescription>>& cases,
                           const CaseRequest& request, const Scene& scene) {
  MemoryBudget budget;
  const auto add_obstacle = [&](const std::string& obstacle) {
    if (budget.windows_obstacle.empty()) budget.windows_obstacle = obstacle;
  };
  if (request.keeps_tracks) add_obstacle("the track of the tool");
  for (const Scene& loaded : scenes) {
    for (const auto& compensator : cases) add_obstacle(find_windows_obstacle(loaded, compensator));
    if (!request.has_comparison_picture) continue;
    for (const CaseDescription& compensator : loaded.cases)
      add_obstacle(find_windows_obstacle(loaded, compensator));
  }
  if (!budget.windows_obstacle.empty()) return budget;
  budget.samples = [request, scene, jobs = scenes.size()](std::size_t blocks,
                                                          std::size_t vertices) {
    WorkSize job = expected_size(scene);
    job.blocks = double(blocks);
    job.vertices = double(vertices);
    return max_samples_in_memory(size_after_sampling(job, scene), request, jobs);
  };
  return budget;
}

/// Reports the memory of the cuts if it is large, and throws if it does not fit.
void check_cut_memory(const Scene& scene, const std::vector<WorkSize>& sizes,
                      const CaseRequest& request, ProgressLine& progress,
                      const std::string& windows_obstacle = {}) {
  check_memory(scene, sizes, request, windows_obstacle);
  if (const std::string text = memory_remark(sizes, request); !text.empty())
    progress_function(progress)(text, -1.0);
}

/// Returns the data to keep of a cut. A report needs the track of the tool.
Retention retention_of_run(const RunOptions& options) {
  return options.report_language.empty() ? required_retention(options.formats) : Retention::Track;
}

/// Returns the request with the pictures and the track that the options need.
CaseRequest add_output_options(CaseRequest request, const RunOptions& options) {
  request.draws_pictures = can_draw_pictures();
  request.keeps_tracks = retention_of_run(options) == Retention::Track;
  return request;
}

/// The result of cutting a case, or the reason of its failure.
struct CaseAttempt {
  std::optional<Verdict> verdict;
  std::string failure;  ///< message of a failed plug-in if there is no verdict
};

/// Cuts one case on the machine with errors, as programmed or with a compensator.
/// @param error_free  the error-free case for comparison; it is needed only after the cut
CaseAttempt attempt_case(const VariantJob& variant_job,
                         const std::optional<CaseDescription>& compensator, Retention retention,
                         const std::shared_future<const Verdict*>& error_free,
                         const Progress& progress) {
  Cut result;
  try {
    result = cut(variant_job.job, compensator, progress, retention);
    check_cuts_part(variant_job.job, result);
  } catch (const compensation::PlugInFailure& failure) {
    return {{}, failure.what()};
  } catch (const BadInput& error) {  // the output of the plug-in may be the cause
    if (!compensator || compensator->plug_in.empty()) throw;
    return {{}, error.what()};
  }
  result.name = case_folder(variant_job.prefix, result.name);
  // Progress is reported while waiting, so that Ctrl-C and failures of other tasks end the wait.
  while (error_free.wait_for(std::chrono::milliseconds(100)) == std::future_status::timeout)
    progress("surface", 1.0);
  return {judge(variant_job.job, std::move(result), error_free.get()), ""};
}

/// Returns true if cases may run in parallel. Compensators of the user run one at a time.
bool are_independent(const std::vector<CaseDescription>& cases) {
  return std::ranges::all_of(cases, [](const CaseDescription& description) {
    return description.plug_in.empty() && description.function == nullptr;
  });
}

/// Cuts the cases of a scene or variant, compares them with its error-free map, and states which
/// case is the baseline of reductions.
void cut_cases(const VariantJob& variant_job, CaseResults& results, Retention retention,
               ProgressLine& progress) {
  const auto folder_name = [&](const std::string& name) {
    return case_folder(variant_job.prefix, name);
  };
  const std::vector<CaseDescription>& compensators = variant_job.job.scene.cases;
  std::optional<Verdict> error_free;
  std::promise<const Verdict*> error_free_promise;
  const std::shared_future<const Verdict*> error_free_verdict =
      error_free_promise.get_future().share();
  std::vector<Task> tasks{{folder_name("error_free"), [&](const Progress& report_progress) {
                             try {
                               // The error-free map of a variant is only compared with, not
                               // reported.
                               Cut error_free_cut = cut_error_free(
                                   variant_job.job, report_progress,
                                   variant_job.prefix.empty() ? retention : Retention::Map);
                               check_cuts_part(variant_job.job, error_free_cut);
                               error_free =
                                   judge(variant_job.job, std::move(error_free_cut), nullptr);
                               error_free_promise.set_value(&*error_free);
                             } catch (...) {
                               error_free_promise.set_exception(std::current_exception());
                               throw;
                             }
                           }}};
  std::vector<CaseAttempt> cases(1 + compensators.size());
  const WorkSize size = work_size(variant_job.job);
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto compensator = i == 0 ? std::nullopt : std::optional(compensators[i - 1]);
    tasks.push_back({folder_name(compensator ? compensator->name : "uncompensated"),
                     [&, i, compensator](const Progress& report_progress) {
                       cases[i] = attempt_case(variant_job, compensator, retention,
                                               error_free_verdict, report_progress);
                     },
                     total_seconds(cut_stages("", size, variant_job.job.scene, compensator))});
  }
  run_tasks(tasks, are_independent(compensators) ? results.max_parallel : 1, progress);
  if (variant_job.prefix.empty())
    results.cases.push_back({std::move(*error_free), &variant_job.job, std::nullopt});
  const std::size_t uncompensated_index = results.cases.size();
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto baseline = i == 0 ? std::nullopt : std::optional(uncompensated_index);
    if (cases[i].verdict)
      results.cases.push_back({std::move(*cases[i].verdict), &variant_job.job, baseline});
    else
      results.failed.push_back({tasks[i + 1].name, cases[i].failure});
  }
}

/// Returns the stages of the cuts of a scene or variant.
std::vector<Stage> cut_stages_of_scene(const std::string& prefix, const WorkSize& size,
                                       const Scene& scene) {
  const auto folder_name = [&](const std::string& name) { return case_folder(prefix, name); };
  std::vector<Stage> stages = error_free_stages(folder_name("error_free"), size) +
                              cut_stages(folder_name("uncompensated"), size, scene, std::nullopt);
  for (const CaseDescription& compensator : scene.cases)
    stages =
        std::move(stages) + cut_stages(folder_name(compensator.name), size, scene, compensator);
  return stages;
}

/// Returns the stages of writing the cases of a scene or variant. The error-free map of a variant
/// is not written.
std::vector<Stage> file_stages_of_scene(const std::string& prefix, const WorkSize& size,
                                        const Scene& scene) {
  const auto task_name = [&](const std::string& name) {
    return "write " + case_folder(prefix, name);
  };
  std::vector<Stage> stages;
  if (prefix.empty()) stages = file_stages(task_name("error_free"), size);
  stages = std::move(stages) + file_stages(task_name("uncompensated"), size);
  for (const CaseDescription& compensator : scene.cases)
    stages = std::move(stages) + file_stages(task_name(compensator.name), size);
  return stages;
}

/// Returns the stages of a comparison after preparation.
/// @param sizes  of the scene and its variants, in this order
std::vector<Stage> comparison_plan(const Scene& scene, const std::vector<Scene>& variants,
                                   const std::vector<WorkSize>& sizes) {
  std::vector<Stage> cuts = cut_stages_of_scene("", sizes.front(), scene);
  std::vector<Stage> files = file_stages_of_scene("", sizes.front(), scene);
  double maps = 2.0 + double(scene.cases.size());
  for (std::size_t i = 0; i < variants.size(); ++i) {
    const std::string& name = scene.variants[i].name;
    cuts = std::move(cuts) + cut_stages_of_scene(name, sizes[i + 1], variants[i]);
    files = std::move(files) + file_stages_of_scene(name, sizes[i + 1], variants[i]);
    maps += 1.0 + double(variants[i].cases.size());
  }
  std::vector<Stage> sensors;
  if (scene.sensor_choice) sensors = {{"choose sensors", "sensors", 2.0}};
  return std::move(cuts) + std::move(files) + std::move(sensors) +
         comparison_stages("write comparison", sizes.front(), maps);
}

void append_exceeded_limits(std::vector<std::string>& texts, const Limits& limits,
                            const Verdict& verdict) {
  for (std::string& text : exceeded_limits(limits, verdict)) texts.push_back(std::move(text));
}

/// Returns a text for each exceeded limit. If there are compensators, only their cases are judged,
/// because the uncompensated machine is expected to fail.
std::vector<std::string> exceeded_limit_texts(const std::vector<ComparedCase>& cases) {
  const bool has_compensators = std::any_of(
      cases.begin(), cases.end(),
      [](const ComparedCase& compared) { return compared.uncompensated_index.has_value(); });
  std::vector<std::string> texts;
  // Without compensators every case is judged except the first, the error-free one.
  for (std::size_t i = 0; i < cases.size(); ++i)
    if (has_compensators ? cases[i].uncompensated_index.has_value() : i > 0)
      append_exceeded_limits(texts, cases[i].job->scene.limits, cases[i].verdict);
  return texts;
}

/// Returns the scene with the compensators of the user added to its cases. Throws BadInput if two
/// cases would have one folder.
Scene add_user_compensators(Scene scene, const RunOptions& options) {
  std::vector<CaseDescription> user_compensators;
  for (const std::filesystem::path& file : options.plug_ins)
    user_compensators.push_back(plug_in_case(file));
  user_compensators.insert(user_compensators.end(), options.functions.begin(),
                           options.functions.end());
  for (const CaseDescription& compensator : user_compensators) {
    const bool is_taken = compensator.name == "error_free" || compensator.name == "uncompensated" ||
                          std::any_of(scene.cases.begin(), scene.cases.end(),
                                      [&](const CaseDescription& description) {
                                        return description.name == compensator.name;
                                      });
    if (is_taken)
      throw BadInput(compensator.plug_in.string(), 0, 0,
                     "a compensator with a file name that no other case uses",
                     "\"" + compensator.name + "\" again");
    scene.cases.push_back(compensator);
    if (!compensator.function) trust(scene, compensator);
  }
  return scene;
}

/// Returns the scenes of all variants. The values of a variant take precedence over the overrides
/// of the command line.
std::vector<Scene> read_variants(const Scene& scene, const std::vector<Override>& overrides) {
  std::vector<Scene> variants;
  for (const Variant& variant : scene.variants) {
    std::vector<Override> variant_overrides = overrides;
    variant_overrides.insert(variant_overrides.end(), variant.set.begin(), variant.set.end());
    variants.push_back(read_scene(scene.file, variant_overrides));
    variants.back().trusted = scene.trusted;
  }
  return variants;
}

/// Checks, before any lengthy work, that no result would overwrite an input, which with --force may
/// have the name of a result.
void check_result_names(const ResultFolder& folder) {
  for (const char* name : result_names) check_file(folder / name);
}

/// Checks, before any lengthy work, that no two cases share a folder and that the folders of cases
/// can be written.
void check_cases(const ResultFolder& folder, const Scene& scene, const std::vector<Scene>& variants,
                 const Writer& writer) {
  ComparedNames names{scene.cases, {}};
  for (std::size_t i = 0; i < variants.size(); ++i)
    names.variants.push_back({scene.variants[i].name, variants[i].cases});
  InputErrors input_errors;  // errors of the scene itself were reported when it was read
  check_case_folders(*scene.tree, names, input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  for (const std::string& name : case_folders(names)) {
    check_folder(folder.path() / name, writer);
    for (const char* file : result_names) check_file(folder.path() / name / file, writer);
  }
}

/// A scene and its variants.
struct RequestedScenes {
  Scene scene;
  std::vector<Scene> variants;
};

/// Reads a scene and its variants, and adds the compensators of the user to each of them.
RequestedScenes read_requested_scenes(const std::filesystem::path& file,
                                      const RunOptions& options) {
  RequestedScenes requested{
      add_user_compensators(read_trusted_scene(file, options.overrides, options.permissions),
                            options),
      {}};
  requested.variants = read_variants(requested.scene, options.overrides);
  for (Scene& variant : requested.variants)
    variant = add_user_compensators(std::move(variant), options);
  return requested;
}

/// Prepares and cuts all cases.
/// @param progress_line  is created here, and used by the caller for writing
CaseResults cut_all_cases(const RequestedScenes& requested, const RunOptions& options,
                          std::optional<ProgressLine>& progress_line) {
  const Scene& scene = requested.scene;
  const std::vector<Scene>& variants = requested.variants;
  const auto preparation_name = [&](std::size_t i) {
    return i == 0 ? std::string("prepare") : "prepare " + scene.variants[i - 1].name;
  };
  std::vector<WorkSize> sizes{expected_size(scene)};
  for (const Scene& variant : variants) sizes.push_back(expected_size(variant));
  std::vector<Stage> plan;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const Scene& scene_or_variant = i == 0 ? scene : variants[i - 1];
    plan = std::move(plan) + scene_preparation_stages(preparation_name(i), sizes[i]) +
           sampling_stages(preparation_name(i), sizes[i], scene_or_variant);
    sizes[i] = size_after_sampling(sizes[i], scene_or_variant);
  }
  progress_line.emplace(std::move(plan) + comparison_plan(scene, variants, sizes),
                        options.progress);
  ProgressLine& progress = *progress_line;
  std::vector<Scene> scenes{scene};
  scenes.insert(scenes.end(), variants.begin(), variants.end());
  CaseRequest request = add_output_options(compare_case_request(scenes), options);
  CaseResults results;
  std::vector<VariantJob>& variant_jobs = results.variant_jobs;
  // Cases refer to the jobs, so the vector must not reallocate.
  variant_jobs.reserve(1 + variants.size());
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    progress.begin(preparation_name(i));
    const MemoryBudget memory = memory_budget(scenes, {std::nullopt}, request, scenes[i]);
    variant_jobs.push_back({i == 0 ? "" : scene.variants[i - 1].name,
                            sample_job(prepare(scenes[i], progress_function(progress), memory),
                                       request, progress, memory.windows_obstacle)});
    sizes[i] = work_size(variant_jobs.back().job);
  }
  // A caller with its own progress function, such as Python, may be able to interrupt only from the
  // calling thread, so its cases run one at a time.
  if (!options.progress)
    request.max_parallel = results.max_parallel = cases_at_once(sizes, request);
  check_cut_memory(scene, sizes, request, progress,
                   memory_budget(scenes, {std::nullopt}, request, scene).windows_obstacle);
  progress.replan(comparison_plan(scene, variants, sizes));
  for (const VariantJob& variant_job : variant_jobs)
    cut_cases(variant_job, results, retention_of_run(options), progress);
  results.comparison = comparison(variant_jobs.front().job, results.cases, results.failed);
  return results;
}

/// Compares the machined body of a case with the design. Returns its warnings.
std::vector<std::string> check_stock(ComparedCase& compared) {
  compared.verdict.stock = stock_check(*compared.job, compared.verdict);
  std::vector<std::string> warnings;
  if (!compared.verdict.stock) return warnings;
  for (const std::string& warning : warnings_of(*compared.verdict.stock))
    warnings.push_back(compared.verdict.cut.name + ": " + warning);
  return warnings;
}

/// Writes the files of all cases. Returns the warnings about the machined bodies.
std::vector<std::string> write_cases(const ResultFolder& folder, CaseResults& results,
                                     const std::vector<std::string>& formats,
                                     ProgressLine& progress) {
  std::vector<std::vector<std::string>> warnings(results.cases.size());
  std::vector<Task> tasks;
  for (std::size_t i = 0; i < results.cases.size(); ++i) {
    const auto write = [&, i](const Progress& report_progress) {
      ComparedCase& compared = results.cases[i];
      warnings[i] = check_stock(compared);
      write_case(folder.inside(compared.verdict.cut.name), *compared.job, compared.verdict, formats,
                 report_progress);
      compared.verdict.stock.reset();  // tens of MB, no longer needed
    };
    tasks.push_back({"write " + results.cases[i].verdict.cut.name, write});
  }
  run_tasks(tasks, results.max_parallel, progress);
  std::vector<std::string> all_warnings;
  for (const std::vector<std::string>& case_warnings : warnings)
    all_warnings.insert(all_warnings.end(), case_warnings.begin(), case_warnings.end());
  return all_warnings;
}

std::vector<std::string> failure_texts(const std::vector<FailedCase>& failed) {
  std::vector<std::string> texts;
  for (const FailedCase& failure : failed) texts.push_back(failure.name + ": " + failure.reason);
  return texts;
}

/// Writes the page of cases that were cut.
ReportOutcome write_report(const ResultFile& file, const std::vector<ComparedCase>& cases,
                           const Comparison& comparison_figures, const RunOptions& options) {
  const HtmlReport page =
      html_report(cases, comparison_figures, {options.report_language, options.command});
  write_file(file, page.html);
  return {page.html.size(), page.warnings, {}, {}};
}

/// Writes the requested report by calling `write`, or removes that of an earlier run if none is
/// requested. Returns the warnings of the report.
template <class Write>
std::vector<std::string> write_or_remove_report(const ResultFolder& folder,
                                                const RunOptions& options, const Write& write) {
  const ResultFile file = folder / "report.html";
  if (!options.report_language.empty()) return write(file).warnings;
  remove_file(file);
  return {};
}

}  // namespace

Outcome run(const std::filesystem::path& file, const RunOptions& options) {
  Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  std::string name = options.case_name.empty() ? scene.case_name : options.case_name;
  if (!options.plug_ins.empty()) name = plug_in_case(options.plug_ins.front()).plug_in.string();
  if (!options.case_name.empty() || !options.plug_ins.empty()) trust(scene, name);
  // The folder is checked and created before the work starts.
  const ResultFolder folder(options.folder, make_writer(scene, options.permissions));
  check_result_names(folder);
  const std::string shown_name = name.empty() ? "uncompensated" : name;
  const auto remaining_stages = [&](const WorkSize& size) {
    return (shown_name == "error_free"
                ? error_free_stages(shown_name, size)
                : cut_stages(shown_name, size, scene, parse_compensator(shown_name))) +
           file_stages("write", size);
  };
  const WorkSize expected = expected_size(scene);
  ProgressLine progress(scene_preparation_stages("prepare", expected) +
                            sampling_stages("prepare", expected, scene) +
                            remaining_stages(size_after_sampling(expected, scene)),
                        options.progress);
  progress.begin("prepare");
  const CaseRequest request =
      add_output_options(run_case_request(parse_compensator(shown_name)), options);
  const MemoryBudget memory =
      memory_budget({scene}, {parse_compensator(shown_name)}, request, scene);
  const Job job = sample_job(prepare(scene, progress_function(progress), memory), request, progress,
                             memory.windows_obstacle);
  check_cut_memory(scene, {work_size(job)}, request, progress, memory.windows_obstacle);
  progress.replan(remaining_stages(work_size(job)));
  progress.begin(shown_name);
  Cut result =
      cut_named_case(job, shown_name, progress_function(progress), retention_of_run(options));
  check_cuts_part(job, result);
  progress.begin("write");
  Verdict verdict = judge(job, std::move(result), nullptr);
  verdict.stock = stock_check(job, verdict);
  write_program(folder, job);
  write_case(folder, job, verdict, options.formats, progress_function(progress));
  Summary figures = summary(job, verdict);
  add_warnings(write_or_remove_report(
                   folder, options,
                   [&](const ResultFile& page) {
                     const std::vector<ComparedCase> single_case{{verdict, &job, std::nullopt}};
                     return write_report(page, single_case, comparison(job, single_case), options);
                   }),
               figures.warnings);
  Outcome outcome{std::move(figures), {}, {}, {}};
  if (scene.sensor_choice)
    outcome.sensors = choose_sensors(folder, scene, read_variants(scene, options.overrides));
  append_exceeded_limits(outcome.exceeded_limits, scene.limits, verdict);
  return outcome;
}

Outcome compare(const std::filesystem::path& file, const RunOptions& options) {
  const RequestedScenes requested = read_requested_scenes(file, options);
  const Scene& scene = requested.scene;
  const std::vector<Scene>& variants = requested.variants;
  const ResultFolder folder(options.folder, make_writer(scene, options.permissions));
  check_result_names(folder);
  check_cases(folder, scene, variants, make_writer(scene, options.permissions));
  std::optional<ProgressLine> progress_line;
  CaseResults results = cut_all_cases(requested, options, progress_line);
  ProgressLine& progress = *progress_line;
  const std::vector<VariantJob>& variant_jobs = results.variant_jobs;
  std::vector<ComparedCase>& cases = results.cases;
  Comparison& comparison_figures = results.comparison;
  Outcome outcome;
  outcome.failed = failure_texts(results.failed);
  for (const VariantJob& variant_job : variant_jobs)
    write_program(folder.inside(variant_job.prefix), variant_job.job);
  outcome.exceeded_limits = exceeded_limit_texts(cases);
  add_warnings(write_cases(folder, results, options.formats, progress),
               comparison_figures.warnings);
  if (scene.sensor_choice) progress.begin("choose sensors");
  outcome.sensors = choose_sensors(folder, scene, variants);
  write_json(folder / "comparison.json", to_json(comparison_figures));
  add_warnings(write_or_remove_report(folder, options,
                                      [&](const ResultFile& page) {
                                        return write_report(page, cases, comparison_figures,
                                                            options);
                                      }),
               comparison_figures.warnings);
  outcome.figures = std::move(comparison_figures);
  progress.begin("write comparison");
  write_comparison_picture(folder / "comparison.png", scene, cases, progress_function(progress));
  return outcome;
}

ReportOutcome report(const std::filesystem::path& scene, const RunOptions& options,
                     const std::filesystem::path& file) {
  const RequestedScenes requested = read_requested_scenes(scene, options);
  const Writer writer = make_writer(requested.scene, options.permissions);
  check_file(file, writer);
  std::optional<ProgressLine> progress_line;
  const CaseResults results = cut_all_cases(requested, options, progress_line);
  progress_line->begin("write comparison");
  const Comparison& comparison_figures = results.comparison;
  ReportOutcome outcome =
      write_report(result_file(file, writer), results.cases, comparison_figures, options);
  outcome.warnings.insert(outcome.warnings.begin(), comparison_figures.warnings.begin(),
                          comparison_figures.warnings.end());
  outcome.exceeded_limits = exceeded_limit_texts(results.cases);
  outcome.failed = failure_texts(results.failed);
  return outcome;
}

CaseResults cut_scene_cases(const std::filesystem::path& scene, const RunOptions& options) {
  const RequestedScenes requested = read_requested_scenes(scene, options);
  std::optional<ProgressLine> progress_line;
  CaseResults results = cut_all_cases(requested, options, progress_line);
  for (ComparedCase& compared : results.cases) {
    add_warnings(check_stock(compared), results.comparison.warnings);
    compared.verdict.stock.reset();  // tens of MB, no longer needed
  }
  return results;
}

Job job_of(const std::filesystem::path& file, const RunOptions& options) {
  const Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const WorkSize expected = expected_size(scene);
  ProgressLine progress(
      scene_preparation_stages("prepare", expected) + sampling_stages("prepare", expected, scene),
      options.progress);
  progress.begin("prepare");
  const CaseRequest request = add_output_options(run_case_request(std::nullopt), options);
  Job job = sample_job(prepare(scene, progress_function(progress)), request, progress);
  check_cut_memory(scene, {work_size(job)}, request, progress);
  return job;
}

}  // namespace abbe::sim
