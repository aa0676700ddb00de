#include "sim/dialects/linuxcnc/linuxcnc.h"

namespace abbe::sim::dialects::linuxcnc {

using Eigen::Vector2d;

// Under G91 radius and angle are increments of the current polar position.
Eigen::Vector2d Machine::polar_end(const Block& block, const Eigen::Vector2d& from) const {
  const Word &r = block['@'], &a = block['^'];
  double radius = from.norm(), angle = std::atan2(from.y(), from.x()) / units::deg;
  if (r) radius = r.value * unit() + (is_incremental_ ? radius : 0.0);
  if (a) angle = a.value + (is_incremental_ ? angle : 0.0);
  return {radius * std::cos(angle * units::deg), radius * std::sin(angle * units::deg)};
}

Target Machine::block_target(const Block& block, bool in_machine_coordinates) const {
  Target target;
  for (int k = 0; k < 9; ++k) {
    const Word& word = block[axis_letters[std::size_t(k)]];
    if (!word) continue;
    const int j = joint(k);
    const double value = axis_word(k, word) * (canon_.is_linear(j) ? 1.0 : units::deg);
    if (is_incremental_ && !in_machine_coordinates)
      target.by(j, value, word);
    else
      target.to(j, value, word);
  }
  if (block.is_polar()) {
    const AxisVector p = programmed_position();
    const Eigen::Vector2d end = polar_end(block, {p[joint(0)], p[joint(1)]});
    const Word& word = block['@'] ? block['@'] : block['^'];
    target.to(joint(0), end.x(), word);
    target.to(joint(1), end.y(), word);
  }
  return target;
}

void Machine::straight(const Block& block, AxisVector end, std::uint32_t stated_axes,
                       bool in_machine_coordinates) {
  Straight move{std::move(end), motion_cause(block), in_machine_coordinates, stated_axes};
  if (compensation_.is_on()) {
    if (in_machine_coordinates) throw_input_error(move.cause, "G40 before G53");
    return compensation_.straight(std::move(move), motion_ == 0);
  }
  canon_.straight(std::move(move), motion_ == 0);
}

void Machine::arc(const Block& block, AxisVector end, std::uint32_t stated_axes) {
  const bool is_compensated = compensation_.is_on();
  ArcMove arc = program::arc_from_block(
      canon_, {.plane = plane_,
               .clockwise = motion_ == 20,
               .absolute_centre = has_absolute_centre_,
               .from = is_compensated ? compensation_.programmed() : canon_.position(),
               .end = std::move(end),
               .cause = motion_cause(block),
               .stated = stated_axes,
               .word = [&](char letter) -> std::optional<program::LengthValue> {
                 const Word& word = block[letter];
                 if (!word) return std::nullopt;
                 return program::LengthValue{word.value * unit(), word};
               }});
  if (const Word& turns = block['P']) {
    if (!(turns.value >= 1 && turns.value <= 1e6) || turns.value != std::floor(turns.value))
      throw_input_error(turns, "an integer from 1 to 1e6 (turns) after P");
    arc.turns = int(turns.value);
  }
  if (is_compensated) return compensation_.arc(std::move(arc));
  canon_.arc(std::move(arc));
}

void Machine::make_synchronised_line(const Block& block, AxisVector end) {
  const Cause cause = motion_cause(block);
  const Word& k = block['K'];
  if (!k || k.value == 0)
    throw_input_error(k ? Cause(k) : cause, "K (pitch) with G33", k ? "0" : "none");
  // K alone sets the pitch in both directions.
  if (block['I']) throw_input_error(block['I'], "no I with G33.1: the return has the same speed");
  const AxisVector start = canon_.position();
  const TemporaryFeed pitch(canon_, FeedMode::PerRevolution, Feed{std::abs(k.value), unit()});
  canon_.straight({.end = std::move(end), .cause = cause}, false);
  if (motion_ != 331) return;
  const int direction = canon_.spindle_direction();
  // Rigid tapping (G33.1) returns at the same pitch with the spindle reversed.
  canon_.turn_spindle(-direction);
  AxisVector return_end = canon_.position();
  for (int axis = 0; axis < 9; ++axis)
    if (const int j = joint(axis); j >= 0) return_end[j] = start[j];
  canon_.straight({.end = std::move(return_end), .cause = cause}, false);
  canon_.turn_spindle(direction);
}

void Machine::move(const Block& block) {
  const Word* axis = first_axis_word(block);
  const bool is_arc = motion_ == 20 || motion_ == 30;
  const bool has_arc_words = block['I'] || block['J'] || block['K'] || block['R'];
  if (motion_ == 52 || motion_ == 53 || motion_ == 50 || motion_ == 51) {
    if (axis || block[Group::Motion]) execute_spline(block);
    return;
  }
  // G76 is not modal, so it acts only in the block that contains it.
  if (motion_ == 760) {
    if (block[Group::Motion]) execute_thread(block);
    return;
  }
  if (!axis && !(is_arc && has_arc_words)) return;
  if (motion_ == 730 || motion_ == 740 || (motion_ >= 810 && motion_ <= 890))
    return execute_cycle(block);
  const Cause cause = motion_cause(block);
  const bool in_machine_coordinates = block.tenths(Group::OneShot) == 530;
  if (in_machine_coordinates) canon_.go_to(Coordinates::Axis, cause);
  const Target target = block_target(block, in_machine_coordinates);
  AxisVector end =
      canon_.target_position_from(in_machine_coordinates ? canon_.position() : current_position(),
                                  target, in_machine_coordinates);
  // The first move after G40 leads from the offset position to the path; an arc between these
  // points would have no centre.
  if (compensation_.is_leaving() && is_arc)
    throw_input_error(cause, "a straight line as the first move after G40");
  compensation_.clear_leaving();
  if (is_arc)
    arc(block, std::move(end), target.stated());
  else if (motion_ == 330 || motion_ == 331)
    make_synchronised_line(block, std::move(end));
  else
    straight(block, std::move(end), target.stated(), in_machine_coordinates);
  if (in_machine_coordinates && canon_.tip_mode()) canon_.go_to(Coordinates::Tip, cause);
}

namespace {

constexpr double max_chord_error = 1e-4;  // mm, of a spline
constexpr double max_chords = 1e6;        // of one spline
// 65536 chords of one span.
constexpr int max_halvings = 16;
// Bounds the memory that G5.2 blocks take.
constexpr std::size_t max_poles = 10000;

/// A rational B-spline with uniform knots, clamped at both ends.
struct Spline {
  std::vector<Eigen::Vector3d> poles;  ///< homogeneous coordinates: x w, y w, w
  std::vector<double> knots;
  int order = 3;

