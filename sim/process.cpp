#include "sim/process.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cutting/force.h"
#include "cutting/read_mesh.h"
#include "kinematics/units.h"
#include "sim/tool_motion.h"

namespace abbe::sim {
namespace {

using errors::Load;
using kinematics::AxisState;
using kinematics::Pose;

cutting::Blank blank_of(const CuttingDescription& description, const cutting::Design& design_m) {
  return std::visit(
      [&](const auto& blank) -> cutting::Blank {
        using Shape = std::decay_t<decltype(blank)>;
        if constexpr (std::is_same_v<Shape, CuttingDescription::OffsetBlank>) {
          return cutting::offset_blank(design_m, blank.allowance, blank.floor);
        } else if constexpr (std::is_same_v<Shape, MeshFile>) {
          cutting::ReadMeshOptions options;
          options.unit_mm = blank.unit;
          const cutting::Design mesh = cutting::read_mesh(blank.file, options);
          return cutting::MeshBlank{mesh.vertices, mesh.triangles};
        } else if constexpr (std::is_same_v<Shape, CuttingDescription::TurnedBlank>) {
          throw std::invalid_argument("a blank that is milled, not a turned one");
        } else {
          return blank;
        }
      },
      description.blank);
}

/// What one look at the cut gives.
struct Look {
  cutting::CuttingLoad cut;
  Load load;
};

Look looked(const cutting::CuttingLoad& cut) {
  Look look;
  look.cut = cut;
  look.load.on_tool_t = cut.on_tool_t;
  look.load.contact_t = cut.contact_t;
  return look;
}

/// Force and deflection brought to agree at one step.
class Loop {
 public:
  Loop(const CuttingDescription& description, const PoseUnderLoad& pose)
      : description_(description), pose_(pose) {}

  /// @param force  what the cut does to a tool that stands at a pose
  /// @param guess  where to begin
  ProcessStep close(std::size_t sample, const std::function<Look(const Pose&)>& force,
                    const Load& guess) const;

