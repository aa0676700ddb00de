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
#include "sim/files/parallel_tasks.h"
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

/// Returns the times at which the spindle or an axis starts after a rest, s; the first is the start
/// of the day.
std::vector<double> cycle_starts(const ThermalDescription& thermal, double history) {
  std::vector<double> starts;
  double time_s = -history;
  bool rests = true;
  for (const ThermalPhase& phase : thermal.history) {
    const bool works = phase.spindle_speed > 0.0 ||
                       (phase.axis_speed.size() > 0 && phase.axis_speed.maxCoeff() > 0.0);
    if (works && rests) starts.push_back(time_s);
    rests = !works;
    time_s += phase.duration;
  }
  return starts;
}

}  // namespace

DayReadings measured_day(const std::string& name, const Scene& scene) {
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(scene.file.string(), 0, 0, expected, seen);
  };
  InstrumentDescription description = find_instrument(scene, scene.sensor_choice->instrument);
  if (description.instrument.kind != errors::metrology::Kind::Drift)
    refuse("an instrument of kind drift for sensor_choice",
           errors::metrology::to_string(description.instrument.kind));
  // Sensors are chosen on the history before the program, which is the day of the machine.
  const double history = history_s(*scene.thermal);
  if (history <= 0.0) refuse("a [[history]] over which sensors are chosen", "none");
  description.starts_s = {-history};
  description.instrument.duration_s = history;
  DayReadings day{
      name, scene.file, cycle_starts(*scene.thermal, history), measured(scene, description), {}};
  day.sensor_noise_K = Eigen::VectorXd::Zero(Eigen::Index(day.readings.sensors.size()));
  for (const errors::TemperatureSensor& sensor : scene.thermal->sensors)
    if (const auto at = std::ranges::find(day.readings.sensors, sensor.name);
        at != day.readings.sensors.end())
      // A reading is rounded to the resolution, which adds the variance of a uniform distribution,
      // resolution^2 / 12.
      day.sensor_noise_K[at - day.readings.sensors.begin()] = std::sqrt(
          sensor.noise_K * sensor.noise_K + sensor.resolution_K * sensor.resolution_K / 12.0);
  return day;
}

std::optional<ThermalChoice> choose_sensors(const ResultFolder& folder, const Scene& scene,
                                            const std::vector<Scene>& variants) {
  if (!scene.sensor_choice || !scene.thermal) return std::nullopt;
  std::vector<DayReadings> days{measured_day("its own day", scene)};
  for (std::size_t i = 0; i < variants.size(); ++i)
    days.push_back(measured_day(scene.variants[i].name, variants[i]));
  ThermalChoice choice = thermal_choice(days, *scene.sensor_choice);
  write_json(folder / "thermal.json", to_json(choice));
  write_thermal_picture(folder / "thermal.png", choice);
  return choice;
}

