#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/units.h"
#include "sim/dialects/linuxcnc/machine.h"
#include "sim/program/nc_reader.h"

namespace abbe::sim::dialects::linuxcnc {

using Eigen::Vector2d;
using program::ArcMove;
using program::Coordinates;
using program::Feed;
using program::FeedMode;
using program::Straight;

// Under G91 radius and angle are increments of the current polar position.
Eigen::Vector2d Machine::polar_end(const Block& block, const Eigen::Vector2d& from) const {
  const NcWord &r = block.radius(), &a = block.angle();
  double radius = from.norm(), angle = std::atan2(from.y(), from.x()) / units::deg;
  if (r) radius = r.value * unit() + (incremental_ ? radius : 0.0);
  if (a) angle = a.value + (incremental_ ? angle : 0.0);
  return {radius * std::cos(angle * units::deg), radius * std::sin(angle * units::deg)};
}

Target Machine::block_target(const Block& block, bool machine) const {
  Target target;
  for (int k = 0; k < 9; ++k) {
    const NcWord& word = block[axis_letters[std::size_t(k)]];
    if (!word) continue;
    const int j = joint(k);
    const double value = axis_word(k, word) * (canon_.is_linear(j) ? 1.0 : units::deg);
    if (incremental_ && !machine)
      target.by(j, value, word);
    else
      target.to(j, value, word);
  }
  if (block.is_polar()) {
    // Under compensation the programmed position counts, not that of the offset tool.
    const bool beside = compensation_.is_on() || compensation_.is_leaving();
    const AxisVector p = canon_.unplaced(beside ? compensation_.programmed() : canon_.position());
    const Eigen::Vector2d end = polar_end(block, {p[joint(0)], p[joint(1)]});
    const NcWord& word = block.radius() ? block.radius() : block.angle();
    target.to(joint(0), end.x(), word);
    target.to(joint(1), end.y(), word);
  }
  return target;
}

void Machine::straight(const Block& block, AxisVector end, std::uint32_t stated, bool machine) {
  Straight move{std::move(end), cause_of(block), machine, stated};
  if (compensation_.is_on()) {
    if (machine) refuse(move.cause, "G40 before G53");
    return compensation_.straight(std::move(move), motion_ == 0);
  }
  canon_.straight(std::move(move), motion_ == 0);
}

void Machine::arc(const Block& block, AxisVector end, std::uint32_t stated) {
  const bool beside = compensation_.is_on();
  ArcMove arc = program::arc_from_block(
      canon_, {.plane = plane_ / 10,
               .clockwise = motion_ == 20,
               .absolute_centre = absolute_centre_,
               .from = beside ? compensation_.programmed() : canon_.position(),
               .end = std::move(end),
               .cause = cause_of(block),
               .stated = stated,
               .word = [&](char letter) -> std::optional<program::LengthValue> {
                 const NcWord& word = block[letter];
                 if (!word) return std::nullopt;
                 return program::LengthValue{word.value * unit(), word};
               }});
  if (const NcWord& turns = block['P']) {
    if (!(turns.value >= 1 && turns.value <= 1e6) || turns.value != std::floor(turns.value))
      refuse(turns, "whole turns of 1 to 1e6 after P");
    arc.turns = int(turns.value);
  }
  if (beside) return compensation_.arc(std::move(arc));
  canon_.arc(std::move(arc));
}

/// Makes a line at a feed per spindle turn, whatever F is.
void Machine::feed_per_turn(const NcWord& pitch, const Straight& move) {
  const FeedMode mode = canon_.feed_mode();
  const auto feed = canon_.feed();
  canon_.set_feed_mode(FeedMode::PerRevolution);
  canon_.set_feed(Feed{std::abs(pitch.value), unit()});
  // F and its mode are restored on errors too, or every later block would get the wrong time.
  const auto again = [&] {
    canon_.set_feed_mode(mode);
    canon_.set_feed(feed);
  };
  try {
    canon_.straight(move, false);
  } catch (const BadInput&) {
    again();
    throw;
  }
  again();
}

void Machine::spindle_synchronised(const Block& block, AxisVector end) {
  const Cause cause = cause_of(block);
  const NcWord& k = block['K'];
  if (!k || k.value == 0) refuse(k ? Cause(k) : cause, "K (pitch) beside G33", k ? "0" : "none");
  // K alone sets the pitch of both directions.
  if (block['I']) refuse(block['I'], "no I beside G33.1: the way back is as fast");
  const AxisVector start = canon_.position();
  feed_per_turn(k, {.end = std::move(end), .cause = cause});
  if (motion_ != 331) return;
  const int direction = canon_.spindle_direction();
  // Rigid tapping (G33.1): back at the same pitch with the spindle reversed.
  canon_.turn_spindle(-direction);
  AxisVector back = canon_.position();
  for (int k9 = 0; k9 < 9; ++k9)
    if (const int j = joint(k9); j >= 0) back[j] = start[j];
  feed_per_turn(k, {.end = std::move(back), .cause = cause});
  canon_.turn_spindle(direction);
}

void Machine::move(const Block& block) {
  const NcWord& axis = first_axis_word(block);
  const bool is_arc = motion_ == 20 || motion_ == 30;
  const bool centre = block['I'] || block['J'] || block['K'] || block['R'];
  if (motion_ == 52 || motion_ == 53 || motion_ == 50 || motion_ == 51) {
    if (axis || block[Group::Motion]) spline(block);
    return;
  }
  // G76 is not modal: it acts only in its own block.
  if (motion_ == 760) {
    if (block[Group::Motion]) thread(block);
    return;
  }
  if (!axis && !(is_arc && centre)) return;
  if (motion_ == 730 || motion_ == 740 || (motion_ >= 810 && motion_ <= 890)) return cycle(block);
  const Cause cause = cause_of(block);
  const bool machine = block.tenths(Group::OneBlock) == 530;
  if (machine) canon_.go_to(Coordinates::Axis, cause);
  const Target target = block_target(block, machine);
  const bool beside = compensation_.is_on() || compensation_.is_leaving();
  AxisVector end =
      beside && !machine ? compensation_.end_of(target) : canon_.end_of(target, machine);
  // The first move after G40 leads from beside the contour back to the path, for which an arc has
  // no centre.
  if (compensation_.is_leaving() && is_arc) refuse(cause, "a line as the first move after G40");
  compensation_.clear_leaving();
  if (is_arc)
    arc(block, std::move(end), target.stated());
  else if (motion_ == 330 || motion_ == 331)
    spindle_synchronised(block, std::move(end));
  else
    straight(block, std::move(end), target.stated(), machine);
  if (machine && canon_.tip_mode()) canon_.go_to(Coordinates::Tip, cause);
}

namespace {

constexpr double chord = 1e-4;       // mm, chord error of a spline
constexpr double most_chords = 1e6;  // of one spline
// Halvings of one span: 65536 chords.
constexpr int max_halvings = 16;
// Bounds the memory of G5.2.
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
    std::vector<Eigen::Vector3d> d(poles.begin() + span - degree, poles.begin() + span + 1);
    for (int r = 1; r <= degree; ++r)
      for (int j = degree; j >= r; --j) {
        const double low = knots[std::size_t(span - degree + j)];
        const double high = knots[std::size_t(span + 1 + j - r)];
        const double a = (u - low) / (high - low);
        d[std::size_t(j)] = (1 - a) * d[std::size_t(j - 1)] + a * d[std::size_t(j)];
      }
    const Eigen::Vector3d& p = d[std::size_t(degree)];
    return {p.x() / p.z(), p.y() / p.z()};
  }
};