 private:
  const CuttingDescription& description_;
  const PoseUnderLoad& pose_;
};

ProcessStep Loop::close(std::size_t sample, const std::function<Look(const Pose&)>& force,
                        const Load& guess) const {
  ProcessStep step;
  Load load = guess;
  Pose T_wt = pose_(sample, load);
  double relaxation = 1.0, last_change = 0.0;
  kinematics::Wrench last_difference = kinematics::Wrench::Zero();
  step.converged = false;
  while (step.iterations < description_.most_iterations) {
    ++step.iterations;
    const Look look = force(T_wt);
    step.torque = look.cut.torque;
    step.load = look.load;
    const Pose told = pose_(sample, look.load);
    const double change = (told * look.load.contact_t - T_wt * look.load.contact_t).norm();
    step.disagreement = change;
    if (!(change > description_.tolerance)) {
      step.converged = std::isfinite(change);
      break;
    }
    const kinematics::Wrench difference = look.load.on_tool_t - load.on_tool_t;
    // below a hundred tolerances the ends of arcs on the grid of the stock show, not the loop
    if (last_change > 100 * description_.tolerance && relaxation == 1.0)
      step.contraction = std::max(step.contraction, change / last_change);
    const kinematics::Wrench bend = difference - last_difference;
    const bool slow = last_change > 0.0 && change > 0.3 * last_change;
    // Aitken: where plain repetition is slow or swings, the secant of the last two
    if (slow && bend.head<3>().squaredNorm() > 0.0)
      relaxation = std::clamp(-relaxation * last_difference.head<3>().dot(bend.head<3>()) /
                                  bend.head<3>().squaredNorm(),
                              0.05, 2.0);
    load.on_tool_t += relaxation * difference;
    load.contact_t = look.load.contact_t;
    last_difference = difference;
    last_change = change;
    T_wt = relaxation == 1.0 ? told : pose_(sample, load);
  }
  return step;
}

/// Samples at which milling looks: after every `step` of tip travel, and where rapid and feed meet.
std::vector<std::size_t> looks(const FollowedProgram& program, double step) {
  const auto rapid = [&](std::size_t i) {
    return program.path.blocks[std::size_t(program.samples.block[i])].interpolation ==
           program::Interpolation::Rapid;
  };
  std::vector<std::size_t> at{0};
  double travel = 0.0;
  const std::size_t n = program.samples.states.size();
  for (std::size_t i = 1; i < n; ++i) {
    travel += (program.T_wt[i].translation() - program.T_wt[i - 1].translation()).norm();
    if (travel < step && i + 1 < n && rapid(i) == rapid(i + 1)) continue;
    at.push_back(i);
    travel = 0.0;
  }
  return at;
}

void note_crash(std::vector<int>& lines, int line) {
  if (std::find(lines.begin(), lines.end(), line) == lines.end() && lines.size() < 1000)
    lines.push_back(line);
}

double power_W(double torque, double speed) { return torque * speed * 1e-3; }  // N mm rad/s

Process follow_milling(const Scene& scene, const CuttingDescription& description,
                       const cutting::Design& design_m, const FollowedProgram& program,
                       const std::function<void(double)>& progress) {
  const auto& cutter = std::get<cutting::Cutter>(program.tool);
  const auto& states = program.samples.states;
  Process process;
  process.stock = cutting::make_stock(
      blank_of(description, design_m), scene.part.T_wm,
      {description.spacing, description.three_directions, description.max_bytes});
  const Loop loop(description, program.pose);
  Pose before = program.pose(0, {});
  const std::vector<std::size_t> at = looks(program, description.step);
  for (std::size_t k = 1; k < at.size(); ++k) {
    const AxisState& state = states[at[k]];
    const int line = program.samples.line[at[k]];
    const bool rapid =
        program.path.blocks[std::size_t(program.samples.block[at[k]])].interpolation ==
        program::Interpolation::Rapid;
    const Eigen::Vector3d feed_w =
        program.T_wt[at[k]].translation() - program.T_wt[at[k - 1]].translation();
    const double duration = state.time_s - states[at[k - 1]].time_s;
    const bool cuts = !rapid && description.material && duration > 0.0 && feed_w.norm() > 0.0;
    const auto force = [&](const Pose& T_wt) -> Look {
      const cutting::Engagement met = cutting::engagement(*process.stock, cutter, T_wt, feed_w);
      if (met.arcs.empty()) return {};
      if (!(state.spindle_speed > 0.0))
        throw BadInput(program.path.file, line, 0, "a spindle that turns (S and M3) where it cuts",
                       "a cut with the spindle at rest");
      const double per_tooth =
          feed_w.norm() / duration * 2 * pi / (state.spindle_speed * description.flutes.count);
      return looked(cutting::mean_force(met, *description.material, description.flutes, per_tooth));
    };
    ProcessStep step;
    if (cuts)
      step = loop.close(at[k], force, process.steps.empty() ? Load{} : process.steps.back().load);
    step.time_s = state.time_s;
    step.line = line;
    step.power_W = power_W(step.torque, state.spindle_speed);
    const Pose after = program.pose(at[k], step.load);
    const cutting::Removed taken =
        cutting::remove(*process.stock, cutter, {before, after, line, rapid});
    step.removed = taken.volume;
    if (taken.crashed) note_crash(process.crash_lines, line);
    process.steps.push_back(step);
    before = after;
    if (progress && k % 256 == 0) progress(double(k) / double(at.size()));
  }
  return process;
}

/// A blank's profile over the part's z as one over the spindle line, in rising order.
Eigen::Matrix<double, Eigen::Dynamic, 2> profile_along(
    const SpindleLine& line, const Pose& T_wm,
    const Eigen::Matrix<double, Eigen::Dynamic, 2>& profile_m) {
  Eigen::Matrix<double, Eigen::Dynamic, 2> profile = profile_m;
  if (line.direction_w.dot(T_wm.linear().col(2)) < 0.0) {
    profile = profile_m.colwise().reverse().eval();
    profile.col(0) *= -1.0;
  }
  profile.col(0).array() += line.direction_w.dot(T_wm.translation() - line.point_w);
  return profile;
}

/// Radius of the work where the edge is in it, the mean over the chip.
double work_radius(const SpindleLine& line, const Pose& T_slow, const cutting::Nose& nose,
                   const std::vector<cutting::EngagedEdge>& edges) {
  double weighted = 0.0, area = 0.0;
  for (const cutting::EngagedEdge& edge : edges) {
    const Eigen::Vector3d p_t(nose.radius * std::cos(edge.psi), 0.0,
                              nose.radius * std::sin(edge.psi));
    const double r = (T_slow * p_t - line.point_w).cross(line.direction_w).norm();
    weighted += r * edge.chip * edge.length;
    area += edge.chip * edge.length;
  }
  return area > 0.0 ? weighted / area : 0.0;
}

Process follow_turning(const Scene& scene, const Machine& machine,
                       const CuttingDescription& description, const FollowedProgram& program,
                       const std::function<void(double)>& progress) {
  const auto* blank = std::get_if<CuttingDescription::TurnedBlank>(&description.blank);
  if (blank == nullptr) throw std::invalid_argument("a turned blank for a turning tool");
  const auto& nose = std::get<cutting::Nose>(program.tool);
  const auto& states = program.samples.states;
  const int spindle = *machine.workpiece_spindle;
  const SpindleLine line = spindle_line(program.chain, spindle);
  const auto profile = profile_along(line, scene.part.T_wm, blank->profile);
  Process process;
  process.turned =
      cutting::make_turned_stock(profile, description.spacing, line.point_w, line.direction_w);
  const Loop loop(description, program.pose);
  const auto slow = [&](const AxisState& state, const Pose& T_wt) {
    return slow_pose(line, state.q[spindle], T_wt);
  };
  Pose before = slow(states.front(), program.pose(0, {}));
  double turned = 0.0;
  for (std::size_t i = 1; i < states.size(); ++i) {
    const AxisState& state = states[i];
    turned += std::abs(state.q[spindle] - states[i - 1].q[spindle]);
    if (turned < 2 * pi * (1 - 1e-9) && i + 1 < states.size()) continue;
    turned = 0.0;
    const auto force = [&](const Pose& T_wt) {
      const Pose T_slow = slow(state, T_wt);
      const auto edges = cutting::engagement(*process.turned, nose, T_slow);
      return looked(cutting::turning_force(edges, nose, *description.material,
                                           work_radius(line, T_slow, nose, edges)));
    };
    ProcessStep step;
    if (description.material)
      step = loop.close(i, force, process.steps.empty() ? Load{} : process.steps.back().load);
    step.time_s = state.time_s;
    step.line = program.samples.line[i];
    step.power_W = power_W(step.torque, state.spindle_speed);
    const Pose after = slow(state, program.pose(i, step.load));
    step.removed = cutting::remove(*process.turned, nose, before, after);
    process.steps.push_back(step);
    before = after;
    if (progress && i % 64 == 0) progress(double(i) / double(states.size()));
  }
  return process;
}

}  // namespace

Process follow(const Scene& scene, const Machine& machine, const cutting::Design& design_m,
               const FollowedProgram& program, const std::function<void(double)>& progress) {
  if (!scene.cutting || program.samples.states.empty()) return {};
  try {
    if (std::holds_alternative<cutting::Cutter>(program.tool))
      return follow_milling(scene, *scene.cutting, design_m, program, progress);
    return follow_turning(scene, machine, *scene.cutting, program, progress);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a blank that can be", fault.what());
  } catch (const std::length_error& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a blank that fits in [cutting] max_MiB",
                   fault.what());
  }
}