  // De Boor's algorithm in homogeneous coordinates.
  Vector2d at(double u) const {
    const int degree = order - 1, n = int(poles.size());
    int span = degree;
    while (span < n - 1 && u >= knots[std::size_t(span + 1)]) ++span;
    std::vector<Eigen::Vector3d> control_points(poles.begin() + span - degree,
                                                poles.begin() + span + 1);
    for (int r = 1; r <= degree; ++r)
      for (int j = degree; j >= r; --j) {
        const double low = knots[std::size_t(span - degree + j)];
        const double high = knots[std::size_t(span + 1 + j - r)];
        const double a = (u - low) / (high - low);
        control_points[std::size_t(j)] =
            (1 - a) * control_points[std::size_t(j - 1)] + a * control_points[std::size_t(j)];
      }
    const Eigen::Vector3d& p = control_points[std::size_t(degree)];
    return {p.x() / p.z(), p.y() / p.z()};
  }
};

// Returns the distance to the chord, not to the infinite line through it.
double distance_to_chord(const Vector2d& p, const Vector2d& a, const Vector2d& b) {
  const Vector2d chord = b - a;
  const double squared_length = chord.squaredNorm();
  const double t =
      squared_length > 0 ? std::clamp((p - a).dot(chord) / squared_length, 0.0, 1.0) : 0.0;
  return (p - a - t * chord).norm();
}

/// Appends the ends of the chords of a section of the spline. The section is halved until its
/// quarter points are within the chord error of its chord.
void append_chords(const Spline& spline, double from, double to, int halvings,
                   std::vector<Vector2d>& points) {
  const Vector2d a = spline.at(from), b = spline.at(to);
  double deviation = 0.0;
  for (const double fraction : {0.25, 0.5, 0.75})
    deviation =
        std::max(deviation, distance_to_chord(spline.at(from + fraction * (to - from)), a, b));
  // The caller reports an error if there are too many chords.
  const bool is_limit_reached = double(points.size()) > max_chords;
  // At least two halvings, because the quarter points of a symmetric S lie near its chord. Half of
  // the tolerance, because three points may miss the largest deviation.
  if ((halvings >= 2 && deviation <= 0.5 * max_chord_error) || halvings == max_halvings ||
      is_limit_reached) {
    points.push_back(b);
    return;
  }
  const double middle = 0.5 * (from + to);
  append_chords(spline, from, middle, halvings + 1, points);
  append_chords(spline, middle, to, halvings + 1, points);
}

/// Returns the ends of the chords of a cubic Bezier curve; n of them deviate by at most |B''| / 8
/// n^2.
std::vector<Vector2d> bezier_points(const std::array<Vector2d, 4>& p) {
  const double max_second_derivative =
      6 * std::max((p[0] - 2 * p[1] + p[2]).norm(), (p[1] - 2 * p[2] + p[3]).norm());
  const int n = int(std::clamp(std::ceil(std::sqrt(max_second_derivative / (8 * max_chord_error))),
                               1.0, max_chords));
  std::vector<Vector2d> points;
  for (int i = 1; i <= n; ++i) {
    const double u = double(i) / n, v = 1 - u;
    points.push_back(v * v * v * p[0] + 3 * v * v * u * p[1] + 3 * v * u * u * p[2] +
                     u * u * u * p[3]);
  }
  return points;
}

// Returns the ends of the chords of a B-spline. Clamped knots make it begin at the first pole and
// end at the last.
std::vector<Vector2d> nurbs_points(std::vector<Eigen::Vector3d> poles, int order) {
  Spline spline{std::move(poles), {}, order};
  const int n = int(spline.poles.size());
  for (int i = 0; i < n + order; ++i)
    spline.knots.push_back(std::clamp(double(i - order + 1), 0.0, double(n - order + 1)));
  std::vector<Vector2d> points;
  for (int i = 0; i < n - order + 1; ++i) append_chords(spline, i, i + 1, 0, points);
  return points;
}

}  // namespace

/// Executes G5, G5.1, G5.2 and G5.3, in X Y.
void Machine::execute_spline(const Block& block) {
  const Cause cause = motion_cause(block);
  if (compensation_.is_on()) throw_input_error(cause, "G40 before a spline");
  if (plane_ != 17) throw_input_error(cause, "G17 before a spline");
  const int x = joint(0), y = joint(1);
  if (x < 0 || y < 0) throw_input_error(cause, "a machine with X and Y for a spline");
  for (int k = 2; k < 9; ++k)
    if (const Word& word = block[axis_letters[std::size_t(k)]])
      throw_input_error(word, "only X and Y with a spline");
  AxisVector position = canon_.programmed();
  const Vector2d start(position[x], position[y]);
  const auto length = [&](char letter) { return block[letter].value * unit(); };
  Vector2d end = start;
  if (block['X']) end.x() = axis_word(0, block['X']) + (is_incremental_ ? start.x() : 0.0);
  if (block['Y']) end.y() = axis_word(1, block['Y']) + (is_incremental_ ? start.y() : 0.0);
  std::vector<Vector2d> points;
  if (motion_ == 50) {
    if (!block['P'] || !block['Q']) throw_input_error(cause, "P and Q with G5", "none");
    if (!block['I'] != !block['J'])
      throw_input_error(cause, "both I and J with G5, or neither", "one");
    if (!block['I'] && !spline_arm_) throw_input_error(cause, "I and J in the first G5", "none");
    // Without I and J the arm mirrors that of the previous G5, so that the tangent is continuous.
    const Vector2d arm = block['I'] ? Vector2d(length('I'), length('J')) : Vector2d(-*spline_arm_);
    spline_arm_ = Vector2d(length('P'), length('Q'));
    points = bezier_points({start, start + arm, end + *spline_arm_, end});
  } else if (motion_ == 51) {
    if (!block['I'] || !block['J']) throw_input_error(cause, "both I and J with G5.1");
    const Vector2d middle = start + Vector2d(length('I'), length('J'));
    // A quadratic Bezier curve equals a cubic one with arms of two thirds.
    points = bezier_points(
        {start, start + 2.0 / 3 * (middle - start), end + 2.0 / 3 * (middle - end), end});
  } else if (motion_ == 52) {
    if (is_incremental_) throw_input_error(cause, "G90 with G5.2");
    if (const Word& l = block['L']) order_ = whole_number(l, 20);
    if (order_ < 2) throw_input_error(block['L'], "an order from 2 to 20 after L");
    const Word& p = block['P'];
    if (!p || !(p.value > 0))
      throw_input_error(p ? Cause(p) : cause, "P (weight) greater than zero with G5.2");
    if (poles_.size() == max_poles)
      throw_input_error(cause, "at most 10000 poles of a spline", "more");
    poles_.push_back({end.x(), end.y(), p.value});
    // G5.2 only collects poles; G5.3 makes the curve.
    return;
  } else {
    if (int(poles_.size()) < order_)
      throw_input_error(cause, fmt::format("at least {} poles before G5.3", order_),
                        fmt::format("{}", poles_.size()));
    std::vector<Eigen::Vector3d> poles;
    for (const Pole& pole : poles_)
      poles.emplace_back(pole.x * pole.weight, pole.y * pole.weight, pole.weight);
    // A straight line leads to the first pole, where the curve begins.
    points.emplace_back(poles_.front().x, poles_.front().y);
    for (const Vector2d& point : nurbs_points(std::move(poles), order_)) points.push_back(point);
    poles_.clear();
    motion_ = -1;
  }
  if (double(points.size()) > max_chords)
    throw_input_error(cause, fmt::format("at most {:.0f} chords in a spline", max_chords), "more");
  // The number of moves is checked first, so that too many of them take no memory.
  run_.check_moves(double(points.size()), cause);
  for (const Vector2d& point : points) {
    position[x] = point.x();
    position[y] = point.y();
    move_to(position, false);
  }
}

namespace {
// mm (0.01 inch), height above the last depth to which the tool returns
constexpr double peck_clearance = 0.254;
// Bounds the number of moves in a hole whose Q is far below any chip thickness.
constexpr double max_pecks = 1e5;

// Steps of the cycles from the bottom of a hole on: d dwell, s spindle stop, v spindle reversed, o
// spindle as before, R feed to R, c and C rapid and feed to the level at which the tool leaves.
constexpr gcode::CodeLetters hole_steps[] = {{730, "c"},  {740, "vdCo"}, {810, "c"},
                                             {820, "dc"}, {830, "c"},    {840, "vdCo"},
                                             {850, "Rc"}, {860, "dsco"}, {890, "dC"}};
}  // namespace

/// Moves to a point in program coordinates.
void Machine::move_to(const AxisVector& end, bool rapid) {
  canon_.straight({.end = canon_.placed(end), .cause = {1, {}}}, rapid);
}

/// Executes a canned cycle. If its first block has an error, later blocks of the cycle report none.
void Machine::execute_cycle(const Block& block) {
  if (!cycle_.has_begun && !block[Group::Motion])
    run_.require_certain("cycle", motion_cause(block));
  run_.define("cycle", [&] { read_cycle_words(block); });
}

/// Reads the words of a cycle and makes its holes. Words missing from a block keep their values.
void Machine::read_cycle_words(const Block& block) {
  const Cause cause = motion_cause(block);
  if (compensation_.is_on()) throw_input_error(cause, "G40 before a canned cycle");
  // Under inverse time each move would need a separate F.
  if (canon_.feed_mode() == FeedMode::InverseTime)
    throw_input_error(cause, "G94 or G95 with a cycle");
  const int depth_axis = plane_normal();
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) throw_input_error(cause, "a machine with X Y Z for a canned cycle");
  for (int k = 3; k < 9; ++k)
    if (const Word& word = block[axis_letters[std::size_t(k)]])
      throw_input_error(word, "X Y Z with a canned cycle");
  const char depth_letter = axis_letters[std::size_t(depth_axis)];
  const Word &r = block['R'], &z = block[depth_letter], &q = block['Q'], &p = block['P'];
  if (!cycle_.has_begun && (!r || !z))
    throw_input_error(cause, fmt::format("{} and R in the first block of a cycle", depth_letter),
                      "none");
  if (r) cycle_.r = r.value * unit();
  if (z) cycle_.z = axis_word(depth_axis, z);
  const bool pecks = motion_ == 730 || motion_ == 830;
  if (q && !pecks) throw_input_error(q, "no Q in this cycle");
  if (q) cycle_.q = q.value * unit();
  if (pecks && !(cycle_.q > 0))
    throw_input_error(q ? Cause(q) : cause, "Q (depth of a peck) greater than zero");
  if (p) cycle_.p = p.value;
  // The dwell of G82, G86 and G89 must be stated once.
  if (!cycle_.has_begun && !p && (motion_ == 820 || motion_ == 860 || motion_ == 890))
    throw_input_error(cause, fmt::format("P (seconds) in the first block of G{}", motion_ / 10),
                      "none");
  if (!(cycle_.p >= 0 && cycle_.p <= 1e6)) throw_input_error(p, "0 to 1e6 seconds after P");
  if (const Word& l = block['L'];
      l && (l.value < 1 || l.value > 1e6 || l.value != std::floor(l.value)))
    throw_input_error(l, "an integer from 1 to 1e6 (repeats) after L");
  const int direction = canon_.spindle_direction();
  // LinuxCNC does not start the spindle, so it must already turn in the direction of the tap.
  if ((motion_ == 840 && direction != 1) || (motion_ == 740 && direction != -1))
    throw_input_error(cause, motion_ == 840 ? "M3 before G84" : "M4 before G74");
  if (motion_ == 860 && direction == 0) throw_input_error(cause, "a running spindle before G86");
  cycle_.has_begun = true;
  make_holes(block);
}

