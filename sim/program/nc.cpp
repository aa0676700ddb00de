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
#include "sim/program/nc_block.h"

namespace abbe::sim::program {
namespace {

using kinematics::AxisVector;
using kinematics::Motion;

constexpr double mm_per_inch = 25.4;
constexpr double largest_mm = 1e6;
constexpr double largest_rad = 1e7;
constexpr double largest_dwell_s = 1e6;
constexpr double smallest_feed = 1e-9;  // per minute; keeps every duration finite
constexpr double arc_absolute = 0.5;    // mm, see README: when an arc's two radii differ too much
constexpr double arc_free = 0.005;      // mm
constexpr double arc_relative = 1e-3;
constexpr double least_motion =
    1e-11;                           // mm or rad, less is the rounding of a change of coordinates
constexpr double same_point = 1e-8;  // mm, an arc that ends this near to its start has no R

enum class Group {
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

/// Tenths of the number, so that G43.4 is 434.
std::optional<Group> g_group(int code) {
  switch (code) {
    case 40:
    case 530:
      return Group::OneBlock;
    case 901:
    case 911:
      return Group::ArcDistance;
    case 400:
      return Group::CutterRadius;
    case 900:
    case 910:
      return Group::Distance;
    case 930:
    case 940:
      return Group::FeedMode;
    case 0:
    case 10:
    case 20:
    case 30:
    case 800:
      return Group::Motion;
    case 170:
    case 180:
    case 190:
      return Group::Plane;
    case 430:
    case 434:
    case 490:
      return Group::ToolLength;
    case 200:
    case 210:
      return Group::Units;
    case 540:
    case 550:
    case 560:
    case 570:
    case 580:
    case 590:
      return Group::WorkOffset;
    default:
      return std::nullopt;
  }
}

std::optional<Group> m_group(int code) {
  switch (code) {
    case 0:
    case 10:
    case 20:
    case 300:
      return Group::Stop;
    case 30:
    case 40:
    case 50:
      return Group::Spindle;
    case 60:
      return Group::ToolChange;
    case 70:
    case 80:
    case 90:
      return Group::Coolant;
    default:
      return std::nullopt;
  }
}

constexpr std::string_view g_codes =
    "a G code of this control (G0 G1 G2 G3 G4 G17 G18 G19 G20 G21 G40 G43 G43.4 G49 G53 G54 ... "
    "G59 "
    "G80 G90 G90.1 G91 G91.1 G93 G94)";
constexpr std::string_view m_codes =
    "an M code of this control (M0 M1 M2 M3 M4 M5 M6 M7 M8 M9 M30)";

/// The codes of a block by modal group.
struct Codes {
  struct Code {
    int tenths = -1;
    NcWord word;
    explicit operator bool() const { return tenths >= 0; }
  };
  std::array<Code, std::size_t(Group::Count)> by_group;
  const Code& operator[](Group group) const { return by_group[std::size_t(group)]; }
};

/// Squares of a way.
struct Squares {
  double xyz = 0.0, uvw = 0.0, turns = 0.0;  // mm^2, rad^2
};

Squares squares(const std::vector<ControlledAxis>& axes, const AxisVector& start,
                const AxisVector& end) {
  Squares squares;
  const int spindle = spindle_of(axes);
  for (int j = 0; j < int(axes.size()); ++j) {
    const ControlledAxis& axis = axes[std::size_t(j)];
    if (axis.motion == Motion::Spindle || j == spindle) continue;
    const double way = end[j] - start[j];
    double& sum = axis.motion != Motion::Linear ? squares.turns
                  : axis.name >= 'X'            ? squares.xyz
                                                : squares.uvw;
    sum += way * way;
  }
  return squares;
}

/// The control while it reads: its modes, and where the axes stand.
class Control {
 public:
  Control(const std::string& file, const NcOptions& options);

  /// @return false at the end of the program
  bool execute(const NcBlock& block);
  Path take() { return std::move(path_); }

 private:
  struct Feed {
    double word = 0.0;  ///< as programmed
    double unit = 1.0;  ///< mm per unit of length in it
  };

  [[noreturn]] void refuse(const NcWord& word, std::string expected) const {
    refuse(word, std::move(expected), shown(word.text));
  }
  [[noreturn]] void refuse(const NcWord& word, std::string expected, std::string seen) const {
    throw BadInput(path_.file, line_, word.column, std::move(expected), std::move(seen));
  }

