#include "sim/study/arm.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "cutting/alignment.h"
#include "cutting/areal_filter.h"
#include "cutting/residual.h"
#include "kinematics/numbers.h"
#include "kinematics/units.h"
#include "sim/cut/reach.h"
#include "sim/cut/tolerance_bands.h"
#include "sim/machine/compile.h"
#include "sim/machine/run_out.h"
#include "sim/report/form_texture.h"
#include "sim/scene/read_scene.h"
#include "sim/study/study_warnings.h"

namespace abbe::sim::study {
namespace {

bool changes_commands(const Input& input) {
  return std::any_of(input.settings.begin(), input.settings.end(), [](const Setting& one) {
    for (const char* key : {"datum", "control", "belief", "compensation", "signals"})
      if (one.path.starts_with(key)) return true;
    return false;
  });
}

bool depend_on_inputs(const Study& study, const Arm& arm, const Scene& scene) {
  if (scene.datum.kind != DatumDescription::Kind::None) return true;
  if (std::any_of(study.inputs.begin(), study.inputs.end(), changes_commands)) return true;
  if (arm.case_name == "uncompensated") return false;
  // any other belief is made from what is read of the machine as it is
  const CaseDescription compensator = parse_case(arm.case_name);
  return !compensator.plug_in.empty() || compensator.belief != CaseDescription::Belief::Identified;
}

bool wants_samples(const Input& input) {
  return input.settings.empty() ||
         std::any_of(input.settings.begin(), input.settings.end(), [](const Setting& one) {
           return one.path.starts_with("errors.") || one.path.starts_with("vibration");
         });
}

/// The inputs that say how densely a program is sampled as far from zero as a sweep or one in 10^9
/// machines has them, the others at their centres.
Eigen::VectorXd wildest(const Study& study) {
  constexpr double far = 6.0;
  Eigen::VectorXd x = centre(study);
  const auto reach = [&](Eigen::Index input, double value) {
    if (std::abs(value) > std::abs(x[input])) x[input] = value;
  };
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Input& input = study.inputs[std::size_t(i)];
    if (!wants_samples(input)) continue;
    for (const double score : {-far, far}) reach(i, at_score(input.distribution, score));
    for (const Sweep& sweep : study.sweeps)
      if (sweep.input == i)
        for (const double value : sweep.values) reach(i, value);
  }
  return x;
}

/// The scene whose errors want the densest samples; none if that machine cannot be.
std::optional<Scene> wildest_scene(const Study& study, const Arm& arm, const Scene& base) {
  try {
    return with_run_out(scene_at(study, arm, base, wildest(study)));
  } catch (const BadScene&) {
    return std::nullopt;
  } catch (const BadInput&) {
    return std::nullopt;
  }
}

/// The job with all inputs at their centres, sampled so densely that it serves them all.
Job prepared(const Study& study, const Arm& arm, const Scene& base, const Progress& progress) {
  const Scene scene = with_run_out(scene_at(study, arm, base, centre(study)));
  const std::optional<Scene> wild = wildest_scene(study, arm, base);
  if (!wild) return prepare(scene, progress);
  const program::SampleOptions enough = sample_options(scene, compile(scene));
  const program::SampleOptions most = sample_options(*wild, compile(*wild));
  const bool denser =
      most.max_spindle_turn < enough.max_spindle_turn || most.max_nose_turn != enough.max_nose_turn;
  return denser ? with_errors(prepare(*wild, progress), scene) : prepare(scene, progress);
}

/// What a map comes to, in figures.
struct MapFigures {
  cutting::Statistics residual;
  std::optional<FormAndTexture> parted;  ///< where a response asks for it
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

Commands commands(const Arm& arm, const Job& job) {
  return arm.case_name == "uncompensated" ? as_programmed(job)
                                          : compensate(job, parse_case(arm.case_name));
}

namespace {

bool asks_to_filter(const Study& study) {
  return std::any_of(study.responses.begin(), study.responses.end(), is_filtered);
}

/// What is to be said where form and texture are asked of vertices that do not resolve the map with
/// every input at its centre; empty where they do.
std::string unresolved_texture(const ReadyArm& ready) {
  constexpr double resolved = 0.05;  // of Sq that interpolation may miss
  Job looked = ready.job;
  looked.sampled = SampledSurface{};  // so that the cut is looked at between the vertices
  looked.sampled->given = looked.design_w.vertices.rows();
  const Cut made = cut(looked, ready.commanded);
  const FormAndTexture parted = form_and_texture(ready.job, made.surface, {});
  if (!made.interpolation || made.interpolation->places == 0 || !parted.texture) return {};
  const double missed = made.interpolation->rms, Sq = parted.texture->Sq;
  if (missed <= resolved * Sq) return {};
  const auto n = double(ready.job.design_w.vertices.rows());
  const double area = ready.job.design_w.area.sum(), spacing = std::sqrt(area / n);
  // of at least the vertex itself
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

ReadyArm ready_arm(const Study& study, const Arm& arm, const Progress& progress) {
  Scene scene = scene_of(study, arm);
  Job job = placed(prepared(study, arm, scene, progress));
  Commands commanded = commands(arm, job);
  const bool for_each = depend_on_inputs(study, arm, scene);
  cutting::Surface error_free;
  if (study.machine_part) error_free = cut_error_free(job, progress).surface;
  ReadyArm ready{arm,      std::move(scene),     std::move(job), std::move(commanded),
                 for_each, std::move(error_free)};
  if (asks_to_filter(study))
    if (const std::string text = unresolved_texture(ready); !text.empty())
      ready.job.warnings.push_back(text);
  for (std::string& text : study_warnings(study, ready.scene))
    ready.job.warnings.push_back(std::move(text));
  return ready;
}

Tried cut_at(const Study& study, const ReadyArm& ready, Job job, const Eigen::VectorXd& x) {
  const Scene scene = scene_at(study, ready.arm, ready.scene, x);
  if (std::any_of(study.inputs.begin(), study.inputs.end(), reshapes)) {
    const Job own = prepare(scene);
    Cut made = cut(own, commands(ready.arm, own));
    cutting::Surface error_free;
    if (study.machine_part) error_free = cut_error_free(own).surface;
    Eigen::VectorXd values = responses(study, own, made.surface, error_free);
    return {std::move(job), std::move(made.surface), std::move(values)};
  }
  job = with_errors(std::move(job), scene);
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
  if (asks_to_filter(study)) figures.parted = form_and_texture(job, judged, {});
  Eigen::VectorXd values(Eigen::Index(study.responses.size()));
  for (std::size_t i = 0; i < study.responses.size(); ++i)
    values[Eigen::Index(i)] = value_of(figures, study.responses[i]);
  return values;
}

}  // namespace abbe::sim::study
