#include "sim/dialects/heidenhain_machine.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain_words.h"

namespace abbe::sim::dialects::heidenhain {

using program::Feed;
using program::FeedMode;

Machine::Machine(ProgramRun& run) : run_(run), canon_(run.canon), contour_(run) {
  length_ = canon_.options().tool_length;
  radius_ = canon_.options().tool_radius;
  datum_shift_ = turns_ = AxisVector::Zero(canon_.position().size());
  if (canon_.options().tool_table)
    tool_ = canon_.options().control_tool;
  else if (!length_.empty())
    tool_ = length_.contains(1) ? 1 : length_.begin()->first;
  canon_.set_inch(false);
  canon_.count_from_workpiece();
  apply_frame({1, {}});
}

void Machine::set_inch(bool inch) { canon_.set_inch(inch); }

double Machine::unit() const { return canon_.inch() ? units::inch : 1.0; }

int Machine::joint_of(char letter, const Cause& cause) const {
  const int joint = canon_.joint_of(letter);
  if (joint < 0) refuse(cause, "an axis of this machine (" + canon_.letters() + ")");
  return joint;
}

void Machine::end_of_program() {
  if (contour_.beside() || contour_.waits()) contour_.finish();
}

void Machine::finish() { contour_.finish(); }

std::optional<double> Machine::preset_parameter(int number) const {
  const auto of_tool = [&](const std::map<int, double>& values, double added) {
    const auto found = values.find(tool_);
    return found == values.end() ? std::nullopt : std::optional((found->second + added) / unit());
  };
  switch (number) {
    case 108:
      return of_tool(radius_, delta_radius_);
    case 109:
      return 2.0;  // the tool axis is Z
    case 110:
      return canon_.spindle_direction() > 0 ? 0.0 : canon_.spindle_direction() < 0 ? 1.0 : 2.0;
    case 113:
      return canon_.inch() ? 1.0 : 0.0;
    case 114:
      return of_tool(length_, delta_length_);
    case 120:
    case 121:
    case 122:
      return plane_axes_[std::size_t(number - 120)];
    default:
      return std::nullopt;
  }
}

/// Refuses a word that the table has as refused.
void Machine::refuse_if_named(const std::string& word, const Cause& cause) const {
  if (const WordUse* use = find_word(heidenhain_words(), word);
      use != nullptr && use->use == Use::Refused)
    refuse(cause, std::string(use->sentence));
}

void Machine::execute(const std::string& keyword, std::size_t from, Words& words,
                      bool before_corner) {
  if (keyword != "CYCL") require_whole_cycle(words.cause(from));
  if (execute_motion(keyword, from, words, before_corner)) return;
  const Cause cause = words.cause(from);
  if (contour_.waits()) {
    contour_.finish();
    refuse(cause, "a move right behind RND or CHF");
  }
  if (keyword == "M") return lone_function(from, words);
  if (keyword == "BLK") return;  // the blank is the scene's
  if (execute_definition(keyword, from, words)) return;
  refuse_if_named(keyword, cause);
  if (const WordUse* use = find_word(heidenhain_words(), keyword);
      use != nullptr && use->use == Use::WithoutEffect)
    return;
  const std::size_t end = std::min(words.cursor.text.size(), from + 40);
  run_.unknown(keyword.empty() ? words.cursor.cause(from, end) : cause, "a block of Klartext");
}

bool Machine::execute_motion(const std::string& keyword, std::size_t from, Words& words,
                             bool before_corner) {
  static constexpr std::string_view motions[] = {"L", "LN", "LP", "C", "CR", "CT", "CP", "CTP"};
  if (std::find(std::begin(motions), std::end(motions), keyword) != std::end(motions)) {
    Move read = read_move(keyword, from, words);
    read.before_corner = before_corner;
    move(std::move(read));
    return true;
  }
  if (keyword == "CC") return pole(words), true;
  if (keyword == "RND" || keyword == "CHF") return corner(keyword, words), true;
  return false;
}

bool Machine::execute_definition(const std::string& keyword, std::size_t from, Words& words) {
  if (keyword == "TOOL") {
    if (words.take("CALL")) return tool_call(words), true;
    if (words.take("DEF")) return tool_def(words), true;
    words.refuse(words.cursor.at, "CALL or DEF after TOOL");
  }
  if (keyword == "STOP") return stop(words), true;
  if (keyword == "CYCL") {
    if (contour_.beside()) words.refuse(from, "R0 before CYCL");
    if (words.take("DEF")) return cycle_definition(words), true;
    if (words.take("CALL")) return cycle_call(words), true;
    words.refuse(words.cursor.at, "DEF or CALL after CYCL");
  }
  if (keyword == "PLANE") return plane(words), true;
  if (keyword == "FUNCTION") return function_block(words), true;
  if (keyword == "TRANS") return trans(words), true;
  if (keyword == "PRESET") return preset(words), true;
  return false;
}

/// M words that stand alone, as 15 M30.
void Machine::lone_function(std::size_t from, Words& words) {
  words.cursor.at = from;
  Move only = read_move("", from, words);
  move(std::move(only));
}

void Machine::stop(Words& words) {
  if (words.at_end()) return canon_.aside("M0");
  Move only = read_move("", words.cursor.at, words);
  canon_.aside("M0");
  move(std::move(only));
}

void Machine::function_block(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  if (words.take("TCPM")) return tcpm(words);
  if (words.take("RESET")) {
    if (!words.take("TCPM")) words.refuse(words.cursor.at, "TCPM after FUNCTION RESET");
    words.ends();
    return set_tcpm(false, words.cause(from));
  }
  if (words.take("DWELL")) {
    const std::size_t at = words.cursor.at;
    if (words.name() != "TIME") words.refuse(at, "TIME and seconds after FUNCTION DWELL");
    const double seconds = words.value();
    words.ends();
    if (contour_.beside()) words.refuse(from, "R0 before FUNCTION DWELL");
    return canon_.dwell(seconds, words.cause(at));
  }
  if (words.take("MODE")) {
    if (!words.take("MILL"))
      words.refuse(words.cursor.at, "MILL: turning and grinding are not read");
    return words.ends();
  }
  const std::string word = words.name();
  words.refuse(from, "TCPM, RESET TCPM, DWELL or MODE MILL after FUNCTION");
}

/// PRESET SELECT #1
void Machine::preset(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  if (!words.take("SELECT") || !words.cursor.take("#"))
    words.refuse(from, "SELECT and # with a number after PRESET");
  const int number = words.whole(9999);
  words.ends();
  choose_preset(number, words.cause(from));
}

double Machine::length_of(int number, const Cause& cause) {
  const auto known = length_.find(number);
  if (known != length_.end()) return known->second;
  if (number == 0) return 0.0;
  if (canon_.options().tool_length.size() == 1 && canon_.options().control_of_h.empty() &&
      !canon_.options().tool_table) {
    const double length = canon_.options().tool_length.begin()->second;
    canon_.assume({fmt::format("TOOL CALL {} calls the only tool, {:.6g} mm long", number, length),
                   "tool.number"});
    if (!radius_.contains(number) && !canon_.options().tool_radius.empty())
      radius_[number] = canon_.options().tool_radius.begin()->second;
    return length_[number] = length;
  }
  std::string numbers;
  for (const auto& [one, mm] : length_)
    numbers += fmt::format("{}{}", numbers.empty() ? "" : " ", one);
  refuse(cause, "a tool whose length is known (" + (numbers.empty() ? "none is" : numbers) + ")");
}

/// The length of the chain's tool is that of the tool itself where the scene has several, else that
/// of H1; what the control believes beyond it lies along the tool axis.
void Machine::select_tool(int number, const Cause& cause) {
  const double length = length_of(number, cause) + delta_length_;
  const auto& known = canon_.options().tool_length;
  double of_chain = length;
  if (const auto own = known.find(number);
      own != known.end() && canon_.options().control_of_h.contains(number))
    of_chain = own->second;
  else if (canon_.options().tool_table)
    of_chain = length_of(canon_.options().control_tool, cause);
  else if (!known.empty())
    of_chain = known.contains(1) ? known.at(1) : known.begin()->second;
  tool_ = number;
  delta_ = length - of_chain;
  canon_.call_length(number, cause);
  update_tip_mode(cause);
}

/// TOOL CALL "BALL 10": a tool of the control's table or of the scene.
int Machine::tool_of_name(Words& words) {
  Cursor& cursor = words.cursor;
  const std::size_t from = cursor.at, close = cursor.text.find('"', from + 1);
  const auto& numbers = canon_.options().tool_number;
  const auto known = close == std::string_view::npos
                         ? numbers.end()
                         : numbers.find(cursor.text.substr(from + 1, close - from - 1));
  if (known == numbers.end())
    words.refuse(from, "a tool by its number: the scene has no tools of that name");
  cursor.at = close + 1;
  return known->second;
}

void Machine::tool_call(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  if (contour_.beside()) words.refuse(from, "R0 before TOOL CALL");
  std::optional<int> number;
  if (words.cursor.here() == '"')
    number = tool_of_name(words);
  else if (words.has_value())
    number = words.whole(32767);
  const Cause cause = words.cause(from);
  if (number) delta_length_ = delta_radius_ = 0.0;
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.name();
    if (name == "Z") continue;
    if (name == "X" || name == "Y") words.refuse(at, "the tool axis Z");
    if (name == "S") {
      const double rpm = words.value();
      if (!(rpm >= 0 && rpm <= 1e7)) words.refuse(at, "a spindle speed of 0 to 1e7 rpm");
      canon_.set_spindle_speed(rpm);
    } else if (name == "F") {
      tool_feed_ = words.value();
      if (!(tool_feed_ > 0)) words.refuse(at, "a feed above zero");
      feed_ = Feed{tool_feed_, canon_.inch() ? 0.1 * units::inch : 1.0};
      feed_per_turn_ = per_turn_;
    } else if (name == "DL") {
      delta_length_ = words.value() * unit();
    } else if (name == "DR") {
      delta_radius_ = words.value() * unit();
    } else {
      refuse_if_named(name, words.cause(at));
      words.refuse(at, "Z, S, F, DL or DR after TOOL CALL");
    }
  }
  if (number) {
    tool_called_ = true;
    canon_.call_tool(*number, true);
    canon_.aside(fmt::format("T{} M6", *number));
  }
  if (number || tool_ >= 0) select_tool(number.value_or(tool_), cause);
}

/// TOOL DEF 5 L+100 R+5; without L and R it only makes ready.
void Machine::tool_def(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  if (words.cursor.here() == '"')
    words.refuse(from, "a tool by its number: the scene has no tools of that name");
  const int number = words.whole(32767);
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.name();
    if (name == "L")
      length_[number] = words.value() * unit();
    else if (name == "R")
      radius_[number] = words.value() * unit();
    else
      words.refuse(at, "L or R after TOOL DEF");
  }
}

}  // namespace abbe::sim::dialects::heidenhain
