#include "cutting/encounters.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "cutting/followed_stretches.h"
#include "kinematics/require.h"

namespace abbe::cutting {
namespace {

using Eigen::Vector3d;
using kinematics::Pose;

constexpr double infinite = std::numeric_limits<double>::infinity();

void check(const std::vector<CarriedBody>& bodies, const std::vector<BodyPair>& pairs,
           const CarriedMotion& motion, const EncounterOptions& options) {
  require(options.resolution > 0.0 && options.clearance >= 0.0 && options.share > 0.0 &&
              options.share < 1.0 && options.chunk > 0,
          "encounters: resolution, share and chunk must be positive, the share below 1, the "
          "clearance not negative");
  require(motion.instants > 0 && motion.bulge.size() + 1 == motion.instants &&
              !motion.stretches.empty() && motion.stretches.front() == 0 &&
              motion.stretches.back() < motion.instants &&
              std::ranges::adjacent_find(motion.stretches, std::greater_equal<>{}) ==
                  motion.stretches.end(),
          "encounters: instants, bulges and stretches must fit each other");
  for (const CarriedBody& body : bodies)
    require(body.carrier >= 0 && body.carrier < motion.carriers && body.body.search != nullptr,
            "encounters: a body needs a carriage that is there");
  for (const BodyPair& pair : pairs)
    require(pair.a >= 0 && pair.b >= 0 && pair.a < int(bodies.size()) &&
                pair.b < int(bodies.size()) && pair.a != pair.b,
            "encounters: a pair needs two bodies that are there");
}

/// First stretches of the chunks, and the number of stretches at the end.
std::vector<std::size_t> chunks_of(const CarriedMotion& motion, std::size_t size) {
  std::vector<std::size_t> first{0};
  for (std::size_t s = 1; s < motion.stretches.size(); ++s)
    if (motion.stretches[s] - motion.stretches[first.back()] >= size) first.push_back(s);
  first.push_back(motion.stretches.size());
  return first;
}

/// The least distances at some instants, below which the others are of interest; none of what
/// meets there.
std::vector<NearestOfPair> seen_on_the_way(const EncounterTask& task, std::size_t looks) {
  std::vector<NearestOfPair> seen(task.pairs.size());
  std::vector<std::size_t> instants;
  for (std::size_t k = 0; k < looks; ++k)
    instants.push_back(k * (task.motion.instants - 1) / std::max<std::size_t>(looks - 1, 1));
  std::vector<std::vector<Pose>> T;
  for (const std::size_t i : instants) T.push_back(task.placed(i, 0.0));
  tbb::parallel_for(std::size_t(0), task.pairs.size(), [&](std::size_t p) {
    if (task.followed[p] == 0 || task.pairs[p].contact_only) return;
    const CarriedBody &a = task.fixed(int(p)), &b = task.moving(int(p));
    for (std::size_t k = 0; k < instants.size(); ++k) {
      const Gap here = gap(a.body, T[k][std::size_t(a.carrier)], b.body,
                           T[k][std::size_t(b.carrier)], {0.0, seen[p].distance});
      if (!(here.distance < seen[p].distance) || here.distance <= task.options.resolution) continue;
      seen[p].distance = here.distance;
      seen[p].moment = {instants[k], 0.0};
      seen[p].place = 0.5 * (here.on_a + here.on_b);
    }
  });
  return seen;
}

/// Where the two of a near miss come within the clearance, in its first stretch.
Moment begin_of(const EncounterTask& task, const Encounter& near) {
  const CarriedBody &a = task.fixed(near.pair), &b = task.moving(near.pair);
  const auto relative = [&](std::size_t i) {
    const std::vector<Pose> T = task.placed(i, 0.0);
    return Pose(T[std::size_t(a.carrier)].inverse() * T[std::size_t(b.carrier)]);
  };
  const std::size_t first = task.motion.stretches[near.first_stretch];
  const std::size_t end =
      std::min(end_of(task.motion, near.first_stretch) - 1, near.moment.instant + 1);
  const std::size_t begin = std::max<std::size_t>(first, 1) - 1;
  Pose before = relative(begin);
  for (std::size_t i = begin; i < end; ++i) {
    const Pose after = relative(i + 1);
    const std::optional<double> u =
        comes_within(a.body, b.body, kinematics::screw_between(before, after),
                     task.options.clearance, task.options.resolution);
    if (u) return {i, *u};
    before = after;
  }
  return near.moment;
}

/// Encounters from those of single stretches: one that goes on in the next stretch is one, and what
/// comes near before contact and after it belongs to the contact.
class Joined {
 public:
  explicit Joined(std::size_t pairs) : open_(pairs) {}

