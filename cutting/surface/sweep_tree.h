#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "cutting/surface/near_moves.h"
#include "cutting/surface/removal.h"
#include "cutting/surface/sweep_bounds.h"

/// The hierarchy of bounds over all moves of a cutter.
namespace abbe::cutting {

/// All moves of a cutter in a hierarchy of bounding volumes with 8 children per node, for finding
/// the first removal along rays. Immutable once constructed; about 75 bytes per move, 90 during
/// construction. A move whose axis turns by more than 0.05 rad counts as several. Its results are,
/// bit for bit, those of testing every move (`removal.h`).
class SweepTree {
 public:
  /// @param cutter  convex
  /// @param motion  outlives the tree, as the tree refers to it
  SweepTree(const Cutter& cutter, const CutterMotion& motion);

  /// Data carried over from neighbouring rays: the item from which to start, i.e. that of the last
  /// removal found, and the moves that were tested most recently. A hint belongs to one tree only,
  /// because item numbers differ between trees. 80 kB, so a run of rays shares one.
  struct Hint {
    /// A move that was tested, by its item number.
    struct Tried {
      int item = -1;
      Move move;
    };
    /// The moves of a leaf in the form in which entry_bounds takes them.
    struct LeafBounds {
      int leaf = -1;
      Move8 lanes;
      std::array<MoveEndpoints, SweepLeaf::width> ends;
    };
    int item = -1;
    std::array<Tried, 256> tried = {};        ///< at the item number modulo the array size
    std::array<LeafBounds, 32> bounded = {};  ///< at the leaf number modulo the array size
    static constexpr std::size_t max_beside = 32, min_beside = 8, max_alone = 512;
    static constexpr int runs_before_growth = 8;
    std::size_t beside = max_beside;  ///< rays searched together; adapts to success
    int runs = 0;                     ///< number of successful searches since `beside` last changed
    std::size_t alone = min_beside;   ///< rays searched one by one before a joint search is tried
                                      ///< again
  };

  /// Returns the first removal along the ray: the smallest s, of equal ones the earliest move; if
  /// the ray starts in removed material, any move that removed it. The result does not depend on
  /// the hint, which is replaced by the item of the result.
  std::optional<Removal> first_removal(const Ray& ray, Hint& hint) const;

  /// Computes the first removals of rays in an order in which neighbours are near each other; such
  /// rays share walks through the tree.
  /// @param rays   of the same band
  /// @param found  (rays), output
  /// @throws std::invalid_argument if their bands differ
  void first_removals(std::span<const Ray> rays, std::span<std::optional<Removal>> found,
                      Hint& hint) const;

  /// Returns the first removal of every move, or part of a move, that comes within `reach` (mm) of
  /// the first of all, in the order of the motion. Empty if there is none, or if the ray starts in
  /// removed material.
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
    std::array<float, 6> k;  // mm, k about the centre, and the axis times a lever
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
  std::vector<std::vector<SweepNode>> levels_;  // levels_[0] holds the parents of the leaves, the
                                                // last level the root
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();  // origin of the nodes' floats
  double reach_ = 0.0;                                // mm, as in RayEnd
};

}  // namespace abbe::cutting
