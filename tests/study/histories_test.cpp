// Days of a small gantry of two warm things, spindle box and Z screw: what a day taught holds where
// it saw what warms, and nowhere else; drifts are those of a closed form.

#include "cutting/map/residual.h"
#include "sim/commands/calibration_commands.h"
#include "sim/scene/read_scene.h"
#include "sim/study/configuration.h"
#include "tests/sim/refusal.h"
#include "tests/sim/small_scene.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

constexpr double K_per_h = 10.0;  // of either node at full work: 100 W into 36 kJ/K, nothing lost
constexpr double growth_um_per_K = 2.0;
constexpr double screw_um_per_m_K = 12.0;
constexpr double lead_deg = 36.0;

const char* heat = R"(
reference_C = 20
[[node]]
name = "box"
capacity_J_per_K = 36000
[[node]]
name = "screw"
capacity_J_per_K = 36000
[[link]]
between = ["box", "room"]
conductance_W_per_K = 1e-6
[[link]]
between = ["screw", "room"]
conductance_W_per_K = 1e-6
[[source]]
node = "box"
kind = "spindle"
power_W = 100
at_rpm = 12000
[[source]]
node = "screw"
kind = "axis"
axis = "Z"
coulomb_N = 2000
[[element]]
name = "EZS"
offset = [{ node = "box", um_per_K = -2 }]
[[element]]
name = "EZZ"
slope = [{ node = "screw", um_per_m_K = 12 }]
fixed_mm = 350
[[sensor]]
name = "at box"
node = "box"
noise_K = 0.02
[[sensor]]
name = "at screw"
node = "screw"
noise_K = 0.02
)";

/// Drift, R-test and tracker from so many hours ago, again every so many hours.
std::string instruments(double hours, double every_h) {
  std::string starts;
  for (double h = -hours; h < 0.0; h += every_h) starts += fmt::format("{}, ", h);
  return fmt::format(R"([[variant.set.instrument]]
kind = "drift"
at_mm = [100, 0, 100]
start_h = {0}
duration_h = {1}
interval_s = 60
[[variant.set.instrument]]
kind = "r_test"
at_mm = [100, 0, 100]
from_deg = -90
to_deg = 90
targets = 3
both_ways = false
position_um = 0
speed_mm_per_min = 10000
set_up_min = 0
start_h = [{2}]
[[variant.set.instrument]]
kind = "tracker"
targets = 2
position_um = 0
alignment_urad = 0
speed_mm_per_min = 10000
set_up_min = 0
start_h = [{2}]
)",
                     -hours, hours, starts);
}

std::string history(const std::string& phases) { return "history = [" + phases + "]\n"; }

const std::string spindle_2h = history("{ duration_h = 2, speed_rpm = 12000 }");
const std::string slides_2h = history("{ duration_h = 2, axis_speed_mm_per_min = { Z = 3000 } }");
const std::string both_4h = history(
    "{ duration_h = 1, speed_rpm = 12000 },"
    "{ duration_h = 1, axis_speed_mm_per_min = { Z = 3000 } },"
    "{ duration_h = 2, speed_rpm = 6000, axis_speed_mm_per_min = { Z = 3000 } }");

std::string day(const std::string& name, const std::string& set) {
  return fmt::format("[[variant]]\nname = \"{}\"\n[variant.set]\nthermal = \"heat.toml\"\n{}", name,
                     set);
}

/// The scene itself has no heat.
std::string scene_text() {
  BallRaster scene;
  scene.part =
      "surface = \"rectangle\"\nlength_x_mm = 6\nlength_y_mm = 6\nat_mm = [40, 25, 80]\n"
      "vertices = 200";
  scene.step = 1.0;
  scene.lead = lead_deg;
  const std::string errors =
      fmt::format("errors = \"{}errors/gantry_typical.toml\"\n", packaged("").string());
  return errors + to_toml(scene) + "[signals]\ninterval_s = 60\n" +
         day("both", both_4h + instruments(4.0, 0.25)) +
         day("spindle", spindle_2h + instruments(2.0, 0.125)) + day("slides", slides_2h) +
         day("spindle again", "\"part.vertices\" = 400\n" + spindle_2h) +
         day("long", history("{ duration_h = 4, speed_rpm = 12000 }")) +
         day("unmoved", "\"thermal.scale\" = 0.0\n" + spindle_2h) +
         day("once", spindle_2h + "[[variant.set.instrument]]\nkind = \"laser\"\naxes = [\"Z\"]\n");
}

class HistoriesOfDays : public testing::Test {
 protected:
  HistoriesOfDays() {
    folder_.write("heat.toml", heat);
    scene_ = folder_.write("days.toml", scene_text());
  }

  Study study(const std::vector<std::string>& train, const std::vector<std::string>& test) const {
    Study study;
    study.file = folder_.path() / "study.toml";
    study.scene = scene_;
    study.histories = Histories{train, test};
    return load_scene(study);
  }

  SceneFolder folder_;
  fs::path scene_;
};

