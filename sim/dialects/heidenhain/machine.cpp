#include "sim/dialects/heidenhain/heidenhain.h"

namespace abbe::sim::dialects::heidenhain {

Machine::Machine(ProgramRun& run) : Control(run), contour_(run) {
  length_ = canon_.options().tool_length;
  radius_ = canon_.options().tool_radius;
  datum_shift_ = removed_turns_ = AxisVector::Zero(canon_.position().size());
  if (canon_.options().tool_table)
    // Before the first TOOL CALL the tool of the scene is in the spindle.
    tool_ = canon_.options().control_tool;
  else if (!length_.empty())
    tool_ = length_.contains(1) ? 1 : length_.begin()->first;
  canon_.set_inch(false);
  // Presets are points in the workpiece even if the scene states none.
  canon_.refer_offsets_to_workpiece();
  apply_frame({1, {}});
}

int Machine::joint_of(char letter, const Cause& cause) const {
  const int joint = canon_.joint_of(letter);
  if (joint < 0) throw_input_error(cause, "an axis of this machine (" + canon_.letters() + ")");
  return joint;
}

void Machine::end_of_program() {
  // The last move of a program that ends with compensation in force must not be lost.
  if (contour_.is_compensated() || contour_.is_waiting()) contour_.finish();
}

std::optional<double> Machine::preset_parameter(int number) const {
  const auto tool_value = [&](const std::map<int, double>& values, double delta) {
    const auto value = find_value(values, tool_);
    return value ? std::optional((*value + delta) / unit()) : std::nullopt;
  };
  if (number == 108) return tool_value(radius_, delta_radius_);
  if (number == 109) return 2.0;  // 2 stands for the tool axis Z
  const int direction = canon_.spindle_direction();
  if (number == 110) return direction > 0 ? 0.0 : direction < 0 ? 1.0 : 2.0;
  if (number == 113) return canon_.inch() ? 1.0 : 0.0;
  if (number == 114) return tool_value(length_, delta_length_);
  if (number >= 120 && number <= 122) return plane_axes_[std::size_t(number - 120)];
  return std::nullopt;
}

/// Throws BadInput with the sentence of the word table if the table rejects the word.
void Machine::reject_unsupported(const std::string& word, const Cause& cause) const {
  if (const WordTableEntry* entry = find_word(heidenhain_words(), word);
      entry != nullptr && entry->use == WordTreatment::Refused)
    throw_input_error(cause, std::string(entry->sentence));
}

void Machine::execute(const std::string& keyword, std::size_t from, WordReader& words,
                      bool before_corner) {
  // A cycle of several blocks must be complete before a block of another kind.
  if (keyword != "CYCL") require_complete_cycle(words.cause(from));
  if (execute_motion(keyword, from, words, before_corner)) return;
  const Cause cause = words.cause(from);
  // A move must follow a corner directly.
  if (contour_.is_waiting()) {
    contour_.finish();
    throw_input_error(cause, "a move immediately after RND or CHF");
  }
  if (keyword == "M") return execute_m_block(from, words);
  if (keyword == "BLK") return;  // the blank is that of the scene
  if (execute_definition(keyword, from, words)) return;
  reject_unsupported(keyword, cause);
  if (const WordTableEntry* entry = find_word(heidenhain_words(), keyword);
      entry != nullptr && entry->use == WordTreatment::WithoutEffect)
    return;
  // The message quotes up to 40 characters of an unknown block without letters.
  const std::size_t end = std::min(words.cursor.text.size(), from + 40);
  run_.handle_unknown_word(keyword.empty() ? words.cursor.cause(from, end) : cause,
                           "a Klartext block");
}

bool Machine::execute_motion(const std::string& keyword, std::size_t from, WordReader& words,
                             bool before_corner) {
  static constexpr std::string_view motions[] = {"L", "LN", "LP", "C", "CR", "CT", "CP", "CTP"};
  if (std::find(std::begin(motions), std::end(motions), keyword) != std::end(motions)) {
    MotionBlock block = read_move(keyword, from, words);
    block.before_corner = before_corner;
    move(std::move(block));
    return true;
  }
  if (keyword == "CC") return set_pole(words), true;
  if (keyword == "RND" || keyword == "CHF") return execute_corner(keyword, words), true;
  return false;
}

bool Machine::execute_definition(const std::string& keyword, std::size_t from, WordReader& words) {
  if (keyword == "TOOL") {
    if (words.accept("CALL")) return tool_call(words), true;
    if (words.accept("DEF")) return tool_def(words), true;
    words.throw_input_error(words.cursor.at, "CALL or DEF after TOOL");
  }
  if (keyword == "STOP") return stop(words), true;
  if (keyword == "CYCL") {
    if (contour_.is_compensated()) words.throw_input_error(from, "R0 before CYCL");
    if (words.accept("DEF")) return execute_cycle_definition(words), true;
    if (words.accept("CALL")) return call_cycle(words), true;
    words.throw_input_error(words.cursor.at, "DEF or CALL after CYCL");
  }
  if (keyword == "PLANE") return execute_plane(words), true;
  if (keyword == "FUNCTION") return execute_function(words), true;
  if (keyword == "TRANS") return execute_trans(words), true;
  if (keyword == "PRESET") return execute_preset(words), true;
  return false;
}

/// Executes a block of M functions alone, for example 15 M30.
void Machine::execute_m_block(std::size_t from, WordReader& words) {
  words.cursor.at = from;
  move(read_move("", from, words));
}

void Machine::stop(WordReader& words) {
  if (words.at_end()) return canon_.record_auxiliary_word("M0");
  MotionBlock functions = read_move("", words.cursor.at, words);
  canon_.record_auxiliary_word("M0");
  move(std::move(functions));
}

void Machine::execute_function(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  if (words.accept("TCPM")) return execute_tcpm(words);
  if (words.accept("RESET")) {
    words.require_word("TCPM", "TCPM after FUNCTION RESET");
    words.expect_end();
    return set_tcpm(false, words.cause(from));
  }
  if (words.accept("DWELL")) {
    const std::size_t at = words.cursor.at;
    if (words.read_name() != "TIME")
      words.throw_input_error(at, "TIME and seconds after FUNCTION DWELL");
    const double seconds = words.read_value();
    words.expect_end();
    // The dwell is executed at once, although compensation still postpones a move.
    if (contour_.is_compensated()) words.throw_input_error(from, "R0 before FUNCTION DWELL");
    return canon_.dwell(seconds, words.cause(at));
  }
  if (words.accept("MODE")) {
    words.require_word("MILL", "MILL: turning and grinding are not supported");
    return words.expect_end();
  }
  const std::string word = words.read_name();
  words.throw_input_error(from, "TCPM, RESET TCPM, DWELL or MODE MILL after FUNCTION");
}

/// Executes PRESET, for example PRESET SELECT #1.
void Machine::execute_preset(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  if (!words.accept("SELECT") || !words.cursor.accept("#"))
    words.throw_input_error(from, "SELECT and # with a number after PRESET");
  const int number = words.read_whole_number(9999);
  words.expect_end();
  select_preset(number, words.cause(from));
}

double Machine::tool_length(int number, const Cause& cause) {
  if (const auto length = find_value(length_, number)) return *length;
  if (number == 0) return 0.0;
  // The only tool of the scene is assumed whatever the number.
  if (canon_.options().tool_length.size() == 1 && canon_.options().control_by_h.empty() &&
      !canon_.options().tool_table) {
    const double length = canon_.options().tool_length.begin()->second;
    canon_.assume({fmt::format("TOOL CALL {} calls the only tool, {:.6g} mm long", number, length),
                   "tool.number"});
    if (!radius_.contains(number) && !canon_.options().tool_radius.empty())
      radius_[number] = canon_.options().tool_radius.begin()->second;
    return length_[number] = length;
  }
  throw_input_error(cause, "a tool with a known length (" + known_numbers(length_, "") + ")");
}

/// Puts a tool in force. The chain has the length of the tool itself if the scene has several
/// tools, else that of H1. The rest of the length in the control lies along the tool axis.
void Machine::select_tool(int number, const Cause& cause) {
  const double length = tool_length(number, cause) + delta_length_;
  const auto& lengths = canon_.options().tool_length;
  double chain_length = length;
  if (const auto entry = lengths.find(number);
      entry != lengths.end() && canon_.options().control_by_h.contains(number))
    chain_length = entry->second;
  else if (canon_.options().tool_table)
    chain_length = tool_length(canon_.options().control_tool, cause);
  else if (!lengths.empty())
    chain_length = lengths.contains(1) ? lengths.at(1) : lengths.begin()->second;
  tool_ = number;
  extra_length_ = length - chain_length;
  canon_.select_length(number, cause);
  update_tip_mode(cause);
}

/// Parses the name of a tool of the control's table or of the scene, for example "BALL 10", and
/// returns its number.
int Machine::read_tool_name(WordReader& words) {
  Cursor& cursor = words.cursor;
  const std::size_t from = cursor.at, close = cursor.text.find('"', from + 1);
  const auto& numbers = canon_.options().tool_number;
  const auto entry = close == std::string_view::npos
                         ? numbers.end()
                         : numbers.find(cursor.text.substr(from + 1, close - from - 1));
  if (entry == numbers.end())
    words.throw_input_error(from, "a tool number: the scene has no tool with this name");
  cursor.at = close + 1;
  return entry->second;
}

void Machine::tool_call(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  if (contour_.is_compensated()) words.throw_input_error(from, "R0 before TOOL CALL");
  std::optional<int> number;
  if (words.cursor.current() == '"')
    number = read_tool_name(words);
  else if (words.has_value())
    number = words.read_whole_number(32767);
  const Cause cause = words.cause(from);
  // DL and DR hold only for their own call.
  if (number) delta_length_ = delta_radius_ = 0.0;
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.read_name();
    if (name == "Z") continue;
    if (name == "X" || name == "Y") words.throw_input_error(at, "the tool axis Z");
    if (name == "S") {
      const double rpm = words.read_value();
      if (!(rpm >= 0 && rpm <= 1e7))
        words.throw_input_error(at, "a spindle speed from 0 to 1e7 rpm");
      canon_.set_spindle_speed(rpm);
    } else if (name == "F") {
      tool_feed_ = words.read_value();
      if (!(tool_feed_ > 0)) words.throw_input_error(at, "a feed greater than zero");
      // In inch programs F counts tenths of an inch per minute.
      feed_ = Feed{tool_feed_, canon_.inch() ? 0.1 * units::inch : 1.0};
      is_last_feed_per_turn_ = is_feed_per_turn_;
    } else if (name == "DL") {
      delta_length_ = words.read_value() * unit();
    } else if (name == "DR") {
      delta_radius_ = words.read_value() * unit();
    } else {
      reject_unsupported(name, words.cause(at));
      words.throw_input_error(at, "Z, S, F, DL or DR after TOOL CALL");
    }
  }
  if (number) {
    is_tool_called_ = true;
    canon_.record_tool_call(*number, true);
    canon_.record_auxiliary_word(fmt::format("T{} M6", *number));
  }
  // A TOOL CALL without number changes S, F, DL and DR of the current tool.
  if (number || tool_ >= 0) select_tool(number.value_or(tool_), cause);
}

