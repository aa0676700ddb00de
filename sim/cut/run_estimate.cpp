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

// Seconds on two cores, measured on the scenes of the library. Only their ratios matter, since the
// speed of the computer is measured during the run.
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

/// Returns an estimate of the number of blocks of a program from the size of its file.
double estimated_blocks(const std::filesystem::path& file) {
  constexpr double bytes_of_block = 35.0;
  std::error_code error;
  const auto bytes = std::filesystem::file_size(file, error);
  return error ? 1000.0 : double(bytes) / bytes_of_block;
}

double estimated_vertices(const std::filesystem::path& mesh) {
  constexpr double bytes_of_vertex = 100.0;  // two triangles of a binary STL
  std::error_code error;
  const auto bytes = std::filesystem::file_size(mesh, error);
  return error ? 20000.0 : double(bytes) / bytes_of_vertex;
}

double correction_seconds(const WorkSize& size, const CaseDescription& compensator) {
  const double steps = compensator.strategy == Strategy::Iterated ? 3.0 : 1.6;  // mean, measured
  double seconds = steps * seconds_per_correction * size.samples;
  if (compensator.channel == Channel::Program)
    seconds += seconds_per_sample_rewritten * size.samples;
  if (compensator.channel != Channel::Ideal) seconds += seconds_per_sample * size.samples;
  return seconds;
}

double surface_seconds(const WorkSize& size) {
  return seconds_per_vertex_cut * size.vertices + seconds_per_sample_sorted * size.samples;
}

/// Returns the time of the cuts from which a compensator learns before it corrects, s.
double learning_seconds(const WorkSize& size, const Scene& scene,
                        const CaseDescription& compensator) {
  const double stock = size.has_stock ? seconds_per_stock_sample * size.samples : 0.0;
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
  size.vertices = mesh ? estimated_vertices(mesh->file) : double(scene.part.vertices);
  const auto* file = std::get_if<ProgramDescription::File>(&scene.program.source);
  size.is_generated = file == nullptr;
  // Typical figures of the library: 30 000 blocks for a generated program, 8 samples a block.
  size.blocks = file ? estimated_blocks(file->file) : 3e4;
  size.samples = 8.0 * size.blocks;
  size.has_stock = scene.cutting.has_value();
  size.has_collisions = scene.collision.is_enabled;
  return size;
}

WorkSize work_size(const Job& job) {
  return {double(job.design_w.vertices.rows()),
          double(job.path.blocks.size()),
          double(job.windows ? job.windows->samples : job.samples.states.size()),
          job.scene.cutting.has_value(),
          !job.program_text.empty(),
          job.scene.collision.is_enabled,
          job.windows ? double(job.windows->max_window_samples) : 0.0,
          job.windows ? double(job.nominal_process.steps.size()) : 0.0};
}

std::vector<Stage> scene_preparation_stages(const std::string& part, const WorkSize& size) {
  std::vector<Stage> stages{
      {part, "part", seconds_per_vertex_made * size.vertices},
      {part, "program",
       (seconds_per_block_read + (size.is_generated ? seconds_per_block_written : 0.0)) *
           size.blocks},
      {part, "sample", seconds_per_sample * size.samples}};
  if (size.has_stock) stages.push_back({part, "stock", seconds_per_stock_sample * size.samples});
  stages.push_back({part, "heat", 0.01});
  return stages;
}

WorkSize size_after_sampling(WorkSize size, const Scene& scene) {
  const PartSampling& sampling = scene.part.sampling;
  constexpr double typical_growth = 20.0;  // of the number of vertices
  if (sampling.kind == PartSampling::Kind::Vertices) return size;
  const auto max_vertices = std::max(double(sampling.points), size.vertices);
  size.vertices = std::min(typical_growth * size.vertices, max_vertices);
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
  if (size.has_collisions) stages = collision_stages(part, size);
  if (size.has_stock) stages.push_back({part, "stock", seconds_per_stock_sample * size.samples});
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
  if (size.has_stock)
    stages.push_back({part, "collisions with the stock", seconds_per_stock_sample * size.samples});
  return stages;
}

std::vector<Stage> comparison_stages(const std::string& part, const WorkSize& size, double maps) {
  return {
      {part, "compare", seconds_per_picture + seconds_per_vertex_compared * size.vertices * maps}};
}

std::vector<Stage> film_stages(const std::string& part, const WorkSize& size, double frames,
                               double pixels) {
  const double stock = size.has_stock ? seconds_per_stock_filmed : 0.0;
  return {{part, "frames", frames * (seconds_per_pixel_filmed * pixels + stock)},
          {part, "encode", seconds_per_file + frames * seconds_per_pixel_encoded * pixels}};
}

