#include "cutting/surface/tool.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "cutting/surface/outline.h"
#include "kinematics/bad_input.h"

namespace abbe::cutting {

using Eigen::Vector2d;

namespace {

using Segments = std::vector<OutlineSegment>;
using Number = OutlineError::Number;

// Limits the number of convex parts of a hollow tool, each of which is searched by itself.
constexpr int max_chords = 200;

/// Returns the direction of travel along an outline with this outward normal.
Vector2d tangent(const Vector2d& normal) { return {-normal.y(), normal.x()}; }

void check_rise(double previous_height, const Vector2d& point) {
  if (point.y() < previous_height)
    throw OutlineError(fmt::format("outline: expected a height of at least {:g} mm (that of the "
                                   "previous point), seen {:g} mm",
                                   previous_height, point.y()),
                       point, Number::Second);
}

void check_arc_heights(const OutlineSegment& segment, double min_normal_x, const Vector2d& end) {
  if (!(min_normal_x >= -bend_tolerance))
    throw OutlineError(fmt::format("outline: expected an arc that stays between the heights of its "
                                   "ends, seen an arc of {:g} mm to ({:g}, {:g}) mm",
                                   segment.radius, end.x(), end.y()),
                       end, Number::Radius);
}

// Arcs that bulge inwards.

/// Returns the arc traversed backwards: an arc that bulges inwards then bulges outwards, as an
/// OutlinePiece must.
OutlineSegment reversed_arc(const Vector2d& from, const Vector2d& to, double radius) {
  const double half_chord = 0.5 * (to - from).norm();
  if (!(radius >= half_chord))
    throw OutlineError(fmt::format("outline: expected an inward arc with a radius of -{:g} mm or "
                                   "below to ({:g}, {:g}), seen -{:g}",
                                   half_chord, to.x(), to.y(), radius),
                       to, Number::Radius);
  check_rise(from.y(), to);
  const OutlineSegment reversed = arc_segment(to, from, radius);
  check_arc_heights(reversed, -std::max(reversed.normal_from.x(), reversed.normal_to.x()), to);
  const bool has_minimum = reversed.normal_from.y() > 0.0 && reversed.normal_to.y() < 0.0;
  const double min_distance = reversed.from.x() - radius * (1.0 + reversed.normal_from.x());
  if (has_minimum && min_distance <= coincidence_tolerance)
    throw OutlineError(fmt::format("outline: expected an arc that stays off the axis, seen an arc "
                                   "of -{:g} mm to ({:g}, {:g}) mm that comes within {:g} mm of it",
                                   radius, to.x(), to.y(), min_distance),
                       to, Number::Radius);
  return reversed;
}

/// An arc that bulges inwards, and the smallest number of chords that keeps within `max_chord_sag`.
struct InwardArc {
  OutlineSegment reversed;
  double arc_angle;  // rad
  int chord_count;

  InwardArc(const Vector2d& from, const Vector2d& to, double radius)
      : reversed(reversed_arc(from, to, radius)),
        // The sine of half a circle may be -0, hence the absolute value of the angle.
        arc_angle(std::abs(std::atan2(cross2d(reversed.normal_from, reversed.normal_to),
                                      reversed.normal_from.dot(reversed.normal_to)))),
        chord_count(std::max(
            1, int(std::ceil(arc_angle /
                             (2.0 * std::acos(std::max(-1.0, 1.0 - max_chord_sag / radius))))))) {
    if (chord_count > max_chords)
      throw OutlineError(fmt::format("outline: expected an inward arc that splits into at most {} "
                                     "chords with a sag of {:g} mm, seen {} to ({:g}, {:g}) mm",
                                     max_chords, max_chord_sag, chord_count, to.x(), to.y()),
                         to, Number::Radius);
  }