/// Executes TOOL DEF, for example TOOL DEF 5 L+100 R+5. Without L and R it only prepares the tool.
void Machine::tool_def(WordReader& words) {
  const std::size_t from = skip_blanks(words.cursor);
  if (words.cursor.current() == '"')
    words.throw_input_error(from, "a tool number: the scene has no tool with this name");
  const int number = words.read_whole_number(32767);
  while (!words.at_end()) {
    const std::size_t at = words.cursor.at;
    const std::string name = words.read_name();
    if (name == "L")
      length_[number] = words.read_value() * unit();
    else if (name == "R")
      radius_[number] = words.read_value() * unit();
    else
      words.throw_input_error(at, "L or R after TOOL DEF");
  }
}

// M functions.

namespace {

/// Returns true for M functions that take effect at the end of their block.
bool is_after_motion(int number) {
  static constexpr int numbers[] = {0, 1, 2, 5, 9, 30, 89, 99, 127, 129};
  return std::ranges::find(numbers, number) != std::end(numbers);
}

/// Skips the values that belong to an M function without effect, such as the X and Y of M118, or
/// the percentage F of M103.
void skip_function_words(int number, WordReader& words) {
  const auto skip_value = [&](auto is_function_word) {
    WordReader ahead = words;
    const std::string name = ahead.read_name();
    if (!is_function_word(name) || !ahead.has_value()) return false;
    ahead.read_value();
    words.cursor.at = ahead.cursor.at;
    return true;
  };
  const auto is_axis = [](const std::string& name) {
    return name.size() == 1 && axis_letters.find(name[0]) != std::string_view::npos;
  };
  static constexpr std::pair<int, std::string_view> words_of_functions[] = {
      {101, "BT"}, {103, "F"}, {120, "LA"}};
  for (const auto& [function, word] : words_of_functions)
    if (function == number) skip_value([&](const std::string& name) { return name == word; });
  if (number != 118) return;
  while (skip_value(is_axis)) {
  }
  // An F after M118 could belong to M118 or be the feed of the block.
  if (WordReader ahead = words; ahead.read_name().starts_with('F'))
    words.throw_input_error(words.cursor.at, "F before M118: words after it belong to it");
}

}  // namespace

