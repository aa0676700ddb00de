#include "sim/cut/collisions.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "cutting/stock/collision.h"
#include "cutting/stock/encounters.h"
#include "cutting/stock/separation.h"
#include "kinematics/units.h"
#include "sim/cut/bodies.h"
#include "sim/cut/collision_events.h"
#include "sim/cut/resources.h"
#include "sim/cut/stock_replay.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/tool_poses.h"

namespace abbe::sim {
namespace {

using cutting::BodyPair;
using cutting::CarrierBody;
using cutting::CarrierMotion;
using cutting::Encounter;
using cutting::end_of;
using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;

/// Returns an upper bound of the distance from any rotary axis to any point of a body, mm. Slides
/// may add their largest positions to the distance at zero.
double reach(const ActualMotion& actual_motion, const std::vector<SolidBody>& bodies) {
  const kinematics::Chain& chain = actual_motion.part.truth.actual;
  const std::vector<Pose> T = carrier_poses(chain, kinematics::AxisVector::Zero(chain.size()), {});
  double turning = 0.0, sliding = 0.0;
  for (const SolidBody& body : bodies) {
    const cutting::ClosedMesh placed = cutting::moved(body.mesh, T[std::size_t(body.frame)]);
    for (const Joint& joint : chain.joints()) {
      if (joint.motion != Motion::Rotary) continue;
      turning = std::max(
          turning,
          (placed.vertices.rowwise() - joint.point_b.transpose()).rowwise().norm().maxCoeff());
    }
  }
  for (int k = 0; k < chain.size(); ++k) {
    if (chain.joints()[std::size_t(k)].motion != Motion::Linear) continue;
    double most = 0.0;
    for (const AxisState& state : actual_motion.samples.states)
      most = std::max(most, std::abs(state.q[k]));
    sliding += most;
  }
  return turning + sliding;
}

/// Returns for each pair of neighbouring samples the distance, mm, by which a body may leave the
/// straight line between them. The deviation of a chord is at most an eighth of the second
/// derivative; for turns about axes within `reach` it is turn^2 reach, and a slide carried by a
/// turn adds twice their product.
std::vector<double> bulges(const ActualMotion& actual_motion, double reach) {
  const kinematics::Chain& chain = actual_motion.part.truth.actual;
  std::vector<double> bulge(actual_motion.samples.states.size() - 1, 0.0);
  for (std::size_t i = 0; i < bulge.size(); ++i) {
    const kinematics::AxisVector step = actual_motion.state(cutting::Moment{i + 1, 0.0}).q -
                                        actual_motion.state(cutting::Moment{i, 0.0}).q;
    double turn = 0.0, way = 0.0;
    for (int k = 0; k < chain.size(); ++k) {
      const Motion motion = chain.joints()[std::size_t(k)].motion;
      if (motion == Motion::Rotary) turn += std::abs(step[k]);
      if (motion == Motion::Linear) way += std::abs(step[k]);
    }
    bulge[i] = (turn * turn * reach + 2.0 * turn * way) / 8.0;
  }
  return bulge;
}

// Returns the motion of all carriers, divided at the ends of blocks.
CarrierMotion motion_of(const ActualMotion& actual_motion, double reach) {
  CarrierMotion motion;
  motion.carriers = Carriers{actual_motion.part.truth.actual.size()}.count();
  motion.instants = actual_motion.samples.states.size();
  motion.place = [&actual_motion](std::size_t i, double u, std::span<Pose> T) {
    std::ranges::copy(actual_motion.carriers({i, u}), T.begin());
  };
  motion.bulge = bulges(actual_motion, reach);
  for (std::size_t i = 0; i < motion.instants; ++i)
    if (i == 0 || actual_motion.samples.block[i] != actual_motion.samples.block[i - 1])
      motion.stretches.push_back(i);
  return motion;
}

/// The bodies of the collision search and, behind them, the cores of cutter and shank, with the
/// pairs to be searched.
struct Search {
  std::vector<CarrierBody> bodies;
  std::vector<BodyPair> pairs;
};

Search collision_search(const std::vector<SolidBody>& bodies, const std::vector<BodyPair>& pairs) {
  Search search;
  std::vector<int> core(bodies.size());
  for (const SolidBody& body : bodies) search.bodies.push_back({searched(body), body.frame});
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    core[i] = int(i);
    if (bodies[i].core.empty()) continue;
    core[i] = int(search.bodies.size());
    search.bodies.push_back({search_core(bodies[i]), bodies[i].frame});
  }
  for (BodyPair pair : pairs) {
    const SolidBody &a = bodies[std::size_t(pair.a)], &b = bodies[std::size_t(pair.b)];
    if (a.kind == SolidBody::Kind::Part || b.kind == SolidBody::Kind::Part) {
      // cutter and shank are always near the part, so their clearance to it says nothing
      pair.contact_only = !a.core.empty() || !b.core.empty();
      pair.a = core[std::size_t(pair.a)];
      pair.b = core[std::size_t(pair.b)];
    }
    search.pairs.push_back(pair);
  }
  return search;
}

/// Searches a part of a job and appends the result to that of the job.
class PartSearch {
 public:
  PartSearch(const ActualMotion& actual_motion, std::size_t number, Collisions& all)
      : actual_motion_(actual_motion),
        number_(number),
        all_(all),
        bodies_(job_bodies(actual_motion.part)),
        pairs_(pairs_of(actual_motion.part.truth.actual, bodies_,
                        actual_motion.part.scene.collision.ignore)),
        search_(collision_search(bodies_, pairs_)),
        motion_(motion_of(actual_motion, reach(actual_motion, bodies_))) {}

