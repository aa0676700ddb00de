// Virtual instruments on whole scenes: what they read is what was put in, no more and no less.

#include "sim/cut/process.h"
#include "sim/machine/truth.h"
#include "sim/scene/read_scene.h"
#include "tests/sim/measured_scene.h"
#include "tests/sim/odd_scenes.h"
#include "tests/sim/refusal.h"
#include "tests/test.h"

namespace abbe::sim {
namespace {

using errors::metrology::BodyPoses;
using errors::metrology::Kind;
using errors::metrology::Readings;
using kinematics::AxisState;

/// The truth that a scene's instruments meet.
Truth truth_met(const Scene& scene) {
  const Machine machine = make_machine(scene);
  return make_truth(scene, machine, activity(scene, machine, {}, {}));
}

/// What an instrument between tool and workpiece would read of a pose T_wt, and of the bed nothing.
double reading_of(const Readings& readings, std::size_t i, const kinematics::Pose& T_wt) {
  const auto& measurement = readings.plan.measurements[i];
  const BodyPoses actual{kinematics::Pose::Identity(), T_wt};
  const BodyPoses nominal{kinematics::Pose::Identity(),
                          readings.nominal.tool_in_workpiece(measurement.state.q)};
  return errors::metrology::reading(readings.plan.set_ups[std::size_t(measurement.set_up)],
                                    measurement.channel, {}, actual, nominal);
}

TEST(Measure, APerfectMachineReadsItsNominalToRounding) {
  int held = 0;
  for (const char* name : {"gantry_perfect.toml", "platform_perfect.toml"}) {
    const Scene scene = read_scene(packaged(name));
    for (const Kind kind : errors::metrology::all_kinds()) {
      const std::string word = to_string(kind);
      Readings readings{{}, make_machine(scene).nominal, {}, {}, {}};
      try {
        readings = measure_machine(scene, faultless(scene, word));
      } catch (const BadInput&) {
        EXPECT_EQ(std::string(name).find("platform"), 0u) << word << ": a gantry can carry all";
        continue;
      }
      ++held;
      if (readings.value.size() == 0) continue;
      EXPECT_LT(beyond_nominal(readings).cwiseAbs().maxCoeff(), 1e-11) << name << " " << word;
    }
  }
  std::cout << held << " kinds of instrument on two machines\n";
  EXPECT_GE(held, 17 + 8);
}

TEST(Measure, TheLaserReadsTheConstantSlopeThatWasInjected) {
  const double c = 6.0_um;  // at +-300 mm
  const Scene scene = scene_of(measured_scene(
      "[errors.EXX]\nkind = \"legendre\"\ncoefficients_um = [0, 6]\nhalf_range_mm = 300\n"));
  const Readings readings = measure_machine(scene, faultless(scene, "laser"));
  const VectorXd seen = beyond_nominal(readings);
  double worst = 0.0, others = 0.0;
  std::map<int, double> zero;  // by set-up: the counter is set where it is first read
  for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
    const auto& measurement = readings.plan.measurements[i];
    const bool along_x = readings.plan.set_ups[std::size_t(measurement.set_up)].name[0] == 'X';
    const double error = along_x ? c * measurement.state.q[1] / 300.0 : 0.0;
    const double first = zero.emplace(measurement.set_up, error).first->second;
    double& most = along_x ? worst : others;
    most = std::max(most, std::abs(seen[Index(i)] - (error - first)));
  }
  std::cout << "off by " << worst << " mm along X, " << others << " mm elsewhere\n";
  EXPECT_LT(worst, 1e-12);  // mm: a few ulp at 300 mm
  EXPECT_LT(others, 1e-12);
}

TEST(Measure, TheLaserSeesThePitchOverItsArm) {
  // the tip is 100 mm below the point where X's deviations are stated: Abbe's principle
  const Scene scene = scene_of(measured_scene(
      "[errors.EBX]\nkind = \"legendre\"\ncoefficients_urad = [0, 30]\nhalf_range_mm = 300\n"));
  const Readings readings = measure_machine(scene, faultless(scene, "laser"));
  const VectorXd seen = beyond_nominal(readings);
  double worst = 0.0;
  std::optional<double> first;
  for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
    const auto& measurement = readings.plan.measurements[i];
    if (readings.plan.set_ups[std::size_t(measurement.set_up)].name[0] != 'X') continue;
    const double arm =
        readings.nominal.tool_in_workpiece(measurement.state.q).translation().z() - 200.0;
    const double error = std::sin(30.0_urad * measurement.state.q[1] / 300.0) * arm;
    if (!first) {
      first = error;
      std::cout << "arm " << arm << " mm\n";
    }
    worst = std::max(worst, std::abs(seen[Index(i)] - (error - *first)));
  }
  std::cout << "off by " << worst << " mm\n";
  EXPECT_LT(worst, 1e-11);
}

