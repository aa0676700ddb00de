#include "sim/compensation/channels.h"
#include "tests/compensation/courses.h"
#include "tests/compensation/encoder_signals.h"
#include "tests/test.h"

namespace abbe::sim::compensation {
namespace {

using testing_courses::before;
using testing_courses::course;
using testing_courses::Knot;
using Order = PositionLoop::Order;

constexpr double signal_period = 1e-3;  // mm

bool same(const Edge& a, const Edge& b) {
  return a.time_s == b.time_s && a.is_a == b.is_a && a.level == b.level;
}

/// Whole signal periods by the position alone.
long periods(double position, double phase) {
  return long(std::floor(position / signal_period - phase));
}

/// Rests, crawls, runs and reversals, with many knots or few.
TimeSeries any_motion(std::mt19937& random, double duration_s, int knots) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::vector<Knot> result = {{0.0, unit(random)}};
  for (int i = 1; i < knots; ++i) {
    const double t = duration_s * i / (knots - 1), dt = duration_s / (knots - 1);
    double speed = 0.0;  // periods a second
    if (unit(random) > -0.4) speed = unit(random) * std::pow(10.0, 1.5 + 1.7 * unit(random));
    result.push_back({t, result.back().value + speed * dt * signal_period});
  }
  return course(result);
}

constexpr double hair_s = 1e-12;  // far above rounding, far below a pair

/// The axis with each pair carried out by the loop: a hair after the pair has ended it starts off,
/// and has moved by one period when `travel_s` has passed.
TimeSeries carried(const TimeSeries& motion, const std::vector<Insertion>& pairs, double pulse_s,
                   double travel_s) {
  std::vector<double> times(motion.time_s.begin(), motion.time_s.end());
  for (const Insertion& pair : pairs) {
    times.push_back(pair.time_s + pulse_s + hair_s);
    times.push_back(pair.time_s + pulse_s + hair_s + travel_s);
  }
  std::sort(times.begin(), times.end());
  std::vector<Knot> knots;
  const auto at = [&](double t, bool after) {
    double x = value_at(motion, t)[0];
    for (const Insertion& pair : pairs) {
      const double since = t - (pair.time_s + pulse_s + hair_s);
      double done = since > travel_s || (after && since >= travel_s) ? 1.0 : 0.0;
      if (travel_s > 0.0) done = std::clamp(since / travel_s, 0.0, 1.0);
      x -= done * pair.direction * signal_period;
    }
    return x;
  };
  for (std::size_t i = 0; i < times.size(); ++i) {
    knots.push_back({times[i], at(times[i], false)});
    if (at(times[i], true) != knots.back().value) knots.push_back({times[i], at(times[i], true)});
  }
  return course(knots);
}

/// What happens at the machine, signal by signal.
struct SignalLevel {
  TimeSeries axis;  ///< where it really goes
  std::vector<Insertion> pairs;
  std::vector<Count> control;  ///< what the control counts
  std::vector<Count> encoder;  ///< what the encoder alone would have reported
};

/// Encoder, box, computer and loop in a ring. What goes in at one instant depends only on what went
/// in before it, so the ring is closed pair by pair.
SignalLevel ring(const TimeSeries& wanted, const TimeSeries& motion, const PulseInsertion& pulses,
                 double travel_s) {
  const double phase = zero_phase(pulses.phase_seed, 0), start = wanted.time_s[0];
  const auto whole = [&](double correction) {
    return long(std::round(correction / signal_period - phase));
  };
  const InsertionBox box{false, pulses.pulse_s};
  SignalLevel level;
  for (;;) {
    level.axis = carried(motion, level.pairs, pulses.pulse_s, travel_s);
    const Feedback encoder = feedback(level.axis, signal_period, phase);
    std::vector<Request> requests;
    const double end = motion.time_s.tail<1>()[0];
    for (int k = 0; start + k * pulses.cycle_s < end; ++k) {
      const double t = start + k * pulses.cycle_s;
      long done = 0;
      for (const Insertion& pair : level.pairs)
        if (pair.time_s < t) done += pair.direction;
      // A correction of +1 count needs a pair of -1.
      const long left = -(whole(value_at(wanted, t)[0]) - whole(wanted.value(0, 0))) - done;
      requests.push_back({t, done + std::clamp(left, -1L, 1L)});
    }
    requests.push_back({start + std::ceil((end - start) / pulses.cycle_s) * pulses.cycle_s,
                        requests.empty() ? 0 : requests.back().pairs});
    std::vector<Insertion> pairs = insertions(encoder, requests, box);
    while (!pairs.empty() && pairs.back().time_s >= requests.back().time_s) pairs.pop_back();
    if (pairs.size() <= level.pairs.size()) {
      level.encoder = counts(encoder);
      level.control = counts(inserted(encoder, requests, box));
      return level;
    }
    pairs.resize(level.pairs.size() + 1);
    level.pairs = pairs;
  }
}

TEST(Quadrature, PassesLowLowThenAThenBothThenB) {
  const auto state = [](double x) {
    const QuadratureState s = quadrature(x * signal_period, signal_period, 0.0);
    return 10 * s.a + s.b;
  };
  for (const double whole : {-3.0, 0.0, 1000.0}) {
    EXPECT_EQ(state(whole + 0.1), 0);
    EXPECT_EQ(state(whole + 0.3), 10);
    EXPECT_EQ(state(whole + 0.6), 11);
    EXPECT_EQ(state(whole + 0.9), 1);
  }
  EXPECT_EQ(state(0.0), 0);
  EXPECT_EQ(state(-1e-12), 1);
  const QuadratureState shifted = quadrature(0.4 * signal_period, signal_period, 0.3);
  EXPECT_FALSE(shifted.a || shifted.b);
}

TEST(EncoderFeedback, HasItsEdgesAtTheExactInstants) {
  const Feedback up = feedback(course({{1.0, 0.0}, {2.0, signal_period}}), signal_period, 0.0);
  const std::vector<Edge> expected = {
      {1.25, true, true}, {1.5, false, true}, {1.75, true, false}, {2.0, false, false}};
  ASSERT_EQ(up.edges.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(up.edges[i].time_s, expected[i].time_s, 1e-15);
    EXPECT_EQ(up.edges[i].is_a, expected[i].is_a);
    EXPECT_EQ(up.edges[i].level, expected[i].level);
  }
  const Feedback down = feedback(course({{0.0, signal_period}, {1.0, 0.0}}), signal_period, 0.0);
  ASSERT_EQ(down.edges.size(), 4u);
  EXPECT_FALSE(down.edges[0].is_a) << "B leads down";
  EXPECT_EQ(down.edges[0].time_s, 0.0) << "from the very edge it leaves at once";
}

TEST(EncoderFeedback, StandsAtEveryInstantAsThePositionSays) {
  SeededRandom random(20250310);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int trial = 0; trial < 200; ++trial) {
    const TimeSeries motion = any_motion(random, 1.0, 2 + trial % 20);
    const double phase = unit(random) - 0.5;
    const Feedback f = feedback(motion, signal_period, phase);
    const std::vector<Count> x1 = counts(f), x4 = counts(f, Evaluation::X4);
    const double start = motion.value(0, 0);
    for (int i = 0; i < 50; ++i) {
      const double t = unit(random), x = value_at(motion, t)[0];
      const double quarters = 4.0 * (x / signal_period - phase);
      if (std::abs(quarters - std::round(quarters)) < 1e-6) continue;
      QuadratureState state = f.start;
      for (const Edge& edge : f.edges)
        if (edge.time_s <= t) (edge.is_a ? state.a : state.b) = edge.level;
      const QuadratureState expected = quadrature(x, signal_period, phase);
      ASSERT_EQ(state.a, expected.a);
      ASSERT_EQ(state.b, expected.b);
      ASSERT_EQ(count_at(x1, t), periods(x, phase) - periods(start, phase));
      ASSERT_EQ(count_at(x4, t), long(std::floor(quarters)) -
                                     long(std::floor(4.0 * (start / signal_period - phase))));
    }
  }
}

