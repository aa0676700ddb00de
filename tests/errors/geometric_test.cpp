#include "errors/geometric.h"
#include "errors/coefficients.h"
#include "errors/curve.h"
#include "errors/element.h"
#include "kinematics/decompositions.h"
#include "tests/errors/machines.h"
#include "tests/errors/numbers.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

using kinematics::Chain;
using kinematics::Deviation;
using kinematics::JointDeviation;
using enum kinematics::Side;
using enum kinematics::Motion;

Polynomial line(double slope) { return {(VectorXd(2) << 0, slope).finished(), 0, 1}; }

std::string refusal_of_errors(const GeometricErrors& errors, const Chain& chain) {
  return thrown_text<std::invalid_argument>([&] { bind(errors, chain); });
}

// ---- binding

TEST(Bind, EveryElementGoesToItsJointAndPlace) {
  const Chain chain = gantry();
  const GeometricModel model =
      bind({{element("EYX", line(1.0_um)), element("ECX", Constant{3.0_urad}),
             element("EB0A", Constant{5.0_urad}), element("EZS", Constant{1.0_um})},
            {}},
           chain);
  const auto state = state_at({0, 100, 0, 0, 0, 0});
  const std::vector<JointDeviation> d = deviations(model, state);
  ASSERT_EQ(d.size(), 6u);
  EXPECT_NEAR(d[1].motion[1], 100.0_um, 1e-15);
  EXPECT_EQ(d[1].motion[5], 3.0_urad);
  EXPECT_EQ(d[4].location[4], 5.0_urad);
  EXPECT_EQ(d[5].motion[2], 1.0_um);
  Deviation sum = Deviation::Zero();
  for (const JointDeviation& joint : d) sum += joint.motion.cwiseAbs() + joint.location.cwiseAbs();
  EXPECT_NEAR(sum.sum(), 100.0_um + 3.0_urad + 5.0_urad + 1.0_um, 1e-15) << "and nowhere else";
}

TEST(Bind, SIsTheWorkpieceSpindleBeforeTheNose) {
  const GeometricErrors errors{{element("EXS", Constant{1.0_um})}, {}};
  EXPECT_EQ(bind(errors, gantry()).elements[0].joint, 5);
  EXPECT_EQ(bind(errors, platform()).elements[0].joint, 0);
  const Vector3d ex(1, 0, 0);
  const Chain both(
      {joint('S', Workpiece, Rotary, ex, {0, 0, 0}), joint('s', Tool, Spindle, ex, {0, 0, 0})},
      at(0, 0, 0), at(0, 0, 0));
  EXPECT_EQ(bind(errors, both).elements[0].joint, 0);
}

TEST(Bind, WhatMeansNothingIsRefusedByName) {
  const Chain chain = gantry();
  const auto one = [](const std::string& name, Shape shape = Constant{1e-6}) {
    return GeometricErrors{{element(name, std::move(shape))}, {}};
  };
  EXPECT_EQ(refusal_of_errors(one("EXB"), chain),
            "EXB: expected an axis of the machine (C X Y Z A s), seen B");
  EXPECT_EQ(refusal_of_errors(one("EC0Y", line(1e-6)), chain),
            "EC0Y: a location error must be a constant");
  EXPECT_EQ(refusal_of_errors(one("EC0Y", Repeatability{1e-6, 1}), chain),
            "EC0Y: a location error must be a constant");
  for (const std::string name : {"EA0X", "EB0Y", "EC0Z", "EA0A", "EC0C", "EC0S"})
    EXPECT_HAS(refusal_of_errors(one(name), chain),
               name + ": an axis has no squareness about itself");
  for (const std::string name : {"EX0X", "EY0X", "EZ0Y"})
    EXPECT_HAS(refusal_of_errors(one(name), chain),
               name + ": a slide has a direction but no position");
  for (const std::string name : {"EX0A", "EZ0C"})
    EXPECT_HAS(refusal_of_errors(one(name), chain),
               name + ": a rotation axis has no position along itself");
  EXPECT_EQ(refusal_of_errors(one("ECS"), chain),
            "ECS: a spindle has no error element about its own axis");
  EXPECT_EQ(refusal_of_errors(one("EAS"), platform()),
            "EAS: a spindle has no error element about its own axis");
  EXPECT_EQ(refusal_of_errors(one("ECS"), platform()), "");
  EXPECT_EQ(
      refusal_of_errors(one("EXX", Constant{std::numeric_limits<double>::quiet_NaN()}), chain),
      "EXX: expected a finite value");
  EXPECT_EQ(refusal_of_errors({{element("EXX", Constant{}), element("EYX", Constant{}),
                                element("EXX", Constant{})},
                               {}},
                              chain),
            "EXX: given twice");
  EXPECT_EQ(refusal_of_errors({}, chain), "");
}

