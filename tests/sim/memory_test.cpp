#include <tbb/global_control.h>
#include <nlohmann/json.hpp>
#include "sim/cut/judged_surface.h"
#include "sim/cut/run_estimate.h"
#include "sim/cut/scene_checks.h"
#include "sim/cut/sweep.h"
#include "sim/loop/correction_channels.h"
#include "sim/scene/cases.h"
#include "tests/safety/program_run.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

#ifndef ABBE_RENDER
#define ABBE_RENDER 0
#endif

namespace abbe::sim {
namespace {

using cutting::VertexStatus;

const std::string dome = (fs::path(ABBE_SOURCE_DIR) / "scenes/gantry_dome.toml").string();

/// Returns the largest resident memory of a process of the program, bytes, or 0 without python3.
/// Python starts the process, as Linux counts the memory of the process that starts another among
/// what the other had before `exec`, and this one has held whole jobs. @param words  without the
/// program
double peak_of(const std::vector<std::string>& words) {
  std::string command =
      "python3 -c \"import resource, subprocess, sys; "
      "ran = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL); "
      "print(ran.returncode, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)\" '" +
      std::string(ABBE_PROGRAM) + "'";
  for (const std::string& word : words) command += " '" + word + "'";
  const safety::Ran python = safety::shell(command);
  if (python.code != 0) return 0.0;
  int code = -1;
  double kilobytes = 0.0;
  std::istringstream(python.text) >> code >> kilobytes;
  EXPECT_EQ(code, 0) << command;
  return 1024.0 * kilobytes;
}

struct MeasuredMemory {
  const char* command;
  std::vector<Override> overrides;
};

double estimate_of(const MeasuredMemory& one) {
  const Scene scene = read_scene(dome, one.overrides);
  const bool compares = std::string(one.command) == "compare";
  CaseRequest asked = compares ? compare_case_request({scene}) : run_case_request({});
  asked.draws_pictures = ABBE_RENDER != 0;
  const std::vector<WorkSize> sizes{work_size(sampled(prepare(scene)))};
  const tbb::global_control two(tbb::global_control::max_allowed_parallelism, 2);
  if (compares) asked.max_parallel = cases_at_once(sizes, asked);
  return peak_memory(sizes, asked);
}

TEST(Memory, TheEstimateIsWithin30PercentOfWhatIsResidentAtMost) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "a sanitizer has memory of its own";
#endif
  const MeasuredMemory scenes[] = {
      {"run",
       {{"part.points", "20000"},
        {"sampling.max_step_mm", "0.1"},
        {"program.step_over_mm", "1.2"}}},
      {"run",
       {{"part.points", "100000"},
        {"part.resolution_um", "0.05"},
        {"program.step_mm", "1"},
        {"program.step_over_mm", "1"}}},
      {"compare",
       {{"part.points", "20000"}, {"program.step_mm", "2"}, {"program.step_over_mm", "2"}}}};
  for (const MeasuredMemory& one : scenes) {
    const SceneFolder folder;
    std::vector<std::string> words{one.command, dome,    "--threads",
                                   "2",         "--out", (folder.path() / "out").string()};
    for (const Override& change : one.overrides)
      words.insert(words.end(), {"--set", change.path + "=" + change.value});
    const double estimate = estimate_of(one), peak = peak_of(words);
    if (peak == 0.0) GTEST_SKIP() << "python3 is not installed";
    std::cout << "  " << one.command << ": estimated " << estimate / 1e6 << " MB, resident "
              << peak / 1e6 << " MB\n";
    EXPECT_LT(std::abs(estimate / peak - 1.0), 0.3) << one.command;
  }
}

TEST(Memory, WhatExceedsIsRefusedWithTheFiguresBeforeAnythingIsCut) {
  const SceneFolder folder;
  const std::string small =
      " --set program.step_mm=2 --set program.step_over_mm=2 --set part.points=3000 --out " +
      (folder.path() / "out").string();
  const auto ran = [&](const std::string& words) { return safety::run(words + small); };

  const auto compared = ran("compare " + dome + " --memory-gb 0.25");
  EXPECT_EQ(compared.code, 3);
  for (const char* words :
       {"expected a run that fits into 0.25 GB of memory, or a larger --memory-gb (",
        "seen about 0.7", " samples of the program, ", " vertices and 6 cases",
        "sampling.max_step_mm"})
    EXPECT_HAS(compared.text, words);

  const auto sampled = ran("run " + dome + " --memory-gb 0.05");
  EXPECT_EQ(sampled.code, 3);
  EXPECT_HAS(sampled.text, "samples of the program, limited by memory");
  EXPECT_FALSE(fs::exists(folder.path() / "out" / "summary.json"));

  EXPECT_EQ(ran("run " + dome + " --memory-gb 0.6").code, 0);
  EXPECT_EQ(ran("run " + dome + " --memory-gb lots").code, 2);
  EXPECT_EQ(ran("run " + dome + " --memory-gb -1").code, 2);
}

/// What of a summary does not depend on how it was computed.
std::string figures_in(const fs::path& folder) {
  nlohmann::json all = nlohmann::json::parse(std::ifstream(folder / "summary.json"));
  // in windows no quick check of collisions is made, which is said
  nlohmann::json& warnings = all.at("warnings");
  std::erase_if(warnings.get_ref<nlohmann::json::array_t&>(), [](const nlohmann::json& warning) {
    return warning.get<std::string>().starts_with("this command does not check collisions");
  });
  return fmt::format("{} {} {}", all.at("samples").dump(), all.at("residual_um").dump(),
                     all.at("warnings").dump());
}

TEST(Memory, AProgramThatDoesNotFitIsCutInWindowsWithinIt) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "a sanitizer has memory of its own";
#endif
  const SceneFolder folder;
  const double most = 0.75e9;
  std::vector<std::string> words{"run", dome, "--threads", "2"};
  // A block of 0.5 mm has 12 samples of 0.045 mm, about 1.2 GB in all, or 17 of 0.03 mm, 1.7 GB.
  const bool is_long = std::getenv("ABBE_LONG") != nullptr;
  const std::string step = is_long ? "sampling.max_step_mm=0.03" : "sampling.max_step_mm=0.045";
  const std::string vertices = is_long ? "part.vertices=20000" : "part.vertices=5000";
  for (const std::string& change : {vertices, step, std::string("program.step_over_mm=1.2"),
                                    std::string("case=perfect-iterated-ideal")})
    words.insert(words.end(), {"--set", change});
  const auto with = [&](std::vector<std::string> more, const std::string& out) {
    more.insert(more.begin(), words.begin(), words.end());
    more.insert(more.end(), {"--out", (folder.path() / out).string()});
    return more;
  };
  const double whole = peak_of(with({}, "whole"));
  const double peak = peak_of(with({"--memory-gb", "0.75"}, "windows"));
  if (whole == 0.0) GTEST_SKIP() << "python3 is not installed";
  std::cout << "  whole " << whole / 1e6 << " MB, in windows " << peak / 1e6 << " MB of "
            << most / 1e6 << '\n';
  EXPECT_GT(whole, 1.3 * most);
  EXPECT_LT(peak, most);
  EXPECT_EQ(figures_in(folder.path() / "windows"), figures_in(folder.path() / "whole"));
}

