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

/// Positions of one axis, or of one parameter of a path, used by a plan; mm or rad.
struct Range {
  double from = 0.0;
  double to = 0.0;
  double overshoot = 0.0;  ///< extra travel at both ends, so that both directions of approach are
                           ///< unambiguous
};

struct AxisDirection {
  int joint = 0;  ///< index in the chain
  char name = 'X';
  Eigen::Vector3d direction_w;  ///< unit; a positive command moves or turns the tool in this
                                ///< direction
};

/// The waiting position of a machine: slides in the middle of their travel, rotary axes at 0 or in
/// the middle of a travel without 0, spindles at 0.
struct ParkedMachine {
  kinematics::AxisVector q;
  std::vector<AxisDirection> slides;  ///< selected by the instrument, by letter
  std::vector<AxisDirection> rotary;  ///< selected by the instrument, by letter, without spindles
};

/// Returns the waiting position and the axes to be measured.
/// @throws std::invalid_argument for an axis in the instrument's list that the machine lacks, or a
///         slide without limits of travel
ParkedMachine stand(const Instrument& instrument, const kinematics::Chain& nominal);

/// Returns the travel of a slide minus the margins.
Range travel(const Instrument& instrument, const kinematics::Joint& slide);
/// Returns the instrument's arc, clipped to the travel of a rotary axis; a whole turn or more that
/// does not fit becomes the full travel.
Range arc(const Instrument& instrument, const kinematics::Joint& rotary);

/// Returns equally spaced targets from the first to the last (count).
Eigen::VectorXd targets(const Range& range, int count);

/// Two unit vectors across a direction, nearest to the bed axes with these letters.
struct Across {
  Eigen::Vector3d direction_w[2];
  char letter[2] = {'X', 'Y'};
};
Across across(const kinematics::Chain& nominal, const kinematics::AxisVector& q,
              const Eigen::Vector3d& direction_w);

/// Returns the position of the reflector, or ball, at the tool in the workpiece.
Eigen::Vector3d reflector_w(const Instrument& instrument, const kinematics::Chain& nominal,
                            const kinematics::AxisVector& q);

/// Returns the point of a rotary axis that is nearest to a position, in the workpiece at q.
Eigen::Vector3d on_axis(const kinematics::Chain& nominal, const kinematics::AxisVector& q,
                        int joint, const Eigen::Vector3d& place_w);

/// Returns the axis positions with the slides set such that the reflector is at a position; limits
/// are not checked. Empty if the slides cannot reach it. Accurate to 1e-9 mm.
/// @param slides  joints that may move; empty: every slide
std::optional<kinematics::AxisVector> slides_for_reflector(const Instrument& instrument,
                                                           const kinematics::Chain& nominal,
                                                           const kinematics::AxisVector& q,
                                                           const Eigen::Vector3d& place_w,
                                                           std::vector<int> slides = {});

/// One axis of a grid and its positions.
struct GridLine {
  int joint = 0;
  Eigen::VectorXd at;
};
/// Returns all combinations, each one step on one axis from the previous.
/// @throws std::invalid_argument for more than 100000 of them
std::vector<kinematics::AxisVector> grid(const Instrument& instrument,
                                         const kinematics::AxisVector& q,
                                         const std::vector<GridLine>& lines);

bool within_travel(const kinematics::Chain& nominal, const kinematics::AxisVector& q);

/// Returns true if two slides travel across each other, i.e. by more than 6 degrees, so that they
/// span a plane.
bool cross(const AxisDirection& one, const AxisDirection& other);
/// Returns all such pairs of slides, in their order.
/// @throws std::invalid_argument naming the instrument if there are none
std::vector<std::array<AxisDirection, 2>> crossing_slides(const Instrument& instrument,
                                                          const ParkedMachine& stand);

/// Throw unless the machine has the slides, or a rotary axis, that the kind needs.
void expect_slides(const Instrument& instrument, const ParkedMachine& stand, int count);
void expect_rotary(const Instrument& instrument, const ParkedMachine& stand);

/// Throws std::invalid_argument with the name of the instrument and a sentence.
[[noreturn]] void refuse(const Instrument& instrument, const std::string& sentence);

/// Axis positions along a path by one parameter: an axis position, an angle, a fraction of a
/// diagonal.
using Path = std::function<kinematics::AxisVector(double)>;

/// Returns the state after a motion to q, with directions and reversals of the axes that moved. The
/// time is unchanged.
kinematics::AxisState moved(kinematics::AxisState state, const kinematics::AxisVector& q);

/// Recorder of a measuring plan: an operator with an instrument who moves, waits and reads. Keeps
/// time, directions of approach and reversals of every axis.
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
  /// Waits.
  void wait(double seconds) { time_s_ += seconds; }
  /// Turns a spindle on to an angle (rad) at the instrument's speed.
  void spin(int joint, double angle);
  void stop_spindle(int joint);
  /// Lets the spindle turn at the instrument's speed from now on; it is read at one angle.
  void run_spindle();
  /// Reads channels of the set-up simultaneously; empty list: all.
  void read(int run, int target, const std::vector<int>& channels = {});

  /// Reads `targets` positions of a path upwards and, if bidirectional, downwards, once per run,
  /// every position approached in the direction of motion.
  /// @param range     of the parameter
  /// @param smoothly  moves between targets, so that axes reverse where they do on a curved path
  void read_both_directions(const Path& path, const Range& range, int smoothly = 1,
                            const std::vector<int>& channels = {});

  /// Reads at positions in their order, then back if bidirectional, once per run.
  /// @param channels  channels by number of the position; empty: all
  void visit(const std::vector<kinematics::AxisVector>& places,
             const std::function<std::vector<int>(int)>& channels = {});

  /// Returns the plan, with its first reading at the instrument's start time.
  Plan finish() &&;

 private:
  void move_along(const Path& path, double from, double to, int smoothly);

  const Instrument& instrument_;
  const kinematics::Chain& nominal_;
  kinematics::AxisState state_;
  double time_s_ = 0.0;
  Plan plan_;
};

}  // namespace abbe::errors::metrology
