#pragma once

#include <string>
#include <vector>

#include "cutting/stock/engagement.h"
#include "cutting/surface/tool.h"
#include "kinematics/pose.h"

namespace abbe::cutting {

/// Mechanistic coefficients: force per chip area (N/mm^2) and per edge length (N/mm), tangential,
/// radial (along the outward normal of the edge's slice) and axial (along the outline, upwards on a
/// flank). On the tool they act against its turning, against the normal, and up the outline.
struct CuttingCoefficients {
  std::string name;
  std::string source;
  double K_tc = 0.0, K_rc = 0.0, K_ac = 0.0;  ///< N/mm^2
  double K_te = 0.0, K_re = 0.0, K_ae = 0.0;  ///< N/mm
};

/// @throws std::invalid_argument naming the number that is negative (tangential, radial) or not
///         finite
void validate(const CuttingCoefficients& coefficients);

/// The flutes of a milling cutter.
struct Flutes {
  int count = 2;               ///< 1 .. 100
  double helix = 0.0;          ///< rad, > -pi/2, < pi/2; + right-hand, counter-clockwise up
  double run_out = 0.0;        ///< mm, radial offset of the cutter's axis, >= 0
  double run_out_angle = 0.0;  ///< rad, from flute 0 to the offset, counter-clockwise
  bool clockwise = true;       ///< M3, seen from the spindle
};
/// @throws std::invalid_argument naming the number
void validate(const Flutes& flutes);

/// Forces of a cut on the tool.
struct CuttingLoad {
  kinematics::Wrench on_tool_t = kinematics::Wrench::Zero();  ///< at the tip, frame t
  Eigen::Vector3d contact_t = Eigen::Vector3d::Zero();        ///< mm, centre of the forces' amounts
                                                        ///< |F_t| + |F_r| + |F_a|; 0 without any
  double torque = 0.0;       ///< N mm on the spindle, > 0 against its turning
  double chip_volume = 0.0;  ///< mm^3 per revolution, as the chip thickness has it; of an instant:
                             ///< if all the revolution were like it
};

/// Mean over a revolution. The helix does not enter it; run-out moves chip from tooth to tooth but
/// not its sum, and the edge terms are those of all teeth. Integrated in closed form over the part
/// of every arc that faces the feed: with the arcs given, to 1e-12 of the sum of amounts. No
/// engagement, no feed: no load, never a NaN. 2 pi torque = K_tc chip_volume where K_te is 0.
/// Source: Altintas 2012, section 2.7; Lee and Altintas 1996 for the corner.
/// @param feed_per_tooth  mm, >= 0
/// @throws std::invalid_argument as `validate`, or for the feed
CuttingLoad mean_force(const Engagement& engagement, const CuttingCoefficients& coefficients,
                       const Flutes& flutes, double feed_per_tooth);

/// At a spindle angle: flute 0 stands at that angle about z of frame t at the tip, the others
/// behind it by equal pitches; up a helical edge by height tan(helix) / largest radius (constant
/// lead): a right-hand one lags on a clockwise spindle. With run-out each tooth cuts what those
/// before it left: h = least over m of m feeds and the difference of the radii to the tooth m
/// before, or 0. Edges are integrated in closed form over the height of their slice, however few
/// slices there are on a flank; in a corner the slices are frustums (order 2). The mean over all
/// angles is `mean_force` (of run-out: unless a tooth meets no chip). Source and throws as there.
/// @param spindle_angle  rad, counter-clockwise; a clockwise spindle counts down
CuttingLoad force_at(const Engagement& engagement, const CuttingCoefficients& coefficients,
                     const Flutes& flutes, double feed_per_tooth, double spindle_angle);

/// Turning by the same coefficients: tangential along -y of frame t (the work comes down on the
/// rake face), radial against the edge's normal, axial not used. Pieces without chip do not press.
/// @param work_radius  mm of the work at the contact, >= 0: torque and chip volume are of it
/// @throws std::invalid_argument as `validate`, or for the radius
CuttingLoad turning_force(const std::vector<EngagedEdge>& edges, const Nose& nose,
                          const CuttingCoefficients& coefficients, double work_radius = 0.0);

}  // namespace abbe::cutting
