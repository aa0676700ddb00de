#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "kinematics/chain.h"
#include "sim/compensation/time_series.h"

/// Channels that carry a correction to the axes while the program runs, and the position loop
/// behind them.
namespace abbe::sim::compensation {

/// The response of a position loop to a change of its set-point. The programmed motion is taken as
/// fed forward; only corrections lag.
struct PositionLoop {
  enum class Order {
    None,    ///< without lag
    First,   ///< 1 / (1 + s / w)
    Second,  ///< w^2 / (s^2 + 2 d w s + w^2)
  } order = Order::None;
  double bandwidth = 20.0;  ///< Hz, w / 2 pi
  double damping = 0.7;     ///< d of a second-order loop, 0.001 to 100
};

/// Density and accuracy of the response of a position loop.
struct LoopOptions {
  int per_constant = 8;     ///< knots in a time constant 1 / w while the loop still moves
  double tolerance = 1e-8;  ///< mm or rad: 0.01 nm; a loop with less to go is at rest
};

/// Returns the response of a loop that starts at rest on the first value. It has a knot at every
/// knot of the input, and `per_constant` more in a time constant while it has more than `tolerance`
/// to go before it follows steadily, also after the last knot until it has settled. The knots are
/// exact to 1e-8 of a step. Between them, where the result is linear, it is off by less than 1 / (3
/// per_constant^2) of what is still to go (8: 0.5 %; damping up to 1) or by twice the tolerance. A
/// ramp of slope v is followed with a lag of v / w (first order) or 2 d v / w (second order).
/// @throws std::invalid_argument if the series is not valid, a bandwidth, damping, tolerance or
///     per_constant is outside its range, or there are more knots than `Knots` takes
TimeSeries loop_response(const TimeSeries& wanted, const PositionLoop& loop,
                         const LoopOptions& options = {});

// The channels, each with its own cycle and limits. All take the wanted correction and return the
// one that arrives; cycles count from the first knot of the wanted correction. All throw
// std::invalid_argument if a series is not valid, a setting is outside its range, or a series is
// too long for its cycle (2e8 cycles, or more knots than `Knots` takes).

/// Insertion of counts into the encoder signals (Guo 2016, Chen and Wang 2013). The axis can only
/// be moved by whole counts, and the position of its zero within a count is unknown. A count is one
/// signal period, whether the control evaluates one edge of it or all four.
struct Pulses {
  Eigen::VectorXd count;  ///< (joints) mm or rad per count, one signal period; 0: not fitted
  double cycle_s = 1e-3;  ///< > 0, cycle of the computer that inserts
  double pulse_s = 2e-6;  ///< > 0, duration of an inserted pair, which must pass while A and B are
                          ///< low
  std::uint64_t phase_seed = 0;  ///< seed of the positions of the zeros, which are uniform over a
                                 ///< count
};

/// Returns the position of the zero of a joint's encoder in counts: uniform over [-1/2, 1/2) as
/// seeds vary. The signals are as `quadrature` gives for this phase.
double zero_phase(std::uint64_t seed, int joint);

/// Returns the correction that arrives through inserted pulses; the fast model. It is count (n +
/// phase) with n whole, so once all pairs are in it is off by at most half a count, uniformly (RMS
/// count / sqrt(12)). n starts at the value closest to the first wanted one. Every cycle the
/// computer rounds the wanted correction and requests one pair more or less; the pair goes in as
/// soon as A and B are low and stay low for its length, during that cycle, or waits for the next
/// one. The position loop then moves the axis by one count, out of that signal period: at rest with
/// A and B low a pair goes in every cycle, at rest with A or B high none, and none where a quarter
/// of a period is shorter than a pair. The loop has no lag here; apply `loop_response` afterwards.
/// The result ends with the later of the two series.
/// Cost is linear in knots, cycles and pairs, not in signal periods.
/// @param wanted  correction of the axis positions; an inserted pair of +1 moves the axis by -count
/// @param motion  (joints) axis positions over time, which determine when the trains are low
/// @return steps; joints that are not fitted stay at 0
/// @throws std::invalid_argument also for positions or corrections beyond 1e15 counts
TimeSeries through(const TimeSeries& wanted, const Pulses& pulses, const TimeSeries& motion);

/// Correction of the set-points in every servo cycle, held in between.
struct OpenControl {
  double cycle_s = 1e-3;  ///< > 0
  double delay_s = 0.0;   ///< >= 0, from reading to acting; may be longer than the cycle
};
/// Returns the correction through an open control. It starts on the first value and ends with the
/// last one.
TimeSeries through(const TimeSeries& wanted, const OpenControl& open);

/// Shift of the external work zero by the PLC: linear axes only, in whole increments, at the rate
/// that the control allows (Guo 2016, Yang 2012). Between cycles the control moves to the new
/// offset at that rate.
struct OriginShift {
  double cycle_s = 10e-3;   ///< > 0, of the PLC
  double delay_s = 0.0;     ///< >= 0, from reading to acting; may be longer than the cycle
  double increment = 1e-3;  ///< mm, smallest step, rounded to nearest; 0: none
  double rate = 0.0;        ///< mm/s, limit; 0: immediate
};
/// Returns the correction through origin shifts. It starts on the first value, rounded, and ends
/// with the last one; columns of axes other than slides are zero.
/// A ramp of `slope` mm/s is missed by slope sqrt(T^2/3 + T D + D^2) RMS, T the cycle, D the delay;
/// the increment adds its square over 12 to the mean square.
TimeSeries through(const TimeSeries& wanted, const OriginShift& origin,
                   std::span<const kinematics::Joint> joints);

/// An actuator that moves the tool along one direction of its own frame (Yang 2012: slow,
/// compliant).
struct Piezo {
  Eigen::Vector3d direction_t = Eigen::Vector3d::UnitZ();  ///< unit to 1e-9
  double range = 0.1;  ///< mm, > 0, whole stroke; half of it in either direction
  PositionLoop loop = {PositionLoop::Order::Second, 100.0, 0.7};
  double stiffness = 50e3;  ///< N/mm, > 0
  double resolution = 0.0;  ///< mm, rounded to nearest; 0: none
  double cycle_s = 1e-3;    ///< > 0, cycle of its set-points
};
/// Returns the stroke over time for the component of a wanted tool displacement along the direction
/// of the piezo. The range limits the set-points; a loop with damping below 1 may overshoot it.
/// @param wanted_t  (3 columns) mm, correcting displacement of the tip in frame t
/// @return one column, mm along the direction
TimeSeries through(const TimeSeries& wanted_t, const Piezo& piezo);

/// Returns the deflection of the piezo, mm, to be added to the stroke: a force on the tool along
/// its direction (N, + along the direction) moves the tool by force / stiffness.
/// @throws std::invalid_argument for a stiffness that is not above 0
double piezo_deflection(const Piezo& piezo, double force_along);

}  // namespace abbe::sim::compensation
