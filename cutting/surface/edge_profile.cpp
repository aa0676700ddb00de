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

constexpr double no_way = 1e-9;  // mm; points nearer to each other are the same point

/// Returns the radius of the circle about the origin that contains the pieces, mm. The farthest
/// point of an arc may be inside it, where its normal points away from the origin.
double outer_radius_of(const std::vector<OutlinePiece>& pieces) {
  double most = 0.0;
  for (const OutlinePiece& piece : pieces) {
    most = std::max(most, piece.to.norm());
    if (!piece.is_arc) continue;
    const Vector2d centre = piece.from - piece.radius * piece.normal_from;
    if (sine_between(piece.normal_from, centre) > 0.0 &&
        sine_between(centre, piece.normal_to) > 0.0)
      most = std::max(most, centre.norm() + piece.radius);
  }
  return most;
}

/// Returns the profile of a loop of pieces, each of which begins where the one before ends.
EdgeProfile closed_profile(const std::vector<OutlinePiece>& pieces) {
  require(pieces.size() >= 2, "edge profile: expected two pieces or more, seen fewer");
  EdgeProfile profile{with_corners(pieces, pieces.back().normal_to)};
  double turned = 0.0;
  for (const OutlinePiece& piece : profile.pieces)
    turned += std::atan2(sine_between(piece.normal_from, piece.normal_to),
                         piece.normal_from.dot(piece.normal_to));
  // One turn is 2 pi and two are 4 pi, so 3 pi separates them whatever the rounding.
  require(turned < 3.0 * std::numbers::pi,
          fmt::format("edge profile: expected one that goes around once, seen {:.0f} turns",
                      turned / (2.0 * std::numbers::pi)));
  profile.outer_radius = outer_radius_of(profile.pieces);
  profile.radius = -distance(profile.pieces, Vector2d::Zero()).value;
  require(profile.radius > no_way,
          fmt::format("edge profile: expected the origin inside, seen it {:.3g} mm outside",
                      -profile.radius));
  return profile;
}

void expect_inside(const char* name, double value, double low, double high) {
  require(std::isfinite(value) && value >= low && value <= high,
          fmt::format("insert: expected {} from {:g} to {:g}, seen {:g}", name, low, high, value));
}

void check_insert(const Insert& insert) {
  constexpr double least = 1e-6, most = 1e4;  // mm
  expect_inside("a nose radius in mm", insert.radius, least, most);
  expect_inside("a length of the major edge in mm", insert.major_length, least, most);
  expect_inside("a length of the minor edge in mm", insert.minor_length, least, most);
  expect_inside("a wiper in mm", insert.wiper, 0.0, most);
  expect_inside("a major angle in deg", insert.major / units::deg, 0.0, 179.0);
  expect_inside("a minor angle in deg", insert.minor / units::deg, 0.0, 179.0);
  expect_inside("major and minor angle together in deg", (insert.major + insert.minor) / units::deg,
                1.0, 179.0);
  const double shortest = insert.radius * std::tan(0.5 * insert.minor);
  require(insert.wiper == 0.0 || insert.wiper >= shortest,
          fmt::format("insert: expected no wiper or one of {:.3g} mm and more, seen {:g}: a minor "
                      "edge of {:g} deg would cut the nose",
                      shortest, insert.wiper, insert.minor / units::deg));
}

// Returns the part of a chord that lies behind a plane. @param v  point of the line, relative to a
// point of the plane
Chord within_half_plane(const Chord& chord, const Vector2d& v, const Vector2d& step,
                        const Vector2d& normal) {
  const double off = normal.dot(v), away = normal.dot(step);
  if (away > 0.0) return {chord.begin, std::min(chord.end, -off / away)};
  if (away < 0.0) return {std::max(chord.begin, -off / away), chord.end};
  return off > 0.0 ? Chord{infinity, -infinity} : chord;
}

/// Returns the chord of a circle. @param v  point of the line, relative to the centre
Chord within_circle(const Vector2d& v, const Vector2d& step, double radius) {
  const double aa = step.squaredNorm();
  // The cross product does not cancel as b^2 - ac does.
  const double off = sine_between(v, step) / std::sqrt(aa);
  const double square = (radius - off) * (radius + off);
  if (square < 0.0) return {infinity, -infinity};
  const double closest = -v.dot(step) / aa, half = std::sqrt(square / aa);
  return {closest - half, closest + half};
}

