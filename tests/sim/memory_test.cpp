#include "sim/cut/run_estimate.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>

#include <gtest/gtest.h>

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <nlohmann/json.hpp>

#include "sim/cut/judged_surface.h"
#include "sim/cut/scene_checks.h"
#include "tests/safety/program_run.h"
#include "tests/sim/scene_folder.h"

#ifndef ABBE_RENDER
#define ABBE_RENDER 0
#endif

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;

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
  asked.pictures = ABBE_RENDER != 0;
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
    EXPECT_NE(compared.text.find(words), std::string::npos) << words << " in " << compared.text;

  const auto sampled = ran("run " + dome + " --memory-gb 0.05");
  EXPECT_EQ(sampled.code, 3);
  EXPECT_NE(sampled.text.find("samples of the program, limited by memory"), std::string::npos)
      << sampled.text;
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
  EXPECT_NE(saved.text.find("it cannot be run in windows with the track of the tool"),
            std::string::npos)
      << saved.text;
  const auto channel = safety::run("run " + dome + " --case perfect-iterated-program" + words);
  EXPECT_EQ(channel.code, 3);
  EXPECT_NE(channel.text.find("it cannot be run in windows with a channel other than ideal"),
            std::string::npos)
      << channel.text;
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
  EXPECT_TRUE(more(size, {.kept = 3.0}));
  EXPECT_TRUE(more(size, {.kept = 1.0, .compared = true}));
  EXPECT_GT(peak_memory({size, size}, one), least);
  const WorkSize long_program{.vertices = 1e4, .blocks = 1e5, .samples = 1e7};
  WorkSize in_stock = long_program;
  in_stock.stock = true;
  const double plain = peak_memory({long_program}, one);
  EXPECT_GT(peak_memory({in_stock}, one), plain);
  EXPECT_GT(peak_memory({long_program}, {.max_parallel = 2}), plain);
  EXPECT_GT(peak_memory({long_program}, {.compensated = true}), plain);
  EXPECT_GT(peak_memory({long_program}, {.compensated = true, .rewritten = true}),
            peak_memory({long_program}, {.compensated = true}));
}

TEST(Memory, CasesAreCutAtOnceWhereThatLeavesRoom) {
  const WorkSize small{.vertices = 1e4, .blocks = 1e4, .samples = 1e5};
  for (const int threads : {1, 2, 4}) {
    const tbb::global_control only(tbb::global_control::max_allowed_parallelism,
                                   std::size_t(threads));
    EXPECT_EQ(cases_at_once({small}, {.kept = 3.0}), std::min(threads, 3));
  }
  const tbb::global_control two(tbb::global_control::max_allowed_parallelism, 2);
  EXPECT_EQ(cases_at_once({small}, {.kept = 1.0}), 1);
  WorkSize huge = small;
  huge.samples = memory_bytes() / 300.0;
  EXPECT_EQ(cases_at_once({huge}, {.kept = 3.0}), 1);
  const CaseRequest many{.kept = 100.0, .compensated = true};
  for (WorkSize job = small; job.samples < huge.samples; job.samples *= 1.3) {
    CaseRequest asked = many;
    asked.max_parallel = cases_at_once({job}, many);
    if (asked.max_parallel > 1) {
      EXPECT_LE(peak_memory({job}, asked), 0.67 * memory_bytes());
    }
  }
}

TEST(Memory, IsToldOfWhereItIsMuch) {
  const CaseRequest two{.kept = 2.0};
  EXPECT_EQ(memory_remark({{.vertices = 1000, .blocks = 100, .samples = 1000}}, two), "");
  EXPECT_EQ(memory_remark({{.vertices = 1000, .blocks = 0, .samples = 1e7}}, two),
            "memory: about 7.1 GB for 10000000 samples of the program, 1000 vertices and 2 cases");
}

}  // namespace
}  // namespace abbe::sim
