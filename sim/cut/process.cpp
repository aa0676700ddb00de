#include "sim/cut/process.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "cutting/force.h"
#include "cutting/read_mesh.h"
#include "kinematics/units.h"
#include "sim/cut/tool_motion.h"

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
  double engaged = 0.0;  // mm of edge
  double chip = 0.0;     // mm
};

Look looked(const cutting::CuttingLoad& cut) {
  Look look;
  look.cut = cut;
  look.load.on_tool_t = cut.on_tool_t;
  look.load.contact_t = cut.contact_t;
  return look;
}

/// Force and deflection of one step, brought to agree.
class Loop {
 public:
  /// @param force  what the cut does to a tool that stands at a pose
  Loop(const CuttingDescription& description, const PoseUnderLoad& pose, std::size_t sample,
       const std::function<Look(const Pose&)>& force)
      : description_(description), pose_(pose), sample_(sample), force_(force) {}

  ProcessStep close(const Load& guess);

 private:
  bool repeat(Load load);
  bool bracket();
  bool look_at(const Load& load);

  const CuttingDescription& description_;
  const PoseUnderLoad& pose_;
  std::size_t sample_;
  const std::function<Look(const Pose&)>& force_;
  ProcessStep step_;
  Look look_;         // at the last load
  Pose T_wt_, told_;  // under the last load, and under what it makes of itself
};

/// Looks at the cut under a load. @return true if that load is what the cut gives, to the tolerance
bool Loop::look_at(const Load& load) {
  ++step_.iterations;
  T_wt_ = pose_(sample_, load);
  look_ = force_(T_wt_);
  told_ = pose_(sample_, look_.load);
  const Eigen::Vector3d contact_t =
      look_.load.on_tool_t.isZero(0.0) ? load.contact_t : look_.load.contact_t;
  step_.disagreement = (told_ * contact_t - T_wt_ * contact_t).norm();
  step_.load = look_.load;
  return step_.disagreement <= description_.tolerance;
}

/// Repetition, and the secant of the last two (Aitken) where it is slow or swings.
bool Loop::repeat(Load load) {
  double relaxation = 1.0, last_change = 0.0;
  kinematics::Wrench last_difference = kinematics::Wrench::Zero();
  while (step_.iterations < description_.most_iterations) {
    if (look_at(load)) return true;
    const double change = step_.disagreement;
    const kinematics::Wrench difference = look_.load.on_tool_t - load.on_tool_t;
    // below a hundred tolerances the ends of arcs on the grid of the stock show, not the loop
    if (last_change > 100 * description_.tolerance && relaxation == 1.0)
      step_.contraction = std::max(step_.contraction, change / last_change);
    const kinematics::Wrench bend = difference - last_difference;
    const bool slow = last_change > 0.0 && change > 0.3 * last_change;
    if (slow && bend.head<3>().squaredNorm() > 0.0)
      relaxation = std::clamp(-relaxation * last_difference.head<3>().dot(bend.head<3>()) /
                                  bend.head<3>().squaredNorm(),
                              0.05, 2.0);
    load.on_tool_t += relaxation * difference;
    if (!look_.load.on_tool_t.isZero(0.0)) load.contact_t = look_.load.contact_t;
    last_difference = difference;
    last_change = change;
  }
  return false;
}

