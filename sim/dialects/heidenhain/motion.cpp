#include "sim/dialects/heidenhain/heidenhain.h"

/// Words of a motion block, and the moves they make.
namespace abbe::sim::dialects::heidenhain {

using Eigen::Vector2d;

/// Parses an axis word, for example X+10 or IX+10. Returns false for another word.
bool Machine::read_axis(const std::string& name, WordReader& words, std::size_t from,
                        MotionBlock& move) {
  const bool is_incremental = name.size() == 2 && name[0] == 'I';
  if ((name.size() != 1 && !is_incremental) ||
      axis_letters.find(name.back()) == std::string_view::npos)
    return false;
  const char letter = name.back();
  const double number = words.read_value();
  const Cause cause = words.cause(from);
  const int joint = joint_of(letter, cause);
  auto& word = move.axes[std::size_t(letter - 'A')];
  if (word) throw_input_error(cause, fmt::format("{} only once in a block", letter));
  word = WordValue{number * (canon_.is_linear(joint) ? unit() : units::deg), is_incremental, cause};
  return true;
}

/// Parses PR, PA, DR and the components NX ... TZ. Returns false for another word.
bool Machine::read_polar(const std::string& name, WordReader& words, std::size_t from,
                         MotionBlock& move) {
  const bool is_incremental = !name.empty() && name[0] == 'I';
  const std::string_view address = std::string_view(name).substr(is_incremental ? 1 : 0);
  if (address == "PR" || address == "PA") {
    const double number = words.read_value();
    auto& word = address == "PR" ? move.pr : move.pa;
    if (word) words.throw_input_error(from, fmt::format("{} only once in a block", address));
    word = WordValue{number * (address == "PR" ? unit() : units::deg), is_incremental,
                     words.cause(from)};
    return true;
  }
  if (name == "DR") {
    words.cursor.skip_blanks();
    const char sign = words.cursor.current();
    // DR+5 would be the radius of a TOOL CALL.
    if ((sign != '+' && sign != '-') || is_digit(words.cursor.peek()))
      words.throw_input_error(from, "DR+ or DR-");
    ++words.cursor.at;
    if (move.is_clockwise) words.throw_input_error(from, "DR only once in a block");
    move.is_clockwise = sign == '-';
    return true;
  }
  if (name.size() == 2 && (name[0] == 'N' || name[0] == 'T') && name[1] >= 'X' && name[1] <= 'Z') {
    if (move.keyword != "LN") words.throw_input_error(from, "LN before " + name);
    auto& word = (name[0] == 'N' ? move.normal : move.direction)[std::size_t(name[1] - 'X')];
    if (word) words.throw_input_error(from, name + " only once in a block");
    word = words.read_value();
    return true;
  }
  return false;
}

Machine::FeedValue Machine::read_feed(std::string letters, WordReader& words,
                                      std::size_t from) const {
  // In F MAX a blank separates the letters from F.
  if (letters.empty() && !words.has_value()) letters = words.read_name();
  if (letters == "MAX") return {FeedKind::Rapid};
  if (letters == "AUTO") {
    if (!(tool_feed_ > 0)) words.throw_input_error(from, "F in a TOOL CALL before F AUTO");
    return {FeedKind::OfTool, tool_feed_};
  }
  if (!letters.empty() && letters != "U") {
    reject_unsupported("F" + letters, words.cause(from));
    words.throw_input_error(from, "a feed: a number, FMAX, F AUTO or FU");
  }
  const std::size_t at = skip_blanks(words.cursor);
  const double value = words.read_value();
  if (!(value >= min_feed)) words.throw_input_error(at, "a feed greater than zero");
  return {letters.empty() ? FeedKind::Number : FeedKind::PerRevolution, value};
}

/// Parses R0, RL or RR, or the radius of CR.
void Machine::read_compensation_side(const std::string& name, WordReader& words, std::size_t from,
                                     MotionBlock& move) {
  const bool had_side = move.side.has_value();
  if (name == "RL" || name == "RR") {
    move.side = name[1];
  } else if (words.cursor.current() == '0' && !is_digit(words.cursor.peek()) &&
             words.cursor.peek() != '.') {
    // CR has no radius of 0, so R0 is the end of compensation.
    ++words.cursor.at;
    move.side = '0';
  } else {
    if (move.keyword != "CR") words.throw_input_error(from, "R0, RL or RR");
    if (move.radius) words.throw_input_error(from, "the radius R only once in a block");
    const double number = words.read_value();
    move.radius = WordValue{number * unit(), false, words.cause(from)};
    return;
  }
  if (had_side) words.throw_input_error(from, "only one of R0, RL and RR per block");
  move.side_cause = words.cause(from);
}

Machine::MotionBlock Machine::read_move(const std::string& keyword, std::size_t from,
                                        WordReader& words) {
  MotionBlock move;
  move.keyword = keyword;
  move.cause = keyword.empty() ? Cause{int(from) + 1, words.cursor.text_until_blank(from)}
                               : words.cause(from);
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.read_name();
    if (name.empty()) words.throw_input_error(at, "a Klartext word");
    if (name == "M") {
      if (move.functions.size() == 8)
        words.throw_input_error(at, "at most 8 M functions in a block");
      MFunction m;
      read_m_function(words, at, m);
      move.functions.push_back(m);
    } else if (name == "R" || name == "RL" || name == "RR") {
      read_compensation_side(name, words, at, move);
    } else if (name[0] == 'F') {
      if (move.feed_kind != FeedKind::None) words.throw_input_error(at, "F only once in a block");
      const FeedValue feed = read_feed(name.substr(1), words, at);
      move.feed_kind = feed.kind;
      move.feed = feed.value;
    } else if (read_axis(name, words, at, move)) {
      // An axis word after an M function could belong to the function.
      if (!move.functions.empty())
        words.throw_input_error(
            at,
            "axis words before the M functions of a block: words after an M function belong to it");
    } else if (!read_polar(name, words, at, move)) {
      reject_unsupported(name, words.cause(at));
      run_.handle_unknown_word(words.cause(at), "a Klartext word");
      if (words.has_value()) words.read_value();
    }
  }
  return move;
}

