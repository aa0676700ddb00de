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

constexpr std::size_t max_slab_leaves = 512;  // of a child; the surface over more leaves is not
                                              // flat
constexpr int core_steps = 4;                 // iterations towards the nearest point of a tool
constexpr int shaft_steps = 2;                // the same for a ball on its shaft
constexpr float move_rounding = 3e-6f;        // of a distance; proved below to be sufficient
constexpr float node_rounding = 4e-6f;        // the same for a node

// Returns the largest float that is not above x, so that a bound stays a bound.
float below(double x) {
  const float f = float(x);
  return double(f) <= x ? f : std::nextafterf(f, -std::numeric_limits<float>::infinity());
}
float above(double x) { return -below(-x); }

Vector3d at(const float (&v)[3][8], int i) { return {v[0][i], v[1][i], v[2][i]}; }

// Construction of the bounds.

/// The centre of the corner circle's plane and the axis at the ends of a move.
struct Ends {
  Vector3d k0, k1, u0, u1;
};

Ends ends_of(const Move& move, double corner_radius) {
  Ends e;
  const auto axis = [&](double t) -> Vector3d {
    return std::cos(t * move.angle) * move.axis + std::sin(t * move.angle) * move.side;
  };
  e.u0 = move.from == 0 ? move.axis : axis(move.from);
  e.u1 = move.angle == 0 ? e.u0 : axis(move.to);
  e.k0 = move.tip + move.from * move.step + corner_radius * e.u0;
  e.k1 = move.tip + move.to * move.step + corner_radius * e.u1;
  return e;
}

/// Returns the direction in which points of the given covariance spread least.
Vector3d flattest(const Eigen::Matrix3d& covariance) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  const Vector3d direction = solver.eigenvectors().col(0);
  return direction.allFinite() && direction.norm() > 0.5 ? direction.normalized()
                                                         : Vector3d::UnitZ().eval();
}

// Adds the slab between two parallel planes that contains all k of the leaves. Passes over a
// surface lie nearly in a plane, where a box that stands askew would be thick.
void add_slab(SweepBounds& b, const SweepLeaves& leaves, std::size_t first, std::size_t end) {
  const auto each_end = [&](const auto& use) {
    for (std::size_t l = first; l < end; ++l) {
      const Vector3d offset = Vector3d(leaves.places[l].origin) - b.low;
      for (int i = 0; i < leaves.places[l].count; ++i) {
        use(at(leaves.moves[l].k0, i) + offset);
        use(at(leaves.moves[l].k1, i) + offset);
      }
    }
  };
  const Vector3d middle = 0.5 * (b.high - b.low);
  Vector3d sum = Vector3d::Zero();
  Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
  double count = 0.0;
  double slack = 0.0;
  for (std::size_t l = first; l < end; ++l) slack = std::max(slack, double(leaves.places[l].slack));
  each_end([&](const Vector3d& k) {
    const Vector3d d = k - middle;
    sum += d;
    square += d * d.transpose();
    count += 1.0;
  });
  const Vector3d flat = flattest(square / count - sum * sum.transpose() / (count * count));
  // through float, so that the heights are computed with the direction that the node stores
  b.flat = flat.cast<float>().cast<double>();
  b.flat_low = std::numeric_limits<double>::infinity();
  b.flat_high = -b.flat_low;
  each_end([&](const Vector3d& k) {
    const double height = b.flat.dot(k);
    b.flat_low = std::min(b.flat_low, height);
    b.flat_high = std::max(b.flat_high, height);
  });
  // 1 % because `flat` is a unit vector only to rounding
  b.flat_low -= 1.01 * slack;
  b.flat_high += 1.01 * slack;
}

}  // namespace

