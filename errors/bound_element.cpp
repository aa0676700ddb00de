#include "errors/bound_element.h"

#include <stdexcept>

#include <fmt/format.h>

namespace abbe::errors {
namespace {

using Eigen::Vector3d;
using kinematics::Joint;

[[noreturn]] void refuse(const std::string& who, const std::string& why) {
  throw std::invalid_argument(who + ": " + why);
}

bool is_along(const ElementName& name, const Joint& joint) {
  const Vector3d unit = Vector3d::Unit(name.component() % 3);
  return unit.cross(joint.direction_b).norm() < 1e-9;
}

void check_location(const ElementName& name, const Joint& joint) {
  const std::string who = to_string(name);
  const std::string motion = std::string("E") + name.direction + name.axis;
  if (name.is_angle() && is_along(name, joint))
    refuse(who, "an axis has no squareness about itself; a constant " + motion + " moves its zero");
  if (!name.is_angle() && joint.motion == kinematics::Motion::Linear)
    refuse(who, "a slide has a direction but no place; write a constant " + motion);
  if (!name.is_angle() && is_along(name, joint))
    refuse(who, "a rotation axis has no place along itself; write a constant " + motion);
}

}  // namespace

int joint_of(char axis, const kinematics::Chain& chain, const std::string& who) {
  if (const auto joint = chain.find(axis)) return *joint;
  if (const auto nose = chain.find('s'); nose && axis == 'S') return *nose;
  std::string known;
  for (const Joint& joint : chain.joints())
    known += std::string(known.empty() ? "" : " ") + joint.name;
  refuse(who, fmt::format("expected an axis of the machine ({}), seen {}", known, axis));
}

void check_meaning(const ElementName& name, const Joint& joint) {
  if (name.location) {
    check_location(name, joint);
  } else if (name.axis == 'S' && name.is_angle() && is_along(name, joint)) {
    refuse(to_string(name), "a spindle has no element about its own axis");
  }
}

}  // namespace abbe::errors