namespace {

/// Returns the job with its part sampled, after checking that it fits into memory at all and lies
/// where the program cuts.
/// @param whole  as in `check_memory`
Job sampled_job(Job job, const CaseRequest& asked, ProgressLine& progress,
                const std::string& whole = {}) {
  check_memory(job.scene, {size_of(job)}, asked, whole);
  if (std::string text = not_searched_text(job); !text.empty())
    job.warnings.push_back(std::move(text));
  return sampled(placed(std::move(job)), to(progress));
}

/// Reports the memory of the cuts if it is large, and throws if it does not fit.
void check_cut_memory(const Scene& scene, const std::vector<WorkSize>& sizes,
                      const CaseRequest& asked, ProgressLine& progress,
                      const std::string& whole = {}) {
  check_memory(scene, sizes, asked, whole);
  if (const std::string text = memory_remark(sizes, asked); !text.empty()) to(progress)(text, -1.0);
}

/// Returns the data to keep of a cut: a report shows the track of the tool.
Retention retention_of_run(const RunOptions& options) {
  return options.report_language.empty() ? retention_for(options.formats) : Retention::Track;
}

/// Adds the memory for pictures and for the track of the tool.
CaseRequest with_output_options(CaseRequest asked, const RunOptions& options) {
  asked.pictures = can_draw_pictures();
  asked.tracked = retention_of_run(options) == Retention::Track;
  return asked;
}

/// Result of a case that was to be cut.
struct CaseAttempt {
  std::optional<Verdict> verdict;
  std::string failure;  ///< message of a failed plug-in; there is no verdict then
};

/// Cuts one case on the machine with errors, as programmed or with a compensator.
/// @param error_free  the map it is compared with, needed after the cut
CaseAttempt attempt_case(const Batch& batch, const std::optional<CaseDescription>& compensator,
                         Retention keep, const std::shared_future<const Verdict*>& error_free,
                         const Progress& progress) {
  Cut one;
  try {
    one = cut(batch.job, compensator, progress, keep);
    check_cuts_part(batch.job, one);
  } catch (const compensation::PlugInFailure& failure) {
    return {{}, failure.what()};
  } catch (const BadInput& fault) {  // caused by the output of the plug-in; otherwise by the scene
    if (!compensator || compensator->plug_in.empty()) throw;
    return {{}, fault.what()};
  }
  one.name = case_folder(batch.prefix, one.name);
  // Progress is reported while waiting, so that Ctrl-C and failures of other tasks end the wait.
  while (error_free.wait_for(std::chrono::milliseconds(100)) == std::future_status::timeout)
    progress("surface", 1.0);
  return {judge(batch.job, std::move(one), error_free.get()), ""};
}

/// Returns true if cases may run in parallel: the user's own compensators run one at a time.
bool are_independent(const std::vector<CaseDescription>& cases) {
  return std::ranges::all_of(cases, [](const CaseDescription& one) {
    return one.plug_in.empty() && one.function == nullptr;
  });
}

/// Cuts the cases of a batch, compares them with its own error-free map, and computes reductions
/// against its uncompensated case.
void cut_cases(const Batch& batch, CaseResults& made, Retention keep, ProgressLine& progress) {
  const auto named = [&](const std::string& name) { return case_folder(batch.prefix, name); };
  const std::vector<CaseDescription>& compensators = batch.job.scene.cases;
  std::optional<Verdict> error_free;
  std::promise<const Verdict*> judged;
  const std::shared_future<const Verdict*> once_judged = judged.get_future().share();
  std::vector<Task> tasks{{named("error_free"), [&](const Progress& line) {
                             try {
                               // The error-free map of a variant is used for comparison only and
                               // not reported.
                               Cut free = cut_error_free(
                                   batch.job, line, batch.prefix.empty() ? keep : Retention::Map);
                               check_cuts_part(batch.job, free);
                               error_free = judge(batch.job, std::move(free), nullptr);
                               judged.set_value(&*error_free);
                             } catch (...) {
                               judged.set_exception(std::current_exception());
                               throw;
                             }
                           }}};
  std::vector<CaseAttempt> cases(1 + compensators.size());
  const WorkSize size = size_of(batch.job);
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto compensator = i == 0 ? std::nullopt : std::optional(compensators[i - 1]);
    tasks.push_back({named(compensator ? compensator->name : "uncompensated"),
                     [&, i, compensator](const Progress& line) {
                       cases[i] = attempt_case(batch, compensator, keep, once_judged, line);
                     },
                     seconds_of(cut_stages("", size, batch.job.scene, compensator))});
  }
  run_tasks(tasks, are_independent(compensators) ? made.at_once : 1, progress);
  if (batch.prefix.empty())
    made.cases.push_back({std::move(*error_free), &batch.job, std::nullopt});
  const std::size_t uncompensated = made.cases.size();
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto against = i == 0 ? std::nullopt : std::optional(uncompensated);
    if (cases[i].verdict)
      made.cases.push_back({std::move(*cases[i].verdict), &batch.job, against});
    else
      made.failed.push_back({tasks[i + 1].name, cases[i].failure});
  }
}

