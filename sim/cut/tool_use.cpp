#include "sim/cut/tool_use.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/cut/tool_motion.h"

namespace abbe::sim {

namespace {

/// Returns the calls that change the tool: M6, or T if the program has no M6.
std::vector<program::ToolCall> tool_changes(const program::Path& path) {
  const bool has_m6 = std::any_of(path.tool_calls.begin(), path.tool_calls.end(),
                                  [](const program::ToolCall& call) { return call.changes; });
  std::vector<program::ToolCall> calls;
  for (const program::ToolCall& call : path.tool_calls)
    if (call.changes == has_m6) calls.push_back(call);
  return calls;
}

/// Returns the tool calls with a block of feed before the next call. T alone is a call if the
/// program has no M6.
std::vector<program::ToolCall> cutting_calls(const program::Path& path) {
  const std::vector<program::ToolCall> calls = tool_changes(path);
  std::vector<program::ToolCall> result;
  for (std::size_t i = 0; i < calls.size(); ++i) {
    const auto first = path.blocks.begin() + std::ptrdiff_t(calls[i].before);
    const auto last = i + 1 < calls.size()
                          ? path.blocks.begin() + std::ptrdiff_t(calls[i + 1].before)
                          : path.blocks.end();
    if (std::any_of(first, last, program::is_feed)) result.push_back(calls[i]);
  }
  return result;
}

// Returns the name of a called tool for messages.
std::string call_name(const program::ToolCall& call) {
  return call.number < 0 ? "M6 without a T" : fmt::format("T{}", call.number);
}

/// Returns the warning about feed before the first call of a cutting tool.
std::vector<std::string> early_feed_warnings(const program::Path& path,
                                             const std::vector<program::ToolCall>& calls,
                                             const std::string& tool_text) {
  if (calls.empty()) return {};
  const auto first_call = path.blocks.begin() + std::ptrdiff_t(calls.front().before);
  const auto early_block = std::find_if(path.blocks.begin(), first_call, program::is_feed);
  if (early_block == first_call) return {};
  return {fmt::format("line {} feeds before the first tool call, {} on line {}: it is cut with {}",
                      early_block->line, call_name(calls.front()), calls.front().line, tool_text)};
}

ToolUse single_tool_use(const program::Path& path, const ToolDescription& tool) {
  const std::vector<program::ToolCall> calls = cutting_calls(path);
  ToolUse use{{{0, 0, path.blocks.size()}},
              early_feed_warnings(path, calls, "the scene's tool too")};
  if (calls.empty()) return use;
  const program::ToolCall& first = calls.front();
  for (const program::ToolCall& call : calls) {
    if (tool.number && call.number != *tool.number)
      throw BadInput(path.file, call.line, 0,
                     fmt::format("T{}, which is the scene's tool.number", *tool.number),
                     fmt::format("{}: describe it in a [[tool]] of its own, or set tool.number = "
                                 "{} if it is the scene's tool",
                                 call_name(call), call.number));
    if (call.number != first.number)
      throw BadInput(path.file, call.line, 0,
                     fmt::format("only one tool, {} of line {}, because the scene has one; "
                                 "describe several as one numbered [[tool]] each",
                                 call_name(first), first.line),
                     call_name(call));
  }
  if (!tool.number)
    use.warnings.push_back(fmt::format(
        "{} on line {} is cut with the scene's tool{}: set tool.number if this is right",
        call_name(first), first.line, tool.name.empty() ? "" : " " + tool.name));
  return use;
}

// Returns the index of the tool that a call names. Throws BadInput if the scene does not describe
// it.
std::size_t described_tool(const program::Path& path, const program::ToolCall& call,
                           std::span<const ToolDescription> tools) {
  std::string known;
  for (std::size_t i = 0; i < tools.size(); ++i) {
    if (tools[i].number == call.number) return i;
    known += fmt::format("{}T{}", known.empty() ? "" : ", ", *tools[i].number);
  }
  throw BadInput(path.file, call.line, 0,
                 fmt::format("a tool described by a [[tool]] of the scene ({})", known),
                 call_name(call));
}

/// Appends a segment, or extends the last one if it has the same tool.
void add(std::vector<ToolSegment>& segments, const ToolSegment& segment) {
  if (segment.first == segment.last) return;
  if (!segments.empty() && segments.back().tool == segment.tool)
    segments.back().last = segment.last;
  else
    segments.push_back(segment);
}

ToolUse several_tool_use(const program::Path& path, std::span<const ToolDescription> tools) {
  const std::vector<program::ToolCall> calls = cutting_calls(path);
  ToolUse use{{},
              early_feed_warnings(path, calls,
                                  fmt::format("T{}, the scene's first tool", *tools[0].number))};
  std::vector<bool> is_called(tools.size(), false);
  // Rapids before the first call belong to the tool that is called.
  std::size_t tool =
      calls.empty() || !use.warnings.empty() ? 0 : described_tool(path, calls.front(), tools);
  std::size_t first = 0;
  for (const program::ToolCall& call : calls) {
    add(use.segments, {tool, first, call.before});
    tool = described_tool(path, call, tools);
    first = call.before;
    is_called[tool] = true;
  }
  add(use.segments, {tool, first, path.blocks.size()});
  for (const ToolSegment& segment : use.segments)
    for (std::string& text : length_warnings(path, segment, *tools[segment.tool].number))
      use.warnings.push_back(std::move(text));
  if (calls.empty())
    use.warnings.push_back(fmt::format(
        "the program calls no tool: it is cut entirely with T{}, the scene's first tool",
        *tools[0].number));
  for (std::size_t i = 0; i < tools.size() && !calls.empty(); ++i)
    if (!is_called[i])
      use.warnings.push_back(fmt::format(
          "T{} of the scene is not used: the program does not call it", *tools[i].number));
  return use;
}

}  // namespace

std::vector<std::string> length_warnings(const program::Path& path, const ToolSegment& segment,
                                         int number) {
  for (std::size_t i = segment.first; i < segment.last; ++i) {
    const program::Block& block = path.blocks[i];
    if (block.tool_length < 0 || block.tool_length == number) continue;
    // Under G43.4 a wrong length displaces all axes, not only the height, so it is an error.
    if (block.coordinates == program::Coordinates::Tip)
      throw BadInput(path.file, block.line, 0,
                     fmt::format("G43.4 H{}, the length of the active tool T{}", number, number),
                     fmt::format("H{}", block.tool_length));
    if (program::is_feed(block))
      return {fmt::format("from line {} on T{} runs with the length H{} of G43 instead of its own",
                          block.line, number, block.tool_length)};
  }
  return {};
}

ToolUse tool_use(const program::Path& path, std::span<const ToolDescription> tools) {
  return tools.size() == 1 ? single_tool_use(path, tools.front()) : several_tool_use(path, tools);
}

namespace {

using program::CutterData;
using program::ToolComment;

constexpr double dimension_tolerance = 0.01;  // mm: CAM systems write two or three decimals

/// Returns the number of the tool that a comment describes; empty if it gives no number and the
/// program calls no tool.
std::optional<int> comment_tool_number(const ToolComment& comment,
                                       const std::vector<program::ToolCall>& calls) {
  if (comment.words.number || calls.empty()) return comment.words.number;
  const auto next_call = std::ranges::find_if(
      calls, [&](const program::ToolCall& call) { return call.before >= comment.before; });
  return next_call == calls.end() ? calls.back().number : next_call->number;
}

/// Returns the tool of the scene that a comment describes; null if that tool does not cut.
const ToolDescription* commented_tool(const ToolComment& comment,
                                      const std::vector<program::ToolCall>& calls,
                                      std::span<const ToolDescription> tools) {
  const std::optional<int> number = comment_tool_number(comment, calls);
  if (number && !calls.empty() &&
      std::ranges::none_of(calls, [&](const auto& call) { return call.number == *number; }))
    return nullptr;
  for (const ToolDescription& tool : tools)
    if (!tool.number || !number || *tool.number == *number) return &tool;
  return nullptr;
}

std::string cutter_difference(const CutterData& data, const cutting::Cutter& cutter) {
  std::vector<std::string> differences;
  if (std::abs(data.diameter - 2.0 * cutter.radius) > dimension_tolerance)
    differences.push_back(fmt::format("{:.6g} mm diameter, but the scene's tool has {:.6g} mm",
                                      data.diameter, 2.0 * cutter.radius));
  std::optional<double> corner = data.corner_radius;
  if (!corner && data.end == CutterData::End::Flat) corner = 0.0;
  if (!corner && data.end == CutterData::End::Ball) corner = 0.5 * data.diameter;
  if (corner && std::abs(*corner - cutter.corner_radius) > dimension_tolerance)
    differences.push_back(fmt::format("{:.6g} mm corner radius, but the scene's tool has {:.6g} mm",
                                      *corner, cutter.corner_radius));
  return fmt::format("{}", fmt::join(differences, "; "));
}

}  // namespace

std::vector<std::string> tool_comment_warnings(const program::Path& path,
                                               std::span<const ToolDescription> tools) {
  const std::vector<program::ToolCall> calls = cutting_calls(path);
  std::vector<std::string> warnings;
  // CAM systems may repeat a comment at every call.
  std::set<std::string> reported;
  for (const ToolComment& comment : path.tool_comments) {
    const ToolDescription* tool = commented_tool(comment, calls, tools);
    const auto* cutter = tool ? std::get_if<cutting::Cutter>(&tool->nominal) : nullptr;
    if (cutter == nullptr) continue;
    const std::string difference = cutter_difference(comment.words, *cutter);
    if (difference.empty() || !reported.insert(difference).second) continue;
    warnings.push_back(
        fmt::format("line {} says \"{}\": {}", comment.line, comment.text, difference));
  }
  return warnings;
}

namespace {

using kinematics::Pose;

// Returns the wear after a use as a fraction of the stated wear, by time or by path length.
double wear_fraction(const ToolWear& wear, const FeedUse& use) {
  return wear.time_s ? use.time_s / *wear.time_s : use.distance / *wear.distance;
}

/// Returns a pose between two others: the tip on a line, the axis on a great circle.
Pose interpolate_pose(const Pose& a, const Pose& b, double fraction) {
  Pose T = a;
  T.translation() = (1.0 - fraction) * a.translation() + fraction * b.translation();
  const Eigen::Vector3d from = a.linear().col(2), to = b.linear().col(2);
  const Eigen::Quaterniond rotation = Eigen::Quaterniond::FromTwoVectors(from, to);
  T.linear() =
      Eigen::Quaterniond::Identity().slerp(fraction, rotation).toRotationMatrix() * a.linear();
  return T;
}

/// Divides a sweep into segments with the same loss of radius in each.
class WearSegmenter {
 public:
  WearSegmenter(const cutting::Cutter& cutter, double step) : cutter_(cutter), step_(step) {}

