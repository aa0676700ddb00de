#include "cutting/surface/outline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Vector2d;

namespace {

constexpr double normal_tolerance = 1e-7;  // rad; rounding of the input may turn a normal back

}  // namespace

ToolOutline closed_outline(const std::vector<OutlineSegment>& segments) {
  ToolOutline outline{with_corners(segments, {0, -1})};
  for (const OutlineSegment& segment : outline.segments) {
    if (!(segment.normal_from.x() >= -normal_tolerance &&
          segment.normal_to.x() >= -normal_tolerance))
      throw OutlineError(fmt::format("outline: expected an outline that rises to its top, seen one "
                                     "that turns back at ({:g}, {:g}) mm",
                                     segment.to.x(), segment.to.y()),
                         segment.to, OutlineError::Number::Second);
    outline.radius = std::max({outline.radius, segment.from.x(), segment.to.x()});
    // An arc may have its largest radius between its ends.
    if (cross2d(segment.normal_from, Vector2d::UnitX()) > 0.0 &&
        cross2d(Vector2d::UnitX(), segment.normal_to) > 0.0)
      outline.radius = std::max(
          outline.radius, segment.from.x() + segment.radius * (1.0 - segment.normal_from.x()));
    outline.height = std::max(outline.height, segment.to.y());
  }
  for (const OutlineSegment& segment : outline.segments)
    outline.is_sharp |= segment.is_arc && segment.radius == 0.0 &&
                        segment.from.y() < outline.height - coincidence_tolerance;
  return outline;
}

ToolOutline outline_from_points(const std::vector<OutlinePoint>& points) {
  return closed_outline(segments_from_points(points));
}

AptCutter with_tangent_corner(AptCutter cutter) {
  // Outward normals of bottom and flank: the centre lies the corner radius inside both lines.
  const Vector2d bottom_normal(std::sin(cutter.bottom), -std::cos(cutter.bottom));
  const Vector2d flank_normal(std::cos(cutter.flank), -std::sin(cutter.flank));
  const Vector2d intersection(0.5 * cutter.diameter,
                              0.5 * cutter.diameter * std::tan(cutter.bottom));
  Eigen::Matrix2d normals;
  normals << bottom_normal.transpose(), flank_normal.transpose();
  const Vector2d centre = intersection - cutter.corner * normals.inverse() * Vector2d::Ones();
  cutter.radial = centre.x();
  cutter.axial = centre.y();
  return cutter;
}

AptCutter with_ball_corner(AptCutter cutter) {
  const double centre_height = cutter.corner / std::cos(cutter.bottom);
  cutter.diameter = 2.0 * (cutter.corner - centre_height * std::sin(cutter.flank)) /
                    (std::cos(cutter.flank) - std::sin(cutter.flank) * std::tan(cutter.bottom));
  cutter.radial = 0.0;
  cutter.axial = centre_height;
  return cutter;
}

ToolOutline apt_outline(const AptCutter& cutter) {
  const auto& [diameter, corner, radial, axial, bottom, flank, height] = cutter;
  // Bottom and flank intersect only if their angles add up to less than a right angle.
  constexpr double right_angle = 0.5 * pi;
  require(diameter > 0.0 && corner >= 0.0 && height > 0.0 && bottom >= 0.0 &&
              bottom < right_angle && std::abs(flank) < right_angle &&
              bottom + std::max(flank, 0.0) < right_angle,
          fmt::format("APT cutter: expected a diameter and a height above 0, a corner radius of at "
                      "least 0, a bottom angle of at least 0, a flank angle within 90 deg and "
                      "their sum below 90 deg, seen {:g}, {:g} and {:g} mm, {:g} and {:g} deg",
                      diameter, height, corner, bottom / units::deg, flank / units::deg));
  const Vector2d bottom_direction(std::cos(bottom), std::sin(bottom)),
      flank_direction(std::sin(flank), std::cos(flank));
  const Vector2d intersection = 0.5 * diameter / bottom_direction.x() * bottom_direction;
  const auto at_height = [&](double y) -> Vector2d {
    return intersection + (y - intersection.y()) / flank_direction.y() * flank_direction;
  };
  require(
      at_height(height).x() > 0.0 && height > intersection.y(),
      fmt::format("APT cutter: expected a flank that ends above its lower end and off the axis, "
                  "seen a flank from {:g} to {:g} mm above the tip, at a radius of {:g} mm",
                  intersection.y(), height, at_height(height).x()));
  if (corner == 0.0) return outline_from_points({{{0, 0}}, {intersection}, {at_height(height)}});
  const Vector2d centre(radial, axial);
  // Returns the foot of the corner's centre on a line through `point`, and half of the chord that
  // the line cuts out of the corner's circle. 1e-6 mm permits parameters rounded for a tangent
  // corner.
  const auto foot_of_centre = [&](const Vector2d& point, const Vector2d& direction,
                                  const char* name) {
    const double offset = std::abs(cross2d(direction, centre - point));
    require(offset <= corner + 1e-6,
            fmt::format("APT cutter: expected a {} that meets the corner radius of {:g} mm, seen "
                        "one {:g} mm from the corner's centre",
                        name, corner, offset));
    const double half_chord = std::sqrt(std::max(0.0, corner * corner - offset * offset));
    return std::pair(Vector2d(point + direction.dot(centre - point) * direction), half_chord);
  };
  const auto [bottom_foot, bottom_half_chord] = foot_of_centre({0, 0}, bottom_direction, "bottom");
  const auto [flank_foot, flank_half_chord] =
      foot_of_centre(intersection, flank_direction, "flank");
  const Vector2d arc_start = bottom_foot + bottom_half_chord * bottom_direction,
                 arc_end = flank_foot - flank_half_chord * flank_direction;
  require(arc_start.x() > -coincidence_tolerance && arc_end.y() < height,
          fmt::format("APT cutter: expected a corner between the axis and the top, {:g} mm above "
                      "the tip, seen a corner from a radius of {:g} mm to {:g} mm above the tip",
                      height, arc_start.x(), arc_end.y()));
  std::vector<OutlineSegment> segments;
  if (arc_start.norm() > coincidence_tolerance) segments.push_back(line_segment({0, 0}, arc_start));
  segments.push_back(arc_segment_about(arc_start, arc_end, corner, centre));
  segments.push_back(line_segment(arc_end, at_height(height)));
  segments.push_back(line_segment(at_height(height), {0, height}));
  return closed_outline(segments);
}

