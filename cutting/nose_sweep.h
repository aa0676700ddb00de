#pragma once

#include <vector>

#include <Eigen/Core>

#include "cutting/sweep.h"

namespace abbe::cutting {

// Everything here is in spindle axes: origin on the spindle line, x along it.

/// The motion between two samples, over u in [0, 1].
struct NoseInterval {
  Eigen::Vector3d centre;       ///< mm, origin of frame t in the slow pose at u = 0
  Eigen::Vector3d centre_step;  ///< mm per u
  Eigen::Matrix3d R;            ///< slow rotation at u = 0
  Eigen::Vector3d turn_axis;    ///< unit, in frame t
  double turn;                  ///< rad per u about it; 0 where it is below 1e-15
  double angle;                 ///< rad, spindle at u = 0
  double angle_step;            ///< rad per u
  double time_s;
  double time_step;
  int line;
};

/// Part of an interval in which the spindle turns by at most one revolution. The rake plane
/// contains the point (x, r, azimuth) where azimuth = angle +- acos((height - tilt x) / r).
struct NosePiece {
  int interval;
  double u0, u1;
  double angle0, angle1;    ///< rad, azimuth of the rake plane's normal at both ends, unwrapped
  double height0, height1;  ///< mm
  double tilt0, tilt1;      ///< tangent of the normal's elevation from the plane of revolution
  bool free;                ///< the normal leans to the spindle by over 60 degrees: no angle
};

/// Bounds over a run of pieces: nose centres in the meridian half-plane (x, r) and the rake plane.
struct NoseNode {
  double x_low, x_high, r_low, r_high;  ///< mm
  double angle_low, angle_high;         ///< rad
  double height, tilt;                  ///< largest magnitudes
  int first, count;                     ///< pieces
  int right;                            ///< second child; the first is the next node
};

/// The sweep of a nose, ready to be asked. Memory is linear in samples plus revolutions.
struct NoseSweep {
  Eigen::Matrix3d R_ws;  ///< spindle axes in the workpiece
  Eigen::Vector3d p_ws;  ///< mm
  std::vector<NoseInterval> intervals;
  std::vector<NosePiece> pieces;
  std::vector<NoseNode> nodes;  ///< a binary tree over the pieces in time, root first; may be empty
  struct Face {
    int interval;
    double u;
  };
  std::vector<Face> faces;  ///< where the sweep begins, ends or turns back
};

/// @throws std::invalid_argument if sizes differ, a number is not finite, time does not increase,
/// the
///         spindle direction is not unit to 1e-9, a slow pose is not a rotation to 1e-9, or the
///         spindle makes more than 20 million revolutions
NoseSweep nose_sweep(const NoseMotion& motion);

/// A ray q + s n seen from the tool at one instant: x_t, z_t and y_t are linear in s, and so is the
/// rate at which the spindle carries the point through the rake plane.
struct RayInTool {
  Eigen::Vector2d point, step;  ///< (x_t, z_t)
  double y, y_step;
  double swing, swing_step;  ///< d y_t / d spindle angle
};
RayInTool ray_in_tool(const NoseInterval& interval, double u, const Eigen::Vector3d& q,
                      const Eigen::Vector3d& n);

}  // namespace abbe::cutting
