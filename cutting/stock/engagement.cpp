#include "cutting/stock/engagement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include "cutting/stock/stock.h"

namespace abbe::cutting {

using Eigen::Vector2d;
using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr int min_corner_slices = 6;        // slices
constexpr double min_feed_fraction = 1e-9;  // of the feed; a smaller lateral component is rounding
constexpr double angle_tolerance = 1e-7;    // rad, or mm along the outline; accuracy of the skin

void check(const Cutter& cutter, const EngagementOptions& options) {
  check_cutter(cutter);
  if (options.slices_per_radius < 1 || options.angles < 4 || !(options.max_slice > 0.0))
    throw std::invalid_argument(
        "engagement: expected at least 1 slice per radius, at least 4 angles and slices above 0 "
        "mm");
}

/// A line or an arc of an outline, parameterised by the length along the outline.
struct OutlineElement {
  double begin, end;  // mm
  Vector2d from;      // (radius, height) at the beginning
  double kappa;       // rad, at the beginning
  double radius;      // mm; 0: a line

  double kappa_at(double length) const {
    return radius > 0.0 ? kappa + (length - begin) / radius : kappa;
  }
  Vector2d point(double length) const {
    const double half_turn = radius > 0.0 ? 0.5 * (length - begin) / radius : 0.0;
    const double chord_length = radius > 0.0 ? 2.0 * radius * std::sin(half_turn) : length - begin;
    if (kappa == 0.5 * pi && radius == 0.0) return {from.x(), from.y() + chord_length};
    return from + chord_length * Vector2d(std::cos(kappa + half_turn), std::sin(kappa + half_turn));
  }
};

/// The outline of a cutter below its top, parameterised by the length from the centre of the
/// bottom.
class CutterOutline {
 public:
  explicit CutterOutline(const Cutter& cutter) {
    if (cutter.outline) {
      for (const OutlineSegment& segment : cutter.outline->segments) add(segment);
      elements_.pop_back();  // the flat at the top
      return;
    }
    const double flat_radius = cutter.radius - cutter.corner_radius;
    add(flat_radius, {0.0, 0.0}, 0.0, 0.0);
    add(0.5 * pi * cutter.corner_radius, {flat_radius, 0.0}, 0.0, cutter.corner_radius);
    add(cutter.flank_length - cutter.corner_radius, {cutter.radius, cutter.corner_radius}, 0.5 * pi,
        0.0);
  }

  const std::vector<OutlineElement>& elements() const { return elements_; }
  double kappa(double length) const { return element(length).kappa_at(length); }
  /// Returns (radius, height).
  Vector2d point(double length) const { return element(length).point(length); }

 private:
  void add(double length, const Vector2d& from, double kappa, double radius) {
    if (!(length > 0.0)) return;
    const double begin = elements_.empty() ? 0.0 : elements_.back().end;
    elements_.push_back({begin, begin + length, from, kappa, radius});
  }
  void add(const OutlineSegment& segment) {
    const auto kappa = [](const Vector2d& normal) { return std::atan2(normal.x(), -normal.y()); };
    const double arc_angle = kappa(segment.normal_to) - kappa(segment.normal_from);
    const double length =
        segment.is_arc ? segment.radius * arc_angle : (segment.to - segment.from).norm();
    add(length, segment.from, kappa(segment.normal_from), segment.radius);
  }
  const OutlineElement& element(double length) const {
    std::size_t i = elements_.size() - 1;
    while (i > 0 && length < elements_[i].begin) --i;
    return elements_[i];
  }