TEST(EncoderFeedback, OfAnAxisAtRestHasNoEdges) {
  for (const TimeSeries& rest :
       {course({{0.0, 0.3}}), course({{0.0, 0.3}, {0.0, 0.3}, {9.0, 0.3}})})
    EXPECT_TRUE(feedback(rest, signal_period, 0.1).edges.empty());
}

TEST(EncoderFeedback, RefusesWhatHasNoSignals) {
  const TimeSeries motion = course({{0.0, 0.0}, {1.0, 1.0}});
  for (const double bad : {0.0, -1.0, nan})
    EXPECT_THROW(feedback(motion, bad, 0.0), std::invalid_argument);
  EXPECT_THROW(feedback(motion, signal_period, nan), std::invalid_argument);
  EXPECT_THROW(feedback(motion, signal_period, 0.0, 1), std::invalid_argument);
  EXPECT_THROW(feedback(motion, signal_period, 0.0, -1), std::invalid_argument);
  EXPECT_THROW(feedback(motion, 1e-9, 0.0), std::invalid_argument) << "too many edges";
  EXPECT_THROW(feedback(motion, 1e-300, 0.0), std::invalid_argument);
  EXPECT_THROW(counts({{}, {{0.0, true, false}}}), std::invalid_argument);
}

TEST(InsertionBox, InsertsOnePairOfTheSameShape) {
  const Feedback rest = feedback(course({{0.0, 0.1 * signal_period}}), signal_period, 0.0);
  const double p = 3e-6;
  for (const long direction : {1L, -1L}) {
    const Feedback out = inserted(rest, {{2.0, direction}}, {false, p});
    ASSERT_EQ(out.edges.size(), 4u);
    const bool a_leads = direction > 0;
    const bool is_a[] = {a_leads, !a_leads, a_leads, !a_leads};
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(out.edges[std::size_t(i)].is_a, is_a[i]);
      EXPECT_EQ(out.edges[std::size_t(i)].level, i < 2);
      EXPECT_NEAR(out.edges[std::size_t(i)].time_s, 2.0 + i * p / 3.0, 1e-15);
    }
    EXPECT_EQ(counts(out).back().count, direction);
    EXPECT_EQ(counts(out, Evaluation::X4).back().count, 4 * direction)
        << "evaluated fourfold, a pair is a whole signal period all the same";
  }
}

