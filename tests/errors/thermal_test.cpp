#include "errors/thermal_run.h"
#include "tests/oracles/thermal_oracle.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

/// One node, tau = capacity / conductance, at 20 deg C.
ThermalNetwork one_node(double capacity, double conductance) {
  return {{{"block", capacity}},
          {},
          {{0, Surroundings::Room, conductance}},
          {},
          VectorXd::Constant(1, 20.0)};
}

Activity activity_at(double time_s, double room_T_C = 20.0) {
  Activity activity;
  activity.time_s = time_s;
  activity.room_T_C = room_T_C;
  return activity;
}

/// Spindle, column, bed in a row; the bed and the column lose heat to the room, the spindle to the
/// coolant.
ThermalNetwork small_machine() {
  ThermalNetwork network;
  network.nodes = {{"spindle", 8e3}, {"column", 1.2e5}, {"bed", 6e5}};
  network.links = {{0, 1, 25.0}, {1, 2, 40.0}};
  network.surroundings = {{1, Surroundings::Room, 12.0},
                          {2, Surroundings::Room, 20.0},
                          {0, Surroundings::Coolant, 30.0}};
  network.sources = {{0, SpindleHeat{900.0, 12000 * units::rpm, 1.5}},
                     {1, AxisHeat{0, 300.0, 0.5}},
                     {2, PowerOnHeat{150.0}},
                     {0, CuttingHeat{0.1}}};
  network.start_T_C = VectorXd::Constant(3, 20.0);
  return network;
}

Activity working(double time_s) {
  Activity activity = activity_at(time_s);
  activity.spindle_speed = 9000 * units::rpm;
  activity.axis_speed = kinematics::AxisVector::Constant(1, 80.0);
  activity.cutting_power_W = 700.0;
  return activity;
}

// ---- closed forms

TEST(Thermal, AFirstOrderNodeReaches1Minus1OverEAtTau) {
  for (const double tau : {1e-3, 1.0, 300.0, 1e6}) {
    const ThermalRun run = simulate(one_node(5.0 * tau, 5.0), std::vector{activity_at(0, 30.0)});
    const double reached = (temperatures(run, tau)[0] - 20.0) / 10.0;
    const double off = reached - (1.0 - std::exp(-1.0));
    std::cout << "tau " << tau << " s: off by " << off << "\n";
    EXPECT_NEAR(off, 0.0, 1e-12);
  }
}

TEST(Thermal, ARampOfHeatIsMetExactly) {
  // C T' = -G (T - 20) + r t: T - 20 = (r / G) (t - tau (1 - e^(-t / tau)))
  ThermalNetwork network = one_node(1000.0, 4.0);
  network.sources = {{0, CuttingHeat{1.0}}};
  Activity end = activity_at(500.0);
  end.cutting_power_W = 600.0;
  const ThermalRun run = simulate(network, std::vector{activity_at(0), end});
  const double tau = 250.0, per_s = 600.0 / 500.0;
  for (const double t : {0.0, 1e-9, 1.0, 250.0, 499.0, 500.0}) {
    const double expected = per_s / 4.0 * (t + tau * std::expm1(-t / tau));
    EXPECT_NEAR(temperatures(run, t)[0] - 20.0, expected, 2e-14 * 75) << t;
  }
  const double after = temperatures(run, 500.0 + tau)[0] - 20.0;  // the heat of the end goes on
  const double at_end = temperatures(run, 500.0)[0] - 20.0;
  EXPECT_NEAR(after, 150.0 + (at_end - 150.0) * std::exp(-1.0), 1e-12);
}

/// A room of mean 20 and amplitude 5 over `periods` periods, `per_period` knots each.
std::vector<Activity> swinging_room(double omega, int periods, int per_period) {
  std::vector<Activity> knots;
  for (int i = 0; i <= periods * per_period; ++i) {
    const double angle = 2 * pi * i / per_period;
    knots.push_back(activity_at(angle / omega, 20.0 + 5.0 * std::sin(angle)));
  }
  return knots;
}

struct Swing {
  double gain = 0.0, lag = 0.0;
};

/// Gain and lag in the last period, by projection on sine and cosine at 720 even instants.
Swing swing_of(const ThermalRun& run, double omega) {
  const double end_s = run.knots.back().time_s;
  double sine = 0.0, cosine = 0.0;
  for (int i = 0; i < 720; ++i) {
    const double t = end_s - (2 * pi / omega) * i / 720.0;
    const double T = temperatures(run, t)[0] - 20.0;
    sine += T * std::sin(omega * t) / 360.0;
    cosine += T * std::cos(omega * t) / 360.0;
  }
  return {std::hypot(sine, cosine) / 5.0, std::atan2(-cosine, sine)};
}