TEST(Measure, EveryInstrumentBetweenToolAndTableReadsWhereTheTipIs) {
  const Scene scene = read_scene(packaged("gantry_dome.toml"));
  const Truth truth = [&] {
    Scene bare = scene;  // instruments stand in for tool and part, and these are as ordered
    bare.tool.actual = bare.tool.nominal;
    bare.tool.actual_length = bare.tool.length;
    return truth_met(bare);
  }();
  for (const char* word : {"laser", "straightness", "square", "diagonals", "ball_bar", "r_test",
                           "sphere", "multilateration"}) {
    const Readings readings = measure_machine(scene, faultless(scene, word));
    std::map<std::pair<int, int>, double> zero;
    double worst = 0.0, largest = 0.0;
    for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
      const auto& measurement = readings.plan.measurements[i];
      const double true_error =
          reading_of(readings, i, tool_in_workpiece(truth, measurement.state)) -
          reading_of(readings, i, readings.nominal.tool_in_workpiece(measurement.state.q));
      const double seen =
          readings.value[Index(i)] -
          reading_of(readings, i, readings.nominal.tool_in_workpiece(measurement.state.q));
      const bool counts = readings.plan.set_ups[std::size_t(measurement.set_up)].is_zero_unknown;
      const double first =
          counts ? zero.emplace(std::pair(measurement.set_up, measurement.channel), true_error)
                       .first->second
                 : 0.0;
      worst = std::max(worst, std::abs(seen - (true_error - first)));
      largest = std::max(largest, std::abs(seen));
    }
    std::cout << fmt::format("{:16} largest {:.2f} um, off by {:.1e} mm\n", word, largest / 1.0_um,
                             worst);
    EXPECT_GT(largest, 1.0_um) << word;
    EXPECT_LT(worst, 1e-11) << word;
  }
}

TEST(Measure, WeightBendsWhatIsMeasured) {
  const auto scene = [](double scale) {
    return scene_of(measured_scene(
        fmt::format("[compliance]\nscale = {}\ngravity = [0, 0, -1]\n"
                    "[compliance.axis.X]\nstiffness_N_per_um = [100, 100, 100]\n"
                    "turning_stiffness_Nm_per_urad = [4, 4, 4]\n"
                    "[[compliance.mass]]\naxis = \"Y\"\nmass_kg = 200\ncentre_mm = [0, 0, 200]\n",
                    scale)));
  };
  const auto sag = [&](double scale) {
    const Scene s = scene(scale);
    const Readings readings = measure_machine(s, faultless(s, "straightness"));
    const VectorXd beyond = beyond_nominal(readings);
    double least = 0.0, most = 0.0;
    for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i)
      if (readings.plan.set_ups[std::size_t(readings.plan.measurements[i].set_up)].name ==
          "Y straightness in Z") {
        least = std::min(least, beyond[Index(i)]);
        most = std::max(most, beyond[Index(i)]);
      }
    return most - least;
  };
  EXPECT_EQ(sag(0.0), 0.0);
  // the mass travels on Y by y, turns X by m g y / k and so the tip, which travels with it, by y^2;
  // at the mean of the travel there is nothing, at both ends the same
  const double y = 0.48 * 700.0, moment = 200.0 * 9.80665 * y;  // N mm
  const double by_hand = moment / 4e9 * y;                      // 4 Nm/urad = 4e9 N mm/rad
  std::cout << "sag at the ends of Y " << sag(1.0) / 1.0_um << " um, by hand " << by_hand / 1.0_um
            << " um\n";
  EXPECT_NEAR(sag(1.0), by_hand, 1e-3 * by_hand);
  EXPECT_NEAR(sag(2.0), 2.0 * sag(1.0), 1e-3 * by_hand);
}

