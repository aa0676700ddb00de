#include "cutting/stock/separation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "cutting/stock/collision.h"
#include "kinematics/bad_input.h"

namespace abbe::cutting {

using Eigen::Vector3d;
using kinematics::Pose;

namespace {

/// Returns the point of balls that is lowest along a direction given in their frame.
Vector3d lowest_point(std::span<const Ball> balls, const Vector3d& direction) {
  Vector3d lowest = Vector3d::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls) {
    const double height = direction.dot(ball.centre) - ball.radius;
    if (height >= least) continue;
    least = height;
    lowest = ball.centre - ball.radius * direction;
  }
  return lowest;
}

}  // namespace

PartingPlane parting_plane(const Body& a, std::span<const Ball> hull_b, const Pose& T_ab,
                           const Vector3d& way) {
  // six steps usually reach 0.995 of the distance; any plane is a valid bound
  constexpr int steps = 6;
  constexpr double close_enough = 0.995;
  PartingPlane best;
  if (hull_b.empty() || !(way.norm() > 0.0)) return best;
  double most = -std::numeric_limits<double>::infinity();
  Vector3d towards = way;
  for (int step = 0; step < steps && towards.norm() > 0.0; ++step) {
    const Vector3d normal = towards.normalized();
    const Vector3d on_a = support_vertex(a, normal);
    const Vector3d on_b = T_ab * lowest_point(hull_b, T_ab.linear().transpose() * normal);
    const double between = normal.dot(on_b - on_a);
    if (between > most) best = {normal, normal.dot(on_a)};
    most = std::max(most, between);
    if (between >= close_enough * towards.norm()) break;
    const Vector3d back = towards - (on_b - on_a);
    if (!(back.squaredNorm() > 0.0)) break;
    towards -= std::clamp(towards.dot(back) / back.squaredNorm(), 0.0, 1.0) * back;
  }
  return best;
}

double beyond(const PartingPlane& plane, std::span<const Ball> hull_b, const Pose& T_ab) {
  if (hull_b.empty() || plane.normal.isZero(0.0)) return 0.0;
  const Vector3d normal = T_ab.linear().transpose() * plane.normal;
  return normal.dot(lowest_point(hull_b, normal)) + plane.normal.dot(T_ab.translation()) -
         plane.height;
}

namespace {

// Every translation that is returned was tested to leave the bodies apart, or separates them by a
// plane. The limits of steps, pairs and planes below therefore affect its length and the time only.

/// The translations q of b with normal . q >= least.
struct HalfSpace {
  Vector3d normal;  // unit
  double least;     // mm
};

/// Returns the shortest translation that lies on up to three planes.
std::optional<Vector3d> shortest_on(std::span<const HalfSpace> planes) {
  Eigen::Matrix3d gram = Eigen::Matrix3d::Identity();
  Vector3d least = Vector3d::Zero();
  for (std::size_t i = 0; i < planes.size(); ++i) {
    least[Eigen::Index(i)] = planes[i].least;
    for (std::size_t j = 0; j < planes.size(); ++j)
      gram(Eigen::Index(i), Eigen::Index(j)) = planes[i].normal.dot(planes[j].normal);
  }
  // determinant of the Gram matrix below which planes count as parallel
  constexpr double parallel = 1e-12;
  if (gram.determinant() < parallel) return {};
  const Vector3d weights = gram.inverse() * least;
  Vector3d q = Vector3d::Zero();
  for (std::size_t i = 0; i < planes.size(); ++i) q += weights[Eigen::Index(i)] * planes[i].normal;
  return q;
}

/// Returns the shortest translation in half-spaces that lies on given planes. If the solution
/// violates a half-space, the new solution lies on its boundary.
std::optional<Vector3d> shortest_in(std::span<const HalfSpace> all,
                                    const std::vector<HalfSpace>& on = {}) {
  constexpr double rounding = 1e-9;  // mm
  std::optional<Vector3d> q = shortest_on(on);
  for (std::size_t i = 0; q && i < all.size(); ++i) {
    if (all[i].normal.dot(*q) >= all[i].least - rounding) continue;
    if (on.size() == 3) return {};
    std::vector<HalfSpace> next = on;
    next.push_back(all[i]);
    q = shortest_in(all.first(i), next);
  }
  return q;
}

/// Two bodies at their poses, in the frame of a.
struct Overlap {
  const Body& a;
  const Body& b;
  Pose T_ab;
  double apart;  // mm, distance at which they count as apart