  double sag() const { return reversed.radius * (1.0 - std::cos(0.5 * arc_angle / chord_count)); }
  Vector2d chord_end(int chord) const {
    const Vector2d& n = reversed.normal_to;
    const double angle = -arc_angle * chord / chord_count;
    const Vector2d rotated_normal(std::cos(angle) * n.x() - std::sin(angle) * n.y(),
                                  std::sin(angle) * n.x() + std::cos(angle) * n.y());
    return reversed.to + reversed.radius * (rotated_normal - n);
  }
};

/// Visits the points in order: calls arc(point, its arc) if an arc that bulges inwards leads to the
/// point, otherwise straight(point).
template <class Straight, class Arc>
void visit_points(const std::vector<OutlinePoint>& points, const Straight& straight,
                  const Arc& arc) {
  Vector2d previous = Vector2d::Zero();
  for (const OutlinePoint& point : points) {
    const bool is_inward_arc =
        std::isfinite(point.radius) && point.radius < 0.0 && point.at.allFinite();
    if (!is_inward_arc)
      straight(point);
    else if ((point.at - previous).norm() > coincidence_tolerance)
      arc(point, InwardArc(previous, point.at, -point.radius));
    else
      straight({point.at});
    previous = point.at;
  }
}

std::vector<OutlinePoint> replace_inward_arcs(const std::vector<OutlinePoint>& points) {
  // An outline that does not start at height 0 is rejected later, by `segments_from_points`.
  if (points.empty() || !(std::abs(points.front().at.y()) <= coincidence_tolerance)) return points;
  std::vector<OutlinePoint> result;
  visit_points(
      points, [&](const OutlinePoint& point) { result.push_back(point); },
      [&](const OutlinePoint& point, const InwardArc& arc) {
        for (int k = 1; k < arc.chord_count; ++k) result.push_back({arc.chord_end(k)});
        result.push_back({point.at});
      });
  return result;
}

// The convex parts of a hollow outline.

void check_heights(const Segments& segments) {
  for (std::size_t i = 0; i + 1 < segments.size(); ++i) {
    const OutlineSegment& segment = segments[i];
    check_rise(segment.from.y(), segment.to);
    check_arc_heights(segment, std::min(segment.normal_from.x(), segment.normal_to.x()),
                      segment.to);
    if (segment.to.x() <= coincidence_tolerance)
      throw OutlineError(fmt::format("outline: expected a radius above 0 everywhere above the tip, "
                                     "seen {:g} mm at a height of {:g} mm",
                                     segment.to.x(), segment.to.y()),
                         segment.to, Number::First);
  }
}

void check_turns(const Segments& segments) {
  for (std::size_t i = 1; i < segments.size(); ++i) {
    const Vector2d &before = segments[i - 1].normal_to, &after = segments[i].normal_from;
    if (before.dot(after) < 0.0 && std::abs(cross2d(before, after)) <= bend_tolerance)
      throw OutlineError(fmt::format("outline: expected an outline that does not turn back on "
                                     "itself, seen one that does at ({:g}, {:g}) mm",
                                     segments[i].from.x(), segments[i].from.y()),
                         segments[i].from);
  }
}

/// Returns the convex runs of an outline, split at the corners that bend inwards.
std::vector<Segments> split_at_inward_corners(const Segments& segments) {
  std::vector<Segments> runs(1);
  for (const OutlineSegment& segment : segments) {
    if (!runs.back().empty() && inward_bend(runs.back().back(), segment) > bend_tolerance)
      runs.emplace_back();
    runs.back().push_back(segment);
  }
  return runs;
}

/// Returns the convex outline of a run, closed by a flat bottom and a flat top.
ToolOutline run_outline(const Segments& run) {
  Segments segments;
  const Vector2d low = run.front().from, high = run.back().to;
  if (low.x() > coincidence_tolerance) segments.push_back(line_segment({0.0, low.y()}, low));
  segments.insert(segments.end(), run.begin(), run.end());
  if (high.x() > coincidence_tolerance) segments.push_back(line_segment(high, {0.0, high.y()}));
  return closed_outline(segments);
}

/// Returns the midpoint of that part of a line from a corner which lies inside a convex outline.
/// The part ends no later than half way to the axis.
Vector2d inner_midpoint(const ToolOutline& outline, const Vector2d& corner, const Vector2d& line) {
  if (std::abs(line.y()) <= bend_tolerance) return corner;
  const double end_height = line.y() > 0.0 ? outline.height : outline.segments.front().from.y();
  double outside_distance = (end_height - corner.y()) / line.y(), inside_distance = 0.0;
  if (line.x() < 0.0) outside_distance = std::min(outside_distance, -0.5 * corner.x() / line.x());
  const auto is_inside = [&](double offset) {
    return distance(outline, corner + offset * line).value <= 0.0;
  };
  if (is_inside(outside_distance)) inside_distance = outside_distance;
  // 60 halvings reach the last bit of a double.
  for (int i = 0; i < 60 && inside_distance < outside_distance; ++i) {
    const double middle = 0.5 * (inside_distance + outside_distance);
    (is_inside(middle) ? inside_distance : outside_distance) = middle;
  }
  return corner + 0.5 * inside_distance * line;
}

/// Extends a run at its lower end to a point on its end line.
void extend_start(Segments& run, const Vector2d& start) {
  OutlineSegment& first_segment = run.front();
  if ((first_segment.from - start).norm() <= coincidence_tolerance) return;
  const Vector2d normal = first_segment.normal_from, corner = first_segment.from;
  if (first_segment.is_arc)
    run.insert(run.begin(), {false, start, corner, normal, normal});
  else
    first_segment.from = start;
}

/// Extends a run at its upper end to a point on its end line.
void extend_end(Segments& run, const Vector2d& end) {
  OutlineSegment& last_segment = run.back();
  if ((last_segment.to - end).norm() <= coincidence_tolerance) return;
  const Vector2d normal = last_segment.normal_to, corner = last_segment.to;
  if (last_segment.is_arc)
    run.push_back({false, corner, end, normal, normal});
  else
    last_segment.to = end;
}

/// Returns the outline, hollow if it has more than one convex run.
/// @param segments  from the tip to the axis at the top, without sharp corners
ToolOutline outline_from_runs(const Segments& segments) {
  const std::vector<Segments> runs = split_at_inward_corners(segments);
  if (runs.size() == 1) return closed_outline(segments);
  std::vector<ToolOutline> cores;
  for (const Segments& run : runs) cores.push_back(run_outline(run));
  ToolOutline outline;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Vector2d previous_normal = k == 0 ? Vector2d(0, -1) : runs[k].front().normal_from;
    const Segments run_boundary = with_corners(runs[k], previous_normal);
    outline.segments.insert(outline.segments.end(), run_boundary.begin(), run_boundary.end());
    Segments extended_run = runs[k];
    if (k > 0)
      extend_start(extended_run, inner_midpoint(cores[k - 1], extended_run.front().from,
                                                -tangent(extended_run.front().normal_from)));
    if (k + 1 < runs.size())
      extend_end(extended_run, inner_midpoint(cores[k + 1], extended_run.back().to,
                                              tangent(extended_run.back().normal_to)));
    outline.parts.push_back(run_outline(extended_run));
    outline.radius = std::max(outline.radius, outline.parts.back().radius);
    outline.height = std::max(outline.height, outline.parts.back().height);
    outline.is_sharp = outline.is_sharp || outline.parts.back().is_sharp;
  }
  return outline;
}

// Run-out.

/// Moves the end of one line and the start of the next to their intersection, after a displacement
/// opened the inward corner between them.
void join_lines(OutlineSegment& lower, OutlineSegment& upper, const Vector2d& corner) {
  const Vector2d u = tangent(lower.normal_to), v = tangent(upper.normal_from);
  const double offset = cross2d(upper.from - lower.from, v) / cross2d(u, v);
  const Vector2d intersection = lower.from + offset * u;
  if (lower.is_arc || upper.is_arc || !(offset > 0.0) || !((upper.to - intersection).dot(v) > 0.0))
    throw std::invalid_argument(
        fmt::format("axial run-out: expected a straight-sided groove higher than the run-out, seen "
                    "a tool whose outline bends inwards at ({:g}, {:g}) mm",
                    corner.x(), corner.y()));
  lower.to = upper.from = intersection;
}

/// Returns the segment, or the two parts of an arc below and above its widest point: axial run-out
/// displaces the two differently.
Segments split_at_widest(const OutlineSegment& segment) {
  if (!segment.is_arc || (segment.normal_from.y() <= 0.0) == (segment.normal_to.y() <= 0.0))
    return {segment};
  OutlineSegment below = segment, above = segment;
  below.to = above.from = segment.from + segment.radius * (Vector2d::UnitX() - segment.normal_from);
  below.normal_to = above.normal_from = Vector2d::UnitX();
  return {below, above};
}

// The interior.

/// Returns the segments of an outline without the flats at tip and top.
Segments side_segments(const ToolOutline& outline) {
  Segments sides;
  for (const OutlineSegment& segment : outline.segments) {
    const bool is_flat = std::abs(segment.to.y() - segment.from.y()) <= coincidence_tolerance;
    if (!is_flat || std::min(segment.from.x(), segment.to.x()) > coincidence_tolerance)
      sides.push_back(segment);
  }
  return sides;
}

double radius_at(const OutlineSegment& segment, double height) {
  const double rise = segment.to.y() - segment.from.y();
  if (rise <= coincidence_tolerance) return std::min(segment.from.x(), segment.to.x());
  if (!segment.is_arc)
    return segment.from.x() +
           (height - segment.from.y()) / rise * (segment.to.x() - segment.from.x());
  const Vector2d centre = segment.from - segment.radius * segment.normal_from;
  const double height_above_centre = height - centre.y();
  return centre.x() + std::sqrt(std::max(0.0, segment.radius * segment.radius -
                                                  height_above_centre * height_above_centre));
}

/// Returns the minimum radius between two heights. Checks only the ends of each segment: none is
/// narrower between them.
double min_radius(const Segments& sides, double low, double high) {
  double result = std::numeric_limits<double>::infinity();
  for (const OutlineSegment& segment : sides) {
    const double from = std::max(low, segment.from.y()), to = std::min(high, segment.to.y());
    if (from <= to) result = std::min({result, radius_at(segment, from), radius_at(segment, to)});
  }
  return result;
}

/// Returns the radius of the narrowest corner that bends inwards.
double neck_radius(const Segments& sides) {
  double result = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < sides.size(); ++i)
    if (inward_bend(sides[i - 1], sides[i]) > bend_tolerance)
      result = std::min(result, sides[i].from.x());
  return result;
}

