#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/inverse.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain_machine.h"

namespace abbe::sim::dialects::heidenhain {

using Eigen::Vector2d;
using kinematics::AxisVector;
using program::Coordinates;

namespace {

constexpr double same_place = 1e-9;  // mm

bool is_arc(const std::string& keyword) { return keyword[0] == 'C'; }
bool is_polar_move(const std::string& keyword) {
  return keyword == "LP" || keyword == "CP" || keyword == "CTP";
}

}  // namespace

std::array<int, 2> Machine::working_plane(const Cause& cause) const {
  return {joint_of('X', cause), joint_of('Y', cause)};
}

void Machine::require_pole(const Cause& cause) const {
  if (!pole_) refuse(cause, "CC before it", "none");
}

/// CC X+10 IY-5, CC Y Z, CC
void Machine::pole(Words& words) {
  const Cause cause{1, "CC"};
  const AxisVector p = contour_.programmed();
  std::array<double, 3> at{};
  unsigned given = 0;
  for (const char letter : {'X', 'Y', 'Z'})
    if (const int j = canon_.joint_of(letter); j >= 0) at[std::size_t(letter - 'X')] = p[j];
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    const std::string name = words.name();
    const bool step = name.size() == 2 && name[0] == 'I';
    if ((name.size() != 1 && !step) || name.back() < 'X' || name.back() > 'Z')
      words.refuse(from, "X, Y or Z after CC");
    const std::size_t k = std::size_t(name.back() - 'X');
    const double value = words.value() * unit();
    joint_of(name.back(), words.cause(from));
    if ((given >> k) & 1u) words.refuse(from, "each axis once");
    at[k] = step ? at[k] + value : value;
    given |= 1u << k;
  }
  if (given != 0 && given != 3 && given != 5 && given != 6)
    refuse(cause, "two of X Y Z after CC, or none");
  const char* plane = given == 6 ? "YZ" : given == 5 ? "ZX" : "XY";
  pole_plane_ = {joint_of(plane[0], cause), joint_of(plane[1], cause)};
  pole_ = at;
}

double Machine::nearest_turn(int joint, double end, double from) const {
  const auto& limits = canon_.options().control;
  const double turn = 2 * pi;
  double near = end + turn * std::round((from - end) / turn);
  if (!limits) return near;
  const kinematics::Joint& axis = limits->joints()[std::size_t(joint)];
  const double axis_to_end = near + canon_.frame().shift[joint];
  if (axis_to_end >= axis.min - 1e-9 && axis_to_end <= axis.max + 1e-9) return near;
  return end;
}

Target Machine::target_of(const Move& move) const {
  Target target;
  const AxisVector p = contour_.programmed();
  for (std::size_t i = 0; i < move.axes.size(); ++i) {
    if (!move.axes[i]) continue;
    const Valued& word = *move.axes[i];
    const char letter = char('A' + i);
    if (letter >= 'X' && !move.machine) require_certain_shift(word.cause);
    const int j = canon_.joint_of(letter);
    if (move.machine && word.step) refuse(word.cause, "an absolute position beside M91");
    if (word.step)
      target.by(j, word.value, word.cause);
    else if (short_way_ && !move.machine && !canon_.is_linear(j))
      target.turn_to(j, nearest_turn(j, word.value, p[j]), word.cause);
    else
      target.to(j, word.value, word.cause);
  }
  return target;
}

/// PR and PA as X and Y, or what the plane of the pole is. @param sweep  rad, of CP
Target Machine::polar_target(const Move& move, double& sweep) const {
  require_pole(move.cause);
  require_certain_shift(move.cause);
  const AxisVector p = contour_.programmed();
  const auto at_pole = [&](int j) {
    for (const char letter : {'X', 'Y', 'Z'})
      if (canon_.joint_of(letter) == j) return (*pole_)[std::size_t(letter - 'X')];
    return 0.0;
  };
  const auto [first, second] = pole_plane_;
  const Vector2d centre(at_pole(first), at_pole(second));
  const Vector2d from = Vector2d(p[first], p[second]) - centre;
  double radius = from.norm(), angle = std::atan2(from.y(), from.x());
  const double start = angle;
  if (move.pr) {
    if (move.keyword == "CP")
      refuse(move.pr->cause, "CP without PR: the radius is where it begins");
    radius = move.pr->value + (move.pr->step ? radius : 0.0);
  }
  if (move.pa) angle = move.pa->value + (move.pa->step ? angle : 0.0);
  if (move.keyword == "CP") {
    if (!move.pa) refuse(move.cause, "PA or IPA beside CP", "none");
    sweep = move.pa->step ? move.pa->value : angle - start;
    if (radius < same_place) refuse(move.cause, "a start beside the pole of CP");
  }
  const double whole = std::round((angle - start) / (2 * pi));
  const bool same = move.keyword == "CP" && std::abs(angle - start - 2 * pi * whole) < 1e-12;
  const Cause& cause = move.pa ? move.pa->cause : move.pr ? move.pr->cause : move.cause;
  Target target = target_of(move);
  if (target.has(first) || target.has(second))
    refuse(cause, "PR and PA without coordinates of the same plane");
  target.to(first, same ? p[first] : centre.x() + radius * std::cos(angle), cause);
  target.to(second, same ? p[second] : centre.y() + radius * std::sin(angle), cause);
  return target;
}

