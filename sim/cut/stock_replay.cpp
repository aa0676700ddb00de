#include "sim/cut/stock_replay.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "cutting/stock/collision.h"
#include "cutting/stock/separation.h"
#include "cutting/stock/stock_mesh.h"
#include "sim/cut/collision_events.h"
#include "sim/cut/process_simulation.h"
#include "sim/cut/tool_poses.h"

namespace abbe::sim {

cutting::StockMove MillingSteps::move(std::size_t k) const {
  return {T_wt[k], T_wt[k + 1], line[k + 1], rapid[k + 1]};
}

MillingSteps make_milling_steps(const Segment& segment, const Commands& commands,
                                const Process& process) {
  const program::Samples& samples = commands.samples;
  const program::Path& path = path_of(segment, commands);
  const auto& T_wt = target_poses(segment, commands);
  const auto& cutter = std::get<cutting::Cutter>(segment.scene.tool.actual);
  MillingSteps milling;
  milling.at = milling_steps(samples, path, T_wt, segment.scene.cutting->step, cutter.flank_length);
  milling.T_wt = tool_poses(segment, commands, process, milling.at);
  for (const std::size_t i : milling.at) {
    milling.line.push_back(samples.line[i]);
    milling.rapid.push_back(is_rapid(samples, path, i));
  }
  return milling;
}

MillingSteps make_milling_steps(const Job& job, std::size_t tool, const WindowedProgram& program) {
  const Segment& segment = tool_segments(job)[tool];
  const double reach = std::get<cutting::Cutter>(segment.scene.tool.actual).flank_length;
  const WindowRange range = window_ranges(job)[tool];
  MillingSteps milling;
  CarriedSamples carried;
  for (std::size_t number = range.first; number < range.last; ++number) {
    const Segment window = make_window(job, number);
    const Commands commands = program.commands(window, number);
    const bool continues = number + 1 < range.last;
    carried.add({.samples = commands.samples,
                 .path = path_of(window, commands),
                 .T_wt = target_poses(window, commands),
                 .pose = {},
                 .chain = segment.truth.actual,
                 .tool = segment.scene.tool.actual,
                 .is_continued = window.sampling.continued_from.has_value()});
    std::vector<std::size_t> at =
        milling_steps(carried.samples, carried.path, carried.T_wt, segment.scene.cutting->step,
                      reach, continues, carried.travel);
    const std::size_t last = at.back();
    // The first step of a later window is the last of the windows before.
    if (!milling.at.empty()) at.erase(at.begin());
    Commands carried_commands;
    carried_commands.samples = carried.samples;
    carried_commands.T_wt_nominal = carried.T_wt;
    if (!at.empty())
      std::ranges::move(tool_poses(segment, carried_commands, {}, at),
                        std::back_inserter(milling.T_wt));
    for (const std::size_t i : at) {
      milling.at.push_back(carried.numbers[i]);
      milling.line.push_back(carried.samples.line[i]);
      milling.rapid.push_back(is_rapid(carried.samples, carried.path, i));
    }
    carried.keep(last, reach);
  }
  return milling;
}

namespace {

/// Returns the steps of a turning program, with the poses of the tool relative to the part as if it
/// did not turn.
MillingSteps make_turning_steps(const Segment& segment, const Commands& commands,
                                const Process& process, const SpindleLine& line) {
  const program::Samples& samples = commands.samples;
  const program::Path& path = path_of(segment, commands);
  const auto& T_wt = target_poses(segment, commands);
  const int spindle = *segment.machine.workpiece_spindle;
  MillingSteps turning;
  turning.at = turning_steps(samples, path, T_wt, spindle, line);
  turning.T_wt = tool_poses(segment, commands, process, turning.at);
  for (std::size_t k = 0; k < turning.at.size(); ++k) {
    const std::size_t i = turning.at[k];
    turning.T_wt[k] = slow_pose(line, samples.states[i].q[spindle], turning.T_wt[k]);
    turning.line.push_back(samples.line[i]);
    turning.rapid.push_back(is_rapid(samples, path, i));
  }
  return turning;
}

}  // namespace

StockReplay::StockReplay(const Job& job, const Commands& commands, const Process& process) {
  for (const Segment& segment : job_segments(job)) {
    const std::size_t number = tools_.size();
    const Commands& part_command = part_commands(commands, number);
    const Process steps = part_process(process, number);
    tools_.push_back(segment.scene.tool.actual);
    if (std::holds_alternative<cutting::Cutter>(tools_.back())) {
      if (number == 0)
        stock_ = blank_stock(segment.scene, make_blank(segment.scene, *segment.body_m));
      milling_.push_back(make_milling_steps(segment, part_command, steps));
    } else {
      const SpindleLine line =
          spindle_line(segment.truth.actual, *segment.machine.workpiece_spindle);
      if (number == 0) stock_ = turned_blank(segment.scene, line);
      milling_.push_back(make_turning_steps(segment, part_command, steps, line));
    }
    for (std::size_t k = 0; k < milling_.back().moves(); ++k)
      moves_.push_back({part_command.samples.states[milling_.back().at[k + 1]].time_s, number, k});
  }
}

bool StockReplay::advance_to(double time_s) {
  double removed = 0.0;  // mm^3
  for (; next_move_ < moves_.size() && moves_[next_move_].end_s <= time_s; ++next_move_) {
    const Move& next = moves_[next_move_];
    const cutting::StockMove move = milling_[next.part].move(next.number);
    const auto& tool = tools_[next.part];
    if (auto* milled = std::get_if<cutting::Stock>(&stock_))
      removed += cutting::remove(*milled, std::get<cutting::Cutter>(tool), move).volume;
    else
      // A negative line marks a rapid.
      removed +=
          cutting::remove(std::get<cutting::TurnedStock>(stock_), std::get<cutting::Nose>(tool),
                          move.from_T_wt, move.to_T_wt, move.rapid ? -move.line : move.line);
  }
  return removed > 0.0;
}

cutting::StockMesh StockReplay::mesh() const {
  return std::visit([](const auto& stock) { return cutting::stock_mesh(stock); }, stock_);
}

double StockReplay::volume() const {
  return std::visit([](const auto& stock) { return cutting::volume(stock); }, stock_);
}

namespace {

using cutting::Body;
using Eigen::Vector3d;
using kinematics::Pose;
using Kind = SolidBody::Kind;

constexpr double infinite_distance = std::numeric_limits<double>::infinity();
// A distance found in a step may be too large by the larger of these two.
constexpr double approach_tolerance = 1e-2;  // mm
constexpr double approach_fraction = 0.02;   // of the distance

std::shared_ptr<const cutting::ClosedMesh> stock_shape(const cutting::Stock& stock) {
  cutting::StockMesh mesh = cutting::stock_mesh(stock);
  return std::make_shared<const cutting::ClosedMesh>(
      cutting::ClosedMesh{std::move(mesh.vertices_w), std::move(mesh.triangles), 0.0});
}

/// Cutter or shank. It may rub on the surface that it has just cut, but its core must not touch it.
struct ToolBody {
  Kind kind = Kind::Cutter;
  std::string name;
  int frame = 0;
  Body body, core;
};

/// A body that must not touch the stock, with the state of its search.
struct WatchedBody {
  std::string name;
  int frame = 0;
  Body body;
  double clearance = 0.0;              // mm; smaller distances are reported
  Pose T_w = Pose::Identity();         // pose for which `distance` was computed
  double distance = 0.0;               // mm, lower bound of the distance at T_w
  bool overlaps = false;               // at the start of the program; the body is not searched
  double nearest = infinite_distance;  // mm, smallest distance so far
  ProgramLocation place = {};          // of the smallest distance
  std::optional<std::size_t> event_index = {};  // index of the event in progress
  bool is_touching = false;                     // at the end of the last step
  struct {
    Pose T_w = Pose::Identity();
    double depth = 0.0;        // mm
    double path_length = 0.0;  // mm, since the beginning of the contact
  } last_sample = {};          // of the depth
};

/// Follows the stock through one segment and searches for collisions of bodies with it.
class StockSearch {
 public:
  StockSearch(const ActualMotion& actual_motion, const std::vector<SolidBody>& bodies,
              const std::vector<cutting::BodyPair>& pairs, MillingSteps steps,
              std::optional<cutting::Stock> before)
      : actual_motion_(actual_motion),
        cutter_(std::get<cutting::Cutter>(actual_motion.segment.scene.tool.actual)),
        milling_(std::move(steps)),
        initial_(before ? *std::move(before)
                        : blank_stock(actual_motion.segment.scene,
                                      make_blank(actual_motion.segment.scene,
                                                 *actual_motion.segment.body_m))),
        stock_(initial_) {
    rebuild_mesh();
    for (const cutting::BodyPair& pair : pairs) add(bodies, pair);
    for (const SolidBody& body : bodies)
      if (body.kind == Kind::Shank && has_own_radius(body)) own_shank_radius_ = mesh_radius(body);
    // Cutter and shank may rub on the surface that they have cut, so their cores are smaller by
    // `rubbing`.
    for (const SolidBody& body : tool_bodies(actual_motion.segment, cutting::rubbing))
      if ((body.kind == Kind::Cutter || (body.kind == Kind::Shank && !has_own_radius(body))) &&
          !is_ignored_body(body.name))
        tool_bodies_.push_back(
            {body.kind, body.name, body.frame, search_body(body), search_core(body)});
  }

