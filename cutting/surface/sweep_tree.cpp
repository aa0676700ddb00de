#include "cutting/surface/sweep_tree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include "cutting/surface/ball_entry.h"
#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/near_moves.h"
#include "kinematics/bad_input.h"

namespace abbe::cutting {

using Eigen::Vector3d;

/// The state of a traversal of the tree for the part of a ray that is not yet cut off by a removal.
struct SweepTree::Traversal {
  const Ray& ray;
  RaySegment segment;
  Hint& hint;
  int searched_leaf = -1;
  int searched_item = -1;
  int cut_count = 0;  // number of removals that made the segment shorter
  bool starts_removed = false;
};

/// The first removal of a ray so far.
struct SweepTree::FirstRemoval {
  std::optional<Removal> best;
  int best_item = -1;

  /// Returns the s (mm) beyond which a removal cannot be the first.
  double limit(const Ray& ray) const {
    return best ? std::min(best->s + entry_margin, ray.band) : ray.band;
  }
  /// Records a removal. Returns true if it comes before the first removal so far.
  bool record(const Removal& removal, int item) {
    const auto order = [](const Removal& r) { return std::tuple(r.s, r.move, r.part); };
    if (best && order(*best) <= order(removal)) return false;
    best = removal;
    best_item = item;
    return true;
  }
};

struct SweepTree::FirstSearch : Traversal, FirstRemoval {
  double limit() const { return FirstRemoval::limit(ray); }
};

struct SweepTree::RemovalCollection : Traversal {
  double end;  // mm along the ray
  std::vector<Removal> removals;

  double limit() const { return end; }
};

// Construction.

SweepTree::SweepTree(const Cutter& cutter, const CutterMotion& motion)
    : cutter_(cutter), motion_(motion) {
  require(!is_hollow(cutter), "sweep: expected a convex cutter, seen a hollow one");
  items_ = sorted_items();
  make_leaves();
  make_nodes();
}

std::vector<SweepTree::Item> SweepTree::sorted_items() {
  const int samples = int(motion_.tip.rows());
  const int moves = samples == 1 ? 1 : samples - 1;
  if (samples == 0) return {};
  const Vector3d low = motion_.tip.colwise().minCoeff();
  const Vector3d high = motion_.tip.colwise().maxCoeff();
  centre_ = 0.5 * (low + high);
  reach_ = 0.5 * (high - low).lpNorm<1>() + 4 * cutter_.radius + cutter_.flank_length;

  // Moves at the same position with different axes cover different regions; in one node they would
  // need a wide cone of axes. Therefore the axis times a lever counts as three more coordinates.
  const double lever = 0.5 * std::max(cutter_.flank_length, cutter_.radius);
  std::vector<int> first_item(std::size_t(moves) + 1, 0);
  for (int i = 0; i < moves; ++i) first_item[i + 1] = first_item[i] + move_part_count(motion_, i);
  std::vector<Key> keys(first_item.back());
  tbb::parallel_for(tbb::blocked_range<int>(0, moves, 4096), [&](const auto& range) {
    for (int i = range.begin(); i < range.end(); ++i) {
      const int next = std::min(i + 1, samples - 1);
      const int parts = first_item[i + 1] - first_item[i];
      for (int part = 0; part < parts; ++part) {
        const double t = (part + 0.5) / parts;
        const Vector3d tip = (1 - t) * motion_.tip.row(i) + t * motion_.tip.row(next);
        const Vector3d axis = motion_.axis.row(i) + motion_.axis.row(next);
        const Vector3d k = tip + 0.5 * cutter_.corner_radius * axis - centre_;
        const Vector3d scaled_axis = lever * axis;
        keys[first_item[i] + part] = {
            {float(k.x()), float(k.y()), float(k.z()), float(scaled_axis.x()),
             float(scaled_axis.y()), float(scaled_axis.z())},
            {i, std::uint16_t(part), std::uint16_t(parts)}};
      }
    }
  });
  sort_keys(keys);
  std::vector<Item> items(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) items[i] = keys[i].item;
  return items;
}

/// Sorts the keys so that each run of 8, 64, 512 ... keys, counted from the first, is compact:
/// halves a range across its longest side, at a whole number of runs.
void SweepTree::sort_keys(std::span<Key> keys) {
  const auto order = [](const Item& item) { return std::tuple(item.move, item.part); };
  if (keys.size() <= width) {
    std::sort(keys.begin(), keys.end(),
              [&](const Key& a, const Key& b) { return order(a.item) < order(b.item); });
    return;
  }
  std::size_t run = width;
  while (run * width < keys.size()) run *= width;
  const std::size_t run_count = (keys.size() + run - 1) / run;
  std::array<float, 6> low = keys.front().k, high = low;
  for (const Key& key : keys)
    for (std::size_t d = 0; d < low.size(); ++d) {
      low[d] = std::min(low[d], key.k[d]);
      high[d] = std::max(high[d], key.k[d]);
    }
  std::size_t longest = 0;
  for (std::size_t candidate = 1; candidate < low.size(); ++candidate)
    if (high[candidate] - low[candidate] > high[longest] - low[longest]) longest = candidate;
  const std::size_t split = run_count / 2 * run;
  std::nth_element(keys.begin(), keys.begin() + std::ptrdiff_t(split), keys.end(),
                   [&](const Key& a, const Key& b) {
                     return a.k[longest] != b.k[longest] ? a.k[longest] < b.k[longest]
                                                         : order(a.item) < order(b.item);
                   });
  // A smaller range is sorted faster than a task is started.
  constexpr std::size_t min_parallel_items = 4096;
  const auto sort_lower = [&] { sort_keys(keys.first(split)); };
  const auto sort_upper = [&] { sort_keys(keys.subspan(split)); };
  if (keys.size() > min_parallel_items) {
    tbb::parallel_invoke(sort_lower, sort_upper);
  } else {
    sort_lower();
    sort_upper();
  }
}

Move SweepTree::item_move(const Item& item) const {
  return move_part(motion_, item.move, item.part, item.parts);
}

const Move& SweepTree::item_move(int item, Hint& hint) const {
  Hint::TestedMove& cached = hint.tested_moves[std::size_t(item) % hint.tested_moves.size()];
  if (cached.item != item) cached = {item, item_move(items_[item])};
  return cached.move;
}

void SweepTree::make_leaves() {
  const std::size_t count = (items_.size() + width - 1) / width;
  leaves_.moves.resize(count);
  leaves_.frames.resize(count);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 256), [&](const auto& range) {
    for (std::size_t leaf = range.begin(); leaf < range.end(); ++leaf) {
      std::array<Move, width> moves;
      const std::size_t move_count = std::min<std::size_t>(width, items_.size() - leaf * width);
      for (std::size_t i = 0; i < move_count; ++i) moves[i] = item_move(items_[leaf * width + i]);
      fill_leaf(leaves_, leaf, cutter_, {moves.data(), move_count});
    }
  });
}

