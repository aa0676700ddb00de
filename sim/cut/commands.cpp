#include "sim/cut/commands.h"

#include <algorithm>
#include <functional>

#include <tbb/parallel_for.h>

#include "kinematics/bad_input.h"
#include "kinematics/decompositions.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/jacobian.h"

namespace abbe::sim {

namespace {

using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Pose;

/// Returns actual minus nominal position of the tip, mm, when the control moves to a point.
using TipDeviation = std::function<Vector3d(const Vector3d& point_w)>;

// Returns the axis state at which the tip of a chain is at a point, rotary axes at zero.
AxisState at_rest(const kinematics::Chain& chain, const Vector3d& point_w, double time_s) {
  const AxisVector zero = AxisVector::Zero(chain.size());
  AxisState state;
  state.q = slide_offset(chain, point_w - chain.tool_in_workpiece(zero).translation());
  state.time_s = time_s;
  return state;
}

/// The command of a control to a point, rotary axes at zero, before and after a compensator.
struct Approach {
  AxisState command;
  AxisState corrected;
  Vector3d wanted_w;  ///< where the nominal machine puts the tip: a component that its slides
                      ///< cannot reach is no deviation
};

Approach approach(const Vector3d& point_w, double time_s, const Machine& machine,
                  const Corrector& corrector) {
  const AxisState nominal = at_rest(machine.nominal, point_w, time_s);
  const Pose T_wt_wanted = machine.nominal.tool_in_workpiece(nominal.q);
  const AxisState command = at_rest(machine.control, point_w, time_s);
  const AxisState corrected =
      corrector ? corrector({command}, {T_wt_wanted}).states.front() : command;
  return {command, corrected, T_wt_wanted.translation()};
}

Vector3d touched_offset(const DatumDescription& datum, const TipDeviation& deviation) {
  using Kind = DatumDescription::Kind;
  if (datum.kind == Kind::None) return Vector3d::Zero();
  if (datum.kind == Kind::Ideal) {
    Vector3d offset = Vector3d::Zero();
    // The deviation depends on where the tip is sent; the errors vary little over an offset, so the
    // last of three repetitions only corrects nanometres.
    for (int i = 0; i < 3; ++i) offset = -deviation(datum.point_w + offset);
    return offset;
  }
  const Eigen::Index n = Eigen::Index(datum.touches.size());
  Eigen::MatrixXd directions(n, 3);
  Eigen::VectorXd learnt(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const DatumDescription::Touch& touch = datum.touches[std::size_t(i)];
    directions.row(i) = touch.direction_w.transpose();
    learnt[i] = -touch.direction_w.dot(deviation(touch.point_w));
  }
  // The shortest solution leaves zero in directions that no touch has measured.
  return shortest_least_squares(directions, learnt);
}

}  // namespace

AxisVector slide_offset(const kinematics::Chain& chain, const Vector3d& offset_w) {
  AxisVector q = AxisVector::Zero(chain.size());
  // Linear axes alone move the tip the same anywhere, so the Jacobian at zero is exact.
  const Eigen::MatrixXd J = kinematics::axis_jacobian(chain, q);
  Eigen::MatrixXd by_slide = Eigen::MatrixXd::Zero(3, chain.size());
  for (int i = 0; i < chain.size(); ++i)
    if (chain.joints()[std::size_t(i)].motion == kinematics::Motion::Linear)
      by_slide.col(i) = J.col(i).head<3>();
  q = shortest_least_squares(by_slide, offset_w);
  return q;
}

Vector3d datum_offset(const DatumDescription& datum, const Machine& machine, const ToolAt& tool_at,
                      const Corrector& corrector) {
  return touched_offset(datum, [&](const Vector3d& point_w) -> Vector3d {
    const Approach made = approach(point_w, datum.time_s, machine, corrector);
    return tool_at(made.corrected).translation() - made.wanted_w;
  });
}

Vector3d expected_offset(const DatumDescription& datum, const Machine& machine,
                         const Corrector& corrector) {
  return touched_offset(datum, [&](const Vector3d& point_w) -> Vector3d {
    const Approach made = approach(point_w, datum.time_s, machine, corrector);
    const kinematics::Chain& control = machine.control;
    return control.tool_in_workpiece(made.command.q).translation() -
           control.tool_in_workpiece(made.corrected.q).translation();
  });
}

namespace {

bool is_tip(const program::Path& path, int block) {
  return path.blocks[std::size_t(block)].coordinates == program::Coordinates::Tip;
}

}  // namespace

std::vector<AxisState> commanded(const kinematics::Chain& control, const program::Path& path,
                                 const program::Samples& samples,
                                 const kinematics::Chain& sampled_by,
                                 const Eigen::Vector3d& offset_w) {
  std::vector<AxisState> states = samples.states;
  // an unchanged chain and no shift give the same bits without another inverse
  if (same(control, sampled_by) && offset_w.isZero(0.0)) return states;
  const AxisVector slides = slide_offset(control, offset_w);
  tbb::parallel_for(std::size_t(0), states.size(), [&](std::size_t i) {
    if (!is_tip(path, samples.block[i])) {
      // A block in axis coordinates is only shifted; a block that programs the tip is solved with
      // the kinematics of the control.
      states[i].q += slides;
      return;
    }
    const Eigen::Vector3d tip_w =
        sampled_by.tool_in_workpiece(states[i].q).translation() + offset_w;
    const auto q = kinematics::slides_for_tip(control, states[i].q, tip_w);
    if (!q)
      throw BadInput(path.file, samples.line[i], 0, "a tip that the control's slides reach",
                     "another");
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

Commands joined(std::vector<Commands> parts) {
  if (parts.size() == 1) return std::move(parts.front());
  Commands all;
  for (const Commands& part : parts) {
    const auto& states = part.samples.states;
    all.samples.states.insert(all.samples.states.end(), states.begin(), states.end());
    all.point_left = std::max(all.point_left, part.point_left);
    all.direction_left = std::max(all.direction_left, part.direction_left);
    all.not_converged += part.not_converged;
    for (const std::string& warning : part.warnings)
      if (std::ranges::find(all.warnings, warning) == all.warnings.end())
        all.warnings.push_back(warning);
  }
  all.stretches = std::move(parts);
  return all;
}

const Commands& of_part(const Commands& commands, std::size_t part) {
  return commands.stretches.empty() ? commands : commands.stretches[part];
}

}  // namespace abbe::sim
