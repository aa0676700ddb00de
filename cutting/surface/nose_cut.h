#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/nose_sweep.h"
#include "cutting/surface/tool.h"

namespace abbe::cutting {

/// The region inside a nose's edge, in the x-z plane of frame t about its origin.
class NoseEdge {
 public:
  /// @throws std::invalid_argument unless radius > 0, every number is finite and the waves leave a
  ///         positive radius everywhere; for waves on the profile of an insert
  explicit NoseEdge(const Nose& nose);

  /// Radius of a circle that holds the whole edge, mm.
  double outer_radius() const {
    return nose_.profile ? nose_.profile->outer_radius : nose_.radius + wave_sum_;
  }

  /// mm, how far the edge reaches in a direction of length 1 or less; of a round one `outer_radius`
  /// of any.
  double reach(const Eigen::Vector2d& direction) const {
    return nose_.profile ? direction.dot(extreme_point(*nose_.profile, direction)) : outer_radius();
  }

  /// Whether it has straight edges, along which a line may run.
  bool has_profile() const { return nose_.profile != nullptr; }
  const EdgeProfile& profile() const { return *nose_.profile; }

  /// Whether a point (x, z) lies inside the edge or on it.
  bool contains(const Eigen::Vector2d& point) const { return outside_by(point) <= 0.0; }

  /// Smallest s >= from at which point + s * step lies inside: to 1e-12 mm along the line for a
  /// circle and, across the edge, for a profile; to 1e-11 mm for a waved edge, whose chords shorter
  /// than 1e-6 mm may be passed over.
  std::optional<double> entry(const Eigen::Vector2d& point, const Eigen::Vector2d& step,
                              double from) const;

  /// Of a line that misses the region: the s at which it comes nearest, to the middle of a round
  /// edge; of one that has passed a profile by `from`, that.
  double nearest(const Eigen::Vector2d& point, const Eigen::Vector2d& step, double from) const;

  /// mm, at most how far a point is outside; negative where it is inside.
  double beyond(const Eigen::Vector2d& point) const {
    return nose_.profile ? distance(nose_.profile->pieces, point).value
                         : point.norm() - outer_radius();
  }

 private:
  double outside_by(const Eigen::Vector2d& point) const;
  std::optional<double> waved_entry(const Eigen::Vector2d& point, const Eigen::Vector2d& step,
                                    double begin, double end) const;

  Nose nose_;
  double wave_sum_ = 0.0;   // mm, how far the edge leaves the circle at most
  double lipschitz_ = 1.0;  // of outside_by, outside the smallest circle inside the edge
};

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
class NoseCutSearch {
 public:
  /// @throws std::invalid_argument as NoseEdge and nose_sweep
  NoseCutSearch(const Nose& nose, const NoseMotion& motion);

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
  void for_each_segment(const Ray& ray_w, const Use& use) const;
  int piece_at(const NoseCut& cut) const;

  NoseEdge edge_;
  NoseSweep sweep_;
  std::optional<ProfileBound> bound_;  // of an edge with a profile
  std::vector<double> turned_;         // rad, at the beginning of every interval
};

}  // namespace abbe::cutting
