#include "cutting/segment_grid.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace abbe::cutting {

using Eigen::Vector3d;

double distance(const Vector3d& p, const Segment& s) {
  const Vector3d d = s.b - s.a;
  const double length2 = d.squaredNorm();
  const double u = length2 > 0.0 ? std::clamp((p - s.a).dot(d) / length2, 0.0, 1.0) : 0.0;
  return (p - s.a - u * d).norm();
}

SegmentGrid::SegmentGrid(std::vector<Segment> segments, double cell)
    : segments_(std::move(segments)), cell_(cell) {
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    const Segment& s = segments_[i];
    const int steps = static_cast<int>(std::ceil((s.b - s.a).norm() / (0.5 * cell_))) + 1;
    for (int k = 0; k <= steps; ++k) {
      auto& list = cells_[cell_of(s.a + (s.b - s.a) * (double(k) / steps))];
      if (list.empty() || list.back() != i) list.push_back(i);
    }
  }
}

// sample points stand at most a quarter cell from any point of a segment, so a segment within one
// cell size of p has a sample within 1.25: two cells away at most
bool SegmentGrid::is_within(const Vector3d& p, double radius) const {
  const Cell c = cell_of(p);
  for (std::int64_t i = -2; i <= 2; ++i)
    for (std::int64_t j = -2; j <= 2; ++j)
      for (std::int64_t k = -2; k <= 2; ++k) {
        const auto found = cells_.find({c[0] + i, c[1] + j, c[2] + k});
        if (found == cells_.end()) continue;
        for (const std::size_t s : found->second)
          if (distance(p, segments_[s]) < radius) return true;
      }
  return false;
}

std::size_t SegmentGrid::Hash::operator()(const Cell& c) const {
  std::uint64_t h = 0x9e3779b97f4a7c15ull;
  for (const std::int64_t v : c) h = (h ^ static_cast<std::uint64_t>(v)) * 0xff51afd7ed558ccdull;
  return static_cast<std::size_t>(h ^ (h >> 32));
}

SegmentGrid::Cell SegmentGrid::cell_of(const Vector3d& p) const {
  Cell cell;
  for (int k = 0; k < 3; ++k)
    cell[static_cast<std::size_t>(k)] = static_cast<std::int64_t>(std::floor(p[k] / cell_));
  return cell;
}

}  // namespace abbe::cutting
