#include "sim/cut/follow.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cutting/engagement.h"
#include "kinematics/units.h"
#include "sim/cut/milling_looks.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/turning.h"

namespace abbe::sim {
namespace {

using errors::Load;
using kinematics::AxisState;
using kinematics::Pose;

Look looked(const cutting::CuttingLoad& cut) {
  Look look;
  look.cut = cut;
  look.load.on_tool_t = cut.on_tool_t;
  look.load.contact_t = cut.contact_t;
  return look;
}

/// Height above the tip whose motion is the feed.
double feed_height(const cutting::Cutter& cutter) {
  const double corner = cutting::corner_height(cutter);
  return corner > 0.0 ? corner : 0.5 * cutter.flank_length;
}

/// Edge in material and largest chip of an engagement.
void note_engagement(const cutting::Engagement& met, int flutes, double feed_per_tooth,
                     Look& look) {
  const double feed_across = met.feed_t.head<2>().norm(), feed_along = -met.feed_t.z();
  const double towards = std::atan2(met.feed_t.y(), met.feed_t.x());
  for (const cutting::EngagedArc& arc : met.arcs) {
    const cutting::EdgeSlice& slice = met.slices[std::size_t(arc.slice)];
    look.engaged += slice.length * (arc.to - arc.from) / (2 * pi) * flutes;
    // nearest that the arc comes to the feed's direction
    const double middle = 0.5 * (arc.from + arc.to), half = 0.5 * (arc.to - arc.from);
    const double off = std::max(0.0, std::abs(std::remainder(middle - towards, 2 * pi)) - half);
    const double facing =
        feed_across * std::sin(slice.kappa) * std::cos(off) + feed_along * std::cos(slice.kappa);
    look.chip = std::max(look.chip, feed_per_tooth * facing);
  }
}

void note_crash(std::vector<int>& lines, int line) {
  if (std::find(lines.begin(), lines.end(), line) == lines.end() && lines.size() < 1000)
    lines.push_back(line);
}

/// How the spindle of a cut turns: refuses one that does not, or turns against the flutes.
void check_spindle(const FollowedProgram& program, std::size_t sample, bool turns_as_it_should,
                   const char* expected) {
  const double speed = program.samples.states[sample].spindle_speed;
  if (speed > 0.0 && turns_as_it_should) return;
  throw BadInput(program.path.file, program.samples.line[sample], 0, expected,
                 speed > 0.0 ? "a cut with the spindle turning the other way"
                             : "a cut with the spindle at rest");
}

/// What milling has at hand at one look.
struct MillingLook {
  const CuttingDescription& description;
  const FollowedProgram& program;
  const cutting::Cutter& cutter;
  const cutting::Stock& stock;
  std::size_t before, sample;
  int spindle;  ///< joint

