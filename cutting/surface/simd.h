#pragma once

#include <experimental/simd>

#include "cutting/surface/outline.h"

/// Vectors of eight floats, eight 3-vectors at a time, and the distance and support of a tool
/// outline for eight points or directions at a time.
namespace abbe::cutting {

namespace stdx = std::experimental;
using Float8 = stdx::simd<float, stdx::simd_abi::deduce_t<float, 8>>;
using Mask8 = Float8::mask_type;

inline constexpr float tiny = 1e-30f;  ///< keeps quotients of zero lengths finite

inline Float8 load(const float* values) { return Float8(values, stdx::element_aligned); }

/// Eight vectors of three components.
struct Vector8 {
  Float8 x, y, z;
};

inline Vector8 load(const float (&v)[3][8]) { return {load(v[0]), load(v[1]), load(v[2])}; }
inline Vector8 spread(const float (&v)[3]) { return {Float8(v[0]), Float8(v[1]), Float8(v[2])}; }
[[gnu::always_inline]] inline Vector8 operator-(const Vector8& a, const Vector8& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
[[gnu::always_inline]] inline Vector8 operator+(const Vector8& a, const Vector8& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
[[gnu::always_inline]] inline Vector8 operator*(const Float8& s, const Vector8& a) {
  return {s * a.x, s * a.y, s * a.z};
}
[[gnu::always_inline]] inline Float8 dot(const Vector8& a, const Vector8& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
[[gnu::always_inline]] inline Vector8 cross(const Vector8& a, const Vector8& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// Returns the length, never zero: lengths below 1e-15 are returned too large.
[[gnu::always_inline]] inline Float8 magnitude(const Vector8& a) {
  return stdx::sqrt(dot(a, a) + tiny);
}
[[gnu::always_inline]] inline Vector8 clamp(const Vector8& p, const Vector8& low,
                                            const Vector8& high) {
  return {stdx::min(stdx::max(p.x, low.x), high.x), stdx::min(stdx::max(p.y, low.y), high.y),
          stdx::min(stdx::max(p.z, low.z), high.z)};
}

/// Returns a bit mask with lane i of the mask as bit i.
[[gnu::always_inline]] inline unsigned bits(const Mask8& mask) {
  return unsigned(mask.__to_bitset().to_ulong());  // libstdc++'s own: one instruction
}

// The outline of a tool in single precision, for eight points or directions at a time.

/// Signed distances from an outline without its top, with their gradients.
struct OutlineDistance8 {
  Float8 value;          ///< mm
  Float8 radial, axial;  ///< unit
  Float8 curvature;      ///< 1/mm, in the half plane, of the offset curve through the point
};

// Positions on an arc are computed relative to its first point, so that large radii cost no digits.

/// Returns the signed distances of eight points.
[[gnu::always_inline]] inline OutlineDistance8 distance(const ToolOutline& outline, const Float8& x,
                                                        const Float8& y) {
  OutlineDistance8 largest{Float8(-1e30f), Float8(0.0f), Float8(-1.0f), Float8(0.0f)};
  const auto update = [&](const Float8& value, const Float8& radial, const Float8& axial,
                          const Float8& curvature) __attribute__((always_inline)) {
    const auto is_larger = value > largest.value;
    stdx::where(is_larger, largest.value) = value;
    stdx::where(is_larger, largest.radial) = radial;
    stdx::where(is_larger, largest.axial) = axial;
    stdx::where(is_larger, largest.curvature) = curvature;
  };
  for (const OutlineSegment& segment : outline.segments) {
    const float nx = float(segment.normal_from.x()), ny = float(segment.normal_from.y());
    const Float8 vx = x - float(segment.from.x()), vy = y - float(segment.from.y());
    const Float8 off = nx * vx + ny * vy;
    if (!segment.is_arc) {
      if (segment.normal_from.y() < 1.0) update(off, Float8(nx), Float8(ny), Float8(0.0f));
      continue;
    }
    const float r = float(segment.radius);
    const float mx = float(segment.normal_to.x()), my = float(segment.normal_to.y());
    const Float8 wx = x - float(segment.to.x()), wy = y - float(segment.to.y());
    const auto is_on_arc = nx * vy - ny * vx >= 0.0f && wx * my - wy * mx >= 0.0f;
    const Float8 cx = vx + r * nx, cy = vy + r * ny;
    const Float8 centre_distance = stdx::sqrt(cx * cx + cy * cy + tiny);
    const Float8 inverse_distance = Float8(1.0f) / centre_distance;
    Float8 value = (vx * vx + vy * vy + 2.0f * r * off) / (centre_distance + r);
    stdx::where(!is_on_arc, value) = Float8(-1e30f);
    update(value, cx * inverse_distance, cy * inverse_distance, inverse_distance);
    // Beyond its ends an arc continues along its tangents.
    Float8 before = off, beyond = mx * wx + my * wy;
    stdx::where(is_on_arc, before) = Float8(-1e30f);
    stdx::where(is_on_arc, beyond) = Float8(-1e30f);
    update(before, Float8(nx), Float8(ny), Float8(0.0f));
    update(beyond, Float8(mx), Float8(my), Float8(0.0f));
  }
  return largest;
}

/// The reach of an outline in eight directions (its support), and the points that reach so far.
struct Reach {
  Float8 value;  ///< mm times the direction's length; too large by at most 1e-9 of an arc's radius
  Float8 x, y;   ///< mm, approximate
};

/// Returns the reach of an outline in eight directions.
[[gnu::always_inline]] inline Reach reach(const ToolOutline& outline, const Float8& across,
                                          const Float8& rise) {
  constexpr float margin = 3e-5f;  // rad: an arc is extended by this beyond its ends, so that
                                   // rounding loses no direction
  const Float8 length = stdx::sqrt(across * across + rise * rise + tiny);
  const float base = float(bottom(outline));
  Reach reach{Float8(base * rise), Float8(0.0f), Float8(base)};
  for (const OutlineSegment& segment : outline.segments) {
    const float tx = float(segment.to.x()), ty = float(segment.to.y());
    const Float8 at_end = tx * across + ty * rise;
    const auto is_larger = at_end > reach.value;
    stdx::where(is_larger, reach.value) = at_end;
    stdx::where(is_larger, reach.x) = Float8(tx);
    stdx::where(is_larger, reach.y) = Float8(ty);
    if (!segment.is_arc || segment.radius == 0.0) continue;
    const float r = float(segment.radius);
    const float nx = float(segment.normal_from.x()), ny = float(segment.normal_from.y());
    const float mx = float(segment.normal_to.x()), my = float(segment.normal_to.y());
    const float fx = float(segment.from.x()), fy = float(segment.from.y());
    const Float8 beyond = nx * rise - ny * across;
    const Float8 before = across * my - rise * mx;
    const Float8 facing = nx * across + ny * rise;
    const Float8 bulge = r * beyond * beyond / (length + facing + tiny);
    const Float8 on_arc = fx * across + fy * rise + bulge;
    const auto improves = on_arc > reach.value && beyond >= -margin * length &&
                          before >= -margin * length && facing > -0.99f * length;
    stdx::where(improves, reach.value) = on_arc;
    stdx::where(improves, reach.x) = fx + r * (across / length - nx);
    stdx::where(improves, reach.y) = fy + r * (rise / length - ny);
  }
  return reach;
}

}  // namespace abbe::cutting