TEST(InsertionBox, BypassLeavesTheFeedbackUntouchedBitForBit) {
  SeededRandom random(20250311);
  const Feedback in = feedback(any_motion(random, 1.0, 30), signal_period, 0.2);
  ASSERT_GT(in.edges.size(), 100u);
  const Feedback out = inserted(in, {{0.0, 5}, {0.5, -5}}, {true, 2e-6});
  ASSERT_EQ(out.edges.size(), in.edges.size());
  for (std::size_t i = 0; i < in.edges.size(); ++i) ASSERT_TRUE(same(in.edges[i], out.edges[i]));
  EXPECT_GT(inserted(in, {{0.0, 5}, {0.5, -5}}).edges.size(), in.edges.size());
}

TEST(InsertionBox, AtRestWithAOrBHighInsertsNothing) {
  for (const double x : {0.25, 0.3, 0.5, 0.6, 0.75, 0.9, 0.999}) {
    const Feedback rest =
        feedback(course({{0.0, x * signal_period}, {9.0, x * signal_period}}), signal_period, 0.0);
    EXPECT_TRUE(insertions(rest, {{1.0, 7}}).empty()) << x;
  }
  for (const double x : {0.0, 0.1, 0.249, 1.0, -1.0}) {
    const Feedback rest =
        feedback(course({{0.0, x * signal_period}, {9.0, x * signal_period}}), signal_period, 0.0);
    EXPECT_EQ(insertions(rest, {{1.0, 7}}).size(), 1u) << "one in a signal period, at " << x;
  }
}

TEST(InsertionBox, InsertsOnePairInEachSignalPeriodThatTheAxisPasses) {
  const Feedback run = feedback(course({{0.0, 0.5 * signal_period}, {1.0, 10.5 * signal_period}}),
                                signal_period, 0.0);
  const std::vector<Insertion> pairs = insertions(run, {{0.0, -100}});
  ASSERT_EQ(pairs.size(), 10u);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_NEAR(pairs[i].time_s, 0.05 + 0.1 * double(i), 1e-12) << "as both trains become low";
    EXPECT_EQ(pairs[i].direction, -1);
  }
}

TEST(InsertionBox, LetsNoPairThroughWhereTheAxisIsTooQuick) {
  const double p = 2e-6;
  const auto pairs_at = [&](double speed) {  // periods a second
    const TimeSeries run =
        course({{0.0, 0.5 * signal_period}, {1e-3, (0.5 + speed * 1e-3) * signal_period}});
    return insertions(feedback(run, signal_period, 0.0), {{0.0, 1000}}, {false, p}).size();
  };
  const double limit = 1.0 / (4.0 * p);
  EXPECT_EQ(pairs_at(1.001 * limit), 0u);
  EXPECT_EQ(pairs_at(0.999 * limit), std::size_t(0.5 + 0.999 * limit * 1e-3));
}

