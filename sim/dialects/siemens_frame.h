#pragma once

#include <string_view>

#include <Eigen/Core>

/// Frames of Siemens 840D: how they are turned and put behind each other.
namespace abbe::sim::dialects::siemens {

/// Rotation about X (0), Y (1) or Z (2) by an angle in degrees, right-handed. Multiples of 90 deg
/// have sines and cosines of 0 and 1 exactly.
Eigen::Matrix3d turned_about(int axis, double angle_deg);

/// p' = rotation p + shift, of X Y Z in mm.
struct Placement {
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();

  bool is_none() const { return shift.isZero(0.0) && rotation.isIdentity(0.0); }
};
/// `second` in the coordinates that `first` makes.
Placement behind(const Placement& first, const Placement& second);

/// How CYCLE800 counts its angles.
enum class SwivelMode { AxisByAxis, SolidAngle };

/// The rotation of a swivelled plane: by three angles about the axes in `order` (0 X, 1 Y, 2 Z),
/// each about the axis as the ones before have turned it; by solid angle about Z, then about the Y
/// that was turned.
Eigen::Matrix3d swivel_rotation(SwivelMode mode, const Eigen::Vector3i& order,
                                const Eigen::Vector3d& angles_deg);

}  // namespace abbe::sim::dialects::siemens
