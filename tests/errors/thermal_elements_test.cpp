#include "errors/thermal_elements.h"
#include "tests/errors/machines.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

using kinematics::AxisVector;
using kinematics::Chain;
using kinematics::Deviation;
using kinematics::JointDeviation;

constexpr double steel = 11.7e-6;  // per K

VectorXd warm(std::initializer_list<double> T_C) {
  return Eigen::Map<const VectorXd>(T_C.begin(), Index(T_C.size()));
}

AxisVector q_of(std::initializer_list<double> q) { return state_at(q).q; }

ThermalFunction per_K(int node, double value) {
  return {0.0, {{node, std::nullopt, value, std::nullopt}}};
}

ThermalElement drift(const std::string& name, ThermalFunction offset) {
  return {parse_element_name(name), std::move(offset), {}, 0.0};
}

AxisExpansion screw(char axis, double fixed = 0.0) {
  return {axis, Feedback::Motor, Expansion{0, steel, fixed}, std::nullopt};
}

double sum_of_magnitudes(const std::vector<JointDeviation>& deviations) {
  double sum = 0.0;
  for (const JointDeviation& joint : deviations)
    sum += joint.motion.cwiseAbs().sum() + joint.location.cwiseAbs().sum();
  return sum;
}

// ---- growth

TEST(ThermalElements, AScrewOf1000mmGrowsBy117umIn10K) {
  ThermalErrors errors;
  errors.expansions = {screw('X')};
  const ThermalModel model = bind(errors, gantry(), 1);
  const auto d = deviations(model, q_of({0, 1000, 0, 0, 0, 0}), warm({30.0}));
  EXPECT_NEAR(d[1].motion[0], 0.117, 1e-16);
  EXPECT_EQ(sum_of_magnitudes(d), std::abs(d[1].motion[0])) << "and nothing else";
}

TEST(ThermalElements, GrowthIsCountedFromTheFixedEnd) {
  ThermalErrors errors;
  errors.expansions = {screw('Y', -400.0)};
  const ThermalModel model = bind(errors, gantry(), 1);
  const auto grown = [&](double y) {
    return deviations(model, q_of({0, 0, y, 0, 0, 0}), warm({25.0}))[2].motion[1];
  };
  EXPECT_EQ(grown(-400), 0.0);
  EXPECT_NEAR(grown(100), steel * 5 * 500, 1e-16);
  EXPECT_NEAR(grown(-500), -steel * 5 * 100, 1e-16);
}

TEST(ThermalElements, FeedbackDecidesWhichGrowthShows) {
  AxisExpansion axis{'Z', Feedback::Motor, Expansion{0, steel, 0.0}, Expansion{1, 8e-6, 100.0}};
  const auto grown = [&](Feedback feedback) {
    axis.feedback = feedback;
    ThermalErrors errors;
    errors.expansions = {axis};
    const ThermalModel model = bind(errors, gantry(), 2);
    return deviations(model, q_of({0, 0, 0, 300, 0, 0}), warm({40.0, 22.0}))[3].motion[2];
  };
  EXPECT_NEAR(grown(Feedback::Motor), steel * 20 * 300, 1e-16);
  EXPECT_NEAR(grown(Feedback::Scale), 8e-6 * 2 * 200, 1e-16);
}

TEST(ThermalElements, OnAPrimedAxisTheCarriageItselfGoesFartherFromItsFixedEnd) {
  // table X' at command +200 stands at -200: a warm screw puts it still lower, so the tool stands
  // farther along +X in the workpiece
  ThermalErrors errors;
  errors.expansions = {screw('X'), screw('Z', 50.0)};
  const Chain chain = platform();  // w S' X' b Z t
  const ThermalModel model = bind(errors, chain, 1);
  const AxisVector q = q_of({0, 200, 30});
  const auto d = deviations(model, q, warm({30.0}));
  const double x = steel * 10 * 200;
  EXPECT_NEAR(d[1].motion[0], -x, 1e-16);
  EXPECT_NEAR(d[2].motion[2], steel * 10 * (30 - 50), 1e-16);
  const Vector3d seen =
      chain.tool_in_workpiece(q, d).translation() - chain.tool_in_workpiece(q).translation();
  EXPECT_NEAR(seen.x(), x, 1e-13);
  errors.expansions = {screw('X', 200.0)};
  EXPECT_EQ(deviations(bind(errors, chain, 1), q, warm({30.0}))[1].motion[0], 0.0)
      << "the fixed end is a commanded position";
}