TEST(Bind, AMeasuringLineNeedsASlideOfTheMachineOnce) {
  const Chain chain = gantry();
  EXPECT_EQ(refusal_of_errors({{}, {{'C', {0, 0, 0}}}}, chain),
            "measuring line of C: expected a slide");
  EXPECT_EQ(refusal_of_errors({{}, {{'S', {0, 0, 0}}}}, chain),
            "measuring line of S: expected a slide");
  EXPECT_EQ(refusal_of_errors({{}, {{'X', {0, 0, 0}}, {'Y', {0, 0, 0}}, {'X', {0, 0, 1}}}}, chain),
            "measuring line of X: given twice");
  EXPECT_EQ(
      refusal_of_errors({{}, {{'X', {0, std::numeric_limits<double>::infinity(), 0}}}}, chain),
      "measuring line of X: expected a finite point");
  EXPECT_NE(refusal_of_errors({{}, {{'W', {0, 0, 0}}}}, chain), "");
}

TEST(Deviations, ATableLeftNamesElementPartAndPosition) {
  Element EXX = element("EXX", make_table((VectorXd(2) << 0, 500).finished(), VectorXd::Zero(2)));
  EXX.curves[0].name = "laser";
  const GeometricModel model = bind({{EXX}, {}}, gantry());
  EXPECT_NO_THROW(deviations(model, state_at({0, 500, 0, 0, 0, 0})));
  const std::string said = thrown_text<std::out_of_range>([&] {
    deviations(model, state_at({0, 512, 0, 0, 0, 0}));
  });
  EXPECT_EQ(said, "EXX (laser): position 512 is outside the table (0 to 500)");
}

TEST(Deviations, TheArgumentIsTheCommandUnlessTheCarriageIsAsked) {
  Element EXX = element("EXX", line(1.0_um));
  const auto state = state_at({0, 30, 0});  // X of the platform, primed
  EXPECT_NEAR(deviations(bind({{EXX}, {}}, platform()), state)[1].motion[0], 30.0_um, 1e-17);
  EXX.curves[0].argument = Argument::Carriage;
  EXPECT_NEAR(deviations(bind({{EXX}, {}}, platform()), state)[1].motion[0], -30.0_um, 1e-17);
  EXX.curves[0].negate = true;
  EXPECT_NEAR(deviations(bind({{EXX}, {}}, platform()), state)[1].motion[0], 30.0_um, 1e-17);
}

// A carriage commanded up lags: its tip-side reading is low, so half < 0 on a tool-side slide; on a
// primed one the carriage itself moves down and stays too high, so half > 0. Both times the tip is
// short of its command in the workpiece.
TEST(Deviations, ALaggingCarriageLeavesTheTipShortOnBothSides) {
  const Vector3d ex(1, 0, 0);
  for (const auto side : {Tool, Workpiece}) {
    const Chain chain({joint('X', side, Linear, ex, {0, 0, 0})}, at(0, 0, 0), at(0, 0, 0));
    const double half = side == Tool ? -2.0_um : 2.0_um;
    const GeometricModel model = bind({{element("EXX", Backlash{half})}, {}}, chain);
    for (const int direction : {1, -1}) {
      auto state = state_at({10});
      state.direction[0] = std::int8_t(direction);
      const double x = chain.tool_in_workpiece(state.q, deviations(model, state)).translation().x();
      EXPECT_NEAR(x, 10 - direction * 2.0_um, 1e-14);
    }
  }
}