void put(SweepLeaves& leaves, std::size_t l, const Cutter& cutter, std::span<const Move> moves) {
  SweepLeaf& leaf = leaves.moves[l];
  SweepLeafPlace& place = leaves.places[l];
  place.count = int(moves.size());
  Vector3d origin = Vector3d::Zero();
  double reach = 0.0;
  double turn2 = 0.0;
  for (int i = 0; i < SweepLeaf::width; ++i) {
    const Ends e = ends_of(moves[std::size_t(std::min(i, place.count - 1))], cutter.corner_radius);
    if (i == 0) origin = e.k0;
    reach = std::max({reach, (e.k0 - origin).norm(), (e.k1 - origin).norm()});
    turn2 = std::max(turn2, (e.u1 - e.u0).squaredNorm());
    for (int d = 0; d < 3; ++d) {
      leaf.k0[d][i] = float(e.k0[d] - origin[d]);
      leaf.k1[d][i] = float(e.k1[d] - origin[d]);
      leaf.u0[d][i] = float(e.u0[d]);
      leaf.u1[d][i] = float(e.u1[d]);
    }
  }
  std::copy_n(origin.data(), 3, place.origin);
  place.reach = float(reach + cutter.radius + cutter.flank_length);
  // 0.13 instead of 1/8 covers the rounding; 2e-7 is the rounding of k to float
  place.slack = float(0.13 * cutter.corner_radius * turn2) + 2e-7f * place.reach;
}

SweepBounds bounds_of(const SweepLeaves& leaves, std::size_t l) {
  const SweepLeaf& leaf = leaves.moves[l];
  const SweepLeafPlace& place = leaves.places[l];
  SweepBounds b;
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < place.count; ++i) {
    for (const Vector3d& k : {at(leaf.k0, i), at(leaf.k1, i)}) {
      b.low = b.low.cwiseMin(k);
      b.high = b.high.cwiseMax(k);
    }
    sum += at(leaf.u0, i) + at(leaf.u1, i);
  }
  const Vector3d origin(place.origin);
  b.low += origin - Vector3d::Constant(place.slack);
  b.high += origin + Vector3d::Constant(place.slack);
  add_slab(b, leaves, l, l + 1);
  // axes that nearly cancel have no mean direction
  if (sum.norm() < 1e-3 * place.count) {
    b.spread = pi;
    return b;
  }
  b.cone = sum.normalized();
  for (int i = 0; i < place.count; ++i)
    for (const Vector3d& u : {at(leaf.u0, i), at(leaf.u1, i)})
      b.spread = std::max(b.spread, std::atan2(u.cross(b.cone).norm(), u.dot(b.cone)));
  // rounding of the cone's axis to float
  b.spread += 1e-6;
  return b;
}

SweepBounds bounds_of(const SweepNode& node, int children, const Vector3d& centre,
                      const SweepLeaves& leaves, std::size_t first, std::size_t end) {
  SweepBounds b;
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < children; ++i) {
    b.low = b.low.cwiseMin(at(node.low, i) + centre);
    b.high = b.high.cwiseMax(at(node.high, i) + centre);
    sum += at(node.cone, i);
  }
  if (end - first <= max_slab_leaves) add_slab(b, leaves, first, end);
  if (sum.norm() < 1e-3 * children) {
    b.spread = pi;
    return b;
  }
  b.cone = sum.normalized();
  for (int i = 0; i < children; ++i) {
    const Vector3d c = at(node.cone, i);
    const double own = std::atan2(double(node.sin_spread[i]), double(node.cos_spread[i]));
    b.spread = std::max(b.spread, own + std::atan2(c.cross(b.cone).norm(), c.dot(b.cone)));
  }
  b.spread += 1e-6;
  return b;
}

void put(SweepNode& node, int child, const SweepBounds& b, const Vector3d& centre) {
  for (int d = 0; d < 3; ++d) {
    // 1e-9 mm covers the rounding of the doubles
    node.low[d][child] = below(b.low[d] - centre[d] - 1e-9);
    node.high[d][child] = above(b.high[d] - centre[d] + 1e-9);
    node.cone[d][child] = float(b.cone[d]);
    node.flat[d][child] = float(b.flat[d]);
  }
  const Vector3d rounding = b.low - (at(node.low, child) + centre);
  node.flat_low[child] = below(b.flat_low + b.flat.dot(rounding) - 1e-9);
  node.flat_high[child] = above(b.flat_high + b.flat.dot(rounding) + 1e-9);
  // a cone wider than 1.5 rad rules out almost nothing, and its tests need an acute angle
  const bool any = b.spread > 1.5;
  node.cos_spread[child] = any ? -1.0f : float(std::cos(b.spread));
  node.sin_spread[child] = any ? 0.0f : float(std::sin(b.spread));
}