/// Returns the chord of a region that is bounded by an arc between the tangents at its ends: on the
/// inner side of the arc's chord the region is the whole wedge of the tangents, beyond it the
/// circle.
Chord within_arc(const Chord& all, const OutlinePiece& arc, const Vector2d& point,
                 const Vector2d& step) {
  const Vector2d v = point - arc.from, w = point - arc.to;
  const Vector2d beyond = line_piece(arc.from, arc.to).normal_from;
  const Chord wedge =
      within_half_plane(within_half_plane(all, v, step, arc.normal_from), w, step, arc.normal_to);
  const Chord near = within_half_plane(wedge, v, step, beyond);
  const Chord disc = within_circle(v + arc.radius * arc.normal_from, step, arc.radius);
  const Chord far = within_half_plane(
      {std::max(all.begin, disc.begin), std::min(all.end, disc.end)}, v, step, -beyond);
  if (near.begin > near.end) return far;
  if (far.begin > far.end) return near;
  return {std::min(near.begin, far.begin), std::max(near.end, far.end)};
}

}  // namespace

EdgeProfile insert_profile(const Insert& insert) {
  check_insert(insert);
  const double r = insert.radius;
  const Vector2d ahead(-std::cos(insert.major), std::sin(insert.major));
  const Vector2d behind(std::cos(insert.minor), std::sin(insert.minor));
  const Vector2d leaves_ahead = r * Vector2d(-ahead.y(), ahead.x());
  const bool wipes = insert.wiper > 0.0;
  const Vector2d lowest(0.0, -r);
  const Vector2d arc_end = wipes ? lowest : Vector2d(r * Vector2d(behind.y(), -behind.x()));
  const Vector2d minor_begin = wipes ? Vector2d(insert.wiper, -r) : arc_end;
  const Vector2d major_end = leaves_ahead + insert.major_length * ahead;
  const Vector2d minor_end = minor_begin + insert.minor_length * behind;
  // The rear corner of the parallelogram is minor_end + s ahead = major_end + t behind.
  const double sine = sine_between(behind, ahead);
  const double s = sine_between(behind, major_end - minor_end) / sine;
  const Vector2d back = minor_end + s * ahead;
  std::vector<OutlinePiece> pieces{line_piece(major_end, leaves_ahead)};
  pieces.push_back(arc_piece_about(leaves_ahead, arc_end, r, Vector2d::Zero()));
  if (wipes) pieces.push_back(line_piece(lowest, minor_begin));
  pieces.push_back(line_piece(minor_begin, minor_end));
  pieces.push_back(line_piece(minor_end, back));
  pieces.push_back(line_piece(back, major_end));
  EdgeProfile profile = closed_profile(pieces);
  require(profile.radius > r - no_way,
          fmt::format("insert: expected edges so long that the body behind holds the circle of the "
                      "nose, seen that it ends {:.3g} mm inside of it",
                      r - profile.radius));
  profile.radius = r;
  return profile;
}

EdgeProfile edge_profile_from_points(const std::vector<OutlinePoint>& points) {
  require(points.size() >= 2, "edge profile: expected two points or more, seen fewer");
  std::vector<OutlinePiece> pieces;
  double area = 0.0;  // mm^2, twice the area of the polygon of the points, + if counter-clockwise
  Vector2d last = points.back().at;
  for (const OutlinePoint& point : points) {
    const bool has_radius = std::isfinite(point.radius) && point.radius >= 0.0;
    if (!has_radius || !point.at.allFinite())
      throw OutlineError(
          fmt::format("edge profile: expected finite numbers and radii of 0 and more, seen "
                      "({:g}, {:g}) mm, radius {:g}",
                      point.at.x(), point.at.y(), point.radius),
          point.at, has_radius ? OutlineError::Number::First : OutlineError::Number::Radius);
    if (!((point.at - last).norm() > no_way))
      throw OutlineError(
          fmt::format("edge profile: expected points apart, seen ({:g}, {:g}) mm twice",
                      point.at.x(), point.at.y()),
          point.at);
    area += sine_between(last, point.at);
    pieces.push_back(point.radius > 0.0 ? arc_piece(last, point.at, point.radius)
                                        : line_piece(last, point.at));
    last = point.at;
  }
  // Two points joined by a line and an arc enclose no polygon, so an area of 0 is permitted.
  require(area > -no_way * no_way,
          "edge profile: expected points counter-clockwise, from x to z, seen them clockwise");
  return closed_profile(pieces);
}