TEST(Deviations, ScaledMultipliesEverythingAndNothingMore) {
  const Chain chain = gantry();
  GeometricErrors errors{{element("EXX", line(1.0_um)), element("EBX", Constant{20.0_urad}),
                          element("EYX", Backlash{1.0_um}), element("EC0Y", Constant{5.0_urad}),
                          element("EZX", Repeatability{1.0_um, 3})},
                         {{'X', {0, 0, 0}}}};
  const GeometricModel model = bind(errors, chain);
  auto state = state_at({0, 100, 0, 0, 0, 0});
  state.direction[1] = 1;
  const auto one = deviations(model, state);
  const auto half = deviations(scaled(model, 0.5), state);
  for (std::size_t j = 0; j < one.size(); ++j) {
    EXPECT_LT((half[j].motion - 0.5 * one[j].motion).norm(), 1e-18);
    EXPECT_LT((half[j].location - 0.5 * one[j].location).norm(), 1e-18);
  }
  for (const JointDeviation& d : deviations(scaled(model, 0.0), state)) {
    EXPECT_TRUE(d.motion.isZero(0.0));
    EXPECT_TRUE(d.location.isZero(0.0));
  }
}

TEST(Deviations, WithoutRandomKeepsTheBacklashAndForgetsChance) {
  const Chain chain = gantry();
  Element EXX = element("EXX", Backlash{1.0_um});
  EXX.curves.push_back({Repeatability{5.0_um, 3}});
  EXX.curves.push_back({Constant{7.0_um}});
  const GeometricModel model = bind({{EXX}, {}}, chain);
  auto state = state_at({0, 0, 0, 0, 0, 0});
  state.direction[1] = -1;
  EXPECT_NE(deviations(model, state)[1].motion[0], 6.0_um);
  EXPECT_NEAR(deviations(without_random_errors(model), state)[1].motion[0], 6.0_um, 1e-18);
  state.stroke[1] = 9;
  EXPECT_NEAR(deviations(without_random_errors(model), state)[1].motion[0], 6.0_um, 1e-18);
}

// ---- the measuring line (Abbe)

// One slide X, its point at z = 500, the tip at z = 100. A pitch EBX of 20 urad moves what is 400
// mm below the point by -8 um. EXX reads 12 um wherever it was measured.
TEST(MeasuringLine, PitchCountsOnceWhereverTheLineWas) {
  const Chain chain({joint('X', Tool, Linear, {1, 0, 0}, {0, 0, 500})}, at(0, 0, 0), at(0, 0, 100));
  const auto state = state_at({40});
  const auto tip_um = [&](std::vector<MeasuringLine> lines) {
    const GeometricModel model = bind(
        {{element("EXX", Constant{12.0_um}), element("EBX", Constant{20.0_urad})}, lines}, chain);
    return (chain.tool_in_workpiece(state.q, deviations(model, state)).translation().x() - 40) /
           1.0_um;
  };
  EXPECT_NEAR(tip_um({}), 4.0, 1e-4) << "used as given at the joint's point";
  EXPECT_NEAR(tip_um({{'X', {0, 0, 100}, MeasuredBy::Carriage}}), 12.0, 1e-4)
      << "measured at the tip";
  EXPECT_NEAR(tip_um({{'X', {0, 0, 300}, MeasuredBy::Carriage}}), 8.0, 1e-4) << "measured half-way";
  EXPECT_NEAR(tip_um({{'X', {0, 0, 500}, MeasuredBy::Carriage}}), 4.0, 1e-4);
  EXPECT_NEAR(tip_um({{'X', {0, 0, 100}, MeasuredBy::Tool}}), 12.0, 1e-4)
      << "no difference on the tool side";
}