  Eigen::Vector3d feed_w() const {
    const Eigen::Vector3d p_t(0, 0, feed_height(cutter));
    return program.T_wt[sample] * p_t - program.T_wt[before] * p_t;
  }
  double duration() const {
    return program.samples.states[sample].time_s - program.samples.states[before].time_s;
  }
  /// M3 counts up; seen from the spindle it turns clockwise.
  bool is_clockwise() const {
    return program.samples.states[sample].q[spindle] > program.samples.states[before].q[spindle];
  }
  Look at(const Pose& T_wt) const;
};

Look MillingLook::at(const Pose& T_wt) const {
  const cutting::Engagement met = cutting::engagement(stock, cutter, T_wt, feed_w());
  if (met.arcs.empty()) return {};
  check_spindle(program, sample, is_clockwise() == description.flutes.clockwise,
                description.flutes.clockwise
                    ? "a spindle that turns clockwise (S and M3) where it cuts"
                    : "a spindle that turns counter-clockwise (S and M4) where it cuts");
  const double per_tooth =
      feed_w().norm() / duration() * 2 * pi /
      (program.samples.states[sample].spindle_speed * description.flutes.count);
  if (per_tooth > cutter.radius)
    throw BadInput(program.path.file, program.samples.line[sample], 0,
                   "a feed per tooth within the cutter's radius",
                   fmt::format("{:.3g} mm", per_tooth));
  Look look =
      looked(cutting::mean_force(met, *description.material, description.flutes, per_tooth));
  note_engagement(met, description.flutes.count, per_tooth, look);
  return look;
}

/// The step at a sample: closed under a force that the cut makes, unloaded where there is none.
ProcessStep step_at(const CuttingDescription& description, const FollowedProgram& program,
                    std::size_t sample, const std::function<Look(const Pose&)>& force,
                    const Process& before) {
  const Load guess = before.steps.empty() ? Load{} : before.steps.back().load;
  ProcessStep step;
  if (force) step = closed_step(description, program.pose, sample, force, guess);
  const AxisState& state = program.samples.states[sample];
  step.time_s = state.time_s;
  step.line = program.samples.line[sample];
  step.power_W = step.torque * state.spindle_speed * 1e-3;  // N mm rad/s
  return step;
}

Process follow_milling(const Scene& scene, const Machine& machine, const cutting::Design& design_m,
                       const FollowedProgram& program,
                       const std::function<void(double)>& progress) {
  const CuttingDescription& description = *scene.cutting;
  const auto& cutter = std::get<cutting::Cutter>(program.tool);
  Process process;
  const cutting::Blank blank = blank_of(scene, design_m);
  if (std::string odd = odd_blank(scene, blank); !odd.empty())
    process.warnings.push_back(std::move(odd));
  process.stock = blank_stock(scene, blank);
  if (std::string uncovered = uncovered_text(scene, *process.stock, design_m); !uncovered.empty())
    process.warnings.push_back(std::move(uncovered));
  const auto spindle = spindle_of(machine);
  if (description.material && !spindle)
    throw std::invalid_argument("a machine with a spindle nose s for a cut with forces");
  Pose before = program.pose(0, {});
  const std::vector<std::size_t> at = milling_looks(program.samples, program.path, program.T_wt,
                                                    description.step, cutter.flank_length);
  for (std::size_t k = 1; k < at.size(); ++k) {
    const MillingLook look{description,        program, cutter, *process.stock, at[k - 1], at[k],
                           spindle.value_or(0)};
    const bool rapid = is_rapid(program.samples, program.path, at[k]);
    std::function<Look(const Pose&)> force;
    if (!rapid && description.material && look.duration() > 0.0 && look.feed_w().norm() > 0.0)
      force = [&](const Pose& T_wt) { return look.at(T_wt); };
    ProcessStep step = step_at(description, program, at[k], force, process);
    const Pose after = program.pose(at[k], step.load);
    const cutting::Removed taken =
        cutting::remove(*process.stock, cutter, {before, after, step.line, rapid});
    step.removed = taken.volume;
    if (taken.crashed) note_crash(process.crash_lines, step.line);
    process.steps.push_back(step);
    before = after;
    if (progress && k % 256 == 0) progress(double(k) / double(at.size()));
  }
  return process;
}

/// Radius of the work where the edge is in it, the mean over the chip.
double work_radius(const SpindleLine& line, const Pose& T_slow, const cutting::Nose& nose,
                   const std::vector<cutting::EngagedEdge>& edges) {
  double weighted = 0.0, area = 0.0;
  for (const cutting::EngagedEdge& edge : edges) {
    Eigen::Vector3d p_t(nose.radius * std::cos(edge.psi), 0.0, nose.radius * std::sin(edge.psi));
    if (nose.profile) {
      const Eigen::Vector2d at = cutting::edge_point(*nose.profile, edge.psi).at;
      p_t = {at.x(), 0.0, at.y()};
    }
    const double r = (T_slow * p_t - line.point_w).cross(line.direction_w).norm();
    weighted += r * edge.chip * edge.length;
    area += edge.chip * edge.length;
  }
  return area > 0.0 ? weighted / area : 0.0;
}

/// Whether the work comes down on the rake face, along -y of frame t, as the spindle angle grows.
bool comes_down(const SpindleLine& line, const Pose& T_slow) {
  const Eigen::Vector3d arm = T_slow.translation() - line.point_w;
  return line.direction_w.cross(arm).dot(T_slow.linear().col(1)) > 0.0;
}

/// What turning has at hand at one look.
struct TurningLook {
  const CuttingDescription& description;
  const FollowedProgram& program;
  const cutting::Nose& nose;
  const cutting::TurnedStock& stock;
  const SpindleLine& line;
  std::size_t before, sample;
  int spindle;  ///< joint