TEST(Memory, WhatCannotBeCutInWindowsIsRefusedWithTheReason) {
  const SceneFolder folder;
  const std::string words =
      " --memory-gb 0.6 --set sampling.max_step_mm=0.03 --set "
      "program.step_over_mm=1.2 --set part.points=3000 --out " +
      (folder.path() / "out").string();
  const auto saved = safety::run("run " + dome + " --save track" + words);
  EXPECT_EQ(saved.code, 3);
  EXPECT_HAS(saved.text, "it cannot be run in windows with the track of the tool");
  const auto channel = safety::run("run " + dome + " --case perfect-iterated-open" + words);
  EXPECT_EQ(channel.code, 3);
  EXPECT_HAS(channel.text,
             "it cannot be run in windows with a channel other than ideal and program");
}

TEST(Memory, GrowsWithAllThatIsAsked) {
  const WorkSize size{.vertices = 1e6, .blocks = 1e5, .samples = 1e6};
  const CaseRequest one;
  const double least = peak_memory({size}, one);
  const auto more = [&](const WorkSize& job, const CaseRequest& asked) {
    return peak_memory({job}, asked) > least;
  };
  EXPECT_TRUE(more({.vertices = 2e6, .blocks = 1e5, .samples = 1e6}, one));
  EXPECT_TRUE(more({.vertices = 1e6, .blocks = 1e6, .samples = 1e6}, one));
  EXPECT_TRUE(more({.vertices = 1e6, .blocks = 1e5, .samples = 4e6}, one));
  EXPECT_TRUE(more(size, {.kept_maps = 3.0}));
  EXPECT_TRUE(more(size, {.kept_maps = 1.0, .has_comparison_picture = true}));
  EXPECT_GT(peak_memory({size, size}, one), least);
  const WorkSize long_program{.vertices = 1e4, .blocks = 1e5, .samples = 1e7};
  WorkSize in_stock = long_program;
  in_stock.has_stock = true;
  const double plain = peak_memory({long_program}, one);
  EXPECT_GT(peak_memory({in_stock}, one), plain);
  EXPECT_GT(peak_memory({long_program}, {.max_parallel = 2}), plain);
  EXPECT_GT(peak_memory({long_program}, {.has_compensator = true}), plain);
  EXPECT_GT(peak_memory({long_program}, {.has_compensator = true, .has_rewritten_commands = true}),
            peak_memory({long_program}, {.has_compensator = true}));
}