// Distance to the segment, not to the infinite line.
double distance_to_chord(const Vector2d& p, const Vector2d& a, const Vector2d& b) {
  const Vector2d way = b - a;
  const double length = way.squaredNorm();
  const double t = length > 0 ? std::clamp((p - a).dot(way) / length, 0.0, 1.0) : 0.0;
  return (p - a - t * way).norm();
}

/// Halves a part until its quarter points lie on its chord.
void refine(const Spline& spline, double from, double to, int halvings,
            std::vector<Vector2d>& points) {
  const Vector2d a = spline.at(from), b = spline.at(to);
  double off = 0.0;
  for (const double part : {0.25, 0.5, 0.75})
    off = std::max(off, distance_to_chord(spline.at(from + part * (to - from)), a, b));
  const bool enough = double(points.size()) > most_chords;  // reported when all points are there
  // Two halvings at least: a symmetric S has its quarter points near the chord. Half of the
  // tolerance, since three samples may miss the largest deviation.
  if ((halvings >= 2 && off <= 0.5 * chord) || halvings == max_halvings || enough) {
    points.push_back(b);
    return;
  }
  const double middle = 0.5 * (from + to);
  refine(spline, from, middle, halvings + 1, points);
  refine(spline, middle, to, halvings + 1, points);
}