/// Sets the feed. FMAX holds only for its own block, every other F until the next one.
void Machine::set_feed(const MotionBlock& move) {
  // In inch programs F counts tenths of an inch per minute.
  const double f_unit = canon_.inch() ? 0.1 * units::inch : 1.0;
  switch (move.feed_kind) {
    case FeedKind::Number:
    case FeedKind::OfTool:
      is_last_feed_per_turn_ = is_feed_per_turn_;
      feed_ = Feed{move.feed, is_feed_per_turn_ ? 1.0 : f_unit};
      break;
    case FeedKind::PerRevolution:
      is_last_feed_per_turn_ = true;
      feed_ = Feed{move.feed, unit()};
      break;
    default:
      break;
  }
  const FeedMode mode = is_last_feed_per_turn_ ? FeedMode::PerRevolution : FeedMode::PerMinute;
  // A waiting move would be made with the new unit of feed.
  if (mode != canon_.feed_mode() && contour_.is_compensated())
    throw_input_error(move.cause,
                      "R0 before the feed changes between per minute and per revolution");
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed_);
}

/// Executes R0, RL and RR. Compensation works in X Y of a machine whose tool does not tilt.
void Machine::set_side(const MotionBlock& move) {
  if (!move.side) return;
  if (*move.side == '0') return contour_.set_side({}, 0.0, move.side_cause);
  if (plane_) throw_input_error(move.side_cause, "RL and RR outside tilted planes");
  if (canon_.tip_mode()) throw_input_error(move.side_cause, "M129 before RL and RR");
  working_plane(move.side_cause);
  const auto radius = find_value(radius_, tool_);
  if (!radius)
    throw_input_error(move.side_cause, "a tool with a known radius",
                      tool_ < 0 ? "none" : fmt::format("tool {}", tool_));
  if (move.keyword != "L" && move.keyword != "LP")
    if (!contour_.is_compensated()) throw_input_error(move.side_cause, "L before RL and RR");
  contour_.set_side(*move.side == 'L', *radius + delta_radius_, move.side_cause);
}

namespace {

constexpr double position_tolerance = 1e-9;  // mm

bool is_arc(const std::string& keyword) { return keyword[0] == 'C'; }
bool is_polar_move(const std::string& keyword) {
  return keyword == "LP" || keyword == "CP" || keyword == "CTP";
}

}  // namespace

std::array<int, 2> Machine::working_plane(const Cause& cause) const {
  return {joint_of('X', cause), joint_of('Y', cause)};
}

