#include "sim/compensation/channels.h"
#include <ctime>
#include "tests/compensation/courses.h"
#include "tests/test.h"

namespace abbe::sim::compensation {
namespace {

using kinematics::Joint;
using kinematics::Motion;
using testing_courses::before;
using testing_courses::course;
using testing_courses::rms;

std::vector<Joint> joints(std::initializer_list<Motion> motions) {
  std::vector<Joint> result;
  for (const Motion motion : motions) {
    Joint joint;
    joint.motion = motion;
    result.push_back(joint);
  }
  return result;
}

TimeSeries through_slide(const TimeSeries& wanted, const OriginShift& origin) {
  const std::vector<Joint> slide = joints({Motion::Linear});
  return apply_channel(wanted, origin, slide);
}

PulseInsertion one_axis(double count, std::uint64_t seed = 1) {
  return {VectorXd::Constant(1, count), 1e-3, 2e-6, seed};
}

double missed(const TimeSeries& wanted, const TimeSeries& arrived, double from_s, double to_s) {
  return rms([&](double t) { return value_at(arrived, t)[0] - value_at(wanted, t)[0]; }, from_s,
             to_s, 200000);
}

// ---- pulses

TEST(PulseInsertion, QuantumIsUniformOverACountOnEveryAxisTogether) {
  SeededRandom random(20250320);
  std::normal_distribution<double> normal;
  const Vector3d q(1e-3, 0.5e-3, 2e-3);
  double sum = 0.0, expected = 0.0, least = infinity, most = 0.0;
  for (int trial = 0; trial < 20; ++trial) {
    const Vector3d n = Vector3d(normal(random), normal(random), normal(random)).normalized();
    // 25 counts a axis over 10 s on another bend each; the axes pass 200 periods a second.
    TimeSeries wanted{VectorXd::LinSpaced(101, 0.0, 10.0), MatrixXd(101, 3)};
    TimeSeries motion{Vector2d(0.0, 10.0), MatrixXd::Zero(2, 3)};
    for (int j = 0; j < 3; ++j) {
      wanted.value.col(j) =
          25.0 * q[j] * (wanted.time_s.array() / 10.0).pow(1.0 + 0.3 * j).matrix();
      motion.value(1, j) = 2000.0 * q[j];
    }
    const TimeSeries arrived = apply_channel(wanted, {q, 1e-3, 2e-6, std::uint64_t(trial)}, motion);
    const double root =
        rms([&](double t) { return n.dot(value_at(arrived, t) - value_at(wanted, t)); }, 0.0, 10.0,
            20000);
    const double formula = std::sqrt(n.cwiseProduct(q).squaredNorm() / 12.0);
    least = std::min(least, root / formula);
    most = std::max(most, root / formula);
    sum += root * root;
    expected += formula * formula;
  }
  std::cout << "  RMS over sqrt(sum (n q)^2 / 12): " << std::sqrt(sum / expected)
            << ", single seeds " << least << " to " << most << "\n";
  EXPECT_NEAR(std::sqrt(sum / expected), 1.0, 0.1);
}

TEST(PulseInsertion, ArriveWithinHalfACountPlusWhatIsWantedDuringACycle) {
  const double q = 1e-3;
  const TimeSeries wanted = course({{0.0, 0.0}, {1.0, 40.0 * q}, {2.0, -10.0 * q}});
  const TimeSeries motion = course({{0.0, 0.0}, {2.0, 10.0}});  // 5 periods a cycle
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const TimeSeries arrived = apply_channel(wanted, one_axis(q, seed), motion);
    double worst = 0.0;
    for (double t = 0.0; t < 2.0; t += 1e-4)
      worst = std::max(worst, std::abs(value_at(arrived, t)[0] - value_at(wanted, t)[0]));
    // 50 counts a second: 0.05 during a cycle, and 0.01 until the next window
    EXPECT_LT(worst, (0.5 + 0.06) * q);
    EXPECT_GT(worst, 0.49 * q);
  }
}

TEST(PulseInsertion, AtRestGoInWhereBothTrainsAreLowAndNowhereElse) {
  const double q = 1e-3;
  int low = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    const TimeSeries wanted = course({{0.0, 0.0}, {0.0, 5.0 * q}, {1.0, 5.0 * q}});
    const TimeSeries arrived = apply_channel(wanted, one_axis(q, seed), course({{0.0, 0.37}}));
    const double x = 0.37 / q - zero_phase(seed, 0);
    const bool is_low = x - std::floor(x) < 0.25;
    low += is_low;
    EXPECT_NEAR(arrived.value(arrived.value.rows() - 1, 0) - arrived.value(0, 0),
                is_low ? 5.0 * q : 0.0, 1e-15);
    if (is_low) {
      // One pair a cycle: the loop carries the axis out of the period in between.
      for (int k = 0; k < 5; ++k) EXPECT_NEAR(arrived.time_s[2 * k + 1], 1e-3 * k + 2e-6, 1e-12);
    }
  }
  std::cout << "  both low in " << low << " of 400 draws\n";
  EXPECT_NEAR(low, 100, 40);
}

