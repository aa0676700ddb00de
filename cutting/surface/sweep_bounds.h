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

/// Bounds in single precision that rule out eight moves, or eight groups of moves, at a time. None
/// that meets the ray between its ends is ever ruled out; the proof stands in sweep_bounds.cpp.
namespace abbe::cutting {

/// Eight moves by the centre k of the corner circle's plane and the axis u at both ends, in float
/// about an origin of their own.
struct alignas(32) SweepLeaf {
  static constexpr int width = 8;
  float k0[3][width];
  float k1[3][width];
  float u0[3][width];
  float u1[3][width];
};
struct SweepLeafPlace {
  double origin[3];
  float reach;         ///< mm, from the origin to the farthest point of a cutter
  float slack;         ///< mm, by which k may leave its chords, and the rounding of the leaf
  std::int32_t count;  ///< of moves, the last of which fills up the leaf
};
struct SweepLeaves {
  std::vector<SweepLeaf> moves;
  std::vector<SweepLeafPlace> places;
};

/// Boxes of k, slabs of k across its flattest direction, both rounded outward, and cones of u of
/// eight groups of moves, in float about the centre of the whole motion.
struct alignas(32) SweepNode {
  static constexpr int width = 8;
  float low[3][width];
  float high[3][width];
  float flat[3][width];    ///< unit to rounding, or zero: no slab
  float flat_low[width];   ///< flat * (k - corner of the box at low) is at least
  float flat_high[width];  ///< and at most this
  float cone[3][width];
  float cos_spread[width];  ///< -1: any direction
  float sin_spread[width];
};

/// The same of one group, in double.
struct SweepBounds {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
  Eigen::Vector3d cone = Eigen::Vector3d::UnitZ();
  double spread = 0.0;  ///< rad, half the opening; pi: any direction
  Eigen::Vector3d flat = Eigen::Vector3d::Zero();
  double flat_low = 0.0;  ///< of flat * (k - low)
  double flat_high = 0.0;
};

/// Fills leaf `leaf` with one to eight moves.
void put(SweepLeaves& leaves, std::size_t leaf, const Cutter& cutter, std::span<const Move> moves);
/// Fills one of the eight groups of a node.
void put(SweepNode& node, int child, const SweepBounds& bounds, const Eigen::Vector3d& centre);

SweepBounds bounds_of(const SweepLeaves& leaves, std::size_t leaf);
/// @param first, end  the leaves below the node
SweepBounds bounds_of(const SweepNode& node, int children, const Eigen::Vector3d& centre,
                      const SweepLeaves& leaves, std::size_t first, std::size_t end);

/// The cutter and a ray that is cut off somewhere, as the bounds take them.
struct RayEnd {
  double point[3];  ///< mm, where the ray is cut off
  float p[3];       ///< the same about the nodes' centre
  float n[3];       ///< normal of the ray
  float doubt;      ///< mm, rounding of a node's bound
  float reach;      ///< mm, from the nodes' centre to the farthest point of a cutter or corner of a
                    ///< box
  float radius, corner, ring, flank;
  const ToolOutline* outline;  ///< of a form cutter

  RayEnd(const Cutter& cutter, const Ray& ray, double s, const Eigen::Vector3d& centre,
         double reach_of_nodes);
  void cut_off(const Ray& ray, double s, const Eigen::Vector3d& centre);
};

/// A ray between where it starts and where it is cut off.
struct RaySegment {
  RayEnd end;
  RayEnd start;  ///< as the end of the ray that runs the other way

  RaySegment(const Cutter& cutter, const Ray& ray, double s, const Eigen::Vector3d& centre,
             double reach_of_nodes);
};

/// The ends of rays beside each other: all in a box, every ray within an angle of one direction.
struct PatchEnd {
  RayEnd end;        ///< of a ray along the direction, at the middle of the box
  float axis[3][3];  ///< unit, of the box
  float half[3];     ///< mm, of its sides
  float tilt;        ///< tangent of the angle

  /// @param axes  columns, the box's; @param halves  mm @param tangent  of the angle, below 1e3
  PatchEnd(const RayEnd& middle, const Eigen::Matrix3d& axes, const Eigen::Vector3d& halves,
           double tangent);
};

/// Rays beside each other between where they start and where they are cut off.
struct PatchSegment {
  PatchEnd end;
  PatchEnd start;
};

/// What eight bounds leave open; of rays beside each other, for any of them.
struct Open8 {
  unsigned bits = 0;                     ///< bit i is set unless i is ruled out
  alignas(32) float separation[8] = {};  ///< large for what is far from the end of the ray

  /// The nearest of those open; some must be.
  int nearest() const;
};
Open8 open_children(const SweepNode& node, const RaySegment& ray);
Open8 open_moves(const SweepLeaf& leaf, const SweepLeafPlace& place, const RaySegment& ray);
Open8 open_children(const SweepNode& node, const PatchSegment& rays);
Open8 open_moves(const SweepLeaf& leaf, const SweepLeafPlace& place, const PatchSegment& rays);

/// What is behind a bound: all cutters of a group lie `gap` / |direction| (mm) or more behind the
/// plane through the end of the ray across `direction`, save for an error of `doubt` / |direction|.
struct Clearance {
  Eigen::Vector3d direction;
  double gap;
  double doubt;
};
std::array<Clearance, SweepNode::width> clearances(const SweepNode& node, const RayEnd& end);
std::array<Clearance, SweepLeaf::width> clearances(const SweepLeaf& leaf,
                                                   const SweepLeafPlace& place, const RayEnd& end);

}  // namespace abbe::cutting
