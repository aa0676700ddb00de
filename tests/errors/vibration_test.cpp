#include "errors/vibration.h"
#include "tests/errors/machines.h"
#include "tests/test.h"

namespace abbe::errors {
namespace {

Vibration of(const std::string& name, double amplitude, double order = 1.0) {
  Vibration v;
  v.name = parse_element_name(name);
  v.amplitude = amplitude;
  v.order = order;
  return v;
}

std::string refusal_of_vibration(const Vibration& vibration,
                                 const kinematics::Chain& chain = gantry()) {
  return thrown_text<std::invalid_argument>([&] { bind({vibration}, chain); }, "none");
}

TEST(Vibration, HarmonicsOfAnElementAddUpAtTheirPhases) {
  Vibration second = of("EXS", 0.5_um, 4.0);
  second.phase = 90.0_deg;
  const VibrationModel model =
      bind({of("EXS", 2.0_um), second, of("EAZ", 3.0_urad, 2.5)}, gantry());
  ASSERT_EQ(model.joints, 6);
  for (const double angle : {0.0, 0.3, -2.0, 1000.0}) {
    const auto d = deviations(model, 100.0, angle);
    ASSERT_EQ(d.size(), 6u);
    kinematics::Deviation spindle = kinematics::Deviation::Zero(), Z = spindle;
    spindle[0] = 2.0_um * std::cos(angle) - 0.5_um * std::sin(4 * angle);
    Z[3] = 3.0_urad * std::cos(2.5 * angle);
    EXPECT_LT((d[5].motion - spindle).norm(), 1e-15) << angle;
    EXPECT_LT((d[3].motion - Z).norm(), 1e-18) << angle;
    for (std::size_t j = 0; j < 6; ++j) {
      EXPECT_TRUE(d[j].location.isZero(0));
      if (j != 5 && j != 3) {
        EXPECT_TRUE(d[j].motion.isZero(0)) << j;
      }
    }
  }
}

TEST(Vibration, SpindleThatCarriesTheWorkpieceIsTheJointS) {
  const kinematics::Chain chain = platform();
  const auto d = deviations(bind({of("EYS", 1.0_um)}, chain), 10.0, 0.0);
  EXPECT_EQ(d[std::size_t(*chain.find('S'))].motion[1], 1.0_um);
  EXPECT_HAS(refusal_of_vibration(of("EAS", 1.0_urad), chain), "about its own axis");
  EXPECT_EQ(refusal_of_vibration(of("EBS", 1.0_urad), chain), "none");
}

TEST(Vibration, UnbalanceGrowsWithTheSquareOfSpeed) {
  Vibration v = of("EXS", 1.0_um);
  v.reference_speed = 50.0;
  EXPECT_EQ(amplitude(v, 0.0), 1.0_um);  // exponent 0: a fixed amplitude, also at rest
  EXPECT_EQ(amplitude(v, 300.0), 1.0_um);
  v.exponent = 2.0;
  EXPECT_EQ(amplitude(v, 0.0), 0.0);
  EXPECT_NEAR(amplitude(v, 150.0), 9.0_um, 1e-18);
  EXPECT_EQ(amplitude(v, -150.0), amplitude(v, 150.0));
}

TEST(Vibration, ResonanceMagnifiesByHalfOfOneOverTheDamping) {
  Vibration v = of("EXS", -1.0_um, 3.0);
  v.resonance = 600.0;
  for (const double damping : {0.01, 0.05, 0.5}) {
    v.damping = damping;
    EXPECT_NEAR(amplitude(v, 200.0), -1.0_um / (2 * damping), 1e-15) << damping;
    EXPECT_EQ(amplitude(v, 0.0), -1.0_um);
    EXPECT_NEAR(amplitude(v, 2e5), -1.0_um / 999999.0, 1e-12) << damping;  // r = 1000
  }
  v.damping = std::sqrt(0.5);  // flat: 1 / sqrt(1 + r^4)
  EXPECT_NEAR(amplitude(v, 400.0), -1.0_um / std::sqrt(17.0), 1e-15);
}

TEST(Vibration, WhatMeansNothingIsRefusedByName) {
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find("EXS") != std::string::npos && text.find(part) != std::string::npos;
  };
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  const auto with = [](double Vibration::*which, double value) {
    Vibration v = of("EXS", 1.0_um);
    v.*which = value;
    return refusal_of_vibration(v);
  };
  EXPECT_PRED2(has, with(&Vibration::order, 0.0), "order");
  EXPECT_PRED2(has, with(&Vibration::order, nan), "order");
  EXPECT_PRED2(has, with(&Vibration::amplitude, inf), "amplitude");
  EXPECT_PRED2(has, with(&Vibration::reference_speed, 0.0), "reference speed");
  EXPECT_PRED2(has, with(&Vibration::exponent, -1.0), "exponent");
  EXPECT_PRED2(has, with(&Vibration::phase, nan), "phase");
  EXPECT_PRED2(has, with(&Vibration::damping, 0.0), "damping");
  Vibration v = of("EXS", 1.0_um);
  v.resonance = 0.0;
  EXPECT_PRED2(has, refusal_of_vibration(v), "resonance");
  EXPECT_HAS(refusal_of_vibration(of("EXB", 1.0)), "EXB");  // an axis it lacks
  EXPECT_HAS(refusal_of_vibration(of("EC0Y", 1.0)), "location");
  EXPECT_HAS(refusal_of_vibration(of("ECS", 1.0)), "about its own axis");
  const VibrationModel none = errors::bind(std::vector<Vibration>{}, gantry());
  EXPECT_TRUE(none.harmonics.empty());
  EXPECT_EQ(deviations(none, 1.0, 1.0).size(), 6u);
}

}  // namespace
}  // namespace abbe::errors