/// Returns the stages of the cuts of a scene, or of one of its variants.
std::vector<Stage> stages_of_cuts(const std::string& prefix, const WorkSize& size,
                                  const Scene& scene) {
  const auto named = [&](const std::string& name) { return case_folder(prefix, name); };
  std::vector<Stage> all = error_free_stages(named("error_free"), size) +
                           cut_stages(named("uncompensated"), size, scene, std::nullopt);
  for (const CaseDescription& one : scene.cases)
    all = std::move(all) + cut_stages(named(one.name), size, scene, one);
  return all;
}

/// Returns the stages of writing the cases; the error-free map of a variant is not written.
std::vector<Stage> stages_of_case_files(const std::string& prefix, const WorkSize& size,
                                        const Scene& scene) {
  const auto named = [&](const std::string& name) { return "write " + case_folder(prefix, name); };
  std::vector<Stage> all;
  if (prefix.empty()) all = file_stages(named("error_free"), size);
  all = std::move(all) + file_stages(named("uncompensated"), size);
  for (const CaseDescription& one : scene.cases)
    all = std::move(all) + file_stages(named(one.name), size);
  return all;
}

/// Returns the stages of a comparison, before or after preparing its scenes.
/// @param sizes  of the scene and of its variants, in this order
std::vector<Stage> stages_of_all(const Scene& scene, const std::vector<Scene>& variants,
                                 const std::vector<WorkSize>& sizes) {
  std::vector<Stage> cuts = stages_of_cuts("", sizes.front(), scene);
  std::vector<Stage> files = stages_of_case_files("", sizes.front(), scene);
  double maps = 2.0 + double(scene.cases.size());
  for (std::size_t i = 0; i < variants.size(); ++i) {
    const std::string& name = scene.variants[i].name;
    cuts = std::move(cuts) + stages_of_cuts(name, sizes[i + 1], variants[i]);
    files = std::move(files) + stages_of_case_files(name, sizes[i + 1], variants[i]);
    maps += 1.0 + double(variants[i].cases.size());
  }
  std::vector<Stage> sensors;
  if (scene.sensor_choice) sensors = {{"choose sensors", "sensors", 2.0}};
  return std::move(cuts) + std::move(files) + std::move(sensors) +
         comparison_stages("write comparison", sizes.front(), maps);
}

void collect(std::vector<std::string>& all, const Limits& limits, const Verdict& verdict) {
  for (std::string& one : exceeded_limits(limits, verdict)) all.push_back(std::move(one));
}

/// Returns the limits that cases exceed. If there are compensators, only their cases are judged,
/// because the uncompensated machine is expected to fail.
std::vector<std::string> violated_limits(const std::vector<Compared>& cases) {
  const bool compensates = std::any_of(cases.begin(), cases.end(), [](const Compared& one) {
    return one.uncompensated.has_value();
  });
  std::vector<std::string> all;
  for (std::size_t i = 0; i < cases.size(); ++i)
    if (compensates ? cases[i].uncompensated.has_value() : i > 0)
      collect(all, cases[i].job->scene.limits, cases[i].verdict);
  return all;
}

/// Returns the compensator of the case that `run` cuts; empty if there is none.
std::optional<CaseDescription> parse_compensator(const std::string& case_name) {
  if (case_name == "error_free" || case_name == "uncompensated") return std::nullopt;
  return parse_case(case_name);
}

/// Cuts the named case.
Cut cut_named_case(const Job& job, const std::string& case_name, Retention keep,
                   const Progress& progress) {
  if (case_name == "error_free") return cut_error_free(job, progress, keep);
  return cut(job, parse_compensator(case_name), progress, keep);
}

/// Returns the scene with the user's own compensators among its cases; each needs a folder of its
/// own.
Scene with_own(Scene scene, const RunOptions& options) {
  std::vector<CaseDescription> own;
  for (const std::filesystem::path& file : options.plug_ins) own.push_back(plug_in_case(file));
  own.insert(own.end(), options.functions.begin(), options.functions.end());
  for (const CaseDescription& added : own) {
    const bool taken =
        added.name == "error_free" || added.name == "uncompensated" ||
        std::any_of(scene.cases.begin(), scene.cases.end(),
                    [&](const CaseDescription& one) { return one.name == added.name; });
    if (taken)
      throw BadInput(added.plug_in.string(), 0, 0,
                     "a compensator whose file name no other case has",
                     "\"" + added.name + "\" again");
    scene.cases.push_back(added);
    if (!added.function) trust(scene, added);
  }
  return scene;
}

