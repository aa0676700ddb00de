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

/// The state of a walk through the tree along the part of the ray that is still open.
struct SweepTree::Aim {
  const Ray& ray;
  RaySegment open;
  Hint& hint;
  int done_leaf = -1;
  int done_item = -1;
  int cuts = 0;  // number of cuts that made the ray shorter
  bool buried = false;
};

/// The first removal of a ray so far.
struct SweepTree::First {
  std::optional<Removal> best;
  int best_item = -1;

  /// Returns the s (mm) beyond which nothing is of interest.
  double limit(const Ray& ray) const {
    return best ? std::min(best->s + entry_margin, ray.band) : ray.band;
  }
  /// @return true if it comes before the first removal so far
  bool take(const Removal& removal, int item) {
    const auto order = [](const Removal& one) { return std::tuple(one.s, one.move, one.part); };
    if (best && order(*best) <= order(removal)) return false;
    best = removal;
    best_item = item;
    return true;
  }
};

struct SweepTree::Search : Aim, First {
  double limit() const { return First::limit(ray); }
};

struct SweepTree::Collection : Aim {
  double end;  // mm along the ray
  std::vector<Removal> found;

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

  // Moves at the same position whose axes lean apart cover different regions; in one node their
  // bound would be that of a cone of axes. The axis times a lever therefore counts as three more
  // coordinates.
  const double lever = 0.5 * std::max(cutter_.flank_length, cutter_.radius);
  std::vector<int> first(std::size_t(moves) + 1, 0);
  for (int i = 0; i < moves; ++i) first[i + 1] = first[i] + parts_of(motion_, i);
  std::vector<Key> keys(first.back());
  tbb::parallel_for(tbb::blocked_range<int>(0, moves, 4096), [&](const auto& range) {
    for (int i = range.begin(); i < range.end(); ++i) {
      const int next = std::min(i + 1, samples - 1);
      const int parts = first[i + 1] - first[i];
      for (int part = 0; part < parts; ++part) {
        const double t = (part + 0.5) / parts;
        const Vector3d tip = (1 - t) * motion_.tip.row(i) + t * motion_.tip.row(next);
        const Vector3d axis = motion_.axis.row(i) + motion_.axis.row(next);
        const Vector3d k = tip + 0.5 * cutter_.corner_radius * axis - centre_;
        const Vector3d arm = lever * axis;
        keys[first[i] + part] = {{float(k.x()), float(k.y()), float(k.z()), float(arm.x()),
                                  float(arm.y()), float(arm.z())},
                                 {i, std::uint16_t(part), std::uint16_t(parts)}};
      }
    }
  });
  gather(keys);
  std::vector<Item> items(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) items[i] = keys[i].item;
  return items;
}

/// Orders the items so that each run of 8, 64, 512 ... of them, counted from the first, is compact:
/// ranges are halved across their longest side, at a whole number of runs.
void SweepTree::gather(std::span<Key> keys) {
  const auto order = [](const Item& item) { return std::tuple(item.move, item.part); };
  if (keys.size() <= width) {
    std::sort(keys.begin(), keys.end(),
              [&](const Key& a, const Key& b) { return order(a.item) < order(b.item); });
    return;
  }
  std::size_t run = width;
  while (run * width < keys.size()) run *= width;
  const std::size_t runs = (keys.size() + run - 1) / run;
  std::array<float, 6> low = keys.front().k, high = low;
  for (const Key& key : keys)
    for (std::size_t d = 0; d < low.size(); ++d) {
      low[d] = std::min(low[d], key.k[d]);
      high[d] = std::max(high[d], key.k[d]);
    }
  std::size_t d = 0;
  for (std::size_t other = 1; other < low.size(); ++other)
    if (high[other] - low[other] > high[d] - low[d]) d = other;
  const std::size_t half = runs / 2 * run;
  std::nth_element(keys.begin(), keys.begin() + std::ptrdiff_t(half), keys.end(),
                   [&](const Key& a, const Key& b) {
                     return a.k[d] != b.k[d] ? a.k[d] < b.k[d] : order(a.item) < order(b.item);
                   });
  // items; a smaller range is ordered faster than a task is started
  constexpr std::size_t worth_a_thread = 4096;
  const auto first = [&] { gather(keys.first(half)); };
  const auto rest = [&] { gather(keys.subspan(half)); };
  if (keys.size() > worth_a_thread) {
    tbb::parallel_invoke(first, rest);
  } else {
    first();
    rest();
  }
}

