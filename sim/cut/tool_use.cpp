#include "sim/cut/tool_use.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::sim {

namespace {

/// Returns the calls that put a tool into the spindle: M6, or T if the program has no M6.
std::vector<program::ToolCall> changes_of(const program::Path& path) {
  const bool with_m6 = std::any_of(path.tool_calls.begin(), path.tool_calls.end(),
                                   [](const program::ToolCall& call) { return call.changes; });
  std::vector<program::ToolCall> calls;
  for (const program::ToolCall& call : path.tool_calls)
    if (call.changes == with_m6) calls.push_back(call);
  return calls;
}

}  // namespace

std::vector<program::ToolCall> cutting_calls(const program::Path& path) {
  const std::vector<program::ToolCall> calls = changes_of(path);
  std::vector<program::ToolCall> cutting;
  for (std::size_t i = 0; i < calls.size(); ++i) {
    const auto first = path.blocks.begin() + std::ptrdiff_t(calls[i].before);
    const auto last = i + 1 < calls.size()
                          ? path.blocks.begin() + std::ptrdiff_t(calls[i + 1].before)
                          : path.blocks.end();
    if (std::any_of(first, last, program::is_feed)) cutting.push_back(calls[i]);
  }
  return cutting;
}

namespace {

// Returns the name of a called tool for messages.
std::string name_of(const program::ToolCall& call) {
  return call.number < 0 ? "M6 without a T" : fmt::format("T{}", call.number);
}

/// Returns the warning about feed before the first call of a tool that cuts.
std::vector<std::string> early_feed_warnings(const program::Path& path,
                                             const std::vector<program::ToolCall>& calls,
                                             const std::string& with) {
  if (calls.empty()) return {};
  const auto called = path.blocks.begin() + std::ptrdiff_t(calls.front().before);
  const auto early = std::find_if(path.blocks.begin(), called, program::is_feed);
  if (early == called) return {};
  return {
      fmt::format("line {} feeds before the first tool is called, {} on line {}: it is cut with "
                  "{}",
                  early->line, name_of(calls.front()), calls.front().line, with)};
}

ToolUse single_tool_use(const program::Path& path, const ToolDescription& tool) {
  const std::vector<program::ToolCall> calls = cutting_calls(path);
  ToolUse use{{{0, 0, path.blocks.size()}},
              early_feed_warnings(path, calls, "the scene's tool as well")};
  if (calls.empty()) return use;
  const program::ToolCall& first = calls.front();
  for (const program::ToolCall& call : calls) {
    if (tool.number && call.number != *tool.number)
      throw BadInput(path.file, call.line, 0,
                     fmt::format("T{}, which is the scene's tool.number", *tool.number),
                     fmt::format("{}: describe it in a [[tool]] of its own, or give tool.number = "
                                 "{} if the scene's is that",
                                 name_of(call), call.number));
    if (call.number != first.number)
      throw BadInput(path.file, call.line, 0,
                     fmt::format("one tool, {} of line {}, as the scene has one; several are "
                                 "described by a [[tool]] each, with its number",
                                 name_of(first), first.line),
                     name_of(call));
  }
  if (!tool.number)
    use.warnings.push_back(
        fmt::format("{} on line {} is cut with the scene's tool{}: give tool.number if it is that",
                    name_of(first), first.line, tool.name.empty() ? "" : " " + tool.name));
  return use;
}

// Returns the number of the described tool that a call names; throws BadInput if there is none.
std::size_t described(const program::Path& path, const program::ToolCall& call,
                      std::span<const ToolDescription> tools) {
  std::string known;
  for (std::size_t i = 0; i < tools.size(); ++i) {
    if (tools[i].number == call.number) return i;
    known += fmt::format("{}T{}", known.empty() ? "" : ", ", *tools[i].number);
  }
  throw BadInput(path.file, call.line, 0,
                 fmt::format("a tool that a [[tool]] of the scene describes ({})", known),
                 name_of(call));
}

/// Appends a segment; if it has the same tool as the last one, that is extended.
void add(std::vector<ToolSegment>& stretches, const ToolSegment& next) {
  if (next.first == next.last) return;
  if (!stretches.empty() && stretches.back().tool == next.tool)
    stretches.back().last = next.last;
  else
    stretches.push_back(next);
}

ToolUse several_tool_use(const program::Path& path, std::span<const ToolDescription> tools) {
  const std::vector<program::ToolCall> calls = cutting_calls(path);
  ToolUse use{
      {},
      early_feed_warnings(path, calls, fmt::format("T{}, the scene's first", *tools[0].number))};
  std::vector<bool> runs(tools.size(), false);
  // rapids before the first call approach the part with the tool that is called
  std::size_t tool =
      calls.empty() || !use.warnings.empty() ? 0 : described(path, calls.front(), tools);
  std::size_t first = 0;
  for (const program::ToolCall& call : calls) {
    add(use.stretches, {tool, first, call.before});
    tool = described(path, call, tools);
    first = call.before;
    runs[tool] = true;
  }
  add(use.stretches, {tool, first, path.blocks.size()});
  for (const ToolSegment& stretch : use.stretches)
    for (std::string& one : length_warnings(path, stretch, *tools[stretch.tool].number))
      use.warnings.push_back(std::move(one));
  if (calls.empty())
    use.warnings.push_back(
        fmt::format("the program calls no tool: all of it is cut with T{}, the scene's first",
                    *tools[0].number));
  for (std::size_t i = 0; i < tools.size() && !calls.empty(); ++i)
    if (!runs[i])
      use.warnings.push_back(fmt::format(
          "T{} of the scene cuts nothing: the program does not call it", *tools[i].number));
  return use;
}

}  // namespace

