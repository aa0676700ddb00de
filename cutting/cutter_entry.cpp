#include "cutting/cutter_entry.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "cutting/ball_entry.h"
#include "cutting/cutter_position.h"
#include "cutting/entry_bounds.h"
#include "cutting/nearly_convex.h"
#include "kinematics/numbers.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

constexpr double straight_tolerance = 1e-9;  // mm, where the search is convex
constexpr double turning_tolerance = 2e-8;   // mm, where the axis turns
constexpr double depth_tolerance = 1e-10;    // mm, of a touch that may be missed
constexpr double least_sine = 1e-15;         // below, the sine between ray and skin is rounding

// ---- the cutter at one instant ------------------------------------------------------------------

/// A ray that meets the cutter: where it enters, and the outward normal of the cutter there.
struct Hit {
  double s;
  Vector3d outward;
};

/// The ray in the frame of the cutter, split along and across its axis.
struct LocalRay {
  Vector3d axis;
  double h, dh;  // height above the tip and its change with s
  Vector3d lateral, dlateral;

  LocalRay(const Position& at, const Vector3d& point, const Vector3d& normal) : axis(at.axis) {
    const Vector3d p = point - at.tip;
    h = p.dot(axis);
    dh = normal.dot(axis);
    lateral = p - h * axis;
    dlateral = normal - dh * axis;
  }
  double height(double s) const { return h + s * dh; }
  Vector3d across(double s) const { return lateral + s * dlateral; }
};

struct Interval {
  double in = -infinity;
  double out = infinity;
};

Interval within_cylinder(const LocalRay& ray, double radius) {
  const double a = ray.dlateral.squaredNorm();
  const double b = ray.lateral.dot(ray.dlateral);
  const double c = ray.lateral.squaredNorm() - radius * radius;
  if (a < 1e-30) return c <= 0 ? Interval{} : Interval{infinity, -infinity};
  const double nearest = -b / a;
  const double half2 = (radius * radius - ray.across(nearest).squaredNorm()) / a;
  if (half2 < 0) return {infinity, -infinity};
  const double half = std::sqrt(half2);
  return {nearest - half, nearest + half};
}

Interval within_slab(const LocalRay& ray, double top) {
  if (ray.dh == 0) return ray.h >= 0 && ray.h <= top ? Interval{} : Interval{infinity, -infinity};
  const double at_bottom = -ray.h / ray.dh;
  const double at_top = (top - ray.h) / ray.dh;
  return {std::min(at_bottom, at_top), std::max(at_bottom, at_top)};
}

/// Entry through the torus corner from a point s outside it, below the flank and within the outer
/// cylinder. Each step replaces the ring by its tangent, whose tube holds the torus: the steps come
/// from outside and never pass the root.
std::optional<Hit> corner_entry(const Cutter& cutter, const LocalRay& ray, double s, double out) {
  const double r = cutter.corner_radius;
  const double ring = cutter.radius - r;
  constexpr int last = 39;
  for (int i = 0; i <= last; ++i) {
    const Vector3d across = ray.across(s);
    const double rho = across.norm();
    const double drho = rho > 0 ? across.dot(ray.dlateral) / rho : ray.dlateral.norm();
    const double a = rho - ring;
    const double b = r - ray.height(s);
    const double A = drho * drho + ray.dh * ray.dh;
    const double B = a * drho - b * ray.dh;
    const double C = a * a + b * b - r * r;
    const double D = B * B - A * C;
    if (D < 0 || (B >= 0 && C > 0)) return std::nullopt;
    const double advance = C <= 0 ? 0.0 : C / (std::sqrt(D) - B);
    s += advance;
    if (s > out) return std::nullopt;
    // The next step would be of the order of the square of this one, unless the ray grazes.
    const bool grazes = D < 1e-4 * B * B;
    if (advance < (grazes ? 1e-14 * (1 + std::abs(s)) : 1e-9) || i == last) {
      const double sideways = rho > 0 ? std::max(a, 0.0) / rho : 0.0;
      return Hit{s, (sideways * across - b * ray.axis).normalized()};
    }
  }
  return std::nullopt;
}

