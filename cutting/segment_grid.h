#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

namespace abbe::cutting {

struct Segment {
  Eigen::Vector3d a, b;
};

/// mm from a point to the nearest one of a segment.
double distance(const Eigen::Vector3d& p, const Segment& s);

/// Segments by the cells of a cubic grid that they pass, so that only near ones are tried.
class SegmentGrid {
 public:
  /// @param cell  mm, > 0; radii that are asked for must not exceed it
  SegmentGrid(std::vector<Segment> segments, double cell);

  /// Whether a segment comes nearer to the point than `radius`.
  bool is_within(const Eigen::Vector3d& p, double radius) const;

 private:
  using Cell = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Cell& c) const;
  };
  Cell cell_of(const Eigen::Vector3d& p) const;

  std::vector<Segment> segments_;
  double cell_;
  std::unordered_map<Cell, std::vector<std::size_t>, Hash> cells_;
};

}  // namespace abbe::cutting