  Pose moved(const Vector3d& q) const {
    Pose T = T_ab;
    T.pretranslate(q);
    return T;
  }
  /// Returns the pairs that are too near after a translation of b; the pairs themselves are not
  /// moved.
  std::vector<TrianglePair> met(const Vector3d& q, std::size_t most, double share = 0.98) const {
    std::vector<TrianglePair> pairs = near_pairs(a, b, moved(q), share * apart, most);
    for (TrianglePair& pair : pairs)
      for (Vector3d& corner : pair.of_b) corner -= q;
    return pairs;
  }
  bool is_inside(const Vector3d& q) const { return is_inside_disjoint(a, b, moved(q)); }
  bool is_apart(const Vector3d& q) const { return met(q, 1).empty() && !is_inside(q); }
};

Vector3d normal_of(const std::array<Vector3d, 3>& triangle) {
  const Vector3d across = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
  const double area = across.norm();
  return area > 0.0 ? Vector3d(across / area) : Vector3d::Zero();
}

/// Returns the distance by which a plane normal to a direction separates b from a, mm; negative if
/// none does.
double parted(const TrianglePair& pair, const Vector3d& direction) {
  double last = -std::numeric_limits<double>::infinity(), first = -last;
  for (std::size_t k = 0; k < 3; ++k) {
    last = std::max(last, direction.dot(pair.of_a[k]));
    first = std::min(first, direction.dot(pair.of_b[k]));
  }
  return first - last - pair.skins;
}

/// Returns the displacement from q along a direction after which a pair is apart for good, mm. The
/// distance is convex along it, so Newton steps back from where a plane separates the pair do not
/// pass the solution.
double clear_after(const TrianglePair& pair, const Vector3d& q, const Vector3d& direction,
                   double apart) {
  double way = apart - parted(pair, direction) - direction.dot(q);
  constexpr int max_steps = 12;
  for (int step = 0; step < max_steps && way > 0.0; ++step) {
    const Gap there = gap(pair, q + way * direction);
    const double rate = direction.dot((there.on_b - there.on_a).normalized());
    const double back = (there.distance - apart) / rate;
    // mm, far below any useful resolution
    constexpr double near = 1e-7;
    if (!(rate > 0.0) || back < near) break;
    way -= back;
  }
  return std::max(way, 0.0);
}

/// Returns the displacement along a direction after which the two are apart, by bisection between a
/// contact and a separation.
double halved(const Overlap& overlap, const Vector3d& from, const Vector3d& direction, double meet,
              double apart) {
  while (apart - meet > overlap.apart) {
    const double middle = 0.5 * (meet + apart);
    (overlap.is_apart(from + middle * direction) ? apart : meet) = middle;
  }
  return apart;
}

/// Returns the first translation from a point along a direction after which the two are apart,
/// before a limit. A pair that meets obstructs until it is clear; after a few steps the step is at
/// least a fraction of the limit, so that many small obstructing pairs do not cost as many steps.
std::optional<Vector3d> first_separated(const Overlap& overlap, const Vector3d& from,
                                        const Vector3d& direction, double limit, int parts) {
  constexpr int patient_steps = 4;
  constexpr std::size_t max_pairs = 8;
  double way = 0.0, met = 0.0, clear = 0.0;
  for (int step = 0; way < limit; ++step) {
    const Vector3d q = from + way * direction;
    const std::vector<TrianglePair> pairs = overlap.met(q, max_pairs);
    if (pairs.empty() && !overlap.is_inside(q))
      return way > clear ? from + halved(overlap, from, direction, met, way) * direction : q;
    double further = 0.1 * overlap.apart;
    for (const TrianglePair& pair : pairs)
      further = std::max(further, clear_after(pair, q, direction, overlap.apart));
    if (pairs.empty()) {
      const GapOptions wanted{0.1, limit - way};
      further = std::max(
          further,
          gap(overlap.a, Pose::Identity(), overlap.b, overlap.moved(q), wanted).distance / 1.1);
    }
    met = way;
    clear = way + further;
    way = step < patient_steps ? clear : std::max(clear, way + limit / parts);
  }
  return {};
}

/// Half-spaces in each of which a pair is certainly apart, as it is after the translation q: beyond
/// a plane normal to the connection, or along the face of one of the triangles.
using Beside = std::array<HalfSpace, 3>;

Beside beside(const TrianglePair& pair, const Vector3d& q, double apart) {
  const Gap there = gap(pair, q);
  const Vector3d nearest = (there.on_b - there.on_a).normalized();
  const HalfSpace across{nearest, std::min(apart - parted(pair, nearest), nearest.dot(q))};
  Beside all{across, across, across};
  const std::array<Vector3d, 2> normals{normal_of(pair.of_a), -normal_of(pair.of_b)};
  for (std::size_t k = 0; k < 2; ++k) {
    const double least = apart - parted(pair, normals[k]);
    if (!normals[k].isZero() && normals[k].dot(q) >= least) all[k + 1] = {normals[k], least};
  }
  return all;
}

/// Returns the distance of a translation from a half-space, mm; negative inside.
double lacking(const HalfSpace& half, const Vector3d& q) { return half.least - half.normal.dot(q); }

/// Returns the half-space that is nearest.
const HalfSpace& easiest(const Beside& all, const Vector3d& q) {
  return *std::ranges::min_element(all, {}, [&](const HalfSpace& one) { return lacking(one, q); });
}

/// Slides along the obstructing faces until no nearby translation is shorter.
class Slide {
 public:
  Slide(const Overlap& overlap, const Vector3d& start) : q(start), overlap_(overlap) {
    constexpr int max_steps = 20;
    for (int step = 0; step < max_steps; ++step) {
      const std::optional<Vector3d> next = shorter();
      if (!next) break;
      if (next->norm() < q.norm()) q = *next;
    }
  }

