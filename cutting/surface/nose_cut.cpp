#include "cutting/surface/nose_cut.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <tuple>

#include "cutting/surface/nose_sweep.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector2d;

NoseEdge::NoseEdge(const Nose& nose) : nose_(nose) {
  double steepest = 0.0;
  for (const NoseWave& wave : nose.waves) {
    if (!std::isfinite(wave.amplitude) || !std::isfinite(wave.phase)) {
      throw std::invalid_argument("nose wave: expected finite amplitude and phase");
    }
    wave_sum_ += std::abs(wave.amplitude);
    steepest += std::abs(double(wave.order) * wave.amplitude);
  }
  if (!std::isfinite(nose.radius) || nose.radius <= wave_sum_) {
    throw std::invalid_argument("nose: expected a radius larger than the sum of its waves");
  }
  if (nose.profile && !nose.waves.empty())
    throw std::invalid_argument("nose: expected waves on a round edge, seen them on an insert");
  lipschitz_ = 1.0 + steepest / (nose.radius - wave_sum_);
}

double NoseEdge::outside_by(const Vector2d& point) const {
  if (nose_.profile) return beyond(point);
  double edge = nose_.radius;
  if (!nose_.waves.empty()) {
    const double psi = std::atan2(point.y(), point.x());
    for (const NoseWave& wave : nose_.waves) {
      edge += wave.amplitude * std::cos(wave.order * psi + wave.phase);
    }
  }
  return point.norm() - edge;
}

std::optional<double> NoseEdge::entry(const Vector2d& point, const Vector2d& step,
                                      double from) const {
  const double aa = step.squaredNorm();
  if (aa < 1e-24) {  // the line is a point in this plane
    return contains(point) ? std::optional(from) : std::nullopt;
  }
  if (nose_.profile) {
    const std::optional<Chord> inside = chord(*nose_.profile, point, step);
    if (!inside || inside->end < from) return std::nullopt;
    return std::max(from, inside->begin);
  }
  const double closest = -point.dot(step) / aa;
  // The distance to the line from the cross product, which does not cancel as b^2 - ac does.
  const double distance = (point.x() * step.y() - point.y() * step.x()) / std::sqrt(aa);
  const double radius = outer_radius();
  const double square = (radius - distance) * (radius + distance);
  if (square < 0.0) return std::nullopt;
  const double half = std::sqrt(square / aa);
  const double begin = std::max(from, closest - half);
  if (begin > closest + half) return std::nullopt;
  if (nose_.waves.empty()) return begin;
  return waved_entry(point, step, begin, closest + half);
}

double NoseEdge::nearest(const Vector2d& point, const Vector2d& step, double from) const {
  const double aa = step.squaredNorm();
  if (!nose_.profile) return -point.dot(step) / aa;
  if (chord(*nose_.profile, point, step)) return from;
  const Vector2d across(-step.y(), step.x());
  // The origin is inside, so the side of the line on which it lies decides which extreme point is
  // nearest.
  const Vector2d towards = across.dot(point) > 0.0 ? Vector2d(across) : Vector2d(-across);
  const double s = (extreme_point(*nose_.profile, towards) - point).dot(step) / aa;
  return std::max(from, s);
}

std::optional<double> NoseEdge::waved_entry(const Vector2d& point, const Vector2d& step,
                                            double begin, double end) const {
  const double speed = step.norm();
  double outside = begin;
  double f_outside = outside_by(point + begin * step);
  if (f_outside <= 0.0) return begin;
  // Steps that the Lipschitz constant permits cannot pass over a crossing. The least step of 1e-6
  // mm ends the slow approach to one, after which the bracket is refined.
  double inside = begin;
  double f_inside = f_outside;
  while (f_inside > 0.0) {
    if (inside >= end) return std::nullopt;
    outside = inside;
    f_outside = f_inside;
    inside = std::min(end, outside + std::max(f_outside / lipschitz_, 1e-6) / speed);
    f_inside = outside_by(point + inside * step);
  }
  // Every third step bisects, so the bracket shrinks even where the secant is one-sided.
  for (int i = 0; i < 60 && (inside - outside) * speed > 1e-13; ++i) {
    const double secant = outside + (inside - outside) * f_outside / (f_outside - f_inside);
    const double middle = 0.5 * (outside + inside);
    const double trial = i % 3 == 2 || !(secant > outside && secant < inside) ? middle : secant;
    const double f = outside_by(point + trial * step);
    (f > 0.0 ? outside : inside) = trial;
    (f > 0.0 ? f_outside : f_inside) = f;
    if (f == 0.0) break;
  }
  return inside;
}

