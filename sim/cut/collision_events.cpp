#include "sim/cut/collision_events.h"

#include <algorithm>

#include <fmt/format.h>

#include "kinematics/escape.h"
#include "sim/program/path_meter.h"

namespace abbe::sim {
namespace {

std::string range_text(const Collision& event, const std::vector<std::string>& more_files) {
  const std::string first = program::line_text(more_files, event.first.line, event.first.file);
  const bool one = event.first.line == event.last.line && event.first.file == event.last.file;
  return one ? first
             : first + " to " + program::line_text(more_files, event.last.line, event.last.file);
}

}  // namespace

std::string event_text(const Collision& event, const std::vector<std::string>& more_files) {
  const std::string where = fmt::format("{}, {:.3f} s{}", range_text(event, more_files),
                                        event.first.time_s, event.rapid ? ", on a rapid" : "");
  const std::string pair = fmt::format("{} and {}", escaped(event.a), escaped(event.b));
  if (!event.contact)
    return fmt::format("{} come within {:.3g} mm: {}", pair, event.distance, where);
  const std::string depth =
      event.depths > 0 ? fmt::format("{:.3g} mm deep", event.depth) : "depth not looked at";
  return fmt::format("{} meet, {}: {}", pair, depth, where);
}

std::vector<std::string> collision_warnings(const Collisions& all) {
  constexpr std::size_t most = 10;
  std::vector<std::string> warnings = all.warnings;
  if (!all.beyond_travel.empty()) warnings.push_back("beyond its travel: " + all.beyond_travel);
  std::size_t said = 0;
  for (const Collision& one : all.list)
    if (one.contact && said++ < most)
      warnings.push_back("collision: " + event_text(one, all.more_files));
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

}  // namespace abbe::sim
