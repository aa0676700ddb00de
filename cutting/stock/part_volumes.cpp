#include "cutting/stock/part_volumes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include <tbb/parallel_for.h>

#include "cutting/part/compensated_sum.h"
#include "cutting/part/index_sets.h"
#include "kinematics/units.h"

namespace abbe::cutting {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

constexpr int half_planes = 12;  // of a profile

using LatticeNode = std::array<int, 3>;

/// The lattice of nodes in space and the lines through them. The coordinates of a node are x, y and
/// z for dexels, and radius, angle and height for a profile, which has no lines around the axis.
class SkinLattice {
 public:
  explicit SkinLattice(const StockSkin& skin)
      : T_wk_(skin.T_wk), lattice_kind_(skin.lattice), skin_error_(skin.spacing) {
    // Skew to the faces, because whole layers of lines along a face would be inside or outside.
    if (lattice_kind_ == StockSkin::Lattice::ThreeDirections)
      T_wk_.rotate(Eigen::Quaterniond(0.79, 0.23, 0.41, 0.17).normalized());
    T_kw_ = T_wk_.inverse();
    for (const auto& p : skin.mesh.vertices_w.rowwise())
      box_.extend(lattice_coordinates(p.transpose()));
    if (is_profile()) box_.min()[0] = 0.0;
    // Nodes of a profile are half a step off its axis.
    if (is_profile()) offset_ = Vector3d(0.5, 0.0, 0.5);
    set_spacing(skin.spacing);
  }
  SkinLattice with_spacing(double spacing) const {
    SkinLattice copy = *this;
    copy.set_spacing(spacing);
    return copy;
  }

  bool is_profile() const { return lattice_kind_ == StockSkin::Lattice::Profile; }
  double spacing() const { return step_[0]; }

  std::vector<int> directions() const {
    switch (lattice_kind_) {
      case StockSkin::Lattice::ThreeDirections:
        return {0, 1, 2};
      case StockSkin::Lattice::OneDirection:
        return {2};
      case StockSkin::Lattice::Profile:
        break;
    }
    return {0, 2};
  }

  /// Returns the coordinate of a node, mm, or rad for an angle.
  double coordinate(int direction, int node) const {
    return (node + offset_[direction]) * step_[direction];
  }
  int node_above(int direction, double coordinate) const {
    return int(std::ceil(coordinate / step_[direction] - offset_[direction]));
  }
  double lower(int direction) const {
    return box_.min()[direction] - (is_profile() && direction == 0 ? 0.0 : spacing());
  }
  double upper(int direction) const { return box_.max()[direction] + spacing(); }

  /// Returns the point on a line at a height along it.
  Vector3d point(const LatticeNode& line, int direction, double height) const {
    Vector3d c;
    for (int k = 0; k < 3; ++k)
      c[k] = k == direction ? height : coordinate(k, line[std::size_t(k)]);
    if (!is_profile()) return T_wk_ * c;
    return T_wk_ * Vector3d(c[0] * std::cos(c[1]), c[0] * std::sin(c[1]), c[2]);
  }
  Vector3d direction_vector(const LatticeNode& line, int direction) const {
    if (!is_profile() || direction == 2) return T_wk_.linear().col(direction);
    const double angle = coordinate(1, line[1]);
    return T_wk_.linear() * Vector3d(std::cos(angle), std::sin(angle), 0.0);
  }

  /// Returns the area that a line represents at a height, mm^2.
  double area(const LatticeNode& line, int direction, double height) const {
    if (!is_profile()) return step_[0] * step_[0];
    return (direction == 0 ? height : coordinate(0, line[0])) * step_[1] * step_[0];
  }
  /// Returns the fraction of a deviation that is measured along this direction; the fractions of
  /// all directions sum to one.
  /// @param direction_w  unit, from the design
  double measured_fraction(int direction, const Vector3d& direction_w) const {
    if (lattice_kind_ == StockSkin::Lattice::OneDirection) return 1.0;
    const double cosine = T_wk_.linear().col(direction).dot(direction_w);
    if (!is_profile()) return cosine * cosine;
    const double axial = T_wk_.linear().col(2).dot(direction_w);
    return direction == 2 ? axial * axial : 1.0 - axial * axial;
  }