  void add(const program::Samples& samples, std::size_t sample, const Pose& T_wt, double loss) {
    if (segments_.empty()) begin(loss);
    const Entry sample_entry{samples.states[sample], samples.line[sample], samples.block[sample],
                             T_wt};
    // A move beyond the end of a segment is divided there, so that neighbouring segments share a
    // pose and leave no gap.
    while (last_entry_ && loss > end_) {
      const double fraction = (end_ - last_loss_) / (loss - last_loss_);
      Entry divided = sample_entry;
      divided.T_wt = interpolate_pose(last_entry_->T_wt, T_wt, fraction);
      divided.state.time_s = last_entry_->state.time_s +
                             fraction * (sample_entry.state.time_s - last_entry_->state.time_s);
      append(divided);
      last_loss_ = end_;
      begin(end_);
      append(divided);
      last_entry_ = divided;
    }
    append(sample_entry);
    last_entry_ = sample_entry;
    last_loss_ = loss;
  }
  std::deque<WornSegment> take() { return std::move(segments_); }

 private:
  struct Entry {
    kinematics::AxisState state;
    int line = 0, block = 0;
    Pose T_wt;
  };

  void begin(double loss) {
    // The cutter in the middle of the segment differs from the worn one by half a step at most.
    segments_.push_back({worn_cutter(cutter_, loss + 0.5 * step_), {}, {}});
    end_ = loss + step_;
  }
  void append(const Entry& entry) {
    WornSegment& segment = segments_.back();
    segment.samples.states.push_back(entry.state);
    segment.samples.line.push_back(entry.line);
    segment.samples.block.push_back(entry.block);
    segment.T_wt.push_back(entry.T_wt);
  }

