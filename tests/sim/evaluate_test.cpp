// Evaluation by the standards, through files: what was injected comes out as the standards name it.

#include "errors/metrology/machine_tests.h"
#include "errors/metrology/test_results.h"
#include "sim/commands/calibration_commands.h"
#include "sim/readings/readings_file.h"
#include "sim/report/evaluation_report.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/measured_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using Json = nlohmann::ordered_json;
using errors::metrology::Readings;
using errors::metrology::TestResult;

Evaluation evaluation(const std::string& text) {
  const SceneFolder folder;
  return evaluate(folder.write("readings.csv", text)).evaluation;
}

Json evaluated(const std::string& text) { return to_json(evaluation(text)); }

/// Evaluation of what a faultless instrument reads on a gantry with the errors given.
Json evaluated(const std::string& errors, const std::string& kind) {
  const Scene scene = scene_of(measured_scene(errors));
  return evaluated(to_text(measure_machine(scene, faultless(scene, kind))));
}

const Json& test_named(const Json& evaluation, const std::string& name) {
  for (const Json& test : evaluation["tests"])
    if (test["name"] == name) return test;
  ADD_FAILURE() << "no test " << name << " in " << evaluation["tests"].dump(1);
  static const Json none;
  return none;
}

TEST(Evaluate, PositionReadingsComeOutAsOnASheetOfPaper) {
  // means 2 and 0 up, -1 and 1 down; s = 1 and 0 up, 0 and 2 down (um)
  const Json e = evaluated(
      "target_mm,direction,run,deviation_um\n"
      "0,up,1,1\n100,up,1,0\n100,down,1,-1\n0,down,1,-1\n"
      "0,up,2,2\n100,up,2,0\n100,down,2,1\n0,down,2,-1\n"
      "0,up,3,3\n100,up,3,0\n100,down,3,3\n0,down,3,-1\n");
  ASSERT_EQ(e["tests"].size(), 1u);
  const Json& test = e["tests"][0];
  EXPECT_EQ(test["standard"], "ISO 230-2:2014 positioning");
  EXPECT_EQ(test["targets"], 2);
  EXPECT_EQ(test["runs_up"], 3);
  const std::pair<const char*, double> by_hand[] = {
      {"A_um", 8},    {"A_up_um", 4},   {"A_down_um", 8}, {"E_um", 3},
      {"E_up_um", 2}, {"E_down_um", 2}, {"M_um", 0},      {"R_um", 8},
      {"R_up_um", 4}, {"R_down_um", 8}, {"B_um", 3},      {"B_mean_um", 1}};
  for (const auto& [key, value] : by_hand) {
    ASSERT_TRUE(test.contains(key)) << key;
    EXPECT_NEAR(test[key].get<double>(), value, 1e-12) << key;
  }
}

TEST(Evaluate, OneWayReadingsLeaveOutWhatNeedsTwoWays) {
  const Evaluation one_way = evaluation(
      "target_mm,direction,run,deviation_um\n0,up,1,0\n10,up,1,2\n0,up,2,0\n10,up,2,4\n");
  const Json e = to_json(one_way);
  const Json& test = e["tests"][0];
  EXPECT_NEAR(test["E_up_um"].get<double>(), 3.0, 1e-12);
  EXPECT_TRUE(test["B_um"].is_null());
  EXPECT_TRUE(test["A_um"].is_null());
  EXPECT_FALSE(test.contains("E_down_um"));
  EXPECT_NO_THROW(to_text(one_way));
}

TEST(Evaluate, TheLaserTellsScaleAndBacklash) {
  const Json e = evaluated(
      "[[errors.EXX]]\nname = \"scale\"\nkind = \"legendre\"\ncoefficients_um = [0, 6]\n"
      "half_range_mm = 300\n[[errors.EXX]]\nname = \"play\"\nkind = \"backlash\"\nhalf_um = 2\n",
      "laser");
  const Json& x = test_named(e, "X positioning");
  const double E_up = x["E_up_um"], B = x["B_um"];
  std::cout << "E up " << E_up << " um, B " << B << " um\n";
  EXPECT_NEAR(E_up, 2 * 6 * 0.96, 1e-6);  // 2 % of the travel is left free at both ends
  EXPECT_NEAR(std::abs(B), 4.0, 1e-6);
  EXPECT_NEAR(test_named(e, "Y positioning")["E_um"].get<double>(), 0.0, 1e-9);
}

