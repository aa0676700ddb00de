#pragma once

#include <vector>

#include <Eigen/Core>

#include "cutting/edge_profile.h"
#include "cutting/nose_stretch.h"
#include "cutting/nose_sweep.h"

namespace abbe::cutting {

/// What a node of the sweep of an edge with a profile rules out: in the meridian half-plane of a
/// ray its tools lie between straight sides along the profile's own, which follow long edges where
/// a circle about them would be far away. Memory is linear in the nodes.
class ProfileBound {
 public:
  ProfileBound(const EdgeProfile& profile, const NoseSweep& sweep);

  /// Below the smallest s at which a piece below the node can meet the ray; infinity if none can.
  double first_reach(int index, const NoseNode& node, const NoseStretch& ray) const;

 private:
  /// Of the centres and tools below a node, mm.
  struct Extent {
    double up_low, up_high;  ///< of centres, across the spindle line in the first rake plane
    double off;              ///< by which a tool that has turned since the first pose leaves it
    double beside;           ///< farthest from that plane
  };
  /// A side of the profile in the first pose: normal . (x, up) <= reach from its centre.
  struct Side {
    Eigen::Vector2d normal;
    double reach;
  };

  Extent extent_of(const NoseSweep& sweep, const NosePiece& piece) const;

  Eigen::Matrix3d R_;                  // of the first pose
  Eigen::Vector3d up_, beside_;        // unit, across the spindle line
  double outer_radius_, down_, wide_;  // mm: of the profile, its reach down, and along `beside`
  std::vector<Side> sides_;
  std::vector<Extent> extents_;  // of the nodes
};

}  // namespace abbe::cutting