TEST(PulseInsertion, DoNotGoInWhereTheAxisIsTooQuick) {
  const double q = 1e-3, limit = q / (4.0 * 2e-6);  // mm/s: 125
  const TimeSeries wanted = course({{0.0, 0.0}, {1.0, 20.0 * q}});
  const auto arrived = [&](double speed) {
    const TimeSeries motion = course({{0.0, 0.0}, {1.0, speed}});
    const TimeSeries c = apply_channel(wanted, one_axis(q), motion);
    return (c.value(c.value.rows() - 1, 0) - c.value(0, 0)) / q;
  };
  EXPECT_NEAR(arrived(0.999 * limit), 20.0, 1.0);
  EXPECT_LE(std::abs(arrived(1.001 * limit)), 1.0) << "before the start and after the end it rests";
}

TEST(PulseInsertion, StartWhereTheFirstValueWantsThem) {
  const double q = 1e-3;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const TimeSeries arrived =
        apply_channel(course({{0.0, 7.3 * q}}), one_axis(q, seed), course({{0.0, 0.0}}));
    ASSERT_EQ(arrived.time_s.size(), 1);
    const double whole = arrived.value(0, 0) / q - zero_phase(seed, 0);
    EXPECT_NEAR(whole, std::round(whole), 1e-9);
    EXPECT_LE(std::abs(arrived.value(0, 0) - 7.3 * q), 0.5 * q * (1.0 + 1e-9));
  }
}

TEST(PulseInsertion, LeaveJointsThatAreNotFittedAtZero) {
  TimeSeries wanted{Vector2d(0.0, 1.0), MatrixXd::Constant(2, 2, 0.5)};
  const TimeSeries motion{Vector2d(0.0, 1.0), MatrixXd::Zero(2, 2)};
  const TimeSeries arrived = apply_channel(wanted, {Vector2d(0.0, 1e-3), 1e-3, 2e-6, 3}, motion);
  EXPECT_TRUE((arrived.value.col(0).array() == 0.0).all());
  EXPECT_NEAR(arrived.value(0, 1), 0.5, 0.5e-3);
}

TEST(PulseInsertion, ZeroPhaseIsUniformAndDiffersFromJointToJoint) {
  double sum = 0.0, squares = 0.0, product = 0.0;
  const int n = 20000;
  for (int seed = 0; seed < n; ++seed) {
    const double a = zero_phase(std::uint64_t(seed), 0), b = zero_phase(std::uint64_t(seed), 1);
    ASSERT_GE(a, -0.5);
    ASSERT_LT(a, 0.5);
    sum += a;
    squares += a * a;
    product += a * b;
  }
  EXPECT_NEAR(sum / n, 0.0, 4.0 * std::sqrt(1.0 / 12.0 / n));
  EXPECT_NEAR(squares / n, 1.0 / 12.0, 4.0 * std::sqrt(1.0 / 180.0 / n));
  EXPECT_NEAR(product / n, 0.0, 4.0 / 12.0 / std::sqrt(n));
}

TEST(PulseInsertion, OfAnHourAtOneMillisecondTakeWellUnderASecondAnAxis) {
  const double q = 1e-3, hour = 3600.0;
  // 100 mm to and fro at 50 mm/s: 50 signal periods a cycle; heat and a wavy screw to correct.
  std::vector<testing_courses::Knot> run, bends;
  for (int i = 0; i <= 1800; ++i) run.push_back({2.0 * i, i % 2 == 0 ? 0.0 : 100.0});
  for (int i = 0; i <= 36000; ++i)
    bends.push_back({0.1 * i, 0.05 * (1.0 - std::exp(-0.1 * i / 900.0)) +
                                  0.02 * std::sin(2.0 * pi * 0.1 * i / 4.0)});
  const TimeSeries motion = course(run), wanted = course(bends);
  const std::clock_t start = std::clock();
  const TimeSeries arrived = apply_channel(wanted, one_axis(q), motion);
  const double seconds = double(std::clock() - start) / CLOCKS_PER_SEC;
  const double root = missed(wanted, arrived, 0.0, hour);
  std::cout << "  " << seconds << " s for " << arrived.time_s.size() / 2 - 1 << " pairs; off by "
            << root / q * std::sqrt(12.0) << " of count / sqrt(12)\n";
  EXPECT_LT(seconds, 1.0);
  EXPECT_NEAR(root, q / std::sqrt(12.0), 0.1 * q / std::sqrt(12.0));
}

