#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/inverse.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/fanuc_machine.h"
#include "sim/dialects/fanuc_turning.h"

namespace abbe::sim::dialects::fanuc {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;

namespace {

constexpr double most_lean = 0.02 * units::deg;  // of the tool from Z of a tilted plane

/// The chain with slides without end: a change of direction does not ask where they are.
Chain with_free_slides(const Chain& chain) {
  std::vector<Joint> joints = chain.joints();
  for (Joint& joint : joints)
    if (joint.motion == Motion::Linear) {
      joint.min = -1e9;
      joint.max = 1e9;
    }
  return {std::move(joints), chain.T_bw_home(), chain.T_bt_home()};
}

}  // namespace

/// G68.2: origin and Euler angles, about Z, the new X and the new Z.
void Machine::tilt(const Block& block) {
  const Code& code = block[Group::Rotation];
  if (tip_words()) refuse(code.word, "G49 before G68.2");
  if (polar_.on) refuse(code.word, "G15 before G68.2");
  if (const Word& p = block['P']; p && p.value != 0.0)
    refuse(p, "Euler angles I J K beside G68.2: no other way to say a plane");
  const auto turn = [&](char letter, const Eigen::Vector3d& axis) {
    const double by = block[letter] ? angle_of(block[letter]) : 0.0;
    return Eigen::AngleAxisd(by * units::deg, axis);
  };
  for (int k = 0; k < 3; ++k) {
    const Word& word = block[axis_letters[std::size_t(k)]];
    centre_[k] = word ? length(word) : 0.0;
  }
  for (int k = 3; k < 9; ++k)
    if (const Word& word = block[axis_letters[std::size_t(k)]])
      refuse(word, "X Y Z I J K beside G68.2");
  rotation_ = (turn('I', Eigen::Vector3d::UnitZ()) * turn('J', Eigen::Vector3d::UnitX()) *
               turn('K', Eigen::Vector3d::UnitZ()))
                  .toRotationMatrix();
  tilted_ = true;
  apply_frame();
  apply_length(code.word);
}

const Chain& Machine::chain(const Cause& cause) const {
  const program::NcOptions& options = canon_.options();
  const bool has = length_mode_ != 490 && h_ != 0;
  const auto own = options.control_of_h.find(has ? h_ : tool_);
  if (own != options.control_of_h.end()) return own->second;
  if (!options.control) refuse(cause, "a control that knows its kinematics");
  return *options.control;
}

AxisVector Machine::rotary_positions(const Eigen::Vector3d& direction_w, const Cause& cause) {
  const Chain& own = chain(cause);
  if (!free_slides_ || free_slides_of_ != &own) {
    free_slides_ = with_free_slides(own);
    free_slides_of_ = &own;
    ranks_ = turning_ranks(own);
  }
  kinematics::InverseResult found;
  const AxisVector now = canon_.position();  // its rotary joints, in any coordinates
  try {
    found = kinematics::inverse(*free_slides_, {Eigen::Vector3d::Zero(), direction_w}, now);
  } catch (const std::invalid_argument&) {
    refuse(cause, "a machine of three slides and at most two rotary axes beside a direction");
  }
  if (found.branches.empty())
    refuse(
        cause, "a direction that the rotary axes reach",
        fmt::format("{:.6f} {:.6f} {:.6f}{}", direction_w.x(), direction_w.y(), direction_w.z(),
                    found.reach == kinematics::Reach::OutOfLimits ? ", beyond their limits" : ""));
  const AxisVector& best = output_judgement(found.branches, now, ranks_);
  AxisVector q = now;
  for (const int j : ranks_) q[j] = best[j];
  return q;
}

/// G53.1 with the slides at rest, G53.6 with the tip.
void Machine::turn_to_plane(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (!tilted_) refuse(code.word, "G68.2 before " + shown(code.word.text));
  if (const Word* axis = first_axis_word(block))
    refuse(*axis, "a block without axis words beside " + shown(code.word.text));
  const AxisVector turned = rotary_positions(rotation_->col(2), code.word);
  const bool keeps_tip = code.tenths == 536;
  if (!keeps_tip) canon_.go_to(program::Coordinates::Axis, code.word);
  AxisVector end = canon_.position();
  for (const int j : ranks_) end[j] = turned[j];
  canon_.traverse({.end = std::move(end), .cause = code.word});
  canon_.go_to(program::Coordinates::Tip, code.word);
}

/// The same end with the rotary axes where I J K of G43.5 want them.
AxisVector Machine::by_direction(const Block& block, AxisVector end) {
  for (const auto& [j, word, step] : axis_words(block))
    if (canon_.options().axes[std::size_t(j)].motion == Motion::Rotary)
      refuse(*word, "I J K for the direction of the tool under G43.5");
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  const Word* first = nullptr;
  for (int k = 0; k < 3; ++k)
    if (const Word& word = block["IJK"[k]]) {
      direction[k] = argument(word);
      if (first == nullptr) first = &word;
    }
  if (first == nullptr) return end;
  if (!(direction.norm() > 1e-9)) refuse(*first, "a direction I J K that is not zero");
  if (rotation_) direction = *rotation_ * direction;
  const AxisVector turned = rotary_positions(direction.normalized(), *first);
  for (const int j : ranks_) end[j] = turned[j];
  return end;
}

/// In a tilted plane X Y Z are the tip's while the tool stands along Z of the plane; without a
/// length Z would be that of the nose.
void Machine::check_tilted(const Target& target, const Cause& cause) const {
  if (!tilted_ || tip_words()) return;
  const int x = joint(0), y = joint(1), z = joint(2);
  if (!target.has(x) && !target.has(y) && !target.has(z)) return;
  const Eigen::Vector3d tool = chain(cause).tool_in_workpiece(canon_.position()).linear().col(2);
  const Eigen::Vector3d across = rotation_->col(2);
  const double lean = std::atan2(tool.cross(across).norm(), tool.dot(across));
  if (lean > most_lean)
    refuse(cause, "G53.1 or rotary words that turn the tool into Z of the plane before X Y Z",
           fmt::format("a tool that leans by {:.3f} degrees", lean / units::deg));
  if (target.has(z) && (length_mode_ == 490 || h_ == 0))
    refuse(target.cause(z), "G43 H before a Z word in a tilted plane");
}

}  // namespace abbe::sim::dialects::fanuc
