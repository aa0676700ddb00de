#include "sim/cut/wear.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/units.h"

namespace abbe::sim {
namespace {

using kinematics::Pose;

double share_of(const ToolWear& wear, const FeedUse& use) {
  return wear.time_s ? use.time_s / *wear.time_s : use.way / *wear.way;
}

/// A pose between two, on line and great circle.
Pose between(const Pose& a, const Pose& b, double u) {
  Pose T = a;
  T.translation() = (1.0 - u) * a.translation() + u * b.translation();
  const Eigen::Vector3d from = a.linear().col(2), to = b.linear().col(2);
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(from, to);
  T.linear() = Eigen::Quaterniond::Identity().slerp(u, turn).toRotationMatrix() * a.linear();
  return T;
}

/// Takes samples one after the other into pieces of equal loss.
class PieceCutter {
 public:
  PieceCutter(const cutting::Cutter& cutter, double step) : cutter_(cutter), step_(step) {}

  void add(const program::Samples& samples, std::size_t i, const Pose& T_wt, double lost) {
    if (pieces_.empty()) begin(lost);
    const Entry now{samples.states[i], samples.line[i], samples.block[i], T_wt};
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
  std::deque<WornPiece> take() { return std::move(pieces_); }

 private:
  struct Entry {
    kinematics::AxisState state;
    int line = 0, block = 0;
    Pose T_wt;
  };

  void begin(double lost) {
    pieces_.push_back({worn(cutter_, lost + 0.5 * step_), {}, {}});
    end_ = lost + step_;
  }
  void put(const Entry& entry) {
    WornPiece& piece = pieces_.back();
    piece.samples.states.push_back(entry.state);
    piece.samples.line.push_back(entry.line);
    piece.samples.block.push_back(entry.block);
    piece.T_wt.push_back(entry.T_wt);
  }

  const cutting::Cutter& cutter_;
  double step_, end_ = 0.0, lost_ = 0.0;
  std::optional<Entry> last_;
  std::deque<WornPiece> pieces_;
};

std::string label_of(const ToolDescription& tool) {
  if (tool.number) return fmt::format("T{}", *tool.number);
  return tool.name.empty() ? "the tool" : tool.name;
}

}  // namespace

std::vector<FeedUse> feed_use(const CutPart& part) {
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

std::vector<FeedUse> uses_before(std::span<const CutPart> parts) {
  std::map<int, FeedUse> done;
  std::vector<FeedUse> before;
  for (CutPart part : parts) {
    FeedUse& use = done[part.tool.number.value_or(0)];
    before.push_back(use);
    part.before = use;
    const std::vector<FeedUse> uses = feed_use(part);
    if (!uses.empty()) use = uses.back();
  }
  return before;
}

std::vector<double> wear_shares(const CutPart& part, const program::Samples& samples) {
  const auto& wear = part.tool.wear;
  if (!wear) return {};
  const std::vector<FeedUse> uses = feed_use(part);
  const auto& own = part.samples.states;
  std::vector<double> shares(samples.states.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < shares.size(); ++i) {
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
  smaller.radius = std::max(cutter.radius - lost, 0.25 * cutter.radius);
  const bool ball = cutter.corner_radius == cutter.radius;
  smaller.corner_radius = ball ? smaller.radius : std::min(cutter.corner_radius, smaller.radius);
  return smaller;
}

double wear_step(double lost) {
  return std::max(wear_within, 0.5 * lost / double(most_wear_pieces));
}

std::deque<WornPiece> worn_pieces(const ToolDescription& tool, const std::vector<double>& shares,
                                  const program::Samples& samples, const std::vector<Pose>& T_wt) {
  if (shares.empty()) return {};
  const double radius = tool.wear->radius;
  const double all = radius * (shares.back() - shares.front());
  PieceCutter cutter(std::get<cutting::Cutter>(tool.actual), 2.0 * wear_step(all));
  for (std::size_t i = 0; i < shares.size(); ++i)
    cutter.add(samples, i, T_wt[i], radius * shares[i]);
  return cutter.take();
}

std::vector<WornTool> worn_tools(std::span<const CutPart> parts) {
  std::vector<WornTool> tools;
  for (const CutPart& part : parts) {
    const std::vector<FeedUse> uses = feed_use(part);
    const ToolDescription& tool = part.tool;
    if (!tool.wear || uses.empty()) continue;
    const double share = share_of(*tool.wear, uses.back());
    const double in_part = share - share_of(*tool.wear, uses.front());
    WornTool one{label_of(tool), uses.back(), share * tool.wear->radius, share * tool.wear->length,
                 tool.wear->radius > 0.0 ? wear_step(in_part * tool.wear->radius) : 0.0};
    const auto same = std::find_if(tools.begin(), tools.end(),
                                   [&](const WornTool& other) { return other.tool == one.tool; });
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
    if (one.within > wear_within)
      text += fmt::format("; its sweep follows the worn radius within {:.3g} um, in {} pieces",
                          one.within / units::um, most_wear_pieces);
    warnings.push_back(std::move(text));
  }
  return warnings;
}

}  // namespace abbe::sim
