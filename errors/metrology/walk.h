#pragma once

#include <functional>
#include <vector>

#include "errors/metrology/stand.h"

namespace abbe::errors::metrology {

/// Axis positions along a path, by one parameter: an axis position, an angle, a part of a diagonal.
using Path = std::function<kinematics::AxisVector(double)>;

/// A state after a motion to q: ways and reversals of the axes that moved. Time is left alone.
kinematics::AxisState moved(kinematics::AxisState state, const kinematics::AxisVector& q);

/// An operator with an instrument at a machine: moves, waits, reads, and writes down the plan.
/// Keeps time, ways of approach and reversals of every axis.
class Walk {
 public:
  Walk(const Instrument& instrument, const kinematics::Chain& nominal,
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
  void back_and_forth(const Path& path, const Range& range, int smoothly = 1,
                      const std::vector<int>& channels = {});

  /// Reads at places in their order, then back if both ways are asked for, as often as there are
  /// runs. @param channels  of a place by its number; none: every one
  void visit(const std::vector<kinematics::AxisVector>& places,
             const std::function<std::vector<int>(int)>& channels = {});

  /// The plan, with the first reading at the instrument's start.
  Plan finish() &&;

 private:
  void go_along(const Path& path, double from, double to, int smoothly);

  const Instrument& instrument_;
  const kinematics::Chain& nominal_;
  kinematics::AxisState state_;
  double time_s_ = 0.0;
  Plan plan_;
};

}  // namespace abbe::errors::metrology
