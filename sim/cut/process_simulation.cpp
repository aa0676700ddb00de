#include "sim/cut/process_simulation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <type_traits>
#include <variant>

#include <fmt/format.h>

#include "cutting/stock/engagement.h"
#include "kinematics/pose.h"
#include "kinematics/units.h"
#include "sim/cut/part.h"
#include "sim/cut/tool_motion.h"

namespace abbe::sim {

namespace {

/// Returns the use of a blank that is a mesh. Like the part it should fit into the travel.
MeshUse blank_mesh_use(const Scene& scene) {
  return {"the blank", "cutting", false, part_mesh_use(scene).travel};
}

/// Returns the warning about the size of a blank from a mesh; empty if there is none.
std::string blank_size_warning(const Scene& scene, const cutting::Blank& blank) {
  const auto* mesh = std::get_if<MeshFile>(&scene.cutting->blank);
  if (mesh == nullptr) return {};
  return mesh_size_warning(*mesh, blank_mesh_use(scene),
                           extents(std::get<cutting::MeshBlank>(blank).vertices_k));
}

/// Returns the warning about a blank that does not contain the design, which suggests another unit
/// or frame; empty if at most a twentieth of the vertices of the design are more than a spacing
/// outside it.
std::string uncovered_design_text(const Scene& scene, const cutting::Stock& blank,
                                  const cutting::Design& design_m) {
  // With 2000 vertices the standard deviation of a fraction of 5 % is half a per cent.
  constexpr Eigen::Index max_points = 2000;
  constexpr double max_outside_fraction = 0.05;  // edges that a rough blank rounds off
  const Eigen::Index vertex_count = design_m.vertices.rows();
  const Eigen::Index stride = std::max<Eigen::Index>(1, vertex_count / max_points);
  int point_count = 0, outside = 0;
  for (Eigen::Index i = 0; i < vertex_count; i += stride, ++point_count) {
    const Eigen::Vector3d point_m = design_m.vertices.row(i).transpose();
    outside += cutting::depth(blank, scene.part.T_wm * point_m) < -blank.spacing;
  }
  if (outside <= max_outside_fraction * point_count) return {};
  return fmt::format(
      "the blank does not contain {:.3g} % of the design: its sizes are in mm in the part's frame, "
      "and forces act only on the material it contains",
      100.0 * outside / point_count);
}

}  // namespace

cutting::Blank make_blank(const Scene& scene, const cutting::Design& design_m) {
  return std::visit(
      [&](const auto& blank) -> cutting::Blank {
        using Shape = std::decay_t<decltype(blank)>;
        if constexpr (std::is_same_v<Shape, CuttingDescription::OffsetBlank>) {
          return cutting::offset_blank(design_m, blank.allowance, blank.floor);
        } else if constexpr (std::is_same_v<Shape, MeshFile>) {
          cutting::Design mesh = read_named_mesh(blank, blank_mesh_use(scene)).design;
          return cutting::MeshBlank{std::move(mesh.vertices), std::move(mesh.triangles)};
        } else if constexpr (std::is_same_v<Shape, CuttingDescription::TurnedBlank>) {
          throw std::invalid_argument("a blank for milling, not for turning");
        } else {
          return blank;
        }
      },
      scene.cutting->blank);
}

cutting::Stock blank_stock(const Scene& scene, const cutting::Blank& blank) {
  const CuttingDescription& description = *scene.cutting;
  return cutting::make_stock(
      blank, scene.part.T_wm,
      {description.spacing, description.three_directions, description.max_bytes});
}

bool is_rapid(const program::Samples& samples, const program::Path& path, std::size_t sample) {
  return path.blocks[std::size_t(samples.block[sample])].interpolation ==
         program::Interpolation::Rapid;
}

namespace {

/// Returns the travel of the tip between two poses plus the rotation of a point `reach` above it,
/// mm.
double sample_travel(const kinematics::Pose& from, const kinematics::Pose& to, double reach) {
  const Eigen::Vector3d axis = to.linear().col(2), previous_axis = from.linear().col(2);
  return (to.translation() - from.translation()).norm() +
         reach * kinematics::angle_between(axis, previous_axis);
}

}  // namespace

std::vector<std::size_t> milling_steps(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, double step,
                                       double reach, bool continues,
                                       const std::optional<double>& from_travel) {
  constexpr double sharp_corner = 0.1;  // rad; a step over a sharper corner would cut it off
  const auto tip = [&](std::size_t i) -> Eigen::Vector3d { return T_wt[i].translation(); };
  const auto is_rapid_at = [&](std::size_t i) { return is_rapid(samples, path, i); };
  std::vector<std::size_t> steps{0};
  double travel = 0.0;
  const std::size_t sample_count = samples.states.size();
  for (std::size_t i = 1; i < sample_count; ++i) {
    travel =
        i == 1 && from_travel ? *from_travel : travel + sample_travel(T_wt[i - 1], T_wt[i], reach);
    const bool is_last = i + 1 == sample_count;
    if (is_last && continues) break;
    if (travel < step && !is_last && is_rapid_at(i) == is_rapid_at(i + 1)) {
      const Eigen::Vector3d incoming = tip(i) - tip(steps.back()), outgoing = tip(i + 1) - tip(i);
      if (kinematics::angle_between(incoming, outgoing) < sharp_corner) continue;
    }
    steps.push_back(i);
    travel = 0.0;
  }
  return steps;
}

namespace {

using kinematics::Pose;

/// Converts the profile of a blank from z of the part to the position along the spindle axis, in
/// rising order.
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

}  // namespace

cutting::TurnedStock turned_blank(const Scene& scene, const SpindleLine& line) {
  const auto* blank = std::get_if<CuttingDescription::TurnedBlank>(&scene.cutting->blank);
  if (blank == nullptr) throw std::invalid_argument("a turned blank for a turning tool");
  return cutting::make_turned_stock(profile_along(line, scene.part.T_wm, blank->profile),
                                    scene.cutting->spacing, line.point_w, line.direction_w);
}

std::vector<std::size_t> turning_steps(const program::Samples& samples, const program::Path& path,
                                       const std::vector<Pose>& T_wt, int spindle,
                                       const SpindleLine& line) {
  constexpr double step = 0.1;  // mm, of rapids and with the spindle at rest
  const auto& states = samples.states;
  const auto tip = [&](std::size_t i) -> Eigen::Vector3d {
    return slow_pose(line, states[i].q[spindle], T_wt[i]).translation();
  };
  const auto is_rapid_at = [&](std::size_t i) { return is_rapid(samples, path, i); };
  std::vector<std::size_t> steps{0};
  double angle = 0.0, travel = 0.0;
  for (std::size_t i = 1; i < states.size(); ++i) {
    angle += std::abs(states[i].q[spindle] - states[i - 1].q[spindle]);
    travel += (tip(i) - tip(i - 1)).norm();
    const bool is_last = i + 1 == states.size();
    const bool by_travel = is_rapid_at(i) || !(states[i].spindle_speed > 0.0);
    // The angles between samples add up to a revolution only within rounding.
    const bool is_due = by_travel ? travel >= step : angle >= 2 * pi * (1 - 1e-9);
    if (!is_due && !is_last && is_rapid_at(i) == is_rapid_at(i + 1)) continue;
    steps.push_back(i);
    angle = travel = 0.0;
  }
  return steps;
}

namespace {

using errors::Load;

/// The cut evaluated at one tool pose.
struct ProcessSample {
  cutting::CuttingLoad cut;
  errors::Load load;
  double engaged = 0.0;   ///< length of edge in material, mm
  double chip = 0.0;      ///< largest uncut chip thickness, mm
  double overhang = 0.0;  ///< length by which the cut exceeds the edges of an insert, mm
};

/// Solves for the force of one step and the deflection that it causes, which agree to the tolerance
/// of the description. (If repetition contracts by c, the remaining error is c / (1 - c) of the
/// last change.) Plain repetition is followed by the secant of the last two iterates if it is slow.
/// If both fail, the load is bracketed between zero and that of the rigid tool, so that a soft
/// machine converges too.
class ForceLoop {
 public:
  /// @param force  returns the cut of a tool at a pose
  ForceLoop(const CuttingDescription& description, const PoseUnderLoad& pose, std::size_t sample,
            const std::function<ProcessSample(const Pose&)>& force)
      : description_(description), pose_(pose), sample_(sample), force_(force) {}