void Machine::make_holes(const Block& block) {
  const int depth_axis = plane_normal();
  const int depth_joint = joint(depth_axis);
  AxisVector position = canon_.programmed();
  // G98 returns to the level at which the first cycle began.
  if (!cycle_.initial) cycle_.initial = position[depth_joint];
  const double initial = *cycle_.initial;
  const double r = is_incremental_ ? cycle_.r + initial : cycle_.r;
  const double bottom = is_incremental_ ? r + cycle_.z : cycle_.z;
  if (r < bottom)
    throw_input_error(block['R'] ? Cause(block['R']) : motion_cause(block),
                      "R above the bottom of the hole",
                      fmt::format("R at {} mm, the bottom at {} mm", r, bottom));
  // A tool below R first rises to R before it moves sideways.
  if (initial < r) {
    position[depth_joint] = r;
    move_to(position, true);
  }
  const double clearance_level = returns_to_r_ ? r : std::max(initial, r);
  // The tool moves to the first hole at the current level, under G98 and G99 alike.
  double level = std::max(position[depth_joint], r);
  const int repeats = block['L'] ? int(block['L'].value) : 1;
  const bool pecks = motion_ == 730 || motion_ == 830;
  // Moves of a hole: to its position, to R, to the bottom, back; each peck adds up to three.
  constexpr double moves_per_hole = 4.0, moves_per_peck = 3.0;  // at most
  run_.check_moves(
      repeats * (moves_per_hole + (pecks ? moves_per_peck * (r - bottom) / cycle_.q : 0.0)),
      motion_cause(block));
  for (int n = 0; n < repeats; ++n) {
    run_.count_block();
    for (int k = 0; k < 3; ++k) {
      const Word& word = block[axis_letters[std::size_t(k)]];
      if (k == depth_axis || !word) continue;
      double& coordinate = position[joint(k)];
      coordinate = is_incremental_ ? coordinate + axis_word(k, word) : axis_word(k, word);
    }
    if (block.is_polar()) {
      const Eigen::Vector2d end = polar_end(block, {position[joint(0)], position[joint(1)]});
      position[joint(0)] = end.x();
      position[joint(1)] = end.y();
    }
    position[depth_joint] = level;
    move_to(position, true);
    position[depth_joint] = r;
    move_to(position, true);
    make_hole({position, depth_joint, r, bottom, clearance_level});
    level = clearance_level;
  }
}

