#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cutting/surface/cutter_entry.h"
#include "cutting/surface/nose_sweep.h"
#include "cutting/surface/tool.h"

/// The edge of a turning tool, and the search for the points at which its sweep cuts a ray.
namespace abbe::cutting {

/// The region inside the edge of a nose, in the x-z plane of frame t about its origin.
class NoseEdge {
 public:
  /// @throws std::invalid_argument unless radius > 0, every number is finite and the waves leave a
  ///         positive radius everywhere; or if an insert's profile has waves
  explicit NoseEdge(const Nose& nose);

  /// Returns the radius of a circle that contains the whole edge, mm.
  double outer_radius() const {
    return nose_.profile ? nose_.profile->outer_radius : nose_.radius + wave_sum_;
  }

  /// Returns the reach of the edge in a direction of length 1 or less, mm; for a round edge
  /// `outer_radius` in every direction.
  double reach(const Eigen::Vector2d& direction) const {
    return nose_.profile ? direction.dot(extreme_point(*nose_.profile, direction)) : outer_radius();
  }

  /// Returns true if the edge is the profile of an insert. A line may then run along a straight
  /// edge.
  bool has_profile() const { return nose_.profile != nullptr; }
  const EdgeProfile& profile() const { return *nose_.profile; }

  /// Returns true if the point (x, z) lies inside or on the edge.
  bool contains(const Eigen::Vector2d& point) const { return signed_distance(point) <= 0.0; }

  /// Returns the smallest s >= from at which point + s * step lies inside, or nothing. The error is
  /// 1e-12 mm along the line for a circle, 1e-12 mm across the edge for a profile, and 1e-11 mm for
  /// a waved edge, of which chords shorter than 1e-6 mm may be missed.
  std::optional<double> entry(const Eigen::Vector2d& point, const Eigen::Vector2d& step,
                              double from) const;

  /// Returns the s at which a line that misses the region is nearest to it (to the centre of a
  /// round edge); `from` if the line passes a profile before `from`.
  double nearest_s(const Eigen::Vector2d& point, const Eigen::Vector2d& step, double from) const;

  /// Returns an upper bound of the distance of a point outside the edge, mm; negative inside.
  double distance_bound(const Eigen::Vector2d& point) const {
    return nose_.profile ? distance(nose_.profile->segments, point).value
                         : point.norm() - outer_radius();
  }

 private:
  double signed_distance(const Eigen::Vector2d& point) const;
  std::optional<double> waved_entry(const Eigen::Vector2d& point, const Eigen::Vector2d& step,
                                    double begin, double end) const;

  Nose nose_;
  double wave_sum_ = 0.0;   // mm, largest deviation of the edge from the circle
  double lipschitz_ = 1.0;  // of signed_distance, outside the largest circle inside the edge
};

/// The point and the instant at which the sweep of a turning tool cuts a ray.
struct NoseCut {
  double s = 0.0;  ///< mm along the normal; -band if the ray starts in removed material
  double time_s = 0.0;
  int interval = 0;  ///< from sample `interval` to the next
  double u = 0.0;    ///< instant within the interval, 0 .. 1
  int line = 0;      ///< program line of the interval
};

/// The sweep of a turning tool, searchable along rays in the workpiece. Immutable once constructed;
/// memory is linear in samples plus revolutions.
class NoseCutSearch {
 public:
  /// @throws std::invalid_argument as NoseEdge and nose_sweep
  NoseCutSearch(const Nose& nose, const NoseMotion& motion);

  /// Returns the first cut along the ray: the smallest s, and the earliest of equal s.
  std::optional<NoseCut> first(const Ray& ray_w) const;

  /// Returns at least one cut of every revolution that cuts at or before `limit` (mm), in the order
  /// of time. A cut at the join of two intervals is returned twice.
  std::vector<NoseCut> within(const Ray& ray_w, double limit) const;

  /// Returns the first cut among those whose spindle travel differs from that of `other` by at most
  /// `window` (rad).
  std::optional<NoseCut> first_in_window(const Ray& ray_w, const NoseCut& other,
                                         double window) const;

  /// Returns the angle through which the spindle turns until the cut, rad; both directions count as
  /// positive.
  double spindle_travel(const NoseCut& cut) const;

 private:
  template <class Visitor>
  void for_each_segment(const Ray& ray_w, const Visitor& visit) const;
  int segment_index(const NoseCut& cut) const;

  NoseEdge edge_;
  NoseSweep sweep_;
  std::optional<ProfileBound> bound_;   // only for an edge with a profile
  std::vector<double> spindle_travel_;  // rad, at the beginning of every interval
};

}  // namespace abbe::cutting
