#include "sim/cut/collisions.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "cutting/encounters.h"
#include "kinematics/escape.h"
#include "sim/cut/bodies.h"
#include "sim/cut/inside_tables.h"
#include "sim/cut/stopwatch.h"
#include "sim/cut/travel.h"
#include "sim/program/path_meter.h"

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

/// A part of a job as it is commanded.
struct Following {
  const Job& part;
  const program::Samples& samples;
  const program::Path& path;

  const AxisState& state(std::size_t i) const { return samples.states[i]; }

  /// Between two samples: axes and time in proportion, directions those of the way there.
  AxisState state(const cutting::Moment& moment) const {
    AxisState state = samples.states[moment.instant];
    if (moment.u > 0.0 && moment.instant + 1 < samples.states.size()) {
      const AxisState& next = samples.states[moment.instant + 1];
      const AxisState before = state;
      state = next;
      state.q = before.q + moment.u * (next.q - before.q);
      state.time_s = before.time_s + moment.u * (next.time_s - before.time_s);
    }
    if (const auto& spindle = part.machine.workpiece_spindle) state.q[*spindle] = 0.0;
    return state;
  }

  std::vector<Pose> carriers(const cutting::Moment& moment) const {
    const AxisState at = state(moment);
    return carrier_poses(part.truth.actual, at.q, deviations(part.truth, at).joints);
  }

  const program::Block& block(std::size_t i) const {
    return path.blocks[std::size_t(samples.block[i])];
  }

  /// The sample to which the axes are on their way.
  std::size_t running(const cutting::Moment& moment) const {
    return std::min(moment.instant + (moment.u > 0.0 ? 1u : 0u), samples.states.size() - 1);
  }

  ProgramPlace place(const cutting::Moment& moment) const {
    const std::size_t i = running(moment);
    return {samples.line[i], block(i).file, state(moment).time_s};
  }
};

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
  for (const SolidBody& body : bodies)
    search.bodies.push_back(
        {body.pieces.empty() ? cutting::body_of(body.mesh) : cutting::body_of(body.pieces),
         body.frame});
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    core[i] = int(i);
    if (bodies[i].core.empty()) continue;
    core[i] = int(search.bodies.size());
    search.bodies.push_back({cutting::body_of(bodies[i].core), bodies[i].frame});
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

std::vector<BodyPair> pairs_in(const Job& part, const std::vector<SolidBody>& bodies) {
  try {
    return pairs_of(part.truth.actual, bodies, part.scene.collision.ignore);
  } catch (const std::invalid_argument& fault) {
    throw BadInput(part.scene.file.string(), 0, 0, "names of bodies in collision.ignore",
                   fault.what());
  }
}

/// The longest way out of a contact at up to so many of its instants.
void measure_depth(const Following& following, const Encounter& found, std::size_t end,
                   const CarriedBody& a, const CarriedBody& b, Collision& collision) {
  constexpr std::size_t most_looks = 24;
  const std::size_t first = std::min(found.moment.instant + 1, following.samples.states.size() - 1);
  const std::size_t count = std::max<std::size_t>(end, first + 1) - first;
  const std::size_t looks = std::min(count, most_looks);
  for (std::size_t k = 0; k < looks; ++k) {
    const std::size_t i = looks == 1 ? first : first + k * (count - 1) / (looks - 1);
    const std::vector<Pose> T = following.carriers({i, 0.0});
    const cutting::WayOut out =
        cutting::way_out(a.body, T[std::size_t(a.carrier)], b.body, T[std::size_t(b.carrier)]);
    collision.depth = std::max(collision.depth, out.depth);
    ++collision.depths;
  }
}

