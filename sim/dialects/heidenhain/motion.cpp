#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain/machine.h"
#include "sim/program/block_motion.h"

/// Words of a motion block, and the moves they make.
namespace abbe::sim::dialects::heidenhain {

using Eigen::Vector2d;
using kinematics::AxisVector;
using program::Coordinates;
using program::Feed;
using program::FeedMode;

namespace {

constexpr double min_feed = 1e-9;  // per minute; keeps every duration finite

bool is_axis_letter(char c) {
  return c >= 'A' && c <= 'Z' && std::string_view("XYZABCUVW").find(c) != std::string_view::npos;
}

}  // namespace

/// Reads an axis word, for example X+10 or IX+10.
bool Machine::read_axis(const std::string& name, Words& words, std::size_t from, Move& move) {
  const bool step = name.size() == 2 && name[0] == 'I';
  if ((name.size() != 1 && !step) || !is_axis_letter(name.back())) return false;
  const char letter = name.back();
  const double number = words.value();
  const Cause cause = words.cause(from);
  const int joint = joint_of(letter, cause);
  auto& word = move.axes[std::size_t(letter - 'A')];
  if (word) refuse(cause, fmt::format("{} once in a block", letter));
  word = WordValue{number * (canon_.is_linear(joint) ? unit() : units::deg), step, cause};
  return true;
}

/// Reads PR, PA, DR and the components NX ... TZ.
bool Machine::read_polar(const std::string& name, Words& words, std::size_t from, Move& move) {
  const bool step = !name.empty() && name[0] == 'I';
  const std::string_view bare = std::string_view(name).substr(step ? 1 : 0);
  if (bare == "PR" || bare == "PA") {
    const double number = words.value();
    auto& word = bare == "PR" ? move.pr : move.pa;
    if (word) words.refuse(from, fmt::format("{} once in a block", bare));
    word = WordValue{number * (bare == "PR" ? unit() : units::deg), step, words.cause(from)};
    return true;
  }
  if (name == "DR") {
    words.cursor.skip_blanks();
    const char sign = words.cursor.current();
    // DR+5 would be the tool radius of a TOOL CALL.
    if ((sign != '+' && sign != '-') || is_digit(words.cursor.peek()))
      words.refuse(from, "DR+ or DR-");
    ++words.cursor.at;
    if (move.clockwise) words.refuse(from, "DR once in a block");
    move.clockwise = sign == '-';
    return true;
  }
  if (name.size() == 2 && (name[0] == 'N' || name[0] == 'T') && name[1] >= 'X' && name[1] <= 'Z') {
    if (move.keyword != "LN") words.refuse(from, "LN before " + name);
    auto& word = (name[0] == 'N' ? move.normal : move.direction)[std::size_t(name[1] - 'X')];
    if (word) words.refuse(from, name + " once in a block");
    word = words.value();
    return true;
  }
  return false;
}

Machine::FeedValue Machine::feed_value(std::string kind, Words& words, std::size_t from) const {
  // In F MAX the word behind F is separated by a blank.
  if (kind.empty() && !words.has_value()) kind = words.name();
  if (kind == "MAX") return {FeedWord::Rapid};
  if (kind == "AUTO") {
    if (!(tool_feed_ > 0)) words.refuse(from, "F in a TOOL CALL before F AUTO");
    return {FeedWord::OfTool, tool_feed_};
  }
  if (!kind.empty() && kind != "U") {
    refuse_if_named("F" + kind, words.cause(from));
    words.refuse(from, "a feed: a number, FMAX, F AUTO or FU");
  }
  words.cursor.skip_blanks();
  const std::size_t at = words.cursor.at;
  const double value = words.value();
  if (!(value >= min_feed)) words.refuse(at, "a feed above zero");
  return {kind.empty() ? FeedWord::Number : FeedWord::PerTurn, value};
}

/// Reads R0, RL or RR; of CR the radius.
void Machine::read_side(const std::string& name, Words& words, std::size_t from, Move& move) {
  const bool had_side = move.side.has_value();
  if (name == "RL" || name == "RR") {
    move.side = name[1];
  } else if (words.cursor.current() == '0' && !is_digit(words.cursor.peek()) &&
             words.cursor.peek() != '.') {
    // R0 is not a radius of 0: CR has no such radius.
    ++words.cursor.at;
    move.side = '0';
  } else {
    if (move.keyword != "CR") words.refuse(from, "R0, RL or RR");
    if (move.radius) words.refuse(from, "the radius R once in a block");
    const double number = words.value();
    move.radius = WordValue{number * unit(), false, words.cause(from)};
    return;
  }
  if (had_side) words.refuse(from, "one of R0, RL and RR in a block");
  move.side_cause = words.cause(from);
}

Machine::Move Machine::read_move(const std::string& keyword, std::size_t from, Words& words) {
  Move move;
  move.keyword = keyword;
  move.cause = keyword.empty() ? Cause{int(from) + 1, words.cursor.text_until_blank(from)} : words.cause(from);
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.name();
    if (name.empty()) words.refuse(at, "a word of Klartext");
    if (name == "M") {
      if (move.functions.size() == 8) words.refuse(at, "at most 8 M words in a block");
      M m;
      read_function(words, at, m);
      move.functions.push_back(m);
    } else if (name == "R" || name == "RL" || name == "RR") {
      read_side(name, words, at, move);
    } else if (name[0] == 'F') {
      if (move.feed_word != FeedWord::None) words.refuse(at, "F once in a block");
      const FeedValue feed = feed_value(name.substr(1), words, at);
      move.feed_word = feed.word;
      move.feed = feed.value;
    } else if (read_axis(name, words, at, move)) {
      // Behind an M function the axis word could belong to it.
      if (!move.functions.empty())
        words.refuse(at, "axis words before the M functions of a block: those behind are theirs");
    } else if (!read_polar(name, words, at, move)) {
      refuse_if_named(name, words.cause(at));
      run_.handle_unknown_word(words.cause(at), "a word of Klartext");
      if (words.has_value()) words.value();
    }
  }
  return move;
}

