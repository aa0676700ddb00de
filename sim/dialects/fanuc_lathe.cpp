#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/dialects/cursor.h"
#include "sim/dialects/fanuc_lathe.h"
#include "sim/dialects/fanuc_machine.h"
#include "sim/dialects/turning_tool.h"

/// Words that a turning control reads otherwise than a milling control: G-code system A.
namespace abbe::sim::dialects::fanuc {

using kinematics::AxisVector;

namespace {

constexpr int geometry_offsets = 10000;  // P of G10 from here on
constexpr int max_offset = 99;

/// Words of a line as far as signs of turning controls need them.
struct LineWords {
  std::array<double, 26> value{};
  std::array<int, 26> column{};  ///< 0: the line has no such word
  std::vector<std::pair<double, int>> g;  ///< codes with their columns
  bool changes_tool = false;              ///< M6

  bool has(char letter) const { return column[std::size_t(letter - 'A')] > 0; }
  double operator[](char letter) const { return value[std::size_t(letter - 'A')]; }
  /// Column of a G code; 0 where there is none of that range.
  int g_within(double first, double last) const {
    for (const auto& [code, at] : g)
      if (code >= first && code <= last) return at;
    return 0;
  }
};

LineWords words_of_line(Cursor cursor) {
  LineWords words;
  while (!cursor.at_end()) {
    const char letter = upper(cursor.here());
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
      break;  // reading says what is wrong with it
    }
    if (!number) continue;
    words.value[std::size_t(letter - 'A')] = *number;
    words.column[std::size_t(letter - 'A')] = column;
    if (letter == 'G') words.g.emplace_back(*number, column);
    words.changes_tool = words.changes_tool || (letter == 'M' && *number == 6);
  }
  return words;
}

}  // namespace

std::optional<TurningSign> sign_of_turning(std::string_view text, const program::Canon& canon) {
  const bool has_u = canon.joint_of('U') >= 0 || canon.joint_of('W') >= 0;
  std::optional<TurningSign> tool;
  bool surface_speed = false, changes = false;
  Lines lines(text);
  while (const auto line = lines.next()) {
    const LineWords words = words_of_line({*line, canon.place()});
    const auto sign = [&](std::string_view what, int column) {
      return TurningSign{std::string(what), lines.number(), column};
    };
    if (const int at = words.g_within(50, 50); at > 0 && words.has('S'))
      return sign("G50 with S, the largest spindle speed of a turning control", at);
    if (const int at = words.g_within(28, 30);
        at > 0 && !has_u && (words.has('U') || words.has('W')))
      return sign("G28 with U or W, increments of a turning control", at);
    if (const int at = words.g_within(70, 73);
        at > 0 && !has_u && words.has('P') && words.has('Q') && !words.has('R') && !words.has('Z'))
      return sign("a cycle of a turning control with P and Q", at);
    if (!tool && words.has('T') && words['T'] >= 101 && words['T'] <= 9999)
      tool = sign("T with tool and offset beside G96, as turning controls have it",
                  words.column['T' - 'A']);
    surface_speed = surface_speed || words.g_within(96, 96) > 0;
    changes = changes || words.changes_tool;
  }
  return surface_speed && !changes ? tool : std::nullopt;
}

bool Machine::is_increment(char letter) const {
  return turning_ && std::string_view("UVWH").find(letter) != std::string_view::npos;
}

int Machine::joint_of_word(char letter) const {
  if (!is_increment(letter)) return canon_.joint_of(letter);
  return canon_.joint_of(letter == 'H' ? 'C' : char(letter - 'U' + 'X'));
}

/// What the program itself cannot say: the words are those of another control on another machine.
void Machine::note_turning_control() {
  if (run_.options().turning.control == ControlKind::OfMachine)
    canon_.assume({"as a spindle turns the workpiece, the control is one of a turning machine "
                   "(Fanuc G-code system A): U V W H are increments, G98 and G99 feeds",
                   "program.control", "--control"});
  if (run_.options().turning.x_words == XWords::OfControl)
    canon_.assume({diameters_ ? "X and U words are diameters" : "X and U words are radii",
                   "program.x_words", "--x-words"});
}

