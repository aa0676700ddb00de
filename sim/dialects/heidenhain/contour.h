#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "sim/dialects/program_run.h"
#include "sim/dialects/tool_compensation.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects::heidenhain {

/// A contour element: a straight or circular move as programmed.
struct ContourElement {
  bool is_rapid = false, is_arc = false;
  kinematics::AxisVector end;          ///< (axes), offsets included
  int first = 0, second = 1;           ///< joints of the plane of an arc
  kinematics::AxisVector centre = {};  ///< as `Canon::placed` returns it
  std::optional<double> radius = {};   ///< alternative to the centre, as in `ArcMove`
  bool is_clockwise = false;
  int turn_count = 1;  ///< as `ArcMove::turns`
  program::Cause cause = {};
  std::uint32_t stated = 0;
  std::optional<program::Feed> feed = {};
  int line = 0, file = 0;
};

/// Processes moves before the canon makes them: rounds (RND) and bevels (CHF) corners, and
/// compensates the tool radius (RL, RR). A move waits for the next one if that determines its end.
///
/// RL and RR begin with a straight move, which ends perpendicular to the beginning of the next move
/// in the plane; R0 ends compensation perpendicular to the end of the last move. Corners are made
/// as in `CutterCompensation`.
class Contour {
 public:
  explicit Contour(ProgramRun& run) : run_(run), canon_(run.canon), compensation_(run) {}

  /// Returns the programmed position, offsets included. The axes may be offset from it or may not
  /// have reached it.
  const kinematics::AxisVector& position() const {
    return is_ahead_ ? position_ : canon_.position();
  }
  /// Returns the programmed position in program coordinates.
  kinematics::AxisVector programmed() const { return canon_.without_offsets(position()); }

  /// Adds a move. `plane` holds the joints of the working plane; `before_corner` is true if
  /// RND or CHF follows. Throws BadInput for moves too short for a corner, and for moves that RL
  /// and RR cannot have.
  void add(ContourElement element, const std::array<int, 2>& plane, bool before_corner);
  /// Adds a corner at the end of the previous move. `size` is the radius or the length of the
  /// bevel, mm.
  void add_corner(bool is_round, double size, std::optional<program::Feed> feed,
                  const program::Cause& cause);
  /// Sets compensation left or right of the path from the next move on, or ends it. `radius` in mm.
  void set_side(std::optional<bool> left, double radius, const program::Cause& cause);
  bool is_compensated() const { return is_left_.has_value(); }
  bool is_waiting() const { return waiting_corner_ || waiting_element_; }
  /// Runs an action after the waiting move of the compensation, or at once if no move waits.
  void run_after_move(std::function<void()> action);
  /// Makes all waiting moves at their programmed ends.
  void finish();

 private:
  /// A corner that waits for the move after it.
  struct Corner {
    bool is_round = true;
    double size = 0.0;
    std::optional<program::Feed> feed;
    program::Cause cause;
    int line = 0, file = 0;
  };
  Eigen::Vector2d in_plane(const kinematics::AxisVector& q) const {
    return {q[plane_[0]], q[plane_[1]]};
  }
  kinematics::AxisVector make_corner(const ContourElement& next);
  void process(ContourElement element);
  void enter_contour(const ContourElement& next);
  Eigen::Vector2d start_direction(const ContourElement& element,
                                  const kinematics::AxisVector& start) const;
  void compensate(const ContourElement& element);
  void issue(const ContourElement& element);
  void issue_entry_moves();

  ProgramRun& run_;
  program::Canon& canon_;
  CutterCompensation compensation_;
  std::array<int, 2> plane_{0, 1};
  bool is_ahead_ = false;  ///< the programmed position is ahead of the axes
  kinematics::AxisVector position_;
  std::optional<ContourElement> waiting_element_;  ///< line before a corner
  kinematics::AxisVector waiting_start_;
  std::optional<Corner> waiting_corner_;
  std::optional<bool> is_left_;  ///< side of the compensation; empty: none
  double radius_ = 0.0;
  /// The first move under RL or RR, and moves of other axes after it.
  std::vector<ContourElement> entry_elements_;
};

}  // namespace abbe::sim::dialects::heidenhain
