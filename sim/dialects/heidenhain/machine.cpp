#include "sim/dialects/heidenhain/machine.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/heidenhain/block.h"

namespace abbe::sim::dialects::heidenhain {

using program::Feed;
using program::FeedMode;

Machine::Machine(ProgramRun& run) : run_(run), canon_(run.canon), contour_(run) {
  length_ = canon_.options().tool_length;
  radius_ = canon_.options().tool_radius;
  datum_shift_ = turns_ = AxisVector::Zero(canon_.position().size());
  if (canon_.options().tool_table)
    // A tool that is in the spindle before the first TOOL CALL: that of the scene.
    tool_ = canon_.options().control_tool;
  else if (!length_.empty())
    tool_ = length_.contains(1) ? 1 : length_.begin()->first;
  canon_.set_inch(false);
  // Presets are points in the workpiece whether or not one is stated.
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
  // A program may end with compensation in force; its last move must not be lost.
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
      return 2.0;  // 2 stands for the tool axis Z
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

/// Throws BadInput with the sentence of the word table if that marks the word as rejected.
void Machine::refuse_if_named(const std::string& word, const Cause& cause) const {
  if (const WordTableEntry* use = find_word(heidenhain_words(), word);
      use != nullptr && use->use == Use::Refused)
    refuse(cause, std::string(use->sentence));
}

void Machine::execute(const std::string& keyword, std::size_t from, Words& words,
                      bool before_corner) {
  // A cycle of several blocks must be complete before another block begins.
  if (keyword != "CYCL") require_whole_cycle(words.cause(from));
  if (execute_motion(keyword, from, words, before_corner)) return;
  const Cause cause = words.cause(from);
  // A corner needs its second move directly behind it.
  if (contour_.waits()) {
    contour_.finish();
    refuse(cause, "a move right behind RND or CHF");
  }
  if (keyword == "M") return lone_function(from, words);
  if (keyword == "BLK") return;  // the blank is that of the scene
  if (execute_definition(keyword, from, words)) return;
  refuse_if_named(keyword, cause);
  if (const WordTableEntry* use = find_word(heidenhain_words(), keyword);
      use != nullptr && use->use == Use::WithoutEffect)
    return;
  // An unknown block without letters is quoted, up to 40 characters.
  const std::size_t end = std::min(words.cursor.text.size(), from + 40);
  run_.handle_unknown_word(keyword.empty() ? words.cursor.cause(from, end) : cause, "a block of Klartext");
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

/// M functions in a block of their own, for example 15 M30.
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
    // The dwell of FUNCTION is executed at once, while compensation still holds a move back.
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

/// Example: PRESET SELECT #1.
void Machine::preset(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  if (!words.take("SELECT") || !words.cursor.accept("#"))
    words.refuse(from, "SELECT and # with a number after PRESET");
  const int number = words.whole(9999);
  words.ends();
  choose_preset(number, words.cause(from));
}

double Machine::length_of(int number, const Cause& cause) {
  const auto known = length_.find(number);
  if (known != length_.end()) return known->second;
  if (number == 0) return 0.0;
  // With a single tool in the scene there is no doubt which one is meant, whatever its number.
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

/// The chain has the length of the tool itself if the scene has several tools, else that of H1; the
/// remainder of the control's length lies along the tool axis.
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
  canon_.select_length(number, cause);
  update_tip_mode(cause);
}

/// Example: TOOL CALL "BALL 10": a tool of the control's table or of the scene.
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
  if (words.cursor.current() == '"')
    number = tool_of_name(words);
  else if (words.has_value())
    number = words.whole(32767);
  const Cause cause = words.cause(from);
  // DL and DR hold for the call they are programmed in.
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
      // In inch programs F counts tenths of an inch per minute.
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
  // A TOOL CALL without number changes S, F, DL and DR of the current tool.
  if (number || tool_ >= 0) select_tool(number.value_or(tool_), cause);
}

/// Example: TOOL DEF 5 L+100 R+5; without L and R it only prepares the tool.
void Machine::tool_def(Words& words) {
  words.cursor.skip_blanks();
  const std::size_t from = words.cursor.at;
  if (words.cursor.current() == '"')
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

// M functions.

namespace {

/// Returns true for M functions that take effect at the end of their block.
bool is_after_motion(int number) {
  static constexpr int all[] = {0, 1, 2, 5, 9, 30, 89, 99, 127, 129};
  return std::find(std::begin(all), std::end(all), number) != std::end(all);
}

/// Skips the values that belong to M functions without effect: the X and Y of M118 move nothing,
/// the F of M103 is a percentage.
void skip_function_words(int number, Words& words) {
  const auto pass = [&](auto is_own) {
    Words ahead = words;
    const std::string name = ahead.name();
    if (!is_own(name) || !ahead.has_value()) return false;
    ahead.value();
    words.cursor.at = ahead.cursor.at;
    return true;
  };
  const auto is_axis = [](const std::string& name) {
    return name.size() == 1 &&
           std::string_view("XYZABCUVW").find(name[0]) != std::string_view::npos;
  };
  switch (number) {
    case 101:
      pass([](const std::string& name) { return name == "BT"; });
      break;
    case 103:
      pass([](const std::string& name) { return name == "F"; });
      break;
    case 118:
      while (pass(is_axis)) {
      }
      // An F behind M118 could be read as its own or as the feed of the block.
      if (Words ahead = words; ahead.name().starts_with('F'))
        words.refuse(words.cursor.at, "F before M118: what stands behind it is its own");
      break;
    case 120:
      pass([](const std::string& name) { return name == "LA"; });
      break;
    default:
      break;
  }
}

}  // namespace

/// Reads the number of an M function and the values that belong to it.
void Machine::read_function(Words& words, std::size_t from, M& m) {
  m.number = words.whole(999);
  m.cause = words.cause(from);
  const std::string name = fmt::format("M{}", m.number);
  refuse_if_named(name, m.cause);
  if (find_word(heidenhain_words(), name) == nullptr) run_.handle_unknown_word(m.cause, "an M word of a TNC");
  const auto next_is = [&](std::string_view wanted) {
    Words ahead = words;
    if (ahead.name() != wanted) return false;
    words.cursor.at = ahead.cursor.at;
    return true;
  };
  skip_function_words(m.number, words);
  if (m.number == 140) {
    words.cursor.skip_blanks();
    // MB MAX may be written with or without a blank.
    if (next_is("MBMAX"))
      m.mb_max = true;
    else if (!next_is("MB"))
      words.refuse(words.cursor.at, "MB after M140");
    else if (next_is("MAX"))
      m.mb_max = true;
    else
      m.mb = words.value() * unit();
  }
  if (m.number == 140 || m.number == 128) {
    words.cursor.skip_blanks();
    const std::size_t at = words.cursor.at;
    Words ahead = words;
    if (const std::string feed = ahead.name(); feed.starts_with('F')) {
      words.cursor.at = ahead.cursor.at;
      const FeedValue value = feed_value(feed.substr(1), words, at);
      m.rapid = value.word == FeedWord::Rapid;
      if (!m.rapid) m.feed = value.value;
      if (value.word == FeedWord::PerTurn)
        words.refuse(at, "a feed per minute after M140 and M128");
    }
  }
  // M128 F limits the compensating moves, which take no time of their own here.
  if (m.number == 128 && m.feed)
    run_.warn_once("F beside M128 limits the feed of compensating moves: it has no effect here");
  if (m.number == 94 && !words.at_end()) {
    Words ahead = words;
    const std::string axis = ahead.name();
    // M94 takes an axis letter without a value.
    if (axis.size() == 1 && !ahead.has_value()) {
      m.axis = axis.front();
      words.cursor.at = ahead.cursor.at;
    }
  }
}

void Machine::apply_functions_before_motion(Move& move) {
  for (const M& m : move.functions)
    if (!is_after_motion(m.number)) start_function(m, move);
}

void Machine::start_function(const M& m, Move& move) {
  const auto spindle = [&](int direction) {
    // Under compensation M functions follow the waiting move.
    contour_.after([this, direction] { canon_.turn_spindle(direction); });
  };
  const auto aside = [&](const char* text) {
    contour_.after([this, text] { canon_.aside(text); });
  };
  switch (m.number) {
    case 3:
    case 4:
      return spindle(m.number == 3 ? 1 : -1);
    case 7:
      return aside("M7");
    case 8:
      return aside("M8");
    case 13:
    case 14:
      spindle(m.number == 13 ? 1 : -1);
      return aside("M8");
    case 91:
      move.machine = true;
      return;
    case 94:
      return reduce_turns(m);
    case 126:
      short_way_ = true;
      return;
    case 128:
      return set_tcpm(true, m.cause);
    case 136:
      if (canon_.inch()) refuse(m.cause, "M136 in a program of MM");
      per_turn_ = feed_per_turn_ = true;
      feed_.reset();
      return;
    case 137:
      // F has another meaning after a change of mode, so the old value must not survive.
      if (per_turn_) feed_.reset();
      per_turn_ = feed_per_turn_ = false;
      return;
    case 140:
      return retract(m, move);
    default:
      return;  // without effect, as the table of words says
  }
}

// M89 and M99 call the cycle after the motion of the block, where the other functions follow too.
void Machine::apply_functions_after_motion(const Move& move) {
  bool calls = modal_cycle_ && std::any_of(move.axes.begin(), move.axes.end(),
                                           [](const auto& axis) { return axis.has_value(); });
  Cause cause = move.cause;
  for (const M& m : move.functions) {
    if (m.number == 99) {
      calls = true;
      modal_cycle_ = false;
      cause = m.cause;
    } else if (m.number == 89) {
      calls = modal_cycle_ = true;
      cause = m.cause;
    } else if (is_after_motion(m.number)) {
      end_function(m);
    }
  }
  if (calls) run_cycle(0.0, cause);
}

void Machine::end_function(const M& m) {
  switch (m.number) {
    case 0:
    case 1:
    case 9: {
      const char* text = m.number == 0 ? "M0" : m.number == 1 ? "M1" : "M9";
      return contour_.after([this, text] { canon_.aside(text); });
    }
    case 5:
      return contour_.after([this] { canon_.turn_spindle(0); });
    case 127:
      short_way_ = false;
      return;
    case 129:
      return set_tcpm(false, m.cause);
    case 2:
    case 30:
      // Waiting moves are made before the program ends.
      contour_.finish();
      ended_ = true;
      return;
    default:
      return;
  }
}

/// M94 removes whole turns from the position of a rotary axis.
void Machine::reduce_turns(const M& m) {
  if (contour_.beside()) refuse(m.cause, "R0 before M94");
  const AxisVector p = canon_.programmed();
  const char only = m.axis;
  if (only != '\0') joint_of(only, m.cause);
  for (const char letter : {'A', 'B', 'C'})
    if (const int j = canon_.joint_of(letter);
        j >= 0 && !canon_.is_linear(j) && (only == '\0' || only == letter))
      // 1e-9 turns absorb rounding, so that 360 degrees become 0 and not 360.
      turns_[j] += 2 * pi * std::floor(p[j] / (2 * pi) + 1e-9);
  apply_frame(m.cause);
}

void Machine::retract(const M& m, const Move& move) {
  if (contour_.beside()) refuse(m.cause, "R0 before M140");
  // A block with axes could retract before or after its motion.
  for (const auto& axis : move.axes)
    if (axis)
      refuse(m.cause, "M140 in a block without axes: which of the two is first is not known");
  const auto before = canon_.feed();
  if (m.feed) {
    if (!(*m.feed > 0)) refuse(m.cause, "a feed above zero");
    canon_.set_feed(Feed{*m.feed, canon_.inch() ? 0.1 * units::inch : 1.0});
  }
  retract_by(m.mb.value_or(0.0), m.mb_max, !m.feed, m.cause);
  canon_.set_feed(before);
}

}  // namespace abbe::sim::dialects::heidenhain
