#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "cutting/stock/body.h"
#include "kinematics/pose.h"

/// Distance and contact of bodies, at a pose and during a motion.
namespace abbe::cutting {

/// The smallest distance between two bodies and the two nearest points, in the frame of the bodies'
/// poses.
struct Gap {
  double distance = 0.0;  ///< mm, 0 if their surfaces meet
  Eigen::Vector3d on_a = Eigen::Vector3d::Zero(), on_b = Eigen::Vector3d::Zero();
};

struct GapOptions {
  double relative_error = 0.0;  ///< permitted relative excess of the distance; 0: to 1e-11 of sizes
                                ///< and distances (1e-8 mm at 1 m); larger values are faster if
                                ///< many points are about equally far
  double max_distance =
      std::numeric_limits<double>::infinity();  ///< mm; a larger distance is returned as
                                                ///< this value, without points
};

/// Returns the distance between the surfaces of two bodies, also if one body lies inside the other.
Gap gap(const Body& a, const kinematics::Pose& T_a, const Body& b, const kinematics::Pose& T_b,
        const GapOptions& options = {});

/// Returns true if one body lies inside the other and their surfaces do not meet, which `gap` does
/// not detect.
bool is_inside(const Body& a, const kinematics::Pose& T_a, const Body& b,
               const kinematics::Pose& T_b);

/// Faster variant of `is_inside` for bodies whose surfaces do not meet.
bool is_inside_disjoint(const Body& a, const Body& b, const kinematics::Pose& T_ab);

/// A ball in the frame of a body.
struct Ball {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm
  double radius = 0.0;                               ///< mm
};

/// Returns balls whose hull contains a body, in its frame: the vertices with their skins. Empty if
/// there are more than `max_balls`.
std::vector<Ball> hull_balls(const Body& body, std::size_t max_balls = 1024);

/// The balls among the components of a body, such as the end of a ball cutter, and the body of the
/// other components.
struct BodyBalls {
  std::vector<Ball> balls;
  std::optional<Body> rest;
};
/// Separates the balls of a body from its other components.
BodyBalls split_into_balls(const Body& body);

/// Returns the body swept by a ball whose centre moves along a polyline.
/// @param centres  (n x 3) mm, vertices of the polyline, n >= 2
/// @throws std::invalid_argument for fewer centres
Body ball_sweep_body(const Points& centres, double radius);

/// One triangle of each of two bodies, in the frame of the first.
struct TrianglePair {
  std::array<Eigen::Vector3d, 3> of_a, of_b;
  double skins = 0.0;  ///< mm, sum of both
};

/// Returns the pairs of triangles of two bodies whose distance, skins included, is at most
/// `max_distance` mm. If there are more than `max_pairs` pairs, returns that many from all over the
/// bodies.
std::vector<TrianglePair> near_pairs(const Body& a, const Body& b, const kinematics::Pose& T_ab,
                                     double max_distance, std::size_t max_pairs);

/// Returns the distance of two triangles after a translation of the second; negative if skins
/// overlap.
Gap gap(const TrianglePair& pair, const Eigen::Vector3d& translation);

struct ApproachOptions {
  double resolution = 5e-3;   ///< mm, a smaller distance is contact
  double within = 1e-2;       ///< mm, absolute tolerance of the least distance
  double share = 1e-2;        ///< relative tolerance; the larger of the two tolerances counts
  double query_error = 0.0;   ///< permitted relative error of every single distance, below `share`
  bool contact_only = false;  ///< true if no distance is needed without contact
};

/// The nearest approach of a body to another in a motion.
struct Approach {
  bool contact = false;
  double u = 0.0;   ///< of contact, or of the least distance, 0 .. 1
  Gap gap;          ///< at that time, in the frame of a
  int queries = 0;  ///< number of distances computed
};

/// Returns the nearest approach. Advances in steps in which the fastest point of b moves by less
/// than the current distance (conservative advancement), so no contact is missed, however thin and
/// fast the bodies are. The returned time of contact is not later than the true one, and earlier by
/// at most the time since the distance fell below the resolution; an approach to within the
/// resolution may count as contact. Without contact the least distance exceeds the true one by at
/// most the larger tolerance.
/// @param b_in_a  motion of b in the frame of a
/// @throws std::invalid_argument for a resolution or `within` that is not positive, a negative
///         share, or a `query_error` that is not below the share
Approach approach(const Body& a, const Body& b, const kinematics::Screw& b_in_a,
                  const ApproachOptions& options = {});

/// Returns the time, 0 .. 1, at which a body first comes within a distance of another in a motion,
/// or nothing if it does not. The time is not later than the true one, and earlier by at most the
/// time in which the bodies come nearer by the tolerance. An approach to within the distance plus
/// the tolerance may count.
/// @param distance, tolerance  mm
/// @throws std::invalid_argument for a tolerance that is not positive
std::optional<double> first_time_within(const Body& a, const Body& b,
                                        const kinematics::Screw& b_in_a, double distance,
                                        double tolerance);

}  // namespace abbe::cutting
