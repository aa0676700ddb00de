#include "sim/report/collision_report.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/escape.h"
#include "sim/program/path_meter.h"
#include "sim/report/json_numbers.h"

namespace abbe::sim {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t most_events = 40;  // of the text
constexpr std::size_t most_pairs = 12;   // of the text

ordered_json place_json(const ProgramPlace& place, const std::vector<std::string>& more_files) {
  ordered_json json = {{"line", place.line}, {"time_s", place.time_s}};
  if (place.file > 0) json["file"] = more_files[std::size_t(place.file) - 1];
  return json;
}

ordered_json event_json(const Collision& one, const std::vector<std::string>& more_files) {
  ordered_json json = {{"kind", one.contact ? "contact" : "near_miss"},
                       {"a", one.a},
                       {"b", one.b},
                       {"rapid", one.rapid},
                       {"first", place_json(one.first, more_files)},
                       {"last", place_json(one.last, more_files)},
                       {"distance_mm", one.distance}};
  if (!one.contact || one.depths > 0)
    json[one.contact ? "deepest" : "nearest"] = place_json(one.worst, more_files);
  if (one.contact) json["depth_mm"] = one.depths > 0 ? ordered_json(one.depth) : ordered_json();
  json["at_bed_mm"] = numbers(one.place_b);
  json["at_workpiece_mm"] = numbers(one.place_w);
  return json;
}

const char* name_of(InBlocks in_blocks) {
  switch (in_blocks) {
    case InBlocks::Always:
      return "always";
    case InBlocks::WhereNear:
      return "where_near";
    case InBlocks::WhereMet:
      return "where_met";
    case InBlocks::Never:
      break;
  }
  return "never";
}

std::string counted(std::size_t n, const char* one, const char* more) {
  return fmt::format("{} {}", n, n == 1 ? one : more);
}

std::string at_text(const Eigen::Vector3d& place) {
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", place.x(), place.y(), place.z());
}

/// Pairs that come nearest, without those that are left out or may touch.
std::vector<Clearance> nearest_pairs(const Collisions& collisions) {
  std::vector<Clearance> pairs;
  for (const Clearance& one : collisions.clearances)
    if (!one.overlap_at_start && std::isfinite(one.distance)) pairs.push_back(one);
  std::ranges::stable_sort(pairs, {}, &Clearance::distance);
  if (pairs.size() > most_pairs) pairs.resize(most_pairs);
  return pairs;
}

}  // namespace

ordered_json to_json(const Collisions& all) {
  ordered_json bodies = ordered_json::array(), events = ordered_json::array(),
               pairs = ordered_json::array(), blocks = ordered_json::array();
  for (const Collisions::NamedBody& one : all.bodies)
    bodies.push_back(
        {{"name", one.name}, {"carried_by", one.carrier}, {"triangles", one.triangles}});
  for (const Collision& one : all.list) events.push_back(event_json(one, all.more_files));
  for (const Clearance& one : all.clearances) {
    ordered_json json = {{"a", one.a}, {"b", one.b}, {"overlap_at_start", one.overlap_at_start}};
    if (std::isfinite(one.distance) && !one.overlap_at_start) {
      json["clearance_mm"] = one.distance;
      json["at"] = place_json(one.place, all.more_files);
    }
    json["in_blocks"] = name_of(one.in_blocks);
    pairs.push_back(std::move(json));
  }
  for (const BlockClearance& one : all.blocks)
    blocks.push_back({one.place.line, one.place.time_s,
                      one.pair < 0 ? ordered_json() : ordered_json(one.at_least),
                      one.pair < 0 ? ordered_json() : ordered_json(one.pair)});
  return {{"case", all.commands},
          {"contacts", contacts(all)},
          {"near_misses", all.list.size() - contacts(all)},
          {"clear", is_clear(all)},
          {"beyond_travel", all.beyond_travel},
          {"resolution_mm", all.resolution},
          {"clearance_mm", all.clearance},
          {"gouge_mm", all.gouge},
          {"bodies", bodies},
          {"events", events},
          {"pairs", pairs},
          {"block_columns", {"line", "time_s", "clearance_at_least_mm", "pair"}},
          {"blocks", blocks},
          {"distances_asked", all.queries},
          {"seconds", all.seconds},
          {"warnings", all.warnings}};
}

std::string to_text(const Collisions& all) {
  const std::size_t count = contacts(all);
  std::string text = fmt::format(
      "\ncollisions of {}: {}; {} under {:g} mm; {} bodies, {} pairs, {:.1f} s\n",
      escaped(all.commands), count == 0 ? "none" : counted(count, "collision", "collisions"),
      counted(all.list.size() - count, "near miss", "near misses"), all.clearance,
      all.bodies.size(), all.clearances.size(), all.seconds);
  for (std::size_t i = 0; i < std::min(all.list.size(), most_events); ++i) {
    const Collision& one = all.list[i];
    text +=
        fmt::format("{} {}\n          {} at {} of the workpiece, {} of the bed\n",
                    one.contact ? "COLLISION" : "near miss", event_text(one, all),
                    one.contact ? "first" : "nearest", at_text(one.place_w), at_text(one.place_b));
  }
  if (all.list.size() > most_events)
    text += fmt::format("          and {} more; --json has all\n", all.list.size() - most_events);
  if (!all.beyond_travel.empty()) text += fmt::format("TRAVEL    {}\n", escaped(all.beyond_travel));
  if (all.clearances.empty()) return text + "          no two bodies can meet\n";
  const std::vector<Clearance> nearest = nearest_pairs(all);
  if (!nearest.empty()) text += "nearest   ";
  bool first = true;
  for (const Clearance& one : nearest) {
    text += fmt::format("{}{:>8.3f} mm  {} - {}, {}\n", first ? "" : "          ", one.distance,
                        escaped(one.a), escaped(one.b),
                        program::line_text(all.more_files, one.place.line, one.place.file));
    first = false;
  }
  if (!nearest.empty())
    text +=
        "          the true clearance is at most 5 % or 0.01 mm less; what each block has at least "
        "is "
        "in --json\n";
  return text;
}

}  // namespace abbe::sim