TEST(ThermalElements, BothSidesOfTheBedGrowAlikeInTheWorkpiece) {
  ThermalErrors errors;
  errors.expansions = {screw('X', -30.0), screw('Y', 20.0), screw('Z')};
  const auto seen = [&](const Chain& chain, const AxisVector& q) -> Vector3d {
    const auto d = deviations(bind(errors, chain, 1), q, warm({28.0}));
    return chain.tool_in_workpiece(q, d).translation() - chain.tool_in_workpiece(q).translation();
  };
  const Vector3d tool_side = seen(gantry(), q_of({0, 100, -150, 80, 0, 0}));
  const Vector3d work_side = seen(turned_gantry(), q_of({0, 80, -150, 100, 0, 0}));
  EXPECT_NEAR((tool_side - Vector3d(130, -170, 80) * steel * 8).norm(), 0.0, 1e-13);
  EXPECT_NEAR((tool_side - work_side).norm(), 0.0, 1e-13);
}

TEST(ThermalElements, AnObliqueSlideGrowsAlongItself) {
  const Vector3d along = Vector3d(1, 0, -2).normalized();
  const Chain chain(
      {joint('U', kinematics::Side::Tool, kinematics::Motion::Linear, along, {0, 0, 0})},
      at(0, 0, 0), at(0, 0, 0));
  ThermalErrors errors;
  errors.expansions = {screw('U')};
  const auto d = deviations(bind(errors, chain, 1), q_of({500}), warm({21.0}));
  EXPECT_NEAR((d[0].motion.head<3>() - steel * 500 * along).norm(), 0.0, 1e-17);
  EXPECT_EQ(d[0].motion.tail<3>().norm(), 0.0);
}

// ---- composite elements

TEST(ThermalElements, YangsSlopeHasAConstantAndTwoTemperatures) {
  // um and cm: (-0.027523 - 0.0049600 dT7 + 0.033601 dT8) x
  constexpr double per_cm = 1e-4;  // um/cm = 1e-3 mm / 10 mm
  ThermalElement element;
  element.name = parse_element_name("EXX");
  element.slope = {-0.027523 * per_cm,
                   {{0, std::nullopt, -0.0049600 * per_cm, std::nullopt},
                    {1, std::nullopt, 0.033601 * per_cm, std::nullopt}}};
  ThermalErrors errors;
  errors.elements = {element};
  errors.reference_T_C = 25.0;
  const ThermalModel model = bind(errors, gantry(), 2);
  for (const double dT7 : {0.0, 3.0, 12.5})
    for (const double dT8 : {0.0, 2.0, 9.0})
      for (const double x_cm : {-40.0, 0.0, 17.0, 40.0}) {
        const double um = (-0.027523 - 0.0049600 * dT7 + 0.033601 * dT8) * x_cm;
        const auto d =
            deviations(model, q_of({0, 10 * x_cm, 0, 0, 0, 0}), warm({25.0 + dT7, 25.0 + dT8}));
        EXPECT_NEAR(d[1].motion[0], um * 1e-3, 1e-17) << dT7 << " " << dT8 << " " << x_cm;
      }
}

TEST(ThermalElements, OffsetAndSlopeAddUpAboutTheFixedBearing) {
  ThermalElement element = drift("EZY", per_K(0, 2.0_um));
  element.offset.constant = 1.0_um;
  element.slope = per_K(1, 5e-6);
  element.fixed = 100.0;
  ThermalErrors errors;
  errors.elements = {element};
  const ThermalModel model = bind(errors, gantry(), 2);
  const auto d = deviations(model, q_of({0, 0, 40, 0, 0, 0}), warm({23.0, 24.0}));
  EXPECT_NEAR(d[2].motion[2], 1.0_um + 6.0_um + 5e-6 * 4 * (40 - 100), 1e-17);
}

TEST(ThermalElements, ThePositionOfAnElementIsTheCommandAlsoOnAPrimedAxis) {
  ThermalElement element{parse_element_name("EXX"), {}, per_K(0, 1e-6), 0.0};
  ThermalErrors errors;
  errors.elements = {element};
  const auto d = deviations(bind(errors, platform(), 1), q_of({0, 200, 0}), warm({21.0}));
  EXPECT_NEAR(d[1].motion[0], +1e-6 * 200, 1e-18) << "as written, of the carriage itself";
}