  Vector3d q;

 private:
  static constexpr std::size_t max_pairs = 96;

  /// Returns the shortest translation that keeps every pair on its side of a plane, for the pairs
  /// that turn out to obstruct.
  std::optional<Vector3d> shorter() {
    constexpr int max_rounds = 16;
    add(overlap_.met(q, max_pairs, 3.0));
    std::vector<Beside> free;
    std::vector<HalfSpace> sides;
    Vector3d next = Vector3d::Zero();
    for (int round = 0; round < max_rounds; ++round) {
      for (std::size_t i = free.size(); i < pairs_.size(); ++i)
        free.push_back(beside(pairs_[i], q, overlap_.apart));
      const std::optional<Vector3d> found = shortest_beside(free, sides, next);
      if (!found) return {};
      next = *found;
      const std::vector<TrianglePair> met = overlap_.met(next, max_pairs);
      if (met.empty() && !overlap_.is_inside(next)) return next;
      if (met.empty()) break;
      add(met);
    }
    const Vector3d back = q - next;
    return first_separated(overlap_, next, back.normalized(), back.norm(), 16);
  }

  /// Repeatedly adds a plane for the pair that is violated most: it often clears other pairs too,
  /// which then need none. Returns nothing if no shorter translation results.
  std::optional<Vector3d> shortest_beside(const std::vector<Beside>& free,
                                          std::vector<HalfSpace>& sides, Vector3d next) const {
    constexpr double rounding = 1e-8;  // mm
    constexpr std::size_t max_sides = 256;
    while (sides.size() < max_sides) {
      HalfSpace hardest{Vector3d::Zero(), rounding};
      for (const Beside& one : free)
        if (const HalfSpace& side = easiest(one, next);
            lacking(side, next) > lacking(hardest, next))
          hardest = side;
      if (hardest.normal.isZero()) return next;
      sides.push_back(hardest);
      const std::optional<Vector3d> found = shortest_in(sides);
      if (!found || !(found->norm() < q.norm() - 0.01 * overlap_.apart)) return {};
      next = *found;
    }
    return {};
  }

  void add(const std::vector<TrianglePair>& pairs) {
    pairs_.insert(pairs_.end(), pairs.begin(), pairs.end());
  }

