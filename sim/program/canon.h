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

/// Canonical moves in the sense of NIST RS274/NGC: the interface through which the reader of every
/// dialect issues motion.
namespace abbe::sim::program {

/// The longest dwell that is accepted, s.
inline constexpr double max_dwell_s = 1e6;

/// The programmed end of a move, joint by joint. Joints that the block does not mention stay where
/// they are.
class Target {
 public:
  /// Sets an absolute value, mm or rad.
  void to(int joint, double value, const Cause& cause) { set_value(joint, value, cause, false); }
  /// Sets an increment, mm or rad.
  void by(int joint, double value, const Cause& cause) { set_value(joint, value, cause, true); }
  /// Sets an absolute value of a rotary axis whose direction of rotation is already decided, so
  /// that no roll-over rule applies.
  void rotate_to(int joint, double value, const Cause& cause) {
    to(joint, value, cause);
    decided_ |= 1u << joint;
  }
  bool has(int joint) const { return (given_ >> joint) & 1u; }
  bool empty() const { return given_ == 0; }
  bool is_decided(int joint) const { return (decided_ >> joint) & 1u; }
  bool is_step(int joint) const { return (step_ >> joint) & 1u; }
  double value(int joint) const { return value_[std::size_t(joint)]; }
  const Cause& cause(int joint) const { return cause_[std::size_t(joint)]; }
  /// Returns the joints that were programmed, one bit per joint.
  std::uint32_t given() const { return given_; }
  /// Returns the joints whose end does not depend on their start (absolute values), one bit per
  /// joint.
  std::uint32_t stated() const { return given_ & ~step_; }

 private:
  void set_value(int joint, double value, const Cause& cause, bool step);

  std::uint32_t given_ = 0, step_ = 0, decided_ = 0;  ///< one bit per joint
  std::array<double, kinematics::max_joints> value_;
  std::array<Cause, kinematics::max_joints> cause_;
};

/// Transformation from program coordinates to coordinates of the axes or the tip. X Y Z are rotated
/// first. Then every joint is shifted by `shift`, and X Y Z by the origin of `Canon::zero`. The
/// tool length is added last.
struct Frame {
  kinematics::AxisVector shift;                  ///< (axes) mm, rad; empty means zero
  std::optional<Eigen::Matrix3d> rotation = {};  ///< of X Y Z
};

/// Meaning of F: G94, G93 or G95.
enum class FeedMode { PerMinute, InverseTime, PerRevolution };

/// A programmed feed and its unit.
struct Feed {
  double word = 0.0;  ///< per minute, 1/min or per revolution, as programmed
  double unit = 1.0;  ///< mm per programmed unit of length
};

/// The smallest radius at feed under constant surface speed without any spindle speed limit.
struct UnlimitedSpeed {
  double radius = 0.0;  ///< mm, smallest distance from the spindle axis
  int line = 0, file = 0;
};

/// A straight move in the current coordinates.
struct Straight {
  kinematics::AxisVector end;   ///< (axes), offsets included
  Cause cause = {};             ///< location for error messages
  bool without_offset = false;  ///< G53: the block is recorded as independent of work offsets
  std::uint32_t stated = 0;     ///< `Target::stated`; these joints are no longer uncertain
};

/// A circular or helical move. Its plane is spanned by two joints; a positive rotation goes from
/// the first to the second.
struct ArcMove {
  int first = 0, second = 1;
  kinematics::AxisVector end;       ///< (axes), offsets included
  Eigen::Vector2d centre = {0, 0};  ///< mm, offsets included, in the plane of the joints
  /// Alternative to `centre`, as `Canon::placed` returns it: the plane is then rotated with the
  /// frame.
  kinematics::AxisVector centre_with_offsets = {};
  /// Alternative to `centre`, mm: positive for at most half a turn, negative for more. The plane is
  /// rotated with the frame.
  std::optional<double> radius = {};
  bool clockwise = false;
  int turns = 1;             ///< number of turns begun: 1 is at most one whole turn, 2 at most two
  Cause cause = {};          ///< the block
  Cause named = {};          ///< the word at which errors about the radii are reported
  std::uint32_t stated = 0;  ///< as in `Straight`
};

/// Receives canonical moves (mm, rad, s) in the order in which a control executes them and records
/// them as a `Path`: geometry, time, position limits, and the data that rewriting needs. The reader
/// of a dialect reports the line of every move (`set_line`), reads back the axis positions, and
/// keeps the modal state of its language itself.
class Canon {
 public:
  /// `options` must outlive the object. Throws std::invalid_argument if the offsets or the start do
  /// not fit the axes.
  Canon(const std::string& file, const NcOptions& options);

  const NcOptions& options() const { return options_; }

  /// Adds another file of the program, for example a subprogram, and returns its number. The first
  /// file is 0.
  int add_file(const std::string& file);
  /// Sets the location of everything that follows.
  void set_line(int line, int file = 0);
  int line() const { return line_; }
  int file() const { return file_; }
  NcLocation place() const { return {file_name(), line_}; }
  [[noreturn]] void throw_input_error(const Cause& cause, std::string expected,
                                      std::optional<std::string> seen = {}) const {
    program::throw_input_error(place(), cause, std::move(expected), std::move(seen));
  }

