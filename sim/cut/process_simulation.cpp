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

/// Returns the use of a blank that is a mesh. It must fit into the travel as the part does.
MeshUse blank_mesh_use(const Scene& scene) {
  return {"the blank", "cutting", false, part_mesh_use(scene).travel};
}

}  // namespace

cutting::Blank blank_of(const Scene& scene, const cutting::Design& design_m) {
  return std::visit(
      [&](const auto& blank) -> cutting::Blank {
        using Shape = std::decay_t<decltype(blank)>;
        if constexpr (std::is_same_v<Shape, CuttingDescription::OffsetBlank>) {
          return cutting::offset_blank(design_m, blank.allowance, blank.floor);
        } else if constexpr (std::is_same_v<Shape, MeshFile>) {
          cutting::Design mesh = read_named_mesh(blank, blank_mesh_use(scene)).design;
          return cutting::MeshBlank{std::move(mesh.vertices), std::move(mesh.triangles)};
        } else if constexpr (std::is_same_v<Shape, CuttingDescription::TurnedBlank>) {
          throw std::invalid_argument("a blank that is milled, not a turned one");
        } else {
          return blank;
        }
      },
      scene.cutting->blank);
}

std::string blank_size_warning(const Scene& scene, const cutting::Blank& blank) {
  const auto* mesh = std::get_if<MeshFile>(&scene.cutting->blank);
  if (mesh == nullptr) return {};
  return mesh_size_warning(*mesh, blank_mesh_use(scene),
                           extents(std::get<cutting::MeshBlank>(blank).vertices_k));
}

cutting::Stock blank_stock(const Scene& scene, const cutting::Blank& blank) {
  const CuttingDescription& description = *scene.cutting;
  return cutting::make_stock(
      blank, scene.part.T_wm,
      {description.spacing, description.three_directions, description.max_bytes});
}

std::string uncovered_text(const Scene& scene, const cutting::Stock& blank,
                           const cutting::Design& design_m) {
  // 2000 vertices give a fraction of 5 % to about half a per cent (one standard deviation)
  constexpr Eigen::Index max_tried = 2000;
  constexpr double tolerated = 0.05;  // fraction of the vertices: edges that a rough blank rounds
                                      // off
  const Eigen::Index n = design_m.vertices.rows();
  const Eigen::Index step = std::max<Eigen::Index>(1, n / max_tried);
  int tried = 0, outside = 0;
  for (Eigen::Index i = 0; i < n; i += step, ++tried) {
    const Eigen::Vector3d point_m = design_m.vertices.row(i).transpose();
    outside += cutting::depth(blank, scene.part.T_wm * point_m) < -blank.spacing;
  }
  if (outside <= tolerated * tried) return {};
  return fmt::format(
      "the blank does not hold {:.3g} % of the design: its sizes are in mm and in the part's own "
      "frame, and forces are of what it holds",
      100.0 * outside / tried);
}

bool is_rapid(const program::Samples& samples, const program::Path& path, std::size_t sample) {
  return path.blocks[std::size_t(samples.block[sample])].interpolation ==
         program::Interpolation::Rapid;
}

std::vector<std::size_t> milling_steps(const program::Samples& samples, const program::Path& path,
                                       const std::vector<kinematics::Pose>& T_wt, double step,
                                       double reach) {
  constexpr double sharp = 0.1;  // rad: a corner of the path, which a longer step would cut off
  const auto tip = [&](std::size_t i) -> Eigen::Vector3d { return T_wt[i].translation(); };
  const auto axis = [&](std::size_t i) -> Eigen::Vector3d { return T_wt[i].linear().col(2); };
  const auto rapid = [&](std::size_t i) { return is_rapid(samples, path, i); };
  std::vector<std::size_t> at{0};
  double travel = 0.0;
  const std::size_t n = samples.states.size();
  for (std::size_t i = 1; i < n; ++i) {
    travel +=
        // a turn of the axis moves the top of the flank, so both count as travel
        (tip(i) - tip(i - 1)).norm() + reach * kinematics::angle_between(axis(i), axis(i - 1));
    const bool last = i + 1 == n;
    if (travel < step && !last && rapid(i) == rapid(i + 1)) {
      const Eigen::Vector3d come = tip(i) - tip(at.back()), goes = tip(i + 1) - tip(i);
      if (kinematics::angle_between(come, goes) < sharp) continue;
    }
    at.push_back(i);
    travel = 0.0;
  }
  return at;
}