/// Makes one hole from R down and out again.
void Machine::make_hole(const Hole& hole) {
  AxisVector position = hole.position;
  const auto move_to_level = [&](double level, bool rapid) {
    position[hole.depth_joint] = level;
    move_to(position, rapid);
  };
  if (motion_ == 730 || motion_ == 830) {
    if ((hole.r - hole.bottom) / cycle_.q > max_pecks)
      throw_input_error({1, {}}, "at most 1e5 pecks in a hole", "more");
    for (double depth = hole.r - cycle_.q; depth > hole.bottom; depth -= cycle_.q) {
      move_to_level(depth, false);
      // G83 clears the chips at R; G73 only breaks them by the clearance.
      if (motion_ == 830) move_to_level(hole.r, true);
      move_to_level(depth + peck_clearance, true);
    }
  }
  move_to_level(hole.bottom, false);
  const int direction = canon_.spindle_direction();
  for (const char step : gcode::letters_of_code(hole_steps, motion_)) {
    if (step == 'd') canon_.dwell(cycle_.p, {1, {}});
    if (step == 's') canon_.turn_spindle(0);
    if (step == 'v') canon_.turn_spindle(-direction);
    if (step == 'o') canon_.turn_spindle(direction);
    if (step == 'R') move_to_level(hole.r, false);
    if (step == 'c' || step == 'C') move_to_level(hole.clearance_level, step == 'c');
  }
}

