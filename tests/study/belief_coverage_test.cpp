// Random machines, calibrated by virtual instruments: how often the true part lies where the study
// of the identified belief says that it does.

#include <tbb/parallel_for.h>
#include "errors/coefficients.h"
#include "errors/curve.h"
#include "errors/identification/model.h"
#include "sim/calibration/calibration.h"
#include "sim/cut/placement.h"
#include "sim/machine/truth.h"
#include "sim/measure/measure.h"
#include "sim/readings/readings_file.h"
#include "sim/report/identification_report.h"
#include "sim/scene/read_scene.h"
#include "sim/study/budget_analysis.h"
#include "sim/study/case_plan.h"
#include "sim/study/influence.h"
#include "sim/study/study_inputs.h"
#include "tests/study/farm_runs.h"
#include "tests/test.h"

namespace abbe::sim::study {
namespace {

/// A machine, what is cut on it, and how it is calibrated.
struct Campaign {
  std::string name;
  std::string scene;        ///< TOML without errors and instruments
  std::string instruments;  ///< TOML
};

std::string scenes_folder() { return (fs::path(ABBE_SOURCE_DIR) / "scenes").string() + "/"; }

std::string dome(const std::string& machine, double height_mm) {
  return fmt::format(
      "title = \"dome\"\nmachine = \"{0}machines/{1}.toml\"\ntool = \"{0}tools/ball_r5.toml\"\n"
      "[part]\nsurface = \"sphere_cap\"\nradius_mm = 20\nrim_radius_mm = 6\n"
      "at_mm = [40, 25, {2}]\nvertices = 200\n"
      "[program]\ngenerator = \"raster\"\nstep_over_mm = 0.8\nstep_mm = 2\nlead_deg = 30\n"
      "feed_mm_per_min = 1500\nclearance_mm = 10\npattern = \"one_way\"\noverrun_mm = 1.0\n"
      "[sampling]\nchord_tolerance_nm = 100\nmax_step_mm = 1000\n",
      scenes_folder(), machine, height_mm);
}

std::string plane() {
  return fmt::format(
      "title = \"plane\"\nmachine = \"{0}machines/platform_xz.toml\"\n"
      "tool = \"{0}tools/diamond_r249um.toml\"\n"
      "[part]\nsurface = \"disc\"\nradius_mm = 8\nturn_deg = [0, 90, 0]\nvertices = 200\n"
      "[program]\ngenerator = \"spiral\"\nspeed_rpm = 150\nfeed_um_per_rev = 100\n"
      "start_beyond_rim_mm = 0.2\nend_radius_mm = 0\ninterval_s = 0.1\nformat = \"pvt\"\n",
      scenes_folder());
}

std::string instrument(const std::string& kind, const std::string& more = "targets = 5\n") {
  return "[[instrument]]\nkind = \"" + kind + "\"\n" + more;
}

/// Balls read while each axis turns, at three places.
std::string r_tests(const std::string& axis, const std::string& places) {
  std::string text;
  int count = 0;
  for (std::size_t from = 0; from < places.size();) {
    const std::size_t end = std::min(places.find(';', from), places.size());
    text += fmt::format(
        "[[instrument]]\nname = \"{0} {1}\"\nkind = \"r_test\"\nposition_um = 1\naxes = [\"{0}\"]\n"
        "targets = 9\n{2}\n",
        axis, count++, places.substr(from, end - from));
    from = end + 1;
  }
  return text;
}

std::string of_slides(const std::string& level = "targets = 5\n") {
  return instrument("laser") + instrument("straightness") + instrument("angle_optics") +
         instrument("level", level) + instrument("square");
}

std::string roll_of_z() {
  return instrument("roll_lines", "axes = [\"Z\"]\ntargets = 5\nlever_mm = 300\n");
}

std::vector<Campaign> campaigns() {
  const std::string balls_of_C =
      r_tests("C", "at_mm = [60, 0, 60];at_mm = [0, 160, 60];at_mm = [-100, 0, 220]");
  const std::string balls_of_A =
      r_tests("A",
              "at_mm = [0, 0, 160];at_mm = [0, 0, 160]\nreflector_mm = [0, 0, -120];"
              "at_mm = [0, 0, 160]\nreflector_mm = [120, 0, 0]");
  const std::string balls_of_table =
      r_tests("A", "at_mm = [60, 0, 60];at_mm = [0, 80, 60];at_mm = [-60, 0, 120]");
  return {{"gantry", dome("gantry_cxyza", 80), of_slides() + roll_of_z() + balls_of_C + balls_of_A},
          {"trunnion", dome("trunnion_ca", 60),
           of_slides() + roll_of_z() + balls_of_C + balls_of_table},
          {"platform", plane(), of_slides("up = [0, 1, 0]\ntargets = 5\n")},
          {"gantry without rolls and balls", dome("gantry_cxyza", 80),
           instrument("laser") + instrument("straightness") + instrument("angle_optics") +
               instrument("square")}};
}

errors::identification::ModelOptions model_options() {
  return {.order = 2, .harmonics = 2, .placement = false};
}

/// A machine with every number that an identification may find drawn by its prior.
errors::GeometricErrors random_machine(const kinematics::Chain& nominal, std::uint64_t seed) {
  errors::GeometricErrors machine = errors::identification::error_model(nominal, model_options());
  const auto all = errors::coefficients(machine.elements);
  VectorXd values = errors::values(machine.elements);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto held = std::ranges::find(machine.covariance.of, all[i]);
    if (held != machine.covariance.of.end()) continue;  // zero by convention
    const std::string number = errors::name_of(all[i], machine.elements);
    values[Index(i)] =
        errors::identification::typical_deviation(number) * errors::normal_deviate(seed, i);
  }
  machine.elements = errors::with_values(machine.elements, values);
  machine.covariance = {};
  return machine;
}

/// The band of 95 % of RMS and PV of the map, of each vertex, and what is true.
struct Trial {
  std::vector<bool> is_within;  ///< RMS, PV
  double vertices_within = 0.0;
  double rms_um = 0.0, low_um = 0.0, high_um = 0.0;
  std::string warning;
};

bool lies_within(std::vector<double> drawn, double value, double& low, double& high) {
  std::sort(drawn.begin(), drawn.end());
  const auto at = [&](double p) { return drawn[std::size_t(p * double(drawn.size() - 1) + 0.5)]; };
  low = at(0.025);
  high = at(0.975);
  return value >= low && value <= high;
}

Trial trial_of(const Campaign& campaign, std::uint64_t seed, const std::string& prior) {
  const RunFolder folder;
  const auto file = folder.write("scene.toml", campaign.scene + campaign.instruments);
  Scene scene = read_scene(file);
  scene.geometric = random_machine(make_machine(scene).nominal, seed);
  scene.seed = seed;
  std::vector<fs::path> files;
  for (const InstrumentDescription& one : scene.instruments)
    files.push_back(
        folder.write(one.instrument.name + ".csv", sim::to_text(measure_machine(scene, one))));
  IdentificationOptions options;
  options.model = model_options();
  options.out = folder / "belief.toml";
  folder.write("belief.toml", belief_file_text(identified(files, options)));
  const Study study = read_study(
      folder.write("study.toml",
                   "scene = \"scene.toml\"\nset = { errors = \"belief.toml\" }\n"
                   "responses = [\"rms\", \"pv\"]\n[[inputs]]\nevery = \"covariance\"\n" +
                       prior + "[influence]\nchecks = 0\n"));
  const PreparedConfiguration ready = prepare_configuration(study, study.configurations.front());
  const InfluenceMap influence = influence_map(study, ready);
  constexpr Index machines = 1000;
  const MatrixXd x =
      draw_inputs(study, points({Sampling::Sobol, int(study.inputs.size()), seed}, 0, machines));
  const MatrixXd figures = responses(study, ready, influence, x);
  const MatrixXd all = maps(influence, x);
  const Job job = check_placement(prepare(scene));
  const cutting::Surface truth = cut(job, uncompensated_commands(job)).surface;
  const VectorXd is = responses(study, job, truth, {});
  Trial trial;
  for (Index r = 0; r < is.size(); ++r) {
    std::vector<double> row(figures.row(r).begin(), figures.row(r).end());
    double low = 0.0, high = 0.0;
    trial.is_within.push_back(lies_within(row, is[r], low, high));
    if (r == 0) trial.rms_um = 1e3 * is[r], trial.low_um = 1e3 * low, trial.high_um = 1e3 * high;
  }
  int cut_vertices = 0, within = 0;
  for (Index v = 0; v < all.rows(); ++v) {
    if (!std::isfinite(truth.residual[v]) || !is_cut(influence, v)) continue;
    std::vector<double> row(all.row(v).begin(), all.row(v).end());
    double low = 0.0, high = 0.0;
    ++cut_vertices;
    within += lies_within(row, truth.residual[v], low, high);
  }
  trial.vertices_within = double(within) / std::max(1, cut_vertices);
  if (prior.empty()) {
    ConfigurationBudget budget;
    budget.arm = study.configurations.front();
    budget.unidentified = unidentified_effects(study, ready);
    trial.warning = unidentified_warning(study, budget);
  }
  return trial;
}

/// Percent of machines whose RMS, PV is within, mean percent of their vertices.
struct BandCoverage {
  double rms = 0.0, pv = 0.0, vertices = 0.0;
  std::string warning;
};

BandCoverage coverage_of(const Campaign& campaign, int machines, const std::string& prior) {
  std::vector<Trial> trials(static_cast<std::size_t>(machines));
  tbb::parallel_for(0, machines, [&](int i) {
    trials[std::size_t(i)] = trial_of(campaign, 7000 + std::uint64_t(i), prior);
  });
  BandCoverage result;
  double rms_um = 0.0, width_um = 0.0;
  for (const Trial& one : trials) {
    result.rms += one.is_within[0] * 100.0 / machines;
    result.pv += one.is_within[1] * 100.0 / machines;
    result.vertices += one.vertices_within * 100.0 / machines;
    rms_um += one.rms_um / machines;
    width_um += (one.high_um - one.low_um) / machines;
  }
  result.warning = trials.front().warning;
  std::cout << fmt::format(
      "{:32} {:22} {} machines: RMS of {:.2f} um in its band of {:.2f} um {:.0f} %, PV {:.0f} %, "
      "vertices {:.1f} %\n{}{}",
      campaign.name, prior.empty() ? "without prior" : prior.substr(0, prior.size() - 1), machines,
      rms_um, width_um, result.rms, result.pv, result.vertices, result.warning,
      result.warning.empty() ? "" : "\n");
  return result;
}

bool is_long() { return std::getenv("ABBE_LONG") != nullptr; }

// 95 of 100 are expected; 90 to 99 is where 98 of 100 such counts lie. Of 20 machines chance leaves
// fewer than 15 within the band once in 3000 times.
TEST(BeliefCoverage, TrueMapsLieInTheBandOf95Percent) {
  const int machines = is_long() ? 100 : 20;
  const double low = is_long() ? 90.0 : 75.0, high = is_long() ? 99.0 : 100.0;
  for (const Campaign& campaign : campaigns()) {
    SCOPED_TRACE(campaign.name);
    const BandCoverage covered = coverage_of(campaign, machines, "unidentified = \"typical\"\n");
    EXPECT_GE(covered.rms, low);
    EXPECT_LE(covered.rms, high);
    EXPECT_GE(covered.pv, low);
    EXPECT_LE(covered.pv, high);
    EXPECT_GE(covered.vertices, 90.0);
    EXPECT_LE(covered.vertices, 99.5);
  }
}

// Without a prior the band leaves out what was not identified, and the result says so.
TEST(BeliefCoverage, WithoutAPriorTheBandIsTooNarrowAndSaysSo) {
  const Campaign campaign = campaigns().back();
  const BandCoverage covered = coverage_of(campaign, 20, "");
  EXPECT_LT(covered.rms, 80.0);
  EXPECT_HAS(covered.warning, "were not identified and have no prior");
  EXPECT_HAS(covered.warning, "the map changes with");
}

}  // namespace
}  // namespace abbe::sim::study