  StockCollisions result;

  void run(const Progress& progress) {
    if (milling_.at.empty()) {
      result.stock = std::move(stock_);
      return;
    }
    start();
    for (std::size_t move = 0; move < milling_.moves(); ++move) {
      const std::vector<Pose> next_poses = poses(move + 1);
      for (WatchedBody& watched : watched_bodies_) search_step(watched, move, next_poses);
      remove_stock(move);
      poses_ = next_poses;
      if (progress && move % 256 == 0)
        progress("collisions with the stock", double(move) / double(milling_.moves()));
    }
    if (crashes_.empty()) {
      result.stock = std::move(stock_);
    } else {
      result.stock = stock_;
      add_crashes();
    }
    if (unconfirmed_crashes_ > 0)
      result.warnings.push_back(
          fmt::format("the stock is cut with a shank of the cutter radius, {:g} mm: at {} {} "
                      "(first line {}) it removes material that the true shank may not touch",
                      cutter_.radius, unconfirmed_crashes_,
                      unconfirmed_crashes_ == 1 ? "place" : "places", first_unconfirmed_line_));
    // Crashes are found in a second pass, after the other events.
    std::ranges::stable_sort(result.list, {},
                             [](const Collision& event) { return event.first.time_s; });
    add_clearances();
    keep_stock_of_first_contact();
  }

