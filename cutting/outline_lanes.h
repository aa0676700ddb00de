#pragma once

#include "cutting/eight.h"
#include "cutting/outline.h"

/// The outline of a tool in single precision, for several places or directions at a time.
namespace abbe::cutting {

/// Signed distance from an outline without its top, with its gradient.
template <class T>
struct LanesDistance {
  T value;          ///< mm
  T radial, axial;  ///< unit
  T curvature;      ///< 1/mm, in the half plane, of what is as far
};

// What an arc adds to its first point is counted from there, so that large radii cost no digits.

template <class T>
[[gnu::always_inline]] inline LanesDistance<T> distance(const ToolOutline& outline, const T& x,
                                                        const T& y) {
  LanesDistance<T> most{T(-1e30f), T(0.0f), T(-1.0f), T(0.0f)};
  const auto take = [&](const T& value, const T& radial, const T& axial, const T& curvature)
      __attribute__((always_inline)) {
    const auto more = value > most.value;
    stdx::where(more, most.value) = value;
    stdx::where(more, most.radial) = radial;
    stdx::where(more, most.axial) = axial;
    stdx::where(more, most.curvature) = curvature;
  };
  for (const OutlinePiece& piece : outline.pieces) {
    const float nx = float(piece.normal_from.x()), ny = float(piece.normal_from.y());
    const T vx = x - float(piece.from.x()), vy = y - float(piece.from.y());
    const T off = nx * vx + ny * vy;
    if (!piece.is_arc) {
      if (piece.normal_from.y() < 1.0) take(off, T(nx), T(ny), T(0.0f));
      continue;
    }
    const float r = float(piece.radius);
    const float mx = float(piece.normal_to.x()), my = float(piece.normal_to.y());
    const T wx = x - float(piece.to.x()), wy = y - float(piece.to.y());
    const auto beside = nx * vy - ny * vx >= 0.0f && wx * my - wy * mx >= 0.0f;
    const T cx = vx + r * nx, cy = vy + r * ny;
    const T far = stdx::sqrt(cx * cx + cy * cy + tiny);
    const T per_far = T(1.0f) / far;
    T value = (vx * vx + vy * vy + 2.0f * r * off) / (far + r);
    stdx::where(!beside, value) = T(-1e30f);
    take(value, cx * per_far, cy * per_far, per_far);
    // beyond its ends an arc goes on along their tangents
    T before = off, beyond = mx * wx + my * wy;
    stdx::where(beside, before) = T(-1e30f);
    stdx::where(beside, beyond) = T(-1e30f);
    take(before, T(nx), T(ny), T(0.0f));
    take(beyond, T(mx), T(my), T(0.0f));
  }
  return most;
}

/// How far an outline reaches in a direction, and where.
template <class T>
struct Reach {
  T most;  ///< mm times the direction's length; too large by 1e-9 of an arc's radius at most
  T x, y;  ///< mm, about
};

template <class T>
[[gnu::always_inline]] inline Reach<T> reach(const ToolOutline& outline, const T& across,
                                             const T& rise) {
  constexpr float margin = 3e-5f;  // rad: an arc counts so far beyond its ends
  const T length = stdx::sqrt(across * across + rise * rise + tiny);
  const float base = float(bottom(outline));
  Reach<T> reach{T(base * rise), T(0.0f), T(base)};
  for (const OutlinePiece& piece : outline.pieces) {
    const float tx = float(piece.to.x()), ty = float(piece.to.y());
    const T at_end = tx * across + ty * rise;
    const auto more = at_end > reach.most;
    stdx::where(more, reach.most) = at_end;
    stdx::where(more, reach.x) = T(tx);
    stdx::where(more, reach.y) = T(ty);
    if (!piece.is_arc || piece.radius == 0.0) continue;
    const float r = float(piece.radius);
    const float nx = float(piece.normal_from.x()), ny = float(piece.normal_from.y());
    const float mx = float(piece.normal_to.x()), my = float(piece.normal_to.y());
    const float fx = float(piece.from.x()), fy = float(piece.from.y());
    const T beyond = nx * rise - ny * across;
    const T before = across * my - rise * mx;
    const T facing = nx * across + ny * rise;
    const T bulge = r * beyond * beyond / (length + facing + tiny);
    const T on_arc = fx * across + fy * rise + bulge;
    const auto lies = on_arc > reach.most && beyond >= -margin * length &&
                      before >= -margin * length && facing > -0.99f * length;
    stdx::where(lies, reach.most) = on_arc;
    stdx::where(lies, reach.x) = fx + r * (across / length - nx);
    stdx::where(lies, reach.y) = fy + r * (rise / length - ny);
  }
  return reach;
}

}  // namespace abbe::cutting
