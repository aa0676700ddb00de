#include "sim/cut/collision_events.h"

#include <algorithm>
#include <iterator>
#include <map>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "sim/program/path_meter.h"

namespace abbe::sim {

namespace {

std::string range_text(const Collision& event, const std::vector<std::string>& more_files) {
  const std::string first = program::line_text(more_files, event.first.line, event.first.file);
  const bool one = event.first.line == event.last.line && event.first.file == event.last.file;
  return one ? first
             : first + " to " + program::line_text(more_files, event.last.line, event.last.file);
}

/// Returns the text of the depth of a contact or of the distance of a near miss.
std::string worst_text(const Collision& event, const Collisions& all) {
  const auto at = [&] {
    return fmt::format("at {}, {:.3f} s",
                       program::line_text(all.more_files, event.worst.line, event.worst.file),
                       event.worst.time_s);
  };
  if (!event.contact) return fmt::format("come within {:.3g} mm {}", event.distance, at());
  if (event.below_mesh) return "meet, less deep than the mesh of the stock shows";
  if (event.depths == 0) return "meet, depth not looked at";
  if (event.depth <= all.resolution) return fmt::format("touch, to {:g} mm", all.resolution);
  return fmt::format("meet, {:.3g} mm deep {}", event.depth, at());
}

}  // namespace

std::string event_text(const Collision& event, const Collisions& all) {
  return fmt::format("{} and {} {}: {}, from {:.3f} s{}", escaped(event.a), escaped(event.b),
                     worst_text(event, all), range_text(event, all.more_files), event.first.time_s,
                     event.rapid ? ", on a rapid" : "");
}

std::vector<std::string> collision_warnings(const Collisions& all) {
  constexpr std::size_t most = 10;  // warnings list only the first ten; the result holds every
                                    // contact
  std::vector<std::string> warnings = all.warnings;
  if (!all.beyond_travel.empty()) warnings.push_back("beyond its travel: " + all.beyond_travel);
  std::size_t said = 0;
  for (const Collision& one : all.list)
    if (one.contact && said++ < most) warnings.push_back("collision: " + event_text(one, all));
  if (said > most) warnings.push_back(fmt::format("and {} more collisions", said - most));
  if (const std::size_t near = all.list.size() - contacts(all); near > 0)
    warnings.push_back(fmt::format("{} times two bodies come within {:g} mm", near, all.clearance));
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
std::vector<std::size_t> spread(std::size_t first, std::size_t end) {
  constexpr std::size_t most = 24;
  std::vector<std::size_t> numbers;
  const std::size_t count = end - first, n = std::min(count, most);
  for (std::size_t k = 0; k < n; ++k)
    numbers.push_back(n == 1 ? first : first + k * (count - 1) / (n - 1));
  return numbers;
}

}  // namespace

DeepestSample deepest_sample(std::size_t first, std::size_t end,
                             const std::vector<std::size_t>& block_ends,
                             const std::function<double(std::size_t)>& depth_at) {
  // Moments are few and sampled once each, so a map by moment finds the neighbours of the deepest
  // one.
  std::map<std::size_t, double> depths;
  const auto look = [&](std::size_t i) {
    if (!depths.contains(i)) depths.emplace(i, depth_at(i));
  };
  for (const std::size_t i : spread(first, end)) look(i);
  for (const std::size_t k : spread(0, block_ends.size()))
    look(std::clamp(block_ends[k], first, end - 1));
  const auto deepest = [&] {
    return std::ranges::max_element(depths, {}, [](const auto& one) { return one.second; });
  };
  // Each round halves both intervals beside the deepest sample: ten rounds narrow 1/24 of a contact
  // to 1/24000 of it.
  constexpr int halvings = 10;
  for (int n = 0; n < halvings; ++n) {
    const auto most = deepest();
    const std::size_t at = most->first;
    const std::size_t before = most == depths.begin() ? at : std::prev(most)->first,
                      after = std::next(most) == depths.end() ? at : std::next(most)->first;
    look(at - (at - before) / 2);
    look(at + (after - at) / 2);
  }
  const auto most = deepest();
  return {most->second, most->first, depths.size()};
}

}  // namespace abbe::sim