TEST(Thermal, ASinusoidalRoomIsFollowedWithTheGainAndLagOfAFirstOrderNode) {
  const double tau = 600.0;
  for (const double omega_tau : {0.1, 1.0, 10.0}) {
    const double omega = omega_tau / tau;
    const int periods = 1 + int(std::ceil(40.0 * omega_tau / (2 * pi)));  // e^-40: settled
    const ThermalRun run = simulate(one_node(6000.0, 10.0), swinging_room(omega, periods, 7200));
    const Swing swing = swing_of(run, omega);
    const double gain = 1.0 / std::sqrt(1.0 + omega_tau * omega_tau);
    std::cout << "omega tau " << omega_tau << ": gain " << swing.gain << " off by "
              << swing.gain - gain << ", lag " << swing.lag << " off by "
              << swing.lag - std::atan(omega_tau) << "\n";
    const double chords = std::pow(2 * pi / 7200, 2) / 12.0;  // a polygon has sinc^2 of the sinus
    EXPECT_NEAR(swing.gain / gain, 1.0 - chords, 1e-10);
    EXPECT_NEAR(swing.lag, std::atan(omega_tau), 1e-10);
  }
}

TEST(Thermal, ASinusoidalRoomConvergesAtSecondOrderInTheKnotSpacing) {
  const double tau = 600.0, omega = 1.0 / tau;
  const auto exact = [&](double t) {  // from 20 deg C at t = 0
    const double wt = omega * tau;
    return 5.0 / (1 + wt * wt) *
           (std::sin(omega * t) - wt * std::cos(omega * t) + wt * std::exp(-t / tau));
  };
  double last = 0.0;
  for (const int per_period : {16, 32, 64, 128, 256, 512}) {
    const ThermalRun run = simulate(one_node(6000.0, 10.0), swinging_room(omega, 3, per_period));
    double worst = 0.0;
    for (int i = 0; i <= 3000; ++i) {
      const double t = run.knots.back().time_s * i / 3000.0;
      worst = std::max(worst, std::abs(temperatures(run, t)[0] - 20.0 - exact(t)));
    }
    if (last > 0.0) {
      const double order = std::log2(last / worst);
      std::cout << per_period << " knots a period: " << worst << " K, order " << order << "\n";
      EXPECT_NEAR(order, 2.0, 0.05);
    }
    last = worst;
  }
}

