#include "sim/cut/stock_replay.h"

#include <algorithm>
#include <cmath>
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

cutting::StockMove Milling::move(std::size_t k) const {
  return {T_wt[k], T_wt[k + 1], line[k + 1], rapid[k + 1]};
}

Milling milling_of(const Job& part, const Commands& commands, const Process& process) {
  const program::Samples& samples = commands.samples;
  const program::Path& path = path_of(part, commands);
  const auto& T_wt = target_poses(part, commands);
  const auto& cutter = std::get<cutting::Cutter>(part.scene.tool.actual);
  Milling milling;
  milling.at = milling_steps(samples, path, T_wt, part.scene.cutting->step, cutter.flank_length);
  milling.T_wt = tool_poses(part, commands, process, milling.at);
  for (const std::size_t i : milling.at) {
    milling.line.push_back(samples.line[i]);
    milling.rapid.push_back(is_rapid(samples, path, i));
  }
  return milling;
}

namespace {

/// Returns the steps of a turning program, with the poses of the tool relative to a part that does
/// not turn.
Milling turning_of(const Job& part, const Commands& commands, const Process& process,
                   const SpindleLine& line) {
  const program::Samples& samples = commands.samples;
  const program::Path& path = path_of(part, commands);
  const auto& T_wt = target_poses(part, commands);
  const int spindle = *part.machine.workpiece_spindle;
  Milling turning;
  turning.at = turning_steps(samples, path, T_wt, spindle, line);
  turning.T_wt = tool_poses(part, commands, process, turning.at);
  for (std::size_t k = 0; k < turning.at.size(); ++k) {
    const std::size_t i = turning.at[k];
    turning.T_wt[k] = slow_pose(line, samples.states[i].q[spindle], turning.T_wt[k]);
    turning.line.push_back(samples.line[i]);
    turning.rapid.push_back(is_rapid(samples, path, i));
  }
  return turning;
}

}  // namespace

StockReplay::StockReplay(const Job& part, const Commands& commands, const Process& process)
    : tool_(part.scene.tool.actual) {
  if (std::holds_alternative<cutting::Cutter>(tool_)) {
    stock_ = blank_stock(part.scene, blank_of(part.scene, *part.body_m));
    milling_ = milling_of(part, commands, process);
  } else {
    const SpindleLine line = spindle_line(part.truth.actual, *part.machine.workpiece_spindle);
    stock_ = turned_blank(part.scene, line);
    milling_ = turning_of(part, commands, process, line);
  }
  for (std::size_t k = 1; k < milling_.at.size(); ++k)
    time_s_.push_back(commands.samples.states[milling_.at[k]].time_s);
}

bool StockReplay::advance_to(double time_s) {
  double taken = 0.0;  // mm^3
  for (; next_ < time_s_.size() && time_s_[next_] <= time_s; ++next_) {
    const cutting::StockMove move = milling_.move(next_);
    if (auto* milled = std::get_if<cutting::Stock>(&stock_))
      taken += cutting::remove(*milled, std::get<cutting::Cutter>(tool_), move).volume;
    else
      taken +=
          // a negative line marks a rapid
          cutting::remove(std::get<cutting::TurnedStock>(stock_), std::get<cutting::Nose>(tool_),
                          move.from_T_wt, move.to_T_wt, move.rapid ? -move.line : move.line);
  }
  return taken > 0.0;
}

