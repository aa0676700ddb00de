#include "sim/loop/correctors.h"

#include <algorithm>
#include <functional>
#include <stdexcept>

#include <tbb/parallel_for.h>

#include "kinematics/units.h"
#include "sim/compensation/plug_in.h"
#include "sim/files/program_file.h"
#include "sim/files/progress.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

/// Height above the tip of the point that a compensator restores: a ball's centre, a corner's
/// centre.
double functional_height(const NominalTool& tool) {
  const auto* cutter = std::get_if<cutting::Cutter>(&tool.shape);
  return cutter != nullptr ? cutting::corner_height(*cutter) : 0.0;
}

compensation::CorrectOptions correct_options(const Seen& seen, const CaseDescription& compensator) {
  compensation::CorrectOptions options;
  options.strategy = compensator.strategy;
  options.rotary_bound = seen.compensation.rotary_bound;
  options.functional_height = functional_height(seen.tool);
  using Channel = CaseDescription::Channel;
  const bool slides_only =
      compensator.channel == Channel::Origin || compensator.channel == Channel::Piezo;
  for (int i = 0; i < seen.machine.control.size(); ++i) {
    const bool turns =
        seen.machine.control.joints()[std::size_t(i)].motion != kinematics::Motion::Linear;
    if (is_spindle(seen.machine, i) || (slides_only && turns)) options.still.set(std::size_t(i));
  }
  return options;
}

/// Belief at one sample of many.
using BeliefAt = std::function<compensation::Belief(std::size_t sample)>;

Corrected corrected(const kinematics::Chain& control, const compensation::CorrectOptions& options,
                    const std::vector<AxisState>& commanded, const std::vector<Pose>& T_wt_nominal,
                    const BeliefAt& belief_at) {
  std::vector<compensation::Correction> corrections(commanded.size());
  tbb::parallel_for(std::size_t(0), commanded.size(), [&](std::size_t i) {
    corrections[i] =
        compensation::correct(control, belief_at(i), T_wt_nominal[i], commanded[i], options);
  });
  Corrected result{commanded, 0.0, 0.0, 0};
  for (std::size_t i = 0; i < commanded.size(); ++i) {
    result.states[i].q = corrections[i].q;
    result.point_left = std::max(result.point_left, corrections[i].point_left);
    result.direction_left = std::max(result.direction_left, corrections[i].direction_left);
    if (!corrections[i].converged) ++result.not_converged;
  }
  return result;
}

/// Where the program takes the axes.
struct Extent {
  AxisVector low, high;
};

Extent extent_of(const program::Samples& samples) {
  Extent extent{samples.states.front().q, samples.states.front().q};
  for (const AxisState& state : samples.states) {
    extent.low = extent.low.cwiseMin(state.q);
    extent.high = extent.high.cwiseMax(state.q);
  }
  return extent;
}

/// Where the axes that a table does not look up stand: as stated, else in the middle of the
/// program.
AxisVector reference_of(const Seen& seen) {
  if (seen.compensation.table.reference) return *seen.compensation.table.reference;
  const Extent extent = extent_of(seen.samples);
  AxisVector middle = 0.5 * (extent.low + extent.high);
  for (int i = 0; i < middle.size(); ++i)
    if (is_spindle(seen.machine, i)) middle[i] = 0.0;
  return middle;
}

[[noreturn]] void refuse_tables(const Seen& seen, const std::logic_error& fault) {
  throw BadInput(seen.file.string(), 0, 0, "a correction that tables can hold", fault.what());
}

Corrector tables_act(compensation::ParameterTables tables) {
  return [tables = std::move(tables)](const std::vector<AxisState>& commanded,
                                      const std::vector<Pose>&) {
    Corrected result{commanded, 0.0, 0.0, 0};
    for (AxisState& state : result.states) state.q += compensation::correction(tables, state);
    return result;
  };
}

}  // namespace

Corrector belief_corrector(const Seen& seen, const CaseDescription& compensator,
                           compensation::Belief belief) {
  return [&control = seen.machine.control, options = correct_options(seen, compensator),
          belief = std::move(belief)](const std::vector<AxisState>& commanded,
                                      const std::vector<Pose>& T_wt_nominal) {
    return corrected(control, options, commanded, T_wt_nominal,
                     [&](std::size_t) { return std::cref(belief); });  // a belief may be large
  };
}

