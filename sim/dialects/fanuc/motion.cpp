#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "kinematics/bad_input.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/fanuc/machine.h"
#include "sim/dialects/tool_vectors.h"
#include "sim/program/nc_reader.h"

namespace abbe::sim::dialects::fanuc {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Joint;
using kinematics::Motion;
using program::ArcMove;
using program::Coordinates;
using program::FeedMode;
using program::Straight;

/// Reads the words of G16: in the plane the first axis is a radius, about the origin or under G91
/// about the current position, the second an angle, under G91 added to the previous one.
void Machine::polar_words(const Block& block, Target& target) {
  const std::string_view plane = plane_letters();
  const Word &r = block[plane[0]], &a = block[plane[1]];
  if (!r && !a) return;
  const int first = canon_.joint_of(plane[0]), second = canon_.joint_of(plane[1]);
  // Under compensation the programmed position counts, not that of the offset tool.
  const AxisVector p =
      canon_.unplaced(compensation_.on() || compensation_.leaving() ? compensation_.programmed()
                                                                    : canon_.position());
  if (r) {
    polar_.radius = length(r);
    polar_.centre = incremental_ ? Eigen::Vector2d(p[first], p[second]) : Eigen::Vector2d(0, 0);
  }
  if (a) polar_.angle = angle_in_degrees(a) + (incremental_ ? polar_.angle : 0.0);
  const double angle = polar_.angle * units::deg;
  const Word& word = r ? r : a;
  target.to(first, polar_.centre.x() + polar_.radius * std::cos(angle), word);
  target.to(second, polar_.centre.y() + polar_.radius * std::sin(angle), word);
}

Target Machine::block_target(const Block& block, bool machine) {
  Target target;
  const std::string_view plane = plane_letters();
  for (const auto& [j, word, step] : axis_words(block)) {
    // Words of the plane are polar and handled together below.
    if (polar_.on && !machine && plane.find(word->letter) != std::string_view::npos) continue;
    if (step && machine) refuse(*word, "X Y Z C beside G53");
    if (target.has(j)) refuse(*word, "an axis by its position or by its increment, not both");
    const double value = axis_word(j, *word);
    if (step || (incremental_ && !machine))
      target.by(j, value, *word);
    else
      target.to(j, value, *word);
  }
  if (polar_.on && !machine) polar_words(block, target);
  return target;
}

void Machine::straight(const Block& block, AxisVector end, std::uint32_t stated) {
  Straight move{std::move(end), cause_of(block), false, stated};
  // Under compensation the move waits for the next one; without it the canon makes it at once.
  if (compensation_.on()) return compensation_.straight(std::move(move), motion_ == 0);
  // Vectors (G43.5) follow the pole rule of the control at feed only.
  if (length_mode_ == 435 && motion_ == 10 && vector_lines_.on()) {
    const kinematics::Chain& own = chain(move.cause);
    vector_lines_.straight_feed(own, std::move(move));
    return;
  }
  canon_.straight(std::move(move), motion_ == 0);
}

void Machine::arc(const Block& block, AxisVector end, std::uint32_t stated) {
  const Cause cause = cause_of(block);
  if (length_mode_ == 435) refuse(cause, "G1 under G43.5");
  const bool beside = compensation_.on();
  ArcMove arc = program::arc_from_block(
      canon_, {.plane = plane_ / 10,
               .clockwise = motion_ == 20,
               .from = beside ? compensation_.programmed() : canon_.position(),
               .end = std::move(end),
               .cause = cause,
               .stated = stated,
               .word = [&](char letter) -> std::optional<program::LengthValue> {
                 const Word& word = block[letter];
                 if (!word) return std::nullopt;
                 return program::LengthValue{length(word), word};
               }});
  if (beside && !compensation_.entered())
    // Type A needs the direction of a line to enter a contour.
    refuse(cause, "a line as the first move after G41 and G42");
  if (beside) return compensation_.arc(std::move(arc));
  canon_.arc(std::move(arc));
}

void Machine::move(const Block& block) {
  const bool axis = first_axis_word(block) != nullptr;
  const bool is_arc = motion_ == 20 || motion_ == 30;
  const bool arc_words = block['I'] || block['J'] || block['K'] || block['R'];
  if (cycle_code_ != 800) {
    if (axis || block[Group::Cycle]) cycle(block);
    return;
  }
  // G90 and G94 of a turning control.
  if (motion_ == 900 || motion_ == 940) {
    if (axis) turning_cycle(block);
    return;
  }
  // Under G43.5 I J K alone rotate the tool at the current tip.
  const bool turns = length_mode_ == 435 && arc_words && !is_arc;
  if (!axis && !turns && !(is_arc && arc_words)) return;
  moved_ = true;
  const Cause cause = cause_of(block);
  note_uncalled_tool(cause);
  const Target target = block_target(block, false);
  check_tilted(target, cause);
  const bool beside = compensation_.on() || compensation_.leaving();
  AxisVector end = beside ? compensation_.end_of(target) : canon_.end_of(target);
  if (compensation_.leaving() && is_arc) refuse(cause, "a line as the first move after G40");
  compensation_.clear_leaving();
  // The end of X Y Z is known first, then the direction is solved there.
  if (length_mode_ == 435) end = point_tool_along_direction(block, std::move(end));
  if (is_arc)
    arc(block, std::move(end), target.stated());
  else
    straight(block, std::move(end), target.stated());
}

/// G53: machine coordinates, always at rapid.
void Machine::to_axes(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (incremental_) refuse(code.word, "G90 beside G53");
  const Target target = block_target(block, true);
  if (target.empty()) refuse(code.word, "an axis word beside G53", "none");
  moved_ = true;
  compensation_.clear_leaving();
  canon_.go_to(Coordinates::Axis, code.word);
  canon_.straight({.end = canon_.end_of(target, true),
                   .cause = code.word,
                   .without_offset = true,
                   .stated = target.stated()},
                  true);
  // The tip mode is only suspended for the block.
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, code.word);
}