/// Everything that moves of a block, and its M words before and behind.
void Machine::move(Move move) {
  const bool turns_with_path = canon_.tip_mode();
  set_side(move);
  functions_before(move);
  if (canon_.tip_mode() != turns_with_path && contour_.beside())
    refuse(move.cause, "R0 before M128");
  set_feed(move);
  const bool any = std::any_of(move.axes.begin(), move.axes.end(),
                               [](const auto& axis) { return axis.has_value(); });
  if (is_polar_move(move.keyword) || any || move.keyword == "LN" ||
      (!move.keyword.empty() && is_arc(move.keyword))) {
    if (move.keyword.empty()) refuse(move.cause, "L before axes");
    if (!tool_called_ && move.feed_word != FeedWord::Rapid && !move.machine) {
      run_.uncalled_tool(move.cause, "no TOOL CALL");
      tool_called_ = true;
    }
    double sweep = 0.0;
    const Target target = is_polar_move(move.keyword) ? polar_target(move, sweep) : target_of(move);
    if (move.machine && move.keyword != "L") refuse(move.cause, "L beside M91");
    if (move.keyword == "LN")
      vector_line(move);
    else if (move.keyword == "C" || move.keyword == "CP")
      arc(move, target, sweep);
    else if (move.keyword == "CR")
      radius_arc(move, target);
    else if (move.keyword == "CT" || move.keyword == "CTP")
      tangent_arc(move, target);
    else
      line(move, target);
  }
  functions_behind(move);
}

/// To the contour; where it arrives is kept for CT.
void Machine::element(Element made, const Move& move, std::uint32_t stated) {
  made.cause = move.cause;
  made.rapid = move.feed_word == FeedWord::Rapid;
  made.stated = stated;
  if (made.round && made.rapid) refuse(move.cause, "F for an arc: FMAX runs straight");
  // on a machine without X and Y nothing asks for the plane: R0 and no corners
  const std::array<int, 2> plane{std::max(canon_.joint_of('X'), 0),
                                 std::max(canon_.joint_of('Y'), 0)};
  contour_.put(std::move(made), plane, move.before_corner);
}

void Machine::line(const Move& move, const Target& target) {
  if (move.machine) return machine_line(move, target);
  bool turns = false;
  for (int j = 0; j < int(canon_.position().size()); ++j)
    turns = turns || (target.has(j) && !canon_.is_linear(j));
  if (turns && plane_ && !tcpm_)
    return turn_in_plane(move, target, move.feed_word == FeedWord::Rapid);
  const AxisVector before = contour_.programmed();
  element({.end = canon_.end_from(contour_.position(), target, false)}, move, target.stated());
  const AxisVector way = contour_.programmed() - before;
  Vector3d in = Vector3d::Zero();
  for (const char letter : {'X', 'Y', 'Z'})
    if (const int j = canon_.joint_of(letter); j >= 0) in[letter - 'X'] = way[j];
  if (in.norm() > same_place) tangent_ = in.normalized();
}

/// M91: positions of the axes.
void Machine::machine_line(const Move& move, const Target& target) {
  if (contour_.beside()) refuse(move.cause, "R0 before M91");
  if (move.before_corner) refuse(move.cause, "no M91 before RND and CHF");
  canon_.go_to(Coordinates::Axis, move.cause);
  program::Straight straight{canon_.end_of(target, true), move.cause, true, target.stated()};
  if (move.feed_word == FeedWord::Rapid)
    canon_.traverse(std::move(straight));
  else
    canon_.straight_feed(std::move(straight));
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, move.cause);
  contour_.finish();
  tangent_.reset();
}

