#include "errors/bound_element.h"

#include <cmath>

#include <fmt/format.h>

#include "errors/expect.h"
#include "kinematics/location.h"

namespace abbe::errors {
namespace {

using Eigen::Vector3d;
using kinematics::Joint;

bool is_along(const ElementName& name, const Joint& joint) {
  const Vector3d unit = Vector3d::Unit(name.component() % 3);
  return unit.cross(joint.direction_b).norm() < 1e-9;
}

char letter(const kinematics::Chain& chain, int joint) {
  return chain.joints()[std::size_t(joint)].name;
}

void check_squareness(const ElementName& name, const kinematics::Chain& chain, int joint) {
  const kinematics::LocationElement element =
      kinematics::location_element(chain.joints(), joint, name.component());
  if (element.defined) return;
  const std::string who = to_string(name);
  const char along = char('X' + (name.direction - 'A'));
  if (element.stated_by)
    refuse(who, fmt::format("{} is the reference of {}; write the angle of the two as E{}0{}, "
                            "which has the opposite sign",
                            name.axis, letter(chain, *element.stated_by), name.direction,
                            letter(chain, *element.stated_by)));
  if (!element.reference)
    refuse(who, fmt::format("no other slide of this machine travels across {}, so there is none to "
                            "which {} could be square; its angle to a rotary axis is written as "
                            "that axis's",
                            along, name.axis));
  refuse(who, fmt::format("{} travels mainly along {} itself; write its squareness to the slides "
                          "across it",
                          name.axis, along));
}

void check_location(const ElementName& name, const kinematics::Chain& chain, int joint) {
  const std::string who = to_string(name);
  const std::string motion = std::string("E") + name.direction + name.axis;
  const Joint& axis = chain.joints()[std::size_t(joint)];
  if (name.is_angle() && is_along(name, axis))
    refuse(who, "an axis has no squareness about itself; a constant " + motion + " moves its zero");
  if (!name.is_angle() && axis.motion == kinematics::Motion::Linear)
    refuse(who, "a slide has a direction but no place; write a constant " + motion);
  if (!name.is_angle() && is_along(name, axis))
    refuse(who, "a rotation axis has no place along itself; write a constant " + motion);
  check_squareness(name, chain, joint);
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

void check_meaning(const ElementName& name, const kinematics::Chain& chain, int joint) {
  if (name.location) {
    check_location(name, chain, joint);
  } else if (name.axis == 'S' && name.is_angle() &&
             is_along(name, chain.joints()[std::size_t(joint)])) {
    refuse(to_string(name), "a spindle has no element about its own axis");
  }
}

std::string meaning(const ElementName& name, const kinematics::Chain& chain, int joint) {
  const kinematics::LocationElement element =
      kinematics::location_element(chain.joints(), joint, name.component());
  const char along = char('X' + name.component() % 3);
  if (!name.is_angle()) return fmt::format("offset of {} along {}", name.axis, along);
  if (!element.reference) return fmt::format("tilt of {} about {}", name.axis, along);
  const Joint& axis = chain.joints()[std::size_t(joint)];
  const Joint& reference = chain.joints()[std::size_t(*element.reference)];
  const bool parallel = std::abs(axis.direction_b.dot(reference.direction_b)) > std::sqrt(0.5);
  return parallel
             ? fmt::format("parallelism of {} to {} about {}", name.axis, reference.name, along)
             : fmt::format("squareness of {} to {}", name.axis, reference.name);
}

}  // namespace abbe::errors