TEST(Thermal, AKnotASecondForElevenDaysAddsNoError) {
  // near the steady state a knot's change is far below an ulp: it must not stop there
  ThermalNetwork network = one_node(1e5 * 3.0, 3.0);  // tau 1e5 s
  network.sources = {{0, PowerOnHeat{60.0}}};
  std::vector<Activity> knots;
  for (int i = 0; i <= 1'000'000; ++i) knots.push_back(activity_at(i));
  const ThermalRun run = simulate(network, knots);
  double worst = 0.0;
  for (const int i : {1, 10, 1000, 10'800, 100'000, 300'000, 1'000'000})
    worst = std::max(worst, std::abs(run.T_C(i, 0) - 20.0 + 20.0 * std::expm1(-i / 1e5)));
  std::cout << "worst " << worst << " K of 20 K\n";
  EXPECT_LT(worst, 2e-11);
}

// ---- the oracle

oracles::HeatNetwork oracle_of(const ThermalNetwork& network, bool coolant) {
  oracles::HeatNetwork same;
  for (const ThermalNode& node : network.nodes) same.capacity.push_back(node.capacity_J_per_K);
  for (const ThermalLink& link : network.links)
    same.links.push_back({link.a, link.b, link.conductance_W_per_K});
  for (const SurroundingsLink& link : network.surroundings) {
    if (link.to == Surroundings::Room)
      same.links.push_back({link.node, -1, link.conductance_W_per_K});
    else if (coolant)
      same.links.push_back({link.node, -2, link.conductance_W_per_K});
  }
  return same;
}

oracles::HeatInput input_of(const ThermalNetwork& network, const Activity& activity) {
  oracles::HeatInput input{std::vector<double>(network.nodes.size(), 0.0),
                           {activity.room_T_C, activity.coolant_T_C}};
  for (const HeatSource& source : network.sources)
    input.heat[std::size_t(source.node)] += heat_W(source, activity);
  return input;
}

/// The oracle's states at the knots.
std::vector<oracles::HeatState> oracle_run(const ThermalNetwork& network,
                                           const std::vector<Activity>& knots, int sensed = 0,
                                           double lag = 1.0) {
  std::vector<oracles::HeatState> states{
      {{network.start_T_C.begin(), network.start_T_C.end()}, network.start_T_C[sensed]}};
  for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
    oracles::HeatNetwork same = oracle_of(network, knots[i].coolant);
    same.sensed = sensed;
    same.lag = lag;
    states.push_back(oracles::heat_after(same, states.back(), input_of(network, knots[i]),
                                         input_of(network, knots[i + 1]),
                                         knots[i + 1].time_s - knots[i].time_s)
                         .state);
  }
  return states;
}

double largest_change(const ThermalRun& run) {
  return (run.T_C.rowwise() - run.T_C.row(0)).cwiseAbs().maxCoeff();
}

struct Draw {
  explicit Draw(unsigned seed) : random(seed) {}
  double even(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  double logarithmic(double low, double high) {
    return std::exp(even(std::log(low), std::log(high)));
  }
  int below(int n) { return int(even(0, n)); }
  std::mt19937 random;
};

/// A connected network of n nodes, capacities and conductances over the decades given.
ThermalNetwork random_network(Draw& draw, int n, double decades) {
  const double low = std::pow(10.0, -decades / 2), high = std::pow(10.0, decades / 2);
  ThermalNetwork network;
  for (int i = 0; i < n; ++i)
    network.nodes.push_back({"n" + std::to_string(i), 1e4 * draw.logarithmic(low, high)});
  for (int i = 1; i < n; ++i)
    network.links.push_back({i, draw.below(i), 10.0 * draw.logarithmic(low, high)});
  for (int i = 0; i + 2 < n; ++i)
    network.links.push_back({i, n - 1, 10.0 * draw.logarithmic(low, high)});
  network.surroundings = {{0, Surroundings::Room, 5.0 * draw.logarithmic(low, high)},
                          {draw.below(n), Surroundings::Room, 5.0 * draw.logarithmic(low, high)},
                          {n - 1, Surroundings::Coolant, 20.0 * draw.logarithmic(low, high)}};
  for (int i = 0; i < n; ++i) network.sources.push_back({i, CuttingHeat{draw.even(0, 1)}});
  network.start_T_C.resize(n);
  for (double& T : network.start_T_C) T = draw.even(15, 25);
  return network;
}

/// Stretches from a millisecond to a day, jumps among them.
std::vector<Activity> random_knots(Draw& draw, int n) {
  std::vector<Activity> knots;
  double time_s = -5000.0;
  for (int i = 0; i < n; ++i) {
    Activity knot = activity_at(time_s, draw.even(10, 30));
    knot.coolant_T_C = draw.even(15, 20);
    knot.coolant = draw.below(3) == 0;
    knot.cutting_power_W = draw.even(0, 500);
    knots.push_back(knot);
    if (draw.below(4) != 0) time_s += draw.logarithmic(1e-3, 1e5);
  }
  return knots;
}

TEST(Thermal, RandomNetworksAgreeWithTheMatrixExponential) {
  const unsigned seed = 20250301;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Draw draw(seed);
  double worst = 0.0;
  for (int round = 0; round < 12; ++round) {
    const ThermalNetwork network = random_network(draw, 1 + draw.below(7) + 1, 2.0);
    const std::vector<Activity> knots = random_knots(draw, 14);
    const ThermalRun run = simulate(network, knots);
    const auto states = oracle_run(network, knots);
    double off = 0.0;
    for (std::size_t i = 0; i < knots.size(); ++i)
      for (std::size_t k = 0; k < network.nodes.size(); ++k)
        off = std::max(off, std::abs(run.T_C(Index(i), Index(k)) - states[i].T[k]));
    worst = std::max(worst, off / largest_change(run));
  }
  std::cout << "worst " << worst << " of the largest change\n";
  EXPECT_LT(worst, 1e-12);
}

TEST(Thermal, BetweenTheKnotsItIsExactToo) {
  const unsigned seed = 7;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Draw draw(seed);
  const ThermalNetwork network = random_network(draw, 5, 2.0);
  const std::vector<Activity> knots = random_knots(draw, 12);
  const ThermalRun run = simulate(network, knots);
  double worst = 0.0;
  for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
    const double length = knots[i + 1].time_s - knots[i].time_s;
    if (length == 0.0) continue;
    const double part = draw.even(0, 1);
    Activity between = knots[i];
    between.time_s += part * length;
    for (const auto number :
         {&Activity::room_T_C, &Activity::coolant_T_C, &Activity::cutting_power_W})
      between.*number += part * (knots[i + 1].*number - knots[i].*number);
    std::vector<Activity> split(knots.begin(), knots.begin() + std::ptrdiff_t(i) + 1);
    split.push_back(between);
    const VectorXd expected = simulate(network, split).T_C.bottomRows(1).transpose();
    worst = std::max(worst, (temperatures(run, between.time_s) - expected).cwiseAbs().maxCoeff());
  }
  std::cout << "worst " << worst << " K\n";
  EXPECT_LT(worst, 1e-12 * largest_change(run));
}

/// Two lumps that exchange heat in a millisecond and lose it in a fortnight.
ThermalNetwork stiff_network() {
  ThermalNetwork network;
  network.nodes = {{"bearing", 1.0}, {"housing", 2.0}, {"bed", 1e6}};
  network.links = {{0, 1, 700.0}, {1, 2, 1.0}};
  network.surroundings = {{2, Surroundings::Room, 1.0}, {1, Surroundings::Coolant, 40.0}};
  network.sources = {{0, PowerOnHeat{20.0}}, {0, CuttingHeat{1.0}}};
  network.start_T_C = (VectorXd(3) << 20, 25, 18).finished();
  return network;
}

TEST(Thermal, RatesFrom1eMinus6To1e3AreMet) {
  const ThermalNetwork network = stiff_network();
  std::vector<Activity> knots;
  for (const double t : {0.0, 1e-7, 1e-3, 2e-3, 1.0, 1.0, 60.0, 1e4, 1e6, 1e6 + 1e-3, 3e6})
    knots.push_back(activity_at(t, 20.0 + std::cos(t)));
  knots[4].cutting_power_W = 30.0;
  knots[6].coolant = true;
  const ThermalRun run = simulate(network, knots);
  std::cout << "rates " << run.dry.rate_per_s.transpose() << " a second\n";
  EXPECT_GT(run.dry.rate_per_s.maxCoeff(), 1e3);
  EXPECT_LT(run.dry.rate_per_s.minCoeff(), 1.1e-6);
  const auto states = oracle_run(network, knots);
  double worst = 0.0;
  for (std::size_t i = 0; i < knots.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      worst = std::max(worst, std::abs(run.T_C(Index(i), Index(k)) - states[i].T[k]));
  std::cout << "worst " << worst / largest_change(run) << " of the largest change\n";
  EXPECT_LT(worst, 1e-12 * largest_change(run));
}

TEST(Thermal, RandomStiffNetworksAreMet) {
  const unsigned seed = 20250302;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Draw draw(seed);
  double worst = 0.0, farthest = 0.0;
  for (int round = 0; round < 12; ++round) {
    const ThermalNetwork network = random_network(draw, 3 + draw.below(4), 5.0);
    const std::vector<Activity> knots = random_knots(draw, 10);
    const ThermalRun run = simulate(network, knots);
    farthest = std::max(farthest, run.dry.rate_per_s.maxCoeff() / run.dry.rate_per_s.minCoeff());
    const auto states = oracle_run(network, knots);
    double off = 0.0;
    for (std::size_t i = 0; i < knots.size(); ++i)
      for (std::size_t k = 0; k < network.nodes.size(); ++k)
        off = std::max(off, std::abs(run.T_C(Index(i), Index(k)) - states[i].T[k]));
    worst = std::max(worst, off / largest_change(run));
  }
  std::cout << "rates up to " << farthest << " apart: worst " << worst
            << " of the largest change\n";
  EXPECT_LT(worst, 1e-12);
}

// ---- energy

/// phi1 = (1 - e^-x) / x, phi2 = (1 - phi1) / x, phi3 = (1/2 - phi2) / x, x >= 0.
double phi(int order, double x) {
  if (x >= 1.0)
    return order == 1 ? -std::expm1(-x) / x : (1.0 / (order - 1) - phi(order - 1, x)) / x;
  double term = 1.0 / std::tgamma(order + 1.0), sum = term;
  for (int k = 1; k < 24; ++k) sum += term *= -x / (k + order);
  return sum;
}

/// Heat between two knots of a run, J: from its sources, to its surroundings, in its nodes.
struct HeatBalance {
  double generated_J = 0.0;
  double to_surroundings_J = 0.0;
  double stored_J = 0.0;
};

/// Conductance times the temperature of the surroundings over that of the room at the start, W.
VectorXd surroundings_W(const ThermalRun& run, std::size_t knot, bool coolant) {
  const double base = run.knots.front().room_T_C;
  VectorXd flow = VectorXd::Zero(Index(run.network.nodes.size()));
  for (const SurroundingsLink& link : run.network.surroundings)
    if (coolant || link.to == Surroundings::Room)
      flow[link.node] += link.conductance_W_per_K *
                         ((link.to == Surroundings::Room ? run.knots[knot].room_T_C
                                                         : run.knots[knot].coolant_T_C) -
                          base);
  return flow;
}

/// The balance with the temperatures integrated in closed form, mode by mode.
HeatBalance heat_balance(const ThermalRun& run, std::size_t from, std::size_t to) {
  HeatBalance balance;
  const double base = run.knots.front().room_T_C;
  for (std::size_t i = from; i < to; ++i) {
    const bool coolant = run.knots[i].coolant;
    const ThermalModes& modes = coolant ? run.wet : run.dry;
    const double h = run.knots[i + 1].time_s - run.knots[i].time_s;
    const VectorXd heat = run.heat_W.row(Index(i)), next_heat = run.heat_W.row(Index(i) + 1);
    const VectorXd room = surroundings_W(run, i, coolant);
    const VectorXd next_room = surroundings_W(run, i + 1, coolant);
    const VectorXd z = modes.to_modes * (run.T_C.row(Index(i)).transpose().array() - base).matrix();
    const VectorXd flow = modes.to_nodes.transpose() * (heat + room);
    const VectorXd rise = modes.to_nodes.transpose() * (next_heat + next_room) - flow;
    VectorXd integral(z.size());
    for (Index k = 0; k < z.size(); ++k) {
      const double x = modes.rate_per_s[k] * h;
      integral[k] = h * (phi(1, x) * z[k] + h * (phi(2, x) * flow[k] + phi(3, x) * rise[k]));
    }
    const VectorXd above = modes.to_nodes * integral;  // K s over the base
    balance.generated_J += 0.5 * h * (heat.sum() + next_heat.sum());
    for (const SurroundingsLink& link : run.network.surroundings)
      if (coolant || link.to == Surroundings::Room)
        balance.to_surroundings_J += link.conductance_W_per_K * above[link.node];
    balance.to_surroundings_J -= 0.5 * h * (room.sum() + next_room.sum());
  }
  for (Index k = 0; k < Index(run.network.nodes.size()); ++k)
    balance.stored_J += run.network.nodes[std::size_t(k)].capacity_J_per_K *
                        (run.T_C(Index(to), k) - run.T_C(Index(from), k));
  return balance;
}

/// generated - to_surroundings - stored, over the largest of them.
double imbalance(const ThermalRun& run, std::size_t from, std::size_t to) {
  const HeatBalance b = heat_balance(run, from, to);
  const double largest =
      std::max({std::abs(b.generated_J), std::abs(b.to_surroundings_J), std::abs(b.stored_J)});
  const double off = b.generated_J - b.to_surroundings_J - b.stored_J;
  return largest == 0.0 ? std::abs(off) : std::abs(off) / largest;
}

TEST(Thermal, TheHeatBalanceClosesTo1eMinus10) {
  const unsigned seed = 4711;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Draw draw(seed);
  double worst = 0.0;
  for (int round = 0; round < 40; ++round) {
    const ThermalNetwork network = random_network(draw, 2 + draw.below(10), 2.0);
    const ThermalRun run = simulate(network, random_knots(draw, 20));
    worst = std::max(worst, imbalance(run, 0, 19));
    worst = std::max(worst, imbalance(run, 3, 11));
  }
  std::cout << "random networks: " << worst << "\n";
  EXPECT_LT(worst, 1e-10);
  std::vector<Activity> knots;
  for (const double t : {0.0, 1e-3, 1.0, 1e4, 3e6})
    knots.push_back(activity_at(t, 15.0 + t * 1e-6));
  const double stiff = imbalance(simulate(stiff_network(), knots), 0, 4);
  std::cout << "rates 1e9 apart: " << stiff << "\n";
  EXPECT_LT(stiff, 1e-10);
}

TEST(Thermal, EachTermOfTheBalanceIsRight) {
  // a block of tau = 100 s under 50 W from 20 deg C: T - 20 = 12.5 (1 - e^(-t / tau))
  ThermalNetwork network = one_node(400.0, 4.0);
  network.sources = {{0, PowerOnHeat{50.0}}};
  const ThermalRun run =
      simulate(network, std::vector{activity_at(0), activity_at(30), activity_at(200)});
  const HeatBalance balance = heat_balance(run, 0, 2);
  EXPECT_NEAR(balance.generated_J, 50.0 * 200, 1e-9);
  EXPECT_NEAR(balance.stored_J, -400.0 * 12.5 * std::expm1(-2.0), 1e-9);
  EXPECT_NEAR(balance.to_surroundings_J, 4.0 * 12.5 * (200.0 + 100.0 * std::expm1(-2.0)), 1e-9);
  EXPECT_EQ(heat_balance(run, 1, 1).generated_J, 0.0);
}

// ---- steady state

/// The temperatures at which the heat of each node is what it gives to others and to its
/// surroundings.
VectorXd steady_state(const ThermalNetwork& network, const Activity& activity) {
  const Index n = Index(network.nodes.size());
  Eigen::MatrixXd conductance = Eigen::MatrixXd::Zero(n, n);
  VectorXd heat = VectorXd::Zero(n);
  for (const ThermalLink& link : network.links) {
    conductance(link.a, link.a) += link.conductance_W_per_K;
    conductance(link.b, link.b) += link.conductance_W_per_K;
    conductance(link.a, link.b) -= link.conductance_W_per_K;
    conductance(link.b, link.a) -= link.conductance_W_per_K;
  }
  for (const SurroundingsLink& link : network.surroundings) {
    const bool is_room = link.to == Surroundings::Room;
    if (!is_room && !activity.coolant) continue;
    conductance(link.node, link.node) += link.conductance_W_per_K;
    heat[link.node] +=
        link.conductance_W_per_K * (is_room ? activity.room_T_C : activity.coolant_T_C);
  }
  for (const HeatSource& source : network.sources) heat[source.node] += heat_W(source, activity);
  return conductance.fullPivLu().solve(heat);
}

TEST(Thermal, ALongRunEndsInTheSteadyState) {
  for (const bool coolant : {false, true}) {
    Activity activity = working(0);
    activity.coolant = coolant;
    activity.room_T_C = 26.0;
    activity.coolant_T_C = 17.0;
    const VectorXd steady = steady_state(small_machine(), activity);
    const VectorXd late = temperatures(simulate(small_machine(), std::vector{activity}), 1e7);
    std::cout << "steady " << steady.transpose() << ", apart by "
              << (late - steady).cwiseAbs().maxCoeff() << " K\n";
    EXPECT_LT((late - steady).cwiseAbs().maxCoeff(), 1e-11);
    double in = 0.0, out = 0.0;
    for (const HeatSource& source : small_machine().sources) in += heat_W(source, activity);
    for (const SurroundingsLink& link : small_machine().surroundings) {
      if (link.to == Surroundings::Room)
        out += link.conductance_W_per_K * (steady[link.node] - 26.0);
      else if (coolant)
        out += link.conductance_W_per_K * (steady[link.node] - 17.0);
    }
    EXPECT_NEAR(out, in, 1e-10 * in);
  }
}

// ---- what a machine does

TEST(Thermal, AMachineAtTheTemperatureOfItsRoomStaysThereToTheLastBit) {
  ThermalNetwork network = small_machine();
  network.start_T_C.setConstant(21.7);
  Activity idle = activity_at(0, 21.7);
  idle.powered = false;
  std::vector<Activity> knots;
  for (int i = 0; i < 1000; ++i) {
    idle.time_s = i * 7.3;
    knots.push_back(idle);
  }
  const ThermalRun run = simulate(network, knots);
  EXPECT_TRUE((run.T_C.array() == 21.7).all());
  EXPECT_TRUE((temperatures(run, 1234.5).array() == 21.7).all());
  EXPECT_TRUE((temperatures(run, 1e9).array() == 21.7).all());
}

TEST(Thermal, HeatFollowsItsLaw) {
  Activity activity = working(0);
  const SpindleHeat spindle{900.0, 12000 * units::rpm, 1.5};
  EXPECT_NEAR(heat_W({0, spindle}, activity), 900.0 * std::pow(0.75, 1.5), 1e-10);
  activity.spindle_speed = -activity.spindle_speed;
  EXPECT_NEAR(heat_W({0, spindle}, activity), 900.0 * std::pow(0.75, 1.5), 1e-10);
  activity.spindle_speed = 0.0;
  EXPECT_EQ(heat_W({0, SpindleHeat{900.0, 1.0, 0.0}}, activity), 0.0) << "at rest no heat";
  // 300 N at 80 mm/s are 24 W, 0.5 N s/mm (80 mm/s)^2 are 3.2 W
  EXPECT_NEAR(heat_W({0, AxisHeat{0, 300.0, 0.5}}, activity), 27.2, 1e-12);
  EXPECT_EQ(heat_W({0, AxisHeat{3, 300.0, 0.5}}, activity), 0.0) << "a speed not said is rest";
  // a table: 2 N m and 3 N m s/rad at 2 rad/s
  activity.axis_speed[0] = -2.0;
  EXPECT_NEAR(heat_W({0, AxisHeat{0, 2e3, 3e3}}, activity), 16.0, 1e-12);
  EXPECT_NEAR(heat_W({0, CuttingHeat{0.1}}, activity), 70.0, 1e-12);
  EXPECT_EQ(heat_W({0, PowerOnHeat{150.0}}, activity), 150.0);
  activity.powered = false;
  EXPECT_EQ(heat_W({0, PowerOnHeat{150.0}}, activity), 0.0);
}

TEST(Thermal, TheCoolantCoolsWhileItFlowsAndHoldsUntilTheNextKnot) {
  ThermalNetwork network = one_node(1000.0, 1e-9);
  network.surroundings.push_back({0, Surroundings::Coolant, 10.0});
  std::vector knots{activity_at(0), activity_at(100), activity_at(200)};
  for (Activity& knot : knots) knot.coolant_T_C = 10.0;
  knots[1].coolant = true;
  const ThermalRun run = simulate(network, knots);
  EXPECT_NEAR(temperatures(run, 100)[0], 20.0, 1e-9);
  EXPECT_NEAR(temperatures(run, 150)[0], 10.0 + 10.0 * std::exp(-0.5), 1e-8);
  EXPECT_NEAR(temperatures(run, 200)[0], 10.0 + 10.0 * std::exp(-1.0), 1e-8);
  EXPECT_NEAR(temperatures(run, 400)[0], 10.0 + 10.0 * std::exp(-1.0), 1e-8) << "it is off again";
}

TEST(Thermal, EqualInstantsAreAJump) {
  ThermalNetwork network = one_node(1000.0, 10.0);
  network.sources = {{0, CuttingHeat{1.0}}};
  Activity before = activity_at(100), after = activity_at(100);
  after.cutting_power_W = 80.0;
  const ThermalRun run = simulate(network, std::vector{activity_at(0), before, before, after});
  EXPECT_EQ(temperatures(run, 100)[0], 20.0) << "no heat before the jump";
  EXPECT_NEAR(temperatures(run, 200)[0], 20.0 - 8.0 * std::expm1(-1.0), 1e-13);
  EXPECT_EQ(heat_balance(run, 1, 3).generated_J, 0.0);
}

TEST(Thermal, BeforeTheFirstKnotItIsTheStartAndAfterTheLastItGoesOn) {
  ThermalNetwork network = small_machine();
  network.start_T_C << 30.0, 20.0, 10.0;
  const ThermalRun run = simulate(network, std::vector{working(-100), working(50)});
  EXPECT_EQ(temperatures(run, -1e9), network.start_T_C);
  EXPECT_EQ(temperatures(run, -100), network.start_T_C);
  const ThermalRun longer =
      simulate(network, std::vector{working(-100), working(50), working(900)});
  EXPECT_LT((temperatures(run, 900) - temperatures(longer, 900)).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_EQ(temperatures(run, 50), VectorXd(run.T_C.row(1)));
}

TEST(Thermal, ASingleKnotIsEnough) {
  const ThermalRun run = simulate(one_node(100.0, 1.0), std::vector{activity_at(5, 30.0)});
  EXPECT_EQ(run.T_C.rows(), 1);
  EXPECT_EQ(temperatures(run, 5)[0], 20.0);
  EXPECT_NEAR(temperatures(run, 105)[0], 30.0 - 10.0 * std::exp(-1.0), 1e-13);
  EXPECT_EQ(heat_balance(run, 0, 0).stored_J, 0.0);
}

// ---- refusals

std::string refusal_to_simulate(const ThermalNetwork& network,
                                std::vector<Activity> knots = {activity_at(0)}) {
  return thrown_text<std::invalid_argument>([&] { simulate(network, knots); });
}

template <typename Change>
std::string refusal_of_changed(Change change) {
  ThermalNetwork network = small_machine();
  change(network);
  return refusal_to_simulate(network);
}

TEST(Thermal, ANetworkThatCannotBeIsRefusedByName) {
  EXPECT_EQ(refusal_to_simulate(small_machine()), "");
  using Network = ThermalNetwork;
  for (const double capacity : {-5.0, 0.0, infinity, std::nan("")}) {
    const std::string message =
        refusal_of_changed([&](Network& n) { n.nodes[1].capacity_J_per_K = capacity; });
    EXPECT_HAS(message, "node column: expected a heat capacity above 0");
  }
  EXPECT_EQ(refusal_of_changed([](Network& n) {
              n.links.pop_back(), n.surroundings.erase(n.surroundings.begin() + 1);
            }),
            "node bed: no heat path to the room");
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.links.erase(n.links.begin()); }),
            "node spindle: no heat path to the room")
      << "the coolant is no room: it does not always flow";
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.links[0].b = 0; }),
            "node spindle: linked to itself");
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.links[0].conductance_W_per_K = -1; }),
            "link of node spindle and node column: expected a conductance above 0, seen -1");
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.surroundings[0].conductance_W_per_K = 0; }),
            "link of node column to the room: expected a conductance above 0, seen 0");
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.links[0].a = 3; }),
            "link: expected a node from 0 to 2, seen 3");
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.nodes[2].name = "spindle"; }),
            "node spindle: given twice");
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.nodes[2].name = ""; }),
            "node 2: expected a name");
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.sources[2].node = -1; }),
            "heat source 3: expected a node from 0 to 2, seen -1");
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.sources[3].law = CuttingHeat{1.5}; }),
            "heat source 4 at node spindle: expected a fraction of the cutting power from 0 to 1, "
            "seen 1.5");
  EXPECT_EQ(refusal_of_changed([](Network& n) { n.start_T_C[1] = infinity; }),
            "node column: expected a finite start temperature, seen inf");
  EXPECT_NE(refusal_of_changed([](Network& n) { n.start_T_C.resize(2); }), "");
  EXPECT_EQ(refusal_to_simulate({}), "thermal network: expected at least one node");
  EXPECT_HAS(refusal_of_changed([](Network& n) {
               n.nodes[0].capacity_J_per_K = 5e-324, n.links[0].conductance_W_per_K = 1e308;
             }),
             "exceed the numeric range");
}