  Pose slow(const Pose& T_wt) const {
    return slow_pose(line, program.samples.states[sample].q[spindle], T_wt);
  }
  Look at(const Pose& T_wt) const;
};

/// Away from the part along the radius, in the tool's x and z; zero at the spindle line.
Eigen::Vector2d away_from_part(const SpindleLine& line, const Pose& T_slow) {
  const Eigen::Vector3d arm = T_slow.translation() - line.point_w;
  const Eigen::Vector3d out = arm - arm.dot(line.direction_w) * line.direction_w;
  const Eigen::Vector3d out_t = T_slow.linear().transpose() * out;
  const Eigen::Vector2d away(out_t.x(), out_t.z());
  return away.norm() > 1e-9 ? Eigen::Vector2d(away.normalized()) : Eigen::Vector2d::Zero();
}

/// The nose as it cuts a stock that knows no overhang.
cutting::Nose over_stock(const cutting::Nose& nose, const Eigen::Vector2d& away) {
  if (!nose.profile || away.isZero(0.0)) return nose;
  cutting::Nose drawn = nose;
  drawn.profile =
      std::make_shared<const cutting::EdgeProfile>(cutting::without_overhang(*nose.profile, away));
  return drawn;
}

/// mm, how much higher than its edges an insert is in the work.
double beyond_edges(const cutting::Nose& nose, const cutting::Nose& drawn,
                    const Eigen::Vector2d& away, const std::vector<cutting::EngagedEdge>& edges) {
  if (!nose.profile || away.isZero(0.0)) return 0.0;
  const double lowest = cutting::foremost(*nose.profile, -away).dot(away);
  const Eigen::Vector2d across(away.y(), -away.x());
  const double right = cutting::edge_height(*nose.profile, away, across),
               left = cutting::edge_height(*nose.profile, away, -across);
  double beyond = 0.0;
  for (const cutting::EngagedEdge& edge : edges) {
    const cutting::EdgePoint point = cutting::edge_point(*drawn.profile, edge.psi);
    const double height = point.outward.dot(across) > 0.0 ? right : left;
    if (edge.chip > 0.0) beyond = std::max(beyond, point.at.dot(away) - lowest - height);
  }
  return beyond;
}

Look TurningLook::at(const Pose& T_wt) const {
  const Pose T_slow = slow(T_wt);
  const Eigen::Vector2d away = away_from_part(line, T_slow);
  const cutting::Nose drawn = over_stock(nose, away);
  const auto edges = cutting::engagement(stock, drawn, T_slow);
  if (edges.empty()) return {};
  const auto& states = program.samples.states;
  const bool grows = states[sample].q[spindle] > states[before].q[spindle];
  check_spindle(program, sample, grows == comes_down(line, T_slow),
                "a spindle that brings the work down on the rake face where it cuts");
  Look look = looked(cutting::turning_force(edges, drawn, *description.material,
                                            work_radius(line, T_slow, drawn, edges)));
  for (const cutting::EngagedEdge& edge : edges) {
    look.engaged += edge.length;
    look.chip = std::max(look.chip, edge.chip);
  }
  look.beyond_edge = beyond_edges(nose, drawn, away, edges);
  return look;
}

Process follow_turning(const Scene& scene, const Machine& machine, const FollowedProgram& program,
                       const std::function<void(double)>& progress) {
  const CuttingDescription& description = *scene.cutting;
  constexpr double scratch = 1e-3;  // mm^3, less is no crash
  const auto& nose = std::get<cutting::Nose>(program.tool);
  const auto& states = program.samples.states;
  const int spindle = *machine.workpiece_spindle;
  const SpindleLine line = spindle_line(program.chain, spindle);
  Process process;
  process.turned = turned_blank(scene, line);
  const std::vector<std::size_t> at =
      turning_looks(program.samples, program.path, program.T_wt, spindle, line);
  Pose before = slow_pose(line, states.front().q[spindle], program.pose(0, {}));
  for (std::size_t k = 1; k < at.size(); ++k) {
    const TurningLook look{description, program,   nose,  *process.turned,
                           line,        at[k - 1], at[k], spindle};
    const bool rapid = is_rapid(program.samples, program.path, at[k]);
    std::function<Look(const Pose&)> force;
    if (!rapid && description.material) force = [&](const Pose& T_wt) { return look.at(T_wt); };
    ProcessStep step = step_at(description, program, at[k], force, process);
    const Pose after = look.slow(program.pose(at[k], step.load));
    step.removed =
        cutting::remove(*process.turned, nose, before, after, rapid ? -step.line : step.line);
    if (rapid && step.removed > scratch) note_crash(process.crash_lines, step.line);
    process.steps.push_back(step);
    before = after;
    if (progress && k % 64 == 0) progress(double(k) / double(at.size()));
  }
  return process;
}

}  // namespace

Process follow(const Scene& scene, const Machine& machine, const cutting::Design& design_m,
               const FollowedProgram& program, const std::function<void(double)>& progress) {
  if (!scene.cutting || program.samples.states.empty()) return {};
  try {
    if (std::holds_alternative<cutting::Cutter>(program.tool))
      return follow_milling(scene, machine, design_m, program, progress);
    return follow_turning(scene, machine, program, progress);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a blank that can be", fault.what());
  } catch (const std::length_error& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a blank that fits in [cutting] max_MiB",
                   fault.what());
  }
}

}  // namespace abbe::sim
