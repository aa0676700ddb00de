#include "errors/compliance.h"
#include "tests/errors/machines.h"
#include "tests/errors/refusal.h"
#include "tests/oracles/beam.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

using kinematics::AxisState;
using kinematics::Chain;
using kinematics::JointDeviation;
using kinematics::Pose;
using kinematics::Side;
using kinematics::Wrench;

constexpr double carbide = 6e5;  // N/mm^2

Compliance diagonal(std::initializer_list<double> entries) {
  Compliance C = Compliance::Zero();
  int i = 0;
  for (const double entry : entries) {
    C(i, i) = entry;
    ++i;
  }
  return C;
}

Wrench force(double x, double y, double z) {
  Wrench W = Wrench::Zero();
  W.head<3>() << x, y, z;
  return W;
}

Load cut(const Wrench& tool_wrench_t) {
  Load load;
  load.tool_wrench_t = tool_wrench_t;
  return load;
}

/// "w b X Y Z C A s t": both turns at the head, C carries A.
Chain head_head() {
  using enum Side;
  using enum kinematics::Motion;
  const Vector3d ex(1, 0, 0), ey(0, 1, 0), ez(0, 0, 1);
  return Chain(
      {joint('X', Tool, Linear, ex, {0, 0, 500}), joint('Y', Tool, Linear, ey, {0, 0, 500}),
       joint('Z', Tool, Linear, ez, {0, 0, 500}), joint('C', Tool, Rotary, ez, {0, 0, 400}),
       joint('A', Tool, Rotary, ex, {0, 0, 200}), joint('s', Tool, Spindle, ez, {0, 0, 150})},
      at(0, 0, 0), at(0, 0, 0));
}

/// Where the loaded tip really stands against where it should, in the workpiece.
Vector3d displaced_tip(const ComplianceModel& model, const AxisState& state, const Load& load) {
  const ForceDeviations D = deviations(model, state, load);
  const Pose T_tool = kinematics::motion(D.tool_t, Vector3d::Zero());
  const Pose T_part = kinematics::motion(D.workpiece_w, Vector3d::Zero());
  const Pose T_wt = T_part.inverse() * model.nominal.tool_in_workpiece(state.q, D.joints) * T_tool;
  return T_wt.translation() - model.nominal.tool_in_workpiece(state.q).translation();
}

// Cantilevers

TEST(Cantilever, ABarOfCarbideHasTheStiffnessOfItsFormula) {
  const CantileverSection bar{40.0, 10.0, carbide, 0.22};
  const Compliance C = stepped_cantilever({&bar, 1});
  const double k = 1.0 / C(0, 0);
  std::cout << "k = " << k << " N/mm\n";
  EXPECT_NEAR(k, 13805.8271, 5e-5);
  EXPECT_DOUBLE_EQ(C(1, 1), C(0, 0));
  const double EI = carbide * pi * 1e4 / 64.0;
  EXPECT_NEAR(C(3, 3), 40.0 / EI, 1e-15 * C(3, 3) + 1e-20);  // M L / E I
  EXPECT_NEAR(-C(4, 0) * EI, 40.0 * 40.0 / 2.0, 1e-9);       // F L^2 / 2 E I
  EXPECT_NEAR(C(2, 2) * carbide * pi * 25.0, 40.0, 1e-10);   // F L / E A
  const double G = carbide / (2.0 * 1.22);
  EXPECT_NEAR(C(5, 5) * G * pi * 1e4 / 32.0, 40.0, 1e-10);  // M L / G J
}

TEST(Cantilever, ASteppedOneHasTheDeflectionOfItsFormula) {
  const std::vector<CantileverSection> sections{{40.0, 10.0, carbide, 0.22},
                                                {30.0, 16.0, carbide, 0.22}};
  const Compliance C = stepped_cantilever(sections);
  std::cout << "100 N: " << 100.0 * C(0, 0) << " mm\n";
  EXPECT_NEAR(100.0 * C(0, 0), 0.0120614855, 5e-11);
}

