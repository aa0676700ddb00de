#include "cutting/stock/encounters.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/stock/separation.h"
#include "kinematics/bad_input.h"

/// The search of `encounters` through the segments of a program that one thread follows.
namespace abbe::cutting {

/// The nearest approach of a pair in a segment.
struct NearestApproach {
  double at_least = std::numeric_limits<double>::infinity();  ///< mm, lower bound
  double distance = std::numeric_limits<double>::infinity();  ///< mm, smallest computed
  bool contact = false;
  Moment moment;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
};

/// The bodies, the pairs and their motion, shared by all threads.
struct EncounterSearch {
  const std::vector<CarrierBody>& bodies;
  const std::vector<BodyPair>& pairs;
  const CarrierMotion& motion;
  const EncounterOptions& options;
  std::vector<char> followed;                 ///< (pairs)
  std::vector<std::vector<Ball>> hulls = {};  ///< (bodies) empty if a body has too many vertices
  std::vector<NearestApproach> seen = {};     ///< (pairs) smallest sampled distances
  /// (pairs) balls and rest of the moving body if only contact matters
  std::vector<BodyBalls> parts = {};
  std::vector<std::vector<Ball>> rest_hulls = {};  ///< (pairs) of the rest

  const CarrierBody& fixed(int pair) const {
    return bodies[std::size_t(pairs[std::size_t(pair)].a)];
  }
  bool is_simple(int pair) const {
    return !hulls[std::size_t(pairs[std::size_t(pair)].a)].empty() &&
           !hulls[std::size_t(pairs[std::size_t(pair)].b)].empty();
  }
  const CarrierBody& moving(int pair) const {
    return bodies[std::size_t(pairs[std::size_t(pair)].b)];
  }
  std::vector<kinematics::Pose> placed(std::size_t instant, double u) const {
    std::vector<kinematics::Pose> T(std::size_t(motion.carriers), kinematics::Pose::Identity());
    motion.place(instant, u, T);
    return T;
  }
};

/// Results of the segments of a chunk.
struct EncounterSearchResult {
  std::vector<SegmentClearance> clearances;
  std::vector<Encounter> encounters;  ///< of single segments
  std::vector<NearestApproach> best;  ///< (pairs)
  std::size_t queries = 0;            ///< number of distances computed
};

/// Follows the pairs through segments.
/// @param first, last  segments, the second excluded
EncounterSearchResult follow(const EncounterSearch& task, std::size_t first, std::size_t last);

namespace {

using Eigen::Vector3d;
using kinematics::Pose;

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double within = 1e-2;  // mm, accuracy of a clearance where its fraction is smaller
constexpr double rough = 0.3;    // fraction of `share`, permitted error of a single distance

/// The state of a pair: its distance at an instant, and its nearest approach so far.
struct Known {
  double low = 0.0, high = infinite;  // mm, bounds at `instant`
  bool met = true;                    // in contact there, or not known: one may be inside the other
  std::size_t instant = 0;
  std::optional<PartingPlane> plane;  // between the two, if it was computed, and
  Vector3d on_b = Vector3d::Zero();   // the point of the gap in the frame of b
  bool asked = false;                 // true if the gap was computed there,
  double most = infinite;             // up to this distance, mm
  Gap gap;
  NearestApproach best;
};

/// The instants up to which the balls of a body, and the rest of it, are known to be free of
/// contact.
struct ContactFreeUntil {
  std::size_t balls = 0, rest = 0;
  std::size_t not_before = 0;  // up to here the sweep of the balls decides nothing
  PartingPlane plane = {};     // between a and the rest
};

/// Returns the points of a polyline between which all other points are within a distance of the
/// chord; the ends are included.
std::vector<std::size_t> corners_within(const std::vector<Vector3d>& points, double distance) {
  const auto is_straight = [&](std::size_t from, std::size_t to) {
    const Vector3d way = points[to] - points[from];
    for (std::size_t i = from + 1; i < to; ++i) {
      const Vector3d here = points[i] - points[from];
      const double length = way.squaredNorm();
      const double share = length > 0.0 ? std::clamp(here.dot(way) / length, 0.0, 1.0) : 0.0;
      if ((here - share * way).norm() > distance) return false;
    }
    return true;
  };
  std::vector<std::size_t> kept{0};
  while (kept.back() + 1 < points.size()) {
    std::size_t to = kept.back() + 1;
    // steps double, so a long straight path costs few tests
    for (std::size_t step = 1; to + step < points.size() && is_straight(kept.back(), to + step);
         step *= 2)
      to += step;
    kept.push_back(to);
  }
  return kept;
}

/// A part of the program that one thread follows.
class Chunk {
 public:
  /// @param first, last  segments, the second excluded
  Chunk(const EncounterSearch& task, std::size_t first, std::size_t last) : task_(task) {
    begin_ = task.motion.stretches[first];
    // The interval between two segments belongs to the second.
    if (begin_ > 0) --begin_;
    const std::size_t end = end_of(task.motion, last - 1);
    for (std::size_t i = begin_; i < end; ++i) poses_.push_back(task.placed(i, 0.0));
    add_ways();
    start();
    for (std::size_t stretch = first; stretch < last; ++stretch) follow(stretch);
    for (const Known& known : known_) result.best.push_back(known.best);
  }