  /// Returns the largest distance of the skin from its points at an edge, mm.
  double skin_error() const { return skin_error_; }

  /// Returns the range of a triangle's corners in lattice coordinates. Angles are unwrapped so that
  /// they differ by at most half a revolution.
  std::array<Vector3d, 2> extent(const TriangleTree& tree, int triangle) const {
    Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
    std::optional<double> angle;
    for (const int corner : tree.triangles().row(triangle)) {
      Vector3d c = lattice_coordinates(tree.vertices().row(corner));
      if (is_profile() && c[0] < 1e-9) {  // a point on the axis has any angle
        low[0] = 0.0;
        continue;
      }
      if (is_profile() && angle) c[1] = *angle + std::remainder(c[1] - *angle, units::full_turn);
      angle = c[1];
      low = low.cwiseMin(c);
      high = high.cwiseMax(c);
    }
    return {low, high};
  }

  Vector3d lattice_coordinates(const Vector3d& position_w) const {
    const Vector3d p = T_kw_ * position_w;
    return is_profile() ? Vector3d(std::hypot(p.x(), p.y()), std::atan2(p.y(), p.x()), p.z()) : p;
  }

 private:
  void set_spacing(double spacing) {
    step_ = Vector3d::Constant(spacing);
    if (is_profile()) step_[1] = units::full_turn / half_planes;
  }

  Eigen::Isometry3d T_wk_, T_kw_;
  StockSkin::Lattice lattice_kind_;
  double skin_error_;
  Eigen::AlignedBox3d box_;  // of the skin
  Vector3d step_ = Vector3d::Ones(), offset_ = Vector3d::Zero();
};

/// Region of a span's end at the design instead of the skin.
constexpr int at_design = -3;

/// A part of a line from skin to skin, either in material or outside it.
struct LineSpan {
  double begin = 0.0, end = 0.0;  // mm along
  int begin_region = at_design, end_region = at_design;
};

/// A part of a span that deviates from the design.
struct DeviationSegment {
  LineSpan span;
  double volume = 0.0;
  double max_deviation = 0.0;  // mm off the design
  bool is_counted = false;     // true if it belongs to the measured region
};

/// A line of the lattice: its direction and its node, whose coordinate along the direction is 0.
struct LatticeLine {
  int direction = 0;
  LatticeNode node{};
  auto operator<=>(const LatticeLine&) const = default;
};

/// Computation of the volume of one region: measures the lines through its triangles, then the
/// lines that cross the measured segments, and so on.
class RegionVolume {
 public:
  RegionVolume(const TriangleTree& tree, const SkinLattice& lattice, const DesignDistance& design,
               const SkinRegions& regions, DeviationSide side, int region)
      : tree_(tree),
        lattice_(lattice),
        design_(design),
        regions_(regions),
        sign_(side == DeviationSide::Excess ? 1.0 : -1.0),
        region_(region) {}

  double compute(const std::vector<int>& triangles) {
    std::vector<LatticeLine> front = lines_at(triangles);
    measure_lines(front, [this](const LatticeLine& line, LineMeasurement& measurement) {
      add_at_skin(line, measurement);
    });
    std::map<LatticeLine, std::size_t> followed_counts;  // segments of a line that were followed
    while (!front.empty()) front = follow_segments(front, followed_counts);
    CompensatedSum sum;
    for (const auto& [line, measured] : lines_)
      for (const DeviationSegment& segment : measured.segments)
        if (segment.is_counted)
          sum.add(is_shared(segment.span) ? 0.5 * segment.volume : segment.volume);
    return sum.value();
  }