/// Entry through an outline from a point s outside it. Its distance is convex along the ray, so no
/// step of Newton's passes the root.
std::optional<Hit> outline_entry(const ToolOutline& outline, const LocalRay& ray, double s) {
  for (int i = 0; i < 100; ++i) {
    const Vector3d across = ray.across(s);
    const double rho = across.norm();
    const Vector3d radial = rho > 0 ? Vector3d(across / rho) : Vector3d::Zero();
    const OutlineDistance at = distance(outline, {rho, ray.height(s)});
    const double drho = rho > 0 ? radial.dot(ray.dlateral) : ray.dlateral.norm();
    const double slope = at.gradient.x() * drho + at.gradient.y() * ray.dh;
    const double advance = at.value <= 0 ? 0.0 : at.value / -slope;
    if (at.value > 0 && !(slope < 0)) return std::nullopt;
    s += advance;
    if (advance <= 1e-15 * (1 + std::abs(s))) {
      const Vector3d outward = at.gradient.x() * radial + at.gradient.y() * ray.axis;
      return slope < 0 ? std::optional(Hit{s, outward.normalized()}) : std::nullopt;
    }
  }
  return std::nullopt;
}

/// Where the whole line of the ray enters the cutter.
/// @param least  before which it does not
std::optional<Hit> entry_at(const Cutter& cutter, const Position& at, const Vector3d& point,
                            const Vector3d& normal, double least) {
  const LocalRay ray(at, point, normal);
  const Interval cylinder = within_cylinder(ray, cutter.radius);
  const Interval slab = within_slab(ray, cutter.flank_length);
  const double s = std::max(cylinder.in, slab.in);
  const double out = std::min(cylinder.out, slab.out);
  if (!(s <= out)) return std::nullopt;
  if (cutter.outline) return outline_entry(*cutter.outline, ray, std::max(s, least));
  const bool through_end = slab.in >= cylinder.in;
  if (through_end && ray.dh < 0) return Hit{s, at.axis};
  const double ring = cutter.radius - cutter.corner_radius;
  if (through_end && std::isfinite(s) && ray.across(s).squaredNorm() <= ring * ring)
    return Hit{s, -at.axis};
  if (cutter.corner_radius == 0 || ray.height(s) >= cutter.corner_radius) {
    if (through_end) return Hit{s, -at.axis};
    return Hit{s, ray.across(s).normalized()};
  }
  if (ring == 0) {  // a ball: the torus is a sphere
    const Vector3d w = point - at.tip - cutter.radius * at.axis;
    const double wn = w.dot(normal);
    const double D = cutter.radius * cutter.radius - (w - wn * normal).squaredNorm();
    if (D < 0) return std::nullopt;
    const double in = -wn - std::sqrt(D);
    if (in > out) return std::nullopt;
    return Hit{in, (w + in * normal) / cutter.radius};
  }
  return corner_entry(cutter, ray, std::max(s, least), out);
}

/// Convex function of the place: distance from the cutter, or less beside sharp edges; negative
/// inside.
struct SignedDistance {
  double value;
  Vector3d gradient;
};

SignedDistance signed_distance(const Cutter& cutter, const Position& at, const Vector3d& point) {
  const Vector3d p = point - at.tip;
  const double h = p.dot(at.axis);
  const Vector3d lateral = p - h * at.axis;
  const double rho = lateral.norm();
  const Vector3d radial = rho > 0 ? Vector3d(lateral / rho) : Vector3d::Zero();
  if (cutter.outline) {
    const OutlineDistance found = distance(*cutter.outline, {rho, h});
    return {found.value, found.gradient.x() * radial + found.gradient.y() * at.axis};
  }
  const double a = rho - (cutter.radius - cutter.corner_radius);
  const double b = cutter.corner_radius - h;
  SignedDistance body;
  if (a > 0 && b > 0) {
    const double length = std::hypot(a, b);
    body = {length - cutter.corner_radius, (a * radial - b * at.axis) / length};
  } else if (a > b) {
    body = {a - cutter.corner_radius, radial};
  } else {
    body = {b - cutter.corner_radius, -at.axis};
  }
  const double above = h - cutter.flank_length;
  const double beside = rho - cutter.radius;
  if (above > 0 && beside > 0) {
    const double length = std::hypot(beside, above);
    return {length, (beside * radial + above * at.axis) / length};
  }
  return above > body.value ? SignedDistance{above, at.axis} : body;
}

// ---- the cutter over a move ---------------------------------------------------------------------