  EncounterSearchResult result;

 private:
  /// Computes an upper bound of how far each pair has moved since the first instant.
  void add_ways() {
    std::map<std::tuple<int, int>, std::size_t> seen;  // carrier of a, body b
    for (std::size_t p = 0; p < task_.pairs.size(); ++p) {
      const auto key = std::tuple(task_.fixed(int(p)).carrier, task_.pairs[p].b);
      const auto [found, added] = seen.emplace(key, ways_.size());
      way_of_.push_back(found->second);
      if (added) ways_.push_back(way(int(p)));
    }
  }

  std::vector<double> way(int pair) const {
    std::vector<double> sum(poses_.size(), 0.0);
    const Body& body = task_.moving(pair).body;
    Pose before = relative(pair, 0);
    for (std::size_t i = 1; i < poses_.size(); ++i) {
      const Pose now = relative(pair, i);
      const double step = farthest(before, now, body);
      sum[i] = sum[i - 1] + (step > 0.0 ? step + task_.motion.bulge[begin_ + i - 1] : 0.0);
      before = now;
    }
    return sum;
  }

  void start() {
    for (std::size_t p = 0; p < task_.pairs.size(); ++p) {
      const Body &a = task_.fixed(int(p)).body, &b = task_.moving(int(p)).body;
      const double apart = (relative(int(p), 0) * b.centre - a.centre).norm();
      Known known;
      known.low = std::max(0.0, apart - a.radius - b.radius);
      known.best = task_.seen[p];
      known_.push_back(known);
    }
    cleared_.resize(task_.pairs.size());
  }

  /// Returns the pose of b relative to a, both in their carriages.
  /// @param i  relative to the chunk's first instant
  Pose relative(int pair, std::size_t i) const { return relative(pair, poses_[i]); }
  Pose relative(int pair, const std::vector<Pose>& T) const {
    return T[std::size_t(task_.fixed(pair).carrier)].inverse() *
           T[std::size_t(task_.moving(pair).carrier)];
  }

  /// Returns an upper bound of the relative motion between two instants, mm.
  /// @param from, to  relative to the chunk's first instant
  double moved(std::size_t pair, std::size_t from, std::size_t to) const {
    return ways_[way_of_[pair]][to] - ways_[way_of_[pair]][from];
  }

  /// Records a distance: of several contacts the first counts, otherwise the nearest point.
  void note(int pair, const Moment& moment, const Gap& gap, NearestApproach& nearest) const {
    const bool contact = gap.distance <= task_.options.resolution;
    const bool earlier =
        std::tie(moment.instant, moment.u) < std::tie(nearest.moment.instant, nearest.moment.u);
    if (nearest.contact ? !(contact && earlier) : !(gap.distance < nearest.distance)) return;
    nearest.distance = gap.distance;
    nearest.moment = moment;
    nearest.contact = contact;
    const std::vector<Pose> T = task_.placed(moment.instant, moment.u);
    nearest.place =
        T[std::size_t(task_.fixed(pair).carrier)] * Vector3d(0.5 * (gap.on_a + gap.on_b));
  }

