#pragma once

#include <string>

#include <Eigen/Core>

#include "cutting/mesh.h"

namespace abbe::render {

/// Part of a picture in pixels, from its lower left corner.
struct Rectangle {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;
};

/// A parallel projection onto the picture: right, up and toward the eye are orthonormal.
struct View {
  Eigen::Vector3d right = Eigen::Vector3d::UnitX();
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  Eigen::Vector3d toward = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm, in the middle of the rectangle
  double mm_per_px = 1.0;
  double depth = 1.0;  ///< mm, everything lies within it before and behind the centre
  Rectangle area;
};

/// The view from direction `from` in which the points just fill `area`.
/// @param from  from the part to the eye, any length; zero is taken as +Z
/// @param up    shown upwards; where it is parallel to `from`, Y or X stands in
View fitted_view(const cutting::Points& points, const Eigen::Vector3d& from,
                 const Eigen::Vector3d& up, const Rectangle& area);

/// Height over width of what such a view shows.
double aspect(const cutting::Points& points, const Eigen::Vector3d& from,
              const Eigen::Vector3d& up);

/// Pixel of the picture where point p appears.
Eigen::Vector2d projected(const View& view, const Eigen::Vector3d& p);

/// How a view is named in a picture: "from +Z", "from (−0.35, −0.70, 0.63)".
std::string view_name(const View& view);

}  // namespace abbe::render
