#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "sim/dialects/siemens/block.h"
#include "sim/dialects/tool_compensation.h"
#include "sim/dialects/tool_vectors.h"

/// Frames and state of a Siemens 840D.
namespace abbe::sim::dialects::siemens {

/// Addresses of axis words with their letters.
inline constexpr std::pair<Address, char> axis_addresses[] = {
    {Address::X, 'X'}, {Address::Y, 'Y'}, {Address::Z, 'Z'}, {Address::A, 'A'}, {Address::B, 'B'},
    {Address::C, 'C'}, {Address::U, 'U'}, {Address::V, 'V'}, {Address::W, 'W'}};

/// Returns the right-handed rotation about X (0), Y (1) or Z (2) by an angle in degrees. Multiples
/// of 90 deg have sines and cosines of exactly 0 and 1.
Eigen::Matrix3d rotation_about(int axis, double angle_deg);

/// A frame of X Y Z, mm: p' = rotation p + shift.
struct CoordinateFrame {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();

  bool is_identity() const { return shift.isZero(0.0) && rotation.isIdentity(0.0); }
};
/// Returns the frame that results from `second` given in the coordinates of `first`.
CoordinateFrame compose(const CoordinateFrame& first, const CoordinateFrame& second);

/// Meaning of the angles of CYCLE800.
enum class SwivelMode { AxisByAxis, SolidAngle };

/// Returns the rotation of a swivelled plane: axis by axis about the axes in `order` (0 X, 1 Y, 2
/// Z), each as rotated by the previous ones; by solid angle about Z, then about the rotated Y.
Eigen::Matrix3d swivel_rotation(SwivelMode mode, const Eigen::Vector3i& order,
                                const Eigen::Vector3d& angles_deg);

// Depths of drilling cycles.

/// Levels along a hole, mm.
struct HoleLevels {
  double retract = 0.0, reference = 0.0, start = 0.0, bottom = 0.0;
};

/// Depths of CYCLE83, mm.
struct PeckParameters {
  double first = 0.0;  ///< first depth from the reference plane, > 0, at most the total depth
  /// > 0: amount by which each peck is shorter; < 0: the negative factor of each peck; 0: none.
  double degression = 0.0;
  double min_peck = 0.0;  ///< shortest peck if degression is a factor
};

/// Returns the depths below the reference plane at the end of each peck; the last one is `total`.
/// Each peck is shorter than the previous one by the degression, but not shorter than the
/// degression. Once at most twice the degression remains, the remainder is halved. Returns an empty
/// list for more than 1e5 pecks.
std::vector<double> peck_depths(double total, const PeckParameters& parameters);

/// Returns the distance above the last depth at which a drill continues at feed after clearing its
/// chips: 0.6 mm up to a depth of 30 mm, then a fiftieth of the depth, at most 7 mm.
double peck_stop_distance(double total);

/// Returns the pitch of a metric coarse thread M3 to M48 in whole millimetres (ISO 261), mm; 0 for
/// other sizes.
double coarse_pitch(double size);

/// Result of a block.
struct BlockResult {
  bool has_moved = false;       ///< it had words of motion, so a modal call follows
  bool is_program_end = false;  ///< end of the program or subprogram
};

/// State of a Siemens control: modes, frames and tools. Executes blocks and issues their moves to
/// the canon.
class Machine {
 public:
  /// `tool_changes_by_m6`: M6 changes to the tool of T; otherwise T itself does.
  Machine(ProgramRun& run, bool tool_changes_by_m6);

  BlockResult execute(const Block& block);
  /// Makes the moves that are still postponed at the end of the program.
  void finish() { compensation_.finish(); }
  /// Executes a drilling cycle or CYCLE800. Returns false if the control has no cycle of that name.
  bool execute_cycle(const ProgramCall& call);
  static bool is_cycle(std::string_view name);

  /// Returns the position of an axis in the workpiece ($AA_IW) or as an axis ($AA_IM), in mm or
  /// inch and degrees. Returns nothing if the machine has no axis of that letter.
  std::optional<double> position(char letter, bool in_machine) const;

 private:
  using AxisVector = kinematics::AxisVector;

  // Words and modes.
  [[noreturn]] void throw_input_error(const Cause& cause, std::string expected,
                                      std::optional<std::string> seen = {}) const {
    canon_.throw_input_error(cause, std::move(expected), std::move(seen));
  }
  void check_words(const Block& block) const;
  void select_work_offset(const Code& code);
  void note_start_modes(const Block& block);
  void set_modes(const Block& block);
  void set_feed(const Block& block);
  void set_spindle(const Block& block);
  void select_master_spindle(int spindle, const Cause& cause);
  void set_speed(double speed, const Cause& cause);
  void set_numbered_spindles(const Block& block);
  void call_tools(const Block& block);
  void note_coolant(const Block& block) const;
  void dwell(const Block& block);
  double unit() const { return canon_.inch() ? mm_per_inch : 1.0; }
  int joint(int xyz) const { return canon_.joint_of("XYZ"[xyz]); }
  const Value* first_axis_word(const Block& block) const;
  Cause motion_cause(const Block& block) const;