namespace {

using Eigen::Vector3d;
using std::numbers::pi;

// rad; at 1 mm of travel per radian across the feed this is 1e-10 mm of surface.
constexpr double angle_tolerance = 1e-10;
// rad; within this of the join of two intervals a cut belongs to both.
constexpr double join_angle = 1e-9;
// mm; nearer to the spindle line the azimuth of a point changes too fast for Newton's method.
constexpr double near_axis = 1e-3;
// mm; a rake plane that passes a point on the spindle line as near as this contains it.
constexpr double in_plane_on_axis = 2e-8;
// mm along the ray; a contact moves less than this between two adjacent instants.
constexpr double leap = 1e-9;

/// Returns the minimum of f between low and high by golden section search.
template <class Function>
double lowest(const Function& f, double low, double high) {
  const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
  double a = high - golden * (high - low);
  double b = low + golden * (high - low);
  double f_a = f(a);
  double f_b = f(b);
  for (int i = 0; i < 45; ++i) {  // 4e-10 of the width; the value at a smooth minimum is accurate
                                  // to the square
    if (f_a <= f_b) {
      high = b;
      b = a;
      f_b = f_a;
      a = high - golden * (high - low);
      f_a = f(a);
    } else {
      low = a;
      a = b;
      f_a = f_b;
      b = low + golden * (high - low);
      f_b = f(b);
    }
  }
  return f_a <= f_b ? a : b;
}

/// The first cut found so far. Equal distances go to the earlier instant, so the result does not
/// depend on the order of the visits.
struct Best {
  NoseCut cut{.s = infinity, .time_s = infinity};

  double limit() const { return cut.s; }
  // removed at the start of the ray: the instant does not matter
  bool done(double from) const { return cut.s <= from; }
  void take(const NoseCut& other) {
    if (other.s > cut.s || (other.s == cut.s && other.time_s >= cut.time_s)) return;
    cut = other;
  }
};

/// All cuts up to a limit.
struct All {
  double most;
  std::vector<NoseCut> cuts;

  double limit() const { return most; }
  bool done(double) const { return false; }
  void take(const NoseCut& cut) {
    if (cut.s <= most) cuts.push_back(cut);
  }
};

/// The sweep against which rays are searched.
struct Searched {
  const NoseSweep& sweep;
  const NoseEdge& edge;
  const ProfileBound* bound;  // null for a round edge
};

/// The search of one ray in one sweep; results are passed to `Taken`.
template <class Taken>
class RaySearch {
 public:
  RaySearch(const Searched& searched, const NoseRaySegment& ray, Taken& taken)
      : sweep_(searched.sweep),
        edge_(searched.edge),
        bound_(searched.bound),
        ray_(ray),
        taken_(taken) {}

  void search() {
    if (sweep_.nodes.empty() || taken_.limit() < ray_.from) return;
    visit(0, bound(0));
    for (const NoseSweep::Face& face : sweep_.faces) try_face(face);
  }

  void try_piece(const NosePiece& piece, double s_start);
  void try_face(const NoseSweep::Face& face);

 private:
  double bound(int index) const {
    const NoseNode& node = sweep_.nodes[std::size_t(index)];
    return bound_ ? bound_->first_reach(index, node, ray_)
                  : first_reach(node, ray_, edge_.outer_radius());
  }
  void visit(int index, double node_bound);
  bool refine(const NosePiece& piece, double u);
  void scan(const NosePiece& piece);
  void offer(const NosePiece& piece, double u, double s);

