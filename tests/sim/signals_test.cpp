// signals.csv and the thermal day: what a control could read, against closed forms.

#include "sim/cut/commands.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/scene_folder.h"
#include "tests/sim/signal_columns.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

const std::vector<Override> small{{"part.vertices", "500"}, {"program.step_over_mm", "5"}};

TEST(Signals, TheThermalDayTellsHistoryAndProgramInTime) {
  const Job job = job_of("thermal_protocol.toml", small);
  const Signals signals = cut(job).signals;
  const auto c = columns(signals);
  const VectorXd& t = c.at("time_s");
  EXPECT_DOUBLE_EQ(t[0], -8 * 3600);
  EXPECT_GT(t[t.size() - 1], 0.0);
  for (Index i = 1; i < t.size(); ++i) ASSERT_GT(t[i], t[i - 1]);
  // the bearing is warmest at the end of a phase of work
  const VectorXd& bearing = c.at("T_spindle_bearing_C");
  Index warmest = 0;
  bearing.maxCoeff(&warmest);
  std::cout << "bearing " << bearing[0] << " .. " << bearing.maxCoeff() << " C at "
            << t[warmest] / 3600 << " h\n";
  EXPECT_NEAR(bearing[0], 25.0, 1e-9);
  EXPECT_NEAR(t[warmest], -3600, 61);
  EXPECT_NEAR(c.at("spindle_rpm")[10], 12000.0, 1e-9);
  EXPECT_TRUE(signals.rows.allFinite());
  int sensors = 0;
  for (const auto& [name, column] : c) sensors += name[0] == 'S' && name.ends_with("_C");
  EXPECT_EQ(sensors, 18);
}

TEST(Signals, SpindleGrowthFollowsItsNodes) {
  const auto c = columns(cut(job_of("thermal_protocol.toml", small)).signals);
  const VectorXd& T_box = c.at("T_spindle_box_C");
  const VectorXd& T_bearing = c.at("T_spindle_bearing_C");
  double worst = 0.0;
  for (Index i = 0; i < T_box.size(); ++i) {
    const double growth = 0.5 * (T_bearing[i] - T_bearing[0]) + 1.3 * (T_box[i] - T_box[0]);
    worst = std::max(worst, std::abs(-c.at("EZS_um")[i] + c.at("EZS_um")[0] - growth));
  }
  std::cout << "EZS follows its two nodes to " << worst << " um\n";
  EXPECT_LT(worst, 1e-6);
}

TEST(Heat, DriftCountsFromTheDatum) {
  // an ideal datum at the touched point: the tip stands exactly there when it was found, and
  // elsewhere by what the machine drifted since
  const Vector3d point(40, 25, 80);
  const auto found_at = [&](double time_h) {
    std::vector<Override> changes = small;
    changes.emplace_back("datum.time_h", fmt::format("{}", time_h));
    return job_of("thermal_protocol.toml", changes);
  };
  const auto tip_off = [&](const Job& job, double time_h) -> Vector3d {
    const Vector3d told_w = point + control_datum_offset(job);
    kinematics::AxisState state;
    state.q = slide_offset(
        job.machine.control,
        told_w - job.machine.control
                     .tool_in_workpiece(kinematics::AxisVector::Zero(job.machine.control.size()))
                     .translation());
    state.time_s = 3600 * time_h;
    return tool_in_workpiece(job.truth, state).translation() - point;
  };
  for (const double found_h : {-8.0, -3.0}) {
    const Job job = found_at(found_h);
    const double now = tip_off(job, found_h).norm(), later = tip_off(job, -1.0).norm();
    std::cout << "datum at " << found_h << " h: tip off by " << now / units::nm << " nm then, "
              << later / units::um << " um at -1 h\n";
    EXPECT_LT(now, 10.0_nm);
    EXPECT_GT(later, found_h < -4 ? 20.0_um : 2.0_um);
  }
  EXPECT_GT((tip_off(found_at(-8.0), 0.0) - tip_off(found_at(-3.0), 0.0)).norm(), 10.0_um);
}

TEST(Signals, TheCurrentIsThatOfTorqueAndFriction) {
  const Job job = job_of("stepped_shaft.toml", {{"part.vertices", "500"},
                                                {"signals.current.noise_A", "0"},
                                                {"signals.current.bandwidth_Hz", "0"}});
  const auto c = columns(cut(job).signals);
  double worst = 0.0, most = 0.0;
  for (Index i = 0; i < c.at("time_s").size(); ++i) {
    const double speed = c.at("spindle_rpm")[i];
    const double idle = speed > 0 ? 1.5 : 0.0;
    worst = std::max(
        worst, std::abs(c.at("current_A")[i] - (c.at("torque_Nm")[i] + idle + 1e-4 * speed) / 0.6));
    most = std::max(most, c.at("current_A")[i]);
    EXPECT_NEAR(c.at("power_W")[i], c.at("torque_Nm")[i] * speed * units::rpm, 1e-6);
  }
  std::cout << "current up to " << most << " A, off by " << worst << " A\n";
  EXPECT_LT(worst, 1e-9);
  EXPECT_GT(most, 3.0);
}

TEST(Signals, NoiseRepeatsWithTheSeedAndHasItsSize) {
  const auto current = [](const std::string& seed, const std::string& noise) {
    return columns(cut(job_of("stepped_shaft.toml", {{"part.vertices", "500"},
                                                     {"seed", seed},
                                                     {"signals.current.noise_A", noise},
                                                     {"signals.interval_s", "0.02"}}))
                       .signals)
        .at("current_A");
  };
  const VectorXd quiet = current("1", "0"), one = current("1", "0.02"),
                 again = current("1", "0.02"), other = current("2", "0.02");
  EXPECT_EQ(one, again);
  EXPECT_NE(one, other);
  const double sigma = std::sqrt((one - quiet).squaredNorm() / double(one.size()));
  std::cout << "noise of " << one.size() << " rows: " << sigma << " A\n";
  EXPECT_NEAR(sigma, 0.02, 4 * 0.02 / std::sqrt(2.0 * double(one.size())));
}

