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

using dialects::WordTreatment;
using kinematics::Motion;
using nlohmann::ordered_json;
using program::AxisFigures;
using program::MoveFigures;
using program::ValueAtLine;

const kinematics::Joint& control_joint(const ProgramInspection& inspection, int j) {
  return inspection.machine.control.joints()[std::size_t(j)];
}

/// Return the unit of an axis in the report, and its name.
double axis_unit(const kinematics::Joint& joint) {
  return joint.motion == Motion::Linear ? 1.0 : units::deg;
}

const char* axis_unit_name(const kinematics::Joint& joint) {
  return joint.motion == Motion::Linear ? "mm" : "deg";
}

/// Returns the maximum speed of an axis, mm/s or rad/s.
double max_axis_speed(const ProgramInspection& inspection, const kinematics::Joint& joint) {
  return joint.motion == Motion::Linear ? inspection.description.rapid_speed
                                        : inspection.description.rapid_rotation_speed;
}

bool has_limits(const kinematics::Joint& joint) {
  // Unlimited axes have limits of 1e9 or more.
  constexpr double no_limit = 1e8;
  return joint.max - joint.min < no_limit;
}

/// Returns the sums over all moves at feed: lines, arcs and cubics.
MoveFigures feed_totals(const program::PathFigures& figures) {
  MoveFigures sum;
  for (const MoveFigures* moves : {&figures.lines, &figures.arcs, &figures.cubics}) {
    sum.count += moves->count;
    sum.seconds += moves->seconds;
    sum.limited_s += moves->limited_s;
    sum.path_length += moves->path_length;
  }
  return sum;
}

/// Returns the number of moves: all blocks of the path except dwells.
std::size_t move_count(const program::PathFigures& figures) {
  return figures.blocks - figures.dwells.count;
}

/// Returns the name of a work offset in the dialect of the program.
std::string offset_name(const ProgramInspection& inspection, int number) {
  if (number < 0) return "none";  // G53, G500, or a table of times
  for (const dialects::Dialect dialect_kind :
       {dialects::Dialect::Siemens, dialects::Dialect::Heidenhain})
    if (inspection.dialect == dialects::name_of(dialect_kind))
      return dialects::offset_name(dialect_kind, number + 1);
  return dialects::offset_name(dialects::Dialect::LinuxCnc, number + 1);
}

/// Returns the source of the work offsets, such as "as FILE has them".
std::string offsets_text(const ProgramInspection& inspection) {
  if (!inspection.offset_table.empty())
    return "as " + escaped(inspection.offset_table.string()) + " has them";
  return inspection.offset.empty() ? "zero unless set by the program"
                                   : "G54 to G59 at " + escaped(inspection.offset) + " each";
}

/// Returns the program line of an extreme value, with the file if it is a subprogram.
std::string line_reference(const ProgramInspection& inspection, const ValueAtLine& extreme) {
  return program::line_label(inspection.subprogram_files, extreme.line, extreme.file);
}

/// Returns the programmed time, and the time if every axis is limited to its maximum speed.
std::string times_text(const ProgramInspection& inspection) {
  const program::PathFigures& figures = inspection.figures;
  const MoveFigures feed = feed_totals(figures);
  const double dwell = figures.dwells.seconds;
  return fmt::format(
      "time      {:.4g} s as programmed: feed {:.4g}, rapid {:.4g}, dwell {:.4g}\n          {:.4g} "
      "s with no axis above its limit: feed {:.4g}, rapid {:.4g} (speeds only: the machine states "
      "no accelerations)\npath      {:.6g} mm at feed, {:.6g} mm at rapid, of the tip in the "
      "workpiece\n",
      feed.seconds + figures.rapids.seconds + dwell, feed.seconds, figures.rapids.seconds, dwell,
      feed.limited_s + figures.rapids.limited_s + dwell, feed.limited_s, figures.rapids.limited_s,
      feed.path_length, figures.rapids.path_length);
}