/// Returns the scenes of all variants: the overrides of the command line come first, so that a
/// variant keeps its own values.
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

/// Checks, before an hour's work, that no result would overwrite an input: with --force one may
/// have the name of a result.
void check_names(const ResultFolder& folder) {
  for (const char* name : result_names) check_file(folder / name);
}

/// Checks, before an hour's work, that no two cases share a folder and that no folder of a case
/// belongs to another program.
void check_cases(const ResultFolder& folder, const Scene& scene, const std::vector<Scene>& variants,
                 const Writer& writer) {
  ComparedNames names{scene.cases, {}};
  for (std::size_t i = 0; i < variants.size(); ++i)
    names.variants.push_back({scene.variants[i].name, variants[i].cases});
  InputErrors input_errors;  // those of the scene alone were reported when it was read
  check_case_folders(*scene.tree, names, input_errors);
  if (!input_errors.empty()) throw BadScene(input_errors.list());
  for (const std::string& name : case_folders(names)) {
    check_folder(folder.path() / name, writer);
    for (const char* file : result_names) check_file(folder.path() / name / file, writer);
  }
}

/// A scene with its variants as read.
struct Asked {
  Scene scene;
  std::vector<Scene> variants;
};

/// Reads the scene with its variants and the user's own compensators in each of them.
Asked read_requested_scenes(const std::filesystem::path& file, const RunOptions& options) {
  Asked asked{with_own(read_trusted_scene(file, options.overrides, options.permissions), options),
              {}};
  asked.variants = read_variants(asked.scene, options.overrides);
  for (Scene& variant : asked.variants) variant = with_own(std::move(variant), options);
  return asked;
}

/// Prepares and cuts all cases.
/// @param line  created here; it is also used for writing afterwards
CaseResults cut_all_cases(const Asked& all, const RunOptions& options,
                          std::optional<ProgressLine>& line) {
  const Scene& scene = all.scene;
  const std::vector<Scene>& variants = all.variants;
  const auto preparing = [&](std::size_t i) {
    return i == 0 ? std::string("prepare") : "prepare " + scene.variants[i - 1].name;
  };
  std::vector<WorkSize> sizes{expected_size(scene)};
  for (const Scene& variant : variants) sizes.push_back(expected_size(variant));
  std::vector<Stage> plan;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const Scene& one = i == 0 ? scene : variants[i - 1];
    plan = std::move(plan) + scene_preparation_stages(preparing(i), sizes[i]) +
           sampling_stages(preparing(i), sizes[i], one);
    sizes[i] = size_after_sampling(sizes[i], one);
  }
  line.emplace(std::move(plan) + stages_of_all(scene, variants, sizes), options.progress);
  ProgressLine& progress = *line;
  std::vector<Scene> scenes{scene};
  scenes.insert(scenes.end(), variants.begin(), variants.end());
  CaseRequest asked = with_output_options(compare_case_request(scenes), options);
  CaseResults made;
  std::vector<Batch>& batches = made.batches;
  // Cases refer to the jobs of their batches, so the vector must not reallocate.
  batches.reserve(1 + variants.size());
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    progress.begin(preparing(i));
    batches.push_back({i == 0 ? "" : scene.variants[i - 1].name,
                       sampled_job(prepare(scenes[i], to(progress)), asked, progress)});
    sizes[i] = size_of(batches.back().job);
  }
  // A caller with its own progress function may be able to interrupt only from the calling thread,
  // as Python does with Ctrl-C; then cases run one at a time.
  if (!options.progress) asked.at_once = made.at_once = cases_at_once(sizes, asked);
  check_cut_memory(scene, sizes, asked, progress);
  progress.replan(stages_of_all(scene, variants, sizes));
  for (const Batch& batch : batches) cut_cases(batch, made, retention_of_run(options), progress);
  made.comparison = comparison(batches.front().job, made.cases, made.failed);
  return made;
}