 private:
  struct LineMeasurement {
    std::vector<LineSpan> spans;
    std::vector<DeviationSegment> segments;
  };
  struct DeviationSample {
    double deviation;  // mm off the design, on the measured side
    double fraction;   // fraction of it that is measured along the line
    bool is_beyond;
    int triangle;
  };
  /// Result of a walk along a line from a point off the design to the design or the end of the
  /// span.
  struct Walk {
    double to;
    bool reaches_end;
    double volume = 0.0, max_deviation = 0.0;
  };

  static bool is_shared(const LineSpan& span) {
    return span.begin_region >= 0 && span.end_region >= 0 && span.begin_region != span.end_region;
  }

  int region_at(int triangle, const Vector3d& point) const {
    int best = -1;
    double min_squared_distance = std::numeric_limits<double>::infinity();
    for (const int corner : tree_.triangles().row(triangle)) {
      const double squared = (Vector3d(tree_.vertices().row(corner)) - point).squaredNorm();
      if (squared >= min_squared_distance) continue;
      min_squared_distance = squared;
      best = corner;
    }
    return regions_.region[std::size_t(best)];
  }

  std::vector<LatticeLine> lines_at(const std::vector<int>& triangles) const {
    std::vector<LatticeLine> lines;
    for (const int t : triangles) {
      const auto [low, high] = lattice_.extent(tree_, t);
      for (const int direction : lattice_.directions()) add_lines(low, high, direction, lines);
    }
    return sorted_unique(std::move(lines));
  }

  void add_lines(const Vector3d& low, const Vector3d& high, int direction,
                 std::vector<LatticeLine>& lines) const {
    // mm or rad; a line through a corner must not be lost by rounding
    constexpr double rounding = 1e-9;
    const int first = (direction + 1) % 3, second = (direction + 2) % 3;
    const auto is_past = [&](int k, int node) {
      return !(lattice_.coordinate(k, node) <= high[k] + rounding);
    };
    for (int i = lattice_.node_above(first, low[first] - rounding); !is_past(first, i); ++i)
      for (int j = lattice_.node_above(second, low[second] - rounding); !is_past(second, j); ++j) {
        LatticeLine line{direction, {}};
        line.node[std::size_t(first)] = i;
        line.node[std::size_t(second)] = j;
        if (lattice_.is_profile()) line.node[1] = (line.node[1] + half_planes) % half_planes;
        lines.push_back(line);
      }
  }

  /// Applies `measure` to lines in parallel; the lines must be different.
  template <typename Act>
  void measure_lines(const std::vector<LatticeLine>& lines, const Act& measure) {
    std::vector<LineMeasurement*> measurements;
    for (const LatticeLine& line : lines) measurements.push_back(&lines_[line]);
    tbb::parallel_for(std::size_t(0), lines.size(), [&](std::size_t i) {
      if (measurements[i]->spans.empty()) measurements[i]->spans = spans(lines[i]);
      measure(lines[i], *measurements[i]);
    });
  }

  /// Returns the spans of a line: those in material for an excess, otherwise those outside it.
  std::vector<LineSpan> spans(const LatticeLine& line) const {
    // Begin outside the part; for a profile far from its axis.
    const double lower = lattice_.lower(line.direction), upper = lattice_.upper(line.direction);
    const Vector3d start = lattice_.point(line.node, line.direction, upper),
                   direction = -lattice_.direction_vector(line.node, line.direction);
    struct SkinCrossing {
      double position;
      int region;
    };
    std::vector<LineSpan> result;
    SkinCrossing previous{upper, at_design};
    bool is_material = false;
    const auto add = [&](const SkinCrossing& next) {
      if (is_material == (sign_ > 0.0) && previous.position > next.position)
        result.push_back({next.position, previous.position, next.region, previous.region});
      previous = next;
      is_material = !is_material;
    };
    for (double travelled = 0.0; travelled < upper - lower;) {
      const auto hit =
          tree_.first_hit(start + travelled * direction, direction,
                          is_material ? TriangleTree::Side::Inner : TriangleTree::Side::Outer,
                          upper - lower - travelled);
      if (!hit) break;
      travelled += hit->along;
      add({upper - travelled, region_at(hit->triangle, start + travelled * direction)});
    }
    add({lower, at_design});
    return result;
  }