  /// Returns the step without time, line, power and removed volume.
  /// @param guess  first load
  ProcessStep solve(const Load& guess);

 private:
  bool iterate(Load load);
  bool bracket();
  bool evaluate(const Load& load);

  const CuttingDescription& description_;
  const PoseUnderLoad& pose_;
  std::size_t sample_;
  const std::function<ProcessSample(const Pose&)>& force_;
  ProcessStep step_;
  ProcessSample cut_;  // with the tool at `T_wt_`
  Pose T_wt_;          // under the last assumed load
};

/// Evaluates the cut under an assumed load.
/// @return true if the deflections by this load and by that of the cut agree to the tolerance
bool ForceLoop::evaluate(const Load& load) {
  ++step_.iterations;
  T_wt_ = pose_(sample_, load);
  cut_ = force_(T_wt_);
  const Pose T_wt_next = pose_(sample_, cut_.load);
  // An unloaded tool has no contact point, so that of the assumed load is used.
  const Eigen::Vector3d contact_t =
      cut_.load.tool_wrench_t.isZero(0.0) ? load.contact_t : cut_.load.contact_t;
  step_.disagreement = (T_wt_next * contact_t - T_wt_ * contact_t).norm();
  step_.load = cut_.load;
  return step_.disagreement <= description_.tolerance;
}

/// Iterates load and deflection: by plain repetition, or by the secant of the last two iterates
/// (Aitken) if repetition converges slowly or oscillates.
/// @return true if they converge
bool ForceLoop::iterate(Load load) {
  double relaxation = 1.0, last_change = 0.0;
  kinematics::Wrench last_difference = kinematics::Wrench::Zero();
  while (step_.iterations < description_.max_iterations) {
    if (evaluate(load)) return true;
    const double change = step_.disagreement;
    const kinematics::Wrench difference = cut_.load.tool_wrench_t - load.tool_wrench_t;
    // Changes below a hundred tolerances come from the grid of the stock at the ends of arcs, and
    // their ratio is not that of the loop.
    if (last_change > 100 * description_.tolerance && relaxation == 1.0)
      step_.loop_gain = std::max(step_.loop_gain, change / last_change);
    const kinematics::Wrench difference_change = difference - last_difference;
    // With a ratio of 0.3 plain repetition gains half a digit in an iteration.
    const bool is_slow = last_change > 0.0 && change > 0.3 * last_change;
    // The secant of two nearly equal iterates is arbitrary, hence the limits of the extrapolation.
    if (is_slow && difference_change.head<3>().squaredNorm() > 0.0)
      relaxation =
          std::clamp(-relaxation * last_difference.head<3>().dot(difference_change.head<3>()) /
                         difference_change.head<3>().squaredNorm(),
                     0.05, 2.0);
    load.tool_wrench_t += relaxation * difference;
    if (!cut_.load.tool_wrench_t.isZero(0.0)) load.contact_t = cut_.load.contact_t;
    last_difference = difference;
    last_change = change;
  }
  return false;
}

/// Finds the load by bisection. The force falls as the tool yields, so that the load lies between
/// zero and that of the rigid tool. Its fraction of the latter is bisected; the cut found by that
/// gives the direction and the contact point for the next bisection.
/// @return true if it converges
bool ForceLoop::bracket() {
  constexpr int max_directions = 8, max_halvings = 60;  // 60 exhaust the digits of a double
  evaluate({});
  Load rigid = cut_.load;
  if (rigid.tool_wrench_t.isZero(0.0)) return true;
  for (int direction = 0; direction < max_directions; ++direction) {
    double low = 0.0, high = 1.0;  // the load of the cut is above `low` and below `high`
    Load load = rigid, larger_load = rigid;
    for (int i = 0; i < max_halvings; ++i) {
      const double fraction = 0.5 * (low + high);
      load = rigid;
      load.tool_wrench_t *= fraction;
      if (evaluate(load)) return true;
      const bool is_larger = cut_.load.tool_wrench_t.head<3>().dot(rigid.tool_wrench_t.head<3>()) >
                             fraction * rigid.tool_wrench_t.head<3>().squaredNorm();
      if (is_larger) larger_load = cut_.load;
      (is_larger ? low : high) = fraction;
      const Pose T_other_end = pose_(sample_, [&] {
        Load bracket_end = rigid;
        bracket_end.tool_wrench_t *= is_larger ? high : low;
        return bracket_end;
      }());
      // The deflections at both ends of the bracket agree although the loads differ: the force
      // jumps between them.
      if ((T_other_end * rigid.contact_t - T_wt_ * rigid.contact_t).norm() <=
          description_.tolerance)
        break;
    }
    // The deflection is now known for the assumed direction; the cut may push in another one.
    const double magnitude = load.tool_wrench_t.head<3>().norm();
    const kinematics::Wrench new_wrench =
        larger_load.tool_wrench_t * (magnitude / larger_load.tool_wrench_t.head<3>().norm());
    Load new_load = larger_load;
    new_load.tool_wrench_t = new_wrench;
    const Pose T_new = pose_(sample_, new_load);
    const double change = (T_new * rigid.contact_t - T_wt_ * rigid.contact_t).norm();
    step_.load = load;
    step_.disagreement = change;
    if (change <= description_.tolerance) return true;
    // The next bisection starts from the magnitude of the rigid load in the new direction.
    const double rigid_magnitude = rigid.tool_wrench_t.head<3>().norm();
    rigid = new_load;
    rigid.tool_wrench_t = new_wrench * (rigid_magnitude / magnitude);
  }
  return false;
}

ProcessStep ForceLoop::solve(const Load& guess) {
  // Iteration is faster and converges at nearly every step; the bracket is for soft machines.
  step_.converged = iterate(guess) || bracket();
  step_.torque = cut_.cut.torque;
  step_.engaged = cut_.engaged;
  step_.overhang = cut_.overhang;
  step_.chip = cut_.chip;
  if (!step_.load.tool_wrench_t.allFinite()) {
    step_.load = {};
    step_.converged = false;
  }
  return step_;
}

using kinematics::AxisState;

// Returns the load of a cut as a sample without engagement.
ProcessSample process_sample(const cutting::CuttingLoad& cut) {
  ProcessSample result;
  result.cut = cut;
  result.load.tool_wrench_t = cut.tool_wrench_t;
  result.load.contact_t = cut.contact_t;
  return result;
}

/// Returns the height above the tip, mm, of the point whose motion counts as the feed: the centre
/// of the corner, or the middle of the flank of a flat end mill.
double feed_height(const cutting::Cutter& cutter) {
  const double corner = cutting::corner_height(cutter);
  return corner > 0.0 ? corner : 0.5 * cutter.flank_length;
}

/// Adds the edge length in material and the largest chip of an engagement.
void add_engagement(const cutting::Engagement& engagement, int flutes, double feed_per_tooth,
                    ProcessSample& sample) {
  const double feed_across = engagement.feed_t.head<2>().norm(),
               feed_along = -engagement.feed_t.z();
  const double feed_angle = std::atan2(engagement.feed_t.y(), engagement.feed_t.x());
  for (const cutting::EngagedArc& arc : engagement.arcs) {
    const cutting::EdgeSlice& slice = engagement.slices[std::size_t(arc.slice)];
    sample.engaged += slice.length * (arc.to - arc.from) / (2 * pi) * flutes;
    // The chip is thickest at the smallest angle between the arc and the feed direction.
    const double arc_middle = 0.5 * (arc.from + arc.to), half_arc = 0.5 * (arc.to - arc.from);
    const double angle_to_feed =
        std::max(0.0, std::abs(std::remainder(arc_middle - feed_angle, 2 * pi)) - half_arc);
    const double feed_into_arc = feed_across * std::sin(slice.kappa) * std::cos(angle_to_feed) +
                                 feed_along * std::cos(slice.kappa);
    sample.chip = std::max(sample.chip, feed_per_tooth * feed_into_arc);
  }
}

// Adds a program line once, up to 1000 lines.
void add_crash_line(std::vector<int>& lines, int line) {
  if (std::find(lines.begin(), lines.end(), line) == lines.end() && lines.size() < 1000)
    lines.push_back(line);
}

/// Throws BadInput if the spindle of a cut is at rest or turns against the cutting edges.
void check_spindle(const FollowedProgram& program, std::size_t sample, bool is_direction_right,
                   const char* expected) {
  const double speed = program.samples.states[sample].spindle_speed;
  if (speed > 0.0 && is_direction_right) return;
  throw BadInput(program.path.file, program.samples.line[sample], 0, expected,
                 speed > 0.0 ? "a cut with the spindle turning in the opposite direction"
                             : "a cut with the spindle at rest");
}

/// The inputs of milling at one step.
struct MillingSample {
  const CuttingDescription& description;
  const FollowedProgram& program;
  const cutting::Cutter& cutter;
  const cutting::Stock& stock;
  std::size_t previous, sample;
  int spindle;  ///< joint

