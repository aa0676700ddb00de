#include "sim/loop/beliefs.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "sim/measure/measure.h"
#include "sim/scene/read_scene.h"

namespace abbe::sim {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using kinematics::AxisState;
using Kind = CaseDescription::Belief;

constexpr double history_interval_s = 60.0;

/// Whether a control can read that column of the signals.
bool readable(const Scene& scene, const std::string& column) {
  if (column == "spindle_rpm" || column == "current_A") return true;
  if (column.ends_with("_encoder_mm") || column.ends_with("_encoder_deg") ||
      column.ends_with("_dynamometer_N"))
    return true;
  if (!scene.thermal) return false;
  const auto& sensors = scene.thermal->sensors;
  return std::any_of(sensors.begin(), sensors.end(),
                     [&](const auto& sensor) { return column == sensor.name + "_C"; });
}

errors::Load foreseen_load(const Job& job, const Foreseen& run, double time_s) {
  errors::Load load = load_at(run.process, time_s);
  if (run.accelerations.empty()) return load;
  const auto& states = job.samples.states;
  const auto after =
      std::lower_bound(states.begin(), states.end(), time_s,
                       [](const AxisState& state, double time) { return state.time_s < time; });
  load.acceleration =
      run.accelerations[std::min(std::size_t(after - states.begin()), states.size() - 1)];
  return load;
}

[[noreturn]] void refuse(const Scene& scene, const std::string& expected, const std::string& seen) {
  throw BadInput(scene.file.string(), 0, 0, expected, seen);
}

bool gives(const BeliefDescription& belief, Kind kind) {
  switch (kind) {
    case Kind::Identified:
      return belief.identified.has_value();
    case Kind::Thermal:
      return belief.thermal.has_value();
    case Kind::Force:
      return belief.force.has_value();
    case Kind::Part:
      return belief.part.has_value();
    default:
      return false;
  }
}

void add_force(compensation::MachineBelief& belief, const Job& job, const Evidence& evidence) {
  using From = BeliefDescription::Force::From;
  const BeliefDescription::Force& force = *job.scene.belief.force;
  if (force.from == From::Current) {
    if (evidence.law) belief.bending = compensation::bending(*evidence.law, evidence.log);
    return;
  }
  compensation::LoadCourse load;
  if (force.from == From::Model)
    load = evidence.model_load.value_or(compensation::LoadCourse{});
  else
    load = compensation::load_of_dynamometer(evidence.log, force.smoothing_s);
  belief.force = {errors::bind(force.compliance, job.machine.control), std::move(load)};
}

/// Row of the vertex nearest to a point.
Index nearest(const cutting::Points& vertices, const Eigen::RowVector3d& point) {
  Index row = 0;
  (vertices.rowwise() - point).rowwise().squaredNorm().minCoeff(&row);
  return row;
}

/// Number of rapids before each instant: what was cut between two of them is one pass.
Eigen::VectorXi passes_at(const program::Path& path, const VectorXd& time_s) {
  std::vector<double> rapids_s;
  for (const program::Block& block : path.blocks)
    if (block.interpolation == program::Interpolation::Rapid) rapids_s.push_back(block.end_s);
  return time_s.unaryExpr([&](double t) {
    return int(std::upper_bound(rapids_s.begin(), rapids_s.end(), t) - rapids_s.begin());
  });
}

/// Rotation of the workpiece's carriage against its place with the spindle at zero.
Eigen::Matrix3d turned_by_spindle(const Job& job, double time_s) {
  const int spindle = *job.machine.workpiece_spindle;
  const auto& states = job.samples.states;
  const auto after =
      std::lower_bound(states.begin(), states.end(), time_s,
                       [](const AxisState& state, double time) { return state.time_s < time; });
  const std::size_t i = std::min(std::size_t(after - states.begin()), states.size() - 1);
  kinematics::AxisVector q = states[i].q;
  if (i > 0 && states[i].time_s > states[i - 1].time_s) {
    const double u = (time_s - states[i - 1].time_s) / (states[i].time_s - states[i - 1].time_s);
    q = states[i - 1].q + u * (states[i].q - states[i - 1].q);
  }
  const Eigen::Matrix3d R_now = job.machine.nominal.workpiece_in_bed(q).linear();
  q[spindle] = 0.0;
  return job.machine.nominal.workpiece_in_bed(q).linear().transpose() * R_now;
}

}  // namespace

bool believes(const Scene& scene, Kind belief, Kind kind) {
  if (belief == Kind::Fused) return gives(scene.belief, kind);
  if (belief == Kind::Composite) return kind == Kind::Identified || kind == Kind::Thermal;
  return belief == kind;
}