// A primed slide X at command 100, so 100 mm to the left; its point at the origin, the line through
// (50, 0, -150). Carried by the carriage the arm stays (50, 0, -150): theta x arm = (-3, 0, -1) um.
// Standing with the tool the arm has grown to (150, 0, -150): (-3, 0, -3) um.
TEST(MeasuringLine, OnAPrimedSlideTheArmGrowsWithTravelIfTheToolCarriesThePoint) {
  const Chain chain({joint('X', Workpiece, Linear, {1, 0, 0}, {0, 0, 0})}, at(0, 0, 0),
                    at(0, 0, 0));
  const auto state = state_at({100});
  const auto at_joint_um = [&](MeasuredBy by) {
    const GeometricModel model =
        bind({{element("EXX", Constant{10.0_um}), element("EZX", Constant{1.0_um}),
               element("EBX", Constant{20.0_urad})},
              {{'X', {50, 0, -150}, by}}},
             chain);
    return Vector3d(deviations(model, state)[0].motion.head<3>() / 1.0_um);
  };
  EXPECT_LT((at_joint_um(MeasuredBy::Carriage) - Vector3d(13, 0, 2)).norm(), 1e-12);
  EXPECT_LT((at_joint_um(MeasuredBy::Tool) - Vector3d(13, 0, 4)).norm(), 1e-12);
}

// Whatever the line, an indicator on it reads what the table says: the material of the carriage
// that is nominally at the measured point is displaced by (EX, EY, EZ). Linear curves on all six;
// three slides.
TEST(MeasuringLine, AnIndicatorOnTheLineReadsTheTable) {
  const Vector3d ex(1, 0, 0), ey(0, 1, 0);
  const Chain chain({joint('X', Workpiece, Linear, ex, {10, -20, 30}),
                     joint('Y', Tool, Linear, ey, {-40, 50, 60})},
                    at(0, 0, 0), at(0, 0, 0));
  const Vector3d at_X(70, 300, -150), at_Y(-200, 10, 400);
  GeometricErrors errors;
  for (const std::string axis : {"X", "Y"}) {
    errors.elements.push_back(element("EX" + axis, line(0.05_um)));
    errors.elements.push_back(element("EY" + axis, line(-0.03_um)));
    errors.elements.push_back(element("EZ" + axis, line(0.02_um)));
    errors.elements.push_back(element("EA" + axis, line(0.1_urad)));
    errors.elements.push_back(element("EB" + axis, line(-0.2_urad)));
    errors.elements.push_back(element("EC" + axis, line(0.3_urad)));
  }
  double worst = 0.0;
  for (const MeasuredBy by : {MeasuredBy::Carriage, MeasuredBy::Tool}) {
    errors.measuring_lines = {{'X', at_X, by}, {'Y', at_Y, by}};
    const GeometricModel model = bind(errors, chain);
    for (const double q : {-200.0, -1.0, 0.0, 37.0, 250.0}) {
      const double y = -0.7 * q;
      const auto state = state_at({q, y});
      const auto d = deviations(model, state);
      const Vector3d table = Vector3d(0.05, -0.03, 0.02) * 1.0_um;
      const auto displaced = [](const kinematics::Pose& actual, const kinematics::Pose& nominal,
                                const Vector3d& point_b) {
        return Vector3d(actual * (nominal.inverse() * point_b) - point_b);
      };
      const Vector3d point_X = by == MeasuredBy::Tool ? at_X : Vector3d(at_X - q * ex);
      const Vector3d read_X =
          displaced(chain.workpiece_in_bed(state.q, d), chain.workpiece_in_bed(state.q), point_X);
      const Vector3d read_Y =
          displaced(chain.tool_in_bed(state.q, d), chain.tool_in_bed(state.q), at_Y + y * ey);
      worst = std::max({worst, (read_X - table * q).norm(), (read_Y - table * y).norm()});
    }
  }
  std::cout << "an indicator on the line reads the table within " << worst << " mm\n";
  EXPECT_LT(worst, 0.5 * std::pow(94.0_urad, 2) * 800) << "second order in the angles";
}

// ---- squareness