TEST(Measure, DriftIsTheTrueMotionOfTheTip) {
  const Scene scene = read_scene(packaged("thermal_protocol.toml"));
  InstrumentDescription drift = faultless(scene, "drift");
  drift.starts_s = {-8.0 * 3600.0};
  drift.instrument.duration_s = 8.0 * 3600.0;
  drift.instrument.interval_s = 1800.0;
  const Readings readings = measure_machine(scene, drift);
  Scene at_20 = scene;
  at_20.thermal->errors.workpiece.reset();  // a nest of sensors stands in for the part
  const Truth truth = truth_met(at_20);
  std::map<int, std::pair<double, double>> first;
  double worst = 0.0, largest = 0.0;
  for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
    const auto& measurement = readings.plan.measurements[i];
    const double seen = readings.value[Index(i)];
    const double is = reading_of(readings, i, tool_in_workpiece(truth, measurement.state));
    const auto [seen_0, is_0] =
        first.emplace(measurement.channel, std::pair(seen, is)).first->second;
    worst = std::max(worst, std::abs((seen - seen_0) - (is - is_0)));
    largest = std::max(largest, std::abs(seen - seen_0));
  }
  std::cout << "largest drift " << largest / 1.0_um << " um, off by " << worst << " mm\n";
  EXPECT_GT(largest, 20.0_um);
  EXPECT_LT(worst, 1e-11);
  EXPECT_EQ(readings.plan.measurements.front().state.time_s, -8.0 * 3600.0);

  Scene cold = scene;
  cold.thermal->scale = 0.0;
  const Readings still = measure_machine(cold, drift);
  for (std::size_t i = 0; i < still.plan.measurements.size(); ++i)
    ASSERT_EQ(still.value[Index(i)], still.value[Index(i) % 5]) << "without heat nothing moves";
}

TEST(Measure, TemperaturesAreThoseOfTheSensorsNodes) {
  Scene scene = read_scene(packaged("thermal_protocol.toml"));
  for (auto& sensor : scene.thermal->sensors)
    sensor.offset_K = sensor.noise_K = sensor.resolution_K = sensor.lag_s = 0.0;
  InstrumentDescription log = find_instrument(scene, "temperature");
  log.starts_s = {-8.0 * 3600.0, -1200.0};
  log.instrument.interval_s = 600.0;
  log.instrument.duration_s = 7200.0;
  const Readings readings = measure_machine(scene, log);
  const Truth truth = truth_met(scene);
  ASSERT_EQ(readings.sensors.size(), 18u);
  ASSERT_EQ(readings.value.size(), 0);
  double worst = 0.0;
  for (std::size_t i = 0; i < readings.plan.measurements.size(); ++i) {
    const double time_s = readings.plan.measurements[i].state.time_s;
    const VectorXd T_C = errors::temperatures(truth.heat->run, time_s);
    for (std::size_t k = 0; k < 18; ++k)
      worst = std::max(
          worst, std::abs(readings.T_C(Index(i), Index(k)) - T_C[scene.thermal->sensors[k].node]));
  }
  std::cout << readings.plan.measurements.size() << " rows, " << worst << " K apart\n";
  EXPECT_LT(worst, 1e-9);
  EXPECT_GT((readings.T_C.colwise().maxCoeff() - readings.T_C.colwise().minCoeff()).maxCoeff(),
            5.0);
}

TEST(Measure, TheSameSeedReadsTheSameBytesAndAnotherOthers) {
  const auto text = [](const char* seed, const char* instrument) {
    const Scene scene = read_scene(packaged("gantry_dome.toml"), {{"seed", seed}});
    return to_text(measure_machine(scene, find_instrument(scene, instrument)));
  };
  for (const char* instrument : {"laser", "r_test", "drift"}) {
    EXPECT_EQ(text("5", instrument), text("5", instrument));
    EXPECT_NE(text("5", instrument), text("6", instrument));
  }
}

TEST(Measure, TwoInstrumentsOfAKindErrApart) {
  const Scene scene = read_scene(packaged("gantry_dome.toml"));
  InstrumentDescription one = find_instrument(scene, "laser"), two = one;
  two.instrument.name = "another laser";
  const VectorXd a = measure_machine(scene, one).value, b = measure_machine(scene, two).value;
  ASSERT_EQ(a.size(), b.size());
  const double apart = rms(a - b);
  std::cout << "two lasers differ by " << apart / 1.0_um << " um RMS\n";
  EXPECT_GT(apart,
            one.instrument.noise);  // sqrt(2) of noise, and what their scales do
}