int SweepTree::children(std::size_t level, int node) const {
  const std::size_t child_count = level == 0 ? leaves_.moves.size() : levels_[level - 1].size();
  return int(std::min<std::size_t>(width, child_count - std::size_t(node) * width));
}

void SweepTree::make_nodes() {
  const std::size_t leaves = leaves_.moves.size();
  std::size_t child_count = leaves;
  while (child_count > 0 && (levels_.empty() || child_count > 1)) {
    const std::size_t level = levels_.size();
    std::vector<SweepNode> nodes((child_count + width - 1) / width);
    levels_.emplace_back();
    const std::size_t leaves_per_child = std::size_t(1) << (3 * level);
    tbb::parallel_for(tbb::blocked_range<int>(0, int(nodes.size()), 64), [&](const auto& range) {
      for (int n = range.begin(); n < range.end(); ++n) {
        const int children_of_node = children(level, n);
        for (int i = 0; i < width; ++i) {
          const std::size_t child = std::size_t(n * width + std::min(i, children_of_node - 1));
          fill_child(nodes[n], i,
                     level == 0
                         ? sweep_bounds(leaves_, child)
                         : sweep_bounds(levels_[level - 1][child], children(level - 1, int(child)),
                                        centre_, leaves_, child * leaves_per_child,
                                        std::min((child + 1) * leaves_per_child, leaves)),
                     centre_);
        }
      }
    });
    child_count = nodes.size();
    levels_[level] = std::move(nodes);
  }
}

// Search.

Removal SweepTree::make_removal(const Entry& entry, int item) const {
  return {entry.s, entry.t, items_[item].move, items_[item].part};
}

