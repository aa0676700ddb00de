#include "sim/cut/collisions.h"

#include <algorithm>
#include <cmath>
#include <functional>
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
#include "sim/cut/stock_replay.h"
#include "sim/cut/tool_motion.h"
#include "sim/cut/tool_poses.h"
#include "sim/files/progress.h"

namespace abbe::sim {
namespace {

using cutting::BodyPair;
using cutting::CarrierBody;
using cutting::CarrierMotion;
using cutting::Encounter;
using cutting::segment_end;
using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::AxisVector;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;
using kinematics::Side;

/// Returns an upper bound of the distance from any rotary axis to any point of a body, mm: the
/// distance with all axes at zero, plus the largest positions of the slides.
double reach(const ActualMotion& actual_motion, const std::vector<SolidBody>& bodies) {
  const kinematics::Chain& chain = actual_motion.segment.truth.actual;
  const std::vector<Pose> T = carrier_poses(chain, kinematics::AxisVector::Zero(chain.size()), {});
  double radius = 0.0, slide_travel = 0.0;
  for (const SolidBody& body : bodies) {
    const cutting::ClosedMesh mesh_b =
        cutting::transformed_mesh(body.mesh, T[std::size_t(body.frame)]);
    for (const Joint& joint : chain.joints()) {
      if (joint.motion != Motion::Rotary) continue;
      radius = std::max(
          radius,
          (mesh_b.vertices.rowwise() - joint.point_b.transpose()).rowwise().norm().maxCoeff());
    }
  }
  for (int k = 0; k < chain.size(); ++k) {
    if (chain.joints()[std::size_t(k)].motion != Motion::Linear) continue;
    double max_position = 0.0;
    for (std::size_t i = 0; i < actual_motion.samples.size(); ++i)
      max_position = std::max(max_position, std::abs(actual_motion.samples[i].state.q[k]));
    slide_travel += max_position;
  }
  return radius + slide_travel;
}

/// Returns (samples - 1) the distance, mm, by which a body may leave the straight line between a
/// sample and the next. A curve leaves its chord by at most an eighth of its second derivative,
/// which is turn^2 reach for turns about axes within `reach`; a slide that a rotary axis carries
/// adds twice the product of both displacements.
std::vector<double> chord_heights(const ActualMotion& actual_motion, double reach) {
  const kinematics::Chain& chain = actual_motion.segment.truth.actual;
  std::vector<double> bulge(actual_motion.samples.size() - 1, 0.0);
  for (std::size_t i = 0; i < bulge.size(); ++i) {
    const kinematics::AxisVector step = actual_motion.state(cutting::Moment{i + 1, 0.0}).q -
                                        actual_motion.state(cutting::Moment{i, 0.0}).q;
    double turn = 0.0, slide_travel = 0.0;
    for (int k = 0; k < chain.size(); ++k) {
      const Motion motion = chain.joints()[std::size_t(k)].motion;
      if (motion == Motion::Rotary) turn += std::abs(step[k]);
      if (motion == Motion::Linear) slide_travel += std::abs(step[k]);
    }
    bulge[i] = (turn * turn * reach + 2.0 * turn * slide_travel) / 8.0;
  }
  return bulge;
}

// Returns the motion of all carriers, divided at the ends of blocks.
CarrierMotion carrier_motion(const ActualMotion& actual_motion, double reach) {
  CarrierMotion motion;
  motion.carriers = Carriers{actual_motion.segment.truth.actual.size()}.count();
  motion.instants = actual_motion.samples.size();
  motion.place = [&actual_motion](std::size_t i, double u, std::span<Pose> T) {
    std::ranges::copy(actual_motion.carriers({i, u}), T.begin());
  };
  motion.bulge = chord_heights(actual_motion, reach);
  std::size_t block = 0;
  for (std::size_t i = 0; i < motion.instants; ++i) {
    const std::size_t previous = std::exchange(block, actual_motion.samples[i].block);
    if (i == 0 || block != previous) motion.segments.push_back(i);
  }
  return motion;
}

/// The bodies of the collision search and, behind them, the cores of cutter and shank, with the
/// pairs to be searched.
struct SearchSetup {
  std::vector<CarrierBody> bodies;
  std::vector<BodyPair> pairs;
};

SearchSetup collision_search(const std::vector<SolidBody>& bodies,
                             const std::vector<BodyPair>& pairs) {
  SearchSetup search;
  std::vector<int> core(bodies.size());
  for (const SolidBody& body : bodies) search.bodies.push_back({search_body(body), body.frame});
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    core[i] = int(i);
    if (bodies[i].core.empty()) continue;
    core[i] = int(search.bodies.size());
    search.bodies.push_back({search_core(bodies[i]), bodies[i].frame});
  }
  for (BodyPair pair : pairs) {
    const SolidBody &a = bodies[std::size_t(pair.a)], &b = bodies[std::size_t(pair.b)];
    if (a.kind == SolidBody::Kind::Part || b.kind == SolidBody::Kind::Part) {
      // Cutter and shank are always near the part, so that their clearance to it tells nothing.
      pair.contact_only = !a.core.empty() || !b.core.empty();
      pair.a = core[std::size_t(pair.a)];
      pair.b = core[std::size_t(pair.b)];
    }
    search.pairs.push_back(pair);
  }
  return search;
}

/// Searches a segment and appends the result to that of the job.
class SegmentSearch {
 public:
  SegmentSearch(const Job& job, const ActualMotion& actual_motion, std::size_t number,
                Collisions& result)
      : actual_motion_(actual_motion),
        number_(number),
        result_(result),
        bodies_(segment_bodies(job, actual_motion.segment)),
        pairs_(collision_pairs(actual_motion.segment.truth.actual, bodies_,
                               actual_motion.segment.scene.collision.ignore)),
        search_(collision_search(bodies_, pairs_)),
        motion_(carrier_motion(actual_motion, reach(actual_motion, bodies_))) {}