TEST(Signals, ABandwidthLagsByItsTimeConstant) {
  const auto run = [](const std::string& hertz) {
    return columns(cut(job_of("stepped_shaft.toml", {{"part.vertices", "500"},
                                                     {"signals.current.noise_A", "0"},
                                                     {"signals.current.bandwidth_Hz", hertz},
                                                     {"signals.interval_s", "0.024"}}))
                       .signals);
  };
  const auto fast = run("0"), slow = run("0.5");
  // a first-order lag delays the area under the curve by its time constant
  const VectorXd& t = fast.at("time_s");
  double area = 0.0;
  for (Index i = 1; i < t.size(); ++i)
    area += 0.5 * (t[i] - t[i - 1]) *
            (fast.at("current_A")[i] - slow.at("current_A")[i] + fast.at("current_A")[i - 1] -
             slow.at("current_A")[i - 1]);
  const double tau = 1 / (2 * pi * 0.5);
  const double rise = slow.at("current_A")[t.size() - 1] - fast.at("current_A")[0];
  std::cout << "area between the currents " << area << " A s, tau times rise " << tau * rise
            << " A s\n";
  // the trapezoids between rows cut off (dt / tau)^2 / 12 of it
  EXPECT_NEAR(area, tau * rise, 2.0 / 12 * std::pow(0.024 / tau, 2) * area);
}

TEST(Signals, AnEncoderReadsTheCommandRoundedToItsResolution) {
  const auto c =
      columns(cut(job_of("stepped_shaft.toml",
                         {{"part.vertices", "500"}, {"signals.encoder_resolution_um", "0.5"}}))
                  .signals);
  double worst = 0.0;
  for (Index i = 0; i < c.at("Z_mm").size(); ++i) {
    worst = std::max(worst, std::abs(c.at("Z_mm")[i] - c.at("Z_encoder_mm")[i]));
    const double counts = c.at("Z_encoder_mm")[i] / 0.5_um;
    EXPECT_NEAR(counts, std::round(counts), 1e-6);
  }
  EXPECT_LE(worst, 0.25_um * (1 + 1e-9));
  EXPECT_GT(worst, 0.0);
}

TEST(Signals, ASceneWithoutHeatAndForceHasNone) {
  EXPECT_TRUE(
      cut(job_of("platform_plane.toml", {{"part.vertices", "200"}})).signals.columns.empty());
}

TEST(Heat, AWarmWorkpieceIsSmallerWhenItIsJudged) {
  // the whole part at 30 deg C: what was cut at radius r is r / (1 + 10 K alpha) at 20 deg C
  const std::string warm = R"(
[thermal]
start_C = 30
[[thermal.node]]
name = "part"
capacity_J_per_K = 1e9
[[thermal.link]]
between = ["part", "room"]
conductance_W_per_K = 1e-6
[thermal.workpiece]
node = "part"
um_per_m_K = 23.5
)";
  const auto disc = [](const std::string& more) {
    return BallRaster{.part =
                          "surface = \"rectangle\"\nlength_x_mm = 12.0\nlength_y_mm = 10.0\n"
                          "at_mm = [40, 25, 80]\nvertices = 2000",
                      .more = more};
  };
  const cutting::Surface cold = cut(job_of(disc(""))).surface;
  const Job job = job_of(disc(warm));
  const cutting::Surface hot = cut(job).surface;
  // a plane 80 mm above the point that stands still sinks by 80 mm * 23.5e-6 * 10
  double worst = 0.0;
  const double far = std::hypot(46.0, 30.0);  // mm, the corner farthest from the fixed point
  const double expected = -80.0 * (1 - 1 / (1 + 23.5e-6 * 10));
  for (Index i = 0; i < cold.residual.size(); ++i)
    if (std::isfinite(cold.residual[i]) && std::isfinite(hot.residual[i]))
      worst = std::max(worst, std::abs(hot.residual[i] - cold.residual[i] - expected));
  std::cout << "plane sinks by " << expected / units::um << " um, map off by " << worst / units::nm
            << " nm (cusps move sideways by " << far * 23.5e-6 * 10 / units::um << " um)\n";
  EXPECT_LT(worst, 0.05 * far * 23.5e-6 * 10 + 1.0_nm);  // slope of a cusp times its shift
}

TEST(Heat, AWarmUpMakesTheMapsGrow) {
  const std::vector<Override> coarse{{"part.vertices", "2000"}, {"program.step_over_mm", "2"}};
  const Scene scene = read_scene(packaged("gantry_warmup.toml"), coarse);
  std::map<std::string, double> rms;
  for (const Variant& variant : scene.variants) {
    std::vector<Override> changes = coarse;
    changes.insert(changes.end(), variant.set.begin(), variant.set.end());
    const Job job = prepare(read_scene(packaged("gantry_warmup.toml"), changes));
    rms[variant.name] = apart(cut(job).surface, cut_error_free(job).surface).rms;
    std::cout << variant.name << ": " << rms[variant.name] / units::um << " um RMS\n";
  }
  EXPECT_LT(rms.at("cold"), rms.at("30 min"));
  EXPECT_LT(rms.at("30 min"), rms.at("3 h"));
}

}  // namespace
}  // namespace abbe::sim