void SweepTree::record(const std::optional<Entry>& entry, int item, FirstSearch& search) const {
  if (!entry || !search.FirstRemoval::record(make_removal(*entry, item), item)) return;
  search.starts_removed = entry->s <= -search.ray.band;
  ++search.cut_count;
  search.segment.end.truncate(search.ray, std::min(entry->s + entry_margin, search.ray.band),
                              centre_);
}

void SweepTree::record(const std::optional<Entry>& entry, int item,
                       RemovalCollection& collection) const {
  if (entry) collection.removals.push_back(make_removal(*entry, item));
}

template <class Query>
void SweepTree::test_item(int item, Query& query) const {
  record(first_entry(cutter_, item_move(item, query.hint), query.ray, query.limit()), item, query);
}

// The nearest candidate comes first, because its removal shortens the ray and so rules out most of
// the others: after every cut the remaining candidates are tested again, eight at a time.

template <class Query>
void SweepTree::search_leaf(int leaf, Query& query) const {
  const SweepLeaf& moves = leaves_.moves[leaf];
  const SweepLeafFrame& frame = leaves_.frames[leaf];
  Candidates8 candidates = candidate_moves(moves, frame, query.segment);
  if (std::popcount(candidates.bits) > 1 && !is_ball(cutter_))
    return search_by_bounds(leaf, candidates.bits, query);
  while (candidates.bits != 0 && !query.starts_removed) {
    const int lane = candidates.nearest();
    candidates.bits &= ~(1u << lane);
    const int cut_count = query.cut_count;
    if (leaf * width + lane != query.searched_item) test_item(leaf * width + lane, query);
    if (query.cut_count != cut_count && candidates.bits != 0)
      candidates.bits &= candidate_moves(moves, frame, query.segment).bits;
  }
}

const SweepTree::Hint::LeafBounds& SweepTree::leaf_bounds(int leaf, Hint& hint) const {
  Hint::LeafBounds& cached = hint.leaf_bounds[std::size_t(leaf) % hint.leaf_bounds.size()];
  if (cached.leaf == leaf) return cached;
  cached.leaf = leaf;
  for (int i = 0; i < width; ++i) {
    const int item = std::min(leaf * width + i, int(items_.size()) - 1);
    cached.endpoints[std::size_t(i)] = move_endpoints(item_move(item, hint));
    cached.moves.set_lane(i, cutter_, cached.endpoints[std::size_t(i)]);
  }
  return cached;
}

/// Searches several candidate moves of a leaf: computes their bounds together and tests the moves
/// in the order of their bounds.
template <class Query>
void SweepTree::search_by_bounds(int leaf, unsigned candidates, Query& query) const {
  const Hint::LeafBounds& moves = leaf_bounds(leaf, query.hint);
  EntryBounds bounds;
  entry_bounds(cutter_, moves.moves, {&query.ray, 1}, {&bounds, 1});
  std::array<double, width> min_s;
  const auto remove_ruled_out = [&] {
    for (unsigned remaining = candidates; remaining != 0; remaining &= remaining - 1) {
      const int i = std::countr_zero(remaining);
      if (min_s[std::size_t(i)] > query.limit()) candidates &= ~(1u << i);
    }
  };
  for (unsigned remaining = candidates; remaining != 0; remaining &= remaining - 1) {
    const auto i = std::size_t(std::countr_zero(remaining));
    min_s[i] = double(bounds.min_s[i]);
    if (min_s[i] > query.limit()) continue;
    const Vector3d normal(bounds.m[0][i], bounds.m[1][i], bounds.m[2][i]);
    min_s[i] = min_entry(cutter_, moves.endpoints[i], query.ray, normal);
  }
  for (remove_ruled_out(); candidates != 0 && !query.starts_removed; remove_ruled_out()) {
    std::size_t next = std::size_t(std::countr_zero(candidates));
    for (unsigned remaining = candidates & (candidates - 1); remaining != 0;
         remaining &= remaining - 1) {
      const auto i = std::size_t(std::countr_zero(remaining));
      if (min_s[i] < min_s[next]) next = i;
    }
    candidates &= ~(1u << next);
    const int item = leaf * width + int(next);
    if (item == query.searched_item) continue;
    const Move& move = item_move(item, query.hint);
    record(first_entry(cutter_, move, query.ray, query.limit(), bounds.fraction[next],
                       bounds.min_s[next]),
           item, query);
  }
}

