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

/// Returns the lowest point of balls along a direction in their frame.
Vector3d lowest_point(std::span<const Ball> balls, const Vector3d& direction) {
  Vector3d lowest = Vector3d::Zero();
  double min_height = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls) {
    const double height = direction.dot(ball.centre) - ball.radius;
    if (height >= min_height) continue;
    min_height = height;
    lowest = ball.centre - ball.radius * direction;
  }
  return lowest;
}

}  // namespace

PartingPlane parting_plane(const Body& a, std::span<const Ball> hull_b, const Pose& T_ab,
                           const Vector3d& a_to_b) {
  // Six steps usually reach 0.995 of the distance; any plane is a valid bound.
  constexpr int max_steps = 6;
  constexpr double required_ratio = 0.995;
  PartingPlane best;
  if (hull_b.empty() || !(a_to_b.norm() > 0.0)) return best;
  double max_distance = -std::numeric_limits<double>::infinity();
  Vector3d connection = a_to_b;
  for (int step = 0; step < max_steps && connection.norm() > 0.0; ++step) {
    const Vector3d normal = connection.normalized();
    const Vector3d on_a = support_vertex(a, normal);
    const Vector3d on_b = T_ab * lowest_point(hull_b, T_ab.linear().transpose() * normal);
    const double distance = normal.dot(on_b - on_a);
    if (distance > max_distance) best = {normal, normal.dot(on_a)};
    max_distance = std::max(max_distance, distance);
    if (distance >= required_ratio * connection.norm()) break;
    const Vector3d change = connection - (on_b - on_a);
    if (!(change.squaredNorm() > 0.0)) break;
    connection -= std::clamp(connection.dot(change) / change.squaredNorm(), 0.0, 1.0) * change;
  }
  return best;
}

double plane_distance(const PartingPlane& plane, std::span<const Ball> hull_b, const Pose& T_ab) {
  if (hull_b.empty() || plane.normal.isZero(0.0)) return 0.0;
  const Vector3d normal = T_ab.linear().transpose() * plane.normal;
  return normal.dot(lowest_point(hull_b, normal)) + plane.normal.dot(T_ab.translation()) -
         plane.height;
}

namespace {

// Every translation that is returned was tested to separate the bodies, or has a plane that
// separates them. Therefore the limits of steps, pairs and planes below only affect its length and
// the time.

/// The translations q of b with normal . q >= offset.
struct HalfSpace {
  Vector3d normal;  // unit
  double offset;    // mm
};

/// Returns the shortest translation that lies on up to three planes.
std::optional<Vector3d> shortest_on_planes(std::span<const HalfSpace> planes) {
  Eigen::Matrix3d gram = Eigen::Matrix3d::Identity();
  Vector3d offsets = Vector3d::Zero();
  for (std::size_t i = 0; i < planes.size(); ++i) {
    offsets[Eigen::Index(i)] = planes[i].offset;
    for (std::size_t j = 0; j < planes.size(); ++j)
      gram(Eigen::Index(i), Eigen::Index(j)) = planes[i].normal.dot(planes[j].normal);
  }
  // Planes count as parallel below this determinant of the Gram matrix.
  constexpr double min_determinant = 1e-12;
  if (gram.determinant() < min_determinant) return {};
  const Vector3d weights = gram.inverse() * offsets;
  Vector3d q = Vector3d::Zero();
  for (std::size_t i = 0; i < planes.size(); ++i) q += weights[Eigen::Index(i)] * planes[i].normal;
  return q;
}

/// Returns the shortest translation inside all half-spaces that lies on the given boundaries. If
/// the solution violates a half-space, the new solution lies on that half-space's boundary.
std::optional<Vector3d> shortest_in_half_spaces(std::span<const HalfSpace> half_spaces,
                                                const std::vector<HalfSpace>& boundaries = {}) {
  constexpr double rounding = 1e-9;  // mm
  std::optional<Vector3d> q = shortest_on_planes(boundaries);
  for (std::size_t i = 0; q && i < half_spaces.size(); ++i) {
    if (half_spaces[i].normal.dot(*q) >= half_spaces[i].offset - rounding) continue;
    if (boundaries.size() == 3) return {};
    std::vector<HalfSpace> extended = boundaries;
    extended.push_back(half_spaces[i]);
    q = shortest_in_half_spaces(half_spaces.first(i), extended);
  }
  return q;
}

/// Two bodies at their poses, in the frame of a.
struct Overlap {
  const Body& a;
  const Body& b;
  Pose T_ab;
  double separation;  // mm, distance at which the bodies count as apart

