// Evaluation by the standards, through files: what was injected comes out as the standards name it.

#include <cmath>
#include <iostream>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/commands/calibration_commands.h"
#include "sim/readings/readings_file.h"
#include "sim/report/evaluation_report.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/measured_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;
using Json = nlohmann::ordered_json;

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
  r.time_s = Eigen::VectorXd::LinSpaced(n * n, 0, 100);
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
    EXPECT_TRUE(std::filesystem::exists(folder.path() / kind / "evaluation.json"));
    for (const Json& picture : e["pictures"])
      EXPECT_GT(std::filesystem::file_size(picture.get<std::string>()), 1000u);
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
    try {
      evaluate(folder.write("bad.csv", text), {folder.path() / "out"});
      return std::string();
    } catch (const BadInput& fault) {
      return std::string(fault.what());
    } catch (const BadScene& fault) {
      return std::string(fault.what());
    }
  };
  const std::string head = "target_mm,direction,run,deviation_um\n";
  for (const std::string& text :
       {std::string(), std::string("\n\n"), head, head + "0,up,1,abc\n", head + "0,up,1,nan\n",
        head + "0,up,1,1\n", head + "0,up,1,1\n10,up,2,1\n", head + "0,sideways,1,1\n",
        std::string("\0\0\0", 3), std::string("# abbe_readings = 1\n"),
        std::string("# abbe_part_readings = 1\n"), std::string("HEADER::\r\n")})
    EXPECT_NE(refusal(text).find("bad.csv"), std::string::npos) << "of: " << text;
  EXPECT_NE(refusal(head + "0,up,1,abc\n").find("bad.csv:2:8"), std::string::npos)
      << refusal(head + "0,up,1,abc\n");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "out"));
  EXPECT_THROW(evaluate(folder.path() / "absent.csv"), BadInput);
  EXPECT_THROW(evaluate(folder.path()), BadInput);
}

}  // namespace
}  // namespace abbe::sim
