#pragma once

#include "cutting/eight.h"
#include "cutting/outline.h"

/// The outline of a tool in single precision, for several places or directions at a time.
namespace abbe::cutting {

/// Signed distance from an outline without its top, with its gradient.
struct LanesDistance {
  Eight value;          ///< mm
  Eight radial, axial;  ///< unit
  Eight curvature;      ///< 1/mm, in the half plane, of what is as far
};

// What an arc adds to its first point is counted from there, so that large radii cost no digits.

[[gnu::always_inline]] inline LanesDistance distance(const ToolOutline& outline, const Eight& x,
                                                     const Eight& y) {
  LanesDistance most{Eight(-1e30f), Eight(0.0f), Eight(-1.0f), Eight(0.0f)};
  const auto take = [&](const Eight& value, const Eight& radial, const Eight& axial,
                        const Eight& curvature) __attribute__((always_inline)) {
    const auto more = value > most.value;
    stdx::where(more, most.value) = value;
    stdx::where(more, most.radial) = radial;
    stdx::where(more, most.axial) = axial;
    stdx::where(more, most.curvature) = curvature;
  };
  for (const OutlinePiece& piece : outline.pieces) {
    const float nx = float(piece.normal_from.x()), ny = float(piece.normal_from.y());
    const Eight vx = x - float(piece.from.x()), vy = y - float(piece.from.y());
    const Eight off = nx * vx + ny * vy;
    if (!piece.is_arc) {
      if (piece.normal_from.y() < 1.0) take(off, Eight(nx), Eight(ny), Eight(0.0f));
      continue;
    }
    const float r = float(piece.radius);
    const float mx = float(piece.normal_to.x()), my = float(piece.normal_to.y());
    const Eight wx = x - float(piece.to.x()), wy = y - float(piece.to.y());
    const auto beside = nx * vy - ny * vx >= 0.0f && wx * my - wy * mx >= 0.0f;
    const Eight cx = vx + r * nx, cy = vy + r * ny;
    const Eight far = stdx::sqrt(cx * cx + cy * cy + tiny);
    const Eight per_far = Eight(1.0f) / far;
    Eight value = (vx * vx + vy * vy + 2.0f * r * off) / (far + r);
    stdx::where(!beside, value) = Eight(-1e30f);
    take(value, cx * per_far, cy * per_far, per_far);
    // beyond its ends an arc goes on along their tangents
    Eight before = off, beyond = mx * wx + my * wy;
    stdx::where(beside, before) = Eight(-1e30f);
    stdx::where(beside, beyond) = Eight(-1e30f);
    take(before, Eight(nx), Eight(ny), Eight(0.0f));
    take(beyond, Eight(mx), Eight(my), Eight(0.0f));
  }
  return most;
}

/// How far an outline reaches in a direction, and where.
struct Reach {
  Eight most;  ///< mm times the direction's length; too large by 1e-9 of an arc's radius at most
  Eight x, y;  ///< mm, about
};

[[gnu::always_inline]] inline Reach reach(const ToolOutline& outline, const Eight& across,
                                          const Eight& rise) {
  constexpr float margin = 3e-5f;  // rad: an arc counts so far beyond its ends
  const Eight length = stdx::sqrt(across * across + rise * rise + tiny);
  const float base = float(bottom(outline));
  Reach reach{Eight(base * rise), Eight(0.0f), Eight(base)};
  for (const OutlinePiece& piece : outline.pieces) {
    const float tx = float(piece.to.x()), ty = float(piece.to.y());
    const Eight at_end = tx * across + ty * rise;
    const auto more = at_end > reach.most;
    stdx::where(more, reach.most) = at_end;
    stdx::where(more, reach.x) = Eight(tx);
    stdx::where(more, reach.y) = Eight(ty);
    if (!piece.is_arc || piece.radius == 0.0) continue;
    const float r = float(piece.radius);
    const float nx = float(piece.normal_from.x()), ny = float(piece.normal_from.y());
    const float mx = float(piece.normal_to.x()), my = float(piece.normal_to.y());
    const float fx = float(piece.from.x()), fy = float(piece.from.y());
    const Eight beyond = nx * rise - ny * across;
    const Eight before = across * my - rise * mx;
    const Eight facing = nx * across + ny * rise;
    const Eight bulge = r * beyond * beyond / (length + facing + tiny);
    const Eight on_arc = fx * across + fy * rise + bulge;
    const auto lies = on_arc > reach.most && beyond >= -margin * length &&
                      before >= -margin * length && facing > -0.99f * length;
    stdx::where(lies, reach.most) = on_arc;
    stdx::where(lies, reach.x) = fx + r * (across / length - nx);
    stdx::where(lies, reach.y) = fy + r * (rise / length - ny);
  }
  return reach;
}

}  // namespace abbe::cutting