namespace {

/// Words of G76, mm and degrees.
struct Thread {
  double pitch = 0.0, z_end = 0.0, peak = 0.0, first_cut = 0.0, height = 0.0;
  double degression = 1.0, slide_angle = 0.0, taper = 0.0;
  int spring_passes = 0;
  bool has_entry_taper = false, has_exit_taper = false;
};

}  // namespace

/// Executes the passes of a thread, in program coordinates of X and Z.
class ThreadPasses {
 public:
  ThreadPasses(Machine& machine, const Thread& thread)
      : machine_(machine),
        thread_(thread),
        position_(machine.canon_.programmed()),
        x_joint_(machine.joint(0)),
        z_joint_(machine.joint(2)),
        x_start_(position_[x_joint_]),
        z_start_(position_[z_joint_]) {}

  void cut() {
    // Depths are measured from the drive line, the X of the start.
    const double peak_depth = std::abs(thread_.peak);
    const double full_depth = std::abs(thread_.height) + peak_depth;
    double depth = peak_depth + thread_.first_cut;
    // The depth of pass n is that of the first one times n^(1/R). With R = 1 all cuts have equal
    // depth, with R = 2 equal area.
    for (int n = 1; depth < full_depth;) {
      machine_.run_.count_block();
      make_pass(depth, full_depth);
      depth = peak_depth + thread_.first_cut * std::pow(++n, 1.0 / thread_.degression);
    }
    // Spring passes repeat the full depth.
    for (int n = 0; n <= thread_.spring_passes; ++n) make_pass(full_depth, full_depth);
    move_to(x_start_, thread_.z_end, true);
  }