void Machine::require_pole(const Cause& cause) const {
  if (!pole_) throw_input_error(cause, "CC before it", "none");
}

/// Executes CC, for example CC X+10 IY-5, CC Y Z, or CC alone.
void Machine::set_pole(WordReader& words) {
  const Cause cause{1, "CC"};
  const AxisVector p = contour_.programmed();
  std::array<double, 3> pole{};
  unsigned programmed_bits = 0;
  // Coordinates that CC does not state are those of the current position.
  for (const char letter : {'X', 'Y', 'Z'})
    if (const int j = canon_.joint_of(letter); j >= 0) pole[std::size_t(letter - 'X')] = p[j];
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    const std::string name = words.read_name();
    const bool is_incremental = name.size() == 2 && name[0] == 'I';
    if ((name.size() != 1 && !is_incremental) || name.back() < 'X' || name.back() > 'Z')
      words.throw_input_error(from, "X, Y or Z after CC");
    const std::size_t k = std::size_t(name.back() - 'X');
    const double value = words.read_value() * unit();
    joint_of(name.back(), words.cause(from));
    if ((programmed_bits >> k) & 1u) words.throw_input_error(from, "each axis only once");
    pole[k] = is_incremental ? pole[k] + value : value;
    programmed_bits |= 1u << k;
  }
  if (programmed_bits != 0 && programmed_bits != 3 && programmed_bits != 5 && programmed_bits != 6)
    throw_input_error(cause, "two of X Y Z after CC, or none");
  // Two coordinates define the plane of the pole.
  const char* plane = programmed_bits == 6 ? "YZ" : programmed_bits == 5 ? "ZX" : "XY";
  pole_plane_ = {joint_of(plane[0], cause), joint_of(plane[1], cause)};
  pole_ = pole;
}

/// Returns the position nearest to `from` modulo 360 degrees (M126), or `end` if the travel of the
/// axis does not allow that position.
double Machine::nearest_rotary_position(int joint, double end, double from) const {
  const auto& limits = canon_.options().control;
  const double turn = 2 * pi;
  double nearest = end + turn * std::round((from - end) / turn);
  if (!limits) return nearest;
  const kinematics::Joint& axis = limits->joints()[std::size_t(joint)];
  const double axis_end = nearest + canon_.frame().shift[joint];
  if (axis_end >= axis.min - 1e-9 && axis_end <= axis.max + 1e-9) return nearest;
  return end;
}

Target Machine::block_target(const MotionBlock& move) const {
  Target target;
  const AxisVector p = contour_.programmed();
  for (std::size_t i = 0; i < move.axes.size(); ++i) {
    if (!move.axes[i]) continue;
    const WordValue& word = *move.axes[i];
    const char letter = char('A' + i);
    if (letter >= 'X' && !move.in_machine_coordinates) require_certain_shift(word.cause);
    const int j = canon_.joint_of(letter);
    if (move.in_machine_coordinates && word.is_incremental)
      throw_input_error(word.cause, "an absolute position with M91");
    if (word.is_incremental) target.by(j, word.value, word.cause);
    // The roll-over rule of the axis must not change the direction that M126 decides.
    else if (takes_shortest_rotation_ && !move.in_machine_coordinates && !canon_.is_linear(j))
      target.rotate_to(j, nearest_rotary_position(j, word.value, p[j]), word.cause);
    else
      target.to(j, word.value, word.cause);
  }
  return target;
}

