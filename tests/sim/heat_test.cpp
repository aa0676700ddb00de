// Heat in a whole scene: its scale, networks that no machine can be, the element of Yang 2012 and
// the pictures of elements.

#include "sim/report/picture_files.h"
#include "tests/sim/refusal.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

/// Heat that drives the spindle by 15 um, a screw by 8 um over the part, and tilts the beam.
const std::string machine_heat = R"(
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
offset = [{ node = "box", um_per_K = -1.6 }]
[[thermal.element]]
name = "EBY"
offset = [{ node = "box", minus = "screw", urad_per_K = 4 }]
[thermal.axis.X]
feedback = "motor"
screw = { node = "screw", um_per_m_K = 11.7, fixed_mm = -300 }
)";

/// The same with a growing part, and a spindle that is 1 um off when it is cold.
const std::string heat_and_part =
    with(machine_heat, "name = \"EZS\"\n", "name = \"EZS\"\noffset_um = 1\n") +
    "[thermal.workpiece]\nnode = \"screw\"\num_per_m_K = 23.1\n";

Job flat_job(const std::string& more, const std::vector<Override>& changes = {}) {
  return job_of({.part = "surface = \"rectangle\"\nlength_x_mm = 20\nlength_y_mm = 6\n"
                         "at_mm = [40, 25, 80]\nvertices = 2000",
                 .more = more},
                changes);
}

Vector3d drift(const Job& job, const AxisState& state) {
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
      const Vector3d d = drift(whole, state);
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
  const std::string text = thrown_text<BadInput>([&] { flat_job(hot); });
  std::cout << text << "\n";
  EXPECT_HAS(text, "ball.toml: expected");
  EXPECT_HAS(text, "thermal.node.box at ");
  EXPECT_HAS(text, " C at 0 s");
  EXPECT_NO_THROW(flat_job(hot, {{"thermal.source.power_W", "1e4"}}));  // 850 K warmer
}

TEST(Heat, ALaserOnTheToolReadsTheElementOfYang) {
  const Job job = job_of("yang_axis.toml", {{"part.vertices", "500"}, {"program.step_mm", "10"}});
  const auto cold_um = [](double x) {  // x in cm, as printed
    return 1.1192e-6 * x * x * x * x + 8.9455e-5 * x * x * x + 9.0575e-4 * x * x - 6.2218e-3 * x +
           0.29717;
  };
  const double before_s = -5 * 3600.0, warm_s = -3600.0;
  const VectorXd T_C = errors::temperatures(job.truth.heat->run, warm_s);
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
  const auto there = [&](const char* name) { return fs::exists(folder.path() / name); };
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
  EXPECT_FALSE(fs::exists(folder.path() / "stock.png"));
  EXPECT_TRUE(fs::exists(folder.path() / "stock.vtp"));
}

#endif

// The three sources of every element, geometric, thermal and force: they add, and one that is off
// costs no bit.

/// Weights that bend the machine by some micrometres, the same however the tool cuts.
const char* const weight = R"(
[compliance]
gravity = [0, 0.3, -1]
[compliance.axis.X]
stiffness_N_per_um = [120, 90, 150]
turning_stiffness_Nm_per_urad = [8, 6, 9]
[compliance.axis.C]
stiffness_N_per_um = [200, 200, 300]
turning_stiffness_Nm_per_urad = [5, 5, 7]
[[compliance.mass]]
axis = "Z"
mass_kg = 110
centre_mm = [0, -60, 260]
[[compliance.mass]]
axis = "C"
mass_kg = 90
centre_mm = [25, 10, -20]
)";

const std::string geometric = "[errors]\n" + [] {
  std::string text;
  std::mt19937 random(20261121);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (const char* name : {"EXX", "EYX", "EZX", "EXY", "EYY", "EZY", "EXZ", "EYZ", "EZZ", "EXA",
                           "EYA", "EZA", "EXC", "EYC", "EZC"})
    text += fmt::format("{}_um = {:.4f}\n", name, 5 * unit(random));
  for (const char* name : {"EAX", "EBX", "ECX", "EAY", "EBY", "ECY", "EC0Y", "EB0Z", "EA0Z", "EB0A",
                           "EC0A", "EA0C", "EB0C"})
    text += fmt::format("{}_urad = {:.4f}\n", name, 15 * unit(random));
  return text;
}();

