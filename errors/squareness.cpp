#include "errors/squareness.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "kinematics/location.h"

namespace abbe::errors {

using Eigen::Vector3d;

// A turn about the bed axis along which the slide mainly travels moves it only as far as it is
// oblique: with this sine 4e-4 of the slope are neglected.
constexpr double most_oblique = 0.02;

std::vector<SquarenessShare> squareness_shares(const ElementName& straightness, double slope,
                                               std::span<const kinematics::Joint> joints) {
  const auto refuse = [&](const char* why) {
    throw std::invalid_argument(to_string(straightness) + ": " + why);
  };
  const auto slide = std::find_if(joints.begin(), joints.end(), [&](const auto& joint) {
    return joint.name == straightness.axis && joint.motion == kinematics::Motion::Linear;
  });
  if (slide == joints.end() || straightness.location || straightness.is_angle())
    refuse("expected a straightness of a slide");
  const Vector3d turn = slide->direction_b.cross(Vector3d::Unit(straightness.component()));
  if (turn.norm() < 1e-9) refuse("expected a straightness of a slide");
  std::vector<SquarenessShare> shares;
  for (int i = 0; i < 3; ++i) {
    if (std::abs(turn[i]) < 1e-12) continue;
    const kinematics::LocationElement element =
        kinematics::location_element(joints, int(slide - joints.begin()), 3 + i);
    const char direction = char('A' + i);
    if (element.defined) {
      shares.push_back({{direction, slide->name, true}, turn[i] * slope});
    } else if (element.stated_by) {
      shares.push_back(
          {{direction, joints[std::size_t(*element.stated_by)].name, true}, -turn[i] * slope});
    } else if (!element.reference || std::abs(turn[i]) > most_oblique) {
      refuse("its slope is no angle to another slide of this machine");
    }
  }
  return shares;
}

}  // namespace abbe::errors