  std::vector<OutlineElement> elements_;
};

/// Returns the positions along the outline of the borders between slices. A slice begins with every
/// line and arc.
std::vector<double> slice_borders(const Cutter& cutter, const EngagementOptions& options) {
  const CutterOutline outline(cutter);
  const double reference_length = 0.5 * pi * cutter.radius / options.slices_per_radius;
  std::vector<double> positions{0.0};
  for (const OutlineElement& element : outline.elements()) {
    const double begin = positions.back();
    // An element shorter than 1e-12 of the radius is rounding.
    if (!(element.end - begin > 1e-12 * cutter.radius)) continue;
    const double max_length =
        element.radius > 0.0
            ? std::min(reference_length, 0.5 * pi * element.radius / min_corner_slices)
        : element.kappa > 0.0 ? std::min(reference_length, options.max_slice)
                              : reference_length;
    // 1e-9, so that rounding does not add a slice to a whole number of them.
    const int count = std::max(1, int(std::ceil((element.end - begin) / max_length - 1e-9)));
    for (int i = 1; i <= count; ++i) positions.push_back(begin + (element.end - begin) * i / count);
  }
  return positions;
}

EdgeSlice slice_between(const CutterOutline& outline, double from, double to) {
  const double middle_length = 0.5 * (from + to);
  const Vector2d point = outline.point(middle_length);
  return {point.y(), point.x(), to - from, outline.kappa(middle_length)};
}

/// Returns the half angle, rad, of the arc about the feed direction in which a slice faces the
/// feed.
double facing_half_angle(double kappa, const Vector3d& feed_t, double lateral) {
  // From n . feed > min_facing with n = (sin kappa cos delta, ., -cos kappa).
  const double required =
      min_feed_component + (kappa == 0.5 * pi ? 0.0 : std::cos(kappa)) * feed_t.z();
  const double amplitude = std::sin(kappa) * lateral;
  if (required >= amplitude) return 0.0;
  if (required <= -amplitude) return pi;
  return std::acos(required / amplitude);
}

/// Search for the engaged arcs in the depth field over the cutter's surface, whose coordinates are
/// the angle from the feed and the length along the outline.
class EngagementSearch {
 public:
  EngagementSearch(const Stock& stock, const Cutter& cutter, const Eigen::Isometry3d& T_wt,
                   const EngagementOptions& options)
      : probe_(stock, T_wt),
        outline_(cutter),
        slice_borders_(slice_borders(cutter, options)),
        bin_count_(2 * ((options.angles + 1) / 2)),
        bin_width_(2.0 * pi / bin_count_),
        // Beyond 3 spacings outside only the sign of a depth is meaningful.
        max_outside_depth_(3.0 * stock.spacing) {}

  Engagement compute(const Vector3d& feed_t) {
    Engagement result;
    result.feed_t = feed_t;
    double lateral = feed_t.head<2>().norm();
    if (lateral < min_feed_fraction) lateral = 0.0;
    feed_angle_ = lateral > 0.0 ? std::atan2(feed_t.y(), feed_t.x()) : 0.0;
    for (int k = -bin_count_ / 2; k <= bin_count_ / 2; ++k)
      directions_.emplace_back(std::cos(feed_angle_ + k * bin_width_),
                               std::sin(feed_angle_ + k * bin_width_));
    const std::size_t n = slice_borders_.size() - 1;
    result.slices.reserve(n + 64);
    std::vector<double> half_angle(n);
    for (std::size_t i = 0; i < n; ++i) {
      result.slices.push_back(slice_between(outline_, slice_borders_[i], slice_borders_[i + 1]));
      half_angle[i] = facing_half_angle(result.slices[i].kappa, feed_t, lateral);
    }
    DepthRow lower;
    for (std::size_t i = 0; i < n; ++i) {
      if (half_angle[i] <= 0.0) {
        lower = {};
        continue;
      }
      if (lower.depths.empty()) lower = depth_row(slice_borders_[i], half_angle[i]);
      const double row_half_angle = std::max(half_angle[i], i + 1 < n ? half_angle[i + 1] : 0.0);
      widen(lower, half_angle[i]);
      DepthRow upper = depth_row(slice_borders_[i + 1], row_half_angle);
      add_slice(int(i), half_angle[i], lower, upper, result);
      lower = std::move(upper);
    }
    return result;
  }

 private:
  /// The depths at the borders of the bins -count .. count about the feed, at one position along
  /// the outline.
  struct DepthRow {
    double at = 0.0;
    int count = 0;
    std::vector<double> depths;  // (2 count + 1)

