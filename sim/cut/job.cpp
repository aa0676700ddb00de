#include "sim/cut/job.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "kinematics/units.h"
#include "sim/cut/accelerations.h"
#include "sim/cut/activity.h"
#include "sim/cut/datum.h"
#include "sim/cut/follow.h"
#include "sim/cut/part.h"
#include "sim/cut/program_warnings.h"
#include "sim/cut/stopwatch.h"
#include "sim/cut/travel.h"
#include "sim/cut/work.h"
#include "sim/machine/compile.h"
#include "sim/machine/run_out.h"

namespace abbe::sim {
namespace {

using kinematics::Pose;

double shaping_height(const Scene& scene) {
  const auto* cutter = std::get_if<cutting::Cutter>(&scene.tool.nominal);
  if (cutter == nullptr) return 0.0;
  const bool flank =
      cutter->corner_radius == 0.0 || std::holds_alternative<program::Flank>(scene.program.source);
  return flank ? cutter->flank_length : cutter->radius;
}

/// Largest second derivative of the tip by the spindle angle that harmonics in that angle make,
/// mm/rad^2: of spindle error motion where the spindle turns the workpiece, of vibration on any.
double spindle_bend(const Scene& scene, const Machine& machine) {
  constexpr double lever = 100.0;  // mm, for tilts
  const auto size = [](const errors::ElementName& name) { return name.is_angle() ? lever : 1.0; };
  double bend = 0.0;
  for (const errors::Element& element : scene.geometric.elements) {
    if (element.name.axis != 'S' || !machine.workpiece_spindle) continue;
    for (const errors::Curve& curve : element.curves)
      bend += size(element.name) * scene.error_scale * errors::most_bend(curve);
  }
  for (const errors::Vibration& vibration : scene.vibrations) {
    double speed = vibration.reference_speed;
    if (vibration.resonance) speed = std::max(speed, *vibration.resonance / vibration.order);
    bend += size(vibration.name) * vibration.order * vibration.order *
            std::abs(errors::amplitude(vibration, speed));
  }
  return bend;
}

/// Refuses a finite-element field that does not lie on the part: another mesh, unit or place.
void check_field(const Scene& scene, const cutting::Design& design_w) {
  if (!scene.compliance || !scene.compliance->workpiece) return;
  const auto* field = std::get_if<errors::WorkpieceField>(&*scene.compliance->workpiece);
  if (field == nullptr) return;
  const auto size = [](const cutting::Points& points) {
    return (points.colwise().maxCoeff() - points.colwise().minCoeff()).norm();
  };
  const auto refuse = [&](const std::string& expected, const std::string& seen) {
    throw BadInput(scene.file.string(), 0, 0, "a compliance field on this part: " + expected, seen);
  };
  // on a square grid the farthest place is 0.71 spacings from a node
  const double allowed = 1.5 * errors::node_spacing(*field);
  const double far = errors::coverage(*field, design_w.vertices);
  if (far > allowed)
    refuse(fmt::format("a node within {:.3g} mm of every vertex, 1.5 of its spacings", allowed),
           fmt::format("a vertex {:.4g} mm from the nearest node", far));
  if (size(field->points_w) > 4 * size(design_w.vertices))
    refuse(fmt::format("nodes over at most {:.4g} mm, four times the part",
                       4 * size(design_w.vertices)),
           fmt::format("nodes over {:.4g} mm", size(field->points_w)));
}

/// Whether samples made with `had` are as dense as `wanted` ones along the turns of spindles, which
/// is all that errors ask of them.
bool is_as_dense(const program::SampleOptions& had, const program::SampleOptions& wanted) {
  if (had.max_spindle_turn > wanted.max_spindle_turn) return false;
  return !wanted.max_nose_turn ||
         (had.max_nose_turn && *had.max_nose_turn <= *wanted.max_nose_turn);
}

}  // namespace

program::SampleOptions sample_options(const Scene& scene, const Machine& machine) {
  program::SampleOptions options;
  options.chord_tolerance = scene.chord_tolerance;
  options.max_step = scene.max_step;
  options.max_axis_step = scene.max_step;
  options.workpiece_spindle = machine.workpiece_spindle;
  options.reach = shaping_height(scene);
  const double bend = spindle_bend(scene, machine);
  if (bend > 0.0) {
    // a chord over an angle leaves bend angle^2 / 8
    const double turn = std::sqrt(8 * scene.chord_tolerance / bend);
    options.max_spindle_turn = std::min(options.max_spindle_turn, turn);
    if (!scene.vibrations.empty()) options.max_nose_turn = turn;
  }
  return options;
}

namespace {

/// The samples of a program; too many are refused at what makes them so many.
program::Samples sampled(const Scene& scene, const program::Path& path, const Machine& machine,
                         program::SampleOptions options) {
  options.max_samples = most_samples();
  try {
    return program::sample(path, machine.nominal, options);
  } catch (const program::TooManySamples& fault) {
    throw refusal_at(scene,
                     {"sampling.max_step_mm", "sampling.chord_tolerance_nm", "program.step_over_mm",
                      "program.step_mm", "program.feed_um_per_rev"},
                     fmt::format("at most {} samples of the program, which the memory holds",
                                 options.max_samples),
                     fmt::format("more, from line {} of {} on", fault.line, path.file));
  }
}

}  // namespace

Job prepare(const Scene& described, const Progress& progress) {
  Stopwatch watch;
  const Scene scene = with_run_out(described);
  Machine machine = compile(scene);
  Part part = load_part(scene);
  const double part_s = watch.lap();
  const Work work = work_of(scene, part);
  check_work(scene, work);
  if (const std::string text = remark(work); progress && !text.empty()) progress(text, -1.0);
  if (progress) progress("program", 0.0);
  Program program = load_program(scene, machine, part);
  const double program_s = watch.lap();
  const program::SampleOptions sampling = sample_options(scene, machine);
  program::Samples samples = sampled(scene, program.path, machine, sampling);
  std::vector<Pose> T_wt_nominal(samples.states.size());
  tbb::parallel_for(std::size_t(0), T_wt_nominal.size(), [&](std::size_t i) {
    T_wt_nominal[i] = machine.nominal.tool_in_workpiece(samples.states[i].q);
  });
  check_travel(machine, program.path, samples);
  std::vector<std::string> warnings =
      program_warnings(scene, part.design_w, program, {samples, T_wt_nominal});
  const double sample_s = watch.lap();
  check_field(scene, part.design_w);
  const auto rigid = [&](std::size_t i, const errors::Load&) { return T_wt_nominal[i]; };
  Process process =
      follow(scene, machine, part.design_m,
             {samples, program.path, T_wt_nominal, rigid, machine.nominal, scene.tool.nominal},
             [&](double fraction) {
               if (progress) progress("stock", fraction);
             });
  const double stock_s = watch.lap();
  Truth truth = truth_of(scene, machine, activity(scene, machine, samples, process));
  std::vector<kinematics::AxisVector> acceleration;
  if (scene.compliance && scene.compliance->inertia) acceleration = accelerations(samples);
  return {scene,
          std::move(machine),
          std::move(truth),
          std::move(part.design_w),
          std::move(program.path),
          sampling,
          std::move(samples),
          std::move(T_wt_nominal),
          std::move(process),
          std::move(acceleration),
          std::move(program.text),
          {{"part", part_s},
           {"program", program_s},
           {"sample", sample_s},
           {"stock", stock_s},
           {"heat", watch.lap()}},
          program.unreached,
          std::move(warnings)};
}

Job with_errors(Job job, const Scene& described) {
  Scene scene = with_run_out(described);
  Machine machine = compile(scene);
  const auto refuse = [&](bool differs, const char* what) {
    if (differs)
      throw BadInput(scene.file.string(), 0, 0, fmt::format("the {} of every other case", what),
                     "another one");
  };
  refuse(!same(machine.nominal, job.machine.nominal), "nominal machine");
  refuse(!is_as_dense(job.sampling, sample_options(scene, machine)), "density of samples");
  Truth truth =
      truth_of(scene, machine, activity(scene, machine, job.samples, job.nominal_process));
  job.scene = std::move(scene);
  job.machine = std::move(machine);
  job.truth = std::move(truth);
  return job;
}

Eigen::Vector3d found_datum(const Job& job, const Corrector& corrector) {
  const auto really_at = [&](const kinematics::AxisState& state) {
    return tool_in_workpiece(job.truth, state);
  };
  return datum_offset(job.scene.datum, job.machine, really_at, corrector);
}

Commands as_programmed(const Job& job) {
  return as_programmed(job.machine, job.path, job.samples, found_datum(job));
}

}  // namespace abbe::sim
