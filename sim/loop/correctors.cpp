#include "sim/loop/correctors.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "kinematics/units.h"
#include "sim/compensation/plug_in.h"
#include "sim/cut/tool_motion.h"
#include "sim/files/program_file.h"
#include "sim/files/progress.h"

namespace abbe::sim {

namespace {

using Eigen::Index;
using Eigen::VectorXd;
using Kind = CaseDescription::Belief;

[[noreturn]] void throw_input_error(const ControlView& view, const std::string& expected,
                                    const std::string& actual) {
  throw BadInput(view.file.string(), 0, 0, expected, actual);
}

/// Returns true if the scene has a belief of a kind.
bool has_belief(const BeliefDescription& belief, Kind kind) {
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

/// Adds the belief about force from its source: the current law, a model, or the dynamometer.
void add_force(compensation::MachineBelief& belief, const ControlView& view,
               const Evidence& evidence) {
  using ForceSource = BeliefDescription::Force::From;
  const BeliefDescription::Force& force = *view.belief.force;
  if (force.from == ForceSource::Current) {
    if (evidence.law)
      belief.current_deflection = compensation::current_deflection(*evidence.law, evidence.log);
    return;
  }
  compensation::LoadSeries load;
  if (force.from == ForceSource::Model)
    load = evidence.model_load.value_or(compensation::LoadSeries{});
  else
    load = compensation::dynamometer_load(evidence.log, force.smoothing_s);
  belief.force = {errors::bind(force.compliance, view.machine.control), std::move(load)};
}

/// Returns the number of rapids before each time. The motion between two rapids is one tool pass.
Eigen::VectorXi rapid_counts(const program::Path& path, const VectorXd& time_s) {
  std::vector<double> rapids_s;
  for (const program::Block& block : path.blocks)
    if (block.interpolation == program::Interpolation::Rapid) rapids_s.push_back(block.end_s);
  return time_s.unaryExpr([&](double t) {
    return int(std::upper_bound(rapids_s.begin(), rapids_s.end(), t) - rapids_s.begin());
  });
}

/// Returns the rotation of the workpiece by its spindle at a time, relative to the spindle at zero.
Eigen::Matrix3d spindle_rotation(const ControlView& view, double time_s) {
  const int spindle = *view.machine.workpiece_spindle;
  const auto& states = view.samples.states;
  const std::size_t i = sample_at(view.samples, time_s);
  kinematics::AxisVector q = states[i].q;
  if (i > 0 && states[i].time_s > states[i - 1].time_s) {
    const double u = (time_s - states[i - 1].time_s) / (states[i].time_s - states[i - 1].time_s);
    q = states[i - 1].q + u * (states[i].q - states[i - 1].q);
  }
  const Eigen::Matrix3d R_at_time = view.machine.nominal.workpiece_in_bed(q).linear();
  q[spindle] = 0.0;
  return view.machine.nominal.workpiece_in_bed(q).linear().transpose() * R_at_time;
}

}  // namespace

bool is_belief_enabled(const BeliefDescription& beliefs, Kind belief, Kind kind) {
  if (belief == Kind::Fused) return has_belief(beliefs, kind);
  if (belief == Kind::Composite) return kind == Kind::Identified || kind == Kind::Thermal;
  return belief == kind;
}

compensation::MachineBelief machine_belief(const ControlView& view,
                                           const CaseDescription& compensator,
                                           const Evidence& evidence) {
  const BeliefDescription& beliefs = view.belief;
  const auto uses_belief = [&](Kind kind, const char* section) {
    if (!is_belief_enabled(beliefs, compensator.belief, kind)) return false;
    if (!has_belief(beliefs, kind))
      throw_input_error(
          view, fmt::format("{} in [belief] for the case {}", section, compensator.name), "none");
    return true;
  };
  compensation::MachineBelief belief{
      view.machine.control, view.machine.workpiece_spindle, {}, {}, {}, {}, {}};
  try {
    // The kinds add up. A kind that the case names must be in the scene.
    if (uses_belief(Kind::Identified, "identified"))
      belief.geometric =
          errors::scaled(errors::bind(*beliefs.identified, view.machine.control), beliefs.scale);
    if (uses_belief(Kind::Thermal, "thermal")) {
      belief.thermal =
          compensation::thermal_series(*beliefs.thermal, evidence.log, view.machine.control);
      belief.thermal->value *= beliefs.scale;
    }
    if (uses_belief(Kind::Force, "force")) add_force(belief, view, evidence);
    if (uses_belief(Kind::Part, "part")) belief.part = evidence.part;
  } catch (const std::invalid_argument& exception) {
    throw_input_error(view, "a belief that matches the machine and its readings", exception.what());
  }
  // A fused belief contains all kinds that the scene has. It needs at least one.
  if (!belief.geometric && !belief.thermal && !belief.force && !belief.current_deflection &&
      !belief.part && compensator.belief == Kind::Fused && !beliefs.part)
    throw_input_error(view, "at least one belief in [belief] for the case " + compensator.name,
                      "nothing");
  return belief;
}

Index nearest_vertex(const cutting::Points& vertices, const Eigen::RowVector3d& point) {
  Index row = 0;
  (vertices.rowwise() - point).rowwise().squaredNorm().minCoeff(&row);
  return row;
}

Eigen::VectorXd program_residuals(const ControlView& view, const cutting::Surface& error_free,
                                  const Eigen::MatrixX3d& points_w) {
  VectorXd residuals(points_w.rows());
  for (Index i = 0; i < residuals.size(); ++i) {
    const Index vertex = nearest_vertex(view.design_w.vertices, points_w.row(i));
    const bool is_cut = error_free.status[std::size_t(vertex)] == cutting::VertexStatus::Cut;
    residuals[i] = is_cut ? error_free.residual[vertex] : 0.0;
  }
  return residuals;
}

compensation::DisplacementSeries part_series(const ControlView& view,
                                             const cutting::Surface& error_free,
                                             const VectorXd& total) {
  std::vector<Index> rows;
  for (std::size_t i = 0; i < error_free.status.size(); ++i)
    if (error_free.status[i] == cutting::VertexStatus::Cut) rows.push_back(Index(i));
  compensation::PartDeviations part{view.design_w.normals(rows, Eigen::all), total(rows),
                                    error_free.cut_time_s(rows),
                                    rapid_counts(view.path, error_free.cut_time_s(rows))};
  // Displacements of the tool are smooth in the bed frame, not on a rotating part.
  if (view.machine.workpiece_spindle)
    for (Index i = 0; i < part.time_s.size(); ++i)
      part.normals.row(i) =
          part.normals.row(i) * spindle_rotation(view, part.time_s[i]).transpose();
  return compensation::displacement_from_deviations(part);
}

namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

/// Returns the height above the tip, mm, of the point that a compensator restores: the centre of a
/// ball or of a corner.
double functional_height(const NominalTool& tool) {
  const auto* cutter = std::get_if<cutting::Cutter>(&tool.shape);
  return cutter != nullptr ? cutting::corner_height(*cutter) : 0.0;
}

/// Returns the options of the strategy, with the axes that a channel cannot move held still.
compensation::CorrectOptions correct_options(const ControlView& view,
                                             const CaseDescription& compensator) {
  compensation::CorrectOptions options;
  options.strategy = compensator.strategy;
  options.rotary_bound = view.compensation.rotary_bound;
  options.functional_height = functional_height(view.tool);
  using Channel = CaseDescription::Channel;
  // Origin shifts and a piezo act on slides only.
  const bool slides_only =
      compensator.channel == Channel::Origin || compensator.channel == Channel::Piezo;
  for (int i = 0; i < view.machine.control.size(); ++i) {
    const bool is_rotary =
        view.machine.control.joints()[std::size_t(i)].motion != kinematics::Motion::Linear;
    if (is_spindle(view.machine, i) || (slides_only && is_rotary))
      options.fixed_joints.set(std::size_t(i));
  }
  return options;
}

/// Function that returns the belief at a sample.
using BeliefAt = std::function<compensation::Belief(std::size_t sample)>;

/// Corrects all commands, in parallel.
CorrectedCommands corrected(const kinematics::Chain& control,
                            const compensation::CorrectOptions& options,
                            const std::vector<AxisState>& commanded,
                            const std::vector<Pose>& T_wt_nominal, const BeliefAt& belief_at) {
  std::vector<compensation::Correction> corrections(commanded.size());
  tbb::parallel_for(std::size_t(0), commanded.size(), [&](std::size_t i) {
    corrections[i] =
        compensation::correct(control, belief_at(i), T_wt_nominal[i], commanded[i], options);
  });
  // Results are combined in order after the parallel part, so they do not depend on the threads.
  CorrectedCommands result{commanded, 0.0, 0.0, 0};
  for (std::size_t i = 0; i < commanded.size(); ++i) {
    result.states[i].q = corrections[i].q;
    result.remaining_point_error =
        std::max(result.remaining_point_error, corrections[i].remaining_point_error);
    result.remaining_direction_error =
        std::max(result.remaining_direction_error, corrections[i].remaining_direction_error);
    if (!corrections[i].converged) ++result.not_converged;
  }
  return result;
}

/// Range of the axis positions in a program.
struct AxisExtent {
  AxisVector low, high;
};

/// Returns the range of the axis positions in a program.
AxisExtent program_extent(const program::Samples& samples) {
  AxisExtent extent{samples.states.front().q, samples.states.front().q};
  for (const AxisState& state : samples.states) {
    extent.low = extent.low.cwiseMin(state.q);
    extent.high = extent.high.cwiseMax(state.q);
  }
  return extent;
}

/// Returns the positions of the axes on which a table does not depend: the stated ones, or the
/// centre of the range of the program.
AxisVector table_reference(const ControlView& view) {
  if (view.compensation.table.reference) return *view.compensation.table.reference;
  const AxisExtent extent = program_extent(view.samples);
  AxisVector centre = 0.5 * (extent.low + extent.high);
  for (int i = 0; i < centre.size(); ++i)
    if (is_spindle(view.machine, i)) centre[i] = 0.0;
  return centre;
}

[[noreturn]] void throw_tables_error(const ControlView& view, const std::logic_error& exception) {
  throw BadInput(view.file.string(), 0, 0, "a correction that tables can represent",
                 exception.what());
}

/// Returns a corrector that adds the corrections of tables.
Corrector apply_tables(compensation::ParameterTables tables) {
  return [tables = std::move(tables)](const std::vector<AxisState>& commanded,
                                      const std::vector<Pose>&) {
    CorrectedCommands result{commanded, 0.0, 0.0, 0};
    for (AxisState& state : result.states) state.q += compensation::correction(tables, state);
    return result;
  };
}

}  // namespace

Corrector belief_corrector(const ControlView& view, const CaseDescription& compensator,
                           compensation::Belief belief) {
  return [&control = view.machine.control, options = correct_options(view, compensator),
          belief = std::move(belief)](const std::vector<AxisState>& commanded,
                                      const std::vector<Pose>& T_wt_nominal) {
    return corrected(control, options, commanded, T_wt_nominal,
                     // By reference, since a belief may be large.
                     [&](std::size_t) { return std::cref(belief); });
  };
}

Corrector plug_in_corrector(const ControlView& view, const CaseDescription& compensator,
                            compensation::ControlLog log) {
  compensation::PlugInTask task;
  task.structure = kinematics::to_string(kinematics::chain_topology(view.machine.control.joints()));
  task.joints = view.machine.control.joints();
  task.tool = view.tool.name;
  task.tool_length = view.tool.length;
  task.log = std::move(log);
  return [&control = view.machine.control, options = correct_options(view, compensator),
          task = std::move(task), file = compensator.plug_in, function = compensator.function](
             const std::vector<AxisState>& commanded, const std::vector<Pose>& T_wt_nominal) {
    compensation::PlugInOptions plug_in_options;
    plug_in_options.on_wait = stop_if_interrupted;
    // A shared library runs in a separate process of this program.
    plug_in_options.host = program_file();
    const compensation::PlugInRequest question{commanded, T_wt_nominal};
    const compensation::PlugInResponse response =
        function ? compensation::ask(file.string(), *function, task, question, plug_in_options)
                 : compensation::ask(file, task, question, plug_in_options);
    if (response.output == compensation::PlugInOutput::Deviation) {
      return corrected(control, options, commanded, T_wt_nominal, [&](std::size_t i) {
        const kinematics::Deviation E = response.rows.row(Eigen::Index(i)).transpose();
        return [&control, E](const AxisState& state) -> Pose {
          return control.tool_in_workpiece(state.q) *
                 kinematics::motion(E, Eigen::Vector3d::Zero());
        };
      });
    }
    CorrectedCommands result{commanded, 0.0, 0.0, 0};
    for (std::size_t i = 0; i < commanded.size(); ++i)
      result.states[i].q += response.rows.row(Eigen::Index(i)).transpose();
    return result;
  };
}

compensation::TableOptions table_options(const ControlView& view) {
  constexpr double unlimited = 1e8;  // mm; limits as wide as this mean that none are stated
  compensation::TableOptions options = view.compensation.table.options;
  const auto& joints = view.machine.control.joints();
  const AxisExtent extent = program_extent(view.samples);
  options.range.emplace();
  for (int i = 0; i < view.machine.control.size(); ++i) {
    const kinematics::Joint& joint = joints[std::size_t(i)];
    // A table has too few points for more than one turn.
    const double max_travel = joint.motion == kinematics::Motion::Linear ? unlimited : 2 * pi;
    const bool has_travel_limits = joint.max - joint.min <= max_travel;
    options.range->col(i) << (has_travel_limits ? joint.min : extent.low[i]),
        (has_travel_limits ? joint.max : extent.high[i]);
    if (is_spindle(view.machine, i)) options.range->col(i).setZero();
  }
  return options;
}

compensation::ParameterTables correction_tables(const ControlView& view,
                                                const Corrector& corrector) {
  const auto correction = [&](const AxisState& state) -> AxisVector {
    AxisState at_start = state;
    // Tables do not depend on time, so they are made for the start of the program.
    at_start.time_s = view.samples.states.front().time_s;
    return corrector({at_start}, {view.machine.nominal.tool_in_workpiece(at_start.q)})
               .states.front()
               .q -
           at_start.q;
  };
  try {
    return compensation::tabulate(correction, view.machine.control, table_reference(view),
                                  table_options(view));
  } catch (const std::logic_error&
               exception) {  // including out_of_range, if a table of the belief ends too soon
    throw_tables_error(view, exception);
  }
}

ControlTables control_tables(const ControlView& view, const Corrector& corrector,
                             const std::optional<errors::GeometricModel>& believed) {
  const auto& format = view.compensation.table.format;
  const kinematics::Chain& control = view.machine.control;
  try {
    if (!format) return {correction_tables(view, corrector), {}};
    const bool is_volumetric = *format == compensation::ControlFormat::Isg;
    if (is_volumetric && !believed)
      throw std::invalid_argument("identified geometric errors for a volumetric table");
    compensation::ControlExport exported =
        is_volumetric
            ? compensation::to_volumetric(*believed, control, table_options(view))
            : compensation::to_control(correction_tables(view, corrector), control, *format);
    // The tables are read back from the control's files, so that rounding and limits of the format
    // have their effect.
    if (is_volumetric)
      return {compensation::read_volumetric_deviations(exported.files, control),
              std::move(exported.omissions)};
    return {compensation::read_control_tables(exported.files, control, *format),
            std::move(exported.omissions)};
  } catch (const std::logic_error&
               exception) {  // including out_of_range, if a table of the belief ends too soon
    throw_tables_error(view, exception);
  }
}

Corrector table_corrector(const ControlView& view, const ControlTables& tables) {
  if (const auto* corrections = std::get_if<compensation::ParameterTables>(&tables.values))
    return apply_tables(*corrections);
  const kinematics::Chain& control = view.machine.control;
  CaseDescription position;
  position.strategy = compensation::Strategy::Position;
  const compensation::MachineBelief table_belief{
      control,
      view.machine.workpiece_spindle,
      errors::bind(std::get<errors::GeometricErrors>(tables.values), control),
      {},
      {},
      {},
      {}};
  return belief_corrector(view, position, [table_belief](const AxisState& state) {
    return tool_in_workpiece(table_belief, state);
  });
}

}  // namespace abbe::sim
