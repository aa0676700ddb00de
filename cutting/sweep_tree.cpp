#include "cutting/sweep_tree.h"

#include <algorithm>
#include <array>
#include <bit>
#include <tuple>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

namespace abbe::cutting {

using Eigen::Vector3d;

/// What a walk through the tree is for, along as much of its ray as is open.
struct SweepTree::Aim {
  const Ray& ray;
  RayStretch open;
  Hint& hint;
  int done_leaf = -1;
  int done_item = -1;
  int cuts = 0;  // that made the ray shorter
  bool buried = false;
};

struct SweepTree::Search : Aim {
  std::optional<Removal> best;
  int best_item = -1;
};

struct SweepTree::Collection : Aim {
  double limit;  // mm along the ray
  std::vector<Removal> found;
};

// ---- building -----------------------------------------------------------------------------------

SweepTree::SweepTree(const Cutter& cutter, const CutterMotion& motion)
    : cutter_(cutter), motion_(motion) {
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
        keys[first[i] + part] = {{float(k.x()), float(k.y()), float(k.z())},
                                 {i, std::uint16_t(part), std::uint16_t(parts)}};
      }
    }
  });
  gather(keys);
  std::vector<Item> items(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) items[i] = keys[i].item;
  return items;
}

/// Orders items so that each run of 8, 64, 512 ... of them, counted from the first, keeps close
/// together: ranges are halved across their longest side, at a whole number of runs.
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
  std::array<float, 3> low = keys.front().k, high = low;
  for (const Key& key : keys)
    for (int d = 0; d < 3; ++d) {
      low[d] = std::min(low[d], key.k[d]);
      high[d] = std::max(high[d], key.k[d]);
    }
  int d = 0;
  for (const int other : {1, 2})
    if (high[other] - low[other] > high[d] - low[d]) d = other;
  const std::size_t half = runs / 2 * run;
  std::nth_element(keys.begin(), keys.begin() + std::ptrdiff_t(half), keys.end(),
                   [&](const Key& a, const Key& b) {
                     return a.k[d] != b.k[d] ? a.k[d] < b.k[d] : order(a.item) < order(b.item);
                   });
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

// ---- searching ----------------------------------------------------------------------------------

void SweepTree::try_item(int item, Search& search) const {
  const Item& it = items_[item];
  const double best = search.best ? search.best->s : search.ray.band;
  const double limit = std::min(best + entry_margin, search.ray.band);
  const std::optional<Entry> entry =
      first_entry(cutter_, move_of(item, search.hint), search.ray, limit);
  if (!entry || entry->s > search.ray.band) return;
  const auto order = [](double s, int move, int part) { return std::tuple(s, move, part); };
  if (search.best && order(search.best->s, search.best->move, search.best->part) <=
                         order(entry->s, it.move, it.part))
    return;
  search.best = Removal{entry->s, entry->t, it.move, it.part};
  search.best_item = item;
  search.buried = entry->s <= -search.ray.band;
  ++search.cuts;
  search.open.end.cut_off(search.ray, std::min(entry->s + entry_margin, search.ray.band), centre_);
}

void SweepTree::try_item(int item, Collection& collection) const {
  const Item& it = items_[item];
  const std::optional<Entry> entry =
      first_entry(cutter_, move_of(item, collection.hint), collection.ray, collection.limit);
  if (entry) collection.found.push_back({entry->s, entry->t, it.move, it.part});
}

// The nearest of what is open comes first, as what it cuts off rules out most of the rest: whenever
// the ray has become shorter, what waits is held against it again, eight at a time.

template <class Wanted>
void SweepTree::search_leaf(int leaf, Wanted& wanted) const {
  const auto open_now = [&] {
    return open_moves(leaves_.moves[leaf], leaves_.places[leaf], wanted.open);
  };
  OpenEight open = open_now();
  while (open.bits != 0 && !wanted.buried) {
    const int i = open.nearest();
    open.bits &= ~(1u << i);
    const int cuts = wanted.cuts;
    if (leaf * width + i != wanted.done_item) try_item(leaf * width + i, wanted);
    if (wanted.cuts != cuts && open.bits != 0) open.bits &= open_now().bits;
  }
}

template <class Wanted>
void SweepTree::descend(Wanted& wanted) const {
  struct Visit {
    int level;
    int index;
    int cuts;  // of the ray when it was held against
    OpenEight open;
  };
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

RayStretch SweepTree::stretch_of(const Ray& ray, double cut_off) const {
  return {cutter_, ray, cut_off, centre_, reach_};
}

std::optional<Removal> SweepTree::first_removal(const Ray& ray, Hint& hint) const {
  if (items_.empty()) return std::nullopt;
  Search search{{.ray = ray, .open = stretch_of(ray, ray.band), .hint = hint}, std::nullopt};
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