/// Converts PR and PA to X and Y, or to the axes of the plane of the pole.
Machine::PolarEnd Machine::polar_end(const MotionBlock& move) const {
  require_pole(move.cause);
  require_certain_shift(move.cause);
  const AxisVector p = contour_.programmed();
  const auto pole_coordinate = [&](int j) {
    for (const char letter : {'X', 'Y', 'Z'})
      if (canon_.joint_of(letter) == j) return (*pole_)[std::size_t(letter - 'X')];
    return 0.0;
  };
  const auto [first, second] = pole_plane_;
  const Vector2d centre(pole_coordinate(first), pole_coordinate(second));
  const Vector2d from = Vector2d(p[first], p[second]) - centre;
  double radius = from.norm(), angle = std::atan2(from.y(), from.x());
  const double start = angle;
  if (move.pr) {
    // CP keeps the radius of its start, so a PR would contradict it.
    if (move.keyword == "CP")
      throw_input_error(move.pr->cause, "CP without PR: the radius is that of its start");
    radius = move.pr->value + (move.pr->is_incremental ? radius : 0.0);
  }
  if (move.pa) angle = move.pa->value + (move.pa->is_incremental ? angle : 0.0);
  double sweep = 0.0;
  if (move.keyword == "CP") {
    if (!move.pa) throw_input_error(move.cause, "PA or IPA with CP", "none");
    sweep = move.pa->is_incremental ? move.pa->value : angle - start;
    if (radius < position_tolerance)
      throw_input_error(move.cause, "a start away from the pole of CP");
  }
  const double turns = std::round((angle - start) / (2 * pi));
  // A full circle must end exactly at its start, or rounding would decide between a whole turn and
  // no motion.
  const bool is_full_circle =
      move.keyword == "CP" && std::abs(angle - start - 2 * pi * turns) < 1e-12;
  const Cause& cause = move.pa ? move.pa->cause : move.pr ? move.pr->cause : move.cause;
  Target target = block_target(move);
  if (target.has(first) || target.has(second))
    throw_input_error(cause, "PR and PA without coordinates of the same plane");
  target.to(first, is_full_circle ? p[first] : centre.x() + radius * std::cos(angle), cause);
  target.to(second, is_full_circle ? p[second] : centre.y() + radius * std::sin(angle), cause);
  return {std::move(target), sweep};
}

/// Executes the motion of a block, and its M functions before and after the motion.
void Machine::move(MotionBlock move) {
  const bool was_tip_mode = canon_.tip_mode();
  set_side(move);
  apply_functions_before_motion(move);
  // Tip coordinates must not change under compensation.
  if (canon_.tip_mode() != was_tip_mode && contour_.is_compensated())
    throw_input_error(move.cause, "R0 before M128");
  set_feed(move);
  const bool has_axis_word = std::any_of(move.axes.begin(), move.axes.end(),
                                         [](const auto& axis) { return axis.has_value(); });
  if (is_polar_move(move.keyword) || has_axis_word || move.keyword == "LN" ||
      (!move.keyword.empty() && is_arc(move.keyword))) {
    if (move.keyword.empty()) throw_input_error(move.cause, "L before axes");
    // Before the first TOOL CALL only rapids and M91 need no tool.
    if (!is_tool_called_ && move.feed_kind != FeedKind::Rapid && !move.in_machine_coordinates) {
      run_.assume_only_tool(move.cause, "no TOOL CALL");
      is_tool_called_ = true;
    }
    const auto [target, sweep] =
        is_polar_move(move.keyword) ? polar_end(move) : PolarEnd{block_target(move)};
    if (move.in_machine_coordinates && move.keyword != "L")
      throw_input_error(move.cause, "L with M91");
    if (move.keyword == "LN")
      make_vector_line(move);
    else if (move.keyword == "C" || move.keyword == "CP")
      make_arc(move, target, sweep);
    else if (move.keyword == "CR")
      make_radius_arc(move, target);
    else if (move.keyword == "CT" || move.keyword == "CTP")
      make_tangent_arc(move, target);
    else
      make_line(move, target);
  }
  apply_functions_after_motion(move);
}

/// Passes a move to the contour and keeps the direction of arrival for CT.
void Machine::add_element(ContourElement element, const MotionBlock& move, std::uint32_t stated) {
  element.cause = move.cause;
  element.is_rapid = move.feed_kind == FeedKind::Rapid;
  element.stated = stated;
  if (element.is_arc && element.is_rapid)
    throw_input_error(move.cause, "F for an arc: FMAX applies only to lines");
  // A machine without X and Y has no compensation and no corners, so it never uses the plane.
  const std::array<int, 2> plane{std::max(canon_.joint_of('X'), 0),
                                 std::max(canon_.joint_of('Y'), 0)};
  contour_.add(std::move(element), plane, move.before_corner);
}