  /// @param steps   of the segment, if its stock is tracked
  /// @param before  stock at the start of the segment; none: the blank
  /// @return the stock that the segment leaves; none if it is not tracked
  std::optional<cutting::Stock> run(const std::function<MillingSteps()>& steps,
                                    std::optional<cutting::Stock> before,
                                    const Progress& progress) {
    const CollisionDescription& description = actual_motion_.segment.scene.collision;
    cutting::EncounterOptions options;
    options.resolution = description.resolution;
    options.clearance = description.clearance;
    options.progress = [&](double fraction) {
      if (progress) progress("collisions", fraction);
    };
    const cutting::Encounters search_result = check_table_range(actual_motion_.segment, [&] {
      return cutting::encounters(search_.bodies, search_.pairs, motion_, options);
    });
    result_.queries += search_result.queries;
    add_bodies();
    add_clearances(search_result);
    for (const Encounter& encounter : search_result.list) add(encounter);
    if (!has_tracked_stock(actual_motion_.segment)) return {};
    return add_stock(steps(), std::move(before), progress);
  }

 private:
  const SolidBody& body(int i) const { return bodies_[std::size_t(i)]; }

  void add_bodies() {
    for (const SolidBody& solid : bodies_)
      // Machine, fixtures and part are the same for every tool, so they are listed once.
      if (number_ == 0 || solid.kind == SolidBody::Kind::Cutter ||
          solid.kind == SolidBody::Kind::Shank || solid.kind == SolidBody::Kind::Holder)
        result_.bodies.push_back({solid.name, solid.carrier, solid.mesh.triangles.rows()});
    for (std::string& text : body_warnings(actual_motion_.segment, bodies_))
      if (std::ranges::find(result_.warnings, text) == result_.warnings.end())
        result_.warnings.push_back(std::move(text));
  }