namespace {

using kinematics::Pose;

/// Returns the profile of a blank over z of the part as one over the spindle axis, in rising order.
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
  constexpr double step = 0.1;  // mm, for rapids and a standing spindle, which have no revolutions
  const auto& states = samples.states;
  const auto place = [&](std::size_t i) -> Eigen::Vector3d {
    return slow_pose(line, states[i].q[spindle], T_wt[i]).translation();
  };
  const auto rapid = [&](std::size_t i) { return is_rapid(samples, path, i); };
  std::vector<std::size_t> at{0};
  double turned = 0.0, travel = 0.0;
  for (std::size_t i = 1; i < states.size(); ++i) {
    turned += std::abs(states[i].q[spindle] - states[i - 1].q[spindle]);
    travel += (place(i) - place(i - 1)).norm();
    const bool last = i + 1 == states.size();
    const bool by_travel = rapid(i) || !(states[i].spindle_speed > 0.0);
    // 1e-9: a revolution of samples adds up to 2 pi only within rounding
    const bool due = by_travel ? travel >= step : turned >= 2 * pi * (1 - 1e-9);
    if (!due && !last && rapid(i) == rapid(i + 1)) continue;
    at.push_back(i);
    turned = travel = 0.0;
  }
  return at;
}

namespace {

using errors::Load;

/// Solves for the force of one step and the deflection that it causes.
class Loop {
 public:
  Loop(const CuttingDescription& description, const PoseUnderLoad& pose, std::size_t sample,
       const std::function<ProcessSample(const Pose&)>& force)
      : description_(description), pose_(pose), sample_(sample), force_(force) {}

  ProcessStep close(const Load& guess);

 private:
  bool repeat(Load load);
  bool bracket();
  bool look_at(const Load& load);