compensation::ControlLog control_log(const Job& job, const Compensated& told,
                                     const Process& process) {
  Scene scene = job.scene;
  // what a scene asks to be reported does not change what a control reads
  if (!(scene.signals.history_interval > 0.0 &&
        scene.signals.history_interval < history_interval_s))
    scene.signals.history_interval = history_interval_s;
  std::vector<errors::Load> loads;
  const auto& T_wt = told.T_wt_nominal.empty() ? job.T_wt_nominal : told.T_wt_nominal;
  const Signals all = signals(scene, job.machine, job.truth, {told.samples, T_wt, process, loads});
  compensation::ControlLog log;
  std::vector<Index> columns;
  for (std::size_t k = 0; k < all.columns.size(); ++k) {
    if (all.columns[k] == "time_s") log.time_s = all.rows.col(Index(k));
    if (!readable(job.scene, all.columns[k])) continue;
    // a sensor called like a node's column stands after it
    if (const auto twin = std::find(log.names.begin(), log.names.end(), all.columns[k]);
        twin != log.names.end()) {
      columns[std::size_t(twin - log.names.begin())] = Index(k);
      continue;
    }
    log.names.push_back(all.columns[k]);
    columns.push_back(Index(k));
  }
  log.values = all.rows(Eigen::all, columns);
  return log;
}

compensation::Belief perfect_belief(const Job& job, Foreseen run) {
  return [known = without_random(job.truth), &job, run = std::move(run)](const AxisState& state) {
    return tool_in_workpiece(known, state, foreseen_load(job, run, state.time_s));
  };
}

compensation::MachineBelief machine_belief(const Job& job, const CaseDescription& compensator,
                                           const Evidence& evidence) {
  const Scene& scene = job.scene;
  const BeliefDescription& given = scene.belief;
  const auto wants = [&](Kind kind, const char* section) {
    if (!believes(scene, compensator.belief, kind)) return false;
    if (!gives(given, kind))
      refuse(scene, fmt::format("{} in [belief] for the case {}", section, compensator.name),
             "none");
    return true;
  };
  compensation::MachineBelief belief{
      job.machine.control, job.machine.workpiece_spindle, {}, {}, {}, {}, {}};
  try {
    if (wants(Kind::Identified, "identified"))
      belief.geometric =
          errors::scaled(errors::bind(*given.identified, job.machine.control), given.scale);
    if (wants(Kind::Thermal, "thermal")) {
      belief.thermal = compensation::course_of(*given.thermal, evidence.log, job.machine.control);
      belief.thermal->value *= given.scale;
    }
    if (wants(Kind::Force, "force")) add_force(belief, job, evidence);
    if (wants(Kind::Part, "part")) belief.part = evidence.part;
  } catch (const std::invalid_argument& fault) {
    refuse(scene, "a belief that fits the machine and what it reads", fault.what());
  }
  if (!belief.geometric && !belief.thermal && !belief.force && !belief.bending && !belief.part &&
      compensator.belief == Kind::Fused && !given.part)
    refuse(scene, "something to believe in [belief] for the case " + compensator.name, "nothing");
  return belief;
}

compensation::CurrentLaw trained_law(const BeliefDescription::Force& force,
                                     const std::vector<std::filesystem::path>& trusted) {
  Scene scene = read_scene(force.training);
  scene.trusted = trusted;
  const auto instrument = part_instrument_of(scene, force.instrument);
  if (!instrument)
    refuse(scene, "an [[instrument]] that measures the part", "\"" + force.instrument + "\"");
  const Job job = prepare(scene);
  const Cut made = cut(job);
  const Eigen::VectorXd cut_time_s = cut_error_free(job).surface.cut_time_s;  // by the program
  const errors::metrology::PartReadings part = measured_part(job, made, *instrument).readings;
  compensation::CurrentTraining training{VectorXd(part.deviation.size()), part.deviation};
  for (Index i = 0; i < part.deviation.size(); ++i)
    training.time_s[i] = cut_time_s[nearest(job.design_w.vertices, part.points_w.row(i))];
  try {
    return compensation::fitted_law(control_log(job, as_programmed(job), made.process), training,
                                    force.smoothing_s);
  } catch (const std::invalid_argument& fault) {
    refuse(scene, "a part from which the current can be learnt", fault.what());
  }
}

Eigen::VectorXd left_by_program(const Job& job, const cutting::Surface& error_free,
                                const Eigen::MatrixX3d& points_w) {
  VectorXd left(points_w.rows());
  for (Index i = 0; i < left.size(); ++i) {
    const Index vertex = nearest(job.design_w.vertices, points_w.row(i));
    const bool is_cut = error_free.status[std::size_t(vertex)] == cutting::VertexStatus::Cut;
    left[i] = is_cut ? error_free.residual[vertex] : 0.0;
  }
  return left;
}

compensation::PartCourse course_of_part(const Job& job, const cutting::Surface& error_free,
                                        const VectorXd& total) {
  std::vector<Index> rows;
  for (std::size_t i = 0; i < error_free.status.size(); ++i)
    if (error_free.status[i] == cutting::VertexStatus::Cut) rows.push_back(Index(i));
  compensation::KnownPart part{job.design_w.normals(rows, Eigen::all), total(rows),
                               error_free.cut_time_s(rows),
                               passes_at(job.path, error_free.cut_time_s(rows))};
  if (job.machine.workpiece_spindle)
    for (Index i = 0; i < part.time_s.size(); ++i)
      part.normals.row(i) =
          part.normals.row(i) * turned_by_spindle(job, part.time_s[i]).transpose();
  return compensation::explained(part);
}

}  // namespace abbe::sim
