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

using Pieces = std::vector<OutlinePiece>;
using Number = OutlineError::Number;

// limits the parts of a hollow tool, each of which is searched by itself
constexpr int most_chords = 200;

Vector2d along(const Vector2d& normal) { return {-normal.y(), normal.x()}; }

void check_rise(double before, const Vector2d& to) {
  if (to.y() < before)
    throw OutlineError(fmt::format("outline: expected a height of {:g} mm at least, that of the "
                                   "point before, seen {:g} mm",
                                   before, to.y()),
                       to, Number::Second);
}

void check_between(const OutlinePiece& piece, double min_normal_x, const Vector2d& to) {
  if (!(min_normal_x >= -min_bend))
    throw OutlineError(
        fmt::format("outline: expected an arc that keeps between the heights of its ends, seen "
                    "one of {:g} mm to ({:g}, {:g}) mm",
                    piece.radius, to.x(), to.y()),
        to, Number::Radius);
}

// Arcs that bulge inwards.

/// Returns an arc that bulges inwards as the reversed arc, which bulges outwards.
OutlinePiece reversed_arc(const Vector2d& from, const Vector2d& to, double radius) {
  const double half = 0.5 * (to - from).norm();
  if (!(radius >= half))
    throw OutlineError(
        fmt::format("outline: expected an arc that bulges inwards with a radius of -{:g} mm or "
                    "beyond to ({:g}, {:g}), seen -{:g}",
                    half, to.x(), to.y(), radius),
        to, Number::Radius);
  check_rise(from.y(), to);
  const OutlinePiece round = arc_piece(to, from, radius);
  check_between(round, -std::max(round.normal_from.x(), round.normal_to.x()), to);
  const bool has_least = round.normal_from.y() > 0.0 && round.normal_to.y() < 0.0;
  const double least = round.from.x() - radius * (1.0 + round.normal_from.x());
  if (has_least && least <= same_place)
    throw OutlineError(fmt::format("outline: expected an arc that stays off the axis, seen one of "
                                   "-{:g} mm to ({:g}, {:g}) mm that comes to {:g} mm from it",
                                   radius, to.x(), to.y(), least),
                       to, Number::Radius);
  return round;
}

/// An arc that bulges inwards, with the smallest number of chords that keeps to the sag.
struct HollowArc {
  OutlinePiece round;
  double turn;  // rad
  int chords;

  HollowArc(const Vector2d& from, const Vector2d& to, double radius)
      : round(reversed_arc(from, to, radius)),
        // the sine of half a circle may be -0, so the sign of the angle is dropped
        turn(std::abs(std::atan2(sine_between(round.normal_from, round.normal_to),
                                 round.normal_from.dot(round.normal_to)))),
        chords(std::max(
            1, int(std::ceil(turn /
                             (2.0 * std::acos(std::max(-1.0, 1.0 - max_chord_sag / radius))))))) {
    if (chords > most_chords)
      throw OutlineError(
          fmt::format("outline: expected an arc that bulges inwards and comes apart in at most {} "
                      "chords of a sag of {:g} mm, seen {} to ({:g}, {:g}) mm",
                      most_chords, max_chord_sag, chords, to.x(), to.y()),
          to, Number::Radius);
  }

  double sag() const { return round.radius * (1.0 - std::cos(0.5 * turn / chords)); }
  Vector2d place(int chord) const {
    const Vector2d& n = round.normal_to;
    const double angle = -turn * chord / chords;
    const Vector2d turned(std::cos(angle) * n.x() - std::sin(angle) * n.y(),
                          std::sin(angle) * n.x() + std::cos(angle) * n.y());
    return round.to + round.radius * (turned - n);
  }
};

