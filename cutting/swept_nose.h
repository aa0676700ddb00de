#pragma once

#include <optional>
#include <vector>

#include "cutting/cutter_entry.h"
#include "cutting/nose_edge.h"
#include "cutting/nose_sweep.h"
#include "cutting/profile_bound.h"

namespace abbe::cutting {

/// A place at which a turning tool's sweep meets a ray, and the instant.
struct NoseCut {
  double s = 0.0;  ///< mm along the normal; -band if the ray starts in removed material
  double time_s = 0.0;
  int interval = 0;  ///< from sample `interval` to the next
  double u = 0.0;    ///< instant within it, 0 .. 1
  int line = 0;      ///< program line of the interval
};

/// The sweep of a turning tool, asked along rays of the workpiece. Immutable once made; linear in
/// samples plus revolutions.
class SweptNose {
 public:
  /// @throws std::invalid_argument as NoseEdge and nose_sweep
  SweptNose(const Nose& nose, const NoseMotion& motion);

  /// First cut along the ray: smallest s, of equal ones the earliest.
  std::optional<NoseCut> first(const Ray& ray_w) const;

  /// At least one cut of every revolution that comes to `limit` (mm) or nearer, in the order of
  /// time; a join of two intervals reports its cut twice.
  std::vector<NoseCut> within(const Ray& ray_w, double limit) const;

  /// First cut among those whose spindle angle is within `window` (rad) of that of `other`.
  std::optional<NoseCut> near(const Ray& ray_w, const NoseCut& other, double window) const;

  /// rad, how far the spindle has turned until then, to and fro alike.
  double turned(const NoseCut& cut) const;

 private:
  template <class Use>
  void each_stretch(const Ray& ray_w, const Use& use) const;
  int piece_at(const NoseCut& cut) const;

  NoseEdge edge_;
  NoseSweep sweep_;
  std::optional<ProfileBound> bound_;  // of an edge with a profile
  std::vector<double> turned_;         // rad, at the beginning of every interval
};

}  // namespace abbe::cutting
