#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/instrument.h"

/// Building blocks of measuring plans: axes, travel and directions of a machine, and a builder that
/// records moves and readings.
namespace abbe::errors::metrology {

/// Range of an axis, or of the parameter of a path, that a plan uses; mm or rad.
struct Range {
  double from = 0.0;
  double to = 0.0;
  double overshoot = 0.0;  ///< additional travel at both ends, for an unambiguous direction of
                           ///< approach
};

/// Axis with its direction in the workpiece.
struct AxisDirection {
  int joint = 0;  ///< index in the chain
  char letter = 'X';
  Eigen::Vector3d direction_w;  ///< unit; a positive command moves the tool along it, or turns the
                                ///< tool about it
};

/// Parked machine: slides in the middle of their travel, rotary axes at 0 or in the middle of their
/// travel if it does not include 0, spindles at 0. It holds the axes that do not move while another
/// is measured.
struct ParkedMachine {
  kinematics::AxisVector q;
  std::vector<AxisDirection> slides;       ///< slides that the instrument measures, in alphabetical
                                           ///< order
  std::vector<AxisDirection> rotary_axes;  ///< rotary axes that the instrument measures, without
                                           ///< spindles, in alphabetical order
};

/// Returns the parked machine with the axes to be measured.
/// @throws std::invalid_argument for an axis in the instrument's list that the machine lacks, or a
///         slide without limits of travel
ParkedMachine park(const Instrument& instrument, const kinematics::Chain& nominal);

/// Returns the travel of a slide minus the margins.
Range travel(const Instrument& instrument, const kinematics::Joint& slide);
/// Returns the instrument's arc, clipped to the travel of a rotary axis; an arc of a whole turn or
/// more that exceeds the travel is replaced by the full travel.
Range arc(const Instrument& instrument, const kinematics::Joint& rotary);

/// Returns equally spaced targets (count) from one end of the range to the other.
Eigen::VectorXd targets(const Range& range, int count);

/// Two unit vectors perpendicular to a direction and to each other. Each is close to the bed axis
/// with its letter.
struct CrossDirections {
  Eigen::Vector3d direction_w[2];
  char letter[2] = {'X', 'Y'};
};
/// Returns the directions perpendicular to a direction, for the machine at q.
CrossDirections cross_directions(const kinematics::Chain& nominal, const kinematics::AxisVector& q,
                                 const Eigen::Vector3d& direction_w);

/// Returns the position of the reflector, or ball, at the tool in the workpiece.
Eigen::Vector3d reflector_w(const Instrument& instrument, const kinematics::Chain& nominal,
                            const kinematics::AxisVector& q);

/// Returns the point of a rotary axis that is nearest to a position, in the workpiece at q.
Eigen::Vector3d nearest_axis_point(const kinematics::Chain& nominal,
                                   const kinematics::AxisVector& q, int joint,
                                   const Eigen::Vector3d& position_w);

/// Returns the axis positions with which the slides hold the reflector at a position, accurate to
/// 1e-9 mm, or nothing if the slides cannot reach it. Limits of travel are not checked.
/// @param slides  joints that may move; empty: all slides
std::optional<kinematics::AxisVector> axes_with_reflector_at(const Instrument& instrument,
                                                             const kinematics::Chain& nominal,
                                                             const kinematics::AxisVector& q,
                                                             const Eigen::Vector3d& position_w,
                                                             std::vector<int> slides = {});

/// Axis of a grid with its positions.
struct GridAxis {
  int joint = 0;
  Eigen::VectorXd values;
};
/// Returns all combinations of the positions, in an order in which each step moves one axis by one
/// spacing.
/// @throws std::invalid_argument for more than 100000 combinations
std::vector<kinematics::AxisVector> grid(const Instrument& instrument,
                                         const kinematics::AxisVector& q,
                                         const std::vector<GridAxis>& axes);

/// Returns true if no axis exceeds its travel.
bool is_within_travel(const kinematics::Chain& nominal, const kinematics::AxisVector& q);

/// Returns true if the directions of two slides differ by more than 6 degrees, so that they span a
/// plane.
bool are_crossing(const AxisDirection& a, const AxisDirection& b);
/// Returns all crossing pairs of slides, in their order.
/// @throws std::invalid_argument naming the instrument if there is none
std::vector<std::array<AxisDirection, 2>> crossing_slides(const Instrument& instrument,
                                                          const ParkedMachine& parked);

/// Throws std::invalid_argument if the instrument measures fewer than `count` slides.
void expect_slides(const Instrument& instrument, const ParkedMachine& parked, int count);
/// Throws std::invalid_argument if the instrument measures no rotary axis.
void expect_rotary_axis(const Instrument& instrument, const ParkedMachine& parked);

/// Throws std::invalid_argument with the name of the instrument and a message.
[[noreturn]] void throw_input_error(const Instrument& instrument, const std::string& message);

/// Path: axis positions as a function of one parameter, such as an axis position, an angle or a
/// fraction of a diagonal.
using Path = std::function<kinematics::AxisVector(double)>;

/// Returns the state after a motion to q, with the directions and reversals of the axes that moved.
/// Its time is unchanged.
kinematics::AxisState state_after_move(kinematics::AxisState state,
                                       const kinematics::AxisVector& q);

/// Builder of a measuring plan. It records moves, waits and readings with their time, and with the
/// directions of approach and reversals of every axis.
class PlanBuilder {
 public:
  PlanBuilder(const Instrument& instrument, const kinematics::Chain& nominal,
              const kinematics::AxisVector& start);

  const kinematics::AxisVector& q() const { return state_.q; }

  /// Adds the time of a set-up; the following readings belong to it.
  void set_up(SetUp set_up);
  /// Moves all axes together to a position.
  /// @throws std::invalid_argument naming the axis whose travel is exceeded
  void move(const kinematics::AxisVector& q);
  void wait(double seconds) { time_s_ += seconds; }
  /// Turns a spindle forwards to an angle (rad) at the instrument's speed.
  void turn_spindle(int joint, double angle);
  void stop_spindle(int joint);
  /// Runs the spindle at the instrument's speed from now on. The plan keeps its angle constant in
  /// all readings.
  void run_spindle();
  /// Reads channels of the set-up simultaneously; an empty list means all channels.
  /// @param run     index from 0
  /// @param target  index of the position in its run, the same for both directions of approach
  void read(int run, int target, const std::vector<int>& channels = {});

  /// Reads the instrument's targets on a path upwards and, if bidirectional, downwards, once per
  /// run. Every target is approached in the direction of motion.
  /// @param range             of the path's parameter
  /// @param moves_per_target  number of moves from target to target; on a curved path several, so
  ///                          that axes reverse where the path does
  void read_both_directions(const Path& path, const Range& range, int moves_per_target = 1,
                            const std::vector<int>& channels = {});

  /// Reads at positions in their order, then back if bidirectional, once per run.
  /// @param channels  returns the channels for the index of a position; empty: all channels
  void visit(const std::vector<kinematics::AxisVector>& positions,
             const std::function<std::vector<int>(int)>& channels = {});

  /// Returns the plan, with its first reading at the instrument's start time.
  Plan finish() &&;

 private:
  void move_along(const Path& path, double from, double to, int moves_per_target);

  const Instrument& instrument_;
  const kinematics::Chain& nominal_;
  kinematics::AxisState state_;
  double time_s_ = 0.0;
  Plan plan_;
};

}  // namespace abbe::errors::metrology