  /// Returns true if one of two bodies with disjoint surfaces is inside the other.
  bool is_inside(int pair, std::size_t i) const {
    const Body &a = task_.fixed(pair).body, &b = task_.moving(pair).body;
    const Pose T = relative(pair, i);
    return (T * b.centre - a.centre).norm() < std::max(a.radius, b.radius) &&
           cutting::is_inside(a, Pose::Identity(), b, T);
  }

  /// Returns a lower bound of the distance at an instant, and updates the state of the pair.
  /// @param far  mm, larger distances need not be exact
  double look(int pair, std::size_t i, double far, NearestApproach& nearest) {
    Known& known = known_[std::size_t(pair)];
    // An exact distance also yields a separating plane.
    const bool exact = task_.is_simple(pair) && !task_.pairs[std::size_t(pair)].contact_only;
    const double share = exact ? 0.0 : rough * task_.options.share;
    Gap here = known.gap;
    if (known.instant != i || !known.asked || known.high >= known.most) {
      GapOptions options{share};
      if (task_.pairs[std::size_t(pair)].contact_only) options.most = (1.0 + share) * far;
      here = gap(task_.fixed(pair).body, Pose::Identity(), task_.moving(pair).body,
                 relative(pair, i), options);
      ++result.queries;
      if (here.distance > task_.options.resolution && known.met && is_inside(pair, i))
        here.distance = 0.0;
      if (i >= known.instant) {
        known.low = here.distance / (1.0 + share);
        known.high = here.distance;
        known.met = here.distance <= task_.options.resolution;
        known.instant = i;
        known.asked = true;
        known.most = options.most;
        known.gap = here;
        known.plane.reset();
      }
    }
    note(pair, {begin_ + i, 0.0}, here, nearest);
    return here.distance / (1.0 + share);
  }

  /// Returns a lower bound of the distance at an instant, from the last separating plane: a body
  /// that slides along another comes no nearer to that plane.
  double by_plane(int pair, std::size_t i) {
    Known& known = known_[std::size_t(pair)];
    const std::vector<Ball>& hull = task_.hulls[std::size_t(task_.pairs[std::size_t(pair)].b)];
    if (!known.plane) {
      if (!known.asked || known.met || known.high >= known.most) return 0.0;
      const Pose T = relative(pair, known.instant);
      known.plane = parting_plane(task_.fixed(pair).body, hull, T, known.gap.on_b - known.gap.on_a);
      known.on_b = T.inverse() * known.gap.on_b;
    }
    return beyond(*known.plane, hull, relative(pair, i));
  }

  /// Returns the same for an interval. If it is sufficient, the state is advanced to the second
  /// instant.
  double by_plane(int pair, std::size_t i0, std::size_t i1, double enough) {
    const auto p = std::size_t(pair);
    Known& known = known_[p];
    if (known.instant > i0) return 0.0;
    const auto at = [&](std::size_t i) {
      return std::max(known.low - moved(p, known.instant, i), by_plane(pair, i));
    };
    const double here = at(i0), there = at(i1);
    double least = 0.5 * (here + there - moved(p, i0, i1));
    if (least < enough && known.plane && std::min(here, there) >= enough) {
      least = infinite;
      double before = here;
      for (std::size_t i = i0; i < i1 && least >= enough; ++i) {
        const double after = at(i + 1);
        least = std::min(least, 0.5 * (before + after - moved(p, i, i + 1)));
        before = after;
      }
    }
    if (least < enough || !known.plane) return least;
    known.low = there;
    // The distance of two of their points is an upper bound of that of the bodies.
    const Vector3d apart = relative(pair, i1) * known.on_b - known.gap.on_a;
    known.high = std::min(known.high + moved(p, known.instant, i1), apart.norm());
    known.instant = i1;
    known.asked = false;
    return least;
  }

  /// Returns the distance that another one must be below to matter, given the smallest known.
  double below(double seen) const {
    return seen == infinite ? infinite
                            : std::min((1.0 - task_.options.share) * seen, seen - within);
  }

  /// Returns the distance below which a pair matters: for the clearance of the segment, for that of
  /// the pair, for contact, or because it is below the reported clearance.
  double wanted(int pair, double seen) const {
    if (task_.pairs[std::size_t(pair)].contact_only) return task_.options.resolution;
    const double of_stretch = below(std::min(smallest_, seen)),
                 of_pair = below(std::min(known_[std::size_t(pair)].best.distance, seen));
    return std::max({of_stretch, of_pair, task_.options.resolution,
                     std::min(task_.options.clearance, below(seen))});
  }