template <class Query>
void SweepTree::descend(Query& query) const {
  struct Visit {
    int level;
    int index;
    int cut_count;  // of the ray when `candidates` was computed
    Candidates8 candidates;
  };
  // 12 levels of 8 children hold 6.9e10 leaves, more than an int can count.
  std::array<Visit, 12> path;
  int depth = 0;
  const auto visit = [&](int level, int index) {
    path[depth] = {level, index, query.cut_count,
                   candidate_children(levels_[level][index], query.segment)};
    path[depth].candidates.bits &= (1u << children(level, index)) - 1u;
    ++depth;
  };
  visit(int(levels_.size()) - 1, 0);
  while (depth > 0 && !query.starts_removed) {
    Visit& current = path[depth - 1];
    if (current.candidates.bits != 0 && current.cut_count != query.cut_count) {
      current.candidates.bits &=
          candidate_children(levels_[current.level][current.index], query.segment).bits;
      current.cut_count = query.cut_count;
    }
    if (current.candidates.bits == 0) {
      --depth;
      continue;
    }
    const int child = current.candidates.nearest();
    current.candidates.bits &= ~(1u << child);
    const int index = current.index * width + child;
    if (current.level > 0)
      visit(current.level - 1, index);
    else if (index != query.searched_leaf)
      search_leaf(index, query);
  }
}

RaySegment SweepTree::ray_segment(const Ray& ray, double end_s) const {
  return {cutter_, ray, end_s, centre_, reach_};
}

std::optional<Removal> SweepTree::first_removal(const Ray& ray, Hint& hint) const {
  if (items_.empty()) return std::nullopt;
  FirstSearch search{{.ray = ray, .segment = ray_segment(ray, ray.band), .hint = hint}, {}};
  // Begin with the item of the neighbour's removal, then its leaf: either usually contains the
  // first removal and so shortens the ray before the traversal.
  if (hint.item >= 0) {
    test_item(hint.item, search);
    search.searched_item = hint.item;
    const int leaf = hint.item / width;
    search_leaf(leaf, search);
    search.searched_leaf = leaf;
  }
  descend(search);
  if (search.best) hint.item = search.best_item;
  return search.best;
}

// Neighbouring rays. A few moves near the one that removed at the previous rays give upper limits
// of the first removals. Moves that no ray can meet before its limit are ruled out for all rays at
// once; the remaining moves are bounded for every ray and tested in the order of their bounds.

namespace {

/// A bounding box of points in given axes.
struct Box {
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d high = -low;

  void add(const Vector3d& point) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  Vector3d centre() const { return 0.5 * (low + high); }
  Vector3d half_sides() const { return 0.5 * (high - low); }
};

}  // namespace

/// Lowers each ray's limit (mm) to the s at which the search would find that the ray meets the
/// cutter of a move at instant t, or of neighbouring moves, or to slightly more.
void SweepTree::lower_limits(std::span<double> limits, std::span<const Ray> rays, int item,
                             double t, Hint& hint) const {
  if (is_ball(cutter_))
    return lower_limits_to_ball(limits, rays, cutter_, item_move(item, hint), t);
  const int first = item / width * width;
  std::vector<Move> moves(std::min(width, int(items_.size()) - first));
  for (std::size_t i = 0; i < moves.size(); ++i) moves[i] = item_move(first + int(i), hint);
  lower_limits_to_moves(limits, rays, cutter_, moves);
}

/// Returns upper limits of the first removals, mm along each ray; an empty vector if a ray starts,
/// or almost starts, in removed material. The limits follow from the move that removed at the
/// previous rays and, if one ray's limit is then far beyond the others, from the first removal of
/// that ray.
std::vector<double> SweepTree::upper_limits(std::span<const Ray> rays, Hint& hint) const {
  // The box about the ends of the rays is only as tight as the farthest end, so up to four of the
  // farthest rays are searched exactly.
  constexpr int max_searches = 4;
  const double first_tolerance = 0.003 * cutter_.radius, tolerance = 0.01 * cutter_.radius;
  const double band = rays.front().band;
  std::vector<double> limits(rays.size(), band);
  if (hint.item >= 0) {
    const Move& move = item_move(hint.item, hint);
    lower_limits(limits, rays, hint.item, 0.5 * (move.from + move.to), hint);
  }
  for (int i = 0; i < max_searches; ++i) {
    const auto [nearest, farthest] = std::minmax_element(limits.begin(), limits.end());
    if (*nearest <= 1e-5 - band) return {};
    if (*farthest - *nearest < (i == 0 ? first_tolerance : tolerance) && hint.item >= 0) break;
    const std::size_t index = i == 0 ? rays.size() / 2 : std::size_t(farthest - limits.begin());
    const std::optional<Removal> removal = first_removal(rays[index], hint);
    if (removal && removal->s <= -band) return {};
    if (!removal) break;
    limits[index] = std::min(limits[index], removal->s + entry_margin);
    lower_limits(limits, rays, hint.item, removal->t, hint);
  }
  return limits;
}