double total_seconds(const std::vector<Stage>& stages) {
  double seconds = 0.0;
  for (const Stage& stage : stages) seconds += stage.seconds;
  return seconds;
}

std::vector<Stage> operator+(std::vector<Stage> first, std::vector<Stage> second) {
  std::move(second.begin(), second.end(), std::back_inserter(first));
  return first;
}

namespace {

// Bytes: the largest resident memory after sampling a program, and after sampling, cutting and
// drawing its surface. Measured on scenes of the library, from 2000 vertices and 105 000 samples to
// a million vertices and 17 million samples.
constexpr double bytes_of_program = 52e6, bytes_of_block = 420, bytes_of_sample = 410;
constexpr double bytes_of_vertex_sampled = 1250;
constexpr double bytes_of_sample_cut = 295, bytes_of_vertex_cut = 420,
                 bytes_of_sample_in_stock = 430;
constexpr double bytes_of_sample_corrected = 355, bytes_of_sample_rewritten = 225;
constexpr double bytes_of_sample_tracked = 180;
constexpr double bytes_of_vertex_kept = 105, bytes_of_vertex_drawn = 1800,
                 bytes_of_vertex_compared = 255;
constexpr double bytes_of_vertex_held = 250, bytes_of_pictures = 320e6, bytes_of_comparison = 230e6;

/// Returns the number of samples in memory. Of a job in windows two are: the first stays while
/// another is cut.
double samples_in_memory(const WorkSize& job) {
  return job.window_samples > 0.0 ? 2.0 * job.window_samples : job.samples;
}

/// Returns the bytes of a job at rest, without its vertices.
double job_bytes(const WorkSize& job) {
  // The steps of a job in windows are held twice: those of the program and those of each tool.
  return bytes_of_block * job.blocks + bytes_of_sample * samples_in_memory(job) +
         2.0 * sizeof(ProcessStep) * job.window_steps;
}

double track_bytes(const WorkSize& job, const CaseRequest& request) {
  return request.keeps_tracks ? bytes_of_sample_tracked * request.kept_maps * samples_in_memory(job)
                              : 0.0;
}

double cutting_bytes(const WorkSize& job, const CaseRequest& request) {
  double sample_bytes = bytes_of_sample_cut;
  if (job.has_stock) sample_bytes += bytes_of_sample_in_stock;
  if (request.has_compensator) sample_bytes += bytes_of_sample_corrected;
  if (request.has_rewritten_commands) sample_bytes += bytes_of_sample_rewritten;
  const double case_bytes = sample_bytes * samples_in_memory(job) +
                            bytes_of_vertex_cut * job.vertices +
                            3.0 * sizeof(ProcessStep) * job.window_steps;
  return job_bytes(job) + request.max_parallel * case_bytes + track_bytes(job, request) +
         bytes_of_vertex_kept * request.kept_maps * job.vertices;
}

double sampling_bytes(const WorkSize& job) {
  return job_bytes(job) + bytes_of_vertex_sampled * job.vertices;
}

double drawing_bytes(const WorkSize& job, const CaseRequest& request) {
  double vertex_bytes =
      bytes_of_vertex_drawn * request.max_parallel + bytes_of_vertex_kept * request.kept_maps;
  double bytes = job_bytes(job) + bytes_of_pictures;
  if (request.has_comparison_picture) {
    vertex_bytes += bytes_of_vertex_compared * request.kept_maps;
    bytes += bytes_of_comparison;
  }
  return bytes + vertex_bytes * job.vertices + track_bytes(job, request);
}

// 1 GB = 1e9 bytes, as for --memory-gb
std::string gigabyte_text(double bytes) { return fmt::format("{:.3g} GB", bytes / 1e9); }

WorkSize total_size(const std::vector<WorkSize>& jobs) {
  WorkSize sum;
  for (const WorkSize& job : jobs) {
    sum.vertices += job.vertices;
    sum.samples += samples_in_memory(job);
    sum.window_samples += job.window_samples;
    sum.window_steps += job.window_steps;
  }
  return sum;
}

std::string memory_text(const std::vector<WorkSize>& jobs, const CaseRequest& request) {
  const WorkSize total = total_size(jobs);
  const std::string steps =
      total.window_steps > 0.0 ? fmt::format(", {:.0f} steps of the cut", total.window_steps) : "";
  return fmt::format(
      "about {} for {:.0f} samples of the program{}{}, {:.0f} vertices and {:.0f} {}",
      gigabyte_text(peak_memory(jobs, request)), total.samples,
      total.window_samples > 0.0 ? " in memory" : "", steps, total.vertices, request.kept_maps,
      request.kept_maps == 1.0 ? "case" : "cases");
}

/// Returns the keys that set the largest fraction of the memory.
std::vector<std::string> dominant_keys(const Scene& scene, const std::vector<WorkSize>& jobs) {
  const WorkSize total = total_size(jobs);
  if (bytes_of_vertex_drawn * total.vertices >
      (bytes_of_sample + bytes_of_sample_cut) * total.samples)
    return {"part.points", "part.resolution_um", "part.vertices"};
  if (sizeof(ProcessStep) * total.window_steps > bytes_of_sample * total.samples)
    return {"cutting.step_mm"};
  if (std::holds_alternative<ProgramDescription::File>(scene.program.source))
    return {"sampling.max_step_mm", "sampling.chord_tolerance_nm"};
  return {"sampling.max_step_mm", "sampling.chord_tolerance_nm", "program.step_over_mm",
          "program.step_mm", "program.feed_um_per_rev"};
}

}  // namespace