TEST(InsertionBox, DropsWhatIsNoLongerWanted) {
  const TimeSeries run = course({{0.0, 0.5 * signal_period}, {1.0, 1.4 * signal_period}});
  const Feedback f = feedback(run, signal_period, 0.0);  // low-low from 0.5556 s to 0.8333 s
  EXPECT_TRUE(insertions(f, {{0.1, 1}, {0.4, 0}}).empty());
  EXPECT_EQ(insertions(f, {{0.1, 1}, {0.6, 0}}).size(), 1u);
  const std::vector<Insertion> late = insertions(f, {{0.1, 1}, {0.4, 0}, {0.7, -1}});
  ASSERT_EQ(late.size(), 1u);
  EXPECT_EQ(late[0].time_s, 0.7);
  EXPECT_EQ(late[0].direction, -1);
  EXPECT_TRUE(insertions(f, {{0.8333 - 1e-6, 1}}, {false, 1e-3}).empty()) << "it would not pass";
}

TEST(InsertionBox, RefusesRequestsOutOfOrder) {
  const Feedback rest = feedback(course({{0.0, 0.0}}), signal_period, 0.0);
  EXPECT_THROW(insertions(rest, {{1.0, 1}, {0.0, 2}}), std::invalid_argument);
  EXPECT_THROW(insertions(rest, {{1.0, 1}, {1.0, 2}}), std::invalid_argument);
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(insertions(rest, {{1.0, 1}}, {false, bad}), std::invalid_argument);
}

TEST(SignalLevel, CounterLessTrueMotionIsWhatTheFastModelInsertsInstantByInstant) {
  SeededRandom random(20250312);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::size_t pairs = 0;
  int waiting = 0;  // instants at which the axis is behind what is wanted: A or B is high too long
  double latest = 0.0;
  for (int trial = 0; trial < 60; ++trial) {
    const double duration = 0.3;
    const TimeSeries motion = any_motion(random, duration, 3 + trial % 25);
    std::vector<Knot> bends;
    for (int i = 0; i <= 6; ++i)
      bends.push_back({duration * i / 6.0, 8.0 * unit(random) * signal_period});
    const TimeSeries wanted = course(bends);
    PulseInsertion pulses{VectorXd::Constant(1, signal_period), 1e-3, 2e-6, std::uint64_t(trial)};
    const double phase = zero_phase(pulses.phase_seed, 0);

    const TimeSeries fast = apply_channel(wanted, pulses, motion);
    const SignalLevel level = ring(wanted, motion, pulses, 0.0);
    pairs += level.pairs.size();
    for (int i = 0; i < 400; ++i) {
      const double t = duration * (0.5 + 0.5 * unit(random));
      // Counts of the fast model, and those that the control sees beyond the encoder's own.
      const double fast_counts = (value_at(fast, t)[0] - fast.value(0, 0)) / signal_period;
      const long seen = count_at(level.control, t) - count_at(level.encoder, t);
      const double travelled =
          (value_at(level.axis, t)[0] - value_at(motion, t)[0]) / signal_period;
      bool during_a_pair = false;
      for (const Insertion& pair : level.pairs)
        if (t >= pair.time_s - 1e-9 && t <= pair.time_s + pulses.pulse_s + 1e-9)
          during_a_pair = true;
      if (during_a_pair) continue;
      waiting += std::abs(value_at(fast, t)[0] - value_at(wanted, t)[0]) > 1.5 * signal_period;
      ASSERT_NEAR(fast_counts, -double(seen), 1e-6) << "trial " << trial << ", " << t << " s";
      ASSERT_NEAR(travelled, -double(seen), 1e-6);
      // The control holds its own count: it sees no more than the programmed motion.
      const double position = value_at(motion, t)[0] / signal_period - phase;
      if (std::abs(position - std::round(position)) > 1e-6) {
        ASSERT_EQ(count_at(level.control, t),
                  periods(value_at(motion, t)[0], phase) - periods(motion.value(0, 0), phase));
      }
    }
    // The instants agree, not only the counts.
    // Its first knot, two a pair, and its last.
    ASSERT_EQ(fast.time_s.size(), Index(2 * level.pairs.size() + 2));
    for (std::size_t i = 0; i < level.pairs.size(); ++i) {
      const double difference =
          std::abs(fast.time_s[Index(2 * i + 1)] - level.pairs[i].time_s - pulses.pulse_s);
      latest = std::max(latest, difference);
      ASSERT_LT(difference, 1e-9);
    }
  }
  EXPECT_GT(pairs, 500u);
  EXPECT_GT(waiting, 500);
  std::cout << "  " << pairs << " pairs, behind at " << waiting << " of 24000 instants, "
            << "instants of pairs agree to " << latest << " s\n";
}