TEST(Thermal, AnActivityThatCannotBeIsRefused) {
  EXPECT_EQ(refusal_to_simulate(small_machine(), {}), "activity: expected at least one knot");
  EXPECT_EQ(refusal_to_simulate(small_machine(), {activity_at(1), activity_at(0)}),
            "activity: time decreases from 1 s to 0 s");
  EXPECT_NE(refusal_to_simulate(small_machine(), {activity_at(std::nan(""))}), "");
  EXPECT_NE(refusal_to_simulate(small_machine(), {activity_at(0, infinity)}), "");
  ThermalNetwork network = small_machine();
  network.sources[1].law = AxisHeat{2, 1.0, 1.0};
  EXPECT_EQ(refusal_to_simulate(network, {working(0)}),
            "activity at 0 s: expected the speed of joint 2, seen 1 speeds");
}

// ---- sensors

VectorXd every(double step, int n, double from = 0.0) {
  return VectorXd::LinSpaced(n, from, from + step * (n - 1));
}

TEST(TemperatureSensor, ReadsItsNodeAtWholeMultiplesOfItsSamplingTime) {
  const ThermalRun run = simulate(small_machine(), std::vector{working(-100), working(500)});
  TemperatureSensor sensor{.name = "T1", .node = 1, .offset_K = 0.25, .sampling_s = 10.0};
  const VectorXd times = every(0.7, 400, -50.0);
  const VectorXd seen = readings(sensor, run, times);
  for (Index i = 0; i < times.size(); ++i) {
    const double sampled = 10.0 * std::floor(times[i] / 10.0);
    EXPECT_EQ(seen[i], temperatures(run, sampled)[1] + 0.25) << times[i];
  }
  EXPECT_EQ(readings(sensor, run, VectorXd::Constant(1, -200.0))[0], 20.25) << "before the history";
}