  Codes codes(const NcBlock& block) const;
  void put_code(Codes& codes, const NcWord& word, std::optional<Group> group,
                std::string_view expected) const;
  void check_letters(const NcBlock& block) const;
  void check_companions(const NcBlock& block, const Codes& codes) const;
  void set_modes(const NcBlock& block, const Codes& codes);
  void set_spindle(const NcBlock& block, const Codes& codes);
  void set_feed(const NcBlock& block, const Codes& codes);
  void set_tool_length(const NcBlock& block, const Codes& codes);
  void note_tool_and_coolant(const NcBlock& block, const Codes& codes);
  void note_stop(const Codes& codes);
  void dwell(const NcBlock& block, const NcWord& g4);
  void move(const NcBlock& block, const Codes& codes);
  AxisVector target(const NcBlock& block, bool machine_coordinates) const;
  double axis_value(int joint, const NcWord& word) const;
  void arc(const NcBlock& block, const NcWord& cause, AxisVector end);
  Eigen::Vector2d centre_from_offsets(const NcBlock& block, const NcWord& cause,
                                      const Eigen::Vector2d& start) const;
  Eigen::Vector2d centre_from_radius(const NcWord& radius, const Eigen::Vector2d& start,
                                     const Eigen::Vector2d& end) const;
  double duration(const Block& block, const NcBlock& words, const NcWord& cause) const;
  void append(Block block, double seconds);
  void go_to(Coordinates coordinates, const NcWord& cause);

  const NcWord& first_axis_word(const NcBlock& block) const;
  bool is_controlled(int joint) const {
    return options_.axes[std::size_t(joint)].motion != Motion::Spindle && joint != spindle_;
  }
  bool is_linear(int joint) const {
    return options_.axes[std::size_t(joint)].motion == Motion::Linear;
  }
  std::string axis_names() const;

  const NcOptions& options_;
  Path path_;
  int line_ = 0;
  std::array<int, 26> joint_of_{};  ///< by letter, -1 where the machine has no such axis
  int spindle_ = -1;                ///< the joint that S and M3 turn

  AxisVector at_;  ///< where the axes are, in `coordinates_`, offsets in
  Coordinates coordinates_ = Coordinates::Axis;
  double time_s_ = 0.0;