TEST(SignalLevel, ALoopThatTakesItsTimeMakesTheAxisTravelAsFar) {
  SeededRandom random(20250313);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  double largest = 0.0;
  for (int trial = 0; trial < 20; ++trial) {
    // The axis runs to and fro all the time; the correction comes to rest for the last third.
    std::vector<Knot> run;
    for (int i = 0; i <= 8; ++i)
      run.push_back({0.05 * i, (i % 2 == 0 ? 0.0 : 20.0 + 5.0 * unit(random)) * signal_period});
    const TimeSeries motion = course(run);
    const double last = 9.0 * unit(random) * signal_period;
    const TimeSeries wanted =
        course({{0.0, 0.0}, {0.1, 4.0 * unit(random) * signal_period}, {0.25, last}});
    const PulseInsertion pulses{VectorXd::Constant(1, signal_period), 1e-3, 2e-6,
                                std::uint64_t(100 + trial)};
    const TimeSeries fast = apply_channel(wanted, pulses, motion);
    const SignalLevel level = ring(wanted, motion, pulses, 0.7e-3);
    long sum = 0;
    for (const Insertion& pair : level.pairs) sum += pair.direction;
    const double end = motion.time_s.tail<1>()[0];
    const double travelled = value_at(level.axis, end)[0] - value_at(motion, end)[0];
    EXPECT_NEAR(travelled, -double(sum) * signal_period, 1e-12);
    EXPECT_NEAR(travelled, value_at(fast, end)[0] - fast.value(0, 0), 1e-12);
    EXPECT_LE(std::abs(value_at(fast, end)[0] - last), 0.5 * signal_period * (1.0 + 1e-9));
    largest = std::max(largest, std::abs(travelled) / signal_period);
  }
  EXPECT_GT(largest, 4.0);
}

double w_of(const PositionLoop& loop) { return 2.0 * std::numbers::pi * loop.bandwidth; }

PositionLoop second(double damping) { return {Order::Second, 20.0, damping}; }

/// Step response of the second order from the textbook's own three formulas.
double step_response(double w, double d, double t) {
  if (d == 1.0) return 1.0 - std::exp(-w * t) * (1.0 + w * t);
  if (d < 1.0) {
    const double r = std::sqrt(1.0 - d * d);
    return 1.0 - std::exp(-d * w * t) / r * std::sin(w * r * t + std::acos(d));
  }
  const double r = std::sqrt(d * d - 1.0), p = w * (d - r), q = w * (d + r);
  return 1.0 - (q * std::exp(-p * t) - p * std::exp(-q * t)) / (q - p);
}

/// The same loop by Runge and Kutta's fourth-order rule in small steps, at the knots of an answer.
double largest_difference_from_rk4(const TimeSeries& wanted, const PositionLoop& loop,
                                   const TimeSeries& answer) {
  const double w = w_of(loop), d = loop.damping;
  const bool is_second = loop.order == Order::Second;
  double x = wanted.value(0, 0), v = 0.0, worst = std::abs(answer.value(0, 0) - x);
  for (Index i = 1; i < answer.time_s.size(); ++i) {
    const double t0 = answer.time_s[i - 1], t1 = answer.time_s[i];
    if (t1 == t0) continue;
    // Every knot of `wanted` is one of `answer`, so the input is one line here.
    const double u0 = value_at(wanted, t0)[0], u1 = before(wanted, t1, 0);
    const auto slope = [&](double s, double y, double z) -> std::array<double, 2> {
      const double u = u0 + (u1 - u0) * s;
      if (!is_second) return {w * (u - y), 0.0};
      return {z, w * w * (u - y) - 2.0 * d * w * z};
    };
    const int steps = int(std::ceil(w * std::max(1.0, 2.0 * d) * (t1 - t0) / 0.004));
    const double h = (t1 - t0) / steps;
    for (int k = 0; k < steps; ++k) {
      const double s = double(k) / steps, half = 0.5 / steps;
      const auto a = slope(s, x, v);
      const auto b = slope(s + half, x + 0.5 * h * a[0], v + 0.5 * h * a[1]);
      const auto c = slope(s + half, x + 0.5 * h * b[0], v + 0.5 * h * b[1]);
      const auto e = slope(s + 2.0 * half, x + h * c[0], v + h * c[1]);
      x += h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + e[0]);
      v += h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + e[1]);
    }
    worst = std::max(worst, std::abs(answer.value(i, 0) - x));
  }
  return worst;
}

