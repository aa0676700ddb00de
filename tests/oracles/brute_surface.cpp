#include "tests/oracles/brute_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <queue>

namespace abbe::oracles {
namespace {

using Real = long double;
constexpr Real infinity = std::numeric_limits<Real>::infinity();

struct Vector {
  Real x, y, z;
};
Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vector operator*(Real k, Vector a) { return {k * a.x, k * a.y, k * a.z}; }
Real dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vector cross(Vector a, Vector b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Real norm(Vector a) { return std::sqrt(dot(a, a)); }
Vector unit(Vector a) { return (1 / norm(a)) * a; }
Vector vector(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

struct RayLine {
  Vector o, d;
  Vector at(Real s) const { return o + s * d; }
};

/// A stretch of an ordered set of s; empty where low > high.
struct Span {
  Real low, high;
};

/// Where the line lies in |p - c| <= r for the part of p across `axis` (or all of p for a zero
/// axis).
Span inside_round(const RayLine& line, Vector axis, Real r) {
  const Vector o = line.o - dot(line.o, axis) * axis;
  const Vector d = line.d - dot(line.d, axis) * axis;
  const Real dd = dot(d, d);
  if (dd < 1e-30L) return dot(o, o) <= r * r ? Span{-infinity, infinity} : Span{1, 0};
  const Real middle = -dot(o, d) / dd;
  const Vector nearest = o + middle * d;
  const Real left = r * r - dot(nearest, nearest);
  if (left < 0) return {1, 0};
  const Real half = std::sqrt(left / dd);
  return {middle - half, middle + half};
}

Span inside_slab(const RayLine& line, Vector normal, Real low, Real high) {
  const Real o = dot(line.o, normal);
  const Real d = dot(line.d, normal);
  if (std::abs(d) < 1e-25L) return o >= low && o <= high ? Span{-infinity, infinity} : Span{1, 0};
  const Real a = (low - o) / d;
  const Real b = (high - o) / d;
  return {std::min(a, b), std::max(a, b)};
}

Span common(Span a, Span b) { return {std::max(a.low, b.low), std::min(a.high, b.high)}; }

/// Distance from the core of a rounded cutter (the disc at the height of the corner's circle and
/// all above it) less the corner radius: convex along every line. Value and slope at s.
struct Convex {
  Real value, slope;
};
Convex corner_distance(const RayLine& line, Vector axis, Real core_radius, Real corner, Real s) {
  const Vector p = line.at(s);
  const Real z = dot(p, axis);
  const Vector across = p - z * axis;
  const Real rho = norm(across);
  const Real out = std::max<Real>(0, rho - core_radius);
  const Real under = std::max<Real>(0, corner - z);
  const Real distance = std::sqrt(out * out + under * under);
  const Real dz = dot(line.d, axis);
  const Real drho = rho > 0 ? dot(across, line.d - dz * axis) / rho : 0;
  if (distance == 0) return {-corner, 0};
  return {distance - corner, (out * drho - under * dz) / distance};
}

/// First s >= from at which a convex function falls to 0: Newton from the left never passes it.
std::optional<Real> first_inside(const RayLine& line, Vector axis, Real core_radius, Real corner,
                                 Real from) {
  Real s = from;
  for (int i = 0; i < 2000; ++i) {
    const Convex g = corner_distance(line, axis, core_radius, corner, s);
    if (g.value <= 1e-17L) return s;
    if (g.slope >= 0) return std::nullopt;
    const Real next = s - g.value / g.slope;
    if (!(next > s)) return s;
    s = next;
  }
  return s;
}

struct Cutter {
  Real radius, corner, bottom, top;  // the tool lies between bottom and top along its axis
};

/// First s >= from at which the line, seen from the tip, is inside the cutter; infinity if none to
/// +band.
Real cutter_entry(const RayLine& line, Vector axis, const Cutter& cutter, Real from, Real to) {
  Span span = common({from, to}, inside_round(line, axis, cutter.radius));
  span = common(span, inside_slab(line, axis, cutter.bottom, cutter.top));
  if (!(span.low <= span.high)) return infinity;
  if (cutter.corner == 0) return span.low;
  const RayLine lifted{line.o - cutter.bottom * axis, line.d};
  const std::optional<Real> s =
      first_inside(lifted, axis, cutter.radius - cutter.corner, cutter.corner, span.low);
  return s && *s <= span.high ? *s : infinity;
}

/// The radius of a form over its height, thickened: concave between -thick and top + thick.
struct FormRadius {
  struct Piece {
    Real x0, z0, x1, z1, r, cx, cz;
  };
  std::vector<Piece> pieces;
  Real widest = 0, top = 0;  // height of the largest radius, and of the top

  explicit FormRadius(const BruteForm& form) {
    Real x = form.bottom, z = 0;
    for (const BruteForm::Point& p : form.points) {
      Piece piece{x, z, p.x, p.z, p.radius, 0, 0};
      if (p.radius > 0) {
        const Real dx = p.x - x, dz = p.z - z, chord = std::sqrt(dx * dx + dz * dz);
        const Real deep = std::sqrt(Real(p.radius) * p.radius - chord * chord / 4) / chord;
        piece.cx = (x + p.x) / 2 - deep * dz;
        piece.cz = (z + p.z) / 2 + deep * dx;
      }
      pieces.push_back(piece);
      x = p.x;
      z = p.z;
    }
    top = z;
    Real low = 0, high = top;  // a concave function's largest value, by ternary search
    for (int i = 0; i < 400; ++i) {
      const Real a = low + (high - low) / 3, b = high - (high - low) / 3;
      (at(a) < at(b) ? low : high) = at(a) < at(b) ? a : b;
    }
    widest = (low + high) / 2;
  }
  Real at(Real z) const {
    for (const Piece& p : pieces) {
      if (z > p.z1 && &p != &pieces.back()) continue;
      if (p.r > 0) return p.cx + std::sqrt(std::max<Real>(0, p.r * p.r - (z - p.cz) * (z - p.cz)));
      return p.x0 + (p.x1 - p.x0) * (z - p.z0) / (p.z1 - p.z0);
    }
    return 0;
  }
  Real thickened(Real z, Real thick) const {
    const Real nearest = std::clamp(widest, z - thick, z + thick);
    return at(std::clamp<Real>(nearest, 0, top)) + thick;
  }
};

/// First s in from .. to at which a line, seen from the tip, is inside a form made thicker:
/// by bisection on the near side of where it is deepest.
Real form_entry(const RayLine& line, Vector axis, const FormRadius& form, Real thick, Real from,
                Real to) {
  const Span span = common({from, to}, inside_slab(line, axis, -thick, form.top + thick));
  if (!(span.low <= span.high)) return infinity;
  const auto outside = [&](Real s) {
    const Vector p = line.at(s);
    const Real z = dot(p, axis);
    return norm(p - z * axis) - form.thickened(z, thick);
  };
  if (outside(span.low) <= 0) return span.low;
  Real low = span.low, high = span.high;
  for (int i = 0; i < 220 && outside(high) > 0; ++i) {
    const Real a = low + (high - low) / 3, b = high - (high - low) / 3;
    if (outside(a) <= 0 || outside(a) < outside(b))
      high = b;
    else
      low = a;
    if (outside(a) <= 0) high = a;
    if (high - low < 1e-17L) break;
  }
  if (outside(high) > 0) return infinity;
  low = span.low;
  for (int i = 0; i < 90; ++i) (outside((low + high) / 2) > 0 ? low : high) = (low + high) / 2;
  return high;
}

/// Part of one move, with the earliest s at which anything of it can be.
struct Stretch {
  Real low;
  std::size_t move;
  Real u0, u1;
};
struct Later {
  bool operator()(const Stretch& a, const Stretch& b) const { return a.low > b.low; }
};

/// Best first: `earliest(move, u0, u1)` bounds a stretch from below, `found(move, u0, u1)` gives a
/// place and instant that belong to it, if it can.
struct Found {
  Real s, u;
};
template <class Earliest, class Finder>
BruteHit search(std::size_t moves, const BruteOptions& options, const Earliest& earliest,
                const Finder& found, const std::vector<double>& times) {
  std::priority_queue<Stretch, std::vector<Stretch>, Later> open;
  BruteHit hit;
  Real best = infinity;
  const Real band = options.band;
  const auto look = [&](std::size_t move, Real u0, Real u1) {
    ++hit.looked_at;
    const Real low = earliest(move, u0, u1);
    if (low > band || low >= best) return;
    if (const std::optional<Found> f = found(move, u0, u1); f && f->s < best && f->s <= band) {
      best = f->s;
      const Real t0 = times[move], t1 = times[move + 1];
      hit.time_s = double(t0 + f->u * (t1 - t0));
    }
    open.push({low, move, u0, u1});
  };
  for (std::size_t move = 0; move < moves; ++move) look(move, 0, 1);
  Real low = best;
  while (!open.empty()) {
    const Stretch s = open.top();
    low = std::min(best, s.low);
    if (best - s.low <= options.tolerance || best <= -band || hit.looked_at > options.most) break;
    open.pop();
    const Real middle = (s.u0 + s.u1) / 2;
    if (middle == s.u0 || middle == s.u1) break;
    look(s.move, s.u0, middle);
    look(s.move, middle, s.u1);
    low = best;
  }
  hit.cut = best < infinity;
  hit.begins_removed = best <= -band;
  hit.s = hit.cut ? double(best) : 0.0;
  hit.bound = hit.cut ? double(best - low) : (open.empty() ? 0.0 : double(band - low));
  return hit;
}

struct MillMove {
  Vector tip, tip_step;
  Vector axis, aside;  // unit and orthogonal; the axis turns from one towards the other
  Real turn;
  Vector axis_at(Real u) const { return std::cos(u * turn) * axis + std::sin(u * turn) * aside; }
};

MillMove mill_move(const BrutePose& a, const BrutePose& b) {
  const Vector from = unit(vector(a.axis));
  const Vector to = unit(vector(b.axis));
  const Real turn = std::atan2(norm(cross(from, to)), dot(from, to));
  const Vector rest = to - dot(to, from) * from;
  const Vector aside = norm(rest) > 0 ? unit(rest) : Vector{0, 0, 0};
  return {vector(a.tip), vector(b.tip) - vector(a.tip), from, aside, norm(rest) > 0 ? turn : 0};
}

struct TurnMove {
  Vector x, y, z;  // the tool's axes at the start
  Vector turn_axis;
  Real turn;
  Vector centre, centre_step;
  Real spindle, spindle_step;
};

Vector turned(Vector v, Vector axis, Real angle) {  // Rodrigues
  return std::cos(angle) * v + std::sin(angle) * cross(axis, v) +
         ((1 - std::cos(angle)) * dot(axis, v)) * axis;
}

/// Axis and angle that turn one frame into another, from the sum of the cross products of their
/// axes.
TurnMove turn_move(const BruteTurning::Pose& a, const BruteTurning::Pose& b, Vector origin) {
  TurnMove move;
  move.x = vector(a.R.col(0));
  move.y = vector(a.R.col(1));
  move.z = vector(a.R.col(2));
  const Vector x = vector(b.R.col(0)), y = vector(b.R.col(1)), z = vector(b.R.col(2));
  const Vector twice_sine = cross(move.x, x) + cross(move.y, y) + cross(move.z, z);
  const Real twice_cosine = dot(move.x, x) + dot(move.y, y) + dot(move.z, z) - 1;
  const Real length = norm(twice_sine);
  move.turn_axis = length > 1e-17L ? unit(twice_sine) : Vector{1, 0, 0};
  move.turn = length > 1e-17L ? std::atan2(length, twice_cosine) : 0;
  move.centre = vector(a.centre) - origin;
  move.centre_step = vector(b.centre) - vector(a.centre);
  move.spindle = a.spindle;
  move.spindle_step = Real(b.spindle) - Real(a.spindle);
  return move;
}

}  // namespace

namespace {

/// @param entry(seen, axis, thicker)  of a line, seen from the tip, into the standing cutter
template <class Entry>
BruteHit milled(const Ray& ray, const std::vector<BrutePose>& motion, Real farthest,
                const BruteOptions& options, const Entry& entry_of) {
  std::vector<MillMove> moves;
  std::vector<double> times;
  for (std::size_t i = 0; i + 1 < motion.size(); ++i) {
    moves.push_back(mill_move(motion[i], motion[i + 1]));
  }
  for (const BrutePose& pose : motion) times.push_back(pose.time_s);
  const RayLine line{vector(ray.origin), unit(vector(ray.direction))};
  const auto entry = [&](std::size_t m, Real u, Real thicker) {
    const MillMove& move = moves[m];
    const RayLine seen{line.o - (move.tip + u * move.tip_step), line.d};
    return entry_of(seen, move.axis_at(u), thicker);
  };
  const auto earliest = [&](std::size_t m, Real u0, Real u1) {
    const Real reach = (norm(moves[m].tip_step) + moves[m].turn * farthest) * (u1 - u0) / 2;
    return entry(m, (u0 + u1) / 2, reach + 1e-16L);
  };
  const auto found = [&](std::size_t m, Real u0, Real u1) -> std::optional<Found> {
    Found best{infinity, 0};
    for (const Real u : {u0, (u0 + u1) / 2, u1}) {
      if (const Real s = entry(m, u, 0); s < best.s) best = {s, u};
    }
    return best.s < infinity ? std::optional(best) : std::nullopt;
  };
  return search(moves.size(), options, earliest, found, times);
}

}  // namespace

BruteHit brute_milled(const Ray& ray, const BruteCutter& cutter,
                      const std::vector<BrutePose>& motion, const BruteOptions& options) {
  const Real band = options.band;
  return milled(ray, motion, std::hypot(Real(cutter.radius), Real(cutter.flank_length)), options,
                [&](const RayLine& seen, Vector axis, Real thicker) {
                  // The corner radius grows with the tool, the flat keeps its radius: this holds
                  // the thickened tool.
                  const Cutter thick{cutter.radius + thicker, cutter.corner_radius + thicker,
                                     -thicker, cutter.flank_length + thicker};
                  return cutter_entry(seen, axis, thick, -band, band);
                });
}

BruteHit brute_milled(const Ray& ray, const BruteForm& form, const std::vector<BrutePose>& motion,
                      const BruteOptions& options) {
  const FormRadius radius(form);
  const Real band = options.band;
  return milled(ray, motion, std::hypot(radius.at(radius.widest), radius.top), options,
                [&](const RayLine& seen, Vector axis, Real thicker) {
                  return form_entry(seen, axis, radius, thicker, -band, band);
                });
}

BruteHit brute_milled(const Ray& ray, const std::vector<BruteLayer>& layers,
                      const std::vector<BrutePose>& motion, const BruteOptions& options) {
  std::vector<FormRadius> radii;
  Real farthest = 0;
  for (const BruteLayer& layer : layers) {
    radii.emplace_back(layer.form);
    const FormRadius& radius = radii.back();
    farthest = std::max(farthest, std::hypot(radius.at(radius.widest), layer.base + radius.top));
  }
  const Real band = options.band;
  return milled(ray, motion, farthest, options,
                [&](const RayLine& seen, Vector axis, Real thicker) {
                  Real first = infinity;
                  for (std::size_t i = 0; i < layers.size(); ++i) {
                    const RayLine raised{seen.o - Real(layers[i].base) * axis, seen.d};
                    first = std::min(first, form_entry(raised, axis, radii[i], thicker, -band,
                                                       std::min<Real>(band, first)));
                  }
                  return first;
                });
}

BruteHit brute_turned(const Ray& ray, const BruteTurning& turning, const BruteOptions& options) {
  const Vector origin = vector(turning.spindle_point);
  const Vector spindle = unit(vector(turning.spindle_direction));
  const RayLine line{vector(ray.origin) - origin, unit(vector(ray.direction))};
  std::vector<TurnMove> moves;
  std::vector<double> times;
  for (std::size_t i = 0; i + 1 < turning.poses.size(); ++i) {
    moves.push_back(turn_move(turning.poses[i], turning.poses[i + 1], origin));
  }
  for (const BruteTurning::Pose& pose : turning.poses) times.push_back(pose.time_s);
  const Real band = options.band;
  const auto axis_at = [&](const TurnMove& move, Vector axis, Real u) {
    const Real angle = move.spindle + u * move.spindle_step;
    return turned(turned(axis, move.turn_axis, u * move.turn), spindle, angle);
  };
  const auto plane_normal = [&](const TurnMove& move, Real u) { return axis_at(move, move.y, u); };
  // (x, z) of frame t
  const auto across = [&](const TurnMove& move, const Eigen::Vector2d& v, Real u) {
    return axis_at(move, Real(v.x()) * move.x + Real(v.y()) * move.z, u);
  };
  // from the middle of the disc
  const auto seen_at = [&](const TurnMove& move, Real u) {
    const Real angle = move.spindle + u * move.spindle_step;
    const Vector centre = turned(move.centre + u * move.centre_step, spindle, angle);
    return RayLine{line.o - (centre + across(move, turning.middle, u)), line.d};
  };
  const Real farthest =
      std::hypot(Real(turning.middle.x()), Real(turning.middle.y())) + turning.radius;
  // below all sides, each moved outwards
  const auto inside_sides = [&](const TurnMove& move, const RayLine& seen, Real u, Real outwards) {
    Span span{-infinity, infinity};
    for (const BruteTurning::Side& side : turning.sides)
      span = common(span, inside_slab(seen, across(move, side.normal, u), -1e6L,
                                      side.reach - side.normal.dot(turning.middle) + outwards));
    return span;
  };
  const auto earliest = [&](std::size_t m, Real u0, Real u1) {
    const TurnMove& move = moves[m];
    const Vector a = move.centre + u0 * move.centre_step;
    const Vector b = move.centre + u1 * move.centre_step;
    const Real arm = std::max(norm(cross(a, spindle)), norm(cross(b, spindle))) + farthest;
    const Real reach =
        (norm(move.centre_step) + std::abs(move.spindle_step) * arm + move.turn * farthest) *
            (u1 - u0) / 2 +
        1e-16L;
    const Real u = (u0 + u1) / 2;
    const RayLine seen = seen_at(move, u);
    const Vector y = plane_normal(move, u);
    Span span = common({-band, band}, inside_slab(seen, y, -reach, reach));
    span = common(span, inside_round(seen, y, turning.radius + reach));
    span = common(span, inside_round(seen, {0, 0, 0}, turning.radius + reach));
    span = common(span, inside_sides(move, seen, u, reach));
    return span.low <= span.high ? span.low : infinity;
  };
  // The line's first place in the cylinder through the disc; where it changes sides of the plane
  // between two instants, some instant between has it in the disc itself, unless that place leaps
  // along a side.
  struct Side {
    Real s, y;
  };
  const auto side = [&](const TurnMove& move, Real u) -> std::optional<Side> {
    const RayLine seen = seen_at(move, u);
    const Vector y = plane_normal(move, u);
    const Span span = common(common({-band, infinity}, inside_round(seen, y, turning.radius)),
                             inside_sides(move, seen, u, 0));
    if (!(span.low <= span.high) || span.low > 2 * band) return std::nullopt;
    return Side{span.low, dot(seen.at(span.low), y)};
  };
  // Where the line goes through the disc at one instant, which is a place for certain too.
  const auto face = [&](const TurnMove& move, Real u) {
    const RayLine seen = seen_at(move, u);
    const Vector y = plane_normal(move, u);
    const Real s = -dot(seen.o, y) / dot(seen.d, y);
    const Span span = inside_sides(move, seen, u, 0);
    return s >= -band && s <= band && norm(seen.at(s)) <= turning.radius && s >= span.low &&
                   s <= span.high
               ? s
               : infinity;
  };
  const auto found = [&](std::size_t m, Real u0, Real u1) -> std::optional<Found> {
    const TurnMove& move = moves[m];
    if (const Real s = face(move, (u0 + u1) / 2); s < infinity) return Found{s, (u0 + u1) / 2};
    std::optional<Side> a = side(move, u0);
    std::optional<Side> b = side(move, u1);
    if (a && std::abs(a->y) < 1e-15L) return Found{a->s, u0};
    if (b && std::abs(b->y) < 1e-15L) return Found{b->s, u1};
    if ((u1 - u0) * std::abs(move.spindle_step) > 0.05L || !a || !b || a->y * b->y > 0) {
      return std::nullopt;
    }
    for (int i = 0; i < 90; ++i) {
      const Real u = (u0 + u1) / 2;
      const std::optional<Side> c = side(move, u);
      if (!c) return std::nullopt;
      (c->y * a->y > 0 ? u0 : u1) = u;
      (c->y * a->y > 0 ? a : b) = c;
    }
    return std::abs(b->y) < 1e-12L ? std::optional(Found{b->s, u1}) : std::nullopt;
  };
  return search(moves.size(), options, earliest, found, times);
}

}  // namespace abbe::oracles
