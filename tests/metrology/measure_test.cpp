#include "errors/metrology/instrument.h"
#include "tests/metrology/machines.h"
#include "tests/test.h"

using namespace abbe;
using namespace abbe::errors::metrology;
using kinematics::AxisState;

namespace {

namespace machines = abbe::errors::metrology::machines;

Instrument exact_laser() {
  Instrument i;
  i.name = "laser";
  i.axes = {'X'};
  return i;
}

/// One displacement channel read `count` times at one place.
Plan standing_still(const Channel& channel, int count, int axes) {
  Plan p;
  p.instrument = p.kind = "dial";
  SetUp s;
  s.channels = {channel};
  s.is_zero_unknown = false;
  p.set_ups = {s};
  for (int i = 0; i < count; ++i) {
    Measurement measurement;
    measurement.target = i;
    measurement.state.q = VectorXd::Zero(axes);
    measurement.state.time_s = i;
    p.measurements.push_back(measurement);
  }
  return p;
}

MachineUnderTest nowhere_special() {
  return [](const AxisState&) { return BodyPoses{}; };
}

}  // namespace

TEST(Measure, TheSameSeedReadsTheSameBitsAndAnotherDoesNot) {
  const machines::Chain chain = machines::gantry();
  for (const Kind kind : all_kinds()) {
    const Plan p = plan(typical_instrument(kind), chain);
    const VectorXd a = measure(p, chain, machines::perfect(chain), 11).value;
    const VectorXd b = measure(p, chain, machines::perfect(chain), 11).value;
    const VectorXd c = measure(p, chain, machines::perfect(chain), 12).value;
    EXPECT_EQ(a, b) << p.kind;
    if (kind != Kind::Temperature) {
      EXPECT_NE(a, c) << p.kind;
    }
  }
}

TEST(Measure, ALongerPlanLeavesTheFirstReadingsAlone) {
  const machines::Chain chain = machines::gantry();
  Instrument i = typical_instrument(Kind::Laser);
  const VectorXd few = measure(plan(i, chain), chain, machines::perfect(chain), 5).value;
  Plan longer = plan(i, chain);
  longer.measurements.push_back(longer.measurements.back());
  const VectorXd more = measure(longer, chain, machines::perfect(chain), 5).value;
  EXPECT_EQ(more.head(few.size()), few);
}

TEST(Measure, NoiseIsNormalAndAsLargeAsStated) {
  const machines::Chain chain = machines::gantry();
  Channel dial;
  dial.noise = 0.3_um;
  const int n = 100000;
  const std::uint64_t seed = 20250411;
  const VectorXd v =
      measure(standing_still(dial, n, chain.size()), chain, nowhere_special(), seed).value;
  const double mean = v.mean() / 0.3_um;
  const double sd = std::sqrt((v.array() - v.mean()).square().sum() / (n - 1)) / 0.3_um;
  const double beyond = double((v.array().abs() > 1.959964 * 0.3_um).count()) / n;
  const double together =
      (v.head(n - 1).array() * v.tail(n - 1).array()).mean() / (0.3_um * 0.3_um);
  std::cout << "seed " << seed << ": mean " << mean << " sigma, sd " << sd << " sigma, beyond 1.96 "
            << beyond << ", neighbours " << together << "\n";
  // Four standard errors each.
  EXPECT_LT(std::abs(mean), 4.0 / std::sqrt(n));
  EXPECT_LT(std::abs(sd - 1.0), 4.0 / std::sqrt(2.0 * n));
  EXPECT_LT(std::abs(beyond - 0.05), 4.0 * std::sqrt(0.05 * 0.95 / n));
  EXPECT_LT(std::abs(together), 4.0 / std::sqrt(n));
}