/// Returns the vertices of a polyline with few segments that lies on the points or nearer to the
/// axis, by at most the tolerance.
std::vector<Vector2d> inner_polyline(const std::vector<Vector2d>& points, double tolerance) {
  const auto is_inside = [&](std::size_t from, std::size_t to) {
    const Vector2d direction = points[to] - points[from];
    for (std::size_t k = from + 1; k < to; ++k) {
      const double x =
          points[from].x() + (points[k].y() - points[from].y()) / direction.y() * direction.x();
      if (x > points[k].x() + 1e-12 || x < points[k].x() - tolerance) return false;
    }
    return true;
  };
  std::vector<Vector2d> vertices{points.front()};
  for (std::size_t from = 0; from + 1 < points.size();) {
    std::size_t to = from + 1;
    while (to + 1 < points.size() && is_inside(from, to + 1)) ++to;
    vertices.push_back(points[to]);
    from = to;
  }
  return vertices;
}

}  // namespace

InsetOutline inset_hollow(const ToolOutline& outline, double margin) {
  const Segments sides = side_segments(outline);
  margin = std::min(margin, 0.5 * neck_radius(sides));
  constexpr double max_cells = 1000.0;
  const double usable_height = outline.height - 2.0 * margin;
  if (!(usable_height > 0.0))
    throw std::invalid_argument("outline: no part of it remains at this inset");
  // Cells of a quarter of the margin, but at most 1000, hence the five-hundredth of the height in
  // the stated bound: a cell includes the heights of its neighbours.
  const double cells = std::clamp(std::ceil(4.0 * usable_height / margin), 1.0, max_cells);
  std::vector<Vector2d> samples;
  for (int i = 0; i <= int(cells); ++i) {
    const double height = margin + i / cells * usable_height,
                 window = margin + usable_height / cells;
    samples.emplace_back(min_radius(sides, height - window, height + window) - margin, height);
  }
  // A core thinner than a tenth of the margin is neglected.
  const auto has_core = [&](const Vector2d& sample) { return sample.x() > 0.1 * margin; };
  const auto first = std::ranges::find_if(samples, has_core);
  const auto last = std::find_if(samples.rbegin(), samples.rend(), has_core).base();
  if (last - first < 2) throw std::invalid_argument("outline: no part of it remains at this inset");
  const double tip_rise = first->y();
  std::vector<OutlinePoint> points;
  for (const Vector2d& sample : inner_polyline({first, last}, 0.05 * margin))
    points.push_back({{sample.x(), sample.y() - tip_rise}});
  return {tool_outline_from_points(points), tip_rise};
}

