#include "cutting/profile_section.h"

#include <algorithm>
#include <cmath>

namespace abbe::cutting {

using Eigen::Vector2d;

namespace {

Vector2d turned(const Vector2d& v, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * v.x() - s * v.y(), s * v.x() + c * v.y()};
}

}  // namespace

Section section(const RevolvedProfile::Piece& piece) {
  const Vector2d chord = piece.to - piece.from;
  const double c = chord.norm();
  const Vector2d along = chord / c;
  if (piece.arc_radius == 0.0) return {piece.from, piece.to, along, 0.0, c};
  const double half = std::asin(std::min(1.0, c / (2.0 * std::abs(piece.arc_radius))));
  const double sign = piece.arc_radius > 0.0 ? 1.0 : -1.0;
  return {piece.from, piece.to, turned(along, sign * half), 1.0 / piece.arc_radius,
          2.0 * half * std::abs(piece.arc_radius)};
}

Station at(const Section& s, double arc) {
  const double angle = arc * s.curvature;
  const Vector2d normal = left_of(turned(s.tangent, -angle));
  if (arc <= 0.0) return {s.from, normal};
  if (arc >= s.length) return {s.to, normal};
  if (s.curvature == 0.0) return {s.from + arc * s.tangent, normal};
  const double chord = 2.0 * std::sin(0.5 * angle) / s.curvature;
  return {s.from + chord * turned(s.tangent, -0.5 * angle), normal};
}

Station at_radius(const Section& s, double r) {
  const Vector2d n0 = left_of(s.tangent);
  const double dr = r - s.from.x();
  const double n_r = std::clamp(n0.x() + s.curvature * dr, -1.0, 1.0);
  const double n_z = std::sqrt((1.0 - n_r) * (1.0 + n_r));
  if (dr == 0.0) return {s.from, n0};
  return {{r, s.from.y() - dr * (n_r + n0.x()) / (n_z + std::max(0.0, n0.y()))}, {n_r, n_z}};
}

Vector2d left_of(const Vector2d& tangent) { return {-tangent.y(), tangent.x()}; }

}  // namespace abbe::cutting
