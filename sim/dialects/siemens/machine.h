#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "sim/dialects/siemens/block.h"
#include "sim/dialects/tool_compensation.h"
#include "sim/dialects/tool_vectors.h"

/// Frames and state of a Siemens 840D.
namespace abbe::sim::dialects::siemens {

/// Returns the right-handed rotation about X (0), Y (1) or Z (2) by an angle in degrees. Multiples
/// of 90 deg have sines and cosines of exactly 0 and 1.
Eigen::Matrix3d rotation_about(int axis, double angle_deg);

/// A frame: p' = rotation p + shift, of X Y Z in mm.
struct Placement {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();

  bool is_none() const { return shift.isZero(0.0) && rotation.isIdentity(0.0); }
};
/// Returns `second` as a frame in the coordinates of `first`.
Placement behind(const Placement& first, const Placement& second);

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
  double first = 0.0;  ///< from the reference plane, > 0, at most the total depth
  /// Amount by which each peck is shorter, > 0; below zero the factor of each peck; 0: none.
  double degression = 0.0;
  double least = 0.0;  ///< shortest peck if degression is a factor
};

/// Returns the depths below the reference plane at the end of each peck; the last one is `total`. A
/// peck is shorter than the previous one by the degression as long as more than the degression
/// remains, then it stays at the degression; once at most twice the degression remains, the rest is
/// halved. Returns an empty list for more than 1e5 pecks.
std::vector<double> peck_depths(double total, const PeckParameters& words);

/// Returns the distance above the last depth at which a drill continues at feed after clearing its
/// chips: 0.6 mm, beyond 30 mm of depth a fiftieth of the depth, at most 7 mm.
double peck_stop_distance(double total);

/// Returns the pitch of a metric coarse thread M3 to M48 in whole millimetres (ISO 261), mm; 0 for
/// other sizes.
double coarse_pitch(double size);

/// Result of a block.
struct BlockResult {
  bool moved = false;  ///< it had words of motion, so a modal call follows
  bool ends = false;   ///< end of the program or subprogram
};

/// State of the control as its words command it: modes, frames, tools, and the moves that they make
/// on the canon.
class Machine {
 public:
  /// `tool_changes_by_m6`: M6 changes to the tool of T; otherwise T itself does.
  Machine(ProgramRun& run, bool tool_changes_by_m6);

  BlockResult execute(const Block& block);
  /// Makes the moves that still wait at the end of the program.
  void finish() { compensation_.finish(); }
  /// Executes a drilling cycle or CYCLE800. Returns false if the control has no cycle of that name.
  bool cycle(const ProgramCall& call);
  static bool is_cycle(std::string_view name);

  /// Returns the position of an axis in the workpiece ($AA_IW) or as an axis ($AA_IM), mm or inch
  /// and degrees; nothing if the machine has no axis of that letter.
  std::optional<double> position(char letter, bool of_the_axis) const;

 private:
  using AxisVector = kinematics::AxisVector;

  // Words and modes.
  [[noreturn]] void refuse(const Cause& cause, std::string expected,
                           std::optional<std::string> seen = {}) const {
    canon_.refuse(cause, std::move(expected), std::move(seen));
  }
  void check_words(const Block& block) const;
  void choose_system(const Code& code);
  void note_start_modes(const Block& block);
  void set_modes(const Block& block);
  void set_feed(const Block& block);
  void set_spindle(const Block& block);
  void choose_master(int spindle, const Cause& cause);
  void set_speed(double word, const Cause& cause);
  void set_numbered_spindles(const Block& block);
  void call_tools(const Block& block);
  void note_coolant(const Block& block) const;
  void dwell(const Block& block);
  double unit() const { return canon_.inch() ? inch_mm : 1.0; }
  int joint(int xyz) const { return canon_.joint_of("XYZ"[xyz]); }
  const Value* first_axis_word(const Block& block) const;
  Cause cause_of(const Block& block) const;

  /// Return the programmed position, from which the tool may be offset: as axes, and in program
  /// coordinates.
  AxisVector here() const {
    return compensation_.is_on() || compensation_.is_leaving() ? compensation_.programmed()
                                                         : canon_.position();
  }
  AxisVector programmed_here() const { return canon_.unplaced(here()); }
  void check_compensation(const Block& block) const;

