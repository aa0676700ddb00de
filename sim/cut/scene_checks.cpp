#include "sim/cut/scene_checks.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/tool_use.h"
#include "sim/scene/document.h"
#include "sim/scene/scene.h"
#include "sim/scene/tool_forms.h"

namespace abbe::sim {

namespace {

constexpr double max_points = 5e6;
// Measured: a dome of 60 531 points, 707 657 samples and few vertices takes 0.54 GB; a million
// vertices with 5.6 million samples take 7.3 GB in all.
constexpr double bytes_per_point = 1500.0, bytes_per_sample = 750.0, bytes_per_vertex = 1500.0;
// Work below both limits takes only a moment and is not reported.
constexpr double max_unreported_points = 3e5, max_unreported_vertices = 1e6;

/// Returns the node at a path such as "program.step_mm"; null if there is none.
const Node* find_node(const Node& tree, const std::string& dotted_path) {
  const Node* node = &tree;
  for (std::size_t begin = 0; node && begin <= dotted_path.size();) {
    const std::size_t dot = std::min(dotted_path.find('.', begin), dotted_path.size());
    node = node->find(dotted_path.substr(begin, dot - begin));
    begin = dot + 1;
  }
  return node;
}

double node_number(const Node& node) {
  if (const auto* integer = std::get_if<std::int64_t>(&node.value)) return double(*integer);
  const auto* real = std::get_if<double>(&node.value);
  return real ? *real : HUGE_VAL;
}

/// Returns a count with three digits, such as "12.3 million".
std::string rounded_count(double count) {
  if (count < 1e6) return fmt::format("{:.0f}", count);
  return count < 1e12 ? fmt::format("{:.3g} million", count / 1e6) : fmt::format("{:.1e}", count);
}

/// Returns the keys that determine most of the memory: those of the vertices of the part, or those
/// of the program.
std::vector<std::string> dominant_byte_keys(const Scene& scene, const WorkEstimate& work) {
  const double vertex_bytes = bytes_per_vertex * work.vertices;
  if (!work.limiting_keys.empty() && vertex_bytes < 0.5 * work.bytes) return work.limiting_keys;
  return {std::holds_alternative<MeshFile>(scene.part.shape) ? "part.file" : "part.vertices"};
}

}  // namespace

BadInput scene_limit_error(const Scene& scene, const std::vector<std::string>& keys,
                           const std::string& expected, const std::string& seen) {
  const SourcePosition* position = nullptr;
  double smallest_value = 0.0;
  for (const std::string& key : keys) {
    const Node* node = scene.tree ? find_node(*scene.tree, key) : nullptr;
    if (!node) continue;
    const double value = node_number(*node);
    // A key given on the command line is preferred, because the user has just changed it.
    const bool is_preferred =
        !position || (node->position.from_command_line && !position->from_command_line) ||
        (node->position.from_command_line == position->from_command_line && value < smallest_value);
    if (!is_preferred) continue;
    position = &node->position;
    smallest_value = value;
  }
  // If the file has none of the keys, the error is located at their section.
  if (!position && scene.tree && !keys.empty())
    if (const Node* section =
            find_node(*scene.tree, keys.front().substr(0, keys.front().find('.'))))
      position = &section->position;
  const std::string full_expectation = fmt::format("{} ({})", expected, fmt::join(keys, ", "));
  if (!position || !position->file)
    return BadInput(scene.file.string(), 0, 0, full_expectation, seen);
  return BadInput(*position->file, position->line, position->column, full_expectation, seen);
}

std::string windows_obstacle_text(const std::string& windows_obstacle) {
  if (windows_obstacle.empty()) return {};
  return fmt::format("; it cannot be run in windows with {}", windows_obstacle);
}

std::size_t max_program_samples() {
  // A fifth of the memory is left for other data.
  return std::size_t(std::min(50e6, 0.8 * memory_bytes() / bytes_per_sample));
}

WorkEstimate estimate_work(const Scene& scene, const Part& part) {
  WorkEstimate work;
  work.vertices = double(part.design_m.vertices.rows());
  const Eigen::Vector2d range = work.range = part.upper - part.lower;
  if (const auto* raster = std::get_if<program::Raster>(&scene.program.source)) {
    work.passes = range.y() / raster->step_over + 1;
    work.points = work.passes * (range.x() / raster->step + 1);
    // The sampling divides steps of the generator that are longer than `max_step`.
    work.samples = std::max(work.points, work.passes * range.x() / scene.max_step);
    work.limiting_keys = {"program.step_over_mm", "program.step_mm", "sampling.max_step_mm"};
  } else if (const auto* flank = std::get_if<program::Flank>(&scene.program.source)) {
    work.passes = 1;
    // The circumference of the largest circle of the part is an upper bound of the path.
    const double circumference = std::numbers::pi * range.maxCoeff();
    work.points = circumference / flank->step + 1;
    work.samples = std::max(work.points, circumference / scene.max_step);
    work.limiting_keys = {"program.step_mm", "sampling.max_step_mm"};
  } else if (const auto* spiral = std::get_if<program::Spiral>(&scene.program.source)) {
    const double revolutions = 0.5 * range.maxCoeff() / spiral->feed_per_revolution + 1;
    work.passes = 1;
    work.points = revolutions * 2 * std::numbers::pi / spiral->spindle_speed / spiral->interval + 1;
    work.samples = std::max(work.points, revolutions);
    work.limiting_keys = {"program.feed_um_per_rev", "program.interval_s", "program.speed_rpm"};
  }
  work.bytes = bytes_per_point * work.points + bytes_per_sample * work.samples +
               bytes_per_vertex * work.vertices;
  return work;
}

WorkEstimate windowed_work(WorkEstimate work) {
  work.bytes -= bytes_per_sample * work.samples;
  work.samples = 0.0;
  return work;
}

void check_work(const Scene& scene, const WorkEstimate& work) {
  if (work.points > max_points)
    throw scene_limit_error(
        scene, work.limiting_keys,
        fmt::format("a program of at most {} points", rounded_count(max_points)),
        fmt::format("about {} in {} passes over {:.3g} x {:.3g} mm of the part",
                    rounded_count(work.points), rounded_count(work.passes), work.range.x(),
                    work.range.y()));
  if (work.samples > double(max_program_samples()))
    throw scene_limit_error(
        scene, work.limiting_keys,
        fmt::format("a program of at most {} samples, limited by memory",
                    rounded_count(double(max_program_samples()))),
        fmt::format("at least {} in {} passes over {:.3g} x {:.3g} mm of the part",
                    rounded_count(work.samples), rounded_count(work.passes), work.range.x(),
                    work.range.y()));
  const double max_bytes = memory_bytes();
  if (work.bytes > max_bytes)
    throw scene_limit_error(
        scene, dominant_byte_keys(scene, work),
        fmt::format("points and vertices that fit into {:.1f} GB of memory", max_bytes / 1e9),
        fmt::format("{:.1f} GB for about {} points, {} samples and {} vertices", work.bytes / 1e9,
                    rounded_count(work.points), rounded_count(work.samples),
                    rounded_count(work.vertices)));
}

std::string work_remark(const WorkEstimate& work) {
  if (work.points < max_unreported_points && work.vertices < max_unreported_vertices) return "";
  return fmt::format("about {} points of the program in {} passes, {} vertices, at least {:.1f} GB",
                     rounded_count(work.points), rounded_count(work.passes),
                     rounded_count(work.vertices), work.bytes / 1e9);
}

namespace {

using kinematics::Motion;
using program::Block;
using program::Interpolation;

// The slowest finishing feed of a milling cutter is about 20 mm/min. An F in m/min that is read as
// mm/min is a thousandth of the intended feed.
constexpr double min_feed_mm_per_min = 5.0;
// At a smaller feed a tooth rubs instead of cutting. Diamond tools have feeds of 1 um per
// revolution or more.
constexpr double min_feed_per_revolution = 0.5 * units::um;
// A feed per revolution is reported above this fraction of the cutter's width, but only above 1 mm,
// which face mills with many teeth reach.
constexpr double max_width_fraction = 0.5, max_unreported_feed_per_revolution = 1.0;

/// Number of blocks of a kind, with the line and value of the first one.
struct BlockCount {
  int blocks = 0;
  int first_line = 0;
  double value = 0.0;  ///< of the first block