std::vector<std::string> length_warnings(const program::Path& path, const ToolSegment& stretch,
                                         int number) {
  for (std::size_t i = stretch.first; i < stretch.last; ++i) {
    const program::Block& block = path.blocks[i];
    if (block.tool_length < 0 || block.tool_length == number) continue;
    // under G43.4 the wrong length moves the axes, not only the height, so it is an error
    if (block.coordinates == program::Coordinates::Tip)
      throw BadInput(path.file, block.line, 0,
                     fmt::format("G43.4 H{}, the length of T{}, which runs here", number, number),
                     fmt::format("H{}", block.tool_length));
    if (program::is_feed(block))
      return {fmt::format("from line {} on T{} runs with the length H{} of G43, not its own",
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

constexpr double same_mm = 0.01;  // CAM systems write two or three decimals

/// Returns the number of the tool that a comment describes; none if nothing is called.
std::optional<int> comment_tool_number(const ToolComment& comment,
                                       const std::vector<program::ToolCall>& calls) {
  if (comment.words.number || calls.empty()) return comment.words.number;
  const auto next = std::ranges::find_if(
      calls, [&](const program::ToolCall& call) { return call.before >= comment.before; });
  return next == calls.end() ? calls.back().number : next->number;
}

/// Returns the tool of the scene that a comment describes; null if it does not cut.
const ToolDescription* tool_of(const ToolComment& comment,
                               const std::vector<program::ToolCall>& calls,
                               std::span<const ToolDescription> tools) {
  const std::optional<int> number = comment_tool_number(comment, calls);
  if (number && !calls.empty() &&
      std::ranges::none_of(calls, [&](const auto& call) { return call.number == *number; }))
    return nullptr;  // the tool does not cut
  for (const ToolDescription& tool : tools)
    if (!tool.number || !number || *tool.number == *number) return &tool;
  return nullptr;
}

std::string cutter_difference(const CutterData& words, const cutting::Cutter& cutter) {
  std::vector<std::string> all;
  if (std::abs(words.diameter - 2.0 * cutter.radius) > same_mm)
    all.push_back(fmt::format("{:.6g} mm in diameter, and the scene's has {:.6g} mm",
                              words.diameter, 2.0 * cutter.radius));
  std::optional<double> corner = words.corner_radius;
  if (!corner && words.end == CutterData::End::Flat) corner = 0.0;
  if (!corner && words.end == CutterData::End::Ball) corner = 0.5 * words.diameter;
  if (corner && std::abs(*corner - cutter.corner_radius) > same_mm)
    all.push_back(fmt::format("{:.6g} mm of corner radius, and the scene's has {:.6g} mm", *corner,
                              cutter.corner_radius));
  return fmt::format("{}", fmt::join(all, "; "));
}

}  // namespace

std::vector<std::string> tool_comment_warnings(const program::Path& path,
                                               std::span<const ToolDescription> tools) {
  const std::vector<program::ToolCall> calls = cutting_calls(path);
  std::vector<std::string> warnings;
  // a comment repeated at every call is reported once
  std::set<std::string> said;
  for (const ToolComment& comment : path.tool_comments) {
    const ToolDescription* tool = tool_of(comment, calls, tools);
    const auto* cutter = tool ? std::get_if<cutting::Cutter>(&tool->nominal) : nullptr;
    if (cutter == nullptr) continue;
    const std::string differs = cutter_difference(comment.words, *cutter);
    if (differs.empty() || !said.insert(differs).second) continue;
    warnings.push_back(fmt::format("line {} says \"{}\": {}", comment.line, comment.text, differs));
  }
  return warnings;
}

namespace {

using kinematics::Pose;

// Returns the wear of a tool as a fraction of its stated wear, by time or by path length.
double share_of(const ToolWear& wear, const FeedUse& use) {
  return wear.time_s ? use.time_s / *wear.time_s : use.way / *wear.way;
}

/// Returns a pose between two others: the tip on a line, the axis on a great circle.
Pose between(const Pose& a, const Pose& b, double u) {
  Pose T = a;
  T.translation() = (1.0 - u) * a.translation() + u * b.translation();
  const Eigen::Vector3d from = a.linear().col(2), to = b.linear().col(2);
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(from, to);
  T.linear() = Eigen::Quaterniond::Identity().slerp(u, turn).toRotationMatrix() * a.linear();
  return T;
}

/// Divides a sweep into segments of equal loss of radius.
class WearSegmenter {
 public:
  WearSegmenter(const cutting::Cutter& cutter, double step) : cutter_(cutter), step_(step) {}

  void add(const program::Samples& samples, std::size_t i, const Pose& T_wt, double lost) {
    if (pieces_.empty()) begin(lost);
    const Entry now{samples.states[i], samples.line[i], samples.block[i], T_wt};
    // A sample beyond the end of a segment is cut there, so that neighbouring segments share a pose
    // and leave no gap.
    while (last_ && lost > end_) {
      const double u = (end_ - lost_) / (lost - lost_);
      Entry cut = now;
      cut.T_wt = between(last_->T_wt, T_wt, u);
      cut.state.time_s = last_->state.time_s + u * (now.state.time_s - last_->state.time_s);
      put(cut);
      lost_ = end_;
      begin(end_);
      put(cut);
      last_ = cut;
    }
    put(now);
    last_ = now;
    lost_ = lost;
  }
  std::deque<WornSegment> take() { return std::move(pieces_); }

 private:
  struct Entry {
    kinematics::AxisState state;
    int line = 0, block = 0;
    Pose T_wt;
  };

  void begin(double lost) {
    // the cutter of the middle of the segment: it differs from the worn one by half a step at most
    pieces_.push_back({worn(cutter_, lost + 0.5 * step_), {}, {}});
    end_ = lost + step_;
  }
  void put(const Entry& entry) {
    WornSegment& piece = pieces_.back();
    piece.samples.states.push_back(entry.state);
    piece.samples.line.push_back(entry.line);
    piece.samples.block.push_back(entry.block);
    piece.T_wt.push_back(entry.T_wt);
  }

  const cutting::Cutter& cutter_;
  double step_, end_ = 0.0, lost_ = 0.0;
  std::optional<Entry> last_;
  std::deque<WornSegment> pieces_;
};

std::string label_of(const ToolDescription& tool) {
  if (tool.number) return fmt::format("T{}", *tool.number);
  return tool.name.empty() ? "the tool" : tool.name;
}

}  // namespace

std::vector<FeedUse> feed_use(const ToolRun& part) {
  std::vector<FeedUse> uses(part.samples.states.size(), part.before);
  FeedUse use = part.before;
  for (std::size_t i = 1; i < uses.size(); ++i) {
    if (program::is_feed(part.path.blocks[std::size_t(part.samples.block[i])])) {
      use.time_s += part.samples.states[i].time_s - part.samples.states[i - 1].time_s;
      use.way += (part.T_wt[i].translation() - part.T_wt[i - 1].translation()).norm();
    }
    uses[i] = use;
  }
  return uses;
}

std::vector<FeedUse> previous_uses(std::span<const ToolRun> parts) {
  std::map<int, FeedUse> done;
  std::vector<FeedUse> before;
  for (ToolRun part : parts) {
    // tools without a number are one tool
    FeedUse& use = done[part.tool.number.value_or(0)];
    before.push_back(use);
    part.before = use;
    const std::vector<FeedUse> uses = feed_use(part);
    if (!uses.empty()) use = uses.back();
  }
  return before;
}

std::vector<double> wear_fractions(const ToolRun& part, const program::Samples& samples) {
  const auto& wear = part.tool.wear;
  if (!wear) return {};
  const std::vector<FeedUse> uses = feed_use(part);
  const auto& own = part.samples.states;
  std::vector<double> shares(samples.states.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    // both lists ascend in time, so one pass suffices
    const double time_s = samples.states[i].time_s;
    while (k + 1 < own.size() && own[k + 1].time_s <= time_s) ++k;
    const double at = share_of(*wear, uses[k]);
    const double step = k + 1 < own.size() ? own[k + 1].time_s - own[k].time_s : 0.0;
    const double next = step > 0.0 ? share_of(*wear, uses[k + 1]) : at;
    const double u = step > 0.0 ? std::clamp((time_s - own[k].time_s) / step, 0.0, 1.0) : 0.0;
    shares[i] = at + u * (next - at);
  }
  return shares;
}

cutting::Cutter worn(const cutting::Cutter& cutter, double lost) {
  cutting::Cutter smaller = cutter;
  // a quarter of the radius at least: a sweep needs a cutter, however much wear is stated
  smaller.radius = std::max(cutter.radius - lost, 0.25 * cutter.radius);
  const bool ball = cutter.corner_radius == cutter.radius;
  smaller.corner_radius = ball ? smaller.radius : std::min(cutter.corner_radius, smaller.radius);
  return smaller;
}

double wear_step(double lost) {
  // half of a segment's loss: a cutter stands for the middle of its segment
  return std::max(wear_tolerance, 0.5 * lost / double(max_wear_pieces));
}

std::deque<WornSegment> worn_segments(const ToolDescription& tool,
                                      const std::vector<double>& shares,
                                      const program::Samples& samples,
                                      const std::vector<Pose>& T_wt) {
  if (shares.empty()) return {};
  const double radius = tool.wear->radius;
  const double all = radius * (shares.back() - shares.front());
  WearSegmenter cutter(std::get<cutting::Cutter>(tool.actual), 2.0 * wear_step(all));
  for (std::size_t i = 0; i < shares.size(); ++i)
    cutter.add(samples, i, T_wt[i], radius * shares[i]);
  return cutter.take();
}

std::vector<WornTool> worn_tools(std::span<const ToolRun> parts) {
  std::vector<WornTool> tools;
  for (const ToolRun& part : parts) {
    const std::vector<FeedUse> uses = feed_use(part);
    const ToolDescription& tool = part.tool;
    if (!tool.wear || uses.empty()) continue;
    const double share = share_of(*tool.wear, uses.back());
    const double in_part = share - share_of(*tool.wear, uses.front());
    WornTool one{label_of(tool), uses.back(), share * tool.wear->radius, share * tool.wear->length,
                 tool.wear->radius > 0.0 ? wear_step(in_part * tool.wear->radius) : 0.0};
    const auto same = std::find_if(tools.begin(), tools.end(),
                                   [&](const WornTool& other) { return other.tool == one.tool; });
    // a tool that is called again goes on wearing: the last entry counts
    if (same == tools.end()) {
      tools.push_back(std::move(one));
    } else {
      one.within = std::max(one.within, same->within);
      *same = std::move(one);
    }
  }
  return tools;
}

std::vector<std::string> wear_warnings(const std::vector<WornTool>& tools) {
  std::vector<std::string> warnings;
  for (const WornTool& one : tools) {
    std::string text = fmt::format(
        "{} is assumed to lose {:.4g} um of its radius and {:.4g} um of its length in {:.4g} min "
        "and {:.6g} mm of the tip at feed, in proportion; stock and force are those of the fresh "
        "cutter",
        one.tool, one.radius / units::um, one.length / units::um, one.use.time_s / 60.0,
        one.use.way);
    if (one.within > wear_tolerance)
      text += fmt::format("; its sweep follows the worn radius within {:.3g} um, in {} pieces",
                          one.within / units::um, max_wear_pieces);
    warnings.push_back(std::move(text));
  }
  return warnings;
}

}  // namespace abbe::sim
