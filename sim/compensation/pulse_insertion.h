#pragma once

#include <vector>

#include "sim/compensation/time_series.h"

/// Feedback of an incremental encoder at signal level, and the box that inserts pulses into it
/// (Chen and Wang 2013). The fast model of the same is `through` with `Pulses` in channels.h.
namespace abbe::sim::compensation {

/// The levels of two square trains 90 degrees apart; A leads when the axis moves up.
struct QuadratureState {
  bool a = false;
  bool b = false;
};

/// Returns the levels of an encoder at a position. With x = position / period - phase both are low
/// for x - floor(x) below 1/4, then A, both, B, a quarter each.
QuadratureState quadrature(double position, double period, double phase);

/// A change of level.
struct Edge {
  double time_s = 0.0;
  bool is_a = false;
  bool level = false;
};

/// The signals on the two wires.
struct Feedback {
  QuadratureState start;    ///< before the first edge
  std::vector<Edge> edges;  ///< in time; edges at one time in the order they occur
};

/// Returns the feedback of a moving axis, every crossing at its own time.
/// @param motion  mm or rad, one of whose columns is the axis
/// @throws std::invalid_argument if the series is not valid, the period is not above 0, a position
///     is beyond 1e15 periods, or there are more than 1e8 edges
Feedback feedback(const TimeSeries& motion, double period, double phase, int column = 0);

/// Evaluation of a feedback by a control.
enum class Evaluation {
  X1,  ///< every fourth edge: a count is a signal period; B falling counts up, B rising counts
       ///< down, with A low
  X4,  ///< every edge: a count is a quarter; an inserted pair is four of them
};

/// The count since the start, up where A leads; one entry for each change.
struct Count {
  double time_s = 0.0;
  long count = 0;
};
/// Returns the counts of a feedback.
/// @throws std::invalid_argument if an edge changes nothing
std::vector<Count> counts(const Feedback& feedback, Evaluation evaluation = Evaluation::X1);

/// Returns the count at a time; 0 before the first entry.
long count_at(const std::vector<Count>& counts, double time_s);

/// Settings of the box that inserts pulses.
struct InsertionBox {
  bool bypass = false;    ///< the feedback passes unchanged, bit for bit
  double pulse_s = 2e-6;  ///< > 0, length of an inserted pair
};

/// A request: the total number of pairs wanted from a time on.
struct Request {
  double time_s = 0.0;
  long pairs = 0;  ///< + counts up, so the loop moves the axis down
};

/// An inserted pair.
struct Insertion {
  double time_s = 0.0;  ///< rise of its first train
  int direction = 1;    ///< +1: A leads, counts up; -1: B leads
};

/// Returns the pairs that go in: only while A and B are low and stay low for the length of a pair,
/// and one each time they become low, i.e. one in a signal period as the axis passes it. A pair
/// that cannot be inserted yet waits, or is dropped if it is no longer wanted. At rest with A or B
/// high nothing is inserted; at rest with both low one pair, until the loop has moved the axis out
/// of that period.
/// @param requests  at increasing times; before the first none is wanted
/// @throws std::invalid_argument if requests are out of order, a pulse is not above 0, or an edge
///     changes nothing
std::vector<Insertion> insertions(const Feedback& feedback, const std::vector<Request>& requests,
                                  const InsertionBox& box = {});

/// Returns the feedback with the pairs merged in: the leading train is high over the first two
/// thirds of a pair, the other over the last two.
Feedback inserted(const Feedback& feedback, const std::vector<Request>& requests,
                  const InsertionBox& box = {});

}  // namespace abbe::sim::compensation
