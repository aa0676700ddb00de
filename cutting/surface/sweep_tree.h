#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cutting/surface/near_moves.h"
#include "cutting/surface/removal.h"
#include "cutting/surface/sweep_bounds.h"

/// The bounding volume hierarchy over all moves of a cutter.
namespace abbe::cutting {

/// All moves of a cutter in a hierarchy of bounding volumes with 8 children per node. Finds the
/// first removal along rays, with the same bits as an exhaustive test of all moves (`removal.h`).
/// Immutable once constructed; about 75 bytes per move, 90 during construction. A move whose axis
/// turns by more than 0.05 rad counts as several.
class SweepTree {
 public:
  /// @param cutter  convex
  /// @param motion  must outlive the tree, which refers to it
  SweepTree(const Cutter& cutter, const CutterMotion& motion);

  /// Data carried over from neighbouring rays: the item of the last removal, from which the next
  /// search starts, and the moves tested most recently. A hint belongs to one tree only, because
  /// item numbers differ between trees. It takes 80 kB, so a run of rays shares one.
  struct Hint {
    /// A cached move with its item number.
    struct TestedMove {
      int item = -1;
      Move move;
    };
    /// The cached moves of a leaf in the form required by entry_bounds.
    struct LeafBounds {
      int leaf = -1;
      Move8 moves;
      std::array<MoveEndpoints, SweepLeaf::width> endpoints;
    };
    int item = -1;
    std::array<TestedMove, 256> tested_moves = {};  ///< at the item number modulo the array size
    std::array<LeafBounds, 32> leaf_bounds = {};    ///< at the leaf number modulo the array size
    static constexpr std::size_t max_group_size = 32, min_group_size = 8, max_single_count = 512;
    static constexpr int successes_before_growth = 8;
    std::size_t group_size = max_group_size;  ///< rays searched together; adapts to success
    int success_count = 0;  ///< number of successful searches since `group_size` last changed
    std::size_t single_count = min_group_size;  ///< rays searched one by one before a joint search
                                                ///< is tried again
  };

  /// Returns the first removal along the ray: the smallest s, and the earliest move of equal s; if
  /// the ray starts in removed material, any move that removed it. The result does not depend on
  /// the hint. Sets the hint to the item of the result.
  std::optional<Removal> first_removal(const Ray& ray, Hint& hint) const;

  /// Computes the first removals of several rays. Consecutive rays should be neighbours, since
  /// neighbours share traversals of the tree.
  /// @param rays      of the same band
  /// @param removals  (rays), output
  /// @throws std::invalid_argument if their bands differ
  void first_removals(std::span<const Ray> rays, std::span<std::optional<Removal>> removals,
                      Hint& hint) const;

  /// Returns, in the order of the motion, the first removal by every move or part of a move whose s
  /// is within `reach` (mm) of the first removal. Empty if nothing is removed or if the ray starts
  /// in removed material.
  std::vector<Removal> removals_within(const Ray& ray, double reach, Hint& hint) const;

 private:
  static constexpr int width = SweepNode::width;

  /// Part number `part` of `parts` of a move.
  struct Item {
    std::int32_t move;
    std::uint16_t part;
    std::uint16_t parts;
  };
  struct FirstRemoval;
  struct Traversal;
  struct FirstSearch;
  struct RemovalCollection;

  struct Key {
    std::array<float, 6> k;  // mm, k relative to the centre, and the axis times a lever
    Item item;
  };

  std::vector<Item> sorted_items();
  static void sort_keys(std::span<Key> keys);
  void make_leaves();
  void make_nodes();
  int children(std::size_t level, int node) const;

  template <class Query>
  void descend(Query& query) const;
  template <class Query>
  void search_leaf(int leaf, Query& query) const;
  template <class Query>
  void search_by_bounds(int leaf, unsigned open, Query& query) const;
  const Hint::LeafBounds& leaf_bounds(int leaf, Hint& hint) const;
  void lower_limits(std::span<double> limits, std::span<const Ray> rays, int item, double t,
                    Hint& hint) const;
  std::vector<double> upper_limits(std::span<const Ray> rays, Hint& hint) const;
  std::optional<PatchSegment> patch_segment(std::span<const Ray> rays,
                                            std::span<const double> limits) const;
  bool collect_near_moves(const PatchSegment& rays, NearMoves& near, Hint& hint) const;
  bool search_patch(std::span<const Ray> rays, std::span<std::optional<Removal>> removals,
                    Hint& hint) const;
  void search_near_moves(std::span<const Ray> rays, std::span<double> limits,
                         std::span<std::optional<Removal>> removals, const NearMoves& near,
                         Hint& hint) const;
  FirstRemoval first_removal_of_pairs(const NearMoves& near, const NearMoves8& moves8,
                                      const NearPairs& pairs, std::size_t first, std::size_t end,
                                      const Ray& ray) const;
  bool search_near_balls(std::span<const Ray> rays, std::span<std::optional<Removal>> removals,
                         const PatchSegment& patch, const NearMoves& near, Hint& hint) const;
  Removal make_removal(const Entry& entry, int item) const;
  void record(const std::optional<Entry>& entry, int item, FirstSearch& search) const;
  void record(const std::optional<Entry>& entry, int item, RemovalCollection& collection) const;
  template <class Query>
  void test_item(int item, Query& query) const;
  RaySegment ray_segment(const Ray& ray, double end_s) const;
  Move item_move(const Item& item) const;
  const Move& item_move(int item, Hint& hint) const;

  Cutter cutter_;
  const CutterMotion& motion_;
  std::vector<Item> items_;
  SweepLeaves leaves_;
  std::vector<std::vector<SweepNode>> levels_;  // levels_[0] holds the parents of the leaves, the
                                                // last level the root
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();  // origin of the nodes' floats
  double reach_ = 0.0;                                // mm, as in RayEnd
};

}  // namespace abbe::cutting