 private:
  /// Keeps the shape of the stock only for the first contact, which is drawn.
  void keep_stock_of_first_contact() {
    bool is_kept = false;
    for (Collision& event : result.list) {
      if (is_kept) event.stock.reset();
      is_kept = is_kept || event.contact;
    }
  }

  bool is_ignored_body(const std::string& name) const {
    return is_ignored(options().ignore, name, "stock");
  }

  /// Adds the clearances of all bodies. Those of cutter and shank are infinite unless they collide,
  /// since they may touch the stock.
  void add_clearances() {
    for (const WatchedBody& watched : watched_bodies_)
      result.clearances.push_back(
          {watched.name, "stock", watched.overlaps, watched.nearest, watched.place,
           watched.overlaps ? ClearanceScope::Never : ClearanceScope::WhenNear});
    for (const ToolBody& tool_body : tool_bodies_) stock_clearance(tool_body.name);
    for (const Collision& event : result.list) {
      Clearance& clearance = stock_clearance(event.a);
      if (!event.contact || clearance.distance == 0.0) continue;
      clearance.distance = 0.0;
      clearance.place = event.first;
    }
  }

  /// Returns the clearance of a body, which is added if the result does not have it yet.
  Clearance& stock_clearance(const std::string& name) {
    const auto clearance = std::ranges::find(result.clearances, name, &Clearance::a);
    if (clearance != result.clearances.end()) return *clearance;
    return result.clearances.emplace_back(
        Clearance{name, "stock", false, infinite_distance, {}, ClearanceScope::WhenInContact});
  }