/// Feeds before a tool is called are those of the only one.
void Machine::note_uncalled_tool(const Cause& cause) {
  if (!turning_ || tool_offset_.called || motion_ == 0) return;
  run_.uncalled_tool(cause, "no T before the first feed");
  tool_offset_.called = true;
  tool_offset_.number = 1;
}

int Machine::tool_in_use() const {
  return tool_ != 0 ? tool_ : program::only_tool(canon_.options()).value_or(0);
}

/// C, R, I and K behind a line make a chamfer or a rounding of the corner at its end.
void Machine::check_corner_words(const Block& block) const {
  const int code = block[Group::Motion] ? block.tenths(Group::Motion) : motion_;
  if (code != 10 || block[Group::OneShot] || block[Group::Macro] || block[Group::SpeedMode]) return;
  for (const char letter : {'C', 'R', 'I', 'K'}) {
    const Word& word = block[letter];
    if (word && !(letter == 'C' && joint_of_word('C') >= 0))
      refuse(word, "lines and arcs as they are: C, R, I and K of corners are not expanded");
  }
}

/// T0101: tool and offset. T0100 and T0 end the offset.
void Machine::call_tool_and_offset(const Block& block) {
  const Word& t = block['T'];
  if (!t) return;
  const int value = whole(canon_, t, 9999);
  if (value != 0 && value <= max_offset)
    refuse(t, "T with four digits, tool and offset, such as T0101");
  if (compensation_.on()) refuse(t, "G40 before another T");
  const int tool = value / 100;
  if (!program::knows_tool(canon_.options(), tool)) refuse(t, "a tool of the tool table");
  tool_offset_.called = true;
  tool_offset_.number = value % 100;
  if (tool != 0) {
    selected_ = tool_ = tool;
    canon_.call_tool(tool, true);
    canon_.aside(fmt::format("T{} M6", tool));
  }
  apply_tool_offset(t);
}

std::optional<double> Machine::nose_radius() const {
  const auto known = radii_.find(tool_in_use());
  if (known == radii_.end() || !known->second.value) return std::nullopt;
  return *known->second.value;
}

AxisVector Machine::nose_from_led_tip() const {
  return nose_from_tip(canon_, run_.options().turning.tip, nose_radius());
}

/// An offset in force has been measured: X Z lead the tip of the tool, X0 being on the spindle
/// line. Without one they are positions of the slides. Until a program calls a tool, the only one
/// is taken to be in use with its offset.
void Machine::apply_tool_offset(const Cause& cause) {
  const kinematics::Chain* chain = chain_to_tip(canon_.options(), tool_in_use());
  const bool counts = tool_offset_.called ? tool_offset_.number != 0 : tool_in_use() != 0;
  if (chain == nullptr || !counts) {
    if (tool_ != 0) canon_.call_length(-1, cause);
    return canon_.set_tool_shift({});
  }
  AxisVector shift = measured_offset(canon_, *chain, cause);
  if (!compensation_.on()) shift += nose_from_led_tip();
  if (const auto wear = tool_offset_.wear.find(tool_offset_.number);
      wear != tool_offset_.wear.end()) {
    if (joint(0) >= 0) shift[joint(0)] += wear->second.x;
    if (joint(2) >= 0) shift[joint(2)] += wear->second.z;
  }
  if (tool_ != 0) canon_.call_length(tool_, cause);
  canon_.set_tool_shift(std::move(shift));
}

/// G10 P (number) X Z U W R: wear. What is geometry on the control is the scene's tool here.
void Machine::store_wear(const Block& block) {
  const Code& code = block[Group::OneShot];
  const Word& p = block['P'];
  if (block['L']) refuse(block['L'], "L2 L20, or no L, beside G10");
  if (!p) refuse(code.word, "P (number of the offset) beside G10", "none");
  const int number = whole(canon_, p, 2 * geometry_offsets);
  if (number < 1 || number > max_offset)
    refuse(p, "wear, P1 to P99: the geometry of tools is that of the scene");
  if (block['Q']) refuse(block['Q'], "no Q: program.tip says which point of the tool X Z lead");
  ToolOffset::Wear& wear = tool_offset_.wear[number];
  for (const auto& [j, word, step] : axis_words(block)) {
    if (j != joint(0) && j != joint(2)) refuse(*word, "X Z U W or R beside G10 of a tool");
    double& value = j == joint(0) ? wear.x : wear.z;
    value = axis_word(j, *word) + (step ? value : 0.0);
  }
  if (const Word& r = block['R']) wear.radius = length(r);
  if (number == tool_offset_.number) apply_tool_offset(code.word);
}