/// Force falls as the tool gives way, so the load lies between none and that of the rigid tool: its
/// share of that is bisected, then its direction and place are taken from what was found there.
bool Loop::bracket() {
  constexpr int most_directions = 8, most_halvings = 60;
  look_at({});
  Load rigid = look_.load;
  if (rigid.on_tool_t.isZero(0.0)) return true;
  for (int turn = 0; turn < most_directions; ++turn) {
    double low = 0.0, high = 1.0;  // the cut gives more than `low`, less than `high`
    Load load = rigid, firm = rigid;
    for (int i = 0; i < most_halvings; ++i) {
      const double share = 0.5 * (low + high);
      load = rigid;
      load.on_tool_t *= share;
      if (look_at(load)) return true;
      const bool gives_more = look_.load.on_tool_t.head<3>().dot(rigid.on_tool_t.head<3>()) >
                              share * rigid.on_tool_t.head<3>().squaredNorm();
      if (gives_more) firm = look_.load;
      (gives_more ? low : high) = share;
      const Pose other = pose_(sample_, [&] {
        Load end = rigid;
        end.on_tool_t *= gives_more ? high : low;
        return end;
      }());
      if ((other * rigid.contact_t - T_wt_ * rigid.contact_t).norm() <= description_.tolerance)
        break;
    }
    // along the direction tried the deflection is known; the cut may push another way there
    const double amount = load.on_tool_t.head<3>().norm();
    const kinematics::Wrench along = firm.on_tool_t * (amount / firm.on_tool_t.head<3>().norm());
    Load next = firm;
    next.on_tool_t = along;
    const Pose turned = pose_(sample_, next);
    const double moved = (turned * rigid.contact_t - T_wt_ * rigid.contact_t).norm();
    step_.load = load;
    step_.disagreement = moved;
    if (moved <= description_.tolerance) return true;
    // the rigid amount in the new direction, for the next bracket
    const double whole = rigid.on_tool_t.head<3>().norm();
    rigid = next;
    rigid.on_tool_t = along * (whole / amount);
  }
  return false;
}

ProcessStep Loop::close(const Load& guess) {
  step_.converged = repeat(guess) || bracket();
  step_.torque = look_.cut.torque;
  step_.engaged = look_.engaged;
  step_.chip = look_.chip;
  if (!step_.load.on_tool_t.allFinite()) {
    step_.load = {};
    step_.converged = false;
  }
  return step_;
}

/// Whether the block that runs at a sample is a rapid.
bool is_rapid(const FollowedProgram& program, std::size_t sample) {
  return program.path.blocks[std::size_t(program.samples.block[sample])].interpolation ==
         program::Interpolation::Rapid;
}

/// Angle between two directions, 0 where one has no length.
double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// Samples at which milling looks.
std::vector<std::size_t> looks(const FollowedProgram& program, double step, double reach) {
  constexpr double sharp = 0.1;  // rad
  const auto tip = [&](std::size_t i) -> Eigen::Vector3d { return program.T_wt[i].translation(); };
  const auto axis = [&](std::size_t i) -> Eigen::Vector3d {
    return program.T_wt[i].linear().col(2);
  };
  std::vector<std::size_t> at{0};
  double travel = 0.0;
  const std::size_t n = program.samples.states.size();
  for (std::size_t i = 1; i < n; ++i) {
    travel += (tip(i) - tip(i - 1)).norm() + reach * angle_between(axis(i), axis(i - 1));
    const bool last = i + 1 == n;
    if (travel < step && !last && is_rapid(program, i) == is_rapid(program, i + 1)) {
      const Eigen::Vector3d come = tip(i) - tip(at.back()), goes = tip(i + 1) - tip(i);
      if (angle_between(come, goes) < sharp) continue;
    }
    at.push_back(i);
    travel = 0.0;
  }
  return at;
}