 private:
  void move_to(double x, double z, bool rapid) {
    position_[x_joint_] = x;
    position_[z_joint_] = z;
    machine_.move_to(position_, rapid);
  }
  void feed(double per_revolution, double x, double z) {
    machine_.canon_.set_feed(program::Feed{per_revolution, 1.0});
    move_to(x, z, false);
  }
  // The infeed follows the angle Q of the compound slide, so deeper passes begin further back along
  // Z.
  void make_pass(double depth, double full_depth) {
    const double side = thread_.peak > 0 ? 1.0 : -1.0;
    const double tangent = std::tan(thread_.slide_angle * units::deg);
    const double z_offset = (depth - std::abs(thread_.peak)) * tangent;
    const double z_pass_start = z_start_ - z_offset,
                 z_end = thread_.z_end + thread_.height * tangent - z_offset;
    const double x_safe = x_start_ - side * (full_depth - depth), x_cut = x_start_ + side * depth;
    const double x_out = x_cut - side * thread_.height;
    // The sign of the taper follows the direction of the thread along Z.
    const double taper = thread_.z_end > z_start_ ? -thread_.taper : thread_.taper;
    // The pitch along Z must stay constant on the taper, so the feed per revolution is the pitch
    // times taper length / taper length along Z.
    const double taper_pitch =
        thread_.taper > 0
            ? thread_.pitch * std::hypot(thread_.taper, thread_.height) / thread_.taper
            : thread_.pitch;
    move_to(x_safe, z_pass_start, true);
    if (thread_.has_entry_taper) {
      feed(taper_pitch, x_out, z_pass_start);
      feed(taper_pitch, x_cut, z_pass_start - taper);
    } else {
      move_to(x_cut, z_pass_start, true);
    }
    feed(thread_.pitch, x_cut, thread_.has_exit_taper ? z_end + taper : z_end);
    if (thread_.has_exit_taper) feed(taper_pitch, x_out, z_end);
    move_to(x_safe, z_end, true);
  }