/// FMAX holds for its own block, every other F until the next one.
void Machine::set_feed(const Move& move) {
  // In inch programs F counts tenths of an inch per minute.
  const double f_unit = canon_.inch() ? 0.1 * units::inch : 1.0;
  switch (move.feed_word) {
    case FeedWord::Number:
    case FeedWord::OfTool:
      feed_per_turn_ = per_turn_;
      feed_ = Feed{move.feed, per_turn_ ? 1.0 : f_unit};
      break;
    case FeedWord::PerTurn:
      feed_per_turn_ = true;
      feed_ = Feed{move.feed, unit()};
      break;
    default:
      break;
  }
  const FeedMode mode = feed_per_turn_ ? FeedMode::PerRevolution : FeedMode::PerMinute;
  // A waiting move would be made with the wrong unit of feed.
  if (mode != canon_.feed_mode() && contour_.beside())
    refuse(move.cause, "R0 before the feed counts otherwise, per minute or per turn");
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed_);
}

// Compensation works in X Y of a machine whose tool does not tilt.
void Machine::set_side(const Move& move) {
  if (!move.side) return;
  if (*move.side == '0') return contour_.set_side({}, 0.0, move.side_cause);
  if (plane_) refuse(move.side_cause, "RL and RR outside of tilted planes");
  if (canon_.tip_mode()) refuse(move.side_cause, "M129 before RL and RR");
  working_plane(move.side_cause);
  const auto radius = radius_.find(tool_);
  if (radius == radius_.end())
    refuse(move.side_cause, "a tool whose radius is known",
           tool_ < 0 ? "none" : fmt::format("tool {}", tool_));
  if (move.keyword != "L" && move.keyword != "LP")
    if (!contour_.beside()) refuse(move.side_cause, "L before RL and RR");
  contour_.set_side(*move.side == 'L', radius->second + delta_radius_, move.side_cause);
}

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

/// Examples: CC X+10 IY-5, CC Y Z, or CC alone.
void Machine::pole(Words& words) {
  const Cause cause{1, "CC"};
  const AxisVector p = contour_.programmed();
  std::array<double, 3> at{};
  unsigned given = 0;
  // CC alone, and coordinates that are not programmed, take the current position.
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
  // Two coordinates define the plane of the pole.
  const char* plane = given == 6 ? "YZ" : given == 5 ? "ZX" : "XY";
  pole_plane_ = {joint_of(plane[0], cause), joint_of(plane[1], cause)};
  pole_ = at;
}

