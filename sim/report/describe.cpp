#include "sim/report/describe.h"

#include <fmt/format.h>

#include "errors/bound_element.h"
#include "kinematics/units.h"
#include "sim/cut/unreached_text.h"
#include "sim/scene/library.h"

namespace abbe::sim {
namespace {

using kinematics::AxisState;
using kinematics::Joint;

/// Where an error motion is stated: on the line on which it was measured, if one is given.
std::string place_of(const errors::GeometricModel& model,
                     const errors::GeometricModel::Bound& bound, const Joint& joint) {
  std::string place = "the joint's point";
  for (const auto& line : model.lines)
    if (line.joint == bound.joint && !bound.element.name.is_angle()) {
      const Eigen::Vector3d at = joint.point_b + line.arm_b;
      place = fmt::format("line through {:.6g} {:.6g} {:.6g}, measured by the {}", at.x(), at.y(),
                          at.z(), line.fixed_in_bed ? "tool" : "carriage");
    }
  return place;
}

Description::Element described(const errors::GeometricModel& model,
                               const errors::GeometricModel::Bound& bound,
                               const kinematics::Chain& chain) {
  const Joint& joint = chain.joints()[std::size_t(bound.joint)];
  Description::Element element;
  element.name = bound.element.name;
  element.on_slide = joint.motion == kinematics::Motion::Linear;
  errors::CurveState at_zero;
  at_zero.primed = joint.side == kinematics::Side::Workpiece;
  double value = 0.0, slope = 0.0;
  bool known = true;
  for (const errors::Curve& curve : bound.element.curves) {
    if (!curve.name.empty()) element.parts.push_back(curve.name);
    try {
      value += errors::value(curve, at_zero);
      slope += errors::slope(curve, at_zero);
    } catch (const std::out_of_range&) {
      known = false;
    }
  }
  if (known) element.value = value;
  if (bound.location) {
    element.location = location_effect(bound.element, chain);
  } else {
    if (known) element.slope = slope;
    element.stated_at = place_of(model, bound, joint);
  }
  return element;
}

/// Nodes that a function of temperatures looks at.
void add_nodes(std::vector<std::string>& names, const errors::ThermalFunction& function,
               const errors::ThermalNetwork& network) {
  for (const auto& term : function.terms) {
    std::string name = network.nodes[std::size_t(term.node)].name;
    if (term.minus) name += " - " + network.nodes[std::size_t(*term.minus)].name;
    names.push_back(name);
  }
}

Description::Heat described(const Truth::Heat& truth, const ThermalDescription& thermal,
                            const kinematics::Chain& chain) {
  const errors::ThermalNetwork& network = truth.run.network;
  const auto name_of = [&](int node) { return network.nodes[std::size_t(node)].name; };
  Description::Heat heat;
  heat.nodes = network.nodes.size();
  heat.links = network.links.size() + network.surroundings.size();
  heat.sources = network.sources.size();
  heat.shortest_time_constant_s = 1.0 / truth.run.dry.rate_per_s.maxCoeff();
  heat.longest_time_constant_s = 1.0 / truth.run.dry.rate_per_s.minCoeff();
  heat.history_h = (0.0 - truth.run.knots.front().time_s) / 3600.0;
  for (const errors::ThermalElement& one : thermal.errors.elements) {
    Description::Heat::Element element{errors::to_string(one.name), {}, {}, {}};
    add_nodes(element.follows, one.offset, network);
    add_nodes(element.follows, one.slope, network);
    if (one.name.location)
      element.meaning =
          errors::meaning(one.name, chain, errors::joint_of(one.name.axis, chain, ""));
    heat.elements.push_back(std::move(element));
  }
  for (const errors::AxisExpansion& axis : thermal.errors.expansions) {
    const bool motor = axis.feedback == errors::Feedback::Motor;
    heat.elements.push_back({fmt::format("E{0}{0}", axis.axis),
                             {name_of((motor ? *axis.screw : *axis.scale).node)},
                             {},
                             motor ? "motor" : "scale"});
  }
  for (const errors::TemperatureSensor& sensor : thermal.sensors)
    heat.sensors.push_back({sensor.name, name_of(sensor.node)});
  return heat;
}

std::array<std::optional<double>, 3> stiffness_N_per_um(const Job& job) {
  const AxisState& state = job.samples.states[job.samples.states.size() / 2];
  constexpr double force = 1.0;  // N
  const auto tip = [&](int axis, double newton) {
    errors::Load load;
    load.on_tool_t[axis] = newton;
    return tool_in_workpiece(job.truth, state, load);
  };
  std::array<std::optional<double>, 3> stiffness;
  for (int axis = 0; axis < 3; ++axis) {
    const kinematics::Pose pushed = tip(axis, force), pulled = tip(axis, -force);
    const double gives =
        pulled.linear().col(axis).dot(pushed.translation() - pulled.translation()) / 2;
    if (gives > 1e-12) stiffness[std::size_t(axis)] = force / gives * units::um;
  }
  return stiffness;
}

}  // namespace

Description describe(const Job& job) {
  const kinematics::Chain& chain = job.machine.nominal;
  const kinematics::Topology topology = kinematics::topology_of(chain.joints());
  const auto& states = job.samples.states;
  Description d;
  d.scene = job.scene.title;
  for (const std::filesystem::path& file : job.scene.files) d.files.push_back(library_name(file));
  d.machine = job.scene.machine.name;
  d.structural_code = kinematics::to_string(topology);
  d.bodies = kinematics::low_order_body_array(topology);
  d.axes = {chain.joints().begin(), chain.joints().end()};
  for (const auto& bound : job.truth.geometric.elements)
    d.elements.push_back(described(job.truth.geometric, bound, chain));
  if (job.truth.heat) d.heat = described(*job.truth.heat, *job.scene.thermal, chain);
  if (job.truth.compliance && !states.empty()) d.stiffness_N_per_um = stiffness_N_per_um(job);
  if (job.scene.cutting)
    d.cut = {job.scene.cutting->material, job.scene.cutting->spacing,
             job.nominal_process.steps.size(), totals(job.nominal_process),
             job.nominal_process.crash_lines};
  const cutting::Design& design = job.design_w;
  d.part = {job.scene.part.name,
            design.vertices.rows(),
            design.triangles.rows(),
            design.area.sum(),
            design.facet_error.size() > 0 ? design.facet_error.maxCoeff() : 0.0,
            region_shares(job.scene.part, job.face_groups,
                          cutting::transformed(design, job.scene.part.T_wm.inverse()))};
  d.program = {job.path.motion_blocks, states.size(), states.empty() ? 0.0 : states.back().time_s,
               unreached_text(job.unreached), job.path.read_as};
  for (const Job& one : job.stretches)
    d.stretches.push_back({*one.scene.tool.number, one.scene.tool.name,
                           one.path.blocks.front().line, one.path.blocks.back().line,
                           one.path.motion_blocks});
  d.warnings = job.warnings;
  d.assumptions = job.path.assumptions;
  return d;
}

}  // namespace abbe::sim