  Machine& machine_;
  const Thread& thread_;
  AxisVector position_;
  int x_joint_, z_joint_;
  double x_start_, z_start_;
};

void Machine::execute_thread(const Block& block) {
  const Cause cause = motion_cause(block);
  if (compensation_.is_on()) throw_input_error(cause, "G40 before G76");
  if (plane_ != 18) throw_input_error(cause, "G18 before G76");
  if (joint(0) < 0 || joint(2) < 0) throw_input_error(cause, "a machine with X and Z for G76");
  for (const char letter : {'P', 'Z', 'I', 'J', 'K'})
    if (!block[letter]) throw_input_error(cause, fmt::format("{} with G76", letter), "none");
  const auto positive = [&](char letter) {
    if (!(block[letter].value > 0))
      throw_input_error(block[letter], fmt::format("{} greater than zero", letter));
    return block[letter].value * unit();
  };
  // Under G7, I J K are diameters.
  const double factor = is_diameter_mode_ ? 0.5 : 1.0;
  Thread thread;
  thread.pitch = positive('P');
  thread.first_cut = factor * positive('J');
  thread.height = factor * positive('K');
  thread.peak = factor * block['I'].value * unit();
  thread.z_end = axis_word(2, block['Z']) + (is_incremental_ ? programmed(2) : 0.0);
  if (const Word& r = block['R']) thread.degression = r.value;
  if (thread.degression < 1 || thread.degression > 100)
    throw_input_error(block['R'], "R from 1 to 100");
  if (const Word& q = block['Q']) thread.slide_angle = q.value;
  if (thread.slide_angle < 0 || thread.slide_angle > 80)
    throw_input_error(block['Q'], "Q from 0 to 80 degrees");
  if (const Word& h = block['H']) thread.spring_passes = whole_number(h, 1000);
  const int tapers = block['L'] ? whole_number(block['L'], 3) : 0;
  thread.has_entry_taper = tapers % 2 == 1;
  thread.has_exit_taper = tapers >= 2;
  if (tapers > 0) {
    if (!block['E']) throw_input_error(cause, "E (length of the taper) with L", "none");
    thread.taper = positive('E');
  }
  const FeedMode mode = canon_.feed_mode();
  const auto feed = canon_.feed();
  canon_.set_feed_mode(FeedMode::PerRevolution);
  ThreadPasses(*this, thread).cut();
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed);
}

int Machine::whole_number(const Word& word, int max) const {
  if (word.value < 0 || word.value > max || word.value != std::floor(word.value))
    throw_input_error(word, fmt::format("an integer from 0 to {}", max));
  return int(word.value);
}

}  // namespace abbe::sim::dialects::linuxcnc