  void add(const Block& block, double block_value = 0.0) {
    if (blocks++ > 0) return;
    first_line = block.line;
    value = block_value;
  }
};

/// Numbers of blocks in feed whose feed or spindle speed is unusual.
struct FeedCounts {
  int feed_blocks = 0;             ///< number of blocks that move at feed
  double max_spindle_speed = 0.0;  ///< rad/s, of the spindle
  BlockCount standing, reversed, slow, rubbing, coarse;
};

/// Returns the length of a block along the path of the tip or of the slides, mm; 0 if a rotary axis
/// moves.
double block_length(const program::Path& path, const Block& block, const kinematics::Chain& chain) {
  double squared_length = 0.0;
  for (int j = 0; j < chain.size(); ++j) {
    const double step = block.end[j] - block.start[j];
    const Motion motion = chain.joints()[std::size_t(j)].motion;
    if (motion == Motion::Rotary && step != 0.0) return 0.0;
    if (motion == Motion::Linear) squared_length += step * step;
  }
  if (block.interpolation != Interpolation::Arc) return std::sqrt(squared_length);
  const program::Arc& arc = path.arcs[block.shape];
  return std::abs(arc.radius * arc.sweep);
}

double cutter_width(const Scene& scene) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  return cutter == nullptr ? 0.0 : 2.0 * cutter->radius;
}

void count_feed(const Block& block, double length, double spindle_speed, double width,
                FeedCounts& counts) {
  const double seconds = block.end_s - block.start_s;
  // A block shorter than 1 nm has no meaningful feed.
  if (!(length > 1e-6) || !(seconds > 0.0) || block.inverse_time) return;
  const double mm_per_min = length / seconds * 60.0;
  if (mm_per_min < min_feed_mm_per_min) return counts.slow.add(block, mm_per_min);
  if (spindle_speed == 0.0) return;
  const double feed_per_revolution = length / seconds * 2 * pi / std::abs(spindle_speed);
  if (feed_per_revolution < min_feed_per_revolution) counts.rubbing.add(block, feed_per_revolution);
  if (feed_per_revolution >
      std::max(max_width_fraction * width, max_unreported_feed_per_revolution))
    counts.coarse.add(block, feed_per_revolution);
}

FeedCounts feed_counts(const Scene& scene, const Machine& machine, const program::Path& path,
                       int spindle) {
  FeedCounts counts;
  // Without [cutting] a right-handed cutter is assumed.
  const bool is_clockwise = !scene.cutting || scene.cutting->flutes.clockwise;
  for (const Block& block : path.blocks) {
    const bool is_line_or_arc =
        block.interpolation == Interpolation::Line || block.interpolation == Interpolation::Arc;
    const double seconds = block.end_s - block.start_s;
    if (!is_line_or_arc || !(seconds > 0.0)) continue;
    ++counts.feed_blocks;
    const double spindle_speed = (block.end[spindle] - block.start[spindle]) / seconds;
    counts.max_spindle_speed = std::max(counts.max_spindle_speed, std::abs(spindle_speed));
    if (spindle_speed == 0.0) counts.standing.add(block);
    // The simulated cut checks the spindle of a turning tool.
    if (!machine.workpiece_spindle) {
      if (spindle_speed != 0.0 && (spindle_speed > 0.0) != is_clockwise) counts.reversed.add(block);
      count_feed(block, block_length(path, block, machine.nominal), spindle_speed,
                 cutter_width(scene), counts);
    }
  }
  return counts;
}

std::string standing_text(const FeedCounts& counts) {
  const BlockCount& standing = counts.standing;
  if (standing.blocks == 0) return {};
  if (standing.blocks == counts.feed_blocks)
    return fmt::format(
        "the spindle never turns: the program feeds from line {} on without a preceding S with M3",
        standing.first_line);
  return fmt::format(
      "the spindle is stopped in {} of {} feed blocks, first line {}: check S and M3",
      standing.blocks, counts.feed_blocks, standing.first_line);
}

std::string reversed_text(const Scene& scene, const FeedCounts& counts) {
  const BlockCount& reversed = counts.reversed;
  if (reversed.blocks == 0) return {};
  const bool is_clockwise = !scene.cutting || scene.cutting->flutes.clockwise;
  return fmt::format(
      "the spindle turns {} in {} of {} feed blocks, first line {}: the teeth do not cut in that "
      "direction; check M{} or cutting.rotation = \"{}\"",
      is_clockwise ? "counter-clockwise (M4)" : "clockwise (M3)", reversed.blocks,
      counts.feed_blocks, reversed.first_line, is_clockwise ? 3 : 4,
      is_clockwise ? "counter_clockwise" : "clockwise");
}

/// Returns the warning about a vibration that is stated at a speed far from those at which the
/// program cuts; empty if there is none.
std::string vibration_text(const Scene& scene, const FeedCounts& counts) {
  constexpr double max_ratio = 5.0,
                   min_ratio = 1.0 / 30;  // a wrong unit gives 60 (1/s) or 9.55 (rad/s)
  for (const errors::Vibration& vibration : scene.vibrations) {
    const double ratio = counts.max_spindle_speed / vibration.reference_speed;
    if (vibration.exponent == 0.0 || ratio == 0.0 || (ratio >= min_ratio && ratio <= max_ratio))
      continue;
    return fmt::format(
        "the spindle cuts at up to {:.4g} rpm, {:.3g} times the speed at which the vibration {} is "
        "stated (at_rpm = {:.4g}): check both units (1/s, rad/s or 1000 rpm?)",
        counts.max_spindle_speed / units::rpm, ratio, errors::to_string(vibration.name),
        vibration.reference_speed / units::rpm);
  }
  return {};
}

// Turn of the free axis at a pole, rad, from which a warning is given.
constexpr double min_reported_pole_turn = 10.0 * units::deg;

}  // namespace

