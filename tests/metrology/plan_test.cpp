#include "errors/metrology/instrument.h"
#include "tests/metrology/machines.h"
#include "tests/test.h"

using namespace abbe;
using namespace abbe::errors::metrology;

namespace {

namespace metrology = abbe::errors::metrology;
namespace machines = metrology::machines;

/// As bought, with a bar or a ball's place that the smaller machines have room for.
Instrument on(const machines::Named& machine, Kind kind) {
  Instrument i = typical_instrument(kind);
  if (machine.name == "platform") i.radius = 40.0;
  if (machine.name == "lathe") i.radius = 80.0;
  return i;
}

bool has_three_slides(const std::string& name) { return name != "platform" && name != "lathe"; }
bool has_rotary(const std::string& name) { return has_three_slides(name) && name != "three_axis"; }

/// Which kinds have something to measure on which machine.
bool suits(Kind kind, const std::string& machine) {
  switch (kind) {
    case Kind::BallBarRotary:
    case Kind::RTest:
    case Kind::Sphere:
      return has_rotary(machine);
    case Kind::StepDiagonal:
      return has_three_slides(machine);
    default:
      return true;
  }
}

void visit_all(
    const std::function<void(const machines::Named&, const Instrument&, const Plan&)>& f) {
  for (const machines::Named& machine : machines::all()) {
    for (const Kind kind : all_kinds()) {
      if (!suits(kind, machine.name)) continue;
      SCOPED_TRACE(machine.name + ", " + to_string(kind));
      const Instrument instrument = on(machine, kind);
      f(machine, instrument, plan(instrument, machine.chain));
    }
  }
}

std::string sentence(const std::function<void()>& f) {
  return thrown_text<std::invalid_argument>([&] { f(); }, "nothing thrown");
}

}  // namespace

TEST(Plan, EveryKindKeepsWithinTheTravelOfEveryMachine) {
  int plans = 0;
  std::size_t measurements = 0;
  visit_all([&](const machines::Named& machine, const Instrument&, const Plan& p) {
    ++plans;
    measurements += p.measurements.size();
    EXPECT_FALSE(p.measurements.empty());
    for (const Measurement& measurement : p.measurements)
      for (int j = 0; j < machine.chain.size(); ++j) {
        const machines::Joint& joint = machine.chain.joints()[std::size_t(j)];
        ASSERT_GE(measurement.state.q[j], joint.min - 1e-9);
        ASSERT_LE(measurement.state.q[j], joint.max + 1e-9);
      }
  });
  std::cout << plans << " plans, " << measurements << " readings\n";
  EXPECT_EQ(plans, 6 * 17 - 3 * 3 - 2);
}

TEST(Plan, TimeRunsOnAndTheFirstReadingIsAtTheStart) {
  visit_all([&](const machines::Named&, const Instrument& instrument, const Plan& p) {
    EXPECT_EQ(p.measurements.front().state.time_s, instrument.start_s);
    for (std::size_t i = 1; i < p.measurements.size(); ++i) {
      const Measurement& a = p.measurements[i - 1];
      const Measurement& b = p.measurements[i];
      ASSERT_GE(b.state.time_s, a.state.time_s);
      ASSERT_GE(b.set_up, a.set_up);
      if (b.set_up > a.set_up) {
        ASSERT_GE(b.state.time_s - a.state.time_s, instrument.set_up_s - 1e-6);
      }
    }
    EXPECT_GE(p.duration_s,
              p.measurements.back().state.time_s - instrument.start_s + instrument.set_up_s - 1e-6);
  });
}

TEST(Plan, StartMovesEveryReading) {
  const machines::Named gantry{"gantry", machines::gantry()};
  Instrument i = on(gantry, Kind::Laser);
  const Plan now = plan(i, gantry.chain);
  i.start_s = -7200.0;
  const Plan before = plan(i, gantry.chain);
  for (std::size_t k = 0; k < now.measurements.size(); ++k)
    ASSERT_NEAR(now.measurements[k].state.time_s - before.measurements[k].state.time_s, 7200.0,
                1e-9);
  EXPECT_EQ(now.duration_s, before.duration_s);
}