  enum class End { Entry, Exit };
  struct Contact {
    double s, y;
    bool on_axis;  // the ray lies on the spindle line there
  };
  std::optional<Contact> contact(const NosePiece& piece, double u, End end) const;
  void solve(const NosePiece& piece, double u0, double u1, End end);
  void lowest_on_axis(const NosePiece& piece, double u0, double u1);
  double pierced(const NosePiece& piece, double u) const;
  void touch(const NosePiece& piece, double u, double step);

  const NoseInterval& interval(const NosePiece& piece) const {
    return sweep_.intervals[std::size_t(piece.interval)];
  }

  const NoseSweep& sweep_;
  const NoseEdge& edge_;
  const ProfileBound* bound_;
  const NoseRaySegment& ray_;
  Taken& taken_;
};

template <class Taken>
void RaySearch<Taken>::visit(int index, double node_bound) {
  if (node_bound > taken_.limit() || node_bound == infinity) return;
  if (taken_.done(ray_.from)) return;
  const NoseNode& node = sweep_.nodes[std::size_t(index)];
  if (node.count == 1) {
    try_piece(sweep_.pieces[std::size_t(node.first)], node_bound);
    return;
  }
  // the nearer child first, since its cut may rule out the other
  const double left = bound(index + 1);
  const double right = bound(node.right);
  if (left <= right) visit(index + 1, left);
  visit(node.right, right);
  if (left > right) visit(index + 1, left);
}

template <class Taken>
void RaySearch<Taken>::offer(const NosePiece& piece, double u, double s) {
  const NoseInterval& i = interval(piece);
  const double within = std::clamp(u, 0.0, 1.0);
  if (s > ray_.to) return;
  taken_.take({s, i.time_s + within * i.time_step, piece.interval, within, i.line});
}

/// Finds every instant of a piece at which the rake plane contains the point where the ray meets
/// the edge.
template <class Taken>
void RaySearch<Taken>::try_piece(const NosePiece& piece, double s_start) {
  const Vector3d p = ray_.at(s_start);
  const double r = radius(p);
  const double turn = piece.angle1 - piece.angle0;
  // Without a usable azimuth (rake plane along the spindle line, ray close to it, spindle turning
  // by less than 1e-4 rad) the piece is searched densely.
  if (piece.free || r < near_axis || std::abs(turn) < 1e-4) return scan(piece);
  const double k0 = (piece.height0 - piece.tilt0 * p.x()) / r;
  const double k1 = (piece.height1 - piece.tilt1 * p.x()) / r;
  const double side0 = std::acos(std::clamp(k0, -1.0, 1.0));
  const double side1 = std::acos(std::clamp(k1, -1.0, 1.0));
  // The amount by which the instant of a cut may lie outside the straight interpolation of the rake
  // plane's azimuth: by the slow rotation, by the height of the nose, and along the ray.
  const double slack = 1e-3 + 10.0 * interval(piece).turn + std::abs(k0) + std::abs(k1) +
                       angle_between(p, ray_.at(ray_.to));
  if (slack > 0.7) return scan(piece);  // Newton's method on a sine needs a better start
  const double azimuth_p = azimuth(p);
  for (const double side : {-1.0, 1.0}) {
    const double from = piece.angle0 + side * side0 - azimuth_p;
    const double to = piece.angle1 + side * side1 - azimuth_p;
    const double low = std::ceil((std::min(from, to) - slack) / (2.0 * pi));
    const double high = std::floor((std::max(from, to) + slack) / (2.0 * pi));
    for (double m = low; m <= high; ++m) {
      const double share = (2.0 * pi * m - from) / (std::abs(to - from) > 1e-6 ? to - from : turn);
      if (!refine(piece, piece.u0 + share * (piece.u1 - piece.u0))) return scan(piece);
    }
  }
}

/// Finds by Newton's method the instant near u at which the rake plane contains the edge's contact
/// on the ray; by a secant once two points give a slope that includes the slow motion. While the
/// trace of the ray misses the edge, its nearest point replaces the contact.
/// @return false if the iteration does not converge; the piece is then searched densely
template <class Taken>
bool RaySearch<Taken>::refine(const NosePiece& piece, double u) {
  const NoseInterval& i = interval(piece);
  double last_u = 0.0, last_y = 0.0;
  for (int step = 0; step < 12; ++step) {
    const RayInTool ray = ray_in_tool(i, u, ray_.q, ray_.n);
    const std::optional<double> hit = edge_.entry(ray.point, ray.step, ray_.from);
    const double aa = ray.step.squaredNorm();
    if (!hit && aa < 1e-12) return false;
    const double s = hit ? *hit : edge_.nearest(ray.point, ray.step, ray_.from);
    const double y = ray.y + s * ray.y_step;
    const double swing = ray.swing + s * ray.swing_step;
    // the work passes the plane too slowly: Newton's step would be unbounded
    if (std::abs(swing) < near_axis) return false;
    double slope = swing * i.angle_step;
    if (step > 0 && u != last_u) {
      const double secant = (y - last_y) / (u - last_u);
      if (secant / slope > 0.5 && secant / slope < 2.0) slope = secant;
    }
    last_u = u;
    last_y = y;
    u -= y / slope;
    const double off = std::abs(u - last_u) * std::abs(i.angle_step);
    if (!(off < 1.0)) return false;
    if (!hit) {
      // Bound of how far the trace still moves until the instant is right: of second order in the
      // angle by the turning, of first order by the slow motion.
      const double nearest = std::max(s, ray_.from);
      const double r = std::max(radius(ray_.at(s)), radius(ray_.at(nearest)));
      const double slow = i.centre_step.norm() + i.turn * (i.centre.norm() + i.centre_step.norm());
      const double moves = std::abs(u - last_u) * slow + off * off * r;
      const double miss = edge_.beyond(ray.point + nearest * ray.step);
      if (miss > 4.0 * moves + 1e-9) return true;
    }
    if (off > angle_tolerance) continue;
    const double before = (piece.u0 - u) * std::abs(i.angle_step);
    const double after = (u - piece.u1) * std::abs(i.angle_step);
    if (hit && before <= join_angle && after <= join_angle) offer(piece, u, s);
    return true;
  }
  return false;
}

template <class Taken>
std::optional<typename RaySearch<Taken>::Contact> RaySearch<Taken>::contact(const NosePiece& piece,
                                                                            double u,
                                                                            End end) const {
  const RayInTool ray = ray_in_tool(interval(piece), u, ray_.q, ray_.n);
  std::optional<double> s = edge_.entry(ray.point, ray.step, ray_.from);
  if (!s) return std::nullopt;
  if (end == End::Exit) {
    s = edge_.entry(ray.point, -ray.step, ray_.from);
    if (!s) return std::nullopt;
    s = -*s;
    if (*s < ray_.from) return std::nullopt;
  }
  return Contact{*s, ray.y + *s * ray.y_step, radius(ray_.at(*s)) <= on_axis};
}

/// Searches a piece densely, for the few rays that pass so near the spindle line, or a spindle that
/// turns so little, that the azimuth does not give the instant.
template <class Taken>
void RaySearch<Taken>::scan(const NosePiece& piece) {
  const double turn = std::abs(interval(piece).angle_step) * (piece.u1 - piece.u0);
  // 128 per revolution, 2.8 deg each, in which y is taken to change sign at most once
  const int parts = std::max(4, int(std::ceil(128.0 * turn / (2.0 * pi))));
  for (const End end : {End::Entry, End::Exit}) {
    double u0 = piece.u0;
    for (int part = 1; part <= parts; ++part) {
      const double u1 = part == parts
                            ? piece.u1
                            : piece.u0 + (piece.u1 - piece.u0) * double(part) / double(parts);
      solve(piece, u0, u1, end);
      u0 = u1;
    }
  }
  const double step = (piece.u1 - piece.u0) / parts;
  for (int part = 0; part <= parts; ++part) touch(piece, piece.u0 + part * step, step);
}

/// Returns the s at which the ray pierces the disc inside the edge at u; infinity if not on this
/// segment.
template <class Taken>
double RaySearch<Taken>::pierced(const NosePiece& piece, double u) const {
  const RayInTool ray = ray_in_tool(interval(piece), u, ray_.q, ray_.n);
  const double s = -ray.y / ray.y_step;
  if (!(s >= ray_.from && s <= ray_.to)) return infinity;
  return edge_.contains(ray.point + s * ray.step) ? s : infinity;
}

/// Handles a nose off the centre height, which leaves a pip. The rake plane envelops its wall:
/// there the ray is cut first inside the disc and not at the edge.
template <class Taken>
void RaySearch<Taken>::touch(const NosePiece& piece, double u, double step) {
  const double s = pierced(piece, u);
  double low = std::max(piece.u0, u - step);
  double high = std::min(piece.u1, u + step);
  if (s == infinity || pierced(piece, low) < s || pierced(piece, high) < s) return;
  const double best = lowest([&](double at) { return pierced(piece, at); }, low, high);
  for (const double at : {u, best}) {
    if (const double found = pierced(piece, at); found < infinity) offer(piece, at, found);
  }
}

/// Finds a contact in the rake plane between two near instants by bisection on the sign of y, after
/// moving inwards an end at which the ray's trace misses the edge.
template <class Taken>
void RaySearch<Taken>::solve(const NosePiece& piece, double u0, double u1, End end) {
  std::optional<Contact> c0 = contact(piece, u0, end);
  std::optional<Contact> c1 = contact(piece, u1, end);
  if (!c0 && !c1) return;
  if (c0 && c1 && c0->on_axis && c1->on_axis) return lowest_on_axis(piece, u0, u1);
  if (!c0 || !c1) {
    double miss = c0 ? u1 : u0;
    double hit = c0 ? u0 : u1;
    // 60 halvings reach the last bit of u
    for (int i = 0; i < 60 && hit != miss; ++i) {
      const double middle = 0.5 * (hit + miss);
      if (middle == hit || middle == miss) break;
      (contact(piece, middle, end) ? hit : miss) = middle;
    }
    (c0 ? u1 : u0) = hit;
    (c0 ? c1 : c0) = contact(piece, hit, end);
  }
  if (c0->y == 0.0) offer(piece, u0, c0->s);
  if (c1->y == 0.0) offer(piece, u1, c1->s);
  if (!(c0->y * c1->y < 0.0)) return;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (u0 + u1);
    if (middle == u0 || middle == u1) break;
    const std::optional<Contact> c = contact(piece, middle, end);
    if (!c) return;
    const bool same = c->y * c0->y > 0.0;
    (same ? u0 : u1) = middle;
    (same ? c0 : c1) = c;
  }
  // Along a straight edge the contact jumps from one end of the edge to the
  // other; the point in the plane lies between.
  if (edge_.has_profile() && std::abs(c1->s - c0->s) > leap && c0->y != c1->y)
    return offer(piece, u0, c0->s + (c1->s - c0->s) * c0->y / (c0->y - c1->y));
  offer(piece, u0, c0->s);
  offer(piece, u1, c1->s);
}