TEST(Measure, EveryStartIsASetUpOfItsOwn) {
  const Scene scene = read_scene(packaged("gantry_perfect.toml"));
  InstrumentDescription laser = find_instrument(scene, "laser");
  laser.instrument.noise = laser.instrument.resolution = 0.0;
  laser.starts_s = {0.0};
  const Readings once = measure_machine(scene, laser);
  laser.starts_s = {0.0, 86400.0};
  const Readings twice = measure_machine(scene, laser);
  ASSERT_EQ(twice.plan.set_ups.size(), 2 * once.plan.set_ups.size());
  ASSERT_EQ(twice.value.size(), 2 * once.value.size());
  EXPECT_DOUBLE_EQ(twice.plan.duration_s, 2 * once.plan.duration_s);
  EXPECT_EQ(twice.value.head(once.value.size()), once.value);
  double apart = 0.0;  // the beam was laid again, and the air is another
  for (Index i = 0; i < once.value.size(); ++i)
    apart = std::max(apart, std::abs(twice.value[i + once.value.size()] - once.value[i]));
  std::cout << "two set-ups differ by up to " << apart / 1.0_um << " um\n";
  EXPECT_GT(apart, 0.01_um);
  EXPECT_LT(apart, 2.0_um);
  const auto& measurements = twice.plan.measurements;
  EXPECT_NEAR(
      measurements[measurements.size() / 2].state.time_s - measurements.front().state.time_s,
      86400.0, 1e-6);
}

/// A file of readings without its readings.
std::string without_readings(const std::string& text) {
  std::string result;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string line = text.substr(at, end - at);
    at = end + 1;
    if (line[0] != '#' && line.ends_with("mm")) {
      const std::size_t unit = line.rfind(','), value = line.rfind(',', unit - 1);
      line.erase(value, unit - value);
    }
    result += line + "\n";
  }
  return result;
}

TEST(Measure, OnlyTheReadingsTellAnythingOfTheTruth) {
  const Scene wrong = read_scene(packaged("gantry_dome.toml"));
  Scene perfect = wrong;
  perfect.geometric = {};
  for (const char* instrument : {"laser", "ball_bar", "r_test"}) {
    const std::string a = to_text(measure_machine(wrong, find_instrument(wrong, instrument)));
    const std::string b = to_text(measure_machine(perfect, find_instrument(perfect, instrument)));
    EXPECT_NE(a, b);
    EXPECT_EQ(without_readings(a), without_readings(b)) << instrument;
  }
}

// ---------------------------------------------------------------- parts

const std::string flat_part =
    "surface = \"rectangle\"\nlength_x_mm = 60\nlength_y_mm = 60\n"
    "at_mm = [40, 25, 80]\nvertices = 3000";
const std::string wrong_slides =
    "[errors]\nEZX = { kind = \"fourier\", period_mm = 70, a_um = [9], b_um = [6] }\n"
    "EZY = { kind = \"fourier\", period_mm = 90, a_um = [-7], b_um = [12] }\n"
    "EBX = { kind = \"fourier\", period_mm = 80, a_urad = [30], b_urad = [20] }\n"
    "EAY = { kind = \"fourier\", period_mm = 60, a_urad = [-25], b_urad = [10] }\n"
    "EB0Z_urad = 100\nEA0Z_urad = -80\n";

Scene part_scene(const std::string& more) {
  return scene_of(to_toml({.part = flat_part,
                           .step_over = 0.2,
                           .step = 0.5,
                           .lead = 0.0,
                           .more = wrong_slides + more}));
}

using VertexPlace = std::array<double, 3>;
template <typename Row>
VertexPlace make_key(const Row& p) {
  return {p.x(), p.y(), p.z()};
}

/// Residual by the place of its vertex.
std::map<VertexPlace, double> map_of(const Job& job, const Cut& cut) {
  std::map<VertexPlace, double> map;
  for (Index i = 0; i < cut.surface.residual.size(); ++i)
    map[make_key(job.design_w.vertices.row(i))] = cut.surface.residual[i];
  return map;
}