  void add_clearances(const cutting::Encounters& encounters) {
    const int pairs_before = int(first_clearance_);
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const cutting::PairClearance& clearance = encounters.pairs[p];
      result_.clearances.push_back({body(pairs_[p].a).name, body(pairs_[p].b).name,
                                    clearance.overlaps_at_start, clearance.distance,
                                    actual_motion_.place(clearance.moment),
                                    clearance.overlaps_at_start     ? ClearanceScope::Never
                                    : search_.pairs[p].contact_only ? ClearanceScope::WhenInContact
                                                                    : ClearanceScope::Always});
    }
    for (std::size_t s = 0; s < encounters.segments.size(); ++s) {
      const cutting::SegmentClearance& clearance = encounters.segments[s];
      const std::size_t first = motion_.segments[s], last = segment_end(motion_, s) - 1;
      ProgramLocation begin = actual_motion_.place({first, 0.0});
      // The interval between two blocks belongs to the second.
      if (first > 0) begin.time_s = actual_motion_.state({first - 1, 0.0}).time_s;
      result_.blocks.push_back({begin, actual_motion_.state({last, 0.0}).time_s,
                                clearance.min_clearance,
                                clearance.pair < 0 ? -1 : pairs_before + clearance.pair});
    }
  }

  std::optional<cutting::Stock> add_stock(MillingSteps steps, std::optional<cutting::Stock> before,
                                          const Progress& progress) {
    const auto begin = std::ptrdiff_t(result_.list.size()) - std::ptrdiff_t(event_count_);
    StockCollisions stock = check_table_range(actual_motion_.segment, [&] {
      return stock_collisions(actual_motion_, bodies_, pairs_, std::move(steps), std::move(before),
                              progress);
    });
    result_.queries += stock.queries;
    std::ranges::move(stock.warnings, std::back_inserter(result_.warnings));
    for (const StockProximity& proximity : stock.near) add_near(proximity, stock.clearances);
    std::ranges::move(stock.clearances, std::back_inserter(result_.clearances));
    for (Collision& event : stock.list) {
      event.part = number_;
      result_.list.push_back(std::move(event));
    }
    // Both groups of collisions of the segment, those with the stock behind the others, are in the
    // order of time already; the sort merges them.
    std::stable_sort(
        result_.list.begin() + begin, result_.list.end(),
        [](const Collision& a, const Collision& b) { return a.first.time_s < b.first.time_s; });
    return std::move(stock.stock);
  }

  /// Lowers the block clearances over the samples of a near miss with the stock.
  /// @param stock_clearances  not yet in the result; they are appended to its clearances
  void add_near(const StockProximity& proximity, const std::vector<Clearance>& stock_clearances) {
    const auto pair = std::ranges::find(stock_clearances, proximity.body, &Clearance::a) -
                      stock_clearances.begin();
    const auto block_of = [&](std::size_t sample) {
      return std::size_t(std::ranges::upper_bound(motion_.segments, sample) -
                         motion_.segments.begin()) -
             1;
    };
    for (std::size_t s = block_of(proximity.first); s <= block_of(proximity.last); ++s)
      lower_clearance(s, proximity.lower_bound, int(result_.clearances.size()) + int(pair));
  }

  /// Lowers the clearance of a block if a pair comes nearer than the previous ones.
  /// @param block_number  in this segment
  /// @param pair          index in the clearances of the result
  void lower_clearance(std::size_t block_number, double min_clearance, int pair) {
    BlockClearance& block = result_.blocks[first_block_ + block_number];
    if (block.pair >= 0 && block.min_clearance <= min_clearance) return;
    block.min_clearance = min_clearance;
    block.pair = pair;
  }

  void add(const Encounter& encounter) {
    const BodyPair pair = pairs_[std::size_t(encounter.pair)];
    Collision event = collision_at(actual_motion_, encounter.moment, encounter.place);
    event.a = body(pair.a).name;
    event.b = body(pair.b).name;
    event.contact = encounter.contact;
    event.first = actual_motion_.place(encounter.begin);
    event.rapid = actual_motion_.is_rapid(encounter.begin);
    event.last = actual_motion_.place({segment_end(motion_, encounter.last_segment) - 1, 0.0});
    event.distance = encounter.distance;
    event.part = number_;
    if (search_.pairs[std::size_t(encounter.pair)].contact_only)
      for (std::size_t s = encounter.first_segment; s <= encounter.last_segment; ++s)
        // The search gives no block clearance for a pair that it searches for contact only.
        lower_clearance(s, 0.0, int(first_clearance_) + encounter.pair);
    if (encounter.contact && contacts(result_) < max_measured_contacts)
      measure_depth(encounter, search_.bodies[std::size_t(pair.a)],
                    search_.bodies[std::size_t(pair.b)], event);
    ++event_count_;
    result_.list.push_back(std::move(event));
  }