TEST(ThermalElements, ATiltFollowsADifferenceAndASpindleGrowsByATable) {
  ThermalErrors errors;
  errors.elements = {drift("EAS", {0.0, {{0, 1, 4.0_urad, std::nullopt}}}),
                     drift("EZS", {0.0,
                                   {{2, std::nullopt, 0.0,
                                     make_table(warm({0, 10, 40}), warm({0, 8.0_um, 20.0_um}),
                                                TableInterpolation::Linear)}}}),
                     drift("EB0Z", per_K(1, 2.0_urad))};
  const ThermalModel model = bind(errors, gantry(), 3);
  const auto d = deviations(model, q_of({0, 0, 0, 0, 0, 0}), warm({29.0, 22.0, 45.0}));
  EXPECT_NEAR(d[5].motion[3], 28.0_urad, 1e-18);
  EXPECT_NEAR(d[5].motion[2], 14.0_um, 1e-17);
  EXPECT_NEAR(d[3].location[4], 4.0_urad, 1e-18);
  EXPECT_NEAR(sum_of_magnitudes(d), 28.0_urad + 14.0_um + 4.0_urad, 1e-16) << "and nothing else";
}

TEST(ThermalElements, AtTheReferenceOnlyConstantsAreLeft) {
  ThermalErrors errors;
  errors.elements = {drift("EZS", per_K(0, 3.0_um)), drift("EC0Y", per_K(1, 1.0_urad))};
  errors.expansions = {screw('X'), screw('Y'), screw('Z')};
  errors.reference_T_C = 23.5;
  const ThermalModel model = bind(errors, gantry(), 2);
  const auto d = deviations(model, q_of({1, 200, -300, 400, 1, 0}), warm({23.5, 23.5}));
  EXPECT_EQ(sum_of_magnitudes(d), 0.0) << "to the last bit";
}

TEST(ThermalElements, EveryElementOfAllJointsGoesToItsPlace) {
  ThermalErrors errors;
  int seen = 0;
  const Chain chain = gantry();
  const std::string axes = "CXYZAS";  // in the order of the chain
  for (std::size_t j = 0; j < axes.size(); ++j)
    for (const char direction : std::string("XYZABC"))
      for (const bool location : {false, true}) {
        const ElementName name{direction, axes[j], location};
        const double value = 1e-3 * (1 + seen);
        errors.elements = {{name, per_K(0, value), {}, 0.0}};
        try {
          bind(errors, chain, 1);
        } catch (const std::invalid_argument&) {
          continue;  // as for geometric errors
        }
        const auto d = deviations(bind(errors, chain, 1), q_of({0, 0, 0, 0, 0, 0}), warm({21.0}));
        const Deviation& part = location ? d[j].location : d[j].motion;
        EXPECT_NEAR(part[name.component()], value, 1e-16) << to_string(name);
        EXPECT_NEAR(sum_of_magnitudes(d), value, 1e-16) << to_string(name);
        ++seen;
      }
  std::cout << seen << " elements of the gantry\n";
  EXPECT_GE(seen, 46);
}

TEST(ThermalElements, LeavingATableIsToldByElementAndNode) {
  ThermalErrors errors;
  errors.elements = {
      drift("EZS", {0.0, {{1, std::nullopt, 0.0, make_table(warm({0, 20}), warm({0, 10.0_um}))}}})};
  const ThermalModel model = bind(errors, gantry(), 2);
  const std::string said = thrown_text<std::out_of_range>([&] {
    deviations(model, q_of({0, 0, 0, 0, 0, 0}), warm({20.0, 41.0}));
  });
  EXPECT_EQ(said, "EZS, dT_K of node 1: position 21 is outside the table (0 to 20)");
  errors.elements[0].offset.terms[0].table->outside = TableExtrapolation::Hold;
  const auto d =
      deviations(bind(errors, gantry(), 2), q_of({0, 0, 0, 0, 0, 0}), warm({20.0, 41.0}));
  EXPECT_EQ(d[5].motion[2], 10.0_um);
}

// ---- workpiece