  void add(const std::vector<SolidBody>& bodies, const cutting::BodyPair& pair) {
    const SolidBody &a = bodies[std::size_t(pair.a)], &b = bodies[std::size_t(pair.b)];
    if (a.kind != Kind::Part && b.kind != Kind::Part) return;
    const SolidBody& body = a.kind == Kind::Part ? b : a;
    const bool is_shank = body.kind == Kind::Shank;
    if (body.kind == Kind::Cutter || (is_shank && !has_own_radius(body))) return;
    if (is_ignored_body(body.name)) return;
    // The clearance of a neck tells nothing, since it moves along the wall that its cutter cuts.
    watched_bodies_.push_back({body.name, body.frame,
                               is_shank ? search_core(body) : search_body(body),
                               is_shank ? 0.0 : options().clearance});
  }

  /// Returns true if the radius of a shank differs from that of the shank that removes stock by
  /// more than 1 % of the cutter radius.
  bool has_own_radius(const SolidBody& shank) const {
    return std::abs(mesh_radius(shank) - shank_radius(cutter_)) > 0.01 * cutter_.radius;
  }
  static double mesh_radius(const SolidBody& shank) {
    return shank.mesh.vertices.leftCols<2>().rowwise().norm().maxCoeff();
  }

  /// Returns the poses of all carriers in the workpiece frame at a step.
  std::vector<Pose> poses(std::size_t k) const {
    std::vector<Pose> T = actual_motion_.carriers({milling_.at[k], 0.0});
    const Carriers carriers{actual_motion_.segment.truth.actual.size()};
    const Pose T_wb = T[std::size_t(carriers.workpiece())].inverse();
    for (Pose& T_carrier : T) T_carrier = T_wb * T_carrier;
    return T;
  }

  /// Returns the pose of a carrier in the workpiece frame between step k and the next.
  /// @param u  fraction of the step, 0 .. 1
  Pose pose(int frame, std::size_t k, double u) const {
    const std::vector<Pose> T = actual_motion_.carriers(moment_in_step(k, u));
    const Carriers carriers{actual_motion_.segment.truth.actual.size()};
    return T[std::size_t(carriers.workpiece())].inverse() * T[std::size_t(frame)];
  }

  ProgramLocation place(std::size_t k) const { return actual_motion_.place({milling_.at[k], 0.0}); }

  /// Returns the end of the block that is executed at a step.
  ProgramLocation end_of_block(std::size_t k) const {
    const CommandedSamples& samples = actual_motion_.samples;
    std::size_t i = milling_.at[k];
    const std::size_t block = samples[i].block;
    while (i + 1 < samples.size() && samples[i + 1].block == block) ++i;
    return actual_motion_.place({i, 0.0});
  }

  void start() {
    poses_ = poses(0);
    for (WatchedBody& watched : watched_bodies_) {
      watched.place = place(0);
      watched.T_w = poses_[std::size_t(watched.frame)];
      watched.distance = distance_to_stock(watched, watched.T_w);
      watched.overlaps = is_in_contact(watched, watched.T_w, watched.distance);
      if (!watched.overlaps) watched.nearest = watched.distance;
    }
  }

  double distance_to_stock(const WatchedBody& watched, const Pose& T_w) {
    if (!mesh_.search) return infinite_distance;
    ++result.queries;
    // The distance may be too large by this fraction. The division makes it a lower bound.
    constexpr double max_relative_error = 0.01;
    return cutting::gap(mesh_, Pose::Identity(), watched.body, T_w, {max_relative_error}).distance /
           (1.0 + max_relative_error);
  }
  bool is_in_contact(const WatchedBody& watched, const Pose& T_w, double distance) const {
    if (!mesh_.search) return false;
    return distance <= options().resolution ||
           cutting::is_inside(mesh_, Pose::Identity(), watched.body, T_w);
  }
  const CollisionDescription& options() const { return actual_motion_.segment.scene.collision; }

  /// Updates the mesh if stock was removed since it was built. Since stock only shrinks, the
  /// distance to an old mesh is a lower bound, and an update is needed only if it is small.
  void update_mesh() {
    if (is_stale_) rebuild_mesh();
  }