std::vector<std::string> feed_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path) {
  const auto spindle = find_spindle(machine);
  if (!spindle) return {};
  const FeedCounts counts = feed_counts(scene, machine, path, *spindle);
  std::vector<std::string> warnings;
  const auto add = [&](std::string text) {
    if (!text.empty()) warnings.push_back(std::move(text));
  };
  add(standing_text(counts));
  add(reversed_text(scene, counts));
  add(vibration_text(scene, counts));
  if (const BlockCount& slow = counts.slow; slow.blocks > 0)
    add(fmt::format(
        "the program feeds at {:.3g} mm/min on line {}, and below {:g} mm/min in {} of {} blocks: "
        "F is in mm/min under G94; check the unit (m/min, mm/s or mm per revolution?)",
        slow.value, slow.first_line, min_feed_mm_per_min, slow.blocks, counts.feed_blocks));
  if (const BlockCount& rubbing = counts.rubbing; rubbing.blocks > 0)
    add(fmt::format(
        "the program feeds {:.3g} um per spindle revolution on line {} ({} of {} "
        "blocks), where a tooth rubs instead of cutting: check the units of F and S",
        rubbing.value / units::um, rubbing.first_line, rubbing.blocks, counts.feed_blocks));
  if (const BlockCount& coarse = counts.coarse; coarse.blocks > 0)
    add(fmt::format(
        "the program feeds {:.3g} mm per spindle revolution on line {} ({} of {} blocks) with a "
        "cutter {:.4g} mm in diameter: check the units of F and S (S is in rpm)",
        coarse.value, coarse.first_line, coarse.blocks, counts.feed_blocks, cutter_width(scene)));
  return warnings;
}