    double depth(int bin) const { return depths[std::size_t(bin + count)]; }
  };
  struct Corner {
    double angle, at, depth;
  };
  /// The part of a bin of a slice that is in material.
  struct Region {
    double area = 0.0;             // rad mm
    double from = 0.0, to = 0.0;   // rad
    double low = 0.0, high = 0.0;  // mm of outline
  };

  double depth(double angle, double at) {
    const Vector2d point = outline_.point(at);
    return probe_.depth({point.x() * std::cos(feed_angle_ + angle),
                         point.x() * std::sin(feed_angle_ + angle), point.y()});
  }

  int bins_within(double half_angle) const {
    return std::min(bin_count_ / 2, int(std::ceil(half_angle / bin_width_ - 1e-9)));
  }

  DepthRow depth_row(double at, double half_angle) {
    DepthRow result{at, bins_within(half_angle), {}};
    result.depths.resize(std::size_t(2 * result.count + 1));
    const Vector2d point = outline_.point(at);
    for (int k = -result.count; k <= result.count; ++k) {
      const Vector2d& direction = directions_[std::size_t(k + bin_count_ / 2)];
      result.depths[std::size_t(k + result.count)] =
          probe_.depth({point.x() * direction.x(), point.x() * direction.y(), point.y()});
    }
    return result;
  }

  void widen(DepthRow& depth_row, double half_angle) {
    if (bins_within(half_angle) > depth_row.count)
      depth_row = this->depth_row(depth_row.at, half_angle);
  }

  void add_slice(int slice, double half_angle, const DepthRow& lower, const DepthRow& upper,
                 Engagement& result) {
    const int count = bins_within(half_angle);
    double arc_begin = 0.0;
    bool is_open = false;
    const auto close_arc = [&](double to) {
      if (is_open && to > arc_begin) add_arc(slice, arc_begin, to, result);
      is_open = false;
    };
    for (int k = -count; k < count; ++k) {
      const double from = std::max(-half_angle, k * bin_width_),
                   to = std::min(half_angle, (k + 1) * bin_width_);
      const double d[4] = {lower.depth(k), lower.depth(k + 1), upper.depth(k), upper.depth(k + 1)};
      const bool all_inside = d[0] > 0.0 && d[1] > 0.0 && d[2] > 0.0 && d[3] > 0.0;
      if (all_inside) {
        if (!is_open) arc_begin = from;
        is_open = true;
        continue;
      }
      if (!(d[0] > 0.0 || d[1] > 0.0 || d[2] > 0.0 || d[3] > 0.0)) {
        close_arc(from);
        continue;
      }
      const Region region = material_region(k, lower, upper, d);
      const bool is_full_length =
          region.area >= (1.0 - 1e-6) * (region.to - region.from) * (upper.at - lower.at);
      const double at = std::max(from, region.from), end = std::min(to, region.to);
      if (!is_full_length) {
        close_arc(from);
        add_partial_slice(region, at, end, result);
      } else if (d[0] > 0.0) {  // an arc from the previous bin ends in this one
        if (!is_open) arc_begin = from;
        is_open = true;
        close_arc(end);
      } else {
        close_arc(from);
        arc_begin = at;
        is_open = true;
      }
    }
    close_arc(half_angle);
  }

  void add_arc(int slice, double from, double to, Engagement& result) const {
    result.arcs.push_back({slice, feed_angle_ + from, feed_angle_ + to});
  }

  /// Adds the region as a partial slice with its average length over its angles.
  void add_partial_slice(const Region& region, double from, double to, Engagement& result) const {
    const double width = region.to - region.from;
    if (!(to > from) || !(width > 0.0)) return;
    const double length = region.area / width;
    const double middle_length = 0.5 * (region.low + region.high);
    if (!(length > 0.0)) return;
    const EdgeSlice part =
        slice_between(outline_, middle_length - 0.5 * length, middle_length + 0.5 * length);
    result.slices.push_back(part);
    add_arc(int(result.slices.size()) - 1, from, to, result);
  }