// Positions on an arc are computed relative to its first point, so that large radii cost no digits.

double support(const ToolOutline& outline, double rise, double across) {
  const Vector2d direction(across, rise);
  double reach = rise * bottom(outline);
  for (const OutlineSegment& segment : outline.segments) {
    reach = std::max(reach, direction.dot(segment.to));
    const double sine = cross2d(segment.normal_from, direction);
    if (segment.is_arc && sine > 0.0 && cross2d(direction, segment.normal_to) > 0.0)
      reach = std::max(reach, direction.dot(segment.from) +
                                  segment.radius * sine * sine /
                                      (direction.norm() + segment.normal_from.dot(direction)));
  }
  return reach;
}

// The extreme point is a corner, or the point of an arc whose normal is the direction.
Vector2d extreme_point(const std::vector<OutlineSegment>& segments, const Vector2d& direction) {
  Vector2d extreme = segments.front().from;
  const auto update = [&](const Vector2d& point) {
    if (direction.dot(point) > direction.dot(extreme)) extreme = point;
  };
  for (const OutlineSegment& segment : segments) {
    update(segment.to);
    if (segment.is_arc && cross2d(segment.normal_from, direction) > 0.0 &&
        cross2d(direction, segment.normal_to) > 0.0)
      update(segment.from + segment.radius * (direction.normalized() - segment.normal_from));
  }
  return extreme;
}

Vector2d support_point(const ToolOutline& outline, double rise, double across) {
  return extreme_point(outline.segments, {across, rise});
}

double top_radius(const ToolOutline& outline) { return outline.segments.back().from.x(); }

double corner_height(const ToolOutline& outline) {
  for (const OutlineSegment& segment : outline.segments) {
    const double centre_height = segment.from.y() - segment.radius * segment.normal_from.y();
    if (segment.radius > 0.0 && centre_height >= 0.0 && centre_height <= outline.height)
      return centre_height;
  }
  return 0.0;
}