TEST(Memory, CasesAreCutAtOnceWhereThatLeavesRoom) {
  const WorkSize small{.vertices = 1e4, .blocks = 1e4, .samples = 1e5};
  for (const int threads : {1, 2, 4}) {
    const tbb::global_control only(tbb::global_control::max_allowed_parallelism,
                                   std::size_t(threads));
    EXPECT_EQ(cases_at_once({small}, {.kept_maps = 3.0}), std::min(threads, 3));
  }
  const tbb::global_control two(tbb::global_control::max_allowed_parallelism, 2);
  EXPECT_EQ(cases_at_once({small}, {.kept_maps = 1.0}), 1);
  WorkSize huge = small;
  huge.samples = memory_bytes() / 300.0;
  EXPECT_EQ(cases_at_once({huge}, {.kept_maps = 3.0}), 1);
  const CaseRequest many{.kept_maps = 100.0, .has_compensator = true};
  for (WorkSize job = small; job.samples < huge.samples; job.samples *= 1.3) {
    CaseRequest asked = many;
    asked.max_parallel = cases_at_once({job}, many);
    if (asked.max_parallel > 1) {
      EXPECT_LE(peak_memory({job}, asked), 0.67 * memory_bytes());
    }
  }
}

TEST(Memory, IsToldOfWhereItIsMuch) {
  const CaseRequest two{.kept_maps = 2.0};
  EXPECT_EQ(memory_remark({{.vertices = 1000, .blocks = 100, .samples = 1000}}, two), "");
  EXPECT_EQ(memory_remark({{.vertices = 1000, .blocks = 0, .samples = 1e7}}, two),
            "memory: about 7.1 GB for 10000000 samples of the program, 1000 vertices and 2 cases");
}

// A job that is run in windows, against the same one held whole.

constexpr std::size_t held_at_once = 12000;  // samples