// X-Y squareness S: x' = x - S y, so r = R (1 - S/2 sin 2 theta). The least-squares circle of that
// keeps centre and radius: form R S; the diameter at +45 deg is 2 R S shorter than at -45 deg.
TEST(Squareness, OfXAndYGivesACircularityOfRS) {
  const double S = 50.0_urad;
  const double R = 100.0;
  const Chain chain({joint('X', Tool, Linear, {1, 0, 0}, {0, 0, 0}),
                     joint('Y', Tool, Linear, {0, 1, 0}, {0, 0, 0})},
                    at(0, 0, 0), at(0, 0, 0));
  const GeometricModel model = bind({{element("EC0Y", Constant{S})}, {}}, chain);
  const auto tip = [&](double angle) {
    const auto state = state_at({R * std::cos(angle), R * std::sin(angle)});
    return Vector2d(
        chain.tool_in_workpiece(state.q, deviations(model, state)).translation().head<2>());
  };
  const int n = 720;
  MatrixXd M(n, 3);  // |p|^2 = 2 c.p + k: the circle is linear in (c, k), then one step on radii
  VectorXd b(n);
  for (int i = 0; i < n; ++i) {
    const Vector2d p = tip(2 * std::numbers::pi * i / n);
    M.row(i) << 2 * p.x(), 2 * p.y(), 1;
    b[i] = p.squaredNorm();
  }
  const Vector3d circle = solve_positive(M.transpose() * M, M.transpose() * b);
  double least = 1e9, most = 0;
  for (int i = 0; i < n; ++i) {
    const double r = (tip(2 * std::numbers::pi * i / n) - circle.head<2>()).norm();
    least = std::min(least, r);
    most = std::max(most, r);
  }
  const auto diameter = [&](double angle) {
    return (tip(angle) - tip(angle + std::numbers::pi)).norm();
  };
  const double difference = diameter(-45.0_deg) - diameter(45.0_deg);
  std::cout << "circularity " << (most - least) / 1.0_um << " um, diameters differ by "
            << difference / 1.0_um << " um\n";
  EXPECT_NEAR(most - least, R * S, 2 * R * S * S);
  EXPECT_NEAR(difference, 2 * R * S, 2 * R * S * S);
}

/// Angle between the paths of two slides of the machine.
double angle_between(const Chain& chain, const GeometricModel& model, int one, int other) {
  const auto way = [&](int joint) {
    auto state = state_at({0, 0, 0});
    const Vector3d from = chain.tool_in_workpiece(state.q, deviations(model, state)).translation();
    state.q[joint] = 100;
    return Vector3d(chain.tool_in_workpiece(state.q, deviations(model, state)).translation() -
                    from);
  };
  return std::acos(way(one).normalized().dot(way(other).normalized()));
}

// Three slides in every order with the bed anywhere between them. A slope of 40 urad of each
// straightness, and the squareness that it is said to amount to, change the angle between the two
// axes by the same; with frames that are turned and with directions of travel alone, and also where
// a slide points the other way.
TEST(Squareness, ASlopeOfAStraightnessAmountsToTheSquarenessThatTurnsTheAxesAsMuch) {
  const double slope = 40.0_urad;
  std::string order = "XYZ";
  int machines = 0;
  do
    for (const char reversed : {'-', 'X', 'Y', 'Z'})
      for (std::size_t primed = 0; primed <= 3; ++primed)
        for (const auto squareness :
             {kinematics::Squareness::Frame, kinematics::Squareness::Travel}) {
          std::vector<kinematics::Joint> joints;
          for (const char name : order) {
            const double way = name == reversed ? -1.0 : 1.0;
            joints.push_back(joint(name, joints.size() < primed ? Workpiece : Tool, Linear,
                                   way * Vector3d::Unit(name - 'X'), {30.0 * name, -20, 10}));
            joints.back().squareness = squareness;
          }
          const Chain chain(joints, at(0, 0, 0), at(0, 0, 0));
          ++machines;
          for (const std::string name : {"EYX", "EZX", "EXY", "EZY", "EXZ", "EYZ"}) {
            const ElementName straightness = parse_element_name(name);
            const std::vector<SquarenessContribution> shares =
                to_squareness_errors(straightness, slope, chain.joints());
            ASSERT_EQ(shares.size(), 1u) << name;
            const SquarenessContribution& share = shares.front();
            const int one = *chain.find(straightness.axis);
            const int other = *chain.find(straightness.direction);
            Element curve{straightness, {Curve{line(slope), "", Argument::Carriage}}};
            const double by_slope = angle_between(chain, bind({{curve}, {}}, chain), one, other);
            const double by_share = angle_between(
                chain, bind({{Element{share.name, {Curve{Constant{share.value}}}}}, {}}, chain),
                one, other);
            EXPECT_NEAR(std::abs(by_slope - 90.0_deg), slope, 1e-12) << name;
            EXPECT_NEAR(by_slope, by_share, 1e-11) << name << " on " << order << ", " << primed;
          }
        }
  while (std::next_permutation(order.begin(), order.end()));
  EXPECT_EQ(machines, 6 * 4 * 4 * 2);
  const Chain machine = gantry();
  for (const char* none : {"EXX", "ECX", "EC0Y", "EXC", "EXU"})
    EXPECT_THROW(to_squareness_errors(parse_element_name(none), 1, machine.joints()),
                 std::invalid_argument)
        << none;
  EXPECT_THROW(to_squareness_errors(parse_element_name("EYX"), 1, platform().joints()),
               std::invalid_argument)
      << "there is no Y to which X could be square";
}