  const cutting::Cutter& cutter_;
  double step_;                         // mm, loss of radius in a segment
  double end_ = 0.0, last_loss_ = 0.0;  // mm, at the end of the segment, and at the last entry
  std::optional<Entry> last_entry_;
  std::deque<WornSegment> segments_;
};

std::string tool_label(const ToolDescription& tool) {
  if (tool.number) return fmt::format("T{}", *tool.number);
  return tool.name.empty() ? "the tool" : tool.name;
}

/// Returns (samples) the use of the tool of a part up to each sample, with its earlier use.
std::vector<FeedUse> feed_use(const ToolRun& part) {
  std::vector<FeedUse> uses(part.samples.states.size(), part.before);
  FeedUse use = part.before;
  for (std::size_t i = 1; i < uses.size(); ++i) {
    if (is_feed_sample(part.path, part.samples, i)) {
      use.time_s += part.samples.states[i].time_s - part.samples.states[i - 1].time_s;
      use.distance += (part.T_wt[i].translation() - part.T_wt[i - 1].translation()).norm();
    }
    uses[i] = use;
  }
  return uses;
}

/// Returns the largest difference between the cutters of the segments and the worn cutter, mm.
/// @param loss  of radius over the whole sweep, mm
double wear_step(double loss) {
  // A segment has the cutter of its middle, which differs by half of its loss from both ends.
  return std::max(wear_tolerance, 0.5 * loss / double(max_wear_segments));
}

}  // namespace

std::vector<FeedUse> previous_uses(std::span<const ToolRun> parts) {
  std::map<int, FeedUse> use_by_tool;
  std::vector<FeedUse> result;
  for (ToolRun part : parts) {
    // A tool without number is the only one.
    FeedUse& use = use_by_tool[part.tool.number.value_or(0)];
    result.push_back(use);
    part.before = use;
    const std::vector<FeedUse> uses = feed_use(part);
    if (!uses.empty()) use = uses.back();
  }
  return result;
}

std::vector<double> wear_fractions(const ToolRun& part, const program::Samples& samples) {
  const auto& wear = part.tool.wear;
  if (!wear) return {};
  const std::vector<FeedUse> uses = feed_use(part);
  const auto& part_states = part.samples.states;
  std::vector<double> fractions(samples.states.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < fractions.size(); ++i) {
    const double time_s = samples.states[i].time_s;
    while (k + 1 < part_states.size() && part_states[k + 1].time_s <= time_s) ++k;
    const double fraction = wear_fraction(*wear, uses[k]);
    const double step =
        k + 1 < part_states.size() ? part_states[k + 1].time_s - part_states[k].time_s : 0.0;
    const double next_fraction = step > 0.0 ? wear_fraction(*wear, uses[k + 1]) : fraction;
    const double position =
        step > 0.0 ? std::clamp((time_s - part_states[k].time_s) / step, 0.0, 1.0) : 0.0;
    fractions[i] = fraction + position * (next_fraction - fraction);
  }
  return fractions;
}

cutting::Cutter worn_cutter(const cutting::Cutter& cutter, double loss) {
  cutting::Cutter result = cutter;
  // A sweep needs a cutter, however much wear is stated.
  result.radius = std::max(cutter.radius - loss, 0.25 * cutter.radius);
  const bool is_ball = cutter.corner_radius == cutter.radius;
  result.corner_radius = is_ball ? result.radius : std::min(cutter.corner_radius, result.radius);
  return result;
}

std::deque<WornSegment> worn_segments(const ToolDescription& tool,
                                      const std::vector<double>& fractions,
                                      const program::Samples& samples,
                                      const std::vector<Pose>& T_wt) {
  if (fractions.empty()) return {};
  const double radius = tool.wear->radius;
  const double total_loss = radius * (fractions.back() - fractions.front());
  WearSegmenter segmenter(std::get<cutting::Cutter>(tool.actual), 2.0 * wear_step(total_loss));
  for (std::size_t i = 0; i < fractions.size(); ++i)
    segmenter.add(samples, i, T_wt[i], radius * fractions[i]);
  return segmenter.take();
}

std::vector<WornTool> worn_tools(std::span<const ToolRun> parts) {
  std::vector<WornTool> tools;
  for (const ToolRun& part : parts) {
    const std::vector<FeedUse> uses = feed_use(part);
    const ToolDescription& tool = part.tool;
    if (!tool.wear || uses.empty()) continue;
    const double fraction = wear_fraction(*tool.wear, uses.back());
    const double part_fraction = fraction - wear_fraction(*tool.wear, uses.front());
    WornTool worn_tool{
        tool_label(tool), uses.back(), fraction * tool.wear->radius, fraction * tool.wear->length,
        tool.wear->radius > 0.0 ? wear_step(part_fraction * tool.wear->radius) : 0.0};
    const auto previous = std::find_if(tools.begin(), tools.end(), [&](const WornTool& listed) {
      return listed.tool == worn_tool.tool;
    });
    // The wear of a tool that is called again continues, so its last use counts.
    if (previous == tools.end()) {
      tools.push_back(std::move(worn_tool));
    } else {
      worn_tool.within = std::max(worn_tool.within, previous->within);
      *previous = std::move(worn_tool);
    }
  }
  return tools;
}

std::vector<std::string> wear_warnings(const std::vector<WornTool>& tools) {
  std::vector<std::string> warnings;
  for (const WornTool& worn_tool : tools) {
    std::string text = fmt::format(
        "{} is assumed to lose {:.4g} um of its radius and {:.4g} um of its length, in proportion, "
        "over {:.4g} min and {:.6g} mm of feed path; stock and force are those of the new cutter",
        worn_tool.tool, worn_tool.radius / units::um, worn_tool.length / units::um,
        worn_tool.use.time_s / 60.0, worn_tool.use.distance);
    if (worn_tool.within > wear_tolerance)
      text += fmt::format("; its sweep follows the worn radius within {:.3g} um, in {} segments",
                          worn_tool.within / units::um, max_wear_segments);
    warnings.push_back(std::move(text));
  }
  return warnings;
}

}  // namespace abbe::sim
