// Heat in a whole scene: its scale, networks that no machine can be, the element of Yang 2012 and
// the pictures of elements.

#include <filesystem>
#include <iostream>
#include <string>

#include <gtest/gtest.h>

#include "kinematics/units.h"
#include "sim/report/picture_files.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"

namespace abbe::sim {
namespace {

using namespace abbe::literals;
using kinematics::AxisState;

const std::string heat_and_part = R"(
[thermal]
[[thermal.node]]
name = "box"
capacity_J_per_K = 20000
start_C = 29
[[thermal.node]]
name = "screw"
capacity_J_per_K = 6000
start_C = 24
[[thermal.link]]
between = ["box", "screw"]
conductance_W_per_K = 2
[[thermal.link]]
between = ["box", "room"]
conductance_W_per_K = 10
[[thermal.element]]
name = "EZS"
offset_um = 1
offset = [{ node = "box", um_per_K = -1.6 }]
[[thermal.element]]
name = "EBY"
offset = [{ node = "box", minus = "screw", urad_per_K = 4 }]
[thermal.axis.X]
feedback = "motor"
screw = { node = "screw", um_per_m_K = 11.7, fixed_mm = -300 }
[thermal.workpiece]
node = "screw"
um_per_m_K = 23.1
)";

Job flat_job(const std::string& more, const std::vector<Override>& changes = {}) {
  return job_of({.part = "surface = \"rectangle\"\nlength_x_mm = 20\nlength_y_mm = 6\n"
                         "at_mm = [40, 25, 80]\nvertices = 2000",
                 .more = more},
                changes);
}

Eigen::Vector3d drift(const Job& job, const AxisState& state) {
  return tool_in_workpiece(job.truth, state).translation() -
         job.machine.nominal.tool_in_workpiece(state.q).translation();
}

AxisState at(const Job& job, double x, double y, double z, double time_s) {
  AxisState state;
  state.q = kinematics::AxisVector::Zero(job.machine.nominal.size());
  state.q[job.machine.nominal.find('X').value()] = x;
  state.q[job.machine.nominal.find('Y').value()] = y;
  state.q[job.machine.nominal.find('Z').value()] = z;
  state.time_s = time_s;
  return state;
}

TEST(Heat, HalfTheScaleHalvesTheDrift) {
  const Job whole = flat_job(heat_and_part),
            half = flat_job(heat_and_part, {{"thermal.scale", "0.5"}});
  double most = 0.0, left = 0.0;
  for (const double x : {-200.0, 0.0, 150.0})
    for (const double time_s : {0.0, 10.0, 500.0}) {
      const AxisState state = at(whole, x, 30, 100, time_s);
      const Eigen::Vector3d d = drift(whole, state);
      most = std::max(most, d.norm());
      left = std::max(left, (drift(half, state) - 0.5 * d).norm());
    }
  std::cout << "drift up to " << most / units::um << " um; half of it to " << left / units::nm
            << " nm\n";
  EXPECT_GT(most, 20.0_um);
  EXPECT_LT(left, 1.0_nm);  // growth 1 / (1 + e) and tilt: second order
}

TEST(Heat, AScaleOfOneCostsNoBitAndZeroLeavesNone) {
  const Job plain = flat_job(heat_and_part),
            one = flat_job(heat_and_part, {{"thermal.scale", "1"}});
  const Job none = flat_job(heat_and_part, {{"thermal.scale", "0"}}), cold = flat_job("");
  const AxisState state = at(plain, 120, -40, 60, 77);
  EXPECT_EQ(drift(plain, state), drift(one, state));
  EXPECT_EQ(drift(none, state), drift(cold, state));
  EXPECT_NE(drift(plain, state), drift(cold, state));
}

TEST(Heat, ANetworkHotterThanCanBeIsRefusedWithNodeTemperatureAndTime) {
  const std::string hot = heat_and_part +
                          "[[thermal.source]]\nnode = \"box\"\nkind = \"power_on\"\n"
                          "power_W = 1e6\n[[thermal.history]]\nduration_h = 1\n";
  try {
    flat_job(hot);
    FAIL() << "a machine of 1e5 C";
  } catch (const BadInput& fault) {
    const std::string text = fault.what();
    std::cout << text << "\n";
    EXPECT_NE(text.find("ball.toml: expected"), std::string::npos) << text;
    EXPECT_NE(text.find("thermal.node.box at "), std::string::npos) << text;
    EXPECT_NE(text.find(" C at 0 s"), std::string::npos) << text;
  }
  EXPECT_NO_THROW(flat_job(hot, {{"thermal.source.power_W", "1e4"}}));  // 850 K warmer
}

TEST(Heat, ALaserOnTheToolReadsTheElementOfYang) {
  const Job job = job_of("yang_axis.toml", {{"part.vertices", "500"}, {"program.step_mm", "10"}});
  const auto cold_um = [](double x) {  // x in cm, as printed
    return 1.1192e-6 * x * x * x * x + 8.9455e-5 * x * x * x + 9.0575e-4 * x * x - 6.2218e-3 * x +
           0.29717;
  };
  const double before_s = -5 * 3600.0, warm_s = -3600.0;
  const Eigen::VectorXd T_C = errors::temperatures(job.truth.heat->run, warm_s);
  for (const double x : {-400.0, -130.0, 0.0, 250.0, 400.0}) {
    const double cm = x / 10.0;
    const double cold = drift(job, at(job, x, 0, 0, before_s)).x() / units::um;
    EXPECT_NEAR(cold, cold_um(cm) - 0.027523 * cm, 1e-5) << x;
    const double warm = drift(job, at(job, x, 0, 0, warm_s)).x() / units::um;
    const double slope = -0.027523 - 0.0049600 * (T_C[0] - 20) + 0.033601 * (T_C[1] - 20);
    EXPECT_NEAR(warm, cold_um(cm) + slope * cm, 1e-5) << x;
    std::cout << "X " << x << " mm: " << cold << " um cold, " << warm << " um after 3 h ("
              << T_C.transpose() << " C)\n";
  }
  EXPECT_NEAR(drift(job, at(job, 0, 0, 0, before_s)).x(), 0.29717_um, 1e-9);
}

#if ABBE_RENDER

TEST(Pictures, OfElementsOfAnEarlierRunAreRemoved) {
  const Job job = flat_job(heat_and_part +
                           "[[thermal.plot]]\nelement = \"EXX\"\nat_s = [0, 100]\n"
                           "range_mm = [-100, 100]\n");
  const SceneFolder folder;
  const auto there = [&](const char* name) {
    return std::filesystem::exists(folder.path() / name);
  };
  const ResultFolder results(folder.path(), {});
  folder.write("notes.png", "kept");
  folder.write("EZZ-temperatures.png", "somebody's own");
  write_file(results / "EYY-temperatures.png", "old");
  Verdict verdict;
  verdict.cut.case_name = "uncompensated";
  write_source_pictures(results, job, verdict);
  EXPECT_TRUE(there("EXX-temperatures.png"));
  EXPECT_FALSE(there("EYY-temperatures.png"));
  EXPECT_TRUE(there("temperatures.png"));
  verdict.cut.case_name = "error_free";
  write_source_pictures(results, job, verdict);
  EXPECT_FALSE(there("EXX-temperatures.png"));
  EXPECT_FALSE(there("temperatures.png"));
  EXPECT_TRUE(there("notes.png"));
  EXPECT_TRUE(there("EZZ-temperatures.png")) << "abbe did not make it";
}

TEST(Pictures, OfABlankThatWasCutAwayThereIsNone) {
  const Job job = flat_job(heat_and_part);
  const SceneFolder folder;
  const ResultFolder results(folder.path(), {});
  write_file(results / "stock.png", "old");
  Verdict verdict;
  verdict.cut.case_name = "error_free";
  verdict.cut.process.stock = cutting::Stock{};
  write_source_pictures(results, job, verdict);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "stock.png"));
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "stock.vtp"));
}

#endif

}  // namespace
}  // namespace abbe::sim