/// On the spindle line every instant is a solution whose rake plane passes through the line; the
/// contact is convex over a short time.
template <class Taken>
void RaySearch<Taken>::lowest_on_axis(const NosePiece& piece, double u0, double u1) {
  const auto s_at = [&](double u) {
    const std::optional<Contact> c = contact(piece, u, End::Entry);
    return c && std::abs(c->y) <= in_plane_on_axis ? c->s : infinity;
  };
  const auto offer_at = [&](double u) {
    if (const double s = s_at(u); s < infinity) offer(piece, u, s);
  };
  for (const double u : {u0, u1, lowest(s_at, u0, u1)}) offer_at(u);
}

/// Cuts by the whole disc, which is part of the sweep's skin where the sweep begins, ends or
/// reverses.
template <class Taken>
void RaySearch<Taken>::try_face(const NoseSweep::Face& face) {
  const NoseInterval& i = sweep_.intervals[std::size_t(face.interval)];
  const RayInTool ray = ray_in_tool(i, face.u, ray_.q, ray_.n);
  if (std::abs(ray.y_step) < 1e-9) return;  // the ray lies in the plane: its contact is at the edge
  const double s = -ray.y / ray.y_step;
  if (!(s >= ray_.from && s <= ray_.to) || !edge_.contains(ray.point + s * ray.step)) return;
  offer({face.interval, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, false}, face.u, s);
}

}  // namespace