  Pose translated_pose(const Vector3d& q) const {
    Pose T = T_ab;
    T.pretranslate(q);
    return T;
  }
  /// Returns the pairs of triangles that are too near after the translation q of b, in their
  /// positions before it.
  std::vector<TrianglePair> close_pairs(const Vector3d& q, std::size_t max_pairs,
                                        double fraction = 0.98) const {
    std::vector<TrianglePair> pairs =
        near_pairs(a, b, translated_pose(q), fraction * separation, max_pairs);
    for (TrianglePair& pair : pairs)
      for (Vector3d& corner : pair.of_b) corner -= q;
    return pairs;
  }
  bool is_inside(const Vector3d& q) const { return is_inside_disjoint(a, b, translated_pose(q)); }
  bool is_separated(const Vector3d& q) const { return close_pairs(q, 1).empty() && !is_inside(q); }
};

Vector3d triangle_normal(const std::array<Vector3d, 3>& triangle) {
  const Vector3d cross_product = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
  const double area = cross_product.norm();
  return area > 0.0 ? Vector3d(cross_product / area) : Vector3d::Zero();
}

/// Returns the width of the gap, mm, between planes normal to a direction that bound a and b;
/// negative if no such plane separates them.
double plane_gap(const TrianglePair& pair, const Vector3d& direction) {
  double max_of_a = -std::numeric_limits<double>::infinity(), min_of_b = -max_of_a;
  for (std::size_t k = 0; k < 3; ++k) {
    max_of_a = std::max(max_of_a, direction.dot(pair.of_a[k]));
    min_of_b = std::min(min_of_b, direction.dot(pair.of_b[k]));
  }
  return min_of_b - max_of_a - pair.skins;
}

/// Returns the displacement, mm, from q along a direction beyond which a pair remains apart. The
/// distance is convex along the direction, so Newton steps back from the position where a plane
/// separates the pair do not pass the solution.
double clearing_distance(const TrianglePair& pair, const Vector3d& q, const Vector3d& direction,
                         double separation) {
  double distance = separation - plane_gap(pair, direction) - direction.dot(q);
  constexpr int max_steps = 12;
  for (int step = 0; step < max_steps && distance > 0.0; ++step) {
    const Gap current_gap = gap(pair, q + distance * direction);
    const double rate = direction.dot((current_gap.on_b - current_gap.on_a).normalized());
    const double reduction = (current_gap.distance - separation) / rate;
    // mm, far below any useful resolution.
    constexpr double min_reduction = 1e-7;
    if (!(rate > 0.0) || reduction < min_reduction) break;
    distance -= reduction;
  }
  return std::max(distance, 0.0);
}

/// Returns the displacement along a direction after which the bodies are apart, by bisection
/// between a distance with contact and one without.
double bisected_separation(const Overlap& overlap, const Vector3d& start, const Vector3d& direction,
                           double contact_distance, double free_distance) {
  while (free_distance - contact_distance > overlap.separation) {
    const double middle_distance = 0.5 * (contact_distance + free_distance);
    (overlap.is_separated(start + middle_distance * direction) ? free_distance : contact_distance) =
        middle_distance;
  }
  return free_distance;
}

/// Returns the first translation from a start along a direction, within a limit, after which the
/// bodies are apart. Each step clears the obstructing pairs; after a few exact steps the step is at
/// least a fraction of the limit, so that many small pairs do not need as many steps.
std::optional<Vector3d> first_separation(const Overlap& overlap, const Vector3d& start,
                                         const Vector3d& direction, double limit, int max_parts) {
  constexpr int exact_steps = 4;
  constexpr std::size_t max_pairs = 8;
  double distance = 0.0, contact_distance = 0.0, clear_distance = 0.0;
  for (int step = 0; distance < limit; ++step) {
    const Vector3d q = start + distance * direction;
    const std::vector<TrianglePair> pairs = overlap.close_pairs(q, max_pairs);
    if (pairs.empty() && !overlap.is_inside(q))
      return distance > clear_distance ? start + bisected_separation(overlap, start, direction,
                                                                     contact_distance, distance) *
                                                     direction
                                       : q;
    double step_length = 0.1 * overlap.separation;
    for (const TrianglePair& pair : pairs)
      step_length =
          std::max(step_length, clearing_distance(pair, q, direction, overlap.separation));
    if (pairs.empty()) {
      const GapOptions gap_options{0.1, limit - distance};
      step_length = std::max(step_length, gap(overlap.a, Pose::Identity(), overlap.b,
                                              overlap.translated_pose(q), gap_options)
                                                  .distance /
                                              1.1);
    }
    contact_distance = distance;
    clear_distance = distance + step_length;
    distance = step < exact_steps ? clear_distance
                                  : std::max(clear_distance, distance + limit / max_parts);
  }
  return {};
}

/// Half-spaces of translations; in each of them a pair is certainly apart: beyond a plane normal to
/// the connection of the nearest points, or beyond the face of one of the triangles.
using HalfSpaceAlternatives = std::array<HalfSpace, 3>;

HalfSpaceAlternatives half_space_alternatives(const TrianglePair& pair, const Vector3d& q,
                                              double separation) {
  const Gap current_gap = gap(pair, q);
  const Vector3d connection = (current_gap.on_b - current_gap.on_a).normalized();
  const HalfSpace connection_plane{
      connection, std::min(separation - plane_gap(pair, connection), connection.dot(q))};
  HalfSpaceAlternatives alternatives{connection_plane, connection_plane, connection_plane};
  const std::array<Vector3d, 2> normals{triangle_normal(pair.of_a), -triangle_normal(pair.of_b)};
  for (std::size_t k = 0; k < 2; ++k) {
    const double offset = separation - plane_gap(pair, normals[k]);
    if (!normals[k].isZero() && normals[k].dot(q) >= offset)
      alternatives[k + 1] = {normals[k], offset};
  }
  return alternatives;
}

/// Returns the distance of a translation from a half-space, mm; negative inside.
double violation(const HalfSpace& half_space, const Vector3d& q) {
  return half_space.offset - half_space.normal.dot(q);
}

/// Returns the half-space that a translation violates least.
const HalfSpace& nearest_half_space(const HalfSpaceAlternatives& alternatives, const Vector3d& q) {
  return *std::ranges::min_element(
      alternatives, {}, [&](const HalfSpace& half_space) { return violation(half_space, q); });
}

/// Search that shortens a translation by sliding along the obstructing faces until no nearby
/// translation is shorter.
class SlidingSearch {
 public:
  SlidingSearch(const Overlap& overlap, const Vector3d& start) : q(start), overlap_(overlap) {
    constexpr int max_steps = 20;
    for (int step = 0; step < max_steps; ++step) {
      const std::optional<Vector3d> candidate = shorter_translation();
      if (!candidate) break;
      if (candidate->norm() < q.norm()) q = *candidate;
    }
  }