/// Parses the number of an M function and the values that belong to it.
void Machine::read_m_function(WordReader& words, std::size_t from, MFunction& m) {
  m.number = words.read_whole_number(999);
  m.cause = words.cause(from);
  const std::string name = fmt::format("M{}", m.number);
  reject_unsupported(name, m.cause);
  if (find_word(heidenhain_words(), name) == nullptr)
    run_.handle_unknown_word(m.cause, "an M function of a TNC");
  const auto accept_name = [&](std::string_view name) {
    WordReader ahead = words;
    if (ahead.read_name() != name) return false;
    words.cursor.at = ahead.cursor.at;
    return true;
  };
  skip_function_words(m.number, words);
  if (m.number == 140) {
    words.cursor.skip_blanks();
    // MB MAX may be written with or without the blank.
    if (accept_name("MBMAX"))
      m.retracts_to_limit = true;
    else if (!accept_name("MB"))
      words.throw_input_error(words.cursor.at, "MB after M140");
    else if (accept_name("MAX"))
      m.retracts_to_limit = true;
    else
      m.retraction = words.read_value() * unit();
  }
  if (m.number == 140 || m.number == 128) {
    const std::size_t at = skip_blanks(words.cursor);
    WordReader ahead = words;
    if (const std::string feed = ahead.read_name(); feed.starts_with('F')) {
      words.cursor.at = ahead.cursor.at;
      const FeedValue value = read_feed(feed.substr(1), words, at);
      m.is_rapid = value.kind == FeedKind::Rapid;
      if (!m.is_rapid) m.feed = value.value;
      if (value.kind == FeedKind::PerRevolution)
        words.throw_input_error(at, "a feed per minute after M140 and M128");
    }
  }
  // F of M128 limits the compensating moves, which take no time here.
  if (m.number == 128 && m.feed)
    run_.warn_once("F with M128 limits the feed of compensating moves: it has no effect here");
  if (m.number == 94 && !words.at_end()) {
    WordReader ahead = words;
    const std::string axis = ahead.read_name();
    // M94 takes an axis letter without a value.
    if (axis.size() == 1 && !ahead.has_value()) {
      m.axis = axis.front();
      words.cursor.at = ahead.cursor.at;
    }
  }
}