  DeviationSample sample(const LatticeLine& line, double height, int guess) const {
    const DesignDistance::PointDistance distance =
        design_.at(lattice_.point(line.node, line.direction, height), guess);
    const double length = distance.from.norm();
    const Vector3d direction = length > 1e-6 ? Vector3d(distance.from / length) : distance.normal;
    return {sign_ * distance.value, lattice_.measured_fraction(line.direction, direction),
            distance.is_beyond, distance.triangle};
  }
  static bool is_off_design(const DeviationSample& current) {
    return current.deviation > 0.0 && !current.is_beyond;
  }

  /// Walks in steps of half the distance from the design, so that it does not pass through a design
  /// thicker than half a spacing.
  Walk walk(const LatticeLine& line, double position, double end) const {
    Walk walk_result{position, true};
    DeviationSample current = sample(line, position, -1);
    while (position != end) {
      const double step = std::max(0.5 * current.deviation, 0.5 * lattice_.spacing());
      const double next_position =
          std::abs(end - position) <= step ? end : position + std::copysign(step, end - position);
      const DeviationSample next_sample = sample(line, next_position, current.triangle);
      if (!is_off_design(next_sample)) {
        const double edge = design_crossing(line, position, current, next_position, next_sample);
        add(line, walk_result, position, current, edge, sample(line, edge, next_sample.triangle));
        walk_result.reaches_end = false;
        return walk_result;
      }
      add(line, walk_result, position, current, next_position, next_sample);
      position = next_position;
      current = next_sample;
    }
    return walk_result;
  }

  /// Adds a step of a walk. Halves it if the direction to the design changes, as at the bisector of
  /// a corner.
  void add(const LatticeLine& line, Walk& walk_result, double position,
           const DeviationSample& current, double next_position,
           const DeviationSample& next_sample) const {
    if (std::abs(current.fraction - next_sample.fraction) > 0.1 &&
        std::abs(next_position - position) > 0.2 * lattice_.spacing()) {
      const double middle = 0.5 * (position + next_position);
      const DeviationSample between = sample(line, middle, current.triangle);
      add(line, walk_result, position, current, middle, between);
      return add(line, walk_result, middle, between, next_position, next_sample);
    }
    walk_result.to = next_position;
    walk_result.max_deviation =
        std::max({walk_result.max_deviation, current.deviation, next_sample.deviation});
    walk_result.volume +=
        0.5 * (current.fraction + next_sample.fraction) * std::abs(next_position - position) *
        lattice_.area(line.node, line.direction, 0.5 * (position + next_position));
  }

  /// Returns the position between two samples at which a line reaches the design.
  double design_crossing(const LatticeLine& line, double off_position, DeviationSample current,
                         double on_position, DeviationSample next_sample) const {
    const double tolerance = 1e-6 * lattice_.spacing();
    for (int i = 0; i < 60 && std::abs(on_position - off_position) > tolerance; ++i) {
      // A plane takes one step; every third step bisects, so the interval always shrinks.
      double fraction = 0.5;
      if (i % 3 != 2 && !next_sample.is_beyond)
        fraction = std::clamp(current.deviation / (current.deviation - next_sample.deviation), 1e-3,
                              1.0 - 1e-3);
      const double between = off_position + fraction * (on_position - off_position);
      const DeviationSample middle = sample(line, between, current.triangle);
      (is_off_design(middle) ? off_position : on_position) = between;
      (is_off_design(middle) ? current : next_sample) = middle;
    }
    return 0.5 * (off_position + on_position);
  }