  Vector3d q;

 private:
  static constexpr std::size_t max_pairs = 96;

  /// Returns the shortest translation that keeps every obstructing pair in one of its half-spaces.
  /// Adds the pairs that obstruct the solution and repeats.
  std::optional<Vector3d> shorter_translation() {
    constexpr int max_rounds = 16;
    add(overlap_.close_pairs(q, max_pairs, 3.0));
    std::vector<HalfSpaceAlternatives> alternatives;
    std::vector<HalfSpace> half_spaces;
    Vector3d candidate = Vector3d::Zero();
    for (int round = 0; round < max_rounds; ++round) {
      for (std::size_t i = alternatives.size(); i < pairs_.size(); ++i)
        alternatives.push_back(half_space_alternatives(pairs_[i], q, overlap_.separation));
      const std::optional<Vector3d> solution =
          shortest_in_alternatives(alternatives, half_spaces, candidate);
      if (!solution) return {};
      candidate = *solution;
      const std::vector<TrianglePair> close_pairs = overlap_.close_pairs(candidate, max_pairs);
      if (close_pairs.empty() && !overlap_.is_inside(candidate)) return candidate;
      if (close_pairs.empty()) break;
      add(close_pairs);
    }
    const Vector3d displacement = q - candidate;
    return first_separation(overlap_, candidate, displacement.normalized(), displacement.norm(),
                            16);
  }