  void run(const Progress& progress) {
    const CollisionDescription& asked = actual_motion_.part.scene.collision;
    cutting::EncounterOptions options;
    options.resolution = asked.resolution;
    options.clearance = asked.clearance;
    options.progress = [&](double share) {
      if (progress) progress("collisions", share);
    };
    const cutting::Encounters found = check_table_range(actual_motion_.part, [&] {
      return cutting::encounters(search_.bodies, search_.pairs, motion_, options);
    });
    all_.queries += found.queries;
    add_bodies();
    add_clearances(found);
    for (const Encounter& one : found.list) add(one);
    if (has_tracked_stock(actual_motion_.part)) add_stock(progress);
  }

 private:
  const SolidBody& body(int i) const { return bodies_[std::size_t(i)]; }

  void add_bodies() {
    for (const SolidBody& one : bodies_)
      // machine, fixtures and part are the same for every tool and listed once
      if (number_ == 0 || one.kind == SolidBody::Kind::Cutter ||
          one.kind == SolidBody::Kind::Shank || one.kind == SolidBody::Kind::Holder)
        all_.bodies.push_back({one.name, one.carrier, one.mesh.triangles.rows()});
    for (std::string& text : body_warnings(actual_motion_.part, bodies_))
      if (std::ranges::find(all_.warnings, text) == all_.warnings.end())
        all_.warnings.push_back(std::move(text));
  }

  void add_clearances(const cutting::Encounters& found) {
    const int before = int(first_clearance_);
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const cutting::PairClearance& one = found.pairs[p];
      all_.clearances.push_back({body(pairs_[p].a).name, body(pairs_[p].b).name,
                                 one.overlaps_at_start, one.distance,
                                 actual_motion_.place(one.moment),
                                 one.overlaps_at_start           ? ClearanceScope::Never
                                 : search_.pairs[p].contact_only ? ClearanceScope::WhenInContact
                                                                 : ClearanceScope::Always});
    }
    for (std::size_t s = 0; s < found.stretches.size(); ++s) {
      const cutting::SegmentClearance& one = found.stretches[s];
      const std::size_t first = motion_.stretches[s], last = end_of(motion_, s) - 1;
      ProgramLocation begin = actual_motion_.place({first, 0.0});
      // the interval between two blocks belongs to the second
      if (first > 0) begin.time_s = actual_motion_.state({first - 1, 0.0}).time_s;
      all_.blocks.push_back({begin, actual_motion_.state({last, 0.0}).time_s, one.at_least,
                             one.pair < 0 ? -1 : before + one.pair});
    }
  }