/// Returns the bundle of the rays, or nothing if a ray deviates from their mean direction by 45 deg
/// or more.
std::optional<PatchSegment> SweepTree::patch_segment(std::span<const Ray> rays,
                                                     std::span<const double> limits) const {
  Vector3d sum = Vector3d::Zero();
  for (const Ray& ray : rays) sum += ray.normal;
  if (!(sum.norm() > 0.5 * double(rays.size()))) return std::nullopt;
  Eigen::Matrix3d axes;
  axes.col(2) = sum.normalized();
  axes.col(0) = axes.col(2).unitOrthogonal();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  const Vector3d origin = rays.front().point;
  Box ends, starts;
  double min_cosine = 1.0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    const Vector3d offset = ray.point - origin;
    ends.add(axes.transpose() * (offset + limits[i] * ray.normal));
    starts.add(axes.transpose() * (offset - ray.band * ray.normal));
    min_cosine = std::min(min_cosine, ray.normal.dot(axes.col(2)));
  }
  if (!(min_cosine > 0.7)) return std::nullopt;
  // The cosine of a small angle has lost half of the digits; the term 1e-14 makes the bound valid.
  const double tangent =
      std::sqrt(std::max(0.0, 1.0 - min_cosine * min_cosine) + 1e-14) / min_cosine;
  const auto make_end = [&](const Box& box, double sense) {
    const Ray central_ray{origin + axes * box.centre(), sense * axes.col(2), rays.front().band};
    return PatchEnd({cutter_, central_ray, 0.0, centre_, reach_}, axes, box.half_sides(), tangent);
  };
  return PatchSegment{make_end(ends, 1.0), make_end(starts, -1.0)};
}

/// Collects the moves that the rays may meet. Returns false if there are more than
/// `near.max_count`.
bool SweepTree::collect_near_moves(const PatchSegment& rays, NearMoves& near, Hint& hint) const {
  struct Visit {
    int level, index;
  };
  std::array<Visit, 12 * width> stack;
  int depth = 0;
  stack[depth++] = {int(levels_.size()) - 1, 0};
  while (depth > 0) {
    const auto [level, index] = stack[--depth];
    unsigned candidates = candidate_children(levels_[level][index], rays).bits;
    candidates &= (1u << children(level, index)) - 1u;
    for (; candidates != 0; candidates &= candidates - 1) {
      const int child = index * width + std::countr_zero(candidates);
      if (level > 0) {
        stack[depth++] = {level - 1, child};
        continue;
      }
      unsigned moves = candidate_moves(leaves_.moves[child], leaves_.frames[child], rays).bits;
      if (near.count + std::popcount(moves) > near.max_count) return false;
      for (; moves != 0; moves &= moves - 1) {
        const int item = child * width + std::countr_zero(moves);
        near.items[near.count] = item;
        near.moves[near.count++] = item_move(item, hint);
      }
    }
  }
  return true;
}