  void rebuild_mesh() {
    // A move changes few patches of this size, and the others keep their search trees.
    constexpr double nodes_of_patch = 32;  // along an edge
    shape_ = stock_shape(stock_);
    const bool is_left = shape_->triangles.rows() > 0;
    mesh_ = is_left ? cutting::make_patched_body(*shape_, nodes_of_patch * stock_.spacing, mesh_)
                    : Body{};
    is_stale_ = false;
  }

  /// Returns the distance, mm, above which a body changes no result. The factor allows an error of
  /// 5 % in the smallest clearance.
  double relevant_distance(const WatchedBody& watched) const {
    return std::max({watched.clearance, options().resolution, 0.95 * watched.nearest});
  }

  /// Searches a step for the beginning of an event, or continues the event in progress.
  void search_step(WatchedBody& watched, std::size_t k, const std::vector<Pose>& next_poses) {
    if (watched.overlaps) return;
    if (watched.event_index) return continue_event(watched, k, next_poses);
    const Pose &from = poses_[std::size_t(watched.frame)],
               &to = next_poses[std::size_t(watched.frame)];
    // The last distance minus the motion since then is a lower bound.
    const double motion = cutting::max_displacement(from, to, watched.body);
    const auto is_far = [&] {
      return watched.distance - cutting::max_displacement(watched.T_w, from, watched.body) -
                 motion >
             relevant_distance(watched);
    };
    if (is_far()) return;
    cutting::Approach closest;
    // The old mesh comes first: it gives a lower bound, and a new mesh costs far more than a query.
    for (const bool use_current_mesh : {false, true}) {
      if (use_current_mesh && !is_stale_) break;
      if (use_current_mesh) update_mesh();
      watched.T_w = from;
      watched.distance = distance_to_stock(watched, from);
      if (is_far()) return;
      closest = approach(watched, from, to);
      if (!closest.contact && closest.gap.distance > relevant_distance(watched)) return;
    }
    begin_event(watched, k, closest, from, to);
  }

  cutting::Approach approach(const WatchedBody& watched, const Pose& from, const Pose& to) {
    cutting::ApproachOptions approach_options;
    approach_options.resolution = options().resolution;
    approach_options.within = approach_tolerance;
    approach_options.share = approach_fraction;
    // The queries take half of the tolerance, the search along the step the other half.
    approach_options.query_error = 0.5 * approach_fraction;
    const cutting::Approach closest = cutting::approach(
        mesh_, watched.body, kinematics::screw_between(from, to), approach_options);
    result.queries += std::size_t(closest.queries);
    return closest;
  }

  void begin_event(WatchedBody& watched, std::size_t k, const cutting::Approach& closest,
                   const Pose& from, const Pose& to) {
    const double distance = closest.contact ? 0.0 : closest.gap.distance;
    const cutting::Moment moment = moment_in_step(k, closest.u);
    if (distance < watched.nearest) {
      watched.nearest = distance;
      watched.place = actual_motion_.place(moment);
    }
    if (!closest.contact && distance > watched.clearance) return;
    watched.event_index = result.list.size();
    result.list.push_back(event(moment, 0.5 * (closest.gap.on_a + closest.gap.on_b)));
    Collision& event = result.list.back();
    event.a = watched.name;
    event.b = "stock";
    event.contact = closest.contact;
    event.distance = distance;
    event.last = end_of_block(k + 1);
    open_line_ = event.last.line;
    add_near(watched.name, k, closest);
    watched.is_touching = closest.contact;
    if (closest.contact) begin_contact(watched, event, k, closest.u);
    // A near miss begins where the body comes within the clearance, not where it is nearest.
    else if (const auto u = cutting::first_time_within(mesh_, watched.body,
                                                       kinematics::screw_between(from, to),
                                                       watched.clearance, options().resolution)) {
      event.first = actual_motion_.place(moment_in_step(k, *u));
      event.rapid = actual_motion_.is_rapid(moment_in_step(k, *u));
    }
  }

  /// Begins a contact and samples its depth over the rest of the step.
  /// @param u  fraction of the step at which contact begins
  void begin_contact(WatchedBody& watched, Collision& event, std::size_t k, double u) {
    event.stock = shape_;
    watched.last_sample = {};
    for (std::size_t i = std::size_t(u * samples_per_step) + 1; i <= samples_per_step; ++i)
      measure(watched, event, k, double(i) / double(samples_per_step));
  }

