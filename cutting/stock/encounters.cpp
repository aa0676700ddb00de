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

namespace abbe::cutting {

namespace {

using Eigen::Vector3d;
using kinematics::Pose;

/// The nearest approach of a pair within a segment.
struct NearestApproach {
  double min_clearance = std::numeric_limits<double>::infinity();  ///< mm, lower bound
  double distance = std::numeric_limits<double>::infinity();       ///< mm, smallest computed
  bool contact = false;
  Moment moment;
  Vector3d place = Vector3d::Zero();
};

/// The bodies, the pairs and their motion, shared by all threads.
struct EncounterSearch {
  const std::vector<CarrierBody>& bodies;
  const std::vector<BodyPair>& pairs;
  const CarrierMotion& motion;
  const EncounterOptions& options;
  std::vector<char> is_followed;              ///< (pairs)
  std::vector<std::vector<Ball>> hulls = {};  ///< (bodies) empty if a body has too many vertices
  std::vector<NearestApproach> sampled_nearest = {};  ///< (pairs) smallest sampled distances
  /// (pairs) balls and other components of the moving body if only contact matters
  std::vector<BodyBalls> moving_parts = {};
  std::vector<std::vector<Ball>> rest_hulls = {};  ///< (pairs) of those components

  const CarrierBody& fixed(int pair) const {
    return bodies[std::size_t(pairs[std::size_t(pair)].a)];
  }
  bool has_hulls(int pair) const {
    return !hulls[std::size_t(pairs[std::size_t(pair)].a)].empty() &&
           !hulls[std::size_t(pairs[std::size_t(pair)].b)].empty();
  }
  const CarrierBody& moving(int pair) const {
    return bodies[std::size_t(pairs[std::size_t(pair)].b)];
  }
  std::vector<Pose> poses(std::size_t instant, double u) const {
    std::vector<Pose> T(std::size_t(motion.carriers), Pose::Identity());
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

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double clearance_accuracy = 1e-2;   // mm, if larger than the relative accuracy `share`
constexpr double query_error_fraction = 0.3;  // of `share`, permitted error of a single distance

/// The state of a pair: its distance at an instant, and its nearest approach so far.
struct PairState {
  double low = 0.0, high = infinity;  // mm, bounds at `instant`
  bool is_in_contact = true;          // or unknown: one may be inside the other
  std::size_t instant = 0;
  std::optional<PartingPlane> plane;  // between the two bodies, if computed
  Vector3d on_b = Vector3d::Zero();   // point of the gap in the frame of b, if `plane` was computed
  bool is_computed = false;           // true if the gap was computed at `instant`
  double max_distance = infinity;     // mm, limit of that computation
  Gap gap;
  NearestApproach best;
};

/// The instants up to which the balls and the other components of a body are known to be free of
/// contact.
struct ContactFreeUntil {
  std::size_t balls = 0, rest = 0;
  std::size_t undecided_until = 0;  // instant up to which the sweep of the balls decides nothing
  PartingPlane plane = {};          // between a and the rest
};

/// Returns indices of points, both ends included, whose polyline is within a distance of all
/// points.
std::vector<std::size_t> simplified_polyline(const std::vector<Vector3d>& points, double distance) {
  const auto is_straight = [&](std::size_t begin, std::size_t end) {
    const Vector3d chord = points[end] - points[begin];
    for (std::size_t i = begin + 1; i < end; ++i) {
      const Vector3d offset = points[i] - points[begin];
      const double squared_length = chord.squaredNorm();
      const double fraction =
          squared_length > 0.0 ? std::clamp(offset.dot(chord) / squared_length, 0.0, 1.0) : 0.0;
      if ((offset - fraction * chord).norm() > distance) return false;
    }
    return true;
  };
  std::vector<std::size_t> vertices{0};
  while (vertices.back() + 1 < points.size()) {
    std::size_t end = vertices.back() + 1;
    // The stride doubles, so a long straight path costs few tests.
    for (std::size_t stride = 1;
         end + stride < points.size() && is_straight(vertices.back(), end + stride); stride *= 2)
      end += stride;
    vertices.push_back(end);
  }
  return vertices;
}

/// The search through one chunk of the program.
class ChunkSearch {
 public:
  /// @param first, last  segments, the second excluded
  ChunkSearch(const EncounterSearch& search, std::size_t first, std::size_t last)
      : search_(search) {
    begin_ = search.motion.segments[first];
    // The interval between two segments belongs to the second.
    if (begin_ > 0) --begin_;
    const std::size_t end = segment_end(search.motion, last - 1);
    for (std::size_t i = begin_; i < end; ++i) poses_.push_back(search.poses(i, 0.0));
    compute_travels();
    initialize_states();
    for (std::size_t segment = first; segment < last; ++segment) follow(segment);
    for (const PairState& state : states_) result.best.push_back(state.best);
  }

  EncounterSearchResult result;

 private:
  /// Computes an upper bound of each pair's relative motion since the first instant.
  void compute_travels() {
    std::map<std::tuple<int, int>, std::size_t> travel_by_bodies;  // carrier of a, body b
    for (std::size_t p = 0; p < search_.pairs.size(); ++p) {
      const auto key = std::tuple(search_.fixed(int(p)).carrier, search_.pairs[p].b);
      const auto [entry, is_new] = travel_by_bodies.emplace(key, travels_.size());
      travel_of_pair_.push_back(entry->second);
      if (is_new) travels_.push_back(pair_travel(int(p)));
    }
  }

  std::vector<double> pair_travel(int pair) const {
    std::vector<double> travel(poses_.size(), 0.0);
    const Body& body = search_.moving(pair).body;
    Pose previous = relative_pose(pair, 0);
    for (std::size_t i = 1; i < poses_.size(); ++i) {
      const Pose current = relative_pose(pair, i);
      const double step = max_displacement(previous, current, body);
      travel[i] = travel[i - 1] + (step > 0.0 ? step + search_.motion.bulge[begin_ + i - 1] : 0.0);
      previous = current;
    }
    return travel;
  }

  void initialize_states() {
    for (std::size_t p = 0; p < search_.pairs.size(); ++p) {
      const Body &a = search_.fixed(int(p)).body, &b = search_.moving(int(p)).body;
      const double centre_distance = (relative_pose(int(p), 0) * b.centre - a.centre).norm();
      PairState state;
      state.low = std::max(0.0, centre_distance - a.radius - b.radius);
      state.best = search_.sampled_nearest[p];
      states_.push_back(state);
    }
    contact_free_.resize(search_.pairs.size());
  }

  /// Returns the pose of b relative to a, both in their carriages.
  /// @param i  relative to the chunk's first instant
  Pose relative_pose(int pair, std::size_t i) const { return relative_pose(pair, poses_[i]); }
  Pose relative_pose(int pair, const std::vector<Pose>& T) const {
    return T[std::size_t(search_.fixed(pair).carrier)].inverse() *
           T[std::size_t(search_.moving(pair).carrier)];
  }

  /// Returns an upper bound of the relative motion between two instants, mm.
  /// @param from, to  relative to the chunk's first instant
  double relative_travel(std::size_t pair, std::size_t from, std::size_t to) const {
    return travels_[travel_of_pair_[pair]][to] - travels_[travel_of_pair_[pair]][from];
  }

  /// Records a distance: the first contact, or without contact the least distance.
  void record(int pair, const Moment& moment, const Gap& gap, NearestApproach& nearest) const {
    const bool is_contact = gap.distance <= search_.options.resolution;
    const bool is_earlier =
        std::tie(moment.instant, moment.u) < std::tie(nearest.moment.instant, nearest.moment.u);
    if (nearest.contact ? !(is_contact && is_earlier) : !(gap.distance < nearest.distance)) return;
    nearest.distance = gap.distance;
    nearest.moment = moment;
    nearest.contact = is_contact;
    const std::vector<Pose> T = search_.poses(moment.instant, moment.u);
    nearest.place =
        T[std::size_t(search_.fixed(pair).carrier)] * Vector3d(0.5 * (gap.on_a + gap.on_b));
  }

  /// Returns true if one of two bodies with disjoint surfaces is inside the other.
  bool is_inside(int pair, std::size_t i) const {
    const Body &a = search_.fixed(pair).body, &b = search_.moving(pair).body;
    const Pose T = relative_pose(pair, i);
    return (T * b.centre - a.centre).norm() < std::max(a.radius, b.radius) &&
           cutting::is_inside(a, Pose::Identity(), b, T);
  }

  /// Returns a lower bound of the distance at an instant, and updates the state of the pair.
  /// @param max_needed  mm, larger distances need not be exact
  double sample(int pair, std::size_t i, double max_needed, NearestApproach& nearest) {
    PairState& state = states_[std::size_t(pair)];
    // An exact distance also yields a separating plane.
    const bool exact = search_.has_hulls(pair) && !search_.pairs[std::size_t(pair)].contact_only;
    const double relative_error = exact ? 0.0 : query_error_fraction * search_.options.share;
    Gap current_gap = state.gap;
    if (state.instant != i || !state.is_computed || state.high >= state.max_distance) {
      GapOptions options{relative_error};
      if (search_.pairs[std::size_t(pair)].contact_only)
        options.max_distance = (1.0 + relative_error) * max_needed;
      current_gap = gap(search_.fixed(pair).body, Pose::Identity(), search_.moving(pair).body,
                        relative_pose(pair, i), options);
      ++result.queries;
      if (current_gap.distance > search_.options.resolution && state.is_in_contact &&
          is_inside(pair, i))
        current_gap.distance = 0.0;
      if (i >= state.instant) {
        state.low = current_gap.distance / (1.0 + relative_error);
        state.high = current_gap.distance;
        state.is_in_contact = current_gap.distance <= search_.options.resolution;
        state.instant = i;
        state.is_computed = true;
        state.max_distance = options.max_distance;
        state.gap = current_gap;
        state.plane.reset();
      }
    }
    record(pair, {begin_ + i, 0.0}, current_gap, nearest);
    return current_gap.distance / (1.0 + relative_error);
  }

  /// Returns a lower bound of the distance at an instant from the last separating plane. The bound
  /// remains tight while a body slides along another.
  double plane_bound(int pair, std::size_t i) {
    PairState& state = states_[std::size_t(pair)];
    const std::vector<Ball>& hull = search_.hulls[std::size_t(search_.pairs[std::size_t(pair)].b)];
    if (!state.plane) {
      if (!state.is_computed || state.is_in_contact || state.high >= state.max_distance) return 0.0;
      const Pose T = relative_pose(pair, state.instant);
      state.plane =
          parting_plane(search_.fixed(pair).body, hull, T, state.gap.on_b - state.gap.on_a);
      state.on_b = T.inverse() * state.gap.on_b;
    }
    return plane_distance(*state.plane, hull, relative_pose(pair, i));
  }

  /// Returns the same bound for an interval. If it reaches `required`, advances the state of the
  /// pair to the second instant.
  double plane_bound(int pair, std::size_t i0, std::size_t i1, double required) {
    const auto p = std::size_t(pair);
    PairState& state = states_[p];
    if (state.instant > i0) return 0.0;
    const auto at = [&](std::size_t i) {
      return std::max(state.low - relative_travel(p, state.instant, i), plane_bound(pair, i));
    };
    const double begin_bound = at(i0), end_bound = at(i1);
    double min_distance = 0.5 * (begin_bound + end_bound - relative_travel(p, i0, i1));
    if (min_distance < required && state.plane && std::min(begin_bound, end_bound) >= required) {
      min_distance = infinity;
      double left_bound = begin_bound;
      for (std::size_t i = i0; i < i1 && min_distance >= required; ++i) {
        const double right_bound = at(i + 1);
        min_distance =
            std::min(min_distance, 0.5 * (left_bound + right_bound - relative_travel(p, i, i + 1)));
        left_bound = right_bound;
      }
    }
    if (min_distance < required || !state.plane) return min_distance;
    state.low = end_bound;
    // The distance between two points of the bodies is an upper bound.
    const Vector3d displacement = relative_pose(pair, i1) * state.on_b - state.gap.on_a;
    state.high = std::min(state.high + relative_travel(p, state.instant, i1), displacement.norm());
    state.instant = i1;
    state.is_computed = false;
    return min_distance;
  }

  /// Returns the limit below which a distance improves on the smallest known one significantly.
  double improvement_limit(double known_distance) const {
    return known_distance == infinity ? infinity
                                      : std::min((1.0 - search_.options.share) * known_distance,
                                                 known_distance - clearance_accuracy);
  }

  /// Returns the distance below which a pair must be searched: for the clearance of the segment,
  /// the clearance of the pair, a contact, or the report of a near miss.
  double needed_distance(int pair, double known_distance) const {
    if (search_.pairs[std::size_t(pair)].contact_only) return search_.options.resolution;
    const double segment_limit = improvement_limit(std::min(min_distance_, known_distance)),
                 pair_limit = improvement_limit(
                     std::min(states_[std::size_t(pair)].best.distance, known_distance));
    return std::max({segment_limit, pair_limit, search_.options.resolution,
                     std::min(search_.options.clearance, improvement_limit(known_distance))});
  }

  /// Searches between two adjacent instants. Returns true on contact.
  bool search_interval(int pair, std::size_t i, NearestApproach& nearest) {
    const std::vector<Pose>& from = poses_[i];
    return search_interval(pair, i, 0.0, relative_pose(pair, from), 1.0, relative_pose(pair, i + 1),
                           nearest, 0);
  }

  bool search_interval(int pair, std::size_t i, double u0, const Pose& T0, double u1,
                       const Pose& T1, NearestApproach& nearest, int depth) {
    const Body &a = search_.fixed(pair).body, &b = search_.moving(pair).body;
    const kinematics::Screw screw = kinematics::screw_between(T0, T1);
    const double middle_u = 0.5 * (u0 + u1);
    const Pose T = relative_pose(pair, search_.poses(begin_ + i, middle_u));
    // No motion requires 30 halvings; the limit only ends the recursion on a jump.
    constexpr int max_depth = 30;
    if (depth < max_depth &&
        max_displacement(kinematics::pose_at(screw, 0.5), T, b) > 0.2 * search_.options.resolution)
      return search_interval(pair, i, u0, T0, middle_u, T, nearest, depth + 1) ||
             search_interval(pair, i, middle_u, T, u1, T1, nearest, depth + 1);
    ApproachOptions options;
    options.resolution = search_.options.resolution;
    options.within = clearance_accuracy;
    options.share = search_.options.share;
    options.query_error = query_error_fraction * search_.options.share;
    options.contact_only = search_.pairs[std::size_t(pair)].contact_only;
    const Approach nearest_approach = approach(a, b, screw, options);
    result.queries += std::size_t(nearest_approach.queries);
    const Moment moment{begin_ + i, u0 + nearest_approach.u * (u1 - u0)};
    record(pair, moment, nearest_approach.gap, nearest);
    const double tolerance =
        std::max(options.within, options.share * nearest_approach.gap.distance);
    nearest.min_clearance =
        std::min(nearest.min_clearance, std::max(0.0, nearest_approach.gap.distance - tolerance));
    return nearest_approach.contact;
  }

  /// Searches between instants with the distances d0 and d1. Returns true on contact.
  bool search_range(int pair, std::size_t i0, double d0, std::size_t i1, double d1,
                    NearestApproach& nearest) {
    const double min_distance = 0.5 * (d0 + d1 - relative_travel(std::size_t(pair), i0, i1));
    if (min_distance >= needed_distance(pair, nearest.distance) && search_.options.accelerated) {
      nearest.min_clearance = std::min(nearest.min_clearance, min_distance);
      return false;
    }
    if (i1 - i0 == 1) return search_interval(pair, i0, nearest);
    const std::size_t i = i0 + (i1 - i0) / 2;
    const double max_needed =
        relative_travel(std::size_t(pair), i0, i1) + 2.0 * search_.options.resolution;
    const double d = sample(pair, i, max_needed, nearest);
    return search_range(pair, i0, d0, i, d, nearest) || search_range(pair, i, d, i1, d1, nearest);
  }

  /// Returns true if a pair has contact between two instants. Skips the instants on both sides of
  /// the middle that the distance at the middle proves free of contact.
  bool search_contact(int pair, std::size_t i0, std::size_t i1, NearestApproach& nearest) {
    if (i1 - i0 == 1) return search_interval(pair, i0, nearest);
    const auto p = std::size_t(pair);
    const std::size_t i = i0 + (i1 - i0) / 2;
    const double travel_before = relative_travel(p, i0, i),
                 travel_after = relative_travel(p, i, i1);
    const double d =
        sample(pair, i, std::max(travel_before, travel_after) + 2.0 * search_.options.resolution,
               nearest) -
        search_.options.resolution;
    std::size_t free_begin = i, free_end = i;
    while (free_begin > i0 && relative_travel(p, free_begin - 1, i) < d) --free_begin;
    while (free_end < i1 && relative_travel(p, i, free_end + 1) < d) ++free_end;
    return (free_begin > i0 && search_contact(pair, i0, free_begin, nearest)) ||
           (free_end < i1 && search_contact(pair, free_end, i1, nearest));
  }

  /// Returns true if the sweep of the moving body's balls and the distance of its other components
  /// prove that there is no contact between two instants. A ball end follows a surface so closely
  /// that distances would be needed every fraction of a millimetre, while the rest is far away.
  bool is_contact_free(int pair, std::size_t i0, std::size_t i1) {
    const auto p = std::size_t(pair);
    const BodyBalls& moving_parts = search_.moving_parts[p];
    ContactFreeUntil& contact_free = contact_free_[p];
    if (!moving_parts.balls.empty() && contact_free.balls < i1) {
      if (i0 < contact_free.undecided_until) return false;
      const std::size_t end = sweep_end(p, i0, i1);
      const bool is_clear = std::ranges::all_of(moving_parts.balls, [&](const Ball& ball) {
        return is_apart_from(ball_sweep(pair, ball, i0, end), pair);
      });
      result.queries += moving_parts.balls.size();
      if (!is_clear) {
        contact_free.undecided_until = end;
        return false;
      }
      contact_free.balls = end;
    }
    return !moving_parts.rest || is_rest_contact_free(pair, i0, i1);
  }

  bool is_rest_contact_free(int pair, std::size_t i0, std::size_t i1) {
    const auto p = std::size_t(pair);
    ContactFreeUntil& contact_free = contact_free_[p];
    contact_free.rest = std::max(contact_free.rest, i0);
    const auto advance = [&](double max_needed) {
      const std::size_t from = contact_free.rest;
      while (contact_free.rest + 1 < poses_.size() &&
             relative_travel(p, from, contact_free.rest + 1) <
                 max_needed - search_.options.resolution)
        ++contact_free.rest;
      return contact_free.rest > from;
    };
    while (contact_free.rest < i1) {
      const Pose T = relative_pose(pair, contact_free.rest);
      const std::vector<Ball>& hull = search_.rest_hulls[p];
      if (advance(plane_distance(contact_free.plane, hull, T))) continue;
      const double relative_error = query_error_fraction * search_.options.share;
      const Gap rest = gap(search_.fixed(pair).body, Pose::Identity(),
                           *search_.moving_parts[p].rest, T, {relative_error});
      ++result.queries;
      contact_free.plane =
          parting_plane(search_.fixed(pair).body, hull, T, Vector3d(rest.on_b - rest.on_a));
      if (!advance(rest.distance / (1.0 + relative_error))) return false;
    }
    return true;
  }

  /// Returns true if the fixed body of a pair has no contact with a body in its frame.
  bool is_apart_from(const Body& other, int pair) const {
    const double resolution = search_.options.resolution;
    const Gap distance = gap(search_.fixed(pair).body, Pose::Identity(), other, Pose::Identity(),
                             {0.0, 2.0 * resolution});
    return distance.distance > resolution;
  }

  /// Returns the last instant to include in the sweep of a ball.
  std::size_t sweep_end(std::size_t pair, std::size_t i0, std::size_t i1) const {
    constexpr double max_sweep_length = 4.0;   // mm
    constexpr std::size_t max_instants = 512;  // instants
    std::size_t end = i1;
    while (end + 1 < poses_.size() && end + 1 - i0 <= max_instants &&
           relative_travel(pair, i0, end + 1) < max_sweep_length)
      ++end;
    return end;
  }

  /// Returns a body that contains the sweep of a ball from one instant to another.
  Body ball_sweep(int pair, const Ball& ball, std::size_t i0, std::size_t i1) const {
    // mm, tolerance of the polyline, by which the ball is enlarged.
    constexpr double chord_tolerance = 2e-3;
    std::vector<Vector3d> path;
    double bulge = 0.0;
    for (std::size_t i = i0; i <= i1; ++i) path.push_back(relative_pose(pair, i) * ball.centre);
    for (std::size_t i = i0; i < i1; ++i) bulge = std::max(bulge, search_.motion.bulge[begin_ + i]);
    const std::vector<std::size_t> vertices = simplified_polyline(path, chord_tolerance);
    Points centres(Eigen::Index(vertices.size()), 3);
    for (std::size_t k = 0; k < vertices.size(); ++k)
      centres.row(Eigen::Index(k)) = path[vertices[k]];
    return ball_sweep_body(centres, ball.radius + chord_tolerance + bulge);
  }

  NearestApproach contact_search(int pair, std::size_t i0, std::size_t i1) {
    NearestApproach nearest;
    const double max_needed =
        relative_travel(std::size_t(pair), i0, i1) + 2.0 * search_.options.resolution;
    PairState& state = states_[std::size_t(pair)];
    if (!state.is_in_contact && i0 < i1 && is_contact_free(pair, i0, i1)) {
      nearest.min_clearance = search_.options.resolution;
      return nearest;
    }
    if (state.is_in_contact || i0 == i1) sample(pair, i0, max_needed, nearest);
    if (!nearest.contact && i0 < i1) state.is_in_contact = search_contact(pair, i0, i1, nearest);
    nearest.min_clearance = nearest.contact ? 0.0 : search_.options.resolution;
    return nearest;
  }

  /// Returns the nearest approach of a pair between two instants; not exact beyond the needed
  /// distance.
  NearestApproach nearest_search(int pair, std::size_t i0, std::size_t i1) {
    NearestApproach nearest;
    const double max_needed =
        relative_travel(std::size_t(pair), i0, i1) + 2.0 * search_.options.resolution;
    const double d0 = sample(pair, i0, max_needed, nearest);
    if (nearest.contact) {
      nearest.min_clearance = 0.0;
      return nearest;
    }
    if (i0 == i1) {
      nearest.min_clearance = d0;
      return nearest;
    }
    const double min_distance = d0 - relative_travel(std::size_t(pair), i0, i1);
    if (min_distance >= needed_distance(pair, nearest.distance) && search_.options.accelerated) {
      nearest.min_clearance = min_distance;
      return nearest;
    }
    const double d1 = sample(pair, i1, max_needed, nearest);
    if (search_range(pair, i0, d0, i1, d1, nearest)) nearest.min_clearance = 0.0;
    return nearest;
  }

  void follow(std::size_t segment) {
    const std::size_t first = search_.motion.segments[segment],
                      end = segment_end(search_.motion, segment);
    const std::size_t i0 = std::max(first, begin_ + 1) - 1 - begin_, i1 = end - 1 - begin_;
    const std::size_t count = search_.pairs.size();
    std::vector<double> low(count, infinity);
    min_distance_ = infinity;
    for (std::size_t p = 0; p < count; ++p) {
      if (search_.is_followed[p] == 0) continue;
      const PairState& state = states_[p];
      low[p] = std::max(0.0, state.low - relative_travel(p, state.instant, i1));
      if (!search_.pairs[p].contact_only)
        min_distance_ = std::min(min_distance_, state.high + relative_travel(p, state.instant, i0));
    }
    for (std::size_t p = 0; p < count; ++p) {
      if (!search_.options.accelerated || search_.is_followed[p] == 0 ||
          search_.pairs[p].contact_only)
        continue;
      const double required = needed_distance(int(p), infinity);
      if (low[p] < required) low[p] = std::max(low[p], plane_bound(int(p), i0, i1, required));
    }
    // The pair with the smallest bound comes first, since its distance may rule out the others.
    std::vector<char> is_done(count, 0);
    for (;;) {
      std::size_t next_pair = count;
      for (std::size_t p = 0; p < count; ++p)
        if (is_done[p] == 0 && search_.is_followed[p] != 0 &&
            (low[p] < needed_distance(int(p), infinity) || !search_.options.accelerated) &&
            (next_pair == count || low[p] < low[next_pair]))
          next_pair = p;
      if (next_pair == count) break;
      is_done[next_pair] = 1;
      const bool contact_only =
          search_.pairs[next_pair].contact_only && search_.options.accelerated;
      const NearestApproach nearest = contact_only ? contact_search(int(next_pair), i0, i1)
                                                   : nearest_search(int(next_pair), i0, i1);
      low[next_pair] = nearest.contact ? 0.0 : std::min(nearest.min_clearance, nearest.distance);
      if (search_.pairs[next_pair].contact_only && !nearest.contact) continue;
      if (!search_.pairs[next_pair].contact_only)
        min_distance_ = std::min(min_distance_, nearest.distance);
      if (nearest.distance < states_[next_pair].best.distance) states_[next_pair].best = nearest;
      if (nearest.contact || nearest.distance < search_.options.clearance)
        result.encounters.push_back({int(next_pair), nearest.contact, segment, segment,
                                     nearest.moment, nearest.moment, nearest.distance,
                                     nearest.place});
    }
    SegmentClearance clearance;
    for (std::size_t p = 0; p < count; ++p)
      if (search_.is_followed[p] != 0 && !search_.pairs[p].contact_only &&
          (clearance.pair < 0 || low[p] < clearance.min_clearance))
        clearance = {low[p], int(p)};
    result.clearances.push_back(clearance);
  }

  const EncounterSearch& search_;
  std::size_t begin_ = 0;  // first instant
  std::vector<std::vector<Pose>> poses_;
  std::vector<std::vector<double>> travels_;
  std::vector<std::size_t> travel_of_pair_;     // (pairs)
  std::vector<PairState> states_;               // (pairs)
  std::vector<ContactFreeUntil> contact_free_;  // (pairs)
  double min_distance_ = infinity;              // smallest distance of the segment
};

void check(const std::vector<CarrierBody>& bodies, const std::vector<BodyPair>& pairs,
           const CarrierMotion& motion, const EncounterOptions& options) {
  require(options.resolution > 0.0 && options.clearance >= 0.0 && options.share > 0.0 &&
              options.share < 1.0 && options.chunk > 0,
          "encounters: resolution, share and chunk must be positive, the share below 1, the "
          "clearance not negative");
  require(motion.instants > 0 && motion.bulge.size() + 1 == motion.instants &&
              !motion.segments.empty() && motion.segments.front() == 0 &&
              motion.segments.back() < motion.instants &&
              std::ranges::adjacent_find(motion.segments, std::greater_equal<>{}) ==
                  motion.segments.end(),
          "encounters: instants, bulges and segments must have matching sizes");
  for (const CarrierBody& body : bodies)
    require(body.carrier >= 0 && body.carrier < motion.carriers && body.body.search != nullptr,
            "encounters: a body refers to a carrier that does not exist");
  for (const BodyPair& pair : pairs)
    require(pair.a >= 0 && pair.b >= 0 && pair.a < int(bodies.size()) &&
                pair.b < int(bodies.size()) && pair.a != pair.b,
            "encounters: a pair must name two different bodies that exist");
}

/// Returns the first segments of the chunks, followed by the number of segments.
std::vector<std::size_t> chunk_starts(const CarrierMotion& motion, std::size_t size) {
  std::vector<std::size_t> first{0};
  for (std::size_t segment = 1; segment < motion.segments.size(); ++segment)
    if (motion.segments[segment] - motion.segments[first.back()] >= size) first.push_back(segment);
  first.push_back(motion.segments.size());
  return first;
}

/// Returns the least distances at some sampled instants, which let the search skip larger ones.
/// Samples in contact are not included.
std::vector<NearestApproach> sampled_distances(const EncounterSearch& search,
                                               std::size_t sample_count) {
  std::vector<NearestApproach> nearest(search.pairs.size());
  std::vector<std::size_t> instants;
  for (std::size_t k = 0; k < sample_count; ++k)
    instants.push_back(k * (search.motion.instants - 1) /
                       std::max<std::size_t>(sample_count - 1, 1));
  std::vector<std::vector<Pose>> T;
  for (const std::size_t i : instants) T.push_back(search.poses(i, 0.0));
  tbb::parallel_for(std::size_t(0), search.pairs.size(), [&](std::size_t p) {
    if (search.is_followed[p] == 0 || search.pairs[p].contact_only) return;
    const CarrierBody &a = search.fixed(int(p)), &b = search.moving(int(p));
    for (std::size_t k = 0; k < instants.size(); ++k) {
      const Gap current_gap = gap(a.body, T[k][std::size_t(a.carrier)], b.body,
                                  T[k][std::size_t(b.carrier)], {0.0, nearest[p].distance});
      if (!(current_gap.distance < nearest[p].distance) ||
          current_gap.distance <= search.options.resolution)
        continue;
      nearest[p].distance = current_gap.distance;
      nearest[p].moment = {instants[k], 0.0};
      nearest[p].place = 0.5 * (current_gap.on_a + current_gap.on_b);
    }
  });
  return nearest;
}

/// Returns the time, in the first segment of a near miss, at which the two bodies come within the
/// clearance.
Moment near_miss_begin(const EncounterSearch& search, const Encounter& near_miss) {
  const CarrierBody &a = search.fixed(near_miss.pair), &b = search.moving(near_miss.pair);
  const auto relative_pose = [&](std::size_t i) {
    const std::vector<Pose> T = search.poses(i, 0.0);
    return Pose(T[std::size_t(a.carrier)].inverse() * T[std::size_t(b.carrier)]);
  };
  const std::size_t first = search.motion.segments[near_miss.first_segment];
  const std::size_t end = std::min(segment_end(search.motion, near_miss.first_segment) - 1,
                                   near_miss.moment.instant + 1);
  const std::size_t begin = std::max<std::size_t>(first, 1) - 1;
  Pose previous = relative_pose(begin);
  for (std::size_t i = begin; i < end; ++i) {
    const Pose next = relative_pose(i + 1);
    const std::optional<double> u =
        first_time_within(a.body, b.body, kinematics::screw_between(previous, next),
                          search.options.clearance, search.options.resolution);
    if (u) return {i, *u};
    previous = next;
  }
  return near_miss.moment;
}

/// Joins the encounters of single segments: one that continues in the next segment is one
/// encounter, and a near miss before or after a contact belongs to the contact.
class EncounterJoiner {
 public:
  explicit EncounterJoiner(std::size_t pairs) : open_encounters_(pairs) {}

  void add(const Encounter& next) {
    OpenEncounter& open_encounter = open_encounters_[std::size_t(next.pair)];
    const bool continues = open_encounter.index && open_encounter.last + 1 >= next.first_segment;
    open_encounter.last = next.last_segment;
    if (!continues) {
      open_encounter.index = list.size();
      list.push_back(next);
      return;
    }
    Encounter& current = list[*open_encounter.index];
    if (next.contact == current.contact) {
      const std::size_t first = current.first_segment;
      if (!current.contact && next.distance < current.distance) current = next;
      current.first_segment = first;
      current.last_segment = next.last_segment;
    } else if (next.contact) {
      current = next;
    }
  }

  std::vector<Encounter> list;

 private:
  struct OpenEncounter {
    std::optional<std::size_t> index;
    std::size_t last = 0;  // segment
  };
  std::vector<OpenEncounter> open_encounters_;  // (pairs)
};

}  // namespace

std::size_t segment_end(const CarrierMotion& motion, std::size_t segment) {
  const std::size_t next = segment + 1;
  return next < motion.segments.size() ? motion.segments[next] : motion.instants;
}

Encounters encounters(const std::vector<CarrierBody>& bodies, const std::vector<BodyPair>& pairs,
                      const CarrierMotion& motion, const EncounterOptions& options) {
  check(bodies, pairs, motion, options);
  EncounterSearch search{bodies, pairs, motion, options, std::vector<char>(pairs.size(), 1)};
  for (const BodyPair& pair : pairs)
    search.moving_parts.push_back(pair.contact_only && options.accelerated
                                      ? split_into_balls(bodies[std::size_t(pair.b)].body)
                                      : BodyBalls{});
  for (const BodyBalls& parts : search.moving_parts)
    search.rest_hulls.push_back(parts.rest ? hull_balls(*parts.rest) : std::vector<Ball>{});
  Encounters result;
  result.pairs.resize(pairs.size());
  const std::vector<Pose> T = search.poses(0, 0.0);
  tbb::parallel_for(std::size_t(0), pairs.size(), [&](std::size_t p) {
    const CarrierBody &a = search.fixed(int(p)), &b = search.moving(int(p));
    const Pose &T_a = T[std::size_t(a.carrier)], &T_b = T[std::size_t(b.carrier)];
    const bool overlap = gap(a.body, T_a, b.body, T_b).distance <= options.resolution ||
                         is_inside(a.body, T_a, b.body, T_b);
    result.pairs[p].overlaps_at_start = overlap;
    search.is_followed[p] = overlap ? 0 : 1;
  });
  result.queries = pairs.size();
  for (const CarrierBody& carried : bodies) search.hulls.push_back(hull_balls(carried.body));
  // Few samples compared with the distances of the search itself.
  const std::size_t sample_count =
      options.accelerated ? std::min<std::size_t>(256, motion.instants / 64) : 0;
  search.sampled_nearest = sampled_distances(search, sample_count);
  result.queries += sample_count * pairs.size();
  const std::vector<std::size_t> starts = chunk_starts(motion, options.chunk);
  std::vector<EncounterSearchResult> chunks(starts.size() - 1);
  std::atomic<std::size_t> next{0}, finished_count{0};
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, chunks.size(), 1),
      [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          // In the order of the motion, since the samples of a long program are made again for each
          // look at a distant chunk.
          const std::size_t c = next++;
          chunks[c] = std::move(ChunkSearch(search, starts[c], starts[c + 1]).result);
          if (options.progress) options.progress(double(++finished_count) / double(chunks.size()));
        }
      },
      tbb::simple_partitioner{});
  for (PairClearance& pair : result.pairs) pair.distance = pair.overlaps_at_start ? 0.0 : infinity;
  EncounterJoiner joiner(pairs.size());
  for (const EncounterSearchResult& chunk : chunks) {
    result.queries += chunk.queries;
    result.segments.insert(result.segments.end(), chunk.clearances.begin(), chunk.clearances.end());
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const NearestApproach& best = chunk.best[p];
      if (search.is_followed[p] != 0 && best.distance < result.pairs[p].distance)
        result.pairs[p] = {false, best.contact ? 0.0 : best.distance, best.moment};
    }
    std::vector<Encounter> chunk_encounters = chunk.encounters;
    std::ranges::stable_sort(chunk_encounters, {}, [](const Encounter& encounter) {
      return std::tuple(encounter.first_segment, encounter.pair);
    });
    for (const Encounter& encounter : chunk_encounters) joiner.add(encounter);
  }
  result.list = std::move(joiner.list);
  tbb::parallel_for(std::size_t(0), result.list.size(), [&](std::size_t i) {
    Encounter& encounter = result.list[i];
    encounter.begin = encounter.contact ? encounter.moment : near_miss_begin(search, encounter);
  });
  return result;
}

}  // namespace abbe::cutting