std::string pole_text(const program::PoleApproach& pole, const kinematics::Chain& chain,
                      double within, const std::vector<std::string>& subprogram_files) {
  if (pole.rotation < min_reported_pole_turn) return {};
  const auto axis_name = [&](int joint) { return chain.joints()[std::size_t(joint)].name; };
  return fmt::format(
      "the tool passes a pole of the machine, where it is parallel to {} and {} does not change "
      "its direction, within {:.3g} deg ({}; the pole is at {} {:.4g}): closer than {:.4g} deg {} "
      "turns by {:.4g} deg in total, at up to {:.4g} deg/min as programmed",
      axis_name(pole.axis), axis_name(pole.axis), pole.angle / units::deg,
      program::line_label(subprogram_files, pole.line, pole.file), axis_name(pole.pole_axis),
      // Adding 0.0 removes the sign of -0.
      pole.pole_position / units::deg + 0.0, within / units::deg, axis_name(pole.axis),
      pole.rotation / units::deg, pole.max_speed / units::deg * 60.0);
}

std::vector<std::string> pole_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path) {
  const auto* program_file = std::get_if<ProgramFile>(&scene.program.source);
  // In a program of axis positions the CAM system has already set the motion at a pole.
  const bool has_tip_blocks = std::ranges::any_of(path.blocks, [](const program::Block& block) {
    return block.coordinates == program::Coordinates::Tip;
  });
  if (program_file == nullptr || !(program_file->pole_warning > 0.0) || !has_tip_blocks) return {};
  const program::NcOptions control = nc_options(scene, machine);
  program::PathMeter meter(machine.control,
                           {.rapid_speed = scene.machine.rapid_speed,
                            .rapid_rotation_speed = scene.machine.rapid_rotation_speed,
                            .pole = program_file->pole_warning},
                           &control.control_by_h);
  meter.add(path);
  const auto pole = meter.figures().pole;
  if (!pole) return {};
  std::string text =
      pole_text(*pole, machine.control, program_file->pole_warning, path.subprogram_files);
  if (text.empty()) return {};
  return {std::move(text)};
}