/// Returns a line with the extents of a box; empty for an empty box. Adding 0.0 turns -0 into 0.
std::string box_text(const char* name, const Eigen::AlignedBox3d& box) {
  if (box.isEmpty()) return "";
  return fmt::format("{:<9} X {:.6g} .. {:.6g}, Y {:.6g} .. {:.6g}, Z {:.6g} .. {:.6g} mm\n", name,
                     box.min().x() + 0.0, box.max().x(), box.min().y() + 0.0, box.max().y(),
                     box.min().z() + 0.0, box.max().z());
}

/// Returns the range of radii at feed of a turning program; empty for milling.
std::string radius_text(const ProgramInspection& inspection) {
  const auto& range = inspection.figures.radius_at_feed;
  if (!range) return "";
  return fmt::format(
      "radius    {:.6g} .. {:.6g} mm from the spindle line at feed: diameters {:.6g} .. {:.6g}\n",
      (*range)[0], (*range)[1], 2 * (*range)[0], 2 * (*range)[1]);
}

/// Returns a table of the axes: range, remaining travel, and the maximum speed at feed in percent
/// of the limit.
std::string axes_text(const ProgramInspection& inspection) {
  std::string text =
      "\naxis  from          to            travel left   fastest at feed, % of its limit\n";
  for (int j = 0; j < inspection.machine.control.size(); ++j) {
    const AxisFigures& axis = inspection.figures.axes[std::size_t(j)];
    if (!axis.has_position) continue;
    const kinematics::Joint& joint = control_joint(inspection, j);
    const double unit = axis_unit(joint);
    const std::string remaining =
        has_limits(joint)
            ? fmt::format("{:.5g} {}", axis.remaining_travel / unit, axis_unit_name(joint))
            : "-";
    // Adding 0.0 turns -0 into 0.
    text += fmt::format("{:<5} {:<13} {:<13} {:<13} ", joint.name,
                        fmt::format("{:.7g}", axis.lowest.value / unit + 0.0),
                        fmt::format("{:.7g}", axis.highest.value / unit + 0.0), remaining);
    if (axis.fastest.value > 0)
      text += fmt::format("{:.5g} {}/min, {:.3g} % on {}", axis.fastest.value / unit * 60,
                          axis_unit_name(joint),
                          100 * axis.fastest.value / max_axis_speed(inspection, joint),
                          line_reference(inspection, axis.fastest));
    text += '\n';
  }
  if (inspection.figures.fastest_axis >= 0)
    text += fmt::format("{} comes closest to its limit\n",
                        control_joint(inspection, inspection.figures.fastest_axis).name);
  return text;
}

/// Returns the pose nearest to a singular one, in which two rotary axes turn the tool about the
/// same line.
std::string singular_text(const ProgramInspection& inspection) {
  if (!inspection.figures.singular) return "singular  no move at feed uses two rotary axes\n";
  const program::SingularPose& pose = *inspection.figures.singular;
  std::string positions;
  for (int j = 0; j < inspection.machine.control.size(); ++j)
    if (control_joint(inspection, j).motion == Motion::Rotary)
      positions += fmt::format(" {} {:.5g}", control_joint(inspection, j).name,
                               pose.q[j] / units::deg + 0.0);
  return fmt::format(
      "singular  nearest pose {:.4g} deg away, on {}:{} deg\n", pose.angle / units::deg,
      program::line_label(inspection.subprogram_files, pose.line, pose.file), positions);
}