  /// Searches between two adjacent instants. @return true on contact
  bool between(int pair, std::size_t i, NearestApproach& nearest) {
    const std::vector<Pose>& from = poses_[i];
    return between(pair, i, 0.0, relative(pair, from), 1.0, relative(pair, i + 1), nearest, 0);
  }

  bool between(int pair, std::size_t i, double u0, const Pose& T0, double u1, const Pose& T1,
               NearestApproach& nearest, int halved) {
    const Body &a = task_.fixed(pair).body, &b = task_.moving(pair).body;
    const kinematics::Screw screw = kinematics::screw_between(T0, T1);
    const double middle = 0.5 * (u0 + u1);
    const Pose T = relative(pair, task_.placed(begin_ + i, middle));
    // 30 halvings are beyond any motion; the limit only ends the recursion on a jump
    constexpr int max_halved = 30;
    if (halved < max_halved &&
        farthest(kinematics::pose_at(screw, 0.5), T, b) > 0.2 * task_.options.resolution)
      return between(pair, i, u0, T0, middle, T, nearest, halved + 1) ||
             between(pair, i, middle, T, u1, T1, nearest, halved + 1);
    ApproachOptions options;
    options.resolution = task_.options.resolution;
    options.within = within;
    options.share = task_.options.share;
    options.rough = rough * task_.options.share;
    options.contact_only = task_.pairs[std::size_t(pair)].contact_only;
    const Approach found = approach(a, b, screw, options);
    result.queries += std::size_t(found.queries);
    const Moment moment{begin_ + i, u0 + found.u * (u1 - u0)};
    note(pair, moment, found.gap, nearest);
    const double allowed = std::max(options.within, options.share * found.gap.distance);
    nearest.at_least = std::min(nearest.at_least, std::max(0.0, found.gap.distance - allowed));
    return found.contact;
  }

  /// Searches between instants with distances d0 and d1. @return true on contact
  bool among(int pair, std::size_t i0, double d0, std::size_t i1, double d1,
             NearestApproach& nearest) {
    const double least = 0.5 * (d0 + d1 - moved(std::size_t(pair), i0, i1));
    if (least >= wanted(pair, nearest.distance) && task_.options.accelerated) {
      nearest.at_least = std::min(nearest.at_least, least);
      return false;
    }
    if (i1 - i0 == 1) return between(pair, i0, nearest);
    const std::size_t i = i0 + (i1 - i0) / 2;
    const double far = moved(std::size_t(pair), i0, i1) + 2.0 * task_.options.resolution;
    const double d = look(pair, i, far, nearest);
    return among(pair, i0, d0, i, d, nearest) || among(pair, i, d, i1, d1, nearest);
  }

  /// Returns true if a pair meets between two instants; distances are not needed. What the distance
  /// at the middle clears on both sides is not searched.
  bool meets(int pair, std::size_t i0, std::size_t i1, NearestApproach& nearest) {
    if (i1 - i0 == 1) return between(pair, i0, nearest);
    const auto p = std::size_t(pair);
    const std::size_t i = i0 + (i1 - i0) / 2;
    const double before = moved(p, i0, i), after = moved(p, i, i1);
    const double d =
        look(pair, i, std::max(before, after) + 2.0 * task_.options.resolution, nearest) -
        task_.options.resolution;
    std::size_t cleared_from = i, cleared_to = i;
    while (cleared_from > i0 && moved(p, cleared_from - 1, i) < d) --cleared_from;
    while (cleared_to < i1 && moved(p, i, cleared_to + 1) < d) ++cleared_to;
    return (cleared_from > i0 && meets(pair, i0, cleared_from, nearest)) ||
           (cleared_to < i1 && meets(pair, cleared_to, i1, nearest));
  }