TEST(PulseInsertion, OfAnEnormousSpeedCostNoMore) {
  const TimeSeries wanted = course({{0.0, 0.0}, {1.0, 0.01}});
  const TimeSeries motion = course({{0.0, -1e9}, {0.5, 1e9}, {0.5, 0.0}, {1.0, 0.0}});
  EXPECT_TRUE(apply_channel(wanted, one_axis(1e-3), motion).value.allFinite());
}

TEST(PulseInsertion, RefuseWhatTheyCannotBe) {
  const TimeSeries rest = course({{0.0, 0.0}}), ramp = course({{0.0, 0.0}, {1.0, 1.0}});
  for (const double bad : {0.0, -1.0, nan, infinity}) {
    PulseInsertion pulses = one_axis(1e-3);
    pulses.cycle_s = bad;
    EXPECT_THROW(apply_channel(ramp, pulses, rest), std::invalid_argument);
    pulses = one_axis(1e-3);
    pulses.pulse_s = bad;
    EXPECT_THROW(apply_channel(ramp, pulses, rest), std::invalid_argument);
  }
  for (const double bad : {-1.0, nan, infinity})
    EXPECT_THROW(apply_channel(ramp, one_axis(bad), rest), std::invalid_argument);
  EXPECT_THROW(apply_channel(course({{0.0, nan}}), one_axis(1e-3), rest), std::invalid_argument);
  EXPECT_THROW(apply_channel(ramp, one_axis(1e-3), course({{0.0, nan}})), std::invalid_argument);
  EXPECT_THROW(apply_channel(ramp, one_axis(1e-3), TimeSeries{}), std::invalid_argument);
  EXPECT_THROW(apply_channel(TimeSeries{}, one_axis(1e-3), rest), std::invalid_argument);
  EXPECT_THROW(apply_channel(ramp, one_axis(1e-17), rest), std::invalid_argument)
      << "too many counts";
  EXPECT_THROW(apply_channel(rest, one_axis(1e-17), ramp), std::invalid_argument);
  EXPECT_THROW(apply_channel(course({{0.0, 0.0}, {1e9, 1.0}}), one_axis(1e-3), rest),
               std::invalid_argument)
      << "too many cycles";
  EXPECT_THROW(apply_channel(ramp, {Vector2d::Ones(), 1e-3, 2e-6, 0}, rest), std::invalid_argument);
}

// ---- open control

TEST(OpenControl, HoldsWhatWasReadFromADelayAfterItsCycleOn) {
  const TimeSeries wanted = course({{0.0, 0.0}, {0.1, 1.0}});
  const TimeSeries arrived = apply_channel(wanted, OpenControl{0.01, 0.003});
  for (int k = 0; k <= 10; ++k) {
    const double act = 0.01 * k + 0.003;
    EXPECT_NEAR(value_at(arrived, act + 1e-9)[0], 0.1 * k, 1e-12);
    EXPECT_NEAR(before(arrived, act - 1e-9, 0), 0.1 * std::max(0, k - 1), 1e-12);
  }
  EXPECT_EQ(value_at(arrived, 9.0)[0], 1.0);
}

TEST(OpenControl, MissesARampByWhatItsCycleAndDelaySay) {
  const double slope = 0.02;
  const TimeSeries ramp = course({{0.0, 0.0}, {20.0, 20.0 * slope}});
  for (const auto& [T, D] : {std::pair{1e-3, 0.0}, {1e-3, 4e-3}, {0.02, 0.01}}) {
    const double expected = slope * std::sqrt(T * T / 3.0 + T * D + D * D);
    const double root = missed(ramp, apply_channel(ramp, OpenControl{T, D}), 1.0, 19.0);
    std::cout << "  cycle " << T << " s, delay " << D << " s: " << root / expected
              << " of the formula\n";
    EXPECT_NEAR(root, expected, 0.01 * expected);
  }
}