/// Chords of a cubic Bezier curve: n of them deviate by at most |B''| / 8 n^2.
std::vector<Vector2d> bezier_points(const std::array<Vector2d, 4>& p) {
  const double bend =
      6 * std::max((p[0] - 2 * p[1] + p[2]).norm(), (p[1] - 2 * p[2] + p[3]).norm());
  const int n = int(std::clamp(std::ceil(std::sqrt(bend / (8 * chord))), 1.0, most_chords));
  std::vector<Vector2d> points;
  for (int i = 1; i <= n; ++i) {
    const double u = double(i) / n, v = 1 - u;
    points.push_back(v * v * v * p[0] + 3 * v * v * u * p[1] + 3 * v * u * u * p[2] +
                     u * u * u * p[3]);
  }
  return points;
}

// Clamped knots: the curve begins and ends at the first and last pole.
std::vector<Vector2d> nurbs_points(std::vector<Eigen::Vector3d> poles, int order) {
  Spline spline{std::move(poles), {}, order};
  const int n = int(spline.poles.size());
  for (int i = 0; i < n + order; ++i)
    spline.knots.push_back(std::clamp(double(i - order + 1), 0.0, double(n - order + 1)));
  std::vector<Vector2d> points;
  for (int i = 0; i < n - order + 1; ++i) refine(spline, i, i + 1, 0, points);
  return points;
}

}  // namespace