NoseCutSearch::NoseCutSearch(const Nose& nose, const NoseMotion& motion)
    : edge_(nose), sweep_(nose_sweep(motion)) {
  if (edge_.has_profile()) bound_.emplace(edge_.profile(), sweep_);
  double turned = 0.0;
  for (const NoseInterval& interval : sweep_.intervals) {
    turned_.push_back(turned);
    turned += std::abs(interval.angle_step);
  }
}

/// Divides a ray that passes the spindle line into two segments, on each of which its radius is
/// nearly linear and its azimuth nearly constant.
template <class Use>
void NoseCutSearch::for_each_segment(const Ray& ray_w, const Use& use) const {
  const Vector3d q = sweep_.R_ws.transpose() * (ray_w.point - sweep_.p_ws);
  const Vector3d n = sweep_.R_ws.transpose() * ray_w.normal;
  const double band = ray_w.band;
  const std::optional<double> nearest = nearest_to_axis(q, n, band);
  if (!nearest) return use(stretch_of(q, n, -band, band));
  use(stretch_of(q, n, -band, *nearest));
  use(stretch_of(q, n, *nearest, band));
}

std::optional<NoseCut> NoseCutSearch::first(const Ray& ray_w) const {
  const Searched searched{sweep_, edge_, bound_ ? &*bound_ : nullptr};
  Best best;
  for_each_segment(
      ray_w, [&](const NoseRaySegment& stretch) { RaySearch(searched, stretch, best).search(); });
  if (best.cut.s == infinity) return std::nullopt;
  return best.cut;
}