class Sweep {
 public:
  /// @param least  before which the ray enters the cutter at no instant
  Sweep(const Cutter& cutter, const Move& move, const Ray& ray, double least = -infinity)
      : cutter_(cutter),
        move_(move),
        ray_(ray),
        least_(least),
        omega_(move.angle * move.axis.cross(move.side)) {
    const double place =
        std::max({ray.point.lpNorm<Eigen::Infinity>(), move.tip.lpNorm<Eigen::Infinity>(),
                  move.step.lpNorm<Eigen::Infinity>(), ray.band});
    rounding_ = 4e-16 * (place + cutter.radius + cutter.flank_length);
  }

  /// Entry at instant t. A ray that starts inside the cutter enters at -band; one that leaves the
  /// cutter before it starts does not meet it.
  Sample entry(double t) const {
    Sample sample = undefined_at(t);
    const Position at = position(move_, t);
    const std::optional<Hit> hit = entry_at(cutter_, at, ray_.point, ray_.normal, least_);
    if (!hit) return sample;
    if (hit->s <= -ray_.band) {
      sample.defined =
          signed_distance(cutter_, at, ray_.point - ray_.band * ray_.normal).value <= 0;
      sample.value = sample.defined ? -ray_.band : infinity;
      return sample;
    }
    sample.defined = true;
    sample.value = hit->s;
    const double facing = std::max(-hit->outward.dot(ray_.normal), least_sine);
    const Vector3d arm = ray_.point + hit->s * ray_.normal - at.tip;
    sample.slope = -hit->outward.dot(velocity(arm)) / facing;
    sample.dip = dip(hit->outward, arm, sample.slope * ray_.normal) / facing;
    sample.fade = move_.angle / facing;
    sample.outward = hit->outward;
    sample.facing = facing;
    sample.doubt = (rounding_ + 4e-16 * std::abs(hit->s)) / facing;
    return sample;
  }

  /// Smallest depth that the ray reaches at instant t within its band: <= 0 if it meets the cutter.
  Sample depth_reached(double t) const {
    const Position at = position(move_, t);
    const Nearest nearest = nearest_on_ray(at);
    const Vector3d arm = ray_.point + nearest.s * ray_.normal - at.tip;
    return {t, true,     nearest.depth,   -nearest.outward.dot(velocity(arm)),
            0, infinity, nearest.outward, 1};
  }

  /// Smallest entry over the move, which is near `about`.
  Sample first(double limit, double about) const {
    const double tolerance = move_.angle > 0 ? turning_tolerance : straight_tolerance;
    const Goal goal{tolerance, limit, -ray_.band};
    // what moves straight sweeps a convex body, which a ray does not enter twice
    const auto beyond_gap = [this](double from, double to, const Goal& towards) {
      return move_.angle > 0 ? least_between(from, to, towards) : undefined_at(from);
    };
    const auto f = [this](double t) { return entry(t); };
    const auto floor = [this](const Piece& piece) { return entry_floor(piece); };
    const Sample found = minimum_about(f, floor, beyond_gap, move_.from, about, move_.to, goal);
    return found.defined ? found : least_between(move_.from, move_.to, goal);
  }

 private:
  /// Where the ray comes nearest to the standing cutter within its band, or a place inside it.
  struct Nearest {
    double s;
    double depth;
    /// Unit; of the planes that touch the cutter across it, one that holds it wholly off the ray.
    Vector3d outward;
  };

  /// The depth is convex along the ray, so two tangents on either side of its minimum bound it. The
  /// mean of their normals that stands across the ray is the normal of a plane just as far off: the
  /// normal at one place may lean along the ray, which would cost a bound `band` times the lean.
  Nearest nearest_on_ray(const Position& at) const {
    struct Along {
      double s, depth, slope;
      Vector3d outward;
    };
    const auto along = [&](double s) {
      const SignedDistance d = signed_distance(cutter_, at, ray_.point + s * ray_.normal);
      return Along{s, d.value, d.gradient.dot(ray_.normal), d.gradient};
    };
    Along a = along(-ray_.band);
    if (a.slope >= 0 || a.depth <= -depth_tolerance) return {a.s, a.depth, a.outward};
    Along b = along(ray_.band);
    if (b.slope <= 0 || b.depth <= -depth_tolerance) return {b.s, b.depth, b.outward};
    for (int i = 0; i < 200; ++i) {
      const double w = b.s - a.s;
      const double turn = b.slope - a.slope;
      const double crossing = (a.depth - b.depth + b.slope * w) / turn;
      const double low = a.depth + a.slope * crossing;
      if (low >= std::min(a.depth, b.depth) - 0.1 * depth_tolerance || w < 1e-13) break;
      const bool smooth = std::abs(crossing - 0.5 * w) < 0.1 * w;
      const double inner = i % 4 == 3 ? 0.5 * w : smooth ? -w * a.slope / turn : crossing;
      const Along c = along(a.s + std::clamp(inner, 1e-4 * w, (1 - 1e-4) * w));
      if (c.slope == 0 || c.depth <= -depth_tolerance) return {c.s, c.depth, c.outward};
      (c.slope < 0 ? a : b) = c;
    }
    const Along& best = a.depth <= b.depth ? a : b;
    return {best.s, best.depth, (b.slope * a.outward - a.slope * b.outward).normalized()};
  }