  void add_stock(const Progress& progress) {
    const auto begin = std::ptrdiff_t(all_.list.size()) - std::ptrdiff_t(listed_);
    StockCollisions found = check_table_range(actual_motion_.part, [&] {
      return stock_collisions(actual_motion_, bodies_, pairs_, progress);
    });
    all_.queries += found.queries;
    for (std::string& text : found.warnings) all_.warnings.push_back(std::move(text));
    for (const StockProximity& one : found.near) add_near(one, found.clearances);
    for (Clearance& one : found.clearances) all_.clearances.push_back(std::move(one));
    for (Collision& one : found.list) {
      one.part = number_;
      all_.list.push_back(std::move(one));
    }
    // collisions with the stock are found after the others of the part; both are in the order of
    // time
    std::stable_sort(
        all_.list.begin() + begin, all_.list.end(),
        [](const Collision& a, const Collision& b) { return a.first.time_s < b.first.time_s; });
  }

  /// Lowers the block clearances over the samples of a near miss with the stock.
  /// @param own  clearances of the stock, which are appended after the present ones
  void add_near(const StockProximity& near, const std::vector<Clearance>& own) {
    const auto pair = std::ranges::find(own, near.body, &Clearance::a) - own.begin();
    const auto block_of = [&](std::size_t sample) {
      return std::size_t(std::ranges::upper_bound(motion_.stretches, sample) -
                         motion_.stretches.begin()) -
             1;
    };
    for (std::size_t s = block_of(near.first); s <= block_of(near.last); ++s)
      lower(s, near.at_least, int(all_.clearances.size()) + int(pair));
  }

  /// Lowers the clearance of a block if the pair comes nearer than those before.
  /// @param stretch  block of this part
  /// @param pair     index in all clearances
  void lower(std::size_t stretch, double at_least, int pair) {
    BlockClearance& block = all_.blocks[first_block_ + stretch];
    if (block.pair >= 0 && block.at_least <= at_least) return;
    block.at_least = at_least;
    block.pair = pair;
  }

  void add(const Encounter& found) {
    const BodyPair pair = pairs_[std::size_t(found.pair)];
    Collision one = collision_at(actual_motion_, found.moment, found.place);
    one.a = body(pair.a).name;
    one.b = body(pair.b).name;
    one.contact = found.contact;
    one.first = actual_motion_.place(found.begin);
    one.rapid = actual_motion_.is_rapid(found.begin);
    one.last = actual_motion_.place({end_of(motion_, found.last_segment) - 1, 0.0});
    one.distance = found.distance;
    one.part = number_;
    if (search_.pairs[std::size_t(found.pair)].contact_only)
      for (std::size_t s = found.first_segment; s <= found.last_segment; ++s)
        // Pairs that are searched for contact only have no clearance of their own in a block; a
        // contact gives them 0.
        lower(s, 0.0, int(first_clearance_) + found.pair);
    if (found.contact && contacts(all_) < max_measured_contacts)
      measure_depth(found, search_.bodies[std::size_t(pair.a)], search_.bodies[std::size_t(pair.b)],
                    one);
    ++listed_;
    all_.list.push_back(std::move(one));
  }