  /// Returns true if a body does not touch between two instants, judged by the sweep of its balls
  /// and the distance of the rest. A ball end follows a surface so closely that distances would be
  /// needed at every fraction of a millimetre, while the rest is far away.
  bool passes(int pair, std::size_t i0, std::size_t i1) {
    const auto p = std::size_t(pair);
    const BodyBalls& parts = task_.parts[p];
    ContactFreeUntil& cleared = cleared_[p];
    if (!parts.balls.empty() && cleared.balls < i1) {
      if (i0 < cleared.not_before) return false;
      const std::size_t end = trail_end(p, i0, i1);
      const bool clear = std::ranges::all_of(parts.balls, [&](const Ball& ball) {
        return is_apart_from(trail(pair, ball, i0, end), pair);
      });
      result.queries += parts.balls.size();
      if (!clear) cleared.not_before = end;
      if (!clear) return false;
      cleared.balls = end;
    }
    return !parts.rest || rest_passes(pair, i0, i1);
  }

  bool rest_passes(int pair, std::size_t i0, std::size_t i1) {
    const auto p = std::size_t(pair);
    ContactFreeUntil& cleared = cleared_[p];
    cleared.rest = std::max(cleared.rest, i0);
    const auto goes_on = [&](double far) {
      const std::size_t from = cleared.rest;
      while (cleared.rest + 1 < poses_.size() &&
             moved(p, from, cleared.rest + 1) < far - task_.options.resolution)
        ++cleared.rest;
      return cleared.rest > from;
    };
    while (cleared.rest < i1) {
      const Pose T = relative(pair, cleared.rest);
      const std::vector<Ball>& hull = task_.rest_hulls[p];
      if (goes_on(beyond(cleared.plane, hull, T))) continue;
      const double share = rough * task_.options.share;
      const Gap rest =
          gap(task_.fixed(pair).body, Pose::Identity(), *task_.parts[p].rest, T, {share});
      ++result.queries;
      cleared.plane =
          parting_plane(task_.fixed(pair).body, hull, T, Vector3d(rest.on_b - rest.on_a));
      if (!goes_on(rest.distance / (1.0 + share))) return false;
    }
    return true;
  }

  /// Returns true if the fixed body of a pair is apart from a body in its frame.
  bool is_apart_from(const Body& other, int pair) const {
    const double resolution = task_.options.resolution;
    const Gap between = gap(task_.fixed(pair).body, Pose::Identity(), other, Pose::Identity(),
                            {0.0, 2.0 * resolution});
    return between.distance > resolution;
  }

  /// Returns the last instant up to which a common sweep is worthwhile.
  std::size_t trail_end(std::size_t pair, std::size_t i0, std::size_t i1) const {
    constexpr double long_enough = 4.0;  // mm
    constexpr std::size_t most = 512;    // instants
    std::size_t end = i1;
    while (end + 1 < poses_.size() && end + 1 - i0 <= most &&
           moved(pair, i0, end + 1) < long_enough)
      ++end;
    return end;
  }

  /// Returns a body that contains the sweep of a ball from one instant to another.
  Body trail(int pair, const Ball& ball, std::size_t i0, std::size_t i1) const {
    // mm, tolerance of the polyline; the ball is enlarged by as much
    constexpr double straight = 2e-3;
    std::vector<Vector3d> all;
    double bulge = 0.0;
    for (std::size_t i = i0; i <= i1; ++i) all.push_back(relative(pair, i) * ball.centre);
    for (std::size_t i = i0; i < i1; ++i) bulge = std::max(bulge, task_.motion.bulge[begin_ + i]);
    const std::vector<std::size_t> kept = corners_within(all, straight);
    Points centres(Eigen::Index(kept.size()), 3);
    for (std::size_t k = 0; k < kept.size(); ++k) centres.row(Eigen::Index(k)) = all[kept[k]];
    return ball_sweep_body(centres, ball.radius + straight + bulge);
  }

  NearestApproach contact_in(int pair, std::size_t i0, std::size_t i1) {
    NearestApproach nearest;
    const double far = moved(std::size_t(pair), i0, i1) + 2.0 * task_.options.resolution;
    Known& known = known_[std::size_t(pair)];
    if (!known.met && i0 < i1 && passes(pair, i0, i1)) {
      nearest.at_least = task_.options.resolution;
      return nearest;
    }
    if (known.met || i0 == i1) look(pair, i0, far, nearest);
    if (!nearest.contact && i0 < i1) known.met = meets(pair, i0, i1, nearest);
    nearest.at_least = nearest.contact ? 0.0 : task_.options.resolution;
    return nearest;
  }