TEST(Measure, ACoordinateMachineReadsTheMapToItsNoise) {
  const Scene scene = part_scene(
      "[[instrument]]\nkind = \"cmm\"\nspacing_mm = 2\nnoise_um = 0\n"
      "[[instrument]]\nname = \"noisy\"\nkind = \"cmm\"\nspacing_mm = 2\nnoise_um = 0.5\n");
  const Job job = prepare(scene);
  const std::map<VertexPlace, double> map = map_of(job, cut(job));
  const auto against_map = [&](const PartReadingsFile& file) {
    VectorXd apart = file.readings.deviation;
    for (Index i = 0; i < apart.size(); ++i) {
      const auto found = map.find(make_key(file.readings.points_w.row(i)));
      EXPECT_NE(found, map.end()) << "every point is a vertex";
      if (found != map.end()) apart[i] -= found->second;
    }
    return apart;
  };
  const auto clean = measure_cut_part(scene, *find_part_instrument(scene, "cmm"));
  const auto noisy = measure_cut_part(scene, *find_part_instrument(scene, "noisy"));
  EXPECT_EQ(clean.kind, "cmm");
  ASSERT_GT(clean.readings.deviation.size(), 500);
  const double left = against_map(clean).cwiseAbs().maxCoeff();
  const double noise = rms(against_map(noisy));
  std::cout << clean.readings.deviation.size() << " points, RMS "
            << rms(clean.readings.deviation) / 1.0_um << " um; without noise off by " << left
            << " mm, with 0.5 um by " << noise / 1.0_um << " um RMS\n";
  EXPECT_LT(left, 1e-13);
  EXPECT_NEAR(noise, 0.5_um, 4 * 0.5_um / std::sqrt(2.0 * double(noisy.readings.deviation.size())));
  EXPECT_DOUBLE_EQ(noisy.readings.sigma, 0.5_um);
}

TEST(Measure, TheMachineCannotSeeItself) {
  const Scene scene = part_scene(
      "[[instrument]]\nkind = \"touch_probe\"\nspacing_mm = 4\nnoise_um = 0\nclearance_mm = 1\n");
  const Job job = prepare(scene);
  const auto wrong = map_of(job, cut(job)), cusps = map_of(job, cut_error_free(job));
  const auto probed = measure_cut_part(scene, *find_part_instrument(scene, "touch_probe")).readings;
  VectorXd machine(probed.deviation.size()), seen(probed.deviation.size());
  for (Index i = 0; i < seen.size(); ++i) {
    const auto p = make_key(probed.points_w.row(i));
    machine[i] = wrong.at(p) - cusps.at(p);
    seen[i] = probed.deviation[i] - cusps.at(p);
  }
  std::cout << fmt::format(
      "of {} points: the machine's part of the map is {:.3f} um RMS, its own "
      "probe reads {:.4f} um RMS of it, {:.4f} at most\n",
      seen.size(), rms(machine) / 1.0_um, rms(seen) / 1.0_um, seen.cwiseAbs().maxCoeff() / 1.0_um);
  EXPECT_GT(rms(machine), 8.0_um);
  // Passes 0.2 mm apart leave flanks of slope 0.1 / 5: squareness and angles move these by some 14
  // um, which is 0.3 um of height; slopes of 1 um/mm over the 0.1 mm to the next pass are 0.1 um.
  EXPECT_LT(seen.cwiseAbs().maxCoeff(), 0.4_um);
  EXPECT_LT(rms(seen), 0.01 * rms(machine));
}

TEST(Measure, APartMeasuresTheCaseThatItsInstrumentNames) {
  const Scene scene = part_scene(
      "[[instrument]]\nkind = \"cmm\"\nspacing_mm = 4\nnoise_um = 0\n"
      "[[instrument]]\nname = \"after\"\nkind = \"cmm\"\nspacing_mm = 4\nnoise_um = 0\n"
      "case = \"perfect-iterated-ideal\"\n");
  const auto before = measure_cut_part(scene, *find_part_instrument(scene, "cmm"));
  const auto after = measure_cut_part(scene, *find_part_instrument(scene, "after"));
  EXPECT_LT(rms(after.readings.deviation), 0.3 * rms(before.readings.deviation));
  EXPECT_EQ(after.part, scene.title + ", perfect-iterated-ideal");
}

// ---------------------------------------------------------------- refusals

