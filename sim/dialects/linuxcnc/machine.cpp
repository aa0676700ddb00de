#include "sim/dialects/linuxcnc/linuxcnc.h"

namespace abbe::sim::dialects::linuxcnc {

namespace {

// Returns true for canned cycles: G73, G74 and G81 to G89.
bool is_drilling(int motion) {
  return motion == 730 || motion == 740 || (motion >= 810 && motion <= 890);
}

constexpr gcode::CodeLetters motion_letters[] = {
    {20, "IJKRP"}, {30, "IJKRP"}, {50, "IJPQ"}, {51, "IJ"},         {52, "PL"},  {330, "K"},
    {331, "KI"},   {730, "RQL"},  {740, "RPL"}, {760, "PIJRKQHEL"}, {810, "RL"}, {820, "RPL"},
    {830, "RQL"},  {840, "RPL"},  {850, "RL"},  {860, "RPL"},       {890, "RPL"}};

// Letters of codes of overrides and outputs.
constexpr gcode::CodeLetters override_letters[] = {{500, "P"},  {510, "P"}, {520, "P"}, {530, "P"},
                                                   {620, "P"},  {630, "P"}, {640, "P"}, {650, "P"},
                                                   {670, "EQ"}, {680, "EQ"}};

// Letters of codes of group 0.
constexpr gcode::CodeLetters one_shot_letters[] = {{40, "P"}, {100, "LPRIJQ"}};

/// Returns true for motion codes that are an error without axis words.
bool requires_axis_words(int motion) {
  return is_drilling(motion) || motion == 330 || motion == 331 || motion == 50 || motion == 51;
}

}  // namespace

Machine::Machine(ProgramRun& run)
    : GCodeControl(run),
      parameters_(5602),
      length_(canon_.options().tool_length),
      radius_(canon_.options().tool_radius) {
  is_diameter_mode_ = run.has_initial_diameters(false);
  for (int system = 1; system <= int(system_changed_.size()); ++system) {
    const AxisVector& offset = program::work_offset(canon_.options(), system);
    for (int k = 0; k < 9 && offset.size() > 0; ++k)
      if (const int j = joint(k); j >= 0)
        // Parameters are in mm and degrees, as in the variables file.
        parameters_[5221 + 20 * std::size_t(system - 1) + std::size_t(k)] =
            canon_.is_linear(j) ? offset[j] : offset[j] / units::deg;
  }
  load_origin(1);
  parameters_[5220] = 1;
  parameters_[5599] = 1;  // (debug,) comments are shown
  // G28 and G30 have stored the reference position of the scene.
  const AxisVector& reference = canon_.options().reference;
  for (int k = 0; k < 9 && reference.size() > 0; ++k)
    if (const int j = joint(k); j >= 0)
      parameters_[5161 + std::size_t(k)] = parameters_[5181 + std::size_t(k)] =
          canon_.is_linear(j) ? reference[j] : reference[j] / units::deg;
}

/// Records the modes that a block states and those that it depends on.
void Machine::note_start_modes(const Block& block) {
  mark_stated_modes(run_, block);
  if (block[Group::LatheDiameter]) is_diameter_mode_known_ = true;
  if (!first_axis_word(block)) return;
  // The assumption is reported because LinuxCNC, unlike Fanuc and Siemens, begins a lathe in G8.
  if (run_.is_turning() && block['X'] && !std::exchange(is_diameter_mode_known_, true) &&
      run_.options().turning.x_words == XWordMeaning::FromControl)
    canon_.assume({"X words are radii (G8): no earlier word states otherwise", "program.x_words",
                   "--x-words"});
  const int motion = block[Group::Motion] ? block.tenths(Group::Motion) : motion_;
  run_.assume_mode(StartMode::Units, "mm (G21)");
  run_.assume_mode(StartMode::Distance, "absolute (G90)");
  assume_plane_and_feed(motion == 20 || motion == 30, motion > 0);
  if (!block[Group::OneShot]) run_.assume_offset(system_, "work offset G54");
}

// X is a diameter under G7 and halved here, so that all other code works with radii.
double Machine::axis_word(int k, const Word& word) const {
  const bool is_rotary = k >= 3 && k <= 5;
  if (is_rotary) return word.value;
  return word.value * unit() * (k == 0 && is_diameter_mode_ ? 0.5 : 1.0);
}

// Returns the word that messages about the motion of a block point at.
Cause Machine::motion_cause(const Block& block) const {
  if (const Code& code = block[Group::Motion]) return code.word;
  if (const Word* axis = first_axis_word(block)) return *axis;
  for (const char letter : {'R', 'I', 'J', 'K', 'P'})
    if (block[letter]) return block[letter];
  if (const Code& code = block[Group::OneShot]) return code.word;
  return {1, {}};
}

/// Checks that every word belongs to a code of its block. Throws BadInput.
void Machine::check_words(const Block& block) const {
  for (const char letter : axis_letters)
    if (const Word& word = block[letter]; word && canon_.joint_of(letter) < 0)
      throw_input_error(word, "an axis of this machine (" + canon_.letters() + ")");
  const Code& one_block = block[Group::OneShot];
  const int motion = block[Group::Motion] ? block.tenths(Group::Motion) : motion_;
  const bool owns_axis_words = one_block && one_block.tenths != 40 && one_block.tenths != 530;
  std::string letters(gcode::letters_of_code(one_shot_letters, one_block.tenths));
  const Word* axis = first_axis_word(block);
  const bool is_arc = motion == 20 || motion == 30;
  const bool has_centre = is_arc && (block['I'] || block['J'] || block['K']);
  // Letters of the motion in force count only in blocks that move.
  if (!owns_axis_words && (axis || block[Group::Motion] || has_centre))
    letters += gcode::letters_of_code(motion_letters, motion);
  const int length = block.tenths(Group::ToolLength);
  if (length == 430 || length == 432 || length == 434) letters += 'H';
  if (const int side = block.tenths(Group::CutterRadius); side > 400) letters += "DL";
  if (block.tenths(Group::SpeedMode) == 960) letters += 'D';
  if (block.tenths(Group::PathMode) == 640) letters += "PQ";
  if (block[Group::Override])
    letters += gcode::letters_of_code(override_letters, block.tenths(Group::Override));
  if (block.tenths(Group::ToolChange) == 610) letters += 'Q';
  if (block.tenths(Group::Spindle) == 190) letters += "RQP";
  for (const char letter : {'D', 'E', 'H', 'I', 'J', 'K', 'L', 'P', 'Q', 'R'}) {
    if (!block[letter] || letters.find(letter) != std::string::npos) continue;
    // A letter with a skipped code may belong to that code.
    if (block.skipped_code)
      run_.handle_unknown_word(block[letter], "a word of LinuxCNC");
    else
      throw_input_error(block[letter],
                        letter == 'P'   ? "G4 with P"
                        : letter == 'H' ? "G43 or G43.4 with H"
                        : std::string_view("IJKR").find(letter) != std::string_view::npos
                            ? "G2 or G3 with I J K R"
                            : fmt::format("a code that uses {}", letter));
  }
  // An unknown G code may give the axis words another meaning; an unknown M code does not.
  check_skipped_code(canon_, block, axis);
  if (block.is_polar()) {
    const Word& word = block['@'] ? block['@'] : block['^'];
    if (block['X'] || block['Y']) throw_input_error(word, "either X Y or @ ^");
    if (plane_ != 17 || owns_axis_words || joint(0) < 0 || joint(1) < 0)
      throw_input_error(word, "a move in the plane of X and Y with @ and ^");
  }
  if (one_block.tenths == 40 && !block['P'])
    throw_input_error(one_block.word, "P (seconds) with G4", "none");
  check_motion(block);
  check_outputs(block);
  const bool is_length_offset = length == 431;
  // The motion code may be in a block with an error.
  const bool is_consequence = motion < 0 && !run_.input_errors().empty();
  if (axis && !owns_axis_words && !is_length_offset && is_consequence)
    throw program::FollowingError(canon_.place().file, canon_.line(), axis->column, "a motion code",
                                  "none");
  if (axis && !owns_axis_words && !is_length_offset && (motion < 0 || motion == 800))
    throw_input_error(*axis, "G0 G1 G2 or G3 before an axis word");
  if (one_block.tenths == 530) {
    if (!axis) throw_input_error(one_block.word, "an axis word with G53", "none");
    if (motion != 0 && motion != 10) throw_input_error(one_block.word, "G0 or G1 with G53");
  }
  check_forbidden_axis_words(canon_, block, axis);
  // LinuxCNC moves by axis words with these codes, which a program never intends.
  const bool stores_position =
      one_block.tenths % 10 == 1 || one_block.tenths == 922 || one_block.tenths == 923;
  if (axis && stores_position)
    throw_input_error(
        *axis, fmt::format("no axis words with {}, which takes none", shown(one_block.word.text)));
  if (owns_axis_words && !stores_position && block[Group::Motion] && (axis || motion != 800))
    throw_input_error(block[Group::Motion].word,
                      "no motion code with " + shown(one_block.word.text));
  if (const Word& tool = block['T'];
      tool && (tool.value < 0 || tool.value != std::floor(tool.value)))
    throw_input_error(tool, "an integer tool number");
}

/// Throws BadInput for a motion code without the words that it needs in its block.
void Machine::check_motion(const Block& block) const {
  const Code& code = block[Group::Motion];
  const bool is_arc = code.tenths == 20 || code.tenths == 30;
  if (code && requires_axis_words(code.tenths) && !first_axis_word(block))
    throw_input_error(code.word, "axis words with " + shown(code.word.text), "none");
  if (code && is_arc && !block['I'] && !block['J'] && !block['K'] && !block['R'])
    throw_input_error(code.word, "I J K or R with " + shown(code.word.text), "none");
  const bool is_incremental =
      block[Group::Distance] ? block.tenths(Group::Distance) == 910 : is_incremental_;
  if (const Code& one_block = block[Group::OneShot]; one_block.tenths == 530 && is_incremental)
    throw_input_error(one_block.word, "G90 with G53: axis positions are absolute", "G91");
}

/// Throws BadInput for M19 and outputs without the words that they need in their block.
void Machine::check_outputs(const Block& block) const {
  if (const Code& code = block[Group::Override]) {
    const bool is_digital = code.tenths >= 620 && code.tenths <= 650;
    const bool is_analog = code.tenths == 670 || code.tenths == 680;
    if ((is_digital && !block['P']) || (is_analog && !block['E']))
      throw_input_error(
          code.word,
          fmt::format("{} (output number) with {}", is_digital ? 'P' : 'E', shown(code.word.text)),
          "none");
    if (const Word& output = block[is_digital ? 'P' : 'E'];
        (is_digital || is_analog) && output.value < 0)
      throw_input_error(output, "a non-negative output number");
  }
  if (block.tenths(Group::Spindle) != 190) return;
  if (const Word& p = block['P']; p && p.value != 0 && p.value != 1 && p.value != 2)
    throw_input_error(p, "P0, P1 or P2 with M19");
  if (const Word& q = block['Q']; q && !(q.value > 0))
    throw_input_error(q, "Q (seconds) greater than zero with M19");
}

void Machine::set_feed(const Block& block) {
  if (const Code& code = block[Group::FeedMode]) {
    const FeedMode mode = code.tenths == 930   ? FeedMode::InverseTime
                          : code.tenths == 940 ? FeedMode::PerMinute
                                               : FeedMode::PerRevolution;
    // rs274 forgets F at each G94 and G95, even if the mode stays.
    canon_.set_feed({});
    canon_.set_feed_mode(mode);
  }
  // Under G93 F holds for its own block only.
  if (canon_.feed_mode() == FeedMode::InverseTime) canon_.set_feed({});
  if (const Word& f = block['F']) {
    if (!(f.value >= min_feed)) throw_input_error(f, "a feed greater than zero");
    canon_.set_feed(Feed{f.value, unit()});
  }
}

void Machine::set_spindle(const Block& block) {
  if (const Code& code = block[Group::SpeedMode]) {
    has_surface_speed_ = code.tenths == 960;
    // D belongs to its own G96.
    max_rpm_.reset();
    if (const Word& d = block['D']; d && has_surface_speed_) {
      if (!(d.value > 0 && d.value <= 1e7))
        throw_input_error(d, "a maximum speed greater than 0 and up to 1e7 rpm");
      max_rpm_ = d.value;
    }
    if (has_surface_speed_ && joint(0) < 0)
      throw_input_error(code.word, "a machine with an X axis for G96");
    if (has_surface_speed_ && !block['S'])
      throw_input_error(code.word, "S (surface speed) with G96", "none");
    // G97 without S continues at the last speed.
    if (!has_surface_speed_ && !block['S']) canon_.set_spindle_speed(speed_);
  }
  if (const Word& s = block['S']) {
    if (s.value < 0 || s.value > 1e7) throw_input_error(s, "a spindle speed from 0 to 1e7 rpm");
    // A surface speed is in m/min, or under G20 in ft/min.
    speed_ = has_surface_speed_ && canon_.inch() ? s.value * 0.3048 : s.value;
    if (!has_surface_speed_) canon_.set_spindle_speed(s.value);
  }
  if (const Code& code = block[Group::Spindle]; code && code.tenths != 190)
    canon_.turn_spindle(code.tenths == 30 ? 1 : code.tenths == 40 ? -1 : 0);
  apply_surface_speed(speed_);
}

// T selects a tool and M6, maybe in a later block, changes to it.
void Machine::call_tools(const Block& block) {
  const Code& change = block[Group::ToolChange];
  const Word& t = block['T'];
  const bool changes = change.tenths == 60;
  if (t) selected_ = int(std::min(t.value, 1e9));
  if (t && !program::is_known_tool(canon_.options(), selected_))
    throw_input_error(t, "a tool of the tool table");
  if (changes && selected_ >= 0) tool_ = selected_;
  // After a tool change the control reads its axis positions anew.
  if (changes) compensation_.clear_leaving();
  if (t || changes) canon_.record_tool_call(t ? t.value : -1.0, changes);
  // M61 declares the tool in the spindle without a change.
  if (change.tenths == 610) {
    const Word& q = block['Q'];
    if (!q || q.value < 0 || q.value != std::floor(q.value))
      throw_input_error(q ? Cause(q) : Cause(change.word), "Q, an integer tool number, with M61");
    selected_ = tool_ = int(std::min(q.value, 1e9));
    if (!program::is_known_tool(canon_.options(), tool_))
      throw_input_error(q, "a tool of the tool table");
    canon_.record_tool_call(q.value, true);
  }
  record_tool_and_coolant(canon_, block, t ? fmt::format("T{:.0f}", t.value) : "");
}

// LinuxCNC executes units, feed, spindle, tool, dwell, plane, compensation, length, system and
// distance mode in this order.
void Machine::set_modes(const Block& block) {
  if (const Code& code = block[Group::Units]) canon_.set_inch(code.tenths == 200);
  if (const Code& code = block[Group::LatheDiameter]) is_diameter_mode_ = code.tenths == 70;
  set_feed(block);
  set_spindle(block);
  call_tools(block);
  if (const Code& code = block[Group::OneShot]; code.tenths == 40) dwell(block);
  if (const Code& code = block[Group::Plane]) {
    if (compensation_.is_on())
      throw_input_error(code.word, "no change of the plane under G41 or G42");
    plane_ = code.tenths / 10;
  }
  if (block[Group::CutterRadius]) set_compensation(block);
  if (block[Group::ToolLength]) set_tool_length(block);
  if (const Code& code = block[Group::Kinematics]) {
    // M429 also ends the tip mode of G43.4.
    has_tip_kinematics_ = code.tenths == 4280;
    has_tip_length_ = has_tip_length_ && has_tip_kinematics_;
    apply_length(code.word);
  }
  if (const Code& code = block[Group::WorkOffset]) {
    // The offset path has been computed in the old system.
    if (compensation_.is_on())
      throw_input_error(code.word, "no change of the coordinate system under G41 or G42");
    select_work_offset(code.tenths <= 590 ? (code.tenths - 530) / 10 : code.tenths - 590 + 6);
  }
  if (const Code& code = block[Group::Distance]) is_incremental_ = code.tenths == 910;
  if (const Code& code = block[Group::ArcDistance]) has_absolute_centre_ = code.tenths == 901;
  if (const Code& code = block[Group::ReturnLevel]) returns_to_r_ = code.tenths == 990;
}

void Machine::dwell(const Block& block) {
  const Word& p = block['P'];
  if (!(p.value >= 0 && p.value <= 1e6))
    throw_input_error(p, "0 to 1e6 seconds with " + shown(block[Group::OneShot].word.text));
  dwell_after_move(p.value, p);
}

void Machine::execute_one_block(const Block& block) {
  const Code& code = block[Group::OneShot];
  if (compensation_.is_on()) throw_input_error(code.word, "G40 before " + shown(code.word.text));
  if (code.tenths == 100) return store_data(block);
  // G28, G28.1, G30 and G30.1
  if (code.tenths < 400) return move_to_reference(block);
  return shift_origin(block);
}

std::function<void(const Cause&)> Machine::saved_modes() {
  return [this, inch = canon_.inch(), is_incremental = is_incremental_,
          has_absolute_centre = has_absolute_centre_, is_diameter_mode = is_diameter_mode_,
          returns_to_r = returns_to_r_, plane = plane_, system = system_,
          direction = canon_.spindle_direction(), feed_mode = canon_.feed_mode(),
          feed = canon_.feed(), has_surface_speed = has_surface_speed_, speed = speed_,
          max_rpm = max_rpm_, rpm = canon_.spindle_speed(), is_compensated = compensation_.is_on(),
          has_tip_length = has_tip_length_, has_tip_kinematics = has_tip_kinematics_,
          length_shift = length_shift_](const Cause& cause) {
    // LinuxCNC does not restore tool length and compensation either; a difference shows an error of
    // the program.
    const bool is_same_length =
        length_shift.size() == length_shift_.size() && length_shift == length_shift_;
    if (!is_same_length || has_tip_length != has_tip_length_ ||
        has_tip_kinematics != has_tip_kinematics_)
      throw_input_error(cause, "the saved tool length: restoring the modes does not restore it",
                        "a different length");
    if (is_compensated != compensation_.is_on())
      throw_input_error(cause, "G40, G41 or G42 as saved: restoring the modes does not restore it",
                        "a different state");
    if (compensation_.is_on() && (system != system_ || plane != plane_))
      throw_input_error(cause, "no change of the plane and coordinate system under G41 or G42");
    canon_.set_inch(inch);
    is_incremental_ = is_incremental;
    has_absolute_centre_ = has_absolute_centre;
    is_diameter_mode_ = is_diameter_mode;
    returns_to_r_ = returns_to_r;
    plane_ = plane;
    canon_.set_feed_mode(feed_mode);
    canon_.set_feed(feed);
    has_surface_speed_ = has_surface_speed;
    speed_ = speed;
    max_rpm_ = max_rpm;
    canon_.set_spindle_speed(rpm);
    apply_surface_speed(speed_);
    canon_.turn_spindle(direction);
    if (system != system_) select_work_offset(system);
  };
}

/// Returns the block without $, and without words for a spindle that the machine does not have.
Block Machine::without_spindle(const Block& block) const {
  const Word& spindle = block['$'];
  if (spindle.value < -1 || spindle.value > 7 || spindle.value != std::floor(spindle.value))
    throw_input_error(spindle, "a spindle from 0 to 7, or -1 for all");
  Block result = block;
  result.words.put(Block::slot('$'), {});
  // $0 and $-1 address the only spindle of the machine.
  if (spindle.value <= 0) return result;
  // A synchronised motion follows its spindle, so the word cannot be ignored.
  if (const int motion = block.tenths(Group::Motion);
      motion == 330 || motion == 331 || motion == 760)
    throw_input_error(spindle, "spindle 0 with a move synchronised to it");
  run_.warn_once(
      fmt::format("spindle {} does not exist: the machine has only spindle 0 ($0)", spindle.value));
  result.words.put('S' - 'A', {});
  for (const Group group : {Group::Spindle, Group::SpeedMode})
    result.codes.put(std::size_t(group), {});
  if (block[Group::SpeedMode]) result.words.put('D' - 'A', {});
  return result;
}

bool Machine::execute(const Block& block) {
  if (block['$']) return execute(without_spindle(block));
  for (const std::string_view text : block.comments) canon_.comment(text);
  check_words(block);
  note_start_modes(block);
  set_modes(block);
  const Code& one_block = block[Group::OneShot];
  // As in rs274 the motion mode from before G5 and G5.1 is in force again after their block.
  struct MotionRestorer {
    int& motion;
    std::optional<int> previous = {};
    ~MotionRestorer() {
      if (previous) motion = *previous;
    }
  } restorer{motion_};
  if (const Code& code = block[Group::Motion]) {
    if (code.tenths == 50 || code.tenths == 51) restorer.previous = motion_;
    if (!is_drilling(code.tenths))
      cycle_ = {};
    else if (code.tenths != motion_)
      // As in LinuxCNC another cycle keeps the dwell.
      cycle_ = {.p = cycle_.p, .initial = cycle_.initial};
    // Another motion code discards the poles of G5.2.
    if (code.tenths != 52 && code.tenths != 53) poles_.clear();
    if (code.tenths != 50) spline_arm_.reset();
    motion_ = code.tenths;
  } else if (first_axis_word(block)) {
    // Any other motion interrupts a sequence of G5.
    spline_arm_.reset();
  }
  if (one_block && one_block.tenths != 530 && one_block.tenths != 40)
    execute_one_block(block);
  else if (block.tenths(Group::ToolLength) != 431)
    move(block);
  return finish_block(canon_, block);
}

double Machine::parameter(int number) const {
  if (number >= 5420 && number <= 5428) {
    const int k = number - 5420;
    const bool is_rotary = k >= 3 && k <= 5;
    return joint(k) < 0 ? 0.0 : programmed(k) / (is_rotary ? 1.0 : unit());
  }
  if (number == 5400) return tool_;
  // #5403 is the table value of the tool in the spindle, whatever length is in force.
  if (number == 5403 && !run_.is_turning()) return find_value(length_, tool_).value_or(0.0);
  if (number >= 5401 && number <= 5409) return run_.is_turning() ? tool_shift(number - 5401) : 0.0;
  if (number == 5410) return 2 * find_value(radius_, tool_).value_or(0.0);
  return parameters_[std::size_t(number)];
}

double Machine::tool_shift(int k) const {
  const int j = joint(k);
  const AxisVector& shift = canon_.tool_shift();
  if (j < 0 || shift.size() == 0) return 0.0;
  return canon_.is_linear(j) ? shift[j] : shift[j] / units::deg;
}

bool Machine::set_parameter(int number, double value) {
  // Position, tool data and version are read only.
  if (number == 5220 || (number >= 5400 && number <= 5428) || number >= 5600) return false;
  parameters_[std::size_t(number)] = value;
  // The origin differs from that of the scene from the next selection of the system on.
  if (number >= 5221 && number < 5221 + 180)
    system_changed_[std::size_t((number - 5221) / 20)] = true;
  return true;
}

std::optional<double> Machine::named_parameter(std::string_view name) const {
  if (name.size() == 2 && name[0] == '_')
    if (const auto k = axis_letters.find(upper(name[1])); k != std::string_view::npos)
      return parameter(5420 + int(k));
  if (name.size() == 6 && name.starts_with("_abs_"))
    if (const auto k = axis_letters.find(upper(name[5])); k != std::string_view::npos)
      return joint(int(k)) < 0 ? 0.0 : axis_position(int(k)) / (k >= 3 && k <= 5 ? 1.0 : unit());
  const FeedMode mode = canon_.feed_mode();
  const std::pair<std::string_view, double> parameters[] = {
      {"_metric", !canon_.inch()},
      {"_imperial", canon_.inch()},
      {"_absolute", !is_incremental_},
      {"_incremental", is_incremental_},
      {"_inverse_time", mode == FeedMode::InverseTime},
      {"_units_per_minute", mode == FeedMode::PerMinute},
      {"_units_per_rev", mode == FeedMode::PerRevolution},
      {"_coord_system", system_ <= 6 ? 530 + 10 * system_ : 590 + system_ - 6},
      {"_tool_offset", canon_.tool_shift().size() > 0},
      {"_retract_r_plane", returns_to_r_},
      {"_retract_old_z", !returns_to_r_},
      {"_spindle_rpm_mode", !has_surface_speed_},
      {"_spindle_css_mode", has_surface_speed_},
      {"_ijk_absolute_mode", has_absolute_centre_},
      {"_lathe_diameter_mode", is_diameter_mode_},
      {"_lathe_radius_mode", !is_diameter_mode_},
      {"_spindle_on", canon_.spindle_direction() != 0},
      {"_spindle_cw", canon_.spindle_direction() > 0},
      {"_feed", canon_.feed() ? canon_.feed()->word : 0.0},
      {"_rpm", canon_.spindle_speed()},
      {"_current_tool", tool_},
      {"_selected_tool", std::max(selected_, 0)},
      {"_motion_mode", motion_},
      {"_plane", 10 * plane_},
      {"_ccomp", compensation_.is_on() ? (compensation_.is_left() ? 410 : 420) : 400},
      {"_line", canon_.line()},
      {"_task", 0},
      // Programs test the version before they use features.
      {"_vmajor", 2.9},
      {"_vminor", 0},
  };
  for (const auto& [parameter, value] : parameters)
    if (parameter == name) return value;
  return std::nullopt;
}

}  // namespace abbe::sim::dialects::linuxcnc