namespace {

/// Returns the warning about a mesh whose facets sag by more than the tolerance, or with most of
/// its vertices on sharp edges; empty if neither is the case.
std::string coarse_mesh_text(const Scene& scene, const cutting::Design& design_w) {
  if (!std::holds_alternative<MeshFile>(scene.part.shape)) return {};
  const cutting::Coarseness coarse = cutting::coarseness(design_w);
  if (2 * coarse.vertices_at_sharp_edges > coarse.judged_vertices)
    return fmt::format(
        "the mesh is too coarse to be judged: {} of {} judged vertices are on edges of more than "
        "30 degrees, where the normal is the mean of faces",
        coarse.vertices_at_sharp_edges, coarse.judged_vertices);
  // If the facets sag by more than h, the mesh itself misses a tolerance of +-h.
  const std::optional<double> half_width = narrowest_half_width(scene.part);
  if (half_width && coarse.max_facet_error > *half_width)
    return fmt::format(
        "the mesh is too coarse for the tolerance: between judged vertices its facets sag by up to "
        "{:.4g} um, while the tolerance is ±{:.4g} um",
        coarse.max_facet_error / units::um, *half_width / units::um);
  return {};
}

bool is_judged(const cutting::Design& design, Eigen::Index vertex) {
  return design.judged.empty() || design.judged[std::size_t(vertex)] != 0;
}

/// Returns the warning about a design whose judged vertices are so sparse that a gouge may lie
/// between them; empty if there is no such warning.
std::string sparse_vertices_text(const Scene& scene, const cutting::Design& design_w) {
  const JudgedVertices judged = judged_vertices(design_w);
  if (!is_sparse(judged, scene.tool)) return {};
  if (judged.vertices < min_judged_vertices)
    return fmt::format(
        "the part is judged at only {} {}: the results do not include the surface between them",
        judged.vertices, judged.vertices == 1 ? "vertex" : "vertices");
  return fmt::format(
      "neighbouring judged vertices are up to {:.4g} mm apart and the cutter is {:.4g} mm in "
      "diameter: the results miss a gouge between them",
      judged.max_distance, 2.0 * std::get<cutting::Cutter>(scene.tool.nominal).radius);
}

// Returns the warning about a program that moves only in rapid traverse.
std::string no_feed_text(const program::Path& path) {
  const bool has_feed = std::any_of(path.blocks.begin(), path.blocks.end(), program::is_feed);
  if (has_feed || path.motion_blocks == 0) return {};
  return fmt::format("no block of the program feeds: all {} moves are rapids", path.motion_blocks);
}

/// Returns the warning about a program that uses or states two units.
std::string unit_change_text(const program::Path& path) {
  if (path.unit_words.size() < 2) return {};
  int inch_moves = 0, moves = 0;
  for (const program::Block& block : path.blocks) {
    if (block.interpolation == program::Interpolation::Dwell) continue;
    ++moves;
    inch_moves += block.inch;
  }
  std::string list;
  // A program may change its unit many times; four of the words are enough to show the mistake.
  for (std::size_t i = 0; i < std::min<std::size_t>(path.unit_words.size(), 4); ++i) {
    const program::UnitWord& word = path.unit_words[i];
    list +=
        fmt::format("{}{} on line {}", i == 0 ? "" : ", ", word.inch ? "G20" : "G21", word.line);
  }
  return fmt::format(
      "the program sets two units, {}: {} of its {} moves are in inches, the others in mm; remove "
      "the wrong word",
      list, inch_moves, moves);
}

/// Adds warnings about a holder that overlaps the cutter or the spindle, or does not extend to the
/// spindle.
void add_holder_warnings(const ToolDescription& tool, std::vector<std::string>& texts) {
  const auto* cutter = std::get_if<cutting::Cutter>(&tool.actual);
  if (cutter == nullptr || !tool.holder) return;
  constexpr double tolerance = 0.01;  // mm
  const double begin = (*tool.holder)(0, 1), end = (*tool.holder)(tool.holder->rows() - 1, 1);
  const std::string tool_text = tool.number ? fmt::format(" of tool {}", *tool.number) : "";
  if (const double overlap = cutter->flank_length - begin; overlap > tolerance)
    texts.push_back(fmt::format(
        "the holder{} begins {:.6g} mm above the tip, {:.6g} mm below the upper end of the flank "
        "(flank_length_mm {:.6g}): that part of the cutter is inside the holder",
        tool_text, begin, overlap, cutter->flank_length));
  const double excess = end - tool.actual_length;
  if (std::abs(excess) > tolerance)
    texts.push_back(fmt::format(
        "the holder{} ends {:.6g} mm above the tip, {:.6g} mm {} the nose of the spindle "
        "(length_mm "
        "{:.6g}){}",
        tool_text, end, std::abs(excess), excess > 0.0 ? "beyond" : "short of", tool.actual_length,
        excess > 0.0 ? "" : ": the gap between them is not checked"));
}

/// Adds the warning that concave arcs of a tool are cut as chords.
void add_chord_warning(const ToolDescription& tool, std::vector<std::string>& texts) {
  const double sag = std::max(chord_sag(tool.nominal_form), chord_sag(tool.actual_form));
  if (sag > 0.0)
    texts.push_back(
        fmt::format("the inward arcs of the tool{} are replaced by chords: the tool is larger "
                    "there by up to {:.3g} um",
                    tool.number ? fmt::format(" {}", *tool.number) : "", sag / units::um));
}

double shank_radius(const Scene& scene, const cutting::Cutter& cutter) {
  return scene.tool.shank_radius.value_or(cutting::shank_radius(cutter));
}

}  // namespace