// M126: the nearest position modulo 360 degrees, if the travel of the axis allows it.
double Machine::nearest_rotary_position(int joint, double end, double from) const {
  const auto& limits = canon_.options().control;
  const double turn = 2 * pi;
  double near = end + turn * std::round((from - end) / turn);
  if (!limits) return near;
  const kinematics::Joint& axis = limits->joints()[std::size_t(joint)];
  const double axis_to_end = near + canon_.frame().shift[joint];
  if (axis_to_end >= axis.min - 1e-9 && axis_to_end <= axis.max + 1e-9) return near;
  return end;
}

Target Machine::block_target(const Move& move) const {
  Target target;
  const AxisVector p = contour_.programmed();
  for (std::size_t i = 0; i < move.axes.size(); ++i) {
    if (!move.axes[i]) continue;
    const WordValue& word = *move.axes[i];
    const char letter = char('A' + i);
    if (letter >= 'X' && !move.machine) require_certain_shift(word.cause);
    const int j = canon_.joint_of(letter);
    if (move.machine && word.step) refuse(word.cause, "an absolute position beside M91");
    if (word.step) target.by(j, word.value, word.cause);
    // A direction decided here must not be changed by the roll-over rule of the axis.
    else if (short_way_ && !move.machine && !canon_.is_linear(j))
      target.turn_to(j, nearest_rotary_position(j, word.value, p[j]), word.cause);
    else
      target.to(j, word.value, word.cause);
  }
  return target;
}

/// Converts PR and PA to X and Y, or to the axes of the plane of the pole. `sweep` receives that of
/// CP, rad.
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
    // CP keeps the radius at which it begins; a PR would contradict it.
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
  // A full circle must end exactly where it began, or rounding would decide between a turn and
  // none.
  const bool same = move.keyword == "CP" && std::abs(angle - start - 2 * pi * whole) < 1e-12;
  const Cause& cause = move.pa ? move.pa->cause : move.pr ? move.pr->cause : move.cause;
  Target target = block_target(move);
  if (target.has(first) || target.has(second))
    refuse(cause, "PR and PA without coordinates of the same plane");
  target.to(first, same ? p[first] : centre.x() + radius * std::cos(angle), cause);
  target.to(second, same ? p[second] : centre.y() + radius * std::sin(angle), cause);
  return target;
}