/// Compares the machined body of a case with the design. Returns its warnings.
std::vector<std::string> check_stock(Compared& one) {
  one.verdict.stock = stock_check(*one.job, one.verdict);
  std::vector<std::string> warnings;
  if (!one.verdict.stock) return warnings;
  for (const std::string& warning : warnings_of(*one.verdict.stock))
    warnings.push_back(one.verdict.cut.name + ": " + warning);
  return warnings;
}

/// Writes the files of all cases. Returns the warnings about the machined bodies.
std::vector<std::string> write_cases(const ResultFolder& folder, CaseResults& made,
                                     const std::vector<std::string>& formats,
                                     ProgressLine& progress) {
  std::vector<std::vector<std::string>> warnings(made.cases.size());
  std::vector<Task> tasks;
  for (std::size_t i = 0; i < made.cases.size(); ++i) {
    const auto write = [&, i](const Progress& line) {
      Compared& one = made.cases[i];
      warnings[i] = check_stock(one);
      write_case(folder.inside(one.verdict.cut.name), *one.job, one.verdict, formats, line);
      one.verdict.stock.reset();  // tens of MB, no longer needed
    };
    tasks.push_back({"write " + made.cases[i].verdict.cut.name, write});
  }
  run_tasks(tasks, made.at_once, progress);
  std::vector<std::string> all;
  for (const std::vector<std::string>& of_case : warnings)
    all.insert(all.end(), of_case.begin(), of_case.end());
  return all;
}

std::vector<std::string> failure_texts(const std::vector<FailedCase>& failed) {
  std::vector<std::string> texts;
  for (const FailedCase& one : failed) texts.push_back(one.name + ": " + one.reason);
  return texts;
}

/// Writes the page of cases that were cut.
ReportOutcome write_report(const ResultFile& file, const std::vector<Compared>& cases,
                           const Comparison& compared, const RunOptions& options) {
  const HtmlReport page = html_report(cases, compared, {options.report_language, options.command});
  write_file(file, page.html);
  return {page.html.size(), page.warnings, {}, {}};
}

/// Writes the page in addition to other results, by `write`; if none is requested, that of an
/// earlier run is removed.
/// @return its warnings
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
  // The folder is checked before the work, and created.
  const ResultFolder folder(options.folder, make_writer(scene, options.permissions));
  check_names(folder);
  const std::string shown = name.empty() ? "uncompensated" : name;
  const auto rest = [&](const WorkSize& size) {
    return (shown == "error_free" ? error_free_stages(shown, size)
                                  : cut_stages(shown, size, scene, parse_compensator(shown))) +
           file_stages("write", size);
  };
  const WorkSize expected = expected_size(scene);
  ProgressLine progress(scene_preparation_stages("prepare", expected) +
                            sampling_stages("prepare", expected, scene) +
                            rest(size_after_sampling(expected, scene)),
                        options.progress);
  progress.begin("prepare");
  const CaseRequest asked =
      with_output_options(run_case_request(parse_compensator(shown)), options);
  // A program that is too long for the memory is cut in windows, unless something needs all
  // samples.
  MemoryBudget holding{{}, find_windows_obstacle(scene, parse_compensator(shown))};
  if (asked.tracked) holding.windows_obstacle = "the track of the tool";
  if (holding.windows_obstacle.empty())
    holding.samples = [&](std::size_t blocks, std::size_t vertices) {
      WorkSize size = expected;
      size.blocks = double(blocks);
      size.vertices = double(vertices);
      return max_samples_in_memory(size_after_sampling(size, scene), asked);
    };
  const Job job =
      sampled_job(prepare(scene, to(progress), holding), asked, progress, holding.windows_obstacle);
  check_cut_memory(scene, {size_of(job)}, asked, progress, holding.windows_obstacle);
  progress.replan(rest(size_of(job)));
  progress.begin(shown);
  Cut made = cut_named_case(job, shown, retention_of_run(options), to(progress));
  check_cuts_part(job, made);
  progress.begin("write");
  Verdict verdict = judge(job, std::move(made), nullptr);
  verdict.stock = stock_check(job, verdict);
  write_program(folder, job);
  write_case(folder, job, verdict, options.formats, to(progress));
  Summary figures = summary(job, verdict);
  add_warnings(
      write_or_remove_report(folder, options,
                             [&](const ResultFile& page) {
                               const std::vector<Compared> alone{{verdict, &job, std::nullopt}};
                               return write_report(page, alone, comparison(job, alone), options);
                             }),
      figures.warnings);
  Outcome outcome{std::move(figures), {}, {}, {}};
  if (scene.sensor_choice)
    outcome.sensors = choose_sensors(folder, scene, read_variants(scene, options.overrides));
  collect(outcome.exceeded_limits, scene.limits, verdict);
  return outcome;
}