std::optional<double> narrowest_half_width(const PartDescription& part) {
  std::optional<double> half_width;
  const auto add = [&](const Tolerance& tolerance) {
    const double own_half_width = 0.5 * (tolerance.upper - tolerance.lower);
    half_width = std::min(half_width.value_or(own_half_width), own_half_width);
  };
  if (part.tolerance) add(*part.tolerance);
  for (const PartRegion& region : part.regions)
    if (region.tolerance) add(*region.tolerance);
  return half_width;
}

JudgedVertices judged_vertices(const cutting::Design& design) {
  JudgedVertices result;
  for (Eigen::Index i = 0; i < design.vertices.rows(); ++i) result.vertices += is_judged(design, i);
  for (Eigen::Index t = 0; t < design.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = design.triangles(t, k), b = design.triangles(t, (k + 1) % 3);
      if (is_judged(design, a) && is_judged(design, b))
        result.max_distance =
            std::max(result.max_distance, (design.vertices.row(a) - design.vertices.row(b)).norm());
    }
  return result;
}

bool is_sparse(const JudgedVertices& judged, const ToolDescription& tool) {
  const auto* cutter = std::get_if<cutting::Cutter>(&tool.nominal);
  return judged.vertices < min_judged_vertices ||
         (cutter != nullptr && judged.max_distance > 2.0 * cutter->radius);
}