/// Appends what is found in a part of a job.
class PartSearch {
 public:
  PartSearch(const Following& following, std::size_t number, Collisions& all)
      : following_(following),
        number_(number),
        all_(all),
        bodies_(bodies_of(following.part)),
        pairs_(pairs_in(following.part, bodies_)),
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
    const int before = int(all_.clearances.size());
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const cutting::PairClearance& one = found.pairs[p];
      all_.clearances.push_back({body(pairs_[p].a).name, body(pairs_[p].b).name,
                                 one.overlaps_at_start, one.distance,
                                 following_.place(one.moment)});
    }
    for (std::size_t s = 0; s < found.stretches.size(); ++s) {
      const cutting::StretchClearance& one = found.stretches[s];
      all_.blocks.push_back({following_.place({motion_.stretches[s], 0.0}),
                             following_.state(end_of(motion_, s) - 1).time_s, one.at_least,
                             one.pair < 0 ? -1 : before + one.pair});
    }
  }

  void add(const Encounter& found) {
    constexpr std::size_t most_measured = 50;  // contacts whose depth is looked at
    const BodyPair pair = pairs_[std::size_t(found.pair)];
    Collision one;
    one.a = body(pair.a).name;
    one.b = body(pair.b).name;
    one.contact = found.contact;
    one.first = following_.place(found.moment);
    one.last = following_.place({end_of(motion_, found.last_stretch) - 1, 0.0});
    one.distance = found.distance;
    one.place_b = found.place;
    const std::vector<Pose> T = following_.carriers(found.moment);
    const Carriers carriers{following_.part.truth.actual.size()};
    one.place_w = T[std::size_t(carriers.workpiece())].inverse() * found.place;
    one.part = number_;
    one.state = following_.state(found.moment);
    one.rapid = following_.block(following_.running(found.moment)).interpolation ==
                program::Interpolation::Rapid;
    if (found.contact && contacts(all_) < most_measured)
      measure_depth(following_, found, end_of(motion_, found.last_stretch),
                    search_.bodies[std::size_t(pair.a)], search_.bodies[std::size_t(pair.b)], one);
    all_.list.push_back(std::move(one));
  }

  const Following& following_;
  std::size_t number_;
  Collisions& all_;
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

std::string range_text(const Collision& event, const std::vector<std::string>& more_files) {
  const std::string first = program::line_text(more_files, event.first.line, event.first.file);
  const bool one = event.first.line == event.last.line && event.first.file == event.last.file;
  return one ? first
             : first + " to " + program::line_text(more_files, event.last.line, event.last.file);
}

}  // namespace

std::string event_text(const Collision& event, const std::vector<std::string>& more_files) {
  const std::string where = fmt::format("{}, {:.3f} s{}", range_text(event, more_files),
                                        event.first.time_s, event.rapid ? ", on a rapid" : "");
  const std::string pair = fmt::format("{} and {}", escaped(event.a), escaped(event.b));
  if (!event.contact)
    return fmt::format("{} come within {:.3g} mm: {}", pair, event.distance, where);
  const std::string depth =
      event.depths > 0 ? fmt::format("{:.3g} mm deep", event.depth) : "depth not looked at";
  return fmt::format("{} meet, {}: {}", pair, depth, where);
}

std::vector<std::string> collision_warnings(const Collisions& all) {
  constexpr std::size_t most = 10;
  std::vector<std::string> warnings = all.warnings;
  if (!all.beyond_travel.empty()) warnings.push_back("beyond its travel: " + all.beyond_travel);
  std::size_t said = 0;
  for (const Collision& one : all.list)
    if (one.contact && said++ < most)
      warnings.push_back("collision: " + event_text(one, all.more_files));
  if (said > most) warnings.push_back(fmt::format("and {} more collisions", said - most));
  if (const std::size_t near = all.list.size() - contacts(all); near > 0)
    warnings.push_back(fmt::format("{} times two bodies come within {:g} mm", near, all.clearance));
  return warnings;
}

std::size_t contacts(const Collisions& collisions) {
  return std::size_t(std::ranges::count_if(collisions.list, &Collision::contact));
}

bool is_clear(const Collisions& collisions) {
  return contacts(collisions) == 0 && collisions.beyond_travel.empty();
}

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
    const Commands& own = of_part(commands, i);
    const Following following{parts[i], own.samples, own.path ? *own.path : parts[i].path};
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