/// G28 and G30: over the programmed point to the reference position, for the programmed axes only.
void Machine::reference(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (const Word& p = block['P']; p && whole(canon_, p, 4) < 2) refuse(p, "P2 P3 or P4 beside G30");
  const Target words = block_target(block, false);
  if (words.empty()) refuse(code.word, "an axis word beside " + shown(code.word.text), "none");
  moved_ = true;
  compensation_.clear_leaving();
  canon_.straight({.end = canon_.end_of(words), .cause = code.word, .stated = words.stated()},
                  true);
  const AxisVector stored = program::reference_of(canon_.options());
  std::string where;
  for (const auto& axis : canon_.options().axes)
    if (const int j = canon_.joint_of(axis.name); j >= 0 && words.has(j))
      where += fmt::format(" {}{:g}", axis.name,
                           stored[j] / (canon_.is_linear(j) ? 1.0 : units::deg) + 0.0);
  // Reported because the scene does not state the reference position.
  if (canon_.options().reference.size() == 0)
    canon_.assume({"the reference position (G28, G30) is where the axes stand at first:" + where,
                   "machine.reference"});
  canon_.go_to(Coordinates::Axis, code.word);
  AxisVector end = canon_.position();
  for (int j = 0; j < int(end.size()); ++j)
    if (words.has(j)) end[j] = stored[j];
  canon_.straight(
      {.end = std::move(end), .cause = code.word, .without_offset = true, .stated = words.given()},
      true);
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, code.word);
}

namespace {

// Inclination of the tool from Z of a tilted plane; angles of three decimals stay far below it.
constexpr double max_lean = 0.02 * units::deg;

/// Returns the chain with unlimited slides: a change of direction must not depend on where they
/// are.
Chain with_free_slides(const Chain& chain) {
  std::vector<Joint> joints = chain.joints();
  for (Joint& joint : joints)
    if (joint.motion == Motion::Linear) {
      joint.min = -1e9;
      joint.max = 1e9;
    }
  return {std::move(joints), chain.T_bw_home(), chain.T_bt_home()};
}

}  // namespace