  const Overlap& overlap_;
  std::vector<TrianglePair> pairs_;
};

/// A direction that many triangles face.
struct Facing {
  Vector3d sum = Vector3d::Zero();
  int count = 0;
  Vector3d direction() const { return sum.normalized(); }
};

/// Returns clusters of directions, the largest first.
std::vector<Facing> clustered_directions(const std::vector<Vector3d>& directions) {
  constexpr double alike = 0.996;  // cosine of 5 degrees
  std::vector<Facing> all;
  for (const Vector3d& one : directions) {
    if (one.isZero()) continue;
    auto near = std::ranges::find_if(
        all, [&](const Facing& other) { return one.dot(other.direction()) > alike; });
    if (near == all.end()) near = all.insert(all.end(), Facing{});
    near->sum += one;
    ++near->count;
  }
  std::ranges::stable_sort(all, std::greater<>{}, &Facing::count);
  return all;
}

std::vector<Vector3d> faced(const std::vector<TrianglePair>& pairs, bool of_a) {
  std::vector<Vector3d> normals;
  for (const TrianglePair& pair : pairs)
    normals.push_back(of_a ? normal_of(pair.of_a) : Vector3d(-normal_of(pair.of_b)));
  return normals;
}

/// Returns the half-spaces demanded by the faces of one body that are met: b completely on the
/// outer side of a face of a, or the other way round.
std::vector<HalfSpace> demands(const std::vector<TrianglePair>& pairs, bool of_a, double apart) {
  const std::vector<Vector3d> normals = faced(pairs, of_a);
  std::vector<HalfSpace> all;
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (!normals[i].isZero()) all.push_back({normals[i], apart - parted(pairs[i], normals[i])});
  return all;
}

/// Returns a translation out of all obstructing faces of one body at once: a corner or a narrow
/// slot is left only by a combination of the normals of its walls. The smallest demands are
/// satisfied first: a shank in the wall of a pocket also meets the rim, but need not be lifted over
/// it.
std::optional<Vector3d> translation_out_of_faces(const Overlap& overlap, bool of_a, double limit) {
  constexpr int max_steps = 24;
  constexpr std::size_t max_pairs = 128, max_walls = 24;
  constexpr double alike = 0.9999, together = 1.5;
  std::vector<HalfSpace> walls;
  Vector3d q = Vector3d::Zero();
  for (int step = 0; step < max_steps && walls.size() < max_walls; ++step) {
    const std::vector<TrianglePair> pairs = overlap.met(q, max_pairs);
    if (pairs.empty()) return overlap.is_inside(q) ? std::nullopt : std::optional(q);
    std::vector<HalfSpace> wanted = demands(pairs, of_a, overlap.apart);
    const auto further = [&](const HalfSpace& one) { return one.least - one.normal.dot(q); };
    double least = limit;
    for (const HalfSpace& one : wanted)
      if (further(one) > 0.0) least = std::min(least, further(one));
    for (const HalfSpace& one : wanted) {
      if (further(one) > together * std::max(least, overlap.apart)) continue;
      auto wall = std::ranges::find_if(
          walls, [&](const HalfSpace& other) { return other.normal.dot(one.normal) > alike; });
      if (wall == walls.end()) wall = walls.insert(wall, one);
      wall->least = std::max(wall->least, one.least);
    }
    const std::optional<Vector3d> next = shortest_in(walls);
    if (!next || next->norm() >= limit || *next == q) return {};
    q = *next;
  }
  return {};
}

/// Returns the translation along the axis on which a plane separates the two first.
Vector3d separating_axis(const Overlap& overlap, const std::vector<Vector3d>& axes) {
  Vector3d shortest = Vector3d::Constant(std::numeric_limits<double>::infinity());
  for (const Vector3d& axis : axes) {
    const Vector3d back = -(overlap.T_ab.linear().transpose() * axis);
    const double way = extent(overlap.a, axis) + extent(overlap.b, back) -
                       overlap.T_ab.translation().dot(axis) + overlap.apart;
    if (way < shortest.norm()) shortest = way * axis;
  }
  return shortest;
}

std::vector<Vector3d> axes_of(const Overlap& overlap) {
  std::vector<Vector3d> axes;
  for (int k = 0; k < 3; ++k)
    for (const double sign : {1.0, -1.0}) {
      axes.push_back(sign * Vector3d::Unit(k));
      axes.push_back(sign * overlap.T_ab.linear().col(k));
    }
  return axes;
}

/// Returns directions evenly distributed on a sphere, on a Fibonacci spiral.
std::vector<Vector3d> all_around(int count) {
  const double golden = std::numbers::pi * (3.0 - std::sqrt(5.0));
  std::vector<Vector3d> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count, r = std::sqrt(1.0 - z * z);
    directions.emplace_back(r * std::cos(golden * i), r * std::sin(golden * i), z);
  }
  return directions;
}