TEST(Squareness, EC0YMakesTheAngleOfXAndYLarger) {
  const Chain chain({joint('X', Tool, Linear, {1, 0, 0}, {0, 0, 0}),
                     joint('Y', Tool, Linear, {0, 1, 0}, {0, 0, 0}),
                     joint('Z', Tool, Linear, {0, 0, 1}, {0, 0, 0})},
                    at(0, 0, 0), at(0, 0, 0));
  const GeometricModel model = bind({{element("EC0Y", Constant{50.0_urad})}, {}}, chain);
  EXPECT_NEAR(angle_between(chain, model, 0, 1) - 90.0_deg, 50.0_urad, 1e-13);
}

/// Machines at random: curves of every shape, series of few ranges and many lengths.
class AnyErrors {
 public:
  explicit AnyErrors(unsigned seed) : random_(seed) {}

  double unit() { return std::uniform_real_distribution<double>(-1, 1)(random_); }
  int upto(int most) { return std::uniform_int_distribution<int>(0, most)(random_); }

  VectorXd numbers(int count) {
    return VectorXd::NullaryExpr(count, [&] { return 1e-3 * unit(); });
  }

  Shape shape() {
    switch (upto(5)) {
      case 0:
        return Polynomial{numbers(upto(5)), 10.0 * upto(1), 400.0};
      case 1: {
        const int n = upto(3);
        return Fourier{numbers(n), numbers(n), upto(1) == 0 ? 16.0 : 6.5};
      }
      case 2:
        return Backlash{1e-3 * unit()};
      case 3:
        return make_table(VectorXd::LinSpaced(9, -500, 500), numbers(9));
      default:
        return Legendre{numbers(upto(9) == 0 ? 30 : upto(7)), 10.0 * upto(1), 400.0};
    }
  }

  GeometricErrors errors() {
    GeometricErrors all;
    for (const char axis : std::string("CXYZA"))
      for (const char direction : std::string("XYZABC")) {
        Element element{parse_element_name(std::string("E") + direction + axis), {}};
        for (int k = 1 + upto(2); k > 0; --k)
          element.curves.push_back({shape(),
                                    {},
                                    upto(1) == 0 ? Argument::Command : Argument::Carriage,
                                    upto(1) == 0,
                                    upto(2) == 0 ? 1.0 : unit()});
        all.elements.push_back(std::move(element));
      }
    return all;
  }

  kinematics::AxisState state() {
    kinematics::AxisState state;
    state.q = kinematics::AxisVector::NullaryExpr(6, [&] { return 300.0 * unit(); });
    for (auto& one : state.direction) one = std::int8_t(upto(2) - 1);
    return state;
  }

 private:
  std::mt19937 random_;
};

/// Curve by curve, none with what another has found.
std::vector<JointDeviation> one_by_one(const GeometricModel& model,
                                       const kinematics::AxisState& state) {
  std::vector<JointDeviation> sum(model.is_joint_primed.size());
  for (const bool constant : {true, false})
    for (const GeometricModel::Bound& bound : model.elements)
      for (const Curve& curve : bound.element.curves)
        if (std::holds_alternative<Constant>(curve.shape) == constant)
          sum[std::size_t(bound.joint)].motion[bound.component] +=
              value(curve, curve_state(model, state, bound.joint));
  return sum;
}

