#include "cutting/thickness.h"

#include <algorithm>
#include <cmath>

namespace abbe::cutting {

using Eigen::Vector3d;

Thickness::Thickness(const Design& design) : tree_(design.vertices, design.triangles) {}

std::optional<double> Thickness::behind(const Vector3d& place, const Vector3d& normal,
                                        double most) const {
  const auto met = tree_.first_met(place, -normal, TriangleTree::Side::Inner, most);
  return met ? std::optional(met->along) : std::nullopt;
}

double Thickness::nearest(const Vector3d& place, double most) const {
  const TriangleTree::Nearest found = tree_.nearest(place, -1, most);
  return found.triangle < 0 ? most : std::min(most, std::sqrt(found.squared));
}

bool Thickness::comes_within(const Vector3d& place, double distance) const {
  return tree_.nearest(place, -1, distance).triangle >= 0;
}

}  // namespace abbe::cutting
