#include "cutting/surface/sweep_bounds.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "cutting/surface/simd.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

// A child with more leaves is not flat.
constexpr std::size_t max_slab_leaves = 512;
constexpr int core_steps = 4;           // iterations towards the nearest point of a tool
constexpr int shaft_steps = 2;          // the same for a ball on its shaft
constexpr float move_rounding = 3e-6f;  // fraction of a distance; derived below
constexpr float node_rounding = 4e-6f;  // the same for a node

/// Returns the largest float that is not above x, so that the conversion keeps a lower bound valid.
float round_down(double x) {
  const float f = float(x);
  return double(f) <= x ? f : std::nextafterf(f, -std::numeric_limits<float>::infinity());
}
float round_up(double x) { return -round_down(-x); }

Vector3d lane_vector(const float (&v)[3][8], int i) { return {v[0][i], v[1][i], v[2][i]}; }

// Construction of the bounds.

/// The centre of the corner circle's plane and the axis at the ends of a move.
struct MoveEnds {
  Vector3d k0, k1, u0, u1;
};

MoveEnds move_ends(const Move& move, double corner_radius) {
  MoveEnds ends;
  const auto axis = [&](double t) -> Vector3d {
    return std::cos(t * move.angle) * move.axis + std::sin(t * move.angle) * move.side;
  };
  ends.u0 = move.from == 0 ? move.axis : axis(move.from);
  ends.u1 = move.angle == 0 ? ends.u0 : axis(move.to);
  ends.k0 = move.tip + move.from * move.step + corner_radius * ends.u0;
  ends.k1 = move.tip + move.to * move.step + corner_radius * ends.u1;
  return ends;
}

/// Returns the direction in which points of the given covariance spread least.
Vector3d flattest_direction(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  const Vector3d direction = solver.eigenvectors().col(0);
  return direction.allFinite() && direction.norm() > 0.5 ? direction.normalized()
                                                         : Vector3d::UnitZ().eval();
}

/// Adds the slab between two parallel planes that contains all k of the leaves. Passes over a
/// surface lie nearly in a plane; a box that is oblique to this plane would be thick.
void add_slab(SweepBounds& bounds, const SweepLeaves& leaves, std::size_t first, std::size_t end) {
  const auto visit_centres = [&](const auto& visit) {
    for (std::size_t l = first; l < end; ++l) {
      const Vector3d offset = Vector3d(leaves.frames[l].origin) - bounds.low;
      for (int i = 0; i < leaves.frames[l].count; ++i) {
        visit(lane_vector(leaves.moves[l].k0, i) + offset);
        visit(lane_vector(leaves.moves[l].k1, i) + offset);
      }
    }
  };
  const Vector3d centre = 0.5 * (bounds.high - bounds.low);
  Vector3d sum = Vector3d::Zero();
  Eigen::Matrix3d square_sum = Eigen::Matrix3d::Zero();
  double count = 0.0;
  double slack = 0.0;
  for (std::size_t l = first; l < end; ++l) slack = std::max(slack, double(leaves.frames[l].slack));
  visit_centres([&](const Vector3d& k) {
    const Vector3d d = k - centre;
    sum += d;
    square_sum += d * d.transpose();
    count += 1.0;
  });
  const Vector3d slab_normal =
      flattest_direction(square_sum / count - sum * sum.transpose() / (count * count));
  // Rounded to float, since the heights must refer to the direction that the node stores.
  bounds.slab_normal = slab_normal.cast<float>().cast<double>();
  bounds.slab_low = std::numeric_limits<double>::infinity();
  bounds.slab_high = -bounds.slab_low;
  visit_centres([&](const Vector3d& k) {
    const double height = bounds.slab_normal.dot(k);
    bounds.slab_low = std::min(bounds.slab_low, height);
    bounds.slab_high = std::max(bounds.slab_high, height);
  });
  // 1 % covers the length of `slab_normal`, which is 1 only to rounding.
  bounds.slab_low -= 1.01 * slack;
  bounds.slab_high += 1.01 * slack;
}

}  // namespace