  /// Returns the joint that a letter addresses. Returns -1 if the machine has no such axis or the
  /// letter names a spindle.
  int joint_of(char letter) const {
    return letter >= 'A' && letter <= 'Z' ? joint_of_[std::size_t(letter - 'A')] : -1;
  }
  bool is_linear(int joint) const {
    return options_.axes[std::size_t(joint)].motion == kinematics::Motion::Linear;
  }
  /// Returns the axis letters, for example "X Y Z A C".
  std::string letters() const { return axis_letter_list(options_.axes); }

  /// Records G20 or G21 for rewriting and for comments. Numbers passed to this class are in mm
  /// under either.
  void set_inch(bool inch);
  bool inch() const { return inch_; }
  void set_feed_mode(FeedMode mode) { feed_mode_ = mode; }
  FeedMode feed_mode() const { return feed_mode_; }
  /// Sets the feed. After an empty value the next move at feed is an input error.
  void set_feed(std::optional<Feed> feed) {
    feed_ = feed;
    if (feed) feed_is_uncertain_ = false;
  }
  const std::optional<Feed>& feed() const { return feed_; }
  void set_spindle_speed(double rpm) { spindle_rpm_ = rpm; }
  double spindle_speed() const { return spindle_rpm_; }  ///< rpm
  /// Sets constant surface speed: the programmed X, taken as a radius, gives each following block
  /// one spindle speed, `mean_spindle_speed`. Requires an X axis. An empty value ends constant
  /// surface speed and keeps the last spindle speed.
  void set_surface_speed(std::optional<SurfaceSpeed> speed) { surface_speed_ = speed; }
  /// Returns the nearest approach to the spindle axis at feed while neither the program nor the
  /// machine limited the spindle speed. Returns nothing if a limit was always in force.
  const std::optional<UnlimitedSpeed>& unlimited_speed() const { return unlimited_speed_; }
  void turn_spindle(int direction) { spindle_turns_ = direction; }  ///< +1 M3, -1 M4, 0 M5
  int spindle_direction() const { return spindle_turns_; }

  /// Returns the origin to which frame shifts refer, see `program_zero`.
  const std::optional<ProgramZero>& zero() const { return zero_; }
  /// From here on, treats offsets as points in the workpiece on a machine with rotary axes, even if
  /// the scene states no offset.
  void refer_offsets_to_workpiece();
  /// Returns the correction, mm, that the origin adds to a shift of X Y Z in the current
  /// coordinates.
  Eigen::Vector3d shift_correction() const { return offset_correction(zero_, coordinates_); }
  /// `number` is recorded with each block: 0 .. 5 for G54 .. G59, more for other systems.
  void set_frame(int number, Frame frame);
  const Frame& frame() const { return frame_; }
  /// Sets the shift of the tool length, (axes) mm and rad, applied on top of the frame. Empty:
  /// none.
  void set_tool_shift(kinematics::AxisVector shift);
  const kinematics::AxisVector& tool_shift() const { return tool_shift_; }
  /// Selects the tool whose length applies (H), -1 for none. The tip mode uses the chain of this
  /// tool. Throws BadInput if the slides cannot reach the tip at the current position.
  void select_length(int number, const Cause& cause);
  /// Switches the tip mode (G43.4, TRAORI, M128), in which X Y Z are the tip in the workpiece.
  /// Throws BadInput on a machine without X Y Z or without known kinematics.
  void set_tip_mode(bool on, const Cause& cause);
  bool tip_mode() const { return tip_mode_; }
  /// From here on, makes every axis with `Rollover::ByControl` take the shorter direction if it
  /// carries the workpiece and its travel exceeds two turns.
  void enable_table_rollover();
  /// Returns the chain that the tip mode uses. Requires that the control knows its kinematics.
  const kinematics::Chain& chain() const { return *chain_; }
  /// Sets the meaning of X Y Z for the next move, for example axis positions for one block of G53
  /// under a tip mode.
  void go_to(Coordinates coordinates, const Cause& cause);
  Coordinates coordinates() const { return coordinates_; }

  /// Returns the current position, (axes) in the current coordinates, spindles included.
  const kinematics::AxisVector& position() const { return position_; }
  /// Returns the current position in program coordinates, without frame and tool length.
  kinematics::AxisVector programmed() const { return without_offsets(position_); }
  /// Converts coordinates of the axes or the tip to program coordinates.
  kinematics::AxisVector without_offsets(kinematics::AxisVector position) const;
  /// Converts program coordinates to coordinates of the axes or the tip, by frame and tool length.
  kinematics::AxisVector placed(kinematics::AxisVector programmed) const;
  /// Returns the end of a move from the current position, with frame and tool length applied. If
  /// `machine` is true, the values are axis positions. Throws BadInput at a value that leads beyond
  /// 1e6 mm or 1e7 rad.
  kinematics::AxisVector end_of(const Target& target, bool machine = false) {
    return target_position_from(position_, target, machine);
  }
  /// Returns the end of a move from `start`.
  kinematics::AxisVector target_position_from(const kinematics::AxisVector& start,
                                              const Target& target, bool machine);
  double time_s() const { return time_s_; }