TEST(ThermalElements, TheWorkpieceIsJudgedAt20C) {
  ThermalErrors errors;
  errors.workpiece = WorkpieceExpansion{0, 23.8e-6, {10, 0, -5}};
  errors.reference_T_C = 25.0;  // has no say here
  const ThermalModel model = bind(errors, gantry(), 1);
  const Vector3d p(110, 40, 15);
  const Vector3d cold = position_at_20_C(model, warm({30.0}), p);
  const Vector3d expected = Vector3d(10, 0, -5) + Vector3d(100, 40, 20) / 1.000238;
  EXPECT_NEAR((cold - expected).norm(), 0.0, 1e-13);
  EXPECT_EQ(position_at_20_C(model, warm({20.0}), p), p) << "to the last bit";
  EXPECT_EQ(position_at_20_C(model, warm({35.0}), errors.workpiece->fixed_w),
            errors.workpiece->fixed_w);
  EXPECT_EQ(position_at_20_C(bind({}, gantry(), 1), warm({35.0}), p), p) << "none given";
}

TEST(ThermalElements, AMachineAndAWorkpieceThatGrowAlikeCutATrueLength) {
  // 300 mm apart as commanded; scale and work of steel at one temperature: 300 mm again at 20 C
  ThermalErrors errors;
  errors.expansions = {{'X', Feedback::Scale, std::nullopt, Expansion{0, steel, 0.0}}};
  errors.workpiece = WorkpieceExpansion{0, steel, Vector3d::Zero()};
  const Chain chain = gantry();
  const ThermalModel model = bind(errors, chain, 1);
  const VectorXd T_C = warm({27.0});
  const auto cut_at = [&](double x) {
    const AxisVector q = q_of({0, x, 0, 0, 0, 0});
    return position_at_20_C(model, T_C,
                            chain.tool_in_workpiece(q, deviations(model, q, T_C)).translation());
  };
  EXPECT_NEAR((cut_at(200) - cut_at(-100)).x(), 300.0, 1e-12);
}

// ---- scale and refusal

TEST(ThermalElements, ScalingScalesEveryValue) {
  SeededRandom random(12);
  std::uniform_real_distribution<double> unit(-1, 1);
  ThermalErrors errors;
  errors.elements = {
      drift("EZS", {unit(random) * 1e-3,
                    {{0, 1, unit(random) * 1e-3, std::nullopt},
                     {1, std::nullopt, 0.0,
                      make_table(warm({-30, 0, 10, 30}), warm({-1e-3, 0, 3e-3, 4e-3}),
                                 TableInterpolation::Spline)}}}),
      {parse_element_name("EXX"), {}, {1e-6, {{1, std::nullopt, 2e-6, std::nullopt}}}, 33.0}};
  errors.expansions = {screw('Y', -20)};
  errors.workpiece = WorkpieceExpansion{0, steel, Vector3d::Zero()};
  const ThermalModel model = bind(errors, gantry(), 2);
  const ThermalModel twice = scaled(model, 2.0);
  for (int i = 0; i < 200; ++i) {
    const AxisVector q = q_of({0, 300 * unit(random), 300 * unit(random), 0, 0, 0});
    const VectorXd T_C = warm({20 + 15 * unit(random), 20 + 15 * unit(random)});
    const auto one = deviations(model, q, T_C);
    const auto two = deviations(twice, q, T_C);
    for (std::size_t j = 0; j < one.size(); ++j) {
      EXPECT_LT((2 * one[j].motion - two[j].motion).norm(), 1e-15);
      EXPECT_EQ(sum_of_magnitudes(deviations(scaled(model, 0.0), q, T_C)), 0.0);
    }
  }
  EXPECT_EQ(twice.workpiece->per_K, 2 * steel);
}

std::string refusal_of_thermal(const ThermalErrors& errors, const Chain& chain = gantry(),
                               int nodes = 2) {
  return thrown_text<std::invalid_argument>([&] { bind(errors, chain, nodes); });
}

std::string refusal_of_thermal(const ThermalElement& element, const Chain& chain = gantry()) {
  ThermalErrors errors;
  errors.elements = {element};
  return refusal_of_thermal(errors, chain);
}