TEST(Measure, ReadingsAreMultiplesOfTheResolutionAndSpreadAsStated) {
  const machines::Chain chain = machines::gantry();
  Channel dial;
  dial.noise = 0.1_um;
  dial.resolution = 0.1_um;
  const int n = 100000;
  const VectorXd v =
      measure(standing_still(dial, n, chain.size()), chain, nowhere_special(), 7).value;
  for (const double x : v) ASSERT_NEAR(x / 0.1_um, std::round(x / 0.1_um), 1e-9);
  const double sd = std::sqrt(v.squaredNorm() / n);
  std::cout << "sd " << sd << " mm, stated " << standard_deviation(dial) << "\n";
  EXPECT_NEAR(sd / standard_deviation(dial), 1.0, 4.0 / std::sqrt(2.0 * n));
}

TEST(Measure, ReversalIsReadBack) {
  const machines::Chain chain = machines::three_axis();  // X carries the table
  const double half = -2.0_um;  // a carriage that lags; primed, so that the tool leads
  const auto machine = machines::wrong(chain, [&](const AxisState& state) {
    auto d = machines::none(chain);
    d[0].motion[0] = half * state.direction[0];
    return d;
  });
  const Plan p = plan(exact_laser(), chain);
  const Readings r = measure(p, chain, machine, 1);
  for (std::size_t i = 0; i < p.measurements.size(); ++i) {
    const AxisState& state = p.measurements[i].state;
    const double deviation = r.value[Index(i)] - state.q[0];
    // The counter was set on the way up; the table that lies back reads the tool ahead.
    const double expected = state.direction[0] > 0 ? 0.0 : 2.0 * half;
    EXPECT_NEAR(deviation, expected, 1e-12);
  }
}

TEST(Measure, CountersAreSetAtTheirFirstReading) {
  const machines::Chain chain = machines::gantry();
  const auto machine = machines::wrong(chain, [&](const AxisState& state) {
    auto d = machines::none(chain);
    d[1].motion[0] = 1e-5 * (state.q[1] + 400.0);
    return d;
  });
  const Plan p = plan(exact_laser(), chain);
  const Readings r = measure(p, chain, machine, 1);
  const double first = p.measurements[0].state.q[1];
  EXPECT_NEAR(r.value[0], first, 1e-12);
  for (std::size_t i = 0; i < p.measurements.size(); ++i) {
    const double q = p.measurements[i].state.q[1];
    EXPECT_NEAR(r.value[Index(i)], q + 1e-5 * (q - first), 1e-12);
  }
}

TEST(Measure, ScaleAndDriftAreDrawnWithTheirSigmas) {
  const machines::Chain chain = machines::gantry();
  Instrument i = exact_laser();
  i.bidirectional = false;
  i.scale_sigma = 1e-6;
  const int n = 4000;
  const auto spread = [&](const Instrument& instrument, const auto& figure) {
    const Plan p = plan(instrument, chain);
    double squares = 0.0;
    for (int seed = 0; seed < n; ++seed) {
      const VectorXd v = measure(p, chain, machines::perfect(chain), std::uint64_t(seed)).value;
      const double x = figure(p, v);
      squares += x * x;
    }
    return std::sqrt(squares / n);
  };
  const double scale = spread(i, [](const Plan& p, const VectorXd& v) {
    return (v.tail<1>()[0] - v[0]) /
               (p.measurements.back().state.q[1] - p.measurements[0].state.q[1]) -
           1.0;
  });
  i.scale_sigma = 0.0;
  i.drift_sigma = 1e-6;
  const double drift = spread(i, [](const Plan& p, const VectorXd& v) {
    return (v.tail<1>()[0] - p.measurements.back().state.q[1]) /
           (p.measurements.back().state.time_s - p.measurements[0].state.time_s);
  });
  std::cout << "scale " << scale << ", drift " << drift << " mm/s, both meant to be 1e-6\n";
  EXPECT_NEAR(scale / 1e-6, 1.0, 4.0 / std::sqrt(2.0 * n));
  EXPECT_NEAR(drift / 1e-6, 1.0, 4.0 / std::sqrt(2.0 * n));
}

