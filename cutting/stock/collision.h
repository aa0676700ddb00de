#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "cutting/stock/body.h"
#include "kinematics/pose.h"

/// Distances and contact of bodies, at a pose and during a motion.
namespace abbe::cutting {

/// The smallest distance between two bodies and the points where it occurs, in the frame in which
/// their poses are stated.
struct Gap {
  double distance = 0.0;  ///< mm, 0 if their surfaces meet
  Eigen::Vector3d on_a = Eigen::Vector3d::Zero(), on_b = Eigen::Vector3d::Zero();
};

struct GapOptions {
  double share = 0.0;  ///< permitted relative error by which the distance is too large: 0 gives it
                       ///< to 1e-11 of sizes and distances (1e-8 mm at 1 m); larger values are
                       ///< quicker where many points are about equally far
  double most = std::numeric_limits<double>::infinity();  ///< mm, a larger distance is returned as
                                                          ///< this value, without its points
};

/// Returns the distance between the surfaces of two bodies; for a body wholly inside the other this
/// is the distance from its surface to the other's.
Gap gap(const Body& a, const kinematics::Pose& T_a, const Body& b, const kinematics::Pose& T_b,
        const GapOptions& options = {});

/// Returns true if one body lies inside the other with their surfaces apart, which `gap` does not
/// detect.
bool is_inside(const Body& a, const kinematics::Pose& T_a, const Body& b,
               const kinematics::Pose& T_b);

/// Faster variant for bodies whose surfaces are known to be apart.
bool is_inside_disjoint(const Body& a, const Body& b, const kinematics::Pose& T_ab);

/// A ball in the frame of a body.
struct Ball {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm
  double radius = 0.0;                               ///< mm
};

/// Returns balls in the frame of a body whose hull contains it: its vertices with their skins;
/// nothing if there are more than `most`.
std::vector<Ball> hull_balls(const Body& body, std::size_t most = 1024);

/// The balls among the pieces of a body, such as the end of a ball cutter, and the remaining
/// pieces.
struct BodyBalls {
  std::vector<Ball> balls;
  std::optional<Body> rest;
};
/// Separates the balls of a body from its other pieces.
BodyBalls split_into_balls(const Body& body);

/// Returns the body swept by a ball whose centre moves along straight lines.
/// @param centres  (n x 3) mm, n >= 2
/// @throws std::invalid_argument for fewer centres
Body ball_sweep_body(const Points& centres, double radius);

/// One triangle of each of two bodies, in the frame of the first.
struct TrianglePair {
  std::array<Eigen::Vector3d, 3> of_a, of_b;
  double skins = 0.0;  ///< mm, sum of both
};

/// Returns pairs of triangles of two bodies whose distance is at most `within` mm, skins included.
/// If there are more than `most`, that many are selected from all over the bodies.
std::vector<TrianglePair> near_pairs(const Body& a, const Body& b, const kinematics::Pose& T_ab,
                                     double within, std::size_t most);

/// Returns the distance of two triangles, the second translated by `moved`; negative if skins
/// overlap.
Gap gap(const TrianglePair& pair, const Eigen::Vector3d& moved);

struct ApproachOptions {
  double resolution = 5e-3;   ///< mm, a smaller distance is contact
  double within = 1e-2;       ///< mm, permitted error of the least distance, or
  double share = 1e-2;        ///< fraction of it, whichever is larger
  double rough = 0.0;         ///< permitted relative error of every single distance, below `share`
  bool contact_only = false;  ///< without contact no distance is needed
};

/// The nearest approach of a body to another in a motion.
struct Approach {
  bool contact = false;
  double u = 0.0;   ///< of contact, or of the least distance, 0 .. 1
  Gap gap;          ///< at that time, in the frame of a
  int queries = 0;  ///< number of distances computed
};

/// Returns the nearest approach. Advances by steps in which the fastest point of b cannot use up
/// the current distance (conservative advancement), so no contact is missed, however thin and fast
/// the bodies are. Contact is found no later than the true one, and before it by no more than the
/// time needed to come within the resolution; a motion that comes within the resolution without
/// meeting may count as contact. Without contact the least distance is within `within`, or that
/// fraction of it, above the true one.
/// @param b_in_a  motion of b in the frame of a
/// @throws std::invalid_argument for a resolution or `within` that is not positive, a negative
///         share, or a `rough` that is not below the share
Approach approach(const Body& a, const Body& b, const kinematics::Screw& b_in_a,
                  const ApproachOptions& options = {});

/// Returns the time at which a body first comes within a distance of another in a motion, 0 .. 1:
/// no later than the true one, and before it by no more than the time needed to come nearer by the
/// tolerance; nothing if it does not. An approach to within the distance plus the tolerance may
/// count.
/// @param distance, tolerance  mm
/// @throws std::invalid_argument for a tolerance that is not positive
std::optional<double> comes_within(const Body& a, const Body& b, const kinematics::Screw& b_in_a,
                                   double distance, double tolerance);

}  // namespace abbe::cutting
