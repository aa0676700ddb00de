#include "sim/program/milling_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "kinematics/inverse.h"

namespace abbe::sim::program {
namespace {

using kinematics::AxisVector;
using kinematics::Motion;
using kinematics::Reach;

class Writer {
 public:
  Writer(const MillingTextOptions& options, const GenerateContext& context, double safe_z)
      : options_(options),
        context_(context),
        five_axis_(has_rotary_axes(context.control)),
        safe_z_(safe_z) {
    axes_ = AxisVector::Zero(context.control.size());
    // rounded so that a feed of 1000 mm/min is written as such
    feed_ = std::round(options.feed * 60.0 * 1e6) / 1e6;
  }

  void head();
  void pass(const Pass& pass);
  MillingProgram program();

 private:
  Reach reach(const Posture& posture);
  void leave_out(const Posture& posture, Reach why);
  AxisVector words(const Eigen::Vector3d& tip_w) const;
  void rapid(const Eigen::Vector3d& tip_w) { items_.push_back(NcMove{true, words(tip_w), 0.0}); }
  void cut(const Eigen::Vector3d& tip_w) { items_.push_back(NcMove{false, words(tip_w), feed_}); }
  Eigen::Vector3d above(const Eigen::Vector3d& tip_w) const {
    return {tip_w.x(), tip_w.y(), safe_z_};
  }
  Eigen::Vector3d clear_of(const Posture& posture) const {
    return posture.tip_w + options_.clearance * posture.retreat_w;
  }
  void enter(const Posture& posture);
  void leave(const Posture& posture);

  const MillingTextOptions& options_;
  const GenerateContext& context_;
  const bool five_axis_;
  const double safe_z_;
  double feed_ = 0.0;
  AxisVector axes_;                    ///< of the last posture reached
  std::optional<Eigen::Vector3d> at_;  ///< clear of the part, where the tip stands between passes
  bool cuts_ = false;
  std::vector<NcItem> items_;
  Unreached unreached_;
};

Reach Writer::reach(const Posture& posture) {
  const auto result =
      kinematics::inverse(context_.control, {posture.tip_w, posture.direction_w}, axes_);
  if (!result.branches.empty()) axes_ = result.branches.front();
  return result.reach;
}

void Writer::leave_out(const Posture& posture, Reach why) {
  if (options_.whole)
    throw std::invalid_argument(fmt::format(
        "a pass with a pose that it does not reach, at ({:.3f}, {:.3f}, {:.3f}) mm of the "
        "workpiece",
        posture.tip_w.x(), posture.tip_w.y(), posture.tip_w.z()));
  if (unreached_.points++ > 0) return;
  unreached_.first_pass = unreached_.all_passes;
  unreached_.why = why;
  unreached_.tip_w = posture.tip_w;
}

AxisVector Writer::words(const Eigen::Vector3d& tip_w) const {
  AxisVector q = axes_;
  if (five_axis_) {
    q[*context_.control.find('X')] = tip_w.x();
    q[*context_.control.find('Y')] = tip_w.y();
    q[*context_.control.find('Z')] = tip_w.z();
    return q;
  }
  const auto slides = kinematics::slides_for_tip(context_.control, q, tip_w);
  if (!slides) throw std::invalid_argument("expected a machine with three independent slides");
  return *slides;
}

void Writer::head() {
  items_.push_back("(" + options_.title + ")");
  items_.push_back("G17 G21 G90 G94 G54");
  items_.push_back(five_axis_ ? fmt::format("G43.4 H{}", context_.h_number) : "G49");
  items_.push_back(fmt::format("S{} M3", nc_number(options_.speed_rpm, 3)));
}

/// To the clear point of a posture whose axes are reached already.
void Writer::enter(const Posture& posture) {
  const Eigen::Vector3d clear = clear_of(posture);
  const bool near = at_ && (*at_ - clear).norm() <= options_.neighbour;
  if (!at_)
    items_.push_back(fmt::format(
        "G0 Z{}",
        nc_number(words(above(clear))[*context_.control.find('Z')], options_.format.decimals_mm)));
  if (!near) rapid(above(clear));
  rapid(clear);
  cut(posture.tip_w);
}

void Writer::leave(const Posture& posture) {
  at_ = clear_of(posture);
  rapid(*at_);
}

void Writer::pass(const Pass& pass) {
  const Posture* last = nullptr;
  ++unreached_.all_passes;
  unreached_.all_points += int(pass.size());
  int reached_points = 0;
  for (const Posture& posture : pass) {
    const AxisVector before = axes_;
    const Reach reach_of_it = reach(posture);
    if (reach_of_it == Reach::OutOfLimits || reach_of_it == Reach::Unreachable) {
      leave_out(posture, reach_of_it);
      if (last) leave(*last);
      last = nullptr;
      continue;
    }
    ++reached_points;
    if (last) {
      cut(posture.tip_w);
    } else {
      // The way up from the pass before is made with the axes as they were there.
      const AxisVector reached = axes_;
      const bool far = at_ && (*at_ - clear_of(posture)).norm() > options_.neighbour;
      axes_ = before;
      if (far) rapid(above(*at_));
      axes_ = reached;
      enter(posture);
    }
    cuts_ = true;
    last = &posture;
  }
  if (last) leave(*last);
  if (reached_points == 0) ++unreached_.passes;
  if (reached_points > 0 && reached_points < int(pass.size())) ++unreached_.broken_passes;
}

MillingProgram Writer::program() {
  if (!cuts_) throw NothingReached(unreached_);
  rapid(above(*at_));
  items_.push_back("M5");
  items_.push_back("M2");
  const std::vector<ControlledAxis> axes = controlled_axes(context_.control);
  return {write_nc(items_, axes, {.format = options_.format, .inverse_time = false}), unreached_};
}

}  // namespace

bool has_rotary_axes(const kinematics::Chain& chain) {
  return std::any_of(chain.joints().begin(), chain.joints().end(),
                     [](const kinematics::Joint& joint) {
                       return joint.motion == Motion::Rotary && joint.name != 'S';
                     });
}

std::vector<ControlledAxis> controlled_axes(const kinematics::Chain& chain) {
  std::vector<ControlledAxis> axes;
  for (const kinematics::Joint& joint : chain.joints()) axes.push_back({joint.name, joint.motion});
  return axes;
}

MillingProgram milling_text(const std::vector<Pass>& passes, const MillingTextOptions& options,
                            const GenerateContext& context) {
  for (const char letter : {'X', 'Y', 'Z'})
    if (!context.control.find(letter))
      throw std::invalid_argument("expected a machine with the axes X Y Z");
  double highest = -std::numeric_limits<double>::infinity();
  for (const Pass& pass : passes)
    for (const Posture& posture : pass) highest = std::max(highest, posture.tip_w.z());
  Writer writer(options, context, highest + options.clearance + 2 * options.cutter_radius);
  writer.head();
  for (const Pass& pass : passes) writer.pass(pass);
  return writer.program();
}

}  // namespace abbe::sim::program