  const CuttingDescription& description_;
  const PoseUnderLoad& pose_;
  std::size_t sample_;
  const std::function<ProcessSample(const Pose&)>& force_;
  ProcessStep step_;
  ProcessSample look_;     // at the last load
  Pose T_wt_, T_wt_next_;  // under the last load, and under the load that the cut then has
};

/// Evaluates the cut under a load.
/// @return true if the load agrees with that of the cut, to the tolerance
bool Loop::look_at(const Load& load) {
  ++step_.iterations;
  T_wt_ = pose_(sample_, load);
  look_ = force_(T_wt_);
  T_wt_next_ = pose_(sample_, look_.load);
  // an unloaded tool has no contact point; that of the assumed load serves
  const Eigen::Vector3d contact_t =
      look_.load.on_tool_t.isZero(0.0) ? load.contact_t : look_.load.contact_t;
  step_.disagreement = (T_wt_next_ * contact_t - T_wt_ * contact_t).norm();
  step_.load = look_.load;
  return step_.disagreement <= description_.tolerance;
}

/// Iterates load and deflection: plain repetition, and the secant of the last two iterates (Aitken)
/// if that converges slowly or oscillates.
bool Loop::repeat(Load load) {
  double relaxation = 1.0, last_change = 0.0;
  kinematics::Wrench last_difference = kinematics::Wrench::Zero();
  while (step_.iterations < description_.max_iterations) {
    if (look_at(load)) return true;
    const double change = step_.disagreement;
    const kinematics::Wrench difference = look_.load.on_tool_t - load.on_tool_t;
    // Below a hundred tolerances the ratio shows the grid of the stock at the ends of arcs, not the
    // loop.
    if (last_change > 100 * description_.tolerance && relaxation == 1.0)
      step_.contraction = std::max(step_.contraction, change / last_change);
    const kinematics::Wrench bend = difference - last_difference;
    // 0.3: plain repetition then gains half a digit in an iteration
    const bool slow = last_change > 0.0 && change > 0.3 * last_change;
    // limits on the extrapolation: the secant of two nearly equal iterates is arbitrary
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

/// Finds the load by bisection. Force falls as the tool yields, so the load lies between zero and
/// that of the rigid tool; its fraction of the latter is bisected, then direction and contact point
/// are taken from the cut found there.
bool Loop::bracket() {
  // 60 halvings exhaust the digits of a double
  constexpr int max_directions = 8, max_halvings = 60;
  look_at({});
  Load rigid = look_.load;
  // a rigid tool that meets nothing needs no load
  if (rigid.on_tool_t.isZero(0.0)) return true;
  for (int turn = 0; turn < max_directions; ++turn) {
    double low = 0.0, high = 1.0;  // the cut gives more than `low`, less than `high`
    Load load = rigid, firm = rigid;
    for (int i = 0; i < max_halvings; ++i) {
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
      // both ends of the bracket deflect the tool alike: the force jumps between them
      if ((other * rigid.contact_t - T_wt_ * rigid.contact_t).norm() <= description_.tolerance)
        break;
    }
    // The deflection is now known along the direction tried; the cut there may push in another one.
    const double amount = load.on_tool_t.head<3>().norm();
    const kinematics::Wrench along = firm.on_tool_t * (amount / firm.on_tool_t.head<3>().norm());
    Load next = firm;
    next.on_tool_t = along;
    const Pose turned = pose_(sample_, next);
    const double moved = (turned * rigid.contact_t - T_wt_ * rigid.contact_t).norm();
    step_.load = load;
    step_.disagreement = moved;
    if (moved <= description_.tolerance) return true;
    // the magnitude of the rigid load in the new direction, for the next bisection
    const double whole = rigid.on_tool_t.head<3>().norm();
    rigid = next;
    rigid.on_tool_t = along * (whole / amount);
  }
  return false;
}

ProcessStep Loop::close(const Load& guess) {
  // Repetition is faster and serves nearly every step; the bracket serves soft machines.
  step_.converged = repeat(guess) || bracket();
  step_.torque = look_.cut.torque;
  step_.engaged = look_.engaged;
  step_.beyond_edge = look_.beyond_edge;
  step_.chip = look_.chip;
  if (!step_.load.on_tool_t.allFinite()) {
    step_.load = {};
    step_.converged = false;
  }
  return step_;
}

}  // namespace

ProcessStep converged_step(const CuttingDescription& description, const PoseUnderLoad& pose,
                           std::size_t sample,
                           const std::function<ProcessSample(const Pose&)>& force,
                           const Load& guess) {
  return Loop(description, pose, sample, force).close(guess);
}

namespace {

using kinematics::AxisState;

// Returns the load of a cut as a sample without engagement.
ProcessSample process_sample(const cutting::CuttingLoad& cut) {
  ProcessSample look;
  look.cut = cut;
  look.load.on_tool_t = cut.on_tool_t;
  look.load.contact_t = cut.contact_t;
  return look;
}

/// Returns the height above the tip, mm, of the point whose motion is the feed: the centre of the
/// corner, or half the flank of a flat end mill.
double feed_height(const cutting::Cutter& cutter) {
  const double corner = cutting::corner_height(cutter);
  return corner > 0.0 ? corner : 0.5 * cutter.flank_length;
}

/// Adds the edge length in material and the largest chip of an engagement.
void note_engagement(const cutting::Engagement& met, int flutes, double feed_per_tooth,
                     ProcessSample& look) {
  const double feed_across = met.feed_t.head<2>().norm(), feed_along = -met.feed_t.z();
  const double towards = std::atan2(met.feed_t.y(), met.feed_t.x());
  for (const cutting::EngagedArc& arc : met.arcs) {
    const cutting::EdgeSlice& slice = met.slices[std::size_t(arc.slice)];
    look.engaged += slice.length * (arc.to - arc.from) / (2 * pi) * flutes;
    // smallest angle between the arc and the feed direction, where the chip is thickest
    const double middle = 0.5 * (arc.from + arc.to), half = 0.5 * (arc.to - arc.from);
    const double off = std::max(0.0, std::abs(std::remainder(middle - towards, 2 * pi)) - half);
    const double facing =
        feed_across * std::sin(slice.kappa) * std::cos(off) + feed_along * std::cos(slice.kappa);
    look.chip = std::max(look.chip, feed_per_tooth * facing);
  }
}

// Notes a program line once; a program that crashes on more than 1000 lines needs no longer list.
void note_crash(std::vector<int>& lines, int line) {
  if (std::find(lines.begin(), lines.end(), line) == lines.end() && lines.size() < 1000)
    lines.push_back(line);
}

/// Throws BadInput if the spindle of a cut is at rest or turns against the cutting edges.
void check_spindle(const FollowedProgram& program, std::size_t sample, bool turns_as_it_should,
                   const char* expected) {
  const double speed = program.samples.states[sample].spindle_speed;
  if (speed > 0.0 && turns_as_it_should) return;
  throw BadInput(program.path.file, program.samples.line[sample], 0, expected,
                 speed > 0.0 ? "a cut with the spindle turning the other way"
                             : "a cut with the spindle at rest");
}

/// The inputs of milling at one step.
struct MillingSample {
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
  /// M3 increases the spindle angle; seen from the spindle it turns clockwise.
  bool is_clockwise() const {
    return program.samples.states[sample].q[spindle] > program.samples.states[before].q[spindle];
  }
  ProcessSample at(const Pose& T_wt) const;
};

ProcessSample MillingSample::at(const Pose& T_wt) const {
  const cutting::Engagement met = cutting::engagement(stock, cutter, T_wt, feed_w());
  if (met.arcs.empty()) return {};
  check_spindle(program, sample, is_clockwise() == description.flutes.clockwise,
                description.flutes.clockwise
                    ? "a spindle that turns clockwise (S and M3) where it cuts"
                    : "a spindle that turns counter-clockwise (S and M4) where it cuts");
  const double per_tooth =
      feed_w().norm() / duration() * 2 * pi /
      (program.samples.states[sample].spindle_speed * description.flutes.count);
  // A feed per tooth beyond the radius is a wrong unit or speed; the force model takes small chips.
  if (per_tooth > cutter.radius)
    throw BadInput(program.path.file, program.samples.line[sample], 0,
                   "a feed per tooth within the cutter's radius",
                   fmt::format("{:.3g} mm", per_tooth));
  ProcessSample look = process_sample(
      cutting::mean_force(met, *description.material, description.flutes, per_tooth));
  note_engagement(met, description.flutes.count, per_tooth, look);
  return look;
}

/// Returns the step at a sample: converged with the force of the cut, or unloaded if there is none.
ProcessStep step_at(const CuttingDescription& description, const FollowedProgram& program,
                    std::size_t sample, const std::function<ProcessSample(const Pose&)>& force,
                    const Process& before) {
  // the load of the step before is close, which saves iterations
  const Load guess = before.steps.empty() ? Load{} : before.steps.back().load;
  ProcessStep step;
  if (force) step = converged_step(description, program.pose, sample, force, guess);
  const AxisState& state = program.samples.states[sample];
  step.time_s = state.time_s;
  step.line = program.samples.line[sample];
  step.power_W = step.torque * state.spindle_speed * 1e-3;  // N mm rad/s
  return step;
}

Process simulate_milling(const Scene& scene, const Machine& machine,
                         const cutting::Design& design_m, const FollowedProgram& program,
                         const std::function<void(double)>& progress) {
  const CuttingDescription& description = *scene.cutting;
  const auto& cutter = std::get<cutting::Cutter>(program.tool);
  Process process;
  const cutting::Blank blank = blank_of(scene, design_m);
  if (std::string odd = blank_size_warning(scene, blank); !odd.empty())
    process.warnings.push_back(std::move(odd));
  process.stock = blank_stock(scene, blank);
  if (std::string uncovered = uncovered_text(scene, *process.stock, design_m); !uncovered.empty())
    process.warnings.push_back(std::move(uncovered));
  const auto spindle = find_spindle(machine);
  if (description.material && !spindle)
    throw std::invalid_argument("a machine with a spindle nose s for a cut with forces");
  Pose before = program.pose(0, {});
  const std::vector<std::size_t> at = milling_steps(program.samples, program.path, program.T_wt,
                                                    description.step, cutter.flank_length);
  for (std::size_t k = 1; k < at.size(); ++k) {
    const MillingSample look{description,        program, cutter, *process.stock, at[k - 1], at[k],
                             spindle.value_or(0)};
    const bool rapid = is_rapid(program.samples, program.path, at[k]);
    std::function<ProcessSample(const Pose&)> force;
    // no force without feed: a dwell and a plunge of zero length remove nothing
    if (!rapid && description.material && look.duration() > 0.0 && look.feed_w().norm() > 0.0)
      force = [&](const Pose& T_wt) { return look.at(T_wt); };
    ProcessStep step = step_at(description, program, at[k], force, process);
    const Pose after = program.pose(at[k], step.load);
    const cutting::RemovalResult taken =
        cutting::remove(*process.stock, cutter, {before, after, step.line, rapid});
    step.removed = taken.volume;
    if (taken.crashed) note_crash(process.crash_lines, step.line);
    process.steps.push_back(step);
    before = after;
    if (progress && k % 256 == 0) progress(double(k) / double(at.size()));
  }
  return process;
}

/// Returns the radius of the work at the engaged edge, mm, weighted with the chip area.
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

/// Returns true if the work moves down on the rake face, along -y of frame t, as the spindle angle
/// grows.
bool is_tool_descending(const SpindleLine& line, const Pose& T_slow) {
  const Eigen::Vector3d arm = T_slow.translation() - line.point_w;
  return line.direction_w.cross(arm).dot(T_slow.linear().col(1)) > 0.0;
}

/// The inputs of turning at one step.
struct TurningSample {
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
  ProcessSample at(const Pose& T_wt) const;
};

/// Returns the radial direction away from the part, in x and z of the tool; zero on the spindle
/// axis.
Eigen::Vector2d away_from_part(const SpindleLine& line, const Pose& T_slow) {
  const Eigen::Vector3d arm = T_slow.translation() - line.point_w;
  const Eigen::Vector3d out = arm - arm.dot(line.direction_w) * line.direction_w;
  const Eigen::Vector3d out_t = T_slow.linear().transpose() * out;
  const Eigen::Vector2d away(out_t.x(), out_t.z());
  return away.norm() > 1e-9 ? Eigen::Vector2d(away.normalized()) : Eigen::Vector2d::Zero();
}

/// Returns the nose as it cuts a stock of one radius per position: edges that overhang count as
/// edges along the radius.
cutting::Nose nose_over_stock(const cutting::Nose& nose, const Eigen::Vector2d& away) {
  if (!nose.profile || away.isZero(0.0)) return nose;
  cutting::Nose drawn = nose;
  drawn.profile =
      std::make_shared<const cutting::EdgeProfile>(cutting::without_overhang(*nose.profile, away));
  return drawn;
}

/// Returns by how much the work reaches higher than the edges of an insert, mm.
double beyond_edges(const cutting::Nose& nose, const cutting::Nose& drawn,
                    const Eigen::Vector2d& away, const std::vector<cutting::EngagedEdge>& edges) {
  if (!nose.profile || away.isZero(0.0)) return 0.0;
  const double lowest = cutting::extreme_point(*nose.profile, -away).dot(away);
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

// The slow pose has the rotation of the work taken out; the feed is left.
ProcessSample TurningSample::at(const Pose& T_wt) const {
  const Pose T_slow = slow(T_wt);
  const Eigen::Vector2d away = away_from_part(line, T_slow);
  const cutting::Nose drawn = nose_over_stock(nose, away);
  const auto edges = cutting::engagement(stock, drawn, T_slow);
  if (edges.empty()) return {};
  const auto& states = program.samples.states;
  const bool grows = states[sample].q[spindle] > states[before].q[spindle];
  check_spindle(program, sample, grows == is_tool_descending(line, T_slow),
                "a spindle that brings the work down on the rake face where it cuts");
  ProcessSample look = process_sample(cutting::turning_force(
      edges, drawn, *description.material, work_radius(line, T_slow, drawn, edges)));
  for (const cutting::EngagedEdge& edge : edges) {
    look.engaged += edge.length;
    look.chip = std::max(look.chip, edge.chip);
  }
  look.beyond_edge = beyond_edges(nose, drawn, away, edges);
  return look;
}

Process simulate_turning(const Scene& scene, const Machine& machine, const FollowedProgram& program,
                         const std::function<void(double)>& progress) {
  const CuttingDescription& description = *scene.cutting;
  constexpr double scratch = 1e-3;  // mm^3; smaller removals are touches, no crash
  const auto& nose = std::get<cutting::Nose>(program.tool);
  const auto& states = program.samples.states;
  const int spindle = *machine.workpiece_spindle;
  const SpindleLine line = spindle_line(program.chain, spindle);
  Process process;
  process.turned = turned_blank(scene, line);
  const std::vector<std::size_t> at =
      turning_steps(program.samples, program.path, program.T_wt, spindle, line);
  Pose before = slow_pose(line, states.front().q[spindle], program.pose(0, {}));
  for (std::size_t k = 1; k < at.size(); ++k) {
    const TurningSample look{description, program,   nose,  *process.turned,
                             line,        at[k - 1], at[k], spindle};
    const bool rapid = is_rapid(program.samples, program.path, at[k]);
    std::function<ProcessSample(const Pose&)> force;
    if (!rapid && description.material) force = [&](const Pose& T_wt) { return look.at(T_wt); };
    ProcessStep step = step_at(description, program, at[k], force, process);
    const Pose after = look.slow(program.pose(at[k], step.load));
    step.removed =
        // a negative line marks material that a rapid took
        cutting::remove(*process.turned, nose, before, after, rapid ? -step.line : step.line);
    if (rapid && step.removed > scratch) note_crash(process.crash_lines, step.line);
    process.steps.push_back(step);
    before = after;
    if (progress && k % 64 == 0) progress(double(k) / double(at.size()));
  }
  return process;
}

}  // namespace

Process simulate_process(const Scene& scene, const Machine& machine,
                         const cutting::Design& design_m, const FollowedProgram& program,
                         const std::function<void(double)>& progress) {
  if (!scene.cutting || program.samples.states.empty()) return {};
  try {
    if (std::holds_alternative<cutting::Cutter>(program.tool))
      return simulate_milling(scene, machine, design_m, program, progress);
    return simulate_turning(scene, machine, program, progress);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a blank that can be", fault.what());
  } catch (const std::length_error& fault) {
    throw BadInput(scene.file.string(), 0, 0, "a blank that fits in [cutting] max_MiB",
                   fault.what());
  }
}

}  // namespace abbe::sim