  /// Returns the nearest approach of a pair between two instants, as far as it matters.
  NearestApproach nearest_in(int pair, std::size_t i0, std::size_t i1) {
    NearestApproach nearest;
    const double far = moved(std::size_t(pair), i0, i1) + 2.0 * task_.options.resolution;
    const double d0 = look(pair, i0, far, nearest);
    if (nearest.contact) {
      nearest.at_least = 0.0;
      return nearest;
    }
    if (i0 == i1) {
      nearest.at_least = d0;
      return nearest;
    }
    const double least = d0 - moved(std::size_t(pair), i0, i1);
    if (least >= wanted(pair, nearest.distance) && task_.options.accelerated) {
      nearest.at_least = least;
      return nearest;
    }
    const double d1 = look(pair, i1, far, nearest);
    if (among(pair, i0, d0, i1, d1, nearest)) nearest.at_least = 0.0;
    return nearest;
  }

  void follow(std::size_t stretch) {
    const std::size_t first = task_.motion.stretches[stretch], end = end_of(task_.motion, stretch);
    const std::size_t i0 = std::max(first, begin_ + 1) - 1 - begin_, i1 = end - 1 - begin_;
    const std::size_t count = task_.pairs.size();
    std::vector<double> low(count, infinite);
    smallest_ = infinite;
    for (std::size_t p = 0; p < count; ++p) {
      if (task_.followed[p] == 0) continue;
      const Known& known = known_[p];
      low[p] = std::max(0.0, known.low - moved(p, known.instant, i1));
      if (!task_.pairs[p].contact_only)
        smallest_ = std::min(smallest_, known.high + moved(p, known.instant, i0));
    }
    for (std::size_t p = 0; p < count; ++p) {
      if (!task_.options.accelerated || task_.followed[p] == 0 || task_.pairs[p].contact_only)
        continue;
      const double enough = wanted(int(p), infinite);
      if (low[p] < enough) low[p] = std::max(low[p], by_plane(int(p), i0, i1, enough));
    }
    // The pair with the smallest bound comes first, since its distance lets the others be skipped.
    std::vector<char> done(count, 0);
    for (;;) {
      std::size_t next = count;
      for (std::size_t p = 0; p < count; ++p)
        if (done[p] == 0 && task_.followed[p] != 0 &&
            (low[p] < wanted(int(p), infinite) || !task_.options.accelerated) &&
            (next == count || low[p] < low[next]))
          next = p;
      if (next == count) break;
      done[next] = 1;
      const bool contact_only = task_.pairs[next].contact_only && task_.options.accelerated;
      const NearestApproach found =
          contact_only ? contact_in(int(next), i0, i1) : nearest_in(int(next), i0, i1);
      low[next] = found.contact ? 0.0 : std::min(found.at_least, found.distance);
      if (task_.pairs[next].contact_only && !found.contact) continue;
      if (!task_.pairs[next].contact_only) smallest_ = std::min(smallest_, found.distance);
      if (found.distance < known_[next].best.distance) known_[next].best = found;
      if (found.contact || found.distance < task_.options.clearance)
        result.encounters.push_back({int(next), found.contact, stretch, stretch, found.moment,
                                     found.moment, found.distance, found.place});
    }
    SegmentClearance clearance;
    for (std::size_t p = 0; p < count; ++p)
      if (task_.followed[p] != 0 && !task_.pairs[p].contact_only &&
          (clearance.pair < 0 || low[p] < clearance.at_least))
        clearance = {low[p], int(p)};
    result.clearances.push_back(clearance);
  }

