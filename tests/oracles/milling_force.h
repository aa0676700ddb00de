#pragma once

#include <Eigen/Core>

/// Milling forces by brute force, in the textbook's own frame (Altintas 2012, section 2.7; Lee and
/// Altintas 1996 for a ball end): x along the feed of the tool, y across, z up the tool; the
/// immersion angle phi counts from +y clockwise, as the cutter turns. Thin discs, many angles,
/// midpoint sums; no closed form, no arcs, no least of thicknesses: the surface that the teeth
/// leave is followed tooth by tooth. Only a horizontal feed.
namespace abbe::oracles {

struct MillingCut {
  int teeth = 2;
  double radius = 5.0;         ///< mm
  bool ball = false;           ///< a ball end, else a cylinder
  double helix = 0.0;          ///< rad, right-hand
  double bottom = 0.0;         ///< mm, lowest disc in material
  double top = 1.0;            ///< mm, highest
  double entry = 0.0;          ///< rad, phi_st
  double exit = 3.14159;       ///< rad, phi_ex
  double feed = 0.1;           ///< mm per tooth
  double run_out = 0.0;        ///< mm
  double run_out_angle = 0.0;  ///< rad, in the sense of phi, from tooth 0 to the offset
  double K_tc = 0.0, K_rc = 0.0, K_ac = 0.0;
  double K_te = 0.0, K_re = 0.0, K_ae = 0.0;
  int discs = 1000;
};

/// On the tool, about its tip.
struct MillingForce {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  double chip_area = 0.0;  ///< mm^2 of all teeth together
};

/// Tooth 0 at phi at the tip of the cutter, tooth j a pitch behind tooth j - 1.
MillingForce milling_force_at(const MillingCut& cut, double phi);

/// Mean of that over a turn in so many steps.
MillingForce mean_milling_force(const MillingCut& cut, int angles);

}  // namespace abbe::oracles