void fill_leaf(SweepLeaves& leaves, std::size_t l, const Cutter& cutter,
               std::span<const Move> moves) {
  SweepLeaf& leaf = leaves.moves[l];
  SweepLeafFrame& frame = leaves.frames[l];
  frame.count = int(moves.size());
  Vector3d origin = Vector3d::Zero();
  double reach = 0.0;
  double squared_axis_change = 0.0;
  for (int i = 0; i < SweepLeaf::width; ++i) {
    const MoveEnds ends =
        move_ends(moves[std::size_t(std::min(i, frame.count - 1))], cutter.corner_radius);
    if (i == 0) origin = ends.k0;
    reach = std::max({reach, (ends.k0 - origin).norm(), (ends.k1 - origin).norm()});
    squared_axis_change = std::max(squared_axis_change, (ends.u1 - ends.u0).squaredNorm());
    for (int d = 0; d < 3; ++d) {
      leaf.k0[d][i] = float(ends.k0[d] - origin[d]);
      leaf.k1[d][i] = float(ends.k1[d] - origin[d]);
      leaf.u0[d][i] = float(ends.u0[d]);
      leaf.u1[d][i] = float(ends.u1[d]);
    }
  }
  std::copy_n(origin.data(), 3, frame.origin);
  frame.reach = float(reach + cutter.radius + cutter.flank_length);
  // 0.13 instead of 1/8 covers the rounding; 2e-7 is the rounding of k to float.
  frame.slack = float(0.13 * cutter.corner_radius * squared_axis_change) + 2e-7f * frame.reach;
}

SweepBounds sweep_bounds(const SweepLeaves& leaves, std::size_t l) {
  const SweepLeaf& leaf = leaves.moves[l];
  const SweepLeafFrame& frame = leaves.frames[l];
  SweepBounds bounds;
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < frame.count; ++i) {
    for (const Vector3d& k : {lane_vector(leaf.k0, i), lane_vector(leaf.k1, i)}) {
      bounds.low = bounds.low.cwiseMin(k);
      bounds.high = bounds.high.cwiseMax(k);
    }
    sum += lane_vector(leaf.u0, i) + lane_vector(leaf.u1, i);
  }
  const Vector3d origin(frame.origin);
  bounds.low += origin - Vector3d::Constant(frame.slack);
  bounds.high += origin + Vector3d::Constant(frame.slack);
  add_slab(bounds, leaves, l, l + 1);
  // Axes that nearly cancel have no mean direction.
  if (sum.norm() < 1e-3 * frame.count) {
    bounds.spread = pi;
    return bounds;
  }
  bounds.cone_axis = sum.normalized();
  for (int i = 0; i < frame.count; ++i)
    for (const Vector3d& u : {lane_vector(leaf.u0, i), lane_vector(leaf.u1, i)})
      bounds.spread = std::max(
          bounds.spread, std::atan2(u.cross(bounds.cone_axis).norm(), u.dot(bounds.cone_axis)));
  // 1e-6 covers the rounding of the cone's axis to float.
  bounds.spread += 1e-6;
  return bounds;
}

SweepBounds sweep_bounds(const SweepNode& node, int children, const Vector3d& centre,
                         const SweepLeaves& leaves, std::size_t first, std::size_t end) {
  SweepBounds bounds;
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < children; ++i) {
    bounds.low = bounds.low.cwiseMin(lane_vector(node.low, i) + centre);
    bounds.high = bounds.high.cwiseMax(lane_vector(node.high, i) + centre);
    sum += lane_vector(node.cone_axis, i);
  }
  if (end - first <= max_slab_leaves) add_slab(bounds, leaves, first, end);
  if (sum.norm() < 1e-3 * children) {
    bounds.spread = pi;
    return bounds;
  }
  bounds.cone_axis = sum.normalized();
  for (int i = 0; i < children; ++i) {
    const Vector3d child_axis = lane_vector(node.cone_axis, i);
    const double child_spread = std::atan2(double(node.sin_spread[i]), double(node.cos_spread[i]));
    bounds.spread =
        std::max(bounds.spread, child_spread + std::atan2(child_axis.cross(bounds.cone_axis).norm(),
                                                          child_axis.dot(bounds.cone_axis)));
  }
  bounds.spread += 1e-6;
  return bounds;
}

