#include "sim/dialects/fanuc/fanuc.h"

namespace abbe::sim::dialects::fanuc {

namespace {

// Letters of codes of group 00.
constexpr gcode::CodeLetters one_shot_letters[] = {{40, "XUP"}, {100, "LPR"}, {300, "P"}};

}  // namespace

Machine::Machine(ProgramRun& run)
    : GCodeControl(run),
      is_turning_(run.is_turning()),
      has_diameters_(run.has_initial_diameters(true)),
      vector_lines_(run),
      zero_offset_(AxisVector::Zero(run.canon.position().size())) {
  const program::NcOptions& options = canon_.options();
  for (const auto& [h, mm] : options.tool_length) lengths_[h].value = mm;
  for (const auto& [d, mm] : options.tool_radius) radii_[d].value = mm;
  const auto subtract_wear = [](Offsets& offsets, const std::map<int, double>& wear) {
    for (const auto& [number, mm] : wear) {
      OffsetEntry& entry = offsets[number];
      // Tables state values including wear. It is subtracted because the control adds it again.
      if (entry.value) entry.value = *entry.value - mm;
      entry.wear = mm;
    }
  };
  subtract_wear(lengths_, options.length_wear);
  subtract_wear(radii_, options.radius_wear);
  for (std::size_t i = 0; i < options.work_offset.size(); ++i)
    systems_[int(i) + 1] =
        options.work_offset[i].size() > 0 ? options.work_offset[i] : zero_offset_;
  external_ = g92_ = g52_ = zero_offset_;
  for (const auto& [number, offset] : options.extra_offsets) {
    if (number == 0) external_ = offset;
    if (number > 100) systems_[number] = offset;
  }
  // Assumed parameters: tables roll over in the shorter direction (1008.0 ROA = 1, 1008.1 RAB = 0).
  canon_.enable_table_rollover();
  apply_frame();
  if (!is_turning_) return;
  // A turning control starts in G18 and with feed per revolution (G99).
  plane_ = 18;
  canon_.set_feed_mode(FeedMode::PerRevolution);
  note_turning_control();
  apply_tool_offset({1, {}});
}

double Machine::word_value(const Word& word) {
  return apply_increment(word, min_increment(word.letter, canon_.inch()));
}

double Machine::angle_in_degrees(const Word& word) {
  return apply_increment(word, min_increment('A', false));
}

/// Returns the value of a word. Without a decimal point it counts least input increments.
double Machine::apply_increment(const Word& word, double increment) {
  if (word.is_in_full_units || word.value == 0.0) return word.value;
  const double value = word.value * increment;
  // The warning is worth its line: hand-written programs may lack points, and the factor is 1000.
  if (!has_warned_of_missing_decimal_point_) {
    has_warned_of_missing_decimal_point_ = true;
    run_.warn_once(fmt::format(
        "{}:{}: {} has no decimal point and is {:g}: such numbers are in units of the least input "
        "increment, 0.001 mm, 0.001 degrees or 0.0001 inch (parameter 3401.0 DPI = 0, IS-B)",
        canon_.place().file, canon_.line(), shown(word.text), value));
  }
  return value;
}

double Machine::axis_word_value(int j, const Word& word) {
  if (!canon_.is_linear(j)) return angle_in_degrees(word) * units::deg;
  // Diameters are halved here, so that all other code works with radii.
  return length(word) * (has_diameters_ && j == joint(0) ? 0.5 : 1.0);
}

Machine::Words Machine::axis_words(const Block& block) const {
  Words words;
  for (const char letter : word_letters())
    if (const Word& word = block[letter])
      words.push_back({joint_of_word(letter), &word, is_increment(letter)});
  return words;
}

// Returns the word that messages about the motion of a block point at.
Cause Machine::motion_cause(const Block& block) const {
  for (const Group group : {Group::Motion, Group::OneShot, Group::Cycle})
    if (const Code& code = block[group]) return code.word;
  if (const Word* axis = first_axis_word(block)) return *axis;
  for (const char letter : {'R', 'I', 'J', 'K'})
    if (block[letter]) return block[letter];
  return {1, {}};
}

/// Returns the letters other than axis words that belong to the codes of a block.
std::string Machine::allowed_letters(const Block& block) const {
  const int one_shot = block.tenths(Group::OneShot);
  std::string letters(gcode::letters_of_code(one_shot_letters, one_shot));
  if (block[Group::MirrorEnd]) return letters;
  const int rotation = block.tenths(Group::Rotation);
  if (rotation == 682) return letters + "IJKP";
  if (rotation == 680) return letters + "RIJK";
  const int code = block[Group::Motion] ? block.tenths(Group::Motion) : motion_;
  // A motion code in the block ends a cycle in force.
  const int cycle = block[Group::Motion]  ? 800
                    : block[Group::Cycle] ? block.tenths(Group::Cycle)
                                          : cycle_code_;
  if (one_shot < 0 && cycle != 800) letters += "RQPKL";
  if (one_shot < 0 && cycle == 800 && (code == 20 || code == 30)) letters += "IJKR";
  if (one_shot < 0 && is_turning_ && (code == 900 || code == 940)) letters += "R";
  if (one_shot == 100 && is_turning_) letters += "Q";
  const int length = block[Group::ToolLength] ? block.tenths(Group::ToolLength) : length_mode_;
  if (one_shot < 0 && length == 435) letters += "IJK";
  const int offset = block.tenths(Group::WorkOffset);
  if (offset == 540 || offset == 541) letters += "P";
  if (block[Group::SpeedMode]) letters += "P";
  if (block[Group::Call]) letters += "PL";
  return letters;
}

/// Checks that every word belongs to a code of its block. Throws BadInput.
void Machine::check_words(const Block& block) const {
  const Code& one_shot = block[Group::OneShot];
  if (is_turning_) check_corner_words(block);
  for (const char letter : word_letters())
    if (const Word& word = block[letter];
        word && joint_of_word(letter) < 0 &&
        !(one_shot.tenths == 40 && (letter == 'U' || letter == 'X')))
      throw_input_error(word, "an axis of this machine (" + canon_.letters() + ")");
  const std::string letters = allowed_letters(block);
  for (const char letter : {'I', 'J', 'K', 'L', 'P', 'Q', 'R'}) {
    const Word& word = block[letter];
    if (!word || letters.find(letter) != std::string::npos) continue;
    // A letter with a skipped code may belong to that code.
    if (block.skipped_code)
      run_.handle_unknown_word(word, "a word of Fanuc's milling controls");
    else
      throw_input_error(word, fmt::format("a code that uses {}", letter));
  }
  const Word* axis = first_axis_word(block);
  check_skipped_code(canon_, block, axis);
  check_forbidden_axis_words(canon_, block, axis);
  check_axis_word_owners(block);
}

/// Checks that the axis words of a block belong to at most one code. A motion code with a code of
/// group 00 is in force from the next block on (B-63944EN, "G codes of different groups").
void Machine::check_axis_word_owners(const Block& block) const {
  const Code* owner = nullptr;
  for (const Group group : {Group::OneShot, Group::Rotation, Group::MirrorEnd}) {
    const Code& code = block[group];
    if (!code) continue;
    if (owner != nullptr)
      throw_input_error(code.word, "a block without " + shown(owner->word.text));
    owner = &code;
  }
  if (const Code& cycle = block[Group::Cycle]; cycle && cycle.tenths != 800 && owner != nullptr)
    throw_input_error(cycle.word, "no cycle with " + shown(owner->word.text));
}

void Machine::set_feed(const Block& block) {
  if (const Code& code = block[Group::FeedMode]) {
    // G94 and G95 are G98 and G99 of a turning control.
    const FeedMode mode = code.tenths == 930                         ? FeedMode::InverseTime
                          : code.tenths == 940 || code.tenths == 980 ? FeedMode::PerMinute
                                                                     : FeedMode::PerRevolution;
    change_feed_mode(mode);
  }
  // Under G93 F holds for its own block only.
  if (canon_.feed_mode() == FeedMode::InverseTime) canon_.set_feed({});
  const Word& f = block['F'];
  if (!f) return;
  if (!(f.value >= min_feed)) throw_input_error(f, "a feed greater than zero");
  // Parameters of the control decide about F without a point in inches or per turn, but not in
  // mm/min.
  if (!f.is_in_full_units && (canon_.inch() || canon_.feed_mode() != FeedMode::PerMinute))
    throw_input_error(
        f,
        is_turning_
            ? "a decimal point in F under G20 and G99: without one its value depends on a parameter"
            : "a decimal point in F under G20, G93 and G95: without one its value depends on a "
              "parameter");
  canon_.set_feed(Feed{f.value, unit()});
}

void Machine::set_spindle(const Block& block) {
  const Word& s = block['S'];
  const int one_shot = block.tenths(Group::OneShot);
  // S with G92 or G50 limits the spindle speed instead of setting it.
  const bool sets_limit = one_shot == 920 || (is_turning_ && one_shot == 500);
  if (const Code& code = block[Group::SpeedMode]) {
    const bool is_surface_speed = code.tenths == 960;
    if (is_surface_speed && joint(0) < 0)
      throw_input_error(code.word, "a machine with an X axis for G96");
    if (is_surface_speed && !surface_speed_m_per_min_ && (!s || sets_limit))
      throw_input_error(code.word, "S (surface speed) with G96", "none");
    has_surface_speed_ = is_surface_speed;
  }
  if (s) {
    const double speed = whole_number(canon_, s, 10'000'000);
    if (sets_limit) {
      max_rpm_ = speed;
    } else {
      speed_word_ = speed;
      if (has_surface_speed_)
        surface_speed_m_per_min_ = canon_.inch() ? speed * 0.3048 : speed;  // ft/min in inches
      else
        canon_.set_spindle_speed(speed);
    }
  }
  if (block[Group::RigidTap]) is_rigid_tapping_ = true;
  if (const Code& code = block[Group::Spindle])
    canon_.turn_spindle(code.tenths == 30 ? 1 : code.tenths == 40 ? -1 : 0);
  // Every block sets the surface speed anew, because S and its limit may have changed.
  apply_surface_speed(surface_speed_m_per_min_.value_or(0.0));
}

void Machine::call_tools(const Block& block) {
  if (is_turning_) call_tool_and_offset(block);
  const bool changes(block[Group::ToolChange]);
  static const Word no_tool;
  const Word& t = is_turning_ ? no_tool : block['T'];
  if (t) preselected_tool_ = whole_number(canon_, t, 99'999'999);
  // On a machining centre T selects a tool and M6, maybe in a later block, changes to it.
  if (changes && preselected_tool_ >= 0) tool_ = preselected_tool_;
  if (t || changes) canon_.record_tool_call(t ? preselected_tool_ : -1.0, changes);
  record_tool_and_coolant(canon_, block, t ? fmt::format("T{}", preselected_tool_) : "");
}

/// Records the modes that a block states and those that it depends on.
void Machine::note_start_modes(const Block& block) {
  mark_stated_modes(run_, block);
  // A dwell and blocks without axis words depend on no mode.
  if (!first_axis_word(block) || block.tenths(Group::OneShot) == 40) return;
  run_.assume_mode(StartMode::Units, "mm (G21)");
  if (!run_.is_turning()) run_.assume_mode(StartMode::Distance, "absolute (G90)");
  if (block[Group::OneShot]) return;
  const int motion = block[Group::Motion] ? block.tenths(Group::Motion) : motion_;
  run_.assume_mode(StartMode::Motion, "rapid (G0)");
  assume_plane_and_feed(motion == 20 || motion == 30, motion > 0,
                        is_turning_ ? "F per minute (G98)" : "F per minute (G94)",
                        is_turning_ ? "F per revolution (G99)" : "F per revolution (G95)");
  run_.assume_offset(system_, "work offset G54");
}

// The control executes units, feed, spindle and tool first, then the modes that moves depend on.
void Machine::set_modes(const Block& block) {
  if (const Code& code = block[Group::Units]) canon_.set_inch(code.tenths == 200);
  set_feed(block);
  set_spindle(block);
  call_tools(block);
  if (const Code& code = block[Group::Plane]) {
    if (compensation_.is_on() && code.tenths != 10 * plane_)
      throw_input_error(code.word, "no change of the plane under G41 or G42");
    plane_ = code.tenths / 10;
  }
  if (const Code& code = block[Group::Distance]) is_incremental_ = code.tenths == 910;
  if (const Code& code = block[Group::ReturnLevel]) returns_to_r_ = code.tenths == 990;
  if (is_turning_) {
    if (const Code& code = block[Group::CutterRadius]) set_nose_compensation(code);
    if (block['D'])
      throw_input_error(block['D'], "T with four digits, tool and offset: a lathe has no D");
  } else if (block[Group::CutterRadius] || block['D']) {
    set_compensation(block);
  }
  if (block[Group::WorkOffset]) select_work_offset(block);
  if (!is_turning_ && (block[Group::ToolLength] || block['H'])) set_tool_length(block);
  if (const Code& code = block[Group::Polar]) {
    polar_ = {.is_on = code.tenths == 160};
    if (polar_.is_on && is_tilted_) throw_input_error(code.word, "G69 before G16");
  }
}

void Machine::dwell(const Block& block) {
  const Code& code = block[Group::OneShot];
  const Word* time_word = nullptr;
  for (const char letter : {'X', 'U', 'P'})
    if (const Word& word = block[letter]) {
      if (time_word) throw_input_error(word, "only one of X, U and P with G4");
      time_word = &word;
    }
  if (!time_word)
    throw_input_error(code.word, "X or U (seconds) or P (milliseconds) with G4", "none");
  for (const char letter : axis_letters)
    if (const Word& word = block[letter]; word && &word != time_word)
      throw_input_error(word, "X or U (seconds) or P (milliseconds) as the only word with G4");
  // A computed value has no written decimal point.
  const bool is_computed = time_word->text.find_first_of("#[") != std::string_view::npos;
  if (time_word->letter == 'P' && time_word->is_in_full_units && !is_computed)
    throw_input_error(*time_word, "milliseconds without a decimal point after P, or X in seconds");
  // Without a point X and U of G4 count increments of 0.001 s.
  const double seconds = time_word->letter == 'P' || !time_word->is_in_full_units
                             ? time_word->value * 1e-3
                             : time_word->value;
  if (!(seconds >= 0 && seconds <= 1e6)) throw_input_error(*time_word, "0 to 1e6 seconds with G4");
  dwell_after_move(seconds, *time_word);
}

void Machine::execute_one_shot(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (code.tenths == 40) return dwell(block);
  if (compensation_.is_on()) throw_input_error(code.word, "G40 before " + shown(code.word.text));
  if (code.tenths == 100) return store_data(block);
  if (code.tenths == 280 || code.tenths == 300) return move_to_reference(block);
  if (code.tenths == 530) return move_in_machine_coordinates(block);
  // G53.1 and G53.6
  if (code.tenths == 531 || code.tenths == 536) return align_tool_with_plane(block);
  return shift_origin(block);
}

// The words of a cycle do not survive G80 or a motion code.
void Machine::end_cycle() {
  cycle_.has_begun = is_rigid_tapping_ = false;
  cycle_.q = cycle_.dwell_s = 0.0;
  cycle_code_ = 800;
}

/// A motion code ends a cycle, but a cycle does not change the motion code.
void Machine::set_motion(const Block& block) {
  const Code &cycle = block[Group::Cycle], &motion = block[Group::Motion];
  if (motion || cycle.tenths == 800) end_cycle();
  if (motion) motion_ = motion.tenths;
  if (motion) turning_cycle_ = {};
  if (cycle && cycle.tenths != 800) cycle_code_ = cycle.tenths;
}

/// Checks a block with G5 or a similar code, which changes the meaning of the other words: no other
/// code and no D F H S T may be in it.
void Machine::check_whole_block_code(const Block& block) const {
  const std::string code_text = shown(block[Group::WholeBlock].word.text);
  for (const Code& code : block.codes)
    if (code && &code != &block[Group::WholeBlock])
      throw_input_error(code.word, "a separate block for " + code_text);
  for (const char letter : {'D', 'F', 'H', 'S', 'T'})
    if (block[letter]) throw_input_error(block[letter], "a separate block for " + code_text);
}

bool Machine::execute(const Block& block) {
  has_moved_ = false;
  for (const std::string_view text : block.comments) canon_.comment(text);
  if (block[Group::WholeBlock]) return check_whole_block_code(block), true;
  check_words(block);
  note_start_modes(block);
  set_modes(block);
  set_motion(block);
  if (const Code& code = block[Group::Rotation]) {
    if (compensation_.is_on()) throw_input_error(code.word, "G40 before " + shown(code.word.text));
    set_rotation(block);
  } else if (block[Group::OneShot]) {
    execute_one_shot(block);
  } else if (!block[Group::MirrorEnd]) {
    move(block);
  }
  for (const Group group : {Group::Spindle, Group::Coolant, Group::ToolChange, Group::Stop})
    if (block[group]) last_m_ = block.tenths(group) / 10;
  return finish_block(canon_, block);
}

// Words that a turning control with G-code system A interprets differently from a milling control.

namespace {

constexpr int first_geometry_offset = 10000;  // P of G10 from here on is geometry, below it wear
constexpr int max_offset_number = 99;

/// Words of a line, for the search of signs of turning controls.
struct LineWords {
  std::array<double, 26> value{};
  std::array<int, 26> column{};           ///< 0: the line has no such word
  std::vector<std::pair<double, int>> g;  ///< codes with their columns
  bool has_m6 = false;