  /// Returns the part of a bin that is in material: the polygon of the corners in material and the
  /// points where the skin crosses the sides.
  Region material_region(int bin, const DepthRow& lower, const DepthRow& upper, const double* d) {
    const double left = bin * bin_width_, right = (bin + 1) * bin_width_;
    const std::array<Corner, 4> corners{Corner{left, lower.at, d[0]}, Corner{right, lower.at, d[1]},
                                        Corner{right, upper.at, d[3]},
                                        Corner{left, upper.at, d[2]}};
    std::array<Vector2d, 8> polygon;
    std::size_t count = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const Corner& a = corners[k];
      const Corner& b = corners[(k + 1) % 4];
      if (a.depth > 0.0) polygon[count++] = {a.angle, a.at};
      if ((a.depth > 0.0) != (b.depth > 0.0)) polygon[count++] = skin_crossing(a, b);
    }
    Region region{0.0, right, left, upper.at, lower.at};
    for (std::size_t k = 0; k < count; ++k) {
      const Vector2d& a = polygon[k];
      const Vector2d& b = polygon[(k + 1) % count];
      region.area +=
          0.5 * ((a.x() - left) * (b.y() - lower.at) - (b.x() - left) * (a.y() - lower.at));
      region.from = std::min(region.from, a.x());
      region.to = std::max(region.to, a.x());
      region.low = std::min(region.low, a.y());
      region.high = std::max(region.high, a.y());
    }
    return region;
  }

  /// Returns the point where the skin passes between two corners. Always searches from the corner
  /// in material, so that neighbouring bins get the same point.
  Vector2d skin_crossing(const Corner& a, const Corner& b) {
    const bool is_a_inside = a.depth > 0.0;
    const Corner& inner = is_a_inside ? a : b;
    const Corner& outer = is_a_inside ? b : a;
    const Vector2d from(inner.angle, inner.at), to(outer.angle, outer.at);
    const double reach = std::abs(to.x() - from.x()) + std::abs(to.y() - from.y());
    double in = 0.0, out = 1.0;
    double depth_in = inner.depth, depth_out = std::max(outer.depth, -max_outside_depth_);
    double x = 0.0;
    for (int i = 0; i < 50; ++i) {
      // Illinois method: a secant that halves the value of a retained end.
      x = in + (out - in) * depth_in / (depth_in - depth_out);
      const Vector2d point = from + x * (to - from);
      const double point_depth = std::max(depth(point.x(), point.y()), -max_outside_depth_);
      if (std::abs(point_depth) < 1e-10 || (out - in) * reach < angle_tolerance) break;
      if (point_depth > 0.0) {
        if (x - in < 0.5 * (out - in)) depth_out *= 0.5;
        in = x;
        depth_in = point_depth;
      } else {
        if (out - x < 0.5 * (out - in)) depth_in *= 0.5;
        out = x;
        depth_out = point_depth;
      }
    }
    return from + x * (to - from);
  }

  DepthProbe probe_;
  CutterOutline outline_;
  std::vector<double> slice_borders_;
  int bin_count_;
  double bin_width_;  // rad
  double max_outside_depth_;
  double feed_angle_ = 0.0;           // rad, of the feed across the axis
  std::vector<Vector2d> directions_;  // of the borders of bins, in frame t
};

}  // namespace

std::vector<EdgeSlice> slices(const Cutter& cutter, const EngagementOptions& options) {
  check(cutter, options);
  const CutterOutline outline(cutter);
  const std::vector<double> borders = slice_borders(cutter, options);
  std::vector<EdgeSlice> result;
  for (std::size_t i = 0; i + 1 < borders.size(); ++i)
    result.push_back(slice_between(outline, borders[i], borders[i + 1]));
  return result;
}

Engagement engagement(const Stock& stock, const Cutter& cutter, const Eigen::Isometry3d& T_wt,
                      const Vector3d& feed_w, const EngagementOptions& options) {
  check(cutter, options);
  const double feed = feed_w.norm();
  if (!T_wt.matrix().allFinite() || !std::isfinite(feed))
    throw std::invalid_argument("engagement: expected a finite pose and feed");
  if (!(feed > 0.0)) throw std::invalid_argument("engagement: expected a feed above 0");
  const Vector3d feed_t = T_wt.linear().transpose() * (feed_w / feed);
  return EngagementSearch(stock, cutter, T_wt, options).compute(feed_t);
}

}  // namespace abbe::cutting