/// Height above the tip whose motion is the feed.
double feed_height(const cutting::Cutter& cutter) {
  return cutter.corner_radius > 0.0 ? cutter.corner_radius : 0.5 * cutter.flank_length;
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
  if (force) step = Loop(description, program.pose, sample, force).close(guess);
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
  process.stock = cutting::make_stock(
      blank_of(description, design_m), scene.part.T_wm,
      {description.spacing, description.three_directions, description.max_bytes});
  const auto spindle = spindle_of(machine);
  if (description.material && !spindle)
    throw std::invalid_argument("a machine with a spindle nose s for a cut with forces");
  Pose before = program.pose(0, {});
  const std::vector<std::size_t> at = looks(program, description.step, cutter.flank_length);
  for (std::size_t k = 1; k < at.size(); ++k) {
    const MillingLook look{description,        program, cutter, *process.stock, at[k - 1], at[k],
                           spindle.value_or(0)};
    const bool rapid = is_rapid(program, at[k]);
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

Look TurningLook::at(const Pose& T_wt) const {
  const Pose T_slow = slow(T_wt);
  const auto edges = cutting::engagement(stock, nose, T_slow);
  if (edges.empty()) return {};
  const auto& states = program.samples.states;
  const bool grows = states[sample].q[spindle] > states[before].q[spindle];
  check_spindle(program, sample, grows == comes_down(line, T_slow),
                "a spindle that brings the work down on the rake face where it cuts");
  Look look = looked(cutting::turning_force(edges, nose, *description.material,
                                            work_radius(line, T_slow, nose, edges)));
  for (const cutting::EngagedEdge& edge : edges) {
    look.engaged += edge.length;
    look.chip = std::max(look.chip, edge.chip);
  }
  return look;
}

/// Samples at which turning looks: once a revolution, where rapid and feed meet, and after every
/// `step` of travel of a rapid or with the spindle at rest.
std::vector<std::size_t> revolutions(const FollowedProgram& program, int spindle,
                                     const SpindleLine& line) {
  constexpr double step = 0.1;  // mm
  const auto& states = program.samples.states;
  const auto place = [&](std::size_t i) -> Eigen::Vector3d {
    return slow_pose(line, states[i].q[spindle], program.T_wt[i]).translation();
  };
  std::vector<std::size_t> at{0};
  double turned = 0.0, travel = 0.0;
  for (std::size_t i = 1; i < states.size(); ++i) {
    turned += std::abs(states[i].q[spindle] - states[i - 1].q[spindle]);
    travel += (place(i) - place(i - 1)).norm();
    const bool last = i + 1 == states.size();
    const bool by_travel = is_rapid(program, i) || !(states[i].spindle_speed > 0.0);
    const bool due = by_travel ? travel >= step : turned >= 2 * pi * (1 - 1e-9);
    if (!due && !last && is_rapid(program, i) == is_rapid(program, i + 1)) continue;
    at.push_back(i);
    turned = travel = 0.0;
  }
  return at;
}

Process follow_turning(const Scene& scene, const Machine& machine, const FollowedProgram& program,
                       const std::function<void(double)>& progress) {
  const CuttingDescription& description = *scene.cutting;
  constexpr double scratch = 1e-3;  // mm^3, less is no crash
  const auto* blank = std::get_if<CuttingDescription::TurnedBlank>(&description.blank);
  if (blank == nullptr) throw std::invalid_argument("a turned blank for a turning tool");
  const auto& nose = std::get<cutting::Nose>(program.tool);
  const auto& states = program.samples.states;
  const int spindle = *machine.workpiece_spindle;
  const SpindleLine line = spindle_line(program.chain, spindle);
  Process process;
  process.turned = cutting::make_turned_stock(profile_along(line, scene.part.T_wm, blank->profile),
                                              description.spacing, line.point_w, line.direction_w);
  const std::vector<std::size_t> at = revolutions(program, spindle, line);
  Pose before = slow_pose(line, states.front().q[spindle], program.pose(0, {}));
  for (std::size_t k = 1; k < at.size(); ++k) {
    const TurningLook look{description, program,   nose,  *process.turned,
                           line,        at[k - 1], at[k], spindle};
    const bool rapid = is_rapid(program, at[k]);
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

ProcessTotals totals(const Process& process) {
  ProcessTotals all;
  for (const ProcessStep& step : process.steps) {
    const double force = step.load.on_tool_t.head<3>().norm();
    all.removed += step.removed;
    all.force_max = std::max(all.force_max, force);
    all.torque_max = std::max(all.torque_max, step.torque);
    all.power_max_W = std::max(all.power_max_W, step.power_W);
    all.iterations_max = std::max(all.iterations_max, step.iterations);
    all.contraction_max = std::max(all.contraction_max, step.contraction);
    if (force > 0.0) {
      all.force_sum += force;
      ++all.loaded;
    }
    if (step.converged) continue;
    ++all.open;
    all.disagreement_max = std::max(all.disagreement_max, step.disagreement);
  }
  return all;
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
  // an unloaded end has no place of its own
  const bool from = !before.load.on_tool_t.isZero(0.0), to = !after->load.on_tool_t.isZero(0.0);
  if (from && to)
    load.contact_t = (1 - part) * before.load.contact_t + part * after->load.contact_t;
  else
    load.contact_t = from ? before.load.contact_t : after->load.contact_t;
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