std::vector<NoseCut> NoseCutSearch::within(const Ray& ray_w, double limit) const {
  const Searched searched{sweep_, edge_, bound_ ? &*bound_ : nullptr};
  All all{limit, {}};
  for_each_segment(
      ray_w, [&](const NoseRaySegment& stretch) { RaySearch(searched, stretch, all).search(); });
  std::sort(all.cuts.begin(), all.cuts.end(), [](const NoseCut& a, const NoseCut& b) {
    return std::tie(a.time_s, a.s) < std::tie(b.time_s, b.s);
  });
  return std::move(all.cuts);
}

double NoseCutSearch::turned(const NoseCut& cut) const {
  const auto i = std::size_t(cut.interval);
  return turned_[i] + cut.u * std::abs(sweep_.intervals[i].angle_step);
}

int NoseCutSearch::piece_at(const NoseCut& cut) const {
  const auto after = std::upper_bound(
      sweep_.pieces.begin(), sweep_.pieces.end(), cut, [](const NoseCut& c, const NosePiece& p) {
        return std::tie(c.interval, c.u) < std::tie(p.interval, p.u0);
      });
  return std::max(0, int(after - sweep_.pieces.begin()) - 1);
}

std::optional<NoseCut> NoseCutSearch::near(const Ray& ray_w, const NoseCut& other,
                                           double window) const {
  const double middle = turned(other);
  const auto off = [&](int interval, double u) {
    return turned({.interval = interval, .u = u}) - middle;
  };
  const int start = piece_at(other);
  int begin = start;
  int end = start + 1;
  const auto piece = [&](int i) -> const NosePiece& { return sweep_.pieces[std::size_t(i)]; };
  while (begin > 0 && off(piece(begin).interval, piece(begin).u0) > -window) --begin;
  while (end < int(sweep_.pieces.size()) && off(piece(end).interval, piece(end).u0) < window) ++end;
  const Searched searched{sweep_, edge_, bound_ ? &*bound_ : nullptr};
  All all{infinity, {}};
  for_each_segment(ray_w, [&](const NoseRaySegment& stretch) {
    RaySearch search(searched, stretch, all);
    const double s = std::clamp(other.s, stretch.from, stretch.to);
    for (int i = begin; i < end; ++i) search.try_piece(piece(i), s);
    for (const NoseSweep::Face& face : sweep_.faces)
      if (std::abs(off(face.interval, face.u)) <= window) search.try_face(face);
  });
  Best best;
  for (const NoseCut& cut : all.cuts)
    if (std::abs(turned(cut) - middle) <= window) best.take(cut);
  if (best.cut.s == infinity) return std::nullopt;
  return best.cut;
}

}  // namespace abbe::cutting
