#include "sim/cut/memory.h"

#include <algorithm>
#include <cstddef>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "sim/cut/work.h"

namespace abbe::sim {
namespace {

using Channel = CaseDescription::Channel;

// Bytes, measured on scenes of the library, from 2000 vertices and 105 000 samples to a million and
// 17 million: what is resident at most once a program is sampled, its surface sampled, cut, drawn.
constexpr double bytes_of_program = 52e6, bytes_of_block = 420, bytes_of_sample = 410;
constexpr double bytes_of_vertex_sampled = 1250;
constexpr double bytes_of_sample_cut = 295, bytes_of_vertex_cut = 420,
                 bytes_of_sample_in_stock = 430;
constexpr double bytes_of_sample_corrected = 355, bytes_of_sample_rewritten = 225;
constexpr double bytes_of_sample_tracked = 180;
constexpr double bytes_of_vertex_kept = 105, bytes_of_vertex_drawn = 1800,
                 bytes_of_vertex_compared = 255;
constexpr double bytes_of_vertex_held = 250, bytes_of_pictures = 320e6, bytes_of_comparison = 230e6;

/// Samples.
double samples_held(const WorkSize& job) {
  return job.in_windows > 0.0 ? 2.0 * job.in_windows : job.samples;
}

/// A job while nothing is done with it, its vertices left out.
double held(const WorkSize& job) {
  return bytes_of_block * job.blocks + bytes_of_sample * samples_held(job);
}

double kept_tracks(const WorkSize& job, const CasesAsked& asked) {
  return asked.tracked ? bytes_of_sample_tracked * asked.kept * samples_held(job) : 0.0;
}

double while_cut(const WorkSize& job, const CasesAsked& asked) {
  double of_samples = bytes_of_sample_cut;
  if (job.stock) of_samples += bytes_of_sample_in_stock;
  if (asked.compensated) of_samples += bytes_of_sample_corrected;
  if (asked.rewritten) of_samples += bytes_of_sample_rewritten;
  const double of_case = of_samples * samples_held(job) + bytes_of_vertex_cut * job.vertices;
  return held(job) + asked.at_once * of_case + kept_tracks(job, asked) +
         bytes_of_vertex_kept * asked.kept * job.vertices;
}

double while_sampled(const WorkSize& job) {
  return held(job) + bytes_of_vertex_sampled * job.vertices;
}

double while_drawn(const WorkSize& job, const CasesAsked& asked) {
  double of_vertices = bytes_of_vertex_drawn * asked.at_once + bytes_of_vertex_kept * asked.kept;
  double bytes = held(job) + bytes_of_pictures;
  if (asked.compared) {
    of_vertices += bytes_of_vertex_compared * asked.kept;
    bytes += bytes_of_comparison;
  }
  return bytes + of_vertices * job.vertices + kept_tracks(job, asked);
}

std::string gigabytes(double bytes) { return fmt::format("{:.3g} GB", bytes / 1e9); }

WorkSize sum_of(const std::vector<WorkSize>& jobs) {
  WorkSize sum;
  for (const WorkSize& job : jobs) {
    sum.vertices += job.vertices;
    sum.samples += samples_held(job);
  }
  return sum;
}

std::string figures(const std::vector<WorkSize>& jobs, const CasesAsked& asked) {
  const WorkSize all = sum_of(jobs);
  return fmt::format("about {} for {:.0f} samples of the program, {:.0f} vertices and {:.0f} {}",
                     gigabytes(peak_memory(jobs, asked)), all.samples, all.vertices, asked.kept,
                     asked.kept == 1.0 ? "case" : "cases");
}

/// Keys that set what takes most of it.
std::vector<std::string> keys_of_most(const Scene& scene, const std::vector<WorkSize>& jobs) {
  const WorkSize all = sum_of(jobs);
  if (bytes_of_vertex_drawn * all.vertices > (bytes_of_sample + bytes_of_sample_cut) * all.samples)
    return {"part.points", "part.resolution_um", "part.vertices"};
  if (std::holds_alternative<ProgramDescription::File>(scene.program.source))
    return {"sampling.max_step_mm", "sampling.chord_tolerance_nm"};
  return {"sampling.max_step_mm", "sampling.chord_tolerance_nm", "program.step_over_mm",
          "program.step_mm", "program.feed_um_per_rev"};
}

}  // namespace

CasesAsked cases_of_run(const std::optional<CaseDescription>& compensator) {
  return {.kept = 1.0,
          .compensated = compensator.has_value(),
          .rewritten = compensator && compensator->channel == Channel::Program};
}

CasesAsked cases_of_compare(const std::vector<Scene>& scenes) {
  CasesAsked asked{.kept = 1.0, .compared = true};
  for (const Scene& scene : scenes) {
    asked.kept += 1.0 + double(scene.cases.size());
    for (const CaseDescription& one : scene.cases) {
      asked.compensated = true;
      asked.rewritten = asked.rewritten || one.channel == Channel::Program;
    }
  }
  return asked;
}

double peak_memory(const std::vector<WorkSize>& jobs, const CasesAsked& asked) {
  const auto held_with_vertices = [](const WorkSize& job) {
    return held(job) + bytes_of_vertex_held * job.vertices;
  };
  double all_held = 0.0, most = 0.0;
  for (const WorkSize& job : jobs) all_held += held_with_vertices(job);
  for (const WorkSize& job : jobs) {
    const double others = all_held - held_with_vertices(job);
    most = std::max({most, others + while_sampled(job), others + while_cut(job, asked),
                     asked.pictures ? others + while_drawn(job, asked) : 0.0});
  }
  return bytes_of_program + most;
}

int cases_at_once(const std::vector<WorkSize>& jobs, CasesAsked asked) {
  constexpr double free_at_least = 0.33;  // of the memory, for which peaks are only estimated
  const double most = (1.0 - free_at_least) * memory_bytes();
  const auto threads =
      tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  asked.at_once = int(std::min(double(threads), asked.kept));
  while (asked.at_once > 1 && peak_memory(jobs, asked) > most) --asked.at_once;
  return std::max(asked.at_once, 1);
}

std::size_t samples_that_fit(WorkSize job, const CasesAsked& asked) {
  const auto fit = [&](double samples) {
    job.samples = samples;
    return peak_memory({job}, asked) <= memory_bytes();
  };
  double low = 1e5, high = 50e6;
  if (!fit(low)) return 0;
  while (high - low > 1.0) (fit(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
  return std::size_t(low);
}

void check_memory(const Scene& scene, const std::vector<WorkSize>& jobs, const CasesAsked& asked,
                  const std::string& whole) {
  const double most = memory_bytes();
  if (peak_memory(jobs, asked) <= most) return;
  throw refusal_at(
      scene, keys_of_most(scene, jobs),
      fmt::format("a run that {} of memory hold, or a larger --memory-gb", gigabytes(most)),
      figures(jobs, asked) + why_no_windows(whole));
}

std::string memory_remark(const std::vector<WorkSize>& jobs, const CasesAsked& asked) {
  constexpr double of_interest = 2e9;
  if (peak_memory(jobs, asked) < of_interest) return "";
  return "memory: " + figures(jobs, asked);
}

}  // namespace abbe::sim