void fill_child(SweepNode& node, int child, const SweepBounds& bounds, const Vector3d& centre) {
  for (int d = 0; d < 3; ++d) {
    // 1e-9 mm covers the rounding of the doubles.
    node.low[d][child] = round_down(bounds.low[d] - centre[d] - 1e-9);
    node.high[d][child] = round_up(bounds.high[d] - centre[d] + 1e-9);
    node.cone_axis[d][child] = float(bounds.cone_axis[d]);
    node.slab_normal[d][child] = float(bounds.slab_normal[d]);
  }
  const Vector3d rounding = bounds.low - (lane_vector(node.low, child) + centre);
  node.slab_low[child] = round_down(bounds.slab_low + bounds.slab_normal.dot(rounding) - 1e-9);
  node.slab_high[child] = round_up(bounds.slab_high + bounds.slab_normal.dot(rounding) + 1e-9);
  // A cone wider than 1.5 rad rules out almost nothing, and the tests require an acute angle.
  const bool is_any_direction = bounds.spread > 1.5;
  node.cos_spread[child] = is_any_direction ? -1.0f : float(std::cos(bounds.spread));
  node.sin_spread[child] = is_any_direction ? 0.0f : float(std::sin(bounds.spread));
}

RayEnd::RayEnd(const Cutter& cutter, const Ray& ray, double s, const Vector3d& centre,
               double reach_of_nodes)
    : reach(round_up(reach_of_nodes)),
      radius(round_up(cutter.radius)),
      corner(round_up(cutter.corner_radius)),
      ring(round_up(cutter.radius - cutter.corner_radius)),
      flank(round_up(cutter.flank_length)),
      outline(cutter.outline.get()) {
  for (int d = 0; d < 3; ++d) n[d] = float(ray.normal[d]);
  truncate(ray, s, centre);
}

void RayEnd::truncate(const Ray& ray, double s, const Vector3d& centre) {
  for (int d = 0; d < 3; ++d) {
    point[d] = ray.point[d] + s * ray.normal[d];
    p[d] = float(point[d] - centre[d]);
  }
  error_bound = node_rounding * (std::abs(p[0]) + std::abs(p[1]) + std::abs(p[2]) + reach);
  if (outline != nullptr) error_bound *= 1.5f;
}

RaySegment::RaySegment(const Cutter& cutter, const Ray& ray, double s, const Vector3d& centre,
                       double reach_of_nodes)
    : end(cutter, ray, s, centre, reach_of_nodes),
      start(cutter, {ray.point, -ray.normal, ray.band}, ray.band, centre, reach_of_nodes) {}

PatchEnd::PatchEnd(const RayEnd& middle, const Eigen::Matrix3d& axes, const Vector3d& halves,
                   double tangent)
    : end(middle), tilt(round_up(1.001 * tangent + 1e-6)) {
  for (int d = 0; d < 3; ++d) {
    for (int k = 0; k < 3; ++k) axis[d][k] = float(axes(k, d));
    half[d] = round_up(1.001 * halves[d] + 1e-9);
  }
  end.error_bound *= 1.5f;
}