// ---------------------------------------------------------------- what days are worth

/// By hand: the flat is cut too deep by what the box grows along the tool, which leans, and by what
/// the screw moves where Z cuts, deepest of all.
double drift_by_hand(const Study& study, double box_h, double screw_h) {
  const Job job = prepare(base_scene(study, {"", "slides", ""}));
  double z = INFINITY;
  for (const kinematics::AxisState& state : job.samples.states) z = std::min(z, state.q[3]);
  const double box = -growth_um_per_K * K_per_h * box_h * std::cos(lead_deg * units::deg);
  const double screw = screw_um_per_m_K * K_per_h * screw_h * (z - 350.0) / 1000.0;
  return std::abs(box + screw) * units::um;
}

TEST_F(HistoriesOfDays, ABeliefHoldsWhereItsDaySawWhatWarms) {
  const Study all =
      study({"both", "spindle"}, {"both", "spindle", "slides", "spindle again", "long"});
  std::vector<double> fractions;
  const auto results =
      histories(all, [&](const std::string&, double f) { fractions.push_back(f); });
  ASSERT_EQ(results.size(), 10u);
  std::cout << to_csv(results);
  for (std::size_t k = 0; k < 10; ++k) {
    EXPECT_EQ(results[k].train, all.histories->train[k / 5]);
    EXPECT_EQ(results[k].test, all.histories->test[k % 5]);
    EXPECT_EQ(results[k].uncompensated_rms, results[k % 5].uncompensated_rms);
  }
  const std::vector<bool> own = {true, false, false, false, false, false, true, false, true, false};
  for (std::size_t k = 0; k < 10; ++k) EXPECT_EQ(results[k].is_own_day, own[k]) << k;
  EXPECT_TRUE(std::ranges::is_sorted(fractions));
  EXPECT_EQ(fractions.back(), 1.0);

  const auto reduction = [&](std::size_t k) { return results[k].reduction_percent.value(); };
  for (const std::size_t k : {0, 1, 2, 3, 6, 8}) EXPECT_GT(reduction(k), 98.0) << k;
  // whoever saw the spindle alone does not know what the screw does
  EXPECT_EQ(results[5].sensors.front(), "at box");
  EXPECT_LT(reduction(5), 40.0);
  EXPECT_LT(std::abs(reduction(7)), 2.0);
  // 40 K, of which a day of 18.75 K says nothing beyond a tenth more
  for (const std::size_t k : {4, 9}) {
    EXPECT_NEAR(reduction(k), 100.0 * 1.1 * 18.75 / 40.0, 2.0);
    EXPECT_HAS(results[k].warnings.back(), "limited");
  }
}

TEST_F(HistoriesOfDays, TheDriftPartIsThatOfTheClosedForm) {
  const Study days = study({"spindle"}, {"both", "spindle", "slides"});
  const auto results = histories(days);
  const std::vector<double> expected = {
      drift_by_hand(days, 2.0, 3.0), drift_by_hand(days, 2.0, 0.0), drift_by_hand(days, 0.0, 2.0)};
  for (std::size_t k = 0; k < 3; ++k) {
    std::cout << results[k].test << ": " << results[k].uncompensated_rms / units::um
              << " um, by hand " << expected[k] / units::um << "\n";
    // the program itself warms both by some hundredths of a K
    EXPECT_NEAR(results[k].uncompensated_rms, expected[k], 0.2 * units::um);
  }
}

TEST_F(HistoriesOfDays, OfADayThatHeatDoesNotMoveThereIsNoReduction) {
  const auto results = histories(study({"spindle"}, {"unmoved"}));
  ASSERT_EQ(results.size(), 1u);
  EXPECT_EQ(results[0].uncompensated_rms, 0.0);
  EXPECT_GT(results[0].compensated_rms, 10.0 * units::um);  // what was believed and is not there
  EXPECT_FALSE(results[0].reduction_percent);
}

// The long way by the files that `measure` and `identify` write, without `histories`.
TEST_F(HistoriesOfDays, TheBeliefIsThatOfTheFilesOfReadings) {
  const Study by_day = study({"spindle"}, {"both"});
  const auto set_of = [&](const std::string& name) {
    for (const Variant& variant : read_scene(scene_).variants)
      if (variant.name == name) return variant.set;
    return std::vector<Override>{};
  };
  std::vector<fs::path> files;
  for (const MeasuredFile& one :
       measure(scene_, {set_of("spindle"), {}, folder_.path() / "readings"}))
    files.push_back(one.file);
  IdentificationOptions options;
  options.method = IdentificationOptions::Method::Thermal;
  options.out = folder_.path() / "belief.txt";
  const IdentificationResult found = identify(files, options);

  const std::vector<Override> day = set_of("both");
  std::vector<Override> informed = day, unmoved = day;
  informed.emplace_back("belief.thermal.file", "\"" + options.out.string() + "\"");
  unmoved.emplace_back("thermal.scale", "0.0");
  const Job job = prepare(read_scene(scene_, informed));
  const auto without = cut(prepare(read_scene(scene_, unmoved))).surface;
  const auto rms = [&](const Cut& one) {
    return *cutting::statistics(cutting::minus(one.surface, without), job.design_w).rms;
  };
  const HistoryResult result = histories(by_day).front();
  EXPECT_EQ(result.uncompensated_rms, rms(cut(job)));
  EXPECT_EQ(result.compensated_rms, rms(cut(job, parse_case("thermal-iterated-ideal"))));
  EXPECT_EQ(result.sensors, std::get<ThermalDay>(found.fit).sensors);

  Study believing = by_day;  // in what it was not taught
  believing.overrides.emplace_back("belief.thermal.file", "\"" + options.out.string() + "\"");
  believing.histories->train = {"both"};
  Study taught = study({"both"}, {"both"});
  EXPECT_EQ(histories(believing).front().compensated_rms,
            histories(taught).front().compensated_rms);
}