/// Returns candidate directions, those derived from the bodies first.
std::vector<Vector3d> candidate_directions(const Overlap& overlap,
                                           const std::vector<Vector3d>& axes) {
  constexpr std::size_t max_pairs = 256, max_bunches = 8;
  const std::vector<TrianglePair> pairs = overlap.met(Vector3d::Zero(), max_pairs);
  std::vector<Vector3d> all;
  for (const bool of_a : {true, false}) {
    const std::vector<Vector3d> normals = faced(pairs, of_a);
    Vector3d mean = Vector3d::Zero();
    for (const Vector3d& normal : normals) mean += normal;
    all.push_back(mean.normalized());
    const std::vector<Facing> bunches = clustered_directions(normals);
    for (std::size_t i = 0; i < std::min(bunches.size(), max_bunches); ++i)
      all.push_back(bunches[i].direction());
  }
  if (pairs.empty()) {
    const Gap nearest = gap(overlap.a, Pose::Identity(), overlap.b, overlap.T_ab);
    const Vector3d way = (nearest.on_b - nearest.on_a).normalized();
    all.insert(all.end(), {way, -way});
  }
  all.insert(all.end(), axes.begin(), axes.end());
  return all;
}

/// Returns the directions without near duplicates.
std::vector<Vector3d> unlike(const std::vector<Vector3d>& all) {
  // tight, because a narrow slot is left only exactly along its walls
  constexpr double alike = 0.999999;
  std::vector<Vector3d> kept;
  for (const Vector3d& one : all)
    if (!one.isZero() &&
        std::ranges::none_of(kept, [&](const Vector3d& other) { return one.dot(other) > alike; }))
      kept.push_back(one);
  return kept;
}

Vector3d shortest_way(const Overlap& overlap) {
  if (overlap.is_apart(Vector3d::Zero())) return Vector3d::Zero();
  const std::vector<Vector3d> axes = axes_of(overlap);
  Vector3d best = Slide(overlap, separating_axis(overlap, axes)).q;
  const auto take = [&](const std::optional<Vector3d>& start) {
    if (!start) return;
    const Vector3d q = Slide(overlap, *start).q;
    if (q.norm() < best.norm()) best = q;
  };
  for (const bool of_a : {true, false}) take(translation_out_of_faces(overlap, of_a, best.norm()));
  const auto look = [&](const Vector3d& direction, int parts) {
    // A longer translation may slide to a shorter one, but hardly if it is beside the best so far.
    constexpr double reach = 1.2, beside = 0.7;
    const bool is_beside = direction.dot(best) > beside * best.norm();
    const double limit = (is_beside ? 1.0 : reach) * best.norm();
    take(first_separated(overlap, Vector3d::Zero(), direction, limit, parts));
  };
  for (const Vector3d& one : unlike(candidate_directions(overlap, axes))) look(one, 16);
  for (const Vector3d& one : all_around(24)) look(one, 8);
  return best;
}

}  // namespace

WayOut way_out(const Body& a, const Pose& T_a, const Body& b, const Pose& T_b, double resolution) {
  require(resolution > 0.0, "way_out: the resolution must be positive");
  const Overlap overlap{a, b, T_a.inverse() * T_b, 0.5 * resolution};
  const Vector3d best = shortest_way(overlap);
  WayOut out;
  out.depth = best.norm();
  if (out.depth > 0.0) out.direction = T_a.linear() * best / out.depth;
  return out;
}

}  // namespace abbe::cutting