TEST(TemperatureSensor, ASamplingTimeThatIsNoBinaryFractionSamplesOnItsMultiples) {
  const ThermalRun run = simulate(small_machine(), std::vector{working(0)});
  const TemperatureSensor sensor{.name = "T1", .sampling_s = 0.1};
  for (int k = 0; k < 1000; ++k) {
    const double t = k * 0.1;
    EXPECT_EQ(readings(sensor, run, VectorXd::Constant(1, t))[0], temperatures(run, t)[0]) << k;
  }
}

TEST(TemperatureSensor, ResolutionRounds) {
  const ThermalRun run = simulate(small_machine(), std::vector{working(0)});
  const TemperatureSensor sensor{.name = "T1", .resolution_K = 0.125};
  const VectorXd seen = readings(sensor, run, every(60, 100));
  for (Index i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i], 0.125 * std::round(seen[i] / 0.125));
    EXPECT_LE(std::abs(seen[i] - temperatures(run, 60.0 * double(i))[0]), 0.0625 + 1e-12);
  }
}

TEST(TemperatureSensor, NoiseHasItsDeviationAndTheSameTimeGivesTheSameReading) {
  ThermalNetwork network = one_node(1.0, 1.0);
  const ThermalRun run = simulate(network, std::vector{activity_at(-20000)});
  const TemperatureSensor sensor{.name = "T1", .noise_K = 0.1, .sampling_s = 1.0, .seed = 99};
  const VectorXd seen = readings(sensor, run, every(1, 20000, -10000));
  const double mean = seen.mean();
  const double sigma = std::sqrt((seen.array() - mean).square().sum() / double(seen.size() - 1));
  std::cout << "seed 99: mean " << mean << ", sigma " << sigma << "\n";
  EXPECT_NEAR(mean, 20.0, 4 * 0.1 / std::sqrt(20000.0));
  EXPECT_NEAR(sigma, 0.1, 4 * 0.1 / std::sqrt(40000.0));
  const VectorXd sparse = readings(sensor, run, every(37, 100, -10000));
  for (Index i = 0; i < sparse.size(); ++i) EXPECT_EQ(sparse[i], seen[37 * i]);
  TemperatureSensor other = sensor;
  other.seed = 100;
  EXPECT_NE(readings(other, run, every(1, 1))[0], readings(sensor, run, every(1, 1))[0]);
}

