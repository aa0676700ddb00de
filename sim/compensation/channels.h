#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

#include "kinematics/chain.h"
#include "sim/compensation/time_series.h"

namespace abbe::sim::compensation {

/// How a position loop follows a change of its set-point. The programmed motion itself is taken as
/// fed forward; only corrections lag.
struct PositionLoop {
  enum class Order {
    None,    ///< at once
    First,   ///< 1 / (1 + s / w)
    Second,  ///< w^2 / (s^2 + 2 d w s + w^2)
  } order = Order::None;
  double bandwidth = 20.0;  ///< Hz, w / 2 pi
  double damping = 0.7;     ///< d of a second-order loop, 0.001 to 100
};

struct LoopOptions {
  int per_constant = 8;     ///< knots a time constant 1 / w while the loop still moves
  double tolerance = 1e-8;  ///< mm or rad: 0.01 nm; what moves by less is at rest
};

/// Answer of a loop that starts at rest on the first value. It has a knot at every instant of the
/// course, and while it still has more than `tolerance` to go before it follows steadily,
/// `per_constant` more a time constant, also after the last until it has settled. Its knots are
/// exact to 1e-8 of a step. Between them, where it is linear, it is off by less than
/// 1 / (3 per_constant^2) of what it has to go (8: 0.5 %; damping up to 1) or by twice the
/// tolerance. A ramp of slope v is followed v / w late (first order) or 2 d v / w (second order).
/// @throws std::invalid_argument for a course that is not valid, a bandwidth, damping, tolerance or
///         per_constant outside its range, or more knots than `Knots` takes
TimeSeries loop_response(const TimeSeries& wanted, const PositionLoop& loop,
                         const LoopOptions& options = {});

// The ways by which a correction reaches the axes while the program runs, each at its own cycle
// and with its own limits. All take the correction that is wanted and return the one that arrives;
// cycles count from the first knot of what is wanted. All throw std::invalid_argument for a course
// that is not valid, a setting outside its range, and a course too long for its cycle (2e8 cycles,
// or more knots than `Knots` takes).

/// Counts added to the encoder signals (Guo 2016, Chen and Wang 2013). The axis can only be moved
/// by whole counts; where within a count its zero lies nobody knows. A count is one signal period,
/// whether the control evaluates one edge of it or all four.
struct Pulses {
  Eigen::VectorXd count;         ///< (joints) mm or rad a count, one signal period; 0: not fitted
  double cycle_s = 1e-3;         ///< > 0, of the computer that inserts
  double pulse_s = 2e-6;         ///< > 0, duration of an inserted pair, which must pass while A and
                                 ///< B are low
  std::uint64_t phase_seed = 0;  ///< draws where the zeros lie; they are uniform over a count
};

/// Where the zero of a joint's encoder lies, in counts: uniform over [-1/2, 1/2) as seeds vary.
/// The signals stand as `quadrature` says for this phase.
double zero_phase(std::uint64_t seed, int joint);

/// The fast model. The correction that arrives is count (n + phase), n whole: so it is off by at
/// most half a count, uniformly, once all pairs are in (RMS count / sqrt(12)). n starts where the
/// first value wants it. Every cycle the computer rounds what is wanted and asks for one pair more
/// or less; it goes in as soon as A and B are low and stay so for its length, during that cycle, or
/// waits for the next one. The position loop then carries the axis on by one count, out of that
/// signal period: at rest with A and B low a pair goes in every cycle, at rest with A or B high
/// none, and none where a quarter of a period lasts less than a pair. The loop is taken as at once
/// here; put `loop_response` after it. Ends with the later of the two courses.
/// Linear in knots, cycles and pairs, not in signal periods.
/// @param wanted  correction of the axis positions; an inserted pair of +1 moves the axis by -count
/// @param motion  (joints) axis positions over time, which say when the trains are low
/// @return steps; joints that are not fitted stay at 0
/// @throws std::invalid_argument also for positions or corrections beyond 1e15 counts
TimeSeries through(const TimeSeries& wanted, const Pulses& pulses, const TimeSeries& motion);

/// Set-points corrected every servo cycle, held in between.
struct OpenControl {
  double cycle_s = 1e-3;  ///< > 0
  double delay_s = 0.0;   ///< >= 0, from reading to acting; may be longer than the cycle
};
/// Starts on the first value, ends with what the last one wants.
TimeSeries through(const TimeSeries& wanted, const OpenControl& open);

/// The external work zero, moved by the PLC: linear axes only, in whole increments, no faster than
/// the control allows (Guo 2016, Yang 2012). Between cycles the control ramps to the new offset at
/// that rate.
struct OriginShift {
  double cycle_s = 10e-3;   ///< > 0, of the PLC
  double delay_s = 0.0;     ///< >= 0, from reading to acting; may be longer than the cycle
  double increment = 1e-3;  ///< mm, least; rounded to nearest; 0: none
  double rate = 0.0;        ///< mm/s, largest; 0: at once
};
/// Starts on the first value, rounded, ends with what the last one wants. Columns of axes that are
/// no slides are zero.
/// A ramp of `slope` mm/s is missed by slope sqrt(T^2/3 + T D + D^2) RMS, T the cycle, D the delay,
/// besides what the increment adds: its square over 12 to the mean square.
TimeSeries through(const TimeSeries& wanted, const OriginShift& origin,
                   std::span<const kinematics::Joint> joints);

/// An actuator that carries the tool along one direction of its own frame (Yang 2012: slow,
/// compliant).
struct Piezo {
  Eigen::Vector3d direction_t = Eigen::Vector3d::UnitZ();  ///< unit to 1e-9
  double range = 0.1;  ///< mm, > 0, whole stroke; half of it either way
  PositionLoop loop = {PositionLoop::Order::Second, 100.0, 0.7};
  double stiffness = 50e3;  ///< N/mm, > 0
  double resolution = 0.0;  ///< mm, rounded to nearest; 0: none
  double cycle_s = 1e-3;    ///< > 0, of its set-points
};
/// Stroke over time for the part of a wanted tool displacement that lies along its direction. The
/// range bounds its set-points; a loop with damping below 1 may swing past it.
/// @param wanted_t  (3 columns) mm, displacement of the tip in frame t that would correct it
/// @return one column, mm along the direction
TimeSeries through(const TimeSeries& wanted_t, const Piezo& piezo);

/// How far the tool gives way along the direction of the piezo, mm: a force on the tool along it
/// (N, + along the direction) carries the tool along with it, force / stiffness. To be added to the
/// stroke. @throws std::invalid_argument for a stiffness that is not above 0
double piezo_deflection(const Piezo& piezo, double force_along);

}  // namespace abbe::sim::compensation