/// Returns the first removal on a ray by the moves of its pairs, numbers `first` to `end`.
SweepTree::FirstRemoval SweepTree::first_removal_of_pairs(const NearMoves& near,
                                                          const NearMoves8& moves8,
                                                          const NearPairs& pairs, std::size_t first,
                                                          std::size_t end, const Ray& ray) const {
  FirstRemoval search;
  if (first == end) return search;
  const auto test_pair = [&](std::size_t pair) {
    const int move = pairs.moves[pair];
    const double limit = search.limit(ray);
    const std::optional<Entry> entry = is_ball(cutter_)
                                           ? first_entry(cutter_, near.moves[move], ray, limit)
                                           : first_entry(cutter_, near.moves[move], ray, limit,
                                                         pairs.fraction(pair), pairs.min_s(pair));
    if (entry) search.record(make_removal(*entry, near.items[move]), near.items[move]);
  };
  std::size_t best = first;
  for (std::size_t pair = first + 1; pair < end; ++pair)
    if (pairs.min_s(pair) < pairs.min_s(best)) best = pair;
  if (!(double(pairs.min_s(best)) > search.limit(ray))) test_pair(best);
  // Moves that single precision cannot distinguish from the best follow in the order of a bound in
  // double precision.
  std::size_t ordered_count = 0;
  std::array<std::pair<double, std::size_t>, NearMoves::capacity> ordered_pairs;
  for (std::size_t pair = first; pair < end; ++pair) {
    if (pair == best || double(pairs.min_s(pair)) > search.limit(ray)) continue;
    const double bound =
        min_entry(cutter_, moves8.endpoints[pairs.moves[pair]], ray, pairs.normal(pair));
    if (bound <= search.limit(ray)) ordered_pairs[ordered_count++] = {bound, pair};
  }
  std::sort(ordered_pairs.begin(), ordered_pairs.begin() + ordered_count);
  for (std::size_t i = 0; i < ordered_count && ordered_pairs[i].first <= search.limit(ray); ++i)
    test_pair(ordered_pairs[i].second);
  return search;
}

/// Searches a few rays at a time with common planes, which rule out most moves for each ray.
void SweepTree::search_near_moves(std::span<const Ray> rays, std::span<double> limits,
                                  std::span<std::optional<Removal>> removals, const NearMoves& near,
                                  Hint& hint) const {
  constexpr std::size_t rays_per_group = Move8::width;
  constexpr std::size_t min_groups_for_planes = 8;  // from here on lower limits repay their cost
  const NearMoves8 moves8(cutter_, near);
  NearPairs pairs;
  std::array<std::size_t, rays_per_group + 1> first_pair;
  for (std::size_t first = 0; first < rays.size(); first += rays_per_group) {
    const std::size_t end = std::min(first + rays_per_group, rays.size());
    const std::span<const Ray> group = rays.subspan(first, end - first);
    const NearPlanes planes(cutter_, moves8, group);
    if (moves8.count > min_groups_for_planes)
      lower_limits_by_planes(limits.subspan(first, group.size()), group, cutter_, near, moves8,
                             planes);
    for (std::size_t i = first; i < end;) {
      const std::size_t batch_begin = i;
      pairs.count = 0;
      for (; i < end && pairs.count <= NearMoves::capacity; ++i) {
        first_pair[i - batch_begin] = pairs.count;
        pairs.add_candidates(moves8, near.count, planes, rays[i], limits[i]);
      }
      first_pair[i - batch_begin] = pairs.count;
      pairs.compute_bounds(moves8, cutter_, rays[i - 1]);
      for (std::size_t j = batch_begin; j < i; ++j) {
        const FirstRemoval search =
            first_removal_of_pairs(near, moves8, pairs, first_pair[j - batch_begin],
                                   first_pair[j - batch_begin + 1], rays[j]);
        removals[j] = search.best;
        if (search.best) hint.item = search.best_item;
      }
    }
  }
}

/// Searches neighbouring rays with closed-form bounds of ball ends. Returns false if the bounds do
/// not apply: they require that the rays can only meet the lower half of the ball, and that it is
/// near.
bool SweepTree::search_near_balls(std::span<const Ray> rays,
                                  std::span<std::optional<Removal>> removals,
                                  const PatchSegment& patch, const NearMoves& near,
                                  Hint& hint) const {
  if (!is_ball(cutter_)) return false;
  const RayEnd& end = patch.end.end;
  const Vector3d origin(end.point[0], end.point[1], end.point[2]),
      normal(end.n[0], end.n[1], end.n[2]);
  const double around = Vector3d(patch.end.half[0], patch.end.half[1], patch.end.half[2]).norm();
  double max_distance = 0.0;
  for (const Ray& ray : rays) max_distance = std::max(max_distance, (ray.point - origin).norm());
  std::array<BallChord, NearMoves::capacity> chords;
  for (int move = 0; move < near.count; ++move) {
    chords[move] = BallChord(cutter_, near.moves[move], origin);
    // ball_bounds requires less than 5 radii.
    if (!(chords[move].distance + max_distance < 4.9 * cutter_.radius) ||
        !is_below_centre(cutter_, near.moves[move], origin, around, normal, patch.end.tilt))
      return false;
  }
  std::array<Entry8, NearMoves::capacity> bounds;
  for (std::size_t first_ray = 0; first_ray < rays.size(); first_ray += width) {
    Ray8 ray_group;
    const std::size_t ray_count = std::min<std::size_t>(width, rays.size() - first_ray);
    for (std::size_t i = 0; i < width; ++i)
      for (int d = 0; d < 3; ++d) {
        const Ray& ray = rays[first_ray + std::min(i, ray_count - 1)];
        ray_group.p[d][i] = float(ray.point[d] - origin[d]);
        ray_group.n[d][i] = float(ray.normal[d]);
      }
    const std::span<const BallChord> moves(chords.data(), std::size_t(near.count));
    const std::array<int, width> nearest_moves = ball_bounds(moves, ray_group, bounds);
    for (std::size_t i = 0; i < ray_count; ++i) {
      const Ray& ray = rays[first_ray + i];
      FirstRemoval search;
      const auto test_move = [&](int move) {
        if (double(bounds[move].min_s[i]) > search.limit(ray)) return;
        const std::optional<Entry> entry =
            first_entry(cutter_, near.moves[move], ray, search.limit(ray));
        if (entry) search.record(make_removal(*entry, near.items[move]), near.items[move]);
      };
      test_move(nearest_moves[i]);
      for (int move = 0; move < near.count; ++move)
        if (move != nearest_moves[i]) test_move(move);
      removals[first_ray + i] = search.best;
      if (search.best) hint.item = search.best_item;
    }
  }
  return true;
}

