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

/// The nodes in space and the lines through them. For dexels they are numbered along x, y and z,
/// for a profile by radius, angle and height; no lines run around the axis.
class SkinLattice {
 public:
  explicit SkinLattice(const StockSkin& skin)
      : T_wk_(skin.T_wk), kind_(skin.lattice), edge_(skin.spacing) {
    // Skew to the faces: along a face whole layers of lines would be in or out.
    if (kind_ == StockSkin::Lattice::ThreeDirections)
      T_wk_.rotate(Eigen::Quaterniond(0.79, 0.23, 0.41, 0.17).normalized());
    T_kw_ = T_wk_.inverse();
    for (const auto& p : skin.mesh.vertices_w.rowwise()) box_.extend(numbers_of(p.transpose()));
    if (is_round()) box_.min()[0] = 0.0;
    // Nodes of a profile are half a step off its axis.
    if (is_round()) offset_ = Vector3d(0.5, 0.0, 0.5);
    set_spacing(skin.spacing);
  }
  SkinLattice with_spacing(double spacing) const {
    SkinLattice other = *this;
    other.set_spacing(spacing);
    return other;
  }

  bool is_round() const { return kind_ == StockSkin::Lattice::Profile; }
  double spacing() const { return step_[0]; }

  std::vector<int> directions() const {
    switch (kind_) {
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
  double at(int direction, int node) const {
    return (node + offset_[direction]) * step_[direction];
  }
  int node_above(int direction, double at) const {
    return int(std::ceil(at / step_[direction] - offset_[direction]));
  }
  double lower(int direction) const {
    return box_.min()[direction] - (is_round() && direction == 0 ? 0.0 : spacing());
  }
  double upper(int direction) const { return box_.max()[direction] + spacing(); }

  /// Returns the point on a line at a height along it.
  Vector3d place(const LatticeNode& line, int direction, double height) const {
    Vector3d c;
    for (int k = 0; k < 3; ++k) c[k] = k == direction ? height : at(k, line[std::size_t(k)]);
    if (!is_round()) return T_wk_ * c;
    return T_wk_ * Vector3d(c[0] * std::cos(c[1]), c[0] * std::sin(c[1]), c[2]);
  }
  Vector3d along(const LatticeNode& line, int direction) const {
    if (!is_round() || direction == 2) return T_wk_.linear().col(direction);
    const double angle = at(1, line[1]);
    return T_wk_.linear() * Vector3d(std::cos(angle), std::sin(angle), 0.0);
  }

  /// Returns the area that a line represents at a height, mm^2.
  double area(const LatticeNode& line, int direction, double height) const {
    if (!is_round()) return step_[0] * step_[0];
    return (direction == 0 ? height : at(0, line[0])) * step_[1] * step_[0];
  }
  /// Returns the fraction of a displacement to the design that is measured along this direction;
  /// the fractions of all directions sum to one.
  double share(int direction, const Vector3d& way_w) const {
    if (kind_ == StockSkin::Lattice::OneDirection) return 1.0;
    const double cosine = T_wk_.linear().col(direction).dot(way_w);
    if (!is_round()) return cosine * cosine;
    const double axial = T_wk_.linear().col(2).dot(way_w);
    return direction == 2 ? axial * axial : 1.0 - axial * axial;
  }

  /// Returns how far the skin may be off its points at an edge, mm.
  double edge() const { return edge_; }

  /// Returns the extent of the corners of a triangle in lattice coordinates; angles are within half
  /// a turn of each other.
  std::array<Vector3d, 2> extent(const TriangleTree& tree, int triangle) const {
    Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
    std::optional<double> angle;
    for (const int corner : tree.triangles().row(triangle)) {
      Vector3d c = numbers_of(tree.vertices().row(corner));
      if (is_round() && c[0] < 1e-9) {  // a point on the axis has any angle
        low[0] = 0.0;
        continue;
      }
      if (is_round() && angle) c[1] = *angle + std::remainder(c[1] - *angle, units::full_turn);
      angle = c[1];
      low = low.cwiseMin(c);
      high = high.cwiseMax(c);
    }
    return {low, high};
  }

  Vector3d numbers_of(const Vector3d& place_w) const {
    const Vector3d p = T_kw_ * place_w;
    return is_round() ? Vector3d(std::hypot(p.x(), p.y()), std::atan2(p.y(), p.x()), p.z()) : p;
  }

 private:
  void set_spacing(double spacing) {
    step_ = Vector3d::Constant(spacing);
    if (is_round()) step_[1] = units::full_turn / half_planes;
  }

  Eigen::Isometry3d T_wk_, T_kw_;
  StockSkin::Lattice kind_;
  double edge_;
  Eigen::AlignedBox3d box_;  // of the skin
  Vector3d step_ = Vector3d::Ones(), offset_ = Vector3d::Zero();
};

/// Label of an end that is at the design, not at the skin.
constexpr int at_design = -3;

/// A part of a line that is in material, or outside it, from skin to skin.
struct LineSpan {
  double from = 0.0, to = 0.0;  // mm along
  int from_region = at_design, to_region = at_design;
};

/// A part of a span that is off the design.
struct DeviationSegment {
  LineSpan span;
  double volume = 0.0;
  double farthest = 0.0;  // mm off the design
  bool counts = false;    // true if it belongs to the measured region
};

/// A direction and the lattice coordinates of the line; the one along the direction is 0.
struct LatticeLine {
  int direction = 0;
  LatticeNode node{};
  auto operator<=>(const LatticeLine&) const = default;
};

// The volume of one region: found by its lines, then by the lines that cross them.
class VolumeBetween {
 public:
  VolumeBetween(const TriangleTree& tree, const SkinLattice& lattice, const DesignDistance& design,
                const SkinRegions& regions, Between which, int region)
      : tree_(tree),
        lattice_(lattice),
        design_(design),
        regions_(regions),
        sign_(which == Between::Left ? 1.0 : -1.0),
        region_(region) {}

  double from(const std::vector<int>& triangles) {
    std::vector<LatticeLine> front = lines_at(triangles);
    look(front, [this](const LatticeLine& line, Measured& found) { add_at_skin(line, found); });
    std::map<LatticeLine, std::size_t> seen;  // segments of a line that were followed
    while (!front.empty()) front = followed(front, seen);
    Sum sum;
    for (const auto& [line, measured] : lines_)
      for (const DeviationSegment& one : measured.stretches)
        if (one.counts) sum.add(is_shared(one.span) ? 0.5 * one.volume : one.volume);
    return sum.value();
  }

 private:
  struct Measured {
    std::vector<LineSpan> spans;
    std::vector<DeviationSegment> stretches;
  };
  struct Off {
    double by;     // mm off the design, on the measured side
    double share;  // fraction of it that is measured along the line
    bool is_beyond;
    int triangle;
  };
  /// A walk along a line from a point off the design to where the line meets the design or the span
  /// ends.
  struct Walk {
    double to;
    bool reached_end;
    double volume = 0.0, farthest = 0.0;
  };

  static bool is_shared(const LineSpan& one) {
    return one.from_region >= 0 && one.to_region >= 0 && one.from_region != one.to_region;
  }

  int region_at(int triangle, const Vector3d& place) const {
    int best = -1;
    double least = std::numeric_limits<double>::infinity();
    for (const int corner : tree_.triangles().row(triangle)) {
      const double squared = (Vector3d(tree_.vertices().row(corner)) - place).squaredNorm();
      if (squared >= least) continue;
      least = squared;
      best = corner;
    }
    return regions_.of[std::size_t(best)];
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
    constexpr double rim = 1e-9;
    const int first = (direction + 1) % 3, second = (direction + 2) % 3;
    const auto past = [&](int k, int node) { return !(lattice_.at(k, node) <= high[k] + rim); };
    for (int i = lattice_.node_above(first, low[first] - rim); !past(first, i); ++i)
      for (int j = lattice_.node_above(second, low[second] - rim); !past(second, j); ++j) {
        LatticeLine line{direction, {}};
        line.node[std::size_t(first)] = i;
        line.node[std::size_t(second)] = j;
        if (lattice_.is_round()) line.node[1] = (line.node[1] + half_planes) % half_planes;
        lines.push_back(line);
      }
  }

  /// Applies `act` to lines, which are all different, in parallel.
  template <typename Act>
  void look(const std::vector<LatticeLine>& lines, const Act& act) {
    std::vector<Measured*> found;
    for (const LatticeLine& line : lines) found.push_back(&lines_[line]);
    tbb::parallel_for(std::size_t(0), lines.size(), [&](std::size_t i) {
      if (found[i]->spans.empty()) found[i]->spans = spans(lines[i]);
      act(lines[i], *found[i]);
    });
  }

  /// Returns the spans of a line that are in material, or outside it.
  std::vector<LineSpan> spans(const LatticeLine& line) const {
    // Begin outside the part; for a profile that is far off its axis.
    const double lower = lattice_.lower(line.direction), upper = lattice_.upper(line.direction);
    const Vector3d start = lattice_.place(line.node, line.direction, upper),
                   direction = -lattice_.along(line.node, line.direction);
    struct Passed {
      double at;
      int region;
    };
    std::vector<LineSpan> all;
    Passed last{upper, at_design};
    bool is_material = false;
    const auto add = [&](const Passed& next) {
      if (is_material == (sign_ > 0.0) && last.at > next.at)
        all.push_back({next.at, last.at, next.region, last.region});
      last = next;
      is_material = !is_material;
    };
    for (double gone = 0.0; gone < upper - lower;) {
      const auto met =
          tree_.first_hit(start + gone * direction, direction,
                          is_material ? TriangleTree::Side::Inner : TriangleTree::Side::Outer,
                          upper - lower - gone);
      if (!met) break;
      gone += met->along;
      add({upper - gone, region_at(met->triangle, start + gone * direction)});
    }
    add({lower, at_design});
    return all;
  }

  Off off(const LatticeLine& line, double height, int guess) const {
    const DesignDistance::At at =
        design_.at(lattice_.place(line.node, line.direction, height), guess);
    const double length = at.from.norm();
    const Vector3d way = length > 1e-6 ? Vector3d(at.from / length) : at.normal;
    return {sign_ * at.value, lattice_.share(line.direction, way), at.is_beyond, at.triangle};
  }
  static bool is_off(const Off& at) { return at.by > 0.0 && !at.is_beyond; }

  /// Steps of half the distance from the design, so that the design is not passed where it is
  /// thicker than half a spacing.
  Walk walk(const LatticeLine& line, double here, double end) const {
    Walk way{here, true};
    Off at = off(line, here, -1);
    while (here != end) {
      const double step = std::max(0.5 * at.by, 0.5 * lattice_.spacing());
      const double there =
          std::abs(end - here) <= step ? end : here + std::copysign(step, end - here);
      const Off next = off(line, there, at.triangle);
      if (!is_off(next)) {
        const double edge = edge_between(line, here, at, there, next);
        add(line, way, here, at, edge, off(line, edge, next.triangle));
        way.reached_end = false;
        return way;
      }
      add(line, way, here, at, there, next);
      here = there;
      at = next;
    }
    return way;
  }

  /// Adds a step; it is halved where the direction to the design changes, as it does at the
  /// bisector of a corner.
  void add(const LatticeLine& line, Walk& way, double here, const Off& at, double there,
           const Off& next) const {
    if (std::abs(at.share - next.share) > 0.1 &&
        std::abs(there - here) > 0.2 * lattice_.spacing()) {
      const double middle = 0.5 * (here + there);
      const Off between = off(line, middle, at.triangle);
      add(line, way, here, at, middle, between);
      return add(line, way, middle, between, there, next);
    }
    way.to = there;
    way.farthest = std::max({way.farthest, at.by, next.by});
    way.volume += 0.5 * (at.share + next.share) * std::abs(there - here) *
                  lattice_.area(line.node, line.direction, 0.5 * (here + there));
  }

  /// Returns the position at which a line comes to the design.
  double edge_between(const LatticeLine& line, double off_at, Off at, double on_at,
                      Off next) const {
    const double close = 1e-6 * lattice_.spacing();
    for (int i = 0; i < 60 && std::abs(on_at - off_at) > close; ++i) {
      // A plane is met in one step; every third step bisects, so the interval always shrinks.
      double share = 0.5;
      if (i % 3 != 2 && !next.is_beyond)
        share = std::clamp(at.by / (at.by - next.by), 1e-3, 1.0 - 1e-3);
      const double between = off_at + share * (on_at - off_at);
      const Off found = off(line, between, at.triangle);
      (is_off(found) ? off_at : on_at) = between;
      (is_off(found) ? at : next) = found;
    }
    return 0.5 * (off_at + on_at);
  }

  /// Adds the segments that begin where the line meets the skin of the region.
  void add_at_skin(const LatticeLine& line, Measured& found) const {
    for (const LineSpan& span : found.spans) {
      double covered = span.from;
      if (span.from_region == region_ && is_off(off(line, span.from, -1))) {
        const Walk up = walk(line, span.from, span.to);
        covered = up.to;
        found.stretches.push_back(
            {{span.from, up.to, region_, up.reached_end ? span.to_region : at_design},
             up.volume,
             up.farthest,
             true});
      }
      if (span.to_region == region_ && covered < span.to && is_off(off(line, span.to, -1))) {
        const Walk down = walk(line, span.to, span.from);
        found.stretches.push_back(
            {{down.to, span.to, down.reached_end ? span.from_region : at_design, region_},
             down.volume,
             down.farthest,
             true});
      }
    }
  }

  /// Adds the segment around a point of a line that is off the design, unless it is known.
  void add_around(const LatticeLine& line, double at, Measured& found) const {
    const auto holds = [&](const LineSpan& one) { return one.from <= at && at <= one.to; };
    if (std::ranges::any_of(found.stretches, holds, &DeviationSegment::span)) return;
    const auto span = std::ranges::find_if(found.spans, holds);
    if (span == found.spans.end() || !is_off(off(line, at, -1))) return;
    const Walk down = walk(line, at, span->from), up = walk(line, at, span->to);
    DeviationSegment one{{down.to, up.to, down.reached_end ? span->from_region : at_design,
                          up.reached_end ? span->to_region : at_design},
                         down.volume + up.volume,
                         std::max(down.farthest, up.farthest)};
    one.counts = is_open(one);
    found.stretches.push_back(one);
  }

  /// Returns true if a segment that was met inside belongs to the region: not if it ends at the
  /// skin of another region, or between skin and design where the mesh may have filled an edge.
  bool is_open(const DeviationSegment& one) const {
    double least = regions_.limit;
    for (const int end : {one.span.from_region, one.span.to_region}) {
      if (end >= 0 || end == SkinRegions::never) return false;
      if (end == SkinRegions::within) least = regions_.limit + lattice_.edge();
    }
    return one.farthest > least;
  }

  /// Adds the segments that cross these lines. @return the lines with new segments
  std::vector<LatticeLine> followed(const std::vector<LatticeLine>& front,
                                    std::map<LatticeLine, std::size_t>& seen) {
    std::map<LatticeLine, std::vector<double>> crossed;
    for (const LatticeLine& line : front) {
      const std::vector<DeviationSegment>& all = lines_.at(line).stretches;
      std::size_t& first = seen[line];
      for (; first < all.size(); ++first)
        if (all[first].counts) add_crossings(line, all[first].span, crossed);
    }
    std::vector<LatticeLine> lines;
    for (const auto& [line, places] : crossed) lines.push_back(line);
    look(lines, [&](const LatticeLine& line, Measured& found) {
      for (const double at : crossed.at(line)) add_around(line, at, found);
    });
    std::erase_if(lines, [&](const LatticeLine& line) {
      return lines_.at(line).stretches.size() == seen[line];
    });
    return lines;
  }

  /// Adds every line that crosses a segment in a node, and the position on it.
  void add_crossings(const LatticeLine& line, const LineSpan& stretch,
                     std::map<LatticeLine, std::vector<double>>& crossed) const {
    const auto along = std::size_t(line.direction);
    for (int i = lattice_.node_above(line.direction, stretch.from);
         lattice_.at(line.direction, i) < stretch.to; ++i)
      for (const int direction : lattice_.directions()) {
        if (direction == line.direction) continue;
        LatticeLine other{direction, line.node};
        other.node[along] = i;
        other.node[std::size_t(direction)] = 0;
        crossed[other].push_back(lattice_.at(direction, line.node[std::size_t(direction)]));
      }
  }

  const TriangleTree& tree_;  // of the skin
  const SkinLattice& lattice_;
  const DesignDistance& design_;
  const SkinRegions& regions_;
  double sign_;
  int region_;
  std::map<LatticeLine, Measured> lines_;
};

/// Returns (regions) the triangles with a corner in each region.
std::vector<std::vector<int>> triangles_by_region(const StockSkin& skin,
                                                  const SkinRegions& regions) {
  std::vector<std::vector<int>> all(std::size_t(regions.count));
  for (Index t = 0; t < skin.mesh.triangles.rows(); ++t)
    for (const int corner : skin.mesh.triangles.row(t)) {
      const int region = regions.of[std::size_t(corner)];
      if (region < 0) continue;
      std::vector<int>& list = all[std::size_t(region)];
      if (list.empty() || list.back() != int(t)) list.push_back(int(t));
    }
  return all;
}

/// Returns the spacing of the lines for a region, mm: some 2000 lines per direction, but neither
/// much finer nor coarser than the dexels.
double spacing_for(const StockSkin& skin, const std::vector<int>& triangles) {
  constexpr double worth = 2000.0, rings = 200.0;  // lines of a direction, nodes along a profile
  double area = 0.0, turned = 0.0;
  const Vector3d axis = skin.T_wk.linear().col(2);
  for (const int t : triangles) {
    const Eigen::RowVector3i c = skin.mesh.triangles.row(t);
    const Vector3d a = skin.mesh.vertices_w.row(c[0]), b = skin.mesh.vertices_w.row(c[1]),
                   d = skin.mesh.vertices_w.row(c[2]);
    const double one = 0.5 * (b - a).cross(d - a).norm();
    area += one;
    turned += one * axis.cross((a + b + d) / 3.0 - skin.T_wk.translation()).norm();
  }
  if (skin.lattice == StockSkin::Lattice::Profile) {
    const double length = area * area / (units::full_turn * turned);
    return std::max(length / rings, skin.spacing);
  }
  // Between dexels of one direction nothing is known of walls along them.
  const double least = skin.lattice == StockSkin::Lattice::OneDirection ? 1.0 : 0.125;
  return std::clamp(std::sqrt(area / worth), least * skin.spacing, 4.0 * skin.spacing);
}

}  // namespace

std::vector<double> volumes_between(const StockSkin& skin, const DesignDistance& design,
                                    const SkinRegions& regions, Between which) {
  if (regions.of.size() != std::size_t(skin.mesh.vertices_w.rows()))
    throw std::invalid_argument("volumes: a region of every vertex is needed");
  std::vector<double> all;
  if (regions.count == 0) return all;
  const TriangleTree tree(skin.mesh.vertices_w, skin.mesh.triangles);
  const SkinLattice any(skin);
  const std::vector<std::vector<int>> triangles = triangles_by_region(skin, regions);
  for (int region = 0; region < regions.count; ++region) {
    const std::vector<int>& its = triangles[std::size_t(region)];
    const SkinLattice lattice = any.with_spacing(spacing_for(skin, its));
    all.push_back(VolumeBetween(tree, lattice, design, regions, which, region).from(its));
  }
  return all;
}

}  // namespace abbe::cutting