void Machine::apply_functions_before_motion(MotionBlock& move) {
  for (const MFunction& m : move.functions)
    if (!is_after_motion(m.number)) start_m_function(m, move);
}

void Machine::start_m_function(const MFunction& m, MotionBlock& move) {
  // Under compensation M functions follow the waiting move.
  const auto turn_spindle = [&](int direction) {
    contour_.run_after_move([this, direction] { canon_.turn_spindle(direction); });
  };
  const auto record_word = [&](const char* text) {
    contour_.run_after_move([this, text] { canon_.record_auxiliary_word(text); });
  };
  const int n = m.number;
  if (n == 3 || n == 13) turn_spindle(1);
  if (n == 4 || n == 14) turn_spindle(-1);
  if (n == 7) record_word("M7");
  if (n == 8 || n == 13 || n == 14) record_word("M8");
  if (n == 91) move.in_machine_coordinates = true;
  if (n == 94) remove_whole_turns(m);
  if (n == 126) takes_shortest_rotation_ = true;
  if (n == 128) set_tcpm(true, m.cause);
  if (n == 136 || n == 137) {
    if (n == 136 && canon_.inch()) throw_input_error(m.cause, "M136 in a program in MM");
    // F has another unit in the new mode, so the old value must not survive.
    if (n == 136 || is_feed_per_turn_) feed_.reset();
    is_feed_per_turn_ = is_last_feed_per_turn_ = n == 136;
  }
  if (n == 140) execute_m140(m, move);
  // Others are without effect according to the word table.
}