/// Calls arc(point, its arc) for points reached by an arc that bulges inwards, straight(point) for
/// all others.
template <class Straight, class Arc>
void each_point(const std::vector<OutlinePoint>& points, const Straight& straight, const Arc& arc) {
  Vector2d last = Vector2d::Zero();
  for (const OutlinePoint& point : points) {
    const bool bulges_inwards =
        std::isfinite(point.radius) && point.radius < 0.0 && point.at.allFinite();
    if (!bulges_inwards)
      straight(point);
    else if ((point.at - last).norm() > same_place)
      arc(point, HollowArc(last, point.at, -point.radius));
    else
      straight({point.at});
    last = point.at;
  }
}

std::vector<OutlinePoint> with_chords(const std::vector<OutlinePoint>& points) {
  if (points.empty() || !(std::abs(points.front().at.y()) <= same_place)) return points;
  std::vector<OutlinePoint> all;
  each_point(
      points, [&](const OutlinePoint& point) { all.push_back(point); },
      [&](const OutlinePoint& point, const HollowArc& arc) {
        for (int k = 1; k < arc.chords; ++k) all.push_back({arc.place(k)});
        all.push_back({point.at});
      });
  return all;
}

// The convex parts of a hollow outline.

void check_heights(const Pieces& pieces) {
  for (std::size_t i = 0; i + 1 < pieces.size(); ++i) {
    const OutlinePiece& piece = pieces[i];
    check_rise(piece.from.y(), piece.to);
    check_between(piece, std::min(piece.normal_from.x(), piece.normal_to.x()), piece.to);
    if (piece.to.x() <= same_place)
      throw OutlineError(
          fmt::format("outline: expected a radius above 0 above its tip, seen {:g} mm at {:g} mm",
                      piece.to.x(), piece.to.y()),
          piece.to, Number::First);
  }
}

void check_turns(const Pieces& pieces) {
  for (std::size_t i = 1; i < pieces.size(); ++i) {
    const Vector2d &before = pieces[i - 1].normal_to, &after = pieces[i].normal_from;
    if (before.dot(after) < 0.0 && std::abs(sine_between(before, after)) <= min_bend)
      throw OutlineError(
          fmt::format("outline: expected it to go on, seen that it turns back on itself at "
                      "({:g}, {:g}) mm",
                      pieces[i].from.x(), pieces[i].from.y()),
          pieces[i].from);
  }
}

/// Returns the runs of an outline between its corners that bend inwards.
std::vector<Pieces> runs_of(const Pieces& pieces) {
  std::vector<Pieces> runs(1);
  for (const OutlinePiece& piece : pieces) {
    if (!runs.back().empty() && inward_bend(runs.back().back(), piece) > min_bend)
      runs.emplace_back();
    runs.back().push_back(piece);
  }
  return runs;
}

/// Returns the outline of a run with a flat bottom below it and a flat top above.
ToolOutline closed_run(const Pieces& run) {
  Pieces pieces;
  const Vector2d low = run.front().from, high = run.back().to;
  if (low.x() > same_place) pieces.push_back(line_piece({0.0, low.y()}, low));
  pieces.insert(pieces.end(), run.begin(), run.end());
  if (high.x() > same_place) pieces.push_back(line_piece(high, {0.0, high.y()}));
  return closed_outline(pieces);
}

/// Returns the midpoint of the segment that a line from a corner has inside a convex outline,
/// limited to half the corner's distance from the axis.
Vector2d inner_midpoint(const ToolOutline& outline, const Vector2d& corner, const Vector2d& line) {
  if (std::abs(line.y()) <= min_bend) return corner;
  const double end = line.y() > 0.0 ? outline.height : outline.pieces.front().from.y();
  double far = (end - corner.y()) / line.y(), near = 0.0;
  if (line.x() < 0.0) far = std::min(far, -0.5 * corner.x() / line.x());
  const auto is_inside = [&](double way) {
    return distance(outline, corner + way * line).value <= 0.0;
  };
  if (is_inside(far)) near = far;
  // 60 halvings reach the last bit
  for (int i = 0; i < 60 && near < far; ++i) {
    const double middle = 0.5 * (near + far);
    (is_inside(middle) ? near : far) = middle;
  }
  return corner + 0.5 * near * line;
}