Move SweepTree::move_of(const Item& item) const {
  return part_of(motion_, item.move, item.part, item.parts);
}

const Move& SweepTree::move_of(int item, Hint& hint) const {
  Hint::Tried& known = hint.tried[std::size_t(item) % hint.tried.size()];
  if (known.item != item) known = {item, move_of(items_[item])};
  return known.move;
}

void SweepTree::make_leaves() {
  const std::size_t count = (items_.size() + width - 1) / width;
  leaves_.moves.resize(count);
  leaves_.places.resize(count);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 256), [&](const auto& range) {
    for (std::size_t l = range.begin(); l < range.end(); ++l) {
      std::array<Move, width> moves;
      const std::size_t used = std::min<std::size_t>(width, items_.size() - l * width);
      for (std::size_t i = 0; i < used; ++i) moves[i] = move_of(items_[l * width + i]);
      put(leaves_, l, cutter_, {moves.data(), used});
    }
  });
}

int SweepTree::children(std::size_t level, int node) const {
  const std::size_t all = level == 0 ? leaves_.moves.size() : levels_[level - 1].size();
  return int(std::min<std::size_t>(width, all - std::size_t(node) * width));
}

void SweepTree::make_nodes() {
  const std::size_t leaves = leaves_.moves.size();
  std::size_t below_count = leaves;
  while (below_count > 0 && (levels_.empty() || below_count > 1)) {
    const std::size_t level = levels_.size();
    std::vector<SweepNode> nodes((below_count + width - 1) / width);
    levels_.emplace_back();
    const std::size_t leaves_a_child = std::size_t(1) << (3 * level);
    tbb::parallel_for(tbb::blocked_range<int>(0, int(nodes.size()), 64), [&](const auto& range) {
      for (int n = range.begin(); n < range.end(); ++n) {
        const int used = children(level, n);
        for (int i = 0; i < width; ++i) {
          const std::size_t child = std::size_t(n * width + std::min(i, used - 1));
          put(nodes[n], i,
              level == 0 ? bounds_of(leaves_, child)
                         : bounds_of(levels_[level - 1][child], children(level - 1, int(child)),
                                     centre_, leaves_, child * leaves_a_child,
                                     std::min((child + 1) * leaves_a_child, leaves)),
              centre_);
        }
      }
    });
    below_count = nodes.size();
    levels_[level] = std::move(nodes);
  }
}

// Search.

Removal SweepTree::removal_of(const Entry& entry, int item) const {
  return {entry.s, entry.t, items_[item].move, items_[item].part};
}

void SweepTree::take(const std::optional<Entry>& entry, int item, Search& search) const {
  if (!entry || !search.First::take(removal_of(*entry, item), item)) return;
  search.buried = entry->s <= -search.ray.band;
  ++search.cuts;
  search.open.end.cut_off(search.ray, std::min(entry->s + entry_margin, search.ray.band), centre_);
}

void SweepTree::take(const std::optional<Entry>& entry, int item, Collection& collection) const {
  if (entry) collection.found.push_back(removal_of(*entry, item));
}

template <class Wanted>
void SweepTree::try_item(int item, Wanted& wanted) const {
  take(first_entry(cutter_, move_of(item, wanted.hint), wanted.ray, wanted.limit()), item, wanted);
}