TEST(TemperatureSensor, LagIsASecondFirstOrderNode) {
  // behind a node of tau: 1 - (tau e^(-t/tau) - lag e^(-t/lag)) / (tau - lag), where they are
  // equal 1 - (1 + t/tau) e^(-t/tau)
  const double tau = 100.0;
  const ThermalRun run = simulate(one_node(500.0, 5.0), std::vector{activity_at(0, 30.0)});
  for (const double lag : {1e-300, 1e-3, 20.0, 100.0 - 1e-6, 100.0, 100.0 + 1e-12, 5000.0}) {
    const TemperatureSensor sensor{.name = "T1", .lag_s = lag, .sampling_s = 1.0};
    const VectorXd seen = readings(sensor, run, every(1, 400));
    double worst = 0.0;
    for (Index i = 0; i < seen.size(); ++i) {
      const double t = double(i);
      const double apart = tau - lag;
      const double behind =
          apart == 0.0 ? t / tau : -lag * std::expm1(-apart / lag * t / tau) / apart;
      const double reached = 1.0 - std::exp(-t / tau) * (1.0 + behind);
      worst = std::max(worst, std::abs(seen[i] - 20.0 - 10.0 * reached));
    }
    std::cout << "lag " << lag << " s: worst " << worst << " K\n";
    EXPECT_LT(worst, 2e-11);
  }
}

