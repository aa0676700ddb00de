#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/fanuc_machine.h"
#include "sim/program/arc_of_block.h"

namespace abbe::sim::dialects::fanuc {

using kinematics::AxisVector;
using program::ArcMove;
using program::Coordinates;
using program::Straight;

/// The words of G16: of the axes of the plane the first is a radius about the origin, under G91
/// about where the tool stands, the second an angle, under G91 from the one before.
void Machine::polar_words(const Block& block, Target& target) {
  const std::string_view plane = plane_letters();
  const Word &r = block[plane[0]], &a = block[plane[1]];
  if (!r && !a) return;
  const int first = canon_.joint_of(plane[0]), second = canon_.joint_of(plane[1]);
  const AxisVector p =
      canon_.unplaced(compensation_.on() || compensation_.leaving() ? compensation_.programmed()
                                                                    : canon_.position());
  if (r) {
    polar_.radius = length(r);
    polar_.centre = incremental_ ? Eigen::Vector2d(p[first], p[second]) : Eigen::Vector2d(0, 0);
  }
  if (a) polar_.angle = angle_of(a) + (incremental_ ? polar_.angle : 0.0);
  const double angle = polar_.angle * units::deg;
  const Word& word = r ? r : a;
  target.to(first, polar_.centre.x() + polar_.radius * std::cos(angle), word);
  target.to(second, polar_.centre.y() + polar_.radius * std::sin(angle), word);
}

Target Machine::target_of(const Block& block, bool machine) {
  Target target;
  const std::string_view plane = plane_letters();
  for (const auto& [j, word, step] : axis_words(block)) {
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
  if (compensation_.on()) return compensation_.straight(std::move(move), motion_ == 0);
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
  ArcMove arc = program::arc_of_block(
      canon_, {.plane = plane_ / 10,
               .clockwise = motion_ == 20,
               .from = beside ? compensation_.programmed() : canon_.position(),
               .end = std::move(end),
               .cause = cause,
               .stated = stated,
               .word = [&](char letter) -> std::optional<program::LengthWord> {
                 const Word& word = block[letter];
                 if (!word) return std::nullopt;
                 return program::LengthWord{length(word), word};
               }});
  if (beside && !compensation_.entered())
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
  if (motion_ == 900 || motion_ == 940) {
    if (axis) turning_cycle(block);
    return;
  }
  const bool turns = length_mode_ == 435 && arc_words && !is_arc;
  if (!axis && !turns && !(is_arc && arc_words)) return;
  moved_ = true;
  const Cause cause = cause_of(block);
  note_uncalled_tool(cause);
  const Target target = target_of(block, false);
  check_tilted(target, cause);
  const bool beside = compensation_.on() || compensation_.leaving();
  AxisVector end = beside ? compensation_.end_of(target) : canon_.end_of(target);
  if (compensation_.leaving() && is_arc) refuse(cause, "a line as the first move after G40");
  compensation_.left_behind();
  if (length_mode_ == 435) end = by_direction(block, std::move(end));
  if (is_arc)
    arc(block, std::move(end), target.stated());
  else
    straight(block, std::move(end), target.stated());
}

/// G53: positions of the axes, at once.
void Machine::to_axes(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (incremental_) refuse(code.word, "G90 beside G53");
  const Target target = target_of(block, true);
  if (target.empty()) refuse(code.word, "an axis word beside G53", "none");
  moved_ = true;
  compensation_.left_behind();
  canon_.go_to(Coordinates::Axis, code.word);
  canon_.straight({.end = canon_.end_of(target, true),
                   .cause = code.word,
                   .without_offset = true,
                   .stated = target.stated()},
                  true);
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, code.word);
}

/// G28, G30: over the point of the words to the reference position of their axes.
void Machine::reference(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (const Word& p = block['P']; p && whole(canon_, p, 4) < 2) refuse(p, "P2 P3 or P4 beside G30");
  const Target words = target_of(block, false);
  if (words.empty()) refuse(code.word, "an axis word beside " + shown(code.word.text), "none");
  moved_ = true;
  compensation_.left_behind();
  canon_.straight({.end = canon_.end_of(words), .cause = code.word, .stated = words.stated()},
                  true);
  const AxisVector stored = program::reference_of(canon_.options());
  std::string where;
  for (const auto& axis : canon_.options().axes)
    if (const int j = canon_.joint_of(axis.name); j >= 0 && words.has(j))
      where += fmt::format(" {}{:g}", axis.name,
                           stored[j] / (canon_.is_linear(j) ? 1.0 : units::deg) + 0.0);
  if (canon_.options().reference.size() == 0)
    canon_.assume({"the reference position (G28, G30) is where the axes stand at first:" + where,
                   "machine.reference"});
  canon_.go_to(Coordinates::Axis, code.word);
  AxisVector end = canon_.position();
  for (int j = 0; j < int(end.size()); ++j)
    if (words.has(j)) end[j] = stored[j];
  canon_.straight({.end = std::move(end),
                   .cause = code.word,
                   .without_offset = true,
                   .stated = words.given()},
                  true);
  if (canon_.tip_mode()) canon_.go_to(Coordinates::Tip, code.word);
}

}  // namespace abbe::sim::dialects::fanuc