TEST(Evaluate, ABallBarTellsTheSquarenessThatWasInjected) {
  for (const double S : {0.0, 40.0, -75.0}) {
    const Json e = evaluated(fmt::format("[errors]\nEC0Y_urad = {}\n", S), "ball_bar");
    bool xy = false;
    for (const Json& test : e["tests"]) {
      ASSERT_EQ(test["standard"], "ISO 230-4:2005 circular test");
      const Json& found = test["causes"]["squareness_urad"];
      if (found.is_null()) continue;
      const double expected = test["plane"] == "XY" ? S : 0.0;
      xy = xy || test["plane"] == "XY";
      EXPECT_NEAR(found["value"].get<double>(), expected, 0.02) << test["name"];
      if (test["plane"] == "XY")
        std::cout << "injected " << S << ", found " << found["value"] << " urad; G "
                  << test["G_both_lsq_um"] << " um\n";
      // an ellipse of axes R +- S R / 2
      if (test["plane"] == "XY") {
        EXPECT_NEAR(test["G_both_lsq_um"].get<double>(), std::abs(S) * 1e-3 * 100, 0.01);
      }
    }
    EXPECT_TRUE(xy);
  }
}

TEST(Evaluate, ASquareTellsEverySquarenessWithItsSign) {
  const Json e = evaluated("[errors]\nEC0Y_urad = 32\nEB0Z_urad = -26\nEA0Z_urad = 21\n", "square");
  // The angle between the axes minus 90 degrees. C turns Y away from X and A turns Z away from Y,
  // but B turns Z towards X.
  const std::pair<const char*, double> expected[] = {
      {"XY square", 32}, {"XZ square", 26}, {"YZ square", 21}};
  for (const auto& [name, value] : expected) {
    bool found = false;
    for (const Json& test : e["tests"]) {
      if (test["name"] != name || !test.contains("squareness_urad")) continue;
      found = true;
      const double seen = test["squareness_urad"];
      std::cout << name << ": " << seen << " urad, by hand " << value << "\n";
      EXPECT_NEAR(seen, value, 1e-3) << name;
    }
    EXPECT_TRUE(found) << name;
  }
}

TEST(Evaluate, DiagonalsOfASquarenessDifferAsGeometryHasIt) {
  const Json e = evaluated("[errors]\nEC0Y_urad = 50\n", "diagonals");
  const Json& face = test_named(e, "face diagonals");
  double most = -1e9, least = 1e9;
  for (const Json& one : face["diagonals"]) {
    if (one["name"].get<std::string>().find("Z") != std::string::npos) continue;
    // E of one diagonal: its change of length from end to end, S x y / sqrt(x^2 + y^2)
    most = std::max(most, one["E_um"].get<double>());
    least = std::min(least, one["E_um"].get<double>());
  }
  const double x = 0.96 * 600, y = 0.96 * 700, change = 50e-3 * x * y / std::hypot(x, y);
  std::cout << "face diagonals change by " << least << " and " << most << " um, by hand " << change
            << "\n";
  EXPECT_NEAR(most, change, 1e-3 * change);
  EXPECT_NEAR(least, change, 1e-3 * change);
  EXPECT_TRUE(test_named(e, "body diagonals").contains("E_d_um"));
}

TEST(Evaluate, DriftIsToldOverTheFirstHourAndTheWhole) {
  const Scene scene = read_scene(packaged("thermal_protocol.toml"));
  InstrumentDescription drift = faultless(scene, "drift");
  drift.starts_s = {-8.0 * 3600.0};
  drift.instrument.duration_s = 3.0 * 3600.0;
  const Json e = evaluated(to_text(measure_machine(scene, drift)));
  ASSERT_EQ(e["tests"].size(), 1u);
  const Json& test = e["tests"][0];
  EXPECT_EQ(test["standard"], "ISO 230-3:2020 thermal drift");
  EXPECT_DOUBLE_EQ(test["first_hour"]["hours"].get<double>(), 1.0);
  EXPECT_NEAR(test["whole"]["hours"].get<double>(), 3.0, 0.01);
  int um = 0, urad = 0;
  for (const auto& [name, one] : test["whole"].items()) {
    if (!one.is_object()) continue;
    um += one.contains("range_um");
    urad += one.contains("range_urad");
    const char* key = one.contains("range_um") ? "range_um" : "range_urad";
    EXPECT_GE(one[key].get<double>(), test["first_hour"][name][key].get<double>());
  }
  EXPECT_EQ(um, 3);
  EXPECT_EQ(urad, 2);
  EXPECT_EQ(e["temperatures"].size(), 18u);
}