TEST(Plan, TargetsAreTheSamePlaceInEveryRunAndFromBothSides) {
  visit_all([&](const machines::Named&, const Instrument& instrument, const Plan& p) {
    if (instrument.kind == Kind::Spindle) return;
    std::map<std::tuple<int, int, int>, kinematics::AxisVector> places;
    for (const Measurement& measurement : p.measurements) {
      const auto [place, is_new] = places.try_emplace(
          {measurement.set_up, measurement.channel, measurement.target}, measurement.state.q);
      if (!is_new) {
        ASSERT_LT((place->second - measurement.state.q).cwiseAbs().maxCoeff(), 1e-9);
      }
    }
  });
}

TEST(Plan, BothWaysApproachEveryTargetUpAndDownWithOneReversalBetween) {
  for (const Kind kind : {Kind::Laser, Kind::Straightness, Kind::AngleOptics, Kind::Square,
                          Kind::Level, Kind::RollLines}) {
    for (const machines::Named& machine : machines::all()) {
      SCOPED_TRACE(machine.name + ", " + to_string(kind));
      const Instrument instrument = on(machine, kind);
      const Plan p = plan(instrument, machine.chain);
      // The axis that a line is along is the one whose position its targets differ in.
      std::map<std::pair<int, int>, std::vector<const Measurement*>> lines;
      for (const Measurement& measurement : p.measurements)
        lines[{measurement.set_up, measurement.channel}].push_back(&measurement);
      for (const auto& [where, measurements] : lines) {
        int axis = 0;
        (measurements[1]->state.q - measurements[0]->state.q).cwiseAbs().maxCoeff(&axis);
        std::set<std::tuple<int, int, int>> seen;
        for (const Measurement* measurement : measurements)
          seen.insert({measurement->run, measurement->target,
                       measurement->state.direction[std::size_t(axis)]});
        EXPECT_EQ(int(seen.size()), instrument.runs * instrument.targets * 2);
        for (std::size_t i = 1; i < measurements.size(); ++i) {
          const kinematics::AxisState& a = measurements[i - 1]->state;
          const kinematics::AxisState& b = measurements[i]->state;
          const auto k = std::size_t(axis);
          EXPECT_EQ(b.stroke[k] - a.stroke[k], a.direction[k] == b.direction[k] ? 0 : 1);
          if (a.direction[k] == b.direction[k]) {
            EXPECT_GT((b.q[axis] - a.q[axis]) * b.direction[k], 0.0);
          }
        }
      }
    }
  }
}

TEST(Plan, CirclesAreDrivenBothWaysAndAxesReverseAtTheirQuadrants) {
  const machines::Chain chain = machines::three_axis();
  Instrument bar = typical_instrument(Kind::BallBar);
  bar.axes = {'X', 'Y'};
  bar.targets = 72;  // 5 degrees, the first place not again
  const Plan p = plan(bar, chain);
  ASSERT_EQ(p.measurements.size(), 2u * 72u);
  for (const Measurement& measurement : p.measurements) {
    const double angle = 5.0 * measurement.target;
    if (measurement.target % 18 == 0) continue;  // on a quadrant an axis is about to turn back
    const int way = &measurement - p.measurements.data() < 72 ? 1 : -1;
    EXPECT_EQ(measurement.state.direction[0], (angle < 180.0 ? -1 : 1) * way) << angle;
    EXPECT_EQ(measurement.state.direction[1], (angle < 90.0 || angle > 270.0 ? 1 : -1) * way)
        << angle;
  }
}

/// Three slides and a quill W that goes along Z, up or down with a positive command.
machines::Chain with_quill(double way) {
  using enum machines::Side;
  return machines::Chain(
      {machines::slide('X', Workpiece, machines::x, {0, 0, -50}, -400, 400),
       machines::slide('Y', Workpiece, machines::y, {0, 0, -150}, -250, 250),
       machines::slide('Z', Tool, machines::z, {0, 200, 300}, -100, 400),
       machines::slide('W', Tool, way * machines::z, {0, 0, 100}, -150, 150), machines::nose(100)},
      machines::at(0, 0, 0), machines::at(0, 0, 60));
}