// Test of the bounds against a ray. Let q be the point where the ray is truncated. A plane through
// q with normal m, m n <= 0, has the whole ray up to q on its outer side. Tools on its inner side
// remove nothing before q:
// m q > max m k + h(m), where h is the support of the tool about k. With u the axis,
//   h = r |m| + ring |m x u| if m u <= 0, (flank - r) m u + R |m x u| if m u > 0.
// m is the direction to q from the nearest point of the tool's core, corrected to be normal to n if
// necessary. The bound holds for any m, so rounding in the computation of m does no harm.
//
// Such a plane has the whole line before q on its outer side, including cutters far behind the
// start of the ray. If the nearest point lies behind q, the test is repeated from the start, for
// the reversed ray.
//
// Rounding of the test itself. Let e = 2^-24, D = |q| + |k| + R + flank about the bound's origin,
// m0 the direction before its correction, |m0| <= |m| + correction. In units of e D |m0|:
//   1  q and k as floats
//   8  a move: the products m q and m k;  28  a node: parts of m, differences from two corners,
//      products with both and sums, each part at most D |m|
//   3  sums of the terms
//  14  |m x u| (7: as a norm of the cross product it is accurate to e |m| however small it is; a
//      difference of squares would be accurate to the root of e), m u (4) and their products with R
//      and flank; 20 if the spread of a cone is included
//   8  m n <= 0 fails by 8 e |m0| (all of m may be what is left of m0), over no more than D of the
//      ray: no cutter reaches farther from q
// The sum is 34 for a move and 60 for a node, that is 2.1e-6 and 3.6e-6.
// tests/cutting/sweep_bounds_test.cpp searches for larger errors.
//
// Neighbouring rays. Their ends q lie in a box with the centre c: m q >= m c - sum |m a| h over its
// axes a and half sides h. With the tangent t of the largest angle between a ray's normal and n, m
// n <= -t |m0| after the correction and |m|^2 <= (1 + t^2) |m0|^2, so that m n' <= 0 for every
// normal n' within that angle: m n' <= m n cos + sqrt(|m|^2 - (m n)^2) sin, which is at most 0
// where -m n >= tan sqrt(|m|^2 - (m n)^2), and |m|^2 - (m n)^2 <= |m0|^2. Half sides and tangent
// are enlarged by a thousandth, far more than their rounding, and the error bound of a node by half
// for the correction.