  /// Records a lower bound of the distance in step k, for the blocks that the step belongs to.
  void add_near(const std::string& body, std::size_t k, const cutting::Approach& closest) {
    const double tolerance = std::max(approach_tolerance, approach_fraction * closest.gap.distance);
    const std::size_t end = milling_.at[k + 1];
    if (closest.contact)
      result.near.push_back(
          {actual_motion_.target_sample(moment_in_step(k, closest.u)), end, body, 0.0});
    else
      result.near.push_back(
          {milling_.at[k] + 1, end, body, std::max(0.0, closest.gap.distance - tolerance)});
  }

  /// Returns the moment at fraction u of step k.
  cutting::Moment moment_in_step(std::size_t k, double u) const {
    u = std::max(u, 1e-9);  // the start of a step belongs to the step
    const double position =
        double(milling_.at[k]) + u * double(milling_.at[k + 1] - milling_.at[k]);
    const auto sample = std::min(std::size_t(position), milling_.at[k + 1] - 1);
    return {sample, position - double(sample)};
  }

  Collision event(const cutting::Moment& moment, const Vector3d& position_w) const {
    const Carriers carriers{actual_motion_.segment.truth.actual.size()};
    const std::vector<Pose> T = actual_motion_.carriers(moment);
    return collision_at(actual_motion_, moment, T[std::size_t(carriers.workpiece())] * position_w);
  }

  /// Samples the depth of a contact at fraction u of step k.
  void measure(WatchedBody& watched, Collision& event, std::size_t k, double u) {
    constexpr std::size_t max_depth_samples = 1000;  // for a program that collides throughout
    if (depth_samples_ >= max_depth_samples) return;
    ++depth_samples_;
    watched.last_sample.T_w = pose(watched.frame, k, u);
    watched.last_sample.depth =
        cutting::penetration(mesh_, Pose::Identity(), watched.body, watched.last_sample.T_w).depth;
    ++event.depth_samples;
    if (watched.last_sample.depth < event.depth) return;
    event.depth = watched.last_sample.depth;
    event.worst = actual_motion_.place(moment_in_step(k, u));
  }

  /// Returns true if the depth at the end of step k needs a sample: it may exceed the largest so
  /// far by more than 2 % and the resolution, since a contact deepens by the motion at most; and
  /// the step ends a block, where motion often reverses, or the body has moved by a 24th of its
  /// path in this contact since the last sample.
  bool is_probe_needed(const WatchedBody& watched, const Collision& event, std::size_t k,
                       const Pose& to) const {
    constexpr double min_increase = 0.02, samples_per_path = 24;
    const double motion = cutting::max_displacement(watched.last_sample.T_w, to, watched.body);
    if (watched.last_sample.depth + motion <=
        std::max((1.0 + min_increase) * event.depth, event.depth + options().resolution))
      return false;
    const bool is_block_end =
        k + 1 == milling_.moves() || milling_.line[k + 2] != milling_.line[k + 1];
    return is_block_end || samples_per_path * motion >= watched.last_sample.path_length;
  }

  /// Continues an event. The mesh of the stock is updated only once a block, since the stock
  /// changes in every step while the tool cuts.
  void continue_event(WatchedBody& watched, std::size_t k, const std::vector<Pose>& next_poses) {
    Collision& event = result.list[*watched.event_index];
    const Pose &from = poses_[std::size_t(watched.frame)],
               &to = next_poses[std::size_t(watched.frame)];
    if (milling_.line[k + 1] != open_line_) update_mesh();
    open_line_ = milling_.line[k + 1];
    cutting::Approach closest;
    closest.contact = watched.is_touching;
    if (!watched.is_touching) closest = nearest_in(watched, from, to);
    add_near(watched.name, k, closest);
    watched.T_w = to;
    watched.distance = distance_to_stock(watched, to);
    watched.is_touching = is_in_contact(watched, to, watched.distance);
    event.last = end_of_block(k + 1);
    // A near miss that becomes a contact stays one event.
    if (!event.contact && (closest.contact || closest.gap.distance < event.distance))
      replace_near_miss(watched, event, k, closest);
    watched.last_sample.path_length += cutting::max_displacement(from, to, watched.body);
    if (watched.is_touching && is_probe_needed(watched, event, k, to))
      measure(watched, event, k, 1.0);
    if (!watched.is_touching && watched.distance > watched.clearance) watched.event_index.reset();
  }

