#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "sim/dialects/program_run.h"
#include "sim/dialects/tool_compensation.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects::heidenhain {

/// A straight or circular move as programmed.
struct Element {
  bool rapid = false, round = false;
  kinematics::AxisVector end;          ///< (axes), offsets included
  int first = 0, second = 1;           ///< joints of the plane of an arc
  kinematics::AxisVector centre = {};  ///< as `Canon::placed` returns it
  std::optional<double> radius = {};   ///< alternative to the centre, as in `ArcMove`
  bool clockwise = false;
  int turns = 1;
  program::Cause cause = {};
  std::uint32_t stated = 0;
  std::optional<program::Feed> feed = {};
  int line = 0, file = 0;
};

/// Processes moves before the canon makes them: corners rounded by RND and bevelled by CHF, and
/// compensation of the tool radius by RL and RR. A move waits for the next one if that determines
/// its end.
///
/// RL and RR begin with a straight move, which ends perpendicular to the beginning of the next move
/// in the plane; R0 ends compensation perpendicular to the end of the last move. Corners are made
/// as in `CutterCompensation`.
class Contour {
 public:
  explicit Contour(ProgramRun& run) : run_(run), canon_(run.canon), beside_(run) {}

  /// Returns the programmed position, offsets included, which the axes may have an offset from or
  /// not have reached.
  const kinematics::AxisVector& position() const { return moved_ ? at_ : canon_.position(); }
  /// Returns the programmed position in program coordinates.
  kinematics::AxisVector programmed() const { return canon_.unplaced(position()); }

  /// Processes a move. `plane` holds the joints of the working plane; `before_corner` is true if
  /// RND or CHF follows. Throws BadInput for moves too short for a corner, and for moves that RL
  /// and RR cannot have.
  void put(Element element, const std::array<int, 2>& plane, bool before_corner);
  /// Adds a corner at the end of the previous move. `size` is the radius or the length of the
  /// bevel, mm.
  void corner(bool round, double size, std::optional<program::Feed> feed,
              const program::Cause& cause);
  /// Sets compensation left or right of the path from the next move on, or none. `radius` in mm.
  void set_side(std::optional<bool> left, double radius, const program::Cause& cause);
  bool beside() const { return side_.has_value(); }
  bool waits() const { return corner_ || held_; }
  /// Runs an action now, or after the waiting move.
  void after(std::function<void()> action);
  /// Makes all waiting moves as they are.
  void finish();

 private:
  /// A corner that waits for the move behind it.
  struct Corner {
    bool round = true;
    double size = 0.0;
    std::optional<program::Feed> feed;
    program::Cause cause;
    int line = 0, file = 0;
  };
  Eigen::Vector2d in_plane(const kinematics::AxisVector& q) const {
    return {q[plane_[0]], q[plane_[1]]};
  }
  kinematics::AxisVector cut_corner(const Element& next);
  void pass(Element element);
  void enter(const Element& next);
  Eigen::Vector2d leaves(const Element& element, const kinematics::AxisVector& start) const;
  void go_beside(const Element& element);
  void make(const Element& element);
  void emit_entry_moves();

  ProgramRun& run_;
  program::Canon& canon_;
  CutterCompensation beside_;
  std::array<int, 2> plane_{0, 1};
  bool moved_ = false;  ///< the programmed position is ahead of the axes
  kinematics::AxisVector at_;
  std::optional<Element> held_;  ///< waits for its corner
  kinematics::AxisVector held_from_;
  std::optional<Corner> corner_;
  std::optional<bool> side_;
  double radius_ = 0.0;
  /// The move that begins RL or RR, and moves of other axes behind it.
  std::vector<Element> entry_;
};

}  // namespace abbe::sim::dialects::heidenhain