ToolOutline tool_outline_from_points(const std::vector<OutlinePoint>& points) {
  const Segments segments = segments_from_points(replace_inward_arcs(points));
  check_heights(segments);
  check_turns(segments);
  return outline_from_runs(segments);
}

double chord_sag(const std::vector<OutlinePoint>& points) {
  double max_sag = 0.0;
  visit_points(
      points, [](const OutlinePoint&) {},
      [&](const OutlinePoint&, const InwardArc& arc) { max_sag = std::max(max_sag, arc.sag()); });
  return max_sag;
}

ToolOutline run_out_envelope(const ToolOutline& outline, double radial, double axial) {
  Segments boundary;
  const auto append = [&](OutlineSegment segment) {
    const Vector2d displacement(
        radial, segment.normal_from.y() + segment.normal_to.y() <= 0.0 ? 0.0 : 2.0 * axial);
    const Vector2d corner = segment.from;
    segment.from += displacement;
    segment.to += displacement;
    const Vector2d previous_end = boundary.empty() ? Vector2d::Zero() : boundary.back().to;
    if ((segment.from - previous_end).norm() > coincidence_tolerance) {
      if (!boundary.empty() && inward_bend(boundary.back(), segment) > bend_tolerance)
        join_lines(boundary.back(), segment, corner);
      else
        boundary.push_back(line_segment(previous_end, segment.from));
    }
    boundary.push_back(segment);
  };
  // Corners, arcs of radius 0, are left out; `outline_from_runs` inserts them again.
  for (const OutlineSegment& segment : outline.segments)
    if (!segment.is_arc || segment.radius > 0.0)
      for (const OutlineSegment& half : split_at_widest(segment)) append(half);
  // The displacement has moved the end of the top off the axis.
  boundary.back().to.x() = 0.0;
  return outline_from_runs(boundary);
}

