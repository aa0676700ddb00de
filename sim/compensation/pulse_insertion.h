#pragma once

#include <vector>

#include "sim/compensation/time_series.h"

/// Feedback of an incremental encoder at signal level, and the box that inserts pulses into it
/// (Chen and Wang 2013). The fast model of the same is `through(…, const Pulses&, …)`.
namespace abbe::sim::compensation {

/// Two square trains, 90 degrees apart; A leads where the axis moves up.
struct QuadratureState {
  bool a = false;
  bool b = false;
};

/// What an encoder of a signal period says at a position: with x = position / period - phase, both
/// low for x - floor(x) below 1/4, then A, both, B, each a quarter.
QuadratureState quadrature(double position, double period, double phase);

/// One change of level.
struct Edge {
  double time_s = 0.0;
  bool is_a = false;
  bool level = false;
};

/// What comes over the two wires.
struct Feedback {
  QuadratureState start;    ///< before the first edge
  std::vector<Edge> edges;  ///< in time; edges at one instant in the order in which they come
};

/// Feedback of an axis that moves so: every crossing at its own instant.
/// @param motion  mm or rad, one of whose columns is the axis
/// @throws std::invalid_argument for a course that is not valid, a period that is not above 0,
///         positions beyond 1e15 periods or more than 1e8 edges
Feedback feedback(const TimeSeries& motion, double period, double phase, int column = 0);

/// How a control evaluates a feedback.
enum class Evaluation {
  X1,  ///< every fourth edge: a count is a signal period, B falling up, B rising down, A low
  X4,  ///< every edge: a count is a quarter; an inserted pair is four of them
};

/// Counts since the start, up where A leads; one entry a change.
struct Count {
  double time_s = 0.0;
  long count = 0;
};
/// @throws std::invalid_argument for an edge that changes nothing
std::vector<Count> counts(const Feedback& feedback, Evaluation evaluation = Evaluation::X1);

/// Count at an instant; 0 before the first.
long count_at(const std::vector<Count>& counts, double time_s);

struct InsertionBox {
  bool bypass = false;    ///< the feedback passes through untouched, bit for bit
  double pulse_s = 2e-6;  ///< > 0, of an inserted pair
};

/// A request: so many pairs in all since the start are wanted from then on.
struct Request {
  double time_s = 0.0;
  long pairs = 0;  ///< + counts up, so the loop moves the axis down
};

/// A pair that goes in.
struct Insertion {
  double time_s = 0.0;  ///< when its first train rises
  int direction = 1;    ///< +1: A leads, counts up; -1: B leads
};

/// Pairs that go in: only while A and B are low and stay low for the length of a pair, and one each
/// time that they become low, so one in a signal period as the axis passes it. What cannot be
/// inserted yet waits, or is dropped if it is no longer wanted; at rest with A or B high nothing is
/// inserted, at rest with both low one pair, until the loop has moved the axis out of that period.
/// @param requests  at increasing times; before the first, none is wanted
/// @throws std::invalid_argument for requests out of order, a pulse that is not above 0, or an edge
///         that changes nothing
std::vector<Insertion> insertions(const Feedback& feedback, const std::vector<Request>& requests,
                                  const InsertionBox& box = {});

/// The feedback with those pairs merged in: the leading train is high over the first two thirds of
/// a pair, the other over the last two.
Feedback inserted(const Feedback& feedback, const std::vector<Request>& requests,
                  const InsertionBox& box = {});

}  // namespace abbe::sim::compensation