/// Rotary words in a tilted plane without M128: the axes go straight to where they are to end, and
/// slides without words stay.
void Machine::turn_in_plane(const Move& move, const Target& target, bool rapid) {
  bool slides = false;
  for (int j = 0; j < int(canon_.position().size()); ++j)
    slides = slides || (target.has(j) && canon_.is_linear(j));
  const AxisVector tip_end = canon_.end_of(target);
  AxisVector end = tip_end;
  const int x = joint_of('X', move.cause), y = joint_of('Y', move.cause),
            z = joint_of('Z', move.cause);
  canon_.go_to(Coordinates::Axis, move.cause);
  if (slides) {
    const auto q = kinematics::slides_for_tip(chain(move.cause), tip_end,
                                              {tip_end[x], tip_end[y], tip_end[z]});
    if (!q) refuse(move.cause, "slides that reach the tip", "a tip out of their reach");
    end = *q;
  } else {
    for (const int j : {x, y, z}) end[j] = canon_.position()[j];
  }
  program::Straight straight{std::move(end), move.cause};
  if (rapid)
    canon_.traverse(std::move(straight));
  else
    canon_.straight_feed(std::move(straight));
  canon_.go_to(Coordinates::Tip, move.cause);
  contour_.finish();
  tangent_.reset();
}

/// LN with the direction of the tool, or without.
void Machine::vector_line(const Move& move) {
  const auto complete = [&](const std::array<std::optional<double>, 3>& v, const char* name) {
    const int n = int(v[0].has_value()) + int(v[1].has_value()) + int(v[2].has_value());
    if (n == 0) return false;
    if (n != 3) refuse(move.cause, fmt::format("{0}X {0}Y {0}Z together", name));
    const double length = Vector3d(*v[0], *v[1], *v[2]).norm();
    if (!(std::abs(length - 1.0) < 1e-3))
      refuse(move.cause, fmt::format("{0}X {0}Y {0}Z of length 1", name),
             fmt::format("{:.6g}", length));
    return true;
  };
  if (contour_.beside()) refuse(move.cause, "R0 before LN");
  complete(move.normal, "N");
  if (std::abs(delta_) > 0 || delta_radius_ != 0)
    refuse(move.cause, "DL 0 and DR 0 beside LN: no compensation along the normal", "others");
  const Target target = target_of(move);
  AxisVector end = canon_.end_from(contour_.position(), target, false);
  std::uint32_t stated = target.stated();
  if (complete(move.direction, "T")) {
    if (!tcpm_) refuse(move.cause, "M128 or FUNCTION TCPM before TX TY TZ");
    for (int j = 0; j < int(end.size()); ++j)
      if (target.has(j) && !canon_.is_linear(j))
        refuse(target.cause(j), "either TX TY TZ or positions of rotary axes");
    const Vector3d t(*move.direction[0], *move.direction[1], *move.direction[2]);
    const AxisVector q = nearest_axes(rotation() * t.normalized(), move.cause);
    for (int j = 0; j < int(end.size()); ++j)
      if (!canon_.is_linear(j) &&
          canon_.options().axes[std::size_t(j)].motion == kinematics::Motion::Rotary) {
        end[j] = q[j];
        stated |= 1u << j;
      }
  }
  element({.end = std::move(end)}, move, stated);
  tangent_.reset();
}

/// C about the pole, CP by an angle.
void Machine::arc(const Move& move, const Target& target, double sweep) {
  require_pole(move.cause);
  if (!move.clockwise) refuse(move.cause, "DR+ or DR-", "none");
  Element round{.round = true,
                .end = canon_.end_from(contour_.position(), target, false),
                .first = pole_plane_[0],
                .second = pole_plane_[1],
                .clockwise = *move.clockwise};
  if (move.keyword == "CP") {
    const bool step = move.pa->step;
    if (step && sweep != 0 && (sweep < 0) != *move.clockwise)
      refuse(move.pa->cause, "IPA with the sign of DR");
    round.turns = step ? std::max(1, int(std::ceil(std::abs(sweep) / (2 * pi) - 1e-9))) : 1;
    if (round.turns > 100000) refuse(move.pa->cause, "at most 1e5 turns");
  }
  AxisVector centre = contour_.programmed();
  for (const char letter : {'X', 'Y', 'Z'})
    if (const int j = canon_.joint_of(letter); j == pole_plane_[0] || j == pole_plane_[1])
      centre[j] = (*pole_)[std::size_t(letter - 'X')];
  const AxisVector end = canon_.unplaced(round.end);
  const Vector2d out = Vector2d(end[round.first], end[round.second]) -
                       Vector2d(centre[round.first], centre[round.second]);
  round.centre = canon_.placed(centre);
  element(std::move(round), move, target.stated());
  arrive(pole_plane_, out, *move.clockwise);
}

}  // namespace abbe::sim::dialects::heidenhain
