#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>

#include "kinematics/chain.h"
#include "sim/program/block_motion.h"
#include "sim/program/nc_block.h"
#include "sim/program/nc_options.h"
#include "sim/program/path.h"

/// Canonical moves, the vocabulary of NIST RS274/NGC: what every front end turns its text into.
namespace abbe::sim::program {

inline constexpr double max_dwell_s = 1e6;

/// Where a move is to end, joint by joint, as words say it. Joints without a word stay.
class Target {
 public:
  void to(int joint, double value, const Cause& cause) { put(joint, value, cause, false); }
  void by(int joint, double value, const Cause& cause) { put(joint, value, cause, true); }
  /// The same as `to` of a rotary axis whose direction is decided: no rule of roll-over applies.
  void turn_to(int joint, double value, const Cause& cause) {
    to(joint, value, cause);
    decided_ |= 1u << joint;
  }
  bool has(int joint) const { return (given_ >> joint) & 1u; }
  bool empty() const { return given_ == 0; }
  bool is_decided(int joint) const { return (decided_ >> joint) & 1u; }
  bool is_step(int joint) const { return (step_ >> joint) & 1u; }
  double value(int joint) const { return value_[std::size_t(joint)]; }
  const Cause& cause(int joint) const { return cause_[std::size_t(joint)]; }
  /// Joints that have a word, bits by joint.
  std::uint32_t given() const { return given_; }
  /// Joints whose end does not depend on where they stood, bits by joint.
  std::uint32_t stated() const { return given_ & ~step_; }

 private:
  void put(int joint, double value, const Cause& cause, bool step);

  std::uint32_t given_ = 0, step_ = 0, decided_ = 0;  ///< bits by joint
  std::array<double, kinematics::max_joints> value_;
  std::array<Cause, kinematics::max_joints> cause_;
};

/// From program coordinates to those of the axes or the tip: turned, then shifted from where
/// `Canon::zero` says, then longer by the tool. X Y Z are turned; every joint is shifted.
struct Frame {
  kinematics::AxisVector shift;                  ///< (axes) mm, rad; empty means zero
  std::optional<Eigen::Matrix3d> rotation = {};  ///< of X Y Z
};

enum class FeedMode { PerMinute, InverseTime, PerRevolution };

/// An F word and what it counts.
struct Feed {
  double word = 0.0;  ///< per minute, 1/min or per turn, as programmed
  double unit = 1.0;  ///< mm per unit of length in it
};

/// The highest spindle speed that constant surface speed led to at feed without any limit.
struct UnlimitedSpeed {
  double radius = 0.0;  ///< mm, from the axis: the least
  int line = 0, file = 0;
};

/// A straight move in the coordinates that are in force.
struct Straight {
  kinematics::AxisVector end;   ///< (axes), offsets already in
  Cause cause = {};             ///< where a refusal points
  bool without_offset = false;  ///< of G53: recorded as a block that no work offset moves
  std::uint32_t stated = 0;     ///< `Target::stated`: ends the doubt about those joints
};

/// A circular or helical move, its plane two joints that make a positive turn from the first to
/// the second.
struct ArcMove {
  int first = 0, second = 1;
  kinematics::AxisVector end;       ///< (axes), offsets already in
  Eigen::Vector2d centre = {0, 0};  ///< mm, offsets already in, in the plane of the joints
  /// Instead, as `Canon::placed` gives it: the plane is then turned as the frame turns.
  kinematics::AxisVector placed_centre = {};
  /// Instead, mm: above zero at most half a turn, below zero more; the plane is turned likewise.
  std::optional<double> radius = {};
  bool clockwise = false;
  int turns = 1;             ///< begun: 1 is at most a whole turn, 2 one more
  Cause cause = {};          ///< of the block
  Cause named = {};          ///< where a refusal of the radii points
  std::uint32_t stated = 0;  ///< as that of a straight move
};

/// Takes canonical moves as a control executes them, numbers in mm, rad and seconds, and writes
/// them down as a `Path`: geometry, time, the limits of positions, the record that rewriting needs.
/// A front end says where each stands (`set_line`) and reads back where the axes are; it keeps
/// modes of its own language itself.
class Canon {
 public:
  /// @param options  outlive it
  /// @throws std::invalid_argument if offsets or start do not fit the axes
  Canon(const std::string& file, const NcOptions& options);

  const NcOptions& options() const { return options_; }

  /// Another file of the program, as of a subprogram. @return its number; the first file is 0
  int add_file(const std::string& file);
  /// What follows stands there.
  void set_line(int line, int file = 0);
  int line() const { return line_; }
  int file() const { return file_; }
  NcLocation place() const { return {file_name(), line_}; }
  [[noreturn]] void refuse(const Cause& cause, std::string expected,
                           std::optional<std::string> seen = {}) const {
    program::refuse(place(), cause, std::move(expected), std::move(seen));
  }