RayEnd::RayEnd(const Cutter& cutter, const Ray& ray, double s, const Vector3d& centre,
               double reach_of_nodes)
    : reach(above(reach_of_nodes)),
      radius(above(cutter.radius)),
      corner(above(cutter.corner_radius)),
      ring(above(cutter.radius - cutter.corner_radius)),
      flank(above(cutter.flank_length)),
      outline(cutter.outline.get()) {
  for (int d = 0; d < 3; ++d) n[d] = float(ray.normal[d]);
  cut_off(ray, s, centre);
}

void RayEnd::cut_off(const Ray& ray, double s, const Vector3d& centre) {
  for (int d = 0; d < 3; ++d) {
    point[d] = ray.point[d] + s * ray.normal[d];
    p[d] = float(point[d] - centre[d]);
  }
  doubt = node_rounding * (std::abs(p[0]) + std::abs(p[1]) + std::abs(p[2]) + reach);
  if (outline != nullptr) doubt *= 1.5f;
}

RaySegment::RaySegment(const Cutter& cutter, const Ray& ray, double s, const Vector3d& centre,
                       double reach_of_nodes)
    : end(cutter, ray, s, centre, reach_of_nodes),
      start(cutter, {ray.point, -ray.normal, ray.band}, ray.band, centre, reach_of_nodes) {}

PatchEnd::PatchEnd(const RayEnd& middle, const Eigen::Matrix3d& axes, const Vector3d& halves,
                   double tangent)
    : end(middle), tilt(above(1.001 * tangent + 1e-6)) {
  for (int d = 0; d < 3; ++d) {
    for (int k = 0; k < 3; ++k) axis[d][k] = float(axes(k, d));
    half[d] = above(1.001 * halves[d] + 1e-9);
  }
  end.doubt *= 1.5f;
}

// Testing the bounds against a ray. With q the point where the ray is cut off, a plane through q
// with normal m, m n <= 0, has the whole ray up to q on its outer side. Tools that all lie on the
// inner side remove nothing before q:
// m q > max m k + h(m), where h is the support of the tool about k. With u the axis,
//   h = r |m| + ring |m x u| if m u <= 0, (flank - r) m u + R |m x u| if m u > 0.
// m is the direction to q from the nearest point of the tool's core, turned to be normal to n if
// need be. The bound holds for any m, so rounding in the computation of m does no harm.
//
// Such a plane has the whole line before q on its outer side, including cutters far behind the
// start of the ray. If the nearest point lies behind q, the test is repeated from the start, for
// the reversed ray.
//
// Rounding of the test itself. Let e = 2^-24, D = |q| + |k| + R + flank about the bound's origin,
// m0 the direction before it is turned normal to n, |m0| <= |m| + turned. In units of e D |m0|:
//   1  q and k as floats
//   8  a move: the products m q and m k;  28  a node: parts of m, differences from two corners,
//      products with both and sums, each part at most D |m|
//   3  sums of the terms
//  14  |m x u| (7: as a norm of the cross product it is accurate to e |m| however small it is; a
//      difference of squares would be to the root of e), m u (4) and their products with R and
//      flank; 20 where they are turned by the spread of a cone
//   8  m n <= 0 fails by 8 e |m0| (all of m may be what is left of m0), over no more than D of the
//      ray: what is farther from q lies in no cutter
// So 34 for a move and 60 for a node, that is 2.1e-6 and 3.6e-6.
// tests/cutting/sweep_bounds_test.cpp searches for larger errors.
//
// Neighbouring rays. Their ends q lie in a box about its middle c: m q >= m c - sum |m a| h over
// its axes a and halves h. With the tangent t of the largest angle between a ray's normal and n, m
// n <= -t |m0| after the turn and |m|^2 <= (1 + t^2) |m0|^2, so that m n' <= 0 for every normal n'
// within that angle: m n' <= m n cos + sqrt(|m|^2 - (m n)^2) sin, which is at most 0 where -m n >=
// tan sqrt(|m|^2 - (m n)^2), and |m|^2 - (m n)^2 <= |m0|^2. Halves and tangent are enlarged by a
// thousandth, compared with which their rounding is nothing, and the doubt of a node by half for
// the turn.