EdgeProfile without_overhang(const EdgeProfile& profile, const Vector2d& away) {
  // Rotate so that `away` is y: the pieces that face the part then have normals from -x over -y to
  // x.
  const Eigen::Matrix2d turn =
      (Eigen::Matrix2d() << away.y(), -away.x(), away.x(), away.y()).finished();
  std::vector<OutlinePiece> pieces = profile.pieces;
  const auto faces = [](const Vector2d& normal) { return normal.y() <= 0.0; };
  double top = -infinity;
  for (OutlinePiece& piece : pieces) {
    for (Vector2d* v : {&piece.from, &piece.to, &piece.normal_from, &piece.normal_to})
      *v = turn * *v;
    top = std::max({top, piece.from.y(), piece.to.y()});
  }
  const auto begins = std::ranges::find_if(pieces, [&](const OutlinePiece& piece) {
    return !faces(piece.normal_from) && faces(piece.normal_to);
  });
  if (begins == pieces.end()) return profile;
  std::ranges::rotate(pieces, begins);

  std::vector<OutlinePoint> points;
  const auto add = [&](const Vector2d& at, double radius = 0.0) {
    if (points.empty() || (points.back().at - at).norm() > no_way) points.push_back({at, radius});
  };
  for (OutlinePiece piece : pieces) {
    const Vector2d centre = piece.from - piece.radius * piece.normal_from;
    if (!faces(piece.normal_from) && !faces(piece.normal_to)) continue;
    // An arc that overhangs is cut where its tangent is along `away`.
    if (!faces(piece.normal_from)) piece.from = centre - piece.radius * Vector2d::UnitX();
    if (!faces(piece.normal_to)) piece.to = centre + piece.radius * Vector2d::UnitX();
    add(piece.from);
    add(piece.to, piece.radius);
  }
  const double left = points.front().at.x(), right = points.back().at.x();
  add({right, top});
  add({left, top});
  if ((points.back().at - points.front().at).norm() <= no_way) points.pop_back();
  for (OutlinePoint& point : points) point.at = turn.transpose() * point.at;
  return edge_profile_from_points(points);
}

double edge_height(const EdgeProfile& profile, const Vector2d& away, const Vector2d& side) {
  const double most = std::sin(15.0 * units::deg);
  const double lowest = extreme_point(profile, -away).dot(away);
  double highest = lowest;
  for (const OutlinePiece& piece : profile.pieces) {
    const bool is_edge = std::max(piece.normal_from.dot(away), piece.normal_to.dot(away)) <= most &&
                         (piece.normal_from + piece.normal_to).dot(side) > 0.0;
    if (is_edge) highest = std::max({highest, piece.from.dot(away), piece.to.dot(away)});
  }
  return highest - lowest;
}

std::optional<Chord> chord(const EdgeProfile& profile, const Vector2d& point,
                           const Vector2d& step) {
  Chord inside{-infinity, infinity};
  for (const OutlinePiece& piece : profile.pieces) {
    if (!piece.is_arc)
      inside = within_half_plane(inside, point - piece.from, step, piece.normal_from);
    else if (piece.radius > 0.0)
      inside = within_arc(inside, piece, point, step);
    if (inside.begin > inside.end) return std::nullopt;
  }
  return inside;
}

Vector2d extreme_point(const EdgeProfile& profile, const Vector2d& direction) {
  return extreme_point(profile.pieces, direction);
}

double max_separation(const EdgeProfile& a, const EdgeProfile& b) {
  // 0.1 deg apart: between two directions the reach changes by less than the stated 1e-3.
  constexpr int directions = 3600;
  double most = 0.0;
  for (int i = 0; i < directions; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / directions;
    const Vector2d way(std::cos(angle), std::sin(angle));
    most =
        std::max(most, std::abs(way.dot(extreme_point(a, way)) - way.dot(extreme_point(b, way))));
  }
  return most;
}

EdgePoint edge_point(const EdgeProfile& profile, double psi) {
  const Vector2d way(std::cos(psi), std::sin(psi));
  const Vector2d at = chord(profile, Vector2d::Zero(), way)->end * way;
  return {at, distance(profile.pieces, at).gradient};
}

}  // namespace abbe::cutting
