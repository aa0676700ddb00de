#pragma once

#include <functional>

#include <Eigen/Core>

/// Where the axes of a machine lie and how they travel, from poses of the tool in the workpiece and
/// nothing else: no joint, no side of the bed, no structural code. Lengths in mm, angles in rad.
namespace abbe::oracles {

/// A machine that can be asked where its tool stands.
struct Poses {
  std::function<Eigen::Matrix4d(const Eigen::VectorXd& q)> T_wt;
  int axes = 0;
};

/// The same machine with one axis at q, the others at zero.
Eigen::Matrix4d with_axis_at(const Poses& machine, int axis, double q);

/// Way of the tip in the workpiece while one axis alone goes from -reach to reach; unit.
Eigen::Vector3d direction_of_travel(const Poses& machine, int axis, double reach = 200.0);

struct Line {
  Eigen::Vector3d point;
  Eigen::Vector3d direction;  ///< unit, right-handed with the turn
};
enum class Standing { InWorkpiece, WithTool };  ///< who looks at the axis

/// Screw axis of what the tool does in the workpiece (or the workpiece round the tool) while one
/// axis alone turns by a radian from zero; its point is the one nearest to `near`.
Line axis_line(const Poses& machine, int axis, Standing standing, const Eigen::Vector3d& near);

/// Angle between two directions.
double angle(const Eigen::Vector3d& one, const Eigen::Vector3d& other);

/// What a ball bar of that radius, centred where the tip stands at zero, says of the angle between
/// two slides beyond 90 degrees: an ellipse, R - R/2 angle sin 2 t, by least squares over a circle.
double angle_by_ball_bar(const Poses& machine, int first, int second, double radius);

/// The same by two lengths across a square of that side.
double angle_by_diagonals(const Poses& machine, int first, int second, double side);

/// The same by a square that lies in the workpiece: the slope of the first axis along it and of the
/// second across.
double angle_by_square(const Poses& machine, int first, int second, double reach);

}  // namespace abbe::oracles