  int motion_ = -1;  ///< tenths of the G code; -1 none
  int plane_ = 170;
  bool incremental_ = false;
  bool absolute_centre_ = false;
  bool inverse_time_ = false;
  bool tip_mode_ = false;
  double unit_ = 1.0;         ///< mm per unit of length
  double tool_length_ = 0.0;  ///< mm added to Z under G43
  int offset_ = 0;            ///< 0 .. 5, G54 .. G59
  std::optional<Feed> feed_;
  int tool_ = -1;  ///< of the last T word
  double spindle_rpm_ = 0.0;
  int spindle_turns_ = 0;  ///< +1 M3, -1 M4, 0 M5
};

Control::Control(const std::string& file, const NcOptions& options) : options_(options) {
  path_.file = file;
  const int n = int(options.axes.size());
  at_ = start_of(options);
  for (const AxisVector& offset : options.work_offset)
    if (offset.size() != 0 && offset.size() != n)
      throw std::invalid_argument("expected one work offset for every axis");
  joint_of_.fill(-1);
  spindle_ = spindle_of(options.axes);
  for (int j = 0; j < n; ++j) {
    const char name = options.axes[std::size_t(j)].name;
    if (is_controlled(j) && name >= 'A' && name <= 'Z') joint_of_[std::size_t(name - 'A')] = j;
  }
}

std::string Control::axis_names() const {
  std::string names;
  for (std::size_t j = 0; j < options_.axes.size(); ++j)
    if (is_controlled(int(j))) names += fmt::format("{} ", options_.axes[j].name);
  if (!names.empty()) names.pop_back();
  return names;
}

void Control::put_code(Codes& codes, const NcWord& word, std::optional<Group> group,
                       std::string_view expected) const {
  if (!group) refuse(word, std::string(expected));
  Codes::Code& place = codes.by_group[std::size_t(*group)];
  if (place)
    refuse(word, fmt::format("one code in a block {}", group_names[std::size_t(*group)]),
           fmt::format("{} after {}", shown(word.text), shown(place.word.text)));
  place = {int(std::lround(word.value * 10)), word};
}

Codes Control::codes(const NcBlock& block) const {
  Codes codes;
  const auto tenths = [](const NcWord& word) {
    const double t = word.value * 10;
    const bool is_code = t >= 0 && t < 2000 && std::abs(t - std::round(t)) < 1e-9;
    return is_code ? int(std::lround(t)) : -1;
  };
  for (const NcWord& word : block.g) put_code(codes, word, g_group(tenths(word)), g_codes);
  for (const NcWord& word : block.m) put_code(codes, word, m_group(tenths(word)), m_codes);
  return codes;
}

void Control::check_letters(const NcBlock& block) const {
  static constexpr std::string_view others = "NFSTPHIJKR", axes = "XYZABCUVW";
  for (char letter = 'A'; letter <= 'Z'; ++letter) {
    const NcWord& word = block[letter];
    if (!word || others.find(letter) != std::string_view::npos) continue;
    if (joint_of_[std::size_t(letter - 'A')] >= 0) continue;
    if (axes.find(letter) != std::string_view::npos)
      refuse(word, "an axis of this machine (" + axis_names() + ")");
    refuse(word, "a word of this control (N G " + axis_names() + " I J K R F S T M H P)");
  }
}

const NcWord& Control::first_axis_word(const NcBlock& block) const {
  static const NcWord none;
  const NcWord* first = &none;
  for (char letter = 'A'; letter <= 'Z'; ++letter) {
    const NcWord& word = block[letter];
    if (word && joint_of_[std::size_t(letter - 'A')] >= 0 &&
        (!*first || word.column < first->column))
      first = &word;
  }
  return *first;
}

/// Words that make sense only beside others.
void Control::check_companions(const NcBlock& block, const Codes& codes) const {
  const Codes::Code& once = codes[Group::OneBlock];
  const NcWord& axis = first_axis_word(block);
  const int motion = codes[Group::Motion] ? codes[Group::Motion].tenths : motion_;
  const bool is_dwell = once && once.tenths == 40;
  const bool is_arc = !is_dwell && (motion == 20 || motion == 30);
  if (is_dwell && axis) refuse(axis, "no axis word beside G4");
  if (is_dwell && !block['P']) refuse(once.word, "P (seconds) beside G4", "none");
  if (block['P'] && !is_dwell) refuse(block['P'], "G4 beside P");
  for (const char letter : {'I', 'J', 'K', 'R'})
    if (block[letter] && !is_arc) refuse(block[letter], "G2 or G3 beside I J K R");
  const Codes::Code& length = codes[Group::ToolLength];
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
  if (const Codes::Code& code = codes[Group::Spindle])
    spindle_turns_ = code.tenths == 30 ? 1 : code.tenths == 40 ? -1 : 0;
}

void Control::set_feed(const NcBlock& block, const Codes& codes) {
  if (const Codes::Code& code = codes[Group::FeedMode]) {
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
  const int x = joint_of_['X' - 'A'], y = joint_of_['Y' - 'A'], z = joint_of_['Z' - 'A'];
  if (coordinates == Coordinates::Tip) {
    const Eigen::Vector3d tip_w = options_.control->tool_in_workpiece(at_).translation();
    at_[x] = tip_w.x();
    at_[y] = tip_w.y();
    at_[z] = tip_w.z();
  } else {
    const auto q = slides_for_tip(*options_.control, at_, {at_[x], at_[y], at_[z]});
    if (!q) refuse(cause, "slides that reach the tip", "a tip out of their reach");
    at_ = *q;
  }
}

void Control::set_tool_length(const NcBlock& block, const Codes& codes) {
  const Codes::Code& code = codes[Group::ToolLength];
  if (!code) return;
  tip_mode_ = code.tenths == 434;
  tool_length_ = 0.0;
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
    if (code.tenths == 430) {
      if (joint_of_['Z' - 'A'] < 0) refuse(code.word, "a machine with a Z axis");
      tool_length_ = length->second;
    }
  }
  if (tip_mode_) {
    for (const char letter : {'X', 'Y', 'Z'})
      if (joint_of_[std::size_t(letter - 'A')] < 0)
        refuse(code.word, "a machine with the axes X Y Z beside G43.4", "one with " + axis_names());
    if (!options_.control) refuse(code.word, "a control that knows its kinematics beside G43.4");
  }
  go_to(tip_mode_ ? Coordinates::Tip : Coordinates::Axis, code.word);
}

void Control::set_modes(const NcBlock& block, const Codes& codes) {
  if (const auto& code = codes[Group::Units]) unit_ = code.tenths == 200 ? mm_per_inch : 1.0;
  set_feed(block, codes);
  set_spindle(block, codes);
  if (const auto& code = codes[Group::Plane]) plane_ = code.tenths;
  set_tool_length(block, codes);
  if (const auto& code = codes[Group::WorkOffset]) offset_ = (code.tenths - 540) / 10;
  if (const auto& code = codes[Group::Distance]) incremental_ = code.tenths == 910;
  if (const auto& code = codes[Group::ArcDistance]) absolute_centre_ = code.tenths == 901;
  if (const auto& code = codes[Group::Motion]) motion_ = code.tenths;
}

void Control::note_tool_and_coolant(const NcBlock& block, const Codes& codes) {
  if (block['T']) tool_ = int(std::min(block['T'].value, 1e9));
  const bool changes = bool(codes[Group::ToolChange]);
  if (block['T'] || changes)
    path_.tool_calls.push_back({line_, tool_, changes, path_.blocks.size()});
  std::string text = block['T'] ? fmt::format("T{:.0f}", block['T'].value) : "";
  for (const Group group : {Group::ToolChange, Group::Coolant})
    if (const Codes::Code& code = codes[group]; code && code.tenths != 90)
      text += fmt::format("{}M{}", text.empty() ? "" : " ", code.tenths / 10);
  if (!text.empty()) path_.asides.push_back({path_.blocks.size(), std::move(text)});
}

/// What a control does after the motion of the block.
void Control::note_stop(const Codes& codes) {
  const Codes::Code &stop = codes[Group::Stop], &coolant = codes[Group::Coolant];
  if (coolant && coolant.tenths == 90) path_.asides.push_back({path_.blocks.size(), "M9"});
  if (stop && stop.tenths <= 10)
    path_.asides.push_back({path_.blocks.size(), fmt::format("M{}", stop.tenths / 10)});
}

void Control::append(Block block, double seconds) {
  block.line = line_;
  block.inch = unit_ != 1.0;
  block.inverse_time = inverse_time_;
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
    const int j = joint_of_[std::size_t(letter - 'A')];
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
    const Squares way = squares(options_.axes, block.start, block.end);
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

Eigen::Vector2d Control::centre_from_offsets(const NcBlock& block, const NcWord& cause,
                                             const Eigen::Vector2d& start) const {
  const std::string_view letters = plane_ == 170 ? "IJK" : plane_ == 180 ? "KIJ" : "JKI";
  const std::string pair = plane_ == 170 ? "I J" : plane_ == 180 ? "I K" : "J K";
  const NcWord& first = block[letters[0]];
  const NcWord& second = block[letters[1]];
  if (const NcWord& outside = block[letters[2]])
    refuse(outside, fmt::format("{} in the plane of G{}", pair, plane_ / 10));
  if (!first && !second)
    refuse(cause, fmt::format("{} or R beside {}", pair, motion_ == 20 ? "G2" : "G3"), "none");
  const Eigen::Vector2d words(first.value * unit_, second.value * unit_);
  if (!absolute_centre_) return start + words;
  if (!first || !second) refuse(cause, "both " + pair + " under G90.1", "one");
  const AxisVector& offset = options_.work_offset[std::size_t(offset_)];
  const auto added = [&](char letter) {
    const int j = joint_of_[std::size_t(letter - 'A')];
    return (offset.size() > 0 ? offset[j] : 0.0) + (letter == 'Z' ? tool_length_ : 0.0);
  };
  const auto axis = [](char centre_letter) { return char('X' + (centre_letter - 'I')); };
  return words + Eigen::Vector2d(added(axis(letters[0])), added(axis(letters[1])));
}

/// R > 0 is the arc of at most half a turn, R < 0 the other.
Eigen::Vector2d Control::centre_from_radius(const NcWord& radius, const Eigen::Vector2d& start,
                                            const Eigen::Vector2d& end) const {
  const double r = radius.value * unit_;
  const Eigen::Vector2d chord = end - start;
  if (chord.norm() < same_point) refuse(radius, "an end that is not the start beside R");
  if (std::abs(r) < same_point) refuse(radius, "a radius that is not zero");
  if (chord.norm() > 2 * std::abs(r) + arc_free)
    refuse(radius, fmt::format("a radius of at least half the chord of {} mm", chord.norm()));
  const double height = std::sqrt(std::max(0.0, r * r - 0.25 * chord.squaredNorm()));
  const Eigen::Vector2d left = Eigen::Vector2d(-chord.y(), chord.x()).normalized();
  const bool centre_is_left = (motion_ == 30) == (r > 0);
  return start + 0.5 * chord + (centre_is_left ? height : -height) * left;
}

void Control::arc(const NcBlock& block, const NcWord& cause, AxisVector end) {
  const std::string_view plane = plane_ == 170 ? "XY" : plane_ == 180 ? "ZX" : "YZ";
  const int first = joint_of_[std::size_t(plane[0] - 'A')];
  const int second = joint_of_[std::size_t(plane[1] - 'A')];
  if (first < 0 || second < 0)
    refuse(cause, fmt::format("a machine with the axes {} {} of the plane", plane[0], plane[1]));
  const Eigen::Vector2d start(at_[first], at_[second]), stop(end[first], end[second]);
  const NcWord& by_radius = block['R'];
  if (by_radius)
    for (const char letter : {'I', 'J', 'K'})
      if (block[letter]) refuse(block[letter], "either R or I J K");
  const Eigen::Vector2d centre = by_radius ? centre_from_radius(by_radius, start, stop)
                                           : centre_from_offsets(block, cause, start);
  Arc arc = arc_through({start, stop, centre, motion_ == 20});
  arc.first = first;
  arc.second = second;
  const double end_radius = (stop - centre).norm();
  const NcWord& named = by_radius ? by_radius : cause;
  if (std::min(arc.radius, end_radius) < same_point)
    refuse(named, "a radius that is not zero", "a centre at an end of the arc");
  if (arc.radius > largest_mm) refuse(named, "a radius of at most 1e6 mm");
  const double off = std::abs(arc.growth);
  if (off > arc_absolute || (off > arc_free && off > arc_relative * arc.radius))
    refuse(named, "one radius at both ends of the arc",
           fmt::format("{} mm at the start and {} mm at the end", arc.radius, end_radius));

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
  const Codes::Code& code = codes[Group::Motion];
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
  const bool machine_coordinates = codes[Group::OneBlock] && codes[Group::OneBlock].tenths == 530;
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
    const double seconds = duration(straight, block, cause);
    if ((straight.end - straight.start).cwiseAbs().maxCoeff() > least_motion)
      append(std::move(straight), seconds);
  }
  if (machine_coordinates && tip_mode_) go_to(Coordinates::Tip, cause);
}

bool Control::execute(const NcBlock& block) {
  line_ = block.line;
  const Codes codes = this->codes(block);
  check_letters(block);
  check_companions(block, codes);
  set_modes(block, codes);
  note_tool_and_coolant(block, codes);
  const Codes::Code& once = codes[Group::OneBlock];
  if (once && once.tenths == 40)
    dwell(block, once.word);
  else
    move(block, codes);
  const Codes::Code& stop = codes[Group::Stop];
  note_stop(codes);
  return !(stop && (stop.tenths == 20 || stop.tenths == 300));
}

}  // namespace

Way way_of_feed(const std::vector<ControlledAxis>& axes, const AxisVector& start,
                const AxisVector& end, const Arc* arc) {
  Squares squared = squares(axes, start, end);
  if (arc != nullptr) {
    const double chord =
        (end[arc->first] - start[arc->first]) * (end[arc->first] - start[arc->first]) +
        (end[arc->second] - start[arc->second]) * (end[arc->second] - start[arc->second]);
    const double round = (arc->radius + 0.5 * arc->growth) * arc->sweep;
    squared.xyz = squared.xyz - chord + round * round;
  }
  const double mm = std::sqrt(squared.xyz > 0.0 ? squared.xyz : squared.uvw);
  if (mm > 0.0) return {mm, true};
  return {std::sqrt(squared.turns) / units::deg, false};
}

AxisVector start_of(const NcOptions& options) {
  const Eigen::Index n = Eigen::Index(options.axes.size());
  if (options.start.size() == 0) return AxisVector::Zero(n);
  if (options.start.size() != n)
    throw std::invalid_argument("expected one start position for every axis");
  return options.start;
}

int spindle_of(const std::vector<ControlledAxis>& axes) {
  int nose = -1;
  for (std::size_t j = 0; j < axes.size(); ++j) {
    if (axes[j].name == 'S' && axes[j].motion == Motion::Rotary) return int(j);
    if (axes[j].motion == Motion::Spindle && nose < 0) nose = int(j);
  }
  return nose;
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
    if (!block.percent && !block.empty() && !control.execute(block)) break;
  }
  return control.take();
}

Path read_nc_file(const std::filesystem::path& file, const NcOptions& options) {
  return read_nc(read_text(file, options.max_bytes), file.string(), options);
}

}  // namespace abbe::sim::program
