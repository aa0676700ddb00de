#include "sim/study/configuration.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "cutting/map/areal_filter.h"
#include "cutting/map/form.h"
#include "cutting/map/residual.h"
#include "errors/coefficients.h"
#include "errors/identification/model.h"
#include "kinematics/units.h"
#include "sim/cut/part_regions.h"
#include "sim/cut/placement.h"
#include "sim/machine/run_out.h"
#include "sim/machine/truth.h"
#include "sim/report/verdict.h"
#include "sim/scene/read_scene.h"
#include "sim/scene/scene.h"
#include "sim/scene/table_reader.h"
#include "sim/scene/toml.h"
#include "sim/scene/value_warnings.h"
#include "sim/study/study_inputs.h"

namespace abbe::sim::study {

namespace {

// P99 of fewer cases is interpolated between the two largest, P95 among the largest six.
constexpr std::uint64_t min_cases_for_quantiles = 100;
// Limit for a factor of an element: machines of one kind differ by a few times their typical error
// at most.
constexpr double max_plausible_factor = 5.0;
// A factor of 7 for one standard deviation: no property of a machine is so uncertain.
constexpr double max_plausible_logarithm = 2.0;
// Limit for a length: no machine and no tool is known to 20 nm.
constexpr double finest_mm = 2e-5;
constexpr double widest_tool_mm = 1.0;  // as for the actual sizes of tools in value_warnings.cpp
constexpr double min_left = 0.2;        // of a standard deviation, between `low` and `high`
// Distances in spreads: a normal distribution has one case in 370 beyond 3 and one in 1e23 beyond
// 10.
constexpr double farthest_centre = 3.0, farthest_sweep = 10.0;

/// Returns the path "errors.EXX.0.coefficients_um.1" without its indices:
/// "errors.EXX.coefficients_um".
std::string path_without_indices(const std::string& path) {
  std::string key;
  for (std::size_t at = 0; at <= path.size();) {
    const std::size_t dot = std::min(path.find('.', at), path.size());
    const std::string part = path.substr(at, dot - at);
    if (!std::ranges::all_of(part, [](unsigned char c) { return std::isdigit(c) != 0; }))
      key += (key.empty() ? "" : ".") + part;
    at = dot + 1;
  }
  return key;
}

/// Returns the probable mistake in a spread of an element's coefficient; um and urad are judged
/// like those of a clamping.
std::string unit_mistake_text(const std::string& unit, double spread) {
  return probable_mistake("setup.EX_" + unit, spread);
}

/// Returns the probable mistake in a spread of the number at a key.
/// @param centre  of that number
std::string spread_mistake_text(const std::string& key, double centre, double spread) {
  const std::string unit = unit_name(key);
  const bool of_machine = key.starts_with("errors.") || key.starts_with("setup.");
  if (of_machine && (unit == "um" || unit == "urad")) return unit_mistake_text(unit, spread);
  if (key.ends_with("_C")) return probable_mistake(key, spread);
  if (key.ends_with("scale") && spread > max_plausible_factor) return "percent";
  if (unit != "mm") return {};
  if (spread < finest_mm) return "m";
  if (centre != 0.0 && spread >= std::abs(centre)) return "um, as it is as large as its centre";
  return key.starts_with("tool.actual.") && spread > widest_tool_mm ? "um" : "";
}

/// Returns true if the belief, and not the study, states the uncertainty of a number.
bool is_in_belief(const std::string& number, const Study& study, const Scene& scene) {
  const errors::GeometricErrors& belief = scene.geometric;
  const auto is_same_number = [&](const errors::Coefficient& one) {
    return errors::name_of(one, belief.elements) == number;
  };
  return std::ranges::any_of(belief.covariance.of, is_same_number) ||
         std::ranges::find(study.unidentified, number, &Unidentified::number) !=
             study.unidentified.end();
}

std::string spread_mistake_text(const Input& input) {
  const Distribution& d = input.distribution;
  if (d.kind == Distribution::Kind::LogNormal)
    return d.spread > max_plausible_logarithm
               ? "one in the unit of the path or in percent, and it is of "
                 "the logarithm"
               : "";
  if (!input.element.empty()) return d.spread > max_plausible_factor ? "percent" : "";
  if (!input.number.empty()) return unit_mistake_text(input.unit, d.spread);
  for (const Setting& setting : input.settings)
    if (std::string mistake =
            spread_mistake_text(path_without_indices(setting.path), setting.factor * d.centre,
                                std::abs(setting.factor) * d.spread);
        !mistake.empty())
      return mistake;
  return {};
}

std::string value_text(const Input& input, double value) {
  return fmt::format("{:.6g}{}{}", value, input.unit.empty() ? "" : " ", input.unit);
}

/// Returns the distance of two values in spreads of a distribution.
double spreads_between(const Distribution& d, double from, double to) {
  if (d.kind != Distribution::Kind::LogNormal) return std::abs(to - from) / d.spread;
  return from > 0.0 && to > 0.0 ? std::abs(std::log(to / from)) / d.spread : infinity;
}

void add_spread(const Input& input, std::vector<std::string>& warnings) {
  const Distribution& d = input.distribution;
  if (const std::string mistake = spread_mistake_text(input); !mistake.empty())
    warnings.push_back(fmt::format("the spread of input \"{}\" is {}: looks like {}", input.name,
                                   value_text(input, d.spread), mistake));
  Distribution uncut = d;
  uncut.low = -infinity;
  uncut.high = infinity;
  const double stated = moments(uncut).standard_deviation, left = moments(d).standard_deviation;
  if (left < min_left * stated)
    warnings.push_back(fmt::format(
        "low and high of input \"{}\" leave a standard deviation of {}, and its spread makes {}: "
        "they are in the unit of its centre, neither multiples of the spread nor differences",
        input.name, value_text(input, left), value_text(input, stated)));
}

/// Warns of a centre that differs from the scene: the base machine of a study has every input at
/// its centre, so it should be the machine of the scene.
void add_centre(const Input& input, const Scene& scene, std::vector<std::string>& warnings) {
  const Distribution& d = input.distribution;
  for (const Setting& setting : input.settings) {
    const std::optional<double> number = scene_number(scene, setting.path);
    if (!number || setting.factor == 0.0) continue;
    const double stated = *number / setting.factor;
    const double apart = spreads_between(d, d.centre, stated);
    if (apart <= farthest_centre) continue;
    warnings.push_back(fmt::format(
        "the centre of input \"{}\" is {}, {:.3g} spreads from the {} that the scene states: the "
        "study's machine is another one than the scene's",
        input.name, value_text(input, d.centre), apart, value_text(input, stated)));
    return;
  }
}

/// Returns the element of the errors that an input changes, such as "EC0Y"; empty if it changes
/// none.
std::string element_of(const Input& input) {
  if (!input.element.empty()) return input.element;
  if (!input.number.empty()) return errors::identification::element_of_number(input.number);
  if (input.settings.empty()) return {};
  const std::string path = path_without_indices(input.settings.front().path), root = "errors.";
  if (!path.starts_with(root)) return {};
  const std::string name = path.substr(root.size(), path.find('.', root.size()) - root.size());
  return std::string(key_stem(name));
}

/// Warns of an element whose factor and coefficient are both inputs: its error counts twice.
void add_shared_elements(const Study& study, std::vector<std::string>& warnings) {
  std::map<std::string, std::string> factors;
  for (const Input& input : study.inputs)
    if (!input.element.empty()) factors.emplace(input.element, input.name);
  for (const Input& input : study.inputs) {
    if (!input.element.empty()) continue;
    const auto factor = factors.find(element_of(input));
    if (factor != factors.end())
      warnings.push_back(
          fmt::format("inputs \"{}\" and \"{}\" both change {}: its error counts twice", input.name,
                      factor->second, factor->first));
  }
}

void add_sweep(const Study& study, const Sweep& sweep, std::vector<std::string>& warnings) {
  const Input& input = study.inputs[std::size_t(sweep.input)];
  const Distribution& d = input.distribution;
  double farthest = d.centre;
  for (const double value : sweep.values)
    if (spreads_between(d, d.centre, value) > spreads_between(d, d.centre, farthest))
      farthest = value;
  if (spreads_between(d, d.centre, farthest) > farthest_sweep)
    warnings.push_back(fmt::format(
        "the sweep of input \"{}\" goes to {}, {:.3g} spreads from its centre {}: its values are "
        "those of the input itself",
        input.name, value_text(input, farthest), spreads_between(d, d.centre, farthest),
        value_text(input, d.centre)));
}

}  // namespace

std::vector<std::string> study_warnings(const Study& study, const Scene& scene) {
  std::vector<std::string> warnings;
  for (const Input& input : study.inputs) {
    if (!is_in_belief(input.number, study, scene)) add_spread(input, warnings);
    add_centre(input, scene, warnings);
  }
  add_shared_elements(study, warnings);
  for (const Sweep& sweep : study.sweeps) add_sweep(study, sweep, warnings);
  // The text is the study as understood, so its line numbers are not those of the file.
  for (std::string& text : value_warnings(parse_toml(study.text, "")))
    warnings.push_back(std::move(text));
  if (study.monte_carlo && study.monte_carlo->cases < min_cases_for_quantiles)
    warnings.push_back(fmt::format(
        "monte_carlo.cases is {}: P95 and P99 of fewer than {} machines are extremes of a few",
        study.monte_carlo->cases, min_cases_for_quantiles));
  return warnings;
}

namespace {

/// Returns true if the commands of the control depend on the input.
bool changes_commands(const Input& input) {
  return std::any_of(input.settings.begin(), input.settings.end(), [](const Setting& one) {
    for (const char* key : {"datum", "control", "belief", "compensation", "signals"})
      if (one.path.starts_with(key)) return true;
    return false;
  });
}

bool depend_on_inputs(const Study& study, const Configuration& arm, const Scene& scene) {
  if (scene.datum.kind != DatumDescription::Kind::None) return true;
  if (std::any_of(study.inputs.begin(), study.inputs.end(), changes_commands)) return true;
  if (arm.case_name == "uncompensated") return false;
  // Any belief other than an identified one is made from readings of the machine as it is.
  const CaseDescription compensator = parse_case(arm.case_name);
  return !compensator.plug_in.empty() || compensator.belief != CaseDescription::Belief::Identified;
}

/// Returns true if larger values of the input need denser samples of the program.
bool needs_samples(const Input& input) {
  return input.settings.empty() ||
         std::any_of(input.settings.begin(), input.settings.end(), [](const Setting& one) {
           return one.path.starts_with("errors.") || one.path.starts_with("vibration");
         });
}

/// Returns the values of the inputs that need the densest sampling: those of `needs_samples` at the
/// extreme of their sweeps or at 6 standard deviations, beyond which lie 2 in 10^9 machines; the
/// others at their centres.
Eigen::VectorXd wildest(const Study& study) {
  constexpr double far = 6.0;
  Eigen::VectorXd x = centre(study);
  const auto reach = [&](Eigen::Index input, double value) {
    if (std::abs(value) > std::abs(x[input])) x[input] = value;
  };
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Input& input = study.inputs[std::size_t(i)];
    if (!needs_samples(input)) continue;
    for (const double score : {-far, far}) reach(i, value_at_score(input.distribution, score));
    for (const Sweep& sweep : study.sweeps)
      if (sweep.input == i)
        for (const double value : sweep.values) reach(i, value);
  }
  return x;
}

/// Returns the scene whose errors need the densest samples; empty if that machine is not valid.
std::optional<Scene> extreme_scene(const Study& study, const Configuration& arm,
                                   const Scene& base) {
  try {
    return with_run_out(scene_at(study, arm, base, wildest(study)));
  } catch (const BadScene&) {
    return std::nullopt;
  } catch (const BadInput&) {
    return std::nullopt;
  }
}

/// Returns the job with all inputs at their centres, sampled densely enough for all their values.
/// One sampling for all machines makes their samples comparable and saves compiling each.
Job prepared(const Study& study, const Configuration& arm, const Scene& base,
             const Progress& progress) {
  const Scene scene = with_run_out(scene_at(study, arm, base, centre(study)));
  const std::optional<Scene> wild = extreme_scene(study, arm, base);
  if (!wild) return prepare(scene, progress);
  const program::SampleOptions enough = sample_options(scene, compile(scene));
  const program::SampleOptions most = sample_options(*wild, compile(*wild));
  const bool denser =
      most.max_spindle_turn < enough.max_spindle_turn || most.max_nose_turn != enough.max_nose_turn;
  return denser ? replace_errors(prepare(*wild, progress), scene) : prepare(scene, progress);
}

/// Figures of one map.
struct MapFigures {
  cutting::Statistics residual;
  std::optional<FormTextureSplit> parted;  ///< only if a response needs the filter
};

double value_of(const MapFigures& figures, Response response) {
  const cutting::Statistics& s = figures.residual;
  const auto of_form = [&](std::optional<double> cutting::Statistics::*figure) {
    return figures.parted ? (figures.parted->form.*figure).value_or(none) : none;
  };
  const auto of_texture = [&](double errors::metrology::Areal::*figure) {
    const bool has = figures.parted && figures.parted->texture;
    return has ? (*figures.parted->texture).*figure : none;
  };
  switch (response) {
    case Response::Pv:
      return s.pv.value_or(none);
    case Response::Rms:
      return s.rms.value_or(none);
    case Response::Mean:
      return s.mean.value_or(none);
    case Response::Std:
      return s.std_dev.value_or(none);
    case Response::MaxAbs:
      return s.max ? std::max(std::abs(*s.min), std::abs(*s.max)) : none;
    case Response::P95Abs:
      return s.p95_abs.value_or(none);
    case Response::InTolerance:
      return s.conformance ? s.conformance->in : none;
    case Response::FormPv:
      return of_form(&cutting::Statistics::pv);
    case Response::FormRms:
      return of_form(&cutting::Statistics::rms);
    case Response::TextureSa:
      return of_texture(&errors::metrology::Areal::Sa);
    case Response::TextureSq:
      return of_texture(&errors::metrology::Areal::Sq);
    case Response::TextureSz:
      return of_texture(&errors::metrology::Areal::Sz);
  }
  return none;
}

}  // namespace

