#include "sim/cut/work.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "sim/scene/scene_tree.h"

namespace abbe::sim {
namespace {

constexpr double most_points = 5e6;
// measured: a dome of 60 531 points, 707 657 samples and few vertices takes 0.54 GB; a million
// vertices under 5.6 million samples 7.3 GB in all
constexpr double bytes_per_point = 1500.0, bytes_per_sample = 750.0, bytes_per_vertex = 1500.0;
constexpr double points_of_a_moment = 3e5, vertices_of_a_moment = 1e6;

const Node* at_path(const Node& tree, const std::string& dotted) {
  const Node* node = &tree;
  for (std::size_t from = 0; node && from <= dotted.size();) {
    const std::size_t dot = std::min(dotted.find('.', from), dotted.size());
    node = node->find(dotted.substr(from, dot - from));
    from = dot + 1;
  }
  return node;
}

double number_in(const Node& node) {
  if (const auto* whole = std::get_if<std::int64_t>(&node.value)) return double(*whole);
  const auto* real = std::get_if<double>(&node.value);
  return real ? *real : HUGE_VAL;
}

std::string listed(const std::vector<std::string>& keys) {
  std::string text;
  for (const std::string& key : keys) text += (text.empty() ? "" : ", ") + key;
  return text;
}

/// Three figures that a person can read: 12.3 million.
std::string about(double count) {
  if (count < 1e6) return fmt::format("{:.0f}", count);
  return count < 1e12 ? fmt::format("{:.3g} million", count / 1e6) : fmt::format("{:.1e}", count);
}

/// Keys that set what takes most of the memory: the vertices of the part, else the program.
std::vector<std::string> keys_of_most_bytes(const Scene& scene, const Work& work) {
  const double of_vertices = bytes_per_vertex * work.vertices;
  if (!work.by.empty() && of_vertices < 0.5 * work.bytes) return work.by;
  return {std::holds_alternative<MeshFile>(scene.part.shape) ? "part.file" : "part.vertices"};
}

}  // namespace

BadInput refusal_at(const Scene& scene, const std::vector<std::string>& keys,
                    const std::string& expected, const std::string& seen) {
  const Place* place = nullptr;
  double least = 0.0;
  for (const std::string& key : keys) {
    const Node* node = scene.tree ? at_path(*scene.tree, key) : nullptr;
    if (!node) continue;
    const double value = number_in(*node);
    const bool rather = !place || (node->place.typed && !place->typed) ||
                        (node->place.typed == place->typed && value < least);
    if (!rather) continue;
    place = &node->place;
    least = value;
  }
  if (!place && scene.tree && !keys.empty())
    if (const Node* section = at_path(*scene.tree, keys.front().substr(0, keys.front().find('.'))))
      place = &section->place;
  const std::string what = expected + " (" + listed(keys) + ")";
  if (!place || !place->file) return BadInput(scene.file.string(), 0, 0, what, seen);
  return BadInput(*place->file, place->line, place->column, what, seen);
}

std::string why_no_windows(const std::string& needs_whole) {
  if (needs_whole.empty()) return {};
  return fmt::format("; with {} it cannot be run in windows", needs_whole);
}

std::size_t most_samples() {
  return std::size_t(std::min(50e6, 0.8 * memory_bytes() / bytes_per_sample));
}

Work work_of(const Scene& scene, const Part& part) {
  Work work;
  work.vertices = double(part.design_m.vertices.rows());
  const Eigen::Vector2d range = work.range = part.upper - part.lower;
  if (const auto* raster = std::get_if<program::Raster>(&scene.program.source)) {
    work.passes = range.y() / raster->step_over + 1;
    work.points = work.passes * (range.x() / raster->step + 1);
    work.samples = std::max(work.points, work.passes * range.x() / scene.max_step);
    work.by = {"program.step_over_mm", "program.step_mm", "sampling.max_step_mm"};
  } else if (const auto* flank = std::get_if<program::Flank>(&scene.program.source)) {
    work.passes = 1;
    const double around = std::numbers::pi * range.maxCoeff();
    work.points = around / flank->step + 1;
    work.samples = std::max(work.points, around / scene.max_step);
    work.by = {"program.step_mm", "sampling.max_step_mm"};
  } else if (const auto* spiral = std::get_if<program::Spiral>(&scene.program.source)) {
    const double revolutions = 0.5 * range.maxCoeff() / spiral->feed_per_revolution + 1;
    work.passes = 1;
    work.points = revolutions * 2 * std::numbers::pi / spiral->spindle_speed / spiral->interval + 1;
    work.samples = std::max(work.points, revolutions);
    work.by = {"program.feed_um_per_rev", "program.interval_s", "program.speed_rpm"};
  }
  work.bytes = bytes_per_point * work.points + bytes_per_sample * work.samples +
               bytes_per_vertex * work.vertices;
  return work;
}

Work without_samples(Work work) {
  work.bytes -= bytes_per_sample * work.samples;
  work.samples = 0.0;
  return work;
}

void check_work(const Scene& scene, const Work& work) {
  if (work.points > most_points)
    throw refusal_at(
        scene, work.by, fmt::format("a program of at most {} points", about(most_points)),
        fmt::format("about {} in {} passes over {:.3g} x {:.3g} mm of the part", about(work.points),
                    about(work.passes), work.range.x(), work.range.y()));
  if (work.samples > double(most_samples()))
    throw refusal_at(
        scene, work.by,
        fmt::format("a program of at most {} samples, which the memory holds",
                    about(double(most_samples()))),
        fmt::format("{} and more in {} passes over {:.3g} x {:.3g} mm of the part",
                    about(work.samples), about(work.passes), work.range.x(), work.range.y()));
  const double most = memory_bytes();
  if (work.bytes > most)
    throw refusal_at(
        scene, keys_of_most_bytes(scene, work),
        fmt::format("points and vertices that {:.1f} GB of memory hold", most / 1e9),
        fmt::format("{:.1f} GB for about {} points, {} samples and {} vertices", work.bytes / 1e9,
                    about(work.points), about(work.samples), about(work.vertices)));
}

std::string remark(const Work& work) {
  if (work.points < points_of_a_moment && work.vertices < vertices_of_a_moment) return "";
  return fmt::format("about {} points of the program in {} passes, {} vertices, at least {:.1f} GB",
                     about(work.points), about(work.passes), about(work.vertices),
                     work.bytes / 1e9);
}

}  // namespace abbe::sim
