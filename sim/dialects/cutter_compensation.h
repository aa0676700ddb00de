#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "sim/dialects/program_run.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects {

/// How a control enters a contour and which corners it sees. The defaults are those of Fanuc (type
/// A), Siemens (NORM) and Heidenhain.
struct CompensationManner {
  /// The entry ends across the beginning of the next segment, at the radius from it. Else, as in
  /// LinuxCNC, it ends beside its own direction, is at least as long as the radius, and may be an
  /// arc.
  bool upright_entry = true;
  /// rad, a corner of less counts as none: the tool is too near the contour behind it by up to
  /// radius * corner^2 / 2, 5 nm at 10 mm of radius.
  double least_corner = 1e-3;
};
inline constexpr CompensationManner linuxcnc_compensation{.upright_entry = false,
                                                          .least_corner = 0.05};

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
  void begin(bool left, double radius, std::array<int, 2> plane, CompensationManner manner = {});
  /// The same where the tool stands beside the programmed place already, as other controls enter.
  void begin_beside(bool left, double radius, std::array<int, 2> plane,
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
  void left_behind() { leaving_ = false; }

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
  static bool leaves_something(const Piece& piece, const Vector2d& from, const Vector2d& to);
  void concave(Piece& next, const Vector2d& corner);
  void round_corner(const Piece& next, const Vector2d& corner);
  void put_out();
  void check_feed(const program::Cause& cause) const;

  ProgramRun& run_;
  program::Canon& canon_;
  bool on_ = false, left_ = false, leaving_ = false, entered_ = false;
  double radius_ = 0.0;
  CompensationManner manner_;
  std::array<int, 2> plane_{0, 1};
  kinematics::AxisVector programmed_;
  std::optional<Piece> waits_;
  std::vector<Later> after_;
};

}  // namespace abbe::sim::dialects