TEST(PositionLoop, AnswersAStepByTheClosedForms) {
  const TimeSeries step = course({{1.0, 0.0}, {1.0, 1.0}, {1.3, 1.0}});
  double worst = 0.0;
  for (const double d : {0.001, 0.05, 0.3, 0.7, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.5, 20.0, 100.0}) {
    const PositionLoop loop = second(d);
    const TimeSeries answer = loop_response(step, loop);
    ASSERT_GT(answer.time_s.size(), 50);
    for (Index i = 0; i < answer.time_s.size(); ++i) {
      const double closed = std::abs(d - 1.0) < 1e-6 ? 1.0 : d;
      const double expected = step_response(w_of(loop), closed, answer.time_s[i] - 1.0);
      worst = std::max(worst, std::abs(answer.value(i, 0) - expected));
      ASSERT_NEAR(answer.value(i, 0), expected, closed == d ? 1e-11 : 1e-8) << "damping " << d;
    }
  }
  const PositionLoop first{Order::First, 20.0, 0.7};
  const TimeSeries answer = loop_response(step, first);
  for (Index i = 0; i < answer.time_s.size(); ++i)
    ASSERT_NEAR(answer.value(i, 0), 1.0 - std::exp(-w_of(first) * (answer.time_s[i] - 1.0)), 1e-13);
  std::cout << "  largest difference from the closed forms " << worst << " of the step\n";
}

TEST(PositionLoop, FollowsARampAsLateAsItsLagSays) {
  const double slope = 0.3;
  const TimeSeries ramp = course({{0.0, 0.0}, {50.0, 50.0 * slope}, {100.0, 100.0 * slope}});
  for (const double d : {0.2, 0.7, 1.0, 3.0}) {
    const PositionLoop loop = second(d);
    const double late = 50.0 * slope - value_at(loop_response(ramp, loop), 50.0)[0];
    EXPECT_NEAR(late, slope * 2.0 * d / w_of(loop), 1e-11) << "damping " << d;
  }
  const PositionLoop first{Order::First, 20.0, 0.7};
  EXPECT_NEAR(50.0 * slope - value_at(loop_response(ramp, first), 50.0)[0], slope / w_of(first),
              1e-11);
}

TEST(PositionLoop, AgreesWithRungeAndKuttaOnAnyCourse) {
  SeededRandom random(20250303);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  double worst = 0.0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<testing_courses::Knot> knots;
    double t = 0.0, x = 0.0;
    for (int i = 0; i < 8; ++i) {
      // lengths from far below to far above the time constant, jumps, rests
      if (unit(random) > -0.3) t += std::pow(10.0, 3.0 * unit(random) - 3.0);
      if (unit(random) > -0.3) x += unit(random);
      knots.push_back({t, x});
    }
    PositionLoop loop{trial % 5 == 0 ? Order::First : Order::Second, 5.0 + 10.0 * (trial % 7),
                      std::pow(10.0, unit(random))};
    if (trial % 11 == 0) loop.damping = 1.0;
    const TimeSeries wanted = course(knots);
    const double difference =
        largest_difference_from_rk4(wanted, loop, loop_response(wanted, loop));
    worst = std::max(worst, difference);
    ASSERT_LT(difference, 1e-8) << "trial " << trial << ", damping " << loop.damping;
  }
  std::cout << "  largest difference from Runge and Kutta " << worst << "\n";
}