std::vector<std::string> names_of(const Plan& plan) {
  std::vector<std::string> names;
  for (const SetUp& set_up : plan.set_ups) names.push_back(set_up.name);
  return names;
}

/// Letters of the axes that move while a set-up reads.
std::string moving(const Plan& plan, int set_up, const machines::Chain& chain) {
  std::string letters;
  const Measurement* first = nullptr;
  for (const Measurement& measurement : plan.measurements) {
    if (measurement.set_up != set_up) continue;
    if (!first) first = &measurement;
    for (int j = 0; j < chain.size(); ++j) {
      const char name = chain.joints()[std::size_t(j)].name;
      if (std::abs(measurement.state.q[j] - first->state.q[j]) > 1e-6 &&
          letters.find(name) == std::string::npos)
        letters += name;
    }
  }
  std::sort(letters.begin(), letters.end());
  return letters;
}

TEST(Plan, ParallelSlidesAreNoPair) {
  for (const double way : {1.0, -1.0}) {
    const machines::Chain chain = with_quill(way);
    Instrument bar = typical_instrument(Kind::BallBar), square = typical_instrument(Kind::Square);
    const Plan circles = plan(bar, chain), squares = plan(square, chain);
    EXPECT_EQ(names_of(circles), (std::vector<std::string>{"WX circle", "WY circle", "XY circle",
                                                           "XZ circle", "YZ circle"}));
    EXPECT_EQ(names_of(squares), (std::vector<std::string>{"WX square", "WY square", "XY square",
                                                           "XZ square", "YZ square"}));
    for (int k = 0; k < 5; ++k) {
      EXPECT_EQ(moving(circles, k, chain), names_of(circles)[std::size_t(k)].substr(0, 2));
      EXPECT_EQ(moving(squares, k, chain), names_of(squares)[std::size_t(k)].substr(0, 2));
    }
    bar.axes = square.axes = {'Z', 'W'};
    EXPECT_EQ(sentence([&] { plan(bar, chain); }),
              "ball_bar: expected two perpendicular slides, seen W Z");
    EXPECT_EQ(sentence([&] { plan(square, chain); }),
              "square: expected two perpendicular slides, seen W Z");
    for (const Kind kind : {Kind::Diagonals, Kind::StepDiagonal}) {
      Instrument laser = typical_instrument(kind);
      laser.axes = {'X', 'Z', 'W'};
      EXPECT_EQ(sentence([&] { plan(laser, chain); }),
                std::string(to_string(kind)) + ": expected perpendicular slides, seen W along Z");
    }
  }
}

TEST(Plan, SlidesFollowSoThatThePerfectMachineReadsNothing) {
  visit_all([&](const machines::Named& machine, const Instrument& as_bought, const Plan&) {
    Instrument i = as_bought;
    i.noise = i.noise_rad = i.resolution = i.resolution_rad = 0.0;
    i.rotation_sigma = i.position_sigma = i.scale_sigma = i.drift_sigma = 0.0;
    const Plan p = plan(i, machine.chain);
    const Readings r = measure(p, machine.chain, machines::perfect(machine.chain), 3);
    if (i.kind == Kind::Temperature) {
      EXPECT_EQ(r.value.size(), 0);
      return;
    }
    double worst = 0.0;
    for (std::size_t k = 0; k < p.measurements.size(); ++k) {
      const Measurement& measurement = p.measurements[k];
      const metrology::SetUp& s = p.set_ups[std::size_t(measurement.set_up)];
      const BodyPoses b = nominal_bodies(machine.chain, measurement.state.q);
      worst =
          std::max(worst, std::abs(r.value[Index(k)] - reading(s, measurement.channel, {}, b, b)));
      double expected = NAN;
      if (i.kind == Kind::Laser) expected = measurement.state.q[*machine.chain.find(s.name[0])];
      if (i.kind == Kind::BallBar || i.kind == Kind::BallBarRotary) expected = i.radius;
      if (i.kind == Kind::RTest || i.kind == Kind::Sphere || i.kind == Kind::Straightness ||
          i.kind == Kind::AngleOptics || i.kind == Kind::Level || i.kind == Kind::Square ||
          i.kind == Kind::RollLines || i.kind == Kind::Spindle || i.kind == Kind::Drift)
        expected = 0.0;
      if (!std::isnan(expected)) {
        ASSERT_NEAR(r.value[Index(k)], expected, 1e-9) << s.name;
      }
    }
    EXPECT_LT(worst, 1e-12);
  });
}