TEST(ThermalElements, AnElementThatCannotBeIsRefusedByName) {
  const auto any = per_K(0, 1e-6);
  EXPECT_EQ(refusal_of_thermal(drift("EZS", any)), "");
  EXPECT_EQ(refusal_of_thermal(drift("EXB", any)),
            "EXB: expected an axis of the machine (C X Y Z A s), seen B");
  EXPECT_EQ(refusal_of_thermal(drift("ECS", any)),
            "ECS: a spindle has no error element about its own axis");
  EXPECT_HAS(refusal_of_thermal(drift("EA0X", any)),
             "EA0X: an axis has no squareness about itself");
  EXPECT_HAS(refusal_of_thermal(drift("EX0X", any)),
             "EX0X: a slide has a direction but no position");
  for (const char* name : {"EC0Y", "EZS", "EY0A"})
    EXPECT_EQ(
        refusal_of_thermal({parse_element_name(name), {}, any, 0.0}),
        std::string(name) + ": a location or spindle element cannot have a slope along an axis");
  EXPECT_EQ(refusal_of_thermal({parse_element_name("EXS"), {}, any, 0.0}, platform()),
            "EXS: a location or spindle element cannot have a slope along an axis");
  EXPECT_EQ(refusal_of_thermal(drift("EZS", per_K(2, 1e-6))),
            "EZS: expected a node from 0 to 1, seen 2");
  EXPECT_EQ(refusal_of_thermal(drift("EZS", {0.0, {{0, -1, 1e-6, std::nullopt}}})),
            "EZS: expected a node from 0 to 1, seen -1");
  EXPECT_EQ(refusal_of_thermal(drift("EZS", per_K(0, std::nan("")))),
            "EZS: expected a finite value per K, seen nan");
  Table falling{warm({0, 10, 5}),
                warm({0, 0, 0}),
                TableInterpolation::Linear,
                TableExtrapolation::Refuse,
                {}};
  EXPECT_HAS(refusal_of_thermal(drift("EZS", {0.0, {{0, std::nullopt, 0.0, falling}}})),
             "EZS: row 3");
  ThermalErrors twice;
  twice.elements = {drift("EZS", any), drift("EZS", any)};
  EXPECT_EQ(refusal_of_thermal(twice), "EZS: given twice");
}

TEST(ThermalElements, AnExpansionThatCannotBeIsRefusedByName) {
  const auto one = [](AxisExpansion axis) {
    ThermalErrors errors;
    errors.expansions = {axis};
    return refusal_of_thermal(errors);
  };
  const Expansion growth{0, steel, 0.0};
  EXPECT_EQ(one(screw('X')), "");
  EXPECT_EQ(one(screw('A')), "expansion of A: expected a slide");
  EXPECT_EQ(one(screw('W')),
            "expansion of W: expected an axis of the machine (C X Y Z A s), seen W");
  EXPECT_EQ(one({'X', Feedback::Motor, std::nullopt, growth}),
            "expansion of X: feedback from the motor requires a screw");
  EXPECT_EQ(one({'X', Feedback::Scale, growth, std::nullopt}),
            "expansion of X: feedback from a scale requires a scale");
  EXPECT_EQ(one({'X', Feedback::Scale, Expansion{9, steel, 0.0}, growth}),
            "expansion of X, screw: expected a node from 0 to 1, seen 9")
      << "what does not show must still make sense";
  EXPECT_EQ(one({'X', Feedback::Motor, Expansion{0, INFINITY, 0.0}, std::nullopt}),
            "expansion of X, screw: expected a finite growth per K, seen inf");
  ThermalErrors errors;
  errors.expansions = {screw('X'), screw('X')};
  EXPECT_EQ(refusal_of_thermal(errors), "expansion of X: given twice");
}

TEST(ThermalElements, AWorkpieceThatCannotBeIsRefused) {
  const auto one = [](WorkpieceExpansion workpiece) {
    ThermalErrors errors;
    errors.workpiece = workpiece;
    return refusal_of_thermal(errors);
  };
  EXPECT_EQ(one({0, steel, Vector3d::Zero()}), "");
  EXPECT_EQ(one({2, steel, Vector3d::Zero()}), "workpiece: expected a node from 0 to 1, seen 2");
  EXPECT_EQ(one({0, -0.05, Vector3d::Zero()}),
            "workpiece: expected a growth below 1e-3 per K, seen -0.05");
  EXPECT_EQ(one({0, steel, Vector3d(0, INFINITY, 0)}), "workpiece: expected a finite fixed point");
}

}  // namespace
}  // namespace abbe::errors