BallRaster dome(const std::string& more) {
  return {.part =
              "surface = \"sphere_cap\"\nradius_mm = 100.0\nrim_radius_mm = 12.0\n"
              "at_mm = [40, 25, 80]\nvertices = 6000",
          .step_over = 0.4,
          .step = 0.2,
          .lead = 36.0,
          .more = more};
}

AxisState any_state(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  AxisState state;
  state.q = AxisVector::Zero(6);  // C X Y Z A s
  state.q << 3.0 * unit(random), 200 * unit(random), 200 * unit(random), 150 + 150 * unit(random),
      1.2 * unit(random), 0.0;
  state.time_s = 100.0 * (1 + unit(random));
  return state;
}

TEST(Sources, TipAndAxisDeviationsAddTo2e4OfTheirSum) {
  const Job all = job_of(dome(geometric + machine_heat + weight));
  const Job singles[] = {job_of(dome(geometric)), job_of(dome(machine_heat)), job_of(dome(weight))};
  SeededRandom random(7);
  double worst_tip = 0.0, worst_axis = 0.0, largest = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const AxisState state = any_state(random);
    const Pose nominal = all.machine.nominal.tool_in_workpiece(state.q);
    // a cut of 150 N on whatever gives way, the same in all; its coupling with the other sources
    // through the depth of cut is the loop's affair
    errors::Load load;
    load.tool_wrench_t << 90, -80, 90, 400, -300, 200;
    const auto deviation = [&](const Job& job) {
      const Pose actual = tool_in_workpiece(job.truth, state, load);
      kinematics::Deviation d;
      d << actual.translation() - nominal.translation(),
          actual.linear().col(2) - nominal.linear().col(2);
      return d;
    };
    kinematics::Deviation left = deviation(all);
    double tip = 0.0, axis = 0.0;
    for (const Job& job : singles) {
      const kinematics::Deviation d = deviation(job);
      left -= d;
      tip += d.head<3>().norm();
      axis += d.tail<3>().norm();
    }
    largest = std::max(largest, tip);
    worst_tip = std::max(worst_tip, left.head<3>().norm() / tip);
    worst_axis = std::max(worst_axis, left.tail<3>().norm() / axis);
  }
  std::cout << "sources up to " << largest / units::um << " um together: tips add to " << worst_tip
            << ", axes to " << worst_axis << " of the sum of the magnitudes\n";
  EXPECT_GT(largest, 20.0_um);
  EXPECT_LT(worst_tip, 2e-4);
  EXPECT_LT(worst_axis, 2e-4);
}

/// Largest change of the tip's deviation to a place one step-over aside.
double rival_shift(const Job& job, double aside) {
  double most = 0.0;
  for (std::size_t i = 0; i < job.samples.states.size(); i += 50) {
    AxisState here = job.samples.states[i], there = here;
    there.q[2] += aside;
    const auto off = [&](const AxisState& state) -> Vector3d {
      return tool_in_workpiece(job.truth, state).translation() -
             job.machine.nominal.tool_in_workpiece(state.q).translation();
    };
    most = std::max(most, (off(here) - off(there)).norm());
  }
  return most;
}