TEST(Cantilever, PushedTowardsXItTurnsSoThatItsFreeEndLeansThatWay) {
  // The clamp lies along +z of the tip: the free end goes to +x, the bar leans, a point of the tool
  // below the tip (z < 0) goes farther still: EB x (0, 0, -1) must be along +x.
  const CantileverSection bar{40.0, 10.0, carbide, 0.22};
  const Compliance C = stepped_cantilever({&bar, 1});
  const kinematics::Deviation D = C * force(1, 2, 0);
  const Vector3d farther = D.tail<3>().cross(Vector3d(0, 0, -1));
  EXPECT_GT(farther.x(), 0.0);
  EXPECT_NEAR(farther.y(), 2.0 * farther.x(), 1e-18);
}

TEST(Cantilever, ALoadAboveTheTipErrsByItsStatedBoundAsAWrench) {
  const CantileverSection bar{40.0, 10.0, carbide, 0.22};
  const Compliance C = stepped_cantilever({&bar, 1});
  const double EI = carbide * pi * 1e4 / 64.0, F = 100.0, above = 5.0, from_clamp = 35.0;
  const double formula = F * from_clamp * from_clamp * (3 * 40.0 - from_clamp) / (6 * EI);
  EXPECT_NEAR(formula, 0.00589226967, 5e-12);
  const oracles::BeamPiece piece{40.0, EI};
  EXPECT_NEAR(oracles::beam_end({&piece, 1}, from_clamp, F, 0.0).deflection, formula, 1e-12);
  Wrench W = force(F, 0, 0);
  W.tail<3>() = Vector3d(0, 0, above).cross(Vector3d(F, 0, 0));
  const double as_wrench = (C * W)[0];
  const double bound = F * above * above * above / (6 * EI);
  std::cout << "as a wrench " << as_wrench << ", bound " << bound << "\n";
  EXPECT_NEAR(std::abs(as_wrench - formula), bound, 1e-12) << "which a single section reaches";
}

TEST(Cantilever, RandomStepsAgreeWithFiniteElements) {
  SeededRandom random(31);
  std::uniform_real_distribution<double> unit(0, 1);
  double worst = 0.0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<CantileverSection> sections;
    std::vector<oracles::BeamPiece> pieces;
    double length = 0.0;
    for (int i = 0; i < 1 + trial % 5; ++i) {
      const CantileverSection one{1.0 + 60.0 * unit(random), 2.0 + 40.0 * unit(random),
                                  1e5 + 5e5 * unit(random), 0.3};
      sections.push_back(one);
      const double EI = one.youngs_modulus * pi * std::pow(one.diameter, 4) / 64.0;
      pieces.insert(pieces.begin(), oracles::BeamPiece{one.length, EI});
      length += one.length;
    }
    const Compliance C = stepped_cantilever(sections);
    const oracles::BeamEnd pushed = oracles::beam_end(pieces, length, 1.0, 0.0);
    const oracles::BeamEnd bent = oracles::beam_end(pieces, length, 0.0, 1.0);
    // away from the clamp is -z, so a slope of x along it is -EB, one of y is +EA
    for (const auto& [ours, theirs] :
         {std::pair(C(0, 0), pushed.deflection), std::pair(-C(4, 0), pushed.slope),
          std::pair(C(1, 1), pushed.deflection), std::pair(C(3, 1), pushed.slope),
          std::pair(C(4, 4), bent.slope), std::pair(-C(0, 4), bent.deflection)})
      worst = std::max(worst, std::abs(ours / theirs - 1.0));
  }
  std::cout << "worst relative " << worst << "\n";
  EXPECT_LT(worst, 1e-8);
}