  /// Returns the closest approach in a step that begins without contact. A contact with an old mesh
  /// is checked with the current one.
  cutting::Approach nearest_in(const WatchedBody& watched, const Pose& from, const Pose& to) {
    const cutting::Approach closest = approach(watched, from, to);
    if (!closest.contact || !is_stale_) return closest;
    update_mesh();
    return approach(watched, from, to);
  }

  /// Replaces a near miss by a closer one, or by a contact.
  void replace_near_miss(WatchedBody& watched, Collision& event, std::size_t k,
                         const cutting::Approach& closest) {
    Collision replacement =
        this->event(moment_in_step(k, closest.u), 0.5 * (closest.gap.on_a + closest.gap.on_b));
    replacement.a = event.a;
    replacement.b = event.b;
    replacement.last = event.last;
    replacement.contact = closest.contact;
    replacement.distance = closest.contact ? 0.0 : closest.gap.distance;
    if (!closest.contact) {
      replacement.first = event.first;
      replacement.rapid = event.rapid;
    }
    event = std::move(replacement);
    if (closest.contact) begin_contact(watched, event, k, closest.u);
    if (event.distance < watched.nearest) {
      watched.nearest = event.distance;
      watched.place = event.worst;
    }
  }

  void remove_stock(std::size_t k) {
    const cutting::RemovalResult removal = cutting::remove(stock_, cutter_, milling_.move(k));
    if (removal.volume > 0.0) is_stale_ = true;
    // A shank wider than the cutter is a watched body, which meets all that a shank of the cutter's
    // radius would meet.
    const bool is_watched =
        own_shank_radius_.value_or(0.0) > shank_radius(cutter_) && !milling_.rapid[k + 1];
    if (removal.crashed && !is_watched) crashes_.push_back(k);
  }

  /// Repeats the cut to examine the crashes of cutter and shank, each with the stock at its time.
  /// Only the first crashes are measured, since each needs a new mesh.
  void add_crashes() {
    stock_ = std::move(initial_);
    std::size_t k = 0, measured = 0;
    for (std::size_t i = 0; i < crashes_.size();) {
      std::size_t end = i + 1;
      while (end < crashes_.size() && is_same_crash(crashes_[end - 1], crashes_[end])) ++end;
      Collision event = dexel_crash(crashes_[i]);
      if (measured++ < max_measured_contacts) {
        for (; k < crashes_[i]; ++k) cutting::remove(stock_, cutter_, milling_.move(k));
        rebuild_mesh();
        // The mesh does not show a contact shallower than the dexel spacing.
        event.below_mesh = true;
        event = deepest(i, end).value_or(std::move(event));
      }
      if (event.below_mesh && own_shank_radius_) {
        if (unconfirmed_crashes_++ == 0) first_unconfirmed_line_ = event.first.line;
      } else if (!is_ignored_body(event.a)) {
        add_crash(i, end, std::move(event));
      }
      i = end;
    }
  }

  /// Returns true if two consecutive crashes belong to the same event.
  bool is_same_crash(std::size_t a, std::size_t b) const {
    return milling_.rapid[a + 1] == milling_.rapid[b + 1] &&
           (b == a + 1 || milling_.line[a + 1] == milling_.line[b + 1]);
  }

  std::optional<Collision> first_contact(const ToolBody& body, std::size_t begin, std::size_t end) {
    const auto frame = std::size_t(body.frame);
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t k = crashes_[i];
      const cutting::Approach closest = cutting::approach(
          mesh_, body.core, kinematics::screw_between(poses(k)[frame], poses(k + 1)[frame]));
      result.queries += std::size_t(closest.queries);
      if (!closest.contact) continue;
      Collision crash = event(moment_in_step(k, closest.u), closest.gap.on_a);
      crash.a = body.name;
      return crash;
    }
    return {};
  }

