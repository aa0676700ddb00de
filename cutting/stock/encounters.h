#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "cutting/stock/collision.h"

/// What comes near what while carriages move along a program.
namespace abbe::cutting {

/// A body that a carriage takes along.
struct CarrierBody {
  Body body;        ///< in the frame of its carriage
  int carrier = 0;  ///< number of the carriage
};

/// Two bodies that may meet, by their numbers.
struct BodyPair {
  int a = 0, b = 0;
  bool contact_only = false;  ///< how near they come is of no interest
};

/// How carriages move, known at instants 0, 1, 2 ...
struct CarrierMotion {
  int carriers = 0;
  std::size_t instants = 0;
  /// Places every carriage at an instant and a fraction of the way to the next, all in one frame.
  /// Asked from any thread.
  std::function<void(std::size_t instant, double u, std::span<kinematics::Pose> T)> place;
  /// (instants - 1) mm, by how much no point of a body leaves the straight way between two
  /// instants, seen from another body.
  std::vector<double> bulge;
  /// (stretches) first instant of each stretch of the program of which a clearance is wanted, such
  /// as its blocks; rising, the first is 0.
  std::vector<std::size_t> stretches;
};

/// First instant after a stretch.
std::size_t end_of(const CarrierMotion& motion, std::size_t stretch);

struct EncounterOptions {
  double resolution = 5e-3;  ///< mm, a smaller distance is contact
  double clearance = 0.0;    ///< mm, a smaller distance is reported
  double share = 0.05;       ///< of a clearance, to which it is known
  std::size_t chunk = 8192;  ///< instants that one thread follows
  bool accelerated = true;   ///< false: every pair at every instant and between, to compare with
  std::function<void(double)> progress = {};  ///< 0 .. 1, from any thread
};

/// A moment between instants.
struct Moment {
  std::size_t instant = 0;
  double u = 0.0;  ///< of the way to the next
};

/// Two bodies in contact, or nearer than the clearance, from one stretch to another.
struct Encounter {
  int pair = 0;
  bool contact = false;
  std::size_t first_segment = 0, last_segment = 0;
  Moment begin;           ///< of first contact, else of coming within the clearance
  Moment moment;          ///< of first contact, else of where they are nearest
  double distance = 0.0;  ///< mm, then
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  ///< mm, between the two, then, in the frame of
                                                    ///< the carriages
};

/// How near a pair comes in the whole program.
struct PairClearance {
  bool overlaps_at_start = false;  ///< and is then not followed
  double distance = 0.0;           ///< mm, 0 for contact; infinite where only contact is looked for
                                   ///< and there is none
  Moment moment;
};

/// Smallest clearance of a stretch.
struct SegmentClearance {
  double at_least = 0.0;  ///< mm, and at most that / (1 - share), or 0.01 mm more
  int pair = -1;          ///< that has it; -1 where no pair is followed
};

struct Encounters {
  std::vector<Encounter> list;              ///< in the order of the program, then of pairs
  std::vector<PairClearance> pairs;         ///< (pairs)
  std::vector<SegmentClearance> stretches;  ///< (stretches)
  std::size_t queries = 0;                  ///< of distances
};

/// Follows pairs through a motion. Between two instants a body is on a screw, halved until that is
/// within a fifth of the resolution, so that nothing is passed (`approach`): contact is reported
/// where two bodies come as near as the resolution, and not after they meet. A distance that is
/// known holds until the motion since could have used it up, so most pairs are seldom asked.
/// The same for any number of threads.
/// @throws std::invalid_argument for numbers that do not fit each other, or an option that is not
///         positive
Encounters encounters(const std::vector<CarrierBody>& bodies, const std::vector<BodyPair>& pairs,
                      const CarrierMotion& motion, const EncounterOptions& options = {});

}  // namespace abbe::cutting