TEST(Measure, AnInstrumentThatTheMachineCannotCarryIsRefusedByName) {
  const Scene three = scene_of(measured_scene("", "three_axis_table"));
  for (const char* name : {"r_test", "ball_bar_rotary", "sphere"}) {
    const std::string refusal = refusal_of_measuring(three, name);
    EXPECT_HAS(refusal, name);
    EXPECT_HAS(refusal, "measured.toml");
  }
  EXPECT_EQ(refusal_of_measuring(three, "laser"), "");
}

TEST(Measure, AnUnknownInstrumentListsTheKnownOnes) {
  const Scene scene =
      scene_of(measured_scene("[[instrument]]\nname = \"mine\"\nkind = \"laser\"\n"));
  const std::string refusal = refusal_of_measuring(scene, "lasre");
  for (const char* word :
       {"\"lasre\"", "mine", "laser", "ball_bar", "temperature", "cmm", "touch_probe"})
    EXPECT_HAS(refusal, word);
}

TEST(Measure, ATableOfErrorsThatIsLeftIsRefusedByName) {
  const Scene scene = scene_of(
      measured_scene("[errors.EXX]\nkind = \"table\"\nq_mm = [-100, 100]\nvalue_um = [0, 1]\n"));
  const std::string refusal = refusal_of_measuring(scene, "laser");
  EXPECT_HAS(refusal, "EXX");
  EXPECT_HAS(refusal, "errors that are defined where laser measures");
}

/// A plane of 10 x 10 mm cut half, or sunk into.
std::string flat_scene(const SceneFolder& folder, double to, double z) {
  folder.write("flat.ngc", to_nc({.from = -7, .to = to, .z = z}));
  return to_toml(FlatScene{.program = "flat.ngc", .more = "[[instrument]]\nkind = \"cmm\"\n"});
}

TEST(Measure, WarningsOfTheCutAreThoseOfTheReadings) {
  const SceneFolder folder;
  MeasureOptions options;
  options.folder = folder.path() / "out";
  const auto half = measure(folder.write("half.toml", flat_scene(folder, -1, 0)), options);
  ASSERT_EQ(half.size(), 1u);
  ASSERT_EQ(half[0].warnings.size(), 2u);  // of the program before, of the cut after
  EXPECT_HAS(half[0].warnings[0], "the program comes within 2 mm of ");
  EXPECT_HAS(half[0].warnings[1], "judged vertices (20 %) are uncut");
  const auto whole = measure(folder.write("whole.toml", flat_scene(folder, 7, 0)), options);
  EXPECT_TRUE(whole.at(0).warnings.empty()) << whole[0].warnings[0];
}

TEST(Measure, APartOfWhichNothingCanBeReadIsRefusedAndLeavesNoFile) {
  const SceneFolder folder;
  MeasureOptions options;
  options.folder = folder.path() / "out";
  const auto sunk = folder.write("sunk.toml", flat_scene(folder, 7, -3));
  const std::string refused = refusal_by([&] { measure(sunk, options); });
  EXPECT_HAS(refused,
             "a part that cmm can measure, seen no judged surface cut within 2 mm of "
             "the design, 400 vertices gouged deeper");
  EXPECT_FALSE(fs::exists(options.folder / "cmm.csv"));
}

TEST(Measure, WritesOneFileAnInstrumentAndNoneWithoutOne) {
  const SceneFolder folder;
  const auto file = folder.write(
      "m.toml", measured_scene("[[instrument]]\nname = \"one\"\nkind = \"laser\"\ntargets = 3\n"
                               "[[instrument]]\nname = \"two\"\nkind = \"level\"\ntargets = 3\n"
                               "[[instrument]]\nname = \"part\"\nkind = \"cmm\"\n"));
  MeasureOptions options;
  options.folder = folder.path() / "out";
  const auto all = measure(file, options);
  ASSERT_EQ(all.size(), 3u);
  for (const MeasuredFile& one : all) EXPECT_TRUE(fs::exists(one.file)) << one.file;
  EXPECT_EQ(all[0].file.filename(), "one.csv");
  EXPECT_EQ(all[0].set_ups, 3u);
  EXPECT_GT(all[0].duration_s, 3600.0);
  options.instruments = {"two"};
  EXPECT_EQ(measure(file, options).size(), 1u);
  const auto none = folder.write("n.toml", measured_scene(""));
  options.instruments = {};
  options.folder = folder.path() / "nothing";
  EXPECT_THROW(measure(none, options), BadInput);
  EXPECT_FALSE(fs::exists(options.folder));
}

}  // namespace
}  // namespace abbe::sim