  Eigen::Vector3d feed_w() const {
    const Eigen::Vector3d p_t(0, 0, feed_height(cutter));
    return program.T_wt[sample] * p_t - program.T_wt[previous] * p_t;
  }
  double duration() const {
    return program.samples.states[sample].time_s - program.samples.states[previous].time_s;
  }
  /// Returns true under M3, which increases the spindle angle: clockwise, seen from the spindle.
  bool is_clockwise() const {
    return program.samples.states[sample].q[spindle] > program.samples.states[previous].q[spindle];
  }
  ProcessSample at(const Pose& T_wt) const;
};

ProcessSample MillingSample::at(const Pose& T_wt) const {
  const cutting::Engagement contact = cutting::engagement(stock, cutter, T_wt, feed_w());
  if (contact.arcs.empty()) return {};
  check_spindle(program, sample, is_clockwise() == description.flutes.clockwise,
                description.flutes.clockwise
                    ? "a spindle that turns clockwise (S and M3) where it cuts"
                    : "a spindle that turns counter-clockwise (S and M4) where it cuts");
  const double tooth_feed =
      feed_w().norm() / duration() * 2 * pi /
      (program.samples.states[sample].spindle_speed * description.flutes.count);
  // The force model holds for small chips. A larger feed per tooth means a wrong unit or speed.
  if (tooth_feed > cutter.radius)
    throw BadInput(program.path.file, program.samples.line[sample], 0,
                   "a feed per tooth within the cutter's radius",
                   fmt::format("{:.3g} mm", tooth_feed));
  ProcessSample result = process_sample(
      cutting::mean_force(contact, *description.material, description.flutes, tooth_feed));
  add_engagement(contact, description.flutes.count, tooth_feed, result);
  return result;
}

/// Returns the step at a sample: converged with the force of the cut, or unloaded without a force.
/// @param force  empty: no force acts
/// @param process  up to the step before, whose load is the first guess
ProcessStep step_at(const CuttingDescription& description, const FollowedProgram& program,
                    std::size_t sample, const std::function<ProcessSample(const Pose&)>& force,
                    const Process& process) {
  const Load guess = process.steps.empty() ? Load{} : process.steps.back().load;
  ProcessStep step;
  if (force) step = ForceLoop(description, program.pose, sample, force).solve(guess);
  const AxisState& state = program.samples.states[sample];
  step.time_s = state.time_s;
  step.line = program.samples.line[sample];
  step.power_W = step.torque * state.spindle_speed * 1e-3;  // N mm rad/s
  return step;
}

/// Returns a process without steps, with the blank as its stock and the warnings about it.
Process milling_blank(const Scene& scene, const cutting::Design& design_m) {
  Process process;
  const cutting::Blank blank = make_blank(scene, design_m);
  if (std::string warning = blank_size_warning(scene, blank); !warning.empty())
    process.warnings.push_back(std::move(warning));
  process.stock = blank_stock(scene, blank);
  if (std::string text = uncovered_design_text(scene, *process.stock, design_m); !text.empty())
    process.warnings.push_back(std::move(text));
  return process;
}

Process simulate_milling(const Scene& scene, const Machine& machine,
                         const cutting::Design& design_m, const FollowedProgram& program,
                         const std::function<void(double)>& progress, Process before) {
  const CuttingDescription& description = *scene.cutting;
  const auto& cutter = std::get<cutting::Cutter>(program.tool);
  Process process = program.is_continued ? std::move(before)
                    : before.stock       ? take_stock(before)
                                         : milling_blank(scene, design_m);
  const auto spindle = find_spindle(machine);
  if (description.material && !spindle)
    throw std::invalid_argument("a machine with a spindle nose s for cutting forces");
  const bool has_step = program.is_continued && !process.steps.empty();
  Pose T_before = program.pose(0, has_step ? process.steps.back().load : Load{});
  const std::vector<std::size_t> step_samples =
      milling_steps(program.samples, program.path, program.T_wt, description.step,
                    cutter.flank_length, program.continues, program.from_travel);
  for (std::size_t k = 1; k < step_samples.size(); ++k) {
    const MillingSample cut{
        description,        program, cutter, *process.stock, step_samples[k - 1], step_samples[k],
        spindle.value_or(0)};
    const bool is_rapid_move = is_rapid(program.samples, program.path, step_samples[k]);
    std::function<ProcessSample(const Pose&)> force;
    // A dwell and a move of zero length have no feed, and hence no force.
    if (!is_rapid_move && description.material && cut.duration() > 0.0 && cut.feed_w().norm() > 0.0)
      force = [&](const Pose& T_wt) { return cut.at(T_wt); };
    ProcessStep step = step_at(description, program, step_samples[k], force, process);
    const Pose T_after = program.pose(step_samples[k], step.load);
    const cutting::RemovalResult removal =
        cutting::remove(*process.stock, cutter, {T_before, T_after, step.line, is_rapid_move});
    step.removed = removal.volume;
    if (removal.crashed) add_crash_line(process.crash_lines, step.line);
    process.steps.push_back(step);
    T_before = T_after;
    if (progress && k % 256 == 0) progress(double(k) / double(step_samples.size()));
  }
  return process;
}

/// Returns the mean radius of the work at the engaged edge, mm, weighted with the chip area.
double work_radius(const SpindleLine& line, const Pose& T_without_spindle,
                   const cutting::Nose& nose, const std::vector<cutting::EngagedEdge>& edges) {
  double weighted_sum = 0.0, area = 0.0;
  for (const cutting::EngagedEdge& edge : edges) {
    Eigen::Vector3d p_t(nose.radius * std::cos(edge.psi), 0.0, nose.radius * std::sin(edge.psi));
    if (nose.profile) {
      const Eigen::Vector2d point = cutting::edge_point(*nose.profile, edge.psi).at;
      p_t = {point.x(), 0.0, point.y()};
    }
    const double edge_radius =
        (T_without_spindle * p_t - line.point_w).cross(line.direction_w).norm();
    weighted_sum += edge_radius * edge.chip * edge.length;
    area += edge.chip * edge.length;
  }
  return area > 0.0 ? weighted_sum / area : 0.0;
}

/// Returns true if the work moves down on the rake face, along -y of frame t, as the spindle angle
/// grows.
bool is_tool_descending(const SpindleLine& line, const Pose& T_without_spindle) {
  const Eigen::Vector3d lever = T_without_spindle.translation() - line.point_w;
  return line.direction_w.cross(lever).dot(T_without_spindle.linear().col(1)) > 0.0;
}

/// The inputs of turning at one step.
struct TurningSample {
  const CuttingDescription& description;
  const FollowedProgram& program;
  const cutting::Nose& nose;
  const cutting::TurnedStock& stock;
  const SpindleLine& line;
  std::size_t previous, sample;
  int spindle;  ///< joint