/// G68.2: origin, and Euler angles about Z, the new X and the new Z.
void Machine::tilt(const Block& block) {
  const Code& code = block[Group::Rotation];
  if (tip_words()) refuse(code.word, "G49 before G68.2");
  if (polar_.on) refuse(code.word, "G15 before G68.2");
  // P1 to P4 of G68.2 state the plane by other angles, points or vectors.
  if (const Word& p = block['P']; p && p.value != 0.0)
    refuse(p, "Euler angles I J K beside G68.2: no other way to say a plane");
  const auto turn = [&](char letter, const Eigen::Vector3d& axis) {
    const double by = block[letter] ? angle_in_degrees(block[letter]) : 0.0;
    return Eigen::AngleAxisd(by * units::deg, axis);
  };
  for (int k = 0; k < 3; ++k) {
    const Word& word = block[axis_letters[std::size_t(k)]];
    centre_[k] = word ? length(word) : 0.0;
  }
  for (int k = 3; k < 9; ++k)
    if (const Word& word = block[axis_letters[std::size_t(k)]])
      refuse(word, "X Y Z I J K beside G68.2");
  rotation_ = (turn('I', Eigen::Vector3d::UnitZ()) * turn('J', Eigen::Vector3d::UnitX()) *
               turn('K', Eigen::Vector3d::UnitZ()))
                  .toRotationMatrix();
  tilted_ = true;
  apply_frame();
  apply_length(code.word);
}

const Chain& Machine::chain(const Cause& cause) const {
  const program::NcOptions& options = canon_.options();
  const bool has = length_mode_ != 490 && h_ != 0;
  const auto own = options.control_of_h.find(has ? h_ : tool_);
  if (own != options.control_of_h.end()) return own->second;
  if (!options.control) refuse(cause, "a control that knows its kinematics");
  return *options.control;
}

AxisVector Machine::rotary_positions(const Eigen::Vector3d& direction_w, const Cause& cause) {
  const Chain& own = chain(cause);
  // Chains are rarely changed; the copy with free slides is kept.
  if (!free_slides_ || free_slides_of_ != &own) {
    free_slides_ = with_free_slides(own);
    free_slides_of_ = &own;
    ranks_ = rotary_judgement_order(own);
  }
  kinematics::InverseSolution found;
  const AxisVector now = canon_.position();  // its rotary joints, valid in any coordinates
  try {
    found = kinematics::inverse(*free_slides_, {Eigen::Vector3d::Zero(), direction_w}, now);
  } catch (const std::invalid_argument&) {
    refuse(cause, "a machine of three slides and at most two rotary axes beside a direction");
  }
  if (found.branches.empty())
    refuse(
        cause, "a direction that the rotary axes reach",
        fmt::format("{:.6f} {:.6f} {:.6f}{}", direction_w.x(), direction_w.y(), direction_w.z(),
                    found.reach == kinematics::Reach::OutOfLimits ? ", beyond their limits" : ""));
  const AxisVector& best = output_judgement(found.branches, now, ranks_);
  AxisVector q = now;
  for (const int j : ranks_) q[j] = best[j];
  return q;
}

/// G53.1 rotates with the slides at rest, G53.6 with the tip at rest.
void Machine::turn_to_plane(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (!tilted_) refuse(code.word, "G68.2 before " + shown(code.word.text));
  if (const Word* axis = first_axis_word(block))
    refuse(*axis, "a block without axis words beside " + shown(code.word.text));
  const AxisVector turned = rotary_positions(rotation_->col(2), code.word);
  const bool keeps_tip = code.tenths == 536;
  // With axes commanded the slides stay; with the tip commanded they compensate.
  if (!keeps_tip) canon_.go_to(program::Coordinates::Axis, code.word);
  AxisVector end = canon_.position();
  for (const int j : ranks_) end[j] = turned[j];
  canon_.traverse({.end = std::move(end), .cause = code.word});
  canon_.go_to(program::Coordinates::Tip, code.word);
}