// Extends a run at its lower end to a point on its own end line.
void begin_at(Pieces& run, const Vector2d& place) {
  OutlinePiece& first = run.front();
  if ((first.from - place).norm() <= same_place) return;
  const Vector2d n = first.normal_from, corner = first.from;
  if (first.is_arc)
    run.insert(run.begin(), {false, place, corner, n, n});
  else
    first.from = place;
}

// Extends a run at its upper end.
void end_at(Pieces& run, const Vector2d& place) {
  OutlinePiece& last = run.back();
  if ((last.to - place).norm() <= same_place) return;
  const Vector2d n = last.normal_to, corner = last.to;
  if (last.is_arc)
    run.push_back({false, corner, place, n, n});
  else
    last.to = place;
}

/// Returns the outline of pieces.
/// @param pieces  from the tip to the axis at the top, without sharp corners
ToolOutline outline_of(const Pieces& pieces) {
  const std::vector<Pieces> runs = runs_of(pieces);
  if (runs.size() == 1) return closed_outline(pieces);
  std::vector<ToolOutline> cores;
  for (const Pieces& run : runs) cores.push_back(closed_run(run));
  ToolOutline outline;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Vector2d before = k == 0 ? Vector2d(0, -1) : runs[k].front().normal_from;
    const Pieces own = with_corners(runs[k], before);
    outline.pieces.insert(outline.pieces.end(), own.begin(), own.end());
    Pieces longer = runs[k];
    if (k > 0)
      begin_at(longer, inner_midpoint(cores[k - 1], longer.front().from,
                                      -along(longer.front().normal_from)));
    if (k + 1 < runs.size())
      end_at(longer,
             inner_midpoint(cores[k + 1], longer.back().to, along(longer.back().normal_to)));
    outline.parts.push_back(closed_run(longer));
    outline.radius = std::max(outline.radius, outline.parts.back().radius);
    outline.height = std::max(outline.height, outline.parts.back().height);
    outline.is_sharp = outline.is_sharp || outline.parts.back().is_sharp;
  }
  return outline;
}

// Run-out.

/// Extends two lines that were moved apart at a corner that bends inwards to where they meet.
void join(OutlinePiece& before, OutlinePiece& after, const Vector2d& corner) {
  const Vector2d u = along(before.normal_to), v = along(after.normal_from);
  const double way = sine_between(after.from - before.from, v) / sine_between(u, v);
  const Vector2d meet = before.from + way * u;
  if (before.is_arc || after.is_arc || !(way > 0.0) || !((after.to - meet).dot(v) > 0.0))
    throw std::invalid_argument(
        fmt::format("run-out along the axis: expected a groove of straight lines that is higher, "
                    "seen a tool whose outline bends inwards at ({:g}, {:g}) mm",
                    corner.x(), corner.y()));
  before.to = after.from = meet;
}

/// Returns a piece, or its halves below and above its widest point, which the axial run-out moves
/// differently.
Pieces halves_of(const OutlinePiece& piece) {
  if (!piece.is_arc || (piece.normal_from.y() <= 0.0) == (piece.normal_to.y() <= 0.0))
    return {piece};
  OutlinePiece below = piece, above = piece;
  below.to = above.from = piece.from + piece.radius * (Vector2d::UnitX() - piece.normal_from);
  below.normal_to = above.normal_from = Vector2d::UnitX();
  return {below, above};
}

// The interior.

/// Returns the pieces beside the axis, without the flats of tip and top.
Pieces sides_of(const ToolOutline& outline) {
  Pieces sides;
  for (const OutlinePiece& piece : outline.pieces) {
    const bool is_flat = std::abs(piece.to.y() - piece.from.y()) <= same_place;
    if (!is_flat || std::min(piece.from.x(), piece.to.x()) > same_place) sides.push_back(piece);
  }
  return sides;
}

