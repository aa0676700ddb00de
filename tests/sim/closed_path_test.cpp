// Closed paths through files: what `evaluate` says of circles, rings and rotary tests does not
// depend on whether the first place is read again at the end.

#include <cmath>
#include <iostream>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "errors/metrology/machine_tests.h"
#include "errors/metrology/test_results.h"
#include "kinematics/units.h"
#include "sim/commands/calibration_commands.h"
#include "sim/report/evaluation_report.h"
#include "tests/sim/measured_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;
using Json = nlohmann::ordered_json;
using errors::metrology::Readings;
using errors::metrology::TestResult;

/// A gantry whose X scale is 50 um/m long.
const char* long_scale =
    "[errors.EXX]\nkind = \"polynomial\"\ncoefficients_um = [0, 50]\nhalf_range_mm = 1000\n";

Readings read_to_targets(const std::string& errors, const std::string& kind, int targets) {
  const Scene scene = scene_of(measured_scene(errors));
  InstrumentDescription instrument = faultless(scene, kind);
  instrument.instrument.targets = targets;
  return measure_machine(scene, instrument);
}

/// The readings with the first place of every pass read again where the pass ends.
Readings read_again(const Readings& once) {
  Readings again = once;
  again.plan.measurements.clear();
  std::vector<double> values;
  const auto& measurements = once.plan.measurements;
  int last = 0;
  for (const auto& measurement : measurements) last = std::max(last, measurement.target);
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    const auto add = [&](std::size_t at, int target) {
      again.plan.measurements.push_back(measurements[at]);
      again.plan.measurements.back().target = target;
      values.push_back(once.value[Eigen::Index(at)]);
    };
    const bool backwards = i > 0 && measurements[i].target == last &&
                           measurements[i - 1].target == last &&
                           measurements[i].set_up == measurements[i - 1].set_up;
    const auto first = [&](int target) {  // look at that target in this pass's set-up
      for (std::size_t k = 0; k < measurements.size(); ++k)
        if (measurements[k].set_up == measurements[i].set_up && measurements[k].target == target)
          return k;
      return i;
    };
    if (backwards) add(first(0), last + 1);
    add(i, measurements[i].target);
    const bool forwards_ends = measurements[i].target == last && !backwards;
    if (forwards_ends) add(first(0), last + 1);
  }
  again.value = Eigen::VectorXd::Map(values.data(), Eigen::Index(values.size()));
  again.T_C.resize(again.value.size(), 0);
  return again;
}

Evaluation evaluated(const Readings& readings) {
  const SceneFolder folder;
  return evaluate(folder.write("readings.csv", to_text(readings))).evaluation;
}

TEST(ClosedPath, ABallBarOfAnyNumberOfTargetsTellsCentreRadiusAndForm) {
  for (const int n : {3, 4, 5, 7, 12, 37, 72, 200}) {
    double low = 1.0, high = 0.0;
    for (int i = 0; i < n; ++i) {
      const double c = std::cos(2.0 * pi * i / n);
      low = std::min(low, c * c);
      high = std::max(high, c * c);
    }
    const Readings once = read_to_targets(long_scale, "ball_bar", n);
    for (const Readings& readings : {once, read_again(once)}) {
      const Evaluation evaluation = evaluated(readings);
      const Json e = to_json(evaluation);
      ASSERT_EQ(e["tests"].size(), 3u) << n;
      const Json& test = e["tests"][0];
      ASSERT_EQ(test["standard"], "ISO 230-4:2005 circular test") << n;
      EXPECT_EQ(test["places"], 2 * n);
      const double G = n == 3 ? 0.0 : 5.0 * (high - low);
      if (n == 72) std::cout << "72 targets: G " << test["G_both_lsq_um"] << " um\n";
      EXPECT_NEAR(test["G_both_lsq_um"].get<double>(), G, 2e-3) << n;
      EXPECT_NEAR(test["radius_mm"].get<double>(), 100.0025, n == 3 ? 2e-3 : 1e-6) << n;
      EXPECT_NEAR(test["centre_X_um"].get<double>(), n == 3 ? 2.5 : 0.0, 2e-3) << n;
      EXPECT_NEAR(test["centre_Y_um"].get<double>(), 0.0, 2e-3) << n;
      EXPECT_NEAR(test["H_um"].get<double>(), 0.0, 1e-6) << n;
      EXPECT_EQ(test["F_from"], "least-squares centre") << n;
      const bool few = n <= 4;
      EXPECT_EQ(test["causes"]["scale_X_minus_Y_um_per_m"].is_null(), few) << n;
      const std::string said = fmt::format(
          "radius, centre_X, centre_Y, scale_X_minus_Y, squareness, reversal_X, reversal_Y, lag "
          "cannot be determined: 8 causes require readings at 9 or more different positions, "
          "counted separately per sense of rotation, seen {}\n",
          2 * n);
      EXPECT_EQ(to_text(evaluation).find(said) != std::string::npos, few) << n;
    }
  }
}