Outcome compare(const std::filesystem::path& file, const RunOptions& options) {
  const Asked asked = read_requested_scenes(file, options);
  const Scene& scene = asked.scene;
  const std::vector<Scene>& variants = asked.variants;
  const ResultFolder folder(options.folder, make_writer(scene, options.permissions));
  check_names(folder);
  check_cases(folder, scene, variants, make_writer(scene, options.permissions));
  std::optional<ProgressLine> line;
  CaseResults made = cut_all_cases(asked, options, line);
  ProgressLine& progress = *line;
  const std::vector<Batch>& batches = made.batches;
  std::vector<Compared>& cases = made.cases;
  Comparison& compared = made.comparison;
  Outcome outcome;
  outcome.failed = failure_texts(made.failed);
  for (const Batch& batch : batches) write_program(folder.inside(batch.prefix), batch.job);
  outcome.exceeded_limits = violated_limits(cases);
  add_warnings(write_cases(folder, made, options.formats, progress), compared.warnings);
  if (scene.sensor_choice) progress.begin("choose sensors");
  outcome.sensors = choose_sensors(folder, scene, variants);
  write_json(folder / "comparison.json", to_json(compared));
  add_warnings(write_or_remove_report(folder, options,
                                      [&](const ResultFile& page) {
                                        return write_report(page, cases, compared, options);
                                      }),
               compared.warnings);
  outcome.figures = std::move(compared);
  progress.begin("write comparison");
  write_comparison_picture(folder / "comparison.png", scene, cases, to(progress));
  return outcome;
}

ReportOutcome report(const std::filesystem::path& scene, const RunOptions& options,
                     const std::filesystem::path& file) {
  const Asked asked = read_requested_scenes(scene, options);
  const Writer writer = make_writer(asked.scene, options.permissions);
  check_file(file, writer);
  std::optional<ProgressLine> line;
  const CaseResults made = cut_all_cases(asked, options, line);
  line->begin("write comparison");
  const Comparison& compared = made.comparison;
  ReportOutcome reported = write_report(result_file(file, writer), made.cases, compared, options);
  reported.warnings.insert(reported.warnings.begin(), compared.warnings.begin(),
                           compared.warnings.end());
  reported.exceeded_limits = violated_limits(made.cases);
  reported.failed = failure_texts(made.failed);
  return reported;
}

CaseResults cut_scene_cases(const std::filesystem::path& scene, const RunOptions& options) {
  const Asked asked = read_requested_scenes(scene, options);
  std::optional<ProgressLine> line;
  CaseResults made = cut_all_cases(asked, options, line);
  for (Compared& one : made.cases) {
    add_warnings(check_stock(one), made.comparison.warnings);
    one.verdict.stock.reset();  // tens of MB, no longer needed
  }
  return made;
}

Job job_of(const std::filesystem::path& file, const RunOptions& options) {
  const Scene scene = read_trusted_scene(file, options.overrides, options.permissions);
  const WorkSize expected = expected_size(scene);
  ProgressLine progress(
      scene_preparation_stages("prepare", expected) + sampling_stages("prepare", expected, scene),
      options.progress);
  progress.begin("prepare");
  const CaseRequest asked = with_output_options(run_case_request(std::nullopt), options);
  Job job = sampled_job(prepare(scene, to(progress)), asked, progress);
  check_cut_memory(scene, {size_of(job)}, asked, progress);
  return job;
}

}  // namespace abbe::sim
