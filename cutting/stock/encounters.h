#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "cutting/stock/collision.h"

/// Near misses and contacts of bodies during a program.
namespace abbe::cutting {

/// A body on a carriage.
struct CarrierBody {
  Body body;        ///< in the frame of its carriage
  int carrier = 0;  ///< index of the carriage
};

/// Two bodies that may meet, by their indices.
struct BodyPair {
  int a = 0, b = 0;
  bool contact_only = false;  ///< true if distances without contact are not needed
};

/// The motion of the carriages at the instants 0, 1, 2 ...
struct CarrierMotion {
  int carriers = 0;
  std::size_t instants = 0;
  /// Sets the pose of every carriage at an instant plus a fraction u of the interval to the next,
  /// all in one frame. Must be thread-safe.
  std::function<void(std::size_t instant, double u, std::span<kinematics::Pose> T)> place;
  /// (instants - 1) mm, upper bound of the deviation of any point of a body from the straight line
  /// between its positions at two instants, relative to another body.
  std::vector<double> bulge;
  /// (segments) first instant of each segment of the program for which a clearance is computed,
  /// such as a block; ascending from 0.
  std::vector<std::size_t> segments;
};

/// Returns the first instant after a segment.
std::size_t segment_end(const CarrierMotion& motion, std::size_t stretch);

struct EncounterOptions {
  double resolution = 5e-3;  ///< mm, a smaller distance is contact
  double clearance = 0.0;    ///< mm, a smaller distance is reported
  double share = 0.05;       ///< relative accuracy of a clearance
  std::size_t chunk = 8192;  ///< number of instants in a task of one thread
  bool accelerated = true;   ///< false: search every pair at and between all instants, for tests
  std::function<void(double)> progress = {};  ///< 0 .. 1, may be called from any thread
};

/// A time between two instants.
struct Moment {
  std::size_t instant = 0;
  double u = 0.0;  ///< fraction of the interval to the next
};

/// Contact of two bodies, or a distance below the clearance, over consecutive segments.
struct Encounter {
  int pair = 0;
  bool contact = false;
  std::size_t first_segment = 0, last_segment = 0;
  Moment begin;   ///< first contact, or the time at which the distance falls below the clearance
  Moment moment;  ///< first contact, or the time of the least distance
  double distance = 0.0;                            ///< mm, at `moment`
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  ///< mm, between the two bodies at `moment`, in
                                                    ///< the frame of the carriages
};

/// The least distance of a pair in the whole program.
struct PairClearance {
  bool overlaps_at_start = false;  ///< true excludes the pair from the search
  double distance = 0.0;  ///< mm, 0 for contact; infinite without contact if only contact is
                          ///< searched
  Moment moment;
};

/// The smallest clearance of a segment.
struct SegmentClearance {
  double min_clearance = 0.0;  ///< mm, a lower bound; the clearance is at most that / (1 - share),
                               ///< or 0.01 mm more
  int pair = -1;               ///< the pair with that clearance; -1 if no pair is searched
};

/// Result of `encounters`.
struct Encounters {
  std::vector<Encounter> list;             ///< in the order of the program, then of pairs
  std::vector<PairClearance> pairs;        ///< (pairs)
  std::vector<SegmentClearance> segments;  ///< (segments)
  std::size_t queries = 0;                 ///< number of distances computed
};

/// Searches the pairs for contacts and near misses during a motion. Between two instants a body
/// moves on a screw; intervals are halved until the screw is within a fifth of the resolution of
/// the motion, so that no contact is missed (`approach`). Contact is reported when two bodies come
/// within the resolution, and not later than they meet. A distance remains a valid bound until the
/// motion since then exceeds it, so most distances are seldom computed. The result is the same for
/// any number of threads.
/// @throws std::invalid_argument for numbers that do not match, or an option that is not positive
Encounters encounters(const std::vector<CarrierBody>& bodies, const std::vector<BodyPair>& pairs,
                      const CarrierMotion& motion, const EncounterOptions& options = {});

}  // namespace abbe::cutting
