#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "sim/dialects/program_run.h"
#include "sim/program/canon.h"

/// Tool offsets of turning controls, and cutter compensation in a plane (G41, G42, RL, RR).
namespace abbe::sim::dialects {

/// Returns the control's chain to the tip of a tool; the tip of a round nose is its centre. If the
/// scene has several tools, the chain is that of the tool number. Returns null if the kinematics
/// are unknown.
const kinematics::Chain* chain_to_tip(const program::NcOptions& control, int tool);

/// Returns the shift, (axes) mm, of a measured tool offset. With it X Z lead the tip in the
/// workpiece, and X0 is on the spindle axis. Throws BadInput unless the slides are at right angles.
kinematics::AxisVector measured_offset(const program::Canon& canon, const kinematics::Chain& chain,
                                       const program::Cause& cause);

/// Returns the displacement from the imaginary tip of a nose to its centre, (axes) mm. `tip` is 0
/// to 9 in the numbering of Fanuc and Siemens: 1 X+ Z+, 2 X+ Z-, 3 X- Z-, 4 X- Z+, 5 Z+, 6 X+, 7
/// Z-, 8 X- of the centre, 0 and 9 the centre.
kinematics::AxisVector nose_offset(const program::Canon& canon, int tip,
                                   std::optional<double> radius);

/// Rules for entering a contour and for detecting corners. The defaults are those of Fanuc (type
/// A), Siemens (NORM) and Heidenhain.
struct CompensationRules {
  /// True: the entry ends one radius from the beginning of the next segment, perpendicular to it.
  /// False, as in LinuxCNC: the entry ends one radius from its programmed end, perpendicular to
  /// itself; it is at least as long as the radius, and may be an arc.
  bool perpendicular_entry = true;
  /// rad; a smaller corner is ignored. The tool then gouges the contour after it by up to
  /// radius * corner^2 / 2, 5 nm at 10 mm of radius.
  double min_corner = 1e-3;
};
inline constexpr CompensationRules linuxcnc_compensation{.perpendicular_entry = false,
                                                         .min_corner = 0.05};

/// Cutter compensation in a plane: offsets the programmed path by the tool radius. Each move waits
/// for the next one, which determines its end: at an inside corner the move ends where the two
/// offset paths intersect, around an outside corner an arc of the tool radius is inserted.
class CutterCompensation {
 public:
  explicit CutterCompensation(ProgramRun& run) : run_(run), canon_(run.canon) {}

  bool is_on() const { return is_on_; }
  bool is_left() const { return is_left_; }
  bool has_entered() const { return has_entered_; }  ///< the first move since `begin` has been made
  /// Begins compensation left or right of the path. `plane` holds the joints of the plane.
  void begin(bool left, double radius, std::array<int, 2> plane, CompensationRules rules = {});
  /// Begins compensation with the tool already offset from the programmed position, as some
  /// controls enter a contour.
  void begin_at_offset(bool left, double radius, std::array<int, 2> plane,
                       kinematics::AxisVector programmed);
  /// Makes the waiting move and ends compensation; the next move leads from the offset position to
  /// its programmed end.
  void end();

  /// Returns the programmed position, from which the tool is offset.
  const kinematics::AxisVector& programmed() const { return programmed_; }
  /// Returns the end of a move that begins at the programmed position.
  kinematics::AxisVector end_of(const program::Target& target) const;
  /// Shifts the programmed position, for example when X Z begin to lead another point of the tool.
  void shift_programmed(const kinematics::AxisVector& displacement) { programmed_ += displacement; }
  /// Returns true after `end` until the next move has been made.
  bool is_leaving() const { return is_leaving_; }
  void clear_leaving() { is_leaving_ = false; }

  /// Adds a line. Throws BadInput for an entry shorter than the radius, and for a corner that the
  /// tool cannot reach.
  void straight(program::Straight move, bool rapid);
  /// Adds an arc. Throws BadInput as `straight` does.
  void arc(program::ArcMove move);
  /// Runs an action after the waiting move, or at once if no move waits.
  void run_after_move(std::function<void()> action);

 private:
  using Vector2d = Eigen::Vector2d;

  /// A segment of the offset path, in the plane.
  struct OffsetSegment {
    bool is_rapid = false, is_arc = false, is_clockwise = false, is_entry = false;
    Vector2d start, end;  ///< offset positions
    Vector2d centre;      ///< centre of an arc
    double radius = 0.0;  ///< radius of the offset arc
    int turn_count = 1;
    Vector2d start_direction, end_direction;  ///< unit, direction at start and end
    kinematics::AxisVector programmed_end;    ///< (axes)
    program::Cause cause;
    std::optional<program::Feed> feed;
    int line = 0, file = 0;
  };

  /// An action to run after the waiting segment, at the line and with the feed of its own block.
  struct PostponedAction {
    std::function<void()> action;
    std::optional<program::Feed> feed;
    int line = 0, file = 0;
  };

  Vector2d arc_centre(const program::ArcMove& move) const;
  Vector2d in_plane(const kinematics::AxisVector& q) const { return {q[plane_[0]], q[plane_[1]]}; }
  /// Returns the offset of the tool from a path of that direction, mm.
  Vector2d offset_vector(const Vector2d& direction) const;
  void join_segment(OffsetSegment segment);
  void enter_by_arc(OffsetSegment& segment, const Vector2d& outwards,
                    const program::Cause& cause) const;
  static bool is_passable(const OffsetSegment& segment, const Vector2d& from, const Vector2d& to);
  void trim_inside_corner(OffsetSegment& next, const Vector2d& corner);
  void round_outside_corner(const OffsetSegment& next, const Vector2d& corner);
  void make_waiting_move();
  void check_feed(const program::Cause& cause) const;

  ProgramRun& run_;
  program::Canon& canon_;
  bool is_on_ = false, is_left_ = false, is_leaving_ = false, has_entered_ = false;
  double radius_ = 0.0;
  CompensationRules rules_;
  std::array<int, 2> plane_{0, 1};
  kinematics::AxisVector programmed_;
  std::optional<OffsetSegment> waiting_segment_;
  std::vector<PostponedAction> postponed_actions_;
};

}  // namespace abbe::sim::dialects