  /// Repeatedly adds the half-space of the most violated pair, which often clears other pairs too.
  /// Returns nothing if no shorter translation results.
  std::optional<Vector3d> shortest_in_alternatives(
      const std::vector<HalfSpaceAlternatives>& alternatives, std::vector<HalfSpace>& half_spaces,
      Vector3d candidate) const {
    constexpr double rounding = 1e-8;  // mm
    constexpr std::size_t max_half_spaces = 256;
    while (half_spaces.size() < max_half_spaces) {
      HalfSpace most_violated{Vector3d::Zero(), rounding};
      for (const HalfSpaceAlternatives& pair_alternatives : alternatives)
        if (const HalfSpace& half_space = nearest_half_space(pair_alternatives, candidate);
            violation(half_space, candidate) > violation(most_violated, candidate))
          most_violated = half_space;
      if (most_violated.normal.isZero()) return candidate;
      half_spaces.push_back(most_violated);
      const std::optional<Vector3d> solution = shortest_in_half_spaces(half_spaces);
      if (!solution || !(solution->norm() < q.norm() - 0.01 * overlap_.separation)) return {};
      candidate = *solution;
    }
    return {};
  }

  void add(const std::vector<TrianglePair>& pairs) {
    pairs_.insert(pairs_.end(), pairs.begin(), pairs.end());
  }