// ---------------------------------------------------------------- refusals

TEST_F(HistoriesOfDays, RefusesWhatCannotTeachOrBeJudged) {
  const auto said = [](const Study& study) { return refusal_by([&] { histories(study); }); };
  const auto expect = [&](const Study& study, const std::vector<std::string>& words) {
    const std::string refusal = said(study);
    for (const std::string& word : words) EXPECT_HAS(refusal, word);
  };
  expect(study({"slides"}, {"both"}), {"days.toml", "[[instrument]]", "start_h", "\"slides\""});
  expect(study({""}, {"both"}), {"days.toml", "[thermal]", "the day of the scene"});
  expect(study({"both"}, {""}), {"days.toml", "[thermal]", "the day of the scene"});
  expect(study({"both"}, {"monday"}), {"days.toml", "\"monday\"", "\"slides\""});
  expect(study({"monday"}, {"both"}), {"days.toml", "\"monday\""});
  expect(study({"once"}, {"both"}), {"days.toml", "\"once\"", "start_h"});
  Study other = study({"both"}, {"both"});
  for (const char* name : {"fused-iterated-ideal", "perfect-iterated-ideal", "uncompensated", "",
                           "composite-iterated-ideal", "mine.py"}) {
    other.histories->case_name = name;
    expect(other, {"study.toml", "histories.case", "thermal-iterated-ideal"});
  }
  other.histories.reset();
  expect(other, {"study.toml", "[histories]"});
}

// ---------------------------------------------------------------- tables

TEST(Histories, TablesReadBackTheSameBits) {
  HistoryResult first, second;
  first.test = "3 h";
  first.uncompensated_rms = 0.1 / 3.0;
  first.compensated_rms = 1e-9 / 7.0;
  first.reduction_percent = 200.0 / 3.0;
  first.sensors = {"a,b", "say \"c\""};
  first.warnings = {"w"};
  second.train = "30 min";
  second.is_own_day = true;
  const std::vector<HistoryResult> results = {first, second};

  const auto json = nlohmann::ordered_json::parse(to_json(results).dump());
  ASSERT_EQ(json.size(), 2u);
  EXPECT_EQ(json[0]["train"], "");
  EXPECT_EQ(json[0]["test"], "3 h");
  EXPECT_EQ(json[0]["own_day"], false);
  EXPECT_EQ(json[0]["uncompensated_rms_um"].get<double>(), first.uncompensated_rms / units::um);
  EXPECT_EQ(json[0]["compensated_rms_um"].get<double>(), first.compensated_rms / units::um);
  EXPECT_EQ(json[0]["reduction_percent"].get<double>(), *first.reduction_percent);
  EXPECT_EQ(json[0]["sensors"].get<std::vector<std::string>>(), first.sensors);
  EXPECT_EQ(json[0]["warnings"].get<std::vector<std::string>>(), first.warnings);
  EXPECT_TRUE(json[1]["reduction_percent"].is_null());

  const std::string csv = to_csv(results);
  const std::size_t head = csv.find('\n') + 1;
  EXPECT_EQ(csv.substr(0, head),
            "train,test,own_day,uncompensated_rms_um,compensated_rms_um,reduction_percent,sensors"
            "\n");
  double uncompensated = 0, compensated = 0, reduction = 0;
  ASSERT_EQ(std::sscanf(csv.c_str() + head, ",3 h,false,%lf,%lf,%lf", &uncompensated, &compensated,
                        &reduction),
            3);
  EXPECT_EQ(uncompensated, first.uncompensated_rms / units::um);
  EXPECT_EQ(compensated, first.compensated_rms / units::um);
  EXPECT_EQ(reduction, *first.reduction_percent);
  EXPECT_HAS(csv, ",\"a,b; say \"\"c\"\"\"\n30 min,,true,0,0,,\n");
  EXPECT_EQ(to_json(std::vector<HistoryResult>{}).dump(), "[]");
  EXPECT_EQ(to_csv(std::vector<HistoryResult>{}), csv.substr(0, head));
}

}  // namespace
}  // namespace abbe::sim::study