TEST(Plan, StepDiagonalCountsLegsOfXThenYThenZAndRisesInZ) {
  const machines::Chain chain = machines::trunnion();  // Y stands before X in its code
  const Plan p = plan(typical_instrument(Kind::StepDiagonal), chain);
  ASSERT_EQ(p.set_ups.size(), 4u);
  const int joints[] = {*chain.find('X'), *chain.find('Y'), *chain.find('Z')};
  std::set<std::pair<int, int>> signs;
  for (std::size_t i = 1; i < p.measurements.size(); ++i) {
    const Measurement& a = p.measurements[i - 1];
    const Measurement& b = p.measurements[i];
    if (b.target == 0) continue;
    ASSERT_EQ(b.target, a.target + 1);
    for (int leg = 0; leg < 3; ++leg) {
      const double way = b.state.q[joints[leg]] - a.state.q[joints[leg]];
      ASSERT_EQ(way != 0.0, leg == (b.target - 1) % 3);
      ASSERT_TRUE(leg < 2 || way >= 0.0);
    }
    signs.insert(
        {b.state.direction[std::size_t(joints[0])], b.state.direction[std::size_t(joints[1])]});
  }
  EXPECT_EQ(signs.size(), 4u);
  EXPECT_EQ(p.measurements.back().target, 30);
}

TEST(Plan, RotaryArcsAreCutToTheTravelOfTheAxisAndOfTheSlides) {
  const machines::Chain chain = machines::trunnion();
  Instrument nest = typical_instrument(Kind::RTest);
  const Plan p = plan(nest, chain);
  std::map<std::string, std::pair<double, double>> arcs;
  for (const Measurement& measurement : p.measurements) {
    const std::string& name = p.set_ups[std::size_t(measurement.set_up)].name;
    const double q = measurement.state.q[*chain.find(name[0])] / units::deg;
    auto [place, is_new] = arcs.try_emplace(name, q, q);
    place->second.first = std::min(place->second.first, q);
    place->second.second = std::max(place->second.second, q);
  }
  for (const auto& [name, arc] : arcs)
    std::cout << name << ": " << arc.first << " to " << arc.second << " deg\n";
  EXPECT_NEAR(arcs["C R-test"].second - arcs["C R-test"].first, 350.0, 1e-9);  // and 0 is 360
  // The tip is 170 mm above the A line at Z = 0 and goes down to -200, 30 mm below the line.
  const double least = -std::acos(-30.0 / 100.0) / units::deg;
  EXPECT_GT(arcs["A R-test"].first, least);
  EXPECT_LT(arcs["A R-test"].first, least + 8.0);
}

TEST(Plan, BallAtTheToolStaysAtItsPlaceInTheWorkpiece) {
  for (const char* name : {"gantry", "trunnion", "head_head"}) {
    for (const machines::Named& machine : machines::all()) {
      if (machine.name != name) continue;
      for (const Kind kind : {Kind::BallBarRotary, Kind::RTest}) {
        Instrument i = on(machine, kind);
        i.reflector_t = {7.0, -3.0, -20.0};
        const Plan p = plan(i, machine.chain);
        std::map<int, Vector3d> place;
        for (const Measurement& measurement : p.measurements) {
          const Vector3d ball_w =
              machine.chain.tool_in_workpiece(measurement.state.q) * i.reflector_t;
          const auto [at, is_new] = place.try_emplace(measurement.set_up, ball_w);
          ASSERT_LT((at->second - ball_w).norm(), 1e-9);
        }
      }
    }
  }
}

