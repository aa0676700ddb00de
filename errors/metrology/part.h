#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "errors/metrology/readings.h"

/// Instruments that measure a part: a touch probe on the machine that made it, and a coordinate
/// measuring machine.
namespace abbe::errors::metrology {

/// Machined surface as points with deviations. A point whose deviation is NaN was not machined and
/// is not measured.
struct PartSurface {
  Eigen::MatrixX3d points_w;   ///< (n x 3) mm, on the design
  Eigen::MatrixX3d normals_w;  ///< (n x 3) unit, outward
  Eigen::VectorXd deviation;   ///< (n) mm along the normal; positive: excess material
};

/// Readings of a part.
struct PartReadings {
  Eigen::MatrixX3d points_w;   ///< (m x 3) mm, on the design
  Eigen::MatrixX3d normals_w;  ///< (m x 3)
  Eigen::VectorXd deviation;   ///< (m) mm along the normal, as reported by the instrument
  double sigma = 0.0;          ///< mm, standard deviation of one reading: noise and rounding
  Eigen::VectorXd time_s;      ///< (m) time of each reading
};

/// Touch probe in the spindle of the machine that carries the part.
struct TouchProbe {
  double radius = 3.0;                                 ///< mm, of the stylus ball
  Eigen::Vector3d centre_t = Eigen::Vector3d::Zero();  ///< mm, centre of the ball relative to the
                                                       ///< tip position assumed by the control
  double noise = 0.5e-3;                               ///< mm, of one touch
  double resolution = 0.0;                             ///< mm
  double clearance = 2.0;                              ///< mm, height above the design at which the
                                                       ///< approach begins
  double speed = 500.0 / 60.0;                         ///< mm/s
  double dwell_s = 1.0;                                ///< s, for each touch
  double start_s = 0.0;                                ///< time of the first touch
  kinematics::AxisVector q;  ///< (axes) positions of the rotary axes; slides are ignored
  std::uint64_t seed = 0;
};

/// Returns the readings that the machine's own control would report. The ball approaches every
/// point along its normal, and the control takes the commanded position at contact for the true
/// one. Contact is computed on the actual machine to 1e-12 mm, with the surface as the plane
/// through the machined point across its normal. To first order the reported value is deviation - n
/// (tip error).
/// @throws std::invalid_argument for shapes that differ, normals that are not unit to 1e-9, options
/// out of range, a point that the slides do not reach within their travel, or a ball that
///         makes no contact within the clearance
PartReadings probe(const PartSurface& part, const kinematics::Chain& nominal,
                   const MachineUnderTest& machine, const TouchProbe& options);

/// Settings of a coordinate measuring machine.
struct CoordinateMeasuringMachine {
  double spacing = 5.0;     ///< mm, of the grid: one point per cell and side, nearest to its centre
  double noise = 0.5e-3;    ///< mm
  double resolution = 0.0;  ///< mm
  /// Displacement of the part from its assumed position, about the mean of its points; empty: drawn
  /// from the sigmas.
  std::optional<kinematics::Deviation> alignment;
  double alignment_sigma = 0.0;      ///< mm, each of three
  double alignment_sigma_rad = 0.0;  ///< rad, each of three
  bool best_fit = false;             ///< report deviations after a rigid least-squares fit
  double start_s = 0.0;
  double interval_s = 2.0;  ///< s per point
  std::uint64_t seed = 0;
};

/// Returns the readings at one point of every grid cell, along the design's normal. The surface
/// counts as a plane there: if the part is displaced sideways by t on a curvature of radius R, the
/// error is t^2 / 2R.
/// @throws std::invalid_argument for shapes that differ, normals that are not unit to 1e-9, or
///         options out of range
PartReadings measure_coordinates(const PartSurface& part,
                                 const CoordinateMeasuringMachine& options);

}  // namespace abbe::errors::metrology