double radius_at(const OutlinePiece& piece, double height) {
  const double rise = piece.to.y() - piece.from.y();
  if (rise <= same_place) return std::min(piece.from.x(), piece.to.x());
  if (!piece.is_arc)
    return piece.from.x() + (height - piece.from.y()) / rise * (piece.to.x() - piece.from.x());
  const Vector2d middle = piece.from - piece.radius * piece.normal_from;
  const double up = height - middle.y();
  return middle.x() + std::sqrt(std::max(0.0, piece.radius * piece.radius - up * up));
}

/// Returns the least radius between two heights. No piece is narrower between its ends than at one
/// of them.
double min_radius(const Pieces& sides, double low, double high) {
  double least = std::numeric_limits<double>::infinity();
  for (const OutlinePiece& piece : sides) {
    const double from = std::max(low, piece.from.y()), to = std::min(high, piece.to.y());
    if (from <= to) least = std::min({least, radius_at(piece, from), radius_at(piece, to)});
  }
  return least;
}

/// Returns the radius of the narrowest corner that bends inwards.
double neck_radius(const Pieces& sides) {
  double neck = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < sides.size(); ++i)
    if (inward_bend(sides[i - 1], sides[i]) > min_bend) neck = std::min(neck, sides[i].from.x());
  return neck;
}

/// Returns as few lines as possible that lie on or below the points, by at most the tolerance.
std::vector<Vector2d> lower_polyline(const std::vector<Vector2d>& places, double tolerance) {
  const auto is_below = [&](std::size_t from, std::size_t to) {
    const Vector2d way = places[to] - places[from];
    for (std::size_t k = from + 1; k < to; ++k) {
      const double x = places[from].x() + (places[k].y() - places[from].y()) / way.y() * way.x();
      if (x > places[k].x() + 1e-12 || x < places[k].x() - tolerance) return false;
    }
    return true;
  };
  std::vector<Vector2d> few{places.front()};
  for (std::size_t from = 0; from + 1 < places.size();) {
    std::size_t to = from + 1;
    while (to + 1 < places.size() && is_below(from, to + 1)) ++to;
    few.push_back(places[to]);
    from = to;
  }
  return few;
}

}  // namespace

InsetOutline inset_hollow(const ToolOutline& outline, double margin) {
  const Pieces sides = sides_of(outline);
  margin = std::min(margin, 0.5 * neck_radius(sides));
  constexpr double max_cells = 1000.0;
  const double room = outline.height - 2.0 * margin;
  if (!(room > 0.0)) throw std::invalid_argument("outline: nothing of it lies that deep");
  // Cells of a quarter of the margin, but at most 1000, hence the five-hundredth of the height in
  // the stated bound: a cell counts its neighbours' heights too.
  const double cells = std::clamp(std::ceil(4.0 * room / margin), 1.0, max_cells);
  std::vector<Vector2d> places;
  for (int i = 0; i <= int(cells); ++i) {
    const double height = margin + i / cells * room, window = margin + room / cells;
    places.emplace_back(min_radius(sides, height - window, height + window) - margin, height);
  }
  // a core thinner than a tenth of the margin does not count
  const auto is_there = [&](const Vector2d& place) { return place.x() > 0.1 * margin; };
  const auto first = std::ranges::find_if(places, is_there);
  const auto last = std::find_if(places.rbegin(), places.rend(), is_there).base();
  if (last - first < 2) throw std::invalid_argument("outline: nothing of it lies that deep");
  const double raised = first->y();
  std::vector<OutlinePoint> points;
  for (const Vector2d& place : lower_polyline({first, last}, 0.05 * margin))
    points.push_back({{place.x(), place.y() - raised}});
  return {profile_from_points(points), raised};
}