  /// Smallest entry between two instants, wherever it is.
  Sample least_between(double from, double to, const Goal& goal) const {
    const auto f = [this](double t) { return entry(t); };
    const auto floor = [this](const Piece& piece) { return entry_floor(piece); };
    const Sample a = entry(from);
    const Sample b = entry(to);
    if (a.defined || b.defined) return minimum(f, floor, a, b, goal);
    const auto g = [this](double t) { return depth_reached(t); };
    const auto g_floor = [this](const Piece& piece) { return depth_floor(piece); };
    const Sample inside = minimum(g, g_floor, g(from), g(to),
                                  {.tolerance = depth_tolerance, .limit = 0.0, .enough = 0.0});
    if (inside.value > 0) return a;
    const Sample c = entry(inside.t);
    if (!c.defined) return c;
    const Sample left = minimum(f, floor, a, c, goal);
    const Sample right = minimum(f, floor, c, b, goal);
    return right.value < left.value ? right : left;
  }

  /// How far the ray's point is from the cutter along m at instant t, at least.
  /// Rounding: with e = 2^-53 and D the distance of the ray's point and the cutter's farthest one
  /// from the tip, the products take 8 e D and |m x axis|, as the norm of a cross product, 7 e of
  /// R; a difference of squares would lose up to 1e-8 R.
  struct Clearance {
    double value;
    double rise;  // of m along the axis
  };
  Clearance clearance(const Vector3d& m, double t) const {
    const Position at = position(move_, t);
    const Vector3d p = ray_.point - at.tip;
    const double rise = m.dot(at.axis);
    const double far = std::max(cutter_.radius + cutter_.flank_length, p.lpNorm<1>());
    return {m.dot(p) - support(cutter_, rise, m.cross(at.axis).norm()) - 4e-15 * far - rounding_,
            rise};
  }

  /// Over a piece, that clearance is at least this line: m is the cutter's normal at its end
  /// `touching`. Between the ends, the point of the cutter that is foremost along m leaves its
  /// chord by arm turn^2 / 2 times x (1 - x), the arm being the part of it along m: R where m
  /// points down the axis, R + flank at most. Counted from the touching end that is a line, for x
  /// (1 - x) <= x.
  Line clearance(const Vector3d& m, const Piece& piece, const Sample& touching) const {
    const double turn = move_.angle * (piece.b.t - piece.a.t);
    const Clearance a = clearance(m, piece.a.t);
    const Clearance b = clearance(m, piece.b.t);
    const double arm =
        cutter_.radius + (std::max(a.rise, b.rise) > -turn ? cutter_.flank_length : 0.0);
    const double lower = 0.51 * arm * turn * turn;
    return &touching == &piece.a ? Line{a.value, b.value - lower} : Line{a.value - lower, b.value};
  }

  /// Bounds from the planes that touch the cutter at the ends of a piece. The rounding of `facing`
  /// counts up to the end of the band.
  Promise entry_floor(const Piece& piece) const {
    const auto line = [&](const Sample& end) {
      if (end.facing <= least_sine) return Line{-1e300, -1e300};
      const Line clear = clearance(end.outward, piece, end);
      const double lower = 4e-16 * ray_.band;
      return Line{(clear.at_a - lower) / end.facing, (clear.at_b - lower) / end.facing};
    };
    const Line first = line(piece.a.defined ? piece.a : piece.b);
    const bool both = piece.a.defined && piece.b.defined;
    return least_above(piece, first, both ? line(piece.b) : first);
  }
  Promise depth_floor(const Piece& piece) const {
    const auto line = [&](const Sample& end) {
      const Line clear = clearance(end.outward, piece, end);
      const double along = ray_.band * std::abs(end.outward.dot(ray_.normal));
      return Line{clear.at_a - along, clear.at_b - along};
    };
    return least_above(piece, line(piece.a), line(piece.b));
  }

