#pragma once

#include <string>
#include <vector>

#include "cutting/stock/engagement.h"
#include "cutting/surface/tool.h"
#include "kinematics/pose.h"

/// Cutting forces of the mechanistic model.
namespace abbe::cutting {

/// Mechanistic coefficients: force per chip area (N/mm^2) and per edge length (N/mm) in the
/// tangential direction, the radial direction (along the outward normal of the edge's slice) and
/// the axial direction (along the outline, upwards on a flank). On the tool the forces act against
/// its rotation, against the normal, and up the outline.
struct CuttingCoefficients {
  std::string name;
  std::string source;
  double K_tc = 0.0, K_rc = 0.0, K_ac = 0.0;  ///< N/mm^2
  double K_te = 0.0, K_re = 0.0, K_ae = 0.0;  ///< N/mm
};

/// Throws std::invalid_argument with the name of a coefficient that is not finite or, if tangential
/// or radial, negative.
void validate(const CuttingCoefficients& coefficients);

/// The flutes of a milling cutter.
struct Flutes {
  int count = 2;               ///< 1 .. 100
  double helix = 0.0;          ///< rad, > -pi/2, < pi/2; + right-hand, counter-clockwise upwards
  double run_out = 0.0;        ///< mm, radial offset of the cutter's axis, >= 0
  double run_out_angle = 0.0;  ///< rad, from flute 0 to the offset, counter-clockwise
  bool clockwise = true;       ///< M3: rotation seen from the spindle
};
/// Throws std::invalid_argument with the name of a number that is out of its range.
void validate(const Flutes& flutes);

/// The forces of a cut on the tool.
struct CuttingLoad {
  kinematics::Wrench tool_wrench_t = kinematics::Wrench::Zero();  ///< at the tip, frame t
  Eigen::Vector3d contact_t = Eigen::Vector3d::Zero();  ///< mm, centroid weighted by |F_t| + |F_r|
                                                        ///< + |F_a|; 0 without forces
  double torque = 0.0;       ///< N mm on the spindle, > 0 against its rotation
  double chip_volume = 0.0;  ///< mm^3 per revolution, from the chip thickness; at a single angle,
                             ///< for a whole revolution with the same load
};

/// Returns the mean load over a revolution. The helix has no influence on it; run-out redistributes
/// the chip among the teeth without changing the sum, and the edge terms are those of all teeth.
/// Integrates in closed form over the part of every arc that faces the feed, for given arcs to
/// 1e-12 of the sum of magnitudes. Without engagement or feed the load is zero, never NaN. 2 pi
/// torque = K_tc chip_volume if K_te is 0. Source: Altintas 2012, section 2.7; Lee and Altintas
/// 1996 for the corner.
/// @param feed_per_tooth  mm, >= 0
/// @throws std::invalid_argument as `validate`, or for the feed
CuttingLoad mean_force(const Engagement& engagement, const CuttingCoefficients& coefficients,
                       const Flutes& flutes, double feed_per_tooth);

/// Returns the load at a spindle angle. At the tip, flute 0 is at that angle about z of frame t and
/// the others follow at equal pitches. Along a helical edge the angle changes by height tan(helix)
/// / largest radius (constant lead): a right-hand edge lags on a clockwise spindle. With run-out
/// each tooth cuts the material left by the preceding teeth: the chip h is the minimum over m of m
/// feeds plus the difference of the radii to the m-th preceding tooth, or 0. Edges are integrated
/// in closed form over the height of their slice, for any number of slices of a flank; in a corner
/// the slices are frustums (order 2). The mean over all angles is `mean_force` (with run-out only
/// if every tooth has a chip). Source and exceptions as for `mean_force`.
/// @param spindle_angle  rad, counter-clockwise; a clockwise spindle counts down
CuttingLoad instantaneous_force(const Engagement& engagement,
                                const CuttingCoefficients& coefficients, const Flutes& flutes,
                                double feed_per_tooth, double spindle_angle);

/// Returns the load of turning with the same coefficients: tangential along -y of frame t (the work
/// moves down on the rake face), radial against the edge's normal; axial coefficients are not used.
/// Edges without chip exert no force.
/// @param work_radius  mm, of the work at the contact, >= 0; torque and chip volume are
///                     proportional to it
/// @throws std::invalid_argument as `validate`, or for the radius
CuttingLoad turning_force(const std::vector<EngagedEdge>& edges, const Nose& nose,
                          const CuttingCoefficients& coefficients, double work_radius = 0.0);

}  // namespace abbe::cutting
