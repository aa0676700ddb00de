#include "sim/program/nc_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/program/canon.h"
#include "sim/program/nc_block.h"

namespace abbe::sim::program {

using Eigen::Vector2d;
using kinematics::AxisVector;

/// Modal groups: a block has at most one code of each.
enum class CodeGroup {
  OneBlock,
  ArcDistance,
  CutterRadius,
  Distance,
  FeedMode,
  Motion,
  Plane,
  ToolLength,
  Units,
  WorkOffset,
  Stop,
  Spindle,
  ToolChange,
  Coolant,
  Count
};

/// G and M codes of a block by modal group.
struct Codes {
  struct Code {
    int tenths = -1;  ///< ten times the number: G43.4 is 434; -1: no code of this group
    NcWord word;
    explicit operator bool() const { return tenths >= 0; }
  };
  std::array<Code, std::size_t(CodeGroup::Count)> by_group;
  const Code& operator[](CodeGroup group) const { return by_group[std::size_t(group)]; }
};

/// Sorts the codes of a block by modal group. Throws BadInput at a code that the control does not
/// know and at the second code of a group.
Codes parse_codes(const NcBlock& block, const NcLocation& location);

namespace {

/// Letters of a plane: its two axes, right-handed, and the centre offsets along the first, the
/// second and the normal.
struct PlaneLetters {
  std::string_view axes, centre;
  std::string_view pair;  ///< the centre offsets in the plane, for messages
};

PlaneLetters plane_letters(int plane) {
  if (plane == 18) return {"ZX", "KIJ", "I K"};
  if (plane == 19) return {"YZ", "JKI", "J K"};
  return {"XY", "IJK", "I J"};
}

void find_centre(const Canon& canon, const ArcBlock& block, const PlaneLetters& letters,
                 ArcMove& arc) {
  const auto first = block.word(letters.centre[0]), second = block.word(letters.centre[1]);
  if (const auto normal_offset = block.word(letters.centre[2]))
    canon.throw_input_error(normal_offset->cause,
                            fmt::format("{} in the plane of G{}", letters.pair, block.plane));
  if (!first && !second)
    canon.throw_input_error(
        block.cause, fmt::format("{} or R with {}", letters.pair, block.clockwise ? "G2" : "G3"),
        "none");
  if (block.absolute_centre && (!first || !second))
    canon.throw_input_error(block.cause, fmt::format("both {} under G90.1", letters.pair), "one");
  const Vector2d centre_words(first ? first->mm : 0.0, second ? second->mm : 0.0);
  const auto in_plane = [&](const AxisVector& q) { return Vector2d(q[arc.first], q[arc.second]); };
  // Without rotation the centre is computed from joint positions directly. The conversion to
  // program coordinates and back would change the last bit.
  if (!canon.frame().rotation) {
    const AxisVector zero = AxisVector::Zero(block.from.size());
    arc.centre = centre_words + in_plane(block.absolute_centre ? canon.placed(zero) : block.from);
    return;
  }
  AxisVector p = canon.without_offsets(block.from);
  p[arc.first] = (block.absolute_centre ? 0.0 : p[arc.first]) + centre_words.x();
  p[arc.second] = (block.absolute_centre ? 0.0 : p[arc.second]) + centre_words.y();
  arc.centre_with_offsets = canon.placed(std::move(p));
  arc.centre = in_plane(arc.centre_with_offsets);
}

}  // namespace

// With R the centre is left to `Canon`, which knows the rotated plane.
ArcMove arc_from_block(const Canon& canon, const ArcBlock& block) {
  const PlaneLetters letters = plane_letters(block.plane);
  ArcMove arc{.first = canon.joint_of(letters.axes[0]),
              .second = canon.joint_of(letters.axes[1]),
              .end = block.end,
              .centre = {0, 0},
              .clockwise = block.clockwise,
              .cause = block.cause,
              .named = block.cause,
              .stated = block.stated};
  if (arc.first < 0 || arc.second < 0)
    canon.throw_input_error(block.cause, fmt::format("a machine with the axes {} {} of the plane",
                                                     letters.axes[0], letters.axes[1]));
  const auto radius = block.word('R');
  if (!radius) {
    find_centre(canon, block, letters, arc);
    return arc;
  }
  for (const char letter : {'I', 'J', 'K'})
    if (const auto word = block.word(letter))
      canon.throw_input_error(word->cause, "either R or I J K");
  arc.radius = radius->mm;
  arc.named = radius->cause;
  return arc;
}

namespace {

// Indexed by CodeGroup.
constexpr std::string_view group_names[] = {"that holds for one block (G4 G53)",
                                            "of arc centres (G90.1 G91.1)",
                                            "of cutter radius (G40)",
                                            "of distances (G90 G91)",
                                            "of feed (G93 G94)",
                                            "of motion (G0 G1 G2 G3 G80)",
                                            "of the plane (G17 G18 G19)",
                                            "of tool length (G43 G43.4 G49)",
                                            "of units (G20 G21)",
                                            "of work offset (G54 ... G59)",
                                            "that stops (M0 M1 M2 M30)",
                                            "of the spindle (M3 M4 M5)",
                                            "of tool change (M6)",
                                            "of coolant (M7 M8 M9)"};

/// Returns the group of a G code; `code` is ten times its number.
std::optional<CodeGroup> g_group(int code) {
  switch (code) {
    case 40:
    case 530:
      return CodeGroup::OneBlock;
    case 901:
    case 911:
      return CodeGroup::ArcDistance;
    case 400:
      return CodeGroup::CutterRadius;
    case 900:
    case 910:
      return CodeGroup::Distance;
    case 930:
    case 940:
      return CodeGroup::FeedMode;
    case 0:
    case 10:
    case 20:
    case 30:
    case 800:
      return CodeGroup::Motion;
    case 170:
    case 180:
    case 190:
      return CodeGroup::Plane;
    case 430:
    case 434:
    case 490:
      return CodeGroup::ToolLength;
    case 200:
    case 210:
      return CodeGroup::Units;
    case 540:
    case 550:
    case 560:
    case 570:
    case 580:
    case 590:
      return CodeGroup::WorkOffset;
    default:
      return std::nullopt;
  }
}

/// Returns the group of an M code; `code` is ten times its number.
std::optional<CodeGroup> m_group(int code) {
  switch (code) {
    case 0:
    case 10:
    case 20:
    case 300:
      return CodeGroup::Stop;
    case 30:
    case 40:
    case 50:
      return CodeGroup::Spindle;
    case 60:
      return CodeGroup::ToolChange;
    case 70:
    case 80:
    case 90:
      return CodeGroup::Coolant;
    default:
      return std::nullopt;
  }
}

constexpr std::string_view g_codes =
    "a G code of this control (G0 G1 G2 G3 G4 G17 G18 G19 G20 G21 G40 G43 G43.4 G49 G53 G54 ... "
    "G59 G80 G90 G90.1 G91 G91.1 G93 G94)";
constexpr std::string_view m_codes =
    "an M code of this control (M0 M1 M2 M3 M4 M5 M6 M7 M8 M9 M30)";

/// Returns ten times the number of a code, or -1 if it has more than one decimal or is out of
/// range.
int parse_tenths(const NcWord& word) {
  const double tenths = word.value * 10;
  // 1e-9 absorbs the binary representation of numbers such as 43.4.
  const bool is_code = tenths >= 0 && tenths < 2000 && std::abs(tenths - std::round(tenths)) < 1e-9;
  return is_code ? int(std::lround(tenths)) : -1;
}

}  // namespace

Codes parse_codes(const NcBlock& block, const NcLocation& location) {
  Codes codes;
  const auto add_code = [&](const NcWord& word, std::optional<CodeGroup> group,
                            std::string_view known_codes) {
    if (!group) throw_input_error(location, word, std::string(known_codes));
    Codes::Code& code = codes.by_group[std::size_t(*group)];
    if (code)
      throw_input_error(location, word,
                        fmt::format("only one code {} per block", group_names[std::size_t(*group)]),
                        fmt::format("{} after {}", shown(word.text), shown(code.word.text)));
    code = {parse_tenths(word), word};
  };
  for (const NcWord& word : block.g) add_code(word, g_group(parse_tenths(word)), g_codes);
  for (const NcWord& word : block.m) add_code(word, m_group(parse_tenths(word)), m_codes);
  return codes;
}

namespace {

constexpr double min_feed_word = 1e-9;  // per minute, so that every duration is finite

/// Executes the blocks of a plain NC program and holds the modal state.
class NcInterpreter {
 public:
  explicit NcInterpreter(Canon& canon) : canon_(canon) {}

