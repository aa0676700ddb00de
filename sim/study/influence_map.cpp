#include "sim/study/influence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <numeric>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <Eigen/Geometry>

#include "cutting/surface/cutter_entry.h"
#include "errors/coefficients.h"
#include "errors/geometric.h"
#include "errors/identification/model.h"
#include "kinematics/inverse_kinematics.h"
#include "kinematics/units.h"
#include "sim/cut/sweep.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/tool_poses.h"
#include "sim/machine/run_out.h"
#include "sim/scene/toml.h"
#include "sim/study/case_plan.h"

namespace abbe::sim::study {

namespace {

using cutting::CompetingPass;
using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using kinematics::Pose;

/// Small displacement of the tool in the workpiece frame: [translation of the tip | rotation
/// vector], mm and rad.
using Twist = kinematics::Deviation;

/// The cut of one tool with the inputs at their centres.
struct ToolCut {
  const Segment& segment;
  const Commands& commanded;
  Process process;
  std::vector<Pose> T_wt;              ///< (samples)
  std::vector<std::size_t> sample;     ///< (cutting motion) number of the sample of the part
  std::optional<SpindleLine> spindle;  ///< axis about which the workpiece turns
};

/// A competing pass of one of several tools.
struct ToolPass : CompetingPass {
  std::size_t tool = 0;  ///< number in BaseRun::tools
};

/// A configuration cut with its inputs at their centres, with the data for the columns of its
/// influence map.
struct BaseRun {
  const Study& study;
  const PreparedConfiguration& ready;
  std::vector<ToolCut> tools = {};          ///< in the order of the program
  std::vector<ToolPass> passes = {};        ///< in the order of the vertices, nearest first
  std::vector<cutting::Gouge> gouges = {};  ///< at vertices without a pass, in the same order

