#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "sim/dialects/program_run.h"
#include "sim/program/canon.h"

/// The tool of a turning control: which point of it X and Z lead.
namespace abbe::sim::dialects {

/// Returns the control's chain to the tip of a tool, which for a round nose is its centre: that of
/// the tool's own number if the scene has several; null where no kinematics are known.
const kinematics::Chain* chain_to_tip(const program::NcOptions& control, int tool);

/// Returns the shift of a tool offset that has been measured: with it X Z lead the tip in the
/// workpiece, X0 on the spindle line. (axes) mm
/// @throws BadInput unless the slides are at right angles
kinematics::AxisVector measured_offset(const program::Canon& canon, const kinematics::Chain& chain,
                                       const program::Cause& cause);

/// Returns the displacement from the imaginary tip of a nose to its centre, (axes) mm.
/// @param tip  0 to 9, as Fanuc and Siemens number them: 1 X+ Z+, 2 X+ Z-, 3 X- Z-, 4 X- Z+,
///             5 Z+, 6 X+, 7 Z-, 8 X- of the centre, 0 and 9 the centre
kinematics::AxisVector nose_offset(const program::Canon& canon, int tip,
                                   std::optional<double> radius);

/// How a control enters a contour and which corners it sees. The defaults are those of Fanuc (type
/// A), Siemens (NORM) and Heidenhain.
struct CompensationRules {
  /// The entry ends across the beginning of the next segment, at the radius from it. Else, as in
  /// LinuxCNC, it ends beside its own direction, is at least as long as the radius, and may be an
  /// arc.
  bool perpendicular_entry = true;
  /// rad, a corner of less counts as none: the tool is too near the contour behind it by up to
  /// radius * corner^2 / 2, 5 nm at 10 mm of radius.
  double min_corner = 1e-3;
};
inline constexpr CompensationRules linuxcnc_compensation{.perpendicular_entry = false,
                                                         .min_corner = 0.05};

/// Cutter compensation in a plane: the path beside the programmed one by the radius of the tool.
/// Each move waits for the next, which decides its end: an inside corner is cut where the two paths
/// beside meet, around an outside corner goes an arc of the radius about it.
class Compensation {
 public:
  explicit Compensation(ProgramRun& run) : run_(run), canon_(run.canon) {}

  bool on() const { return on_; }
  bool left() const { return left_; }
  bool entered() const { return entered_; }  ///< the first move since `begin` has been taken
  /// What follows is left or right of the programmed path. @param first, second  joints of the
  /// plane
  void begin(bool left, double radius, std::array<int, 2> plane, CompensationRules manner = {});
  /// The same where the tool stands beside the programmed place already, as other controls enter.
  void begin_at_offset(bool left, double radius, std::array<int, 2> plane,
                       kinematics::AxisVector programmed);
  /// The move that waits is made; the next one leads from where the tool stands to its programmed
  /// end.
  void end();
  /// The program ends.
  void finish() { end(); }

  /// Where the program is, which the tool is beside.
  const kinematics::AxisVector& programmed() const;
  kinematics::AxisVector end_of(const program::Target& target) const;
  /// The program stands elsewhere than was said, as where another point of the tool is led from now
  /// on.
  void shift_programmed(const kinematics::AxisVector& by) { programmed_ += by; }
  /// The first move after `end` has been made.
  bool leaving() const { return leaving_; }
  void clear_leaving() { leaving_ = false; }

  /// @throws BadInput for an entry shorter than the radius, a corner that the tool does not reach
  void straight(program::Straight move, bool rapid);
  void arc(program::ArcMove move);
  /// Done now, or behind the move that waits.
  void after(std::function<void()> action);

 private:
  using Vector2d = Eigen::Vector2d;

  /// A piece of the path beside, in the plane.
  struct Piece {
    bool rapid = false, round = false, clockwise = false, entry = false;
    Vector2d start, end;  ///< beside the programmed ones
    Vector2d centre;      ///< of an arc
    double radius = 0.0;  ///< of the arc beside
    int turns = 1;
    Vector2d leaves, arrives;   ///< unit, direction at start and end
    kinematics::AxisVector to;  ///< programmed end of all axes
    program::Cause cause;
    std::optional<program::Feed> feed;
    int line = 0, file = 0;
  };

  /// What is done behind the piece that waits, at its own line and with its own feed.
  struct Later {
    std::function<void()> action;
    std::optional<program::Feed> feed;
    int line = 0, file = 0;
  };

  Vector2d centre_of(const program::ArcMove& move) const;
  Vector2d in_plane(const kinematics::AxisVector& q) const { return {q[plane_[0]], q[plane_[1]]}; }
  /// To the side of a direction on which the tool is.
  Vector2d beside(const Vector2d& direction) const;
  void join(Piece piece);
  void enter_by_arc(Piece& piece, const Vector2d& outwards, const program::Cause& cause) const;
  static bool has_length_left(const Piece& piece, const Vector2d& from, const Vector2d& to);
  void concave(Piece& next, const Vector2d& corner);
  void round_corner(const Piece& next, const Vector2d& corner);
  void emit_waiting_move();
  void check_feed(const program::Cause& cause) const;

  ProgramRun& run_;
  program::Canon& canon_;
  bool on_ = false, left_ = false, leaving_ = false, entered_ = false;
  double radius_ = 0.0;
  CompensationRules manner_;
  std::array<int, 2> plane_{0, 1};
  kinematics::AxisVector programmed_;
  std::optional<Piece> waits_;
  std::vector<Later> after_;
};

}  // namespace abbe::sim::dialects