/// G5, G5.1, G5.2 and G5.3, in X Y.
void Machine::spline(const Block& block) {
  const Cause cause = cause_of(block);
  if (compensation_.is_on()) refuse(cause, "G40 before a spline");
  if (plane_ != 170) refuse(cause, "G17 before a spline");
  const int x = joint(0), y = joint(1);
  if (x < 0 || y < 0) refuse(cause, "a machine with X and Y beside a spline");
  for (int k = 2; k < 9; ++k)
    if (const NcWord& word = block[axis_letters[std::size_t(k)]])
      refuse(word, "X and Y alone beside a spline");
  AxisVector at = canon_.programmed();
  const Vector2d start(at[x], at[y]);
  const auto word = [&](char letter) { return block[letter].value * unit(); };
  Vector2d end = start;
  if (block['X']) end.x() = axis_word(0, block['X']) + (incremental_ ? start.x() : 0.0);
  if (block['Y']) end.y() = axis_word(1, block['Y']) + (incremental_ ? start.y() : 0.0);
  std::vector<Vector2d> points;
  if (motion_ == 50) {
    if (!block['P'] || !block['Q']) refuse(cause, "P and Q beside G5", "none");
    if (!block['I'] != !block['J']) refuse(cause, "both I and J beside G5, or none", "one");
    if (!block['I'] && !spline_arm_) refuse(cause, "I and J in the first G5", "none");
    // Without I J the arm continues that of the previous G5, so that the tangent is continuous.
    const Vector2d arm = block['I'] ? Vector2d(word('I'), word('J')) : Vector2d(-*spline_arm_);
    spline_arm_ = Vector2d(word('P'), word('Q'));
    points = bezier_points({start, start + arm, end + *spline_arm_, end});
  } else if (motion_ == 51) {
    if (!block['I'] || !block['J']) refuse(cause, "both I and J beside G5.1");
    const Vector2d middle = start + Vector2d(word('I'), word('J'));
    // A quadratic Bezier curve as a cubic one: arms of two thirds.
    points = bezier_points(
        {start, start + 2.0 / 3 * (middle - start), end + 2.0 / 3 * (middle - end), end});
  } else if (motion_ == 52) {
    if (incremental_) refuse(cause, "G90 beside G5.2");
    if (const NcWord& l = block['L']) order_ = whole_word(l, 20);
    if (order_ < 2) refuse(block['L'], "an order of 2 to 20 after L");
    const NcWord& p = block['P'];
    if (!p || !(p.value > 0)) refuse(p ? Cause(p) : cause, "P (weight) above zero beside G5.2");
    if (poles_.size() == max_poles) refuse(cause, "at most 10000 poles of a spline", "more");
    poles_.push_back({end.x(), end.y(), p.value});
    // G5.2 only collects poles; G5.3 makes the curve.
    return;
  } else {
    if (int(poles_.size()) < order_)
      refuse(cause, fmt::format("{} poles or more before G5.3", order_),
             fmt::format("{}", poles_.size()));
    std::vector<Eigen::Vector3d> poles;
    for (const Pole& pole : poles_)
      poles.emplace_back(pole.x * pole.weight, pole.y * pole.weight, pole.weight);
    // The curve begins at the first pole, which is reached by a line.
    points.emplace_back(poles_.front().x, poles_.front().y);
    for (const Vector2d& point : nurbs_points(std::move(poles), order_)) points.push_back(point);
    poles_.clear();
    motion_ = -1;
  }
  if (double(points.size()) > most_chords)
    refuse(cause, fmt::format("at most {:.0f} chords of a spline", most_chords), "more");
  // Checked before the moves are made, so that no memory is taken for too many.
  run_.check_moves(double(points.size()), cause);
  for (const Vector2d& point : points) {
    at[x] = point.x();
    at[y] = point.y();
    go(at, false);
  }
}

namespace {
// mm (0.01 inch), distance above the last peck to which the tool returns
constexpr double peck_clearance = 0.254;
// Bounds a hole whose Q is far below any chip.
constexpr double max_pecks = 1e5;
}  // namespace

/// Moves to a point in program coordinates.
void Machine::go(const AxisVector& end, bool rapid) {
  canon_.straight({.end = canon_.placed(end), .cause = {1, {}}}, rapid);
}

/// A cycle whose first block has an error is not begun, so the blocks behind it report no errors of
/// their own.
void Machine::cycle(const Block& block) {
  if (!cycle_.begun && !block[Group::Motion]) run_.require_certain("cycle", cause_of(block));
  run_.define("cycle", [&] { take_cycle(block); });
}

