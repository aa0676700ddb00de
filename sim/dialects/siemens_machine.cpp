#include "sim/dialects/siemens_machine.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::siemens {

using kinematics::AxisVector;
using program::Feed;
using program::FeedMode;

namespace {

constexpr double least_feed = 1e-9;  // per minute; keeps every duration finite
constexpr std::pair<Address, char> axis_addresses[] = {
    {Address::X, 'X'}, {Address::Y, 'Y'}, {Address::Z, 'Z'}, {Address::A, 'A'}, {Address::B, 'B'},
    {Address::C, 'C'}, {Address::U, 'U'}, {Address::V, 'V'}, {Address::W, 'W'}};

bool is_arc(std::string_view motion) { return motion == "G2" || motion == "G3"; }

}  // namespace

Machine::Machine(ProgramRun& run, bool tool_changes_by_m6)
    : run_(run),
      canon_(run.canon),
      turning_(canon_.options().control),
      changes_by_m6_(tool_changes_by_m6),
      programmable_turns_(AxisVector::Zero(canon_.position().size())),
      compensation_(run) {
  canon_.count_from_workpiece();
  apply_tool();
}

const Value* Machine::first_axis_word(const Block& block) const {
  const Value* first = nullptr;
  for (const auto& [address, letter] : axis_addresses)
    if (const Value& word = block[address];
        word && (first == nullptr || word.cause.column < first->cause.column))
      first = &word;
  return first;
}

Cause Machine::cause_of(const Block& block) const {
  if (const Code& code = block[Group::Motion]) return code.cause;
  if (const Value* axis = first_axis_word(block)) return axis->cause;
  using enum Address;
  for (const Address address : {CR, AR, RP, AP, I, J, K, A3, B3, C3, I1, J1, K1, TURN, RPL})
    if (block[address]) return block[address].cause;
  return {1, {}};
}

/// Words that make sense only beside others.
void Machine::check_words(const Block& block) const {
  using enum Address;
  for (const auto& [address, letter] : axis_addresses)
    if (const Value& word = block[address]; word && canon_.joint_of(letter) < 0)
      refuse(word, "an axis of this machine (" + canon_.letters() + ")");
  const std::string_view motion = block[Group::Motion] ? block.word(Group::Motion) : motion_;
  const auto only_beside = [&](std::initializer_list<Address> addresses, bool beside,
                               std::string_view what) {
    for (const Address address : addresses)
      if (block[address] && !beside)
        refuse(block[address], fmt::format("{} beside {}", what, shown(block[address].cause.text)));
  };
  const bool round = is_arc(motion) && !block[Group::Frame] && !block[Group::Dwell];
  only_beside({I, J, K}, round || motion == "G33", "G2, G3 or G33");
  only_beside({CR, AR, TURN}, round || (motion == "CIP" && block[TURN]), "G2 or G3");
  only_beside({I1, J1, K1}, motion == "CIP", "CIP");
  only_beside({RPL}, block.word(Group::Frame) == "ROT" || block.word(Group::Frame) == "AROT",
              "ROT or AROT");
  only_beside({A3, B3, C3}, traori_ || block.word(Group::Transformation) == "TRAORI", "TRAORI");
  only_beside({LIMS}, true, "G96");
  only_beside({P}, block.call.has_value(), "a subprogram");
  if (const Value& offset = block[OFFN]; offset && offset.value != 0)
    refuse(offset, std::string(fact_of("OFFN")->sentence));
  if (const Value& t = block[T];
      t && !block.tool_name && (t.value < 0 || t.value != std::floor(t.value) || t.value > 1e9))
    refuse(t, "a whole tool number");
  if (const Value& d = block[D]; d && d.value != 0 && d.value != 1)
    refuse(d, "D0 or D1: a tool of the scene has one edge");
  for (const auto& value : block.values)
    if (value && value.measure != Measure::Modal) {
      const Address address = Address(&value - block.values.data());
      if (address <= K1 || address == AP || address == RP) continue;
      refuse(value, "a number without AC() and the like");
    }
}

void Machine::set_feed(const Block& block) {
  if (const Code& code = block[Group::Units]) {
    canon_.set_inch(code.word == "G70" || code.word == "G700");
    inch_feed_ = code.word == "G700";
  }
  if (const Code& code = block[Group::FeedMode]) {
    const FeedMode mode = code.word == "G93"   ? FeedMode::InverseTime
                          : code.word == "G94" ? FeedMode::PerMinute
                                               : FeedMode::PerRevolution;
    if (mode != canon_.feed_mode()) canon_.set_feed({});
    canon_.set_feed_mode(mode);
  }
  if (const Code& code = block[Group::SpeedMode];
      code && canon_.feed_mode() != FeedMode::PerRevolution) {
    canon_.set_feed({});
    canon_.set_feed_mode(FeedMode::PerRevolution);
  }
  if (block[Group::Dwell]) return;
  if (canon_.feed_mode() == FeedMode::InverseTime) canon_.set_feed({});
  if (const Value& f = block[Address::F]) {
    if (!(f.value >= least_feed)) refuse(f, "a feed above zero");
    canon_.set_feed(Feed{f.value, inch_feed_ ? inch_mm : 1.0});
  }
}

