#include "sim/program/nc.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "kinematics/bad_input.h"
#include "kinematics/inverse.h"
#include "kinematics/text.h"
#include "kinematics/units.h"
#include "sim/program/nc_arc.h"
#include "sim/program/nc_codes.h"
#include "sim/program/nc_notes.h"

namespace abbe::sim::program {
namespace {

using kinematics::AxisVector;
using kinematics::Motion;

constexpr double largest_mm = 1e6;
constexpr double largest_rad = 1e7;
constexpr double largest_dwell_s = 1e6;
constexpr double smallest_feed = 1e-9;  // per minute; keeps every duration finite
// mm or rad, less is the rounding of a change of coordinates
constexpr double least_motion = 1e-11;

/// The control while it reads: its modes, and where the axes stand.
class Control {
 public:
  Control(const std::string& file, const NcOptions& options);

  /// @return false at the end of the program
  bool execute(const NcBlock& block);
  void read_comments(const NcBlock& block) { notes_.note_comments(block); }
  Path take() { return std::move(path_); }

 private:
  struct Feed {
    double word = 0.0;  ///< as programmed
    double unit = 1.0;  ///< mm per unit of length in it
  };

  NcPlace place() const { return {path_.file, line_}; }
  [[noreturn]] void refuse(const NcWord& word, std::string expected,
                           std::optional<std::string> seen = {}) const {
    program::refuse(place(), word, std::move(expected), std::move(seen));
  }

  void check_letters(const NcBlock& block) const;
  void check_companions(const NcBlock& block, const Codes& codes) const;
  void set_modes(const NcBlock& block, const Codes& codes);
  void set_spindle(const NcBlock& block, const Codes& codes);
  void set_feed(const NcBlock& block, const Codes& codes);
  void set_tool_length(const NcBlock& block, const Codes& codes);
  void dwell(const NcBlock& block, const NcWord& g4);
  void move(const NcBlock& block, const Codes& codes);
  AxisVector target(const NcBlock& block, bool machine_coordinates) const;
  double axis_value(int joint, const NcWord& word) const;
  void arc(const NcBlock& block, const NcWord& cause, AxisVector end);
  double duration(const Block& block, const NcBlock& words, const NcWord& cause) const;
  void append(Block block, double seconds);
  void go_to(Coordinates coordinates, const NcWord& cause);

  void use_chain(const NcWord& h, const NcWord& cause);

  const NcWord& first_axis_word(const NcBlock& block) const;
  /// -1 where the machine has no such axis
  int joint_of(char letter) const { return joint_of_[std::size_t(letter - 'A')]; }
  bool is_linear(int joint) const {
    return options_.axes[std::size_t(joint)].motion == Motion::Linear;
  }

  const NcOptions& options_;
  Path path_;
  NcNotes notes_{path_};
  int line_ = 0;
  std::array<int, 26> joint_of_;  ///< by letter
  int spindle_;                   ///< the joint that S and M3 turn

  AxisVector at_;  ///< where the axes are, in `coordinates_`, offsets in
  Coordinates coordinates_ = Coordinates::Axis;
  double time_s_ = 0.0;