/// A dome under a leaning ball end mill, five axes, with errors that depend on the way.
BallRaster leaning_dome(const std::string& sampling = "vertices = 3000") {
  return {.part =
              "surface = \"sphere_cap\"\nradius_mm = 60.0\nrim_radius_mm = 12.0\nat_mm = [40, 25, "
              "80]\n" +
              sampling,
          .step_over = 0.4,
          .step = 0.25,
          .more =
              "[errors]\n"
              "EXX = { kind = \"polynomial\", half_range_mm = 400.0, coefficients_um = [3.0, "
              "2.0, 1.0] }\n"
              "EYX = { kind = \"fourier\", period_mm = 20.0, b_um = [2.0] }\n"
              "EZY = { kind = \"backlash\", half_um = 2.0 }\n"
              "EAC = { kind = \"fourier\", period_deg = 360.0, b_urad = [30.0] }\n"};
}

MemoryBudget holding(std::size_t samples) {
  return {[samples](std::size_t, std::size_t) { return samples; }, ""};
}

Job held_whole(const BallRaster& raster, const std::vector<Override>& changes = {}) {
  return sampled(prepare(scene_of(raster, changes)));
}

Job in_windows(const BallRaster& raster, const std::vector<Override>& changes = {}) {
  return sampled(prepare(scene_of(raster, changes), {}, holding(held_at_once)));
}

void same_maps(const cutting::Surface& a, const cutting::Surface& b) {
  ASSERT_EQ(a.status, b.status);
  ASSERT_EQ(a.within.size(), b.within.size());
  for (Index i = 0; i < a.residual.size(); ++i) {
    ASSERT_TRUE(a.residual[i] == b.residual[i] || std::isnan(a.residual[i])) << i;
    ASSERT_TRUE(a.cut_time_s[i] == b.cut_time_s[i] || std::isnan(a.cut_time_s[i])) << i;
    ASSERT_EQ(a.cut_line[std::size_t(i)], b.cut_line[std::size_t(i)]) << i;
  }
  for (Index i = 0; i < a.within.size(); ++i)
    ASSERT_TRUE(a.within[i] == b.within[i] || std::isnan(a.within[i])) << i;
}

void same_cuts(const Cut& a, const Cut& b) {
  same_maps(a.surface, b.surface);
  EXPECT_NEAR(a.tip_error.rms, b.tip_error.rms, 1e-12 * a.tip_error.rms);
  EXPECT_EQ(a.tip_error.max, b.tip_error.max);
  EXPECT_NEAR(a.direction_error.rms, b.direction_error.rms, 1e-12 * a.direction_error.rms);
  EXPECT_EQ(a.direction_error.max, b.direction_error.max);
  // an estimate from up to 1000 intervals, which are others in windows
  EXPECT_NEAR(a.chord_error.rms, b.chord_error.rms,
              0.5 * std::max(a.chord_error.rms, b.chord_error.rms));
  EXPECT_EQ(a.remaining_point_error, b.remaining_point_error);
  EXPECT_EQ(a.remaining_direction_error, b.remaining_direction_error);
  EXPECT_EQ(a.case_name, b.case_name);
}

TEST(Windows, AreOnlyMadeOfAProgramThatIsNotHeld) {
  const Job job = prepare(scene_of(leaning_dome()), {}, holding(10'000'000));
  EXPECT_FALSE(job.windows);
  const Job none = prepare(scene_of(leaning_dome()), {}, holding(0));
  EXPECT_FALSE(none.windows) << "a memory that holds nothing refuses, and is no reason for windows";
}

