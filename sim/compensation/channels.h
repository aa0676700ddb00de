#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "kinematics/chain.h"
#include "sim/compensation/time_series.h"

/// Channels that carry a correction to the axes while the program runs, and the position loops that
/// execute it.
namespace abbe::sim::compensation {

/// Model of the response of a position loop to a change of its set-point. The programmed motion is
/// assumed to be fed forward, so only corrections lag.
struct PositionLoop {
  enum class Order {
    None,    ///< without lag
    First,   ///< 1 / (1 + s / w)
    Second,  ///< w^2 / (s^2 + 2 d w s + w^2)
  } order = Order::None;
  double bandwidth = 20.0;  ///< Hz, w / 2 pi
  double damping = 0.7;     ///< d of a second-order loop, 0.001 to 100
};

/// Density and accuracy of a computed loop response.
struct LoopOptions {
  int per_constant = 8;     ///< knots in a time constant 1 / w while the loop still moves
  double tolerance = 1e-8;  ///< mm or rad (0.01 nm); a loop with less motion left is at rest
};

/// Returns the response of a loop that starts at rest on the first value. It has a knot at every
/// knot of the input, and `per_constant` more in a time constant as long as more than `tolerance`
/// of motion remains before it follows steadily; after the last knot, until it has settled. The
/// knots are exact to 1e-8 of a step. Between them the result is linear and deviates by less than 1
/// / (3 per_constant^2) of the remaining motion (8: 0.5 %; damping up to 1) or by twice the
/// tolerance. A ramp of slope v is followed with a lag of v / w (first order) or 2 d v / w (second
/// order).
/// @throws std::invalid_argument if the series is not valid, a bandwidth, damping, tolerance or
///     per_constant is outside its range, or there are more knots than `Knots` takes
TimeSeries loop_response(const TimeSeries& input, const PositionLoop& loop,
                         const LoopOptions& options = {});

// Each channel has its own cycle and limits. The overloads of `apply_channel` take the requested
// correction and return the one that arrives at the axes; cycles count from the first knot of the
// request. All throw std::invalid_argument if a series is not valid, a setting is outside its
// range, or a series is too long for its cycle (2e8 cycles, or more knots than `Knots` takes).

/// Insertion of counts into the encoder signals (Guo 2016, Chen and Wang 2013). It moves an axis by
/// whole counts only, and the position of the zero within a count is unknown. A count is one signal
/// period, whether the control evaluates one edge of it or all four.
struct PulseInsertion {
  Eigen::VectorXd
      count;  ///< (joints) mm or rad per count (signal period); 0: joint without channel
  double cycle_s = 1e-3;  ///< > 0, cycle of the computer that inserts
  /// > 0, duration of an inserted pair, during which A and B of the encoder must be low
  double pulse_s = 2e-6;
  /// Seed of the positions of the zeros, which are uniform over a count.
  std::uint64_t phase_seed = 0;
};

/// Returns the position of the zero of a joint's encoder in counts, uniform over [-1/2, 1/2) for
/// varying seeds.
double zero_phase(std::uint64_t seed, int joint);

/// Returns the correction that arrives through inserted pulses, by the fast model. It is count (n +
/// phase) with n whole. Once all pairs are in, it deviates by at most half a count, uniformly (RMS
/// count / sqrt(12)). n starts at the value closest to the first request. Every cycle the computer
/// rounds the requested correction and asks for one pair more or less. The pair is inserted as soon
/// as A and B are low and stay low for its duration, if that is within the cycle; otherwise the
/// next cycle asks again. The position loop then moves the axis by one count, out of that signal
/// period. At rest with A and B low, one pair is inserted every cycle; at rest with A or B high
/// none; and none if a quarter of a period is shorter than a pair. The model has no lag; apply
/// `loop_response` afterwards. The result ends with the later of the two series. Cost is linear in
/// knots, cycles and pairs, not in signal periods.
/// @param correction  requested for the axis positions; an inserted pair of +1 moves the axis by
///     -count
/// @param motion  (joints) axis positions over time, which determine when A and B are low
/// @return steps; joints without a channel stay at 0
/// @throws std::invalid_argument also for positions or corrections beyond 1e15 counts
TimeSeries apply_channel(const TimeSeries& correction, const PulseInsertion& pulses,
                         const TimeSeries& motion);

/// Correction of the set-points in every servo cycle; the value is held until the next one.
struct OpenControl {
  double cycle_s = 1e-3;  ///< > 0
  double delay_s = 0.0;   ///< >= 0, from reading to acting; may be longer than the cycle
};
/// Returns the correction through an open control. It starts on the first value and ends with the
/// last one.
TimeSeries apply_channel(const TimeSeries& correction, const OpenControl& open);

/// Shift of the external work zero by the PLC, for linear axes only, in whole increments (Guo 2016,
/// Yang 2012). Between cycles the control moves to the new offset at the rate that it allows.
struct OriginShift {
  double cycle_s = 10e-3;   ///< > 0, of the PLC
  double delay_s = 0.0;     ///< >= 0, from reading to acting; may be longer than the cycle
  double increment = 1e-3;  ///< mm, smallest step, rounded to nearest; 0: none
  double rate = 0.0;        ///< mm/s, limit; 0: immediate
};
/// Returns the correction through origin shifts. It starts on the first value, rounded, and ends
/// with the last one; columns of rotary axes and spindles are zero.
/// The error of a ramp of `slope` mm/s is slope sqrt(T^2/3 + T D + D^2) RMS, with the cycle T and
/// the delay D; the increment adds its square over 12 to the mean square.
TimeSeries apply_channel(const TimeSeries& correction, const OriginShift& origin,
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
/// Returns the stroke over time for the component of a requested tool displacement along the
/// direction of the piezo. The range limits the set-points; a loop with damping below 1 may
/// overshoot it.
/// @param displacement_t  (3 columns) mm, correcting displacement of the tip in frame t
/// @return one column, mm along the direction
TimeSeries apply_channel(const TimeSeries& displacement_t, const Piezo& piezo);

/// Returns the deflection of the piezo, mm, to be added to the stroke: a force on the tool along
/// its direction (N, + along the direction) moves the tool by force / stiffness.
/// @throws std::invalid_argument for a stiffness that is not above 0
double piezo_deflection(const Piezo& piezo, double force_along);

}  // namespace abbe::sim::compensation
