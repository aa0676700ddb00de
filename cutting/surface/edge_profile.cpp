#include "cutting/surface/edge_profile.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "cutting/surface/outline.h"
#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector2d;

namespace {

/// Returns the radius, mm, of the smallest circle about the origin that contains the segments. On
/// an arc the farthest point may be where the normal points away from the origin.
double max_radius(const std::vector<OutlineSegment>& segments) {
  double result = 0.0;
  for (const OutlineSegment& segment : segments) {
    result = std::max(result, segment.to.norm());
    if (!segment.is_arc) continue;
    const Vector2d centre = segment.from - segment.radius * segment.normal_from;
    if (cross2d(segment.normal_from, centre) > 0.0 && cross2d(centre, segment.normal_to) > 0.0)
      result = std::max(result, centre.norm() + segment.radius);
  }
  return result;
}

/// Returns the profile of a closed loop of consecutive segments.
EdgeProfile closed_profile(const std::vector<OutlineSegment>& segments) {
  require(segments.size() >= 2, "edge profile: expected at least two segments, seen fewer");
  EdgeProfile profile{with_corners(segments, segments.back().normal_to)};
  double total_turn = 0.0;
  for (const OutlineSegment& segment : profile.segments)
    total_turn += std::atan2(cross2d(segment.normal_from, segment.normal_to),
                             segment.normal_from.dot(segment.normal_to));
  // One turn is 2 pi and two are 4 pi, so 3 pi separates them whatever the rounding.
  require(
      total_turn < 3.0 * std::numbers::pi,
      fmt::format("edge profile: expected a profile that closes after one turn, seen {:.0f} turns",
                  total_turn / (2.0 * std::numbers::pi)));
  profile.outer_radius = max_radius(profile.segments);
  profile.radius = -distance(profile.segments, Vector2d::Zero()).value;
  require(
      profile.radius > coincidence_tolerance,
      fmt::format("edge profile: expected the origin inside the profile, seen {:.3g} mm outside",
                  -profile.radius));
  return profile;
}

void check_range(const char* name, double value, double low, double high) {
  require(std::isfinite(value) && value >= low && value <= high,
          fmt::format("insert: expected {} from {:g} to {:g}, seen {:g}", name, low, high, value));
}

void check_insert(const Insert& insert) {
  constexpr double min_length = 1e-6, max_length = 1e4;  // mm
  check_range("a nose radius in mm", insert.radius, min_length, max_length);
  check_range("a length of the major edge in mm", insert.major_length, min_length, max_length);
  check_range("a length of the minor edge in mm", insert.minor_length, min_length, max_length);
  check_range("a wiper in mm", insert.wiper, 0.0, max_length);
  check_range("a major angle in deg", insert.major / units::deg, 0.0, 179.0);
  check_range("a minor angle in deg", insert.minor / units::deg, 0.0, 179.0);
  check_range("a sum of major and minor angle in deg", (insert.major + insert.minor) / units::deg,
              1.0, 179.0);
  const double min_wiper = insert.radius * std::tan(0.5 * insert.minor);
  require(insert.wiper == 0.0 || insert.wiper >= min_wiper,
          fmt::format("insert: expected no wiper or a wiper of at least {:.3g} mm, seen {:g}: a "
                      "minor edge of {:g} deg would cut the nose",
                      min_wiper, insert.wiper, insert.minor / units::deg));
}

/// Returns the part of a chord on the inner side of a line.
/// @param v       point of the chord's line, relative to a point of the bounding line
/// @param normal  of the bounding line, outward
Chord within_half_plane(const Chord& chord, const Vector2d& v, const Vector2d& step,
                        const Vector2d& normal) {
  const double offset = normal.dot(v), slope = normal.dot(step);
  if (slope > 0.0) return {chord.begin, std::min(chord.end, -offset / slope)};
  if (slope < 0.0) return {std::max(chord.begin, -offset / slope), chord.end};
  return offset > 0.0 ? Chord{infinity, -infinity} : chord;
}

/// Returns the chord that a line has in a circle.
/// @param v  point of the line, relative to the centre
Chord within_circle(const Vector2d& v, const Vector2d& step, double radius) {
  const double squared_step = step.squaredNorm();
  // The cross product does not cancel as b^2 - ac does.
  const double offset = cross2d(v, step) / std::sqrt(squared_step);
  const double squared_half_chord = (radius - offset) * (radius + offset);
  if (squared_half_chord < 0.0) return {infinity, -infinity};
  const double closest = -v.dot(step) / squared_step,
               half_chord = std::sqrt(squared_half_chord / squared_step);
  return {closest - half_chord, closest + half_chord};
}

/// Returns the part of a chord inside a region bounded by an arc and the tangents at its ends.
/// Inside the arc's chord the region is the wedge of the tangents, beyond it the circle.
Chord within_arc(const Chord& chord, const OutlineSegment& arc, const Vector2d& point,
                 const Vector2d& step) {
  const Vector2d from_start = point - arc.from, from_end = point - arc.to;
  const Vector2d chord_normal = line_segment(arc.from, arc.to).normal_from;
  const Chord wedge = within_half_plane(within_half_plane(chord, from_start, step, arc.normal_from),
                                        from_end, step, arc.normal_to);
  const Chord inner_chord = within_half_plane(wedge, from_start, step, chord_normal);
  const Chord circle_chord =
      within_circle(from_start + arc.radius * arc.normal_from, step, arc.radius);
  const Chord outer_chord = within_half_plane(
      {std::max(chord.begin, circle_chord.begin), std::min(chord.end, circle_chord.end)},
      from_start, step, -chord_normal);
  if (inner_chord.begin > inner_chord.end) return outer_chord;
  if (outer_chord.begin > outer_chord.end) return inner_chord;
  return {std::min(inner_chord.begin, outer_chord.begin),
          std::max(inner_chord.end, outer_chord.end)};
}

}  // namespace