  /// Adds the segments that begin where the line meets the skin of the region.
  void add_at_skin(const LatticeLine& line, LineMeasurement& measurement) const {
    for (const LineSpan& span : measurement.spans) {
      double covered = span.begin;
      if (span.begin_region == region_ && is_off_design(sample(line, span.begin, -1))) {
        const Walk up = walk(line, span.begin, span.end);
        covered = up.to;
        measurement.segments.push_back(
            {{span.begin, up.to, region_, up.reaches_end ? span.end_region : at_design},
             up.volume,
             up.max_deviation,
             true});
      }
      if (span.end_region == region_ && covered < span.end &&
          is_off_design(sample(line, span.end, -1))) {
        const Walk down = walk(line, span.end, span.begin);
        measurement.segments.push_back(
            {{down.to, span.end, down.reaches_end ? span.begin_region : at_design, region_},
             down.volume,
             down.max_deviation,
             true});
      }
    }
  }

  /// Adds the segment around a position of a line that is off the design, unless it exists already.
  void add_segment_at(const LatticeLine& line, double position,
                      LineMeasurement& measurement) const {
    const auto contains = [&](const LineSpan& candidate) {
      return candidate.begin <= position && position <= candidate.end;
    };
    if (std::ranges::any_of(measurement.segments, contains, &DeviationSegment::span)) return;
    const auto span = std::ranges::find_if(measurement.spans, contains);
    if (span == measurement.spans.end() || !is_off_design(sample(line, position, -1))) return;
    const Walk down = walk(line, position, span->begin), up = walk(line, position, span->end);
    DeviationSegment segment{{down.to, up.to, down.reaches_end ? span->begin_region : at_design,
                              up.reaches_end ? span->end_region : at_design},
                             down.volume + up.volume,
                             std::max(down.max_deviation, up.max_deviation)};
    segment.is_counted = is_of_region(segment);
    measurement.segments.push_back(segment);
  }

  /// Returns true if a segment met on a crossing line belongs to the region. It does not if it ends
  /// at the skin of a region, or if it may be an edge filled by the mesh.
  bool is_of_region(const DeviationSegment& segment) const {
    double min_deviation = regions_.limit;
    for (const int end : {segment.span.begin_region, segment.span.end_region}) {
      if (end >= 0 || end == SkinRegions::excluded) return false;
      if (end == SkinRegions::within_limit) min_deviation = regions_.limit + lattice_.skin_error();
    }
    return segment.max_deviation > min_deviation;
  }

  /// Adds the segments that cross those of the given lines. Returns the lines with new segments.
  std::vector<LatticeLine> follow_segments(const std::vector<LatticeLine>& front,
                                           std::map<LatticeLine, std::size_t>& followed_counts) {
    std::map<LatticeLine, std::vector<double>> crossed;
    for (const LatticeLine& line : front) {
      const std::vector<DeviationSegment>& segments = lines_.at(line).segments;
      std::size_t& first = followed_counts[line];
      for (; first < segments.size(); ++first)
        if (segments[first].is_counted) add_crossings(line, segments[first].span, crossed);
    }
    std::vector<LatticeLine> lines;
    for (const auto& [line, positions] : crossed) lines.push_back(line);
    measure_lines(lines, [&](const LatticeLine& line, LineMeasurement& measurement) {
      for (const double position : crossed.at(line)) add_segment_at(line, position, measurement);
    });
    std::erase_if(lines, [&](const LatticeLine& line) {
      return lines_.at(line).segments.size() == followed_counts[line];
    });
    return lines;
  }