  const ToolCut& tool(const ToolPass& pass) const { return tools[pass.tool]; }
};

/// Throws BadInput for a tool whose passes do not make a surface of their own.
void check_tool(const Segment& segment) {
  const auto require = [&](bool is_met, const char* expected, const char* seen) {
    if (!is_met) throw BadInput(segment.scene.file.string(), 0, 0, expected, seen);
  };
  require(!segment.scene.tool.wear || !(segment.scene.tool.wear->radius > 0.0),
          "a tool of constant radius for influence maps (engine = \"full\" supports wear)",
          "tool.wear.radius_um");
  const auto* cutter = std::get_if<cutting::Cutter>(&segment.scene.tool.actual);
  require(!cutter || !cutting::is_hollow(*cutter),
          "a convex tool for influence maps (engine = \"full\" supports concave ones)",
          "a concave tool.kind = \"profile\"");
}

ToolCut tool_cut(const Segment& segment, const Commands& commanded, Process process) {
  ToolCut tool{segment, commanded, std::move(process), {}, {}, std::nullopt};
  tool.T_wt = tool_poses(segment, commanded, tool.process);
  if (std::holds_alternative<cutting::Cutter>(segment.scene.tool.actual)) {
    tool.sample.resize(commanded.samples.states.size());
    std::iota(tool.sample.begin(), tool.sample.end(), std::size_t(0));
    return tool;
  }
  tool.spindle = spindle_line(segment.truth.actual, *segment.machine.workpiece_spindle);
  // A turned surface needs distinct instants, but a reversal is sampled twice.
  tool.sample = distinct_instants(commanded.samples);
  return tool;
}

std::vector<CompetingPass> competing_passes(const cutting::Design& design_w, const ToolCut& tool,
                                            const cutting::CompetingPassOptions& options) {
  const program::Samples& samples = tool.commanded.samples;
  if (const auto* cutter = std::get_if<cutting::Cutter>(&tool.segment.scene.tool.actual))
    return cutting::milled_competing_passes(design_w, *cutter, cutter_motion(tool.T_wt, samples),
                                            options);
  const auto& nose = std::get<cutting::Nose>(tool.segment.scene.tool.actual);
  return cutting::turned_competing_passes(
      design_w, nose,
      nose_motion(tool.T_wt, samples, *tool.spindle, *tool.segment.machine.workpiece_spindle),
      options);
}

/// Returns the passes of all tools, at each vertex those within `reach` of the nearest, and at most
/// `max_passes`.
/// @param passes  of each tool, in the order of the vertices
std::vector<ToolPass> nearest_passes(const std::vector<std::vector<CompetingPass>>& passes,
                                     const cutting::CompetingPassOptions& options) {
  std::vector<ToolPass> all;
  for (std::size_t tool = 0; tool < passes.size(); ++tool)
    for (const CompetingPass& pass : passes[tool]) all.push_back({pass, tool});
  if (passes.size() == 1) return all;
  std::ranges::stable_sort(all, [](const ToolPass& a, const ToolPass& b) {
    return std::pair(a.vertex, a.distance) < std::pair(b.vertex, b.distance);
  });
  std::vector<ToolPass> nearest;
  std::size_t first = 0;  // pass of the vertex
  for (const ToolPass& pass : all) {
    if (nearest.empty() || nearest[first].vertex != pass.vertex) first = nearest.size();
    if (first < nearest.size() && (nearest.size() - first >= std::size_t(options.max_passes) ||
                                   pass.distance > nearest[first].distance + options.reach))
      continue;
    nearest.push_back(pass);
  }
  return nearest;
}

/// Returns the gouges beyond the band. Passes end at the band, so one tool can only gouge vertices
/// without a pass; of several tools one may gouge where another has a pass.
std::vector<cutting::Gouge> gouges(const BaseRun& run) {
  std::vector<ToolSweep> sweeps;
  for (const ToolCut& tool : run.tools)
    sweeps.push_back({tool.segment.scene.tool.actual, tool.commanded.samples, tool.T_wt,
                      tool.segment.truth.actual, tool.segment.machine.workpiece_spindle,
                      path_of(tool.segment, tool.commanded)});
  const Job& job = run.ready.job;
  cutting::Design design_w = job.design_w;
  design_w.judged.resize(std::size_t(design_w.vertices.rows()), 1);
  if (run.tools.size() == 1)
    for (const ToolPass& pass : run.passes) design_w.judged[std::size_t(pass.vertex)] = 0;
  return machined_surface(design_w, sweeps, {.band = job.scene.band, .progress = {}}).gouges;
}

/// Returns the base run; `study` and `ready` must outlive it.
/// @throws BadInput as `cut`, and for tool wear or a hollow tool
BaseRun base_run(const Study& study, const PreparedConfiguration& ready, const Progress& progress) {
  const Job& job = ready.job;
  std::ranges::for_each(job_segments(job), check_tool);
  cutting::CompetingPassOptions options;
  options.reach = study.influence.reach;
  options.max_passes = study.influence.max_competing_passes;
  options.band = job.scene.band;
  BaseRun run{study, ready};
  const Process process = cut_process(job, ready.commanded);
  const auto parts = job_segments(job);
  std::vector<std::vector<CompetingPass>> passes;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (progress)
      options.progress = [&](double fraction) {
        progress("rivals", (double(i) + fraction) / double(parts.size()));
      };
    run.tools.push_back(
        tool_cut(parts[i], part_commands(ready.commanded, i), part_process(process, i)));
    passes.push_back(competing_passes(job.design_w, run.tools.back(), options));
  }
  run.passes = nearest_passes(passes, options);
  run.gouges = gouges(run);
  std::set<int> gouged;
  for (const cutting::Gouge& gouge : run.gouges) gouged.insert(gouge.vertex);
  std::erase_if(run.passes, [&](const ToolPass& pass) { return gouged.contains(pass.vertex); });
  return run;
}

/// An end of the move on which a competing pass makes its surface.
struct MoveEnd {
  std::size_t sample = 0;  ///< of the part
  double share = 0.0;      ///< weight of this end at the instant of the pass, 0 .. 1
};

/// Returns both ends of the move of a competing pass; their weights add up to 1.
std::array<MoveEnd, 2> move_ends(const BaseRun& run, const ToolPass& pass) {
  const std::vector<std::size_t>& sample = run.tool(pass).sample;
  const auto move = std::size_t(pass.move);
  // The last sample begins no move, so both ends of a pass there are that sample.
  const std::size_t next = std::min(move + 1, sample.size() - 1);
  return {MoveEnd{sample[move], 1.0 - pass.t}, MoveEnd{sample[next], pass.t}};
}

/// Returns the samples at the ends of the moves of all passes of a tool, ascending.
std::vector<std::size_t> pass_samples(const BaseRun& run, std::size_t tool) {
  std::vector<std::size_t> samples;
  for (const ToolPass& pass : run.passes)
    if (pass.tool == tool)
      for (const MoveEnd& end : move_ends(run, pass)) samples.push_back(end.sample);
  std::sort(samples.begin(), samples.end());
  samples.erase(std::unique(samples.begin(), samples.end()), samples.end());
  return samples;
}

}  // namespace

std::array<double, 2> difference_points(const Study& study, Eigen::Index input) {
  const Distribution& distribution = study.inputs[std::size_t(input)].distribution;
  return {value_at_score(distribution, -1.0), value_at_score(distribution, 1.0)};
}

