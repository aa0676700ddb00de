#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "kinematics/chain.h"
#include "sim/program/path.h"

/// Measurement of a path: extents, travel, times, speeds and singular poses.
namespace abbe::sim::program {

/// Speed limits of the axes. Times are computed from speeds alone, because the description of a
/// machine has no accelerations.
struct AxisLimits {
  double rapid_speed = 10000.0 / 60.0;  ///< mm/s of every linear axis
  double rapid_rotation_speed = 1.0;    ///< rad/s of every rotary axis
  double pole = 0.0;  ///< rad; an approach to a pole below this angle is recorded; 0: none is
};

/// A value and the program line at which it occurs.
struct ValueAtLine {
  double value = 0.0;
  int line = 0;
  std::uint16_t file = 0;  ///< see `Block`
};

/// Range, speed and remaining travel of one axis, mm or rad.
struct AxisFigures {
  bool has_position = false;      ///< the axis is no spindle and the program has blocks
  ValueAtLine lowest, highest;    ///< extreme positions
  ValueAtLine fastest;            ///< mm/s or rad/s, in moves at feed
  double remaining_travel = 0.0;  ///< mm or rad to the nearer travel limit; negative beyond it
};

/// The pose nearest to a singularity in which a move at feed turns rotary axes.
struct SingularPose {
  /// rad, smallest change of tool direction per rad of rotary axis motion, as an angle; 0 if some
  /// rotation does not change the direction
  double angle = 0.0;
  kinematics::AxisVector q;
  int line = 0;
  std::uint16_t file = 0;
};

/// The closest approach to a pole at feed under a tip mode. At a pole the position of one axis, the
/// free axis, does not change the tool direction.
struct PoleApproach {
  double angle = 0.0;          ///< rad, smallest angle between the tool and that axis
  int axis = 0;                ///< the free axis, a joint
  int pole_axis = 0;           ///< the other rotary joint
  double pole_position = 0.0;  ///< rad, position of `pole_axis` at the nearest pole
  double rotation = 0.0;       ///< rad, rotation of `axis` close to the pole
  double max_speed = 0.0;      ///< rad/s of `axis` there, as programmed
  int line = 0;                ///< line of the smallest angle
  std::uint16_t file = 0;
};

/// Distances and times of the moves of one type.
struct MoveFigures {
  std::size_t count = 0;
  double seconds = 0.0;      ///< as programmed; rapids along their path at the rapid speed
  double limited_s = 0.0;    ///< s, if no axis exceeds its speed limit
  double path_length = 0.0;  ///< mm, path length of the tip in the workpiece
};

/// The results of `PathMeter`.
struct PathFigures {
  std::size_t blocks = 0;
  MoveFigures rapids, lines, arcs, cubics, dwells;
  std::vector<AxisFigures> axes;  ///< (joints)
  std::size_t slowed_moves = 0;   ///< moves at feed in which an axis would exceed its speed limit
  ValueAtLine max_slow_down;      ///< largest factor by which a move is slowed
  int fastest_axis = -1;  ///< joint that comes nearest to its speed limit or exceeds it most
  Eigen::AlignedBox3d feed_extent_w, tip_extent_w;  ///< extents of the tip in the workpiece, mm
  /// Smallest and largest distance of the tip from the axis of the workpiece spindle, at feed, mm.
  /// Empty if the machine has no such spindle.
  std::optional<std::array<double, 2>> radius_at_feed;
  std::optional<SingularPose> singular;  ///< empty if no move at feed turns a pair of rotary axes
  /// Empty if the tool is never near a pole or nothing rotates there.
  std::optional<PoleApproach> pole;
  std::map<int, std::size_t> offsets;  ///< blocks by `Block::work_offset`
  std::map<int, std::size_t> lengths;  ///< blocks by `Block::tool_length`
  std::size_t tip_blocks = 0;          ///< blocks under a tip mode
};

/// Chord tolerance, mm, for lengths, times and speeds of curved moves.
inline constexpr double path_meter_tolerance = 0.01;

/// Measures a path block by block, as the axes of a machine run it, without keeping blocks.
/// Positions and extents are those of the curves, within 1e-9 mm and rad: an extreme between the
/// sampled points of a move is searched if it may exceed the extremes so far. If an axis reverses
/// twice between two points, as slides that follow rotary axes may, the extreme may be wrong by
/// `path_meter_tolerance`; on arcs, helices and cubics none is missed. The singular pose is found
/// by minimising along each move that may come nearer, within 1e-7 rad. The rotation of an axis
/// near a pole is summed over the parts of moves that come near, so it is at most one part too
/// large at each end.
class PathMeter {
 public:
  /// `control` must outlive the object; its limits are the travel limits. `control_by_h`, which
  /// must outlive it too, holds the chains to the tips of other tools, by H number.
  PathMeter(const kinematics::Chain& control, const AxisLimits& limits,
            const std::map<int, kinematics::Chain>* control_by_h = nullptr);