  const Overlap& overlap_;
  std::vector<TrianglePair> pairs_;
};

/// A cluster of normals with its mean direction.
struct DirectionCluster {
  Vector3d sum = Vector3d::Zero();
  int count = 0;
  Vector3d direction() const { return sum.normalized(); }
};

/// Returns clusters of directions, the largest first.
std::vector<DirectionCluster> clustered_directions(const std::vector<Vector3d>& directions) {
  constexpr double min_cosine = 0.996;  // cosine of 5 degrees
  std::vector<DirectionCluster> clusters;
  for (const Vector3d& normal : directions) {
    if (normal.isZero()) continue;
    auto cluster = std::ranges::find_if(clusters, [&](const DirectionCluster& candidate) {
      return normal.dot(candidate.direction()) > min_cosine;
    });
    if (cluster == clusters.end()) cluster = clusters.insert(clusters.end(), DirectionCluster{});
    cluster->sum += normal;
    ++cluster->count;
  }
  std::ranges::stable_sort(clusters, std::greater<>{}, &DirectionCluster::count);
  return clusters;
}

std::vector<Vector3d> face_normals(const std::vector<TrianglePair>& pairs, bool of_a) {
  std::vector<Vector3d> normals;
  for (const TrianglePair& pair : pairs)
    normals.push_back(of_a ? triangle_normal(pair.of_a) : Vector3d(-triangle_normal(pair.of_b)));
  return normals;
}

/// Returns the half-spaces of the faces of one body in close pairs: in each the other triangle lies
/// completely on the outer side of the face.
std::vector<HalfSpace> face_half_spaces(const std::vector<TrianglePair>& pairs, bool of_a,
                                        double separation) {
  const std::vector<Vector3d> normals = face_normals(pairs, of_a);
  std::vector<HalfSpace> half_spaces;
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (!normals[i].isZero())
      half_spaces.push_back({normals[i], separation - plane_gap(pairs[i], normals[i])});
  return half_spaces;
}

/// Returns a translation out of all obstructing faces of one body at once: only a combination of
/// the walls' normals leads out of a corner or a narrow slot. Satisfies the smallest violations
/// first: a shank in the wall of a pocket also meets the rim, but need not be lifted over it.
std::optional<Vector3d> translation_out_of_faces(const Overlap& overlap, bool of_a, double limit) {
  constexpr int max_steps = 24;
  constexpr std::size_t max_pairs = 128, max_walls = 24;
  constexpr double min_cosine = 0.9999, tolerance_factor = 1.5;
  std::vector<HalfSpace> walls;
  Vector3d q = Vector3d::Zero();
  for (int step = 0; step < max_steps && walls.size() < max_walls; ++step) {
    const std::vector<TrianglePair> pairs = overlap.close_pairs(q, max_pairs);
    if (pairs.empty()) return overlap.is_inside(q) ? std::nullopt : std::optional(q);
    std::vector<HalfSpace> half_spaces = face_half_spaces(pairs, of_a, overlap.separation);
    double min_violation = limit;
    for (const HalfSpace& half_space : half_spaces)
      if (violation(half_space, q) > 0.0)
        min_violation = std::min(min_violation, violation(half_space, q));
    for (const HalfSpace& half_space : half_spaces) {
      if (violation(half_space, q) > tolerance_factor * std::max(min_violation, overlap.separation))
        continue;
      auto wall = std::ranges::find_if(walls, [&](const HalfSpace& candidate) {
        return candidate.normal.dot(half_space.normal) > min_cosine;
      });
      if (wall == walls.end()) wall = walls.insert(wall, half_space);
      wall->offset = std::max(wall->offset, half_space.offset);
    }
    const std::optional<Vector3d> next = shortest_in_half_spaces(walls);
    if (!next || next->norm() >= limit || *next == q) return {};
    q = *next;
  }
  return {};
}

/// Returns the shortest translation along one of the axes after which a plane separates the bodies.
Vector3d separating_axis(const Overlap& overlap, const std::vector<Vector3d>& axes) {
  Vector3d shortest = Vector3d::Constant(std::numeric_limits<double>::infinity());
  for (const Vector3d& axis : axes) {
    const Vector3d opposite = -(overlap.T_ab.linear().transpose() * axis);
    const double distance = extent(overlap.a, axis) + extent(overlap.b, opposite) -
                            overlap.T_ab.translation().dot(axis) + overlap.separation;
    if (distance < shortest.norm()) shortest = distance * axis;
  }
  return shortest;
}

std::vector<Vector3d> frame_axes(const Overlap& overlap) {
  std::vector<Vector3d> axes;
  for (int k = 0; k < 3; ++k)
    for (const double sign : {1.0, -1.0}) {
      axes.push_back(sign * Vector3d::Unit(k));
      axes.push_back(sign * overlap.T_ab.linear().col(k));
    }
  return axes;
}

/// Returns directions evenly distributed over the sphere, on a Fibonacci spiral.
std::vector<Vector3d> sphere_directions(int count) {
  const double golden = std::numbers::pi * (3.0 - std::sqrt(5.0));
  std::vector<Vector3d> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count, r = std::sqrt(1.0 - z * z);
    directions.emplace_back(r * std::cos(golden * i), r * std::sin(golden * i), z);
  }
  return directions;
}