  const EncounterSearch& task_;
  std::size_t begin_ = 0;  // first instant
  std::vector<std::vector<Pose>> poses_;
  std::vector<std::vector<double>> ways_;
  std::vector<std::size_t> way_of_;        // (pairs)
  std::vector<Known> known_;               // (pairs)
  std::vector<ContactFreeUntil> cleared_;  // (pairs)
  double smallest_ = infinite;             // smallest distance of the segment
};

}  // namespace

EncounterSearchResult follow(const EncounterSearch& task, std::size_t first, std::size_t last) {
  return std::move(Chunk(task, first, last).result);
}

namespace {

void check(const std::vector<CarrierBody>& bodies, const std::vector<BodyPair>& pairs,
           const CarrierMotion& motion, const EncounterOptions& options) {
  require(options.resolution > 0.0 && options.clearance >= 0.0 && options.share > 0.0 &&
              options.share < 1.0 && options.chunk > 0,
          "encounters: resolution, share and chunk must be positive, the share below 1, the "
          "clearance not negative");
  require(motion.instants > 0 && motion.bulge.size() + 1 == motion.instants &&
              !motion.stretches.empty() && motion.stretches.front() == 0 &&
              motion.stretches.back() < motion.instants &&
              std::ranges::adjacent_find(motion.stretches, std::greater_equal<>{}) ==
                  motion.stretches.end(),
          "encounters: instants, bulges and stretches must fit each other");
  for (const CarrierBody& body : bodies)
    require(body.carrier >= 0 && body.carrier < motion.carriers && body.body.search != nullptr,
            "encounters: a body needs a carriage that is there");
  for (const BodyPair& pair : pairs)
    require(pair.a >= 0 && pair.b >= 0 && pair.a < int(bodies.size()) &&
                pair.b < int(bodies.size()) && pair.a != pair.b,
            "encounters: a pair needs two bodies that are there");
}

/// Returns the first segments of the chunks, followed by the number of segments.
std::vector<std::size_t> chunks_of(const CarrierMotion& motion, std::size_t size) {
  std::vector<std::size_t> first{0};
  for (std::size_t s = 1; s < motion.stretches.size(); ++s)
    if (motion.stretches[s] - motion.stretches[first.back()] >= size) first.push_back(s);
  first.push_back(motion.stretches.size());
  return first;
}

/// Returns the least distances at some sampled instants, which let the search skip larger ones;
/// pairs in contact at a sample are omitted there.
std::vector<NearestApproach> sampled_distances(const EncounterSearch& task, std::size_t looks) {
  std::vector<NearestApproach> seen(task.pairs.size());
  std::vector<std::size_t> instants;
  for (std::size_t k = 0; k < looks; ++k)
    instants.push_back(k * (task.motion.instants - 1) / std::max<std::size_t>(looks - 1, 1));
  std::vector<std::vector<Pose>> T;
  for (const std::size_t i : instants) T.push_back(task.placed(i, 0.0));
  tbb::parallel_for(std::size_t(0), task.pairs.size(), [&](std::size_t p) {
    if (task.followed[p] == 0 || task.pairs[p].contact_only) return;
    const CarrierBody &a = task.fixed(int(p)), &b = task.moving(int(p));
    for (std::size_t k = 0; k < instants.size(); ++k) {
      const Gap here = gap(a.body, T[k][std::size_t(a.carrier)], b.body,
                           T[k][std::size_t(b.carrier)], {0.0, seen[p].distance});
      if (!(here.distance < seen[p].distance) || here.distance <= task.options.resolution) continue;
      seen[p].distance = here.distance;
      seen[p].moment = {instants[k], 0.0};
      seen[p].place = 0.5 * (here.on_a + here.on_b);
    }
  });
  return seen;
}

/// Returns the time at which the two bodies of a near miss come within the clearance, in its first
/// segment.
Moment begin_of(const EncounterSearch& task, const Encounter& near) {
  const CarrierBody &a = task.fixed(near.pair), &b = task.moving(near.pair);
  const auto relative = [&](std::size_t i) {
    const std::vector<Pose> T = task.placed(i, 0.0);
    return Pose(T[std::size_t(a.carrier)].inverse() * T[std::size_t(b.carrier)]);
  };
  const std::size_t first = task.motion.stretches[near.first_segment];
  const std::size_t end =
      std::min(end_of(task.motion, near.first_segment) - 1, near.moment.instant + 1);
  const std::size_t begin = std::max<std::size_t>(first, 1) - 1;
  Pose before = relative(begin);
  for (std::size_t i = begin; i < end; ++i) {
    const Pose after = relative(i + 1);
    const std::optional<double> u =
        comes_within(a.body, b.body, kinematics::screw_between(before, after),
                     task.options.clearance, task.options.resolution);
    if (u) return {i, *u};
    before = after;
  }
  return near.moment;
}

/// Joins encounters of single segments: one that continues in the next segment is one encounter,
/// and a near miss before or after a contact belongs to the contact.
class Joined {
 public:
  explicit Joined(std::size_t pairs) : open_(pairs) {}