// The nearest open child comes first, because its cut rules out most of the others: whenever the
// ray has become shorter, the waiting ones are tested again, eight at a time.

template <class Wanted>
void SweepTree::search_leaf(int leaf, Wanted& wanted) const {
  const SweepLeaf& moves = leaves_.moves[leaf];
  const SweepLeafPlace& place = leaves_.places[leaf];
  Open8 open = open_moves(moves, place, wanted.open);
  if (std::popcount(open.bits) > 1 && !is_ball(cutter_))
    return search_bounded(leaf, open.bits, wanted);
  while (open.bits != 0 && !wanted.buried) {
    const int i = open.nearest();
    open.bits &= ~(1u << i);
    const int cuts = wanted.cuts;
    if (leaf * width + i != wanted.done_item) try_item(leaf * width + i, wanted);
    if (wanted.cuts != cuts && open.bits != 0)
      open.bits &= open_moves(moves, place, wanted.open).bits;
  }
}

const SweepTree::Hint::LeafBounds& SweepTree::bounded(int leaf, Hint& hint) const {
  Hint::LeafBounds& known = hint.bounded[std::size_t(leaf) % hint.bounded.size()];
  if (known.leaf == leaf) return known;
  known.leaf = leaf;
  for (int i = 0; i < width; ++i) {
    const int item = std::min(leaf * width + i, int(items_.size()) - 1);
    known.ends[std::size_t(i)] = ends_of(move_of(item, hint));
    known.lanes.put(i, cutter_, known.ends[std::size_t(i)]);
  }
  return known;
}

/// Searches several open moves of a leaf: bounds them together and tests them from the least bound
/// on.
template <class Wanted>
void SweepTree::search_bounded(int leaf, unsigned open, Wanted& wanted) const {
  const Hint::LeafBounds& moves = bounded(leaf, wanted.hint);
  EntryBounds bounds;
  entry_bounds(cutter_, moves.lanes, {&wanted.ray, 1}, {&bounds, 1});
  std::array<double, width> least;
  const auto keep_open = [&] {
    for (unsigned left = open; left != 0; left &= left - 1) {
      const int i = std::countr_zero(left);
      if (least[std::size_t(i)] > wanted.limit()) open &= ~(1u << i);
    }
  };
  for (unsigned left = open; left != 0; left &= left - 1) {
    const auto i = std::size_t(std::countr_zero(left));
    least[i] = double(bounds.least[i]);
    if (least[i] > wanted.limit()) continue;
    const Vector3d away(bounds.m[0][i], bounds.m[1][i], bounds.m[2][i]);
    least[i] = min_entry(cutter_, moves.ends[i], wanted.ray, away);
  }
  for (keep_open(); open != 0 && !wanted.buried; keep_open()) {
    std::size_t next = std::size_t(std::countr_zero(open));
    for (unsigned left = open & (open - 1); left != 0; left &= left - 1) {
      const auto i = std::size_t(std::countr_zero(left));
      if (least[i] < least[next]) next = i;
    }
    open &= ~(1u << next);
    const int item = leaf * width + int(next);
    if (item == wanted.done_item) continue;
    const Move& move = move_of(item, wanted.hint);
    take(first_entry(cutter_, move, wanted.ray, wanted.limit(), bounds.part[next],
                     bounds.least[next]),
         item, wanted);
  }
}