/// Returns the called tools, the comments of the program on their diameters, and the work offsets.
std::string tools_text(const ProgramInspection& inspection) {
  std::string text;
  for (const ProgramTool& tool : inspection.tools)
    text += fmt::format("{:<9} {}, called {} on line {}, {} blocks\n", text.empty() ? "tools" : "",
                        tool.number < 0 ? "M6 without T" : fmt::format("T{}", tool.number),
                        tool.calls == 1 ? "once" : fmt::format("{} times, first", tool.calls),
                        tool.line, tool.blocks);
  if (text.empty()) text = "tools     none called\n";
  constexpr std::size_t max_comments = 10;
  for (std::size_t i = 0; i < std::min(max_comments, inspection.tool_comments.size()); ++i) {
    const program::ToolComment& comment = inspection.tool_comments[i];
    text += fmt::format(
        "          line {} describes a tool of {:.6g} mm{}: {}\n", comment.line,
        comment.words.diameter,
        comment.words.corner_radius
            ? fmt::format(" with a corner radius of {:.6g} mm", *comment.words.corner_radius)
            : "",
        escaped(comment.text));
  }
  text += fmt::format("offsets   {}:", offsets_text(inspection));
  for (const auto& [number, blocks] : inspection.figures.offsets)
    text += fmt::format(" {} ({} blocks)", offset_name(inspection, number), blocks);
  return text + "\n";
}

/// Returns a line with the NC words of one kind of use and their counts.
std::string words_text(const ProgramInspection& inspection, WordTreatment use, const char* name) {
  std::string text;
  for (const dialects::UsedWord& word : inspection.words)
    if (word.use == use) text += fmt::format(" {} {}", word.word, word.count);
  return text.empty() ? "" : fmt::format("{:<9}{}\n", name, text);
}

/// Returns a line with the unknown words that were skipped and their counts.
std::string skipped_text(const ProgramInspection& inspection) {
  std::string text;
  for (const dialects::SkippedWord& word : inspection.skipped)
    text += fmt::format(" {} {}", escaped(word.word), word.count);
  return text.empty() ? "" : fmt::format("{:<9}{}\n", "skipped", text);
}

}  // namespace

std::string to_text(const ProgramInspection& inspection) {
  const program::PathFigures& figures = inspection.figures;
  const bool by_linuxcnc = inspection.interpreter == dialects::Interpreter::LinuxCnc;
  return fmt::format("program   {}, {} lines, read as {}{}{}\n", escaped(inspection.file.string()),
                     inspection.lines, inspection.dialect,
                     inspection.dialect_evidence.empty()
                         ? ""
                         : ", as " + escaped(inspection.dialect_evidence),
                     by_linuxcnc ? ", by the LinuxCNC interpreter" : "") +
         (inspection.tool_table.empty()
              ? fmt::format("machine   {}, tool length {:.6g} mm\n", inspection.machine_name,
                            inspection.tool_length)
              : fmt::format("machine   {}, tools of {}\n", inspection.machine_name,
                            escaped(inspection.tool_table.string()))) +
         fmt::format(
             "blocks    {} executed; {} moves: {} rapids, {} lines, {} arcs{}; {} dwells; {} in a "
             "tool tip mode\n",
             inspection.executed, move_count(figures), figures.rapids.count, figures.lines.count,
             figures.arcs.count,
             figures.cubics.count > 0 ? fmt::format(", {} cubics", figures.cubics.count) : "",
             figures.dwells.count, figures.tip_blocks) +
         times_text(inspection) + box_text("feed", figures.feed_extent_w) +
         box_text("all", figures.tip_extent_w) + radius_text(inspection) + axes_text(inspection) +
         "\n" + singular_text(inspection) + tools_text(inspection) +
         words_text(inspection, WordTreatment::Read, "words") +
         words_text(inspection, WordTreatment::WithoutEffect, "ignored") + skipped_text(inspection);
}