TEST(Plan, RefusesInASentence) {
  const machines::Chain gantry = machines::gantry(), lathe = machines::lathe();
  const auto refusal = [&](
                           Kind kind, const machines::Chain& chain,
                           const std::function<void(Instrument&)>& change = [](Instrument&) {}) {
    Instrument i = typical_instrument(kind);
    change(i);
    return sentence([&] { plan(i, chain); });
  };
  EXPECT_EQ(refusal(Kind::Laser, gantry, [](Instrument& i) { i.axes = {'Q'}; }),
            "laser: expected an axis of the machine, seen Q");
  EXPECT_EQ(refusal(Kind::Laser, gantry, [](Instrument& i) { i.axes = {'C'}; }),
            "laser: expected axes that this instrument can measure, seen C");
  EXPECT_EQ(refusal(Kind::StepDiagonal, lathe),
            "step_diagonal: expected at least 3 slides to measure, seen 2");
  EXPECT_EQ(refusal(Kind::RTest, lathe), "r_test: expected a rotary axis to measure, seen none");
  EXPECT_EQ(refusal(Kind::BallBar, lathe, [](Instrument& i) { i.radius = 150.0; })
                .find("ball_bar: expected targets within the travel of X, -5 to 200 mm, seen 247"),
            0u);
  EXPECT_EQ(refusal(Kind::Spindle, gantry, [](Instrument& i) { i.spindle_speed = 0.0; }),
            "spindle: expected a spindle speed above 0, seen 0 rpm");
  for (const auto& change : std::vector<std::function<void(Instrument&)>>{
           [](Instrument& i) { i.noise = -1.0; }, [](Instrument& i) { i.noise = NAN; },
           [](Instrument& i) { i.runs = 0; }, [](Instrument& i) { i.runs = 2000000000; },
           [](Instrument& i) { i.targets = 1; }, [](Instrument& i) { i.margin = 0.0; },
           [](Instrument& i) { i.margin = 0.5; }, [](Instrument& i) { i.to_rad = INFINITY; },
           [](Instrument& i) { i.from_rad = 7.0; }, [](Instrument& i) { i.speed = 0.0; },
           [](Instrument& i) { i.dwell_s = NAN; }, [](Instrument& i) { i.start_s = INFINITY; },
           [](Instrument& i) {
             i.up_b = {0, 0, 2};
           },
           [](Instrument& i) { i.interval_s = 1e-9; },
           [](Instrument& i) { i.targets = 100000, i.runs = 10000; },
           [](Instrument& i) { i.reflector_t.x() = NAN; }})
    EXPECT_NE(refusal(Kind::Laser, gantry, change), "nothing thrown");
  EXPECT_NE(refusal(Kind::Tracker, gantry, [](Instrument& i) { i.targets = 100000; }),
            "nothing thrown");
  EXPECT_NE(refusal(Kind::RTest, gantry,
                    [](Instrument& i) { i.location_w = Vector3d(5000.0, 0.0, 0.0); }),
            "nothing thrown");
}

TEST(Plan, SlidesWithoutLimitsAreRefused) {
  std::vector<machines::Joint> joints = machines::lathe().joints();
  joints[1].min = -1e9;
  const machines::Chain chain(joints, machines::lathe().T_bw_home(), machines::lathe().T_bt_home());
  EXPECT_HAS(sentence([&] { plan(typical_instrument(Kind::Laser), chain); }), "travel limits of Z");
}

TEST(Plan, WordsOfKindsComeBack) {
  EXPECT_EQ(all_kinds().size(), 17u);
  for (const Kind kind : all_kinds()) {
    ASSERT_TRUE(find_kind(to_string(kind)));
    EXPECT_EQ(*find_kind(to_string(kind)), kind);
    EXPECT_EQ(typical_instrument(kind).kind, kind);
    EXPECT_EQ(typical_instrument(kind).name, to_string(kind));
  }
  EXPECT_FALSE(find_kind("theodolite"));
}

TEST(Plan, TimesAreAPersonsTimes) {
  const machines::Named gantry{"gantry", machines::gantry()};
  for (const Kind kind : all_kinds()) {
    const Plan p = plan(on(gantry, kind), gantry.chain);
    std::cout << p.kind << ": " << p.set_ups.size() << " set-ups, " << p.measurements.size()
              << " readings, " << p.duration_s / 3600.0 << " h\n";
    EXPECT_GT(p.duration_s, 600.0);
    EXPECT_LT(p.duration_s, 24.0 * 3600.0);
  }
}