/// Returns candidate directions: first those of the faces, then the axes.
std::vector<Vector3d> candidate_directions(const Overlap& overlap,
                                           const std::vector<Vector3d>& axes) {
  constexpr std::size_t max_pairs = 256, max_clusters = 8;
  const std::vector<TrianglePair> pairs = overlap.close_pairs(Vector3d::Zero(), max_pairs);
  std::vector<Vector3d> directions;
  for (const bool of_a : {true, false}) {
    const std::vector<Vector3d> normals = face_normals(pairs, of_a);
    Vector3d mean = Vector3d::Zero();
    for (const Vector3d& normal : normals) mean += normal;
    directions.push_back(mean.normalized());
    const std::vector<DirectionCluster> clusters = clustered_directions(normals);
    for (std::size_t i = 0; i < std::min(clusters.size(), max_clusters); ++i)
      directions.push_back(clusters[i].direction());
  }
  if (pairs.empty()) {
    const Gap nearest = gap(overlap.a, Pose::Identity(), overlap.b, overlap.T_ab);
    const Vector3d connection = (nearest.on_b - nearest.on_a).normalized();
    directions.insert(directions.end(), {connection, -connection});
  }
  directions.insert(directions.end(), axes.begin(), axes.end());
  return directions;
}

/// Returns the directions without zeros and near duplicates.
std::vector<Vector3d> distinct_directions(const std::vector<Vector3d>& directions) {
  // Tight, because only a direction exactly along its walls leads out of a narrow slot.
  constexpr double min_cosine = 0.999999;
  std::vector<Vector3d> result;
  for (const Vector3d& direction : directions)
    if (!direction.isZero() && std::ranges::none_of(result, [&](const Vector3d& previous) {
          return direction.dot(previous) > min_cosine;
        }))
      result.push_back(direction);
  return result;
}

Vector3d shortest_translation(const Overlap& overlap) {
  if (overlap.is_separated(Vector3d::Zero())) return Vector3d::Zero();
  const std::vector<Vector3d> axes = frame_axes(overlap);
  Vector3d best = SlidingSearch(overlap, separating_axis(overlap, axes)).q;
  const auto improve = [&](const std::optional<Vector3d>& start) {
    if (!start) return;
    const Vector3d q = SlidingSearch(overlap, *start).q;
    if (q.norm() < best.norm()) best = q;
  };
  for (const bool of_a : {true, false})
    improve(translation_out_of_faces(overlap, of_a, best.norm()));
  const auto search_direction = [&](const Vector3d& direction, int max_parts) {
    // A longer translation may slide to a shorter one, but hardly if its direction is near the
    // best.
    constexpr double max_length_factor = 1.2, beside_cosine = 0.7;
    const bool is_beside = direction.dot(best) > beside_cosine * best.norm();
    const double limit = (is_beside ? 1.0 : max_length_factor) * best.norm();
    improve(first_separation(overlap, Vector3d::Zero(), direction, limit, max_parts));
  };
  for (const Vector3d& candidate : distinct_directions(candidate_directions(overlap, axes)))
    search_direction(candidate, 16);
  for (const Vector3d& candidate : sphere_directions(24)) search_direction(candidate, 8);
  return best;
}

}  // namespace

Penetration penetration(const Body& a, const Pose& T_a, const Body& b, const Pose& T_b,
                        double resolution) {
  require(resolution > 0.0, "penetration: the resolution must be positive");
  const Overlap overlap{a, b, T_a.inverse() * T_b, 0.5 * resolution};
  const Vector3d translation = shortest_translation(overlap);
  Penetration result;
  result.depth = translation.norm();
  if (result.depth > 0.0) result.direction = T_a.linear() * translation / result.depth;
  return result;
}

}  // namespace abbe::cutting