  void add(const Encounter& next) {
    Open& open = open_[std::size_t(next.pair)];
    const bool goes_on = open.index && open.last + 1 >= next.first_stretch;
    open.last = next.last_stretch;
    if (!goes_on) {
      open.index = list.size();
      list.push_back(next);
      return;
    }
    Encounter& one = list[*open.index];
    if (next.contact == one.contact) {
      const std::size_t first = one.first_stretch;
      if (!one.contact && next.distance < one.distance) one = next;
      one.first_stretch = first;
      one.last_stretch = next.last_stretch;
    } else if (next.contact) {
      one = next;
    }
  }

  std::vector<Encounter> list;

 private:
  struct Open {
    std::optional<std::size_t> index;
    std::size_t last = 0;  // stretch
  };
  std::vector<Open> open_;  // (pairs)
};

}  // namespace

std::size_t end_of(const CarriedMotion& motion, std::size_t stretch) {
  const std::size_t next = stretch + 1;
  return next < motion.stretches.size() ? motion.stretches[next] : motion.instants;
}

Encounters encounters(const std::vector<CarriedBody>& bodies, const std::vector<BodyPair>& pairs,
                      const CarriedMotion& motion, const EncounterOptions& options) {
  check(bodies, pairs, motion, options);
  EncounterTask task{bodies, pairs, motion, options, std::vector<char>(pairs.size(), 1)};
  for (const BodyPair& pair : pairs)
    task.parts.push_back(pair.contact_only && options.accelerated
                             ? balls_of(bodies[std::size_t(pair.b)].body)
                             : BallsOfBody{});
  for (const BallsOfBody& one : task.parts)
    task.rest_hulls.push_back(one.rest ? hull_of(*one.rest) : std::vector<Ball>{});
  Encounters all;
  all.pairs.resize(pairs.size());
  const std::vector<Pose> T = task.placed(0, 0.0);
  tbb::parallel_for(std::size_t(0), pairs.size(), [&](std::size_t p) {
    const CarriedBody &a = task.fixed(int(p)), &b = task.moving(int(p));
    const Pose &T_a = T[std::size_t(a.carrier)], &T_b = T[std::size_t(b.carrier)];
    const bool overlap = gap(a.body, T_a, b.body, T_b).distance <= options.resolution ||
                         is_inside(a.body, T_a, b.body, T_b);
    all.pairs[p].overlaps_at_start = overlap;
    task.followed[p] = overlap ? 0 : 1;
  });
  all.queries = pairs.size();
  for (const CarriedBody& one : bodies) task.hulls.push_back(hull_of(one.body));
  // few beside those of the search itself
  const std::size_t looks =
      options.accelerated ? std::min<std::size_t>(256, motion.instants / 64) : 0;
  task.seen = seen_on_the_way(task, looks);
  all.queries += looks * pairs.size();
  const std::vector<std::size_t> first = chunks_of(motion, options.chunk);
  std::vector<FollowedStretches> chunks(first.size() - 1);
  std::atomic<std::size_t> done{0};
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, chunks.size(), 1),
      [&](const auto& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c) {
          chunks[c] = follow(task, first[c], first[c + 1]);
          if (options.progress) options.progress(double(++done) / double(chunks.size()));
        }
      },
      tbb::simple_partitioner{});
  for (PairClearance& pair : all.pairs) pair.distance = pair.overlaps_at_start ? 0.0 : infinite;
  Joined joined(pairs.size());
  for (const FollowedStretches& chunk : chunks) {
    all.queries += chunk.queries;
    all.stretches.insert(all.stretches.end(), chunk.clearances.begin(), chunk.clearances.end());
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const NearestOfPair& best = chunk.best[p];
      if (task.followed[p] != 0 && best.distance < all.pairs[p].distance)
        all.pairs[p] = {false, best.contact ? 0.0 : best.distance, best.moment};
    }
    std::vector<Encounter> found = chunk.encounters;
    std::ranges::stable_sort(
        found, {}, [](const Encounter& one) { return std::tuple(one.first_stretch, one.pair); });
    for (const Encounter& one : found) joined.add(one);
  }
  all.list = std::move(joined.list);
  tbb::parallel_for(std::size_t(0), all.list.size(), [&](std::size_t i) {
    Encounter& one = all.list[i];
    one.begin = one.contact ? one.moment : begin_of(task, one);
  });
  return all;
}

}  // namespace abbe::cutting