  /// Samples the depth of a contact from its first moment to the end of its last block, in eighths
  /// of a step.
  void measure_depth(const Encounter& found, const CarrierBody& a, const CarrierBody& b,
                     Collision& collision) const {
    constexpr std::size_t n = samples_per_step;
    const auto moment = [](std::size_t look) {
      return cutting::Moment{look / n, double(look % n) / double(n)};
    };
    const std::size_t first = n * found.moment.instant + std::size_t(double(n) * found.moment.u);
    const std::size_t last = n * (end_of(motion_, found.last_segment) - 1);
    std::vector<std::size_t> block_ends;
    for (std::size_t s = found.first_segment; s <= found.last_segment; ++s)
      block_ends.push_back(n * (end_of(motion_, s) - 1));
    const auto depth_at = [&](std::size_t look) {
      const std::vector<Pose> T = actual_motion_.carriers(moment(look));
      return cutting::way_out(a.body, T[std::size_t(a.carrier)], b.body, T[std::size_t(b.carrier)])
          .depth;
    };
    const DeepestSample deepest =
        // a contact that begins in the last step of its last block leaves `first` behind `last`
        deepest_sample(first, std::max(first, last) + 1, block_ends, depth_at);
    collision.depth = deepest.depth;
    collision.depths = deepest.looks;
    collision.worst = actual_motion_.place(moment(deepest.at));
  }

  const ActualMotion& actual_motion_;
  std::size_t number_;
  Collisions& all_;
  std::size_t first_clearance_ = all_.clearances.size(), first_block_ = all_.blocks.size();
  std::size_t listed_ = 0;  // number of collisions of this part in the list
  std::vector<SolidBody> bodies_;
  std::vector<BodyPair> pairs_;
  Search search_;
  CarrierMotion motion_;
};

/// Adds a warning for each pair that overlaps at the start of the program.
void add_overlap_warnings(Collisions& all) {
  for (const Clearance& one : all.clearances)
    if (one.overlap_at_start)
      all.warnings.push_back(fmt::format(
          "{} and {} overlap where the program begins and are not looked at: leave the pair out by "
          "[[collision.ignore]] if that is meant, else move one of them",
          one.a, one.b));
}

}  // namespace

Collisions collisions(const Job& job, const Commands& commands, const std::string& name,
                      const Progress& progress) {
  Stopwatch watch;
  Collisions all;
  all.commands = name;
  all.resolution = job.scene.collision.resolution;
  all.clearance = job.scene.collision.clearance;
  all.gouge = job.scene.collision.gouge;
  const auto parts = parts_of(job);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const ActualMotion actual_motion{parts[i], of_part(commands, i)};
    if (i == 0) all.more_files = actual_motion.path.more_files;
    try {
      // One error message is enough; the search goes on, so that it also reports the collisions.
      check_travel(parts[i].machine, actual_motion.path, actual_motion.samples);
    } catch (const BadInput& beyond) {
      if (all.beyond_travel.empty()) all.beyond_travel = beyond.what();
    }
    PartSearch(actual_motion, i, all).run(progress);
  }
  add_overlap_warnings(all);
  all.seconds = watch.lap();
  return all;
}

// Quick proximity check for runs without a collision search.