// Clips the bounding rectangle to the half planes inside all lines and tangents, after a shift
// inwards by the margin.
InsetOutline inset_convex(const ToolOutline& outline, double margin) {
  require(!is_hollow(outline), "outline: expected a convex outline to inset, seen a hollow one");
  std::vector<Vector2d> corners{
      {0.0, 0.0}, {outline.radius, 0.0}, {outline.radius, outline.height}, {0.0, outline.height}};
  const auto clip_to_half_plane = [&](const Vector2d& normal, const Vector2d& tangent_point) {
    const double limit = normal.dot(tangent_point) - margin;
    std::vector<Vector2d> clipped;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Vector2d &a = corners[i], &b = corners[(i + 1) % corners.size()];
      const double excess_a = normal.dot(a) - limit, excess_b = normal.dot(b) - limit;
      if (excess_a <= 0.0) clipped.push_back(a);
      if ((excess_a < 0.0 && excess_b > 0.0) || (excess_a > 0.0 && excess_b < 0.0))
        clipped.push_back(a + excess_a / (excess_a - excess_b) * (b - a));
    }
    corners = std::move(clipped);
  };
  for (const OutlineSegment& segment : outline.segments) {
    if (!segment.is_arc) clip_to_half_plane(segment.normal_from, segment.from);
    if (segment.radius == 0.0) continue;
    const double arc_angle = std::atan2(cross2d(segment.normal_from, segment.normal_to),
                                        segment.normal_from.dot(segment.normal_to));
    // 3 deg between tangents: the corners of the polygon would stand out by 0.034 % of the radius,
    // so the tangents are moved inwards by that
    const int tangent_count = 1 + int(std::ceil(arc_angle / (3.0 * units::deg)));
    const double chord_sag =
        segment.radius * (1.0 - std::cos(0.5 * arc_angle / (tangent_count - 1)));
    for (int i = 0; i < tangent_count; ++i) {
      const Vector2d normal =
          Eigen::Rotation2Dd(i * arc_angle / (tangent_count - 1)) * segment.normal_from;
      clip_to_half_plane(normal, segment.from + segment.radius * (normal - segment.normal_from) -
                                     chord_sag * normal);
    }
  }
  const auto on_axis = [](const Vector2d& corner) { return corner.x() <= 0.0; };
  const auto lowest =
      std::ranges::min_element(corners, {}, [](const Vector2d& corner) { return corner.y(); });
  require(std::ranges::count_if(corners, on_axis) >= 2,
          fmt::format("outline: expected an outline more than {:g} mm wide on both sides", margin));
  InsetOutline inner;
  inner.raised = lowest->y();
  std::ranges::rotate(corners, std::ranges::find_if(corners, [&](const Vector2d& corner) {
                        return on_axis(corner) &&
                               corner.y() <= inner.raised + coincidence_tolerance;
                      }));
  std::vector<OutlinePoint> points;
  for (const Vector2d& corner : corners)
    if (points.empty() || !on_axis(corner))
      points.push_back({corner - Vector2d(0.0, inner.raised)});
  points.front().at.y() = 0.0;
  inner.outline = outline_from_points(points);
  return inner;
}

double max_separation(const ToolOutline& a, const ToolOutline& b) {
  double max_difference = 0.0;
  // Steps of 1 deg, as stated in the header.
  for (int degree = -90; degree <= 90; ++degree) {
    const double angle = degree * units::deg;
    const double rise = std::sin(angle), across = std::max(0.0, std::cos(angle));
    max_difference =
        std::max(max_difference, std::abs(support(a, rise, across) - support(b, rise, across)));
  }
  if (!is_hollow(a) && !is_hollow(b)) return max_difference;
  for (const auto& [first, second] : {std::pair(&a, &b), std::pair(&b, &a)})
    for (const OutlineSegment& segment : first->segments)
      max_difference = std::max(max_difference, std::abs(distance(*second, segment.to).value));
  return max_difference;
}

OutlineDistance distance(const ToolOutline& outline, const Vector2d& point) {
  if (!is_hollow(outline)) return distance(outline.segments, point);
  OutlineDistance nearest{std::numeric_limits<double>::infinity(), Vector2d::Zero()};
  for (const ToolOutline& part : outline.parts) {
    const OutlineDistance part_distance = distance(part, point);
    if (part_distance.value < nearest.value) nearest = part_distance;
  }
  return nearest;
}

// The largest of the distances to the tangents, which is convex.
OutlineDistance distance(const std::vector<OutlineSegment>& segments, const Vector2d& point) {
  OutlineDistance largest{-1e300, {0, -1}};
  const auto update = [&](double value, const Vector2d& gradient) {
    if (value > largest.value) largest = {value, gradient};
  };
  for (const OutlineSegment& segment : segments) {
    const Vector2d v = point - segment.from, w = point - segment.to;
    const double offset = segment.normal_from.dot(v);
    if (segment.is_arc && cross2d(segment.normal_from, v) >= 0.0 &&
        cross2d(w, segment.normal_to) >= 0.0) {
      const Vector2d from_centre = v + segment.radius * segment.normal_from;
      const double centre_distance = from_centre.norm();
      if (centre_distance > 0.0)
        // Equal to far - radius without its cancellation for large radii.
        update(
            (v.squaredNorm() + 2.0 * segment.radius * offset) / (centre_distance + segment.radius),
            from_centre / centre_distance);
    } else {
      update(offset, segment.normal_from);
      if (segment.is_arc) update(segment.normal_to.dot(w), segment.normal_to);
    }
  }
  return largest;
}

