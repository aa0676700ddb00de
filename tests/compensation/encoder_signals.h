#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "kinematics/units.h"
#include "sim/compensation/time_series.h"

/// The feedback of an incremental encoder at signal level, and of the box that inserts pulses into
/// it (Chen and Wang 2013), edge by edge: what the fast model, `apply_channel` with
/// `PulseInsertion` in channels.h, is held against.
namespace abbe::sim::compensation {

/// The levels of two square pulse trains 90 degrees apart; A leads if the axis moves up.
struct QuadratureState {
  bool a = false;
  bool b = false;
};

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

inline constexpr double max_periods = 1e15;  // up to here doubles resolve a quarter of a period
inline constexpr std::size_t max_edges = 100'000'000;

/// Returns the quarter of the signal period, 0..3: both low, A, both, B.
inline int quarter_of(const QuadratureState& state) {
  return state.a ? (state.b ? 2 : 1) : (state.b ? 3 : 0);
}

inline QuadratureState state_of(double quarter) {
  const int q = int(quarter - 4.0 * std::floor(quarter / 4.0));
  return {q == 1 || q == 2, q == 2 || q == 3};
}

inline double position_in_quarters(double position, double period, double phase) {
  return 4.0 * (position / period - phase);
}

/// Returns the edge between neighbouring quarters, i.e. that of the train whose level differs.
inline Edge make_edge(double quarter, double from, double time_s) {
  const QuadratureState before = state_of(from), after = state_of(quarter);
  const bool is_a = before.a != after.a;
  return {time_s, is_a, is_a ? after.a : after.b};
}

inline QuadratureState apply_edge(QuadratureState state, const Edge& edge) {
  bool& level = edge.is_a ? state.a : state.b;
  if (level == edge.level)
    throw std::invalid_argument("an encoder edge does not change the level at " +
                                std::to_string(edge.time_s) + " s");
  level = edge.level;
  return state;
}

/// A time range in which both trains are low.
struct LowInterval {
  double begin_s, end_s;
};

inline std::vector<LowInterval> low_intervals(const Feedback& feedback) {
  std::vector<LowInterval> intervals;
  QuadratureState state = feedback.start;
  double begin_s = -infinity;
  for (const Edge& edge : feedback.edges) {
    if (quarter_of(state) == 0) intervals.push_back({begin_s, edge.time_s});
    state = apply_edge(state, edge);
    begin_s = edge.time_s;
  }
  if (quarter_of(state) == 0) intervals.push_back({begin_s, infinity});
  return intervals;
}

inline void validate(const std::vector<Request>& requests, const InsertionBox& box) {
  if (!(box.pulse_s > 0.0) || !std::isfinite(box.pulse_s))
    throw std::invalid_argument("an insertion box expects a pulse above 0");
  for (std::size_t i = 0; i < requests.size(); ++i)
    if (!std::isfinite(requests[i].time_s) ||
        (i > 0 && requests[i].time_s <= requests[i - 1].time_s))
      throw std::invalid_argument("an insertion box expects requests at increasing times");
}

/// Returns the levels of an encoder at a position. With x = position / period - phase and the
/// fraction x - floor(x), none is high in the first quarter, A in the second, both in the third and
/// B in the fourth.
inline QuadratureState quadrature(double position, double period, double phase) {
  return state_of(std::floor(position_in_quarters(position, period, phase)));
}

/// Returns the feedback of a moving axis, with every edge at the time of its crossing.
/// @param motion  mm or rad; `column` is that of the axis
/// @throws std::invalid_argument if the series is not valid, the period is not above 0, a position
///     is beyond 1e15 periods, or there are more than 1e8 edges
inline Feedback feedback(const TimeSeries& motion, double period, double phase, int column = 0) {
  validate(motion, "encoder feedback");
  if (!(period > 0.0) || !std::isfinite(period) || !std::isfinite(phase))
    throw std::invalid_argument("encoder feedback: expected a period above 0 and a finite phase");
  if (column < 0 || column >= motion.value.cols())
    throw std::invalid_argument("encoder feedback: the motion has no such column");
  const auto quarters_at = [&](Eigen::Index knot) {
    const double g = position_in_quarters(motion.value(knot, column), period, phase);
    if (!(std::abs(g) <= 4.0 * max_periods))
      throw std::invalid_argument("encoder feedback: more than 1e15 periods from zero");
    return g;
  };
  double g0 = quarters_at(0);
  Feedback result{state_of(std::floor(g0)), {}};
  for (Eigen::Index i = 1; i < motion.time_s.size(); ++i) {
    const double g1 = quarters_at(i), t0 = motion.time_s[i - 1], t1 = motion.time_s[i];
    const double from = std::floor(g0), to = std::floor(g1), step = to > from ? 1.0 : -1.0;
    if (double(result.edges.size()) + std::abs(to - from) > double(max_edges))
      throw std::invalid_argument("encoder feedback: more than 1e8 edges");
    // Each crossing of a boundary between quarters is an edge.
    for (double quarter = from; quarter != to; quarter += step) {
      const double boundary = step > 0.0 ? quarter + 1.0 : quarter;
      const double time_s = t0 + (boundary - g0) / (g1 - g0) * (t1 - t0);
      result.edges.push_back(make_edge(quarter + step, quarter, time_s));
    }
    g0 = g1;
  }
  return result;
}

/// Returns the counts of a feedback.
/// @throws std::invalid_argument if an edge does not change its level
inline std::vector<Count> counts(const Feedback& feedback, Evaluation evaluation = Evaluation::X1) {
  std::vector<Count> result;
  QuadratureState state = feedback.start;
  // X4 counts from the first quarter, X1 from the first period.
  long quarter = quarter_of(state);
  const long start = quarter;
  const auto count_at_quarter = [&](long quarters_now) {
    return evaluation == Evaluation::X4 ? quarters_now - start : quarters_now >> 2;
  };
  for (const Edge& edge : feedback.edges) {
    const long previous_count = count_at_quarter(quarter);
    const int previous_quarter = quarter_of(state);
    state = apply_edge(state, edge);
    // Modulo 4, a difference of one quarter is upwards; the other neighbour is downwards.
    quarter += (quarter_of(state) - previous_quarter + 4) % 4 == 1 ? 1 : -1;
    if (count_at_quarter(quarter) != previous_count)
      result.push_back({edge.time_s, count_at_quarter(quarter)});
  }
  return result;
}

/// Returns the count at a time; 0 before the first entry.
inline long count_at(const std::vector<Count>& counts, double time_s) {
  const auto next = std::upper_bound(counts.begin(), counts.end(), time_s,
                                     [](double t, const Count& c) { return t < c.time_s; });
  return next == counts.begin() ? 0 : std::prev(next)->count;
}

/// Returns the pairs that the box inserts. It inserts a pair only while A and B are low and stay
/// low for its duration, and only one pair each time they become low, i.e. one in each signal
/// period that the axis passes. A pair that cannot be inserted yet waits, or is dropped if it is no
/// longer requested. At rest with A or B high no pair is inserted; at rest with both low a single
/// pair, until the loop has moved the axis out of that period.
/// @param requests  at increasing times; before the first one no pair is requested
/// @throws std::invalid_argument if requests are out of order, a duration is not above 0, or an
///     edge does not change its level
inline std::vector<Insertion> insertions(const Feedback& feedback,
                                         const std::vector<Request>& requests,
                                         const InsertionBox& box = {}) {
  validate(requests, box);
  std::vector<Insertion> result;
  if (box.bypass) return result;
  long inserted_pairs = 0;
  std::size_t next = 0;  // first request after the current time
  for (const LowInterval& interval : low_intervals(feedback)) {
    while (next < requests.size() && requests[next].time_s <= interval.begin_s) ++next;
    double time_s = interval.begin_s;
    // Requests that change nothing or are withdrawn later in this interval are skipped.
    while (next < requests.size() && (next == 0 || requests[next - 1].pairs == inserted_pairs) &&
           requests[next].time_s < interval.end_s)
      time_s = requests[next++].time_s;
    const long missing_pairs = next == 0 ? 0 : requests[next - 1].pairs - inserted_pairs;
    if (missing_pairs == 0 || !(time_s + box.pulse_s <= interval.end_s)) continue;
    result.push_back({time_s, missing_pairs > 0 ? 1 : -1});
    inserted_pairs += result.back().direction;
  }
  return result;
}

/// Returns the feedback with the inserted pairs. The leading train is high during the first two
/// thirds of a pair, the other one during the last two thirds.
inline Feedback inserted(const Feedback& feedback, const std::vector<Request>& requests,
                         const InsertionBox& box = {}) {
  Feedback result{feedback.start, {}};
  auto edge = feedback.edges.begin();
  for (const Insertion& pair : insertions(feedback, requests, box)) {
    // An edge at the time of a pair is the one that made both trains low, so it comes first.
    while (edge != feedback.edges.end() && edge->time_s <= pair.time_s)
      result.edges.push_back(*edge++);
    const bool is_a_first = pair.direction > 0;
    const double third_s = box.pulse_s / 3.0;
    result.edges.push_back({pair.time_s, is_a_first, true});
    result.edges.push_back({pair.time_s + third_s, !is_a_first, true});
    result.edges.push_back({pair.time_s + 2.0 * third_s, is_a_first, false});
    result.edges.push_back({pair.time_s + box.pulse_s, !is_a_first, false});
  }
  result.edges.insert(result.edges.end(), edge, feedback.edges.end());
  return result;
}

}  // namespace abbe::sim::compensation