/// G41 and G42 lead the nose along the contour: the centre of it beside by its radius.
void Machine::set_nose_compensation(const Code& code) {
  cutter_ = code.tenths;
  if (code.tenths == 400) {
    if (!compensation_.on()) return;
    compensation_.end();
    apply_tool_offset(code.word);
    return compensation_.shift_programmed(nose_from_led_tip());
  }
  if (compensation_.on()) {
    if (code.tenths == side_) return;  // posts say it again
    refuse(code.word, "G40 between G41 and G42");
  }
  side_ = code.tenths;
  const std::string_view plane = plane_letters();
  const int first = canon_.joint_of(plane[0]), second = canon_.joint_of(plane[1]);
  if (first < 0 || second < 0)
    refuse(code.word,
           fmt::format("a machine with the axes {} {} of the plane", plane[0], plane[1]));
  const auto radius = nose_radius();
  if (!radius)
    refuse(code.word, "a tool whose nose radius is known",
           tool_ == 0 ? "none called" : fmt::format("T{:02}", tool_));
  const auto wear = tool_offset_.wear.find(tool_offset_.number);
  const double worn = wear == tool_offset_.wear.end() ? 0.0 : wear->second.radius;
  run_.warn_once(
      "nose compensation arrives upright beside the start of the contour and goes around outside "
      "corners in arcs; a control goes around some of them in lines");
  compensation_.begin(code.tenths == 410, *radius + worn, {first, second});
  apply_tool_offset(code.word);
  compensation_.shift_programmed(-nose_from_led_tip());
}

/// G90 turns along Z, G94 faces along X: rapid to the cut, feed along it and out of it, rapid back.
/// Words that a block leaves out stay as they were.
void Machine::turning_cycle(const Block& block) {
  const Cause cause = cause_of(block);
  if (compensation_.on()) refuse(cause, "G40 before G90 and G94");
  note_uncalled_tool(cause);
  const int x = joint(0), z = joint(2);
  if (x < 0 || z < 0) refuse(cause, "a machine with X and Z beside G90 and G94");
  const AxisVector start = canon_.programmed();
  TurningCycle& cycle = turning_cycle_;
  for (const auto& [j, word, step] : axis_words(block)) {
    if (j != x && j != z) refuse(*word, "X Z U W beside G90 and G94");
    const double to = axis_word(j, *word) + (step ? start[j] : 0.0);
    (j == x ? cycle.x : cycle.z) = to;
    (j == x ? cycle.has_x : cycle.has_z) = true;
  }
  if (const Word& r = block['R']) cycle.taper = length(r);
  if (!cycle.has_x || !cycle.has_z)
    refuse(cause, "X and Z in the first block of G90 and G94", "one of them");
  moved_ = true;
  const auto go = [&](double to_x, double to_z, bool rapid) {
    AxisVector end = start;
    end[x] = to_x;
    end[z] = to_z;
    const AxisVector placed = canon_.placed(std::move(end));
    AxisVector there = canon_.position();  // a spindle among the joints goes on
    there[x] = placed[x];
    there[z] = placed[z];
    canon_.straight({.end = std::move(there), .cause = cause}, rapid);
  };
  const bool along_z = motion_ == 900;
  if (along_z)
    go(cycle.x + cycle.taper, start[z], true);
  else
    go(start[x], cycle.z + cycle.taper, true);
  go(cycle.x, cycle.z, false);
  if (along_z)
    go(start[x], cycle.z, false);
  else
    go(cycle.x, start[z], false);
  go(start[x], start[z], true);
}

}  // namespace abbe::sim::dialects::fanuc