void Machine::set_spindle(const Block& block) {
  if (const Value& most = block[Address::LIMS]) {
    if (!(most.value > 0 && most.value <= 1e7)) refuse(most, "a speed of more than 0 to 1e7 rpm");
    most_rpm_ = most.value;
  }
  if (const Code& code = block[Group::SpeedMode]) {
    if (code.word == "G96" && joint(0) < 0) refuse(code.cause, "a machine with an X axis");
    const bool surface = code.word == "G96";
    if (surface != surface_speed_) speed_ = surface ? 0.0 : canon_.spindle_speed();
    surface_speed_ = surface;
  }
  const bool limits = block[Group::Limits].word.size() > 0;
  if (const Value& s = block[Address::S]; s && !block[Group::Dwell] && !limits) {
    if (s.value < 0 || s.value > 1e7) refuse(s, "a spindle speed of 0 to 1e7 rpm");
    // m/min in mm, ft/min in inches
    speed_ = surface_speed_ && inch_feed_ ? s.value * 0.3048 : s.value;
    if (!surface_speed_) canon_.set_spindle_speed(s.value);
  }
  if (const Code& code = block[Group::Spindle])
    canon_.turn_spindle(code.word == "M3" ? 1 : code.word == "M4" ? -1 : 0);
  canon_.set_surface_speed(surface_speed_ ? std::optional(program::SurfaceSpeed{speed_, most_rpm_})
                                          : std::nullopt);
}

void Machine::note_coolant(const Block& block) const {
  std::string text;
  for (const std::string_view word : block.coolant)
    text += (text.empty() ? "" : " ") + std::string(word);
  if (!text.empty()) canon_.aside(std::move(text));
}

void Machine::dwell(const Block& block) {
  const Code& code = block[Group::Dwell];
  const Value &seconds = block[Address::F], &turns = block[Address::S];
  if (bool(seconds) == bool(turns)) refuse(code.cause, "either F or S beside G4");
  if (turns && !(canon_.spindle_speed() > 0)) refuse(turns, "a spindle that turns beside G4 S");
  const double time = seconds ? seconds.value : turns.value * 60.0 / canon_.spindle_speed();
  const Cause cause = seconds ? seconds.cause : turns.cause;
  if (!(time >= 0 && time <= 1e6)) refuse(cause, "0 to 1e6 seconds");
  compensation_.after([this, time, cause = Cause{cause.column, {}}] { canon_.dwell(time, cause); });
}

/// Words that G41 and G42 do not go with.
void Machine::check_compensation(const Block& block) const {
  if (!compensation_.on()) return;
  const Code& side = block[Group::CutterRadius];
  for (const Group group : {Group::Plane, Group::Units, Group::WorkOffset, Group::WithoutOffset,
                            Group::Transformation, Group::Pole, Group::Frame, Group::ToolChange})
    if (const Code& code = block[group]) refuse(code.cause, "G40 before " + shown(code.cause.text));
  if (side && side.word != "G40" && (side.word == "G41") != compensation_.left())
    refuse(side.cause, "G40 between G41 and G42");
  for (const Address address : {Address::T, Address::D, Address::A, Address::B, Address::C,
                                Address::A3, Address::B3, Address::C3})
    if (block[address]) refuse(block[address], "G40 before " + shown(block[address].cause.text));
  if (const Code& code = block[Group::Motion]; code && (code.word == "CIP" || code.word == "G33"))
    refuse(code.cause, "G40 before " + shown(code.cause.text));
}

void Machine::choose_system(const Code& code) {
  const int number = std::stoi(std::string(code.word.substr(1)));
  if (number > 506 && !canon_.options().more_offset.contains(number))
    refuse(code.cause,
           fmt::format("G54 to G57, G505 or G506, or an offset that the control's table has "
                       "(`offsets`): $P_UIFR[{}]",
                       number - 500));
  const int first = number < 500 ? 54 : number > 506 ? 1 : 501;
  system_ = number - first;
  apply_frame();
}

void Machine::set_modes(const Block& block) {
  set_feed(block);
  set_spindle(block);
  if (const Code& code = block[Group::Plane])
    plane_ = code.word == "G17" ? 17 : code.word == "G18" ? 18 : 19;
  if (const Code& code = block[Group::Distance]) incremental_ = code.word == "G91";
  if (const Code& code = block[Group::OrientationFrame]) workpiece_frame_ = code.word == "ORIWKS";
  if (const Code& code = block[Group::OrientationWay]) on_great_circle_ = code.word != "ORIAXES";
  call_tools(block);
  if (const Code& code = block[Group::WorkOffset]) {
    choose_system(code);
  }
  if (const Code& code = block[Group::Transformation]) change_transformation(code);
  if (const Code& code = block[Group::CutterRadius]) set_compensation(code);
}

Executed Machine::execute(const Block& block) {
  check_words(block);
  check_compensation(block);
  set_modes(block);
  note_coolant(block);
  const Code& stop = block[Group::Stop];
  const bool ends = stop && (stop.word == "M2" || stop.word == "M30" || stop.word == "M17");
  if (const Code& code = block[Group::Motion]) motion_ = code.word;
  Executed done{false, ends};
  if (block[Group::Frame])
    frame_words(block);
  else if (block[Group::Dwell])
    dwell(block);
  else if (block[Group::Pole])
    set_pole(block);
  else if (!block[Group::Limits])
    done.moved = move(block);
  if (stop && !ends) canon_.aside(stop.word == "M1" ? "M1" : "M0");
  return done;
}

std::optional<double> Machine::position(char letter, bool of_the_axis) const {
  const int j = canon_.joint_of(letter);
  if (j < 0) return std::nullopt;
  const double value = of_the_axis ? here()[j] : programmed_here()[j];
  return canon_.is_linear(j) ? value / unit() : value / units::deg;
}

}  // namespace abbe::sim::dialects::siemens
