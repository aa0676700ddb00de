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

namespace abbe::sim::program {

/// How fast an axis may go, and what a control makes of the blocks: speeds alone, since the
/// description of a machine has no accelerations.
struct AxisLimits {
  double rapid_speed = 10000.0 / 60.0;  ///< mm/s of every slide
  double rapid_turn = 1.0;              ///< rad/s of every rotary axis
  double pole = 0.0;                    ///< rad: nearer to a pole than this is noted; 0: never
};

/// A line of the program at which a figure is met.
struct ValueAtLine {
  double value = 0.0;
  int line = 0;
  std::uint16_t file = 0;  ///< as of a block
};

/// What a program asks of one axis, mm or rad.
struct AxisFigures {
  bool positioned = false;  ///< no spindle, and the program has blocks
  ValueAtLine least, most;  ///< positions
  ValueAtLine fastest;      ///< mm/s or rad/s, of the moves at feed
  double left = 0.0;        ///< mm or rad, to the nearer limit of travel; below zero beyond it
};

/// The pose nearest to a singular one in which a move at feed turns rotary axes.
struct SingularPose {
  double angle = 0.0;  ///< rad: the least change of direction that a turn of the rotary axes by
                       ///< 1 rad makes there, as an angle; 0 where an axis turns nothing
  kinematics::AxisVector q;
  int line = 0;
  std::uint16_t file = 0;
};

/// Where the tool is near a pole in moves at feed under a tip mode, and turns the axis that is free
/// there.
struct NearPole {
  double angle = 0.0;    ///< rad, of the tool to that axis, the least
  int axis = 0;          ///< joint that is free at the pole
  int other = 0;         ///< the other rotary joint
  double at = 0.0;       ///< rad, position of `other` in the pole that is nearest
  double turned = 0.0;   ///< rad, of `axis` where the tool is near
  double fastest = 0.0;  ///< rad/s of `axis` there, as programmed
  int line = 0;          ///< of the least angle
  std::uint16_t file = 0;
};

/// Ways and times of the moves of one kind.
struct MoveFigures {
  std::size_t count = 0;
  double seconds = 0.0;    ///< as programmed; of rapids along the way at the rapid speed
  double limited_s = 0.0;  ///< no axis beyond its limit
  double way = 0.0;        ///< mm, of the tip in the workpiece
};

struct PathFigures {
  std::size_t blocks = 0;
  MoveFigures rapids, lines, arcs, cubics, dwells;
  std::vector<AxisFigures> axes;  ///< (joints)
  std::size_t slowed = 0;         ///< moves at feed in which an axis would be beyond its limit
  ValueAtLine max_slowed;         ///< by which factor at most
  int fastest_axis = -1;          ///< the joint that comes nearest to its limit, or goes beyond it
  Eigen::AlignedBox3d feed_w, all_w;  ///< of the tip in the workpiece
  /// Least and largest distance of the tip from the line of the spindle that turns the workpiece at
  /// feed, mm; none where no spindle does.
  std::optional<std::array<double, 2>> radius_at_feed;
  std::optional<SingularPose> singular;  ///< none where no move at feed turns two rotary axes' tool
  std::optional<NearPole> pole;  ///< none where the tool is never near, or nothing turns there
  std::map<int, std::size_t> offsets;  ///< blocks by `Block::work_offset`
  std::map<int, std::size_t> lengths;  ///< blocks by `Block::tool_length`
  std::size_t tip_blocks = 0;          ///< under a tip mode
};

/// mm, to which ways, times and speeds follow the chords of a curved move.
inline constexpr double path_meter_within = 0.01;

/// Looks at a path block by block, as the axes of a machine run it; keeps no blocks.
/// Positions and extents are those of the curves, within 1e-9 mm and rad: an extreme between the
/// places of a move is searched where it may be a new one. An axis that turns back twice between
/// two places, where slides follow rotary axes, may be missed by `path_meter_within`; on arcs,
/// helices and cubics none is. The singular pose is met by minimising along each move that may come
/// nearer, within 1e-7 rad; how an axis turns near a pole is summed over the pieces of moves that
/// come near, so by one piece at most too much at each end.
class PathMeter {
 public:
  /// @param control       outlives it; its limits are those of travel
  /// @param control_of_h  outlives it; chains to the tip of tools of other lengths, by H
  PathMeter(const kinematics::Chain& control, const AxisLimits& limits,
            const std::map<int, kinematics::Chain>* control_of_h = nullptr);

  /// The next blocks. @throws BadInput naming the line where the slides do not reach a tip
  void add(const Path& piece);
  PathFigures figures() const;
  /// Where the last block ended: axes, and the tip in the workpiece.
  const kinematics::AxisVector& axes() const { return q_; }

  /// Called with every place of the tip that is looked at, as for a picture.
  std::function<void(const Eigen::Vector3d& tip_w, bool rapid)> on_tip_point = {};

 private:
  using AxisVector = kinematics::AxisVector;

  bool is_spindle(int j) const { return j == spindle_ || motion(j) == kinematics::Motion::Spindle; }
  kinematics::Motion motion(int j) const { return control_->joints()[std::size_t(j)].motion; }
  double limit(int j) const;
  Eigen::Vector3d tip_position(const Path& path, const Block& block, const AxisVector& q,
                               double u) const;
  bool take_chain_of(const Block& block);
  void begin(const Path& path, const Block& block);
  void move(const Path& path, const Block& block);
  void note_position(const Block& block, const AxisVector& q);
  /// A place of a move, or what an extreme is sought of: axes, then the tip.
  struct MeterPoint {
    double u = 0.0;
    AxisVector q;
    Eigen::Vector3d tip_w;
  };
  MeterPoint place_at(const Path& path, const Block& block, double u) const;
  void note_point(const Block& block, const MeterPoint& place);
  double coordinate(const MeterPoint& place, int k) const;
  bool is_curved(const Block& block, int k) const;
  bool has_extreme_near_end(const Path& path, const Block& block) const;
  bool can_be_new_extreme(const Block& block, double value, int k, double sign) const;
  void note_extremes(const Path& path, const Block& block, const std::array<MeterPoint, 3>& three);
  void note_all_extremes(const Path& path, const Block& block, std::size_t chords);
  void note_speeds(const Block& block, const AxisVector& step, double seconds);
  void note_slowed(const Block& block, double factor);
  void note_singular(const Path& path, const Block& block, double from, double to, double turn);
  void note_pole(const Block& block, const AxisVector& to, double seconds);
  void look_at(const Path& path, const Block& block, double u);
  double singular_angle(const Path& path, const Block& block, double u) const;
  MoveFigures& kind(const Block& block);
  void note_radius();

  const kinematics::Chain* control_;
  const std::map<int, kinematics::Chain>* control_of_h_;
  AxisLimits limits_;
  int spindle_ = -1;
  /// That of the spindle that turns the workpiece, in the workpiece.
  std::optional<Eigen::ParametrizedLine<double, 3>> spindle_line_w_;
  std::array<int, 3> xyz_{-1, -1, -1};  ///< joints; -1 where the machine lacks one
  std::vector<int> rotary_;
  PathFigures figures_;
  AxisVector q_;
  Eigen::Vector3d tip_w_ = Eigen::Vector3d::Zero();
  AxisVector programmed_;  ///< where the last block ended, in `coordinates_`
  Coordinates coordinates_ = Coordinates::Axis;
  double fastest_share_ = 0.0;
};

/// "line 12", or "line 12 of FILE" in another file of the program.
/// @param more_files  as Path has them
std::string line_text(const std::vector<std::string>& more_files, int line, std::uint16_t file);

}  // namespace abbe::sim::program