  /// Samples the depth of a contact from its first moment to the end of its last block, at most
  /// `samples_per_step` times a step.
  void measure_depth(const Encounter& contact, const CarrierBody& a, const CarrierBody& b,
                     Collision& collision) const {
    constexpr std::size_t divisions = samples_per_step;
    const auto moment = [](std::size_t eighth) {
      return cutting::Moment{eighth / divisions, double(eighth % divisions) / double(divisions)};
    };
    const std::size_t first =
        divisions * contact.moment.instant + std::size_t(double(divisions) * contact.moment.u);
    const std::size_t last = divisions * (segment_end(motion_, contact.last_segment) - 1);
    std::vector<std::size_t> block_ends;
    for (std::size_t s = contact.first_segment; s <= contact.last_segment; ++s)
      block_ends.push_back(divisions * (segment_end(motion_, s) - 1));
    const auto depth_at = [&](std::size_t eighth) {
      const std::vector<Pose> T = actual_motion_.carriers(moment(eighth));
      return cutting::penetration(a.body, T[std::size_t(a.carrier)], b.body,
                                  T[std::size_t(b.carrier)])
          .depth;
    };
    const DeepestSample deepest =
        // `first` exceeds `last` if the contact begins in the last step of its last block.
        deepest_sample(first, std::max(first, last) + 1, block_ends, depth_at);
    collision.depth = deepest.depth;
    collision.depth_samples = deepest.sample_count;
    collision.worst = actual_motion_.place(moment(deepest.moment));
  }

  const ActualMotion& actual_motion_;
  std::size_t number_;
  Collisions& result_;
  std::size_t first_clearance_ = result_.clearances.size(), first_block_ = result_.blocks.size();
  std::size_t event_count_ = 0;  // number of collisions of this segment in the list
  std::vector<SolidBody> bodies_;
  std::vector<BodyPair> pairs_;
  SearchSetup search_;
  CarrierMotion motion_;
};

/// Adds a warning for each pair that overlaps at the start of the program.
void add_overlap_warnings(Collisions& result) {
  for (const Clearance& pair : result.clearances)
    if (pair.overlap_at_start)
      result.warnings.push_back(fmt::format(
          "{} and {} overlap at the start of the program and are not checked: exclude the pair "
          "with [[collision.ignore]] if this is intended, otherwise move one of them",
          pair.a, pair.b));
}

/// Searches the tools of a job one after another.
class JobSearch {
 public:
  JobSearch(const Job& job, const std::string& name, const Progress& progress)
      : job_(job), progress_(progress) {
    result_.commands = name;
    result_.resolution = job.scene.collision.resolution;
    result_.clearance = job.scene.collision.clearance;
    result_.gouge = job.scene.collision.gouge;
  }

  /// Searches a tool, in the order of the program.
  /// @param tool  index in `tool_segments`
  void add(std::size_t tool, const CommandedSamples& samples,
           const std::function<MillingSteps()>& steps) {
    const ActualMotion actual_motion{tool_segments(job_)[tool], samples};
    stock_ =
        SegmentSearch(job_, actual_motion, tool, result_).run(steps, std::move(stock_), progress_);
  }

  Collisions take(std::vector<std::string> subprogram_files, std::string beyond_travel) {
    add_overlap_warnings(result_);
    result_.subprogram_files = std::move(subprogram_files);
    result_.beyond_travel = std::move(beyond_travel);
    result_.seconds = watch_.lap();
    return std::move(result_);
  }

 private:
  const Job& job_;
  const Progress& progress_;
  Stopwatch watch_;
  std::optional<cutting::Stock> stock_;
  Collisions result_;
};

}  // namespace