/// Reads the words of a cycle. Words that are not programmed keep their values.
void Machine::take_cycle(const Block& block) {
  const Cause cause = cause_of(block);
  if (compensation_.is_on()) refuse(cause, "G40 before a canned cycle");
  // In inverse time each move would need an F of its own.
  if (canon_.feed_mode() == FeedMode::InverseTime) refuse(cause, "G94 or G95 beside a cycle");
  const int deep = plane_ == 170 ? 2 : plane_ == 180 ? 1 : 0;
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) refuse(cause, "a machine with X Y Z beside a canned cycle");
  for (int k = 3; k < 9; ++k)
    if (const NcWord& word = block[axis_letters[std::size_t(k)]])
      refuse(word, "X Y Z beside a canned cycle");
  const char deep_letter = axis_letters[std::size_t(deep)];
  const NcWord &r = block['R'], &z = block[deep_letter], &q = block['Q'], &p = block['P'];
  if (!cycle_.begun && (!r || !z))
    refuse(cause, fmt::format("{} and R in the first block of a cycle", deep_letter), "none");
  if (r) cycle_.r = r.value * unit();
  if (z) cycle_.z = axis_word(deep, z);
  const bool pecks = motion_ == 730 || motion_ == 830;
  if (q && !pecks) refuse(q, "no Q in this cycle");
  if (q) cycle_.q = q.value * unit();
  if (pecks && !(cycle_.q > 0)) refuse(q ? Cause(q) : cause, "Q (depth of a peck) above zero");
  if (p) cycle_.p = p.value;
  // The dwell of G82, G86 and G89 must be stated once.
  if (!cycle_.begun && !p && (motion_ == 820 || motion_ == 860 || motion_ == 890))
    refuse(cause, fmt::format("P (seconds) in the first block of G{}", motion_ / 10), "none");
  if (!(cycle_.p >= 0 && cycle_.p <= 1e6)) refuse(p, "0 to 1e6 seconds after P");
  if (const NcWord& l = block['L'];
      l && (l.value < 1 || l.value > 1e6 || l.value != std::floor(l.value)))
    refuse(l, "whole repeats of 1 to 1e6 after L");
  const int turns = canon_.spindle_direction();
  // LinuxCNC does not start the spindle: it must turn in the direction of the tap.
  if ((motion_ == 840 && turns != 1) || (motion_ == 740 && turns != -1))
    refuse(cause, motion_ == 840 ? "M3 before G84" : "M4 before G74");
  if (motion_ == 860 && turns == 0) refuse(cause, "a spindle that turns before G86");
  cycle_.begun = true;
  cycle_holes(block);
}

void Machine::cycle_holes(const Block& block) {
  const int deep = plane_ == 170 ? 2 : plane_ == 180 ? 1 : 0;
  const int d = joint(deep);
  AxisVector at = canon_.programmed();
  // G98 returns to the level at which the first block of the cycles began.
  if (!cycle_.initial) cycle_.initial = at[d];
  const double initial = *cycle_.initial;
  const double r = incremental_ ? cycle_.r + initial : cycle_.r;
  const double bottom = incremental_ ? r + cycle_.z : cycle_.z;
  // The tool goes from R down to the bottom at feed; reversed levels are an error of the program.
  if (r < bottom)
    refuse(block['R'] ? Cause(block['R']) : cause_of(block), "R above the bottom of the hole",
           fmt::format("R at {} mm, the bottom at {} mm", r, bottom));
  // Below R the tool first rises to R, before it moves sideways.
  if (initial < r) {
    at[d] = r;
    go(at, true);
  }
  const double clear = to_r_ ? r : std::max(initial, r);
  // The first hole is reached at the current level, under G98 and G99 alike.
  double level = std::max(at[d], r);
  const int repeats = block['L'] ? int(block['L'].value) : 1;
  const bool pecks = motion_ == 730 || motion_ == 830;
  // Moves of a hole: to the place, to R, to the bottom, back; each peck adds up to three.
  constexpr double moves_per_hole = 4.0, moves_per_peck = 3.0;  // at most
  run_.check_moves(
      repeats * (moves_per_hole + (pecks ? moves_per_peck * (r - bottom) / cycle_.q : 0.0)),
      cause_of(block));
  for (int n = 0; n < repeats; ++n) {
    run_.count_block();
    for (int k = 0; k < 3; ++k) {
      const NcWord& word = block[axis_letters[std::size_t(k)]];
      if (k == deep || !word) continue;
      at[joint(k)] = incremental_ ? at[joint(k)] + axis_word(k, word) : axis_word(k, word);
    }
    if (block.is_polar()) {
      const Eigen::Vector2d end = polar_end(block, {at[joint(0)], at[joint(1)]});
      at[joint(0)] = end.x();
      at[joint(1)] = end.y();
    }
    at[d] = level;
    go(at, true);
    at[d] = r;
    go(at, true);
    hole({at, d, r, bottom, clear});
    level = clear;
  }
}