namespace {

enum class CutterForm { Ball, Rounded, Outlined };

/// Components of a direction along an axis and across it.
struct DirectionComponents {
  Float8 along, across, length;
};
/// Cosine and sine of half the opening angle of a cone.
struct ConeSpread {
  Float8 cosine, sine;
};

/// Returns an upper bound of the reach of an outline over all directions whose angle to the axis is
/// within a spread of that of m. Every such direction is a combination of the two limiting ones
/// with coefficients whose sum is from 1 to 1 / cos of the spread; the lower limit matters for an
/// outline that begins above the tip and ends below a plane.
[[gnu::always_inline]] inline Float8 cone_support(const ToolOutline& outline,
                                                  const DirectionComponents& m,
                                                  const ConeSpread& spread) {
  Float8 nearer = m.across * spread.cosine - m.along * spread.sine;
  Float8 upward = m.along * spread.cosine + m.across * spread.sine;
  Float8 farther = m.across * spread.cosine + m.along * spread.sine;
  Float8 downward = m.along * spread.cosine - m.across * spread.sine;
  const auto is_beyond_axis = nearer < 0.0f, is_below_axis = farther < 0.0f;
  stdx::where(is_beyond_axis, nearer) = Float8(0.0f);
  stdx::where(is_beyond_axis, upward) = m.length;
  stdx::where(is_below_axis, farther) = Float8(0.0f);
  stdx::where(is_below_axis, downward) = -m.length;
  const Float8 most =
      stdx::max(reach(outline, nearer, upward).value, reach(outline, farther, downward).value);
  return stdx::max(most, most / spread.cosine);
}

/// Returns the point of the core nearest to a point w, both relative to k; u is the tool axis.
template <CutterForm form>
[[gnu::always_inline]] inline Vector8 core_point(const RayEnd& end, const Vector8& w,
                                                 const Vector8& u) {
  const Float8 rise = dot(w, u);
  const Vector8 radial_vector = w - rise * u;
  const Float8 rho = magnitude(radial_vector);
  if constexpr (form == CutterForm::Outlined) {
    const OutlineDistance8 near = distance(*end.outline, rho, rise);
    return w - (near.value * near.radial / rho) * radial_vector - (near.value * near.axial) * u;
  } else {
    return stdx::min(Float8(1.0f), end.ring / rho) * radial_vector +
           stdx::max(rise, Float8(0.0f)) * u;
  }
}

/// A plane through q with normal `m`, and its distances to eight tools behind it.
struct Plane {
  Vector8 m;
  Float8 gap;
  Float8 error_bound;  // of `gap`
  Float8 behind;       // positive if the nearest point of the core lies behind q
};

[[gnu::always_inline]] inline unsigned candidate_bits(const Plane& plane) {
  return bits(!(plane.gap - plane.error_bound > 0.0f));
}

const RayEnd& central_ray(const RayEnd& end) { return end; }
const RayEnd& central_ray(const PatchEnd& rays) { return rays.end; }

/// Returns the multiple of n to subtract from m so that m n <= 0 for every ray.
[[gnu::always_inline]] inline Float8 normal_correction(const Vector8& m, const RayEnd& end) {
  return stdx::max(dot(m, spread(end.n)), Float8(0.0f));
}
[[gnu::always_inline]] inline Float8 normal_correction(const Vector8& m, const PatchEnd& rays) {
  return stdx::max(dot(m, spread(rays.end.n)) + rays.tilt * magnitude(m), Float8(0.0f));
}

/// Returns the largest distance of the rays' ends from their centre along m, times |m|.
[[gnu::always_inline]] inline Float8 extent(const Vector8&, const RayEnd&) { return Float8(0.0f); }
[[gnu::always_inline]] inline Float8 extent(const Vector8& m, const PatchEnd& rays) {
  Float8 sum(0.0f);
  for (int d = 0; d < 3; ++d) sum += rays.half[d] * stdx::abs(dot(m, spread(rays.axis[d])));
  return sum;
}

/// Returns the approximate direction from the nearest point of the cutters' cores to the end of the
/// ray.
template <CutterForm form>
[[gnu::always_inline]] inline Vector8 separation_direction(const RayEnd& end,
                                                           const SweepNode& node) {
  const Vector8 p = spread(end.p);
  const Vector8 low = load(node.low);
  const Vector8 high = load(node.high);
  const Vector8 cone_axis = load(node.cone_axis);
  const Vector8 slab_normal = load(node.slab_normal);
  const Float8 slab_low = load(node.slab_low);
  const Float8 slab_high = load(node.slab_high);
  const auto from_nearest = [&](const Vector8& point) __attribute__((always_inline)) {
    const Float8 height = dot(point - low, slab_normal);
    const Float8 lift = stdx::min(stdx::max(height, slab_low), slab_high) - height;
    return point - clamp(point + lift * slab_normal, low, high);
  };
  Vector8 m = from_nearest(p);
  if constexpr (form == CutterForm::Ball) {
    Float8 rise = stdx::max(dot(m, cone_axis), Float8(0.0f));
    for (int i = 0; i < shaft_steps && stdx::any_of(rise > 0.0f); ++i) {
      m = from_nearest(p - rise * cone_axis);
      rise = stdx::max(dot(m, cone_axis) + rise, Float8(0.0f));
    }
  } else {
    Vector8 w = m;  // to p from the nearest position of k
    Vector8 previous_step = m;
    for (int i = 0; i < core_steps; ++i) {
      const Vector8 core = core_point<form>(end, w, cone_axis);
      m = from_nearest(p - core);
      const Vector8 next_w = m + core;
      const Vector8 step = next_w - w;
      w = next_w;
      if (i == 1) {  // the steps form a geometric series: extrapolate to its limit
        const Float8 ratio = dot(step, previous_step) / (dot(previous_step, previous_step) + tiny);
        w = w + stdx::min(stdx::max(ratio / (1.0f - ratio), Float8(0.0f)), Float8(30.0f)) * step;
      }
      previous_step = step;
    }
  }
  return m;
}

template <CutterForm form, class Rays>
[[gnu::always_inline]] inline Plane bound_plane(const Rays& rays, const SweepNode& node) {
  const RayEnd& end = central_ray(rays);
  const Vector8 cone_axis = load(node.cone_axis);
  const Float8 cos_spread = load(node.cos_spread);
  const Float8 sin_spread = load(node.sin_spread);
  const Vector8 slab_normal = load(node.slab_normal);
  const Vector8 n = spread(end.n);
  const Vector8 m0 = separation_direction<form>(end, node);
  const Float8 correction = normal_correction(m0, rays);
  const Vector8 m = m0 - correction * n;
  // The components of m across the slab and along it are bounded separately: m (q - k) is their sum
  // whatever the length of `slab_normal`.
  const Vector8 from_low = spread(end.p) - load(node.low);
  const Vector8 from_high = spread(end.p) - load(node.high);
  const Float8 across_slab = dot(m, slab_normal);
  const Float8 height = dot(from_low, slab_normal);
  const Vector8 in_slab = m - across_slab * slab_normal;
  const Float8 separation = stdx::min(across_slab * (height - load(node.slab_low)),
                                      across_slab * (height - load(node.slab_high))) +
                            stdx::min(in_slab.x * from_low.x, in_slab.x * from_high.x) +
                            stdx::min(in_slab.y * from_low.y, in_slab.y * from_high.y) +
                            stdx::min(in_slab.z * from_low.z, in_slab.z * from_high.z);
  const Float8 length = magnitude(m);
  // The u of the cone nearest to m has the largest m u and, if that is negative, also the largest
  // |m x u|. The angle between m and the cone's axis is then at least a right angle, so that
  // nothing cancels in the sine of the angle reduced by the spread.
  const Float8 along = dot(m, cone_axis);
  const Float8 sine_component = magnitude(cross(m, cone_axis));
  Float8 upward = along * cos_spread + sine_component * sin_spread;
  stdx::where(along > length * cos_spread, upward) = length;
  Float8 support;
  if constexpr (form == CutterForm::Outlined) {
    support = cone_support(*end.outline, {along, sine_component, length}, {cos_spread, sin_spread});
    stdx::where(cos_spread < 0.0f, support) = (end.radius + end.flank) * length;
  } else {
    support = end.corner * length;
    if constexpr (form == CutterForm::Rounded)
      support += end.ring * (sine_component * cos_spread - along * sin_spread);
    stdx::where(upward > 0.0f, support) = end.radius * length + (end.flank - end.corner) * upward;
  }
  return {m, separation - support - extent(m, rays), end.error_bound * (length + correction),
          correction};
}

/// Overload for the moves of a leaf.
/// @param p  end of the ray relative to the leaf's origin
template <CutterForm form>
[[gnu::always_inline]] inline Vector8 separation_direction(const Vector8& p, const RayEnd& end,
                                                           const SweepLeaf& leaf) {
  const Vector8 k0 = load(leaf.k0);
  const Vector8 k1 = load(leaf.k1);
  const Vector8 u0 = load(leaf.u0);
  const Vector8 u1 = load(leaf.u1);
  const Vector8 step = k1 - k0;
  const Vector8 axis_step = u1 - u0;
  const Float8 inverse_squared_length = 1.0f / (dot(step, step) + tiny);
  const auto from_nearest = [&](const Vector8& point, Float8& t) __attribute__((always_inline)) {
    const Vector8 w = point - k0;
    t = stdx::min(stdx::max(dot(w, step) * inverse_squared_length, Float8(0.0f)), Float8(1.0f));
    return w - t * step;
  };
  Float8 t;
  Vector8 m = from_nearest(p, t);
  if constexpr (form == CutterForm::Ball) {
    for (int i = 0; i < shaft_steps; ++i) {
      const Vector8 u = u0 + t * axis_step;
      m = from_nearest(p - stdx::max(dot(p - k0 - t * step, u), Float8(0.0f)) * u, t);
    }
  } else {
    Float8 t0 = t;
    Float8 t1 = t;
    for (int i = 0; i < core_steps; ++i) {
      const Vector8 u = u0 + t * axis_step;
      const Vector8 core = core_point<form>(end, p - k0 - t * step, u);
      t0 = t1;
      t1 = t;
      m = from_nearest(p - core, t);
      if (i == 1) {  // the steps form a geometric series: extrapolate to its limit
        const Float8 second_difference = t - 2.0f * t1 + t0;
        const Float8 limit = t - (t - t1) * (t - t1) / second_difference;
        stdx::where(stdx::abs(second_difference) > 1e-6f, t) =
            stdx::min(stdx::max(limit, Float8(0.0f)), Float8(1.0f));
      }
    }
  }
  return m;
}

template <CutterForm form, class Rays>
[[gnu::always_inline]] inline Plane bound_plane(const Rays& rays, const SweepLeaf& leaf,
                                                const SweepLeafFrame& frame) {
  const RayEnd& end = central_ray(rays);
  const float local[3] = {float(end.point[0] - frame.origin[0]),
                          float(end.point[1] - frame.origin[1]),
                          float(end.point[2] - frame.origin[2])};
  const float offset = std::abs(local[0]) + std::abs(local[1]) + std::abs(local[2]);
  const Float8 error_bound(move_rounding * (offset + frame.reach));
  const Vector8 p = spread(local);
  const Vector8 u0 = load(leaf.u0);
  const Vector8 u1 = load(leaf.u1);
  const Vector8 axis_step = u1 - u0;
  const Vector8 n = spread(end.n);
  const Vector8 m0 = separation_direction<form>(p, end, leaf);
  const Float8 correction = normal_correction(m0, rays);
  const Vector8 m = m0 - correction * n;
  const Float8 length = magnitude(m);
  Float8 upward = -length;
  const auto extreme_height = [&](const Vector8& k, const Vector8& u)
      __attribute__((always_inline)) {
    const Float8 along_axis = dot(m, u);
    upward = stdx::max(upward, along_axis);
    const Float8 across_axis = magnitude(cross(m, u));
    if constexpr (form == CutterForm::Outlined) {
      return dot(m, k) + reach(*end.outline, across_axis, along_axis).value;
    } else {
      Float8 h = end.corner * length + end.ring * across_axis;
      const Float8 top = (end.flank - end.corner) * along_axis + end.radius * across_axis;
      stdx::where(along_axis > 0.0f, h) = top;
      return dot(m, k) + h;
    }
  };
  const Float8 max_height =
      stdx::max(extreme_height(load(leaf.k0), u0), extreme_height(load(leaf.k1), u1));
  // Between the ends the point of the tool that is foremost along m departs from its chord by arm
  // angle^2 / 8. The arm is the point's component along m: R where m u <= 0, R + flank at most. If
  // m u <= 0 at both ends, it is so in between, because (m u)'' = -angle^2 m u.
  Float8 arm(end.radius);
  stdx::where(upward > 0.0f, arm) = Float8(end.radius + end.flank);
  const Float8 sag = arm * (0.13f * dot(axis_step, axis_step)) * length;
  return {m, dot(m, p) - max_height - sag - extent(m, rays), error_bound * (length + correction),
          correction};
}

template <std::size_t n>
std::array<Clearance, n> plane_clearances(const Plane& plane) {
  std::array<Clearance, n> result;
  for (std::size_t i = 0; i < n; ++i)
    result[i] = {{plane.m.x[i], plane.m.y[i], plane.m.z[i]}, plane.gap[i], plane.error_bound[i]};
  return result;
}

CutterForm cutter_form(const RayEnd& end) {
  if (end.outline != nullptr) return CutterForm::Outlined;
  return end.ring == 0.0f ? CutterForm::Ball : CutterForm::Rounded;
}

/// Calls `visit` with the form as a compile-time constant.
template <class Visitor>
auto dispatch_form(const RayEnd& end, const Visitor& visit) {
  switch (cutter_form(end)) {
    case CutterForm::Ball:
      return visit(std::integral_constant<CutterForm, CutterForm::Ball>());
    case CutterForm::Outlined:
      return visit(std::integral_constant<CutterForm, CutterForm::Outlined>());
    case CutterForm::Rounded:
      break;
  }
  return visit(std::integral_constant<CutterForm, CutterForm::Rounded>());
}

template <CutterForm form, class Segment>
Candidates8 find_candidate_children(const SweepNode& node, const Segment& ray) {
  const Plane plane = bound_plane<form>(ray.end, node);
  Candidates8 candidates{candidate_bits(plane)};
  const Float8 margin = plane.gap - plane.error_bound;
  margin.copy_to(candidates.separation, stdx::vector_aligned);
  // The plane at the start is computed only if it can rule out a candidate of the plane at the end.
  if ((candidates.bits & bits(plane.behind > 0.0f)) != 0)
    candidates.bits &= candidate_bits(bound_plane<form>(ray.start, node));
  return candidates;
}

template <CutterForm form, class Segment>
Candidates8 find_candidate_moves(const SweepLeaf& leaf, const SweepLeafFrame& frame,
                                 const Segment& ray) {
  const Plane plane = bound_plane<form>(ray.end, leaf, frame);
  Candidates8 candidates{candidate_bits(plane) & ((1u << frame.count) - 1u)};
  plane.gap.copy_to(candidates.separation, stdx::vector_aligned);
  if ((candidates.bits & bits(plane.behind > 0.0f)) != 0)
    candidates.bits &= candidate_bits(bound_plane<form>(ray.start, leaf, frame));
  return candidates;
}

}  // namespace

