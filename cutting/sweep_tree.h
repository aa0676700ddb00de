#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "cutting/cutter_entry.h"
#include "cutting/sweep.h"
#include "cutting/tool.h"

namespace abbe::cutting {

/// What removed the material at the start of the machined surface along a ray.
struct Removal {
  double s = 0.0;  ///< mm along the normal; -band if the ray starts in removed material
  double t = 0.0;  ///< instant within the move, 0 .. 1
  int move = 0;    ///< the move from sample `move` to the next
  int part = 0;    ///< of the move, if it counts as several
};

/// The parts of at most 0.05 rad as which a move counts if its axis turns by more.
int parts_of(const CutterMotion& motion, int move);
Move part_of(const CutterMotion& motion, int move, int part);

/// All moves of a cutter in a hierarchy of bounding volumes, 8 children a node, for finding the
/// first removal along rays. Immutable once made; about 75 bytes a move, 90 while it is made.
/// A move whose axis turns by more than 0.05 rad counts as several.
class SweepTree {
 public:
  /// @param motion  outlives the tree, as the tree refers to it
  SweepTree(const Cutter& cutter, const CutterMotion& motion);

  /// A place in the tree to start from: that of the removal found for a ray nearby.
  struct Hint {
    int item = -1;
  };

  /// First removal along the ray: smallest s, of equal ones the earliest move. Does not depend on
  /// the hint, which is replaced by the place of the result.
  std::optional<Removal> first_removal(const Ray& ray, Hint& hint) const;

  /// First removal of every move, or part of one, that comes within `reach` (mm) of the first of
  /// all, in the order of the motion. Empty if there is none, or if the ray starts in removed
  /// material.
  std::vector<Removal> removals_within(const Ray& ray, double reach, Hint& hint) const;

 private:
  static constexpr int width = 8;

  /// Part number `part` of `parts` of a move.
  struct Item {
    std::int32_t move;
    std::uint16_t part;
    std::uint16_t parts;
  };
  /// Eight moves by the centre k of the corner circle's plane and the axis u at both ends, in float
  /// about an origin of their own; they only serve to rule moves out.
  struct alignas(32) Leaf {
    float k0[3][width];
    float k1[3][width];
    float u0[3][width];
    float u1[3][width];
  };
  struct LeafOrigin {
    double origin[3];
    float reach;  // mm, from the origin to the farthest point of a cutter
    float slack;  // mm, by which k may leave its chords, and the rounding of the leaf
    std::int32_t count;
  };
  /// Boxes of k, slabs of k across its flattest direction, both rounded outward, and cones of u of
  /// eight children.
  struct alignas(32) Node {
    float low[3][width];
    float high[3][width];
    float flat[3][width];    // unit to rounding
    float flat_low[width];   // flat * (k - corner of the box at low) is at least
    float flat_high[width];  // and at most this
    float cone[3][width];
    float cos_spread[width];
    float sin_spread[width];
  };
  struct Bounds;
  struct Query;
  struct Aim;
  struct Search;
  struct Collection;

  std::vector<Item> sorted_items();
  void make_leaves();
  void make_nodes();
  Bounds item_bounds(const Item& item) const;
  Bounds leaf_bounds(int leaf) const;
  Bounds node_bounds(const Node& node, int children, std::size_t first_leaf,
                     std::size_t end_leaf) const;
  void add_slab(Bounds& bounds, std::size_t first_leaf, std::size_t end_leaf) const;
  void place(Node& node, int child, const Bounds& bounds) const;
  int children(std::size_t level, int node) const;

  template <bool ball>
  unsigned open_children(const Node& node, const Query& query, float* separation) const;
  template <bool ball>
  unsigned open_moves(int leaf, const Query& query) const;
  template <bool ball, class Wanted>
  void descend(Wanted& wanted) const;
  template <bool ball, class Wanted>
  void search_leaf(int leaf, Wanted& wanted) const;
  void try_item(int item, Search& search) const;
  void try_item(int item, Collection& collection) const;
  Query query_of(const Ray& ray, double cut_off) const;
  Move move_of(const Item& item) const;

  Cutter cutter_;
  const CutterMotion& motion_;
  std::vector<Item> items_;
  std::vector<Leaf> leaves_;
  std::vector<LeafOrigin> origins_;
  std::vector<std::vector<Node>> levels_;  // levels_[0] holds leaves, the last one the root
  double centre_[3] = {0, 0, 0};           // the nodes' floats are about it
  float doubt_ = 0.0f;                     // mm, rounding of a node's test
};

}  // namespace abbe::cutting