  /// Returns false at the end of the program.
  bool execute(const NcBlock& block);
  void read_comments(const NcBlock& block);

 private:
  [[noreturn]] void throw_input_error(const Cause& word, std::string expected,
                                      std::optional<std::string> seen = {}) const {
    canon_.throw_input_error(word, std::move(expected), std::move(seen));
  }

  void check_letters(const NcBlock& block) const;
  void check_companions(const NcBlock& block, const Codes& codes) const;
  void set_modes(const NcBlock& block, const Codes& codes);
  void set_spindle(const NcBlock& block, const Codes& codes);
  void set_feed(const NcBlock& block, const Codes& codes);
  void set_tool_length(const NcBlock& block, const Codes& codes);
  void record_words_before_motion(const NcBlock& block, const Codes& codes);
  void record_words_after_motion(const Codes& codes);
  void dwell(const NcBlock& block, const NcWord& g4);
  void move(const NcBlock& block, const Codes& codes);
  Target target(const NcBlock& block, bool machine_coordinates) const;
  void arc(const NcBlock& block, const NcWord& cause, AxisVector end);

  const NcWord& first_axis_word(const NcBlock& block) const;
  double unit() const { return canon_.inch() ? units::inch : 1.0; }

  Canon& canon_;
  int motion_ = -1;  ///< ten times the number of the G code; -1: none yet
  int plane_ = 170;
  bool incremental_ = false;
  bool absolute_centre_ = false;
};

void NcInterpreter::read_comments(const NcBlock& block) {
  canon_.set_line(block.line);
  for (const std::string_view text : block.comments) canon_.comment(text);
}

void NcInterpreter::check_letters(const NcBlock& block) const {
  static constexpr std::string_view other_letters = "NFSTPHIJKR", axis_letters = "XYZABCUVW";
  for (char letter = 'A'; letter <= 'Z'; ++letter) {
    const NcWord& word = block[letter];
    if (!word || other_letters.find(letter) != std::string_view::npos) continue;
    if (canon_.joint_of(letter) >= 0) continue;
    if (axis_letters.find(letter) != std::string_view::npos)
      throw_input_error(word, "an axis of this machine (" + canon_.letters() + ")");
    throw_input_error(word,
                      "a word of this control (N G " + canon_.letters() + " I J K R F S T M H P)");
  }
}

const NcWord& NcInterpreter::first_axis_word(const NcBlock& block) const {
  static const NcWord none;
  const NcWord* first = &none;
  for (char letter = 'A'; letter <= 'Z'; ++letter) {
    const NcWord& word = block[letter];
    if (word && canon_.joint_of(letter) >= 0 && (!*first || word.column < first->column))
      first = &word;
  }
  return *first;
}

/// Checks the words that are valid only together with others.
void NcInterpreter::check_companions(const NcBlock& block, const Codes& codes) const {
  const Codes::Code& one_block_code = codes[CodeGroup::OneBlock];
  const NcWord& axis = first_axis_word(block);
  const int motion = codes[CodeGroup::Motion] ? codes[CodeGroup::Motion].tenths : motion_;
  const bool is_dwell = one_block_code && one_block_code.tenths == 40;
  const bool is_arc = !is_dwell && (motion == 20 || motion == 30);
  if (is_dwell && axis) throw_input_error(axis, "no axis word with G4");
  if (is_dwell && !block['P'])
    throw_input_error(one_block_code.word, "P (seconds) with G4", "none");
  if (block['P'] && !is_dwell) throw_input_error(block['P'], "G4 with P");
  for (const char letter : {'I', 'J', 'K', 'R'})
    if (block[letter] && !is_arc) throw_input_error(block[letter], "G2 or G3 with I J K R");
  const Codes::Code& length = codes[CodeGroup::ToolLength];
  const bool calls_length = length && length.tenths != 490;
  if (calls_length && !block['H'])
    throw_input_error(length.word, "H (tool length) with " + shown(length.word.text), "none");
  if (block['H'] && !calls_length) throw_input_error(block['H'], "G43 or G43.4 with H");
  if (axis && (motion < 0 || motion == 800))
    throw_input_error(axis, "G0 G1 G2 or G3 before an axis word");
  if (one_block_code && one_block_code.tenths == 530) {
    if (!axis) throw_input_error(one_block_code.word, "an axis word with G53", "none");
    if (is_arc) throw_input_error(one_block_code.word, "G0 or G1 with G53");
  }
  if (const NcWord& tool = block['T'];
      tool && (tool.value < 0 || tool.value != std::floor(tool.value)))
    throw_input_error(tool, "an integer tool number");
}

void NcInterpreter::set_spindle(const NcBlock& block, const Codes& codes) {
  if (const NcWord& s = block['S']) {
    if (s.value < 0 || s.value > 1e7) throw_input_error(s, "a spindle speed from 0 to 1e7 rpm");
    canon_.set_spindle_speed(s.value);
  }
  if (const Codes::Code& code = codes[CodeGroup::Spindle])
    canon_.turn_spindle(code.tenths == 30 ? 1 : code.tenths == 40 ? -1 : 0);
}

void NcInterpreter::set_feed(const NcBlock& block, const Codes& codes) {
  if (const Codes::Code& code = codes[CodeGroup::FeedMode]) {
    const FeedMode mode = code.tenths == 930 ? FeedMode::InverseTime : FeedMode::PerMinute;
    // After a change of mode F has another meaning, so the old value must not survive.
    if (mode != canon_.feed_mode()) canon_.set_feed({});
    canon_.set_feed_mode(mode);
  }
  // Under G93 F holds for its own block only.
  if (canon_.feed_mode() == FeedMode::InverseTime) canon_.set_feed({});
  if (const NcWord& f = block['F']) {
    if (!(f.value >= min_feed_word)) throw_input_error(f, "a feed greater than zero");
    canon_.set_feed(Feed{f.value, unit()});
  }
}

// G43 shifts Z by the tool length; G43.4 commands the tip, so its chain includes the length.
void NcInterpreter::set_tool_length(const NcBlock& block, const Codes& codes) {
  const Codes::Code& code = codes[CodeGroup::ToolLength];
  if (!code) return;
  if (code.tenths == 490) {
    canon_.set_tool_shift({});
    canon_.select_length(-1, code.word);
    return canon_.set_tip_mode(false, code.word);
  }
  const std::map<int, double>& lengths = canon_.options().tool_length;
  const NcWord& h = block['H'];
  const auto length =
      h.value == std::floor(h.value) && h.value >= 0 ? lengths.find(int(h.value)) : lengths.end();
  if (length == lengths.end()) {
    std::string known_lengths;
    for (const auto& [number, mm] : lengths) known_lengths += fmt::format(" H{}", number);
    throw_input_error(h, "a known tool length (" +
                             (known_lengths.empty() ? "none known" : known_lengths.substr(1)) +
                             ")");
  }
  canon_.select_length(length->first, code.word);
  AxisVector shift;
  if (code.tenths == 430) {
    const int z = canon_.joint_of('Z');
    if (z < 0) throw_input_error(code.word, "a machine with a Z axis");
    shift = AxisVector::Zero(canon_.position().size());
    shift[z] = length->second;
  }
  canon_.set_tool_shift(std::move(shift));
  canon_.set_tip_mode(code.tenths == 434, code.word);
}

void NcInterpreter::set_modes(const NcBlock& block, const Codes& codes) {
  if (const auto& code = codes[CodeGroup::Units]) canon_.set_inch(code.tenths == 200);
  set_feed(block, codes);
  set_spindle(block, codes);
  if (const auto& code = codes[CodeGroup::Plane]) plane_ = code.tenths;
  set_tool_length(block, codes);
  if (const auto& code = codes[CodeGroup::WorkOffset]) {
    const int number = (code.tenths - 540) / 10;
    canon_.set_frame(number, {canon_.options().work_offset[std::size_t(number)]});
  }
  if (const auto& code = codes[CodeGroup::Distance]) incremental_ = code.tenths == 910;
  if (const auto& code = codes[CodeGroup::ArcDistance]) absolute_centre_ = code.tenths == 901;
  if (const auto& code = codes[CodeGroup::Motion]) motion_ = code.tenths;
}

void NcInterpreter::record_words_before_motion(const NcBlock& block, const Codes& codes) {
  const bool changes = bool(codes[CodeGroup::ToolChange]);
  const NcWord& tool = block['T'];
  if (tool || changes) canon_.record_tool_call(tool ? tool.value : -1.0, changes);
  std::string text = tool ? fmt::format("T{:.0f}", tool.value) : "";
  for (const CodeGroup group : {CodeGroup::ToolChange, CodeGroup::Coolant})
    if (const Codes::Code& code = codes[group]; code && code.tenths != 90)
      text += fmt::format("{}M{}", text.empty() ? "" : " ", code.tenths / 10);
  if (!text.empty()) canon_.record_auxiliary_word(std::move(text));
}

/// Records the words that a control executes after the motion of the block: M0 M1 M9.
void NcInterpreter::record_words_after_motion(const Codes& codes) {
  const Codes::Code &stop = codes[CodeGroup::Stop], &coolant = codes[CodeGroup::Coolant];
  if (coolant && coolant.tenths == 90) canon_.record_auxiliary_word("M9");
  if (stop && stop.tenths <= 10) canon_.record_auxiliary_word(fmt::format("M{}", stop.tenths / 10));
}

// Canon checks the range too, but only here can the message name G4.
void NcInterpreter::dwell(const NcBlock& block, const NcWord& g4) {
  const NcWord& p = block['P'];
  if (p.value < 0 || p.value > max_dwell_s)
    throw_input_error(p, "0 to 1e6 seconds with " + shown(g4.text));
  canon_.dwell(p.value, p);
}

// G53 ignores G91: machine coordinates are always absolute.
Target NcInterpreter::target(const NcBlock& block, bool machine_coordinates) const {
  Target target;
  for (char letter = 'A'; letter <= 'Z'; ++letter) {
    const NcWord& word = block[letter];
    const int j = canon_.joint_of(letter);
    if (!word || j < 0) continue;
    const double value = word.value * (canon_.is_linear(j) ? unit() : units::deg);
    if (incremental_ && !machine_coordinates)
      target.by(j, value, word);
    else
      target.to(j, value, word);
  }
  return target;
}

void NcInterpreter::arc(const NcBlock& block, const NcWord& cause, AxisVector end) {
  canon_.arc(arc_from_block(canon_, {.plane = plane_ / 10,
                                     .clockwise = motion_ == 20,
                                     .absolute_centre = absolute_centre_,
                                     .from = canon_.position(),
                                     .end = std::move(end),
                                     .cause = cause,
                                     .word = [&](char letter) -> std::optional<LengthValue> {
                                       const NcWord& word = block[letter];
                                       if (!word) return std::nullopt;
                                       return LengthValue{word.value * unit(), word};
                                     }}));
}

void NcInterpreter::move(const NcBlock& block, const Codes& codes) {
  const Codes::Code& code = codes[CodeGroup::Motion];
  const NcWord& axis = first_axis_word(block);
  const bool is_arc = motion_ == 20 || motion_ == 30;
  const bool has_arc_words = block['I'] || block['J'] || block['K'] || block['R'];
  if (!axis && !(is_arc && has_arc_words)) return;
  // I J K or R without axis words program a full circle.
  const NcWord& cause = code         ? code.word
                        : axis       ? axis
                        : block['R'] ? block['R']
                        : block['I'] ? block['I']
                        : block['J'] ? block['J']
                                     : block['K'];
  // G53 holds for one block, so the coordinates are switched before the move and back after it.
  const bool machine_coordinates =
      codes[CodeGroup::OneBlock] && codes[CodeGroup::OneBlock].tenths == 530;
  if (machine_coordinates) canon_.go_to(Coordinates::Axis, cause);
  AxisVector end = canon_.end_of(target(block, machine_coordinates), machine_coordinates);
  if (is_arc)
    arc(block, cause, std::move(end));
  else if (motion_ == 0)
    canon_.traverse({std::move(end), cause, machine_coordinates});
  else
    canon_.straight_feed({std::move(end), cause, machine_coordinates});
  if (machine_coordinates && canon_.tip_mode()) canon_.go_to(Coordinates::Tip, cause);
}

// The order is that of RS274/NGC: feed, spindle, tool, modes, then dwell or motion, then stops.
bool NcInterpreter::execute(const NcBlock& block) {
  canon_.set_line(block.line);
  const Codes codes = parse_codes(block, canon_.place());
  check_letters(block);
  check_companions(block, codes);
  set_modes(block, codes);
  record_words_before_motion(block, codes);
  const Codes::Code& one_block_code = codes[CodeGroup::OneBlock];
  if (one_block_code && one_block_code.tenths == 40)
    dwell(block, one_block_code.word);
  else
    move(block, codes);
  const Codes::Code& stop = codes[CodeGroup::Stop];
  record_words_after_motion(codes);
  return !(stop && (stop.tenths == 20 || stop.tenths == 300));
}

}  // namespace

Path read_nc(std::string_view text, const std::string& file, const NcOptions& options) {
  if (text.size() > options.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.max_bytes),
                   fmt::format("{}", text.size()));
  Canon canon(file, options);
  read_nc(text, canon);
  return canon.take();
}

void read_nc(std::string_view text, Canon& canon) {
  NcInterpreter interpreter(canon);
  LineReader lines(text);
  NcBlock block;
  int percent_marks = 0;
  while (const auto line = lines.next()) {
    canon.set_line(lines.number());
    block = parse_block(*line, canon.place(), std::move(block));
    // The first % opens the tape, the second one ends it.
    if (block.is_percent_line && ++percent_marks == 2) break;
    // The strict reader knows a single level of block skip.
    if (block.deleted && canon.options().block_skip.test(0)) continue;
    if (!block.comments.empty()) interpreter.read_comments(block);
    if (!block.is_percent_line && !block.empty() && !interpreter.execute(block)) break;
  }
}

Path read_nc_file(const std::filesystem::path& file, const NcOptions& options) {
  return read_nc(read_text(file, options.max_bytes), file.string(), options);
}

}  // namespace abbe::sim::program
