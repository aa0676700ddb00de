#include "sim/cut/stages.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <variant>

namespace abbe::sim {
namespace {

using Belief = CaseDescription::Belief;
using Channel = CaseDescription::Channel;
using compensation::Strategy;

// Seconds on two cores, measured on the scenes of the library. Only how they compare matters much:
// the rest is learned.
constexpr double s_of_vertex_made = 1e-6, s_of_block_read = 5e-6, s_of_block_written = 6e-6;
constexpr double s_of_sample_followed_by_bodies = 1e-5;
constexpr double s_of_sample = 3.4e-6, s_of_sample_in_stock = 4e-5, s_of_sample_posed = 2.3e-6;
constexpr double s_of_vertex_sampled = 3e-5;
constexpr double s_of_vertex_cut = 6e-6, s_of_sample_sorted = 1e-6;
constexpr double s_of_correction = 3.1e-6, s_of_sample_rewritten = 6e-6;
constexpr double s_of_vertex_written = 1e-6, s_of_vertex_drawn = 6e-6,
                 s_of_vertex_compared = 2.9e-6;
constexpr double s_of_pixel_filmed = 1e-7, s_of_pixel_encoded = 1.5e-8, s_of_stock_filmed = 0.1;
constexpr double s_of_file = 0.1, s_of_picture = 0.8;

/// Blocks of a file, by its bytes.
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

double seconds_of_correction(const WorkSize& size, const CaseDescription& compensator) {
  const double steps = compensator.strategy == Strategy::Iterated ? 3.0 : 1.6;
  double seconds = steps * s_of_correction * size.samples;
  if (compensator.channel == Channel::Program) seconds += s_of_sample_rewritten * size.samples;
  if (compensator.channel != Channel::Ideal) seconds += s_of_sample * size.samples;
  return seconds;
}

double seconds_of_surface(const WorkSize& size) {
  return s_of_vertex_cut * size.vertices + s_of_sample_sorted * size.samples;
}

/// What a compensator cuts before it knows what it corrects by.
double seconds_of_learning(const WorkSize& size, const Scene& scene,
                           const CaseDescription& compensator) {
  const double stock = size.stock ? s_of_sample_in_stock * size.samples : 0.0;
  const bool part = compensator.belief == Belief::Part && scene.belief.part.has_value();
  const bool force = (compensator.belief == Belief::Force || compensator.belief == Belief::Fused) &&
                     scene.belief.force.has_value();
  double seconds = 0.0;
  if (part) seconds += scene.belief.part->passes * (seconds_of_surface(size) + stock);
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
          job.windows ? double(job.windows->most_at_once) : 0.0};
}

std::vector<Stage> stages_of_preparing(const std::string& part, const WorkSize& size) {
  std::vector<Stage> stages{
      {part, "part", s_of_vertex_made * size.vertices},
      {part, "program",
       (s_of_block_read + (size.generated ? s_of_block_written : 0.0)) * size.blocks},
      {part, "sample", s_of_sample * size.samples}};
  if (size.stock) stages.push_back({part, "stock", s_of_sample_in_stock * size.samples});
  stages.push_back({part, "heat", 0.01});
  return stages;
}

WorkSize once_sampled(WorkSize size, const Scene& scene) {
  const PartSampling& sampling = scene.part.sampling;
  constexpr double usual_growth = 20.0;
  if (sampling.kind == PartSampling::Kind::Vertices) return size;
  const auto most = std::max(double(sampling.points), size.vertices);
  size.vertices = std::min(usual_growth * size.vertices, most);
  return size;
}

std::vector<Stage> stages_of_sampling(const std::string& part, const WorkSize& size,
                                      const Scene& scene) {
  const double seconds =
      seconds_of_surface(size) + s_of_vertex_sampled * once_sampled(size, scene).vertices;
  return {{part, "sampling", seconds}};
}

std::vector<Stage> stages_of_error_free(const std::string& part, const WorkSize& size) {
  return {{part, "surface", seconds_of_surface(size)}};
}

std::vector<Stage> stages_of_commands(const std::string& part, const WorkSize& size,
                                      const Scene& scene, const CaseDescription& compensator) {
  return {{part, "learn", seconds_of_learning(size, scene, compensator)},
          {part, "correct", seconds_of_correction(size, compensator)}};
}

std::vector<Stage> stages_of_cut(const std::string& part, const WorkSize& size, const Scene& scene,
                                 const std::optional<CaseDescription>& compensator) {
  std::vector<Stage> cut = stages_of_cut(part, size);
  if (!compensator) return cut;
  return stages_of_commands(part, size, scene, *compensator) + std::move(cut);
}

std::vector<Stage> stages_of_cut(const std::string& part, const WorkSize& size) {
  std::vector<Stage> stages;
  if (size.collisions) stages = stages_of_collisions(part, size);
  if (size.stock) stages.push_back({part, "stock", s_of_sample_in_stock * size.samples});
  stages.push_back({part, "poses", s_of_sample_posed * size.samples});
  stages.push_back({part, "surface", seconds_of_surface(size)});
  return stages;
}

std::vector<Stage> stages_of_files(const std::string& part, const WorkSize& size) {
  return {{part, "write", s_of_file + s_of_vertex_written * size.vertices},
          {part, "draw", s_of_picture + s_of_vertex_drawn * size.vertices}};
}

std::vector<Stage> stages_of_words(const std::string& part, const WorkSize& size) {
  return {{part, "words", s_of_sample_posed * size.samples}};
}

std::vector<Stage> stages_of_collisions(const std::string& part, const WorkSize& size) {
  std::vector<Stage> stages{{part, "collisions", s_of_sample_followed_by_bodies * size.samples}};
  if (size.stock)
    stages.push_back({part, "collisions with the stock", s_of_sample_in_stock * size.samples});
  return stages;
}

std::vector<Stage> stages_of_comparison(const std::string& part, const WorkSize& size,
                                        double maps) {
  return {{part, "compare", s_of_picture + s_of_vertex_compared * size.vertices * maps}};
}

std::vector<Stage> stages_of_film(const std::string& part, const WorkSize& size, double frames,
                                  double pixels) {
  const double stock = size.stock ? s_of_stock_filmed : 0.0;
  return {{part, "frames", frames * (s_of_pixel_filmed * pixels + stock)},
          {part, "encode", s_of_file + frames * s_of_pixel_encoded * pixels}};
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

}  // namespace abbe::sim