TEST(Series, ThatShareTheirFunctionsHaveTheBitsOfCurvesOneByOne) {
  int grouped = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    AnyErrors any(seed);
    const GeometricModel model = bind(any.errors(), gantry());
    for (const auto& term : model.terms) grouped += term.group >= 0 ? 1 : 0;
    EXPECT_LE(model.groups.size(), GeometricModel::max_groups);
    for (int k = 0; k < 50; ++k) {
      const kinematics::AxisState state = any.state();
      const std::vector<JointDeviation> expected = one_by_one(model, state);
      const std::vector<JointDeviation> seen = deviations(model, state);
      for (std::size_t j = 0; j < seen.size(); ++j)
        for (int i = 0; i < 6; ++i)
          ASSERT_EQ(seen[j].motion[i], expected[j].motion[i]) << "seed " << seed << " joint " << j;
    }
  }
  EXPECT_GT(grouped, 1000) << "the series are what is tested here";
}

TEST(Series, OfOneArgumentAndRangeShareABasisWhateverTheirLengths) {
  const auto curve = [](Shape shape, Argument argument = Argument::Command) {
    return Curve{std::move(shape), {}, argument};
  };
  const auto ones = [](int count) { return VectorXd(VectorXd::Ones(count)); };
  const SeriesBasis basis = *series_basis(curve(Legendre{ones(5), 0, 300}));
  EXPECT_TRUE(basis.has_same_functions(*series_basis(curve(Legendre{ones(7), 0, 300}))));
  EXPECT_FALSE(basis.has_same_functions(*series_basis(curve(Legendre{ones(5), 1, 300}))));
  EXPECT_FALSE(basis.has_same_functions(*series_basis(curve(Legendre{ones(5), 0, 301}))));
  EXPECT_FALSE(basis.has_same_functions(
      *series_basis(curve(Legendre{ones(5), 0, 300}, Argument::Carriage))));
  EXPECT_FALSE(basis.has_same_functions(*series_basis(curve(Fourier{ones(5), ones(5), 300}))));
  EXPECT_FALSE(series_basis(curve(Legendre{ones(SeriesBasis::max_functions + 1), 0, 300})));
  EXPECT_FALSE(series_basis(curve(Polynomial{ones(5), 0, 300})));
}

/// Every shape once.
std::vector<Element> all_shapes() {
  const VectorXd q = numbers({-10, 0, 5, 20});
  const Table line =
      make_table(q, numbers({1, -2, 3, 4}), TableInterpolation::Linear, TableExtrapolation::Hold);
  const Table spline =
      make_table(q, numbers({1, -2, 3, 4}), TableInterpolation::Spline, TableExtrapolation::Hold);
  return {{{'X', 'X', false},
           {{Legendre{numbers({0.1, 0.2, 0.3}), 5, 15}},
            {Fourier{numbers({1, 2}), numbers({3, 4}), 8.0}, "screw pitch"},
            {Backlash{0.7}}}},
          {{'Y', 'X', false}, {{Polynomial{numbers({1, 2, 3, 4}), 1, 9}}}},
          {{'Z', 'X', false}, {{line, "laser", Argument::Carriage, true, 0.5}}},
          {{'A', 'X', false}, {{spline}, {DirectionalTables{line, spline}, "both ways"}}},
          {{'B', 'X', false}, {{Repeatability{1.0, 3}}, {Asynchronous{1.0, 4}}}},
          {{'C', 'Y', true}, {{Constant{4.0}}}}};
}

TEST(Coefficients, ANumberIsNamedByItsElementItsCurveAndItsPlace) {
  const std::vector<Element> elements = all_shapes();
  std::vector<std::string> names;
  for (const Coefficient& c : coefficients(elements)) names.push_back(name_of(c, elements));
  const std::vector<std::string> expected = {"EXX[0]",
                                             "EXX[1]",
                                             "EXX[2]",
                                             "EXX screw pitch cos 1",
                                             "EXX screw pitch cos 2",
                                             "EXX screw pitch sin 1",
                                             "EXX screw pitch sin 2",
                                             "EXX backlash",
                                             "EYX[0]",
                                             "EYX[1]",
                                             "EYX[2]",
                                             "EYX[3]",
                                             "EZX[0]",
                                             "EZX[1]",
                                             "EZX[2]",
                                             "EZX[3]",
                                             "EAX[0]",
                                             "EAX[1]",
                                             "EAX[2]",
                                             "EAX[3]",
                                             "EAX both ways up[0]",
                                             "EAX both ways up[1]",
                                             "EAX both ways up[2]",
                                             "EAX both ways up[3]",
                                             "EAX both ways down[0]",
                                             "EAX both ways down[1]",
                                             "EAX both ways down[2]",
                                             "EAX both ways down[3]",
                                             "EC0Y"};
  EXPECT_EQ(names, expected) << "a random shape has no numbers";
}

