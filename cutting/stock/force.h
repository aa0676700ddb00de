#pragma once

#include <string>
#include <vector>

#include "cutting/stock/engagement.h"
#include "cutting/surface/tool.h"
#include "kinematics/pose.h"

/// Cutting forces by the mechanistic model.
namespace abbe::cutting {

/// Mechanistic coefficients: force per chip area (N/mm^2) and per edge length (N/mm), in the
/// tangential, radial (along the outward normal of the edge's slice) and axial (along the outline,
/// upwards on a flank) directions. On the tool they act against its rotation, against the normal,
/// and up the outline.
struct CuttingCoefficients {
  std::string name;
  std::string source;
  double K_tc = 0.0, K_rc = 0.0, K_ac = 0.0;  ///< N/mm^2
  double K_te = 0.0, K_re = 0.0, K_ae = 0.0;  ///< N/mm
};

/// Checks the coefficients.
/// @throws std::invalid_argument naming the number that is negative (tangential, radial) or not
///         finite
void validate(const CuttingCoefficients& coefficients);

/// The flutes of a milling cutter.
struct Flutes {
  int count = 2;               ///< 1 .. 100
  double helix = 0.0;          ///< rad, > -pi/2, < pi/2; + right-hand, counter-clockwise upwards
  double run_out = 0.0;        ///< mm, radial offset of the cutter's axis, >= 0
  double run_out_angle = 0.0;  ///< rad, from flute 0 to the offset, counter-clockwise
  bool clockwise = true;       ///< M3, seen from the spindle
};
/// Checks the flutes.
/// @throws std::invalid_argument naming the number
void validate(const Flutes& flutes);

/// The forces of a cut on the tool.
struct CuttingLoad {
  kinematics::Wrench on_tool_t = kinematics::Wrench::Zero();  ///< at the tip, frame t
  Eigen::Vector3d contact_t = Eigen::Vector3d::Zero();  ///< mm, centroid weighted by |F_t| + |F_r|
                                                        ///< + |F_a|; 0 without forces
  double torque = 0.0;       ///< N mm on the spindle, > 0 against its rotation
  double chip_volume = 0.0;  ///< mm^3 per revolution, from the chip thickness; for a single angle:
                             ///< as if the whole revolution were like it
};

/// Returns the mean load over a revolution. The helix has no influence; run-out moves chip from
/// tooth to tooth but does not change the sum, and the edge terms are those of all teeth.
/// Integrated in closed form over the part of every arc that faces the feed: for given arcs to
/// 1e-12 of the sum of amounts. Without engagement or feed the load is zero, never NaN. 2 pi torque
/// = K_tc chip_volume if K_te is 0.
/// Source: Altintas 2012, section 2.7; Lee and Altintas 1996 for the corner.
/// @param feed_per_tooth  mm, >= 0
/// @throws std::invalid_argument as `validate`, or for the feed
CuttingLoad mean_force(const Engagement& engagement, const CuttingCoefficients& coefficients,
                       const Flutes& flutes, double feed_per_tooth);

/// Returns the load at a spindle angle. At the tip, flute 0 stands at that angle about z of frame t
/// and the others follow at equal pitches; up a helical edge the angle changes by height tan(helix)
/// / largest radius (constant lead): a right-hand edge lags on a clockwise spindle.
/// With run-out each tooth cuts what the teeth before it left: h is the least over m of m feeds
/// plus the difference of the radii to the tooth m before, or 0. Edges are integrated in closed
/// form over the height of their slice, however few slices a flank has; in a corner the slices are
/// frustums (order 2). The mean over all angles is `mean_force` (with run-out: unless a tooth meets
/// no chip). Source and exceptions as there.
/// @param spindle_angle  rad, counter-clockwise; a clockwise spindle counts down
CuttingLoad force_at(const Engagement& engagement, const CuttingCoefficients& coefficients,
                     const Flutes& flutes, double feed_per_tooth, double spindle_angle);

/// Returns the load of turning with the same coefficients: tangential along -y of frame t (the work
/// comes down on the rake face), radial against the edge's normal; axial coefficients are not used.
/// Pieces without chip exert no force.
/// @param work_radius  mm, of the work at the contact, >= 0; torque and chip volume are
///                     proportional to it
/// @throws std::invalid_argument as `validate`, or for the radius
CuttingLoad turning_force(const std::vector<EngagedEdge>& edges, const Nose& nose,
                          const CuttingCoefficients& coefficients, double work_radius = 0.0);

}  // namespace abbe::cutting