void Machine::make_line(const MotionBlock& move, const Target& target) {
  if (move.in_machine_coordinates) return move_in_machine_coordinates(move, target);
  bool has_rotary_word = false;
  for (int j = 0; j < int(canon_.position().size()); ++j)
    has_rotary_word = has_rotary_word || (target.has(j) && !canon_.is_linear(j));
  // In a plane without M128 rotary words do not rotate the tool about its tip.
  if (has_rotary_word && plane_ && !is_tcpm_)
    return rotate_axes_in_plane(move, target, move.feed_kind == FeedKind::Rapid);
  const AxisVector start = contour_.programmed();
  add_element({.end = canon_.target_position_from(contour_.position(), target, false)}, move,
              target.stated());
  const AxisVector displacement = contour_.programmed() - start;
  Vector3d displacement_xyz = Vector3d::Zero();
  for (const char letter : {'X', 'Y', 'Z'})
    if (const int j = canon_.joint_of(letter); j >= 0)
      displacement_xyz[letter - 'X'] = displacement[j];
  if (displacement_xyz.norm() > position_tolerance) tangent_ = displacement_xyz.normalized();
}

/// Executes a line with M91, whose words are positions of the axes.
void Machine::move_in_machine_coordinates(const MotionBlock& move, const Target& target) {
  if (contour_.is_compensated()) throw_input_error(move.cause, "R0 before M91");
  if (move.before_corner) throw_input_error(move.cause, "no M91 before RND and CHF");
  canon_.go_to(Coordinates::Axis, move.cause);
  canon_.straight({canon_.end_of(target, true), move.cause, true, target.stated()},
                  move.feed_kind == FeedKind::Rapid);
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, move.cause);
  contour_.finish();
  tangent_.reset();
}

/// Executes rotary words in a tilted plane without M128: the axes move straight to their ends, and
/// slides without words stay.
void Machine::rotate_axes_in_plane(const MotionBlock& move, const Target& target, bool rapid) {
  bool has_slide_word = false;
  for (int j = 0; j < int(canon_.position().size()); ++j)
    has_slide_word = has_slide_word || (target.has(j) && canon_.is_linear(j));
  const AxisVector tip_end = canon_.end_of(target);
  AxisVector end = tip_end;
  const int x = joint_of('X', move.cause), y = joint_of('Y', move.cause),
            z = joint_of('Z', move.cause);
  canon_.go_to(Coordinates::Axis, move.cause);
  if (has_slide_word) {
    // Programmed X Y Z are the position of the tip at the end.
    const auto q =
        kinematics::solve_slides(chain(move.cause), tip_end, {tip_end[x], tip_end[y], tip_end[z]});
    if (!q)
      throw_input_error(move.cause, "a tip within the travel of the linear axes",
                        "a tip out of reach");
    end = *q;
  } else {
    for (const int j : {x, y, z}) end[j] = canon_.position()[j];
  }
  canon_.straight({std::move(end), move.cause}, rapid);
  canon_.go_to(Coordinates::Tip, move.cause);
  contour_.finish();
  tangent_.reset();
}

/// Executes LN, with or without a tool direction.
void Machine::make_vector_line(const MotionBlock& move) {
  const auto is_complete = [&](const std::array<std::optional<double>, 3>& v, const char* name) {
    const int count = int(v[0].has_value()) + int(v[1].has_value()) + int(v[2].has_value());
    if (count == 0) return false;
    if (count != 3) throw_input_error(move.cause, fmt::format("{0}X {0}Y {0}Z together", name));
    const double length = Vector3d(*v[0], *v[1], *v[2]).norm();
    // The length of vectors with three decimals is within a thousandth of 1.
    if (!(std::abs(length - 1.0) < 1e-3))
      throw_input_error(move.cause, fmt::format("{0}X {0}Y {0}Z of length 1", name),
                        fmt::format("{:.6g}", length));
    return true;
  };
  if (contour_.is_compensated()) throw_input_error(move.cause, "R0 before LN");
  is_complete(move.normal, "N");
  // DL and DR would shift the path along the surface normal.
  if (std::abs(extra_length_) > 0 || delta_radius_ != 0)
    throw_input_error(move.cause, "DL 0 and DR 0 with LN: no compensation along the normal",
                      "other values");
  const Target target = block_target(move);
  AxisVector end = canon_.target_position_from(contour_.position(), target, false);
  std::uint32_t stated = target.stated();
  if (is_complete(move.direction, "T")) {
    if (!is_tcpm_) throw_input_error(move.cause, "M128 or FUNCTION TCPM before TX TY TZ");
    for (int j = 0; j < int(end.size()); ++j)
      if (target.has(j) && !canon_.is_linear(j))
        throw_input_error(target.cause(j), "either TX TY TZ or positions of rotary axes");
    const Vector3d t(*move.direction[0], *move.direction[1], *move.direction[2]);
    // The direction counts in the plane; the axes are solved for the workpiece.
    const AxisVector q = nearest_axes(rotation() * t.normalized(), move.cause);
    for (int j = 0; j < int(end.size()); ++j)
      if (!canon_.is_linear(j) &&
          canon_.options().axes[std::size_t(j)].motion == kinematics::Motion::Rotary) {
        end[j] = q[j];
        stated |= 1u << j;
      }
  }
  add_element({.end = std::move(end)}, move, stated);
  tangent_.reset();
}

