#include "sim/report/program_report.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/files/json_files.h"
#include "sim/program/path_meter.h"
#include "sim/scene/program.h"

namespace abbe::sim {

namespace {

using dialects::Use;
using kinematics::Motion;
using nlohmann::ordered_json;
using program::AxisFigures;
using program::MoveFigures;
using program::ValueAtLine;

const kinematics::Joint& joint_of(const ProgramInspection& alone, int j) {
  return alone.machine.control.joints()[std::size_t(j)];
}

double unit_of(const kinematics::Joint& joint) {
  return joint.motion == Motion::Linear ? 1.0 : units::deg;
}

const char* unit_name(const kinematics::Joint& joint) {
  return joint.motion == Motion::Linear ? "mm" : "deg";
}

/// Returns the maximum speed of an axis, mm/s or rad/s.
double limit_of(const ProgramInspection& alone, const kinematics::Joint& joint) {
  return joint.motion == Motion::Linear ? alone.description.rapid_speed
                                        : alone.description.rapid_turn;
}

bool has_limits(const kinematics::Joint& joint) {
  // Unlimited axes have limits of 1e9 or more.
  constexpr double no_limit = 1e8;
  return joint.max - joint.min < no_limit;
}

/// Returns the sum of all moves at feed: lines, arcs and cubics.
MoveFigures feed_of(const program::PathFigures& figures) {
  MoveFigures sum;
  for (const MoveFigures* one : {&figures.lines, &figures.arcs, &figures.cubics}) {
    sum.count += one->count;
    sum.seconds += one->seconds;
    sum.limited_s += one->limited_s;
    sum.way += one->way;
  }
  return sum;
}

std::size_t moves_of(const program::PathFigures& figures) {
  return figures.blocks - figures.dwells.count;
}

/// Returns the name of a work offset in the dialect of the program.
std::string offset_name(const ProgramInspection& alone, int number) {
  if (number < 0) return "none";  // G53, G500, or a table of times
  for (const dialects::Dialect one : {dialects::Dialect::Siemens, dialects::Dialect::Heidenhain})
    if (alone.dialect == dialects::name_of(one)) return dialects::offset_name(one, number + 1);
  return dialects::offset_name(dialects::Dialect::LinuxCnc, number + 1);
}

/// Returns the source of the work offsets: "as FILE has them".
std::string offsets_text(const ProgramInspection& alone) {
  if (!alone.offset_table.empty())
    return "as " + escaped(alone.offset_table.string()) + " has them";
  return alone.offset.empty() ? "zero unless the program sets them"
                              : "G54 to G59 at " + escaped(alone.offset) + " each";
}

std::string place_of(const ProgramInspection& alone, const ValueAtLine& at) {
  return program::line_text(alone.more_files, at.line, at.file);
}

/// Returns the time as programmed, and the time if no axis exceeds its maximum speed.
std::string times_text(const ProgramInspection& alone) {
  const program::PathFigures& f = alone.figures;
  const MoveFigures feed = feed_of(f);
  const double dwell = f.dwells.seconds;
  return fmt::format(
      "time      {:.4g} s as programmed: feed {:.4g}, rapid {:.4g}, dwell {:.4g}\n"
      "          {:.4g} s with no axis above its limit: feed {:.4g}, rapid {:.4g} (speeds alone: "
      "the machine states no accelerations)\n"
      "way       {:.6g} mm at feed, {:.6g} mm at rapid, of the tip in the workpiece\n",
      feed.seconds + f.rapids.seconds + dwell, feed.seconds, f.rapids.seconds, dwell,
      feed.limited_s + f.rapids.limited_s + dwell, feed.limited_s, f.rapids.limited_s, feed.way,
      f.rapids.way);
}

/// Returns a line with the extents of a box; adding 0.0 turns -0 into 0.
std::string box_text(const char* name, const Eigen::AlignedBox3d& box) {
  if (box.isEmpty()) return "";
  return fmt::format("{:<9} X {:.6g} .. {:.6g}, Y {:.6g} .. {:.6g}, Z {:.6g} .. {:.6g} mm\n", name,
                     box.min().x() + 0.0, box.max().x(), box.min().y() + 0.0, box.max().y(),
                     box.min().z() + 0.0, box.max().z());
}

/// Returns the range of radii of a turning program at feed.
std::string radius_text(const ProgramInspection& alone) {
  const auto& range = alone.figures.radius_at_feed;
  if (!range) return "";
  return fmt::format(
      "radius    {:.6g} .. {:.6g} mm from the spindle line at feed: diameters {:.6g} .. {:.6g}\n",
      (*range)[0], (*range)[1], 2 * (*range)[0], 2 * (*range)[1]);
}

/// Returns a table of the axes: range, travel left, and the highest speed at feed in percent of the
/// limit.
std::string axes_text(const ProgramInspection& alone) {
  std::string text =
      "\naxis  from          to            travel left   fastest at feed, share of its limit\n";
  for (int j = 0; j < alone.machine.control.size(); ++j) {
    const AxisFigures& axis = alone.figures.axes[std::size_t(j)];
    if (!axis.positioned) continue;
    const kinematics::Joint& joint = joint_of(alone, j);
    const double unit = unit_of(joint);
    const std::string left =
        has_limits(joint) ? fmt::format("{:.5g} {}", axis.left / unit, unit_name(joint)) : "-";
    // Adding 0.0 turns -0 into 0.
    text += fmt::format("{:<5} {:<13} {:<13} {:<13} ", joint.name,
                        fmt::format("{:.7g}", axis.least.value / unit + 0.0),
                        fmt::format("{:.7g}", axis.most.value / unit + 0.0), left);
    if (axis.fastest.value > 0)
      text += fmt::format("{:.5g} {}/min, {:.3g} % on {}", axis.fastest.value / unit * 60,
                          unit_name(joint), 100 * axis.fastest.value / limit_of(alone, joint),
                          place_of(alone, axis.fastest));
    text += '\n';
  }
  if (alone.figures.fastest_axis >= 0)
    text += fmt::format("{} comes nearest to its limit\n",
                        joint_of(alone, alone.figures.fastest_axis).name);
  return text;
}

/// Returns the pose nearest to a singular one, at which two rotary axes turn the tool about one
/// line.
std::string singular_text(const ProgramInspection& alone) {
  if (!alone.figures.singular)
    return "singular  no move at feed turns the tool by two rotary axes\n";
  const program::SingularPose& pose = *alone.figures.singular;
  std::string at;
  for (int j = 0; j < alone.machine.control.size(); ++j)
    if (joint_of(alone, j).motion == Motion::Rotary)
      at += fmt::format(" {} {:.5g}", joint_of(alone, j).name, pose.q[j] / units::deg + 0.0);
  return fmt::format("singular  nearest pose {:.4g} deg away, on {}:{} deg\n",
                     pose.angle / units::deg,
                     program::line_text(alone.more_files, pose.line, pose.file), at);
}

/// Returns the tools that are called, the comments of the program about their diameters, and the
/// work offsets.
std::string tools_text(const ProgramInspection& alone) {
  std::string text;
  for (const ProgramTool& tool : alone.tools)
    text += fmt::format("{:<9} {}, called {} on line {}, {} blocks\n", text.empty() ? "tools" : "",
                        tool.number < 0 ? "M6 without T" : fmt::format("T{}", tool.number),
                        tool.calls == 1 ? "once" : fmt::format("{} times, first", tool.calls),
                        tool.line, tool.blocks);
  if (text.empty()) text = "tools     none called\n";
  constexpr std::size_t most = 10;
  for (std::size_t i = 0; i < std::min(most, alone.tool_comments.size()); ++i) {
    const program::ToolComment& one = alone.tool_comments[i];
    text += fmt::format("          line {} describes one of {:.6g} mm{}: {}\n", one.line,
                        one.words.diameter,
                        one.words.corner_radius
                            ? fmt::format(" with a corner of {:.6g} mm", *one.words.corner_radius)
                            : "",
                        escaped(one.text));
  }
  text += fmt::format("offsets   {}:", offsets_text(alone));
  for (const auto& [number, blocks] : alone.figures.offsets)
    text += fmt::format(" {} ({} blocks)", offset_name(alone, number), blocks);
  return text + "\n";
}

/// Returns the NC words of one use with their counts.
std::string words_text(const ProgramInspection& alone, Use use, const char* name) {
  std::string text;
  for (const dialects::UsedWord& word : alone.words)
    if (word.use == use) text += fmt::format(" {} {}", word.word, word.count);
  return text.empty() ? "" : fmt::format("{:<9}{}\n", name, text);
}

/// Returns the unknown words that were skipped, with their counts.
std::string skipped_text(const ProgramInspection& alone) {
  std::string text;
  for (const dialects::SkippedWord& word : alone.skipped)
    text += fmt::format(" {} {}", escaped(word.word), word.count);
  return text.empty() ? "" : fmt::format("{:<9}{}\n", "skipped", text);
}

}  // namespace

std::string to_text(const ProgramInspection& alone) {
  const program::PathFigures& f = alone.figures;
  const bool by_linuxcnc = alone.interpreter == dialects::Interpreter::LinuxCnc;
  return fmt::format("program   {}, {} lines, read as {}{}{}\n", escaped(alone.file.string()),
                     alone.lines, alone.dialect,
                     alone.sign.empty() ? "" : ", as " + escaped(alone.sign),
                     by_linuxcnc ? ", by LinuxCNC's own interpreter" : "") +
         (alone.tool_table.empty() ? fmt::format("machine   {}, tool length {:.6g} mm\n",
                                                 alone.machine_name, alone.tool_length)
                                   : fmt::format("machine   {}, tools of {}\n", alone.machine_name,
                                                 escaped(alone.tool_table.string()))) +
         fmt::format(
             "blocks    {} executed; {} moves: {} rapids, {} lines, {} arcs{}; {} dwells; "
             "{} under a tip mode\n",
             alone.executed, moves_of(f), f.rapids.count, f.lines.count, f.arcs.count,
             f.cubics.count > 0 ? fmt::format(", {} cubics", f.cubics.count) : "", f.dwells.count,
             f.tip_blocks) +
         times_text(alone) + box_text("feed", f.feed_w) + box_text("all", f.all_w) +
         radius_text(alone) + axes_text(alone) + "\n" + singular_text(alone) + tools_text(alone) +
         words_text(alone, Use::Read, "words") + words_text(alone, Use::WithoutEffect, "ignored") +
         skipped_text(alone);
}

namespace {

ordered_json to_json(const MoveFigures& moves) {
  return {{"count", moves.count},
          {"time_s", moves.seconds},
          {"time_by_axis_limits_s", moves.limited_s},
          {"way_mm", moves.way}};
}

/// Returns a box by axes; null if nothing moves.
ordered_json to_json(const Eigen::AlignedBox3d& box) {
  if (box.isEmpty()) return nullptr;
  ordered_json json;
  for (int k = 0; k < 3; ++k)
    json[std::string(1, char('X' + k))] = {box.min()[k] + 0.0, box.max()[k] + 0.0};
  return json;
}

ordered_json axes_json(const ProgramInspection& alone) {
  ordered_json axes;
  for (int j = 0; j < alone.machine.control.size(); ++j) {
    const AxisFigures& axis = alone.figures.axes[std::size_t(j)];
    if (!axis.positioned) continue;
    const kinematics::Joint& joint = joint_of(alone, j);
    const double unit = unit_of(joint);
    ordered_json left;
    if (has_limits(joint)) left = axis.left / unit;
    axes[std::string(1, joint.name)] = {
        {"unit", unit_name(joint)},
        {"from", axis.least.value / unit + 0.0},
        {"from_line", axis.least.line},
        {"to", axis.most.value / unit + 0.0},
        {"to_line", axis.most.line},
        {"travel_left", left},
        {"fastest_per_min", axis.fastest.value / unit * 60},
        {"fastest_line", axis.fastest.line},
        {"share_of_limit", axis.fastest.value / limit_of(alone, joint)}};
  }
  return axes;
}

/// Returns the pose nearest to a singular one; null if the tool is not turned by two rotary axes.
ordered_json singular_json(const ProgramInspection& alone) {
  if (!alone.figures.singular) return nullptr;
  const program::SingularPose& pose = *alone.figures.singular;
  ordered_json at;
  for (int j = 0; j < alone.machine.control.size(); ++j)
    if (const auto& joint = joint_of(alone, j); joint.motion != Motion::Spindle)
      at[std::string(1, joint.name)] = pose.q[j] / unit_of(joint) + 0.0;
  return {{"angle_deg", pose.angle / units::deg}, {"line", pose.line}, {"axes", at}};
}

/// Returns the nearest pass of a pole, at which a rotary axis turns fast.
ordered_json pole_json(const ProgramInspection& alone) {
  if (!alone.figures.pole) return nullptr;
  const program::NearPole& pole = *alone.figures.pole;
  return {{"angle_deg", pole.angle / units::deg},
          {"line", pole.line},
          {"axis", std::string(1, joint_of(alone, pole.axis).name)},
          {"turned_deg", pole.turned / units::deg},
          {"fastest_deg_per_min", pole.fastest / units::deg * 60.0}};
}

ordered_json tools_json(const ProgramInspection& alone) {
  ordered_json tools = ordered_json::array();
  for (const ProgramTool& tool : alone.tools)
    tools.push_back({{"number", tool.number},
                     {"line", tool.line},
                     {"calls", tool.calls},
                     {"blocks", tool.blocks}});
  return tools;
}

/// Returns all NC words used, and those skipped, with their first lines.
ordered_json words_json(const ProgramInspection& alone) {
  ordered_json words = ordered_json::array();
  for (const dialects::UsedWord& word : alone.words)
    words.push_back({{"word", word.word},
                     {"use", std::string(dialects::name_of(word.use))},
                     {"count", word.count},
                     {"line", word.line},
                     {"meaning", std::string(word.sentence)}});
  for (const dialects::SkippedWord& word : alone.skipped)
    words.push_back(
        {{"word", word.word}, {"use", "skipped"}, {"count", word.count}, {"line", word.line}});
  return words;
}

}  // namespace

ordered_json to_json(const std::vector<program::Assumption>& assumptions) {
  ordered_json list = ordered_json::array();
  for (const program::Assumption& assumption : assumptions) {
    ordered_json entry = {{"text", assumption.text}, {"key", assumption.key}};
    if (!assumption.option.empty()) entry["option"] = assumption.option;
    entry["line"] = assumption.line;
    if (!assumption.file.empty()) entry["file"] = assumption.file;
    list.push_back(std::move(entry));
  }
  return list;
}

ordered_json to_json(const ProgramInspection& alone) {
  const program::PathFigures& f = alone.figures;
  const MoveFigures feed = feed_of(f);
  ordered_json offsets, fastest;
  for (const auto& [number, blocks] : f.offsets) offsets[offset_name(alone, number)] = blocks;
  if (f.fastest_axis >= 0) fastest = std::string(1, joint_of(alone, f.fastest_axis).name);
  return {
      {"program", alone.file.string()},
      {"dialect", alone.dialect},
      {"sign", alone.sign},
      {"interpreter", alone.interpreter == dialects::Interpreter::LinuxCnc ? "linuxcnc" : "abbe"},
      {"control", alone.turning ? "turning" : "milling"},
      {"machine", alone.machine_name},
      {"tool_length_mm", alone.tool_length},
      {"tool_table", alone.tool_table.string()},
      {"offset_table", alone.offset_table.string()},
      {"lines", alone.lines},
      {"blocks", alone.executed},
      {"moves", moves_of(f)},
      {"rapids", to_json(f.rapids)},
      {"lines_at_feed", to_json(f.lines)},
      {"arcs", to_json(f.arcs)},
      {"cubics", to_json(f.cubics)},
      {"dwells", {{"count", f.dwells.count}, {"time_s", f.dwells.seconds}}},
      {"time_s", feed.seconds + f.rapids.seconds + f.dwells.seconds},
      {"time_by_axis_limits_s", feed.limited_s + f.rapids.limited_s + f.dwells.seconds},
      {"slowed_moves", f.slowed},
      {"tip_mode_blocks", f.tip_blocks},
      {"extent_at_feed_mm", to_json(f.feed_w)},
      {"extent_mm", to_json(f.all_w)},
      {"radius_at_feed_mm", f.radius_at_feed ? ordered_json(*f.radius_at_feed) : ordered_json()},
      {"axes", axes_json(alone)},
      {"fastest_axis", fastest},
      {"singular", singular_json(alone)},
      {"near_pole", pole_json(alone)},
      {"tools", tools_json(alone)},
      {"offset", alone.offset},
      {"offsets", offsets},
      {"words", words_json(alone)},
      {"assumptions", to_json(alone.assumptions)},
      {"warnings", alone.warnings}};
}

namespace {

constexpr std::size_t max_events = 40;  // in the text
constexpr std::size_t max_pairs = 12;   // in the text

/// Returns line, time and, in a subprogram, the file.
ordered_json position_json(const ProgramLocation& place,
                           const std::vector<std::string>& more_files) {
  ordered_json json = {{"line", place.line}, {"time_s", place.time_s}};
  if (place.file > 0) json["file"] = more_files[std::size_t(place.file) - 1];
  return json;
}

/// Returns a contact or near miss. The depth is null where it was not computed.
ordered_json event_json(const Collision& one, const std::vector<std::string>& more_files) {
  ordered_json json = {{"kind", one.contact ? "contact" : "near_miss"},
                       {"a", one.a},
                       {"b", one.b},
                       {"rapid", one.rapid},
                       {"first", position_json(one.first, more_files)},
                       {"last", position_json(one.last, more_files)},
                       {"distance_mm", one.distance}};
  if (!one.contact || one.depths > 0)
    json[one.contact ? "deepest" : "nearest"] = position_json(one.worst, more_files);
  if (one.contact) json["depth_mm"] = one.depths > 0 ? ordered_json(one.depth) : ordered_json();
  json["at_bed_mm"] = numbers(one.place_b);
  json["at_workpiece_mm"] = numbers(one.place_w);
  return json;
}

/// Returns the blocks in which the clearance of a pair is known.
const char* scope_name(ClearanceScope in_blocks) {
  switch (in_blocks) {
    case ClearanceScope::Always:
      return "always";
    case ClearanceScope::WhenNear:
      return "where_near";
    case ClearanceScope::WhenInContact:
      return "where_met";
    case ClearanceScope::Never:
      break;
  }
  return "never";
}

std::string counted(std::size_t n, const char* one, const char* more) {
  return fmt::format("{} {}", n, n == 1 ? one : more);
}

std::string position_text(const Eigen::Vector3d& place) {
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", place.x(), place.y(), place.z());
}

/// Returns the nearest pairs, without pairs that are left out or may touch.
std::vector<Clearance> nearest_pairs(const Collisions& collisions) {
  std::vector<Clearance> pairs;
  for (const Clearance& one : collisions.clearances)
    if (!one.overlap_at_start && std::isfinite(one.distance)) pairs.push_back(one);
  std::ranges::stable_sort(pairs, {}, &Clearance::distance);
  if (pairs.size() > max_pairs) pairs.resize(max_pairs);
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
  // A pair that overlaps at the start, such as a carriage and its guide, has no clearance.
  for (const Clearance& one : all.clearances) {
    ordered_json json = {{"a", one.a}, {"b", one.b}, {"overlap_at_start", one.overlap_at_start}};
    if (std::isfinite(one.distance) && !one.overlap_at_start) {
      json["clearance_mm"] = one.distance;
      json["at"] = position_json(one.place, all.more_files);
    }
    json["in_blocks"] = scope_name(one.in_blocks);
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
  for (std::size_t i = 0; i < std::min(all.list.size(), max_events); ++i) {
    const Collision& one = all.list[i];
    text += fmt::format("{} {}\n          {} at {} of the workpiece, {} of the bed\n",
                        one.contact ? "COLLISION" : "near miss", event_text(one, all),
                        one.contact ? "first" : "nearest", position_text(one.place_w),
                        position_text(one.place_b));
  }
  if (all.list.size() > max_events)
    text += fmt::format("          and {} more; --json has all\n", all.list.size() - max_events);
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