Commands commands(const Configuration& arm, const Job& job) {
  return arm.case_name == "uncompensated" ? uncompensated_commands(job)
                                          : compensate(job, parse_case(arm.case_name));
}

namespace {

bool needs_filter(const Study& study) {
  return std::any_of(study.responses.begin(), study.responses.end(), is_filtered);
}

/// Returns a warning if form and texture are requested and the vertices do not resolve the map with
/// every input at its centre; else empty.
std::string unresolved_texture(const PreparedConfiguration& ready) {
  // Fraction of Sq that interpolation between vertices may miss; in squares it changes Sq by 0.1 %.
  constexpr double resolved = 0.05;
  Job looked = ready.job;
  // A sampled surface makes the cut compare the map with points between the vertices.
  looked.sampled = SampledSurface{};
  looked.sampled->given = looked.design_w.vertices.rows();
  const Cut made = cut(looked, ready.commanded);
  const FormTextureSplit parted = split_form_texture(ready.job, made.surface, {});
  if (!made.interpolation || made.interpolation->places == 0 || !parted.texture) return {};
  const double missed = made.interpolation->rms, Sq = parted.texture->Sq;
  if (missed <= resolved * Sq) return {};
  const auto n = double(ready.job.design_w.vertices.rows());
  const double area = ready.job.design_w.area.sum(), spacing = std::sqrt(area / n);
  // The area of the filter holds at least the vertex itself. The missed part averages out over its
  // vertices as independent values do.
  const double by_chance =
      missed /
      std::sqrt(std::max(1.0, cutting::filter_values(ready.job.scene.part.form_cutoff, n / area)));
  return fmt::format(
      "form and texture are judged at the part's {} vertices as loaded, about {:.3g} mm apart: "
      "between them the surface of {} is {:.3g} um RMS off a straight line ({:.3g} um at most), "
      "where texture has Sq {:.3g} um: texture figures are not resolved, and form figures are off "
      "by about {:.2g} um by chance; raise part.vertices",
      ready.job.design_w.vertices.rows(), spacing, ready.arm.name, missed / units::um,
      made.interpolation->worst / units::um, Sq / units::um, by_chance / units::um);
}

}  // namespace

