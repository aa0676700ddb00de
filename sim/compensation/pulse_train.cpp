#include "sim/compensation/pulse_train.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "kinematics/numbers.h"

namespace abbe::sim::compensation {
namespace {

constexpr double most_periods = 1e15;  // a quarter of a period is still resolved
constexpr std::size_t most_edges = 100'000'000;

/// Quarter of its signal period, 0..3: low-low, A, both, B.
int quarter_of(const QuadratureState& state) {
  return state.a ? (state.b ? 2 : 1) : (state.b ? 3 : 0);
}

QuadratureState state_of(double quarter) {
  const int q = int(quarter - 4.0 * std::floor(quarter / 4.0));
  return {q == 1 || q == 2, q == 2 || q == 3};
}

double quarters(double position, double period, double phase) {
  return 4.0 * (position / period - phase);
}

/// The one train that differs between neighbouring quarters.
Edge edge_into(double quarter, double from, double time_s) {
  const QuadratureState before = state_of(from), after = state_of(quarter);
  const bool is_a = before.a != after.a;
  return {time_s, is_a, is_a ? after.a : after.b};
}

QuadratureState after(QuadratureState state, const Edge& edge) {
  bool& train = edge.is_a ? state.a : state.b;
  if (train == edge.level)
    throw std::invalid_argument("an edge of an encoder changes nothing at " +
                                std::to_string(edge.time_s) + " s");
  train = edge.level;
  return state;
}

/// Times between which both trains are low.
struct Stay {
  double begin_s, end_s;
};

std::vector<Stay> stays_low(const Feedback& feedback) {
  std::vector<Stay> stays;
  QuadratureState state = feedback.start;
  double begin_s = -infinity;
  for (const Edge& edge : feedback.edges) {
    if (quarter_of(state) == 0) stays.push_back({begin_s, edge.time_s});
    state = after(state, edge);
    begin_s = edge.time_s;
  }
  if (quarter_of(state) == 0) stays.push_back({begin_s, infinity});
  return stays;
}

void validate(const std::vector<Request>& requests, const InsertionBox& box) {
  if (!(box.pulse_s > 0.0) || !std::isfinite(box.pulse_s))
    throw std::invalid_argument("an insertion box expects a pulse above 0");
  for (std::size_t i = 0; i < requests.size(); ++i)
    if (!std::isfinite(requests[i].time_s) ||
        (i > 0 && requests[i].time_s <= requests[i - 1].time_s))
      throw std::invalid_argument("an insertion box expects requests at increasing times");
}

}  // namespace

QuadratureState quadrature(double position, double period, double phase) {
  return state_of(std::floor(quarters(position, period, phase)));
}

Feedback feedback(const Course& motion, double period, double phase, int column) {
  validate(motion, "encoder feedback");
  if (!(period > 0.0) || !std::isfinite(period) || !std::isfinite(phase))
    throw std::invalid_argument("encoder feedback: expected a period above 0 and a finite phase");
  if (column < 0 || column >= motion.value.cols())
    throw std::invalid_argument("encoder feedback: the motion has no such column");
  const auto at = [&](Eigen::Index knot) {
    const double g = quarters(motion.value(knot, column), period, phase);
    if (!(std::abs(g) <= 4.0 * most_periods))
      throw std::invalid_argument("encoder feedback: more than 1e15 periods from zero");
    return g;
  };
  double g0 = at(0);
  Feedback result{state_of(std::floor(g0)), {}};
  for (Eigen::Index i = 1; i < motion.time_s.size(); ++i) {
    const double g1 = at(i), t0 = motion.time_s[i - 1], t1 = motion.time_s[i];
    const double from = std::floor(g0), to = std::floor(g1), step = to > from ? 1.0 : -1.0;
    if (double(result.edges.size()) + std::abs(to - from) > double(most_edges))
      throw std::invalid_argument("encoder feedback: more than 1e8 edges");
    for (double quarter = from; quarter != to; quarter += step) {
      const double boundary = step > 0.0 ? quarter + 1.0 : quarter;
      const double time_s = t0 + (boundary - g0) / (g1 - g0) * (t1 - t0);
      result.edges.push_back(edge_into(quarter + step, quarter, time_s));
    }
    g0 = g1;
  }
  return result;
}

std::vector<Count> counts(const Feedback& feedback, Evaluation evaluation) {
  std::vector<Count> result;
  QuadratureState state = feedback.start;
  // X4 counts from the quarter in which it starts, X1 from the period.
  long quarter = quarter_of(state);
  const long start = quarter;
  const auto count_of = [&](long quarters_now) {
    return evaluation == Evaluation::X4 ? quarters_now - start : quarters_now >> 2;
  };
  for (const Edge& edge : feedback.edges) {
    const long before = count_of(quarter);
    const int from = quarter_of(state);
    state = after(state, edge);
    quarter += (quarter_of(state) - from + 4) % 4 == 1 ? 1 : -1;
    if (count_of(quarter) != before) result.push_back({edge.time_s, count_of(quarter)});
  }
  return result;
}

long count_at(const std::vector<Count>& counts, double time_s) {
  const auto next = std::upper_bound(counts.begin(), counts.end(), time_s,
                                     [](double t, const Count& c) { return t < c.time_s; });
  return next == counts.begin() ? 0 : std::prev(next)->count;
}

std::vector<Insertion> insertions(const Feedback& feedback, const std::vector<Request>& requests,
                                  const InsertionBox& box) {
  validate(requests, box);
  std::vector<Insertion> result;
  if (box.bypass) return result;
  long done = 0;
  std::size_t next = 0;  // first request after the instant looked at
  for (const Stay& stay : stays_low(feedback)) {
    while (next < requests.size() && requests[next].time_s <= stay.begin_s) ++next;
    double time_s = stay.begin_s;
    while (next < requests.size() && (next == 0 || requests[next - 1].pairs == done) &&
           requests[next].time_s < stay.end_s)
      time_s = requests[next++].time_s;
    const long left = next == 0 ? 0 : requests[next - 1].pairs - done;
    if (left == 0 || !(time_s + box.pulse_s <= stay.end_s)) continue;
    result.push_back({time_s, left > 0 ? 1 : -1});
    done += result.back().direction;
  }
  return result;
}

Feedback inserted(const Feedback& feedback, const std::vector<Request>& requests,
                  const InsertionBox& box) {
  Feedback result{feedback.start, {}};
  auto edge = feedback.edges.begin();
  for (const Insertion& pair : insertions(feedback, requests, box)) {
    // An edge at the very begin of a pair is the one that made both trains low.
    while (edge != feedback.edges.end() && edge->time_s <= pair.time_s)
      result.edges.push_back(*edge++);
    const bool leads = pair.direction > 0;
    const double third_s = box.pulse_s / 3.0;
    result.edges.push_back({pair.time_s, leads, true});
    result.edges.push_back({pair.time_s + third_s, !leads, true});
    result.edges.push_back({pair.time_s + 2.0 * third_s, leads, false});
    result.edges.push_back({pair.time_s + box.pulse_s, !leads, false});
  }
  result.edges.insert(result.edges.end(), edge, feedback.edges.end());
  return result;
}

}  // namespace abbe::sim::compensation