  /// Adds every line that crosses a span in a node, with its position on that line.
  void add_crossings(const LatticeLine& line, const LineSpan& span,
                     std::map<LatticeLine, std::vector<double>>& crossed) const {
    const auto along = std::size_t(line.direction);
    for (int i = lattice_.node_above(line.direction, span.begin);
         lattice_.coordinate(line.direction, i) < span.end; ++i)
      for (const int direction : lattice_.directions()) {
        if (direction == line.direction) continue;
        LatticeLine crossing_line{direction, line.node};
        crossing_line.node[along] = i;
        crossing_line.node[std::size_t(direction)] = 0;
        crossed[crossing_line].push_back(
            lattice_.coordinate(direction, line.node[std::size_t(direction)]));
      }
  }

  const TriangleTree& tree_;  // of the skin
  const SkinLattice& lattice_;
  const DesignDistance& design_;
  const SkinRegions& regions_;
  double sign_;
  int region_;
  std::map<LatticeLine, LineMeasurement> lines_;
};

/// Returns, for each region, the triangles with a corner in it.
std::vector<std::vector<int>> triangles_by_region(const StockSkin& skin,
                                                  const SkinRegions& regions) {
  std::vector<std::vector<int>> result(std::size_t(regions.count));
  for (Index t = 0; t < skin.mesh.triangles.rows(); ++t)
    for (const int corner : skin.mesh.triangles.row(t)) {
      const int region = regions.region[std::size_t(corner)];
      if (region < 0) continue;
      std::vector<int>& list = result[std::size_t(region)];
      if (list.empty() || list.back() != int(t)) list.push_back(int(t));
    }
  return result;
}

/// Returns the spacing of the lines for a region, mm: some 2000 lines per direction, but not much
/// finer or coarser than the dexels.
double spacing_for(const StockSkin& skin, const std::vector<int>& triangles) {
  constexpr double lines_per_direction = 2000.0, nodes_per_profile = 200.0;
  double area = 0.0, moment = 0.0;
  const Vector3d axis = skin.T_wk.linear().col(2);
  for (const int t : triangles) {
    const Eigen::RowVector3i c = skin.mesh.triangles.row(t);
    const Vector3d a = skin.mesh.vertices_w.row(c[0]), b = skin.mesh.vertices_w.row(c[1]),
                   d = skin.mesh.vertices_w.row(c[2]);
    const double triangle_area = 0.5 * (b - a).cross(d - a).norm();
    area += triangle_area;
    moment += triangle_area * axis.cross((a + b + d) / 3.0 - skin.T_wk.translation()).norm();
  }
  if (skin.lattice == StockSkin::Lattice::Profile) {
    const double length = area * area / (units::full_turn * moment);
    return std::max(length / nodes_per_profile, skin.spacing);
  }
  // Walls along dexels of one direction are unknown between the dexels.
  const double min_factor = skin.lattice == StockSkin::Lattice::OneDirection ? 1.0 : 0.125;
  return std::clamp(std::sqrt(area / lines_per_direction), min_factor * skin.spacing,
                    4.0 * skin.spacing);
}

}  // namespace

std::vector<double> volumes_between(const StockSkin& skin, const DesignDistance& design,
                                    const SkinRegions& regions, DeviationSide side) {
  if (regions.region.size() != std::size_t(skin.mesh.vertices_w.rows()))
    throw std::invalid_argument("volumes: expected one region per vertex");
  std::vector<double> volumes;
  if (regions.count == 0) return volumes;
  const TriangleTree tree(skin.mesh.vertices_w, skin.mesh.triangles);
  const SkinLattice base_lattice(skin);
  const std::vector<std::vector<int>> triangles = triangles_by_region(skin, regions);
  for (int region = 0; region < regions.count; ++region) {
    const std::vector<int>& region_triangles = triangles[std::size_t(region)];
    const SkinLattice lattice = base_lattice.with_spacing(spacing_for(skin, region_triangles));
    volumes.push_back(
        RegionVolume(tree, lattice, design, regions, side, region).compute(region_triangles));
  }
  return volumes;
}

}  // namespace abbe::cutting