PreparedConfiguration prepare_configuration(const Study& study, const Configuration& arm,
                                            const Progress& progress) {
  Scene scene = scene_of(study, arm);
  Job job = placed(prepared(study, arm, scene, progress));
  Commands commanded = commands(arm, job);
  const bool for_each = depend_on_inputs(study, arm, scene);
  cutting::Surface error_free;
  if (study.machine_part) error_free = cut_error_free(job, progress).surface;
  PreparedConfiguration ready{arm,      std::move(scene),     std::move(job), std::move(commanded),
                              for_each, std::move(error_free)};
  if (needs_filter(study))
    if (const std::string text = unresolved_texture(ready); !text.empty())
      ready.job.warnings.push_back(text);
  for (std::string& text : study_warnings(study, ready.scene))
    ready.job.warnings.push_back(std::move(text));
  return ready;
}

Tried cut_at(const Study& study, const PreparedConfiguration& ready, Job job,
             const Eigen::VectorXd& x) {
  const Scene scene = scene_at(study, ready.arm, ready.scene, x);
  // A case that changes part, program or nominal machine shares nothing with the prepared job.
  if (std::any_of(study.inputs.begin(), study.inputs.end(), is_reshaping)) {
    const Job own = prepare(scene);
    Cut made = cut(own, commands(ready.arm, own));
    cutting::Surface error_free;
    if (study.machine_part) error_free = cut_error_free(own).surface;
    Eigen::VectorXd values = responses(study, own, made.surface, error_free);
    return {std::move(job), std::move(made.surface), std::move(values)};
  }
  job = replace_errors(std::move(job), scene);
  Cut made =
      ready.commanded_for_each ? cut(job, commands(ready.arm, job)) : cut(job, ready.commanded);
  Eigen::VectorXd values = responses(study, job, made.surface, ready.error_free);
  return {std::move(job), std::move(made.surface), std::move(values)};
}

Eigen::VectorXd responses(const Study& study, const Job& job, const cutting::Surface& surface,
                          const cutting::Surface& error_free) {
  const auto aligned = [&](const cutting::Surface& one) {
    return cutting::aligned(one, job.design_w, {job.scene.alignment}).surface;
  };
  cutting::Surface judged = aligned(surface);
  if (study.machine_part) judged = cutting::minus(judged, aligned(error_free));
  MapFigures figures{
      cutting::statistics(judged, job.design_w,
                          tolerance_bands(job.scene.part, job.face_groups, job.design_w)),
      {}};
  if (needs_filter(study)) figures.parted = split_form_texture(job, judged, {});
  Eigen::VectorXd values(Eigen::Index(study.responses.size()));
  for (std::size_t i = 0; i < study.responses.size(); ++i)
    values[Eigen::Index(i)] = value_of(figures, study.responses[i]);
  return values;
}

}  // namespace abbe::sim::study