/// Executes C about the pole, and CP by an angle.
void Machine::make_arc(const MotionBlock& move, const Target& target, double sweep) {
  require_pole(move.cause);
  if (!move.is_clockwise) throw_input_error(move.cause, "DR+ or DR-", "none");
  ContourElement element{.is_arc = true,
                         .end = canon_.target_position_from(contour_.position(), target, false),
                         .first = pole_plane_[0],
                         .second = pole_plane_[1],
                         .is_clockwise = *move.is_clockwise};
  if (move.keyword == "CP") {
    const bool is_incremental = move.pa->is_incremental;
    // IPA and DR both state the sign.
    if (is_incremental && sweep != 0 && (sweep < 0) != *move.is_clockwise)
      throw_input_error(move.pa->cause, "IPA with the sign of DR");
    // 1e-9 turns absorb rounding, so that 720 degrees are two turns and not three.
    element.turn_count =
        is_incremental ? std::max(1, int(std::ceil(std::abs(sweep) / (2 * pi) - 1e-9))) : 1;
    if (element.turn_count > 100000) throw_input_error(move.pa->cause, "at most 1e5 turns");
  }
  AxisVector centre = contour_.programmed();
  for (const char letter : {'X', 'Y', 'Z'})
    if (const int j = canon_.joint_of(letter); j == pole_plane_[0] || j == pole_plane_[1])
      centre[j] = (*pole_)[std::size_t(letter - 'X')];
  const AxisVector end = canon_.without_offsets(element.end);
  const Vector2d radial = Vector2d(end[element.first], end[element.second]) -
                          Vector2d(centre[element.first], centre[element.second]);
  element.centre = canon_.placed(centre);
  add_element(std::move(element), move, target.stated());
  store_arrival_direction(pole_plane_, radial, *move.is_clockwise);
}

// Arcs without a pole, and corners.

namespace {
constexpr double min_length = 1e-9;  // mm
}

/// Stores the direction in which an arc arrives. `radial` points from its centre to its end, mm.
void Machine::store_arrival_direction(const std::array<int, 2>& plane, const Vector2d& radial,
                                      bool clockwise) {
  if (radial.norm() < min_length) return tangent_.reset();
  const Vector2d d =
      clockwise ? Vector2d(radial.y(), -radial.x()) : Vector2d(-radial.y(), radial.x());
  Vector3d tangent = Vector3d::Zero();
  for (const char letter : {'X', 'Y', 'Z'}) {
    if (canon_.joint_of(letter) == plane[0]) tangent[letter - 'X'] = d.x();
    if (canon_.joint_of(letter) == plane[1]) tangent[letter - 'X'] = d.y();
  }
  tangent_ = tangent.normalized();
}