Corrector plug_in_corrector(const Seen& seen, const CaseDescription& compensator,
                            compensation::ControlLog log) {
  compensation::PlugInTask task;
  task.structure = kinematics::to_string(kinematics::topology_of(seen.machine.control.joints()));
  task.joints = seen.machine.control.joints();
  task.tool = seen.tool.name;
  task.tool_length = seen.tool.length;
  task.log = std::move(log);
  return [&control = seen.machine.control, options = correct_options(seen, compensator),
          task = std::move(task), file = compensator.plug_in, function = compensator.function](
             const std::vector<AxisState>& commanded, const std::vector<Pose>& T_wt_nominal) {
    compensation::PlugInOptions asking;
    asking.waiting = stop_if_interrupted;
    asking.host = program_file();
    const compensation::PlugInQuestion question{commanded, T_wt_nominal};
    const compensation::PlugInAnswer answer =
        function ? compensation::ask(file.string(), *function, task, question, asking)
                 : compensation::ask(file, task, question, asking);
    if (answer.answers == compensation::Answers::Deviation) {
      return corrected(control, options, commanded, T_wt_nominal, [&](std::size_t i) {
        const kinematics::Deviation E = answer.rows.row(Eigen::Index(i)).transpose();
        return [&control, E](const AxisState& state) -> Pose {
          return control.tool_in_workpiece(state.q) *
                 kinematics::motion(E, Eigen::Vector3d::Zero());
        };
      });
    }
    Corrected result{commanded, 0.0, 0.0, 0};
    for (std::size_t i = 0; i < commanded.size(); ++i)
      result.states[i].q += answer.rows.row(Eigen::Index(i)).transpose();
    return result;
  };
}

compensation::TableOptions table_options(const Seen& seen) {
  constexpr double endless = 1e8;  // mm
  compensation::TableOptions options = seen.compensation.table.options;
  const auto& joints = seen.machine.control.joints();
  const Extent extent = extent_of(seen.samples);
  options.range.emplace();
  for (int i = 0; i < seen.machine.control.size(); ++i) {
    const kinematics::Joint& joint = joints[std::size_t(i)];
    const double most = joint.motion == kinematics::Motion::Linear ? endless : 2 * pi;
    const bool whole = joint.max - joint.min <= most;
    options.range->col(i) << (whole ? joint.min : extent.low[i]),
        (whole ? joint.max : extent.high[i]);
    if (is_spindle(seen.machine, i)) options.range->col(i).setZero();
  }
  return options;
}

compensation::ParameterTables tables_of(const Seen& seen, const Corrector& corrector) {
  const auto correction = [&](const AxisState& state) -> AxisVector {
    AxisState at = state;
    at.time_s = seen.samples.states.front().time_s;
    return corrector({at}, {seen.machine.nominal.tool_in_workpiece(at.q)}).states.front().q - at.q;
  };
  try {
    return compensation::tabulated(correction, seen.machine.control, reference_of(seen),
                                   table_options(seen));
  } catch (const std::logic_error& fault) {  // also out_of_range: a believed table ends too soon
    refuse_tables(seen, fault);
  }
}

TableCorrector table_corrector(const Seen& seen, const Corrector& corrector,
                               const std::optional<errors::GeometricModel>& believed) {
  const CompensationDescription::Table& table = seen.compensation.table;
  const kinematics::Chain& control = seen.machine.control;
  try {
    if (!table.format) return {tables_act(tables_of(seen, corrector)), {}};
    if (*table.format != compensation::ControlFormat::Isg) {
      compensation::Export out =
          compensation::to_control(tables_of(seen, corrector), control, *table.format);
      return {tables_act(compensation::tables_of_control(out.files, control, *table.format)),
              std::move(out.left_out)};
    }
    if (!believed)
      throw std::invalid_argument("geometric errors that are identified, for a volumetric table");
    compensation::Export out = compensation::to_volumetric(*believed, control, table_options(seen));
    CaseDescription position;
    position.strategy = compensation::Strategy::Position;
    const compensation::MachineBelief read{
        control,
        seen.machine.workpiece_spindle,
        errors::bind(compensation::deviations_of_volumetric(out.files, control), control),
        {},
        {},
        {},
        {}};
    return {
        belief_corrector(seen, position,
                         [read](const AxisState& state) { return tool_in_workpiece(read, state); }),
        std::move(out.left_out)};
  } catch (const std::logic_error& fault) {  // also out_of_range: a believed table ends too soon
    refuse_tables(seen, fault);
  }
}

}  // namespace abbe::sim
