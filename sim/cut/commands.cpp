#include "sim/cut/commands.h"

#include <algorithm>
#include <functional>

#include <tbb/parallel_for.h>

#include "kinematics/bad_input.h"
#include "kinematics/decompositions.h"
#include "kinematics/inverse_kinematics.h"

namespace abbe::sim {

namespace {

using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

/// Returns the actual minus the nominal position of the tip, mm, when the control moves to a point.
using TipDeviation = std::function<Vector3d(const Vector3d& point_w)>;

/// Returns the axis state at which the tip of a chain is at a point, rotary axes at zero.
AxisState state_at(const kinematics::Chain& chain, const Vector3d& point_w, double time_s) {
  const AxisVector zero = AxisVector::Zero(chain.size());
  AxisState state;
  state.q = slide_offset(chain, point_w - chain.tool_in_workpiece(zero).translation());
  state.time_s = time_s;
  return state;
}

/// The command of a control that moves the tip to a point, before and after correction.
struct Approach {
  AxisState command;
  AxisState corrected;
  Vector3d nominal_w;  ///< tip of the nominal machine: what its slides cannot reach is no deviation
};

Approach approach_point(const Vector3d& point_w, double time_s, const Machine& machine,
                        const Corrector& corrector) {
  const AxisState nominal = state_at(machine.nominal, point_w, time_s);
  const Pose T_wt_nominal = machine.nominal.tool_in_workpiece(nominal.q);
  const AxisState command = state_at(machine.control, point_w, time_s);
  const AxisState corrected =
      corrector ? corrector({command}, {T_wt_nominal}).states.front() : command;
  return {command, corrected, T_wt_nominal.translation()};
}

/// Returns the shift of the work zero that measuring a datum gives, mm.
Vector3d measured_offset(const DatumDescription& datum, const TipDeviation& deviation) {
  using Kind = DatumDescription::Kind;
  if (datum.kind == Kind::None) return Vector3d::Zero();
  if (datum.kind == Kind::Ideal) {
    Vector3d offset = Vector3d::Zero();
    // The deviation depends on the commanded point. Errors vary little over an offset, so that the
    // third repetition only corrects nanometres.
    for (int i = 0; i < 3; ++i) offset = -deviation(datum.point_w + offset);
    return offset;
  }
  const Eigen::Index n = Eigen::Index(datum.touches.size());
  Eigen::MatrixXd directions(n, 3);
  Eigen::VectorXd components(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const DatumDescription::Touch& touch = datum.touches[std::size_t(i)];
    directions.row(i) = touch.direction_w.transpose();
    components[i] = -touch.direction_w.dot(deviation(touch.point_w));
  }
  // The shortest solution is zero in directions that no touch has measured.
  return shortest_least_squares(directions, components);
}

}  // namespace

Eigen::MatrixXd slide_jacobian(const kinematics::Chain& chain, const AxisVector& q) {
  const Eigen::MatrixXd J = kinematics::axis_jacobian(chain, q);
  Eigen::MatrixXd J_slides = Eigen::MatrixXd::Zero(3, chain.size());
  for (int i = 0; i < chain.size(); ++i)
    if (chain.joints()[std::size_t(i)].motion == kinematics::Motion::Linear)
      J_slides.col(i) = J.col(i).head<3>();
  return J_slides;
}

AxisVector slide_offset(const kinematics::Chain& chain, const Vector3d& offset_w) {
  // Slides alone move the tip by the same displacement anywhere, so the Jacobian at zero is exact.
  return shortest_least_squares(slide_jacobian(chain, AxisVector::Zero(chain.size())), offset_w);
}

Vector3d datum_offset(const DatumDescription& datum, const Machine& machine, const ToolAt& tool_at,
                      const Corrector& corrector) {
  return measured_offset(datum, [&](const Vector3d& point_w) -> Vector3d {
    const Approach point_approach = approach_point(point_w, datum.time_s, machine, corrector);
    return tool_at(point_approach.corrected).translation() - point_approach.nominal_w;
  });
}

Vector3d expected_offset(const DatumDescription& datum, const Machine& machine,
                         const Corrector& corrector) {
  return measured_offset(datum, [&](const Vector3d& point_w) -> Vector3d {
    const Approach point_approach = approach_point(point_w, datum.time_s, machine, corrector);
    const kinematics::Chain& control = machine.control;
    return control.tool_in_workpiece(point_approach.command.q).translation() -
           control.tool_in_workpiece(point_approach.corrected.q).translation();
  });
}

std::vector<AxisState> commanded(const kinematics::Chain& control, const program::Path& path,
                                 const program::Samples& samples,
                                 const kinematics::Chain& sampled_by,
                                 const Eigen::Vector3d& offset_w) {
  std::vector<AxisState> states = samples.states;
  // Without a shift the same chain would give the same commands, but not the same bits.
  if (have_same_poses(control, sampled_by) && offset_w.isZero(0.0)) return states;
  const AxisVector slides = slide_offset(control, offset_w);
  tbb::parallel_for(std::size_t(0), states.size(), [&](std::size_t i) {
    const program::Block& block = path.blocks[std::size_t(samples.block[i])];
    if (block.coordinates != program::Coordinates::Tip) {
      // Axis coordinates need no kinematics of the control.
      states[i].q += slides;
      return;
    }
    const Eigen::Vector3d tip_w =
        sampled_by.tool_in_workpiece(states[i].q).translation() + offset_w;
    const auto q = kinematics::solve_slides(control, states[i].q, tip_w);
    if (!q)
      throw BadInput(path.file, samples.line[i], 0,
                     "a tip position within reach of the control's slides", "a tip out of reach");
    states[i].q = *q;
  });
  return states;
}

Commands uncompensated_commands(const Machine& machine, const program::Path& path,
                                const program::Samples& samples, const Eigen::Vector3d& offset_w) {
  Commands result;
  result.samples = samples;
  result.samples.states = commanded(machine.control, path, samples, machine.nominal, offset_w);
  return result;
}

Commands joined(std::vector<Commands> segments) {
  if (segments.size() == 1) return std::move(segments.front());
  Commands job_commands;
  for (const Commands& segment : segments) {
    const auto& states = segment.samples.states;
    job_commands.samples.states.insert(job_commands.samples.states.end(), states.begin(),
                                       states.end());
    job_commands.remaining_point_error =
        std::max(job_commands.remaining_point_error, segment.remaining_point_error);
    job_commands.remaining_direction_error =
        std::max(job_commands.remaining_direction_error, segment.remaining_direction_error);
    job_commands.not_converged += segment.not_converged;
    for (const std::string& warning : segment.warnings)
      if (std::ranges::find(job_commands.warnings, warning) == job_commands.warnings.end())
        job_commands.warnings.push_back(warning);
  }
  job_commands.segments = std::move(segments);
  return job_commands;
}

const Commands& part_commands(const Commands& commands, std::size_t part) {
  return commands.segments.empty() ? commands : commands.segments[part];
}

}  // namespace abbe::sim