CaseRequest run_case_request(const std::optional<CaseDescription>& compensator) {
  return {.kept_maps = 1.0,
          .has_compensator = compensator.has_value(),
          .has_rewritten_commands = compensator && compensator->channel == Channel::Program};
}

CaseRequest compare_case_request(const std::vector<Scene>& scenes) {
  CaseRequest request{.kept_maps = 1.0, .has_comparison_picture = true};
  for (const Scene& scene : scenes) {
    request.kept_maps += 1.0 + double(scene.cases.size());
    for (const CaseDescription& description : scene.cases) {
      request.has_compensator = true;
      request.has_rewritten_commands =
          request.has_rewritten_commands || description.channel == Channel::Program;
    }
  }
  return request;
}

double peak_memory(const std::vector<WorkSize>& jobs, const CaseRequest& request) {
  const auto bytes_at_rest = [](const WorkSize& job) {
    return job_bytes(job) + bytes_of_vertex_held * job.vertices;
  };
  double all_bytes = 0.0, max_bytes = 0.0;
  for (const WorkSize& job : jobs) all_bytes += bytes_at_rest(job);
  // One job at a time is at its peak while the others are at rest.
  for (const WorkSize& job : jobs) {
    const double other_bytes = all_bytes - bytes_at_rest(job);
    max_bytes = std::max(
        {max_bytes, other_bytes + sampling_bytes(job), other_bytes + cutting_bytes(job, request),
         request.draws_pictures ? other_bytes + drawing_bytes(job, request) : 0.0});
  }
  return bytes_of_program + max_bytes;
}

int cases_at_once(const std::vector<WorkSize>& jobs, CaseRequest request) {
  constexpr double min_free_fraction = 0.33;  // of the memory, since peaks are only estimated
  const double max_bytes = (1.0 - min_free_fraction) * memory_bytes();
  const auto threads =
      tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  request.max_parallel = int(std::min(double(threads), request.kept_maps));
  while (request.max_parallel > 1 && peak_memory(jobs, request) > max_bytes) --request.max_parallel;
  return std::max(request.max_parallel, 1);
}

std::size_t max_samples_in_memory(WorkSize job, const CaseRequest& request, std::size_t jobs) {
  const auto fits = [&](double samples) {
    job.samples = samples;
    return peak_memory(std::vector<WorkSize>(jobs, job), request) <= memory_bytes();
  };
  // A window of less than 1e5 samples costs more than it saves. A program has at most 50e6.
  double low = 1e5, high = 50e6;
  if (!fits(low)) return 0;
  // The peak grows with the samples, so bisection finds the largest number that fits.
  while (high - low > 1.0) (fits(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
  return std::size_t(low);
}

void check_memory(const Scene& scene, const std::vector<WorkSize>& jobs, const CaseRequest& request,
                  const std::string& windows_obstacle) {
  const double max_bytes = memory_bytes();
  if (peak_memory(jobs, request) <= max_bytes) return;
  throw scene_limit_error(scene, dominant_keys(scene, jobs),
                          fmt::format("a run that fits into {} of memory, or a larger --memory-gb",
                                      gigabyte_text(max_bytes)),
                          memory_text(jobs, request) + windows_obstacle_text(windows_obstacle));
}

std::string memory_remark(const std::vector<WorkSize>& jobs, const CaseRequest& request) {
  constexpr double max_unreported = 2e9;  // bytes
  if (peak_memory(jobs, request) < max_unreported) return "";
  return "memory: " + memory_text(jobs, request);
}

}  // namespace abbe::sim