/// Makes one hole from R down and out again.
void Machine::hole(const Hole& hole) {
  AxisVector at = hole.at;
  const auto to = [&](double level, bool rapid) {
    at[hole.deep] = level;
    go(at, rapid);
  };
  if (motion_ == 730 || motion_ == 830) {
    if ((hole.r - hole.bottom) / cycle_.q > max_pecks)
      refuse({1, {}}, "at most 1e5 pecks in a hole", "more");
    for (double depth = hole.r - cycle_.q; depth > hole.bottom; depth -= cycle_.q) {
      to(depth, false);
      // G83 clears the chips at R; G73 only breaks them by the clearance.
      if (motion_ == 830) to(hole.r, true);
      to(depth + peck_clearance, true);
    }
  }
  to(hole.bottom, false);
  const int turns = canon_.spindle_direction();
  const auto wait = [&] { canon_.dwell(cycle_.p, {1, {}}); };
  switch (motion_) {
    case 740:
    case 840:
      // Tapping: the spindle reverses at the bottom and again outside.
      canon_.turn_spindle(-turns);
      wait();
      to(hole.clear, false);
      canon_.turn_spindle(turns);
      return;
    case 860:
      wait();
      canon_.turn_spindle(0);
      to(hole.clear, true);
      canon_.turn_spindle(turns);
      return;
    case 820:
      wait();
      return to(hole.clear, true);
    case 850:
      to(hole.r, false);
      return to(hole.clear, true);
    case 890:
      wait();
      return to(hole.clear, false);
    default:
      return to(hole.clear, true);
  }
}

namespace {

/// Words of G76, in mm.
struct Thread {
  double pitch = 0.0, z_end = 0.0, peak = 0.0, first = 0.0, height = 0.0;
  double degression = 1.0, angle = 0.0, taper = 0.0;
  int springs = 0;
  bool tapers_in = false, tapers_out = false;
};

}  // namespace

/// The passes of a thread, in program coordinates of X and Z.
class ThreadPasses {
 public:
  ThreadPasses(Machine& machine, const Thread& thread)
      : machine_(machine),
        thread_(thread),
        at_(machine.canon_.programmed()),
        x_(machine.joint(0)),
        z_(machine.joint(2)),
        x0_(at_[x_]),
        z0_(at_[z_]) {}

  void cut() {
    // Depths count from the drive line, where X stands at the start; the thread peak is `full` away
    // from it.
    const double full = std::abs(thread_.peak);
    const double end = std::abs(thread_.height) + full;
    double depth = full + thread_.first;
    // Depth of pass n: first * n^(1/R). With R = 1 all cuts have equal depth, with R = 2 equal
    // area.
    for (int n = 1; depth < end;) {
      machine_.run_.count_block();
      pass(depth, end);
      depth = full + thread_.first * std::pow(++n, 1.0 / thread_.degression);
    }
    // Spring passes repeat the full depth.
    for (int n = 0; n <= thread_.springs; ++n) pass(end, end);
    to(x0_, thread_.z_end, true);
  }