TEST(OpenControl, WithAHugeDelayActsLateNotWrong) {
  const TimeSeries arrived = apply_channel(course({{0.0, 1.0}, {1.0, 2.0}}), OpenControl{0.5, 1e6});
  EXPECT_EQ(value_at(arrived, 1e6 - 1.0)[0], 1.0);
  EXPECT_EQ(value_at(arrived, 1e6 + 0.5)[0], 1.5);
  EXPECT_EQ(value_at(arrived, 1e6 + 1.0)[0], 2.0);
}

TEST(OpenControl, OfAConstantOrOneInstantIsThat) {
  for (const TimeSeries& c : {course({{3.0, 4.0}}), course({{3.0, 4.0}, {9.0, 4.0}})}) {
    const TimeSeries arrived = apply_channel(c, OpenControl{});
    EXPECT_EQ(arrived.time_s.size(), 1);
    EXPECT_EQ(value_at(arrived, 5.0)[0], 4.0);
  }
  const TimeSeries jump = apply_channel(course({{3.0, 4.0}, {3.0, 6.0}}), OpenControl{});
  EXPECT_EQ(value_at(jump, 2.9)[0], 4.0);
  EXPECT_EQ(value_at(jump, 3.0)[0], 6.0);
}

TEST(OpenControl, RefusesWhatItCannotBe) {
  const TimeSeries ramp = course({{0.0, 0.0}, {1.0, 1.0}});
  for (const double bad : {0.0, -1.0, nan, infinity})
    EXPECT_THROW(apply_channel(ramp, OpenControl{bad, 0.0}), std::invalid_argument);
  for (const double bad : {-1.0, nan, infinity})
    EXPECT_THROW(apply_channel(ramp, OpenControl{1e-3, bad}), std::invalid_argument);
  EXPECT_THROW(apply_channel(ramp, OpenControl{1e-12, 0.0}), std::invalid_argument)
      << "too many cycles";
  EXPECT_THROW(apply_channel(TimeSeries{}, OpenControl{}), std::invalid_argument);
}

// ---- origin shift

TEST(OriginShift, MissesARampByWhatItsCycleAndDelaySay) {
  for (const double slope : {0.02, -0.3})
    for (const auto& [T, D] : {std::pair{0.01, 0.0}, {0.01, 0.05}, {0.1, 0.03}}) {
      const TimeSeries ramp = course({{0.0, 0.0}, {20.0, 20.0 * slope}});
      const double expected = std::abs(slope) * std::sqrt(T * T / 3.0 + T * D + D * D);
      const double root = missed(ramp, through_slide(ramp, {T, D, 0.0, 0.0}), 1.0, 19.0);
      EXPECT_NEAR(root, expected, 0.01 * expected);
    }
}

TEST(OriginShift, AddsTheSquareOfItsIncrementOverTwelve) {
  // An irrational number of increments a cycle, so that rounding meets every remainder.
  const double T = 0.01, D = 0.02, q = 1e-3, slope = 0.1 * q / T * std::numbers::phi;
  const TimeSeries ramp = course({{0.0, 0.0}, {40.0, 40.0 * slope}});
  const double expected = std::sqrt(slope * slope * (T * T / 3.0 + T * D + D * D) + q * q / 12.0);
  const double root = missed(ramp, through_slide(ramp, {T, D, q, 0.0}), 1.0, 39.0);
  std::cout << "  " << root / expected << " of the formula\n";
  EXPECT_NEAR(root, expected, 0.01 * expected);
}

TEST(OriginShift, MovesInWholeIncrementsRoundedToNearest) {
  const TimeSeries wanted = course({{0.0, 0.0}, {1.0, 0.0101}, {2.0, -0.0037}});
  const TimeSeries arrived = through_slide(wanted, {0.01, 0.0, 1e-3, 0.0});
  for (Index i = 0; i < arrived.time_s.size(); ++i) {
    const double whole = arrived.value(i, 0) / 1e-3;
    EXPECT_NEAR(whole, std::round(whole), 1e-9);
  }
  EXPECT_NEAR(value_at(arrived, 3.0)[0], -0.004, 1e-15);
  EXPECT_NEAR(value_at(arrived, 1.0)[0], 0.010, 1e-15);
}