  /// Samples the depth of a body over the crashes [begin, end) with the stock at the first of them.
  void measure(const ToolBody& body, std::size_t begin, std::size_t end, Collision& event) const {
    constexpr std::size_t divisions = samples_per_step;
    const auto u = [](std::size_t division) {
      return double(division % divisions + 1) / double(divisions);
    };
    const auto line = [&](std::size_t i) { return milling_.line[crashes_[i] + 1]; };
    std::vector<std::size_t> line_ends;
    for (std::size_t i = begin; i < end; ++i)
      if (i + 1 == end || line(i + 1) != line(i))
        line_ends.push_back(divisions * i + divisions - 1);
    const DeepestSample deepest =
        deepest_sample(divisions * begin, divisions * end, line_ends, [&](std::size_t division) {
          return cutting::penetration(mesh_, Pose::Identity(), body.body,
                                      pose(body.frame, crashes_[division / divisions], u(division)))
              .depth;
        });
    event.depth = deepest.depth;
    event.depth_samples = deepest.sample_count;
    event.worst = actual_motion_.place(
        moment_in_step(crashes_[deepest.moment / divisions], u(deepest.moment)));
  }

  /// Returns the deeper of the contacts of cutter and shank; empty if the mesh shows none.
  std::optional<Collision> deepest(std::size_t begin, std::size_t end) {
    std::optional<Collision> deepest_contact;
    if (!mesh_.search) return deepest_contact;
    for (const ToolBody& body : tool_bodies_) {
      // A cutter may meet stock in feed.
      if (body.kind == Kind::Cutter && !milling_.rapid[crashes_[begin] + 1]) continue;
      std::optional<Collision> contact = first_contact(body, begin, end);
      if (!contact) continue;
      measure(body, begin, end, *contact);
      if (!deepest_contact || contact->depth > deepest_contact->depth)
        deepest_contact = std::move(contact);
    }
    return deepest_contact;
  }

  /// Returns the event for a crash that only the dexels show.
  Collision dexel_crash(std::size_t k) const {
    Collision crash = event({milling_.at[k], 0.0}, milling_.T_wt[k].translation());
    crash.a = milling_.rapid[k + 1] ? "cutter" : "shank";
    return crash;
  }

  void add_crash(std::size_t begin, std::size_t end, Collision crash) {
    crash.b = "stock";
    crash.stock = shape_;
    crash.rapid = milling_.rapid[crashes_[begin] + 1];
    crash.last = end_of_block(crashes_[end - 1] + 1);
    for (std::size_t i = begin; i < end; ++i)
      result.near.push_back(
          {milling_.at[crashes_[i]] + 1, milling_.at[crashes_[i] + 1], crash.a, 0.0});
    result.list.push_back(std::move(crash));
  }

  const ActualMotion& actual_motion_;
  const cutting::Cutter& cutter_;
  MillingSteps milling_;
  cutting::Stock initial_, stock_;
  std::shared_ptr<const cutting::ClosedMesh> shape_;
  Body mesh_;  // search structure of `shape_`; empty if no stock is left
  bool is_stale_ = false;
  std::optional<double> own_shank_radius_;  // mm; empty: the shank has the radius of the cutter
  std::size_t unconfirmed_crashes_ = 0;     // crashes of the dexels that the bodies do not confirm
  int first_unconfirmed_line_ = 0;
  std::vector<WatchedBody> watched_bodies_;
  std::vector<ToolBody> tool_bodies_;
  std::vector<Pose> poses_;           // of all carriers in the workpiece, at the present step
  std::vector<std::size_t> crashes_;  // steps in which the dexels show a crash of cutter or shank
  int open_line_ = 0;
  std::size_t depth_samples_ = 0;
};

}  // namespace

bool has_tracked_stock(const Segment& segment) {
  return segment.scene.cutting &&
         std::holds_alternative<cutting::Cutter>(segment.scene.tool.actual);
}

StockCollisions stock_collisions(const ActualMotion& actual_motion,
                                 const std::vector<SolidBody>& bodies,
                                 const std::vector<cutting::BodyPair>& pairs, MillingSteps steps,
                                 std::optional<cutting::Stock> before, const Progress& progress) {
  StockSearch search(actual_motion, bodies, pairs, std::move(steps), std::move(before));
  search.run(progress);
  return std::move(search.result);
}

}  // namespace abbe::sim