 private:
  void to(double x, double z, bool rapid) {
    at_[x_] = x;
    at_[z_] = z;
    machine_.go(at_, rapid);
  }
  void feed(double per_turn, double x, double z) {
    machine_.canon_.set_feed(program::Feed{per_turn, 1.0});
    to(x, z, false);
  }
  // The infeed follows the compound slide angle Q: deeper passes begin further back along Z.
  void pass(double depth, double end) {
    const double side = thread_.peak > 0 ? 1.0 : -1.0;
    const double tangent = std::tan(thread_.angle * units::deg);
    const double back = (depth - std::abs(thread_.peak)) * tangent;
    const double z_start = z0_ - back, z_end = thread_.z_end + thread_.height * tangent - back;
    const double x_safe = x0_ - side * (end - depth), x_cut = x0_ + side * depth;
    const double x_out = x_cut - side * thread_.height;
    // The sign of the taper follows the direction of the thread along Z.
    const double taper = thread_.z_end > z0_ ? -thread_.taper : thread_.taper;
    // The pitch along the slanted entry keeps the spindle angle per Z: pitch times length over its
    // Z.
    const double slanted =
        thread_.taper > 0
            ? thread_.pitch * std::hypot(thread_.taper, thread_.height) / thread_.taper
            : thread_.pitch;
    to(x_safe, z_start, true);
    if (thread_.tapers_in) {
      feed(slanted, x_out, z_start);
      feed(slanted, x_cut, z_start - taper);
    } else {
      to(x_cut, z_start, true);
    }
    feed(thread_.pitch, x_cut, thread_.tapers_out ? z_end + taper : z_end);
    if (thread_.tapers_out) feed(slanted, x_out, z_end);
    to(x_safe, z_end, true);
  }

  Machine& machine_;
  const Thread& thread_;
  Machine::AxisVector at_;
  int x_, z_;
  double x0_, z0_;
};

void Machine::thread(const Block& block) {
  const Cause cause = cause_of(block);
  if (compensation_.is_on()) refuse(cause, "G40 before G76");
  if (plane_ != 180) refuse(cause, "G18 before G76");
  if (joint(0) < 0 || joint(2) < 0) refuse(cause, "a machine with X and Z beside G76");
  for (const char letter : {'P', 'Z', 'I', 'J', 'K'})
    if (!block[letter]) refuse(cause, fmt::format("{} beside G76", letter), "none");
  const auto positive = [&](char letter) {
    if (!(block[letter].value > 0)) refuse(block[letter], fmt::format("{} above zero", letter));
    return block[letter].value * unit();
  };
  const double across = diameter_ ? 0.5 : 1.0;  // I J K are diameters under G7
  Thread thread;
  thread.pitch = positive('P');
  thread.first = across * positive('J');
  thread.height = across * positive('K');
  thread.peak = across * block['I'].value * unit();
  thread.z_end = axis_word(2, block['Z']) + (incremental_ ? programmed(2) : 0.0);
  if (const NcWord& r = block['R']) thread.degression = r.value;
  if (thread.degression < 1 || thread.degression > 100) refuse(block['R'], "R of 1 to 100");
  if (const NcWord& q = block['Q']) thread.angle = q.value;
  if (thread.angle < 0 || thread.angle > 80) refuse(block['Q'], "Q of 0 to 80 degrees");
  if (const NcWord& h = block['H']) thread.springs = whole_word(h, 1000);
  const int tapers = block['L'] ? whole_word(block['L'], 3) : 0;
  thread.tapers_in = tapers % 2 == 1;
  thread.tapers_out = tapers >= 2;
  if (tapers > 0) {
    if (!block['E']) refuse(cause, "E (length of the taper) beside L", "none");
    thread.taper = positive('E');
  }
  // The feed of the thread ends with the cycle.
  const FeedMode mode = canon_.feed_mode();
  const auto feed = canon_.feed();
  canon_.set_feed_mode(FeedMode::PerRevolution);
  ThreadPasses(*this, thread).cut();
  canon_.set_feed_mode(mode);
  canon_.set_feed(feed);
}

int Machine::whole_word(const NcWord& word, int most) const {
  if (word.value < 0 || word.value > most || word.value != std::floor(word.value))
    refuse(word, fmt::format("a whole number of 0 to {}", most));
  return int(word.value);
}

}  // namespace abbe::sim::dialects::linuxcnc
