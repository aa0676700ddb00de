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

constexpr int fewest_in_corner = 6;  // slices
constexpr double no_feed = 1e-9;     // fraction of the feed; smaller components are rounding
constexpr double end_angle = 1e-7;   // rad, accuracy of the ends of arcs

void check(const Cutter& cutter, const EngagementOptions& options) {
  check_cutter(cutter);
  if (options.slices_per_radius < 1 || options.angles < 4 || !(options.max_slice > 0.0))
    throw std::invalid_argument(
        "engagement: expected 1 or more slices a radius, 4 or more angles, slices above 0 mm");
}

/// A line or an arc of an outline, parameterised by the length along the outline.
struct OutlineSegment {
  double begin, end;  // mm
  Vector2d from;      // (radius, height) at its beginning
  double kappa;       // rad, at its beginning
  double radius;      // mm; 0: a line

  double kappa_at(double at) const { return radius > 0.0 ? kappa + (at - begin) / radius : kappa; }
  Vector2d place(double at) const {
    const double half = radius > 0.0 ? 0.5 * (at - begin) / radius : 0.0;
    const double far = radius > 0.0 ? 2.0 * radius * std::sin(half) : at - begin;
    if (kappa == 0.5 * pi && radius == 0.0) return {from.x(), from.y() + far};
    return from + far * Vector2d(std::cos(kappa + half), std::sin(kappa + half));
  }
};

/// The outline of a cutter below its top, parameterised by the length along it from the centre of
/// its bottom.
class CutterOutline {
 public:
  explicit CutterOutline(const Cutter& cutter) {
    if (cutter.outline) {
      for (const OutlinePiece& piece : cutter.outline->pieces) add(piece);
      stretches_.pop_back();  // the flat at the top
      return;
    }
    const double flat = cutter.radius - cutter.corner_radius;
    add(flat, {0.0, 0.0}, 0.0, 0.0);
    add(0.5 * pi * cutter.corner_radius, {flat, 0.0}, 0.0, cutter.corner_radius);
    add(cutter.flank_length - cutter.corner_radius, {cutter.radius, cutter.corner_radius}, 0.5 * pi,
        0.0);
  }

  const std::vector<OutlineSegment>& stretches() const { return stretches_; }
  double kappa(double at) const { return stretch(at).kappa_at(at); }
  /// (radius, height)
  Vector2d place(double at) const { return stretch(at).place(at); }

 private:
  void add(double length, const Vector2d& from, double kappa, double radius) {
    if (!(length > 0.0)) return;
    const double begin = stretches_.empty() ? 0.0 : stretches_.back().end;
    stretches_.push_back({begin, begin + length, from, kappa, radius});
  }
  void add(const OutlinePiece& piece) {
    const auto kappa = [](const Vector2d& normal) { return std::atan2(normal.x(), -normal.y()); };
    const double turn = kappa(piece.normal_to) - kappa(piece.normal_from);
    const double length = piece.is_arc ? piece.radius * turn : (piece.to - piece.from).norm();
    add(length, piece.from, kappa(piece.normal_from), piece.radius);
  }
  const OutlineSegment& stretch(double at) const {
    std::size_t i = stretches_.size() - 1;
    while (i > 0 && at < stretches_[i].begin) --i;
    return stretches_[i];
  }

  std::vector<OutlineSegment> stretches_;
};

/// Returns the positions along the outline between slices. Every line and arc begins a slice.
std::vector<double> borders(const Cutter& cutter, const EngagementOptions& options) {
  const CutterOutline outline(cutter);
  const double fine = 0.5 * pi * cutter.radius / options.slices_per_radius;
  std::vector<double> at{0.0};
  for (const OutlineSegment& one : outline.stretches()) {
    const double from = at.back();
    // 1e-12 of the radius: pieces of rounding make no slice
    if (!(one.end - from > 1e-12 * cutter.radius)) continue;
    const double longest = one.radius > 0.0
                               ? std::min(fine, 0.5 * pi * one.radius / fewest_in_corner)
                           : one.kappa > 0.0 ? std::min(fine, options.max_slice)
                                             : fine;
    // 1e-9: a whole number of slices must not become one more by rounding
    const int count = std::max(1, int(std::ceil((one.end - from) / longest - 1e-9)));
    for (int i = 1; i <= count; ++i) at.push_back(from + (one.end - from) * i / count);
  }
  return at;
}

EdgeSlice slice_between(const CutterOutline& outline, double from, double to) {
  const double middle = 0.5 * (from + to);
  const Vector2d place = outline.place(middle);
  return {place.y(), place.x(), to - from, outline.kappa(middle)};
}

