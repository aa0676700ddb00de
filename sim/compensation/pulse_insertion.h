#pragma once

#include <vector>

#include "sim/compensation/time_series.h"

/// Simulation at signal level of the feedback of an incremental encoder and of the box that inserts
/// pulses into it (Chen and Wang 2013). The fast model of this channel is `through` with `Pulses`
/// in channels.h.
namespace abbe::sim::compensation {

/// The levels of two square pulse trains 90 degrees apart; A leads if the axis moves up.
struct QuadratureState {
  bool a = false;
  bool b = false;
};

/// Returns the levels of an encoder at a position. With x = position / period - phase and the
/// fraction x - floor(x), none is high in the first quarter, A in the second, both in the third and
/// B in the fourth.
QuadratureState quadrature(double position, double period, double phase);

/// A change of level of one train.
struct Edge {
  double time_s = 0.0;
  bool is_a = false;
  bool level = false;
};

/// The signals of an encoder over time.
struct Feedback {
  QuadratureState start;    ///< before the first edge
  std::vector<Edge> edges;  ///< in the order of time; edges at one time in the order of occurrence
};

/// Returns the feedback of a moving axis, with every edge at the time of its crossing.
/// @param motion  mm or rad; `column` is that of the axis
/// @throws std::invalid_argument if the series is not valid, the period is not above 0, a position
///     is beyond 1e15 periods, or there are more than 1e8 edges
Feedback feedback(const TimeSeries& motion, double period, double phase, int column = 0);

/// Edges of a feedback that a control counts.
enum class Evaluation {
  X1,  ///< with A low, B falling counts up and B rising down: a count is a signal period
  X4,  ///< every edge: a count is a quarter of a period, and an inserted pair is four counts
};

/// The count since the start after a change; it increases if A leads.
struct Count {
  double time_s = 0.0;
  long count = 0;
};
/// Returns the counts of a feedback.
/// @throws std::invalid_argument if an edge does not change its level
std::vector<Count> counts(const Feedback& feedback, Evaluation evaluation = Evaluation::X1);

/// Returns the count at a time; 0 before the first entry.
long count_at(const std::vector<Count>& counts, double time_s);

/// Settings of the box that inserts pulses.
struct InsertionBox {
  bool bypass = false;    ///< passes the feedback unchanged, bit for bit
  double pulse_s = 2e-6;  ///< > 0, duration of an inserted pair
};

/// A request for a total number of pairs from a time on.
struct Request {
  double time_s = 0.0;
  long pairs = 0;  ///< positive pairs count up, so the loop moves the axis down
};

/// An inserted pair.
struct Insertion {
  double time_s = 0.0;  ///< rising edge of its first train
  int direction = 1;    ///< +1: A leads, counts up; -1: B leads
};

/// Returns the pairs that the box inserts. It inserts a pair only while A and B are low and stay
/// low for its duration, and only one pair each time they become low, i.e. one in each signal
/// period that the axis passes. A pair that cannot be inserted yet waits, or is dropped if it is no
/// longer requested. At rest with A or B high no pair is inserted; at rest with both low a single
/// pair, until the loop has moved the axis out of that period.
/// @param requests  at increasing times; before the first one no pair is requested
/// @throws std::invalid_argument if requests are out of order, a duration is not above 0, or an
/// edge
///     does not change its level
std::vector<Insertion> insertions(const Feedback& feedback, const std::vector<Request>& requests,
                                  const InsertionBox& box = {});

/// Returns the feedback with the inserted pairs. The leading train is high during the first two
/// thirds of a pair, the other one during the last two thirds.
Feedback inserted(const Feedback& feedback, const std::vector<Request>& requests,
                  const InsertionBox& box = {});

}  // namespace abbe::sim::compensation
