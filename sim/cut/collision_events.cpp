#include "sim/cut/collision_events.h"

#include <algorithm>
#include <iterator>
#include <map>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "sim/program/path_meter.h"

namespace abbe::sim {

namespace {

std::string range_text(const Collision& event, const std::vector<std::string>& subprogram_files) {
  const std::string first =
      program::line_label(subprogram_files, event.first.line, event.first.file);
  const bool is_one_line =
      event.first.line == event.last.line && event.first.file == event.last.file;
  return is_one_line ? first
                     : first + " to " +
                           program::line_label(subprogram_files, event.last.line, event.last.file);
}

/// Returns the text of the depth of a contact or of the distance of a near miss.
std::string worst_text(const Collision& event, const Collisions& result) {
  const auto worst_location_text = [&] {
    return fmt::format(
        "at {}, {:.3f} s",
        program::line_label(result.subprogram_files, event.worst.line, event.worst.file),
        event.worst.time_s);
  };
  if (!event.contact)
    return fmt::format("come within {:.3g} mm {}", event.distance, worst_location_text());
  if (event.below_mesh) return "collide, by less than the mesh of the stock resolves";
  if (event.depth_samples == 0) return "collide, depth not evaluated";
  if (event.depth <= result.resolution) return fmt::format("touch (to {:g} mm)", result.resolution);
  return fmt::format("collide, {:.3g} mm deep {}", event.depth, worst_location_text());
}

}  // namespace

std::string event_text(const Collision& event, const Collisions& result) {
  return fmt::format("{} and {} {}: {}, from {:.3f} s{}", escaped(event.a), escaped(event.b),
                     worst_text(event, result), range_text(event, result.subprogram_files),
                     event.first.time_s, event.rapid ? ", in a rapid move" : "");
}

std::vector<std::string> collision_warnings(const Collisions& result) {
  constexpr std::size_t max_listed = 10;  // the result file lists every contact
  std::vector<std::string> warnings = result.warnings;
  if (!result.beyond_travel.empty())
    warnings.push_back("beyond its travel: " + result.beyond_travel);
  std::size_t contact_count = 0;
  for (const Collision& event : result.list)
    if (event.contact && contact_count++ < max_listed)
      warnings.push_back("collision: " + event_text(event, result));
  if (contact_count > max_listed)
    warnings.push_back(fmt::format("and {} more collisions", contact_count - max_listed));
  if (const std::size_t near_misses = result.list.size() - contacts(result); near_misses > 0)
    warnings.push_back(fmt::format("near misses: {} times two bodies come within {:g} mm",
                                   near_misses, result.clearance));
  return warnings;
}

std::size_t contacts(const Collisions& collisions) {
  return std::size_t(std::ranges::count_if(collisions.list, &Collision::contact));
}

bool is_clear(const Collisions& collisions) {
  return contacts(collisions) == 0 && collisions.beyond_travel.empty();
}

namespace {

/// Returns up to 24 numbers of [first, end), evenly spread, with the first and the last.
std::vector<std::size_t> spread_numbers(std::size_t first, std::size_t end) {
  constexpr std::size_t max_count = 24;
  std::vector<std::size_t> numbers;
  const std::size_t count = end - first, n = std::min(count, max_count);
  for (std::size_t k = 0; k < n; ++k)
    numbers.push_back(n == 1 ? first : first + k * (count - 1) / (n - 1));
  return numbers;
}

}  // namespace

DeepestSample deepest_sample(std::size_t first, std::size_t end,
                             const std::vector<std::size_t>& block_ends,
                             const std::function<double(std::size_t)>& depth_at) {
  // A map by moment gives the neighbours of the deepest sample.
  std::map<std::size_t, double> depths;
  const auto sample = [&](std::size_t i) {
    if (!depths.contains(i)) depths.emplace(i, depth_at(i));
  };
  for (const std::size_t i : spread_numbers(first, end)) sample(i);
  for (const std::size_t k : spread_numbers(0, block_ends.size()))
    sample(std::clamp(block_ends[k], first, end - 1));
  const auto deepest = [&] {
    return std::ranges::max_element(depths, {},
                                    [](const auto& sample_depth) { return sample_depth.second; });
  };
  // Each halving samples the middle of both intervals beside the deepest sample: ten of them narrow
  // 1/24 of a contact to 1/24000.
  constexpr int halvings = 10;
  for (int n = 0; n < halvings; ++n) {
    const auto deepest_entry = deepest();
    const std::size_t moment = deepest_entry->first;
    const std::size_t previous = deepest_entry == depths.begin() ? moment
                                                                 : std::prev(deepest_entry)->first,
                      following = std::next(deepest_entry) == depths.end()
                                      ? moment
                                      : std::next(deepest_entry)->first;
    sample(moment - (moment - previous) / 2);
    sample(moment + (following - moment) / 2);
  }
  const auto deepest_entry = deepest();
  return {deepest_entry->second, deepest_entry->first, depths.size()};
}

}  // namespace abbe::sim