namespace {

/// Returns the scenes at `difference_points`, with the other inputs at their centres.
std::array<Scene, 2> stepped_scenes(const BaseRun& run, Index input) {
  Eigen::VectorXd x = centre(run.study);
  std::array<Scene, 2> scenes;
  const std::array<double, 2> values = difference_points(run.study, input);
  for (std::size_t side = 0; side < 2; ++side) {
    x[input] = values[side];
    scenes[side] = scene_at(run.study, run.ready.arm, run.ready.scene, x);
  }
  return scenes;
}

/// Returns the scene of one of the tools of a run, with run-out as part of the tool.
Scene tool_scene(const BaseRun& run, const Scene& scene, std::size_t tool) {
  if (run.tools.size() == 1) return with_run_out(scene);
  return with_run_out(select_tool(scene, *run.tools[tool].segment.scene.tool.number));
}

Matrix3d spindle_rotation(const SpindleLine& line, double angle) {
  return Eigen::AngleAxisd(angle, line.direction_w).toRotationMatrix();
}

double spindle_angle(const ToolCut& tool, const MoveEnd& end) {
  return tool.commanded.samples.states[end.sample].q[*tool.segment.machine.workpiece_spindle];
}

double spindle_angle(const ToolCut& tool, const std::array<MoveEnd, 2>& ends) {
  return ends[0].share * spindle_angle(tool, ends[0]) +
         ends[1].share * spindle_angle(tool, ends[1]);
}

Pose interpolate_pose(const Pose& from, const Pose& to, double fraction) {
  Pose pose = Pose::Identity();
  pose.translation() = (1.0 - fraction) * from.translation() + fraction * to.translation();
  pose.linear() = Eigen::Quaterniond(from.linear())
                      .slerp(fraction, Eigen::Quaterniond(to.linear()))
                      .toRotationMatrix();
  return pose;
}

/// Returns the displacement of the contact, mm, workpiece frame, by displacements of the tool at
/// the ends of the pass's move. If the workpiece turns, the displacements are interpolated in the
/// frame of the spindle, where they vary slowly.
Vector3d displacement(const BaseRun& run, const ToolPass& pass,
                      const std::array<Twist, 2>& at_ends) {
  const std::array<MoveEnd, 2> ends = move_ends(run, pass);
  const ToolCut& tool = run.tool(pass);
  Vector3d result = Vector3d::Zero();
  for (std::size_t e = 0; e < 2; ++e) {
    const Vector3d shift = at_ends[e].head<3>(), rotation = at_ends[e].tail<3>();
    const Vector3d& tip = tool.T_wt[ends[e].sample].translation();
    if (!tool.spindle) {
      result += ends[e].share * (shift + rotation.cross(pass.contact - tip));
      continue;
    }
    // `contact` is the position of the contact when the tool is at this end.
    const Matrix3d R_forward =
        spindle_rotation(*tool.spindle, spindle_angle(tool, ends) - spindle_angle(tool, ends[e]));
    const Vector3d contact = R_forward.transpose() * (pass.contact - tool.spindle->point_w);
    result += ends[e].share *
              (R_forward * (shift + rotation.cross(contact - (tip - tool.spindle->point_w))));
  }
  return result;
}

/// The tool of one machine at the ends of a pass's move.
struct Tool {
  std::array<Pose, 2> T_wt;
  std::optional<SpindleLine> spindle;  ///< of this machine: another clamping moves it
};

/// Returns the pose of the tool in the workpiece at the instant of a pass, T_wt.
Pose tool_at(const BaseRun& run, const ToolPass& pass, const Tool& tool) {
  const std::array<MoveEnd, 2> ends = move_ends(run, pass);
  if (!tool.spindle) return interpolate_pose(tool.T_wt[0], tool.T_wt[1], ends[1].share);
  const SpindleLine& line = *tool.spindle;
  const ToolCut& base = run.tool(pass);
  const Pose slow =
      interpolate_pose(slow_pose(line, spindle_angle(base, ends[0]), tool.T_wt[0]),
                       slow_pose(line, spindle_angle(base, ends[1]), tool.T_wt[1]), ends[1].share);
  return slow_pose(line, -spindle_angle(base, ends), slow);
}

/// Returns the displacement of the contact, mm, workpiece frame, from the tool of one machine to
/// that of another. Each tool is interpolated as in the surface engine.
Vector3d displacement(const BaseRun& run, const ToolPass& pass, const Tool& from, const Tool& to) {
  const Pose a = tool_at(run, pass, from), b = tool_at(run, pass, to);
  // The antisymmetric part of R is the rotation vector to the third order of the angle, which is
  // below a milliradian.
  const Matrix3d R = b.linear() * a.linear().transpose();
  const Vector3d rotation = 0.5 * Vector3d(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
  const Vector3d lever = pass.contact - 0.5 * (a.translation() + b.translation());
  return b.translation() - a.translation() + rotation.cross(lever);
}

// Slopes and shifts of the influence map: the effects of inputs on the passes of a base run.

/// Slopes and shifts for some inputs, in the layout of the map.
struct Columns {
  Eigen::MatrixXd slope;  ///< (inputs x passes) mm per unit of the input
  Eigen::MatrixXd shift;  ///< (inputs x passes) the same, across the pass
};

/// The effect of a unit of an input on the deviations of the joints: the difference of two models
/// with only those elements that the input changes. It is exact for coefficients, in which curves
/// are linear.
struct GeometricInput {
  Index input = 0;
  errors::GeometricModel with;
  errors::GeometricModel without;
  double per_unit = 1.0;
};

/// Returns the elements that an input changes; empty if it also changes something else.
std::set<std::string> changed_elements(const Input& input) {
  std::set<std::string> names;
  if (!input.element.empty()) names.insert(input.element);
  if (!input.number.empty())
    names.insert(errors::identification::coefficient_element(input.number));
  for (const Setting& setting : input.settings) {
    const std::string prefix = "errors.";
    if (!setting.path.starts_with(prefix)) return {};
    const std::size_t end = setting.path.find('.', prefix.size());
    names.insert(setting.path.substr(prefix.size(), end - prefix.size()));
  }
  return names;
}

errors::GeometricErrors select_elements(const errors::GeometricErrors& source,
                                        const std::set<std::string>& names) {
  errors::GeometricErrors selection;
  selection.measuring_lines = source.measuring_lines;
  for (const errors::Element& element : source.elements)
    if (names.count(errors::to_string(element.name))) selection.elements.push_back(element);
  return selection;
}

/// Returns true if two cutters leave the same surface on the same path.
bool same_shape(const cutting::Cutter& a, const cutting::Cutter& b) {
  return a.radius == b.radius && a.corner_radius == b.corner_radius &&
         a.flank_length == b.flank_length &&
         (a.outline == b.outline || (a.outline && b.outline && *a.outline == *b.outline));
}

/// Returns true if two actual tools are equal. The run-out of a spindle is part of the tool.
bool same_tools(const ToolDescription& a, const ToolDescription& b) {
  if (a.actual_length != b.actual_length) return false;
  const auto* cutter_a = std::get_if<cutting::Cutter>(&a.actual);
  const auto* cutter_b = std::get_if<cutting::Cutter>(&b.actual);
  return !cutter_a || !cutter_b || same_shape(*cutter_a, *cutter_b);
}

Twist input_twist(const GeometricInput& input, const kinematics::AxisState& state,
                  const Eigen::MatrixXd& J_motion, const Eigen::MatrixXd& J_location) {
  Twist twist = Twist::Zero();
  const auto add = [&](const errors::GeometricModel& model, double factor) {
    const auto joints = errors::deviations(model, state);
    // Most joints have no deviation by these few elements, and their blocks are skipped.
    for (std::size_t i = 0; i < joints.size(); ++i) {
      const Index at = 6 * Index(i);
      if (!joints[i].motion.isZero(0.0))
        twist += factor * (J_motion.middleCols<6>(at) * joints[i].motion);
      if (!joints[i].location.isZero(0.0))
        twist += factor * (J_location.middleCols<6>(at) * joints[i].location);
    }
  };
  add(input.with, input.per_unit);
  add(input.without, -input.per_unit);
  return twist;
}

/// Returns the model of an input that acts only through elements of the geometric errors and does
/// not change the commands; none for any other input.
/// @param scenes  from stepped_scenes
std::optional<GeometricInput> geometric_input(const BaseRun& run, Index input,
                                              const std::array<Scene, 2>& scenes) {
  if (run.ready.needs_commands_per_case) return std::nullopt;
  const std::set<std::string> names = changed_elements(run.study.inputs[std::size_t(input)]);
  if (names.empty()) return std::nullopt;
  std::array<errors::GeometricErrors, 2> selections;
  for (std::size_t tool = 0; tool < run.tools.size(); ++tool) {
    const std::array sides{tool_scene(run, scenes[0], tool), tool_scene(run, scenes[1], tool)};
    if (!same_tools(sides[0].tool, sides[1].tool)) return std::nullopt;
    // Elements without run-out are the same for all tools.
    if (tool == 0)
      selections = {select_elements(sides[0].geometric, names),
                    select_elements(sides[1].geometric, names)};
  }
  for (const errors::GeometricErrors& selection : selections)
    if (selection.elements.size() != names.size()) return std::nullopt;
  const kinematics::Chain& chain = run.ready.job.truth.actual;
  const double scale = scenes[0].error_scale;
  const std::array<double, 2> values = difference_points(run.study, input);
  return GeometricInput{input, errors::scaled(errors::bind(selections[1], chain), scale),
                        errors::scaled(errors::bind(selections[0], chain), scale),
                        1.0 / (values[1] - values[0])};
}

/// Returns the columns of all geometric inputs at once, by the Jacobian of the chain.
Columns geometric_columns(const BaseRun& run, const std::vector<GeometricInput>& inputs) {
  const Index count = Index(inputs.size()), passes = Index(run.passes.size());
  Columns columns{Eigen::MatrixXd(count, passes), Eigen::MatrixXd(count, passes)};
  if (inputs.empty()) return columns;
  tbb::parallel_for(std::size_t(0), run.passes.size(), [&](std::size_t r) {
    const ToolPass& pass = run.passes[r];
    const kinematics::Chain& chain = run.tool(pass).segment.truth.actual;
    const std::array<MoveEnd, 2> ends = move_ends(run, pass);
    std::vector<std::array<Twist, 2>> twists(inputs.size());
    // Inputs are the inner loop, since all of them need the same Jacobians.
    for (std::size_t e = 0; e < 2; ++e) {
      const kinematics::AxisState& state = run.tool(pass).commanded.samples.states[ends[e].sample];
      const Eigen::MatrixXd J_motion = kinematics::motion_jacobian(chain, state.q);
      const Eigen::MatrixXd J_location = kinematics::location_jacobian(chain, state.q);
      for (std::size_t i = 0; i < inputs.size(); ++i)
        twists[i][e] = input_twist(inputs[i], state, J_motion, J_location);
    }
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const Vector3d d = displacement(run, pass, twists[i]);
      columns.slope(Index(i), Index(r)) = pass.gradient.dot(d);
      columns.shift(Index(i), Index(r)) = pass.across.dot(d);
    }
  });
  return columns;
}

/// One of the two machines of a difference, with one of its tools.
struct DifferenceMachine {
  std::vector<Pose> T_wt;  ///< at the samples that passes need
  std::optional<SpindleLine> spindle;
  ToolDescription tool;
};

/// Returns (tools) a machine of a difference with each of its tools.
/// @param needed  (tools) samples at which the poses are needed
std::vector<DifferenceMachine> difference_machines(
    const BaseRun& run, const Scene& scene, const std::vector<std::vector<std::size_t>>& needed) {
  const Job job = replace_errors(run.ready.job, scene);
  const Commands machine_commands =
      run.ready.needs_commands_per_case ? commands(run.ready.arm, job) : Commands{};
  const Commands& all_commands =
      run.ready.needs_commands_per_case ? machine_commands : run.ready.commanded;
  // A more compliant machine removes less and has smaller loads, so each machine needs its own
  // forces.
  const bool has_deflection =
      std::ranges::any_of(job_segments(job),
                          [](const Segment& part) { return part.truth.compliance.has_value(); }) &&
      std::ranges::any_of(run.tools, [](const ToolCut& t) { return !t.process.steps.empty(); });
  const Process process = has_deflection ? cut_process(job, all_commands) : Process{};
  std::vector<DifferenceMachine> machines;
  for (std::size_t i = 0; i < run.tools.size(); ++i) {
    const Segment& part = job_segments(job)[i];
    const ToolCut& base = run.tools[i];
    const Commands& commanded = part_commands(all_commands, i);
    if (commanded.samples.states.size() != base.T_wt.size())
      throw BadInput(run.study.file.string(), 0, 0,
                     "engine = \"full\" for a case with samples that depend on the machine",
                     run.ready.arm.name);
    machines.push_back(
        {tool_poses(part, commanded, has_deflection ? part_process(process, i) : base.process,
                    needed[i]),
         std::nullopt, part.scene.tool});
    if (base.spindle)
      machines.back().spindle = spindle_line(part.truth.actual, *part.machine.workpiece_spindle);
  }
  return machines;
}

/// Returns the distance along the normal, mm, at which a cutter of another shape leaves the surface
/// on the move of a pass.
double surface_distance(const BaseRun& run, const cutting::CutterMotion& motion,
                        const CompetingPass& pass, const cutting::Cutter& cutter) {
  const cutting::Design& design = run.ready.job.design_w;
  const cutting::Ray ray{design.vertices.row(pass.vertex).transpose(),
                         design.normals.row(pass.vertex).transpose(), run.ready.job.scene.band};
  const auto entry =
      cutting::first_entry(cutter, cutting::move_after(motion, pass.move), ray, ray.band);
  // A cutter that misses the vertex does not change its height.
  return entry ? entry->s : pass.distance;
}

/// Returns the distance from the centre of a nose to its edge in the direction psi, mm.
double edge_radius(const cutting::Nose& nose, double psi) {
  double radius = nose.radius;
  for (const cutting::NoseWave& wave : nose.waves)
    radius += wave.amplitude * std::cos(wave.order * psi + wave.phase);
  return radius;
}

/// Returns the vector from one edge to another at the contact, along the normal, (x, z) of frame t,
/// mm.
Eigen::Vector2d edge_offset(const cutting::EdgeProfile& from, const cutting::EdgeProfile& to,
                            const Vector3d& contact_t) {
  const Eigen::Vector2d point(contact_t.x(), contact_t.z());
  const cutting::OutlineDistance from_distance = cutting::distance(from.segments, point);
  return (from_distance.value - cutting::distance(to.segments, point).value) *
         from_distance.gradient;
}

/// Adds the change of the cutter of a tool to a column.
void add_cutter_change(const BaseRun& run, std::size_t tool, const cutting::Cutter& from,
                       const cutting::Cutter& to, double per_unit, Columns& column) {
  if (same_shape(from, to)) return;
  if (cutting::is_hollow(from) || cutting::is_hollow(to))
    throw std::invalid_argument(
        "influence maps: expected convex tools, seen a concave tool.kind = \"profile\"");
  const cutting::CutterMotion motion =
      cutter_motion(run.tools[tool].T_wt, run.tools[tool].commanded.samples);
  tbb::parallel_for(std::size_t(0), run.passes.size(), [&](std::size_t r) {
    const ToolPass& pass = run.passes[r];
    if (pass.tool != tool) return;
    const double larger = surface_distance(run, motion, pass, to);
    const double smaller = surface_distance(run, motion, pass, from);
    column.slope(0, Index(r)) += (larger - smaller) * per_unit;
  });
}

/// Returns the displacement of a contact, mm per unit, by a change of the nose. An edge that lies
/// farther out moves the contact away from its centre.
Vector3d nose_displacement(const BaseRun& run, const ToolPass& pass, const cutting::Nose& from,
                           const cutting::Nose& to, double per_unit) {
  const ToolCut& base = run.tool(pass);
  const std::array<MoveEnd, 2> ends = move_ends(run, pass);
  const Pose T_wt =
      tool_at(run, pass, {{base.T_wt[ends[0].sample], base.T_wt[ends[1].sample]}, base.spindle});
  const Vector3d contact_t = T_wt.inverse() * pass.contact;
  if (from.profile) {
    const Eigen::Vector2d offset = edge_offset(*from.profile, *to.profile, contact_t) * per_unit;
    return T_wt.linear() * Vector3d(offset.x(), 0.0, offset.y());
  }
  const double psi = std::atan2(contact_t.z(), contact_t.x());
  const double offset = (edge_radius(to, psi) - edge_radius(from, psi)) * per_unit;
  return offset * (pass.contact - T_wt.translation()).normalized();
}

/// Returns the column of any other input, by the difference of the machines at `stepped_scenes`:
/// that of the poses of their tools at the passes, and that of their tool shapes. With compliance
/// each machine is cut with its own forces.
/// @throws BadInput if a machine cannot cut the program, or its samples differ from the base run's
Columns difference_columns(const BaseRun& run, Index input, const std::array<Scene, 2>& scenes) {
  const std::array<double, 2> values = difference_points(run.study, input);
  const double per_unit = 1.0 / (values[1] - values[0]);
  std::vector<std::vector<std::size_t>> samples;
  for (std::size_t i = 0; i < run.tools.size(); ++i) samples.push_back(pass_samples(run, i));
  const std::array sides{difference_machines(run, scenes[0], samples),
                         difference_machines(run, scenes[1], samples)};
  const auto tool_on = [&](std::size_t side, const ToolPass& pass) {
    const DifferenceMachine& machine = sides[side][pass.tool];
    Tool tool{{}, machine.spindle};
    const std::array<MoveEnd, 2> ends = move_ends(run, pass);
    for (std::size_t e = 0; e < 2; ++e)
      tool.T_wt[e] =
          machine.T_wt[std::size_t(std::ranges::lower_bound(samples[pass.tool], ends[e].sample) -
                                   samples[pass.tool].begin())];
    return tool;
  };
  Columns columns{Eigen::MatrixXd(1, Index(run.passes.size())),
                  Eigen::MatrixXd(1, Index(run.passes.size()))};
  tbb::parallel_for(std::size_t(0), run.passes.size(), [&](std::size_t r) {
    const ToolPass& pass = run.passes[r];
    const Vector3d d = per_unit * displacement(run, pass, tool_on(0, pass), tool_on(1, pass));
    columns.slope(0, Index(r)) = pass.gradient.dot(d);
    columns.shift(0, Index(r)) = pass.across.dot(d);
    const auto* from = std::get_if<cutting::Nose>(&sides[0][pass.tool].tool.actual);
    if (from == nullptr) return;
    const Vector3d by_nose = nose_displacement(
        run, pass, *from, std::get<cutting::Nose>(sides[1][pass.tool].tool.actual), per_unit);
    columns.slope(0, Index(r)) += pass.gradient.dot(by_nose);
    columns.shift(0, Index(r)) += pass.across.dot(by_nose);
  });
  for (std::size_t i = 0; i < run.tools.size(); ++i)
    if (const auto* from = std::get_if<cutting::Cutter>(&sides[0][i].tool.actual))
      add_cutter_change(run, i, *from, std::get<cutting::Cutter>(sides[1][i].tool.actual), per_unit,
                        columns);
  return columns;
}

constexpr std::uint64_t check_stream = 0x2545f4914f6cdd1dULL;

/// Returns the columns of all inputs.
Columns input_columns(const BaseRun& run, const Progress& progress) {
  const Index p = Index(run.study.inputs.size()), m = Index(run.passes.size());
  Columns result{Eigen::MatrixXd(p, m), Eigen::MatrixXd(p, m)};
  const auto enter = [&](Index input, const Columns& columns, Index row) {
    result.slope.row(input) = columns.slope.row(row);
    result.shift.row(input) = columns.shift.row(row);
  };
  std::vector<GeometricInput> geometric;
  for (Index i = 0; i < p; ++i) {
    if (progress) progress("inputs", double(i) / double(p));
    if (is_reshaping(run.study.inputs[std::size_t(i)]))
      throw BadInput(run.study.file.string(), 0, 0,
                     "engine = \"full\" for an input that changes part, program, nominal machine "
                     "or stock",
                     run.study.inputs[std::size_t(i)].name);
    const std::array<Scene, 2> scenes = stepped_scenes(run, i);
    if (auto model = geometric_input(run, i, scenes))
      geometric.push_back(std::move(*model));
    else
      enter(i, difference_columns(run, i, scenes), 0);
  }
  const Columns jacobian_columns = geometric_columns(run, geometric);
  for (std::size_t k = 0; k < geometric.size(); ++k)
    enter(geometric[k].input, jacobian_columns, Index(k));
  return result;
}

/// Cuts machines in full to find where the maps fail. Machines that cannot cut the program are left
/// out.
class FullCutChecks {
 public:
  FullCutChecks(const Study& study, const PreparedConfiguration& ready)
      : study_(study), ready_(ready) {}