ToolOutline profile_from_points(const std::vector<OutlinePoint>& points) {
  const Pieces pieces = pieces_from_points(with_chords(points));
  check_heights(pieces);
  check_turns(pieces);
  return outline_of(pieces);
}

double chord_sag(const std::vector<OutlinePoint>& points) {
  double most = 0.0;
  each_point(
      points, [](const OutlinePoint&) {},
      [&](const OutlinePoint&, const HollowArc& arc) { most = std::max(most, arc.sag()); });
  return most;
}

ToolOutline widened(const ToolOutline& outline, double radial, double axial) {
  Pieces moved;
  const auto add = [&](OutlinePiece piece) {
    const Vector2d by(radial,
                      piece.normal_from.y() + piece.normal_to.y() <= 0.0 ? 0.0 : 2.0 * axial);
    const Vector2d corner = piece.from;
    piece.from += by;
    piece.to += by;
    const Vector2d last = moved.empty() ? Vector2d::Zero() : moved.back().to;
    if ((piece.from - last).norm() > same_place) {
      if (!moved.empty() && inward_bend(moved.back(), piece) > min_bend)
        join(moved.back(), piece, corner);
      else
        moved.push_back(line_piece(last, piece.from));
    }
    moved.push_back(piece);
  };
  for (const OutlinePiece& piece : outline.pieces)
    if (!piece.is_arc || piece.radius > 0.0)
      for (const OutlinePiece& half : halves_of(piece)) add(half);
  moved.back().to.x() = 0.0;
  return outline_of(moved);
}

Cutter form_cutter(ToolOutline outline) {
  const double radius = outline.radius, height = outline.height;
  return {radius, 0.0, height, std::make_shared<const ToolOutline>(std::move(outline))};
}

Nose nose_of(EdgeProfile profile) {
  Nose nose{profile.radius, {}};
  nose.profile = std::make_shared<const EdgeProfile>(std::move(profile));
  return nose;
}

void check_cutter(const Cutter& cutter) {
  require(std::isfinite(cutter.radius) && cutter.radius > 0.0 && cutter.corner_radius >= 0.0 &&
              cutter.corner_radius <= cutter.radius && std::isfinite(cutter.flank_length) &&
              cutter.flank_length >= cutter.corner_radius,
          "cutter: expected radius > 0, corner radius from 0 to radius, flank at least as long");
}

std::vector<Cutter> convex_parts(const Cutter& cutter) {
  if (!is_hollow(cutter)) return {cutter};
  std::vector<Cutter> parts;
  for (const ToolOutline& part : cutter.outline->parts)
    parts.push_back(
        {part.radius, 0.0, part.height, std::shared_ptr<const ToolOutline>(cutter.outline, &part)});
  return parts;
}

InsetCutter shrunk(const Cutter& cutter, double margin) {
  const double by = std::min(margin, 0.25 * cutter.radius);
  if (cutter.outline) {
    const double depth = std::min(by, 0.25 * cutter.flank_length);
    InsetOutline inner =
        is_hollow(cutter) ? inset_hollow(*cutter.outline, depth) : inside(*cutter.outline, depth);
    return {form_cutter(std::move(inner.outline)), inner.raised};
  }
  return {{cutter.radius - by, std::max(0.0, cutter.corner_radius - by), cutter.flank_length}, by};
}

namespace {

void expect_amount(const char* name, double value) {
  if (std::isfinite(value) && value >= 0.0) return;
  throw std::invalid_argument(
      fmt::format("expected {} run-out of 0 mm or more, seen {}", name, value));
}

}  // namespace

Cutter with_run_out(const Cutter& cutter, double radial, double axial) {
  check_cutter(cutter);
  expect_amount("radial", radial);
  expect_amount("axial", axial);
  if (cutter.outline) return form_cutter(widened(*cutter.outline, radial, axial));
  Cutter result = cutter;
  result.radius += radial;
  result.flank_length += 2.0 * axial;
  return result;
}

}  // namespace abbe::cutting