Load load_at(const Process& process, double time_s) {
  const auto& steps = process.steps;
  const auto after =
      std::lower_bound(steps.begin(), steps.end(), time_s,
                       [](const ProcessStep& step, double time) { return step.time_s < time; });
  if (after == steps.end()) return {};
  if (after == steps.begin() || after->time_s == time_s)
    return after->time_s == time_s ? after->load : Load{};
  const ProcessStep& before = *(after - 1);
  const double part = (time_s - before.time_s) / (after->time_s - before.time_s);
  Load load;
  load.on_tool_t = (1 - part) * before.load.on_tool_t + part * after->load.on_tool_t;
  load.contact_t = (1 - part) * before.load.contact_t + part * after->load.contact_t;
  return load;
}

std::vector<kinematics::AxisVector> accelerations(const program::Samples& samples) {
  constexpr double window_s = 0.02;
  const auto& states = samples.states;
  std::vector<kinematics::AxisVector> all(states.size());
  const auto at = [&](double time_s, std::size_t near) -> kinematics::AxisVector {
    std::size_t i = near;
    while (i + 1 < states.size() && states[i + 1].time_s <= time_s) ++i;
    while (i > 0 && states[i].time_s > time_s) --i;
    if (i + 1 == states.size() || time_s <= states[i].time_s) return states[i].q;
    const double part = (time_s - states[i].time_s) / (states[i + 1].time_s - states[i].time_s);
    return (1 - part) * states[i].q + part * states[i + 1].q;
  };
  for (std::size_t i = 0; i < states.size(); ++i) {
    const double t = states[i].time_s;
    all[i] = (at(t + window_s, i) - 2 * states[i].q + at(t - window_s, i)) / (window_s * window_s);
  }
  return all;
}

}  // namespace abbe::sim