namespace {

enum class Form { Ball, Rounded, Outlined };

/// Components of a direction along an axis and across it.
struct Steepness {
  Float8 along, across, length;
};
// Cosine and sine of half the opening of a cone.
struct Spread {
  Float8 cosine, sine;
};

/// Returns an upper bound of the reach of an outline in a direction whose angle to the axis is
/// known only to within a spread. Any direction in the range is a combination of the two limits
/// whose coefficients sum to at most 1 / cos of the spread, and to at least 1, which matters for an
/// outline that begins above the tip and ends below a plane.
[[gnu::always_inline]] inline Float8 support_within(const ToolOutline& outline, const Steepness& m,
                                                    const Spread& spread) {
  Float8 nearer = m.across * spread.cosine - m.along * spread.sine;
  Float8 upward = m.along * spread.cosine + m.across * spread.sine;
  Float8 farther = m.across * spread.cosine + m.along * spread.sine;
  Float8 downward = m.along * spread.cosine - m.across * spread.sine;
  const auto up = nearer < 0.0f, down = farther < 0.0f;
  stdx::where(up, nearer) = Float8(0.0f);
  stdx::where(up, upward) = m.length;
  stdx::where(down, farther) = Float8(0.0f);
  stdx::where(down, downward) = -m.length;
  const Float8 most =
      stdx::max(reach(outline, nearer, upward).most, reach(outline, farther, downward).most);
  return stdx::max(most, most / spread.cosine);
}

/// Returns the vector to a point w about k from the nearest point of the core, which stands about k
/// along u.
template <Form form>
[[gnu::always_inline]] inline Vector8 core_towards(const RayEnd& end, const Vector8& w,
                                                   const Vector8& u) {
  const Float8 rise = dot(w, u);
  const Vector8 across = w - rise * u;
  const Float8 rho = length_of(across);
  if constexpr (form == Form::Outlined) {
    const OutlineDistance8 near = distance(*end.outline, rho, rise);
    return w - (near.value * near.radial / rho) * across - (near.value * near.axial) * u;
  } else {
    return stdx::min(Float8(1.0f), end.ring / rho) * across + stdx::max(rise, Float8(0.0f)) * u;
  }
}

/// A plane through q with normal `m`, and its distances to eight tools behind it.
struct Plane {
  Vector8 m;
  Float8 gap;
  Float8 doubt;   // amount by which gap may be too large
  Float8 behind;  // positive if the nearest point of the core lies behind q
};

[[gnu::always_inline]] inline unsigned open_of(const Plane& plane) {
  return bits(!(plane.gap - plane.doubt > 0.0f));
}

const RayEnd& middle_of(const RayEnd& end) { return end; }
const RayEnd& middle_of(const PatchEnd& rays) { return rays.end; }

/// Returns by how much m must be turned along n so that m n <= 0 for every ray.
[[gnu::always_inline]] inline Float8 turned_by(const Vector8& m, const RayEnd& end) {
  return stdx::max(dot(m, spread(end.n)), Float8(0.0f));
}
[[gnu::always_inline]] inline Float8 turned_by(const Vector8& m, const PatchEnd& rays) {
  return stdx::max(dot(m, spread(rays.end.n)) + rays.tilt * length_of(m), Float8(0.0f));
}

/// Returns the extent of the rays' ends from their middle along m.
[[gnu::always_inline]] inline Float8 extent_along(const Vector8&, const RayEnd&) {
  return Float8(0.0f);
}
[[gnu::always_inline]] inline Float8 extent_along(const Vector8& m, const PatchEnd& rays) {
  Float8 sum(0.0f);
  for (int d = 0; d < 3; ++d) sum += rays.half[d] * stdx::abs(dot(m, spread(rays.axis[d])));
  return sum;
}

/// Returns approximately the direction from the nearest point of the cutters' cores to the end of
/// the ray.
template <Form form>
[[gnu::always_inline]] inline Vector8 direction_to(const RayEnd& end, const SweepNode& node) {
  const Vector8 p = spread(end.p);
  const Vector8 low = load(node.low);
  const Vector8 high = load(node.high);
  const Vector8 cone = load(node.cone);
  const Vector8 flat = load(node.flat);
  const Float8 flat_low = load(node.flat_low);
  const Float8 flat_high = load(node.flat_high);
  const auto from_nearest = [&](const Vector8& point) __attribute__((always_inline)) {
    const Float8 height = dot(point - low, flat);
    const Float8 lift = stdx::min(stdx::max(height, flat_low), flat_high) - height;
    return point - clamp(point + lift * flat, low, high);
  };
  Vector8 m = from_nearest(p);
  if constexpr (form == Form::Ball) {
    Float8 rise = stdx::max(dot(m, cone), Float8(0.0f));
    for (int i = 0; i < shaft_steps && stdx::any_of(rise > 0.0f); ++i) {
      m = from_nearest(p - rise * cone);
      rise = stdx::max(dot(m, cone) + rise, Float8(0.0f));
    }
  } else {
    Vector8 w = m;  // to p from the nearest position of k
    Vector8 last_step = m;
    for (int i = 0; i < core_steps; ++i) {
      const Vector8 core = core_towards<form>(end, w, cone);
      m = from_nearest(p - core);
      const Vector8 next = m + core;
      const Vector8 step = next - w;
      w = next;
      if (i == 1) {  // the steps form a geometric series: extrapolate to its limit
        const Float8 ratio = dot(step, last_step) / (dot(last_step, last_step) + tiny);
        w = w + stdx::min(stdx::max(ratio / (1.0f - ratio), Float8(0.0f)), Float8(30.0f)) * step;
      }
      last_step = step;
    }
  }
  return m;
}

template <Form form, class Rays>
[[gnu::always_inline]] inline Plane plane_before(const Rays& rays, const SweepNode& node) {
  const RayEnd& end = middle_of(rays);
  const Vector8 cone = load(node.cone);
  const Float8 cos_spread = load(node.cos_spread);
  const Float8 sin_spread = load(node.sin_spread);
  const Vector8 flat = load(node.flat);
  const Vector8 n = spread(end.n);
  const Vector8 m0 = direction_to<form>(end, node);
  const Float8 turned = turned_by(m0, rays);
  const Vector8 m = m0 - turned * n;
  // The components of m across the slab and along it are bounded separately: m (q - k) is their sum
  // whatever the length of `flat`.
  const Vector8 from_low = spread(end.p) - load(node.low);
  const Vector8 from_high = spread(end.p) - load(node.high);
  const Float8 steep = dot(m, flat);
  const Float8 height = dot(from_low, flat);
  const Vector8 rest = m - steep * flat;
  const Float8 apart =
      stdx::min(steep * (height - load(node.flat_low)), steep * (height - load(node.flat_high))) +
      stdx::min(rest.x * from_low.x, rest.x * from_high.x) +
      stdx::min(rest.y * from_low.y, rest.y * from_high.y) +
      stdx::min(rest.z * from_low.z, rest.z * from_high.z);
  const Float8 length = length_of(m);
  // The u of the cone that is nearest to m has the largest m u and, if that is negative, also
  // the largest |m x u|. The angle to the cone's axis is then at least a right angle, so that
  // nothing cancels in the sine of the angle that remains after the spread.
  const Float8 along = dot(m, cone);
  const Float8 beside = length_of(cross(m, cone));
  Float8 upward = along * cos_spread + beside * sin_spread;
  stdx::where(along > length * cos_spread, upward) = length;
  Float8 support;
  if constexpr (form == Form::Outlined) {
    support = support_within(*end.outline, {along, beside, length}, {cos_spread, sin_spread});
    stdx::where(cos_spread < 0.0f, support) = (end.radius + end.flank) * length;
  } else {
    support = end.corner * length;
    if constexpr (form == Form::Rounded)
      support += end.ring * (beside * cos_spread - along * sin_spread);
    stdx::where(upward > 0.0f, support) = end.radius * length + (end.flank - end.corner) * upward;
  }
  return {m, apart - support - extent_along(m, rays), end.doubt * (length + turned), turned};
}

/// The direction for moves; p is the end of the ray about their origin.
template <Form form>
[[gnu::always_inline]] inline Vector8 direction_to(const Vector8& p, const RayEnd& end,
                                                   const SweepLeaf& leaf) {
  const Vector8 k0 = load(leaf.k0);
  const Vector8 k1 = load(leaf.k1);
  const Vector8 u0 = load(leaf.u0);
  const Vector8 u1 = load(leaf.u1);
  const Vector8 step = k1 - k0;
  const Vector8 turn = u1 - u0;
  const Float8 per_length2 = 1.0f / (dot(step, step) + tiny);
  const auto from_nearest = [&](const Vector8& point, Float8& t) __attribute__((always_inline)) {
    const Vector8 w = point - k0;
    t = stdx::min(stdx::max(dot(w, step) * per_length2, Float8(0.0f)), Float8(1.0f));
    return w - t * step;
  };
  Float8 t;
  Vector8 m = from_nearest(p, t);
  if constexpr (form == Form::Ball) {
    for (int i = 0; i < shaft_steps; ++i) {
      const Vector8 u = u0 + t * turn;
      m = from_nearest(p - stdx::max(dot(p - k0 - t * step, u), Float8(0.0f)) * u, t);
    }
  } else {
    Float8 t0 = t;
    Float8 t1 = t;
    for (int i = 0; i < core_steps; ++i) {
      const Vector8 u = u0 + t * turn;
      const Vector8 core = core_towards<form>(end, p - k0 - t * step, u);
      t0 = t1;
      t1 = t;
      m = from_nearest(p - core, t);
      if (i == 1) {  // the steps form a geometric series: extrapolate to its limit
        const Float8 bend = t - 2.0f * t1 + t0;
        const Float8 limit = t - (t - t1) * (t - t1) / bend;
        stdx::where(stdx::abs(bend) > 1e-6f, t) =
            stdx::min(stdx::max(limit, Float8(0.0f)), Float8(1.0f));
      }
    }
  }
  return m;
}

template <Form form, class Rays>
[[gnu::always_inline]] inline Plane plane_before(const Rays& rays, const SweepLeaf& leaf,
                                                 const SweepLeafPlace& place) {
  const RayEnd& end = middle_of(rays);
  const float local[3] = {float(end.point[0] - place.origin[0]),
                          float(end.point[1] - place.origin[1]),
                          float(end.point[2] - place.origin[2])};
  const float distance = std::abs(local[0]) + std::abs(local[1]) + std::abs(local[2]);
  const Float8 doubt(move_rounding * (distance + place.reach));
  const Vector8 p = spread(local);
  const Vector8 u0 = load(leaf.u0);
  const Vector8 u1 = load(leaf.u1);
  const Vector8 turn = u1 - u0;
  const Vector8 n = spread(end.n);
  const Vector8 m0 = direction_to<form>(p, end, leaf);
  const Float8 turned = turned_by(m0, rays);
  const Vector8 m = m0 - turned * n;
  const Float8 length = length_of(m);
  Float8 upward = -length;
  const auto farthest = [&](const Vector8& k, const Vector8& u) __attribute__((always_inline)) {
    const Float8 along = dot(m, u);
    upward = stdx::max(upward, along);
    const Float8 across = length_of(cross(m, u));
    if constexpr (form == Form::Outlined) {
      return dot(m, k) + reach(*end.outline, across, along).most;
    } else {
      Float8 h = end.corner * length + end.ring * across;
      const Float8 top = (end.flank - end.corner) * along + end.radius * across;
      stdx::where(along > 0.0f, h) = top;
      return dot(m, k) + h;
    }
  };
  const Float8 most = stdx::max(farthest(load(leaf.k0), u0), farthest(load(leaf.k1), u1));
  // Between the ends the point of the tool that is foremost along m departs from its chord by arm
  // angle^2 / 8. The arm is its component along m: R where m u <= 0, R + flank at most. If m u <= 0
  // at both ends it is so in between, because (m u)'' = -angle^2 m u.
  Float8 arm(end.radius);
  stdx::where(upward > 0.0f, arm) = Float8(end.radius + end.flank);
  const Float8 sag = arm * (0.13f * dot(turn, turn)) * length;
  return {m, dot(m, p) - most - sag - extent_along(m, rays), doubt * (length + turned), turned};
}

template <std::size_t n>
std::array<Clearance, n> clearances_of(const Plane& plane) {
  std::array<Clearance, n> all;
  for (std::size_t i = 0; i < n; ++i)
    all[i] = {{plane.m.x[i], plane.m.y[i], plane.m.z[i]}, plane.gap[i], plane.doubt[i]};
  return all;
}

Form form_of(const RayEnd& end) {
  if (end.outline != nullptr) return Form::Outlined;
  return end.ring == 0.0f ? Form::Ball : Form::Rounded;
}

/// Calls `use` with the form as a compile-time constant.
template <class Use>
auto by_form(const RayEnd& end, const Use& use) {
  switch (form_of(end)) {
    case Form::Ball:
      return use(std::integral_constant<Form, Form::Ball>());
    case Form::Outlined:
      return use(std::integral_constant<Form, Form::Outlined>());
    case Form::Rounded:
      break;
  }
  return use(std::integral_constant<Form, Form::Rounded>());
}

template <Form form, class Stretch>
Open8 open_children_of(const SweepNode& node, const Stretch& ray) {
  const Plane plane = plane_before<form>(ray.end, node);
  Open8 open{open_of(plane)};
  const Float8 room = plane.gap - plane.doubt;
  room.copy_to(open.separation, stdx::vector_aligned);
  // The second plane is computed only if it can close a child that the first leaves open.
  if ((open.bits & bits(plane.behind > 0.0f)) != 0)
    open.bits &= open_of(plane_before<form>(ray.start, node));
  return open;
}

template <Form form, class Stretch>
Open8 open_moves_of(const SweepLeaf& leaf, const SweepLeafPlace& place, const Stretch& ray) {
  const Plane plane = plane_before<form>(ray.end, leaf, place);
  Open8 open{open_of(plane) & ((1u << place.count) - 1u)};
  plane.gap.copy_to(open.separation, stdx::vector_aligned);
  if ((open.bits & bits(plane.behind > 0.0f)) != 0)
    open.bits &= open_of(plane_before<form>(ray.start, leaf, place));
  return open;
}

}  // namespace

