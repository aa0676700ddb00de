#include "cutting/nose_stretch.h"

#include <algorithm>

namespace abbe::cutting {

using Eigen::Vector3d;

NoseStretch stretch_of(const Vector3d& q, const Vector3d& n, double from, double to) {
  NoseStretch stretch;
  stretch.q = q;
  stretch.n = n;
  stretch.from = from;
  stretch.to = to;
  const double r_from = radius(stretch.at(from));
  const double r_to = radius(stretch.at(to));
  stretch.radius_step = (r_to - r_from) / (to - from);
  stretch.radius0 = r_from - from * stretch.radius_step;
  stretch.radius_min = std::min(r_from, r_to);
  // r^2 = a + 2 b s + c s^2 is convex in s, so it hangs below its chord, lowest where the slopes
  // agree.
  const double a = q.y() * q.y() + q.z() * q.z();
  const double b = q.y() * n.y() + q.z() * n.z();
  const double c = n.y() * n.y() + n.z() * n.z();
  const double m = stretch.radius_step;
  stretch.sag = 1e-9;
  const double steep = c - m * m;
  if (steep > 0.0) {
    const double w = std::copysign(std::sqrt(m * m * std::max(0.0, a * c - b * b) / steep), m);
    const double s = std::clamp((w - b) / c, from, to);
    stretch.sag += std::max(0.0, stretch.radius0 + s * m - radius(stretch.at(s)));
  }
  // The end that stands on the axis has no azimuth; then the other end has that of all the rest.
  const bool starts_on_axis = r_from < on_axis;
  stretch.azimuth = azimuth(stretch.at(starts_on_axis ? to : from));
  stretch.azimuth_spread =
      stretch.radius_min < on_axis ? 0.0 : angle_between(stretch.at(from), stretch.at(to));
  stretch.x_max = std::max(std::abs(stretch.at(from).x()), std::abs(stretch.at(to).x()));
  return stretch;
}

std::optional<double> nearest_to_axis(const Vector3d& q, const Vector3d& n, double band) {
  const double c = n.y() * n.y() + n.z() * n.z();
  const double s = -(q.y() * n.y() + q.z() * n.z());
  if (c < 1e-20 || std::abs(s) >= band * c) return std::nullopt;
  return s / c;
}

}  // namespace abbe::cutting