TEST(ClosedPath, CausesThatReadAlikeAreNamedWithTheirAxes) {
  const Scene scene = scene_of(measured_scene(long_scale));
  InstrumentDescription bar = faultless(scene, "ball_bar");
  bar.instrument.bidirectional = false;
  const Json causes = to_json(evaluated(measure_machine(scene, bar)))["tests"][0]["causes"];
  EXPECT_EQ(causes["undetermined"], Json({"squareness", "lag"}));
  EXPECT_EQ(causes["undetermined_because"],
            "squareness, lag cannot be determined: their effects are indistinguishable at the 72 "
            "measured positions, in one sense of rotation only");
}

TEST(ClosedPath, AnArcTakesFFromTheCentreAsSetUp) {
  const Scene scene = scene_of(measured_scene(long_scale));
  InstrumentDescription bar = faultless(scene, "ball_bar");
  bar.instrument.to_rad = 220.0 * units::deg;
  const Json e = to_json(evaluated(measure_machine(scene, bar)));
  const Json& test = e["tests"][0];
  EXPECT_NE(test["F_from"].get<std::string>().find("as set up"), std::string::npos);
  EXPECT_NEAR(test["F_max_both_um"].get<double>(), 5.0, 1e-3);
  EXPECT_NEAR(test["F_min_both_um"].get<double>(), 0.0, 5e-3);
}

// X of the ball while C turns, centre of the table 10 um off: sums of squares over places.
TEST(ClosedPath, AnRTestHasTheSameRmsWithItsFirstPlaceReadAgain) {
  for (const int n : {3, 4, 8, 36, 199}) {
    const Readings once = read_to_targets(
        "[errors]\nEX0C_um = 10\n[errors.EZC]\nkind = \"fourier\"\nperiod_deg = 360\n"
        "a_um = [3]\nb_um = [0]\n",
        "r_test", n);
    const errors::metrology::MachineTests a = classify_readings(once),
                                          b = classify_readings(read_again(once));
    ASSERT_EQ(a.others.size(), b.others.size());
    ASSERT_FALSE(a.others.empty());
    for (std::size_t k = 0; k < a.others.size(); ++k) {
      const auto square = [](const errors::metrology::OtherTest& t) {
        return t.weights.dot(t.deviation.cwiseAbs2());
      };
      const double scale = std::max(square(a.others[k]), 1e-12);
      EXPECT_NEAR(square(b.others[k]) / scale, square(a.others[k]) / scale, 1e-6)
          << a.others[k].name << ", " << n;
    }
  }
}

/// A ring of n points on a cylinder that is out of round by order 2, the first touched again or
/// not.
PartReadingsFile touched_ring(int n, bool again, double radius, double centre_um) {
  PartReadingsFile part{"cmm", "cmm", "a ring", {}};
  auto& r = part.readings;
  const int m = n + (again ? 1 : 0);
  r.points_w.resize(m, 3);
  r.normals_w.resize(m, 3);
  r.deviation.resize(m);
  r.time_s = Eigen::VectorXd::LinSpaced(m, 0, m);
  for (int i = 0; i < m; ++i) {
    const double a = 2.0 * pi * (i % n) / n;
    r.normals_w.row(i) << std::cos(a), 0, std::sin(a);
    r.points_w.row(i) << 30 + radius * std::cos(a), -7, 5 + radius * std::sin(a);
    r.deviation[i] = 2.0_um * std::cos(2.0 * a) + centre_um * units::um * std::cos(a) + 1.0_um;
  }
  return part;
}

/// The value of a figure of a test.
template <typename Value>
Value value_of(const TestResult& test, const std::string& figure) {
  for (const auto& one : test.figures)
    if (one.name == figure) return std::get<Value>(one.value);
  throw std::out_of_range(figure);
}

TEST(ClosedPath, ARingOfAPartHasACircularityACentreAndARadius) {
  for (int n = 4; n <= 200; ++n) {
    double low = 1.0, high = -1.0, square = 0.0;
    for (int i = 0; i < n; ++i) {
      const double c = std::cos(4.0 * pi * i / n);
      low = std::min(low, c);
      high = std::max(high, c);
      square += c * c / n;
    }
    for (const bool again : {false, true}) {
      const auto tests = standard_results(touched_ring(n, again, 20.0, 3.0).readings);
      ASSERT_EQ(tests.size(), 2u) << n;
      const TestResult& test = tests[0];
      ASSERT_EQ(test.name, "circularity");
      const double second = 1e-3;  // um: 5 um squared on 20 mm
      EXPECT_NEAR(value_of<double>(test, "circularity_lsq"), 2.0 * (high - low), 2 * second) << n;
      EXPECT_NEAR(value_of<double>(test, "radius"), 20.001, 1e-6) << n;
      const auto centre = value_of<Eigen::Vector3d>(test, "centre");
      EXPECT_NEAR(centre.x(), 30.003, 1e-6) << n;
      EXPECT_NEAR(centre.y(), -7.0, 1e-12) << n;
      EXPECT_NEAR(centre.z(), 5.0, 1e-6) << n;
      EXPECT_NEAR(value_of<double>(tests[1], "mean"), 1.0, 1e-9) << n;
      EXPECT_NEAR(value_of<double>(tests[1], "Sq"), std::sqrt(4.0 * square + 4.5), 1e-9) << n;
    }
  }
  EXPECT_EQ(standard_results(touched_ring(3, true, 20.0, 0.0).readings)[0].name, "circularity");
}

}  // namespace
}  // namespace abbe::sim