/// Executes CT in X Y and CTP in the plane of the pole: an arc that continues the last move without
/// a corner.
void Machine::make_tangent_arc(const MotionBlock& move, const Target& target) {
  if (!tangent_)
    throw_input_error(move.cause, "a line or arc before CT, to which it is tangential", "none");
  const auto [first, second] = move.keyword == "CTP" ? pole_plane_ : working_plane(move.cause);
  const AxisVector p = contour_.programmed();
  AxisVector end = canon_.target_position_from(contour_.position(), target, false);
  const AxisVector programmed_end = canon_.without_offsets(end);
  Vector2d t = Vector2d::Zero();
  for (const char letter : {'X', 'Y', 'Z'}) {
    if (canon_.joint_of(letter) == first) t.x() = (*tangent_)[letter - 'X'];
    if (canon_.joint_of(letter) == second) t.y() = (*tangent_)[letter - 'X'];
  }
  const Vector2d start(p[first], p[second]),
      chord = Vector2d(programmed_end[first], programmed_end[second]) - start;
  if (t.norm() < 1e-9)
    throw_input_error(move.cause, "a move in the plane before CT", "a move perpendicular to it");
  if (chord.norm() < min_length)
    throw_input_error(move.cause, "an end of CT that differs from its start");
  t.normalize();
  const Vector2d left(-t.y(), t.x());
  const double offset = left.dot(chord);
  // An end straight ahead makes the arc a line; no arc reaches an end straight back.
  if (std::abs(offset) < 1e-9 * chord.norm()) {
    if (t.dot(chord) < 0)
      throw_input_error(move.cause, "an end of CT that an arc can reach",
                        "an end straight behind the start");
    return make_line(move, target);
  }
  const double radius = chord.squaredNorm() / (2 * offset);  // to the left if positive
  const Vector2d centre = start + radius * left;
  ContourElement element{.is_arc = true,
                         .end = std::move(end),
                         .first = first,
                         .second = second,
                         .is_clockwise = radius < 0};
  AxisVector programmed_centre = p;
  programmed_centre[first] = centre.x();
  programmed_centre[second] = centre.y();
  element.centre = canon_.placed(programmed_centre);
  const Vector2d radial = Vector2d(programmed_end[first], programmed_end[second]) - centre;
  add_element(std::move(element), move, target.stated());
  store_arrival_direction({first, second}, radial, radius < 0);
}

/// Executes CR in X Y, or in the two axes that the block names.
void Machine::make_radius_arc(const MotionBlock& move, const Target& target) {
  if (!move.radius) throw_input_error(move.cause, "R with CR", "none");
  if (!move.is_clockwise) throw_input_error(move.cause, "DR+ or DR-", "none");
  auto plane = working_plane(move.cause);
  if (const int z = canon_.joint_of('Z'); z >= 0 && target.has(z)) {
    if (target.has(plane[0]) && !target.has(plane[1])) plane = {z, plane[0]};
    if (!target.has(plane[0]) && target.has(plane[1]) && plane[0] != z) plane = {plane[1], z};
  }
  ContourElement element{.is_arc = true,
                         .end = canon_.target_position_from(contour_.position(), target, false),
                         .first = plane[0],
                         .second = plane[1],
                         .radius = move.radius->value,
                         .is_clockwise = *move.is_clockwise};
  const AxisVector p = contour_.programmed(), end = canon_.without_offsets(element.end);
  program::ArcGeometry geometry{
      {p[plane[0]], p[plane[1]]}, {end[plane[0]], end[plane[1]]}, {}, *move.is_clockwise};
  geometry.centre =
      program::centre_by_radius(geometry, move.radius->value, canon_.place(), move.radius->cause);
  const Vector2d radial = geometry.end - geometry.centre;
  add_element(std::move(element), move, target.stated());
  store_arrival_direction(plane, radial, *move.is_clockwise);
}

/// Executes RND and CHF, for example RND R5 or CHF 2. F is a feed of the corner alone.
void Machine::execute_corner(const std::string& keyword, WordReader& words) {
  const Cause cause{1, keyword == "RND" ? "RND" : "CHF"};
  std::optional<program::Feed> feed;
  std::optional<double> size;
  while (!words.at_end()) {
    const std::size_t from = words.cursor.at;
    const std::string name = words.read_name();
    if (name.starts_with('F')) {
      const FeedValue value = read_feed(name.substr(1), words, from);
      if (value.kind == FeedKind::Rapid || value.kind == FeedKind::PerRevolution)
        words.throw_input_error(from, "a feed per minute for a corner");
      feed = program::Feed{value.value, canon_.inch() ? 0.1 * units::inch : 1.0};
    } else if (!size && name == (keyword == "RND" ? "R" : "")) {
      size = words.read_value() * unit();
    } else {
      words.throw_input_error(from,
                              keyword == "RND" ? "R and F after RND" : "a length and F after CHF");
    }
  }
  working_plane(cause);
  if (!size)
    throw_input_error(cause, keyword == "RND" ? "R after RND" : "a length after CHF", "none");
  contour_.add_corner(keyword == "RND", *size, feed, cause);
}

}  // namespace abbe::sim::dialects::heidenhain