TEST(TemperatureSensor, LagAgreesWithTheMatrixExponential) {
  const unsigned seed = 31;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  Draw draw(seed);
  double worst = 0.0;
  for (const double lag : {1e-2, 3.0, 700.0, 1e5}) {
    const ThermalNetwork network = random_network(draw, 4, 2.0);
    std::vector<Activity> knots = random_knots(draw, 10);
    for (Activity& knot : knots) knot.time_s = std::round(knot.time_s);
    const ThermalRun run = simulate(network, knots);
    const auto states = oracle_run(network, knots, 2, lag);
    const TemperatureSensor sensor{.name = "T", .node = 2, .lag_s = lag, .sampling_s = 1.0};
    VectorXd times(Index(knots.size()));
    for (Index i = 0; i < times.size(); ++i) times[i] = knots[std::size_t(i)].time_s;
    const VectorXd seen = readings(sensor, run, times);
    for (Index i = 0; i < times.size(); ++i)
      worst =
          std::max(worst, std::abs(seen[i] - states[std::size_t(i)].sensor) / largest_change(run));
    const VectorXd alone = readings(sensor, run, times.tail(1));
    EXPECT_EQ(alone[0], seen[seen.size() - 1]) << "whatever else is asked";
  }
  std::cout << "worst " << worst << " of the largest change\n";
  EXPECT_LT(worst, 1e-12);
}