  void add(const Encounter& next) {
    Open& open = open_[std::size_t(next.pair)];
    const bool goes_on = open.index && open.last + 1 >= next.first_segment;
    open.last = next.last_segment;
    if (!goes_on) {
      open.index = list.size();
      list.push_back(next);
      return;
    }
    Encounter& one = list[*open.index];
    if (next.contact == one.contact) {
      const std::size_t first = one.first_segment;
      if (!one.contact && next.distance < one.distance) one = next;
      one.first_segment = first;
      one.last_segment = next.last_segment;
    } else if (next.contact) {
      one = next;
    }
  }

  std::vector<Encounter> list;

 private:
  struct Open {
    std::optional<std::size_t> index;
    std::size_t last = 0;  // segment
  };
  std::vector<Open> open_;  // (pairs)
};

}  // namespace

std::size_t end_of(const CarrierMotion& motion, std::size_t stretch) {
  const std::size_t next = stretch + 1;
  return next < motion.stretches.size() ? motion.stretches[next] : motion.instants;
}

Encounters encounters(const std::vector<CarrierBody>& bodies, const std::vector<BodyPair>& pairs,
                      const CarrierMotion& motion, const EncounterOptions& options) {
  check(bodies, pairs, motion, options);
  EncounterSearch task{bodies, pairs, motion, options, std::vector<char>(pairs.size(), 1)};
  for (const BodyPair& pair : pairs)
    task.parts.push_back(pair.contact_only && options.accelerated
                             ? split_into_balls(bodies[std::size_t(pair.b)].body)
                             : BodyBalls{});
  for (const BodyBalls& one : task.parts)
    task.rest_hulls.push_back(one.rest ? hull_balls(*one.rest) : std::vector<Ball>{});
  Encounters all;
  all.pairs.resize(pairs.size());
  const std::vector<Pose> T = task.placed(0, 0.0);
  tbb::parallel_for(std::size_t(0), pairs.size(), [&](std::size_t p) {
    const CarrierBody &a = task.fixed(int(p)), &b = task.moving(int(p));
    const Pose &T_a = T[std::size_t(a.carrier)], &T_b = T[std::size_t(b.carrier)];
    const bool overlap = gap(a.body, T_a, b.body, T_b).distance <= options.resolution ||
                         is_inside(a.body, T_a, b.body, T_b);
    all.pairs[p].overlaps_at_start = overlap;
    task.followed[p] = overlap ? 0 : 1;
  });
  all.queries = pairs.size();
  for (const CarrierBody& one : bodies) task.hulls.push_back(hull_balls(one.body));
  // Few compared with the distances of the search itself.
  const std::size_t looks =
      options.accelerated ? std::min<std::size_t>(256, motion.instants / 64) : 0;
  task.seen = sampled_distances(task, looks);
  all.queries += looks * pairs.size();
  const std::vector<std::size_t> first = chunks_of(motion, options.chunk);
  std::vector<EncounterSearchResult> chunks(first.size() - 1);
  std::atomic<std::size_t> done{0};
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, chunks.size(), 1),
      [&](const auto& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c) {
          chunks[c] = follow(task, first[c], first[c + 1]);
          if (options.progress) options.progress(double(++done) / double(chunks.size()));
        }
      },
      tbb::simple_partitioner{});
  for (PairClearance& pair : all.pairs) pair.distance = pair.overlaps_at_start ? 0.0 : infinite;
  Joined joined(pairs.size());
  for (const EncounterSearchResult& chunk : chunks) {
    all.queries += chunk.queries;
    all.stretches.insert(all.stretches.end(), chunk.clearances.begin(), chunk.clearances.end());
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const NearestApproach& best = chunk.best[p];
      if (task.followed[p] != 0 && best.distance < all.pairs[p].distance)
        all.pairs[p] = {false, best.contact ? 0.0 : best.distance, best.moment};
    }
    std::vector<Encounter> found = chunk.encounters;
    std::ranges::stable_sort(
        found, {}, [](const Encounter& one) { return std::tuple(one.first_segment, one.pair); });
    for (const Encounter& one : found) joined.add(one);
  }
  all.list = std::move(joined.list);
  tbb::parallel_for(std::size_t(0), all.list.size(), [&](std::size_t i) {
    Encounter& one = all.list[i];
    one.begin = one.contact ? one.moment : begin_of(task, one);
  });
  return all;
}

}  // namespace abbe::cutting