int Candidates8::nearest() const {
  int best = std::countr_zero(bits);
  for (unsigned remaining = bits & (bits - 1); remaining != 0; remaining &= remaining - 1) {
    const int i = std::countr_zero(remaining);
    if (separation[i] < separation[best]) best = i;
  }
  return best;
}

Candidates8 candidate_children(const SweepNode& node, const RaySegment& ray) {
  return dispatch_form(ray.end,
                       [&](auto form) { return find_candidate_children<form()>(node, ray); });
}

Candidates8 candidate_moves(const SweepLeaf& leaf, const SweepLeafFrame& frame,
                            const RaySegment& ray) {
  return dispatch_form(ray.end,
                       [&](auto form) { return find_candidate_moves<form()>(leaf, frame, ray); });
}

Candidates8 candidate_children(const SweepNode& node, const PatchSegment& rays) {
  return dispatch_form(rays.end.end,
                       [&](auto form) { return find_candidate_children<form()>(node, rays); });
}

Candidates8 candidate_moves(const SweepLeaf& leaf, const SweepLeafFrame& frame,
                            const PatchSegment& rays) {
  return dispatch_form(rays.end.end,
                       [&](auto form) { return find_candidate_moves<form()>(leaf, frame, rays); });
}

std::array<Clearance, SweepNode::width> clearances(const SweepNode& node, const RayEnd& end) {
  return dispatch_form(end, [&](auto form) {
    return plane_clearances<SweepNode::width>(bound_plane<form()>(end, node));
  });
}

std::array<Clearance, SweepLeaf::width> clearances(const SweepLeaf& leaf,
                                                   const SweepLeafFrame& frame, const RayEnd& end) {
  return dispatch_form(end, [&](auto form) {
    return plane_clearances<SweepLeaf::width>(bound_plane<form()>(end, leaf, frame));
  });
}

}  // namespace abbe::cutting