  /// Velocity per unit t of the cutter's material at `arm` from the tip.
  Vector3d velocity(const Vector3d& arm) const { return move_.step + omega_.cross(arm); }

  /// How strongly the turning of the frame can bend the entry downwards: the acceleration, seen
  /// from the cutter, of a point that moves at `v`, against the normal; a quarter of its size is
  /// added because the normal wanders within the move.
  double dip(const Vector3d& outward, const Vector3d& arm, const Vector3d& v) const {
    if (move_.angle == 0) return 0.0;
    const Vector3d acceleration =
        omega_.cross(omega_.cross(arm)) - 2.0 * omega_.cross(v - move_.step);
    return std::max(0.0, -outward.dot(acceleration)) + 0.25 * acceleration.norm();
  }

  const Cutter& cutter_;
  const Move& move_;
  const Ray& ray_;
  double least_;     // mm along the ray
  Vector3d omega_;   // rad per unit t
  double rounding_;  // mm, of a point seen from the tip: an ulp or two of the coordinates
};

}  // namespace

std::optional<double> standing_entry(const Cutter& cutter, const Move& move, double t,
                                     const Ray& ray, float least) {
  const Sample sample = Sweep(cutter, move, ray, double(least)).entry(t);
  return sample.defined ? std::optional(sample.value) : std::nullopt;
}

double depth(const Cutter& cutter, const Move& move, double t, const Vector3d& place) {
  return -signed_distance(cutter, position(move, t), place).value;
}

Move move_after(const CutterMotion& motion, int index) {
  const int next = std::min<int>(index + 1, int(motion.tip.rows()) - 1);
  Move move;
  move.tip = motion.tip.row(index);
  move.step = motion.tip.row(next).transpose() - move.tip;
  move.axis = motion.axis.row(index);
  const Vector3d target = motion.axis.row(next);
  const Vector3d across = target - target.dot(move.axis) * move.axis;
  const double sine = across.norm();
  if (sine < 1e-15) {  // rounding of a direction that stands still
    move.side = move.axis.unitOrthogonal();
    return move;
  }
  move.side = across / sine;
  const double cosine = target.dot(move.axis);
  if (sine < 0.05 && cosine > 0) {  // the series of the arc sine is exact to rounding here
    const double y = sine * sine;
    const double more = 3.0 / 40 + y * (15.0 / 336 + y * 105.0 / 3456);
    move.angle = sine * (1 + y * (1.0 / 6 + y * more));
  } else {
    move.angle = std::atan2(sine, cosine);
  }
  return move;
}

std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit) {
  if (cutter.corner_radius == cutter.radius) {
    const BallAnswer answer = ball_entry(cutter, move, ray, limit);
    if (answer.decided)
      return answer.entry && answer.entry->s <= limit ? answer.entry : std::nullopt;
  }
  const MoveEnds ends = ends_of(move);
  MoveEight eight;
  for (int lane = 0; lane < MoveEight::width; ++lane) eight.put(lane, cutter, ends);
  EntryBounds bound;
  entry_bounds(cutter, eight, {&ray, 1}, {&bound, 1});
  if (double(bound.least[0]) > limit) return std::nullopt;
  const Vector3d m(bound.m[0][0], bound.m[1][0], bound.m[2][0]);
  if (least_entry(cutter, ends, ray, m) > limit) return std::nullopt;
  return first_entry(cutter, move, ray, limit, bound.part[0], bound.least[0]);
}

std::optional<Entry> first_entry(const Cutter& cutter, const Move& move, const Ray& ray,
                                 double limit, float part, float least) {
  const double about = instant(move, part);
  const Sample sample = Sweep(cutter, move, ray, double(least)).first(limit, about);
  if (!sample.defined || sample.value > limit) return std::nullopt;
  return Entry{sample.value, sample.t};
}

}  // namespace abbe::cutting