template <class Wanted>
void SweepTree::descend(Wanted& wanted) const {
  struct Visit {
    int level;
    int index;
    int cuts;  // of the ray when `open` was computed
    Open8 open;
  };
  // 12 levels of 8 children hold 6.9e10 leaves, more than an int can number
  std::array<Visit, 12> path;
  int depth = 0;
  const auto visit = [&](int level, int index) {
    path[depth] = {level, index, wanted.cuts, open_children(levels_[level][index], wanted.open)};
    path[depth].open.bits &= (1u << children(level, index)) - 1u;
    ++depth;
  };
  visit(int(levels_.size()) - 1, 0);
  while (depth > 0 && !wanted.buried) {
    Visit& last = path[depth - 1];
    if (last.open.bits != 0 && last.cuts != wanted.cuts) {
      last.open.bits &= open_children(levels_[last.level][last.index], wanted.open).bits;
      last.cuts = wanted.cuts;
    }
    if (last.open.bits == 0) {
      --depth;
      continue;
    }
    const int child = last.open.nearest();
    last.open.bits &= ~(1u << child);
    const int index = last.index * width + child;
    if (last.level > 0)
      visit(last.level - 1, index);
    else if (index != wanted.done_leaf)
      search_leaf(index, wanted);
  }
}

RaySegment SweepTree::stretch_of(const Ray& ray, double cut_off) const {
  return {cutter_, ray, cut_off, centre_, reach_};
}

std::optional<Removal> SweepTree::first_removal(const Ray& ray, Hint& hint) const {
  if (items_.empty()) return std::nullopt;
  Search search{{.ray = ray, .open = stretch_of(ray, ray.band), .hint = hint}, {}};
  // The item of the neighbour's removal, then its leaf: either usually contains the first removal
  // and so shortens the ray before the walk begins.
  if (hint.item >= 0) {
    try_item(hint.item, search);
    search.done_item = hint.item;
    const int leaf = hint.item / width;
    search_leaf(leaf, search);
    search.done_leaf = leaf;
  }
  descend(search);
  if (search.best) hint.item = search.best_item;
  return search.best;
}

// Neighbouring rays. The few moves that they meet near the move met by the rays before give upper
// bounds of the first removals. Moves that no ray can meet up to there are ruled out for all rays
// at once; the remaining moves are bounded for every ray, and tested from the least bound on.

namespace {

/// A box along given axes.
struct Box {
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d high = -low;

  void add(const Vector3d& place) {
    low = low.cwiseMin(place);
    high = high.cwiseMax(place);
  }
  Vector3d middle() const { return 0.5 * (low + high); }
  Vector3d halves() const { return 0.5 * (high - low); }
};

}  // namespace

/// Lowers each ray's limit (mm) to the s at which the search would find that it meets the cutter of
/// a move at instant t, or of moves beside it, or slightly beyond.
void SweepTree::lower(std::span<double> limits, std::span<const Ray> rays, int item, double t,
                      Hint& hint) const {
  if (is_ball(cutter_)) return lower_to_ball(limits, rays, cutter_, move_of(item, hint), t);
  const int first = item / width * width;
  std::vector<Move> moves(std::min(width, int(items_.size()) - first));
  for (std::size_t k = 0; k < moves.size(); ++k) moves[k] = move_of(first + int(k), hint);
  lower_to_eight(limits, rays, cutter_, moves);
}

/// Returns limits in mm along each ray that do not lie before its first removal; nothing if one of
/// the rays starts, or almost starts, in removed material. They follow from the move that the rays
/// before met and, where that leaves one of them far behind the others, from the first removal of
/// that ray.
std::vector<double> SweepTree::limits_of(std::span<const Ray> rays, Hint& hint) const {
  // The box about the ends of the rays is only as good as the ray that reaches farthest, so up to
  // four of them are searched exactly.
  constexpr int searches = 4;
  const double tight = 0.003 * cutter_.radius, loose = 0.01 * cutter_.radius;
  const double band = rays.front().band;
  std::vector<double> limits(rays.size(), band);
  if (hint.item >= 0) {
    const Move& move = move_of(hint.item, hint);
    lower(limits, rays, hint.item, 0.5 * (move.from + move.to), hint);
  }
  for (int i = 0; i < searches; ++i) {
    const auto [least, most] = std::minmax_element(limits.begin(), limits.end());
    if (*least <= 1e-5 - band) return {};
    if (*most - *least < (i == 0 ? tight : loose) && hint.item >= 0) break;
    const std::size_t next = i == 0 ? rays.size() / 2 : std::size_t(most - limits.begin());
    const std::optional<Removal> removal = first_removal(rays[next], hint);
    if (removal && removal->s <= -band) return {};
    if (!removal) break;
    limits[next] = std::min(limits[next], removal->s + entry_margin);
    lower(limits, rays, hint.item, removal->t, hint);
  }
  return limits;
}

