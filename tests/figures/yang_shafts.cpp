// Yang 2012, table 1: a stepped and a conical blank turned to one diameter.

#include "sim/loop/compensate.h"
#include "tests/figures/figure.h"
#include "tests/test.h"

namespace abbe::figures {
namespace {

// A vector holds three radii, mm.

const std::string yang_table_1 = "Yang 2012, table 1";
const std::string open = "force-position-open";
const std::string fit =
    "a fit: compliance, length of the tool and blank are set to these six radii";
const std::string trial_fit =
    "a fit: one gain of the current a trial, and an idle current for every cut";

struct Shaft {
  std::string scene, name;
  Vector3d before;
  std::array<Vector3d, 2> after;
  std::string spreads, reductions;  ///< as printed, of three trials
};
const std::array<Shaft, 2> shafts{
    {{"stepped_shaft",
      "stepped",
      {12.4847, 12.4816, 12.4782},
      {Vector3d(12.4936, 12.4913, 12.4898), Vector3d(12.4911, 12.4894, 12.4927)},
      "6.5 → 3.8, 3.3, 3.4",
      "42, 49, 48"},
     {"cone_shaft",
      "cone",
      {12.4887, 12.4853, 12.4826},
      {Vector3d(12.4931, 12.4914, 12.4893), Vector3d(12.4895, 12.4921, 12.4934)},
      "6.1 → 3.8, 3.9, 3.5",
      "38, 36, 43"}}};

SceneCase before(const Shaft& shaft) { return {shaft.scene}; }
SceneCase after(const Shaft& shaft, int trial) {
  return {shaft.scene, {}, open, fmt::format("trial {}", trial)};
}

Vector3d radii(const SceneCase& one) {
  Vector3d r;
  int i = 0;
  for (const auto& [name, value] : summary_of(one)["radii_um"].items())
    r[i++] = value.get<double>() * 1e-3;
  return r;
}

std::string text(const Vector3d& r) {
  return fmt::format("{:.4f} {:.4f} {:.4f}", r[0], r[1], r[2]);
}
double spread_um(const Vector3d& r) { return (r.maxCoeff() - r.minCoeff()) / units::um; }
double rise_um(const Vector3d& from, const Vector3d& to) {
  return (to.mean() - from.mean()) / units::um;
}
double gain(const Vector3d& from, const Vector3d& to) {
  const Vector3d x = from.array() - from.mean(), y = to.array() - to.mean();
  return 1.0 - x.dot(y) / x.squaredNorm();
}

void add_radii(std::vector<Figure>& rows, const Shaft& shaft) {
  rows.push_back({yang_table_1, shaft.name + ": radii before compensation, mm", text(shaft.before),
                  [shaft] { return text(radii(before(shaft))); }, command(before(shaft)), fit,
                  true});
  for (int trial = 1; trial <= 2; ++trial)
    rows.push_back({yang_table_1, fmt::format("{}: radii after, trial {}, mm", shaft.name, trial),
                    text(shaft.after[std::size_t(trial - 1)]),
                    [shaft, trial] { return text(radii(after(shaft, trial))); },
                    command(after(shaft, trial)), trial_fit, true});
}

void add_derived(std::vector<Figure>& rows, const Shaft& shaft) {
  const std::string both = command({shaft.scene, {}, open, "trial 1"}) + " and 2";
  const auto of_trials = [shaft](auto what, const char* form) {
    const Vector3d from = radii(before(shaft));
    return fmt::format(fmt::runtime(form), what(from, radii(after(shaft, 1))),
                       what(from, radii(after(shaft, 2))));
  };
  const auto of_table = [&shaft](auto what, const char* form) {
    return fmt::format(fmt::runtime(form), what(shaft.before, shaft.after[0]),
                       what(shaft.before, shaft.after[1]));
  };
  rows.push_back({yang_table_1, shaft.name + ": mean radius rises by, trials 1 and 2, µm",
                  of_table(rise_um, "{:.1f}, {:.1f}"),
                  [of_trials] { return of_trials(rise_um, "{:.1f}, {:.1f}"); }, both, trial_fit,
                  true});
  rows.push_back({yang_table_1, shaft.name + ": gain on the varying part, trials 1 and 2",
                  of_table(gain, "{:.2f}, {:.2f}"),
                  [of_trials] { return of_trials(gain, "{:.2f}, {:.2f}"); }, both, trial_fit,
                  true});
  const auto reduction = [](const Vector3d& from, const Vector3d& to) {
    return 100 * (1 - spread_um(to) / spread_um(from));
  };
  rows.push_back({yang_table_1, shaft.name + ": spread before → after in three trials, µm",
                  shaft.spreads,
                  [shaft, of_trials] {
                    const auto after_spread = [](const Vector3d&, const Vector3d& to) {
                      return spread_um(to);
                    };
                    return fmt::format("{:.1f} → {}", spread_um(radii(before(shaft))),
                                       of_trials(after_spread, "{:.1f}, {:.1f}"));
                  },
                  both, "the radii of one trial are lost, so that there are two", true});
  rows.push_back({yang_table_1, shaft.name + ": spread reduced by, %", shaft.reductions,
                  [of_trials, reduction] { return of_trials(reduction, "{:.0f}, {:.0f}"); }, both,
                  "one gain for both shafts; the second trial's differ by more than that", true});
}

/// By the law in the state in which it was learnt: what a current that says the force could do.
void add_law(std::vector<Figure>& rows, const Shaft& shaft) {
  const auto row = [&](const std::string& what, const SceneCase& one) {
    rows.push_back(
        {yang_table_1, fmt::format("{}: spread by the law as learnt, {}, µm", shaft.name, what),
         shaft.spreads,
         [shaft, one] {
           return fmt::format("{:.2f} → {:.2f}", spread_um(radii(before(shaft))),
                              spread_um(radii(one)));
         },
         command(one), "the current is worth in the trials what it was in training", true});
  };
  row("open control", {shaft.scene, {}, open});
  row("open control, no noise", {shaft.scene, {{"signals.current.noise_A", "0"}}, open});
  row("shift of the origin", {shaft.scene, {}, "force-position-origin"});
  const SceneCase law{shaft.scene, {}, open};
  rows.push_back({yang_table_1, shaft.name + ": mean radius by the law as learnt, mm", "12.4914",
                  [law] { return fmt::format("{:.4f}", radii(law).mean()); }, command(law),
                  "0.09 µm of the difference lie where no slide goes, the rest is the law of the "
                  "training part",
                  true});
}

std::string level(const std::array<Vector3d, 4>& all) {
  Eigen::Vector4d means;
  for (int i = 0; i < 4; ++i) means[i] = all[std::size_t(i)].mean();
  const double scatter = std::sqrt((means.array() - means.mean()).square().sum() / 3);
  return fmt::format("{:.4f} ± {:.5f}", means.mean(), scatter);
}

/// Mean range of three normal deviates over their sigma, from the distribution of a range.
double expected_range_of_three() {
  double sum = 0.0;
  const double h = 0.005;
  const auto below = [](double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); };
  for (double x = -8.0; x <= 8.0; x += h)
    sum += h * (1 - std::pow(below(x), 3) - std::pow(1 - below(x), 3));
  return sum;
}

std::string cutting_conditions() {
  const sim::Job job = sim::prepare(scene_of("stepped_shaft", {{"part.vertices", "500"}}));
  const auto cut = std::find_if(
      job.path.blocks.begin(), job.path.blocks.end(),
      [](const auto& one) { return one.interpolation == sim::program::Interpolation::Line; });
  const auto& states = job.samples.states;
  const auto inside = std::find_if(states.begin(), states.end(), [&](const auto& state) {
    return state.time_s > 0.5 * (cut->start_s + cut->end_s);
  });
  const int z = job.machine.nominal.find('Z').value();
  return fmt::format("{:.0f} rpm, {:.0f} mm/min", inside->spindle_speed / units::rpm,
                     60 * std::abs(cut->end[z] - cut->start[z]) / (cut->end_s - cut->start_s));
}

}  // namespace

std::vector<Figure> yang_shafts() {
  std::vector<Figure> rows{{yang_table_1, "speed and feed", "2500 rpm, 100 mm/min",
                            cutting_conditions, "`abbe check scenes/stepped_shaft.toml`", ""}};
  for (const Shaft& shaft : shafts) add_radii(rows, shaft);
  for (const Shaft& shaft : shafts) add_derived(rows, shaft);
  rows.push_back(
      {yang_table_1, "mean of the four means after compensation and their scatter, mm",
       level({shafts[0].after[0], shafts[0].after[1], shafts[1].after[0], shafts[1].after[1]}),
       [] {
         return level({radii(after(shafts[0], 1)), radii(after(shafts[0], 2)),
                       radii(after(shafts[1], 1)), radii(after(shafts[1], 2))});
       },
       "the four trials above", "a tool 8.6 µm long, inferred from this figure", true});
  for (const Shaft& shaft : shafts) add_law(rows, shaft);
  rows.push_back({yang_table_1, "expected range of three readings, in σ", "1.69",
                  [] { return fmt::format("{:.4f}", expected_range_of_three()); },
                  "`abbe test -R '^Figures'`", ""});
  return rows;
}

}  // namespace abbe::figures