TEST(Windows, GiveEveryCaseOfAnyChoiceOfPlacesToTheBit) {
  for (const char* sampling :
       {"vertices = 3000", "vertices = 300\nresolution_um = 0.5\npoints = 6000",
        "vertices = 300\nspacing_mm = 1.0\npoints = 20000"}) {
    SCOPED_TRACE(sampling);
    const Job job = held_whole(leaning_dome(sampling)),
              windowed = in_windows(leaning_dome(sampling));
    ASSERT_TRUE(windowed.windows);
    std::cout << windowed.windows->samples << " samples in " << windowed.windows->all.size()
              << " windows\n";
    EXPECT_GT(windowed.windows->all.size(), 3u);
    EXPECT_EQ(windowed.windows->samples, job.samples.states.size());
    ASSERT_EQ(job.design_w.vertices, windowed.design_w.vertices);
    EXPECT_EQ(job.warnings, windowed.warnings);
    same_cuts(cut_error_free(job), cut_error_free(windowed));
    same_cuts(cut(job), cut(windowed));
    EXPECT_EQ(cut(job).warnings, cut(windowed).warnings);
    for (const char* name : {"perfect-position-ideal", "perfect-iterated-ideal",
                             "perfect-iterated-program", "perfect-decoupled-program"}) {
      SCOPED_TRACE(name);
      const CaseDescription compensator = parse_case(name);
      const bool rewrites = compensator.channel == CaseDescription::Channel::Program;
      if (rewrites && job.scene.part.sampling.kind != PartSampling::Kind::Vertices) continue;
      const Cut whole = cut(job, compensator), of_windows = cut(windowed, compensator);
      same_cuts(whole, of_windows);
      EXPECT_EQ(whole.rewritten_program, of_windows.rewritten_program);
      EXPECT_EQ(!whole.rewritten_program.empty(), rewrites);
    }
  }
}

TEST(Windows, FindTheGougesOfTheWhole) {
  BallRaster deep = leaning_dome();
  deep.more =
      "[errors]\nEZX = { kind = \"polynomial\", half_range_mm = 400.0, coefficients_um = "
      "[0.0, -2000.0] }\n";
  const std::vector<Override> narrow{{"search.band_mm", "0.05"}};
  const Job job = held_whole(deep, narrow), windowed = in_windows(deep, narrow);
  const Cut a = cut(job), b = cut(windowed);
  std::cout << std::ranges::count(a.surface.status, VertexStatus::Gouged) << " vertices gouged\n";
  EXPECT_GT(std::ranges::count(a.surface.status, VertexStatus::Gouged), 100);
  EXPECT_EQ(a.surface.status, b.surface.status);
  EXPECT_EQ(a.warnings, b.warnings);
}

void same_contacts(const cutting::PassGradients& a, const cutting::PassGradients& b) {
  for (Index v = 0; v < a.travel.size(); ++v) {
    ASSERT_EQ(std::isnan(a.travel[v]), std::isnan(b.travel[v])) << v;
    if (std::isnan(a.travel[v])) continue;
    ASSERT_EQ(a.travel[v], b.travel[v]) << v;
    if (!a.gradient.row(v).allFinite()) continue;
    ASSERT_EQ(a.gradient.row(v), b.gradient.row(v)) << v;
  }
}

TEST(Windows, HaveTheContactsOfTheWhole) {
  const Job job = held_whole(leaning_dome()), windowed = in_windows(leaning_dome());
  const Sweep one = error_free_sweep(job, surface_options(job, {}));
  const Sweep many = error_free_sweep(windowed, surface_options(windowed, {}));
  const cutting::Surface surface = one.surface(job.design_w);
  same_contacts(one.contacts(job.design_w, surface), many.contacts(job.design_w, surface));
}