TEST(PositionLoop, HasAKnotAtEveryInstantOfItsCourseAndEndsSettled) {
  const TimeSeries wanted =
      course({{0.0, 0.0}, {1e-9, 1e-3}, {0.5, 1e-3}, {0.5, 2e-3}, {2.0, -1e-3}});
  for (const double d : {0.1, 1.0, 30.0}) {
    const TimeSeries answer = loop_response(wanted, second(d));
    for (const double t : wanted.time_s)
      EXPECT_NE(std::find(answer.time_s.begin(), answer.time_s.end(), t), answer.time_s.end());
    EXPECT_NEAR(answer.value(answer.value.rows() - 1, 0), -1e-3, 1e-8) << "damping " << d;
  }
}

TEST(PositionLoop, IsOffBetweenItsKnotsByNoMoreThanItSays) {
  const double step = 1e-2;
  const TimeSeries wanted = course({{0.0, 0.0}, {0.0, step}});
  for (const int per_constant : {4, 8, 32}) {
    double worst = 0.0;
    for (const double d : {0.1, 0.4, 0.7, 1.0}) {
      const PositionLoop loop = second(d);
      const TimeSeries answer = loop_response(wanted, loop, {per_constant, 1e-8});
      for (double t = 0.0; t < 0.3; t += 1e-5)
        worst = std::max(worst,
                         std::abs(value_at(answer, t)[0] - step * step_response(w_of(loop), d, t)));
    }
    std::cout << "  " << per_constant << " knots a constant: off by " << 100.0 * worst / step
              << " % of the step\n";
    EXPECT_LT(worst, step / (3.0 * per_constant * per_constant) + 2e-8);
  }
}

TEST(PositionLoop, CreepsOverdampedWithoutAHostOfKnots) {
  const TimeSeries answer = loop_response(course({{0.0, 0.0}, {0.0, 1.0}}), second(100.0));
  EXPECT_LT(answer.time_s.size(), 500);
  EXPECT_NEAR(answer.value(answer.value.rows() - 1, 0), 1.0, 1e-8);
}

TEST(PositionLoop, WithoutOrderFollowsAtOnce) {
  const TimeSeries wanted = course({{0.0, 0.0}, {0.0, 1.0}, {1.0, 3.0}});
  const TimeSeries answer = loop_response(wanted, {});
  EXPECT_EQ(answer.time_s, wanted.time_s);
  EXPECT_EQ(answer.value, wanted.value);
}

TEST(PositionLoop, StaysPutOnAConstantCourse) {
  for (const TimeSeries& wanted : {course({{5.0, 0.25}}), course({{5.0, 0.25}, {5.0, 0.25}})}) {
    const TimeSeries answer = loop_response(wanted, second(0.7));
    EXPECT_EQ(answer.time_s.size(), 1);
    EXPECT_EQ(value_at(answer, 9.0)[0], 0.25);
  }
}

TEST(PositionLoop, RefusesWhatItCannotBe) {
  const TimeSeries step = course({{0.0, 0.0}, {0.0, 1.0}});
  for (const double bad : {0.0, -1.0, nan, infinity})
    EXPECT_THROW(loop_response(step, {Order::First, bad, 0.7}), std::invalid_argument);
  for (const double bad : {0.0, -1.0, 0.999e-3, 100.1, nan, infinity})
    EXPECT_THROW(loop_response(step, second(bad)), std::invalid_argument);
  EXPECT_THROW(loop_response(step, second(0.7), {0, 1e-8}), std::invalid_argument);
  EXPECT_THROW(loop_response(step, second(0.7), {8, 0.0}), std::invalid_argument);
  EXPECT_THROW(loop_response(course({{0.0, nan}}), second(0.7)), std::invalid_argument);
}

TEST(PositionLoop, TakesTimesAtTheEdgeOfWhatNumbersTellApart) {
  const TimeSeries answer =
      loop_response(course({{1e9, 0.0}, {1e9, 1.0}}), {Order::First, 1e9, 0.7});
  EXPECT_NEAR(answer.value(answer.value.rows() - 1, 0), 1.0, 1e-8);
  EXPECT_LT(answer.time_s.size(), 1000);
  const TimeSeries steep =
      loop_response(course({{0.0, 0.0}, {5e-324, 1.0}, {1.0, 1.0}}), second(0.7));
  EXPECT_TRUE(steep.value.allFinite());
  EXPECT_NEAR(value_at(steep, 1.0)[0], 1.0, 1e-8);
}

}  // namespace
}  // namespace abbe::sim::compensation