namespace {

/// Returns the largest number of probed poses of a job. A probe takes about 1 us, a sample of a run
/// 5 us or more, so the check stays below a few per cent of the run.
std::size_t max_probes(std::size_t samples) { return 4000 + samples / 10; }
/// Number of probes of a pair that is already near; after them it is left undecided whether the
/// bodies meet.
constexpr int max_probes_near = 500;
/// Number of samples whose axis displacements are summed in advance, so that a distant pair skips
/// them in one step.
constexpr std::size_t samples_per_chunk = 64;

/// A body with its bounding box. A distance between boxes takes a hundredth of the time of one
/// between meshes.
struct BoxedBody {
  std::string name;
  int frame = 0;
  cutting::Body body;
  Vector3d middle = Vector3d::Zero();  ///< centre of the box, mm, in the frame of the carrier
  Vector3d half = Vector3d::Zero();    // half sides of the box, mm
  double radius = 0.0;                 ///< of the ball around the box, mm
};

BoxedBody boxed(const SolidBody& solid) {
  const Vector3d low = solid.mesh.vertices.colwise().minCoeff();
  const Vector3d high = solid.mesh.vertices.colwise().maxCoeff();
  const Vector3d half = 0.5 * (high - low);
  return {solid.name, solid.frame, searched(solid), 0.5 * (low + high), half, half.norm()};
}

/// Returns a lower bound of the distance between two boxes, mm: the widest gap along their sides
/// and along the line between their centres.
double box_distance(const BoxedBody& a, const Pose& T_a, const BoxedBody& b, const Pose& T_b) {
  const Vector3d between = T_b * b.middle - T_a * a.middle;
  const Eigen::Matrix3d A = T_a.linear(), B = T_b.linear();
  const Vector3d in_a = A.transpose() * between, in_b = B.transpose() * between;
  const Eigen::Matrix3d turn = (A.transpose() * B).cwiseAbs();
  const double along_a = (in_a.cwiseAbs() - a.half - turn * b.half).maxCoeff();
  const double along_b = (in_b.cwiseAbs() - b.half - turn.transpose() * a.half).maxCoeff();
  const double along_line = between.norm() - a.radius - b.radius;
  return std::max({along_a, along_b, along_line});
}

/// Returns the position of a carrier in the row of joints from the workpiece to the tool. Half
/// numbers lie between joints; the joints between two carriers move them relative to each other.
double place_in_row(const kinematics::Chain& chain, int frame) {
  const Carriers carriers{chain.size()};
  double bed = -0.5;
  for (const Joint& joint : chain.joints()) bed += joint.side == Side::Workpiece;
  if (frame == Carriers::bed) return bed;
  if (frame == carriers.workpiece()) return -0.5;
  if (frame == carriers.tool()) return chain.size() - 0.5;
  const int joint = frame - carriers.carriage(0);
  const bool of_workpiece = chain.joints()[std::size_t(joint)].side == Side::Workpiece;
  return joint + (of_workpiece ? -0.5 : 0.5);
}

/// The axis positions of a segment of a program, with spindles at rest.
class AxisMotion {
 public:
  AxisMotion(const Machine& machine, const program::Samples& samples) : samples_(samples) {
    const int axes = machine.nominal.size();
    for (int k = 0; k < axes; ++k) is_moved_.push_back(is_spindle(machine, k) ? 0.0 : 1.0);
    farthest_ = position(0).cwiseAbs();
    const std::size_t steps = samples.states.size() - 1;
    chunks_.resize(steps / samples_per_chunk, AxisVector::Zero(axes));
    for (std::size_t i = 0; i < steps; ++i) {
      farthest_ = farthest_.cwiseMax(position(i + 1).cwiseAbs());
      const std::size_t chunk = i / samples_per_chunk;
      if (chunk < chunks_.size()) chunks_[chunk] += step(i);
    }
  }

  std::size_t steps() const { return samples_.states.size() - 1; }
  /// Returns the positions between a sample and the next, spindles at zero.
  /// @param fraction  of the distance to the next sample
  AxisVector position(std::size_t sample, double fraction = 0.0) const {
    AxisVector q = samples_.states[sample].q;
    if (fraction > 0.0) q += fraction * (samples_.states[sample + 1].q - q);
    for (int k = 0; k < q.size(); ++k) q[k] *= is_moved_[std::size_t(k)];
    return q;
  }
  const AxisVector& farthest() const { return farthest_; }
  int line(std::size_t sample, double fraction) const {
    return samples_.line[sample + (fraction > 0.0 ? 1 : 0)];
  }

  struct At {
    std::size_t sample = 0;
    double fraction = 0.0;
  };
  /// Returns the point of the motion up to which a body has moved by `room` mm, if it moves by at
  /// most `weights` times the displacements of the axes; the end of the motion if it moves less.
  At after(At at, double room, const AxisVector& weights) const {
    while (at.sample < steps()) {
      const bool begins = at.fraction <= 0.0 && at.sample % samples_per_chunk == 0;
      const std::size_t chunk = at.sample / samples_per_chunk;
      if (begins && chunk < chunks_.size()) {
        const double way = weights.dot(chunks_[chunk]);
        if (way <= room) {
          room -= way;
          at.sample += samples_per_chunk;
          continue;
        }
      }
      const double way = weights.dot(step(at.sample));
      const double left = (1.0 - at.fraction) * way;
      if (left > room) return {at.sample, at.fraction + room / way};
      room -= left;
      at = {at.sample + 1, 0.0};
    }
    return at;
  }