  /// Adds a rapid or a straight feed.
  void straight(Straight move, bool rapid);
  void traverse(Straight move);
  /// Throws BadInput without a feed, or with a feed per revolution and a spindle at rest.
  void straight_feed(Straight move);
  /// Throws BadInput as `straight_feed` does, and for radii that differ by more than the README of
  /// this folder allows.
  void arc(ArcMove move);
  /// Throws BadInput outside 0 to 1e6 s.
  void dwell(double seconds, const Cause& cause);

  /// Records a word that causes no motion (T, M0 M1 M6 M7 M8 M9), for rewriting.
  void record_auxiliary_word(std::string text);
  /// Records T, with M6 if `changes` is true; number -1 means M6 alone, with the tool of the last
  /// T.
  void record_tool_call(double number, bool changes);
  /// Records a comment if it gives the diameter of a tool. Without a unit the diameter is in the
  /// unit of the program.
  void comment(std::string_view text);
  /// Records a cutter, mm, that a statement of the program describes.
  void cutter(std::string_view word, const CutterData& words);

  /// Records an assumption at its own line, or at the current one if it has none. A text is
  /// recorded only once.
  void assume(Assumption assumption);

  /// Marks the position of every joint as uncertain after an input error: until a joint is stated
  /// again, errors of arcs that do not close are consequences and are not reported. Feed and
  /// spindle speed are marked too, because the faulty block may have set them.
  void mark_position_uncertain() {
    uncertain_joints_ = ~std::uint32_t(0);
    feed_is_uncertain_ = spindle_is_uncertain_ = true;
  }

  /// Throws ProgramLimitExceeded if `more` further moves would exceed `NcOptions::max_moves`.
  void check_moves(double more, const Cause& cause) const;
  /// Throws ProgramLimitExceeded if `more` further moves would bring the kept moves above
  /// `NcOptions::max_move_bytes`.
  void check_memory(double more, const Cause& cause) const;
  std::size_t blocks() const { return handed_over_ + path_.blocks.size(); }
  /// Returns the number of blocks that were not handed over yet.
  std::size_t kept() const { return path_.blocks.size(); }
  /// Moves the kept blocks into a path, with their arcs and auxiliary words. Tool calls stay here;
  /// their block numbers count from the start of the whole program.
  Path take_kept_blocks();
  Path take() { return std::move(path_); }

 private:
  const std::string& file_name() const {
    return file_ == 0 ? path_.file : more_files_[std::size_t(file_ - 1)];
  }
  void add_straight(Straight move, Interpolation interpolation);
  void turn_at_surface_speed(const Block& block, bool feed);
  double apply_rollover(int joint, double from, const Target& target, double to);
  bool is_endless(int joint) const;
  void record_machine_zero_assumption(const Target& target);
  void record_known_positions(const Block& block, std::uint32_t stated);
  double duration(const Block& block, const Cause& cause) const;
  void append(Block block, double seconds);
  std::size_t kept_bytes() const;
  [[noreturn]] void throw_limit_exceeded(double moves, const Cause& cause,
                                         const std::string& expected) const;
  /// Returns the arc of a move in the current coordinates.
  Arc compute_arc(const ArcMove& move);
  /// Returns the rotation of the plane of an arc, in the order of its joints; nothing if the plane
  /// is that of the joints.
  std::optional<Eigen::Matrix3d> arc_plane_rotation(const ArcMove& move, int third) const;
  /// Returns `compute()`. If it throws, sets the axes to the programmed `end` first, so that the
  /// next move is checked independently of this one.
  template <typename Compute>
  auto with_end_on_error(const kinematics::AxisVector& end, const Compute& compute);

  const NcOptions& options_;
  Path path_;
  /// File names that error locations refer to; a deque keeps the references valid.
  std::deque<std::string> more_files_;
  std::size_t handed_over_ = 0;  ///< number of blocks
  int line_ = 0, file_ = 0;
  const std::array<int, 26> joint_of_;
  const int spindle_;
  std::array<int, 3> xyz_;           ///< joints of X Y Z; -1 for an axis that the machine lacks
  kinematics::AxisVector position_;  ///< current position in `coordinates_`, offsets included
  Coordinates coordinates_ = Coordinates::Axis;
  double time_s_ = 0.0;
  bool tip_mode_ = false;
  bool inch_ = false;
  const kinematics::Chain* chain_;  ///< chain that the tip mode uses, or null
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
  std::uint32_t uncertain_joints_ = 0;  ///< one bit per joint
  bool feed_is_uncertain_ = false, spindle_is_uncertain_ = false;
  std::array<Rollover, kinematics::max_joints> rollover_{};
  std::uint32_t rollover_reported_ = 0;  ///< one bit per joint
  std::uint32_t known_ = 0;              ///< one bit per joint: the program has stated its position
  bool has_fed_ = false;                 ///< a move at feed has been made
};

}  // namespace abbe::sim::program
