#include "errors/element.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "kinematics/chain.h"

namespace abbe::errors {

using Eigen::Vector3d;

namespace {

constexpr std::string_view directions = "XYZABC";
constexpr std::string_view axes = "XYZUVWABCS";

/// Returns text from a file in quotes, shortened to 40 characters, non-printable ones as '?'.
std::string quoted(std::string_view text) {
  std::string result = "'";
  for (const char c : text.substr(0, 40)) result += c >= ' ' && c <= '~' ? c : '?';
  return result + (text.size() > 40 ? "...'" : "'");
}

}  // namespace

ElementName parse_element_name(std::string_view text) {
  const bool is_long = !text.empty() && text.front() == 'E';
  const std::string_view letters = is_long ? text.substr(1) : text;
  // The zero of EC0Y marks a location error.
  const bool location = letters.size() == 3 && letters[1] == '0';
  // Vendors omit the E of location errors only: "C0Y", but not "XX".
  const bool has_valid_length = location || (is_long && letters.size() == 2);
  if (!has_valid_length || directions.find(letters.front()) == std::string_view::npos ||
      axes.find(letters.back()) == std::string_view::npos) {
    throw std::invalid_argument(
        "expected an element name: E, direction (X Y Z A B C), 0 for a location error, axis (X Y Z "
        "U V W A B C S), e.g. EYX or EC0Y, seen " +
        quoted(text));
  }
  return {letters.front(), letters.back(), location};
}

std::string to_string(const ElementName& name) {
  return std::string("E") + name.direction + (name.location ? "0" : "") + name.axis;
}

void refuse(const std::string& who, const std::string& reason) {
  throw std::invalid_argument(who + ": " + reason);
}

void require_positive_value(double value, const std::string& who, const char* quantity) {
  if (!(value > 0.0) || !std::isfinite(value))
    refuse(who, fmt::format("expected a {} above 0, seen {}", quantity, value));
}

void require_not_negative(double value, const std::string& who, const char* quantity) {
  if (!(value >= 0.0) || !std::isfinite(value))
    refuse(who, fmt::format("expected a {} of at least 0, seen {}", quantity, value));
}

void require_finite(double value, const std::string& who, const char* quantity) {
  if (!std::isfinite(value))
    refuse(who, fmt::format("expected a finite {}, seen {}", quantity, value));
}

void require_node(int node, int nodes, const std::string& who) {
  if (node < 0 || node >= nodes)
    refuse(who, fmt::format("expected a node from 0 to {}, seen {}", nodes - 1, node));
}

namespace {

using kinematics::Joint;

bool is_along(const ElementName& name, const Joint& joint) {
  const Vector3d unit = Vector3d::Unit(name.component() % 3);
  // A sine below 1e-9 counts as parallel: far above the rounding of a unit vector, far below any
  // real misalignment.
  return unit.cross(joint.direction_b).norm() < 1e-9;
}

char letter(const kinematics::Chain& chain, int joint) {
  return chain.joints()[std::size_t(joint)].name;
}

/// Throws std::invalid_argument if the angle belongs to another slide or has no reference slide.
void check_squareness(const ElementName& name, const kinematics::Chain& chain, int joint) {
  const kinematics::LocationElement element =
      kinematics::location_element(chain.joints(), joint, name.component());
  if (element.defined) return;
  const std::string who = to_string(name);
  const char along = char('X' + (name.direction - 'A'));
  if (element.later_slide)
    refuse(who, fmt::format("{} is the reference of {}; state the angle between them as E{}0{}, "
                            "which has the opposite sign",
                            name.axis, letter(chain, *element.later_slide), name.direction,
                            letter(chain, *element.later_slide)));
  if (!element.reference)
    refuse(who, fmt::format(
                    "no other slide of this machine travels perpendicular to {}, so {} has no "
                    "squareness; state its angle to a rotary axis as an element of the rotary axis",
                    along, name.axis));
  refuse(who, fmt::format("{} travels mainly along {} itself; state its squareness to the slides "
                          "perpendicular to it",
                          name.axis, along));
}

/// Throws std::invalid_argument if a location element has no meaning for the axis.
void check_location(const ElementName& name, const kinematics::Chain& chain, int joint) {
  const std::string who = to_string(name);
  const std::string motion = std::string("E") + name.direction + name.axis;
  const Joint& axis = chain.joints()[std::size_t(joint)];
  if (name.is_angle() && is_along(name, axis))
    refuse(who, "an axis has no squareness about itself; use a constant " + motion +
                    " to shift its zero");
  if (!name.is_angle() && axis.motion == kinematics::Motion::Linear)
    refuse(who, "a slide has a direction but no position; use a constant " + motion);
  if (!name.is_angle() && is_along(name, axis))
    refuse(who, "a rotation axis has no position along itself; use a constant " + motion);
  check_squareness(name, chain, joint);
}

}  // namespace

int axis_joint(char axis, const kinematics::Chain& chain, const std::string& who) {
  if (const auto joint = chain.find(axis)) return *joint;
  // Descriptions write S for the spindle; a chain names a workpiece spindle S and the nose s.
  if (const auto nose = chain.find('s'); nose && axis == 'S') return *nose;
  std::string axis_letters;
  for (const Joint& joint : chain.joints())
    axis_letters += std::string(axis_letters.empty() ? "" : " ") + joint.name;
  refuse(who, fmt::format("expected an axis of the machine ({}), seen {}", axis_letters, axis));
}

void check_meaning(const ElementName& name, const kinematics::Chain& chain, int joint) {
  if (name.location) {
    check_location(name, chain, joint);
  } else if (name.axis == 'S' && name.is_angle() &&
             is_along(name, chain.joints()[std::size_t(joint)])) {
    refuse(to_string(name), "a spindle has no error element about its own axis");
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
  // An axis within 45 degrees of its reference is intended to be parallel to it, any other one
  // square to it.
  const bool is_parallel = std::abs(axis.direction_b.dot(reference.direction_b)) > std::sqrt(0.5);
  return is_parallel
             ? fmt::format("parallelism of {} to {} about {}", name.axis, reference.name, along)
             : fmt::format("squareness of {} to {}", name.axis, reference.name);
}

// Maximum component of the rotation about the bed axis along which the slide mainly travels. Such a
// rotation moves an oblique slide only to second order, and no element expresses it: neglecting it
// loses at most 4e-4 of the slope.
constexpr double max_oblique_sine = 0.02;

std::vector<SquarenessContribution> to_squareness_errors(
    const ElementName& straightness, double slope, std::span<const kinematics::Joint> joints) {
  const auto throw_error = [&](const char* reason) {
    throw std::invalid_argument(to_string(straightness) + ": " + reason);
  };
  const auto slide = std::find_if(joints.begin(), joints.end(), [&](const auto& joint) {
    return joint.name == straightness.axis && joint.motion == kinematics::Motion::Linear;
  });
  if (slide == joints.end() || straightness.location || straightness.is_angle())
    throw_error("expected the straightness of a slide");
  // A slope of a straightness rotates the direction of travel about the normal to travel and
  // straightness.
  const Vector3d rotation = slide->direction_b.cross(Vector3d::Unit(straightness.component()));
  if (rotation.norm() < 1e-9) throw_error("expected the straightness of a slide");
  std::vector<SquarenessContribution> contributions;
  for (int i = 0; i < 3; ++i) {
    if (std::abs(rotation[i]) < 1e-12) continue;
    const kinematics::LocationElement element =
        kinematics::location_element(joints, int(slide - joints.begin()), 3 + i);
    const char direction = char('A' + i);
    if (element.defined) {
      contributions.push_back({{direction, slide->name, true}, rotation[i] * slope});
    } else if (element.later_slide) {
      contributions.push_back({{direction, joints[std::size_t(*element.later_slide)].name, true},
                               -rotation[i] * slope});
    } else if (!element.reference || std::abs(rotation[i]) > max_oblique_sine) {
      throw_error("its slope is not an angle to another slide of this machine");
    }
  }
  return contributions;
}

}  // namespace abbe::errors
