#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "errors/metrology/instrument.h"

/// The machine as a plan finds it: what its axes are in the workpiece and how far they may go.
namespace abbe::errors::metrology {

/// Positions that a plan uses of one axis or of one parameter of a path, mm or rad.
struct Range {
  double from = 0.0;
  double to = 0.0;
  double overshoot = 0.0;  ///< room at both ends, so that both ways of approach are true ones
};

struct AxisDirection {
  int joint = 0;  ///< index in the chain
  char name = 'X';
  Eigen::Vector3d direction_w;  ///< unit; a positive command moves, or turns, the tool this way
};

/// Where a machine waits: slides in the middle of their travel, rotary axes at 0 or in the middle
/// of a travel without 0, spindles at 0.
struct ParkedMachine {
  kinematics::AxisVector q;
  std::vector<AxisDirection> slides;  ///< by letter, the instrument's choice of them
  std::vector<AxisDirection> rotary;  ///< without spindles, the instrument's choice of them
};

/// @throws std::invalid_argument for an axis in the instrument's list that the machine lacks, or
///         a slide without limits of travel
ParkedMachine stand(const Instrument& instrument, const kinematics::Chain& nominal);

/// The travel of a slide less the margins.
Range travel(const Instrument& instrument, const kinematics::Joint& slide);
/// The instrument's arc, cut to the travel of a rotary axis; a whole turn or more that does not fit
/// is all the travel there is.
Range arc(const Instrument& instrument, const kinematics::Joint& rotary);

/// Targets of a range, equally spaced from the first to the last. (count)
Eigen::VectorXd targets(const Range& range, int count);

/// Two unit vectors across a direction, nearest to axes of the bed with these letters.
struct Across {
  Eigen::Vector3d direction_w[2];
  char letter[2] = {'X', 'Y'};
};
Across across(const kinematics::Chain& nominal, const kinematics::AxisVector& q,
              const Eigen::Vector3d& direction_w);

/// Where the reflector, or the ball, at the tool is in the workpiece.
Eigen::Vector3d reflector_w(const Instrument& instrument, const kinematics::Chain& nominal,
                            const kinematics::AxisVector& q);

/// Point nearest to a place on the line of an axis that turns, in the workpiece at q.
Eigen::Vector3d on_axis(const kinematics::Chain& nominal, const kinematics::AxisVector& q,
                        int joint, const Eigen::Vector3d& place_w);

/// The same axis positions with the slides where they put the reflector; limits not looked at.
/// Empty if the slides that there are cannot. To 1e-9 mm.
/// @param slides  joints that may move; empty: every slide
std::optional<kinematics::AxisVector> slides_for_reflector(const Instrument& instrument,
                                                           const kinematics::Chain& nominal,
                                                           const kinematics::AxisVector& q,
                                                           const Eigen::Vector3d& place_w,
                                                           std::vector<int> slides = {});

/// One axis of a grid and the positions that it takes.
struct GridLine {
  int joint = 0;
  Eigen::VectorXd at;
};
/// Every combination, each a step on one axis from the one before.
/// @throws std::invalid_argument for more than 100000 of them
std::vector<kinematics::AxisVector> grid(const Instrument& instrument,
                                         const kinematics::AxisVector& q,
                                         const std::vector<GridLine>& lines);

bool within_travel(const kinematics::Chain& nominal, const kinematics::AxisVector& q);

/// Whether two slides travel across each other: by more than 6 degrees, so that they make a plane.
bool cross(const AxisDirection& one, const AxisDirection& other);
/// Every two of the slides that do, in their order.
/// @throws std::invalid_argument by the instrument's name if there are none
std::vector<std::array<AxisDirection, 2>> crossing_slides(const Instrument& instrument,
                                                          const ParkedMachine& stand);

/// Refuses a machine with fewer slides, or without a rotary axis, than the kind needs.
void expect_slides(const Instrument& instrument, const ParkedMachine& stand, int count);
void expect_rotary(const Instrument& instrument, const ParkedMachine& stand);

/// Refusal of an instrument by its name and in a sentence.
[[noreturn]] void refuse(const Instrument& instrument, const std::string& sentence);

/// Axis positions along a path, by one parameter: an axis position, an angle, a part of a diagonal.
using Path = std::function<kinematics::AxisVector(double)>;

/// A state after a motion to q: ways and reversals of the axes that moved. Time is left alone.
kinematics::AxisState moved(kinematics::AxisState state, const kinematics::AxisVector& q);

/// An operator with an instrument at a machine: moves, waits, reads, and writes down the plan.
/// Keeps time, ways of approach and reversals of every axis.
class PlanBuilder {
 public:
  PlanBuilder(const Instrument& instrument, const kinematics::Chain& nominal,
              const kinematics::AxisVector& start);

  const kinematics::AxisVector& q() const { return state_.q; }

  /// Takes the time of a set-up; what is read from here on is read with it.
  void set_up(SetUp set_up);
  /// Moves every axis at once to a place.
  /// @throws std::invalid_argument naming the axis whose travel is left
  void move(const kinematics::AxisVector& q);
  /// Waits.
  void wait(double seconds) { time_s_ += seconds; }
  /// Turns a spindle on to an angle (rad) at the instrument's speed.
  void spin(int joint, double angle);
  void stop_spindle(int joint);
  /// The spindle turns at the instrument's speed from now on and is read at one angle.
  void run_spindle();
  /// Reads channels of the set-up, all at once; no list: every one.
  void read(int run, int target, const std::vector<int>& channels = {});

  /// Reads `targets` places of a path up and, if both ways are asked for, down, as often as there
  /// are runs, every place approached from the side of its way.
  /// @param range     of the parameter
  /// @param smoothly  pieces between targets, so that axes reverse where they do on a curved path
  void read_both_directions(const Path& path, const Range& range, int smoothly = 1,
                            const std::vector<int>& channels = {});

  /// Reads at places in their order, then back if both ways are asked for, as often as there are
  /// runs. @param channels  of a place by its number; none: every one
  void visit(const std::vector<kinematics::AxisVector>& places,
             const std::function<std::vector<int>(int)>& channels = {});

  /// The plan, with the first reading at the instrument's start.
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