TEST(Coefficients, NamesStayUniqueWhereCurvesAreAlike) {
  const std::vector<Element> elements = {{{'X', 'X', false},
                                          {{Constant{1}},
                                           {Constant{2}},
                                           {Backlash{1}},
                                           {Constant{3}, "backlash"},
                                           {Constant{3}, "#1"},
                                           {Legendre{numbers({1, 2}), 0, 1}},
                                           {Polynomial{numbers({1, 2}), 0, 1}},
                                           {Legendre{numbers({1}), 0, 1}, "run"},
                                           {Legendre{numbers({1}), 0, 1}, "run"}}}};
  std::set<std::string> names;
  for (const Coefficient& c : coefficients(elements)) names.insert(name_of(c, elements));
  EXPECT_EQ(names.size(), coefficients(elements).size());
}

TEST(Coefficients, ValuesComeBackAsTheyWerePut) {
  const std::vector<Element> elements = all_shapes();
  const VectorXd before = values(elements);
  ASSERT_EQ(before.size(), 29);
  EXPECT_EQ(before[7], 0.7);
  VectorXd other = VectorXd::LinSpaced(29, -3.0, 11.0);
  EXPECT_EQ(values(with_values(elements, other)), other);
  EXPECT_EQ(values(with_values(with_values(elements, other), before)), before);
  EXPECT_THROW(with_values(elements, VectorXd::Zero(28)), std::invalid_argument);
  EXPECT_THROW(with_values(elements, VectorXd::Zero(30)), std::invalid_argument);
  EXPECT_EQ(values({}).size(), 0);
}

TEST(Coefficients, EveryCurveIsItsNumbersTimesItsBasis) {
  SeededRandom random(20261121);
  std::normal_distribution<double> normal;
  std::vector<double> places = {0.0, 1e-12, -1e-12, -10.0, 5.0, 20.0, 0.5 * pi, pi, -25.0, 40.0};
  for (int i = 0; i < 200; ++i) places.push_back(30.0 * normal(random));
  double worst = 0.0;
  for (const bool primed : {false, true})
    for (const int direction : {-1, 0, 1})
      for (const double q : places) {
        std::vector<Element> elements = all_shapes();
        const auto count = Index(coefficients(elements).size());
        elements =
            with_values(elements, VectorXd::NullaryExpr(count, [&] { return normal(random); }));
        const CurveState state{q, primed ? -q : q, direction, 3, primed};
        for (const Element& element : elements)
          for (const Curve& curve : element.curves) {
            if (is_random(curve)) continue;
            const VectorXd b = basis(curve, state);
            const VectorXd v = values({{element.name, {curve}}});
            ASSERT_EQ(b.size(), v.size());
            const double size = b.cwiseAbs().dot(v.cwiseAbs());
            if (size == 0.0) {
              EXPECT_EQ(value(curve, state), 0.0);
              continue;
            }
            worst = std::max(worst, std::abs(b.dot(v) - value(curve, state)) / size);
          }
      }
  std::cout << "basis times numbers against value: " << worst << " of the sum of magnitudes\n";
  EXPECT_LT(worst, 1e-14);
}

TEST(Coefficients, ATableThatRefusesRefusesItsBasisToo) {
  const Curve curve{make_table(numbers({0, 1}), numbers({1, 2}))};
  EXPECT_THROW(basis(curve, {2.0, 2.0, 0, 0, false}), std::out_of_range);
  EXPECT_EQ(basis(curve, {0.25, 0.25, 0, 0, false}), numbers({0.75, 0.25}));
  EXPECT_EQ(basis({Repeatability{1.0, 1}}, {}).size(), 0);
}

}  // namespace
}  // namespace abbe::errors
