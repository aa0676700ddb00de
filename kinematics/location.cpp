#include "kinematics/location.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

namespace abbe::kinematics {
namespace {

using MainSlides = std::array<std::optional<int>, 3>;

constexpr std::string_view slides_in_order = "XYZUVWPQR";
constexpr double mainly = 0.5;     // cosine: a slide within 60 degrees of a bed axis may be its own
constexpr double is_along = 1e-9;  // sine between two directions that are one

std::optional<int> bed_axis_of(const MainSlides& slides, int joint) {
  for (int k = 0; k < 3; ++k)
    if (slides[std::size_t(k)] == joint) return k;
  return std::nullopt;
}

/// Main slides that see a component of another joint, in the order of their rank.
std::vector<int> seen_by(const MainSlides& slides, int joint, int component) {
  std::vector<int> result;
  for (int k = 0; k < 3; ++k) {
    const bool sees = component < 3 ? k == component : k != component - 3;
    const std::optional<int> slide = slides[std::size_t(k)];
    if (sees && slide && *slide != joint) result.push_back(*slide);
  }
  return result;
}

Displaces displaces(std::span<const Joint> joints, int joint, int component,
                    const std::vector<int>& seen) {
  const bool is_angle = component >= 3;
  if (is_angle && joints[std::size_t(joint)].squareness == Squareness::Travel)
    return Displaces::Axis;
  const auto carried = std::count_if(seen.begin(), seen.end(),
                                     [&](int slide) { return carries(joints, joint, slide); });
  if (carried == 0) return Displaces::Frame;
  return carried == std::ptrdiff_t(seen.size()) ? Displaces::Carried : Displaces::Axis;
}

}  // namespace

bool carries(std::span<const Joint> joints, int one, int other) {
  const Side side = joints[std::size_t(one)].side;
  if (joints[std::size_t(other)].side != side) return false;
  return side == Side::Tool ? one < other : one > other;
}

MainSlides main_slides(std::span<const Joint> joints) {
  MainSlides slides;
  for (const char letter : slides_in_order) {
    const auto joint = std::find_if(joints.begin(), joints.end(),
                                    [&](const Joint& one) { return one.name == letter; });
    if (joint == joints.end() || joint->motion != Motion::Linear) continue;
    int best = -1;
    double most = mainly;
    for (int k = 0; k < 3; ++k) {
      const double along = std::abs(joint->direction_b[k]);
      if (slides[std::size_t(k)] || along <= most) continue;
      best = k;
      most = along;
    }
    if (best >= 0) slides[std::size_t(best)] = int(joint - joints.begin());
  }
  return slides;
}

LocationElement location_element(std::span<const Joint> joints, int joint, int component) {
  const Joint& one = joints[std::size_t(joint)];
  const MainSlides slides = main_slides(joints);
  const std::vector<int> seen = seen_by(slides, joint, component);
  LocationElement element;
  if (!seen.empty()) element.reference = seen.front();
  const Eigen::Vector3d unit = Eigen::Vector3d::Unit(component % 3);
  element.defined = !(unit.cross(one.direction_b).norm() < is_along);
  if (one.motion == Motion::Linear)
    element.defined = element.defined && component >= 3 && !seen.empty();
  if (const auto own = bed_axis_of(slides, joint); own && element.defined) {
    // the angle of a pair of main slides is the later one's
    element.defined = seen.size() == 1 && *bed_axis_of(slides, seen.front()) < *own;
    if (!element.defined && seen.size() == 1) element.stated_by = seen.front();
  }
  const bool alone = component >= 3 && one.squareness == Squareness::Travel;
  if (element.defined || alone) element.displaces = displaces(joints, joint, component, seen);
  return element;
}

}  // namespace abbe::kinematics
