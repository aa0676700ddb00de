#pragma once

#include <Eigen/Core>

/// The deviation of a part that was cut and measured, fed back to the program that cut it.
namespace abbe::sim::compensation {

/// Deviations between the places where they were read: at every point that of a plane through its
/// eight nearest readings, weighted by (1/d - 1/d9)^2, so that it does not jump where neighbours
/// change; a reading's own place has its own value. Exact for what is linear over the part.
/// @param read_at    (n x 3) mm, n >= 1 @param deviation (n) mm
/// @param points     (m x 3) mm, farther than `reach` from any reading: none, 0
/// @return (m) mm
Eigen::VectorXd between_readings(const Eigen::MatrixX3d& read_at, const Eigen::VectorXd& deviation,
                                 const Eigen::MatrixX3d& points, double reach);

/// What is known of a part: deviations at places, and when the nominal program shapes each.
struct KnownPart {
  Eigen::MatrixX3d normals;   ///< (n x 3) unit, outward, in the frame in which the tool is moved
  Eigen::VectorXd deviation;  ///< (n) mm along the normal, plus: material left
  Eigen::VectorXd time_s;     ///< (n)
  Eigen::VectorXi pass = {};  ///< (n) number of the tool's pass, or empty: one
};

/// Displacement of the tool that a part shows, over time, linear between instants, held outside.
struct PartCourse {
  Eigen::VectorXd time_s;  ///< (m) increasing
  Eigen::MatrixX3d move;   ///< (m x 3) mm
};

struct MirrorOptions {
  int together = 8;       ///< neighbours in time that are taken together
  double damping = 0.02;  ///< of the least squares, so that a direction that hardly any normal sees
                          ///< stays unmoved
};
/// Displacement that explains the deviations of neighbours in time: n . move = deviation by damped
/// least squares, one for every few points, at their mean time, and carried on straight to the ends
/// of their stretch. What is linear in time along a stretch is met to the damping, ends included.
/// Another pass, or a gap in time of more than ten times what is usual for points taken together,
/// begins a stretch.
PartCourse explained(const KnownPart& part, const MirrorOptions& options = {});

Eigen::Vector3d move_at(const PartCourse& course, double time_s);

}  // namespace abbe::sim::compensation
