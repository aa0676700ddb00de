#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/tool.h"

/// Bounds that rule out moves which cannot meet a ray, for eight moves or eight groups of moves at
/// a time in single precision. A move that meets the ray between its ends is never ruled out;
/// sweep_bounds.cpp contains the proof. k is the centre of the circle of corner centres, u the tool
/// axis.
namespace abbe::cutting {

/// Eight moves, each by k and u at both ends, in float relative to the origin of their
/// SweepLeafFrame. Index: coordinate, move.
struct alignas(32) SweepLeaf {
  static constexpr int width = 8;
  float k0[3][width];
  float k1[3][width];
  float u0[3][width];
  float u1[3][width];
};
/// Origin and error bounds of a leaf.
struct SweepLeafFrame {
  double origin[3];
  float reach;         ///< mm, largest distance of a point of a cutter from the origin
  float slack;         ///< mm, largest distance of k from the chord of its move, plus rounding
  std::int32_t count;  ///< number of moves; the last one is repeated to fill the leaf
};
/// All leaves of a tree.
struct SweepLeaves {
  std::vector<SweepLeaf> moves;
  std::vector<SweepLeafFrame> frames;
};

/// Bounds of eight groups of moves: a box of k, a slab of k normal to the direction of the least
/// spread of k (both rounded outwards), and a cone of u. In float relative to the centre of the
/// whole motion. Index: coordinate, group.
struct alignas(32) SweepNode {
  static constexpr int width = 8;
  float low[3][width];
  float high[3][width];
  float slab_normal[3][width];  ///< normal of the slab, unit to rounding; zero: no slab
  float slab_low[width];        ///< lower bound of flat . (k - low)
  float slab_high[width];       ///< upper bound of the same
  float cone_axis[3][width];    ///< unit
  float cos_spread[width];      ///< cosine of half the cone angle; -1: any direction
  float sin_spread[width];
};

/// Bounds of one group, in double precision.
struct SweepBounds {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
  Eigen::Vector3d cone_axis = Eigen::Vector3d::UnitZ();
  double spread = 0.0;  ///< rad, half the cone angle; pi: any direction
  Eigen::Vector3d slab_normal = Eigen::Vector3d::Zero();
  double slab_low = 0.0;  ///< lower bound of flat . (k - low)
  double slab_high = 0.0;
};

/// Fills a leaf with one to eight moves.
void fill_leaf(SweepLeaves& leaves, std::size_t leaf, const Cutter& cutter,
               std::span<const Move> moves);
/// Fills one of the eight groups of a node.
void fill_child(SweepNode& node, int child, const SweepBounds& bounds,
                const Eigen::Vector3d& centre);

/// Returns the bounds of a leaf.
SweepBounds sweep_bounds(const SweepLeaves& leaves, std::size_t leaf);
/// Returns the bounds of a node.
/// @param first, end  the leaves below the node
SweepBounds sweep_bounds(const SweepNode& node, int children, const Eigen::Vector3d& centre,
                         const SweepLeaves& leaves, std::size_t first, std::size_t end);

/// A cutter and the end of a truncated ray, in the form required by the bounds.
struct RayEnd {
  double point[3];    ///< mm, end of the ray
  float p[3];         ///< mm, the same relative to the centre of the nodes
  float n[3];         ///< unit, direction of the ray
  float error_bound;  ///< mm, rounding in the bounds of a node
  float reach;        ///< mm, largest distance of a cutter or box from the centre of the nodes
  float radius, corner, ring, flank;
  const ToolOutline* outline;  ///< of a form cutter, else null

  RayEnd(const Cutter& cutter, const Ray& ray, double s, const Eigen::Vector3d& centre,
         double reach_of_nodes);
  /// Truncates the ray at s mm along it.
  void truncate(const Ray& ray, double s, const Eigen::Vector3d& centre);
};

/// A ray from its start to the point where it is truncated.
struct RaySegment {
  RayEnd end;
  RayEnd start;  ///< treated as the end of the reversed ray

  RaySegment(const Cutter& cutter, const Ray& ray, double s, const Eigen::Vector3d& centre,
             double reach_of_nodes);
};

/// The ends of a bundle of neighbouring rays: all ends lie in a box, and the angle between every
/// ray and a common direction is limited.
struct PatchEnd {
  RayEnd end;        ///< of a ray in the common direction through the middle of the box
  float axis[3][3];  ///< axes of the box, unit
  float half[3];     ///< mm, half the sides of the box
  float tilt;        ///< tangent of the angle

  /// @param axes        columns, axes of the box
  /// @param half_sides  mm
  /// @param tangent     of the largest angle, below 1e3
  PatchEnd(const RayEnd& middle, const Eigen::Matrix3d& axes, const Eigen::Vector3d& half_sides,
           double tangent);
};

/// A bundle of neighbouring rays from their starts to the points where they are truncated.
struct PatchSegment {
  PatchEnd end;
  PatchEnd start;
};

/// The moves or groups, of eight, that are not ruled out; for a bundle of rays, those that are not
/// ruled out for all rays at once.
struct Candidates8 {
  unsigned bits = 0;                     ///< bit i is set unless move or group i is ruled out
  alignas(32) float separation[8] = {};  ///< larger for moves farther from the end of the ray

  /// Returns the index of the nearest candidate. Requires at least one.
  int nearest() const;
};
/// Returns the children of a node, or the moves of a leaf, that the rays may meet.
Candidates8 candidate_children(const SweepNode& node, const RaySegment& ray);
Candidates8 candidate_moves(const SweepLeaf& leaf, const SweepLeafFrame& frame,
                            const RaySegment& ray);
Candidates8 candidate_children(const SweepNode& node, const PatchSegment& rays);
Candidates8 candidate_moves(const SweepLeaf& leaf, const SweepLeafFrame& frame,
                            const PatchSegment& rays);

/// The separating plane of a bound: all cutters of a group are at least (`gap` - `error_bound`) /
/// |direction| (mm) behind the plane through the end of the ray normal to `direction`.
struct Clearance {
  Eigen::Vector3d direction;
  double gap;
  double error_bound;
};
/// Returns the separating planes of the eight bounds, for tests.
std::array<Clearance, SweepNode::width> clearances(const SweepNode& node, const RayEnd& end);
std::array<Clearance, SweepLeaf::width> clearances(const SweepLeaf& leaf,
                                                   const SweepLeafFrame& frame, const RayEnd& end);

}  // namespace abbe::cutting