TEST(OriginShift, MovesSlidesOnly) {
  const TimeSeries wanted{Vector2d(0.0, 1.0), MatrixXd::Constant(2, 3, 0.5)};
  const std::vector<Joint> three = joints({Motion::Rotary, Motion::Linear, Motion::Spindle});
  const TimeSeries arrived = apply_channel(wanted, OriginShift{}, three);
  EXPECT_EQ(value_at(arrived, 0.5), Vector3d(0.0, 0.5, 0.0));
}

TEST(OriginShift, GoesToEachNewOffsetAtItsRateAndNoFaster) {
  const double rate = 2.0;
  const std::vector<Joint> two = joints({Motion::Linear, Motion::Linear});
  TimeSeries wanted{Eigen::Vector4d(0.0, 0.0, 1.0, 1.0), MatrixXd(4, 2)};
  wanted.value << 0.0, 0.0, 1.0, -0.2, 1.0, -0.2, -3.0, 0.0;
  const TimeSeries arrived = apply_channel(wanted, {0.1, 0.05, 0.0, rate}, two);
  const auto at = [&](double t) { return value_at(arrived, t); };
  EXPECT_EQ(at(0.05), Vector2d(0.0, 0.0));
  EXPECT_TRUE(at(0.10).isApprox(Vector2d(0.1, -0.1), 1e-12));
  EXPECT_TRUE(at(0.15).isApprox(Vector2d(0.2, -0.2), 1e-12));
  EXPECT_TRUE(at(0.55).isApprox(Vector2d(1.0, -0.2), 1e-12));
  EXPECT_EQ(at(1.0), Vector2d(1.0, -0.2));
  EXPECT_TRUE(at(2.05).isApprox(Vector2d(-1.0, 0.0), 1e-12));
  EXPECT_EQ(at(3.05), Vector2d(-3.0, 0.0));
  for (Index i = 1; i < arrived.time_s.size(); ++i) {
    const double run = arrived.time_s[i] - arrived.time_s[i - 1];
    const double rise = (arrived.value.row(i) - arrived.value.row(i - 1)).cwiseAbs().maxCoeff();
    EXPECT_LE(rise, rate * run + 1e-12);
  }
}

TEST(OriginShift, TooSlowForARampFollowsAtItsRate) {
  const TimeSeries ramp = course({{0.0, 0.0}, {10.0, 10.0}});
  const TimeSeries arrived = through_slide(ramp, {0.01, 0.0, 1e-3, 0.25});
  EXPECT_NEAR(value_at(arrived, 10.0)[0], 2.5, 0.01);
  EXPECT_NEAR(value_at(arrived, 100.0)[0], 10.0, 1e-12);
}

TEST(OriginShift, RefusesWhatItCannotBe) {
  const TimeSeries ramp = course({{0.0, 0.0}, {1.0, 1.0}});
  for (const double bad : {0.0, -1.0, nan, infinity})
    EXPECT_THROW(through_slide(ramp, {bad, 0.0, 1e-3, 0.0}), std::invalid_argument);
  for (const double bad : {-1.0, nan, infinity}) {
    EXPECT_THROW(through_slide(ramp, {0.01, bad, 1e-3, 0.0}), std::invalid_argument);
    EXPECT_THROW(through_slide(ramp, {0.01, 0.0, bad, 0.0}), std::invalid_argument);
    EXPECT_THROW(through_slide(ramp, {0.01, 0.0, 1e-3, bad}), std::invalid_argument);
  }
  EXPECT_THROW(apply_channel(ramp, OriginShift{}, joints({})), std::invalid_argument);
  EXPECT_THROW(through_slide(TimeSeries{}, OriginShift{}), std::invalid_argument);
  EXPECT_THROW(through_slide(course({{0.0, infinity}}), OriginShift{}), std::invalid_argument);
}

// ---- piezo

TimeSeries displacement(const std::vector<double>& times, const std::vector<Vector3d>& values) {
  TimeSeries result{VectorXd(Index(times.size())), MatrixXd(Index(times.size()), 3)};
  for (std::size_t i = 0; i < times.size(); ++i) {
    result.time_s[Index(i)] = times[i];
    result.value.row(Index(i)) = values[i].transpose();
  }
  return result;
}

TEST(Piezo, CarriesThePartAlongItsDirection) {
  Piezo piezo;
  piezo.direction_t = Vector3d(0.6, 0.0, 0.8);
  const TimeSeries wanted = displacement({0.0, 0.0}, {Vector3d::Zero(), Vector3d(0.01, 5.0, 0.02)});
  EXPECT_NEAR(value_at(apply_channel(wanted, piezo), 10.0)[0], 0.022, 1e-8);
}