TEST(Evaluate, APartOfAPlaneHasAFlatness) {
  PartReadingsFile part{"cmm", "cmm", "a plane", {}};
  const int n = 21;
  auto& r = part.readings;
  r.points_w.resize(n * n, 3);
  r.normals_w = Eigen::MatrixX3d::Zero(n * n, 3);
  r.normals_w.col(2).setOnes();
  r.deviation.resize(n * n);
  r.time_s = VectorXd::LinSpaced(n * n, 0, 100);
  for (int i = 0; i < n * n; ++i) {
    const double x = i % n - 10, y = i / n - 10;
    r.points_w.row(i) << x, y, 5;
    r.deviation[i] = (x * y > 0 ? 1 : -1) * (x == 0 || y == 0 ? 0 : 2.0_um) + 1e-6 * x;
  }
  const Json e = evaluated(to_text(part));
  EXPECT_EQ(e["kind"], "cmm");
  const Json& flatness = test_named(e, "flatness");
  std::cout << "flatness, minimum zone " << flatness["flatness_minimum_zone_um"] << " um\n";
  EXPECT_NEAR(flatness["flatness_minimum_zone_um"].get<double>(), 4.0, 1e-6);
  EXPECT_GE(flatness["flatness_lsq_um"].get<double>(),
            flatness["flatness_minimum_zone_um"].get<double>() - 1e-9);
  const Json& heights = test_named(e, "heights");
  EXPECT_NEAR(heights["Sa_um"].get<double>(), 2.0 * 400 / 441, 1e-6);
  EXPECT_NEAR(heights["Sz_um"].get<double>(), 4.0, 1e-6);
}

TEST(Evaluate, WritesWhatItPromises) {
  const SceneFolder folder;
  const Scene scene = read_scene(packaged("gantry_dome.toml"));
  for (const char* kind : {"laser", "ball_bar", "diagonals", "straightness", "r_test", "spindle"}) {
    const auto file = folder.write(std::string(kind) + ".csv",
                                   to_text(measure_machine(scene, find_instrument(scene, kind))));
    const EvaluationOutcome made = evaluate(file, {folder.path() / kind});
    const Json e = to_json(made.evaluation, made.pictures);
    EXPECT_EQ(e["file"], file.string());
    EXPECT_EQ(e["kind"], kind);
    ASSERT_FALSE(e["tests"].empty());
    for (const Json& test : e["tests"]) {
      EXPECT_TRUE(test.contains("name") && test.contains("standard"));
    }
    EXPECT_TRUE(fs::exists(folder.path() / kind / "evaluation.json"));
    for (const Json& picture : e["pictures"])
      EXPECT_GT(fs::file_size(picture.get<std::string>()), 1000u);
#if ABBE_RENDER
    const std::string word = kind;
    if (word != "r_test" && word != "spindle") {
      EXPECT_FALSE(e["pictures"].empty()) << kind;
    }
#endif
    EXPECT_GT(to_text(made.evaluation, made.pictures).size(), 100u);
  }
}

TEST(Evaluate, BrokenFilesAreRefusedByPlace) {
  const SceneFolder folder;
  const auto refusal = [&](const std::string& text) {
    return thrown_text<BadInput, BadScene>(
        [&] { evaluate(folder.write("bad.csv", text), {folder.path() / "out"}); });
  };
  const std::string head = "target_mm,direction,run,deviation_um\n";
  for (const std::string& text :
       {std::string(), std::string("\n\n"), head, head + "0,up,1,abc\n", head + "0,up,1,nan\n",
        head + "0,up,1,1\n", head + "0,up,1,1\n10,up,2,1\n", head + "0,sideways,1,1\n",
        std::string("\0\0\0", 3), std::string("# abbe_readings = 1\n"),
        std::string("# abbe_part_readings = 1\n"), std::string("HEADER::\r\n")})
    EXPECT_HAS(refusal(text), "bad.csv") << "of: " << text;
  EXPECT_HAS(refusal(head + "0,up,1,abc\n"), "bad.csv:2:8");
  EXPECT_FALSE(fs::exists(folder.path() / "out"));
  EXPECT_THROW(evaluate(folder.path() / "absent.csv"), BadInput);
  EXPECT_THROW(evaluate(folder.path()), BadInput);
}

// Closed paths through files: what `evaluate` says of circles, rings and rotary tests does not
// depend on whether the first place is read again at the end.

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
      values.push_back(once.value[Index(at)]);
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
  again.value = VectorXd::Map(values.data(), Index(values.size()));
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
  EXPECT_HAS(test["F_from"].get<std::string>(), "as set up");
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
  r.time_s = VectorXd::LinSpaced(m, 0, m);
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
      const auto centre = value_of<Vector3d>(test, "centre");
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
