#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "cutting/encounters.h"
#include "cutting/parting_plane.h"

/// The search of `encounters` through a part of a program, which one thread follows.
namespace abbe::cutting {

/// What is found of a pair in a stretch.
struct NearestOfPair {
  double at_least = std::numeric_limits<double>::infinity();  ///< mm
  double distance = std::numeric_limits<double>::infinity();  ///< mm, seen
  bool contact = false;
  Moment moment;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
};

/// The bodies, the pairs and how they move: what all threads share.
struct EncounterTask {
  const std::vector<CarriedBody>& bodies;
  const std::vector<BodyPair>& pairs;
  const CarriedMotion& motion;
  const EncounterOptions& options;
  std::vector<char> followed;                 ///< (pairs)
  std::vector<std::vector<Ball>> hulls = {};  ///< (bodies) empty where there is too much to it
  std::vector<NearestOfPair> seen = {};       ///< (pairs) somewhere on the way
  std::vector<BallsOfBody> parts = {};  ///< (pairs) of the moving body where only contact matters
  std::vector<std::vector<Ball>> rest_hulls = {};  ///< (pairs) of what is no ball in them

  const CarriedBody& fixed(int pair) const {
    return bodies[std::size_t(pairs[std::size_t(pair)].a)];
  }
  bool is_simple(int pair) const {
    return !hulls[std::size_t(pairs[std::size_t(pair)].a)].empty() &&
           !hulls[std::size_t(pairs[std::size_t(pair)].b)].empty();
  }
  const CarriedBody& moving(int pair) const {
    return bodies[std::size_t(pairs[std::size_t(pair)].b)];
  }
  std::vector<kinematics::Pose> placed(std::size_t instant, double u) const {
    std::vector<kinematics::Pose> T(std::size_t(motion.carriers), kinematics::Pose::Identity());
    motion.place(instant, u, T);
    return T;
  }
};

/// What is found in stretches of a task.
struct FollowedStretches {
  std::vector<StretchClearance> clearances;
  std::vector<Encounter> encounters;  ///< of single stretches
  std::vector<NearestOfPair> best;    ///< (pairs)
  std::size_t queries = 0;            ///< of distances
};

/// @param first, last  stretches, the second excluded
FollowedStretches follow(const EncounterTask& task, std::size_t first, std::size_t last);

}  // namespace abbe::cutting