TEST(Piezo, StaysWithinHalfItsRangeEitherWay) {
  Piezo piezo;
  piezo.loop = {};
  const TimeSeries wanted =
      displacement({0.0, 1.0, 2.0}, {Vector3d(0, 0, -1), Vector3d(0, 0, 1), Vector3d(0, 0, 0.01)});
  const TimeSeries stroke = apply_channel(wanted, piezo);
  EXPECT_EQ(stroke.value.minCoeff(), -0.05);
  EXPECT_EQ(stroke.value.maxCoeff(), 0.05);
  EXPECT_NEAR(value_at(stroke, 2.0)[0], 0.01, 1e-12);
}

TEST(Piezo, MovesInStepsOfItsResolutionToItsVeryEnds) {
  Piezo piezo;
  piezo.loop = {};
  piezo.resolution = 0.03;
  const TimeSeries wanted = displacement({0.0, 1.0}, {Vector3d::Zero(), Vector3d(0, 0, 0.2)});
  const TimeSeries stroke = apply_channel(wanted, piezo);
  EXPECT_NEAR(value_at(stroke, 0.10)[0], 0.03, 1e-15);
  EXPECT_NEAR(value_at(stroke, 0.05)[0], 0.0, 1e-15);
  EXPECT_EQ(value_at(stroke, 1.0)[0], 0.05);
}

TEST(Piezo, FollowsASineAsItsBandwidthSays) {
  Piezo piezo;
  piezo.cycle_s = 1e-4;
  piezo.loop = {PositionLoop::Order::Second, 30.0, 0.7};
  const double f = 20.0, amplitude = 0.02;
  std::vector<double> times;
  std::vector<Vector3d> values;
  for (int i = 0; i <= 20000; ++i) {
    times.push_back(1e-4 * i);
    values.push_back({0, 0, amplitude * std::sin(2 * pi * f * times.back())});
  }
  const TimeSeries stroke = apply_channel(displacement(times, values), piezo);
  double cosine = 0.0, sine = 0.0;
  const int n = 20000;
  for (int i = 0; i < n; ++i) {  // whole periods, settled
    const double t = 1.0 + 1.0 * (i + 0.5) / n, x = value_at(stroke, t)[0];
    sine += 2.0 / n * x * std::sin(2 * pi * f * t);
    cosine += 2.0 / n * x * std::cos(2 * pi * f * t);
  }
  const double r = f / 30.0;
  const double gain = 1.0 / std::hypot(1.0 - r * r, 2.0 * 0.7 * r);
  std::cout << "  gain " << std::hypot(sine, cosine) / amplitude << ", closed form " << gain
            << "\n";
  EXPECT_NEAR(std::hypot(sine, cosine), gain * amplitude, 0.002 * amplitude);
}

TEST(Piezo, YieldsTheWayItIsPushed) {
  Piezo piezo;
  piezo.stiffness = 20e3;
  EXPECT_DOUBLE_EQ(piezo_deflection(piezo, 100.0), 5e-3);
  EXPECT_DOUBLE_EQ(piezo_deflection(piezo, -100.0), -5e-3);
  for (const double bad : {0.0, -1.0, nan, infinity}) {
    piezo.stiffness = bad;
    EXPECT_THROW(piezo_deflection(piezo, 1.0), std::invalid_argument);
  }
}

TEST(Piezo, RefusesWhatItCannotBe) {
  const TimeSeries wanted = displacement({0.0}, {Vector3d::Zero()});
  const auto refuses = [&](const auto& change) {
    Piezo piezo;
    change(piezo);
    EXPECT_THROW(apply_channel(wanted, piezo), std::invalid_argument);
  };
  refuses([](Piezo& p) { p.direction_t = Vector3d(0, 0, 1.001); });
  refuses([](Piezo& p) { p.direction_t = Vector3d(0, 0, nan); });
  refuses([](Piezo& p) { p.range = 0.0; });
  refuses([](Piezo& p) { p.range = nan; });
  refuses([](Piezo& p) { p.resolution = -1.0; });
  refuses([](Piezo& p) { p.cycle_s = 0.0; });
  refuses([](Piezo& p) { p.loop.bandwidth = 0.0; });
  EXPECT_THROW(apply_channel(course({{0.0, 0.0}}), Piezo{}), std::invalid_argument);
}

}  // namespace
}  // namespace abbe::sim::compensation