  std::optional<cutting::Surface> cut(const Eigen::VectorXd& x) {
    try {
      CutCase machine = cut_at(study_, ready_, ready_.job, x);
      has_cut_ = true;
      return std::move(machine.surface);
    } catch (const BadScene&) {
      last_error_ = std::current_exception();
    } catch (const BadInput&) {
      last_error_ = std::current_exception();
    }
    return std::nullopt;
  }

  /// @throws the error of the last machine if no machine could be cut
  void throw_unless_checked() const {
    if (!has_cut_ && last_error_) std::rethrow_exception(last_error_);
  }

 private:
  const Study& study_;
  const PreparedConfiguration& ready_;
  bool has_cut_ = false;
  std::exception_ptr last_error_;
};

/// Returns the error of a map at a vertex, mm; infinite if only one of map and full cut has a
/// surface there.
double map_error(const InfluenceMap& map, const cutting::Surface& surface, Index v,
                 double estimated) {
  const bool has_reference = std::isfinite(map.error_free[v]);
  const bool is_cut_in_full =
      has_reference && surface.status[std::size_t(v)] == cutting::VertexStatus::Cut;
  const bool has_estimate = std::isfinite(estimated);
  if (is_cut_in_full && has_estimate) return std::abs(estimated - surface.residual[v]);
  return is_cut_in_full == has_estimate ? 0.0 : infinity;
}

double flagged_percent(const InfluenceMap& map, double limit) {
  double flagged_area = 0.0, area = 0.0;
  for (Index v = 0; v < map.max_error.size(); ++v) {
    if (map.status[std::size_t(v)] == cutting::VertexStatus::Outside) continue;
    area += map.design.area[v];
    if (map.max_error[v] > limit) flagged_area += map.design.area[v];
  }
  return area > 0.0 ? 100.0 * flagged_area / area : 0.0;
}

/// Returns (n) the largest error of the map at each vertex over the checked machines, mm.
Eigen::VectorXd largest_errors(const BaseRun& run, const InfluenceMap& map,
                               const Progress& progress) {
  const Study& study = run.study;
  Eigen::VectorXd max_error = Eigen::VectorXd::Zero(map.design.vertices.rows());
  const int count = study.influence.checks;
  if (count == 0) return max_error;
  const Sequence random{Sampling::Random, int(study.inputs.size()), study.seed ^ check_stream};
  const Eigen::MatrixXd x = draw_inputs(study, points(random, 0, count));
  const Eigen::MatrixXd estimated = maps(map, x);
  FullCutChecks checks(study, run.ready);
  for (int i = 0; i < count; ++i) {
    if (progress) progress("checks", double(i) / count);
    const std::optional<cutting::Surface> surface = checks.cut(x.col(i));
    if (!surface) continue;
    for (Index v = 0; v < max_error.size(); ++v)
      max_error[v] = std::max(max_error[v], map_error(map, *surface, v, estimated(v, i)));
  }
  checks.throw_unless_checked();
  return max_error;
}

/// Removes the passes of vertices without a surface in the error-free map, if the study compares
/// with that map.
BaseRun keep_comparable_passes(BaseRun run) {
  if (run.study.subtracts_error_free_map)
    std::erase_if(run.passes, [&](const ToolPass& pass) {
      return !std::isfinite(run.ready.error_free.residual[pass.vertex]);
    });
  return run;
}

/// Returns the map with the passes of every vertex in order, without the effects of inputs.
InfluenceMap map_frame(const BaseRun& run) {
  const std::vector<ToolPass>& passes = run.passes;
  const Job& job = run.ready.job;
  const Index vertex_count = job.design_w.vertices.rows();
  InfluenceMap map;
  map.design = job.design_w;
  map.centre = centre(run.study);
  map.error_free = Eigen::VectorXd::Zero(vertex_count);
  map.status.assign(std::size_t(vertex_count), cutting::VertexStatus::Uncut);
  const auto& judged = job.design_w.judged;
  for (Index v = 0; v < vertex_count; ++v)
    if (!judged.empty() && !judged[std::size_t(v)])
      map.status[std::size_t(v)] = cutting::VertexStatus::Outside;
  for (const cutting::Gouge& gouge : run.gouges)
    map.status[std::size_t(gouge.vertex)] = cutting::VertexStatus::Gouged;
  if (run.study.subtracts_error_free_map) map.error_free = run.ready.error_free.residual;
  map.distance.resize(Index(passes.size()));
  map.half_curvature.resize(Index(passes.size()));
  map.first.assign(std::size_t(vertex_count) + 1, 0);
  for (std::size_t r = 0; r < passes.size(); ++r) {
    ++map.first[std::size_t(passes[r].vertex) + 1];
    map.status[std::size_t(passes[r].vertex)] = cutting::VertexStatus::Cut;
    map.distance[Index(r)] = passes[r].distance;
    map.half_curvature[Index(r)] = 0.5 * passes[r].curvature;
  }
  for (std::size_t v = 0; v < std::size_t(vertex_count); ++v) map.first[v + 1] += map.first[v];
  return map;
}

/// Returns the reason why a base run has no pass.
std::string uncut_message(const BaseRun& run) {
  const std::string& arm = run.ready.arm.name;
  if (run.gouges.empty()) return fmt::format("no vertices cut ({})", arm);
  return fmt::format("no vertices cut within {} mm, {} {} gouged deeper ({})",
                     run.ready.job.scene.band, run.gouges.size(),
                     run.gouges.size() == 1 ? "vertex" : "vertices", arm);
}

}  // namespace

InfluenceMap influence_map(const Study& study, const PreparedConfiguration& ready,
                           const Progress& progress) {
  const BaseRun run = keep_comparable_passes(base_run(study, ready, progress));
  if (run.passes.empty())
    throw BadInput(study.scene.string(), 0, 0,
                   "a program that cuts the part within the band with every input at its centre",
                   uncut_message(run));
  InfluenceMap map = map_frame(run);
  Columns columns = input_columns(run, progress);
  map.slope = std::move(columns.slope);
  map.shift = std::move(columns.shift);
  map.max_error = largest_errors(run, map, progress);
  map.flagged_percent = flagged_percent(map, study.influence.flag_threshold);
  return map;
}

}  // namespace abbe::sim::study
