#pragma once

#include <optional>

#include <Eigen/Core>

#include "cutting/tool.h"

namespace abbe::cutting {

/// The region inside a nose's edge, in the x-z plane of frame t about its origin.
class NoseEdge {
 public:
  /// @throws std::invalid_argument unless radius > 0, every number is finite and the waves leave a
  ///         positive radius everywhere
  explicit NoseEdge(const Nose& nose);

  /// Radius of a circle that holds the whole edge, mm.
  double outer_radius() const { return nose_.radius + wave_sum_; }

  /// Whether a point (x, z) lies inside the edge or on it.
  bool contains(const Eigen::Vector2d& point) const { return outside_by(point) <= 0.0; }

  /// Smallest s >= from at which point + s * step lies inside: to 1e-12 mm along the line for a
  /// circle, to 1e-11 mm for a waved edge, whose chords shorter than 1e-6 mm may be passed over.
  std::optional<double> entry(const Eigen::Vector2d& point, const Eigen::Vector2d& step,
                              double from) const;

 private:
  double outside_by(const Eigen::Vector2d& point) const;
  std::optional<double> waved_entry(const Eigen::Vector2d& point, const Eigen::Vector2d& step,
                                    double begin, double end) const;

  Nose nose_;
  double wave_sum_ = 0.0;   // mm, how far the edge leaves the circle at most
  double lipschitz_ = 1.0;  // of outside_by, outside the smallest circle inside the edge
};

}  // namespace abbe::cutting