Collisions collisions(const Job& job, const Commands& commands, const std::string& name,
                      const Progress& progress) {
  JobSearch search(job, name, progress);
  std::string beyond_travel;
  const auto segments = job_segments(job);
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Segment& segment = segments[i];
    const Commands& tool_commands = part_commands(commands, i);
    try {
      // One error is reported, and the search goes on, so that the user sees the collisions too.
      check_travel(segment.machine, path_of(segment, tool_commands), tool_commands.samples);
    } catch (const BadInput& beyond) {
      if (beyond_travel.empty()) beyond_travel = beyond.what();
    }
    search.add(i, {segment, tool_commands},
               [&] { return make_milling_steps(segment, tool_commands); });
  }
  return search.take(path_of(segments.front(), part_commands(commands, 0)).subprogram_files,
                     std::move(beyond_travel));
}

Collisions collisions(const Job& job, const WindowedProgram& program, const std::string& name,
                      const Progress& progress) {
  JobSearch search(job, name, progress);
  const std::vector<WindowRange> ranges = window_ranges(job);
  for (std::size_t i = 0; i < ranges.size(); ++i)
    if (ranges[i].first < ranges[i].last)
      search.add(i, {job, i, program}, [&] { return make_milling_steps(job, i, program); });
  return search.take(program.path.subprogram_files, {});
}

// Quick proximity check for runs without a collision search.

