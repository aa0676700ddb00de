#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cutting/surface/near_moves.h"
#include "cutting/surface/removal.h"
#include "cutting/surface/sweep_bounds.h"

namespace abbe::cutting {

/// All moves of a cutter in a hierarchy of bounding volumes, 8 children a node, for finding the
/// first removal along rays. Immutable once made; about 75 bytes a move, 90 while it is made.
/// A move whose axis turns by more than 0.05 rad counts as several.
/// What it answers is, bit for bit, what trying every move answers (`removal.h`).
class SweepTree {
 public:
  /// @param cutter  convex
  /// @param motion  outlives the tree, as the tree refers to it
  SweepTree(const Cutter& cutter, const CutterMotion& motion);

  /// What is known from rays nearby: a place in the tree to start from, that of the removal found
  /// for the last, and the moves that were tried most recently. Of one tree only: the moves of
  /// another would be taken for its own. 80 kB, so a run of rays shares one.
  struct Hint {
    struct Tried {
      int item = -1;
      Move move;
    };
    /// The moves of a leaf, as they are bounded.
    struct LeafBounds {
      int leaf = -1;
      Move8 lanes;
      std::array<MoveEndpoints, SweepLeaf::width> ends;
    };
    int item = -1;
    std::array<Tried, 256> tried = {};        ///< at the item's number modulo their count
    std::array<LeafBounds, 32> bounded = {};  ///< the same of leaves
    static constexpr std::size_t max_beside = 32, min_beside = 8, max_alone = 512;
    static constexpr int runs_before_growth = 8;
    std::size_t beside = max_beside;  ///< rays that are looked at together, as that went well
    int runs = 0;                     ///< that went well in this number since it last changed
    std::size_t alone = min_beside;   ///< or one by one, before that is tried again
  };

  /// First removal along the ray: smallest s, of equal ones the earliest move; if the ray starts in
  /// removed material, any move that removed it. Does not depend on the hint, which is replaced by
  /// the place of the result.
  std::optional<Removal> first_removal(const Ray& ray, Hint& hint) const;

  /// The same of rays in an order in which neighbours are near to each other, which share walks
  /// through the tree.
  /// @param rays   of one band
  /// @param found  (rays)
  /// @throws std::invalid_argument if their bands differ
  void first_removals(std::span<const Ray> rays, std::span<std::optional<Removal>> found,
                      Hint& hint) const;

  /// First removal of every move, or part of one, that comes within `reach` (mm) of the first of
  /// all, in the order of the motion. Empty if there is none, or if the ray starts in removed
  /// material.
  std::vector<Removal> removals_within(const Ray& ray, double reach, Hint& hint) const;

 private:
  static constexpr int width = SweepNode::width;

  /// Part number `part` of `parts` of a move.
  struct Item {
    std::int32_t move;
    std::uint16_t part;
    std::uint16_t parts;
  };
  struct First;
  struct Aim;
  struct Search;
  struct Collection;

  struct Key {
    std::array<float, 6> k;  // mm, about the centre, and the axis times a lever
    Item item;
  };

  std::vector<Item> sorted_items();
  static void gather(std::span<Key> keys);
  void make_leaves();
  void make_nodes();
  int children(std::size_t level, int node) const;

  template <class Wanted>
  void descend(Wanted& wanted) const;
  template <class Wanted>
  void search_leaf(int leaf, Wanted& wanted) const;
  template <class Wanted>
  void search_bounded(int leaf, unsigned open, Wanted& wanted) const;
  const Hint::LeafBounds& bounded(int leaf, Hint& hint) const;
  void lower(std::span<double> limits, std::span<const Ray> rays, int item, double t,
             Hint& hint) const;
  std::vector<double> limits_of(std::span<const Ray> rays, Hint& hint) const;
  std::optional<PatchSegment> patch_of(std::span<const Ray> rays,
                                       std::span<const double> limits) const;
  bool gather_near(const PatchSegment& rays, NearMoves& near, Hint& hint) const;
  bool search_patch(std::span<const Ray> rays, std::span<std::optional<Removal>> found,
                    Hint& hint) const;
  void search_near(std::span<const Ray> rays, std::span<double> limits,
                   std::span<std::optional<Removal>> found, const NearMoves& near,
                   Hint& hint) const;
  First nearest_of(const NearMoves& near, const NearMoves8& eights, const NearPairs& pairs,
                   std::size_t first, std::size_t end, const Ray& ray) const;
  bool search_near_balls(std::span<const Ray> rays, std::span<std::optional<Removal>> found,
                         const PatchSegment& patch, const NearMoves& near, Hint& hint) const;
  Removal removal_of(const Entry& entry, int item) const;
  void take(const std::optional<Entry>& entry, int item, Search& search) const;
  void take(const std::optional<Entry>& entry, int item, Collection& collection) const;
  template <class Wanted>
  void try_item(int item, Wanted& wanted) const;
  RaySegment stretch_of(const Ray& ray, double cut_off) const;
  Move move_of(const Item& item) const;
  const Move& move_of(int item, Hint& hint) const;

  Cutter cutter_;
  const CutterMotion& motion_;
  std::vector<Item> items_;
  SweepLeaves leaves_;
  std::vector<std::vector<SweepNode>> levels_;        // levels_[0] holds leaves, the last the root
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();  // the nodes' floats are about it
  double reach_ = 0.0;                                // mm, as in RayEnd
};

}  // namespace abbe::cutting