TEST(Sources, MapsAddWithinTheBoundOfShiftedCusps) {
  const double R = 5.0, rho = 100.0, step_over = 0.4;
  const std::string texts[] = {geometric, machine_heat, weight};
  const Job all = job_of(dome(geometric + machine_heat + weight));
  const Cut error_free = cut_error_free(all);
  VectorXd left = cut(all).surface.residual - error_free.surface.residual;
  double t = 0.0, competing_passes = 0.0, tips = 0.0;
  for (const std::string& text : texts) {
    const Job job = job_of(dome(text));
    const Cut one = cut(job);
    left -= one.surface.residual - error_free.surface.residual;
    t += one.tip_error.max;
    competing_passes += rival_shift(job, step_over);
    tips += one.tip_error.rms;
  }
  const double bend = 1 / R + 1 / rho;  // 1 / R_eff
  const double slope = 0.5 * step_over * bend;
  const double bound = 0.5 * t * t * bend + 2 * slope * t + competing_passes;
  double most = 0.0, square = 0.0;
  int n = 0;
  for (const double d : left)
    if (std::isfinite(d)) {
      most = std::max(most, std::abs(d));
      square += d * d;
      ++n;
    }
  std::cout << "maps of three sources (tips " << tips / units::um << " um RMS in sum): apart by "
            << most / units::um << " um at most, " << std::sqrt(square / n) / units::um
            << " um RMS; bound " << bound / units::um << " um\n";
  EXPECT_GT(n, 5000);
  EXPECT_LT(most, bound);
  EXPECT_LT(bound, 0.1 * t);  // the bound says something
}

void expect_same_bits(const cutting::Surface& a, const cutting::Surface& b) {
  ASSERT_EQ(a.residual.size(), b.residual.size());
  for (Index i = 0; i < a.residual.size(); ++i)
    if (std::isfinite(a.residual[i])) {
      ASSERT_EQ(a.residual[i], b.residual[i]) << i;
    }
  ASSERT_EQ(a.status, b.status);
}

TEST(Sources, OneThatIsOffCostsNoBit) {
  const cutting::Surface plain = cut(job_of(dome(geometric))).surface;
  // a network that drives nothing
  std::string cold = machine_heat;
  cold.erase(cold.find("[[thermal.element]]"));
  expect_same_bits(plain, cut(job_of(dome(geometric + cold))).surface);
  // a compliance that nothing loads
  std::string unloaded = weight;
  unloaded.erase(unloaded.find("gravity"),
                 unloaded.find('\n', unloaded.find("gravity")) + 1 - unloaded.find("gravity"));
  expect_same_bits(plain, cut(job_of(dome(geometric + unloaded))).surface);
  // a stock that is cut without forces, on a compliant machine
  const std::string stock =
      "[cutting]\nblank = \"offset\"\nallowance_mm = 0.2\nfloor_mm = -20\nspacing_mm = 0.5\n";
  expect_same_bits(plain, cut(job_of(dome(geometric + unloaded + stock))).surface);
}

TEST(Vibration, AFlatSinksByTheAmplitudeOfAnAxialVibration) {
  // 10 000 rpm and 600 mm/min: 60 um a turn, far below the step-over, so every place sees the
  // lowest
  const double amplitude = 1.0_um;
  const auto flat = [](const std::string& more) {
    return BallRaster{.part =
                          "surface = \"rectangle\"\nlength_x_mm = 6.0\nlength_y_mm = 4.0\n"
                          "at_mm = [40, 25, 80]\nvertices = 1500",
                      .step_over = 0.5,
                      .step = 0.5,
                      .more = "feed_mm_per_min = 600\n" + more};
  };
  const cutting::Surface still = cut(job_of(flat(""))).surface;
  const Job job =
      job_of(flat("[sampling]\nchord_tolerance_nm = 20\n"
                  "[[vibration]]\nelement = \"EZS\"\namplitude_um = 1.0\n"));
  const cutting::Surface shaken = cut(job).surface;
  // between two lowest places, 30 um away, a ball R 5 leaves (30 um)^2 / 2 R = 0.09 um at most
  double least = 1.0, most = -1.0;
  for (Index i = 0; i < still.residual.size(); ++i)
    if (std::isfinite(still.residual[i]) && std::isfinite(shaken.residual[i])) {
      least = std::min(least, shaken.residual[i] - still.residual[i]);
      most = std::max(most, shaken.residual[i] - still.residual[i]);
    }
  std::cout << job.samples.states.size() << " samples; the flat sinks by " << -most / units::um
            << " to " << -least / units::um << " um, amplitude 1 um\n";
  // the head leans by 36 deg, so the nose's Z is not the flat's normal
  const double across = std::cos(36.0 * units::deg);
  EXPECT_NEAR(least, -amplitude * across, 25.0_nm);
  EXPECT_LT(most, -amplitude * across + 0.12_um);
}

}  // namespace
}  // namespace abbe::sim