/// Returns the common bound of the rays; nothing unless they all lean from their mean by less than
/// 45 deg.
std::optional<PatchSegment> SweepTree::patch_of(std::span<const Ray> rays,
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
    const Vector3d place = ray.point - origin;
    ends.add(axes.transpose() * (place + limits[i] * ray.normal));
    starts.add(axes.transpose() * (place - ray.band * ray.normal));
    min_cosine = std::min(min_cosine, ray.normal.dot(axes.col(2)));
  }
  if (!(min_cosine > 0.7)) return std::nullopt;
  // The cosine of a small angle has lost half of its digits; 1e-14 restores the bound.
  const double tangent =
      std::sqrt(std::max(0.0, 1.0 - min_cosine * min_cosine) + 1e-14) / min_cosine;
  const auto end = [&](const Box& box, double sense) {
    const Ray middle{origin + axes * box.middle(), sense * axes.col(2), rays.front().band};
    return PatchEnd({cutter_, middle, 0.0, centre_, reach_}, axes, box.halves(), tangent);
  };
  return PatchSegment{end(ends, 1.0), end(starts, -1.0)};
}

/// Collects the moves that the rays may meet. @return false if there are more than `near` may hold
bool SweepTree::gather_near(const PatchSegment& rays, NearMoves& near, Hint& hint) const {
  struct Visit {
    int level, index;
  };
  std::array<Visit, 12 * width> waiting;
  int depth = 0;
  waiting[depth++] = {int(levels_.size()) - 1, 0};
  while (depth > 0) {
    const auto [level, index] = waiting[--depth];
    unsigned open = open_children(levels_[level][index], rays).bits;
    open &= (1u << children(level, index)) - 1u;
    for (; open != 0; open &= open - 1) {
      const int child = index * width + std::countr_zero(open);
      if (level > 0) {
        waiting[depth++] = {level - 1, child};
        continue;
      }
      unsigned moves = open_moves(leaves_.moves[child], leaves_.places[child], rays).bits;
      if (near.count + std::popcount(moves) > near.most) return false;
      for (; moves != 0; moves &= moves - 1) {
        const int item = child * width + std::countr_zero(moves);
        near.items[near.count] = item;
        near.moves[near.count++] = move_of(item, hint);
      }
    }
  }
  return true;
}

/// Returns the first removal of a ray by the moves of its pairs.
SweepTree::First SweepTree::nearest_of(const NearMoves& near, const NearMoves8& all,
                                       const NearPairs& pairs, std::size_t first, std::size_t end,
                                       const Ray& ray) const {
  First search;
  if (first == end) return search;
  const auto attempt = [&](std::size_t pair) {
    const int k = pairs.moves[pair];
    const double limit = search.limit(ray);
    const std::optional<Entry> entry =
        is_ball(cutter_)
            ? first_entry(cutter_, near.moves[k], ray, limit)
            : first_entry(cutter_, near.moves[k], ray, limit, pairs.part(pair), pairs.least(pair));
    if (entry) search.take(removal_of(*entry, near.items[k]), near.items[k]);
  };
  std::size_t best = first;
  for (std::size_t pair = first + 1; pair < end; ++pair)
    if (pairs.least(pair) < pairs.least(best)) best = pair;
  if (!(double(pairs.least(best)) > search.limit(ray))) attempt(best);
  // Moves that single precision cannot distinguish from the best follow in the order of a bound in
  // double precision.
  std::size_t competing_passes = 0;
  std::array<std::pair<double, std::size_t>, NearMoves::room> by_least;
  for (std::size_t pair = first; pair < end; ++pair) {
    if (pair == best || double(pairs.least(pair)) > search.limit(ray)) continue;
    const double sharper = min_entry(cutter_, all.ends[pairs.moves[pair]], ray, pairs.away(pair));
    if (sharper <= search.limit(ray)) by_least[competing_passes++] = {sharper, pair};
  }
  std::sort(by_least.begin(), by_least.begin() + competing_passes);
  for (std::size_t r = 0; r < competing_passes && by_least[r].first <= search.limit(ray); ++r)
    attempt(by_least[r].second);
  return search;
}