EdgeProfile insert_profile(const Insert& insert) {
  check_insert(insert);
  const double r = insert.radius;
  const Vector2d major_direction(-std::cos(insert.major), std::sin(insert.major));
  const Vector2d minor_direction(std::cos(insert.minor), std::sin(insert.minor));
  const Vector2d major_begin = r * Vector2d(-major_direction.y(), major_direction.x());
  const bool has_wiper = insert.wiper > 0.0;
  const Vector2d lowest(0.0, -r);
  const Vector2d arc_end =
      has_wiper ? lowest : Vector2d(r * Vector2d(minor_direction.y(), -minor_direction.x()));
  const Vector2d minor_begin = has_wiper ? Vector2d(insert.wiper, -r) : arc_end;
  const Vector2d major_end = major_begin + insert.major_length * major_direction;
  const Vector2d minor_end = minor_begin + insert.minor_length * minor_direction;
  // The rear corner is that of the parallelogram: minor_end + s major_direction = major_end + t
  // minor_direction.
  const double sine = cross2d(minor_direction, major_direction);
  const double s = cross2d(minor_direction, major_end - minor_end) / sine;
  const Vector2d rear_corner = minor_end + s * major_direction;
  std::vector<OutlineSegment> segments{line_segment(major_end, major_begin)};
  segments.push_back(arc_segment_about(major_begin, arc_end, r, Vector2d::Zero()));
  if (has_wiper) segments.push_back(line_segment(lowest, minor_begin));
  segments.push_back(line_segment(minor_begin, minor_end));
  segments.push_back(line_segment(minor_end, rear_corner));
  segments.push_back(line_segment(rear_corner, major_end));
  EdgeProfile profile = closed_profile(segments);
  require(profile.radius > r - coincidence_tolerance,
          fmt::format("insert: expected edges long enough for the insert to contain the nose "
                      "circle, seen an insert that ends {:.3g} mm inside it",
                      r - profile.radius));
  profile.radius = r;
  return profile;
}

EdgeProfile edge_profile_from_points(const std::vector<OutlinePoint>& points) {
  require(points.size() >= 2, "edge profile: expected at least two points, seen fewer");
  std::vector<OutlineSegment> segments;
  double area = 0.0;  // mm^2, twice the area of the polygon of the points, + if counter-clockwise
  Vector2d previous = points.back().at;
  for (const OutlinePoint& point : points) {
    const bool has_radius = std::isfinite(point.radius) && point.radius >= 0.0;
    if (!has_radius || !point.at.allFinite())
      throw OutlineError(fmt::format("edge profile: expected finite numbers and radii of at least "
                                     "0, seen ({:g}, {:g}) mm, radius {:g}",
                                     point.at.x(), point.at.y(), point.radius),
                         point.at,
                         has_radius ? OutlineError::Number::First : OutlineError::Number::Radius);
    if (!((point.at - previous).norm() > coincidence_tolerance))
      throw OutlineError(
          fmt::format("edge profile: expected distinct points, seen ({:g}, {:g}) mm twice",
                      point.at.x(), point.at.y()),
          point.at);
    area += cross2d(previous, point.at);
    segments.push_back(point.radius > 0.0 ? arc_segment(previous, point.at, point.radius)
                                          : line_segment(previous, point.at));
    previous = point.at;
  }
  // Two points joined by a line and an arc enclose no polygon, so an area of 0 is permitted.
  require(area > -coincidence_tolerance * coincidence_tolerance,
          "edge profile: expected points in counter-clockwise order, from x to z, seen clockwise "
          "order");
  return closed_profile(segments);
}