  /// Returns the programmed position, from which compensation may offset the tool.
  AxisVector current_position() const {
    return compensation_.is_on() || compensation_.is_leaving() ? compensation_.programmed()
                                                               : canon_.position();
  }
  /// Same as `current_position` in program coordinates.
  AxisVector programmed_position() const { return canon_.without_offsets(current_position()); }
  void check_compensated_block(const Block& block) const;

  // Tools.
  void set_compensation(const Code& code);
  int tool_number(const Block& block) const;
  bool has_single_length() const;
  bool is_known_tool() const { return tool_ >= 0 || has_single_length(); }
  double active_tool_length(const Cause& cause) const;
  void apply_tool();
  /// Returns the shift, (axes), of the tool length in force in axis coordinates; empty: none.
  AxisVector active_tool_shift() const;

  // Frames.
  bool is_tip_mode() const { return is_traori_ || (swivel_ && swivel_->is_aligned); }
  void apply_frame();
  void change_transformation(const Code& code);
  void execute_frame(const Block& block);
  CoordinateFrame programmed_frame(const Block& block) const;
  void execute_cycle800(const ProgramCall& call);
  void end_swivel();
  void retract(int mode, double distance, const Cause& cause);
  void swivel_tool(const Eigen::Vector3d& direction_w, int preference, bool keeps_tip,
                   const Cause& cause);
  Eigen::Matrix3d total_rotation() const;

  void note_diameters(const Block& block);
  /// Returns the factor from an X value to a radius.
  double x_radius_factor(bool absolute) const;
  void require_radius_words(const Value& word) const;
  std::optional<double> nose_radius(int tool) const;
  AxisVector programmed_nose_offset() const;

  // Straight motion.
  bool move(const Block& block);
  Target block_target(const Block& block, bool machine) const;
  void add_axis_word(Target& target, int j, const Value& word, bool machine) const;
  void add_polar_words(Target& target, const Block& block);
  void set_pole(const Block& block);
  void check_motion(const Block& block) const;
  void make_straight(program::Straight move, bool rapid);
  void move_in_machine_coordinates(const Block& block);
  void cut_thread(const Block& block, AxisVector end);
  /// Sets the rotary axes of `end` by the vector A3 B3 C3.
  void apply_tool_vector(const Block& block, AxisVector& end) const;
  /// Makes a line along which the tool direction follows a great circle.
  void move_on_great_circle(program::Straight move);

  // Arcs.

  /// The plane of arcs.
  struct ArcPlane {
    std::string_view letters;       ///< "XY"
    std::array<Address, 3> centre;  ///< centre addresses of the first axis, the second, the normal
    int first = 0, second = 1;      ///< joints of the plane
    int normal = 2;                 ///< joint across the plane
  };
  ArcPlane arc_plane(const Cause& cause) const;
  void arc(const Block& block, const Target& target);
  void make_arc_through_point(const Block& block, const Target& target);
  void make_arc(const Block& block, program::ArcMove move);
  AxisVector arc_centre(const Block& block, const ArcPlane& plane, const Cause& cause) const;

  // Cycles.
  friend class Hole;

  static constexpr double mm_per_inch = 25.4;

  ProgramRun& run_;
  program::Canon& canon_;
  const OrientationKinematics orientation_;
  bool m6_changes_tool_;
  std::string_view motion_ = "G1";
  int plane_ = 17;
  bool is_incremental_ = false, is_feed_in_inches_ = false;
  enum class Diameters { Off, On, Absolute } diameter_mode_ = Diameters::Off;
  bool is_diameter_mode_known_ = false;
  bool has_surface_speed_ = false;
  double speed_ = 0.0;
  std::optional<double> max_rpm_;  ///< LIMS=
  struct Spindle {
    double rpm = 0.0;
    int direction = 0;
  };
  int master_spindle_ = 1;           ///< carries the tool; S and M without a number belong to it
  std::map<int, Spindle> spindles_;  ///< states of the other spindles
  int selected_ = -1, tool_ = -1;    ///< tool of the last T; tool in the spindle
  bool has_tool_length_ = true;      ///< D1
  int system_ = 0;                   ///< index of the work offset: 0 is G54; -1 is G500
  bool is_traori_ = false;           ///< TRAORI
  bool turns_in_workpiece_ = true;   ///< ORIWKS
  std::optional<bool> on_great_circle_;  ///< true: ORIVECT; false: ORIAXES; empty: not programmed
  CoordinateFrame programmable_frame_;
  AxisVector programmable_axis_shift_;  ///< (axes) of rotary and additional linear axes, rad, mm
  struct Swivel {
    CoordinateFrame frame;
    bool is_aligned = false;  ///< the rotary axes hold the tool along z of the frame
  };
  std::optional<Swivel> swivel_;
  struct Pole {
    Eigen::Vector2d position = {0, 0};
    double radius = 0.0, angle_deg = 0.0;
  } pole_;
  CutterCompensation compensation_;
};

}  // namespace abbe::sim::dialects::siemens
