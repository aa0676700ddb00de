#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "cutting/stock/body.h"
#include "kinematics/pose.h"

namespace abbe::cutting {

/// Where two bodies are nearest to each other, in the frame in which their poses are stated.
struct Gap {
  double distance = 0.0;  ///< mm, 0 where their surfaces meet
  Eigen::Vector3d on_a = Eigen::Vector3d::Zero(), on_b = Eigen::Vector3d::Zero();
};

struct GapOptions {
  double share = 0.0;  ///< of the distance that it may be found too large by: 0 gives it to 1e-11
                       ///< of sizes and distances (1e-8 mm at 1 m), more is quicker where much is
                       ///< about as far
  double most = std::numeric_limits<double>::infinity();  ///< mm, a larger distance is given as
                                                          ///< this one, without its points
};

/// Between surfaces: of a body wholly inside the other it is the way out.
Gap gap(const Body& a, const kinematics::Pose& T_a, const Body& b, const kinematics::Pose& T_b,
        const GapOptions& options = {});

/// Whether one lies inside the other, their surfaces apart: what `gap` does not see.
bool is_inside(const Body& a, const kinematics::Pose& T_a, const Body& b,
               const kinematics::Pose& T_b);

/// The same where their surfaces are known to be apart.
bool is_inside_disjoint(const Body& a, const Body& b, const kinematics::Pose& T_ab);

struct Ball {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm
  double radius = 0.0;                               ///< mm
};

/// Balls in the frame of a body whose hull holds it, its vertices and skins; none where there are
/// more than `most`.
std::vector<Ball> hull_balls(const Body& body, std::size_t most = 1024);

/// Balls among the pieces of a body, such as the end of a ball cutter, and what else there is.
struct BodyBalls {
  std::vector<Ball> balls;
  std::optional<Body> rest;
};
BodyBalls split_into_balls(const Body& body);

/// What a ball sweeps whose centre goes along straight lines.
/// @param centres  (n x 3) mm, n >= 2
/// @throws std::invalid_argument for fewer
Body ball_sweep_body(const Points& centres, double radius);

/// A triangle of each of two bodies, in the frame of the first.
struct TrianglePair {
  std::array<Eigen::Vector3d, 3> of_a, of_b;
  double skins = 0.0;  ///< mm, of both together
};

/// Triangles of two bodies that are as near as this, mm, skins included; no more than `most` of
/// them, which are then from all over.
std::vector<TrianglePair> near_pairs(const Body& a, const Body& b, const kinematics::Pose& T_ab,
                                     double within, std::size_t most);

/// Of two triangles, the second moved by a translation; below zero where skins overlap.
Gap gap(const TrianglePair& pair, const Eigen::Vector3d& moved);

struct ApproachOptions {
  double resolution = 5e-3;   ///< mm, a smaller distance is contact
  double within = 1e-2;       ///< mm, of the least distance that is found, or
  double share = 1e-2;        ///< of it, whichever is more
  double rough = 0.0;         ///< share of every distance that it may be found too large by, below
                              ///< `share`
  bool contact_only = false;  ///< without contact nothing else is of interest
};

/// How near a body comes to another in a motion.
struct Approach {
  bool contact = false;
  double u = 0.0;   ///< of contact, or of where they are nearest, 0 .. 1
  Gap gap;          ///< there, in the frame of a
  int queries = 0;  ///< of distances
};

/// Goes from distance to distance by what the fastest point of b can do in it (conservative
/// advancement), so nothing is passed, however thin and fast. Contact is found not after the true
/// one, and before it by no more than it takes to come as near as the resolution; a motion that
/// comes so near and does not meet may count as contact. Without contact the least distance is
/// within `within`, or that share of it, above the true one.
/// @param b_in_a  how b moves in the frame of a
/// @throws std::invalid_argument for a resolution or `within` that is not positive, a share that is
///         below zero, or rough distances that are not below it
Approach approach(const Body& a, const Body& b, const kinematics::Screw& b_in_a,
                  const ApproachOptions& options = {});

/// When a body first comes within a distance of another in a motion, 0 .. 1: not after the true
/// moment, and before it by no more than it takes to come nearer by the tolerance. Also what comes
/// to within the distance and that tolerance may count.
/// @param distance, tolerance  mm
/// @throws std::invalid_argument for a tolerance that is not positive
std::optional<double> comes_within(const Body& a, const Body& b, const kinematics::Screw& b_in_a,
                                   double distance, double tolerance);

}  // namespace abbe::cutting