  /// Processes the next blocks. Throws BadInput at the line where the slides do not reach a tip.
  void add(const Path& path);
  PathFigures figures() const;
  /// Returns the axis positions at the end of the last block.
  const kinematics::AxisVector& axes() const { return q_; }

  /// Is called with every sampled point of the tip, for example to draw the path.
  std::function<void(const Eigen::Vector3d& tip_w, bool rapid)> on_tip_point = {};

 private:
  using AxisVector = kinematics::AxisVector;

  bool is_spindle(int j) const { return j == spindle_ || motion(j) == kinematics::Motion::Spindle; }
  kinematics::Motion motion(int j) const { return control_->joints()[std::size_t(j)].motion; }
  double limit(int j) const;
  Eigen::Vector3d tip_position(const Path& path, const Block& block, const AxisVector& q,
                               double u) const;
  bool select_chain(const Block& block);
  void begin(const Path& path, const Block& block);
  void move(const Path& path, const Block& block);
  void record_position(const Block& block, const AxisVector& q);
  /// A sampled point of a move: fraction, axes and tip.
  struct SampledPoint {
    double u = 0.0;
    AxisVector q;
    Eigen::Vector3d tip_w;
  };
  SampledPoint point_at(const Path& path, const Block& block, double u) const;
  void record_point(const Block& block, const SampledPoint& point);
  double coordinate(const SampledPoint& point, int k) const;
  bool is_curved(const Block& block, int k) const;
  bool has_extreme_near_end(const Path& path, const Block& block) const;
  bool can_be_new_extreme(const Block& block, double value, int k, double sign) const;
  void search_extremes(const Path& path, const Block& block,
                       const std::array<SampledPoint, 3>& triple);
  void search_all_extremes(const Path& path, const Block& block, std::size_t chords);
  void record_speeds(const Block& block, const AxisVector& step, double seconds);
  void record_slow_down(const Block& block, double factor);
  void search_singular_pose(const Path& path, const Block& block, double from, double to,
                            double rotation);
  void record_pole(const Block& block, const AxisVector& to, double seconds);
  void record_singular_angle(const Path& path, const Block& block, double u);
  double singular_angle(const Path& path, const Block& block, double u) const;
  MoveFigures& figures_of_type(const Block& block);
  void record_radius();

  const kinematics::Chain* control_;
  const std::map<int, kinematics::Chain>* control_of_h_;
  AxisLimits limits_;
  int spindle_ = -1;
  /// Axis of the spindle that turns the workpiece, in the workpiece frame.
  std::optional<Eigen::ParametrizedLine<double, 3>> spindle_line_w_;
  std::array<int, 3> xyz_{-1, -1, -1};  ///< joints; -1 where the machine lacks one
  std::vector<int> rotary_;
  PathFigures figures_;
  AxisVector q_;
  Eigen::Vector3d tip_w_ = Eigen::Vector3d::Zero();
  AxisVector programmed_;  ///< end of the last block, in `coordinates_`
  Coordinates coordinates_ = Coordinates::Axis;
  double max_speed_ratio_ = 0.0;
};

/// Returns "line 12" for the first file of a program, "line 12 of FILE" for the others.
/// `subprogram_files` is Path::more_files.
std::string line_label(const std::vector<std::string>& subprogram_files, int line,
                       std::uint16_t file);

}  // namespace abbe::sim::program