/// Returns the same end with the rotary axes at the direction I J K of G43.5.
AxisVector Machine::point_tool_along_direction(const Block& block, AxisVector end) {
  for (const auto& [j, word, step] : axis_words(block))
    if (canon_.options().axes[std::size_t(j)].motion == Motion::Rotary)
      refuse(*word, "I J K for the direction of the tool under G43.5");
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  const Word* first = nullptr;
  for (int k = 0; k < 3; ++k)
    if (const Word& word = block["IJK"[k]]) {
      direction[k] = argument(word);
      if (first == nullptr) first = &word;
    }
  if (first == nullptr) return end;
  if (!(direction.norm() > 1e-9)) refuse(*first, "a direction I J K that is not zero");
  // The direction is programmed in the tilted system.
  if (rotation_) direction = *rotation_ * direction;
  const AxisVector turned = rotary_positions(direction.normalized(), *first);
  for (const int j : ranks_) end[j] = turned[j];
  return end;
}

/// In a tilted plane X Y Z are those of the tip while the tool is along Z of the plane. Without a
/// tool length Z would be that of the nose.
void Machine::check_tilted(const Target& target, const Cause& cause) const {
  if (!tilted_ || tip_words()) return;
  const int x = joint(0), y = joint(1), z = joint(2);
  if (!target.has(x) && !target.has(y) && !target.has(z)) return;
  const Eigen::Vector3d tool = chain(cause).tool_in_workpiece(canon_.position()).linear().col(2);
  const Eigen::Vector3d across = rotation_->col(2);
  const double lean = std::atan2(tool.cross(across).norm(), tool.dot(across));
  if (lean > max_lean)
    refuse(cause, "G53.1 or rotary words that turn the tool into Z of the plane before X Y Z",
           fmt::format("a tool that leans by {:.3f} degrees", lean / units::deg));
  if (target.has(z) && (length_mode_ == 490 || h_ == 0))
    refuse(target.cause(z), "G43 H before a Z word in a tilted plane");
}

namespace {

constexpr double peck_clearance = 0.5;  // mm, parameters 5114 and 5115; reported in a warning
// Bounds a hole whose Q is far below any chip.
constexpr double max_pecks = 1e5;

bool is_tap(int code) { return code == 740 || code == 840; }
bool is_peck(int code) { return code == 730 || code == 830; }
bool shifts(int code) { return code == 760 || code == 870; }
bool dwells(int code) { return is_tap(code) || shifts(code) || code == 820 || code == 890; }

}  // namespace

void Machine::to_level(double level, bool rapid) {
  cycle_.at[joint(2)] = level;
  const AxisVector to = canon_.placed(cycle_.at);
  AxisVector end = canon_.position();  // a spindle among the joints keeps turning
  for (const char letter : axis_letters)
    if (const int j = canon_.joint_of(letter); j >= 0) end[j] = to[j];
  canon_.straight({.end = std::move(end), .cause = cycle_.cause}, rapid);
}

