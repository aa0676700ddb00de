#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain_machine.h"
#include "sim/program/arc_move.h"

/// Arcs without a pole, and corners.
namespace abbe::sim::dialects::heidenhain {

using Eigen::Vector2d;
using kinematics::AxisVector;

namespace {
constexpr double least_length = 1e-9;  // mm
}

/// Keeps the direction in which an arc arrives. @param out  from its centre to its end, mm
void Machine::arrive(const std::array<int, 2>& plane, const Vector2d& out, bool clockwise) {
  if (out.norm() < least_length) return tangent_.reset();
  const Vector2d d = clockwise ? Vector2d(out.y(), -out.x()) : Vector2d(-out.y(), out.x());
  Vector3d in = Vector3d::Zero();
  for (const char letter : {'X', 'Y', 'Z'}) {
    if (canon_.joint_of(letter) == plane[0]) in[letter - 'X'] = d.x();
    if (canon_.joint_of(letter) == plane[1]) in[letter - 'X'] = d.y();
  }
  tangent_ = in.normalized();
}

/// CT: from where the last move arrived, in its direction. CTP in the plane of the pole, else X Y.
void Machine::tangent_arc(const Move& move, const Target& target) {
  if (!tangent_) refuse(move.cause, "a line or arc before CT, whose direction goes on", "none");
  const auto [first, second] = move.keyword == "CTP" ? pole_plane_ : working_plane(move.cause);
  const AxisVector p = contour_.programmed();
  AxisVector end = canon_.end_from(contour_.position(), target, false);
  const AxisVector to = canon_.unplaced(end);
  Vector2d t = Vector2d::Zero();
  for (const char letter : {'X', 'Y', 'Z'}) {
    if (canon_.joint_of(letter) == first) t.x() = (*tangent_)[letter - 'X'];
    if (canon_.joint_of(letter) == second) t.y() = (*tangent_)[letter - 'X'];
  }
  const Vector2d start(p[first], p[second]), chord = Vector2d(to[first], to[second]) - start;
  if (t.norm() < 1e-9) refuse(move.cause, "a move in the plane before CT", "one across it");
  if (chord.norm() < least_length) refuse(move.cause, "an end of CT that is not its start");
  t.normalize();
  const Vector2d left(-t.y(), t.x());
  const double across = left.dot(chord);
  if (std::abs(across) < 1e-9 * chord.norm()) {
    if (t.dot(chord) < 0)
      refuse(move.cause, "an end of CT that an arc reaches", "one straight back");
    return line(move, target);
  }
  const double radius = chord.squaredNorm() / (2 * across);  // to the left where above zero
  const Vector2d centre = start + radius * left;
  Element round{.round = true,
                .end = std::move(end),
                .first = first,
                .second = second,
                .clockwise = radius < 0};
  AxisVector at = p;
  at[first] = centre.x();
  at[second] = centre.y();
  round.centre = canon_.placed(at);
  const Vector2d out = Vector2d(to[first], to[second]) - centre;
  element(std::move(round), move, target.stated());
  arrive({first, second}, out, radius < 0);
}

/// CR: in X Y, or in the two axes that it names.
void Machine::radius_arc(const Move& move, const Target& target) {
  if (!move.radius) refuse(move.cause, "R beside CR", "none");
  if (!move.clockwise) refuse(move.cause, "DR+ or DR-", "none");
  auto plane = working_plane(move.cause);
  if (const int z = canon_.joint_of('Z'); z >= 0 && target.has(z)) {
    if (target.has(plane[0]) && !target.has(plane[1])) plane = {z, plane[0]};
    if (!target.has(plane[0]) && target.has(plane[1]) && plane[0] != z) plane = {plane[1], z};
  }
  Element round{.round = true,
                .end = canon_.end_from(contour_.position(), target, false),
                .first = plane[0],
                .second = plane[1],
                .radius = move.radius->value,
                .clockwise = *move.clockwise};
  const AxisVector p = contour_.programmed(), to = canon_.unplaced(round.end);
  program::ArcWords words{
      {p[plane[0]], p[plane[1]]}, {to[plane[0]], to[plane[1]]}, {}, *move.clockwise};
  words.centre =
      program::centre_by_radius(words, move.radius->value, canon_.place(), move.radius->cause);
  const Vector2d out = words.end - words.centre;
  element(std::move(round), move, target.stated());
  arrive(plane, out, *move.clockwise);
}

/// RND R5, CHF 2: with F a feed of the corner alone.
void Machine::corner(const std::string& keyword, Words& words) {
  const Cause cause{1, keyword == "RND" ? "RND" : "CHF"};
  std::optional<program::Feed> feed;
  std::optional<double> size;
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    const std::string name = words.name();
    if (name.starts_with('F')) {
      const FeedValue read = feed_value(name.substr(1), words, from);
      if (read.word == FeedWord::Rapid || read.word == FeedWord::PerTurn)
        words.refuse(from, "a feed per minute for a corner");
      feed = program::Feed{read.value, canon_.inch() ? 0.1 * units::inch : 1.0};
    } else if (!size && name == (keyword == "RND" ? "R" : "")) {
      size = words.value() * unit();
    } else {
      words.refuse(from, keyword == "RND" ? "R and F after RND" : "a length and F after CHF");
    }
  }
  working_plane(cause);
  if (!size) refuse(cause, keyword == "RND" ? "R after RND" : "a length after CHF", "none");
  contour_.corner(keyword == "RND", *size, feed, cause);
}

}  // namespace abbe::sim::dialects::heidenhain