Cutter form_cutter(ToolOutline outline) {
  const double radius = outline.radius, height = outline.height;
  return {radius, 0.0, height, std::make_shared<const ToolOutline>(std::move(outline))};
}

Nose profile_nose(EdgeProfile profile) {
  Nose nose{profile.radius, {}};
  nose.profile = std::make_shared<const EdgeProfile>(std::move(profile));
  return nose;
}

void check_cutter(const Cutter& cutter) {
  require(std::isfinite(cutter.radius) && cutter.radius > 0.0 && cutter.corner_radius >= 0.0 &&
              cutter.corner_radius <= cutter.radius && std::isfinite(cutter.flank_length) &&
              cutter.flank_length >= cutter.corner_radius,
          "cutter: expected a radius above 0, a corner radius from 0 to the radius and a flank at "
          "least as long as the corner radius");
}

std::vector<Cutter> convex_parts(const Cutter& cutter) {
  if (!is_hollow(cutter)) return {cutter};
  std::vector<Cutter> parts;
  for (const ToolOutline& part : cutter.outline->parts)
    parts.push_back(
        {part.radius, 0.0, part.height, std::shared_ptr<const ToolOutline>(cutter.outline, &part)});
  return parts;
}

InsetCutter inset_cutter(const Cutter& cutter, double margin) {
  const double offset = std::min(margin, 0.25 * cutter.radius);
  if (cutter.outline) {
    const double depth = std::min(offset, 0.25 * cutter.flank_length);
    InsetOutline inner = is_hollow(cutter) ? inset_hollow(*cutter.outline, depth)
                                           : inset_convex(*cutter.outline, depth);
    return {form_cutter(std::move(inner.outline)), inner.raised};
  }
  return {
      {cutter.radius - offset, std::max(0.0, cutter.corner_radius - offset), cutter.flank_length},
      offset};
}

namespace {

void check_run_out(const char* name, double value) {
  if (std::isfinite(value) && value >= 0.0) return;
  throw std::invalid_argument(
      fmt::format("expected {} run-out of at least 0 mm, seen {}", name, value));
}

}  // namespace

Cutter with_run_out(const Cutter& cutter, double radial, double axial) {
  check_cutter(cutter);
  check_run_out("radial", radial);
  check_run_out("axial", axial);
  if (cutter.outline) return form_cutter(run_out_envelope(*cutter.outline, radial, axial));
  Cutter result = cutter;
  result.radius += radial;
  result.flank_length += 2.0 * axial;
  return result;
}

}  // namespace abbe::cutting