namespace {

/// Two bodies that come near each other.
struct BodyProximity {
  std::string a, b;
  int line = 0;           ///< program line on which they first meet, otherwise are nearest
  double distance = 0.0;  ///< mm, between the bodies on that line
};

/// The pairs of machine, fixtures and tool that come within `collision.clearance_mm` on the
/// error-free machine. The check is for `run` and `compare` without a collision search and takes
/// some milliseconds; it stops before the end of the program if it would take a noticeable fraction
/// of the run. Between samples the axes move linearly, and the displacement of a body is bounded by
/// those of the axes, so that no approach is skipped. The part is left out, since the cut reports
/// contact with it.
struct Proximity {
  std::vector<BodyProximity> near;
  bool is_complete = true;  ///< false if there may be further pairs, as in a job in windows, whose
                            ///< samples are not held
};

/// Returns the largest number of poses to probe in a job. A probe takes about 1 us and a sample of
/// a run 5 us or more, so that the check takes a few per cent of the run at most.
std::size_t max_probes(std::size_t samples) { return 4000 + samples / 10; }
/// Largest number of probes that decide if the bodies of a near pair meet; beyond it the pair is
/// reported as near.
constexpr int max_probes_near = 500;
/// Number of samples in a chunk, whose axis displacements are summed in advance: a distant pair
/// skips a chunk in one step.
constexpr std::size_t samples_per_chunk = 64;

/// A body with its bounding box. The distance between boxes takes a hundredth of the time of that
/// between meshes.
struct BoxedBody {
  std::string name;
  int frame = 0;
  cutting::Body body;
  Vector3d middle = Vector3d::Zero();  ///< centre of the box, mm, in the frame of the carrier
  Vector3d half = Vector3d::Zero();    // half sides of the box, mm
  double radius = 0.0;                 ///< of the sphere around the box, mm
};

BoxedBody boxed(const SolidBody& solid) {
  const Vector3d low = solid.mesh.vertices.colwise().minCoeff();
  const Vector3d high = solid.mesh.vertices.colwise().maxCoeff();
  const Vector3d half = 0.5 * (high - low);
  return {solid.name, solid.frame, search_body(solid), 0.5 * (low + high), half, half.norm()};
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

/// Returns the position of a carrier in the chain from the workpiece to the tool. Joint k is at k,
/// carriers at half numbers between joints. The joints between two carriers move them relative to
/// each other.
double position_in_chain(const kinematics::Chain& chain, int frame) {
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

  struct Point {
    std::size_t sample = 0;
    double fraction = 0.0;
  };
  /// Returns the first point behind `point` at which a body may have moved by `distance` mm, if it
  /// moves by at most `weights` times the displacements of the axes; the end of the motion if it
  /// cannot move that far.
  Point after(Point point, double distance, const AxisVector& weights) const {
    while (point.sample < steps()) {
      const bool is_chunk_start = point.fraction <= 0.0 && point.sample % samples_per_chunk == 0;
      const std::size_t chunk = point.sample / samples_per_chunk;
      if (is_chunk_start && chunk < chunks_.size()) {
        const double displacement = weights.dot(chunks_[chunk]);
        if (displacement <= distance) {
          distance -= displacement;
          point.sample += samples_per_chunk;
          continue;
        }
      }
      const double displacement = weights.dot(step(point.sample));
      const double remaining = (1.0 - point.fraction) * displacement;
      if (remaining > distance) return {point.sample, point.fraction + distance / displacement};
      distance -= remaining;
      point = {point.sample + 1, 0.0};
    }
    return point;
  }

 private:
  AxisVector step(std::size_t i) const {
    AxisVector displacement = (samples_.states[i + 1].q - samples_.states[i].q).cwiseAbs();
    for (int k = 0; k < displacement.size(); ++k) displacement[k] *= is_moved_[std::size_t(k)];
    return displacement;
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
    AxisMotion::Point point;
    std::optional<BodyProximity> near;
    double limit = near_;
    int probes_near = max_probes_near;
    for (bool is_start = true; point.sample < motion_.steps() || is_start; is_start = false) {
      if (is_exhausted() || probes_near == 0) break;
      --probes_left_;
      const double distance = distance_at(a, b, point);
      if (near) --probes_near;
      if (distance <= near_ && (!near || distance < near->distance)) {
        near = {a.name, b.name, motion_.line(point.sample, point.fraction), distance};
        limit = contact_;  // only contact remains to be decided
        if (distance <= contact_) break;
      }
      // The bodies cannot come within the limit before they have moved by the difference. A step of
      // at least half the limit keeps a pair that stays at the limit from stalling the search.
      point = motion_.after(point, std::max(distance - limit, 0.5 * limit), weights);
    }
    return near;
  }

 private:
  double distance_at(const BoxedBody& a, const BoxedBody& b, const AxisMotion::Point& point) const {
    const std::vector<Pose> T =
        carrier_poses(chain_, motion_.position(point.sample, point.fraction), {});
    const Pose &T_a = T[std::size_t(a.frame)], &T_b = T[std::size_t(b.frame)];
    const double bound = box_distance(a, T_a, b, T_b);
    if (bound > 2.0 * near_) return bound;
    // The gap between surfaces does not show that one body is inside the other. The test is needed
    // only at the start, since a body cannot get inside later without contact.
    if (point.sample == 0 && point.fraction <= 0.0 && cutting::is_inside(a.body, T_a, b.body, T_b))
      return 0.0;
    return cutting::gap(a.body, T_a, b.body, T_b).distance;
  }

  /// Returns (axes) upper bounds of the displacement of a point of one body relative to the other,
  /// mm for each mm or rad of an axis.
  AxisVector joint_weights(const BoxedBody& a, const BoxedBody& b) const {
    const double position_a = position_in_chain(chain_, a.frame),
                 position_b = position_in_chain(chain_, b.frame);
    AxisVector weights = AxisVector::Zero(chain_.size());
    for (int k = 0; k < chain_.size(); ++k) {
      if (!(k > std::min(position_a, position_b) && k < std::max(position_a, position_b))) continue;
      const Motion motion = chain_.joints()[std::size_t(k)].motion;
      if (motion == Motion::Linear) weights[k] = 1.0;
      // A turn may be seen as moving either body, so the one with the shorter arm gives the bound.
      if (motion == Motion::Rotary)
        weights[k] = std::min(arm(k, a, position_a), arm(k, b, position_b));
    }
    return weights;
  }

  /// Returns an upper bound of the distance from the axis of a joint to the farthest point of a
  /// body, mm, for all positions of the joints between both.
  /// @param position  of the body in the chain
  double arm(int joint, const BoxedBody& body, double position) const {
    const int step = position > joint ? 1 : -1;
    Vector3d point = chain_.joints()[std::size_t(joint)].point_b;
    double sum = 0.0;
    for (int k = joint + step; step > 0 ? k < position : k > position; k += step) {
      const Joint& inner_joint = chain_.joints()[std::size_t(k)];
      if (inner_joint.motion == Motion::Linear) sum += motion_.farthest()[k];
      if (inner_joint.motion != Motion::Rotary) continue;
      sum += (inner_joint.point_b - point).norm();
      point = inner_joint.point_b;
    }
    return sum + (zero_[std::size_t(body.frame)] * body.middle - point).norm() + body.radius;
  }

  const kinematics::Chain& chain_;
  const AxisMotion& motion_;
  double near_, contact_;  // mm
  std::vector<Pose> zero_;
  std::size_t probes_left_;
};

std::string pair_text(const BodyProximity& pair) { return pair.a + " and " + pair.b; }

constexpr std::string_view not_searched = "this command does not check collisions";

/// Returns the pairs of one segment that come near.
Proximity near_bodies_in(const Segment& segment) {
  Proximity proximity;
  if (segment.samples.states.empty()) return proximity;
  // Without machine bodies and fixtures only the tool is left, which cannot meet itself.
  std::vector<SolidBody> solids = machine_bodies(segment.scene.machine);
  std::ranges::move(fixture_bodies(segment.scene), std::back_inserter(solids));
  if (solids.empty()) return proximity;
  std::ranges::move(tool_bodies(segment, 0.0), std::back_inserter(solids));
  std::vector<BoxedBody> bodies;
  for (const SolidBody& solid : solids) bodies.push_back(boxed(solid));
  const AxisMotion motion(segment.machine, segment.samples);
  NearSearch search(segment.scene, segment.machine, motion);
  for (const BodyPair& pair :
       collision_pairs(segment.machine.nominal, solids, segment.scene.collision.ignore))
    if (auto near = search.first_near(bodies[std::size_t(pair.a)], bodies[std::size_t(pair.b)]))
      proximity.near.push_back(std::move(*near));
  proximity.is_complete = !search.is_exhausted();
  std::ranges::stable_sort(proximity.near, {}, &BodyProximity::line);
  return proximity;
}

/// Finds the bodies of a job that come near each other.
Proximity find_near_bodies(const Job& job) {
  Proximity result;
  result.is_complete = !job.windows;
  if (job.windows) return result;
  // A pair is listed once, for the first tool with which it is near.
  for (const Segment& segment : job_segments(job)) {
    Proximity proximity = near_bodies_in(segment);
    result.is_complete = result.is_complete && proximity.is_complete;
    for (BodyProximity& pair : proximity.near)
      if (std::ranges::none_of(result.near, [&](const BodyProximity& listed) {
            return listed.a == pair.a && listed.b == pair.b;
          }))
        result.near.push_back(std::move(pair));
  }
  return result;
}

}  // namespace

std::string proximity_warning(const Job& job) {
  if (job.scene.collision.is_enabled) return {};
  const Proximity proximity = find_near_bodies(job);
  const std::vector<BodyProximity>& near = proximity.near;
  if (near.empty() && proximity.is_complete) return {};
  constexpr std::string_view advice = "run `abbe check --collisions`";
  if (near.empty())
    return fmt::format("{}, and the program is too long for a quick check: {}", not_searched,
                       advice);
  const auto touches = [&](const BodyProximity& pair) {
    return pair.distance <= job.scene.collision.resolution;
  };
  const auto contact = std::ranges::find_if(near, touches);
  const BodyProximity& first = contact == near.end() ? near.front() : *contact;
  const std::string what = touches(first)
                               ? fmt::format("{} collide on line {}", pair_text(first), first.line)
                               : fmt::format("{} come within {:.3g} mm of each other on line {}",
                                             pair_text(first), first.distance, first.line);
  const std::string others_text = near.size() > 1
                                      ? fmt::format(", and {} other {} near", near.size() - 1,
                                                    near.size() == 2 ? "pair is" : "pairs are")
                                      : "";
  return fmt::format("{}, but {}{}: {}", not_searched, what, others_text, advice);
}

}  // namespace abbe::sim
