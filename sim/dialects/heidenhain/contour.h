#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "sim/dialects/program_run.h"
#include "sim/dialects/tool_compensation.h"
#include "sim/program/canon.h"

namespace abbe::sim::dialects::heidenhain {

/// A straight or circular move as the program says it.
struct Element {
  bool rapid = false, round = false;
  kinematics::AxisVector end;          ///< (axes), offsets already in
  int first = 0, second = 1;           ///< joints of the plane of an arc
  kinematics::AxisVector centre = {};  ///< as `Canon::placed` gives it
  std::optional<double> radius = {};   ///< instead, as that of `ArcMove`
  bool clockwise = false;
  int turns = 1;
  program::Cause cause = {};
  std::uint32_t stated = 0;
  std::optional<program::Feed> feed = {};
  int line = 0, file = 0;
};

/// What becomes of the moves before the canon makes them: corners that RND and CHF round and bevel,
/// and the path beside the programmed one by the radius of the tool, RL and RR. A move waits for
/// the next one where that decides its end.
///
/// RL and RR begin with a straight move, which ends across the beginning of the move in the plane
/// that follows; R0 ends them across the end of the last one. Corners are those of
/// `Compensation`.
class Contour {
 public:
  explicit Contour(ProgramRun& run) : run_(run), canon_(run.canon), beside_(run) {}

  /// Where the program is, which the axes may be beside or behind, offsets in.
  const kinematics::AxisVector& position() const { return moved_ ? at_ : canon_.position(); }
  /// The same in program coordinates.
  kinematics::AxisVector programmed() const { return canon_.unplaced(position()); }

  /// @param plane  joints of the working plane
  /// @param before_corner  RND or CHF follows
  /// @throws BadInput for a corner that is too small, and what RL and RR cannot do
  void put(Element element, const std::array<int, 2>& plane, bool before_corner);
  /// The corner at the end of the move before. @param size  mm, radius or length of the bevel
  void corner(bool round, double size, std::optional<program::Feed> feed,
              const program::Cause& cause);
  /// Left or right of the path from the next move on, none for on it. @param radius  mm
  void set_side(std::optional<bool> left, double radius, const program::Cause& cause);
  bool beside() const { return side_.has_value(); }
  bool waits() const { return corner_ || held_; }
  /// Now, or behind the move that waits.
  void after(std::function<void()> action);
  /// All that waits is made as it stands.
  void finish();

 private:
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
  Compensation beside_;
  std::array<int, 2> plane_{0, 1};
  bool moved_ = false;  ///< the program is not where the axes stand
  kinematics::AxisVector at_;
  std::optional<Element> held_;  ///< its corner follows
  kinematics::AxisVector held_from_;
  std::optional<Corner> corner_;
  std::optional<bool> side_;
  double radius_ = 0.0;
  std::vector<Element>
      entry_;  ///< the move that begins RL or RR, and those of other axes behind it
};

}  // namespace abbe::sim::dialects::heidenhain