/// Searches a few rays at a time with common planes, which rule out most moves for each of them.
void SweepTree::search_near(std::span<const Ray> rays, std::span<double> limits,
                            std::span<std::optional<Removal>> found, const NearMoves& near,
                            Hint& hint) const {
  constexpr std::size_t few = Move8::width;
  constexpr std::size_t many = 8;  // eights of moves, for which lower limits repay their cost
  const NearMoves8 all(cutter_, near);
  NearPairs pairs;
  std::array<std::size_t, few + 1> first_pair;
  for (std::size_t first = 0; first < rays.size(); first += few) {
    const std::size_t end = std::min(first + few, rays.size());
    const std::span<const Ray> beside = rays.subspan(first, end - first);
    const NearPlanes planes(cutter_, all, beside);
    if (all.count > many)
      lower_by_planes(limits.subspan(first, beside.size()), beside, cutter_, near, all, planes);
    for (std::size_t i = first; i < end;) {
      const std::size_t begun = i;
      pairs.count = 0;
      for (; i < end && pairs.count <= NearMoves::room; ++i) {
        first_pair[i - begun] = pairs.count;
        pairs.add_open(all, near.count, planes, rays[i], limits[i]);
      }
      first_pair[i - begun] = pairs.count;
      pairs.bound(all, cutter_, rays[i - 1]);
      for (std::size_t j = begun; j < i; ++j) {
        const First search =
            nearest_of(near, all, pairs, first_pair[j - begun], first_pair[j - begun + 1], rays[j]);
        found[j] = search.best;
        if (search.best) hint.item = search.best_item;
      }
    }
  }
}

/// Searches neighbouring rays with bounds of ball ends in closed form.
/// @return false if the bounds do not apply: they require that only the lower half of the ball is
///         met, and that it is near
bool SweepTree::search_near_balls(std::span<const Ray> rays,
                                  std::span<std::optional<Removal>> found,
                                  const PatchSegment& patch, const NearMoves& near,
                                  Hint& hint) const {
  if (!is_ball(cutter_)) return false;
  const RayEnd& end = patch.end.end;
  const Vector3d origin(end.point[0], end.point[1], end.point[2]),
      normal(end.n[0], end.n[1], end.n[2]);
  const double around = Vector3d(patch.end.half[0], patch.end.half[1], patch.end.half[2]).norm();
  double far = 0.0;
  for (const Ray& ray : rays) far = std::max(far, (ray.point - origin).norm());
  std::array<BallChord, NearMoves::room> chords;
  for (int k = 0; k < near.count; ++k) {
    chords[k] = BallChord(cutter_, near.moves[k], origin);
    // ball_bounds requires less than 5 radii
    if (!(chords[k].distance + far < 4.9 * cutter_.radius) ||
        !stays_below_centre(cutter_, near.moves[k], origin, around, normal, patch.end.tilt))
      return false;
  }
  std::array<Entry8, NearMoves::room> bounds;
  for (std::size_t i0 = 0; i0 < rays.size(); i0 += width) {
    Ray8 eight;
    const std::size_t used = std::min<std::size_t>(width, rays.size() - i0);
    for (std::size_t i = 0; i < width; ++i)
      for (int d = 0; d < 3; ++d) {
        const Ray& ray = rays[i0 + std::min(i, used - 1)];
        eight.p[d][i] = float(ray.point[d] - origin[d]);
        eight.n[d][i] = float(ray.normal[d]);
      }
    const std::span<const BallChord> moves(chords.data(), std::size_t(near.count));
    const std::array<int, width> least = ball_bounds(moves, eight, bounds);
    for (std::size_t i = 0; i < used; ++i) {
      const Ray& ray = rays[i0 + i];
      First search;
      const auto attempt = [&](int k) {
        if (double(bounds[k].least[i]) > search.limit(ray)) return;
        const std::optional<Entry> entry =
            first_entry(cutter_, near.moves[k], ray, search.limit(ray));
        if (entry) search.take(removal_of(*entry, near.items[k]), near.items[k]);
      };
      attempt(least[i]);
      for (int k = 0; k < near.count; ++k)
        if (k != least[i]) attempt(k);
      found[i0 + i] = search.best;
      if (search.best) hint.item = search.best_item;
    }
  }
  return true;
}