  int motion_ = -1;  ///< tenths of the G code; -1 none
  int plane_ = 170;
  bool incremental_ = false;
  bool absolute_centre_ = false;
  bool inverse_time_ = false;
  bool tip_mode_ = false;
  double unit_ = 1.0;               ///< mm per unit of length
  const kinematics::Chain* chain_;  ///< that G43.4 counts with; null if there is none
  int length_number_ = -1;          ///< H in force
  double tool_length_ = 0.0;        ///< mm added to Z under G43
  int offset_ = 0;                  ///< 0 .. 5, G54 .. G59
  std::optional<Feed> feed_;
  double spindle_rpm_ = 0.0;
  int spindle_turns_ = 0;  ///< +1 M3, -1 M4, 0 M5
};

Control::Control(const std::string& file, const NcOptions& options)
    : options_(options),
      joint_of_(joints_by_letter(options.axes)),
      spindle_(spindle_of(options.axes)),
      at_(start_of(options)),
      chain_(options.control ? &*options.control : nullptr) {
  path_.file = file;
  for (const AxisVector& offset : options.work_offset)
    if (offset.size() != 0 && offset.size() != at_.size())
      throw std::invalid_argument("expected one work offset for every axis");
}

void Control::check_letters(const NcBlock& block) const {
  static constexpr std::string_view others = "NFSTPHIJKR", axes = "XYZABCUVW";
  for (char letter = 'A'; letter <= 'Z'; ++letter) {
    const NcWord& word = block[letter];
    if (!word || others.find(letter) != std::string_view::npos) continue;
    if (joint_of(letter) >= 0) continue;
    if (axes.find(letter) != std::string_view::npos)
      refuse(word, "an axis of this machine (" + letters_of(options_.axes) + ")");
    refuse(word,
           "a word of this control (N G " + letters_of(options_.axes) + " I J K R F S T M H P)");
  }
}

const NcWord& Control::first_axis_word(const NcBlock& block) const {
  static const NcWord none;
  const NcWord* first = &none;
  for (char letter = 'A'; letter <= 'Z'; ++letter) {
    const NcWord& word = block[letter];
    if (word && joint_of(letter) >= 0 && (!*first || word.column < first->column)) first = &word;
  }
  return *first;
}

/// Words that make sense only beside others.
void Control::check_companions(const NcBlock& block, const Codes& codes) const {
  const Codes::Code& once = codes[CodeGroup::OneBlock];
  const NcWord& axis = first_axis_word(block);
  const int motion = codes[CodeGroup::Motion] ? codes[CodeGroup::Motion].tenths : motion_;
  const bool is_dwell = once && once.tenths == 40;
  const bool is_arc = !is_dwell && (motion == 20 || motion == 30);
  if (is_dwell && axis) refuse(axis, "no axis word beside G4");
  if (is_dwell && !block['P']) refuse(once.word, "P (seconds) beside G4", "none");
  if (block['P'] && !is_dwell) refuse(block['P'], "G4 beside P");
  for (const char letter : {'I', 'J', 'K', 'R'})
    if (block[letter] && !is_arc) refuse(block[letter], "G2 or G3 beside I J K R");
  const Codes::Code& length = codes[CodeGroup::ToolLength];
  const bool calls = length && length.tenths != 490;
  if (calls && !block['H'])
    refuse(length.word, "H (tool length) beside " + shown(length.word.text), "none");
  if (block['H'] && !calls) refuse(block['H'], "G43 or G43.4 beside H");
  if (axis && (motion < 0 || motion == 800)) refuse(axis, "G0 G1 G2 or G3 before an axis word");
  if (once && once.tenths == 530) {
    if (!axis) refuse(once.word, "an axis word beside G53", "none");
    if (is_arc) refuse(once.word, "G0 or G1 beside G53");
  }
  if (const NcWord& tool = block['T'];
      tool && (tool.value < 0 || tool.value != std::floor(tool.value)))
    refuse(tool, "a whole tool number");
}

void Control::set_spindle(const NcBlock& block, const Codes& codes) {
  if (const NcWord& s = block['S']) {
    if (s.value < 0 || s.value > 1e7) refuse(s, "a spindle speed of 0 to 1e7 rpm");
    spindle_rpm_ = s.value;
  }
  if (const Codes::Code& code = codes[CodeGroup::Spindle])
    spindle_turns_ = code.tenths == 30 ? 1 : code.tenths == 40 ? -1 : 0;
}

void Control::set_feed(const NcBlock& block, const Codes& codes) {
  if (const Codes::Code& code = codes[CodeGroup::FeedMode]) {
    const bool inverse = code.tenths == 930;
    if (inverse != inverse_time_) feed_.reset();
    inverse_time_ = inverse;
  }
  if (inverse_time_) feed_.reset();
  if (const NcWord& f = block['F']) {
    if (!(f.value >= smallest_feed)) refuse(f, "a feed above zero");
    feed_ = Feed{f.value, unit_};
  }
}

void Control::go_to(Coordinates coordinates, const NcWord& cause) {
  if (coordinates == coordinates_) return;
  coordinates_ = coordinates;
  const int x = joint_of('X'), y = joint_of('Y'), z = joint_of('Z');
  if (coordinates == Coordinates::Tip) {
    const Eigen::Vector3d tip_w = chain_->tool_in_workpiece(at_).translation();
    at_[x] = tip_w.x();
    at_[y] = tip_w.y();
    at_[z] = tip_w.z();
  } else {
    const auto q = slides_for_tip(*chain_, at_, {at_[x], at_[y], at_[z]});
    if (!q) refuse(cause, "slides that reach the tip", "a tip out of their reach");
    at_ = *q;
  }
}

/// The chain to the tip of another tool: the axes stay where they are.
void Control::use_chain(const NcWord& h, const NcWord& cause) {
  const auto own = options_.control_of_h.find(int(h.value));
  if (own == options_.control_of_h.end() || chain_ == &own->second) return;
  go_to(Coordinates::Axis, cause);
  chain_ = &own->second;
}

void Control::set_tool_length(const NcBlock& block, const Codes& codes) {
  const Codes::Code& code = codes[CodeGroup::ToolLength];
  if (!code) return;
  tip_mode_ = code.tenths == 434;
  tool_length_ = 0.0;
  length_number_ = -1;
  if (code.tenths != 490) {
    const NcWord& h = block['H'];
    const auto length = h.value == std::floor(h.value) && h.value >= 0
                            ? options_.tool_length.find(int(h.value))
                            : options_.tool_length.end();
    if (length == options_.tool_length.end()) {
      std::string known;
      for (const auto& [number, mm] : options_.tool_length) known += fmt::format(" H{}", number);
      refuse(h,
             "a tool length that is known (" + (known.empty() ? "none is" : known.substr(1)) + ")");
    }
    length_number_ = length->first;
    use_chain(h, code.word);
    if (code.tenths == 430) {
      if (joint_of('Z') < 0) refuse(code.word, "a machine with a Z axis");
      tool_length_ = length->second;
    }
  }
  if (tip_mode_) {
    for (const char letter : {'X', 'Y', 'Z'})
      if (joint_of(letter) < 0)
        refuse(code.word, "a machine with the axes X Y Z beside G43.4",
               "one with " + letters_of(options_.axes));
    if (chain_ == nullptr) refuse(code.word, "a control that knows its kinematics beside G43.4");
  }
  go_to(tip_mode_ ? Coordinates::Tip : Coordinates::Axis, code.word);
}

void Control::set_modes(const NcBlock& block, const Codes& codes) {
  if (const auto& code = codes[CodeGroup::Units]) unit_ = code.tenths == 200 ? units::inch : 1.0;
  set_feed(block, codes);
  set_spindle(block, codes);
  if (const auto& code = codes[CodeGroup::Plane]) plane_ = code.tenths;
  set_tool_length(block, codes);
  if (const auto& code = codes[CodeGroup::WorkOffset]) offset_ = (code.tenths - 540) / 10;
  if (const auto& code = codes[CodeGroup::Distance]) incremental_ = code.tenths == 910;
  if (const auto& code = codes[CodeGroup::ArcDistance]) absolute_centre_ = code.tenths == 901;
  if (const auto& code = codes[CodeGroup::Motion]) motion_ = code.tenths;
}

void Control::append(Block block, double seconds) {
  block.line = line_;
  block.inch = unit_ != 1.0;
  block.inverse_time = inverse_time_;
  if (block.work_offset >= 0) block.work_offset = offset_;
  block.tool_length = length_number_;
  block.start_s = time_s_;
  block.end_s = time_s_ + seconds;
  if (spindle_ >= 0) {
    const double speed = spindle_turns_ * spindle_rpm_ * units::rpm;
    block.start[spindle_] = at_[spindle_];
    block.end[spindle_] = at_[spindle_] + speed * seconds;
  }
  time_s_ = block.end_s;
  at_ = block.end;
  if (block.interpolation != Interpolation::Dwell) ++path_.motion_blocks;
  path_.blocks.push_back(std::move(block));
}

void Control::dwell(const NcBlock& block, const NcWord& g4) {
  const NcWord& p = block['P'];
  if (p.value < 0 || p.value > largest_dwell_s)
    refuse(p, "0 to 1e6 seconds beside " + shown(g4.text));
  if (p.value == 0.0) return;
  Block still;
  still.interpolation = Interpolation::Dwell;
  still.coordinates = coordinates_;
  still.start = still.end = at_;
  append(std::move(still), p.value);
}

double Control::axis_value(int joint, const NcWord& word) const {
  return word.value * (is_linear(joint) ? unit_ : units::deg);
}

AxisVector Control::target(const NcBlock& block, bool machine_coordinates) const {
  AxisVector end = at_;
  const AxisVector& offset = options_.work_offset[std::size_t(offset_)];
  for (char letter = 'A'; letter <= 'Z'; ++letter) {
    const NcWord& word = block[letter];
    const int j = joint_of(letter);
    if (!word || j < 0) continue;
    const double value = axis_value(j, word);
    if (machine_coordinates) {
      end[j] = value;
    } else if (incremental_) {
      end[j] += value;
    } else {
      end[j] = value + (offset.size() > 0 ? offset[j] : 0.0) + (letter == 'Z' ? tool_length_ : 0.0);
    }
    if (!(std::abs(end[j]) <= (is_linear(j) ? largest_mm : largest_rad)))
      refuse(word, is_linear(j) ? "a position within 1e6 mm" : "a position within 1e7 rad");
  }
  return end;
}

double Control::duration(const Block& block, const NcBlock& words, const NcWord& cause) const {
  if (block.interpolation == Interpolation::Rapid) {
    const SquaredWay way = squared_way(options_.axes, block.start, block.end);
    const double mm = std::sqrt(way.xyz + way.uvw);
    return mm > 0.0 ? mm / options_.rapid_speed : std::sqrt(way.turns) / options_.rapid_turn;
  }
  if (!feed_)
    refuse(words['F'] ? words['F'] : cause,
           inverse_time_ ? "F in every block of motion under G93"
                         : "F before or in the first block of feed",
           "none");
  if (inverse_time_) return 60.0 / feed_->word;
  const Way way =
      way_of_feed(options_.axes, block.start, block.end,
                  block.interpolation == Interpolation::Arc ? &path_.arcs[block.shape] : nullptr);
  return way.length * 60.0 / (feed_->word * (way.linear ? feed_->unit : 1.0));
}

void Control::arc(const NcBlock& block, const NcWord& cause, AxisVector end) {
  const std::string_view plane = plane_ == 170 ? "XY" : plane_ == 180 ? "ZX" : "YZ";
  const int first = joint_of(plane[0]);
  const int second = joint_of(plane[1]);
  if (first < 0 || second < 0)
    refuse(cause, fmt::format("a machine with the axes {} {} of the plane", plane[0], plane[1]));
  const AxisVector& offset = options_.work_offset[std::size_t(offset_)];
  const auto zero = [&](int joint, char letter) {
    return (offset.size() > 0 ? offset[joint] : 0.0) + (letter == 'Z' ? tool_length_ : 0.0);
  };
  Arc arc = arc_of({block,
                    cause,
                    place(),
                    plane_,
                    motion_ == 20,
                    absolute_centre_,
                    unit_,
                    {at_[first], at_[second]},
                    {end[first], end[second]},
                    {zero(first, plane[0]), zero(second, plane[1])}});
  arc.first = first;
  arc.second = second;
  Block round;
  round.interpolation = Interpolation::Arc;
  round.coordinates = coordinates_;
  round.shape = std::uint32_t(path_.arcs.size());
  round.start = at_;
  round.end = std::move(end);
  path_.arcs.push_back(arc);
  const double seconds = duration(round, block, cause);
  append(std::move(round), seconds);
}

void Control::move(const NcBlock& block, const Codes& codes) {
  const Codes::Code& code = codes[CodeGroup::Motion];
  const NcWord& axis = first_axis_word(block);
  const bool is_arc = motion_ == 20 || motion_ == 30;
  const bool centre = block['I'] || block['J'] || block['K'] || block['R'];
  if (!axis && !(is_arc && centre)) return;
  const NcWord& cause = code         ? code.word
                        : axis       ? axis
                        : block['R'] ? block['R']
                        : block['I'] ? block['I']
                        : block['J'] ? block['J']
                                     : block['K'];
  const bool machine_coordinates =
      codes[CodeGroup::OneBlock] && codes[CodeGroup::OneBlock].tenths == 530;
  if (machine_coordinates) go_to(Coordinates::Axis, cause);
  AxisVector end = target(block, machine_coordinates);
  if (is_arc) {
    arc(block, cause, std::move(end));
  } else {
    Block straight;
    straight.interpolation = motion_ == 0 ? Interpolation::Rapid : Interpolation::Line;
    straight.coordinates = coordinates_;
    straight.start = at_;
    straight.end = std::move(end);
    if (machine_coordinates) straight.work_offset = -1;
    const double seconds = duration(straight, block, cause);
    if ((straight.end - straight.start).cwiseAbs().maxCoeff() > least_motion)
      append(std::move(straight), seconds);
  }
  if (machine_coordinates && tip_mode_) go_to(Coordinates::Tip, cause);
}

bool Control::execute(const NcBlock& block) {
  line_ = block.line;
  const Codes codes = codes_of(block, place());
  check_letters(block);
  check_companions(block, codes);
  set_modes(block, codes);
  notes_.note_before_motion(block, codes);
  const Codes::Code& once = codes[CodeGroup::OneBlock];
  if (once && once.tenths == 40)
    dwell(block, once.word);
  else
    move(block, codes);
  const Codes::Code& stop = codes[CodeGroup::Stop];
  notes_.note_after_motion(codes);
  return !(stop && (stop.tenths == 20 || stop.tenths == 300));
}

}  // namespace

AxisVector start_of(const NcOptions& options) {
  const Eigen::Index n = Eigen::Index(options.axes.size());
  if (options.start.size() == 0) return AxisVector::Zero(n);
  if (options.start.size() != n)
    throw std::invalid_argument("expected one start position for every axis");
  return options.start;
}

Path read_nc(std::string_view text, const std::string& file, const NcOptions& options) {
  if (text.size() > options.max_bytes)
    throw BadInput(file, 0, 0, fmt::format("at most {} bytes", options.max_bytes),
                   fmt::format("{}", text.size()));
  Control control(file, options);
  Lines lines(text);
  NcBlock block;
  int percents = 0;
  while (const auto line = lines.next()) {
    block = parse_block(*line, {file, lines.number()}, std::move(block));
    if (block.percent && ++percents == 2) break;
    if (block.deleted && options.block_delete) continue;
    if (!block.comments.empty()) control.read_comments(block);
    if (!block.percent && !block.empty() && !control.execute(block)) break;
  }
  return control.take();
}

Path read_nc_file(const std::filesystem::path& file, const NcOptions& options) {
  return read_nc(read_text(file, options.max_bytes), file.string(), options);
}

}  // namespace abbe::sim::program