/// Reads the words of a cycle. Words that are not programmed keep their values, and levels stay.
void Machine::take_cycle_words(const Block& block) {
  const int z = joint(2);
  const Word &r = block['R'], &deep = block['Z'], &q = block['Q'], &p = block['P'];
  if (!cycle_.begun) {
    if (!r || !deep) refuse(cycle_.cause, "Z and R in the first block of a cycle", "none");
    cycle_.initial = canon_.programmed()[z];
  }
  // Under G91 R counts from the initial level and Z from R.
  if (r) cycle_.r = length(r) + (incremental_ ? cycle_.initial : 0.0);
  if (deep) cycle_.bottom = length(deep) + (incremental_ ? cycle_.r : 0.0);
  if (q && !is_peck(cycle_code_) && !shifts(cycle_code_))
    refuse(q, is_tap(cycle_code_) ? "no Q: tapping with pecks is not read" : "no Q in this cycle");
  // Q is an amount; the control ignores its sign.
  if (q) cycle_.q = std::abs(length(q));
  if ((is_peck(cycle_code_) || shifts(cycle_code_)) && !(cycle_.q > 0))
    refuse(q ? Cause(q) : cycle_.cause, "Q above zero");
  if (p && !dwells(cycle_code_)) refuse(p, "no P in this cycle");
  // P is in milliseconds.
  if (p) cycle_.dwell_s = whole(canon_, p, 99'999'999) * 1e-3;
  warn_low_start();
  const bool from_behind = cycle_code_ == 870;
  if (from_behind && to_r_) refuse(cycle_.cause, "G98 beside G87");
  if (from_behind ? cycle_.bottom < cycle_.r : cycle_.r < cycle_.bottom)
    refuse(r ? Cause(r) : cycle_.cause,
           from_behind ? "the end of the bore above R" : "R above the bottom of the hole",
           fmt::format("R at {} mm, the bottom at {} mm", cycle_.r, cycle_.bottom));
  const int turns = canon_.spindle_direction();
  const int wanted = cycle_code_ == 740 ? -1 : 1;
  // Tapping needs the spindle to turn the right way; M29 (rigid) makes the control turn it.
  if (is_tap(cycle_code_) && !rigid_ && turns != wanted)
    refuse(cycle_.cause,
           fmt::format("M{} or M29 before G{}", wanted > 0 ? 3 : 4, cycle_code_ / 10));
  if ((cycle_code_ == 860 || shifts(cycle_code_)) && turns == 0)
    refuse(cycle_.cause, "a spindle that turns before the cycle");
  cycle_.begun = true;
}

/// Under G98 the last operation of a cycle returns to the Z of its start, even if R is above it
/// (Haas VF operator's manual 96-8000, page 182: the six operations of a canned cycle). LinuxCNC
/// stays at R in that case.
void Machine::warn_low_start() {
  if (to_r_ || cycle_code_ == 870 || !(cycle_.initial < cycle_.r)) return;
  run_.warn_once(
      "a cycle begins below its R: under G98 the tool goes back down to where it began at rapid, "
      "and "
      "to the next hole at that level");
}

void Machine::cycle(const Block& block) {
  cycle_.cause = cause_of(block);
  if (compensation_.on()) refuse(cycle_.cause, "G40 before a canned cycle");
  if (canon_.feed_mode() == FeedMode::InverseTime)
    refuse(cycle_.cause, "G94 or G95 beside a cycle");
  if (plane_ != 170)
    refuse(cycle_.cause, "G17 beside a cycle: the axis that drills is a parameter elsewhere");
  if (tip_words()) refuse(cycle_.cause, "G43 beside a cycle, in a tilted plane where it is needed");
  for (int k = 0; k < 3; ++k)
    if (joint(k) < 0) refuse(cycle_.cause, "a machine with X Y Z beside a canned cycle");
  // A cycle whose definition has an error is not reported again for each hole.
  if (!cycle_.begun && !block[Group::Cycle]) run_.require_certain("cycle", cycle_.cause);
  run_.define("cycle", [&] { take_cycle_words(block); });
  moved_ = true;
  compensation_.clear_leaving();
  cycle_holes(block);
}

/// K and L are the number of holes; with 0 the words are only stored.
void Machine::cycle_holes(const Block& block) {
  const Word& repeats = block['K'] ? block['K'] : block['L'];
  if (block['K'] && block['L']) refuse(block['L'], "either K or L");
  const int n = repeats ? whole(canon_, repeats, 1'000'000) : 1;
  // Moves of a hole: to the place, to R, to the bottom, back; each peck adds up to three.
  constexpr double moves_per_hole = 4.0, moves_per_peck = 3.0;  // at most
  const double pecks = is_peck(cycle_code_) ? std::abs(cycle_.r - cycle_.bottom) / cycle_.q : 0.0;
  run_.check_moves(n * (moves_per_hole + moves_per_peck * pecks), cycle_.cause);
  for (int i = 0; i < n; ++i) {
    run_.count_block();
    Target target = block_target(block, false);
    const int z = joint(2);
    // The place of a hole is reached at the current Z.
    target.by(z, 0.0, cycle_.cause);
    check_tilted(target, cycle_.cause);
    AxisVector end = canon_.end_of(target);
    canon_.straight({.end = end, .cause = cycle_.cause, .stated = target.stated()}, true);
    hole(canon_.unplaced(end));
  }
}

