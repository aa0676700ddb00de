#include "sim/cut/collisions.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cutting/encounters.h"
#include "cutting/way_out.h"
#include "sim/cut/bodies.h"
#include "sim/cut/depth_looks.h"
#include "sim/cut/following.h"
#include "sim/cut/inside_tables.h"
#include "sim/cut/stock_collisions.h"
#include "sim/cut/stopwatch.h"
#include "sim/cut/travel.h"

namespace abbe::sim {
namespace {

using cutting::BodyPair;
using cutting::CarriedBody;
using cutting::CarriedMotion;
using cutting::Encounter;
using cutting::end_of;
using Eigen::Vector3d;
using kinematics::AxisState;
using kinematics::Joint;
using kinematics::Motion;
using kinematics::Pose;

/// mm from any axis that turns to any point of a body, at most.
double reach(const Following& following, const std::vector<SolidBody>& bodies) {
  const kinematics::Chain& chain = following.part.truth.actual;
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
    for (const AxisState& state : following.samples.states)
      most = std::max(most, std::abs(state.q[k]));
    sliding += most;
  }
  return turning + sliding;
}

/// mm between two samples, by which a body may leave its straight way: an eighth of the second
/// derivative of a chain of turns and slides.
std::vector<double> bulges(const Following& following, double reach) {
  const kinematics::Chain& chain = following.part.truth.actual;
  std::vector<double> bulge(following.samples.states.size() - 1, 0.0);
  for (std::size_t i = 0; i < bulge.size(); ++i) {
    const kinematics::AxisVector step =
        following.state(cutting::Moment{i + 1, 0.0}).q - following.state(cutting::Moment{i, 0.0}).q;
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

CarriedMotion motion_of(const Following& following, double reach) {
  CarriedMotion motion;
  motion.carriers = Carriers{following.part.truth.actual.size()}.count();
  motion.instants = following.samples.states.size();
  motion.place = [&following](std::size_t i, double u, std::span<Pose> T) {
    std::ranges::copy(following.carriers({i, u}), T.begin());
  };
  motion.bulge = bulges(following, reach);
  for (std::size_t i = 0; i < motion.instants; ++i)
    if (i == 0 || following.samples.block[i] != following.samples.block[i - 1])
      motion.stretches.push_back(i);
  return motion;
}

/// What is searched: the bodies, and those of the tool that meet the part without their skin.
struct Search {
  std::vector<CarriedBody> bodies;
  std::vector<BodyPair> pairs;
};

Search search_of(const std::vector<SolidBody>& bodies, const std::vector<BodyPair>& pairs) {
  Search search;
  std::vector<int> core(bodies.size());
  for (const SolidBody& body : bodies) search.bodies.push_back({searched(body), body.frame});
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    core[i] = int(i);
    if (bodies[i].core.empty()) continue;
    core[i] = int(search.bodies.size());
    search.bodies.push_back({searched_core(bodies[i]), bodies[i].frame});
  }
  for (BodyPair pair : pairs) {
    const SolidBody &a = bodies[std::size_t(pair.a)], &b = bodies[std::size_t(pair.b)];
    if (a.kind == SolidBody::Kind::Part || b.kind == SolidBody::Kind::Part) {
      // the cutter is always near the part
      pair.contact_only = !a.core.empty() || !b.core.empty();
      pair.a = core[std::size_t(pair.a)];
      pair.b = core[std::size_t(pair.b)];
    }
    search.pairs.push_back(pair);
  }
  return search;
}

/// Appends what is found in a part of a job.
class PartSearch {
 public:
  PartSearch(const Following& following, std::size_t number, Collisions& all)
      : following_(following),
        number_(number),
        all_(all),
        bodies_(bodies_of(following.part)),
        pairs_(
            pairs_of(following.part.truth.actual, bodies_, following.part.scene.collision.ignore)),
        search_(search_of(bodies_, pairs_)),
        motion_(motion_of(following, reach(following, bodies_))) {}

  void run(const Progress& progress) {
    const CollisionDescription& asked = following_.part.scene.collision;
    cutting::EncounterOptions options;
    options.resolution = asked.resolution;
    options.clearance = asked.clearance;
    options.progress = [&](double share) {
      if (progress) progress("collisions", share);
    };
    const cutting::Encounters found = inside_tables(following_.part, [&] {
      return cutting::encounters(search_.bodies, search_.pairs, motion_, options);
    });
    all_.queries += found.queries;
    add_bodies();
    add_clearances(found);
    for (const Encounter& one : found.list) add(one);
    if (follows_stock(following_.part)) add_stock(progress);
  }

 private:
  const SolidBody& body(int i) const { return bodies_[std::size_t(i)]; }

  void add_bodies() {
    for (const SolidBody& one : bodies_)
      if (number_ == 0 || one.kind == SolidBody::Kind::Cutter ||
          one.kind == SolidBody::Kind::Shank || one.kind == SolidBody::Kind::Holder)
        all_.bodies.push_back({one.name, one.carrier, one.mesh.triangles.rows()});
    for (std::string& text : body_warnings(following_.part, bodies_))
      if (std::ranges::find(all_.warnings, text) == all_.warnings.end())
        all_.warnings.push_back(std::move(text));
  }

  void add_clearances(const cutting::Encounters& found) {
    const int before = int(first_clearance_);
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const cutting::PairClearance& one = found.pairs[p];
      all_.clearances.push_back({body(pairs_[p].a).name, body(pairs_[p].b).name,
                                 one.overlaps_at_start, one.distance, following_.place(one.moment),
                                 one.overlaps_at_start           ? InBlocks::Never
                                 : search_.pairs[p].contact_only ? InBlocks::WhereMet
                                                                 : InBlocks::Always});
    }
    for (std::size_t s = 0; s < found.stretches.size(); ++s) {
      const cutting::StretchClearance& one = found.stretches[s];
      const std::size_t first = motion_.stretches[s], last = end_of(motion_, s) - 1;
      ProgramPlace begin = following_.place({first, 0.0});
      // what lies between two blocks belongs to the second
      if (first > 0) begin.time_s = following_.state({first - 1, 0.0}).time_s;
      all_.blocks.push_back({begin, following_.state({last, 0.0}).time_s, one.at_least,
                             one.pair < 0 ? -1 : before + one.pair});
    }
  }

  void add_stock(const Progress& progress) {
    const auto begin = std::ptrdiff_t(all_.list.size()) - std::ptrdiff_t(listed_);
    StockCollisions found = inside_tables(
        following_.part, [&] { return stock_collisions(following_, bodies_, pairs_, progress); });
    all_.queries += found.queries;
    for (std::string& text : found.warnings) all_.warnings.push_back(std::move(text));
    for (const NearStock& one : found.near) add_near(one, found.clearances);
    for (Clearance& one : found.clearances) all_.clearances.push_back(std::move(one));
    for (Collision& one : found.list) {
      one.part = number_;
      all_.list.push_back(std::move(one));
    }
    std::stable_sort(
        all_.list.begin() + begin, all_.list.end(),
        [](const Collision& a, const Collision& b) { return a.first.time_s < b.first.time_s; });
  }

  /// @param own  pairs of the stock, which come next
  void add_near(const NearStock& near, const std::vector<Clearance>& own) {
    const auto pair = std::ranges::find(own, near.body, &Clearance::a) - own.begin();
    const auto block_of = [&](std::size_t sample) {
      return std::size_t(std::ranges::upper_bound(motion_.stretches, sample) -
                         motion_.stretches.begin()) -
             1;
    };
    for (std::size_t s = block_of(near.first); s <= block_of(near.last); ++s)
      lower(s, near.at_least, int(all_.clearances.size()) + int(pair));
  }

  /// @param stretch  of this part @param pair  of all clearances
  void lower(std::size_t stretch, double at_least, int pair) {
    BlockClearance& block = all_.blocks[first_block_ + stretch];
    if (block.pair >= 0 && block.at_least <= at_least) return;
    block.at_least = at_least;
    block.pair = pair;
  }

  void add(const Encounter& found) {
    const BodyPair pair = pairs_[std::size_t(found.pair)];
    Collision one = event_at(following_, found.moment, found.place);
    one.a = body(pair.a).name;
    one.b = body(pair.b).name;
    one.contact = found.contact;
    one.first = following_.place(found.begin);
    one.rapid = following_.is_rapid(found.begin);
    one.last = following_.place({end_of(motion_, found.last_stretch) - 1, 0.0});
    one.distance = found.distance;
    one.part = number_;
    if (search_.pairs[std::size_t(found.pair)].contact_only)
      for (std::size_t s = found.first_stretch; s <= found.last_stretch; ++s)
        lower(s, 0.0, int(first_clearance_) + found.pair);
    if (found.contact && contacts(all_) < most_measured_contacts)
      measure_depth(found, search_.bodies[std::size_t(pair.a)], search_.bodies[std::size_t(pair.b)],
                    one);
    ++listed_;
    all_.list.push_back(std::move(one));
  }

  /// The longest way out of a contact that is found.
  void measure_depth(const Encounter& found, const CarriedBody& a, const CarriedBody& b,
                     Collision& collision) const {
    constexpr std::size_t n = looks_of_step;
    const auto moment = [](std::size_t look) {
      return cutting::Moment{look / n, double(look % n) / double(n)};
    };
    const std::size_t first = n * found.moment.instant + std::size_t(double(n) * found.moment.u);
    const std::size_t last = n * (end_of(motion_, found.last_stretch) - 1);
    std::vector<std::size_t> block_ends;
    for (std::size_t s = found.first_stretch; s <= found.last_stretch; ++s)
      block_ends.push_back(n * (end_of(motion_, s) - 1));
    const auto depth_at = [&](std::size_t look) {
      const std::vector<Pose> T = following_.carriers(moment(look));
      return cutting::way_out(a.body, T[std::size_t(a.carrier)], b.body, T[std::size_t(b.carrier)])
          .depth;
    };
    const DeepestLook deepest =
        deepest_look(first, std::max(first, last) + 1, block_ends, depth_at);
    collision.depth = deepest.depth;
    collision.depths = deepest.looks;
    collision.worst = following_.place(moment(deepest.at));
  }

  const Following& following_;
  std::size_t number_;
  Collisions& all_;
  std::size_t first_clearance_ = all_.clearances.size(), first_block_ = all_.blocks.size();
  std::size_t listed_ = 0;  // of this part
  std::vector<SolidBody> bodies_;
  std::vector<BodyPair> pairs_;
  Search search_;
  CarriedMotion motion_;
};

/// Says which pairs overlap where the program begins.
void warn_of_overlaps(Collisions& all) {
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
    const Following following{parts[i], of_part(commands, i)};
    if (i == 0) all.more_files = following.path.more_files;
    try {
      check_travel(parts[i].machine, following.path, following.samples);
    } catch (const BadInput& beyond) {
      if (all.beyond_travel.empty()) all.beyond_travel = beyond.what();
    }
    PartSearch(following, i, all).run(progress);
  }
  warn_of_overlaps(all);
  all.seconds = watch.lap();
  return all;
}

}  // namespace abbe::sim