/// Searches rays together. Returns false if they are too far apart for a joint search to pay.
bool SweepTree::search_patch(std::span<const Ray> rays, std::span<std::optional<Removal>> removals,
                             Hint& hint) const {
  std::vector<double> limits = upper_limits(rays, hint);
  if (limits.empty()) return false;
  const std::optional<PatchSegment> patch = patch_segment(rays, limits);
  NearMoves near;
  // The closed form of a ball tests every near move for every ray, which does not pay for many
  // moves.
  near.max_count = is_ball(cutter_) ? std::min(NearMoves::capacity, 2 * int(rays.size()) + 16)
                                    : NearMoves::capacity;
  if (!patch || !collect_near_moves(*patch, near, hint)) return false;
  if (near.count == 0)
    std::fill(removals.begin(), removals.end(), std::nullopt);
  else if (!search_near_balls(rays, removals, *patch, near, hint))
    search_near_moves(rays, limits, removals, near, hint);
  return true;
}

// The number of rays searched together halves on failure and doubles after a series of successes,
// so that it adapts to the density of the vertices.
void SweepTree::first_removals(std::span<const Ray> rays,
                               std::span<std::optional<Removal>> removals, Hint& hint) const {
  for (const Ray& ray : rays)
    require(ray.band == rays.front().band, "sweep: expected rays that all have the same band");
  for (std::size_t i = 0; i < rays.size();) {
    const std::size_t count = std::min(hint.group_size, rays.size() - i);
    if (count >= Hint::min_group_size &&
        search_patch(rays.subspan(i, count), removals.subspan(i, count), hint)) {
      if (++hint.success_count == Hint::successes_before_growth) {
        hint.group_size = std::min(2 * hint.group_size, Hint::max_group_size);
        hint.success_count = 0;
      }
      hint.single_count = Hint::min_group_size;
      i += count;
      continue;
    }
    if (count >= 2 * Hint::min_group_size) {
      hint.group_size = count / 2;
      hint.success_count = 0;
      continue;
    }
    const std::size_t end = std::min(i + hint.single_count, rays.size());
    for (; i < end; ++i) removals[i] = first_removal(rays[i], hint);
    hint.single_count = std::min(2 * hint.single_count, Hint::max_single_count);
  }
}

std::vector<Removal> SweepTree::removals_within(const Ray& ray, double reach, Hint& hint) const {
  const std::optional<Removal> first = first_removal(ray, hint);
  if (!first || first->s <= -ray.band) return {};
  const double limit = std::min(first->s + reach, ray.band);
  const double end_s = std::min(limit + entry_margin, ray.band);
  RemovalCollection collection{
      {.ray = ray, .segment = ray_segment(ray, end_s), .hint = hint}, limit, {}};
  descend(collection);
  std::vector<Removal>& removals = collection.removals;
  std::sort(removals.begin(), removals.end(), [](const Removal& a, const Removal& b) {
    return std::tie(a.move, a.part) < std::tie(b.move, b.part);
  });
  return std::move(removals);
}

}  // namespace abbe::cutting
