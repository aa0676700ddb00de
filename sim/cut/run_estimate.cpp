#include "sim/cut/run_estimate.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <variant>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "sim/cut/scene_checks.h"

namespace abbe::sim {

namespace {

using Belief = CaseDescription::Belief;
using Channel = CaseDescription::Channel;
using compensation::Strategy;

// Seconds on two cores, measured on the scenes of the library. Their ratios matter; the speed of
// the computer is learned while it runs.
constexpr double seconds_per_vertex_made = 1e-6, seconds_per_block_read = 5e-6,
                 seconds_per_block_written = 6e-6;
constexpr double seconds_per_collision_sample = 1e-5;
constexpr double seconds_per_sample = 3.4e-6, seconds_per_stock_sample = 4e-5,
                 seconds_per_pose = 2.3e-6;
constexpr double seconds_per_vertex_sampled = 3e-5;
constexpr double seconds_per_vertex_cut = 6e-6, seconds_per_sample_sorted = 1e-6;
constexpr double seconds_per_correction = 3.1e-6, seconds_per_sample_rewritten = 6e-6;
constexpr double seconds_per_vertex_written = 1e-6, seconds_per_vertex_drawn = 6e-6,
                 seconds_per_vertex_compared = 2.9e-6;
constexpr double seconds_per_pixel_filmed = 1e-7, seconds_per_pixel_encoded = 1.5e-8,
                 seconds_per_stock_filmed = 0.1;
constexpr double seconds_per_file = 0.1, seconds_per_picture = 0.8;

/// Returns the approximate number of blocks of a file, from its size.
double blocks_in(const std::filesystem::path& file) {
  constexpr double bytes_of_block = 35.0;
  std::error_code failure;
  const auto bytes = std::filesystem::file_size(file, failure);
  return failure ? 1000.0 : double(bytes) / bytes_of_block;
}

double vertices_in(const std::filesystem::path& mesh) {
  constexpr double bytes_of_vertex = 100.0;  // two triangles of a binary STL
  std::error_code failure;
  const auto bytes = std::filesystem::file_size(mesh, failure);
  return failure ? 20000.0 : double(bytes) / bytes_of_vertex;
}

double correction_seconds(const WorkSize& size, const CaseDescription& compensator) {
  // average number of correction steps of a sample
  const double steps = compensator.strategy == Strategy::Iterated ? 3.0 : 1.6;
  double seconds = steps * seconds_per_correction * size.samples;
  if (compensator.channel == Channel::Program)
    seconds += seconds_per_sample_rewritten * size.samples;
  if (compensator.channel != Channel::Ideal) seconds += seconds_per_sample * size.samples;
  return seconds;
}

double surface_seconds(const WorkSize& size) {
  return seconds_per_vertex_cut * size.vertices + seconds_per_sample_sorted * size.samples;
}

/// Returns the time of the cuts that a compensator learns from before it corrects.
double learning_seconds(const WorkSize& size, const Scene& scene,
                        const CaseDescription& compensator) {
  const double stock = size.stock ? seconds_per_stock_sample * size.samples : 0.0;
  const bool part = compensator.belief == Belief::Part && scene.belief.part.has_value();
  const bool force = (compensator.belief == Belief::Force || compensator.belief == Belief::Fused) &&
                     scene.belief.force.has_value();
  double seconds = 0.0;
  if (part) seconds += scene.belief.part->passes * (surface_seconds(size) + stock);
  if (force) seconds += scene.belief.force->passes * stock;
  return seconds;
}

}  // namespace

WorkSize expected_size(const Scene& scene) {
  WorkSize size;
  const auto* mesh = std::get_if<MeshFile>(&scene.part.shape);
  size.vertices = mesh ? vertices_in(mesh->file) : double(scene.part.vertices);
  const auto* file = std::get_if<ProgramDescription::File>(&scene.program.source);
  size.generated = file == nullptr;
  // Typical figures of the library: 30 000 blocks for a generated program, 8 samples a block.
  size.blocks = file ? blocks_in(file->file) : 3e4;
  size.samples = 8.0 * size.blocks;
  size.stock = scene.cutting.has_value();
  size.collisions = scene.collision.on;
  return size;
}

WorkSize size_of(const Job& job) {
  return {double(job.design_w.vertices.rows()),
          double(job.path.blocks.size()),
          double(job.windows ? job.windows->samples : job.samples.states.size()),
          job.scene.cutting.has_value(),
          !job.program_text.empty(),
          job.scene.collision.on,
          job.windows ? double(job.windows->max_at_once) : 0.0};
}

std::vector<Stage> scene_preparation_stages(const std::string& part, const WorkSize& size) {
  std::vector<Stage> stages{
      {part, "part", seconds_per_vertex_made * size.vertices},
      {part, "program",
       (seconds_per_block_read + (size.generated ? seconds_per_block_written : 0.0)) * size.blocks},
      {part, "sample", seconds_per_sample * size.samples}};
  if (size.stock) stages.push_back({part, "stock", seconds_per_stock_sample * size.samples});
  stages.push_back({part, "heat", 0.01});
  return stages;
}

WorkSize size_after_sampling(WorkSize size, const Scene& scene) {
  const PartSampling& sampling = scene.part.sampling;
  // typical growth of the vertices by adaptive sampling
  constexpr double usual_growth = 20.0;
  if (sampling.kind == PartSampling::Kind::Vertices) return size;
  const auto most = std::max(double(sampling.points), size.vertices);
  size.vertices = std::min(usual_growth * size.vertices, most);
  return size;
}

std::vector<Stage> sampling_stages(const std::string& part, const WorkSize& size,
                                   const Scene& scene) {
  const double seconds = surface_seconds(size) +
                         seconds_per_vertex_sampled * size_after_sampling(size, scene).vertices;
  return {{part, "sampling", seconds}};
}

std::vector<Stage> error_free_stages(const std::string& part, const WorkSize& size) {
  return {{part, "surface", surface_seconds(size)}};
}

std::vector<Stage> command_stages(const std::string& part, const WorkSize& size, const Scene& scene,
                                  const CaseDescription& compensator) {
  return {{part, "learn", learning_seconds(size, scene, compensator)},
          {part, "correct", correction_seconds(size, compensator)}};
}

std::vector<Stage> cut_stages(const std::string& part, const WorkSize& size, const Scene& scene,
                              const std::optional<CaseDescription>& compensator) {
  std::vector<Stage> cut = cut_stages(part, size);
  if (!compensator) return cut;
  return command_stages(part, size, scene, *compensator) + std::move(cut);
}

std::vector<Stage> cut_stages(const std::string& part, const WorkSize& size) {
  std::vector<Stage> stages;
  if (size.collisions) stages = collision_stages(part, size);
  if (size.stock) stages.push_back({part, "stock", seconds_per_stock_sample * size.samples});
  stages.push_back({part, "poses", seconds_per_pose * size.samples});
  stages.push_back({part, "surface", surface_seconds(size)});
  return stages;
}

std::vector<Stage> file_stages(const std::string& part, const WorkSize& size) {
  return {{part, "write", seconds_per_file + seconds_per_vertex_written * size.vertices},
          {part, "draw", seconds_per_picture + seconds_per_vertex_drawn * size.vertices}};
}

std::vector<Stage> rewriting_stages(const std::string& part, const WorkSize& size) {
  return {{part, "words", seconds_per_pose * size.samples}};
}

std::vector<Stage> collision_stages(const std::string& part, const WorkSize& size) {
  std::vector<Stage> stages{{part, "collisions", seconds_per_collision_sample * size.samples}};
  if (size.stock)
    stages.push_back({part, "collisions with the stock", seconds_per_stock_sample * size.samples});
  return stages;
}

std::vector<Stage> comparison_stages(const std::string& part, const WorkSize& size, double maps) {
  return {
      {part, "compare", seconds_per_picture + seconds_per_vertex_compared * size.vertices * maps}};
}

std::vector<Stage> film_stages(const std::string& part, const WorkSize& size, double frames,
                               double pixels) {
  const double stock = size.stock ? seconds_per_stock_filmed : 0.0;
  return {{part, "frames", frames * (seconds_per_pixel_filmed * pixels + stock)},
          {part, "encode", seconds_per_file + frames * seconds_per_pixel_encoded * pixels}};
}

double seconds_of(const std::vector<Stage>& stages) {
  double seconds = 0.0;
  for (const Stage& stage : stages) seconds += stage.seconds;
  return seconds;
}

std::vector<Stage> operator+(std::vector<Stage> first, std::vector<Stage> second) {
  std::move(second.begin(), second.end(), std::back_inserter(first));
  return first;
}

namespace {

// Bytes, measured on scenes of the library from 2000 vertices and 105 000 samples to a million and
// 17 million: the largest resident memory after a program is sampled, its surface sampled, cut,
// drawn.
constexpr double bytes_of_program = 52e6, bytes_of_block = 420, bytes_of_sample = 410;
constexpr double bytes_of_vertex_sampled = 1250;
constexpr double bytes_of_sample_cut = 295, bytes_of_vertex_cut = 420,
                 bytes_of_sample_in_stock = 430;
constexpr double bytes_of_sample_corrected = 355, bytes_of_sample_rewritten = 225;
constexpr double bytes_of_sample_tracked = 180;
constexpr double bytes_of_vertex_kept = 105, bytes_of_vertex_drawn = 1800,
                 bytes_of_vertex_compared = 255;
constexpr double bytes_of_vertex_held = 250, bytes_of_pictures = 320e6, bytes_of_comparison = 230e6;

/// Returns the samples in memory. In windows there are two: the first stays while another is cut.
double samples_held(const WorkSize& job) {
  return job.in_windows > 0.0 ? 2.0 * job.in_windows : job.samples;
}

/// Returns the bytes of a job at rest, without its vertices.
double held(const WorkSize& job) {
  return bytes_of_block * job.blocks + bytes_of_sample * samples_held(job);
}

double kept_tracks(const WorkSize& job, const CaseRequest& asked) {
  return asked.tracked ? bytes_of_sample_tracked * asked.kept * samples_held(job) : 0.0;
}

double bytes_while_cutting(const WorkSize& job, const CaseRequest& asked) {
  double of_samples = bytes_of_sample_cut;
  if (job.stock) of_samples += bytes_of_sample_in_stock;
  if (asked.compensated) of_samples += bytes_of_sample_corrected;
  if (asked.rewritten) of_samples += bytes_of_sample_rewritten;
  const double of_case = of_samples * samples_held(job) + bytes_of_vertex_cut * job.vertices;
  return held(job) + asked.at_once * of_case + kept_tracks(job, asked) +
         bytes_of_vertex_kept * asked.kept * job.vertices;
}

double bytes_while_sampling(const WorkSize& job) {
  return held(job) + bytes_of_vertex_sampled * job.vertices;
}

double bytes_while_drawing(const WorkSize& job, const CaseRequest& asked) {
  double of_vertices = bytes_of_vertex_drawn * asked.at_once + bytes_of_vertex_kept * asked.kept;
  double bytes = held(job) + bytes_of_pictures;
  if (asked.compared) {
    of_vertices += bytes_of_vertex_compared * asked.kept;
    bytes += bytes_of_comparison;
  }
  return bytes + of_vertices * job.vertices + kept_tracks(job, asked);
}

// 1 GB = 1e9 bytes, as for --memory-gb
std::string gigabytes(double bytes) { return fmt::format("{:.3g} GB", bytes / 1e9); }

WorkSize sum_of(const std::vector<WorkSize>& jobs) {
  WorkSize sum;
  for (const WorkSize& job : jobs) {
    sum.vertices += job.vertices;
    sum.samples += samples_held(job);
  }
  return sum;
}

std::string figures(const std::vector<WorkSize>& jobs, const CaseRequest& asked) {
  const WorkSize all = sum_of(jobs);
  return fmt::format("about {} for {:.0f} samples of the program, {:.0f} vertices and {:.0f} {}",
                     gigabytes(peak_memory(jobs, asked)), all.samples, all.vertices, asked.kept,
                     asked.kept == 1.0 ? "case" : "cases");
}

/// Returns the keys that set what takes most of the memory.
std::vector<std::string> dominant_keys(const Scene& scene, const std::vector<WorkSize>& jobs) {
  const WorkSize all = sum_of(jobs);
  if (bytes_of_vertex_drawn * all.vertices > (bytes_of_sample + bytes_of_sample_cut) * all.samples)
    return {"part.points", "part.resolution_um", "part.vertices"};
  if (std::holds_alternative<ProgramDescription::File>(scene.program.source))
    return {"sampling.max_step_mm", "sampling.chord_tolerance_nm"};
  return {"sampling.max_step_mm", "sampling.chord_tolerance_nm", "program.step_over_mm",
          "program.step_mm", "program.feed_um_per_rev"};
}

}  // namespace

CaseRequest run_case_request(const std::optional<CaseDescription>& compensator) {
  return {.kept = 1.0,
          .compensated = compensator.has_value(),
          .rewritten = compensator && compensator->channel == Channel::Program};
}

CaseRequest compare_case_request(const std::vector<Scene>& scenes) {
  CaseRequest asked{.kept = 1.0, .compared = true};
  for (const Scene& scene : scenes) {
    asked.kept += 1.0 + double(scene.cases.size());
    for (const CaseDescription& one : scene.cases) {
      asked.compensated = true;
      asked.rewritten = asked.rewritten || one.channel == Channel::Program;
    }
  }
  return asked;
}

double peak_memory(const std::vector<WorkSize>& jobs, const CaseRequest& asked) {
  const auto held_with_vertices = [](const WorkSize& job) {
    return held(job) + bytes_of_vertex_held * job.vertices;
  };
  double all_held = 0.0, most = 0.0;
  for (const WorkSize& job : jobs) all_held += held_with_vertices(job);
  // Only one job is at its peak at a time; the others are at rest.
  for (const WorkSize& job : jobs) {
    const double others = all_held - held_with_vertices(job);
    most = std::max({most, others + bytes_while_sampling(job),
                     others + bytes_while_cutting(job, asked),
                     asked.pictures ? others + bytes_while_drawing(job, asked) : 0.0});
  }
  return bytes_of_program + most;
}

int cases_at_once(const std::vector<WorkSize>& jobs, CaseRequest asked) {
  constexpr double free_at_least = 0.33;  // fraction of the memory, since peaks are only estimated
  const double most = (1.0 - free_at_least) * memory_bytes();
  const auto threads =
      tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  asked.at_once = int(std::min(double(threads), asked.kept));
  while (asked.at_once > 1 && peak_memory(jobs, asked) > most) --asked.at_once;
  return std::max(asked.at_once, 1);
}

std::size_t max_samples_in_memory(WorkSize job, const CaseRequest& asked) {
  const auto fit = [&](double samples) {
    job.samples = samples;
    return peak_memory({job}, asked) <= memory_bytes();
  };
  // below 1e5 samples a window costs more than it saves; 50e6 is the limit of a program
  double low = 1e5, high = 50e6;
  if (!fit(low)) return 0;
  // the peak grows with the samples, so bisection finds the largest number that fits
  while (high - low > 1.0) (fit(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
  return std::size_t(low);
}

void check_memory(const Scene& scene, const std::vector<WorkSize>& jobs, const CaseRequest& asked,
                  const std::string& whole) {
  const double most = memory_bytes();
  if (peak_memory(jobs, asked) <= most) return;
  throw scene_limit_error(
      scene, dominant_keys(scene, jobs),
      fmt::format("a run that {} of memory hold, or a larger --memory-gb", gigabytes(most)),
      figures(jobs, asked) + windows_obstacle_text(whole));
}

std::string memory_remark(const std::vector<WorkSize>& jobs, const CaseRequest& asked) {
  constexpr double of_interest = 2e9;  // bytes; a smaller peak needs no attention
  if (peak_memory(jobs, asked) < of_interest) return "";
  return "memory: " + figures(jobs, asked);
}

}  // namespace abbe::sim