  /// -1 where the machine has no such axis, or a spindle of that name
  int joint_of(char letter) const {
    return letter >= 'A' && letter <= 'Z' ? joint_of_[std::size_t(letter - 'A')] : -1;
  }
  bool is_linear(int joint) const {
    return options_.axes[std::size_t(joint)].motion == kinematics::Motion::Linear;
  }
  /// "X Y Z A C"
  std::string letters() const { return axis_letter_list(options_.axes); }

  /// G20 or G21: for the record and for comments; numbers given here are mm all the same.
  void set_inch(bool inch);
  bool inch() const { return inch_; }
  void set_feed_mode(FeedMode mode) { feed_mode_ = mode; }
  FeedMode feed_mode() const { return feed_mode_; }
  /// None: a feed move without one is refused.
  void set_feed(std::optional<Feed> feed) {
    feed_ = feed;
    if (feed) feed_is_uncertain_ = false;
  }
  const std::optional<Feed>& feed() const { return feed_; }
  void set_spindle_speed(double rpm) { spindle_rpm_ = rpm; }
  double spindle_speed() const { return spindle_rpm_; }  ///< rpm
  /// The blocks that follow set the speed of the spindle by the X of the program, which is a radius
  /// here; none: it is as it was set. There is an X. Each block runs at one speed, that of
  /// `mean_spindle_speed`.
  void set_surface_speed(std::optional<SurfaceSpeed> speed) { surface_speed_ = speed; }
  /// Where a move at feed came nearest to the axis while neither the program nor the machine
  /// limited the spindle; none where they always did.
  const std::optional<UnlimitedSpeed>& unlimited_speed() const { return unlimited_speed_; }
  void turn_spindle(int direction) { spindle_turns_ = direction; }  ///< +1 M3, -1 M4, 0 M5
  int spindle_direction() const { return spindle_turns_; }

  /// What shifts of frames count from: the rule of `program_zero`.
  const std::optional<ProgramZero>& zero() const { return zero_; }
  /// From here on as places, even if the scene states no offset, on a machine with rotary axes.
  void count_from_workpiece();
  /// What zero adds to a shift of X Y Z in the coordinates in force, mm.
  Eigen::Vector3d shift_correction() const { return offset_correction(zero_, coordinates_); }
  /// @param number  for the record: 0 .. 5, G54 .. G59; more for others
  void set_frame(int number, Frame frame);
  const Frame& frame() const { return frame_; }
  /// Shift of a tool's length, (axes) mm and rad, on top of the frame; empty for none.
  void set_tool_shift(kinematics::AxisVector shift);
  const kinematics::AxisVector& tool_shift() const { return tool_shift_; }
  /// The tool whose length counts (H), -1 for none; its chain is the one that the tip mode uses.
  /// @throws BadInput if the slides do not reach the tip where they stand
  void select_length(int number, const Cause& cause);
  /// X Y Z are the tip in the workpiece from here (G43.4, TRAORI, M128), or axes again.
  /// @throws BadInput on a machine without X Y Z or without known kinematics
  void set_tip_mode(bool on, const Cause& cause);
  bool tip_mode() const { return tip_mode_; }
  /// From here on an axis whose machine leaves its roll-over to the control (`Rollover::ByControl`)
  /// goes the short way, if it carries the workpiece and turns by more than two turns.
  void enable_table_rollover();
  /// That the tip mode counts with; there must be one.
  const kinematics::Chain& chain() const { return *chain_; }
  /// What X Y Z mean for the next move: axes for one block beside a tip mode, as G53 does.
  void go_to(Coordinates coordinates, const Cause& cause);
  Coordinates coordinates() const { return coordinates_; }

  /// Where the axes stand, (axes) in the coordinates in force; spindles included.
  const kinematics::AxisVector& position() const { return at_; }
  /// The same in program coordinates: frame and tool taken off.
  kinematics::AxisVector programmed() const { return unplaced(at_); }
  kinematics::AxisVector unplaced(kinematics::AxisVector position) const;
  /// Program coordinates to those of the axes or the tip.
  kinematics::AxisVector placed(kinematics::AxisVector programmed) const;
  /// Where the words lead: through the frame and the tool.
  /// @param machine  the words are positions of the axes themselves
  /// @throws BadInput at a word that leads beyond 1e6 mm or 1e7 rad
  kinematics::AxisVector end_of(const Target& target, bool machine = false) {
    return end_from(at_, target, machine);
  }
  /// The same from elsewhere than where the axes stand.
  kinematics::AxisVector end_from(const kinematics::AxisVector& start, const Target& target,
                                  bool machine);
  double time_s() const { return time_s_; }

