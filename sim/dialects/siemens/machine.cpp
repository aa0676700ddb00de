#include "sim/dialects/siemens/siemens.h"

namespace abbe::sim::dialects::siemens {

// Quarter turns are exact, so that a frame of 90 deg does not round coordinates.
Eigen::Matrix3d rotation_about(int axis, double angle_deg) {
  const double quarters = std::round(angle_deg / 90.0);
  const double remainder = (angle_deg - 90.0 * quarters) * units::deg;
  double c = std::cos(remainder), s = std::sin(remainder);
  const int quarter_turns = ((int(std::fmod(quarters, 4.0)) % 4) + 4) % 4;
  for (int k = 0; k < quarter_turns; ++k) {
    const double rotated_cosine = -s;
    s = c;
    c = rotated_cosine;
  }
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  const int i = (axis + 1) % 3, k = (axis + 2) % 3;
  // Adding zero changes -0 to +0.
  R(i, i) = R(k, k) = c + 0.0;
  R(k, i) = s + 0.0;
  R(i, k) = -s + 0.0;
  return R;
}

CoordinateFrame compose(const CoordinateFrame& first, const CoordinateFrame& second) {
  return {first.rotation * second.shift + first.shift, first.rotation * second.rotation};
}

Eigen::Matrix3d swivel_rotation(SwivelMode mode, const Eigen::Vector3i& order,
                                const Eigen::Vector3d& angles_deg) {
  if (mode == SwivelMode::SolidAngle)
    return rotation_about(2, angles_deg[0]) * rotation_about(1, angles_deg[1]);
  return rotation_about(order[0], angles_deg[0]) * rotation_about(order[1], angles_deg[1]) *
         rotation_about(order[2], angles_deg[2]);
}

std::vector<double> peck_depths(double total, const PeckParameters& parameters) {
  constexpr std::size_t max_pecks = 100'000;
  constexpr double tolerance = 1e-9;  // mm, remainder of a rounded depth
  std::vector<double> depths;
  double depth = 0.0, peck = parameters.first;
  const double degression = parameters.degression;
  while (total - depth > tolerance) {
    if (depths.size() == max_pecks) return {};
    const double remaining = total - depth;
    // The last two pecks have equal lengths if at most twice the degression remains.
    const bool is_halved = degression > 0 && !depths.empty() && remaining > peck + tolerance &&
                           remaining <= 2 * degression + tolerance;
    if (is_halved) {
      depths.push_back(depth + 0.5 * remaining);
      depths.push_back(total);
      return depths;
    }
    depth = remaining <= peck + tolerance ? total : depth + peck;
    depths.push_back(depth);
    // The degression is also the shortest peck.
    if (degression > 0) peck = std::min(peck, std::max(peck - degression, degression));
    // A negative degression is a factor of at most 1; pecks do not become shorter than `min_peck`.
    if (degression < 0)
      peck = std::max(peck * std::min(-degression, 1.0),
                      std::min(parameters.min_peck, parameters.first));
    if (!(peck > tolerance)) return {};
  }
  return depths;
}

double peck_stop_distance(double total) {
  return total <= 30.0 ? 0.6 : std::min(total / 50.0, 7.0);
}

double coarse_pitch(double size) {
  // Sizes of the first choice of ISO 261, and M14, M18, M22, M27, M33, M39, M45 of the second.
  static constexpr std::pair<double, double> pitches[] = {
      {3, 0.5},  {4, 0.7},  {5, 0.8},  {6, 1.0},  {8, 1.25}, {10, 1.5}, {12, 1.75},
      {14, 2.0}, {16, 2.0}, {18, 2.5}, {20, 2.5}, {22, 2.5}, {24, 3.0}, {27, 3.0},
      {30, 3.5}, {33, 3.5}, {36, 4.0}, {39, 4.0}, {42, 4.5}, {45, 4.5}, {48, 5.0}};
  for (const auto& [diameter, pitch] : pitches)
    if (diameter == size) return pitch;
  return 0.0;
}

namespace {

bool is_arc(std::string_view motion) { return motion == "G2" || motion == "G3"; }

}  // namespace

Machine::Machine(ProgramRun& run, bool tool_changes_by_m6)
    : GCodeControl(run),
      orientation_(canon_.options().control),
      m6_changes_tool_(tool_changes_by_m6),
      programmable_axis_shift_(AxisVector::Zero(canon_.position().size())) {
  // Work offsets are points in the workpiece even if the scene states none.
  canon_.refer_offsets_to_workpiece();
  if (run_.is_turning()) {
    // A turning control starts in G18 with feed per revolution.
    plane_ = 18;
    canon_.set_feed_mode(FeedMode::PerRevolution);
  }
  if (run_.has_initial_diameters(true)) diameter_mode_ = Diameters::On;
  apply_tool();
}

/// Reports the assumption that X words are diameters or radii, unless the program states it.
void Machine::note_diameters(const Block& block) {
  if (!run_.is_turning() || is_diameter_mode_known_ || !block["X"] || block[Group::Frame]) return;
  is_diameter_mode_known_ = true;
  if (run_.options().turning.x_words != XWordMeaning::FromControl) return;
  const bool are_diameters = diameter_mode_ == Diameters::On;
  canon_.assume({fmt::format("X words are {}: no earlier word states otherwise",
                             are_diameters ? "diameters (DIAMON)" : "radii (DIAMOF)"),
                 "program.x_words", "--x-words"});
}

double Machine::x_radius_factor(bool absolute) const {
  // Under DIAM90 only absolute positions are diameters.
  const bool is_diameter =
      diameter_mode_ == Diameters::On || (diameter_mode_ == Diameters::Absolute && absolute);
  return is_diameter ? 0.5 : 1.0;
}

/// Throws BadInput for an X word that may or may not be a diameter, which no manual settles.
void Machine::require_radius_words(const Value& word) const {
  if (diameter_mode_ != Diameters::Off && word.value != 0.0)
    throw_input_error(word,
                      "DIAMOF before " + shown(word.cause.text) + " with a frame, a pole or CIP");
}

const Value* Machine::first_axis_word(const Block& block) const {
  const Value* first = nullptr;
  for (int k = 0; k < 9; ++k)
    if (const Value& word = block.axis_word(k);
        word && (first == nullptr || word.cause.column < first->cause.column))
      first = &word;
  return first;
}

// Returns the word that messages about the motion of a block point at.
Cause Machine::motion_cause(const Block& block) const {
  if (const Code& code = block[Group::Motion]) return code.cause;
  if (const Value* axis = first_axis_word(block)) return axis->cause;
  for (const Address address : Addresses{"CR", "AR", "RP", "AP", "I", "J", "K", "A3", "B3", "C3",
                                         "I1", "J1", "K1", "TURN", "RPL"})
    if (block[address]) return block[address].cause;
  return {1, {}};
}

/// Checks that every word belongs to another word of its block. Throws BadInput.
void Machine::check_words(const Block& block) const {
  for (int k = 0; k < 9; ++k)
    if (const Value& word = block.axis_word(k); word && joint(k) < 0)
      throw_input_error(word, "an axis of this machine (" + canon_.letters() + ")");
  const std::string_view motion = block[Group::Motion] ? block.word(Group::Motion) : motion_;
  const auto require = [&](Addresses addresses, bool has_owner, std::string_view owner) {
    for (const Address address : addresses)
      if (block[address] && !has_owner)
        throw_input_error(block[address],
                          fmt::format("{} with {}", owner, shown(block[address].cause.text)));
  };
  const bool makes_arc = is_arc(motion) && !block[Group::Frame] && !block[Group::Dwell];
  require({"I", "J", "K"}, makes_arc || motion == "G33", "G2, G3 or G33");
  require({"CR", "AR", "TURN"}, makes_arc || (motion == "CIP" && block["TURN"]), "G2 or G3");
  require({"I1", "J1", "K1"}, motion == "CIP", "CIP");
  require({"RPL"}, block.word(Group::Frame) == "ROT" || block.word(Group::Frame) == "AROT",
          "ROT or AROT");
  require({"A3", "B3", "C3"}, is_traori_ || block.word(Group::Transformation) == "TRAORI",
          "TRAORI");
  const Value* position = first_axis_word(block);
  for (const Address address :
       Addresses{"AP", "RP", "A3", "B3", "C3"})  // these words move the axes too
    if (position == nullptr && block[address]) position = &block[address];
  if (position != nullptr) {
    if (block.code_forbidding_axis_words)
      throw_input_error(*position, fmt::format("no axis words with {}, which takes none",
                                               shown(block.code_forbidding_axis_words.cause.text)));
    // The order of a motion and a subprogram or cycle in one block is not defined.
    if (block.call || block.is_modal)
      throw_input_error(*position, fmt::format("{}, a cycle or subprogram, in a separate block",
                                               shown(block.call ? block.call->cause.text
                                                                : block.modal_cause.text)));
  }
  require({"LIMS"}, true, "G96");
  require({"P"}, block.call.has_value(), "a subprogram");
  if (const Value& offset = block["OFFN"]; offset && offset.value != 0)
    throw_input_error(offset, std::string(find_entry("OFFN")->sentence));
  if (const Value& t = block["T"];
      t && !block.tool_name && (t.value < 0 || t.value != std::floor(t.value) || t.value > 1e9))
    throw_input_error(t, "an integer tool number");
  // A tool of the scene has one cutting edge.
  if (const Value& d = block["D"]; d && d.value != 0 && d.value != 1)
    throw_input_error(d, "D0 or D1: a tool of the scene has one edge");
  for (const auto& value : block.values)
    if (value && value.mode != PositionMode::Modal) {
      const auto index = std::size_t(&value - block.values.data());
      // Addresses of axes and centres, which come first, may have AC().
      if (index <= Address("K1").index || &value == &block["AP"] || &value == &block["RP"])
        continue;
      throw_input_error(value, "a number without AC() and similar");
    }
}

void Machine::set_feed(const Block& block) {
  if (const Code& code = block[Group::Units]) {
    canon_.set_inch(code.word == "G70" || code.word == "G700");
    // Under G70 F stays in mm; under G700 it is in inches too.
    is_feed_in_inches_ = code.word == "G700";
  }
  if (const Code& code = block[Group::FeedMode]) {
    const FeedMode mode = code.word == "G93"   ? FeedMode::InverseTime
                          : code.word == "G94" ? FeedMode::PerMinute
                                               : FeedMode::PerRevolution;
    change_feed_mode(mode);
  }
  // G96 and G97 switch to feed per revolution, G961 and G971 to feed per minute; G962 and G972 keep
  // it.
  if (const Code& code = block[Group::SpeedMode];
      code && code.word != "G962" && code.word != "G972") {
    const bool per_minute = code.word == "G961" || code.word == "G971";
    change_feed_mode(per_minute ? FeedMode::PerMinute : FeedMode::PerRevolution);
  }
  // F with G4 is a time.
  if (block[Group::Dwell]) return;
  // Under G93 F holds for its own block only.
  if (canon_.feed_mode() == FeedMode::InverseTime) canon_.set_feed({});
  if (const Value& f = block["F"]) {
    if (!(f.value >= min_feed)) throw_input_error(f, "a feed greater than zero");
    canon_.set_feed(Feed{f.value, is_feed_in_inches_ ? units::inch : 1.0});
  }
}

void Machine::select_master_spindle(int spindle, const Cause& cause) {
  if (spindle == master_spindle_) return;
  if (has_surface_speed_) throw_input_error(cause, "G97 before a change of the master spindle");
  // The previous master spindle keeps its speed and direction until it becomes the master again.
  spindles_[master_spindle_] = {canon_.spindle_speed(), canon_.spindle_direction()};
  master_spindle_ = spindle;
  const Spindle state = spindles_[spindle];
  speed_ = state.rpm;
  canon_.set_spindle_speed(state.rpm);
  canon_.turn_spindle(state.direction);
}

/// Sets the speed of the master spindle, rpm, or under G96 the surface speed.
void Machine::set_speed(double speed, const Cause& cause) {
  if (!(speed >= 0 && speed <= 1e7)) throw_input_error(cause, "a spindle speed from 0 to 1e7 rpm");
  // A surface speed is in m/min, or under G700 in ft/min.
  speed_ = has_surface_speed_ && is_feed_in_inches_ ? speed * 0.3048 : speed;
  if (!has_surface_speed_) canon_.set_spindle_speed(speed);
}

/// Executes S2=1000 and M2=3. The tool is in the master spindle; words of other spindles have no
/// effect until SETMS.
void Machine::set_numbered_spindles(const Block& block) {
  const auto direction = [](std::string_view m) { return m == "M3" ? 1 : m == "M4" ? -1 : 0; };
  for (const SpindleWord& word : block.spindles) {
    if (word.speed && block[Group::Dwell]) throw_input_error(word.cause, "S with G4");
    if (word.spindle != master_spindle_) {
      const auto [entry, is_new] = spindles_.try_emplace(word.spindle);
      if (word.speed) entry->second.rpm = *word.speed;
      if (!word.speed) entry->second.direction = direction(word.direction);
      // The program may be for a machine with another master spindle.
      if (is_new)
        run_.warn_once(
            fmt::format("{}:{}: {} is for spindle {} and has no effect: the tool is assumed to be "
                        "in the master spindle, {}; SETMS({}) changes it",
                        canon_.place().file, canon_.line(), shown(word.cause.text), word.spindle,
                        master_spindle_, word.spindle));
      continue;
    }
    if (word.speed && block["S"]) throw_input_error(word.cause, "only one spindle speed per block");
    if (!word.speed && block[Group::Spindle])
      throw_input_error(word.cause, "only one spindle direction per block");
    if (word.speed)
      set_speed(*word.speed, word.cause);
    else
      canon_.turn_spindle(direction(word.direction));
  }
}

void Machine::set_spindle(const Block& block) {
  if (const Value& limit = block["LIMS"]) {
    if (!(limit.value > 0 && limit.value <= 1e7))
      throw_input_error(limit, "a speed greater than 0 and up to 1e7 rpm");
    max_rpm_ = limit.value;
  }
  if (const Code& code = block[Group::SpeedMode]) {
    const bool is_surface_speed = code.word.starts_with("G96");
    if (is_surface_speed && joint(0) < 0) throw_input_error(code.cause, "a machine with an X axis");
    // The first G96 has no earlier surface speed to fall back on.
    if (is_surface_speed && !has_surface_speed_ && !block["S"])
      throw_input_error(code.cause, "S (surface speed) with " + shown(code.cause.text), "none");
    // Speed and surface speed are different quantities, so a new mode must not take over the value.
    if (is_surface_speed != has_surface_speed_)
      speed_ = is_surface_speed ? 0.0 : canon_.spindle_speed();
    has_surface_speed_ = is_surface_speed;
  }
  // S with G25 and G26 is a limit, not a speed.
  const bool sets_limit = block[Group::Limits].word.size() > 0;
  if (const Code& code = block[Group::MasterSpindle])
    select_master_spindle(block.master_spindle, code.cause);
  if (const Value& s = block["S"]; s && !block[Group::Dwell] && !sets_limit) set_speed(s.value, s);
  if (!sets_limit) set_numbered_spindles(block);
  if (const Code& code = block[Group::Spindle])
    canon_.turn_spindle(code.word == "M3" ? 1 : code.word == "M4" ? -1 : 0);
  apply_surface_speed(speed_);
}

void Machine::note_coolant(const Block& block) const {
  std::string text;
  for (const std::string_view word : block.coolant)
    text += (text.empty() ? "" : " ") + std::string(word);
  if (!text.empty()) canon_.record_auxiliary_word(std::move(text));
}

void Machine::dwell(const Block& block) {
  const Code& code = block[Group::Dwell];
  const Value &seconds = block["F"], &revolutions = block["S"];
  if (const Value* axis = first_axis_word(block))
    throw_input_error(axis->cause, "no axis words with G4, which takes none");
  // G4 F is a time in seconds, G4 S a number of spindle revolutions.
  if (bool(seconds) == bool(revolutions)) throw_input_error(code.cause, "either F or S with G4");
  if (revolutions && !(canon_.spindle_speed() > 0))
    throw_input_error(revolutions, "a running spindle with G4 S");
  const double time = seconds ? seconds.value : revolutions.value * 60.0 / canon_.spindle_speed();
  const Cause cause = seconds ? seconds.cause : revolutions.cause;
  if (!(time >= 0 && time <= 1e6)) throw_input_error(cause, "0 to 1e6 seconds");
  dwell_after_move(time, cause);
}

/// Throws BadInput for words that are not possible under G41 and G42.
void Machine::check_compensated_block(const Block& block) const {
  if (!compensation_.is_on()) return;
  const Code& side = block[Group::CutterRadius];
  for (const Group group : {Group::Plane, Group::Units, Group::WorkOffset, Group::WithoutOffset,
                            Group::Transformation, Group::Pole, Group::Frame, Group::ToolChange})
    if (const Code& code = block[group])
      throw_input_error(code.cause, "G40 before " + shown(code.cause.text));
  if (side && side.word != "G40" && (side.word == "G41") != compensation_.is_left())
    throw_input_error(side.cause, "G40 between G41 and G42");
  for (const Address address : Addresses{"T", "D", "A", "B", "C", "A3", "B3", "C3"})
    if (block[address])
      throw_input_error(block[address], "G40 before " + shown(block[address].cause.text));
  if (const Code& code = block[Group::Motion]; code && (code.word == "CIP" || code.word == "G33"))
    throw_input_error(code.cause, "G40 before " + shown(code.cause.text));
}

void Machine::select_work_offset(const Code& code) {
  const int number = std::stoi(std::string(code.word.substr(1)));
  if (number > 506 && !canon_.options().extra_offsets.contains(number))
    throw_input_error(code.cause, fmt::format("G54 to G57, G505 or G506, or an offset from the "
                                              "control's table (`offsets`): $P_UIFR[{}]",
                                              number - 500));
  // G54 to G57 are indices 0 to 3, G505 and G506 are 4 and 5; G507 and beyond have index n - 1.
  const int first = number < 500 ? 54 : number > 506 ? 1 : 501;
  system_ = number - first;
  apply_frame();
}

/// Records the modes that a block states and those that it depends on.
void Machine::note_start_modes(const Block& block) {
  const std::pair<Group, StartMode> groups[] = {
      {Group::Units, StartMode::Units},          {Group::Distance, StartMode::Distance},
      {Group::Plane, StartMode::Plane},          {Group::FeedMode, StartMode::Feed},
      {Group::SpeedMode, StartMode::Feed},       {Group::Motion, StartMode::Motion},
      {Group::WorkOffset, StartMode::WorkOffset}};
  for (const auto& [group, mode] : groups)
    if (block[group]) run_.mark_stated(mode);
  if (first_axis_word(block) == nullptr || block[Group::Frame]) return;
  const std::string_view motion = block[Group::Motion] ? block.word(Group::Motion) : motion_;
  run_.assume_mode(StartMode::Units, "mm (G71)");
  run_.assume_mode(StartMode::Distance, "absolute (G90)");
  run_.assume_mode(StartMode::Motion, "line (G1)");
  assume_plane_and_feed(is_arc(motion), motion != "G0");
  if (!block[Group::WithoutOffset]) run_.assume_offset(system_ + 1, "work offset G54");
}

// The control executes units and feed first, then spindle, plane, distance, tool, offset,
// transformation and compensation.
void Machine::set_modes(const Block& block) {
  if (const Code& code = block[Group::Diameters]) {
    if (code.word != "DIAMOF" && !run_.is_turning())
      throw_input_error(code.cause,
                        "a turning control (control = \"turning\", or a machine whose spindle "
                        "turns the workpiece): X is not a diameter on a milling control");
    diameter_mode_ = code.word == "DIAMON"   ? Diameters::On
                     : code.word == "DIAM90" ? Diameters::Absolute
                                             : Diameters::Off;
    is_diameter_mode_known_ = true;
  }
  set_feed(block);
  set_spindle(block);
  note_diameters(block);
  if (const Code& code = block[Group::Plane])
    plane_ = code.word == "G17" ? 17 : code.word == "G18" ? 18 : 19;
  if (const Code& code = block[Group::Distance]) is_incremental_ = code.word == "G91";
  if (const Code& code = block[Group::OrientationFrame])
    turns_in_workpiece_ = code.word == "ORIWKS";
  if (const Code& code = block[Group::OrientationPath]) on_great_circle_ = code.word != "ORIAXES";
  call_tools(block);
  if (const Code& code = block[Group::WorkOffset]) {
    select_work_offset(code);
  }
  if (const Code& code = block[Group::Transformation]) change_transformation(code);
  if (const Code& code = block[Group::CutterRadius]) set_compensation(code);
}

BlockResult Machine::execute(const Block& block) {
  check_words(block);
  check_compensated_block(block);
  note_start_modes(block);
  set_modes(block);
  note_coolant(block);
  const Code& stop = block[Group::Stop];
  const bool is_program_end =
      stop && (stop.word == "M2" || stop.word == "M30" || stop.word == "M17");
  if (const Code& code = block[Group::Motion]) motion_ = code.word;
  BlockResult result{false, is_program_end};
  if (block[Group::Frame])
    execute_frame(block);
  else if (block[Group::Dwell])
    dwell(block);
  else if (block[Group::Pole])
    set_pole(block);
  else if (!block[Group::Limits])
    result.has_moved = move(block);
  if (stop && !is_program_end) canon_.record_auxiliary_word(stop.word == "M1" ? "M1" : "M0");
  return result;
}

std::optional<double> Machine::position(char letter, bool in_machine) const {
  const int j = canon_.joint_of(letter);
  if (j < 0) return std::nullopt;
  const double x_factor = j == joint(0) && !in_machine ? 1.0 / x_radius_factor(true) : 1.0;
  const double value = in_machine ? current_position()[j] : programmed_position()[j] * x_factor;
  return canon_.is_linear(j) ? value / unit() : value / units::deg;
}

/// Returns the number of the tool of T, which may be a number, a name or the only tool of the
/// scene.
int Machine::tool_number(const Block& block) const {
  const Value& word = block["T"];
  if (!block.tool_name) return int(word.value);
  const std::string& name = *block.tool_name;
  const auto& numbers = canon_.options().tool_number;
  if (const auto entry = numbers.find(name); entry != numbers.end()) return entry->second;
  // A name that consists of digits is usually the number.
  if (!name.empty() && name.size() < 9 && std::all_of(name.begin(), name.end(), is_digit))
    return std::stoi(name);
  if (canon_.options().control_by_h.empty() && !canon_.options().tool_length.empty() &&
      !canon_.options().tool_table) {
    canon_.assume({fmt::format("T={} is assumed to be the scene's only tool", quoted_excerpt(name)),
                   "tool.name"});
    return canon_.options().tool_length.begin()->first;
  }
  std::string names;
  for (const auto& [tool_name, number] : numbers)
    names += (names.empty() ? "" : ", ") + quoted_excerpt(tool_name);
  throw_input_error(
      word, "the name of a tool of the scene (" + (names.empty() ? "none is named" : names) + ")",
      quoted_excerpt(name));
}

void Machine::call_tools(const Block& block) {
  const Value &t = block["T"], &d = block["D"];
  const Code& change = block[Group::ToolChange];
  if (t) selected_ = tool_number(block);
  if (t && !program::is_known_tool(canon_.options(), selected_))
    throw_input_error(t.cause, "a tool of the tool table");
  // With M6 T only selects; without it T changes.
  const bool changes = change || (t && !m6_changes_tool_);
  if (changes && selected_ >= 0) tool_ = selected_;
  if (t || change) canon_.record_tool_call(t ? double(selected_) : -1.0, bool(change));
  std::string text = t ? fmt::format("T{}", selected_) : "";
  if (change) text += text.empty() ? "M6" : " M6";
  if (!text.empty()) canon_.record_auxiliary_word(std::move(text));
  if (!changes && !d) return;
  // After a tool change the control reads its axis positions anew.
  compensation_.clear_leaving();
  // A new tool comes with D1; T0 has no length.
  if (changes) has_tool_length_ = true;
  if (d) has_tool_length_ = d.value != 0;
  if (changes && tool_ == 0) has_tool_length_ = false;
  if (tool_ >= 0)
    canon_.select_length(has_tool_length_ ? tool_ : -1, t        ? t.cause
                                                        : change ? change.cause
                                                                 : d.cause);
  apply_tool();
}

/// Returns true if all tools have the same length, so that the tool in the spindle does not matter.
bool Machine::has_single_length() const {
  const auto& lengths = canon_.options().tool_length;
  return !lengths.empty() && canon_.options().control_by_h.empty() &&
         !canon_.options().tool_table &&
         std::all_of(lengths.begin(), lengths.end(),
                     [&](const auto& entry) { return entry.second == lengths.begin()->second; });
}

double Machine::active_tool_length(const Cause& cause) const {
  const auto& lengths = canon_.options().tool_length;
  if (const auto length = find_value(lengths, tool_)) return *length;
  if (has_single_length()) return lengths.begin()->second;
  throw_input_error(
      cause, "a tool with a known length (" + known_numbers(lengths, "T") + ") in the spindle",
      tool_ < 0 ? "none called" : fmt::format("T{}", tool_));
}

std::optional<double> Machine::nose_radius(int tool) const {
  const auto& radii = canon_.options().tool_radius;
  if (const auto radius = find_value(radii, tool)) return radius;
  // The only tool of the scene is assumed whatever its number.
  const auto only = program::only_tool(canon_.options());
  return only ? find_value(radii, *only) : std::nullopt;
}

/// Returns the displacement, (axes) mm, from the point of a turning tool that X Z lead to the
/// centre of its nose.
AxisVector Machine::programmed_nose_offset() const {
  return nose_offset(canon_, run_.is_turning() ? run_.options().turning.tip_number : 0,
                     nose_radius(tool_));
}

void Machine::set_compensation(const Code& code) {
  if (code.word == "G40") {
    if (!compensation_.is_on()) return;
    compensation_.end();
    if (!run_.is_turning()) return;
    // When compensation begins or ends, the programmed point changes between the tip and the centre
    // of the nose.
    apply_tool();
    return compensation_.shift_programmed(programmed_nose_offset());
  }
  const bool left = code.word == "G41";
  if (compensation_.is_on()) return;
  if (!has_tool_length_) throw_input_error(code.cause, "D1 before " + shown(code.cause.text));
  const std::array<int, 2> joints = plane_joints(code.cause);
  const Eigen::Matrix3d R = total_rotation();
  // 1 - cos(tilt) below 1e-14, a tilt of 1.4e-7 rad, is a rotation about the normal of the plane.
  if (std::abs(R(plane_normal(), plane_normal()) - 1.0) > 1e-14)
    throw_input_error(code.cause, "no tilted plane with a path of the tool centre: no " +
                                      std::string(code.word) + " in it");
  const int tool = tool_ >= 0 ? tool_ : run_.assume_only_tool(code.cause, "no tool called");
  const auto radius = nose_radius(tool);
  if (!radius)
    throw_input_error(code.cause, "a tool with a known radius", fmt::format("T{}", tool));
  compensation_.begin(left, *radius, joints);
  if (!run_.is_turning()) return;
  apply_tool();  // under G41 and G42 X Z lead the centre of the nose
  compensation_.shift_programmed(-programmed_nose_offset());
}

/// Puts the tool length in force. On a machine with rotary axes it is that of the chain; on a
/// turning control it is measured, so that X Z lead the tip; on other machines it is added to Z.
void Machine::apply_tool() {
  canon_.set_tool_shift(is_tip_mode() ? AxisVector() : active_tool_shift());
  apply_frame();
}

AxisVector Machine::active_tool_shift() const {
  if (run_.is_turning()) {
    const Chain* to_tip = chain_to_tip(canon_.options(), tool_);
    if (to_tip == nullptr || !has_tool_length_ || !is_known_tool()) return {};
    AxisVector measured = measured_offset(canon_, *to_tip, {1, {}});
    if (!compensation_.is_on()) measured += programmed_nose_offset();
    return measured;
  }
  AxisVector shift = AxisVector::Zero(canon_.position().size());
  const auto& zero = canon_.zero();
  // With the axes at zero the vector from the tip to the nose is the length of the tool.
  if (zero && zero->places && orientation_.is_possible()) {
    const auto tip_w = program::tip_at_zero(*chain_to_tip(canon_.options(), tool_));
    // Under D0 no length counts, so that X Y Z lead the nose.
    if (!tip_w || (!has_tool_length_ && is_known_tool())) return {};
    for (int k = 0; k < 3; ++k) shift[joint(k)] = zero->nose_w[k] - (*tip_w)[k];
    return shift;
  }
  const int z = joint(2);
  if (z < 0 || orientation_.is_possible() || !has_tool_length_ || !is_known_tool()) return {};
  shift[z] = active_tool_length({1, {}});
  return shift;
}

}  // namespace abbe::sim::dialects::siemens