void Machine::turn_for_tap(int direction) {
  canon_.turn_spindle(cycle_code_ == 740 ? -direction : direction);
}

/// Shifts the tool across the hole by Q along +X; parameter 5148 may state another direction.
void Machine::shift_tool(double by) {
  run_.warn_once(
      "G76 and G87 shift the tool along +X (5101.4 RD1, 5101.5 RD2 and 5148 may say otherwise)");
  cycle_.at[joint(0)] += by;
  to_level(cycle_.at[joint(2)], true);
}

void Machine::pecks() {
  run_.warn_once(fmt::format(
      "the clearance of pecks in G73 and G83 is taken to be {} mm (parameters 5114 and 5115)",
      peck_clearance));
  if ((cycle_.r - cycle_.bottom) / cycle_.q > max_pecks)
    refuse(cycle_.cause, "at most 1e5 pecks in a hole", "more");
  for (int n = 1;; ++n) {
    const double depth = cycle_.r - n * cycle_.q;
    if (!(depth > cycle_.bottom)) return;
    to_level(depth, false);
    // G83 clears the chips at R; G73 only breaks them by the clearance.
    if (cycle_code_ == 830) to_level(cycle_.r, true);
    to_level(std::min(cycle_.r, depth + peck_clearance), true);
  }
}

/// G87: down to R with the tool shifted, up to Z at feed, shifted out.
void Machine::bore_from_behind() {
  const int turns = canon_.spindle_direction();
  canon_.turn_spindle(0);
  shift_tool(cycle_.q);
  to_level(cycle_.r, true);
  shift_tool(-cycle_.q);
  canon_.turn_spindle(turns);
  to_level(cycle_.bottom, false);
  canon_.dwell(cycle_.dwell_s, cycle_.cause);
  canon_.turn_spindle(0);
  shift_tool(cycle_.q);
  to_level(cycle_.initial, true);
  shift_tool(-cycle_.q);
  canon_.turn_spindle(turns);
}

/// Operations at the bottom of the hole, and retraction to R.
void Machine::bottom_of_hole() {
  const int turns = canon_.spindle_direction();
  if (dwells(cycle_code_)) canon_.dwell(cycle_.dwell_s, cycle_.cause);
  switch (cycle_code_) {
    case 740:
    case 840:
      turn_for_tap(-1);
      to_level(cycle_.r, false);
      // Rigid tapping leaves the spindle at rest.
      return turn_for_tap(rigid_ ? 0 : 1);
    case 760:
      canon_.turn_spindle(0);
      shift_tool(cycle_.q);
      to_level(to_r_ ? cycle_.r : cycle_.initial, true);
      shift_tool(-cycle_.q);
      return canon_.turn_spindle(turns);
    case 850:
    case 890:
      return to_level(cycle_.r, false);
    case 860:
      canon_.turn_spindle(0);
      to_level(cycle_.r, true);
      return canon_.turn_spindle(turns);
    default:
      return to_level(cycle_.r, true);
  }
}

/// Makes one hole, starting above its place.
void Machine::hole(const AxisVector& place) {
  cycle_.at = place;
  if (cycle_code_ == 870) return bore_from_behind();
  to_level(cycle_.r, true);
  if (is_tap(cycle_code_)) turn_for_tap(1);
  if (is_peck(cycle_code_)) pecks();
  to_level(cycle_.bottom, false);
  bottom_of_hole();
  if (!to_r_ && cycle_.initial != cycle_.r && cycle_code_ != 760) to_level(cycle_.initial, true);
}

}  // namespace abbe::sim::dialects::fanuc
