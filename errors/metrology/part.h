#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "errors/metrology/readings.h"

/// Instruments that read a part: the probe of the machine that made it, and a coordinate measuring
/// machine.
namespace abbe::errors::metrology {

/// A machined surface as arrays. A point without a deviation (NaN) was not machined and is not
/// read.
struct PartSurface {
  Eigen::MatrixX3d points_w;   ///< (n x 3) mm, on the design
  Eigen::MatrixX3d normals_w;  ///< (n x 3) unit, outward
  Eigen::VectorXd deviation;   ///< (n) mm along the normal, plus: material left
};

/// What was read of it.
struct PartReadings {
  Eigen::MatrixX3d points_w;   ///< (m x 3) mm, on the design
  Eigen::MatrixX3d normals_w;  ///< (m x 3)
  Eigen::VectorXd deviation;   ///< (m) mm along the normal, as the instrument reports it
  double sigma = 0.0;          ///< mm, standard deviation of one of them: noise and rounding
  Eigen::VectorXd time_s;      ///< (m) when each was read
};

/// A touch probe in the spindle of the machine that carries the part.
struct TouchProbe {
  double radius = 3.0;                                 ///< mm, of the stylus ball
  Eigen::Vector3d centre_t = Eigen::Vector3d::Zero();  ///< mm, the ball's centre from the tip that
                                                       ///< the control believes in
  double noise = 0.5e-3;                               ///< mm, of one touch
  double resolution = 0.0;                             ///< mm
  double clearance = 2.0;                              ///< mm, where the approach begins
  double speed = 500.0 / 60.0;                         ///< mm/s
  double dwell_s = 1.0;                                ///< for each touch
  double start_s = 0.0;                                ///< time of the first touch
  kinematics::AxisVector q;  ///< (axes) where the rotary axes stand; slides are not looked at
  std::uint64_t seed = 0;
};

/// Readings that the machine's own control would report: the ball approaches every point along its
/// normal, with the commanded place at contact taken for the true one. Contact is found on the
/// actual machine with the surface as the plane through the machined point across its normal, to
/// 1e-12 mm; what is reported is, to first order, deviation - n (tip error).
/// @throws std::invalid_argument for shapes that differ, normals that are not unit to 1e-9, options
///         out of range, a point that the slides do not reach within their travel, a machine on
///         which the ball comes to no contact within the clearance
PartReadings probe(const PartSurface& part, const kinematics::Chain& nominal,
                   const MachineUnderTest& machine, const TouchProbe& options);

/// How a coordinate measuring machine reads a part.
struct CoordinateMachine {
  double spacing = 5.0;     ///< mm, of the grid: one point a cell and side, nearest to its middle
  double noise = 0.5e-3;    ///< mm
  double resolution = 0.0;  ///< mm
  /// How the part lies against where it is thought to be, about the middle of its points; drawn
  /// from the sigmas if not given.
  std::optional<kinematics::Deviation> alignment;
  double alignment_sigma = 0.0;      ///< mm, each of three
  double alignment_sigma_rad = 0.0;  ///< rad, each of three
  bool best_fit = false;             ///< deviations after a rigid best fit (least squares)
  double start_s = 0.0;
  double interval_s = 2.0;  ///< a point
  std::uint64_t seed = 0;
};

/// Every chosen point of the map, read across the design's normal from the surface taken as plane
/// there: to t^2 / 2R where the part slides by t on a curvature of radius R.
/// @throws std::invalid_argument for shapes that differ, normals that are not unit to 1e-9, options
///         out of range
PartReadings measure_coordinates(const PartSurface& part, const CoordinateMachine& options);

}  // namespace abbe::errors::metrology