EdgeProfile without_overhang(const EdgeProfile& profile, const Vector2d& away) {
  // After a rotation that makes `away` the y direction, the segments that face the part have
  // normals from -x over -y to x.
  const Eigen::Matrix2d rotation =
      (Eigen::Matrix2d() << away.y(), -away.x(), away.x(), away.y()).finished();
  std::vector<OutlineSegment> segments = profile.segments;
  const auto faces_part = [](const Vector2d& normal) { return normal.y() <= 0.0; };
  double top = -infinity;
  for (OutlineSegment& segment : segments) {
    for (Vector2d* v : {&segment.from, &segment.to, &segment.normal_from, &segment.normal_to})
      *v = rotation * *v;
    top = std::max({top, segment.from.y(), segment.to.y()});
  }
  const auto first_facing = std::ranges::find_if(segments, [&](const OutlineSegment& segment) {
    return !faces_part(segment.normal_from) && faces_part(segment.normal_to);
  });
  if (first_facing == segments.end()) return profile;
  std::ranges::rotate(segments, first_facing);

  std::vector<OutlinePoint> points;
  const auto append = [&](const Vector2d& at, double radius = 0.0) {
    if (points.empty() || (points.back().at - at).norm() > coincidence_tolerance)
      points.push_back({at, radius});
  };
  for (OutlineSegment segment : segments) {
    const Vector2d centre = segment.from - segment.radius * segment.normal_from;
    if (!faces_part(segment.normal_from) && !faces_part(segment.normal_to)) continue;
    // An arc that overhangs is cut where its tangent is along `away`.
    if (!faces_part(segment.normal_from))
      segment.from = centre - segment.radius * Vector2d::UnitX();
    if (!faces_part(segment.normal_to)) segment.to = centre + segment.radius * Vector2d::UnitX();
    append(segment.from);
    append(segment.to, segment.radius);
  }
  const double left = points.front().at.x(), right = points.back().at.x();
  append({right, top});
  append({left, top});
  if ((points.back().at - points.front().at).norm() <= coincidence_tolerance) points.pop_back();
  for (OutlinePoint& point : points) point.at = rotation.transpose() * point.at;
  return edge_profile_from_points(points);
}

double edge_height(const EdgeProfile& profile, const Vector2d& away, const Vector2d& side) {
  const double max_overhang = std::sin(15.0 * units::deg);
  const double lowest = extreme_point(profile, -away).dot(away);
  double highest = lowest;
  for (const OutlineSegment& segment : profile.segments) {
    const bool is_edge =
        std::max(segment.normal_from.dot(away), segment.normal_to.dot(away)) <= max_overhang &&
        (segment.normal_from + segment.normal_to).dot(side) > 0.0;
    if (is_edge) highest = std::max({highest, segment.from.dot(away), segment.to.dot(away)});
  }
  return highest - lowest;
}

std::optional<Chord> chord(const EdgeProfile& profile, const Vector2d& point,
                           const Vector2d& step) {
  Chord inside{-infinity, infinity};
  for (const OutlineSegment& segment : profile.segments) {
    if (!segment.is_arc)
      inside = within_half_plane(inside, point - segment.from, step, segment.normal_from);
    else if (segment.radius > 0.0)
      inside = within_arc(inside, segment, point, step);
    if (inside.begin > inside.end) return std::nullopt;
  }
  return inside;
}

Vector2d extreme_point(const EdgeProfile& profile, const Vector2d& direction) {
  return extreme_point(profile.segments, direction);
}

double max_separation(const EdgeProfile& a, const EdgeProfile& b) {
  // 0.1 deg apart: between two directions the reach changes by less than the stated 1e-3.
  constexpr int directions = 3600;
  double max_difference = 0.0;
  for (int i = 0; i < directions; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / directions;
    const Vector2d direction(std::cos(angle), std::sin(angle));
    max_difference = std::max(max_difference, std::abs(direction.dot(extreme_point(a, direction)) -
                                                       direction.dot(extreme_point(b, direction))));
  }
  return max_difference;
}

EdgePoint edge_point(const EdgeProfile& profile, double psi) {
  const Vector2d direction(std::cos(psi), std::sin(psi));
  const Vector2d point = chord(profile, Vector2d::Zero(), direction)->end * direction;
  return {point, distance(profile.segments, point).gradient};
}

}  // namespace abbe::cutting
