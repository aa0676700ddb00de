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

/// Bounds in single precision that rule out eight moves, or eight groups of moves, at a time. No
/// move that meets the ray between its ends is ever ruled out; sweep_bounds.cpp contains the proof.
namespace abbe::cutting {

/// Eight moves as the centre k of the corner circle's plane and the axis u at both ends, in float
/// relative to an origin of their own.
struct alignas(32) SweepLeaf {
  static constexpr int width = 8;
  float k0[3][width];
  float k1[3][width];
  float u0[3][width];
  float u1[3][width];
};
/// Origin and error bounds of a leaf.
struct SweepLeafPlace {
  double origin[3];
  float reach;         ///< mm, from the origin to the farthest point of a cutter
  float slack;         ///< mm, largest distance of k from its chords, plus the rounding of the leaf
  std::int32_t count;  ///< number of moves; the last one is repeated to fill the leaf
};
/// All leaves of a tree.
struct SweepLeaves {
  std::vector<SweepLeaf> moves;
  std::vector<SweepLeafPlace> places;
};

/// Bounds of eight groups of moves: boxes of k, slabs of k in the direction in which it spreads
/// least, both rounded outwards, and cones of u; in float about the centre of the whole motion.
struct alignas(32) SweepNode {
  static constexpr int width = 8;
  float low[3][width];
  float high[3][width];
  float flat[3][width];    ///< unit to rounding, or zero: no slab
  float flat_low[width];   ///< lower bound of flat * (k - corner of the box at low)
  float flat_high[width];  ///< upper bound of the same
  float cone[3][width];
  float cos_spread[width];  ///< cosine of half the opening of the cone; -1: any direction
  float sin_spread[width];
};

/// Bounds of one group, in double precision.
struct SweepBounds {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
  Eigen::Vector3d cone = Eigen::Vector3d::UnitZ();
  double spread = 0.0;  ///< rad, half the opening of the cone; pi: any direction
  Eigen::Vector3d flat = Eigen::Vector3d::Zero();
  double flat_low = 0.0;  ///< lower bound of flat * (k - low)
  double flat_high = 0.0;
};

/// Fills a leaf with one to eight moves.
void put(SweepLeaves& leaves, std::size_t leaf, const Cutter& cutter, std::span<const Move> moves);
/// Fills one of the eight groups of a node.
void put(SweepNode& node, int child, const SweepBounds& bounds, const Eigen::Vector3d& centre);

/// Returns the bounds of a leaf.
SweepBounds bounds_of(const SweepLeaves& leaves, std::size_t leaf);
/// Returns the bounds of a node.
/// @param first, end  the leaves below the node
SweepBounds bounds_of(const SweepNode& node, int children, const Eigen::Vector3d& centre,
                      const SweepLeaves& leaves, std::size_t first, std::size_t end);

/// The cutter and one end of a ray that is cut off there, in the form in which the bounds use them.
struct RayEnd {
  double point[3];  ///< mm, where the ray is cut off
  float p[3];       ///< the same point about the nodes' centre
  float n[3];       ///< normal of the ray
  float doubt;      ///< mm, rounding of a node's bound
  float reach;  ///< mm, from the nodes' centre to the farthest point of a cutter or corner of a box
  float radius, corner, ring, flank;
  const ToolOutline* outline;  ///< of a form cutter, else null

  RayEnd(const Cutter& cutter, const Ray& ray, double s, const Eigen::Vector3d& centre,
         double reach_of_nodes);
  /// Moves the end of the ray to s mm along it.
  void cut_off(const Ray& ray, double s, const Eigen::Vector3d& centre);
};

/// A ray between its start and the point where it is cut off.
struct RaySegment {
  RayEnd end;
  RayEnd start;  ///< treated as the end of the reversed ray

  RaySegment(const Cutter& cutter, const Ray& ray, double s, const Eigen::Vector3d& centre,
             double reach_of_nodes);
};

/// The ends of neighbouring rays: all of them lie in a box, and every ray is within an angle of one
/// direction.
struct PatchEnd {
  RayEnd end;        ///< of a ray in that direction, at the middle of the box
  float axis[3][3];  ///< unit axes of the box
  float half[3];     ///< mm, half the sides of the box
  float tilt;        ///< tangent of the angle

  /// @param axes     columns, of the box
  /// @param halves   mm
  /// @param tangent  of the angle, below 1e3
  PatchEnd(const RayEnd& middle, const Eigen::Matrix3d& axes, const Eigen::Vector3d& halves,
           double tangent);
};

/// Neighbouring rays between their starts and the points where they are cut off.
struct PatchSegment {
  PatchEnd end;
  PatchEnd start;
};

/// The moves or groups that eight bounds do not rule out; for neighbouring rays, those that are
/// open for any of them.
struct Open8 {
  unsigned bits = 0;                     ///< bit i is set unless i is ruled out
  alignas(32) float separation[8] = {};  ///< large for moves far from the end of the ray

  /// Returns the nearest open one; at least one must be open.
  int nearest() const;
};
/// Returns the children of a node, or moves of a leaf, that the ray may meet.
Open8 open_children(const SweepNode& node, const RaySegment& ray);
Open8 open_moves(const SweepLeaf& leaf, const SweepLeafPlace& place, const RaySegment& ray);
Open8 open_children(const SweepNode& node, const PatchSegment& rays);
Open8 open_moves(const SweepLeaf& leaf, const SweepLeafPlace& place, const PatchSegment& rays);

/// The plane behind a bound: all cutters of a group lie at least `gap` / |direction| (mm) behind
/// the plane through the end of the ray normal to `direction`, with an error of at most `doubt` /
/// |direction|.
struct Clearance {
  Eigen::Vector3d direction;
  double gap;
  double doubt;
};
/// Returns the planes of the eight bounds; used by the tests.
std::array<Clearance, SweepNode::width> clearances(const SweepNode& node, const RayEnd& end);
std::array<Clearance, SweepLeaf::width> clearances(const SweepLeaf& leaf,
                                                   const SweepLeafPlace& place, const RayEnd& end);

}  // namespace abbe::cutting