void same_process(const Process& a, const Process& b) {
  ASSERT_EQ(a.steps.size(), b.steps.size());
  for (std::size_t i = 0; i < a.steps.size(); ++i) {
    ASSERT_EQ(a.steps[i].time_s, b.steps[i].time_s) << i;
    ASSERT_EQ(a.steps[i].line, b.steps[i].line) << i;
    ASSERT_EQ(a.steps[i].load.tool_wrench_t, b.steps[i].load.tool_wrench_t) << i;
    ASSERT_EQ(a.steps[i].removed, b.steps[i].removed) << i;
    ASSERT_EQ(a.steps[i].power_W, b.steps[i].power_W) << i;
    ASSERT_EQ(a.steps[i].iterations, b.steps[i].iterations) << i;
  }
  EXPECT_EQ(a.part_starts, b.part_starts);
  EXPECT_EQ(a.crash_lines, b.crash_lines);
  ASSERT_EQ(a.stock.has_value(), b.stock.has_value());
  if (!a.stock) return;
  EXPECT_EQ(cutting::volume(*a.stock), cutting::volume(*b.stock));
}

// A bracket that three tools cut from one blank, on a machine that errs, warms up and bends. With
// few samples held, windows end within steps of the stock, intervals of heat and rows of signals.
TEST(Windows, GiveSeveralToolsForcesAndHeatToTheBit) {
  const Scene scene =
      read_scene(fs::path(ABBE_SOURCE_DIR) / "scenes/bracket/bracket.toml",
                 {{"signals.interval_s", "0.7"},
                  {"thermal.interval_s", "1.3"},
                  {"cutting.spacing_mm", std::getenv("ABBE_LONG") ? "0.5" : "1.5"}});
  const Job job = sampled(prepare(scene));
  const Job windowed = sampled(prepare(scene, {}, holding(4000)));
  ASSERT_TRUE(windowed.windows);
  std::cout << windowed.windows->samples << " samples of " << windowed.segments.size()
            << " tools in " << windowed.windows->all.size() << " windows\n";
  EXPECT_EQ(windowed.windows->samples, job.samples.states.size());
  EXPECT_EQ(job.warnings, windowed.warnings);
  same_process(job.nominal_process, windowed.nominal_process);
  ASSERT_TRUE(job.truth.heat && windowed.truth.heat);
  EXPECT_EQ(job.truth.heat->run.T_C, windowed.truth.heat->run.T_C);
  same_cuts(cut_error_free(job), cut_error_free(windowed));
  for (const char* name : {"", "perfect-iterated-ideal", "perfect-iterated-program"}) {
    SCOPED_TRACE(name);
    const auto compensator =
        *name ? std::optional(parse_case(name)) : std::optional<CaseDescription>();
    const Cut a = cut(job, compensator), b = cut(windowed, compensator);
    same_cuts(a, b);
    same_process(a.process, b.process);
    EXPECT_EQ(a.signals.columns, b.signals.columns);
    ASSERT_EQ(a.signals.rows.rows(), b.signals.rows.rows());
    EXPECT_GT(a.signals.rows.rows(), 100);
    EXPECT_EQ(a.signals.rows, b.signals.rows);
    EXPECT_EQ(a.warnings, b.warnings);
    EXPECT_EQ(a.rewritten_program, b.rewritten_program);
  }
  const Sweep one = error_free_sweep(job, surface_options(job, {})),
              many = error_free_sweep(windowed, surface_options(windowed, {}));
  const cutting::Surface surface = one.surface(job.design_w);
  same_contacts(one.contacts(job.design_w, surface), many.contacts(job.design_w, surface));
}

// A program of random short blocks, a third of which dwell.
std::string dwelling_program(std::mt19937_64& random) {
  std::uniform_real_distribution<double> place(-20.0, 20.0), turn(-30.0, 30.0);
  std::string text = "G21 G90 G17 G94 S3000 M3 F2000\n";
  double x = 0.0, y = 0.0;
  for (int i = 0; i < 300; ++i) {
    if (random() % 3 == 0) {
      text += "G4 P0.7\n";
      continue;
    }
    const double from_x = x, from_y = y;
    x = place(random), y = place(random);
    switch (random() % 4) {
      case 0:
        text += fmt::format("G0 X{:.4f} Y{:.4f} Z{:.4f}\n", x, y, 150.0 + place(random));
        break;
      case 1:
        text += fmt::format("G2 X{:.4f} Y{:.4f} I{:.5f} J{:.5f}\n", x, y, 0.5 * (x - from_x),
                            0.5 * (y - from_y));
        break;
      default:
        text += fmt::format("G1 X{:.4f} Y{:.4f} Z{:.4f} A{:.4f} C{:.4f}\n", x, y,
                            150.0 + place(random), turn(random), turn(random));
    }
  }
  return text + "M30\n";
}

