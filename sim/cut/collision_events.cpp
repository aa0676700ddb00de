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

/// How deep, or how near.
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
  constexpr std::size_t most = 10;
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

}  // namespace abbe::sim