int Open8::nearest() const {
  int best = std::countr_zero(bits);
  for (unsigned left = bits & (bits - 1); left != 0; left &= left - 1) {
    const int i = std::countr_zero(left);
    if (separation[i] < separation[best]) best = i;
  }
  return best;
}

Open8 open_children(const SweepNode& node, const RaySegment& ray) {
  return by_form(ray.end, [&](auto form) { return open_children_of<form()>(node, ray); });
}

Open8 open_moves(const SweepLeaf& leaf, const SweepLeafPlace& place, const RaySegment& ray) {
  return by_form(ray.end, [&](auto form) { return open_moves_of<form()>(leaf, place, ray); });
}

Open8 open_children(const SweepNode& node, const PatchSegment& rays) {
  return by_form(rays.end.end, [&](auto form) { return open_children_of<form()>(node, rays); });
}

Open8 open_moves(const SweepLeaf& leaf, const SweepLeafPlace& place, const PatchSegment& rays) {
  return by_form(rays.end.end, [&](auto form) { return open_moves_of<form()>(leaf, place, rays); });
}

std::array<Clearance, SweepNode::width> clearances(const SweepNode& node, const RayEnd& end) {
  return by_form(end, [&](auto form) {
    return clearances_of<SweepNode::width>(plane_before<form()>(end, node));
  });
}

std::array<Clearance, SweepLeaf::width> clearances(const SweepLeaf& leaf,
                                                   const SweepLeafPlace& place, const RayEnd& end) {
  return by_form(end, [&](auto form) {
    return clearances_of<SweepLeaf::width>(plane_before<form()>(end, leaf, place));
  });
}

}  // namespace abbe::cutting