std::vector<std::string> program_warnings(const Scene& scene, const cutting::Design& design_w,
                                          const program::Path& path,
                                          const program::UnreachedPoints& unreached) {
  std::vector<std::string> warnings = tool_comment_warnings(path, all_tools(scene));
  for (std::string text :
       {unreached_text(unreached), no_feed_text(path), unit_change_text(path),
        coarse_mesh_text(scene, design_w), sparse_vertices_text(scene, design_w)})
    if (!text.empty()) warnings.push_back(std::move(text));
  for (const ToolDescription& tool : all_tools(scene)) {
    add_holder_warnings(tool, warnings);
    add_chord_warning(tool, warnings);
  }
  return warnings;
}

ShankContacts shank_contacts(const Scene& scene, const cutting::Design& design_w,
                             const NominalRun& run) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  if (cutter == nullptr) return {};
  const cutting::CutterMotion motion = cutter_motion(run.T_wt, run.samples);
  ShankContacts contacts;
  contacts.shank = cutting::shank_contact(
      design_w, *cutter, motion,
      {.length = scene.tool.length, .band = scene.band, .radius = shank_radius(scene, *cutter)});
  if (scene.tool.holder)
    contacts.holder = cutting::non_cutting_contact(
        design_w, cutting::non_cutting_sections(*scene.tool.holder), motion, scene.band);
  return contacts;
}

ShankContacts joined(const ShankContacts& a, const ShankContacts& b) {
  const auto join = [](const std::optional<cutting::ShankContact>& first,
                       const std::optional<cutting::ShankContact>& second) {
    if (!first || !second) return first ? first : second;
    cutting::ShankContact contact = second->deepest > first->deepest ? *second : *first;
    // The larger number is a lower bound; the sum would count vertices twice that are met in both
    // windows.
    contact.vertices = std::max(first->vertices, second->vertices);
    contact.first_line = first->first_line;
    return std::optional(contact);
  };
  return {join(a.shank, b.shank), join(a.holder, b.holder), true};
}

std::vector<std::string> shank_warnings(const Scene& scene, const ShankContacts& contacts) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  std::vector<std::string> warnings;
  const auto add = [&](const std::string& what,
                       const std::optional<cutting::ShankContact>& contact) {
    if (!contact) return;
    warnings.push_back(fmt::format(
        "{} enters the design by more than {:.4g} mm at {} vertices{}, {} {:.3f} mm "
        "deep (line {}, first line {})",
        what, contact->tolerated_depth, contact->vertices, contacts.in_windows ? " or more" : "",
        contact->continues_deeper ? "at least" : "up to", contact->deepest, contact->line,
        contact->first_line));
  };
  if (cutter == nullptr) return warnings;
  const double radius = shank_radius(scene, *cutter);
  add(fmt::format("the shank above the flank ({:.4g} mm above the tip{})", cutter->flank_length,
                  radius == cutter->radius ? "" : fmt::format(", radius {:.4g} mm", radius)),
      contacts.shank);
  add("the holder", contacts.holder);
  return warnings;
}

}  // namespace abbe::sim
