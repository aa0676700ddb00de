#include "sim/cut/feed_warnings.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/units.h"

namespace abbe::sim {
namespace {

using kinematics::Motion;
using program::Block;
using program::Interpolation;

// F of an axis in m/min is a thousandth of its number in mm/min: the slowest that mills finish with
// is about 20 mm/min.
constexpr double slowest_mm_per_min = 5.0;
// below it a tooth rubs; diamonds are fed by 1 um a turn and more
constexpr double least_per_turn = 0.5 * units::um;
// of the cutter's width, and never doubted below 1 mm: face mills of many teeth are fed by that
constexpr double most_per_turn = 0.5, never_doubted_per_turn = 1.0;

/// Blocks of one kind.
struct Count {
  int blocks = 0;
  int first_line = 0;
  double value = 0.0;  ///< of the first

  void add(const Block& block, double of_block = 0.0) {
    if (blocks++ > 0) return;
    first_line = block.line;
    value = of_block;
  }
};

struct FeedCounts {
  int feeds = 0;
  double fastest = 0.0;  ///< rad/s
  Count standing, reversed, slow, rubbing, coarse;
};

/// mm, of the tip or the slides; 0 of a block that an axis turns in.
double length_of(const program::Path& path, const Block& block, const kinematics::Chain& chain) {
  double squared = 0.0;
  for (int j = 0; j < chain.size(); ++j) {
    const double step = block.end[j] - block.start[j];
    const Motion motion = chain.joints()[std::size_t(j)].motion;
    if (motion == Motion::Rotary && step != 0.0) return 0.0;
    if (motion == Motion::Linear) squared += step * step;
  }
  if (block.interpolation != Interpolation::Arc) return std::sqrt(squared);
  const program::Arc& arc = path.arcs[block.shape];
  return std::abs(arc.radius * arc.sweep);
}

double cutter_width(const Scene& scene) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  return cutter == nullptr ? 0.0 : 2.0 * cutter->radius;
}

void count_feed(const Block& block, double length, double rate, double width, FeedCounts& counts) {
  const double seconds = block.end_s - block.start_s;
  if (!(length > 1e-6) || !(seconds > 0.0) || block.inverse_time) return;
  const double mm_per_min = length / seconds * 60.0;
  if (mm_per_min < slowest_mm_per_min) return counts.slow.add(block, mm_per_min);
  if (rate == 0.0) return;
  const double per_turn = length / seconds * 2 * pi / std::abs(rate);
  if (per_turn < least_per_turn) counts.rubbing.add(block, per_turn);
  if (per_turn > std::max(most_per_turn * width, never_doubted_per_turn))
    counts.coarse.add(block, per_turn);
}

FeedCounts feed_counts(const Scene& scene, const Machine& machine, const program::Path& path,
                       int spindle) {
  FeedCounts counts;
  // without [cutting] nothing says that a cutter is left-handed
  const bool clockwise = !scene.cutting || scene.cutting->flutes.clockwise;
  for (const Block& block : path.blocks) {
    const bool straight_or_arc =
        block.interpolation == Interpolation::Line || block.interpolation == Interpolation::Arc;
    const double seconds = block.end_s - block.start_s;
    if (!straight_or_arc || !(seconds > 0.0)) continue;
    ++counts.feeds;
    const double rate = (block.end[spindle] - block.start[spindle]) / seconds;
    counts.fastest = std::max(counts.fastest, std::abs(rate));
    if (rate == 0.0) counts.standing.add(block);
    if (!machine.workpiece_spindle) {
      if (rate != 0.0 && (rate > 0.0) != clockwise) counts.reversed.add(block);
      count_feed(block, length_of(path, block, machine.nominal), rate, cutter_width(scene), counts);
    }
  }
  return counts;
}

std::string standing_text(const FeedCounts& counts) {
  const Count& standing = counts.standing;
  if (standing.blocks == 0) return {};
  if (standing.blocks == counts.feeds)
    return fmt::format(
        "the spindle never turns: the program feeds from line {} on and has no S with M3 before it",
        standing.first_line);
  return fmt::format("the spindle stands in {} of {} blocks that feed, first line {}: S and M3?",
                     standing.blocks, counts.feeds, standing.first_line);
}

std::string reversed_text(const Scene& scene, const FeedCounts& counts) {
  const Count& reversed = counts.reversed;
  if (reversed.blocks == 0) return {};
  const bool clockwise = !scene.cutting || scene.cutting->flutes.clockwise;
  return fmt::format(
      "the spindle turns {} in {} of {} blocks that feed, first line {}: the teeth do not cut that "
      "way, M{} or cutting.rotation = \"{}\"?",
      clockwise ? "counter-clockwise (M4)" : "clockwise (M3)", reversed.blocks, counts.feeds,
      reversed.first_line, clockwise ? 3 : 4, clockwise ? "counter_clockwise" : "clockwise");
}

/// Returns what is said of a vibration whose amplitude is stated at a speed far from any that cuts.
std::string vibration_text(const Scene& scene, const FeedCounts& counts) {
  constexpr double most_times = 5.0,
                   least_times = 1.0 / 30;  // 60 and 9.55 are 1/s and rad/s for rpm
  for (const errors::Vibration& vibration : scene.vibrations) {
    const double times = counts.fastest / vibration.reference_speed;
    if (vibration.exponent == 0.0 || times == 0.0 || (times >= least_times && times <= most_times))
      continue;
    return fmt::format(
        "the spindle cuts at up to {:.4g} rpm, {:.3g} times the speed at which the vibration {} is "
        "stated (at_rpm = {:.4g}): one of the two looks like 1/s, rad/s or 1000 rpm",
        counts.fastest / units::rpm, times, errors::to_string(vibration.name),
        vibration.reference_speed / units::rpm);
  }
  return {};
}

}  // namespace

std::vector<std::string> feed_warnings(const Scene& scene, const Machine& machine,
                                       const program::Path& path) {
  const auto spindle = spindle_of(machine);
  if (!spindle) return {};
  const FeedCounts counts = feed_counts(scene, machine, path, *spindle);
  std::vector<std::string> warnings;
  const auto add = [&](std::string text) {
    if (!text.empty()) warnings.push_back(std::move(text));
  };
  add(standing_text(counts));
  add(reversed_text(scene, counts));
  add(vibration_text(scene, counts));
  if (const Count& slow = counts.slow; slow.blocks > 0)
    add(fmt::format(
        "the program feeds at {:.3g} mm/min on line {}, and below {:g} mm/min in {} of {} blocks: "
        "F is mm/min under G94, looks like m/min, mm/s or mm a turn",
        slow.value, slow.first_line, slowest_mm_per_min, slow.blocks, counts.feeds));
  if (const Count& rubbing = counts.rubbing; rubbing.blocks > 0)
    add(
        fmt::format("the program feeds by {:.3g} um a turn of the spindle on line {} ({} of {} "
                    "blocks): a tooth "
                    "rubs at that; F or S looks like another unit",
                    rubbing.value / units::um, rubbing.first_line, rubbing.blocks, counts.feeds));
  if (const Count& coarse = counts.coarse; coarse.blocks > 0)
    add(fmt::format(
        "the program feeds by {:.3g} mm a turn of the spindle on line {} ({} of {} blocks) under a "
        "cutter {:.4g} mm wide: F or S looks like another unit, S is in rpm",
        coarse.value, coarse.first_line, coarse.blocks, counts.feeds, cutter_width(scene)));
  return warnings;
}

}  // namespace abbe::sim