namespace {

ordered_json to_json(const MoveFigures& moves) {
  return {{"count", moves.count},
          {"time_s", moves.seconds},
          {"time_by_axis_limits_s", moves.limited_s},
          {"way_mm", moves.path_length}};
}

/// Returns the extents of a box by axis; null for an empty box.
ordered_json to_json(const Eigen::AlignedBox3d& box) {
  if (box.isEmpty()) return nullptr;
  ordered_json json;
  for (int k = 0; k < 3; ++k)
    json[std::string(1, char('X' + k))] = {box.min()[k] + 0.0, box.max()[k] + 0.0};
  return json;
}

ordered_json axes_json(const ProgramInspection& inspection) {
  ordered_json axes;
  for (int j = 0; j < inspection.machine.control.size(); ++j) {
    const AxisFigures& axis = inspection.figures.axes[std::size_t(j)];
    if (!axis.has_position) continue;
    const kinematics::Joint& joint = control_joint(inspection, j);
    const double unit = axis_unit(joint);
    ordered_json remaining;
    if (has_limits(joint)) remaining = axis.remaining_travel / unit;
    axes[std::string(1, joint.name)] = {
        {"unit", axis_unit_name(joint)},
        {"from", axis.lowest.value / unit + 0.0},
        {"from_line", axis.lowest.line},
        {"to", axis.highest.value / unit + 0.0},
        {"to_line", axis.highest.line},
        {"travel_left", remaining},
        {"fastest_per_min", axis.fastest.value / unit * 60},
        {"fastest_line", axis.fastest.line},
        {"share_of_limit", axis.fastest.value / max_axis_speed(inspection, joint)}};
  }
  return axes;
}

/// Returns the pose nearest to a singular one; null if no two rotary axes turn the tool.
ordered_json singular_json(const ProgramInspection& inspection) {
  if (!inspection.figures.singular) return nullptr;
  const program::SingularPose& pose = *inspection.figures.singular;
  ordered_json positions;
  for (int j = 0; j < inspection.machine.control.size(); ++j)
    if (const auto& joint = control_joint(inspection, j); joint.motion != Motion::Spindle)
      positions[std::string(1, joint.name)] = pose.q[j] / axis_unit(joint) + 0.0;
  return {{"angle_deg", pose.angle / units::deg}, {"line", pose.line}, {"axes", positions}};
}

/// Returns the closest approach to a pole, where a rotary axis turns fast; null if there is none.
ordered_json pole_json(const ProgramInspection& inspection) {
  if (!inspection.figures.pole) return nullptr;
  const program::PoleApproach& pole = *inspection.figures.pole;
  return {{"angle_deg", pole.angle / units::deg},
          {"line", pole.line},
          {"axis", std::string(1, control_joint(inspection, pole.axis).name)},
          {"turned_deg", pole.rotation / units::deg},
          {"fastest_deg_per_min", pole.max_speed / units::deg * 60.0}};
}

ordered_json tools_json(const ProgramInspection& inspection) {
  ordered_json tools = ordered_json::array();
  for (const ProgramTool& tool : inspection.tools)
    tools.push_back({{"number", tool.number},
                     {"line", tool.line},
                     {"calls", tool.calls},
                     {"blocks", tool.blocks}});
  return tools;
}

/// Returns all used and all skipped NC words with their first lines.
ordered_json words_json(const ProgramInspection& inspection) {
  ordered_json words = ordered_json::array();
  for (const dialects::UsedWord& word : inspection.words)
    words.push_back({{"word", word.word},
                     {"use", std::string(dialects::name_of(word.use))},
                     {"count", word.count},
                     {"line", word.line},
                     {"meaning", std::string(word.sentence)}});
  for (const dialects::SkippedWord& word : inspection.skipped)
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

ordered_json to_json(const ProgramInspection& inspection) {
  const program::PathFigures& figures = inspection.figures;
  const MoveFigures feed = feed_totals(figures);
  ordered_json offsets, fastest;
  for (const auto& [number, blocks] : figures.offsets)
    offsets[offset_name(inspection, number)] = blocks;
  if (figures.fastest_axis >= 0)
    fastest = std::string(1, control_joint(inspection, figures.fastest_axis).name);
  return {
      {"program", inspection.file.string()},
      {"dialect", inspection.dialect},
      {"sign", inspection.dialect_evidence},
      {"interpreter",
       inspection.interpreter == dialects::Interpreter::LinuxCnc ? "linuxcnc" : "abbe"},
      {"control", inspection.turning ? "turning" : "milling"},
      {"machine", inspection.machine_name},
      {"tool_length_mm", inspection.tool_length},
      {"tool_table", inspection.tool_table.string()},
      {"offset_table", inspection.offset_table.string()},
      {"lines", inspection.lines},
      {"blocks", inspection.executed},
      {"moves", move_count(figures)},
      {"rapids", to_json(figures.rapids)},
      {"lines_at_feed", to_json(figures.lines)},
      {"arcs", to_json(figures.arcs)},
      {"cubics", to_json(figures.cubics)},
      {"dwells", {{"count", figures.dwells.count}, {"time_s", figures.dwells.seconds}}},
      {"time_s", feed.seconds + figures.rapids.seconds + figures.dwells.seconds},
      {"time_by_axis_limits_s", feed.limited_s + figures.rapids.limited_s + figures.dwells.seconds},
      {"slowed_moves", figures.slowed_moves},
      {"tip_mode_blocks", figures.tip_blocks},
      {"extent_at_feed_mm", to_json(figures.feed_extent_w)},
      {"extent_mm", to_json(figures.tip_extent_w)},
      {"radius_at_feed_mm",
       figures.radius_at_feed ? ordered_json(*figures.radius_at_feed) : ordered_json()},
      {"axes", axes_json(inspection)},
      {"fastest_axis", fastest},
      {"singular", singular_json(inspection)},
      {"near_pole", pole_json(inspection)},
      {"tools", tools_json(inspection)},
      {"offset", inspection.offset},
      {"offsets", offsets},
      {"words", words_json(inspection)},
      {"assumptions", to_json(inspection.assumptions)},
      {"warnings", inspection.warnings}};
}

namespace {

constexpr std::size_t max_events = 40;  // in the text
constexpr std::size_t max_pairs = 12;   // in the text

/// Returns line, time and, for a subprogram, the file.
ordered_json position_json(const ProgramLocation& location,
                           const std::vector<std::string>& subprogram_files) {
  ordered_json json = {{"line", location.line}, {"time_s", location.time_s}};
  if (location.file > 0) json["file"] = subprogram_files[std::size_t(location.file) - 1];
  return json;
}

/// Returns a contact or near miss. The depth is null if it was not computed.
ordered_json event_json(const Collision& event, const std::vector<std::string>& subprogram_files) {
  ordered_json json = {{"kind", event.contact ? "contact" : "near_miss"},
                       {"a", event.a},
                       {"b", event.b},
                       {"rapid", event.rapid},
                       {"first", position_json(event.first, subprogram_files)},
                       {"last", position_json(event.last, subprogram_files)},
                       {"distance_mm", event.distance}};
  if (!event.contact || event.depth_samples > 0)
    json[event.contact ? "deepest" : "nearest"] = position_json(event.worst, subprogram_files);
  if (event.contact)
    json["depth_mm"] = event.depth_samples > 0 ? ordered_json(event.depth) : ordered_json();
  json["at_bed_mm"] = numbers(event.place_b);
  json["at_workpiece_mm"] = numbers(event.position_w);
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

std::string count_text(std::size_t count, const char* singular, const char* plural) {
  return fmt::format("{} {}", count, count == 1 ? singular : plural);
}

std::string position_text(const Eigen::Vector3d& position) {
  return fmt::format("({:.2f}, {:.2f}, {:.2f})", position.x(), position.y(), position.z());
}

/// Returns the pairs with the smallest clearances. Pairs that overlap at the start are left out.
std::vector<Clearance> nearest_pairs(const Collisions& collisions) {
  std::vector<Clearance> pairs;
  for (const Clearance& pair : collisions.clearances)
    if (!pair.overlap_at_start && std::isfinite(pair.distance)) pairs.push_back(pair);
  std::ranges::stable_sort(pairs, {}, &Clearance::distance);
  if (pairs.size() > max_pairs) pairs.resize(max_pairs);
  return pairs;
}

}  // namespace

ordered_json to_json(const Collisions& collisions) {
  ordered_json bodies = ordered_json::array(), events = ordered_json::array(),
               pairs = ordered_json::array(), blocks = ordered_json::array();
  for (const Collisions::NamedBody& body : collisions.bodies)
    bodies.push_back(
        {{"name", body.name}, {"carried_by", body.carrier}, {"triangles", body.triangles}});
  for (const Collision& event : collisions.list)
    events.push_back(event_json(event, collisions.subprogram_files));
  // A pair that overlaps at the start, such as a carriage and its guide, has no clearance.
  for (const Clearance& pair : collisions.clearances) {
    ordered_json json = {{"a", pair.a}, {"b", pair.b}, {"overlap_at_start", pair.overlap_at_start}};
    if (std::isfinite(pair.distance) && !pair.overlap_at_start) {
      json["clearance_mm"] = pair.distance;
      json["at"] = position_json(pair.place, collisions.subprogram_files);
    }
    json["in_blocks"] = scope_name(pair.in_blocks);
    pairs.push_back(std::move(json));
  }
  for (const BlockClearance& block : collisions.blocks)
    blocks.push_back({block.place.line, block.place.time_s,
                      block.pair < 0 ? ordered_json() : ordered_json(block.min_clearance),
                      block.pair < 0 ? ordered_json() : ordered_json(block.pair)});
  return {{"case", collisions.commands},
          {"contacts", contacts(collisions)},
          {"near_misses", collisions.list.size() - contacts(collisions)},
          {"clear", is_clear(collisions)},
          {"beyond_travel", collisions.beyond_travel},
          {"resolution_mm", collisions.resolution},
          {"clearance_mm", collisions.clearance},
          {"gouge_mm", collisions.gouge},
          {"bodies", bodies},
          {"events", events},
          {"pairs", pairs},
          {"block_columns", {"line", "time_s", "clearance_at_least_mm", "pair"}},
          {"blocks", blocks},
          {"distances_asked", collisions.queries},
          {"seconds", collisions.seconds},
          {"warnings", collisions.warnings}};
}

std::string to_text(const Collisions& collisions) {
  const std::size_t count = contacts(collisions);
  std::string text = fmt::format(
      "\ncollisions of {}: {}; {} under {:g} mm; {} bodies, {} pairs, {:.1f} s\n",
      escaped(collisions.commands),
      count == 0 ? "none" : count_text(count, "collision", "collisions"),
      count_text(collisions.list.size() - count, "near miss", "near misses"), collisions.clearance,
      collisions.bodies.size(), collisions.clearances.size(), collisions.seconds);
  for (std::size_t i = 0; i < std::min(collisions.list.size(), max_events); ++i) {
    const Collision& event = collisions.list[i];
    text += fmt::format("{} {}\n          {} at {} of the workpiece, {} of the bed\n",
                        event.contact ? "COLLISION" : "near miss", event_text(event, collisions),
                        event.contact ? "first" : "nearest", position_text(event.position_w),
                        position_text(event.place_b));
  }
  if (collisions.list.size() > max_events)
    text += fmt::format("          and {} more; --json lists all\n",
                        collisions.list.size() - max_events);
  if (!collisions.beyond_travel.empty())
    text += fmt::format("TRAVEL    {}\n", escaped(collisions.beyond_travel));
  if (collisions.clearances.empty()) return text + "          no two bodies can collide\n";
  const std::vector<Clearance> nearest = nearest_pairs(collisions);
  if (!nearest.empty()) text += "nearest   ";
  bool is_first = true;
  for (const Clearance& pair : nearest) {
    text += fmt::format(
        "{}{:>8.3f} mm  {} - {}, {}\n", is_first ? "" : "          ", pair.distance,
        escaped(pair.a), escaped(pair.b),
        program::line_label(collisions.subprogram_files, pair.place.line, pair.place.file));
    is_first = false;
  }
  if (!nearest.empty())
    text +=
        "          the true clearance is at most 5 % or 0.01 mm less; --json has a lower bound for "
        "each block\n";
  return text;
}

}  // namespace abbe::sim