  bool has(char letter) const { return column[std::size_t(letter - 'A')] > 0; }
  double operator[](char letter) const { return value[std::size_t(letter - 'A')]; }
  /// Returns the column of a G code within a range, or 0.
  int find_g_code(double min, double max) const {
    for (const auto& [code, at] : g)
      if (code >= min && code <= max) return at;
    return 0;
  }
};

LineWords parse_line_words(Cursor cursor) {
  LineWords words;
  while (!cursor.at_end()) {
    const char letter = upper(cursor.current());
    if (letter == '(') {
      const std::size_t close = cursor.text.find(')', cursor.at);
      if (close == std::string_view::npos) break;
      cursor.at = close + 1;
      continue;
    }
    const int column = int(cursor.at) + 1;
    ++cursor.at;
    if (!is_letter(letter)) continue;
    std::optional<double> number;
    try {
      number = cursor.number();
    } catch (const BadInput&) {
      break;  // the reader reports the error
    }
    if (!number) continue;
    words.value[std::size_t(letter - 'A')] = *number;
    words.column[std::size_t(letter - 'A')] = column;
    if (letter == 'G') words.g.emplace_back(*number, column);
    words.has_m6 = words.has_m6 || (letter == 'M' && *number == 6);
  }
  return words;
}

}  // namespace

std::optional<TurningEvidence> find_turning_evidence(std::string_view text,
                                                     const program::Canon& canon) {
  const bool has_u_or_w = canon.joint_of('U') >= 0 || canon.joint_of('W') >= 0;
  std::optional<TurningEvidence> tool;
  // T0101 is a valid tool number on a mill too, so it counts only together with G96 and without M6.
  bool has_g96 = false, has_m6 = false;
  LineReader lines(text);
  while (const auto line = lines.next()) {
    const LineWords words = parse_line_words({*line, canon.place()});
    const auto sign = [&](std::string_view what, int column) {
      return TurningEvidence{std::string(what), lines.number(), column};
    };
    if (const int at = words.find_g_code(50, 50); at > 0 && words.has('S'))
      return sign("G50 with S, the maximum spindle speed of a turning control", at);
    if (const int at = words.find_g_code(28, 30);
        at > 0 && !has_u_or_w && (words.has('U') || words.has('W')))
      return sign("G28 with U or W, increments of a turning control", at);
    if (const int at = words.find_g_code(70, 73); at > 0 && !has_u_or_w && words.has('P') &&
                                                  words.has('Q') && !words.has('R') &&
                                                  !words.has('Z'))
      return sign("a turning cycle with P and Q", at);
    if (!tool && words.has('T') && words['T'] >= 101 && words['T'] <= 9999)
      tool = sign("T with tool and offset with G96, as used on turning controls",
                  words.column['T' - 'A']);
    has_g96 = has_g96 || words.find_g_code(96, 96) > 0;
    has_m6 = has_m6 || words.has_m6;
  }
  return has_g96 && !has_m6 ? tool : std::nullopt;
}

bool Machine::is_increment(char letter) const {
  return is_turning_ && std::string_view("UVWH").find(letter) != std::string_view::npos;
}

int Machine::joint_of_word(char letter) const {
  if (!is_increment(letter)) return canon_.joint_of(letter);
  // U V W are X Y Z incrementally, H is C.
  return canon_.joint_of(letter == 'H' ? 'C' : char(letter - 'U' + 'X'));
}

/// Reports the assumptions about the control for which the program was written.
void Machine::note_turning_control() {
  if (run_.options().turning.control_kind == ControlKind::FromMachine)
    canon_.assume(
        {"since a spindle turns the workpiece, the control is taken as a turning control (Fanuc "
         "G-code system A): U V W H are increments, G98 and G99 set the feed mode",
         "program.control", "--control"});
  if (run_.options().turning.x_words == XWordMeaning::FromControl)
    canon_.assume({has_diameters_ ? "X and U words are diameters" : "X and U words are radii",
                   "program.x_words", "--x-words"});
}

/// Assumes the only tool for a feed before the first T.
void Machine::note_uncalled_tool(const Cause& cause) {
  if (!is_turning_ || tool_offset_.called || motion_ == 0) return;
  run_.assume_only_tool(cause, "no T before the first feed");
  tool_offset_.called = true;
  tool_offset_.number = 1;
}

// Without T the only tool is in the turret.
int Machine::tool_in_use() const {
  return tool_ != 0 ? tool_ : program::only_tool(canon_.options()).value_or(0);
}

/// C, R, I and K after a line insert a chamfer or a rounding at its end.
void Machine::check_corner_words(const Block& block) const {
  const int code = block[Group::Motion] ? block.tenths(Group::Motion) : motion_;
  if (code != 10 || block[Group::OneShot] || block[Group::Macro] || block[Group::SpeedMode]) return;
  for (const char letter : {'C', 'R', 'I', 'K'}) {
    const Word& word = block[letter];
    if (word && !(letter == 'C' && joint_of_word('C') >= 0))
      throw_input_error(word, "plain lines and arcs: corners with C, R, I and K are not expanded");
  }
}

/// Executes T with tool and offset, T0101. T0100 and T0 end the offset.
void Machine::call_tool_and_offset(const Block& block) {
  const Word& t = block['T'];
  if (!t) return;
  const int value = whole_number(canon_, t, 9999);
  // T1 to T99 could be a tool or an offset, depending on parameters.
  if (value != 0 && value <= max_offset_number)
    throw_input_error(t, "T with four digits, tool and offset, such as T0101");
  if (compensation_.is_on()) throw_input_error(t, "G40 before another T");
  const int tool = value / 100;
  if (!program::is_known_tool(canon_.options(), tool))
    throw_input_error(t, "a tool of the tool table");
  tool_offset_.called = true;
  tool_offset_.number = value % 100;
  if (tool != 0) {
    preselected_tool_ = tool_ = tool;
    canon_.record_tool_call(tool, true);
    canon_.record_auxiliary_word(fmt::format("T{} M6", tool));
  }
  apply_tool_offset(t);
}

std::optional<double> Machine::nose_radius() const {
  const auto radius_entry = radii_.find(tool_in_use());
  if (radius_entry == radii_.end() || !radius_entry->second.value) return std::nullopt;
  return *radius_entry->second.value;
}

AxisVector Machine::programmed_nose_offset() const {
  return nose_offset(canon_, run_.options().turning.tip_number, nose_radius());
}

/// Puts the tool offset in force. It is a measured one: X Z lead the tip of the tool, and X0 is on
/// the spindle axis. Without an offset X Z are positions of the slides. Until a program calls a
/// tool, the only tool counts as called with its offset.
void Machine::apply_tool_offset(const Cause& cause) {
  const kinematics::Chain* chain = chain_to_tip(canon_.options(), tool_in_use());
  const bool has_offset = tool_offset_.called ? tool_offset_.number != 0 : tool_in_use() != 0;
  if (chain == nullptr || !has_offset) {
    if (tool_ != 0) canon_.select_length(-1, cause);
    return canon_.set_tool_shift({});
  }
  AxisVector shift = measured_offset(canon_, *chain, cause);
  // Under nose compensation the centre of the nose is led, whatever the programmed tip.
  if (!compensation_.is_on()) shift += programmed_nose_offset();
  if (const auto wear = find_value(tool_offset_.wear, tool_offset_.number)) {
    if (joint(0) >= 0) shift[joint(0)] += wear->x;
    if (joint(2) >= 0) shift[joint(2)] += wear->z;
  }
  if (tool_ != 0) canon_.select_length(tool_, cause);
  canon_.set_tool_shift(std::move(shift));
}

/// Executes G10 P X Z U W R, which sets wear. The geometry of a tool is that of the scene.
void Machine::store_wear(const Block& block) {
  const Code& code = block[Group::OneShot];
  const Word& p = block['P'];
  if (block['L']) throw_input_error(block['L'], "L2 L20, or no L, with G10");
  if (!p) throw_input_error(code.word, "P (offset number) with G10", "none");
  const int number = whole_number(canon_, p, 2 * first_geometry_offset);
  if (number < 1 || number > max_offset_number)
    throw_input_error(p, "wear, P1 to P99: the geometry of tools is that of the scene");
  if (block['Q'])
    throw_input_error(block['Q'], "no Q: program.tip states which point of the tool X Z guide");
  ToolOffset::Wear& wear = tool_offset_.wear[number];
  for (const auto& [j, word, is_incremental] : axis_words(block)) {
    if (j != joint(0) && j != joint(2))
      throw_input_error(*word, "X Z U W or R with G10 for a tool");
    double& value = j == joint(0) ? wear.x : wear.z;
    value = axis_word_value(j, *word) + (is_incremental ? value : 0.0);
  }
  if (const Word& r = block['R']) wear.radius = length(r);
  if (number == tool_offset_.number) apply_tool_offset(code.word);
}

/// Executes G40 to G42. Nose compensation offsets the centre of the nose by its radius.
void Machine::set_nose_compensation(const Code& code) {
  cutter_code_ = code.tenths;
  if (code.tenths == 400) {
    if (!compensation_.is_on()) return;
    compensation_.end();
    // The programmed point changes between tip and centre of the nose when compensation ends or
    // begins.
    apply_tool_offset(code.word);
    return compensation_.shift_programmed(programmed_nose_offset());
  }
  if (compensation_.is_on()) {
    if (code.tenths == start_side_) return;  // postprocessors repeat the code
    throw_input_error(code.word, "G40 between G41 and G42");
  }
  start_side_ = code.tenths;
  const std::array<int, 2> joints = plane_joints(code.word);
  const auto radius = nose_radius();
  if (!radius)
    throw_input_error(code.word, "a tool whose nose radius is known",
                      tool_ == 0 ? "none called" : fmt::format("T{:02}", tool_));
  const auto wear = find_value(tool_offset_.wear, tool_offset_.number);
  run_.warn_once(
      "nose compensation approaches the start of the contour at a right angle and goes around "
      "outside corners in arcs; a control goes around some of them in lines");
  compensation_.begin(code.tenths == 410, *radius + (wear ? wear->radius : 0.0), joints);
  apply_tool_offset(code.word);
  compensation_.shift_programmed(-programmed_nose_offset());
}

/// Executes G90 (along Z) and G94 (along X): rapid to the cut, feed along it and out of it, rapid
/// back. Values that a block does not state are kept from the previous one.
void Machine::turning_cycle(const Block& block) {
  const Cause cause = motion_cause(block);
  if (compensation_.is_on()) throw_input_error(cause, "G40 before G90 and G94");
  note_uncalled_tool(cause);
  const int x = joint(0), z = joint(2);
  if (x < 0 || z < 0) throw_input_error(cause, "a machine with X and Z for G90 and G94");
  const AxisVector start = canon_.programmed();
  TurningCycle& cycle = turning_cycle_;
  for (const auto& [j, word, is_incremental] : axis_words(block)) {
    if (j != x && j != z) throw_input_error(*word, "X Z U W with G90 and G94");
    const double to = axis_word_value(j, *word) + (is_incremental ? start[j] : 0.0);
    (j == x ? cycle.x : cycle.z) = to;
    (j == x ? cycle.has_x : cycle.has_z) = true;
  }
  if (const Word& r = block['R']) cycle.taper = length(r);
  if (!cycle.has_x || !cycle.has_z)
    throw_input_error(cause, "X and Z in the first block of G90 and G94", "only one of them");
  has_moved_ = true;
  const auto move_to = [&](double to_x, double to_z, bool rapid) {
    AxisVector end = start;
    end[x] = to_x;
    end[z] = to_z;
    const AxisVector placed = canon_.placed(std::move(end));
    AxisVector position = canon_.position();  // a spindle among the joints keeps turning
    position[x] = placed[x];
    position[z] = placed[z];
    canon_.straight({.end = std::move(position), .cause = cause}, rapid);
  };
  const bool is_along_z = motion_ == 900;
  if (is_along_z)
    move_to(cycle.x + cycle.taper, start[z], true);
  else
    move_to(start[x], cycle.z + cycle.taper, true);
  move_to(cycle.x, cycle.z, false);
  if (is_along_z)
    move_to(start[x], cycle.z, false);
  else
    move_to(cycle.x, start[z], false);
  move_to(start[x], start[z], true);
}

}  // namespace abbe::sim::dialects::fanuc