TEST(Cantilever, WhatIsNotPhysicalIsRefusedByItsSection) {
  const auto with = [](const CantileverSection& bad) {
    const std::vector<CantileverSection> sections{{40.0, 10.0}, bad};
    return refusal([&] { stepped_cantilever(sections); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(contains(with({0.0, 10.0}), "section 2: expected a length above 0"));
  EXPECT_TRUE(contains(with({1.0, -1.0}), "section 2: expected a diameter"));
  EXPECT_TRUE(contains(with({1.0, 1.0, nan}), "section 2: expected a Young's modulus"));
  EXPECT_TRUE(contains(with({1.0, 1.0, 1e5, 0.6}), "section 2: expected a Poisson ratio"));
  EXPECT_TRUE(contains(with({1.0, 1.0, 1e5, -1.0}), "section 2: expected a Poisson ratio"));
  EXPECT_TRUE(contains(refusal([] { stepped_cantilever({}); }), "at least one section"));
}

// What a compliance may be

TEST(Compliance, ThatIsNotPhysicalIsRefusedByName) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  const auto why = [](const Compliance& C) { return refusal([&] { validate(C, "fixture"); }); };
  EXPECT_EQ(why(Compliance::Zero()), "");
  EXPECT_EQ(why(diagonal({1e-5, 1e-5, 1e-6, 1e-9, 1e-9, 1e-10})), "");
  for (const double bad : {nan, inf, -inf}) {
    Compliance C = diagonal({1e-5});
    C(2, 4) = bad;
    EXPECT_TRUE(contains(why(C), "fixture: expected finite"));
  }
  Compliance skew = diagonal({1e-5, 1e-5});
  skew(0, 1) = 1e-6;
  EXPECT_TRUE(contains(why(skew), "fixture: expected a symmetric"));
  skew(0, 1) = 1e-15;  // 1e-10 of the largest
  EXPECT_EQ(why(skew), "");
  EXPECT_TRUE(contains(why(diagonal({1e-5, -1e-6})), "negative eigenvalue"));
  EXPECT_EQ(why(diagonal({1e-5, -1e-15})), "");
  Compliance coupled = diagonal({1e-5, 1e-5});
  coupled(0, 1) = coupled(1, 0) = 1.1e-5;  // positive diagonal, eigenvalue -1e-6
  EXPECT_TRUE(contains(why(coupled), "negative eigenvalue"));
  EXPECT_TRUE(contains(why(diagonal({1e308, 0, 0, 1e305})), "finite"));
}

TEST(Compliance, BindNamesWhatIsWrong) {
  const auto why = [](const std::function<void(ComplianceErrors&)>& spoil) {
    ComplianceErrors errors;
    spoil(errors);
    return refusal([&] { bind(errors, gantry()); });
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(why([](auto&) {}), "");
  EXPECT_TRUE(contains(why([](auto& e) {
                         e.joints = {{'B', diagonal({})}};
                       }),
                       "axis B: expected an axis"));
  EXPECT_TRUE(contains(why([](auto& e) {
                         e.joints = {{'X', diagonal({})}, {'X', diagonal({})}};
                       }),
                       "axis X"));
  EXPECT_TRUE(contains(why([](auto& e) {
                         e.joints = {{'S', diagonal({})}, {'s', diagonal({})}};
                       }),
                       "axis s"))
      << "the spindle by both its letters";
  EXPECT_TRUE(contains(why([](auto& e) { e.joints = {{'Y', diagonal({-1e-5})}}; }), "axis Y"));
  EXPECT_TRUE(contains(why([](auto& e) { e.tool = diagonal({-1e-5}); }), "tool"));
  EXPECT_TRUE(contains(why([](auto& e) { e.fixture = diagonal({-1e-5}); }), "fixture"));
  EXPECT_TRUE(contains(why([](auto& e) { e.scale = -1; }), "scale"));
  EXPECT_TRUE(contains(why([](auto& e) {
                         e.masses = {{'Z', -1.0, Vector3d::Zero()}};
                       }),
                       "mass on Z"));
  EXPECT_TRUE(contains(why([](auto& e) {
                         e.masses = {{'Q', 1.0, Vector3d::Zero()}};
                       }),
                       "mass on Q"));
  EXPECT_TRUE(contains(why([&](auto& e) {
                         e.masses = {{'Z', nan, Vector3d::Zero()}};
                       }),
                       "mass on Z"));
  EXPECT_TRUE(contains(why([&](auto& e) { e.masses = {{'Z', 1.0, {nan, 0, 0}}}; }), "mass on Z"));
  EXPECT_TRUE(contains(why([&](auto& e) { e.gravity_b = Vector3d(0, 0, nan); }), "gravity"));
  EXPECT_TRUE(contains(why([&](auto& e) { e.clamping_w[3] = nan; }), "clamping"));
  EXPECT_TRUE(contains(why([](auto& e) { e.workpiece = WorkpieceBar{}; }), "workpiece"));
}

// The cut

TEST(ForcePart, ASlideGivesWayAlongTheForceAndTurnsByItsArm) {
  // X of the gantry stands at (0, -400, 300); the tip at (0, 0, 0): arm r = (0, 400, -300).
  // 100 N along y: M = r x F = (300 * 100, 0, 0) N mm.
  ComplianceErrors errors;
  errors.joints = {{'X', diagonal({0, 2e-6, 0, 1e-11, 0, 0})}};
  const ComplianceModel model = bind(errors, gantry());
  const AxisState state = state_at({0, 0, 0, 0, 0, 0});
  const ForceDeviations D = deviations(model, state, cut(force(0, 100, 0)));
  kinematics::Deviation expected;
  expected << 0, 2e-4, 0, 3e-7, 0, 0;
  EXPECT_LT((D.joints[1].motion - expected).norm(), 1e-18);
  for (const std::size_t other : {0, 2, 3, 4, 5}) EXPECT_TRUE(D.joints[other].motion.isZero(0.0));
  // by hand: 0.2 um of shift and 0.3 urad * 300 mm of turn along y, 0.3 urad * 400 mm along z
  const Vector3d d = displaced_tip(model, state, cut(force(0, 100, 0)));
  EXPECT_LT((d - Vector3d(0, 2e-4 + 9e-5, 1.2e-4)).norm(), 1e-9);
}

TEST(ForcePart, APrimedTableMovesWithTheReactionSoThatTheTipInThePartMovesWithTheForce) {
  ComplianceErrors errors;
  errors.joints = {{'C', diagonal({1e-5, 1e-5, 1e-5, 0, 0, 0})}};
  const ComplianceModel model = bind(errors, gantry());
  for (const double c : {0.0, pi / 2, 0.7}) {
    const AxisState state = state_at({c, 30, 40, 50, 0, 0});
    const Wrench W = force(10, 20, 30);  // the tool stands along the bed's axes
    const ForceDeviations D = deviations(model, state, cut(W));
    EXPECT_LT((D.joints[0].motion + 1e-5 * W).norm(), 1e-17) << "the table, along the bed";
    const Vector3d d = displaced_tip(model, state, cut(W));
    const Matrix3d R_wt = model.nominal.tool_in_workpiece(state.q).linear();
    EXPECT_LT((d - 1e-5 * R_wt * W.head<3>()).norm(), 1e-13) << "the tip, seen from the part";
  }
}

TEST(ForcePart, OfAHeadAxisTurnsWithWhatCarriesIt) {
  // A rides on C. At C = 90 deg the soft x of A points along the bed's y, so a push along y meets
  // it, one along x does not.
  ComplianceErrors errors;
  errors.joints = {{'A', diagonal({1e-5})}};
  const ComplianceModel model = bind(errors, head_head());
  const AxisState state = state_at({0, 0, 0, pi / 2, 0, 0});
  const Pose T_wt = model.nominal.tool_in_workpiece(state.q);
  const auto pushed = [&](const Vector3d& along_w) {
    const Vector3d t = T_wt.linear().transpose() * along_w;
    return displaced_tip(model, state, cut(force(t.x(), t.y(), t.z())));
  };
  EXPECT_LT((pushed({0, 100, 0}) - Vector3d(0, 1e-3, 0)).norm(), 1e-15);
  EXPECT_LT(pushed({100, 0, 0}).norm(), 1e-15);
  EXPECT_LT(pushed({0, 0, 100}).norm(), 1e-15);
}

TEST(ForcePart, DoesTheWorkOfItsLoadOnAnyMachine) {
  // Reciprocity holds the virtual work: what load 1 does on the displacement of load 2 is what
  // load 2 does on that of load 1, tool, fixture, wall and every joint included.
  SeededRandom random(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto any = [&](int n) { return VectorXd::NullaryExpr(n, [&] { return unit(random); }); };
  double worst = 0.0;
  for (const Chain& chain : {gantry(), turned_gantry(), platform(), head_head()}) {
    for (int trial = 0; trial < 50; ++trial) {
      const auto some = [&] {
        Eigen::Matrix<double, 6, 6> A = MatrixXd::NullaryExpr(6, 6, [&] { return unit(random); });
        A.bottomRows<3>() *= 1e-2;
        return Compliance(1e-6 * A * A.transpose());
      };
      ComplianceErrors errors;
      for (const kinematics::Joint& joint : chain.joints())
        errors.joints.push_back({joint.name, some()});
      errors.tool = some();
      errors.fixture = some();
      const ComplianceModel model = bind(errors, chain);
      AxisState state;
      state.q = any(chain.size());
      for (int i = 0; i < chain.size(); ++i)
        if (chain.joints()[std::size_t(i)].motion == kinematics::Motion::Linear) state.q[i] *= 200;
      Wrench one = any(6), two = any(6);
      one.tail<3>() *= 50;
      two.tail<3>() *= 50;
      // first-order displacement of the tool in the part, in the tool's own axes
      const auto displacement = [&](const Wrench& W) {
        const double small = 1e-3;
        ForceDeviations D = deviations(scaled(model, small), state, cut(W));
        const Pose actual = kinematics::motion(D.workpiece_w, Vector3d::Zero()).inverse() *
                            chain.tool_in_workpiece(state.q, D.joints) *
                            kinematics::motion(D.tool_t, Vector3d::Zero());
        const Pose E = kinematics::error_transform(chain.tool_in_workpiece(state.q), actual);
        kinematics::Deviation d;
        d << E.translation(), kinematics::rotation_vector(E.linear());
        return kinematics::Deviation(d / small);
      };
      const double there = two.dot(displacement(one)), back = one.dot(displacement(two));
      const double size =
          std::abs(one.dot(displacement(one))) + std::abs(two.dot(displacement(two)));
      worst = std::max(worst, std::abs(there - back) / size);
      EXPECT_GT(one.dot(displacement(one)), 0.0) << "the tip must go with the push";
    }
  }
  std::cout << "worst " << worst << " of the work\n";
  EXPECT_LT(worst, 1e-5);
}

TEST(ForcePart, DoublesWithTheCompliance) {
  ComplianceErrors errors;
  for (const char axis : {'C', 'X', 'Y', 'Z', 'A', 'S'})
    errors.joints.push_back({axis, diagonal({1e-5, 2e-5, 1e-5, 1e-10, 2e-10, 1e-10})});
  errors.tool = diagonal({5e-5, 5e-5, 1e-6});
  errors.fixture = diagonal({1e-5, 1e-5, 1e-5});
  const ComplianceModel model = bind(errors, gantry());
  const AxisState state = state_at({0.4, 100, -50, 30, 0.6, 0});
  const Load load = cut(force(60, -80, 40));
  const Vector3d once = displaced_tip(model, state, load);
  const Vector3d twice = displaced_tip(scaled(model, 2.0), state, load);
  const double off = (twice - 2.0 * once).norm() / once.norm();
  std::cout << "tip " << once.norm() * 1e3 << " um, doubling off by " << off << "\n";
  EXPECT_GT(once.norm(), 1.0_um);
  EXPECT_LT(off, 2e-4);
  EXPECT_LT((deviations(scaled(model, 2.0), state, load).tool_t -
             2.0 * deviations(model, state, load).tool_t)
                .norm(),
            1e-18);
  errors.scale = 2.0;
  EXPECT_EQ(displaced_tip(bind(errors, gantry()), state, load), twice);
}

TEST(ForcePart, FixtureAndWallMoveWithTheReaction) {
  ComplianceErrors errors;
  errors.fixture = diagonal({1e-5, 1e-5, 1e-5, 0, 0, 1e-9});
  errors.workpiece = WorkpieceBar{{0, 0, 0}, {0, 0, 1}, 50.0, 200.0, 7e4};
  const ComplianceModel model = bind(errors, gantry());
  const AxisState state = state_at({0, 30, 40, 20, 0, 0});  // tip at (30, 40, 20)
  Load load = cut(force(10, 0, 0));
  load.contact_t = Vector3d(0, 0, 5);
  const ForceDeviations D = deviations(model, state, load);
  const double wall = 25.0 * 25.0 * 25.0 / (3 * 7e4 * 200.0);
  // M about w = -(r x F) = -(0, 20 * 10, -40 * 10)
  kinematics::Deviation expected;
  expected << -1e-4 - 10 * wall, 0, 0, 0, 0, 4e-7;
  EXPECT_LT((D.workpiece_w - expected).norm(), 1e-17);
  EXPECT_GT(displaced_tip(model, state, load).x(), 0.0) << "seen from the part the tip goes on";
  EXPECT_NEAR(deviations(scaled(model, 2.0), state, load).workpiece_w[0], -2e-4 - 20 * wall, 1e-17);
}

TEST(ForcePart, ClampingBearsOnTheFixtureAlone) {
  ComplianceErrors errors;
  errors.joints = {{'C', diagonal({1e-5, 1e-5, 1e-5})}};
  errors.fixture = diagonal({0, 0, 2e-6});
  errors.clamping_w = force(0, 0, -500);
  const ComplianceModel model = bind(errors, gantry());
  const ForceDeviations D = deviations(model, state_at({0, 0, 0, 0, 0, 0}), {});
  EXPECT_NEAR(D.workpiece_w[2], -1e-3, 1e-17);
  for (const JointDeviation& joint : D.joints) EXPECT_TRUE(joint.motion.isZero(0.0));
}

TEST(ForcePart, WithoutLoadThereIsNone) {
  ComplianceErrors errors;
  errors.joints = {{'X', diagonal({1e-5, 1e-5, 1e-5})}};
  errors.tool = diagonal({1e-5});
  errors.masses = {{'X', 100.0, {0, 0, 0}}};  // neither gravity nor inertia
  const ForceDeviations D =
      deviations(bind(errors, gantry()), state_at({0.3, 1, 2, 3, 0.4, 0}), {});
  for (const JointDeviation& joint : D.joints) EXPECT_TRUE(joint.motion.isZero(0.0));
  EXPECT_TRUE(D.tool_t.isZero(0.0));
  EXPECT_TRUE(D.workpiece_w.isZero(0.0));
}

// Masses

constexpr double g = 9806.65;  // mm/s^2

TEST(Weight, AtTheEndOfAnOverhungSlideTurnsItByHand) {
  // Y carries 200 kg 300 mm beyond X's point in y: X sees F = -1961.33 N along z and M about x of
  // 300 * -1961.33 N mm.
  ComplianceErrors errors;
  errors.joints = {{'X', diagonal({0, 0, 1e-6, 2e-11, 0, 0})}};
  errors.masses = {{'Y', 200.0, {0, -100, 350}}};  // X's point is at y = -400
  errors.gravity_b = Vector3d(0, 0, -g);
  const ComplianceModel model = bind(errors, gantry());
  const ForceDeviations D = deviations(model, state_at({0, 0, 0, 0, 0, 0}), {});
  EXPECT_NEAR(D.joints[1].motion[2], -1961.33e-6, 1e-12);
  EXPECT_NEAR(D.joints[1].motion[3], -1961.33 * 300 * 2e-11, 1e-16);
  EXPECT_TRUE(D.joints[2].motion.isZero(0.0)) << "Y is stiff";
  // Y goes out by 100 mm: the arm grows
  const ForceDeviations far = deviations(model, state_at({0, 0, 100, 0, 0, 0}), {});
  EXPECT_NEAR(far.joints[1].motion[3], -1961.33 * 400 * 2e-11, 1e-16);
}

TEST(Weight, OfAPrimedTableLoadsEveryAxisBelowItAndNoneAbove) {
  // turned gantry "w A' Z' Y' X' b C s t": a table of 50 kg on Y' loads Y and X, not Z and A, and
  // moves against the command: Y = +80 carries it to -80.
  ComplianceErrors errors;
  for (const char axis : {'A', 'Z', 'Y', 'X', 'C'})
    errors.joints.push_back({axis, diagonal({1e-6, 1e-6, 1e-6, 1e-11, 0, 0})});
  errors.masses = {{'Y', 50.0, {0, 20, 0}}};
  errors.gravity_b = Vector3d(0, 0, -g);
  const ComplianceModel model = bind(errors, turned_gantry());
  const ForceDeviations D = deviations(model, state_at({0, 0, 80, 0, 0, 0}), {});
  const double F = -50 * g * 1e-3;
  EXPECT_TRUE(D.joints[0].motion.isZero(0.0));
  EXPECT_TRUE(D.joints[1].motion.isZero(0.0));
  EXPECT_TRUE(D.joints[4].motion.isZero(0.0));
  EXPECT_NEAR(D.joints[2].motion[2], 1e-6 * F, 1e-15);
  EXPECT_NEAR(D.joints[2].motion[3], 1e-11 * 20 * F, 1e-16) << "Y's point travels with it";
  EXPECT_NEAR(D.joints[3].motion[2], 1e-6 * F, 1e-15);
  // X's point is at y = -400; the mass is at 20 - 80
  EXPECT_NEAR(D.joints[3].motion[3], 1e-11 * (-60 + 400) * F, 1e-16);
}

TEST(Weight, OfAGantrysXCarriageMovesOverTheBed) {
  // The bed bears the X carriage at the joint's point, which travels along: the deviation of X is
  // the same wherever it stands, and so is no error of form; a mass on X that stays in the bed
  // would not be one of its carriage.
  ComplianceErrors errors;
  errors.joints = {{'X', diagonal({0, 0, 1e-6, 0, 1e-11, 0})}};
  errors.masses = {{'X', 500.0, {30, -400, 300}}};
  errors.gravity_b = Vector3d(0, 0, -g);
  const ComplianceModel model = bind(errors, gantry());
  for (const double x : {-300.0, 0.0, 250.0}) {
    const ForceDeviations D = deviations(model, state_at({0, x, 0, 0, 0, 0}), {});
    EXPECT_NEAR(D.joints[1].motion[2], -500 * g * 1e-9, 1e-12);
    EXPECT_NEAR(D.joints[1].motion[4], 30 * 500 * g * 1e-14, 1e-15) << "its +x end goes down";
  }
}

TEST(Weight, OfToolAndPartBearsOnToolAndFixtureToo) {
  ComplianceErrors errors;
  errors.joints = {{'S', diagonal({0, 0, 1e-6})}, {'C', diagonal({0, 0, 1e-6})}};
  errors.tool = diagonal({1e-5, 1e-5, 0});
  errors.fixture = diagonal({0, 0, 1e-6});
  errors.masses = {{'t', 2.0, {0, 0, 60}}, {'w', 30.0, {10, 0, 40}}};
  errors.gravity_b = Vector3d(0, 0, -g);
  const ComplianceModel model = bind(errors, gantry());
  const ForceDeviations level = deviations(model, state_at({0, 0, 0, 0, 0, 0}), {});
  EXPECT_NEAR(level.joints[5].motion[2], -2 * g * 1e-9, 1e-15);
  EXPECT_NEAR(level.joints[0].motion[2], -30 * g * 1e-9, 1e-15);
  EXPECT_NEAR(level.workpiece_w[2], -30 * g * 1e-9, 1e-15);
  EXPECT_LT(level.tool_t.norm(), 1e-15);
  // The head turned by A = 90 deg: the tool's y points up, and it sags against it.
  const ForceDeviations lying = deviations(model, state_at({0, 0, 0, 0, pi / 2, 0}), {});
  EXPECT_NEAR(lying.tool_t[1], -2 * g * 1e-8, 1e-14);
}

TEST(Weight, AgreesWithTheWorkOnDisplacedMasses) {
  // C^-1 delta must be the derivative of the work by the deviation, here by central differences of
  // the place of the mass, which rides as the tip of a chain that ends with its joint.
  SeededRandom random(99);
  std::uniform_real_distribution<double> unit(-1, 1);
  double worst = 0.0;
  for (const kinematics::DeviationAxes axes :
       {kinematics::DeviationAxes::Fixed, kinematics::DeviationAxes::Turning}) {
    for (const Chain& machine : {gantry(), turned_gantry(), head_head()}) {
      std::vector<kinematics::Joint> joints = machine.joints();
      for (kinematics::Joint& joint : joints) joint.deviation_axes = axes;
      const Chain chain(joints, machine.T_bw_home(), machine.T_bt_home());
      for (int carrier = 0; carrier < chain.size(); ++carrier) {
        const Side side = joints[std::size_t(carrier)].side;
        const Vector3d centre(200 * unit(random), 200 * unit(random), 200 * unit(random));
        ComplianceErrors errors;
        for (const kinematics::Joint& joint : joints)
          errors.joints.push_back({joint.name, Compliance::Identity()});
        errors.masses = {{joints[std::size_t(carrier)].name, 1000.0, centre}};
        const Vector3d G(unit(random), unit(random), unit(random));  // N, as 1000 kg make it
        errors.gravity_b = G;
        AxisState state;
        state.q.resize(chain.size());
        for (int i = 0; i < chain.size(); ++i)
          state.q[i] = unit(random) *
                       (joints[std::size_t(i)].motion == kinematics::Motion::Linear ? 150.0 : 2.0);
        const ForceDeviations D = deviations(bind(errors, chain), state, {});
        // joints beyond the carrier stand still at zero, so that the mass ends the branch
        AxisState at_mass = state;
        for (int i = 0; i < chain.size(); ++i)
          if (side == Side::Tool ? i > carrier : i < carrier) at_mass.q[i] = 0.0;
        const Pose home = at(centre.x(), centre.y(), centre.z());
        const Chain to_mass(joints, side == Side::Tool ? Pose::Identity() : home,
                            side == Side::Tool ? home : Pose::Identity());
        for (int i = 0; i < chain.size(); ++i) {
          const bool carries = joints[std::size_t(i)].side == side &&
                               (side == Side::Tool ? i <= carrier : i >= carrier);
          for (int k = 0; k < 6; ++k) {
            const auto place = [&](double by) {
              std::vector<JointDeviation> one(std::size_t(chain.size()));
              one[std::size_t(i)].motion[k] = by;
              return Vector3d((side == Side::Tool ? to_mass.tool_in_bed(at_mass.q, one)
                                                  : to_mass.workpiece_in_bed(at_mass.q, one))
                                  .translation());
            };
            const double h = 1e-4;
            const double work = carries ? G.dot(place(h) - place(-h)) / (2 * h) : 0.0;
            worst = std::max(worst, std::abs(D.joints[std::size_t(i)].motion[k] - work) / 600.0);
          }
        }
      }
    }
  }
  std::cout << "worst " << worst << " of force times arm\n";
  EXPECT_LT(worst, 1e-8);
}

TEST(Inertia, PushesAgainstTheAcceleration) {
  ComplianceErrors errors;
  errors.joints = {{'X', diagonal({1e-6, 0, 0})}, {'Y', diagonal({1e-6, 1e-6, 0})}};
  errors.masses = {{'Y', 100.0, {0, 0, 0}}};
  errors.inertia = true;
  const ComplianceModel model = bind(errors, gantry());
  Load load;
  load.acceleration = kinematics::AxisVector::Zero(6);
  load.acceleration[1] = 5000.0;  // X at 5 m/s^2: 500 N backwards on X and on Y which rides on it
  ForceDeviations D = deviations(model, state_at({0, 0, 0, 0, 0, 0}), load);
  EXPECT_NEAR(D.joints[1].motion[0], -500e-6, 1e-15);
  EXPECT_NEAR(D.joints[2].motion[0], -500e-6, 1e-15);
  load.acceleration[1] = 0.0;
  load.acceleration[2] = -2000.0;
  D = deviations(model, state_at({0, 0, 0, 0, 0, 0}), load);
  EXPECT_NEAR(D.joints[2].motion[1], +200e-6, 1e-15);
  load.acceleration.resize(0);
  EXPECT_TRUE(deviations(model, state_at({0, 0, 0, 0, 0, 0}), load).joints[2].motion.isZero(0.0));
}

TEST(Inertia, OfAPrimedTableGoesWithTheCommandSinceTheTableGoesAgainstIt) {
  ComplianceErrors errors;
  errors.joints = {{'X', diagonal({1e-6})}};
  errors.masses = {{'X', 100.0, {0, 0, 0}}};
  errors.inertia = true;
  Load load;
  load.acceleration = kinematics::AxisVector::Zero(3);
  load.acceleration[1] = 1000.0;
  const ForceDeviations D = deviations(bind(errors, platform()), state_at({0, 0, 0}), load);
  EXPECT_NEAR(D.joints[1].motion[0], +100e-6, 1e-15);
}

TEST(Inertia, OfATurnIsTangential) {
  // A of the gantry turns about x at z = 200; a mass at z = 100 is 100 below: alpha about x gives
  // a = alpha x r = alpha (1,0,0) x (0,0,-100) = alpha (0, 100, 0).
  ComplianceErrors errors;
  errors.joints = {{'Z', diagonal({0, 1e-6, 0})}};
  errors.masses = {{'A', 10.0, {0, 0, 100}}};
  errors.inertia = true;
  Load load;
  load.acceleration = kinematics::AxisVector::Zero(6);
  load.acceleration[4] = 20.0;
  const ForceDeviations D = deviations(bind(errors, gantry()), state_at({0, 0, 0, 0, 0, 0}), load);
  EXPECT_NEAR(D.joints[3].motion[1], -10 * 20 * 100 * 1e-9, 1e-16);
}

}  // namespace
}  // namespace abbe::errors