namespace {

/// Appends a segment. Splits an arc of more than a right angle in two, since the sine decides only
/// within half a revolution whether a direction is within the range of an arc.
void append_split(std::vector<OutlineSegment>& segments, const OutlineSegment& segment) {
  const Vector2d& start_normal = segment.normal_from;
  if (!segment.is_arc || start_normal.dot(segment.normal_to) >= 0.0) {
    segments.push_back(segment);
    return;
  }
  // For half a circle the two normals cancel, and the term of 1e-9 decides the side.
  const Vector2d middle_normal =
      (start_normal + segment.normal_to + 1e-9 * Vector2d(-start_normal.y(), start_normal.x()))
          .normalized();
  const Vector2d split_point = segment.from + segment.radius * (middle_normal - start_normal);
  segments.push_back(
      {true, segment.from, split_point, start_normal, middle_normal, segment.radius});
  segments.push_back(
      {true, split_point, segment.to, middle_normal, segment.normal_to, segment.radius});
}

}  // namespace

OutlineSegment line_segment(const Vector2d& from, const Vector2d& to) {
  const Vector2d along = (to - from).normalized();
  const Vector2d normal(along.y(), -along.x());
  return {false, from, to, normal, normal};
}

OutlineSegment arc_segment_about(const Vector2d& from, const Vector2d& to, double radius,
                                 const Vector2d& centre) {
  return {true, from, to, (from - centre).normalized(), (to - centre).normalized(), radius};
}

OutlineSegment arc_segment(const Vector2d& from, const Vector2d& to, double radius) {
  const Vector2d chord = to - from;
  const double half = 0.5 * chord.norm();
  if (!(radius >= half))
    throw OutlineError(
        fmt::format(
            "outline: expected an arc of radius at least {:g} mm to ({:g}, {:g}), seen {:g}", half,
            to.x(), to.y(), radius),
        to, OutlineError::Number::Radius);
  const Vector2d inward = Vector2d(-chord.y(), chord.x()).normalized();
  return arc_segment_about(from, to, radius,
                           0.5 * (from + to) + std::sqrt(radius * radius - half * half) * inward);
}

std::vector<OutlineSegment> segments_from_points(const std::vector<OutlinePoint>& points) {
  require(!points.empty(), "outline: expected at least one point, seen none");
  std::vector<OutlineSegment> segments;
  Vector2d previous = Vector2d::Zero();
  const auto append = [&](const OutlinePoint& point) {
    const bool has_radius = std::isfinite(point.radius) && point.radius >= 0.0;
    if (!has_radius || !point.at.allFinite() || point.at.x() < 0.0)
      throw OutlineError(
          fmt::format(
              "outline: expected finite numbers of at least 0, seen ({:g}, {:g}) mm, radius {:g}",
              point.at.x(), point.at.y(), point.radius),
          point.at, has_radius ? OutlineError::Number::First : OutlineError::Number::Radius);
    if ((point.at - previous).norm() > coincidence_tolerance)
      segments.push_back(point.radius > 0.0 ? arc_segment(previous, point.at, point.radius)
                                            : line_segment(previous, point.at));
    previous = point.at;
  };
  if (!(std::abs(points.front().at.y()) <= coincidence_tolerance))
    throw OutlineError(fmt::format("outline: expected the first point at height 0, seen {:g} mm",
                                   points.front().at.y()),
                       points.front().at, OutlineError::Number::Second);
  for (const OutlinePoint& point : points) append(point);
  if (!(previous.x() > coincidence_tolerance && previous.y() > coincidence_tolerance))
    throw OutlineError(
        fmt::format(
            "outline: expected the last point above the tip and off the axis, seen ({:g}, {:g}) mm",
            previous.x(), previous.y()),
        previous,
        previous.x() > coincidence_tolerance ? OutlineError::Number::Second
                                             : OutlineError::Number::First);
  append({{0.0, previous.y()}});
  return segments;
}

double inward_bend(const OutlineSegment& previous, const OutlineSegment& segment) {
  return -cross2d(previous.normal_to, segment.normal_from);
}

std::vector<OutlineSegment> with_corners(const std::vector<OutlineSegment>& segments,
                                         const Vector2d& normal_before) {
  std::vector<OutlineSegment> result;
  for (const OutlineSegment& segment : segments) {
    const Vector2d previous_normal = result.empty() ? normal_before : result.back().normal_to;
    const double bend = cross2d(previous_normal, segment.normal_from);
    // The sine is near 0 also where the outline turns back on itself; only the cosine tells.
    const bool turns_back = previous_normal.dot(segment.normal_from) < 0.0;
    if (!(bend > -bend_tolerance) || (turns_back && bend <= bend_tolerance))
      throw InwardBendError(
          fmt::format("outline: expected a convex outline, seen an inward bend of {:.3g} deg at "
                      "({:g}, {:g}) mm",
                      std::atan2(-bend, previous_normal.dot(segment.normal_from)) / units::deg,
                      segment.from.x(), segment.from.y()),
          segment.from);
    if (bend > bend_tolerance)
      append_split(result,
                   {true, segment.from, segment.from, previous_normal, segment.normal_from});
    append_split(result, segment);
  }
  return result;
}

}  // namespace abbe::cutting