  Pose slow(const Pose& T_wt) const {
    return slow_pose(line, program.samples.states[sample].q[spindle], T_wt);
  }
  ProcessSample at(const Pose& T_wt) const;
};

/// Returns the radial direction away from the part, in x and z of the tool; zero on the spindle
/// axis.
Eigen::Vector2d away_from_part(const SpindleLine& line, const Pose& T_without_spindle) {
  const Eigen::Vector3d radial_t =
      T_without_spindle.linear().transpose() * line.radial(T_without_spindle.translation());
  const Eigen::Vector2d away(radial_t.x(), radial_t.z());
  return away.norm() > 1e-9 ? Eigen::Vector2d(away.normalized()) : Eigen::Vector2d::Zero();
}

/// Returns the nose that has the same effect on a stock with one radius at each position along the
/// axis: overhanging edges are replaced by edges along the radius.
cutting::Nose nose_over_stock(const cutting::Nose& nose, const Eigen::Vector2d& away) {
  if (!nose.profile || away.isZero(0.0)) return nose;
  cutting::Nose stock_nose = nose;
  stock_nose.profile =
      std::make_shared<const cutting::EdgeProfile>(cutting::without_overhang(*nose.profile, away));
  return stock_nose;
}

/// Returns the height by which the cut exceeds the edges of an insert, mm.
double beyond_edges(const cutting::Nose& nose, const cutting::Nose& stock_nose,
                    const Eigen::Vector2d& away, const std::vector<cutting::EngagedEdge>& edges) {
  if (!nose.profile || away.isZero(0.0)) return 0.0;
  const double tip_height = cutting::extreme_point(*nose.profile, -away).dot(away);
  const Eigen::Vector2d across(away.y(), -away.x());
  const double right_height = cutting::edge_height(*nose.profile, away, across),
               left_height = cutting::edge_height(*nose.profile, away, -across);
  double max_excess = 0.0;
  for (const cutting::EngagedEdge& edge : edges) {
    const cutting::EdgePoint point = cutting::edge_point(*stock_nose.profile, edge.psi);
    const double height = point.outward.dot(across) > 0.0 ? right_height : left_height;
    if (edge.chip > 0.0)
      max_excess = std::max(max_excess, point.at.dot(away) - tip_height - height);
  }
  return max_excess;
}

ProcessSample TurningSample::at(const Pose& T_wt) const {
  const Pose T_without_spindle = slow(T_wt);
  const Eigen::Vector2d away = away_from_part(line, T_without_spindle);
  const cutting::Nose stock_nose = nose_over_stock(nose, away);
  const auto edges = cutting::engagement(stock, stock_nose, T_without_spindle);
  if (edges.empty()) return {};
  const auto& states = program.samples.states;
  const bool is_angle_growing = states[sample].q[spindle] > states[previous].q[spindle];
  check_spindle(program, sample, is_angle_growing == is_tool_descending(line, T_without_spindle),
                "a spindle that turns the workpiece towards the rake face where it cuts");
  ProcessSample result = process_sample(
      cutting::turning_force(edges, stock_nose, *description.material,
                             work_radius(line, T_without_spindle, stock_nose, edges)));
  for (const cutting::EngagedEdge& edge : edges) {
    result.engaged += edge.length;
    result.chip = std::max(result.chip, edge.chip);
  }
  result.overhang = beyond_edges(nose, stock_nose, away, edges);
  return result;
}

Process simulate_turning(const Scene& scene, const Machine& machine, const FollowedProgram& program,
                         const std::function<void(double)>& progress, Process before) {
  const CuttingDescription& description = *scene.cutting;
  constexpr double min_crash_volume = 1e-3;  // mm^3; a smaller removal is only a touch
  const auto& nose = std::get<cutting::Nose>(program.tool);
  const auto& states = program.samples.states;
  const int spindle = *machine.workpiece_spindle;
  const SpindleLine line = spindle_line(program.chain, spindle);
  Process process = take_stock(before);
  if (!process.turned) process.turned = turned_blank(scene, line);
  const std::vector<std::size_t> step_samples =
      turning_steps(program.samples, program.path, program.T_wt, spindle, line);
  Pose T_before = slow_pose(line, states.front().q[spindle], program.pose(0, {}));
  for (std::size_t k = 1; k < step_samples.size(); ++k) {
    const TurningSample cut{description,         program,         nose,   *process.turned, line,
                            step_samples[k - 1], step_samples[k], spindle};
    const bool is_rapid_move = is_rapid(program.samples, program.path, step_samples[k]);
    std::function<ProcessSample(const Pose&)> force;
    if (!is_rapid_move && description.material)
      force = [&](const Pose& T_wt) { return cut.at(T_wt); };
    ProcessStep step = step_at(description, program, step_samples[k], force, process);
    const Pose T_after = cut.slow(program.pose(step_samples[k], step.load));
    // A negative line marks material removed by a rapid.
    step.removed = cutting::remove(*process.turned, nose, T_before, T_after,
                                   is_rapid_move ? -step.line : step.line);
    if (is_rapid_move && step.removed > min_crash_volume)
      add_crash_line(process.crash_lines, step.line);
    process.steps.push_back(step);
    T_before = T_after;
    if (progress && k % 64 == 0) progress(double(k) / double(step_samples.size()));
  }
  return process;
}

}  // namespace

Process simulate_process(const Scene& scene, const Machine& machine,
                         const cutting::Design& design_m, const FollowedProgram& program,
                         const std::function<void(double)>& progress, Process before) {
  if (!scene.cutting || program.samples.states.empty())
    return program.is_continued ? std::move(before) : take_stock(before);
  try {
    if (std::holds_alternative<cutting::Cutter>(program.tool))
      return simulate_milling(scene, machine, design_m, program, progress, std::move(before));
    return simulate_turning(scene, machine, program, progress, std::move(before));
  } catch (const std::invalid_argument& error) {
    throw BadInput(scene.file.string(), 0, 0, "a valid blank", error.what());
  } catch (const std::length_error& error) {
    throw BadInput(scene.file.string(), 0, 0, "a blank that fits in [cutting] max_MiB",
                   error.what());
  }
}

void CarriedSamples::add(const FollowedProgram& window) {
  const std::vector<program::Block> kept = std::move(path.blocks);
  path = window.path;
  path.blocks.insert(path.blocks.begin(), kept.begin(), kept.end());
  const std::size_t first = window.is_continued ? 1 : 0;
  std::size_t number = numbers.empty() ? 0 : numbers.back() + 1;
  for (std::size_t i = first; i < window.samples.states.size(); ++i) {
    samples.states.push_back(window.samples.states[i]);
    samples.line.push_back(window.samples.line[i]);
    samples.block.push_back(window.samples.block[i] + int(kept.size()));
    T_wt.push_back(window.T_wt[i]);
    numbers.push_back(number++);
  }
}

void CarriedSamples::keep(std::size_t step, double reach) {
  const std::size_t last = samples.states.size() - 1;
  // Added up in the order of `milling_steps`, so that the travel has its bits.
  std::optional<double> from_step;
  for (std::size_t i = step + 1; i <= last; ++i)
    from_step = i == 1 && travel
                    ? *travel
                    : from_step.value_or(0.0) + sample_travel(T_wt[i - 1], T_wt[i], reach);
  CarriedSamples kept;
  kept.travel = from_step;
  for (std::size_t i = step; i <= last; i += std::max<std::size_t>(1, last - step)) {
    kept.samples.states.push_back(samples.states[i]);
    kept.samples.line.push_back(samples.line[i]);
    kept.samples.block.push_back(int(kept.path.blocks.size()));
    kept.path.blocks.push_back(path.blocks[std::size_t(samples.block[i])]);
    kept.T_wt.push_back(T_wt[i]);
    kept.numbers.push_back(numbers[i]);
  }
  *this = std::move(kept);
}

void WindowedProcess::add(const Scene& scene, const Machine& machine,
                          const cutting::Design& design_m, const FollowedProgram& window,
                          const PoseAt& pose, const std::function<void(double)>& progress) {
  if (!scene.cutting) return;
  carried_.add(window);
  const auto& [samples, path, T_wt, travel, numbers] = carried_;
  const auto pose_at = [&](std::size_t i, const Load& load) {
    return pose(carried_.samples.states[i], carried_.T_wt[i], load);
  };
  process_ = simulate_process(scene, machine, design_m,
                              {samples, path, T_wt, pose_at, window.chain, window.tool,
                               window.is_continued, window.continues, travel},
                              progress, std::move(process_));
  if (samples.states.empty()) return;
  const double reach = std::get<cutting::Cutter>(window.tool).flank_length;
  carried_.keep(
      milling_steps(samples, path, T_wt, scene.cutting->step, reach, window.continues, travel)
          .back(),
      reach);
}

}  // namespace abbe::sim