/// Executes the motion of a block and its M functions before and behind it.
void Machine::move(Move move) {
  const bool turns_with_path = canon_.tip_mode();
  set_side(move);
  apply_functions_before_motion(move);
  // Compensation and tip coordinates cannot be changed together.
  if (canon_.tip_mode() != turns_with_path && contour_.beside())
    refuse(move.cause, "R0 before M128");
  set_feed(move);
  const bool any = std::any_of(move.axes.begin(), move.axes.end(),
                               [](const auto& axis) { return axis.has_value(); });
  if (is_polar_move(move.keyword) || any || move.keyword == "LN" ||
      (!move.keyword.empty() && is_arc(move.keyword))) {
    if (move.keyword.empty()) refuse(move.cause, "L before axes");
    // Before the first TOOL CALL only rapids and M91 need no tool.
    if (!tool_called_ && move.feed_word != FeedWord::Rapid && !move.machine) {
      run_.assume_only_tool(move.cause, "no TOOL CALL");
      tool_called_ = true;
    }
    double sweep = 0.0;
    const Target target =
        is_polar_move(move.keyword) ? polar_target(move, sweep) : block_target(move);
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
  apply_functions_after_motion(move);
}

/// Passes a move to the contour and keeps the direction of arrival for CT.
void Machine::element(Element made, const Move& move, std::uint32_t stated) {
  made.cause = move.cause;
  made.rapid = move.feed_word == FeedWord::Rapid;
  made.stated = stated;
  if (made.round && made.rapid) refuse(move.cause, "F for an arc: FMAX runs straight");
  // A machine without X and Y never uses the plane: it has no compensation and no corners.
  const std::array<int, 2> plane{std::max(canon_.joint_of('X'), 0),
                                 std::max(canon_.joint_of('Y'), 0)};
  contour_.put(std::move(made), plane, move.before_corner);
}

void Machine::line(const Move& move, const Target& target) {
  if (move.machine) return machine_line(move, target);
  bool turns = false;
  for (int j = 0; j < int(canon_.position().size()); ++j)
    turns = turns || (target.has(j) && !canon_.is_linear(j));
  // In a plane without M128 rotary words move axes, not the tool about its tip.
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

/// Rotary words in a tilted plane without M128: the axes move straight to their ends, and slides
/// without words stay.
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
    // Programmed X Y Z are where the tip is to be at the end.
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

/// LN, with or without a tool direction.
void Machine::vector_line(const Move& move) {
  const auto complete = [&](const std::array<std::optional<double>, 3>& v, const char* name) {
    const int n = int(v[0].has_value()) + int(v[1].has_value()) + int(v[2].has_value());
    if (n == 0) return false;
    if (n != 3) refuse(move.cause, fmt::format("{0}X {0}Y {0}Z together", name));
    const double length = Vector3d(*v[0], *v[1], *v[2]).norm();
    // Vectors of three decimals stay within a thousandth of length 1.
    if (!(std::abs(length - 1.0) < 1e-3))
      refuse(move.cause, fmt::format("{0}X {0}Y {0}Z of length 1", name),
             fmt::format("{:.6g}", length));
    return true;
  };
  if (contour_.beside()) refuse(move.cause, "R0 before LN");
  complete(move.normal, "N");
  // Compensation along the surface normal would change the path by DL and DR.
  if (std::abs(delta_) > 0 || delta_radius_ != 0)
    refuse(move.cause, "DL 0 and DR 0 beside LN: no compensation along the normal", "others");
  const Target target = block_target(move);
  AxisVector end = canon_.end_from(contour_.position(), target, false);
  std::uint32_t stated = target.stated();
  if (complete(move.direction, "T")) {
    if (!tcpm_) refuse(move.cause, "M128 or FUNCTION TCPM before TX TY TZ");
    for (int j = 0; j < int(end.size()); ++j)
      if (target.has(j) && !canon_.is_linear(j))
        refuse(target.cause(j), "either TX TY TZ or positions of rotary axes");
    const Vector3d t(*move.direction[0], *move.direction[1], *move.direction[2]);
    // The direction is programmed in the plane; solved for the workpiece.
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

/// C about the pole, and CP by an angle.
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
    // Under IPA the sign is stated twice.
    if (step && sweep != 0 && (sweep < 0) != *move.clockwise)
      refuse(move.pa->cause, "IPA with the sign of DR");
    // 1e-9 turns absorb rounding, so that 720 degrees are two turns and not three.
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

// Arcs without a pole, and corners.

namespace {
constexpr double min_length = 1e-9;  // mm
}

/// Stores the direction in which an arc arrives. `out` points from its centre to its end, mm.
void Machine::arrive(const std::array<int, 2>& plane, const Vector2d& out, bool clockwise) {
  if (out.norm() < min_length) return tangent_.reset();
  const Vector2d d = clockwise ? Vector2d(out.y(), -out.x()) : Vector2d(-out.y(), out.x());
  Vector3d in = Vector3d::Zero();
  for (const char letter : {'X', 'Y', 'Z'}) {
    if (canon_.joint_of(letter) == plane[0]) in[letter - 'X'] = d.x();
    if (canon_.joint_of(letter) == plane[1]) in[letter - 'X'] = d.y();
  }
  tangent_ = in.normalized();
}

/// CT: from where the last move arrived, in its direction; CTP in the plane of the pole, CT in X Y.
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
  if (chord.norm() < min_length) refuse(move.cause, "an end of CT that is not its start");
  t.normalize();
  const Vector2d left(-t.y(), t.x());
  const double across = left.dot(chord);
  // Straight ahead the arc is a line; straight back there is none.
  if (std::abs(across) < 1e-9 * chord.norm()) {
    if (t.dot(chord) < 0)
      refuse(move.cause, "an end of CT that an arc reaches", "one straight back");
    return line(move, target);
  }
  const double radius = chord.squaredNorm() / (2 * across);  // to the left if positive
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
  program::ArcGeometry words{
      {p[plane[0]], p[plane[1]]}, {to[plane[0]], to[plane[1]]}, {}, *move.clockwise};
  words.centre =
      program::centre_by_radius(words, move.radius->value, canon_.place(), move.radius->cause);
  const Vector2d out = words.end - words.centre;
  element(std::move(round), move, target.stated());
  arrive(plane, out, *move.clockwise);
}

/// Examples: RND R5 or CHF 2; F is a feed of the corner alone.
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