double StockReplay::done() const {
  return time_s_.empty() ? 1.0 : double(next_) / double(time_s_.size());
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

constexpr double infinite = std::numeric_limits<double>::infinity();
// The distance found in a step may be too large by the larger of these two.
constexpr double approach_tolerance = 1e-2;  // mm
constexpr double approach_fraction = 0.02;   // of the distance

std::shared_ptr<const cutting::ClosedMesh> shape_of(const cutting::Stock& stock) {
  cutting::StockMesh mesh = cutting::stock_mesh(stock);
  return std::make_shared<const cutting::ClosedMesh>(
      cutting::ClosedMesh{std::move(mesh.vertices_w), std::move(mesh.triangles), 0.0});
}

/// Cutter or shank. It may rub on the skin that it has just cut, but its core must not touch it.
struct ToolBody {
  Kind kind = Kind::Cutter;
  std::string name;
  int frame = 0;
  Body body, core;
};

/// A body that must not touch the stock.
struct WatchedBody {
  std::string name;
  int frame = 0;
  Body body;
  double clearance = 0.0;                // mm, a smaller distance is reported
  Pose T_w = Pose::Identity();           // pose for which `distance` was computed
  double distance = 0.0;                 // mm, lower bound of the distance at T_w
  bool overlaps = false;                 // overlaps the stock at the start and is not followed
  double nearest = infinite;             // mm, smallest distance so far
  ProgramLocation place = {};            // where that was
  std::optional<std::size_t> open = {};  // index of the event in progress
  bool met = false;                      // in contact at the end of the last step
  struct {
    Pose T_w = Pose::Identity();
    double depth = 0.0;  // mm, sampled there
    double way = 0.0;    // mm, path since the contact began
  } looked = {};         // last sample of the depth
};

/// Follows the stock from blank to part and searches for collisions of the machine with it.
class StockSearch {
 public:
  StockSearch(const ActualMotion& actual_motion, const std::vector<SolidBody>& bodies,
              const std::vector<cutting::BodyPair>& pairs)
      : actual_motion_(actual_motion),
        cutter_(std::get<cutting::Cutter>(actual_motion.part.scene.tool.actual)),
        milling_(milling_of(actual_motion.part, actual_motion.commands)),
        blank_(blank_stock(actual_motion.part.scene,
                           blank_of(actual_motion.part.scene, *actual_motion.part.body_m))),
        stock_(blank_) {
    renew();
    for (const cutting::BodyPair& pair : pairs) add(bodies, pair);
    for (const SolidBody& body : bodies)
      if (body.kind == Kind::Shank && has_own_radius(body)) own_shank_radius_ = radius_of(body);
    // Cutter and shank may rub on what they have cut; their cores are smaller by `rubbing`.
    for (const SolidBody& body : tool_bodies(actual_motion.part, cutting::rubbing))
      if ((body.kind == Kind::Cutter || (body.kind == Kind::Shank && !has_own_radius(body))) &&
          !is_left_out(body.name))
        tool_.push_back({body.kind, body.name, body.frame, searched(body), search_core(body)});
  }

  StockCollisions found;

  void run(const Progress& progress) {
    if (milling_.at.empty()) return;
    start();
    for (std::size_t k = 0; k < milling_.moves(); ++k) {
      const std::vector<Pose> next = poses(k + 1);
      for (WatchedBody& one : watched_) look(one, k, next);
      take(k);
      now_ = next;
      if (progress && k % 256 == 0)
        progress("collisions with the stock", double(k) / double(milling_.moves()));
    }
    if (!crashes_.empty()) add_crashes();
    if (unseen_ > 0)
      found.warnings.push_back(fmt::format(
          "the stock is cut with a shank of the cutter's radius, {:g} mm: at {} {} (first line {}) "
          "it takes away what the true shank is not seen to meet",
          cutter_.radius, unseen_, unseen_ == 1 ? "place" : "places", unseen_line_));
    // Crashes were found in a second pass, so the list is not in order yet.
    std::ranges::stable_sort(found.list, {}, [](const Collision& one) { return one.first.time_s; });
    add_clearances();
    keep_first_stock();
  }

 private:
  /// Keeps the stock only of the first contact, the one that is drawn.
  void keep_first_stock() {
    bool is_kept = false;
    for (Collision& one : found.list) {
      if (is_kept) one.stock.reset();
      is_kept = is_kept || one.contact;
    }
  }

  bool is_left_out(const std::string& name) const {
    return is_ignored(options().ignore, name, "stock");
  }

  /// Adds the clearances of all bodies. Cutter and shank have one only if they collide, since they
  /// may touch the stock.
  void add_clearances() {
    for (const WatchedBody& one : watched_)
      found.clearances.push_back({one.name, "stock", one.overlaps, one.nearest, one.place,
                                  one.overlaps ? ClearanceScope::Never : ClearanceScope::WhenNear});
    for (const ToolBody& one : tool_) clearance_of(one.name);
    for (const Collision& event : found.list) {
      Clearance& clearance = clearance_of(event.a);
      if (!event.contact || clearance.distance == 0.0) continue;
      clearance.distance = 0.0;
      clearance.place = event.first;
    }
  }

  Clearance& clearance_of(const std::string& name) {
    const auto one = std::ranges::find(found.clearances, name, &Clearance::a);
    if (one != found.clearances.end()) return *one;
    return found.clearances.emplace_back(
        Clearance{name, "stock", false, infinite, {}, ClearanceScope::WhenInContact});
  }

  void add(const std::vector<SolidBody>& bodies, const cutting::BodyPair& pair) {
    const SolidBody &a = bodies[std::size_t(pair.a)], &b = bodies[std::size_t(pair.b)];
    if (a.kind != Kind::Part && b.kind != Kind::Part) return;
    const SolidBody& other = a.kind == Kind::Part ? b : a;
    const bool is_shank = other.kind == Kind::Shank;
    if (other.kind == Kind::Cutter || (is_shank && !has_own_radius(other))) return;
    if (is_left_out(other.name)) return;
    // A neck moves along the wall that its cutter cuts, so its clearance would say nothing.
    watched_.push_back({other.name, other.frame, is_shank ? search_core(other) : searched(other),
                        is_shank ? 0.0 : options().clearance});
  }

  /// Returns true if the radius of a shank differs from that which removes stock by more than 1 %
  /// of the cutter radius.
  bool has_own_radius(const SolidBody& shank) const {
    return std::abs(radius_of(shank) - shank_radius(cutter_)) > 0.01 * cutter_.radius;
  }
  static double radius_of(const SolidBody& shank) {
    return shank.mesh.vertices.leftCols<2>().rowwise().norm().maxCoeff();
  }

  /// Returns the poses of all carriers in the workpiece frame at a step.
  std::vector<Pose> poses(std::size_t k) const {
    std::vector<Pose> T = actual_motion_.carriers({milling_.at[k], 0.0});
    const Carriers carriers{actual_motion_.part.truth.actual.size()};
    const Pose T_wb = T[std::size_t(carriers.workpiece())].inverse();
    for (Pose& one : T) one = T_wb * one;
    return T;
  }

  /// Returns the pose of a carrier in the workpiece frame between step k and the next.
  /// @param u  fraction of the way, 0 .. 1
  Pose pose(int frame, std::size_t k, double u) const {
    const std::vector<Pose> T = actual_motion_.carriers(moment_of(k, u));
    const Carriers carriers{actual_motion_.part.truth.actual.size()};
    return T[std::size_t(carriers.workpiece())].inverse() * T[std::size_t(frame)];
  }

  ProgramLocation place(std::size_t k) const { return actual_motion_.place({milling_.at[k], 0.0}); }

  /// Returns the end of the block that is being executed at a step.
  ProgramLocation end_of_block(std::size_t k) const {
    const auto& block = actual_motion_.samples.block;
    std::size_t i = milling_.at[k];
    while (i + 1 < block.size() && block[i + 1] == block[i]) ++i;
    return actual_motion_.place({i, 0.0});
  }

  void start() {
    now_ = poses(0);
    for (WatchedBody& one : watched_) {
      one.place = place(0);
      one.T_w = now_[std::size_t(one.frame)];
      one.distance = ask(one, one.T_w);
      one.overlaps = meets(one, one.T_w, one.distance);
      if (!one.overlaps) one.nearest = one.distance;
    }
  }

  double ask(const WatchedBody& one, const Pose& T_w) {
    if (!mesh_.search) return infinite;
    ++found.queries;
    // The distance may be too large by this fraction; the division makes it a lower bound.
    constexpr double share = 0.01;
    return cutting::gap(mesh_, Pose::Identity(), one.body, T_w, {share}).distance / (1.0 + share);
  }
  bool meets(const WatchedBody& one, const Pose& T_w, double distance) const {
    if (!mesh_.search) return false;
    return distance <= options().resolution ||
           cutting::is_inside(mesh_, Pose::Identity(), one.body, T_w);
  }
  const CollisionDescription& options() const { return actual_motion_.part.scene.collision; }

  /// Updates the mesh if stock was removed since. A distance to an old mesh is still a lower bound,
  /// because stock only shrinks, so the mesh is updated only when the old one comes near.
  void refresh() {
    if (!is_stale_) return;
    renew();
  }

  void renew() {
    // Patches of 32 nodes along each edge: a move changes few of them, and the others keep their
    // search trees.
    constexpr double nodes_of_patch = 32;
    shape_ = shape_of(stock_);
    const bool is_left = shape_->triangles.rows() > 0;
    mesh_ = is_left ? cutting::make_patched_body(*shape_, nodes_of_patch * stock_.spacing, mesh_)
                    : Body{};
    is_stale_ = false;
  }

  /// Returns the distance, mm, above which a body needs no closer look. The factor leaves an error
  /// of 5 % in the smallest clearance.
  double wanted(const WatchedBody& one) const {
    return std::max({one.clearance, options().resolution, 0.95 * one.nearest});
  }

  void look(WatchedBody& one, std::size_t k, const std::vector<Pose>& next) {
    if (one.overlaps) return;
    if (one.open) return go_on(one, k, next);
    const Pose &from = now_[std::size_t(one.frame)], &to = next[std::size_t(one.frame)];
    // The last distance, less the motion since then, is still a lower bound.
    const double step = cutting::farthest(from, to, one.body);
    const auto is_far = [&] {
      return one.distance - cutting::farthest(one.T_w, from, one.body) - step > wanted(one);
    };
    if (is_far()) return;
    cutting::Approach near;
    // The old mesh is tried first: it gives a lower bound, and a new mesh costs far more than a
    // query.
    for (const bool fresh : {false, true}) {
      if (fresh && !is_stale_) break;
      if (fresh) refresh();
      one.T_w = from;
      one.distance = ask(one, from);
      if (is_far()) return;
      near = approach(one, from, to);
      if (!near.contact && near.gap.distance > wanted(one)) return;
    }
    note(one, k, near, from, to);
  }

  cutting::Approach approach(const WatchedBody& one, const Pose& from, const Pose& to) {
    cutting::ApproachOptions how;
    how.resolution = options().resolution;
    how.within = approach_tolerance;
    how.share = approach_fraction;
    // Half of the tolerance is for the queries, the other half for the search along the step.
    how.rough = 0.5 * approach_fraction;
    const cutting::Approach near =
        cutting::approach(mesh_, one.body, kinematics::screw_between(from, to), how);
    found.queries += std::size_t(near.queries);
    return near;
  }

  void note(WatchedBody& one, std::size_t k, const cutting::Approach& near, const Pose& from,
            const Pose& to) {
    const double distance = near.contact ? 0.0 : near.gap.distance;
    const cutting::Moment moment = moment_of(k, near.u);
    if (distance < one.nearest) {
      one.nearest = distance;
      one.place = actual_motion_.place(moment);
    }
    if (!near.contact && distance > one.clearance) return;
    one.open = found.list.size();
    found.list.push_back(event(moment, 0.5 * (near.gap.on_a + near.gap.on_b)));
    Collision& event = found.list.back();
    event.a = one.name;
    event.b = "stock";
    event.contact = near.contact;
    event.distance = distance;
    event.last = end_of_block(k + 1);
    open_line_ = event.last.line;
    add_near(one.name, k, near);
    one.met = near.contact;
    if (near.contact) meet(one, event, k, near.u);
    // A near miss begins where the body comes within the clearance, not where it is nearest.
    else if (const auto u =
                 cutting::comes_within(mesh_, one.body, kinematics::screw_between(from, to),
                                       one.clearance, options().resolution)) {
      event.first = actual_motion_.place(moment_of(k, *u));
      event.rapid = actual_motion_.is_rapid(moment_of(k, *u));
    }
  }

  /// Begins a contact and samples its depth over the rest of the step.
  /// @param u  fraction of the step at which contact begins
  void meet(WatchedBody& one, Collision& event, std::size_t k, double u) {
    event.stock = shape_;
    one.looked = {};
    for (std::size_t i = std::size_t(u * samples_per_step) + 1; i <= samples_per_step; ++i)
      measure(one, event, k, double(i) / double(samples_per_step));
  }

  /// Records a lower bound of the distance in step k, for the blocks that the step belongs to.
  void add_near(const std::string& body, std::size_t k, const cutting::Approach& near) {
    const double less = std::max(approach_tolerance, approach_fraction * near.gap.distance);
    const std::size_t end = milling_.at[k + 1];
    if (near.contact)
      found.near.push_back({actual_motion_.running(moment_of(k, near.u)), end, body, 0.0});
    else
      found.near.push_back(
          {milling_.at[k] + 1, end, body, std::max(0.0, near.gap.distance - less)});
  }

  /// Returns the moment at fraction u of step k.
  cutting::Moment moment_of(std::size_t k, double u) const {
    u = std::max(u, 1e-9);  // so that the start of a step counts as part of it
    const double at = double(milling_.at[k]) + u * double(milling_.at[k + 1] - milling_.at[k]);
    const auto i = std::min(std::size_t(at), milling_.at[k + 1] - 1);
    return {i, at - double(i)};
  }

  Collision event(const cutting::Moment& moment, const Vector3d& place_w) const {
    const Carriers carriers{actual_motion_.part.truth.actual.size()};
    const std::vector<Pose> T = actual_motion_.carriers(moment);
    return collision_at(actual_motion_, moment, T[std::size_t(carriers.workpiece())] * place_w);
  }

  /// Samples the depth of a contact at fraction u of step k.
  void measure(WatchedBody& one, Collision& event, std::size_t k, double u) {
    // Bounds the time for a program that collides throughout.
    constexpr std::size_t max_looks = 1000;
    if (looks_ >= max_looks) return;
    ++looks_;
    one.looked.T_w = pose(one.frame, k, u);
    one.looked.depth = cutting::way_out(mesh_, Pose::Identity(), one.body, one.looked.T_w).depth;
    ++event.depths;
    if (one.looked.depth < event.depth) return;
    event.depth = one.looked.depth;
    event.worst = actual_motion_.place(moment_of(k, u));
  }

  /// Returns true if the depth at the end of step k is to be sampled. It must be able to exceed the
  /// largest so far by more than 2 % and the resolution, given that a contact deepens by no more
  /// than the motion. In addition the step must end a block, where motion often reverses, or the
  /// body must have moved by a 24th of its path in this contact since the last sample.
  bool is_probe_needed(const WatchedBody& one, const Collision& event, std::size_t k,
                       const Pose& to) const {
    constexpr double share = 0.02, often = 24;
    const double moved = cutting::farthest(one.looked.T_w, to, one.body);
    if (one.looked.depth + moved <=
        std::max((1.0 + share) * event.depth, event.depth + options().resolution))
      return false;
    const bool ends_block =
        k + 1 == milling_.moves() || milling_.line[k + 2] != milling_.line[k + 1];
    return ends_block || often * moved >= one.looked.way;
  }

  /// Continues an event. The mesh of the stock is updated once per block, because an exact one
  /// would have to be built for every step while the tool cuts.
  void go_on(WatchedBody& one, std::size_t k, const std::vector<Pose>& next) {
    Collision& event = found.list[*one.open];
    const Pose &from = now_[std::size_t(one.frame)], &to = next[std::size_t(one.frame)];
    if (milling_.line[k + 1] != open_line_) refresh();
    open_line_ = milling_.line[k + 1];
    cutting::Approach near;
    near.contact = one.met;
    if (!one.met) near = nearest_in(one, from, to);
    add_near(one.name, k, near);
    one.T_w = to;
    one.distance = ask(one, to);
    one.met = meets(one, to, one.distance);
    event.last = end_of_block(k + 1);
    // A near miss that turns into a contact is a single event.
    if (!event.contact && (near.contact || near.gap.distance < event.distance))
      nearer(one, event, k, near);
    one.looked.way += cutting::farthest(from, to, one.body);
    if (one.met && is_probe_needed(one, event, k, to)) measure(one, event, k, 1.0);
    if (!one.met && one.distance > one.clearance) one.open.reset();
  }

  /// Returns the nearest approach in a step that begins without contact. A contact with an old mesh
  /// is confirmed with the current one.
  cutting::Approach nearest_in(const WatchedBody& one, const Pose& from, const Pose& to) {
    const cutting::Approach near = approach(one, from, to);
    if (!near.contact || !is_stale_) return near;
    refresh();
    return approach(one, from, to);
  }

  void nearer(WatchedBody& one, Collision& event, std::size_t k, const cutting::Approach& near) {
    Collision now = this->event(moment_of(k, near.u), 0.5 * (near.gap.on_a + near.gap.on_b));
    now.a = event.a;
    now.b = event.b;
    now.last = event.last;
    now.contact = near.contact;
    now.distance = near.contact ? 0.0 : near.gap.distance;
    // A near miss keeps the beginning found before.
    if (!near.contact) {
      now.first = event.first;
      now.rapid = event.rapid;
    }
    event = std::move(now);
    if (near.contact) meet(one, event, k, near.u);
    if (event.distance < one.nearest) {
      one.nearest = event.distance;
      one.place = event.worst;
    }
  }

  void take(std::size_t k) {
    const cutting::RemovalResult removed = cutting::remove(stock_, cutter_, milling_.move(k));
    if (removed.volume > 0.0) is_stale_ = true;
    // A shank wider than the cutter is followed as a body of its own, which meets everything that a
    // shank of the cutter's radius would.
    const bool is_watched =
        own_shank_radius_.value_or(0.0) > shank_radius(cutter_) && !milling_.rapid[k + 1];
    if (removed.crashed && !is_watched) crashes_.push_back(k);
  }

  /// Runs the program a second time to examine the crashes of cutter and shank, each with the stock
  /// that it meets. Only the first ones are measured, since each needs a new mesh.
  void add_crashes() {
    stock_ = blank_;
    std::size_t k = 0, measured = 0;
    for (std::size_t i = 0; i < crashes_.size();) {
      std::size_t end = i + 1;
      while (end < crashes_.size() && is_same_crash(crashes_[end - 1], crashes_[end])) ++end;
      Collision event = unseen(crashes_[i]);
      if (measured++ < max_measured_contacts) {
        for (; k < crashes_[i]; ++k) cutting::remove(stock_, cutter_, milling_.move(k));
        renew();
        // A contact shallower than the dexel spacing does not show in the mesh.
        event.below_mesh = true;
        event = deepest(i, end).value_or(std::move(event));
      }
      if (event.below_mesh && own_shank_radius_) {
        if (unseen_++ == 0) unseen_line_ = event.first.line;
      } else if (!is_left_out(event.a)) {
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
      const cutting::Approach met = cutting::approach(
          mesh_, body.core, kinematics::screw_between(poses(k)[frame], poses(k + 1)[frame]));
      found.queries += std::size_t(met.queries);
      if (!met.contact) continue;
      Collision one = event(moment_of(k, met.u), met.gap.on_a);
      one.a = body.name;
      return one;
    }
    return {};
  }

  /// Samples the depth of a body over the crashes [begin, end) with the stock at the first of them.
  void measure(const ToolBody& body, std::size_t begin, std::size_t end, Collision& event) const {
    constexpr std::size_t n = samples_per_step;
    const auto u = [](std::size_t look) { return double(look % n + 1) / double(n); };
    const auto line = [&](std::size_t i) { return milling_.line[crashes_[i] + 1]; };
    std::vector<std::size_t> line_ends;
    for (std::size_t i = begin; i < end; ++i)
      if (i + 1 == end || line(i + 1) != line(i)) line_ends.push_back(n * i + n - 1);
    const DeepestSample deepest =
        deepest_sample(n * begin, n * end, line_ends, [&](std::size_t look) {
          return cutting::way_out(mesh_, Pose::Identity(), body.body,
                                  pose(body.frame, crashes_[look / n], u(look)))
              .depth;
        });
    event.depth = deepest.depth;
    event.depths = deepest.looks;
    event.worst = actual_motion_.place(moment_of(crashes_[deepest.at / n], u(deepest.at)));
  }

  /// Returns the deeper of the contacts of cutter and shank; empty if the mesh shows none.
  std::optional<Collision> deepest(std::size_t begin, std::size_t end) {
    std::optional<Collision> worst;
    if (!mesh_.search) return worst;
    for (const ToolBody& body : tool_) {
      // A cutter that meets stock in feed cuts; only in rapid it crashes.
      if (body.kind == Kind::Cutter && !milling_.rapid[crashes_[begin] + 1]) continue;
      std::optional<Collision> one = first_contact(body, begin, end);
      if (!one) continue;
      measure(body, begin, end, *one);
      if (!worst || one->depth > worst->depth) worst = std::move(one);
    }
    return worst;
  }

  /// Returns the event for a crash that shows only in the dexels.
  Collision unseen(std::size_t k) const {
    Collision one = event({milling_.at[k], 0.0}, milling_.T_wt[k].translation());
    one.a = milling_.rapid[k + 1] ? "cutter" : "shank";
    return one;
  }

  void add_crash(std::size_t begin, std::size_t end, Collision met) {
    met.b = "stock";
    met.stock = shape_;
    met.rapid = milling_.rapid[crashes_[begin] + 1];
    met.last = end_of_block(crashes_[end - 1] + 1);
    for (std::size_t i = begin; i < end; ++i)
      found.near.push_back(
          {milling_.at[crashes_[i]] + 1, milling_.at[crashes_[i] + 1], met.a, 0.0});
    found.list.push_back(std::move(met));
  }

  const ActualMotion& actual_motion_;
  const cutting::Cutter& cutter_;
  Milling milling_;
  cutting::Stock blank_, stock_;
  std::shared_ptr<const cutting::ClosedMesh> shape_;
  Body mesh_;  // search structure of `shape_`; empty if no stock is left
  bool is_stale_ = false;
  std::optional<double> own_shank_radius_;  // mm; empty: the shank has the radius of the cutter
  std::size_t unseen_ = 0;                  // crashes of the dexels that the bodies do not confirm
  int unseen_line_ = 0;                     // program line of the first of them
  std::vector<WatchedBody> watched_;
  std::vector<ToolBody> tool_;
  std::vector<Pose> now_;             // poses of all carriers in the workpiece
  std::vector<std::size_t> crashes_;  // steps in which the dexels show a crash of cutter or shank
  int open_line_ = 0;
  std::size_t looks_ = 0;
};

}  // namespace

bool has_tracked_stock(const Job& part) {
  return part.scene.cutting && std::holds_alternative<cutting::Cutter>(part.scene.tool.actual);
}

StockCollisions stock_collisions(const ActualMotion& actual_motion,
                                 const std::vector<SolidBody>& bodies,
                                 const std::vector<cutting::BodyPair>& pairs,
                                 const Progress& progress) {
  StockSearch search(actual_motion, bodies, pairs);
  search.run(progress);
  return std::move(search.found);
}

}  // namespace abbe::sim