  /// A traverse or a straight feed.
  void straight(Straight move, bool rapid);
  void traverse(Straight move);
  /// @throws BadInput without a feed, or per turn of a spindle that stands
  void straight_feed(Straight move);
  /// @throws BadInput the same; and for radii that differ as the README of this folder says
  void arc(ArcMove move);
  /// @throws BadInput beyond 0 to 1e6 s
  void dwell(double seconds, const Cause& cause);

  /// Words that move nothing, kept for rewriting: T, M0 M1 M6 M7 M8 M9.
  void aside(std::string text);
  /// A T word with or without M6, or M6 alone (number -1: that of the last T word).
  void call_tool(double number, bool changes);
  /// A comment; if it gives the diameter of a tool it is noted, what it leaves unsaid of its unit
  /// is that of the program.
  void comment(std::string_view text);
  /// A cutter that a word of the program describes, in mm.
  void cutter(std::string_view word, const CutterData& words);

  /// Records an assumption, once for each text, at the line where reading stands unless it says
  /// another.
  void assume(Assumption assumption);

  /// A fault in what comes from outside kept the axes from where they should be: until each is
  /// stated again, arcs that do not close only follow from it.
  /// A feed or spindle that is missing may be what that input error kept away.
  void mark_position_uncertain() {
    uncertain_joints_ = ~std::uint32_t(0);
    feed_is_uncertain_ = spindle_is_uncertain_ = true;
  }

  /// @throws Exhausted where so many more moves go beyond `NcOptions::max_moves`
  void check_moves(double more, const Cause& cause) const;
  /// @throws Exhausted where they would take more than `NcOptions::max_move_bytes`, being kept
  void check_memory(double more, const Cause& cause) const;
  std::size_t blocks() const { return handed_over_ + path_.blocks.size(); }
  /// Blocks that are kept here.
  std::size_t kept() const { return path_.blocks.size(); }
  /// Those blocks as a path of their own, with their arcs and the words that move nothing; they are
  /// kept here no longer. Calls of tools stay, with the numbers of their blocks in the whole.
  Path hand_over();
  Path take() { return std::move(path_); }

 private:
  const std::string& file_name() const {
    return file_ == 0 ? path_.file : more_files_[std::size_t(file_ - 1)];
  }
  void go(Straight move, Interpolation interpolation);
  void turn_at_surface_speed(const Block& block, bool feed);
  double apply_rollover(int joint, double from, const Target& target, double to);
  bool is_endless(int joint) const;
  void note_machine_zero(const Target& target);
  void note_positions(const Block& block, std::uint32_t stated);
  double duration(const Block& block, const Cause& cause) const;
  void append(Block block, double seconds);
  std::size_t kept_bytes() const;
  [[noreturn]] void refuse_more(double moves, const Cause& cause,
                                const std::string& expected) const;
  /// A move that cannot be made leaves the axes where it would have ended, so that the next one is
  /// judged by itself.
  Arc arc_of(const ArcMove& move);
  /// How the plane of an arc is turned, in the order of its joints; none where it is theirs.
  std::optional<Eigen::Matrix3d> turn_of(const ArcMove& move, int third) const;
  template <typename Make>
  auto made(const kinematics::AxisVector& end, const Make& make);

  const NcOptions& options_;
  Path path_;
  std::deque<std::string> more_files_;  ///< those of the path, for places: they stay where they are
  std::size_t handed_over_ = 0;         ///< blocks
  int line_ = 0, file_ = 0;
  const std::array<int, 26> joint_of_;
  const int spindle_;
  std::array<int, 3> xyz_;     ///< joints; -1 where the machine lacks one
  kinematics::AxisVector at_;  ///< where the axes are, in `coordinates_`, offsets in
  Coordinates coordinates_ = Coordinates::Axis;
  double time_s_ = 0.0;
  bool tip_mode_ = false;
  bool inch_ = false;
  const kinematics::Chain* chain_;  ///< that the tip mode counts with; null if there is none
  int length_number_ = -1;
  int offset_number_ = 0;
  std::optional<ProgramZero> zero_;
  Frame frame_;
  kinematics::AxisVector tool_shift_;
  FeedMode feed_mode_ = FeedMode::PerMinute;
  std::optional<Feed> feed_;
  double spindle_rpm_ = 0.0;
  std::optional<SurfaceSpeed> surface_speed_;
  std::optional<UnlimitedSpeed> unlimited_speed_;
  int spindle_turns_ = 0;
  int tool_ = -1;                       ///< of the last T word
  std::uint32_t uncertain_joints_ = 0;  ///< bits by joint
  bool feed_is_uncertain_ = false, spindle_is_uncertain_ = false;
  std::array<Rollover, kinematics::max_joints> rollover_{};
  std::uint32_t rollover_noted_ = 0;  ///< bits by joint
  std::uint32_t known_ = 0;           ///< bits by joint: the program has said where it stands
  bool fed_ = false;                  ///< there was a move at feed
};

}  // namespace abbe::sim::program
