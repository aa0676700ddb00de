#include "sim/dialects/fanuc_machine.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"

namespace abbe::sim::dialects::fanuc {

using program::Feed;
using program::FeedMode;

namespace {

constexpr double smallest_feed = 1e-9;  // per minute; keeps every duration finite

/// One-shot codes whose axis words are no move of the block.
bool takes_axis_words(int one_shot) { return one_shot >= 0; }

std::string_view letters_of_one_shot(int code) {
  switch (code) {
    case 40:
      return "XUP";
    case 100:
      return "LPR";
    case 300:
      return "P";
    default:
      return "";
  }
}

}  // namespace

Machine::Machine(ProgramRun& run)
    : run_(run),
      canon_(run.canon),
      compensation_(run),
      vector_lines_(run),
      zero_(AxisVector::Zero(run.canon.position().size())) {
  const program::NcOptions& options = canon_.options();
  for (const auto& [h, mm] : options.tool_length) lengths_[h].value = mm;
  for (const auto& [d, mm] : options.tool_radius) radii_[d].value = mm;
  const auto take_wear = [](Offsets& offsets, const std::map<int, double>& wear) {
    for (const auto& [number, mm] : wear) {
      Geometry& one = offsets[number];
      if (one.value) one.value = *one.value - mm;
      one.wear = mm;
    }
  };
  take_wear(lengths_, options.length_wear);
  take_wear(radii_, options.radius_wear);
  for (std::size_t i = 0; i < options.work_offset.size(); ++i)
    systems_[int(i) + 1] = options.work_offset[i].size() > 0 ? options.work_offset[i] : zero_;
  external_ = g92_ = g52_ = zero_;
  for (const auto& [number, offset] : options.more_offset) {
    if (number == 0) external_ = offset;
    if (number > 100) systems_[number] = offset;
  }
  apply_frame();
}

double Machine::unit() const { return canon_.inch() ? units::inch : 1.0; }

double Machine::argument(const Word& word) {
  return counted(word, least_increment(word.letter, canon_.inch()));
}

double Machine::angle_of(const Word& word) { return counted(word, least_increment('A', false)); }

/// A number without a decimal point counts in increments.
double Machine::counted(const Word& word, double increment) {
  if (word.pointed || word.value == 0.0) return word.value;
  const double value = word.value * increment;
  if (!warned_of_point_) {
    warned_of_point_ = true;
    run_.warn_once(fmt::format(
        "{}:{}: {} has no decimal point and is {:g}: such numbers count in the least input "
        "increment, 0.001 mm, 0.001 degrees or 0.0001 inch (parameter 3401.0 DPI = 0, IS-B)",
        canon_.place().file, canon_.line(), shown(word.text), value));
  }
  return value;
}

double Machine::axis_word(int j, const Word& word) {
  return canon_.is_linear(j) ? length(word) : angle_of(word) * units::deg;
}

Machine::Words Machine::axis_words(const Block& block) const {
  Words words;
  for (int k = 0; k < 9; ++k)
    if (const Word& word = block[axis_letters[std::size_t(k)]]) words.emplace_back(joint(k), &word);
  return words;
}

const Word* Machine::first_axis_word(const Block& block) const {
  const Word* first = nullptr;
  for (const char letter : axis_letters)
    if (const Word& word = block[letter]; word && (!first || word.column < first->column))
      first = &word;
  return first;
}

Cause Machine::cause_of(const Block& block) const {
  for (const Group group : {Group::Motion, Group::OneShot, Group::Cycle})
    if (const Code& code = block[group]) return code.word;
  if (const Word* axis = first_axis_word(block)) return *axis;
  for (const char letter : {'R', 'I', 'J', 'K'})
    if (block[letter]) return block[letter];
  return {1, {}};
}

/// Letters beside axis words that the codes of a block take.
std::string Machine::letters_taken(const Block& block) const {
  const int once = block.tenths(Group::OneShot);
  std::string taken(letters_of_one_shot(once));
  const int rotation = block.tenths(Group::Rotation);
  if (rotation == 682) return taken + "IJKP";
  if (rotation == 680) return taken + "RIJK";
  const int code = block[Group::Motion] ? block.tenths(Group::Motion) : motion_;
  const int cycle = block[Group::Motion]  ? 800
                    : block[Group::Cycle] ? block.tenths(Group::Cycle)
                                          : cycle_code_;
  if (once < 0 && cycle != 800) taken += "RQPKL";
  if (once < 0 && cycle == 800 && (code == 20 || code == 30)) taken += "IJKR";
  const int length = block[Group::ToolLength] ? block.tenths(Group::ToolLength) : length_mode_;
  if (once < 0 && length == 435) taken += "IJK";
  const int offset = block.tenths(Group::WorkOffset);
  if (offset == 540 || offset == 541) taken += "P";
  if (block[Group::SpeedMode]) taken += "P";
  if (block[Group::Call]) taken += "PL";
  return taken;
}

/// Words that make sense only beside others.
void Machine::check_words(const Block& block) const {
  const Code& once = block[Group::OneShot];
  for (const char letter : axis_letters)
    if (const Word& word = block[letter]; word && canon_.joint_of(letter) < 0 &&
                                          !(once.tenths == 40 && (letter == 'U' || letter == 'X')))
      refuse(word, "an axis of this machine (" + canon_.letters() + ")");
  const std::string taken = letters_taken(block);
  for (const char letter : {'I', 'J', 'K', 'L', 'P', 'Q', 'R'}) {
    const Word& word = block[letter];
    if (!word || taken.find(letter) != std::string::npos) continue;
    if (block.skipped)
      run_.unknown(word, "a word of Fanuc's milling controls");
    else
      refuse(word, fmt::format("a code that takes {}", letter));
  }
  const Word* axis = first_axis_word(block);
  if (axis && block.skipped.letter == 'G')
    refuse(*axis, "no axis words beside a code that is skipped: what it makes of them is not known",
           fmt::format("{} beside {}", shown(axis->text), shown(block.skipped.text)));
  if (!takes_axis_words(once.tenths)) return;
  if (block[Group::Motion] && once.tenths != 530)
    refuse(block[Group::Motion].word, "no code of motion beside " + shown(once.word.text));
  if (block[Group::Rotation])
    refuse(block[Group::Rotation].word, "a block of its own beside " + shown(once.word.text));
}

void Machine::set_feed(const Block& block) {
  if (const Code& code = block[Group::FeedMode]) {
    const FeedMode mode = code.tenths == 930   ? FeedMode::InverseTime
                          : code.tenths == 940 ? FeedMode::PerMinute
                                               : FeedMode::PerRevolution;
    if (mode != canon_.feed_mode()) canon_.set_feed({});
    canon_.set_feed_mode(mode);
  }
  if (canon_.feed_mode() == FeedMode::InverseTime) canon_.set_feed({});
  const Word& f = block['F'];
  if (!f) return;
  if (!(f.value >= smallest_feed)) refuse(f, "a feed above zero");
  if (!f.pointed && (canon_.inch() || canon_.feed_mode() != FeedMode::PerMinute))
    refuse(f,
           "a decimal point in F under G20, G93 and G95: where it is without one is a parameter");
  canon_.set_feed(Feed{f.value, unit()});
}

void Machine::set_spindle(const Block& block) {
  if (const Code& code = block[Group::SpeedMode]) {
    surface_speed_ = code.tenths == 960;
    if (surface_speed_ && joint(0) < 0) refuse(code.word, "a machine with an X axis beside G96");
    if (!surface_speed_ && !block['S']) canon_.set_spindle_speed(speed_);
  }
  if (const Word& s = block['S']) {
    const double speed = whole(canon_, s, 10'000'000);
    if (block.tenths(Group::OneShot) == 920) {
      most_rpm_ = speed;
    } else {
      // m/min in mm, ft/min in inches
      speed_ = surface_speed_ && canon_.inch() ? speed * 0.3048 : speed;
      if (!surface_speed_) canon_.set_spindle_speed(speed);
    }
  }
  if (block[Group::RigidTap]) rigid_ = true;
  if (const Code& code = block[Group::Spindle])
    canon_.turn_spindle(code.tenths == 30 ? 1 : code.tenths == 40 ? -1 : 0);
  canon_.set_surface_speed(surface_speed_ ? std::optional(program::SurfaceSpeed{speed_, most_rpm_})
                                          : std::nullopt);
}

void Machine::call_tools(const Block& block) {
  const bool changes(block[Group::ToolChange]);
  const Word& t = block['T'];
  if (t) selected_ = whole(canon_, t, 99'999'999);
  if (changes && selected_ >= 0) tool_ = selected_;
  if (t || changes) canon_.call_tool(t ? selected_ : -1.0, changes);
  std::string text = t ? fmt::format("T{}", selected_) : "";
  const auto add = [&](bool has, const char* word) {
    if (has) text += std::string(text.empty() ? "" : " ") + word;
  };
  add(changes, "M6");
  add(block.tenths(Group::Coolant) == 70, "M7");
  add(block.tenths(Group::Coolant) == 80, "M8");
  if (!text.empty()) canon_.aside(std::move(text));
}

void Machine::set_modes(const Block& block) {
  if (const Code& code = block[Group::Units]) canon_.set_inch(code.tenths == 200);
  set_feed(block);
  set_spindle(block);
  call_tools(block);
  if (const Code& code = block[Group::Plane]) {
    if (compensation_.on() && code.tenths != plane_)
      refuse(code.word, "no change of the plane under G41 or G42");
    plane_ = code.tenths;
  }
  if (const Code& code = block[Group::Distance]) incremental_ = code.tenths == 910;
  if (const Code& code = block[Group::ReturnLevel]) to_r_ = code.tenths == 990;
  if (block[Group::CutterRadius] || block['D']) set_compensation(block);
  if (block[Group::WorkOffset]) choose_system(block);
  if (block[Group::ToolLength] || block['H']) set_tool_length(block);
  if (const Code& code = block[Group::Polar]) {
    polar_ = {.on = code.tenths == 160};
    if (polar_.on && tilted_) refuse(code.word, "G69 before G16");
  }
}

void Machine::dwell(const Block& block) {
  const Code& code = block[Group::OneShot];
  const Word* time = nullptr;
  for (const char letter : {'X', 'U', 'P'})
    if (const Word& word = block[letter]) {
      if (time) refuse(word, "one of X, U and P beside G4");
      time = &word;
    }
  if (!time) refuse(code.word, "X or U (seconds) or P (milliseconds) beside G4", "none");
  const bool worked_out = time->text.find_first_of("#[") != std::string_view::npos;
  if (time->letter == 'P' && time->pointed && !worked_out)
    refuse(*time, "milliseconds without a decimal point after P, or X in seconds");
  const double seconds = time->letter == 'P' || !time->pointed ? time->value * 1e-3 : time->value;
  if (!(seconds >= 0 && seconds <= 1e6)) refuse(*time, "0 to 1e6 seconds beside G4");
  compensation_.after(
      [this, seconds, cause = Cause{time->column, {}}] { canon_.dwell(seconds, cause); });
}

void Machine::one_shot(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (code.tenths == 40) return dwell(block);
  if (compensation_.on()) refuse(code.word, "G40 before " + shown(code.word.text));
  switch (code.tenths) {
    case 100:
      return store_data(block);
    case 280:
    case 300:
      return reference(block);
    case 520:
    case 920:
    case 921:
      return shift_origin(block);
    case 530:
      return to_axes(block);
    default:
      return turn_to_plane(block);
  }
}

void Machine::end_cycle() {
  cycle_.begun = rigid_ = false;
  cycle_.q = cycle_.dwell_s = 0.0;
  cycle_code_ = 800;
}

/// A code of motion ends a cycle, a cycle leaves the code of motion.
void Machine::set_motion(const Block& block) {
  const Code &cycle = block[Group::Cycle], &motion = block[Group::Motion];
  if (motion || cycle.tenths == 800) end_cycle();
  if (motion) motion_ = motion.tenths;
  if (cycle && cycle.tenths != 800) cycle_code_ = cycle.tenths;
}

/// The words of G5 and its kind say nothing about other codes.
void Machine::check_alone(const Block& block) const {
  const std::string own = shown(block[Group::Alone].word.text);
  for (const Code& code : block.codes)
    if (code && &code != &block[Group::Alone]) refuse(code.word, "a block of its own for " + own);
  for (const char letter : {'D', 'F', 'H', 'S', 'T'})
    if (block[letter]) refuse(block[letter], "a block of its own for " + own);
}

bool Machine::execute(const Block& block) {
  moved_ = false;
  for (const std::string_view text : block.comments) canon_.comment(text);
  if (block[Group::Alone]) return check_alone(block), true;
  check_words(block);
  set_modes(block);
  set_motion(block);
  if (const Code& code = block[Group::Rotation]) {
    if (compensation_.on()) refuse(code.word, "G40 before " + shown(code.word.text));
    set_rotation(block);
  } else if (block[Group::OneShot]) {
    one_shot(block);
  } else {
    move(block);
  }
  if (block.tenths(Group::Coolant) == 90) canon_.aside("M9");
  const Code& stop = block[Group::Stop];
  if (stop && stop.tenths <= 10) canon_.aside(fmt::format("M{}", stop.tenths / 10));
  for (const Group group : {Group::Spindle, Group::Coolant, Group::ToolChange, Group::Stop})
    if (block[group]) last_m_ = block.tenths(group) / 10;
  return !(stop && (stop.tenths == 20 || stop.tenths == 300));
}

}  // namespace abbe::sim::dialects::fanuc