 private:
  AxisVector step(std::size_t i) const {
    AxisVector way = (samples_.states[i + 1].q - samples_.states[i].q).cwiseAbs();
    for (int k = 0; k < way.size(); ++k) way[k] *= is_moved_[std::size_t(k)];
    return way;
  }

  const program::Samples& samples_;
  std::vector<double> is_moved_;  // 0 for spindles, else 1
  AxisVector farthest_;
  std::vector<AxisVector> chunks_;
};

/// Finds the first point of a motion at which the two bodies of a pair are near.
class NearSearch {
 public:
  NearSearch(const Scene& scene, const Machine& machine, const AxisMotion& motion)
      : chain_(machine.nominal),
        motion_(motion),
        near_(std::max(scene.collision.clearance, scene.collision.resolution)),
        contact_(scene.collision.resolution),
        zero_(carrier_poses(chain_, AxisVector::Zero(chain_.size()), {})),
        probes_left_(max_probes(motion.steps())) {}

  bool is_exhausted() const { return probes_left_ == 0; }

  std::optional<BodyProximity> first_near(const BoxedBody& a, const BoxedBody& b) {
    const AxisVector weights = joint_weights(a, b);
    AxisMotion::At at;
    std::optional<BodyProximity> near;
    double wanted = near_;
    int probes_near = max_probes_near;
    for (bool starts = true; at.sample < motion_.steps() || starts; starts = false) {
      if (is_exhausted() || probes_near == 0) break;
      --probes_left_;
      const double distance = distance_at(a, b, at);
      if (near) --probes_near;
      if (distance <= near_ && (!near || distance < near->distance)) {
        near = {a.name, b.name, motion_.line(at.sample, at.fraction), distance};
        wanted = contact_;  // the bodies are near: from now on the search only decides whether they
                            // meet
        if (distance <= contact_) break;
      }
      // The bodies cannot meet before they have moved by their distance. Half of the limit is the
      // least step, so that a pair at the limit does not stop the search.
      at = motion_.after(at, std::max(distance - wanted, 0.5 * wanted), weights);
    }
    return near;
  }

 private:
  double distance_at(const BoxedBody& a, const BoxedBody& b, const AxisMotion::At& at) const {
    const std::vector<Pose> T = carrier_poses(chain_, motion_.position(at.sample, at.fraction), {});
    const Pose &T_a = T[std::size_t(a.frame)], &T_b = T[std::size_t(b.frame)];
    const double bound = box_distance(a, T_a, b, T_b);
    if (bound > 2.0 * near_) return bound;
    // Bodies have only surfaces: one inside the other shows only by a test, needed once, since a
    // body cannot get inside later without contact.
    if (at.sample == 0 && at.fraction <= 0.0 && cutting::is_inside(a.body, T_a, b.body, T_b))
      return 0.0;
    return cutting::gap(a.body, T_a, b.body, T_b).distance;
  }

  /// Returns (axes) upper bounds of the displacement of a point of one body relative to the other,
  /// mm for each mm or rad of an axis.
  AxisVector joint_weights(const BoxedBody& a, const BoxedBody& b) const {
    const double from = place_in_row(chain_, a.frame), to = place_in_row(chain_, b.frame);
    AxisVector weights = AxisVector::Zero(chain_.size());
    for (int k = 0; k < chain_.size(); ++k) {
      if (!(k > std::min(from, to) && k < std::max(from, to))) continue;
      const Motion motion = chain_.joints()[std::size_t(k)].motion;
      if (motion == Motion::Linear) weights[k] = 1.0;
      // The distance is the same in the frame of either body, so the body with the shorter arm
      // gives the bound of a turn.
      if (motion == Motion::Rotary) weights[k] = std::min(arm(k, a, from), arm(k, b, to));
    }
    return weights;
  }