TEST(Measure, TimeSinceASetUpCountsFromItsFirstReading) {
  const machines::Chain chain = machines::gantry();
  Instrument i = exact_laser();
  i.axes = {};
  i.start_s = -500.0;
  const Plan p = plan(i, chain);
  const VectorXd since = time_since_set_up(p);
  std::vector<double> first(p.set_ups.size(), NAN);
  for (std::size_t k = 0; k < p.measurements.size(); ++k) {
    double& start = first[std::size_t(p.measurements[k].set_up)];
    if (std::isnan(start)) {
      start = p.measurements[k].state.time_s;
      EXPECT_EQ(since[Index(k)], 0.0);
    }
    EXPECT_EQ(since[Index(k)], p.measurements[k].state.time_s - start);
  }
}

TEST(Measure, TemperaturesAloneHaveNoValues) {
  const machines::Chain chain = machines::lathe();
  Instrument log = typical_instrument(Kind::Temperature);
  log.interval_s = 60.0;
  log.duration_s = 600.0;
  const Readings r = measure(plan(log, chain), chain, machines::perfect(chain), 1);
  EXPECT_EQ(r.value.size(), 0);
  EXPECT_EQ(r.plan.measurements.size(), 11u);
  EXPECT_EQ(r.plan.measurements.back().state.time_s, 600.0);
}

TEST(Measure, SpindleIsReadAsItTurnsAndAnEccentricBallGoesRound) {
  for (const machines::Named& machine : machines::all()) {
    SCOPED_TRACE(machine.name);
    Instrument i = typical_instrument(Kind::Spindle);
    i.noise = i.resolution = i.drift_sigma = 0.0;
    i.runs = 2;
    const Plan p = plan(i, machine.chain);
    const Readings r = measure(p, machine.chain, machines::perfect(machine.chain), 4);
    const int joint = machine.chain.find('s') ? *machine.chain.find('s') : *machine.chain.find('S');
    double once = 0.0, axial = 0.0;
    for (std::size_t k = 0; k < p.measurements.size(); ++k) {
      EXPECT_EQ(p.measurements[k].state.spindle_speed, i.spindle_speed);
      EXPECT_NEAR(p.measurements[k].state.q[joint],
                  2.0 * pi * (p.measurements[k].run + p.measurements[k].target / 64.0), 1e-12);
      double& most = p.measurements[k].channel == 4 ? axial : once;
      most = std::max(most, std::abs(r.value[Index(k)]));
    }
    EXPECT_GT(once, 1.0_um);
    EXPECT_LT(axial, 1e-12);
    // One turn later everything is where it was.
    const std::size_t turn = p.measurements.size() / 2;
    for (std::size_t k = 0; k < turn; ++k)
      ASSERT_NEAR(r.value[Index(k)], r.value[Index(k + turn)], 1e-12);
  }
}

TEST(Measure, PlansThatDoNotFitAreRefused) {
  const machines::Chain chain = machines::gantry();
  const Plan good = plan(exact_laser(), chain);
  const auto refused = [&](const std::function<void(Plan&)>& change) {
    Plan bad = good;
    change(bad);
    EXPECT_THROW(measure(bad, chain, machines::perfect(chain), 1), std::invalid_argument);
  };
  refused([](Plan& p) { p.measurements[3].set_up = 1; });
  refused([](Plan& p) { p.measurements[3].set_up = -1; });
  refused([](Plan& p) { p.measurements[3].channel = 1; });
  refused([](Plan& p) { p.measurements[3].channel = -1; });
  refused([](Plan& p) { p.measurements[3].state.q.resize(2); });
  refused([](Plan& p) { p.measurements[3].state.q[0] = NAN; });
  refused([](Plan& p) { p.measurements[3].state.time_s = INFINITY; });
  refused([](Plan& p) {  // a mirror edge on
    p.set_ups[0].channels[0].quantity = Quantity::Mirror;
    p.set_ups[0].channels[0].normal_of = Vector3d::UnitZ();
  });
}