/// Returns half of the arc, about the feed's direction, in which a slice faces the feed.
double facing(double kappa, const Vector3d& feed_t, double lateral) {
  // From n . feed > min_facing with n = (sin kappa cos delta, ., -cos kappa).
  const double needed = min_facing + (kappa == 0.5 * pi ? 0.0 : std::cos(kappa)) * feed_t.z();
  const double most = std::sin(kappa) * lateral;
  if (needed >= most) return 0.0;
  if (needed <= -most) return pi;
  return std::acos(needed / most);
}

/// The depth field over the cutter's surface, by angle from the feed and length along the outline.
class EngagedSlices {
 public:
  EngagedSlices(const Stock& stock, const Cutter& cutter, const Eigen::Isometry3d& T_wt,
                const EngagementOptions& options)
      : probe_(stock, T_wt),
        outline_(cutter),
        borders_(borders(cutter, options)),
        bins_(2 * ((options.angles + 1) / 2)),
        bin_(2.0 * pi / bins_),
        // depths are limited to 3 spacings outside, beyond which they carry only a sign
        margin_(3.0 * stock.spacing) {}

  Engagement engaged(const Vector3d& feed_t) {
    Engagement result;
    result.feed_t = feed_t;
    double lateral = feed_t.head<2>().norm();
    if (lateral < no_feed) lateral = 0.0;
    heading_ = lateral > 0.0 ? std::atan2(feed_t.y(), feed_t.x()) : 0.0;
    for (int k = -bins_ / 2; k <= bins_ / 2; ++k)
      directions_.emplace_back(std::cos(heading_ + k * bin_), std::sin(heading_ + k * bin_));
    const std::size_t n = borders_.size() - 1;
    result.slices.reserve(n + 64);
    std::vector<double> half(n);
    for (std::size_t i = 0; i < n; ++i) {
      result.slices.push_back(slice_between(outline_, borders_[i], borders_[i + 1]));
      half[i] = facing(result.slices[i].kappa, feed_t, lateral);
    }
    Level lower;
    for (std::size_t i = 0; i < n; ++i) {
      if (half[i] <= 0.0) {
        lower = {};
        continue;
      }
      if (lower.depths.empty()) lower = level(borders_[i], half[i]);
      const double wanted = std::max(half[i], i + 1 < n ? half[i + 1] : 0.0);
      widen(lower, half[i]);
      Level upper = level(borders_[i + 1], wanted);
      add_slice(int(i), half[i], lower, upper, result);
      lower = std::move(upper);
    }
    return result;
  }

 private:
  /// The depths at the borders of bins -count .. count about the feed, at one position of the
  /// outline.
  struct Level {
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
    const Vector2d place = outline_.place(at);
    return probe_.depth({place.x() * std::cos(heading_ + angle),
                         place.x() * std::sin(heading_ + angle), place.y()});
  }

  int bins_for(double half) const {
    return std::min(bins_ / 2, int(std::ceil(half / bin_ - 1e-9)));
  }

  Level level(double at, double half) {
    Level result{at, bins_for(half), {}};
    result.depths.resize(std::size_t(2 * result.count + 1));
    const Vector2d place = outline_.place(at);
    for (int k = -result.count; k <= result.count; ++k) {
      const Vector2d& direction = directions_[std::size_t(k + bins_ / 2)];
      result.depths[std::size_t(k + result.count)] =
          probe_.depth({place.x() * direction.x(), place.x() * direction.y(), place.y()});
    }
    return result;
  }

  void widen(Level& level, double half) {
    if (bins_for(half) > level.count) level = this->level(level.at, half);
  }

  void add_slice(int slice, double half, const Level& lower, const Level& upper,
                 Engagement& result) {
    const int count = bins_for(half);
    double begun = 0.0;
    bool open = false;
    const auto close = [&](double to) {
      if (open && to > begun) add_arc(slice, begun, to, result);
      open = false;
    };
    for (int k = -count; k < count; ++k) {
      const double from = std::max(-half, k * bin_), to = std::min(half, (k + 1) * bin_);
      const double d[4] = {lower.depth(k), lower.depth(k + 1), upper.depth(k), upper.depth(k + 1)};
      const bool all = d[0] > 0.0 && d[1] > 0.0 && d[2] > 0.0 && d[3] > 0.0;
      if (all) {
        if (!open) begun = from;
        open = true;
        continue;
      }
      if (!(d[0] > 0.0 || d[1] > 0.0 || d[2] > 0.0 || d[3] > 0.0)) {
        close(from);
        continue;
      }
      const Region region = in_material(k, lower, upper, d);
      const bool whole_length =
          region.area >= (1.0 - 1e-6) * (region.to - region.from) * (upper.at - lower.at);
      const double at = std::max(from, region.from), end = std::min(to, region.to);
      if (!whole_length) {
        close(from);
        add_part(region, at, end, result);
      } else if (d[0] > 0.0) {  // it continues from the bin before and ends here
        if (!open) begun = from;
        open = true;
        close(end);
      } else {
        close(from);
        begun = at;
        open = true;
      }
    }
    close(half);
  }