  /// Returns an upper bound of the distance from the axis of a joint to the farthest point of a
  /// body, mm, for all positions of the axes between them.
  double arm(int joint, const BoxedBody& body, double place) const {
    const int step = place > joint ? 1 : -1;
    Vector3d at = chain_.joints()[std::size_t(joint)].point_b;
    double sum = 0.0;
    for (int k = joint + step; step > 0 ? k < place : k > place; k += step) {
      const Joint& next = chain_.joints()[std::size_t(k)];
      if (next.motion == Motion::Linear) sum += motion_.farthest()[k];
      if (next.motion != Motion::Rotary) continue;
      sum += (next.point_b - at).norm();
      at = next.point_b;
    }
    return sum + (zero_[std::size_t(body.frame)] * body.middle - at).norm() + body.radius;
  }

  const kinematics::Chain& chain_;
  const AxisMotion& motion_;
  double near_, contact_;  // mm
  std::vector<Pose> zero_;
  std::size_t probes_left_;
};

std::string pair_text(const BodyProximity& pair) { return pair.a + " and " + pair.b; }

constexpr std::string_view not_searched = "collisions are not searched here";

/// Returns the pairs of one part of a job that come near, each with its first location.
Proximity near_bodies_in(const Job& part) {
  Proximity found;
  if (part.samples.states.empty()) return found;
  // Without machine bodies and fixtures only the tool is left, which cannot meet itself.
  std::vector<SolidBody> solids = machine_bodies(part.scene.machine);
  std::ranges::move(fixture_bodies(part.scene), std::back_inserter(solids));
  if (solids.empty()) return found;
  std::ranges::move(tool_bodies(part, 0.0), std::back_inserter(solids));
  std::vector<BoxedBody> bodies;
  for (const SolidBody& solid : solids) bodies.push_back(boxed(solid));
  const AxisMotion motion(part.machine, part.samples);
  NearSearch search(part.scene, part.machine, motion);
  for (const BodyPair& pair : pairs_of(part.machine.nominal, solids, part.scene.collision.ignore))
    if (auto near = search.first_near(bodies[std::size_t(pair.a)], bodies[std::size_t(pair.b)]))
      found.near.push_back(std::move(*near));
  found.is_complete = !search.is_exhausted();
  std::ranges::stable_sort(found.near, {}, &BodyProximity::line);
  return found;
}

}  // namespace

Proximity find_near_bodies(const Job& job) {
  Proximity all;
  all.is_complete = !job.windows;
  if (job.windows) return all;
  // A pair is listed once, with the first tool that brings it near.
  for (const Job& part : parts_of(job)) {
    Proximity found = near_bodies_in(part);
    all.is_complete = all.is_complete && found.is_complete;
    for (BodyProximity& next : found.near)
      if (std::ranges::none_of(all.near, [&](const BodyProximity& had) {
            return had.a == next.a && had.b == next.b;
          }))
        all.near.push_back(std::move(next));
  }
  return all;
}

std::string not_searched_text(const Job& job) {
  if (job.scene.collision.on) return {};  // a run with collisions on searches them itself
  const Proximity found = find_near_bodies(job);
  const std::vector<BodyProximity>& near = found.near;
  if (near.empty() && found.is_complete) return {};
  constexpr std::string_view advice = "`abbe check --collisions` searches them";
  if (near.empty())
    return fmt::format("{}, and the program is too long for a quick check: {}", not_searched,
                       advice);
  const auto touches = [&](const BodyProximity& pair) {
    return pair.distance <= job.scene.collision.resolution;
  };
  const auto met = std::ranges::find_if(near, touches);
  const BodyProximity& first = met == near.end() ? near.front() : *met;
  const std::string what = touches(first)
                               ? fmt::format("{} meet on line {}", pair_text(first), first.line)
                               : fmt::format("{} come within {:.3g} mm of each other on line {}",
                                             pair_text(first), first.distance, first.line);
  const std::string others = near.size() > 1
                                 ? fmt::format(", and {} other {} near", near.size() - 1,
                                               near.size() == 2 ? "pair comes" : "pairs come")
                                 : "";
  return fmt::format("{}, but {}{}: {}", not_searched, what, others, advice);
}

}  // namespace abbe::sim