TEST(TemperatureSensor, NonsenseIsRefusedByName) {
  const ThermalRun run = simulate(small_machine(), std::vector{activity_at(0)});
  const auto refused = [&](const TemperatureSensor& sensor) -> std::string {
    return thrown_text<std::invalid_argument>([&] { readings(sensor, run, every(1, 3)); });
  };
  EXPECT_EQ(refused({.name = "nut"}), "");
  EXPECT_EQ(refused({.name = "nut", .node = 3}), "sensor nut: expected a node from 0 to 2, seen 3");
  EXPECT_EQ(refused({.name = "nut", .noise_K = -1}),
            "sensor nut: expected a noise of at least 0, seen -1");
  EXPECT_EQ(refused({.name = "nut", .resolution_K = -1}),
            "sensor nut: expected a resolution of at least 0, seen -1");
  EXPECT_EQ(refused({.name = "nut", .lag_s = infinity}),
            "sensor nut: expected a lag of at least 0, seen inf");
  EXPECT_EQ(refused({.name = "nut", .sampling_s = 0}),
            "sensor nut: expected a sampling time above 0, seen 0");
  EXPECT_EQ(refused({.name = "nut", .offset_K = std::nan("")}),
            "sensor nut: expected a finite offset, seen nan");
  EXPECT_NE(refused({.name = "nut", .sampling_s = 1e-300}), "") << "samples that cannot be counted";
  const TemperatureSensor good{.name = "nut"};
  EXPECT_THROW(readings(good, run, (VectorXd(2) << 1, 0).finished()), std::invalid_argument);
  EXPECT_THROW(readings(good, run, VectorXd::Constant(1, infinity)), std::invalid_argument);
  EXPECT_EQ(readings(good, run, VectorXd()).size(), 0);
}

}  // namespace
}  // namespace abbe::errors