/// Searches rays together. @return false if they are too far apart for it to be worthwhile
bool SweepTree::search_patch(std::span<const Ray> rays, std::span<std::optional<Removal>> found,
                             Hint& hint) const {
  std::vector<double> limits = limits_of(rays, hint);
  if (limits.empty()) return false;
  const std::optional<PatchSegment> patch = patch_of(rays, limits);
  NearMoves near;
  // the closed form of a ball tests every near move for every ray, which does not pay for many
  // moves
  near.most =
      is_ball(cutter_) ? std::min(NearMoves::room, 2 * int(rays.size()) + 16) : NearMoves::room;
  if (!patch || !gather_near(*patch, near, hint)) return false;
  if (near.count == 0)
    std::fill(found.begin(), found.end(), std::nullopt);
  else if (!search_near_balls(rays, found, *patch, near, hint))
    search_near(rays, limits, found, near, hint);
  return true;
}

// The number of rays searched together halves on failure and doubles after a series of successes,
// so that it adapts to the density of the vertices.
void SweepTree::first_removals(std::span<const Ray> rays, std::span<std::optional<Removal>> found,
                               Hint& hint) const {
  for (const Ray& ray : rays)
    require(ray.band == rays.front().band, "sweep: expected rays of one band");
  for (std::size_t i = 0; i < rays.size();) {
    const std::size_t count = std::min(hint.beside, rays.size() - i);
    if (count >= Hint::min_beside &&
        search_patch(rays.subspan(i, count), found.subspan(i, count), hint)) {
      if (++hint.runs == Hint::runs_before_growth) {
        hint.beside = std::min(2 * hint.beside, Hint::max_beside);
        hint.runs = 0;
      }
      hint.alone = Hint::min_beside;
      i += count;
      continue;
    }
    if (count >= 2 * Hint::min_beside) {
      hint.beside = count / 2;
      hint.runs = 0;
      continue;
    }
    const std::size_t end = std::min(i + hint.alone, rays.size());
    for (; i < end; ++i) found[i] = first_removal(rays[i], hint);
    hint.alone = std::min(2 * hint.alone, Hint::max_alone);
  }
}

std::vector<Removal> SweepTree::removals_within(const Ray& ray, double reach, Hint& hint) const {
  const std::optional<Removal> first = first_removal(ray, hint);
  if (!first || first->s <= -ray.band) return {};
  const double limit = std::min(first->s + reach, ray.band);
  const double cut_off = std::min(limit + entry_margin, ray.band);
  Collection collection{{.ray = ray, .open = stretch_of(ray, cut_off), .hint = hint}, limit, {}};
  descend(collection);
  std::vector<Removal>& found = collection.found;
  std::sort(found.begin(), found.end(), [](const Removal& a, const Removal& b) {
    return std::tie(a.move, a.part) < std::tie(b.move, b.part);
  });
  return std::move(found);
}

}  // namespace abbe::cutting