/// Executes M functions that take effect after the motion, and the cycle that M89 and M99 call.
void Machine::apply_functions_after_motion(const MotionBlock& move) {
  bool calls_cycle =
      is_cycle_modal_ && std::any_of(move.axes.begin(), move.axes.end(),
                                     [](const auto& axis) { return axis.has_value(); });
  Cause cause = move.cause;
  for (const MFunction& m : move.functions) {
    if (m.number == 99) {
      calls_cycle = true;
      is_cycle_modal_ = false;
      cause = m.cause;
    } else if (m.number == 89) {
      calls_cycle = is_cycle_modal_ = true;
      cause = m.cause;
    } else if (is_after_motion(m.number)) {
      end_m_function(m);
    }
  }
  if (calls_cycle) run_cycle(0.0, cause);
}

void Machine::end_m_function(const MFunction& m) {
  const int n = m.number;
  if (n == 0 || n == 1 || n == 9) {
    const char* text = n == 0 ? "M0" : n == 1 ? "M1" : "M9";
    contour_.run_after_move([this, text] { canon_.record_auxiliary_word(text); });
  }
  if (n == 5) contour_.run_after_move([this] { canon_.turn_spindle(0); });
  if (n == 127) takes_shortest_rotation_ = false;
  if (n == 129) set_tcpm(false, m.cause);
  if (n == 2 || n == 30) {
    contour_.finish();
    has_ended_ = true;
  }
}

/// Executes M94, which removes whole turns from the position of one or all rotary axes.
void Machine::remove_whole_turns(const MFunction& m) {
  if (contour_.is_compensated()) throw_input_error(m.cause, "R0 before M94");
  const AxisVector p = canon_.programmed();
  if (m.axis != '\0') joint_of(m.axis, m.cause);
  for (const char letter : {'A', 'B', 'C'})
    if (const int j = canon_.joint_of(letter);
        j >= 0 && !canon_.is_linear(j) && (m.axis == '\0' || m.axis == letter))
      // 1e-9 turns absorb rounding, so that 360 degrees become 0.
      removed_turns_[j] += 2 * pi * std::floor(p[j] / (2 * pi) + 1e-9);
  apply_frame(m.cause);
}

void Machine::execute_m140(const MFunction& m, const MotionBlock& move) {
  if (contour_.is_compensated()) throw_input_error(m.cause, "R0 before M140");
  // Manuals do not say if a block with axes retracts before or after its motion.
  for (const auto& axis : move.axes)
    if (axis) throw_input_error(m.cause, "M140 in a block without axes: their order is unknown");
  const auto feed_before = canon_.feed();
  if (m.feed) {
    if (!(*m.feed > 0)) throw_input_error(m.cause, "a feed greater than zero");
    canon_.set_feed(Feed{*m.feed, canon_.inch() ? 0.1 * units::inch : 1.0});
  }
  retract_by(m.retraction.value_or(0.0), m.retracts_to_limit, !m.feed, m.cause);
  canon_.set_feed(feed_before);
}

}  // namespace abbe::sim::dialects::heidenhain