TEST(Windows, CorrectAProgramAsTheWhole) {
  constexpr std::uint64_t seed = 29;
  std::mt19937_64 random(seed);
  std::cout << "seed " << seed << "\n";
  const SceneFolder folder;
  folder.write("dwelling.ngc", dwelling_program(random));
  BallRaster raster = leaning_dome("vertices = 300");
  std::string toml = to_toml(raster);
  toml.replace(toml.find("[program]"), toml.find("[errors]") - toml.find("[program]"),
               "[program]\nfile = \"dwelling.ngc\"\n[sampling]\nmax_step_mm = 4.0\n"
               "chord_tolerance_nm = 20000\n");
  const Scene scene = read_scene(folder.write("dwelling.toml", toml));
  const Job job = prepare(scene);
  const Job windowed = in_random_windows(job, random);
  int after_dwell = 0;
  for (const Window& window : windowed.windows->all)
    if (window.blocks.continued_from)
      after_dwell +=
          job.path.blocks[window.blocks.first - 1].interpolation == program::Interpolation::Dwell;
  std::cout << windowed.windows->all.size() << " windows, " << after_dwell << " after a dwell\n";
  EXPECT_GT(after_dwell, 10);
  // A correction that drifts with time, so that it changes during a dwell.
  const Corrector drifting = [](const auto& commanded, const auto&) {
    CorrectedCommands result{commanded};
    for (kinematics::AxisState& state : result.states)
      for (Index k = 0; k < state.q.size(); ++k)
        state.q[k] += 1e-4 * std::sin(0.3 * state.time_s + double(k) + 0.1 * state.q[k]);
    return result;
  };
  const auto corrected = [&](const RangeVisitor& ranges) {
    return correct_program(ranges, drifting, {0.01, -0.02, 0.03}, {0.011, -0.02, 0.03});
  };
  const CorrectedProgram whole =
      corrected([&](const auto& use) { use(make_control_view(job, job)); });
  const CorrectedProgram in_ranges = corrected([&](const auto& use) {
    visit_segments(windowed,
                   [&](const Segment& window) { use(make_control_view(windowed, window)); });
  });
  ASSERT_EQ(whole.points.size(), job.path.blocks.size());
  ASSERT_EQ(whole.points.size(), in_ranges.points.size());
  std::size_t points = 0;
  for (std::size_t i = 0; i < whole.points.size(); ++i) {
    ASSERT_EQ(whole.points[i].size(), in_ranges.points[i].size()) << "block " << i;
    points += whole.points[i].size();
    for (std::size_t k = 0; k < whole.points[i].size(); ++k) {
      EXPECT_EQ(whole.points[i][k].u, in_ranges.points[i][k].u) << "block " << i;
      EXPECT_EQ(whole.points[i][k].at, in_ranges.points[i][k].at) << "block " << i;
      EXPECT_EQ(whole.points[i][k].centre, in_ranges.points[i][k].centre) << "block " << i;
    }
  }
  std::cout << points << " points in " << whole.points.size() << " blocks\n";
}

TEST(Windows, AreNotTakenForTheWhole) {
  const Job windowed = in_windows(leaning_dome());
  EXPECT_THROW(job_segments(windowed), std::logic_error);
  EXPECT_THROW(uncompensated_commands(windowed), std::logic_error);
}

}  // namespace
}  // namespace abbe::sim