  // Tools.
  void set_compensation(const Code& code);
  int number_of_tool(const Block& block) const;
  bool has_single_length() const;
  bool knows_tool() const { return tool_ >= 0 || has_single_length(); }
  double active_tool_length(const Cause& cause) const;
  void apply_tool();
  /// Returns the shift, (axes), of the tool length in force while the axes are commanded; empty:
  /// none.
  AxisVector active_tool_shift() const;

  // Frames.
  bool tip_mode() const { return traori_ || (swivel_ && swivel_->turned); }
  void apply_frame();
  void change_transformation(const Code& code);
  void frame_words(const Block& block);
  Placement frame_of_words(const Block& block) const;
  void swivel(const ProgramCall& call);
  void unswivel();
  void retract(int manner, double by, const Cause& cause);
  void turn_to(const Eigen::Vector3d& direction_w, int preference, bool tip_stays,
               const Cause& cause);
  Eigen::Matrix3d total_rotation() const;

  void note_diameters(const Block& block);
  /// Returns the factor that turns an X value into a radius.
  double radius_of_x(bool absolute) const;
  void refuse_diameters(const Value& word) const;
  std::optional<double> nose_radius(int tool) const;
  AxisVector programmed_nose_offset() const;

  // Straight motion.
  bool move(const Block& block);
  Target block_target(const Block& block, bool machine) const;
  void put_word(Target& target, int j, const Value& word, bool machine) const;
  void put_polar(Target& target, const Block& block);
  void set_pole(const Block& block);
  void check_motion(const Block& block) const;
  void put_straight(program::Straight move, bool rapid);
  void to_machine(const Block& block);
  void thread(const Block& block, AxisVector end);
  /// Sets the rotary axes of `end` by A3 B3 C3.
  void point_tool(const Block& block, AxisVector& end) const;
  /// Issues a line that changes the tool direction on a great circle.
  void great_circle(program::Straight move);

  // Arcs.

  /// The plane of arcs.
  struct Plane {
    std::string_view letters;       ///< "XY"
    std::array<Address, 3> centre;  ///< of the first axis, the second, and the normal
    int first = 0, second = 1;      ///< joints
    int across = 2;
  };
  Plane plane(const Cause& cause) const;
  void arc(const Block& block, const Target& target);
  void arc_through(const Block& block, const Target& target);
  void put_arc(const Block& block, program::ArcMove move);
  AxisVector centre_of(const Block& block, const Plane& plane, const Cause& cause) const;

  // Cycles.
  friend class Hole;

  static constexpr double inch_mm = 25.4;

  ProgramRun& run_;
  program::Canon& canon_;
  const OrientationKinematics orientation_;
  bool changes_by_m6_;
  std::string_view motion_ = "G1";
  int plane_ = 17;
  bool incremental_ = false, inch_feed_ = false;
  enum class Diameters { Off, On, Absolute } diameters_ = Diameters::Off;
  bool diameters_stated_ = false;
  bool surface_speed_ = false;
  double speed_ = 0.0;
  std::optional<double> max_rpm_;  ///< LIMS=
  struct Spindle {
    double rpm = 0.0;
    int direction = 0;
  };
  int master_ = 1;  ///< spindle that carries the tool; S and M without number are its own
  std::map<int, Spindle> spindles_;  ///< other spindles, as their words left them
  int selected_ = -1, tool_ = -1;    ///< of T; in the spindle
  bool length_counts_ = true;        ///< D1
  int system_ = 0;                   ///< index of the work offset: 0 is G54; -1 is G500
  bool traori_ = false;
  bool workpiece_frame_ = true;          ///< ORIWKS
  std::optional<bool> on_great_circle_;  ///< ORIVECT true, ORIAXES false; empty: not programmed
  Placement programmable_;
  AxisVector programmable_turns_;  ///< (axes) rad, mm of additional linear axes
  struct Swivel {
    Placement frame;
    bool turned = false;  ///< the rotary axes stand so that the tool is along its z
  };
  std::optional<Swivel> swivel_;
  struct Pole {
    Eigen::Vector2d at = {0, 0};
    double radius = 0.0, angle_deg = 0.0;
  } pole_;
  CutterCompensation compensation_;
};

}  // namespace abbe::sim::dialects::siemens