  void add_arc(int slice, double from, double to, Engagement& result) const {
    result.arcs.push_back({slice, heading_ + from, heading_ + to});
  }

  /// Adds the region as a slice of its own, with its average length over its angles.
  void add_part(const Region& region, double from, double to, Engagement& result) const {
    const double width = region.to - region.from;
    if (!(to > from) || !(width > 0.0)) return;
    const double length = region.area / width;
    const double middle = 0.5 * (region.low + region.high);
    if (!(length > 0.0)) return;
    const EdgeSlice part = slice_between(outline_, middle - 0.5 * length, middle + 0.5 * length);
    result.slices.push_back(part);
    add_arc(int(result.slices.size()) - 1, from, to, result);
  }

  /// Returns the part of a bin of a slice that is in material: the polygon of the corners in
  /// material and the points between them where the skin crosses the sides.
  Region in_material(int bin, const Level& lower, const Level& upper, const double* d) {
    const double left = bin * bin_, right = (bin + 1) * bin_;
    const std::array<Corner, 4> corners{Corner{left, lower.at, d[0]}, Corner{right, lower.at, d[1]},
                                        Corner{right, upper.at, d[3]},
                                        Corner{left, upper.at, d[2]}};
    std::array<Vector2d, 8> polygon;
    std::size_t count = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const Corner& a = corners[k];
      const Corner& b = corners[(k + 1) % 4];
      if (a.depth > 0.0) polygon[count++] = {a.angle, a.at};
      if ((a.depth > 0.0) != (b.depth > 0.0)) polygon[count++] = skin(a, b);
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

  /// Returns the point where the skin passes between two points of the cutter, always searched from
  /// the one in material, so that neighbouring bins find the same point.
  Vector2d skin(const Corner& a, const Corner& b) {
    const bool a_in = a.depth > 0.0;
    const Corner& inner = a_in ? a : b;
    const Corner& outer = a_in ? b : a;
    const Vector2d from(inner.angle, inner.at), to(outer.angle, outer.at);
    const double reach = std::abs(to.x() - from.x()) + std::abs(to.y() - from.y());
    double in = 0.0, out = 1.0;
    double depth_in = inner.depth, depth_out = std::max(outer.depth, -margin_);
    double x = 0.0;
    for (int i = 0; i < 50; ++i) {
      // Illinois method: a secant that halves the value of an end that is kept.
      x = in + (out - in) * depth_in / (depth_in - depth_out);
      const Vector2d place = from + x * (to - from);
      const double here = std::max(depth(place.x(), place.y()), -margin_);
      if (std::abs(here) < 1e-10 || (out - in) * reach < end_angle) break;
      if (here > 0.0) {
        if (x - in < 0.5 * (out - in)) depth_out *= 0.5;
        in = x;
        depth_in = here;
      } else {
        if (out - x < 0.5 * (out - in)) depth_in *= 0.5;
        out = x;
        depth_out = here;
      }
    }
    return from + x * (to - from);
  }

  DepthProbe probe_;
  CutterOutline outline_;
  std::vector<double> borders_;
  int bins_;
  double bin_;  // rad
  double margin_;
  double heading_ = 0.0;              // rad, of the feed across the axis
  std::vector<Vector2d> directions_;  // of the borders of bins, in frame t
};

}  // namespace

std::vector<EdgeSlice> slices(const Cutter& cutter, const EngagementOptions& options) {
  check(cutter, options);
  const CutterOutline outline(cutter);
  const std::vector<double> at = borders(cutter, options);
  std::vector<EdgeSlice> result;
  for (std::size_t i = 0; i + 1 < at.size(); ++i)
    result.push_back(slice_between(outline, at[i], at[i + 1]));
  return result;
}

Engagement engagement(const Stock& stock, const Cutter& cutter, const Eigen::Isometry3d& T_wt,
                      const Vector3d& feed_w, const EngagementOptions& options) {
  check(cutter, options);
  const double feed = feed_w.norm();
  if (!T_wt.matrix().allFinite() || !std::isfinite(feed))
    throw std::invalid_argument("engagement: expected a finite pose and feed");
  if (!(feed > 0.0)) throw std::invalid_argument("engagement: expected a feed that is not zero");
  const Vector3d feed_t = T_wt.linear().transpose() * (feed_w / feed);
  return EngagedSlices(stock, cutter, T_wt, options).engaged(feed_t);
}

}  // namespace abbe::cutting
